"""Compiled Minkowski sums of polygons, stored as in `polygon`, with segments and with polygons."""

from __future__ import annotations

import numpy as np

from infoset._compile import compiled, inlined
from infoset.geometry.polygon import (
    HEIGHT_ROUNDING,
    Points,
    append,
    close,
    copy,
    cross,
    extremes,
    following,
    preceding,
    put,
    unsigned,
    vertex,
)
from infoset.geometry.polygon_exact import tidy


@compiled
def add_segment(points: Points, count: int, half_x: float, half_y: float) -> int:
    """Add the segment from -half to +half (Minkowski sum), in place; return the new count.

    It is at most count + 2, for which the array needs room. O(count), in two passes. The boundary
    is divided at its extremes across the segment: the part in front, from the rightmost vertex
    counter-clockwise to the leftmost one as seen along +half, moves by +half, the rest by -half.
    A division at extremes, and not at sign changes of edges, is correct for tiny edges with a wrong
    direction. If rounding could hide an extreme (an edge along the segment, a set thin across it, a
    point), the edges are merged as in `add_polygon`.
    """
    if count == 0 or (half_x == 0.0 and half_y == 0.0):
        return count
    bottom, top = extremes(points, count, -half_y, half_x)
    if not (
        is_lowest(points, count, bottom, half_x, half_y)
        and is_lowest(points, count, top, -half_x, -half_y)
    ):
        segment = np.empty((2, 2))
        out = np.empty((count + 2, 2))
        put(segment, 0, -half_x, -half_y)
        put(segment, 1, half_x, half_y)
        made = add_polygon(points, count, segment, 2, out)
        copy(out, made, points)
        return made

    # From the last vertex to the first, so that no vertex is overwritten before it is read; the
    # direction changes at the two extremes, which are written twice.
    if bottom < top:
        half_x = -half_x
        half_y = -half_y
    # Unsigned indices avoid the test for negative ones, which takes as long as the rest of this
    # loop.
    turns = unsigned(bottom), unsigned(top)
    target = unsigned(count + 2)
    for k in range(count):
        i = unsigned(count - 1 - k)
        x = points[i, 0]
        y = points[i, 1]
        target -= unsigned(1)
        put(points, target, x + half_x, y + half_y)
        if i in turns:
            half_x = -half_x
            half_y = -half_y
            target -= unsigned(1)
            put(points, target, x + half_x, y + half_y)
    return count + 2


@inlined
def is_lowest(points: Points, count: int, i: int, x: float, y: float) -> bool:
    """Whether a vertex is lower, across (x, y), than its neighbours by more than rounding."""
    here = vertex(points, i)
    before = vertex(points, preceding(i, count))
    after = vertex(points, following(i, count))
    height = cross(x, y, here.x, here.y)
    rise = min(cross(x, y, before.x, before.y), cross(x, y, after.x, after.y))
    reach_x = max(abs(here.x), abs(before.x), abs(after.x))
    reach_y = max(abs(here.y), abs(before.y), abs(after.y))
    return bool(rise - height > HEIGHT_ROUNDING * (abs(x) * reach_y + abs(y) * reach_x))


@compiled
def lowest_index(points: Points, count: int) -> int:
    """Index of the lowest vertex; of equally low ones the leftmost."""
    best = 0
    for i in range(1, count):
        is_level = points[i, 1] == points[best, 1]
        if points[i, 1] < points[best, 1] or (is_level and points[i, 0] < points[best, 0]):
            best = i
    return best


@compiled
def add_polygon(points: Points, count: int, other: Points, other_count: int, out: Points) -> int:
    """Write the Minkowski sum of two convex polygons; return its number of vertices.

    It is at most count + other_count; none if either polygon is empty. O(count + other_count). The
    edges of both are merged in order of direction, which gives vertices that are one addition each:
    rounding errors do not accumulate. If rounding has given an edge a wrong direction, the hull is
    taken first, which costs more: the merge needs edges in order. Rounding may exchange two edges
    that are nearly parallel, which moves a vertex by less than a rounding of the coordinates.
    """
    if count == 0 or other_count == 0:
        return 0
    first, n = tidy(points, count)
    second, m = tidy(other, other_count)
    i = lowest_index(first, n)
    j = lowest_index(second, m)
    # The sides that are left of each polygon. A segment has two, there and back, a point none.
    steps_i = n if n > 1 else 0
    steps_j = m if m > 1 else 0
    made = 0
    while True:
        made = append(out, made, first[i, 0] + second[j, 0], first[i, 1] + second[j, 1])

        next_i = following(i, n)
        next_j = following(j, m)
        order = direction_order(
            first[next_i, 0] - first[i, 0],
            first[next_i, 1] - first[i, 1],
            second[next_j, 0] - second[j, 0],
            second[next_j, 1] - second[j, 1],
        )
        advances_i = steps_i > 0 and (steps_j == 0 or order >= 0)
        advances_j = steps_j > 0 and (steps_i == 0 or order <= 0)
        if advances_i:
            i = next_i
            steps_i -= 1
        if advances_j:
            j = next_j
            steps_j -= 1
        if steps_i == 0 and steps_j == 0:
            return close(out, made)


@compiled
def direction_order(ax: float, ay: float, bx: float, by: float) -> int:
    """Return 1 if direction a is before b, counter-clockwise from +x, -1 if after, 0 if equal."""
    # Directions from half a turn on come after the others.
    a_is_late = ay < 0.0 or (ay == 0.0 and ax < 0.0)
    b_is_late = by < 0.0 or (by == 0.0 and bx < 0.0)
    if a_is_late != b_is_late:
        return -1 if a_is_late else 1
    turn = cross(ax, ay, bx, by)
    return int(turn > 0.0) - int(turn < 0.0)
