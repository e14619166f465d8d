"""Every operation on convex polygons against exact rational arithmetic.

Tolerances come from rounding alone. `U` is the unit of rounding of a double; an operation that
rounds each coordinate a few times errs by a few `U` times the maximum value of *that* coordinate,
so sets are compared up to a small box, not a disc: nothing is hidden when x is a billion times y.
Inputs are exactly convex: hulls taken in rationals.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from infoset import ConvexPolygons
from tests.rationals import Fraction

U = Fraction(1, 2**53)
FEW = 8  # roundings of one coordinate in any one operation
MINIMUM = Fraction(1, 2**1074)  # rounding of a product that underflows
Exact = tuple[Fraction, Fraction]
ORIGIN: Exact = (Fraction(0), Fraction(0))
Vertices = list[tuple[float, float]]
SOME = settings(
    max_examples=30,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)
FEWER = settings(SOME, max_examples=20)


# The oracle
# --------------------------------------------------------------------------------------------------


def exact(points: Sequence[Sequence[float] | np.ndarray] | np.ndarray) -> list[Exact]:
    return [(Fraction(float(x)), Fraction(float(y))) for x, y in points]


def turn(a: Exact, b: Exact, c: Exact) -> Fraction:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def hull(points: Sequence[Exact]) -> list[Exact]:
    """Strictly convex hull, counter-clockwise, by Andrew's monotone chain."""
    ordered = sorted(set(points))
    if len(ordered) < 3:
        return ordered
    chains: list[list[Exact]] = []
    for run in (ordered, ordered[::-1]):
        chain: list[Exact] = []
        for point in run:
            while len(chain) > 1 and turn(chain[-2], chain[-1], point) <= 0:
                chain.pop()
            chain.append(point)
        chains.append(chain[:-1])

    return chains[0] + chains[1]


def dot(normal: Exact, point: Exact) -> Fraction:
    return normal[0] * point[0] + normal[1] * point[1]


def normals_of(polygon: Sequence[Exact]) -> list[Exact]:
    """Outward normals of the edges; for a segment, of both its sides."""
    around = [*polygon[1:], polygon[0]]
    return [(b[1] - a[1], a[0] - b[0]) for a, b in zip(polygon, around, strict=True) if a != b]


AXES: list[Exact] = [(Fraction(x), Fraction(y)) for x, y in ((1, 0), (0, 1), (-1, 0), (0, -1))]


def outside_by(points: Sequence[Exact], polygon: Sequence[Exact], box: Exact) -> Exact | None:
    """Return a point that is not in the polygon enlarged by [-box, box], if there is one.

    The normals of the enlarged polygon are the normals of the polygon and the axes: only these are
    tested.
    """
    if not polygon:
        return points[0] if points else None
    for normal in normals_of(polygon) + AXES:
        reach = (
            max(dot(normal, p) for p in polygon) + abs(normal[0]) * box[0] + abs(normal[1]) * box[1]
        )
        for point in points:
            if dot(normal, point) > reach:
                return point
    return None


def assert_same_set(got: ConvexPolygons, wanted: Sequence[Exact], box: Exact) -> None:
    """Each lies in the other enlarged by the box."""
    result = exact(got.polygon())
    lost = outside_by(wanted, hull(result), box)
    assert lost is None, f"lost {[float(c) for c in lost]} from {got.polygon().tolist()}"
    extra = outside_by(result, hull(wanted), box)
    assert extra is None, (
        f"{[float(c) for c in extra]} of {got.polygon().tolist()} is not in the exact set"
    )


def exact_clip(
    polygon: Sequence[Exact], normal: Exact, lower: Fraction | None, upper: Fraction | None
) -> list[Exact]:
    """Intersection with the band; None is no bound."""
    kept = list(polygon)
    for sign, bound in ((1, lower), (-1, upper)):
        if bound is None or not kept:
            continue
        heights = [sign * (dot(normal, p) - bound) for p in kept]
        cut: list[Exact] = []
        for i, here in enumerate(kept):
            before = kept[i - 1]
            h_before = heights[i - 1]
            h = heights[i]
            if h_before * h < 0:
                f = h_before / (h_before - h)
                cut.append(
                    (before[0] + f * (here[0] - before[0]), before[1] + f * (here[1] - before[1]))
                )
            if h >= 0:
                cut.append(here)
        kept = hull(cut)
    return kept


