"""Zonotopes against exact rational numbers, determinants, linear programs and polytopes."""

from __future__ import annotations

from itertools import combinations, product
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from infoset import ConvexPolygons, Polytope, Zonotope
from infoset.arrays import Floats
from infoset.geometry.polytope import EmptyPolytopeError
from tests.rationals import Fraction

EPS = float(np.finfo(np.float64).eps)
SOME = settings(max_examples=40, deadline=None)


# Oracles
# --------------------------------------------------------------------------------------------------


def exact(numbers: Any) -> list[Fraction]:
    return [Fraction(float(number)) for number in numbers]


def exact_product(one: list[Fraction], two: list[Fraction]) -> Fraction:
    return sum((a * b for a, b in zip(one, two, strict=True)), Fraction(0))


def exact_support(zonotope: Zonotope, direction: list[Fraction]) -> Fraction:
    """Return the support function: d . c + sum of |d . g|."""
    heights = [exact_product(direction, exact(row)) for row in zonotope.generators]
    return exact_product(direction, exact(zonotope.centre)) + sum(map(abs, heights), Fraction(0))


def exact_determinant(rows: list[list[Fraction]]) -> Fraction:
    if not rows:
        return Fraction(1)
    total = Fraction(0)
    for k, entry in enumerate(rows[0]):
        minor = [row[:k] + row[k + 1 :] for row in rows[1:]]
        total += (-1) ** k * entry * exact_determinant(minor)
    return total


def exact_volume(generators: Floats) -> Fraction:
    """Return 2^n times the sum of the determinants of n generators, without signs."""
    rows = [exact(row) for row in generators]
    space = generators.shape[1]
    total = sum(
        (abs(exact_determinant(list(part))) for part in combinations(rows, space)), Fraction(0)
    )
    return Fraction(2**space) * total


def sizes_of(zonotope: Zonotope) -> Floats:
    return np.asarray(np.abs(zonotope.centre) + np.abs(zonotope.generators).sum(axis=0))


def directions_of(zonotope: Zonotope, count: int = 30) -> Floats:
    """Return directions in which all axes of a set count, shape (count, n)."""
    widths = np.abs(zonotope.generators).sum(axis=0)
    return np.random.default_rng(1).normal(size=(count, zonotope.space)) / np.where(
        widths > 0.0, widths, 1.0
    )


def assert_contains_and_fits(outer: Polytope, zonotope: Zonotope, excess: float = 1e-11) -> None:
    """Check that the supports are not below the exact ones, nor above them by more than `excess`.

    Both up to rounding.
    """
    rows = directions_of(zonotope)
    wanted = np.array([float(exact_support(zonotope, exact(row))) for row in rows])
    terms = np.abs(rows) @ sizes_of(zonotope)
    widths = np.abs(rows) @ np.abs(zonotope.generators).sum(axis=0)
    rounding = (2 * zonotope.space + 4) * EPS * terms
    thickness = 1e-11 * widths if outer.dimension < outer.space else 0.0
    got = outer.support_function(rows)
    assert (got >= wanted - rounding - thickness).all()
    assert (got <= wanted + rounding + excess * widths).all()


@st.composite
def whole(draw: st.DrawFn) -> Zonotope:
    """Return a zonotope of small integers in different units.

    Flat sets and parallel generators are frequent.
    """
    space = draw(st.integers(1, 4))
    entries = st.integers(-2, 2)
    rows = draw(st.lists(st.lists(entries, min_size=space, max_size=space), max_size=6))
    units = 10.0 ** np.array(draw(st.lists(st.integers(-6, 6), min_size=space, max_size=space)))
    far = draw(st.sampled_from([0.0, 1.0, 1e4]))
    centre = far * np.array(draw(st.lists(entries, min_size=space, max_size=space)))
    return Zonotope(centre * units, np.array(rows, float).reshape(-1, space) * units)


def rotated_boxes(count: int) -> Zonotope:
    random = np.random.default_rng(0)
    boxes = [
        np.diag(random.uniform(0.1, 1.0, 3)) @ Rotation.random(random_state=k).as_matrix()
        for k in range(count)
    ]
    return Zonotope([1.0, 2.0, 3.0], np.vstack(boxes))


# Operations on generators
# --------------------------------------------------------------------------------------------------


