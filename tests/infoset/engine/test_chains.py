"""Sections kept as two chains, against exact rational polygons in the coordinates (V, m).

What rounding may do is bounded beforehand, in units `U` of the magnitudes that a section had over
its history: `R` for V, `G` for m and z (the maximum m plus the first time to go times `R`). An
operation that writes a vertex sums a few numbers, of up to `2 R` in V and `2 G` in m: it puts the
vertex off by less than `8 U R` and `16 U G`. A height that is compared is off by less than `16 U G`
as well. Moves of the origins are compensated and add nothing.

An error of a level can move a vertex far along an edge that is nearly level, so a section cannot be
near the exact one at all places; but it is the exact section of bands that differ by rounding. So
two exact polygons are carried, one through bands too narrow by the rounding, one through bands too
wide: after `k` operations a section lies in the wide one enlarged by the box of `8 k U R` by `16 k
U G`, and contains the narrow one to within that box. A box is not enlarged by a cut, if the band is
widened by its height. Where no band is nearly along an edge, the narrow and the wide one are the
same to a few ulp, and without cuts they are equal.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, example, given, settings
from hypothesis import strategies as st

import infoset.engine.chain_storage
import infoset.engine.chains
from infoset.arrays import Floats
from infoset.engine.chain_storage import FIRST_RING, TAKEN
from infoset.engine.chains import CAPACITY, SectionView
from tests.infoset.geometry.test_polygon_oracle import (
    AXES,
    Exact,
    dot,
    exact_clip,
    hull,
    outside_by,
)
from tests.kernels import callable_kernels
from tests.rationals import Fraction

chain_storage, chains = map(callable_kernels, (infoset.engine.chain_storage, infoset.engine.chains))
Level = tuple[float, float, float]

RIGHT, LEFT = range(2)
U = Fraction(1, 2**53)
ROW = 1  # the middle one of three: an operation on a section must not change its neighbours
checked = settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow])
briefly = settings(checked, max_examples=12)


# The oracle: convex polygons with rational vertices (V, m), counter-clockwise, no three of them on
# a line.


def upward(tau: float) -> Exact:
    """The normal of heights z = m - tau V."""
    return -Fraction(tau), Fraction(1)


MISS: Exact = (Fraction(0), Fraction(1))


def rounded(points: Sequence[Exact]) -> Floats:
    return np.array([(float(v), float(m)) for v, m in points])


def may_reach(points: Floats, normal: Exact, height: Fraction | None = None) -> list[int]:
    """Return the points that may lie above a height, by default above all others: the rest do not,
    despite rounding.
    """
    components = rounded([normal])[0]
    heights = points @ components
    sizes = np.abs(points) @ np.abs(components)
    level = heights.max() if height is None else float(height)
    indices: list[int] = np.flatnonzero(
        heights >= level - 1e-14 * (sizes.max() + abs(level))
    ).tolist()
    return indices


def highest(points: Sequence[Exact], about: Floats, normal: Exact) -> Fraction:
    """Return the maximum height; `about` are the points, rounded."""
    return max(dot(normal, points[i]) for i in may_reach(about, normal))


def reaches(polygon: Sequence[Exact], normal: Exact) -> tuple[Fraction, Fraction]:
    about = rounded(polygon)
    return -highest(polygon, about, (-normal[0], -normal[1])), highest(polygon, about, normal)


def moved(polygon: Sequence[Exact], by: Exact) -> list[Exact]:
    return [(point[0] + by[0], point[1] + by[1]) for point in polygon]


def with_segment(polygon: Sequence[Exact], half: Exact) -> list[Exact]:
    return hull(moved(polygon, half) + moved(polygon, (-half[0], -half[1])))


def assert_contains(polygon: Sequence[Exact], points: Sequence[Exact], box: Exact) -> None:
    lost = outside_by(points, polygon, box)
    assert lost is None, (
        f"{tuple(map(float, lost))} is not in {[tuple(map(float, point)) for point in polygon]}"
    )


# A section, and what its chains hold, exactly.


class Section:
    """One row of three, with the time to go that it was last turned to."""

    def __init__(self, tau: float, bottom: Level, top: Level, room: int = CAPACITY) -> None:
        self.chains = chain_storage.empty_sections(3, room)
        self.chains.rings[FIRST_RING:] = 0.0
        self.tau = tau
        chains.start(self.view, tau, bottom, top)

    @property
    def sides(self) -> tuple[Any, Any]:
        """The right and the left chain."""
        return self.chains.records[2 * ROW], self.chains.records[2 * ROW + 1]

    @property
    def view(self) -> SectionView:
        return SectionView(*self.sides, self.chains.rings, 0.0)

    def turn(self, tau: float) -> None:
        self.tau = tau
        chains.turn(self.view, tau)

    def spread(self, half_v: float) -> None:
        chains.spread(self.view, self.tau, half_v)

    def shift(self, v: float) -> None:
        chains.shift(self.view, self.tau, v)

    def cut(self, lower: float, upper: float) -> Any:
        return chains.cut(self.view, self.tau, lower, upper)

    def cut_misses(self, lower: float, upper: float) -> Any:
        return chains.cut_misses(self.view, self.tau, lower, upper, chain_storage.working_room())

    def reduce(self) -> None:
        chains.reduce_outward(self.view, self.tau, chain_storage.working_room())

    @property
    def reach(self) -> float:
        return float(self.sides[RIGHT].reach)

    @property
    def count(self) -> int:
        return int(chains.count_of(self.view))

    def heights(self) -> Any:
        return chains.heights(self.view, self.tau)

    def outline(self) -> Floats:
        out: Floats = chain_storage.working_room()
        return out[: chains.outline(self.view, self.tau, out)].copy()

    def corners(self) -> list[Exact]:
        """The outline, as (V, m)."""
        tau = Fraction(self.tau)
        outline = [(Fraction(float(v)), Fraction(float(z))) for v, z in self.outline()]
        return hull([(v, z + tau * v) for v, z in outline])

    def numbers(self, side: int) -> range:
        return range(int(self.sides[side].begin), int(self.sides[side].end))

    def local(self, side: int) -> list[tuple[float, float]]:
        """Vertices from the origin of their chain."""
        places = [chains.offset_of(self.sides[side], i) for i in self.numbers(side)]
        return [(float(self.chains.rings[at]), float(self.chains.rings[at + 1])) for at in places]

    def replace(self, side: int, vertices: Sequence[tuple[float, float]]) -> None:
        """Write other vertices, from the origin of their chain."""
        for i, (v, m) in enumerate(vertices):
            chains.write(self.sides[side], self.chains.rings, i, v, m)
        self.sides[side].end = len(vertices)

    def origin(self, side: int) -> list[float]:
        """V and m of a chain's origin, each as two floats."""
        return [float(self.sides[side][part]) for part in ("v", "v_rest", "m", "m_rest")]

    def chain(self, side: int) -> list[Exact]:
        """Vertices as the rings have them, without any rounding."""
        v, v_rest, m, m_rest = map(Fraction, self.origin(side))
        return [(Fraction(x) + v + v_rest, Fraction(y) + m + m_rest) for x, y in self.local(side)]

    def peak(self, side: int) -> Any:
        chain = self.sides[side]
        return chains.find_peak(chain, self.chains.rings, (1.0, -1.0)[side], abs(float(chain.m)))

    def is_alone(self) -> bool:
        """Whether the rows before and after are as they were made."""
        others = np.delete(self.chains.records, [2 * ROW, 2 * ROW + 1])
        rings = [
            self.chains.rings[ring : ring + 2 * (mask + 1)]
            for ring, mask in others[["ring", "mask"]].tolist()
        ]
        fields = [others[name] for name in others.dtype.names or () if name not in ("ring", "mask")]
        return not any(part.any() for part in (*fields, *rings))


