"""Scenario files: TOML as a person writes it, in kilometres and degrees, to and from `sim.scenario.Scenario` in SI.

A number is read as the decimal that stands in the file and rounded once, after the change of unit. So every SI value
can be written (its own shortest decimal with the point moved), and comes back as it was, bit for bit.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import tomllib
from collections.abc import Iterator
from decimal import Context, Decimal, InvalidOperation
from enum import Enum
from importlib import resources
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from experiments._scenario_checks import Known, Problem, cross_problems
from experiments._scenario_tables import (
    SCHEMA,
    TABLES,
    DecimalPair,
    DispersionTable,
    ScenarioTables,
    UncertaintyTable,
    keys_of,
    nearest,
    shown,
)
from experiments.errors import InputError
from guidance.thruster import Thruster
from infoset.model import InitialSet, Interval, Model, SetModel, StateBox
from infoset.sensors import AngleSensor, RangeSensor, RateSensor
from sim.scenario import Scenario, Sun, Target

LARGEST_FILE_BYTES = 1_000_000
LONGEST_LINE = 1000
MOST_PROBLEMS = 100
DEFAULT_FEWEST_SECTIONS = 5

_EXACT = Context(prec=60)
_KILO = 3
_RADIANS_PER_DEGREE = _EXACT.divide(
    Decimal("3.14159265358979323846264338327950288419716939937510582097494459"), Decimal(180)
)

UNUSUAL_TABLES = ("rate_sensor", "target")
"""Tables that the template shows but leaves out."""


def scenario_names() -> tuple[str, ...]:
    """Return the names of the built-in scenarios, in alphabetical order."""
    files = resources.files("experiments").joinpath("scenarios").iterdir()
    return tuple(sorted(file.name.removesuffix(".toml") for file in files if file.name.endswith(".toml")))


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
    if name not in scenario_names():
        raise _no_such_name(name, "no built-in scenario")
    return resources.files("experiments").joinpath("scenarios", f"{name}.toml").read_text(encoding="utf-8")


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
        In SI units.

    Raises
    ------
    InputError
        If there is no such scenario or file, or the file is not a sound scenario; all its problems are named.
    """
    given = os.fspath(name_or_path)
    marks = [mark for mark in (os.sep, os.altsep) if mark]
    is_name = isinstance(name_or_path, str) and not given.endswith(".toml") and not any(mark in given for mark in marks)
    if is_name and given in scenario_names():
        return read_scenario(scenario_text(given), f"{given} (built in)")
    if is_name and not _exists(given):
        raise _no_such_name(given, "no file and no built-in scenario")
    return read_scenario(_text_of_file(given), given)


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
    document = _parse(text, source)
    schema = document.get("schema", SCHEMA)
    if isinstance(schema, bool) or not isinstance(schema, int) or schema != SCHEMA:
        raise InputError(
            f"{source}: schema: must be {SCHEMA}, the only form of file this version reads, found {shown(schema)}; "
            f"write schema = {SCHEMA} and the keys of `infoset scenarios new`, or update infoset"
        )
    tables = None
    problems: list[Problem] = []
    try:
        tables = ScenarioTables.model_validate(document)
    except ValidationError as error:
        problems = [_problem(details) for details in error.errors(include_url=False)[: MOST_PROBLEMS + 1]]
        known = Known(document, frozenset(tuple(str(part) for part in each["loc"]) for each in error.errors()))
    else:
        known = Known(document, frozenset())
    problems += cross_problems(known)
    if tables is None or problems:
        raise InputError(_report(problems, source))
    return _to_scenario(tables)


