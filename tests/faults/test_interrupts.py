"""Ctrl-C at random moments: complete files or none, a message, and how to continue."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from infoset.sim import Campaign, CampaignNoise, Scenario
from infoset.sim.storage import CampaignFolder
from tests.experiments.command_line import Command
from tests.faults.conftest import begin, ended, need_whole

pytestmark = [pytest.mark.thorough, pytest.mark.skipif(os.name != "posix", reason="POSIX signals")]

RESUME = "interrupted; the stored runs are complete: continue with --resume"
CODES = (130, -signal.SIGINT)
"""Python itself ends by the signal where it drops an interrupt, which shells report as 130 too."""


@pytest.mark.parametrize("command", ["campaign", "sweep"])
def test_message_of_an_interrupt_says_how_to_continue(
    command: str, infoset: Command, file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stored: list[int] = []
    write = CampaignFolder.write

    def write_one(folder: CampaignFolder, *given: Any) -> None:
        if stored:
            raise KeyboardInterrupt
        write(folder, *given)
        stored.append(1)

    more = ["--vary", "thruster.budget_m_s=100:200:2"] if command == "sweep" else []
    asked = (command, file, "--runs", 16, "--chunk", 8, "--out", "runs", *more)
    with monkeypatch.context() as patched:
        patched.setattr(CampaignFolder, "write", write_one)
        code, out, err = infoset(*asked)
    assert (code, out, err.splitlines()[-1]) == (130, "", RESUME)
    need_whole(tmp_path / "runs")
    assert infoset(*asked, "--resume", "-q")[0] == 0
    assert CampaignFolder.read(tmp_path / "runs").complete


COMMANDS: dict[str, list[object]] = {
    "experiment": ["experiment", "brief.toml", "--runs", 3, "--out", "o"],
    "pareto": ["pareto", "--out", "o", "--html", "page.html"],
    "reach": ["reach", "--out", "o", "--html", "page.html"],
}


@pytest.mark.parametrize("name", COMMANDS)
def test_command_interrupted_at_random_moments_leaves_whole_files(
    name: str, file: Path, tmp_path: Path
) -> None:
    command = [*COMMANDS[name], "--overwrite"]
    chance = random.Random(name)
    began_s = time.monotonic()
    assert ended(begin(*command, folder=tmp_path)).code == 0
    lasts_s = time.monotonic() - began_s
    for _ in range(3):
        process = begin(*command, folder=tmp_path)
        time.sleep(chance.uniform(min(0.5, lasts_s), lasts_s))
        process.send_signal(signal.SIGINT)
        assert ended(process).code in (0, *CODES)
        need_whole(tmp_path)


@pytest.mark.parametrize(
    ("kind", "times"), [(signal.SIGINT, 10), (signal.SIGKILL, 6)], ids=["interrupted", "killed"]
)
def test_a_campaign_stopped_many_times_gives_the_same_bits(
    kind: signal.Signals, times: int, brief: Scenario, file: Path, tmp_path: Path
) -> None:
    """At random moments: before the first file, between two files, and while one is written."""
    many = ("--runs", 2000, "--chunk", 8, "--noise", "mixed", "--model", "paper")
    asked = ("campaign", file, *many, "--out", "runs", "--resume", "-q")
    chance = random.Random(9)
    stored = []
    shards = tmp_path / "runs" / "shards"
    for _ in range(times):
        process = begin(*asked, folder=tmp_path)
        before = len(list(shards.glob("*.parquet")))
        deadline = time.monotonic() + 60.0
        while (
            process.poll() is None
            and len(list(shards.glob("*.parquet"))) == before
            and time.monotonic() < deadline
        ):
            time.sleep(0.005)
        time.sleep(chance.uniform(0.0, 0.5))
        process.send_signal(kind)
        left = ended(process)
        stored.append(CampaignFolder.read(tmp_path / "runs").finished_runs)
        if left.code == 0:
            break
        if kind is signal.SIGINT:
            need_whole(tmp_path / "runs")
            assert (left.code, left.err.splitlines()) == (130, [RESUME])
        else:
            assert left.code == -kind
    assert stored == sorted(set(stored))
    assert ended(begin(*asked, folder=tmp_path)).code == 0
    expected = Campaign(brief, 2000, tmp_path / "whole", noise=CampaignNoise.MIXED).run().runs()
    assert CampaignFolder.read(tmp_path / "runs").runs().equals(expected)


@pytest.mark.parametrize("place", ["typer", "numpy", "infoset.sim.engagement"])
def test_an_interrupt_while_a_module_is_loaded(place: str, file: Path, tmp_path: Path) -> None:
    program = f"""
import importlib.machinery, os, signal, sys

class Finder(importlib.machinery.PathFinder):
    @classmethod
    def find_spec(cls, name, path=None, target=None):
        if name == {place!r}:
            os.kill(os.getpid(), signal.SIGINT)
        return None

sys.meta_path.insert(0, Finder)
from infoset.experiments.__main__ import main
main()
"""
    command = [sys.executable, "-c", program, "engage", file.name, "-q"]
    done = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False
    )
    assert (done.returncode, done.stdout) == (130, "")
    assert "Traceback" not in done.stderr
