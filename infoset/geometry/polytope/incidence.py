"""Incidence of vertices and facets as bits, and the proof that no vertex or facet is missing.

A set of bits has the shape (words,), in words of 64 bits: bit i, which is bit i % 64 of word
i // 64, is set if a vertex lies on facet i. All of this is combinatorial: no number is rounded
here. See `is_closed` for the proof.

References
----------
K. Mehlhorn, S. Naeher, M. Seel, R. Seidel, T. Schilz, S. Schirra and C. Uhrig, Checking geometric
programs or verification of geometric structures, Computational Geometry 12 (1999).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from infoset.arrays import Flags, Integers
from infoset.kernels import Kernels

Bits = NDArray[np.uint64]
_kernels = Kernels()


@_kernels.inlined
def _ones(word: Any) -> int:
    """Return the number of bits of a word. LLVM makes one instruction of the loop."""
    count = 0
    while word:
        word &= word - np.uint64(1)
        count += 1
    return count


@_kernels.allocation_free
def common(one: Bits, others: Bits, counts: Integers) -> None:
    """Write the numbers of common bits of a set, shape (words,), and others, shape (words, k).

    Only the first len(counts) of the others are compared.
    """
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


class Needed(NamedTuple):
    """Points and rows that are not redundant."""

    points: Integers
    """Numbers of the points, shape (v,)."""
    rows: Integers
    """Numbers of the rows, shape (f,)."""
    on: Flags
    """Whether one of these points is on one of these rows, shape (v, f)."""


def without_redundant(on: Flags, dimension: int) -> Needed:
    """Return the points and rows that are not redundant, from an incidence of shape (points, rows).

    A point is redundant if it is on fewer than `dimension` rows, or another point is on all of its
    rows; of points on the same rows the first stays. The same holds for rows.
    """
    return Needed(*_without_redundant(on, dimension))


@_kernels.compiled
def _without_redundant(on: Flags, dimension: int) -> tuple[Integers, Integers, Flags]:
    """Return the members of `Needed`; see `without_redundant`."""
    points = np.arange(on.shape[0])
    rows = np.arange(on.shape[1])
    kept = np.zeros(1, np.bool_)
    # Without some of the points, others of the rows are redundant.
    while not kept.all():
        needed = _maximal(packed(on.T), dimension)
        rows = rows[needed]
        on = on[:, needed]

        kept = _maximal(packed(on), dimension)
        points = points[kept]
        on = on[kept]
    return points, rows, on


@_kernels.compiled
def _maximal(bits: Bits, least: int) -> Flags:
    """Return which sets have at least `least` bits and are in no other set.

    Of equal sets it is the first.
    """
    columns = np.ascontiguousarray(bits.T)
    shared = np.empty(len(bits), np.int64)
    counts = np.empty(len(bits), np.int64)
    kept = np.ones(len(bits), np.bool_)
    for i in range(len(bits)):
        common(bits[i], columns, shared[: i + 1])
        counts[i] = shared[i]
        for j in range(i):
            # One of the two contains the other, and the smaller one goes.
            if shared[j] == min(counts[i], counts[j]):
                kept[i if counts[i] <= counts[j] else j] = False
    return kept & (counts >= least)


@_kernels.compiled
def is_closed(on: Flags, dimension: int) -> bool:
    """Whether vertices and facets of a polytope are all that it has, from their incidence, (v, f).

    Assumption: every vertex satisfies all half-spaces of the facets, and is on the facets of its
    bits and strictly inside of the others. Bits alone are not enough: the incidence of a torus is
    closed too.

    1. Each vertex is a vertex of the intersection of the half-spaces, as the neighbour along each
       edge is strictly inside a facet that the others are on.
    2. All neighbours of a vertex are known if its edges are all vertices of its vertex figure, a
       polytope of one dimension less, which is the same question. In a simple vertex, on as many
       facets as dimensions, the figure is a simplex.
    3. The graph of a polytope is connected: a list of vertices that has all the neighbours of its
       members has all vertices.

    The same holds for facets, with ridges instead of edges, in the hull of the vertices. The more
    numerous of the two are asked: each is on fewer of the others. O(k^2 words) for k of them, if
    most are simple.
    """
    if min(on.shape) <= dimension:
        return False
    if dimension == 1:
        # A segment: each end is on one facet, and they are on different ones.
        return (
            on.shape == (2, 2)
            and on[0, 0] != on[0, 1]
            and on[1, 0] != on[1, 1]
            and on[0, 0] != on[1, 0]
        )
    if len(on) >= on.shape[1]:
        return _is_closed(packed(on), dimension)
    return _is_closed(packed(on.T), dimension)


@_kernels.compiled
def _is_closed(bits: Bits, dimension: Any) -> bool:
    """Whether vertices are all vertices of a polytope of two or more dimensions; see `is_closed`.

    `bits` are the vertices, or the facets in their place. `dimension` is an integer of any type.
    The vertices are visited along the edges, from the first one.
    """
    k, words = bits.shape
    columns = np.ascontiguousarray(bits.T)
    shared = np.empty(k, np.int64)
    near = np.empty(k, np.int64)
    others = np.empty(k, np.int64)

    is_reached = np.zeros(k, np.bool_)
    waiting = np.zeros(k, np.int64)
    is_reached[0] = True
    left = 1
    while left:
        left -= 1
        one = waiting[left]
        common(bits[one], columns, shared)
        count = _edges(bits, one, shared, dimension - 1, near, others)
        if shared[one] == dimension:
            is_right = _is_simplex(shared, others[:count], dimension)
        elif dimension == 2:
            is_right = False
        elif dimension == 3:
            # The vertex figure is a polygon, whose sides are the facets.
            is_right = count == shared[one] and _is_cycle(bits, one, others[:count])
        else:
            # The vertex figure is a polytope of one dimension less with the same facets.
            edges = np.empty((count, words), np.uint64)
            has_edges = _write_figure(bits, one, others[:count], edges)
            is_right = has_edges and count >= dimension and _is_closed(edges, dimension - 1)
        if not is_right:
            return False

        for other in others[:count]:
            if not is_reached[other]:
                is_reached[other] = True
                waiting[left] = other
                left += 1
    return bool(is_reached.all())


@_kernels.allocation_free
def _edges(
    bits: Bits, one: int, shared: Integers, least: int, near: Integers, others: Integers
) -> int:
    """Write the vertices that span an edge with vertex `one`, and return their number.

    It is 0 if two vertices span the same edge. The numbers of common facets are `shared`, shape
    (k,). An edge lies on at least `least` facets, and no third vertex lies on all of them. `near`,
    shape (k,), is for work.
    """
    found = 0
    for k in range(len(bits)):
        near[found] = k
        found += k != one and shared[k] >= least

    count = 0
    for other in near[:found]:
        is_edge = True
        has_twin = False
        for third in near[:found]:
            if third == other or not contains_common(bits[third], bits[one], bits[other]):
                continue
            is_edge &= shared[third] == shared[other]
            has_twin = True
        if is_edge and has_twin:
            return 0
        others[count] = other
        count += is_edge
    return count


@_kernels.allocation_free
def _is_simplex(shared: Integers, others: Integers, dimension: Any) -> bool:
    """Whether the figure of a simple vertex is a simplex: each edge leaves one of its facets.

    No two edges leave the same facet, as the edges are different.
    """
    is_right = len(others) == dimension
    for other in others:
        is_right &= shared[other] == dimension - 1
    return bool(is_right)


@_kernels.allocation_free
def _is_cycle(bits: Bits, one: int, others: Integers) -> bool:
    """Whether each facet of a vertex in space has two of its edges."""
    for word in range(bits.shape[1]):
        once = np.uint64(0)
        twice = np.uint64(0)
        for other in others:
            edge = bits[one, word] & bits[other, word]
            if twice & edge:
                return False
            twice |= once & edge
            once |= edge
        if twice != bits[one, word]:
            return False
    return True


@_kernels.allocation_free
def _write_figure(bits: Bits, one: int, others: Integers, edges: Bits) -> bool:
    """Write the edges of a vertex, the vertices of its figure, as bits.

    Return whether each facet of the vertex has an edge.
    """
    is_complete = True
    for word in range(bits.shape[1]):
        missing = bits[one, word]
        for i in range(len(others)):
            edges[i, word] = bits[one, word] & bits[others[i], word]
            missing &= ~edges[i, word]
        is_complete &= missing == np.uint64(0)
    return is_complete
