"""Files of the user: the tables and keys of a TOML file are the fields of a frozen dataclass.

Every kind of file is read here. A key may be written in any unit of its quantity (`units.py`), a
number is rounded once, and an interval may be written as one number, which is both of its ends. The
dataclass declares types, limits and defaults; pydantic walks through it and finds all errors at
once.
"""

from __future__ import annotations

import json
import os
import re
import tomllib
import types
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from decimal import Context, Decimal, InvalidOperation
from enum import Enum
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import (
    Annotated,
    Any,
    NamedTuple,
    TypeVar,
    Union,
    cast,
    get_args,
    get_origin,
    get_type_hints,
)

from pydantic import ValidationError

from infoset.experiments.common.built_in_files import (
    PROBLEMS,
    SCENARIO,
    built_in,
    built_in_names,
    kind_of,
    taken_by,
)
from infoset.experiments.common.errors import InputError, nearest, shown
from infoset.experiments.common.units import quantity_and_unit, si_factor, units_like
from infoset.limits import LONGEST_DESCRIPTION, MAXIMUM, plain_number
from infoset.sim.storage.codec import adapter

ENDS = ("min", "max")
"""Ends of an interval, after the name of its key."""
KeyPath = tuple[str, ...]
Kind = TypeVar("Kind")

_UNTRAPPED = Context(prec=60, traps=[])
"""Arithmetic of the products of a number and the factor of its unit.

Products beyond the range of decimal numbers are infinite, which is refused as any infinite value. A
factor has at most 28 digits (`si_factor`), so that with 60 digits the product with a number of 32
digits is exact; it is rounded once, to a float.
"""
_MAX_FAULTS = 50
"""Maximum number of faults in a message: two screens."""
MAX_FILE_BYTES = 100_000
"""Size of the largest TOML file that is read: ten times the largest built-in file; chosen."""
MAX_KEY_PARTS = 20
"""Maximum number of parts of a dotted key of a TOML file; the longest key of our files has three.

The time of the parser grows as the square of this number: for a file of `MAX_FILE_BYTES` with parts
of one letter it is 0.3 s with 20 parts, 1 s with 100, and 11 s with half of the file in one key."""
_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
"""Numbers on the command line: also those without a digit on one side of the point."""
_TOKENS = re.compile(
    r"""(?P<dot>\.)|(?P<blank>[ \t]++)|(?P<comment>\#[^\n]*+)"""
    r'''|(?P<part>"""(?:[^"\\]|\\.|"(?!""))*+(?:"{3,5})?|"(?:[^"\\\n]|\\.)*+"?|[A-Za-z0-9_-]++'''
    r"""|'''(?:[^']|'(?!''))*+(?:'{3,5})?|'[^'\n]*+'?)"""
    r"|(?P<other>.)",
    re.DOTALL,
)
"""Tokens of TOML: strings and bare words (`part`), which are the parts of keys, and what stands
between them. No token is read twice, so the time is proportional to the length of the text."""


class KeyField(NamedTuple):
    """The kind of value of a key: a table, many tables, an interval, or anything else.

    `table` is the dataclass of a table, and `many` says whether there is an array of them. `pair`
    is an interval. `numeric` is the type of a number.
    """

    table: type | None
    many: bool
    pair: bool
    numeric: type | None


def read_file(
    owner: type[Kind], name_or_path: str | os.PathLike[str], settings: Sequence[str] | None = None
) -> Kind:
    """Read a built-in file or a file of the user as a dataclass.

    Parameters
    ----------
    owner : type
        The dataclass; its class variable ``kind``, if any, is the ``kind`` of such files.
    name_or_path : str or path
        A built-in name wins over a file of that name, unless the argument is a `Path`, has a path
        separator or ends in ``.toml``.
    settings : sequence of str or None
        KEY=VALUE: values that replace values of the file, for example
        ``thruster.budget_m_s=500``. A key of an array of tables has the number of its table,
        ``craft.2.weight``; ``.min`` and ``.max`` are the ends of an interval. The value is in the
        unit at the end of KEY. The settings are appended to the description of the result.

    Raises
    ------
    InputError
        If there is no such file, or it is invalid; the message has a line for each error.
    """
    text, source = source_of(name_or_path, [kind_name(owner)])
    made: Any = read_text(owner, text, source, settings)
    if settings:
        lines = [line for line in (made.description, f"with {', '.join(settings)}") if line]
        made = replace(made, description="; ".join(lines)[:LONGEST_DESCRIPTION])
    return made  # type: ignore[no-any-return]  # the type of the result is `owner`


