"""Clocks that jump, and files from the future."""

from __future__ import annotations

import itertools
import os
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from sim.storage import CampaignFolder
from tests.faults.conftest import Infoset, need_whole

pytestmark = pytest.mark.thorough

YEAR_S = 365.25 * 86_400.0


def jumping() -> Iterator[float]:
    """A clock that goes on, back by a year, forth by ten, and stands still."""
    now = 1e9
    for jump in itertools.cycle((0.5, -YEAR_S, 10.0 * YEAR_S, 0.0, -0.25)):
        now += jump
        yield now


@pytest.fixture
def wild_clocks(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = jumping()
    for name in ("time", "monotonic", "perf_counter"):
        monkeypatch.setattr(f"time.{name}", lambda: next(clock))


@pytest.mark.usefixtures("wild_clocks")
def test_a_campaign_stops_and_resumes_as_by_a_sound_clock(infoset: Infoset, file: Path, tmp_path: Path) -> None:
    rule = ("--until", "miss_m p50 ci<2")
    asked = ("campaign", file, "--runs", 400, "--chunk", 16, *rule)
    wild = infoset(*asked, "--out", "wild", "--workers", 1)
    assert wild.code == 0
    # What was stored last year, or will be next year, is resumed too.
    for sign, path in zip(itertools.cycle((-1.0, 1.0)), sorted((tmp_path / "wild").rglob("*"))):
        os.utime(path, (2e9 + sign * YEAR_S, 2e9 + sign * YEAR_S))
    again = infoset(*asked, "--out", "wild", "--resume")
    assert again.code == 0
    need_whole(tmp_path / "wild")
    stopped = [line for line in (wild.out + again.out).splitlines() if "stopped by" in line]
    assert len({line.split(",")[1] for line in stopped}) == 1


def test_the_stopping_rule_knows_no_clock(
    infoset: Infoset, file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = ("campaign", file, "--runs", 400, "--chunk", 16, "--until", "miss_m p50 ci<2", "-q")
    assert infoset(*asked, "--out", "sound").code == 0
    with monkeypatch.context() as patched:
        clock = jumping()
        for name in ("time", "monotonic", "perf_counter"):
            patched.setattr(f"time.{name}", lambda: next(clock))
        assert infoset(*asked, "--out", "wild", "--workers", 1).code == 0
    sound, wild = (CampaignFolder.read(tmp_path / name) for name in ("sound", "wild"))
    assert wild.runs().equals(sound.runs())
    assert 0 < wild.finished_runs < 400


def test_a_lock_is_none_of_the_clock(infoset: Infoset, file: Path, tmp_path: Path) -> None:
    """A lock file of last year or of next year, whose process has gone, holds nobody back."""
    for when in (time.time() - YEAR_S, time.time() + YEAR_S):
        folder = tmp_path / f"runs-{when:.0f}"
        folder.mkdir()
        (folder / ".lock").touch()
        os.utime(folder / ".lock", (when, when))
        assert infoset("campaign", file, "--runs", 8, "--out", folder, "-q").code == 0
