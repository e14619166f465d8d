"""Operations on polytopes that make new ones, and polytopes in few dimensions from their support vectors alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import block_diag

from infoset.polytope.polytope import Polytope

Floats = NDArray[np.float64]

_MOST_ROUNDS = 200
_FLAT = 1e-7


def linear_image(polytope: Polytope, matrix: ArrayLike, shift: ArrayLike = 0.0) -> Polytope:
    """Return {matrix x + shift: x in the polytope}, the hull of the image of the vertices.

    `matrix`, shape (m, n), may be singular: the image of the `polytope` is then flat. `shift` has shape (m,).
    """
    return Polytope.from_vertices(polytope.vertices @ np.asarray(matrix, dtype=float).T + np.asarray(shift, float))


def minkowski_sum(first: Polytope, second: Polytope) -> Polytope:
    """Return {x + y: x in the first, y in the second}, the hull of all v1 v2 sums of two vertices."""
    sums = first.vertices[:, None, :] + second.vertices[None, :, :]
    return Polytope.from_vertices(sums.reshape(-1, first.space))


def intersection(*polytopes: Polytope) -> Polytope:
    """Return the intersection of `polytopes`, at least one; `EmptyPolytopeError` is raised where it is empty."""
    return Polytope.from_halfspaces(
        np.vstack([polytope.normals for polytope in polytopes]),
        np.concatenate([polytope.offsets for polytope in polytopes]),
        np.vstack([polytope.across for polytope in polytopes]),
        np.concatenate([polytope.levels for polytope in polytopes]),
        bounded=True,
    )


def cut(polytope: Polytope, normals: ArrayLike, offsets: ArrayLike) -> Polytope:
    """Return {x in the polytope: normals x <= offsets}, or the `polytope` itself where nothing is cut off.

    `normals` have shape (m, n), `offsets` shape (m,); `EmptyPolytopeError` is raised where the set is empty.
    """
    rows, limits = np.asarray(normals, dtype=float), np.asarray(offsets, dtype=float)
    cuts = polytope.support(rows) > limits
    if not cuts.any():
        return polytope
    return Polytope.from_halfspaces(
        np.vstack([polytope.normals, rows[cuts]]),
        np.concatenate([polytope.offsets, limits[cuts]]),
        polytope.across,
        polytope.levels,
        bounded=True,
    )


def projection(polytope: Polytope, axes: Sequence[int]) -> Polytope:
    """Return the projection of a `polytope` on some `axes`, in a space of as many dimensions."""
    return Polytope.from_vertices(polytope.vertices[:, list(axes)])


def product(*polytopes: Polytope) -> Polytope:
    """Return the Cartesian product of `polytopes`, at least one, with v1 v2 ... vertices and f1 + f2 + ... facets."""
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
