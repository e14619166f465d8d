"""Compiled predicates on polygons that are decided exactly, and intersections of polygons built on
them.

A polygon is the convex hull of its vertices, stored as in `polygon`. The sign of an orientation is
evaluated in floating point, then with twice the precision, then exactly: rounding decides nothing.
Products of two coordinates must neither overflow nor underflow: coordinates from 1e-140 to 1e60 in
size, and zero.
"""

from __future__ import annotations

import numpy as np

from infoset._compile import compiled
from infoset.geometry.double_words import two_product, two_sum
from infoset.geometry.polygon import Points, append, close, copy, move, put

_SINGLE = 4e-16
"""A difference of two products of differences has an error of less than (3 + 16 u) u of their
sizes, u = 1.1e-16.
"""


@compiled
def exact_sum(terms: Points) -> float:
    """Return the sum of numbers, shape (k,), within a few ulp of itself; its sign is exact.

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
def orientation(ax: float, ay: float, bx: float, by: float, cx: float, cy: float) -> float:
    """Return twice the area of the triangle a, b, c, within a few ulp of itself: positive if c is
    left of a -> b.
    """
    ux = bx - ax
    uy = by - ay
    vx = cx - ax
    vy = cy - ay
    left = ux * vy
    right = uy * vx
    # Without cancellation the result is accurate.
    if min(left, right) <= 0.0 <= max(left, right) and left != right:
        return left - right
    ux, ux_low = two_sum(bx, -ax)
    uy, uy_low = two_sum(by, -ay)
    vx, vx_low = two_sum(cx, -ax)
    vy, vy_low = two_sum(cy, -ay)
    left, left_low = two_product(ux, vy)
    right, right_low = two_product(uy, vx)
    if ux_low == 0.0 and uy_low == 0.0 and vx_low == 0.0 and vy_low == 0.0:
        return (left - right) + (left_low - right_low)
    difference, low = two_sum(left, -right)
    low += (left_low - right_low) + ((ux * vy_low + ux_low * vy) - (uy * vx_low + uy_low * vx))
    # The neglected terms are products of two rounding errors; the margin keeps the result within a
    # few ulp of itself.
    if abs(difference + low) > 1e-15 * (abs(left) + abs(right)):
        return difference + low
    terms = np.empty(16)
    terms[0], terms[1] = two_product(ux_low, vy_low)
    terms[2], terms[3] = two_product(-uy_low, vx_low)
    terms[4], terms[5] = two_product(ux, vy_low)
    terms[6], terms[7] = two_product(ux_low, vy)
    terms[8], terms[9] = two_product(-uy, vx_low)
    terms[10], terms[11] = two_product(-uy_low, vx)
    terms[12] = left
    terms[13] = left_low
    terms[14], terms[15] = -right, -right_low
    return exact_sum(terms)


@compiled
def side(ax: float, ay: float, bx: float, by: float, cx: float, cy: float) -> float:
    """Return a number with the exact sign of `orientation`."""
    left = (bx - ax) * (cy - ay)
    right = (by - ay) * (cx - ax)
    if abs(left - right) > _SINGLE * (abs(left) + abs(right)):
        return left - right
    return orientation(ax, ay, bx, by, cx, cy)


@compiled
def sort_points(points: Points, count: int) -> None:
    """Sort points by x, then by y, in place, by insertion: O(count) if they are nearly sorted."""
    for i in range(1, count):
        x = points[i, 0]
        y = points[i, 1]
        j = i
        while j > 0 and (points[j - 1, 0] > x or (points[j - 1, 0] == x and points[j - 1, 1] > y)):
            move(points, j - 1, j)
            j -= 1
        put(points, j, x, y)


@compiled
def drop_repeats(points: Points, count: int) -> int:
    """Remove vertices that repeat the previous one, in place; return the new count. O(count)."""
    made = 0
    for i in range(count):
        made = append(points, made, points[i, 0], points[i, 1])
    return close(points, made)


@compiled
def hull(points: Points, count: int, out: Points) -> int:
    """Write the convex hull of points, exactly decided, without vertices along an edge; return the
    number of vertices.

    It has 2 vertices if the points lie on a line, 1 if they coincide. `out` may be `points`.
    O(count) for sorted points; the sort takes O(count^2) in the worst case.

    References
    ----------
    A. M. Andrew, Another efficient algorithm for convex hulls in two dimensions, Inf. Process.
    Lett. 9 (1979).
    """
    points = points[:count].copy()
    sort_points(points, count)
    chain = np.empty((2 * count, 2))
    made, fewest, lower = 0, 1, 0
    for step in range(2 * count - 1):  # forth and back
        i = step if step < count else 2 * count - 2 - step
        if step == count:
            fewest = made
            lower = made - 2
        x = points[i, 0]
        y = points[i, 1]
        if lower > 0 and chain[lower, 0] == x and chain[lower, 1] == y:  # in the lower chain
            lower -= 1
            continue
        while made > fewest and (
            side(
                chain[made - 2, 0], chain[made - 2, 1], chain[made - 1, 0], chain[made - 1, 1], x, y
            )
            <= 0.0
        ):
            made -= 1
        if step == 0 or i > 0:
            made = append(chain, made, x, y)
    copy(chain, made, out)
    return made


@compiled
def tidy(points: Points, count: int) -> tuple[Points, int]:
    """Return the polygon if it is strictly convex, otherwise its hull. O(count)."""
    strict = count != 2 or points[0, 0] != points[1, 0] or points[0, 1] != points[1, 1]
    i = count - 2
    j = count - 1
    for k in range(count if count > 2 else 0):
        turn = side(
            points[i, 0], points[i, 1], points[j, 0], points[j, 1], points[k, 0], points[k, 1]
        )
        strict &= turn > 0.0
        i = j
        j = k
    if strict:
        return points, count
    out = np.empty((count, 2))
    return out, hull(points, count, out)


@compiled
def holds(points: Points, count: int, x: float, y: float) -> bool:
    """Whether a point is in a strictly convex polygon or on its boundary, exactly decided.
    O(count).
    """
    if count == 0:
        return False
    j = count - 1
    for k in range(count):
        if side(points[j, 0], points[j, 1], points[k, 0], points[k, 1], x, y) < 0.0:
            return False
        j = k
    if count > 2:
        return True
    last = count - 1
    low_x = min(points[0, 0], points[last, 0])
    high_x = max(points[0, 0], points[last, 0])
    low_y = min(points[0, 1], points[last, 1])
    high_y = max(points[0, 1], points[last, 1])
    return bool((low_x <= x <= high_x) & (low_y <= y <= high_y))


@compiled
def meeting(a: Points, i: int, j: int, b: Points, k: int, m: int) -> tuple[float, float]:
    """Return the point in which the edge i-j of a crosses the edge k-m of b, within 4 ulp of the
    coordinates.
    """
    ax = a[i, 0]
    ay = a[i, 1]
    bx = a[j, 0]
    by = a[j, 1]
    cx = b[k, 0]
    cy = b[k, 1]
    dx = b[m, 0]
    dy = b[m, 1]
    # The shorter edge is divided, from its nearer end.
    if abs(dx - cx) + abs(dy - cy) < abs(bx - ax) + abs(by - ay):
        ax, ay, bx, by, cx, cy, dx, dy = cx, cy, dx, dy, ax, ay, bx, by
    from_a = abs(orientation(cx, cy, dx, dy, ax, ay))
    from_b = abs(orientation(cx, cy, dx, dy, bx, by))
    if from_a > from_b:
        ax, ay, bx, by, from_a, from_b = bx, by, ax, ay, from_b, from_a
    fraction = from_a / (from_a + from_b)
    x = ax + fraction * (bx - ax)
    y = ay + fraction * (by - ay)
    return cx if cx == dx else x, cy if cy == dy else y


@compiled
def intersect(points: Points, count: int, other: Points, other_count: int, out: Points) -> int:
    """Write the intersection of two polygons and return its number of vertices, at most count +
    other_count.

    O(count * other_count) orientations. The vertices are the vertices of each polygon that are in
    the other one and the crossings of edges. All are decided exactly, so that no sliver or contact
    is lost, and each vertex is within 4 ulp of the coordinates of the exact one.
    """
    if count == 0 or other_count == 0:
        return 0
    a, n = tidy(points, count)
    b, m = tidy(other, other_count)
    corners = np.empty((3 * (n + m), 2))
    of_b, made = sides_of(a, n, b, m, corners, 0)
    of_a, made = sides_of(b, m, a, n, corners, made)
    for i in range(n if n > 2 else n - 1):
        j = i + 1 if i + 1 < n else 0
        for k in range(m if m > 2 else m - 1):
            p = k + 1 if k + 1 < m else 0
            if of_b[i, k] * of_b[i, p] < 0.0 and of_a[k, i] * of_a[k, j] < 0.0:
                x, y = meeting(a, i, j, b, k, p)
                put(corners, made, x, y)
                made += 1
    return hull(corners, made, out)


@compiled
def sides_of(
    a: Points, n: int, b: Points, m: int, corners: Points, made: int
) -> tuple[Points, int]:
    """Return the side of each edge of a on which each vertex of b is, -1, 0 or 1, shape (n, m);
    append those in a.
    """
    sides = np.empty((n, m))
    for k in range(m):
        inside = True
        for i in range(n):
            j = i + 1 if i + 1 < n else 0
            sides[i, k] = np.sign(side(a[i, 0], a[i, 1], a[j, 0], a[j, 1], b[k, 0], b[k, 1]))
            inside &= sides[i, k] >= 0.0
        if inside and (n > 2 or holds(a, n, b[k, 0], b[k, 1])):
            put(corners, made, b[k, 0], b[k, 1])
            made += 1
    return sides, made


@compiled
def reflex_vertex(points: Points, count: int) -> int:
    """Return the first vertex at which a ring is not convex, exactly decided; -1 for a convex ring.
    O(count).

    There the ring turns the other way or back, or it begins a second revolution. No vertex repeats
    the previous one, and a ring on one line is convex.
    """
    area, is_flat = 0.0, True
    for j in range(count):
        ax = points[j - 1, 0]
        ay = points[j - 1, 1]
        bx = points[j, 0]
        by = points[j, 1]
        cx = points[(j + 1) % count, 0]
        cy = points[(j + 1) % count, 1]
        area += orientation(points[0, 0], points[0, 1], bx, by, cx, cy)
        is_flat &= side(ax, ay, bx, by, cx, cy) == 0.0
    if is_flat:
        return -1
    peaks, second_peak = 0, -1
    for j in range(count):
        ax = points[j - 1, 0]
        ay = points[j - 1, 1]
        bx = points[j, 0]
        by = points[j, 1]
        cx = points[(j + 1) % count, 0]
        cy = points[(j + 1) % count, 1]
        turn = side(ax, ay, bx, by, cx, cy) * (1.0 if area > 0.0 else -1.0)
        if turn < 0.0 or (turn == 0.0 and (bx - ax) * (cx - bx) + (by - ay) * (cy - by) < 0.0):
            return j
        if (by > ay or (by == ay and bx > ax)) and (cy < by or (cy == by and cx < bx)):
            peaks += 1
            second_peak = j if peaks == 2 else second_peak
    return second_peak
