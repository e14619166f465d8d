"""A scenario: all numbers of an engagement, in SI units."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from enum import Enum
from functools import cached_property
from typing import Annotated, Any, TypeVar

import numpy as np

from infoset.arrays import Floats
from infoset.clock import fitted_step_s
from infoset.guidance.noise import NoiseSource, TieRule
from infoset.guidance.noise_registry import NoiseKind
from infoset.guidance.strategy import Strategy
from infoset.guidance.thruster import Thruster
from infoset.limits import (
    NUMBER,
    Checked,
    Description,
    Limits,
    Name,
    NotNegative,
    Positive,
    check_fields,
    shown,
)
from infoset.model import SetModel, SetSettings, StateBox, check_period, steps_of_period
from infoset.sensors import (
    AngleSensor,
    BearingSensor,
    Camera,
    OffsetCamera,
    RangeSensor,
    RateSensor,
    Sensor,
)
from infoset.sensors.brightness import offset_share
from infoset.sim.body import Body
from infoset.sim.covariance import Covariance
from infoset.sim.wrong_images import WrongImages, WrongRanges

_OfFile = TypeVar("_OfFile", bound=AngleSensor | Camera | RangeSensor | RateSensor)
"""A sensor of a scenario file."""
LIGHT_M_S = 299_792_458.0
"""Speed of light, m/s: exact, by the definition of the metre."""


@dataclass(frozen=True)
class _Speed(Limits):
    """A positive speed of at most 1 % of the speed of light; higher ones are mistakes of units.

    Relativity changes motions of such speeds by less than 1e-4 of themselves.
    """

    def problem(self, value: object) -> str | None:
        """Return why a speed is not allowed, or None."""
        problem = super().problem(value)
        if problem is not None:
            return problem
        number: Any = value
        if number > 0.01 * LIGHT_M_S:
            return "is more than a hundredth of the speed of light; check its unit"
        return None


_SPEED = _Speed(above=0.0)
"""Limits of a closing speed."""
_DIRECTION = Limits(minimum=-2.0 * math.pi, maximum=2.0 * math.pi)
"""Limits of an angle in a plane: any turn, counted from -180 or from 0 degrees."""
_ELEVATION = Limits(minimum=-0.5 * math.pi, maximum=0.5 * math.pi)
"""Limits of an angle to a plane."""
_SIGMA = Limits(minimum=0.01, maximum=10.0)
"""Limits of a standard deviation in bounds of the error: from almost no errors to almost uniform
ones, whose truncated density differs by 0.5 %.
"""
MAX_STEPS = 100_000
"""Maximum number of steps of a flight. Chosen: all random numbers are drawn before it starts, and a
run with its history then takes 60 MB (`simulate.STEPS_AT_ONCE`)."""
STEPS_ROUNDING = 1e-9
"""Relative rounding error of the number of steps: a flight of exactly `MAX_STEPS` is allowed.

