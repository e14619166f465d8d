"""Double description: the extreme rays of a polyhedral cone, one of its rows after the other.

A polytope {y: a . y <= b} is the cone {(y, t): b t - a . y >= 0, t >= 0}; its vertices are the
extreme rays with t = 1 (`affine`). In the dual, points y are the rows (-y, 1) of a cone whose
extreme rays are the facets (a, b). Bit i of a ray is set if it lies on row i. A row's longest entry
is about one.

Numbers are rounded here, so that a result may be wrong: `construction` proves it or computes it
with integers (`cone`).

References
----------
K. Fukuda and A. Prodon, Double description method revisited, in Combinatorics and Computer Science
(1996).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from infoset.arrays import Flags, Floats, Integers
from infoset.geometry.polytope.incidence import Bits, common, contains_common, packed, unpacked
from infoset.geometry.tolerances import ON
from infoset.kernels import Kernels

_kernels = Kernels()


@_kernels.inlined
def dot(one: Floats, other: Floats) -> float:
    """Return the sum of products of the entries of `one` and the first entries of the other."""
    total = 0.0
    for i in range(len(one)):
        total += one[i] * other[i]
    return total


@_kernels.inlined
def size_of(ray: Floats) -> float:
    """Return the maximum absolute entry."""
    size = 0.0
    for value in ray:
        size = max(size, abs(value))
    return size


@_kernels.inlined
def unit_of(ray: Floats) -> float:
    """Return a power of two: times this, the maximum absolute entry is from 1/2 to 1."""
    return math.ldexp(1.0, -math.frexp(size_of(ray))[1])


@_kernels.compiled
def in_units(rows: Floats) -> Floats:
    """Return rows times powers of two: the maximum absolute entry of each row is from 1/2 to 1."""
    return np.asarray(rows * np.array([unit_of(row) for row in rows]).reshape(-1, 1))


def rows_of_cone(facets: Floats) -> Floats:
    """Return the rows (-a, b) of a cone for half-spaces, rows (a, b): b t - a . y >= 0."""
    signs = [-1.0] * (facets.shape[1] - 1) + [1.0]
    return facets * signs


def extreme_rays(rows: Floats, affine: bool, tolerance: float) -> tuple[Floats, Flags]:
    """Return the extreme rays, shape (k, D), of {z: rows z >= 0}, and which ray is on which row.

    If `affine`, the first row is t >= 0, and rays with t > 0 have t = 1. It starts with the
    simplicial cone of D rows and inserts the others in their order. If the rank of the rows is
    below D to a `tolerance`, it returns no rays.
    """
    m, size = rows.shape
    chosen, _ = pivots(rows, tolerance, 0 if affine else -1)
    if len(chosen) < size:
        return np.empty((0, size)), np.empty((0, m), np.bool_)

    # Each ray of a simplicial cone lies on all of its rows but one.
    rays = np.array(np.linalg.inv(rows[chosen]).T, np.float64, order="C")
    on = np.zeros((size, m), np.bool_)
    on[:, chosen] = ~np.eye(size, dtype=np.bool_)
    if affine:
        # The first ray is not on t >= 0: it is a point, and the others are directions.
        rays[:, -1] = np.eye(size)[0]
        rays[1:] = in_units(rays)[1:]
    else:
        rays = in_units(rays)

    others = np.delete(np.arange(m), chosen)
    # An edge of a cone of D dimensions lies on at least D - 2 of its rows.
    return insert_rows(rays, on, rows[others], others, size - 2, affine)


@_kernels.compiled
def pivots(rows: Floats, tolerance: float, first: Any) -> tuple[Integers, Integers]:
    """Return rows and columns of a regular part of a matrix, shapes (r,), by complete pivoting.

    A pivot up to `tolerance` ends it. If `first` >= 0, the first pivot is the last entry of that
    row.
    """
    k, size = rows.shape
    table = rows.copy()
    chosen = np.empty(min(k, size), np.int64)
    columns = np.empty(min(k, size), np.int64)
    for step in range(min(k, size)):
        if step or first < 0:
            best = np.abs(table).argmax()
        else:
            best = first * size + size - 1
        row = best // size
        column = best % size
        if abs(table[row, column]) <= tolerance:
            return chosen[:step].copy(), columns[:step].copy()

        chosen[step] = row
        columns[step] = column
        table -= np.outer(table[:, column] / table[row, column], table[row])
        # These entries are zero but for rounding.
        table[row] = 0.0
        table[:, column] = 0.0
    return chosen, columns


@_kernels.compiled
def insert_rows(
    rays: Floats, on: Flags, rows: Floats, numbers: Integers, least: int, affine: Any
) -> tuple[Floats, Flags]:
    """Return the rays with row . z >= 0 for rows with some `numbers`, and their incidence.

    `on`, shape (k, m), is whether a ray is on a row. It has columns for the new rows, too; see
    `insert`.
    """
    bits = packed(on)
    for k in range(len(rows)):
        rays, bits = insert(rays, bits, rows[k], numbers[k], least, affine)
    return rays, unpacked(bits, on.shape[1])


@_kernels.compiled
def insert(
    rays: Floats, bits: Bits, row: Floats, number: int, least: int, affine: Any
) -> tuple[Floats, Bits]:
    """Return the rays with row . z >= 0, shape (k, D), and their bits, shape (k, words).

    One step of the double description: rays with row . z < 0 go; each edge that crosses the row
    gives a ray on it. `number` is the bit of the row; see `sides` and `crossings`.
    """
    heights = sides(rays, row)
    new, marks = crossings(rays, bits, heights, least, affine)

    on = heights == 0.0
    above = heights > 0.0
    on_row = on.sum()
    old = (heights >= 0.0).sum()
    rays = np.concatenate((rays[on], rays[above], new))
    bits = np.concatenate((bits[on], bits[above], marks))

    word = number // 64
    bit = np.uint64(1) << np.uint64(number % 64)
    bits[:on_row, word] |= bit
    bits[old:, word] |= bit
    return rays, bits


@_kernels.compiled
def sides(rays: Floats, row: Floats) -> Floats:
    """Return the heights row . z of rays, 0 for rays on the row: within ON of their lengths."""
    heights = np.array([dot(row, ray) for ray in rays])
    lengths = np.array([size_of(ray) for ray in rays])
    return np.asarray(heights * (np.abs(heights) > ON * lengths))


@_kernels.compiled
def crossings(
    rays: Floats, bits: Bits, heights: Floats, least: int, affine: Any
) -> tuple[Floats, Bits]:
    """Return the rays in which edges cross a row, and the common bits of the ends of the edges.

    `heights` are the heights of the rays over the row (`sides`); an edge lies on at least `least`
    rows. O(k words) for each ray on the smaller side and each pair with as many rows.
    """
    k, size = rays.shape
    columns = np.ascontiguousarray(bits.T)
    result = np.empty((2 * k, size))
    marks = np.empty((2 * k, bits.shape[1]), np.uint64)
    shared = np.empty(k, np.int64)
    near = np.empty(k, np.int64)

    # Pairs are searched from the side with fewer rays, which takes less time.
    fewer = heights < 0.0 if (heights < 0.0).sum() < (heights > 0.0).sum() else heights > 0.0
    count = 0
    for one in np.flatnonzero(fewer):
        # One ray spans at most k edges.
        if count + k > len(result):
            result = np.concatenate((result, result))
            marks = np.concatenate((marks, marks))
        work = columns, shared, near, result[count:], marks[count:]
        count += _cross(one, rays, bits, heights, least, affine, work)
    return result[:count], marks[:count]


@_kernels.allocation_free
def _cross(
    one: Any,
    rays: Floats,
    bits: Bits,
    heights: Floats,
    least: int,
    affine: Any,
    work: tuple[Any, ...],
) -> int:
    """Write the rays in which edges of one ray cross the row, and their bits; return their number.

    See `crossings`. `work` is the transposed bits, two arrays for work, and the two results.
    """
    columns, shared, near, result, marks = work
    common(bits[one], columns, shared)
    # Only rays with enough common rows can be the other end of an edge, or forbid it.
    found = 0
    for third in range(len(rays)):
        near[found] = third
        found += shared[third] >= least

    count = 0
    for other in near[:found]:
        p, q = (one, other) if heights[one] > 0.0 else (other, one)
        if heights[p] > 0.0 > heights[q] and _is_edge(bits, near[:found], p, q):
            _combine(rays[p], rays[q], heights[p], -heights[q], affine, result[count])
            for word in range(bits.shape[1]):
                marks[count, word] = bits[p, word] & bits[q, word]
            count += 1
    return count


@_kernels.allocation_free
def _is_edge(bits: Bits, others: Integers, p: Any, q: Any) -> bool:
    """Whether none of the `others`, numbers of rays, lies on all rows on which p and q lie."""
    forbidden = False
    for k in others:
        forbidden |= k not in (p, q) and contains_common(bits[k], bits[p], bits[q])
    return not forbidden


@_kernels.allocation_free
def _combine(p: Floats, q: Floats, alpha: float, beta: float, affine: Any, result: Floats) -> None:
    """Write the ray alpha q + beta p; with t = 1 if it is a point.

    Coordinates that both points share stay exact.
    """
    last = len(p) - 1
    total = alpha * q[last] + beta * p[last] if affine else 0.0
    if total > 0.0:
        # Start from the nearer point, which is q.
        if beta * p[last] > alpha * q[last]:
            p, q, beta = q, p, alpha
        for i in range(len(p)):
            result[i] = q[i] + beta / total * (p[i] - p[last] * q[i])
        return

    for i in range(len(p)):
        result[i] = alpha * q[i] + beta * p[i]
    result *= unit_of(result)
