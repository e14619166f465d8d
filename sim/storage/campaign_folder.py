"""The folder of a campaign: a manifest, and a file of runs for each chunk."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from infoset.sim.results import Results
from infoset.sim.storage.files import (
    LOCK,
    StorageError,
    is_leftover,
    locked,
    reporting,
    write_whole,
)
from infoset.sim.storage.manifest import MANIFEST, Manifest, read_manifest

if TYPE_CHECKING:
    import pandas as pd

SHARDS = "shards"
"""Name of the folder with the files of runs, in the folder of a campaign."""


class CampaignFolder:
    """The stored runs of a campaign or a sweep, finished or not.

    A file is named after its cell and its runs, and is renamed into place once it is complete: the
    folder needs no list of its files.
    """

    def __init__(self, path: Path, manifest: Manifest) -> None:
        self.path = path
        self.manifest = manifest
        shards = path / SHARDS
        self._identity = manifest.identity
        with reporting(shards):
            self._names = {file.name for file in shards.iterdir()} if shards.is_dir() else set()

    def __repr__(self) -> str:
        manifest = self.manifest
        cells = f", {self.manifest.cells} cells" if self.manifest.axes else ""
        return (
            f"<{manifest.kind} of {manifest.scenario.name} in {self.path}: {manifest.strategy}, "
            f"{manifest.noise.value} noise, seed {manifest.seed}{cells}, {self.finished_runs} of "
            f"{self.wanted_runs} runs stored>"
        )

    @classmethod
    def read(cls, path: Path) -> CampaignFolder:
        """Open a folder; StorageError if it contains no campaign."""
        return cls(path, read_manifest(path))

    def has(self, cell: int, runs: Sequence[int]) -> bool:
        """Return whether a chunk with exactly these runs is stored."""
        return _name(cell, runs) in self._names

    @property
    def stored_runs(self) -> list[int]:
        """Engagements of the result that are stored, by cell."""
        return [sum(len(runs) for _, runs in chunks) for chunks in self.stored_chunks()]

    @property
    def finished_runs(self) -> int:
        """Engagements of the result that are stored."""
        return sum(self.stored_runs)

    @property
    def wanted_runs(self) -> int:
        """Engagements of the result, over all cells."""
        return sum(map(self.manifest.wanted_runs, range(self.manifest.cells)))

    @property
    def complete(self) -> bool:
        """Whether every engagement of the result is stored."""
        return self.finished_runs == self.wanted_runs

    def runs(self, columns: Sequence[str] | None = None, cell: int | None = None) -> pd.DataFrame:
        """Return the stored runs, in the order of cells and runs.

        None is all columns, or all cells. Unknown numbers are NaN, unknown flags NA. A
        StorageError, which names the file, is raised if a file cannot be read.
        """
        stored = self.stored_chunks()
        chosen = [chunks for number, chunks in enumerate(stored) if cell in (None, number)]
        return self.read_chunks(itertools.chain(*chosen), columns)

    def stored_chunks(self) -> list[list[tuple[int, range]]]:
        """Return the cells and runs of the stored chunks, by cell and in the order of the runs."""
        stored: list[list[tuple[int, range]]] = [[] for _ in range(self.manifest.cells)]
        for cell, runs in self.manifest.chunks():
            if self.has(cell, runs):
                stored[cell].append((cell, runs))
        return stored

    def read_chunks(
        self, chunks: Iterable[tuple[int, Sequence[int]]], columns: Sequence[str] | None = None
    ) -> pd.DataFrame:
        """Return some columns of stored chunks, one after the other; see `runs`."""
        names = [_name(*chunk) for chunk in chunks]
        files = {self.path / SHARDS / name: self._metadata(name) for name in names}
        from infoset.sim.storage import tables

        return tables.read(files, columns)

    @classmethod
    @contextlib.contextmanager
    def begin(cls, path: Path, manifest: Manifest, *, resume: bool) -> Iterator[CampaignFolder]:
        """Start or resume a campaign in a folder, and hold the folder's lock in the context.

        More runs in the `manifest` than in the folder extend the campaign. `resume` is whether the
        folder may contain this campaign already. A StorageError is raised if the folder contains
        something else or a campaign with different settings, another campaign is running in it, or
        it cannot be written.
        """
        from infoset.sim.storage import tables  # noqa: F401 (fails at once if a library is missing)

        need_free(path, resume=resume)
        with reporting(path):
            path.mkdir(parents=True, exist_ok=True)
        with locked(path):
            with reporting(path):
                if (path / MANIFEST).is_file():
                    stored = read_manifest(path)
                    manifest = stored.continued(manifest, path)
                    # With more runs, the last chunk of a cell is a larger one.
                    for name in _names(stored) - _names(manifest):
                        (path / SHARDS / name).unlink(missing_ok=True)
                manifest.write(path)
                (path / SHARDS).mkdir(exist_ok=True)
                for file in filter(is_leftover, [*path.iterdir(), *(path / SHARDS).iterdir()]):
                    file.unlink()
            yield cls(path, manifest)

    def write(self, cell: int, runs: Sequence[int], results: Results) -> None:
        """Write the file of a chunk atomically."""
        from infoset.sim.storage import tables

        name = _name(cell, runs)
        content = tables.to_bytes(results, cell, self.manifest.noise, self._metadata(name))
        write_whole(self.path / SHARDS / name, content)
        self._names.add(name)

    def stop(self, cell_runs: tuple[int, ...]) -> None:
        """Store the number of runs of each cell after a rule has stopped some of them."""
        self.manifest = replace(self.manifest, cell_runs=cell_runs)
        self.manifest.write(self.path)

    def _metadata(self, name: str) -> dict[str, str]:
        return {"campaign": self._identity, "name": name}


def _names(manifest: Manifest) -> set[str]:
    """Return the names of the files of all chunks, also after a rule has stopped a cell."""
    return {_name(*chunk) for chunk in replace(manifest, cell_runs=()).chunks()}


def _name(cell: int, runs: Sequence[int]) -> str:
    """Return the name of the file of a chunk.

    Leading zeros put names into the order of cells, of which there are at most `MAX_CELLS`, and
    runs.
    """
    return f"cell-{cell:05d}-runs-{runs[0]:08d}-{runs[-1]:08d}.parquet"


def need_free(path: Path, *, resume: bool) -> None:
    """Raise StorageError if a folder has content, except a campaign to `resume`.

    The lock and temporary files of a process that died do not count.
    """
    with reporting(path):
        if not path.exists():
            return
        if not path.is_dir():
            raise StorageError(
                f"{path}: is a file, not a folder; choose another name for the campaign's folder"
            )
        names = {file.name for file in path.iterdir() if not is_leftover(file)} - {LOCK}
    if MANIFEST in names and not resume:
        raise StorageError(
            f"{path}: contains a campaign already; continue it with --resume, or choose another "
            "folder"
        )
    if names and MANIFEST not in names:
        raise StorageError(f"{path}: is not empty, and contains no campaign; choose another folder")
