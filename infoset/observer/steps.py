"""Compiled steps of a `LinearObserver` with two states, for a batch of polygons.

Every step is outward by a few ulp: the computed set contains the exact one, and a true state that
is computed with floating-point numbers from errors at their bounds.

Kernels write their results to a batch `out` of the same size, with room for more vertices.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from infoset._compile import compiled, inlined
from infoset.arrays import Floats, Integers
from infoset.engine.section_life import CUT_SLACK, SUM_SLACK
from infoset.geometry import polygon, polygon_exact, polygon_reduction, polygon_sum
from infoset.geometry.polygon import Points

MAX_VERTICES = 512
"""Number of vertices to which a polygon with more is reduced outward in a step, so that the time of
a step is bounded; the enlargement after it and cuts add some. Chosen: twice the maximum of a
section of an engagement.
"""
_SHARP = 2.0
"""Slope of the edges at a vertex that is extreme along an axis, relative to the other axis, in
units of the box, above which the vertex is divided into two. Undivided it would move by more than
1 + 2 * 2 = 5 half-widths of the box along the axis (`move_along_axis`). Chosen.
"""
_SHARP_CORNER = 0.5
"""The same slope at a vertex that is extreme along two axes: undivided it would move by more than
(1 + 0.5) / (1 - 0.5) = 3 half-widths along each axis (`move_along_corner`). Chosen.
"""


class Batch(NamedTuple):
    """B polygons: their vertices, shape (B, room, 2), and the numbers of vertices, shape (B,)."""

    vertices: Floats
    counts: Integers


class Move(NamedTuple):
    """A step matrix x + shift + w, with w in the sum of segments and a polygon.

    `shifts`, and the sums `terms` of the sizes of their terms, have the shape (B, 2) or (1, 2).
    `generators`, shape (g, 2), are half segments; the polygon `other`, shape (m, 2), may have no
    vertices.
    """

    matrix: Floats
    shifts: Floats
    terms: Floats
    generators: Floats
    other: Floats


class Strips(NamedTuple):
    """The sets {x: lower <= normal . x <= upper} of a batch of runs.

    `normals`, shape (r, n), have any length; a zero one bounds nothing. `lower` and `upper`, shape
    (B, r), are infinite for a strip that does not exist in this run. `terms`, shape (B, r), are the
    sums of the sizes of the terms of the bounds, which determine rounding errors.
    """

    normals: Floats
    lower: Floats
    upper: Floats
    terms: Floats


@inlined
def reach(points: Points, count: int) -> tuple[float, float]:
    """Maximum sizes of both coordinates of the vertices; zero without vertices."""
    x = y = 0.0
    for i in range(count):
        x = max(x, abs(points[i, 0]))
        y = max(y, abs(points[i, 1]))
    return x, y


@compiled
def predict_all(sets: Batch, move: Move, out: Batch) -> None:
    """Write each polygon after a step, enlarged by the rounding of the step.

    The half-widths of this enlargement are `SUM_SLACK` times the terms of a coordinate. A result
    has at most 2 g + m + 4 vertices more.
    """
    matrix = move.matrix
    xx = matrix[0, 0]
    xy = matrix[0, 1]
    yx = matrix[1, 0]
    yy = matrix[1, 1]
    determinant = polygon.scaled_determinant(xx, xy, yx, yy)
    added_x, added_y = reach_of_sum(move.generators, move.other)

    scratch = np.empty_like(out.vertices[0])
    second = np.empty_like(out.vertices[0])
    for b in range(sets.counts.size):
        count = sets.counts[b]
        out.counts[b] = 0
        if count == 0:
            continue

        points = sets.vertices[b]
        row = b if len(move.shifts) > 1 else 0
        shift_x = move.shifts[row, 0]
        shift_y = move.shifts[row, 1]
        x, y = reach(points, count)
        slack_x = SUM_SLACK * (abs(xx) * x + abs(xy) * y + move.terms[row, 0] + added_x)
        slack_y = SUM_SLACK * (abs(yx) * x + abs(yy) * y + move.terms[row, 1] + added_y)

        if determinant > 0.0:
            map_vertices(points, count, matrix, scratch)
        else:
            # The order of the vertices changes, or the image is a segment.
            count = polygon.map_linearly(points, count, xx, xy, yx, yy, scratch)
        count = add_disturbance(scratch, count, move.generators, move.other, second)
        if count > MAX_VERTICES:
            count = polygon_reduction.reduce_outward(scratch, count, MAX_VERTICES)
        out.counts[b] = enlarge(scratch, count, shift_x, shift_y, slack_x, slack_y, out.vertices[b])


@inlined
def reach_of_sum(generators: Floats, other: Floats) -> tuple[float, float]:
    """Maximum sizes of both coordinates of the sum of segments and a polygon."""
    x = y = 0.0
    for g in range(len(generators)):
        x += abs(generators[g, 0])
        y += abs(generators[g, 1])
    other_x, other_y = reach(other, len(other))
    return x + other_x, y + other_y


@inlined
def map_vertices(points: Points, count: int, matrix: Floats, out: Points) -> None:
    """Write the images of the vertices under a matrix with a positive determinant."""
    for i in range(count):
        x = points[i, 0]
        y = points[i, 1]
        out[i, 0] = matrix[0, 0] * x + matrix[0, 1] * y
        out[i, 1] = matrix[1, 0] * x + matrix[1, 1] * y


@inlined
def add_disturbance(
    points: Points, count: int, generators: Floats, other: Floats, scratch: Points
) -> int:
    """Add segments and a polygon to a polygon, in place; return the number of vertices."""
    if len(other) > 0:
        polygon.copy(points, count, scratch)
        count = polygon_sum.add_polygon(scratch, count, other, len(other), points)
    for g in range(len(generators)):
        count = polygon_sum.add_segment(points, count, generators[g, 0], generators[g, 1])
    return count


@inlined
def corner(part: int) -> tuple[float, float]:
    """Signs of the corner of a box that belongs to a part of the boundary.

    Part 0 is before the lowest vertex, and parts follow counter-clockwise.
    """
    # The part modulo 4, of negative ones too.
    k = part & 3
    return (1.0 if 0 < k < 3 else -1.0), (1.0 if k >= 2 else -1.0)


@compiled
def enlarge(
    points: Points,
    count: int,
    shift_x: float,
    shift_y: float,
    half_x: float,
    half_y: float,
    out: Points,
) -> int:
    """Write a polygon, not empty, that is moved by a shift and contains the sum with a small box.

    Half the widths of the box are (half_x, half_y). Return the number of vertices: the result has
    `count` vertices for most sets, at most count + 4. O(count).

    The lowest, rightmost, highest and leftmost vertices divide the boundary into four parts, and
    each part moves by one corner of the box. A dividing vertex moves so that both of its edges move
    far enough, by at most five half-widths; at a sharp tip it becomes one vertex for each part that
    meets there, two to four. The division at extremes is correct for edges of a few ulp with a
    wrong direction.
    """
    # `ends[k]` is the vertex between the parts k and k + 1, of k modulo 4. If the lowest vertex is
    # extreme along other axes too, the boundary begins with a part before 0.
    ends = extremes(points, count)
    low = ends[0]
    part = 0
    while part > -3 and ends[(part - 1) & 3] == low:
        part -= 1
    last_part = part + 4

    made = 0
    i = low
    for _ in range(count):
        x = points[i, 0] + shift_x
        y = points[i, 1] + shift_y
        after = part
        while after < last_part and ends[after & 3] == i:
            after += 1

        move_x, move_y = corner(part)
        if after > part:
            move_x, move_y = tip_move(points, count, i, part, after, half_x, half_y)
        if move_x != 0.0 or move_y != 0.0:
            polygon.put(out, made, x + move_x * half_x, y + move_y * half_y)
            made += 1
        else:
            for k in range(part, min(after, part + 3) + 1):
                along_x, along_y = corner(k)
                polygon.put(out, made, x + along_x * half_x, y + along_y * half_y)
                made += 1
        part = after
        i = i + 1 if i + 1 < count else 0

    # The extremes are not in counter-clockwise order.
    if part != last_part:
        return enlarge_carefully(points, count, shift_x, shift_y, half_x, half_y, out)
    return polygon.close(out, made)


@inlined
def extremes(points: Points, count: int) -> tuple[int, int, int, int]:
    """Numbers of the lowest, rightmost, highest and leftmost vertices; of equal ones the first."""
    low = right = high = left = 0
    for i in range(1, count):
        x = points[i, 0]
        y = points[i, 1]
        low = i if y < points[low, 1] else low
        right = i if x > points[right, 0] else right
        high = i if y > points[high, 1] else high
        left = i if x < points[left, 0] else left
    return low, right, high, left


@inlined
def tip_move(
    points: Points, count: int, i: int, part: int, after: int, half_x: float, half_y: float
) -> tuple[float, float]:
    """Move of vertex i, in units of half the widths of the box; zero if it must be divided.

    The edge to the vertex belongs to the part `part` of the boundary and the edge from it to
    `after`: the vertex is extreme along after - part axes, which may be one or two. A vertex that
    is extreme along three axes is a sharp tip.
    """
    if after - part > 2:
        return 0.0, 0.0

    # Outward normals of the edges to the vertex and from it, in units of the box.
    before = i - 1 if i > 0 else count - 1
    behind = i + 1 if i + 1 < count else 0
    in_x = (points[i, 1] - points[before, 1]) * half_x
    in_y = (points[before, 0] - points[i, 0]) * half_y
    out_x = (points[behind, 1] - points[i, 1]) * half_x
    out_y = (points[i, 0] - points[behind, 0]) * half_y

    # The axis u of the first division, and the next axis v counter-clockwise.
    first_x, first_y = corner(part)
    next_x, next_y = corner(part + 1)
    u_x = 0.5 * (first_x + next_x)
    u_y = 0.5 * (first_y + next_y)
    v_x = -u_y
    v_y = u_x
    in_u = in_x * u_x + in_y * u_y
    in_v = in_x * v_x + in_y * v_y
    out_u = out_x * u_x + out_y * u_y
    out_v = out_x * v_x + out_y * v_y

    if after - part == 1:
        far, side = move_along_axis(in_u, -in_v, out_u, out_v)
        return far * u_x + side * v_x, far * u_y + side * v_y
    far = move_along_corner(in_u, -in_v, out_v, -out_u)
    return far * (u_x + v_x), far * (u_y + v_y)


@inlined
def move_along_axis(a: float, b: float, c: float, d: float) -> tuple[float, float]:
    """Move of a vertex that is extreme along an axis u, along u and along v.

    The edge to the vertex has the normal a u - b v, the edge from it the normal c u + d v. A move
    by f u + s v must be at least a + b along the first normal and c + d along the second one, the
    supports of the box: s = -1 makes the second one an equality with f = 1 + 2 d / c. The move is
    zero if the vertex is sharp, or if one of a to d is negative, which is rounding.
    """
    if min(a, b) < 0.0 or min(c, d) < 0.0:
        return 0.0, 0.0
    if d * a <= b * c and d <= _SHARP * c and c > 0.0:
        return 1.0 + 2.0 * (d / c), -1.0
    if b <= _SHARP * a and a > 0.0:
        return 1.0 + 2.0 * (b / a), 1.0
    return 0.0, 0.0


@inlined
def move_along_corner(a: float, b: float, c: float, d: float) -> float:
    """Move of a vertex that is extreme along two axes u and v, along both; zero if it is sharp.

    The edge to the vertex has the normal a u - b v, the edge from it the normal c v - d u.
    """
    if min(a, b) < 0.0 or min(c, d) < 0.0:
        return 0.0
    if b > _SHARP_CORNER * a or d > _SHARP_CORNER * c or a == 0.0 or c == 0.0:
        return 0.0
    return max((a + b) / (a - b), (c + d) / (c - d))


@compiled
def enlarge_carefully(
    points: Points,
    count: int,
    shift_x: float,
    shift_y: float,
    half_x: float,
    half_y: float,
    out: Points,
) -> int:
    """Write the result of `enlarge` for a set as thin as rounding: the hull of all corners.

    The vertices of such a set may be in a wrong order.
    """
    corners = np.empty((4 * count, 2))
    for i in range(count):
        for k in range(4):
            along_x, along_y = corner(k)
            corners[4 * i + k, 0] = points[i, 0] + shift_x + along_x * half_x
            corners[4 * i + k, 1] = points[i, 1] + shift_y + along_y * half_y

    hull = np.empty((4 * count, 2))
    made = polygon_exact.hull(corners, 4 * count, hull)
    if made > count + 4:
        made = polygon_reduction.reduce_outward(hull, made, count + 4)
    polygon.copy(hull, made, out)
    return made


@compiled
def update_all(sets: Batch, strips: Strips, excess: Floats, out: Batch) -> None:
    """Write the part of each polygon that is within strips: at most 2 r vertices more.

    The bounds are enlarged by `CUT_SLACK` times their terms and the terms of normal . x. `excess`,
    shape (B, r), receives the distance between set and strip, in the unit of the bounds, where the
    set becomes empty; its other elements are unchanged.
    """
    normals = strips.normals
    for b in range(sets.counts.size):
        count = sets.counts[b]
        points = out.vertices[b]
        polygon.copy(sets.vertices[b], count, points)
        x, y = reach(points, count)
        for r in range(len(normals)):
            if count == 0:
                break
            normal_x = normals[r, 0]
            normal_y = normals[r, 1]
            more = CUT_SLACK * (abs(normal_x) * x + abs(normal_y) * y + strips.terms[b, r])
            minimum = strips.lower[b, r] - more
            maximum = strips.upper[b, r] + more

            # The height of all points along a zero normal is 0.
            if normal_x == 0.0 and normal_y == 0.0:
                overlap = min(maximum, -minimum)
                count = count if overlap >= 0.0 else 0
            else:
                count, overlap = polygon.clip_to_band(
                    points, count, normal_x, normal_y, minimum, maximum
                )
            if count == 0:
                excess[b, r] = -overlap
        out.counts[b] = count


@compiled
def cut_to_preimage(sets: Batch, later: Batch, matrix: Floats, out: Batch) -> None:
    """Write the points x of each polygon for which matrix x is in the polygon of `later`.

    That is the polygon with the same index. The result has at most four vertices more than the two
    polygons together. The half-planes of the later polygon are enlarged by `CUT_SLACK` times the
    sizes of the products whose sum is a height. The level of each one is the maximum height of all
    vertices, so that the half-plane of an edge of a few ulp with a wrong direction contains the
    set. Half-planes along the axes bound the set at sharp tips, which such edges leave open.
    """
    for b in range(sets.counts.size):
        out.counts[b] = 0
        count = sets.counts[b]
        sides = later.counts[b]
        if count == 0 or sides == 0:
            continue

        points = out.vertices[b]
        other = later.vertices[b]
        polygon.copy(sets.vertices[b], count, points)
        x, y = reach(points, count)
        other_x, other_y = reach(other, sides)
        terms_x = max(other_x, abs(matrix[0, 0]) * x + abs(matrix[0, 1]) * y)
        terms_y = max(other_y, abs(matrix[1, 0]) * x + abs(matrix[1, 1]) * y)
        # Sides -4 to -1 of `normal_of_side` are the four directions along the axes.
        for i in range(-4, sides):
            normal_x, normal_y = normal_of_side(other, sides, i)
            top = polygon.support_index(other, sides, normal_x, normal_y)
            level = polygon.height(other, top, normal_x, normal_y)
            level += CUT_SLACK * (abs(normal_x) * terms_x + abs(normal_y) * terms_y)

            # normal . (matrix x) is the height of x along this vector; 0 for all x if it is zero.
            mapped_x = matrix[0, 0] * normal_x + matrix[1, 0] * normal_y
            mapped_y = matrix[0, 1] * normal_x + matrix[1, 1] * normal_y
            if mapped_x == 0.0 and mapped_y == 0.0:
                count = count if level >= 0.0 else 0
            else:
                count, _ = polygon.clip_to_band(points, count, mapped_x, mapped_y, -np.inf, level)
            if count == 0:
                break
        out.counts[b] = count


@inlined
def normal_of_side(points: Points, count: int, i: int) -> tuple[float, float]:
    """Outward normal of side i of a counter-clockwise polygon, as long as the side; for i from -4
    to -1, a direction along an axis.
    """
    if i == -4:
        return 0.0, -1.0
    if i == -3:
        return 0.0, 1.0
    if i == -2:
        return -1.0, 0.0
    if i == -1:
        return 1.0, 0.0
    j = i + 1 if i + 1 < count else 0
    return points[j, 1] - points[i, 1], points[i, 0] - points[j, 0]


@compiled
def support_all(sets: Batch, direction: Floats) -> Floats:
    """Return the maximum height of each polygon along a direction; -inf for the empty set."""
    heights = np.full(sets.counts.size, -np.inf)
    for b in range(sets.counts.size):
        count = sets.counts[b]
        if count > 0:
            top = polygon.support_index(sets.vertices[b], count, direction[0], direction[1])
            heights[b] = polygon.height(sets.vertices[b], top, direction[0], direction[1])
    return heights
