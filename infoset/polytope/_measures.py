"""Volume, division into simplices, and largest ball of polytopes.

`stretch`, shape (n,), are scales of the axes of a set with an interior, None if they do not differ much.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull, Delaunay

from infoset.arrays import Floats
from infoset.polytope._affine_hull import chebyshev_ball, frame_of


def volume_of(vertices: Floats, stretch: Floats | None) -> float:
    """Return the volume within the affine hull of vertices, shape (v, n); 1 for a point."""
    frame = frame_of(vertices if stretch is None else vertices / stretch)
    scale = float(np.prod(frame.extents)) * (1.0 if stretch is None else float(np.prod(stretch)))
    if frame.dimension < 2:
        return scale * 2.0 if frame.dimension else 1.0
    inner = frame.inward(vertices if stretch is None else vertices / stretch)
    return float(ConvexHull(inner).volume) * scale


def simplices_of(vertices: Floats, stretch: Floats | None) -> tuple[Floats, Floats]:
    """Return simplices that divide the hull, shape (k, d + 1, n), and their shares of the volume, shape (k,)."""
    scaled = vertices if stretch is None else vertices / stretch
    frame = frame_of(scaled)
    if len(vertices) == frame.dimension + 1:
        return vertices[None], np.ones(1)
    inner = frame.inward(scaled)
    corners = Delaunay(inner, qhull_options="QJ").simplices
    sizes = np.abs(np.linalg.det(inner[corners[:, 1:]] - inner[corners[:, :1]]))
    return vertices[corners], sizes / sizes.sum()


def largest_ball(vertices: Floats, normals: Floats, offsets: Floats, stretch: Floats | None) -> tuple[Floats, float]:
    """Return the centre, shape (n,), and the radius of a largest ball within the affine hull."""
    if stretch is not None:  # in units of the axes, and of the shortest axis for the radius
        least = float(stretch.min())
        middle, rows = vertices.mean(axis=0), normals * stretch
        sizes = np.abs(rows).max(axis=1)
        limits = (offsets - normals @ middle) / sizes
        inner, radius = chebyshev_ball(rows / sizes[:, None], limits, least / sizes)
        return middle + stretch * inner, least * max(0.0, radius)
    frame = frame_of(vertices)
    if not frame.dimension:
        return frame.centre, 0.0
    scale = float(frame.extents.max())
    rows = normals @ frame.basis
    sizes = np.linalg.norm(rows, axis=1)
    limits = (offsets - normals @ frame.centre) / (scale * sizes)
    centre, radius = chebyshev_ball(rows / sizes[:, None], limits)
    return frame.centre + scale * frame.basis @ centre, scale * max(0.0, radius)
