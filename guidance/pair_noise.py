"""Measurement noise of the reference adversary: two truths measured as if they were one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from guidance.noise import LineOfSight, Measurement
from infoset import InformationSetView

Floats = NDArray[np.float64]


class PairNoise:
    """Measurements that cannot tell the two truths of a pair apart up to some step, and honest ones after it.

    Parameters
    ----------
    last_common_step : int
        The last step at which both truths of a pair are measured at the middle between them.
    angle_every : int
        Steps between measurements of the angle: at the others nobody looks at what is given.

    Attributes
    ----------
    greatest_share : float
        Greatest error given so far, in units of its bound. At most 1 where the noise has kept to its bounds.

    Notes
    -----
    Engagements 2k and 2k + 1 of a batch are a pair. What is common to both is measured, so that a strategy that sees
    nothing else does the same in both; the set is not looked at.
    """

    def __init__(self, last_common_step: int, angle_every: int = 1) -> None:
        self.last_common_step = last_common_step
        self.angle_every = angle_every
        self.greatest_share = 0.0

    def measure(self, sight: LineOfSight, predicted: InformationSetView) -> Measurement:
        """Measure the middle of each pair, or after the last common step the truth itself."""
        ranging, rating = sight.range_error is not None, sight.rate_error_rad_s is not None
        if sight.step > self.last_common_step:
            return Measurement(
                sight.alpha_rad, sight.range_m if ranging else None, sight.omega_rad_s if rating else None
            )
        alpha, measured_range, measured_rate = middle(sight.alpha_rad), None, None
        if sight.step % self.angle_every == 0:
            self._note(np.abs(alpha - sight.alpha_rad), sight.angle_sensor.error_bound(sight.range_m))
        if sight.range_error is not None:
            measured_range = middle(sight.range_m)
            self._note(np.abs(measured_range - sight.range_m), sight.range_error * sight.range_m)
        if sight.rate_error_rad_s is not None and sight.omega_rad_s is not None:
            measured_rate = middle(sight.omega_rad_s)
            self._note(np.abs(measured_rate - sight.omega_rad_s), np.full(len(alpha), sight.rate_error_rad_s))
        return Measurement(alpha, measured_range, measured_rate)

    def _note(self, error: Floats, bound: Floats) -> None:
        self.greatest_share = max(self.greatest_share, float((error / bound).max()))


def middle(values: Floats) -> Floats:
    """The mean of each two neighbours, for both of them.

    Parameters
    ----------
    values : ndarray, shape (B,)
        B even.

    Returns
    -------
    ndarray, shape (B,)
    """
    pairs = values.reshape(-1, 2)
    return np.repeat(pairs[:, 0] + 0.5 * (pairs[:, 1] - pairs[:, 0]), 2)
