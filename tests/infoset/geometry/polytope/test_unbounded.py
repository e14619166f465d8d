"""Unbounded polytopes: half-spaces, cones, cylinders, R^n, against known answers and exact
arithmetic (PPL).
"""

from __future__ import annotations

import pickle
from collections.abc import Callable
from functools import cache
from importlib.util import find_spec
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

from infoset.arrays import Floats
from infoset.geometry.polytope import EmptyPolytopeError, Polytope, UnboundedPolytopeError, product
from infoset.geometry.polytope.polyhedron import Polyhedron
from tests.infoset.geometry.polytope.exact_sets import polyhedron

needs_ppl = pytest.mark.skipif(
    find_spec("ppl") is None, reason="needs the extra exact: pip install '.[exact]'"
)


# Functions and not constants: kernels are compiled when tests run, not when they are collected.


@cache
def quadrant() -> Polytope:
    return Polytope.from_rays([[0.0, 0.0]], [[1.0, 0.0], [0.0, 1.0]])


@cache
def strip() -> Polytope:
    return Polytope.from_constraints([[0.0, 1.0], [0.0, -1.0]], [1.0, 1.0])


@cache
def box() -> Polytope:
    return Polytope.from_box([-1.0, -1.0], [1.0, 1.0])


@cache
def wedge() -> Polytope:
    return Polytope.from_rays(
        [[0.0, 0.0, 1.0], [2.0, 0.0, 1.0]], [[0.0, 1.0, 0.0], [0.0, 1.0, 1.0]]
    )


def test_half_space_has_a_line_and_a_direction() -> None:
    half = Polytope.halfspace([3.0, 4.0], 10.0)

    assert half.dimension == 2
    assert len(half.vertices) == len(half.lines) == len(half.directions) == 1
    np.testing.assert_allclose(half.normals, [[0.6, 0.8]], rtol=1e-15)
    np.testing.assert_allclose(half.offsets, [2.0], rtol=1e-15)
    assert half.contains([[2.0, 1.0], [2.1, 1.0], [-1e9, 1e8]]).tolist() == [True, False, True]


def test_half_space_with_a_zero_normal_is_refused() -> None:
    with pytest.raises(ValueError, match="normal must not be zero"):
        Polytope.halfspace([0.0, 0.0], 1.0)


@pytest.mark.parametrize("space", [1, 2, 5])
def test_whole_space_is_unbounded_and_without_facets(space: int) -> None:
    whole = Polytope.space_of(space)

    assert (whole.dimension, len(whole.normals), len(whole.lines)) == (space, 0, space)
    assert whole.contains(np.full(space, 1e50))
    assert whole.margin(np.zeros(space)) == np.inf
    assert whole.volume() == np.inf
    np.testing.assert_array_equal(whole.bounding_box(), [[-np.inf] * space, [np.inf] * space])


def test_rays_inside_the_cone_of_others_are_left_out() -> None:
    cone = Polytope.from_rays(
        [[0.0, 0.0], [1.0, 1.0]], [[1.0, 0.0], [0.0, 1.0], [2.0, 3.0], [0.0, 0.0]]
    )

    assert cone.equals(quadrant())
    assert cone.vertices.tolist() == [[0.0, 0.0]]
    assert sorted(cone.directions.tolist()) == [[0.0, 1.0], [1.0, 0.0]]


def test_opposite_rays_are_a_line() -> None:
    found = Polytope.from_rays([[0.0, 1.0]], [[1.0, 0.0], [-2.0, 0.0]])

    assert (found.dimension, len(found.lines), len(found.directions)) == (1, 1, 0)
    np.testing.assert_array_equal(found.across, [[0.0, 1.0]])
    np.testing.assert_array_equal(found.levels, [1.0])


def test_points_without_rays_are_their_hull() -> None:
    assert Polytope.from_rays(box().vertices, np.zeros((0, 2))).equals(box())


