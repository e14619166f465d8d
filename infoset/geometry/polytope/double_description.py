"""Double description: the extreme rays of a polyhedral cone from its rows, one row after the other, compiled.

A polytope {y: a . y <= b} is the cone {(y, t): b t - a . y >= 0, t >= 0}; its vertices are the extreme rays with t = 1
(`affine`). In the dual, points y are the rows (-y, 1) of a cone whose extreme rays are the facets (a, b). Incidence is
stored as bits: bit i of a ray is set if the ray lies on row i. A row's longest entry is about one.

References
----------
K. Fukuda and A. Prodon, Double description method revisited, in Combinatorics and Computer Science (1996).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from infoset.arrays import Flags, Floats, Integers
from infoset.geometry.double_words import two_product, two_sum
from infoset.geometry.polytope.errors import UncertainHullError
from infoset.kernels import Kernels

Bits = NDArray[np.uint64]
_kernels = Kernels()
ON = 1e-12
"""Distance of a ray from a row that contains it, relative to the ray: 5000 roundings."""
COLLINEAR = 1e-9
"""Distance of a ray from the plane of two others that contains it. A wrong one adds only points of the set."""
TIP = 1e-12
"""Maximum movement of a vertex to the outer sides of its facets, in scaled coordinates."""
_MOVES = 60
"""Maximum number of moves of a vertex across its facets."""
_SWEEP = 3
"""Number of moves that are orthogonal to each other: longer sweeps move farther at sharp corners, shorter ones more."""
MAX_CROSSINGS = 50_000
"""Number of edges that cross one row from which rounding decides: a larger set would take minutes for the next row."""
EPS = float(np.finfo(np.float64).eps)

_1 = np.uint64(1)


@_kernels.inlined
def _common(one: Bits, other: Bits) -> int:
    """Return the number of common bits."""
    count = 0
    for word in range(len(one)):
        left = one[word] & other[word]
        while left:  # LLVM makes one instruction of this loop
            left &= left - _1
            count += 1
    return count


@_kernels.inlined
def _within(one: Bits, other: Bits, holder: Bits) -> bool:
    """Whether a set of bits holds all common bits of two others."""
    for word in range(len(one)):  # noqa: SIM110 - Numba compiles no generator
        if one[word] & other[word] & ~holder[word]:
            return False
    return True


@_kernels.inlined
def _dot(one: Floats, other: Floats) -> float:
    """Return the sum of products of the entries of `one` and the first ones of the other."""
    total = 0.0
    for i in range(len(one)):
        total += one[i] * other[i]
    return total


@_kernels.inlined
def _size(ray: Floats) -> float:
    """Return the maximum absolute entry."""
    size = 0.0
    for value in ray:
        size = max(size, abs(value))
    return size


@_kernels.allocation_free
def _forbids(rays: Floats, signs: Integers, p: Any, q: Any, k: int) -> bool:
    """Whether a third ray k, on all rows on which p and q lie, shows that p and q span no edge.

    Rounding can leave three rays in the plane of one edge: k forbids the edge only if it is between p and q or
    outside their plane. Of equal rays on the same side of the new row the first one has the edge.
    """
    one, two, third = rays[p], rays[q], rays[k]
    pp, pq, pk = _dot(one, one), _dot(one, two), _dot(one, third)
    qq, kk = _dot(two, two), _dot(third, third)
    uu = uk = away = 0.0  # u is the part of q orthogonal to p
    for i in range(len(one)):
        u = two[i] - pq / pp * one[i]
        uu += u * u
        uk += u * third[i]
    if uu == 0.0:
        return False
    beta = uk / uu
    alpha = (pk - beta * pq) / pp
    for i in range(len(one)):
        rest = third[i] - alpha * one[i] - beta * two[i]
        away += rest * rest
    if away > COLLINEAR**2 * kk:
        return True
    near_p, near_q = abs(beta) * math.sqrt(qq / kk) < COLLINEAR, abs(alpha) * math.sqrt(pp / kk) < COLLINEAR
    if near_p:
        return bool(signs[k] == signs[p] and k < p)
    if near_q:
        return bool(signs[k] == signs[q] and k < q)
    return alpha > 0.0 and beta > 0.0


@_kernels.allocation_free
def _combine(p: Floats, q: Floats, alpha: float, beta: float, affine: bool, result: Floats) -> None:
    """Write the ray alpha q + beta p; with t = 1 if it is a point. Coordinates that both points share stay exact."""
    last = len(p) - 1
    total = alpha * q[last] + beta * p[last] if affine else 0.0
    if total > 0.0:
        if beta * p[last] > alpha * q[last]:
            p, q, beta = q, p, alpha
        for i in range(len(p)):  # q is the nearer point
            result[i] = q[i] + beta / total * (p[i] - p[last] * q[i])
        return
    for i in range(len(p)):
        result[i] = alpha * q[i] + beta * p[i]
    result *= math.ldexp(1.0, -math.frexp(_size(result))[1])


@_kernels.compiled
def sides(rays: Floats, row: Floats) -> tuple[Floats, Integers]:
    """Return the heights row . z of rays, and their signs, 0 for rays on the row."""
    heights, signs = np.empty(len(rays)), np.zeros(len(rays), np.int64)
    for i in range(len(rays)):
        height, length = 0.0, 0.0
        for j in range(len(row)):
            height += row[j] * rays[i, j]
            length = max(length, abs(rays[i, j]))
        heights[i] = height
        if abs(height) > ON * length:
            signs[i] = 1 if height > 0.0 else -1
    return heights, signs


@_kernels.compiled
def crossings(
    rays: Floats, bits: Bits, heights: Floats, signs: Integers, least: int, affine: bool
) -> tuple[Floats, Bits]:
    """Return the rays in which edges cross a row, and the common bits of the ends of the edges.

    `heights` and `signs` are those of `sides`, and `least` is the minimum number of rows on which an edge lies. An
    UncertainHullError is raised if more than `MAX_CROSSINGS` edges cross the row.
    O(above below (words + k words)) at worst.
    """
    (k, size), counts = rays.shape, np.array([_common(one, one) for one in bits])
    room, count, blocker = 2 * k + 16, 0, 0
    result, marks = np.empty((room, size)), np.empty((room, bits.shape[1]), np.uint64)
    below = np.flatnonzero(signs < 0)
    for p in np.flatnonzero(signs > 0):
        for q in below:
            shared = _common(bits[p], bits[q])
            if shared < least:
                continue
            # Two simple vertices with a common line of facets are its ends.
            simple = shared == least and counts[p] <= least + 1 and counts[q] <= least + 1
            for step in range(-1, -1 if simple else k):
                third = blocker if step < 0 else step  # the last one that forbade an edge often does it again
                holds = third not in (p, q) and _within(bits[p], bits[q], bits[third])
                if holds and _forbids(rays, signs, p, q, third):
                    blocker = third
                    break
            else:
                if count == MAX_CROSSINGS:
                    raise UncertainHullError("rounding decides about vertices: one half-space cuts 50000 edges")
                if count == room:
                    room *= 2
                    result, marks = np.concatenate((result, result)), np.concatenate((marks, marks))
                _combine(rays[p], rays[q], heights[p], -heights[q], affine, result[count])
                marks[count] = bits[p] & bits[q]
                count += 1
    return result[:count], marks[:count]


@_kernels.compiled
def insert(rays: Floats, bits: Bits, row: Floats, number: int, least: int, affine: bool) -> tuple[Floats, Bits]:
    """Return the rays with row . z >= 0, shape (k, D), and their bits, shape (k, words), for one more row.

    One step of the double description: rays on the wrong side go; each edge that crosses the row gives a ray. `number`
    is the bit of the row; see `sides` and `crossings`.
    """
    heights, signs = sides(rays, row)
    word, bit = number // 64, _1 << np.uint64(number % 64)
    marks, on, above = bits.copy(), signs == 0, signs > 0
    marks[:, word] |= on * bit
    if (signs >= 0).all():
        return rays, marks
    new, new_marks = crossings(rays, bits, heights, signs, least, affine)
    new_marks[:, word] |= bit
    # New rays are compared with those on the row, which come first.
    rays, bits = np.concatenate((rays[on], rays[above], new)), np.concatenate((marks[on], marks[above], new_marks))
    return _merged(rays, bits, on.sum(), len(rays) - len(new))


@_kernels.compiled
def _merged(rays: Floats, bits: Bits, on: int, old: int) -> tuple[Floats, Bits]:
    """Return rays without new ones (from number `old`) that equal one of the first `on` ones or an earlier new one.

    The ray that stays lies on the rows of both. Otherwise rays that rounding doubles would multiply.
    """
    kept, sizes = np.ones(len(rays), np.bool_), np.array([_size(ray) for ray in rays])
    for j in range(old, len(rays)):
        for number in range(on + j - old):
            i = number if number < on else number - on + old
            for c in range(rays.shape[1]):
                if not kept[i] or abs(sizes[j] * rays[i, c] - sizes[i] * rays[j, c]) > ON * sizes[i] * sizes[j]:
                    break
            else:
                bits[i] |= bits[j]
                kept[j] = False
                break
    return rays[kept], bits[kept]


@_kernels.compiled
def packed(flags: Flags) -> Bits:
    """Return rows of flags, shape (k, m), as bits, shape (k, words)."""
    bits = np.zeros((len(flags), (flags.shape[1] + 63) // 64), np.uint64)
    for i in range(len(flags)):
        for j in range(flags.shape[1]):
            bits[i, j >> 6] |= np.uint64(flags[i, j]) << np.uint64(j & 63)
    return bits


@_kernels.compiled
def unpacked(bits: Bits, count: int) -> Flags:
    """Return the first `count` bits of rows as flags, shape (k, count)."""
    flags = np.empty((len(bits), count), np.bool_)
    for i in range(len(bits)):
        for j in range(count):
            flags[i, j] = (bits[i, j >> 6] >> np.uint64(j & 63)) & _1 == _1
    return flags


@_kernels.compiled
def pivots(rows: Floats, tolerance: float, first: int) -> tuple[Integers, Integers]:
    """Return rows and columns of a regular part of a matrix, shapes (r,), by complete pivoting.

    A pivot up to `tolerance` ends it. If `first` >= 0, the first pivot is the last entry of that row.
    """
    table, (k, size) = rows.copy(), rows.shape
    chosen, columns = np.empty(min(k, size), np.int64), np.empty(min(k, size), np.int64)
    for step in range(min(k, size)):
        best = np.abs(table).argmax() if step or first < 0 else first * size + size - 1
        row, column = best // size, best % size
        if abs(table[row, column]) <= tolerance:
            return chosen[:step].copy(), columns[:step].copy()
        chosen[step], columns[step] = row, column
        table -= np.outer(table[:, column] / table[row, column], table[row])
        table[row], table[:, column] = 0.0, 0.0
    return chosen, columns


@_kernels.compiled
def extreme_rays(rows: Floats, affine: bool, tolerance: float) -> tuple[Floats, Flags, int]:
    """Return the extreme rays, shape (k, D), of {z: rows z >= 0}, which ray is on which row, and the rank of the rows.

    If `affine`, the first row is t >= 0, and rays with t > 0 have t = 1. It starts with the simplicial cone of D rows
    and inserts the others in their order; if the rank is below D to a `tolerance`, it returns no rays.
    """
    m, size = rows.shape
    chosen, _ = pivots(rows, tolerance, 0 if affine else -1)
    if len(chosen) < size:
        return np.empty((0, size)), np.empty((0, m), np.bool_), len(chosen)
    rays, on = np.ascontiguousarray(np.linalg.inv(rows[chosen]).T), np.zeros((size, m), np.bool_)
    for i in range(size):
        if affine:
            rays[i, -1] = 1.0 if i == 0 else 0.0
        if not affine or i > 0:
            rays[i] *= math.ldexp(1.0, -math.frexp(_size(rays[i]))[1])
        on[:, chosen[i]] = True  # a ray lies on all of these rows but one
        on[i, chosen[i]] = False
    bits = packed(on)
    for i in range(m):
        if (chosen != i).all():
            rays, bits = insert(rays, bits, rows[i], i, size - 2, affine)
    return rays, unpacked(bits, m), size


@_kernels.compiled
def maximal(bits: Bits, least: int) -> tuple[Flags, bool]:
    """Return which sets of bits have at least `least` bits and are in no other set, of equal ones the first.

    The other value is whether each shares `least` - 1 bits with `least` others: a vertex in d dimensions has d edges.
    """
    counts, near = np.array([_common(one, one) for one in bits]), np.zeros(len(bits), np.int64)
    kept = counts >= least
    for i in range(len(bits)):
        for j in range(i):
            common = _common(bits[i], bits[j])
            if common >= least - 1:
                near[i] += 1
                near[j] += 1
                if common == min(counts[i], counts[j]):
                    kept[i if counts[i] <= counts[j] else j] = False
    return kept, bool((near >= least).all())


@_kernels.compiled
def lattice(on: Flags, dimension: int) -> tuple[Integers, Integers, Flags]:
    """Return the numbers of the points and rows that are not redundant, and which of these points lie on which row.

    An UncertainHullError is raised unless each vertex has d facets and edges, and each facet d vertices and ridges.
    """
    used, sides, kept, edges = np.arange(len(on)), np.arange(on.shape[1]), np.zeros(1, np.bool_), False
    while not kept.all():  # without some of the points, others of the rows are redundant
        bits = packed(on.T)
        needed, _ = maximal(bits, dimension)
        sides, on, bits = sides[needed], on[:, needed], bits[needed]
        kept, edges = maximal(packed(on), dimension)
        used, on = used[kept], on[kept]
    if not (edges and maximal(bits, dimension)[1] and min(len(used), len(sides)) > dimension):
        raise UncertainHullError("rounding decides which points are vertices of a set")
    return used, sides, on


@_kernels.allocation_free
def precise_dot(a: Floats, b: Floats, start: float) -> tuple[float, float]:
    """Return start + a . b as the sum of two numbers, as exact as with doubled digits (Ogita, Rump and Oishi)."""
    high, low = start, 0.0
    for i in range(len(b)):
        product, rounded = two_product(a[i], b[i])
        high, lost = two_sum(high, product)
        low += lost + rounded
    return two_sum(high, low)


@_kernels.compiled
def affine_image(points: Floats, matrix: Floats, shift: Floats) -> tuple[Floats, Floats]:
    """Return matrix x + shift of points, shape (k, m), rounded once, and the maximum rounding errors, shape (m,)."""
    image, errors = np.empty((len(points), len(matrix))), np.zeros(len(matrix))
    for j in range(len(matrix)):
        for i in range(len(points)):
            image[i, j], low = precise_dot(matrix[j], points[i], shift[j])
            errors[j] = max(errors[j], abs(low))
    return image, errors


@_kernels.compiled
def supports(points: Floats, normals: Floats) -> Floats:
    """Return max normal . point of each normal, shape (f,), rounded up from nearly exact products."""
    result = np.full(len(normals), -np.inf)
    for f in range(len(normals)):
        for i in range(len(points)):
            height, terms = 0.0, 0.0
            for j in range(points.shape[1]):
                height += normals[f, j] * points[i, j]
                terms += abs(normals[f, j] * points[i, j])
            # Only points that may be highest are worth the precise product.
            if height + 8.0 * EPS * terms >= result[f]:
                high, low = precise_dot(normals[f], points[i], 0.0)
                result[f] = max(result[f], math.nextafter(high, math.inf) if low > 0.0 else high)
    return result


@_kernels.allocation_free
def _cross_facets(facets: Floats, mine: Integers, needs: Floats, basis: Floats, step: Floats) -> bool:
    """Enlarge a step until it moves a point by its needs across its facets, and return whether it does.

    Each move is across the facet that is missed most, and along those of the moves before in its sweep. At a sharp
    corner it may fail. `basis`, shape (`_SWEEP`, n), is a working array.
    """
    size = 0
    for _ in range(_MOVES):
        facet, most = -1, EPS * math.sqrt(_dot(step, step))  # far below the rounding of the coordinates
        for m in range(len(mine)):
            gap = needs[m] - _dot(step, facets[mine[m]])
            if gap > most:
                facet, most = m, gap
        if facet < 0:
            return True
        normal, free = facets[mine[facet]], basis[size]
        for j in range(len(free)):
            free[j] = normal[j]
        for k in range(2 * size):  # twice, for rounding
            along = _dot(free, basis[k % size])
            for j in range(len(free)):
                free[j] -= along * basis[k % size, j]
        length = math.sqrt(_dot(free, free))
        if length < 1e-12:  # it depends on those of the sweep
            size = 0
            continue
        share = (most + 0.25 * abs(needs[facet])) / _dot(free, normal)
        for j in range(len(free)):
            step[j] += share * free[j]
            free[j] /= length
        size = (size + 1) % len(basis)
    return False


@_kernels.compiled
def push_out(points: Floats, facets: Floats, on: Flags, chosen: Flags, flat: bool, most: float) -> Floats:
    """Return points, shape (v, n): the `chosen` ones are not inside a facet on which they lie, if `most` allows.

    Then the hull of the points contains the set of the facets: a map of the set to the hull that takes each facet to
    its outer side covers the set. A point that is exactly on its facets stays. The others move across their facets
    (`_cross_facets`), or where this fails, at a sharp corner, and in a `flat` set, away from the centre. No point moves
    by more than `most`: where rounding moves facets more than the vertex, the hull may lack the very tip.
    """
    n, f = points.shape[1], len(facets)
    result, middle, basis = points.copy(), points.sum(axis=0) / len(points), np.empty((min(_SWEEP, n), n))
    numbers, gaps, step = np.empty(f, np.int64), np.empty(f), np.empty(n)
    for i in np.flatnonzero(chosen):
        inside, count, rounding = False, 0, n * EPS * (1.0 + _size(points[i]))  # that of the new coordinates
        for k in range(f):
            if on[i, k]:
                height, _ = precise_dot(facets[k, :n], points[i], -facets[k, n])
                inside |= height < 0.0
                numbers[count], gaps[count] = k, rounding - height
                count += 1
        if not inside:
            continue
        mine, needs = numbers[:count], gaps[:count]
        step[:] = 0.0
        if flat or not _cross_facets(facets, mine, needs, basis, step):
            away, factor = points[i] - middle, 0.0
            for m in range(count):
                along = _dot(away, facets[mine[m]])
                if along > 0.0 and needs[m] > factor * along:
                    factor = needs[m] / along
            step[:] = factor * away
        result[i] += min(1.0, most / math.sqrt(_dot(step, step) + 1e-300)) * step
    return result
