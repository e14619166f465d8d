"""The keys of a scenario file that a sweep varies, each over a range of values in the unit of the file.

A cell is valid exactly when a file with its values is, and has the same error messages.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Sequence
from decimal import Context, Decimal, InvalidOperation
from typing import Literal

from experiments.common.display_units import split_unit
from experiments.common.errors import InputError, input_errors, shown
from experiments.common.input_file import changed, keys_of, numeric_key, similar_key
from sim.scenario import Scenario
from sim.storage import MAX_CELLS, Axis

MAX_AXES = 4
MAX_VALUES = 1000
EXAMPLE = "--vary angle_sensor.scale=1:8:8,thruster.max_impulse_m_s=2.5:20:8"

_PLACES = Context(prec=12)
"""Values between the ends are rounded to 12 digits."""


def sweep_axes(text: str, scenario: Scenario) -> tuple[Axis, ...]:
    """Read the value of --vary: `table.key=FROM:TO:COUNT` or `table.key=log:FROM:TO:COUNT`, separated by commas.

    Of a key that is an interval, `table.key.min` or `table.key.max` is varied. `one.key=other.key=FROM:TO:COUNT` gives
    both keys the same values. `sensor.scale` is a factor of all error bounds of a sensor. Raise `InputError` if the
    text has another form, or scenarios have no such key; the message suggests the most similar key.
    """
    pieces = [piece.strip() for piece in text.split(",")]
    if len(pieces) > MAX_AXES:
        raise InputError(f"--vary: at most {MAX_AXES} keys can be varied at once, found {len(pieces)}; leave some out")
    axes = tuple(_axis(piece, scenario) for piece in pieces)
    bounds = _error_bounds(scenario)
    varied = [(key, tied) for axis in axes for tied in tied_keys(axis.key) for key in bounds.get(tied, {tied: 0.0})]
    for key, _ in varied:
        names = [tied for other, tied in varied if other == key]
        if len(names) > 1:
            problem = "is named twice" if len(set(names)) == 1 else "vary the same value"
            raise InputError(f"--vary: {' and '.join(dict.fromkeys(names))} {problem}; name each key once")
    cells = math.prod(len(axis.values) for axis in axes)
    if cells > MAX_CELLS:
        raise InputError(f"--vary: {cells} cells are more than the limit of {MAX_CELLS}; give fewer values")
    return axes


def sweep_cells(scenario: Scenario, axes: Sequence[Axis]) -> tuple[Scenario, ...]:
    """Return the scenario of each combination of the axes' values; the last axis varies fastest.

    Raise `InputError`, with the message of a scenario file, if a cell is not a valid scenario.
    """
    bounds = _error_bounds(scenario)
    cells = []
    for values in itertools.product(*(axis.values for axis in axes)):
        changes: dict[str, float] = {}
        for axis, value in zip(axes, values, strict=True):
            for key in tied_keys(axis.key):
                scaled = {name: value * bound for name, bound in bounds.get(key, {}).items()}
                changes |= {name: float(f"{number:.12g}") for name, number in scaled.items()} or {key: value}
        changes = {key: round(value) if numeric_key(Scenario, key) is int else value for key, value in changes.items()}
        text = ", ".join(f"{key} = {value:.12g}" for key, value in changes.items())
        cells.append(changed(scenario, changes, f"{scenario.name} with {text}"))
    return tuple(cells)


def _error_bounds(scenario: Scenario) -> dict[str, dict[str, float]]:
    """Return the error bounds of each sensor by key, under the name of their common factor: `angle_sensor.scale`."""
    sensors = {f"{name}_sensor": sensor for name, sensor in scenario.sensors.items()}
    return {
        f"{table}.{SCALE}": {
            f"{table}.{name}": value
            for name, value in vars(sensor).items()
            if "error" in name and value
            if isinstance(value, float)
        }
        for table, sensor in sensors.items()
    }


def _axis(piece: str, scenario: Scenario) -> Axis:
    *keys, written = (part.strip() for part in piece.split("="))
    key = "=".join(keys)
    if not key:
        raise InputError(f"--vary: {shown(piece)} is not written as KEY=FROM:TO:COUNT; for example {EXAMPLE}")
    for single in keys:
        if single not in _error_bounds(scenario) and numeric_key(Scenario, single) is None:
            known = [*keys_of(Scenario), *_error_bounds(scenario)]
            guess = similar_key(single, [key for key in known if key != single])
            remedy = f"; did you mean {guess}?" if guess else ""
            raise InputError(f"--vary: a scenario has no numeric key {shown(single)}{remedy}")
    if len({unit_of(single) for single in keys}) > 1:
        units = ", ".join(f"{single} in {unit_of(single) or 'no unit'}" for single in keys)
        raise InputError(f"--vary: keys with the same values must have the same unit, found {units}")
    whole = any(numeric_key(Scenario, single) is int for single in keys)
    parts = [part.strip() for part in written.split(":")]
    scale: Literal["linear", "log"] = "linear"
    if parts[0] == "log":
        scale, parts = "log", parts[1:]
    if len(parts) != 3:
        raise InputError(
            f"--vary: {key}: must be FROM:TO:COUNT or log:FROM:TO:COUNT, found {shown(written)}; for example {EXAMPLE}"
        )
    first, last = (_number(part, key) for part in parts[:2])
    if first >= last:
        raise InputError(f"--vary: {key}: must go from a smaller to a greater value, found {shown(written)}")
    if first <= 0 and any(single.endswith(f".{SCALE}") for single in keys):
        raise InputError(f"--vary: {key} must be greater than 0, found {shown(written)}")
    if scale == "log" and first <= 0:
        raise InputError(f"--vary: {key}: on a logarithmic scale values must be greater than 0, found {shown(written)}")
    if not re.fullmatch(r"[0-9]{1,9}", parts[2]) or not 2 <= int(parts[2]) <= MAX_VALUES:
        problem = f"the count must be a whole number from 2 to {MAX_VALUES}, found {shown(parts[2])}"
        raise InputError(f"--vary: {key}: {problem}")
    count = int(parts[2])
    values = _spaced(first, last, count, scale, whole=whole)
    if len(set(values)) < count:
        raise InputError(
            f"--vary: {key}: {count} values from {parts[0]} to {parts[1]} are not all different"
            f"{' whole numbers' if whole else ''}; give fewer values"
        )
    with input_errors("--vary"):
        return Axis(key, values, scale)


def _number(text: str, key: str) -> Decimal:
    try:
        value = Decimal(text) if re.fullmatch(r"[+-]?[0-9.]{1,40}(?:[eE][+-]?[0-9]{1,4})?", text) else None
    except InvalidOperation:
        value = None
    if value is None:
        raise InputError(f"--vary: {key}: must be a number, found {shown(text)}; for example {EXAMPLE}")
    return value


def _spaced(first: Decimal, last: Decimal, count: int, scale: str, *, whole: bool) -> tuple[float, ...]:
    """Return evenly spaced values; the first and the last are not rounded."""
    if scale == "log":
        rise = math.log(last / first) / (count - 1)
        between = [Decimal(float(first) * math.exp(rise * index)) for index in range(1, count - 1)]
    else:
        between = [first + (last - first) * index / (count - 1) for index in range(1, count - 1)]
    values = [first, *(_PLACES.plus(value) for value in between), last]
    return tuple(float(round(value)) if whole else float(value) for value in values)


SCALE = "scale"
"""Name, after the table of a sensor, of the factor of its error bounds."""

_BEFORE_ARRIVAL = ("first_image_s", "last_image_s", "last_impulse_s")
"""Times that count from the nominal arrival back."""


def tied_keys(key: str) -> list[str]:
    """Return the keys of an axis: several if they have the same values, `a.one_m=b.two_m`."""
    return key.split("=")


def unit_of(key: str) -> str:
    """Return the unit in the name of a key; empty if it has none."""
    return split_unit(_parts(tied_keys(key)[0])[1])[1]


def key_label(key: str) -> str:
    """Return a key as the label of an axis: `angle sensor: error at nominal range, rad`."""
    tables = [_parts(single)[0] for single in tied_keys(key)]
    names = [_words(single) for single in tied_keys(key)]
    if len(set(tables)) == 1:
        tables, names = tables[:1], [" = ".join(names)]
    label = " = ".join(f"{table}: {name}" if table else name for table, name in zip(tables, names, strict=True))
    unit = unit_of(key)
    label = label.replace("_", " ")
    return f"{label}, {unit}" if unit else label


def _words(key: str) -> str:
    _, name, end = _parts(key)
    if name == SCALE:
        return "factor of the error bounds"
    return f"{split_unit(name)[0]} {'before arrival' if name in _BEFORE_ARRIVAL else end}".strip()


def _parts(key: str) -> tuple[str, str, str]:
    """Return the table, the name, and the end of a pair or an empty text."""
    *tables, name = key.removesuffix(".min").removesuffix(".max").split(".")
    return " ".join(tables), name, {".min": "minimum", ".max": "maximum"}.get(key[-4:], "")
