"""Not enough memory: one message, and a campaign that is continued when there is enough."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from infoset.sim import Campaign, Results, Scenario
from infoset.sim.parallel import Task, simulate_task
from infoset.sim.storage import CampaignFolder
from tests.experiments.command_line import Command
from tests.faults.conftest import Left, need_whole

pytestmark = pytest.mark.thorough

LIMITED = (
    "import resource, sys\n"
    "from infoset.experiments.cli import main\n"
    "import numpy, pyarrow, scipy.linalg, infoset.sim.storage.tables, infoset.sim.simulate\n"
    "import infoset.experiments.campaigns.run_campaign, "
    "infoset.experiments.interception.scenario_file\n"
    "from infoset.engine import location, section_passes\n"
    "used = int(open('/proc/self/statm').read().split()[0]) * resource.getpagesize()\n"
    "resource.setrlimit(resource.RLIMIT_AS, (used + int(sys.argv[1]),) * 2)\n"
    "main(sys.argv[2:])\n"
)
"""A process that may allocate so many bytes more than it has after loading, as under `ulimit -v`.

OpenBLAS, which Numba loads with scipy.linalg, does not end where it finds no memory, and is loaded
before.
"""


def with_room(room_bytes: int, *arguments: object, folder: Path) -> Left:
    """Run the command with so much memory beyond what Python and its libraries take; kill it after
    two minutes.
    """
    try:
        done = subprocess.run(
            [sys.executable, "-c", LIMITED, str(room_bytes), *map(str, arguments)],
            cwd=folder,
            capture_output=True,
            text=True,
            check=False,
            timeout=120,
            env={**os.environ, "NO_COLOR": "1"},
        )
    except subprocess.TimeoutExpired:
        return Left(-signal.SIGKILL, "", "")
    return Left(done.returncode, done.stdout, done.stderr)


def test_missing_memory_is_a_message_that_says_how_to_continue(
    infoset: Command, file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flown: list[Task] = []

    def fly(task: Task, *_: object) -> Results:
        flown.append(task)
        if len(flown) > 1:
            raise MemoryError("Unable to allocate 7.45 GiB")
        return simulate_task(task)

    asked = ("campaign", file, "--runs", 24, "--chunk", 8, "--out", "runs", "--workers", 1)
    with monkeypatch.context() as patched:
        patched.setattr("infoset.sim.parallel.simulate_task", fly)
        code, _, err = infoset(*asked)
    message = err.splitlines()[-1]
    assert code == 2
    assert message.startswith("error: not enough memory (Unable to allocate 7.45 GiB); ")
    assert message.endswith("the stored runs are complete: continue with --resume")
    need_whole(tmp_path / "runs")
    assert infoset(*asked, "--resume", "-q")[0] == 0


@pytest.mark.skipif(
    not Path("/proc/self/statm").exists(), reason="how much memory is taken is told here otherwise"
)
def test_a_campaign_under_a_limit_ends_and_is_resumed(
    brief: Scenario, file: Path, tmp_path: Path
) -> None:
    """With however little memory: the shards that are there are complete, and the campaign can be
    resumed.

    Where a library or Python itself fails for want of memory, it may end the process in its own
    way, or wait forever. So few runs are simulated in threads: Python's pool of processes waits for
    a thread that had no memory.
    """
    study = ("campaign", file, "--model", "paper")
    asked = (*study, "--runs", 2048, "--chunk", 512, "--out", "runs", "--resume", "--workers", 2)
    # What compiles is not ours: the kernels are made before.
    assert (
        with_room(
            4 << 30, *study, "--runs", 32, "--out", "first", "--workers", 1, folder=tmp_path
        ).code
        == 0
    )
    codes = []
    for room_bytes in (1 << 20, 8 << 20, 32 << 20, 128 << 20):
        left = with_room(room_bytes, *asked, folder=tmp_path)
        codes.append(left.code)
        if left.code == 2:
            assert left.err.splitlines()[-1].startswith("error: ")
            assert "memory" in left.err
        if (tmp_path / "runs" / "manifest.json").exists():
            need_whole(tmp_path / "runs")
    assert any(codes)
    assert with_room(4 << 30, *asked, folder=tmp_path).code == 0
    expected = Campaign(brief, 2048, tmp_path / "whole").run().runs()
    assert CampaignFolder.read(tmp_path / "runs").runs().equals(expected)
