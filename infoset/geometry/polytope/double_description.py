"""Double description: the extreme rays of a polyhedral cone from its rows, one row after the other, compiled.

A polytope {y: a . y <= b} is the cone {(y, t): b t - a . y >= 0, t >= 0}; its vertices are the extreme rays with t = 1
(`affine`). In the dual, points y are the rows (-y, 1) of a cone whose extreme rays are the facets (a, b). Bit i of a
ray is set if it lies on row i. A row's longest entry is about one. Images and sums of polytopes are also here.

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
from infoset.geometry.double_words import EPS, affine_image, precise_dot, supports, two_sum
from infoset.geometry.polytope.errors import UncertainHullError
from infoset.kernels import Kernels

Bits = NDArray[np.uint64]
_kernels = Kernels()
ON = 1e-12
"""Distance of a ray from a row that contains it, relative to the ray: 5000 roundings."""
COLLINEAR = 1e-9
"""Distance of a ray from the plane of two others that contains it. A wrong one adds only points of the set."""
TIP = 1e-12
"""Maximum movement of a vertex to the outer sides of its facets, in scaled coordinates, of a set with an interior."""


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


@_kernels.inlined
def _unit(ray: Floats) -> float:
    """Return a power of two: times this, the maximum absolute entry is from 1/2 to 1."""
    return math.ldexp(1.0, -math.frexp(_size(ray))[1])


@_kernels.allocation_free
def _forbids(rays: Floats, heights: Floats, p: Any, q: Any, k: int) -> bool:
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
    if near_p or near_q:
        twin = p if near_p else q
        return bool(heights[k] * heights[twin] > 0.0 and k < twin)
    return alpha > 0.0 and beta > 0.0


@_kernels.allocation_free
def _is_edge(rays: Floats, bits: Bits, heights: Floats, others: Integers, p: Any, q: Any) -> bool:
    """Whether none of the `others`, numbers of rays, forbids an edge between p and q."""
    for k in others:
        holds = k not in (p, q)
        for word in range(bits.shape[1]):
            holds &= not bits[p, word] & bits[q, word] & ~bits[k, word]
        if holds and _forbids(rays, heights, p, q, k):
            return False
    return True


@_kernels.allocation_free
def _combine(p: Floats, q: Floats, alpha: float, beta: float, affine: Any, result: Floats) -> None:
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
    result *= _unit(result)


@_kernels.compiled
def sides(rays: Floats, row: Floats) -> Floats:
    """Return the heights row . z of rays, 0 for rays on the row."""
    heights, lengths = np.array([_dot(row, ray) for ray in rays]), np.array([_size(ray) for ray in rays])
    return np.asarray(heights * (np.abs(heights) > ON * lengths))


@_kernels.allocation_free
def _cross(one: Any, rays: Floats, bits: Bits, heights: Floats, least: int, affine: Any, work: tuple[Any, ...]) -> int:
    """Write the rays, and their bits, in which edges of one ray cross the row, see `crossings`; return their number."""
    columns, shared, near, result, marks = work
    found, count = 0, 0
    common(bits[one], columns, shared)
    for third in range(len(rays)):  # only rays with enough common rows can be the other end, or forbid an edge
        near[found] = third
        found += shared[third] >= least
    for other in near[:found]:
        p, q = (one, other) if heights[one] > 0.0 else (other, one)
        if heights[p] > 0.0 > heights[q] and _is_edge(rays, bits, heights, near[:found], p, q):
            _combine(rays[p], rays[q], heights[p], -heights[q], affine, result[count])
            for word in range(bits.shape[1]):
                marks[count, word] = bits[p, word] & bits[q, word]
            count += 1
    return count


@_kernels.compiled
def crossings(rays: Floats, bits: Bits, heights: Floats, least: int, affine: Any) -> tuple[Floats, Bits]:
    """Return the rays in which edges cross a row, and the common bits of the ends of the edges.

    `heights` are those of `sides`, and `least` is the minimum number of rows on which an edge lies. O(k words) for each
    ray on the smaller side and each pair with as many rows. From 50 000 edges on it raises an UncertainHullError.
    """
    (k, size), columns, count = rays.shape, np.ascontiguousarray(bits.T), 0
    result, marks = np.empty((2 * k, size)), np.empty((2 * k, bits.shape[1]), np.uint64)
    shared, near = np.empty(k, np.int64), np.empty(k, np.int64)
    fewer = heights < 0.0 if (heights < 0.0).sum() < (heights > 0.0).sum() else heights > 0.0
    for one in np.flatnonzero(fewer):
        if count > 50_000:  # a larger set would take minutes for the next row
            raise UncertainHullError("rounding decides about vertices: one half-space cuts 50000 edges")
        if count + k > len(result):
            result, marks = np.concatenate((result, result)), np.concatenate((marks, marks))
        work = columns, shared, near, result[count:], marks[count:]
        count += _cross(one, rays, bits, heights, least, affine, work)
    return result[:count], marks[:count]


@_kernels.compiled
def insert(rays: Floats, bits: Bits, row: Floats, number: int, least: int, affine: Any) -> tuple[Floats, Bits]:
    """Return the rays with row . z >= 0, shape (k, D), and their bits, shape (k, words), for one more row.

    One step of the double description: rays on the wrong side go; each edge that crosses the row gives a ray. `number`
    is the bit of the row; see `sides` and `crossings`.
    """
    heights = sides(rays, row)
    new, marks = crossings(rays, bits, heights, least, affine)
    on, above = heights == 0.0, heights > 0.0
    word, bit, touching, old = number // 64, np.uint64(1) << np.uint64(number % 64), on.sum(), (heights >= 0.0).sum()
    rays, bits = np.concatenate((rays[on], rays[above], new)), np.concatenate((bits[on], bits[above], marks))
    bits[:touching, word] |= bit
    bits[old:, word] |= bit
    return _merged(rays, bits, touching, old)


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
    return (rays, bits) if kept.all() else (rays[kept], bits[kept])


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
def insert_rows(
    rays: Floats, on: Flags, rows: Floats, numbers: Integers, least: int, affine: Any
) -> tuple[Floats, Flags]:
    """Return the rays with row . z >= 0 for rows with some `numbers`, and which ray is on which row; see `insert`."""
    bits = packed(on)
    for k in range(len(rows)):
        rays, bits = insert(rays, bits, rows[k], numbers[k], least, affine)
    return rays, unpacked(bits, on.shape[1])


@_kernels.compiled
def pivots(rows: Floats, tolerance: float, first: Any) -> tuple[Integers, Integers]:
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


def extreme_rays(rows: Floats, affine: bool, tolerance: float) -> tuple[Floats, Flags, int]:
    """Return the extreme rays, shape (k, D), of {z: rows z >= 0}, which ray is on which row, and the rank of the rows.

    If `affine`, the first row is t >= 0, and rays with t > 0 have t = 1. It starts with the simplicial cone of D rows
    and inserts the others in their order; if the rank is below D to a `tolerance`, it returns no rays.
    """
    m, size = rows.shape
    chosen, _ = pivots(rows, tolerance, 0 if affine else -1)
    if len(chosen) < size:
        return np.empty((0, size)), np.empty((0, m), np.bool_), len(chosen)
    rays, on = np.array(np.linalg.inv(rows[chosen]).T, np.float64, order="C"), np.zeros((size, m), np.bool_)
    if affine:
        rays[:, -1] = np.eye(size)[0]
    rays[int(affine) :] = in_units(rays)[int(affine) :]
    on[:, chosen] = ~np.eye(size, dtype=np.bool_)  # a ray lies on all of these rows but one
    others = np.delete(np.arange(m), chosen)
    return *insert_rows(rays, on, rows[others], others, size - 2, affine), size


@_kernels.compiled
def maximal(bits: Bits, least: int) -> tuple[Flags, bool]:
    """Return which sets of bits have at least `least` bits and are in no other set, of equal ones the first.

    The other value is whether each shares `least` - 1 bits with `least` others: a vertex in d dimensions has d edges.
    """
    columns, shared, k = np.ascontiguousarray(bits.T), np.empty(len(bits), np.int64), len(bits)
    kept, near, counts = np.ones(k, np.bool_), np.zeros(k, np.int64), np.empty(k, np.int64)
    for i in range(k):
        common(bits[i], columns, shared[: i + 1])
        counts[i] = shared[i]
        for j in range(i):
            if shared[j] >= least - 1:
                near[i] += 1
                near[j] += 1
                if shared[j] == min(counts[i], counts[j]):
                    kept[i if counts[i] <= counts[j] else j] = False
    return kept & (counts >= least), bool((near >= least).all())


@_kernels.compiled
def lattice(on: Flags, dimension: int) -> tuple[Integers, Integers, Flags]:
    """Return the numbers of the points and rows that are not redundant, and which of these points lie on which row.

    An UncertainHullError is raised unless each vertex has d facets and edges, and each facet d vertices and ridges.
    """
    used, sides, kept, edges, ridges = np.arange(len(on)), np.arange(on.shape[1]), np.zeros(1, np.bool_), False, False
    while not kept.all():  # without some of the points, others of the rows are redundant
        bits = packed(on.T)
        needed, ridges = maximal(bits, dimension)
        if not needed.all():
            sides, on, ridges = sides[needed], on[:, needed], maximal(bits[needed], dimension)[1]
        kept, edges = maximal(packed(on), dimension)
        used, on = used[kept], on[kept]
    if not (edges and ridges and min(len(used), len(sides)) > dimension):
        raise UncertainHullError("rounding decides which points are vertices of a set")
    return used, sides, on


@_kernels.compiled
def coordinates(lower: Floats, upper: Floats, minimum: Floats, share: float) -> tuple[Floats, Floats]:
    """Return a centre and scales, powers of two, for a set between two points, or as wide as `minimum`, each (n,).

    A scale is at least a `share` of the coordinates. Differences from a centre far away are exact.
    """
    centre, scale = np.zeros(len(lower)), np.empty(len(lower))
    for j in range(len(lower)):
        size = max(abs(lower[j]), abs(upper[j]))
        width = max(upper[j] - lower[j], minimum[j], share * size)
        scale[j] = math.ldexp(1.0, math.frexp(width or 1.0)[1] - 1)
        if size > 16.0 * scale[j]:
            centre[j] = 0.5 * lower[j] + 0.5 * upper[j]
    return centre, scale


@_kernels.compiled
def image(
    points: Floats, facets: Floats, centre: Floats, scale: Floats, matrix: Floats, offset: Floats
) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Return points, facets, centre, scale and rounding errors of the image of a set, in its own coordinates.

    Facets are none unless the matrix is square with pivots above 1e-6. A facet a y <= b is a' y' <= b + a' s under y' =
    matrix y + s; a' matrix differs from a by rounding. The hull of points may lack a tip: it gives too small supports.
    """
    (m, n), sizes = matrix.shape, np.array([_size(column) for column in points.T])
    middle, rounded = affine_image(centre.reshape(1, n), matrix, offset)
    matrix = matrix * scale
    rough = matrix @ points.T + middle.T
    lower, upper = np.array([row.min() for row in rough]), np.array([row.max() for row in rough])
    # Of a coordinate that is zero but for rounding, the errors stay small in the new coordinates.
    centre, scale = coordinates(lower, upper, 2.0**-10 * (np.abs(matrix) @ sizes), np.float64(0.0))
    matrix, shift = matrix / scale.reshape(m, 1), (middle - centre) / scale
    result, errors = affine_image(points, matrix, shift[0])
    errors += rounded / scale
    units = np.array([_size(column) for column in matrix.T]) + 1e-300  # its condition does not depend on them
    if not m == n == len(pivots(matrix / units, 1e-6, np.int64(-1))[0]):
        return result, facets[:0], centre, scale, errors
    normals = np.ascontiguousarray(facets[:, :n]) @ np.linalg.inv(matrix)
    back, low = affine_image(normals, np.ascontiguousarray(matrix.T), np.zeros(n))
    away = (np.abs(back - facets[:, :n]) + low) @ sizes
    ends, lost = affine_image(shift, normals, facets[:, n].copy())
    outer = np.where(away + lost > 0.0, np.nextafter(ends[0] + (away + lost), np.inf), ends[0])
    return result, np.column_stack((normals, outer)), centre, scale, errors


