"""Extreme rays in integers against another exact library (PPL), also of sets without vertices."""

from __future__ import annotations

import fractions
from importlib.util import find_spec

import numpy as np
import pytest

from infoset.arrays import Floats
from infoset.geometry.polytope import cone
from tests.infoset.geometry.polytope.exact_sets import polyhedron
from tests.rationals import Fraction

needs_ppl = pytest.mark.skipif(
    find_spec("ppl") is None, reason="needs the extra exact: pip install '.[exact]'"
)


def rows_of(seed: int) -> tuple[Floats, Floats]:
    """Integers, or mixed units, some with opposite rows, some with a box around."""
    random = np.random.default_rng(seed)
    space = int(random.integers(1, 5))
    count = int(random.integers(space, 3 * space + 4))
    rows = random.integers(-3, 4, (count, space)).astype(float)
    limits = random.integers(-1, 4, count).astype(float)
    if seed % 4 > 1:
        rows = random.normal(size=(count, space)) * 10.0 ** random.integers(-12, 13, space)
        limits = random.normal(size=count) + 0.7
    if seed % 4 == 1:
        rows = np.vstack([rows, -rows[:1]])
        limits = np.append(limits, -limits[0])
    if seed % 3 == 0:
        rows = np.vstack([rows, np.eye(space), -np.eye(space)])
        limits = np.append(limits, np.full(2 * space, 3.0))
    return rows, limits


@needs_ppl
@pytest.mark.parametrize("count", [60, pytest.param(1500, marks=pytest.mark.thorough)])
def test_vertices_directions_and_lines_equal_ppl(count: int) -> None:
    import ppl

    for seed in range(count):
        rows, limits = rows_of(seed)
        found = cone.vertices_of(cone.rationals(rows), cone.rationals(limits[None])[0])

        generators = list(polyhedron(rows, limits).minimized_generators())
        entries = [
            [int(one.coefficient(ppl.Variable(i))) for i in range(rows.shape[1])]
            for one in generators
        ]
        pairs = list(zip(generators, entries, strict=True))
        points = {
            tuple(Fraction(x, int(one.divisor())) for x in row)
            for one, row in pairs
            if one.is_point()
        }
        directions = {tuple(row) for one, row in pairs if one.is_ray()}
        assert len(found.points) == len(points), seed
        if not points:
            continue
        assert len(found.lines) == sum(one.is_line() for one in generators), seed
        assert len(found.directions) == len(directions), seed
        if not found.lines:  # modulo lines, points and directions are not unique
            assert {tuple(Fraction(x) for x in point) for point in found.points} == points, seed
            shortest = {
                tuple(cone.whole([fractions.Fraction(x) for x in row])) for row in directions
            }
            assert {
                tuple(cone.whole([fractions.Fraction(x) for x in row])) for row in found.directions
            } == shortest, seed


def test_half_plane_has_a_point_a_direction_and_a_line() -> None:
    found = cone.vertices_of(cone.rationals(np.array([[2.0, 1.0]])), [fractions.Fraction(4)])

    assert len(found.points) == len(found.directions) == len(found.lines) == 1
    x, y = found.points[0]
    assert 2 * x + y == 4
    assert 2 * found.directions[0][0] + found.directions[0][1] < 0
    assert 2 * found.lines[0][0] + found.lines[0][1] == 0


def test_null_space_of_mixed_units_is_exact() -> None:
    matrix = cone.rationals(np.array([[3e-20, 1.0, 0.0], [6e-20, 2.0, 0.0]]))

    basis = cone.null_space(matrix)

    assert len(basis) == 2
    assert all(
        entry == 0 for (entry,) in cone.product(matrix, [[fractions.Fraction(x)] for x in basis[0]])
    )
