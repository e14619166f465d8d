from __future__ import annotations

import contextlib
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.figure import Figure
from scipy.stats import pearsonr, spearmanr

from experiments.campaigns.campaign_columns import START, CampaignColumns, correlations
from experiments.campaigns.campaign_figures import draw_campaign_distributions, draw_convergence, draw_dispersion
from experiments.common.screen import BeginProgress
from experiments.interception.figures.distributions import MAX_POINTS
from experiments.interception.scenario_file import load_scenario
from sim import Campaign, CampaignNoise, Scenario
from tests.experiments.campaigns.figure_room import need_room

Infoset = Callable[..., tuple[int, str, str]]
FIGURES = [
    f"figure-{name}.{kind}" for name in ("convergence", "dispersion", "distributions") for kind in ("pdf", "png")
]


@pytest.fixture(scope="module")
def folder(brief: Scenario, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A campaign that no command has flown: manifest and shards only."""
    path = tmp_path_factory.mktemp("campaign") / "runs"
    Campaign(brief, 300, path, noise=CampaignNoise.MIXED).run()
    return path


def test_a_report_of_files_alone_shows_its_progress(
    infoset: Infoset, brief: Scenario, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bars: list[str] = []

    @contextlib.contextmanager
    def recorded(quiet: bool) -> Iterator[BeginProgress]:
        def begin(name: str) -> Callable[[float], None]:
            bars.append(name)
            return lambda done: None

        yield begin

    monkeypatch.setattr("experiments.campaigns.run_report.progress_bar", recorded)
    before = sorted(each.name for each in folder.iterdir())
    code, out, err = infoset("report", folder, "--out", tmp_path / "report")
    assert code == 0
    assert bars == ["quantiles", "figures"]
    assert sorted(err.removeprefix("wrote ").removesuffix(f" in {tmp_path / 'report'}\n").split(", ")) == [
        *FIGURES,
        "report.json",
        "scenario.toml",
    ]
    assert sorted(each.name for each in folder.iterdir()) == before == [".lock", "manifest.json", "shards"]
    assert sorted(each.name for each in (tmp_path / "report").iterdir()) == [*FIGURES, "report.json", "scenario.toml"]
    assert load_scenario(tmp_path / "report" / "scenario.toml") == brief
    found = json.loads((tmp_path / "report" / "report.json").read_text())
    assert [each["noise"] for each in found["samples"]] == ["random", "game"]
    assert set(found["correlation_with_miss"]) == {"random", "game"}
    assert len(found["worst"]) == 10
    scenario = tmp_path / "report" / "scenario.toml"
    for each in found["worst"]:
        assert each["replay"] == f"infoset engage {scenario} --noise {each['noise']} --seed 0 --run {each['run']}"
        assert each["replay"] in out
    for title in (
        "correlation of the miss with",
        "150 runs of random noise",
        "Fisher's z",
        "|z_km|",
        "Spearman",
        "the worst runs, each",
        "p99.9",
        "95 % CI",
    ):
        assert title in out


def test_no_digit_is_cut_at_60_columns(infoset: Infoset, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "60")
    code, out, _ = infoset("report", folder)
    assert code == 0
    assert "…" not in out
    table = [line.split() for line in out.splitlines() if " p99 " in line]
    assert len(table) == 6  # three quantities, two noises
    assert all(float(row[row.index("p99") + 1]) > 0.0 for row in table)
    assert "150 runs are too few for p99.9; 1000 runs of each noise (--runs 2000) show all quantiles" in out


def test_a_report_writes_nothing_unasked(infoset: Infoset, folder: Path, tmp_path: Path) -> None:
    code, out, _ = infoset("report", folder)
    assert code == 0
    assert "--out writes one" in out
    assert list(tmp_path.iterdir()) == []
    assert infoset("report", folder, "-q") == (0, "", "")
    for option, value in (("--require", "miss_m p90<10"), ("--show", "miss_m p50")):
        code, out, err = infoset("report", folder, option, value)
        assert (code, out) == (2, "")
        assert f"{option}: is only for a sweep, and {folder} is a campaign; omit it" in err


@pytest.mark.parametrize(
    ("what", "parts"),
    [
        ("missing", ["there is no such folder"]),
        (".", ["contains no campaign and no sweep"]),
        ("empty", ["contains no runs yet"]),
        ("broken", ["is not a readable manifest"]),
    ],
)
def test_what_cannot_be_reported(what: str, parts: list[str], infoset: Infoset, folder: Path, tmp_path: Path) -> None:
    for name, manifest in (("empty", (folder / "manifest.json").read_text()), ("broken", "{]")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "manifest.json").write_text(manifest)
    code, out, err = infoset("report", what, "--out", "report")
    assert (code, out) == (2, "")
    assert err.count("error: ") == 1
    for part in parts:
        assert part in err
    assert not (tmp_path / "report").exists()


PLANE = ("z_km", "x_km", "vz_km_s", "vx_km_s")


def columns(noise: str, size: int, components: Sequence[str] = PLANE) -> CampaignColumns:
    rng = np.random.default_rng([size, noise == "game"])
    start = {name: rng.uniform(size=size) for name in components}
    return CampaignColumns(
        noise, False, rng.exponential(size=size), rng.normal(100.0, 5.0, size), np.zeros(0), start, False
    )


def test_the_axis_has_room_for_the_guarantee_or_says_what_is_beyond() -> None:
    drawn = replace(columns("random", 40), guaranteed_miss_m=np.linspace(10.0, 20.0, 40), guarantees=True)
    figure = draw_campaign_distributions([drawn])
    (miss, _) = figure.axes
    assert miss.get_xlim()[1] > 20.0
    assert miss.get_xlabel() == "miss, m"
    (legend,) = figure.legends
    assert "random noise: guaranteed miss" in [text.get_text() for text in legend.get_texts()]
    tailed = replace(drawn, guaranteed_miss_m=np.append(np.linspace(10.0, 20.0, 39), 9e4))
    (miss, _) = draw_campaign_distributions([tailed]).axes
    assert miss.get_xlabel().split("\n")[1:] == ["guaranteed misses beyond the axis: 1 of 40"]


def test_the_radius_of_the_body_is_a_line_with_a_label() -> None:
    figure = draw_campaign_distributions([replace(columns("random", 40), radius_m=0.5), columns("game", 40)])
    miss, impulse = figure.axes
    (line,) = [each for each in miss.lines if str(each.get_label()).startswith("body radius")]
    assert float(np.asarray(line.get_xdata())[0]) == 0.5
    assert not [each for each in impulse.lines if str(each.get_label()).startswith("body radius")]
    (legend,) = figure.legends
    assert legend.get_texts()[-1].get_text() == "body radius, 0.5 m: a smaller miss is a hit"


@pytest.mark.parametrize("size", [1, 2, 30, 20_000])
def test_figures_of_few_runs_and_of_many(size: int) -> None:
    both = [columns("random", size), columns("game", size)]
    left, right = draw_campaign_distributions(both).axes
    assert (left.get_xlabel().split("\n")[0], right.get_xlabel()) == ("miss, m", "impulse spent, m/s")
    assert max(len(np.asarray(line.get_xdata())) for line in left.get_lines()) <= MAX_POINTS + 2
    panels = draw_convergence(both).axes
    assert [each.get_title() for each in panels] == [
        "(a) miss, random noise",
        "(b) impulse spent, random noise",
        "(c) miss, game noise",
        "(d) impulse spent, game noise",
    ]
    assert all(each.get_xlabel() == "runs" for each in panels)
    clouds = draw_dispersion(both).axes
    assert [each.get_xlabel() for each in clouds[:4]] == [
        *("initial z, km", "initial x, km", "initial V$_z$, km/s", "initial V$_x$, km/s"),
    ]
    assert max(len(np.asarray(line.get_xdata())) for line in clouds[0].get_lines()) <= MAX_POINTS


def test_texts_of_figures_never_touch() -> None:
    both = [columns("random", 400), columns("game", 400)]
    far = replace(both[1], miss_m=np.append(both[1].miss_m[:-1], 1e5))
    for drawn in (both, [both[0], far]):
        for draw in (draw_campaign_distributions, draw_convergence, draw_dispersion):
            need_room(draw(drawn))
    slow = replace(
        both[0], start={name: 6.14 + 1e-4 * values / np.abs(values).max() for name, values in far.start.items()}
    )
    figure = draw_dispersion([slow])
    need_room(figure)
    assert figure.axes[3].get_xlabel() == "initial V$_x$, m/s"
    assert all(not axes.xaxis.get_offset_text().get_text() for axes in figure.axes)
    row = draw_dispersion([far]).axes[0]
    assert row.get_ylabel() == "miss, m\nruns beyond the axis: 1 of 400"


def test_in_space_the_components_along_y_are_shown_too() -> None:
    both = [columns("random", 400, START), columns("game", 400, START)]
    figure = draw_dispersion(both)
    need_room(figure)
    labels = [axes.get_xlabel() for axes in figure.axes]
    assert labels == 2 * [
        *("initial y, km", "initial z, km", "initial x, km"),
        *("initial V$_y$, km/s", "initial V$_z$, km/s", "initial V$_x$, km/s"),
    ]
    assert [bool(axes.get_ylabel()) for axes in figure.axes] == 4 * [True, False, False]
    moduli = ["|y_km|", "|z_km|", "|vy_km_s|", "|vz_km_s|"]
    assert [*correlations(both[0])] == [*START, *moduli]
    assert [*correlations(columns("random", 50))] == [*PLANE, "|z_km|", "|vz_km_s|"]


def test_correlations_by_hand() -> None:
    given = columns("random", 50)
    rising = np.arange(50.0)
    start = {"z_km": rising - 20.0, "x_km": rising**3, "vz_km_s": -rising, "vx_km_s": np.ones(50)}
    found = correlations(replace(given, miss_m=rising, start=start))
    assert [found["z_km"][kind] for kind in ("pearson", "spearman")] == pytest.approx([1.0, 1.0])
    assert found["x_km"]["spearman"] == pytest.approx(1.0)
    assert found["x_km"]["pearson"] == pytest.approx(np.corrcoef(rising, rising**3)[0, 1])
    assert found["vz_km_s"]["pearson"] == pytest.approx(-1.0)
    assert found["|vz_km_s|"]["pearson"] == pytest.approx(1.0)
    assert set(found["vx_km_s"].values()) == {None}


def test_correlations_have_confidence_intervals() -> None:
    given = columns("random", 30)
    found = correlations(given)["z_km"]
    pearson, lower, upper = found["pearson"], found["pearson_lower"], found["pearson_upper"]
    assert pearson is not None
    interval = pearsonr(given.start["z_km"], given.miss_m).confidence_interval()
    assert [lower, upper] == pytest.approx([interval.low, interval.high])
    assert found["spearman_lower"] is not None
    few = correlations(columns("random", 3))["z_km"]
    assert (few["pearson_lower"], few["spearman_upper"]) == (None, None)
    assert few["pearson"] is not None


def legend_texts(figure: Figure) -> list[str]:
    (legend,) = figure.legends
    return [legend.get_title().get_text(), *(text.get_text() for text in legend.get_texts())]


def test_figures_show_no_quantile_of_too_few_runs() -> None:
    figure = draw_convergence([columns("random", 30)])
    assert legend_texts(figure) == ["too few runs for p99", "p50 and its 95 % confidence interval", "p90"]
    figure = draw_convergence([columns("random", 500)])
    assert legend_texts(figure)[1:] == [f"{level} and its 95 % confidence interval" for level in ("p50", "p90", "p99")]
    p99 = max(figure.axes[0].get_lines(), key=lambda line: float(np.asarray(line.get_xdata())[0]))
    assert np.asarray(p99.get_xdata())[0] >= 100.0
    for size in (30, 60, 150, 4000):
        for axes in draw_convergence([columns("random", size)]).axes:
            low, high = axes.get_xlim()
            assert sum(low <= tick <= high for tick in axes.get_xticks()) >= 3


def test_the_dispersion_of_few_runs_is_visible() -> None:
    few, many = (draw_dispersion([columns("random", size)]) for size in (30, 2000))
    assert legend_texts(few) == ["too few runs for median and p90 (200 of a noise are needed)", "runs"]
    assert legend_texts(many)[1:] == ["runs", "median", "p90"]
    assert few.axes[0].get_lines()[0].get_markersize() > 5.0
    assert len(few.axes[0].get_lines()) == 1


@given(values=st.lists(st.tuples(st.integers(-4, 4), st.integers(-4, 4)), min_size=3, max_size=30))
@settings(deadline=None)
def test_spearmans_correlation_is_scipys_with_ties(values: list[tuple[int, int]]) -> None:
    one, other = (np.array(each, dtype=np.float64) for each in zip(*values, strict=True))
    given = columns("random", len(values))
    found = correlations(replace(given, miss_m=other, start={**given.start, "z_km": one}))["z_km"]["spearman"]
    if np.ptp(one) == 0.0 or np.ptp(other) == 0.0:
        assert found is None
    else:
        assert found == pytest.approx(spearmanr(one, other).statistic, abs=1e-12)
