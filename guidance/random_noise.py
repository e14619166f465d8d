"""Uniform measurement noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from guidance.noise import LineOfSight, Measurement
from infoset import InformationSetView

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class RandomNoise:
    """Measurements uniform in the intervals that the truth allows.

    Parameters
    ----------
    angle_draws, range_draws : ndarray, shape (B, steps)
        Uniform in [-1, 1]; the error is the draw times the bound.
    rate_draws : ndarray, shape (B, steps), or None
        The same for the angular rate, in [-1, 1]; None where there is no such sensor.

    References
    ----------
    Kumkov and Patsko (1997), section 7.
    """

    angle_draws: Floats
    range_draws: Floats
    rate_draws: Floats | None = None

    def measure(self, sight: LineOfSight, predicted: InformationSetView) -> Measurement:
        """Draw the measurements of a step; the set is not looked at."""
        bound = sight.angle_sensor.error_bound(sight.range_m)
        alpha = sight.alpha_rad + bound * self.angle_draws[:, sight.step]
        distance = omega = None
        if sight.range_error is not None:
            distance = sight.range_m * (1.0 + sight.range_error * self.range_draws[:, sight.step])
        if sight.rate_error_rad_s is not None and sight.omega_rad_s is not None and self.rate_draws is not None:
            omega = sight.omega_rad_s + sight.rate_error_rad_s * self.rate_draws[:, sight.step]
        return Measurement(alpha, distance, omega)
