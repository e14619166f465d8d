from __future__ import annotations

import hashlib
import json
import os
import pickle
import random
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from importlib.metadata import PackageNotFoundError
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import sim
from experiments.campaigns.flight import duration, size
from experiments.campaigns.samples import replay_line
from experiments.common.errors import InputError
from experiments.common.input_file import to_toml
from experiments.interception.scenario_file import load_scenario, with_model
from experiments.interception.strategies import load_strategy
from guidance import NoiseKind
from infoset import Model
from sim import Campaign, CampaignNoise, Scenario, fly_one
from sim.chunk import chunk_size
from sim.storage import CampaignFolder
from sim.storage.codec import fingerprint
from sim.versions import install_command, versions

Infoset = Callable[..., tuple[int, str, str]]
FILES = [".lock", "manifest.json", "scenario.toml", "shards", "summary.json"]


@pytest.fixture
def file(brief: Scenario, tmp_path: Path, infoset: Infoset) -> Path:
    path = tmp_path / "brief.toml"
    path.write_text(to_toml(brief))
    return path


def test_a_campaign_into_a_folder(infoset: Infoset, brief: Scenario, file: Path, tmp_path: Path) -> None:
    folder = tmp_path / "runs"
    code, out, err = infoset(
        *("campaign", file, "--runs", 150, "--noise", "mixed", "--seed", 4, "--model", "paper", "--out", folder)
    )
    assert (code, err) == (0, f"wrote shards, scenario.toml, summary.json in {folder}\n")
    assert sorted(each.name for each in folder.iterdir()) == FILES
    stored = CampaignFolder.read(folder)
    assert stored.complete
    assert stored.table().equals(
        Campaign(brief, 150, tmp_path / "api", seed=4, noise=CampaignNoise.MIXED).run(workers=1).table
    )
    assert load_scenario(folder / "scenario.toml") == brief
    found = json.loads((folder / "summary.json").read_text())
    assert found["versions"] == versions()
    assert (found["scenario"], found["scenario_hash"]) == ("brief", fingerprint(brief))
    assert (found["runs"], found["seed"], found["complete"], found["redone"]) == (150, 4, True, [])
    miss = stored.table(["miss_m", "noise"])
    for sample in found["samples"]:
        own = sorted(
            value
            for value, noise in zip(*(miss.column(name).to_pylist() for name in ("miss_m", "noise")), strict=True)
            if noise == sample["noise"]
        )
        assert sample["runs"] == len(own) == 75
        assert sample["miss_m"]["max"] == own[-1]
        assert sample["miss_m"]["p50"]["value"] == own[37]
        assert sample["miss_m"]["p50"]["lower"] in own
        assert sample["miss_m"]["p99.9"]["upper"] is None
        assert sum(sample["outcomes"].values()) == 75
        assert f"{sample['noise']} noise: true state inside the set at every step: {sample['truth_kept']} of 75" in out
    assert "miss, m" in out
    assert "impulse, m/s" in out


def test_nothing_but_json_on_stdout(infoset: Infoset, file: Path, tmp_path: Path) -> None:
    code, out, err = infoset("campaign", file, "--runs", 10, "--out", tmp_path / "runs", "--json", "-")
    assert code == 0
    assert json.loads(out)["runs"] == 10
    assert "miss, m" in err
    assert infoset("campaign", file, "--runs", 10, "--out", tmp_path / "quiet", "--quiet") == (0, "", "")


def test_a_stored_run_is_the_engagement_that_engage_flies(infoset: Infoset, file: Path, tmp_path: Path) -> None:
    folder = tmp_path / "runs with a space"
    assert infoset("campaign", file, "--runs", 40, "--noise", "mixed", "--out", folder, "-q")[0] == 0
    code, out, _ = infoset("report", folder, "--json", "-")
    assert code == 0
    worst = json.loads(out)["worst"]
    assert [each["miss_m"] for each in worst] == sorted((each["miss_m"] for each in worst), reverse=True)
    assert len(worst) == 10
    for each in worst[:3]:
        name, *arguments = shlex.split(each["replay"])
        assert name == "infoset"
        code, out, _ = infoset(*arguments, "--json", "-")
        flown = json.loads(out)
        assert (flown["run"], flown["noise"]) == (each["run"], each["noise"])
        assert (flown["miss_m"], flown["impulse_m_s"]) == (each["miss_m"], each["impulse_m_s"])


