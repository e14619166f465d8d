"""Causes of misses: the first one that applies, from the true motion, the engine and the set."""

from __future__ import annotations

from enum import Enum
from functools import partial
from typing import Any, NamedTuple

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
    """No critical decision: the miss without impulses exceeds the outer radius of the body by more
    than all impulses, with any budget, can correct.
    """
    BUDGET = "budget"
    """With more budget, a hit would have been possible at the start, or after the critical
    decision.
    """
    KNOWLEDGE = "knowledge"
    """At the critical decision no impulse was right for all possible misses, and at the last
    decision these were still wider than the body. Also if there is no critical decision, and
    neither the engine nor the budget is the cause: then the set was empty at the decisions."""
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
"""Numbers that explain the misses of a cause: the maximum of a column over these misses."""


class _AtDecisions(NamedTuple):
    """Values of n flights at K decisions.

    Parameters
    ----------
    miss_m : ndarray, shape (K + 1, C, n)
        Lateral misses without the impulses from each decision on; the last row is the miss.
    tracking : ndarray of bool, shape (K, n)
        Whether the flight decides impulses.
    budget_m_s : ndarray, shape (K, n)
        Budget left before the decision.
    ends_m : ndarray, shape (K + 1, 2, C, n)
        Ends of the possible misses; the last row is zero, for flights without a decision.
    """

    miss_m: Floats
    tracking: Flags
    budget_m_s: Floats
    ends_m: Floats

    def of_flights(self, which: Flags) -> _AtDecisions:
        """Return the values of some flights."""
        return _AtDecisions(
            self.miss_m[..., which],
            self.tracking[:, which],
            self.budget_m_s[:, which],
            self.ends_m[..., which],
        )


