"""Compiled operations on one convex polygon of the plane.

A polygon is an array `points` of shape (capacity, 2) whose first `count` rows are its vertices,
counter-clockwise. One vertex is a point, two are a segment, and none is the empty set; operations
accept them unless they ask for a nonempty set. Operations that may change the number of vertices
return the new count: they work in place, or write to `out`, which must not overlap `points`. No
tolerance is absolute: a cut or a sum is exact up to rounding of the coordinates, a few ulp.

Because of rounding, a polygon is convex only up to a few ulp: the direction of a tiny edge is
arbitrary, vertices may coincide, and the vertices of a set as thin as the rounding error may have
any order. All operations accept that.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from infoset._compile import compiled, inlined

Points = NDArray[np.float64]

HEIGHT_ROUNDING = 16.0 * float(np.finfo(np.float64).eps)
"""Difference of two heights, relative to the products in them, that may be a rounding error.

The roundings of two heights and of their difference are at most 3 eps of the products. The rest is
for vertices that earlier operations rounded (tests of slivers, `test_polygon_wear.py`).
"""

MINIMUM = float(np.finfo(np.float64).tiny)
"""Smallest normal number: a divisor, or a distance, that must not be zero."""


class Point(NamedTuple):
    """A point of the plane, or a vector."""

    x: float
    y: float


class Moments(NamedTuple):
    """Area and centroid of a polygon."""

    area: float
    x: float
    y: float


class FarthestPair(NamedTuple):
    """Maximum distance between two vertices, and their indices."""

    distance: float
    first: int
    last: int


@inlined
def cross(ax: float, ay: float, bx: float, by: float) -> float:
    """Cross product of two vectors of the plane."""
    return ax * by - ay * bx


@inlined
def unsigned(i: int) -> Any:
    """Return an index that cannot be negative as an unsigned integer."""
    return np.uint64(i)


@inlined
def following(i: int, count: int) -> int:
    """Return the index of the next vertex around a polygon."""
    return i + 1 if i + 1 < count else 0


@inlined
def preceding(i: int, count: int) -> int:
    """Return the index of the previous vertex around a polygon."""
    return i - 1 if i > 0 else count - 1


@inlined
def vertex(points: Points, i: int) -> Point:
    """Return a vertex as a point."""
    return Point(points[i, 0], points[i, 1])


@inlined
def put(out: Points, i: int, x: float, y: float) -> None:
    """Write a vertex."""
    out[i, 0] = x
    out[i, 1] = y


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
) -> Point:
    """Return the point of the edge i-j at a level of `normal . p`.

    The heights of i and j differ. It is interpolated from the end nearer to the level, and does not
    depend, bit for bit, on the order of i and j, so that a cut segment stays a segment.
    """
    near = i
    far = j
    height_near = height(points, i, normal_x, normal_y)
    height_far = height(points, j, normal_x, normal_y)
    farther = abs(level - height_near) - abs(level - height_far)
    if farther > 0.0 or (farther == 0.0 and height_near > height_far):
        near, far = far, near
        height_near, height_far = height_far, height_near

    fraction = (level - height_near) / (height_far - height_near)
    x = points[near, 0] + fraction * (points[far, 0] - points[near, 0])
    y = points[near, 1] + fraction * (points[far, 1] - points[near, 1])

    # A cut along an axis has its coordinate exactly. The normal is not zero: the heights differ.
    if normal_x == 0.0:
        y = level / normal_y
    elif normal_y == 0.0:
        x = level / normal_x
    return Point(x, y)


@compiled
def cut_cap(
    points: Points, count: int, top: int, normal_x: float, normal_y: float, level: float
) -> int:
    """Remove, in place, the part with normal . p > level; return the new number of vertices.

    It is at most count + 1. Vertex `top` is the highest and is higher than the level, and some
    vertex is not. O(count). The two points where the boundary crosses the level replace the
    sequence of high vertices around the top; other vertices do not change, so that rounding errors
    elsewhere have no effect.
    """
    # The vertices from `first` to `last` are high, those before and after them are not.
    first = top
    before = preceding(first, count)
    while height(points, before, normal_x, normal_y) > level:
        first = before
        before = preceding(first, count)
    last = top
    after = following(last, count)
    while height(points, after, normal_x, normal_y) > level:
        last = after
        after = following(last, count)

    enter = crossing(points, before, first, normal_x, normal_y, level)
    leave = crossing(points, last, after, normal_x, normal_y, level)
    # A crossing at a vertex that stays adds none, and two equal crossings add one.
    differ = enter.x != leave.x or enter.y != leave.y
    adds_enter = height(points, before, normal_x, normal_y) < level and differ
    adds_leave = height(points, after, normal_x, normal_y) < level
    added = int(adds_enter) + int(adds_leave)

    if first <= last:
        target = first
        move_tail(points, count, last + 1, first + added)
        count = first + added + (count - last - 1)
    else:
        # The high vertices are both ends of the array.
        target = first - last - 1
        for i in range(target):
            move(points, i + last + 1, i)
        count = target + added

    if adds_enter:
        put(points, target, enter.x, enter.y)
        target += 1
    if adds_leave:
        put(points, target, leave.x, leave.y)
    return count


@inlined
def move_tail(points: Points, count: int, start: int, target: int) -> None:
    """Move the vertices from `start` on to the rows from `target` on, which may overlap."""
    step = target - start
    if step > 0:
        for i in range(count - 1, start - 1, -1):
            move(points, i, i + step)
    elif step < 0:
        for i in range(start, count):
            move(points, i, i + step)


@compiled
def clip_to_band(
    points: Points, count: int, normal_x: float, normal_y: float, lower: float, upper: float
) -> tuple[int, float]:
    """Cut in place by the band lower <= normal . p <= upper; return the new count and the overlap.

    The array needs room for two more vertices. The normal has any nonzero length; infinite bounds
    give a half-plane. The overlap is the smaller overlap of polygon and band at the two borders,
    times the length of the normal; it is minus their distance, times this length, if they do not
    intersect, and -inf if the polygon is empty or lower > upper. O(count). A vertex on a border is
    inside. The new vertices of an axis-parallel cut lie exactly on its line.
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
    """Return the indices of the first lowest and the first highest vertex along a direction."""
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


