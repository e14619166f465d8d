"""Files that are there whole or not at all, whatever moment the process or the machine dies at."""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
from collections.abc import Iterator
from pathlib import Path

from sim.storage.errors import DiskFullError, StorageError

_NO_ROOM = (errno.ENOSPC, errno.EDQUOT)


def write_whole(file: Path, content: bytes) -> None:
    """Write a file under a temporary name, flush it to the disk, and give it its name.

    Parameters
    ----------
    file : Path
        Replaced if it is there.
    content : bytes

    Raises
    ------
    DiskFullError
        If there is no room; the file is then what it was.
    StorageError
        If it cannot be written for another reason.

    Notes
    -----
    Renaming is atomic, and comes after the content has reached the disk; then the folder is flushed, so that the name
    outlives the machine too.
    """
    temporary = file.parent / f".infoset-{os.getpid()}-{secrets.token_hex(4)}.tmp"
    with reporting(file):
        try:
            with temporary.open("xb") as stream:
                stream.write(content)
                stream.flush()
                os.fsync(stream.fileno())
            temporary.replace(file)
        finally:
            with contextlib.suppress(OSError):
                temporary.unlink(missing_ok=True)
        _flush_folder(file.parent)


def clear_leftovers(folder: Path) -> None:
    """Take away the temporary files of processes that died while writing; only under the folder's lock."""
    for leftover in filter(is_leftover, folder.iterdir()):
        with contextlib.suppress(OSError):
            leftover.unlink()


def is_leftover(file: Path) -> bool:
    """Whether a file is one that was being written: it is none yet, or will never be one."""
    return file.name.startswith(".infoset-") and file.name.endswith(".tmp")


@contextlib.contextmanager
def reporting(where: Path) -> Iterator[None]:
    """Turn an error of the file system into one that a person can act on.

    Parameters
    ----------
    where : Path
        What is being read or written.

    Yields
    ------
    None

    Raises
    ------
    StorageError
        For every `OSError`; a `DiskFullError` where the disk is full.
    """
    try:
        yield
    except OSError as error:
        if error.errno in _NO_ROOM:
            raise DiskFullError(
                f"{where}: the disk is full; what is in the folder is whole: make room and resume it"
            ) from None
        raise StorageError(f"{where}: {error.strerror or error}; check the folder and the disk") from None


def _flush_folder(folder: Path) -> None:
    if os.name != "posix":  # elsewhere a folder cannot be opened
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
