from __future__ import annotations

import itertools
from importlib.util import find_spec

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from infoset import Zonotope
from infoset.arrays import Floats
from infoset.geometry.polytope import (
    EmptyPolytopeError,
    Polytope,
    UnboundedPolytopeError,
    polytope_from_support,
    product,
)
from tests.rendezvous.reachability.rationals import rational_hull, rational_intersection

needs_ppl = pytest.mark.skipif(
    find_spec("ppl") is None, reason="needs the extra exact: pip install '.[exact]'"
)


def random_points(seed: int, count: int, size: int, rank: int) -> Floats:
    """Points that span `rank` dimensions of R^size, each direction of another length."""
    generator = np.random.default_rng(seed)
    spread = generator.standard_normal((count, rank)) * 10.0 ** generator.uniform(-2, 2, rank)
    turn = np.linalg.qr(generator.standard_normal((size, size)))[0]
    return np.asarray(spread @ turn[:rank] + generator.standard_normal(size))


def directions(seed: int, size: int, count: int = 50) -> Floats:
    found = np.random.default_rng(seed).standard_normal((count, size))
    return np.asarray(found / np.linalg.norm(found, axis=1)[:, None])


def test_flat_box_point_and_segment_have_measures_of_their_dimension() -> None:
    flat = Polytope.from_box([0.0, 1.0, 2.0], [1.0, 1.0, 4.0])
    assert (len(flat.vertices), len(flat.normals), flat.dimension, flat.space) == (4, 4, 2, 3)
    assert flat.volume() == pytest.approx(2.0)
    assert flat.margin([0.5, 1.1, 3.0]) == pytest.approx(-0.1)

    point = Polytope.from_vertices([[1.0, 2.0]])
    assert (point.dimension, point.volume(), len(point.normals)) == (0, 1.0, 0)

    segment = Polytope.from_vertices([[0.0, 0.0], [3.0, 4.0], [1.5, 2.0]])
    assert (segment.dimension, len(segment.vertices), len(segment.normals)) == (1, 2, 2)
    assert segment.volume() == pytest.approx(5.0)


@pytest.mark.parametrize("size", [2, 3, 4, 5])
def test_cross_polytope_and_simplex_have_known_numbers_of_vertices_and_facets(size: int) -> None:
    cross = Polytope.from_vertices(np.vstack([np.eye(size), -np.eye(size)]))
    assert (len(cross.vertices), len(cross.normals)) == (2 * size, 2**size)

    simplex = Polytope.from_constraints(
        np.vstack([-np.eye(size), np.ones((1, size))]), [*[0.0] * size, 1.0]
    )
    assert (len(simplex.vertices), len(simplex.normals)) == (size + 1, size + 1)
    assert simplex.volume() == pytest.approx(1.0 / np.prod(np.arange(1, size + 1)))


def test_redundant_points_and_half_spaces_are_left_out() -> None:
    grid = np.array(list(itertools.product([0.0, 0.5, 1.0], repeat=3)))
    cube = Polytope.from_vertices(np.vstack([grid, grid]))
    assert (len(cube.vertices), len(cube.normals)) == (8, 6)

    rows = np.vstack([np.eye(3), -np.eye(3), np.ones((1, 3)), np.eye(3)])
    again = Polytope.from_constraints(rows, [1, 1, 1, 0, 0, 0, 3, 1, 5, 1])
    assert (len(again.vertices), len(again.normals)) == (8, 6)


@needs_ppl
@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    size=st.integers(2, 6),
    flat=st.integers(0, 3),
    extra=st.integers(1, 8),
)
def test_hull_equals_the_exact_hull(seed: int, size: int, flat: int, extra: int) -> None:
    rank = max(1, size - flat)
    points = random_points(seed, rank + extra, size, rank)
    hull = Polytope.from_vertices(points)
    assert hull.dimension == rank
    # Every point is inside, and the supports of the hull are the supports of the points.
    assert float(hull.margin(points).min()) > -1e-9 * np.abs(points).max()
    found = directions(seed, size)
    np.testing.assert_allclose(
        hull.support_function(found),
        (points @ found.T).max(axis=0),
        atol=1e-9 * np.abs(points).max(),
    )
    # Floats that are flat only to rounding are not flat in rationals.
    if rank == size:
        exact = rational_hull(points)
        assert (len(hull.vertices), len(hull.normals)) == (len(exact.vertices), exact.facets)


