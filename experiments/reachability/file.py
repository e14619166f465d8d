"""Problem files of kind `reachable-rendezvous`: tables, checks, and the problem in SI."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from functools import cached_property
from typing import Annotated

import numpy as np
from pydantic import Field, PlainValidator

from experiments.common.errors import InputError
from experiments.common.problem_file import ProblemTables, ReadProblem, orbit_problems, problem_form
from experiments.common.toml_file import load_tables
from experiments.common.toml_form import Known, Problem
from experiments.common.toml_values import (
    KILO,
    NUMBER,
    POSITIVE,
    Degrees,
    Eccentricity,
    Items,
    Number,
    Numbers,
    Positive,
    Table,
    Vector,
    Whole,
    key,
    si,
)
from infoset.arrays import Floats
from infoset.polytope import EmptyPolytopeError, Polytope, UnboundedPolytopeError, UncertainHullError
from rendezvous.reachability import (
    MOST_PERIODS,
    InadmissibleStartError,
    MotionModel,
    NonlinearMotion,
    ReachabilityProblem,
    ThrustShape,
    between_periods,
    discretised,
    motion_of,
)
from rendezvous.relative_motion import ConstantMotion, EllipticOrbit, TschaunerHempel
from rendezvous.two_body import OrbitalElements

Rows = tuple[tuple[Decimal, ...], ...]

KIND = "reachable-rendezvous"
MOST_FACES = 24
MOST_HALFSPACES = 50
MOST_POLYTOPES = 20
MOST_CHECKS = 10
_INSTANTS = 12
_MOST_REVOLUTIONS = 100
_MOST_REACH = 1e4
STATE_NAMES = ("x", "y", "z", "vx", "vy", "vz")


OpenAngle = Annotated[Decimal, PlainValidator(Number(above=Decimal(0), below=Decimal(90)))]
Bound = Annotated[tuple[Decimal, ...], PlainValidator(Numbers(3, POSITIVE, one_for_all=True))]
FromPeriod = Annotated[int, PlainValidator(Whole(MOST_PERIODS, least=0))]
Normals = Annotated[
    Rows, PlainValidator(Items(Numbers(3, NUMBER), "arrays of 3 numbers", MOST_HALFSPACES, numbered="row {}:"))
]
Offsets = Annotated[tuple[Decimal, ...], PlainValidator(Items(NUMBER, "numbers", MOST_HALFSPACES))]


class OrbitTable(Table):
    """[orbit]: the orbit of the passive craft."""

    semi_major_axis_km: Positive = key("semi-major axis", "10000.0")
    eccentricity: Eccentricity = key("eccentricity, at least 0 and below 1", "0.1")
    true_anomaly_deg: Degrees = key("true anomaly at t = 0", "0.0")
    gravitational_parameter_m3_s2: Positive = key("gravitational parameter of the planet", "3.986004418e14")


class InitialTable(Table):
    """[initial]: the active craft at t = 0."""

    position_m: Vector = key(
        "x radially outward, y along the motion, z along the orbit's normal", "[-2540.0, -2650.0, 2120.0]"
    )
    velocity_m_s: Vector = key("velocity in the same axes", "[2.0, 3.0, 3.0]")


class BoundsTable(Table):
    """[bounds]: bounds of the components, one number or one for each axis."""

    position_m: Bound = key("bound of the position at t = 0..T", "3000.0")
    velocity_m_s: Bound = key("bound of the velocity at t = 0..T", "7.5")
    control: Bound = key("bound of the control, in units of acceleration_m_s2", "1.0")


class ConeTable(Table):
    """[cone]: an approach cone, replaced by a pyramid inside it."""

    apex_m: Vector = key("apex", "[0.0, 20.0, 0.0]")
    axis: Vector = key("direction of the axis, of any length", "[0.0, -1.0, 0.0]")
    half_angle_deg: OpenAngle = key("angle between axis and cone", "60.0")
    faces: Annotated[int, PlainValidator(Whole(MOST_FACES, least=3))] = key(
        "number of faces of the pyramid, at least 3", "8", default=8
    )
    from_period: FromPeriod = key("first t at which it holds", "0", default=0)


class KeepInTable(Table):
    """[[keep_in]]: a bounded polytope for the position, normals . position <= offsets_m."""

    normals: Normals = key(
        "one array for each half-space", "[[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]]"
    )
    offsets_m: Offsets = key("one number for each half-space", "[2900, 2900, 2900, 2900, 2900, 2900]")
    from_period: FromPeriod = key("first t at which it holds", "0", default=0)


class DisturbanceTable(Table):
    """[disturbance]: an unknown acceleration, constant over each period."""

    acceleration_m_s2: Bound = key("largest magnitude along an axis", "1e-4")


class NavigationTable(Table):
    """[navigation]: errors of the initial state of a plan, in closed loop."""

    position_error_m: Bound = key("largest error along an axis", "1.0")
    velocity_error_m_s: Bound = key("largest error along an axis", "0.01")


class ReachabilityTables(ProblemTables):
    """A problem file of kind `reachable-rendezvous`."""

    periods: Annotated[int, PlainValidator(Whole(MOST_PERIODS))] = key("number of periods, T", "4")
    period_s: Positive = key("length of a period", "180.0")
    acceleration_m_s2: Positive = key("acceleration of a unit control", "0.15")
    model: MotionModel = key('"frozen" at t = 0, or "time-varying"', '"frozen"', default=MotionModel.FROZEN)
    thrust: ThrustShape = key(
        '"box" (each component is bounded) or "ball" (the norm is bounded)', '"box"', default=ThrustShape.BOX
    )
    checks_between_periods: Annotated[int, PlainValidator(Whole(MOST_CHECKS, 0, "shorten period_s instead"))] = key(
        "number of instants within a period at which the constraints also hold", "0", default=0
    )
    orbit: OrbitTable = key("the orbit of the passive craft", "")
    initial: InitialTable = key("the active craft at t = 0", "")
    bounds: BoundsTable = key("bounds of the components", "")
    cone: ConeTable | None = key("an approach cone", "", default=None)
    keep_in: Annotated[tuple[KeepInTable, ...], Field(max_length=MOST_POLYTOPES)] = key(
        "polytopes for the position", "", default=()
    )
    disturbance: DisturbanceTable | None = key("an unknown acceleration", "", default=None)
    navigation: NavigationTable | None = key("navigation errors", "", default=None)


@dataclass(frozen=True, eq=False, repr=False)
class Rendezvous(ReadProblem[ReachabilityTables]):
    """A problem as read, in SI.

    `motion` is the linear model, `truth` the nonlinear one. `disturbance`, shape (T, 6, 3), is the effect of unit
    components of the unknown acceleration on the state, `navigation_error`, shape (6,), the largest error of each
    component of an estimate.
    """

    problem: ReachabilityProblem
    motion: ConstantMotion | TschaunerHempel
    truth: NonlinearMotion
    period_s: float
    acceleration_m_s2: float
    disturbance: Floats | None
    navigation_error: Floats | None

    @cached_property
    def instants(self) -> Floats:
        """Return the matrices of the states between the periods at which all members are checked."""
        return between_periods(self.motion, self.problem.periods, self.period_s, self.acceleration_m_s2, _INSTANTS)

    @property
    def longer(self) -> ReachabilityProblem:
        """The problem with up to four times as many periods; the last offsets of its constraints continue to hold."""
        problem, periods = self.problem, min(4 * self.problem.periods, MOST_PERIODS)
        transition, control = discretised(self.motion, periods, self.period_s, self.acceleration_m_s2)
        offsets, between = problem.offsets, problem.between
        if offsets is not None:
            offsets = np.vstack([offsets, np.repeat(offsets[-1:], periods - problem.periods, 0)])
        if between is not None:
            instants = between.shape[1]
            between = between_periods(self.motion, periods, self.period_s, self.acceleration_m_s2, instants)
        return replace(problem, transition=transition, control=control, offsets=offsets, between=between)


def load_rendezvous(name_or_path: str | os.PathLike[str], settings: Sequence[str] | None = None) -> Rendezvous:
    """Read a built-in problem by its name or a file by its path, with settings KEY=VALUE in place of its values.

    Raises
    ------
    InputError
        If there is no such problem, or it is not sound.
    """
    tables = load_tables(FORM, name_or_path, settings)
    try:
        return _rendezvous(tables)
    except InadmissibleStartError as error:
        violated = "; ".join(f"{name} by {excess:.6g}" for name, excess in error.broken)
        raise InputError(
            f"{os.fspath(name_or_path)}: initial.position_m: the state violates constraints: {violated}; move it "
            "inside, or let them hold from a later period (from_period)"
        ) from None
    except (ValueError, ArithmeticError) as error:
        raise InputError(f"{os.fspath(name_or_path)}: {error}; check the numbers and their units") from None


def _checks(known: Known) -> Iterator[Problem]:
    """Check the values against each other."""
    for name in ("position_m", "velocity_m_s"):
        values, bounds = known.value("initial", name), known.value("bounds", name)
        limits = bounds if isinstance(bounds, list) else [bounds] * 3
        for axis, value, limit in zip("xyz", values if isinstance(values, list) else (), limits, strict=False):
            if limit is not None and abs(Decimal(value)) > Decimal(limit):
                yield Problem(
                    ("initial", name),
                    f"{axis} is outside its bound, {limit}: found {value}",
                    f"move it inside, or raise bounds.{name}",
                )
    control = known.value("bounds", "control")
    if known.value("thrust") == "ball" and isinstance(control, list) and len({Decimal(value) for value in control}) > 1:
        yield Problem(("bounds", "control"), "must be one number for thrust in a ball", "write the radius of the ball")
    direction = known.value("cone", "axis")
    if isinstance(direction, list) and not any(direction):
        yield Problem(("cone", "axis"), "has no direction: all components are 0", "write axis = [0.0, -1.0, 0.0]")
    if known.value("disturbance") is not None and known.value("checks_between_periods"):
        yield Problem(
            ("disturbance",),
            "is possible without checks between periods only",
            "remove it, or write checks_between_periods = 0",
        )
    yield from _orbit_problems(known)
    yield from _size_problems(known)
    yield from _keep_in_problems(known)


def _orbit_problems(known: Known) -> Iterator[Problem]:
    """Check the size of the passive craft's orbit."""
    axis, eccentricity, mu = (
        known.number("orbit", name) for name in ("semi_major_axis_km", "eccentricity", "gravitational_parameter_m3_s2")
    )
    if axis is None or eccentricity is None or mu is None:
        return
    orbit = OrbitalElements(si(axis, KILO), si(eccentricity), 0.0, 0.0, 0.0, 0.0)
    remedy = "choose an orbit above the planet, in kilometres, or correct gravitational_parameter_m3_s2"
    yield from orbit_problems(("orbit", "semi_major_axis_km"), orbit.state(si(mu)), si(mu), remedy)


