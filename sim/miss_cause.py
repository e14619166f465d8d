"""Why engagements miss: the first cause that applies to each miss, from the true motion, the engine and the set."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from guidance.authority import correctable_m
from infoset import PredictedMiss
from infoset.arrays import Flags, Floats, Integers
from infoset.set_queries import MaskedFloats
from sim.scenario import Scenario


class MissCause(Enum):
    """Why an engagement missed: the first of these that applies.

    The critical decision is the last one before which impulses within the limits of the engine and the budget could
    still have made a hit. docs/miss-causes.md has the definitions and what they imply.
    """

    ENGINE = "engine"
    """No critical decision: the miss without impulses is more than all impulses, with any budget, can correct."""
    BUDGET = "budget"
    """With more budget, a hit would have been possible at the start, or after the critical decision."""
    KNOWLEDGE = "knowledge"
    """At the critical decision no impulse was right for all possible misses, and at the last decision these were still
    wider than the body."""
    SATURATED = "saturated"
    """At the critical decision no impulse was right for all possible misses, but at the last one these were narrow: the
    miss was known too late."""
    GUIDANCE = "guidance"
    """An impulse at the critical decision would have kept a hit possible for all possible misses."""


@dataclass(frozen=True)
class MissReasons:
    """Causes of the misses of B engagements, and the quantities that decide them, in metres, shape (B,).

    Parameters
    ----------
    causes : tuple of MissCause or None
        None for hits, and without a body.
    unguided_m : ndarray
        Miss without impulses.
    engine_m, budget_m : ndarray
        Maximum change of the miss by all impulses of the flight, without a limit of their sum and within the budget.
    last_possible_m : masked array
        Radius of the possible misses at the last decision; masked without a decision.
    """

    causes: tuple[MissCause | None, ...]
    unguided_m: Floats
    engine_m: Floats
    budget_m: Floats
    last_possible_m: MaskedFloats


class DecisionLog:
    """What decides the causes of misses, recorded in a flight of B engagements and evaluated after it.

    Notes
    -----
    With the lateral miss m of the true motion, its arrival T and the executed impulses u_j at the times t_j, the miss
    without the impulses from decision i on is M_i = m + sum over j >= i of u_j (T - t_j): no motion is simulated again.
    Recorded arrays are kept, not copied. Cost: O(1) in a step, O(K B) after a flight with K decisions.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._decisions: list[tuple[int, Flags, Floats, PredictedMiss]] = []
        self._executed: list[Floats] = []

    def decide(self, step: int, tracking: Flags, budget_left_m_s: Floats, miss: PredictedMiss) -> None:
        """Record a step in which impulses can be decided, before the decision."""
        self._decisions.append((step, tracking, budget_left_m_s, miss))

    def execute(self, impulse_m_s: Floats) -> None:
        """Record the executed impulses of a step, shape (C, B)."""
        self._executed.append(impulse_m_s)

    def reasons(self, lateral_miss_m: Floats, arrival_s: Floats, missed: Flags) -> MissReasons:
        """Return the reasons of all misses, from the lateral misses (C, B) and the arrivals (B,) of the true motions.

        In space the impulses of a flight reach a disc, so the modulus of M_i is compared with the authority, and the
        radius of the possible misses is that of the disc around their rectangle.
        """
        scenario, runs = self._scenario, len(arrival_s)
        thruster, step_s = scenario.thruster, scenario.set_model.step_s
        steps = np.array([step for step, *_ in self._decisions], dtype=np.int64) + thruster.delay_steps
        times_s: Floats = step_s * steps.astype(np.float64)
        tracking = _rows([flags for _, flags, *_ in self._decisions], runs) > 0.0
        budget = _rows([left for _, _, left, _ in self._decisions], runs)
        lower = _rows([miss.lower_m for *_, miss in self._decisions], *lateral_miss_m.shape)
        upper = _rows([miss.upper_m for *_, miss in self._decisions], *lateral_miss_m.shape)
        executed = _with_end(_rows(self._executed, *lateral_miss_m.shape))
        given = executed[np.minimum(steps, len(executed) - 1)]
        changes = given * np.maximum(arrival_s - times_s[:, None], 0.0)[:, None]
        miss = lateral_miss_m + _with_end(np.cumsum(changes[::-1], axis=0)[::-1])
        # What the engine cannot correct with the errors of its impulses in its favour, it never can.
        favour, first = 1.0 + thruster.execution_error_relative, np.arange(len(steps))[:, None]
        limits = np.full_like(budget, thruster.max_impulse_m_s * (len(steps) + 1)), budget
        engine, within_budget = (
            _with_end(favour * correctable_m(times_s, thruster, limit, arrival_s, first)) for limit in limits
        )
        radius, off = _modulus(0.5 * (upper - lower)), _modulus(miss[:-1] - 0.5 * (upper + lower))
        # A set that has lost the true state knows less than its width says.
        unknown, farthest = np.maximum(radius, off), _modulus(np.maximum(upper, -lower))
        found = iter(
            _causes(
                _modulus(miss)[:, missed],
                engine[:, missed],
                within_budget[:, missed],
                _with_end(unknown, np.inf)[:, missed],
                _with_end(farthest)[:, missed],
                tracking[:, missed],
                scenario.radius_m or 0.0,
            )
        )
        return MissReasons(
            tuple(next(found) if flag else None for flag in missed.tolist()),
            _modulus(miss)[0],
            engine[0],
            within_budget[0],
            np.ma.MaskedArray(_with_end(radius)[_last(tracking), np.arange(runs)], mask=~tracking.any(axis=0)),
        )


