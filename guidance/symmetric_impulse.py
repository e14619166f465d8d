"""The impulse that corrects an interval of misses."""

from __future__ import annotations

import numpy as np

from infoset.arrays import Floats
from infoset.engine.predicted_miss import PredictedMiss
from infoset.limits import POSITIVE


def symmetric_impulse(
    interval: PredictedMiss, closing_speed_m_s: float, lead_s: float = 0.0
) -> Floats:
    """Return the impulse k_s (m/s) that makes the ends of the predicted-miss interval opposite.

    Parameters
    ----------
    interval : PredictedMiss
        Interval of each engagement; the impulse is zero where it does not exist, and where both
        points have the range zero at the impulse.
    closing_speed_m_s : float
        Nominal closing speed e.
    lead_s : float
        Time from now to the impulse, s; the range at the impulse is used.

    References
    ----------
    Kumkov and Patsko (1997), equation (15).
    """
    POSITIVE.need("closing_speed_m_s", closing_speed_m_s)
    upper_range = range_at_impulse(interval.upper_point.range_m, closing_speed_m_s, lead_s)
    lower_range = range_at_impulse(interval.lower_point.range_m, closing_speed_m_s, lead_s)
    ranges = upper_range + lower_range
    wanted = (interval.upper_m + interval.lower_m) * closing_speed_m_s
    return np.divide(
        wanted, ranges, out=np.zeros(ranges.shape), where=interval.exists & (ranges != 0.0)
    )


def range_at_impulse(range_m: Floats, closing_speed_m_s: float, lead_s: float) -> Floats:
    """Return the range (m) at the impulse that is decided now; zero after the arrival."""
    if lead_s == 0.0:
        return range_m
    return np.maximum(range_m - closing_speed_m_s * lead_s, 0.0)
