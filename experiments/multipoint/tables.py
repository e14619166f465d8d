"""The tables and keys of a problem of several targets, and what each value may be."""

from __future__ import annotations

from collections.abc import Iterator
from decimal import Decimal
from enum import Enum
from typing import Annotated

from pydantic import Field, PlainValidator

from experiments.common.orbit_angle import angle_problems
from experiments.common.toml_file import Known, Problem
from experiments.common.toml_values import (
    NUMBER,
    ONE,
    ZERO,
    Degrees,
    Description,
    Name,
    NotNegative,
    Number,
    Numbers,
    OneOf,
    Positive,
    Table,
    Vector,
    key,
    wrong,
)
from rendezvous.multipoint import Meet

KIND = "multipoint"
MOST_TARGETS = 200
ELEMENTS = 7


class Axes(Enum):
    """What positions and velocities are in."""

    HILL = "hill"
    INERTIAL = "inertial"


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
Eccentricity = Annotated[Decimal, PlainValidator(Number(least=ZERO, below=ONE))]
Time = Annotated[Decimal, PlainValidator(NUMBER)]


class BodyTable(Table):
    """Where a body is: in axes of Hill at t = 0, or inertial at an epoch."""

    position_m: Vector | None = key("at t = 0, axes of Hill", "[0.0, 2000.0, 0.0]", default=None)
    velocity_m_s: Vector | None = key("at t = 0, axes of Hill", "[0.0, 0.0, 0.0]", default=None)
    elements: Elements | None = key(
        "a km, e, then i, RAAN, argument of periapsis, true anomaly in degrees, epoch s",
        "[1.5e8, 0.02, 0.0, 0.0, 103.0, 0.0, 0.0]",
        default=None,
    )
    position_km: Vector | None = key("in place of elements", "[7000.0, 0.0, 0.0]", default=None)
    velocity_km_s: Vector | None = key("in place of elements", "[0.0, 7.5, 0.0]", default=None)
    epoch_s: Time = key("of position_km and velocity_km_s", "0.0", default=ZERO)


class ChaserTable(BodyTable):
    """[chaser]."""


class TargetTable(BodyTable):
    """[[target]]."""

    name: Name = key("what the target is called", '"T1"')
    time_s: Positive | None = key("when it is met; a start where times are optimised", "1500.0", default=None)
    meet: Annotated[Meet, PlainValidator(OneOf(Meet))] = key(
        '"flyby", at its position, or "rendezvous", with its velocity too', '"flyby"', default=Meet.FLYBY
    )
    dwell_s: NotNegative = key("how long the chaser stays; of a rendezvous", "0.0", default=ZERO)


class TimesTable(Table):
    """[times]."""

    optimise: Annotated[bool, PlainValidator(_flag)] = key("whether times are optimised", "false", default=False)
    latest_s: Positive | None = key("when the last target is met at the latest", "4000.0", default=None)
    least_gap_s: NotNegative = key("least travel time between two targets", "0.0", default=ZERO)
    price_per_s: NotNegative = key("added to the cost for a second of the last time", "1e-6", default=ZERO)


class MultipointTables(Table):
    """A whole problem."""

    schema_number: Annotated[int, PlainValidator(lambda value: value)] = key(
        "version of this form of file", "1", alias="schema", default=1
    )
    kind: Annotated[str, PlainValidator(lambda value: value)] = key("what kind of problem it is", f'"{KIND}"')
    name: Name = key("what results are called", '"my-tour"', default="tour")
    description: Description = key("a line for `infoset problems list`", '"Who is visited"', default="")
    axes: Annotated[Axes, PlainValidator(OneOf(Axes))] = key('"hill" or "inertial"', '"hill"')
    orbit_rate_rad_s: Positive | None = key("mean motion of the reference orbit", "1.13e-3", default=None)
    eccentricity: Eccentricity = key("of the reference orbit", "0.0", default=ZERO)
    true_anomaly_deg: Degrees = key("of the reference orbit at t = 0", "0.0", default=ZERO)
    gravitational_parameter_km3_s2: Positive | None = key("of the attracting body", "398600.4418", default=None)
    greatest_control_m_s2: Positive | None = key("bound on the control", "0.01", default=None)
    chaser: ChaserTable = key("where the chaser is", "")
    target: Annotated[list[TargetTable], Field(min_length=1, max_length=MOST_TARGETS)] = key("the targets", "")
    times: TimesTable = key("how times are chosen", "", default=TimesTable())


