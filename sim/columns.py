"""Columns of results, each declared at its field; every file format reads the declaration."""

from __future__ import annotations

import csv
import inspect
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from enum import Enum
from functools import cache
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from infoset.limits import MAXIMUM

Cell = str | int | float | bool | None
"""A cell of a table; None is unknown."""

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
        Set by `columns_of`: name of the field, index from the end along the second axis of a field
        of shape (B, n), None for a field of shape (B,), and whether the field is computed from
        others (``init=False``).
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
    """Return the metadata of a dataclass field with these columns, one for each component."""
    return {"columns": declared}


@cache
def columns_of(owner: Any) -> tuple[Column, ...]:
    """Return the columns that a dataclass declares, in the order of its fields."""
    found = []
    for field in fields(owner):
        declared: tuple[Column, ...] = field.metadata.get("columns", ())
        for index, column in enumerate(declared):
            # From the end: in a plane, the first of several components is missing.
            component = index - len(declared) if len(declared) > 1 else None
            found.append(
                replace(column, field=field.name, component=component, derived=not field.init)
            )
    return tuple(found)


def columns_with_values(owner: Any) -> tuple[Column, ...]:
    """Return the columns without the optional ones that are unknown in all runs."""

    def is_known(column: Column) -> bool:
        return any(value is not None for value in values_of(owner, column))

    declared = columns_of(owner.__class__)
    return tuple(column for column in declared if not column.optional or is_known(column))


def values_of(owner: object, column: Column) -> list[Any]:
    """Return one column as plain Python values, one per run; None is unknown."""
    values: Any = getattr(owner, column.field)
    if values is None:
        return [None] * len(cast("Any", owner))
    if isinstance(values, tuple):
        return [None if value is None else value.value for value in values]
    if column.component is not None:
        # In a plane nothing is along y, and there is no B-plane.
        if -column.component > values.shape[1]:
            return [None] * len(values)
        values = values[:, column.component]
    plain: list[Any] = values.tolist()
    return plain


def fields_of(owner: Any, table: Mapping[str, Sequence[Cell]]) -> dict[str, Any]:
    """Return the arguments of a dataclass from its columns by name: the inverse of `values_of`.

    Optional columns may be missing. A ValueError is raised if another column is missing or unknown,
    if a column is not declared, if the columns differ in length, if a value is not of the column's
    kind or beyond `MAXIMUM`, or if one component of several is unknown in some runs.
    """
    declared = columns_of(owner)
    _check_table(table, declared)
    arguments: dict[str, Any] = {}
    for column in declared:
        if column.derived:
            continue
        if column.name not in table:
            arguments.setdefault(column.field, None)
            continue

        values = _array_of(column, table[column.name])
        if column.component is None:
            arguments[column.field] = values
        elif np.ma.is_masked(values):
            raise ValueError(f"column {column.name!r} is unknown in some runs")
        elif arguments.get(column.field) is None:
            arguments[column.field] = values[:, None]
        else:
            arguments[column.field] = np.column_stack([arguments[column.field], values])
    return arguments


def _check_table(table: Mapping[str, Sequence[Cell]], declared: Sequence[Column]) -> None:
    """Raise ValueError unless a table has the declared columns, as lists of equal length."""
    names = [column.name for column in declared]
    unknown = [name for name in table if name not in names]
    if unknown:
        raise ValueError(f"column {unknown[0]!r} is not known")
    missing = [
        column.name for column in declared if column.name not in table and not column.optional
    ]
    if missing:
        raise ValueError(f"column {missing[0]!r} is missing")
    if not all(isinstance(cells, list) for cells in table.values()):
        raise ValueError("a column is no list")
    if len({len(cells) for cells in table.values()}) != 1:
        raise ValueError("its columns differ in length")


def _array_of(column: Column, cells: Sequence[Cell]) -> Any:
    """Return the values of a column: a tuple of enumeration members, or an array.

    The array of a nullable column is masked.
    """
    is_known = np.array([cell is not None for cell in cells], dtype=bool)
    if not column.nullable and not is_known.all():
        raise ValueError(f"column {column.name!r} has an unknown value")
    if issubclass(column.kind, Enum):
        return tuple(None if cell is None else column.kind(cell) for cell in cells)

    accepted = (int, float) if column.kind is float else column.kind
    for cell in cells:
        is_flag_as_number = isinstance(cell, bool) and column.kind is not bool
        if cell is not None and (is_flag_as_number or not isinstance(cell, accepted)):
            raise ValueError(
                f"column {column.name!r} has a value that is no {column.kind.__name__}"
            )
        if isinstance(cell, int | float) and not abs(cell) <= MAXIMUM:
            raise ValueError(f"column {column.name!r} has a number beyond {MAXIMUM:g}")
    # Zeros below the mask.
    values: NDArray[Any] = np.array(
        [0 if cell is None else cell for cell in cells], dtype=column.kind
    )
    return np.ma.MaskedArray(values, mask=~is_known) if column.nullable else values


def csv_text(names: Sequence[str], rows: Sequence[Sequence[Cell]]) -> str:
    """Return a table as comma-separated values, the names of the columns in the first line.

    None is an empty cell, True and False are ``true`` and ``false``, numbers have all their digits.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    for row in rows:
        writer.writerow([str(cell).lower() if isinstance(cell, bool) else cell for cell in row])
    return text.getvalue()


def documented(owner: type[_Owner]) -> type[_Owner]:
    """Add the fields that declare columns to a docstring, which must end with its parameters."""
    parameters: list[str] = []
    attributes = ["", "Attributes", "----------"]
    for field in fields(cast("Any", owner)):
        declared: tuple[Column, ...] = field.metadata.get("columns", ())
        if declared:
            lines = parameters if field.init else attributes
            lines += _described(field.name, declared)
    owner.__doc__ = "\n".join([inspect.getdoc(owner) or "", *parameters, *attributes])
    return owner


def _described(name: str, declared: Sequence[Column]) -> list[str]:
    """Return the lines of a field with columns in a docstring."""
    # The last of several columns stands for all: x, z, or B.R.
    last = declared[-1]
    array = "masked array" if last.nullable else "ndarray"
    if issubclass(last.kind, Enum):
        array = "tuple"
    fewest = sum(not column.optional for column in declared)
    shape = "(B,)" if len(declared) == 1 else f"(B, {fewest} or {len(declared)})"
    meaning = "; ".join(column.meaning for column in declared)
    unit = f" Unit: {last.unit}." if last.unit else ""
    return [
        f"{name} : {array} of {last.kind.__name__}, shape {shape}",
        f"    {meaning}.{unit}",
    ]
