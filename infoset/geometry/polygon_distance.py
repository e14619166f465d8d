"""Compiled nearest points of polygons, stored as in `polygon`, and largest discs in polygons."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from infoset._compile import compiled, inlined
from infoset.geometry.polygon import (
    MINIMUM,
    Point,
    Points,
    farthest_pair,
    following,
    move,
    preceding,
    put,
    vertex,
)
from infoset.geometry.polygon_exact import holds, tidy

LONGEST_DURATION = 1e300
"""Start of the search for a minimum: in this time each side that becomes shorter vanishes."""
LEAST_TURN = 1e-300
"""Divisor in place of a turn of zero or less: the polygon is then open, and the result not used."""


class Nearest(NamedTuple):
    """A point of a polygon, and its distance."""

    x: float
    y: float
    distance: float


class Disc(NamedTuple):
    """The centre and the radius of a disc."""

    x: float
    y: float
    radius: float


@inlined
def nearest_on_edge(start: Point, end: Point, point: Point) -> Point:
    """Return the nearest point of an edge, computed from its nearer end: an end is met exactly."""
    along_x = end.x - start.x
    along_y = end.y - start.y
    squared = along_x * along_x + along_y * along_y
    if squared == 0.0:
        return start

    to_point = (point.x - start.x) * along_x + (point.y - start.y) * along_y
    share = min(1.0, max(0.0, to_point / squared))
    if share <= 0.5:
        return Point(start.x + share * along_x, start.y + share * along_y)

    to_point = (point.x - end.x) * along_x + (point.y - end.y) * along_y
    share = min(0.0, to_point / squared)
    return Point(end.x + share * along_x, end.y + share * along_y)


@compiled
def nearest(points: Points, count: int, point: Point) -> Nearest:
    """Return the nearest point of a nonempty, strictly convex polygon. O(count).

    The distance is 0 only for points inside or on the boundary.
    """
    if holds(points, count, point):
        return Nearest(point.x, point.y, 0.0)

    minimum = np.inf
    best = point
    start = vertex(points, count - 1)
    for i in range(count):
        end = vertex(points, i)
        near = nearest_on_edge(start, end, point)
        # The maximum is a lower bound of the distance, and much faster than `hypot`.
        if max(abs(point.x - near.x), abs(point.y - near.y)) < minimum:
            distance = math.hypot(point.x - near.x, point.y - near.y)
            if distance < minimum:
                minimum = distance
                best = near
        start = end
    return Nearest(best.x, best.y, max(minimum, MINIMUM))


@compiled
def max_disc(points: Points, count: int) -> Disc:
    """Return a largest disc in a nonempty polygon. O(count^2).

    The sides move inward at the same speed, and a side whose length becomes zero is removed, until
    no area is left. The centre is the middle of the segment that remains.
    """
    corners, n = tidy(points, count)
    corners = corners[:n].copy()
    normals = np.empty((n, 2))
    if n > 2:  # a segment and a point have no disc
        write_normals(corners, n, normals)

    # After the normals: a short side may vanish here.
    origin = vertex(corners, 0)
    corners[:, 0] -= origin.x
    corners[:, 1] -= origin.y

    speeds = np.empty((n, 2))
    radius = 0.0
    while n > 2:
        if not write_corner_speeds(normals, n, speeds):
            break
        vanishing, duration = first_to_vanish(corners, normals, speeds, n)
        if vanishing < 0:
            break

        radius += duration
        corners[:n] += duration * speeds[:n]
        # The ends of the side have met, and one of them goes: its second end, or of the last side,
        # whose second end is corner 0, its first end. So side i still begins at corner i.
        remove_row(normals, vanishing, n)
        remove_row(corners, min(vanishing + 1, n - 1), n)
        n -= 1

    ends = farthest_pair(corners, n)
    first = vertex(corners, ends.first)
    last = vertex(corners, ends.last)
    return Disc(
        origin.x + 0.5 * (first.x + last.x),
        origin.y + 0.5 * (first.y + last.y),
        radius,
    )


@compiled
def write_normals(corners: Points, n: int, normals: Points) -> None:
    """Write the inward unit normals of the sides; side i is from corner i to the next one."""
    for i in range(n):
        j = following(i, n)
        along_x = corners[j, 0] - corners[i, 0]
        along_y = corners[j, 1] - corners[i, 1]
        length = math.hypot(along_x, along_y)
        put(normals, i, -along_y / length, along_x / length)


@compiled
def write_corner_speeds(normals: Points, n: int, speeds: Points) -> bool:
    """Write the velocities of the corners if all sides move inward at the speed 1.

    Return whether the polygon is closed: each corner turns left by less than half a revolution.
    """
    is_closed = True
    for i in range(n):
        h = preceding(i, n)
        # `towards` is 1 + cos and `turn` is sin of the angle by which the corner turns.
        towards = 1.0 + normals[h, 0] * normals[i, 0] + normals[h, 1] * normals[i, 1]
        turn = normals[h, 0] * normals[i, 1] - normals[h, 1] * normals[i, 0]
        is_closed &= turn > 0.0
        # The tangent of half the turn, without cancellation for turns near half a revolution.
        half = turn / towards if towards > 0.5 else (2.0 - towards) / max(turn, LEAST_TURN)
        speeds[i, 0] = normals[i, 0] + half * normals[i, 1]
        speeds[i, 1] = normals[i, 1] - half * normals[i, 0]
    return is_closed


@compiled
def first_to_vanish(corners: Points, normals: Points, speeds: Points, n: int) -> tuple[int, float]:
    """Return the side whose length is zero first, or -1 if no side becomes shorter, and when."""
    duration = LONGEST_DURATION
    vanishing = -1
    for i in range(n):
        j = following(i, n)
        along_x = normals[i, 1]
        along_y = -normals[i, 0]
        length = (corners[j, 0] - corners[i, 0]) * along_x + (
            corners[j, 1] - corners[i, 1]
        ) * along_y
        closing = (speeds[i, 0] - speeds[j, 0]) * along_x + (speeds[i, 1] - speeds[j, 1]) * along_y
        # A product, not a quotient: a side that does not become shorter is never taken.
        if length < duration * closing:
            duration = max(0.0, length) / closing
            vanishing = i
    return vanishing, duration


@compiled
def remove_row(rows: Points, index: int, n: int) -> None:
    """Remove one of n rows, in place."""
    for i in range(index, n - 1):
        move(rows, i + 1, i)
