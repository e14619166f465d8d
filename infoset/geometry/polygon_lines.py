"""Compiled intersections of half-planes, decided exactly.

A line is (a, b, c), for the half-plane a x + b y <= c. Each coefficient is the sum of L numbers
without rounding: `lines` has the shape (k, 3, L), and `values`, shape (k, 3), are the sums rounded.
"""

from __future__ import annotations

import math

import numpy as np

from infoset._compile import compiled, inlined
from infoset.arrays import Flags, Floats, Integers
from infoset.geometry.double_words import two_product, two_sum
from infoset.geometry.polygon import Point, Points, following, preceding, put, vertex
from infoset.geometry.polygon_exact import exact_sum, hull, tidy

FAR = 1e70
"""Half-width of a box around all sets: a set that reaches it counts as unbounded.

It is far above 1e60, the maximum of all numbers, and products of three numbers stay finite.
"""
BOX_SIDES = 4
"""Number of sides of a box along the axes.

They are the first lines of an intersection (the box `FAR`) and the first rows of a difference (the
bounding box).
"""
UNBOUNDED = -1
"""Number of vertices of an unbounded set."""
LONGEST = 16
"""Maximum number of terms of a coefficient of a side of a difference.

An offset is two products of sums of two numbers, and a product of two numbers has two terms: 16 in
all.
"""
DETERMINANT_ROUNDING = 1e-14
"""Share of the products in a determinant from which its sign is certain.

Each of three factors and five operations errs by a few units of rounding, 1.1e-16: in all by less
than a third of this.
"""
HEIGHT_ROUNDING = 2e-15
"""Share of two products from which the sign of the difference of two heights is certain.

The coefficient, the difference of coordinates and the product are rounded by 1.1e-16 each, and the
sum once: in all less than a quarter of this.
"""


@inlined
def add_products(one: Floats, two: Floats, sign: float, sums: Floats, made: int) -> int:
    """Append the terms of the product of two sums, with the rounding errors; return the count.

    `sums` needs room for two more terms for each pair.
    """
    for a in one:
        for b in two:
            if a != 0.0 and b != 0.0:
                sums[made], sums[made + 1] = two_product(sign * a, b)
                made += 2
    return made


@compiled
def minor_terms(one: Floats, two: Floats, i: int, j: int) -> Floats:
    """Return one[i] two[j] - one[j] two[i] of two lines as numbers whose sum is exact."""
    # Two products of sums, and two terms for each product of two numbers.
    sums = np.empty(4 * one.shape[1] * two.shape[1])
    made = add_products(one[i], two[j], 1.0, sums, 0)
    made = add_products(one[j], two[i], -1.0, sums, made)
    # The terms no longer overlap: many are zero, and take no further product.
    exact_sum(sums[:made])
    return sums[:made]


@compiled
def height_over_line(along: Floats, start: Floats, point: Floats) -> float:
    """Return the cross product of `along` and point - start, shape (2,) each; its sign is exact."""
    sums = np.empty(8)  # four products of two terms each
    made = add_products(along[:1], point[1:], 1.0, sums, 0)
    made = add_products(along[:1], start[1:], -1.0, sums, made)
    made = add_products(along[1:], point[:1], -1.0, sums, made)
    made = add_products(along[1:], start[:1], 1.0, sums, made)
    return exact_sum(sums[:made])


@compiled
def beyond(values: Floats, lines: Floats, i: int, j: int, k: int) -> float:
    """Return a number that is positive if the point where lines i and j meet violates line k.

    Its sign is exact. The lines meet at (x / w, y / w) with x = c_i b_j - b_i c_j,
    y = a_i c_j - c_i a_j and w = a_i b_j - b_i a_j, so that the number is a_k x + b_k y - c_k w:
    the directions of the lines i and j must turn left by less than half a turn, that is, w > 0.
    """
    one = values[i]
    two = values[j]
    row = values[k]
    total = 0.0
    size = 0.0
    for m in range(3):
        n = (m + 1) % 3
        p = (m + 2) % 3
        left = one[p] * two[n]
        right = one[n] * two[p]
        total += row[m] * (left - right)
        size += abs(row[m]) * (abs(left) + abs(right))
    if abs(total) > DETERMINANT_ROUNDING * size:
        return float(total)

    x = minor_terms(lines[i], lines[j], 2, 1)
    y = minor_terms(lines[i], lines[j], 0, 2)
    minus_w = minor_terms(lines[i], lines[j], 1, 0)
    # Two terms for each product of two numbers.
    sums = np.empty(2 * lines.shape[2] * (x.size + y.size + minus_w.size))
    made = add_products(lines[k, 0], x, 1.0, sums, 0)
    made = add_products(lines[k, 1], y, 1.0, sums, made)
    made = add_products(lines[k, 2], minus_w, 1.0, sums, made)
    return exact_sum(sums[:made])