def load_problem(
    name_or_path: str | os.PathLike[str], settings: Sequence[str] | None = None
) -> Any:
    """Read a built-in problem or a file of a problem, of any kind in `PROBLEMS`.

    `settings` are as in `read_file`. Return the dataclass of its kind. `InputError` as `read_file`,
    also for a scenario and for a file without a known kind.
    """
    text, source = source_of(name_or_path, PROBLEMS)
    kind = kind_of(parse(text, source))
    if kind is None:
        raise InputError(
            f"{source}: kind: must be one of {', '.join(PROBLEMS)}; write it above the first table"
        )
    if kind == SCENARIO:
        raise InputError(f"{source}: {taken_by(kind)}")

    owner: type = getattr(
        import_module(f"infoset.experiments.{PROBLEMS[kind].module}"), PROBLEMS[kind].owner
    )
    return read_file(owner, name_or_path, settings)


def read_text(
    owner: type[Kind], text: str, source: str, settings: Sequence[str] | None = None
) -> Kind:
    """Return the dataclass of the text of a file, as `read_file`; messages name `source`.

    The settings do not change the description.
    """
    document = parse(text, source)
    wanted = kind_name(owner)
    kind = kind_of(document)
    if kind is not None and kind != wanted:
        raise InputError(f"{source}: {taken_by(kind)}")
    if wanted != SCENARIO and document.pop("kind", None) != wanted:
        raise InputError(f'{source}: kind: must be "{wanted}"; write it above the first table')

    reading = _Reading(owner, source)
    values = reading.in_si(document, owner, ())
    for setting in settings or ():
        reading.set(values, setting)
    return reading.made(values)  # type: ignore[no-any-return]  # pydantic returns Any


def source_of(name_or_path: str | os.PathLike[str], kinds: Collection[str]) -> tuple[str, str]:
    """Return the text of a file, and its name for messages.

    The file is a built-in one of these kinds, or a file of the user.
    """
    given = os.fspath(name_or_path)
    is_name = (
        isinstance(name_or_path, str) and not given.endswith(".toml") and Path(given).name == given
    )
    if is_name and (given in built_in_names(kinds) or not os.path.lexists(given)):
        return built_in(given, kinds).text, f"{given} (built in)"
    try:
        return read_input(Path(given), MAX_FILE_BYTES).decode("utf-8-sig"), given
    except UnicodeDecodeError:
        raise InputError(f"{given}: is not text in UTF-8; save it as UTF-8") from None


def read_input(file: Path, max_bytes: int) -> bytes:
    """Return the content of a file of the user.

    Raise `InputError` if it has more than `max_bytes`, or cannot be read.
    """
    try:
        with file.open("rb") as stream:
            content = stream.read(max_bytes + 1)
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror}") from None
    if len(content) > max_bytes:
        raise InputError(f"{file}: has more than {max_bytes} bytes")
    return content


def kind_name(owner: type) -> str:
    """Return the kind of the files of a dataclass."""
    return str(getattr(owner, "kind", SCENARIO))


