"""Rows of a campaign as Arrow tables and Parquet files. The one module that imports pyarrow."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from numpy.typing import NDArray

from guidance import NoiseKind, TieRule
from sim.chunk import Chunk
from sim.columns import Column, columns_of, values_of
from sim.results import Results

SCHEMA_VERSION = 2
M_PER_KM = 1e3
MAX_BYTES_A_ROW = 160
"""A row takes about 110 bytes, and 150 with its text uncompressed; in a plane 30 less."""
BYTES_BESIDE_ROWS = 100_000

_RESULTS = [column for column in columns_of(Results) if not column.derived]
_NOISES = (
    Column("noise", "", "Measurement noise", NoiseKind),
    Column("tie", "", "How game noise breaks ties; null under random noise", TieRule, nullable=True),
    Column("range_sensor", "", "Whether there is a range sensor", bool),
)


def _is_start(column: Column) -> bool:
    return column.name.startswith("start_")


def _stored(column: Column) -> Column:
    """Return a column as it is stored: the start is in km."""
    if not _is_start(column):
        return column
    name = column.name.removeprefix("start_").replace("_m", "_km")
    return replace(column, name=name, unit=f"k{column.unit}")


_COLUMNS = [_stored(column) for column in (_RESULTS[0], *_NOISES, *_RESULTS[1:])]
_TYPES = {int: pa.int64(), float: pa.float64(), bool: pa.bool_()}
_TEXTS = {column.name: {text.value for text in column.kind} for column in _COLUMNS if issubclass(column.kind, Enum)}
_LIMITS = {column.name: column.limits for column in _COLUMNS}


def schema(*, with_cell: bool) -> Any:
    """Return the Arrow schema of the rows: names, types, and unit and meaning in each field's metadata."""
    fields = [
        pa.field(
            column.name,
            _TYPES.get(column.kind, pa.string()),
            nullable=column.nullable,
            metadata={"unit": column.unit, "meaning": column.meaning},
        )
        for column in _COLUMNS
    ]
    cell = [pa.field("cell", pa.int32(), nullable=False, metadata={"unit": "", "meaning": "Cell number in the sweep"})]
    return pa.schema([*(cell if with_cell else []), *fields], metadata={"infoset_schema": str(SCHEMA_VERSION)})


def rows(chunk: Chunk, results: Results, *, with_cell: bool) -> Any:
    """Return the results of a chunk as an Arrow table, with the column `cell` in a sweep.

    A FloatingPointError is raised if a number is not finite or out of its limits.
    """
    noises = chunk.noises(results.runs)
    stored: dict[str, Any] = {
        "cell": np.full(len(results), chunk.cell, dtype=np.int32),
        "noise": [noise.value for noise in noises],
        "tie": [chunk.scenario.tie.value if noise is NoiseKind.GAME else None for noise in noises],
        "range_sensor": np.full(len(results), chunk.scenario.range_sensor is not None),
    }
    for column in _RESULTS:
        values = values_of(results, column)
        if _is_start(column):
            values = [None if value is None else value / M_PER_KM for value in values]
        stored[_stored(column).name] = values
    wanted = schema(with_cell=with_cell)
    table = pa.table({name: stored[name] for name in wanted.names}, schema=wanted)
    try:
        need_valid(table, chunk.runs, chunk.cell)
    except ValueError as error:
        raise FloatingPointError(
            f"results of runs {results.runs[0]} to {results.runs[-1]} are not finite or out of their limits: {error}"
        ) from None
    return table


def need_valid(table: Any, runs: range, cell: int) -> None:
    """Raise ValueError, which names the column, if complete rows are not those of some runs of a cell, in order.

    It is also raised if a number is not finite or out of its limits, or a text is unknown.
    """
    for name, wanted in (("run", np.asarray(runs)), ("cell", np.full(len(runs), cell))):
        if name in table.column_names:
            values = table.column(name).to_numpy()
            wrong = np.flatnonzero(values != wanted)
            if wrong.size:
                raise ValueError(f"{name} is {values[wrong[0]]} in row {wrong[0]}, must be {wanted[wrong[0]]}")
    for name in table.column_names:
        column = table.column(name)
        if name in _TEXTS and not {*pc.unique(column).to_pylist()} <= {*_TEXTS[name], None}:
            raise ValueError(f"{name} contains an unknown text")
        if not pa.types.is_floating(column.type) or column.null_count == len(column):
            continue
        known = column.drop_null().to_numpy()
        ends = known.min(), known.max()  # NaN if there is one
        if not np.isfinite(ends).all():
            raise ValueError(f"{name} contains a value that is not a finite number")
        for end in ends:
            problem = _LIMITS[name].problem(end)
            if problem is not None:
                raise ValueError(f"{name} {problem}: got {end:g}")


