from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from numpy.typing import NDArray

from experiments.common.figure_style import figure_bytes, width_mm
from experiments.interception.comparison import Comparison
from experiments.interception.curves import Curve, curve_scenarios
from experiments.interception.figures.comparison import draw_comparison
from experiments.interception.figures.distributions import axis_limit, draw_distributions
from experiments.interception.figures.process import draw_process
from experiments.interception.figures.sets import MEASUREMENT_MARK, TRUTH_MARK, choose_sections, draw_sets
from experiments.interception.scenario_file import load_scenario
from guidance import NoiseKind, TieRule
from infoset import ConvexPolygons
from sim import Record, Results, StepRecord, fly_one, simulate
from tests.experiments.campaigns.figure_room import need_room

UNITS = (", m", ", s", ", m/s", ", mrad", ", µrad/s", "(share of runs)")
RUNS = 6


@pytest.fixture(scope="module")
def records() -> list[Record]:
    scenario = load_scenario("asteroid-1997-single")
    return [fly_one(replace(scenario, noise=kind)) for kind in (NoiseKind.RANDOM, NoiseKind.GAME)]


@pytest.fixture(scope="module")
def curves() -> list[Curve]:
    return [
        Curve(number, flown.noise, flown.range_sensor is not None, simulate(flown, runs=RUNS))
        for number, flown in curve_scenarios(load_scenario("asteroid-1997"))
    ]


def shortened(record: Record, vertices: Sequence[tuple[float, float]]) -> Record:
    """A record of one step with one section, a polygon of (V, z)."""
    step = record.steps[0]
    section = replace(step.sections[0], polygon=ConvexPolygons(np.array(vertices), len(vertices)))
    return replace(record, steps=(replace(step, sections=(section,)),))


def along_z(step: StepRecord, **values: Any) -> StepRecord:
    """A step of a plane with some values of its axis replaced."""
    return replace(step, axes={"z": replace(step.axes["z"], **values)})


def line(axes: Axes, label: str) -> Line2D:
    (found,) = [each for each in axes.lines if each.get_label() == label]
    return found


def place(mark: Line2D) -> NDArray[np.float64]:
    return np.asarray(mark.get_xydata(), dtype=np.float64).ravel()


def assert_units(figure: Figure) -> None:
    for axes in figure.axes:
        for label in (axes.get_xlabel(), axes.get_ylabel()):
            assert not label or label.splitlines()[0].endswith(UNITS), label
        assert axes.get_ylabel()


def test_process_has_four_rows_a_record_with_units(records: list[Record]) -> None:
    figure = draw_process(records)
    assert len(figure.axes) == 8
    assert_units(figure)
    bottom = min(axes.get_position().y0 for axes in figure.axes)
    assert all(axes.get_xlabel() == "time t, s" for axes in figure.axes if axes.get_position().y0 == bottom)
    titles = [axes.get_title() for axes in figure.axes if axes.get_title()]
    assert titles[0].startswith("(a) random noise\nmiss ")
    assert titles[1].startswith("(b) game noise\nmiss ")
    assert f"{records[1].result.impulse_m_s[0]:.1f} m/s" in titles[1]


def test_process_rows_share_limits_and_hold_the_impulse_limit(records: list[Record]) -> None:
    figure = draw_process(records)
    for first, second in zip(figure.axes[::2], figure.axes[1::2], strict=True):
        assert first.get_ylim() == second.get_ylim()
    low, high = figure.axes[4].get_ylim()
    limit = records[0].scenario.thruster.max_impulse_m_s
    assert low < -limit < limit < high


def test_process_says_where_a_curve_leaves_the_axes(records: list[Record]) -> None:
    texts = [text.get_text() for text in draw_process(records).axes[3].texts]
    last = records[1].steps[-1]
    assert texts == [f"reaches −{abs(last.true_rate_rad_s) * 1e3:.3g} mrad/s at {last.time_s:g} s"]


def test_process_gives_a_fast_rate_in_whole_units_and_breaks_a_long_title(records: list[Record]) -> None:
    last = along_z(records[1].steps[-1], true_rate_rad_s=-2.074)
    text = "a description so long that it would run over the edge of the page"
    scenario = replace(records[1].scenario, name=text)
    fast = replace(records[1], scenario=scenario, steps=(*records[1].steps[:-1], last))
    figure = draw_process([records[1], fast])
    assert [each.get_text() for each in figure.axes[3].texts] == [f"reaches −2.07 rad/s at {last.time_s:g} s"]
    title = figure.axes[1].get_title().splitlines()
    assert text in " ".join(title)
    assert max(map(len, title)) <= 45
    assert "(linear within ±10 m)" in figure.axes[6].get_ylabel()


