"""Compiled operations on all vertices of a section: outline, reduction, cut by a band of the predicted miss."""

from __future__ import annotations

from infoset import polygon, polygon_hull
from infoset._compile import ZERO, allocation_free, inlined
from infoset.chains import (
    BEGIN,
    CAPACITY,
    END,
    EPSILON,
    LEFT,
    MOST_ADDED,
    PEAK,
    REACH,
    REDUCED,
    RIGHT,
    Floats,
    Integers,
    begin_of,
    count_of,
    end_of,
    offset_of,
    put,
    read,
    sign_of,
    vertex,
)


@inlined
def is_crowded(marks: Integers, n: int) -> bool:
    """Whether the next step may increase the number of vertices beyond CAPACITY."""
    return bool(count_of(marks, n) > CAPACITY - MOST_ADDED)


@allocation_free
def reduce_outward(origins: Floats, rings: Floats, marks: Integers, n: int, tau: float, points: Floats) -> None:
    """Enlarge a section by removing edges of the longer chain until it has `REDUCED` vertices.

    Parameters
    ----------
    tau : float
        Time to go, s.
    points : ndarray, shape (2 CAPACITY + 4, 2)
        Working array.

    Notes
    -----
    An edge is removed by extending its neighbours to their intersection; the edge that adds the least area is removed
    first, at O(CAPACITY) per edge. Vertices that are not convex because of rounding are removed before. If no edge can
    be removed, three sides of a box around the chain replace it.
    """
    right = marks[n, RIGHT, END] - marks[n, RIGHT, BEGIN]
    other = min(right, count_of(marks, n) - right)
    side = RIGHT if right > other else LEFT
    count = ZERO
    for i in range(begin_of(marks, n, side), end_of(marks, n, side)):
        v, m = read(rings, offset_of(marks, n, side, i))
        count = polygon.append(points, polygon_hull.drop_turned(points, count, 1, v, m), v, m)
    count, done = polygon_hull.drop_inner_edges(points, count, REDUCED - other, points[CAPACITY + 2 :].reshape(-1))
    if not done:
        count = box_around(points, count, sign_of(side), tau)
    for i in range(count):
        put(rings, marks, n, side, i, points[i, 0], points[i, 1])
        # |V| of a new vertex may exceed the previous bound.
        v, _ = vertex(origins, rings, marks, n, side, i)
        origins[n, RIGHT, REACH] = max(origins[n, RIGHT, REACH], abs(v))
    marks[n, side, BEGIN] = 0
    marks[n, side, END] = count
    marks[n, side, PEAK] = 0


@allocation_free
def box_around(points: Floats, count: int, sign: float, tau: float) -> int:
    """Replace a chain by three sides of a box: from its ends along the level to the outermost vertex."""
    out = 0.0
    for end in (0, count - 1):
        for i in range(count):
            along = sign * (points[i, 0] - points[end, 0])
            out = max(out, along)
    last_v, last_m = points[count - 1, 0], points[count - 1, 1]
    points[1, 0] = points[0, 0] + sign * out
    points[1, 1] = points[0, 1] + sign * out * tau
    points[2, 0] = last_v + sign * out
    points[2, 1] = last_m + sign * out * tau
    points[3, 0] = last_v
    points[3, 1] = last_m
    return 4


@allocation_free
def outline(origins: Floats, rings: Floats, marks: Integers, n: int, tau: float, out: Floats) -> int:
    """Write the vertices (V, z), counter-clockwise; return their number, at most CAPACITY.

    Notes
    -----
    A point in which the chains meet is stored in both, equal to within rounding. It is written once.
    """
    made = ZERO
    for side in (RIGHT, LEFT):
        first = begin_of(marks, n, side)
        for i in range(first, end_of(marks, n, side)):
            v, m = vertex(origins, rings, marks, n, side, i)
            z = m - tau * v
            if i > first or made == 0 or not meets(out, made - 1, v, z, origins[n, RIGHT, REACH], tau):
                made = polygon.append(out, made, v, z)
    while made > 1 and meets(out, made - 1, out[0, 0], out[0, 1], origins[n, RIGHT, REACH], tau):
        made -= 1
    return made


@allocation_free
def meets(points: Floats, i: int, v: float, z: float, reach: float, tau: float) -> bool:
    """Whether a vertex equals (V, z) to within the rounding error of a change of chains."""
    close_v = abs(points[i, 0] - v) <= 4.0 * EPSILON * reach
    return bool(close_v and abs(points[i, 1] - z) <= 4.0 * EPSILON * (abs(z) + 2.0 * tau * reach))


@allocation_free
def cut_misses(
    origins: Floats,
    rings: Floats,
    marks: Integers,
    n: int,
    tau: float,
    tilt: float,
    lower: float,
    upper: float,
    points: Floats,
) -> tuple[bool, float]:
    """Intersect a section with the band lower <= m + V tilt <= upper; returns are those of `chain_steps.cut`.

    Notes
    -----
    This band is not parallel to the level, so that it may cut any edge: the chains are computed anew. O(vertices).
    `points` is a working array of CAPACITY + 2 vertices.
    """
    count = ZERO
    for side in (RIGHT, LEFT):
        for i in range(begin_of(marks, n, side), end_of(marks, n, side)):
            v, m = vertex(origins, rings, marks, n, side, i)
            count = polygon.append(points, count, v, m)
    count, overlap = polygon.clip_to_band(points, count, tilt, 1.0, lower, upper)
    if count == 0:
        return False, overlap
    for side in (RIGHT, LEFT):
        for part in range(REACH):
            origins[n, side, part] = 0.0
    bottom, top = polygon.extremes(points, count, -tau, 1.0)
    thickness = polygon.height(points, top, -tau, 1.0) - polygon.height(points, bottom, -tau, 1.0)
    if thickness <= 16.0 * EPSILON * (abs(points[top, 1]) + abs(points[bottom, 1]) + tau * origins[n, RIGHT, REACH]):
        # All heights are equal to within rounding: the vertices of extreme V are the ends of both chains.
        bottom, top = polygon.extremes(points, count, -1.0, 0.0)
    for side in (RIGHT, LEFT):
        first, last = (bottom, top) if side == RIGHT else (top, bottom)
        length = (last - first) % count + 1
        for i in range(length):
            at = (first + i) % count
            put(rings, marks, n, side, i, points[at, 0], points[at, 1])
        marks[n, side, BEGIN] = 0
        marks[n, side, END] = length
        marks[n, side, PEAK] = 0
    return True, overlap
