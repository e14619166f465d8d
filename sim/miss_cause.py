"""Why engagements miss: the first cause that applies to each miss, from the true motion, the engine and the set."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np

from guidance.authority import correctable_m
from infoset import PredictedMiss
from infoset.arrays import Flags, Floats
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
    """At the critical decision the possible misses were too wide for what could be corrected after it, and at the last
    decision they were still wider than the body."""
    SATURATED = "saturated"
    """At the critical decision they were too wide, but at the last one they were narrow: known too late."""
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
        thruster, step_s = self._scenario.thruster, self._scenario.set_model.step_s
        count, delay, shape = len(self._decisions), thruster.delay_steps, lateral_miss_m.shape
        steps = np.array([step for step, *_ in self._decisions], dtype=np.int64) + delay
        tracking = _rows([flags for _, flags, *_ in self._decisions], shape[1:]).astype(bool)
        budget = _rows([left for _, _, left, _ in self._decisions], shape[1:])
        lower, upper = (
            _rows([getattr(miss, end) for *_, miss in self._decisions], shape) for end in ("lower_m", "upper_m")
        )
        executed = np.concatenate([_rows(self._executed, shape), np.zeros((delay + 1, *shape))])
        given = executed[np.minimum(steps, len(executed) - 1)]
        corrected = given * np.maximum(arrival_s - step_s * steps[:, None], 0.0)[:, None]
        after = np.append(np.cumsum(corrected[::-1], axis=0)[::-1], np.zeros((1, *shape)), axis=0)
        miss = lateral_miss_m + after
        without_limit = np.full_like(budget, thruster.max_impulse_m_s * (count + 1))
        # The errors of execution count in favour of the engine: what it cannot correct then, it never can.
        engine, within_budget = (
            (1.0 + thruster.execution_error_relative)
            * np.append(
                correctable_m(step_s * steps, thruster, limit, arrival_s, np.arange(count)[:, None]),
                np.zeros((1, *shape[1:])),
                axis=0,
            )
            for limit in (without_limit, budget)
        )
        middle, radius = 0.5 * (lower + upper), np.hypot.reduce(0.5 * (upper - lower), axis=1)
        # Beyond the radius if the set has lost the true state.
        unknown = np.maximum(radius, np.hypot.reduce(miss[:-1] - middle, axis=1))
        decided, last = tracking.any(axis=0), _last(tracking)
        causes: list[MissCause | None] = [None] * shape[1]
        for at, cause in zip(
            np.flatnonzero(missed).tolist(),
            _causes(
                np.hypot.reduce(miss, axis=1)[:, missed],
                engine[:, missed],
                within_budget[:, missed],
                np.append(unknown, np.full((1, *shape[1:]), np.inf), axis=0)[:, missed],
                tracking[:, missed],
                self._scenario.radius_m or 0.0,
            ),
            strict=True,
        ):
            causes[at] = cause
        at_last = np.append(radius, np.zeros((1, *shape[1:])), axis=0)[last, np.arange(shape[1])]
        return MissReasons(
            tuple(causes),
            np.hypot.reduce(miss[0]),
            engine[0],
            within_budget[0],
            np.ma.MaskedArray(at_last, mask=~decided),
        )


def _causes(
    miss: Floats, engine: Floats, budget: Floats, unknown: Floats, tracking: Flags, radius_m: float
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
    wide = ~exists | (unknown[critical, runs] > later_m + radius_m)
    conditions = (
        beyond[0],
        ~reach[0] | by_budget,
        wide & (~exists | (unknown[last, runs] > radius_m)),
        wide,
        np.ones_like(wide),
    )
    order = list(MissCause)
    return [order[index] for index in np.argmax(conditions, axis=0).tolist()]


def _rows(values: list[Floats] | list[Flags], shape: tuple[int, ...]) -> Floats:
    """Return recorded arrays as one, which is empty without any."""
    return np.reshape(np.array(values, dtype=np.float64), (len(values), *shape))


def _last(flags: Flags) -> Any:
    """Return the last row with a flag in each column; -1 without one."""
    return np.where(flags.any(axis=0), len(flags) - 1 - np.argmax(flags[::-1], axis=0), -1) if len(flags) else -1
