"""Compiled loops over batches of polygons.

A batch is the arrays `vertices`, shape (B, V, 2), and `counts`, shape (B,). Kernels that make
polygons write to `out` and `made`; kernels that measure write up to three numbers for each polygon
to `out`.
"""

from __future__ import annotations

import math

import numpy as np

from infoset._compile import compiled
from infoset.arrays import Floats, Integers
from infoset.geometry import (
    polygon,
    polygon_distance,
    polygon_exact,
    polygon_lines,
    polygon_reduction,
    polygon_sum,
)
from infoset.geometry.polygon import Point, Points, vertex
from infoset.geometry.tolerances import EPS

LEAST_LENGTH = 1e-300
"""Minimum divisor, a guard against zero. The vertices of a side are different, and of coordinates
above 1e-140 (see `polygon_exact`) no length is nearly as short."""


@compiled
def drop_repeats(vertices: Floats, counts: Integers) -> None:
    """Remove repeated vertices, also the last one of a closed ring, in place."""
    for i in range(counts.size):
        counts[i] = polygon_exact.drop_repeats(vertices[i], counts[i])


@compiled
def reflex_vertices(vertices: Floats, counts: Integers, reflex: Integers) -> None:
    """First vertex at which each ring is not convex, or -1."""
    for i in range(counts.size):
        reflex[i] = polygon_exact.reflex_vertex(vertices[i], counts[i])


@compiled
def hull(vertices: Floats, counts: Integers, out: Floats, made: Integers) -> None:
    """Convex hulls of points."""
    for i in range(counts.size):
        made[i] = polygon_exact.hull(vertices[i], counts[i], out[i])


@compiled
def cut(
    vertices: Floats,
    counts: Integers,
    out: Floats,
    made: Integers,
    normal: Floats,
    bounds: Floats,
    slack: float,
) -> None:
    """Cuts by bands with `bounds` of shape (B, 2), wider by `slack` ulp of the vertices' terms."""
    for i in range(counts.size):
        polygon.copy(vertices[i], counts[i], out[i])
        wider = 0.0
        if slack > 0.0:
            for j in range(counts[i]):
                terms = abs(normal[i, 0] * out[i, j, 0]) + abs(normal[i, 1] * out[i, j, 1])
                wider = max(wider, terms)
            wider *= slack * EPS
        made[i], _ = polygon.clip_to_band(
            out[i],
            counts[i],
            normal[i, 0],
            normal[i, 1],
            bounds[i, 0] - wider,
            bounds[i, 1] + wider,
        )


@compiled
def linear_map(
    vertices: Floats, counts: Integers, out: Floats, made: Integers, matrices: Floats
) -> None:
    """Image of polygon i under matrix i; `matrices` has the shape (B, 2, 2)."""
    for i in range(counts.size):
        m = matrices[i]
        made[i] = polygon.map_linearly(
            vertices[i], counts[i], m[0, 0], m[0, 1], m[1, 0], m[1, 1], out[i]
        )


@compiled
def invert(matrix: Floats, out: Floats) -> None:
    """Inverse matrices, shape (B, 2, 2). `out` is zero before, and stays so for a singular one."""
    origin = Point(0.0, 0.0)
    for i in range(len(matrix)):
        m = matrix[i]
        determinant = polygon_exact.orientation(origin, vertex(m, 0), vertex(m, 1))
        if determinant != 0.0:
            out[i, 0, 0] = m[1, 1] / determinant
            out[i, 0, 1] = -m[0, 1] / determinant
            out[i, 1, 0] = -m[1, 0] / determinant
            out[i, 1, 1] = m[0, 0] / determinant


@compiled
def range_meets(
    vertices: Floats, counts: Integers, out: Floats, matrix: Floats, offset: Floats
) -> None:
    """Whether {m p + o}, with singular matrices m, meets the polygons, decided exactly: 1 or 0.

    The range is the line through o along the longer column of m, or o itself if m is zero.
    """
    for i in range(counts.size):
        first = matrix[i, :, 0]
        second = matrix[i, :, 1]
        along = first if np.abs(first).max() >= np.abs(second).max() else second
        if along[0] == 0.0 and along[1] == 0.0:
            points, n = polygon_exact.tidy(vertices[i], counts[i])
            out[i, 0] = polygon_exact.holds(points, n, vertex(offset, i))
            continue

        is_left = False
        is_right = False
        for k in range(counts[i]):
            height = polygon_lines.height_over_line(along, offset[i], vertices[i, k])
            # A vertex on the line is on both sides.
            is_left |= height >= 0.0
            is_right |= height <= 0.0
        out[i, 0] = is_left and is_right


