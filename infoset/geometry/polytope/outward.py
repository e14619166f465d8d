"""Images, sums and enlargements of polytopes with vertices and facets that are rounded outward,
compiled.

All arrays are in scaled coordinates; see `Polytope`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from infoset.arrays import Flags, Floats, Integers
from infoset.geometry.double_words import affine_image, precise_dot, supports, two_sum
from infoset.geometry.polytope.double_description import (
    crossings,
    dot,
    in_units,
    pivots,
    sides,
    size_of,
)
from infoset.geometry.polytope.incidence import packed, unpacked
from infoset.geometry.polytope.scaled_coordinates import coordinates
from infoset.geometry.tolerances import EPS, ON, REDUCED, SNAP
from infoset.kernels import Kernels

_kernels = Kernels()


@_kernels.compiled
def image(
    points: Floats, facets: Floats, centre: Floats, scale: Floats, matrix: Floats, offset: Floats
) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Return points, facets, centre, scale and rounding errors of the image of a set, in its own
    coordinates.

    Facets are none unless the matrix is square with pivots that are certainly not zero. A facet a y
    <= b is a' y' <= b + a' s under y' = matrix y + s; a' matrix differs from a by rounding. The
    hull of points may lack a tip: it gives too small supports.
    """
    (m, n), sizes = matrix.shape, np.array([size_of(column) for column in points.T])
    middle, rounded = affine_image(centre.reshape(1, n), matrix, offset)
    matrix = matrix * scale
    rough = matrix @ points.T + middle.T
    lower = np.array([row.min() for row in rough])
    upper = np.array([row.max() for row in rough])
    # Of a coordinate that is zero but for rounding, the errors stay small in the new coordinates.
    centre, scale = coordinates(lower, upper, 2.0**-10 * (np.abs(matrix) @ sizes), np.float64(0.0))
    matrix = matrix / scale.reshape(m, 1)
    shift = (middle - centre) / scale
    result, errors = affine_image(points, matrix, shift[0])
    errors += rounded / scale
    units = (
        np.array([size_of(column) for column in matrix.T]) + 1e-300
    )  # its condition does not depend on them
    if not m == n == len(pivots(matrix / units, REDUCED, np.int64(-1))[0]):
        return result, facets[:0], centre, scale, errors
    normals = np.ascontiguousarray(facets[:, :n]) @ np.linalg.inv(matrix)
    back, low = affine_image(normals, np.ascontiguousarray(matrix.T), np.zeros(n))
    away = (np.abs(back - facets[:, :n]) + low) @ sizes
    ends, lost = affine_image(shift, normals, facets[:, n].copy())
    outer = np.where(away + lost > 0.0, np.nextafter(ends[0] + (away + lost), np.inf), ends[0])
    return result, np.column_stack((normals, outer)), centre, scale, errors


@_kernels.compiled
def touching(
    points: Floats, facets: Floats, on: Flags, known: int, size: float, far: float
) -> tuple[Flags, bool]:
    """Return which points are on which facets, also those within SNAP of them, and whether the
    points are consistent.

    They are not if a point is outside of a facet, or away from one that it is `on`, shape (v, f),
    by more than `far`. Only points on facets after the first `known` are looked at. `size` is that
    of the points.
    """
    n = points.shape[1]
    units = np.array([size_of(facet) for facet in facets])
    result = on.copy()
    is_consistent = True
    for i in range(len(points)):
        if known > 0 and not on[i, known:].any():
            continue
        for j in range(len(facets)):
            height = dot(points[i], facets[j]) - facets[j, n]
            limit = far * units[j]
            is_consistent &= height <= limit and (height >= -limit or not on[i, j])
            result[i, j] |= height >= -SNAP * size * units[j]
    return result, is_consistent


@_kernels.compiled
def refined(points: Floats, facets: Floats, equations: Floats, on: Flags, known: int) -> Floats:
    """Return points, those on facets after the first `known` computed again: nearest to where their
    facets meet.

    Cuts of a small part combine points that are far from it, so that their rounding grows.
    """
    n = points.shape[1]
    result = points.copy()
    for i in range(len(points)):
        if known > 0 and not on[i, known:].any():
            continue
        rows = np.concatenate((facets[on[i]], equations))
        gaps = np.array([row[n] - dot(points[i], row) for row in rows])
        result[i] += np.linalg.lstsq(np.ascontiguousarray(rows[:, :n]), gaps)[0]
    return result


@_kernels.compiled
def loses_points(points: Floats, used: Integers, on: Flags, least: int, distance: float) -> bool:
    """Whether a point that is not used is on at least `least` facets and farther than a distance
    from all that are.

    Between facets at a small angle many points are near both: what is on which does not show which
    are vertices.
    """
    is_used = np.zeros(len(points), np.bool_)
    is_used[used] = True
    for i in range(len(points)):
        if is_used[i] or on[i].sum() < least:
            continue
        nearest = np.inf
        for k in used:
            apart = 0.0
            for j in range(points.shape[1]):
                apart = max(apart, abs(points[i, j] - points[k, j]))
            nearest = min(nearest, apart)
        if nearest > distance:
            return True
    return False


