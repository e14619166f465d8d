"""Operations of polytopes against exact rational polytopes, published cases, and earlier errors."""

from __future__ import annotations

import itertools
from importlib.util import find_spec

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from infoset import ConvexPolygons, Zonotope
from infoset.arrays import Floats
from infoset.geometry.polytope import EmptyPolytopeError, Polytope
from infoset.geometry.tolerances import ON, SNAP
from tests.rationals import Fraction
from tests.rendezvous.reachability.rationals import RationalSet, polyhedron_of, rounded, vertices_of

needs_ppl = pytest.mark.skipif(
    find_spec("ppl") is None, reason="needs the extra exact: pip install '.[exact]'"
)

some = settings(max_examples=15, deadline=None)
SEED = st.integers(0, 10**6)
SPACE = st.integers(3, 4)
KIND = st.sampled_from(["plain", "flat", "segment", "point", "mixed", "lattice"])


def points_of(kind: str, seed: int, space: int) -> Floats:
    """Return random points of a kind: "mixed" has axes up to 1e9 times longer than others."""
    random = np.random.default_rng(seed)
    points = random.uniform(-1.0, 1.0, (space + 5, space))
    if kind == "lattice":
        return random.integers(-3, 4, points.shape).astype(float)
    if kind == "flat":
        points[:, -1] = 0.25
    if kind == "mixed":
        points *= 10.0 ** random.permutation(np.array([-5.0, 0.0, 4.0, 1.0])[:space])
    return points[: {"segment": 2, "point": 1}.get(kind, len(points))]


def exactly(points: Floats) -> list[list[Fraction]]:
    return [[Fraction(float(value)) for value in point] for point in points]


def assert_same(got: Polytope, exact: RationalSet, size: Floats) -> None:
    """Each vertex of one set is within 1e-9 of the other set, in units of the sizes of the axes.

    The bounds of a set that counts as flat can be as far away as its thickness: 1e-9 on both sides
    of its centre.
    """
    assert got.is_empty == (not len(exact.vertices))
    if got.is_empty:
        return
    wanted = Polytope.from_vertices(exact.vertices / size)
    scaled = Polytope.from_vertices(got.vertices / size)
    assert float(wanted.margin(scaled.vertices).min()) >= -1e-9
    assert float(scaled.margin(wanted.vertices).min()) >= -1e-9
    assert np.abs(got.bounding_box() - exact.bounds.T).max(axis=0) / size == pytest.approx(
        0.0, abs=2e-9
    )


@needs_ppl
@some
@given(SEED, SPACE, KIND, KIND)
@example(seed=827447, space=4, kind="lattice", other_kind="mixed")
@example(seed=7293, space=4, kind="lattice", other_kind="mixed")
def test_operations_on_two_sets_equal_exact_ones(
    seed: int, space: int, kind: str, other_kind: str
) -> None:
    points = points_of(kind, seed, space)
    if kind == "mixed":
        # The same axes are long.
        others = points_of(kind, seed, space)
    else:
        others = points_of(other_kind, seed + 1, space)
    others = 0.5 * others + 0.25 * points.mean(axis=0)
    size = np.maximum(np.abs(points).max(axis=0), np.abs(others).max(axis=0)) + 1e-300
    size = np.maximum(size, 1e-9 * size.max())
    one = Polytope.from_vertices(points)
    two = Polytope.from_vertices(others)
    exact_one = polyhedron_of(exactly(points))
    exact_two = polyhedron_of(exactly(others))
    assert_same(one, rounded(exact_one), size)

    both = polyhedron_of(exactly(points))
    both.poly_hull_assign(exact_two)
    assert_same(one.convex_hull(two), rounded(both), size)

    sums = [
        [a + b for a, b in zip(p, q, strict=True)]
        for p in vertices_of(exact_one)
        for q in vertices_of(exact_two)
    ]
    assert_same(one + two, rounded(polyhedron_of(sums)), size)

    # Rounding decides whether flat sets meet.
    if not {kind, other_kind} <= {"plain", "mixed", "lattice"}:
        return
    common = polyhedron_of(exactly(points))
    common.intersection_assign(exact_two)
    if common.is_empty() or common.affine_dimension() == space:
        assert_same(one & two, rounded(common), size)

    less = polyhedron_of(exactly(points))
    small = exactly(0.05 * (others - others.mean(axis=0)))
    for q in small:
        less.intersection_assign(
            polyhedron_of([[a - b for a, b in zip(p, q, strict=True)] for p in exactly(points)])
        )
    part = Polytope.from_vertices(np.array(small, dtype=float))
    if less.is_empty() or less.affine_dimension() == space:
        assert_same(one.minkowski_difference(part), rounded(less), size)
    assert part.translate(one.vertices[0]).is_subset(one + part, 1e-9 * float(size.max()))


