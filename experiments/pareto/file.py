"""Problem files of kind `pareto-encounter`: their tables, and the encounter of the core that they describe."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PlainValidator

from experiments.common.errors import InputError
from experiments.common.orbit_angle import angle_problems
from experiments.common.problem_file import problem_form, problem_hash
from experiments.common.toml_file import Known, Problem, load_tables
from experiments.common.toml_values import (
    NUMBER,
    ZERO,
    Description,
    Name,
    NotNegative,
    OneOf,
    Positive,
    Table,
    Vector,
    key,
    known_name,
    si,
    wrong,
)
from rendezvous.pareto import Component, Craft, Encounter, Meeting
from rendezvous.relative_motion import ORBITAL, ClohessyWiltshire

Floats = NDArray[np.float64]

KIND = "pareto-encounter"
MOST_CRAFT = 50
COMPONENTS = {each.name.lower(): each for each in Component}
TERMINAL = {name: f"{name}_m" if component.value < 3 else f"{name}_m_s" for name, component in COMPONENTS.items()}

Number = Annotated[Decimal, PlainValidator(NUMBER)]


def _free(value: object) -> tuple[Component, ...]:
    if not isinstance(value, list):
        raise wrong("must be an array of names")
    if not value:
        raise wrong("frees no component", 'free at least one, for example free = ["y", "z"]')
    names = [known_name(each, tuple(COMPONENTS)) for each in value]
    if len(set(names)) < len(names):
        raise wrong("names a component twice", "name each once")
    return tuple(COMPONENTS[name] for name in names)


class TerminalTable(Table):
    """What the meeting's fixed components are."""

    x_m: Number = key("against the motion", "0.0", default=ZERO)
    y_m: Number = key("radially outward", "0.0", default=ZERO)
    z_m: Number = key("along the orbit's normal", "0.0", default=ZERO)
    vx_m_s: Number = key("velocity against the motion", "0.0", default=ZERO)
    vy_m_s: Number = key("velocity outward", "0.0", default=ZERO)
    vz_m_s: Number = key("velocity along the normal", "0.0", default=ZERO)


class CraftTable(Table):
    """[[craft]]."""

    name: Name = key("what the craft is called", '"first"')
    position_m: Vector = key("x against the motion, y outward, z along the normal", "[0.0, 60.0, 80.0]")
    velocity_m_s: Vector = key("of the same", "[-1.2, -4.1, 0.04]")
    weight: NotNegative = key("of its excess in the group's loss", "1.0", default=Decimal(1))
    start_s: NotNegative = key("when it starts", "0.0", default=ZERO)


class ParetoTables(Table):
    """A whole problem."""

    schema_number: Annotated[int, PlainValidator(lambda value: value)] = key(
        "version of this form of file", "1", alias="schema", default=1
    )
    kind: Annotated[str, PlainValidator(lambda value: value)] = key("what kind of problem it is", f'"{KIND}"')
    name: Name = key("what results are called", '"my-encounter"', default="encounter")
    description: Description = key("a line for `infoset problems list`", '"Who meets whom"', default="")
    orbit_rate_rad_s: Positive = key("mean motion of the circular reference orbit", "1.176e-3")
    duration_s: Positive = key("from t = 0 to the meeting", "30.0")
    free: Annotated[tuple[Component, ...], PlainValidator(_free)] = key(
        "open components of the meeting's state, of x, y, z, vx, vy, vz", '["y", "z"]'
    )
    meet: Annotated[Meeting, PlainValidator(OneOf(Meeting))] = key(
        '"rendezvous", or "intercept": at one position with velocities of their own',
        '"rendezvous"',
        default=Meeting.RENDEZVOUS,
    )
    greatest_control_m_s2: Positive | None = key("bound on each craft's control", "1.0", default=None)
    terminal: TerminalTable = key("fixed components of the meeting's state", "", default=TerminalTable())
    craft: Annotated[list[CraftTable], Field(min_length=1, max_length=MOST_CRAFT)] = key("the craft", "")


def _checks(known: Known) -> Iterator[Problem]:
    """What the values must be to one another."""
    free, given = known.value("free"), known.value("terminal")
    if isinstance(free, list):
        if known.value("meet") == Meeting.INTERCEPT.value:
            for name in (each for each in free if str(each).startswith("v")):
                yield Problem(
                    ("free",), f"frees {name}, but velocities of an intercept are free anyway", "free x, y, z"
                )
        for name in (each for each in free if isinstance(given, dict) and TERMINAL.get(str(each)) in given):
            where = ("terminal", TERMINAL[str(name)])
            yield Problem(where, f"fixes {name}, which free = [...] leaves open", "remove it, or do not free it")
    craft = known.value("craft")
    count = len(craft) if isinstance(craft, list) else 0
    seen: set[object] = set()
    for place in range(count):
        name = known.value("craft", str(place), "name")
        if isinstance(name, str) and name in seen:
            yield Problem(("craft", str(place), "name"), f'calls a second craft "{name}"', "give each its own name")
        seen.add(name if isinstance(name, str) else None)
    weights = [known.value("craft", str(each), "weight") for each in range(count)]
    if count and all(isinstance(each, int | Decimal) and each == 0 for each in weights):
        yield Problem(("craft", "0", "weight"), "is zero, and so are all others", "give one craft a positive weight")
    duration, rate = known.number("duration_s"), known.number("orbit_rate_rad_s")
    if duration is None or duration <= 0:
        return
    yield from angle_problems(("duration_s",), duration, rate)
    for place in range(count):
        start = known.number("craft", str(place), "start_s")
        if start is not None and start >= duration:
            path = ("craft", str(place), "start_s")
            yield Problem(path, f"must be before the meeting at {duration} s, found {start}", "start it earlier")


FORM = problem_form(KIND, ParetoTables, _checks)


@dataclass(frozen=True, eq=False)
class ParetoProblem:
    """A problem as read.

    Parameters
    ----------
    name : str
    source : str
        What it was read from.
    hash : str
        Of every value but name and description.
    encounter : Encounter
    greatest_control_m_s2 : float or None
    """

    name: str
    source: str
    hash: str
    encounter: Encounter
    greatest_control_m_s2: float | None


def load_pareto(name_or_path: str) -> ParetoProblem:
    """Read a built-in problem or a file.

    Parameters
    ----------
    name_or_path : str

    Returns
    -------
    ParetoProblem

    Raises
    ------
    InputError
        If there is no such problem, or it is not sound.
    """
    tables = load_tables(FORM, name_or_path)
    motion = ClohessyWiltshire(si(tables.orbit_rate_rad_s), ORBITAL)
    craft = tuple(
        Craft(
            each.name,
            np.array([si(value) for value in (*each.position_m, *each.velocity_m_s)]),
            motion,
            si(each.weight),
            si(each.start_s),
        )
        for each in tables.craft
    )
    fixed = np.array([si(getattr(tables.terminal, TERMINAL[name])) for name in COMPONENTS])
    try:
        encounter = Encounter(craft, si(tables.duration_s), tables.free, fixed, tables.meet)
    except ValueError as error:
        raise InputError(f"{name_or_path}: {error}") from None
    bound = tables.greatest_control_m_s2
    return ParetoProblem(
        tables.name, name_or_path, problem_hash(tables), encounter, None if bound is None else si(bound)
    )