@compiled
def add_segments(
    vertices: Floats, counts: Integers, out: Floats, made: Integers, halves: Floats
) -> None:
    """Minkowski sums with g segments from -half to +half for each polygon: halves (B, g, 2)."""
    for i in range(counts.size):
        polygon.copy(vertices[i], counts[i], out[i])
        made[i] = counts[i]
        for half in halves[i]:
            made[i] = polygon_sum.add_segment(out[i], made[i], half[0], half[1])


@compiled
def add_polygon(
    vertices: Floats,
    counts: Integers,
    out: Floats,
    made: Integers,
    other: Floats,
    other_counts: Integers,
) -> None:
    """Minkowski sums."""
    for i in range(counts.size):
        made[i] = polygon_sum.add_polygon(vertices[i], counts[i], other[i], other_counts[i], out[i])


@compiled
def difference(
    vertices: Floats,
    counts: Integers,
    out: Floats,
    made: Integers,
    other: Floats,
    other_counts: Integers,
) -> None:
    """Minkowski differences; the other polygons are not empty."""
    for i in range(counts.size):
        if counts[i] > 0:
            made[i] = polygon_lines.difference(
                vertices[i], counts[i], other[i], other_counts[i], out[i]
            )


@compiled
def intersect(
    vertices: Floats,
    counts: Integers,
    out: Floats,
    made: Integers,
    other: Floats,
    other_counts: Integers,
) -> None:
    """Intersections."""
    for i in range(counts.size):
        made[i] = polygon_exact.intersect(vertices[i], counts[i], other[i], other_counts[i], out[i])


@compiled
def intersect_lines(
    vertices: Floats, counts: Integers, out: Floats, made: Integers, lines: Floats
) -> None:
    """Intersections of k half-planes, shape (B, k, 3, 1); the polygons give only their number.

    The number of vertices of an unbounded set is -1 (`polygon_lines.UNBOUNDED`).
    """
    for i in range(counts.size):
        made[i] = polygon_lines.intersect_lines(lines[i], out[i])


@compiled
def reduce_outward(
    vertices: Floats, counts: Integers, out: Floats, made: Integers, cap: int
) -> None:
    """Outer polygons of few vertices."""
    for i in range(counts.size):
        polygon.copy(vertices[i], counts[i], out[i])
        made[i] = polygon_reduction.reduce_outward(out[i], counts[i], cap)


@compiled
def constraints(vertices: Floats, counts: Integers, normals: Floats, offsets: Floats) -> None:
    """Half-planes with unit normals, shape (B, k, 2).

    There is one for each side, four for a segment and a point; an empty set is 0 p <= -1.
    """
    for i in range(counts.size):
        points, n = polygon_exact.tidy(vertices[i], counts[i])
        if n == 0:
            offsets[i, 0] = -1.0
            continue
        for j in range(n if n > 2 else 4):
            normal = outward_normal(points, n, j)
            normals[i, j, 0] = normal.x
            normals[i, j, 1] = normal.y
            at = polygon.support_index(points, n, normal.x, normal.y)
            offsets[i, j] = polygon.height(points, at, normal.x, normal.y)


@compiled
def outward_normal(points: Points, n: int, j: int) -> Point:
    """Return the unit normal of side j; a segment and a point have four, across each other."""
    if n > 2:
        along = unit_vector(vertex(points, j), vertex(points, polygon.following(j, n)))
        return Point(along.y, -along.x)

    x, y = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[j]
    if n == 1:
        return Point(x, y)
    # The same four directions, turned so that the second one is along the segment.
    along = unit_vector(vertex(points, 0), vertex(points, 1))
    return Point(x * along.y + y * along.x, y * along.y - x * along.x)


@compiled
def unit_vector(start: Point, end: Point) -> Point:
    """Return the unit vector from one point to another."""
    x = end.x - start.x
    y = end.y - start.y
    length = max(math.hypot(x, y), LEAST_LENGTH)
    return Point(x / length, y / length)


@compiled
def excess(
    vertices: Floats, counts: Integers, out: Floats, other: Floats, other_counts: Integers
) -> None:
    """Maximum distances of a vertex from the other polygons, 0 only for subsets.

    They are 0 for an empty set, also in another one, and inf for other sets if the other polygon is
    empty. `out` is zero before.
    """
    for i in range(counts.size):
        points, count = polygon_exact.tidy(other[i], other_counts[i])
        for k in range(counts[i]):
            away = np.inf
            if count > 0:
                away = polygon_distance.nearest(points, count, vertex(vertices[i], k)).distance
            out[i, 0] = max(out[i, 0], away)


