"""What coalitions would do on their own, what the common meeting costs them, and how costs could be shared."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from itertools import combinations
from math import factorial

import numpy as np
from numpy.typing import NDArray

from rendezvous.pareto.solution import EncounterSolution, weighted_point

Floats = NDArray[np.float64]

MOST_CRAFT = 12
_RELATIVE = 1e-12


class Core(Enum):
    """Whether some division of the cost leaves no coalition better off alone."""

    EMPTY = "empty"
    ZERO = "zero"

    @property
    def reason(self) -> str:
        """Why, in a sentence."""
        if self is Core.EMPTY:
            return (
                "the core is empty: alone each craft has no excess, so each would have to pay at most nothing, "
                "yet the cost of all together is positive; meeting together saves nobody anything here"
            )
        return "all ideals coincide: nobody has an excess, and the core is the division in which nobody pays"


@dataclass(frozen=True)
class Coalition:
    """Some of the craft.

    Parameters
    ----------
    members : tuple of int
        Which.
    excess : float
        c(S): their weighted sum of excesses at the meeting that is best for them alone, m^2/s^3.
    regret : float
        By how much their sum is greater at the common meeting, m^2/s^3.
    """

    members: tuple[int, ...]
    excess: float
    regret: float


@dataclass(frozen=True)
class Coalitions:
    """All coalitions of an encounter.

    Parameters
    ----------
    coalitions : tuple of Coalition
        By size; single craft and all together among them.
    shapley : ndarray, shape (n,)
        The Shapley value of the cost game c, m^2/s^3.
    transfers : ndarray, shape (n,)
        What each craft is owed by the others so that it bears its Shapley value: its own weighted excess less that,
        m^2/s^3; of sum zero.
    core : Core
    """

    coalitions: tuple[Coalition, ...]
    shapley: Floats
    transfers: Floats
    core: Core


def analyse_coalitions(solution: EncounterSolution) -> Coalitions:
    """Look at every coalition.

    Parameters
    ----------
    solution : EncounterSolution
        The common meeting is the best one for the group.

    Returns
    -------
    Coalitions

    Raises
    ------
    ValueError
        If there are more than 12 craft: coalitions are 2^n.

    Notes
    -----
    With one M and equal weights c(S) = sum over pairs of d_ij^2 / |S|. c is superadditive with c({i}) = 0, so its core
    is empty unless all ideals coincide. O(2^n n).
    """
    count = len(solution.costs)
    if count > MOST_CRAFT:
        raise ValueError(f"{count} craft have {2**count - 1} coalitions; at most {MOST_CRAFT} craft are analysed")
    weights = solution.encounter.weights
    common = weights * solution.excess()
    worth: dict[tuple[int, ...], float] = {(): 0.0}
    found = []
    for size in range(1, count + 1):
        for members in combinations(range(count), size):
            worth[members] = _worth(solution, members, weights)
            regret = max(float(common[list(members)].sum()) - worth[members], 0.0)
            found.append(Coalition(members, worth[members], regret))
    shapley = np.array([_shapley(each, count, worth) for each in range(count)])
    # Relative to the scale of the ideals themselves: equal ideals come out equal only up to rounding.
    scale = max(float(sum((each.root @ each.ideal) @ (each.root @ each.ideal) for each in solution.costs)), 0.0)
    core = Core.EMPTY if worth[tuple(range(count))] > _RELATIVE * scale else Core.ZERO
    return Coalitions(tuple(found), shapley, common - shapley - (common.sum() - shapley.sum()) / count, core)


def _worth(solution: EncounterSolution, members: tuple[int, ...], weights: Floats) -> float:
    chosen = [solution.costs[each] for each in members]
    if len(members) == 1 or not (weights[list(members)] > 0.0).any():
        return 0.0
    point = weighted_point(chosen, weights[list(members)])
    return float(sum(weights[member] * each.excess(point) for member, each in zip(members, chosen, strict=True)))


def _shapley(craft: int, count: int, worth: dict[tuple[int, ...], float]) -> float:
    others = [each for each in range(count) if each != craft]
    total = 0.0
    for size in range(count):
        share = factorial(size) * factorial(count - size - 1) / factorial(count)
        for members in combinations(others, size):
            total += share * (worth[tuple(sorted((*members, craft)))] - worth[members])
    return total
