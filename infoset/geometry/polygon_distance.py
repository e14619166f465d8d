"""Compiled nearest points of polygons, stored as in `polygon`, and largest discs in polygons."""

from __future__ import annotations

import math

import numpy as np

from infoset._compile import compiled
from infoset.geometry.polygon import MINIMUM, Points, farthest_pair
from infoset.geometry.polygon_exact import holds, tidy


@compiled
def nearest(points: Points, count: int, x: float, y: float) -> tuple[float, float, float]:
    """Return the nearest point (x, y) of a nonempty, strictly convex polygon, and its distance; 0
    only inside.

    O(count).
    """
    if holds(points, count, x, y):
        return x, y, 0.0
    minimum = np.inf
    best_x = x
    best_y = y
    j = count - 1
    for i in range(count):
        along_x = points[i, 0] - points[j, 0]
        along_y = points[i, 1] - points[j, 1]
        from_x = x - points[j, 0]
        from_y = y - points[j, 1]
        squared = along_x * along_x + along_y * along_y
        part = (
            min(1.0, max(0.0, (from_x * along_x + from_y * along_y) / squared))
            if squared > 0.0
            else 0.0
        )
        # From the nearer end, so that an end is met exactly.
        if part > 0.5:
            away = (x - points[i, 0]) * along_x + (y - points[i, 1]) * along_y
            part = min(0.0, away / squared)
            near_x = points[i, 0] + part * along_x
            near_y = points[i, 1] + part * along_y
        else:
            near_x = points[j, 0] + part * along_x
            near_y = points[j, 1] + part * along_y
        if max(abs(x - near_x), abs(y - near_y)) < minimum:
            distance = math.hypot(x - near_x, y - near_y)
            if distance < minimum:
                minimum = distance
                best_x = near_x
                best_y = near_y
        j = i
    return best_x, best_y, max(minimum, MINIMUM)


@compiled
def max_disc(points: Points, count: int) -> tuple[float, float, float]:
    """Return the centre (x, y) and the radius of a largest disc in a nonempty polygon. O(count^2).

    The sides move inward at the same speed, and a side whose length becomes zero is removed, until
    no area is left. The centre is the middle of the segment that remains.
    """
    a, n = tidy(points, count)
    a = a[:n].copy()
    origin_x = a[0, 0]
    origin_y = a[0, 1]
    normals = np.empty((n, 2))
    for i in range(n if n > 2 else 0):
        j = (i + 1) % n
        along_x = a[j, 0] - a[i, 0]
        along_y = a[j, 1] - a[i, 1]
        length = math.hypot(along_x, along_y)
        normals[i, 0], normals[i, 1] = -along_y / length, along_x / length
    a[:, 0] -= origin_x  # after the normals: a short side may vanish here
    a[:, 1] -= origin_y
    speed = np.empty((n, 2))
    radius = 0.0
    while n > 2:
        minimum, chosen, open_end = 1e300, -1, False
        for i in range(n):  # vertex i is between the sides i - 1 and i
            h = i - 1 if i > 0 else n - 1
            towards = 1.0 + normals[h, 0] * normals[i, 0] + normals[h, 1] * normals[i, 1]
            turn = normals[h, 0] * normals[i, 1] - normals[h, 1] * normals[i, 0]
            open_end |= turn <= 0.0
            # The tangent of half the turn, without cancellation for turns near half a revolution.
            # 1e-300 only avoids a division by zero: the polygon is then open, and not used.
            half = turn / towards if towards > 0.5 else (2.0 - towards) / max(turn, 1e-300)
            speed[i, 0] = normals[i, 0] + half * normals[i, 1]
            speed[i, 1] = normals[i, 1] - half * normals[i, 0]
        if open_end:
            break
        for i in range(n):
            j = (i + 1) % n
            along_x = normals[i, 1]
            along_y = -normals[i, 0]
            length = (a[j, 0] - a[i, 0]) * along_x + (a[j, 1] - a[i, 1]) * along_y
            closing = (speed[i, 0] - speed[j, 0]) * along_x + (speed[i, 1] - speed[j, 1]) * along_y
            if length < minimum * closing:
                minimum = max(0.0, length) / closing
                chosen = i
        if chosen < 0:
            break
        radius += minimum
        a[:n] += minimum * speed[:n]
        for i in range(chosen, n - 1):
            normals[i, 0], normals[i, 1] = normals[i + 1, 0], normals[i + 1, 1]
        for i in range(min(chosen + 1, n - 1), n - 1):
            a[i, 0], a[i, 1] = a[i + 1, 0], a[i + 1, 1]
        n -= 1
    _, first, last = farthest_pair(a, n)
    return (
        origin_x + 0.5 * (a[first, 0] + a[last, 0]),
        origin_y + 0.5 * (a[first, 1] + a[last, 1]),
        radius,
    )
