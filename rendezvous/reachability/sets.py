"""Forward sets and the tube of a problem: exact polytopes, or programs over the admissible
controls.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np

from infoset.geometry.polytope import EmptyPolytopeError, Polytope, polytope_from_support
from infoset.rendezvous._arrays import Floats
from infoset.rendezvous.reachability.admissible import Lifted, Maximiser, lift, lift_with_states
from infoset.rendezvous.reachability.conic import MAX_GAP
from infoset.rendezvous.reachability.optimum import BlockOptimum
from infoset.rendezvous.reachability.problem import ReachabilityProblem

MAX_VERTICES = 1000
"""Vertices of an exact set: a step with so many takes seconds."""
_MAX_DIMENSIONS = 8
"""Dimensions of a set of optimal controls whose vertices are computed."""
_FEW_CONTROLS = 24
_AT_BOUND = 1.0 - 1e-10
_SHARP = 1e-7
_GAP = 1e-3
"""Maximum duality gap of the programs of a projection, as a part of its tolerance."""


class SetKind(Enum):
    """Set of states at a time: those on paths of admissible controls (forward), or of optimal
    controls (tube).
    """

    FORWARD = "forward"
    TUBE = "tube"


class TooManyVerticesError(ValueError):
    """A set has too many vertices, or none because thrust is in a ball."""


class ThinSetError(ArithmeticError):
    """An exact set is so thin that rounding decides about it."""


@dataclass(frozen=True)
class VertexCounts:
    """Size and dimension of a polytope; `facets` are those of all blocks."""

    vertices: int
    facets: int
    dimension: int


@dataclass(frozen=True, eq=False)
class ReachableSets:
    """Sets of states at t = 0..T, in the units of the problem; `parts` are those of each block of
    the problem.
    """

    problem: ReachabilityProblem
    parts: tuple[BlockSets, ...]

    def bounds(self, kind: SetKind) -> Floats:
        """Return the minimum and maximum value of each state at each time, shape (T + 1, n, 2), of
        sets of a `kind`.
        """
        result = np.zeros((self.problem.periods + 1, self.problem.states, 2))
        for block, part in zip(self.problem.blocks, self.parts, strict=True):
            result[:, block.states] = part.bounds(kind) * block.scale[:, None]
        return result

    def counts(self, kind: SetKind, time: int) -> VertexCounts | None:
        """Return the counts of the set of a `kind` at a `time`; None if its vertices are not
        known.
        """
        sets = [
            polytope for part in self.parts if (polytope := part.polytope(kind, time)) is not None
        ]
        if len(sets) < len(self.parts):
            return None
        return VertexCounts(
            int(np.prod([len(polytope.vertices) for polytope in sets])),
            sum(len(polytope.normals) for polytope in sets),
            sum(polytope.dimension for polytope in sets),
        )

    def projection(
        self, kind: SetKind, time: int, axes: Sequence[int], tolerance: float = 1e-9
    ) -> Floats:
        """Return the vertices of the projection of a set on two or three states, shape (v,
        len(axes)), in no order.

        `axes` are indices of states, `time` is from 0 to T, and `tolerance` is the relative error
        of the projection of a set that is represented by programs.
        """
        order: list[int] = []
        points = []
        for block, part in zip(self.problem.blocks, self.parts, strict=True):
            mine = [
                int(np.flatnonzero(block.states == axis)[0])
                for axis in axes
                if axis in block.states
            ]
            if not mine:
                continue
            order += [int(block.states[index]) for index in mine]
            points.append(
                part.projection(kind, time, np.eye(block.size)[mine], tolerance) * block.scale[mine]
            )
        return combined(points)[:, [order.index(axis) for axis in axes]]


def combined(parts: Sequence[Floats]) -> Floats:
    """Return all combinations of one row of each array, side by side."""
    rows = np.zeros((1, 0))
    for part in parts:
        rows = np.hstack([np.repeat(rows, len(part), axis=0), np.tile(part, (len(rows), 1))])
    return rows


@dataclass(frozen=True, eq=False)
class ExactSets:
    """Sets of a block with all vertices and facets, for thrust in a box and constraints at whole
    periods only.
    """

    forward: tuple[Polytope, ...]
    tube: tuple[Polytope, ...]

    def polytope(self, kind: SetKind, time: int) -> Polytope:
        """Return the set itself."""
        return (self.forward if kind is SetKind.FORWARD else self.tube)[time]

    def bounds(self, kind: SetKind) -> Floats:
        """Return the minimum and maximum value of each state at each time, shape (T + 1, n, 2)."""
        boxes = [self.polytope(kind, time).bounding_box() for time in range(len(self.forward))]
        return np.array([np.stack(box, axis=-1) for box in boxes])

    def projection(self, kind: SetKind, time: int, rows: Floats, tolerance: float = 1e-9) -> Floats:
        """Return the vertices of the image of a set under a matrix, shape (d, n), of few rows."""
        return self.polytope(kind, time).linear_map(rows).vertices


def exact_sets(optimum: BlockOptimum) -> ExactSets:
    """Compute the sets of a block with their vertices and facets.

    Shorikov and Goranov (2021): G+(t + 1) = (A G+(t) + B U) cut by X. The states of the tube X_e(t)
    are those of G+(t) with A x + B u in X_e(t + 1) for some u: A x is in X_e(t + 1) - B U, whose
    half-spaces need no inverse of A. Where zero is not reached the tube is a face of G+ that
    rounding would lose; it is then the image of the optimal controls.

    Raises
    ------
    TooManyVerticesError
        If a set has more than 1000 vertices.
    ThinSetError
        If a set is so thin that rounding leaves nothing of it.
    """
    block = optimum.block
    try:
        forward = [Polytope.from_vertices(block.initial[None, :])]
        for t in range(block.periods):
            reached = _with_thrust(forward[-1].linear_map(block.transition[t]), block.control[t])
            forward.append(reached.cut(block.normals, upper=block.offsets[t + 1]).needed())
        if not optimum.reached:
            if not optimum.optimal.size:
                return ExactSets(
                    tuple(forward),
                    tuple(Polytope.from_vertices(x[None]) for x in optimum.optimal.free),
                )
            controls = optimal_polytope(optimum)
            maps = zip(optimum.optimal.response, optimum.optimal.free, strict=True)
            return ExactSets(
                tuple(forward),
                tuple(controls.affine_map(response, free) for response, free in maps),
            )
        tube = [Polytope.from_vertices(np.zeros((1, block.size)))]
        for t in range(block.periods - 1, 0, -1):
            rows, limits = _with_thrust(tube[0], block.control[t]).constraints()
            tube.insert(0, forward[t].cut(rows @ block.transition[t], upper=limits).needed())
        return ExactSets(tuple(forward), (forward[0], *tube))
    except EmptyPolytopeError as error:  # the programs show that it is not empty
        raise ThinSetError("a set is too thin: it is empty by rounding") from error


def _with_thrust(states: Polytope, control: Floats) -> Polytope:
    """The set of x + B u, |u_j| <= 1."""
    for half in control.T:
        states = states.add_segment(half)
        if len(states.vertices) > MAX_VERTICES:
            raise TooManyVerticesError(f"an exact set has more than {MAX_VERTICES} vertices")
    return states


def optimal_polytope(optimum: BlockOptimum) -> Polytope:
    """Return the set of optimal controls of a block, in its coordinates z, of which there is at
    least one.

    Raises
    ------
    TooManyVerticesError
        If it has too many dimensions, or thrust is in a ball.
    ThinSetError
        If the set is so thin that rounding leaves nothing of it.
    """
    optimal = optimum.optimal
    if optimal.ball:
        raise TooManyVerticesError("with thrust in a ball the optimal controls have no vertices")
    if optimal.size > _MAX_DIMENSIONS:
        raise TooManyVerticesError(
            f"the optimal controls of a block span {optimal.size} dimensions, more than the limit "
            f"of {_MAX_DIMENSIONS} for vertices"
        )
    try:
        return Polytope.from_constraints(optimal.rows, optimal.limits).needed().bounded()
    except EmptyPolytopeError as error:  # the centre is inside
        raise ThinSetError(
            "the set of optimal controls of a block is too thin: it is empty"
        ) from error


class LiftedSets:
    """Sets of a block, represented by programs over its admissible controls.

    Each direction needs a linear program, or a cone program for thrust in a ball. The only error is
    the tolerance of the programs, at most 1e-8 of the bounds. The variables are the controls; if
    there are many, states are variables too, because the rows are then sparse.
    """

    def __init__(self, optimum: BlockOptimum) -> None:
        self._optimum = optimum
        self._known: dict[tuple[SetKind, int], tuple[Lifted, Maximiser]] = {}

    def bounds(self, kind: SetKind) -> Floats:
        """Return the minimum and maximum value of each state at each time, shape (T + 1, n, 2)."""
        size = self._optimum.block.size
        periods = self._optimum.block.periods
        result = np.zeros((periods + 1, size, 2))
        result[0] = self._optimum.block.initial[:, None]
        if kind is SetKind.FORWARD:
            for t in range(1, periods + 1):
                lifted, program = self._set(kind, t)
                response = lifted.response[t]
                for side, sign in enumerate((-1.0, 1.0)):
                    points = program.maximise_all(sign * response)
                    result[t, :, side] = lifted.free[t] + np.einsum("ip,ip->i", response, points)
            return result
        # If a state on the path of an optimal control is at its bound, no program is needed.
        lifted, program = self._set(kind, periods)
        best = np.full((periods + 1, size, 2), -np.inf)
        # Multiples of the maximum powers of two first: any first part of the times is evenly
        # spread.
        for t in sorted(range(1, periods), key=lambda t: (-(t & -t), t)):
            for i in range(size):
                for side, sign in enumerate((-1.0, 1.0)):
                    if best[t, i, side] < _AT_BOUND:
                        point = program.maximise(sign * lifted.response[t, i])
                        states = lifted.free + lifted.response @ point
                        best[t, i, side] = sign * states[t, i]
                        np.maximum(best, np.stack([-states, states], axis=-1), out=best)
        result[1:, :, 0], result[1:, :, 1] = -best[1:, :, 0], best[1:, :, 1]
        result[periods] = self._optimum.terminal[:, None]
        return result

    def projection(self, kind: SetKind, time: int, rows: Floats, tolerance: float = 1e-9) -> Floats:
        """Return the vertices of the image of a set under a matrix, shape (d, n), of few rows."""
        if time == 0:
            return np.asarray(rows @ self._optimum.block.initial)[None, :]
        lifted, program = self._set(kind, time)
        free = rows @ lifted.free[time]
        response = rows @ lifted.response[time]

        def furthest(direction: Floats) -> Floats:
            cost = direction @ response
            if tolerance > _SHARP:
                return np.asarray(
                    free + response @ program.maximise(cost, max(MAX_GAP, _GAP * tolerance))
                )
            return np.asarray(free + response @ program.maximise_sharply(cost))

        return polytope_from_support(furthest, len(rows), tolerance).vertices

    def polytope(self, kind: SetKind, time: int) -> Polytope | None:
        """Return None: the vertices are not known."""
        return None

    def _set(self, kind: SetKind, time: int) -> tuple[Lifted, Maximiser]:
        key = kind, 0 if kind is SetKind.TUBE else time
        if key not in self._known:
            if kind is SetKind.TUBE:
                lifted = optimal_set(self._optimum)
            else:
                block = self._optimum.block.first(max(time, 1))
                few = block.periods * len(block.controls) <= _FEW_CONTROLS
                lifted = lift(block) if few else lift_with_states(block)
            self._known[key] = lifted, Maximiser(lifted)
        return self._known[key]


BlockSets = ExactSets | LiftedSets
"""Sets of states of a block, at t = 0..T, scaled."""


def optimal_set(optimum: BlockOptimum) -> Lifted:
    """Return the optimal controls of a block in variables for which linear programs are fast."""
    if optimum.optimal.size <= _FEW_CONTROLS or not optimum.reached:
        return optimum.optimal
    lifted = lift_with_states(optimum.block)
    return lifted.where(lifted.response[-1], -lifted.free[-1])
