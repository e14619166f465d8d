"""Measurement noise whose errors are given in advance: prescribed, or drawn at random."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from infoset.arrays import Floats
from infoset.guidance.noise import LineOfSight, draws_of_step, need_draws
from infoset.information_set import InformationSetView
from infoset.sensors import Camera, Measurements


@dataclass(frozen=True)
class ScriptedNoise:
    """Measurements whose errors, in units of their bounds, are given in advance.

    Parameters
    ----------
    errors : mapping of str to ndarray, shape (C, B, steps), for ranges (B, steps)
        Errors by sensor, within [-1, 1]: an angle alpha + u h(d), a range d (1 + u b). A sensor
        without errors measures the true value.

    Raises
    ------
    TypeError, ValueError
        If an error is not within [-1, 1], or B and steps are not the same for all sensors.

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
            shapes.add(errors.shape[-2:])
        if len(shapes) > 1:
            raise ValueError(
                f"errors must have one shape (B, steps) for all sensors: got {sorted(shapes)}"
            )

    def measure(self, sight: LineOfSight, predicted: InformationSetView) -> Measurements:
        """Return the measurements of a step; `errors_of_step` describes its exceptions."""
        return measure_with_errors(sight, self.errors_of_step(sight))

    def errors_of_step(self, sight: LineOfSight) -> dict[str, Floats]:
        """Return the errors of a step by sensor, in units of their bounds.

        Raises
        ------
        ValueError
            If errors are missing for this step, or have another shape than the measurements.
        """
        return {
            name: draws_of_step(
                f"errors[{name!r}]", self.errors[name], sight.step, sight.shape(sensor)
            )
            for name, sensor in sight.sensors.items()
            if name in self.errors
        }


@dataclass(frozen=True)
class RandomNoise(ScriptedNoise):
    """Measurements with errors drawn in advance, within their bounds.

    Parameters
    ----------
    errors : mapping of str to ndarray, shape (C, B, steps), for ranges (B, steps)
        Draws by sensor in [-1, 1], uniform or of `gaussian_noise`; the error is the draw times the
        bound.
    bias : ndarray, shape (C, B), or None
        Constant errors of the centroid part of a camera's bound, in units of this part; `errors`
        are then errors of the pixel part. None means errors of the whole bound.
    drift : ndarray, shape (C, B, steps), or None
        Errors of the drift of a camera's attitude, in units of this part of the bound; `errors` are
        then errors of the others.

    Raises
    ------
    TypeError, ValueError
        If an error, a bias or a drift is not within [-1, 1].

    References
    ----------
    Kumkov and Patsko (1997), section 7.
    """

    bias: Floats | None = None
    drift: Floats | None = None

    name: ClassVar[str] = "random"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.bias is not None:
            need_draws("bias", self.bias[..., None])
        if self.drift is not None:
            need_draws("drift", self.drift)

    def errors_of_step(self, sight: LineOfSight) -> dict[str, Floats]:
        """Return the errors of a step by sensor, in units of their bounds.

        The draw of a camera is the error of the part of its bound that neither `bias` nor `drift`
        has: the three errors are summed, each times the share of its part.

        Raises
        ------
        ValueError
            If errors are missing for this step, or have another shape than the measurements.
        KeyError
            If there is a bias or a drift, but `errors` has none of the camera.
        """
        errors = super().errors_of_step(sight)
        camera = sight.sensors.get(Camera.name)
        if not isinstance(camera, Camera):
            return errors
        if self.drift is not None:
            # Without a bias the centroid part is in `errors`, too.
            drift = draws_of_step("drift", self.drift, sight.step, sight.shape(camera))
            errors[camera.name] = camera.with_drift(
                sight, errors[camera.name], drift, is_whole=self.bias is None
            )
        if self.bias is not None:
            errors[camera.name] = camera.with_bias(sight, errors[camera.name], self.bias)
        return errors


def measure_with_errors(sight: LineOfSight, errors: Mapping[str, Floats]) -> dict[str, Floats]:
    """Return the measurements of a step from errors in units of the bounds, by default zero."""
    return {
        name: sensor.measured(sight, errors[name]) if name in errors else sensor.true_value(sight)
        for name, sensor in sight.sensors.items()
    }


def errors_made(sight: LineOfSight, measured: Measurements) -> dict[str, Floats]:
    """Return the errors of measurements in units of the bounds.

    It is the inverse of `measure_with_errors`, to rounding; errors beyond a bound become 1 or -1.
    """
    errors = {}
    for name, values in measured.items():
        sensor = sight.sensors[name]
        errors[name] = sensor.limited(sensor.error(sight, values))
    return errors