@_kernels.allocation_free
def _cross_facets(facets: Floats, mine: Integers, needs: Floats, basis: Floats, step: Floats) -> bool:
    """Enlarge a step until it moves a point by its needs across its facets, and return whether it does.

    Each move is across the facet that is missed most, and along those of the moves before in its sweep: at sharp
    corners, longer sweeps would move farther, shorter ones more often; it may fail. `basis`, shape (3, n), is for work.
    """
    size = 0
    for _ in range(60):
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


@_kernels.allocation_free
def _push(point: Floats, facets: Floats, mine: Integers, centre: Floats, flat: bool, most: float, work: Any) -> None:
    """Move a point, in place, to the outer sides of its facets, with the numbers `mine`; see `push_out`."""
    needs, step, basis = work
    inside, rounding = False, len(point) * EPS * (1.0 + _size(point))  # that of the new coordinates
    for m in range(len(mine)):
        height, _ = precise_dot(facets[mine[m]], point, -facets[mine[m], -1])
        inside |= height < 0.0
        needs[m] = rounding - height
    if not inside:
        return
    step[:] = 0.0
    if flat or not _cross_facets(facets, mine, needs, basis, step):
        factor = 0.0
        for j in range(len(point)):
            step[j] = point[j] - centre[j]
        for m in range(len(mine)):
            along = _dot(step, facets[mine[m]])
            if along > 0.0 and needs[m] > factor * along:
                factor = needs[m] / along
        step *= factor
    share = min(1.0, most / math.sqrt(_dot(step, step) + 1e-300))
    for j in range(len(point)):
        point[j] += share * step[j]


