"""The folder of a campaign: begun or resumed under a lock, filled shard by shard, read by anybody."""

from __future__ import annotations

import contextlib
import re
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.chunk import Chunk
from sim.results import Results
from sim.storage.atomic_file import clear_leftovers, is_leftover, reporting, write_whole
from sim.storage.errors import DamagedError, ManifestError, MissingLibraryError, OccupiedError
from sim.storage.folder_lock import LOCK, FolderLock
from sim.storage.manifest import MANIFEST, Manifest, made_here, need_same, read_manifest, write_manifest

Numbers = np.ma.MaskedArray[tuple[int], np.dtype[np.float64]]
Codes = NDArray[np.int8]

SHARDS = "shards"
BEYOND = "beyond"
"""Folder in the shards' for those past the point where a rule stopped: flown, but no part of the result."""

_NAME = re.compile(r"chunk-(\d{7,12})-([0-9a-f]{8})\.parquet")


@dataclass(frozen=True)
class Damage:
    """A shard that is no longer what was written, or never belonged here.

    Parameters
    ----------
    file : Path
    reason : str
    """

    file: Path
    reason: str


class CampaignFolder:
    """A campaign on disk.

    Parameters
    ----------
    path : Path
    manifest : Manifest

    Notes
    -----
    A shard is named after its chunk and the CRC-32 of its bytes, and is renamed into place once it is whole: its name
    says both that it is finished and what must be in it. No list of shards has to be kept in step with them.
    """

    def __init__(self, path: Path, manifest: Manifest) -> None:
        self.path = path
        self.manifest = manifest
        self.damaged: list[Damage] = []
        self._files: dict[int, Path] = {}
        self._sound: set[int] = set()
        self._tables = need_arrow()
        self._scan()

    @classmethod
    @contextlib.contextmanager
    def begin(
        cls, path: Path, manifest: Manifest, *, resume: bool, beside: Mapping[str, str] | None = None
    ) -> Iterator[CampaignFolder]:
        """Begin a campaign in a folder, or go on with the one in it, alone in there until leaving.

        Parameters
        ----------
        path : Path
            Made if it is not there.
        manifest : Manifest
            What is asked for. More runs than a campaign had so far extend it.
        resume : bool
            Whether to go on with what is there.
        beside : mapping of str to str
            Text files to write beside the manifest.

        Yields
        ------
        CampaignFolder

        Raises
        ------
        OccupiedError
            If the folder holds something and `resume` is not set, or another campaign is at work in it.
        ManifestError
            If it holds another campaign; the differences are shown.
        StorageError
            If it cannot be written.
        """
        need_arrow()
        need_free(path, resume=resume)
        with reporting(path):
            path.mkdir(parents=True, exist_ok=True)
        with FolderLock(path):
            need_free(path, resume=resume)
            clear_leftovers(path)
            found = read_manifest(path) if (path / MANIFEST).is_file() else None
            begun = replace(manifest, made_by=made_here())
            folder_manifest = begun if found is None else _continued(found, manifest, path)
            if found is not None:
                _take_back(path / SHARDS)
                if found.runs < folder_manifest.runs:
                    _drop_partial_shard(path, found)
            if found != folder_manifest:
                write_manifest(path, folder_manifest)
            for name, text in (beside or {}).items():
                write_whole(path / name, text.encode())
            with reporting(path):
                (path / SHARDS / BEYOND).mkdir(parents=True, exist_ok=True)
            clear_leftovers(path / SHARDS)
            yield cls(path, folder_manifest)

    @classmethod
    def read(cls, path: Path) -> CampaignFolder:
        """Open a campaign to read what there is of it, finished or not.

        Parameters
        ----------
        path : Path

        Returns
        -------
        CampaignFolder

        Raises
        ------
        ManifestError
            If there is no campaign.
        """
        need_arrow()
        return cls(path, read_manifest(path))

    @property
    def wanted_chunks_a_cell(self) -> int:
        """Shards that the wanted runs of a cell make."""
        return -(-self.manifest.wanted_runs // self.manifest.chunk)

    @property
    def chunks_a_cell(self) -> int:
        """How many chunks all runs of a cell make: from the number of one cell's first to that of the next."""
        return -(-self.manifest.runs // self.manifest.chunk)

    @property
    def finished(self) -> frozenset[int]:
        """Numbers of the chunks whose shards are here and sound."""
        return frozenset(self._files)

    @property
    def finished_runs(self) -> int:
        """Engagements of the result that are here."""
        return sum(self._size(index) for index in self._wanted())

    @property
    def wanted_runs(self) -> int:
        """Engagements of the result, over all cells."""
        return self.manifest.wanted_runs * self.manifest.cells

    @property
    def complete(self) -> bool:
        """Whether every engagement of the result is here."""
        return self.finished_runs == self.wanted_runs

    def write(self, chunk: Chunk, results: Results) -> None:
        """Write the shard of a chunk: whole or not at all.

        Parameters
        ----------
        chunk : Chunk
        results : Results

        Raises
        ------
        DiskFullError
            If there is no room.
        StorageError
            If it cannot be written.
        FloatingPointError
            If the results are not finite.
        """
        table = self._tables.rows(chunk, results, with_cell=bool(self.manifest.axes))
        content = self._tables.to_bytes(table, {"campaign": self.manifest.identity, "chunk": str(chunk.index)})
        file = self.path / SHARDS / f"chunk-{chunk.index:07d}-{zlib.crc32(content):08x}.parquet"
        write_whole(file, content)
        self._files[chunk.index] = file
        self._sound.add(chunk.index)

    def write_beside(self, name: str, content: bytes) -> None:
        """Write another file into the folder, whole or not at all."""
        write_whole(self.path / name, content)

    def table_file(self, columns: Mapping[str, Sequence[Any]], units: Mapping[str, str]) -> bytes:
        """Return a table made of the campaign as a Parquet file.

        Parameters
        ----------
        columns : mapping of str to sequence
            Numbers and text; None is null.
        units : mapping of str to str
            Of columns that have one; they stand in the metadata of its fields.

        Returns
        -------
        bytes
        """
        content: bytes = self._tables.to_bytes(
            self._tables.plain_table(columns, units), {"campaign": self.manifest.identity}
        )
        return content

    def discard_damaged(self) -> None:
        """Take the damaged shards away, so that their chunks are flown again."""
        for damage in self.damaged:
            with reporting(damage.file):
                damage.file.unlink(missing_ok=True)
        self.damaged = []

    def stop_after(self, runs: int) -> None:
        """Note after how many runs a rule has stopped the campaign, and put aside what was flown beyond.

        Parameters
        ----------
        runs : int
        """
        if runs != self.manifest.stopped_after:
            self.manifest = replace(self.manifest, stopped_after=runs)
            write_manifest(self.path, self.manifest)
        for index in [each for each in self._files if not self._is_wanted(each)]:
            file = self._files.pop(index)
            with reporting(file):
                file.replace(file.parent / BEYOND / file.name)

    def table(self, columns: Sequence[str] | None = None, cell: int | None = None) -> Any:
        """Return rows as an Arrow table, in the order of cells and runs.

        Parameters
        ----------
        columns : sequence of str or None
            None is all of them.
        cell : int or None
            None is all of them.

        Returns
        -------
        pyarrow.Table

        Raises
        ------
        DamagedError
            If a shard has changed since the folder was opened, or holds what no campaign writes.
        """
        parts = [self._read(index, columns) for index in self._wanted(cell)]
        return self._tables.joined(parts, columns, with_cell=bool(self.manifest.axes))

    def shards(
        self, quantities: Sequence[str], texts: Mapping[str, Sequence[str]], cell: int | None = None
    ) -> Iterator[tuple[dict[str, Numbers], dict[str, Codes]]]:
        """Return columns shard by shard, in the order of cells and runs: one shard is in memory at a time.

        Parameters
        ----------
        quantities : sequence of str
            Columns of numbers.
        texts : mapping of str to sequence of str
            Columns of text, each with what it can say.
        cell : int or None
            None is all of them.

        Yields
        ------
        tuple of dict
            Numbers, masked where they are null; and texts as places in the list of what they can say, -1 where they say
            none of it.

        Raises
        ------
        DamagedError
            If a shard has changed since the folder was opened, or holds what no campaign writes.
        """
        for index in self._wanted(cell):
            yield self._columns_of(index, quantities, texts)

    def sample(self, quantity: str, noise: str, cell: int | None = None) -> NDArray[np.float64]:
        """Return what is known of a quantity under a noise, in the order of cells and runs."""
        # Room for all rows: the pages that are never written cost nothing.
        found, size = np.empty(sum(self._size(index) for index in self._wanted(cell))), 0
        for numbers, codes in self.shards([quantity], {"noise": [noise]}, cell):
            (known,) = _by_noise(numbers[quantity], codes["noise"], 1)
            found[size : size + known.size] = known
            size += known.size
        return found[:size]

    def chunk_samples(self, index: int, quantity: str, noises: Sequence[str]) -> list[NDArray[np.float64]]:
        """Return what is known of a quantity in a finished chunk, a sample a noise."""
        numbers, codes = self._columns_of(index, [quantity], {"noise": noises})
        return _by_noise(numbers[quantity], codes["noise"], len(noises))

    def numbers(self, name: str, cell: int | None = None) -> Numbers:
        """Return a column of numbers, masked where it is null."""
        size = sum(self._size(index) for index in self._wanted(cell))
        values, unknown, first = np.empty(size), np.empty(size, dtype=bool), 0
        for numbers, _ in self.shards([name], {}, cell):
            part = numbers[name]
            values[first : first + part.size] = part.data
            unknown[first : first + part.size] = np.ma.getmaskarray(part)
            first += part.size
        return np.ma.MaskedArray(values, mask=unknown)

    def codes(self, name: str, known: Sequence[str], cell: int | None = None) -> Codes:
        """Return a column of text as places in a list of what it can say; -1 where it says none of them."""
        parts = [codes[name] for _, codes in self.shards([], {name: known}, cell)]
        return np.concatenate(parts) if parts else np.zeros(0, dtype=np.int8)

    def at(self, places: Sequence[int], cell: int | None = None) -> list[dict[str, Any]]:
        """Return whole rows at some places of the columns, as mappings by column."""
        shards = self._wanted(cell)
        starts = np.concatenate([[0], np.cumsum([self._size(index) for index in shards])])
        rows = []
        for place in places:
            shard = int(np.searchsorted(starts, place, side="right")) - 1
            rows.append(self._read(shards[shard], None).slice(int(place - starts[shard]), 1).to_pylist()[0])
        return rows

    def _columns_of(
        self, index: int, quantities: Sequence[str], texts: Mapping[str, Sequence[str]]
    ) -> tuple[dict[str, Numbers], dict[str, Codes]]:
        table = self._read(index, [*quantities, *texts])
        return (
            {name: self._tables.numbers(table, name) for name in quantities},
            {name: self._tables.codes(table, name, known) for name, known in texts.items()},
        )

    def _read(self, index: int, columns: Sequence[str] | None) -> Any:
        """Some columns of a shard, None being all; when it is read first, all of its values are checked."""
        file, with_cell = self._files[index], bool(self.manifest.axes)
        try:
            if index in self._sound:
                return self._tables.read(file, columns, with_cell=with_cell)
            table = self._tables.read(file, None, with_cell=with_cell)
            cell, place = divmod(index, self.chunks_a_cell)
            first = place * self.manifest.chunk
            self._tables.need_sound(table, range(first, first + self._size(index)), cell)
            self._sound.add(index)
            return table if columns is None else table.select(list(columns))
        except (OSError, ValueError) as error:
            raise DamagedError(
                f"{file}: a shard has changed or gone: {str(error)[:200]}; delete it, and fly its runs again with "
                "--resume"
            ) from None

    def _size(self, index: int) -> int:
        first = index % self.chunks_a_cell * self.manifest.chunk
        return min(self.manifest.chunk, self.manifest.runs - first)

    def _is_wanted(self, index: int) -> bool:
        cell, place = divmod(index, self.chunks_a_cell)
        return place < self.wanted_chunks_a_cell and cell < self.manifest.cells

    def _wanted(self, cell: int | None = None) -> list[int]:
        found: Iterable[int] = sorted(self._files)
        return [each for each in found if self._is_wanted(each) and cell in (None, each // self.chunks_a_cell)]

    def _scan(self) -> None:
        """Find the sound shards, and those that are not."""
        folder = self.path / SHARDS
        if not folder.is_dir():
            return
        with reporting(folder):
            names = sorted(folder.iterdir())
        for file in names:
            matched = _NAME.fullmatch(file.name)
            if matched is None:
                continue
            index = int(matched[1])
            reason = self._unsound(file, index, int(matched[2], 16))
            if reason is None:
                self._files[index] = file
            else:
                self.damaged.append(Damage(file, reason))

    def _unsound(self, file: Path, index: int, checksum: int) -> str | None:
        """What is wrong with a shard, or None."""
        rows = self._size(index)
        try:
            if not file.is_file():
                return "is no ordinary file"
            if rows < 1 or index >= self.chunks_a_cell * self.manifest.cells:
                return "is of no chunk of this campaign"
            size, most = file.stat().st_size, self._tables.largest_file(rows)
            if size > most:
                return f"has {size} bytes, more than any shard of {rows} rows"
            content = file.read_bytes()
        except OSError as error:
            return f"cannot be read: {error.strerror}"
        if zlib.crc32(content) != checksum:
            return f"is cut short or changed: {len(content)} bytes whose checksum is not the one of its name"
        told = {"campaign": self.manifest.identity, "chunk": str(index)}
        reason: str | None = self._tables.fault(content, told, rows, with_cell=bool(self.manifest.axes))
        return reason


def _by_noise(values: Numbers, places: Codes, noises: int) -> list[NDArray[np.float64]]:
    """What is known of the values of each noise."""
    known = ~np.ma.getmaskarray(values)
    return [values.data[known & (places == place)] for place in range(noises)]


def need_arrow() -> ModuleType:
    """Return the module that reads and writes tables, or say what to install.

    Returns
    -------
    module

    Raises
    ------
    MissingLibraryError
        If pyarrow is not installed.
    """
    try:
        from sim.storage import tables
    except ImportError:
        raise MissingLibraryError(
            "campaigns are stored with pyarrow, which is not installed; install the extra: pip install "
            "'infoset[campaign]'"
        ) from None
    return tables


def need_free(path: Path, *, resume: bool) -> None:
    """Refuse a folder that holds something else, or a campaign that is not to be resumed.

    Parameters
    ----------
    path : Path
    resume : bool
        Whether to go on with a campaign that it holds.

    Raises
    ------
    OccupiedError
        If it does.
    """
    with reporting(path):
        if not path.exists() and not path.is_symlink():
            return
        if not path.is_dir():
            raise OccupiedError(f"{path}: is a file, not a folder; choose another name for the campaign's folder")
        strange = [each.name for each in path.iterdir() if each.name != LOCK and not is_leftover(each)]
    if MANIFEST in strange:
        if not resume:
            raise OccupiedError(f"{path}: holds a campaign already; go on with --resume, or choose another folder")
    elif strange:
        raise OccupiedError(f"{path}: is not empty, and holds no campaign; choose another folder")


def _continued(found: Manifest, given: Manifest, path: Path) -> Manifest:
    """The manifest of a campaign that goes on; it may have grown."""
    need_same(found, given, path)
    if given.runs == found.runs and given.until == found.until:
        return found
    if given.runs < found.runs:
        raise ManifestError(
            f"{path}: is another campaign than the one asked for: it has {found.runs} runs, now {given.runs} are asked "
            "for; give as many or more"
        )
    if given.axes and given.runs != found.runs:
        raise ManifestError(
            f"{path}: is another sweep than the one asked for: it has {found.runs} runs a cell, now {given.runs}; give "
            "as many, or choose another folder"
        )
    return replace(found, runs=given.runs, until=given.until, stopped_after=None)


def _take_back(shards: Path) -> None:
    """Put back what a rule put aside: it may be wanted now, and the shard that is not full may be among it."""
    with reporting(shards):
        for kept in (shards / BEYOND).glob("*"):
            kept.replace(shards / kept.name)


def _drop_partial_shard(path: Path, found: Manifest) -> None:
    """Take the last shard of a campaign away if it is not full: with more runs it will be."""
    last, rows = divmod(found.runs, found.chunk)
    if not rows:
        return
    with reporting(path):
        for file in (path / SHARDS).glob(f"chunk-{last:07d}-*.parquet"):
            file.unlink()
