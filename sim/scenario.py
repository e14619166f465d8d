"""A scenario: all numbers of an engagement, in SI units."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Annotated

from guidance.noise import NoiseKind, TieRule
from guidance.strategy import Strategy
from guidance.thruster import Thruster
from infoset.limits import ADDED_LATER, Checked, Limits, NotNegative, Positive, check_fields
from infoset.model import SetModel, StateBox
from infoset.sensor import Sensor
from infoset.sensors import RangeSensor, RateSensor

_DIRECTION = Limits(least=-2.0 * math.pi, most=2.0 * math.pi)
_ELEVATION = Limits(least=-0.5 * math.pi, most=0.5 * math.pi)


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
        Angle of that direction out of the plane (x, z), toward y, rad. For space only.

    Raises
    ------
    TypeError, ValueError
        If a value is not a number within its limits.
    """

    gravitational_parameter_m3_s2: Positive
    distance_m: Positive
    direction_rad: Annotated[float, _DIRECTION]
    elevation_rad: Annotated[float, _ELEVATION] = field(default=0.0, metadata=ADDED_LATER)


class Manoeuvre(Enum):
    """How the target accelerates along z, within its bound.

    CONSTANT keeps its sign, BANG_BANG changes it at equal intervals, RANDOM_TELEGRAPH at random times; WORST_CASE has
    the sign of the predicted miss of the true state, and increases it.
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
        Acceleration along y, m/s^2; None is that along z. For space only.
    switching_period_s : float
        Time between changes of sign (bang-bang), or the mean time (random telegraph), s.

    Raises
    ------
    TypeError, ValueError
        If a value is not within its limits.
    """

    manoeuvre: Manoeuvre
    acceleration_m_s2: NotNegative
    switching_period_s: Positive = 10.0
    acceleration_y_m_s2: NotNegative | None = field(default=None, metadata=ADDED_LATER)


@dataclass(frozen=True)
class Body(Checked):
    """The size of the object.

    Parameters
    ----------
    radius_m : float
        Radius of a sphere, m: an engagement hits if its miss is at most this radius.

    Raises
    ------
    TypeError, ValueError
        If the radius is not a positive number.
    """

    radius_m: Positive


@dataclass(frozen=True)
class Scenario:
    """An interception: true motion, sensors, engine, guidance and noise.

    Parameters
    ----------
    sun : Sun or None
        None is free space.
    dispersion : StateBox
        True starts (B0 x D0), uniform, unknown on board. A fixed value has equal ends.
    set_model : SetModel
        Knowledge and assumptions on board, with the closing speed, the step and the angle sensor.
    target : Target or None
        A target that manoeuvres; None does not.
    body : Body or None
        The size of the object; None is a point, and no engagement has a hit or a miss.

    Raises
    ------
    TypeError, ValueError
        If a value is not within its limits, or two of them contradict each other.
    """

    name: str
    description: str
    sun: Sun | None
    nominal_range_m: Positive
    dispersion: StateBox
    set_model: SetModel
    range_sensor: RangeSensor | None
    thruster: Thruster
    strategy: str = "symmetric-miss"
    noise: NoiseKind = NoiseKind.RANDOM
    tie: TieRule = TieRule.UPPER
    rate_sensor: RateSensor | None = None
    target: Target | None = None
    body: Body | None = field(default=None, metadata=ADDED_LATER)

    def __post_init__(self) -> None:
        check_fields(self)
        for name, sensor in self.sensors.items():
            self.set_model.check_period(f"{name}_sensor", sensor)
        self._check_axes()
        _ = self.impulse_steps  # raises ValueError if the thruster can give no impulse
        self.set_model.check_start("dispersion", self.dispersion)
        greatest = max(self.dispersion.x_m[1], self.set_model.bounds.x_m[1])
        if self.sun is not None and self.sun.distance_m <= greatest:
            raise ValueError(
                f"sun.distance_m must be greater than the greatest possible range, {greatest:g} m: "
                f"got {self.sun.distance_m!r}"
            )
        least = min(self.dispersion.x_m[0], self.set_model.bounds.x_m[0])
        if self.body is not None and self.body.radius_m >= least:
            raise ValueError(
                f"body.radius_m must be less than the least possible range, {least:g} m: got {self.body.radius_m!r}"
            )

    def _check_axes(self) -> None:
        """Check that start and set are both in a plane or both in space, and that a plane has no values of space."""
        if self.dispersion.axes != self.set_model.axes:
            raise ValueError(
                "Scenario: dispersion and set_model.bounds must both have y_m and vy_m_s (an engagement in space), or "
                "neither"
            )
        if self.is_spatial:
            return
        for name, is_set in (
            ("sun.elevation_rad", self.sun is not None and self.sun.elevation_rad != 0.0),
            ("target.acceleration_y_m_s2", self.target is not None and self.target.acceleration_y_m_s2 is not None),
            ("thruster.pointing_error_rad", self.thruster.pointing_error_rad > 0.0),
        ):
            if is_set:
                raise ValueError(
                    f"{name} is a value of an engagement in space, and dispersion has no y_m and vy_m_s: set them, or "
                    "leave the value out"
                )

    @property
    def nominal_arrival_s(self) -> float:
        """Time from the start to x = 0 at the nominal range and closing speed, s."""
        return self.nominal_range_m / self.set_model.closing_speed_m_s

    @property
    def impulse_steps(self) -> Sequence[int] | None:
        """Steps in which impulses can be given (`Thruster.impulse_steps`); None is every step from the delay on."""
        return self.thruster.impulse_steps(self.nominal_arrival_s, self.set_model.step_s)

    @property
    def is_spatial(self) -> bool:
        """Whether the engagement is in space, with two lateral axes."""
        return len(self.set_model.axes) > 1

    @property
    def radius_m(self) -> float | None:
        """Radius of the body, m; None if it has no size."""
        return None if self.body is None else self.body.radius_m

    @property
    def sensors(self) -> dict[str, Sensor]:
        """Sensors on board by name, in the order in which a step applies their measurements."""
        fitted = (self.range_sensor, self.set_model.angle_sensor, self.rate_sensor)
        return {sensor.name: sensor for sensor in fitted if sensor is not None}


def strategy_name(scenario: Scenario, own: Strategy | None) -> str:
    """Return the name of a strategy in files: the registered name, or module and class of the user's own."""
    if own is None:
        return scenario.strategy
    return f"{type(own).__module__}.{type(own).__qualname__}"


def with_strategy(scenario: Scenario, strategy: Strategy | str | None) -> tuple[Scenario, Strategy | None]:
    """Return the scenario with a strategy if it is a registered name, and the strategy if it is an object."""
    if isinstance(strategy, str):
        return replace(scenario, strategy=strategy), None
    return scenario, strategy
