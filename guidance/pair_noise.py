"""Measurement noise of the lower bound: two truths with the same measurements."""

from __future__ import annotations

import numpy as np

from guidance.noise import LineOfSight
from infoset import AngleSensor, Convention, InformationSetView
from infoset.arrays import Floats
from infoset.sensors import Measurements, Sensor


class PairNoise:
    """Measurements that are the same for the two truths of a pair up to some step, and exact after it.

    Engagements 2k and 2k + 1 of a batch are a pair. Both get the same measurements, so a strategy that uses nothing
    else acts alike in both.

    Parameters
    ----------
    last_common_step : int
        Last step in which both truths of a pair are measured at the middle between them: the mean of the measured
        values, or of the directions if the sensor measures a direction (`Convention.CONE`).

    Attributes
    ----------
    greatest_share : float
        Greatest error so far, in units of its bound; at most 1 if all errors are within their bounds.
    """

    def __init__(self, last_common_step: int) -> None:
        self.last_common_step = last_common_step
        self.greatest_share = 0.0

    def measure(self, sight: LineOfSight, predicted: InformationSetView) -> Measurements:
        """Measure the middle of each pair, or after the last common step the true values."""
        if sight.step > self.last_common_step:
            return {name: sensor.true_value(sight) for name, sensor in sight.sensors.items()}
        measured = {name: _common(sensor, sight) for name, sensor in sight.sensors.items()}
        for name, sensor in sight.sensors.items():
            error = sensor.error(sight, measured[name])
            is_disc = isinstance(sensor, AngleSensor) and sensor.is_disc
            share = np.hypot(*error) if is_disc else np.abs(error)
            self.greatest_share = max(self.greatest_share, float(share.max()))
        return measured


def _common(sensor: Sensor, sight: LineOfSight) -> Floats:
    """Return the common measurement of each pair, for both of them."""
    true = sensor.true_value(sight)
    if not (isinstance(sensor, AngleSensor) and sensor.convention is Convention.CONE):
        return middle(true)
    slopes = np.tan(true)
    directions = np.stack([*slopes, np.ones_like(slopes[0])])
    *lateral, along = middle(directions / np.linalg.norm(directions, axis=0))
    return np.asarray(np.arctan2(lateral, along))


def middle(values: Floats) -> Floats:
    """Return the mean of each pair of neighbours, for both of them; shape (..., B), B even."""
    first, second = values[..., 0::2], values[..., 1::2]
    return np.repeat(first + 0.5 * (second - first), 2, axis=-1)
