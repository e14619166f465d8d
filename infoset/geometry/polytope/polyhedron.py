"""Convex polyhedra in exact integers, which represent unbounded polytopes.

A polyhedron is {x: a . x <= b for all facets, a . x = b for all equations}, and the sum of the hull
of its points, the cone of its directions and the span of its lines. Every list has rows of n + 1
integers: (a, b) for facets and equations, (x t, t) with t > 0 for a point x, (d, 0) for directions
and lines. Each representation follows from the other by `cone.extreme_rays`, without rounding: a
direction that lies in a facet stays in it.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np

from infoset.arrays import Floats
from infoset.geometry.polytope.cone import Row, combined, dot, extreme_rays, shortest, whole


@dataclass(frozen=True, eq=False)
class Polyhedron:
    """A convex polyhedron in R^n in both representations, without redundant rows.

    Without points it is empty.
    """

    space: int
    points: tuple[Row, ...]
    directions: tuple[Row, ...]
    lines: tuple[Row, ...]
    facets: tuple[Row, ...]
    equations: tuple[Row, ...]

    @property
    def is_bounded(self) -> bool:
        """Whether it has no direction and no line."""
        return not self.directions and not self.lines

    @cached_property
    def half_spaces(self) -> list[Row]:
        """Rows (a, b), a . x <= b: the facets, and two of each equation."""
        return [*self.facets, *self.equations, *(_negative(row) for row in self.equations)]

    @property
    def generators(self) -> tuple[list[Row], list[Row], list[Row]]:
        """Points, directions and lines, as lists."""
        return list(self.points), list(self.directions), list(self.lines)


def of_half_spaces(space: int, rows: Iterable[Row]) -> Polyhedron:
    """Return {x: a . x <= b for all rows (a, b)} in R^n, n = `space`."""
    table = [_unit(space)]
    for row in rows:
        table.append(_turned(row))
    cone = extreme_rays(table)
    points = [ray for ray in cone.rays if ray[-1] > 0]
    if not points:
        return Polyhedron(space, (), (), (), (), ())
    directions = [ray for ray in cone.rays if not ray[-1]]
    return of_generators(space, points, directions, cone.lines)


def of_generators(
    space: int, points: Sequence[Row], directions: Sequence[Row], lines: Sequence[Row]
) -> Polyhedron:
    """Return the sum of the hull of points, the cone of directions and the span of lines, in R^n.

    There is at least one point.
    """
    both_ends = [*lines, *(_negative(line) for line in lines)]
    dual = extreme_rays([_turned(row) for row in (*points, *directions, *both_ends)])
    # Lines of the dual are the equations of the set, and rays its facets: the equations are
    # subtracted from them, so that each facet has one form.
    equations, pivots = _reduced(dual.lines)
    facets = []
    for ray in dual.rays:
        facet = ray
        for equation, pivot in zip(equations, pivots, strict=True):
            facet = combined(equation[pivot], facet, -facet[pivot], equation)
        # A row without a normal is t >= 0, which holds for all points.
        if any(facet[:-1]):
            facets.append(facet)

    # The facets give the generators without redundant ones.
    half_spaces = [*facets, *equations, *(_negative(row) for row in equations)]
    primal = extreme_rays([_unit(space), *(_turned(row) for row in half_spaces)])
    return Polyhedron(
        space,
        tuple(ray for ray in primal.rays if ray[-1] > 0),
        tuple(ray for ray in primal.rays if not ray[-1]),
        tuple(primal.lines),
        tuple(facets),
        tuple(equations),
    )


def image(
    one: Polyhedron, matrix: Sequence[Sequence[Fraction]], offset: Sequence[Fraction]
) -> Polyhedron:
    """Return {matrix x + offset}."""
    points, directions, lines = (
        [_mapped(row, matrix, offset) for row in rows] for rows in one.generators
    )
    # A direction whose image is zero is none.
    directions = [direction for direction in directions if any(direction)]
    lines = [line for line in lines if any(line)]
    return of_generators(len(matrix), points, directions, lines)


def preimage(
    rows: Iterable[Row], matrix: Sequence[Sequence[Fraction]], offset: Sequence[Fraction]
) -> Polyhedron:
    """Return {x: a . (matrix x + offset) <= b for all rows (a, b)}."""
    columns = list(zip(*matrix, strict=True))
    composed = []
    for row in rows:
        normal = row[:-1]
        limit = row[-1]
        entries = [_product(normal, column) for column in columns]
        composed.append(whole([*entries, limit - _product(normal, offset)]))
    return of_half_spaces(len(columns), composed)


def total(one: Polyhedron, other: Polyhedron) -> Polyhedron:
    """Return the Minkowski sum {x + y}."""
    points = []
    for x, y in itertools.product(one.points, other.points):
        height = x[-1] * y[-1]
        sums = [a * y[-1] + b * x[-1] for a, b in zip(x[:-1], y[:-1], strict=True)]
        points.append(shortest([*sums, height]))
    return of_generators(
        one.space, points, [*one.directions, *other.directions], [*one.lines, *other.lines]
    )


def moved_outward(rows: Iterable[Row], by: Sequence[Fraction]) -> list[Row]:
    """Return rows of {x + e: |e_i| <= by_i}."""
    larger = []
    for row in rows:
        reach = sum(
            (abs(entry) * size for entry, size in zip(row[:-1], by, strict=True)), Fraction(0)
        )
        larger.append(whole([*map(Fraction, row[:-1]), row[-1] + reach]))
    return larger


def moved_inward(rows: Iterable[Row], other: Polyhedron) -> list[Row] | None:
    """Return rows of {x: x + y in the set for all y of the other}.

    It is None if there is no such x because the other set is unbounded along a normal.
    """
    smaller = []
    for row in rows:
        reach = support(other, row[:-1])
        if reach is None:
            return None
        smaller.append(whole([*map(Fraction, row[:-1]), row[-1] - reach]))
    return smaller


def support(one: Polyhedron, normal: Sequence[int]) -> Fraction | None:
    """Return max normal . x over a polyhedron that has points; None if there is no maximum."""
    if any(dot(normal, line[:-1]) for line in one.lines):
        return None
    if any(dot(normal, direction[:-1]) > 0 for direction in one.directions):
        return None
    return max(Fraction(dot(normal, point[:-1]), point[-1]) for point in one.points)


def recession(one: Polyhedron) -> Polyhedron:
    """Return the cone of all directions d with x + d in the set for all x of it."""
    origin = [0] * one.space + [1]
    return of_generators(one.space, [origin], one.directions, one.lines)


def hull(sets: Sequence[Polyhedron]) -> Polyhedron:
    """Return the closed convex hull of the union of sets that have points."""
    points = [row for one in sets for row in one.points]
    directions = [row for one in sets for row in one.directions]
    lines = [row for one in sets for row in one.lines]
    return of_generators(sets[0].space, points, directions, lines)


def holds_with_equality(row: Row, point: Row) -> bool:
    """Whether a point is on the boundary of a half-space, or on an equation."""
    return dot(row[:-1], point[:-1]) == row[-1] * point[-1]


def as_points(rows: Floats) -> list[Row]:
    """Return points, shape (k, n), as integer rows."""
    return [whole([*map(Fraction, row), Fraction(1)]) for row in rows.tolist()]


def as_directions(rows: Floats) -> list[Row]:
    """Return directions, shape (k, n), as integer rows, without zeros."""
    return [whole([*map(Fraction, row), Fraction(0)]) for row in rows.tolist() if any(row)]


def as_half_spaces(rows: Floats, limits: Floats) -> list[Row]:
    """Return half-spaces rows x <= limits, shapes (k, n) and (k,), as integer rows."""
    table = np.column_stack([rows, limits])
    return [whole(list(map(Fraction, row))) for row in table.tolist()]


def rounded_points(rows: Sequence[Row], space: int) -> Floats:
    """Return points as floats, shape (k, n), each coordinate rounded once."""
    return np.array([[entry / row[-1] for entry in row[:-1]] for row in rows]).reshape(-1, space)


def rounded_directions(rows: Sequence[Row], space: int) -> Floats:
    """Return directions of unit length, shape (k, n)."""
    vectors = np.array(
        [[entry / max(map(abs, row)) for entry in row[:-1]] for row in rows]
    ).reshape(-1, space)
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1)[:, None])


def rounded_rows(rows: Sequence[Row], space: int) -> Floats:
    """Return rows (a, b), shape (k, n + 1), with a largest entry of a from 1/2 to 1.

    Rows of dyadic numbers are exact.
    """
    table = []
    for row in rows:
        unit = Fraction(2) ** -max(map(abs, row[:-1])).bit_length()
        table.append([float(entry * unit) for entry in row])
    return np.array(table).reshape(-1, space + 1)


def rounded_equations(rows: Sequence[Row], space: int) -> Floats:
    """Return rows (a, b), shape (k, n + 1), each with an entry 1 where the others are zero."""
    table = []
    for row in rows:
        others = [one for one in rows if one is not row]
        own = [j for j in range(space) if row[j] and not any(one[j] for one in others)]
        pivot = max((row[j] for j in own), key=abs)
        table.append([entry / pivot for entry in row])
    return np.array(table).reshape(-1, space + 1)


def _mapped(row: Row, matrix: Sequence[Sequence[Fraction]], offset: Sequence[Fraction]) -> Row:
    """Return the image of a point (x t, t) or a direction (d, 0)."""
    height = row[-1]
    entries = [
        _product(row[:-1], line) + height * shift
        for line, shift in zip(matrix, offset, strict=True)
    ]
    return whole([*entries, Fraction(height)])


def _product(integers: Sequence[int], numbers: Sequence[Fraction]) -> Fraction:
    return sum((a * b for a, b in zip(integers, numbers, strict=True)), Fraction(0))


def _reduced(rows: Sequence[Row]) -> tuple[list[Row], list[int]]:
    """Return equations in reduced echelon form, and the pivot axis of each.

    No other equation has a factor of this axis; its own factor is positive.
    """
    left = list(rows)
    done: list[Row] = []
    pivots: list[int] = []
    while left:
        row = left.pop()
        column = max((j for j in range(len(row) - 1) if j not in pivots), key=lambda j: abs(row[j]))
        if row[column] < 0:
            row = _negative(row)
        factor = row[column]
        left = [combined(factor, one, -one[column], row) for one in left]
        done = [combined(factor, one, -one[column], row) for one in done]
        done.append(row)
        pivots.append(column)
    return done, pivots


def _turned(row: Row) -> Row:
    """Return the row (-a, b) of the cone {(x, t): b t - a . x >= 0}, or of its dual, (-x, t)."""
    return [*(-entry for entry in row[:-1]), row[-1]]


def _negative(row: Row) -> Row:
    return [-entry for entry in row]


def _unit(space: int) -> Row:
    """Return the row t >= 0."""
    return [0] * space + [1]