def scenario_hash(scenario: Scenario) -> str:
    """Return a short fingerprint of every value that can change a result.

    Parameters
    ----------
    scenario : Scenario
        Its name and description do not count.

    Returns
    -------
    str
        16 hexadecimal digits, the same for equal values on every machine.
    """
    values = _canonical(dataclasses.replace(scenario, name="", description=""))
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:16]


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
    for name, field in keys_of(None).items():
        if name not in TABLES:
            lines += _template_key(name, field)
    for table in TABLES:
        field = keys_of(None)[table]
        optional = "" if field.is_required() else " (an optional table)"
        keys = [line for name, key in keys_of(table).items() for line in _template_key(name, key)]
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
    tables: dict[str, dict[str, str]] = {
        "": {
            "schema": str(SCHEMA),
            "name": _quoted(scenario.name),
            "description": _quoted(scenario.description),
        }
    }
    if sun is not None:
        tables["sun"] = {
            "gravitational_parameter_km3_s2": _number(sun.gravitational_parameter_m3_s2, 3 * _KILO),
            "distance_km": _number(sun.distance_m, _KILO),
            "direction_deg": _degrees(sun.direction_rad),
        }
    tables["nominal"] = {
        "range_km": _number(scenario.nominal_range_m, _KILO),
        "closing_speed_km_s": _number(model.closing_speed_m_s, _KILO),
    }
    tables["uncertainty"] = _box(model.bounds, _pair)
    tables["dispersion"] = _box(scenario.dispersion, _pair_or_number)
    tables["angle_sensor"] = {
        "period_s": _number(sensor.period_s),
        "error_at_nominal_range_rad": _number(sensor.error_at_nominal_range_rad),
        "error_at_zero_range_rad": _number(sensor.error_at_zero_range_rad),
    }
    if scenario.range_sensor is not None:
        tables["range_sensor"] = {
            "period_s": _number(scenario.range_sensor.period_s),
            "relative_error": _number(scenario.range_sensor.relative_error),
        }
    if scenario.rate_sensor is not None:
        tables["rate_sensor"] = {
            "period_s": _number(scenario.rate_sensor.period_s),
            "error_rad_s": _number(scenario.rate_sensor.error_rad_s),
        }
    if scenario.target is not None:
        tables["target"] = {
            "manoeuvre": _quoted(scenario.target.manoeuvre.value),
            "acceleration_m_s2": _number(scenario.target.acceleration_m_s2),
            "switching_period_s": _number(scenario.target.switching_period_s),
        }
    tables["thruster"] = {
        "budget_m_s": _number(scenario.thruster.budget_m_s),
        "least_impulse_m_s": _number(scenario.thruster.least_impulse_m_s),
        "greatest_impulse_m_s": _number(scenario.thruster.greatest_impulse_m_s),
        "execution_error_relative": _number(scenario.thruster.execution_error_relative),
    }
    tables["guidance"] = {
        "step_s": _number(model.step_s),
        "strategy": _quoted(scenario.strategy),
        "range_threshold_km": _number(model.range_threshold_m, _KILO),
    }
    tables["information_set"] = {
        "model": _quoted(model.kind.value),
        "initial_set": _quoted(model.initial_set.value),
        "sections": str(int(model.sections)),
        "fewest_sections": str(int(model.fewest_sections)),
        "disturbance_m_s2": _number(model.disturbance_m_s2),
    }
    tables["noise"] = {"kind": _quoted(scenario.noise.value), "tie": _quoted(scenario.tie.value)}
    return "\n".join(_table_lines(tables))


def _no_such_name(name: str, what: str) -> InputError:
    names = scenario_names()
    guess = nearest(name, list(names))
    hint = f'did you mean "{guess}"? ' if guess else ""
    return InputError(f"{what} is called {shown(name)}; {hint}the built-in ones are {', '.join(names)}")


def _exists(path: str) -> bool:
    try:
        return bool(path) and Path(path).exists()
    except (OSError, ValueError):  # a name too long, or with a null in it
        return False


