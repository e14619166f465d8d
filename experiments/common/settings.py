"""Values of a file that a command replaces: those of ``--set``, and those of the cells of a sweep.

A value is replaced in the parsed file, before the file is checked. The values are therefore valid exactly when a file
with them is, and have the same error messages.
"""

from __future__ import annotations

import itertools
import re
import tomllib
from collections.abc import Mapping, Sequence
from decimal import Decimal, InvalidOperation
from typing import Any

from experiments.common.errors import InputError, nearest, shown
from experiments.common.toml_values import decimal_of

ENDS = ("least", "greatest")
"""Names of the ends of a pair, after the name of its key."""
LONGEST_SETTING = 1000
_FIRST = "1"
"""Number of the table of an array in the names of its keys."""


def read_settings(settings: Sequence[str]) -> dict[str, str]:
    """Return the values of ``--set KEY=VALUE`` by key, as written.

    `InputError` if a setting has another form, or a key is set twice.
    """
    values: dict[str, str] = {}
    for setting in settings:
        key, mark, text = (part.strip() for part in setting.partition("="))
        if not mark or not key or not text or len(setting) > LONGEST_SETTING:
            raise InputError(
                f"--set: must be KEY=VALUE, found {shown(setting)}; for example --set name=mine, or with the table of "
                "the key, --set TABLE.KEY=5"
            )
        if key in values:
            raise InputError(f"--set: {key} is set twice; set each key once")
        values[key] = text
    return values


def replace_values(
    document: dict[str, Any], values: Mapping[str, str], known: Sequence[str], noun: str, shown_by: str
) -> None:
    """Replace values of a parsed file, or add them.

    Parameters
    ----------
    document : dict
        The parsed file; it is changed.
    values : mapping of str to str
        TOML values by key. A key is written with its table, ``thruster.budget_m_s``; in an array of tables with the
        number of the table, ``craft.2.weight``. ``.least`` and ``.greatest`` after a key are the ends of a pair. Text
        may lack its quotes.
    known : sequence of str
        Keys of such a file; ``craft.1.weight`` stands for all tables of an array.
    noun, shown_by : str
        Name of such a file, and the command that shows its keys, for messages.

    Raises
    ------
    InputError
        If there is no such key, or no such table of an array.
    """
    for key, literal in values.items():
        path, end = key.split("."), None
        if _general(path) not in known:
            end = path.pop()
            if end not in ENDS or _general(path) not in known:
                guess = similar_key(key, known)
                hint = f"did you mean {guess}?" if guess else f"for the keys, see: {shown_by}"
                if key.endswith("_sensor.scale"):
                    hint = "a scale is only for --vary of infoset sweep; set each error bound of the sensor"
                raise InputError(f"--set: a {noun} has no key {shown(key)}; {hint}")
        table = _table(document, path[:-1], key)
        if table is not None:  # a file with a value in place of a table is refused by its checks
            value = _value(literal)
            table[path[-1]] = value if end is None else _with_end(table.get(path[-1]), end, value, key)


def similar_key(key: str, known: Sequence[str]) -> str | None:
    """Return the most similar known key, or up to three keys with the same last part, or None."""
    last = key.rsplit(".", 1)[-1]
    alike = [name for name in known if last in name.split(".")]
    return nearest(key, known) or " or ".join(alike[:3]) or None


def _general(path: Sequence[str]) -> str:
    return ".".join(_FIRST if part.isdecimal() else part for part in path)


def _table(document: dict[str, Any], path: Sequence[str], key: str) -> dict[str, Any] | None:
    """Return a table, which is added if it is missing; None if the file has something else there."""
    table: Any = document
    for part, after in itertools.pairwise((*path, "")):
        if isinstance(table, list) and part.isdecimal():
            if not 1 <= int(part[:6]) <= len(table):
                raise InputError(f"--set: {key}: the file has {len(table)} of these tables; give a number from 1")
            table = table[int(part) - 1]
        elif isinstance(table, dict):
            table = table.setdefault(part, [] if after.isdecimal() else {})
    return table if isinstance(table, dict) else None


def _value(literal: str) -> Any:
    """Return a TOML value; other text is a number with a free form, such as ``.5``, or text without quotes."""
    try:
        parsed = tomllib.loads(f"value = {literal}", parse_float=decimal_of)
    except (ValueError, RecursionError):
        parsed = {}
    if [*parsed] == ["value"]:
        return parsed["value"]
    try:
        return Decimal(literal) if re.fullmatch(r"[+-]?[0-9.]+(?:[eE][+-]?[0-9]+)?", literal) else literal
    except InvalidOperation:
        return literal


def _with_end(pair: object, end: str, value: object, key: str) -> list[object]:
    """Return a pair with a new end; a number is a pair with equal ends."""
    if pair is None:
        raise InputError(f"--set: {key}: the file has no such pair; set both ends, for example --set KEY=[1.0, 2.0]")
    ends = list(pair) if isinstance(pair, list) and len(pair) == len(ENDS) else [pair, pair]
    ends[ENDS.index(end)] = value
    return ends
