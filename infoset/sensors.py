"""Sensors with bounded errors, of unknown distribution: one class for each kind."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property
from typing import Any, ClassVar, TypeVar

import numpy as np

from infoset.arrays import Flags, Floats
from infoset.limits import Checked, Fraction, NotNegative, Part, Positive, check_fields
from infoset.sensor import Apart, Cuttable, Geometry, Measurements, Sensor

RangeOrRanges = TypeVar("RangeOrRanges", float, Floats)


class Bias(Enum):
    """How the random error of a camera is drawn.

    RANDOM: a new error within the whole bound for each image. CONSTANT: the centroid part is drawn once a run, the
    pixel part for each image.
    """

    RANDOM = "random"
    CONSTANT = "constant"


TIME_TOLERANCE = 1e-6
"""Rounding of the first and the last image, as a share of the time between two images."""
NEGLIGIBLE_ERROR_RAD = 1e-60
"""Error bound of an axis that is measured without error."""


@dataclass(frozen=True)
class AngleSensor(Sensor):
    """A sensor of the line-of-sight angles atan2(z, x) and, in space, atan2(y, x), each with its own error.

    The error bound is linear in the range, or that of a camera.

    Parameters
    ----------
    period_s : float
        Time between measurements, s; the first is at t = 0.
    error_at_nominal_range_rad, error_at_zero_range_rad : float or None
        Bound a + h(d) at `nominal_range_m` and at zero range, rad, in (0, 1). The same line continues beyond.
    nominal_range_m : float or None
        Range at which the first of the two holds, m.
    pixel_error_rad : float or None
        A number makes the sensor a camera, in place of the three values above. Its bound at the distance d is
        pixel_error_rad + centroid_error_m / d, the same for both axes.
    centroid_error_m : float
        Maximum distance between the point of the body that a camera measures and its centre, m.
    error_at_nominal_range_y_rad, error_at_zero_range_y_rad : float or None
        The same bounds for the angle of the y axis, rad, in [0, 1); None is that of the z axis. For space only.
    first_image_s, last_image_s : float
        Times before the nominal arrival of the first and the last image, s. Images begin at the start for None, and
        continue until the true arrival for 0.
    miss_probability : float
        Probability that an image is lost, in [0, 1).

    Raises
    ------
    TypeError, ValueError
        If a value is not a number within its limits, or two of them contradict each other.

    References
    ----------
    Kumkov and Patsko (1997), equations (4) and (10), for the linear bound.
    """

    name: ClassVar[str] = "angle"
    quantity: ClassVar[str] = "angle_rad"
    stream: ClassVar[int] = 1

    period_s: Positive
    error_at_nominal_range_rad: Fraction | None = None
    error_at_zero_range_rad: Fraction | None = None
    nominal_range_m: Positive | None = None
    pixel_error_rad: Fraction | None = None
    centroid_error_m: NotNegative = 0.0
    error_at_nominal_range_y_rad: Part | None = None
    error_at_zero_range_y_rad: Part | None = None
    bias: Bias = Bias.RANDOM
    first_image_s: Positive | None = None
    last_image_s: NotNegative = 0.0
    miss_probability: Part = 0.0

    def __post_init__(self) -> None:
        check_fields(self)
        line = (self.error_at_nominal_range_rad, self.error_at_zero_range_rad, self.nominal_range_m)
        of_y = (self.error_at_nominal_range_y_rad, self.error_at_zero_range_y_rad)
        if self.is_camera and not set(line + of_y) == {None}:
            raise ValueError(
                "AngleSensor: with pixel_error_rad, a camera, leave out error_at_nominal_range_rad, "
                "error_at_zero_range_rad and nominal_range_m, and those of y"
            )
        if not self.is_camera and (None in line or self.centroid_error_m > 0.0):
            raise ValueError(
                "AngleSensor: must have error_at_nominal_range_rad, error_at_zero_range_rad and nominal_range_m of the "
                "linear bound, or pixel_error_rad and centroid_error_m of a camera"
            )
        if self.bias is Bias.CONSTANT and not self.is_camera:
            raise ValueError("AngleSensor: bias can be constant only for a camera, whose centroid part is constant")
        if self.first_image_s is not None and self.first_image_s < self.last_image_s:
            raise ValueError(
                "AngleSensor: first_image_s must be at least last_image_s, because both are times before the arrival: "
                f"got {self.first_image_s!r} and {self.last_image_s!r}"
            )

    @classmethod
    def camera(
        cls, period_s: float, pixel_error_rad: float, centroid_error_m: float = 0.0, **others: Any
    ) -> AngleSensor:
        """Return a camera, with the error bound pixel + centroid_error_m / d at the distance d; `others` are fields."""
        return cls(period_s, pixel_error_rad=pixel_error_rad, centroid_error_m=centroid_error_m, **others)

    @property
    def is_camera(self) -> bool:
        """Whether the error bound is that of a camera."""
        return self.pixel_error_rad is not None

    @property
    def constant_error_rad(self) -> float:
        """The part of the error bound that does not depend on the range, rad: that at range zero, or of the pixel."""
        return (self.pixel_error_rad if self.is_camera else self.error_at_zero_range_rad) or 0.0

    @property
    def is_spatial(self) -> bool:
        """Whether a value is set that only an engagement in space uses."""
        return self != self.axis("z")

    def axis(self, name: str) -> AngleSensor:
        """Return the sensor of one plane angle, "y" or "z"; an error bound of zero becomes negligible."""
        return self._planar[name]

    @cached_property
    def _planar(self) -> dict[str, AngleSensor]:
        """The sensors of both plane angles, which strategies need at every step."""
        plain = replace(self, error_at_nominal_range_y_rad=None, error_at_zero_range_y_rad=None)
        if self.is_camera:
            return {"y": plain, "z": plain}
        at_nominal, at_zero = (max(bound, NEGLIGIBLE_ERROR_RAD) for bound in self._bounds_of_y)
        along_y = replace(plain, error_at_nominal_range_rad=at_nominal, error_at_zero_range_rad=at_zero)
        return {"y": along_y, "z": plain}

    @property
    def _bounds_of_y(self) -> tuple[float, float]:
        """The bounds of the angle of the y axis at the nominal range and at range zero, rad; they may be zero."""
        own = (self.error_at_nominal_range_y_rad, self.error_at_zero_range_y_rad)
        common = (self.error_at_nominal_range_rad, self.error_at_zero_range_rad)
        at_nominal, at_zero = ((of_z if of_y is None else of_y) or 0.0 for of_y, of_z in zip(own, common, strict=True))
        return at_nominal, at_zero

    @property
    def error_slope_rad_per_m(self) -> float:
        """Change of the bound with range, rad/m."""
        if self.error_at_nominal_range_rad is None or self.nominal_range_m is None:
            return 0.0
        return (self.error_at_nominal_range_rad - self.constant_error_rad) / self.nominal_range_m

    def error_bound(self, range_m: RangeOrRanges) -> RangeOrRanges:
        """Return the maximum size of the error at a range (m), rad.

        The bound of a camera does not increase at distances below its centroid error, where c/d is greater than 1 rad.
        """
        bound = self.constant_error_rad + self.error_slope_rad_per_m * range_m
        if self.centroid_error_m:
            distance: RangeOrRanges = np.maximum(range_m, self.centroid_error_m)
            bound = bound + self.centroid_error_m / distance
        return bound

    def error_bounds(self, range_m: Floats) -> Floats:
        """Return the maximum size of the error of each angle, rad, at ranges (m) of shape (..., B).

        Returns
        -------
        ndarray, shape (..., B)
            (2, B) if the two axes differ.
        """
        if self.error_at_nominal_range_y_rad is None and self.error_at_zero_range_y_rad is None:
            return self.error_bound(range_m)
        y, z = np.broadcast_to(range_m, (2, range_m.shape[-1]))
        at_nominal, at_zero = self._bounds_of_y
        return np.stack([at_zero + (at_nominal - at_zero) / (self.nominal_range_m or 1.0) * y, self.error_bound(z)])

    def true_value(self, sight: Geometry) -> Floats:
        """Return the line-of-sight angles, rad."""
        return sight.alpha_rad

    def bound(self, sight: Geometry) -> Floats:
        """Return the error bound at the true range, rad."""
        return self.error_bounds(sight.range_m)

    def measures_at(self, before_arrival_s: float) -> bool:
        """Return whether there are images at a time before the nominal arrival, s."""
        room_s = TIME_TOLERANCE * self.period_s
        too_early = self.first_image_s is not None and before_arrival_s > self.first_image_s + room_s
        too_late = self.last_image_s > 0.0 and before_arrival_s < self.last_image_s - room_s
        return not (too_early or too_late)

    def with_bias(self, sight: Geometry, error: Floats, bias: Floats) -> Floats:
        """Return the error of a camera in units of its bound, from those of the pixel and of the centroid part.

        Parameters
        ----------
        error, bias : ndarray, shape (..., B)
            Errors in units of the bounds of the two parts, within [-1, 1].
        """
        share = self.constant_error_rad / self.error_bound(sight.range_m)
        return share * error + (1.0 - share) * bias

    def error(self, sight: Geometry, measured: Floats) -> Floats:
        """Return the error of measured angles in units of the bound."""
        return (measured - sight.alpha_rad) / np.maximum(self.bound(sight), NEGLIGIBLE_ERROR_RAD)

    def cut(self, sets: Cuttable, measured: Measurements, where: Flags) -> None:
        """Cut by the angle."""
        sets.measure_angle(measured[self.name], where)

    def band(self, range_m: Floats, closing_speed_m_s: Floats | float, errors: float = 1.0) -> tuple[bool, Floats]:
        """Return a band of z."""
        return False, errors * self.error_bound(range_m) * range_m

    def share(self, apart: Apart) -> Floats:
        """Return half of the maximum difference of the angles, in units of the bound, shape (n,).

        An angle changes by at most as much as z/x. The bound may fall with the distance, which is greater than the
        range. An axis that is measured without error is left out.
        """
        angles = np.abs(apart.offset_m) / apart.range_m
        bounds = np.minimum(self.error_bounds(apart.range_m), self.error_bounds(apart.farthest_m))
        shares = np.where(bounds == 0.0, 0.0, 0.5 * angles / np.maximum(bounds, NEGLIGIBLE_ERROR_RAD))
        return np.asarray(shares.max(axis=0))


@dataclass(frozen=True)
class RangeSensor(Checked, Sensor):
    """A range sensor with a bounded relative error.

    Parameters
    ----------
    period_s : float
        Time between measurements, s; the first is at t = 0.
    relative_error : float
        Maximum |d_m - d| / d, in (0, 1).

    References
    ----------
    Kumkov and Patsko (1997), equations (5) and (11).
    """

    name: ClassVar[str] = "range"
    quantity: ClassVar[str] = "range_m"
    stream: ClassVar[int] = 2
    is_lateral: ClassVar[bool] = False

    period_s: Positive
    relative_error: Fraction

    def true_value(self, sight: Geometry) -> Floats:
        """Return the range, m."""
        return sight.range_m

    def bound(self, sight: Geometry) -> Floats:
        """Return the error bound, m."""
        return self.relative_error * sight.range_m

    def cut(self, sets: Cuttable, measured: Measurements, where: Flags) -> None:
        """Cut by the range; an angle measured in the same step sharpens the cut."""
        sets.measure_range(measured[self.name], self.relative_error, where, alpha_rad=measured.get(AngleSensor.name))

    def share(self, apart: Apart) -> Floats:
        """Return half of the maximum difference of the distances, in units of the bound, shape (n,)."""
        difference_m = apart.slope * np.hypot.reduce(apart.offset_m) + apart.shift_m
        return np.asarray(difference_m / (2.0 * self.relative_error * apart.range_m))

    def measured(self, sight: Geometry, error: Floats | float) -> Floats:
        """Return d (1 + error b), m."""
        return sight.range_m * (1.0 + self.relative_error * error)

    def error(self, sight: Geometry, measured: Floats) -> Floats:
        """Return (d_m / d - 1) / b of measured ranges d_m, m."""
        return (measured / sight.range_m - 1.0) / self.relative_error


@dataclass(frozen=True)
class RateSensor(Checked, Sensor):
    """A sensor of the line of sight's angular rate with a bounded error.

    Parameters
    ----------
    period_s : float
        Time between measurements, s; the first is at t = 0.
    error_rad_s : float
        Maximum |omega_m - omega|, rad/s.

    References
    ----------
    Kumkov and Patsko (2001).
    """

    name: ClassVar[str] = "rate"
    quantity: ClassVar[str] = "rate_rad_s"
    stream: ClassVar[int] = 4

    period_s: Positive
    error_rad_s: Positive

    def true_value(self, sight: Geometry) -> Floats:
        """Return the rate of the line of sight, rad/s."""
        return sight.omega_rad_s

    def bound(self, sight: Geometry) -> float:
        """Return the error bound, rad/s."""
        return self.error_rad_s

    def cut(self, sets: Cuttable, measured: Measurements, where: Flags) -> None:
        """Cut by the rate."""
        sets.measure_rate(measured[self.name], self.error_rad_s, where)

    def band(self, range_m: Floats, closing_speed_m_s: Floats | float, errors: float = 1.0) -> tuple[bool, Floats]:
        """Return a band of the predicted miss, omega x^2/e."""
        return True, errors * self.error_rad_s * range_m * range_m / closing_speed_m_s

    def share(self, apart: Apart) -> Floats:
        """Return half of the maximum difference of the rates, in units of the bound, shape (n,).

        The rate is the derivative of z/x times cos^2(alpha), which depends on z.
        """
        change_m = np.abs(apart.predicted_miss_m) + 4.0 * apart.slope**2 * np.abs(apart.offset_m)
        return np.asarray(change_m.max(axis=0) / self.band(apart.range_m, apart.closing_speed_m_s, 2.0)[1])


SENSORS: tuple[type[Sensor], ...] = (AngleSensor, RangeSensor, RateSensor)
"""All kinds, in the order of their columns in files."""
