"""Facets from vertices and vertices from facets, by Qhull, with checks."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg import null_space
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError, cKDTree

from infoset.arrays import Flags, Floats, Integers
from infoset.geometry.polytope._affine_hull import (
    FLAT,
    Frame,
    UncertainHullError,
    chebyshev_ball,
    frame_of,
    relative_interior,
)

Description = tuple[Floats, Floats, Floats, Floats, Floats]
"""Vertices; facets normals x <= offsets; the affine hull across x = levels: the fields of a `Polytope`."""

_OPTIONS = ("Qt", "QJ Pp")
"""Options of Qhull: merged facets, divided into simplices; if these fail, joggled points."""
_ROUND = 30.0
"""Ratio of length to thickness above which sets are intersected again, in coordinates in which they are round."""
MERGE = 1e-10
"""Points nearer than this are one point, in coordinates in which the width of the set is about one."""
_APART = 1e-9
"""Maximum distance between both representations of a set."""
_MIN_ON, _MAX_ON = 1e-14, 1e-7
"""Limits of the distance, in the same coordinates, below which a point is on a plane."""
_OTHERWISE_ON = (1e-11, 1e-10, 1e-12, 1e-13, 1e-9, 1e-8)
_MIN_RANK = 1e-11
_ENTRIES = 4_000_000
_APART_BY_ROUNDING = 1e-7
_ON_PLANE = 1e-13
_MAX_JOGGLED = 200
"""Maximum number of joggled vertices. Their facets are simplices: 915 vertices in 8 dimensions have 3.7 million."""


def hull_of_points(points: Floats, flat: float = FLAT) -> Description:
    """Return both representations of the convex hull of points, shape (k, n).

    An UncertainHullError is raised if Qhull fails, or its facets and vertices do not agree.
    """
    frame = frame_of(points, flat)
    return _outward(frame, *_hull(frame.inward(points)))


def intersection_of_halfspaces(
    normals: Floats,
    offsets: Floats,
    across: Floats,
    levels: Floats,
    *,
    bounded: bool = False,
    rounding: float = 0.0,
) -> Description:
    """Return both representations of {x: normals x <= offsets, across x = levels}; `rounding` is that of the offsets.

    The errors of `relative_interior` are raised if the set is empty, is unbounded, or depends on rounding.
    """
    inside = relative_interior(normals, offsets, across, levels, bounded=bounded, rounding=rounding)
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


def _corners(rows: Floats, limits: Floats, centre: Floats, again: int = 3) -> tuple[Floats, Floats, Floats]:
    """Return vertices and facets of a bounded set with an interior.

    If the vertices of a long set were too inexact to find coordinates in which it is round, they are found `again`.
    """
    if rows.shape[1] == 1:
        minimum = float((limits[rows[:, 0] < 0] / rows[rows[:, 0] < 0, 0]).max())
        most = float((limits[rows[:, 0] > 0] / rows[rows[:, 0] > 0, 0]).min())
        return np.array([[minimum], [most]]), np.array([[-1.0], [1.0]]), np.array([-minimum, most])
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
    try:
        points, sides, ends = essential(_met(inner, inner_rows, inner_limits), inner_rows, inner_limits)
    except UncertainHullError:
        if not again:
            raise
        points, sides, ends = _corners(inner_rows, inner_limits, chebyshev_ball(inner_rows, inner_limits)[0], again - 1)
    return (frame.outward(points), *frame.rows_outward(sides, ends))


def _intersect(rows: Floats, limits: Floats, centre: Floats) -> Floats:
    try:
        with np.errstate(divide="ignore", invalid="ignore"):  # vertices at infinity are refused below
            points = HalfspaceIntersection(np.column_stack([rows, -limits]), centre).intersections
    except QhullError as error:
        raise UncertainHullError(f"rounding decides where {len(rows)} half-spaces meet") from error
    if not np.isfinite(points).all():
        raise UncertainHullError(f"rounding decides where {len(rows)} half-spaces meet: a vertex is at infinity")
    return np.asarray(points)


def _met(points: Floats, rows: Floats, limits: Floats) -> Floats:
    """Return vertices, shape (k, d), those replaced that rounding of nearly parallel planes has torn apart.

    Points within 1e-7 of each other, but not within `MERGE`, become one point if there is a point on all their planes,
    to rounding. Coordinates are those in which the width of the set is about one.
    """
    labels = together(points, _APART_BY_ROUNDING)
    joined = points.copy()
    for label in np.flatnonzero(np.bincount(labels) > 1):
        members = np.flatnonzero(labels == label)
        if np.ptp(points[members], axis=0).max() <= MERGE:
            continue
        on = (np.abs(limits - points[members] @ rows.T) <= _ON_PLANE).any(axis=0)
        common = np.linalg.lstsq(rows[on], limits[on], rcond=_MIN_RANK)[0]
        if on.any() and np.abs(rows[on] @ common - limits[on]).max() <= _ON_PLANE:
            joined[members] = common
    return joined


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


def essential(points: Floats, normals: Floats, offsets: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the points that are vertices and the planes that are facets of a full-dimensional polytope, d >= 2.

    `points`, shape (k, d), contain all vertices, and perhaps other points of the polytope, in coordinates in which its
    width is about one. `normals`, shape (m, d), and `offsets` contain all facets, and perhaps other half-spaces that
    contain the polytope. Normals of the returned facets have unit length. An UncertainHullError is raised if, because
    of rounding, a point is outside or the result is not a polytope.

    A plane is a facet if the points on it span d - 1 dimensions and are not a subset of the points on another plane. A
    point is a vertex if it is the only common point of the planes through it. O(k m d^2), and O(m^2 k) for matrix
    products. As a check, the hull of the vertices is computed again: it must contain all points, and each simplex of
    its surface must lie in a facet. With many vertices and fewer facets the intersection of the facets is computed
    instead: it must have these vertices. Distances of points from planes are either rounding or real: the widest gap
    among them separates the two. If the check fails, fixed tolerances are tried.
    """
    lengths = np.linalg.norm(normals, axis=1)
    normals, offsets = normals / lengths[:, None], offsets / lengths
    gaps = offsets - points @ normals.T
    if float(gaps.min()) < -_MAX_ON:
        raise UncertainHullError(f"a vertex is {-float(gaps.min()):.2g} outside its own facets")
    failed = UncertainHullError("no tolerance fits")
    labels = together(points, MERGE)
    kept = np.unique(labels, return_index=True)[1]
    points = points[kept]
    for near in (_widest_gap(gaps), *_OTHERWISE_ON):
        # A merged point is on the planes of all its points.
        on = np.zeros((len(kept), len(normals)), dtype=bool)
        np.logical_or.at(on, labels, gaps <= near)
        try:
            corners, facets = _agreeing(points, normals, offsets, on, max(near, _MIN_RANK))
        except UncertainHullError as error:
            failed = error
        else:
            return points[corners], normals[facets], offsets[facets]
    raise failed