class _Reading:
    """A file that is being read: its faults, and its keys and values as written.

    `_faults` are the faults, and `_written` the keys and values as they are in the file, both by
    path. A path has the names of the fields, whose units are SI. `_guessed` are the paths of the
    fields that were probably meant by unknown keys: they are not reported as missing.
    """

    def __init__(self, owner: type, source: str) -> None:
        self._owner = owner
        self._source = source
        self._faults: dict[KeyPath, str] = {}
        self._written: dict[KeyPath, tuple[str, object]] = {}
        self._guessed: set[KeyPath] = set()

    def in_si(self, table: Mapping[str, Any], owner: type, path: KeyPath) -> dict[str, Any]:
        """Return a table by the names of the fields, numbers in SI; find unknown keys."""
        known = fields_of(owner)
        values = dict[str, Any]()
        for key, value in table.items():
            name = next((name for name in known if si_factor(key, name) is not None), None)
            if name is None:
                self._unknown((*path, key), value, known)
                continue
            here = (*path, name)
            if name in values:
                self._faults[here] = f"is written again, as {key}"
                continue
            self._written[here] = key, value
            # It is not None, because the field was found by it.
            factor = si_factor(key, name) or Decimal(1)
            values[name] = self._value_in_si(value, known[name], here, factor)

        return values

    def _value_in_si(self, value: Any, field: KeyField, path: KeyPath, factor: Decimal) -> Any:
        """Return the value of a key with numbers in SI; a number for an interval is both ends."""
        if field.table is not None and isinstance(value, dict):
            return self.in_si(value, field.table, path)
        if field.table is not None and isinstance(value, list):
            tables = [*value]
            for index, each in enumerate(value):
                if isinstance(each, dict):
                    tables[index] = self.in_si(each, field.table, (*path, str(index)))
            return tables

        scaled = _scaled(value, factor)
        is_number = isinstance(scaled, float | int) and not isinstance(value, bool)
        if field.pair and is_number:
            return [scaled, scaled]
        return scaled

    def _unknown(self, path: KeyPath, value: object, known: Mapping[str, KeyField]) -> None:
        """Note a key that no field has, with the key that was probably meant.

        That is, in this order: the same quantity with a known unit, the nearest key of its table, a
        similar key of another table. If it is in its table, its field is not reported as missing.
        A table that is like no other is noted with all tables that are possible there.
        One fault more than `_MAX_FAULTS` is kept: `made` then says that there are more.
        """
        if len(self._faults) > _MAX_FAULTS:
            return
        with_unit = _with_wrong_unit(path[-1], known)
        if with_unit is not None:
            self._guessed.add((*path[:-1], with_unit))
            self._faults[path] = f"is not a known key; {_units_text(with_unit)}"
            return

        quantity, unit = quantity_and_unit(path[-1])
        by_quantity = {quantity_and_unit(name)[0]: name for name in known}
        near = by_quantity.get(nearest(quantity, [*by_quantity]) or "")
        guess = similar_key(path[-1], keys_of(self._owner))

        if near is not None:
            self._guessed.add((*path[:-1], near))
            guess = near
            # The unit as written, if it fits.
            in_unit = f"{quantity_and_unit(near)[0]}_{unit}"
            if si_factor(in_unit, near) is not None:
                guess = in_unit

        fault = "is not a known key"
        tables = [name for name, field in known.items() if field.table is not None]
        if guess:
            fault += f"; did you mean {guess}?"
        elif tables and _is_table(value):
            fault += f"; the tables are {', '.join(tables)}"
        self._faults[path] = fault

    def set(self, values: dict[str, Any], setting: str) -> None:
        """Replace a value by the value of KEY=VALUE."""
        key, mark, literal = (part.strip() for part in setting.partition("="))
        if not mark or not key or not literal:
            raise InputError(
                f"--set: must be KEY=VALUE, found {shown(setting)}; for example --set name=mine"
            )

        found = _found(values, self._owner, key)
        if found is None:
            raise InputError(f"--set: {self._source} has no key {shown(key)}{self._hint_for(key)}")

        path = key.split(".")
        if found.end is not None:
            path.pop()
        # The number of a table of an array counts from one in a key, and from zero in a path.
        where = tuple(str(int(part) - 1) if part.isdecimal() else part for part in path[:-1])
        given = _value(literal)
        value = self.in_si({path[-1]: given}, found.owner, where)[found.name]

        if found.end is not None:
            if isinstance(given, bool) or not isinstance(given, int | Decimal):
                raise InputError(f"--set: {key}: must be a number, found {shown(given)}")
            pair = found.table.get(found.name)
            if not isinstance(pair, list) or len(pair) != 2:
                raise InputError(
                    f"--set: {key}: the file has no such interval; set both ends, KEY=[1.0, 2.0]"
                )
            # A number for an interval was read as both of its ends.
            end_value = value[0]
            value = [*pair]
            value[found.end] = end_value

        found.table[found.name] = value

    def _hint_for(self, key: str) -> str:
        """Return the end of a message about an unknown key: the key that was probably meant."""
        keys = keys_of(self._owner)
        table, _, last = key.rpartition(".")
        siblings = [name.rsplit(".", 1)[-1] for name in keys if name.rpartition(".")[0] == table]
        with_unit = _with_wrong_unit(last, siblings)
        if with_unit is not None:
            return f"; {_units_text(with_unit)}"
        guess = similar_key(key, keys)
        if guess:
            return f"; did you mean {guess}?"
        return ""

    def made(self, values: Mapping[str, Any]) -> Any:
        """Return the dataclass; raise `InputError` with a line for each fault."""
        made = None
        try:
            (made,) = adapter(self._owner).validate_json(json.dumps([values], default=str))
        except ValidationError as error:
            for details in error.errors(include_url=False):
                self._invalid(details)

        if made is not None and not self._faults:
            return made

        lines = [f"{self._source}: {self._line(path, text)}" for path, text in self._faults.items()]
        if len(lines) > _MAX_FAULTS:
            lines[_MAX_FAULTS:] = ["... and more; correct these first"]
        raise InputError("\n".join(lines))

    def _invalid(self, details: Mapping[str, Any]) -> None:
        """Note an error of pydantic at its key."""
        # The first part is 0: `made` validates a tuple of one dataclass.
        path = tuple(map(str, details["loc"][1:]))
        if details["type"] == "missing":
            if path in self._guessed:
                # It is written under a name that is not known, which has a fault.
                return
            text = "is missing"
        else:
            text = details["msg"].removeprefix("Value error, ")
            text = text.replace("Input should be", "must be")
            text = self._in_degrees(re.sub(r"^[A-Z]\w+: ", "", text))  # the name of a class

        name, _, rest = text.partition(" ")
        written = self._written.get((*path, name))
        if written is not None and written[0] != name and rest.startswith("must be"):
            # The key is written in another unit: name it as it is written, with its value.
            path = (*path, name)
            text = rest
        while path and path not in self._written and path[-1].isdecimal():
            text = f"number {int(path[-1]) + 1} {text}"
            path = path[:-1]
        self._faults.setdefault(path, text)

    def _in_degrees(self, text: str) -> str:
        """Return a message with the keys of angles in degrees, unless the file has them in rad."""
        written = {key for key, _ in self._written.values()}
        for name in re.findall(r"\w+_angle_rad\b", text):
            if name not in written:
                text = text.replace(name, f"{name.removesuffix('_rad')}_deg")
        return text

    def _line(self, path: KeyPath, text: str) -> str:
        """Return a fault with its key as written and its value.

        The SI unit of the limits is named if the key has another unit.
        """
        if not path:
            return text
        key, value = self._written.get(path, (path[-1], None))
        parts = [f"#{int(part) + 1}" if part.isdecimal() else part for part in path[:-1]]
        parts.append(key if key.isidentifier() else shown(key))
        line = f"{'.'.join(parts)}: {text}"
        # A message without a number, or with the limit zero, is the same in all units.
        if key != path[-1] and re.search(r"[1-9]", text):
            line += f" (in {quantity_and_unit(path[-1])[1]})"
        if value is not None and not isinstance(value, dict):
            line += f", found {shown(value)}"
        return line


