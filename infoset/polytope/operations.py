"""Polytopes in few dimensions from their support vectors alone, and functions that have become methods."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag

from infoset._set_arguments import need_set
from infoset.arrays import Floats
from infoset.polytope.polytope import Polytope

_MOST_ROUNDS = 200
_FLAT = 1e-7


def linear_image(polytope: Polytope, matrix: ArrayLike, shift: ArrayLike = 0.0) -> Polytope:
    """Return `polytope.affine_map(matrix, shift)`. Deprecated."""
    _warn("linear_image", "affine_map")
    return polytope.affine_map(matrix, shift)


def minkowski_sum(first: Polytope, second: Polytope) -> Polytope:
    """Return `first.minkowski_sum(second)`. Deprecated."""
    _warn("minkowski_sum", "minkowski_sum")
    return first.minkowski_sum(second)


def intersection(*polytopes: Polytope) -> Polytope:
    """Return the intersection; an empty one raises an EmptyPolytopeError. Deprecated."""
    _warn("intersection", "intersection")
    return polytopes[0].intersection(*polytopes[1:]).needed()


def cut(polytope: Polytope, normals: ArrayLike, offsets: ArrayLike) -> Polytope:
    """Return `polytope.cut(normals, upper=offsets)`; an empty set raises an EmptyPolytopeError. Deprecated."""
    _warn("cut", "cut")
    return polytope.cut(normals, upper=offsets).needed()


def projection(polytope: Polytope, axes: Sequence[int]) -> Polytope:
    """Return `polytope.project(axes)`. Deprecated."""
    _warn("projection", "project")
    return polytope.project(axes)


def _warn(old: str, new: str) -> None:
    warnings.warn(
        f"the function {old} is deprecated and will be removed: use the method {new} of Polytope",
        DeprecationWarning,
        stacklevel=3,
    )


def shadow(
    furthest: Callable[[Floats], Floats], space: int, tolerance: float = 1e-9, most_facets: int = 10_000
) -> Polytope:
    """Return a polytope from its support vectors: a projection of a set that is known only by programs over it.

    `furthest` returns a point of the set furthest along a direction, both of shape (space,). `space` is 2 or 3; more
    works but the cost grows fast. Vertices of the result are points of the set; the set extends beyond its facets, at
    most `most_facets`, by no more than the relative `tolerance`.

    The hull of the points known is enlarged: each facet (and each direction across it, where it is flat) beyond which
    the set extends gives a new point. It ends when none does, after a program a facet and a vertex: exact, for a
    polytope.

    Raises
    ------
    ArithmeticError
        If it has too many facets.
    """
    unit = np.eye(space)
    points = np.array([furthest(direction) for direction in np.vstack([unit, -unit])])
    known: set[tuple[float, ...]] = set()
    for _ in range(_MOST_ROUNDS):
        hull = Polytope.from_vertices(points, _FLAT)
        size = max(float(np.ptp(points, axis=0).max()), 1e-12 * float(np.abs(points).max()))
        rows, limits = hull.constraints()
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


def product(*polytopes: Polytope) -> Polytope:
    """Return the Cartesian product of `polytopes`, with v1 v2 ... vertices and f1 + f2 + ... facets.

    Raises
    ------
    ValueError
        If there is no polytope.
    """
    if not [need_set("each factor", factor, Polytope) for factor in polytopes]:
        raise ValueError("a product needs at least one polytope")
    vertices = polytopes[0].vertices
    for factor in polytopes[1:]:
        left = np.repeat(vertices, len(factor.vertices), axis=0)
        vertices = np.hstack([left, np.tile(factor.vertices, (len(vertices), 1))])
    return Polytope(
        vertices,
        block_diag(*[factor.normals for factor in polytopes]),
        np.concatenate([factor.offsets for factor in polytopes]),
        block_diag(*[factor.across for factor in polytopes]),
        np.concatenate([factor.levels for factor in polytopes]),
    )
