"""Batches of polygons, polygons from points, and conversion from and to shapely."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import shapely

from infoset import ConvexPolygons, Polytope
from tests.rationals import Fraction


def boxes(shape: tuple[int, ...]) -> ConvexPolygons:
    """A batch of boxes [0, k + 1] x [0, 1], k counting the batch."""
    widths = np.arange(1.0, math.prod(shape) + 1.0).reshape(shape)
    zeros = np.zeros(shape)
    ones = np.ones(shape)
    corners = [(zeros, zeros), (widths, zeros), (widths, ones), (zeros, ones)]
    return ConvexPolygons(
        np.stack([np.stack(c, axis=-1) for c in corners], axis=-2), np.full(shape, 4)
    )


def square() -> ConvexPolygons:
    return ConvexPolygons.from_box((0.0, 0.0), (1.0, 1.0))


def segment() -> ConvexPolygons:
    return ConvexPolygons([(0.0, 0.0), (3.0, 4.0)], 2)


# Batches
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", [(3,), (2, 3)])
def test_batch_has_the_results_of_its_members(shape: tuple[int, ...]) -> None:
    batch = boxes(shape)
    random = np.random.default_rng(1)
    vectors = random.normal(size=(*shape, 2))
    lower = random.uniform(-0.5, 0.2, shape)
    upper = random.uniform(0.3, 2.0, shape)
    matrices = random.normal(size=(*shape, 2, 2))
    operations: list[Callable[..., Any]] = [
        lambda sets, _, *vector: sets.cut(*vector),
        lambda sets, matrix, *_: sets.linear_map(matrix),
        lambda sets, _, vector, *__: sets.translate(vector),
        lambda sets, _, vector, *__: sets.add_segment(vector),
        lambda sets, matrix, *_: sets.minkowski_sum(sets.linear_map(matrix)),
        lambda sets, _, vector, *__: sets.support_function(vector),
        lambda sets, _, vector, *__: sets.support_vector(vector),
        lambda sets, _, vector, *__: sets.margin(vector),
        lambda sets, *_: sets.centroid(),
    ]
    arguments = (batch, matrices, vectors, lower, upper)
    for operation in operations:
        whole = operation(*arguments)
        for index in np.ndindex(shape):
            many = whole[index]
            alone = operation(*(each[index] for each in arguments))
            if isinstance(alone, ConvexPolygons):
                many = many.polygon()
                alone = alone.polygon()
            np.testing.assert_array_equal(many, alone)


def test_members_of_a_batch_have_any_number_of_vertices() -> None:
    vertices = np.zeros((4, 4, 2))
    vertices[1, 0] = (1.0, 2.0)
    vertices[2, :2] = segment().polygon()
    vertices[3] = square().polygon()
    vertices[0] = np.nan  # padding
    mixed = ConvexPolygons(vertices, [0, 1, 2, 4])

    assert mixed.is_empty.tolist() == [True, False, False, False]
    np.testing.assert_array_equal(mixed.area(), [0.0, 0.0, 0.0, 1.0])
    np.testing.assert_array_equal(mixed.support_function((1.0, 0.0)), [-np.inf, 1.0, 3.0, 1.0])
    assert mixed.contains((1.0, 2.0)).tolist() == [False, True, False, False]
    assert mixed.margin((1.0, 1.0))[0] == -np.inf
    assert mixed.cut((1.0, 0.0), 0.5, 2.0).counts.tolist() == [0, 1, 2, 4]
    assert mixed.linear_map(np.eye(2)).counts.tolist() == [0, 1, 2, 4]
    assert mixed.add_segment((0.0, 1.0)).counts.tolist() == [0, 2, 4, 4]
    assert mixed.minkowski_sum(square()).counts.tolist() == [0, 4, 6, 4]


def test_batch_is_indexed_sliced_masked_and_iterated_over() -> None:
    batch = boxes((2, 3))

    assert len(batch) == 2
    assert batch[1].shape == (3,)
    assert batch[1, 2].area() == 6.0
    assert batch[:, 1:].shape == (2, 2)
    assert batch[batch.area() > 3.0].shape == (3,)
    assert [row.shape for row in batch] == [(3,), (3,)]
    assert [float(one.area()) for one in batch[0]] == [1.0, 2.0, 3.0]
    with pytest.raises(IndexError):
        batch[2]


# Empty sets
# --------------------------------------------------------------------------------------------------


# Here and below a case is a function that returns a set: kernels are compiled when tests run, not
# when they are collected.
@pytest.mark.parametrize(
    "make", [ConvexPolygons.empty, lambda: square().cut((1.0, 0.0), 5.0, 6.0)], ids=["made", "cut"]
)
def test_operations_on_the_empty_set_are_empty(make: Callable[[], ConvexPolygons]) -> None:
    empty = make()

    results = [
        empty.cut((1.0, 0.0), 0.0, 1.0),
        empty.linear_map(np.eye(2)),
        empty.translate((1.0, 1.0)),
        empty.add_segment((1.0, 0.0)),
        empty.minkowski_sum(square()),
        square().minkowski_sum(empty),
        empty.reduce_outward(4),
    ]

    assert all(result.is_empty for result in results)
    assert empty.area() == 0.0
    assert empty.support_function((1.0, 0.0)) == -np.inf
    assert empty.margin((0.0, 0.0)) == -np.inf
    assert not empty.contains((0.0, 0.0))
    assert empty.polygon().shape == (0, 2)


@pytest.mark.parametrize(
    "measure",
    [
        ConvexPolygons.centroid,
        lambda p: np.ma.stack(p.bounding_box()),
        lambda p: p.support_vector((1.0, 0.0)),
    ],
    ids=["centroid", "bounding_box", "support_vector"],
)
def test_point_is_refused_for_the_empty_set_and_masked_for_an_empty_member(
    measure: Callable[[ConvexPolygons], object],
) -> None:
    with pytest.raises(ValueError, match="the empty set has no"):
        measure(ConvexPolygons.empty())

    batch = boxes((3,)).cut((1.0, 0.0), [1.5, 0.0, 0.0], 9.0)
    values: np.ma.MaskedArray[Any, Any] = np.ma.asarray(measure(batch))
    of_last = np.asarray(measure(batch[2]))

    assert np.ma.getmaskarray(values)[..., 0, 0].all()
    assert not np.ma.getmaskarray(values)[..., 1:, :].any()
    np.testing.assert_array_equal(values[..., 2, :], of_last)


def test_results_masked_for_empty_members_are_taken_as_arguments() -> None:
    batch = boxes((3,)).cut((1.0, 0.0), [1.5, 0.0, 0.0], 9.0)
    middle = batch.centroid()

    assert batch.contains(middle).tolist() == [False, True, True]
    assert (batch.margin(middle)[1:] > 0.0).all()
    assert batch.translate(middle).is_empty.tolist() == [True, False, False]

    hidden = np.ma.masked_array(np.zeros((3, 2)), [[False] * 2, [True] * 2, [False] * 2])
    with pytest.raises(TypeError, match="masked"):
        batch.contains(hidden)
    with pytest.raises(TypeError, match="use contains for a batch"):
        assert (0.0, 0.0) in batch


# From points, to shapely and back
# --------------------------------------------------------------------------------------------------


def around(vertices: np.ndarray) -> list[tuple[float, float]]:
    """Vertices from the smallest one on, to compare cycles."""
    corners = [(float(x), float(y)) for x, y in vertices]
    start = corners.index(min(corners))
    return corners[start:] + corners[:start]


def test_from_points_takes_any_order_with_repeats_and_inner_points() -> None:
    corners = [(0.0, 0.0), (4.0, 0.0), (5.0, 2.0), (2.0, 5.0), (0.0, 3.0)]
    random = np.random.default_rng(2)
    for _ in range(20):
        points = random.permutation(corners * 2 + [(2.0, 2.0), (1.0, 1.0), (2.0, 0.0)])
        hull = ConvexPolygons.from_points(points)
        assert around(hull.polygon()) == corners
    assert hull.area() == 17.5


STAR = [(math.cos(turn), math.sin(turn)) for turn in 0.8 * math.pi * np.arange(5)]


@pytest.mark.parametrize(
    ("ring", "vertex"),
    [
        ([(0, 0), (4, 0), (4, 4), (3, 1)], 3),
        ([(0, 0), (0.5, 2.0**-60), (1, 0), (0.5, 1)], 1),
        ([(0, 0), (1, 1), (1, 0), (0, 1)], 0),
        (STAR, 3),
        # a closed ring, whose first vertex is the one that is not convex
        ([(0.5, 0.2), (1, 0), (1, 1), (0, 1), (0, 0), (0.5, 0.2)], 0),
    ],
)
def test_ring_is_refused_if_it_is_not_convex_and_the_constructor_takes_its_hull(
    ring: Any, vertex: int
) -> None:
    with pytest.raises(ValueError, match=f"the ring is not convex: vertex {vertex},"):
        ConvexPolygons.from_vertices(ring)
    with pytest.raises(ValueError, match=rf"vertex {vertex} of polygon \[1\]"):
        ConvexPolygons.from_vertices([[ring[0]] * len(ring), ring])
    assert ConvexPolygons(ring, len(ring)).equals(ConvexPolygons.from_points(ring))


@pytest.mark.parametrize(
    ("points", "wanted"),
    [
        ([], []),
        ([(1.0, 2.0)], [(1.0, 2.0)]),
        ([(1.0, 2.0)] * 3, [(1.0, 2.0)]),
        ([(1.0, 1.0), (0.0, 0.0)], [(0.0, 0.0), (1.0, 1.0)]),
        ([(2.0, 2.0), (0.0, 0.0), (1.0, 1.0), (0.0, 0.0)], [(0.0, 0.0), (2.0, 2.0)]),
        ([(0.0, 3.0), (0.0, 1.0), (0.0, 2.0)], [(0.0, 1.0), (0.0, 3.0)]),
    ],
)
def test_hull_of_points_on_a_line_is_a_segment_or_a_point(
    points: list[tuple[float, float]], wanted: list[tuple[float, float]]
) -> None:
    hull = ConvexPolygons.from_points(points)
    assert hull.shape == ()
    assert sorted(map(tuple, hull.polygon().tolist())) == wanted


@pytest.mark.parametrize(
    ("make", "kind"),
    [
        (ConvexPolygons.empty, "Polygon"),
        (lambda: ConvexPolygons.from_box((1.0, 2.0), (1.0, 2.0)), "Point"),
        (segment, "LineString"),
        (square, "Polygon"),
        (lambda: ConvexPolygons.from_box((1e9, 0.0), (1e9 + 1.0, 1e-9)), "Polygon"),
    ],
)
def test_polygon_from_its_shapely_geometry_is_the_same(
    make: Callable[[], ConvexPolygons], kind: str
) -> None:
    polygon = make()
    geometry = polygon.to_shapely()

    assert geometry.geom_type == kind
    assert geometry.is_empty == polygon.is_empty

    back = ConvexPolygons.from_shapely(geometry)
    assert back.shape == ()
    assert back.counts == polygon.counts
    if polygon.counts:
        assert around(back.polygon()) == around(polygon.polygon())
    assert polygon.area() == pytest.approx(geometry.area)


def test_from_shapely_takes_any_orientation_and_refuses_other_sets() -> None:
    clockwise = shapely.Polygon([(0.0, 0.0), (0.0, 1.0), (1.0, 1.0), (1.0, 0.0)])

    assert ConvexPolygons.from_shapely(clockwise).area() == 1.0
    with pytest.raises(ValueError, match="not convex"):
        ConvexPolygons.from_shapely(
            shapely.Polygon([(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (3.0, 1.0)])
        )
    with pytest.raises(ValueError, match="is needed"):
        ConvexPolygons.from_shapely(shapely.MultiPoint([(0.0, 0.0), (1.0, 0.0)]))
    with pytest.raises(ValueError, match="choose one with an index"):
        boxes((3,)).to_shapely()


@pytest.mark.parametrize("kind", [ConvexPolygons, Polytope])
@pytest.mark.parametrize(
    "value",
    [[(0.0, 0.0), (1.0, 0.0)], "POINT (1 2)", None, shapely.LinearRing([(0, 0), (1, 0), (0, 1)])],
)
def test_from_shapely_refuses_other_geometries_with_the_names_of_possible_ones(
    kind: Any, value: Any
) -> None:
    with pytest.raises(ValueError, match="a Point, a LineString or a Polygon is needed: got"):
        kind.from_shapely(value)


def meets_range(vertices: Any, matrix: Any, offset: Any) -> bool:
    """Whether the line of all matrix p + offset meets a polygon, in rationals."""
    column = matrix[:, 0] if matrix[:, 0].any() else matrix[:, 1]
    u, v = (Fraction(float(entry)) for entry in column)
    x, y = (Fraction(float(entry)) for entry in offset)
    heights = [u * (Fraction(float(b)) - y) - v * (Fraction(float(a)) - x) for a, b in vertices]
    return min(heights) <= 0 <= max(heights)


def test_preimage_under_a_singular_matrix_is_unbounded_if_its_range_meets_the_polygon() -> None:
    """With rounded unit normals it was a triangle with coordinates of 2e16."""
    with pytest.raises(ValueError, match=r"^the preimage is unbounded"):
        ConvexPolygons.from_points([[-1, 2], [0, -1], [1, -1]]).preimage([[3, -1], [6, -2]])


def test_preimage_under_a_singular_matrix_is_empty_if_its_range_misses_the_polygon() -> None:
    """With rounded unit normals it was unbounded."""
    assert (
        ConvexPolygons.from_points([[4, -1], [3, 4], [2, -1]]).preimage([[3, -2], [6, -4]]).is_empty
    )


@pytest.mark.parametrize(
    ("point", "is_empty"), [((0.5, 0.5), False), ((1.0, 1.0), False), ((1.5, 0.5), True)]
)
def test_preimage_under_the_zero_matrix_is_decided_by_the_offset(
    point: tuple[float, float], is_empty: bool
) -> None:
    if is_empty:
        assert square().preimage(np.zeros((2, 2)), point).is_empty
    else:
        with pytest.raises(ValueError, match="unbounded"):
            square().preimage(np.zeros((2, 2)), point)


def test_preimage_of_a_batch_has_empty_members_and_names_an_unbounded_one() -> None:
    regular = np.array([[2.0, 0.0], [0.0, 2.0]])
    singular = np.array([[1.0, 0.0], [0.0, 0.0]])
    batch = boxes((2,))

    missed = batch.preimage([regular, singular], [[0.0, 0.0], [0.0, 5.0]])

    assert missed.is_empty.tolist() == [False, True]
    np.testing.assert_array_equal(missed[0].polygon(), 0.5 * batch[0].polygon())
    with pytest.raises(ValueError, match=r"of polygon \[1\] is unbounded"):
        batch.preimage([regular, singular])


@pytest.mark.parametrize("count", [400, pytest.param(2700, marks=pytest.mark.thorough)])
def test_preimages_under_singular_matrices_are_decided_exactly(count: int) -> None:
    """With rounded unit normals about 2 % of such decisions were wrong."""
    for seed in range(count):
        random = np.random.default_rng(seed)
        polygon = ConvexPolygons.from_points(random.integers(-4, 5, (3, 2)))
        factors = [random.integers(-6, 7, 2).astype(float), random.integers(1, 4, 2).astype(float)]
        if seed % 2:  # floats of many digits: products with powers of two are exactly parallel
            factors = [random.normal(size=2), 2.0 ** random.integers(-3, 4, 2)]
        matrix = np.outer(factors[0], factors[1])
        if not matrix.any():
            continue
        offset = random.integers(-3, 4, 2) if seed % 5 < 3 else random.normal(size=2)

        if meets_range(polygon.polygon(), matrix, offset):
            with pytest.raises(ValueError, match="unbounded"):
                polygon.preimage(matrix, offset)
        else:
            assert polygon.preimage(matrix, offset).is_empty, seed