def _text_of_file(path: str) -> str:
    """Read a file a person named."""
    try:
        with Path(path).open("rb") as file:
            content = file.read(LARGEST_FILE_BYTES + 1)
    except FileNotFoundError:
        raise InputError(
            f"{path}: there is no such file; check the path, or see `infoset scenarios list` for the built-in names"
        ) from None
    except IsADirectoryError:
        raise InputError(f"{path}: is a folder; name a scenario file in it") from None
    except PermissionError:
        raise InputError(f"{path}: cannot be read, permission denied; check who may read it") from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise InputError(f"{shown(path)}: cannot be read: {reason}; check the path") from None
    if len(content) > LARGEST_FILE_BYTES:
        raise InputError(
            f"{path}: is over {LARGEST_FILE_BYTES // 1000} kB, far more than a scenario needs; name a scenario file"
        )
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise InputError(f"{path}: is not UTF-8 text (line {line}); save it as UTF-8") from None


def _decimal(literal: str) -> Decimal:
    """Read a TOML float as written."""
    try:
        return Decimal(literal)
    except InvalidOperation:  # an exponent beyond what a Decimal holds: zero or infinity, as for a float
        return Decimal(repr(float(literal)))


def _parse(text: str, source: str) -> dict[str, Any]:
    """Parse TOML, refusing what would take the parser too long."""
    if len(text) > LARGEST_FILE_BYTES:
        raise InputError(f"{source}: is over {LARGEST_FILE_BYTES // 1000} kB, far more than a scenario needs")
    lines = text.split("\n")
    for number, line in enumerate(lines, start=1):
        if len(line) > LONGEST_LINE:  # the parser's time grows as the square of a dotted key's length
            raise InputError(f"{source}: line {number} is over {LONGEST_LINE} characters; no line of a scenario is")
    try:
        return tomllib.loads(text, parse_float=_decimal)
    except tomllib.TOMLDecodeError as error:
        column = len(lines[-1]) + 1
        reason = str(error).replace("(at end of document)", f"(at line {len(lines)}, column {column}: the end)")
        raise InputError(f"{source}: is not TOML: {reason}; correct that line") from None
    except (RecursionError, ValueError) as error:
        reason = "it is nested too deeply" if isinstance(error, RecursionError) else str(error)
        raise InputError(f"{source}: is not a scenario: {reason}; start from `infoset scenarios new FILE`") from None


def _report(problems: list[Problem], source: str) -> str:
    """Put all problems of a file into one message, in the order of the tables."""
    order = [*keys_of(None)]
    problems = sorted(problems, key=lambda each: order.index(each.path[0]) if each.path[0] in order else len(order))
    lines = [f"{source}: {_path(each.path)}: {each.text}; {each.remedy}" for each in problems[:MOST_PROBLEMS]]
    if len(problems) > MOST_PROBLEMS:
        lines.append(f"{source}: and more problems; correct these first")
    if len(lines) == 1:
        return lines[0]
    return "\n  ".join([f"{source} has {len(lines)} problems:", *lines])


def _path(path: tuple[str, ...]) -> str:
    return ".".join(part if part.replace("_", "").replace("-", "").isalnum() else shown(part) for part in path)


def _problem(details: Any) -> Problem:
    """Say in our words what pydantic found."""
    path = tuple(str(part) for part in details["loc"])
    if details["type"] == "missing":
        return Problem(path, "is missing", _remedy_of_missing(path))
    if details["type"] == "extra_forbidden":
        return Problem(path, *_unknown(path, details["input"]))
    found = shown(details["input"])
    if details["type"] == "scenario":
        context = details["ctx"]
        return Problem(path, f"{context['problem']}, found {found}", context["remedy"] or f"write {_example(path)}")
    return Problem(
        path, f"must be a table, found {found}", f"write [{path[0]}] on a line of its own, its keys below it"
    )


def _example(path: tuple[str, ...]) -> str:
    field = keys_of(path[0] if len(path) > 1 else None)[path[-1]]
    return f"for example {path[-1]} = {field.examples[0]}"


