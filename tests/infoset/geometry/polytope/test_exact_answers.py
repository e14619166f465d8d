"""Random kinds of polytopes that once had wrong answers, against determinants and exact rationals
(PPL).

Volumes of sums, preimages under singular matrices, differences of flat sets, and half-spaces in
mixed units. The full numbers of cases are in the thorough tier.
"""

from __future__ import annotations

import itertools
from importlib.util import find_spec

import numpy as np
import pytest

from infoset.arrays import Floats
from infoset.geometry.polytope import Polytope
from infoset.geometry.tolerances import SNAP
from tests.infoset.geometry.polytope.exact_sets import polyhedron
from tests.rationals import Fraction
from tests.rendezvous.reachability.rationals import polyhedron_of, vertices_of

needs_ppl = pytest.mark.skipif(
    find_spec("ppl") is None, reason="needs the extra exact: pip install '.[exact]'"
)

MAX_ERROR = 1e-9
"""Relative error of volumes and widths: a thousand times the documented excess of one operation,
1e-12.
"""


# Volumes
# --------------------------------------------------------------------------------------------------


def system_of(seed: int) -> Floats:
    """A regular matrix of order 3 with entries of one decimal."""
    random = np.random.default_rng(seed)
    while True:
        matrix = np.round(random.uniform(-0.5, 0.5, (3, 3)), 1)
        if abs(np.linalg.det(matrix)) > 1e-4:
            return matrix


def reached(matrix: Floats) -> tuple[Polytope, float]:
    """The sum of a cube and its images under three powers of a matrix, and its volume from
    determinants.
    """
    cube = Polytope.from_box([-1.0] * 3, [1.0] * 3)
    whole = cube
    power = np.eye(3)
    generators = [np.eye(3)]
    for _ in range(3):
        power = matrix @ power
        whole = whole + power @ cube
        generators.append(power.T)
    triples = itertools.combinations(np.vstack(generators), 3)
    return whole, 8.0 * sum(abs(float(np.linalg.det(np.array(triple)))) for triple in triples)


def test_sum_with_nearly_parallel_facets_has_the_exact_volume_and_centroid() -> None:
    """Formerly 48.2321 and (0.08, 0.002, -0.01): one facet was two, each with some of its
    vertices.
    """
    whole, volume = reached(np.array([[0.0, -0.3, 0.0], [-0.4, 0.1, 0.4], [0.2, 0.3, -0.1]]))

    assert volume == pytest.approx(51.0737367, rel=1e-8)
    assert whole.volume() == pytest.approx(volume, rel=MAX_ERROR)
    np.testing.assert_allclose(whole.centroid(), 0.0, rtol=0.0, atol=MAX_ERROR)
    assert len(whole.vertices) - len(edges_of(whole)) + len(whole.normals) == 2


def edges_of(one: Polytope) -> list[tuple[int, int]]:
    """Pairs of facets of a set of R^3 with two common vertices."""
    pairs = itertools.combinations(range(len(one.normals)), 2)
    return [(i, j) for i, j in pairs if (one.incidence[:, i] & one.incidence[:, j]).sum() == 2]


@pytest.mark.parametrize(
    "seeds",
    [
        # All of these were wrong.
        (169, 181, 228, 358, 455, 485, 492, 498, 694, 740),
        pytest.param(tuple(range(1000)), marks=pytest.mark.thorough),
    ],
)
def test_volumes_of_sums_and_of_their_parts_equal_sums_of_determinants(
    seeds: tuple[int, ...],
) -> None:
    """Formerly 14 of these 1000 sums, and 11 of their halves, had a wrong volume."""
    for seed in seeds:
        whole, volume = reached(system_of(seed))
        normal = np.random.default_rng(seed).normal(size=3)

        assert whole.volume() == pytest.approx(volume, rel=MAX_ERROR), seed
        np.testing.assert_allclose(whole.centroid(), 0.0, rtol=0.0, atol=MAX_ERROR)
        assert whole.cut(normal, upper=0.0).volume() == pytest.approx(
            0.5 * volume, rel=MAX_ERROR
        ), seed


# Preimages
# --------------------------------------------------------------------------------------------------


def singular_case(seed: int) -> tuple[Floats, Floats, Floats]:
    """Vertices, a matrix with a null space, and an offset, all integers, some in mixed units."""
    random = np.random.default_rng(seed)
    space = int(random.integers(2, 5))
    size = int(random.integers(1, 5))
    rank = int(random.integers(0, min(space, size - 1) + 1))
    points = random.integers(-3, 4, (int(random.integers(1, space + 4)), space)).astype(float)
    factors = random.integers(-3, 4, (space, rank)), random.integers(-3, 4, (rank, size))
    matrix = (factors[0] @ factors[1]).astype(float)
    if seed % 6 == 3:
        matrix *= 2.0 ** random.integers(-40, 41, size)
    offset = random.integers(-3, 4, space).astype(float) if seed % 5 < 3 else np.zeros(space)
    return points, matrix, offset