@_kernels.compiled
def push_out(points: Floats, facets: Floats, on: Flags, old: Any, flat: bool, most: float) -> Floats:
    """Return points, shape (v, n): those on facets after the first `old` are not inside their facets, if `most` allows.

    Then the hull of the points contains the set of the facets: a map of the set to the hull that takes each facet to
    its outer side covers the set. A point that is exactly on its facets stays. The others move across their facets
    (`_cross_facets`), or where this fails, at a sharp corner, and in a `flat` set, away from the centre. No point moves
    by more than `most`: where rounding moves facets more than the vertex, the hull may lack the very tip.
    """
    n, f, result, centre = points.shape[1], len(facets), points.copy(), points.sum(axis=0) / len(points)
    work, mine = (np.empty(f), np.empty(n), np.empty((min(3, n), n))), np.empty(f, np.int64)
    whole = np.array([on[:, k].all() for k in range(f)])  # rows of the affine hull
    for i in range(len(points)):
        if on[i, old:].any():
            count = 0
            for k in range(f):
                mine[count] = k
                count += on[i, k] > whole[k]
            _push(result[i], facets, mine[:count], centre, flat, most, work)
    return result


@_kernels.compiled
def near(rays: Floats, rows: Floats, distance: float) -> Flags:
    """Return which ray is within a relative `distance` of which row, shape (k, m): |row . ray| <= distance |ray|."""
    result = np.empty((len(rays), len(rows)), np.bool_)
    for i in range(len(rays)):
        limit = distance * _size(rays[i])
        for j in range(len(rows)):
            result[i, j] = abs(_dot(rows[j], rays[i])) <= limit
    return result


