"""Files of a campaign's folder: written whole or not at all, by one campaign at a time."""

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
    """A campaign's folder cannot be used as asked; the message says what, where, and what to do."""


class MissingLibraryError(StorageError):
    """The library that reads and writes campaigns is not installed."""


class OccupiedError(StorageError):
    """The folder holds something else, or another campaign is running in it."""


class ManifestError(StorageError):
    """The manifest is damaged, or belongs to a campaign with different settings."""


class DamagedError(StorageError):
    """A shard is no longer what was written."""


class DiskFullError(StorageError):
    """The disk is full; files written before are complete."""


def replace_file(file: Path, content: bytes) -> None:
    """Write a file whole or not at all, whenever the process or the machine stops.

    The content goes to a temporary file in the same folder and is flushed to the disk; then the file is renamed, which
    is atomic, and the folder is flushed so that the new name is on the disk too. Raises `OSError`; the file is then
    what it was.
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
    """Do as `replace_file`, but raise `StorageError` (`DiskFullError` where the disk is full)."""
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
    """Turn an `OSError` while `path` is read or written into a message for the user.

    Raises
    ------
    StorageError
        `DiskFullError` where the disk is full.
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
    """Hold the lock of a folder, which ends with the process.

    A forked child would keep the lock after its parent has ended: use process pools that spawn.

    Raises
    ------
    OccupiedError
        If another campaign holds it.
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
