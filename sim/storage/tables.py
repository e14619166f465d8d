"""Rows of a campaign as Arrow tables and Parquet files. The one module that imports pyarrow."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from numpy.typing import NDArray

from guidance import NoiseKind
from sim.chunk import Chunk
from sim.results import Results

SCHEMA_VERSION = 1
M_PER_KM = 1e3

_COLUMNS: tuple[tuple[str, Any, str, str], ...] = (
    ("run", pa.int64(), "", "number of the run"),
    ("noise", pa.string(), "", "measurement noise: random or game"),
    ("tie", pa.string(), "", "what game noise does between equals; null under random noise"),
    ("range_meter", pa.bool_(), "", "whether there is a range meter"),
    ("miss_m", pa.float64(), "m", "least distance between the centres of mass"),
    ("impulse_m_s", pa.float64(), "m/s", "sum of the sizes of the impulses"),
    ("guaranteed_miss_m", pa.float64(), "m", "Phi; null where it is not known or was not kept"),
    ("outcome", pa.string(), "", "how the engagement ended"),
    ("truth_margin", pa.float64(), "m", "least margin of the truth in its section; null where nothing was measured"),
    ("z_km", pa.float64(), "km", "where the truth started, across"),
    ("x_km", pa.float64(), "km", "where the truth started, along"),
    ("vz_km_s", pa.float64(), "km/s", "its speed across"),
    ("vx_km_s", pa.float64(), "km/s", "its speed along"),
)
_CELL = ("cell", pa.int32(), "", "number of the cell of the sweep")
_NULLABLE = ("tie", "guaranteed_miss_m", "truth_margin")


def schema(*, with_cell: bool) -> Any:
    """Return the Arrow schema of the rows: names, types, and unit and meaning in each field's metadata."""
    columns = (_CELL, *_COLUMNS) if with_cell else _COLUMNS
    return pa.schema(
        [
            pa.field(name, kind, nullable=name in _NULLABLE, metadata={"unit": unit, "meaning": meaning})
            for name, kind, unit, meaning in columns
        ],
        metadata={"infoset_schema": str(SCHEMA_VERSION)},
    )


def rows(chunk: Chunk, results: Results, *, with_cell: bool) -> Any:
    """Return the results of a chunk as an Arrow table.

    Parameters
    ----------
    chunk : Chunk
    results : Results
        Of its runs, in their order.
    with_cell : bool
        Whether the rows say which cell of a sweep they belong to.

    Returns
    -------
    pyarrow.Table

    Raises
    ------
    FloatingPointError
        If a miss or an impulse is not a finite number.
    """
    guaranteed = results.guaranteed_miss_m
    if not np.isfinite([results.miss_m, results.impulse_m_s, guaranteed.filled(0.0)]).all():
        raise FloatingPointError(f"results of runs {results.runs[0]} to {results.runs[-1]} are not finite")
    noises = chunk.noises(results.runs)
    margin = results.truth_margin_m
    columns: dict[str, Any] = {
        "cell": np.full(len(results), chunk.cell, dtype=np.int32),
        "run": results.runs,
        "noise": [noise.value for noise in noises],
        "tie": [chunk.scenario.tie.value if noise is NoiseKind.GAME else None for noise in noises],
        "range_meter": np.full(len(results), chunk.scenario.range_sensor is not None),
        "miss_m": results.miss_m,
        "impulse_m_s": results.impulse_m_s,
        "guaranteed_miss_m": pa.array(guaranteed.filled(0.0), mask=np.ma.getmaskarray(guaranteed)),
        "outcome": [outcome.value for outcome in results.outcomes],
        "truth_margin": pa.array(np.where(np.isfinite(margin), margin, 0.0), mask=~np.isfinite(margin)),
        "z_km": results.position_m[:, 0] / M_PER_KM,
        "x_km": results.position_m[:, 1] / M_PER_KM,
        "vz_km_s": results.velocity_m_s[:, 0] / M_PER_KM,
        "vx_km_s": results.velocity_m_s[:, 1] / M_PER_KM,
    }
    wanted = schema(with_cell=with_cell)
    return pa.table({name: columns[name] for name in wanted.names}, schema=wanted)


def to_bytes(table: Any, extra: Mapping[str, str]) -> bytes:
    """Return a table as a Parquet file, with some more of its own in the metadata of the schema."""
    sink = pa.BufferOutputStream()
    whole = table.replace_schema_metadata({**(table.schema.metadata or {}), **extra})
    # Numbers drawn at random repeat nowhere: a dictionary of them only takes room.
    pq.write_table(
        whole,
        sink,
        compression="zstd",
        use_dictionary=[name for name in ("noise", "tie", "outcome") if name in table.column_names],
    )
    return bytes(sink.getvalue().to_pybytes())


def metadata(content: bytes) -> tuple[dict[str, str], int] | None:
    """Return the metadata and the number of rows of a Parquet file; None if it is none."""
    try:
        found = pq.ParquetFile(pa.BufferReader(content))
        extra = found.schema_arrow.metadata or {}
        return {key.decode(): value.decode() for key, value in extra.items()}, int(found.metadata.num_rows)
    except (pa.ArrowException, OSError, UnicodeDecodeError):
        return None


def read(files: Sequence[Path], columns: Sequence[str] | None, *, with_cell: bool) -> Any:
    """Read some columns of shards, one after the other.

    Parameters
    ----------
    files : sequence of Path
    columns : sequence of str or None
        None is all of them.
    with_cell : bool

    Returns
    -------
    pyarrow.Table
    """
    wanted = schema(with_cell=with_cell)
    names = wanted.names if columns is None else list(columns)
    whole = pa.schema([wanted.field(name) for name in names], metadata=wanted.metadata)
    parts = [pq.ParquetFile(file).read(columns=names, use_threads=False).select(names) for file in files]
    return pa.concat_tables([part.replace_schema_metadata(whole.metadata) for part in parts] or [whole.empty_table()])


def numbers(table: Any, name: str) -> np.ma.MaskedArray[tuple[int], np.dtype[np.float64]]:
    """Return a column of numbers; masked where it is null."""
    column = table.column(name)
    if not column.null_count:
        return np.ma.MaskedArray(column.to_numpy(), mask=False)
    return np.ma.MaskedArray(pc.fill_null(column, 0).to_numpy(), mask=pc.is_null(column).to_numpy())


def codes(table: Any, name: str, known: Sequence[str]) -> NDArray[np.int8]:
    """Return a column of text as places in a list of what it can say; -1 where it says none of them."""
    found = pc.index_in(table.column(name), value_set=pa.array(list(known), type=pa.string()))
    return np.asarray(pc.fill_null(found, -1).to_numpy(), dtype=np.int8)


def plain_table(columns: Mapping[str, Sequence[Any]], units: Mapping[str, str]) -> Any:
    """Return a table of numbers and text, None being null, with units in the metadata of its fields."""
    table = pa.table({name: pa.array(list(values)) for name, values in columns.items()})
    fields = [field.with_metadata({"unit": units.get(field.name, "")}) for field in table.schema]
    return table.cast(pa.schema(fields, metadata={"infoset_schema": str(SCHEMA_VERSION)}))
