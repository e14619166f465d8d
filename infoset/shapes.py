"""Conversion of polygons to and from shapely."""

from infoset.convex_polygons import ConvexPolygons

from_shapely = ConvexPolygons.from_shapely
to_shapely = ConvexPolygons.to_shapely
