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
"""Name of the lock's file in a folder."""
_TEMPORARY = ".infoset-"
"""Beginning of the names of temporary files."""


class StorageError(Exception):
    """The folder of a campaign cannot be used; the message gives problem, file and remedy."""


def replace_file(file: Path, content: bytes) -> None:
    """Write a file atomically: at any time it is complete or unchanged.

    The content is written to a temporary file in the same folder and flushed to the disk; then the
    file is renamed, which is atomic, and the folder is flushed so that the new name is on the disk
    too. Raises `OSError`: the file is then unchanged, or complete if only the flush of the folder
    failed.
    """
    temporary = file.parent / f"{_TEMPORARY}{os.getpid()}-{secrets.token_hex(4)}.tmp"
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


def write_whole(file: Path, content: bytes) -> None:
    """Call `replace_file`, and raise its errors as `StorageError`."""
    with reporting(file):
        replace_file(file, content)


def is_leftover(file: Path) -> bool:
    """Whether a file is a temporary one of `replace_file`, left by a process that died."""
    return file.name.startswith(_TEMPORARY) and file.suffix == ".tmp"


@contextlib.contextmanager
def reporting(path: Path) -> Iterator[None]:
    """Raise an `OSError` of the context as a StorageError with a message for the user."""
    try:
        yield
    except OSError as error:
        remedy = "check the folder and the disk"
        if error.errno in (errno.ENOSPC, errno.EDQUOT):
            remedy = (
                "the files in the folder are complete: free some space and run again with --resume"
            )
        raise StorageError(f"{path}: {error.strerror or error}; {remedy}") from None


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the lock of a folder; StorageError if another campaign holds it.

    The lock ends with the process at the latest. A forked child would keep the lock after its
    parent has ended: use process pools that spawn.
    """
    with contextlib.ExitStack() as stack:
        with reporting(folder / LOCK):
            try:
                stack.enter_context(FileLock(folder / LOCK, timeout=0))
            except Timeout:
                raise StorageError(
                    f"{folder}: another campaign is running in this folder; wait for it, or choose "
                    "another folder"
                ) from None
        yield