def _size_problems(known: Known) -> Iterator[Problem]:
    """Refuse numbers that take too long or are lost in rounding; mostly a unit is wrong."""
    period, periods = known.number("period_s"), known.value("periods")
    axis, mu = known.number("orbit", "semi_major_axis_km"), known.number("orbit", "gravitational_parameter_m3_s2")
    if period is None:
        return
    if isinstance(periods, int) and axis is not None and mu is not None:
        turns = periods * float(period) * (float(mu) / (1e3 * float(axis)) ** 3) ** 0.5 / (2.0 * np.pi)
        if turns > _MOST_REVOLUTIONS:
            yield Problem(
                ("period_s",),
                f"{periods} periods are {turns:.3g} revolutions, over {_MOST_REVOLUTIONS}: found {period}",
                "check its unit, and those of [orbit]",
            )
    push = known.number("acceleration_m_s2")
    for name, power in (("position_m", 2), ("velocity_m_s", 1)):
        bound, control = known.value("bounds", name), known.value("bounds", "control")
        if push is None or bound is None or control is None:
            continue
        least, most = min(_numbers(bound)), max(_numbers(control))
        reach = float(push) * most * float(period) ** power / least
        if reach > _MOST_REACH:
            yield Problem(
                ("acceleration_m_s2",),
                f"full thrust over one period changes {name} by {reach:.3g} times its bound, over {_MOST_REACH:g}: "
                f"found {push}",
                f"check its unit, and those of period_s and bounds.{name}",
            )