class TrackedSection:
    """A section with its exact polygons, narrow and wide, and the bounds of the module's
    docstring.
    """

    def __init__(self, tau: float, bottom: Level, top: Level, room: int = CAPACITY) -> None:
        self.section = Section(tau, bottom, top, room)
        self.first_tau = Fraction(tau)
        corners = [(Fraction(v), Fraction(level[2])) for level in (bottom, top) for v in level[:2]]
        self.narrow = self.wide = hull([(v, z + self.first_tau * v) for v, z in corners])
        self.max_v = max(abs(v) for v, _ in corners)
        self.max_m = max(abs(number) for points in (corners, self.wide) for _, number in points)
        self.operations = 1
        self.check()

    @property
    def maximum(self) -> Fraction:
        return self.max_m + self.first_tau * self.max_v

    @property
    def box(self) -> Exact:
        return 8 * self.operations * U * self.max_v, 16 * self.operations * U * self.maximum

    @property
    def tolerance(self) -> Fraction:
        """Height of the box."""
        return self.box[1] + Fraction(self.section.tau) * self.box[0]

    def turn(self, tau: float) -> None:
        self.section.turn(tau)
        self.operations += 1
        self.check()

    def spread(self, half_v: float) -> None:
        self.section.spread(half_v)
        half = (Fraction(half_v), Fraction(half_v) * Fraction(self.section.tau))
        self.narrow = with_segment(self.narrow, half)
        self.wide = with_segment(self.wide, half)
        self.grow(half)

    def shift(self, v: float) -> None:
        self.section.shift(v)
        by = (Fraction(v), Fraction(v) * Fraction(self.section.tau))
        self.narrow = moved(self.narrow, by)
        self.wide = moved(self.wide, by)
        self.grow((abs(by[0]), abs(by[1])))

    def grow(self, by: Exact) -> None:
        self.max_v += by[0]
        self.max_m += by[1]
        self.check()

    def cut(self, lower: float, upper: float, of_miss: bool = False) -> bool:
        """Cut by a band of height or of predicted miss; whether the section is nonempty as it
        should be.
        """
        normal = MISS if of_miss else upward(self.section.tau)
        operation = self.section.cut_misses if of_miss else self.section.cut
        nonempty, overlap = operation(lower, upper)
        rounding = 16 * U * self.maximum + self.tolerance
        # The overlap itself is a difference, of levels that need not be near the section.
        doubt = rounding + 4 * U * (abs(Fraction(lower)) + abs(Fraction(upper)))
        for polygon, sign in ((self.narrow, -1), (self.wide, 1)):
            if polygon:
                minimum, most = reaches(polygon, normal)
                exact = min(most - Fraction(lower), Fraction(upper) - minimum)
                assert sign * (Fraction(overlap) - exact) <= doubt
                assert nonempty or sign > 0 or exact <= doubt
                assert not nonempty or sign < 0 or exact >= -doubt
        self.narrow = exact_clip(
            self.narrow, normal, Fraction(lower) + rounding, Fraction(upper) - rounding
        )
        self.wide = exact_clip(
            self.wide, normal, Fraction(lower) - rounding, Fraction(upper) + rounding
        )
        self.operations += 1
        if nonempty:
            assert self.wide
            self.check()
        else:
            assert not self.narrow
        return bool(nonempty)

    def check(self) -> None:
        """Assert all properties that hold after any operation."""
        section = self.section
        normal = upward(self.section.tau)
        right = section.chain(RIGHT)
        left = section.chain(LEFT)
        assert right
        assert left
        assert section.count == len(right) + len(left) <= CAPACITY
        assert section.is_alone()
        assert Fraction(section.reach) * (1 + self.operations * U) >= max(
            abs(v) for v, _ in right + left
        )
        if not self.narrow:
            # The section is thinner than rounding: the order of its vertices is not determined.
            return
        tolerance = self.tolerance
        for chain, sign in ((right, 1), (left, -1)):
            rises = [sign * dot(normal, point) for point in chain]
            assert all(after >= before - tolerance for before, after in pairwise(rises))
        self.check_extremes(right, left)

    def check_extremes(self, right: list[Exact], left: list[Exact]) -> None:
        """Heights and peaks lie between the extremes of the narrow and of the wide polygon, and are
        the extremes of the vertices.
        """
        section = self.section
        normal = upward(self.section.tau)
        minimum, maximum = map(Fraction, section.heights())
        lowest, highest = reaches(right + left, normal)
        assert abs(minimum - lowest) <= self.tolerance
        assert abs(maximum - highest) <= self.tolerance
        peak = right[section.peak(RIGHT) - section.numbers(RIGHT)[0]][1]
        trough = left[section.peak(LEFT) - section.numbers(LEFT)[0]][1]
        assert max(m for _, m in right) - peak <= self.box[1]
        assert trough - min(m for _, m in left) <= self.box[1]
        for low, high, direction, slack in (
            (minimum, maximum, normal, self.tolerance),
            (trough, peak, MISS, self.box[1]),
        ):
            inner = reaches(self.narrow, direction)
            outer = reaches(self.wide, direction)
            assert outer[0] - slack <= low <= inner[0] + slack
            assert inner[1] - slack <= high <= outer[1] + slack

    def check_outline(self) -> None:
        if self.narrow:
            corners = self.section.corners()
            assert_contains(self.wide, corners, self.box)
            assert_contains(corners, self.narrow, self.box)


