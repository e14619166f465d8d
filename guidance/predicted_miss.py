"""Predicted miss of single states, and the impulse that makes an interval of them symmetric."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from infoset import PredictedMiss
from infoset.limits import POSITIVE

Floats = NDArray[np.float64]


def zero_effort_miss(omega_rad_s: Floats, range_m: Floats, closing_speed_m_s: float) -> Floats:
    """Signed miss without further control, omega x^2 / e.

    Parameters
    ----------
    omega_rad_s, range_m : ndarray
        Line-of-sight rate and range, of any common shape.
    closing_speed_m_s : float
        e.

    Returns
    -------
    ndarray
        m; it equals z + V x/e.

    References
    ----------
    Kumkov and Patsko (1997), section 5, with the sign kept.
    """
    POSITIVE.need("closing_speed_m_s", closing_speed_m_s)
    return omega_rad_s * range_m**2 / closing_speed_m_s


def symmetric_impulse(interval: PredictedMiss, closing_speed_m_s: float) -> Floats:
    """Impulse k_s after which the ends of the predicted-miss interval are opposite.

    Parameters
    ----------
    interval : PredictedMiss
        One interval an engagement.
    closing_speed_m_s : float
        e.

    Returns
    -------
    ndarray, shape (B,)
        m/s; zero where there is no interval.

    References
    ----------
    Kumkov and Patsko (1997), equation (15).
    """
    POSITIVE.need("closing_speed_m_s", closing_speed_m_s)
    ranges = interval.upper_point.range_m + interval.lower_point.range_m
    wanted = (interval.upper_m + interval.lower_m) * closing_speed_m_s
    return np.divide(wanted, ranges, out=np.zeros_like(ranges), where=interval.exists & (ranges != 0.0))