def _numbers(value: object) -> list[float]:
    """Return the numbers of a valid value: one number, or an array."""
    return [float(str(number)) for number in (value if isinstance(value, list) else [value])]


def _keep_in_problems(known: Known) -> Iterator[Problem]:
    boxes = known.value("keep_in")
    for index in range(len(boxes) if isinstance(boxes, list) else 0):
        path = ("keep_in", str(index))
        normals, offsets = known.value(*path, "normals"), known.value(*path, "offsets_m")
        if not isinstance(normals, list) or not isinstance(offsets, list):
            continue
        if len(normals) != len(offsets):
            yield Problem(
                (*path, "offsets_m"),
                f"must have one number for each of the {len(normals)} normals, found {len(offsets)}",
                "add or remove some",
            )
            continue
        rows, limits = np.array(normals, dtype=float), np.array(offsets, dtype=float)
        if (np.linalg.norm(rows, axis=1) == 0.0).any():
            yield Problem((*path, "normals"), "has a normal of zero length", "remove it and its offset")
            continue
        size = max(float(np.abs(limits).max()), 1e-300)
        try:
            Polytope.from_constraints(rows, limits / size).needed()
        except EmptyPolytopeError as error:
            remedy = f"increase its offsets by at least {error.relaxation * size:.6g} m"
            yield Problem(path, "is empty: no position lies in all its half-spaces", remedy)
        except UnboundedPolytopeError as error:
            along = ", ".join(f"{value:.3g}" for value in error.direction)
            yield Problem(path, f"is unbounded along ({along})", "add half-spaces that bound it")
        except UncertainHullError:
            yield Problem(path, "is too flat or too small for the precision of the numbers", "make it wider")


