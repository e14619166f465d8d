"""The information set: cuts, shifts, predictions, replay at any label, ends of the range."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from infoset import (
    AngleSensor,
    ConvexPolygons,
    InformationSet,
    InitialSet,
    Model,
    Recovery,
    SetModel,
    SetStatus,
    StateBox,
)
from infoset.arrays import Floats

E = 58e3
STEP = 0.5
SENSOR = AngleSensor(0.5, 0.00015, 0.00023, 5801.3e3)
KNOWN = StateBox((-10e3, 10e3), (5301.3e3, 6301.3e3), (-100.0, 100.0), (-59e3, -57e3))
MODEL = SetModel(
    E, STEP, KNOWN, SENSOR, disturbance_m_s2=0.005, range_threshold_m=5e3, model=Model.PAPER
)


def feasible_range_interval_m(information: InformationSet) -> tuple[Floats, Floats]:
    """Return the ends of the ranges that agree with the history, to rounding, m, shape (B,)."""
    refined = information.copy()
    refined._state.refine(refined.tracking, 2)
    return refined.stored_range_interval_m()


def flown(model: SetModel, steps: int, seed: int = 0, batch: int = 1) -> InformationSet:
    """Return a set after some steps with random noise and impulses, before a measurement."""
    random = np.random.default_rng(seed)
    z = random.uniform(-1e3, 1e3, (1, batch))
    v = random.uniform(-50.0, 50.0, (1, batch))
    x = 5801.3e3
    information = InformationSet(model, batch)
    for _ in range(steps):
        information.measure_angle(
            z / x + random.uniform(-1.0, 1.0, (1, batch)) * SENSOR.error_bound(x)
        )
        impulse = random.uniform(-3.0, 3.0, (1, batch))
        information.shift(impulse)
        v = v - impulse
        information.drop_below_threshold()
        information.predict()
        z = z + STEP * v
        x = x - E * STEP

    return information


def test_section_that_is_replayed_is_equal_to_the_section_carried_from_the_start() -> None:
    information = flown(replace(MODEL, sections=9, fewest_sections=1), 150)
    carried = information.sections()
    assert len(carried) >= 2
    for section in carried:
        replayed = information.section_at(section.label_m)
        np.testing.assert_allclose(
            replayed.polygons[0].polygon(), section.polygons[0].polygon(), rtol=1e-12, atol=0.0
        )
        assert replayed.range_m == section.range_m


@pytest.mark.parametrize("rates", range(1, 9))
def test_rates_of_one_engagement_leave_room_for_the_sections_of_another(rates: int) -> None:
    model = replace(MODEL, sections=3, fewest_sections=1)
    alone = InformationSet(model)
    both = InformationSet(model, 2)
    for _ in range(90):
        both.measure_angle(0.0, [True, False])
        for _ in range(rates):
            both.measure_rate(0.0, 1.0, [True, False])
        for information in (alone, both):
            information.predict()

    for one, other in zip(alone.sections(), both.sections(1), strict=True):
        np.testing.assert_array_equal(other.polygons[0].polygon(), one.polygons[0].polygon())


def model_in_space() -> SetModel:
    return replace(MODEL, bounds=replace(KNOWN, y_m=(-8e3, 8e3), vy_m_s=(-80.0, 80.0)))


@pytest.mark.parametrize("batch", [1, 3])
def test_number_in_space_is_for_all_axes_and_engagements(batch: int) -> None:
    one = InformationSet(model_in_space(), batch)
    each = InformationSet(model_in_space(), batch)

    one.measure_angle(0.0002)
    one.shift(1.0)
    each.measure_angle(np.full((2, batch), 0.0002))
    each.shift(np.full((2, batch), 1.0))

    np.testing.assert_array_equal(one.predicted_miss().upper_m, each.predicted_miss().upper_m)


@pytest.mark.parametrize("batch", [1, 3])
@pytest.mark.parametrize(
    "value", [[0.0004], [0.1, 0.2, 0.3], [[0.1, 0.2]] * 3, [[np.nan, np.nan, np.nan]] * 2, "ab"]
)
def test_value_in_space_of_another_shape_is_refused_and_changes_nothing(
    value: Any, batch: int
) -> None:
    information = InformationSet(model_in_space(), batch)
    before = information.predicted_miss().upper_m

    for change in (information.measure_angle, information.shift):
        with pytest.raises(
            (ValueError, TypeError), match=r"have the shape \(2, [13]\)|finite|numbers"
        ):
            change(value)

    np.testing.assert_array_equal(information.predicted_miss().upper_m, before)


def test_new_grid_has_twice_the_fewest_sections_and_one_over_the_feasible_range() -> None:
    model = replace(MODEL, sections=5, fewest_sections=5)
    information = InformationSet(model)
    information.measure_range(5801.3e3, 0.05)
    ranges = np.array([section.range_m for section in information.sections()])

    assert len(ranges) == 11
    np.testing.assert_allclose(
        ranges, np.linspace(5801.3e3 / 1.05, 5801.3e3 / 0.95, 11), rtol=1e-12
    )


def test_range_measurement_keeps_exactly_the_ranges_within_its_bound() -> None:
    information = InformationSet(replace(MODEL, sections=101))
    information.measure_range(5801.3e3, 0.05)
    minimum, maximum = feasible_range_interval_m(information)

    assert minimum[0] == pytest.approx(5801.3e3 / 1.05, rel=1e-13)
    assert maximum[0] == pytest.approx(5801.3e3 / 0.95, rel=1e-13)

    ranges = [section.range_m for section in information.sections()]
    assert minimum[0] <= min(ranges)
    assert max(ranges) <= maximum[0]


@pytest.mark.parametrize("seed", range(6))
def test_ends_of_the_range_are_feasible_and_labels_just_beyond_are_not(seed: int) -> None:
    # With a sharp sensor and a large offset angles depend on the range, so that the ends of the
    # range are between stored labels.
    sharp = AngleSensor(0.5, 2e-6, 2e-6, 5801.3e3)
    model = replace(MODEL, angle_sensor=sharp, disturbance_m_s2=0.0, sections=15, fewest_sections=2)
    random = np.random.default_rng(seed)
    information = InformationSet(model)
    z = 9e3
    v = -80.0
    x = 5801.3e3
    for _ in range(90):
        information.measure_angle(z / x + random.uniform(-1.0, 1.0) * 2e-6)
        impulse = float(random.uniform(-7.0, 7.0))
        information.shift(impulse)
        v -= impulse
        information.drop_below_threshold()
        information.predict()
        z = z + STEP * v
        x = x - E * STEP

    assert information.tracking[0]

    travelled = E * information.time_s
    minimum, maximum = feasible_range_interval_m(information)

    assert maximum[0] - minimum[0] < 0.9 * 1000e3
    for end, outward in ((minimum[0], -1.0), (maximum[0], 1.0)):
        label = end + travelled
        beyond = label + outward * 2e-9 * label
        assert not information.section_at(label).polygons[0].is_empty
        assert information.section_at(beyond).polygons[0].is_empty


def test_initial_rectangle_is_the_rectangle_of_the_paper() -> None:
    section = InformationSet(replace(MODEL, sections=1, fewest_sections=1)).sections()[0]
    x = section.label_m
    lower, upper = section.omega_alpha[0].bounding_box()

    assert lower[1] == pytest.approx(math.atan(-10e3 / x), rel=1e-12)
    assert upper[1] == pytest.approx(math.atan(10e3 / x), rel=1e-12)
    assert lower[0] == pytest.approx((-100.0 * x - -59e3 * -10e3) / x**2, rel=1e-9)
    assert upper[0] == pytest.approx((100.0 * x - -59e3 * 10e3) / x**2, rel=1e-9)


def test_initial_box_is_the_box_of_the_bounds() -> None:
    information = InformationSet(replace(MODEL, initial_set=InitialSet.BOX))
    lower, upper = information.sections()[0].polygons[0].bounding_box()
    np.testing.assert_array_equal(lower, (-100.0, -10e3))
    np.testing.assert_array_equal(upper, (100.0, 10e3))


def test_one_step_is_equal_to_the_formulas_of_the_theory() -> None:
    """Band, shift, shear and disturbance of a box, from the formulas of the theory."""
    model = replace(
        MODEL, initial_set=InitialSet.BOX, sections=1, fewest_sections=1, disturbance_m_s2=0.02
    )
    information = InformationSet(model)
    x = information.sections()[0].range_m
    bound = SENSOR.error_bound(x)
    information.measure_angle(0.001)
    lower, upper = information.sections()[0].polygons[0].bounding_box()

    np.testing.assert_allclose(
        (lower[1], upper[1]), (x * (0.001 - bound), x * (0.001 + bound)), rtol=1e-13
    )

    information.shift(4.0)
    information.predict()
    section = information.sections()[0]

    assert section.range_m == pytest.approx(x - E * STEP, rel=1e-15)

    nu = 0.02
    for direction in ((1.0, 0.0), (0.0, 1.0), (0.3, 1.0), (-1.0, 0.2), (-0.3, -1.0)):
        corners = [
            (v - 4.0, z + STEP * (v - 4.0)) for v in (-100.0, 100.0) for z in (lower[1], upper[1])
        ]
        push = abs(direction[0] * nu * STEP + direction[1] * 0.5 * nu * STEP**2)
        expected = max(direction[0] * v + direction[1] * z for v, z in corners) + push
        assert section.polygons[0].support_function(direction) == pytest.approx(expected, rel=1e-13)


def test_predicted_miss_of_the_initial_box_is_the_formula_of_the_theory() -> None:
    model = replace(MODEL, initial_set=InitialSet.BOX, sections=2, fewest_sections=1)
    miss = InformationSet(model).predicted_miss()
    time_to_go = 6301.3e3 / E
    expected = 10e3 + 100.0 * time_to_go + 0.5 * 0.005 * time_to_go**2

    assert miss.upper_m[0] == pytest.approx(expected, rel=1e-13)
    assert miss.lower_m[0] == pytest.approx(-expected, rel=1e-13)
    assert miss.upper_point.range_m[0] == 6301.3e3
    assert miss.upper_point.omega_rad_s[0] * 6301.3e3**2 / E == pytest.approx(
        10e3 + 100.0 * time_to_go, rel=1e-13
    )


def test_point_of_an_extreme_edge_is_its_lowest_above_and_its_highest_below() -> None:
    """The paper's rectangle has whole edges of extreme omega: the vertex rule of the theory."""
    information = InformationSet(replace(MODEL, sections=1, fewest_sections=1))
    for _ in range(3):
        information.predict()
    miss = information.predicted_miss()
    lower, upper = information.sections()[0].omega_alpha[0].bounding_box()
    points = information.sections()[0].omega_alpha[0].polygon()
    tolerance = 1e-9 * (upper[0] - lower[0])

    assert miss.upper_point.alpha_rad[0, 0] == pytest.approx(
        points[points[:, 0] > upper[0] - tolerance, 1].min()
    )
    assert miss.lower_point.alpha_rad[0, 0] == pytest.approx(
        points[points[:, 0] < lower[0] + tolerance, 1].max()
    )
    assert miss.upper_point.alpha_rad[0, 0] < miss.lower_point.alpha_rad[0, 0]


