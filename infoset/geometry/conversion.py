"""Conversion of convex sets of the plane to rings of vertices, and of rings to shapely.

The sets are shapely geometries, or the vertices of polytopes. A ring is an array of shape (k, 2)
with the vertices counter-clockwise: one of a point, two of a segment, none of the empty set. The
methods of `ConvexPolygons` and `Polytope` with the same purpose call these functions.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from infoset.arrays import Floats
from infoset.geometry import polygon_batches as kernels
from infoset.geometry._set_arguments import finite_values
from infoset.limits import shown

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

AREA_ROUNDING = 64.0 * float(np.finfo(np.float64).eps)
"""Rounding of an area, relative to the products of coordinates and widths in it.

Areas of rings of 1000 vertices differ by at most 10 units of rounding from the areas of their
hulls.
"""


def ring_of_points(points: Floats) -> Floats:
    """Return the ring of the convex hull of points, shape (n, 2).

    O(n) for sorted points, O(n^2) at worst. Exact: vertices are points, and rounding does not
    decide which.
    """
    count = len(points)
    ring = np.zeros((1, count, 2))
    made = np.zeros(1, dtype=np.int64)
    kernels.hull(np.ascontiguousarray(points)[None], np.array([count], dtype=np.int64), ring, made)
    return ring[0, : int(made[0])]


def ring_of_geometry(geometry: BaseGeometry) -> Floats:
    """Return the ring of a convex shapely Point, LineString or Polygon. O(n^2) at worst.

    Vertices along a side are dropped.

    Raises
    ------
    ValueError
        If the geometry is of another type, or it is not convex by more than rounding.
    """
    from shapely import get_coordinates

    kind = getattr(geometry, "geom_type", None)
    if kind not in ("Point", "LineString", "Polygon"):
        raise ValueError(f"a Point, a LineString or a Polygon is needed: got {shown(geometry)}")
    points = finite_values("points", get_coordinates(geometry), "k", 2)
    ring = ring_of_points(points)
    if not len(points):
        return ring

    # Products of an x with a height of the set, and of a y with a width: hence the reversed order.
    rounding = AREA_ROUNDING * np.abs(points).max(axis=0) @ np.ptp(points, axis=0)[::-1]
    missing = abs(geometry.convex_hull.area - geometry.area)
    if missing > rounding:
        raise ValueError(
            f"the {kind} is not convex: its area and that of its hull differ by {missing:g}"
        )
    return ring


def geometry_of_ring(ring: Floats) -> BaseGeometry:
    """Return a ring as a shapely Point, LineString or Polygon.

    A ring without vertices is an empty Polygon.
    """
    from shapely import LineString, Point, Polygon

    if len(ring) == 1:
        return Point(ring[0])
    if len(ring) == 2:
        return LineString(ring)
    return Polygon(ring)