class DecisionLog:
    """Decisions of B engagements, from which the causes of misses are computed after the flight.

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
    (T - t_j): no motion is simulated again. A burn acts at its middle. Cost: O(B) in a step, O(K B)
    after a flight with K decisions.
    """

    def __init__(self, scenario: Scenario, lateral: tuple[int, int], steps: int) -> None:
        self._scenario = scenario
        self._steps: list[int] = []
        self._tracking = np.zeros((steps, lateral[1]), dtype=bool)
        self._budget_m_s = np.zeros((steps, lateral[1]))
        # The last row of both stays zero: there is no decision after the last one, and an impulse
        # whose delay ends after the last step is not executed.
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

        In space the impulses of a flight reach a disc. Therefore the modulus of M_i is compared
        with the authority, and the possible misses have the radius of the disc around their
        rectangle.
        """
        thruster = self._scenario.engine
        number = len(self._steps)
        steps = np.array(self._steps, dtype=np.int64) + thruster.delay_steps
        times_s: Floats = self._scenario.fitted_step_s * steps.astype(np.float64)
        flights = _AtDecisions(
            self._misses_without_impulses_m(steps, times_s, lateral_miss_m, arrival_s),
            self._tracking[:number],
            self._budget_m_s[:number],
            self._ends_m[: number + 1],
        )

        causes = np.full(len(missed), None, dtype=object)
        if missed.any():
            causes[missed] = self._causes(flights.of_flights(missed), times_s, arrival_s[missed])

        last = _last(flights.tracking)
        lower_m, upper_m = _chosen(flights.ends_m, last)
        return {
            "causes": tuple(causes),
            "unguided_miss_m": modulus(flights.miss_m[0]),
            "engine_corrects_m": max_correctable_m(times_s, thruster, arrival_s),
            "budget_corrects_m": max_correctable_m(
                times_s, thruster, arrival_s, budget=thruster.budget_m_s
            ),
            "last_possible_m": np.ma.MaskedArray(modulus(0.5 * (upper_m - lower_m)), mask=last < 0),
        }

    def _misses_without_impulses_m(
        self, steps: Integers, times_s: Floats, lateral_miss_m: Floats, arrival_s: Floats
    ) -> Floats:
        """Return the misses M_i without the impulses from each decision on, shape (K + 1, C, B)."""
        effects_m = np.zeros((len(steps) + 1, *lateral_miss_m.shape))
        # An impulse whose delay ends after the last step has the last row, which is zero.
        effects_m[:-1] = self._executed_m_s[np.minimum(steps, len(self._executed_m_s) - 1)]
        sizes = modulus(effects_m[:-1].swapaxes(0, 1))
        middles_s = times_s[:, None] + 0.5 * self._scenario.engine.burn_s(sizes)
        effects_m[:-1] *= np.maximum(arrival_s - middles_s, 0.0)[:, None]
        return np.asarray(np.cumsum(effects_m[::-1], axis=0)[::-1] + lateral_miss_m)

    def _causes(self, flights: _AtDecisions, times_s: Floats, arrival_s: Floats) -> list[MissCause]:
        """Return the causes of n misses.

        The modulus of M_i less the authority does not decrease with i: an impulse changes both by
        at most its own share.
        """
        thruster = self._scenario.engine
        # A greater miss cannot hit, and a smaller one than the certain radius hits.
        outer_m = self._scenario.outer_radius_m or 0.0
        certain_m = self._scenario.certain_radius_m or 0.0
        corrects_m = partial(max_correctable_m, times_s, thruster, arrival_s)
        decisions = np.arange(len(times_s))[:, None]
        each = np.arange(flights.miss_m.shape[2])
        sizes = modulus(flights.miss_m.swapaxes(0, 1))

        possible = flights.tracking & (
            sizes[:-1] - corrects_m(decisions, flights.budget_m_s) <= outer_m
        )
        exists = possible.any(axis=0)
        critical = _last(possible)
        last = _last(flights.tracking)
        is_before_last = critical < last
        # The decision after the critical one; without a critical one it is the first.
        after = np.minimum(critical + 1, len(times_s))
        later_corrects_m = corrects_m(after)

        # The impulse that is best for all possible misses, and the part of them that it and the
        # later ones leave.
        lower_m, upper_m = _chosen(flights.ends_m, critical)
        farthest_m = modulus(np.maximum(upper_m, -lower_m))
        left_m = np.maximum(
            _unknown_m(flights, critical) - np.where(is_before_last, later_corrects_m, 0.0),
            farthest_m - corrects_m(critical),
        )
        wide = ~exists | (left_m > certain_m)

        with_budget_m = corrects_m(budget=thruster.budget_m_s)
        by_budget = exists & is_before_last & (sizes[after, each] - later_corrects_m <= outer_m)
        # The cause is the first of these conditions that holds.
        conditions = {
            MissCause.ENGINE: sizes[0] - corrects_m() > outer_m,
            MissCause.BUDGET: by_budget | (sizes[0] - with_budget_m > outer_m),
            MissCause.KNOWLEDGE: wide & (~exists | (_unknown_m(flights, last) > certain_m)),
            MissCause.SATURATED: wide,
            MissCause.GUIDANCE: np.ones_like(wide),
        }
        first = np.argmax(list(conditions.values()), axis=0)
        return [list(conditions)[index] for index in first.tolist()]


def count_causes(
    causes: NDArray[np.object_], unguided_m: Floats, engine_m: Floats, last_possible_m: Floats
) -> dict[str, Any]:
    """Return the number of misses of each cause by name, and the numbers that explain them.

    `needed_m` and `corrected_m` are the maximum miss without impulses and the maximum correction of
    the misses by the engine; `possible_m` is the maximum radius of the possible misses of the
    misses by knowledge. They are None without a known value of such misses. The arguments are
    columns of results, shape (N,).
    """
    columns = {
        "unguided_miss_m": unguided_m,
        "engine_corrects_m": engine_m,
        "last_possible_m": last_possible_m,
    }
    counts: dict[str, Any] = {
        cause.value: int((causes == cause.value).sum()) for cause in MissCause
    }
    explained = {
        name: max_of_cause(causes, columns[column], cause)
        for name, (cause, column) in EXPLAINED.items()
    }
    return counts | explained


def max_of_cause(causes: NDArray[np.object_], values_m: Floats, cause: MissCause) -> float | None:
    """Return the maximum of a column over the misses of a cause.

    Unknown values are NaN, and do not count. None without a known value.
    """
    of_cause = values_m[causes == cause.value]
    return max(of_cause[~np.isnan(of_cause)].tolist(), default=None)


def _unknown_m(flights: _AtDecisions, rows: Integers) -> Floats:
    """Return the radius of the possible misses of each flight at one of its decisions, m.

    It is greater if they exclude the true miss: the distance of the true miss from their middle.
    """
    lower, upper = _chosen(flights.ends_m, rows)
    truth = flights.miss_m[rows, :, np.arange(len(rows))].T
    half_width = modulus(0.5 * (upper - lower))
    return np.maximum(half_width, modulus(truth - 0.5 * (lower + upper)))


def _chosen(rows: Floats, chosen: Integers) -> Floats:
    """Return one row for each of n flights, shape (2, C, n), from rows of shape (K + 1, 2, C, n).

    The index -1 is the last row.
    """
    return np.moveaxis(rows[chosen, :, :, np.arange(len(chosen))], 0, -1)


def _last(flags: Flags) -> Integers:
    """Return the last row with a flag in each column; -1 without one."""
    last = len(flags) - 1 - np.argmax(flags[::-1], axis=0) if len(flags) else -1
    return np.where(flags.any(axis=0), last, -1)
