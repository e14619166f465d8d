"""`ConvexPolygons`, `Polytope` and `Zonotope` share names and refuse mistaken arguments."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import shapely

from infoset import ConvexPolygons, Polytope, Zonotope

VOCABULARY = {
    "linear_map",
    "affine_map",
    "translate",
    "minkowski_sum",
    "minkowski_difference",
    "intersection",
    "convex_hull",
    "cut",
    "preimage",
    "support_function",
    "support_vector",
    "contains",
    "is_subset",
    "equals",
    "is_empty",
    "vertices",
    "constraints",
    "area",
    "volume",
    "centroid",
    "chebyshev_centre",
    "bounding_box",
    "diameter",
    "hausdorff_distance",
    "distance",
    "closest_point",
    "project",
    "slice",
    "sample",
    "reduce_outward",
    "plot",
    "add_segment",
    "from_vertices",
    "from_constraints",
    "from_box",
    "from_ball",
    "from_zonotope",
    "from_shapely",
    "to_shapely",
    "margin",
    "empty",
    "isdisjoint",
    "polytope",
    "space",
}
"""The names of both classes."""

ONLY_POLYGONS = {
    **dict.fromkeys(
        ["counts", "shape", "stack", "broadcast_to"], "a Polytope is a single set, not a batch"
    ),
    "polygon": "the vertices of a member of a batch; a Polytope has .vertices",
    "from_points": "a Polytope from_vertices is a hull of points in any order; a ring has an order",
    "unchecked": "for arrays of kernels, which only polygons have",
}
ONLY_POLYTOPES = {
    **dict.fromkeys(
        ["normals", "offsets", "across", "levels"],
        "stored facets and affine hull; polygons compute them",
    ),
    "dimension": "the number of vertices of a polygon shows its dimension",
    "needed": "the set itself, or an error: members of a batch that are empty are masked",
    **dict.fromkeys(
        ["points", "facets", "equations", "incidence", "centre", "scale"],
        "arrays in scaled coordinates",
    ),
    "separating_direction": "a witness; polygons decide exactly whether they meet",
    "enlarged": "outward by given errors; kernels of polygons do this at each step",
    **dict.fromkeys(
        [
            "space_of",
            "halfspace",
            "from_rays",
            "is_bounded",
            "directions",
            "lines",
            "recession",
            "bounded",
            "exact",
        ],
        "a polygon is bounded: an unbounded set of the plane is a Polytope",
    ),
}


ONLY_ZONOTOPES = {
    "generators": "the stored set, with its centre; polytopes store vertices and facets",
    "box": "a centre and generators along axes",
}


def names(kind: type) -> set[str]:
    fields = {name for base in kind.__mro__ for name in getattr(base, "__annotations__", {})}
    return {name for name in {*dir(kind), *fields} if not name.startswith("_")}


def test_polygons_and_polytopes_have_the_same_names() -> None:
    assert names(ConvexPolygons) & names(Polytope) >= VOCABULARY
    assert names(ConvexPolygons) - names(Polytope) == set(ONLY_POLYGONS)
    assert names(Polytope) - names(ConvexPolygons) == set(ONLY_POLYTOPES)


def test_zonotopes_have_names_of_polytopes() -> None:
    assert names(Zonotope) - names(Polytope) == set(ONLY_ZONOTOPES)
    assert names(Zonotope) - set(ONLY_ZONOTOPES) >= {
        "affine_map",
        "cut",
        "enlarged",
        "reduce_outward",
        "volume",
    }


@pytest.mark.parametrize("number", [1, [1], (1,), np.array([1]), np.int64(1)])
def test_projections_and_slices_take_an_axis_as_a_number_or_a_sequence(number: Any) -> None:
    square = ConvexPolygons.from_box([0, 1], [2, 5])
    cube = Polytope.from_box([0, 1, 2], [3, 5, 7])

    assert [float(end) for end in square.project(number)] == [1.0, 5.0]
    assert [end.tolist() for end in cube.project(number).bounding_box()] == [[1.0], [5.0]]
    assert [float(end) for end in square.slice(number, 2.0)] == [0.0, 2.0]
    for values in (2.0, [2.0]):
        assert np.ravel(cube.slice(number, values).bounding_box()) == pytest.approx(
            [0.0, 2.0, 3.0, 7.0], abs=1e-15
        )


def test_projections_have_the_axes_in_their_order() -> None:
    square = ConvexPolygons.from_box([0, 1], [2, 5]).project([1, 0])
    cube = Polytope.from_box([0, 1, 2], [3, 5, 7]).project([2, 0])

    assert [end.tolist() for end in square.bounding_box()] == [[1.0, 0.0], [5.0, 2.0]]
    assert [end.tolist() for end in cube.bounding_box()] == [[2.0, 0.0], [7.0, 3.0]]


def test_polytope_is_converted_from_and_to_shapely() -> None:
    triangle = shapely.Polygon([(0, 0), (0, 2), (1, 0)])
    for geometry, dimension in (
        (triangle, 2),
        (shapely.LineString([(0, 0), (1, 2)]), 1),
        (shapely.Point(1, 2), 0),
    ):
        one = Polytope.from_shapely(geometry)
        assert (one.space, one.dimension) == (2, dimension)
        assert one.area() == pytest.approx(geometry.area)
        assert one.to_shapely().normalize().equals_exact(geometry.normalize(), 1e-15)

    assert Polytope.from_shapely(shapely.Polygon()).is_empty
    assert Polytope.empty(2).to_shapely().is_empty
    with pytest.raises(
        ValueError, match="the Polygon is not convex: its area and that of its hull differ by 4"
    ):
        Polytope.from_shapely(shapely.Polygon([(0, 0), (4, 0), (4, 4), (3, 1)]))
    for operation in (Polytope.area, Polytope.to_shapely):
        with pytest.raises(ValueError, match=r"a set of R\^2 is needed: project this one, of R\^3"):
            operation(Polytope.empty(3))


def test_single_polygon_takes_many_points_and_directions() -> None:
    square = ConvexPolygons.from_box([0, 0], [2, 2])
    points = np.array([[[1.0, 1.0], [3.0, 1.0], [5.0, 6.0]]])

    assert square.contains(points).tolist() == [[True, False, False]]
    assert square.margin(points).tolist() == [[1.0, -1.0, -5.0]]
    assert square.closest_point(points).tolist() == [[[1.0, 1.0], [2.0, 1.0], [2.0, 2.0]]]
    assert square.support_function(points).tolist() == [[4.0, 8.0, 22.0]]
    assert square.support_vector(points).tolist() == [[[2.0, 2.0]] * 3]
    assert square.contains(square.sample(20)).all()
    assert not ConvexPolygons.empty().contains(points).any()
    assert square.contains(np.zeros((0, 2))).shape == (0,)
    with pytest.raises(ValueError, match="normal must have the shape"):
        square.cut([[1, 0], [0, 1]], 0.0, 1.0)  # for a Polytope this is one intersection


@pytest.mark.parametrize("kind", [ConvexPolygons, Polytope])
def test_sets_have_multiples_and_are_disjoint_from_sets_apart(kind: Any) -> None:
    square = kind.from_box([0, 1], [2, 5])
    far = kind.from_box([2, 7], [3, 8])
    wanted = kind.from_box([0, 2], [4, 10])

    for doubled in (2 * square, square * 2.0, np.float64(2.0) * square):
        assert bool(np.all(doubled.equals(wanted, 1e-12)))
    assert bool(np.all((-square).equals(kind.from_box([-2, -5], [0, -1]), 1e-12)))
    with pytest.raises(TypeError):
        square * square
    assert bool(np.all(square.isdisjoint(far)))
    assert not np.any(square.isdisjoint(kind.from_box([2, 5], [3, 6])))  # they touch
    assert bool(
        np.all(square.isdisjoint(kind.empty() if kind is ConvexPolygons else kind.empty(2)))
    )


def test_witness_separates_disjoint_sets() -> None:
    one = Polytope.from_box([0, 0, 0], [1, 1, 1])
    two = Polytope.from_vertices([[2, 2, 2], [3, 2, 2], [2, 3, 2], [2, 2, 3]])
    direction = one.separating_direction(two)

    assert direction == pytest.approx(np.ones(3) / np.sqrt(3.0), abs=1e-12)
    assert one.separating_direction(one) is None


def test_zonotope_is_mapped_by_operators_and_methods() -> None:
    turned = np.array([[0.0, -1.0], [1.0, 0.0]]) @ Zonotope([1, 2], [[1, 0], [0, 3]])
    assert turned.centre.tolist() == [-2.0, 1.0]
    assert turned.generators.tolist() == [[0.0, 1.0], [-3.0, 0.0]]