@_kernels.compiled
def in_units(rows: Floats) -> Floats:
    """Return rows times powers of two: the maximum absolute entry of each row is from 1/2 to 1."""
    return np.asarray(rows * np.array([_unit(row) for row in rows]).reshape(-1, 1))


@_kernels.compiled
def around(points: Floats, facets: Floats, on: Flags, by: Floats, flat: bool) -> tuple[Floats, Floats]:
    """Return points and facets, in units, moved outward to contain {y + e: |e_i| <= by_i}, `by` of shape (n,)."""
    facets = in_units(facets)
    if not by.any():
        return points, facets
    for k in range(len(facets)):
        facets[k, -1] += (1.0 + 8.0 * EPS) * _dot(by, np.abs(facets[k])) + EPS * abs(facets[k, -1])
    return push_out(points, facets, on, np.int64(0), flat, TIP + 32.0 * by.max()), facets


@_kernels.compiled
def swept(points: Floats, facets: Floats, on: Flags, along: Floats) -> tuple[Floats, Floats, Flags, Floats]:
    """Return points, facets, incidence and rounding errors of the sum with the segment from -along to along.

    Each facet moves, and each ridge between two facets that face opposite ends of the segment becomes a facet. A vertex
    moves to an end if it lies on a facet that faces this end.
    """
    heights = sides(facets, np.append(along / _size(along), 0.0))
    # Numba compiles a kernel again for a Python constant, but not for one of NumPy.
    new, marks = crossings(facets, packed(on.T), heights, len(along) - 1, np.bool_(False))
    directed = np.array([_size(row[:-1]) > ON for row in new], np.bool_)  # not of two opposite facets
    new = new[directed]
    # Two facets that are nearly opposite give a facet in which rounding is large: it holds all vertices.
    new[:, -1] = supports(points, np.ascontiguousarray(new[:, :-1]))
    facets, ridges, count = np.concatenate((facets, new)), unpacked(marks[directed], len(points)), 0
    result, errors = np.empty((2 * len(points), len(along))), np.zeros(len(along))
    incidence = np.zeros((len(result), len(facets)), np.bool_)
    for end in (1.0, -1.0):
        for i in range(len(points)):
            ahead = False
            for k in range(len(heights)):
                ahead |= on[i, k] & (end * heights[k] > 0.0)
                incidence[count, k] = on[i, k] & (end * heights[k] >= 0.0)
            if ahead:
                incidence[count, len(heights) :] = ridges[:, i]
                for j in range(len(along)):
                    result[count, j], low = two_sum(points[i, j], end * along[j])
                    errors[j] = max(errors[j], abs(low))
                count += 1
    for k in range(len(facets)):
        facets[k, -1] += (1.0 + 8.0 * EPS) * abs(_dot(along, facets[k])) + 2.0 * EPS * abs(facets[k, -1])
    return result[:count], facets, incidence[:count], errors
