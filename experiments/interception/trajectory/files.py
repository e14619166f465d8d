"""Files that a trajectory file names, in its folder or in folders that the user allows."""

from __future__ import annotations

import stat
from collections.abc import Sequence
from pathlib import Path

from infoset.experiments.common.errors import InputError, shown


def named_file(name: str, folder: Path, allowed: Sequence[Path]) -> Path:
    """Return the path of a file that a trajectory file in `folder` names.

    It must be a regular file below this folder or below one of those `allowed`; links and parents
    are followed before the comparison. `InputError` otherwise.
    """
    file = folder / name
    try:
        found = file.resolve(strict=True)
        mode = found.stat().st_mode
    except (
        OSError,
        RuntimeError,
        ValueError,
    ) as error:  # RuntimeError: a loop of links; ValueError: a zero byte
        reason = getattr(error, "strerror", None) or "the path is not valid"
        raise InputError(f"{shown(name)}: cannot be read: {reason}") from None

    if not any(found.is_relative_to(each.resolve()) for each in (folder, *allowed)):
        raise InputError(
            f"{shown(name)}: is not below the folder of the trajectory file; copy it there, or "
            "allow its folder with --files-in FOLDER"
        )
    if not stat.S_ISREG(mode):
        raise InputError(
            f"{shown(name)}: is not a regular file, but a folder, pipe or device; give a file"
        )
    # As named, so that later messages show the path that the user wrote.
    return file
