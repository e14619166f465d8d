"""Comparison of computed vertices with computed facets, compiled.

All arrays are in scaled coordinates; see `Polytope`. The checks do not change numbers, except
`refined`, which computes vertices again.
"""

from __future__ import annotations

import numpy as np

from infoset.arrays import Flags, Floats, Integers
from infoset.geometry.polytope.double_description import dot, size_of
from infoset.geometry.tolerances import SNAP
from infoset.kernels import Kernels

_kernels = Kernels()
SAME_VERTEX = 64.0 * SNAP
"""Distance of points that are the same vertex: both are within SNAP of its facets. In the plane
they are if the facets are at an angle above 1.8 degrees.
"""


@_kernels.compiled
def touching(
    points: Floats, facets: Floats, on: Flags, known: int, size: float, far: float
) -> tuple[Flags, bool]:
    """Return the incidence with all points within SNAP of a facet, and whether it is consistent.

    It is not if a point is outside of a facet by more than `far`, or this far away from a facet
    that it is `on`, shape (v, f). Only points on facets after the first `known` are compared, all
    if `known` is 0. `size` is the maximum coordinate of the points, at least one: SNAP is relative
    to it.
    """
    n = points.shape[1]
    units = np.array([size_of(facet) for facet in facets])
    result = on.copy()
    is_consistent = True
    for i in range(len(points)):
        if known > 0 and not on[i, known:].any():
            continue

        for j in range(len(facets)):
            height = dot(points[i], facets[j]) - facets[j, n]
            limit = far * units[j]
            # Positive heights are outside.
            is_consistent &= height <= limit and (height >= -limit or not on[i, j])
            result[i, j] |= height >= -SNAP * size * units[j]
    return result, is_consistent


@_kernels.compiled
def refined(points: Floats, facets: Floats, equations: Floats, on: Flags, known: int) -> Floats:
    """Return points; points on facets after the first `known` move to where their facets meet.

    All points move if `known` is 0. The steps have the least length at which the facets are met
    best. Cuts of a small part combine points that are far from it, so that their rounding grows.
    """
    n = points.shape[1]
    result = points.copy()
    for i in range(len(points)):
        if known > 0 and not on[i, known:].any():
            continue

        rows = np.concatenate((facets[on[i]], equations))
        gaps = np.array([row[n] - dot(points[i], row) for row in rows])
        result[i] += np.linalg.lstsq(np.ascontiguousarray(rows[:, :n]), gaps)[0]
    return result


@_kernels.compiled
def loses_points(points: Floats, used: Integers, on: Flags, least: int, distance: float) -> bool:
    """Whether a vertex is lost: a point on `least` or more facets, far from all that are `used`.

    Far is farther than `distance` along an axis. Between facets at a small angle many points are
    near both: the incidence does not show which of them are vertices.
    """
    is_used = np.zeros(len(points), np.bool_)
    is_used[used] = True
    for i in range(len(points)):
        if is_used[i] or on[i].sum() < least:
            continue

        nearest = np.inf
        for k in used:
            apart = 0.0
            for j in range(points.shape[1]):
                apart = max(apart, abs(points[i, j] - points[k, j]))
            nearest = min(nearest, apart)
        if nearest > distance:
            return True
    return False
