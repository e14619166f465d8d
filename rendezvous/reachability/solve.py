"""Solution of a problem: minimum terminal norm, all controls that attain it, and sets of states."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass
from enum import Enum
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from infoset.rendezvous._arrays import Floats
from infoset.rendezvous.reachability.admissible import Lifted, Maximiser, joined
from infoset.rendezvous.reachability.optimum import BlockOptimum, block_optimum, block_reaches_zero
from infoset.rendezvous.reachability.problem import ReachabilityProblem, ThrustShape
from infoset.rendezvous.reachability.sets import (
    BlockSets,
    LiftedSets,
    ReachableSets,
    SetKind,
    ThinSetError,
    TooManyVerticesError,
    exact_sets,
    optimal_set,
)

MAX_STATES = 4
"""Maximum number of states of a block for which the exact route is tried: the (x, y) block of
relative motion has four. Hulls of six coupled states took seconds and rounding decided some."""
MAX_EXACT_PERIODS = 16
"""Maximum number of periods for which the exact route is tried. Chosen: more
periods give more vertices than are of use."""
AGREEMENT = 1e-9
"""Maximum difference between the bounds of both routes, relative to the bounds on states: the
violation of a constraint that the programs may have (`conic.MAX_VIOLATION`)."""
_STILL = 1e-12
"""Change of a control over the set, as a part of its bound, below which it is rounding. Chosen:
published problems have the same controls from 1e-14 to 1e-10 (measured)."""


class Route(Enum):
    """Representation of sets: vertices and facets (exact), or programs over controls (lifted)."""

    EXACT = "exact"
    LIFTED = "lifted"


@dataclass(frozen=True, eq=False)
class OptimalControls:
    """The set {u: |x(T)| is minimal and u satisfies all constraints}, from the blocks.

    It is a polytope for thrust in a box.
    """

    problem: ReachabilityProblem
    blocks: tuple[BlockOptimum, ...]

    @cached_property
    def space(self) -> Lifted:
        """The set in coordinates z of its affine hull; controls divided by their bounds."""
        return joined(
            [part.optimal for part in self.blocks],
            [part.block.controls for part in self.blocks],
            self.problem.periods,
            self.problem.controls,
        )

    @property
    def centre(self) -> Floats:
        """A point far from the boundary of `space`, shape (dimension,)."""
        return np.concatenate([part.centre for part in self.blocks])

    @property
    def scale(self) -> Floats:
        """Units of the controls: their bounds, shape (T m,)."""
        return np.tile(self.problem.control_bounds, self.problem.periods)

    @property
    def dimension(self) -> int:
        """Dimension of the set; 0 where the optimal control is unique."""
        return sum(part.optimal.size for part in self.blocks)

    @property
    def miss(self) -> float:
        """The minimum terminal norm, in the units of the problem."""
        return float(np.linalg.norm([part.miss for part in self.blocks]))

    def at(self, point: Floats) -> Floats:
        """Return the controls, shape (..., T, m), of a `point` z, shape (..., dimension)."""
        scaled = self.space.control_free + np.asarray(point) @ self.space.control_response.T
        shape = (*np.shape(point)[:-1], self.problem.periods, -1)
        return np.asarray((scaled * self.scale).reshape(shape))

    def excess(self, controls: ArrayLike) -> Floats:
        """Return the deviation of `controls`, shape (..., T, m), from the set, shape (...).

        It is the larger of the maximum violation of a constraint and the distance of the terminal
        state from the optimal one, relative to the bounds. For members of the set it is at most
        rounding.
        """
        thrust = np.asarray(controls, dtype=float)
        best = np.zeros(self.problem.states)
        for part in self.blocks:
            best[part.block.states] = part.terminal * part.block.scale

        last = self.problem.run(thrust)[..., -1, :]
        away = (np.abs(last - best) / self.problem.state_bounds).max(axis=-1)
        return np.asarray(np.maximum(self.problem.excess(thrust), away))

    def ranges(self) -> Floats:
        """Return the minimum and maximum of each control over the set, shape (T, m, 2).

        They are found by at most 2 T m linear programs, or cone programs for thrust in a ball.
        """
        periods = self.problem.periods
        result = np.zeros((periods, self.problem.controls, 2))
        for part in self.blocks:
            lifted = optimal_set(part)
            costs = np.vstack([-lifted.control_response, lifted.control_response])
            moving = np.abs(costs).max(axis=1, initial=0.0) > _STILL

            points = Maximiser(lifted).maximise_all(costs[moving])
            best = np.zeros(len(costs))
            best[moving] = np.einsum("kp,kp->k", costs[moving], points)

            # `down` are maxima of minus the change of a control: minima with the opposite sign.
            down, up = np.split(best, 2)
            ends = np.stack([lifted.control_free - down, lifted.control_free + up], axis=-1)
            result[:, part.block.controls] = ends.reshape(periods, -1, 2)
        return result * self.problem.control_bounds[:, None]


@dataclass(frozen=True, eq=False)
class Solution:
    """The solution of a problem: all controls of minimum terminal norm, forward sets and the tube.

    The `route` is EXACT if the vertices and facets of all blocks are known; `reason` explains the
    choice of the route.
    """

    problem: ReachabilityProblem
    optimal: OptimalControls
    sets: ReachableSets
    route: Route
    reason: str


def optimal_controls(problem: ReachabilityProblem, *, relative: bool = False) -> OptimalControls:
    """Return all controls of minimum terminal norm.

    `relative` and the errors that are raised are described in `block_optimum`.
    """
    optima = [block_optimum(block, relative=relative) for block in problem.blocks]
    return OptimalControls(problem, tuple(optima))


def solve(problem: ReachabilityProblem) -> Solution:
    """Compute the minimum terminal norm, all optimal controls, the forward sets and the tube.

    The route is exact if blocks and their number of periods are small, thrust is in a box,
    constraints apply at whole periods only, and rounding does not decide; otherwise it is lifted.
    `EmptyTubeError` is raised if no control satisfies the constraints.
    """
    optimal = optimal_controls(problem)
    lifted = tuple(LiftedSets(optimum) for optimum in optimal.blocks)

    reason = _refusal(problem)
    if not reason:
        try:
            exact = tuple(exact_sets(optimum) for optimum in optimal.blocks)
            _need_agreement(exact, lifted)
        except (TooManyVerticesError, ThinSetError) as error:
            reason = str(error)
        else:
            sizes = ", ".join(str(block.size) for block in problem.blocks)
            sets = ReachableSets(problem, exact)
            return Solution(problem, optimal, sets, Route.EXACT, f"blocks of {sizes} states")
    return Solution(problem, optimal, ReachableSets(problem, lifted), Route.LIFTED, reason)


def _need_agreement(exact: tuple[BlockSets, ...], lifted: tuple[BlockSets, ...]) -> None:
    """Raise `ThinSetError` if the bounds of exact sets differ from the results of programs."""
    for one, other in zip(exact, lifted, strict=True):
        for kind in SetKind:
            apart = float(np.abs(one.bounds(kind) - other.bounds(kind)).max())
            if apart > AGREEMENT:
                raise ThinSetError(
                    f"{kind.value} sets from hulls and from programs differ by {apart:.2g} of a "
                    "bound"
                )


def _refusal(problem: ReachabilityProblem) -> str:
    """Return the reason why exact sets are not computed; empty if there is none."""
    if problem.thrust is ThrustShape.BALL:
        return "for thrust in a ball the sets are not polytopes"
    if problem.between is not None:
        return "constraints within periods couple states and controls"
    if len(problem.limits[0]):
        return "exact sets are computed for controls in a box without further limits"
    largest = max(block.size for block in problem.blocks)
    if largest > MAX_STATES:
        return f"the constraints couple {largest} states; exact sets have at most {MAX_STATES}"
    if problem.periods > MAX_EXACT_PERIODS:
        return f"exact sets are computed for at most {MAX_EXACT_PERIODS} periods"
    return ""


def min_periods(problem: ReachabilityProblem) -> int | None:
    """Return the minimum number of periods in which zero can be reached, at most T, or None.

    If the zero state and the zero control satisfy all constraints, zero can be held, and the
    minimum number is computed by bisection; otherwise all numbers are tried, in ascending order,
    up to the first that reaches zero. Each block and number needs the programs of
    `block_reaches_zero`.

    Raises
    ------
    NoSolutionError
        If a minimum norm was not solved to its accuracy.
    """

    def reached(periods: int) -> bool:
        return all(block_reaches_zero(block.first(periods)) for block in problem.blocks)

    can_stay_at_zero = all(
        (block.offsets >= 0.0).all() and (block.control_offsets >= 0.0).all()
        for block in problem.blocks
    )
    if not can_stay_at_zero:
        numbers = range(1, problem.periods + 1)
        return next((periods for periods in numbers if reached(periods)), None)
    if not reached(problem.periods):
        return None
    return 1 + bisect_left(range(1, problem.periods), True, key=reached)