def _remedy_of_missing(path: tuple[str, ...]) -> str:
    if len(path) > 1:
        return f"add it under [{path[0]}], {_example(path)}"
    if path[0] in TABLES:
        return f"add the table [{path[0]}] with its keys {', '.join(keys_of(path[0]))}"
    return f"add it above the first table, {_example(path)}"


def _unknown(path: tuple[str, ...], value: object) -> tuple[str, str]:
    """Say what to do about a key or a table that a scenario does not have."""
    name, table = path[-1], path[0] if len(path) > 1 else None
    what = "is not a table of a scenario" if isinstance(value, dict) else "is not a key of a scenario"
    homes = [f"[{other}]" for other in TABLES if name in keys_of(other)]
    if table is not None and name in keys_of(None):
        if name in TABLES:
            return f"is not a key of [{table}]", f"write [{name}] as a table of its own"
        return f"is not a key of [{table}]", f"move {name} above the first table"
    if homes and not isinstance(value, dict):
        return f"is not a key of {f'[{table}]' if table else 'the top'}", f"move {name} to {' or '.join(homes)}"
    valid = [*keys_of(table)]
    guess = nearest(name, valid)
    if table is not None:
        what = f"is not a key of [{table}]"
    return what, f"did you mean {guess}?" if guess else f"remove it; valid here: {', '.join(valid)}"


def _si(value: Decimal, power_of_ten: int = 0) -> float:
    """Change the unit of a decimal and round it, once."""
    return float(value.scaleb(power_of_ten, _EXACT))


def _interval(pair: DecimalPair) -> Interval:
    return _si(pair[0], _KILO), _si(pair[1], _KILO)


def _radians(degrees: Decimal) -> float:
    return float(_EXACT.multiply(degrees, _RADIANS_PER_DEGREE))


def _state_box(table: UncertaintyTable | DispersionTable) -> StateBox:
    return StateBox(
        z_m=_interval(table.z_km),
        x_m=_interval(table.x_km),
        vz_m_s=_interval(table.vz_km_s),
        vx_m_s=_interval(table.vx_km_s),
    )


def _to_scenario(tables: ScenarioTables) -> Scenario:
    """Change units and compose the dataclasses of the core."""
    information_set, sun, range_sensor = tables.information_set, tables.sun, tables.range_sensor
    rate_sensor, target = tables.rate_sensor, tables.target
    nominal_range_m = _si(tables.nominal.range_km, _KILO)
    fewest = information_set.fewest_sections
    return Scenario(
        name=tables.name,
        description=tables.description,
        sun=None
        if sun is None
        else Sun(
            gravitational_parameter_m3_s2=_si(sun.gravitational_parameter_km3_s2, 3 * _KILO),
            distance_m=_si(sun.distance_km, _KILO),
            direction_rad=_radians(sun.direction_deg),
        ),
        nominal_range_m=nominal_range_m,
        dispersion=_state_box(tables.dispersion),
        set_model=SetModel(
            closing_speed_m_s=_si(tables.nominal.closing_speed_km_s, _KILO),
            step_s=_si(tables.guidance.step_s),
            bounds=_state_box(tables.uncertainty),
            angle_sensor=AngleSensor(
                period_s=_si(tables.angle_sensor.period_s),
                error_at_nominal_range_rad=_si(tables.angle_sensor.error_at_nominal_range_rad),
                error_at_zero_range_rad=_si(tables.angle_sensor.error_at_zero_range_rad),
                nominal_range_m=nominal_range_m,
            ),
            disturbance_m_s2=_si(information_set.disturbance_m_s2),
            range_threshold_m=_si(tables.guidance.range_threshold_km, _KILO),
            sections=information_set.sections,
            fewest_sections=min(DEFAULT_FEWEST_SECTIONS, information_set.sections) if fewest is None else fewest,
            initial_set=information_set.initial_set or default_initial_set(information_set.model),
            kind=information_set.model,
        ),
        range_sensor=None
        if range_sensor is None
        else RangeSensor(period_s=_si(range_sensor.period_s), relative_error=_si(range_sensor.relative_error)),
        thruster=Thruster(
            budget_m_s=_si(tables.thruster.budget_m_s),
            least_impulse_m_s=_si(tables.thruster.least_impulse_m_s),
            greatest_impulse_m_s=_si(tables.thruster.greatest_impulse_m_s),
            execution_error_relative=_si(tables.thruster.execution_error_relative),
        ),
        strategy=tables.guidance.strategy,
        noise=tables.noise.kind,
        tie=tables.noise.tie,
        rate_sensor=None
        if rate_sensor is None
        else RateSensor(period_s=_si(rate_sensor.period_s), error_rad_s=_si(rate_sensor.error_rad_s)),
        target=None
        if target is None
        else Target(
            manoeuvre=target.manoeuvre,
            acceleration_m_s2=_si(target.acceleration_m_s2),
            switching_period_s=_si(target.switching_period_s),
        ),
    )


