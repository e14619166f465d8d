"""Measurement errors given in advance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from guidance.noise import LineOfSight, Measurement, need_draws
from infoset import InformationSetView

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class ScriptedNoise:
    """Measurements whose errors, in units of their bounds, were written down before the flight.

    Extremal errors are +1 and -1, a constant bias is one number in every step; any sequence within [-1, 1] will do.

    Parameters
    ----------
    angle_errors : ndarray, shape (B, steps)
        u of alpha_m = alpha + u h(d), in [-1, 1].
    range_errors : ndarray, shape (B, steps), or None
        u of d_m = d (1 + u b), in [-1, 1]; None measures ranges without error.
    rate_errors : ndarray, shape (B, steps), or None
        The same for the angular rate; None measures rates without error.

    Raises
    ------
    ValueError
        If an error is not within [-1, 1], or the arrays do not have one shape (B, steps).

    References
    ----------
    Kumkov and Patsko (1997), equations (4) and (5).
    """

    angle_errors: Floats
    range_errors: Floats | None = None
    rate_errors: Floats | None = None

    name: ClassVar[str] = "scripted"

    def __post_init__(self) -> None:
        for name in ("angle_errors", "range_errors", "rate_errors"):
            errors = getattr(self, name)
            if errors is None:
                continue
            need_draws(name, errors)
            if errors.shape != self.angle_errors.shape:
                raise ValueError(f"{name} must have the shape (B, steps), the same for all: got {errors.shape}")

    def measure(self, sight: LineOfSight, predicted: InformationSetView) -> Measurement:
        """Make the measurements of a step; the set is not looked at.

        Raises
        ------
        ValueError
            If the script is shorter than the flight.
        """
        step, steps = sight.step, self.angle_errors.shape[1]
        if step >= steps:
            raise ValueError(f"the errors are given for {steps} steps, and step {step} has none")
        return measure_with_errors(
            sight,
            self.angle_errors[:, step],
            None if self.range_errors is None else self.range_errors[:, step],
            None if self.rate_errors is None else self.rate_errors[:, step],
        )


def measure_with_errors(
    sight: LineOfSight, angle_error: Floats, range_error: Floats | None = None, rate_error: Floats | None = None
) -> Measurement:
    """What the sensors that measure in a step give, with these errors.

    Parameters
    ----------
    sight : LineOfSight
    angle_error, range_error, rate_error : ndarray, shape (B,)
        In units of the bounds; None is no error. Those of sensors that do not measure are not looked at.

    Returns
    -------
    Measurement
    """
    alpha = sight.alpha_rad + sight.angle_sensor.error_bound(sight.range_m) * angle_error
    distance = omega = None
    if sight.range_error is not None:
        factor = 1.0 if range_error is None else 1.0 + sight.range_error * range_error
        distance = sight.range_m * factor
    if sight.rate_error_rad_s is not None and sight.omega_rad_s is not None:
        offset = 0.0 if rate_error is None else sight.rate_error_rad_s * rate_error
        omega = sight.omega_rad_s + offset
    return Measurement(alpha, distance, omega)


def errors_made(sight: LineOfSight, measurement: Measurement) -> tuple[Floats, Floats, Floats]:
    """Errors of a measurement in units of the bounds: the inverse of `measure_with_errors`, to rounding.

    Parameters
    ----------
    sight : LineOfSight
    measurement : Measurement

    Returns
    -------
    angle_error, range_error, rate_error : ndarray, shape (B,)
        Within [-1, 1]; zeros for what was not measured.
    """
    angle, distance, omega = np.zeros((3, *sight.alpha_rad.shape))
    if measurement.alpha_rad is not None:
        angle = (measurement.alpha_rad - sight.alpha_rad) / sight.angle_sensor.error_bound(sight.range_m)
    if sight.range_error is not None and measurement.range_m is not None:
        distance = (measurement.range_m / sight.range_m - 1.0) / sight.range_error
    if sight.rate_error_rad_s and sight.omega_rad_s is not None and measurement.omega_rad_s is not None:
        omega = (measurement.omega_rad_s - sight.omega_rad_s) / sight.rate_error_rad_s
    return np.clip(angle, -1.0, 1.0), np.clip(distance, -1.0, 1.0), np.clip(omega, -1.0, 1.0)