@cache
def fields_of(owner: type) -> Mapping[str, KeyField]:
    """Return the keys of the table of a dataclass, by name."""
    hints = get_type_hints(owner, include_extras=True)
    return {field.name: _key_field(hints[field.name]) for field in fields(owner)}


def _key_field(hint: Any) -> KeyField:
    """Return the kind of value of a type hint, without None and without annotations."""
    if get_origin(hint) in (Union, types.UnionType):
        hint = next(kind for kind in get_args(hint) if kind is not types.NoneType)
    if get_origin(hint) is Annotated:
        hint = get_args(hint)[0]

    inner = get_args(hint)
    # tuple[Table, ...] is an array of tables.
    many = get_origin(hint) is tuple and inner[1:] == (...,) and is_dataclass(inner[0])
    table = inner[0] if many else hint
    if not isinstance(table, type) or not is_dataclass(table):
        table = None
    numeric = hint if hint in (int, float) else None
    return KeyField(table, many, pair=hint == tuple[float, float], numeric=numeric)


def keys_of(owner: type, prefix: str = "") -> list[str]:
    """Return the keys of a file with their tables.

    The keys of an array of tables have the number 1.
    """
    keys = []
    for name, field in fields_of(owner).items():
        if field.table is None:
            keys.append(prefix + name)
        elif field.many:
            keys += keys_of(field.table, f"{prefix}{name}.1.")
        else:
            keys += keys_of(field.table, f"{prefix}{name}.")
    return keys


