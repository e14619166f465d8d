"""Compiled operations on one convex polygon of the plane.

A polygon is an array `points` of shape (capacity, 2) whose first `count` rows are its vertices, counter-clockwise.
One vertex is a point and two are a segment: they are polygons like any other; none is the empty set.
Operations that may change the number of vertices write to `out`, which must not overlap `points`, and return the
new count. No tolerance is absolute: a cut or a sum is exact up to rounding of the coordinates, a few ulp.

Rounding leaves a polygon convex only up to a few ulp: a tiny edge may point anywhere, vertices may coincide, those of
a set as thin as rounding may come in any order. Every operation stands that.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from infoset._compile import compiled, inlined

Points = NDArray[np.float64]

# A difference of heights below this, relative to the products it is made of, may be rounding.
ROUNDING = 16.0 * float(np.finfo(np.float64).eps)


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
    """Copy a vertex to another place."""
    i, j = unsigned(source), unsigned(target)
    points[j, 0] = points[i, 0]
    points[j, 1] = points[i, 1]


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
    """Point of the edge i-j at a level of `normal . p`, counted from its nearer end: least rounding.

    Notes
    -----
    The same point, bit for bit, whichever way the edge is run: a cut segment stays a segment.
    """
    height_i = height(points, i, normal_x, normal_y)
    height_j = height(points, j, normal_x, normal_y)
    near, far, height_near, height_far = i, j, height_i, height_j
    farther = abs(level - height_i) - abs(level - height_j)
    if farther > 0.0 or (farther == 0.0 and height_i > height_j):
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
                move(points, i, i + step)
        elif step < 0:
            for i in range(last + 1, count):
                move(points, i, i + step)
        count = first + added + kept
    else:
        place = first - last - 1
        for i in range(place):
            move(points, i + last + 1, i)
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
    along_x, along_y = (xx, yx) if max(abs(xx), abs(yx)) > max(abs(xy), abs(yy)) else (xy, yy)
    scale = max(abs(along_x), abs(along_y))
    first = support_index(out, made, -along_x / scale, -along_y / scale)
    last = support_index(out, made, along_x / scale, along_y / scale)
    first_x, first_y, last_x, last_y = out[first, 0], out[first, 1], out[last, 0], out[last, 1]
    made = append(out, 0, first_x, first_y)
    return append(out, made, last_x, last_y)


@compiled
def scaled_determinant(xx: float, xy: float, yx: float, yy: float) -> float:
    """Determinant of a matrix divided by a power of two near its largest entry, lest it underflow or overflow."""
    exponent = math.frexp(max(abs(xx), abs(xy), abs(yx), abs(yy)))[1]
    return cross(
        math.ldexp(xx, -exponent), math.ldexp(yx, -exponent), math.ldexp(xy, -exponent), math.ldexp(yy, -exponent)
    )


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
def add_segment(points: Points, count: int, half_x: float, half_y: float) -> int:
    """Minkowski sum with the segment from -half to +half, in place and in two passes.

    Parameters
    ----------
    points, count : polygon
        With room for two vertices more.
    half_x, half_y : float
        Half of the segment.

    Returns
    -------
    int
        Vertices of the sum: at most count + 2; 0 for the empty set.

    Notes
    -----
    O(count). The boundary is cut where it is extreme across the segment; the part to the right of the segment's
    direction moves by +half, the rest by -half. Cutting at extremes, not where edges change sign, keeps the result
    sound when rounding makes tiny edges turn the wrong way. Where rounding could mistake an extreme - an edge along
    the segment, a set thin across it, a point - `add_segment_carefully` does the work.
    """
    if count == 0 or (half_x == 0.0 and half_y == 0.0):
        return count
    bottom, top = extremes(points, count, -half_y, half_x)
    if not (is_lowest(points, count, bottom, half_x, half_y) and is_lowest(points, count, top, -half_x, -half_y)):
        return add_segment_carefully(points, count, half_x, half_y)
    if bottom < top:
        half_x, half_y = -half_x, -half_y
    # Unsigned indices spare the check for negative ones, which costs as much as the rest of this loop.
    turns = unsigned(bottom), unsigned(top)
    place = unsigned(count + 2)
    for k in range(count):
        i = unsigned(count - 1 - k)
        x, y = points[i, 0], points[i, 1]
        place -= unsigned(1)
        put(points, place, x + half_x, y + half_y)
        if i in turns:
            half_x, half_y = -half_x, -half_y
            place -= unsigned(1)
            put(points, place, x + half_x, y + half_y)
    return count + 2


@inlined
def is_lowest(points: Points, count: int, i: int, x: float, y: float) -> bool:
    """Whether a vertex is lower across (x, y) than its neighbours by more than rounding."""
    before = i - 1 if i > 0 else count - 1
    after = i + 1 if i + 1 < count else 0
    height = cross(x, y, points[i, 0], points[i, 1])
    rise = min(cross(x, y, points[before, 0], points[before, 1]), cross(x, y, points[after, 0], points[after, 1]))
    reach_x = max(abs(points[i, 0]), abs(points[before, 0]), abs(points[after, 0]))
    reach_y = max(abs(points[i, 1]), abs(points[before, 1]), abs(points[after, 1]))
    return bool(rise - height > ROUNDING * (abs(x) * reach_y + abs(y) * reach_x))


@compiled
def add_segment_carefully(points: Points, count: int, half_x: float, half_y: float) -> int:
    """Minkowski sum, in place, of a segment and any set: with an edge along it, as thin as rounding, a point.

    Notes
    -----
    O(count). Heights are counted from a vertex, so that their rounding is relative to the set's own size. In a set
    longer along the segment than across it the hindmost and foremost vertices are certain, and the lowest is sought
    only from the one to the other, the highest only on the way back: taken on the wrong side, it would leave the
    foremost behind. In a set longer across the segment it is the lowest and highest that are certain.
    """
    source = points[:count].copy()
    scale = max(abs(half_x), abs(half_y))
    x = half_x / scale
    y = half_y / scale
    origin_x = points[0, 0]
    origin_y = points[0, 1]
    bottom = top = hind = fore = 0
    lowest = highest = least = greatest = 0.0
    for i in range(1, count):
        from_x = points[i, 0] - origin_x
        from_y = points[i, 1] - origin_y
        height = cross(x, y, from_x, from_y)
        along = x * from_x + y * from_y
        if height < lowest:
            lowest = height
            bottom = i
        if height > highest:
            highest = height
            top = i
        if along < least:
            least = along
            hind = i
        if along > greatest:
            greatest = along
            fore = i
    if greatest - least > highest - lowest:
        bottom_first, bottom_last = lowest_between(points, count, hind, fore, x, y)
        top_first, top_last = lowest_between(points, count, fore, hind, -x, -y)
    else:
        bottom_first, bottom_last = level_stretch(points, count, bottom, x, y)
        top_first, top_last = level_stretch(points, count, top, x, y)
    made = append_moved(source, count, bottom_last, top_first, half_x, half_y, points, 0)
    made = append_moved(source, count, top_last, bottom_first, -half_x, -half_y, points, made)
    return close(points, made)


@compiled
def lowest_between(points: Points, count: int, first: int, last: int, x: float, y: float) -> tuple[int, int]:
    """First and last of the vertices lowest across (x, y) from vertex first to vertex last, counter-clockwise."""
    lowest = 0.0
    lowest_first = lowest_last = first
    i = first
    while i != last:
        i = i + 1 if i + 1 < count else 0
        height = cross(x, y, points[i, 0] - points[first, 0], points[i, 1] - points[first, 1])
        if height < lowest:
            lowest = height
            lowest_first = lowest_last = i
        elif height == lowest:
            lowest_last = i
    return lowest_first, lowest_last


@compiled
def level_stretch(points: Points, count: int, i: int, x: float, y: float) -> tuple[int, int]:
    """First and last of the vertices around vertex i that are exactly as high as it across (x, y)."""
    first = last = i
    for _ in range(count - 1):
        before = first - 1 if first > 0 else count - 1
        if cross(x, y, points[before, 0] - points[i, 0], points[before, 1] - points[i, 1]) != 0.0:
            break
        first = before
    for _ in range(count - 1):
        after = last + 1 if last + 1 < count else 0
        if cross(x, y, points[after, 0] - points[i, 0], points[after, 1] - points[i, 1]) != 0.0:
            break
        last = after
    return first, last


@compiled
def append_moved(points: Points, count: int, first: int, last: int, x: float, y: float, out: Points, made: int) -> int:
    """Add the vertices from first to last, counter-clockwise, moved by (x, y); return the new count."""
    i = first
    while True:
        made = append(out, made, points[i, 0] + x, points[i, 1] + y)
        if i == last:
            return made
        i = i + 1 if i + 1 < count else 0


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
    """Convex hull of any points: counter-clockwise, without repeated vertices or vertices along an edge.

    Parameters
    ----------
    points, count : points, in any order
    out : ndarray, shape (>= count, 2)

    Returns
    -------
    int
        Vertices of the hull: 2 if the points lie on a line, 1 if they coincide, 0 if there are none.

    Notes
    -----
    Andrew's monotone chain: O(count) once the points are in order; putting them so takes O(count^2) at worst. A
    point is dropped where it sticks out by less than rounding. The directions of the edges increase strictly,
    rounding or not.

    References
    ----------
    A. M. Andrew, Another efficient algorithm for convex hulls in two dimensions, Inf. Process. Lett. 9 (1979).
    """
    points = points[:count].copy()
    sort_points(points, count)
    count = drop_repeats(points, count)
    made = 0
    for i in range(count):
        made = drop_turned(out, made, 1, points[i, 0], points[i, 1])
        made = append(out, made, points[i, 0], points[i, 1])
    lower = made
    known = lower - 2
    for i in range(count - 2, 0, -1):
        x = points[i, 0]
        y = points[i, 1]
        if known > 0 and out[known, 0] == x and out[known, 1] == y:
            known -= 1
            continue
        made = drop_turned(out, made, lower, x, y)
        made = append(out, made, x, y)
    if count > 0:
        made = drop_turned(out, made, lower, points[0, 0], points[0, 1])
    return made


@compiled
def sort_points(points: Points, count: int) -> None:
    """Order points by x, then by y, in place, by insertion: O(count) if they are nearly in order."""
    for i in range(1, count):
        x = points[i, 0]
        y = points[i, 1]
        j = i
        while j > 0 and (points[j - 1, 0] > x or (points[j - 1, 0] == x and points[j - 1, 1] > y)):
            points[j, 0] = points[j - 1, 0]
            points[j, 1] = points[j - 1, 1]
            j -= 1
        points[j, 0] = x
        points[j, 1] = y


@compiled
def drop_turned(out: Points, made: int, fewest: int, x: float, y: float) -> int:
    """Drop last vertices, down to `fewest`, at which the way to (x, y) does not turn left; return the new count."""
    while made > fewest:
        along_x = out[made - 1, 0] - out[made - 2, 0]
        along_y = out[made - 1, 1] - out[made - 2, 1]
        if cross(along_x, along_y, x - out[made - 1, 0], y - out[made - 1, 1]) > 0.0:
            break
        made -= 1
    return made


@compiled
def drop_repeats(points: Points, count: int) -> int:
    """Drop vertices that repeat the one before, in place; return the new count. O(count)."""
    made = 0
    for i in range(count):
        made = append(points, made, points[i, 0], points[i, 1])
    return close(points, made)


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
    O(count + other_count); more if rounding has turned an edge of either the wrong way, for then its hull is taken
    first: one tiny edge out of order would spoil the whole merge. Each vertex of the sum is one addition of two
    vertices: nothing accumulates.
    """
    if count == 0 or other_count == 0:
        return 0
    first, first_count = with_edges_in_order(points, count)
    second, second_count = with_edges_in_order(other, other_count)
    i = lowest_index(first, first_count)
    j = lowest_index(second, second_count)
    steps_i = first_count if first_count > 1 else 0
    steps_j = second_count if second_count > 1 else 0
    made = 0
    while True:
        made = append(out, made, first[i, 0] + second[j, 0], first[i, 1] + second[j, 1])
        next_i = i + 1 if i + 1 < first_count else 0
        next_j = j + 1 if j + 1 < second_count else 0
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
def with_edges_in_order(points: Points, count: int) -> tuple[Points, int]:
    """The polygon itself, or its hull where rounding has turned an edge the wrong way."""
    if edges_in_order(points, count):
        return points, count
    ordered = np.empty((count, 2))
    return ordered, hull(points, count, ordered)


