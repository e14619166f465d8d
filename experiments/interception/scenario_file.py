"""Scenario files: TOML as a person writes it, in kilometres and degrees, to and from `sim.scenario.Scenario` in SI.

A number is read as the decimal that stands in the file and rounded once, after the change of unit. So every SI value
can be written (its own shortest decimal with the point moved), and comes back as it was, bit for bit.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import fields
from enum import Enum
from typing import Any

from experiments.common.errors import InputError
from experiments.common.toml_file import (
    Form,
    built_in_names,
    built_in_text,
    keys_of,
    load_tables,
    read_tables,
    tables_of,
)
from experiments.common.toml_values import (
    KILO,
    DecimalPair,
    Table,
    degrees_text,
    number_text,
    quoted_text,
    radians,
    shown,
    si,
)
from experiments.interception.scenario_checks import cross_problems
from experiments.interception.scenario_tables import (
    OPTIONAL_SENSORS,
    SCHEMA,
    DispersionTable,
    ScenarioTables,
    UncertaintyTable,
)
from guidance.thruster import Thruster
from infoset.model import InitialSet, Interval, Model, SetModel, StateBox
from infoset.sensors import AngleSensor
from sim.scenario import Scenario, Sun, Target
from sim.storage.codec import scenario_hash as scenario_hash  # noqa: PLC0414 (users import it from here)

DEFAULT_FEWEST_SECTIONS = 5
SMALL_ANGLE_RAD = 0.01
"""Greatest line-of-sight angle at which the model `paper`, which takes angles for their tangents, is good."""

FORM = Form(
    noun="scenario",
    folder="scenarios",
    listed_by="infoset scenarios list",
    begun_by="infoset scenarios new FILE",
    tables=ScenarioTables,
    checks=cross_problems,
    schema=SCHEMA,
)

_POWERS = {"_km3_s2": 3 * KILO, "_km_s": KILO, "_km": KILO}
"""Powers of ten of the units in the keys of a file that are not SI units."""
_WHOLE = ("schema", "sections", "fewest_sections")
UNUSUAL_TABLES = (*(table for table in OPTIONAL_SENSORS if table != "range_sensor"), "target")
"""Tables that the template shows but leaves out."""


def scenario_names() -> tuple[str, ...]:
    """Return the names of the built-in scenarios, in alphabetical order."""
    return built_in_names(FORM)


def scenario_text(name: str) -> str:
    """Return the file of a built-in scenario, comments and all.

    Parameters
    ----------
    name : str
        One of `scenario_names()`.

    Returns
    -------
    str
        TOML.

    Raises
    ------
    InputError
        If there is no such scenario.
    """
    return built_in_text(FORM, name)


def load_scenario(name_or_path: str | os.PathLike[str]) -> Scenario:
    """Read a built-in scenario or a scenario file.

    Parameters
    ----------
    name_or_path : str or path
        A built-in name, or the path of a TOML file. A name wins over a file of that name, unless the argument has a
        path separator or ends in ``.toml``.

    Returns
    -------
    Scenario
        In SI units, each number rounded once.

    Raises
    ------
    InputError
        If there is no such scenario or file, or the file is not a sound scenario; all its problems are named.
    """
    return _to_scenario(load_tables(FORM, name_or_path), str(name_or_path))


def read_scenario(text: str, source: str) -> Scenario:
    """Turn the text of a scenario file into a scenario.

    Parameters
    ----------
    text : str
        TOML with exactly the tables and keys of a scenario.
    source : str
        What to call the text in messages: the file's name.

    Returns
    -------
    Scenario
        In SI units, each number rounded once.

    Raises
    ------
    InputError
        With every problem of the text: where it is, the value found and the remedy.
    """
    return _to_scenario(read_tables(FORM, text, source), source)


def scenario_warnings(scenario: Scenario) -> list[str]:
    """Say what is allowed in a scenario but probably not meant.

    Parameters
    ----------
    scenario : Scenario
        A sound scenario.

    Returns
    -------
    list of str
        One line each: which key, and by how much.
    """
    lines = []
    uncertainty, dispersion = scenario.set_model.bounds, scenario.dispersion
    for key, unit in (("z", "km"), ("x", "km"), ("vz", "km/s"), ("vx", "km/s")):
        field = f"{key}_m" if unit == "km" else f"{key}_m_s"
        name = f"{key}_km" if unit == "km" else f"{key}_km_s"
        known: Interval = getattr(uncertainty, field)
        true: Interval = getattr(dispersion, field)
        for excess, side in ((known[0] - true[0], "below"), (true[1] - known[1], "above")):
            if excess > 0:
                lines.append(
                    f"dispersion.{name} reaches {excess / 1000:.6g} {unit} {side} uncertainty.{name}: "
                    "the truth may start outside what is known on board, and the set may lose it"
                )
    speed = scenario.set_model.closing_speed_m_s
    least, greatest = -uncertainty.vx_m_s[1], -uncertainty.vx_m_s[0]
    outside = max(least - speed, speed - greatest)
    if outside > 0:
        lines.append(
            f"nominal.closing_speed_km_s is {outside / 1000:.6g} km/s outside uncertainty.vx_km_s: "
            "the on-board model believes in a speed known to be wrong"
        )
    thruster = scenario.thruster
    target, model = scenario.target, scenario.set_model
    steepest = max(
        max(abs(end) for box in (uncertainty, dispersion) for end in box.z_m)
        / min(uncertainty.x_m[0], dispersion.x_m[0]),
        max(abs(end) for box in (uncertainty, dispersion) for end in box.vz_m_s) / speed,
    )
    if steepest > SMALL_ANGLE_RAD and not model.is_guaranteed:
        lines.append(
            f"information_set.model is paper, which takes angles for their tangents, and the line of sight may be "
            f"{steepest:.3g} rad off the x axis: beyond {SMALL_ANGLE_RAD:g} rad the set may lose the truth; "
            "write model = guaranteed"
        )
    if target is not None and model.is_guaranteed and target.acceleration_m_s2 > model.disturbance_m_s2:
        lines.append(
            f"target.acceleration_m_s2, {target.acceleration_m_s2:g}, exceeds information_set.disturbance_m_s2, "
            f"{model.disturbance_m_s2:g}: the guaranteed model does not allow for it and may lose the truth"
        )
    if thruster.budget_m_s < thruster.least_impulse_m_s:
        lines.append(
            f"thruster.budget_m_s, {thruster.budget_m_s:g}, is less than thruster.least_impulse_m_s, "
            f"{thruster.least_impulse_m_s:g}: no impulse can be given"
        )
    return lines


def default_initial_set(model: Model) -> InitialSet:
    """Return the shape of a section at t0 when a scenario does not say: the paper's rectangle, else the box."""
    return {Model.PAPER: InitialSet.RECTANGLE}.get(model, InitialSet.BOX)