@SOME
@given(whole(), st.integers(1, 4), st.integers(0, 1000))
def test_map_has_the_supports_of_the_set_along_mapped_directions(
    zonotope: Zonotope, rows: int, seed: int
) -> None:
    random = np.random.default_rng(seed)
    matrix = random.normal(size=(rows, zonotope.space))
    offset = random.normal(size=rows)
    image = zonotope.affine_map(matrix, offset)

    assert (image.space, len(image.generators)) == (rows, len(zonotope.generators))

    for direction in random.normal(size=(5, rows)):
        back = [exact_product(exact(direction), exact(column)) for column in matrix.T]
        wanted = exact_support(zonotope, back) + exact_product(exact(direction), exact(offset))
        # Centre and generators are rounded once.
        rounding = EPS * np.abs(direction) @ (np.abs(matrix) @ sizes_of(zonotope) + np.abs(offset))
        assert abs(exact_support(image, exact(direction)) - wanted) <= Fraction(float(rounding))


@SOME
@given(whole())
def test_operators_have_exact_supports(zonotope: Zonotope) -> None:
    direction = exact(directions_of(zonotope, 1)[0])
    opposite = [-entry for entry in direction]
    half = np.arange(1.0, zonotope.space + 1)
    support = exact_support(zonotope, direction)
    length = sum((abs(a * b) for a, b in zip(direction, exact(half), strict=True)), Fraction(0))
    along = abs(exact_product(direction, exact(half)))

    assert exact_support(-zonotope, opposite) == support
    assert exact_support(2 * zonotope, direction) == 2 * support
    assert (
        exact_support(zonotope + Zonotope(0.0 * half, np.diag(half)), direction) == support + length
    )
    assert exact_support(zonotope.enlarged(half), direction) == support + length
    assert exact_support(zonotope.add_segment(half), direction) == support + along
    assert exact_support(zonotope.add_segment(0.0 * half), direction) == support


@SOME
@given(whole())
def test_translation_moves_the_centre(zonotope: Zonotope) -> None:
    moved = zonotope + np.ones(zonotope.space)
    np.testing.assert_array_equal(moved.centre, zonotope.centre + 1.0)
    np.testing.assert_array_equal(moved.generators, zonotope.generators)
    np.testing.assert_array_equal(zonotope.translate(np.ones(zonotope.space)).centre, moved.centre)


def test_projection_takes_axes_in_their_order() -> None:
    zonotope = Zonotope([1, 2, 3], [[1, 0, 0], [0, 2, 0], [1, 1, 1]])
    shadow = zonotope.project([2, 0])

    assert shadow.centre.tolist() == [3.0, 1.0]
    assert shadow.generators.tolist() == [[0.0, 1.0], [1.0, 1.0]]
    assert zonotope.project(1).generators.tolist() == [[2.0], [1.0]]


@SOME
@given(whole())
def test_support_function_and_vector_agree(zonotope: Zonotope) -> None:
    rows = np.vstack([directions_of(zonotope, 3), np.eye(zonotope.space), -np.eye(zonotope.space)])
    supports = zonotope.support_function(rows)
    for row, support in zip(rows, supports, strict=True):
        rounding = (
            (len(zonotope.generators) + zonotope.space + 2) * EPS * np.abs(row) @ sizes_of(zonotope)
        )
        wanted = exact_support(zonotope, exact(row))
        point = zonotope.support_vector(row)
        assert abs(Fraction(float(support)) - wanted) <= Fraction(float(rounding))
        assert abs(exact_product(exact(row), exact(point)) - wanted) <= Fraction(
            float(2.0 * rounding)
        )


def test_support_vector_across_opposite_generators_is_a_vertex() -> None:
    zonotope = Zonotope([0, 0], [[1, 0], [-1, 0], [0, 1]])
    assert zonotope.support_vector([0, 1]).tolist() == [2.0, 1.0]
    assert zonotope.support_vector([0, -1]).tolist() == [2.0, -1.0]


@SOME
@given(whole())
def test_bounding_box_is_the_exact_one_rounded_outward(zonotope: Zonotope) -> None:
    lower, upper = zonotope.bounding_box()
    for axis, unit in enumerate(np.eye(zonotope.space)):
        top = exact_support(zonotope, exact(unit))
        bottom = -exact_support(zonotope, exact(-unit))
        rounding = Fraction(float(2.0 * EPS * sizes_of(zonotope)[axis]))
        assert top <= Fraction(float(upper[axis])) <= top + rounding
        assert bottom - rounding <= Fraction(float(lower[axis])) <= bottom


