"""Why engagements miss: the first cause that applies to each miss, from the true motion, the engine
and the set.
"""

from __future__ import annotations

from enum import Enum
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from infoset.arrays import Flags, Floats, Integers
from infoset.engine.predicted_miss import PredictedMiss
from infoset.guidance.authority import max_correctable_m
from infoset.guidance.thruster import modulus
from infoset.sim.scenario import Scenario


class MissCause(Enum):
    """Why an engagement missed: the first of these that applies.

    The critical decision is the last one before which impulses within the limits of the engine and
    the budget could still have made a hit. docs/miss-causes.md has the definitions and what they
    imply.
    """

    ENGINE = "engine"
    """No critical decision: the miss without impulses is more than all impulses, with any budget,
    can correct.
    """
    BUDGET = "budget"
    """With more budget, a hit would have been possible at the start, or after the critical
    decision.
    """
    KNOWLEDGE = "knowledge"
    """At the critical decision no impulse was right for all possible misses, and at the last
    decision these were still wider than the body."""
    SATURATED = "saturated"
    """At the critical decision no impulse was right for all possible misses, but at the last one
    these were narrow: the miss was known too late."""
    GUIDANCE = "guidance"
    """An impulse at the critical decision would have kept a hit possible for all possible
    misses.
    """


EXPLAINED = {
    "needed_m": (MissCause.ENGINE, "unguided_miss_m"),
    "corrected_m": (MissCause.ENGINE, "engine_corrects_m"),
    "possible_m": (MissCause.KNOWLEDGE, "last_possible_m"),
}
"""What explains the misses of a cause: the maximum of a column over them."""


class DecisionLog:
    """What decides the causes of misses, recorded in a flight of B engagements and evaluated after
    it.

    Parameters
    ----------
    lateral : tuple of int
        Shape (C, B) of impulses.
    steps : int
        Maximum number of steps.

    Notes
    -----
    With the lateral miss m of the true motion, its arrival T and the executed impulses u_j at the
    times t_j, the miss without the impulses from decision i on is M_i = m + sum over j >= i of u_j
    (T - t_j): no motion is simulated again. Cost: O(B) in a step, O(K B) after a flight with K
    decisions.
    """

    def __init__(self, scenario: Scenario, lateral: tuple[int, int], steps: int) -> None:
        self._scenario = scenario
        self._steps: list[int] = []
        self._tracking = np.zeros((steps, lateral[1]), dtype=bool)
        self._budget_m_s = np.zeros((steps, lateral[1]))
        # One row more, of zeros: after the last decision.
        self._ends_m = np.zeros((steps + 1, 2, *lateral))
        self._executed_m_s = np.zeros((steps + 1, *lateral))

    def decide(
        self, step: int, tracking: Flags, budget_left_m_s: Floats, miss: PredictedMiss
    ) -> None:
        """Record a step in which impulses can be decided, before the decision."""
        row = len(self._steps)
        self._steps.append(step)
        self._tracking[row] = tracking
        self._budget_m_s[row] = budget_left_m_s
        self._ends_m[row, 0], self._ends_m[row, 1] = miss.lower_m, miss.upper_m

    def execute(self, step: int, impulse_m_s: Floats) -> None:
        """Record the executed impulses of a step, shape (C, B)."""
        self._executed_m_s[step] = impulse_m_s

    def columns(self, lateral_miss_m: Floats, arrival_s: Floats, missed: Flags) -> dict[str, Any]:
        """Return the fields of `Results` with the causes, from lateral misses (C, B) and arrivals
        (B,) of the motions.

        In space the impulses of a flight reach a disc, so the modulus of M_i is compared with the
        authority, and the radius of the possible misses is that of the disc around their rectangle.
        """
        thruster = self._scenario.thruster
        number = len(self._steps)
        steps = np.array(self._steps, dtype=np.int64) + thruster.delay_steps
        tracking = self._tracking[:number]
        budget_m_s = self._budget_m_s[:number]
        ends_m = self._ends_m[: number + 1]
        times_s: Floats = self._scenario.step_s * steps.astype(np.float64)
        miss = np.zeros((number + 1, *lateral_miss_m.shape))
        miss[:-1] = self._executed_m_s[np.minimum(steps, len(self._executed_m_s) - 1)]
        miss[:-1] *= np.maximum(arrival_s - times_s[:, None], 0.0)[:, None]
        miss = np.cumsum(miss[::-1], axis=0)[::-1] + lateral_miss_m
        causes = np.full(len(missed), None, dtype=object)
        last = _last(tracking)
        if missed.any():
            at_decisions = (
                miss[..., missed],
                tracking[:, missed],
                budget_m_s[:, missed],
                ends_m[..., missed],
            )
            causes[missed] = self._causes(*at_decisions, times_s, arrival_s[missed])
        lower_m, upper_m = _chosen(ends_m, last)
        return {
            "causes": tuple(causes),
            "unguided_miss_m": modulus(miss[0]),
            "engine_corrects_m": max_correctable_m(times_s, thruster, arrival_s),
            "budget_corrects_m": max_correctable_m(
                times_s, thruster, arrival_s, budget=thruster.budget_m_s
            ),
            "last_possible_m": np.ma.MaskedArray(modulus(0.5 * (upper_m - lower_m)), mask=last < 0),
        }

    def _causes(
        self,
        miss: Floats,
        tracking: Flags,
        budget_m_s: Floats,
        ends_m: Floats,
        times_s: Floats,
        arrival_s: Floats,
    ) -> list[MissCause]:
        """Return the causes of n misses.

        `miss`, shape (K + 1, C, n), has the misses without the impulses from each decision on, and
        at last that of the flight; its modulus less the authority does not decrease: an impulse
        changes both by at most its own share. `ends_m`, shape (K + 1, 2, C, n), are the ends of the
        possible misses at the decisions.
        """
        radius_m = self._scenario.radius_m or 0.0
        at = np.arange(miss.shape[2])
        sizes = modulus(miss.swapaxes(0, 1))
        decisions = np.arange(len(times_s))[:, None]
        corrects_m = partial(max_correctable_m, times_s, self._scenario.thruster, arrival_s)
        possible = tracking & (sizes[:-1] - corrects_m(decisions, budget_m_s) <= radius_m)
        critical = _last(possible)
        last = _last(tracking)
        exists = possible.any(axis=0)
        then = np.minimum(critical + 1, len(times_s))
        now_m = corrects_m(critical)
        then_m = corrects_m(then)
        lower_m, upper_m = _chosen(ends_m, critical)
        farthest_m = modulus(np.maximum(upper_m, -lower_m))
        # More than the half-width of the possible misses if they exclude the true one.
        unknown_m, unknown_at_last_m = (
            np.maximum(
                modulus(0.5 * (upper - lower)), modulus(miss[rows, :, at].T - 0.5 * (lower + upper))
            )
            for rows, (lower, upper) in ((rows, _chosen(ends_m, rows)) for rows in (critical, last))
        )
        # What the impulse that is best for all possible misses leaves beyond the later ones.
        beyond_m = np.maximum(
            unknown_m - np.where(critical < last, then_m, 0.0), farthest_m - now_m
        )
        by_budget = exists & (critical < last) & (sizes[then, at] - then_m <= radius_m)
        within_m = corrects_m(budget=self._scenario.thruster.budget_m_s)
        wide = ~exists | (beyond_m > radius_m)
        # The cause is the first of these conditions that holds.
        conditions = {
            MissCause.ENGINE: sizes[0] - corrects_m() > radius_m,
            MissCause.BUDGET: by_budget | (sizes[0] - within_m > radius_m),
            MissCause.KNOWLEDGE: wide & (~exists | (unknown_at_last_m > radius_m)),
            MissCause.SATURATED: wide,
            MissCause.GUIDANCE: np.ones_like(wide),
        }
        first = np.argmax(list(conditions.values()), axis=0)
        return [list(conditions)[index] for index in first.tolist()]