def test_support_is_infinite_only_where_the_set_is_unbounded() -> None:
    directions = [[-1.0, -1.0], [-1.0, 0.0], [0.0, 1.0], [1e-300, -1.0]]

    assert quadrant().support_function(directions).tolist() == [0.0, 0.0, np.inf, np.inf]
    assert quadrant().support_vector([-1.0, -2.0]).tolist() == [0.0, 0.0]
    with pytest.raises(UnboundedPolytopeError, match="along"):
        quadrant().support_vector([1.0, 0.0])


def test_support_along_a_facet_is_finite_in_spite_of_rounding() -> None:
    for seed in range(200):
        random = np.random.default_rng(seed)
        cone = Polytope.from_rays(random.normal(size=(1, 4)), random.normal(size=(4, 4)))
        rows, limits = cone.constraints()

        np.testing.assert_allclose(cone.support_function(rows), limits, rtol=1e-14, atol=1e-14)
        assert cone.is_subset(cone)


def test_intersections_of_unbounded_sets_are_exact() -> None:
    part = quadrant() & box()

    assert part.is_bounded
    assert part.equals(Polytope.from_box([0.0, 0.0], [1.0, 1.0]))
    assert (strip() & quadrant()).directions.tolist() == [[1.0, 0.0]]
    assert (quadrant() & Polytope.halfspace([1.0, 1.0], -1.0)).is_empty
    assert (quadrant() & Polytope.halfspace([1.0, 1.0], 0.0)).vertices.tolist() == [[0.0, 0.0]]
    assert (quadrant() & Polytope.empty(2)).is_empty


def test_cut_and_slice_of_unbounded_sets_are_exact() -> None:
    assert quadrant().cut([1.0, 1.0], upper=1.0).area() == pytest.approx(0.5, rel=1e-15)
    assert quadrant().cut([1.0, 1.0], lower=1.0).vertices.shape == (2, 2)
    np.testing.assert_array_equal(wedge().slice(2, 2.0).bounding_box(), [[0.0, 1.0], [2.0, np.inf]])


def test_sums_with_unbounded_sets_are_exact() -> None:
    assert (quadrant() + box()).vertices.tolist() == [[-1.0, -1.0]]
    assert (quadrant() + -quadrant()).equals(Polytope.space_of(2))
    assert quadrant().add_segment([1.0, 0.0]).vertices.tolist() == [[-1.0, 0.0]]
    assert quadrant().enlarged([2.0, 3.0]).vertices.tolist() == [[-2.0, -3.0]]
    assert (quadrant().translate([5.0, 7.0])).vertices.tolist() == [[5.0, 7.0]]


def test_differences_of_unbounded_sets_are_exact() -> None:
    assert quadrant().minkowski_difference(box()).vertices.tolist() == [[1.0, 1.0]]
    assert quadrant().minkowski_difference(quadrant()).equals(quadrant())
    assert box().minkowski_difference(quadrant()).is_empty
    assert strip().minkowski_difference(box()).dimension == 1


def test_images_of_unbounded_sets_are_exact() -> None:
    assert ([[1.0, -1.0]] @ quadrant()).equals(Polytope.space_of(1))
    assert (-quadrant()).support_function([1.0, 1.0]) == 0.0
    assert (np.zeros((1, 2)) @ quadrant()).vertices.tolist() == [[0.0]]
    np.testing.assert_array_equal(quadrant().project(1).bounding_box(), [[0.0], [np.inf]])


