"""The keys of a scenario file that a sweep varies, each over a range of values.

The values are in the unit at the end of the key.

A cell is valid exactly when a file with its values is, and has the same error messages.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Sequence

import numpy as np

from infoset.experiments.common.errors import InputError, input_errors, shown
from infoset.experiments.common.input_file import (
    changed,
    field_key,
    keys_of,
    numeric_key,
    similar_key,
)
from infoset.experiments.common.units import split_unit
from infoset.sim.scenario import Scenario
from infoset.sim.storage import MAX_CELLS, Axis

MAX_AXES = 4
"""Maximum number of axes: with ten values each, four axes have `MAX_CELLS` cells."""
MAX_VALUES = 1000
"""Maximum number of values of an axis: more than a figure can show."""
SCALE = "scale"
"""Name, after the table of a sensor, of the factor of its error bounds."""
DRIFT = "drift_rad"
"""Key of an error bound without `error` in its name."""
_ENDS = (".min", ".max")
"""Ends of the names of keys that are an end of an interval."""
# More digits than these are taken for a mistake; chosen.
_NUMBER = r"([+-]?(?:[0-9]{1,20}\.?[0-9]{0,20}|\.[0-9]{1,20})(?:[eE][+-]?[0-9]{1,4})?)"
_RANGE = re.compile(rf"(log:)?\s*{_NUMBER}\s*:\s*{_NUMBER}\s*:\s*([0-9]{{1,9}})")


def sweep_axes(text: str, scenario: Scenario) -> tuple[Axis, ...]:
    """Read the value of --vary: axes, separated by commas.

    An axis is `table.key=FROM:TO:COUNT` or `table.key=log:FROM:TO:COUNT`. Of a key that is an
    interval, `table.key.min` or `table.key.max` is varied. `one.key=other.key=FROM:TO:COUNT` gives
    both keys the same values. `sensor.scale` is a factor of all error bounds of a sensor. Raise
    `InputError` if the text has another form, or scenarios have no such key; the message suggests
    the most similar key.
    """
    pieces = text.split(",")
    if len(pieces) > MAX_AXES:
        raise InputError(
            f"--vary: at most {MAX_AXES} keys can be varied at once, found {len(pieces)}; leave "
            "some out"
        )

    axes = tuple(_axis(piece.strip(), scenario) for piece in pieces)

    # A key may be varied once, also in another unit and by the factor of its sensor; an interval
    # not also by an end.
    bounds = _error_bounds(scenario)
    # Of each value, the keys of --vary by which it is varied. A value is named by both ends of its
    # key, so that an interval has a name in common with each of its ends.
    varied: dict[str, list[str]] = {}
    for axis in axes:
        for tied in tied_keys(axis.key):
            # The numbers of both mappings are not used, only their keys.
            for key in bounds.get(tied, {field_key(Scenario, tied): 0.0}):
                ends = [key] if key.endswith(_ENDS) else [key + end for end in _ENDS]
                for end in ends:
                    varied.setdefault(end, []).append(tied)

    for names in varied.values():
        if len(names) > 1:
            raise InputError(
                f"--vary: {' and '.join(names)} vary the same value; name each key once"
            )

    cells = math.prod(len(axis.values) for axis in axes)
    if cells > MAX_CELLS:
        raise InputError(
            f"--vary: {cells} cells are more than the limit of {MAX_CELLS}; give fewer values"
        )
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
                if bounds.get(key):
                    for name, bound in bounds[key].items():
                        # 12 digits as values of an axis, without the rounding of the product.
                        changes[name] = float(f"{value * bound:.12g}")
                else:
                    changes[key] = value
        # Values of keys for whole numbers are whole already; the file needs them as integers.
        for key, value in changes.items():
            if numeric_key(Scenario, key) is int:
                changes[key] = round(value)
        text = ", ".join(f"{key} = {value:.12g}" for key, value in changes.items())
        cells.append(changed(scenario, changes, f"{scenario.name} with {text}"))

    return tuple(cells)


def _error_bounds(scenario: Scenario) -> dict[str, dict[str, float]]:
    """Return the error bounds of each sensor by key, under the name of their common factor.

    The name is for example `angle_sensor.scale`. Bounds that are zero, which a factor does not
    change, are left out.
    """
    factors: dict[str, dict[str, float]] = {}
    for sensor in scenario.sensors.values():
        factors[f"{sensor.table}.{SCALE}"] = {
            f"{sensor.table}.{name}": value
            for name, value in vars(sensor).items()
            if ("error" in name or name == DRIFT) and value and isinstance(value, float)
        }
    return factors


def _axis(piece: str, scenario: Scenario) -> Axis:
    """Read one axis of --vary."""
    *keys, written = (part.strip() for part in piece.split("="))
    factors = _error_bounds(scenario)
    _check_keys(keys, [*factors])
    match = _RANGE.fullmatch(written)
    if not keys or match is None:
        raise InputError(
            f"--vary: {shown(piece)} is not written as KEY=FROM:TO:COUNT or KEY=log:FROM:TO:COUNT; "
            "for example --vary angle_sensor.scale=1:8:8,thruster.max_impulse_m_s=2.5:20:8"
        )

    is_log = bool(match[1])
    first = float(match[2])
    last = float(match[3])
    count = int(match[4])
    if not 0.0 < last - first < math.inf or not 2 <= count <= MAX_VALUES:
        raise InputError(
            f"--vary: {keys[0]}: must go from a smaller to a greater value, with a count from 2 to "
            f"{MAX_VALUES}, found {shown(written)}"
        )
    if first <= 0 and (is_log or any(key in factors for key in keys)):
        raise InputError(
            f"--vary: {keys[0]}: factors and logarithmic values must be greater than 0, found "
            f"{match[2]}"
        )

    # The ends are exactly as written; the values between them have 12 digits. For a key of whole
    # numbers all values are rounded, also the ends.
    spaced = np.geomspace if is_log else np.linspace
    between = spaced(first, last, count)[1:-1]
    values = [first, *(float(f"{value:.12g}") for value in between), last]
    if any(numeric_key(Scenario, key) is int for key in keys):
        values = [float(round(value)) for value in values]
    if len(set(values)) < count:
        raise InputError(
            f"--vary: {keys[0]}: {count} values in {shown(written)} are not all different; give "
            "fewer"
        )

    with input_errors("--vary"):
        return Axis("=".join(keys), tuple(values), "log" if is_log else "linear")


def _check_keys(keys: Sequence[str], factors: Sequence[str]) -> None:
    """Raise `InputError` unless keys are numeric keys or factors, all in the same unit."""
    for key in keys:
        if key not in factors and numeric_key(Scenario, key) is None:
            known = [known for known in [*keys_of(Scenario), *factors] if known != key]
            message = f"--vary: a scenario has no numeric key {shown(key)}"
            if guess := similar_key(key, known):
                message += f"; did you mean {guess}?"
            raise InputError(message)

    if len({unit_of(key) for key in keys}) > 1:
        units = ", ".join(f"{key} in {unit_of(key) or 'no unit'}" for key in keys)
        raise InputError(
            f"--vary: keys with the same values must have the same unit, found {units}"
        )


def tied_keys(key: str) -> list[str]:
    """Return the keys of an axis: several if they have the same values, `a.one_m=b.two_m`."""
    return key.split("=")


def unit_of(key: str) -> str:
    """Return the unit in the name of a key; empty if it has none."""
    return split_unit(key.removesuffix(".min").removesuffix(".max"))[1]


def key_label(key: str, factor: str = "") -> str:
    """Return a key as the label of an axis, with a factor of its unit.

    For example ``angle sensor: error at nominal range, rad``.
    """
    names = []
    for single in tied_keys(key):
        end = ""
        if single.endswith(_ENDS):
            end = single[-4:]  # both ends have four letters
        name = split_unit(single.removesuffix(end))[0] + end.replace(".", " ")
        names.append(name.replace(f".{SCALE}", ".factor of the error bounds").replace(".", ": "))

    label = " = ".join(names)
    unit = f"{factor}{unit_of(tied_keys(key)[0])}".strip()
    if unit:
        label += f", {unit}"
    return label