def count_causes(
    causes: NDArray[np.object_], unguided_m: Floats, engine_m: Floats, last_possible_m: Floats
) -> dict[str, Any]:
    """Return the number of misses of each cause by name, and what explains them: columns of
    results, shape (N,).

    `needed_m` and `corrected_m` are the maximum miss without impulses of the misses by the engine,
    and what their impulses correct; `possible_m` the maximum radius of the possible misses of those
    by knowledge. None without such misses.
    """
    columns = {
        "unguided_miss_m": unguided_m,
        "engine_corrects_m": engine_m,
        "last_possible_m": last_possible_m,
    }
    explained = {
        name: max_of_cause(causes, columns[column], cause)
        for name, (cause, column) in EXPLAINED.items()
    }
    return {**{cause.value: int((causes == cause.value).sum()) for cause in MissCause}, **explained}


def max_of_cause(causes: NDArray[np.object_], values_m: Floats, cause: MissCause) -> float | None:
    """Return the maximum of a column of results over the misses of a cause; None without such
    misses.
    """
    return max(values_m[causes == cause.value].tolist(), default=None)


def _chosen(rows: Floats, chosen: Integers) -> Floats:
    """Return one row for each of n flights, shape (2, C, n), from rows of shape (K + 1, 2, C, n);
    -1 is the last.
    """
    return np.moveaxis(rows[chosen, :, :, np.arange(len(chosen))], 0, -1)


def _last(flags: Flags) -> Integers:
    """Return the last row with a flag in each column; -1 without one."""
    last = len(flags) - 1 - np.argmax(flags[::-1], axis=0) if len(flags) else -1
    return np.where(flags.any(axis=0), last, -1)