def test_box_has_its_ends_exactly() -> None:
    lower = [-1.0, 0.0, 2.0]
    upper = [3.0, 0.5, 2.0]
    box = Zonotope.box(lower, upper)

    assert [end.tolist() for end in box.bounding_box()] == [lower, upper]
    assert box.dimension == 2
    assert sorted(box.polytope().vertices.tolist()) == sorted(
        Polytope.from_box(lower, upper).vertices.tolist()
    )


# Polytopes
# --------------------------------------------------------------------------------------------------


@SOME
@given(whole())
def test_polytope_contains_the_zonotope_and_fits_it(zonotope: Zonotope) -> None:
    outer = zonotope.polytope()
    widths = np.abs(zonotope.generators).sum(axis=0)
    units = np.where(widths > 0.0, widths, 1.0)
    rank = (
        int(np.linalg.matrix_rank(zonotope.generators / units)) if len(zonotope.generators) else 0
    )

    assert outer.dimension == zonotope.dimension == rank
    assert_contains_and_fits(outer, zonotope)
    assert zonotope.volume() == pytest.approx(outer.volume(), rel=1e-11)
    if rank == zonotope.space:
        assert zonotope.volume() == pytest.approx(
            float(exact_volume(zonotope.generators)), rel=1e-13
        )


@SOME
@given(whole())
def test_polytope_has_the_vertices_of_the_hull_of_all_sums(zonotope: Zonotope) -> None:
    zonotope = Zonotope(zonotope.centre, zonotope.generators[:4])
    outer = zonotope.polytope()
    count = len(zonotope.generators)
    signs = np.array(list(product([-1.0, 1.0], repeat=count))).reshape(2**count, count)
    hull = Polytope.from_vertices(zonotope.centre + signs @ zonotope.generators)

    assert (len(outer.vertices), len(outer.normals)) == (len(hull.vertices), len(hull.normals))

    # Each vertex is one of the hull, within the movement of vertices and their rounding.
    widths = np.abs(zonotope.generators).sum(axis=0)
    near = 1e-11 * widths + 4.0 * EPS * sizes_of(zonotope)

    for vertex in outer.vertices:
        assert (np.abs(hull.vertices - vertex) <= near).all(axis=1).any()


@pytest.mark.parametrize("count", range(3, 12))
def test_facets_in_general_position_are_spanned_by_all_pairs(count: int) -> None:
    zonotope = Zonotope(np.zeros(3), np.random.default_rng(count).normal(size=(count, 3)))
    outer = zonotope.polytope()

    assert len(outer.normals) == count * (count - 1)
    assert len(outer.vertices) == count * (count - 1) + 2
    assert (outer.incidence.sum(axis=0) == 4).all()
    assert outer.volume() == pytest.approx(float(exact_volume(zonotope.generators)), rel=1e-12)


@pytest.mark.parametrize("count", [2, 3, 5, 8])
def test_facets_hold_for_the_zonotope_exactly(count: int) -> None:
    """The offset of a facet is at least the exact support along its stored normal."""
    for space in (2, 3):
        zonotope = Zonotope(
            np.ones(space) / 3.0, np.random.default_rng(count).normal(size=(count + 1, space))
        )
        outer = zonotope.polytope()
        for facet in outer.facets:
            # a . y <= b with y = (x - centre) / scale is a / scale . x <= b + a / scale . centre.
            row = [a / s for a, s in zip(exact(facet[:-1]), exact(outer.scale), strict=True)]
            level = Fraction(float(facet[-1])) + exact_product(row, exact(outer.centre))
            assert exact_support(zonotope, row) <= level


def test_thirteen_rotated_boxes_have_all_facets() -> None:
    zonotope = rotated_boxes(13)
    outer = zonotope.polytope()

    assert (len(outer.normals), len(outer.vertices)) == (1482, 1484)
    assert outer.volume() == pytest.approx(zonotope.volume(), rel=1e-12)
    assert_contains_and_fits(outer, zonotope, 1e-13)


def test_aligned_boxes_are_one_box() -> None:
    halves = np.random.default_rng(2).integers(1, 9, (13, 3)).astype(float)
    zonotope = Zonotope(np.zeros(3), np.vstack([np.diag(half) for half in halves]))
    outer = zonotope.polytope()
    wanted = Polytope.from_box(-halves.sum(axis=0), halves.sum(axis=0))

    assert sorted(outer.vertices.tolist()) == sorted(wanted.vertices.tolist())
    assert sorted(outer.normals.tolist()) == sorted(wanted.normals.tolist())


