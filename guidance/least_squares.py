"""Zero-effort-miss guidance on a least-squares fit to all measurements so far."""

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
"""Components of a start: lateral offset, its rate, range and closing speed, all at t = 0."""


class Measurements:
    """All measurements of one sensor so far: times, s, shape (n,); values, rad or m, shape (B, n)."""

    def __init__(self, batch: int) -> None:
        self.times_s = np.empty(0)
        self.values = np.empty((batch, 0))
        self.offsets_m = np.empty((batch, 0))
        """Change of z by the impulses until then, m, shape (B, n)."""

    def add(self, time_s: float, value: Floats, offset_m: Floats) -> None:
        """Append a measurement."""
        self.times_s = np.append(self.times_s, time_s)
        self.values = np.column_stack([self.values, value])
        self.offsets_m = np.column_stack([self.offsets_m, offset_m])


class LeastSquaresState:
    """Measurements and impulses so far, and the motion fitted to them."""

    def __init__(self, batch: int) -> None:
        self.start = np.zeros((batch, 4))
        """Fitted (z, V_z, x, closing speed) at t = 0, m and m/s."""
        self.angles = Measurements(batch)
        self.ranges = Measurements(batch)
        self.speed_given_m_s = np.zeros(batch)
        """Sum of the impulses so far."""
        self.offset_given_m = np.zeros(batch)
        """Change of z by the impulses, sum k_j (t - t_j)."""


@dataclass(frozen=True)
class LeastSquares:
    """Fit one motion to all measurements, and correct the part of its miss outside a dead zone.

    Parameters
    ----------
    dead_zone : float
        Half-width of the dead zone of the estimated miss, in standard deviations.
    last_s : float
        Time to go below which there is no dead zone, s.
    iterations : int
        Gauss-Newton steps after each measurement, starting from the previous fit.

    Raises
    ------
    TypeError, ValueError
        If a value is negative or not finite, or `iterations` is less than 1.

    Notes
    -----
    The motion is z(t) = z_0 + V_0 t - sum k_j (t - t_j), x(t) = x_0 - c t, with four unknowns and the impulses as
    given. Each step solves the 4 x 4 normal equations over all measurements, with weights 1/variance: b^2/3 for an
    error uniform within +-b, and width^2/12 for the initial bounds, which count as one more measurement. The
    covariance of the miss is that of the normal equations. Cost: each step uses all measurements, about 200 here, at a
    few microseconds each per batch.

    Limits: there is no process noise, so manoeuvres of the target and errors of the engine are not modelled. One
    linearisation describes the remaining uncertainty, and without a range meter the range is known poorly until the
    end. Nothing is guaranteed; errors that keep their sign, or change it on purpose, are outside the theory. The rate
    sensor is not used.

    References
    ----------
    Gauss (1809); Björck (1996), Numerical methods for least squares problems, chapter 9.
    """

    dead_zone: NotNegative = 1.0
    last_s: NotNegative = 3.0
    iterations: Annotated[int, COUNT] = 3

    name: ClassVar[str] = "least-squares"

    def __post_init__(self) -> None:
        check_fields(self)

    def start(self, batch: int) -> LeastSquaresState:
        """Start without measurements."""
        return LeastSquaresState(batch)

    def decide(self, situation: Situation, state: LeastSquaresState) -> Floats:
        """Fit the motion again, and return the impulses, m/s."""
        _note(situation, state)
        centre, variance = _prior(situation)
        if situation.step == 0:
            state.start[:] = centre
        covariance = np.broadcast_to(np.diag(variance), (len(state.start), 4, 4))
        for _ in range(self.iterations):
            covariance = _improve(situation, state, centre, variance)
        z_now, v_now, to_go, gradient = _miss(situation, state)
        deviation = np.sqrt(np.einsum("bi,bij,bj->b", gradient, covariance, gradient))
        return impulse_beyond_dead_zone(z_now + v_now * to_go, deviation, to_go, self.dead_zone, self.last_s)


