"""Facets from vertices and vertices from facets, by Qhull, with checks."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space
from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError

from infoset.polytope._frame import FLAT, Frame, frame_of
from infoset.polytope._incidence import MERGE, essential, together
from infoset.polytope._relative_interior import chebyshev_ball, relative_interior
from infoset.polytope.errors import UncertainHullError

Floats = NDArray[np.float64]

_OPTIONS = ("Qt", "QJ Pp")
_APART = 1e-9
_ROUND = 30.0
"""Ratio of length to thickness above which sets are intersected again, in coordinates in which they are round."""


Description = tuple[Floats, Floats, Floats, Floats, Floats]
"""Vertices; facets normals x <= offsets; the affine hull across x = levels: the fields of a `Polytope`."""


def hull_of_points(points: Floats, flat: float = FLAT) -> Description:
    """Return both representations of the convex hull of points, shape (k, n).

    Raises
    ------
    UncertainHullError
        If Qhull fails, or its facets and vertices do not agree.
    """
    frame = frame_of(points, flat)
    return _outward(frame, *_hull(frame.inward(points)))


def intersection_of_halfspaces(
    normals: Floats, offsets: Floats, across: Floats, levels: Floats, *, bounded: bool = False
) -> Description:
    """Return both representations of {x: normals x <= offsets, across x = levels}.

    Raises
    ------
    EmptyPolytopeError, UnboundedPolytopeError, UncertainHullError
        If the set is empty, is unbounded, or depends on rounding.
    """
    inside = relative_interior(normals, offsets, across, levels, bounded=bounded)
    if not inside.dimension:
        return _single(inside.point)
    corners, sides, ends = _corners(inside.rows, inside.limits, inside.centre)
    return _lifted(inside.point, inside.basis, corners, sides, ends)


def _hull(inner: Floats) -> tuple[Floats, Floats, Floats]:
    """Return vertices, normals and offsets of points that span their space, about one wide."""
    size = inner.shape[1]
    if size == 0:
        return np.zeros((1, 0)), np.zeros((0, 0)), np.zeros(0)
    if size == 1:
        ends = np.array([[inner.min()], [inner.max()]])
        return ends, np.array([[-1.0], [1.0]]), np.array([-ends[0, 0], ends[1, 0]])
    inner = inner[np.unique(together(inner, MERGE), return_index=True)[1]]
    failed = UncertainHullError("no hull was found")
    for options in _OPTIONS:
        try:
            hull = ConvexHull(inner, qhull_options=options)
            planes = np.unique(hull.equations.round(13), axis=0)
            vertices, normals, offsets = essential(inner[hull.vertices], planes[:, :-1], -planes[:, -1])
        except QhullError as error:
            failed = UncertainHullError(f"rounding decides which of {len(inner)} points are vertices")
            failed.__cause__ = error
            continue
        except UncertainHullError as error:
            failed = error
            continue
        outside = float((inner @ normals.T - offsets).max())
        if outside <= _APART:
            return vertices, normals, offsets
        failed = UncertainHullError(f"a point is {outside:.2g} outside its hull")
    raise failed


def _corners(rows: Floats, limits: Floats, centre: Floats) -> tuple[Floats, Floats, Floats]:
    """Return vertices and facets of a bounded set with an interior."""
    if rows.shape[1] == 1:
        least = float((limits[rows[:, 0] < 0] / rows[rows[:, 0] < 0, 0]).max())
        most = float((limits[rows[:, 0] > 0] / rows[rows[:, 0] > 0, 0]).min())
        return np.array([[least], [most]]), np.array([[-1.0], [1.0]]), np.array([-least, most])
    first = _intersect(rows, limits, centre)
    frame = frame_of(first)
    if frame.dimension == rows.shape[1] and frame.extents.max() > _ROUND * frame.extents.min():
        inner_rows = (rows @ frame.basis) * frame.extents
        inner_limits = limits - rows @ frame.centre
        size = np.linalg.norm(inner_rows, axis=1)
        inner_rows, inner_limits = inner_rows / size[:, None], inner_limits / size
        inner = _intersect(inner_rows, inner_limits, chebyshev_ball(inner_rows, inner_limits)[0])
    else:
        scale = max(float(frame.extents.max(initial=0.0)), 1e-300)
        frame = Frame(frame.centre, np.eye(rows.shape[1]), np.full(rows.shape[1], scale), np.zeros((rows.shape[1], 0)))
        inner_rows, inner_limits = rows, (limits - rows @ frame.centre) / scale
        inner = frame.inward(first)
    points, sides, ends = essential(inner, inner_rows, inner_limits)
    return (frame.outward(points), *frame.rows_outward(sides, ends))


def _intersect(rows: Floats, limits: Floats, centre: Floats) -> Floats:
    try:
        points = HalfspaceIntersection(np.column_stack([rows, -limits]), centre).intersections
    except QhullError as error:
        raise UncertainHullError(f"rounding decides where {len(rows)} half-spaces meet") from error
    if not np.isfinite(points).all():
        raise UncertainHullError(f"rounding decides where {len(rows)} half-spaces meet: a vertex is at infinity")
    return np.asarray(points)


def _outward(frame: Frame, vertices: Floats, normals: Floats, offsets: Floats) -> Description:
    if not frame.dimension:
        return _single(frame.centre)
    turned, moved = frame.rows_outward(normals, offsets)
    across = frame.across.T
    return frame.outward(vertices), turned, moved, across, across @ frame.centre


def _lifted(point: Floats, basis: Floats, corners: Floats, sides: Floats, ends: Floats) -> Description:
    turned = sides @ basis.T
    across = null_space(basis.T).T if basis.shape[1] < len(point) else np.zeros((0, len(point)))
    return point + corners @ basis.T, turned, ends + turned @ point, across, across @ point


def _single(point: Floats) -> Description:
    size = len(point)
    return point[None, :], np.zeros((0, size)), np.zeros(0), np.eye(size), point.copy()