# Sequences of operations: plain numbers, scaled with the section when they are applied.

UNIT = st.one_of(
    st.integers(-(2**40), 2**40).map(lambda i: i / 2**40),
    st.sampled_from([-1.0, -0.5, 0.0, 0.5, 1.0]),
)
SIZES = st.sampled_from([1e-9, 1e-3, 1.0, 1.0, 1.0, 1e3])
FALLS = st.sampled_from([1.0, 1.0, 1.0 - 1e-12, 0.999, 0.9, 0.9, 0.7, 0.5, 0.01])
ULPS = st.sampled_from([0, 0, 1, -1, 3, -3, 20, 1000])


class Start(NamedTuple):
    """A trapezium between two levels."""

    tau: float
    bottom: Level
    top: Level


class Band(NamedTuple):
    """Position of a band relative to a section."""

    kind: str
    parts: tuple[float, float]
    ulps: int
    of_miss: bool


class Step(NamedTuple):
    """Operations on a section in one step."""

    falls: tuple[float, float]
    half_v: float
    kick: float
    band: Band | None


@st.composite
def starts(draw: st.DrawFn) -> Start:
    """Trapezia, points, segments along the level, across it and aslant, near zero and far from
    it.
    """
    tau = draw(st.sampled_from([1e-3, 0.7, 1.0, 130.0, 1e4]))
    size_v = draw(SIZES)
    place = draw(st.sampled_from([0.0, 0.0, 1.0, 100.0]))
    size_z = draw(st.one_of(SIZES, st.just(size_v * tau)))
    vs = [size_v * (draw(UNIT) + place) for _ in range(4)]
    zs = [size_z * draw(UNIT) for _ in range(2)]
    kind = draw(
        st.sampled_from(["trapezium"] * 4 + ["rectangle", "point", "level", "upright", "aslant"])
    )
    if kind in ("point", "level"):
        zs[1] = zs[0]
    if kind in ("point", "upright", "aslant"):
        vs[1], vs[3] = vs[0], vs[2]
    if kind in ("point", "upright", "rectangle", "level"):
        vs[2:] = vs[:2]
    bottom = sorted(vs[:2])
    top = sorted(vs[2:])
    return Start(tau, (bottom[0], bottom[1], min(zs)), (top[0], top[1], max(zs)))