@pytest.mark.parametrize("seed", range(12))
def test_generators_in_common_planes_give_facets_of_more_than_four_sides(seed: int) -> None:
    """Rounding moves rotated integers out of their common planes, and no sliver is left."""
    random = np.random.default_rng(seed)
    whole_rows = np.array(
        [[1, 0, 0], [0, 1, 0], [1, 1, 0], [1, -1, 0], [0, 0, 1], [1, 0, 1]], float
    )
    turned = whole_rows @ Rotation.random(random_state=seed).as_matrix()
    plain = Zonotope(np.zeros(3), whole_rows).polytope()
    rotated = Zonotope(random.normal(size=3), turned).polytope()

    assert len(rotated.vertices) == len(plain.vertices)
    assert sorted(rotated.incidence.sum(axis=0)) == sorted(plain.incidence.sum(axis=0))
    assert max(plain.incidence.sum(axis=0)) == 8
    assert rotated.volume() == pytest.approx(float(exact_volume(whole_rows)), rel=1e-12)


@pytest.mark.parametrize("away", [1e-15, 1e-14, 1e-13, 3e-13, 1e-12, 1e-11, 1e-10, 1e-9])
@pytest.mark.parametrize("seed", range(4))
def test_nearly_coplanar_and_parallel_generators_lose_nothing(away: float, seed: int) -> None:
    random = np.random.default_rng(seed)
    rows = np.array([[1, 0, 0], [0, 1, 0], [1, 1, 0], [1, 1, 0], [0, 0, 1], [2, 1, 1]], float)
    zonotope = Zonotope(np.zeros(3), rows + away * random.normal(size=rows.shape))
    outer = zonotope.polytope()

    assert_contains_and_fits(outer, zonotope)
    assert outer.volume() == pytest.approx(float(exact_volume(zonotope.generators)), rel=1e-10)


@pytest.mark.parametrize("thin", [1e-2, 1e-4, 1e-6, 1e-8, 1e-10])
def test_needle_has_the_volume_of_its_determinants(thin: float) -> None:
    """All generators are nearly parallel, and not along an axis."""
    random = np.random.default_rng(5)
    generators = np.outer(random.normal(size=5), [1.0, 0.7, 0.3]) + thin * random.normal(
        size=(5, 3)
    )
    zonotope = Zonotope(np.zeros(3), generators)

    assert zonotope.dimension == 3
    assert zonotope.volume() == pytest.approx(float(exact_volume(generators)), rel=1e-13)

    outer = zonotope.polytope()
    assert (len(outer.normals), len(outer.vertices)) == (20, 22)
    assert_contains_and_fits(outer, zonotope)


FLAT_SETS = [
    # space, generators, dimension, vertices, volume within the affine hull
    (2, [], 0, 1, 1.0),
    (3, [[0, 0, 0]], 0, 1, 1.0),
    (3, [[0, 3, 4]], 1, 2, 10.0),
    (3, [[0, 3, 4], [0, -6, -8]], 1, 2, 30.0),  # parallel
    (3, [[1, 0, 1], [0, 1, 0]], 2, 4, 4.0 * np.sqrt(2.0)),
    (3, [[1, 0, 1], [0, 1, 0], [1, 1, 1]], 2, 6, 12.0 * np.sqrt(2.0)),
    (5, [[1, 0, 0, 0, 0], [0, 1, 0, 1, 0], [0, 0, 0, 0, 2]], 3, 8, 16.0 * np.sqrt(2.0)),
    (
        5,
        [[1, 0, 0, 0, 0], [0, 1, 0, 1, 0], [0, 0, 1, 0, 0], [0, 0, 0, 0, 1]],
        4,
        16,
        16.0 * np.sqrt(2.0),
    ),
]


@pytest.mark.parametrize(("space", "generators", "dimension", "vertices", "volume"), FLAT_SETS)
@pytest.mark.parametrize("far", [0.0, 1.0, 1e6])
def test_flat_zonotope_has_its_dimension_vertices_and_volume(
    space: int,
    generators: list[list[float]],
    dimension: int,
    vertices: int,
    volume: float,
    far: float,
) -> None:
    zonotope = Zonotope(far * np.arange(1.0, space + 1), generators)
    outer = zonotope.polytope()

    assert (zonotope.dimension, outer.dimension) == (dimension, dimension)
    assert (len(zonotope.vertices), len(outer.vertices)) == (vertices, vertices)
    assert zonotope.volume() == pytest.approx(volume, rel=1e-13)
    assert outer.volume() == pytest.approx(volume, rel=1e-11)
    assert_contains_and_fits(outer, zonotope)
    assert zonotope.contains(zonotope.vertices).all()
    assert outer.contains(zonotope.centre)


