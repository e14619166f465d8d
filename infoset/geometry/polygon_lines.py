"""Compiled intersections of half-planes."""

from __future__ import annotations

import math

import numpy as np

from infoset._compile import compiled, inlined
from infoset.arrays import Floats
from infoset.geometry.double_words import two_product, two_sum
from infoset.geometry.polygon import Points, put
from infoset.geometry.polygon_exact import exact_sum, hull, tidy

FAR = 1e70
"""Coordinates of a box that contains all sets: a set that reaches it is unbounded."""
UNBOUNDED = -1
"""Number of vertices of an unbounded set."""
LONGEST = 16
"""Most terms of a coefficient of a side of a difference."""


@inlined
def add_products(one: Floats, two: Floats, sign: float, sums: Floats, made: int) -> int:
    """Append the terms of the product of two sums, each with its rounding error; return the new
    number of terms.
    """
    for a in one:
        for b in two:
            if a != 0.0 and b != 0.0:
                sums[made], sums[made + 1] = two_product(sign * a, b)
                made += 2
    return made


@compiled
def minor_terms(one: Floats, two: Floats, i: int, j: int) -> Floats:
    """Return one[i] two[j] - one[j] two[i] of two lines, shape (3, L), as numbers whose sum is
    exact.
    """
    sums = np.empty(4 * one.shape[1] * two.shape[1])
    made = add_products(one[i], two[j], 1.0, sums, 0)
    made = add_products(one[j], two[i], -1.0, sums, made)
    exact_sum(sums[:made])
    return sums[:made]


@compiled
def height_over_line(along: Floats, start: Floats, point: Floats) -> float:
    """Return the cross product of `along` and point - start, all of shape (2,); its sign is
    exact.
    """
    sums = np.empty(8)
    made = add_products(along[:1], point[1:], 1.0, sums, 0)
    made = add_products(along[:1], start[1:], -1.0, sums, made)
    made = add_products(along[1:], point[:1], -1.0, sums, made)
    made = add_products(along[1:], start[:1], 1.0, sums, made)
    return exact_sum(sums[:made])


@compiled
def beyond(values: Floats, lines: Floats, i: int, j: int, k: int) -> float:
    """Return a number that is positive if the point where the lines i and j meet violates line k;
    its sign is exact.

    A line is (a, b, c) with a x + b y <= c. The directions of the first two must turn left, by less
    than half a turn. `lines` has the shape (k, 3, L): each coefficient is the sum of L numbers.
    `values`, shape (k, 3), are the sums rounded.
    """
    one = values[i]
    two = values[j]
    row = values[k]
    total = size = 0.0
    for m in range(3):
        n = (m + 1) % 3
        p = (m + 2) % 3
        left = one[p] * two[n]
        right = one[n] * two[p]
        total += row[m] * (left - right)
        size += abs(row[m]) * (abs(left) + abs(right))
    # The values have errors of a few ulp, and each operation one of half an ulp.
    if abs(total) > 1e-14 * size:
        return float(total)
    x = minor_terms(lines[i], lines[j], 2, 1)
    y = minor_terms(lines[i], lines[j], 0, 2)
    w = minor_terms(lines[i], lines[j], 1, 0)
    sums = np.empty(2 * lines.shape[2] * (x.size + y.size + w.size))
    made = add_products(lines[k, 0], x, 1.0, sums, 0)
    made = add_products(lines[k, 1], y, 1.0, sums, made)
    made = add_products(lines[k, 2], w, 1.0, sums, made)
    return exact_sum(sums[:made])