BANDS = st.builds(
    Band,
    st.sampled_from(
        ["parts", "parts", "vertex", "vertex", "thin", "touching", "beyond", "around", "rest"]
    ),
    st.tuples(UNIT, UNIT),
    ULPS,
    st.sampled_from([False] * 5 + [True]),
)
HALVES = st.one_of(st.just(0.0), UNIT.map(abs), st.sampled_from([1e-16, 1e-6, 1.0]))


def steps(bands: st.SearchStrategy[Band | None]) -> st.SearchStrategy[Step]:
    return st.builds(Step, st.tuples(FALLS, FALLS), HALVES, st.one_of(st.just(0.0), UNIT), bands)


def levels(section: Section, band: Band, ulp: float) -> tuple[float, float]:
    """The borders of a band."""
    outline = section.outline()
    heights = outline[:, 1] + (section.tau * outline[:, 0] if band.of_miss else 0.0)
    minimum = float(heights.min())
    maximum = float(heights.max())
    extent = maximum - minimum
    error = band.ulps * ulp
    first, second = band.parts
    if band.kind == "parts":
        borders = [0.5 * (minimum + maximum) + part * extent for part in band.parts]
        return min(borders), max(borders)
    if band.kind == "vertex":
        level = float(heights[int(abs(first) * (len(heights) - 1))]) + error
        return (level, maximum + ulp) if second < 0.0 else (minimum - ulp, level)
    if band.kind == "thin":
        level = minimum + abs(first) * extent
        return level, level + abs(error)
    at_top = {
        "touching": (maximum + error, maximum + extent + 1.0),
        "rest": (minimum + 0.999 * extent, maximum + 1.0),
    }
    at_bottom = {
        "touching": (minimum - extent - 1.0, minimum + error),
        "rest": (minimum - 1.0, minimum + 0.001 * extent),
    }
    if band.kind in at_top:
        return at_top[band.kind] if first < 0.0 else at_bottom[band.kind]
    if band.kind == "beyond":
        return maximum + abs(first) * extent, maximum + 2.0 * extent
    return minimum - 1.0, maximum + 1.0


def apply_step(tracked: TrackedSection, step: Step) -> bool:
    """Apply one step; return whether the section is not empty after it."""
    scale = float(tracked.max_v) / tracked.operations
    tracked.turn(tracked.section.tau * step.falls[0])
    tracked.spread(scale * step.half_v)
    tracked.turn(tracked.section.tau * step.falls[1])
    tracked.shift(scale * step.kick)
    if step.band is None:
        return True
    lower, upper = levels(tracked.section, step.band, float(U * tracked.maximum))
    return lower > upper or tracked.cut(lower, upper, step.band.of_miss)


