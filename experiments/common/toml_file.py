"""TOML files of the user: found by name or path, limited in size, checked completely, all problems in one message."""

from __future__ import annotations

import itertools
import os
import re
import tomllib
from collections.abc import Mapping, Sequence
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from experiments.common.errors import InputError, nearest, shown
from experiments.common.file_kinds import (
    LARGEST_FILE_BYTES,
    LONGEST_LINE,
    PROBLEMS,
    SCENARIO,
    ZIP,
    built_in,
    built_in_names,
    kind_of,
    read_input,
    taken_by,
    use_of_content,
)
from experiments.common.toml_form import (
    ENDS,
    Form,
    KeyPath,
    Known,
    Problem,
    Tables,
    heading,
    keys_of,
    settable_keys,
    similar_key,
    tables_of,
)
from experiments.common.toml_values import LONGEST_DESCRIPTION, WRONG, decimal_of

MOST_PROBLEMS = 100
_LONGEST_SETTING = 1000
MISSING = "is missing"
DID_YOU_MEAN = "did you mean {}?"


def load_tables(
    form: Form[Tables], name_or_path: str | os.PathLike[str], settings: Sequence[str] | None = None
) -> Tables:
    """Read a built-in file or a file of the user; the numbers stay as written.

    A built-in name wins over a file of that name, unless the argument has a path separator or ends in ``.toml``.
    `settings` are KEY=VALUE: values in place of those of the file, in its units, with the keys of `read_tables`; they
    are added to the description. Raise `InputError` if there is no such file, or it is invalid, with all its problems.
    """
    text, source = _text_of(form, name_or_path)
    values = _read_settings(settings or ())
    if not values:
        return read_tables(form, text, source)
    tables = read_tables(form, text, f"{source} with --set", values)
    changes = ", ".join(f"{key} = {' '.join(value.split())}" for key, value in values.items() if key != "description")
    lines = [line for line in (getattr(tables, "description", ""), changes and f"with {changes}") if line]
    return tables.model_copy(update={"description": "; ".join(lines)[:LONGEST_DESCRIPTION]})