def scenario_template() -> str:
    """Return a sound scenario file with a comment on every key, to start one's own from."""
    lines = [
        "# A scenario. Check it with: infoset scenarios check FILE",
        "# Every key carries its unit in its name. z is across the nominal line of approach, x along it, and the",
        "# spacecraft is the origin. A line `# key = value` is optional: the default or an example.",
        "",
    ]
    for name, field in keys_of(ScenarioTables).items():
        if name not in tables_of(ScenarioTables):
            lines += _template_key(name, field)
    for table in tables_of(ScenarioTables):
        field = keys_of(ScenarioTables)[table]
        optional = "" if field.is_required() else " (an optional table)"
        keys = [line for name, key in keys_of(ScenarioTables, (table,)).items() for line in _template_key(name, key)]
        if table in UNUSUAL_TABLES:
            keys = [f"# {line.removeprefix('# ')}" for line in keys]
        lines += ["", f"# {field.description}{optional}", f"# [{table}]" if table in UNUSUAL_TABLES else f"[{table}]"]
        lines += keys
    return "\n".join(lines) + "\n"


def scenario_to_toml(scenario: Scenario) -> str:
    """Write a scenario as a file that reads back as the same scenario, bit for bit.

    Parameters
    ----------
    scenario : Scenario
        In SI units.

    Returns
    -------
    str
        TOML, every key given.

    Raises
    ------
    InputError
        If it holds what no file can: a number that is not finite, or an angle sensor with a nominal range other than
        the scenario's own.
    """
    model, sensor, sun = scenario.set_model, scenario.set_model.angle_sensor, scenario.sun
    if sensor.nominal_range_m != scenario.nominal_range_m:
        raise InputError(
            f"scenario {shown(scenario.name)}: its angle sensor has the nominal range {sensor.nominal_range_m!r} m and "
            f"it has {scenario.nominal_range_m!r} m; a scenario file has one, nominal.range_km"
        )
    tables: dict[str, dict[str, object]] = {
        "": {"schema": SCHEMA, "name": scenario.name, "description": scenario.description}
    }
    if sun is not None:
        tables["sun"] = {
            "gravitational_parameter_km3_s2": sun.gravitational_parameter_m3_s2,
            "distance_km": sun.distance_m,
            "direction_deg": sun.direction_rad,
        }
    tables["nominal"] = {"range_km": scenario.nominal_range_m, "closing_speed_km_s": model.closing_speed_m_s}
    tables["uncertainty"] = {**_box(model.bounds)}
    tables["dispersion"] = {
        key: pair[0] if pair[0] == pair[1] else pair for key, pair in _box(scenario.dispersion).items()
    }
    tables["angle_sensor"] = {key: value for key, value in vars(sensor).items() if key != "nominal_range_m"}
    for table in (*OPTIONAL_SENSORS, "target"):
        if (fitted := getattr(scenario, table)) is not None:
            tables[table] = vars(fitted)
    tables["thruster"] = vars(scenario.thruster)
    tables["guidance"] = {
        "step_s": model.step_s,
        "strategy": scenario.strategy,
        "range_threshold_km": model.range_threshold_m,
    }
    tables["information_set"] = {
        "model": model.kind,
        "initial_set": model.initial_set,
        "sections": int(model.sections),
        "fewest_sections": int(model.fewest_sections),
        "recovery": model.recovery,
        "disturbance_m_s2": model.disturbance_m_s2,
    }
    tables["noise"] = {"kind": scenario.noise, "tie": scenario.tie}
    return "\n".join(_table_lines(tables))


