"""Polygons as they are after a thousand operations: convex only up to rounding, as thin as rounding, vertices repeated.

`test_polygon_oracle.py` has exactly convex polygons. Here the exact set is the rational hull of the worn vertices, and
an operation is right if its result and the exact one lie in each other enlarged by a few `EPS * reach`, where `reach`
is the maximum modulus of a coordinate and `EPS` is 2**-52.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from infoset import polygon, polygon_hull, polygon_sum
from infoset.arrays import Floats
from tests.infoset.test_polygon_oracle import Exact, dot, exact, exact_sum, hull, turn
from tests.rationals import Fraction

pytestmark = pytest.mark.thorough


EPS = Fraction(1, 2**52)
GUARD = -7.25e77

checked = settings(max_examples=30, deadline=None)


# The oracle: convex polygons with rational vertices, counter-clockwise, no three of them on a line.


def edges(corners: Sequence[Exact]) -> list[tuple[Exact, Exact]]:
    return [(corners[i - 1], corners[i]) for i in range(len(corners))]


def squared(a: Exact, b: Exact) -> Fraction:
    return (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2


def squared_from_edge(point: Exact, a: Exact, b: Exact) -> Fraction:
    length = squared(a, b)
    if not length:
        return squared(point, a)
    along = (point[0] - a[0]) * (b[0] - a[0]) + (point[1] - a[1]) * (b[1] - a[1])
    if along <= 0:
        return squared(point, a)
    if along >= length:
        return squared(point, b)
    return turn(a, b, point) ** 2 / length


def is_inside(point: Exact, corners: Sequence[Exact]) -> bool:
    return len(corners) > 2 and all(turn(a, b, point) >= 0 for a, b in edges(corners))


def squared_from_boundary(point: Exact, corners: Sequence[Exact]) -> Fraction:
    return min(squared_from_edge(point, a, b) for a, b in edges(corners))


def lies_within(points: Iterable[Exact], corners: Sequence[Exact], tolerance: Fraction) -> bool:
    """Whether points lie in the polygon enlarged by a tolerance."""
    return all(
        is_inside(point, corners) or (corners and squared_from_boundary(point, corners) <= tolerance**2)
        for point in points
    )


def agree(made: Floats, right: Sequence[Exact], tolerance: Fraction) -> bool:
    """Whether a polygon and the exact one lie in each other, enlarged by a tolerance."""
    corners = hull(exact(made))
    return lies_within(corners, right, tolerance) and lies_within(right, corners, tolerance)


def exact_clip(
    corners: Sequence[Exact], normal: Exact, lower: float | Fraction, upper: float | Fraction
) -> list[Exact]:
    kept = list(corners)
    for direction, level in ((normal, upper), ((-normal[0], -normal[1]), -lower)):
        if level == math.inf:
            continue
        if level == -math.inf:
            return []
        bound = Fraction(level)
        new = [point for point in kept if dot(direction, point) <= bound]
        for a, b in edges(kept):
            over_a, over_b = dot(direction, a) - bound, dot(direction, b) - bound
            if over_a * over_b < 0:
                part = over_a / (over_a - over_b)
                new.append((a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1])))
        kept = hull(new)
    return kept


def reach(*arrays: Floats) -> Fraction:
    """Maximum modulus of the coordinates of some arrays."""
    return Fraction(max((float(np.max(np.abs(array))) for array in arrays if array.size), default=0.0))


# What the operations are tried on.


def unit_floats(minimum: float = -1.0) -> st.SearchStrategy[float]:
    """Numbers whose products are far from underflow."""
    return st.floats(minimum, 1.0).map(lambda number: number if abs(number) > 1e-60 else 0.0)


@st.composite
def clouds(draw: st.DrawFn) -> Floats:
    """Points whose hull is round, thin, tiny far from the origin, of mixed magnitudes, or on a coarse lattice."""
    kind = draw(st.sampled_from(["round", "thin", "tiny", "mixed", "lattice", "polar"]))
    number = draw(st.integers(1, 9))
    if kind == "lattice":
        return np.array(draw(st.lists(st.tuples(*[st.integers(-4, 4)] * 2), min_size=number, max_size=number)), float)
    if kind == "polar":
        angles = np.array(draw(st.lists(unit_floats(), min_size=3, max_size=9)))
        return np.stack([np.cos(np.pi * angles), np.sin(np.pi * angles)], axis=-1)
    points = np.array(draw(st.lists(st.tuples(unit_floats(), unit_floats()), min_size=number, max_size=number)))
    if kind == "mixed":
        powers = draw(st.lists(st.integers(-9, 9), min_size=2 * number, max_size=2 * number))
        return points * 10.0 ** np.reshape(powers, (number, 2))
    size, distance = {"round": (1.0, 0.0), "thin": (1.0, 1.0), "tiny": (1e-9, 1e4)}[kind]
    if kind == "thin":
        points = points * [1.0, draw(st.sampled_from([1e-12, 1e-9, 1e-5]))]
        distance = draw(st.sampled_from([0.0, 1.0, 1e4]))
    angle = np.pi * draw(st.sampled_from([0.0, 0.5, 0.25, 0.1, 1.0 / 3.0]))
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    centre = distance * np.array(draw(st.tuples(unit_floats(), unit_floats())))
    turned: Floats = points @ turn.T * size + centre
    return turned


@st.composite
def polygons(draw: st.DrawFn) -> Floats:
    """Exactly convex polygons, from any vertex on; points and segments among them."""
    corners = np.array([[float(x), float(y)] for x, y in hull(exact(draw(clouds())))])
    return np.roll(corners, draw(st.integers(0, len(corners) - 1)), axis=0)


@st.composite
def worn_polygons(draw: st.DrawFn) -> Floats:
    """Polygons convex only up to 2 ulp: vertices along edges, moved a little, and repeated ones."""
    corners = draw(polygons())
    assert isinstance(corners, np.ndarray)
    ulp = float(EPS * reach(corners))
    worn = []
    for i in range(len(corners)):
        after = corners[(i + 1) % len(corners)]
        for part in [0.0, *sorted(draw(st.lists(st.sampled_from([0.0, 1e-16, 0.1, 0.5, 0.9, 1.0]), max_size=2)))]:
            shift = np.array(draw(st.tuples(*[st.sampled_from([-1.0, 0.0, 0.0, 1.0])] * 2)))
            worn.append(corners[i] + part * (after - corners[i]) + ulp * shift)
    return np.array(worn)


any_polygons = st.one_of(polygons(), polygons(), worn_polygons())
magnitudes = st.sampled_from([1e-9, 1e-3, 1.0, 1e3, 1e9])


@st.composite
def vectors(draw: st.DrawFn, corners: Floats | None = None) -> Floats:
    """A vector of any magnitude: along an axis, along an edge, nearly along one, or any."""
    size = float(draw(magnitudes))
    kind = draw(st.sampled_from(["axis", "edge", "near", "any"]))
    if kind in ("edge", "near") and corners is not None and len(corners) > 1:
        i = int(draw(st.integers(0, len(corners) - 1)))
        vector = (corners[i] - corners[i - 1]) * float(draw(st.sampled_from([1.0, -0.5, 3.0])))
        if kind == "near":
            away = np.array(draw(st.tuples(unit_floats(), unit_floats())))
            vector = vector + 1e-15 * float(np.max(np.abs(vector))) * away
    elif kind == "axis":
        vector = size * np.array(draw(st.sampled_from([(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)])))
    else:
        vector = size * np.array(draw(st.tuples(unit_floats(), unit_floats())))
    return np.asarray(vector, dtype=np.float64)


# Running a kernel: what it writes beyond the room that its contract asks for is an error.


def written(corners: Floats, extra: int, kernel: Callable[[Floats], int]) -> Floats:
    room = len(corners) + extra
    out = np.full((room + 6, 2), GUARD)
    count = kernel(out)
    assert count <= room
    assert np.all(out[room:] == GUARD)
    made = out[:count].copy()
    assert np.all(np.isfinite(made))
    return made


def clip(corners: Floats, normal: Floats, lower: float, upper: float) -> Floats:
    def kernel(out: Floats) -> int:
        out[: len(corners)] = corners
        return polygon.clip_to_band(out, len(corners), normal[0], normal[1], lower, upper)[0]

    return written(corners, 2, kernel)


def add_segment(corners: Floats, half: Floats) -> Floats:
    def kernel(out: Floats) -> int:
        out[: len(corners)] = corners
        return polygon_sum.add_segment(out, len(corners), half[0], half[1])

    return written(corners, 2, kernel)


def reduce_outward(corners: Floats, cap: int) -> Floats:
    reduced = corners.copy()
    return reduced[: polygon_hull.reduce_outward(reduced, len(reduced), cap)]


# Cuts.


@st.composite
def levels(draw: st.DrawFn, heights: Floats) -> float:
    """A bound: at a vertex, between two, outside, or infinite."""
    kind = draw(st.sampled_from(["vertex", "between", "between", "outside", "infinite"]))
    if kind == "vertex":
        return float(draw(st.sampled_from(sorted(heights.tolist()))))
    if kind == "infinite":
        return float(draw(st.sampled_from([-math.inf, math.inf])))
    part = float(draw(st.floats(0.0, 1.0) if kind == "between" else st.floats(-1.0, 2.0)))
    return float(heights.min() + part * (heights.max() - heights.min()))


@checked
@given(st.data())
def test_a_cut_is_exact_for_a_polygon_and_a_band_off_by_rounding(data: st.DataObject) -> None:
    corners = data.draw(any_polygons)
    normal = data.draw(vectors(corners))
    assume(np.any(normal != 0.0))
    heights = corners @ normal
    lower, upper = data.draw(levels(heights)), data.draw(levels(heights))
    made = clip(corners, normal, lower, upper)
    if lower > upper:
        assert not len(made)
        return
    whole, direction = hull(exact(corners)), exact([normal])[0]
    tolerance = 8 * EPS * reach(corners)
    noise = 8 * EPS * (abs(direction[0]) + abs(direction[1])) * reach(corners)
    result = hull(exact(made))
    assert lies_within(result, whole, tolerance)
    for point in result:
        assert lower == -math.inf or dot(direction, point) >= Fraction(lower) - noise
        assert upper == math.inf or dot(direction, point) <= Fraction(upper) + noise
    narrow_lower = lower if math.isinf(lower) else Fraction(lower) + noise
    narrow_upper = upper if math.isinf(upper) else Fraction(upper) - noise
    if narrow_lower <= narrow_upper:
        assert lies_within(exact_clip(whole, direction, narrow_lower, narrow_upper), result, tolerance)


def test_a_segment_cut_in_the_middle_stays_a_segment() -> None:
    rng = np.random.default_rng(3)
    for _ in range(300):
        ends = rng.normal(size=(2, 2))
        heights = ends @ [0.3, 0.7]
        made = clip(ends, np.array([0.3, 0.7]), 0.5 * (heights[0] + heights[1]), np.inf)
        assert len(made) == 2


# Maps.


# Sums.


@checked
@given(st.data())
def test_the_sum_with_a_segment_is_the_exact_one(data: st.DataObject) -> None:
    corners = data.draw(any_polygons)
    half = data.draw(vectors(corners))
    made = add_segment(corners, half)
    right = exact_sum(hull(exact(corners)), exact([half, -half]))
    assert agree(made, right, 16 * EPS * (reach(corners) + reach(half)))


NEEDLES = [
    [
        (-0.4199648838291332, -0.8046284964945892),
        (-0.21663544825908576, -0.41506102470000833),
        (-0.06900951438607994, -0.1322182495308004),
        (0.05993258520542393, 0.11482737672060572),
        (0.19391520840777354, 0.3715303555048267),
        (0.44135165135307153, 0.8456043096167817),
        (0.4416662909540454, 0.8462071409458227),
    ],
    [
        (0.5619530156120761, 1.7224009108576142),
        (0.5858609290896699, 1.6829734085839667),
        (1.0192741493643804, 0.9682142246081361),
        (1.2989574143031726, 0.5069772967344721),
        (1.300131356201347, 0.5050413019056982),
    ],
    [
        (9999.351639831943, 10000.181875125238),
        (9999.379090582095, 10000.174174762278),
        (9999.580493035284, 10000.117678237346),
        (10000.020727967303, 9999.994185482325),
        (10000.955757722317, 9999.731895073139),
        (9999.723394015195, 10000.07759228683),
    ],
]
HALVES = [(-0.04627034494556237, -0.08865131233444135), (0.051849929567132004, -0.08550780551437075)]
HALVES += [(0.09628350189477886, -0.027009021879329843)]


@pytest.mark.parametrize(("needle", "half"), list(zip(NEEDLES, HALVES, strict=True)))
def test_a_needle_of_a_few_ulp_keeps_its_ends(needle: list[tuple[float, float]], half: tuple[float, float]) -> None:
    """Lowest and highest were found a thousandth of the length past its end: the end did not move by half."""
    corners, step = np.array(needle), np.array(half)
    tolerance = 16 * EPS * (reach(corners) + reach(step))
    assert agree(add_segment(corners, step), exact_sum(hull(exact(corners)), exact([step, -step])), tolerance)


@pytest.mark.parametrize(("distance", "thickness"), [(0.0, 1e-16), (1.0, 1e-15), (1e4, 1e-12)])
def test_a_sliver_along_the_segment_keeps_its_ends(distance: float, thickness: float) -> None:
    """Where heights agree within rounding, the lowest vertex may be found on the upper side: an end would be lost."""
    rng = np.random.default_rng(1)
    for trial in range(8000):
        angle = rng.uniform(0.0, 2.0 * np.pi)
        along, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        parts, sides = rng.uniform(-1.0, 1.0, (2, 10))
        offsets = thickness * 10.0 ** rng.uniform(-1.0, 2.0) * sides * (1.0 - parts**2)
        cloud = distance + parts[:, np.newaxis] * along + offsets[:, np.newaxis] * across
        corners = np.empty((21, 2))
        corners = corners[: polygon_hull.hull(cloud, len(cloud), corners)]
        made = add_segment(corners, 0.1 * along)
        for end in (along, -along):
            grown = np.max((made - corners[0]) @ end) - np.max((corners - corners[0]) @ end)
            assert abs(grown - 0.1) <= 16 * float(EPS) * (1.0 + distance)
        if trial % 200 == 0:
            right = exact_sum(hull(exact(corners)), exact([0.1 * along, -0.1 * along]))
            assert agree(made, right, 16 * EPS * (reach(corners) + 1))


# Reduction.


@checked
@given(any_polygons, st.integers(4, 8))
def test_a_reduced_polygon_contains_the_polygon_and_keeps_to_the_cap(corners: Floats, cap: int) -> None:
    reduced = reduce_outward(corners, cap)
    assert len(reduced) <= cap
    assert np.all(np.isfinite(reduced))
    if len(corners) <= cap:
        np.testing.assert_array_equal(reduced, corners)
    else:
        tolerance = 16 * EPS * (reach(reduced) + reach(corners))
        assert lies_within(exact(corners), hull(exact(reduced)), tolerance)


def test_reduction_of_a_set_as_thin_as_rounding_contains_it() -> None:
    """Where no edge can go, for rounding has left none a direction, a rectangle is taken."""
    rng = np.random.default_rng(5)
    for _ in range(300):
        along = rng.uniform(-1.0, 1.0, 12)
        noise = 10.0 ** rng.uniform(-18.0, -15.0) * rng.uniform(-1.0, 1.0, 12)
        corners = np.stack([along, rng.uniform(-2.0, 2.0) * along + noise], axis=-1)
        reduced = reduce_outward(corners, 4)
        assert len(reduced) <= 4
        assert lies_within(exact(corners), hull(exact(reduced)), 16 * EPS * reach(reduced))
        assert polygon.area(reduced, len(reduced)) < 1e-14


def test_the_edge_that_adds_the_min_area_is_removed_first() -> None:
    """The reference computes all areas again after each removal; the lengths are equal in pairs, so that areas tie."""
    rng = np.random.default_rng(2)
    work = np.empty((128, 2))
    for count in (5, 16, 33, 60):
        lengths = 10.0 ** rng.uniform(-4.0, 0.0, count)
        directions = np.linspace(0.0, 3.0, count)
        steps = np.minimum(lengths, lengths[::-1])[:, None] * np.stack(
            [np.cos(directions), np.sin(directions)], axis=-1
        )
        path = np.cumsum(steps, axis=0)
        expected = path.copy()
        while len(expected) > 4:
            removals = [
                polygon_hull.removed_edge(expected, i - 1, i, i + 1, i + 2) for i in range(1, len(expected) - 2)
            ]
            first = min(range(len(removals)), key=lambda i: removals[i][0])
            expected[first + 1] = removals[first][1:]
            expected = np.delete(expected, first + 2, axis=0)
        assert polygon_hull.drop_inner_edges(path, count, 4, work) == (4, True)
        np.testing.assert_array_equal(path[:4], expected)


@checked
@given(clouds())
def test_the_hull_is_the_exact_one(points: Floats) -> None:
    made = written(points, 0, lambda out: polygon_hull.hull(points, len(points), out))
    assert agree(made, hull(exact(points)), 4 * EPS * reach(points))