def document_of(form: Form[Tables], name_or_path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the content of a built-in file of any kind or a file of the user as parsed, without checks of its keys."""
    return _parse(form, *_text_of(form, name_or_path))


def _text_of(form: Form[Tables], name_or_path: str | os.PathLike[str]) -> tuple[str, str]:
    """Return the text of a file, and its name for messages."""
    given = os.fspath(name_or_path)
    marks = [mark for mark in (os.sep, os.altsep) if mark]
    is_name = isinstance(name_or_path, str) and not given.endswith(".toml") and not any(mark in given for mark in marks)
    kinds = [form.kind] if form.kind else PROBLEMS
    if is_name and (given in built_in_names(kinds) or not os.path.lexists(given)):
        return built_in(given, kinds, f"no file and no built-in {form.noun}").text, f"{given} (built in)"
    return _text_of_file(form, given), given


def read_tables(form: Form[Tables], text: str, source: str, values: Mapping[str, str] | None = None) -> Tables:
    """Check the text of a file, and return its values, numbers as written; messages name `source`.

    `values` are TOML values that replace those of the text, by key, before the text is checked. A key is written with
    its table, ``thruster.budget_m_s``; in an array of tables with the number of the table, ``craft.2.weight``.
    ``.least`` and ``.greatest`` after a key are the ends of a pair. Texts may be written without quotes. Raise
    `InputError` with all problems of the text: path, value and what to do.
    """
    document = _parse(form, text, source)
    kind = kind_of(document)
    if kind is not None and kind != form.kind:
        raise InputError(f"{source}: {taken_by(kind)}")
    if values:
        _replace_values(form, document, values)
    schema = document.get("schema", form.schema)
    if isinstance(schema, bool) or not isinstance(schema, int) or schema != form.schema:
        raise InputError(
            f"{source}: schema: must be {form.schema}, the only file format that this version reads, found "
            f"{shown(schema)}; write schema = {form.schema} and the keys of `{form.begun_by}`, or update infoset"
        )
    if form.kind != SCENARIO and document.get("kind") != form.kind:
        fault = f'must be "{form.kind}", found {shown(document["kind"])}' if "kind" in document else "is missing"
        raise InputError(f'{source}: kind: {fault}; write kind = "{form.kind}" above the first table')
    tables = None
    problems: list[Problem] = []
    try:
        tables = form.tables.model_validate(document)
    except ValidationError as error:
        found_wrong = error.errors(include_url=False)
        problems = [_problem(form, details) for details in found_wrong[: MOST_PROBLEMS + 1]]
        known = Known(document, frozenset(tuple(str(part) for part in each["loc"]) for each in found_wrong))
    else:
        known = Known(document, frozenset())
    problems += form.checks(known)
    # A key with a misspelt name is not missing too.
    misspelt = {(*each.path[:-1], each.remedy) for each in problems}
    problems = [
        each
        for each in problems
        if each.text != MISSING or (*each.path[:-1], DID_YOU_MEAN.format(each.path[-1])) not in misspelt
    ]
    if tables is None or problems:
        raise InputError(_report(form, problems, source))
    return tables


def _read_settings(settings: Sequence[str]) -> dict[str, str]:
    """Return the values of ``--set KEY=VALUE`` by key, as written."""
    values: dict[str, str] = {}
    for setting in settings:
        key, mark, text = (part.strip() for part in setting.partition("="))
        if not mark or not key or not text or len(setting) > _LONGEST_SETTING:
            raise InputError(
                f"--set: must be KEY=VALUE, found {shown(setting)}; for example --set name=mine, or with the table of "
                "the key, --set TABLE.KEY=5"
            )
        if key in values:
            raise InputError(f"--set: {key} is set twice; set each key once")
        values[key] = text
    return values


def _replace_values(form: Form[Tables], document: dict[str, Any], values: Mapping[str, str]) -> None:
    """Replace values of a parsed file, or add them; `InputError` if there is no such key, or no such table of an array.

    The file is checked afterwards, so the values are valid exactly when a file with them is.
    """
    known = settable_keys(form.tables)
    for key, literal in values.items():
        path, end = key.split("."), None
        if _general(path) not in known:
            end = path.pop()
            if end not in ENDS or _general(path) not in known:
                guess = similar_key(key, known)
                hint = f"did you mean {guess}?" if guess else f"for the keys, see: {form.begun_by}"
                if key.endswith("_sensor.scale"):
                    hint = "a scale is only for --vary of infoset sweep; set each error bound of the sensor"
                raise InputError(f"--set: a {form.noun} has no key {shown(key)}; {hint}")
        table = _table(document, path[:-1], key)
        if table is not None:  # a file with a value in place of a table is refused by its checks
            value = _value(literal)
            table[path[-1]] = value if end is None else _with_end(table.get(path[-1]), end, value, key)


def _general(path: Sequence[str]) -> str:
    """Return a key as in `settable_keys`, which has the number 1 for all tables of an array."""
    return ".".join("1" if part.isdecimal() else part for part in path)


def _table(document: dict[str, Any], path: Sequence[str], key: str) -> dict[str, Any] | None:
    """Return a table, which is added if it is missing; None if the file has something else there."""
    table: Any = document
    for part, after in itertools.pairwise((*path, "")):
        if isinstance(table, list) and part.isdecimal():
            if not 1 <= int(part[:6]) <= len(table):
                raise InputError(f"--set: {key}: the file has {len(table)} of these tables, numbered from 1")
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


def _text_of_file(form: Form[Tables], path: str) -> str:
    content = read_input(
        Path(path),
        f"{form.noun} file",
        LARGEST_FILE_BYTES,
        f"check the path, or see `{form.listed_by}` for the built-in names",
    )
    if content.startswith(ZIP):
        raise InputError(f"{path}: {use_of_content(content)}")
    if not content.strip():
        raise InputError(f"{path}: is empty; start from `{form.begun_by}`")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise InputError(f"{path}: is not UTF-8 text (line {line}); save it as UTF-8") from None


def _parse(form: Form[Tables], text: str, source: str) -> dict[str, Any]:
    """Parse TOML; raise `InputError` for texts that would take the parser too long."""
    if len(text) > LARGEST_FILE_BYTES:
        raise InputError(f"{source}: is over {LARGEST_FILE_BYTES // 1000} kB, far more than a {form.noun} needs")
    lines = text.split("\n")
    for number, line in enumerate(lines, start=1):
        if len(line) > LONGEST_LINE:
            raise InputError(f"{source}: line {number} is over {LONGEST_LINE} characters; divide it")
    try:
        return tomllib.loads(text, parse_float=decimal_of)
    except tomllib.TOMLDecodeError as error:
        column = len(lines[-1]) + 1
        reason = str(error).replace("(at end of document)", f"(at line {len(lines)}, column {column}: the end)")
        raise InputError(f"{source}: is not valid TOML: {reason}; correct that line") from None
    except (RecursionError, ValueError) as error:
        reason = "it is nested too deeply" if isinstance(error, RecursionError) else str(error)
        raise InputError(f"{source}: is not a {form.noun}: {reason}; start from `{form.begun_by}`") from None


def _report(form: Form[Tables], problems: list[Problem], source: str) -> str:
    """Return one message with all problems of a file, in the order of the tables."""
    order = [*keys_of(form.tables)]
    problems = sorted(problems, key=lambda each: order.index(each.path[0]) if each.path[0] in order else len(order))
    lines = [f"{source}: {_written(each.path)}: {each.text}; {each.remedy}" for each in problems[:MOST_PROBLEMS]]
    if len(problems) > MOST_PROBLEMS:
        lines.append(f"{source}: and more problems; correct these first")
    if len(lines) == 1:
        return lines[0]
    return "\n  ".join([f"{source} has {len(lines)} problems:", *lines])


def _written(path: KeyPath) -> str:
    """Return a path for a message: the second table of [[craft]] is ``craft #2``."""
    parts: list[str] = []
    for depth, part in enumerate(path):
        if part.isdigit() and depth:
            parts[-1] += f" #{int(part) + 1}"
        else:
            parts.append(part if part.replace("_", "").replace("-", "").isalnum() else shown(part))
    return ".".join(parts)


def _problem(form: Form[Tables], details: Any) -> Problem:
    path = tuple(str(part) for part in details["loc"])
    if details["type"] == "missing":
        return Problem(path, MISSING, _remedy_of_missing(form, path))
    if details["type"] == "extra_forbidden":
        return Problem(path, *_unknown(form, path, details["input"]))
    found = shown(details["input"])
    if details["type"] == WRONG:
        context = details["ctx"]
        remedy = context["remedy"] or f"write {_example(form.tables, path)}"
        return Problem(path, f"{context['problem']}, found {found}", remedy)
    if details["type"] in ("too_short", "too_long"):
        least, most = details["ctx"].get("min_length"), details["ctx"].get("max_length")
        limit = f"at least {least}" if least is not None else f"at most {most}"
        return Problem(path, f"must have {limit} of them, found {len(details['input'])}", "add or remove some")
    written = heading(form.tables, path[0])
    problem = "must be tables" if written.startswith("[[") and len(path) == 1 else "must be a table"
    return Problem(path, f"{problem}, found {found}", f"write {written} on a separate line, its keys below it")


def _example(tables: type[BaseModel], path: KeyPath) -> str:
    return f"for example {path[-1]} = {keys_of(tables, path[:-1])[path[-1]].examples[0]}"


def _remedy_of_missing(form: Form[Tables], path: KeyPath) -> str:
    tables = form.tables
    if len(path) > 1:
        return f"add it under {heading(tables, path[0])}, {_example(tables, path)}"
    if path[0] in tables_of(tables):
        keys = keys_of(tables, path).items()
        needed = [name for name, field in keys if field.is_required() or f"{path[0]}.{name}" in form.written]
        return f"add the table {heading(tables, path[0])} with its keys {', '.join(needed)}"
    return f"add it above the first table, {_example(tables, path)}"


def _unknown(form: Form[Tables], path: KeyPath, value: object) -> tuple[str, str]:
    name, home = path[-1], path[:-1]
    known_tables = tables_of(form.tables)
    homes = [heading(form.tables, other) for other in known_tables if name in keys_of(form.tables, (other,))]
    here = heading(form.tables, home[0]) if home else None
    if here is not None and name in keys_of(form.tables):
        what = f"is not a key of {here}"
        if name in known_tables:
            return what, f"write {heading(form.tables, name)} as a separate table"
        return what, f"move {name} above the first table"
    if homes and not isinstance(value, dict):
        return f"is not a key of {here or 'the top level'}", f"move {name} to {' or '.join(homes)}"
    valid = [*keys_of(form.tables, home)]
    guess = nearest(name, valid)
    if here is not None:
        what = f"is not a key of {here}"
    else:
        what = f"is not a {'table' if isinstance(value, dict) else 'key'} of a {form.noun}"
    return what, DID_YOU_MEAN.format(guess) if guess else f"remove it; valid here: {', '.join(valid)}"
