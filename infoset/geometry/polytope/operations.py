"""Polytopes in few dimensions from their support vectors alone, and products."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg import block_diag

from infoset.arrays import Floats
from infoset.geometry._set_arguments import need_set
from infoset.geometry.polytope.polytope import Polytope
from infoset.geometry.tolerances import ON, REDUCED

_MAX_ROUNDS = 200
_FLAT = 4.0 * REDUCED
"""Thickness of a flat set of points that a solver of linear programs found."""


def polytope_from_support(
    furthest: Callable[[Floats], Floats],
    space: int,
    tolerance: float = 1e-9,
    max_facets: int = 10_000,
) -> Polytope:
    """Return a polytope from its support vectors: a projection of a set that is known only by
    programs over it.

    `furthest` returns a point of the set furthest along a direction, both of shape (space,).
    `space` is 2 or 3; more works but the cost grows fast. Vertices of the result are points of the
    set; the set extends beyond its facets, at most `max_facets`, by no more than the relative
    `tolerance`.

    The hull of the points known is enlarged: each facet (and each direction across it, where it is
    flat) beyond which the set extends gives a new point. It ends when none does, after a program a
    facet and a vertex: exact, for a polytope.

    Raises
    ------
    ArithmeticError
        If it has too many facets.
    """
    unit = np.eye(space)
    points = np.array([furthest(direction) for direction in np.vstack([unit, -unit])])
    known: set[tuple[float, ...]] = set()
    for _ in range(_MAX_ROUNDS):
        hull = Polytope.from_vertices(points, _FLAT)
        size = max(float(np.ptp(points, axis=0).max()), ON * float(np.abs(points).max()))
        rows, limits = hull.constraints()
        if len(rows) > max_facets:
            raise ArithmeticError(f"the projection has over {max_facets} facets")
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


def product(*polytopes: Polytope) -> Polytope:
    """Return the Cartesian product of `polytopes`, with v1 v2 ... vertices and f1 + f2 + ...
    facets.

    Raises
    ------
    ValueError
        If there is no polytope.
    """
    if not [need_set("each factor", factor, Polytope) for factor in polytopes]:
        raise ValueError("a product needs at least one polytope")
    if any(factor.is_empty for factor in polytopes):
        return Polytope.empty(sum(factor.space for factor in polytopes))
    if not all(factor.is_bounded for factor in polytopes):
        axes = np.eye(sum(factor.space for factor in polytopes))
        ends = np.cumsum([factor.space for factor in polytopes])[:-1]
        parts = zip(polytopes, np.split(axes, ends), strict=True)
        cylinders = [factor.preimage(rows) for factor, rows in parts]
        return cylinders[0].intersection(*cylinders[1:])
    points = polytopes[0].points
    on = polytopes[0].incidence
    for factor in polytopes[1:]:
        count = len(factor.points)
        on = np.hstack([np.repeat(on, count, axis=0), np.tile(factor.incidence, (len(points), 1))])
        points = np.hstack(
            [np.repeat(points, count, axis=0), np.tile(factor.points, (len(points), 1))]
        )
    facets, equations = (
        np.column_stack(
            [
                block_diag(*[rows[:, :-1] for rows in tables]),
                np.concatenate([rows[:, -1] for rows in tables]),
            ]
        )
        for tables in ([one.facets for one in polytopes], [one.equations for one in polytopes])
    )
    centre, scale = (
        np.concatenate([getattr(one, name) for one in polytopes]) for name in ("centre", "scale")
    )
    return Polytope(points, facets, equations, on, centre, scale)