def checks(known: Known) -> Iterator[Problem]:
    """Find what the values are not to one another.

    Parameters
    ----------
    known : Known

    Yields
    ------
    Problem
    """
    given = known.value("axes")
    if given not in [each.value for each in Axes]:
        return
    axes = Axes(given)
    yield from _axes_problems(known, axes)
    targets = known.value("target")
    count = len(targets) if isinstance(targets, list) else 0
    for path in (("chaser",), *(("target", str(each)) for each in range(count))):
        yield from _body_problems(known, path, axes)
    seen: set[object] = set()
    for place in range(count):
        name = known.value("target", str(place), "name")
        if isinstance(name, str) and name in seen:
            yield Problem(("target", str(place), "name"), f'lists "{name}" a second time', "list each target once")
        seen.add(name if isinstance(name, str) else None)
    for place in range(count):
        dwell, meet = known.number("target", str(place), "dwell_s"), known.value("target", str(place), "meet")
        if dwell and meet in (None, Meet.FLYBY.value):
            where = ("target", str(place), "dwell_s")
            yield Problem(where, f"is {dwell}, but a flyby cannot stay", 'set meet = "rendezvous", or remove it')
    yield from _time_problems(known, count)
    if axes is Axes.HILL:
        places: list[tuple[str, ...]] = [("target", str(each), "time_s") for each in range(count)]
        places.append(("times", "latest_s"))
        last = max(places, key=lambda path: known.number(*path) or ZERO)
        yield from angle_problems(last, known.number(*last), known.number("orbit_rate_rad_s"))


def _axes_problems(known: Known, axes: Axes) -> Iterator[Problem]:
    needed = TOP_KEYS[axes][0]
    if known.document.get(needed) is None:
        yield Problem((needed,), f'is missing, and axes = "{axes.value}" needs it', "add it above the first table")
    other = Axes.INERTIAL if axes is Axes.HILL else Axes.HILL
    for name in TOP_KEYS[other]:
        if name in known.document:
            yield Problem((name,), f'belongs to axes = "{other.value}"', f'remove it, or write axes = "{other.value}"')


def _body_problems(known: Known, path: tuple[str, ...], axes: Axes) -> Iterator[Problem]:
    table = known.value(*path)
    if not isinstance(table, dict):
        return
    other = Axes.INERTIAL if axes is Axes.HILL else Axes.HILL
    for name in KEYS[other]:
        if name in table:
            yield Problem((*path, name), f'belongs to axes = "{other.value}"', f"give {' and '.join(KEYS[axes][:2])}")
            return
    if axes is Axes.HILL:
        missing = [name for name in KEYS[axes] if name not in table]
    elif "elements" in table:
        missing = []
        for name in KEYS[axes][1:]:
            if name in table:
                yield Problem((*path, name), "is given beside elements, which say it already", "give one of the two")
    else:
        missing = [name for name in ("position_km", "velocity_km_s") if name not in table]
        if len(missing) == 2:
            yield Problem(path, "says nowhere where it is", "add elements, or position_km and velocity_km_s")
            return
    for name in missing:
        yield Problem((*path, name), "is missing", f"add {name} = [x, y, z]")


def _time_problems(known: Known, count: int) -> Iterator[Problem]:
    optimise = known.value("times", "optimise") is True
    times = [known.number("target", str(each), "time_s") for each in range(count)]
    latest, gap = known.number("times", "latest_s"), known.number("times", "least_gap_s") or ZERO
    dwell = [known.number("target", str(each), "dwell_s") or ZERO for each in range(count)]
    if not optimise:
        for place in range(count):
            where = ("target", str(place), "time_s")
            table = known.value("target", str(place))
            if isinstance(table, dict) and "time_s" not in table:
                yield Problem(where, "is missing", "add it, or let times be found: optimise = true under [times]")
        for place in range(1, count):
            first, second = times[place - 1], times[place]
            if first is None or second is None:
                continue
            if second <= first + dwell[place - 1]:
                leaves = f"the one before is left at {first + dwell[place - 1]} s"
                where = ("target", str(place), "time_s")
                yield Problem(where, f"must be later, found {second}: {leaves}", "list targets in order of time")
        last = times[-1] if times else None
        if last is not None and latest is not None and last > latest:
            text = f"is {latest}, before the last visit at {last} s"
            yield Problem(("times", "latest_s"), text, "make it later, or remove it")
    need = count * gap + sum(dwell[:-1], ZERO)
    if latest is not None and count and (latest < need or (dwell and latest <= sum(dwell[:-1], ZERO))):
        text = f"is {latest}, and {count} visits with their least gaps and stays take {need} s"
        yield Problem(("times", "latest_s"), text, "make it later, or gaps and stays shorter")
    price = known.number("times", "price_per_s") or ZERO
    table = known.value("times")
    if optimise and price == 0 and isinstance(table, dict) and "latest_s" not in table:
        yield Problem(
            ("times", "latest_s"),
            "is missing: with the last time free the cost falls to zero as it grows, so there is no best",
            "add it, or a price_per_s above 0",
        )