def _note(situation: Situation, state: LeastSquaresState) -> None:
    """Store the impulse of the previous step and the measurements of this one."""
    if situation.step > 0:
        state.speed_given_m_s = state.speed_given_m_s + situation.last_impulse_m_s
        state.offset_given_m = state.offset_given_m + situation.step_s * state.speed_given_m_s
    for name, kept in (("angle", state.angles), ("range", state.ranges)):
        if name in situation.new:
            kept.add(situation.time_s, situation.measured[name], state.offset_given_m)


def _prior(situation: Situation) -> tuple[Floats, Floats]:
    """Return mean and variances of the start."""
    bounds = situation.information.model.bounds
    intervals = np.array([bounds.z_m, bounds.vz_m_s, bounds.x_m, (-bounds.vx_m_s[1], -bounds.vx_m_s[0])])
    # An exactly known value gets a variance that is negligible against its size and against the angle errors.
    sensor = situation.information.model.angle_sensor
    angle = max(sensor.error_at_zero_range_rad, sensor.error_at_nominal_range_rad)
    resolved = np.array([angle * bounds.x_m[1], angle * situation.closing_speed_m_s, 0.0, 0.0])
    widths = np.maximum(np.ptp(intervals, axis=1), 1e-9 * np.maximum(np.abs(intervals).max(axis=1), resolved))
    return intervals.mean(axis=1), widths**2 / 12.0


def _improve(situation: Situation, state: LeastSquaresState, centre: Floats, variance: Floats) -> Floats:
    """Do one Gauss-Newton step on all measurements; return the covariance of the fit, shape (B, 4, 4)."""
    start, model = state.start, situation.information.model
    normal = np.broadcast_to(np.diag(1.0 / variance), (len(start), 4, 4)).copy()
    right = (centre - start) / variance
    nearest = 0.1 * situation.step_s * situation.closing_speed_m_s
    for measurements, are_angles in ((state.angles, True), (state.ranges, False)):
        if not len(measurements.times_s):
            continue
        times, measured = measurements.times_s, measurements.values
        z = start[:, Z, None] + start[:, VZ, None] * times - measurements.offsets_m
        x = np.maximum(start[:, X, None] - start[:, SPEED, None] * times, nearest)
        square = z * z + x * x
        if are_angles:
            bound, residual = model.angle_sensor.error_bound(x), measured - np.arctan2(z, x)
            by_z, by_x = x / square, -z / square
        else:
            meter = situation.sensors["range"]
            assert isinstance(meter, RangeSensor)
            distance = np.sqrt(square)
            bound, residual = meter.relative_error * distance, measured - distance
            by_z, by_x = z / distance, x / distance
        jacobian = np.stack([by_z, by_z * times, by_x, -by_x * times], axis=-1)
        weighted = jacobian * (3.0 / bound**2)[..., None]
        normal += np.swapaxes(weighted, 1, 2) @ jacobian
        right += np.einsum("bni,bn->bi", weighted, residual)
    # In units of the prior's deviations, which span six decades, the prior is the identity, so no exact eigenvalue is
    # less than 1. Rounding errors matter where angles determine one direction ten decades better than another.
    scale = np.sqrt(variance)
    values, vectors = np.linalg.eigh(normal * np.outer(scale, scale))
    inverse = (vectors / np.maximum(values, 1.0)[:, None, :]) @ np.swapaxes(vectors, 1, 2)
    covariance = inverse * np.outer(scale, scale)
    state.start = start + np.einsum("bij,bj->bi", covariance, right)
    state.start[:, X] = np.maximum(state.start[:, X], state.start[:, SPEED] * situation.time_s + nearest)
    return np.asarray(covariance)


def _miss(situation: Situation, state: LeastSquaresState) -> tuple[Floats, Floats, Floats, Floats]:
    """Return z, V_z and time to go now, and the gradient of the miss by the start, shape (B, 4)."""
    time, start = situation.time_s, state.start
    z_now = start[:, Z] + start[:, VZ] * time - state.offset_given_m
    v_now = start[:, VZ] - state.speed_given_m_s
    arrival = start[:, X] / start[:, SPEED]
    to_go = np.maximum(arrival - time, 0.0)
    gradient = np.stack(
        [np.ones_like(z_now), arrival, v_now / start[:, SPEED], -v_now * arrival / start[:, SPEED]], axis=-1
    )
    return z_now, v_now, to_go, gradient