def _agreeing(
    points: Floats, normals: Floats, offsets: Floats, on: Flags, negligible: float
) -> tuple[Integers, Integers]:
    """Return which points are vertices and which planes facets, given which points are on which planes."""
    size = points.shape[1]
    facets = _max(on, size)
    members = on[:, facets].T
    means = (members @ points) / members.sum(axis=1)[:, None]
    spans = _ranks(
        len(means), len(points), lambda one: (points - means[one, None, :]) * members[one, :, None], negligible
    )
    facets = facets[spans >= size - 1]
    through = on[:, facets]
    corners = np.flatnonzero(through.sum(axis=1) >= size)
    planes, met = normals[facets], through[corners]
    corners = corners[_ranks(len(met), len(planes), lambda one: planes * met[one, :, None], negligible) == size]
    if len(corners) <= size or len(facets) <= size:
        raise UncertainHullError(f"{len(corners)} vertices and {len(facets)} facets are no polytope in R^{size}")
    if float(through[corners].sum(axis=0).min()) < size:
        raise UncertainHullError(f"a facet of a polytope in R^{size} has fewer than {size} vertices")
    if size == 2 and len(corners) != len(facets):
        raise UncertainHullError(f"{len(corners)} vertices and {len(facets)} sides are no polygon")
    few_facets = len(facets) < len(corners) and len(corners) > _MAX_JOGGLED
    if not (few_facets and _meet_in(points, corners, normals[facets], offsets[facets], on[:, facets])):
        _need_agreement(points, corners, on[:, facets])
    return corners, facets