@needs_ppl
@some
@given(SEED, SPACE, KIND)
@example(seed=2000, space=3, kind="mixed")
def test_maps_projections_and_slices_equal_exact_ones(seed: int, space: int, kind: str) -> None:
    points = points_of(kind, seed, space)
    one = Polytope.from_vertices(points)
    size = np.maximum(np.abs(points).max(axis=0), 1e-9 * np.abs(points).max())
    random = np.random.default_rng(seed + 2)
    matrix = random.integers(-2, 3, (2, space)).astype(float)
    offset = random.integers(-2, 3, 2).astype(float)
    image = np.array(exactly(points)) @ np.array(exactly(matrix)).T + np.array(
        [Fraction(float(v)) for v in offset]
    )
    reach = np.full(2, float(size.max()) + 2.0)

    assert_same(one.affine_map(matrix, offset), rounded(polyhedron_of(image.tolist())), reach)
    assert_same(
        one.project([0, space - 1]),
        rounded(polyhedron_of(exactly(points[:, [0, space - 1]]))),
        size[[0, space - 1]],
    )

    if kind == "plain":
        square = np.eye(space) + np.triu(random.integers(-1, 2, (space, space)), 1)
        back = one.affine_map(square, np.ones(space)).preimage(square, np.ones(space))
        assert back.equals(one, 1e-9 * float(size.max() + 1.0))

        value = float(points[:, 0].mean())
        half = one.slice([0], [value])
        lifted = np.column_stack([np.full(len(half.vertices), value), half.vertices])
        assert one.contains(lifted, 1e-9 * float(size.max())).all()
        assert_same(
            one.cut(np.eye(space)[0], value, value).project(range(1, space)),
            rounded(polyhedron_of(exactly(half.vertices))),
            size[1:],
        )


@some
@given(SEED, SPACE, KIND)
def test_measures_satisfy_their_identities(seed: int, space: int, kind: str) -> None:
    points = points_of(kind, seed, space)
    one = Polytope.from_vertices(points)
    size = float(np.abs(points).max())
    assert (one.margin(one.vertices) >= 0.0).all()
    assert one.contains(points, 1e-9 * size).all()

    centre, radius = one.chebyshev_centre()
    assert one.contains(centre, 1e-9 * size)
    assert float((one.offsets - one.normals @ centre).min(initial=np.inf)) >= radius - 1e-9 * size
    assert one.contains(one.sample(20), 1e-9 * size).all()
    assert one.contains(one.centroid(), 1e-9 * size)

    far = one.vertices[0] + 3.0 * size * np.eye(space)[0]
    near = one.closest_point(far)
    assert one.contains(near, 1e-9 * size)
    # For the nearest point to x, (x - near) . (y - near) <= 0 for all y of the set.
    assert float(((one.vertices - near) @ (far - near)).max()) <= 1e-8 * size**2
    assert one.distance(far) == pytest.approx(float(np.linalg.norm(far - near)), rel=1e-9)

    moved = one.translate(4.0 * size * np.eye(space)[0])
    assert one.hausdorff_distance(moved) == pytest.approx(4.0 * size, rel=1e-9)
    assert one.distance(moved) <= 4.0 * size * (1.0 + 1e-15)
    assert one.diameter() == pytest.approx(
        max(float(np.linalg.norm(p - q)) for p in points for q in points), rel=1e-9
    )

    if kind == "plain":
        fewer = one.reduce_outward(2 * space + 2)
        assert len(fewer.normals) <= 2 * space + 2
        assert one.is_subset(fewer, 1e-9 * size)

        again = Polytope.from_constraints(*one.constraints())
        assert len(again.normals) == len(one.normals)
        # Rounded offsets can divide a vertex of many facets.
        apart = np.abs(again.vertices[:, None] - one.vertices).max(axis=2)
        assert max(apart.min(axis=0).max(), apart.min(axis=1).max()) <= 1e-10 * size

        share = one.cut(np.eye(space)[0], upper=float(one.centroid()[0])).volume() / one.volume()
        assert float((one.sample(20_000)[:, 0] < one.centroid()[0]).mean()) == pytest.approx(
            share, abs=0.02
        )