def exact_area(polygon: Sequence[Exact]) -> Fraction:
    return (
        sum(
            (turn(polygon[0], polygon[i], polygon[i + 1]) for i in range(1, len(polygon) - 1)),
            Fraction(0),
        )
        / 2
    )


def exact_centroid(polygon: Sequence[Exact]) -> Exact:
    total = Fraction(0)
    x = Fraction(0)
    y = Fraction(0)
    for i in range(1, len(polygon) - 1):
        b = polygon[i]
        c = polygon[i + 1]
        weight = turn(polygon[0], b, c)
        total += weight
        x += weight * (polygon[0][0] + b[0] + c[0]) / 3
        y += weight * (polygon[0][1] + b[1] + c[1]) / 3
    if total:
        return x / total, y / total
    first = polygon[0]
    last = polygon[-1]
    return (first[0] + last[0]) / 2, (first[1] + last[1]) / 2


def exact_distance(polygon: Sequence[Exact], point: Exact) -> float:
    """Distance to the boundary, rounded once or twice."""
    minimum: Fraction | None = None
    for a, b in zip(polygon, [*polygon[1:], polygon[0]], strict=True):
        edge = (b[0] - a[0], b[1] - a[1])
        away = (point[0] - a[0], point[1] - a[1])
        length = dot(edge, edge)
        f = min(Fraction(1), max(Fraction(0), dot(edge, away) / length)) if length else Fraction(0)
        gap = (away[0] - f * edge[0], away[1] - f * edge[1])
        minimum = dot(gap, gap) if minimum is None else min(minimum, dot(gap, gap))
    assert minimum is not None
    return math.sqrt(minimum)


def strictly_inside(polygon: Sequence[Exact], point: Exact) -> bool:
    around = [*polygon[1:], polygon[0]]
    return len(polygon) > 2 and all(
        turn(a, b, point) > 0 for a, b in zip(polygon, around, strict=True)
    )


# What is tested
# --------------------------------------------------------------------------------------------------


class Case(NamedTuple):
    """A polygon as the library sees it and as the oracle does."""

    polygon: ConvexPolygons
    exact: list[Exact]

    @property
    def size(self) -> Exact:
        """Maximum |x| and |y|."""
        return max(abs(p[0]) for p in self.exact), max(abs(p[1]) for p in self.exact)

    @property
    def extent(self) -> Exact:
        xs = [p[0] for p in self.exact]
        ys = [p[1] for p in self.exact]
        return max(xs) - min(xs), max(ys) - min(ys)

    def box(self, more: Exact = ORIGIN, few: int = FEW) -> Exact:
        return few * U * (self.size[0] + more[0]), few * U * (self.size[1] + more[1])


def case_of(points: Vertices) -> Case:
    corners = hull(exact(points))
    vertices = np.array([[float(x), float(y)] for x, y in corners]).reshape(-1, 2)
    return Case(ConvexPolygons(vertices, len(vertices)), corners)


# On a lattice, so that coincidences happen, and numbers below 1e-12 of the scale do not: underflow
# is not the subject.
UNIT = st.one_of(
    st.integers(-(2**40), 2**40).map(lambda i: i / 2**40),
    st.sampled_from([-1.0, -0.5, 0.0, 0.5, 1.0]),
)
ANGLE = st.floats(0.0, 2.0 * math.pi)
SCALE = st.integers(-5, 4).map(lambda k: 10.0**k)  # nine decades