def _meet_in(points: Floats, corners: Integers, normals: Floats, offsets: Floats, on_facets: Flags) -> bool:
    """Whether the facets contain all points and meet in the vertices only. Fast if facets are few.

    The hull of 915 vertices in 8 dimensions takes a minute, the intersection of their 23 facets milliseconds.
    """
    vertices = points[corners]
    try:
        with np.errstate(divide="ignore", invalid="ignore"):
            met = HalfspaceIntersection(np.column_stack([normals, -offsets]), vertices.mean(axis=0))
    except QhullError:
        return False
    if not np.isfinite(met.intersections).all():  # the facets do not bound a set
        return False
    apart, nearest = cKDTree(vertices).query(met.intersections, p=np.inf)
    return (
        float((points @ normals.T - offsets).max()) <= _APART
        and float(apart.max()) <= _APART
        and len(np.unique(nearest)) == len(corners)
        and all(
            on_facets[corners[corner], planes].all() for corner, planes in zip(nearest, met.dual_facets, strict=True)
        )
    )


def _need_agreement(points: Floats, corners: Integers, on_facets: Flags) -> None:
    """Check that the hull of the vertices contains all points, and that each simplex of its surface is in a facet."""
    hull = _surface(points[corners])
    outside = float((points @ hull.equations[:, :-1].T + hull.equations[:, -1]).max())
    if outside > _APART:
        raise UncertainHullError(f"a point is {outside:.2g} outside the hull of its vertices")
    for some in _chunks(len(hull.simplices), on_facets.shape[1]):
        covered = np.ones((len(hull.simplices[some]), on_facets.shape[1]), dtype=bool)
        for corner in hull.simplices[some].T:
            covered &= on_facets[corners[corner]]
        if not covered.any(axis=1).all():
            raise UncertainHullError("a part of the surface is in no facet")


def _surface(vertices: Floats) -> ConvexHull:
    """Return the hull of vertices; if merged facets stop Qhull and the vertices are few, of joggled vertices."""
    try:
        return ConvexHull(vertices)
    except QhullError as error:
        failed = error
    if len(vertices) <= _MAX_JOGGLED:
        try:
            return ConvexHull(vertices, qhull_options=_OPTIONS[1])
        except QhullError as error:
            failed = error
    raise UncertainHullError(f"rounding decides which of {len(vertices)} points are vertices") from failed


def _widest_gap(gaps: Floats) -> float:
    """Return the geometric mean of the ends of the widest gap among small distances."""
    sizes = np.abs(gaps)
    small = np.log(np.sort(sizes[(sizes > _MIN_ON) & (sizes < _MAX_ON)]))
    ends = np.concatenate([[np.log(_MIN_ON)], small, [np.log(_MAX_ON)]])
    widest = int(np.diff(ends).argmax())
    return float(np.exp(0.5 * (ends[widest] + ends[widest + 1])))


def together(points: Floats, within: float) -> Integers:
    """Label points that are nearer to each other than a distance, in every coordinate, with the same number."""
    # Scipy 1.11.0 looks for components among indices of 32 bits only.
    pairs = cKDTree(points).query_pairs(within, p=np.inf, output_type="ndarray").astype(np.int32)
    graph = csr_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(points), len(points)))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def _max(on: Flags, minimum: int) -> Integers:
    """Return the planes whose points are not all on another plane; of planes with the same points, the first."""
    planes = np.flatnonzero(on.sum(axis=0) >= minimum)
    held = on[:, planes].astype(np.float32)
    counts, order = held.sum(axis=0), np.arange(len(planes))
    kept = np.ones(len(planes), dtype=bool)
    for some in _chunks(len(planes), len(planes)):
        within = held[:, some].T @ held >= counts[some, None]
        kept[some] = ~(within & ((counts > counts[some, None]) | (order < order[some, None]))).any(axis=1)
    return np.asarray(planes[kept])


def _ranks(count: int, height: int, stack: Callable[[slice], Floats], negligible: float) -> Integers:
    """Return the ranks of matrices, which are built in batches."""
    ranks = [np.zeros(0, np.int64)]
    for some in _chunks(count, height):
        values = np.linalg.svd(stack(some), compute_uv=False)
        ranks.append((values > negligible * np.maximum(values[:, :1], 1e-300)).sum(axis=1))
    return np.concatenate(ranks)


def _chunks(count: int, width: int) -> list[slice]:
    """Return parts of `count` rows of a table with `width` columns, which is too large to be stored."""
    size = max(1, _ENTRIES // max(1, width))
    return [slice(start, start + size) for start in range(0, count, size)]
