"""Images, sums and enlargements of polytopes, rounded outward, compiled.

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
from infoset.geometry.tolerances import EPS, ON, REDUCED, UNSURE
from infoset.kernels import Kernels

_kernels = Kernels()
_LEAST_WIDTH = 2.0**-10
"""Minimum scale of a coordinate of an image, relative to the terms of the products that it is a sum
of. The rounding of these terms, EPS, is then at most a quarter of ON in the scaled coordinate.
"""
MAX_MOVE = 32.0
"""Maximum move of a vertex, relative to the move of its facets. Where two facets that move by 1
meet at an angle of 3.6 degrees, their corner moves by 32. Chosen: the points of 24 enlarged images
lack 2e-10 of their facets from 32 to 128, and 7e-8 with 8 (measured)."""
_MAX_CROSSINGS = 60
"""Maximum number of moves across single facets. A corner that needs more counts as too sharp for
such moves, and its vertex moves away from the centre. Chosen: the images of `MAX_MOVE` are the same
from 15 to 240 (measured).
"""
_BEYOND = 0.25
"""Part of the distance to a facet by which a move goes beyond the facet, so that later moves rarely
bring the point back inside by rounding. Chosen: compared with 0.25, the volumes of the images of
`MAX_MOVE` are 0.02 % smaller with 0, and 0.07 % greater with 1 (measured).
"""


@_kernels.compiled
def image(
    points: Floats, facets: Floats, centre: Floats, scale: Floats, matrix: Floats, offset: Floats
) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Return points, facets, centre, scale and rounding errors of the image of a set.

    The image is in coordinates in which it is about one wide, y' = matrix y + s, where a facet
    a y <= b is a' y' <= b + a' s; a' matrix differs from a by rounding. The result has no facets
    unless the matrix is square with pivots that are certainly not zero. Their offsets are not the
    supports of the points: the hull of the given points may lack a tip of the given facets. The
    errors, shape (m,), are not in the facets: the caller enlarges the result by them.
    """
    m, n = matrix.shape
    sizes = np.array([size_of(column) for column in points.T])
    middle, middle_errors = affine_image(centre.reshape(1, n), matrix, offset)
    columns = matrix * scale

    rough = columns @ points.T + middle.T
    lower = np.array([row.min() for row in rough])
    upper = np.array([row.max() for row in rough])
    # Of a coordinate that is zero but for rounding, the errors stay small in the new coordinates.
    least = _LEAST_WIDTH * (np.abs(columns) @ sizes)
    new_centre, new_scale = coordinates(lower, upper, least, np.float64(0.0))

    scaled = columns / new_scale.reshape(m, 1)
    shift = (middle - new_centre) / new_scale
    result, errors = affine_image(points, scaled, shift[0])
    errors += middle_errors / new_scale

    # Whether the matrix is regular does not depend on the units of its columns. A column of zeros
    # is divided by 1e-300, not by zero.
    units = np.array([size_of(column) for column in scaled.T]) + 1e-300
    if not m == n == len(pivots(scaled / units, REDUCED, np.int64(-1))[0]):
        return result, facets[:0], new_centre, new_scale, errors

    normals = np.ascontiguousarray(facets[:, :n]) @ np.linalg.inv(scaled)
    back, back_errors = affine_image(normals, np.ascontiguousarray(scaled.T), np.zeros(n))
    away = (np.abs(back - facets[:, :n]) + back_errors) @ sizes
    ends, end_errors = affine_image(shift, normals, facets[:, n].copy())
    unsure = away + end_errors
    outer = np.where(unsure > 0.0, np.nextafter(ends[0] + unsure, np.inf), ends[0])
    return result, np.column_stack((normals, outer)), new_centre, new_scale, errors


@_kernels.compiled
def swept(
    points: Floats, facets: Floats, on: Flags, along: Floats
) -> tuple[Floats, Floats, Flags, Floats]:
    """Return points, facets, incidence and rounding errors of a sum with a segment.

    The segment is from -along to along. Each facet moves, and each ridge between two facets that
    face opposite ends of the segment becomes a facet. A vertex moves to an end if it lies on a
    facet that faces this end. `along`, shape (n,), is not zero. The errors, shape (n,), are the
    maximum rounding of a coordinate of the points. The facets do not allow for it: the caller
    enlarges the result by it (`construction.enlarged`).
    """
    heights = sides(facets, np.append(along / size_of(along), 0.0))
    # Numba compiles a kernel again for a Python constant, but not for one of NumPy.
    new, marks = crossings(facets, packed(on.T), heights, len(along) - 1, np.bool_(False))
    # Two opposite facets give a row without a normal.
    directed = np.array([size_of(row[:-1]) > ON for row in new], np.bool_)
    new = new[directed]
    # Two facets that are nearly opposite give a facet in which rounding is large: it holds all
    # vertices.
    new[:, -1] = supports(points, np.ascontiguousarray(new[:, :-1]))
    facets = np.concatenate((facets, new))
    ridges = unpacked(marks[directed], len(points))

    old = len(heights)
    count = 0
    result = np.empty((2 * len(points), len(along)))
    errors = np.zeros(len(along))
    incidence = np.zeros((len(result), len(facets)), np.bool_)
    for end in (1.0, -1.0):
        for i in range(len(points)):
            ahead = False
            for k in range(old):
                ahead |= on[i, k] & (end * heights[k] > 0.0)
                incidence[count, k] = on[i, k] & (end * heights[k] >= 0.0)
            if not ahead:
                continue

            incidence[count, old:] = ridges[:, i]
            for j in range(len(along)):
                result[count, j], low = two_sum(points[i, j], end * along[j])
                errors[j] = max(errors[j], abs(low))
            count += 1

    # Outward: the terms of the height of `along` may cancel, as in each new facet. The two sums and
    # the last addition are rounded by EPS / 2 each: 2 EPS.
    for k in range(len(facets)):
        rounding = UNSURE * len(along) * dot(np.abs(along), np.abs(facets[k]))
        facets[k, -1] += abs(dot(along, facets[k])) + rounding
        facets[k, -1] += 2.0 * EPS * abs(facets[k, -1])
    return result[:count], facets, incidence[:count], errors


