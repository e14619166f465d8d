"""Figures of engagements in a plane: what is drawn are the numbers of the results."""

from __future__ import annotations

from dataclasses import replace

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon

from infoset.arrays import Floats
from infoset.experiments.common.figure_style import CURVE_LOOKS, figure_bytes, new_figure
from infoset.experiments.interception.course import Courses
from infoset.experiments.interception.figures.commands import draw_experiment
from infoset.experiments.interception.figures.comparison import draw_comparison
from infoset.experiments.interception.figures.distributions import (
    Sample,
    draw_distributions,
    draw_samples,
)
from infoset.experiments.interception.figures.process import draw_process
from infoset.experiments.interception.figures.sets import (
    MEASUREMENT_MARK,
    TRUTH_MARK,
    choose_sections,
    draw_sets,
)
from infoset.experiments.interception.figures.shared import draw_levels
from infoset.experiments.interception.scenario_file import load_scenario
from infoset.experiments.interception.study import Comparison, Curve, curve_scenarios
from infoset.guidance import NoiseKind, TieRule
from infoset.sim import Body, Record, Results, fly_one, simulate

UNITS = (", m", ", s", ", m/s", ", mrad", ", µrad/s", "share of runs")
RUNS = 6


@pytest.fixture(scope="module")
def records() -> list[Record]:
    scenario = load_scenario("asteroid-1997-single")
    return [fly_one(replace(scenario, noise=kind)) for kind in (NoiseKind.RANDOM, NoiseKind.GAME)]


@pytest.fixture(scope="module")
def curves() -> list[Curve]:
    return [
        Curve(number, flown.noise.value, flown.range_sensor is not None, simulate(flown, runs=RUNS))
        for number, flown in curve_scenarios(load_scenario("asteroid-1997"))
    ]


def points(axes: Axes, label: str) -> Floats:
    """Return the points of the only line with a label."""
    (found,) = [each for each in axes.lines if each.get_label() == label]
    return data(found)


def data(line: Line2D) -> Floats:
    return np.asarray(line.get_xydata(), dtype=np.float64)


