"""Scales of coordinates whose sizes differ much."""

from __future__ import annotations

import contextlib

import numpy as np
from scipy.optimize import linprog

from infoset.arrays import Floats
from infoset.polytope._affine_hull import (
    FLAT,
    HIGHS,
    ROUNDING,
    EmptyPolytopeError,
    UnboundedPolytopeError,
    UncertainHullError,
)
from infoset.polytope._qhull import Description, intersection_of_halfspaces

MOST_RATIO = 1e6
"""Greatest ratio of widths along the axes without scaling."""
_LEAST = 3e-12
"""A width along an axis that is less than this part of the width along another one may be rounding: the set is flat,
unless it is known to be solid."""


def scale_of(points: Floats, *, solid: bool = False) -> Floats | None:
    """Return a power of two near the width along each axis, shape (n,); None if the widths do not differ much.

    A set that is known to be `solid` has an interior: no width is rounding.
    """
    lower, upper = points.min(axis=0), points.max(axis=0)
    return scale_of_box(lower, upper, upper - lower if solid else None)


def scale_of_box(lower: Floats, upper: Floats, solid: Floats | None = None) -> Floats | None:
    """Return scales as `scale_of` for a set with these bounds, in sets that have an interior and the widths `solid`."""
    return _scales(upper - lower, np.maximum(np.abs(lower), np.abs(upper)), solid)


def _scales(widths: Floats, sizes: Floats, solid: Floats | None) -> Floats | None:
    wide = (widths > FLAT * sizes) & (widths > _LEAST * (widths.max() if solid is None else solid))
    if wide.sum() < 2 or widths[wide].max() < MOST_RATIO * widths[wide].min():
        return None
    return powers_of_two(np.where(wide, widths, np.where(sizes > 0.0, sizes, 1.0)))


def powers_of_two(sizes: Floats) -> Floats:
    """Return powers of two near positive sizes: scales that round nothing."""
    return np.asarray(np.exp2(np.rint(np.log2(sizes))))


def scale_of_constraints(
    normals: Floats, offsets: Floats, across: Floats, levels: Floats
) -> tuple[Floats, Floats, Floats] | None:
    """Return scales as `scale_of` for {x: normals x <= offsets, across x = levels}, and the bounds of x that give them.

    None without linear programs if neither the offsets of the rows, of unit length, nor the columns differ much.
    """
    rows = np.vstack([normals, across])
    columns = np.ones(1)
    if rows.any(axis=0).all():
        columns = np.exp(np.mean(np.log(np.where(rows != 0.0, np.abs(rows), 1.0)), axis=0, where=rows != 0.0))
    bounds = _bounds_of_axes(normals, offsets)
    box = None
    if np.isfinite(bounds).all() and (bounds[0] < bounds[1]).all():
        lower, upper = tightened(normals, offsets, *bounds)
        box = scale_of_box(lower, upper, upper - lower)
    columns = columns if box is None else 1.0 / box
    lengths = np.linalg.norm(normals, axis=1)
    sizes = np.abs(offsets[(lengths > 0.0) & (offsets != 0.0)] / lengths[(lengths > 0.0) & (offsets != 0.0)])
    if columns.max() < 1e3 * columns.min() and (not len(sizes) or sizes.max() < MOST_RATIO * sizes.min()):
        return None
    if box is None and columns.size > 1:
        # The sizes of coordinates at which a row is tight.
        tight = (normals != 0.0) & (offsets != 0.0)[:, None]
        sizes = (
            np.log(np.where(tight, np.abs(normals), 1.0))
            - np.log(np.where(offsets != 0.0, np.abs(offsets), 1.0))[:, None]
        )
        columns = np.where(
            tight.any(axis=0), np.exp(sizes.sum(axis=0, where=tight) / np.maximum(tight.sum(axis=0), 1)), columns
        )
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
    scale = _scales(widths / columns, np.abs(ends).max(axis=0) / columns, widths / columns)
    lower, upper = ends / columns
    return np.ones_like(lower) if scale is None else scale, lower, upper