def half_spaces_of(one: Polytope) -> list[tuple[list[Fraction], Fraction]]:
    """Return the half-spaces (a, b), a . x <= b, of the facets in rational numbers."""
    found = []
    for *row, limit in one.facets.tolist():
        normal = [
            Fraction(entry) / Fraction(scale)
            for entry, scale in zip(row, one.scale.tolist(), strict=True)
        ]
        centre = [Fraction(value) for value in one.centre.tolist()]
        found.append((normal, Fraction(limit) + dot(normal, centre)))
    return found


def dot(one: list[Fraction], other: list[Fraction]) -> Fraction:
    return sum((a * b for a, b in zip(one, other, strict=True)), Fraction(0))


def corners_of(half_planes: list[tuple[list[Fraction], Fraction]]) -> list[list[Fraction]]:
    """Return the points of two of the lines that are in all half-planes."""
    corners = []
    for (one, limit), (other, other_limit) in itertools.combinations(half_planes, 2):
        det = one[0] * other[1] - one[1] * other[0]
        if det == 0:
            continue
        corner = [
            (limit * other[1] - one[1] * other_limit) / det,
            (one[0] * other_limit - limit * other[0]) / det,
        ]
        if all(dot(normal, corner) <= bound for normal, bound in half_planes):
            corners.append(corner)
    return corners


@pytest.mark.parametrize("factor", [1.0, 2.0])
def test_preimage_of_a_set_far_from_the_origin_contains_the_exact_one(factor: float) -> None:
    """The rows are exact, but the limits are moved by the centre, which rounds them."""
    random = np.random.default_rng(3)
    for _ in range(20):
        one = Polytope.from_vertices(random.uniform(-1.0, 1.0, (6, 2)) + 500.0)
        half_planes = half_spaces_of(one.preimage(factor * np.eye(2)))
        corners = corners_of(half_spaces_of(one))
        assert len(corners) >= 3
        for corner in corners:
            x = [value / Fraction(factor) for value in corner]
            assert all(dot(normal, x) <= limit for normal, limit in half_planes)


@pytest.mark.parametrize("space", [1, 2, 3, 5])
def test_boxes_are_exact(space: int) -> None:
    """Formerly [0, 0] .. [1, 2] reached to -2.2e-16, and vertices had a positive excess."""
    lower = np.zeros(space)
    upper = np.arange(1.0, space + 1.0) / 3.0
    box = Polytope.from_box(lower, upper)
    assert sorted(map(tuple, box.vertices.tolist())) == sorted(
        itertools.product(*zip(lower, upper, strict=True))
    )
    assert (box.margin(box.vertices) >= 0.0).all()
    assert not box.contains(upper + 1e-14).all()
    flat = Polytope.from_box([0.0] * space, [0.0] * (space - 1) + [1e-12])
    assert (flat.dimension, len(flat.vertices)) == (1, 2)


