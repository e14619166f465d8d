"""The contract of measurement noise, and its kinds."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from infoset import AngleSensor, InformationSetView

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
            Within the bounds.
        """
