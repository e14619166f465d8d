"""The impulse for an estimated miss with an uncertainty, shared by the strategies with estimators."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


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