def test_empty_set_is_empty_also_if_its_facets_leave_a_direction_open() -> None:
    """Formerly {x <= 2, y <= 10, y >= 11} was called unbounded."""
    empty = Polytope.from_constraints([[1.0, 0.0], [0.0, 1.0], [0.0, -1.0]], [2.0, 10.0, -11.0])
    assert empty.is_empty
    with pytest.raises(EmptyPolytopeError, match=r"the polytope is empty$"):
        empty.needed()
    assert not Polytope.from_constraints(
        [[1.0, 0.0], [0.0, 1.0], [0.0, -1.0]], [2.0, 10.0, 11.0]
    ).is_bounded


@pytest.mark.parametrize(
    ("normal", "lower", "upper"),
    [
        ([1, 0, 0], 0.7, 0.5),
        ([1000, 0, 0], 700, 500),
        ([1, 0, 0], 2.7, 2.5),
        ([1, 0, 0], np.nextafter(0.5, 1.0), 0.5),
        ([1, 0, 0], -np.inf, -np.inf),
        ([1, 0, 0], np.inf, np.inf),
    ],
)
def test_cut_by_a_strip_without_points_is_empty(
    normal: list[float], lower: float, upper: float
) -> None:
    cube = Polytope.from_box([0.0] * 3, [1.0] * 3)

    assert cube.cut(normal, lower, upper).is_empty


def test_difference_and_intersection_without_points_are_empty() -> None:
    floor = Polytope.from_box([0, 0, 0], [1, 1, 0])
    tall = Polytope.from_box([0, 0, 0], [1.5, 1, 0.2])
    assert floor.minkowski_difference(tall).is_empty
    assert (Polytope.from_vertices([[2, 2], [3, 3]]) & Polytope.from_box([0, 0], [1, 1])).is_empty


def test_operations_on_the_empty_set_are_empty_and_its_points_do_not_exist() -> None:
    empty = Polytope.empty(3)
    box = Polytope.from_box([0.0] * 3, [1.0] * 3)
    made = [
        empty & box,
        box & empty,
        empty + box,
        box + empty,
        np.eye(3) @ empty,
        empty.translate([1.0, 0.0, 0.0]),
        empty.preimage(np.eye(3)),
        empty.cut([1.0, 0.0, 0.0], 0.0, 1.0),
        empty.slice([0], 0.0),
        empty.project([0, 1]),
        empty.minkowski_difference(box),
        empty.reduce_outward(6),
        empty.convex_hull(empty),
        box & Polytope.from_box([2.0] * 3, [3.0] * 3),
        box.cut([1.0, 0.0, 0.0], 0.75, 0.25),
    ]
    assert all(one.is_empty for one in made)

    assert empty.convex_hull(box).equals(box)
    assert (empty.volume(), empty.diameter(), empty.distance(box)) == (0.0, 0.0, np.inf)
    assert empty <= box
    assert not box <= empty
    assert [0.5] * 3 not in empty
    assert float(empty.support_function([1.0, 0.0, 0.0])) == -np.inf
    assert repr(empty) == "<empty polytope in R^3: 0 vertices, 0 facets>"

    for measure in (
        empty.centroid,
        empty.bounding_box,
        empty.chebyshev_centre,
        lambda: empty.sample(3),
    ):
        with pytest.raises(EmptyPolytopeError):
            measure()
    with pytest.raises(ValueError, match="unbounded"):
        box.minkowski_difference(empty)
    with pytest.raises(ValueError, match=r"in R\^3"):
        empty.distance(Polytope.from_box([0.0, 0.0], [1.0, 1.0]))


