"""Kinds of TOML files: their tables and keys, and the problems that a file can have."""

from __future__ import annotations

import typing
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import Any, Generic, TypeVar

from pydantic import BaseModel

from experiments.common.errors import nearest
from experiments.common.file_kinds import SCENARIO
from experiments.common.toml_values import DecimalPair, quoted_text

ENDS = ("least", "greatest")
"""Names of the ends of a pair, after the name of its key."""

KeyPath = tuple[str, ...]
Tables = TypeVar("Tables", bound=BaseModel)


@dataclass(frozen=True)
class Problem:
    """One problem of a file: path of the key, what is wrong with which value, and what to do.

    In an array of tables, the path has the index of the table, from 0, after its name.
    """

    path: KeyPath
    text: str
    remedy: str


@dataclass(frozen=True)
class Known:
    """The values of a file as parsed; those whose paths are in `bad` are None."""

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


@dataclass(frozen=True)
class Form(Generic[Tables]):
    """A kind of file: its tables, and its names in messages.

    Parameters
    ----------
    noun : str
        Name of such a file in messages: ``scenario``.
    listed_by, begun_by : str
        Commands that list the built-in files, and that print or write a valid file to start from.
    tables : type
        The pydantic model of the whole file, made of `experiments.common.toml_values.Table`.
    checks : callable, optional
        Checks of relations between values.
    written : sequence of str, optional
        Optional tables and keys that the template contains, not as comments: ``chaser.position_m``.
    kind : str, optional
        Required value of ``kind``; `SCENARIO` for scenario files, which do not have this key.
    """

    noun: str
    listed_by: str
    begun_by: str
    tables: type[Tables]
    checks: Callable[[Known], Iterable[Problem]] = lambda _: ()
    written: Sequence[str] = ()
    kind: str = SCENARIO
    schema: int = 1


def keys_of(tables: type[BaseModel], path: KeyPath = ()) -> dict[str, Any]:
    """Return the keys of a table as written, with their pydantic fields; an empty path is the top of the file."""
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


def similar_key(key: str, known: Sequence[str]) -> str | None:
    """Return the most similar known key, or up to three keys with the same last part, or None."""
    last = key.rsplit(".", 1)[-1]
    alike = [name for name in known if last in name.split(".")]
    return nearest(key, known) or " or ".join(alike[:3]) or None


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
    annotation = _fields(tables)[name].annotation
    return any(typing.get_origin(kind) in (list, tuple) for kind in (annotation, *typing.get_args(annotation)))


def heading(tables: type[BaseModel], name: str) -> str:
    """Return the heading of a table: ``[orbit]``, ``[[craft]]``."""
    return f"[[{name}]]" if is_array(tables, name) else f"[{name}]"


_WIDTH = 44


def template(form: Form[Tables], head: Sequence[str]) -> str:
    """Return a valid file of a form, with some lines at its top.

    Optional keys and tables are comments, except those in ``form.written``. A key with several examples is written with
    the first one in the first table that has it, with the second one in the second table, and so on; an array has as
    many tables as that needs.
    """
    lines, used = [*(f"# {line}" for line in head), ""], Counter[str]()
    top = {name: field for name, field in keys_of(form.tables).items() if name not in tables_of(form.tables)}
    for name, field in top.items():
        if name == "kind" and form.kind != SCENARIO:
            lines.append(_key_line("kind", quoted_text(form.kind), field))
        else:
            written = field.is_required() or name in ("schema", *form.written)
            lines.append(_key_line(name, field.examples[0], field, is_comment=not written))
    for name in tables_of(form.tables):
        lines += _table(form, name, used)
    return "\n".join(lines) + "\n"


def _table(form: Form[Tables], name: str, used: Counter[str]) -> Iterator[str]:
    field, keys = keys_of(form.tables)[name], keys_of(form.tables, (name,))
    array = is_array(form.tables, name)
    is_comment = not field.is_required() and field.default in (None, ()) and name not in form.written
    written = {key for key in keys if not is_comment and (keys[key].is_required() or f"{name}.{key}" in form.written)}
    note = f"; one table {heading(form.tables, name)} for each" if array else ""
    optional = "" if field.is_required() else " (an optional table)"
    yield from ("", f"# {field.description}{note}{optional}")
    count = max((len(keys[key].examples) - used[_use(key, keys[key])] for key in written), default=1) if array else 1
    for index in range(max(1, count)):
        yield from [""] if index else []
        yield f"# {heading(form.tables, name)}" if is_comment else heading(form.tables, name)
        for key, own in keys.items():
            if key in written or index == 0:
                example = own.examples[min(used[_use(key, own)], len(own.examples) - 1)]
                yield _key_line(key, example, own, is_comment=key not in written)
                used[_use(key, own)] += key in written


def _use(key: str, field: Any) -> str:
    return f"{key}: {field.description}"


def _key_line(name: str, example: str, field: Any, *, is_comment: bool = False) -> str:
    line = f"{'# ' if is_comment else ''}{name} = {example}"
    return f"{line:<{_WIDTH}}  # {field.description}"
