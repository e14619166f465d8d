"""Least-squares fit to all measurements so far, and zero-effort-miss guidance on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from guidance.estimate import MissEstimate, constant_error_m, correct_outside_dead_zone, independent_error_rad
from guidance.situation import Situation
from infoset import RangeSensor
from infoset.arrays import Flags, Floats
from infoset.limits import COUNT, Checked, NotNegative

Z, VZ, X, SPEED, ACCELERATION = range(5)
"""Components of a start: lateral offset, its rate, range and closing speed at t = 0, and lateral acceleration."""

MAX_KEPT = 640
"""Maximum number of measurements of a sensor that are linearised again at each fit."""


@dataclass(frozen=True)
class Measurements:
    """Measurements of one sensor that are linearised at each fit, at times of shape (n,).

    `values`, rad or m, and `offsets_m`, the change of z by the impulses until then, have the shape (B, n), as `seen`:
    whether an engagement measured.
    """

    times_s: Floats
    values: Floats
    offsets_m: Floats
    seen: Flags

    def with_one(self, time_s: float, value: Floats, offset_m: Floats, seen: Flags) -> Measurements:
        """Return these measurements and a further one."""
        return Measurements(
            np.append(self.times_s, time_s),
            np.column_stack([self.values, np.where(seen, value, 0.0)]),
            np.column_stack([self.offsets_m, offset_m]),
            np.column_stack([self.seen, seen]),
        )

    def part(self, which: slice) -> Measurements:
        """Return some of the measurements."""
        return Measurements(self.times_s[which], self.values[:, which], self.offsets_m[:, which], self.seen[:, which])


class LeastSquaresFit:
    """One motion for each engagement, fitted to all measurements so far.

    Parameters
    ----------
    is_augmented : bool
        Estimate the lateral acceleration of the target, which is constant in the fit.
    iterations : int
        Gauss-Newton steps of a fit, starting from the previous fit.

    Attributes
    ----------
    start : ndarray, shape (B, n)
        Fitted (z, V_z, x, closing speed) at t = 0, m and m/s, and the acceleration, m/s^2, if n is 5.
    speed_given_m_s, offset_given_m : ndarray, shape (B,)
        Sum of the impulses so far, and the change of z by them, sum k_j (t - t_j).

    Notes
    -----
    The motion is z(t) = z_0 + V_0 t + a t^2/2 - sum k_j (t - t_j), x(t) = x_0 - c t, with the impulses as given. A fit
    solves the normal equations of all measurements, with weights 1/variance: b^2/3 for an error uniform within +-b, and
    width^2/12 for the initial bounds, which count as one more measurement. The acceleration a has the variance nu^2/3,
    with the bound nu of the set's model. The covariance of the miss is that of the normal equations.

    If there are more than `MAX_KEPT` measurements of a sensor, the older half is linearised once and for all at the
    fit of that step, and only its normal equations are stored. The linearised angle keeps the errors z - x tan(alpha)
    that a change of scale of the motion keeps, so a later change of the estimated range does no harm. The cost of a
    step is thus bounded: about 20 operations on arrays of B `MAX_KEPT` values for each iteration. A step without a
    decision has no fit.

    With a constant centroid error of a camera, the noise is the pixel part, and c^2/3 is added to the variance of the
    miss.

    References
    ----------
    Gauss (1809); Björck (1996), Numerical methods for least squares problems, chapter 9.
    """

    name: ClassVar[str] = "least-squares"

    def __init__(self, batch: int, is_augmented: bool = False, iterations: int = 3) -> None:
        self._size = 5 if is_augmented else 4
        self._iterations = iterations
        self.start = np.zeros((batch, self._size))
        none = np.empty((batch, 0))
        self.measurements = dict.fromkeys(("angle", "range"), Measurements(np.empty(0), none, none, none.astype(bool)))
        self.speed_given_m_s = np.zeros(batch)
        self.offset_given_m = np.zeros(batch)
        self._stored_normal = np.zeros((batch, self._size, self._size))
        self._stored_right = np.zeros((batch, self._size))

    def update(self, situation: Situation) -> None:
        """Store the impulse of the previous step and the measurements of this one."""
        if situation.step == 0:
            self.start[:], _ = self._prior(situation)
        else:
            self.speed_given_m_s = self.speed_given_m_s + situation.last_impulse_m_s
            self.offset_given_m = self.offset_given_m + situation.step_s * self.speed_given_m_s
        for name in [name for name in self.measurements if name in situation.new]:
            value, seen = situation.measured[name], situation.is_new(name)
            kept = self.measurements[name].with_one(situation.time_s, value, self.offset_given_m, seen)
            self.measurements[name] = kept
            if len(kept.times_s) > MAX_KEPT:
                self._store_older_half(situation, name)

    def estimate(self, situation: Situation) -> MissEstimate:
        """Fit the motion again, and return the miss."""
        covariance = self._fit(situation)
        time, start = situation.time_s, self.start
        z_now = start[:, Z] + start[:, VZ] * time - self.offset_given_m
        v_now = start[:, VZ] - self.speed_given_m_s
        arrival = start[:, X] / start[:, SPEED]
        to_go = np.maximum(arrival - time, 0.0)
        miss, v_final = z_now + v_now * to_go, v_now
        if self._size > ACCELERATION:
            miss = miss + 0.5 * start[:, ACCELERATION] * arrival**2
            v_final = v_now + start[:, ACCELERATION] * arrival
        gradient = [np.ones_like(z_now), arrival, v_final / start[:, SPEED], -v_final * arrival / start[:, SPEED]]
        if self._size > ACCELERATION:
            gradient.append(0.5 * arrival**2)
        by_start = np.stack(gradient, axis=-1)
        variance = np.einsum("bi,bij,bj->b", by_start, covariance, by_start)
        constant = constant_error_m(situation.information.model.angle_sensor)
        return MissEstimate(
            miss - situation.pending_m(to_go),
            np.sqrt(variance + constant**2 / 3.0),
            np.maximum(to_go - situation.lead_s, 0.0),
        )

    def _prior(self, situation: Situation) -> tuple[Floats, Floats]:
        """Return mean and variances of the start."""
        model = situation.information.model
        bounds, sensor, e = model.bounds, model.angle_sensor, situation.closing_speed_m_s
        intervals = np.array([bounds.z_m, bounds.vz_m_s, bounds.x_m, (-bounds.vx_m_s[1], -bounds.vx_m_s[0])])
        # An exactly known value gets a variance that is negligible against its size and against the angle errors.
        angle = max(sensor.constant_error_rad, sensor.error_at_nominal_range_rad or 0.0)
        resolved = np.array([angle * bounds.x_m[1], angle * e, 0.0, 0.0])
        if self._size > ACCELERATION:
            nu = model.acceleration_m_s2
            intervals = np.array([*intervals, (-nu, nu)])
            resolved = np.array([*resolved, angle * e * e / bounds.x_m[1]])
        widths = np.maximum(np.ptp(intervals, axis=1), 1e-9 * np.maximum(np.abs(intervals).max(axis=1), resolved))
        return intervals.mean(axis=1), widths**2 / 12.0

    def _fit(self, situation: Situation) -> Floats:
        """Fit the start, and return its covariance, shape (B, n, n)."""
        centre, variance = self._prior(situation)
        for _ in range(self._iterations):
            covariance = self._improve(situation, centre, variance)
        return covariance

    def _improve(self, situation: Situation, centre: Floats, variance: Floats) -> Floats:
        """Do one Gauss-Newton step on all measurements; return the covariance of the fit, shape (B, n, n)."""
        start = self.start
        normal = np.broadcast_to(np.diag(1.0 / variance), (len(start), self._size, self._size)).copy()
        right = (centre - start) / variance
        for name, measurements in self.measurements.items():
            if len(measurements.times_s):
                own_normal, own_right = self._equations(situation, name, measurements)
                normal += own_normal
                right += own_right
        normal += self._stored_normal
        right += self._stored_right - np.einsum("bij,bj->bi", self._stored_normal, start - centre)
        # In units of the prior's deviations, which span six decades, the prior is the identity, so no exact eigenvalue
        # is less than 1. Rounding errors matter where angles determine one direction ten decades better than another.
        scale = np.sqrt(variance)
        values, vectors = np.linalg.eigh(normal * np.outer(scale, scale))
        inverse = (vectors / np.maximum(values, 1.0)[:, None, :]) @ np.swapaxes(vectors, 1, 2)
        covariance = inverse * np.outer(scale, scale)
        self.start = start + np.einsum("bij,bj->bi", covariance, right)
        nearest = 0.1 * situation.step_s * situation.closing_speed_m_s
        self.start[:, X] = np.maximum(self.start[:, X], self.start[:, SPEED] * situation.time_s + nearest)
        return np.asarray(covariance)

    def _equations(self, situation: Situation, name: str, measurements: Measurements) -> tuple[Floats, Floats]:
        """Return matrix and right side of the normal equations of measurements, linearised at the present fit."""
        start, times = self.start, measurements.times_s
        z = start[:, Z, None] + start[:, VZ, None] * times - measurements.offsets_m
        if self._size > ACCELERATION:
            z = z + 0.5 * start[:, ACCELERATION, None] * times**2
        nearest = 0.1 * situation.step_s * situation.closing_speed_m_s
        x = np.maximum(start[:, X, None] - start[:, SPEED, None] * times, nearest)
        square = z * z + x * x
        if name == "angle":
            bound, residual = (
                independent_error_rad(situation.information.model, x),
                measurements.values - np.arctan2(z, x),
            )
            by_z, by_x = x / square, -z / square
        else:
            meter = situation.sensors["range"]
            assert isinstance(meter, RangeSensor)
            distance = np.sqrt(square)
            bound, residual = meter.relative_error * distance, measurements.values - distance
            by_z, by_x = z / distance, x / distance
        columns = [by_z, by_z * times, by_x, -by_x * times]
        if self._size > ACCELERATION:
            columns.append(0.5 * by_z * times**2)
        jacobian = np.stack(columns, axis=-1)
        weighted = jacobian * (3.0 * measurements.seen / bound**2)[..., None]
        return np.swapaxes(weighted, 1, 2) @ jacobian, np.einsum("bni,bn->bi", weighted, residual)

    def _store_older_half(self, situation: Situation, name: str) -> None:
        """Replace the older half of the measurements of a sensor by their normal equations."""
        self._fit(situation)
        kept = self.measurements[name]
        normal, right = self._equations(situation, name, kept.part(slice(MAX_KEPT // 2)))
        centre, _ = self._prior(situation)
        self._stored_normal = self._stored_normal + normal
        self._stored_right = self._stored_right + right + np.einsum("bij,bj->bi", normal, self.start - centre)
        self.measurements[name] = kept.part(slice(MAX_KEPT // 2, None))


@dataclass(frozen=True)
class LeastSquares(Checked):
    """Fit one motion to all measurements, and correct the part of its miss outside a dead zone.

    Parameters
    ----------
    dead_zone : float
        Half-width of the dead zone of the estimated miss, in standard deviations.
    last_s : float
        Time to go below which there is no dead zone, s. With a cut-off, the time before the cut-off.
    iterations : int
        Gauss-Newton steps after each measurement, starting from the previous fit.

    Raises
    ------
    TypeError, ValueError
        If a value is negative or not finite, or `iterations` is less than 1.

    Notes
    -----
    `LeastSquaresFit` describes the fit. The last decision before the arrival that the engine allows has no dead zone.

    Limits: there is no process noise, so manoeuvres of the target and errors of the engine are not modelled. One
    linearisation describes the remaining uncertainty, and without a range sensor the range is known poorly until the
    end. Nothing is guaranteed; errors that keep their sign, or change it on purpose, are outside the theory. The rate
    sensor is not used.
    """

    dead_zone: NotNegative = 1.0
    last_s: NotNegative = 3.0
    iterations: Annotated[int, COUNT] = 3

    name: ClassVar[str] = "least-squares"

    def start(self, batch: int) -> LeastSquaresFit:
        """Start without measurements."""
        return LeastSquaresFit(batch, iterations=self.iterations)

    def decide(self, situation: Situation, state: LeastSquaresFit) -> Floats:
        """Fit the motion again, and return the impulses, m/s."""
        return correct_outside_dead_zone(situation, state, self.dead_zone, self.last_s)
