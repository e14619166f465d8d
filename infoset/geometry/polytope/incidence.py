"""Which vertex is on which facet, as bits: redundant vertices and facets, edges, and the proof that nothing is missing.

A set of bits has the shape (words,): bit i is set if a vertex lies on facet i. All of this is combinatorial: no number
is rounded here. See `is_closed` for the proof.

References
----------
K. Mehlhorn, S. Naeher, M. Seel, R. Seidel, T. Schilz, S. Schirra and C. Uhrig, Checking geometric programs or
verification of geometric structures, Computational Geometry 12 (1999).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from infoset.arrays import Flags, Integers
from infoset.kernels import Kernels

Bits = NDArray[np.uint64]
_kernels = Kernels()


@_kernels.inlined
def _ones(word: Any) -> int:
    """Return the number of bits of a word: LLVM makes one instruction of the loop, or one for several words."""
    count = 0
    while word:
        word &= word - np.uint64(1)
        count += 1
    return count


@_kernels.allocation_free
def common(one: Bits, others: Bits, counts: Integers) -> None:
    """Write the numbers of common bits of a set, shape (words,), and of others, shape (words, k)."""
    counts[:] = 0
    for word in range(len(one)):
        for k in range(len(counts)):
            counts[k] += _ones(one[word] & others[word, k])


@_kernels.inlined
def contains_common(third: Bits, one: Bits, other: Bits) -> bool:
    """Whether a set has all bits that two others have in common."""
    missing = np.uint64(0)
    for word in range(len(third)):
        missing |= one[word] & other[word] & ~third[word]
    return bool(missing == np.uint64(0))


@_kernels.compiled
def packed(flags: Flags) -> Bits:
    """Return rows of flags, shape (k, m), as bits, shape (k, words)."""
    bits = np.zeros((len(flags), (flags.shape[1] + 63) // 64), np.uint64)
    for i in range(len(flags)):
        for j in range(flags.shape[1]):
            if flags[i, j]:
                bits[i, j >> 6] |= np.uint64(1) << np.uint64(j & 63)
    return bits


@_kernels.compiled
def unpacked(bits: Bits, count: int) -> Flags:
    """Return the first `count` bits of rows as flags, shape (k, count)."""
    flags = np.empty((len(bits), count), np.bool_)
    for i in range(len(bits)):
        for j in range(count):
            flags[i, j] = bits[i, j >> 6] >> np.uint64(j & 63) & np.uint64(1)
    return flags


@_kernels.compiled
def _maximal(bits: Bits, least: int) -> Flags:
    """Return which sets have at least `least` bits and are in no other set, of equal ones the first."""
    columns = np.ascontiguousarray(bits.T)
    shared = np.empty(len(bits), np.int64)
    counts = np.empty(len(bits), np.int64)
    kept = np.ones(len(bits), np.bool_)
    for i in range(len(bits)):
        common(bits[i], columns, shared[: i + 1])
        counts[i] = shared[i]
        for j in range(i):
            if shared[j] == min(counts[i], counts[j]):
                kept[i if counts[i] <= counts[j] else j] = False
    return kept & (counts >= least)


@_kernels.compiled
def without_redundant(on: Flags, dimension: int) -> tuple[Integers, Integers, Flags]:
    """Return the numbers of the points and the rows that are not redundant, and which of these are on which.

    `on` has the shape (points, rows). A point is redundant if it is on fewer than `dimension` rows, or on no other rows
    than another point, and a row likewise.
    """
    points = np.arange(on.shape[0])
    rows = np.arange(on.shape[1])
    kept = np.zeros(1, np.bool_)
    while not kept.all():  # without some of the points, others of the rows are redundant
        needed = _maximal(packed(on.T), dimension)
        rows = rows[needed]
        on = on[:, needed]

        kept = _maximal(packed(on), dimension)
        points = points[kept]
        on = on[kept]
    return points, rows, on


@_kernels.compiled
def _edges(bits: Bits, one: int, shared: Integers, least: int) -> Integers:
    """Return the vertices that span an edge with vertex `one`; none if two of them span the same edge.

    The numbers of common facets are `shared`, shape (k,). An edge lies on at least `least` facets, and no third vertex
    lies on all of them.
    """
    near = np.flatnonzero(shared >= least)
    near = near[near != one]
    is_edge = np.ones(len(near), np.bool_)
    for k in range(len(near)):
        other = near[k]
        has_twin = False
        for third in near:
            if third == other or not contains_common(bits[third], bits[one], bits[other]):
                continue
            if shared[third] > shared[other]:
                is_edge[k] = False
                break
            has_twin = True
        if has_twin and is_edge[k]:
            return np.zeros(0, np.int64)
    return np.asarray(near[is_edge])


@_kernels.compiled
def _is_closed(bits: Bits, dimension: Any) -> bool:
    """Whether vertices are all vertices of a polytope; see `is_closed`."""
    columns = np.ascontiguousarray(bits.T)
    shared = np.empty(len(bits), np.int64)
    is_reached = np.zeros(len(bits), np.bool_)
    waiting = np.empty(len(bits), np.int64)
    waiting[0] = 0
    count = 1
    is_reached[0] = True
    while count:
        count -= 1
        one = waiting[count]
        common(bits[one], columns, shared)
        others = _edges(bits, one, shared, dimension - 1)
        if len(others) < dimension:
            return False

        # The edges are the vertices of the vertex figure, a polytope of one dimension less with the same facets.
        edges = bits[others] & bits[one]
        union = edges[0].copy()
        for k in range(1, len(edges)):
            union |= edges[k]
        if (union != bits[one]).any():
            return False
        if shared[one] == dimension:
            # The figure is a simplex if each edge leaves one of its facets, another one each.
            if len(others) != dimension or (shared[others] != dimension - 1).any():
                return False
        elif dimension == 2 or not _is_closed(edges, dimension - 1):
            return False

        for other in others:
            if not is_reached[other]:
                is_reached[other] = True
                waiting[count] = other
                count += 1
    return bool(is_reached.all())


@_kernels.compiled
def is_closed(on: Flags, dimension: int) -> bool:
    """Whether vertices and facets of a polytope are all that it has; `on`, shape (v, f), is which is on which.

    Given: every vertex satisfies all half-spaces of the facets, and is on those of its bits and strictly inside of the
    others. Then each is a vertex of the intersection of the half-spaces. All neighbours of a vertex are known if its
    edges are all vertices of its vertex figure, a polytope of one dimension less, which is the same question; in a
    simple vertex, on as many facets as dimensions, the figure is a simplex. The graph of a polytope is connected: a
    list of vertices that has all the neighbours of its members has all vertices.

    The same holds for facets, with ridges instead of edges, in the hull of the vertices. The side on which fewer
    vertices or facets are not simple is asked. O(k^2 words) if none is.
    """
    if min(on.shape) <= dimension:
        return False
    if dimension == 1:
        return on.shape == (2, 2) and on[0, 0] != on[0, 1] and on[1, 0] != on[1, 1] and on[0, 0] != on[1, 0]
    of_vertices = on.sum(axis=1)
    of_facets = on.sum(axis=0)
    if (of_vertices > dimension).sum() <= (of_facets > dimension).sum():
        return _is_closed(packed(on), dimension)
    return _is_closed(packed(on.T), dimension)