def test_noise_model_strategy_tie_and_meter_are_the_options(infoset: Infoset, file: Path, tmp_path: Path) -> None:
    options = (
        "--noise",
        "game",
        "--strategy",
        "patient",
        "--model",
        "guaranteed",
        "--tie",
        "lower",
        "--no-range-sensor",
    )
    assert infoset("campaign", file, "--runs", 8, "--out", tmp_path / "runs", "-q", *options)[0] == 0
    rows = CampaignFolder.read(tmp_path / "runs").table()
    assert set(rows.column("noise").to_pylist()) == {"game"}
    assert set(rows.column("tie").to_pylist()) == {"lower"}
    assert set(rows.column("range_sensor").to_pylist()) == {False}
    assert rows.column("guaranteed_miss_m").null_count == 0
    flown = load_scenario(tmp_path / "runs" / "scenario.toml")
    assert (flown.strategy, flown.noise) == ("patient", NoiseKind.GAME)
    assert rows.column("miss_m").to_pylist()[3] == float(fly_one(flown, 3).result.miss_m[0])
    found = json.loads((tmp_path / "runs" / "summary.json").read_text())
    assert found["samples"][0]["phi_held"] == found["samples"][0]["phi_known"] == 8


OWN = """
import numpy as np
class Half:
    share = 0.5
    def start(self, batch):
        return None
    def decide(self, situation, state):
        return self.share * np.ones(len(situation.budget_left_m_s))
"""


@pytest.mark.parametrize("command", [["campaign"], ["sweep", "--vary", "thruster.budget_m_s=100:200:2"]])
def test_a_strategy_of_a_file_in_threads_and_processes(
    command: list[str], infoset: Infoset, file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "path", list(sys.path))
    module = f"half_{command[0]}"
    (tmp_path / f"{module}.py").write_text(OWN)
    asked = [*command, file, "--runs", 12, "--chunk", 4, "--strategy", f"{module}.py:Half", "-q"]
    assert infoset(*asked, "--out", "threads") == (0, "", "")
    assert infoset(*asked, "--out", "processes", "--processes", 2 if command == ["campaign"] else 1) == (0, "", "")
    threads, processes = (CampaignFolder.read(tmp_path / name) for name in ("threads", "processes"))
    assert threads.table().equals(processes.table())
    digest = hashlib.sha256(OWN.encode()).hexdigest()[:16]
    assert threads.manifest.strategy == f"{module}.py:Half sha256:{digest}"
    if command == ["campaign"]:
        _, out, _ = infoset("report", "threads", "--json", "-")
        worst = json.loads(out)["worst"][0]
        _, *arguments = shlex.split(worst["replay"])
        assert json.loads(infoset(*arguments, "--json", "-")[1])["miss_m"] == worst["miss_m"]
    (tmp_path / f"{module}.py").write_text(OWN.replace("0.5", "0.25"))
    own = load_strategy(f"{module}.py:Half")
    pickled = pickle.dumps(own)
    del sys.modules[module]
    with pytest.raises(InputError, match="has changed since the command started"):
        pickle.loads(pickled)
    del sys.modules[module]  # the next command reads the changed file, as in a new process
    code, _, err = infoset(*asked, "--out", "threads", "--resume")
    assert code == 2
    here, now = (f'"{module}.py:Half sha256:{part}' for part in (f'{digest}" in the folder', ""))
    assert f"strategy: {here}, {now}" in err


