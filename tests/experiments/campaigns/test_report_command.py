"""`infoset report` of a campaign, its tables and its figures."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from scipy.stats import pearsonr

from infoset.experiments.campaigns import sample_rows
from infoset.experiments.campaigns.campaign_figures import draw_convergence, draw_dispersion
from infoset.experiments.campaigns.run_tables import WORST, correlations, summary, worst_runs
from infoset.experiments.interception.figures.distributions import MAX_POINTS
from infoset.experiments.interception.scenario_file import load_scenario
from infoset.guidance import NoiseKind
from infoset.sim import Campaign, CampaignNoise, Scenario, simulate
from infoset.sim.storage import CampaignFolder
from tests.experiments.command_line import Command

FIGURES = [
    f"figure-{name}.{kind}"
    for name in ("convergence", "dispersion", "distributions")
    for kind in ("pdf", "png")
]


@pytest.fixture(scope="module")
def folder(brief: Scenario, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A campaign that no command has flown: manifest and shards only."""
    path = tmp_path_factory.mktemp("campaign") / "runs"
    Campaign(brief, 300, path, noise=CampaignNoise.MIXED).run()
    return path


@pytest.mark.usefixtures("unrendered")
def test_report_of_a_campaign_reads_only_its_files(
    infoset: Command, brief: Scenario, folder: Path, tmp_path: Path
) -> None:
    before = sorted(each.name for each in folder.iterdir())
    code, out, _ = infoset("report", folder, "--out", tmp_path / "report", "--csv", "table.csv")
    assert code == 0
    assert sorted(each.name for each in folder.iterdir()) == before
    assert sorted(each.name for each in (tmp_path / "report").iterdir()) == [
        *FIGURES,
        "report.json",
        "scenario.toml",
    ]
    assert load_scenario(tmp_path / "report" / "scenario.toml") == brief
    found = json.loads((tmp_path / "report" / "report.json").read_text())
    table = pd.read_csv(tmp_path / "table.csv")
    for first, (sample, row) in enumerate(
        zip(found["samples"], table.to_dict("records"), strict=True)
    ):
        flown = simulate(replace(brief, noise=NoiseKind(sample["noise"])), range(first, 300, 2))
        assert (sample["noise"], sample["runs"]) == (row["noise"], 150)
        assert sample["miss_m_p90"] == row["miss_m_p90"] == np.quantile(flown.miss_m, 0.9)
        assert sample["phi_known"] == flown.phi_held.count()
        assert sample["impulse_m_s_max"] == flown.impulse_m_s.max()
    worst = found["worst"]
    assert [row["miss_m"] for row in worst] == sorted(
        (row["miss_m"] for row in worst), reverse=True
    )
    scenario = tmp_path / "report" / "scenario.toml"
    for row in worst:
        assert (
            row["replay"]
            == f"infoset engage {scenario} --noise {row['noise']} --seed 0 --run {row['run']}"
        )
        assert row["replay"] in out
    # The note about a missing scenario file: --out has written the file.
    assert "which these commands need" not in out
    assert "which these commands need; --out writes one" in infoset("report", folder)[1]
    for title in (
        "correlation of the miss with",
        "Fisher's z",
        "|start_z_m|",
        "spearman",
        "p99.9",
        "95 % CI",
    ):
        assert title in out


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (["missing"], "is no folder"),
        (["."], "contains no campaign"),
        (["empty"], "contains no runs yet"),
        (["broken"], "is not a readable manifest"),
        (["runs", "--require", "miss_m p90<10"], "--require: is only for a sweep"),
    ],
)
def test_report_of_a_wrong_folder_or_requirement_is_refused(
    arguments: list[str], part: str, infoset: Command, folder: Path, tmp_path: Path
) -> None:
    (tmp_path / "runs").symlink_to(folder)
    for name, manifest in (("empty", (folder / "manifest.json").read_text()), ("broken", "{]")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "manifest.json").write_text(manifest)
    assert part in infoset.refused("report", "--out", "report", *arguments)
    assert not (tmp_path / "report").exists()