@inlined
def support_index(points: Points, count: int, normal_x: float, normal_y: float) -> int:
    """Return the index of the first highest vertex of a nonempty polygon along a direction.

    O(count).
    """
    best = 0
    best_height = height(points, 0, normal_x, normal_y)
    for i in range(1, count):
        here = height(points, i, normal_x, normal_y)
        if here > best_height:
            best = i
            best_height = here
    return best


@compiled
def map_linearly(
    points: Points, count: int, xx: float, xy: float, yx: float, yy: float, out: Points
) -> int:
    """Write the image under the matrix [[xx, xy], [yx, yy]]. O(count).

    A singular matrix gives a segment or a point; a segment takes O(count^2).
    """
    determinant = scaled_determinant(xx, xy, yx, yy)
    made = 0
    for i in range(count):
        # A reflection reverses the order of the vertices.
        source = i if determinant >= 0.0 else count - 1 - i
        x = points[source, 0]
        y = points[source, 1]
        made = append(out, made, xx * x + xy * y, yx * x + yy * y)
    made = close(out, made)
    if determinant != 0.0 or made <= 1:
        return made

    ends = farthest_pair(out, made)
    start = vertex(out, ends.first)
    end = vertex(out, ends.last)
    made = append(out, 0, start.x, start.y)
    return append(out, made, end.x, end.y)


@compiled
def scaled_determinant(xx: float, xy: float, yx: float, yy: float) -> float:
    """Determinant of a matrix that is divided by a power of two near its largest entry.

    The products then do not overflow, and underflow only if the entries differ by 150 decades.
    """
    exponent = math.frexp(max(abs(xx), abs(xy), abs(yx), abs(yy)))[1]
    return cross(
        math.ldexp(xx, -exponent),
        math.ldexp(yx, -exponent),
        math.ldexp(xy, -exponent),
        math.ldexp(yy, -exponent),
    )


