"""Conversion of polygons to and from shapely."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from infoset.convex_polygons import ConvexPolygons

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry


def to_shapely(polygon: ConvexPolygons) -> BaseGeometry:
    """Return a single polygon as a shapely Point, LineString or Polygon; the empty set is an empty Polygon."""
    from shapely import LineString, Point, Polygon

    vertices = polygon.polygon()
    if len(vertices) == 1:
        return Point(vertices[0])
    if len(vertices) == 2:
        return LineString(vertices)
    return Polygon(vertices)


def from_shapely(geometry: BaseGeometry) -> ConvexPolygons:
    """Return a convex shapely Point, LineString or Polygon as a single polygon.

    Raises
    ------
    ValueError
        If the geometry is not convex, or not a Point, LineString or Polygon.
    """
    from shapely.geometry.polygon import orient

    if geometry.is_empty:
        return ConvexPolygons.empty()
    if geometry.geom_type == "Polygon":
        vertices = np.asarray(orient(geometry).exterior.coords)[:-1, :2]
        if not np.isclose(geometry.area, geometry.convex_hull.area, rtol=1e-9, atol=0.0):
            raise ValueError("the polygon is not convex")
    elif geometry.geom_type in ("Point", "LineString"):
        vertices = np.asarray(geometry.coords)[:, :2]
        if len(vertices) > 2:
            raise ValueError("a line must be a single segment")
    else:
        raise ValueError(f"a Point, LineString or Polygon is needed: got {geometry.geom_type}")
    return ConvexPolygons(vertices, len(vertices))