Chosen: far above the rounding of a quotient, and less than one step.
"""
SUN_ROUNDING = 1e-9
"""Component of the direction of the Sun along an axis below which it counts as zero: the cosine of
90 deg is 6e-17 in floats.
"""
MIN_SHARE_WITHIN = 0.01
"""Minimum share of the starts of a covariance within the dispersion; a start is drawn again at most
some 1000 times.
"""


@dataclass(frozen=True)
class Sun(Checked):
    """The attracting body of both spacecraft and object.

    Parameters
    ----------
    gravitational_parameter_m3_s2 : float
        K, m^3/s^2.
    distance_m : float
        Distance from the spacecraft at t = 0, m.
    direction_rad : float
        Direction of the Sun seen from the spacecraft at t = 0, from the x axis toward z, rad.
    elevation_rad : float
        Angle of this direction out of the plane (x, z), toward y, rad. For space only.
    spacecraft_velocity_m_s : tuple of float, or None
        Velocity of the spacecraft from the Sun at t = 0 along y, z and x, in a plane along z and x,
        m/s. None is a circular orbit, in the plane of the Sun and the x axis and toward +x.
    """

    gravitational_parameter_m3_s2: Positive
    distance_m: Positive
    direction_rad: Annotated[float, _DIRECTION]
    elevation_rad: Annotated[float, _ELEVATION] = 0.0
    spacecraft_velocity_m_s: Annotated[tuple[float, ...], NUMBER] | None = None


class Manoeuvre(Enum):
    """How the target accelerates along each lateral axis: by its full acceleration, or not.

    NONE does not accelerate. CONSTANT keeps its sign, BANG_BANG changes it at equal intervals,
    RANDOM_TELEGRAPH at random times; WORST_CASE has the sign of the predicted miss of the true
    state, and increases it. With game noise that shifts the true state, WORST_CASE has the side of
    this shift.
    """

    NONE = "none"
    CONSTANT = "constant"
    BANG_BANG = "bang-bang"
    RANDOM_TELEGRAPH = "random-telegraph"
    WORST_CASE = "worst-case"


@dataclass(frozen=True)
class Target(Checked):
    """A target that manoeuvres.

    Parameters
    ----------
    acceleration_m_s2 : float
        Acceleration along z, m/s^2.
    acceleration_y_m_s2 : float or None
        Acceleration along y, m/s^2; None is the same as along z. For space only.
    switching_period_s : float
        Time between changes of sign (bang-bang), or the mean time (random telegraph), s.
    """

    manoeuvre: Manoeuvre
    acceleration_m_s2: NotNegative
    switching_period_s: Positive = 10.0
    acceleration_y_m_s2: NotNegative | None = None


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """An interception: true motion, sensors, engine, guidance and noise. Its fields are the keys of
    a scenario file.

    Parameters
    ----------
    name, description : str
        Name of the results, and a line about the scenario.
    nominal_range_m, closing_speed_m_s : float
        Range at the start, m, and closing speed e, m/s, of the nominal motion, which the on-board
        model believes in.
    step_s : float
        The step Delta of observation and control, s. With times before the arrival it is the asked
        step, and flights have `fitted_step_s`.
    strategy : str
        Name of the guidance strategy.
    noise, tie : NoiseKind, TieRule
        Choice of the errors of measurements, and choice of game noise between two equally bad
        extremes.
    noise_sigma : float
        Standard deviation of Gaussian and correlated errors as a share of the bound, at which they
        are truncated.
    noise_correlation_s : float or None
        Time constant of correlated errors, s; None is a tenth of the time to the nominal arrival.
    uncertainty : StateBox
        Starts that are possible on board (B x D).
    dispersion : StateBox
        True starts (B0 x D0), uniform, unknown on board. A fixed value has equal ends.
    covariance : Covariance or None
        True starts are normal around the middle of the dispersion, and are drawn again until they
        are within it. The components are along (y, z, x), in a plane along (z, x).
    b_plane_t_rad : float or None
        Direction of the axis T of the B-plane, the line in which it meets the reference plane, from
        y toward z, rad. None: the reference plane is not known. For space only.
    angle_sensor : AngleSensor or None
        The sensor of the line-of-sight angles, if it is not a camera.
    camera : Camera or None
        The camera that measures them. One of the two must be given.
    information_set : SetSettings
        Choices of the information set.
    sun : Sun or None
        None is free space.
    wrong_images : WrongImages or None
        Images with errors beyond their bound in the simulated flights; None has none.
    wrong_ranges : WrongRanges or None
        Measured ranges with errors beyond their bound in the simulated flights; None has none.
    target : Target or None
        A target that manoeuvres; None does not.
    body : Body or None
        The size of the object; None is a point, and no engagement has a hit or a miss.

    Raises
    ------
    TypeError, ValueError
        If a value is not within its limits, or two of them contradict each other.
    """

    name: Name
    description: Description = ""
    nominal_range_m: Positive
    closing_speed_m_s: Annotated[float, _SPEED]
    step_s: Positive
    strategy: str = "symmetric-miss"
    noise: NoiseKind = NoiseKind.RANDOM
    tie: TieRule = TieRule.UPPER
    noise_sigma: Annotated[float, _SIGMA] = 1.0 / 3.0
    noise_correlation_s: Positive | None = None
    b_plane_t_rad: Annotated[float, _DIRECTION] | None = None
    sun: Sun | None = None
    uncertainty: StateBox
    dispersion: StateBox
    covariance: Covariance | None = None
    angle_sensor: AngleSensor | None = None
    camera: Camera | None = None
    range_sensor: RangeSensor | None = None
    rate_sensor: RateSensor | None = None
    wrong_images: WrongImages | None = None
    wrong_ranges: WrongRanges | None = None
    target: Target | None = None
    body: Body | None = None
    thruster: Thruster
    information_set: SetSettings

    def __post_init__(self) -> None:
        check_fields(self)
        self._check_body()
        for sensor in (self._asked_bearing_sensor, self.range_sensor, self.rate_sensor):
            if sensor is not None:
                check_period(sensor, self.step_s)
        self._check_axes()
        self._check_covariance()
        # Properties that raise ValueError: if a burn may be longer than a step, if the thruster can
        # give no impulse, and if the closing speed is too uncertain.
        _ = self.engine
        _ = self.impulse_steps
        self.set_model.check_start("dispersion", self.dispersion)
        if self.information_set.is_guaranteed:
            _ = self.set_model.label_limits_m
        self._check_lengths()
        self.check_last_burn(self.set_model)
        self._check_wrong_ranges()
        if self.information_set.wrong_images and self.rate_sensor is not None:
            raise ValueError(
                "information_set.wrong_images must be 0 with a rate_sensor, for which there is no "
                f"proof: got {self.information_set.wrong_images}"
            )

    def _check_body(self) -> None:
        """Refuse an ellipse and an aim point in a plane."""
        if self.body is None or self.uncertainty.y_m is not None:
            return
        for key in ("semi_axes_m", "aim_m"):
            if getattr(self.body, key) is not None:
                raise ValueError(
                    f"body.{key} is a value of an engagement in space, and uncertainty has no y_m "
                    "and vy_m_s: set them, or leave the value out"
                )

    def check_last_burn(self, model: SetModel) -> None:
        """Check that the last burn ends before the earliest possible arrival in a set model.

        With gravity the arrival may be earlier (`infoset.sim.gravity.on_board_model`).

        Raises
        ------
        ValueError
            If it may end later.
        """
        longest_s = self.engine.longest_burn_s
        if longest_s == 0.0:
            return
        step_s = self.fitted_step_s
        steps = self.impulse_steps
        last_step = self.last_burn_step(model)
        if steps is not None and steps[-1] <= last_step:
            return
        earliest_s = self.nominal_arrival_s - model.label_limits_m[0] / self.closing_speed_m_s
        key = "last_impulse_s"
        asked_s = self.thruster.last_impulse_s
        if asked_s is None and self.thruster.impulses_s:
            key = "impulses_s"
            asked_s = self.thruster.impulses_s[-1]
        got = repr(asked_s)
        if asked_s is not None and steps is not None:
            scheduled_s = self.nominal_arrival_s - steps[-1] * step_s
            # Compared with six digits, with which the message shows the step.
            if f"{scheduled_s:.6g}" != f"{asked_s:.6g}":
                got += f", rounded to the step at {scheduled_s:.6g} s"
        raise ValueError(
            f"thruster.{key}: the last burn must end before the arrival, which may be "
            f"{earliest_s:.4g} s earlier than the nominal one, and may last {longest_s:.4g} s: "
            f"write at least {self.nominal_arrival_s - last_step * step_s:.6g}: got {got}"
        )

    def last_burn_step(self, model: SetModel) -> int:
        """Return the last step in which the longest burn ends before the earliest possible arrival
        in a set model.
        """
        first_arrival_s = model.label_limits_m[0] / self.closing_speed_m_s
        return math.floor((first_arrival_s - self.engine.longest_burn_s) / self.fitted_step_s)

    def _check_wrong_ranges(self) -> None:
        """Check that wrong ranges fit the model and the sensors."""
        range_sensor = self.range_sensor
        if self.wrong_ranges is not None and range_sensor is None:
            raise ValueError(
                "wrong_ranges needs a range_sensor: add the table, or leave wrong_ranges out"
            )
        if range_sensor is None or range_sensor.wrong_measurements == 0:
            return
        if not self.information_set.is_guaranteed:
            raise ValueError(
                'range_sensor.wrong_measurements must be 0 in model = "paper", which guarantees '
                f"nothing: got {range_sensor.wrong_measurements}"
            )

    def _check_lengths(self) -> None:
        """Check the number of steps, the distance of the Sun and the radius of the body."""
        farthest_m = self.dispersion.x_m[1]
        slowest_m_s = -self.dispersion.vx_m_s[1]
        if farthest_m > MAX_STEPS * (1.0 + STEPS_ROUNDING) * slowest_m_s * self.fitted_step_s:
            raise ValueError(
                f"step_s must be long enough for at most {MAX_STEPS} steps from {farthest_m:g} m "
                f"at {slowest_m_s:g} m/s: got {self.step_s!r}"
            )
        maximum = max(self.dispersion.x_m[1], self.uncertainty.x_m[1])
        if self.sun is not None and self.sun.distance_m <= maximum:
            raise ValueError(
                f"sun.distance_m must be greater than the maximum possible range, {maximum:g} m: "
                f"got {self.sun.distance_m!r}"
            )
        minimum = min(self.dispersion.x_m[0], self.uncertainty.x_m[0])
        if self.body is not None and self.body.longest_m >= minimum:
            raise ValueError(
                f"body.{self.body.size_key} must be less than the minimum possible range, "
                f"{minimum:g} m: got {self.body.longest_m!r}"
            )

    @cached_property
    def set_model(self) -> SetModel:
        """Knowledge and assumptions on board, without gravity and the errors of the engine
        (`infoset.sim.gravity`).
        """
        return SetModel(
            closing_speed_m_s=self.closing_speed_m_s,
            step_s=self.fitted_step_s,
            bounds=self.uncertainty,
            angle_sensor=self.bearing_sensor,
            aim_m=None if self.body is None else self.body.aim_m,
            **vars(self.information_set),
        )

    def _check_axes(self) -> None:
        """Check that all values are in a plane, or all in space."""
        if self.dispersion.axes != self.set_model.axes:
            raise ValueError(
                "Scenario: uncertainty and dispersion must both have y_m and vy_m_s (an "
                "engagement in space), or neither"
            )
        components = len(self.set_model.axes) + 1
        velocity = None if self.sun is None else self.sun.spacecraft_velocity_m_s
        if velocity is not None and len(velocity) != components:
            raise ValueError(
                f"sun.spacecraft_velocity_m_s must have {components} components: got "
                f"{len(velocity)}"
            )
        if self.covariance is not None and self.covariance.size != 2 * components:
            raise ValueError(
                f"covariance must have {2 * components} components: got {self.covariance.size}"
            )
        if self.is_spatial:
            return

        sun = self.sun
        target = self.target
        values_in_space = {
            "sun.elevation_rad": sun is not None and sun.elevation_rad != 0.0,
            "target.acceleration_y_m_s2": (
                target is not None and target.acceleration_y_m_s2 is not None
            ),
            "thruster.pointing_error_rad": self.thruster.pointing_error_rad > 0.0,
            "b_plane_t_rad": self.b_plane_t_rad is not None,
        }
        for name, is_set in values_in_space.items():
            if is_set:
                raise ValueError(
                    f"{name} is a value of an engagement in space, and dispersion has no y_m and "
                    "vy_m_s: set them, or leave the value out"
                )

    def _check_covariance(self) -> None:
        """Check that enough normal starts are within the dispersion."""
        if self.covariance is None:
            return
        half_widths = 0.5 * np.ptp(corners(self.dispersion), axis=0)
        share = self.covariance.share_within(half_widths)
        if share < MIN_SHARE_WITHIN:
            raise ValueError(
                f"covariance: {100.0 * share:.2g} % of its starts are within dispersion, at "
                f"least {100.0 * MIN_SHARE_WITHIN:g} % must be: widen dispersion, or reduce "
                "the deviations"
            )

    @property
    def _asked_bearing_sensor(self) -> AngleSensor | Camera:
        """The sensor of the line-of-sight angles as in the file."""
        given = [sensor for sensor in (self.angle_sensor, self.camera) if sensor is not None]
        if len(given) != 1:
            raise ValueError(
                "Scenario: must have one sensor of angles, the table angle_sensor, whose error "
                "bound is linear in the range, or the table camera: got "
                f"{'both' if given else 'neither'}"
            )
        return given[0]

    @cached_property
    def bearing_sensor(self) -> BearingSensor:
        """The sensor of the line-of-sight angles of flights, with `fitted_step_s`; with a phase
        angle it has the offset of the images.

        Raises
        ------
        ValueError
            If the scenario has none, or two, or if a phase angle does not fit the scenario.
        """
        sensor = self._fitted(self._asked_bearing_sensor)
        if not isinstance(sensor, Camera) or sensor.phase_angle_rad is None:
            return sensor
        values = {field.name: getattr(sensor, field.name) for field in fields(Camera)}
        return OffsetCamera(**values, offset_m=self._offset_m(sensor))

    def _offset_m(self, camera: Camera) -> tuple[float, ...]:
        """Return the offset of the centre of brightness along each lateral axis, m."""
        phase_rad = camera.phase_angle_rad
        sun_rad = camera.sun_angle_rad
        if phase_rad is None or sun_rad is None:
            return (0.0,) * len(self.uncertainty.axes)
        if self.body is None:
            raise ValueError(
                "camera.phase_angle_rad needs the radius of the body, of which the offset is a "
                "share: add the table body with radius_m or semi_axes_m"
            )

        length_m = offset_share(phase_rad, camera.brightness) * self.body.mean_radius_m
        along_y, along_z = (
            0.0 if abs(share) < SUN_ROUNDING else share
            for share in (math.cos(sun_rad), math.sin(sun_rad))
        )
        if len(self.uncertainty.axes) > 1:
            return length_m * along_y, length_m * along_z
        if along_y != 0.0:
            raise ValueError(
                "camera.sun_angle_rad must be along the lateral axis of a plane, 90 or -90 deg: "
                f"got {math.degrees(sun_rad):g} deg"
            )
        return (math.copysign(length_m, along_z),)

    @property
    def nominal_arrival_s(self) -> float:
        """Time from the start to x = 0 at the nominal range and closing speed, s."""
        return self.nominal_range_m / self.closing_speed_m_s

    @cached_property
    def fitted_step_s(self) -> float:
        """The step of flights, s.

        If the scenario has times before the nominal arrival, the arrival is a whole number of these
        steps after the start, so that the times are exact; otherwise it is `step_s`.
        """
        has_times = self.thruster.has_times or self._asked_bearing_sensor.has_times
        if not has_times:
            return self.step_s
        return fitted_step_s(self.nominal_arrival_s, self.step_s)

    @property
    def correlation_time_s(self) -> float:
        """Time constant of correlated errors, s."""
        if self.noise_correlation_s is None:
            return 0.1 * self.nominal_arrival_s
        return self.noise_correlation_s

    @property
    def drift_time_s(self) -> float:
        """Time constant of the drift of a camera's attitude, s."""
        if self.camera is None or self.camera.drift_time_s is None:
            return 0.1 * self.nominal_arrival_s
        return self.camera.drift_time_s

    @cached_property
    def engine(self) -> Thruster:
        """The thruster with its maximum impulse: without a value, that of a burn of one step.

        Raises
        ------
        ValueError
            If the maximum impulse is given, and its burn may be longer than a step; or if it is not
            given, and the minimum impulse exceeds the impulse of a burn of one step.
        """
        return self.thruster.limited_to(self.fitted_step_s)

    @property
    def impulse_steps(self) -> Sequence[int] | None:
        """Steps in which impulses can be given; None is every step from the delay on."""
        return self.thruster.impulse_steps(self.nominal_arrival_s, self.fitted_step_s)

    @property
    def is_spatial(self) -> bool:
        """Whether the engagement is in space, with two lateral axes."""
        return len(self.set_model.axes) > 1

    @property
    def certain_radius_m(self) -> float | None:
        """Radius around the aim point that is certainly inside the body, m; None without a size.

        It is the radius of a sphere with the aim point in its centre.
        """
        return None if self.body is None else self.body.inscribed_m

    @property
    def outer_radius_m(self) -> float | None:
        """Radius around the aim point that contains the body, m; None without a size."""
        return None if self.body is None else self.body.outer_m

    @property
    def sensors(self) -> dict[str, Sensor]:
        """Sensors of flights by name, in the order in which a step applies their measurements.

        Their periods are whole numbers of `fitted_step_s`.
        """
        sensors: dict[str, Sensor] = {}
        if self.range_sensor is not None:
            sensors[RangeSensor.name] = self._fitted(self.range_sensor)
        sensors[BearingSensor.name] = self.bearing_sensor
        if self.rate_sensor is not None:
            sensors[RateSensor.name] = self._fitted(self.rate_sensor)
        return sensors

    def _fitted(self, sensor: _OfFile) -> _OfFile:
        """Return a sensor of the file whose period has as many steps of flights as asked steps."""
        if self.fitted_step_s == self.step_s:
            return sensor
        steps = steps_of_period(sensor.period_s, self.step_s)
        return replace(sensor, period_s=steps * self.fitted_step_s)


