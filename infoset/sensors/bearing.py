"""Sensors of the line-of-sight angles with bounded errors.

The error bound of an `AngleSensor` is linear in the range, the bound of a `Camera` falls with it.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import KW_ONLY, dataclass, fields, replace
from enum import Enum
from functools import cached_property
from typing import Annotated, ClassVar, TypeVar

import numpy as np

from infoset.arrays import Flags, Floats
from infoset.clock import steps_between
from infoset.limits import NUMBER, Fraction, Limits, NotNegative, Part, Positive, check_fields
from infoset.sensors.brightness import Brightness
from infoset.sensors.sensor import Apart, Cuttable, Geometry, Measurements, Sensor, along_x_m

RangeOrRanges = TypeVar("RangeOrRanges", float, Floats)

NEGLIGIBLE_ERROR_RAD = 1e-60
"""Replaces an error bound of zero (an axis measured without error) in divisions.

The sensor of one axis (`axis`) has it too, so that errors in units of it exist; it is far below the
rounding of an angle. `error_bound` and `error_bounds` of the whole sensor still return zero.
"""


_PHASE = Limits(minimum=0.0, maximum=math.radians(170.0))
"""Limits of a phase angle; beyond, the lit part, less than 0.8 % of the disc, is too narrow for a
centre of brightness. The maximum is chosen."""
_TURN = Limits(minimum=-2.0 * math.pi, maximum=2.0 * math.pi)
"""Limits of an angle in a plane: any turn, counted from -180 or from 0 degrees."""


class Bias(Enum):
    """Kinds of random errors of a camera.

    RANDOM: a new error within the whole bound for each image. CONSTANT: the centroid part is drawn
    once a run, the pixel part for each image.
    """

    RANDOM = "random"
    CONSTANT = "constant"


@dataclass(frozen=True)
class BearingSensor(Sensor):
    """A sensor of the line-of-sight angles atan2(z, x) and, in space, atan2(y, x).

    Each angle has its own error. The error bound of an angle is a constant, a part that is linear
    in the range, and a part that falls with it; a kind of sensor has one of the latter two.

    Parameters
    ----------
    period_s : float
        Time between measurements, s; the first is at t = 0.
    first_image_s, last_image_s : float
        Times before the nominal arrival, s; the first and the last image are the nearest to them.
        Images begin at the start for None, and continue until the true arrival for 0.
    miss_probability : float
        Probability that an image is lost, in [0, 1).

    Raises
    ------
    TypeError, ValueError
        If a value is not a number within its limits, or two of them contradict each other.
    """

    name: ClassVar[str] = "angle"
    quantity: ClassVar[str] = "angle_rad"
    stream: ClassVar[int] = 1

    period_s: Positive
    _: KW_ONLY
    first_image_s: Positive | None = None
    last_image_s: NotNegative = 0.0
    miss_probability: Part = 0.0

    def __post_init__(self) -> None:
        check_fields(self)
        if self.first_image_s is not None and self.first_image_s < self.last_image_s:
            raise ValueError(
                f"{type(self).__name__}: first_image_s must be at least last_image_s, because both "
                f"are times before the arrival: got {self.first_image_s!r} and "
                f"{self.last_image_s!r}"
            )

    @property
    @abstractmethod
    def constant_error_rad(self) -> float:
        """The part of the error bound that does not depend on the range, rad."""

    @property
    def error_slope_rad_per_m(self) -> float:
        """Change of the error bound with the range, rad/m."""
        return 0.0

    @property
    def centroid_error_m(self) -> float:
        """The part of the error bound that falls with the distance, times the distance, m."""
        return 0.0

    @property
    def centroid_bound_m(self) -> float:
        """The same part of the bound that the set uses, m; in space of the angle of z."""
        return self.centroid_error_m

    @property
    def shift_m(self) -> float:
        """Measured point minus the centre, a length that the set subtracts, m; in space along z."""
        return 0.0

    @property
    def farthest_m(self) -> float:
        """Maximum distance of the measured point from the centre across the line of sight, m."""
        return self.centroid_error_m

    @property
    def misalignment_rad(self) -> float:
        """Bound of a constant that all measured slopes have in addition to their errors."""
        return 0.0

    @property
    def has_constant_bias(self) -> bool:
        """Whether the centroid part of the random errors is constant in a run."""
        return False

    @property
    def is_spatial(self) -> bool:
        """Whether a value is set that only an engagement in space uses."""
        return self != self.axis("z")

    def axis(self, name: str) -> BearingSensor:
        """Return the sensor of one plane angle, "y" or "z".

        An error bound of zero becomes negligible.
        """
        return self

    @abstractmethod
    def error_bound(self, range_m: RangeOrRanges) -> RangeOrRanges:
        """Return the maximum size of the error at a range (m), rad; in space of the angle of z."""

    def error_bounds(self, range_m: Floats) -> Floats:
        """Return the maximum size of the error of each angle, rad, at ranges (m) of shape (..., B).

        Returns
        -------
        ndarray, shape (..., B)
            (2, B) if the two axes differ.
        """
        return self.error_bound(range_m)

    def true_value(self, sight: Geometry) -> Floats:
        """Return the line-of-sight angles, rad."""
        return sight.alpha_rad

    def expected(self, alpha_rad: Floats, range_m: Floats) -> Floats:
        """Return the measured angles, rad, that the set expects of points at line-of-sight angles.

        Both have the shape (C, B).
        """
        return alpha_rad

    def bound(self, sight: Geometry) -> Floats:
        """Return the error bound at the true range, rad."""
        return self.error_bounds(sight.range_m)

    @property
    def has_times(self) -> bool:
        """Whether times before the nominal arrival are given."""
        return self.first_image_s is not None or self.last_image_s > 0.0

    def measures_at(self, before_arrival_s: float) -> bool:
        """Return whether the image at a time before the nominal arrival, s, is taken.

        Images can be taken every `period_s`. The first and the last one are nearest to
        `first_image_s` and `last_image_s` (`infoset.clock.steps_between`).
        """
        if self.first_image_s is not None:
            steps_to_first = steps_between(before_arrival_s, self.first_image_s, self.period_s)
            if steps_to_first > 0:
                return False
        if self.last_image_s == 0.0:
            return True
        return steps_between(before_arrival_s, self.last_image_s, self.period_s) >= 0

    def error(self, sight: Geometry, measured: Floats) -> Floats:
        """Return the error of measured angles in units of the bound."""
        error_rad = measured - self.true_value(sight)
        return error_rad / np.maximum(self.bound(sight), NEGLIGIBLE_ERROR_RAD)

    def cut(self, sets: Cuttable, measured: Measurements, where: Flags) -> None:
        """Cut by the angle."""
        sets.measure_angle(measured[self.name], where)

    def band(
        self, range_m: Floats, closing_speed_m_s: Floats | float, errors: float = 1.0
    ) -> tuple[bool, Floats]:
        """Return a band of z."""
        return False, errors * self.error_bound(range_m) * range_m

    def share(self, apart: Apart) -> Floats:
        """Return half of the maximum difference of the angles, in units of the bound, shape (n,).

        Half, because both motions get the value in the middle. An angle changes by at most as much
        as z/x. Bounds have the shape (n,), or (2, n) if the axes differ, and are smallest at an end
        of [range_m, farthest_m]. An axis measured without error is left out: such an engagement is
        one in a plane (docs/guarantee-bound.md).
        """
        angles = np.abs(apart.offset_m) / apart.range_m
        bounds = np.minimum(self.error_bounds(apart.range_m), self.error_bounds(apart.farthest_m))
        shares = 0.5 * angles / np.maximum(bounds, NEGLIGIBLE_ERROR_RAD)
        return np.asarray(np.where(bounds == 0.0, 0.0, shares).max(axis=0))


@dataclass(frozen=True)
class AngleSensor(BearingSensor):
    """A sensor of the line-of-sight angles with an error bound that is linear in the range.

    Parameters
    ----------
    error_at_nominal_range_rad, error_at_zero_range_rad : float
        Bound a + h(d) at `nominal_range_m` and at zero range, rad, in (0, 1). The same line
        continues beyond.
    nominal_range_m : float
        Range of the first bound, m.
    error_at_nominal_range_y_rad, error_at_zero_range_y_rad : float or None
        The same bounds for the angle of the y axis, rad, in [0, 1); None is the bound of the z
        axis. For space only.
    **others
        Fields of `BearingSensor`.

    References
    ----------
    Kumkov and Patsko (1997), equations (4) and (10).
    """

    table: ClassVar[str] = "angle_sensor"

    error_at_nominal_range_rad: Fraction
    error_at_zero_range_rad: Fraction
    nominal_range_m: Positive
    _: KW_ONLY
    error_at_nominal_range_y_rad: Part | None = None
    error_at_zero_range_y_rad: Part | None = None

    @property
    def constant_error_rad(self) -> float:
        """The error bound at range zero, rad."""
        return self.error_at_zero_range_rad

    @property
    def error_slope_rad_per_m(self) -> float:
        """Change of the error bound with the range, rad/m."""
        change = self.error_at_nominal_range_rad - self.error_at_zero_range_rad
        return change / self.nominal_range_m

    def axis(self, name: str) -> AngleSensor:
        """Return the sensor of one plane angle, "y" or "z".

        An error bound of zero becomes negligible.
        """
        return self._planar[name]

    @cached_property
    def _planar(self) -> dict[str, AngleSensor]:
        """The sensors of both plane angles, which strategies need at every step."""
        plain = replace(self, error_at_nominal_range_y_rad=None, error_at_zero_range_y_rad=None)
        at_nominal, at_zero = (max(bound, NEGLIGIBLE_ERROR_RAD) for bound in self._bounds_of_y)
        return {
            "y": replace(
                plain, error_at_nominal_range_rad=at_nominal, error_at_zero_range_rad=at_zero
            ),
            "z": plain,
        }

    @property
    def _bounds_of_y(self) -> tuple[float, float]:
        """Bounds of the angle of the y axis at the nominal range and at zero, rad.

        They may be zero.
        """
        at_nominal = self.error_at_nominal_range_y_rad
        at_zero = self.error_at_zero_range_y_rad
        return (
            self.error_at_nominal_range_rad if at_nominal is None else at_nominal,
            self.error_at_zero_range_rad if at_zero is None else at_zero,
        )

    def error_bound(self, range_m: RangeOrRanges) -> RangeOrRanges:
        """Return the maximum size of the error at a range (m), rad; in space of the angle of z."""
        return self.error_at_zero_range_rad + self.error_slope_rad_per_m * range_m

    def error_bounds(self, range_m: Floats) -> Floats:
        """Return the maximum size of the error of each angle, rad, at ranges (m) of shape (..., B).

        The result has the shape (2, B) if the two axes differ.
        """
        if self.error_at_nominal_range_y_rad is None and self.error_at_zero_range_y_rad is None:
            return self.error_bound(range_m)
        # Ranges of the shape (B,) are those of both angles, of the shape (2, B) one for each.
        y, z = np.broadcast_to(range_m, (2, range_m.shape[-1]))
        at_nominal, at_zero = self._bounds_of_y
        return np.stack(
            [at_zero + (at_nominal - at_zero) / self.nominal_range_m * y, self.error_bound(z)]
        )


@dataclass(frozen=True)
class Camera(BearingSensor):
    """A sensor of the line-of-sight angles with the bound pixel_error_rad + drift_rad +
    centroid_error_m / d.

    d is the distance. The bound is the same for both axes.

    Parameters
    ----------
    pixel_error_rad : float
        Maximum error of an image, rad, in (0, 1).
    drift_rad : float
        Maximum error of the attitude that changes slowly, rad. Its random errors are correlated in
        time, whatever the noise.
    drift_time_s : float or None
        Time constant of their correlation, s; None is a tenth of the time to the nominal arrival.
    misalignment_rad : float
        Maximum error of the attitude that is constant in a flight: all slopes tan(angle) are
        shifted by it, drawn once a run. The set allows for it by a larger start.
    centroid_error_m : float
        Maximum distance between the point of the body that the camera measures and its centre, m.
        With a phase angle: what remains of it after the offset of the centre of brightness.
    bias : Bias
        Whether the random error of the centroid is constant in a run.
    phase_angle_rad : float or None
        Angle between the directions from the body to the Sun and to the camera, rad, constant in a
        flight. The images then show the centre of brightness of a sphere (`offset_share`). None:
        they show the centre.
    sun_angle_rad : float or None
        Direction of the Sun across the line of approach, from y toward z, rad; in a plane pi/2 or
        -pi/2. With a phase angle only.
    brightness : Brightness
        Law of the brightness.
    phase_correction : bool
        Whether the set on board subtracts the offset. If not, it allows for an error of the
        offset and `centroid_error_m` along each axis.
    **others
        Fields of `BearingSensor`.

    Raises
    ------
    TypeError, ValueError
        If a value is not within its limits, or two of them contradict each other.
    """

    table: ClassVar[str] = "camera"

    pixel_error_rad: Fraction
    centroid_error_m: NotNegative = 0.0
    bias: Bias = Bias.RANDOM
    drift_rad: Part = 0.0
    drift_time_s: Positive | None = None
    misalignment_rad: Part = 0.0
    phase_angle_rad: Annotated[float, _PHASE] | None = None
    sun_angle_rad: Annotated[float, _TURN] | None = None
    brightness: Brightness = Brightness.MEAN
    phase_correction: bool = True

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.phase_angle_rad is None) != (self.sun_angle_rad is None):
            missing = "phase_angle_rad" if self.phase_angle_rad is None else "sun_angle_rad"
            raise ValueError(
                "Camera: phase_angle_rad and sun_angle_rad must both be set, or neither: "
                f"{missing} is missing"
            )
        if self.phase_angle_rad is not None:
            return
        for name, is_set in (
            ("phase_correction", not self.phase_correction),
            ("brightness", self.brightness is not Brightness.MEAN),
        ):
            if is_set:
                raise ValueError(
                    f"Camera: {name} needs phase_angle_rad and sun_angle_rad, from which the "
                    f"offset follows: set them, or leave {name} out"
                )

    @property
    def constant_error_rad(self) -> float:
        """The error bound of an image and of the drift of the attitude, rad."""
        return self.pixel_error_rad + self.drift_rad

    @property
    def has_constant_bias(self) -> bool:
        """Whether the centroid part of the random errors is constant in a run."""
        return self.bias is Bias.CONSTANT

    def error_bound(self, range_m: RangeOrRanges) -> RangeOrRanges:
        """Return the maximum size of the error at a range (m), rad.

        It does not increase at distances d below the centroid error c, where c/d is greater than 1
        rad.
        """
        # Without a centroid error the quotient is 0 at any distance: 1 m only avoids 0 / 0.
        distance: RangeOrRanges = np.maximum(range_m, self.centroid_error_m or 1.0)
        return self.constant_error_rad + self.centroid_error_m / distance

    def with_bias(self, sight: Geometry, error: Floats, bias: Floats) -> Floats:
        """Return the error in units of the bound, from the errors of its two parts.

        Parameters
        ----------
        error, bias : ndarray, shape (..., B)
            Errors of the part without the centroid and of the centroid part, in units of their
            bounds, within [-1, 1].
        """
        share = self.constant_error_rad / self.bound(sight)
        return share * error + (1.0 - share) * bias

    def with_drift(
        self, sight: Geometry, error: Floats, drift: Floats, *, is_whole: bool
    ) -> Floats:
        """Return the error with the drift, in units of its bound.

        Parameters
        ----------
        error, drift : ndarray, shape (..., B)
            Errors of the part without the drift and of the drift, in units of their bounds, within
            [-1, 1].
        is_whole : bool
            Whether `error`, and the result with it, has the centroid part.
        """
        bound = self.bound(sight) if is_whole else self.constant_error_rad
        share = self.drift_rad / bound
        return np.asarray((1.0 - share) * error + share * drift)


@dataclass(frozen=True)
class OffsetCamera(Camera):
    """A camera whose images show a point that is a known distance from the centre of the body.

    The error of an image is about this point. `error_bound` and `error_bounds` are the bounds of
    the set, about the point that it expects: this point with `phase_correction`, the centre
    without.

    Parameters
    ----------
    offset_m : tuple of float
        The point minus the centre along each lateral axis, (y, z) or (z,), m.
    **others
        Fields of `Camera`.
    """

    offset_m: Annotated[tuple[float, ...], NUMBER] = (0.0,)

    @property
    def of_file(self) -> Camera:
        """The camera without its offset, as in a file."""
        return Camera(**{field.name: getattr(self, field.name) for field in fields(Camera)})

    @property
    def centroid_bound_m(self) -> float:
        """The part of the bound that falls with the distance, m; in space of the angle of z."""
        if self.phase_correction:
            return self.centroid_error_m
        return self.centroid_error_m + abs(self.offset_m[-1])

    @property
    def shift_m(self) -> float:
        """Measured point minus the centre, a length that the set subtracts, m; in space along z."""
        return self.offset_m[-1] if self.phase_correction else 0.0

    @property
    def farthest_m(self) -> float:
        """Maximum distance of the measured point from the centre across the line of sight, m."""
        return self.centroid_error_m + math.hypot(*self.offset_m)

    def axis(self, name: str) -> OffsetCamera:
        """Return the sensor of one plane angle, "y" or "z"."""
        return self._planar[name]

    @cached_property
    def _planar(self) -> dict[str, OffsetCamera]:
        """The sensors of both plane angles, which strategies need at every step.

        The last offset is along z; the first one is along y in space, the same in a plane.
        """
        return {
            "y": replace(self, offset_m=self.offset_m[:1]),
            "z": replace(self, offset_m=self.offset_m[-1:]),
        }

    def true_value(self, sight: Geometry) -> Floats:
        """Return the angles of the point that the images show, rad."""
        return self._angle_of_point(sight.alpha_rad, sight.along_x_m)

    def expected(self, alpha_rad: Floats, range_m: Floats) -> Floats:
        """Return the measured angles, rad, that the set expects of points at line-of-sight angles.

        Both have the shape (C, B).
        """
        if not self.phase_correction:
            return alpha_rad
        return self._angle_of_point(alpha_rad, along_x_m(alpha_rad, range_m))

    def _angle_of_point(self, alpha_rad: Floats, x_m: Floats) -> Floats:
        """Return atan((z + o)/x) of each axis, rad, shape (C, B), from the angles and x."""
        offset_m = np.reshape(self.offset_m, (-1, 1))
        return np.asarray(np.arctan2(x_m * np.tan(alpha_rad) + offset_m, x_m))

    def bound(self, sight: Geometry) -> Floats:
        """Return the error bound of images about the point that they show, rad."""
        return super().error_bound(sight.range_m)

    def error_bound(self, range_m: RangeOrRanges) -> RangeOrRanges:
        """Return the error bound of the set at a range (m), rad; in space of the angle of z."""
        centroid_m = self.centroid_bound_m
        # 1 m only avoids 0 / 0, see `Camera.error_bound`.
        distance: RangeOrRanges = np.maximum(range_m, centroid_m or 1.0)
        return self.constant_error_rad + centroid_m / distance

    def error_bounds(self, range_m: Floats) -> Floats:
        """Return the error bounds of the set at ranges (m) of shape (..., B), rad.

        The result has the shape (2, B) in space.
        """
        if len(self.offset_m) == 1:
            return self.error_bound(range_m)
        # Ranges of the shape (B,) are those of both angles, of the shape (2, B) one for each.
        y, z = np.broadcast_to(range_m, (2, range_m.shape[-1]))
        return np.stack([self.axis("y").error_bound(y), self.error_bound(z)])

    def band(
        self, range_m: Floats, closing_speed_m_s: Floats | float, errors: float = 1.0
    ) -> tuple[bool, Floats]:
        """Return a band of z, by the errors of images about the point that they show."""
        return False, errors * super().error_bound(range_m) * range_m

    def share(self, apart: Apart) -> Floats:
        """Return half of the maximum difference of the angles, in units of the bound, shape (n,).

        The slopes (z + o)/x of two motions differ by at most as much as z/x, and by o times the
        difference of 1/x.
        """
        lengths_m = np.reshape(np.abs(self.offset_m), (-1, 1))
        # `range_m` is the smaller of both ranges: a bound of the difference of 1/x.
        inverse = apart.shift_m / apart.range_m**2
        angles = np.abs(apart.offset_m) / apart.range_m + lengths_m * inverse
        bounds = np.minimum(
            super().error_bound(apart.range_m), super().error_bound(apart.farthest_m)
        )
        return np.asarray((0.5 * angles / bounds).max(axis=0))