@pytest.mark.usefixtures("unrendered")
@pytest.mark.parametrize("bytes_at_once", [1, 300 * 20])
def test_report_does_not_depend_on_the_columns_read_together(
    bytes_at_once: int, infoset: Command, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    together = infoset("report", folder, "--json", "-")
    monkeypatch.setattr(sample_rows, "PASS_BYTES", bytes_at_once)
    assert infoset("report", folder, "--json", "-") == together


def test_report_reads_only_columns_within_the_memory_limit(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stored = CampaignFolder.read(folder)
    read: list[list[str]] = []
    read_chunks = stored.read_chunks

    def recorded(
        chunks: Iterable[tuple[int, Sequence[int]]], columns: Sequence[str] | None = None
    ) -> pd.DataFrame:
        assert columns is not None
        read.append([*columns])
        return read_chunks(chunks, columns)

    monkeypatch.setattr(stored, "read_chunks", recorded)
    monkeypatch.setattr(sample_rows, "PASS_BYTES", 300 * 16)
    summary(stored)
    correlations(stored)
    steps = [columns for columns in read if "outcome" not in columns]
    assert all(columns[0] == "noise" and len(columns) <= 3 for columns in steps)


def test_worst_runs_have_the_largest_misses_of_all_runs_also_with_equal_misses(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stored = CampaignFolder.read(folder)
    read_chunks = stored.read_chunks

    def rounded(
        chunks: Iterable[tuple[int, Sequence[int]]], columns: Sequence[str] | None = None
    ) -> pd.DataFrame:
        runs = read_chunks(chunks, columns)
        return runs.assign(miss_m=runs["miss_m"].round(-1))

    monkeypatch.setattr(stored, "read_chunks", rounded)
    found = worst_runs(stored, Path("scenario.toml"))
    whole = stored.runs()
    # Equal misses are in the order of the runs.
    expected = whole.sort_values("miss_m", ascending=False, kind="stable").head(WORST)
    assert whole["miss_m"].nunique() < WORST
    assert found["run"].tolist() == expected["run"].tolist()
    assert found["impulse_m_s"].tolist() == expected["impulse_m_s"].tolist()


PLANE = ("start_z_m", "start_x_m", "start_vz_m_s", "start_vx_m_s")


def made_runs(noise: str, size: int) -> pd.DataFrame:
    rng = np.random.default_rng([size, noise == "game"])
    start = {name: rng.uniform(-900.0, 900.0, size) for name in PLANE}
    drawn = {"miss_m": rng.exponential(size=size), "impulse_m_s": rng.normal(100.0, 5.0, size)}
    return pd.DataFrame({"cell": 0, "noise": noise, **start, **drawn})


def correlated(runs: pd.DataFrame) -> dict[str, dict[str, Any]]:
    """Return the correlations of runs of random noise by component."""
    folder = SimpleNamespace(
        manifest=SimpleNamespace(
            noise=SimpleNamespace(kinds=[NoiseKind.RANDOM]),
            scenario=SimpleNamespace(is_spatial=False),
        ),
        finished_runs=len(runs),
        stored_chunks=lambda: [[(0, range(len(runs)))]],
        read_chunks=lambda _, columns: runs.reindex(columns=columns),
    )
    rows = correlations(cast(CampaignFolder, folder)).to_dict("records")
    return {row["component"]: row for row in rows}


def test_correlations_equal_the_definitions_of_pearson_and_spearman() -> None:
    rising = np.arange(50.0)
    start = {
        "start_z_m": rising - 20.0,
        "start_x_m": rising**3,
        "start_vz_m_s": -rising,
        "start_vx_m_s": np.ones(50),
    }
    found = correlated(made_runs("random", 50).assign(miss_m=rising, **start))
    assert [*found] == [*PLANE, "|start_z_m|", "|start_vz_m_s|"]
    assert [found["start_z_m"][kind] for kind in ("pearson", "spearman")] == pytest.approx(
        [1.0, 1.0]
    )
    assert found["start_x_m"]["spearman"] == pytest.approx(1.0)
    assert found["start_x_m"]["pearson"] == pytest.approx(np.corrcoef(rising, rising**3)[0, 1])
    assert found["start_vz_m_s"]["pearson"] == pytest.approx(-1.0)
    assert found["|start_vz_m_s|"]["pearson"] == pytest.approx(1.0)
    assert np.isnan(
        [found["start_vx_m_s"][kind] for kind in ("pearson", "spearman", "pearson_lower")]
    ).all()


def test_correlations_have_confidence_intervals() -> None:
    runs = made_runs("random", 30)
    found = correlated(runs)["start_z_m"]
    interval = pearsonr(runs["start_z_m"], runs["miss_m"]).confidence_interval()
    assert (found["pearson_lower"], found["pearson_upper"]) == pytest.approx(
        (interval.low, interval.high)
    )
    # Fieller, Hartley and Pearson (1957): the variance of the z of Spearman's coefficient is 1.06 /
    # (n - 3).
    z = np.arctanh(found["spearman"]) + np.array([-1.0, 1.0]) * 1.959963984540054 * np.sqrt(
        1.06 / 27.0
    )
    assert (found["spearman_lower"], found["spearman_upper"]) == pytest.approx(tuple(np.tanh(z)))
    few = correlated(made_runs("random", 3))["start_z_m"]
    assert np.isnan([few["pearson_lower"], few["spearman_upper"]]).all()


def titles(figure: Figure) -> list[str]:
    return [axes.get_title(loc="left") for axes in figure.axes]


@pytest.mark.parametrize("size", [1, 30, 20_000])
def test_figures_of_few_runs_and_of_many(size: int) -> None:
    both = {noise: made_runs(noise, size) for noise in ("random", "game")}
    figure = draw_convergence(both)
    figure.draw_without_rendering()
    assert titles(figure) == [
        "(a) random noise",
        "(b) random noise",
        "(c) game noise",
        "(d) game noise",
    ]
    shown = [text.get_text() for text in figure.legends[0].get_texts()]
    assert shown == [
        name for name, needed in (("p50", 2), ("p90", 10), ("p99", 100)) if size >= needed
    ]
    assert ("too few runs for" in figure.legends[0].get_title().get_text()) == (size < 100)
    figure = draw_dispersion(both)
    figure.draw_without_rendering()
    assert [axes.get_xlabel() for axes in figure.axes[:4]] == [
        *("initial $z$, km", "initial $x$, km", "initial $V_z$, m/s", "initial $V_x$, m/s")
    ]
    drawn = figure.axes[0].get_lines()
    assert max(len(np.asarray(line.get_xdata())) for line in drawn) <= MAX_POINTS
    assert len(drawn) == (3 if size >= 200 else 1)
