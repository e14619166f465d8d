"""Cuts and sums by incidence against hulls of all candidate points, on polytopes with many coincidences."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from infoset.arrays import Floats
from infoset.geometry.polytope import Polytope
from infoset.geometry.polytope.double_description import FacetsAndVertices
from tests.infoset.geometry.polytope.test_published_polytopes import exact_vertices
from tests.rationals import Fraction

small = st.integers(-3, 3).map(float)
SOME = settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])


def vectors(size: int) -> st.SearchStrategy[list[float]]:
    return st.lists(small, min_size=size, max_size=size)


def supports(points: Floats, directions: Floats) -> Floats:
    return np.asarray((points @ directions.T).max(axis=0))


def directions(size: int) -> Floats:
    grid = np.array(np.meshgrid(*[[-1.0, 0.0, 0.5, 2.0]] * size)).reshape(size, -1).T
    return np.asarray(grid[np.any(grid, axis=1)])


def is_consistent(shape: FacetsAndVertices) -> bool:
    heights = shape.vertices @ shape.normals.T - shape.offsets
    return bool((heights <= 1e-12).all() and (np.abs(heights[shape.incidence]) <= 1e-12).all())


@SOME
@given(st.data(), st.sampled_from([1, 2, 3, 4]))
def test_a_sum_with_segments_has_the_supports_of_its_terms(data: st.DataObject, size: int) -> None:
    shape = FacetsAndVertices.of(Polytope.from_box(-np.ones(size), np.ones(size)))
    segments = data.draw(st.lists(vectors(size), min_size=1, max_size=4))
    wanted = np.abs(directions(size)).sum(axis=1)
    for half in segments:
        shape = shape.plus_segment(np.array(half))
        wanted = wanted + np.abs(directions(size) @ half)
        assert is_consistent(shape)
    np.testing.assert_allclose(supports(shape.vertices, directions(size)), wanted, rtol=0.0, atol=1e-12)


@SOME
@given(st.data(), st.sampled_from([2, 3, 4]))
def test_cuts_have_the_vertices_of_exact_rational_arithmetic(data: st.DataObject, size: int) -> None:
    rows = [[float(i == j) * sign for j in range(size)] for i in range(size) for sign in (1, -1)]
    limits = [3.0] * (2 * size)
    shape: FacetsAndVertices | None = FacetsAndVertices.of(Polytope.from_box([-3.0] * size, [3.0] * size))
    for normal in data.draw(st.lists(vectors(size).filter(any), min_size=1, max_size=4)):
        # The center stays inside, so that the set has full dimension.
        level = data.draw(st.sampled_from([0.5, 1.0, 2.0, 3.0, 6.0]))
        assert shape is not None
        shape, _ = shape.cut(np.array(normal), level)
        rows.append(normal)
        limits.append(level)
    assert shape is not None
    assert is_consistent(shape)
    sides = [tuple(map(Fraction, (limit, *(-x for x in row)))) for row, limit in zip(rows, limits, strict=True)]
    exact = sorted(tuple(round(float(x), 9) + 0.0 for x in vertex) for vertex in exact_vertices(sides, []))
    ours = sorted({tuple(round(value, 9) + 0.0 for value in vertex) for vertex in shape.vertices.tolist()})
    np.testing.assert_allclose(ours, exact, rtol=0.0, atol=2e-9)
    assert len(ours) == len(exact)


def test_an_empty_cut_tells_its_excess() -> None:
    shape = FacetsAndVertices.of(Polytope.from_box([0.0, 0.0, 0.0], [1.0, 1.0, 1.0]))
    nothing, lowest = shape.cut(np.array([1.0, 1.0, 0.0]), -0.5)
    assert nothing is None
    assert lowest == pytest.approx(0.5)
    everything, _ = shape.cut(np.array([1.0, 1.0, 0.0]), 2.0)
    assert everything is shape


def test_a_plane_that_touches_the_set_keeps_a_layer() -> None:
    shape = FacetsAndVertices.of(Polytope.from_box([0.0, 0.0, 0.0], [1.0, 1.0, 1.0]))
    layer, _ = shape.cut(np.array([1.0, 0.0, 0.0]), 0.0)
    assert layer is not None
    assert 0.0 < float(layer.vertices[:, 0].max()) <= 2e-7
    assert is_consistent(layer)


def test_flat_sets_and_singular_images_get_a_thickness() -> None:
    flat = FacetsAndVertices.of(Polytope.from_box([1.0, 0.0, 0.0], [1.0, 1.0, 1.0]))
    assert flat.vertices.shape == (8, 3)
    assert is_consistent(flat)
    assert 1e-8 <= float(np.ptp(flat.vertices[:, 0])) <= 1e-7
    image = flat.affine_image(np.diag([1.0, 1.0, 0.0]), np.zeros(3))
    assert is_consistent(image)
    np.testing.assert_allclose(image.vertices[:, 2], 0.0, atol=1e-5)


@pytest.mark.parametrize("seed", range(12))
def test_a_flat_set_whose_coordinates_are_rounding_errors_is_consistent(seed: int) -> None:
    """A square that is turned and turned back. Formerly exact rational heights of vertices were far beyond facets."""
    turn = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    square = turn.T @ (turn @ Polytope.from_box([-1.0, -1.0, 0.0], [1.0, 1.0, 0.0]))
    shape = FacetsAndVertices.of(square)
    vertices = [[Fraction(x) for x in vertex] for vertex in shape.vertices.tolist()]
    for normal, offset, on in zip(shape.normals.tolist(), shape.offsets.tolist(), shape.incidence.T, strict=True):
        heights = [sum(Fraction(n) * x for n, x in zip(normal, vertex, strict=True)) for vertex in vertices]
        depth = max(heights) - min(heights)
        away = [(height - Fraction(offset)) / depth for height in heights]
        assert max(away) <= 1e-6
        assert min(each for each, lies_on in zip(away, on, strict=True) if lies_on) >= -1e-6
