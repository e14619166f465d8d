"""`ConvexPolygons` and `Polytope` have the same names, and each operation refuses mistaken arguments clearly."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import shapely

from infoset import ConvexPolygons, Polytope, Zonotope
from infoset.polytope import product

VOCABULARY = {
    "linear_map", "affine_map", "translate", "minkowski_sum", "minkowski_difference", "intersection", "convex_hull",
    "cut", "preimage", "support_function", "support_vector", "contains", "is_subset", "equals", "is_empty",
    "vertices", "constraints", "area", "volume", "centroid", "chebyshev_centre", "bounding_box", "diameter",
    "hausdorff_distance", "distance", "closest_point", "project", "slice", "sample", "reduce_outward", "plot",
    "from_vertices", "from_constraints", "from_box", "from_ball", "from_zonotope", "from_shapely", "to_shapely",
    "margin", "empty",
}  # fmt: skip
"""The names of both classes."""

ONLY_POLYGONS = {
    **dict.fromkeys(["counts", "shape", "stack", "broadcast_to"], "a Polytope is a single set, not a batch"),
    "polygon": "the vertices of a member of a batch; those of a Polytope are .vertices",
    "polytope": "conversion; the reverse is ConvexPolygons.from_points(P.vertices)",
    "from_points": "from_vertices of a Polytope is a hull of points in any order; a ring has an order",
    "unchecked": "for arrays of kernels, which only polygons have",
    "add_segment": "the sum with a segment in O(n); a segment is also a Polytope of two vertices",
}
ONLY_POLYTOPES = {
    **dict.fromkeys(["normals", "offsets", "across", "levels"], "stored facets and affine hull; polygons compute them"),
    **dict.fromkeys(["space", "dimension"], "a polygon is in R^2, and its number of vertices shows its dimension"),
    **dict.fromkeys(["relaxation", "needed"], "minimum relaxation of an empty set, known from linear programs"),
    "excess": "-margin; needed where no sign must change",
    "essential_vertices": "vertices that may be the same point; polygons decide this exactly",
}


def names(kind: type) -> set[str]:
    fields = {name for base in kind.__mro__ for name in getattr(base, "__annotations__", {})}
    return {name for name in {*dir(kind), *fields} if not name.startswith("_")}


def test_both_classes_have_the_same_names() -> None:
    assert names(ConvexPolygons) & names(Polytope) >= VOCABULARY
    assert names(ConvexPolygons) - names(Polytope) == set(ONLY_POLYGONS)
    assert names(Polytope) - names(ConvexPolygons) == set(ONLY_POLYTOPES)


def test_arguments_have_the_same_order_and_names_up_to_a_plural() -> None:
    """A batch has an argument for each member, a polytope a row for each argument: `direction` and `directions`."""
    more = {"from_vertices", "from_ball", "from_constraints", "empty", "box"}
    for name in names(ConvexPolygons) & names(Polytope) - more:
        one, two = getattr(ConvexPolygons, name, None), getattr(Polytope, name, None)
        if inspect.isroutine(one) and inspect.isroutine(two):
            first, second = (
                [parameter.rstrip("s") for parameter in inspect.signature(method).parameters] for method in (one, two)
            )
            assert first == second, name


def test_projections_and_slices_take_a_number_or_several() -> None:
    square, cube = ConvexPolygons.from_box([0, 1], [2, 5]), Polytope.from_box([0, 1, 2], [3, 5, 7])
    number: Any
    for number in (1, [1], (1,), np.array([1]), np.int64(1)):
        assert [float(end) for end in square.project(number)] == [1.0, 5.0]
        assert [end.tolist() for end in cube.project(number).bounding_box()] == [[1.0], [5.0]]
        assert [float(end) for end in square.slice(number, 2.0)] == [0.0, 2.0]
        for values in (2.0, [2.0]):
            assert np.ravel(cube.slice(number, values).bounding_box()) == pytest.approx([0.0, 2.0, 3.0, 7.0], abs=1e-15)
    assert [end.tolist() for end in square.project([1, 0]).bounding_box()] == [[1.0, 0.0], [5.0, 2.0]]
    assert [end.tolist() for end in cube.project([2, 0]).bounding_box()] == [[2.0, 0.0], [7.0, 3.0]]


def test_polytopes_from_and_to_shapely() -> None:
    triangle = shapely.Polygon([(0, 0), (0, 2), (1, 0)])
    for geometry, dimension in ((triangle, 2), (shapely.LineString([(0, 0), (1, 2)]), 1), (shapely.Point(1, 2), 0)):
        one = Polytope.from_shapely(geometry)
        assert (one.space, one.dimension) == (2, dimension)
        assert one.area() == pytest.approx(geometry.area)
        assert one.to_shapely().normalize().equals_exact(geometry.normalize(), 1e-15)
    assert Polytope.from_shapely(shapely.Polygon()).is_empty
    assert Polytope.empty(2).to_shapely().is_empty
    with pytest.raises(ValueError, match="the ring is not convex: vertex 3"):
        Polytope.from_shapely(shapely.Polygon([(0, 0), (4, 0), (4, 4), (3, 1)]))
    for operation in (Polytope.area, Polytope.to_shapely):
        with pytest.raises(ValueError, match=r"a set of R\^2 is needed: project this one, of R\^3"):
            operation(Polytope.empty(3))


def test_a_single_polygon_takes_many_points_and_directions() -> None:
    square, points = ConvexPolygons.from_box([0, 0], [2, 2]), np.array([[[1.0, 1.0], [3.0, 1.0], [5.0, 6.0]]])
    assert square.contains(points).tolist() == [[True, False, False]]
    assert square.margin(points).tolist() == [[1.0, -1.0, -5.0]]
    assert square.closest_point(points).tolist() == [[[1.0, 1.0], [2.0, 1.0], [2.0, 2.0]]]
    assert square.support_function(points).tolist() == [[4.0, 8.0, 22.0]]
    assert square.support_vector(points).tolist() == [[[2.0, 2.0]] * 3]
    assert square.contains(square.sample(20)).all()
    assert not ConvexPolygons.empty().contains(points).any()
    assert square.contains(np.zeros((0, 2))).shape == (0,)
    with pytest.raises(ValueError, match=r"\(2, 2\); broadcast_to makes a batch of a single polygon"):
        square.cut([[1, 0], [0, 1]], 0.0, 1.0)  # for a Polytope this is one intersection


def test_hulls_of_lists_and_a_line_beside_a_polygon() -> None:
    one, two = [[0, 0], [1, 0], [0, 1]], [[0, 0], [4, 0], [4, 4], [0, 4], [1, 1]]
    assert ConvexPolygons.from_points([one, two]).area().tolist() == [0.5, 16.0]
    with pytest.raises(ValueError, match=r"the line where coordinate 0 is 5\.0 does not meet the polygon"):
        ConvexPolygons.from_points(one).slice(0, 5.0)


SQUARE, CUBE = ConvexPolygons.from_box([0, 0], [1, 1]), Polytope.from_box([0, 0, 0], [1, 1, 1])
EYE = np.eye(3)
BAD_NUMBERS: list[Any] = [np.nan, np.inf, "1", None, 1e70, 1j, np.ma.masked_array([1.0], [True])]
BAD_VECTORS: list[Any] = [
    *BAD_NUMBERS,
    1.0,
    [],
    [1.0],
    [1, 2, 3, 4],
    [1, np.nan],
    [1, 2, np.inf],
    ["a", "b"],
    [[1], [2, 3]],
]
BAD_MATRICES: list[Any] = [
    *BAD_VECTORS,
    EYE[None, None],
    np.full((3, 3), np.nan),
    np.full((2, 2), np.inf),
    [[1, 2, 3, 4]],
]
BAD_SETS: list[Any] = [None, 1.0, "set", [[0, 0], [1, 1]]]
BAD_AXES: list[Any] = [-1, 5, 0.5, "x", None, [], [0, 0], [[0], [1]], [1, 7], True]
BAD_COUNTS: list[Any] = [-1, 0, 1.5, "2", None, True]
BAD_TOLERANCES: list[Any] = [-1.0, np.nan, np.inf, "1", None]
AXES_WITHOUT_FILL = [None, "axes", np.zeros(2)]


def unit(one: Any) -> list[float]:
    """Return a direction, and a point of the set."""
    return [1.0, 0.0] if isinstance(one, ConvexPolygons) else [1.0, 0.0, 0.0]


Operation = Callable[[Any, Any], object]
OPERATIONS: dict[str, tuple[Operation, list[Any]]] = {
    "linear_map": (lambda p, x: p.linear_map(x), BAD_MATRICES),
    "affine_map": (lambda p, x: p.affine_map(x), BAD_MATRICES),
    "affine_map offset": (lambda p, x: p.affine_map(np.eye(len(unit(p))), x), [[], [1.0], *BAD_NUMBERS[:-1]]),
    "A @ P": (lambda p, x: x @ p, BAD_MATRICES[:-3]),
    "translate": (lambda p, x: p.translate(x), BAD_VECTORS),
    "P + vector": (lambda p, x: p + x, BAD_VECTORS),
    "preimage": (lambda p, x: p.preimage(x), BAD_MATRICES),
    "preimage offset": (lambda p, x: p.preimage(np.eye(len(unit(p))), x), [[], [1.0], *BAD_NUMBERS[:-1]]),
    "minkowski_sum": (lambda p, x: p.minkowski_sum(x), BAD_SETS),
    "minkowski_difference": (lambda p, x: p.minkowski_difference(x), BAD_SETS),
    "intersection": (lambda p, x: p.intersection(x), BAD_SETS),
    "convex_hull": (lambda p, x: p.convex_hull(x), BAD_SETS),
    "is_subset": (lambda p, x: p.is_subset(x), BAD_SETS),
    "equals": (lambda p, x: p.equals(x), BAD_SETS),
    "hausdorff_distance": (lambda p, x: p.hausdorff_distance(x), BAD_SETS),
    "P & Q": (lambda p, x: p & x, BAD_SETS),
    "P <= Q": (lambda p, x: p <= x, BAD_SETS),
    "cut": (lambda p, x: p.cut(x, 0.0, 1.0), BAD_MATRICES),
    "cut lower": (lambda p, x: p.cut(unit(p), x), [np.nan, "1", None, [1, 2], []]),
    "cut upper": (lambda p, x: p.cut(unit(p), upper=x), [np.nan, "1", None, [1, 2], []]),
    "cut slack": (lambda p, x: p.cut(unit(p), 0, 1, slack_ulp=x), BAD_TOLERANCES),
    "support_function": (lambda p, x: p.support_function(x), BAD_VECTORS),
    "support_vector": (lambda p, x: p.support_vector(x), BAD_VECTORS),
    "margin": (lambda p, x: p.margin(x), BAD_VECTORS),
    "contains": (lambda p, x: p.contains(x), BAD_VECTORS),
    "point in P": (lambda p, x: x in p, BAD_VECTORS),
    "contains tolerance": (lambda p, x: p.contains(unit(p), x), BAD_TOLERANCES),
    "is_subset tolerance": (lambda p, x: p.is_subset(p, x), BAD_TOLERANCES),
    "equals tolerance": (lambda p, x: p.equals(p, x), BAD_TOLERANCES),
    "closest_point": (lambda p, x: p.closest_point(x), BAD_VECTORS),
    "distance": (lambda p, x: p.distance(x), BAD_VECTORS),
    "project": (lambda p, x: p.project(x), BAD_AXES),
    "slice": (lambda p, x: p.slice(x, 0.5), [*BAD_AXES, [0, 1, 2]]),
    "slice values": (lambda p, x: p.slice(0, x), [np.nan, "1", None, [1, 2]]),
    "sample": (lambda p, x: p.sample(x), BAD_COUNTS),
    "sample seed": (lambda p, x: p.sample(1, x), [-1, 1.5, "2", None]),
    "reduce_outward": (lambda p, x: p.reduce_outward(x), [*BAD_COUNTS, 3]),
    "plot": (lambda p, x: p.plot(x), AXES_WITHOUT_FILL),
    "from_vertices": (lambda p, x: p.from_vertices(x), [*BAD_NUMBERS, 1.0, [1.0], [[np.nan, 0]], [["a", "b"]], [[1, 2],
        [3]]]),
    "from_constraints": (lambda p, x: p.from_constraints(x, [1.0]), BAD_MATRICES),
    "from_constraints offsets": (lambda p, x: p.from_constraints([unit(p)], x), [*BAD_NUMBERS[:1], "1", None, [],
        [1, 2], 1]),
    "from_box": (lambda p, x: p.from_box(x, unit(p)), [*BAD_NUMBERS, 1.0, [], [1, 2, 3, 4], [2, 0, 0], [2, 0]]),
    "from_box upper": (lambda p, x: p.from_box(0 * np.array(unit(p)), x), [*BAD_VECTORS, [-1, 0], [-1, 0, 0]]),
    "from_ball": (lambda p, x: p.from_ball(x, 1.0), [*BAD_NUMBERS, 1.0, [], [[[]]], [1, np.nan], ["a", "b"]]),
    "from_ball radius": (lambda p, x: p.from_ball(unit(p), x), [-1.0, np.nan, "1", None, np.inf]),
    "from_zonotope": (lambda p, x: p.from_zonotope(x, []), [*BAD_NUMBERS, 1.0, [], [1, np.nan], ["a", "b"]]),
    "from_zonotope generators": (lambda p, x: p.from_zonotope(unit(p), x), [*BAD_NUMBERS, [1.0], [[1, 2, 3, 4]],
        [[np.nan] * 3]]),
    "from_shapely": (lambda p, x: p.from_shapely(x), [None, 1.0, "POINT (1 2)", shapely.MultiPoint([(0, 0), (1, 0)])]),
    "empty": (lambda p, x: p.empty(x), [-1, 1.5, "2", None, (-1,), [1]]),
}  # fmt: skip

ONE_CLASS: dict[str, tuple[Callable[[Any], object], list[Any]]] = {
    "ConvexPolygons(vertices)": (lambda x: ConvexPolygons(x, 3), [*BAD_NUMBERS, 1.0, [1.0], np.eye(3)]),
    "ConvexPolygons(counts)": (lambda x: ConvexPolygons([[0, 0]], x), [-1, 2, 0.5, np.nan, "1", None, [1, 1]]),
    "ConvexPolygons.from_vertices counts": (lambda x: ConvexPolygons.from_vertices([[0, 0]], x), [-1, 2, 0.5, "1",
        [1, 1]]),
    "ConvexPolygons.from_points": (ConvexPolygons.from_points, [*BAD_NUMBERS, 1.0, [1.0], [[1, 2], [3]], [[1, 2, 3]]]),
    "ConvexPolygons.from_ball sides": (lambda x: ConvexPolygons.from_ball([0, 0], 1, x), [2, 3.5, "4", None]),
    "ConvexPolygons.stack": (ConvexPolygons.stack, [[None], [SQUARE, CUBE], [SQUARE, SQUARE.broadcast_to((2,))]]),
    "ConvexPolygons.broadcast_to": (SQUARE.broadcast_to((2,)).broadcast_to, [(3,), 5, "2", (-1,), None, np.eye(2)]),
    "ConvexPolygons.add_segment": (SQUARE.add_segment, BAD_VECTORS),
    "batches": (SQUARE.broadcast_to((2,)).intersection, [SQUARE.broadcast_to((3,))]),
    "batch to R^3": (SQUARE.broadcast_to((2,)).affine_map, [np.ones((3, 2))]),
    "another space": (CUBE.intersection, [Polytope.empty(2)]),
    "distance from another space": (CUBE.distance, [Polytope.empty(2)]),
    "across": (lambda x: Polytope.from_constraints(EYE, np.ones(3), x, [1.0]), [[[1, 0]], [1.0],
        [[np.nan, 0, 0]], "a"]),
    "levels": (lambda x: Polytope.from_constraints(EYE, np.ones(3), [[1, 0, 0]], x), [None, [1, 2], [np.nan],
        [np.inf]]),
    "excess": (CUBE.excess, BAD_VECTORS),
    "cut with several": (lambda x: CUBE.cut(EYE, upper=x), [[1, 2], [1, 2, np.nan]]),
    "product": (lambda x: product(*x), [(), (CUBE, None)]),
}  # fmt: skip


def refuse(operation: Callable[[], object], what: str) -> None:
    """Check that an operation raises one clear error: of the checks of arguments, not from inside."""
    with pytest.raises((ValueError, TypeError)) as caught:
        operation()
    last = caught.traceback[-1]
    assert "/numpy/" not in str(last.path), (what, str(caught.value))
    text = str(caught.value)
    inside = (
        "setting an array",
        "operands",
        "matmul",
        "could not convert",
        "out of range",
        "subscript",
        "ufunc",
        "unexpected",
    )
    assert not any(word in text for word in inside) or "unsupported operand" in text, (what, text)
    clear = (
        "must",
        "needed",
        "not convex",
        "unsupported operand",
        "not supported",
        "unbounded",
        "hole",
        "batch",
        "reversed",
        "needs",
    )
    assert any(word in text for word in clear), (what, text)


@pytest.mark.parametrize("name", OPERATIONS)
@pytest.mark.parametrize("sample", [SQUARE, CUBE, ConvexPolygons.empty(), Polytope.empty(3)], ids=repr)
def test_mistaken_arguments_have_one_clear_message(name: str, sample: Any) -> None:
    operation, mistakes = OPERATIONS[name]
    for mistake in mistakes:
        refuse(lambda mistake=mistake: operation(sample, mistake), f"{name}({mistake!r})")  # type: ignore[misc]


@pytest.mark.parametrize("name", ONE_CLASS)
def test_mistaken_arguments_of_one_class_have_one_clear_message(name: str) -> None:
    operation, mistakes = ONE_CLASS[name]
    for mistake in mistakes:
        refuse(lambda mistake=mistake: operation(mistake), f"{name}({mistake!r})")  # type: ignore[misc]


@pytest.mark.parametrize(
    ("kind", "arguments", "message"),
    [
        (Polytope, (EYE, np.ones(3)), "Polytope: missing a required argument: 'offsets'; use Polytope.from"),
        (Polytope, (), "Polytope: missing a required argument: 'vertices'; use Polytope.from"),
        (ConvexPolygons, ([(0, 0), (1, 0)],), "ConvexPolygons: missing a required argument: 'counts'; use ConvexPo"),
        (ConvexPolygons, (1, 2, 3), "ConvexPolygons: too many positional arguments; use ConvexPolygons.from_vertices"),
    ],
)
def test_a_constructor_names_its_own_class_and_the_way_to_make_a_set(kind: Any, arguments: Any, message: str) -> None:
    with pytest.raises(TypeError) as raised:
        kind(*arguments)
    assert str(raised.value).startswith(message)


@pytest.mark.parametrize("sample", [SQUARE, CUBE])
def test_a_sum_with_a_set_of_another_class_names_the_class(sample: Any) -> None:
    other: Any
    for other in (Zonotope(np.zeros(2), np.eye(2)), CUBE if sample is SQUARE else SQUARE):
        for one, two in ((sample, other), (other, sample)):
            with pytest.raises(TypeError, match=r"^other must be of the type (Polytope|ConvexPolygons): got "):
                one + two


def test_every_public_operation_is_in_the_table() -> None:
    without_arguments = {"area", "volume", "centroid", "chebyshev_centre", "bounding_box", "diameter", "constraints"}
    others = {
        "to_shapely",
        "vertices",
        "is_empty",
    }
    assert VOCABULARY - without_arguments - others <= {name.split()[0] for name in OPERATIONS}
