"""Compiled operations on one convex polygon of the plane.

A polygon is an array `points` of shape (capacity, 2) whose first `count` rows are its vertices,
counter-clockwise. One vertex is a point, two are a segment, and none is the empty set; all
operations accept them. Operations that may change the number of vertices write to `out`, which must
not overlap `points`, and return the new count. No tolerance is absolute: a cut or a sum is exact up
to rounding of the coordinates, a few ulp.

Because of rounding, a polygon is convex only up to a few ulp: the direction of a tiny edge is
arbitrary, vertices may coincide, and the vertices of a set as thin as the rounding error may have
any order. All operations accept that.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from infoset._compile import compiled, inlined

Points = NDArray[np.float64]

ROUNDING = 16.0 * float(np.finfo(np.float64).eps)
"""A difference of heights may be a rounding error if it is below this, relative to the products in
the heights: the slack of a cut."""

MINIMUM = float(np.finfo(np.float64).tiny)


@inlined
def cross(ax: float, ay: float, bx: float, by: float) -> float:
    """Cross product of two vectors of the plane."""
    return ax * by - ay * bx


@inlined
def unsigned(i: int) -> Any:
    """Return an index that cannot be negative as an unsigned integer."""
    return np.uint64(i)


@inlined
def move(points: Points, source: int, target: int) -> None:
    """Copy a vertex to another row."""
    i = unsigned(source)
    j = unsigned(target)
    points[j, 0] = points[i, 0]
    points[j, 1] = points[i, 1]


@inlined
def copy(points: Points, count: int, out: Points) -> None:
    """Copy the vertices of a polygon."""
    for i in range(count):
        out[i, 0] = points[i, 0]
        out[i, 1] = points[i, 1]


@inlined
def append(out: Points, count: int, x: float, y: float) -> int:
    """Add a vertex unless it repeats the last one; return the new count."""
    if count > 0 and out[count - 1, 0] == x and out[count - 1, 1] == y:
        return count
    out[count, 0] = x
    out[count, 1] = y
    return count + 1


@inlined
def close(out: Points, count: int) -> int:
    """Remove trailing vertices that repeat the first; return the new count."""
    while count > 1 and out[count - 1, 0] == out[0, 0] and out[count - 1, 1] == out[0, 1]:
        count -= 1
    return count


@inlined
def height(points: Points, i: int, normal_x: float, normal_y: float) -> float:
    """Height of a vertex along a direction: normal . p."""
    return float(normal_x * points[i, 0] + normal_y * points[i, 1])


@inlined
def crossing(
    points: Points, i: int, j: int, normal_x: float, normal_y: float, level: float
) -> tuple[float, float]:
    """Return the point of the edge i-j at a level of `normal . p`, interpolated from the nearer
    end.

    The result does not depend, bit for bit, on the order of i and j, so that a cut segment stays a
    segment.
    """
    height_i = height(points, i, normal_x, normal_y)
    height_j = height(points, j, normal_x, normal_y)
    near = i
    far = j
    height_near = height_i
    height_far = height_j
    farther = abs(level - height_i) - abs(level - height_j)
    if farther > 0.0 or (farther == 0.0 and height_i > height_j):
        near = j
        far = i
        height_near = height_j
        height_far = height_i
    fraction = (level - height_near) / (height_far - height_near)
    x = points[near, 0] + fraction * (points[far, 0] - points[near, 0])
    y = points[near, 1] + fraction * (points[far, 1] - points[near, 1])
    if normal_x == 0.0:
        y = level / normal_y
    elif normal_y == 0.0:
        x = level / normal_x
    return x, y


@compiled
def cut_cap(
    points: Points, count: int, top: int, normal_x: float, normal_y: float, level: float
) -> int:
    """Remove, in place, the part with normal . p > level; return the new number of vertices, at
    most count + 1.

    Vertex `top` is the highest and is higher than the level, and some vertex is not. O(count). The
    two points where the boundary crosses the level replace the sequence of high vertices around the
    top; other vertices do not change, so that rounding errors elsewhere have no effect.
    """
    first = last = top
    before = first - 1 if first > 0 else count - 1
    while height(points, before, normal_x, normal_y) > level:
        first = before
        before = first - 1 if first > 0 else count - 1
    after = last + 1 if last + 1 < count else 0
    while height(points, after, normal_x, normal_y) > level:
        last = after
        after = last + 1 if last + 1 < count else 0
    x, y = crossing(points, before, first, normal_x, normal_y, level)
    other_x, other_y = crossing(points, last, after, normal_x, normal_y, level)
    # A line through a vertex, or two equal crossings, adds no vertex.
    entering = height(points, before, normal_x, normal_y) < level and (x != other_x or y != other_y)
    leaving = height(points, after, normal_x, normal_y) < level
    added = int(entering) + int(leaving)
    if first <= last:
        kept = count - last - 1
        target = first
        step = first + added - (last + 1)
        if step > 0:
            for i in range(count - 1, last, -1):
                move(points, i, i + step)
        elif step < 0:
            for i in range(last + 1, count):
                move(points, i, i + step)
        count = first + added + kept
    else:
        target = first - last - 1
        for i in range(target):
            move(points, i + last + 1, i)
        count = target + added
    if entering:
        put(points, target, x, y)
        target += 1
    if leaving:
        put(points, target, other_x, other_y)
    return count


@compiled
def clip_to_band(
    points: Points, count: int, normal_x: float, normal_y: float, lower: float, upper: float
) -> tuple[int, float]:
    """Intersect in place with the band lower <= normal . p <= upper; return the number of vertices
    and the overlap.

    The array needs room for two more vertices. The normal has any nonzero length; infinite bounds
    give a half-plane. The overlap is the smaller one of polygon and band at the two borders; minus
    their distance if they do not intersect. O(count). A vertex on a border is inside. The new
    vertices of an axis-parallel cut lie exactly on its line.
    """
    if count == 0 or lower > upper:
        return 0, -np.inf
    bottom, top = extremes(points, count, normal_x, normal_y)
    minimum = height(points, bottom, normal_x, normal_y)
    maximum = height(points, top, normal_x, normal_y)
    overlap = min(maximum - lower, upper - minimum)
    if overlap < 0.0:
        return 0, overlap
    if maximum > upper:
        count = cut_cap(points, count, top, normal_x, normal_y, upper)
        bottom, top = extremes(points, count, normal_x, normal_y)
        # If the band is as thin as the rounding error, the cut may lie an ulp below the lower
        # border: keep the cut.
        lower = min(lower, height(points, top, normal_x, normal_y))
        minimum = height(points, bottom, normal_x, normal_y)
    if minimum < lower:
        count = cut_cap(points, count, bottom, -normal_x, -normal_y, -lower)
    return count, overlap


@inlined
def extremes(points: Points, count: int, normal_x: float, normal_y: float) -> tuple[int, int]:
    """Return the indices of a lowest and a highest vertex along a direction; of equal ones the
    first.
    """
    minimum = np.inf
    maximum = -np.inf
    bottom = top = 0
    for i in range(count):
        here = height(points, i, normal_x, normal_y)
        if here < minimum:
            minimum = here
            bottom = i
        if here > maximum:
            maximum = here
            top = i
    return bottom, top


@compiled
def map_linearly(
    points: Points, count: int, xx: float, xy: float, yx: float, yy: float, out: Points
) -> int:
    """Write the image under the matrix [[xx, xy], [yx, yy]]; a singular one gives a segment or a
    point. O(count).

    A segment takes O(count^2).
    """
    determinant = scaled_determinant(xx, xy, yx, yy)
    made = 0
    for i in range(count):
        source = i if determinant >= 0.0 else count - 1 - i
        x = points[source, 0]
        y = points[source, 1]
        made = append(out, made, xx * x + xy * y, yx * x + yy * y)
    made = close(out, made)
    if determinant != 0.0 or made <= 1:
        return made
    _, i, j = farthest_pair(out, made)
    x = out[i, 0]
    y = out[i, 1]
    other_x = out[j, 0]
    other_y = out[j, 1]
    return append(out, append(out, 0, x, y), other_x, other_y)


@compiled
def scaled_determinant(xx: float, xy: float, yx: float, yy: float) -> float:
    """Determinant of a matrix divided by a power of two near its largest entry, against underflow
    and overflow.
    """
    exponent = math.frexp(max(abs(xx), abs(xy), abs(yx), abs(yy)))[1]
    return cross(
        math.ldexp(xx, -exponent),
        math.ldexp(yx, -exponent),
        math.ldexp(xy, -exponent),
        math.ldexp(yy, -exponent),
    )


@inlined
def support_index(points: Points, count: int, normal_x: float, normal_y: float) -> int:
    """Return the index of a vertex farthest along a direction; of equal ones the first.
    O(count).
    """
    best = 0
    best_height = normal_x * points[0, 0] + normal_y * points[0, 1]
    for i in range(1, count):
        height = normal_x * points[i, 0] + normal_y * points[i, 1]
        if height > best_height:
            best = i
            best_height = height
    return best


@inlined
def put(out: Points, i: int, x: float, y: float) -> None:
    """Write a vertex."""
    out[i, 0] = x
    out[i, 1] = y


@compiled
def fan_area(points: Points, i: int) -> float:
    """Twice the area of the triangle of vertices 0, i and i + 1; zero if rounding makes it
    negative.
    """
    double = cross(
        points[i, 0] - points[0, 0],
        points[i, 1] - points[0, 1],
        points[i + 1, 0] - points[0, 0],
        points[i + 1, 1] - points[0, 1],
    )
    return max(0.0, double)


@compiled
def moments(points: Points, count: int) -> tuple[float, float, float]:
    """Return the area and the centroid (x, y) of a nonempty polygon; the middle of a set without
    area. O(count).

    The centroid is a convex combination of the centroids of a triangle fan, so that it lies in the
    hull.
    """
    weight = 0.0
    x = 0.0
    y = 0.0
    for i in range(1, count - 1):
        triangle = fan_area(points, i)
        weight += triangle
        x += triangle * ((points[i, 0] - points[0, 0]) + (points[i + 1, 0] - points[0, 0])) / 3.0
        y += triangle * ((points[i, 1] - points[0, 1]) + (points[i + 1, 1] - points[0, 1])) / 3.0
    if weight > 0.0:
        return 0.5 * weight, points[0, 0] + x / weight, points[0, 1] + y / weight
    _, i, j = farthest_pair(points, count)
    return 0.0, 0.5 * (points[i, 0] + points[j, 0]), 0.5 * (points[i, 1] + points[j, 1])


@compiled
def farthest_pair(points: Points, count: int) -> tuple[float, int, int]:
    """Return the maximum distance between two vertices, and their numbers. O(count^2)."""
    maximum, first, last = 0.0, 0, 0
    for i in range(count):
        for j in range(i):
            distance = math.hypot(points[i, 0] - points[j, 0], points[i, 1] - points[j, 1])
            if distance > maximum:
                maximum = distance
                first = i
                last = j
    return maximum, first, last


@inlined
def pass_edge(
    nearest: float,
    inside: bool,
    start: tuple[float, float],
    end: tuple[float, float],
    x: float,
    y: float,
) -> tuple[float, bool]:
    """Add one edge to the squared distance of (x, y) to the boundary and to the parity test for
    inside.

    Without branches: a mispredicted branch costs more than a division.
    """
    edge_x = end[0] - start[0]
    edge_y = end[1] - start[1]
    from_x = x - start[0]
    from_y = y - start[1]
    to_x = x - end[0]
    to_y = y - end[1]
    offset = cross(edge_x, edge_y, from_x, from_y)
    squared_length = edge_x * edge_x + edge_y * edge_y
    along = from_x * edge_x + from_y * edge_y
    off_line = offset * offset / max(squared_length, MINIMUM)
    off_start = from_x * from_x + from_y * from_y
    off_end = to_x * to_x + to_y * to_y
    squared = off_line if along < squared_length else off_end
    squared = squared if along > 0.0 else off_start
    rises = end[1] > start[1]
    inside ^= ((end[1] > y) != (start[1] > y)) & ((offset > 0.0) == rises)
    return min(nearest, squared), inside


@compiled
def margin(points: Points, count: int, x: float, y: float) -> float:
    """Return the signed distance from (x, y) to the boundary: positive inside, negative outside,
    -inf if empty.

    O(count). The parity of the edges to the right gives the sign, and the nearest edge the
    distance. An edge of a few ulp with a wrong direction has no effect on either; the signed
    distance to its line would be wrong.
    """
    nearest = np.inf
    inside = False
    last = count - 1
    for i in range(count):
        start = (points[last, 0], points[last, 1])
        end = (points[i, 0], points[i, 1])
        nearest, inside = pass_edge(nearest, inside, start, end, x, y)
        last = i
    return math.sqrt(nearest) if inside else -math.sqrt(nearest)
