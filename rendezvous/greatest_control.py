"""How hard a thruster is driven at most: the greatest size of a control over a time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_SAMPLES, _ROUNDS = 257, 3


def greatest_control(control: Callable[[Floats], Floats], start_s: float, end_s: float) -> float:
    """Return the greatest |u| of a control that is smooth between two times, m/s^2.

    Parameters
    ----------
    control : callable
        u, shape (k, 3), m/s^2, at times of shape (k,), s.
    start_s, end_s : float

    Returns
    -------
    float

    Notes
    -----
    The greatest of 257 samples, then of samples 128 times as dense around it, twice.
    """
    low, high, greatest = start_s, end_s, 0.0
    for _ in range(_ROUNDS):
        times = np.linspace(low, high, _SAMPLES)
        sizes = np.linalg.norm(control(times), axis=1)
        top = int(sizes.argmax())
        greatest = max(greatest, float(sizes[top]))
        low, high = float(times[max(top - 1, 0)]), float(times[min(top + 1, _SAMPLES - 1)])
    return greatest