def _canonical(value: Any) -> Any:
    """Return a value as JSON that is equal exactly when the values are."""
    if dataclasses.is_dataclass(value):
        return {field.name: _canonical(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, tuple):
        return [_canonical(each) for each in value]
    if value is None or isinstance(value, str):
        return value
    return (float(value) + 0.0).hex()  # adding zero takes the sign off a negative zero


def _toml_float(value: Decimal) -> str:
    """Write a decimal as a TOML float, without an exponent where that is short."""
    value = value.normalize(_EXACT)
    if value and not -6 <= value.adjusted() < 9:
        return f"{value:e}"
    text = f"{value:f}"
    return text if "." in text else f"{text}.0"


def _number(si: float, power_of_ten: int = 0) -> str:
    """Write an SI value as the shortest decimal of a unit 10^power_of_ten times as great."""
    value = Decimal(repr(float(si)))
    if not value.is_finite():
        raise InputError(f"a scenario file holds finite numbers only, not {si}; correct the scenario")
    return _toml_float(value.scaleb(-power_of_ten, _EXACT))


def _degrees(radians: float) -> str:
    """Write an angle as the shortest decimal of degrees that reads back as the same radians."""
    exact = _EXACT.divide(Decimal(_number(radians)), _RADIANS_PER_DEGREE)
    shorter = (Context(prec=digits).plus(exact) for digits in range(1, 20))
    return _toml_float(next((value for value in shorter if repr(_radians(value)) == repr(radians)), exact))


def _pair(interval: Interval) -> str:
    return f"[{_number(interval[0], _KILO)}, {_number(interval[1], _KILO)}]"


def _pair_or_number(interval: Interval) -> str:
    least, greatest = (_number(end, _KILO) for end in interval)
    return least if least == greatest else f"[{least}, {greatest}]"


def _box(box: StateBox, written: Any) -> dict[str, str]:
    return {
        "z_km": written(box.z_m),
        "x_km": written(box.x_m),
        "vz_km_s": written(box.vz_m_s),
        "vx_km_s": written(box.vx_m_s),
    }


def _quoted(text: str) -> str:
    """Write a TOML string on one line."""
    escapes = {"\\": "\\\\", '"': '\\"'}
    return '"' + "".join(escapes.get(c, c if c.isprintable() or c == " " else f"\\U{ord(c):08x}") for c in text) + '"'


def _table_lines(tables: dict[str, dict[str, str]]) -> Iterator[str]:
    for table, keys in tables.items():
        if table:
            yield f"\n[{table}]"
        yield from (f"{key} = {value}" for key, value in keys.items())
    yield ""


def _template_key(name: str, field: Any) -> list[str]:
    line = f"{name} = {field.examples[0]}"
    return [f"{line if field.is_required() else f'# {line}':<44}  # {field.description}"]
