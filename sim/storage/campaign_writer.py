"""Writing the folder of a campaign: started or resumed under a lock, filled shard by shard."""

from __future__ import annotations

import contextlib
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from sim.chunk import Chunk
from sim.results import Results
from sim.storage.campaign_folder import SHARDS, CampaignFolder, need_arrow
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
"""Folder in that of the shards for those after the run where a rule stopped: flown, but no part of the result."""


class CampaignWriter(CampaignFolder):
    """The folder of a campaign that is being flown; made by `begin`."""

    @classmethod
    @contextlib.contextmanager
    def begin(
        cls, path: Path, manifest: Manifest, *, resume: bool, beside: Mapping[str, str] | None = None
    ) -> Iterator[CampaignWriter]:
        """Start a campaign in a folder, or resume the one in it, and hold the folder's lock until leaving.

        Parameters
        ----------
        path : Path
            Made if it does not exist.
        manifest : Manifest
            The campaign wanted; more runs than the folder's campaign extend it.
        resume : bool
            Whether the folder may hold this campaign already.
        beside : mapping of str to str
            Names and contents of text files to write into the folder.

        Raises
        ------
        OccupiedError
            If the folder holds something else, or another campaign is running in it.
        ManifestError
            If it holds a campaign with different settings.
        StorageError
            If it cannot be written.
        """
        need_arrow()
        need_free(path, resume=resume)
        with reporting(path):
            path.mkdir(parents=True, exist_ok=True)
        with locked(path):
            need_free(path, resume=resume)
            clear_leftovers(path)
            found = read_manifest(path) if (path / MANIFEST).is_file() else None
            if found is None:
                manifest = replace(manifest, made_by=made_here())
            else:
                manifest = _continued(found, manifest, path)
                _take_back(path / SHARDS)
                if found.runs < manifest.runs:
                    _drop_partial_shard(path, found)
            if found != manifest:
                write_manifest(path, manifest)
            for name, text in (beside or {}).items():
                write_whole(path / name, text.encode())
            with reporting(path):
                (path / SHARDS / BEYOND).mkdir(parents=True, exist_ok=True)
            clear_leftovers(path / SHARDS)
            yield cls(path, manifest)

    def write(self, chunk: Chunk, results: Results) -> None:
        """Write the shard of a chunk, whole or not at all.

        Raises
        ------
        StorageError
            If it cannot be written; `DiskFullError` where the disk is full.
        FloatingPointError
            If the results are not finite.
        """
        table = self._tables.rows(chunk, results, with_cell=bool(self.manifest.axes))
        content = self._tables.to_bytes(table, {"campaign": self.manifest.identity, "chunk": str(chunk.index)})
        file = self.path / SHARDS / f"chunk-{chunk.index:07d}-{zlib.crc32(content):08x}.parquet"
        write_whole(file, content)
        self._files[chunk.index] = file
        self._checked.add(chunk.index)

    def discard_damaged(self) -> None:
        """Delete the damaged shards, so that their chunks are flown again."""
        for damage in self.damaged:
            with reporting(damage.file):
                damage.file.unlink(missing_ok=True)
        self.damaged = []

    def stop_after(self, runs: int) -> None:
        """Note that a rule has stopped the campaign after some runs, and move the shards beyond them aside."""
        if runs != self.manifest.stopped_after:
            self.manifest = replace(self.manifest, stopped_after=runs)
            write_manifest(self.path, self.manifest)
        for index in [index for index in self._files if not self._is_wanted(index)]:
            file = self._files.pop(index)
            with reporting(file):
                file.replace(file.parent / BEYOND / file.name)


def need_free(path: Path, *, resume: bool) -> None:
    """Check that a folder is empty or does not exist, or, on a resume, holds a campaign.

    Raises
    ------
    OccupiedError
        If it holds something else.
    """
    with reporting(path):
        if not path.exists() and not path.is_symlink():
            return
        if not path.is_dir():
            raise OccupiedError(f"{path}: is a file, not a folder; choose another name for the campaign's folder")
        names = [file.name for file in path.iterdir() if file.name != LOCK and not is_leftover(file)]
    if MANIFEST in names:
        if not resume:
            raise OccupiedError(
                f"{path}: holds a campaign already; continue it with --resume, or choose another folder"
            )
    elif names:
        raise OccupiedError(f"{path}: is not empty, and holds no campaign; choose another folder")


def _continued(found: Manifest, asked: Manifest, path: Path) -> Manifest:
    """Return the manifest of a campaign that is resumed, perhaps with more runs or another rule."""
    need_same(found, asked, path)
    if asked.runs == found.runs and asked.until == found.until:
        return found
    if asked.runs < found.runs:
        raise ManifestError(
            f"{path}: the campaign in this folder has {found.runs} runs, and {asked.runs} are asked for; give --runs "
            f"{found.runs} or more"
        )
    if asked.axes and asked.runs != found.runs:
        raise ManifestError(
            f"{path}: the sweep in this folder has {found.runs} runs a cell, and {asked.runs} are asked for; give "
            f"--runs {found.runs}, or choose another folder"
        )
    return replace(found, runs=asked.runs, until=asked.until, stopped_after=None)


def _take_back(shards: Path) -> None:
    """Move back the shards that a rule moved aside: they may be wanted now."""
    with reporting(shards):
        for kept in (shards / BEYOND).glob("*"):
            kept.replace(shards / kept.name)


def _drop_partial_shard(path: Path, found: Manifest) -> None:
    """Delete the last shard of a campaign if it is not full: with more runs it will be."""
    last, rows = divmod(found.runs, found.chunk)
    if not rows:
        return
    with reporting(path):
        for file in (path / SHARDS).glob(f"chunk-{last:07d}-*.parquet"):
            file.unlink()
