"""Templates: valid files with a comment on every key, generated from the declarations of the keys."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any

from experiments.common.file_kinds import SCENARIO
from experiments.common.toml_form import Form, Tables, heading, is_array, keys_of, tables_of
from experiments.common.toml_values import quoted_text

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
