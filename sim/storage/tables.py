"""Files of runs, written as Arrow tables and read as pandas frames. Only this imports pyarrow."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import Enum
from pathlib import Path

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from infoset.sim.columns import Column, columns_of, values_of
from infoset.sim.parallel import CampaignNoise
from infoset.sim.results import Results
from infoset.sim.storage.files import StorageError

_RUN, *_OTHERS = columns_of(Results)
_COLUMNS = (
    Column("cell", "", "Cell number in the sweep; 0 in a campaign", int),
    _RUN,
    Column("noise", "", "Measurement noise", CampaignNoise),
    *_OTHERS,
)


def _type(column: Column) -> pa.DataType:
    if issubclass(column.kind, Enum):
        return pa.dictionary(pa.int32(), pa.string())
    return {int: pa.int64(), float: pa.float64(), bool: pa.bool_()}[column.kind]


SCHEMA = pa.schema(
    pa.field(
        column.name,
        _type(column),
        column.nullable,
        {"unit": column.unit, "meaning": column.meaning},
    )
    for column in _COLUMNS
)


def to_bytes(
    results: Results, cell: int, noise: CampaignNoise, metadata: Mapping[str, str]
) -> bytes:
    """Return results of a cell as a Parquet file, with `metadata` in its schema."""
    values = {column.name: values_of(results, column) for column in columns_of(Results)}
    values["cell"] = [cell] * len(results)
    values["noise"] = [noise.of_run(run).value for run in results.runs.tolist()]
    table = pa.table(values, SCHEMA.with_metadata(metadata))
    sink = pa.BufferOutputStream()
    # Only texts repeat: a dictionary of random numbers would need more space.
    texts = [field.name for field in SCHEMA if pa.types.is_dictionary(field.type)]
    pq.write_table(table, sink, compression="zstd", use_dictionary=texts, write_page_checksum=True)
    return bytes(sink.getvalue().to_pybytes())


def read(
    files: Mapping[Path, Mapping[str, str]], columns: Sequence[str] | None = None
) -> pd.DataFrame:
    """Return some columns of all files, one after the other; None is all columns.

    Each file must have the schema and its metadata in `files`. A StorageError, which names the
    file, is raised if a file cannot be read, or its schema or metadata differ.
    """
    names = SCHEMA.names if columns is None else list(columns)
    parts = [pa.schema([SCHEMA.field(name) for name in names]).empty_table()]
    for file, metadata in files.items():
        try:
            parts.append(_table(file, metadata, names))
        except (pa.ArrowException, OSError, ValueError) as error:
            raise StorageError(
                f"{file}: cannot be read: {str(error)[:200]}; delete it, and simulate its runs "
                "again with --resume"
            ) from None
    table = pa.concat_tables(parts)
    # Without other references, the memory of each column is free once pandas has its copy.
    parts.clear()
    frame = table.to_pandas(
        types_mapper={pa.bool_(): pd.BooleanDtype()}.get, split_blocks=True, self_destruct=True
    )
    # Arrow keeps freed memory: here as much as the frame needs.
    pa.default_memory_pool().release_unused()
    return frame


def _table(file: Path, metadata: Mapping[str, str], names: Sequence[str]) -> pa.Table:
    wanted = {key.encode(): value.encode() for key, value in metadata.items()}
    # A dataset of pyarrow reads the same, and takes twice as long for each file.
    with pq.ParquetFile(file, page_checksum_verification=True) as stored:
        found = stored.schema_arrow
        if not found.equals(SCHEMA) or found.metadata != wanted:
            raise ValueError("it is no file of runs of this campaign")
        return stored.read(names)
