"""Ctrl-C at random moments: whole files or none, a message, and how to go on."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
import weakref
from collections.abc import Callable
from enum import Enum
from pathlib import Path
from typing import Any

import pytest
from pydantic import TypeAdapter

from experiments.__main__ import main as beginning
from experiments.campaigns.flight import campaign_errors
from infoset.model import Model
from sim import Campaign, CampaignNoise, Scenario
from sim.storage import CampaignFolder
from sim.storage.codec import to_json
from tests.faults.conftest import Infoset, Left, begin, ended, need_whole

pytestmark = [pytest.mark.thorough, pytest.mark.skipif(os.name != "posix", reason="POSIX signals")]

RESUME = "interrupted; the stored runs are complete: continue with --resume"


def interrupted(*arguments: object, folder: Path, after_s: float) -> Left:
    """Begin a command and interrupt it."""
    process = begin(*arguments, folder=folder)
    deadline = time.monotonic() + after_s
    while process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    left = ended(process)
    assert "Traceback" not in left.err
    if left.code:
        assert left.code == 130
        assert "interrupted" in left.err.splitlines()[-1]
    return left


@pytest.mark.parametrize("command", ["campaign", "sweep"])
def test_an_interrupt_says_how_to_go_on(
    command: str, infoset: Infoset, file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
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
    monkeypatch.setattr(CampaignFolder, "write", write_one)
    left = infoset(*asked)
    assert (left.code, left.out) == (130, "")
    assert left.err.splitlines()[-1] == RESUME
    need_whole(tmp_path / "runs")
    monkeypatch.undo()
    monkeypatch.chdir(tmp_path)
    assert infoset(*asked, "--resume", "-q").code == 0
    there = CampaignFolder.read(tmp_path / "runs")
    assert there.complete


def interrupt(_: object) -> None:
    raise KeyboardInterrupt


def test_an_interrupt_while_a_scenario_is_encoded_stays_an_interrupt(
    brief: Scenario, monkeypatch: pytest.MonkeyPatch
) -> None:
    to_json(brief)  # makes pydantic's serializer
    monkeypatch.setattr(Model, "value", property(interrupt), raising=False)
    with pytest.raises(KeyboardInterrupt):
        to_json(brief)


def test_what_cannot_be_resumed_is_only_interrupted() -> None:
    with pytest.raises(KeyboardInterrupt, match=r"^$"), campaign_errors():
        raise KeyboardInterrupt


COMMANDS: dict[str, list[object]] = {
    "experiment": ["experiment", "brief.toml", "--runs", 3, "--out", "o"],
    "compare": ["compare", "brief.toml", "--runs", 2, "--strategies", "patient,symmetric-miss", "--out", "o"],
    "replay": ["replay", "flight.npz", "--out", "o", "--html", "page.html"],
    "pareto": ["pareto", "--out", "o", "--html", "page.html"],
    "multipoint": ["multipoint", "--out", "o", "--html", "page.html"],
    "reach": ["reach", "--out", "o", "--html", "page.html"],
    "pursuit": ["pursuit", "--out", "o", "--html", "page.html"],
    "report": ["report", "flown", "--out", "o"],
    "reproduce": ["reproduce", "--paper", "pareto", "--json", "o.json"],
    "sweep": [
        *("sweep", "brief.toml", "--vary", "thruster.budget_m_s=100:200:3", "--runs", 64, "--chunk", 8, "--out", "o")
    ],
}


@pytest.mark.thorough
@pytest.mark.parametrize("name", COMMANDS)
def test_interrupted_at_random_moments(name: str, infoset: Infoset, file: Path, tmp_path: Path) -> None:
    assert infoset("engage", file, "--record", "flight.npz", "-q").code == 0
    assert infoset("campaign", file, "--runs", 32, "--out", "flown", "-q").code == 0
    command, chance = COMMANDS[name], random.Random(name)
    whole = tmp_path / "whole"
    whole.mkdir()
    for each in (file.name, "flight.npz", "flown"):
        (whole / each).symlink_to(tmp_path / each)
    began_s = time.monotonic()
    assert ended(begin(*command, folder=whole)).code == 0
    lasts_s = time.monotonic() - began_s
    codes = []
    for trial in range(3):
        folder = tmp_path / f"trial-{trial}"
        folder.mkdir()
        for each in (file.name, "flight.npz", "flown"):
            (folder / each).symlink_to(tmp_path / each)
        # Past the first moments, which are Python's own: until it runs `experiments.__main__` it ends by the signal.
        left = interrupted(*command, folder=folder, after_s=chance.uniform(min(0.5, lasts_s), lasts_s))
        codes.append(left.code)
        need_whole(folder)
        if left.code and name == "sweep" and (folder / "o").exists():
            assert left.err.splitlines()[-1] in (RESUME, "interrupted")
            assert ended(begin(*command, "--resume", "-q", folder=folder)).code == 0
            assert CampaignFolder.read(folder / "o").complete
    assert any(codes)


@pytest.mark.thorough
def test_a_campaign_interrupted_ten_times_gives_the_same_bits(brief: Scenario, file: Path, tmp_path: Path) -> None:
    many = ("--runs", 2000, "--chunk", 8, "--noise", "mixed", "--model", "paper")
    asked = ("campaign", file, *many, "--out", "runs", "--resume", "-q")
    chance, stored = random.Random(9), []
    shards = tmp_path / "runs" / "shards"
    for _ in range(10):
        process = begin(*asked, folder=tmp_path)
        before, deadline = len(list(shards.glob("*.parquet"))), time.monotonic() + 60.0
        while process.poll() is None and len(list(shards.glob("*.parquet"))) == before and time.monotonic() < deadline:
            time.sleep(0.005)
        time.sleep(chance.uniform(0.0, 0.5))
        process.send_signal(signal.SIGINT)
        left = ended(process)
        need_whole(tmp_path / "runs")
        stored.append(CampaignFolder.read(tmp_path / "runs").finished_runs)
        if left.code == 0:
            break
        assert left.code == 130
        assert left.err.splitlines() == [RESUME]
    assert stored == sorted(set(stored))
    assert ended(begin(*asked, folder=tmp_path)).code == 0
    expected = Campaign(brief, 2000, tmp_path / "whole", noise=CampaignNoise.MIXED).run().runs()
    assert CampaignFolder.read(tmp_path / "runs").runs().equals(expected)


MOMENTS = {
    "loading the command": "loading typer",
    "loading numbers": "loading numpy",
    "loading the simulator": "loading sim.engagement",
    "loading a kernel": "in numba.core.dispatcher:Dispatcher.compile",
    "in flight": "in sim.engagement:Engagements.advance",
}
AT_A_MOMENT = """
import importlib.machinery, os, signal, sys

