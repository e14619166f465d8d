"""Polytopes in few dimensions from their support vectors alone, and products."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.linalg import block_diag

from infoset.arrays import Floats
from infoset.geometry._set_arguments import need_set
from infoset.geometry.polytope.polytope import Polytope
from infoset.geometry.tolerances import ON, REDUCED

_MAX_ROUNDS = 200
"""Maximum number of enlargements of the hull, a guard: each adds a point beyond every facet that
the set exceeds, so that a set with at most `max_facets` facets is found after few enlargements.
"""
_FLAT = 4.0 * REDUCED
"""Thickness of a flat set of points that a solver of linear programs found: 1.2e-7. HiGHS satisfies
constraints to 1e-7 by default.
"""


def polytope_from_support(
    furthest: Callable[[Floats], Floats],
    space: int,
    # Chosen: random and published projections have the same number of vertices from a quarter of
    # this to four times this (measured).
    tolerance: float = 1e-9,
    # A guard: `furthest`, often a linear program, is called for each facet.
    max_facets: int = 10_000,
) -> Polytope:
    """Return a polytope from its support vectors, such as a projection of a set of programs.

    `furthest` returns a point of the set furthest along a direction, both of shape (space,).
    `space` is 2 or 3; more works but the cost grows fast. Vertices of the result are points of the
    set; the set extends beyond its facets, at most `max_facets`, by no more than `tolerance` times
    its greatest width along an axis. An equation of a flat set counts as two facets.

    The hull of the known points is enlarged: each facet beyond which the set extends gives a new
    point, and so does each direction across a flat hull. It ends if there is no such facet, after
    one call of `furthest` for each facet and vertex; for a polytope the result is exact.

    Raises
    ------
    ArithmeticError
        If the hull has more than `max_facets` facets, or does not end after 200 enlargements.
    """
    unit = np.eye(space)
    points = np.array([furthest(direction) for direction in np.vstack([unit, -unit])])
    known: set[tuple[float, ...]] = set()
    for _ in range(_MAX_ROUNDS):
        hull = Polytope.from_vertices(points, _FLAT)
        # A point of a set far from the origin is known to ON of its coordinates.
        size = max(float(np.ptp(points, axis=0).max()), ON * float(np.abs(points).max()))
        rows, limits = hull.constraints()
        if len(rows) > max_facets:
            raise ArithmeticError(f"the projection has over {max_facets} facets")
        new = []
        for row, limit in zip(rows, limits, strict=True):
            # Unit normals that agree in 10 digits are the same facet, computed again. The sum makes
            # -0.0 to 0.0.
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


def product(*polytopes: Polytope) -> Polytope:
    """Return the Cartesian product of `polytopes`.

    It has v1 v2 ... vertices and f1 + f2 + ... facets.

    Raises
    ------
    ValueError
        If there is no polytope.
    """
    factors = [need_set("each factor", factor, Polytope) for factor in polytopes]
    if not factors:
        raise ValueError("a product needs at least one polytope")
    if any(factor.is_empty for factor in polytopes):
        return Polytope.empty(sum(factor.space for factor in polytopes))
    if not all(factor.is_bounded for factor in polytopes):
        return _product_of_cylinders(polytopes)

    points = polytopes[0].points
    on = polytopes[0].incidence
    for factor in polytopes[1:]:
        # Each point with each point of the factor.
        before = len(points)
        count = len(factor.points)
        points = np.hstack([np.repeat(points, count, axis=0), np.tile(factor.points, (before, 1))])
        on = np.hstack([np.repeat(on, count, axis=0), np.tile(factor.incidence, (before, 1))])
    facets = _side_by_side([one.facets for one in polytopes])
    equations = _side_by_side([one.equations for one in polytopes])
    centre = np.concatenate([one.centre for one in polytopes])
    scale = np.concatenate([one.scale for one in polytopes])
    return Polytope(points, facets, equations, on, centre, scale)


def _product_of_cylinders(polytopes: Sequence[Polytope]) -> Polytope:
    """Return the product of sets, some of them unbounded: the points whose parts are in them."""
    spaces = [factor.space for factor in polytopes]
    axes = np.split(np.eye(sum(spaces)), np.cumsum(spaces)[:-1])
    cylinders = [factor.preimage(rows) for factor, rows in zip(polytopes, axes, strict=True)]
    return cylinders[0].intersection(*cylinders[1:])


def _side_by_side(tables: Sequence[Floats]) -> Floats:
    """Return rows (a, b) of the factors of a product as rows of the product."""
    normals = block_diag(*[rows[:, :-1] for rows in tables])
    limits = np.concatenate([rows[:, -1] for rows in tables])
    return np.column_stack([normals, limits])