@compiled
def intersect_lines(rows: Floats, out: Points) -> int:
    """Write the polygon {p: a x + b y <= c for all rows}; return its size, or `UNBOUNDED`.

    `rows` has the shape (k, 3, L), and `out` at least (k + 4, 2). c = inf is no limit, and c = -inf
    the empty set; a = b = 0 is no limit either if c >= 0, and the empty set otherwise. O(k^2).

    The borders are inserted one by one into a large box. A vertex is kept as the pair of its
    borders, and an exact determinant decides whether it satisfies a row, so that rounding decides
    nothing; each coordinate is within a few ulp of itself.
    """
    lines = lines_in_box(rows)
    count = len(lines)
    values = np.empty((count, 3))
    for i in range(count):
        for m in range(3):
            values[i, m] = exact_sum(lines[i, m])

    # The numbers of the borders in their order around the set, which begins as the box.
    # Each row adds at most one to the four of the box, which `count` contains.
    chain = np.arange(count)
    outside = np.empty(count, dtype=np.bool_)
    size = BOX_SIDES
    for k in range(BOX_SIDES, count):
        a, b, c = values[k]
        has_direction = a != 0.0 or b != 0.0
        if c == np.inf or (not has_direction and c >= 0.0):
            continue
        if c == -np.inf or not has_direction:
            return 0
        size = insert_border(values, lines, chain, size, k, outside)
        if size == 0:
            return 0

    for i in range(size):
        if chain[i] < BOX_SIDES:
            return UNBOUNDED
    return write_corners(values, lines, chain, size, out)


@compiled
def lines_in_box(rows: Floats) -> Floats:
    """Return the lines of a large box, counter-clockwise, and the rows after them."""
    lines = np.zeros((BOX_SIDES + len(rows), 3, rows.shape[2]))
    lines[0, 0, 0] = 1.0
    lines[1, 1, 0] = 1.0
    lines[2, 0, 0] = -1.0
    lines[3, 1, 0] = -1.0
    lines[:BOX_SIDES, 2, 0] = FAR
    lines[BOX_SIDES:] = rows
    return lines


@compiled
def insert_border(
    values: Floats, lines: Floats, chain: Integers, size: int, k: int, outside: Flags
) -> int:
    """Cut a set by line k, in place: `chain` has the numbers of its borders. Return its new size.

    Vertex i is between the borders i and i + 1; the size of the empty set is 0. `outside` is a
    working array.
    """
    violated = 0
    for i in range(size):
        outside[i] = beyond(values, lines, chain[i], chain[following(i, size)], k) > 0.0
        violated += outside[i]
    if violated == size:
        return 0
    if violated == 0:
        return size

    # The vertices from `first` to first + violated - 1 are outside: line k replaces the borders
    # between them.
    first = 0
    while not outside[first] or outside[preceding(first, size)]:
        first += 1
    remaining = size - violated + 1
    kept = np.empty(remaining, dtype=np.int64)
    for i in range(remaining):
        kept[i] = chain[(first + violated + i) % size]
    chain[:remaining] = kept
    chain[remaining] = k
    return remaining + 1


@compiled
def write_corners(values: Floats, lines: Floats, chain: Integers, size: int, out: Points) -> int:
    """Write the vertices between the borders of a set that is not empty; return their number."""
    points = np.empty((size, 2))
    made = 0
    for i in range(size):
        j = following(i, size)
        # Vertices that coincide are written once: they may be rounded to different points. The last
        # one is written if all others were left out.
        coincides = beyond(values, lines, chain[i], chain[j], chain[following(j, size)]) == 0.0
        if coincides and (made > 0 or i + 1 < size):
            continue
        corner = meeting_of_lines(values, lines, chain[i], chain[j])
        put(points, made, corner.x, corner.y)
        made += 1
    return hull(points, made, out)


@compiled
def meeting_of_lines(values: Floats, lines: Floats, i: int, j: int) -> Point:
    """Return the point where two lines meet; each coordinate is within a few ulp of itself."""
    w = exact_sum(minor_terms(lines[i], lines[j], 0, 1))
    x = exact_sum(minor_terms(lines[i], lines[j], 2, 1)) / w
    y = exact_sum(minor_terms(lines[i], lines[j], 0, 2)) / w

    # A line along an axis has its coordinate, rounded once.
    for a, b, c in (values[i], values[j]):
        if b == 0.0:
            x = c / a
        elif a == 0.0:
            y = c / b
    return Point(x, y)


