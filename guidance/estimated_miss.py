"""From an estimated miss and its uncertainty to an impulse: the part that the strategies with estimators share."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def impulse_beyond_dead_zone(
    miss_m: Floats, deviation_m: Floats, time_to_go_s: Floats, dead_zone: float, last_s: float
) -> Floats:
    """Impulse that corrects an estimated miss as far as it is surely there, and at the end as it is.

    Parameters
    ----------
    miss_m, deviation_m : ndarray, shape (B,)
        Estimated zero-effort miss and its standard deviation, m.
    time_to_go_s : ndarray, shape (B,)
        Time to the closest approach, s; without it (not positive) nothing is fired.
    dead_zone : float
        Half-width of the zone about zero that is left alone, in standard deviations.
    last_s : float
        Time to go from which on there is no dead zone, s: what is left now cannot wait.

    Returns
    -------
    ndarray, shape (B,)
        m/s.
    """
    zone = np.where(time_to_go_s > last_s, dead_zone, 0.0) * deviation_m
    excess = miss_m - np.clip(miss_m, -zone, zone)
    return np.divide(excess, time_to_go_s, out=np.zeros_like(miss_m), where=time_to_go_s > 0.0)