def similar_key(key: str, known: Sequence[str]) -> str | None:
    """Return up to three known keys with the same last part, in any unit, joined by "or".

    If there are none: the most similar known key, or None.
    """
    last = key.rsplit(".", 1)[-1]
    alike = [
        name
        for name in known
        if name.rsplit(".", 1)[-1] == last or si_factor(last, name.rsplit(".", 1)[-1])
    ]
    # Three, chosen: they fit a line.
    return " or ".join(alike[:3]) or nearest(key, known)


def _is_table(value: object) -> bool:
    """Return whether the value of a key is a table or an array of tables."""
    first = value[0] if isinstance(value, list) and value else value
    return isinstance(first, dict)


def _with_wrong_unit(key: str, known: Iterable[str]) -> str | None:
    """Return the known key that a key is except for its unit.

    For example `max_impulse_m_s` for the key `max_impulse_km`, or `max_impulse` without a unit.
    """
    for name in known:
        quantity, unit = quantity_and_unit(name)
        if (
            unit
            and (key == quantity or key.startswith(f"{quantity}_"))
            and si_factor(key, name) is None
        ):
            return name
    return None


def _units_text(name: str) -> str:
    """Return a question about a key, with the units that its quantity can have."""
    return f"did you mean {name}? It can end in {', '.join(units_like(name))}"


def numeric_key(owner: type, key: str) -> type[int] | type[float] | None:
    """Return the type of the number that the value of a key may be.

    None if it is not a number, there is no such key, or it is in an array of tables, whose
    numbers exist only in a file.
    """
    found = _found({}, owner, key)
    if found is None:
        return None
    field = fields_of(found.owner)[found.name]
    if field.pair:
        return float
    return field.numeric


def field_key(owner: type, key: str) -> str:
    """Return a known key in the unit of its field: `body.radius_m` for `body.radius_km`."""
    found = _found({}, owner, key)
    if found is None:
        return key
    path = key.split(".")
    # The name of an end, min or max, follows the name of the field.
    path[-1 if found.end is None else -2] = found.name
    return ".".join(path)


class _FoundKey(NamedTuple):
    """The place of a key: its table with the dataclass, the name of its field, and an end.

    `end` is the number of an end of an interval, or None.
    """

    table: dict[str, Any]
    owner: type
    name: str
    end: int | None


def _found(values: dict[str, Any], owner: type, key: str) -> _FoundKey | None:
    """Return the place of a key; None if there is no such key.

    A table that is missing in `values` is added.
    """
    path = key.split(".")
    table = cast(Any, values)
    end = None
    if len(path) > 1 and path[-1] in ENDS:
        end = ENDS.index(path.pop())

    for part in path[:-1]:
        if isinstance(table, list):
            # A file of `MAX_FILE_BYTES` has fewer than 100 000 tables.
            number = int(part) if part.isdecimal() and len(part) < 6 else 0
            if not 1 <= number <= len(table):
                return None
            table = table[number - 1]
        else:
            field = fields_of(owner).get(part)
            if field is None or field.table is None or not isinstance(table, dict):
                return None
            owner = field.table
            table = table.setdefault(part, [] if field.many else {})

    name = next((name for name in fields_of(owner) if si_factor(path[-1], name)), None)
    if not isinstance(table, dict) or name is None:
        return None
    if end is not None and not fields_of(owner)[name].pair:
        return None
    return _FoundKey(table, owner, name, end)


