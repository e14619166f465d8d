"""Problem files of kind `multipoint`: tables, checks, and the tour in SI."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal
from enum import Enum
from typing import Annotated

import numpy as np
from pydantic import Field, PlainValidator

from experiments.common.errors import InputError, input_errors
from experiments.common.problem_file import (
    ProblemTables,
    ReadProblem,
    angle_problems,
    duplicate_names,
    orbit_problems,
    problem_form,
    rate_problems,
)
from experiments.common.toml_file import load_tables
from experiments.common.toml_form import KeyPath, Known, Problem
from experiments.common.toml_values import (
    KILO,
    NUMBER,
    ZERO,
    Degrees,
    Eccentricity,
    Name,
    NotNegative,
    Numbers,
    Positive,
    Table,
    Vector,
    key,
    radians,
    si,
    wrong,
)
from infoset.arrays import Floats
from rendezvous.multipoint import DriftingTargets, KeplerTargets, KeplerTour, Meet, Target, TimeLimits, Tour, Visits
from rendezvous.relative_motion import ClohessyWiltshire, EllipticOrbit, LinearMotion, TschaunerHempel
from rendezvous.two_body import OrbitalElements, coast

KIND = "multipoint"
MOST_TARGETS = 200
ELEMENTS = 7


class Axes(Enum):
    """Axes of positions and velocities."""

    HILL = "hill"
    INERTIAL = "inertial"

    @property
    def other(self) -> Axes:
        """Return the other axes."""
        return Axes.INERTIAL if self is Axes.HILL else Axes.HILL


KEYS = {
    Axes.HILL: ("position_m", "velocity_m_s"),
    Axes.INERTIAL: ("elements", "position_km", "velocity_km_s", "epoch_s"),
}
TOP_KEYS = {
    Axes.HILL: ("orbit_rate_rad_s", "eccentricity", "true_anomaly_deg"),
    Axes.INERTIAL: ("gravitational_parameter_km3_s2",),
}


def _elements(value: object) -> tuple[Decimal, ...]:
    numbers = Numbers(ELEMENTS, NUMBER)(value)
    if not (numbers[0] > 0 and 0 <= numbers[1] < 1):
        raise wrong(
            "must begin with a semi-major axis above 0 and an eccentricity from 0 to below 1",
            "write [a_km, e, i_deg, raan_deg, argument_of_periapsis_deg, true_anomaly_deg, epoch_s]",
        )
    return numbers


def _flag(value: object) -> bool:
    if not isinstance(value, bool):
        raise wrong("must be true or false")
    return value


Elements = Annotated[tuple[Decimal, ...], PlainValidator(_elements)]
Time = Annotated[Decimal, PlainValidator(NUMBER)]


class BodyTable(Table):
    """State of a body: at t = 0 in Hill axes, or at an epoch in inertial axes."""

    position_m: Vector | None = key(
        "at t = 0: x radially outward, y along the motion, z along the orbit's normal",
        "[0.0, 0.0, 0.0]",
        "[100.0, 2000.0, 50.0]",
        "[-150.0, 3500.0, -80.0]",
        default=None,
    )
    velocity_m_s: Vector | None = key(
        "velocity at t = 0 in the same axes",
        "[0.0, 0.0, 0.0]",
        "[0.05, -0.226, 0.02]",
        "[-0.10, 0.339, 0.05]",
        default=None,
    )
    elements: Elements | None = key(
        'with axes = "inertial": a km, e, then i, RAAN, argument of periapsis, true anomaly in degrees, epoch s',
        "[1.5e8, 0.02, 0.0, 0.0, 103.0, 0.0, 0.0]",
        default=None,
    )
    position_km: Vector | None = key("position, in place of elements", "[7000.0, 0.0, 0.0]", default=None)
    velocity_km_s: Vector | None = key("velocity, in place of elements", "[0.0, 7.5, 0.0]", default=None)
    epoch_s: Time = key("epoch of position_km and velocity_km_s", "0.0", default=ZERO)


class ChaserTable(BodyTable):
    """[chaser]."""


class TargetTable(BodyTable):
    """[[target]]."""

    name: Name = key("name of the target", '"T1"', '"T2"')
    time_s: Positive | None = key(
        "time of the visit; a first guess if times are optimised", "1500.0", "3000.0", default=None
    )
    meet: Meet = key(
        '"flyby" (same position) or "rendezvous" (same position and velocity)', '"flyby"', default=Meet.FLYBY
    )
    dwell_s: NotNegative = key("how long the chaser stays at a rendezvous", "0.0", default=ZERO)


class TimesTable(Table):
    """[times]."""

    optimise: Annotated[bool, PlainValidator(_flag)] = key("whether times are optimised", "false", default=False)
    latest_s: Positive | None = key("latest time of the last visit; without this key: none", "4000.0", default=None)
    least_gap_s: NotNegative = key("shortest travel time between two targets", "0.0", default=ZERO)
    price_per_s: NotNegative = key("price of one second of the last time, added to the cost", "0.0", default=ZERO)


class MultipointTables(ProblemTables):
    """A problem file of kind `multipoint`."""

    name: Name = key("name of the results", '"my-tour"', default="tour")
    axes: Axes = key('"hill" or "inertial"', '"hill"')
    orbit_rate_rad_s: Positive | None = key(
        'mean motion of the reference orbit, with axes = "hill"', "1.13e-3", default=None
    )
    eccentricity: Eccentricity = key("eccentricity of the reference orbit", "0.0", default=ZERO)
    true_anomaly_deg: Degrees = key("true anomaly of the reference orbit at t = 0", "0.0", default=ZERO)
    gravitational_parameter_km3_s2: Positive | None = key(
        'gravitational parameter of the attracting body, with axes = "inertial"', "398600.4418", default=None
    )
    greatest_control_m_s2: Positive | None = key("bound on the control; without this key: none", "0.02", default=None)
    chaser: ChaserTable = key("initial state of the chaser", "")
    target: Annotated[list[TargetTable], Field(min_length=1, max_length=MOST_TARGETS)] = key("the targets", "")
    times: TimesTable = key("choice of the times", "", default=TimesTable())


def _checks(known: Known) -> Iterator[Problem]:
    """Check the values against each other."""
    name = known.value("axes")
    if name not in [axes.value for axes in Axes]:
        return
    axes = Axes(name)
    yield from _axes_problems(known, axes)
    targets = known.value("target")
    paths = [("target", str(index)) for index in range(len(targets) if isinstance(targets, list) else 0)]
    for path in (("chaser",), *paths):
        yield from _body_problems(known, path, axes)
    yield from duplicate_names(known, "target", len(paths))
    for path in paths:
        dwell, meet = known.number(*path, "dwell_s"), known.value(*path, "meet")
        if dwell and meet in (None, Meet.FLYBY.value):
            remedy = 'set meet = "rendezvous", or remove it'
            yield Problem((*path, "dwell_s"), f"is {dwell}, but a flyby has no stay", remedy)
    yield from _time_problems(known, paths)
    if axes is Axes.HILL:
        yield from rate_problems(known.number("orbit_rate_rad_s"), known.number("eccentricity"))
        times = [*((*path, "time_s") for path in paths), ("times", "latest_s")]
        last = max(times, key=lambda path: known.number(*path) or ZERO)
        yield from angle_problems(last, known.number(*last), known.number("orbit_rate_rad_s"))
    else:
        for path in (("chaser",), *paths):
            yield from _orbit_problems(known, path)


def _axes_problems(known: Known, axes: Axes) -> Iterator[Problem]:
    needed, other = TOP_KEYS[axes][0], axes.other
    if known.document.get(needed) is None:
        yield Problem((needed,), f'is missing, and axes = "{axes.value}" needs it', "add it above the first table")
    for name in TOP_KEYS[other]:
        if name in known.document:
            yield Problem((name,), f'belongs to axes = "{other.value}"', f'remove it, or write axes = "{other.value}"')


def _body_problems(known: Known, path: KeyPath, axes: Axes) -> Iterator[Problem]:
    table = known.value(*path)
    if not isinstance(table, dict):
        return
    for name in KEYS[axes.other]:
        if name in table:
            remedy = f"give {' and '.join(KEYS[axes][:2])}"
            yield Problem((*path, name), f'belongs to axes = "{axes.other.value}"', remedy)
            return
    needed = KEYS[axes]
    if axes is Axes.INERTIAL:
        needed = ("position_km", "velocity_km_s")
        if "elements" in table:
            for name in KEYS[axes][1:]:
                if name in table:
                    yield Problem((*path, name), "is given together with elements", "give one of the two")
            return
        if not any(name in table for name in needed):
            yield Problem(path, "has no initial state", "add elements, or position_km and velocity_km_s")
            return
    for name in needed:
        if name not in table:
            yield Problem((*path, name), "is missing", f"add {name} = [x, y, z]")


def _orbit_problems(known: Known, path: KeyPath) -> Iterator[Problem]:
    """Check the orbit of a body about the attracting one."""
    mu, elements = known.number("gravitational_parameter_km3_s2"), known.value(*path, "elements")
    position, velocity = (known.value(*path, name) for name in ("position_km", "velocity_km_s"))
    if mu is None:
        return
    name, mu_si = "elements", si(mu, 3 * KILO)
    if isinstance(elements, list):
        axis, eccentricity = Decimal(elements[0]), Decimal(elements[1])
        state = OrbitalElements(si(axis, KILO), si(eccentricity), 0.0, 0.0, 0.0, 0.0).state(mu_si)
    elif isinstance(position, list) and isinstance(velocity, list):
        name, state = "position_km", (_si_km(position), _si_km(velocity))
    else:
        return
    remedy = "choose an ellipse above the attracting body, or check the units"
    yield from orbit_problems((*path, name), state, mu_si, remedy)


def _si_km(values: list[object]) -> Floats:
    return np.array([si(Decimal(str(value)), KILO) for value in values])


def _time_problems(known: Known, paths: Sequence[KeyPath]) -> Iterator[Problem]:
    optimise = known.value("times", "optimise") is True
    times = [known.number(*path, "time_s") for path in paths]
    dwell = [known.number(*path, "dwell_s") or ZERO for path in paths]
    latest, gap = known.number("times", "latest_s"), known.number("times", "least_gap_s") or ZERO
    if not optimise:
        for path in paths:
            table = known.value(*path)
            if isinstance(table, dict) and "time_s" not in table:
                remedy = "add it, or optimise the times: optimise = true under [times]"
                yield Problem((*path, "time_s"), "is missing", remedy)
        for index in range(1, len(paths)):
            first, second = times[index - 1], times[index]
            if first is not None and second is not None and second <= first + dwell[index - 1]:
                text = f"must be after {first + dwell[index - 1]} s, when the chaser leaves the previous target, "
                text += f"found {second}"
                yield Problem((*paths[index], "time_s"), text, "list the targets in order of time")
        last = times[-1] if times else None
        if last is not None and latest is not None and last > latest:
            text = f"is {latest}, before the last visit at {last} s"
            yield Problem(("times", "latest_s"), text, "make it later, or set optimise = true under [times]")
    stays = sum(dwell[:-1], ZERO)
    need = len(paths) * gap + stays
    if latest is not None and paths and (latest < need or latest <= stays):
        text = f"is {latest}, and {len(paths)} visits with their gaps and stays take {need} s"
        yield Problem(("times", "latest_s"), text, "make it later, or the gaps and stays shorter")
    price, table = known.number("times", "price_per_s") or ZERO, known.value("times")
    if optimise and price == 0 and isinstance(table, dict) and "latest_s" not in table:
        yield Problem(
            ("times", "latest_s"),
            "is missing: the cost decreases to zero as the last time grows, so there is no best time",
            "add it, or a price_per_s above 0",
        )


FORM = problem_form(
    KIND,
    MultipointTables,
    _checks,
    (
        "orbit_rate_rad_s",
        *(f"{body}.{name}" for body in ("chaser", "target") for name in KEYS[Axes.HILL]),
        "target.time_s",
    ),
)


@dataclass(frozen=True, eq=False, repr=False)
class MultipointProblem(ReadProblem[MultipointTables]):
    """A problem as read; `times_s`, by target as listed, is None if a time is missing."""

    tour: Visits
    times_s: Floats | None
    latest_s: float | None
    price_per_s: float
    greatest_control_m_s2: float | None

    def limits(self) -> TimeLimits:
        """Return the limits of the times; `InputError` if the last time has neither a limit nor a price."""
        try:
            return TimeLimits(self.latest_s, self.tables.times.si("least_gap_s"), self.price_per_s)
        except ValueError as error:
            raise InputError(f"{self.source}: {error}: latest_s or price_per_s under [times]") from None


def load_multipoint(name_or_path: str, settings: Sequence[str] | None = None) -> MultipointProblem:
    """Read a built-in problem by its name or a file by its path, with settings KEY=VALUE in place of its values.

    Raises
    ------
    InputError
        If there is no such problem, or it is not sound.
    """
    tables = load_tables(FORM, name_or_path, settings)
    with input_errors(name_or_path):
        tour = _hill(tables) if tables.axes is Axes.HILL else _inertial(tables)
    times_s = [table.si("time_s") for table in tables.target if table.time_s is not None]
    return MultipointProblem(
        tables,
        name_or_path,
        tour,
        np.array(times_s) if len(times_s) == len(tables.target) else None,
        tables.times.si("latest_s"),
        tables.times.si("price_per_s"),
        tables.si("greatest_control_m_s2"),
    )


def _described(tables: MultipointTables) -> tuple[Target, ...]:
    return tuple(Target(table.name, table.meet, table.si("dwell_s")) for table in tables.target)


def _hill(tables: MultipointTables) -> Tour:
    rate, eccentricity = tables.si("orbit_rate_rad_s"), tables.si("eccentricity")
    motion: LinearMotion = ClohessyWiltshire(rate)
    if eccentricity > 0.0:
        motion = TschaunerHempel(EllipticOrbit(rate, eccentricity, tables.si("true_anomaly_deg")))
    initial = np.array([_relative(table) for table in tables.target])
    return Tour(motion, DriftingTargets(_described(tables), motion, initial), _relative(tables.chaser))


def _inertial(tables: MultipointTables) -> KeplerTour:
    mu = tables.si("gravitational_parameter_km3_s2")
    states, epochs = zip(*(_absolute(table, mu) for table in tables.target), strict=True)
    targets = KeplerTargets(_described(tables), np.array(states), np.array(epochs), mu)
    try:
        targets.states(np.arange(len(states)), targets.epoch_s)
        chaser, epoch_s = _absolute(tables.chaser, mu)
        return KeplerTour(targets, coast(chaser, -epoch_s, mu))
    except ValueError as error:
        raise ValueError(f"{error}; check the units of states and of gravitational_parameter_km3_s2") from None


def _relative(body: BodyTable) -> Floats:
    return np.array(body.si_numbers("position_m", "velocity_m_s"))


def _absolute(body: BodyTable, mu: float) -> tuple[Floats, float]:
    """Return the inertial state at the epoch, and the epoch."""
    if body.elements is not None:
        axis, eccentricity, *angles, epoch = body.elements
        orbit = OrbitalElements(si(axis, KILO), si(eccentricity), *(radians(angle) for angle in angles))
        return np.concatenate(orbit.state(mu)), si(epoch)
    return np.array(body.si_numbers("position_km", "velocity_km_s")), body.si("epoch_s")
