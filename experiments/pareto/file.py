"""Problem files of kind `pareto-encounter`: tables, checks, and the encounter in SI."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import Annotated

import numpy as np
from pydantic import Field, PlainValidator

from experiments.common.errors import input_errors
from experiments.common.problem_file import (
    ProblemTables,
    ReadProblem,
    angle_problems,
    duplicate_names,
    problem_form,
    rate_problems,
)
from experiments.common.toml_file import load_tables
from experiments.common.toml_form import Known, Problem
from experiments.common.toml_values import (
    NUMBER,
    ZERO,
    Name,
    NotNegative,
    Positive,
    Table,
    Vector,
    key,
    known_name,
    wrong,
)
from rendezvous.pareto import Component, Craft, Encounter, Meeting
from rendezvous.relative_motion import ClohessyWiltshire

KIND = "pareto-encounter"
MOST_CRAFT = 50
COMPONENTS = {component.name.lower(): component for component in Component}
TERMINAL = {name: f"{name}_m" if component.value < 3 else f"{name}_m_s" for name, component in COMPONENTS.items()}

Number = Annotated[Decimal, PlainValidator(NUMBER)]


def _free(value: object) -> tuple[Component, ...]:
    if not isinstance(value, list):
        raise wrong("must be an array of names")
    if not value:
        raise wrong("has no component", 'name at least one, for example free = ["x", "z"]')
    names = [known_name(name, tuple(COMPONENTS)) for name in value]
    if len(set(names)) < len(names):
        raise wrong("names a component twice", "name each once")
    return tuple(COMPONENTS[name] for name in names)


class TerminalTable(Table):
    """[terminal]: the fixed components of the meeting."""

    x_m: Number = key("radially outward", "0.0", default=ZERO)
    y_m: Number = key("along the motion", "0.0", default=ZERO)
    z_m: Number = key("along the orbit's normal", "0.0", default=ZERO)
    vx_m_s: Number = key("velocity outward", "0.0", default=ZERO)
    vy_m_s: Number = key("velocity along the motion", "0.0", default=ZERO)
    vz_m_s: Number = key("velocity along the normal", "0.0", default=ZERO)


class CraftTable(Table):
    """[[craft]]."""

    name: Name = key("name of the craft", '"first"', '"second"')
    position_m: Vector = key(
        "x radially outward, y along the motion, z along the orbit's normal",
        "[60.0, 0.0, 80.0]",
        "[-50.0, -40.0, 60.0]",
    )
    velocity_m_s: Vector = key("velocity in the same axes", "[-4.1, 1.2, 0.04]", "[7.6, 9.0, 0.07]")
    weight: NotNegative = key("weight of its excess in the group loss", "1.0", default=Decimal(1))
    start_s: NotNegative = key("start time", "0.0", default=ZERO)


class ParetoTables(ProblemTables):
    """A problem file of kind `pareto-encounter`."""

    name: Name = key("name of the results", '"my-encounter"', default="encounter")
    orbit_rate_rad_s: Positive = key("mean motion of the circular reference orbit", "1.176e-3")
    duration_s: Positive = key("from t = 0 to the meeting", "30.0")
    free: Annotated[tuple[Component, ...], PlainValidator(_free)] = key(
        "free components of the meeting, of x, y, z, vx, vy, vz", '["x", "z"]'
    )
    meet: Meeting = key(
        '"rendezvous", or "intercept" (the same position, any velocities)', '"rendezvous"', default=Meeting.RENDEZVOUS
    )
    greatest_control_m_s2: Positive | None = key(
        "bound on each craft's control; without this key: none", "20.0", default=None
    )
    terminal: TerminalTable = key("fixed components of the meeting", "", default=TerminalTable())
    craft: Annotated[list[CraftTable], Field(min_length=1, max_length=MOST_CRAFT)] = key("the craft", "")


def _checks(known: Known) -> Iterator[Problem]:
    """Check the values against each other."""
    free, terminal, craft = known.value("free"), known.value("terminal"), known.value("craft")
    for name in free if isinstance(free, list) else ():
        if known.value("meet") == Meeting.INTERCEPT.value and str(name).startswith("v"):
            yield Problem(("free",), f"lists {name}, but the velocities of an intercept are always free", "remove it")
        if isinstance(terminal, dict) and TERMINAL.get(str(name)) in terminal:
            where = ("terminal", TERMINAL[str(name)])
            yield Problem(where, f"fixes {name}, which free = [...] lists as free", "remove one of the two")
    count = len(craft) if isinstance(craft, list) else 0
    yield from duplicate_names(known, "craft", count)
    weights = [known.value("craft", str(index), "weight") for index in range(count)]
    if count and all(isinstance(weight, int | Decimal) and weight == 0 for weight in weights):
        yield Problem(("craft", "0", "weight"), "is zero, and so are all others", "give one craft a positive weight")
    yield from rate_problems(known.number("orbit_rate_rad_s"))
    duration, rate = known.number("duration_s"), known.number("orbit_rate_rad_s")
    if duration is None or duration <= 0:
        return
    yield from angle_problems(("duration_s",), duration, rate)
    for index in range(count):
        path = ("craft", str(index), "start_s")
        start = known.number(*path)
        if start is not None and start >= duration:
            yield Problem(path, f"must be before the meeting at {duration} s, found {start}", "start it earlier")


FORM = problem_form(KIND, ParetoTables, _checks)


@dataclass(frozen=True, eq=False, repr=False)
class ParetoProblem(ReadProblem[ParetoTables]):
    """A problem as read."""

    encounter: Encounter
    greatest_control_m_s2: float | None


def load_pareto(name_or_path: str, settings: Sequence[str] | None = None) -> ParetoProblem:
    """Read a built-in problem by its name or a file by its path, with settings KEY=VALUE in place of its values.

    Raises
    ------
    InputError
        If there is no such problem, or it is not sound.
    """
    tables = load_tables(FORM, name_or_path, settings)
    motion = ClohessyWiltshire(tables.si("orbit_rate_rad_s"))
    craft = tuple(
        Craft(
            table.name,
            np.array(table.si_numbers("position_m", "velocity_m_s")),
            motion,
            table.si("weight"),
            table.si("start_s"),
        )
        for table in tables.craft
    )
    fixed = np.array(tables.terminal.si_numbers(*TERMINAL.values()))
    with input_errors(name_or_path):
        encounter = Encounter(craft, tables.si("duration_s"), tables.free, fixed, tables.meet)
    return ParetoProblem(tables, name_or_path, encounter, tables.si("greatest_control_m_s2"))
