"""Compiled intersections of half-planes."""

from __future__ import annotations

import numpy as np

from infoset._compile import compiled, inlined
from infoset.polygon import Points, put
from infoset.polygon_exact import exact_sum, hull, two_product, two_sum

FAR = 1e70
"""Coordinates of a box that contains all sets: a set that reaches it is unbounded."""
UNBOUNDED = -1
"""Number of vertices of an unbounded set."""


@inlined
def minor(a: float, b: float, c: float, d: float) -> float:
    """Return a d - b c within a few ulp of itself."""
    left, left_low = two_product(a, d)
    right, right_low = two_product(b, c)
    difference, low = two_sum(left, -right)
    return difference + (low + (left_low - right_low))


@compiled
def beyond(one: Points, two: Points, row: Points) -> float:
    """Return a number that is positive if the point where two borders meet violates a third row; its sign is exact.

    A row is (a, b, c) with a x + b y <= c. The directions of the first two must turn left, by less than half a turn.
    """
    x, y = minor(one[2], one[1], two[2], two[1]), minor(one[0], one[2], two[0], two[2])
    w = minor(one[0], one[1], two[0], two[1])
    total = row[0] * x + row[1] * y - row[2] * w
    if abs(total) > 2e-15 * (abs(row[0] * x) + abs(row[1] * y) + abs(row[2] * w)):
        return float(total)
    return determinant(one, two, row)


@compiled
def determinant(one: Points, two: Points, row: Points) -> float:
    """Return the number of `beyond`, with the exact sign."""
    terms = np.empty(24)
    made = 0
    for i, j, k in ((2, 1, 0), (0, 2, 1), (1, 0, 2)):
        for a, b in ((one[i], two[j]), (-one[j], two[i])):
            for part in two_product(a, b):
                terms[made], terms[made + 1] = two_product(part, row[k])
                made += 2
    return exact_sum(terms)


@compiled
def intersect_rows(rows: Points, out: Points) -> int:
    """Write the polygon {p: a x + b y <= c for all rows (a, b, c)}; return its number of vertices, or `UNBOUNDED`.

    `rows` has the shape (k, 3), `out` (>= k + 4, 2). An infinite c is no limit; a = b = 0 is no limit either if c >= 0,
    and the empty set otherwise. O(k^2). Borders are inserted one by one. A vertex is kept as the pair of its borders,
    and an exact determinant decides whether it satisfies a row, so that rounding decides nothing; each coordinate is
    within a few ulp of itself.
    """
    count = len(rows)
    lines = np.zeros((count + 4, 3))
    for i in range(4):
        lines[i, 0], lines[i, 1], lines[i, 2] = (1.0, 0.0, -1.0, 0.0)[i], (0.0, 1.0, 0.0, -1.0)[i], FAR
    lines[4:] = rows
    chain = np.arange(count + 8)
    outside = np.empty(count + 8, dtype=np.bool_)
    size = 4
    for k in range(4, count + 4):
        if lines[k, 2] == np.inf or (lines[k, 0] == 0.0 and lines[k, 1] == 0.0 and lines[k, 2] >= 0.0):
            continue
        if lines[k, 2] == -np.inf or (lines[k, 0] == 0.0 and lines[k, 1] == 0.0):
            return 0
        violated = 0
        for i in range(size):
            j = i + 1 if i + 1 < size else 0
            outside[i] = beyond(lines[chain[i]], lines[chain[j]], lines[k]) > 0.0
            violated += outside[i]
        if violated == size:
            return 0
        if violated == 0:
            continue
        # The vertices first .. first + violated - 1 are outside; vertex i is between borders i and i + 1.
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
    for i in range(size):
        if chain[i] < 4:
            return UNBOUNDED
        a, b = lines[chain[i]], lines[chain[i + 1 if i + 1 < size else 0]]
        w = minor(a[0], a[1], b[0], b[1])
        x, y = minor(a[2], a[1], b[2], b[1]) / w, minor(a[0], a[2], b[0], b[2]) / w
        for line in (a, b):
            if line[1] == 0.0:
                x = line[2] / line[0]
            elif line[0] == 0.0:
                y = line[2] / line[1]
        put(points, i, x + 0.0, y + 0.0)
    return hull(points, size, out)


@compiled
def difference(points: Points, count: int, other: Points, other_count: int, out: Points) -> int:
    """Write the Minkowski (Pontryagin) difference {p: p + q in the polygon for all q in the other one}, neither empty.

    O(count * (count + other_count)), in coordinates about a vertex of each polygon. The sides are moved by rounded
    support functions. The bounding box, whose sides need no direction, holds the tips of needles in place.
    """
    rows = np.empty((count + 6, 3))
    from_x, from_y, to_x, to_y = points[0, 0], points[0, 1], other[0, 0], other[0, 1]
    made = 0
    for i in range(count + 6):
        if i < 4:
            a, b = ((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0))[i]
        else:  # the two sides of a segment; none of a point
            j, k = (i - 4) % count, (i - 3) % count
            a, b = points[k, 1] - points[j, 1], points[j, 0] - points[k, 0]
        reach = own = -np.inf
        for m in range(other_count):
            reach = max(reach, a * (other[m, 0] - to_x) + b * (other[m, 1] - to_y))
        for m in range(count):
            own = max(own, a * (points[m, 0] - from_x) + b * (points[m, 1] - from_y))
        if i < 4 or (a != 0.0 and b != 0.0):  # the box has the sides along the axes
            rows[made, 0], rows[made, 1], rows[made, 2] = a, b, own - reach
            made += 1
    work = np.empty((made + 4, 2))
    made = intersect_rows(rows[:made], work)
    for i in range(made):
        x, y = work[i, 0] + (from_x - to_x), work[i, 1] + (from_y - to_y)
        # On the bounding box a coordinate is the difference of two coordinates.
        for axis in range(2):
            low, high = (
                points[:count, axis].min() - other[:other_count, axis].min(),
                (points[:count, axis].max() - other[:other_count, axis].max()),
            )
            if work[i, axis] == rows[2 * axis, 2]:
                x, y = (high, y) if axis == 0 else (x, high)
            elif work[i, axis] == -rows[2 * axis + 1, 2]:
                x, y = (low, y) if axis == 0 else (x, low)
        put(out, i, x, y)
    return made