def test_preimage_of_a_singular_matrix_contains_its_null_space() -> None:
    found = box().preimage([[1.0, 1.0, 0.0], [0.0, 0.0, 2.0]], [0.5, 0.0])

    np.testing.assert_allclose(found.lines @ [[1.0], [1.0], [0.0]], 0.0, atol=1e-15)
    np.testing.assert_allclose(
        found.support_function([[1.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), [0.5, 0.5], rtol=1e-14
    )
    assert box().preimage([[0.0, 0.0], [0.0, 0.0]]).equals(Polytope.space_of(2))
    assert box().preimage([[0.0, 0.0], [0.0, 0.0]], [2.0, 0.0]).is_empty


def test_hull_with_an_unbounded_set_is_closed() -> None:
    hull = Polytope.halfspace([0.0, 1.0], 0.0).convex_hull(Polytope.from_vertices([[0.0, 1.0]]))

    assert hull.equals(Polytope.halfspace([0.0, 1.0], 1.0))


def test_subset_of_an_unbounded_set_needs_its_directions() -> None:
    assert Polytope.halfspace([-1.0, -1.0], 0.0) >= quadrant()
    assert not Polytope.halfspace([-1.0, -1.0], 0.0) <= quadrant()
    assert not quadrant() <= box()
    assert Polytope.from_box([0.0, 0.0], [1e9, 1.0]) <= quadrant()


def test_distances_of_unbounded_sets_are_exact() -> None:
    assert quadrant().distance([-3.0, -4.0]) == 5.0
    assert quadrant().closest_point([-3.0, 7.0]).tolist() == [0.0, 7.0]
    assert quadrant().distance((-quadrant()).translate([-3.0, -4.0])) == 5.0
    assert Polytope.halfspace([0.6, 0.8], 1.0).distance(
        Polytope.halfspace([-0.6, -0.8], -3.0)
    ) == pytest.approx(2.0)
    assert strip().distance(strip()) == 0.0


def test_separating_direction_of_unbounded_sets_exists_if_they_are_disjoint() -> None:
    one = Polytope.halfspace([0.0, 1.0], 0.0)
    other = quadrant().translate([3.0, 1.0])

    assert one.separating_direction(other) is not None
    assert one.isdisjoint(other)
    assert not one.isdisjoint(quadrant())


def test_hausdorff_distance_is_finite_for_equal_recession_cones() -> None:
    assert quadrant().hausdorff_distance(quadrant().translate([3.0, 0.0])) == 3.0
    assert quadrant().hausdorff_distance(strip()) == np.inf
    assert quadrant().hausdorff_distance(box()) == np.inf


def test_recession_cone_has_the_directions_of_the_set() -> None:
    assert (quadrant().translate([1.0, 2.0])).recession().equals(quadrant())
    assert box().recession().vertices.tolist() == [[0.0, 0.0]]
    with pytest.raises(EmptyPolytopeError):
        Polytope.empty(2).recession()


def test_largest_ball_of_a_strip_is_found_and_of_a_quadrant_is_refused() -> None:
    centre, radius = strip().chebyshev_centre()

    assert radius == pytest.approx(1.0)
    assert centre[1] == pytest.approx(0.0, abs=1e-9)
    with pytest.raises(UnboundedPolytopeError):
        quadrant().chebyshev_centre()


@pytest.mark.parametrize(
    "ask",
    [
        Polytope.centroid,
        lambda one: one.sample(3),
        lambda one: one.reduce_outward(10),
        Polytope.to_shapely,
    ],
)
def test_operation_for_bounded_sets_refuses_an_unbounded_set(
    ask: Callable[[Polytope], object],
) -> None:
    with pytest.raises(UnboundedPolytopeError, match=r"unbounded along \("):
        ask(quadrant())


def test_measures_of_unbounded_sets_are_infinite() -> None:
    assert quadrant().volume() == np.inf
    assert quadrant().area() == np.inf
    assert quadrant().diameter() == np.inf
    assert Polytope.from_rays([[0.0, 0.0]], [[1.0, 2.0]]).area() == 0.0


def test_product_with_an_unbounded_factor_is_unbounded() -> None:
    found = product(quadrant(), Polytope.from_box([0.0], [1.0]))

    np.testing.assert_array_equal(found.bounding_box(), [[0.0, 0.0, 0.0], [np.inf, np.inf, 1.0]])
    assert (len(found.vertices), len(found.directions)) == (2, 2)


def test_plot_shows_the_part_within_the_limits_of_the_axes() -> None:
    axes = Figure().add_subplot()
    axes.set(xlim=(-2.0, 3.0), ylim=(4.0, -1.0))

    (patch,) = quadrant().plot(axes)

    assert sorted(map(tuple, patch.get_xy()[:-1].tolist())) == [
        (0.0, 0.0),
        (0.0, 4.0),
        (3.0, 0.0),
        (3.0, 4.0),
    ]
    assert (axes.get_xlim(), axes.get_ylim()) == ((-2.0, 3.0), (4.0, -1.0))


def test_unbounded_set_is_pickled_and_shown() -> None:
    again = pickle.loads(pickle.dumps(quadrant()))

    assert again.equals(quadrant())
    assert repr(again) == "<unbounded polytope of dimension 2 in R^2: 1 vertices, 2 facets>"


# Against exact arithmetic
# --------------------------------------------------------------------------------------------------


def random_set(random: np.random.Generator, space: int) -> tuple[Polytope, Any]:
    """Return a random set, often unbounded or flat, and PPL's polyhedron with the same data."""
    import ppl

    largest = 2 if random.random() < 0.7 else 1000

    def values(count: int) -> Floats:
        return random.integers(-largest, largest + 1, (count, space)).astype(float)

    if random.random() < 0.4:
        rows = values(int(random.integers(1, space + 2)))
        limits = values(len(rows))[:, 0]
        return Polytope.from_constraints(rows, limits), polyhedron(rows, limits)

    points = values(int(random.integers(1, 4)))
    directions = values(int(random.integers(0, 4)))
    lines = values(int(random.random() < 0.3))
    generators = ppl.Generator_System()
    for make, vectors in ((ppl.point, points), (ppl.ray, directions), (ppl.line, lines)):
        for vector in vectors:
            if vector.any() or make is ppl.point:
                generators.insert(make(linear(vector)))
    universe = ppl.C_Polyhedron(space, "empty")
    universe.add_generators(generators)
    return Polytope.from_rays(points, directions, lines), universe


def linear(entries: Any) -> Any:
    """Return the sum of entries times variables, in the space of all of them."""
    import ppl

    return sum(
        (int(entry) * ppl.Variable(i) for i, entry in enumerate(entries)),
        start=ppl.Linear_Expression(0),
    )


def need_equal(found: Polytope, expected: Any, label: str) -> None:
    """Compare a set with a polyhedron: exactly if unbounded, else its vertices to rounding."""
    import ppl

    assert found.is_empty == expected.is_empty(), label
    if found.is_empty:
        return
    assert found.is_bounded == expected.is_bounded(), label
    assert found.dimension == expected.affine_dimension(), label
    if found.exact is None:
        points = [g for g in expected.minimized_generators() if g.is_point()]
        exact = [
            [int(g.coefficient(ppl.Variable(i))) / int(g.divisor()) for i in range(found.space)]
            for g in points
        ]
        near = Polytope.from_vertices(exact)
        size = max(1.0, float(np.abs(exact).max()))
        assert len(found.vertices) == len(exact), label
        assert found.hausdorff_distance(near) <= 1e-11 * size, label
        return
    assert both_representations(found.exact) == [expected, expected], label
    facets = sum(1 for row in expected.minimized_constraints() if row.is_inequality())
    assert len(found.normals) == facets, label


def both_representations(one: Polyhedron) -> list[Any]:
    """Return the polyhedra of PPL from the half-spaces of a set and from its generators."""
    import ppl

    sides = ppl.C_Polyhedron(one.space, "universe")
    for row in one.half_spaces:
        sides.add_constraint(linear(row[:-1]) <= row[-1])

    generators = ppl.Generator_System()
    for point in one.points:
        generators.insert(ppl.point(linear(point[:-1]), point[-1]))
    for direction in one.directions:
        generators.insert(ppl.ray(linear(direction[:-1])))
    for line in one.lines:
        generators.insert(ppl.line(linear(line[:-1])))
    sums = ppl.C_Polyhedron(one.space, "empty")
    sums.add_generators(generators)
    return [sides, sums]


def is_exact(one: Polytope, expected: Any) -> bool:
    """Whether a set is stored without rounding: all vertices and facets are floats."""
    return one.is_empty or both_representations(one._polyhedron) == [expected, expected]


def mapped(given: Any, matrix: Floats, offset: Floats) -> Any:
    """Return the image of a polyhedron, {matrix x + offset}, by projection."""
    import ppl

    m = len(matrix)
    result = ppl.C_Polyhedron(m, "universe")
    result.concatenate_assign(given)
    for j in range(m):
        result.add_constraint(linear([*np.eye(m)[j], *-matrix[j]]) == int(offset[j]))
    result.remove_higher_space_dimensions(m)
    return result


def source_of(given: Any, matrix: Floats, offset: Floats) -> Any:
    """Return the preimage of a polyhedron: {x: matrix x + offset in it}, by projection."""
    import ppl

    m, n = matrix.shape
    result = ppl.C_Polyhedron(n, "universe")
    result.concatenate_assign(given)
    for j in range(m):
        result.add_constraint(linear([*-matrix[j], *np.eye(m)[j]]) == int(offset[j]))
    result.remove_higher_space_dimensions(n)
    return result


def summed(one: Any, other: Any) -> Any:
    """Return {x + y}: the image of the product."""
    import ppl

    both = ppl.C_Polyhedron(one)
    both.concatenate_assign(other)
    space = one.space_dimension()
    return mapped(both, np.hstack([np.eye(space), np.eye(space)]), np.zeros(space))


def difference(one: Any, other: Any) -> Any:
    """Return {x: x + y in one for all y of the other}: each half-space holds for the lowest y."""
    import ppl

    space = one.space_dimension()
    result = ppl.C_Polyhedron(space, "universe")
    for row in one.minimized_constraints():
        normal = [int(row.coefficient(ppl.Variable(i))) for i in range(space)]
        for sign in (1, -1) if row.is_equality() else (1,):
            # sign (normal . x + b) >= 0 must hold at x + y: the least value of sign normal . y
            # counts.
            terms = linear([sign * entry for entry in normal])
            least = other.minimize(terms)
            if not least["bounded"]:
                return ppl.C_Polyhedron(space, "empty")
            low = int(least["inf_n"])
            divisor = int(least["inf_d"])
            limit = sign * int(row.inhomogeneous_term())
            result.add_constraint(divisor * terms + divisor * limit + low >= 0)
    return result


@needs_ppl
@pytest.mark.parametrize("count", [30, pytest.param(1000, marks=pytest.mark.thorough)])
@pytest.mark.parametrize("space", [2, 3])
def test_operations_on_pairs_with_directions_and_lines_equal_exact_ones(
    space: int, count: int
) -> None:
    import ppl

    unbounded = compared = seed = 0
    while compared < count:
        seed += 1
        random = np.random.default_rng([seed, space])
        one, first = random_set(random, space)
        two, second = random_set(random, space)
        need_equal(one, first, f"set {seed}")
        # A set whose vertices or facets are rounded is not the polyhedron with the same data.
        if not (is_exact(one, first) and is_exact(two, second)):
            continue

        compared += 1
        unbounded += not (one.is_bounded and two.is_bounded)
        matrix = random.integers(-2, 3, (int(random.integers(1, 4)), space)).astype(float)
        offset = random.integers(-2, 3, len(matrix)).astype(float)
        back = random.integers(-2, 3, (space, int(random.integers(1, 4)))).astype(float)
        back_offset = random.integers(-2, 3, space).astype(float)

        common = ppl.C_Polyhedron(first)
        common.intersection_assign(second)
        need_equal(one & two, common, f"intersection {seed}")
        need_equal(
            one.preimage(back, back_offset), source_of(first, back, back_offset), f"preimage {seed}"
        )
        if one.is_empty or two.is_empty:
            continue

        hull = ppl.C_Polyhedron(first)
        hull.poly_hull_assign(second)
        need_equal(one.convex_hull(two), hull, f"hull {seed}")
        need_equal(one + two, summed(first, second), f"sum {seed}")
        need_equal(one.minkowski_difference(two), difference(first, second), f"difference {seed}")
        need_equal(one.affine_map(matrix, offset), mapped(first, matrix, offset), f"image {seed}")
    assert unbounded > 0.9 * count