@compiled
def edges_in_order(points: Points, count: int) -> bool:
    """Whether the edges' directions, from the lowest vertex on, go round once without turning back. O(count)."""
    if count == 1:
        return True
    i = lowest_index(points, count)
    from_x = 1.0
    from_y = 0.0
    for _ in range(count):
        after = i + 1 if i + 1 < count else 0
        edge_x = points[after, 0] - points[i, 0]
        edge_y = points[after, 1] - points[i, 1]
        if (edge_x == 0.0 and edge_y == 0.0) or direction_order(from_x, from_y, edge_x, edge_y) < 0:
            return False
        from_x = edge_x
        from_y = edge_y
        i = after
    return True


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


@inlined
def pass_edge(
    nearest: float, inside: bool, start: tuple[float, float], end: tuple[float, float], x: float, y: float
) -> tuple[float, bool]:
    """Square of the distance from (x, y) to the nearest edge so far, and whether it is inside so far, one edge on.

    Notes
    -----
    Only an edge whose line is nearer than what was found is looked at closely: dividing would be most of the work.
    """
    edge_x, edge_y = end[0] - start[0], end[1] - start[1]
    from_x, from_y = x - start[0], y - start[1]
    beside = cross(edge_x, edge_y, from_x, from_y)
    squared_length = edge_x * edge_x + edge_y * edge_y
    if not beside * beside > nearest * squared_length:
        along = from_x * edge_x + from_y * edge_y
        if along <= 0.0:
            squared = from_x * from_x + from_y * from_y
        elif along >= squared_length:
            squared = (x - end[0]) ** 2 + (y - end[1]) ** 2
        else:
            squared = beside * beside / squared_length
        nearest = min(nearest, squared)
    if (end[1] > y) != (start[1] > y) and (beside > 0.0) == (end[1] > start[1]):
        inside = not inside
    return nearest, inside


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
        start, end = (points[last, 0], points[last, 1]), (points[i, 0], points[i, 1])
        nearest, inside = pass_edge(nearest, inside, start, end, x, y)
        last = i
    return math.sqrt(nearest) if inside else -math.sqrt(nearest)


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
    The edge whose neighbours, extended until they meet, add least area goes first. O(count) an edge. Where rounding
    has turned an edge the wrong way the hull is taken first; a hull too thin for that becomes a rectangle.
    """
    is_hull = False
    while count > cap:
        chosen, x, y = cheapest_edge(points, count, 0, count - 1)
        if chosen >= 0:
            points[chosen, 0] = x
            points[chosen, 1] = y
            gone = chosen + 1 if chosen + 1 < count else 0
            for i in range(gone, count - 1):
                points[i, 0] = points[i + 1, 0]
                points[i, 1] = points[i + 1, 1]
            count -= 1
            is_hull = False
        elif is_hull:
            count = make_rectangle(points, count)
        else:
            count = hull(points, count, points)
            is_hull = True
    return count


@compiled
def cheapest_edge(points: Points, count: int, first: int, last: int) -> tuple[int, float, float]:
    """First vertex of the edge that costs least area to drop, and where its neighbours meet; -1 if not convex.

    Notes
    -----
    Only the edges whose first vertex is one of first .. last can go: all of them, or those inside a chain.
    """
    least = np.inf
    chosen = -1
    chosen_x = chosen_y = 0.0
    before = first - 1 if first > 0 else count - 1
    for i in range(first, last + 1):
        j = i + 1 if i + 1 < count else 0
        after = j + 1 if j + 1 < count else 0
        from_x = points[i, 0] - points[before, 0]
        from_y = points[i, 1] - points[before, 1]
        edge_x = points[j, 0] - points[i, 0]
        edge_y = points[j, 1] - points[i, 1]
        to_x = points[after, 0] - points[j, 0]
        to_y = points[after, 1] - points[j, 1]
        before = i
        bend = cross(from_x, from_y, edge_x, edge_y)
        if bend <= 0.0:
            return -1, 0.0, 0.0
        turn = cross(from_x, from_y, to_x, to_y)
        if turn <= ROUNDING * (abs(from_x * to_y) + abs(from_y * to_x)):
            continue
        reach = cross(edge_x, edge_y, to_x, to_y) / turn
        added = reach * bend
        x = points[i, 0] + reach * from_x
        y = points[i, 1] + reach * from_y
        # The new vertex must not fall short of the far end of the edge: at a sharp tip that would cut the tip off.
        if added < least and (points[j, 0] - x) * to_x + (points[j, 1] - y) * to_y >= 0.0:
            least = added
            chosen = i
            chosen_x = x
            chosen_y = y
    return chosen, chosen_x, chosen_y


@compiled
def make_rectangle(points: Points, count: int) -> int:
    """Replace a polygon by the rectangle around it along its longest direction from vertex 0, in place. O(count)."""
    origin_x = points[0, 0]
    origin_y = points[0, 1]
    length = 0.0
    x = 1.0
    y = 0.0
    for i in range(1, count):
        distance = math.hypot(points[i, 0] - origin_x, points[i, 1] - origin_y)
        if distance > length:
            length = distance
            x = (points[i, 0] - origin_x) / distance
            y = (points[i, 1] - origin_y) / distance
    least = greatest = lowest = highest = 0.0
    for i in range(1, count):
        from_x = points[i, 0] - origin_x
        from_y = points[i, 1] - origin_y
        along = x * from_x + y * from_y
        height = cross(x, y, from_x, from_y)
        least = min(least, along)
        greatest = max(greatest, along)
        lowest = min(lowest, height)
        highest = max(highest, height)
    made = 0
    for along, height in ((least, lowest), (greatest, lowest), (greatest, highest), (least, highest)):
        made = append(points, made, origin_x + along * x - height * y, origin_y + along * y + height * x)
    return close(points, made)