@st.composite
def points_of_polygon(draw: st.DrawFn, minimum: int = 1) -> Vertices:
    unit = draw(st.lists(st.tuples(UNIT, UNIT), min_size=minimum, max_size=9))
    kinds = ["plain", "round", "thin", "tiny", "mixed", "each", "segment", "point"]
    kind = draw(st.sampled_from(kinds))
    if minimum > 2 and kind in ("segment", "point"):
        kind = "plain"
    angle = draw(ANGLE)
    c = math.cos(angle)
    s = math.sin(angle)

    points = unit
    if kind == "round":
        turns = [math.pi * (x + 1.0) for x, _ in unit]
        points = [(3.0 * math.cos(t), 3.0 * math.sin(t) + 1.0) for t in turns]
    elif kind == "thin":
        points = [(c * x - s * 1e-12 * y, s * x + c * 1e-12 * y) for x, y in unit]
    elif kind == "tiny":
        at = draw(st.tuples(UNIT, UNIT))
        points = [(1e4 * at[0] + 1e-9 * x, 1e4 * at[1] + 1e-9 * y) for x, y in unit]
    elif kind == "mixed":
        across = draw(SCALE)
        up = draw(SCALE)
        away = draw(st.sampled_from([0.0, 1.0, 1e3]))
        points = [(across * (x + away), up * (y - away)) for x, y in unit]
    elif kind == "each":
        points = [(draw(SCALE) * x, draw(SCALE) * y) for x, y in unit]
    elif kind == "segment":
        x, y = unit[0]
        length = draw(SCALE)
        dx, dy = draw(st.sampled_from([(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (c, s)]))
        points = [(x, y), (x + length * dx, y + length * dy)]
    elif kind == "point":
        points = unit[:1]
    return points


CASES = points_of_polygon().map(case_of)
FAT_CASES = points_of_polygon(minimum=3).map(case_of)


@st.composite
def directions(draw: st.DrawFn, case: Case) -> tuple[float, float]:
    """Directions: axis-parallel of several lengths, across an edge, or any.

    In some of the latter both coordinates have the same weight.
    """
    kind = draw(st.sampled_from(["axis", "axis", "edge", "any", "weighed"]))
    if kind == "axis":
        length = draw(st.sampled_from([1.0, -1.0, 2.0, -1.0, 0.3]))
        return draw(st.sampled_from([(length, 0.0), (0.0, length)]))
    if kind == "edge" and len(case.exact) > 1:
        x, y = draw(st.sampled_from(normals_of(case.exact)))
        return float(x), float(y)

    angle = draw(ANGLE)
    if kind == "weighed":
        return math.cos(angle) / float(case.extent[0] or 1), math.sin(angle) / float(
            case.extent[1] or 1
        )

    return math.cos(angle), math.sin(angle)


@st.composite
def bands(draw: st.DrawFn, case: Case) -> tuple[tuple[float, float], float, float]:
    """Bands: through vertices and edges, across, of no width, reversed, infinite, apart."""
    normal = draw(directions(case))
    heights = [normal[0] * float(x) + normal[1] * float(y) for x, y in case.exact]
    low = min(heights)
    high = max(heights)
    width = high - low or 1.0
    level = st.one_of(
        st.sampled_from(heights),
        UNIT.map(lambda f: low + 0.5 * (f + 1.0) * (high - low)),
        st.sampled_from(
            [
                low - width,
                high + width,
                math.nextafter(low, -math.inf),
                math.nextafter(high, math.inf),
            ]
        ),
    )
    kind = draw(st.sampled_from(["any", "any", "any", "reversed", "zero width", "infinite"]))
    lower = draw(level)
    upper = draw(level)
    if kind == "zero width":
        upper = lower
    elif kind == "infinite":
        lower, upper = draw(
            st.sampled_from([(-math.inf, upper), (lower, math.inf), (-math.inf, math.inf)])
        )
    elif (lower > upper) != (kind == "reversed"):
        lower, upper = upper, lower

    return normal, lower, upper


def bound(value: float, by: Fraction) -> Fraction | None:
    return None if math.isinf(value) else Fraction(value) + by


# Cuts
# --------------------------------------------------------------------------------------------------


@SOME
@given(CASES, st.data())
def test_clip_is_the_exact_intersection_up_to_rounding(case: Case, data: st.DataObject) -> None:
    """A crossing is on its edge up to a few ulp, and on its line up to rounding of normal . p.

    Heights of slanted bands are themselves rounded, by up to `slack`; where an edge is nearly
    parallel to the band that moves the crossing far along the edge (the condition of the problem),
    so it is the *band* that is known up to `slack`: the result lies between the cuts by the bands
    narrower and wider by it. Heights in axis-parallel bands whose normal is a power of two are
    exact: no slack, and no tolerance along the normal.
    """
    normal, lower, upper = data.draw(bands(case))
    got = case.polygon.cut(normal, lower, upper)
    direction = (Fraction(normal[0]), Fraction(normal[1]))
    aligned = min(map(abs, normal)) == 0.0 and max(map(abs, normal)) in (1.0, 2.0)
    slack = (
        Fraction(0)
        if aligned
        else FEW * U * (abs(direction[0]) * case.size[0] + abs(direction[1]) * case.size[1])
    )
    box = case.box()
    if aligned:
        box = (Fraction(0), box[1]) if normal[0] else (box[0], Fraction(0))
    result = exact(got.polygon())
    if lower > upper:
        assert got.is_empty
        return

    narrow = exact_clip(case.exact, direction, bound(lower, slack), bound(upper, -slack))
    if (
        slack
        and not (math.isinf(lower) or math.isinf(upper))
        and Fraction(lower) + slack > Fraction(upper) - slack
    ):
        narrow = []

    lost = outside_by(narrow, hull(result), box)

    assert lost is None, f"lost {[float(c) for c in lost]}"
    assert outside_by(result, case.exact, case.box()) is None
    for point in result:
        assert math.isinf(lower) or dot(direction, point) >= Fraction(lower) - slack
        assert math.isinf(upper) or dot(direction, point) <= Fraction(upper) + slack


@SOME
@given(CASES, st.sampled_from([0, 1]), st.sampled_from([1.0, -1.0, 0.3, -7.0]), st.data())
def test_axis_parallel_clip_leaves_vertices_exactly_on_its_line(
    case: Case, axis: int, length: float, data: st.DataObject
) -> None:
    normal = (length, 0.0) if axis == 0 else (0.0, length)
    heights = [length * float(p[axis]) for p in case.exact]
    level = UNIT.map(lambda f: min(heights) + 0.5 * (f + 1.0) * (max(heights) - min(heights)))
    lower, upper = sorted((data.draw(level), data.draw(level)))
    given_vertices = {tuple(p) for p in case.polygon.polygon()}

    for vertex in case.polygon.cut(normal, lower, upper).polygon():
        assert tuple(vertex) in given_vertices or vertex[axis] in (lower / length, upper / length)


# Maps and sums
# --------------------------------------------------------------------------------------------------

ENTRY = st.one_of(UNIT, st.builds(lambda scale, x: scale * x, SCALE, UNIT))


@st.composite
def matrices(draw: st.DrawFn) -> list[list[float]]:
    kind = draw(
        st.sampled_from(
            ["any", "reflection", "shear", "rank one", "nearly rank one", "projection", "zero"]
        )
    )
    a, b, c, d = (draw(ENTRY) for _ in range(4))
    if kind == "reflection":
        return [[0.0, a], [a, 0.0]]
    if kind == "shear":
        return [[1.0, a], [0.0, 1.0]]
    if kind == "rank one":  # exactly: powers of two
        return [[a, 2.0 * a], [0.25 * a, 0.5 * a]]
    if kind == "nearly rank one":
        return [[a * b, a * c], [d * b, d * c]]
    if kind == "projection":
        return draw(
            st.sampled_from([[[a, 0.0], [0.0, 0.0]], [[0.0, 0.0], [a, b]], [[0.0, a], [0.0, b]]])
        )

    return [[0.0, 0.0], [0.0, 0.0]] if kind == "zero" else [[a, b], [c, d]]


def exact_image(matrix: list[list[float]], points: Sequence[Exact]) -> list[Exact]:
    rows = [(Fraction(row[0]), Fraction(row[1])) for row in matrix]
    return [(dot(rows[0], p), dot(rows[1], p)) for p in points]


def image_box(matrix: list[list[float]], size: Exact, few: int = FEW) -> Exact:
    x, y = (abs(Fraction(row[0])) * size[0] + abs(Fraction(row[1])) * size[1] for row in matrix)
    return few * U * x, few * U * y


@SOME
@given(CASES, matrices())
def test_linear_map_is_exact_up_to_rounding(case: Case, matrix: list[list[float]]) -> None:
    got = case.polygon.linear_map(matrix)
    assert_same_set(got, exact_image(matrix, case.exact), image_box(matrix, case.size))
    (a, b), (c, d) = matrix
    if a * d - b * c == 0.0:
        assert got.counts <= 2


@FEWER
@given(CASES, st.tuples(ENTRY, ENTRY))
def test_translation_is_exact_up_to_one_rounding(case: Case, offset: tuple[float, float]) -> None:
    dx = Fraction(offset[0])
    dy = Fraction(offset[1])
    moved = [(x + dx, y + dy) for x, y in case.exact]
    assert_same_set(case.polygon.translate(offset), moved, case.box((abs(dx), abs(dy)), few=1))


@st.composite
def halves(draw: st.DrawFn, case: Case) -> tuple[float, float]:
    """Half-segments: parallel to an edge, parallel to an axis, zero, any."""
    kind = draw(st.sampled_from(["edge", "axis", "any", "zero"]))
    if kind == "edge" and len(case.exact) > 1:
        x, y = draw(st.sampled_from(normals_of(case.exact)))
        return -float(y), float(x)
    if kind == "zero":
        return 0.0, 0.0
    a = draw(ENTRY)
    b = draw(ENTRY)
    return draw(st.sampled_from([(a, 0.0), (0.0, a)])) if kind == "axis" else (a, b)


@st.composite
def uneven_polygons(draw: st.DrawFn) -> Case:
    """Polygons with vertices that are repeated or moved by an ulp, as rounding leaves them.

    Tiny edges turn the wrong way.
    """
    even = draw(CASES)
    corners = [(float(x), float(y)) for x, y in even.exact]
    ulps = [float(2 * U * size) for size in even.size]
    vertices = []
    for corner in corners:
        for _ in range(draw(st.integers(1, 3))):
            steps = draw(st.tuples(st.integers(-1, 1), st.integers(-1, 1)))
            vertices.append(
                tuple(v + s * ulp for v, s, ulp in zip(corner, steps, ulps, strict=True))
            )

    polygon = ConvexPolygons.unchecked(np.array(vertices), np.array(len(vertices)))
    return Case(polygon, hull(exact(vertices)))


@st.composite
def moved_polygons(draw: st.DrawFn) -> Case:
    """Polygons that are moved or mapped, so that vertices may coincide."""
    before = draw(CASES).polygon
    after = (
        before.translate(draw(st.tuples(ENTRY, ENTRY)))
        if draw(st.booleans())
        else before.linear_map(draw(matrices()))
    )
    return Case(after, hull(exact(after.polygon())))


UNEVEN = st.one_of(uneven_polygons(), moved_polygons())


@SOME
@given(st.one_of(CASES, UNEVEN), st.data())
def test_sum_with_a_segment_is_exact_up_to_rounding(case: Case, data: st.DataObject) -> None:
    half = data.draw(halves(case))
    hx = Fraction(half[0])
    hy = Fraction(half[1])
    wanted = [(x + sign * hx, y + sign * hy) for x, y in case.exact for sign in (-1, 1)]

    assert_same_set(case.polygon.add_segment(half), hull(wanted), case.box((abs(hx), abs(hy))))


def exact_sum(first: Sequence[Exact], second: Sequence[Exact]) -> list[Exact]:
    return hull([(a[0] + b[0], a[1] + b[1]) for a in first for b in second])


@SOME
@given(st.one_of(CASES, UNEVEN), CASES)
def test_sum_with_a_polygon_is_exact_up_to_rounding(first: Case, second: Case) -> None:
    got = first.polygon.minkowski_sum(second.polygon)
    assert_same_set(got, exact_sum(first.exact, second.exact), first.box(second.size))
    assert int(got.counts) <= int(first.polygon.counts + second.polygon.counts)


def test_sum_of_a_clockwise_needle_with_a_segment_along_it_keeps_its_ends() -> None:
    """The boundary from (0, 0) by way of (-ulp, 0) to (0, 1) is clockwise, by rounding."""
    got = ConvexPolygons([(0.0, 0.0), (-(2.0**-52), 0.0), (0.0, 1.0)], 3).add_segment((0.0, 1.0))
    assert [got.support_function((0.0, -1.0)), got.support_function((0.0, 1.0))] == [1.0, 2.0]


@SOME
@given(UNEVEN, st.data())
def test_clip_of_an_uneven_polygon_is_exact_up_to_its_unevenness(
    case: Case, data: st.DataObject
) -> None:
    """An edge of an ulp in the wrong place is also a slack of the band.

    The other tolerances are the same as for exactly convex polygons.
    """
    normal, lower, upper = data.draw(bands(case))
    direction = (Fraction(normal[0]), Fraction(normal[1]))
    slack = FEW * U * (abs(direction[0]) * case.size[0] + abs(direction[1]) * case.size[1])
    got = case.polygon.cut(normal, lower, upper)

    assert got.counts <= case.polygon.counts + 2

    result = exact(got.polygon())
    narrow = (
        []
        if lower + 2 * float(slack) > upper
        else exact_clip(case.exact, direction, bound(lower, slack), bound(upper, -slack))
    )
    lost = outside_by(narrow, hull(result), case.box())

    assert lost is None, f"lost {[float(c) for c in lost]} from {got.polygon().tolist()}"
    assert outside_by(result, case.exact, case.box()) is None


@SOME
@given(UNEVEN, st.data())
def test_measures_of_an_uneven_polygon_are_exact_up_to_its_unevenness(
    case: Case, data: st.DataObject
) -> None:
    """Errors are at most the few ulp by which the polygon is not convex."""
    probe = data.draw(probes(case))
    point = exact([probe])[0]
    got = float(case.polygon.margin(probe))
    wanted = exact_distance(case.exact, point)
    tolerance = math.hypot(*map(float, case.box(few=2 * FEW)))

    assert abs(abs(got) - wanted) <= tolerance
    if wanted > tolerance:
        assert (got > 0.0) == strictly_inside(case.exact, point)

    n = len(case.polygon.polygon())
    ulps = 2 * n * FEW * (case.box(few=1)[0] * case.extent[1] + case.box(few=1)[1] * case.extent[0])
    ulps += 4 * n * FEW * case.box(few=1)[0] * case.box(few=1)[1]

    assert abs(Fraction(float(case.polygon.area())) - exact_area(case.exact)) <= ulps
    assert (
        outside_by(exact([case.polygon.centroid().tolist()]), case.exact, case.box(few=n * FEW))
        is None
    )


# Measures
# --------------------------------------------------------------------------------------------------


@SOME
@given(CASES, st.data())
def test_support_function_and_vector_are_exact_up_to_rounding(
    case: Case, data: st.DataObject
) -> None:
    x, y = data.draw(directions(case))
    value = float(case.polygon.support_function((x, y)))
    vector = case.polygon.support_vector((x, y))
    direction = (Fraction(x), Fraction(y))
    wanted = max(dot(direction, p) for p in case.exact)
    slack = FEW * (
        U * (abs(direction[0]) * case.size[0] + abs(direction[1]) * case.size[1]) + MINIMUM
    )

    assert abs(Fraction(value) - wanted) <= slack
    assert exact([vector.tolist()])[0] in case.exact
    assert dot(direction, exact([vector.tolist()])[0]) >= wanted - slack

    low, high = case.polygon.bounding_box()
    assert exact([low.tolist(), high.tolist()]) == [
        tuple(f(p[k] for p in case.exact) for k in (0, 1)) for f in (min, max)
    ]


@st.composite
def probes(draw: st.DrawFn, case: Case) -> tuple[float, float]:
    """Points: vertices, points of edges and next to them, the middle, anywhere near."""
    corners = [(float(x), float(y)) for x, y in case.exact]
    a = draw(st.sampled_from(corners))
    b = draw(st.sampled_from(corners))
    f = draw(UNIT)
    x = a[0] + f * (b[0] - a[0])
    y = a[1] + f * (b[1] - a[1])
    if draw(st.booleans()):
        x += draw(UNIT) * float(case.extent[0])
        y += draw(UNIT) * float(case.extent[1])
    if draw(st.booleans()):
        x += draw(st.sampled_from([-1.0, 1.0])) * (math.ulp(x) if x else 0.0)
    return x, y


@SOME
@given(CASES, st.data())
def test_margin_is_exact_up_to_rounding(case: Case, data: st.DataObject) -> None:
    """The error is relative to the size of the set and to the distance of the point from it.

    Only differences of coordinates are rounded.
    """
    probe = data.draw(probes(case))
    point = exact([probe])[0]
    got = float(case.polygon.margin(probe))
    wanted = exact_distance(case.exact, point)
    reach = max(math.hypot(float(x - point[0]), float(y - point[1])) for x, y in case.exact)
    tolerance = FEW * float(U) * reach

    assert abs(abs(got) - wanted) <= tolerance
    if wanted > tolerance:
        assert (got > 0.0) == strictly_inside(case.exact, point)


def area_tolerance(case: Case) -> Fraction:
    """Each term of a fan rounds its differences and two products of up to the extents."""
    return FEW * U * len(case.exact) * case.extent[0] * case.extent[1]


@SOME
@given(CASES)
def test_area_is_exact_up_to_rounding(case: Case) -> None:
    assert abs(Fraction(float(case.polygon.area())) - exact_area(case.exact)) <= area_tolerance(
        case
    )


@SOME
@given(CASES)
def test_centroid_is_exact_up_to_rounding(case: Case) -> None:
    got = exact([case.polygon.centroid().tolist()])[0]
    n = len(case.exact)
    box = (
        FEW * U * (case.size[0] + n * case.extent[0]),
        FEW * U * (case.size[1] + n * case.extent[1]),
    )

    assert outside_by([got], case.exact, box) is None

    area = exact_area(case.exact)
    if area == 0 or area > 64 * area_tolerance(case):
        # The weights are wrong by area_tolerance / area, relatively, and move the centroid by that
        # much of the extent.
        doubt = 4 * area_tolerance(case) / area if area else Fraction(0)
        wanted = exact_centroid(case.exact)
        for k in (0, 1):
            assert abs(got[k] - wanted[k]) <= box[k] + doubt * case.extent[k]


@SOME
@given(
    st.one_of(
        FAT_CASES,
        st.lists(ANGLE, min_size=5, max_size=14).map(
            lambda turns: case_of([(1e3 * math.cos(t), 1e-3 * math.sin(t)) for t in turns])
        ),
    ),
    st.integers(4, 8),
)
def test_reduced_polygon_contains_the_polygon(case: Case, cap: int) -> None:
    """A new vertex is rounded at its own, larger, coordinates, once for every edge dropped."""
    got = case.polygon.reduce_outward(cap)
    if case.polygon.counts <= cap:
        assert got.polygon().tolist() == case.polygon.polygon().tolist()
        return

    assert got.counts <= cap

    result = exact(got.polygon())
    after = Case(got, result)

    assert (
        outside_by(case.exact, hull(result), after.box(case.size, few=FEW * len(case.exact)))
        is None
    )
    assert np.isfinite(got.polygon()).all()