@compiled
def intersect_lines(rows: Floats, out: Points) -> int:
    """Write the polygon {p: a x + b y <= c for all rows (a, b, c)}; return its number of vertices,
    or `UNBOUNDED`.

    `rows` has the shape (k, 3, L): each coefficient is the sum of L numbers; `out` (>= k + 4, 2).
    An infinite c is no limit; a = b = 0 is no limit either if c >= 0, and the empty set otherwise.
    O(k^2). Borders are inserted one by one. A vertex is kept as the pair of its borders, and an
    exact determinant decides whether it satisfies a row, so that rounding decides nothing; each
    coordinate is within a few ulp of itself.
    """
    count = len(rows)
    lines = np.zeros((count + 4, 3, rows.shape[2]))
    values = np.empty((count + 4, 3))
    for i in range(4):
        lines[i, 0, 0], lines[i, 1, 0], lines[i, 2, 0] = (
            (1.0, 0.0, -1.0, 0.0)[i],
            (0.0, 1.0, 0.0, -1.0)[i],
            FAR,
        )
    lines[4:] = rows
    for i in range(count + 4):
        for m in range(3):
            values[i, m] = exact_sum(lines[i, m])
    chain = np.arange(count + 8)
    outside = np.empty(count + 8, dtype=np.bool_)
    size = 4
    for k in range(4, count + 4):
        a, b, c = values[k]
        if c == np.inf or (a == 0.0 and b == 0.0 and c >= 0.0):
            continue
        if c == -np.inf or (a == 0.0 and b == 0.0):
            return 0
        violated = 0
        for i in range(size):
            outside[i] = (
                beyond(values, lines, chain[i], chain[i + 1 if i + 1 < size else 0], k) > 0.0
            )
            violated += outside[i]
        if violated == size:
            return 0
        if violated == 0:
            continue
        # The vertices first .. first + violated - 1 are outside; vertex i is between borders i and
        # i + 1.
        first = 0
        while not outside[first] or outside[first - 1 if first > 0 else size - 1]:
            first += 1
        kept = np.empty(size - violated + 2, dtype=np.int64)
        for i in range(size - violated + 1):
            kept[i] = chain[(first + violated + i) % size]
        size = size - violated + 2
        kept[size - 1] = k
        chain[:size] = kept
    points = np.empty((size, 2))
    made = 0
    for i in range(size):
        if chain[i] < 4:
            return UNBOUNDED
        j = chain[i + 1 if i + 1 < size else 0]
        # Vertices that coincide are written once: they may be rounded to different points.
        if beyond(values, lines, chain[i], j, chain[(i + 2) % size]) == 0.0 and (
            made > 0 or i + 1 < size
        ):
            continue
        a = lines[chain[i]]
        b = lines[j]
        w = exact_sum(minor_terms(a, b, 0, 1))
        x = exact_sum(minor_terms(a, b, 2, 1)) / w
        y = exact_sum(minor_terms(a, b, 0, 2)) / w
        for line in (values[chain[i]], values[j]):
            if line[1] == 0.0:
                x = line[2] / line[0]
            elif line[0] == 0.0:
                y = line[2] / line[1]
        put(points, made, x + 0.0, y + 0.0)
        made += 1
    return hull(points, made, out)


@compiled
def difference(points: Points, count: int, other: Points, other_count: int, out: Points) -> int:
    """Write the Minkowski (Pontryagin) difference {p: p + q in the polygon for all q in the other
    one}, neither empty.

    O(count * (count + other_count)). Each side moves inward until it meets the lowest vertex of the
    other polygon, the vertex that is chosen exactly. Its normal and its offset are sums of numbers
    without rounding, so that the intersection is exact. The sides of the bounding box close the
    difference of a segment or a point. The coordinates are divided by powers of two, so that
    products neither overflow nor underflow.
    """
    a, n = tidy(points, count)
    a = a[:n].copy()
    b = other[:other_count].copy()
    unit = np.ones(2)
    for axis in range(2):
        largest = max(np.abs(a[:, axis]).max(), np.abs(b[:, axis]).max())
        unit[axis] = math.ldexp(1.0, math.frexp(largest)[1])
        a[:, axis] /= unit[axis]
        b[:, axis] /= unit[axis]
    rows = np.zeros((n + 4, 3, LONGEST))
    made = 0
    for axis in range(2):
        for sign in (1.0, -1.0):
            rows[made, axis, 0] = sign
            most = (sign * a[:, axis]).max()
            reach = (sign * b[:, axis]).max()
            rows[made, 2, 0], rows[made, 2, 1] = two_sum(most, -reach)
            made += 1
    for i in range(n):
        j = i + 1 if i + 1 < n else 0
        side = rows[made]
        side[0, 0], side[0, 1] = two_sum(a[j, 1], -a[i, 1])
        side[1, 0], side[1, 1] = two_sum(a[i, 0], -a[j, 0])
        if side[0, 0] == 0.0 or side[1, 0] == 0.0:  # a side of the box, or a point
            side[:] = 0.0
            continue
        to = farthest_along(side, b)
        from_x = np.empty(2)
        from_y = np.empty(2)
        from_x[0], from_x[1] = two_sum(a[i, 0], -b[to, 0])
        from_y[0], from_y[1] = two_sum(a[i, 1], -b[to, 1])
        terms = add_products(side[0, :2], from_x, 1.0, side[2], 0)
        add_products(side[1, :2], from_y, 1.0, side[2], terms)
        made += 1
    work = np.empty((made + 4, 2))
    made = intersect_lines(rows[:made], work)
    for i in range(made):
        put(out, i, work[i, 0] * unit[0], work[i, 1] * unit[1])
    return made


@compiled
def farthest_along(side: Floats, points: Points) -> int:
    """Return the number of the point that is farthest along the normal of a line, exactly
    decided.
    """
    best = 0
    sums = np.empty(LONGEST)
    for i in range(1, len(points)):
        x = side[0, 0] * (points[i, 0] - points[best, 0])
        y = side[1, 0] * (points[i, 1] - points[best, 1])
        farther = x + y
        # The coefficients and the differences are rounded, each by half an ulp, as are the
        # products.
        if abs(farther) <= 2e-15 * (abs(x) + abs(y)):
            made = add_products(side[0, :2], points[i, :1], 1.0, sums, 0)
            made = add_products(side[0, :2], points[best, :1], -1.0, sums, made)
            made = add_products(side[1, :2], points[i, 1:], 1.0, sums, made)
            made = add_products(side[1, :2], points[best, 1:], -1.0, sums, made)
            farther = exact_sum(sums[:made])
        if farther > 0.0:
            best = i
    return best