def _value(literal: str) -> Any:
    """Return a TOML value; any other text is a number such as ``.5``, or text without quotes."""
    # As in `parse`: the parser would take too long.
    if _line_of_long_key(literal) is not None:
        return literal
    try:
        return tomllib.loads(f"value = {literal}", parse_float=Decimal)["value"]
    except (ValueError, RecursionError, InvalidOperation):
        if _NUMBER.fullmatch(literal):
            return Decimal(literal)
        return literal


def _scaled(value: Any, factor: Decimal) -> Any:
    """Return a value with its numbers times a factor, each rounded once.

    Whole numbers stay whole if the factor is 1.
    """
    if isinstance(value, list):
        return [_scaled(item, factor) for item in value]
    if isinstance(value, bool) or not isinstance(value, int | Decimal):
        return value
    if isinstance(value, int) and factor == 1:
        return value
    return float(_UNTRAPPED.multiply(Decimal(value), factor))


def parse(text: str, source: str) -> dict[str, Any]:
    """Parse TOML; refuse keys that would take the parser too long."""
    line = _line_of_long_key(text)
    if line is not None:
        raise InputError(
            f"{source}: line {line}: a key has more than {MAX_KEY_PARTS} parts; no key has more "
            "than three"
        )

    try:
        return tomllib.loads(text, parse_float=Decimal)
    except RecursionError:
        reason = "it is nested too deeply"
    except (ValueError, InvalidOperation) as error:
        reason = str(error)

    raise InputError(f"{source}: is not valid TOML: {reason}")


def _line_of_long_key(text: str) -> int | None:
    """Return the number of the first line with a key of more than `MAX_KEY_PARTS` parts.

    None if there is no such key.
    """
    parts = 0
    follows_dot = False
    for token in _TOKENS.finditer(text):
        kind = token.lastgroup
        if kind == "part":
            parts = parts + 1 if follows_dot else 1
            follows_dot = False
            if parts > MAX_KEY_PARTS:
                return text.count("\n", 0, token.start()) + 1
        elif kind == "dot":
            follows_dot = True
        elif kind != "blank":
            parts = 0
            follows_dot = False

    return None


def to_toml(value: Any) -> str:
    """Return the file of a dataclass, in SI; it is read back as an equal one."""
    lines = [*_lines(value, "")]
    kind = kind_name(type(value))
    if kind != SCENARIO:
        lines.insert(0, f"kind = {_literal(kind)}")
    return "\n".join(lines) + "\n"


def _lines(value: Any, prefix: str) -> Iterator[str]:
    """Yield the lines of a table: its keys, then its tables with their headings."""
    tables = []
    defaults = {field.name: field.default for field in fields(value)}
    for name, field in fields_of(value.__class__).items():
        inner = plain_number(getattr(value, name))
        # TOML has no None. `MAXIMUM` is the default of `Thruster.max_impulse_m_s`: no limit.
        if inner in (None, ()) or inner == MAXIMUM == defaults[name]:
            continue
        path = f"{prefix}{name}"
        if field.table is None:
            yield f"{name} = {_literal(inner)}"
        elif field.many:
            tables += [(f"[[{path}]]", each, path) for each in inner]
        else:
            tables.append((f"[{path}]", inner, path))

    for heading, table, path in tables:
        yield from ("", heading, *_lines(table, f"{path}."))


def _literal(value: Any) -> str:
    """Return a value as TOML: JSON has the same texts and flags, `repr` all digits of a float."""
    if isinstance(value, Enum):
        value = value.value
    if isinstance(value, tuple):
        return f"[{', '.join(map(_literal, value))}]"
    if isinstance(value, float):
        return repr(value)
    return json.dumps(value, ensure_ascii=False)


def changed(value: Kind, changes: Mapping[str, float | int], source: str) -> Kind:
    """Return a dataclass with other values by key, checked as a file with these values is."""
    settings = [f"{key}={plain_number(number)!r}" for key, number in changes.items()]
    return read_text(type(value), to_toml(value), source, settings)