# Sequences of operations.


@checked
@given(starts(), st.lists(steps(st.one_of(st.none(), BANDS)), min_size=1, max_size=10))
def test_section_equals_the_exact_polygon_up_to_rounding(
    start: Start, sequence: list[Step]
) -> None:
    tracked = TrackedSection(*start)
    for step in sequence:
        if not apply_step(tracked, step):
            return
        tracked.check_outline()


@pytest.mark.parametrize("start", [(3.0, 3.0, -50.4220476397299), (2.0, 5.0, 7.1)])
@pytest.mark.parametrize("tau", [0.44999999999955004, 1.0, 7.3, 1e4])
def test_level_segment_keeps_its_ends_if_the_level_does_not_turn(start: Level, tau: float) -> None:
    """All its heights are equal to within rounding: which of its ends is the higher must not be
    taken from that.
    """
    halves = (202.7652897567146, 0.0, 613.1018861295662, 1e-3)
    for kick in np.random.default_rng(1).uniform(-300.0, 300.0, 20):
        tracked = TrackedSection(tau, start, start)
        tracked.shift(float(kick))
        for half_v in halves:
            for _ in range(3):
                tracked.turn(tau)
            tracked.spread(half_v)
            tracked.check_outline()
        tracked.turn(0.9 * tau)
        tracked.check_outline()
        lowest, highest = tracked.section.heights()
        assert highest - lowest == pytest.approx(
            (start[1] - start[0] + 2.0 * sum(halves)) * 0.1 * tau, rel=1e-9
        )


def test_one_step_of_a_square_gives_the_expected_vertices() -> None:
    section = Section(2.0, (-1.0, 1.0, -1.0), (-1.0, 1.0, 1.0))
    section.turn(1.0)
    np.testing.assert_array_equal(
        section.outline(), [(-1.0, -2.0), (1.0, 0.0), (1.0, 2.0), (-1.0, 0.0)]
    )
    section.spread(0.5)
    outline = section.outline()
    np.testing.assert_array_equal(
        outline, [(-0.5, -2.0), (1.5, 0.0), (1.5, 2.0), (0.5, 2.0), (-1.5, 0.0), (-1.5, -2.0)]
    )
    section.turn(1.0)
    section.shift(0.25)
    assert section.cut(-1.0, 1.0) == (True, 3.0)
    wanted = [(0.75, -1.0), (1.75, 0.0), (1.75, 1.0), (-0.25, 1.0), (-1.25, 0.0), (-1.25, -1.0)]
    assert sorted(section.outline().tolist()) == sorted(map(list, wanted))
    assert section.heights() == (-1.0, 1.0)
    assert section.cut(1.0 + 2.0**-40, 3.0) == (False, -(2.0**-40))
    assert sorted(section.outline().tolist()) == sorted(map(list, wanted)), (
        "an empty section is left as it was"
    )
    assert section.cut(1.0, 3.0) == (True, 0.0)
    np.testing.assert_array_equal(np.sort(section.outline(), axis=0), [(-0.25, 1.0), (1.75, 1.0)])


