"""The miss that impulses after a decision can still correct."""

from __future__ import annotations

import numpy as np

from infoset.arrays import Floats, Integers
from infoset.guidance.situation import Situation
from infoset.guidance.symmetric_impulse import range_at_impulse
from infoset.guidance.thruster import Thruster


def correctable_later_m(situation: Situation, range_m: Floats) -> Floats:
    """Return the miss (m) that impulses after this step can still correct.

    It is the sum of mu2 x_j/e over the later impulses with x_j > 0, as many as the budget allows.
    The impulse that is decided now does not count, and its budget is not subtracted. Without a
    schedule, a rest of the budget below mu2 does not count either.

    Parameters
    ----------
    range_m : ndarray, shape (..., B, S)
        Present ranges of hypotheses.
    """
    thruster = situation.thruster
    e = situation.closing_speed_m_s
    step_s = situation.step_s
    budget = situation.budget_left_m_s[:, None]
    if situation.later_times_s is not None:
        times_s = situation.later_times_s - situation.time_s
        return correctable_m(times_s, thruster, budget, range_m / e)

    # An impulse of maximum size in each of the next steps.
    to_go_s = range_at_impulse(range_m, e, situation.lead_s) / e
    # Steps after the impulse that is decided now and before the arrival: none at it.
    steps = np.ceil(to_go_s / step_s) - 1.0
    full = np.clip(np.floor(budget / thruster.max_impulse_m_s), 0.0, np.maximum(steps, 0.0))
    # A burn acts at its middle. The sum of the times to go j steps later, for j = 1 to `full`:
    to_go_s = to_go_s - 0.5 * thruster.burn_s(thruster.max_impulse_m_s)
    return np.asarray(
        thruster.max_impulse_m_s * (full * to_go_s - step_s * 0.5 * full * (full + 1.0))
    )


def correctable_m(
    times_s: Floats, thruster: Thruster, budget: Floats, to_go_s: Floats, first: Integers | int = 0
) -> Floats:
    """Return the miss (m) that impulses can correct, as many as the budget allows.

    Impulses have their maximum, the earliest first, until the budget is spent or x = 0 (the range
    is zero). One more has the rest of the budget, none if the rest is below the minimum impulse.
    Burns are assumed to end before x = 0: one that starts less than half its duration before counts
    negative. The result has the broadcast shape.

    Parameters
    ----------
    times_s : ndarray, shape (n,)
        Times from now at which impulses can be given, increasing.
    budget, to_go_s : ndarray
        Budget, m/s, and time to x = 0; broadcast against each other and against `first`.
    first : ndarray of int or int
        Index of the first impulse that counts, at most n.
    """
    # Impulses from `first` on that are before x = 0.
    possible = np.maximum(np.searchsorted(times_s, to_go_s) - first, 0)
    full = np.minimum(budget // thruster.max_impulse_m_s, possible).astype(np.int64)
    rest = np.minimum(budget - full * thruster.max_impulse_m_s, thruster.max_impulse_m_s)
    rest = np.where((full < possible) & (rest >= thruster.min_impulse_m_s), rest, 0.0)

    # The sum of the times to go of the impulses from `first` to `end`, by sums of all times.
    end = first + full
    times_s = times_s[: end.max(initial=0) + 1]  # later ones are not needed
    sums_s = np.append(0.0, np.cumsum(times_s))
    # The rest is given at the time after the full impulses. Where this would be after the last one,
    # the rest is zero: any number will do.
    next_s = np.append(times_s, 0.0)[end]
    # A burn acts at its middle.
    of_full_s = to_go_s - 0.5 * thruster.burn_s(thruster.max_impulse_m_s)
    of_rest_s = to_go_s - 0.5 * thruster.burn_s(rest)
    return np.asarray(
        thruster.max_impulse_m_s * (full * of_full_s - (sums_s[end] - sums_s[first]))
        + rest * (of_rest_s - next_s)
    )


def max_correctable_m(
    times_s: Floats,
    thruster: Thruster,
    to_go_s: Floats,
    first: Integers | int = 0,
    budget: Floats | float | None = None,
) -> Floats:
    """Return the maximum of `correctable_m` for all errors of execution, m.

    For burns it is an upper bound: a longer burn also acts later. The default budget is no limit.
    """
    if budget is None:
        # One impulse more than there are times: no rounding of the quotient loses one.
        budget = thruster.max_impulse_m_s * (len(times_s) + 1.0)
    commanded_m = correctable_m(times_s, thruster, np.asarray(budget), to_go_s, first)
    return (1.0 + thruster.execution_error_relative) * commanded_m
