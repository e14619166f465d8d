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

# Thickness, in units of the coordinates' magnitude, below which the orientation of a polygon is rounding.
NEEDLE = 4.0 * float(np.finfo(np.float64).eps)


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
def height(points: Points, i: int, normal_x: float, normal_y: float) -> float:
    """How far a vertex lies along a direction: normal . p."""
    return float(normal_x * points[i, 0] + normal_y * points[i, 1])


@inlined
def crossing(points: Points, i: int, j: int, normal_x: float, normal_y: float, level: float) -> tuple[float, float]:
    """Point of the edge i-j at a level of `normal . p`, counted from its nearer end: least rounding."""
    height_i = height(points, i, normal_x, normal_y)
    height_j = height(points, j, normal_x, normal_y)
    near, far, height_near, height_far = i, j, height_i, height_j
    if abs(level - height_i) > abs(height_j - level):
        near, far, height_near, height_far = j, i, height_j, height_i
    fraction = (level - height_near) / (height_far - height_near)
    x = points[near, 0] + fraction * (points[far, 0] - points[near, 0])
    y = points[near, 1] + fraction * (points[far, 1] - points[near, 1])
    if normal_x == 0.0:
        y = level / normal_y
    elif normal_y == 0.0:
        x = level / normal_x
    return x, y