@compiled
def fan_area(points: Points, i: int) -> float:
    """Twice the area of the triangle of vertices 0, i and i + 1; zero if rounding makes it < 0."""
    double = cross(
        points[i, 0] - points[0, 0],
        points[i, 1] - points[0, 1],
        points[i + 1, 0] - points[0, 0],
        points[i + 1, 1] - points[0, 1],
    )
    return max(0.0, double)


@compiled
def moments(points: Points, count: int) -> Moments:
    """Return the area and the centroid of a nonempty polygon. O(count).

    The centroid of a set without area is the middle of its farthest vertices. Otherwise it is a
    convex combination of the centroids of a triangle fan, so that it lies in the hull.
    """
    weight = 0.0
    x = 0.0
    y = 0.0
    for i in range(1, count - 1):
        # The centroid of a triangle, from vertex 0, is a third of the sum of its two sides.
        triangle = fan_area(points, i)
        weight += triangle
        x += triangle * ((points[i, 0] - points[0, 0]) + (points[i + 1, 0] - points[0, 0])) / 3.0
        y += triangle * ((points[i, 1] - points[0, 1]) + (points[i + 1, 1] - points[0, 1])) / 3.0
    if weight > 0.0:
        return Moments(0.5 * weight, points[0, 0] + x / weight, points[0, 1] + y / weight)

    ends = farthest_pair(points, count)
    return Moments(
        0.0,
        0.5 * (points[ends.first, 0] + points[ends.last, 0]),
        0.5 * (points[ends.first, 1] + points[ends.last, 1]),
    )


@compiled
def farthest_pair(points: Points, count: int) -> FarthestPair:
    """Return the maximum distance between two vertices, and their indices. O(count^2)."""
    maximum = 0.0
    first = 0
    last = 0
    for i in range(count):
        for j in range(i):
            distance = math.hypot(points[i, 0] - points[j, 0], points[i, 1] - points[j, 1])
            if distance > maximum:
                maximum = distance
                first = i
                last = j
    return FarthestPair(maximum, first, last)


@inlined
def pass_edge(
    nearest: float,
    inside: bool,
    start: tuple[float, float],
    end: tuple[float, float],
    x: float,
    y: float,
) -> tuple[float, bool]:
    """Add an edge to the squared distance of (x, y) from the boundary, and to the parity inside.

    Without branches: a mispredicted branch costs more than a division.
    """
    start_x, start_y = start
    end_x, end_y = end
    edge_x = end_x - start_x
    edge_y = end_y - start_y
    from_x = x - start_x
    from_y = y - start_y
    to_x = x - end_x
    to_y = y - end_y
    offset = cross(edge_x, edge_y, from_x, from_y)
    squared_length = edge_x * edge_x + edge_y * edge_y
    along = from_x * edge_x + from_y * edge_y

    # The nearest point is within the edge, or one of its ends.
    off_line = offset * offset / max(squared_length, MINIMUM)
    off_start = from_x * from_x + from_y * from_y
    off_end = to_x * to_x + to_y * to_y
    squared = off_line if along < squared_length else off_end
    squared = squared if along > 0.0 else off_start

    # The parity changes if the ray from the point to the right crosses the edge.
    rises = end_y > start_y
    inside ^= ((end_y > y) != (start_y > y)) & ((offset > 0.0) == rises)
    return min(nearest, squared), inside


@compiled
def margin(points: Points, count: int, x: float, y: float) -> float:
    """Return the signed distance from (x, y) to the boundary: positive inside, -inf if empty.

    O(count). The parity of the edges to the right gives the sign, and the nearest edge the
    distance. An edge of a few ulp with a wrong direction has no effect on either; the signed
    distance to its line would be wrong.
    """
    nearest = np.inf
    inside = False
    last = count - 1
    for i in range(count):
        nearest, inside = pass_edge(nearest, inside, vertex(points, last), vertex(points, i), x, y)
        last = i
    return math.sqrt(nearest) if inside else -math.sqrt(nearest)
