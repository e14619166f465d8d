"""A polytope in few dimensions from its support vectors alone."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from infoset.polytope.polytope import Polytope

Floats = NDArray[np.float64]

_MOST_ROUNDS = 200
_FLAT = 1e-7


def shadow(
    furthest: Callable[[Floats], Floats], space: int, tolerance: float = 1e-9, most_facets: int = 10_000
) -> Polytope:
    """Return a polytope from its support vectors: a projection of a set that is known only by programs over it.

    Parameters
    ----------
    furthest : callable
        Returns a point of the set furthest along a direction, both of shape (space,).
    space : int
        2 or 3; more works but the cost grows fast.
    tolerance : float
        Greatest relative distance by which a facet may be inside the set.
    most_facets : int
        Limit of the number of facets.

    Returns
    -------
    Polytope
        Its vertices are points of the set; its facets are supported to within the tolerance.

    Raises
    ------
    ArithmeticError
        If it has too many facets.

    Notes
    -----
    The hull of the points known is enlarged: each facet (and each direction across it, where it is flat) beyond which
    the set extends gives a new point. It ends when none does, after a program a facet and a vertex: exact, for a
    polytope.
    """
    unit = np.eye(space)
    points = np.array([furthest(direction) for direction in np.vstack([unit, -unit])])
    known: set[tuple[float, ...]] = set()
    for _ in range(_MOST_ROUNDS):
        hull = Polytope.from_vertices(points, _FLAT)
        size = max(float(np.ptp(points, axis=0).max()), 1e-12 * float(np.abs(points).max()))
        rows = np.vstack([hull.normals, hull.across, -hull.across])
        limits = np.concatenate([hull.offsets, hull.levels, -hull.levels])
        if len(rows) > most_facets:
            raise ArithmeticError(f"the projection has over {most_facets} facets")
        new = []
        for row, limit in zip(rows, limits, strict=True):
            key = tuple((row + 0.0).round(10))
            if key in known:
                continue
            point = furthest(row)
            if row @ point > limit + tolerance * size:
                new.append(point)
            else:
                known.add(key)
        if not new:
            return hull
        points = np.vstack([hull.vertices, new])
    raise ArithmeticError("the projection did not end")
