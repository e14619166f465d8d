"""The contract of measurement noise, and checks of its errors and measurements."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Protocol

import numpy as np

from infoset.arrays import Floats
from infoset.information_set import InformationSetView
from infoset.limits import real_array, real_values, shown
from infoset.sensors import Measurements, Sensor
from infoset.sensors.sensor import along_x_m


class TieRule(Enum):
    """Which extreme the game noise keeps when both are equally bad."""

    UPPER = "upper"
    LOWER = "lower"
    ALTERNATE = "alternate"
    RANDOM = "random"


@dataclass(frozen=True)
class LineOfSight:
    """True line of sight in one step, and the sensors that measure it.

    Parameters
    ----------
    step : int
        Number of the step.
    alpha_rad, omega_rad_s : ndarray, shape (C, B)
        True line-of-sight angles atan2(z, x), in space atan2(y, x) and atan2(z, x), rad, and their
        rates, rad/s.
    range_m : ndarray, shape (B,)
        True distance, m.
    sensors : mapping of str to Sensor
        Sensors that measure in this step, by name: "angle", "range", "rate".
    pending : sequence of (float, ndarray)
        Impulses that are decided and not given yet: time from now, s, and impulse, m/s, shape (C,
        B).
    time_s : float
        Time since the start, s.
    uniform : mapping of str to ndarray
        Random numbers of this step by sensor, with the shape of its measurements: independent,
        uniform in [-1, 1], and the same for a run of a seed in every batch.
    x_m : ndarray, shape (B,), or None
        True distance along x, m; None means that it follows from `alpha_rad` and `range_m`. A
        misaligned camera needs it, because its angles are turned.
    """

    step: int
    alpha_rad: Floats
    omega_rad_s: Floats
    range_m: Floats
    sensors: Mapping[str, Sensor]
    pending: Sequence[tuple[float, Floats]] = ()
    time_s: float = 0.0
    uniform: Mapping[str, Floats] = field(default_factory=dict)
    x_m: Floats | None = None

    @property
    def along_x_m(self) -> Floats:
        """Part of the distance along x, m, shape (B,)."""
        if self.x_m is not None:
            return self.x_m
        return along_x_m(self.alpha_rad, self.range_m)

    def shape(self, sensor: Sensor) -> tuple[int, ...]:
        """Return the shape of the measurements of a sensor."""
        return self.alpha_rad.shape if sensor.is_lateral else self.range_m.shape


def checked_measurements(
    measured: Measurements, sight: LineOfSight, noise: object
) -> dict[str, Floats]:
    """Return the measurements of a noise as arrays.

    Numbers that are not real or not finite raise as in `real_array`.

    Raises
    ------
    TypeError, ValueError
        If the noise returned no mapping, measured with a sensor that does not measure in this step,
        or returned an array whose shape is not the shape of the measurements.
    """
    where = f"noise {type(noise).__name__} at step {sight.step}"
    if not isinstance(measured, Mapping):
        raise TypeError(
            f"{where} must return a mapping from sensor names to measured values, for example "
            f'{{"angle": sight.alpha_rad}}: got {type(measured).__name__}'
        )

    checked = {}
    for name, values in measured.items():
        if name not in sight.sensors:
            raise ValueError(
                f"{where}: sensor {name!r} does not measure at this step, only "
                f"{sorted(sight.sensors)}; leave it out: got {shown(values)}"
            )
        shape = sight.shape(sight.sensors[name])
        if np.ndim(values) == 0:
            raise ValueError(
                f"{where}: {name} must be an array of the shape {shape}: got {shown(values)}"
            )
        checked[name] = real_array(f"{where}: {name}", values, shape)
    return checked


def need_draws(name: str, draws: Floats) -> None:
    """Raise ValueError unless errors, in units of their bounds, are in [-1, 1].

    Their shape must be (C, B, steps) or (B, steps).
    """
    if not isinstance(draws, np.ndarray) or draws.ndim not in (2, 3):
        raise ValueError(
            f"{name} must have the shape (C, B, steps), or (B, steps) for ranges: got "
            f"{np.shape(draws)}"
        )
    if not (np.abs(real_values(name, draws)) <= 1.0).all():  # refuses NaN as well
        raise ValueError(f"{name} must lie within [-1, 1], in units of the bound")


def draws_of_step(name: str, draws: Floats, step: int, shape: tuple[int, ...]) -> Floats:
    """Return the draws of one step.

    ValueError is raised if there are none, or the measurements have another shape.
    """
    steps = draws.shape[-1]
    if draws.shape[:-1] != shape:
        raise ValueError(
            f"{name} must have the shape {(*shape, steps)} in this engagement: got {draws.shape}"
        )
    if step >= steps:
        raise ValueError(f"{name} has {steps} steps, none for step {step}: give one for each step")
    return draws[..., step]


class MeasurementNoise(Protocol):
    """A rule that chooses measurement errors within their bounds."""

    def measure(self, sight: LineOfSight, predicted: InformationSetView) -> Measurements:
        """Choose the measurements of a step.

        Parameters
        ----------
        sight : LineOfSight
            True line of sight, and the sensors that measure.

        Returns
        -------
        mapping of str to ndarray
            Measured values by sensor: angles (rad) and rates (rad/s), shape (C, B), ranges (m),
            shape (B,). A sensor that is left out gives no measurement in this step.
        """


NoiseSource = MeasurementNoise | Callable[[], MeasurementNoise]
"""A noise of all batches of runs, or a class or function that is called for the noise of each
batch.
"""
