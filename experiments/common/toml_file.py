"""TOML files of the user: found by name or path, limited in size, checked completely, all problems in one message."""

from __future__ import annotations

import os
import tomllib
import typing
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from typing import Any, Generic, TypeVar

from pydantic import BaseModel, ValidationError

from experiments.common.errors import InputError, nearest, shown
from experiments.common.file_kinds import (
    LARGEST_FILE_BYTES,
    LONGEST_LINE,
    PROBLEM_COMMANDS,
    SCENARIO,
    ZIP,
    built_in,
    built_in_names,
    kind_of,
    taken_by,
    use_of_file,
    use_of_folder,
)
from experiments.common.settings import read_settings, replace_values
from experiments.common.toml_values import LONGEST_DESCRIPTION, WRONG, DecimalPair, decimal_of

MOST_PROBLEMS = 100
MISSING = "is missing"
DID_YOU_MEAN = "did you mean {}?"

KeyPath = tuple[str, ...]
Tables = TypeVar("Tables", bound=BaseModel)


@dataclass(frozen=True)
class Problem:
    """One problem of a file.

    Parameters
    ----------
    path : tuple of str
        Table and key; an array of tables has the index of the table, from 0, after its name.
    text : str
        What is wrong, and with which value.
    remedy : str
        What to do.
    """

    path: KeyPath
    text: str
    remedy: str


@dataclass(frozen=True)
class Known:
    """The values of a file; those that are invalid are None.

    Parameters
    ----------
    document : dict
        The file as parsed.
    bad : frozenset of tuple of str
        Paths of the invalid tables and keys.
    """

    document: dict[str, Any]
    bad: frozenset[KeyPath]

    def value(self, *path: str) -> object:
        """Return the value of a key as parsed, or None."""
        value: object = self.document
        for depth, part in enumerate(path, start=1):
            if path[:depth] in self.bad:
                return None
            if isinstance(value, list):
                value = value[int(part)] if int(part) < len(value) else None
            else:
                value = value.get(part) if isinstance(value, dict) else None
        return value

    def number(self, *path: str) -> Decimal | None:
        """Return a number, or None."""
        value = self.value(*path)
        return Decimal(value) if isinstance(value, int | Decimal) else None

    def pair(self, *path: str) -> DecimalPair | None:
        """Return an interval, or None; a fixed number has equal ends."""
        value = self.value(*path)
        if isinstance(value, list):
            return Decimal(value[0]), Decimal(value[1])
        fixed = self.number(*path)
        return None if fixed is None else (fixed, fixed)


def no_checks(_known: Known) -> Iterator[Problem]:
    """Yield no problem."""
    return iter(())


@dataclass(frozen=True)
class Form(Generic[Tables]):
    """A kind of file: its tables, and its names in messages.

    Parameters
    ----------
    noun : str
        Name of such a file in messages: ``scenario``.
    listed_by : str
        Command that lists the built-in files.
    begun_by : str
        Command that prints or writes a valid file to start from.
    tables : type
        The pydantic model of the whole file, made of `experiments.common.toml_values.Table`.
    checks : callable, optional
        Checks of relations between values.
    written : sequence of str, optional
        Optional tables and keys that the template contains, not as comments: ``chaser.position_m``.
    kind : str, optional
        Required value of ``kind``; `SCENARIO` for scenario files, which do not have this key.
    schema : int, optional
        Version of the file format.
    """

    noun: str
    listed_by: str
    begun_by: str
    tables: type[Tables]
    checks: Callable[[Known], Iterator[Problem]] = no_checks
    written: Sequence[str] = ()
    kind: str = SCENARIO
    schema: int = 1


def load_tables(
    form: Form[Tables], name_or_path: str | os.PathLike[str], settings: Sequence[str] | None = None
) -> Tables:
    """Read a built-in file or a file of the user; the numbers stay as written.

    Parameters
    ----------
    name_or_path : str or path
        A built-in name, or the path of a TOML file. A name wins over a file of that name, unless the argument has a
        path separator or ends in ``.toml``.
    settings : sequence of str or None, optional
        KEY=VALUE: values in place of those of the file, in its units; see `experiments.common.settings`. They are
        added to the description.

    Raises
    ------
    InputError
        If there is no such file, or it is invalid; the message lists all its problems.
    """
    text, source = _text_of(form, name_or_path)
    values = read_settings(settings or ())
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
    kinds = [form.kind] if form.kind else PROBLEM_COMMANDS
    if is_name and (given in built_in_names(kinds) or not _exists(given)):
        return built_in(given, kinds, f"no file and no built-in {form.noun}").text, f"{given} (built in)"
    return _text_of_file(form, given), given


