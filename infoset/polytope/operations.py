"""Operations on polytopes that make new ones."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from infoset.polytope.polytope import Polytope

Floats = NDArray[np.float64]


def linear_image(polytope: Polytope, matrix: ArrayLike, shift: ArrayLike = 0.0) -> Polytope:
    """Return {matrix x + shift: x in the polytope}.

    Parameters
    ----------
    polytope : Polytope
    matrix : array_like, shape (m, n)
        Singular ones too: the image is then flat.
    shift : array_like, shape (m,)

    Returns
    -------
    Polytope

    Notes
    -----
    The hull of the image of the vertices.
    """
    return Polytope.from_vertices(polytope.vertices @ np.asarray(matrix, dtype=float).T + np.asarray(shift, float))


def minkowski_sum(first: Polytope, second: Polytope) -> Polytope:
    """Return {x + y: x in the first, y in the second}.

    Parameters
    ----------
    first, second : Polytope

    Returns
    -------
    Polytope

    Notes
    -----
    The hull of all sums of two vertices, v1 v2 points.
    """
    sums = first.vertices[:, None, :] + second.vertices[None, :, :]
    return Polytope.from_vertices(sums.reshape(-1, first.space))


def intersection(*polytopes: Polytope) -> Polytope:
    """Return what polytopes have in common.

    Parameters
    ----------
    *polytopes : Polytope
        At least one.

    Returns
    -------
    Polytope

    Raises
    ------
    EmptyPolytopeError
        If that is nothing.
    """
    return Polytope.from_halfspaces(
        np.vstack([each.normals for each in polytopes]),
        np.concatenate([each.offsets for each in polytopes]),
        np.vstack([each.across for each in polytopes]),
        np.concatenate([each.levels for each in polytopes]),
        bounded=True,
    )


def cut(polytope: Polytope, normals: ArrayLike, offsets: ArrayLike) -> Polytope:
    """Return {x in the polytope: normals x <= offsets}.

    Parameters
    ----------
    polytope : Polytope
    normals : array_like, shape (m, n)
    offsets : array_like, shape (m,)

    Returns
    -------
    Polytope
        The same one where nothing is cut off.

    Raises
    ------
    EmptyPolytopeError
        If nothing is left.
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
    """Return the shadow of a polytope on some axes.

    Parameters
    ----------
    polytope : Polytope
    axes : sequence of int

    Returns
    -------
    Polytope
        In a space of as many dimensions as axes are named.
    """
    return Polytope.from_vertices(polytope.vertices[:, list(axes)])


def product(*polytopes: Polytope) -> Polytope:
    """Return the set of points whose first coordinates are in the first polytope, and so on.

    Parameters
    ----------
    *polytopes : Polytope
        At least one.

    Returns
    -------
    Polytope
        v1 v2 ... vertices, f1 + f2 + ... facets.
    """
    vertices = polytopes[0].vertices
    for each in polytopes[1:]:
        left = np.repeat(vertices, len(each.vertices), axis=0)
        vertices = np.hstack([left, np.tile(each.vertices, (len(vertices), 1))])
    space = vertices.shape[1]
    normals: list[Floats] = []
    across: list[Floats] = []
    start = 0
    for each in polytopes:
        for given, rows in ((each.normals, normals), (each.across, across)):
            wide = np.zeros((len(given), space))
            wide[:, start : start + each.space] = given
            rows.append(wide)
        start += each.space
    return Polytope(
        vertices,
        np.vstack(normals),
        np.concatenate([each.offsets for each in polytopes]),
        np.vstack(across),
        np.concatenate([each.levels for each in polytopes]),
    )