def test_inconsistent_measurement_is_reported_and_the_last_consistent_set_continues() -> None:
    information = InformationSet(MODEL, batch=2)
    information.measure_angle(0.001)
    before = information.copy()
    information.measure_angle([[0.0012, -0.0012]])

    assert information.inconsistent.tolist() == [False, True]

    step, label = information.inconsistency
    assert step.tolist() == [None, 0]
    assert MODEL.bounds.x_m[0] <= label[1] <= MODEL.bounds.x_m[1]
    assert information.status == [SetStatus.TRACKING, SetStatus.TRACKING]

    # The set before the measurement, wider by the error bound of one measurement: e b in V, which
    # is x b of miss.
    x = 5801.3e3
    bound = MODEL.angle_sensor.error_bound(x)
    old = before.section_at(x, 1).polygons[0]
    new = information.section_at(x, 1).polygons[0]
    grown = old.minkowski_sum(ConvexPolygons.from_box((-E * bound, 0.0), (E * bound, 0.0)))

    for direction in ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0), (1.0, 0.01), (-1.0, 0.02)):
        assert new.support_function(direction) == pytest.approx(
            float(grown.support_function(direction)), rel=1e-9
        )

    information.predict()
    information.shift(1.0)

    assert information.predicted_miss().exists.all()