@needs_ppl
@settings(max_examples=20, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    size=st.integers(2, 6),
    rank=st.integers(1, 5),
    extra=st.integers(1, 6),
)
def test_flat_hull_equals_the_exact_hull(seed: int, size: int, rank: int, extra: int) -> None:
    generator = np.random.default_rng(seed)
    rank = min(rank, size)
    points = (
        generator.integers(-9, 10, (rank + extra, rank)) @ generator.integers(-9, 10, (rank, size))
    ).astype(float)
    exact = rational_hull(points)
    hull = Polytope.from_vertices(points)
    facets = 0 if hull.dimension == 0 else len(hull.normals)
    assert (hull.dimension, len(hull.vertices), facets) == (
        exact.dimension,
        len(exact.vertices),
        exact.facets,
    )


@needs_ppl
@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6), size=st.integers(2, 5), count=st.integers(1, 8))
@example(seed=1219, size=5, count=6)
@example(seed=1374, size=5, count=2)
@example(seed=1477, size=5, count=6)
def test_intersection_of_half_spaces_equals_the_exact_one(seed: int, size: int, count: int) -> None:
    generator = np.random.default_rng(seed)
    rows = np.vstack([np.eye(size), -np.eye(size), generator.standard_normal((count, size))])
    limits = np.concatenate([np.ones(2 * size), generator.uniform(0.05, 1.0, count)])
    found = Polytope.from_constraints(rows, limits)
    exact = rational_intersection(rows, limits)
    assert (len(found.vertices), len(found.normals)) == (len(exact.vertices), exact.facets)
    np.testing.assert_allclose(np.stack(found.bounding_box(), axis=-1), exact.bounds, atol=1e-9)
    # The vertices are rounded: their hull may have more facets, but is the same set.
    again = Polytope.from_vertices(found.vertices)
    assert len(again.vertices) == len(found.vertices)
    assert again.equals(found, 1e-12)


def test_flat_sets_meet_in_flat_sets() -> None:
    square = Polytope.from_box([-1.0, -1.0, 0.0], [1.0, 1.0, 0.0])
    other = Polytope.from_box([0.0, -1.0, -1.0], [0.0, 1.0, 1.0])
    line = square.intersection(other)
    assert (line.dimension, len(line.vertices)) == (1, 2)

    # The equations of the face are hidden in half-spaces.
    cube = Polytope.from_box([0.0, 0.0, 0.0], [1.0, 1.0, 1.0])
    touching = Polytope.from_box([1.0, 0.0, 0.0], [2.0, 1.0, 1.0])
    face = cube.intersection(touching)
    assert (face.dimension, len(face.vertices)) == (2, 4)
    corner = cube.intersection(Polytope.from_box([1.0, 1.0, 1.0], [2.0, 2.0, 2.0]))
    assert corner.dimension == 0
    np.testing.assert_allclose(corner.vertices, [[1.0, 1.0, 1.0]], atol=1e-12)