@_kernels.allocation_free
def _cross_facets(
    facets: Floats, mine: Integers, needs: Floats, basis: Floats, step: Floats
) -> bool:
    """Enlarge a step until it moves a point by its needs across its facets, and return whether it
    does.

    Each move is across the facet that is missed most, and along those of the moves before in its
    sweep: at sharp corners, longer sweeps would move farther, shorter ones more often; it may fail.
    `basis`, shape (3, n), is for work.
    """
    size = 0
    for _ in range(60):
        facet, most = (
            -1,
            EPS * math.sqrt(dot(step, step)),
        )  # far below the rounding of the coordinates
        for m in range(len(mine)):
            gap = needs[m] - dot(step, facets[mine[m]])
            if gap > most:
                facet = m
                most = gap
        if facet < 0:
            return True
        normal = facets[mine[facet]]
        free = basis[size]
        for j in range(len(free)):
            free[j] = normal[j]
        for k in range(2 * size):  # twice, for rounding
            along = dot(free, basis[k % size])
            for j in range(len(free)):
                free[j] -= along * basis[k % size, j]
        length = math.sqrt(dot(free, free))
        if length < ON:  # it depends on those of the sweep
            size = 0
            continue
        share = (most + 0.25 * abs(needs[facet])) / dot(free, normal)
        for j in range(len(free)):
            step[j] += share * free[j]
            free[j] /= length
        size = (size + 1) % len(basis)
    return False


@_kernels.allocation_free
def _push(
    point: Floats,
    facets: Floats,
    mine: Integers,
    centre: Floats,
    flat: bool,
    most: float,
    work: Any,
) -> None:
    """Move a point, in place, to the outer sides of its facets, with the numbers `mine`; see
    `push_out`.
    """
    needs, step, basis = work
    inside, rounding = (
        False,
        len(point) * EPS * (1.0 + size_of(point)),
    )  # that of the new coordinates
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
            along = dot(step, facets[mine[m]])
            if along > 0.0 and needs[m] > factor * along:
                factor = needs[m] / along
        step *= factor
    share = min(1.0, most / math.sqrt(dot(step, step) + 1e-300))
    for j in range(len(point)):
        point[j] += share * step[j]


@_kernels.compiled
def push_out(
    points: Floats, facets: Floats, on: Flags, known: Any, flat: bool, most: float
) -> Floats:
    """Return points, shape (v, n), moved so that they are not inside their facets, if `most`
    allows.

    Points on none but the first `known` facets stay. Then the hull of the points contains the set
    of the facets: a map of the set to the hull that takes each facet to its outer side covers the
    set. A point that is exactly on its facets stays. The others move across their facets
    (`_cross_facets`), or where this fails, at a sharp corner, and in a `flat` set, away from the
    centre. No point moves by more than `most`: where rounding moves facets more than the vertex,
    the hull may lack the very tip.
    """
    n = points.shape[1]
    f = len(facets)
    result = points.copy()
    centre = points.sum(axis=0) / len(points)
    work = (np.empty(f), np.empty(n), np.empty((min(3, n), n)))
    mine = np.empty(f, np.int64)
    whole = np.array([on[:, k].all() for k in range(f)])  # rows of the affine hull
    for i in range(len(points)):
        if on[i, known:].any():
            count = 0
            for k in range(f):
                mine[count] = k
                count += on[i, k] > whole[k]
            _push(result[i], facets, mine[:count], centre, flat, most, work)
    return result


@_kernels.compiled
def around(
    points: Floats, facets: Floats, on: Flags, by: Floats, flat: bool
) -> tuple[Floats, Floats]:
    """Return points and facets, in units, moved outward to contain {y + e: |e_i| <= by_i}, `by` of
    shape (n,).
    """
    facets = in_units(facets)
    if not by.any():
        return points, facets
    for k in range(len(facets)):
        facets[k, -1] += (1.0 + 8.0 * EPS) * dot(by, np.abs(facets[k])) + EPS * abs(facets[k, -1])
    return push_out(points, facets, on, np.int64(0), flat, ON + 32.0 * by.max()), facets


@_kernels.compiled
def swept(
    points: Floats, facets: Floats, on: Flags, along: Floats
) -> tuple[Floats, Floats, Flags, Floats]:
    """Return points, facets, incidence and rounding errors of the sum with the segment from -along
    to along.

    Each facet moves, and each ridge between two facets that face opposite ends of the segment
    becomes a facet. A vertex moves to an end if it lies on a facet that faces this end.
    """
    heights = sides(facets, np.append(along / size_of(along), 0.0))
    # Numba compiles a kernel again for a Python constant, but not for one of NumPy.
    new, marks = crossings(facets, packed(on.T), heights, len(along) - 1, np.bool_(False))
    directed = np.array(
        [size_of(row[:-1]) > ON for row in new], np.bool_
    )  # not of two opposite facets
    new = new[directed]
    # Two facets that are nearly opposite give a facet in which rounding is large: it holds all
    # vertices.
    new[:, -1] = supports(points, np.ascontiguousarray(new[:, :-1]))
    facets = np.concatenate((facets, new))
    ridges = unpacked(marks[directed], len(points))
    count = 0
    result = np.empty((2 * len(points), len(along)))
    errors = np.zeros(len(along))
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
        facets[k, -1] += (1.0 + 8.0 * EPS) * abs(dot(along, facets[k])) + 2.0 * EPS * abs(
            facets[k, -1]
        )
    return result[:count], facets, incidence[:count], errors