def test_set_is_finished_if_all_labels_have_left() -> None:
    information = InformationSet(replace(MODEL, sections=2, fewest_sections=1))
    for _ in range(230):
        information.drop_below_threshold()
        information.predict()
    assert information.status == [SetStatus.FINISHED]


def test_measurement_of_some_of_a_batch_does_not_change_the_others() -> None:
    information = InformationSet(MODEL, batch=2)
    before = information.sections(1)[3].polygons[0].polygon()
    information.measure_angle(0.0003, where=[True, False])

    np.testing.assert_array_equal(information.sections(1)[3].polygons[0].polygon(), before)
    assert (
        information.sections(0)[3].polygons[0].area()
        < information.sections(1)[3].polygons[0].area()
    )


@pytest.mark.parametrize("recovery", list(Recovery))
def test_copy_of_a_view_continues_as_the_set_does(recovery: Recovery) -> None:
    """Some labels have left before a contradiction: they decide about the status of the set."""
    information = InformationSet(
        replace(MODEL, model=Model.GUARANTEED, initial_set=InitialSet.BOX, recovery=recovery)
    )
    while not information.guaranteed_miss()[1].any():
        information.drop_below_threshold()
        information.predict()

    information.measure_angle(0.0)
    copies = information.copy(), information.view().copy()
    for each in copies:
        each.measure_angle(1.2)
    straight, by_view = copies

    assert by_view.status == straight.status == [SetStatus.REFUTED]
    assert by_view.inconsistent.tolist() == straight.inconsistent.tolist() == [False]
    np.testing.assert_array_equal(by_view.guaranteed_miss(), straight.guaranteed_miss())