def test_far_and_small_zonotope_keeps_its_shape() -> None:
    """The set is 1e-12 of its distance wide: vertices are exact in the scaled coordinates."""
    generators = 2.0**-40 * np.array([[1, 0, 0], [0, 1, 0], [1, 1, 1], [0, 1, 2]], float)
    near = Zonotope(np.zeros(3), generators).polytope()
    far = Zonotope([3.0, 5.0, 7.0], generators).polytope()

    assert (len(far.vertices), len(far.normals)) == (len(near.vertices), len(near.normals))
    assert far.volume() == pytest.approx(near.volume(), rel=1e-12)


@pytest.mark.parametrize("size", [2.0**-40, 2.0**-100])
def test_polytope_of_a_small_zonotope_is_a_scaled_one(size: float) -> None:
    """The sum of segments, in four dimensions, finds independent generators of any size."""
    generators = np.random.default_rng(1).uniform(-1.0, 1.0, (6, 4))
    small = Zonotope(np.zeros(4), size * generators).polytope()
    assert (small.vertices == size * Zonotope(np.zeros(4), generators).polytope().vertices).all()


def test_volume_is_computed_by_the_polytope_if_the_subsets_are_many() -> None:
    generators = np.random.default_rng(0).normal(size=(1500, 2))
    zonotope = Zonotope(np.zeros(2), generators)  # 1.1e6 pairs
    pairs = np.abs(np.subtract(*(generators[:, [k]] * generators[None, :, 1 - k] for k in (0, 1))))
    assert zonotope.volume() == pytest.approx(4.0 * np.triu(pairs, 1).sum(), rel=1e-11)


def test_polytope_of_a_zonotope_is_computed_once() -> None:
    zonotope = rotated_boxes(1)
    assert zonotope.polytope() is zonotope.polytope()
    np.testing.assert_array_equal(Polytope.from_zonotope(zonotope).vertices, zonotope.vertices)


@pytest.mark.parametrize("space", [1, 2, 3, 4])
def test_operations_give_the_same_sets_as_polytopes(space: int) -> None:
    random = np.random.default_rng(space)
    one = Zonotope(random.normal(size=space), random.normal(size=(space + 1, space)))
    two = Zonotope(one.centre + 0.1, random.normal(size=(space, space)))
    first = one.polytope()
    second = two.polytope()
    matrix = random.normal(size=(2, space))
    small = Zonotope(np.zeros(space), 0.01 * np.eye(space))

    assert (one + two).polytope().equals(first + second, 1e-11)
    assert (matrix @ one).polytope().equals(matrix @ first, 1e-11)
    assert one.project([0]).polytope().equals(first.project([0]), 1e-11)
    assert (-one).polytope().equals(-first, 1e-11)
    assert (
        one.enlarged(np.full(space, 0.5))
        .polytope()
        .equals(first + Polytope.from_box([-0.5] * space, [0.5] * space), 1e-11)
    )
    for part in (one & two, one & second, first & two, one.intersection(two, second)):
        assert part.equals(first & second, 1e-11)
    assert one.convex_hull(two).equals(first.convex_hull(second), 1e-11)
    assert one.minkowski_difference(small).equals(
        first.minkowski_difference(small.polytope()), 1e-11
    )
    assert small + one.centre <= one
    assert not one <= small
    assert one.equals(Zonotope(one.centre, -one.generators[::-1]), 1e-11)

    points = one.centre + random.normal(size=(3, 2, space))
    np.testing.assert_array_equal(one.margin(points), first.margin(points))
    assert one.centroid() == pytest.approx(first.centroid(), abs=1e-12)
    assert not one.is_empty


def test_area_is_the_volume_of_a_set_of_the_plane() -> None:
    assert Zonotope([1, 2], [[1, 0], [0, 3]]).area() == pytest.approx(12.0)
    assert Zonotope([1, 2], [[1, 1]]).area() == 0.0