def corners(box: StateBox) -> tuple[Floats, Floats]:
    """Return minimum and maximum (z, x, V_z, V_x) of a box; (y, z, x, V_y, V_z, V_x) in space."""
    lateral = [box.axis(name) for name in box.axes]
    intervals = np.array(
        [*(axis.z_m for axis in lateral), box.x_m, *(axis.vz_m_s for axis in lateral), box.vx_m_s],
        dtype=np.float64,
    )
    return intervals[:, 0], intervals[:, 1]


def of_model(model: SetModel, asked: Scenario | None = None) -> dict[str, Any]:
    """Return the fields of a scenario with a set model: ``replace(scenario, **of_model(model))``.

    They do not contain the bounds of gravity and of the engine's errors, which follow from the
    scenario.

    Parameters
    ----------
    model : SetModel
        The set model.
    asked : Scenario or None
        Scenario whose asked step the fields keep if the model has its `fitted_step_s`, so that its
        other sensors fit them. None: the step is that of the model.
    """
    step_s = model.step_s
    sensor = model.angle_sensor
    if asked is not None and asked.fitted_step_s == step_s != asked.step_s:
        step_s = asked.step_s
        sensor = replace(sensor, period_s=model.steps_in(sensor.period_s) * step_s)
    if isinstance(sensor, OffsetCamera):
        sensor = sensor.of_file
    return {
        "closing_speed_m_s": model.closing_speed_m_s,
        "step_s": step_s,
        "uncertainty": model.bounds,
        "angle_sensor": sensor if isinstance(sensor, AngleSensor) else None,
        "camera": sensor if isinstance(sensor, Camera) else None,
        "information_set": SetSettings(
            **{field.name: getattr(model, field.name) for field in fields(SetSettings)}
        ),
    }


