"""Columns of results: each is declared once, at its field, and every file format reads the declaration."""

from __future__ import annotations

import inspect
from dataclasses import dataclass, fields, replace
from enum import Enum
from functools import cache
from typing import Any, TypeVar, cast

_Owner = TypeVar("_Owner")


@dataclass(frozen=True)
class Column:
    """A column of a table with one row per run, declared in the metadata of a dataclass field.

    Parameters
    ----------
    name : str
        Heading in CSV files and key in JSON.
    unit : str
        Empty for a flag, a text and a number without a unit.
    meaning : str
        Description, for the documentation and the metadata of Parquet files.
    kind : type
        `float`, `int`, `bool`, `str`, or an enumeration whose values are texts.
    nullable : bool
        Whether a value may be unknown: masked in an array, null in a file.
    optional : bool
        Whether CSV and JSON leave the column out if it is unknown in all runs.
    field, component, derived : str, int or None, bool
        Set by `columns_of`: name of the field, index from the end along the second axis of a field of shape (B, n),
        None for a field of shape (B,), and whether the field is computed from others (``init=False``).
    """

    name: str
    unit: str
    meaning: str
    kind: type = float
    nullable: bool = False
    optional: bool = False
    field: str = ""
    component: int | None = None
    derived: bool = False


def columns(*declared: Column) -> dict[str, tuple[Column, ...]]:
    """Return the metadata of a dataclass field that holds these columns, one for each component."""
    return {"columns": declared}


@cache
def columns_of(owner: Any) -> tuple[Column, ...]:
    """Return the columns that a dataclass declares, in the order of its fields."""
    return tuple(
        replace(
            column,
            field=field.name,
            component=index - len(declared) if len(declared) > 1 else None,
            derived=not field.init,
        )
        for field in fields(owner)
        for declared in [field.metadata.get("columns", ())]
        for index, column in enumerate(declared)
    )


def columns_with_values(owner: Any) -> tuple[Column, ...]:
    """Return the columns of `columns_of` without the optional ones that are unknown in all runs."""
    return tuple(
        column
        for column in columns_of(owner.__class__)
        if not column.optional or any(value is not None for value in values_of(owner, column))
    )


def values_of(owner: object, column: Column) -> list[Any]:
    """Return one column as plain Python values, one per run: texts for an enumeration, None if unknown."""
    values: Any = getattr(owner, column.field)
    if values is None:
        return [None] * len(cast("Any", owner))
    if isinstance(values, tuple):
        return [None if value is None else value.value for value in values]
    if column.component is not None:
        if -column.component > values.shape[1]:  # in a plane nothing is along y, and there is no B-plane
            return [None] * len(values)
        values = values[:, column.component]
    plain: list[Any] = values.tolist()
    return plain


def documented(owner: type[_Owner]) -> type[_Owner]:
    """Complete the docstring of a dataclass, which ends with its parameters, by the fields that declare columns."""
    parameters: list[str] = []
    attributes = ["", "Attributes", "----------"]
    for field in fields(cast("Any", owner)):
        declared: tuple[Column, ...] = field.metadata.get("columns", ())
        if declared:
            last = declared[-1]
            array = "tuple" if issubclass(last.kind, Enum) else "masked array" if last.nullable else "ndarray"
            fewest = sum(not column.optional for column in declared)
            shape = "(B,)" if len(declared) == 1 else f"(B, {fewest} or {len(declared)})"
            meaning = "; ".join(column.meaning for column in declared)
            unit = f" Unit: {last.unit}." if last.unit else ""
            lines = parameters if field.init else attributes
            lines += [f"{field.name} : {array} of {last.kind.__name__}, shape {shape}", f"    {meaning}.{unit}"]
    owner.__doc__ = "\n".join([inspect.getdoc(owner) or "", *parameters, *attributes])
    return owner
