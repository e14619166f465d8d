"""Problem files of kind `reachable-rendezvous`; their keys are the fields of `Rendezvous`."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from infoset.arrays import Floats
from infoset.experiments.common.orbit_checks import check_angle, check_orbit
from infoset.experiments.reachability.error_tables import (
    MAX_GUARANTEED_PERIODS,
    NO_ERROR,
    ExecutionError,
    Goal,
    InitialError,
    PassiveSafetyTable,
    Sensor,
    check_starts,
)
from infoset.experiments.reachability.vectors import Bound, Vector
from infoset.limits import Description, Limits, Name, Part, Positive
from infoset.rendezvous.reachability import (
    IMPULSE,
    MAX_PERIODS,
    Coasting,
    ErrorBounds,
    MotionModel,
    NonlinearMotion,
    OutputProblem,
    PathLimits,
    ReachabilityProblem,
    SightSensor,
    ThrustShape,
    between_impulses,
    between_periods,
    discretised,
    impulsive,
    motion_of,
    with_errors,
)
from infoset.rendezvous.relative_motion import EllipticOrbit, HeldMotion
from infoset.rendezvous.two_body import OrbitalElements

STATE_NAMES = ("x", "y", "z", "vx", "vy", "vz")
_MAX_REACH = 1e4
"""Largest change of a state by full control over a period, as a multiple of its bound; beyond it
rounding decides the result. Chosen."""
_INSTANTS = 12
"""Instants within a period at which selected controls are checked; chosen."""


class Engine(Enum):
    """Shape of the control: thrust held over each period, or an impulse at its start."""

    HELD = "held"
    IMPULSES = "impulses"


_MAX_ANGLE_RAD = 0.25
"""Maximum angle of the orbit at the perigee in an interval of a drift: bound (7) of
docs/guaranteed-rendezvous.md exists up to 0.8, and is 1.4 times as large as needed at 0.25."""
_MIN_INSTANTS = 4
"""Minimum number of intervals of a period of a drift; the default of `Coasting`."""
_FLIGHT_INSTANTS = 16
"""Minimum number of intervals of a period in which constraints are kept: their shift is then below
the printed digits of a position near the goal."""
Period = Annotated[int, Limits(minimum=0, maximum=MAX_PERIODS, whole=True)]


@dataclass(frozen=True, kw_only=True)
class Orbit:
    """The orbit of the passive craft, with the true anomaly at t = 0."""

    semi_major_axis_m: Positive
    eccentricity: Part
    true_anomaly_rad: Annotated[float, Limits(minimum=-2.0 * math.pi, maximum=2.0 * math.pi)]
    gravitational_parameter_m3_s2: Positive

    def __post_init__(self) -> None:
        mu_m3_s2 = self.gravitational_parameter_m3_s2
        elements = OrbitalElements(self.semi_major_axis_m, self.eccentricity, 0.0, 0.0, 0.0, 0.0)
        check_orbit("semi_major_axis_m", elements.state(mu_m3_s2), mu_m3_s2)


@dataclass(frozen=True, kw_only=True)
class Start:
    """The active craft at t = 0 in Hill's axes.

    x radially outward, y along the motion, z along the orbit's normal.
    """

    position_m: Vector
    velocity_m_s: Vector


@dataclass(frozen=True, kw_only=True)
class Bounds:
    """Bounds of position and velocity at t = 0..T, and of held thrust.

    The unit of the thrust, `control`, is `acceleration_m_s2`; its default is 1.
    """

    position_m: Bound
    velocity_m_s: Bound
    control: Bound | None = None


def _check_times(first: int, last: int) -> None:
    if first > last:
        raise ValueError(f"until_period: must be at least from_period, {first}")


@dataclass(frozen=True, kw_only=True)
class Cone:
    """An approach cone, replaced by a pyramid inside it.

    It holds from t = `from_period` to t = `until_period`. The axis may have any length; the
    half-angle is that between axis and cone.
    """

    apex_m: Vector
    axis: Vector
    half_angle_rad: Annotated[float, Limits(above=0.0, below=0.5 * math.pi)]
    faces: Annotated[int, Limits(minimum=3, maximum=24, whole=True)] = 8
    from_period: Period = 0
    until_period: Period = MAX_PERIODS

    def __post_init__(self) -> None:
        _check_times(self.from_period, self.until_period)
        if not any(self.axis):
            raise ValueError("axis: must have a direction, not only zeros")

    @property
    def half_spaces(self) -> tuple[Floats, Floats]:
        """Outward normals, (faces, 6), and offsets of the pyramid, whose edges lie on the cone."""
        along = np.array(self.axis) / np.linalg.norm(self.axis)
        # Two directions across the axis and each other.
        across = np.linalg.svd(along[None, :])[2][1:]
        turns = 2.0 * np.pi * np.arange(self.faces) / self.faces
        # The middle of a face is nearer to the axis than the edges, which are on the cone.
        slope = np.tan(self.half_angle_rad) * np.cos(np.pi / self.faces)
        rows = (
            np.outer(np.cos(turns), across[0]) + np.outer(np.sin(turns), across[1]) - slope * along
        )
        normals = rows / np.linalg.norm(rows, axis=1)[:, None]
        return np.pad(normals, ((0, 0), (0, 3))), normals @ np.array(self.apex_m)


@dataclass(frozen=True, kw_only=True)
class KeepIn:
    """Half-spaces for states, normals . position + velocity_normals_s . velocity <= offsets_m.

    They hold from t = `from_period` to t = `until_period`.
    """

    normals: Annotated[tuple[Vector, ...], Field(min_length=1, max_length=50)]
    velocity_normals_s: tuple[Vector, ...] = ()
    offsets_m: tuple[float, ...]
    from_period: Period = 0
    until_period: Period = MAX_PERIODS

    def __post_init__(self) -> None:
        _check_times(self.from_period, self.until_period)
        if len(self.offsets_m) != len(self.normals):
            raise ValueError(
                f"offsets_m: must have {len(self.normals)} numbers, one for each normal"
            )
        if len(self.velocity_normals_s) not in (0, len(self.normals)):
            raise ValueError(
                f"velocity_normals_s: must have {len(self.normals)} rows, one for each normal"
            )
        if not self._rows.any(axis=1).all():
            raise ValueError("normals: must have no row of zeros")

    @property
    def _rows(self) -> Floats:
        """Normals of states, shape (k, 6)."""
        velocity = self.velocity_normals_s or np.zeros((len(self.normals), 3))
        return np.hstack([self.normals, velocity])

    @property
    def half_spaces(self) -> tuple[Floats, Floats]:
        """Normals, shape (k, 6), and offsets; the part for the position has length one.

        If this part is zero, the part for the velocity has.
        """
        rows = self._rows
        lengths = np.linalg.norm(rows[:, :3], axis=1)
        lengths = np.where(lengths > 0.0, lengths, np.linalg.norm(rows[:, 3:], axis=1))
        return rows / lengths[:, None], np.array(self.offsets_m) / lengths


@dataclass(frozen=True, kw_only=True)
class ControlLimits:
    """Half-spaces for the controls, normals . u <= offsets, in the units of the controls.

    They hold from t = `from_period` to t = `until_period`.
    """

    normals: Annotated[tuple[Vector, ...], Field(min_length=1, max_length=50)]
    offsets: tuple[float, ...]
    from_period: Period = 0
    until_period: Period = MAX_PERIODS

    def __post_init__(self) -> None:
        _check_times(self.from_period, self.until_period)
        if len(self.offsets) != len(self.normals):
            raise ValueError(f"offsets: must have {len(self.normals)} numbers, one for each normal")
        if not all(map(any, self.normals)):
            raise ValueError("normals: must have no row of zeros")


@dataclass(frozen=True, kw_only=True)
class Disturbance:
    """An unknown acceleration, constant over each period: its largest magnitude along an axis."""

    acceleration_m_s2: Bound


@dataclass(frozen=True, kw_only=True)
class Navigation:
    """Largest errors of the initial state of a plan along an axis, in closed loop."""

    position_error_m: Bound
    velocity_error_m_s: Bound


@dataclass(frozen=True, kw_only=True)
class Rendezvous:
    """A rendezvous in T `periods`.

    With ``engine = "held"`` the thrust is constant over a period, and `acceleration_m_s2` is that
    of a unit control. With ``engine = "impulses"`` a period begins with an impulse of at most
    `max_impulse_m_s` along each axis, or in norm for thrust in a ball. The constraints hold at t =
    0..T, before and after an impulse, and at `checks_between_periods` instants within each period.

    With `sensor` or `initial_error` the result is what a rendezvous can guarantee, with
    `passive_safety` also if the engines fail, and with `nonlinear` for the motion about a central
    body.
    """

    kind: ClassVar[str] = "reachable-rendezvous"

    name: Name = "rendezvous"
    description: Description = ""
    periods: Annotated[int, Limits(minimum=1, maximum=MAX_PERIODS, whole=True)]
    period_s: Positive
    engine: Engine = Engine.HELD
    acceleration_m_s2: Positive | None = None
    max_impulse_m_s: Bound | None = None
    model: MotionModel = MotionModel.FROZEN
    thrust: ThrustShape = ThrustShape.BOX
    checks_between_periods: Annotated[int, Limits(minimum=0, maximum=10, whole=True)] = 0
    orbit: Orbit
    initial: Start
    bounds: Bounds
    cone: Cone | None = None
    keep_in: Annotated[tuple[KeepIn, ...], Field(max_length=20)] = ()
    control_limits: Annotated[tuple[ControlLimits, ...], Field(max_length=20)] = ()
    disturbance: Disturbance | None = None
    navigation: Navigation | None = None
    initial_error: InitialError | None = None
    execution_error: ExecutionError | None = None
    sensor: Sensor | None = None
    goal: Goal | None = None
    passive_safety: PassiveSafetyTable | None = None
    nonlinear: bool = False

    def __post_init__(self) -> None:
        self._check_engine()
        self._check_times()
        check_angle(
            "period_s, in all periods,",
            self.periods * self.period_s,
            self.ellipse.mean_motion_rad_s,
        )
        if self.disturbance is not None and self.checks_between_periods:
            raise ValueError("checks_between_periods: must be 0 with a disturbance")
        change_m_s = float(self.control_bounds.max()) * self.delta_v_m_s
        reach = max(
            change_m_s / min(self.bounds.velocity_m_s),
            change_m_s * self.period_s / min(self.bounds.position_m),
        )
        if reach > _MAX_REACH:
            key = "max_impulse_m_s" if self.has_impulses else "acceleration_m_s2"
            raise ValueError(
                f"{key}: full control over a period changes a state by {reach:.3g} times its "
                f"bound; rounding decides the result beyond {_MAX_REACH:g}"
            )
        _ = self.problem  # raises ValueError if the values define no problem
        self._check_errors()

    def _check_errors(self) -> None:
        """Raise `ValueError` if the tables of the errors contradict others, or one is missing."""
        if not self.is_guaranteed:
            for key in ("execution_error", "goal", "passive_safety"):
                if getattr(self, key) is not None:
                    raise ValueError(f"{key}: needs [sensor] or [initial_error]")
            if self.nonlinear:
                raise ValueError("nonlinear: needs [sensor] or [initial_error]")
            return
        if self.goal is None:
            raise ValueError("goal: is missing; [sensor] and [initial_error] need it")
        if self.navigation is not None:
            raise ValueError("navigation: must be omitted with [sensor] or [initial_error]")
        if self.periods > MAX_GUARANTEED_PERIODS:
            raise ValueError(
                f"periods: must be at most {MAX_GUARANTEED_PERIODS} with [sensor] or "
                "[initial_error]"
            )
        self._check_execution()
        self._check_drifts()
        check_starts(self.problem, self.errors.start)

    def _check_execution(self) -> None:
        execution = self.execution_error
        if execution is None:
            return
        if self.has_impulses and execution.absolute_m_s2 is not None:
            raise ValueError("execution_error.absolute_m_s2: impulses need absolute_m_s")
        if not self.has_impulses and execution.absolute_m_s is not None:
            raise ValueError("execution_error.absolute_m_s: held thrust needs absolute_m_s2")

    def _check_drifts(self) -> None:
        key = "passive_safety" if self.passive_safety is not None else "nonlinear"
        if self.passive_safety is None and not self.nonlinear:
            return
        if not self.has_impulses:
            raise ValueError(f'{key}: needs engine = "impulses"')
        if self.is_frozen_ellipse:
            raise ValueError(f'{key}: needs model = "time-varying" on an ellipse')
        last = None if self.passive_safety is None else self.passive_safety.until_period
        if last is not None and last >= self.periods:
            raise ValueError(
                f"passive_safety.until_period: must be at most {self.periods - 1}, the last impulse"
            )
        self._check_keep_out(self.passive_safety)

    def _check_keep_out(self, safety: PassiveSafetyTable | None) -> None:
        """Raise `ValueError` if drifts begin inside the ball, or lead to a hold point inside it."""
        if safety is None or self.goal is None:
            return
        points = [("initial.position_m", self.initial.position_m)]
        if safety.until_period in (None, self.periods - 1):
            # The drift after the last impulse passes the hold point.
            points.append(("goal.position_m", self.goal.position_m))
        for key, point in points:
            distance_m = math.hypot(*point)
            if distance_m < safety.keep_out_m:
                raise ValueError(
                    f"{key}: is {distance_m:g} m from the target, inside the ball of "
                    f"passive_safety.keep_out_m, {safety.keep_out_m:g} m; move it or make the ball "
                    "smaller"
                )

    def _check_engine(self) -> None:
        if self.has_impulses:
            if self.max_impulse_m_s is None:
                raise ValueError("max_impulse_m_s: is missing; impulses need it")
            if self.acceleration_m_s2 is not None or self.bounds.control is not None:
                raise ValueError(
                    "engine: impulses are limited by max_impulse_m_s; omit acceleration_m_s2 and "
                    "bounds.control"
                )
            return
        if self.acceleration_m_s2 is None:
            raise ValueError("acceleration_m_s2: is missing; held thrust needs it")
        if self.max_impulse_m_s is not None:
            raise ValueError('max_impulse_m_s: needs engine = "impulses"')

    def _check_times(self) -> None:
        """Raise `ValueError` if constraints begin after the last state or control."""
        tables: list[tuple[str, Cone | KeepIn | ControlLimits, int]] = []
        if self.cone is not None:
            tables.append(("cone", self.cone, self.periods))
        for number, region in enumerate(self.keep_in, start=1):
            tables.append((f"keep_in.#{number}", region, self.periods))
        for number, limits in enumerate(self.control_limits, start=1):
            tables.append((f"control_limits.#{number}", limits, self.periods - 1))
        for name, table, last in tables:
            if table.from_period > last:
                raise ValueError(
                    f"{name}.from_period: must be at most {last}, the last t with periods = "
                    f"{self.periods}, found {table.from_period}"
                )

    @property
    def has_impulses(self) -> bool:
        """Whether a control is an impulse, in m/s; otherwise it is thrust."""
        return self.engine is Engine.IMPULSES

    @property
    def is_frozen_ellipse(self) -> bool:
        """Whether the linear model is frozen although the orbit is an ellipse.

        Bounds between the instants exist only for the model of the orbit itself.
        """
        return self.model is MotionModel.FROZEN and self.orbit.eccentricity > 0.0

    @property
    def control_bounds(self) -> Floats:
        """Bounds of the controls, shape (3,): in m/s, or as parts of `acceleration_m_s2`."""
        if self.has_impulses:
            return np.array(self.max_impulse_m_s)
        return np.array(self.bounds.control or (1.0, 1.0, 1.0))

    @property
    def unit_m_s2(self) -> float:
        """Acceleration of a unit of held thrust."""
        assert self.acceleration_m_s2 is not None
        return self.acceleration_m_s2

    @property
    def delta_v_m_s(self) -> float:
        """Delta-v of a unit control over a period."""
        return 1.0 if self.has_impulses else self.unit_m_s2 * self.period_s

    @cached_property
    def ellipse(self) -> EllipticOrbit:
        """The orbit of the passive craft."""
        orbit = self.orbit
        return EllipticOrbit.of_size(
            orbit.semi_major_axis_m,
            orbit.eccentricity,
            orbit.gravitational_parameter_m3_s2,
            orbit.true_anomaly_rad,
        )

    @cached_property
    def motion(self) -> HeldMotion:
        """The linear model."""
        return motion_of(self.ellipse, self.model)

    @cached_property
    def truth(self) -> NonlinearMotion:
        """The nonlinear model."""
        return NonlinearMotion(self.ellipse, self.orbit.semi_major_axis_m)

    @cached_property
    def problem(self) -> ReachabilityProblem:
        """The problem that is solved."""
        return self._problem(self.periods)

    @property
    def longer(self) -> ReachabilityProblem:
        """The problem with up to four times as many periods."""
        return self._problem(min(4 * self.periods, MAX_PERIODS))

    @cached_property
    def instants(self) -> Floats:
        """Matrices of the states between the periods at which selected controls are checked."""
        return self._between(self.periods, _INSTANTS)

    @property
    def disturbance_effect(self) -> Floats | None:
        """Effect of the unknown acceleration on the state, shape (T, 6, 3).

        Column j is the effect of its largest magnitude along axis j, held over a period.
        """
        if self.disturbance is None:
            return None
        # The effect of 1 m/s^2.
        _, held = discretised(self.motion, self.periods, self.period_s, 1.0)
        return np.asarray(held * self.disturbance.acceleration_m_s2)

    @property
    def navigation_error(self) -> Floats | None:
        """Largest error of each component of an estimate, shape (6,)."""
        if self.navigation is None:
            return None
        return np.array(self.navigation.position_error_m + self.navigation.velocity_error_m_s)

    @property
    def is_guaranteed(self) -> bool:
        """Whether the file asks for what a rendezvous can guarantee with bounded errors."""
        return self.sensor is not None or self.initial_error is not None

    @cached_property
    def errors(self) -> ErrorBounds:
        """Bounds of the errors, in the units of the states and the controls."""
        start = self.initial_error or InitialError()
        execution = self.execution_error or ExecutionError()
        absolute = np.array(execution.absolute_m_s or NO_ERROR)
        if not self.has_impulses:
            absolute = np.array(execution.absolute_m_s2 or NO_ERROR) / self.unit_m_s2
        measured: tuple[float, ...] = ()
        if self.sensor is not None and self.sensor.position_error_m is not None:
            measured = self.sensor.position_error_m + (self.sensor.velocity_error_m_s or ())
        return ErrorBounds(
            np.array(start.position_m + start.velocity_m_s),
            absolute,
            np.full(3, execution.relative),
            np.array(measured),
            self.disturbance_effect,
            self.sight,
        )

    @property
    def sight(self) -> SightSensor | None:
        """The sensor of lines of sight, if there is one."""
        return None if self.sensor is None else self.sensor.sight

    @property
    def has_feedback(self) -> bool:
        """Whether a plan before the flight reacts to measurements."""
        return self.sensor is not None and self.sensor.acts_before_flight

    @property
    def couples_all_states(self) -> bool:
        """Whether plans are for all states together: independent parts are not planned apart.

        Drifts, distances of nonlinear motion and lines of sight depend on all states.
        """
        return self.nonlinear or self.sight is not None or self.passive_safety is not None

    @cached_property
    def output_problem(self) -> OutputProblem:
        """The problem with bounded errors."""
        goal = self.goal
        assert goal is not None
        box = goal.position_box_m + (goal.velocity_box_m_s or (np.inf,) * 3)
        target = np.array(goal.position_m + goal.velocity_m_s)
        return with_errors(
            self.problem,
            self.errors,
            target,
            np.array(box),
            all_act=self.couples_all_states,
            at_instants=self.path_limits is None,
        )

    @property
    def drifts(self) -> Coasting:
        """The motion after each impulse after which the engines may fail.

        Without [passive_safety] it is the motion in the period after each impulse.
        """
        impulses = self.periods
        periods = 1
        if self.passive_safety is not None:
            periods = self.passive_safety.drift_periods
            if self.passive_safety.until_period is not None:
                impulses = self.passive_safety.until_period + 1
        ellipse = self.ellipse
        # The rate of the orbit at the perigee.
        fastest_rad_s = ellipse.semi_latus_rate_rad_s * (1.0 + ellipse.eccentricity) ** 2
        instants = math.ceil(self.period_s * fastest_rad_s / _MAX_ANGLE_RAD)
        acceleration_m_s2 = 0.0
        if self.disturbance is not None:
            acceleration_m_s2 = float(np.linalg.norm(self.disturbance.acceleration_m_s2))
        return Coasting(
            ellipse,
            self.period_s,
            impulses,
            periods,
            max(instants, _MIN_INSTANTS),
            acceleration_m_s2,
            semi_major_axis_m=self.orbit.semi_major_axis_m if self.nonlinear else None,
        )

    @cached_property
    def path_limits(self) -> PathLimits | None:
        """The constraints on states at all times; None if they are kept at instants only.

        Held thrust, and the frozen model of an ellipse, have no bound between instants.
        """
        if not self.has_impulses or self.is_frozen_ellipse:
            return None
        drifts = self.drifts
        flight = replace(
            drifts,
            impulses=self.periods,
            periods=1,
            instants=max(drifts.instants, _FLIGHT_INSTANTS),
        )
        problem = self.problem
        normals, offsets = problem.further
        # For each period: upper and lower bounds of states, and the offsets that hold at its start.
        bounds = np.tile(problem.state_bounds, (self.periods, 2))
        unit = np.eye(problem.states)
        return PathLimits(
            flight, np.vstack([unit, -unit, normals]), np.hstack([bounds, offsets[:-1]])
        )

    def _problem(self, periods: int) -> ReachabilityProblem:
        between = None
        if self.checks_between_periods:
            between = self._between(periods, self.checks_between_periods)
        with np.errstate(over="ignore", invalid="ignore"):
            if self.has_impulses:
                transition, control = impulsive(self.motion, periods, self.period_s)
            else:
                transition, control = discretised(
                    self.motion, periods, self.period_s, self.unit_m_s2
                )
        return ReachabilityProblem(
            transition,
            control,
            np.array(self.initial.position_m + self.initial.velocity_m_s),
            np.array(self.bounds.position_m + self.bounds.velocity_m_s),
            self.control_bounds,
            self.thrust,
            *self._half_spaces(periods),
            between,
            STATE_NAMES,
            IMPULSE if self.has_impulses else None,
            *self._limits(periods),
        )

    def _between(self, periods: int, instants: int) -> Floats:
        with np.errstate(over="ignore", invalid="ignore"):
            if self.has_impulses:
                return between_impulses(self.motion, periods, self.period_s, instants)
            return between_periods(self.motion, periods, self.period_s, self.unit_m_s2, instants)

    def _limits(self, periods: int) -> tuple[Floats, Floats]:
        """Return the limits on the controls as constraints: normals and offsets."""
        normals = np.zeros((0, 3))
        offsets = np.zeros((periods, 0))
        times = np.arange(periods)[:, None]
        for each in self.control_limits:
            normals = np.vstack([normals, each.normals])
            # At other times the offset is infinite: no constraint.
            holds = (times >= each.from_period) & (times <= each.until_period)
            offsets = np.hstack([offsets, np.where(holds, each.offsets, np.inf)])
        return normals, offsets

    def _half_spaces(self, periods: int) -> tuple[Floats, Floats, tuple[str, ...]]:
        """Return cone and half-spaces as constraints on states: normals, offsets and names."""
        regions: list[tuple[str, Cone | KeepIn]] = []
        if self.cone:
            regions.append(("face {} of the cone", self.cone))
        for number, box in enumerate(self.keep_in, start=1):
            regions.append((f"half-space {{}} of keep_in #{number}", box))

        normals = np.zeros((0, 6))
        offsets = np.zeros((periods + 1, 0))
        names = list[str]()
        times = np.arange(periods + 1)[:, None]
        for name, region in regions:
            rows, offsets_m = region.half_spaces
            normals = np.vstack([normals, rows])
            # At other times the offset is infinite: no constraint.
            holds = (times >= region.from_period) & (times <= region.until_period)
            offsets = np.hstack([offsets, np.where(holds, offsets_m, np.inf)])
            names += [name.format(row) for row in range(1, len(rows) + 1)]
        return normals, offsets, tuple(names)