def test_nearly_parallel_facets_stay_two_facets() -> None:
    # A corner cut off by a plane that turns by little: each vertex is a real one.
    rows = np.array([[1.0, 0.0], [1.0, 1e-6], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    found = Polytope.from_constraints(rows, [1.0, 1.0, 1.0, 1.0, 1.0])
    assert (len(found.vertices), len(found.normals)) == (5, 5)


def test_cut_and_product_have_known_volumes() -> None:
    cube = Polytope.from_box([-1.0] * 3, [1.0] * 3)
    half = cube.cut([[1.0, 0.0, 0.0]], upper=[0.0])
    assert half.volume() == pytest.approx(4.0)
    assert cube.cut([[1.0, 1.0, 1.0]], upper=[5.0]) is cube
    assert cube.cut([[1.0, 0.0, 0.0]], upper=[-2.0]).is_empty

    both = product(
        Polytope.from_box([0.0], [1.0]),
        Polytope.from_vertices([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]),
    )
    assert (len(both.vertices), len(both.normals)) == (6, 5)
    assert both.volume() == pytest.approx(0.5)


@pytest.mark.parametrize("size", [2, 3])
def test_projection_by_supports_is_the_projection(size: int) -> None:
    solid = Polytope.from_vertices(random_points(3, 30, 5, 5))

    def furthest(direction: Floats) -> Floats:
        return solid.support_vector(np.concatenate([direction, np.zeros(5 - size)]))[:size]

    found = polytope_from_support(furthest, size)
    expected = solid.project(range(size))
    assert (len(found.vertices), len(found.normals)) == (
        len(expected.vertices),
        len(expected.normals),
    )
    seen = directions(1, size)
    np.testing.assert_allclose(
        found.support_function(seen),
        expected.support_function(seen),
        atol=1e-9 * np.abs(solid.vertices).max(),
    )


def test_projection_by_supports_of_a_flat_set_is_flat_and_of_a_disc_is_refused() -> None:
    flat = Polytope.from_vertices([[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]])
    assert polytope_from_support(flat.support_vector, 3).dimension == 2
    with pytest.raises(ArithmeticError, match="over 20 facets"):
        polytope_from_support(
            lambda direction: direction / np.linalg.norm(direction), 2, max_facets=20
        )


@pytest.mark.parametrize("junk", [0.0, 1e-17, -1e-17])
def test_row_that_is_the_rounding_of_zero_is_ignored(junk: float) -> None:
    rows = np.vstack([np.eye(3), -np.eye(3), [[0.0, junk, -junk]], np.zeros((1, 3))])
    limits = np.concatenate([np.ones(6), [-1e-17, -1e-16]])
    found = Polytope.from_constraints(rows, limits)
    assert found.dimension == 3
    assert len(found.vertices) == 8


@pytest.mark.parametrize("far", [1e3, 1e6, 1e9, 1e12, 1e15])
def test_far_constraint_does_not_change_a_set(far: float) -> None:
    """It once made the unit cube count as flat, and then as empty."""
    unit = np.eye(3)
    rows = np.vstack([unit, -unit, [[1.0, 0.0, 0.0], [1.0, 1.0, 0.0]]])
    cube = Polytope.from_constraints(rows, [1.0, 1.0, 1.0, 0.0, 0.0, 0.0, far, far])
    assert len(cube.vertices) == 8
    assert cube.volume() == pytest.approx(1.0, rel=1e-12)


def test_cut_in_units_that_differ_by_1e30_is_precise() -> None:
    """Formerly an error: the sizes differed too much for a hull."""
    units = np.array([1e15, 1.0, 1e-15])
    row = np.array([0.5, -0.7, -0.2])
    plain = Polytope.from_box(np.zeros(3), np.ones(3)).cut(row, upper=-0.2)
    cut = Polytope.from_box(np.zeros(3), units).cut(row / units, upper=-0.2)
    assert len(cut.vertices) == len(plain.vertices)
    assert np.sort(cut.vertices / units, axis=0) == pytest.approx(
        np.sort(plain.vertices, axis=0), abs=1e-12
    )


FLAT_SETS = {
    "triangle": [[0.0, 0.0, 0.0], [4.0, 0.0, 8.0], [0.0, 4.0, -4.0]],
    "parallel to axes": [[0.0, 3.0, 0.0], [4.0, 3.0, 8.0], [0.0, 3.0, -4.0], [8.0, 3.0, 0.0]],
    "segment": [[-4.0, 8.0, 2.0], [4.0, 0.0, -6.0]],
    "point": [[1.0, 2.0, 3.0]],
    "solid": [[0.0, 0.0, 0.0], [8.0, 0.0, 4.0], [0.0, 8.0, 0.0], [4.0, 0.0, -8.0], [3.0, 5.0, 7.0]],
}


UNITS = np.array([2.0**13, 1.0, 2.0**-13])
FAR = 1e6
ORIGIN = FAR * np.array([1.0, -2.0, 1.0])
NEAR = 1e-9 + 1e-13 * FAR
"""Distance of coordinates that are equal, in the units."""


@pytest.mark.parametrize("name", FLAT_SETS)
def test_operations_on_flat_sets_in_mixed_units_far_from_the_origin_are_precise(name: str) -> None:
    """Formerly most operations on flat sets whose units differ by 1e8 lost vertices, or gave points
    or no set.
    """
    points = np.array(FLAT_SETS[name])
    # The same set at the origin with equal units is the reference.
    plain = Polytope.from_vertices(points)
    other = Polytope.from_vertices((points + ORIGIN) * UNITS)
    cube = Polytope.from_box(np.full(3, -2.0), np.full(3, 2.0))
    box = Polytope.from_box(-2.0 * UNITS, 2.0 * UNITS)
    centre = points.mean(axis=0).round(2)
    around = (centre + ORIGIN) * UNITS
    normal = np.array([1.0, 2.0, -1.0])
    level = float(normal @ centre)
    far_level = float(normal @ (centre + ORIGIN))
    matrix = np.array([[1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 1.0]])
    unscaled = UNITS[:, None] * matrix / UNITS

    equations = other.normals, other.offsets, other.across, other.levels
    pairs = [
        (plain, other),
        (plain, Polytope.from_constraints(*other.constraints())),
        (plain, Polytope.from_constraints(*equations)),
        (plain, other & other),
        (plain & cube.translate(centre), other & box.translate(around)),
        (plain + cube, other + box),
        (plain, (other + box).minkowski_difference(box)),
        (plain.cut(normal, upper=level), other.cut(normal / UNITS, upper=far_level)),
        (plain.cut(normal, level, level), other.cut(normal / UNITS, far_level, far_level)),
        (plain, other.affine_map(unscaled).preimage(unscaled)),
    ]
    for wanted, got in pairs:
        assert got.dimension == wanted.dimension
        vertices = (got.vertices / UNITS - ORIGIN)[:, None]
        apart = np.abs(vertices - wanted.vertices).max(axis=2)
        # A cut at a vertex may leave two vertices near each other.
        assert max(apart.min(axis=0).max(), apart.min(axis=1).max()) < NEAR
        assert got.contains(got.vertices).all()
        assert not got.contains((2.0 * points.max(axis=0) + 1.0 + ORIGIN) * UNITS)


@pytest.mark.parametrize("axes", [[0], [1, 2]])
@pytest.mark.parametrize("name", FLAT_SETS)
def test_slices_of_flat_sets_in_mixed_units_far_from_the_origin_are_precise(
    name: str, axes: list[int]
) -> None:
    points = np.array(FLAT_SETS[name])
    plain = Polytope.from_vertices(points)
    other = Polytope.from_vertices((points + ORIGIN) * UNITS)
    centre = points.mean(axis=0).round(2)
    around = (centre + ORIGIN) * UNITS

    wanted = plain.slice(axes, centre[axes])
    got = other.slice(axes, around[axes])

    assert got.dimension == wanted.dimension
    if not got.is_empty:
        rest = np.delete(np.arange(3), axes)
        ends = np.array(got.bounding_box()) / UNITS[rest] - ORIGIN[rest]
        assert ends == pytest.approx(np.array(wanted.bounding_box()), abs=NEAR)


@pytest.mark.parametrize("name", FLAT_SETS)
def test_measures_of_flat_sets_in_mixed_units_far_from_the_origin_are_precise(name: str) -> None:
    points = np.array(FLAT_SETS[name])
    dimension = Polytope.from_vertices(points).dimension
    one = Polytope.from_vertices((points + ORIGIN) * UNITS)

    is_simplex = len(one.vertices) == dimension + 1
    if is_simplex:
        edges = np.array(one.vertices[1:] - one.vertices[0])
        stretch = np.sqrt(max(np.linalg.det(edges @ edges.T), 0.0))
        volume = stretch / [1.0, 1.0, 2.0, 6.0][dimension]
        assert one.volume() == pytest.approx(volume, rel=1e-7)
    middle, radius = one.chebyshev_centre()
    assert one.contains(middle, 1e-9 * float(UNITS.max()))
    assert (radius > 0.0) == (dimension > 0)
    depth = float((one.offsets - one.normals @ middle).min(initial=np.inf))
    assert depth >= radius * (1.0 - 1e-6) - 1e-9 * FAR


@pytest.mark.parametrize("seed", range(10))
def test_coordinates_that_are_equal_at_all_points_stay_exact(seed: int) -> None:
    """Formerly they had the rounding errors of other coordinates, which can have larger units."""
    points = 1e9 * np.random.default_rng(seed).normal(size=(9, 5))
    points[:, [1, 3]] = 5e-9, 0.0
    hull = Polytope.from_vertices(points)
    zonotope = Polytope.from_zonotope(Zonotope(points[0], points - points[0]))

    for flat in (hull, zonotope):
        assert flat.dimension == 3
        np.testing.assert_array_equal(
            flat.vertices[:, [1, 3]], np.tile([5e-9, 0.0], (len(flat.vertices), 1))
        )
        assert not flat.normals[:, [1, 3]].any()
        np.testing.assert_array_equal(
            flat.across.T @ flat.across, np.diag([0.0, 1.0, 0.0, 1.0, 0.0])
        )
        np.testing.assert_array_equal(flat.across.T @ flat.levels, [0.0, 5e-9, 0.0, 0.0, 0.0])


def test_row_of_another_length_does_not_change_a_thin_set() -> None:
    """Formerly a point: the rounding of the offsets was not divided by the lengths of the rows."""
    rows = [
        [-1.0, 0.0],
        [8388609.0, -8388608.0],
        [-8388599.0, 8388608.0],
        [25165827.0, -25165824.0],
    ]
    assert len(Polytope.from_constraints(rows, [0.0, 32.0, 48.0, 251658399.0]).vertices) == 3


def test_equations_in_mixed_units_are_kept() -> None:
    point = Polytope.from_box([1.0, 2.0], [1.0, 2.0]).preimage(np.diag([1e-6, 1e6]))
    np.testing.assert_allclose(point.vertices, [[1e6, 2e-6]], rtol=1e-9)

    rows = [[0.0, 1e-7, 0.0], [0.0, 0.0, 1e6]]
    levels = [1e-7, 1e6]
    segment = Polytope.from_constraints(
        [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]], [1.0, 1.0], rows, levels
    )
    np.testing.assert_allclose(
        np.sort(segment.vertices, axis=0), [[-1.0, 1.0, 1.0], [1.0, 1.0, 1.0]], rtol=1e-9
    )


SIDES = [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]]