def read_tables(form: Form[Tables], text: str, source: str, values: Mapping[str, str] | None = None) -> Tables:
    """Check the text of a file, and return its values, numbers as written.

    Parameters
    ----------
    source : str
        Name of the file in messages.
    values : mapping of str to str or None, optional
        TOML values that replace those of the text, by key; see `experiments.common.settings.replace_values`.

    Raises
    ------
    InputError
        With all problems of the text: place, value and what to do.
    """
    document = _parse(form, text, source)
    kind = kind_of(document)
    if kind is not None and kind != form.kind:
        raise InputError(f"{source}: {taken_by(kind)}")
    if values:
        replace_values(document, values, settable_keys(form.tables), form.noun, form.begun_by)
    schema = document.get("schema", form.schema)
    if isinstance(schema, bool) or not isinstance(schema, int) or schema != form.schema:
        raise InputError(
            f"{source}: schema: must be {form.schema}, the only file format that this version reads, found "
            f"{shown(schema)}; write schema = {form.schema} and the keys of `{form.begun_by}`, or update infoset"
        )
    if form.kind != SCENARIO and document.get("kind") != form.kind:
        found = f"found {shown(document['kind'])}" if "kind" in document else "which is missing"
        raise InputError(
            f'{source}: kind: must be "{form.kind}", {found}; write kind = "{form.kind}" above the first table'
        )
    tables = None
    problems: list[Problem] = []
    try:
        tables = form.tables.model_validate(document)
    except ValidationError as error:
        found_wrong = error.errors(include_url=False)
        problems = [_problem(form, details) for details in found_wrong[: MOST_PROBLEMS + 1]]
        # A key with a misspelt name is not missing too.
        misspelt = {(*each.path[:-1], each.remedy) for each in problems}
        problems = [
            each
            for each in problems
            if each.text != MISSING or (*each.path[:-1], DID_YOU_MEAN.format(each.path[-1])) not in misspelt
        ]
        known = Known(document, frozenset(tuple(str(part) for part in each["loc"]) for each in found_wrong))
    else:
        known = Known(document, frozenset())
    problems += form.checks(known)
    if tables is None or problems:
        raise InputError(_report(form, problems, source))
    return tables


def keys_of(tables: type[BaseModel], path: KeyPath = ()) -> dict[str, Any]:
    """Return the keys of a table as written, with their pydantic fields.

    Parameters
    ----------
    tables : type
        The model of the whole file.
    path : tuple of str, optional
        The table in it; empty is the top of the file.
    """
    model = tables
    for part in path:
        if part.isdigit():
            continue
        inner = _table_in(_fields(model)[part].annotation)
        if inner is None:
            return {}
        model = inner
    return _fields(model)


def tables_of(tables: type[BaseModel]) -> tuple[str, ...]:
    """Return the names of the tables of a file, in their order."""
    return tuple(name for name, field in _fields(tables).items() if _table_in(field.annotation) is not None)


def settable_keys(tables: type[BaseModel]) -> list[str]:
    """Return the keys of a file that ``--set`` replaces, with their tables; ``craft.1.weight`` in an array."""
    inner = tables_of(tables)
    top = [name for name in keys_of(tables) if name not in (*inner, "schema", "kind")]
    return top + [
        f"{table}.1.{name}" if is_array(tables, table) else f"{table}.{name}"
        for table in inner
        for name in keys_of(tables, (table,))
    ]


def _fields(model: type[BaseModel]) -> dict[str, Any]:
    return {field.alias or name: field for name, field in model.model_fields.items()}


def _table_in(annotation: Any) -> type[BaseModel] | None:
    """Return the model of a table, optional or an array of them, or None for a plain value."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    inner = [_table_in(each) for each in typing.get_args(annotation)]
    return next((each for each in inner if each is not None), None)


def is_array(tables: type[BaseModel], name: str) -> bool:
    """Whether a table is an array of tables."""
    return any(typing.get_origin(each) in (list, tuple) for each in _options(_fields(tables)[name].annotation))


def _options(annotation: Any) -> tuple[Any, ...]:
    return (annotation, *typing.get_args(annotation))


def heading(tables: type[BaseModel], name: str) -> str:
    """Return the heading of a table: ``[orbit]``, ``[[craft]]``."""
    return f"[[{name}]]" if is_array(tables, name) else f"[{name}]"


def _exists(path: str) -> bool:
    try:
        return bool(path) and Path(path).exists()
    except (OSError, ValueError):  # a name too long, or with a null in it
        return False


def _text_of_file(form: Form[Tables], path: str) -> str:
    """Read a file of the user."""
    try:
        with Path(path).open("rb") as file:
            content = file.read(LARGEST_FILE_BYTES + 1)
    except FileNotFoundError:
        raise InputError(
            f"{path}: there is no such file; check the path, or see `{form.listed_by}` for the built-in names"
        ) from None
    except IsADirectoryError:
        raise InputError(f"{path}: {use_of_folder(Path(path), f'{form.noun} file')}") from None
    except PermissionError:
        raise InputError(f"{path}: cannot be read, permission denied; check who may read it") from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise InputError(f"{shown(path)}: cannot be read: {reason}; check the path") from None
    if len(content) > LARGEST_FILE_BYTES:
        raise InputError(
            f"{path}: is over {LARGEST_FILE_BYTES // 1000} kB, far more than a {form.noun} needs; name a {form.noun} "
            f"file"
        )
    if content.startswith(ZIP):
        raise InputError(f"{path}: {use_of_file(Path(path))}")
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
            raise InputError(f"{source}: line {number} is over {LONGEST_LINE} characters; no line of a {form.noun} is")
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
    """Return the problem of an error of pydantic."""
    path = tuple(str(part) for part in details["loc"])
    if details["type"] == "missing":
        return Problem(path, MISSING, _remedy_of_missing(form.tables, path))
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


def _remedy_of_missing(tables: type[BaseModel], path: KeyPath) -> str:
    if len(path) > 1:
        return f"add it under {heading(tables, path[0])}, {_example(tables, path)}"
    if path[0] in tables_of(tables):
        return f"add the table {heading(tables, path[0])} with its keys {', '.join(keys_of(tables, path))}"
    return f"add it above the first table, {_example(tables, path)}"


def _unknown(form: Form[Tables], path: KeyPath, value: object) -> tuple[str, str]:
    """Return the text and the remedy for an unknown key or table."""
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
