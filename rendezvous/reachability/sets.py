"""Forward sets and the tube of a problem: exact polytopes, or programs over admissible controls."""

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
from infoset.rendezvous.reachability.problem import ReachabilityProblem, StateBlock

MAX_VERTICES = 1000
"""Maximum number of vertices of an exact set: a step with so many takes seconds."""
_MAX_DIMENSIONS = 8
"""Maximum dimension of a set of optimal controls whose vertices are computed. Six periods of the
(x, y) block have 12 controls and four terminal equations; larger sets have too many vertices."""
_FEW_CONTROLS = 24
"""Number of controls up to which dense programs over controls alone are faster than sparse ones
over controls and states. Chosen: both have the same solutions."""
_AT_BOUND = 1.0 - 1e-10
"""Part of its bound from which a state of the tube counts as at its bound, so that no program is
solved: ten times below `solve.AGREEMENT`, to which the bounds of sets are checked."""
_SHARP = 1e-7
"""Tolerance of a projection up to which its vertices are moved onto their active rows: the duality
gaps of the programs, at most 1e-8, are not small beside a smaller tolerance."""
_GAP = 1e-3
"""Maximum duality gap of the programs of a projection, as a part of its tolerance: it does not
affect the vertices at the precision of a figure."""


class SetKind(Enum):
    """States at a time on paths of admissible controls (forward), or of optimal controls (tube)."""

    FORWARD = "forward"
    TUBE = "tube"


class TooManyVerticesError(ValueError):
    """A set has too many vertices, or none because thrust is in a ball."""


class ThinSetError(ArithmeticError):
    """An exact set is so thin that rounding decides about it."""


@dataclass(frozen=True)
class VertexCounts:
    """Size and dimension of a polytope, the product of one polytope per block."""

    vertices: int
    facets: int
    dimension: int


@dataclass(frozen=True, eq=False)
class ReachableSets:
    """Sets of states at t = 0..T, in the units of the problem.

    A set is the product of the sets of the blocks, in `parts`.
    """

    problem: ReachabilityProblem
    parts: tuple[BlockSets, ...]

    def bounds(self, kind: SetKind) -> Floats:
        """Return the minimum and maximum of each state in the sets of a `kind`, (T + 1, n, 2)."""
        result = np.zeros((self.problem.periods + 1, self.problem.states, 2))
        for block, part in zip(self.problem.blocks, self.parts, strict=True):
            result[:, block.states] = part.bounds(kind) * block.scale[:, None]
        return result

    def counts(self, kind: SetKind, time: int) -> VertexCounts | None:
        """Return the counts of the set of a `kind` at a `time`; None if vertices are not known."""
        vertices = 1
        facets = 0
        dimension = 0
        for part in self.parts:
            polytope = part.polytope(kind, time)
            if polytope is None:
                return None
            vertices *= len(polytope.vertices)
            facets += len(polytope.normals)
            dimension += polytope.dimension
        return VertexCounts(vertices, facets, dimension)

    def projection(
        self, kind: SetKind, time: int, axes: Sequence[int], tolerance: float = 1e-9
    ) -> Floats:
        """Return the vertices of the projection of a set on some states, shape (v, len(axes)).

        `axes` are indices of two or three states, `time` is from 0 to T, and `tolerance` is the
        relative error of the projection of a set that is represented by programs. The vertices are
        in no order.
        """
        order: list[int] = []
        points = []
        for block, part in zip(self.problem.blocks, self.parts, strict=True):
            states = block.states.tolist()
            places = [states.index(axis) for axis in axes if axis in states]
            if not places:
                continue
            rows = np.eye(block.size)[places]
            scaled = part.projection(kind, time, rows, tolerance)
            points.append(scaled * block.scale[places])
            order += [states[place] for place in places]

        return combined(points)[:, [order.index(axis) for axis in axes]]


def combined(parts: Sequence[Floats]) -> Floats:
    """Return all combinations of one row of each array, side by side."""
    rows = np.zeros((1, 0))
    for part in parts:
        rows = np.hstack([np.repeat(rows, len(part), axis=0), np.tile(part, (len(rows), 1))])
    return rows


