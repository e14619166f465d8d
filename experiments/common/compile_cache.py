"""Where compiled kernels are kept: beside the sources, else where the user keeps such things, else in a folder here.

Numba looks for the first two by itself, and fails where neither can be written; this module finds the third. Imports
nothing heavy: it is asked before a command begins.
"""

from __future__ import annotations

import os
import stat
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path

VARIABLE = "NUMBA_CACHE_DIR"
PACKAGES = ("infoset", "sim", "rendezvous")
"""The packages that have kernels."""


def keep_kernels_somewhere() -> None:
    """Name a folder for compiled kernels, in the environment, if there is none that Numba would find.

    Notes
    -----
    Compiled kernels are programs, so the folder must be one that nobody else can put anything into. Where there is none
    at all, nothing is named, and kernels are compiled in every process.
    """
    if os.environ.get(VARIABLE) or _written_beside_sources() or _can_be_made(_folder_of_user()):
        return
    try:
        os.environ[VARIABLE] = str(_private_folder())
    except OSError:
        return


def _written_beside_sources() -> bool:
    """Whether Python's own caches can be written in the packages."""
    specs = [find_spec(name) for name in PACKAGES]
    sources = [Path(each.origin).parent for each in specs if each is not None and each.origin is not None]
    return all(_can_be_made(folder / "__pycache__") for folder in sources)


def _folder_of_user() -> Path:
    """Where Numba keeps what it cannot keep beside the sources."""
    home = Path(os.path.expanduser("~"))  # noqa: PTH111 - without a home it stays "~", where Path.home raises
    if sys.platform == "darwin":
        return home / "Library" / "Caches" / "numba"
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", home / "AppData" / "Local")) / "numba"
    return Path(os.environ.get("XDG_CACHE_HOME", home / ".cache")) / "numba"


def _can_be_made(folder: Path) -> bool:
    """Whether a folder can be written, or made and then written."""
    there = next((each for each in (folder, *folder.absolute().parents) if each.exists()), None)
    return there is not None and there.is_dir() and os.access(there, os.W_OK | os.X_OK)


def _private_folder() -> Path:
    """Return a folder for temporary files that belongs to this user alone, made if it is not there."""
    user = os.getuid() if hasattr(os, "getuid") else 0
    folder = Path(tempfile.gettempdir()) / f"infoset-kernels-{user}"
    folder.mkdir(mode=0o700, exist_ok=True)
    found = folder.lstat()
    theirs = hasattr(os, "getuid") and (found.st_uid != user or found.st_mode & 0o077)
    if not stat.S_ISDIR(found.st_mode) or theirs:
        raise PermissionError(f"{folder} is somebody else's")
    return folder
