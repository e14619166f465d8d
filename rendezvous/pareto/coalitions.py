"""Costs of coalitions, their regret at the common meeting, and the division of costs."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from itertools import combinations
from math import factorial

import numpy as np

from infoset.rendezvous._arrays import Floats
from infoset.rendezvous.pareto.solution import EncounterSolution, weighted_point

MAX_CRAFT = 12
"""Largest number of craft: 4095 coalitions, each a least-squares problem."""
_EXCESS_ROUNDING = 1e-18
"""Excess of all craft that is the rounding of ideals, as a share of their squared cost at free
values of zero."""


class Core(Enum):
    """Whether a division of the cost exists that no coalition can improve alone."""

    EMPTY = "empty"
    ZERO = "zero"

    @property
    def reason(self) -> str:
        """The reason, in a sentence."""
        if self is Core.EMPTY:
            return (
                "the core is empty: each craft alone has zero excess, so its share in the core is "
                "at most zero, but the shares must sum to the cost of the common meeting, which "
                "is positive"
            )
        return (
            "the ideal meetings of all craft with a weight above 0 coincide: these craft have no "
            "excess, and in the only division of the core all shares are zero"
        )


@dataclass(frozen=True)
class Coalition:
    """A coalition of craft, whose `members` are indices.

    `excess` is c(S), their minimum weighted sum of excesses at a common meeting, and `regret` its
    increase at the common meeting of all; both in m^2/s^3.
    """

    members: tuple[int, ...]
    excess: float
    regret: float


@dataclass(frozen=True)
class Coalitions:
    """All coalitions of an encounter, by size, from single craft to the coalition of all.

    `shapley`, shape (n,), is the Shapley value of the cost game c, and `core` the core of this
    game. `transfers`, shape (n,), are payments to each craft that leave it with its Shapley value:
    its weighted excess minus that value, of sum zero. Both are in m^2/s^3.
    """

    coalitions: tuple[Coalition, ...]
    shapley: Floats
    transfers: Floats
    core: Core


def analyse_coalitions(solution: EncounterSolution) -> Coalitions:
    """Analyse every coalition of a `solution`, whose meeting is the best one for the group.

    With one M and weights of 1 c(S) = sum over pairs of d_ij^2 / |S|. c is superadditive with
    c({i}) = 0, so its core is empty unless all ideals of craft with a weight above 0 coincide.
    O(2^n n).

    Raises
    ------
    ValueError
        If there are more than 12 craft: there are 2^n coalitions.
    """
    count = len(solution.costs)
    if count > MAX_CRAFT:
        raise ValueError(
            f"{count} craft have {2**count - 1} coalitions; at most {MAX_CRAFT} craft are analysed"
        )
    weights = solution.encounter.weights
    common = weights * solution.excess()
    worth: dict[tuple[int, ...], float] = {(): 0.0}
    coalitions = []
    for size in range(1, count + 1):
        for members in combinations(range(count), size):
            worth[members] = _worth(solution, members, weights)
            # A regret is not negative, up to rounding.
            regret = max(float(common[list(members)].sum()) - worth[members], 0.0)
            coalitions.append(Coalition(members, worth[members], regret))

    shapley = np.zeros(count)
    for members, value in worth.items():
        for craft in members:
            # The craft joins the others: their orders before it, and those of the rest after it.
            others = tuple(member for member in members if member != craft)
            orders = factorial(len(others)) * factorial(count - len(members))
            shapley[craft] += orders / factorial(count) * (value - worth[others])

    # Equal ideals are equal up to rounding only.
    squares = [cost.effort_base @ cost.effort_base for cost in solution.costs]
    rounding = _EXCESS_ROUNDING * sum(weights * squares)
    core = Core.EMPTY if worth[tuple(range(count))] > rounding else Core.ZERO

    # The sums are equal up to rounding, which is spread over all craft.
    transfers = common - shapley - (common.sum() - shapley.sum()) / count
    return Coalitions(tuple(coalitions), shapley, transfers, core)


def _worth(solution: EncounterSolution, members: tuple[int, ...], weights: Floats) -> float:
    """Return the minimum of the weighted excess of a coalition; 0 for a craft alone, and without
    weights.
    """
    costs = [solution.costs[member] for member in members]
    # `weighted_point` needs a positive weight.
    if len(members) == 1 or not (weights[list(members)] > 0.0).any():
        return 0.0
    point = weighted_point(costs, weights[list(members)])
    return float(
        sum(
            weights[member] * cost.excess(point)
            for member, cost in zip(members, costs, strict=True)
        )
    )