@dataclass(frozen=True, eq=False)
class ExactSets:
    """Sets of a block with all vertices and facets, for thrust in a box.

    Constraints apply at whole periods only.
    """

    forward: tuple[Polytope, ...]
    tube: tuple[Polytope, ...]

    def polytope(self, kind: SetKind, time: int) -> Polytope:
        """Return the set itself."""
        sets = self.forward if kind is SetKind.FORWARD else self.tube
        return sets[time]

    def bounds(self, kind: SetKind) -> Floats:
        """Return the minimum and maximum of each state at each time, shape (T + 1, n, 2)."""
        boxes = [self.polytope(kind, time).bounding_box() for time in range(len(self.forward))]
        return np.array([np.stack(box, axis=-1) for box in boxes])

    def projection(self, kind: SetKind, time: int, rows: Floats, tolerance: float = 1e-9) -> Floats:
        """Return the vertices of the image of a set under a matrix, shape (d, n), of few rows."""
        return self.polytope(kind, time).linear_map(rows).vertices


def exact_sets(optimum: BlockOptimum) -> ExactSets:
    """Compute the sets of a block with their vertices and facets.

    Raises
    ------
    TooManyVerticesError
        If a set has more than 1000 vertices.
    ThinSetError
        If a set is so thin that rounding leaves nothing of it.
    """
    try:
        forward = _forward_sets(optimum.block)
        if optimum.reached:
            return ExactSets(forward, _tube_to_zero(optimum.block, forward))
        return ExactSets(forward, _image_of_controls(optimum))
    except EmptyPolytopeError as error:  # the programs show that it is not empty
        raise ThinSetError("a set is too thin: it is empty by rounding") from error


def _forward_sets(block: StateBlock) -> tuple[Polytope, ...]:
    """Shorikov and Goranov (2021): G+(t + 1) = (A G+(t) + B U) cut by the constraints."""
    sets = [Polytope.from_vertices(block.initial[None, :])]
    for t in range(block.periods):
        if block.jump is not None:
            reached = _after_impulse(block, sets[-1], block.jump, t).linear_map(block.transition[t])
        else:
            reached = _with_thrust(sets[-1].linear_map(block.transition[t]), block.control[t])
        sets.append(reached.cut(block.normals, upper=block.offsets[t + 1]).needed())
    return tuple(sets)


def _after_impulse(block: StateBlock, states: Polytope, jump: Floats, time: int) -> Polytope:
    """The states just after the impulse at a time, for a set of states before it."""
    return _with_thrust(states, jump).cut(block.normals, upper=block.offsets[time]).needed()


def _tube_to_zero(block: StateBlock, forward: tuple[Polytope, ...]) -> tuple[Polytope, ...]:
    """The states x of G+(t) with A x + B u in the tube at t + 1 for some u, back from zero.

    A x is in the tube minus B U, whose half-spaces need no inverse of A. With impulses, x + jump u
    is in the set of the states after the impulse that A moves into the tube.
    """
    tube = [Polytope.from_vertices(np.zeros((1, block.size)))]
    for t in range(block.periods - 1, 0, -1):
        if block.jump is not None:
            rows, limits = tube[0].constraints()
            after = _after_impulse(block, forward[t], block.jump, t)
            leading = after.cut(rows @ block.transition[t], upper=limits).needed()
            rows, limits = _with_thrust(leading, block.jump).constraints()
            tube.insert(0, forward[t].cut(rows, upper=limits).needed())
        else:
            rows, limits = _with_thrust(tube[0], block.control[t]).constraints()
            tube.insert(0, forward[t].cut(rows @ block.transition[t], upper=limits).needed())
    return (forward[0], *tube)


def _image_of_controls(optimum: BlockOptimum) -> tuple[Polytope, ...]:
    """The tube as the image of the optimal controls.

    Where zero is not reached the tube is a face of G+, which rounding would lose.
    """
    optimal = optimum.optimal
    if not optimal.size:
        return tuple(Polytope.from_vertices(state[None]) for state in optimal.free)
    controls = optimal_polytope(optimum)
    return tuple(
        controls.affine_map(response, free)
        for response, free in zip(optimal.response, optimal.free, strict=True)
    )


