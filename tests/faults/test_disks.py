"""Disks that are full, folders that may not be written, and other clocks."""

from __future__ import annotations

import errno
import os
import subprocess
from pathlib import Path

import pytest

from infoset.experiments.common.figure_style import new_figure
from infoset.experiments.common.output import Output
from infoset.sim import Campaign, Scenario
from infoset.sim.storage import CampaignFolder
from tests.experiments.command_line import Command
from tests.faults.conftest import begin, ended, need_whole

pytestmark = pytest.mark.thorough

COMMANDS = {
    "experiment": ("experiment", "brief.toml", "--runs", 2),
    "engage": ("engage", "brief.toml"),
    "pareto": ("pareto",),
    "reach": ("reach",),
    "campaign": ("campaign", "brief.toml", "--model", "paper", "--runs", 8),
}


@pytest.mark.parametrize("name", list(COMMANDS)[:-1])
def test_full_disk_is_a_message_and_leaves_no_partial_file(
    name: str, infoset: Command, file: Path, small_disk: Path
) -> None:
    assert "No space left on device" in infoset(*COMMANDS[name], "--out", small_disk / "o")[2]
    need_whole(small_disk)


def test_campaign_is_resumed_after_a_full_disk(
    infoset: Command, brief: Scenario, file: Path, small_disk: Path
) -> None:
    subprocess.run(["mount", "-o", "remount,size=200k", small_disk], check=True)
    asked = (
        "campaign",
        file,
        "--model",
        "paper",
        "--runs",
        1600,
        "--chunk",
        32,
        "--out",
        small_disk / "runs",
        "-q",
    )
    err = infoset.refused(*asked)
    assert (
        "No space left on device; the files in the folder are complete: free some space and "
        "run again"
    ) in err
    assert 0 < CampaignFolder.read(small_disk / "runs").finished_runs < 1500
    need_whole(small_disk)
    assert infoset(*asked, "--resume")[0] == 2  # still full
    subprocess.run(["mount", "-o", "remount,size=4m", small_disk], check=True)
    assert infoset(*asked, "--resume") == (0, "", "")
    expected = Campaign(brief, 1600, file.parent / "whole").run()
    assert CampaignFolder.read(small_disk / "runs").runs().equals(expected.runs())


@pytest.mark.parametrize("name", COMMANDS)
def test_folder_without_permission_is_a_message(
    name: str, file: Path, tmp_path: Path, ordinary: tuple[str, ...]
) -> None:
    sealed = tmp_path / "sealed"
    sealed.mkdir(mode=0o500)
    left = ended(begin(*COMMANDS[name], "--out", sealed / "o", folder=tmp_path, prefix=ordinary))
    assert left.code == 2
    assert "Permission denied" in left.err.splitlines()[-1]
    assert list(sealed.iterdir()) == []


def test_a_figure_replaces_the_one_before_only_when_it_is_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    figure = new_figure(height_mm=20.0, width_mm=20.0)
    Output(tmp_path, {}, overwrite=True).figure("figure", figure)
    before = {each.name: each.read_bytes() for each in tmp_path.iterdir()}
    figure.text(0.5, 0.5, "another")

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(OSError, match="No space left on device"):
        Output(tmp_path, {}, overwrite=True).figure("figure", figure)
    assert {each.name: each.read_bytes() for each in tmp_path.iterdir()} == before
