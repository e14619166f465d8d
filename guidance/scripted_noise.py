"""Measurement noise whose errors are given in advance: prescribed, or drawn at random."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from guidance.noise import LineOfSight, need_draws
from infoset import InformationSetView
from infoset.sensors import Measurements

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class ScriptedNoise:
    """Measurements whose errors, in units of their bounds, are given in advance.

    Parameters
    ----------
    errors : mapping of str to ndarray, shape (B, steps)
        Errors by sensor, within [-1, 1]: an angle alpha + u h(d), a range d (1 + u b). A sensor without errors measures
        the true value.

    Raises
    ------
    TypeError, ValueError
        If an error is not within [-1, 1], or the arrays do not have one shape (B, steps).

    References
    ----------
    Kumkov and Patsko (1997), equations (4) and (5).
    """

    errors: Mapping[str, Floats]

    name: ClassVar[str] = "scripted"

    def __post_init__(self) -> None:
        shapes = set()
        for name, errors in self.errors.items():
            need_draws(f"errors[{name!r}]", errors)
            shapes.add(errors.shape)
        if len(shapes) > 1:
            raise ValueError(f"errors must have one shape (B, steps) for all sensors: got {sorted(shapes)}")

    def measure(self, sight: LineOfSight, predicted: InformationSetView) -> Measurements:
        """Return the measurements of a step.

        Raises
        ------
        ValueError
            If errors are missing for this step.
        """
        for name, errors in self.errors.items():
            if sight.step >= errors.shape[1]:
                raise ValueError(
                    f"errors[{name!r}] has {errors.shape[1]} steps, none for step {sight.step}: give one for each step"
                )
        return measure_with_errors(sight, {name: errors[:, sight.step] for name, errors in self.errors.items()})


@dataclass(frozen=True)
class RandomNoise(ScriptedNoise):
    """Measurements with errors drawn in advance, uniform within their bounds.

    Parameters
    ----------
    errors : mapping of str to ndarray, shape (B, steps)
        Draws by sensor, uniform in [-1, 1]; the error is the draw times the bound.

    References
    ----------
    Kumkov and Patsko (1997), section 7.
    """

    name: ClassVar[str] = "random"


def measure_with_errors(sight: LineOfSight, errors: Mapping[str, Floats]) -> dict[str, Floats]:
    """Return the measurements of a step from errors in units of the bounds, shape (B,); a missing error is zero."""
    return {
        name: sensor.measured(sight, errors[name]) if name in errors else sensor.true_value(sight)
        for name, sensor in sight.sensors.items()
    }


def errors_made(sight: LineOfSight, measured: Measurements) -> dict[str, Floats]:
    """Return the errors of measurements in units of the bounds: the inverse of `measure_with_errors`, to rounding."""
    return {name: np.clip(sight.sensors[name].error(sight, values), -1.0, 1.0) for name, values in measured.items()}