def _value_text(key: str, value: Any) -> str:
    """Write an SI value in the unit that its key names."""
    if isinstance(value, Enum | str):
        return quoted_text(value.value if isinstance(value, Enum) else value)
    if isinstance(value, tuple):
        return f"[{', '.join(_value_text(key, end) for end in value)}]"
    if key.endswith("_deg"):
        return degrees_text(value)
    power = next((power for unit, power in _POWERS.items() if key.endswith(unit)), 0)
    return str(value) if key in _WHOLE else number_text(value, power)


def _interval(pair: DecimalPair) -> Interval:
    return si(pair[0], KILO), si(pair[1], KILO)


def _state_box(table: UncertaintyTable | DispersionTable) -> StateBox:
    return StateBox(
        z_m=_interval(table.z_km),
        x_m=_interval(table.x_km),
        vz_m_s=_interval(table.vz_km_s),
        vx_m_s=_interval(table.vx_km_s),
    )


def _to_scenario(tables: ScenarioTables, source: str) -> Scenario:
    """Change units and compose the dataclasses of the core."""
    try:
        return _composed(tables)
    except ValueError as error:
        # The decimals keep to the limits; two that differ beyond the sixteenth digit are one number in the core.
        raise InputError(
            f"{source}: {error}; numbers are rounded to 16 digits: change it in the first of them"
        ) from None


def _composed(tables: ScenarioTables) -> Scenario:
    information_set, sun, target = tables.information_set, tables.sun, tables.target
    nominal_range_m = si(tables.nominal.range_km, KILO)
    fewest = information_set.fewest_sections
    return Scenario(
        name=tables.name,
        description=tables.description,
        sun=None
        if sun is None
        else Sun(
            gravitational_parameter_m3_s2=si(sun.gravitational_parameter_km3_s2, 3 * KILO),
            distance_m=si(sun.distance_km, KILO),
            direction_rad=radians(sun.direction_deg),
        ),
        nominal_range_m=nominal_range_m,
        dispersion=_state_box(tables.dispersion),
        set_model=SetModel(
            closing_speed_m_s=si(tables.nominal.closing_speed_km_s, KILO),
            step_s=si(tables.guidance.step_s),
            bounds=_state_box(tables.uncertainty),
            angle_sensor=AngleSensor(
                period_s=si(tables.angle_sensor.period_s),
                error_at_nominal_range_rad=si(tables.angle_sensor.error_at_nominal_range_rad),
                error_at_zero_range_rad=si(tables.angle_sensor.error_at_zero_range_rad),
                nominal_range_m=nominal_range_m,
            ),
            disturbance_m_s2=si(information_set.disturbance_m_s2),
            range_threshold_m=si(tables.guidance.range_threshold_km, KILO),
            sections=information_set.sections,
            fewest_sections=min(DEFAULT_FEWEST_SECTIONS, information_set.sections) if fewest is None else fewest,
            initial_set=information_set.initial_set or default_initial_set(information_set.model),
            kind=information_set.model,
            recovery=information_set.recovery,
        ),
        thruster=Thruster(
            budget_m_s=si(tables.thruster.budget_m_s),
            least_impulse_m_s=si(tables.thruster.least_impulse_m_s),
            greatest_impulse_m_s=si(tables.thruster.greatest_impulse_m_s),
            execution_error_relative=si(tables.thruster.execution_error_relative),
        ),
        strategy=tables.guidance.strategy,
        noise=tables.noise.kind,
        tie=tables.noise.tie,
        target=None
        if target is None
        else Target(
            manoeuvre=target.manoeuvre,
            acceleration_m_s2=si(target.acceleration_m_s2),
            switching_period_s=si(target.switching_period_s),
        ),
        **{table: _sensor(kind, getattr(tables, table)) for table, kind in OPTIONAL_SENSORS.items()},
    )


def _sensor(kind: Any, table: Table | None) -> Any:
    """Return a sensor from its table; None without one."""
    return None if table is None else kind(**{field.name: si(getattr(table, field.name)) for field in fields(kind)})


def _box(box: StateBox) -> dict[str, Interval]:
    return {"z_km": box.z_m, "x_km": box.x_m, "vz_km_s": box.vz_m_s, "vx_km_s": box.vx_m_s}


def _table_lines(tables: dict[str, dict[str, object]]) -> Iterator[str]:
    for table, keys in tables.items():
        if table:
            yield f"\n[{table}]"
        yield from (f"{key} = {_value_text(key, value)}" for key, value in keys.items())
    yield ""


def _template_key(name: str, field: Any) -> list[str]:
    line = f"{name} = {field.examples[0]}"
    return [f"{line if field.is_required() else f'# {line}':<44}  # {field.description}"]
