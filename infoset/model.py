"""Assumptions of the set: motion, start, angle sensor, and the uncertainty that a step adds."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property
from typing import Annotated

import numpy as np

from infoset.arrays import Floats
from infoset.limits import (
    NUMBER,
    POSITIVE,
    WRONG,
    Limits,
    NotNegative,
    Part,
    Positive,
    check_fields,
)
from infoset.sensors import BearingSensor, Sensor

Interval = tuple[float, float]

MAX_SECTIONS = 10_000
"""Maximum number of sections: they take 6 MB for each engagement (docs/measured/performance.md)."""
CENTROID_ERRORS_AT_THRESHOLD = 10.0
"""Minimum range threshold in centroid errors of the camera.

At shorter ranges its error bound is greater than 0.1 rad, which is not a small angle.
"""
WHOLE_STEPS_TOLERANCE = 1e-9
"""Relative error of the number of steps between two measurements.

A file may have a period and a step as rounded decimals; a quotient of floats is far more exact.
"""
MIN_RANGE = 1e-9
"""Minimum range as a share of the maximum label; at a range of zero there is no angle.

It is far above the rounding of a range, 1e-16 of the label, and far below a range that matters.
"""
LONGEST_BURN = 1.0 + 1e-9
"""Maximum duration of a burn in units of the time that it has: one, and the rounding of a quotient.
"""

_APPROACH = Limits(below=0.0)
_SECTIONS = Limits(minimum=1, maximum=MAX_SECTIONS, whole=True)
_IMAGE_CLASSES = Limits(minimum=3, maximum=16, whole=True)
"""Number G of classes, at least q + 2, where q is at least 1. The maximum is chosen: with q = 1
there are G sets, and the time of a flight grows with them."""
MAX_SETS = 64
"""Maximum number C(G, q) of sets of an engagement, to limit the time and the memory of a flight.
Chosen: q = 3 with its default of 8 classes gives 56."""


class Model(Enum):
    """Uncertainties that the set allows for.

    PAPER is the published procedure, whose set may lose the true state. GUARANTEED allows for
    errors of the closing speed, gravity, manoeuvres, errors of the engine and rounding, and its set
    contains the true state.
    """

    PAPER = "paper"
    GUARANTEED = "guaranteed"


class InitialSet(Enum):
    """Shape of a section at the start.

    RECTANGLE is a rectangle in (omega, alpha), as in the paper, and belongs to the paper's model;
    BOX is a rectangle in (z, V).
    """

    RECTANGLE = "rectangle"
    BOX = "box"


class Recovery(Enum):
    """Treatment of a set that a measurement leaves empty, because it contradicts the model.

    WIDENED ignores the measurement and enlarges the last consistent set, predicted to the present
    step, by the error bound of an angle. NONE leaves the set empty, as in the published procedure.
    """

    WIDENED = "widened"
    NONE = "none"


@dataclass(frozen=True)
class StateBox:
    """Intervals of relative position and velocity: the paper's B x D.

    Parameters
    ----------
    z_m, x_m : tuple of float
        Minimum and maximum lateral offset and range, m.
    vz_m_s, vx_m_s : tuple of float
        Minimum and maximum relative velocity along z and x, m/s (vx is negative: the object
        approaches).
    y_m, vy_m_s : tuple of float, or None
        Offset, m, and velocity, m/s, along the second lateral axis; both make the box spatial, None
        is a plane.

    Raises
    ------
    TypeError, ValueError
        If an interval is not a pair of numbers within their limits, or is reversed, or only one of
        `y_m` and `vy_m_s` is set.
    """

    z_m: Annotated[Interval, NUMBER]
    x_m: Annotated[Interval, POSITIVE]
    vz_m_s: Annotated[Interval, NUMBER]
    vx_m_s: Annotated[Interval, _APPROACH]
    y_m: Annotated[Interval, NUMBER] | None = None
    vy_m_s: Annotated[Interval, NUMBER] | None = None

    def __post_init__(self) -> None:
        check_fields(self)
        if (self.y_m is None) != (self.vy_m_s is None):
            missing = "y_m" if self.y_m is None else "vy_m_s"
            raise ValueError(
                f"StateBox: y_m and vy_m_s must both be set, or neither: {missing} is missing"
            )

    @property
    def axes(self) -> tuple[str, ...]:
        """Lateral axes: ("z",) in a plane, ("y", "z") in space."""
        return ("z",) if self.y_m is None else ("y", "z")

    def axis(self, name: str) -> StateBox:
        """Return the planar box of x and one lateral axis, "y" or "z", which is z in it."""
        if self.y_m is None or self.vy_m_s is None:
            return self
        if name == "y":
            return StateBox(self.y_m, self.x_m, self.vy_m_s, self.vx_m_s)
        return StateBox(self.z_m, self.x_m, self.vz_m_s, self.vx_m_s)

    @property
    def offset_m(self) -> float:
        """Maximum distance from the x axis, m."""
        return math.hypot(*(max(abs(z) for z in self.axis(name).z_m) for name in self.axes))

    @property
    def lateral_speed_m_s(self) -> float:
        """Maximum velocity across the x axis, m/s."""
        return math.hypot(*(max(abs(v) for v in self.axis(name).vz_m_s) for name in self.axes))

    @property
    def farthest_m(self) -> float:
        """Maximum distance until x = 0, m.

        Without impulses and accelerations the distance is a convex function of time: it is largest
        at the start or at the end.
        """
        # vx is negative: its upper limit is the slowest approach.
        max_range = self.x_m[1]
        max_duration = max_range / -self.vx_m_s[1]
        at_start = math.hypot(max_range, self.offset_m)
        at_end = self.offset_m + self.lateral_speed_m_s * max_duration
        return max(at_start, at_end)


@dataclass(frozen=True, kw_only=True)
class SetSettings:
    """Choices of an information set.

    Parameters
    ----------
    model : Model
        Uncertainties that the set allows for.
    initial_set : InitialSet or None
        Shape of a section at the start; None is RECTANGLE in the paper's model. The guaranteed
        model allows only BOX.
    sections : int
        Number of x-sections at the start, on a uniform grid over the possible ranges, ends
        included. With 101 sections the median misses of asteroid-1997 differ by at most 4 % from
        those with the default (docs/interception.md).
    fewest_sections : int
        If fewer sections are left, replay makes a new grid of 2 fewest_sections + 1: more than half
        of them can become empty before the next grid is needed.
    recovery : Recovery
        Treatment of a set that a measurement leaves empty.
    wrong_images : int
        Maximum number q of images of a flight whose errors may be arbitrary. Only in the guaranteed
        model, and without a sensor of rates.
    image_classes : int or None
        Number G of classes into which the images are dealt if some may be wrong; None is 2q + 2.
        There are C(G, q) sets. More classes make the guaranteed miss smaller.
    range_threshold_m : float
        Hypotheses whose range is about to fall below this value eps leave the set, m.
    disturbance_m_s2 : float
        Bound of the acceleration along z, m/s^2: of the fictitious acceleration, nu, in the paper's
        model, and of the target's manoeuvres in the guaranteed model.
    disturbance_y_m_s2 : float or None
        The same bound along y; None is the value along z. For space only.

    Raises
    ------
    TypeError, ValueError
        If a value is not within its limits, `sections` is less than `fewest_sections`, or a set of
        the guaranteed model starts in the paper's rectangle.
    """

    model: Model = Model.GUARANTEED
    initial_set: InitialSet | None = None
    sections: Annotated[int, _SECTIONS] = 29
    fewest_sections: Annotated[int, _SECTIONS] = 5
    recovery: Recovery = Recovery.WIDENED
    wrong_images: Annotated[int, WRONG] = 0
    image_classes: Annotated[int, _IMAGE_CLASSES] | None = None
    range_threshold_m: NotNegative = 0.0
    disturbance_m_s2: NotNegative = 0.0
    disturbance_y_m_s2: NotNegative | None = None

    def __post_init__(self) -> None:
        check_fields(self)
        if self.sections < self.fewest_sections:
            raise ValueError(
                f"sections must be at least fewest_sections, {self.fewest_sections}: got "
                f"{self.sections}"
            )
        if self.is_guaranteed and self.initial_set is InitialSet.RECTANGLE:
            # The rectangle takes angles for their tangents: x arctan(z/x) is less than z, and a
            # corner of the box of the starts is outside.
            raise ValueError(
                'initial_set = "rectangle" belongs to model = "paper": the rectangle does not '
                'contain all possible starts, as model = "guaranteed" must; leave initial_set out, '
                'or write model = "paper"'
            )

        self._check_wrong_images()

    def _check_wrong_images(self) -> None:
        """Check that wrong images fit the model and the number of classes."""
        if self.wrong_images == 0:
            if self.image_classes is not None:
                raise ValueError(
                    "image_classes belongs to wrong_images, which is 0: leave image_classes out, "
                    "or set wrong_images"
                )
            return
        if not self.is_guaranteed:
            raise ValueError(
                'wrong_images must be 0 in model = "paper", which guarantees nothing: got '
                f"{self.wrong_images}"
            )
        if self.classes < self.wrong_images + 2:
            raise ValueError(
                f"image_classes must be at least {self.wrong_images + 2}, two more than "
                f"wrong_images: got {self.classes}"
            )
        sets = math.comb(self.classes, self.wrong_images)
        if sets > MAX_SETS:
            raise ValueError(
                f"image_classes must give at most {MAX_SETS} sets: {self.classes} classes with "
                f"{self.wrong_images} wrong images give {sets}"
            )

    @property
    def classes(self) -> int:
        """Number G of classes of images."""
        return 2 * self.wrong_images + 2 if self.image_classes is None else self.image_classes

    @property
    def is_guaranteed(self) -> bool:
        """Whether the model is `Model.GUARANTEED`, whose set contains the true state."""
        return self.model is Model.GUARANTEED

    @property
    def starts_as_box(self) -> bool:
        """Whether a section at the start is a rectangle in (z, V), and not in (omega, alpha)."""
        return self.is_guaranteed or self.initial_set is InitialSet.BOX


@dataclass(frozen=True)
class SetModel(SetSettings):
    """Parameters of an information set.

    Parameters
    ----------
    closing_speed_m_s : float
        The nominal closing speed e, m/s.
    step_s : float
        The step Delta of observation and control, s.
    bounds : StateBox
        Possible states at t = 0.
    angle_sensor : BearingSensor
        The line-of-sight sensor.
    gravity_m_s2 : float
        Bound of the difference of gravity along z; used by the guaranteed model only.
    gravity_y_m_s2 : float or None
        The same bound along y; None is the value along z. For space only.
    gravity_speed_change : float
        Bound of the relative change of the closing speed by gravity; used by the guaranteed model
        only.
    execution_error_relative : float
        Bound of |given / commanded - 1| of an impulse; used by the guaranteed model only.
    pointing_error_rad : float
        Bound of the angle between the given and the commanded impulse; used by the guaranteed model
        in space only.
    aim_m : tuple of float, or None
        Point at which guidance aims, relative to the centre that the sensors measure, along the
        lateral axes, m; None is the centre. Misses are those of this point.
    burn_acceleration_m_s2 : float or None
        Acceleration of a burn, which starts at its step: an impulse k lasts |k| over it. None:
        impulses are instantaneous.
    **settings
        Fields of `SetSettings`.

    Raises
    ------
    TypeError, ValueError
        If a value is not within its limits, or two of them contradict each other.

    References
    ----------
    Kumkov and Patsko (1997), equation (9) and section 4.
    """

    closing_speed_m_s: Positive
    step_s: Positive
    bounds: StateBox
    angle_sensor: BearingSensor
    gravity_m_s2: NotNegative = 0.0
    gravity_y_m_s2: NotNegative | None = None
    gravity_speed_change: NotNegative = 0.0
    execution_error_relative: Part = 0.0
    pointing_error_rad: Part = 0.0
    aim_m: Annotated[tuple[float, ...], NUMBER] | None = None
    burn_acceleration_m_s2: Positive | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.axes) == 1:
            self._check_planar()
        if self.aim_m is not None and len(self.aim_m) != len(self.axes):
            raise ValueError(
                f"SetModel: aim_m must have {len(self.axes)} components: got {self.aim_m!r}"
            )
        check_period(self.angle_sensor, self.step_s)
        self.check_start("bounds", self.bounds)
        self._check_threshold()

    def _check_threshold(self) -> None:
        """Refuse a range threshold at which the error of a camera is no small angle."""
        sensor = self.angle_sensor
        nearest_m = CENTROID_ERRORS_AT_THRESHOLD * sensor.farthest_m
        if self.range_threshold_m >= nearest_m:
            return
        length = f"{sensor.table}.centroid_error_m"
        if sensor.farthest_m > sensor.centroid_error_m:
            length += " and the offset of the centre of brightness"
        raise ValueError(
            f"SetModel: range_threshold_m must be at least {CENTROID_ERRORS_AT_THRESHOLD:g} "
            f"times {length}, {nearest_m:g} m: got {self.range_threshold_m!r}"
        )

    def _check_planar(self) -> None:
        """Refuse values for an engagement in space."""
        spatial = {
            self.angle_sensor.table: self.angle_sensor.is_spatial,
            "disturbance_y_m_s2": self.disturbance_y_m_s2 is not None,
            "gravity_y_m_s2": self.gravity_y_m_s2 is not None,
            "pointing_error_rad": self.pointing_error_rad > 0.0,
        }
        for name, is_set in spatial.items():
            if is_set:
                raise ValueError(
                    f"SetModel: {name} holds a value of an engagement in space, and bounds have no "
                    "y_m and vy_m_s: set them, or leave the value out"
                )

    @property
    def axes(self) -> tuple[str, ...]:
        """Lateral axes: ("z",) in a plane, ("y", "z") in space."""
        return self.bounds.axes

    @property
    def lateral_aim_m(self) -> Floats:
        """The aim point along the lateral axes, m, shape (C,)."""
        if self.aim_m is None:
            return np.zeros(len(self.axes))
        return np.array(self.aim_m)

    def axis(self, name: str) -> SetModel:
        """Return the planar model of x and one lateral axis, "y" or "z", which is z in it.

        It has no pointing error, which couples the two axes: `section_laws` adds it.
        """
        return self if len(self.axes) == 1 else self._planar[name]

    @cached_property
    def _planar(self) -> dict[str, SetModel]:
        """The planar models of a model in space."""
        disturbance_y = self.disturbance_y_m_s2
        gravity_y = self.gravity_y_m_s2
        return {
            "y": self._planar_axis(
                "y",
                self.disturbance_m_s2 if disturbance_y is None else disturbance_y,
                self.gravity_m_s2 if gravity_y is None else gravity_y,
            ),
            "z": self._planar_axis("z", self.disturbance_m_s2, self.gravity_m_s2),
        }

    def _planar_axis(self, name: str, disturbance_m_s2: float, gravity_m_s2: float) -> SetModel:
        return replace(
            self,
            bounds=self.bounds.axis(name),
            angle_sensor=self.angle_sensor.axis(name),
            disturbance_m_s2=disturbance_m_s2,
            gravity_m_s2=gravity_m_s2,
            disturbance_y_m_s2=None,
            gravity_y_m_s2=None,
            pointing_error_rad=0.0,
            aim_m=None if self.aim_m is None else (self.aim_m[self.axes.index(name)],),
        )

    def check_start(self, name: str, box: StateBox) -> None:
        """Refuse starts at or below the range threshold, or without a positive error bound.

        The error bound is the bound of the angle at the maximum distance, the smaller one of both
        axes. `name` is the name of the box, for the message.

        Raises
        ------
        ValueError
            If there are such starts.
        """
        if self.range_threshold_m >= box.x_m[0]:
            raise ValueError(
                f"range_threshold_m must be less than the minimum range of {name}, {box.x_m[0]:g} "
                f"m: got {self.range_threshold_m!r}"
            )

        sensors = [self.angle_sensor.axis(axis) for axis in box.axes]
        bound = min(sensor.error_bound(box.farthest_m) for sensor in sensors)
        if not bound > 0.0:
            raise ValueError(
                f"{self.angle_sensor.table}: its error bound must be positive up to the maximum "
                f"distance of {name}, {box.farthest_m:g} m: got {bound:.3g} rad there"
            )

    @property
    def speed_error(self) -> float:
        """Maximum |eta|, where e (1 + eta) is the true closing speed; zero in the paper's model."""
        if not self.is_guaranteed:
            return 0.0
        # vx is minus the closing speed.
        e = self.closing_speed_m_s
        return max(abs(speed + e) for speed in self.bounds.vx_m_s) / e + self.gravity_speed_change

    @property
    def seen_bounds(self) -> StateBox:
        """Possible states at t = 0 in the turned axes of a misaligned camera, of a planar model.

        With the misalignment b of slopes, z + b x and V_z + b V_x have the angles that the camera
        measures. See docs/guarantee-space.md.
        """
        turn = self.angle_sensor.misalignment_rad
        if turn == 0.0:
            return self.bounds
        box = self.bounds
        z_m = turn * box.x_m[1]
        vz_m_s = turn * self.closing_speed_m_s * (1.0 + self.speed_error)
        return replace(
            box,
            z_m=(box.z_m[0] - z_m, box.z_m[1] + z_m),
            vz_m_s=(box.vz_m_s[0] - vz_m_s, box.vz_m_s[1] + vz_m_s),
        )

    @property
    def acceleration_m_s2(self) -> float:
        """Bound nu of the acceleration along z in the set, m/s^2.

        In the guaranteed model, lengths and accelerations are the true values divided by 1 + eta.
        """
        if not self.is_guaranteed:
            return self.disturbance_m_s2
        return (self.disturbance_m_s2 + self.gravity_m_s2) / (1.0 - self.speed_error)

    def steps_in(self, period_s: float) -> int:
        """Return the number of steps between two measurements, at least one."""
        return steps_of_period(period_s, self.step_s)

    @property
    def min_range_m(self) -> float:
        """Minimum range of a hypothesis, m.

        It is the threshold, but at least `MIN_RANGE` of the maximum label.
        """
        return max(self.range_threshold_m, MIN_RANGE * self.label_limits_m[1])

    def burn_s(self, size_m_s: float) -> float:
        """Return the maximum duration of a burn with an impulse of a modulus, s."""
        if self.burn_acceleration_m_s2 is None:
            return 0.0
        return size_m_s * (1.0 + self.execution_error_relative) / self.burn_acceleration_m_s2

    @property
    def label_limits_m(self) -> Interval:
        """Minimum and maximum label of a true state, m: its range at t = 0 divided by 1 + eta.

        Raises
        ------
        ValueError
            If eta may be 1 or more, for which the guaranteed model has no labels.
        """
        minimum, maximum = self.bounds.x_m
        eta = self.speed_error
        if eta >= 1.0:
            raise ValueError(
                "SetModel: the guaranteed model needs a closing speed known to better than 100 %: "
                f"bounds.vx_m_s and gravity_speed_change let it differ by {eta:.3g} of "
                f"closing_speed_m_s, {self.closing_speed_m_s:g} m/s"
            )
        return minimum / (1.0 + eta), maximum / (1.0 - eta)


def steps_of_period(period_s: float, step_s: float) -> int:
    """Return the number of steps between two measurements, at least one."""
    return max(1, round(period_s / step_s))


def check_period(sensor: Sensor, step_s: float) -> None:
    """Refuse a sensor whose period is not a whole number of steps.

    Raises
    ------
    ValueError
        If the period is not a whole number of steps.
    """
    steps = sensor.period_s / step_s
    whole = steps_of_period(sensor.period_s, step_s)
    if abs(steps - whole) > WHOLE_STEPS_TOLERANCE * whole:
        raise ValueError(
            f"{sensor.table}.period_s must be a whole number of steps of {step_s!r} s: got "
            f"{sensor.period_s!r} s"
        )
