"""Extreme rays of a polyhedral cone in integers: rounding decides nothing.

A set {x: a . x <= b} is the cone {(x, t): b t - a . x >= 0, t >= 0}, where rows (a, b) are floats
times powers of two. Its extreme rays with t > 0 are the vertices, those with t = 0 directions; the
lines that it contains are separate. Empty, flat and unbounded sets are results like others. It
takes ten to fifty times as long as `double_description`, which rounds: integers decide whether a
set is empty, flat or unbounded, and find its box.

References
----------
K. Fukuda and A. Prodon, Double description method revisited, in Combinatorics and Computer Science
(1996).
"""

from __future__ import annotations

import math
import operator
from collections.abc import Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from infoset.arrays import Flags, Floats, Integers
from infoset.geometry.polytope.incidence import Bits, common, contains_common, packed
from infoset.kernels import Kernels

Row = list[int]
Rationals = list[Fraction]
Box = tuple[Rationals, Rationals]
"""Minimum and maximum coordinates."""
_kernels = Kernels()


class Cone(NamedTuple):
    """Extreme rays of a cone {z: rows z >= 0} modulo its lines."""

    rays: list[Row]
    on: Flags
    """Whether a ray is on a row, shape (rays, rows)."""
    lines: list[Row]
    """A basis of the lines."""


class Vertices(NamedTuple):
    """Vertices of a set of half-spaces, and directions and lines along which it is unbounded.

    All are lists of n numbers. Without vertices the set is empty, whatever the directions and lines
    are.
    """

    points: list[Rationals]
    on: Flags
    """Whether a vertex is on the boundary of a half-space, shape (vertices, half-spaces)."""
    directions: list[Row]
    lines: list[Row]

    @property
    def is_bounded(self) -> bool:
        """Whether there is no direction in which the set, if it has points, is unbounded."""
        return not self.directions and not self.lines

    def box(self) -> Box:
        """Return the minimum and the maximum coordinates of the vertices, at least one."""
        axes = list(zip(*self.points, strict=True))
        return [min(axis) for axis in axes], [max(axis) for axis in axes]


def vertices_of(rows: list[Rationals], limits: Rationals) -> Vertices:
    """Return the vertices, directions and lines of {x: rows x <= limits}, with at least one row."""
    # The row t >= 0 comes first. It is no half-space: `on` is returned without it.
    is_ahead = [0] * len(rows[0]) + [1]
    table = [is_ahead]
    for row, limit in zip(rows, limits, strict=True):
        table.append(whole([*(-entry for entry in row), limit]))
    cone = extreme_rays(table)

    is_point = np.array([ray[-1] > 0 for ray in cone.rays], np.bool_)
    on = cone.on[is_point, 1:]
    points = [[Fraction(entry, ray[-1]) for entry in ray[:-1]] for ray in cone.rays if ray[-1]]
    directions = [ray[:-1] for ray in cone.rays if not ray[-1]]
    lines = [line[:-1] for line in cone.lines]
    return Vertices(points, on, directions, lines)


def null_space(matrix: list[Rationals]) -> list[Row]:
    """Return a basis of {x: matrix x = 0}, of any signs and lengths; the matrix has a row."""
    basis = _unit_vectors(len(matrix[0]))
    for row in map(whole, matrix):
        heights = [dot(row, line) for line in basis]
        pivot = _first_nonzero(heights)
        if pivot is None:
            continue
        height = heights.pop(pivot)
        line = basis.pop(pivot)
        basis = _moved_along(basis, heights, line, height)
    return basis


def product(rows: list[Rationals], matrix: list[Rationals]) -> list[Rationals]:
    """Return the product of two matrices."""
    columns = list(zip(*matrix, strict=True))
    return [
        [sum(map(operator.mul, row, column), Fraction(0)) for column in columns] for row in rows
    ]


