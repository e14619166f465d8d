"""Nearest points of far sets against exact rationals."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from infoset.arrays import Floats
from infoset.geometry.polytope import Polytope, nearest_pair
from tests.rationals import Fraction

MAX_ERROR = 1e-12
"""Of the size of the set, as documented; coordinates of the sets here are of their size."""


def solved(matrix: list[list[Fraction]], right: list[Fraction]) -> list[Fraction] | None:
    """The exact solution of linear equations; None if the matrix is singular."""
    table = [[*row, value] for row, value in zip(matrix, right, strict=True)]
    for column in range(len(table)):
        pivot = next((row for row in range(column, len(table)) if table[row][column] != 0), None)
        if pivot is None:
            return None
        table[column], table[pivot] = table[pivot], table[column]
        for row in range(len(table)):
            if row != column:
                factor = table[row][column] / table[column][column]
                table[row] = [
                    a - factor * b for a, b in zip(table[row], table[column], strict=True)
                ]
    return [row[-1] / row[i] for i, row in enumerate(table)]


def dot(one: list[Fraction], two: list[Fraction]) -> Fraction:
    return sum((a * b for a, b in zip(one, two, strict=True)), Fraction(0))


def exact_closest(vertices: Floats, point: Floats) -> Floats:
    """The combination of at most n vertices that satisfies the conditions of optimality."""
    start = [Fraction(float(value)) for value in point]
    steps = [
        [Fraction(float(a)) - b for a, b in zip(vertex, start, strict=True)] for vertex in vertices
    ]
    for size in range(1, len(start) + 1):
        for chosen in itertools.combinations(range(len(steps)), size):
            first = steps[chosen[0]]
            edges = [[a - b for a, b in zip(steps[k], first, strict=True)] for k in chosen[1:]]
            shares = solved(
                [[dot(a, b) for a in edges] for b in edges], [-dot(edge, first) for edge in edges]
            )
            if shares is None or any(share < 0 for share in shares) or sum(shares) > 1:
                continue
            least = list(first)
            for share, edge in zip(shares, edges, strict=True):
                least = [a + share * b for a, b in zip(least, edge, strict=True)]
            if all(dot(least, step) >= dot(least, least) for step in steps):
                return np.array([float(a + b) for a, b in zip(least, start, strict=True)])
    return point


@pytest.mark.parametrize("far", [1.0, 1e4, 1e9, 1e12])
def test_closest_point_of_a_tetrahedron_to_a_point_ahead_is_the_middle_of_its_face(
    far: float,
) -> None:
    """From 1e9 it was a vertex: rounding of the distance hid the differences of the vertices."""
    corners = Polytope.from_vertices([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])

    np.testing.assert_allclose(
        corners.closest_point([far] * 3), [1.0 / 3.0] * 3, rtol=0.0, atol=MAX_ERROR
    )


@pytest.mark.parametrize("count", [100, pytest.param(1500, marks=pytest.mark.thorough)])
def test_closest_points_to_far_points_are_exact(count: int) -> None:
    """Formerly 398 of 1500 were wrong by over 1e-9 of the size."""
    for seed in range(count):
        random = np.random.default_rng(seed)
        space = int(random.integers(2, 5))
        points = random.normal(size=(space + 3, space))
        if seed % 3 == 0:
            points = random.integers(-3, 4, points.shape).astype(float)
        one = Polytope.from_vertices(points)
        direction = (
            random.normal(size=space) if seed % 2 else random.integers(-1, 2, space).astype(float)
        )
        far = direction * 10.0 ** random.uniform(0.0, 12.0)

        wanted = exact_closest(one.vertices, far)

        error = float(np.abs(one.closest_point(far) - wanted).max())
        assert error <= MAX_ERROR * float(np.ptp(points, axis=0).max()), seed


@pytest.mark.parametrize("far", [0.0, 1e6, 1e9])
def test_distance_of_far_sets_equals_the_distance_of_their_faces(far: float) -> None:
    """Two unit cubes, the second one moved along two axes: two parallel edges are nearest."""
    cube = np.array(list(itertools.product([0.0, 1.0], repeat=3)))

    pair = nearest_pair(cube, cube + np.array([far + 2.0, 0.0, far + 2.0]))

    # The edges x = z = 1 and x = z = far + 2 face each other: any two points of them with the same
    # y are nearest.
    np.testing.assert_array_equal(pair.difference[[0, 2]], [-far - 1.0, -far - 1.0])
    np.testing.assert_array_equal(pair.point[[0, 2]], [1.0, 1.0])
    assert abs(pair.difference[1]) <= MAX_ERROR


def test_nearest_points_of_sets_that_meet_coincide() -> None:
    random = np.random.default_rng(0)
    one = random.normal(size=(30, 3))
    two = random.normal(size=(30, 3))

    pair = nearest_pair(one, two)

    assert np.abs(pair.difference).max() <= 1e-13
