"""Reading the folder of a campaign, finished or not."""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from infoset.arrays import Floats
from sim.storage.files import DamagedError, MissingLibraryError, reporting
from sim.storage.manifest import Manifest, read_manifest
from sim.versions import install_command

Numbers = np.ma.MaskedArray[tuple[int], np.dtype[np.float64]]
Codes = NDArray[np.int8]

SHARDS = "shards"
_NAME = re.compile(r"chunk-(\d{7,12})-([0-9a-f]{8})\.parquet")


@dataclass(frozen=True)
class Damage:
    """A damaged shard, or one that belongs to another campaign."""

    file: Path
    reason: str


class CampaignFolder:
    """The stored runs of a campaign or a sweep; `damaged` lists shards that were left out.

    A shard is named after its chunk and the CRC-32 of its bytes, and is renamed into place once it is complete: the
    folder needs no list of its shards. When a shard is first read, all its values are checked.
    """

    def __init__(self, path: Path, manifest: Manifest) -> None:
        self.path = path
        self.manifest = manifest
        self.damaged: list[Damage] = []
        self._files: dict[int, Path] = {}
        self._checked: set[int] = set()
        self._tables = need_arrow()
        self._scan()

    @classmethod
    def read(cls, path: Path) -> CampaignFolder:
        """Open a folder; raise `ManifestError` if it holds no campaign."""
        need_arrow()
        return cls(path, read_manifest(path))

    @property
    def finished(self) -> frozenset[int]:
        """Numbers of the chunks that are stored and undamaged."""
        return frozenset(self._files)

    def has(self, index: int) -> bool:
        """Return whether a chunk is stored and undamaged."""
        return index in self._files

    @property
    def finished_runs(self) -> int:
        """Engagements of the result that are stored."""
        return self._rows(None)

    @property
    def wanted_runs(self) -> int:
        """Engagements of the result, over all cells."""
        return sum(map(self.manifest.wanted_runs, range(self.manifest.cells)))

    @property
    def complete(self) -> bool:
        """Whether every engagement of the result is stored."""
        return self.finished_runs == self.wanted_runs

    def table(self, columns: Sequence[str] | None = None, cell: int | None = None) -> Any:
        """Return rows as a pyarrow.Table, in the order of cells and runs; None is all columns, or all cells.

        A DamagedError is raised if a shard has changed since the folder was opened.
        """
        parts = [self._read(index, columns) for index in self._wanted(cell)]
        return self._tables.joined(parts, columns, with_cell=bool(self.manifest.axes))

    def runs(self, columns: Sequence[str] | None = None, cell: int | None = None) -> Any:
        """Return the stored runs as a pandas.DataFrame, in the order of cells and runs; None is all of them."""
        frame = self._tables.frame(self.table(cell=cell), guarantees=self.manifest.scenario.set_model.is_guaranteed)
        return frame if columns is None else frame[list(columns)]

    def shards(
        self, quantities: Sequence[str], texts: Mapping[str, Sequence[str]], cell: int | None = None
    ) -> Iterator[tuple[dict[str, Numbers], dict[str, Codes]]]:
        """Yield columns shard by shard, in the order of cells and runs; one shard is in memory at a time.

        Columns of numbers are masked where null. `texts` has a list of values for each column of text: the codes are
        indices in the list, -1 for other values. A DamagedError is raised if a shard has changed since the folder was
        opened.
        """
        for index in self._wanted(cell):
            yield self._columns_of(index, quantities, texts)

    def sample(self, quantity: str, noise: str, cell: int | None = None, *, unknown: float | None = None) -> Floats:
        """Return the values of a quantity under a noise, in the order of cells and runs.

        Runs without a value have the value `unknown`; None omits them.
        """
        # Room for all rows: the pages of memory that are never written cost nothing.
        values, size = np.empty(self._rows(cell)), 0
        for numbers, codes in self.shards([quantity], {"noise": [noise]}, cell):
            (part,) = _by_noise(numbers[quantity], codes["noise"], 1, unknown)
            values[size : size + part.size] = part
            size += part.size
        return values[:size]

    def chunk_samples(
        self, index: int, quantity: str, noises: Sequence[str], *, unknown: float | None = None
    ) -> list[Floats]:
        """Return the values of a quantity in one chunk, an array for each noise, as in `sample`."""
        numbers, codes = self._columns_of(index, [quantity], {"noise": noises})
        return _by_noise(numbers[quantity], codes["noise"], len(noises), unknown)

    def numbers(self, name: str, cell: int | None = None) -> Numbers:
        """Return a column of numbers, masked where it is null."""
        column: Numbers = np.ma.MaskedArray(np.empty(self._rows(cell)), mask=True)
        first = 0
        for numbers, _ in self.shards([name], {}, cell):
            column[first : first + numbers[name].size] = numbers[name]
            first += numbers[name].size
        return column

    def codes(self, name: str, known: Sequence[str], cell: int | None = None) -> Codes:
        """Return a column of text as indices in a list of values; -1 for other values."""
        parts = [codes[name] for _, codes in self.shards([], {name: known}, cell)]
        return np.concatenate([np.zeros(0, dtype=np.int8), *parts])

    def at(self, indices: Sequence[int], cell: int | None = None) -> list[dict[str, Any]]:
        """Return whole rows, as mappings by column, at some indices of the columns."""
        shards = self._wanted(cell)
        starts = np.concatenate([[0], np.cumsum([self._size(index) for index in shards])])
        rows = []
        for index in indices:
            shard = int(np.searchsorted(starts, index, side="right")) - 1
            rows.append(self._read(shards[shard], None).slice(int(index - starts[shard]), 1).to_pylist()[0])
        return rows

    def table_file(self, columns: Mapping[str, Sequence[Any]], units: Mapping[str, str]) -> bytes:
        """Return the Parquet file of a table derived from the campaign, of numbers and text; None is null.

        The `units` are in the metadata of the fields, as in the shards.
        """
        table = self._tables.plain_table(columns, units)
        return bytes(self._tables.to_bytes(table, {"campaign": self.manifest.identity}))

    def _columns_of(
        self, index: int, quantities: Sequence[str], texts: Mapping[str, Sequence[str]]
    ) -> tuple[dict[str, Numbers], dict[str, Codes]]:
        table = self._read(index, [*quantities, *texts])
        return (
            {name: self._tables.numbers(table, name) for name in quantities},
            {name: self._tables.codes(table, name, known) for name, known in texts.items()},
        )

    def _read(self, index: int, columns: Sequence[str] | None) -> Any:
        """Return some columns of a shard, None being all; raise DamagedError if it has changed."""
        try:
            return self._valid(index, columns)
        except (OSError, ValueError) as error:
            raise DamagedError(
                f"{self._files[index]}: the shard has changed or is missing: {str(error)[:200]}; delete it, and "
                "simulate its runs again with --resume"
            ) from None

    def _valid(self, index: int, columns: Sequence[str] | None) -> Any:
        """Return some columns of a shard, None being all; the first reading checks the values of all columns."""
        file, with_cell = self._files[index], bool(self.manifest.axes)
        if index in self._checked:
            return self._tables.read(file, columns, with_cell=with_cell)
        table = self._tables.read(file, None, with_cell=with_cell)
        cell, runs = self.manifest.runs_of(index)
        self._tables.need_valid(table, runs, cell)
        self._checked.add(index)
        return table if columns is None else table.select(list(columns))

    def _size(self, index: int) -> int:
        return len(self.manifest.runs_of(index)[1])

    def _rows(self, cell: int | None) -> int:
        return sum(self._size(index) for index in self._wanted(cell))

    def _is_wanted(self, index: int) -> bool:
        cell, runs = self.manifest.runs_of(index)
        return runs.start < self.manifest.wanted_runs(cell)

    def _wanted(self, cell: int | None = None) -> list[int]:
        """Return the stored chunks of the result, in the order of cells and runs."""
        cells = {index: self.manifest.runs_of(index)[0] for index in self._files if self._is_wanted(index)}
        return sorted(
            (index for index in cells if cell in (None, cells[index])), key=lambda index: (cells[index], index)
        )

    def _scan(self) -> None:
        """Find the undamaged shards, and list the others in `damaged`."""
        folder = self.path / SHARDS
        if not folder.is_dir():
            return
        with reporting(folder):
            files = sorted(folder.iterdir())
        for file in files:
            matched = _NAME.fullmatch(file.name)
            if matched is None:
                continue
            index = int(matched[1])
            fault = self._fault(file, index, int(matched[2], 16))
            if fault is None:
                self._files[index] = file
            else:
                self.damaged.append(Damage(file, fault))

    def _fault(self, file: Path, index: int, checksum: int) -> str | None:
        """Return a description of the damage of a shard; None if there is none."""
        try:
            if index >= self.manifest.chunks:
                return "is not a chunk of this campaign"
            if not file.is_file():
                return "is not an ordinary file"
            rows, size = self._size(index), file.stat().st_size
            if size > self._tables.BYTES_BESIDE_ROWS + self._tables.MAX_BYTES_A_ROW * rows:
                return f"has {size} bytes, more than any shard of {rows} rows"
            content = file.read_bytes()
        except OSError as error:
            return f"cannot be read: {error.strerror}"
        if zlib.crc32(content) != checksum:
            return f"is truncated or changed: the checksum of its {len(content)} bytes differs from the one in its name"
        wanted = {"campaign": self.manifest.identity, "chunk": str(index)}
        fault: str | None = self._tables.fault(content, wanted, rows, with_cell=bool(self.manifest.axes))
        return fault


def _by_noise(values: Numbers, codes: Codes, noises: int, unknown: float | None) -> list[Floats]:
    samples = [values[codes == code] for code in range(noises)]
    return [sample.compressed() if unknown is None else sample.filled(unknown) for sample in samples]


def need_arrow() -> ModuleType:
    """Return the module that reads and writes tables; raise MissingLibraryError if pyarrow is not installed."""
    try:
        from sim.storage import tables
    except ImportError:
        raise MissingLibraryError(
            f"campaigns are stored with pyarrow, which is not installed: {install_command('campaign')}"
        ) from None
    return tables
