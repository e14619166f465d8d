"""Figures of engagements in space."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.path import Path

from infoset.arrays import Floats
from infoset.experiments.common.figure_style import figure_bytes
from infoset.experiments.interception.course import Courses, complete_steps, true_predicted_misses
from infoset.experiments.interception.figures.approach import draw_approach
from infoset.experiments.interception.figures.b_plane import Cloud, cloud, draw_b_plane, ellipse
from infoset.experiments.interception.figures.corridor import draw_corridor
from infoset.experiments.interception.figures.process import draw_process
from infoset.experiments.interception.figures.sets import draw_sets
from infoset.experiments.interception.scenario_file import load_scenario
from infoset.experiments.interception.study import Curve
from infoset.guidance import NoiseKind
from infoset.guidance.thruster import modulus
from infoset.sim import Body, Record, Results, fly_one, simulate
from infoset.sim.scenario import of_model

RUNS = 12
MEDIAN = "circle: median of the miss"
NINETY = "circle: 90 % of the misses"
GUARANTEE = "guaranteed miss Φ"


@pytest.fixture(scope="module")
def results() -> Results:
    return simulate(load_scenario("asteroid-1997-space"), RUNS)


@pytest.fixture(scope="module")
def records() -> list[Record]:
    scenario = load_scenario("asteroid-1997-space")
    return [fly_one(replace(scenario, noise=kind)) for kind in (NoiseKind.RANDOM, NoiseKind.GAME)]


def drawn(axes: Axes) -> dict[str, Floats]:
    """Return the points of the lines of axes by their labels."""
    return {
        str(line.get_label()): np.asarray(line.get_xydata(), dtype=np.float64)
        for line in axes.lines
    }


def circles(axes: Axes) -> dict[str, float]:
    """Return the radii of the circles by their labels."""
    lines = {
        name: points for name, points in drawn(axes).items() if name in (MEDIAN, NINETY, GUARANTEE)
    }
    return {name: float(np.hypot(*points.T).mean()) for name, points in lines.items()}


def legend(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_the_b_plane_shows_each_miss_and_the_circles_of_its_quantiles(results: Results) -> None:
    figure = draw_b_plane([cloud("random noise", [results])])
    assert all(content for _, content in figure_bytes(figure))
    (axes,) = figure.axes
    np.testing.assert_array_equal(drawn(axes)["miss of one run"], results.lateral_miss_m)
    quantiles = {MEDIAN: np.quantile(results.miss_m, 0.5), NINETY: np.quantile(results.miss_m, 0.9)}
    assert circles(axes) == pytest.approx(quantiles)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("miss along y, m", "miss along z, m")
    assert axes.get_aspect() == 1.0
    assert axes.get_xlim() == axes.get_ylim()
    assert axes.get_xlim()[1] > results.miss_m.max()


def test_with_several_results_of_a_run_the_worst_is_drawn(results: Results) -> None:
    middle = float(np.median(results.miss_m))
    near = replace(
        results, miss_m=np.full(RUNS, middle), lateral_miss_m=0.5 * results.lateral_miss_m
    )
    worst = cloud("worst", [near, results])
    np.testing.assert_array_equal(worst.miss_m, np.maximum(results.miss_m, middle))
    worse = results.miss_m > middle
    assert worse.any()
    np.testing.assert_array_equal(worst.across_m[worse], results.lateral_miss_m[worse])
    np.testing.assert_array_equal(worst.across_m[~worse], near.lateral_miss_m[~worse])


def test_ellipses_contain_their_share_of_the_runs_within_the_guaranteed_miss() -> None:
    across = np.random.default_rng(3).normal(size=(400, 2)) @ np.array([[3.0, 1.0], [0.0, 0.5]]) + [
        4.0,
        -2.0,
    ]
    for level in (0.5, 0.99):
        outline = ellipse(across, level)
        assert outline is not None
        centre = across.mean(axis=0)[:, None]
        wider = centre + (1.0 + 2e-4) * (
            outline - centre
        )  # 180 chords are up to 1.5e-4 inside, and a point is on them
        assert np.mean(Path(wider.T).contains_points(across)) == pytest.approx(level, abs=0.003)
        reach = float(np.hypot(*outline).max())
        assert ellipse(across, level, 0.99 * reach) is None
        assert ellipse(across, level, 1.01 * reach) is not None
    assert ellipse(across[:2], 0.5) is None
    assert ellipse(np.outer(np.arange(9.0), [1.0, 2.0]), 0.5) is None
    for guaranteed_m, count in ((None, 2), (9.0, 1)):
        figure = draw_b_plane([Cloud("many", across, np.hypot(*across.T), guaranteed_m)])
        assert sum(name.startswith("ellipse") for name in legend(figure)) == count


def test_ellipses_are_within_the_guaranteed_miss_of_the_aim_point() -> None:
    across = np.random.default_rng(3).normal(size=(400, 2))
    body = Body(100.0, aim_m=(60.0, 0.0))
    # Closest approaches without a miss are opposite to the aim point.
    closest = -np.array([60.0, 0.0])
    around_aim = Cloud("many", across + closest, np.hypot(*across.T), 9.0)
    around_centre = Cloud("many", across, np.hypot(*(across - closest).T), 9.0)
    for each, count in ((around_aim, 2), (around_centre, 0)):
        names = legend(draw_b_plane([each], body))
        assert sum(name.startswith("ellipse") for name in names) == count


def test_times_of_the_schedule_do_not_limit_the_axis_of_the_rates() -> None:
    record = fly_one(load_scenario("haiv-2013"))
    slow = replace(record, true_rate_rad_s=np.full_like(record.true_rate_rad_s, 1e-9))
    axes = next(axes for axes in draw_process([slow]).axes if "ω" in axes.get_ylabel())
    assert axes.get_ylim() == pytest.approx((0.5e-3, 2e-3))  # half and twice the rate in µrad/s


def test_wide_misses_have_a_panel_at_the_scale_of_the_body() -> None:
    across = 1e3 * np.random.default_rng(5).normal(size=(50, 2))
    across[:4] *= 1e-3
    misses = np.hypot(*across.T)
    hits = int((misses <= 100.0).sum())
    wide = Cloud("wide", across, misses, hits=hits)
    figure = draw_b_plane([wide, wide], Body(100.0))
    assert 4 <= hits < 50
    assert [axes.get_title("left").splitlines()[-1] for axes in figure.axes] == [
        f"hits: {hits} of 50 runs"
    ] * 4
    assert [axes.get_xlim()[1] == 200.0 for axes in figure.axes] == [False, False, True, True]
    assert "body radius, 100 m" in legend(figure)
    assert len(draw_b_plane([wide], Body(1500.0)).axes) == 1
    far = draw_b_plane(
        [replace(wide, across_m=20.0 * across, miss_m=20.0 * wide.miss_m)], None
    ).axes[0]
    assert far.get_xlabel() == "miss along y, km"


def test_planes_of_very_different_sets_have_individual_limits(records: list[Record]) -> None:
    random, game = records
    step = int(np.abs(random.time_s - 60.0).argmin())
    figure = draw_sets(records, [float(random.time_s[step])])
    for axes, (record, axis) in zip(
        figure.axes, ((random, 0), (random, 1), (game, 0), (game, 1)), strict=True
    ):
        outlines = [section.omega_alpha[axis].polygon() for section in record.sections[step]]
        width = 1e6 * np.ptp(np.concatenate(outlines)[:, 0])
        assert width > 0.14 * np.ptp(axes.get_xlim())


def test_process_has_a_column_for_each_record_and_axis(records: list[Record]) -> None:
    figure = draw_process(records)
    assert len(figure.axes) == 16
    for number, axes in enumerate(figure.axes[::8] + figure.axes[1::8]):
        record = records[number % 2]
        axis = number // 2
        np.testing.assert_allclose(
            drawn(axes)["true value"][:, 1], 1e3 * record.true_angle_rad[:, axis]
        )


def test_end_of_the_possible_miss_is_that_of_a_set_that_became_empty(
    records: list[Record],
) -> None:
    record = records[0]
    empty_from = record.steps // 2
    predicted_m = record.predicted_miss_m.copy()
    predicted_m[empty_from:] = np.nan
    emptied = replace(record, predicted_miss_m=predicted_m)

    lines = drawn(draw_approach([emptied]).axes[1])

    known = lines["possible miss without further impulses"]
    assert len(known) == empty_from
    np.testing.assert_array_equal(lines["end: last complete set"], known[-1:])


def scheduled(record: Record) -> Record:
    """The same record with a cut-off and a last image."""
    scenario = record.scenario
    sensor = replace(scenario.set_model.angle_sensor, last_image_s=4.0)
    thruster = replace(scenario.thruster, last_impulse_s=10.0)
    model = replace(scenario.set_model, angle_sensor=sensor)
    return replace(record, scenario=replace(scenario, **of_model(model), thruster=thruster))


def test_approach_shows_possible_misses_and_the_schedule(records: list[Record]) -> None:
    record = scheduled(records[0])
    figure = draw_approach([record])
    b_plane, possible, moduli = figure.axes
    lines = drawn(possible)
    known = lines["possible miss without further impulses"]
    centred = lines["after an impulse that centres the set"]
    shown = lines["miss of the true state without further impulses"]
    model = record.scenario.set_model
    near_m = model.range_threshold_m + model.closing_speed_m_s * model.step_s
    count = 1 + next(
        number for number, sections in enumerate(record.sections) if sections[0].range_m < near_m
    )
    assert 0.8 * record.steps < count < record.steps
    intervals = record.predicted_miss_m[:count]
    np.testing.assert_allclose(known[:, 1], np.hypot(*np.abs(intervals).max(axis=2).T))
    np.testing.assert_allclose(
        centred[:, 1], np.hypot(*(0.5 * np.diff(intervals, axis=2)[:, :, 0].T))
    )
    before = record.scenario.nominal_arrival_s - record.time_s
    half_step_s = 0.5 * model.step_s
    np.testing.assert_allclose(known[:, 0], np.maximum(before[:count], half_step_s))
    np.testing.assert_allclose(shown[:, 0], np.maximum(before, half_step_s))
    seconds = record.true_range_m[-1] / model.closing_speed_m_s
    end = true_predicted_misses(record)[-1] - seconds * record.impulse_m_s[-1]
    np.testing.assert_allclose(end, record.result.lateral_miss_m[0], atol=0.01)
    assert (shown[:count, 1] < 1.001 * known[:, 1]).all()
    assert possible.get_xlim()[0] > possible.get_xlim()[1]
    # The image of the schedule that is nearest to 4 s.
    image_times_s = record.scenario.nominal_arrival_s - model.angle_sensor.period_s * np.arange(
        record.steps
    )
    last_s = image_times_s[np.abs(image_times_s - 4.0).argmin()]
    assert [text.get_text() for text in possible.texts] == [
        "cut-off, 10 s",
        f"last image, {last_s:.3g} s",
    ]
    assert moduli.get_xlabel() == "time to go"
    assert b_plane.get_xlim() == b_plane.get_ylim()
    assert "times of the schedule" in legend(figure)
    assert "possible misses of the last complete set" in legend(figure)
    assert len(draw_approach(records).axes) == 6


def test_the_axes_of_the_b_plane_name_the_unit_of_their_ticks() -> None:
    across_m = np.array([[4e3, 0.0], [0.0, -8e3], [-6e3, 1e3]])
    far = Cloud("far", across_m, np.hypot(*across_m.T), t_rad=0.0)
    (axes,) = draw_b_plane([far]).axes

    assert axes.get_xlabel() == r"$B\cdot T$, km"
    assert axes.get_ylabel() == r"$B\cdot R$, km"
    assert axes.xaxis.get_major_formatter()(5e3) == "5"


@pytest.mark.parametrize("name", ["asteroid-1997", "asteroid-1997-space"])
def test_courses_equal_the_records_of_single_engagements(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys.modules["infoset.sim.simulate"], "ENGAGEMENTS_AT_ONCE", 2)
    monkeypatch.setattr("infoset.experiments.interception.course.MAX_COURSES", 3)
    scenario = load_scenario(name)
    scenario = replace(scenario, **of_model(replace(scenario.set_model, sections=5)))
    courses = Courses(scenario, 4)
    flown = simulate(scenario, 4, observe=courses.observe)
    assert flown.to_dict() == simulate(scenario, 4).to_dict()
    assert courses.possible_m.shape == courses.impulse_m_s.shape == (3, len(courses.steps))
    for run in range(3):
        record = fly_one(scenario, run)
        maximum = modulus(np.abs(record.predicted_miss_m[complete_steps(record)]).max(axis=-1).T)
        stored = courses.possible_m[run]
        maximum = maximum[: min(len(maximum) - 1, len(stored))]
        np.testing.assert_array_equal(stored[: len(maximum)], maximum)
        assert np.isnan(stored[len(maximum) :]).all()
        given = modulus(record.impulse_m_s.T)[: len(stored)]
        np.testing.assert_allclose(courses.impulse_m_s[run, : len(given)], given, rtol=1e-12)


def test_courses_of_long_flights_keep_the_max_impulses(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("infoset.experiments.interception.course.MAX_SHOWN_STEPS", 40)
    scenario = load_scenario("haiv-2013")
    courses = Courses(scenario, 2)
    assert len(courses.steps) <= 44
    assert set(scenario.thruster.impulses_s) <= set(courses.before_arrival_s)
    flown = simulate(scenario, 2, observe=courses.observe)
    at = [
        courses.before_arrival_s.tolist().index(time_s) for time_s in scenario.thruster.impulses_s
    ]
    assert flown.burns_m_s is not None
    np.testing.assert_allclose(courses.impulse_m_s[:, at], flown.burns_m_s, rtol=1e-12)
    every = load_scenario("asteroid-1997-space")
    courses = Courses(every, 1)
    simulate(every, 1, observe=courses.observe)
    assert courses.impulse_m_s.max() == pytest.approx(
        modulus(fly_one(every).impulse_m_s.T).max(), rel=1e-12
    )


def test_the_corridor_has_quantiles_of_possible_misses_and_impulses() -> None:
    scenario = load_scenario("haiv-2013")
    courses = Courses(scenario, 3)
    curve = Curve(1, "random", False, simulate(scenario, 3, observe=courses.observe))
    figure = draw_corridor([curve, curve], [courses, courses])
    left, right, left_impulse, _ = figure.axes
    assert left.get_title("left") == "(a) random noise, 3 runs"
    median, maximum = (drawn(left)[f"possible miss: {name}"] for name in ("median", "maximum"))
    np.testing.assert_allclose(median[:, 1], np.median(courses.possible_m, axis=0)[: len(median)])
    np.testing.assert_allclose(maximum[:, 1], courses.possible_m.max(axis=0)[: len(maximum)])
    end = drawn(left)["end: last complete set of half the runs"]
    np.testing.assert_array_equal(end[0], median[-1])
    assert left.get_ylim() == right.get_ylim()
    assert left.get_xlim() == left_impulse.get_xlim()
    assert {
        "impulse: median",
        "guaranteed miss Φ",
        "body radius, 50 m",
        "times of the schedule",
    } <= set(legend(figure))
    assert "impulse: 90 %" not in legend(figure)


def test_the_corridor_of_one_run_has_its_impulses() -> None:
    scenario = load_scenario("haiv-2013")
    courses = Courses(scenario, 1)
    curve = Curve(1, "random", False, simulate(scenario, 1, observe=courses.observe))

    below = draw_corridor([curve], [courses]).axes[1]

    (impulses,) = below.collections
    assert impulses.get_label() == "impulses of the run"
    tops = sorted(float(np.asarray(path.vertices)[:, 1].max()) for path in impulses.get_paths())
    assert tops == sorted(courses.impulse_m_s[courses.impulse_m_s > 0.0].tolist())


def test_a_long_flight_shows_the_errors_of_its_angles_within_their_bound_over_the_time_to_go() -> (
    None
):
    scenario = load_scenario("dart-2022", ["step_s=120", "camera.period_s=120"])
    record = fly_one(scenario)
    panels = [
        (axes, line)
        for axes in draw_process([record]).axes
        for line in axes.lines
        if line.get_label() == "error of the measured angle"
    ]
    bound = scenario.set_model.angle_sensor.error_bound
    for axis, (axes, line) in enumerate(panels):
        seen = record.measures("angle")
        errors = (record.measured["angle"] - record.true_angle_rad)[seen, axis]
        assert line.get_xdata() == pytest.approx(scenario.nominal_arrival_s - record.time_s[seen])
        assert line.get_ydata() == pytest.approx(1e6 * errors, abs=1e-6)
        distances_m = record.true_range_m[seen]
        assert (np.abs(line.get_ydata()) <= 1e6 * bound(distances_m) * (1.0 + 1e-9)).all()
        assert axes.get_ylabel() in ("", "error of α, µrad")
