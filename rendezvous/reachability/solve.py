"""Which route a problem takes, and all that is found on it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from infoset.polytope import EmptyPolytopeError, UncertainHullError
from rendezvous.reachability.block_sets import BlockSets, SetKind
from rendezvous.reachability.blocks import Block, split
from rendezvous.reachability.exact_sets import Budget, ExactSets, Meter, TooLargeError
from rendezvous.reachability.lifted_sets import LiftedSets
from rendezvous.reachability.optimal_controls import OptimalControls
from rendezvous.reachability.optimum import BlockOptimum, block_optimum, block_reaches_zero
from rendezvous.reachability.problem import ReachabilityProblem, ThrustShape
from rendezvous.reachability.reachable_sets import ReachableSets

MOST_STATES_BY_CHOICE = 4
"""Blocks of more states than this are not tried on the exact route unless it is asked for."""
MOST_PERIODS_BY_CHOICE = 16
AGREEMENT = 1e-9
"""How far the bounds of both routes may be apart, relative to the bounds on states."""


class Route(Enum):
    """How sets of states are known: by all their vertices and facets, or by programs over the admissible controls."""

    EXACT = "exact"
    LIFTED = "lifted"


@dataclass(frozen=True, eq=False)
class Solution:
    """What there is to know of a problem.

    Parameters
    ----------
    problem : ReachabilityProblem
    optimal : OptimalControls
    sets : ReachableSets
    route : Route
        EXACT where every block has its vertices and facets.
    reason : str
        Why this route.
    """

    problem: ReachabilityProblem
    optimal: OptimalControls
    sets: ReachableSets
    route: Route
    reason: str


def solve(problem: ReachabilityProblem, route: Route | None = None, budget: Budget | None = None) -> Solution:
    """Find the least terminal norm, all controls that reach it, and the sets they lead through.

    Parameters
    ----------
    problem : ReachabilityProblem
    route : Route or None
        None leaves it to the solver: exact where blocks are small, thrust is in a box, constraints hold at whole
        periods and the sets are expected within the budget; lifted everywhere else.
    budget : Budget or None
        What the exact route may take.

    Returns
    -------
    Solution

    Raises
    ------
    EmptyTubeError
        If no control keeps the constraints.
    TooLargeError, UncertainHullError
        If the exact route was asked for and cannot be gone.
    """
    blocks = split(problem)
    optima = tuple(block_optimum(each) for each in blocks)
    optimal = OptimalControls(problem, optima)
    lifted: tuple[BlockSets, ...] = tuple(LiftedSets(each) for each in optima)
    meter = Meter(budget or Budget())
    refused = None if route is Route.LIFTED else _refusal(problem, blocks, asked=route is Route.EXACT)
    if route is Route.EXACT and refused is not None:
        raise TooLargeError(refused)
    if route is Route.LIFTED or refused is not None:
        why = "as asked" if refused is None else refused
        return Solution(problem, optimal, ReachableSets(problem, blocks, lifted), Route.LIFTED, why)
    try:
        exact = _exact(optima, meter)
        _need_agreement(exact, lifted)
    except (TooLargeError, UncertainHullError) as error:
        if route is Route.EXACT:
            raise
        return Solution(problem, optimal, ReachableSets(problem, blocks, lifted), Route.LIFTED, str(error))
    why = "as asked" if route is Route.EXACT else f"blocks of {', '.join(str(each.size) for each in blocks)} states"
    return Solution(problem, optimal, ReachableSets(problem, blocks, exact), Route.EXACT, why)


def _exact(optima: tuple[BlockOptimum, ...], meter: Meter) -> tuple[BlockSets, ...]:
    try:
        return tuple(ExactSets(each, meter) for each in optima)
    except EmptyPolytopeError as error:  # what is not empty by the programs
        raise UncertainHullError("a set is so thin that rounding leaves nothing of it") from error


def _need_agreement(exact: tuple[BlockSets, ...], lifted: tuple[BlockSets, ...]) -> None:
    """Refuse exact sets whose bounds the programs do not confirm."""
    for one, other in zip(exact, lifted, strict=True):
        for kind in SetKind:
            apart = float(np.abs(one.bounds(kind) - other.bounds(kind)).max())
            if apart > AGREEMENT:
                raise UncertainHullError(f"{kind.value} sets by hulls and by programs are {apart:.2g} of a bound apart")


def least_periods(problem: ReachabilityProblem) -> int | None:
    """Return the least number of periods after which zero can be reached, with every constraint kept.

    Parameters
    ----------
    problem : ReachabilityProblem
        Its T is the most that is looked at.

    Returns
    -------
    int or None
        None if there is none.

    Notes
    -----
    Where zero keeps all constraints it can be kept once reached, and the least is found by bisection; else all are
    tried. A linear program a block and try.
    """
    blocks = split(problem)
    waits = all((each.offsets >= 0.0).all() for each in blocks)

    def reached(periods: int) -> bool:
        return all(block_reaches_zero(each.first(periods)) for each in blocks)

    if not waits:
        return next((each for each in range(1, problem.periods + 1) if reached(each)), None)
    if not reached(problem.periods):
        return None
    low, high = 0, problem.periods
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if reached(middle) else (middle, high)
    return high


def _refusal(problem: ReachabilityProblem, blocks: tuple[Block, ...], *, asked: bool) -> str | None:
    """Why exact sets are not tried, or None."""
    if problem.thrust is ThrustShape.BALL:
        return "thrust in a ball has sets that are no polytopes"
    if problem.between is not None:
        return "constraints between the periods bind states and controls together"
    if asked:
        return None
    largest = max(each.size for each in blocks)
    if largest > MOST_STATES_BY_CHOICE:
        return f"the constraints couple {largest} states, whose hulls lose facets to rounding"
    if problem.periods > MOST_PERIODS_BY_CHOICE:
        return f"over {MOST_PERIODS_BY_CHOICE} periods hulls lose facets to rounding"
    return None
