"""Uniform measurement noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from guidance.noise import LineOfSight, Measurement, need_draws
from guidance.scripted_noise import measure_with_errors
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
        The same for the angular rate, in [-1, 1]; None is no error.

    Raises
    ------
    TypeError, ValueError
        If a draw is not within [-1, 1], or an array not of shape (B, steps).

    References
    ----------
    Kumkov and Patsko (1997), section 7.
    """

    angle_draws: Floats
    range_draws: Floats
    rate_draws: Floats | None = None

    def __post_init__(self) -> None:
        for name in ("angle_draws", "range_draws", "rate_draws"):
            draws = getattr(self, name)
            if draws is not None or name != "rate_draws":
                need_draws(name, draws)

    def measure(self, sight: LineOfSight, predicted: InformationSetView) -> Measurement:
        """Draw the measurements of a step; the set is not looked at."""
        step = sight.step
        rate = None if self.rate_draws is None else self.rate_draws[:, step]
        return measure_with_errors(sight, self.angle_draws[:, step], self.range_draws[:, step], rate)