@pytest.mark.parametrize("small", [1e-3, 1e-6, 3e-7, 1e-9])
def test_part_that_is_far_smaller_than_the_sets_is_found_in_its_own_coordinates(
    small: float,
) -> None:
    """Parts that are 1e12 times narrower than the first set were a point or a segment beside the
    part.
    """
    wide = 1.0 / small
    tall = Polytope.from_box([-small, -wide], [small, wide])
    broad = Polytope.from_box([-wide, -small], [wide, small])
    both = tall & broad
    assert both.contains([[-small, -small], [small, small], [-small, small]]).all()
    np.testing.assert_allclose(both.bounding_box(), [[-small] * 2, [small] * 2], rtol=1e-9)

    line = Polytope.from_vertices([[-wide, 0.0], [wide, 0.0]])
    square = Polytope.from_box([-small] * 2, [small] * 2)
    for piece in (line & square, square & line):
        np.testing.assert_allclose(
            piece.bounding_box(), [[-small, 0.0], [small, 0.0]], rtol=1e-9, atol=1e-300
        )

    less = Polytope.from_box([0.0] * 2, [1e6] * 2).minkowski_difference(
        Polytope.from_box([0.0] * 2, [1e6 - small] * 2)
    )
    assert less.contains([small / 2.0] * 2)


@pytest.mark.parametrize("scale", list(itertools.permutations([1.0, 1e-9, 1e-4])))
def test_set_with_axes_of_very_different_sizes_is_not_flat(scale: tuple[float, ...]) -> None:
    """Formerly a set with axes 1e9 times longer than others counted as flat."""
    points = np.random.default_rng(0).uniform(-1.0, 1.0, (12, 3))
    plain = Polytope.from_vertices(points)

    found = Polytope.from_vertices(points * scale)

    assert (found.dimension, len(found.vertices)) == (3, len(plain.vertices))
    assert found.volume() == pytest.approx(plain.volume() * np.prod(scale), rel=1e-12)
    again = Polytope.from_constraints(*found.constraints())
    for end, wanted in zip(again.bounding_box(), plain.bounding_box(), strict=True):
        assert end / scale == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize(("space", "most"), [(1, 1.0), (2, 1.09), (3, 1.13), (4, 1.17), (5, 1.19)])
def test_polytopes_of_a_ball_are_larger_or_smaller_by_the_documented_factor(
    space: int, most: float
) -> None:
    outer = Polytope.from_ball(np.ones(space), 2.0)
    inner = Polytope.from_ball(np.ones(space), 2.0, outer=False)

    for one, depth in ((outer, 2.0), (inner, 2.0 / most)):
        assert (one.offsets - one.normals.sum(axis=1)).min() >= depth - 1e-14
        assert np.linalg.norm(one.normals, axis=1) == pytest.approx(1.0)
        # A hull of the 3840 points of R^5 takes long.
        if space < 5:
            hull = Polytope.from_vertices(one.vertices)
            assert len(hull.vertices) == len(one.vertices)
            assert len(hull.normals) == len(one.normals)
            assert hull.equals(one, 1e-12)
    assert outer.chebyshev_centre()[1] == pytest.approx(2.0)
    assert np.linalg.norm(inner.vertices - 1.0, axis=1) == pytest.approx(2.0)
    assert np.linalg.norm(outer.vertices - 1.0, axis=1).max() <= 2.0 * most


@pytest.mark.parametrize("outer", [True, False])
def test_polytope_of_a_ball_that_is_smaller_than_rounding_is_flat(outer: bool) -> None:
    assert Polytope.from_ball([1e10, 1.0], 1e-8, outer=outer).dimension < 2


def test_polytope_of_a_zonotope_has_its_support_function() -> None:
    generators = np.random.default_rng(0).normal(size=(5, 3))
    zonotope = Polytope.from_zonotope(Zonotope([1.0, 2.0, 3.0], generators))
    directions = np.random.default_rng(1).normal(size=(20, 3))
    wanted = directions @ [1.0, 2.0, 3.0] + np.abs(directions @ generators.T).sum(axis=1)

    np.testing.assert_allclose(zonotope.support_function(directions), wanted, rtol=1e-12)
    assert Polytope.from_zonotope(Zonotope([1.0, 2.0], [])).dimension == 0


# Published cases
# --------------------------------------------------------------------------------------------------

