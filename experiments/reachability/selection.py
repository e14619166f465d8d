"""Selection of optimal controls by the option --select."""

from __future__ import annotations

import re

import numpy as np

from infoset.arrays import Floats
from infoset.experiments.common.errors import InputError, shown
from infoset.experiments.common.options import choice
from infoset.experiments.reachability.file import Engine
from infoset.rendezvous.reachability import (
    Solution,
    ThinSetError,
    TooManyVerticesError,
    analytic_centre,
    chebyshev_centre,
    minimum_delta_v,
    minimum_energy,
    minimum_l1,
    minimum_norms,
    minimum_peak,
    samples,
    vertices,
)

SINGLE = {
    "energy": minimum_energy,
    "l1": minimum_l1,
    "norms": minimum_norms,
    "delta-v": minimum_delta_v,
    "peak": minimum_peak,
    "chebyshev": chebyshev_centre,
    "analytic": analytic_centre,
}
"""Selections of one control each: minimum sum of squares, of absolute values, of norms, etc."""
DEFAULT_SELECTION = {
    Engine.HELD: "energy,l1,norms,peak,chebyshev,analytic",
    Engine.IMPULSES: "delta-v,energy,peak,chebyshev,analytic",
}
"""Selections without the option --select."""
VERTICES, SAMPLES = "vertices", "samples"
"""Selections of several controls."""
MAX_SAMPLES = 1000
"""Largest number of samples; chosen: each is simulated and listed."""


def selection(text: str) -> tuple[list[str], int]:
    """Return the names of the selection, and the number of samples, 0 without them.

    Raise `InputError` for an unknown or repeated name, a number after another name, or if the
    number of samples is not a whole number from 1 to `MAX_SAMPLES`.
    """
    names = list[str]()
    count = 0
    for part in text.split(","):
        name, colon, digits = part.strip().partition(":")
        name = choice("--select", name, [*SINGLE, VERTICES, SAMPLES])
        if name in names:
            raise InputError(f"--select {name}: is given twice; give it once")
        names.append(name)

        if name == SAMPLES:
            count = _sample_count(digits.strip(), part.strip())
        elif colon:
            raise InputError(f"--select {name}: takes no number, found {shown(part.strip())}")
    return names, count


def _sample_count(digits: str, part: str) -> int:
    """Return the number of samples in a part of --select."""
    # More digits than four are more than `MAX_SAMPLES`, or begin with a zero.
    count = int(digits) if re.fullmatch("[0-9]{1,4}", digits) else 0
    if not 1 <= count <= MAX_SAMPLES:
        raise InputError(
            f"--select {SAMPLES}: must be {SAMPLES}:N with a whole number N between 1 and "
            f"{MAX_SAMPLES}, found {shown(part)}"
        )
    return count


def select_controls(solution: Solution, select: str, seed: int) -> dict[str, Floats]:
    """Return the selected optimal controls, each of shape (T, m), by name."""
    names, count = selection(select)
    controls: dict[str, Floats] = {}
    for name in names:
        if name in SINGLE:
            controls[name] = SINGLE[name](solution.optimal)
        elif name == VERTICES:
            try:
                several = vertices(solution.optimal)
            except (TooManyVerticesError, ThinSetError) as error:
                raise InputError(
                    f"--select vertices: {error}; choose for example --select samples:20"
                ) from None
            for number, control in enumerate(several, start=1):
                controls[f"vertex {number}"] = control
        else:
            several = samples(solution.optimal, count, np.random.default_rng(seed))
            for number, control in enumerate(several, start=1):
                controls[f"sample {number}"] = control
    return controls