@checked
@given(
    st.integers(0, 3),
    st.lists(st.tuples(steps(st.none()), st.booleans(), UNIT.map(abs)), min_size=4, max_size=16),
)
def test_section_contains_the_true_state_if_bands_end_at_it(
    corner: int, sequence: list[tuple[Step, bool, float]]
) -> None:
    """The truth is a corner of the set, and each band ends at it, widened by the 16 ulp that a
    measurement has.
    """
    bottom = (-0.2, 0.3, -17.0)
    top = (-0.1, 0.3, 23.0)
    section = Section(300.0, bottom, top)
    v = Fraction((*bottom[:2], *top[:2])[corner])
    z = Fraction((bottom, top)[corner // 2][2])
    truth = (v, z + 300 * v)
    max_m = 400.0
    for step, from_below, width in sequence:
        section.turn(section.tau * step.falls[0])
        section.spread(0.01 * step.half_v)
        section.turn(section.tau * step.falls[1])
        section.shift(0.1 * step.kick)
        kick = Fraction(0.1 * step.kick)
        truth = (truth[0] + kick, truth[1] + kick * Fraction(section.tau))
        level = float(dot(upward(section.tau), truth))
        max_m += abs(0.1 * step.kick) * section.tau + 0.01 * step.half_v * section.tau
        slack = 16.0 * chains.EPSILON * (max_m + 300.0 * section.reach)
        band = (
            (level - slack, level + width + slack)
            if from_below
            else (level - width - slack, level + slack)
        )
        nonempty, overlap = section.cut(*band)
        assert nonempty
        assert overlap > 0.0
    # A truth once lost would be far outside by now, for the level has turned.
    assert_contains(
        section.corners(), [truth], (8 * U * Fraction(section.reach), 16 * U * Fraction(max_m))
    )


# Peaks.


@briefly
@example(
    # Two vertices that differed by rounding hid that the vertex before them had become the highest.
    start=Start(0.7, (0.0, 1e-9, 2.4500059225829315e-16), (1.8189894035458566e-21, 5e-10, 3.5e-10)),
    sequence=[
        Step((1.0, 1.0), 0.0, 0.0, None),
        Step((1.0, 0.01), 2.0**-40, 0.0, None),
        Step((0.7, 0.01), 0.0, 0.0, Band("parts", (0.0, 0.5), 0, True)),
        Step((1.0, 0.01), 0.0, 0.0, None),
    ],
    part=0.0,
)
@given(starts(), st.lists(steps(st.one_of(st.none(), BANDS)), max_size=6), UNIT.map(abs))
def test_first_vertex_near_a_peak_has_a_miss_within_the_tolerance(
    start: Start, sequence: list[Step], part: float
) -> None:
    tracked = TrackedSection(*start)
    if not all(apply_step(tracked, step) for step in sequence):
        return
    section = tracked.section
    for side, sign in ((RIGHT, 1.0), (LEFT, -1.0)):
        misses = [sign * m for _, m in section.local(side)]
        first = section.numbers(side)[0]
        peak = section.peak(side)
        tolerance = part * (max(misses) - min(misses))
        near = chains.first_near_peak(section.sides[side], section.chains.rings, sign, tolerance)
        level = misses[peak - first] - tolerance
        assert all(miss >= level for miss in misses[near - first : peak - first + 1])
        assert near == first or misses[near - first - 1] < level


@pytest.mark.parametrize("part", [0.25, 0.5, 0.9])
def test_level_segment_stays_a_segment_if_it_is_cut_by_its_miss(part: float) -> None:
    """Its heights are equal: neither its lowest vertex nor its highest says where it ends."""
    tracked = TrackedSection(0.7, (100.0, 300.0, 29.5), (100.0, 300.0, 29.5))
    middle = 29.5 + 0.7 * 200.0
    assert tracked.cut(middle - part * 70.0, middle + 0.5 * part * 70.0, of_miss=True)
    tracked.check_outline()
    for _ in range(3):
        tracked.turn(0.7)
        tracked.spread(10.0)
        tracked.check_outline()
    tracked.turn(0.5)
    tracked.check_outline()
    minimum, maximum = tracked.section.heights()
    assert maximum - minimum == pytest.approx((1.5 * part * 100.0 + 60.0) * 0.2)


# Outward reduction and room.


def crowded(tau: float, size_v: float, size_z: float, fall: float) -> TrackedSection:
    """A section that has grown until it may have no room for another step; its exact polygon is
    taken from there.
    """
    tracked = TrackedSection(tau, (-size_v, 1.3 * size_v, -size_z), (-size_v, size_v, 1.3 * size_z))
    section = tracked.section
    while not chains.is_crowded(section.view):
        before = section.count
        section.turn(section.tau * fall)
        section.spread(0.01 * size_v)
        section.turn(section.tau * fall)
        assert before < section.count <= before + chains.MAX_ADDED
        tracked.operations += 2
    tracked.narrow = tracked.wide = hull(section.chain(RIGHT) + section.chain(LEFT))
    tracked.max_v = Fraction(section.reach)
    tracked.max_m += tracked.first_tau * tracked.max_v
    tracked.check()
    return tracked


@pytest.mark.parametrize("fall", [pytest.param(0.999, marks=pytest.mark.thorough), 0.97])
@pytest.mark.parametrize(
    ("tau", "size_v", "size_z"), [(1.0, 1.0, 1.0), (500.0, 1e-9, 30.0), (500.0, 2.0, 1e-6)]
)
def test_reduced_section_contains_the_section_and_takes_further_steps(
    tau: float, size_v: float, size_z: float, fall: float
) -> None:
    tracked = crowded(tau, size_v, size_z, fall)
    section = tracked.section
    section.reduce()
    assert section.count <= chains.REDUCED
    reduced = hull(section.chain(RIGHT) + section.chain(LEFT))
    assert_contains(reduced, tracked.narrow, tracked.box)
    # The edges that go are those that cost minimum: there is hardly more of the set in any
    # direction.
    for normal in AXES:
        (minimum, maximum), (low, high) = reaches(tracked.narrow, normal), reaches(reduced, normal)
        assert high - low <= (maximum - minimum) * Fraction(11, 10)
    tracked.wide = reduced
    tracked.operations += 1
    tracked.check()
    for k in range(6):
        tracked.turn(section.tau * 0.9)
        tracked.spread(0.02 * size_v)
        tracked.turn(section.tau * 0.9)
        bottom, top = section.heights()
        margin = 0.2 * (top - bottom)
        tracked.cut(bottom + margin * (k % 2), top - margin * ((k + 1) % 2))
    tracked.check_outline()


def test_bound_of_v_holds_after_the_reduction_of_a_round_chain() -> None:
    """Dropping edges all around, it goes farther out than any vertex was."""
    section = Section(3.0, (-1.0, 1.0, 0.0), (-1.0, 1.0, 1.0))
    turns = np.linspace(-0.8, 0.8, 248)
    section.replace(
        RIGHT, [(math.cos(turn), math.sin(turn) + 3.0 * math.cos(turn)) for turn in turns]
    )
    before = hull(section.chain(RIGHT) + section.chain(LEFT))
    section.reduce()
    assert section.count == chains.REDUCED
    assert_contains(hull(section.chain(RIGHT) + section.chain(LEFT)), before, (8 * U, 32 * U))
    outermost = max(abs(v) for side in (RIGHT, LEFT) for v, _ in section.chain(side))
    assert 1 < outermost <= section.reach


def test_reduced_section_contains_a_chain_as_thin_as_rounding() -> None:
    """Where rounding has left edges no direction, three sides of a box around the chain are
    taken.
    """
    rng = np.random.default_rng(5)
    for thickness in (0.0, 1e-17, 1e-16, 1e-15, 1e-12):
        section = Section(3.0, (-1.0, 1.0, 0.0), (-1.0, 1.0, 1.0))
        rises = np.sort(rng.uniform(0.0, 1.0, 250))
        v = 1.0 + 0.3 * rises + thickness * rng.uniform(-1.0, 1.0, 250) * 10.0
        section.replace(RIGHT, list(zip(v.tolist(), (rises + 3.0 * v).tolist(), strict=True)))
        section.sides[RIGHT].reach = 2.0
        before = section.chain(RIGHT) + section.chain(LEFT)
        section.reduce()
        assert section.count <= chains.REDUCED
        assert_contains(section.corners(), before, (32 * U * 2, 64 * U * 6))
        assert all(
            abs(v) <= section.reach for side in (RIGHT, LEFT) for v, _ in section.chain(side)
        )
        misses = [m for _, m in section.chain(RIGHT)]
        assert misses[section.peak(RIGHT) - section.numbers(RIGHT)[0]] >= max(misses) - 64 * U


@briefly
@given(
    starts(), st.lists(steps(st.none()), min_size=1, max_size=6), st.lists(steps(BANDS), max_size=3)
)
def test_section_does_not_change_if_its_rings_are_widened(
    start: Start, before: list[Step], after: list[Step]
) -> None:
    tracked = TrackedSection(*start, room=32)
    twin = TrackedSection(*start)
    for step in before:
        assert apply_step(tracked, step) == apply_step(twin, step)
    rings = chain_storage.with_room(tracked.section.chains.rings, 4 * CAPACITY)
    tracked.section.chains = tracked.section.chains._replace(rings=rings)
    chain_storage.widen_rings(tracked.section.view, CAPACITY)
    assert rings[TAKEN] <= rings.size
    for i in range(len(after) + 1):
        for side in (RIGHT, LEFT):
            assert tracked.section.local(side) == twin.section.local(side)
            assert (
                tracked.section.sides[side].tolist()[:-2] == twin.section.sides[side].tolist()[:-2]
            )
        if i < len(after) and not (apply_step(tracked, after[i]) & apply_step(twin, after[i])):
            break


# Mirror.


def assert_mirrored(section: Section, mirror: Section) -> None:
    """Turned by 180 degrees the right chain is the left one, to the last bit."""
    for side in (RIGHT, LEFT):
        assert mirror.local(1 - side) == [(-v, -m) for v, m in section.local(side)]
        assert mirror.origin(1 - side) == [-part for part in section.origin(side)]
        assert mirror.numbers(1 - side) == section.numbers(side)
    assert mirror.heights() == tuple(-height for height in section.heights()[::-1])


@checked
@given(
    starts(),
    st.lists(st.tuples(steps(st.none()), st.booleans(), UNIT.map(abs)), min_size=1, max_size=10),
)
def test_mirrored_sequence_gives_the_mirrored_section_bit_by_bit(
    start: Start, sequence: list[tuple[Step, bool, float]]
) -> None:
    """With one border a cut: two borders on one edge are worked in another order, see the next
    test.

    So it is with the two turns of a section that is as thin as rounding, which could share an edge:
    none is here.
    """
    tau, (low, high, z), (low_top, high_top, z_top) = start
    magnitude = max(abs(z), abs(z_top)) + tau * max(map(abs, (low, high, low_top, high_top)))
    assume(z_top - z > 1e-5 * magnitude)
    section = Section(*start)
    mirror = Section(tau, (-high_top, -low_top, -z_top), (-high, -low, -z))
    size = max(map(abs, (low, high, low_top, high_top)))
    for step, from_below, part in sequence:
        for one, sign in ((section, 1.0), (mirror, -1.0)):
            one.turn(one.tau * step.falls[0])
            one.spread(size * step.half_v)
            one.turn(one.tau * step.falls[1])
            one.shift(sign * size * step.kick)
        assert_mirrored(section, mirror)
        minimum, maximum = section.heights()
        level = minimum + (0.1 + 0.8 * part) * (maximum - minimum)
        band = (level, maximum + 1.0) if from_below else (minimum - 1.0, level)
        assert section.cut(*band) == mirror.cut(-band[1], -band[0])
        assert_mirrored(section, mirror)
        for side in (RIGHT, LEFT):
            assert section.peak(side) == mirror.peak(1 - side)


# Wear.


def test_section_is_exact_to_4_ulp_after_ten_thousand_moves() -> None:
    """Origins a thousand times as far out as the section is wide, and back: it is exact to 4 ulp,
    not to 10 000.
    """
    rng = np.random.default_rng(3)
    tracked = TrackedSection(97.3, (-1.3, 0.7, -20.0), (-0.9, 1.1, 30.0))
    section = tracked.section
    exact = tracked.wide
    added = (Fraction(0), Fraction(0))
    place = (Fraction(0), Fraction(0))
    max_v = Fraction(0)
    max_m = Fraction(0)
    for _ in range(10_000):
        half_v = float(rng.uniform(0.0, 1e-4))
        kick = float(rng.uniform(-1.0, 1.0) * 1e3) if abs(place[0]) < 3000 else -float(place[0])
        section.spread(half_v)
        section.shift(kick)
        by = (Fraction(kick), Fraction(kick) * Fraction(97.3))
        place = (place[0] + by[0], place[1] + by[1])
        added = (added[0] + Fraction(half_v), added[1] + Fraction(half_v) * Fraction(97.3))
        max_v = max(max_v, abs(place[0]))
        max_m = max(max_m, abs(place[1]))
    section.shift(-float(place[0]))
    back = Fraction(-float(place[0]))
    place = (place[0] + back, place[1] + back * Fraction(97.3))
    wanted = moved(with_segment(exact, added), place)
    got = hull(section.chain(RIGHT) + section.chain(LEFT))
    # Not a unit of rounding of how far it has been, for each of two floats, is left behind:
    far = (max_v * U * U * 20_000, max_m * U * U * 20_000)
    # but the half of a spread along m is rounded, as is what it starts from.
    box = (far[0] + 2 * U * 2, far[1] + U * added[1] + 4 * U * 150)
    assert_contains(wanted, got, box)
    assert_contains(got, wanted, box)
    outline = section.corners()
    reach = max(abs(v) for v, _ in wanted), max(abs(m) for _, m in wanted)
    few = (8 * U * reach[0], 8 * U * (reach[1] + Fraction(97.3) * reach[0]))
    assert_contains(wanted, outline, few)
    assert_contains(outline, wanted, few)
    assert math.isclose(section.reach, 5e6, rel_tol=0.2)


def test_peak_is_found_if_vertices_coincide() -> None:
    """Both have the same miss, so that to look for a greater one next to the first is to look no
    further.
    """
    section = Section(3.0, (-1.0, 1.0, 0.0), (-1.0, 1.0, 1.0))
    (v, m), (v_top, m_top) = section.local(RIGHT)
    section.replace(RIGHT, [(v, m), (math.nextafter(v, 2.0), m), (v, m), (v_top, m_top)])
    assert section.peak(RIGHT) == 3
