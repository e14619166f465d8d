"""Figures of engagements in space."""

from __future__ import annotations

import sys
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon
from PIL import Image, ImageSequence

from experiments.common.input_file import to_toml
from experiments.interception.course import Clock, Courses, duration_text, possible_misses, true_predicted_misses
from experiments.interception.curves import Curve
from experiments.interception.figures.animation import animate
from experiments.interception.figures.approach import draw_approach
from experiments.interception.figures.b_plane import Cloud, cloud, draw_b_plane, ellipse, max_guarantee
from experiments.interception.figures.corridor import draw_corridor
from experiments.interception.figures.process import draw_process
from experiments.interception.figures.sets import TRUTH_MARK, choose_sections, draw_sets, planes_at
from experiments.interception.scenario_file import load_scenario
from guidance import NoiseKind
from sim import Record, Results, Scenario, fly_one, simulate
from sim.scenario import of_model
from tests.experiments.command_line import Command
from tests.space import in_space

RUNS = 12
AXES = ("y", "z")


@pytest.fixture(scope="module")
def results() -> Results:
    return simulate(load_scenario("asteroid-1997-space"), RUNS)


@pytest.fixture(scope="module")
def records() -> list[Record]:
    scenario = load_scenario("asteroid-1997-space")
    return [fly_one(replace(scenario, noise=kind)) for kind in NoiseKind]


def circles(axes: Axes) -> dict[str, float]:
    return {str(patch.get_label()): patch.radius for patch in axes.patches if isinstance(patch, Circle)}