def whole(numbers: Rationals) -> Row:
    """Return rational numbers times a positive factor, as integers without a common divisor."""
    divisor = math.lcm(*(number.denominator for number in numbers))
    return shortest([number.numerator * (divisor // number.denominator) for number in numbers])


def rationals(rows: Floats) -> list[Rationals]:
    """Return floats, shape (k, n), as the rational numbers that they are."""
    return [[Fraction(number) for number in row] for row in rows.tolist()]


def rounded(row: Row) -> Floats:
    """Return a row as floats, the largest 1 in size."""
    return np.array(_rounded(row))


def _rounded(row: Row) -> list[float]:
    largest = max(map(abs, row)) or 1  # a row of zeros stays
    return [entry / largest for entry in row]


def extreme_rays(rows: list[Row]) -> Cone:
    """Return the extreme rays of {z: rows z >= 0}, one step of the double description for each row.

    It starts with the whole space, which has no ray and as many lines as dimensions. Rows that end
    lines come first, then always the row that most rays violate: an empty set ends after few of
    many rows.
    """
    lines = _unit_vectors(len(rows[0]))
    rays: list[Row] = []
    on = np.zeros((0, len(rows)), np.bool_)
    done = np.zeros(len(rows), np.bool_)
    for number, row in enumerate(rows):
        heights = [dot(row, line) for line in lines]
        pivot = _first_nonzero(heights)
        if pivot is None:
            continue

        # The half of a line that is above the row becomes a ray; all other lines and rays move
        # along the line, onto the row.
        height = abs(heights.pop(pivot))
        line = lines.pop(pivot)
        above = line if dot(row, line) > 0 else [-entry for entry in line]
        lines = _moved_along(lines, heights, above, height)
        rays = _moved_along(rays, [dot(row, ray) for ray in rays], above, height)
        rays.append(above)

        # The new ray lies on all rows before this one, and the others also on this one.
        on[:, number] = True
        on = np.vstack([on, done])
        done[number] = True
    return _inserted(rows, rays, on, done, lines)


def _unit_vectors(size: int) -> list[Row]:
    return [[int(i == j) for j in range(size)] for i in range(size)]


def _first_nonzero(numbers: Row) -> int | None:
    """Return the position of the first number that is not zero."""
    return next((k for k, number in enumerate(numbers) if number), None)


def _moved_along(vectors: list[Row], heights: Row, line: Row, height: int) -> list[Row]:
    """Return vectors with some `heights` over a row, moved onto it along a line with a `height`.

    They are multiplied by `height`: it must be positive for rays, a negative one reverses lines.
    """
    moved = zip(vectors, heights, strict=True)
    return [combined(height, vector, -above, line) for vector, above in moved]


def _inserted(rows: list[Row], rays: list[Row], on: Flags, done: Flags, lines: list[Row]) -> Cone:
    """Return the cone after the rows that are not `done`, each a combination of rows that are."""
    # An edge of the cone modulo its lines, of some dimension d, lies on d - 2 rows.
    least = len(rows[0]) - len(lines) - 2
    units = np.array([_rounded(row) for row in rows])
    while not done.all():
        left = np.flatnonzero(~done)
        number = int(left[0])
        # Rounded heights: they choose only the order of the rows.
        if rays:
            heights = units[left] @ np.array([_rounded(ray) for ray in rays]).T
            violations = (heights < 0.0).sum(axis=1)
            number = int(left[violations.argmax()])
        rays, on = _cut(rays, on, rows[number], number, least)
        done[number] = True
    return Cone(rays, on, lines)


def _cut(rays: list[Row], on: Flags, row: Row, number: int, least: int) -> tuple[list[Row], Flags]:
    """Return the rays above or on a row and the rays in which edges cross it, and their incidence.

    The row has a `number`, whose column of `on` is written; an edge lies on at least `least` rows.
    """
    heights = [dot(row, ray) for ray in rays]
    on[:, number] = [height == 0 for height in heights]
    if min(heights, default=0) >= 0:
        return rays, on

    signs = np.array([(height > 0) - (height < 0) for height in heights], np.int64)
    kept = np.flatnonzero(signs >= 0)
    ends = edges_across(packed(on), signs, least)
    new = [combined(heights[p], rays[q], -heights[q], rays[p]) for p, q in ends.tolist()]
    bits = on[ends[:, 0]] & on[ends[:, 1]]
    bits[:, number] = True
    return [*(rays[k] for k in kept), *new], np.vstack([on[kept], bits])


@_kernels.compiled
def edges_across(bits: Bits, signs: Integers, least: int) -> Integers:
    """Return pairs of rays, shape (k, 2), with signs 1 and -1, that span an edge.

    An edge lies on at least `least` rows, and no third ray lies on all of them.
    """
    columns = np.ascontiguousarray(bits.T)
    count = len(bits)
    shared = np.empty(count, np.int64)
    near = np.empty(count, np.int64)
    pairs = np.empty((count, 2), np.int64)
    made = 0
    for p in np.flatnonzero(signs > 0):
        # Only rays with enough common rows can be the other end of an edge, or forbid it.
        common(bits[p], columns, shared)
        found = 0
        for k in range(count):
            near[found] = k
            found += shared[k] >= least

        for q in near[:found]:
            if signs[q] >= 0:
                continue
            is_edge = True
            for k in near[:found]:
                is_edge &= k in (p, q) or not contains_common(bits[k], bits[p], bits[q])
            if not is_edge:
                continue

            if made == len(pairs):
                pairs = np.concatenate((pairs, pairs))
            pairs[made, 0] = p
            pairs[made, 1] = q
            made += 1
    return pairs[:made]


def dot(one: Sequence[int], other: Sequence[int]) -> int:
    """Return the sum of products."""
    return sum(a * b for a, b in zip(one, other, strict=True))


def combined(share: int, one: Row, other_share: int, other: Row) -> Row:
    """Return share one + other_share other, without a common divisor."""
    return shortest([share * a + other_share * b for a, b in zip(one, other, strict=True)])


def shortest(row: Row) -> Row:
    """Return the row without a common divisor."""
    divisor = math.gcd(*row)
    return [entry // divisor for entry in row] if divisor > 1 else row
