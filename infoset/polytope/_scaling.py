"""Scales of coordinates whose sizes differ much."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

from infoset.polytope._affine_hull import FLAT, HIGHS
from infoset.polytope._qhull import Description

Floats = NDArray[np.float64]

_MOST = 1e6
"""Greatest ratio of widths along the axes without scaling."""
_LEAST = 3e-12
"""A width along an axis that is less than this part of the width along another one is rounding: the set is flat."""


def scale_of(points: Floats) -> Floats | None:
    """Return a power of two near the width along each axis, shape (n,); None if the widths do not differ much."""
    return _scales(np.ptp(points, axis=0), np.abs(points).max(axis=0))


def _scales(widths: Floats, sizes: Floats) -> Floats | None:
    wide = (widths > FLAT * sizes) & (widths > _LEAST * widths.max())
    if wide.sum() < 2 or widths[wide].max() < _MOST * widths[wide].min():
        return None
    return np.asarray(np.exp2(np.rint(np.log2(np.where(wide, widths, np.where(sizes > 0.0, sizes, 1.0))))))


def scale_of_constraints(normals: Floats, offsets: Floats, across: Floats, levels: Floats) -> Floats | None:
    """Return scales as `scale_of` for {x: normals x <= offsets, across x = levels}, from linear programs for the
    bounds.

    None without linear programs if neither the offsets of the rows, of unit length, nor the columns differ much.
    """
    rows = np.vstack([normals, across])
    columns = np.ones(1)
    if rows.any(axis=0).all():
        columns = np.exp(np.mean(np.log(np.where(rows != 0.0, np.abs(rows), 1.0)), axis=0, where=rows != 0.0))
    lengths = np.linalg.norm(normals, axis=1)
    sizes = np.abs(offsets[(lengths > 0.0) & (offsets != 0.0)] / lengths[(lengths > 0.0) & (offsets != 0.0)])
    if columns.max() < 1e3 * columns.min() and (not len(sizes) or sizes.max() < _MOST * sizes.min()):
        return None
    rows = normals / columns
    lengths = np.linalg.norm(rows, axis=1)
    rows, limits = rows[lengths > 0.0] / lengths[lengths > 0.0, None], offsets[lengths > 0.0] / lengths[lengths > 0.0]
    equal = (across / columns, levels) if len(across) else (None, None)
    ends = np.zeros((2, normals.shape[1]))
    for axis in range(normals.shape[1]):
        for side, sign in enumerate((1.0, -1.0)):
            cost = sign * np.eye(normals.shape[1])[axis]
            optimum = linprog(cost, rows, limits, *equal, bounds=(None, None), method="highs", options=HIGHS)
            if optimum.status != 0:
                return None
            ends[side, axis] = sign * optimum.fun
    # Widths that may be rounding of the linear programs count as zero.
    widths = np.where(ends[1] - ends[0] > 1e-8 * np.abs(ends).max(), ends[1] - ends[0], 0.0)
    return _scales(widths / columns, np.abs(ends).max(axis=0) / columns)


def stretched(description: Description, scale: Floats) -> Description:
    """Return the set whose coordinates are those of a description times a scale."""
    vertices, normals, offsets, across, levels = description
    rows = normals / scale
    if len(across):
        q, r = np.linalg.qr((across / scale).T)
        across, levels = q.T, np.linalg.solve(r.T, levels)
        offsets = offsets - rows @ across.T @ levels
        rows = rows - rows @ across.T @ across
    lengths = np.linalg.norm(rows, axis=1)
    return vertices * scale, rows / lengths[:, None], offsets / lengths, across, levels