THERE_AND_BACK = [
    # cddlib issue 34 (also CDDLib.jl issue 47): "Numerically inconsistent"; vertices were doubled
    # 2.5e-9 apart here.
    [(-8.02, -2.955, -2.412), (-7.942, -2.622, -2.362), (-7.956, -1.271, -2.403),
     (-7.878, -0.937, -2.353), (-7.763, 1.284, -2.392), (-7.685, 1.617, -2.342),
     (-7.699, 2.968, -2.383), (-7.621, 3.301, -2.333), (-6.495, 3.278, -1.779),
     (0.773, 3.13, -2.645)],
    # pycvxset, test_polytope_unary.py: a quadrangle; the cross-polytope; a simplex.
    [(1.9, 0.2), (0.0, -2.0), (-0.3, 0.17), (3.0, 4.01)],
    [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (-1.0, 0.0, 0.0), (0.0, -1.0, 0.0),
     (0.0, 0.0, -1.0)],
    [(1.0, 0.0), (0.0, 1.0), (0.0, 0.0)],
    # pycvxset issue 4: a segment.
    [(3.0, 2.4), (6.0, 4.8)],
    # zonoopt, test of vrep_2_hybzono: two of its polygons.
    [(5.566, 5.896), (4.044, 5.498), (5.32, 3.909), (5.599, 4.082)],
    [(0.049, 6.05), (-0.248, 3.881), (0.617, 3.981)],
]  # fmt: skip


@needs_ppl
@pytest.mark.parametrize("points", THERE_AND_BACK)
def test_published_vertices_come_back(points: list[tuple[float, ...]]) -> None:
    hull = Polytope.from_vertices(points)
    again = Polytope.from_constraints(*hull.constraints())
    exact = rounded(polyhedron_of(exactly(np.array(points))))
    assert len(hull.vertices) == len(again.vertices) == len(exact.vertices)
    for one in (hull, again):
        gaps = np.abs(one.vertices[:, None] - exact.vertices[None]).max(axis=-1) / one.scale.max()
        assert (gaps.min(axis=1) <= vertex_errors(one)).all()


def vertex_errors(one: Polytope) -> Floats:
    """Bounds of the errors of vertices, in scaled coordinates, shape (v,), for every order of
    operations.

    A vertex counts as on a row within `ON` of each coordinate, as the same as another one within
    `SNAP`, and moves to the outer sides of its rows by at most `SNAP`. A vertex with the matrix of
    rows R and heights h is within |h| / s of the exact one, with s the least singular value of R.
    """
    errors = []
    for on in one.incidence:
        rows = np.vstack([one.facets[on], one.equations])[:, :-1]
        least = float(np.linalg.svd(rows)[1][: one.space].min())
        errors.append(np.sqrt(len(rows)) * ((one.space + 1) * ON + 2.0 * SNAP) / least)
    return np.array(errors)


CONSTRAINTS: list[tuple[list[tuple[float, ...]], int]] = [
    # Rows (b, -a) of b - a x >= 0 with the number of vertices. cddlib issue 34, of 19 August 2026:
    # a ray was reported.
    ([(1.3660253171818983, -0.49999999999999994, -0.8660254037844387),
      (0.36602545378443874, -0.8660254037844387, 0.49999999999999994),
      (1, 0, 1), (1, -1, 0), (1, 0, -1), (1, 1, 0)], 5),
    # cddlib issue 67: two of five vertices were missing.
    ([(-0.5367662906646729, 0.9292178750038147, 0.36953237652778625),
      (0.39611172676086426, 0.058287363499403, -0.9982998371124268),
      (-0.17240175604820251, -0.0582873672246933, 0.9982998371124268),
      (-0.45, 1, 0), (0.45, 0, -1), (-0.35, 0, 1)], 5),
    # LazySets issue 918: infeasible constraints had vertices.
    ([(0, -1, -1), (-1, 1, 0), (-1, 0, 1)], 0),
    # LazySets issue 994: a triangle.
    ([(0.25, 0, -1), (0.25, -1, 0), (0, 1, 1)], 3),
    # polytope, tulip-control issue 23: boxes of 30000 and 40000 by 25; the result depended on the
    # order.
    ([(30000, -1, 0), (25, 0, -1), (0, 1, 0), (0, 0, 1),
      (40000, -1, 0), (25, 0, -1), (0, 1, 0), (0, 0, 1)], 4),
    ([(40000, -1, 0), (25, 0, -1), (0, 1, 0), (0, 0, 1),
      (30000, -1, 0), (25, 0, -1), (0, 1, 0), (0, 0, 1)], 4),
    # pycvxset issue 2: the unit square. test_polytope_binary.py: an empty box.
    ([(1, -1, 0), (1, 0, -1), (0, 1, 0), (0, 0, 1)], 4),
    ([(-1, -1, 0), (-1, 0, -1), (-1, 1, 0), (-1, 0, 1)], 0),
]  # fmt: skip