@_kernels.compiled
def around(
    points: Floats, facets: Floats, on: Flags, by: Floats, flat: bool
) -> tuple[Floats, Floats]:
    """Return points and facets, in units, moved outward to contain {y + e: |e_i| <= by_i}.

    `by` has the shape (n,).
    """
    facets = in_units(facets)
    if not by.any():
        return points, facets
    for k in range(len(facets)):
        # 8 ulp are more than the n + 1 roundings of this line, each at most half an ulp.
        reach = (1.0 + 8.0 * EPS) * dot(by, np.abs(facets[k]))
        facets[k, -1] += reach + EPS * abs(facets[k, -1])
    most = ON + MAX_MOVE * by.max()
    return push_out(points, facets, on, np.int64(0), flat, most), facets


@_kernels.compiled
def push_out(
    points: Floats, facets: Floats, on: Flags, known: Any, flat: bool, most: float
) -> Floats:
    """Return points, shape (v, n), moved to the outer sides of their facets, if `most` allows.

    Points on none but the first `known` facets stay, and so do points that are on or beyond all of
    their facets. The others move across their facets (`_cross_facets`), or where this fails, at a
    sharp corner, and in a `flat` set, away from the centre. No point moves by more than `most`:
    where rounding moves facets more than the vertex, the hull may lack the very tip.

    The hull of the points then contains the set of the facets: a map of the set to the hull that
    takes each facet to its outer side covers the set.
    """
    n = points.shape[1]
    f = len(facets)
    result = points.copy()
    centre = points.sum(axis=0) / len(points)
    # The basis is for sweeps of up to three moves (`_cross_facets`).
    work = (np.empty(f), np.empty(n), np.empty((min(3, n), n)))
    mine = np.empty(f, np.int64)
    # A facet with all points is a row of the affine hull.
    whole = np.array([on[:, k].all() for k in range(f)])
    for i in range(len(points)):
        if on[i, known:].any():
            count = 0
            for k in range(f):
                mine[count] = k
                count += on[i, k] > whole[k]
            _push(result[i], facets, mine[:count], centre, flat, most, work)
    return result


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
    """Move a point, in place, to the outer sides of its facets, with the numbers `mine`.

    See `push_out`. `work` is arrays for needs, shape (f,), the step, (n,), and a basis, (3, n).
    """
    needs, step, basis = work
    # The new coordinates are rounded, too.
    rounding = len(point) * EPS * (1.0 + size_of(point))
    inside = False
    for m in range(len(mine)):
        height, _ = precise_dot(facets[mine[m]], point, -facets[mine[m], -1])
        inside |= height < 0.0
        needs[m] = rounding - height
    if not inside:
        return

    step[:] = 0.0
    if flat or not _cross_facets(facets, mine, needs, basis, step):
        for j in range(len(point)):
            step[j] = point[j] - centre[j]
        factor = 0.0
        for m in range(len(mine)):
            along = dot(step, facets[mine[m]])
            if along > 0.0 and needs[m] > factor * along:
                factor = needs[m] / along
        step *= factor

    # 1e-300: a step of zero keeps the quotient defined.
    share = min(1.0, most / math.sqrt(dot(step, step) + 1e-300))
    for j in range(len(point)):
        point[j] += share * step[j]


@_kernels.allocation_free
def _cross_facets(
    facets: Floats, mine: Integers, needs: Floats, basis: Floats, step: Floats
) -> bool:
    """Enlarge a step until it moves a point across its facets by `needs`; return whether it does.

    Moves are grouped in sweeps of up to three. Each move is across the facet that is missed most,
    and parallel to the facets of the earlier moves of its sweep. At sharp corners, longer sweeps
    would move farther, and shorter sweeps need more moves. `basis`, shape (3, n), is for work: the
    orthonormal normals of a sweep.
    """
    size = 0
    for _ in range(_MAX_CROSSINGS):
        facet = -1
        # A gap of EPS of the step is far below the rounding of the coordinates.
        most = EPS * math.sqrt(dot(step, step))
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
        # Orthogonalized twice, because of rounding: to the basis, and to the basis again.
        for k in range(2 * size):
            along = dot(free, basis[k % size])
            for j in range(len(free)):
                free[j] -= along * basis[k % size, j]
        length = math.sqrt(dot(free, free))
        if length < ON:
            # The normal depends on the normals of the sweep: begin the next one.
            size = 0
            continue

        share = (most + _BEYOND * abs(needs[facet])) / dot(free, normal)
        for j in range(len(free)):
            step[j] += share * free[j]
            free[j] /= length
        size = (size + 1) % len(basis)  # a full sweep ends, and the next one begins
    return False