def count_causes(
    causes: NDArray[np.object_], unguided_m: Floats, engine_m: Floats, last_possible_m: Floats
) -> dict[str, Any]:
    """Return the number of misses of each cause by name, and what explains them: columns of results, shape (N,).

    `needed_m` and `corrected_m` are the maximum miss without impulses of the misses by the engine, and what their
    impulses correct; `possible_m` the maximum radius of the possible misses of those by knowledge. None without such
    misses.
    """

    def maximum(values_m: Floats, cause: MissCause) -> float | None:
        return max(values_m[causes == cause.value].tolist(), default=None)

    return {
        **{cause.value: int((causes == cause.value).sum()) for cause in MissCause},
        "needed_m": maximum(unguided_m, MissCause.ENGINE),
        "corrected_m": maximum(engine_m, MissCause.ENGINE),
        "possible_m": maximum(last_possible_m, MissCause.KNOWLEDGE),
    }


def _causes(
    miss: Floats,
    engine: Floats,
    budget: Floats,
    unknown: Floats,
    farthest: Floats,
    tracking: Flags,
    radius_m: float,
) -> list[MissCause]:
    """Return the causes of misses; the arrays have a row for each decision, all but `tracking` one more for the end.

    `miss` less `engine`, or less `budget`, does not decrease: an impulse changes the miss by at most its own share.
    """
    runs = np.arange(miss.shape[1])
    reach, beyond = miss - budget <= radius_m, miss - engine > radius_m
    possible = tracking & reach[:-1]
    critical, last, exists = _last(possible), _last(tracking), possible.any(axis=0)
    is_last = critical == last
    then = np.minimum(critical + 1, len(miss) - 1)
    later_m = np.where(is_last, 0.0, engine[then, runs])
    by_budget = exists & ~is_last & ~beyond[then, runs]
    # The maximum miss beyond the later impulses, after the impulse that is best for all possible misses.
    beyond_m = np.maximum(unknown[critical, runs] - later_m, farthest[critical, runs] - engine[critical, runs])
    wide = ~exists | (beyond_m > radius_m)
    conditions = (
        beyond[0],
        ~reach[0] | by_budget,
        wide & (~exists | (unknown[last, runs] > radius_m)),
        wide,
        np.ones_like(wide),
    )
    order = list(MissCause)
    return [order[index] for index in np.argmax(conditions, axis=0).tolist()]


def _rows(values: Sequence[Floats] | Sequence[Flags], *shape: int) -> Floats:
    """Return recorded arrays of a shape as one array, which is empty without any."""
    return np.reshape(np.array(values, dtype=np.float64), (len(values), *shape))


def _modulus(lateral: Floats) -> Floats:
    """Return the moduli of values along the lateral axes, the second axis of an array."""
    return np.asarray(np.hypot.reduce(lateral, axis=1))


def _with_end(rows: Floats, value: float = 0.0) -> Floats:
    """Return rows with one more of a value: after the last decision."""
    return np.append(rows, np.full((1, *rows.shape[1:]), value), axis=0)


def _last(flags: Flags) -> Integers:
    """Return the last row with a flag in each column; -1 without one."""
    return np.asarray(np.max(np.where(flags, np.arange(len(flags))[:, None], -1), axis=0, initial=-1))
