"""Compiled predicates on polygons that are decided exactly, and intersections of polygons.

A polygon is the convex hull of its vertices, stored as in `polygon`. The sign of an orientation is
evaluated in floating point, then with twice the precision, then exactly: rounding decides nothing.
Products of two coordinates must neither overflow nor underflow: coordinates from 1e-140 to 1e60 in
size, and zero.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from infoset._compile import compiled, inlined, pasted
from infoset.arrays import Floats
from infoset.geometry.double_words import two_product, two_sum
from infoset.geometry.polygon import (
    Point,
    Points,
    append,
    close,
    copy,
    following,
    move,
    preceding,
    put,
    vertex,
)

SINGLE_ROUNDING = 4e-16
"""Share of two products from which the sign of their difference is certain.

A difference of two products of differences has an error of less than (3 + 16 u) u of their sizes,
u = 1.1e-16 (Shewchuk, 1997).
"""
DOUBLE_ROUNDING = 1e-15
"""The same for twice the precision, whose roundings are at most 15 u^2 of the sizes.

From 1e-15 = 9 u of the sizes on, the difference is therefore within three ulp of itself.
"""


class DoubleVector(NamedTuple):
    """A vector whose coordinates x + x_low and y + y_low are sums of two numbers."""

    x: float
    x_low: float
    y: float
    y_low: float


@inlined
def vector_between(start: Point, end: Point) -> DoubleVector:
    """Return the vector from one point to another, without rounding."""
    x, x_low = two_sum(end.x, -start.x)
    y, y_low = two_sum(end.y, -start.y)
    return DoubleVector(x, x_low, y, y_low)


@compiled
def exact_sum(terms: Floats) -> float:
    """Return the sum of numbers, shape (k,), within a few ulp of itself; its sign is exact.

    The terms are replaced by others of the same sum that do not overlap.

    References
    ----------
    J. R. Shewchuk, Adaptive precision floating-point arithmetic and fast robust geometric
    predicates, Discrete and Computational Geometry 18 (1997): the function Grow-Expansion.
    """
    for size in range(terms.size):
        carried = terms[size]
        for i in range(size):
            carried, terms[i] = two_sum(carried, terms[i])
        terms[size] = carried

    total = 0.0
    for term in terms:
        total += term
    return total


@compiled
def exact_cross(u: DoubleVector, v: DoubleVector) -> float:
    """Return the cross product of two vectors within a few ulp of itself; its sign is exact."""
    # All products of two parts with their rounding errors, from the smallest to the largest: eight
    # products of two terms each.
    terms = np.empty(16)
    terms[0], terms[1] = two_product(u.x_low, v.y_low)
    terms[2], terms[3] = two_product(-u.y_low, v.x_low)
    terms[4], terms[5] = two_product(u.x, v.y_low)
    terms[6], terms[7] = two_product(u.x_low, v.y)
    terms[8], terms[9] = two_product(-u.y, v.x_low)
    terms[10], terms[11] = two_product(-u.y_low, v.x)
    terms[12], terms[13] = two_product(u.x, v.y)
    terms[14], terms[15] = two_product(-u.y, v.x)
    return exact_sum(terms)


@compiled
def orientation(a: Point, b: Point, c: Point) -> float:
    """Return twice the area of the triangle a, b, c: positive if c is left of a -> b.

    It is within a few ulp of itself: rounded if that is enough, else with twice the precision, else
    exact.
    """
    left = (b.x - a.x) * (c.y - a.y)
    right = (b.y - a.y) * (c.x - a.x)
    # Without cancellation the result is accurate.
    if min(left, right) <= 0.0 <= max(left, right) and left != right:
        return left - right

    u = vector_between(a, b)
    v = vector_between(a, c)
    left, left_low = two_product(u.x, v.y)
    right, right_low = two_product(u.y, v.x)
    if u.x_low == 0.0 and u.y_low == 0.0 and v.x_low == 0.0 and v.y_low == 0.0:
        return (left - right) + (left_low - right_low)

    # The neglected terms are products of two rounding errors.
    difference, low = two_sum(left, -right)
    low += (left_low - right_low) + (
        (u.x * v.y_low + u.x_low * v.y) - (u.y * v.x_low + u.y_low * v.x)
    )
    if abs(difference + low) > DOUBLE_ROUNDING * (abs(left) + abs(right)):
        return difference + low

    return exact_cross(u, v)


@compiled
def side(a: Point, b: Point, c: Point) -> float:
    """Return a number with the exact sign of `orientation`: positive if c is left of a -> b."""
    left = (b.x - a.x) * (c.y - a.y)
    right = (b.y - a.y) * (c.x - a.x)
    if abs(left - right) > SINGLE_ROUNDING * (abs(left) + abs(right)):
        return left - right
    return orientation(a, b, c)


@inlined
def precedes(a: Point, b: Point) -> bool:
    """Whether a is left of b, or below it at the same x."""
    return a.x < b.x or (a.x == b.x and a.y < b.y)


@compiled
def sort_points(points: Points, count: int) -> None:
    """Sort points by x, then by y, in place, by insertion: O(count) if they are nearly sorted."""
    for i in range(1, count):
        point = vertex(points, i)
        j = i
        while j > 0 and precedes(point, vertex(points, j - 1)):
            move(points, j - 1, j)
            j -= 1
        put(points, j, point.x, point.y)


@compiled
def drop_repeats(points: Points, count: int) -> int:
    """Remove vertices that repeat the previous one, in place; return the new count. O(count).

    Last vertices that repeat the first one are removed, too.
    """
    made = 0
    for i in range(count):
        made = append(points, made, points[i, 0], points[i, 1])
    return close(points, made)


@compiled
def hull(points: Points, count: int, out: Points) -> int:
    """Write the convex hull of points, decided exactly; return the number of vertices.

    No vertex lies along an edge: there are 2 vertices if the points lie on a line, 1 if they
    coincide. `out` may be `points`. O(count) for sorted points; the sort takes O(count^2) in the
    worst case.

    References
    ----------
    A. M. Andrew, Another efficient algorithm for convex hulls in two dimensions, Inf. Process.
    Lett. 9 (1979).
    """
    points = points[:count].copy()
    sort_points(points, count)

    # The lower half, from left to right.
    chain = np.empty((2 * count, 2))
    made = 0
    for i in range(count):
        made = extend(chain, made, 1, vertex(points, i))

    # The upper half, back to the first point. Vertices of the lower half are below it.
    rightmost = made
    lower = made - 2
    for i in range(count - 2, -1, -1):
        point = vertex(points, i)
        if lower > 0 and chain[lower, 0] == point.x and chain[lower, 1] == point.y:
            lower -= 1
            continue
        made = extend(chain, made, rightmost, point)

    made = close(chain, made)
    copy(chain, made, out)
    return made


@pasted
def extend(chain: Points, count: int, fewest: int, point: Point) -> int:
    """Append a point to a chain that turns left; return the new count.

    Last vertices at which the chain would no longer turn left are removed, down to `fewest`.
    """
    while count > fewest and side(vertex(chain, count - 2), vertex(chain, count - 1), point) <= 0.0:
        count -= 1
    return append(chain, count, point.x, point.y)


@compiled
def is_strictly_convex(points: Points, count: int) -> bool:
    """Whether a ring turns left at each vertex; two vertices must differ. O(count)."""
    if count < 2:
        return True
    a = vertex(points, count - 2)
    b = vertex(points, count - 1)
    if count == 2:
        return a.x != b.x or a.y != b.y

    for i in range(count):
        c = vertex(points, i)
        if not side(a, b, c) > 0.0:
            return False
        a = b
        b = c
    return True


@compiled
def tidy(points: Points, count: int) -> tuple[Points, int]:
    """Return the polygon itself if it is strictly convex, otherwise its hull, in a new array.

    O(count) for a strictly convex polygon, otherwise as `hull`.
    """
    if is_strictly_convex(points, count):
        return points, count
    out = np.empty((count, 2))
    return out, hull(points, count, out)


@compiled
def holds(points: Points, count: int, point: Point) -> bool:
    """Whether a strictly convex polygon contains a point, also on the boundary. O(count), exact."""
    if count == 0:
        return False
    start = vertex(points, count - 1)
    for i in range(count):
        end = vertex(points, i)
        if side(start, end, point) < 0.0:
            return False
        start = end
    if count > 2:
        return True

    # On the line of a segment: between its ends.
    first = vertex(points, 0)
    last = vertex(points, count - 1)
    in_x = min(first.x, last.x) <= point.x <= max(first.x, last.x)
    in_y = min(first.y, last.y) <= point.y <= max(first.y, last.y)
    return bool(in_x & in_y)


@compiled
def intersect(points: Points, count: int, other: Points, other_count: int, out: Points) -> int:
    """Write the intersection of two polygons; return its number of vertices.

    It is at most count + other_count. O(count * other_count) orientations. The vertices are the
    vertices of each polygon that are in the other one and the crossings of edges. All are decided
    exactly, so that no sliver or contact is lost, and each vertex is within 4 ulp of the
    coordinates of the exact one.
    """
    if count == 0 or other_count == 0:
        return 0
    a, n = tidy(points, count)
    b, m = tidy(other, other_count)
    b_sides = sides_of(a, n, b, m)
    a_sides = sides_of(b, m, a, n)

    # Up to n + m vertices inside, and two crossings on each edge.
    corners = np.empty((3 * (n + m), 2))
    made = append_inner(a, n, b, m, b_sides, corners, 0)
    made = append_inner(b, m, a, n, a_sides, corners, made)
    for i in range(edge_count(n)):
        j = following(i, n)
        for k in range(edge_count(m)):
            p = following(k, m)
            if b_sides[i, k] * b_sides[i, p] < 0.0 and a_sides[k, i] * a_sides[k, j] < 0.0:
                corner = meeting(vertex(a, i), vertex(a, j), vertex(b, k), vertex(b, p))
                put(corners, made, corner.x, corner.y)
                made += 1
    return hull(corners, made, out)


@inlined
def edge_count(count: int) -> int:
    """Number of edges of a polygon, where a segment has one."""
    return count if count > 2 else count - 1


@compiled
def sides_of(a: Points, n: int, b: Points, m: int) -> Floats:
    """Return the side of each edge of a on which each vertex of b is, shape (n, m): -1, 0 or 1."""
    sides = np.empty((n, m))
    for i in range(n):
        start = vertex(a, i)
        end = vertex(a, following(i, n))
        for k in range(m):
            sides[i, k] = np.sign(side(start, end, vertex(b, k)))
    return sides


@compiled
def append_inner(
    a: Points, n: int, b: Points, m: int, sides: Floats, corners: Points, made: int
) -> int:
    """Append the vertices of b that are in a, from their `sides` of it; return the new count."""
    for k in range(m):
        inside = True
        for i in range(n):
            inside &= sides[i, k] >= 0.0
        # The sides of a segment or a point do not exclude points on its line.
        if inside and (n > 2 or holds(a, n, vertex(b, k))):
            put(corners, made, b[k, 0], b[k, 1])
            made += 1
    return made


@compiled
def meeting(a: Point, b: Point, c: Point, d: Point) -> Point:
    """Return the point in which the edges a-b and c-d cross, within 4 ulp of the coordinates.

    The ends of each edge are on different sides of the other one, and none of them on it.
    """
    # The shorter edge is divided, from its nearer end.
    if abs(d.x - c.x) + abs(d.y - c.y) < abs(b.x - a.x) + abs(b.y - a.y):
        a, c = c, a
        b, d = d, b
    from_a = abs(orientation(c, d, a))
    from_b = abs(orientation(c, d, b))
    if from_a > from_b:
        a, b = b, a
        from_a, from_b = from_b, from_a

    fraction = from_a / (from_a + from_b)
    x = a.x + fraction * (b.x - a.x)
    y = a.y + fraction * (b.y - a.y)
    # An edge along an axis has its coordinate exactly.
    return Point(c.x if c.x == d.x else x, c.y if c.y == d.y else y)


@compiled
def reflex_vertex(points: Points, count: int) -> int:
    """Return the first vertex at which a ring is not convex; -1 for a convex ring. O(count), exact.

    There the ring turns the other way or back, or it begins a second revolution. No vertex repeats
    the previous one, and a ring on one line is convex.
    """
    area = 0.0
    is_flat = True
    for j in range(count):
        a = vertex(points, preceding(j, count))
        b = vertex(points, j)
        c = vertex(points, following(j, count))
        area += orientation(vertex(points, 0), b, c)
        is_flat &= side(a, b, c) == 0.0
    if is_flat:
        return -1

    # The sense in which the ring goes around: 1 is counter-clockwise.
    sense = 1.0 if area > 0.0 else -1.0
    peaks = 0
    second_peak = -1
    for j in range(count):
        a = vertex(points, preceding(j, count))
        b = vertex(points, j)
        c = vertex(points, following(j, count))
        turn = side(a, b, c) * sense
        turns_back = (b.x - a.x) * (c.x - b.x) + (b.y - a.y) * (c.y - b.y) < 0.0
        if turn < 0.0 or (turn == 0.0 and turns_back):
            return j

        # A convex ring has one vertex that is higher than both neighbours.
        if is_higher(b, a) and is_higher(b, c):
            peaks += 1
            if peaks == 2:
                second_peak = j
    return second_peak


@inlined
def is_higher(a: Point, b: Point) -> bool:
    """Whether a is above b, or right of it at the same y."""
    return a.y > b.y or (a.y == b.y and a.x > b.x)