def legend(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def assert_units(figure: Figure) -> None:
    for axes in figure.axes:
        for label in (axes.get_xlabel(), axes.get_ylabel()):
            assert not label or label.splitlines()[0].endswith(UNITS), label


def test_process_has_four_rows_of_equal_limits_and_units(records: list[Record]) -> None:
    figure = draw_process(records)
    assert_units(figure)
    assert [axes.get_xlabel() for axes in figure.axes] == ["", "", "", "time t, s"] * 2
    for first, second in zip(figure.axes[:4], figure.axes[4:], strict=True):
        assert first.get_ylim() == second.get_ylim()
    low, high = figure.axes[2].get_ylim()
    limit = records[0].scenario.thruster.max_impulse_m_s
    assert low < -limit < limit < high
    for column, record in zip((figure.axes[:4], figure.axes[4:]), records, strict=True):
        np.testing.assert_allclose(
            points(column[0], "true value")[:, 1], 1e3 * record.true_angle_rad[:, 0]
        )
        measured = 1e3 * record.measured["angle"][record.measures("angle"), 0]
        np.testing.assert_allclose(points(column[0], "measured angle")[:, 1], measured)
        (bars,) = column[2].collections
        heights = np.array([np.asarray(path.vertices)[1, 1] for path in bars.get_paths()])
        given = record.impulse_m_s[:, 0]
        misses = record.predicted_miss_m[:, 0]
        np.testing.assert_allclose(heights, given[given != 0.0])
        misses = misses[np.isfinite(misses[:, 0])]
        lower, upper = (data(line)[:, 1] for line in column[3].lines[1:])
        np.testing.assert_array_equal(np.stack([lower, upper], axis=1), misses)


def test_sets_show_truth_measurement_and_sections(records: list[Record]) -> None:
    figure = draw_sets(records)
    assert len(figure.axes) == 6
    assert_units(figure)
    for position, axes in enumerate(figure.axes):
        record = records[position % 2]
        step = (1, 8, 16)[position // 2]
        true = np.array(
            [[record.true_rate_rad_s[step, 0] * 1e6, record.true_angle_rad[step, 0] * 1e3]]
        )
        np.testing.assert_allclose(points(axes, TRUTH_MARK), true)
        np.testing.assert_allclose(
            points(axes, MEASUREMENT_MARK), [[true[0, 0], record.measured["angle"][step, 0] * 1e3]]
        )
        chosen = choose_sections(record.sections[step], 5)
        outlines = [
            np.asarray(patch.get_xy()) for patch in axes.patches if isinstance(patch, Polygon)
        ]
        for outline, section in zip(outlines, chosen, strict=True):
            np.testing.assert_allclose(outline[:-1], section.omega_alpha[0].polygon() * [1e6, 1e3])
        name = (
            f"({'abcdef'[position]}) {('random', 'game')[position % 2]} noise,\n"
            f"t = {record.time_s[step]:g} s"
        )
        assert (
            axes.get_title("left")
            == f"{name}, {chosen[0].range_m / 1e3:.0f} to {chosen[-1].range_m / 1e3:.0f} km"
        )
    for first, second in zip(figure.axes[::2], figure.axes[1::2], strict=True):
        assert (first.get_xlim(), first.get_ylim()) == (second.get_xlim(), second.get_ylim())
    assert len(legend(figure)) == 4


def test_chosen_sections_keep_the_ends(records: list[Record]) -> None:
    sections = records[0].sections[0]
    for most in (2, 3, 5, 100):
        chosen = choose_sections(sections, most)
        assert (chosen[0], chosen[-1]) == (sections[0], sections[-1])
        assert len(chosen) == min(most, len(sections))


def test_distributions_draw_the_curves_and_their_bands(curves: list[Curve]) -> None:
    figure = draw_distributions(curves, numbered=True)
    assert_units(figure)
    half = np.sqrt(np.log(40.0) / (2.0 * RUNS))  # Dvoretzky-Kiefer-Wolfowitz
    share = np.arange(1, RUNS + 1) / RUNS
    for axes, name in zip(figure.axes, ("miss_m", "impulse_m_s"), strict=True):
        bands = [
            np.asarray(band.get_paths()[0].vertices)
            for band in axes.collections
            if band.get_paths()
        ]
        for curve, band in zip(curves, bands, strict=True):
            sample = np.sort(getattr(curve.results, name))
            label = (
                f"{curve.number}  {curve.noise} noise, {'with' if curve.range_sensor else 'no'} "
                "range sensor"
            )
            drawn = points(axes, f"{label}, {RUNS} runs")
            np.testing.assert_array_equal(drawn[1:-1], np.column_stack([sample, share]))
            for edge in (np.maximum(share - half, 0.0), np.minimum(share + half, 1.0)):
                for corner in zip(sample, edge, strict=True):
                    assert np.isclose(band, corner).all(axis=1).any()


def test_the_runs_that_the_paper_prints_are_marks() -> None:
    scenario = load_scenario("asteroid-1997")
    curve = Curve(1, "random", False, simulate(scenario, 2))
    courses = Courses(scenario, 2)
    figure = next(draw_experiment(scenario, [curve], [courses]))
    label = "printed: one run from z = \N{MINUS SIGN}8 km, random noise"
    left, right = figure.axes
    assert (points(left, label)[0, 0], data(right.lines[-1])[0, 0]) == (4.3, 244.7)
    assert right.get_xlim()[1] > 244.7
    other = next(draw_experiment(replace(scenario, name="mine"), [curve], [courses]))
    assert label not in legend(other)


@pytest.mark.parametrize(
    ("radius_m", "scale"), [(None, "linear"), (400.0, "linear"), (20.0, "log")]
)
def test_the_axis_of_the_miss_shows_the_radius_of_the_body(
    radius_m: float | None, scale: str
) -> None:
    misses = np.geomspace(500.0, 2000.0, 40)
    body = None if radius_m is None else Body(radius_m)
    figure = draw_samples([Sample("wide", CURVE_LOOKS[1], misses, misses)], body)
    assert figure.axes[0].get_xscale() == scale
    low, high = figure.axes[0].get_xlim()
    assert low < (radius_m or 500.0) < high


@pytest.mark.parametrize(
    ("body", "name"),
    [
        (Body(700.0), "body radius, 700 m"),
        (Body(700.0, aim_m=(300.0, 400.0)), "circle inside the body, 200 m"),
        (Body(semi_axes_m=(900.0, 600.0)), "circle inside the body, 600 m"),
    ],
)
def test_radius_that_is_not_that_of_a_sphere_around_the_aim_point_is_named(
    body: Body, name: str
) -> None:
    misses = np.geomspace(500.0, 2000.0, 40)
    figure = draw_samples([Sample("wide", CURVE_LOOKS[1], misses, misses)], body)
    assert f"{name}: a smaller miss is a hit" in legend(figure)

    axes = new_figure(80.0).subplots()
    draw_levels(axes, None, body)
    (line,) = axes.lines
    assert line.get_label() == name


def test_a_printed_run_beyond_all_misses_is_within_the_axis() -> None:
    few = np.array([1.1, 1.3])
    printed = Sample("printed", {"color": "k"}, np.array([34.0]), np.array([522.0]))
    figure = draw_samples([Sample("few", CURVE_LOOKS[1], few, few)], None, [printed])
    for axes, value in zip(figure.axes, (34.0, 522.0), strict=True):
        assert axes.get_xlim()[1] > value


@pytest.mark.parametrize(
    ("runs", "marks"),
    [(2, []), (10, ["10 to 90 %"]), (100, ["10 to 90 %", "99 %"])],
    ids=["2", "10", "100"],
)
def test_a_comparison_draws_only_quantiles_that_the_runs_show(runs: int, marks: list[str]) -> None:
    results = simulate(load_scenario("asteroid-1997-single"), 2).take(np.arange(runs) % 2)
    games: dict[TieRule | None, Results] = dict.fromkeys(TieRule, results)
    compared = [Comparison("a", "random", {None: results}), Comparison("a", "game", games)]
    figure = draw_comparison(compared)
    assert set(legend(figure)) == {f"histogram of {runs} runs", "median", *marks, "worst run"}
    assert points(figure.axes[0], "median")[0, 0] == np.median(results.miss_m)
    assert points(figure.axes[3], "worst run")[0, 0] == results.impulse_m_s.max()


@pytest.mark.thorough
def test_files_are_written_twice_the_same_and_nothing_global_is_touched(
    curves: list[Curve],
) -> None:
    before = dict(mpl.rcParams)
    first, second = (figure_bytes(draw_distributions(curves)) for _ in range(2))
    assert first == second
    (_, pdf), (_, png) = first
    assert (pdf[:4], png[:4]) == (b"%PDF", b"\x89PNG")
    assert dict(mpl.rcParams) == before
