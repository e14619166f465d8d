"""The contract of measurement noise, and its kinds."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from infoset import AngleSensor, InformationSetView
from infoset.limits import real_array, real_values, shown

Floats = NDArray[np.float64]


class NoiseKind(Enum):
    """How nature chooses the measurement errors within their bounds."""

    RANDOM = "random"
    GAME = "game"


class TieRule(Enum):
    """Which extreme the game noise keeps when both are equally bad."""

    UPPER = "upper"
    LOWER = "lower"
    ALTERNATE = "alternate"
    RANDOM = "random"


@dataclass(frozen=True)
class LineOfSight:
    """What the sensors look at in one step: the truth, and what they can tell of it.

    Parameters
    ----------
    step : int
        Number of the step.
    alpha_rad, range_m : ndarray, shape (B,)
        True line-of-sight angle and range.
    angle_sensor : AngleSensor
        Error law of the angle.
    range_error : float or None
        Relative error bound b of the range meter; None where it does not measure in this step.
    omega_rad_s : ndarray, shape (B,), or None
        True rate of the line of sight.
    rate_error_rad_s : float or None
        Error bound of the rate sensor; None where it does not measure in this step.
    """

    step: int
    alpha_rad: Floats
    range_m: Floats
    angle_sensor: AngleSensor
    range_error: float | None
    omega_rad_s: Floats | None = None
    rate_error_rad_s: float | None = None


@dataclass(frozen=True)
class Measurement:
    """What the sensors give.

    Parameters
    ----------
    alpha_rad : ndarray, shape (B,), or None
        Measured line-of-sight angle, rad; None where there was none: the sensor has dropped out.
    range_m : ndarray, shape (B,), or None
        Measured range, m; None where it was not measured.
    omega_rad_s : ndarray, shape (B,), or None
        Measured rate, rad/s; None where it was not measured.
    """

    alpha_rad: Floats | None
    range_m: Floats | None
    omega_rad_s: Floats | None = None


def checked_measurement(measurement: Measurement, sight: LineOfSight, noise: object) -> Measurement:
    """Return what a noise has measured, with arrays of shape (B,), if the sensors that measure in a step can give it.

    Parameters
    ----------
    measurement : Measurement
    sight : LineOfSight
        What the noise was given.
    noise : object
        The noise, for the message.

    Returns
    -------
    Measurement

    Raises
    ------
    TypeError
        If it is no measurement, or holds anything but real numbers.
    ValueError
        If a number is not finite, a shape is wrong, or a sensor was not asked.
    """
    where = f"noise {type(noise).__name__} at step {sight.step}"
    if not isinstance(measurement, Measurement):
        raise TypeError(f"{where} must return a Measurement: got {type(measurement).__name__}")
    asked = {
        "alpha_rad": (measurement.alpha_rad, True),
        "range_m": (measurement.range_m, sight.range_error is not None),
        "omega_rad_s": (measurement.omega_rad_s, sight.rate_error_rad_s is not None),
    }
    for name, (value, measures) in asked.items():
        if value is not None and not measures:
            raise ValueError(
                f"{where}: {name} must be None, because that sensor does not measure then: got {shown(value)}"
            )
    shape = sight.alpha_rad.shape
    return Measurement(
        *(None if value is None else real_array(f"{where}: {name}", value, shape) for name, (value, _) in asked.items())
    )


def need_draws(name: str, draws: Floats) -> None:
    """Refuse errors, in units of their bounds, that are not of shape (B, steps) and within [-1, 1].

    Parameters
    ----------
    name : str
        Of the parameter, for the message.
    draws : ndarray, shape (B, steps)

    Raises
    ------
    TypeError, ValueError
        If they are not.
    """
    if not isinstance(draws, np.ndarray) or draws.ndim != 2:
        raise ValueError(f"{name} must have the shape (B, steps): got {np.shape(draws)}")
    if not (np.abs(real_values(name, draws)) <= 1.0).all():  # refuses NaN as well
        raise ValueError(f"{name} must lie within [-1, 1], in units of the bound")


class MeasurementNoise(Protocol):
    """A rule that chooses the errors within their bounds."""

    def measure(self, sight: LineOfSight, predicted: InformationSetView) -> Measurement:
        """Choose the measurements of a step.

        Parameters
        ----------
        sight : LineOfSight
            The truth.
        predicted : InformationSetView
            The set before the measurement.

        Returns
        -------
        Measurement
            Within the bounds; None for a sensor that does not measure in this step.
        """