@compiled
def gap(
    vertices: Floats, counts: Integers, out: Floats, other: Floats, other_counts: Integers
) -> None:
    """Distances between polygons: 0 only if they intersect, infinite if one is empty.

    `out` is zero before.
    """
    common = np.empty((vertices.shape[1] + other.shape[1], 2))
    for i in range(counts.size):
        if polygon_exact.intersect(vertices[i], counts[i], other[i], other_counts[i], common) > 0:
            continue

        # Polygons apart are nearest at a vertex of one of them.
        out[i, 0] = np.inf
        if counts[i] > 0 and other_counts[i] > 0:
            a, n = polygon_exact.tidy(vertices[i], counts[i])
            b, m = polygon_exact.tidy(other[i], other_counts[i])
            for j in range(n):
                away = polygon_distance.nearest(b, m, vertex(a, j)).distance
                out[i, 0] = min(out[i, 0], away)
            for j in range(m):
                away = polygon_distance.nearest(a, n, vertex(b, j)).distance
                out[i, 0] = min(out[i, 0], away)


@compiled
def nearest(vertices: Floats, counts: Integers, out: Floats, point: Floats) -> None:
    """Write nearest points (x, y) of polygons and their distances in the columns of `out`.

    The distance from the empty set is inf, without a nearest point.
    """
    for i in range(counts.size):
        out[i, 2] = np.inf
        if counts[i] > 0:
            points, count = polygon_exact.tidy(vertices[i], counts[i])
            near = polygon_distance.nearest(points, count, vertex(point, i))
            out[i, 0] = near.x
            out[i, 1] = near.y
            out[i, 2] = near.distance


@compiled
def support(vertices: Floats, counts: Integers, out: Floats, direction: Floats) -> None:
    """Support functions, column 0 of `out`, and support vectors (x, y), columns 1 and 2."""
    for i in range(counts.size):
        if counts[i] == 0:
            out[i, 0] = -np.inf
            continue
        x, y = direction[i]
        at = polygon.support_index(vertices[i], counts[i], x, y)
        out[i, 1] = vertices[i, at, 0]
        out[i, 2] = vertices[i, at, 1]
        out[i, 0] = x * out[i, 1] + y * out[i, 2]


@compiled
def margin(vertices: Floats, counts: Integers, out: Floats, point: Floats) -> None:
    """Signed distances of points from the boundaries, column 0 of `out`."""
    for i in range(counts.size):
        out[i, 0] = polygon.margin(vertices[i], counts[i], point[i, 0], point[i, 1])


@compiled
def moments(vertices: Floats, counts: Integers, out: Floats) -> None:
    """Areas and centroids, as columns (area, x, y). `out` is zero before."""
    for i in range(counts.size):
        if counts[i] > 0:
            found = polygon.moments(vertices[i], counts[i])
            out[i, 0] = found.area
            out[i, 1] = found.x
            out[i, 2] = found.y


@compiled
def diameter(vertices: Floats, counts: Integers, out: Floats) -> None:
    """Maximum distances between two vertices, column 0 of `out`."""
    for i in range(counts.size):
        out[i, 0] = polygon.farthest_pair(vertices[i], counts[i]).distance


@compiled
def max_disc(vertices: Floats, counts: Integers, out: Floats) -> None:
    """Centres and radii of largest discs, as columns (x, y, radius)."""
    for i in range(counts.size):
        if counts[i] > 0:
            disc = polygon_distance.max_disc(vertices[i], counts[i])
            out[i, 0] = disc.x
            out[i, 1] = disc.y
            out[i, 2] = disc.radius


@compiled
def sample(vertices: Floats, counts: Integers, uniform: Floats, out: Floats) -> None:
    """Points distributed uniformly, from uniform numbers of shape (B, k, 3)."""
    for i in range(counts.size):
        n = counts[i]
        points = vertices[i]
        if n == 0:
            continue

        # `fan_area` is twice the area of a triangle, too.
        area = 2.0 * polygon.moments(points, n).area
        for j in range(uniform.shape[1]):
            # The first number chooses a triangle of the fan from vertex 0, with k and k + 1.
            rest = uniform[i, j, 0] * area
            k = 1
            while k < n - 2 and rest > polygon.fan_area(points, k):
                rest -= polygon.fan_area(points, k)
                k += 1

            # The others are shares of its two sides; a parallelogram is folded to the triangle.
            one = uniform[i, j, 1]
            two = uniform[i, j, 2]
            if one + two > 1.0 and n > 2:
                one = 1.0 - one
                two = 1.0 - two
            for axis in range(2):
                start = points[0, axis]
                value = start
                if n > 1:
                    value += one * (points[k, axis] - start)
                if n > 2:
                    value += two * (points[k + 1, axis] - start)
                out[i, j, axis] = value
