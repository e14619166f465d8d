from __future__ import annotations

import hashlib
import json
import os
import pickle
import shlex
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest

from infoset import Model
from infoset.experiments.campaigns import cluster
from infoset.experiments.common.errors import InputError
from infoset.experiments.interception.scenario_file import load_scenario, with_model
from infoset.experiments.interception.strategies import load_strategy
from infoset.guidance import NoiseKind
from infoset.sim import Campaign, CampaignNoise, Scenario, fly_one
from infoset.sim.storage import CampaignFolder
from infoset.sim.storage.codec import fingerprint
from infoset.sim.versions import versions

Infoset = Callable[..., tuple[int, str, str]]
needs_kill = pytest.mark.skipif(os.name != "posix", reason="there is no kill -9")


def stored_runs(folder: Path) -> pd.DataFrame:
    """The runs of a complete campaign, without temporary files."""
    folder_read = CampaignFolder.read(folder)
    assert folder_read.complete
    assert not list(folder.rglob("*.tmp"))
    return folder_read.runs()


def test_a_campaign_into_a_folder(
    infoset: Infoset, brief: Scenario, file: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "runs"
    asked = (
        "campaign",
        file,
        "--runs",
        150,
        "--noise",
        "mixed",
        "--seed",
        4,
        "--model",
        "paper",
        "--out",
        folder,
    )
    code, out, err = infoset(*asked)
    assert code == 0
    assert err.endswith(f"wrote shards, scenario.toml, summary.json in {folder}\n")
    assert {each.name for each in folder.iterdir()} == {
        *(".lock", "manifest.json", "scenario.toml", "shards", "summary.json")
    }
    runs = stored_runs(folder)
    assert runs.equals(
        Campaign(brief, 150, tmp_path / "api", seed=4, noise=CampaignNoise.MIXED)
        .run(workers=1)
        .runs()
    )
    assert load_scenario(folder / "scenario.toml") == brief
    found = json.loads((folder / "summary.json").read_text())
    assert found["versions"] == versions()
    assert (found["scenario"], found["scenario_hash"]) == ("brief", fingerprint(brief))
    assert (found["runs"], found["seed"], found["complete"]) == (150, 4, True)
    for sample in found["samples"]:
        own = sorted(runs["miss_m"][runs["noise"] == sample["noise"]])
        assert sample["runs"] == len(own) == 75
        assert sample["miss_m_max"] == own[-1]
        assert sample["miss_m_p50"] == own[37]
        assert sample["miss_m_p50_lower"] in own
        assert sample["miss_m_p99.9_upper"] is None
        assert (
            sum(sample[name] for name in ("arrived", "set_empty", "budget_spent", "diverged")) == 75
        )
    code, out, err = infoset(*asked, "--resume", "--json", "-")
    assert code == 0
    assert json.loads(out)["runs"] == 150
    assert "miss, m" not in err
    assert infoset(*asked, "--resume", "--quiet", "--csv", "table.csv") == (0, "", "")
    assert pd.read_csv("table.csv")["miss_m_p50"].tolist() == [
        sample["miss_m_p50"] for sample in found["samples"]
    ]
    what = (
        f"<campaign of brief in {folder}: symmetric-miss, mixed noise, seed 4, 150 of 150 runs "
        "stored>"
    )
    assert repr(CampaignFolder.read(folder)) == what
    code, _, err = infoset(*asked)
    assert code == 2
    assert "contains a campaign already; continue it with --resume" in err
    code, _, err = infoset(*asked, "--resume", "--seed", 3)
    assert code == 2
    assert "  seed: 4 in the folder, 3 now" in err


def test_options_of_a_campaign_are_applied_to_its_engagements(
    infoset: Infoset, file: Path, tmp_path: Path
) -> None:
    options = (
        "--noise",
        "game",
        "--strategy",
        "patient",
        "--model",
        "guaranteed",
        "--set",
        "tie=lower",
    )
    asked = (
        "campaign",
        file,
        "--runs",
        8,
        "--out",
        tmp_path / "runs",
        "-q",
        "--no-range-sensor",
        *options,
    )
    assert infoset(*asked)[0] == 0
    runs = stored_runs(tmp_path / "runs")
    assert set(runs["noise"]) == {"game"}
    assert runs["guaranteed_miss_m"].notna().all()
    scenario = load_scenario(tmp_path / "runs" / "scenario.toml")
    assert (scenario.strategy, scenario.noise, scenario.tie.value) == (
        "patient",
        NoiseKind.GAME,
        "lower",
    )
    assert scenario.range_sensor is None
    assert runs["miss_m"][3] == fly_one(scenario, 3).result.miss_m[0]
    found = json.loads((tmp_path / "runs" / "summary.json").read_text())
    assert found["samples"][0]["phi_held"] == found["samples"][0]["phi_known"] == 8


OWN = """
import numpy as np
class Half:
    share = 0.5
    def start(self, shape):
        return None
    def decide(self, situation, state):
        return self.share * np.ones_like(situation.last_impulse_m_s)
"""


def test_a_strategy_of_a_file_in_threads_and_processes(
    infoset: Infoset, file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "path", list(sys.path))
    (tmp_path / "halved.py").write_text(OWN)
    asked = ["campaign", file, "--runs", 12, "--chunk", 4, "--strategy", "halved.py:Half", "-q"]
    assert infoset(*asked, "--out", "threads") == (0, "", "")
    monkeypatch.setattr(cluster, "RUNS_OF_A_PROCESS", 6)
    assert infoset(*asked, "--out", "processes", "--workers", 2) == (0, "", "")
    assert stored_runs(Path("threads")).equals(stored_runs(Path("processes")))
    digest = hashlib.sha256(OWN.encode()).hexdigest()[:16]
    assert (
        CampaignFolder.read(Path("threads")).manifest.strategy == f"halved.py:Half sha256:{digest}"
    )
    worst = json.loads(infoset("report", "threads", "--json", "-")[1])["worst"][0]
    _, *arguments = shlex.split(worst["replay"])
    assert json.loads(infoset(*arguments, "--json", "-")[1])["miss_m"] == worst["miss_m"]
    (tmp_path / "halved.py").write_text(OWN.replace("0.5", "0.25"))
    pickled = pickle.dumps(load_strategy("halved.py:Half"))
    del sys.modules["halved"]
    with pytest.raises(InputError, match="has changed since the command started"):
        pickle.loads(pickled)
    del sys.modules["halved"]  # the next command reads the changed file, as in a new process
    code, _, err = infoset(*asked, "--out", "threads", "--resume")
    assert code == 2
    assert (
        f'strategy: "halved.py:Half sha256:{digest}" in the folder, "halved.py:Half sha256:' in err
    )


def test_campaign_with_until_stops_and_is_continued_by_a_stricter_rule(
    infoset: Infoset, file: Path, tmp_path: Path
) -> None:
    asked = (
        "campaign",
        file,
        "--runs",
        400,
        "--chunk",
        16,
        "--out",
        tmp_path / "runs",
        "--until",
        "miss_m p50 ci<1",
    )
    code, out, _ = infoset(*asked)
    assert code == 0
    runs = CampaignFolder.read(tmp_path / "runs").finished_runs
    assert 16 <= runs < 400
    assert f"{runs} runs of 400, stopped by the rule miss_m p50 ci<1" in out
    code, out, _ = infoset(*asked[:-1], "miss_m p50 ci<1e-9", "--resume")
    assert code == 0
    assert CampaignFolder.read(tmp_path / "runs").finished_runs == 400
    assert (
        "the rule miss_m p50 ci<1e-09 is not met; continue with --resume and a greater --runs"
        in out
    )


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (["--strategy", "patent"], "did you mean patient?"),
        (["--until", "miss_m"], "--until: must be a quantity, a quantile and a width"),
        (["--dask", "localhost"], "--dask: no Dask scheduler answers at localhost"),
        (["--dask", "tcp://h:1", "--workers", 2], "cannot be combined; give only one of them"),
        (["--out", "brief.toml"], "brief.toml: is a file, not a folder"),
        (["--out", "."], "is not empty, and contains no campaign"),
        (["--out", "/dev/null/x"], "/dev/null/x"),
    ],
)
def test_wrong_option_is_refused_before_the_work(
    arguments: list[object],
    part: str,
    infoset: Infoset,
    file: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(
        "infoset.sim.parallel.simulate_task", lambda *_: pytest.fail("began to work")
    )
    code, out, err = infoset("campaign", file, "--runs", 10, "--out", "runs", *arguments)
    assert (code, out) == (2, "")
    assert err.count("error: ") == 1
    assert part in err
    assert [each.name for each in tmp_path.iterdir()] == ["brief.toml"]


@pytest.mark.parametrize(
    ("library", "extra"),
    [("pyarrow", "campaign"), ("pandas", "campaign"), ("distributed", "distributed")],
)
def test_missing_library_is_refused_with_the_name_of_its_extra(
    library: str, extra: str, infoset: Infoset, file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from infoset.sim import storage

    monkeypatch.setitem(sys.modules, library, None)
    for name in [
        each
        for each in sys.modules
        if each.startswith(("infoset.experiments.campaigns.", "infoset.sim.storage.tables"))
    ]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.delattr(storage, "tables", raising=False)
    options = ("--dask", "tcp://127.0.0.1:1") if library == "distributed" else ()
    code, out, err = infoset("campaign", file, "--runs", 8, "--out", "runs", *options)
    assert (code, out) == (2, "")
    assert (
        err.splitlines()[-1]
        == f"error: {library} is not installed: install infoset with the extra [{extra}]"
    )


def command(file: Path, folder: Path, runs: int, *options: object) -> list[str]:
    """The command that begins or resumes a campaign in a process."""
    asked = (
        "campaign",
        file,
        "--runs",
        runs,
        "--chunk",
        8,
        "--noise",
        "mixed",
        "--out",
        folder,
        "--resume",
        "-q",
    )
    return [sys.executable, "-m", "infoset", *map(str, (*asked, *options))]


def wait_for_shards(process: subprocess.Popen[bytes], folder: Path, number: int) -> None:
    """Wait until a campaign has stored more files."""
    deadline = time.monotonic() + 120.0
    while len(list(folder.glob("shards/*.parquet"))) < number:
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.005)


@pytest.mark.thorough
@needs_kill
@pytest.mark.skipif(
    not Path("/proc/self/stat").exists(), reason="this system does not list its processes"
)
def test_processes_give_the_same_bits_and_end_with_their_parent(
    brief: Scenario, file: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "runs"
    asked = command(file, folder, 4000, "--workers", 2)
    with subprocess.Popen(asked) as process:
        wait_for_shards(process, folder, 10)
        children = {child for child in processes() if parent(child) == process.pid}
        assert len(children) >= 2
        process.kill()
    deadline = time.monotonic() + 10.0
    while children & processes() and time.monotonic() < deadline:
        time.sleep(0.1)
    assert not children & processes()
    assert 80 <= CampaignFolder.read(folder).finished_runs < 4000
    subprocess.run(asked, check=True)
    expected = Campaign(
        with_model(brief, Model.GUARANTEED), 4000, tmp_path / "whole", noise=CampaignNoise.MIXED
    ).run()
    assert stored_runs(folder).equals(expected.runs())


def processes() -> set[int]:
    return {int(each.name) for each in Path("/proc").iterdir() if each.name.isdigit()}


def parent(process: int) -> int:
    """The parent of a process; 0 if it has ended."""
    try:
        return int(
            (Path("/proc") / str(process) / "stat").read_text().rpartition(")")[2].split()[1]
        )
    except OSError:
        return 0