def test_sum_with_a_set_of_another_class_is_a_polytope() -> None:
    box = Polytope.from_box([-1.0, -1.0], [2.0, 3.0])

    for found in (
        SQUARE + box,
        box + SQUARE,
        SQUARE + ConvexPolygons.from_box([-1.0, -1.0], [2.0, 3.0]),
    ):
        assert isinstance(found, Polytope)
        assert found.equals(SQUARE.polytope() + box, 1e-12)


def test_plot_returns_the_artists_of_the_polytope() -> None:
    import matplotlib.pyplot as plt

    figure, ax = plt.subplots()
    zonotope = Zonotope([1, 2], [[1, 0], [0, 3], [1, 1]])
    (patch,) = zonotope.plot(ax, alpha=0.5)
    corners = patch.get_path().vertices[:-1]

    assert ConvexPolygons.from_points(corners).area() == pytest.approx(zonotope.volume())
    assert len(corners) == 6
    assert len(zonotope.plot()) == 1
    assert len(ax.patches) == 2

    plt.close(figure)
    with pytest.raises(ValueError, match=r"a set of R\^3 is drawn on axes of 3 dimensions"):
        rotated_boxes(1).plot(ax)


# Membership
# --------------------------------------------------------------------------------------------------


def boundary_points(zonotope: Zonotope, random: np.random.Generator) -> Floats:
    """Return vertices, and the middles of facets.

    In the middle of a facet all generators are at their ends, except the ones in its plane.
    """
    units = np.where(
        np.abs(zonotope.generators).sum(axis=0) > 0.0, np.abs(zonotope.generators).sum(axis=0), 1.0
    )
    rows = zonotope.generators / units
    space = zonotope.space
    found = [zonotope.support_vector(row) for row in directions_of(zonotope, 5)]
    for _ in range(8):
        plane = rows[random.choice(len(rows), space - 1, replace=False)]
        _, values, normals = np.linalg.svd(plane)
        heights = rows @ normals[-1]
        if values.min() > 1e-6:
            signs = np.where(np.abs(heights) > 1e-9, np.sign(heights), 0.0)
            found.append(zonotope.centre + signs @ zonotope.generators)

    return np.array(found)


@pytest.mark.parametrize("seed", range(24))
def test_point_is_inside_if_it_is_on_the_boundary_and_outside_just_beyond(seed: int) -> None:
    random = np.random.default_rng(seed)
    space = 2 + seed % 4
    count = space + int(random.integers(0, 5))
    rows = random.normal(size=(count, space))
    if seed % 3 == 0:  # many faces in common planes
        rows = (
            np.vstack([np.eye(space), random.integers(-1, 2, (count - space, space))])
            @ np.linalg.qr(rows[:space])[0]
        )

    units = 10.0 ** random.integers(-6, 7, space)
    zonotope = Zonotope(random.normal(size=space) * units, rows * units)
    points = boundary_points(zonotope, random)

    assert zonotope.contains(points).all()
    assert zonotope.contains(0.5 * points + 0.5 * points[::-1]).all()
    for factor in (1e-3, 1e-6, 1e-9, 1e-11):
        assert not zonotope.contains(
            zonotope.centre + (1.0 + factor) * (points - zonotope.centre)
        ).any()


@pytest.mark.parametrize("seed", range(8))
def test_membership_agrees_with_linear_programs(seed: int) -> None:
    random = np.random.default_rng(seed)
    space = 3 + seed % 3
    count = 7
    zonotope = Zonotope(random.normal(size=space), random.normal(size=(count, space)))
    points = zonotope.centre + 2.0 * random.normal(size=(20, space))
    inside = zonotope.contains(points)
    for point, is_inside in zip(points, inside, strict=True):
        # min s with |t| <= s and generators' t = point - centre, by the interior-point method.
        rows = np.vstack([np.eye(count), -np.eye(count)])
        optimum = linprog(
            np.eye(count + 1)[-1],
            A_ub=np.column_stack([rows, -np.ones(2 * count)]),
            b_ub=np.zeros(2 * count),
            A_eq=np.column_stack([zonotope.generators.T, np.zeros(space)]),
            b_eq=point - zonotope.centre,
            bounds=(None, None),
            method="highs-ipm",
        )
        assert abs(optimum.fun - 1.0) > 1e-6  # no point of these seeds is so close to the boundary
        assert is_inside == (optimum.fun <= 1.0)


