"""States of bodies from SPICE kernels."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from infoset.arrays import Floats
from infoset.experiments.common.errors import InputError
from infoset.experiments.common.input_file import read_input
from infoset.experiments.interception.trajectory.files import named_file

BINARY = (b"DAF/", b"NAIF/DA", b"DAS/", b"NAIF/DAS")
"""First bytes of binary kernels, of which SPICE reads only what it needs."""
MAX_TEXT_BYTES = 10_000_000
"""Size of the largest text kernel: all of it is read into memory."""
NAMES_OF_FILES = b"KERNELS_TO_LOAD"
"""The variable by which a text kernel, then a meta-kernel, makes SPICE load other files."""
INERTIAL_CLASS = 1
"""SPICE's class of the inertial frames that it has built in."""


def kernel_files(names: Sequence[str], folder: Path, allowed: Sequence[Path]) -> list[Path]:
    """Return the paths of kernels.

    Raise `InputError` for a meta-kernel and for a file that may not be opened.
    """
    files = []
    for name in names:
        file = named_file(name, folder, allowed)
        if not _is_binary(file) and NAMES_OF_FILES in read_input(file, MAX_TEXT_BYTES).upper():
            raise InputError(
                f"{name}: is a meta-kernel, which loads further files; name the kernels themselves "
                "in kernels = [...]"
            )
        files.append(file)
    return files


@contextmanager
def loaded(files: Sequence[Path]) -> Iterator[Any]:
    """Load kernels and give the module spiceypy; its errors become an `InputError` of one line."""
    import spiceypy

    try:
        with spiceypy.KernelPool([str(file) for file in files]):
            yield spiceypy
    except spiceypy.SpiceyError as error:
        raise InputError(f"spice: {' '.join((error.long or error.short).split())}") from None


def kernel_state(spice: Any, body: str, time_s: float, frame: str, centre: str) -> Floats:
    """Return position and velocity of a body at a time of SPICE, m and m/s, shape (2, 3).

    The time is TDB from J2000, s.
    """
    code = spice.namfrm(frame)
    if code == 0 or spice.frinfo(code)[1] != INERTIAL_CLASS:
        raise InputError(
            f"frame: {frame} is not an inertial frame of SPICE; use J2000 or ECLIPJ2000"
        )
    state, _ = spice.spkezr(body, time_s, frame, "NONE", centre)
    # SPICE is in kilometres.
    return np.asarray(1e3 * np.reshape(state, (2, 3)))


def _is_binary(file: Path) -> bool:
    try:
        with file.open("rb") as stream:
            # As many bytes as the longest of `BINARY` has.
            return stream.read(8).startswith(BINARY)
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror}") from None
