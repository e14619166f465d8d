"""Predicted miss of a state, and the impulses that correct an interval of misses or an estimated miss."""

from __future__ import annotations

import numpy as np

from infoset import PredictedMiss
from infoset.arrays import Floats
from infoset.limits import POSITIVE


def zero_effort_miss(omega_rad_s: Floats, range_m: Floats, closing_speed_m_s: float) -> Floats:
    """Return the signed miss (m) without further impulses, omega x^2 / e, which equals z + V x/e.

    Parameters
    ----------
    omega_rad_s, range_m : ndarray
        Line-of-sight rate and range x, of any common shape.
    closing_speed_m_s : float
        Nominal closing speed e.

    References
    ----------
    Kumkov and Patsko (1997), section 5, with the sign kept.
    """
    POSITIVE.need("closing_speed_m_s", closing_speed_m_s)
    return omega_rad_s * range_m**2 / closing_speed_m_s


def symmetric_impulse(interval: PredictedMiss, closing_speed_m_s: float, lead_s: float = 0.0) -> Floats:
    """Return the impulse k_s (m/s) after which the ends of the predicted-miss interval are opposite.

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
    ranges = range_at_impulse(interval.upper_point.range_m, closing_speed_m_s, lead_s) + range_at_impulse(
        interval.lower_point.range_m, closing_speed_m_s, lead_s
    )
    wanted = (interval.upper_m + interval.lower_m) * closing_speed_m_s
    return np.divide(wanted, ranges, out=np.zeros(ranges.shape), where=interval.exists & (ranges != 0.0))


def range_at_impulse(range_m: Floats, closing_speed_m_s: float, lead_s: float) -> Floats:
    """Return the range (m) after `lead_s`, at the impulse that is decided now; zero after the arrival."""
    return range_m if lead_s == 0.0 else np.maximum(range_m - closing_speed_m_s * lead_s, 0.0)


def impulse_beyond_dead_zone(
    miss_m: Floats, deviation_m: Floats, time_to_go_s: Floats, dead_zone: float, last_s: float
) -> Floats:
    """Return the impulse (m/s) that corrects the part of an estimated miss outside a dead zone.

    Parameters
    ----------
    miss_m, deviation_m : ndarray, shape (B,)
        Estimated zero-effort miss and its standard deviation, m.
    time_to_go_s : ndarray, shape (B,)
        Time to the closest approach, s; the impulse is zero where it is not positive.
    dead_zone : float
        Half-width of the dead zone, in standard deviations.
    last_s : float
        Time to go below which there is no dead zone, s.
    """
    zone = np.where(time_to_go_s > last_s, dead_zone, 0.0) * deviation_m
    excess = miss_m - np.clip(miss_m, -zone, zone)
    return np.divide(excess, time_to_go_s, out=np.zeros_like(miss_m), where=time_to_go_s > 0.0)