def test_until_stops_and_goes_on(infoset: Infoset, file: Path, tmp_path: Path) -> None:
    asked = ("campaign", file, "--runs", 400, "--chunk", 16, "--out", tmp_path / "runs", "--until", "miss_m p50 ci<1")
    code, out, _ = infoset(*asked)
    assert code == 0
    stored = CampaignFolder.read(tmp_path / "runs")
    assert 16 <= stored.finished_runs < 400
    assert f"{stored.finished_runs} runs of 400, stopped by the rule miss_m p50 ci<1" in out
    report = infoset("report", tmp_path / "runs")[1]
    for text in (out, report):
        assert "computed with 95 % confidence for a fixed number of runs" in " ".join(text.split())
        assert "so their confidence is about 92 to 95 %" in " ".join(text.split())
    assert "95 % confidence limits" not in out
    assert infoset(*asked[:-1], "miss_m p50 ci<1e-9", "--resume")[0] == 0
    assert CampaignFolder.read(tmp_path / "runs").finished_runs == 400
    code, out, _ = infoset(*asked[:-1], "miss_m p50 ci<1e-9", "--resume")
    assert "the rule miss_m p50 ci<1e-09 is not met; continue with --resume and a greater --runs" in out


def test_damage_is_said_and_mended(infoset: Infoset, file: Path, tmp_path: Path) -> None:
    asked = ("campaign", file, "--runs", 48, "--chunk", 16, "--out", tmp_path / "runs")
    assert infoset(*asked, "-q")[0] == 0
    victim = sorted((tmp_path / "runs" / "shards").glob("*.parquet"))[1]
    victim.write_bytes(victim.read_bytes()[:500])
    code, _, err = infoset("report", tmp_path / "runs")
    assert code == 0
    assert f"{victim}: is truncated or changed" in err
    assert "32 of 48 runs are stored" in err
    code, _, err = infoset(*asked, "--resume")
    assert code == 0
    assert f"{victim}: is truncated or changed: the checksum of its 500 bytes" in err
    assert "simulated again" in err
    assert CampaignFolder.read(tmp_path / "runs").complete


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["--runs", 0], ["--runs", "must be from 1 to "]),
        (["--runs", -3], ["--runs", "must be from 1 to "]),
        (["--runs", 10**30], ["--runs", " to 10000000, found "]),
        (["--seed", -1], ["--seed"]),
        (["--chunk", 0], ["--chunk"]),
        (["--workers", 0], ["--workers: must be from 1 to 1024, found 0; for example --workers 4"]),
        (["--processes", 0], ["--processes: must be from 1 to 1024, found 0; for example --processes 4"]),
        (["--workers", 10**6], ["--workers", " to 1024, found "]),
        (["--noise", "gam"], ["--noise: there is no", "did you mean game? choose one of: random, game, mixed"]),
        (["--strategy", "patent"], ["did you mean patient?"]),
        (["--until", "miss p99 ci<1"], ["--until: there is no quantity miss"]),
        (
            ["--until", "miss_m"],
            ["--until: must be a quantity, a quantile and a width", 'for example "miss_m p99 ci<0.5"'],
        ),
        (["--dask", "localhost"], ["--dask: must be an address such as tcp://host:8786"]),
        (["--dask", "tcp://h:1", "--workers", 2], ["cannot be combined; give only one of them"]),
        (["--processes", 2, "--workers", 2], ["cannot be combined; give only one of them"]),
        (["--processes", 0], ["--processes", "must be from 1 to "]),
        (["--json", "missing/x.json"], ["there is no folder missing"]),
        (["--out", "brief.toml"], ["brief.toml: is a file, not a folder"]),
        (["--out", "."], ["is not empty, and contains no campaign"]),
        (["--out", ".", "--resume"], ["is not empty, and contains no campaign"]),
        (["--out", "/dev/null/x"], ["/dev/null/x"]),
        (["--out", "x" * 300], ["File name too long"]),
    ],
)
def test_what_is_wrong_is_said_before_the_work(
    arguments: list[object],
    parts: list[str],
    infoset: Infoset,
    file: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("sim.flights.fly_chunk", lambda *_: pytest.fail("began to work"))
    given = {"--runs": 10, "--out": "runs"}
    flags = [each for each in arguments if each == "--resume"]
    pairs = [each for each in arguments if each != "--resume"]
    given |= dict(zip(pairs[::2], pairs[1::2], strict=True))  # type: ignore[arg-type]
    code, out, err = infoset("campaign", file, *[part for pair in given.items() for part in pair], *flags)
    assert (code, out) == (2, "")
    assert err.count("error: ") == 1
    for part in parts:
        assert part in err
    assert [each.name for each in tmp_path.iterdir()] == ["brief.toml"]


def test_resuming_another_campaign_shows_the_difference(infoset: Infoset, file: Path, tmp_path: Path) -> None:
    asked = ("campaign", file, "--runs", 8, "--out", tmp_path / "runs", "-q")
    assert infoset(*asked)[0] == 0
    code, _, err = infoset(*asked)
    assert code == 2
    assert "contains a campaign already; continue it with --resume" in err
    code, _, err = infoset(*asked, "--resume", "--seed", 3, "--noise", "game")
    assert code == 2
    assert "  seed: 0 in the folder, 3 now" in err
    assert '  noise: "random" in the folder, "game" now' in err
    assert infoset(*asked, "--resume") == (0, "", "")


def test_without_the_extra_it_says_which(
    infoset: Infoset, file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    monkeypatch.delitem(sys.modules, "sim.storage.tables", raising=False)
    import sim.storage

    monkeypatch.delattr(sim.storage, "tables", raising=False)
    for command in (
        ["campaign", file, "--runs", 8, "--out", "runs"],
        ["sweep", file, "--vary", "thruster.budget_m_s=1:2:2", "--runs", 8, "--out", "runs"],
        ["report", "runs"],
    ):
        code, out, err = infoset(*command)
        assert (code, out) == (2, "")
        assert err == (
            f"error: campaigns are stored with pyarrow, which is not installed: {install_command('campaign')}\n"
        )
    monkeypatch.undo()


def test_without_dask_it_says_which_extra(infoset: Infoset, file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    code, _, err = infoset("campaign", file, "--runs", 8, "--out", "runs", "--dask", "tcp://127.0.0.1:1")
    assert code == 2
    assert f"not installed: {install_command('distributed')}" in err


@pytest.mark.parametrize(
    ("origin", "command"),
    [
        ('{"url": "file:///a%20b/clone", "dir_info": {"editable": true}}', 'pip install -e "/a b/clone[exact]"'),
        ('{"url": "file:///a%20b/clone", "dir_info": {}}', 'pip install "/a b/clone[exact]"'),
        ('{"url": "file:///a/infoset.whl", "archive_info": {}}', 'pip install "infoset[exact]"'),
        (None, 'pip install "infoset[exact]"'),
    ],
)
def test_the_command_for_an_extra(origin: str | None, command: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sim.versions.distribution", lambda _name: SimpleNamespace(read_text=lambda _file: origin))
    assert install_command("exact") == command


def test_the_command_for_an_extra_of_a_clone_that_is_not_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    def not_installed(name: str) -> None:
        raise PackageNotFoundError(name)

    monkeypatch.setattr("sim.versions.distribution", not_installed)
    assert install_command("exact") == f'pip install -e "{Path(sim.__file__).parents[1]}[exact]"'


def test_a_large_campaign_says_time_and_disk_first(
    infoset: Infoset, file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Begun(Exception):  # noqa: N818
        pass

    def begin(*_: object, **__: object) -> None:
        raise Begun

    monkeypatch.setattr("sim.Campaign.run", begin)
    asked = ("campaign", file, "--runs", 5_000_000, "--out", tmp_path / "runs", "--workers", 2)
    with pytest.raises(Begun):
        infoset(*asked)
    monkeypatch.setattr("shutil.disk_usage", lambda _: type("Usage", (), {"free": 10**6}))
    code, _, err = infoset(*asked)
    assert code == 2
    assert "5000000 engagements: about" in err
    shards = -(-5_000_000 // chunk_size(5_000_000))
    assert (
        f"on 2 cores, and {size(66 * 5_000_000 + 6000 * shards)} in {shards} shards, but the disk has 1 MB left" in err
    )
    assert not (tmp_path / "runs").exists()


def test_times_and_sizes_are_said_as_people_do() -> None:
    assert [duration(each) for each in (3.0, 99.0, 150.0, 7800.0, 180_000.0, 1e7)] == [
        *("3 s", "99 s", "2 min", "2 h 10 min", "2 days", "116 days"),
    ]
    assert [size(each) for each in (10, 1500, 2.5e6, 7e10, 4e13)] == ["10 bytes", "1.5 kB", "2.5 MB", "70 GB", "40 TB"]


def test_replay_lines_are_for_a_shell() -> None:
    line = replay_line(Path("a folder/it's.toml"), 7, 3, "game")
    assert line == "infoset engage 'a folder/it'\"'\"'s.toml' --noise game --seed 3 --run 7"


def test_the_rate_is_told_where_nobody_looks(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from experiments.campaigns.flight import campaign_progress
    from sim.campaign import Progress

    clock = iter([0.0, 10.0, 61.0, 61.0, 70.0, 130.0, 130.0])
    monkeypatch.setattr("time.monotonic", lambda: next(clock))
    with campaign_progress("campaign", quiet=False) as tell:
        for done in (500, 600, 700, 800):
            tell(Progress(done=done, total=1000, flown=done - 400, elapsed_s=(done - 400) / 5.0))
    assert capsys.readouterr().err.splitlines() == [
        "campaign: 600 of 1000, 5 runs/s, 80 s left",
        "campaign: 800 of 1000, 5 runs/s, 40 s left",
    ]


def _command(file: Path, folder: Path, runs: int) -> list[object]:
    """The command that begins or resumes a campaign."""
    return ["campaign", file, "--runs", runs, "--chunk", 8, "--noise", "mixed", "--out", folder, "--resume", "-q"]


def _begin(file: Path, folder: Path, runs: int) -> subprocess.Popen[bytes]:
    """Begin or resume a campaign in a process of its own."""
    arguments = map(str, _command(file, folder, runs))
    return subprocess.Popen([sys.executable, "-m", "experiments", *arguments], stderr=subprocess.PIPE)


def _killed_at_random_moments(file: Path, folder: Path, runs: int, kills: int, seed: int) -> list[int]:
    """Kill a campaign again and again, and return how many runs were stored each time."""
    chance, stored = random.Random(seed), []
    for _ in range(kills):
        with _begin(file, folder, runs) as process:
            shards = folder / "shards"
            before = len(list(shards.glob("*.parquet"))) if shards.is_dir() else 0
            # Past the start of Python most moments are in the flight: wait for the first new shard, then at random.
            deadline = time.monotonic() + 60.0
            while process.poll() is None and time.monotonic() < deadline:
                if chance.random() < 0.0004 or (shards.is_dir() and len(list(shards.glob("*.parquet"))) > before):
                    break
                time.sleep(0.005)
            time.sleep(chance.uniform(0.0, 0.5))
            process.send_signal(signal.SIGKILL)
            process.wait()
        if (folder / "manifest.json").exists():
            there = CampaignFolder.read(folder)
            assert there.damaged == []
            stored.append(there.finished_runs)
    return stored


def _finished(file: Path, folder: Path, runs: int) -> Any:
    with _begin(file, folder, runs) as process:
        _, errors = process.communicate(timeout=300)
    assert (process.returncode, errors) == (0, b"")
    return _table(folder)


def _table(folder: Path) -> Any:
    """The table of a complete campaign, without temporary files."""
    there = CampaignFolder.read(folder)
    assert there.complete
    assert not list(folder.rglob("*.tmp"))
    return there.table()


@pytest.mark.skipif(os.name != "posix", reason="there is no kill -9")
def test_killed_and_resumed(infoset: Infoset, brief: Scenario, file: Path, tmp_path: Path) -> None:
    stored = _killed_at_random_moments(file, tmp_path / "runs", 400, 1, seed=1)
    assert stored == sorted(stored)
    study = with_model(brief, Model.GUARANTEED)  # the default model of the command
    expected = Campaign(study, 400, tmp_path / "whole", noise=CampaignNoise.MIXED).run().table
    assert infoset(*_command(file, tmp_path / "runs", 400)) == (0, "", "")
    assert _table(tmp_path / "runs").equals(expected)


@pytest.mark.thorough
@pytest.mark.skipif(os.name != "posix", reason="there is no kill -9")
def test_killed_at_twenty_random_moments_and_resumed(brief: Scenario, file: Path, tmp_path: Path) -> None:
    stored = _killed_at_random_moments(file, tmp_path / "runs", 4000, 20, seed=2)
    assert stored == sorted(stored)  # what is stored is never lost
    assert len(set(stored)) > 10
    assert stored[-1] < 4000
    study = with_model(brief, Model.GUARANTEED)
    expected = Campaign(study, 4000, tmp_path / "whole", noise=CampaignNoise.MIXED).run().table
    assert _finished(file, tmp_path / "runs", 4000).equals(expected)


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 200 kB."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=200k", "tmpfs", folder], capture_output=True, check=False
    )
    if mounted.returncode != 0:
        pytest.skip("a small tmpfs cannot be mounted here")
    yield folder
    subprocess.run(["umount", folder], check=True)


@pytest.mark.skipif(not Path("/bin/mount").exists(), reason="there is no mount")
def test_a_disk_that_fills_up(infoset: Infoset, brief: Scenario, file: Path, small_disk: Path, tmp_path: Path) -> None:
    asked = ("campaign", file, "--runs", 1600, "--chunk", 32, "--out", small_disk / "runs", "--quiet")
    code, out, err = infoset(*asked)
    assert (code, out) == (2, "")
    assert err.startswith("error: ")
    assert "the disk is full" in err
    assert "free some space and run again with --resume" in err
    there = CampaignFolder.read(small_disk / "runs")
    assert there.damaged == []
    assert 0 < there.finished_runs < 1500
    assert not list(small_disk.rglob("*.tmp"))
    assert infoset(*asked, "--resume")[0] == 2  # still full
    subprocess.run(["mount", "-o", "remount,size=4m", small_disk], check=True)
    assert infoset(*asked, "--resume") == (0, "", "")
    expected = Campaign(with_model(brief, Model.GUARANTEED), 1600, tmp_path / "whole").run().table
    assert CampaignFolder.read(small_disk / "runs").table().equals(expected)


def test_a_second_campaign_in_the_folder_is_refused(infoset: Infoset, file: Path, tmp_path: Path) -> None:
    from sim.storage.files import locked

    asked = ("campaign", file, "--runs", 8, "--out", tmp_path / "runs")
    assert infoset(*asked, "-q")[0] == 0
    with locked(tmp_path / "runs"):
        code, _, err = infoset(*asked, "--resume")
    assert code == 2
    assert "another campaign is running in this folder" in err


@pytest.mark.thorough
def test_processes_give_the_same_bits_and_die_with_their_parent(brief: Scenario, file: Path, tmp_path: Path) -> None:
    arguments = ["campaign", file, "--runs", 6000, "--chunk", 8, "--noise", "mixed", "--out", tmp_path / "runs", "-q"]
    brief = with_model(brief, Model.GUARANTEED)
    command = [sys.executable, "-m", "experiments", *map(str, arguments), "--resume", "--processes", "2"]
    with subprocess.Popen(command) as process:
        shards = tmp_path / "runs" / "shards"
        while not shards.is_dir() or len(list(shards.glob("*.parquet"))) < 10:
            assert process.poll() is None
            time.sleep(0.05)
        children = {child: _parent(child) for child in _processes() if _parent(child) == process.pid}
        assert len(children) >= 2
        process.kill()
        process.wait()
    deadline = time.monotonic() + 10.0
    while children.keys() & set(_processes()) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert not children.keys() & set(_processes())
    there = CampaignFolder.read(tmp_path / "runs")
    assert 80 <= there.finished_runs < 6000
    subprocess.run([*command], check=True)
    expected = Campaign(brief, 6000, tmp_path / "whole", noise=CampaignNoise.MIXED).run().table
    assert CampaignFolder.read(tmp_path / "runs").table().equals(expected)


def _processes() -> list[int]:
    """Processes that live."""
    if not Path("/proc/self/stat").exists():
        pytest.skip("this system does not list its processes")
    return [int(each.name) for each in Path("/proc").iterdir() if each.name.isdigit()]


def _parent(process: int) -> int:
    """The parent of a process; 0 if it has gone."""
    try:
        return int((Path("/proc") / str(process) / "stat").read_text().rpartition(")")[2].split()[1])
    except OSError:
        return 0