def test_same_noise_is_told_apart_by_the_run(records: list[Record]) -> None:
    figure = draw_process([records[0], replace(records[0], run=7)])
    titles = [axes.get_title().splitlines()[0] for axes in figure.axes if axes.get_title()]
    assert titles == ["(a) random noise, run 0", "(b) random noise, run 7"]


def test_sets_show_truth_measurement_and_labelled_sections(records: list[Record]) -> None:
    figure = draw_sets(records)
    assert len(figure.axes) == 6
    assert_units(figure)
    assert all(axes.get_xlabel() for axes in figure.axes)
    for position, axes in enumerate(figure.axes):
        step = records[position % 2].steps[(1, 8, 16)[position // 2]]
        truth, measurement = line(axes, TRUTH_MARK), line(axes, MEASUREMENT_MARK)
        assert (truth.get_marker(), measurement.get_marker()) == ("x", "s")
        np.testing.assert_allclose(place(truth), (step.true_rate_rad_s * 1e6, step.true_angle_rad * 1e3))
        np.testing.assert_allclose(place(measurement), (step.true_rate_rad_s * 1e6, step.measured["angle"] * 1e3))
        assert sum(isinstance(patch, Polygon) for patch in axes.patches) == 5
        labels = {text.get_text() for text in axes.texts}
        assert {f"{step.sections[end].range_m / 1e3:.0f} km" for end in (0, -1)} <= labels
        assert len(labels) == 5
        assert axes.get_title().startswith(f"({'abcdef'[position]}) {('random', 'game')[position % 2]} noise, t = ")
        assert axes.get_title().endswith(f"t = {step.time_s:g} s")
        column = sorted(axes.texts, key=lambda text: float(text.get_position()[1]))
        ranges = [int(text.get_text().split()[0]) for text in column]
        assert ranges in (sorted(ranges), sorted(ranges, reverse=True))
    for first, second in zip(figure.axes[::2], figure.axes[1::2], strict=True):
        assert first.get_xlim() == second.get_xlim()
        assert first.get_ylim() == second.get_ylim()


def test_a_figure_has_no_legend_of_what_it_does_not_show(records: list[Record]) -> None:
    """Without an angle at the drawn times there is neither a square nor a shaded band, and the legend has none."""

    def legend(record: Record) -> list[str]:
        return [text.get_text() for text in draw_sets([record]).legends[0].get_texts()]

    blind = replace(records[0], steps=tuple(along_z(step, measured={}) for step in records[0].steps))
    assert legend(blind) == [TRUTH_MARK, "section of the set, with its range in km"]
    assert len(legend(records[0])) == 4


def test_a_miss_of_kilometres_leaves_the_whole_flight_readable(records: list[Record]) -> None:
    """A line of sight that turns by 80 mrad at the end does not set the limits, and no note hides the curve."""
    steps = records[0].steps
    angles = 1.6e-3 + 2e-4 * np.sin(np.arange(len(steps)) / 20.0)
    far = np.array([step.true_range_m for step in steps])
    angles += 4e3 / np.maximum(far, 1e3) * (far < 0.2 * far[0])
    record = replace(
        records[0],
        steps=tuple(
            along_z(step, true_angle_rad=angle, measured={"angle": angle + 1e-4})
            for step, angle in zip(steps, angles.tolist(), strict=True)
        ),
    )
    axes = draw_process([record]).axes[0]
    low, high = axes.get_ylim()
    assert high - low < 4.0 * 0.5
    (note,) = axes.texts
    assert note.get_text().startswith("reaches ")
    right, up = note.get_position()
    left = right - 1.7 * len(note.get_text()) / width_mm(axes)
    across = np.interp([step.time_s for step in steps], axes.get_xlim(), (0.0, 1.0))
    heights = (angles * 1e3 - low) / (high - low)
    under = (across > left) & (across < right) & (np.abs(heights - up) < 0.1)
    assert not under.any()


@pytest.mark.parametrize(
    ("runs", "marks"), [(2, []), (10, ["10 to 90 %"]), (100, ["10 to 90 %", "99 %"])], ids=["2", "10", "100"]
)
def test_a_comparison_draws_only_quantiles_that_the_runs_show(runs: int, marks: list[str]) -> None:
    results = simulate(load_scenario("asteroid-1997-single"), 2).take(np.arange(runs) % 2)
    games: dict[TieRule | None, Results] = dict.fromkeys(TieRule, results)
    compared = [Comparison("a", NoiseKind.RANDOM, {None: results}), Comparison("a", NoiseKind.GAME, games)]
    texts = [text.get_text() for text in draw_comparison(compared).legends[0].get_texts()]
    assert texts == [f"histogram of {runs} runs", "median", *marks, "worst run"]


def test_sets_beyond_the_flight_show_the_last_step(records: list[Record]) -> None:
    (axes,) = draw_sets(records[1:], times_s=(500.0,)).axes
    assert axes.get_title() == f"game noise, t = {records[1].steps[-1].time_s:g} s"
    assert [text.get_text() for text in axes.texts] == ["no section is left"]


def test_chosen_sections_keep_the_ends(records: list[Record]) -> None:
    sections = records[0].steps[0].sections
    for most in (2, 3, 5, 100):
        chosen = choose_sections(sections, most)
        assert chosen[0] is sections[0]
        assert chosen[-1] is sections[-1]
        assert len(chosen) == min(most, len(sections))
    assert choose_sections(sections, 1) == [sections[len(sections) // 2]]


@pytest.mark.parametrize("vertices", [[(0.0, -8000.0)], [(0.0, -8000.0), (50.0, -8000.0)]], ids=["point", "segment"])
def test_degenerate_section_of_a_single_step_is_visible(
    records: list[Record], vertices: list[tuple[float, float]], tmp_path: Path
) -> None:
    record = shortened(records[0], vertices)
    figure = draw_sets([record], times_s=(0.5,))
    (axes,) = figure.axes
    (drawn,) = [each for each in axes.lines if each.get_label() not in (TRUTH_MARK, MEASUREMENT_MARK)]
    assert (drawn.get_marker(), len(np.asarray(drawn.get_xdata()))) == ("o", len(vertices))
    assert figure_bytes(draw_process([record]) if len(vertices) == 1 else figure)


def test_distributions_draw_the_band_of_the_half_width(curves: list[Curve]) -> None:
    figure = draw_distributions(curves)
    assert len(figure.axes) == 2
    assert_units(figure)
    half = np.sqrt(np.log(40.0) / (2.0 * RUNS))  # Dvoretzky-Kiefer-Wolfowitz
    for axes, name in zip(figure.axes, ("miss_m", "impulse_m_s"), strict=True):
        for curve in curves:
            sample = np.sort(getattr(curve.results, name))
            share = np.arange(1, RUNS + 1) / RUNS
            drawn = line(axes, f"curve {curve.number}").get_xydata()
            np.testing.assert_array_equal(np.asarray(drawn)[1:-1], np.column_stack([sample, share]))
            lower, upper = (
                np.asarray(each.get_xydata()) for each in axes.lines if each.get_label() == f"band {curve.number}"
            )
            for edge, expected in ((lower, np.maximum(share - half, 0.0)), (upper, np.minimum(share + half, 1.0))):
                np.testing.assert_array_equal(edge[:, 0], sample)
                free = np.isfinite(edge[:, 1])
                np.testing.assert_allclose(edge[free, 1], expected[free])
                np.testing.assert_array_equal(free, (expected > 0.0) & (expected < 1.0))
        assert {text.get_text() for text in axes.texts} == {"1", "2", "3", "4"}
    (legend,) = figure.legends
    assert "95 % confidence band" in " ".join(text.get_text() for text in legend.get_texts())


def test_both_panels_of_the_distributions_have_the_same_ticks(curves: list[Curve]) -> None:
    figure = draw_distributions(curves)
    need_room(figure)
    for axes in figure.axes:
        ticks = [tick for tick in axes.get_yticks() if -0.01 < tick < 1.01]
        np.testing.assert_allclose(ticks, [0.0, 0.2, 0.4, 0.6, 0.8, 1.0], atol=1e-12)
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert [name[0] for name in names if name[0].isdigit()] == [str(curve.number) for curve in curves]


def test_the_radius_of_the_body_is_a_line_with_a_label(curves: list[Curve]) -> None:
    inside = float(np.median(curves[0].results.miss_m))
    for radius, drawn, where in ((inside, 1, "a smaller miss is a hit"), (1e6, 0, "beyond the axis")):
        figure = draw_distributions(curves, radius_m=radius)
        miss, impulse = figure.axes
        lines = [each for each in miss.lines if each.get_label() == "_radius"]
        assert [float(np.asarray(each.get_xdata())[0]) for each in lines] == [radius] * drawn
        assert not [each for each in impulse.lines if each.get_label() == "_radius"]
        (legend,) = figure.legends
        assert legend.get_texts()[-1].get_text() == f"body radius, {radius:g} m: {where}"
    figure = draw_distributions(curves)
    assert "radius" not in " ".join(text.get_text() for legend in figure.legends for text in legend.get_texts())


def test_a_few_huge_misses_leave_the_axis_legible(curves: list[Curve]) -> None:
    miss = curves[1].results.miss_m.copy()
    miss[0] = 8e4
    lost = replace(curves[1], results=replace(curves[1].results, miss_m=miss))
    (axes, _) = draw_distributions([curves[0], lost, *curves[2:]]).axes
    assert axes.get_xlim()[1] < 1e5
    assert axis_limit([np.append(np.linspace(1.0, 2.0, 40), 8e4)]) == 2.0
    wide = replace(curves[0], results=made_up(curves[0], 40))
    (axes, _) = draw_distributions([wide]).axes
    assert axes.get_xlim()[1] < 3.0
    assert axes.get_xlabel() == "miss, m\nruns beyond the axis: 1 of 40 of curve 1"


def test_curves_decades_apart_get_a_logarithmic_axis_and_keep_their_numbers(curves: list[Curve]) -> None:
    far = [
        replace(curve, results=replace(curve.results, miss_m=curve.results.miss_m + 5e3)) if curve.number > 2 else curve
        for curve in curves
    ]
    (miss, impulse) = draw_distributions(far).axes
    assert (miss.get_xscale(), impulse.get_xscale()) == ("log", "linear")
    for axes in (miss, impulse):
        assert {text.get_text() for text in axes.texts} == {"1", "2", "3", "4"}
        assert all(0.0 < text.get_position()[0] < 1.0 for text in axes.texts)
    assert miss.get_xlim()[1] > max(float(curve.results.miss_m.max()) for curve in far)


def test_a_curve_on_the_edge_keeps_its_number(curves: list[Curve]) -> None:
    still = replace(curves[0], results=replace(curves[0].results, miss_m=np.zeros(RUNS)))
    (axes, _) = draw_distributions([still, curves[1]]).axes
    assert {text.get_text() for text in axes.texts} == {"1", "2"}


def made_up(curve: Curve, runs: int) -> Results:
    """Results with made-up misses, one of them huge."""
    miss = np.linspace(1.0, 2.0, runs)
    miss[3] = 8e4
    alike = curve.results.take(np.zeros(runs, dtype=int))
    return replace(alike, runs=np.arange(runs), miss_m=miss, impulse_m_s=np.linspace(100.0, 200.0, runs))


def test_equal_values_are_drawn(curves: list[Curve]) -> None:
    results = replace(curves[0].results, miss_m=np.zeros(RUNS), impulse_m_s=np.full(RUNS, 5.0))
    figure = draw_distributions([replace(curves[0], results=results)])
    assert [kind for kind, content in figure_bytes(figure) if content] == ["pdf", "png"]
    for axes, value in zip(figure.axes, (0.0, 5.0), strict=False):
        minimum, maximum = axes.get_xlim()
        assert minimum <= value <= maximum
        assert minimum < maximum


def test_files_are_written_twice_the_same(curves: list[Curve]) -> None:
    first, second = (figure_bytes(draw_distributions(curves)) for _ in range(2))
    assert first == second
    (_, pdf), (_, png) = first
    assert pdf.startswith(b"%PDF")
    assert png.startswith(b"\x89PNG")


def test_nothing_global_is_touched(records: list[Record]) -> None:
    import matplotlib as mpl

    before = dict(mpl.rcParams)
    draw_process(records)
    assert dict(mpl.rcParams) == before


def test_nothing_to_draw_is_an_error(records: list[Record]) -> None:
    with pytest.raises(ValueError, match="at least one record"):
        draw_process([])
    with pytest.raises(ValueError, match="at least one record"):
        draw_sets([])
    with pytest.raises(ValueError, match="at least one section"):
        draw_sets(records, sections=0)
    with pytest.raises(ValueError, match="at least one curve"):
        draw_distributions([])
