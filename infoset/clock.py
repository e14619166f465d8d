"""Times before the nominal arrival on a grid of steps: a time means the nearest step.

If times before the arrival are asked for, the length of the step is changed slightly so that the
nominal arrival is a whole number of steps after the start.
"""

from __future__ import annotations

import math

STEP_ROUNDING = 1e-9
"""Part of a step by which a computed number of steps may be wrong.

A flight has at most 1e5 steps, and a subtraction and a division round their number by at most
4e-11. Times of a file are decimals with far fewer digits.
"""


def fitted_step_s(arrival_s: float, step_s: float) -> float:
    """Return the step, s, that is nearest to an asked one and divides the time to the arrival.

    It differs from the asked step by at most 1/(2N) of the asked one, with the number N of steps;
    an asked step of more than twice the time to the arrival becomes this time.

    Parameters
    ----------
    arrival_s, step_s : float
        Time from the start to the nominal arrival, and the asked length of a step, s.
    """
    number = max(1, round(arrival_s / step_s))
    if abs(arrival_s / step_s - number) <= STEP_ROUNDING:
        return step_s
    return arrival_s / number


def steps_between(start_s: float, time_s: float, step_s: float) -> int:
    """Return the number of steps from a time to the step nearest to another time.

    If two steps are equally near, it is the earlier one. No step is at or after the nominal
    arrival. The number is negative if the nearest step is before `start_s`.

    Parameters
    ----------
    start_s, time_s : float
        Times before the nominal arrival, s; `start_s` is the time of a step.
    step_s : float
        Time between two steps, s.
    """
    # With `ceil` and - 0.5, not `round`: of two steps that are equally near the earlier one.
    nearest = math.ceil((start_s - time_s) / step_s - 0.5 - STEP_ROUNDING)
    last = math.ceil(start_s / step_s - STEP_ROUNDING) - 1
    return min(nearest, last)