FORM = problem_form(KIND, ReachabilityTables, _checks)


def _rendezvous(tables: ReachabilityTables) -> Rendezvous:
    orbit = EllipticOrbit.of_size(
        *tables.orbit.si_numbers(
            "semi_major_axis_km", "eccentricity", "gravitational_parameter_m3_s2", "true_anomaly_deg"
        )
    )
    motion = motion_of(orbit, tables.model)
    period_s, acceleration = tables.si("period_s"), tables.si("acceleration_m_s2")
    with np.errstate(over="ignore", invalid="ignore"):
        transition, control = discretised(motion, tables.periods, period_s, acceleration)
        between = None
        if tables.checks_between_periods:
            between = between_periods(motion, tables.periods, period_s, acceleration, tables.checks_between_periods)
    normals, offsets, names = _regions(tables)
    problem = ReachabilityProblem(
        transition,
        control,
        _vector(tables.initial, "position_m", "velocity_m_s"),
        _vector(tables.bounds, "position_m", "velocity_m_s"),
        _vector(tables.bounds, "control"),
        tables.thrust,
        normals,
        offsets,
        names,
        between,
        STATE_NAMES,
    )
    disturbance = None
    if tables.disturbance is not None:
        disturbance = control / acceleration * _vector(tables.disturbance, "acceleration_m_s2")
    navigation = tables.navigation
    return Rendezvous(
        tables,
        tables.name,
        problem,
        motion,
        NonlinearMotion(orbit, tables.orbit.si("semi_major_axis_km")),
        period_s,
        acceleration,
        disturbance,
        None if navigation is None else _vector(navigation, "position_error_m", "velocity_error_m_s"),
    )


def _regions(tables: ReachabilityTables) -> tuple[Floats | None, Floats | None, tuple[str, ...]]:
    """Return the half-spaces of the cone and of the polytopes as constraints on states: normals, offsets and names."""
    normals, offsets, names, begin = [], [], [], []
    cone = tables.cone
    if cone is not None:
        rows = _pyramid(_vector(cone, "axis"), cone.si("half_angle_deg"), cone.faces)
        normals.append(rows)
        offsets.append(rows @ _vector(cone, "apex_m"))
        names += [f"face {face} of the cone" for face in range(1, len(rows) + 1)]
        begin += [cone.from_period] * len(rows)
    for number, box in enumerate(tables.keep_in, start=1):
        rows = np.array([[si(value) for value in normal] for normal in box.normals])
        lengths = np.linalg.norm(rows, axis=1)
        normals.append(rows / lengths[:, None])
        offsets.append(_vector(box, "offsets_m") / lengths)
        names += [f"half-space {half} of keep_in #{number}" for half in range(1, len(rows) + 1)]
        begin += [box.from_period] * len(rows)
    if not normals:
        return None, None, ()
    both = np.hstack([np.vstack(normals), np.zeros((len(names), 3))])
    times = np.arange(tables.periods + 1)[:, None]
    return both, np.where(times >= np.array(begin), np.concatenate(offsets), np.inf), tuple(names)


def _pyramid(axis: Floats, half_angle_rad: float, faces: int) -> Floats:
    """Return the outward unit normals of a pyramid whose edges lie on a cone."""
    along = axis / np.linalg.norm(axis)
    across = np.linalg.svd(along[None, :])[2][1:]
    turns = 2.0 * np.pi * np.arange(faces) / faces
    slope = np.tan(half_angle_rad) * np.cos(np.pi / faces)
    rows = np.outer(np.cos(turns), across[0]) + np.outer(np.sin(turns), across[1]) - slope * along
    return np.asarray(rows / np.linalg.norm(rows, axis=1)[:, None])


def _vector(table: Table, *names: str) -> Floats:
    return np.array(table.si_numbers(*names))
