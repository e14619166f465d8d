"""Forward sets and the tube of a problem: exact polytopes, or programs over the admissible controls."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from time import perf_counter

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from infoset.geometry.polytope import Polytope, polytope_from_support
from rendezvous._arrays import Floats
from rendezvous.reachability.admissible import Lifted, Maximiser, lift, lift_with_states
from rendezvous.reachability.conic import MAX_GAP
from rendezvous.reachability.optimum import BlockOptimum
from rendezvous.reachability.problem import ReachabilityProblem

MAX_SECONDS, MAX_MEGABYTES, MAX_DIMENSION = 5.0, 500.0, 6
"""Limits of the exact route: the computing time of all blocks, the memory for one step, and the states of a block."""
_FEW_CONTROLS = 24
_TOGETHER = 1e-7
_AT_BOUND = 1.0 - 1e-10
_SHARP = 1e-7
_GAP = 1e-3
"""Maximum duality gap of the programs of a projection, as a part of its tolerance."""


class SetKind(Enum):
    """Set of states at a time: those on paths of admissible controls (forward), or of optimal controls (tube)."""

    FORWARD = "forward"
    TUBE = "tube"


class TooLargeError(ArithmeticError):
    """The exact route would exceed its limits."""


@dataclass(frozen=True)
class SetCounts:
    """Size and dimension of a polytope: `facets` are those of all blocks.

    Vertices nearer to each other than 1e-7 of the bounds count once.
    """

    vertices: int
    facets: int
    dimension: int


@dataclass(frozen=True, eq=False)
class ReachableSets:
    """Sets of states at t = 0..T, in the units of the problem; `parts` are those of each block of the problem."""

    problem: ReachabilityProblem
    parts: tuple[BlockSets, ...]

    def bounds(self, kind: SetKind) -> Floats:
        """Return the minimum and maximum value of each state at each time, shape (T + 1, n, 2), of sets of a `kind`."""
        result = np.zeros((self.problem.periods + 1, self.problem.states, 2))
        for block, part in zip(self.problem.blocks, self.parts, strict=True):
            result[:, block.states] = part.bounds(kind) * block.scale[:, None]
        return result

    def support(self, kind: SetKind, time: int, directions: Floats) -> Floats:
        """Return the maximum of direction . x over the set of a `kind` at a `time`, shape (k,).

        `directions`, shape (k, n), are such that direction . x is taken in the units of the problem.
        """
        total = np.zeros(len(directions))
        for block, part in zip(self.problem.blocks, self.parts, strict=True):
            total += part.support(kind, time, directions[:, block.states] * block.scale)
        return total

    def counts(self, kind: SetKind, time: int) -> SetCounts | None:
        """Return the counts of the set of a `kind` at a `time`; None if its vertices are not known."""
        sets = [polytope for part in self.parts if (polytope := part.polytope(kind, time)) is not None]
        if len(sets) < len(self.parts):
            return None
        return SetCounts(
            int(np.prod([essential_vertices(polytope.vertices) for polytope in sets])),
            sum(len(polytope.normals) for polytope in sets),
            sum(polytope.dimension for polytope in sets),
        )

    def projection(self, kind: SetKind, time: int, axes: Sequence[int], tolerance: float = 1e-9) -> Floats:
        """Return the vertices of the projection of a set on two or three states, shape (v, len(axes)), in no order.

        `axes` are indices of states, `time` is from 0 to T, and `tolerance` is the relative error of the projection of
        a set that is represented by programs.
        """
        order: list[int] = []
        points = np.zeros((1, 0))
        for block, part in zip(self.problem.blocks, self.parts, strict=True):
            mine = [int(np.flatnonzero(block.states == axis)[0]) for axis in axes if axis in block.states]
            if not mine:
                continue
            order += [int(block.states[index]) for index in mine]
            scaled = part.projection(kind, time, np.eye(block.size)[mine], tolerance).vertices * block.scale[mine]
            points = np.hstack([np.repeat(points, len(scaled), axis=0), np.tile(scaled, (len(points), 1))])
        return points[:, [order.index(axis) for axis in axes]]


class Meter:
    """Measures the computing time of hulls, and raises an error before a hull that is expected to exceed a limit.

    The time for k points in R^d is taken to grow as k^(d/2), and the memory of the check as vertices times facets.
    Both are extrapolated from the last hull of that dimension, or from values of a slow machine for the first hull.
    """

    def __init__(self) -> None:
        # The time that Numba needs to compile the kernels does not count.
        unit = Polytope.from_vertices(np.vstack([np.zeros(3), np.eye(3)]))
        _ = (unit + 0.5 * unit).cut(np.eye(3), 0.0, 0.7).intersection(unit).preimage(np.eye(3))
        self._began_s = perf_counter()
        self._last: dict[int, tuple[int, float, int]] = {}

    def hull(self, points: Floats) -> Polytope:
        """Return the hull of points, shape (k, n); `TooLargeError` is raised where it would exceed a limit."""
        count, size = points.shape
        if size > 2:
            self._check(count, size)
        began_s = perf_counter()
        hull = Polytope.from_vertices(points)
        self._last[size] = (count, perf_counter() - began_s, len(hull.normals))
        return hull

    def _check(self, count: int, size: int) -> None:
        power = max(1.0, size / 2.0)
        last_count, last_s, facets = self._last.get(size, (1000, 0.02 * 4.0 ** (size - 2), 50 * 4 ** (size - 2)))
        growth = (count / last_count) ** power
        expected_s = perf_counter() - self._began_s + growth * last_s
        expected_mb = 1e-6 * growth * facets * (8.0 * count + 4.0 * growth * facets)
        for expected, most, unit in (
            (expected_s, MAX_SECONDS, "s"),
            (expected_mb, MAX_MEGABYTES, "MB"),
        ):
            if expected > most:
                raise TooLargeError(
                    f"with a hull of {count} points in R^{size} the exact sets are expected to take {expected:.3g} "
                    f"{unit}, more than the limit of {most:g} {unit}"
                )


class ExactSets:
    """Sets of a block with all vertices and facets, for thrust in a box and constraints at whole periods only.

    Shorikov and Goranov (2021): G+(t + 1) = (A G+(t) + B U) cut by X; G-(t) = {x in X: A x in G-(t + 1) - B U}, whose
    half-spaces need no inverse of A; the tube is the intersection of both. Where zero is not reached the tube is a face
    of G+ that rounding would lose; it is then the image of the vertices of the optimal controls. The constructor raises
    `TooLargeError` if the block exceeds a limit, or a hull is expected to, and `UncertainHullError` if
    rounding decides which points are vertices of a set.
    """

    def __init__(self, optimum: BlockOptimum, meter: Meter) -> None:
        block = optimum.block
        if block.size > MAX_DIMENSION:
            raise TooLargeError(
                f"a block has {block.size} states, more than the limit of {MAX_DIMENSION} for exact sets"
            )
        self._optimum, self._meter = optimum, meter
        rows = np.vstack([np.eye(len(block.controls)), -np.eye(len(block.controls))])
        corners = np.zeros((1, 0))
        if len(rows):  # not `from_box`: the last digits of results depend on the order of these corners
            corners = Polytope.from_constraints(rows, np.ones(len(rows))).vertices
        forward = [Polytope.from_vertices(block.initial[None, :])]
        for t in range(block.periods):
            moved = forward[-1].vertices @ block.transition[t].T
            reached = meter.hull(_sums(moved, corners @ block.control[t].T))
            rows, ends = _finite(block.normals, block.offsets[t + 1])
            forward.append(reached.cut(rows, upper=ends).needed())
        tube = self._both_ways(corners, forward) if optimum.reached else self._of_controls()
        self._sets = {SetKind.FORWARD: forward, SetKind.TUBE: tube}

    def support(self, kind: SetKind, time: int, directions: Floats) -> Floats:
        """Return the support function along directions, shape (k, n), as an array of shape (k,)."""
        return self.polytope(kind, time).support_function(directions)

    def bounds(self, kind: SetKind) -> Floats:
        """Return the minimum and maximum value of each state at each time, shape (T + 1, n, 2)."""
        return np.array([np.stack(polytope.bounding_box(), axis=-1) for polytope in self._sets[kind]])

    def projection(self, kind: SetKind, time: int, rows: Floats, tolerance: float = 1e-9) -> Polytope:
        """Return the image of a set under a matrix, shape (d, n), of few rows."""
        return self.polytope(kind, time).linear_map(rows)

    def polytope(self, kind: SetKind, time: int) -> Polytope:
        """Return the set itself."""
        return self._sets[kind][time]

    def _both_ways(self, corners: Floats, forward: list[Polytope]) -> list[Polytope]:
        block = self._optimum.block
        backward = Polytope.from_vertices(np.zeros((1, block.size)))
        tube = [backward]
        for t in range(block.periods - 1, 0, -1):
            before = self._meter.hull(_sums(backward.vertices, -corners @ block.control[t].T))
            rows, ends = _finite(block.normals, block.offsets[t])
            backward = Polytope.from_constraints(
                np.vstack([before.normals @ block.transition[t], rows]),
                np.concatenate([before.offsets, ends]),
                before.across @ block.transition[t],
                before.levels,
            ).needed()
            tube.append(forward[t].intersection(backward).needed())
        return [forward[0], *reversed(tube)]

    def _of_controls(self) -> list[Polytope]:
        optimal = self._optimum.optimal
        corners = np.zeros((1, 0))
        if optimal.size:
            corners = Polytope.from_constraints(optimal.rows, optimal.limits).needed().vertices
        return [
            self._meter.hull(free + corners @ response.T)
            for free, response in zip(optimal.free, optimal.response, strict=True)
        ]


def essential_vertices(vertices: Floats) -> int:
    """Return the number of vertices; those within 1e-7 of each other in every coordinate count once."""
    # Scipy 1.11.0 looks for components among indices of 32 bits only.
    pairs = cKDTree(vertices).query_pairs(_TOGETHER, p=np.inf, output_type="ndarray").astype(np.int32)
    graph = csr_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(vertices), len(vertices)))
    return int(connected_components(graph, directed=False)[0])


def _sums(first: Floats, second: Floats) -> Floats:
    return np.asarray((first[:, None, :] + second[None, :, :]).reshape(-1, first.shape[1]))


def _finite(normals: Floats, offsets: Floats) -> tuple[Floats, Floats]:
    held = np.isfinite(offsets)
    return normals[held], offsets[held]


class LiftedSets:
    """Sets of a block, represented by programs over its admissible controls.

    Each direction needs a linear program, or a cone program for thrust in a ball. The only error is the tolerance of
    the programs, at most 1e-8 of the bounds. The variables are the controls; if there are many, states are variables
    too, because the rows are then sparse.
    """

    def __init__(self, optimum: BlockOptimum) -> None:
        self._optimum = optimum
        self._known: dict[tuple[SetKind, int], tuple[Lifted, Maximiser]] = {}

    def support(self, kind: SetKind, time: int, directions: Floats) -> Floats:
        """Return the support function along directions, shape (k, n), as an array of shape (k,)."""
        lifted, program = self._set(kind, time)
        costs = directions @ lifted.response[time]
        points = program.maximise_all(costs)
        return np.asarray(directions @ lifted.free[time] + np.einsum("kp,kp->k", costs, points))

    def bounds(self, kind: SetKind) -> Floats:
        """Return the minimum and maximum value of each state at each time, shape (T + 1, n, 2)."""
        size, periods = self._optimum.block.size, self._optimum.block.periods
        unit = np.eye(size)
        result = np.zeros((periods + 1, size, 2))
        result[0] = self._optimum.block.initial[:, None]
        if kind is SetKind.FORWARD:
            for t in range(1, periods + 1):
                ends = self.support(kind, t, np.vstack([-unit, unit])).reshape(2, size)
                result[t, :, 0], result[t, :, 1] = -ends[0], ends[1]
            return result
        # If a state on the path of an optimal control is at its bound, no program is needed.
        lifted, program = self._set(kind, periods)
        best = np.full((periods + 1, size, 2), -np.inf)
        # Multiples of the maximum powers of two first: any first part of the times is evenly spread.
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

    def projection(self, kind: SetKind, time: int, rows: Floats, tolerance: float = 1e-9) -> Polytope:
        """Return the image of a set under a matrix, shape (d, n), of few rows."""
        if time == 0:
            return Polytope.from_vertices((rows @ self._optimum.block.initial)[None, :])
        lifted, program = self._set(kind, time)
        free, response = rows @ lifted.free[time], rows @ lifted.response[time]

        def furthest(direction: Floats) -> Floats:
            cost = direction @ response
            if tolerance > _SHARP:
                return np.asarray(free + response @ program.maximise(cost, max(MAX_GAP, _GAP * tolerance)))
            return np.asarray(free + response @ program.maximise_sharply(cost))

        return polytope_from_support(furthest, len(rows), tolerance)

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