@pytest.mark.parametrize(("range_m", "nearest"), [(5.0e6, "minimum"), (6.5e6, "maximum")])
def test_label_of_an_inconsistent_range_is_the_nearest_feasible_one(
    range_m: float, nearest: str
) -> None:
    information = InformationSet(MODEL)
    information.measure_range(5.5e6, 1e-3)
    feasible = information.labels_m[information.feasible]
    information.measure_range(range_m, 1e-3)
    (step,), (label,) = information.inconsistency

    assert step == 0

    # The limits are a little outside the labels of the outermost sections.
    wanted = feasible.min() if nearest == "minimum" else feasible.max()
    assert label == pytest.approx(wanted, rel=1e-3)


def test_sections_are_segments_and_points_if_the_start_is_known_exactly() -> None:
    line = replace(MODEL, bounds=replace(KNOWN, z_m=(100.0, 100.0)), initial_set=InitialSet.BOX)
    assert InformationSet(line).sections()[0].polygons[0].counts == 2
    point = replace(line, bounds=replace(line.bounds, vz_m_s=(3.0, 3.0)))
    assert InformationSet(point).sections()[0].polygons[0].polygon().tolist() == [[3.0, 100.0]]


def test_sections_keep_the_vertex_cap_after_many_cuts_in_one_step() -> None:
    """Each cut may add two vertices: at the cap they are removed again."""
    information = InformationSet(
        replace(MODEL, sections=3, fewest_sections=1, initial_set=InitialSet.BOX)
    )
    for _ in range(140):
        information.predict()
    section = information.sections()[1]
    bound = float(SENSOR.error_bound(section.range_m))
    minimum, maximum = (
        float(corner[1]) / section.range_m for corner in section.polygons[0].bounding_box()
    )

    assert maximum - minimum > 2.0 * bound

    for share in np.linspace(0.0, 0.9, 12):
        information.measure_angle(minimum + (1.0 + share) * bound)
        assert all(int(section.polygons[0].counts) <= 256 for section in information.sections())

    assert information.tracking[0]


def test_sections_at_the_vertex_cap_contain_the_exact_ones() -> None:
    """Without cuts every step adds two vertices; the reduced section contains the exact one."""
    information = InformationSet(
        replace(MODEL, sections=1, fewest_sections=1, initial_set=InitialSet.BOX)
    )
    exact = information.sections()[0].polygons[0]
    nu = MODEL.disturbance_m_s2
    for _ in range(150):
        information.predict()
        exact = exact.linear_map([[1.0, 0.0], [STEP, 1.0]]).add_segment(
            [nu * STEP, 0.5 * nu * STEP**2]
        )

    kept = information.sections()[0].polygons[0]

    assert int(kept.counts) <= 256
    assert int(exact.counts) > 256

    turns = np.linspace(0.0, 6.28, 60)
    normals = np.column_stack((50.0 * np.cos(turns), np.sin(turns)))
    for normal in normals:
        assert kept.support_function(normal) >= exact.support_function(normal) * (1.0 - 1e-13)
    assert kept.area() <= exact.area() * 1.001
    assert isinstance(exact, ConvexPolygons)
