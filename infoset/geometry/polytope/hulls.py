"""Convex hulls of points, flat ones included: the double description in the dual, checked.

The facets of a hull are computed with rounded numbers. They are kept if they prove to be all
(`incidence.is_closed`); otherwise they are computed again with integers (`cone`), which round
nothing.
"""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

import numpy as np

from infoset.arrays import Flags, Floats, Integers
from infoset.geometry.double_words import supports
from infoset.geometry.polytope import cone
from infoset.geometry.polytope import double_description as dd
from infoset.geometry.polytope.arrays import PolytopeArrays
from infoset.geometry.polytope.incidence import is_closed, without_redundant
from infoset.geometry.polytope.scaled_coordinates import coordinates
from infoset.geometry.polytope.vertex_checks import SAME_VERTEX, loses_points, touching
from infoset.geometry.tolerances import SNAP


def hull_of(points: Floats, flat: float = SNAP) -> PolytopeArrays:
    """Return the convex hull of points, shape (m, n), at least one; see `hull`."""
    space = points.shape[1]
    centre, scale = coordinates(points.min(axis=0), points.max(axis=0), np.zeros(space), SNAP)
    return hull((points - centre) / scale, centre, scale, flat)


def hull(points: Floats, centre: Floats, scale: Floats, flat: float = SNAP) -> PolytopeArrays:
    """Return the convex hull of points in scaled coordinates, flat if it is thinner than `flat`.

    Points of a set of dimension d differ in d coordinates, found by complete pivoting. The hull is
    computed in these own coordinates; the other coordinates are affine functions of them.
    """
    space = points.shape[1]
    # The first pivot is the 1 of the first point: the next ones are differences from this point.
    homogeneous = np.column_stack([points, np.ones(len(points))])
    chosen, columns = dd.pivots(homogeneous, flat, 0)
    own = columns[1:]
    others = np.delete(np.arange(space), own)

    functions = np.linalg.solve(
        homogeneous[chosen][:, [*own, space]], points[np.ix_(chosen, others)]
    ).T
    equations = np.eye(space, space + 1)[others]
    equations[:, own] = -functions[:, :-1]
    equations[:, -1] = functions[:, -1]

    if not len(own):
        no_facet = equations[:0]
        on = np.zeros((1, 0), np.bool_)
        return PolytopeArrays(points[:1].copy(), no_facet, equations, on, centre, scale)

    if len(others):
        # The two sides of a flat set are the same points, to its thickness.
        cells = np.rint(points[:, own] / SNAP)
        _, first = np.unique(cells, axis=0, return_index=True)
        points = points[np.sort(first)]

    inner = np.ascontiguousarray(points[:, own])
    sides = _sides_of(inner)
    facets = np.zeros((len(sides.normals), space + 1))
    facets[:, own] = sides.normals
    facets[:, -1] = supports(inner, sides.normals)
    return PolytopeArrays(points[sides.vertices], facets, equations, sides.on, centre, scale)


def spans_less(points: Floats, flat: float) -> bool:
    """Whether points are in a plane, to a distance `flat`."""
    homogeneous = np.column_stack([points, np.ones(len(points))])
    chosen, _ = dd.pivots(homogeneous, flat, 0)
    return bool(len(chosen) <= points.shape[1])


class _Sides(NamedTuple):
    """Facets of the hull of points."""

    vertices: Integers
    """Numbers of the points that are vertices, shape (v,)."""
    normals: Floats
    """Normals of the facets, shape (f, d)."""
    on: Flags
    """Whether a vertex is on a facet, shape (v, f)."""


def _sides_of(points: Floats) -> _Sides:
    """Return the facets of the hull of points, shape (m, d), that have an interior."""
    # Points x are the rows (-x, 1) of a cone: its extreme rays (a, b) are the facets a . x <= b.
    rows = np.column_stack([-points, np.ones(len(points))])
    rays, on = dd.extreme_rays(rows, False, 0.0)
    found = _checked_sides(points, rays, on.T.copy())
    if found is not None:
        return found

    exact_rows = [
        cone.whole([*(-entry for entry in point), Fraction(1)]) for point in cone.rationals(points)
    ]
    exact = cone.extreme_rays(exact_rows)
    rays = np.array([cone.rounded(ray) for ray in exact.rays])
    on = exact.on.T.copy()
    found = _checked_sides(points, rays, on)
    if found is not None:
        return found

    # Facets at a small angle have points within SNAP of both: the incidence is the exact one.
    return _needed_sides(rays, on)


def _checked_sides(points: Floats, rays: Floats, on: Flags) -> _Sides | None:
    """Return the facets among the rays if they prove to be all, else None.

    `on`, shape (m, f), is whether a point is on a ray. Rounding can divide a facet in two rays,
    each on some of its points: with all points within SNAP, they are one.
    """
    dimension = points.shape[1]
    # All facets were computed (none is known before), and SNAP is taken as a distance, not relative
    # to the largest coordinate.
    snapped, is_consistent = touching(points, rays, on, 0, 1.0, SNAP)
    if not is_consistent:
        return None

    for incidence in (on, snapped):
        found = _needed_sides(rays, incidence)
        is_lost = loses_points(points, found.vertices, incidence, dimension, SAME_VERTEX)
        if not is_lost and is_closed(found.on, dimension):
            return found
    return None


def _needed_sides(rays: Floats, on: Flags) -> _Sides:
    """Return the facets without redundant points and rays."""
    needed = without_redundant(on, rays.shape[1] - 1)
    return _Sides(needed.points, rays[needed.rows, :-1].copy(), needed.on)
