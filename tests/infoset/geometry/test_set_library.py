"""Operations on two polygons, or on constraints, against exact rationals, and in batches.

The oracle, the cases and the tolerances are described in `test_polygon_oracle`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import assume, example, given
from hypothesis import strategies as st
from numpy.typing import ArrayLike
from scipy.optimize import linprog

from infoset import ConvexPolygons, Zonotope
from infoset.arrays import Floats
from tests.infoset.geometry.test_polygon_oracle import (
    ANGLE,
    AXES,
    CASES,
    FAT_CASES,
    SCALE,
    SOME,
    UNIT,
    Case,
    Exact,
    U,
    assert_same_set,
    case_of,
    dot,
    exact,
    exact_clip,
    exact_sum,
    hull,
    normals_of,
    outside_by,
    probes,
    turn,
)
from tests.rationals import Fraction

ZERO = Fraction(0)


def exact_intersection(one: Sequence[Exact], other: Sequence[Exact]) -> list[Exact]:
    """Return the part of one polygon within the sides and the bounding box of another one."""
    kept = list(one) if other else []
    for normal in normals_of(other) + AXES:
        if kept:
            kept = exact_clip(kept, normal, None, max(dot(normal, p) for p in other))
    return kept


def exact_difference(one: Sequence[Exact], other: Sequence[Exact]) -> list[Exact]:
    """Return the Pontryagin difference of two polygons.

    It is the intersection of the translates of one by the vertices of the other.
    """
    kept: list[Exact] | None = None
    for x, y in other:
        moved = [(p[0] - x, p[1] - y) for p in one]
        kept = moved if kept is None else exact_intersection(kept, moved)
    assert kept is not None
    return kept


def holds(polygon: Sequence[Exact], point: Exact) -> bool:
    return bool(exact_intersection([point], polygon))


@st.composite
def partners(draw: st.DrawFn, case: Case) -> Case:
    """A polygon that shares vertices or sides with another one, or is in it, or crosses it."""
    corners = [(float(x), float(y)) for x, y in case.exact]
    low = np.min(corners, axis=0)
    high = np.max(corners, axis=0)
    kind = draw(st.sampled_from(["any", "shared", "inside", "across", "sliver", "moved"]))
    if kind == "any":
        return draw(CASES)
    if kind == "moved":
        dx = draw(UNIT) * (high[0] - low[0])
        dy = draw(UNIT) * (high[1] - low[1])
        return case_of([(x + dx, y + dy) for x, y in corners])

    unit = draw(st.lists(st.tuples(UNIT, UNIT), min_size=1, max_size=7))
    within = [
        (low[0] + abs(x) * (high[0] - low[0]), low[1] + abs(y) * (high[1] - low[1]))
        for x, y in unit
    ]
    if kind == "inside":
        return case_of(within)
    if kind == "shared":
        i = draw(st.integers(0, len(corners) - 1))
        a = corners[i - 1]
        b = corners[i]
        return case_of([a, (0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])), *within[:3]])

    wide = [
        (x + 3.0 * draw(UNIT) * (high[0] - low[0]), y + 3.0 * draw(UNIT) * (high[1] - low[1]))
        for x, y in within
    ]
    if kind == "across":
        return case_of(wide)
    # A sliver through points of the polygon: its ends torn apart by a few units of rounding or by
    # 1e-12 of its length.
    part = draw(st.sampled_from([1e-16, 1e-15, 1e-12, 1e-7]))
    a = wide[0]
    b = within[-1]
    across = (part * (b[1] - a[1]), -part * (b[0] - a[0]))
    return case_of(
        [a, b, (a[0] + across[0], a[1] + across[1]), (b[0] + across[0], b[1] + across[1])]
    )


PAIRS = CASES.flatmap(lambda case: st.tuples(st.just(case), partners(case)))


# Two polygons
# --------------------------------------------------------------------------------------------------


@SOME
@given(PAIRS)
def test_intersection_is_empty_only_if_the_exact_one_is(pair: tuple[Case, Case]) -> None:
    """Nonempty exactly where the exact one is, and each vertex within 8 ulp of the coordinates."""
    one, other = pair
    wanted = exact_intersection(one.exact, other.exact)
    for got in (one.polygon & other.polygon, other.polygon & one.polygon):
        assert got.is_empty == (not wanted)
        size = (min(one.size[0], other.size[0]), min(one.size[1], other.size[1]))
        assert_same_set(got, wanted, (16 * U * size[0], 16 * U * size[1]))
        assert int(got.counts) <= int(one.polygon.counts + other.polygon.counts)


@st.composite
def slivers(draw: st.DrawFn) -> Case:
    """A triangle or a quadrangle as thin as a few units of rounding, up to 1e-6 of its length."""
    angle = draw(ANGLE)
    thickness = draw(st.sampled_from([1e-16, 1e-15, 1e-14, 1e-12, 1e-9, 1e-6]))
    x = draw(UNIT)
    y = draw(UNIT)
    c = math.cos(angle)
    s = math.sin(angle)
    local = [
        (-2.0, 0.0),
        (2.0, 0.0),
        (draw(UNIT), thickness),
        (draw(UNIT), -thickness * abs(draw(UNIT))),
    ]
    return case_of([(x + c * u - s * v, y + s * u + c * v) for u, v in local])


@SOME
@given(slivers(), slivers())
def test_intersection_of_slivers_is_exact_up_to_rounding(one: Case, other: Case) -> None:
    """Within 16 units of rounding of the coordinates of both.

    If one is on an axis, the other gives the scale.
    """
    wanted = exact_intersection(one.exact, other.exact)
    got = one.polygon & other.polygon

    assert got.is_empty == (not wanted)

    size = (max(one.size[0], other.size[0]), max(one.size[1], other.size[1]))
    assert_same_set(got, wanted, (16 * U * size[0], 16 * U * size[1]))


@SOME
@given(PAIRS)
def test_subsets_and_equality_are_decided_exactly(pair: tuple[Case, Case]) -> None:
    one, other = pair

    for inner, outer in ((one, other), (other, one)):
        assert (inner.polygon <= outer.polygon) == all(holds(outer.exact, p) for p in inner.exact)
    assert one.polygon.equals(other.polygon) == (set(one.exact) == set(other.exact))
    assert one.polygon.equals(one.polygon)
    assert one.polygon <= one.polygon.convex_hull(other.polygon)


@SOME
@given(CASES, st.data())
def test_membership_is_decided_exactly(case: Case, data: st.DataObject) -> None:
    probe = data.draw(probes(case))

    assert (
        case.polygon.contains(probe)
        == (probe in case.polygon)
        == holds(case.exact, exact([probe])[0])
    )

    reach = float(max(*case.size, abs(Fraction(probe[0])), abs(Fraction(probe[1]))))
    away = float(case.polygon.distance(probe))

    assert case.polygon.contains(probe, tolerance=away + 1e-15 * reach)


@SOME
@given(PAIRS)
def test_hull_of_a_union_has_exactly_its_vertices(pair: tuple[Case, Case]) -> None:
    one, other = pair
    got = one.polygon.convex_hull(other.polygon)
    assert set(exact(got.polygon())) == set(hull(one.exact + other.exact))


@SOME
@given(PAIRS)
def test_difference_is_empty_only_if_the_exact_one_is(pair: tuple[Case, Case]) -> None:
    """Nonempty exactly where the exact one is, and each vertex within 4 ulp of the coordinates."""
    one, other = pair
    wanted = exact_difference(one.exact, other.exact)
    got = one.polygon.minkowski_difference(other.polygon)

    assert got.is_empty == (not wanted)

    size = (one.size[0] + other.size[0], one.size[1] + other.size[1])
    assert_same_set(got, wanted, (4 * U * size[0], 4 * U * size[1]))


def two_digits(values: ArrayLike) -> Floats:
    return np.round(np.asarray(values), 2) + 0.0


def test_difference_of_sets_that_fit_in_one_place_is_decided_exactly() -> None:
    """Parallelograms with coordinates of two digits, less three of their vertices or a side.

    These are moved in some cases. Without exact decisions a third of the differences that are a
    point, or nearly a point, would be empty.
    """
    one = ConvexPolygons.from_vertices([(0, 0), (-0.4, 0), (-0.5, -0.3), (-0.1, -0.3)])
    part = ConvexPolygons.from_vertices([(0, 0), (-0.4, 0), (-0.1, -0.3)])

    assert part <= one
    assert one.minkowski_difference(part).polygon().tolist() == [[0.0, 0.0]]

    random = np.random.default_rng(3)
    kinds = {0: 0, 1: 0, 2: 0}
    for number in range(500):
        corner, along, across, offset = two_digits(random.uniform(-1.0, 1.0, (4, 2)))
        ring = two_digits([corner, corner + along, corner + along + across, corner + across])
        if len(set(map(tuple, ring))) < 4 or turn(*exact(ring[:3])) == 0:
            continue
        share = two_digits(ring[: 3 - number % 2] + (offset if number % 3 == 0 else 0.0))
        outer = ConvexPolygons.from_points(ring)
        inner = ConvexPolygons.from_points(share)
        wanted = exact_difference(exact(outer.polygon()), exact(inner.polygon()))
        got = outer.minkowski_difference(inner)
        assert got.is_empty == (not wanted)
        assert_same_set(got, wanted, (4 * U, 4 * U))
        kinds[min(len(hull(wanted)), 2)] += 1

    assert min(kinds.values()) > 50


def test_difference_of_boxes_is_exact() -> None:
    small = ConvexPolygons.from_box((0, 0), (0.5, 0.25))
    box = ConvexPolygons.from_box((0.1, 0.2), (3.7, 9.1)).minkowski_difference(small)
    assert [end.tolist() for end in box.bounding_box()] == [[0.1, 0.2], [3.7 - 0.5, 9.1 - 0.25]]


def exact_distance_between(one: Sequence[Exact], other: Sequence[Exact]) -> float:
    if exact_intersection(one, other):
        return 0.0
    minimum: list[Fraction] = []
    for points, sides in ((one, other), (other, one)):
        for a, b in zip(sides, [*sides[1:], sides[0]], strict=True):
            edge = (b[0] - a[0], b[1] - a[1])
            length = dot(edge, edge)
            for p in points:
                away = (p[0] - a[0], p[1] - a[1])
                part = min(Fraction(1), max(ZERO, dot(edge, away) / length)) if length else ZERO
                gap = (away[0] - part * edge[0], away[1] - part * edge[1])
                minimum.append(dot(gap, gap))
    return math.sqrt(min(minimum))


@SOME
@given(PAIRS)
def test_distances_are_zero_only_if_the_sets_meet(pair: tuple[Case, Case]) -> None:
    """Zero exactly where the sets meet; otherwise the error scales with the coordinates."""
    one, other = pair
    tolerance = 32 * float(U) * float(max(*one.size, *other.size))
    wanted = exact_distance_between(one.exact, other.exact)
    got = float(one.polygon.distance(other.polygon))

    assert (got == 0.0) == (wanted == 0.0)
    assert abs(got - wanted) <= tolerance

    spread = max(exact_distance_between([p], other.exact) for p in one.exact)
    spread = max([spread, *(exact_distance_between([p], one.exact) for p in other.exact)])

    assert abs(float(one.polygon.hausdorff_distance(other.polygon)) - spread) <= tolerance

    far = max(
        dot((a[0] - b[0], a[1] - b[1]), (a[0] - b[0], a[1] - b[1]))
        for a in one.exact
        for b in one.exact
    )
    assert float(one.polygon.diameter()) == pytest.approx(math.sqrt(far), rel=1e-14)

    for point in other.polygon.polygon():
        near = one.polygon.closest_point(point)
        assert outside_by(exact([near]), one.exact, one.box()) is None
        direct = exact_distance_between(exact([point]), one.exact)
        assert abs(math.hypot(*(near - point)) - direct) <= tolerance


# Constraints
# --------------------------------------------------------------------------------------------------


@st.composite
def half_planes(draw: st.DrawFn) -> list[tuple[float, float, float]]:
    """Rows (a, b, c): round a point, through common points, parallel, redundant, contradictory."""
    rows = []
    at = draw(st.tuples(UNIT, UNIT))
    for _ in range(draw(st.integers(1, 7))):
        angle = draw(st.one_of(ANGLE, st.integers(0, 7).map(lambda k: k * math.pi / 4)))
        a = math.cos(angle)
        b = math.sin(angle)
        if draw(st.booleans()):
            a = round(a, 1)
            b = round(b, 1)
        a, b = (
            value if abs(value) > 1e-100 else 0.0 for value in (a, b)
        )  # smaller numbers are outside the limits
        scale = draw(SCALE)
        c = a * at[0] + b * at[1] + draw(st.sampled_from([0.0, 1.0, 1e-9, 1e3, -1e-3, 0.1]))
        rows.append((a * scale, b * scale, c * scale))
    if draw(st.booleans()):
        size = draw(SCALE)
        rows += [(1.0, 0.0, size), (-1.0, 0.0, size), (0.0, 1.0, size), (0.0, -1.0, size)]

    return draw(st.permutations(rows))


@SOME
@given(half_planes())
def test_set_of_constraints_is_empty_or_unbounded_only_if_the_exact_one_is(
    rows: list[tuple[float, float, float]],
) -> None:
    """Empty and unbounded sets are found exactly; each vertex is within 4 ulp of itself."""
    far = Fraction(10) ** 40
    wanted: list[Exact] = [(-far, -far), (far, -far), (far, far), (-far, far)]
    for a, b, c in rows:
        wanted = (
            exact_clip(wanted, (Fraction(a), Fraction(b)), None, Fraction(c))
            if (a, b) != (0.0, 0.0)
            else wanted
        )
        wanted = wanted if wanted and ((a, b) != (0.0, 0.0) or c >= 0.0) else []

    array = np.array(rows)
    if any(max(abs(x), abs(y)) == far for x, y in wanted):
        with pytest.raises(ValueError, match="the set is unbounded"):
            ConvexPolygons.from_constraints(array[:, :2], array[:, 2])
        return

    got = ConvexPolygons.from_constraints(array[:, :2], array[:, 2])

    assert got.is_empty == (not wanted)
    for point in exact(got.polygon()):
        assert (
            min(
                max(abs(point[0] - x) - 4 * U * abs(x), abs(point[1] - y) - 4 * U * abs(y))
                for x, y in wanted
            )
            <= 0
        )

    if wanted:
        size = max(abs(x) for x, _ in wanted), max(abs(y) for _, y in wanted)
        assert_same_set(got, wanted, (4 * U * size[0], 4 * U * size[1]))


@SOME
@given(CASES)
def test_set_of_its_constraints_is_the_polygon(case: Case) -> None:
    normals, offsets = case.polygon.constraints()

    assert np.hypot(*normals.T) == pytest.approx(1.0)
    assert float((case.polygon.polygon() @ normals.T - offsets).max()) <= 1e-15 * float(
        max(case.size)
    )

    length = math.hypot(*case.extent)
    if len(case.exact) > 2 and float(abs(turn(*case.exact[:3]))) > 1e-3 * length**2:
        again = ConvexPolygons.from_constraints(normals, offsets)
        assert float(again.hausdorff_distance(case.polygon)) <= 1e-10 * float(max(case.size))


@SOME
@given(FAT_CASES, st.tuples(UNIT, UNIT, UNIT, UNIT), st.tuples(UNIT, UNIT))
def test_image_of_the_preimage_is_the_polygon(
    case: Case, entries: tuple[float, ...], offset: tuple[float, float]
) -> None:
    """They are equal to rounding; the preimage under a singular matrix is unbounded."""
    matrix = np.array([[2.0 + entries[0], entries[1]], [entries[2], 2.0 + entries[3]]])
    assume(abs(float(np.linalg.det(matrix))) > 0.5)
    size = float(max(*case.size, *(abs(Fraction(x)) for x in offset)))
    back = case.polygon.preimage(matrix, offset)
    for image in (
        back.affine_map(matrix, offset),
        case.polygon.affine_map(matrix, offset).preimage(matrix, offset),
    ):
        box = (Fraction(64 * size) * U * 8, Fraction(64 * size) * U * 8)
        wide = exact_sum(
            case.exact, [(x * box[0], y * box[1]) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        )
        assert outside_by(exact(image.polygon()), wide, box) is None
        if float(case.polygon.area()) > 1e-3 * size**2:
            assert float(image.hausdorff_distance(case.polygon)) <= 1e-6 * size

    with pytest.raises(ValueError, match="unbounded"):
        case.polygon.translate(-case.polygon.centroid()).preimage([[1.0, 0.0], [0.0, 0.0]])


# One polygon
# --------------------------------------------------------------------------------------------------


@SOME
@given(CASES)
@example(
    case_of(
        [
            (0.0, 0.0),
            (-8.270011920337144e-25, -3.784833429991908e-25),
            (-0.2080734182735712, 0.454648713412840),
        ]
    )
)
def test_largest_disc_is_in_the_polygon_and_as_large_as_a_linear_program_finds(case: Case) -> None:
    """The programs are about a corner, in units of the extent."""
    centre, radius = case.polygon.chebyshev_centre()
    size = float(max(case.size))

    assert outside_by(exact([centre]), case.exact, case.box(few=64)) is None
    assert float(case.polygon.margin(centre)) >= float(radius) - 64 * float(U) * size

    corners = np.array(
        [[float(x - case.exact[0][0]), float(y - case.exact[0][1])] for x, y in case.exact]
    )
    width = float(np.abs(corners).max())
    if len(case.exact) < 3:
        assert radius == 0.0
        return

    sides = zip(case.exact, [*case.exact[1:], case.exact[0]], strict=True)
    along = np.array([[float(q[0] - p[0]), float(q[1] - p[1])] for p, q in sides])
    normals = np.column_stack([along[:, 1], -along[:, 0]]) / np.hypot(*along.T)[:, None]
    limits = (normals * corners).sum(axis=1) / width
    rows = np.column_stack([normals, np.ones(len(normals))])
    best = linprog([0.0, 0.0, -1.0], A_ub=rows, b_ub=limits, bounds=(None, None), method="highs")

    assert best.status == 0
    assert float(radius) >= -best.fun * width - 1e-6 * width


@SOME
@given(CASES, st.integers(0, 1), UNIT)
def test_projection_slice_and_samples_are_exact_up_to_rounding(
    case: Case, axis: int, part: float
) -> None:
    lower, upper = (float(end) for end in case.polygon.project(axis))

    assert (lower, upper) == (
        float(min(p[axis] for p in case.exact)),
        float(max(p[axis] for p in case.exact)),
    )

    value = lower + abs(part) * (upper - lower)
    normal = AXES[axis]
    line = exact_clip(case.exact, normal, Fraction(value), Fraction(value))
    if line:
        ends = case.polygon.slice(axis, value)
        wanted = min(p[1 - axis] for p in line), max(p[1 - axis] for p in line)
        for end, exact_end in zip(ends, wanted, strict=True):
            assert abs(Fraction(float(end)) - exact_end) <= case.box()[1 - axis]

    points = case.polygon.sample(50, seed=1)

    assert outside_by(exact(points), case.exact, case.box()) is None


@pytest.mark.parametrize("sides", [3, 4, 7, 64])
def test_polygons_of_balls_and_zonotopes_have_their_supports(sides: int) -> None:
    centre = (1.0, -2.0)
    outer, inner = (
        ConvexPolygons.from_ball(centre, 3.0, sides, outer=outer) for outer in (True, False)
    )

    assert float(outer.margin(centre)) == pytest.approx(3.0, rel=1e-14)
    assert np.hypot(*(inner.polygon() - centre).T) == pytest.approx(3.0, rel=1e-14)
    assert (int(outer.counts), int(inner.counts)) == (sides, sides)

    generators = np.random.default_rng(sides).normal(size=(sides, 2))
    zonotope = ConvexPolygons.from_zonotope(Zonotope(centre, generators))

    assert int(zonotope.counts) == 2 * sides

    directions = np.random.default_rng(1).normal(size=(20, 2))
    wanted = directions @ centre + np.abs(directions @ generators.T).sum(axis=1)

    np.testing.assert_allclose(
        zonotope.broadcast_to((20,)).support_function(directions), wanted, rtol=1e-14
    )
    np.testing.assert_allclose(zonotope.area(), Zonotope(centre, generators).volume(), rtol=1e-13)
    assert ConvexPolygons.from_zonotope(Zonotope(centre, [])).polygon().tolist() == [list(centre)]


# Rings
# --------------------------------------------------------------------------------------------------


@SOME
@given(FAT_CASES, st.data())
def test_rings_of_both_orders_give_the_polygon(case: Case, data: st.DataObject) -> None:
    """Rings may be clockwise or closed, repeat vertices, and have vertices along a side."""
    assume(len(case.exact) > 2)
    ring = [tuple(map(float, p)) for p in case.exact]
    start = data.draw(st.integers(0, len(ring) - 1))
    ring = ring[start:] + ring[:start]
    if data.draw(st.booleans()):
        ring.append(ring[0])
    ring.insert(1, ring[0])
    for order in (ring, ring[::-1]):
        polygon = ConvexPolygons.from_vertices(order)
        assert set(exact(polygon.polygon())) == set(case.exact)
        assert float(polygon.area()) >= 0.0
        assert ConvexPolygons.from_shapely(shapely.Polygon(order)).equals(polygon)
        assert ConvexPolygons(order, len(order)).convex_hull(polygon).equals(polygon)


# Batches
# --------------------------------------------------------------------------------------------------

BINARY: list[Callable[[ConvexPolygons, ConvexPolygons], Any]] = [
    ConvexPolygons.intersection,
    ConvexPolygons.minkowski_sum,
    ConvexPolygons.minkowski_difference,
    ConvexPolygons.convex_hull,
    ConvexPolygons.is_subset,
    ConvexPolygons.equals,
    ConvexPolygons.distance,
    ConvexPolygons.hausdorff_distance,
]
UNARY: list[Callable[[ConvexPolygons], Any]] = [
    lambda p: p.cut((1.0, 0.5), -0.5, 0.5, slack_ulp=4.0),
    lambda p: p.linear_map([[1.0, 0.5], [0.0, 2.0]]),
    lambda p: p.affine_map([[1.0, 0.5], [0.0, 2.0]], (1.0, 2.0)),
    lambda p: p.preimage([[1.0, 0.5], [0.0, 2.0]], (1.0, 2.0)),
    lambda p: p.translate((1.0, 2.0)),
    lambda p: p.reduce_outward(4),
    lambda p: p.contains((0.1, 0.1)),
    lambda p: p.support_function((0.3, 0.1)),
    lambda p: p.support_vector((0.3, 0.1)),
    lambda p: p.closest_point((5.0, 5.0)),
    lambda p: p.bounding_box()[0],
    lambda p: p.chebyshev_centre()[1],
    lambda p: p.project(0)[0],
    lambda p: p.slice(0, 0.0)[1],
    ConvexPolygons.area,
    ConvexPolygons.centroid,
    ConvexPolygons.diameter,
]


def mixed_batch(seed: int) -> ConvexPolygons:
    """Polygons, a segment, a point, and an empty set."""
    random = np.random.default_rng(seed)
    sizes = [8, 5, 2, 1, 0, 6, 0]
    return ConvexPolygons.stack(
        [ConvexPolygons.from_points(random.uniform(-1.0, 1.0, (size, 2))) for size in sizes]
    )


@pytest.mark.parametrize("number", range(len(UNARY) + len(BINARY)))
def test_empty_members_do_not_affect_other_members(number: int) -> None:
    batch = mixed_batch(1)
    partner = mixed_batch(2)
    if number >= len(UNARY):
        binary = BINARY[number - len(UNARY)]
        if binary is ConvexPolygons.minkowski_difference:
            batch = ConvexPolygons.stack(
                [*list(batch)[:4], ConvexPolygons.empty(), batch[5], ConvexPolygons.empty()]
            )
        whole = binary(batch, partner)
        singles = [binary(batch[i], partner[i]) for i in range(len(batch))]
    else:
        operation = UNARY[number]
        whole = operation(batch)
        missing = (
            batch.is_empty
            if isinstance(whole, ConvexPolygons)
            else np.ma.getmaskarray(whole).reshape(7, -1)[:, 0]
        )
        singles = [None if missing[i] else operation(batch[i]) for i in range(len(batch))]
        assert whole.shape[0] == len(batch)
    for i, alone in enumerate(singles):
        if isinstance(whole, ConvexPolygons):
            assert whole[i].polygon().tolist() == (
                alone.polygon().tolist() if alone is not None else []
            )
        elif alone is not None and not np.ma.is_masked(whole[i]):
            np.testing.assert_array_equal(np.ma.getdata(whole[i]), alone)
        elif alone is None and np.ma.isMaskedArray(whole):
            assert np.ma.getmaskarray(whole)[i].all()