def _with_thrust(states: Polytope, control: Floats) -> Polytope:
    """The set of x + B u, |u_j| <= 1."""
    for half in control.T:
        states = states.add_segment(half)
        if len(states.vertices) > MAX_VERTICES:
            raise TooManyVerticesError(f"an exact set has more than {MAX_VERTICES} vertices")
    return states


def optimal_polytope(optimum: BlockOptimum) -> Polytope:
    """Return the set of optimal controls of a block in its coordinates z, at least one.

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
        """Return the minimum and maximum of each state at each time, shape (T + 1, n, 2)."""
        if kind is SetKind.FORWARD:
            return self._forward_bounds()
        return self._tube_bounds()

    def _forward_bounds(self) -> Floats:
        block = self._optimum.block
        result = np.zeros((block.periods + 1, block.size, 2))
        result[0] = block.initial[:, None]
        for t in range(1, block.periods + 1):
            lifted, program = self._set(SetKind.FORWARD, t)
            response = lifted.response[t]
            for side, sign in enumerate((-1.0, 1.0)):
                points = program.maximise_all(sign * response)
                result[t, :, side] = lifted.free[t] + np.einsum("ip,ip->i", response, points)
        return result

    def _tube_bounds(self) -> Floats:
        """Return the minimum and the maximum of each state at each time, shape (T + 1, n, 2).

        A state that is at its bound on a path found before needs no program.
        """
        block = self._optimum.block
        lifted, program = self._set(SetKind.TUBE, block.periods)
        # Maxima of -x and of x over the paths found so far.
        best = np.full((block.periods + 1, block.size, 2), -np.inf)
        for t in sorted(range(1, block.periods), key=_by_power_of_two):
            for i in range(block.size):
                for side, sign in enumerate((-1.0, 1.0)):
                    if best[t, i, side] >= _AT_BOUND:
                        continue
                    point = program.maximise(sign * lifted.response[t, i])
                    states = lifted.free + lifted.response @ point
                    best[t, i, side] = sign * states[t, i]
                    np.maximum(best, np.stack([-states, states], axis=-1), out=best)

        result = np.stack([-best[..., 0], best[..., 1]], axis=-1)
        result[0] = block.initial[:, None]
        result[block.periods] = self._optimum.terminal[:, None]
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
                point = program.maximise(cost, max(MAX_GAP, _GAP * tolerance))
            else:
                point = program.maximise_sharply(cost)
            return np.asarray(free + response @ point)

        return polytope_from_support(furthest, len(rows), tolerance).vertices

    def polytope(self, kind: SetKind, time: int) -> Polytope | None:
        """Return None: the vertices are not known."""
        return None

    def _set(self, kind: SetKind, time: int) -> tuple[Lifted, Maximiser]:
        """The controls whose states at `time` are the set; all times of the tube share them."""
        key = (kind, 0) if kind is SetKind.TUBE else (kind, time)
        if key not in self._known:
            if kind is SetKind.TUBE:
                lifted = optimal_set(self._optimum)
            else:
                lifted = self._admissible_until(time)
            self._known[key] = lifted, Maximiser(lifted)
        return self._known[key]

    def _admissible_until(self, time: int) -> Lifted:
        """Return the admissible controls of the first `time` >= 1 periods; no other one matters."""
        block = self._optimum.block.first(time)
        if block.periods * len(block.controls) <= _FEW_CONTROLS:
            return lift(block)
        return lift_with_states(block)


def _by_power_of_two(time: int) -> tuple[int, int]:
    """Key of an order that starts with multiples of the largest power of two.

    The first times of the order are evenly spread, so their paths soon reach most bounds.
    """
    return -(time & -time), time


BlockSets = ExactSets | LiftedSets
"""Sets of states of a block at t = 0..T, divided by the bounds on states."""


def optimal_set(optimum: BlockOptimum) -> Lifted:
    """Return the optimal controls of a block in variables for which linear programs are fast."""
    if optimum.optimal.size <= _FEW_CONTROLS or not optimum.reached:
        return optimum.optimal
    lifted = lift_with_states(optimum.block)
    return lifted.where(lifted.response[-1], -lifted.free[-1])