@compiled
def difference(points: Points, count: int, other: Points, other_count: int, out: Points) -> int:
    """Write the Minkowski (Pontryagin) difference {p: p + q in the polygon for all q in the other}.

    Neither is empty; `out` has at least count + 4 rows. O(count * (count + other_count)). Each side
    moves inward until it meets the vertex of the other polygon that is farthest along its normal,
    which is chosen exactly. Its normal and its offset are sums of numbers without rounding, so that
    the intersection is exact.
    The coordinates are divided by powers of two, so that products neither overflow nor underflow.
    """
    a, n = tidy(points, count)
    a = a[:n].copy()
    b = other[:other_count].copy()
    unit = np.ones(2)
    for axis in range(2):
        largest = max(np.abs(a[:, axis]).max(), np.abs(b[:, axis]).max())
        # For coordinates that are all zero it is 1.
        unit[axis] = math.ldexp(1.0, math.frexp(largest)[1])
        a[:, axis] /= unit[axis]
        b[:, axis] /= unit[axis]

    rows = np.zeros((BOX_SIDES + n, 3, LONGEST))
    write_box_rows(a, b, rows)
    made = BOX_SIDES
    for i in range(n):
        made += write_side_row(vertex(a, i), vertex(a, following(i, n)), b, rows[made])

    corners = np.empty((made + BOX_SIDES, 2))
    made = intersect_lines(rows[:made], corners)
    for i in range(made):
        put(out, i, corners[i, 0] * unit[0], corners[i, 1] * unit[1])
    return made


@compiled
def write_box_rows(a: Points, b: Points, rows: Floats) -> None:
    """Write the first four rows of a difference a - b: the sides of the bounding box of a.

    They are the sides in the directions x, -x, y and -y, moved inward by the support function of b
    in these directions.
    Every difference needs them: `write_side_row` writes no side along an axis, and a segment or a
    point has no other bounds. `rows`, shape (k, 3, L >= 2), are zero before.
    """
    made = 0
    for axis in range(2):
        for sign in (1.0, -1.0):
            most = (sign * a[:, axis]).max()
            reach = (sign * b[:, axis]).max()
            rows[made, axis, 0] = sign
            rows[made, 2, 0], rows[made, 2, 1] = two_sum(most, -reach)
            made += 1


@compiled
def write_side_row(start: Point, end: Point, other: Points, row: Floats) -> int:
    """Write a side, from start to end, moved inward by another polygon; return the rows written.

    The side, of a counter-clockwise polygon, is moved by the support of `other`, and becomes a line
    of shape (3, LONGEST); `row` must be zero. Return 1, or 0 for a point and for a side along an
    axis, which the bounding box has: `row` is then zero again.
    """
    row[0, 0], row[0, 1] = two_sum(end.y, -start.y)
    row[1, 0], row[1, 1] = two_sum(start.x, -end.x)
    if row[0, 0] == 0.0 or row[1, 0] == 0.0:
        row[:] = 0.0
        return 0

    farthest = vertex(other, farthest_along(row, other))
    from_x = np.empty(2)
    from_y = np.empty(2)
    from_x[0], from_x[1] = two_sum(start.x, -farthest.x)
    from_y[0], from_y[1] = two_sum(start.y, -farthest.y)
    # The offset: the normal times the vector from the farthest vertex to the start of the side.
    terms = add_products(row[0, :2], from_x, 1.0, row[2], 0)
    add_products(row[1, :2], from_y, 1.0, row[2], terms)
    return 1


@compiled
def farthest_along(line: Floats, points: Points) -> int:
    """Return the index of the point farthest along the normal of a line, decided exactly."""
    best = 0
    sums = np.empty(LONGEST)
    for i in range(1, len(points)):
        x = line[0, 0] * (points[i, 0] - points[best, 0])
        y = line[1, 0] * (points[i, 1] - points[best, 1])
        farther = x + y  # the normal times the vector from the best point so far
        if abs(farther) <= HEIGHT_ROUNDING * (abs(x) + abs(y)):
            made = add_products(line[0, :2], points[i, :1], 1.0, sums, 0)
            made = add_products(line[0, :2], points[best, :1], -1.0, sums, made)
            made = add_products(line[1, :2], points[i, 1:], 1.0, sums, made)
            made = add_products(line[1, :2], points[best, 1:], -1.0, sums, made)
            farther = exact_sum(sums[:made])
        if farther > 0.0:
            best = i
    return best
