"""Writing the folder of a campaign: started or resumed under a lock, filled shard by shard."""

from __future__ import annotations

import contextlib
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from sim.chunk import Chunk
from sim.results import Results
from sim.storage.campaign_folder import SHARDS, CampaignFolder, Damage, need_arrow
from sim.storage.files import (
    LOCK,
    ManifestError,
    OccupiedError,
    clear_leftovers,
    is_leftover,
    locked,
    reporting,
    write_whole,
)
from sim.storage.manifest import MANIFEST, Manifest, made_here, need_same, read_manifest, write_manifest

BEYOND = "beyond"
"""Subfolder for the shards after the run at which a stopping rule was met; they are not part of the result."""


class CampaignWriter(CampaignFolder):
    """The folder of a running campaign; created by `begin`."""

    @classmethod
    @contextlib.contextmanager
    def begin(
        cls, path: Path, manifest: Manifest, *, resume: bool, beside: Mapping[str, str] | None = None
    ) -> Iterator[CampaignWriter]:
        """Start a campaign in a folder, or resume the one in it, and hold the folder's lock until the context ends.

        More runs in the `manifest` than in the folder extend the campaign. `resume` is whether the folder may contain
        this campaign already. `beside` has names and contents of text files to write into the folder.

        Raises
        ------
        StorageError
            If the folder contains something else or a campaign with different settings, another campaign is running in
            it, or it cannot be written.
        """
        need_arrow()
        need_free(path, resume=resume)
        with reporting(path):
            path.mkdir(parents=True, exist_ok=True)
        with locked(path):
            need_free(path, resume=resume)
            clear_leftovers(path)
            stored = read_manifest(path) if (path / MANIFEST).is_file() else None
            if stored is None:
                manifest = replace(manifest, made_by=made_here())
            else:
                manifest = _continued(stored, manifest, path)
                _take_back(path / SHARDS)
                if stored.runs < manifest.runs:
                    _drop_partial_shard(path, stored)
            if stored != manifest:
                write_manifest(path, manifest)
            for name, text in (beside or {}).items():
                write_whole(path / name, text.encode())
            with reporting(path):
                (path / SHARDS / BEYOND).mkdir(parents=True, exist_ok=True)
            clear_leftovers(path / SHARDS)
            yield cls(path, manifest)

    def write(self, chunk: Chunk, results: Results) -> None:
        """Write the shard of a chunk atomically; raise FloatingPointError if the results are not finite."""
        table = self._tables.rows(chunk, results, with_cell=bool(self.manifest.axes))
        content = self._tables.to_bytes(table, {"campaign": self.manifest.identity, "chunk": str(chunk.index)})
        file = self.path / SHARDS / f"chunk-{chunk.index:07d}-{zlib.crc32(content):08x}.parquet"
        write_whole(file, content)
        self._files[chunk.index] = file

    def discard_damaged(self) -> tuple[Damage, ...]:
        """Delete and return the damaged shards, so that their chunks are simulated again; check all values for it."""
        for index, file in sorted(self._files.items()):
            try:
                self._valid(index, None)
            except (OSError, ValueError) as error:
                del self._files[index]
                self.damaged.append(Damage(file, str(error)[:200]))
        damaged, self.damaged = tuple(self.damaged), []
        for damage in damaged:
            with reporting(damage.file):
                damage.file.unlink(missing_ok=True)
        return damaged

    def stop_cells(self, runs: tuple[int, ...]) -> None:
        """Store the number of runs of each cell of a finished sweep whose cells a requirement stopped."""
        if runs != self.manifest.cell_runs:
            self.manifest = replace(self.manifest, cell_runs=runs)
            write_manifest(self.path, self.manifest)

    def stop_after(self, runs: int) -> None:
        """Store the number of runs at which a rule stopped the campaign, and move later shards to the subfolder."""
        if runs != self.manifest.stopped_after:
            self.manifest = replace(self.manifest, stopped_after=runs)
            write_manifest(self.path, self.manifest)
        for index in [index for index in self._files if not self._is_wanted(index)]:
            file = self._files.pop(index)
            with reporting(file):
                file.replace(file.parent / BEYOND / file.name)


def need_free(path: Path, *, resume: bool) -> None:
    """Raise OccupiedError if a folder has content, except a campaign to `resume`."""
    with reporting(path):
        if not path.exists() and not path.is_symlink():
            return
        if not path.is_dir():
            raise OccupiedError(f"{path}: is a file, not a folder; choose another name for the campaign's folder")
        names = [file.name for file in path.iterdir() if file.name != LOCK and not is_leftover(file)]
    if MANIFEST in names:
        if not resume:
            kind = "campaign"
            with contextlib.suppress(ManifestError):
                kind = read_manifest(path).kind
            raise OccupiedError(
                f"{path}: contains a {kind} already; continue it with --resume, or choose another folder"
            )
    elif names:
        raise OccupiedError(f"{path}: is not empty, and contains no campaign; choose another folder")


def _continued(stored: Manifest, wanted: Manifest, path: Path) -> Manifest:
    """Return the manifest of a campaign that is resumed, perhaps with more runs or another rule."""
    need_same(stored, wanted, path)
    stored = replace(stored, require=wanted.require)
    if wanted.runs == stored.runs and wanted.until == stored.until:
        return stored
    if wanted.runs < stored.runs:
        option = "--max-runs" if wanted.axes and wanted.until else "--runs"
        raise ManifestError(
            f"{path}: the {stored.kind} in this folder has {stored.runs} runs, more than {option} {wanted.runs}; give "
            f"{option} {stored.runs} or more"
        )
    # Once the number of runs may depend on the results, it may in all later sessions.
    extended = bool(stored.axes) and (stored.is_watched or wanted.is_watched or wanted.runs > stored.runs)
    return replace(stored, runs=wanted.runs, until=wanted.until, stopped_after=None, cell_runs=(), extended=extended)


def _take_back(shards: Path) -> None:
    """Move the shards of the subfolder back, because more runs or another rule may need them."""
    with reporting(shards):
        for kept in (shards / BEYOND).glob("*"):
            kept.replace(shards / kept.name)


def _drop_partial_shard(path: Path, stored: Manifest) -> None:
    """Delete the last shard of each cell if it is not full; with more runs it is written again."""
    last, rows = divmod(stored.runs, stored.chunk)
    if not rows:
        return
    with reporting(path):
        for cell in range(stored.cells):
            for file in (path / SHARDS).glob(f"chunk-{stored.index_of(cell, last):07d}-*.parquet"):
                file.unlink()
