"""Figures of engagements in space."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from experiments.interception.figures.b_plane import Cloud, cloud, draw_b_plane
from experiments.interception.scenario_file import load_scenario
from sim import Results, simulate
from tests.experiments.command_line import Command

RUNS = 12


@pytest.fixture(scope="module")
def results() -> Results:
    return simulate(load_scenario("asteroid-1997-space"), RUNS)


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


@pytest.mark.parametrize("name", ["experiment", "compare"])
@pytest.mark.parametrize("scenario", ["asteroid-1997", "asteroid-1997-space"])
def test_commands_write_a_b_plane_of_each_noise_in_space_only(
    infoset: Command, tmp_path: Path, name: str, scenario: str
) -> None:
    infoset(
        name, scenario, "--runs", "2", "--out", tmp_path, *(("--strategies", "patient") if name == "compare" else ())
    )
    written = {file.stem for file in tmp_path.glob("figure-b-plane-*.png")}
    assert written == ({"figure-b-plane-random", "figure-b-plane-game"} if scenario.endswith("space") else set())