def strategy_name(scenario: Scenario, own: Strategy | None) -> str:
    """Return the name of a strategy in files: registered, or module and class of the user's."""
    if own is None:
        return scenario.strategy
    return f"{type(own).__module__}.{type(own).__qualname__}"


def need_scenario(scenario: object) -> None:
    """Raise TypeError if an argument is not a `Scenario`; the message says how to read one."""
    if not isinstance(scenario, Scenario):
        raise TypeError(
            f"scenario must be a Scenario: got {shown(scenario)}; infoset.load_scenario returns it "
            "for a name or a file"
        )


def with_strategy(
    scenario: Scenario, strategy: Strategy | str | None
) -> tuple[Scenario, Strategy | None]:
    """Return the scenario with a registered strategy, or the scenario and a strategy object.

    A TypeError is raised if the scenario is not a `Scenario`.
    """
    need_scenario(scenario)
    if isinstance(strategy, str):
        return replace(scenario, strategy=strategy), None
    return scenario, strategy


def noise_name(own: NoiseSource) -> str:
    """Return the name of a user's noise in records: its attribute `name`, or its class."""
    kind = own if isinstance(own, type) else type(own)
    return str(getattr(own, "name", kind.__name__))


def with_noise(
    scenario: Scenario, noise: NoiseSource | str | None
) -> tuple[Scenario, NoiseSource | None]:
    """Return the scenario with the named kind of noise, or the scenario and a noise object.

    A ValueError is raised if no kind has this name.
    """
    if not isinstance(noise, str):
        return scenario, noise
    names = [kind.value for kind in NoiseKind]
    if noise not in names:
        raise ValueError(f"no noise is called '{noise}'; there are: {', '.join(names)}")
    return replace(scenario, noise=NoiseKind(noise)), None