@compiled
def cut_cap(points: Points, count: int, top: int, normal_x: float, normal_y: float, level: float) -> int:
    """Cut off, in place, what is higher than a level; vertex `top` is higher, another is not.

    Parameters
    ----------
    points, count : polygon
        With room for one vertex more.
    top : int
        The highest vertex.
    normal_x, normal_y, level : float
        Kept is normal . p <= level.

    Returns
    -------
    int
        New number of vertices, at most count + 1.

    Notes
    -----
    O(count). The run of high vertices about the top is replaced by the two points where the boundary crosses the
    level: only that run, so rounding elsewhere cannot tear the polygon.
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
    # A border through a vertex, or both crossings in one place, adds no vertex.
    entering = height(points, before, normal_x, normal_y) < level and (x != other_x or y != other_y)
    leaving = height(points, after, normal_x, normal_y) < level
    added = int(entering) + int(leaving)
    if first <= last:
        kept = count - last - 1
        place = first
        step = first + added - (last + 1)
        if step > 0:
            for i in range(count - 1, last, -1):
                put(points, i + step, points[i, 0], points[i, 1])
        elif step < 0:
            for i in range(last + 1, count):
                put(points, i + step, points[i, 0], points[i, 1])
        count = first + added + kept
    else:
        place = first - last - 1
        for i in range(place):
            put(points, i, points[i + last + 1, 0], points[i + last + 1, 1])
        count = place + added
    if entering:
        put(points, place, x, y)
        place += 1
    if leaving:
        put(points, place, other_x, other_y)
    return count


@compiled
def clip_to_band(
    points: Points, count: int, normal_x: float, normal_y: float, lower: float, upper: float
) -> tuple[int, float]:
    """Intersection, in place, with the band lower <= normal . p <= upper.

    Parameters
    ----------
    points, count : polygon
        With room for two vertices more.
    normal_x, normal_y : float
        Normal of the band, of any length but zero.
    lower, upper : float
        Bounds; infinite ones give a half-plane.

    Returns
    -------
    count : int
        Vertices of the intersection; 0 if it is empty.
    overlap : float
        Least overlap of the polygon and the band across either border; negative is the distance between them.

    Notes
    -----
    O(count). A vertex on the border is inside. An axis-parallel cut leaves its vertices exactly on its line.
    """
    if count == 0 or lower > upper:
        return 0, -np.inf
    bottom, top = extremes(points, count, normal_x, normal_y)
    least = height(points, bottom, normal_x, normal_y)
    greatest = height(points, top, normal_x, normal_y)
    overlap = min(greatest - lower, upper - least)
    if overlap < 0.0:
        return 0, overlap
    if greatest > upper:
        count = cut_cap(points, count, top, normal_x, normal_y, upper)
        bottom, top = extremes(points, count, normal_x, normal_y)
        # Across a band as thin as rounding the cut itself may lie an ulp below the lower border: keep the cut.
        lower = min(lower, height(points, top, normal_x, normal_y))
        least = height(points, bottom, normal_x, normal_y)
    if least < lower:
        count = cut_cap(points, count, bottom, -normal_x, -normal_y, -lower)
    return count, overlap


@inlined
def extremes(points: Points, count: int, normal_x: float, normal_y: float) -> tuple[int, int]:
    """Indices of a lowest and a highest vertex along a direction: the first of equals."""
    least = np.inf
    greatest = -np.inf
    bottom = top = 0
    for i in range(count):
        here = height(points, i, normal_x, normal_y)
        if here < least:
            least = here
            bottom = i
        if here > greatest:
            greatest = here
            top = i
    return bottom, top


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
def shear_and_add_segment(
    points: Points, count: int, shear: float, direction_x: float, direction_y: float, length: float, slack: float
) -> int:
    """Shear, then Minkowski sum with a centred segment, in place and in two passes.

    Parameters
    ----------
    points, count : polygon
        With room for two vertices more.
    shear : float
        y becomes y + shear x first.
    direction_x, direction_y : float
        Direction of the segment, of any length but zero.
    length, slack : float
        The segment reaches from -half to +half, half = direction (length + slack max |x|).

    Returns
    -------
    int
        Vertices of the sum: at most count + 2; 0 for the empty set.

    Notes
    -----
    O(count). The boundary is cut where it is extreme across the segment; the part to the right of the segment's
    direction moves by +half, the rest by -half. Cutting at extremes, not where edges change sign, keeps the result
    sound when rounding makes tiny edges turn the wrong way.
    """
    if count == 0:
        return 0
    least = np.inf
    greatest = -np.inf
    bottom_first = top_first = 0
    reach = 0.0
    for i in range(count):
        x = points[i, 0]
        points[i, 1] += shear * x
        reach = max(reach, abs(x))
        across = cross(direction_x, direction_y, x, points[i, 1])
        if across < least:
            least = across
            bottom_first = i
        if across > greatest:
            greatest = across
            top_first = i
    half_x = direction_x * (length + slack * reach)
    half_y = direction_y * (length + slack * reach)
    if half_x == 0.0 and half_y == 0.0:
        return count
    # An edge along the segment is extreme as a whole: it grows longer, and no vertex is added.
    bottom_last = bottom_first
    top_last = top_first
    if greatest > least:
        bottom_first, bottom_last = level_run(points, count, bottom_first, direction_x, direction_y, least)
        top_first, top_last = level_run(points, count, top_first, direction_x, direction_y, greatest)
    tall = max(abs(points[bottom_first, 1]), abs(points[top_first, 1]))
    forward = height(points, bottom_last, direction_x, direction_y) - height(
        points, bottom_first, direction_x, direction_y
    )
    backward = height(points, top_last, direction_x, direction_y) - height(points, top_first, direction_x, direction_y)
    scale = abs(direction_x) * tall + abs(direction_y) * reach
    if forward < 0.0 or backward > 0.0:
        scale = (abs(direction_x) + abs(direction_y)) * max(tall, reach)
    if greatest - least <= NEEDLE * scale:
        # A needle along the segment, as thin as rounding: which side is which cannot be told, only how far it goes.
        back, front = extremes(points, count, direction_x, direction_y)
        back_x, back_y = points[back, 0] - half_x, points[back, 1] - half_y
        put(points, 1, points[front, 0] + half_x, points[front, 1] + half_y)
        put(points, 0, back_x, back_y)
        return 2
    made = place = count + int(bottom_first == bottom_last) + int(top_first == top_last)
    if bottom_last < top_last:
        half_x, half_y = -half_x, -half_y
    for i in range(count - 1, -1, -1):
        place -= 1
        x, y = points[i, 0], points[i, 1]
        put(points, place, x + half_x, y + half_y)
        if i in (bottom_last, top_last):
            half_x, half_y = -half_x, -half_y
            if bottom_first == bottom_last if i == bottom_last else top_first == top_last:
                place -= 1
                put(points, place, x + half_x, y + half_y)
    return made


@inlined
def level_run(
    points: Points, count: int, start: int, direction_x: float, direction_y: float, level: float
) -> tuple[int, int]:
    """First and last of the consecutive vertices about `start` that lie exactly at its level across a direction."""
    first = last = start
    while True:
        before = first - 1 if first > 0 else count - 1
        if cross(direction_x, direction_y, points[before, 0], points[before, 1]) != level:
            break
        first = before
    while True:
        after = last + 1 if last + 1 < count else 0
        if cross(direction_x, direction_y, points[after, 0], points[after, 1]) != level:
            break
        last = after
    return first, last


@inlined
def put(out: Points, i: int, x: float, y: float) -> None:
    """Write a vertex."""
    out[i, 0] = x
    out[i, 1] = y


@compiled
def lowest_index(points: Points, count: int) -> int:
    """Index of the lowest vertex, the leftmost of equally low ones."""
    best = 0
    for i in range(1, count):
        if points[i, 1] < points[best, 1] or (points[i, 1] == points[best, 1] and points[i, 0] < points[best, 0]):
            best = i
    return best


@compiled
def hull(points: Points, count: int, out: Points) -> int:
    """Convex hull of points in any order, counter-clockwise, no vertex repeated; return its number of vertices.

    Parameters
    ----------
    points, count : points, in any order
    out : ndarray, shape (>= 2 count + 1, 2)

    Notes
    -----
    Sorting by insertion and Andrew's two chains: at most O(count^2), a handful of vertices.
    """
    ordered = points[:count].copy()
    for i in range(1, count):
        x, y = ordered[i, 0], ordered[i, 1]
        j = i
        while j > 0 and (ordered[j - 1, 0] > x or (ordered[j - 1, 0] == x and ordered[j - 1, 1] > y)):
            put(ordered, j, ordered[j - 1, 0], ordered[j - 1, 1])
            j -= 1
        put(ordered, j, x, y)
    made = 0
    for chain in range(2):
        kept = 1 if chain == 0 else made
        for k in range(count):
            i = k if chain == 0 else count - 1 - k
            if made > 0 and ordered[i, 0] == out[made - 1, 0] and ordered[i, 1] == out[made - 1, 1]:
                continue
            while made > max(kept, 1):
                edge_x = out[made - 1, 0] - out[made - 2, 0]
                edge_y = out[made - 1, 1] - out[made - 2, 1]
                if cross(edge_x, edge_y, ordered[i, 0] - out[made - 1, 0], ordered[i, 1] - out[made - 1, 1]) > 0.0:
                    break
                made -= 1
            put(out, made, ordered[i, 0], ordered[i, 1])
            made += 1
    return close(out, made)


@compiled
def add_polygon(points: Points, count: int, other: Points, other_count: int, out: Points) -> int:
    """Minkowski sum with another convex polygon, by merging their edges in order of direction.

    Parameters
    ----------
    points, count : polygon
    other, other_count : polygon
    out : ndarray, shape (>= count + other_count + 1, 2)
        The walk around the boundary ends by writing its first vertex again.

    Returns
    -------
    int
        Vertices of the sum: at most count + other_count; 0 if either is empty.

    Notes
    -----
    O(count + other_count), after a hull of either. A vertex of the sum is one addition of two: nothing accumulates.
    """
    if count == 0 or other_count == 0:
        return 0
    # A repeated vertex or an edge that rounding has turned would spoil the merge: hulls have none.
    first = np.empty((2 * count + 1, 2))
    second = np.empty((2 * other_count + 1, 2))
    count = hull(points, count, first)
    other_count = hull(other, other_count, second)
    points, other = first, second
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
