"""Estimates of the motion along one lateral axis, as guidance uses them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from guidance.situation import Situation
from infoset import Bias, SetModel
from infoset.arrays import Floats
from infoset.sensors import AngleSensor


@dataclass(frozen=True)
class MissEstimate:
    """Zero-effort miss of a batch of engagements: the miss without further impulses.

    Parameters
    ----------
    miss_m, deviation_m : ndarray, shape (B,)
        Signed miss and its standard deviation, m. Pending impulses count as given.
    to_go_s : ndarray, shape (B,)
        Time from the impulse that is decided now to the closest approach, s; not negative.

    Notes
    -----
    The rate of the line of sight at the impulse is miss / (c tau^2), with the closing speed c and the time to go tau.
    """

    miss_m: Floats
    deviation_m: Floats
    to_go_s: Floats

    @property
    def correction_m_s(self) -> Floats:
        """Impulse that makes the miss zero, m/s, shape (B,); zero at the closest approach."""
        return self._correcting(self.miss_m)

    def correction_outside_m_s(self, dead_zone: float, last_s: float) -> Floats:
        """Return the impulse that corrects the part of the miss beyond `dead_zone` standard deviations, m/s."""
        zone = np.where(self.to_go_s > last_s, dead_zone, 0.0) * self.deviation_m
        return self._correcting(self.miss_m - np.clip(self.miss_m, -zone, zone))

    def _correcting(self, miss_m: Floats) -> Floats:
        return np.divide(miss_m, self.to_go_s, out=np.zeros_like(miss_m), where=self.to_go_s > 0.0)


class Estimator(Protocol):
    """A filter or a fit for a batch of engagements along one lateral axis."""

    def update(self, situation: Situation) -> None:
        """Use the impulse of the previous step and the measurements of this one; call it once a step."""

    def estimate(self, situation: Situation) -> MissEstimate:
        """Return the estimate after `update` of the same step."""


EstimatorKind = Callable[[int, bool], Estimator]
"""Makes an estimator from the number of engagements and whether it estimates the acceleration of the target."""


def independent_error_rad(model: SetModel, range_m: Floats) -> Floats:
    """Return the bound of the part of an angle error that is independent between measurements, rad.

    A line that falls with the range is positive up to the maximum possible distance, and an estimate can be beyond it.
    The bound is therefore at least half of that at the maximum distance.
    """
    sensor = model.angle_sensor
    if sensor.bias is Bias.CONSTANT:
        return np.full_like(range_m, sensor.constant_error_rad)
    return np.maximum(sensor.error_bound(range_m), 0.5 * sensor.error_bound(model.bounds.farthest_m))


def constant_error_m(sensor: AngleSensor) -> float:
    """Return the bound of the part of the errors that is constant in a flight, m.

    The angles then show a point at this lateral distance from the centre, which no measurement can tell from the
    centre: the error of an estimated miss contains it unchanged.
    """
    return sensor.centroid_error_m if sensor.bias is Bias.CONSTANT else 0.0


def correct_outside_dead_zone(situation: Situation, estimator: Estimator, dead_zone: float, last_s: float) -> Floats:
    """Update an estimator, and return the impulses (m/s) that correct the part of the miss outside a dead zone.

    The dead zone is in standard deviations of the miss. There is none in the last seconds, `last_s`, before the closest
    approach, and before the last impulse that the engine allows.
    """
    estimator.update(situation)
    if not situation.may_fire:
        return np.zeros_like(situation.last_impulse_m_s)
    is_last = situation.last_s - situation.lead_s <= last_s
    return estimator.estimate(situation).correction_outside_m_s(0.0 if is_last else dead_zone, last_s)
