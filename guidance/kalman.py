"""Zero-effort-miss guidance on a bank of extended Kalman filters: the stochastic baseline."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray

from guidance.predicted_miss import impulse_beyond_dead_zone
from guidance.situation import Situation
from infoset import RangeSensor
from infoset.limits import COUNT, NotNegative, check_fields

Floats = NDArray[np.float64]

Z, VZ, X, SPEED = range(4)
"""Components of a state: lateral offset, its rate, range and closing speed."""


@dataclass
class KalmanState:
    """A bank of M filters for each engagement, one for each interval of the possible ranges.

    Parameters
    ----------
    mean : ndarray, shape (B, M, 4)
        Estimates of (z, V_z, x, closing speed), m and m/s.
    covariance : ndarray, shape (B, M, 4, 4)
        Their covariances.
    log_weight : ndarray, shape (B, M)
        Logarithms of the probabilities of the intervals, up to a constant.
    """

    mean: Floats
    covariance: Floats
    log_weight: Floats


@dataclass(frozen=True)
class Kalman:
    """Estimate as if errors were Gaussian, and correct the part of the expected miss outside a dead zone.

    Parameters
    ----------
    dead_zone : float
        Half-width of the dead zone of the estimated miss, in standard deviations.
    last_s : float
        Time to go below which there is no dead zone, s.
    members : int
        Number of filters, one for each interval of the possible ranges.
    process_noise : float
        Standard deviation of the acceleration along z, constant over a step and independent between steps,
        in units of that of an acceleration uniform within the bound of the set's model.

    Raises
    ------
    TypeError, ValueError
        If a value is negative or not finite, or there is no filter.

    Notes
    -----
    The state is (z, V_z, x, closing speed) with z' = V_z, x' = -closing speed, and the impulses as given. The variance
    of a measurement is b^2/3, that of an error uniform within +-b, with b at the estimated range. The prior is uniform
    within the initial bounds of the set. Angles alone show the range only through the impulses, and one linearisation
    is poor for a wide prior of the range. Therefore each filter of the bank has an interval of the range, and its
    weight is the likelihood of its measurements (a range-parameterised filter). The impulse minimises the expected
    square of the miss over the bank, E[m tau]/E[tau^2], with the time to go tau. Cost: about 30 NumPy operations on B M
    stacked 4 x 4 matrices per step. Libraries such as filterpy run one filter at a time, in a Python loop.

    Limits: the filter guarantees nothing. Its deviations are those of independent errors; an error that keeps its sign,
    or changes it on purpose, is within the bound but outside the theory. A uniform error has sharp ends, which contain
    more information than its variance; an estimator of second moments cannot use it. The rate sensor is not used.

    References
    ----------
    Kalman (1960); Peach (1995), Bearings-only tracking using a set of range-parameterised extended Kalman filters.
    """

    dead_zone: NotNegative = 1.0
    last_s: NotNegative = 3.0
    members: Annotated[int, COUNT] = 9
    process_noise: NotNegative = 1.0

    name: ClassVar[str] = "kalman"

    def __post_init__(self) -> None:
        check_fields(self)

    def start(self, batch: int) -> KalmanState:
        """Start with empty filters; the first step sets their prior."""
        return KalmanState(
            np.zeros((batch, self.members, 4)), np.zeros((batch, self.members, 4, 4)), np.zeros((batch, self.members))
        )

    def decide(self, situation: Situation, state: KalmanState) -> Floats:
        """Predict, update with the new measurements, and return the impulses, m/s."""
        if situation.step == 0:
            self._set_prior(situation, state)
        else:
            self._predict(situation, state)
        _update_all(situation, state)
        return self._impulse(state)

    def _set_prior(self, situation: Situation, state: KalmanState) -> None:
        bounds = situation.information.model.bounds
        edges = np.linspace(*bounds.x_m, self.members + 1)
        stretch = (bounds.x_m[1] - bounds.x_m[0]) / self.members
        state.mean[..., Z] = 0.5 * (bounds.z_m[0] + bounds.z_m[1])
        state.mean[..., VZ] = 0.5 * (bounds.vz_m_s[0] + bounds.vz_m_s[1])
        state.mean[..., X] = 0.5 * (edges[:-1] + edges[1:])
        state.mean[..., SPEED] = -0.5 * (bounds.vx_m_s[0] + bounds.vx_m_s[1])
        widths = [np.ptp(bounds.z_m), np.ptp(bounds.vz_m_s), stretch, np.ptp(bounds.vx_m_s)]
        state.covariance[:] = np.diag(np.square(widths) / 12.0)

    def _predict(self, situation: Situation, state: KalmanState) -> None:
        step_s = situation.step_s
        state.mean[..., VZ] -= situation.last_impulse_m_s[:, None]
        motion = np.eye(4)
        motion[Z, VZ], motion[X, SPEED] = step_s, -step_s
        state.mean = state.mean @ motion.T
        state.covariance = motion @ state.covariance @ motion.T
        push = np.array([0.5 * step_s**2, step_s, 0.0, 0.0])
        variance = (self.process_noise * situation.information.model.acceleration_m_s2) ** 2 / 3.0
        state.covariance += variance * np.outer(push, push)

    def _impulse(self, state: KalmanState) -> Floats:
        ahead = state.mean[..., X] > 0.0
        weight = np.where(ahead, np.exp(state.log_weight - state.log_weight.max(axis=1, keepdims=True)), 0.0)
        total = weight.sum(axis=1, keepdims=True)
        weight = np.divide(weight, total, out=np.zeros_like(weight), where=total > 0.0)
        speed, velocity = state.mean[..., SPEED], state.mean[..., VZ]
        to_go = np.maximum(state.mean[..., X], 0.0) / speed
        miss = state.mean[..., Z] + velocity * to_go
        gradient = np.stack([np.ones_like(miss), to_go, velocity / speed, -velocity * to_go / speed], axis=-1)
        variance = np.einsum("bmi,bmij,bmj->bm", gradient, state.covariance, gradient)
        mean = (weight * miss).sum(axis=1)
        # Rounding may leave a small variance just below zero.
        spread = (weight * (np.maximum(variance, 0.0) + (miss - mean[:, None]) ** 2)).sum(axis=1)
        deviation = np.sqrt(spread)
        square = (weight * to_go**2).sum(axis=1)
        best = np.divide((weight * miss * to_go).sum(axis=1), square, out=np.zeros_like(mean), where=square > 0.0)
        to_go = (weight * to_go).sum(axis=1)
        return impulse_beyond_dead_zone(best * to_go, deviation, to_go, self.dead_zone, self.last_s)


def _update_all(situation: Situation, state: KalmanState) -> None:
    """Update the filters with the measurements of this step."""
    nearest = situation.closing_speed_m_s * situation.step_s * 0.1
    z, x = state.mean[..., Z], np.maximum(state.mean[..., X], nearest)
    meter, angle_sensor = situation.sensors.get("range"), situation.information.model.angle_sensor
    if "range" in situation.new and isinstance(meter, RangeSensor):
        gradient = np.zeros_like(state.mean)
        gradient[..., X] = 1.0
        variance = (meter.relative_error * x) ** 2 / 3.0
        _update(state, situation.measured["range"][:, None] - state.mean[..., X], gradient, variance)
        z, x = state.mean[..., Z], np.maximum(state.mean[..., X], nearest)
    if "angle" in situation.new:
        gradient = np.zeros_like(state.mean)
        square = z * z + x * x
        gradient[..., Z], gradient[..., X] = x / square, -z / square
        variance = angle_sensor.error_bound(x) ** 2 / 3.0
        _update(state, situation.measured["angle"][:, None] - np.arctan2(z, x), gradient, variance)


def _update(state: KalmanState, innovation: Floats, gradient: Floats, variance: Floats) -> None:
    """Update each filter with one scalar measurement, in Joseph's form, and its weight."""
    spread = np.einsum("bmij,bmj->bmi", state.covariance, gradient)
    # Rounding may leave a negative value where angles have reduced a variance by twenty decades.
    total = np.maximum(np.einsum("bmi,bmi->bm", gradient, spread), 0.0) + variance
    gain = spread / total[..., None]
    state.mean = state.mean + gain * innovation[..., None]
    keep = np.eye(4) - gain[..., :, None] * gradient[..., None, :]
    state.covariance = keep @ state.covariance @ np.swapaxes(keep, -1, -2)
    state.covariance += variance[..., None, None] * gain[..., :, None] * gain[..., None, :]
    state.log_weight = state.log_weight - 0.5 * (innovation**2 / total + np.log(total))
