"""One campaign a folder at a time: a lock of the operating system, which goes when its process does."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

from sim.storage.atomic_file import reporting
from sim.storage.errors import OccupiedError

LOCK = ".lock"


class FolderLock:
    """A lock on a folder, held from entering to leaving, or until the process ends in whatever way.

    Parameters
    ----------
    folder : Path
        It must be there.

    Raises
    ------
    OccupiedError
        On entering, if another process or thread holds it.

    Notes
    -----
    The file stays behind; it is the lock on it that counts, so nothing is stale after a crash. A forked child would
    keep the lock beyond its parent: give campaigns process pools that spawn.
    """

    def __init__(self, folder: Path) -> None:
        self._file = folder / LOCK
        self._stream: BinaryIO | None = None

    def __enter__(self) -> FolderLock:
        with reporting(self._file):
            stream = self._file.open("a+b")
        try:
            _lock(stream)
        except OSError:
            stream.close()
            raise OccupiedError(
                f"{self._file.parent}: another campaign is at work in this folder; wait for it, or choose another"
            ) from None
        except BaseException:
            stream.close()
            raise
        self._stream = stream
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._stream is not None:
            self._stream.close()
            self._stream = None


def _lock(stream: BinaryIO) -> None:
    """Lock a file at once, or raise OSError."""
    if sys.platform == "win32":
        import msvcrt

        stream.seek(0)
        msvcrt.locking(stream.fileno(), msvcrt.LK_NBLCK, 1)
    else:
        import fcntl

        fcntl.flock(stream.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
        os.set_inheritable(stream.fileno(), False)
