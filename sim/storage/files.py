"""Files of a campaign's folder: atomic writes, and a lock for one campaign at a time."""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
from collections.abc import Iterator
from pathlib import Path

from filelock import FileLock, Timeout

LOCK = ".lock"
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT)


class StorageError(Exception):
    """The folder of a campaign cannot be used; the message gives the problem, the folder and a remedy."""


class MissingLibraryError(StorageError):
    """The library that reads and writes campaigns is not installed."""


class OccupiedError(StorageError):
    """The folder contains something else, or another campaign is running in it."""


class ManifestError(StorageError):
    """The manifest is damaged, or belongs to a campaign with different settings."""


class DamagedError(StorageError):
    """A shard has changed since it was written."""


class DiskFullError(StorageError):
    """The disk is full; files written before are complete."""


def replace_file(file: Path, content: bytes) -> None:
    """Write a file atomically: if the process or the machine stops, the file is complete or unchanged.

    The content is written to a temporary file in the same folder and flushed to the disk; then the file is renamed,
    which is atomic, and the folder is flushed so that the new name is on the disk too. Raises `OSError`; the file is
    then unchanged.
    """
    temporary = temporary_beside(file)
    try:
        with temporary.open("xb") as stream:
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
        temporary.replace(file)
    finally:
        with contextlib.suppress(OSError, ValueError):
            temporary.unlink(missing_ok=True)
    if os.name == "posix":  # other systems cannot open a folder
        descriptor = os.open(file.parent, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def temporary_beside(file: Path) -> Path:
    """Return a short unused name in the folder of a file."""
    return file.parent / f".infoset-{os.getpid()}-{secrets.token_hex(4)}.tmp"


def write_whole(file: Path, content: bytes) -> None:
    """Call `replace_file`, and raise its errors as `StorageError` (`DiskFullError` if the disk is full)."""
    with reporting(file):
        replace_file(file, content)


def is_leftover(file: Path) -> bool:
    """Whether a file is a temporary one of `replace_file`."""
    return file.name.startswith(".infoset-") and file.name.endswith(".tmp")


def clear_leftovers(folder: Path) -> None:
    """Delete the temporary files of processes that died while writing; call it under the folder's lock only."""
    for leftover in filter(is_leftover, folder.iterdir()):
        with contextlib.suppress(OSError):
            leftover.unlink()


@contextlib.contextmanager
def reporting(path: Path) -> Iterator[None]:
    """Raise an `OSError` during reading or writing of `path` as a StorageError with a message for the user.

    It is a DiskFullError if the disk is full.
    """
    try:
        yield
    except OSError as error:
        if error.errno in _NO_ROOM:
            raise DiskFullError(
                f"{path}: the disk is full; the files in the folder are complete: free some space and run again with "
                "--resume"
            ) from None
        raise StorageError(f"{path}: {error.strerror or error}; check the folder and the disk") from None


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the lock of a folder; raise OccupiedError if another campaign holds it.

    The lock ends with the process at the latest. A forked child would keep the lock after its parent has ended: use
    process pools that spawn.
    """
    with contextlib.ExitStack() as stack, reporting(folder / LOCK):
        try:
            stack.enter_context(FileLock(folder / LOCK, timeout=0))
        except Timeout:
            raise OccupiedError(
                f"{folder}: another campaign is running in this folder; wait for it, or choose another folder"
            ) from None
        release = stack.pop_all()
    with release:
        yield
