"""Invariants of the double description, and sets that were wrong or refused before it was one."""

from __future__ import annotations

import numpy as np
import pytest

from infoset.geometry.polytope import Polytope
from infoset.geometry.polytope.incidence import packed, unpacked


def test_vertices_are_the_points_bit_for_bit() -> None:
    points = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    np.testing.assert_array_equal(Polytope.from_vertices(points).vertices, points)

    # All points of a simplex are vertices.
    random = np.random.default_rng(0)
    for far in (0.0, 1e3, 1e9):
        simplex = far + random.normal(size=(5, 4))
        np.testing.assert_array_equal(Polytope.from_vertices(simplex).vertices, simplex)


@pytest.mark.parametrize("matrix", [[[1.0], [2.0]], [[0.3], [0.1]], [[1e-6], [1e6]]])
def test_preimage_of_a_flat_set_under_a_tall_matrix_is_the_set(
    matrix: list[list[float]],
) -> None:
    interval = Polytope.from_box([0.0], [1.0])
    back = interval.linear_map(matrix).preimage(matrix)
    np.testing.assert_allclose(np.sort(back.vertices, axis=0), [[0.0], [1.0]], rtol=0.0, atol=1e-12)


@pytest.mark.parametrize(("points", "space"), [(14, 5), (14, 6)])
def test_gaussian_polytopes_of_five_and_six_dimensions_intersect(points: int, space: int) -> None:
    random = np.random.default_rng([5, points, 0])
    one = Polytope.from_vertices(random.normal(size=(points, space)))
    two = Polytope.from_vertices(random.normal(size=(points, space)) * 0.8)
    both = one & two
    assert space == 6 or len(both.vertices) == 516
    assert both.is_subset(one, 1e-12)
    assert both.is_subset(two, 1e-12)
    inside = random.normal(size=(2000, space)) * 0.3
    np.testing.assert_array_equal(
        both.contains(inside), one.contains(inside) & two.contains(inside)
    )


def test_sets_that_touch_in_a_vertex_meet_in_it() -> None:
    one = Polytope.from_vertices([(1, 0), (2, -3), (0, 1), (2, -2)])
    two = Polytope.from_vertices([(1, 0), (7, 0)])
    np.testing.assert_allclose((one & two).vertices, [[1.0, 0.0]], rtol=0.0, atol=1e-15)


@pytest.mark.parametrize("space", [2, 3, 4, 5])
def test_incidence_agrees_with_vertices_and_facets(space: int) -> None:
    """A sum of segments, cut and mapped: vertices are on the facets of their bits to 1e-11."""
    random = np.random.default_rng(space)
    one = Polytope.from_box(-np.ones(space), np.ones(space))
    for _ in range(3):
        one = one.add_segment(random.normal(size=space)).cut(random.normal(size=space), -1.0, 2.0)
        one = one.affine_map(random.normal(size=(space, space)), random.normal(size=space))
    heights = one.points @ one.facets[:, :-1].T - one.facets[:, -1]
    on = one.incidence
    assert float(np.abs(heights[on]).max()) <= 1e-11
    assert float(heights[~on].max()) < -1e-12
    assert on.sum(axis=1).min() >= space
    assert on.sum(axis=0).min() >= space


def test_flags_are_packed_and_unpacked() -> None:
    flags = np.random.default_rng(0).random((70, 130)) < 0.5
    np.testing.assert_array_equal(unpacked(packed(flags), 130), flags)
    np.testing.assert_array_equal(
        packed(flags).view(np.uint8)[:, :17], np.packbits(flags, axis=1, bitorder="little")
    )