def to_bytes(table: Any, extra: Mapping[str, str]) -> bytes:
    """Return a table as a Parquet file, with some more entries in the metadata of its schema."""
    sink = pa.BufferOutputStream()
    whole = table.replace_schema_metadata({**(table.schema.metadata or {}), **extra})
    # Random numbers do not repeat, so dictionary encoding would only increase the size.
    texts = [name for name in _TEXTS if name in table.column_names]
    pq.write_table(whole, sink, compression="zstd", use_dictionary=texts)
    return bytes(sink.getvalue().to_pybytes())


def fault(content: bytes, wanted: Mapping[str, str], rows: int, *, with_cell: bool) -> str | None:
    """Return a description of the damage of a shard, from its metadata; None if there is none.

    The metadata of its schema must have the entries `wanted`, and the file must have `rows` rows.
    """
    try:
        file = pq.ParquetFile(pa.BufferReader(content))
        metadata, columns = file.metadata, file.schema_arrow
        entries = {key.decode(): value.decode() for key, value in (columns.metadata or {}).items()}
    except (pa.ArrowException, OSError, ValueError):
        return "is not a Parquet file"
    if any(entries.get(key) != value for key, value in wanted.items()):
        return "belongs to another campaign"
    if metadata.num_rows != rows:
        return f"has {metadata.num_rows} rows instead of {rows}"
    if not columns.equals(schema(with_cell=with_cell)):
        return "has other columns than a campaign"
    return None


def read(file: Path, columns: Sequence[str] | None, *, with_cell: bool) -> Any:
    """Return some columns of a shard without a `fault`; None returns all columns.

    A ValueError is raised if the content is not that of a shard.
    """
    wanted = _some(columns, with_cell=with_cell)
    try:
        table = pq.ParquetFile(file).read(columns=wanted.names, use_threads=False)
        return table.select(wanted.names).cast(wanted).replace_schema_metadata(wanted.metadata)
    except (pa.ArrowException, KeyError) as error:
        raise ValueError(str(error)) from None


def joined(parts: Sequence[Any], columns: Sequence[str] | None, *, with_cell: bool) -> Any:
    """Return several tables as one; without tables, a table without rows."""
    return pa.concat_tables(parts or [_some(columns, with_cell=with_cell).empty_table()])


def frame(table: Any, *, guarantees: bool) -> Any:
    """Return the rows as a pandas.DataFrame with the columns of `Results`, the cell and the noise."""
    frame = table.to_pandas(types_mapper={pa.bool_(): pd.BooleanDtype()}.get, categories=["noise", "outcome"])
    for column in _COLUMNS:
        if column.name.endswith(("_km", "_km_s")):
            name = f"start_{column.name}".replace("_km", "_m")
            frame[name] = frame.pop(column.name) * M_PER_KM
    if "cell" not in frame:
        frame.insert(0, "cell", np.zeros(len(frame), dtype=np.int32))
    frame["truth_kept"] = (frame["truth_margin_m"].fillna(0.0) >= 0.0).astype("boolean")
    known = frame["guaranteed_miss_m"].notna() & guarantees
    frame["phi_held"] = (frame["miss_m"] <= frame["guaranteed_miss_m"]).astype("boolean").where(known)
    return frame.drop(columns=["tie", "range_sensor"])


def _some(columns: Sequence[str] | None, *, with_cell: bool) -> Any:
    """Return the schema of some columns; None returns that of all columns."""
    wanted = schema(with_cell=with_cell)
    return wanted if columns is None else pa.schema([wanted.field(name) for name in columns], metadata=wanted.metadata)


def numbers(table: Any, name: str) -> np.ma.MaskedArray[tuple[int], np.dtype[np.float64]]:
    """Return a column of numbers, or of flags as 0 and 1; masked where it is null."""
    column = table.column(name)
    if pa.types.is_boolean(column.type):
        column = column.cast(pa.float64())
    if not column.null_count:
        return np.ma.MaskedArray(column.to_numpy(), mask=False)
    return np.ma.MaskedArray(pc.fill_null(column, 0).to_numpy(), mask=pc.is_null(column).to_numpy())


def codes(table: Any, name: str, known: Sequence[str]) -> NDArray[np.int8]:
    """Return a column of text as indices in a list of values; -1 for other values."""
    indices = pc.index_in(table.column(name), value_set=pa.array(list(known), type=pa.string()))
    return np.asarray(pc.fill_null(indices, -1).to_numpy(), dtype=np.int8)


def plain_table(columns: Mapping[str, Sequence[Any]], units: Mapping[str, str]) -> Any:
    """Return a table of numbers and text, with null for None and units in the metadata of its fields."""
    table = pa.table({name: pa.array(list(values)) for name, values in columns.items()})
    fields = [field.with_metadata({"unit": units.get(field.name, "")}) for field in table.schema]
    return table.cast(pa.schema(fields, metadata={"infoset_schema": str(SCHEMA_VERSION)}))