@pytest.mark.parametrize(("rows", "count"), CONSTRAINTS)
def test_published_constraints_have_the_published_number_of_vertices(
    rows: list[tuple[float, ...]], count: int
) -> None:
    array = np.array(rows, dtype=float)
    polygon = ConvexPolygons.from_constraints(-array[:, 1:], array[:, 0])
    polytope = Polytope.from_constraints(-array[:, 1:], array[:, 0])

    assert int(polygon.counts) == len(polytope.vertices) == count
    gaps = np.abs(polytope.vertices[:, None] - polygon.polygon()[None]).max(axis=-1, initial=0.0)
    assert count == 0 or float(gaps.min(axis=1).max()) <= 1e-11 * float(
        np.abs(polygon.polygon()).max()
    )


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize(
    "large", [[1e9, 1.0, 1e-9], [1e9, 1.0, 1.0], [1e9, 1e9, 1e9], [1.0, 1.0, 1e-9]]
)
def test_intersections_with_sets_that_are_a_billion_times_larger(
    large: list[float], size: float
) -> None:
    upper = np.array(large)
    both = Polytope.from_box(np.zeros(3), upper) & Polytope.from_box(np.zeros(3), np.full(3, size))
    lower, most = both.bounding_box()
    np.testing.assert_allclose(most, np.minimum(upper, size), rtol=1e-9, atol=1e-12 * most.max())
    np.testing.assert_allclose(lower, 0.0, rtol=0.0, atol=1e-12 * most.max())


@pytest.mark.parametrize("states", [2, 3, 4])
def test_simplex_is_divided_into_one_simplex(states: int) -> None:
    """A triangulation by Qhull needs one point more; a flat triangle in R^3 is one too."""
    corners = np.vstack([np.zeros(states), np.eye(states)])
    for points in (corners, np.hstack([corners, np.full((states + 1, 1), 0.25)])):
        simplex = Polytope.from_vertices(points)
        assert simplex.centroid() == pytest.approx(points.mean(axis=0), rel=1e-14)
        assert simplex.contains(simplex.sample(50), 1e-12).all()


def test_constraints_that_leave_a_direction_free_give_an_unbounded_set() -> None:
    """Issue 93 of polytope: vertices of 3e13 were returned for the free direction (0, 0, 1, 1)."""
    rows = np.array(
        [
            [-1, 0, 0, 0],
            [0, 1, 0, 0],
            [0.5, -0.5, 0.5, -0.5],
            [0.5, -0.5, -0.5, 0.5],
            [0.5, 0.5, 0.5, -0.5],
            [0, 0, -1, 0],
        ]
    )
    found = Polytope.from_constraints(rows, [-0.33333, 0.3125, 0.05724, -0.01478, 0.3566, -0.16667])
    np.testing.assert_allclose(found.directions, [[0.0, 0.0, 0.5**0.5, 0.5**0.5]], rtol=1e-15)


def test_segment_contains_its_points_and_meets_lines_in_points() -> None:
    """Issue 4 of pycvxset."""
    segment = Polytope.from_vertices([[3.0, 2.4], [6.0, 4.8]])
    inside = segment.contains([[3.0, 2.4], [6.0, 4.8], [2.97, 2.376], [3.97, 3.176]])
    assert inside.tolist() == [True, True, False, True]
    assert segment.cut([1.0, 0.0], 2.97, 2.97).is_empty
    np.testing.assert_allclose(
        segment.cut([1.0, 0.0], 3.97, 3.97).vertices, [[3.97, 3.176]], rtol=1e-12
    )