def test_membership_takes_batches_and_single_points() -> None:
    zonotope = Zonotope([0, 0, 0], [[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]])

    assert zonotope.contains(np.zeros((2, 3, 3))).shape == (2, 3)
    assert zonotope.contains(np.zeros((0, 3))).shape == (0,)
    assert np.ones(3) in zonotope
    assert np.array([2.0, 2.0, 2.0]) in zonotope
    assert np.array([2.0, 2.0, -0.5]) not in zonotope
    assert zonotope.contains([2.0, 2.0, -0.5], 0.25)
    assert not zonotope.contains([2.0, 2.0, -0.5], 0.2499)


@pytest.mark.parametrize("rank", [0, 1, 2, 3])
@pytest.mark.parametrize("far", [0.0, 1.0, 1e5])
def test_points_of_a_flat_set_are_inside_and_points_across_are_not(rank: int, far: float) -> None:
    random = np.random.default_rng(rank)
    plane = random.normal(size=(rank, 5))
    zonotope = Zonotope(far * random.normal(size=5), random.normal(size=(6, rank)) @ plane)
    inside = zonotope.centre + random.uniform(-1.0, 1.0, (20, 6)) @ zonotope.generators

    assert zonotope.contains(inside).all()

    across = np.linalg.svd(np.vstack([plane, np.zeros((5, 5))]))[2][-1]
    assert not zonotope.contains(inside + 1e-8 * across).any()


# Outer sets
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", [1, 1.5, 2, 3])
@pytest.mark.parametrize("space", [1, 2, 3, 5])
def test_reduced_zonotope_contains_the_set(space: int, order: float) -> None:
    random = np.random.default_rng(space)
    zonotope = Zonotope(random.normal(size=space), random.normal(size=(6 * space, space)))
    outer = zonotope.reduce_outward(order)

    assert len(outer.generators) <= order * space
    for row in random.normal(size=(20, space)):
        assert exact_support(outer, exact(row)) >= exact_support(zonotope, exact(row))
    # The bounding box is kept, but for rounding.
    for end, wanted in zip(outer.bounding_box(), zonotope.bounding_box(), strict=True):
        assert end == pytest.approx(wanted, rel=1e-14, abs=1e-14 * float(sizes_of(zonotope).max()))


def test_reduction_keeps_few_generators_as_they_are() -> None:
    zonotope = rotated_boxes(2)
    assert zonotope.reduce_outward(2) is zonotope


def test_reduction_does_not_depend_on_units() -> None:
    random = np.random.default_rng(0)
    units = 2.0 ** np.array([-20, 0, 13])
    zonotope = Zonotope(np.zeros(3), random.normal(size=(20, 3)))
    scaled = Zonotope(np.zeros(3), zonotope.generators * units).reduce_outward(3)

    np.testing.assert_array_equal(scaled.generators, zonotope.reduce_outward(3).generators * units)


@pytest.mark.parametrize("seed", range(20))
def test_cut_keeps_all_points_in_the_strips(seed: int) -> None:
    random = np.random.default_rng(seed)
    space = 1 + seed % 4
    count = 1 + seed % 3
    units = 10.0 ** random.integers(-4, 5, space)
    zonotope = Zonotope(
        random.normal(size=space) * units, random.normal(size=(space + 3, space)) * units
    )
    normals = random.normal(size=(count, space)) / units
    ends = random.choice([-1.0, 1.0], size=(400, space + 3))
    ends[::2] = random.uniform(-1.0, 1.0, (200, space + 3))
    points = zonotope.centre + ends @ zonotope.generators
    truth = points[0]
    half = np.abs(random.normal(size=count)) * (random.random(count) < 0.8)
    lower = normals @ truth - half
    upper = normals @ truth + half
    upper[random.random(count) < 0.2] = np.inf
    outer = zonotope.cut(normals, lower, upper, slack_ulp=8.0)
    inside = ((points @ normals.T >= lower) & (points @ normals.T <= upper)).all(axis=1)
    inside[0] = True

    assert outer.contains(points[inside]).all()
    assert np.linalg.norm(outer.generators / units) <= np.linalg.norm(
        zonotope.generators / units
    ) * (1.0 + 1e-9)