@needs_ppl
@pytest.mark.parametrize("count", [200, pytest.param(2800, marks=pytest.mark.thorough)])
def test_preimage_under_a_singular_matrix_is_empty_or_unbounded_if_the_exact_one_is(
    count: int,
) -> None:
    """Formerly about 1 % of such preimages were called unbounded where they are empty, or the other
    way round.
    """
    import ppl

    for seed in range(count):
        points, matrix, offset = singular_case(seed)
        image = ppl.Generator_System(
            polyhedron_of([[Fraction(value) for value in offset.tolist()]]).generators()
        )
        for column in matrix.T:
            entries = [int(Fraction(value) * 2**45) for value in column.tolist()]
            if any(entries):
                image.insert(
                    ppl.line(sum(entry * ppl.Variable(i) for i, entry in enumerate(entries)))
                )
        common = polyhedron_of([[Fraction(value) for value in point] for point in points.tolist()])
        common.intersection_assign(ppl.C_Polyhedron(image))
        one = Polytope.from_vertices(points)

        found = one.preimage(matrix, offset)
        assert found.is_empty == common.is_empty(), seed
        assert found.is_bounded == common.is_empty(), seed


# Differences
# --------------------------------------------------------------------------------------------------


def test_difference_of_a_flat_set_and_a_segment_across_it_is_empty() -> None:
    """Formerly 'unbounded'."""
    rows = [[2, -3, -2], [-2, 3, 2], *np.eye(3), *-np.eye(3)]
    flat = Polytope.from_constraints(rows, [1, -1, *[2] * 6])
    segment = Polytope.from_vertices([[-1, -2, 2], [2, 0, -2]])

    assert flat.minkowski_difference(segment).is_empty


@needs_ppl
@pytest.mark.parametrize("count", [100, pytest.param(3000, marks=pytest.mark.thorough)])
def test_differences_of_flat_sets_are_the_exact_ones(count: int) -> None:
    """Formerly some of such differences, about 3 %, were called unbounded."""
    compared = 0
    seed = -1
    while compared < count:
        seed += 1
        random = np.random.default_rng(seed)
        space = int(random.integers(2, 5))
        rows = random.integers(-3, 4, (int(random.integers(1, space)), space)).astype(float)
        levels = random.integers(-2, 3, len(rows)).astype(float)
        normals = np.vstack([rows, -rows, np.eye(space), -np.eye(space)])
        limits = np.concatenate([levels, -levels, np.full(2 * space, 2.0)])
        flat = Polytope.from_constraints(normals, limits)
        if flat.is_empty:
            continue
        compared += 1
        other = random.integers(-2, 3, (int(random.integers(1, 4)), space)).astype(float)

        found = flat.minkowski_difference(Polytope.from_vertices(other))

        exact = polyhedron(normals, limits - (other @ normals.T).max(axis=0))
        assert found.is_empty == exact.is_empty(), seed
        if not exact.is_empty():
            vertices = np.array(
                [[float(value) for value in vertex] for vertex in vertices_of(exact)]
            )
            apart = np.abs(vertices[:, None] - found.vertices).max(axis=2)
            assert max(apart.min(axis=0).max(), apart.min(axis=1).max()) <= MAX_ERROR, seed


# Mixed units
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("lower", "upper"),
    [
        ([-1e-10, 5.7999e7], [1e-10, 5.8001e7]),
        ([-1e-15, -4.5], [0.0, -4.4]),
        ([-1e-9, 7e6 - 100.0, 7.5e3 - 1.0], [1e-9, 7e6 + 100.0, 7.5e3 + 1.0]),
    ],
)
def test_box_in_mixed_units_is_bounded(lower: list[float], upper: list[float]) -> None:
    """Formerly 'unbounded'."""
    unit = np.eye(len(lower))

    box = Polytope.from_constraints(
        np.vstack([unit, -unit]), np.concatenate([upper, np.negative(lower)])
    )

    np.testing.assert_array_equal(box.bounding_box(), [lower, upper])


def far_case(seed: int) -> tuple[Floats, Floats, Floats, Floats]:
    """Half-spaces of a thin box far from the origin in mixed units, of every second one with three
    oblique cuts.
    """
    random = np.random.default_rng(seed)
    space = int(random.integers(2, 5))
    middle = random.choice([-1.0, 1.0], space) * 10.0 ** random.uniform(-12.0, 12.0, space)
    # Cuts that miss a box without a width by less than rounding touch it.
    width = np.abs(middle) * 10.0 ** random.uniform(-15.0 if seed % 2 else -17.0, -6.0, space)
    lower = middle - 0.5 * width
    upper = middle + 0.5 * width
    rows = np.vstack([np.eye(space), -np.eye(space)])
    limits = np.concatenate([upper, -lower])
    if seed % 2:
        cuts = random.normal(size=(3, space)) / width
        cuts /= 2.0 ** np.frexp(np.abs(cuts).max(axis=1))[1][:, None]
        levels = cuts @ middle + random.uniform(-0.15, 0.5, 3) * (np.abs(cuts) @ width)
        rows = np.vstack([rows, cuts])
        limits = np.concatenate([limits, levels])
    order = random.permutation(len(rows))
    return rows[order], limits[order], lower, upper


