"""Laws that information sets obey, and so the chains they are made of.

Measuring again tells nothing new, more data and narrower bounds give smaller sets, the order of
measurements does not matter, impulses add, prediction is a shear that keeps areas, sections are
concave in the label, mirrors hold, powers of two are exact to the last bit.
`tests/infoset/geometry/test_polygon_oracle.py` and `test_set_library.py` compare the operations of
`ConvexPolygons` with exact rationals. Sets of the other problems are in
`test_polytope_operations.py`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from infoset import (
    AngleSensor,
    ConvexPolygons,
    InformationSet,
    InitialSet,
    Model,
    SetModel,
    StateBox,
)
from tests.infoset.test_information_set import feasible_range_interval_m

pytestmark = pytest.mark.thorough

some = settings(max_examples=10, deadline=None)
few = settings(max_examples=3, deadline=None)

ROUNDING = 2e-8
"""Of a coordinate, or of a height, several times over."""


def lies_in(inner: ConvexPolygons, outer: ConvexPolygons, by: float = ROUNDING) -> bool:
    """Whether every vertex of one is in the other, or nearer to it than rounding."""
    return all(float(outer.margin(vertex)) >= -by for vertex in inner.polygon())


def same(one: ConvexPolygons, other: ConvexPolygons, by: float = ROUNDING) -> bool:
    return lies_in(one, other, by) and lies_in(other, one, by)


# Information sets
# --------------------------------------------------------------------------------------------------

E, STEP, RANGE = 1000.0, 2.0, 100e3
BOUNDS = StateBox((-2e3, 3e3), (90e3, 110e3), (-40.0, 30.0), (-1010.0, -990.0))
SENSOR = AngleSensor(STEP, 0.002, 0.003, RANGE)
SOUND = SetModel(
    E,
    STEP,
    BOUNDS,
    SENSOR,
    disturbance_m_s2=0.05,
    range_threshold_m=2e3,
    sections=5,
    fewest_sections=1,
    initial_set=InitialSet.BOX,
    model=Model.GUARANTEED,
    execution_error_relative=0.02,
)
PAPER = replace(SOUND, model=Model.PAPER)
MODEL = st.sampled_from([SOUND, PAPER])
PART = st.floats(-1.0, 1.0)
LABEL = st.floats(91e3, 109e3)


def story(steps: int) -> st.SearchStrategy[list[tuple[float, float, float]]]:
    """Steps of an error and an impulse in units of their bounds, and whether the rate is measured:
    above zero.
    """
    return st.lists(st.tuples(PART, PART, PART), min_size=1, max_size=steps)


STORY = story(12)


def tell(
    model: SetModel, events: list[tuple[float, float, float]], *, sign: float = 1.0
) -> InformationSet:
    """A set after measurements about the motion z = 300 m + 5 m/s t, x = 100 km - e t, and
    impulses.
    """
    information = InformationSet(model)
    for i, (error, impulse, rate) in enumerate(events):
        t = STEP * i
        z = 300.0 + 5.0 * t
        x = RANGE - E * t
        information.measure_angle(sign * (z / x + error * float(model.angle_sensor.error_bound(x))))
        if rate > 0.0:
            information.measure_rate(sign * (5.0 + E * z / x) / x, 0.02 * E / x)
        information.shift(sign * impulse)
        information.predict()
    return information


def section(information: InformationSet, label: float) -> ConvexPolygons:
    """In lengths, V counted as V x/e: what rounding does is alike along both axes then."""
    found = information.section_at(label)
    return found.polygons[0].linear_map([[found.range_m / E, 0.0], [0.0, 1.0]])


HAIR = 1e-9 * 1e4
"""Far above what rounding and the slack of some tens of ulp do to lengths of up to 10 km in a dozen
steps.
"""


@few
@given(MODEL, STORY, PART, LABEL)
def test_repeated_measurement_does_not_change_the_set(
    model: SetModel, events: list[tuple[float, float, float]], error: float, label: float
) -> None:
    information = tell(model, events)
    t = information.time_s
    alpha = (300.0 + 5.0 * t) / (RANGE - E * t) + 0.001 * error

    def measure(what: int) -> None:
        if what == 0:
            information.measure_angle(alpha)
        elif what == 1:
            information.measure_rate(0.0, 0.01)
        else:
            information.measure_range(RANGE - E * t, 0.08, alpha_rad=alpha)

    for what in range(3):
        measure(what)
        once = information.copy()
        measure(what)
        first = section(once, label)
        second = section(information, label)
        assert first.is_empty == second.is_empty
        assert same(first, second, HAIR)
        np.testing.assert_allclose(
            feasible_range_interval_m(once), feasible_range_interval_m(information), rtol=1e-9
        )


@few
@given(MODEL, STORY, LABEL, st.floats(1.0, 1.5))
def test_wider_bounds_give_larger_sets(
    model: SetModel, events: list[tuple[float, float, float]], label: float, more: float
) -> None:
    # The measured values must be the same: errors in units of a greater bound are less.
    within = [(error / more, impulse, rate) for error, impulse, rate in events]
    narrow = section(tell(model, events), label)
    sensor = replace(
        SENSOR, error_at_nominal_range_rad=0.002 * more, error_at_zero_range_rad=0.003 * more
    )
    assert lies_in(narrow, section(tell(replace(model, angle_sensor=sensor), within), label), HAIR)
    box = replace(BOUNDS, z_m=(-2e3 * more, 3e3 * more), vz_m_s=(-40.0 * more, 30.0 * more))
    for larger in (
        replace(model, bounds=box),
        replace(model, disturbance_m_s2=model.disturbance_m_s2 * more),
        replace(model, execution_error_relative=0.02 * more),
        replace(model, gravity_m_s2=0.01 * (more - 1.0)),
    ):
        assert lies_in(narrow, section(tell(larger, events), label), HAIR)


@few
@given(MODEL, STORY, LABEL, PART)
def test_more_data_give_smaller_sets_in_any_order(
    model: SetModel, events: list[tuple[float, float, float]], label: float, error: float
) -> None:
    before = tell(model, events)
    alpha = (300.0 + 5.0 * before.time_s) / (RANGE - E * before.time_s) + 0.001 * error
    one = before.copy()
    other = before.copy()
    one.measure_angle(alpha)
    one.measure_range(RANGE - E * before.time_s, 0.05)
    other.measure_range(RANGE - E * before.time_s, 0.05)
    other.measure_angle(alpha)
    assume(not (one.inconsistent.any() or other.inconsistent.any()))
    cut = section(one, label)
    same_cut = section(other, label)
    assert lies_in(cut, section(before, label), HAIR)
    assert same(cut, same_cut, HAIR)
    misses = [information.predicted_miss() for information in (before, one, other)]
    assert (
        misses[0].lower_m[0] - HAIR
        <= misses[1].lower_m[0]
        <= misses[1].upper_m[0]
        <= misses[0].upper_m[0] + HAIR
    )
    ends = [feasible_range_interval_m(information) for information in (before, one)]
    assert (
        ends[0][0][0] * (1.0 - 1e-12)
        <= ends[1][0][0]
        <= ends[1][1][0]
        <= ends[0][1][0] * (1.0 + 1e-12)
    )


@few
@given(STORY, LABEL, PART, PART)
def test_impulses_add_and_move_the_predicted_miss(
    events: list[tuple[float, float, float]], label: float, first: float, second: float
) -> None:
    one = tell(PAPER, events)
    other = tell(PAPER, events)
    before = other.section_at(label)
    one.shift(first)
    one.shift(second)
    other.shift(first + second)
    assert same(section(one, label), section(other, label), HAIR)
    after = other.section_at(label).polygons[0]
    assume(not before.polygons[0].is_empty)
    assert float(after.area()) == pytest.approx(
        float(before.polygons[0].area()), rel=1e-9, abs=1e-9
    )
    moved = before.polygons[0].translate((-(first + second), 0.0))
    assert same(after, moved, HAIR)


@few
@given(STORY, LABEL)
def test_prediction_is_a_shear_and_a_segment(
    events: list[tuple[float, float, float]], label: float
) -> None:
    """It keeps areas where there is no disturbance, and adds the width across the segment where
    there is one.
    """
    information = tell(PAPER, events)
    before = information.section_at(label).polygons[0]
    assume(not before.is_empty)
    information.predict()
    after = information.section_at(label)
    nu = PAPER.disturbance_m_s2
    half = np.array([nu * STEP, 0.5 * nu * STEP**2])
    wanted = before.linear_map([[1.0, 0.0], [STEP, 1.0]]).add_segment(half)
    assert same(after.polygons[0], wanted, HAIR)
    width = float(wanted.support_function((-half[1], half[0]))) + float(
        wanted.support_function((half[1], -half[0]))
    )
    area = float(before.area()) + 2.0 * width
    assert float(after.polygons[0].area()) == pytest.approx(area, rel=1e-9, abs=HAIR)
    assert float(after.omega_alpha[0].area()) * after.range_m**2 == pytest.approx(
        float(after.polygons[0].area()), rel=1e-9
    )
    still = tell(replace(PAPER, disturbance_m_s2=0.0), events)
    misses = [still.predicted_miss()]
    still.predict()
    misses.append(still.predicted_miss())
    assert misses[1].upper_m == pytest.approx(misses[0].upper_m, abs=HAIR)
    assert misses[1].lower_m == pytest.approx(misses[0].lower_m, abs=HAIR)


@few
@given(story(6), LABEL, LABEL)
def test_sections_are_concave_in_the_label(
    events: list[tuple[float, float, float]], one: float, other: float
) -> None:
    """Half of the sum of two sections lies in the section between: the whole set is convex."""
    information = tell(SOUND, [(error, impulse, -1.0) for error, impulse, _ in events])
    low, high, middle = (
        information.section_at(label).polygons[0] for label in (one, other, 0.5 * (one + other))
    )
    assume(not (low.is_empty or high.is_empty))
    assert lies_in(low.minkowski_sum(high).linear_map(0.5 * np.eye(2)), middle, HAIR)


@few
@given(MODEL, STORY, LABEL)
def test_a_mirrored_history_gives_the_mirrored_set(
    model: SetModel, events: list[tuple[float, float, float]], label: float
) -> None:
    box = replace(BOUNDS, z_m=(-3e3, 2e3), vz_m_s=(-30.0, 40.0))
    there = tell(model, events)
    back = tell(replace(model, bounds=box), events, sign=-1.0)
    image = section(back, label).linear_map(-np.eye(2))
    wanted = section(there, label)
    assert image.is_empty == wanted.is_empty
    assert same(image, wanted, ROUNDING)
    assert back.predicted_miss().lower_m == pytest.approx(
        -there.predicted_miss().upper_m, rel=1e-12
    )


@few
@given(MODEL, STORY, LABEL, st.integers(-30, 30))
def test_lengths_a_power_of_two_as_long_give_the_same_digits(
    model: SetModel, events: list[tuple[float, float, float]], label: float, power: int
) -> None:
    unit = 2.0**power
    box = StateBox(
        *((unit * ends[0], unit * ends[1]) for ends in vars(BOUNDS).values() if ends is not None)
    )
    scaled = replace(
        model,
        closing_speed_m_s=unit * E,
        bounds=box,
        angle_sensor=replace(SENSOR, nominal_range_m=unit * RANGE),
        disturbance_m_s2=unit * model.disturbance_m_s2,
        range_threshold_m=unit * model.range_threshold_m,
    )
    events = [(error, impulse, -1.0) for error, impulse, _ in events]
    plain = tell(model, events)
    other = InformationSet(scaled)
    for i, (error, impulse, _) in enumerate(events):
        z = 300.0 + 5.0 * STEP * i
        x = RANGE - E * STEP * i
        other.measure_angle(z / x + error * float(SENSOR.error_bound(x)))
        other.shift(unit * impulse)
        other.predict()
    assert (unit * plain.section_at(label).polygons[0].polygon()).tolist() == (
        other.section_at(unit * label).polygons[0].polygon().tolist()
    )
    assert (
        unit * plain.predicted_miss().upper_m
    ).tolist() == other.predicted_miss().upper_m.tolist()
    assert (unit * plain.ranges_m).tolist() == other.ranges_m.tolist()