@pytest.mark.parametrize(
    ("rows", "limits", "equations", "levels"),
    [
        (SIDES, [-0.5, 0.0, 1.0, 1.0], None, []),
        ([[0.0, 0.0], *SIDES], [-1.0, 1.0, 1.0, 1.0, 1.0], None, []),
        (SIDES, [1.0, 1.0, 1.0, 1.0], [[1.0, 0.0], [1.0, 0.0]], [0.0, 0.5]),
    ],
    ids=["two half-spaces", "0 x <= -1", "two equations"],
)
def test_constraints_without_a_common_point_give_the_empty_set(
    rows: list[list[float]],
    limits: list[float],
    equations: list[list[float]] | None,
    levels: list[float],
) -> None:
    with pytest.raises(EmptyPolytopeError):
        Polytope.from_constraints(rows, limits, equations, levels).needed()


@pytest.mark.parametrize(
    ("rows", "limits", "equations", "directions", "lines"),
    [
        ([[1.0, 0.0], [0.0, 1.0], [0.0, -1.0]], [1.0, 1.0, 1.0], None, [[-1.0, 0.0]], 0),
        ([[1.0, 0.0], [-1.0, 0.0]], [1.0, 1.0], None, [], 1),
        ([[1.0, 0.0], [-1.0, 0.0]], [np.inf, np.inf], None, [], 2),
        ([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]], [0.0, 0.0], [[0.0, 1.0, 0.0]], [], 1),
    ],
)
def test_half_spaces_without_an_end_give_an_unbounded_set(
    rows: list[list[float]],
    limits: list[float],
    equations: list[list[float]] | None,
    directions: list[list[float]],
    lines: int,
) -> None:
    found = Polytope.from_constraints(rows, limits, equations, [0.0] * len(equations or ()))

    assert not found.is_bounded
    assert found.directions.tolist() == directions
    assert len(found.lines) == lines
    with pytest.raises(UnboundedPolytopeError, match="unbounded along"):
        found.centroid()
