"""Arrays as short text, for the data of a page."""

from __future__ import annotations

import base64
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

STEPS_OF_A_BOX = 65535
"""Steps of the vertex grid across the box of a polygon: about 0.01 pixels on a screen."""


def packed_floats(values: ArrayLike) -> str:
    """Return numbers as base64 of little-endian doubles: all their digits."""
    return _text(np.asarray(values, dtype="<f8"))


def packed_counts(values: ArrayLike) -> str:
    """Return counts as base64 of little-endian 32-bit integers.

    Parameters
    ----------
    values : array_like
        From 0 to 2^32 - 1.
    """
    return _text(np.asarray(values, dtype="<u4"))


def packed_outlines(outlines: Sequence[Floats]) -> dict[str, str]:
    """Return outlines with their boxes exactly and their vertices on a grid of `STEPS_OF_A_BOX` across the box.

    Parameters
    ----------
    outlines : sequence of ndarray, shape (n, d)
        At least one vertex each.

    Returns
    -------
    dict
        ``boxes`` (least of each coordinate, then greatest), ``counts`` and ``vertices``.
    """
    counts = np.array([len(outline) for outline in outlines], dtype=np.int64)
    if not len(counts):
        return {"boxes": "", "counts": "", "vertices": ""}
    points = np.concatenate(outlines)
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    least, greatest = np.minimum.reduceat(points, starts), np.maximum.reduceat(points, starts)
    width = np.where(greatest > least, greatest - least, 1.0)
    share = (points - np.repeat(least, counts, axis=0)) / np.repeat(width, counts, axis=0)
    return {
        "boxes": packed_floats(np.concatenate([least, greatest], axis=1)),
        "counts": packed_counts(counts),
        "vertices": _text(np.rint(share * STEPS_OF_A_BOX).astype("<u2")),
    }


def _text(values: NDArray[np.generic]) -> str:
    return base64.b64encode(np.ascontiguousarray(values).tobytes()).decode("ascii")
