"""Compiled operations on one convex polygon of the plane.

A polygon is an array `points` of shape (capacity, 2) whose first `count` rows are its vertices, counter-clockwise.
One vertex is a point and two are a segment: they are polygons like any other; none is the empty set.
Operations that may change the number of vertices write to `out`, which must not overlap `points`, and return the
new count. No tolerance is absolute: a cut or a sum is exact up to rounding of the coordinates, a few ulp.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from infoset._compile import compiled, inlined

Points = NDArray[np.float64]


@inlined
def cross(ax: float, ay: float, bx: float, by: float) -> float:
    """Cross product of two vectors of the plane."""
    return ax * by - ay * bx


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
    """Drop trailing vertices that repeat the first; return the new count."""
    while count > 1 and out[count - 1, 0] == out[0, 0] and out[count - 1, 1] == out[0, 1]:
        count -= 1
    return count


@inlined
def append_crossing(
    out: Points,
    count: int,
    points: Points,
    edge: tuple[int, int, float, float],
    level: float,
    normal_x: float,
    normal_y: float,
) -> int:
    """Add the point of an edge (i, j, height of i, height of j) at a level, counted from its nearer end."""
    near, far, height_near, height_far = edge
    if abs(level - height_near) > abs(height_far - level):
        far, near, height_far, height_near = edge
    fraction = (level - height_near) / (height_far - height_near)
    x = points[near, 0] + fraction * (points[far, 0] - points[near, 0])
    y = points[near, 1] + fraction * (points[far, 1] - points[near, 1])
    if normal_x == 0.0:
        y = level / normal_y
    elif normal_y == 0.0:
        x = level / normal_x
    return append(out, count, x, y)


@compiled
def clip_to_band(
    points: Points,
    count: int,
    normal_x: float,
    normal_y: float,
    lower: float,
    upper: float,
    out: Points,
) -> int:
    """Intersection with the band lower <= normal . p <= upper, in one pass over the edges.

    Parameters
    ----------
    points, count : polygon
    normal_x, normal_y : float
        Normal of the band, of any length but zero.
    lower, upper : float
        Bounds; infinite ones give a half-plane.
    out : ndarray, shape (>= count + 2, 2)

    Returns
    -------
    int
        Vertices of the intersection; 0 if it is empty.

    Notes
    -----
    O(count). A vertex on the border is inside. An axis-parallel cut leaves vertices exactly on its line.
    """
    made = 0
    if count == 0 or lower > upper:
        return 0
    last = count - 1
    height_last = normal_x * points[last, 0] + normal_y * points[last, 1]
    for i in range(count):
        height = normal_x * points[i, 0] + normal_y * points[i, 1]
        inside = lower <= height <= upper
        if inside and lower <= height_last <= upper:
            put(out, made, points[i, 0], points[i, 1])
            made += 1
        else:
            edge = (last, i, height_last, height)
            if height_last < lower < height:
                made = append_crossing(out, made, points, edge, lower, normal_x, normal_y)
            elif height < upper < height_last:
                made = append_crossing(out, made, points, edge, upper, normal_x, normal_y)
            if height_last < upper < height:
                made = append_crossing(out, made, points, edge, upper, normal_x, normal_y)
            elif height < lower < height_last:
                made = append_crossing(out, made, points, edge, lower, normal_x, normal_y)
            if inside:
                made = append(out, made, points[i, 0], points[i, 1])
        last = i
        height_last = height
    return close(out, made)


@inlined
def translate(points: Points, count: int, x: float, y: float) -> None:
    """Move by (x, y), in place. O(count)."""
    for i in range(count):
        points[i, 0] += x
        points[i, 1] += y


@compiled
def map_linearly(points: Points, count: int, xx: float, xy: float, yx: float, yy: float, out: Points) -> int:
    """Image under the matrix [[xx, xy], [yx, yy]]; a singular one gives a segment or a point. O(count)."""
    determinant = xx * yy - xy * yx
    for i in range(count):
        source = i if determinant >= 0.0 else count - 1 - i
        x = points[source, 0]
        y = points[source, 1]
        out[i, 0] = xx * x + xy * y
        out[i, 1] = yx * x + yy * y
    if determinant != 0.0 or count <= 1:
        return count
    along_x, along_y = (xx, yx) if xx != 0.0 or yx != 0.0 else (xy, yy)
    first = support_index(out, count, -along_x, -along_y)
    last = support_index(out, count, along_x, along_y)
    first_x, first_y, last_x, last_y = out[first, 0], out[first, 1], out[last, 0], out[last, 1]
    made = append(out, 0, first_x, first_y)
    return append(out, made, last_x, last_y)


@inlined
def support_index(points: Points, count: int, normal_x: float, normal_y: float) -> int:
    """Index of a vertex farthest along a direction: the first of equals. O(count)."""
    best = 0
    best_height = normal_x * points[0, 0] + normal_y * points[0, 1]
    for i in range(1, count):
        height = normal_x * points[i, 0] + normal_y * points[i, 1]
        if height > best_height:
            best = i
            best_height = height
    return best


@compiled
def add_segment(points: Points, count: int, half_x: float, half_y: float, out: Points) -> int:
    """Minkowski sum with the segment from -half to +half.

    Parameters
    ----------
    points, count : polygon
    half_x, half_y : float
        Half of the segment, as a vector.
    out : ndarray, shape (>= count + 2, 2)

    Returns
    -------
    int
        Vertices of the sum: at most count + 2; 0 for the empty set.

    Notes
    -----
    O(count). The boundary is cut where it is extreme across the segment; the part to the right of the segment's
    direction moves by +half, the rest by -half. Cutting at extremes, not at sign changes of edges, keeps the result
    sound when rounding makes tiny edges turn the wrong way.
    """
    if count == 0:
        return 0
    if half_x == 0.0 and half_y == 0.0:
        for i in range(count):
            put(out, i, points[i, 0], points[i, 1])
        return count
    # Heights are measured across the segment; of equally high vertices the hindmost and foremost count.
    bottom = np.inf
    top = -np.inf
    bottom_first = bottom_last = top_first = top_last = 0
    for i in range(count):
        height = cross(half_x, half_y, points[i, 0], points[i, 1])
        if height <= bottom:
            if height < bottom:
                bottom = height
                bottom_first = bottom_last = i
            else:
                bottom_first = hindmost(points, bottom_first, i, half_x, half_y)
                bottom_last = hindmost(points, bottom_last, i, -half_x, -half_y)
        if height >= top:
            if height > top:
                top = height
                top_first = top_last = i
            else:
                top_first = hindmost(points, top_first, i, -half_x, -half_y)
                top_last = hindmost(points, top_last, i, half_x, half_y)
    made = put_stretch(points, count, bottom_last, top_first, half_x, half_y, out, 0)
    return put_stretch(points, count, top_last, bottom_first, -half_x, -half_y, out, made)


@inlined
def put(out: Points, i: int, x: float, y: float) -> None:
    """Write a vertex."""
    out[i, 0] = x
    out[i, 1] = y


@inlined
def put_stretch(points: Points, count: int, first: int, last: int, x: float, y: float, out: Points, made: int) -> int:
    """Write the vertices from first to last, counter-clockwise, moved by (x, y); return how many there are now."""
    end = last + 1 if first <= last else count
    for i in range(first, end):
        put(out, made, points[i, 0] + x, points[i, 1] + y)
        made += 1
    if first > last:
        for i in range(last + 1):
            put(out, made, points[i, 0] + x, points[i, 1] + y)
            made += 1
    return made


@inlined
def hindmost(points: Points, i: int, j: int, x: float, y: float) -> int:
    """Whichever of two vertices lies less far along (x, y); the first of equals."""
    if x * (points[j, 0] - points[i, 0]) + y * (points[j, 1] - points[i, 1]) < 0.0:
        return j
    return i


@compiled
def lowest_index(points: Points, count: int) -> int:
    """Index of the lowest vertex, the leftmost of equally low ones."""
    best = 0
    for i in range(1, count):
        if points[i, 1] < points[best, 1] or (points[i, 1] == points[best, 1] and points[i, 0] < points[best, 0]):
            best = i
    return best


@compiled
def add_polygon(points: Points, count: int, other: Points, other_count: int, out: Points) -> int:
    """Minkowski sum with another convex polygon, by merging their edges in order of direction.

    Parameters
    ----------
    points, count : polygon
    other, other_count : polygon
    out : ndarray, shape (>= count + other_count, 2)

    Returns
    -------
    int
        Vertices of the sum: at most count + other_count; 0 if either is empty.

    Notes
    -----
    O(count + other_count). Each vertex of the sum is one addition of two vertices: nothing accumulates.
    """
    if count == 0 or other_count == 0:
        return 0
    i = first_i = lowest_index(points, count)
    j = first_j = lowest_index(other, other_count)
    steps_i = count if count > 1 else 0
    steps_j = other_count if other_count > 1 else 0
    made = append(out, 0, points[first_i, 0] + other[first_j, 0], points[first_i, 1] + other[first_j, 1])
    while steps_i > 0 or steps_j > 0:
        next_i = i + 1 if i + 1 < count else 0
        next_j = j + 1 if j + 1 < other_count else 0
        edge_x = points[next_i, 0] - points[i, 0]
        edge_y = points[next_i, 1] - points[i, 1]
        other_x = other[next_j, 0] - other[j, 0]
        other_y = other[next_j, 1] - other[j, 1]
        turn = direction_order(edge_x, edge_y, other_x, other_y)
        if steps_j == 0 or (steps_i > 0 and turn >= 0):
            i = next_i
            steps_i -= 1
            if turn == 0 and steps_j > 0:
                j = next_j
                steps_j -= 1
        else:
            j = next_j
            steps_j -= 1
        made = append(out, made, points[i, 0] + other[j, 0], points[i, 1] + other[j, 1])
    return close(out, made)


@compiled
def direction_order(ax: float, ay: float, bx: float, by: float) -> int:
    """1 if direction a comes before b counted counter-clockwise from +x, -1 if after, 0 if they agree."""
    a_returns = ay < 0.0 or (ay == 0.0 and ax < 0.0)
    b_returns = by < 0.0 or (by == 0.0 and bx < 0.0)
    if a_returns != b_returns:
        return -1 if a_returns else 1
    turn = cross(ax, ay, bx, by)
    if turn > 0.0:
        return 1
    if turn < 0.0:
        return -1
    return 0


@compiled
def area(points: Points, count: int) -> float:
    """Area; zero for a point, a segment and the empty set. O(count)."""
    twice = 0.0
    for i in range(1, count - 1):
        twice += max(0.0, fan_area(points, i))
    return 0.5 * twice


@compiled
def fan_area(points: Points, i: int) -> float:
    """Twice the signed area of the triangle of vertices 0, i and i + 1."""
    return cross(
        points[i, 0] - points[0, 0],
        points[i, 1] - points[0, 1],
        points[i + 1, 0] - points[0, 0],
        points[i + 1, 1] - points[0, 1],
    )


@compiled
def centroid(points: Points, count: int) -> tuple[float, float]:
    """Centroid of a polygon that is not empty; the middle of a segment or of a set without area.

    Notes
    -----
    O(count). A convex combination of the triangles of a fan, so it lies in the hull however thin the polygon is.
    """
    weight = 0.0
    x = 0.0
    y = 0.0
    for i in range(1, count - 1):
        triangle = max(0.0, fan_area(points, i))
        weight += triangle
        x += triangle * ((points[i, 0] - points[0, 0]) + (points[i + 1, 0] - points[0, 0])) / 3.0
        y += triangle * ((points[i, 1] - points[0, 1]) + (points[i + 1, 1] - points[0, 1])) / 3.0
    if weight > 0.0:
        return points[0, 0] + x / weight, points[0, 1] + y / weight
    far = 0
    far_distance = 0.0
    for i in range(1, count):
        distance = math.hypot(points[i, 0] - points[0, 0], points[i, 1] - points[0, 1])
        if distance > far_distance:
            far = i
            far_distance = distance
    other = support_index(points, count, points[0, 0] - points[far, 0], points[0, 1] - points[far, 1])
    return 0.5 * (points[far, 0] + points[other, 0]), 0.5 * (points[far, 1] + points[other, 1])


@compiled
def distance_to_edge(points: Points, i: int, j: int, x: float, y: float) -> float:
    """Distance from (x, y) to the edge between vertices i and j."""
    edge_x = points[j, 0] - points[i, 0]
    edge_y = points[j, 1] - points[i, 1]
    from_x = x - points[i, 0]
    from_y = y - points[i, 1]
    length = math.hypot(edge_x, edge_y)
    if length == 0.0:
        return math.hypot(from_x, from_y)
    edge_x /= length
    edge_y /= length
    along = from_x * edge_x + from_y * edge_y
    if along <= 0.0:
        return math.hypot(from_x, from_y)
    if along >= length:
        return math.hypot(x - points[j, 0], y - points[j, 1])
    return abs(cross(edge_x, edge_y, from_x, from_y))


@compiled
def margin(points: Points, count: int, x: float, y: float) -> float:
    """Signed distance from (x, y) to the boundary: positive inside, negative outside, -inf for the empty set.

    Notes
    -----
    O(count). Inside or outside is decided by the parity of the edges to the right, the distance by the nearest
    edge: an edge of a few ulp that points the wrong way spoils neither, as it would the signed distance to a line.
    """
    nearest = np.inf
    inside = False
    last = count - 1
    for i in range(count):
        nearest = min(nearest, distance_to_edge(points, last, i, x, y))
        if (points[i, 1] > y) != (points[last, 1] > y):
            turn = cross(
                points[i, 0] - points[last, 0],
                points[i, 1] - points[last, 1],
                x - points[last, 0],
                y - points[last, 1],
            )
            if (turn > 0.0) == (points[i, 1] > points[last, 1]):
                inside = not inside
        last = i
    return nearest if inside else -nearest


@compiled
def reduce_outward(points: Points, count: int, cap: int) -> int:
    """Drop edges, in place, until at most `cap` vertices are left; the result contains the polygon.

    Parameters
    ----------
    points, count : polygon
    cap : int
        At least 4: a convex polygon of five vertices always has an edge that can go.

    Returns
    -------
    int
        New number of vertices.

    Notes
    -----
    The edge whose neighbours, extended until they meet, add least area goes first. O(count) an edge.
    """
    while count > cap:
        least = np.inf
        chosen = -1
        chosen_x = chosen_y = 0.0
        for i in range(count):
            j = i + 1 if i + 1 < count else 0
            before = i - 1 if i > 0 else count - 1
            after = j + 1 if j + 1 < count else 0
            from_x = points[i, 0] - points[before, 0]
            from_y = points[i, 1] - points[before, 1]
            to_x = points[after, 0] - points[j, 0]
            to_y = points[after, 1] - points[j, 1]
            turn = cross(from_x, from_y, to_x, to_y)
            if turn <= 0.0:
                continue
            edge_x = points[j, 0] - points[i, 0]
            edge_y = points[j, 1] - points[i, 1]
            reach = max(0.0, cross(edge_x, edge_y, to_x, to_y) / turn)
            added = abs(cross(edge_x, edge_y, reach * from_x, reach * from_y))
            if added < least:
                least = added
                chosen = i
                chosen_x = points[i, 0] + reach * from_x
                chosen_y = points[i, 1] + reach * from_y
        if chosen < 0:
            return count
        points[chosen, 0] = chosen_x
        points[chosen, 1] = chosen_y
        gone = chosen + 1 if chosen + 1 < count else 0
        for i in range(gone, count - 1):
            points[i, 0] = points[i + 1, 0]
            points[i, 1] = points[i + 1, 1]
        count -= 1
    return count