def test_difference_of_a_flat_square_and_a_cube_is_empty_and_with_itself_a_point() -> None:
    """From test_polytope_binary.py of pycvxset."""
    flat = Polytope.from_box([-1.0, -1.0, 0.0], [1.0, 1.0, 0.0])
    assert flat.minkowski_difference(Polytope.from_box([-1.0] * 3, [1.0] * 3)).is_empty
    np.testing.assert_allclose(
        flat.minkowski_difference(flat).vertices, [[0.0, 0.0, 0.0]], atol=1e-12
    )


def test_projection_of_a_cylinder_is_its_base() -> None:
    """From test_polytope_unary.py of pycvxset."""
    cylinder = [[-1, 0, 0], [0, -1, 0], [1, 1, 0], [0, 0, 1], [0, 0, -1]]
    shade = Polytope.from_constraints(cylinder, [0, 0, 1, 1, 1]).project([0, 1])
    assert shade.equals(Polytope.from_vertices([[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]]), 1e-12)


@pytest.mark.parametrize("space", [2, 3])
def test_facets_of_an_image_exclude_none_of_its_exact_vertices(space: int) -> None:
    """In rationals, in the coordinates of the image: formerly one of two such maps, by up to
    1e-16.
    """
    random = np.random.default_rng(space)
    mapped = 0
    exact = np.vectorize(Fraction, otypes=[object])
    for _ in range(100):
        matrix = random.integers(-7, 8, (space, space)).astype(float)
        if abs(np.linalg.det(matrix)) < 0.5:
            continue
        lower = random.integers(-5, 0, space)
        upper = random.integers(1, 6, space)
        image = Polytope.from_box(lower, upper).linear_map(matrix)
        mapped += 1
        facets, centre, scale = map(exact, (image.facets, image.centre, image.scale))
        for corner in itertools.product(*zip(lower.tolist(), upper.tolist(), strict=True)):
            point = (exact(matrix) @ np.array(corner) - centre) / scale
            assert (facets[:, :-1] @ point <= facets[:, -1]).all()
    assert mapped > 50


def test_facets_of_a_sum_with_a_segment_exclude_no_exact_point_of_it() -> None:
    """In rationals, in the coordinates of the sum.

    Of integers, points of the sum are not rounded. A facet along the segment was formerly not moved
    by the rounding of its height, whose terms cancel: one of these sets lacked 3e-17.
    """
    random = np.random.default_rng(3)
    exact = np.vectorize(Fraction, otypes=[object])
    summed = 0
    for _ in range(100):
        corners = random.integers(-3, 4, (random.integers(6, 14), 3)).astype(float)
        half = random.integers(-3, 4, 3).astype(float)
        hull = Polytope.from_vertices(corners)
        if hull.dimension < 3 or not half.any():
            continue
        found = hull.add_segment(half)
        summed += 1
        facets, centre, scale = map(exact, (found.facets, found.centre, found.scale))
        for corner, side in itertools.product(corners, (1, -1)):
            point = (exact(corner) + side * exact(half) - centre) / scale
            assert (facets[:, :-1] @ point <= facets[:, -1]).all()
    assert summed > 80


def test_segment_that_underflows_is_ignored() -> None:
    box = Polytope.from_box([-1e5] * 3, [1e5] * 3)
    assert box.add_segment([1e-320, 0.0, 0.0]).equals(box)


def test_cut_that_leaves_a_billionth_of_a_set_is_precise() -> None:
    box = Polytope.from_box([0, 0, 0], [1e9, 1, 1])
    np.testing.assert_allclose(box.cut([1, 0, 0], upper=1.0).volume(), 1.0, rtol=1e-9)
    np.testing.assert_allclose(box.cut([1, 1, 1], upper=1.0).volume(), 1.0 / 6.0, rtol=1e-9)
