"""Volume, division into simplices and largest ball of polytopes, and the shortest difference between two hulls.

`axes` are coordinates in which the set is about one wide, None if its own do not differ much.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull, Delaunay

from infoset.arrays import Floats
from infoset.geometry.polytope._affine_hull import chebyshev_ball, frame_of
from infoset.geometry.polytope._scaling import LocalAxes

_MAX_STEPS = 1000
_PRECISION = 1e-14


def volume_of(vertices: Floats, axes: LocalAxes | None) -> float:
    """Return the volume within the affine hull of vertices, shape (v, n); 1 for a point."""
    frame = frame_of(vertices if axes is None else axes.inward(vertices))
    scale = float(np.prod(frame.extents)) if axes is None else axes.volume(frame.basis * frame.extents)
    if frame.dimension < 2:
        return scale * 2.0 if frame.dimension else 1.0
    inner = frame.inward(vertices if axes is None else axes.inward(vertices))
    return float(ConvexHull(inner).volume) * scale


def simplices_of(vertices: Floats, axes: LocalAxes | None) -> tuple[Floats, Floats]:
    """Return simplices that divide the hull, shape (k, d + 1, n), and their shares of the volume, shape (k,)."""
    scaled = vertices if axes is None else axes.inward(vertices)
    frame = frame_of(scaled)
    if len(vertices) == frame.dimension + 1:
        return vertices[None], np.ones(1)
    inner = frame.inward(scaled)
    corners = Delaunay(inner, qhull_options="QJ").simplices
    sizes = np.abs(np.linalg.det(inner[corners[:, 1:]] - inner[corners[:, :1]]))
    return vertices[corners], sizes / sizes.sum()


def max_ball(vertices: Floats, normals: Floats, offsets: Floats, axes: LocalAxes | None) -> tuple[Floats, float]:
    """Return the centre, shape (n,), and the radius of a largest ball within the affine hull."""
    frame = frame_of(vertices if axes is None else axes.inward(vertices))
    if not frame.dimension:
        return vertices[0], 0.0
    if axes is not None:  # in coordinates of the frame; the unit of the radius is the minimum distance of a facet
        steps = axes.spread((frame.basis * frame.extents).T)
        middle, rows = vertices.mean(axis=0), normals @ steps.T
        sizes = np.abs(rows).max(axis=1)
        minimum = float(sizes.min())
        inner, radius = chebyshev_ball(rows / sizes[:, None], (offsets - normals @ middle) / sizes, minimum / sizes)
        return middle + inner @ steps, minimum * max(0.0, radius)
    scale = float(frame.extents.max())
    rows = normals @ frame.basis
    sizes = np.linalg.norm(rows, axis=1)
    limits = (offsets - normals @ frame.centre) / (scale * sizes)
    centre, radius = chebyshev_ball(rows / sizes[:, None], limits)
    return frame.centre + scale * frame.basis @ centre, scale * max(0.0, radius)


def nearest_difference(one: Floats, two: Floats) -> Floats:
    """Return the shortest vector p - q, with p and q in the convex hulls of points of shapes (k, n) and (m, n).

    References
    ----------
    P. Wolfe, Finding the nearest point in a polytope, Mathematical Programming 11 (1976).
    """
    size = max(float(np.abs(one - two[0]).max()), float(np.abs(two - two[0]).max()), 1e-300)
    corral = (one[:1] - two[:1]) / size
    shares = np.ones(1)
    for _ in range(_MAX_STEPS):
        x = shares @ corral
        p = one[int((one @ x).argmin())]
        q = two[int((two @ x).argmax())]
        point = (p - q) / size
        if x @ x - x @ point <= _PRECISION * max(float(x @ x), _PRECISION) or (corral == point).all(axis=1).any():
            break
        corral, shares = np.vstack([corral, point]), np.append(shares, 0.0)
        while True:
            target = _affine_minimizer(corral)
            if (target > 0.0).all():
                shares = target
                break
            # Go toward the minimizer until a share is zero; drop that point.
            below = target <= 0.0
            part = float(np.min(shares[below] / np.maximum(shares[below] - target[below], 1e-300)))
            shares = shares + min(1.0, part) * (target - shares)
            shares[below & (shares <= shares[below].min())] = 0.0
            kept = shares > 0.0
            corral, shares = corral[kept], shares[kept] / shares[kept].sum()
    return np.asarray(size * (shares @ corral))


def _affine_minimizer(corral: Floats) -> Floats:
    """Return the coefficients of the shortest point of the affine hull of points."""
    edges = corral[1:] - corral[0]
    weights = np.linalg.lstsq(edges.T, -corral[0], rcond=None)[0] if len(edges) else np.zeros(0)
    return np.append(1.0 - weights.sum(), weights)