def test_gain_of_a_cut_has_the_smallest_sum_of_squares() -> None:
    """The same gain as a least-squares problem: |(I - K C) G|^2 + |K V|^2 over K."""
    random = np.random.default_rng(3)
    zonotope = Zonotope(random.normal(size=3), random.normal(size=(6, 3)))
    normals = random.normal(size=(2, 3))
    half = np.array([0.3, 0.2])
    middle = normals @ zonotope.centre + [0.5, -0.4]
    images = zonotope.generators @ normals.T
    stacked = np.vstack([images, np.diag(half)])
    wanted = np.vstack([zonotope.generators, np.zeros((2, 3))])
    gain = np.linalg.lstsq(stacked, wanted, rcond=None)[0].T
    outer = zonotope.cut(normals, middle - half, middle + half)

    assert outer.centre == pytest.approx(zonotope.centre + gain @ [0.5, -0.4], abs=1e-13)
    assert outer.generators[:6] == pytest.approx(zonotope.generators - images @ gain.T, abs=1e-13)
    assert outer.generators[6:8] == pytest.approx((gain * half).T, abs=1e-13)
    assert np.abs(outer.generators[8:]).max() < 1e-12  # rounding


def test_cut_by_exact_values_of_all_coordinates_is_a_point() -> None:
    zonotope = Zonotope([0, 0, 0], [[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]])
    outer = zonotope.cut(np.eye(3), [0.5, -0.25, 0.125], [0.5, -0.25, 0.125])
    for end in outer.bounding_box():
        assert end == pytest.approx([0.5, -0.25, 0.125], abs=1e-13)


def test_cut_by_the_same_strip_twice_is_in_the_strip() -> None:
    zonotope = rotated_boxes(2)
    normal = np.array([1.0, 2.0, -1.0])
    middle = float(normal @ zonotope.centre)
    twice = zonotope.cut([normal, normal], middle, middle)

    for end in (twice.support_function(normal), -twice.support_function(-normal)):
        assert end == pytest.approx(middle, abs=1e-12)


def test_strips_around_the_set_do_not_change_it() -> None:
    zonotope = rotated_boxes(2)
    assert zonotope.cut([1.0, 0.0, 0.0], -100.0, 100.0) is zonotope
    assert zonotope.cut(np.eye(3)) is zonotope


@pytest.mark.parametrize(("lower", "upper"), [(1.5, 3.0), (-np.inf, -1.5), (0.5, 0.25)])
def test_strip_that_misses_the_set_is_refused(lower: float, upper: float) -> None:
    zonotope = Zonotope([0, 0], [[1, 0], [0, 1]])
    with pytest.raises(EmptyPolytopeError, match="no point of the zonotope is in strip 1, from"):
        zonotope.cut([[0, 1], [1, 0]], [-1.0, lower], [1.0, upper])


# Mistaken arguments
# --------------------------------------------------------------------------------------------------

SQUARE = Zonotope([0, 0], [[1, 0], [0, 1]])


@pytest.mark.parametrize(
    ("operation", "error", "message"),
    [
        (lambda: Zonotope([0, 0], [[1, 0, 0]]), ValueError, "generators must have the shape"),
        (lambda: Zonotope([0, np.nan], []), ValueError, "centre must be finite"),
        (lambda: SQUARE + Zonotope([0], []), ValueError, r"other must be a set in R\^2"),
        (
            lambda: SQUARE.intersection("x"),  # type: ignore[arg-type]
            TypeError,
            r"other must be a set \(ConvexPolygons, Polytope or Zonotope\)",
        ),
        (lambda: SQUARE & rotated_boxes(1), ValueError, r"other must be a set in R\^2"),
        (lambda: SQUARE + np.ones(3), ValueError, r"offset must have the shape \(2,\)"),
        (lambda: np.eye(3) @ SQUARE, ValueError, "matrix must have the shape"),
        (lambda: SQUARE.enlarged([-1, 0]), ValueError, "by must be at least 0"),
        (lambda: SQUARE.reduce_outward(0.5), ValueError, "order must be at least 1"),
        (lambda: SQUARE.project(2), ValueError, "axes must be one or more different numbers"),
        (lambda: SQUARE.contains([1, 2, 3]), ValueError, "points must have the shape"),
        (lambda: SQUARE.cut([1, 2, 3], 0, 1), ValueError, "normals must have the shape"),
        (lambda: SQUARE.cut([1, 0], np.nan, 1), ValueError, "lower must be a number"),
        (
            lambda: Polytope.from_zonotope([0, 0]),  # type: ignore[arg-type]
            TypeError,
            "zonotope must be of the type Zonotope",
        ),
        (
            lambda: ConvexPolygons.from_zonotope(rotated_boxes(1)),
            ValueError,
            r"zonotope must be in R\^2",
        ),
    ],
)
def test_mistaken_arguments_are_refused(
    operation: Any, error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        operation()