kind, _, place = sys.argv.pop(1).partition(" ")

def interrupt(*_):
    os.kill(os.getpid(), signal.SIGINT)

class Finder(importlib.machinery.PathFinder):
    @classmethod
    def find_spec(cls, name, path=None, target=None):
        if kind == "loading" and name == place:
            interrupt()
        return None

if kind == "in":
    module, _, function = place.partition(":")
    owner, _, name = function.partition(".")
    setattr(getattr(__import__(module, fromlist=[owner]), owner), name, interrupt)
sys.meta_path.insert(0, Finder)
from experiments.__main__ import main
main()
"""


def begun(program: str, *arguments: str, folder: Path) -> Left:
    """Run a program as a module, as ``python -m``."""
    (folder / "begun.py").write_text(program)
    command = [sys.executable, "-m", "begun", *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120, check=False)
    return Left(done.returncode, done.stdout, done.stderr)


@pytest.mark.parametrize("moment", MOMENTS)
def test_an_interrupt_at_a_moment_is_one_message(moment: str, file: Path, tmp_path: Path) -> None:
    left = begun(AT_A_MOMENT, MOMENTS[moment], "engage", file.name, "-q", folder=tmp_path)
    assert (left.code, left.out) == (130, "")
    assert left.err.splitlines()[-1] == "interrupted"
    assert "Traceback" not in left.err


def test_an_interrupt_while_a_dataclass_is_defined_is_one_message(tmp_path: Path) -> None:
    program = """
import experiments.cli
from experiments.__main__ import main

def run():
    exec("raise KeyboardInterrupt")

experiments.cli.main = run
main()
"""
    assert begun(program, folder=tmp_path) == Left(130, "", "interrupted\n")


def test_an_interrupt_while_python_exits_changes_nothing(tmp_path: Path) -> None:
    program = """
import os, signal, sys
import experiments.cli
from experiments.__main__ import main

class Last:
    def __del__(self, kill=os.kill, process=os.getpid(), interrupt=signal.SIGINT):
        kill(process, interrupt)

sys.last = Last()
experiments.cli.main = lambda: sys.exit(0)
main()
"""
    assert begun(program, folder=tmp_path) == Left(0, "", "")


def wrapped_by_python() -> None:
    raise RuntimeError("Error calling __set_name__") from KeyboardInterrupt()


def replaced_by_pydantic() -> None:
    class Kind(Enum):
        ONE = 1

        @property
        def value(self) -> int:
            raise KeyboardInterrupt

    TypeAdapter(Kind)


@pytest.mark.parametrize("run", [wrapped_by_python, replaced_by_pydantic])
def test_an_interrupt_as_another_error_is_one_message(
    run: Callable[[], None], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.unraisablehook", sys.unraisablehook)  # put back afterwards
    monkeypatch.setattr("experiments.cli.main", run)
    with pytest.raises(SystemExit) as left:
        beginning()
    assert left.value.code == 130
    assert capsys.readouterr().err == "interrupted\n"


def test_other_errors_are_not_taken_for_interrupts(monkeypatch: pytest.MonkeyPatch) -> None:
    def run() -> None:
        raise RuntimeError("a defect") from ValueError()

    monkeypatch.setattr("sys.unraisablehook", sys.unraisablehook)
    monkeypatch.setattr("experiments.cli.main", run)
    with pytest.raises(RuntimeError, match="a defect"):
        beginning()


def test_an_interrupt_that_falls_into_a_callback_is_not_lost(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    class Thing:
        pass

    def run() -> None:
        thing = Thing()
        watched = weakref.ref(thing, interrupt)
        del thing
        time.sleep(5.0)
        assert watched() is None

    monkeypatch.setattr("sys.unraisablehook", sys.unraisablehook)  # put back afterwards
    monkeypatch.setattr("experiments.cli.main", run)
    with pytest.raises(SystemExit) as left:
        beginning()
    assert left.value.code == 130
    assert capsys.readouterr().err == "interrupted\n"
