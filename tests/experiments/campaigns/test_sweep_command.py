"""`infoset sweep` and `infoset report` of a sweep."""

from __future__ import annotations

import itertools
import json
import shutil
from pathlib import Path

import pandas as pd
import pyarrow.parquet as pq
import pytest

from infoset.experiments.campaigns.sweep_axes import sweep_axes, sweep_cells
from infoset.experiments.interception.scenario_file import load_scenario
from infoset.sim import Campaign, Scenario, estimate_hits
from infoset.sim.requirement import share_interval
from infoset.sim.storage import CampaignFolder, read_manifest
from tests.experiments.command_line import Command

pytestmark = pytest.mark.usefixtures("unrendered")

FILES = [
    *(
        ".lock",
        "figure-sweep.pdf",
        "figure-sweep.png",
        "manifest.json",
        "scenario.toml",
        "shards",
        "summary.json",
    ),
    "sweep.parquet",
]
TWO = "angle_sensor.error_at_zero_range_rad=1e-4:4e-4:3,thruster.max_impulse_m_s=log:2:8:2"


@pytest.fixture(scope="module")
def swept(brief: Scenario, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sweep that no command has flown: manifest and shards only."""
    folder = tmp_path_factory.mktemp("sweep") / "two"
    axes = sweep_axes(TWO, brief)
    Campaign(brief, 20, folder, axes=axes, cells=sweep_cells(brief, axes), guarantee=False).run()
    return folder


@pytest.mark.usefixtures("rendered")
def test_a_sweep_of_two_keys(infoset: Command, file: Path, tmp_path: Path) -> None:
    folder = tmp_path / "sweep"
    code, out, err = infoset(
        "sweep", file, "--model", "paper", "--vary", TWO, "--runs", 30, "--out", folder
    )
    assert code == 0
    assert f"in {folder}" in err
    assert sorted(each.name for each in folder.iterdir()) == FILES
    rows = pd.read_parquet(folder / "sweep.parquet")
    keys = ["angle_sensor.error_at_zero_range_rad", "thruster.max_impulse_m_s"]
    found = json.loads((folder / "summary.json").read_text())
    assert (found["kind"], found["runs"], [each["unit"] for each in found["axes"]]) == (
        "sweep",
        180,
        ["rad", "m/s"],
    )
    combinations = list(itertools.product((1e-4, 2.5e-4, 4e-4), (2.0, 8.0)))
    assert [tuple(row) for row in rows[keys].to_numpy()] == combinations
    assert [tuple(cell[key] for key in keys) for cell in found["cells"]] == combinations
    assert "random noise: miss_m p99<10 is met in" in out


def test_a_sweep_of_one_key_mixed_and_resumed(infoset: Command, file: Path, tmp_path: Path) -> None:
    asked = (
        "sweep",
        file,
        "--vary",
        "thruster.max_impulse_m_s=2:8:4",
        "--runs",
        20,
        "--noise",
        "mixed",
    )
    code, out, _ = infoset(*asked, "--out", tmp_path / "a", "--require", "miss_m p90<3")
    assert code == 0
    assert (tmp_path / "a" / "figure-sweep-game.png").is_file()
    table = pq.read_table(tmp_path / "a" / "sweep.parquet")
    assert table.column("noise").to_pylist() == ["random", "game"] * 4
    assert set(table.column("runs").to_pylist()) == {10}
    before = (tmp_path / "a" / "sweep.parquet").read_bytes()
    for victim in list((tmp_path / "a" / "shards").glob("*.parquet"))[1:3]:
        victim.unlink()
    code, out, _ = infoset("report", tmp_path / "a")
    assert out.count("random noise: miss_m p90<3 is met in") == 1
    assert out.count("miss_m p90<3 is met against this adversary in") == 1
    again = infoset(*asked, "--out", tmp_path / "a", "--require", "miss_m p90<3", "--resume", "-q")
    assert again == (0, "", "")
    assert (tmp_path / "a" / "sweep.parquet").read_bytes() == before
    code, _, err = infoset(
        *asked[:3], "thruster.max_impulse_m_s=2:9:4", *asked[4:], "--out", "a", "--resume"
    )
    assert code == 2
    assert "axes: " in err


def test_report_of_a_sweep_reads_only_its_files(
    infoset: Command, swept: Path, tmp_path: Path
) -> None:
    out_folder = tmp_path / "report"
    report = (
        "report",
        swept,
        "--out",
        out_folder,
        "--require",
        "impulse_m_s p50<60",
        "--csv",
        "table.csv",
    )
    code, out, _ = infoset(*report)
    assert code == 0
    assert "brief, with range sensor, model paper, strategy symmetric-miss, seed 0\n" in out
    names = [
        "figure-sweep.pdf",
        "figure-sweep.png",
        "report.json",
        "scenario.toml",
        "sweep.parquet",
    ]
    assert sorted(each.name for each in out_folder.iterdir()) == names
    rows = pd.read_parquet(out_folder / "sweep.parquet")
    pd.testing.assert_frame_equal(pd.read_csv(tmp_path / "table.csv"), rows, check_dtype=False)
    cells = json.loads((out_folder / "report.json").read_text())["cells"]
    assert [cell["required_value"] for cell in cells] == rows["required_value"].tolist()
    assert rows["required_value"].tolist() == rows["impulse_m_s_p50"].tolist()
    assert load_scenario(out_folder / "scenario.toml").name == "brief"


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (["--vary", "thruster.budget=1:2:2"], "did you mean thruster.budget_m_s?"),
        (
            ["--vary", "thruster.max_impulse_m_s=0.01:5:3"],
            "brief with thruster.max_impulse_m_s = 0.01",
        ),
        (["--require", "miss_m 10"], "--require: must be hit>=SHARE, no-CAUSE>=SHARE or QUANTITY"),
        (["--require", "hit>=0.95"], "has no [body] with a radius; give a bound of the miss"),
        (["--max-runs", 30], "--max-runs is the limit of --until; add --until decided"),
        (
            ["--until", "decided", "--max-runs", 9],
            "--max-runs: must be at least --runs, 10, found 9",
        ),
    ],
)
def test_wrong_option_is_refused_before_the_work(
    arguments: list[str],
    part: str,
    infoset: Command,
    file: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("infoset.sim.Campaign.run", lambda *_, **__: pytest.fail("began to work"))
    given = {"--vary": TWO, "--runs": 10, "--out": "sweep"} | dict(
        zip(arguments[::2], arguments[1::2], strict=True)
    )
    assert part in infoset.refused(
        "sweep", file, *[part for pair in given.items() for part in pair]
    )
    assert [each.name for each in tmp_path.iterdir()] == ["brief.toml"]


def test_runs_are_added_until_each_cell_is_decided(
    infoset: Command, file: Path, tmp_path: Path
) -> None:
    key = "angle_sensor.error_at_zero_range_rad"
    asked = (
        "sweep",
        file,
        "--vary",
        f"{key}=1e-5:3e-4:4",
        "--require",
        "miss_m p80<3",
        "--out",
        tmp_path / "sweep",
    )
    assert infoset(*asked, "--runs", 10)[0] == 0
    code, out, _ = infoset(
        *asked, "--runs", 10, "--until", "decided", "--max-runs", 300, "--resume"
    )
    assert code == 0
    assert (
        "the decision in each cell has a confidence of at least 95 % although runs were added;"
        in out
    )
    summary = json.loads((tmp_path / "sweep" / "summary.json").read_text())
    assert (summary["complete"], summary["until"], summary["require"]) == (
        True,
        "miss_m p80<3",
        "miss_m p80<3",
    )
    runs = [cell["runs"] for cell in summary["cells"]]
    assert min(runs) == 50
    assert sum(runs) == summary["runs"] == summary["wanted_runs"]
    assert all(
        cell["requirement"] != "undecided" or cell["runs"] == 300 for cell in summary["cells"]
    )
    # The report uses the requirement of the sweep, and the test that allows for the added runs.
    report = infoset.json("report", tmp_path / "sweep")
    assert report["require"] == "miss_m p80<3"
    assert report["cells"] == summary["cells"]


@pytest.mark.parametrize("until", [(), ("--until", "decided", "--max-runs", 60)])
def test_bound_of_the_guarantee_is_not_met_by_runs_without_guarantee(
    until: tuple[object, ...], infoset: Command, file: Path, tmp_path: Path
) -> None:
    """The sets of most runs become empty: the others alone have bounds, which all meet the
    requirement.
    """
    moving = ("--set", "target.manoeuvre=bang-bang", "--set", "target.acceleration_m_s2=1")
    asked = (
        "sweep",
        file,
        *moving,
        "--vary",
        "target.acceleration_m_s2=1.8:4:2",
        "--runs",
        40,
        *until,
    )
    summary = infoset.json(*asked, "--require", "guaranteed_miss_m p50<1e9", "--out", "sweep")
    cells = summary["cells"]
    assert [cell["requirement"] for cell in cells] == ["not-met"] * 2
    known = [cell["required_known"] for cell in cells]
    assert known == [cell["phi_known"] for cell in cells]
    _, out, _ = infoset("report", tmp_path / "sweep")
    assert f"{sum(known)} of {summary['runs']} runs have a value of guaranteed_miss_m" in out
    # The quantiles of so few values are not shown, although the number of runs would show them.
    assert 0 < known[0] < 10
    assert cells[0]["guaranteed_miss_m_p90"] is None
    assert cells[0]["miss_m_p90"] is not None


def test_needed_runs_are_the_runs_of_both_noises(infoset: Command, file: Path) -> None:
    asked = (
        "sweep",
        file,
        "--set",
        "body.radius_m=5",
        "--vary",
        "angle_sensor.scale=0.5:1.125:2",
        "--noise",
        "mixed",
    )
    summary = infoset.json(*asked, "--runs", 40, "--out", "sweep")
    assert summary["confidence_holds"]["requirement"] == "a fixed number of runs"
    assert [(cell["runs"], cell["runs_needed"]) for cell in summary["cells"][:2]] == [
        (20, 210),
        (20, 210),
    ]


@pytest.mark.thorough
def test_sweep_with_added_runs_is_judged_as_watched(
    infoset: Command, file: Path, tmp_path: Path
) -> None:
    asked = (
        "sweep",
        file,
        "--set",
        "body.radius_m=8",
        "--vary",
        "angle_sensor.scale=0.5:3:3",
        "--out",
        "sweep",
    )
    assert infoset(*asked, "--runs", 60)[0] == 0
    # Runs that are missing, and a repeated command, add no runs.
    next((tmp_path / "sweep" / "shards").glob("*.parquet")).unlink()
    assert infoset(*asked, "--runs", 60, "--resume")[0] == 0
    assert not read_manifest(tmp_path / "sweep").is_watched
    code, out, _ = infoset(*asked, "--runs", 100, "--resume")
    assert code == 0
    assert (
        "the decision in each cell has a confidence of at least 95 % although runs were added"
        in out
    )
    assert read_manifest(tmp_path / "sweep").is_watched
    summary = json.loads((tmp_path / "sweep" / "summary.json").read_text())
    fixed = "a fixed number of runs"
    assert summary["confidence_holds"] == {
        "requirement": "any number of runs",
        "hit": fixed,
        "quantiles": fixed,
    }
    for cell in summary["cells"]:
        lower, upper = share_interval(cell["hits"], 100)
        # The first run that decides is final: its bound is an end of the interval.
        assert cell["required_lower"] == max(lower, 0.95 if cell["requirement"] == "met" else 0.0)
        assert cell["required_upper"] == min(
            upper, 0.95 if cell["requirement"] == "not-met" else 1.0
        )
    # A sweep that was watched once stays so.
    assert (
        infoset(*asked, "--runs", 100, "--resume", "--until", "decided", "--max-runs", 150)[0] == 0
    )
    assert infoset(*asked, "--runs", 150, "--resume")[0] == 0
    assert read_manifest(tmp_path / "sweep").until is None
    assert read_manifest(tmp_path / "sweep").is_watched


def test_a_required_probability_of_a_hit(infoset: Command, file: Path, tmp_path: Path) -> None:
    asked = (
        "sweep",
        file,
        "--set",
        "body.radius_m=8",
        "--vary",
        "angle_sensor.scale=0.5:3:3",
        "--runs",
        40,
    )
    summary = infoset.json(*asked, "--out", tmp_path / "sweep")
    assert summary["require"] == "hit>=0.95"
    runs = CampaignFolder.read(tmp_path / "sweep").runs(["cell", "miss_m"])
    for cell in summary["cells"]:
        estimate = estimate_hits(
            int((runs.loc[runs["cell"] == cell["cell"], "miss_m"] <= 8.0).sum()), 40
        )
        shown = (cell["hits"], cell["hit_probability"], cell["hit_lower"], cell["hit_upper"])
        assert shown == (estimate.hits, estimate.probability, estimate.lower, estimate.upper)
        expected = (
            "met" if estimate.lower >= 0.95 else "not-met" if estimate.upper < 0.95 else "undecided"
        )
        assert cell["requirement"] == expected
        assert (cell["required_lower"], cell["required_upper"]) == (estimate.lower, estimate.upper)
    assert (
        infoset.json("report", tmp_path / "sweep", "--require", "hit > 0.5")["require"]
        == "hit>=0.5"
    )


def test_report_of_an_unfinished_sweep_has_its_stored_cells(
    infoset: Command, swept: Path, tmp_path: Path
) -> None:
    shutil.copytree(swept, tmp_path / "two")
    for victim in sorted((tmp_path / "two" / "shards").glob("*.parquet"))[2:]:
        victim.unlink()
    code, out, err = infoset(
        "report", tmp_path / "two", "--out", tmp_path / "report", "--json", "-"
    )
    assert code == 0
    found = json.loads(out)
    assert (found["runs"], found["wanted_runs"], found["complete"]) == (40, 120, False)
    assert "40 of 120 runs are stored" in err
    assert [cell["runs"] for cell in found["cells"]] == [20, 20, 0, 0, 0, 0]
    assert found["cells"][5]["requirement"] is None
    assert pq.read_table(tmp_path / "report" / "sweep.parquet").column("miss_m_p50").null_count == 4