def legend(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_the_b_plane_shows_each_miss_and_the_circles_of_its_quantiles(results: Results) -> None:
    figure = draw_b_plane([cloud("random noise", [results])])
    (axes,) = figure.axes
    (points,) = [line for line in axes.lines if line.get_label() == "_misses"]
    np.testing.assert_array_equal(np.asarray(points.get_xydata()), results.lateral_miss.data)
    assert circles(axes) == {"_0.5": np.quantile(results.miss_m, 0.5), "_0.9": np.quantile(results.miss_m, 0.9)}
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("miss along y, m", "miss along z, m")
    assert axes.get_aspect() == 1.0
    assert axes.get_xlim() == axes.get_ylim()
    assert axes.get_xlim()[1] > results.miss_m.max()
    assert legend(figure)[0] == f"miss of one run, {RUNS} runs per panel"


def test_with_several_results_of_a_run_the_worst_is_drawn(results: Results) -> None:
    middle = float(np.median(results.miss_m))
    near = replace(results, miss_m=np.full(RUNS, middle), lateral_miss=0.5 * results.lateral_miss)
    drawn = cloud("worst", [near, results])
    np.testing.assert_array_equal(drawn.miss_m, np.maximum(results.miss_m, middle))
    worse = results.miss_m > middle
    assert worse.any()
    np.testing.assert_array_equal(drawn.across_m[worse], results.lateral_miss.data[worse])
    np.testing.assert_array_equal(drawn.across_m[~worse], near.lateral_miss.data[~worse])


def test_the_radius_of_the_body_is_a_circle(results: Results) -> None:
    one = cloud("random noise", [results])
    for radius, drawn, where in ((4.0, True, "a smaller miss is a hit"), (1e6, False, "beyond the axes")):
        figure = draw_b_plane([one], radius)
        assert ("_radius" in circles(figure.axes[0])) == drawn
        assert legend(figure)[-1] == f"body radius, {radius:g} m: {where}"
    assert "radius" not in " ".join(legend(draw_b_plane([one])))


def test_a_circle_of_a_quantile_does_not_hide_the_radius_of_the_body(results: Results) -> None:
    (axes,) = draw_b_plane([cloud("random noise", [results])], float(np.median(results.miss_m))).axes
    orders = {patch.get_label(): patch.get_zorder() for patch in axes.patches}
    assert orders.pop("_radius") > max(orders.values())
    (points,) = [line for line in axes.lines if line.get_label() == "_misses"]
    assert points.get_zorder() > max(orders.values())


def test_ellipses_contain_their_share_of_the_runs() -> None:
    numbers = np.random.default_rng(3)
    across = numbers.normal(size=(400, 2)) @ np.array([[3.0, 1.0], [0.0, 0.5]]) + [4.0, -2.0]
    for level in (0.5, 0.99):
        shape = ellipse(across, level)
        assert shape is not None
        centre, axes, angle = shape
        turned = (across - centre) @ np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        assert np.mean(np.sum((turned / axes) ** 2, axis=1) <= 1.0 + 1e-9) == pytest.approx(level, abs=0.003)
    assert ellipse(across[:2], 0.5) is None
    assert ellipse(np.outer(np.arange(9.0), [1.0, 2.0]), 0.5) is None
    figure = draw_b_plane([Cloud("many", across, np.hypot(*across.T))])
    drawn = {str(patch.get_label()) for patch in figure.axes[0].patches}
    assert {"_ellipse 0.5", "_ellipse 0.99"} <= drawn
    assert {"ellipse: 50 % of the runs", "ellipse: 99 % of the runs"} <= set(legend(figure))


def test_the_max_guaranteed_miss_of_the_runs_is_a_circle(results: Results) -> None:
    bound = float(results.guaranteed_miss_m.max())
    assert cloud("paper model", [results]).guaranteed_m is None
    sound = cloud("guaranteed", [replace(results, guarantees=True)])
    assert sound.guaranteed_m == bound
    figure = draw_b_plane([replace(sound, guaranteed_m=1.5 * float(results.miss_m.max()))])
    assert circles(figure.axes[0])["_guarantee"] == 1.5 * float(results.miss_m.max())
    assert "circle: guaranteed miss Φ, maximum of the runs" in legend(figure)
    far = draw_b_plane([replace(sound, guaranteed_m=1e5)])
    assert "_guarantee" not in circles(far.axes[0])
    assert far.axes[0].get_title().endswith("maximum Φ: 100000.0 m")
    assert "circle: guaranteed miss Φ, maximum of the runs: beyond the axes" in legend(far)
    assert max_guarantee([3.0, np.inf]) is None


def test_samples_that_differ_much_have_limits_for_each_panel(results: Results) -> None:
    small = cloud("small", [results])
    large = Cloud("large", 20.0 * small.across_m, 20.0 * small.miss_m)
    alike, unlike = draw_b_plane([small, small]), draw_b_plane([small, large])
    assert alike.axes[0].get_xlim() == alike.axes[1].get_xlim()
    assert unlike.axes[1].get_xlim()[1] == pytest.approx(20.0 * unlike.axes[0].get_xlim()[1])
    assert unlike.legends[0].get_title().get_text() == "The scale differs from panel to panel."
    assert [axes.get_title().splitlines()[0] for axes in unlike.axes] == ["(a) small", "(b) large"]


def test_a_few_huge_misses_leave_the_panel_legible() -> None:
    across = np.column_stack([np.linspace(1.0, 2.0, 40), np.linspace(-1.0, 1.0, 40)])
    across[3] = 8e4
    (axes,) = draw_b_plane([Cloud("lost", across, np.hypot(*across.T))]).axes
    assert axes.get_xlim()[1] < 5.0
    assert [text.get_text() for text in axes.texts] == ["beyond the axes: 1 of 40"]


def test_quantiles_that_the_runs_do_not_show_are_left_out() -> None:
    across = np.array([[1.0, 0.0], [0.0, 2.0]])
    figure = draw_b_plane([Cloud("two", across, np.array([1.0, 2.0]))])
    assert set(circles(figure.axes[0])) == {"_0.5"}
    assert "circle: 90 % of the misses" not in legend(figure)
    with pytest.raises(ValueError, match="at least one cloud"):
        draw_b_plane([])


def test_process_has_the_courses_of_both_axes(records: list[Record]) -> None:
    figure = draw_process(records[:1])
    steps = records[0].steps
    assert len(figure.axes) == 8
    assert [axes.get_title() for axes in figure.axes[:2]] == ["along y", "along z"]
    assert figure.axes[0].texts[0].get_text().startswith("random noise, range sensor\nmiss ")
    for column, axis in enumerate(AXES):
        angle, rate, _, below = figure.axes[column::2]
        for axes, field, scale in ((angle, "true_angle_rad", 1e3), (rate, "true_rate_rad_s", 1e6)):
            true = [getattr(step.axes[axis], field) * scale for step in steps]
            assert any(np.array_equal(np.asarray(line.get_ydata()), true) for line in axes.lines)
        measured = [step.axes[axis].measured["angle"] * 1e3 for step in steps]
        np.testing.assert_allclose(np.asarray(angle.lines[0].get_ydata()), measured)
        lower = [miss[0] for step in steps if (miss := step.axes[axis].predicted_miss_m) is not None]
        assert any(np.array_equal(np.asarray(line.get_ydata()), lower) for line in below.lines)
    for row in range(4):
        first, second = figure.axes[2 * row : 2 * row + 2]
        assert first.get_ylim() == second.get_ylim()


def test_process_shows_the_components_and_the_modulus_of_an_impulse(records: list[Record]) -> None:
    figure = draw_process(records[1:])
    steps = records[1].steps
    moduli = np.array([step.impulse_m_s for step in steps])
    for axes, axis in zip(figure.axes[4:6], AXES, strict=True):
        behind, before = (
            np.array([np.asarray(path.vertices)[1, 1] for path in lines.get_paths()]) for lines in axes.collections
        )
        np.testing.assert_allclose(behind, moduli[moduli > 0.0])
        component = np.array([step.axes[axis].impulse_m_s for step in steps])
        np.testing.assert_allclose(before, component[component != 0.0])
    assert {"impulse component", "modulus of the impulse vector, upward"} <= set(legend(figure))


def test_process_of_two_records_has_four_columns(records: list[Record]) -> None:
    figure = draw_process(records)
    assert [axes.get_title() for axes in figure.axes[:4]] == ["along y", "along z"] * 2
    assert [figure.axes[k].texts[0].get_text()[:3] for k in (0, 2)] == ["(a)", "(b)"]
    for axes in figure.axes:
        for text in axes.texts[1:]:
            assert text.get_window_extent().width < 1.2 * axes.get_window_extent().width


def test_the_sets_of_both_planes_are_side_by_side(records: list[Record]) -> None:
    figure = draw_sets(records[:1], (0.5, 8.0), sections=3)
    titles = [
        "(a) {}\nalong y, t = 0.5 s",
        "(b) {}\nalong z, t = 0.5 s",
        "(c) {}\nalong y, t = 8 s",
        "(d) {}\nalong z, t = 8 s",
    ]
    assert [axes.get_title() for axes in figure.axes] == [each.format("random noise, range sensor") for each in titles]
    for number, axes in enumerate(figure.axes):
        step, axis = records[0].steps[(1, 16)[number // 2]], AXES[number % 2]
        assert axes.get_xlabel() == f"line-of-sight rate ω along {axis}, µrad/s"
        assert axes.get_ylabel().split(",")[0] == f"line-of-sight angle α along {axis}"
        chosen = choose_sections(step.sections, 3)
        polygons = [section.omega_alpha if axis == "z" else section.omega_alpha_y for section in chosen]
        drawn = [patch.get_xy() for patch in axes.patches if isinstance(patch, Polygon) and patch.get_closed()]
        for outline, polygon in zip(drawn[-3:], polygons, strict=True):
            assert polygon is not None
            np.testing.assert_allclose(np.asarray(outline)[:-1], polygon.polygon() * [1e6, 1e3])
        (truth,) = [line for line in axes.lines if line.get_label() == TRUTH_MARK]
        along = step.axes[axis]
        true = np.array([[along.true_rate_rad_s * 1e6, along.true_angle_rad * 1e3]])
        np.testing.assert_allclose(np.asarray(truth.get_xydata(), dtype=np.float64), true)
        assert {text.get_text() for text in axes.texts} == {f"{section.range_m / 1e3:.0f} km" for section in chosen}


def test_an_animation_shows_both_axes(brief: Scenario) -> None:
    records = [fly_one(replace(in_space(brief), noise=kind)) for kind in NoiseKind]
    sizes = []
    for shown in (records[:1], records):
        with Image.open(BytesIO(animate(shown, 2))) as animation:
            sizes.append((animation.size[0], len(list(ImageSequence.Iterator(animation)))))
    assert sizes == [(640, 2), (1280, 2)]


@pytest.mark.parametrize("name", ["experiment", "compare"])
@pytest.mark.parametrize("spatial", [False, True])
@pytest.mark.usefixtures("unrendered")
def test_commands_write_a_b_plane_of_each_noise_in_space_only(
    infoset: Command, brief: Scenario, tmp_path: Path, name: str, spatial: bool
) -> None:
    (tmp_path / "brief.toml").write_text(to_toml(in_space(brief) if spatial else brief))
    strategies = ("--strategies", "patient") if name == "compare" else ()
    assert infoset(name, "brief.toml", "--runs", "2", "--out", "out", *strategies)[0] == 0
    written = {file.stem for file in (tmp_path / "out").glob("figure-b-plane-*.png")}
    assert written == ({"figure-b-plane-random", "figure-b-plane-game"} if spatial else set())


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
    possible, moduli, b_plane = figure.axes
    lines = {str(line.get_label()): np.asarray(line.get_xydata(), dtype=np.float64) for line in possible.lines}
    model = record.scenario.set_model
    near_m = model.range_threshold_m + model.closing_speed_m_s * model.step_s
    last = next(number for number, step in enumerate(record.steps) if step.sections[0].range_m < near_m)
    steps = record.steps[: last + 1]
    assert 0.8 * len(record.steps) < len(steps) < len(record.steps)
    intervals = np.array([[step.axes[axis].predicted_miss_m for axis in AXES] for step in steps])
    np.testing.assert_allclose(lines["_possible"][:, 1], np.hypot(*np.abs(intervals).max(axis=2).T))
    np.testing.assert_allclose(lines["_centred"][:, 1], np.hypot(*(0.5 * np.diff(intervals, axis=2)[:, :, 0].T)))
    before = record.scenario.nominal_arrival_s - np.array([step.time_s for step in record.steps])
    np.testing.assert_allclose(lines["_possible"][:, 0], np.maximum(before[: len(steps)], 0.25))
    np.testing.assert_allclose(lines["_true"][:, 0], np.maximum(before, 0.25))
    end_step = record.steps[-1]
    seconds = end_step.true_range_m / model.closing_speed_m_s
    end = [miss[-1] - seconds * end_step.axes[axis].impulse_m_s for axis, miss in true_predicted_misses(record).items()]
    np.testing.assert_allclose(end, record.result.lateral_miss[0].data, atol=0.01)
    assert (lines["_true"][: len(steps), 1] < 1.001 * lines["_possible"][:, 1]).all()
    assert possible.get_xlim()[0] > possible.get_xlim()[1]
    assert [text.get_text() for text in possible.texts] == ["cut-off, 10 s", "last image, 4 s"]
    assert moduli.get_xlabel() == "time before the nominal arrival"
    assert b_plane.get_xlim() == b_plane.get_ylim()
    assert "times of the schedule" in legend(figure)
    assert len(draw_approach(records).axes) == 6


@pytest.mark.parametrize("name", ["asteroid-1997", "asteroid-1997-space"])
def test_courses_are_those_of_single_engagements(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.modules["sim.simulate"], "ENGAGEMENTS_AT_ONCE", 2)
    monkeypatch.setattr("experiments.interception.course.MAX_COURSES", 3)
    scenario = load_scenario(name)
    scenario = replace(scenario, **of_model(replace(scenario.set_model, sections=5)))
    courses = Courses(scenario, 4)
    flown = simulate(scenario, 4, observe=courses.observe)
    assert flown.to_dict() == simulate(scenario, 4).to_dict()
    assert courses.possible_m.shape == courses.impulse_m_s.shape == (3, len(courses.steps))
    for run in range(3):
        record = fly_one(scenario, run)
        _, misses = possible_misses(record)
        maximum = np.hypot.reduce([np.abs(interval).max(axis=1) for interval in misses.values()])
        stored = courses.possible_m[run]
        maximum = maximum[: min(len(maximum) - 1, len(stored))]
        np.testing.assert_array_equal(stored[: len(maximum)], maximum)
        assert np.isnan(stored[len(maximum) :]).all()
        given = [abs(step.impulse_m_s) for step in record.steps[: len(stored)]]
        np.testing.assert_allclose(courses.impulse_m_s[run, : len(given)], given, rtol=1e-12)


def test_courses_of_long_flights_keep_the_max_impulses(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("experiments.interception.course.MAX_STEPS", 40)
    scenario = load_scenario("haiv-2013")
    courses = Courses(scenario, 2)
    assert len(courses.steps) <= 44
    assert set(scenario.thruster.impulses_s) <= set(courses.before_arrival_s)
    flown = simulate(scenario, 2, observe=courses.observe)
    at = [courses.before_arrival_s.tolist().index(time_s) for time_s in scenario.thruster.impulses_s]
    assert flown.burns_m_s is not None
    np.testing.assert_allclose(courses.impulse_m_s[:, at], flown.burns_m_s, rtol=1e-12)
    every = load_scenario("asteroid-1997-space")
    courses = Courses(every, 1)
    simulate(every, 1, observe=courses.observe)
    impulses = [step.impulse_m_s for step in fly_one(every).steps]
    assert courses.impulse_m_s.max() == pytest.approx(max(impulses), rel=1e-12)


def test_the_corridor_has_quantiles_of_possible_misses_and_impulses() -> None:
    scenario = load_scenario("haiv-2013")
    courses = Courses(scenario, 3)
    curve = Curve(1, NoiseKind.RANDOM, False, simulate(scenario, 3, observe=courses.observe))
    figure = draw_corridor([curve, curve], [courses, courses])
    left, right, left_impulse, _ = figure.axes
    assert left.get_title() == "(a) random noise, 3 runs"
    median, maximum = (np.asarray(line.get_xydata(), dtype=np.float64) for line in left.lines[:2])
    np.testing.assert_allclose(median[:, 1], np.median(courses.possible_m, axis=0)[: len(median)])
    np.testing.assert_allclose(maximum[:, 1], courses.possible_m.max(axis=0)[: len(maximum)])
    assert left.get_ylim() == right.get_ylim()
    assert left.get_xlim() == left_impulse.get_xlim()
    assert legend(figure) == [
        "possible miss: median",
        "possible miss: maximum",
        "impulse: median",
        "maximum guaranteed miss Φ",
        "body radius, 50 m",
        "times of the schedule",
    ]


def test_long_flights_and_schedules_have_a_logarithmic_time_axis(records: list[Record]) -> None:
    assert not Clock.of(records).counts_down
    record = scheduled(records[0])
    assert Clock.of([record]).counts_down
    clock, arrival_s = Clock.of([record]), record.scenario.nominal_arrival_s
    assert clock.text(record, arrival_s + 1e-12) == "at the nominal arrival"
    assert clock.text(record, arrival_s + 2.0) == "2 s after the nominal arrival"
    assert Clock.of([replace(records[0], steps=2 * records[0].steps)]).counts_down
    figure = draw_process([record])
    assert {axes.get_xscale() for axes in figure.axes} == {"log"}
    assert legend(figure)[-1] == "last image 4 s, cut-off 10 s"
    titles = [axes.get_title() for axes in draw_sets([record], (90.0,)).axes]
    assert titles == [
        f"({k}) random noise, range sensor\nalong {axis}, 10 s before arrival"
        for k, axis in zip("ab", AXES, strict=True)
    ]
    times = [duration_text(each) for each in (0.5, 59.0, 60.0, 100.0, 150.0, 14400.0, 86400.0)]
    assert times == ["0.5 s", "59 s", "1 min", "100 s", "2.5 min", "4 h", "1 d"]


def test_the_axis_of_impulses_extends_to_small_impulses(records: list[Record]) -> None:
    scenario = records[0].scenario
    strong = replace(scenario, thruster=replace(scenario.thruster, max_impulse_m_s=1e3))
    axes = draw_process([replace(records[0], scenario=strong)]).axes[4]
    maximum = max(step.impulse_m_s for step in records[0].steps)
    assert axes.get_ylim() == pytest.approx((-1.2 * maximum, 1.35 * maximum))
    assert axes.texts[0].get_text() == "maximum impulse ±1000 m/s, beyond the axis"


def test_process_of_a_long_flight_shows_errors_moduli_and_the_true_miss(records: list[Record]) -> None:
    record = scheduled(records[0])
    figure = draw_process([record])
    errors, rates, _, misses = (figure.axes[2 * row] for row in range(4))
    seen = [step for step in record.steps if "angle" in step.axes["y"].measured]
    dots = next(line for line in errors.lines if line.get_marker() == ".")
    expected = [1e6 * (step.axes["y"].measured["angle"] - step.axes["y"].true_angle_rad) for step in seen]
    np.testing.assert_allclose(np.asarray(dots.get_ydata(), dtype=np.float64), expected)
    sensor = record.scenario.set_model.angle_sensor
    (band,) = errors.collections
    ends = np.asarray(band.get_paths()[0].vertices)[:, 1]
    assert ends.max() == pytest.approx(1e6 * max(float(sensor.error_bound(step.true_range_m)) for step in seen))
    assert np.abs(expected).max() <= ends.max()
    true = np.asarray(rates.lines[1].get_ydata(), dtype=np.float64)
    np.testing.assert_allclose(true, [1e6 * abs(step.axes["y"].true_rate_rad_s) for step in record.steps])
    true = np.asarray(misses.lines[3].get_ydata(), dtype=np.float64)
    np.testing.assert_allclose(true, true_predicted_misses(record)["y"])
    assert "bound of the angle error" in legend(figure)


def test_sections_that_coincide_are_two_and_small_angles_are_in_microradians() -> None:
    record = fly_one(load_scenario("haiv-2013"))
    early, late = (planes_at([record], [""], time_s, 5) for time_s in (3600.0, 7150.0))
    assert [len(plane.chosen) for plane in early] == [2, 2]
    assert [len(plane.chosen) for plane in late] == [5, 5]
    assert [plane.chosen[0].range_m for plane in early] == [early[0].step.sections[0].range_m] * 2
    figure = draw_sets([record], (3600.0,))
    axes = figure.axes[0]
    assert axes.get_ylabel() == "line-of-sight angle α along y, µrad"
    figure.draw_without_rendering()
    low, high = (1e3 * limit for limit in axes.get_ylim())
    ticks = [float(tick.get_text().replace("\N{MINUS SIGN}", "-")) for tick in axes.get_yticklabels()]
    assert sum(low <= tick <= high for tick in ticks) >= 2


@pytest.mark.parametrize("order", [1, -1])
def test_beside_a_record_in_space_one_of_a_plane_has_labels_on_all_its_axes(records: list[Record], order: int) -> None:
    planar = fly_one(load_scenario("asteroid-1997"), seed=1)
    figure = draw_sets([records[0], planar][::order])
    assert all(axes.yaxis.label.get_visible() and " along " in axes.get_ylabel() for axes in figure.axes)
    assert all(axes.yaxis.get_tick_params()["labelleft"] for axes in figure.axes)
    assert all("\nalong " in axes.get_title() for axes in figure.axes)