def _bounds_of_axes(rows: Floats, limits: Floats) -> Floats:
    """Return the least and the greatest coordinates that the rows along the axes allow, shape (2, n)."""
    along = rows[np.count_nonzero(rows, axis=1) == 1]
    ends = limits[np.count_nonzero(rows, axis=1) == 1, None]
    ends = np.divide(ends, along, out=np.zeros_like(along), where=along != 0.0)
    lower = np.where(along < 0.0, ends, -np.inf).max(axis=0, initial=-np.inf)
    return np.array([lower, np.where(along > 0.0, ends, np.inf).min(axis=0, initial=np.inf)])


def tightened(rows: Floats, limits: Floats, lower: Floats, upper: Floats) -> tuple[Floats, Floats]:
    """Return bounds of {x: rows x <= limits, lower <= x <= upper}, from each row alone; they need not be the least."""
    least = np.minimum(rows * lower, rows * upper)
    ends = limits[:, None] - (least.sum(axis=1)[:, None] - least)
    ends = np.divide(ends, rows, out=np.zeros_like(rows), where=rows != 0.0)
    most = np.where(rows > 0.0, ends, np.inf).min(axis=0, initial=np.inf)
    return np.where(rows < 0.0, ends, -np.inf).max(axis=0, initial=-np.inf).clip(lower), most.clip(max=upper)


def scaled_rows(rows: Floats, limits: Floats, scale: Floats) -> tuple[Floats, Floats]:
    """Return half-spaces of x / scale with normals of unit length, except those whose normal is rounding."""
    lengths = np.linalg.norm(rows, axis=1)
    units = np.where(lengths > ROUNDING * lengths.max(initial=0.0), np.linalg.norm(rows * scale, axis=1), 1.0)
    return rows * scale / units[:, None], limits / units


def without_far(rows: Floats, limits: Floats, lower: Floats, upper: Floats) -> tuple[Floats, Floats]:
    """Return half-spaces without those 1e3 times farther away than a box that contains the set; a larger box if any.

    Their offsets would hide the size of the set: it would count as flat.
    """
    if (lower > upper).any():
        return rows, limits
    size = float(np.maximum(np.abs(lower), np.abs(upper)).max())
    middle, half = 0.5 * lower + 0.5 * upper, upper - lower + 1e-3 * size
    near = limits - (rows @ middle + np.abs(rows) @ half) <= 1e3 * size * np.linalg.norm(rows, axis=1)
    if near.all():
        return rows, limits
    unit = np.eye(len(lower))
    return np.vstack([rows[near], unit, -unit]), np.concatenate([limits[near], middle + half, half - middle])


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


def described(rows: Floats, limits: Floats, across: Floats, levels: Floats, *, bounded: bool) -> Description:
    """Return both representations as `intersection_of_halfspaces`, in scaled coordinates if their sizes differ much."""
    result: Description | None = None
    failure: ValueError | ArithmeticError | None = None
    try:
        result = intersection_of_halfspaces(rows, limits, across, levels, bounded=bounded)
        if not len(result[3]):
            return result
    except (EmptyPolytopeError, UnboundedPolytopeError, UncertainHullError) as error:
        failure = error
    known = scale_of_constraints(rows, limits, across, levels)
    if known is not None:
        scale, lower, upper = known
        with contextlib.suppress(EmptyPolytopeError, UncertainHullError):
            near, ends = without_far(*scaled_rows(rows, limits, scale), lower / scale, upper / scale)
            return stretched(intersection_of_halfspaces(near, ends, across * scale, levels, bounded=True), scale)
        # The bounds exist, so the set is not emptier than their rounding.
        if isinstance(failure, EmptyPolytopeError) and failure.relaxation > 1e-6 * np.abs(known[1:]).max():
            failure = UncertainHullError(
                "the half-spaces have common points, but their sizes differ too much for a hull: scale the coordinates"
            )
    if result is None:
        assert failure is not None
        raise failure
    return result