@needs_ppl
@pytest.mark.parametrize("count", [60, pytest.param(1500, marks=pytest.mark.thorough)])
def test_sets_in_mixed_units_far_from_the_origin_are_the_exact_ones(count: int) -> None:
    """Formerly many of such sets were called unbounded or flat, or lost their width or vertices."""
    for seed in range(count):
        rows, limits, lower, upper = far_case(seed)
        exact = polyhedron(rows, limits)

        found = Polytope.from_constraints(rows, limits)

        assert found.is_empty == exact.is_empty(), seed
        if exact.is_empty():
            continue
        assert found.dimension == exact.affine_dimension(), seed
        vertices = vertices_of(exact)
        assert found.contains([[float(value) for value in vertex] for vertex in vertices]).all(), (
            seed
        )
        for axis in range(found.space):
            assert width_error(found, axis, [vertex[axis] for vertex in vertices]) <= MAX_ERROR, (
                seed
            )
        if not seed % 2:
            np.testing.assert_array_equal(found.bounding_box(), [lower, upper])


def width_error(found: Polytope, axis: int, values: list[Fraction]) -> float:
    """Distance of the ends of a set along an axis, as stored, from the exact ones, relative to the
    exact width.
    """
    low = float(found.points[:, axis].min())
    high = float(found.points[:, axis].max())
    centre = Fraction(float(found.centre[axis]))
    scale = Fraction(float(found.scale[axis]))
    ends = zip((low, high), (min(values), max(values)), strict=True)
    error = max(abs(centre + scale * Fraction(end) - exact) for end, exact in ends)
    return (
        float(error / (max(values) - min(values)))
        if max(values) > min(values)
        else float(error > 0)
    )


@pytest.mark.parametrize("junk", [1e-17, -1e-17])
def test_row_that_is_rounding_does_not_empty_a_thin_set_in_mixed_units(junk: float) -> None:
    """A row 1e15 times shorter than the others is no constraint, also where exact vertices
    decide.
    """
    lower = np.array([7e6 - 1e-6, -1.0, -1.0])
    upper = np.array([7e6 + 1e-6, 1.0, 1.0])
    rows = np.vstack([np.eye(3), -np.eye(3), [[0.0, junk, -junk]]])

    found = Polytope.from_constraints(rows, np.concatenate([upper, -lower, [-3e-17]]))

    np.testing.assert_array_equal(found.bounding_box(), [lower, upper])


@pytest.mark.parametrize("width", [1e-3, 1e-12])
def test_set_without_an_end_along_one_axis_is_unbounded_along_it(width: float) -> None:
    rows = [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0]]

    found = Polytope.from_constraints(rows, [1e6 * width, -1e6 * width + 1e3 * width, 7.0])

    np.testing.assert_array_equal(found.directions, [[0.0, -1.0]])
    assert len(found.vertices) == 2


# Cuts
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("upper", [-0.5, 0.5])
def test_intersection_with_a_very_long_set_does_not_depend_on_the_order(upper: float) -> None:
    """Its honest facets are 1e15 times shorter than others, and were taken for rounding: the result
    was empty.
    """
    square = Polytope.from_box([-1.0, -1.0], [1.0, 1.0])
    long = Polytope.from_box([0.0, -1.4e11], [1.25e-4, upper])
    for both in (square & long, long & square):
        lower, most = both.bounding_box()
        np.testing.assert_allclose(lower, [0.0, -1.0], rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(most, [1.25e-4, upper], rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("seed", range(6))
def test_thin_part_loses_only_the_dimension_in_which_it_is_flat(seed: int) -> None:
    """A bar, 2e-10 thick along one axis and 3e-12 along the other: formerly both were flat."""
    turn = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    bar = Polytope.from_box([-1.0] * 3, [1.0] * 3).cut(turn, [-0.5, 0.0, 0.0], [0.5, 2e-10, 3e-12])
    assert bar.dimension == 2
    corners = (
        np.array([(x, y, z) for x in (-0.5, 0.5) for y in (0.0, 2e-10) for z in (0.0, 3e-12)])
        @ turn
    )
    assert bar.contains(corners, SNAP).all()


def test_cut_of_a_small_flat_set_is_as_precise_as_the_set() -> None:
    """The coordinate that is zero has no width: an oblique half-space was compared with a width of
    one.
    """
    segment = Polytope.from_box([0.0, 0.0], [1e-13, 0.0])
    assert segment.cut([1.0, 1.0], upper=-9e-13).is_empty
    square = Polytope.from_box([0.0, 0.0, 0.0], [1e-10, 1e-10, 0.0])
    corner = square.cut([1.0, 0.5, 1.0], upper=4e-13)
    assert corner.dimension == 2
    assert corner.volume() == pytest.approx(0.5 * 4e-13 * 8e-13, rel=1e-9)
    assert square.cut([0.0, 0.0, 1.0], upper=0.0).equals(square)
    assert square.cut([0.0, 0.0, 1.0], upper=-1e-3).is_empty
