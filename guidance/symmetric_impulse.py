"""The impulse that corrects an interval of misses."""

from __future__ import annotations

import numpy as np

from infoset.arrays import Floats
from infoset.engine.predicted_miss import PredictedMiss
from infoset.limits import POSITIVE


def symmetric_impulse(
    interval: PredictedMiss, closing_speed_m_s: float, lead_s: float = 0.0
) -> Floats:
    """Return the impulse k_s (m/s) after which the ends of the predicted-miss interval are
    opposite.

    Parameters
    ----------
    interval : PredictedMiss
        Interval of each engagement; the impulse is zero where it does not exist.
    closing_speed_m_s : float
        Nominal closing speed e.
    lead_s : float
        Time from now to the impulse, s; the ranges are those at the impulse.

    References
    ----------
    Kumkov and Patsko (1997), equation (15).
    """
    POSITIVE.need("closing_speed_m_s", closing_speed_m_s)
    ranges = range_at_impulse(
        interval.upper_point.range_m, closing_speed_m_s, lead_s
    ) + range_at_impulse(interval.lower_point.range_m, closing_speed_m_s, lead_s)
    wanted = (interval.upper_m + interval.lower_m) * closing_speed_m_s
    return np.divide(
        wanted, ranges, out=np.zeros(ranges.shape), where=interval.exists & (ranges != 0.0)
    )


def range_at_impulse(range_m: Floats, closing_speed_m_s: float, lead_s: float) -> Floats:
    """Return the range (m) after `lead_s`, at the impulse that is decided now; zero after the
    arrival.
    """
    return range_m if lead_s == 0.0 else np.maximum(range_m - closing_speed_m_s * lead_s, 0.0)
