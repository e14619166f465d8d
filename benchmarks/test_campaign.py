"""Campaigns: time of storing, gain of a second thread or process, and memory as a function of the
number of runs.
"""

from __future__ import annotations

import os
import shutil
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from infoset.guidance import NoiseKind
from infoset.sim import Campaign, Scenario, simulate
from infoset.sim.parallel import worker_processes

Check = Callable[[str, float, float, str], None]
Work = Callable[[Path], object]

RUNS = 800
ROUNDS = 7
FEW, MANY = 10_000, 1_000_000

_SHORT_FLIGHTS = """
import sys
from dataclasses import replace
from pathlib import Path
from infoset.experiments import load_scenario
from infoset.experiments.campaigns.run_tables import summary
from infoset import StateBox
from infoset.sim import Campaign, CampaignNoise

# The last seconds of the interception with three sections: a million engagements take minutes.
whole = load_scenario('asteroid-1997')
known = StateBox(z_m=(-1e3, 1e3), x_m=(190e3, 250e3), vz_m_s=(-50.0, 50.0), vx_m_s=(-59e3, -57e3))
start = StateBox(
    z_m=(-500.0, 500.0), x_m=(210e3, 230e3), vz_m_s=(-50.0, 50.0), vx_m_s=(-58.1e3, -57.9e3)
)
model = replace(whole.set_model, bounds=known, sections=3, fewest_sections=2)
short = replace(whole, set_model=model, dispersion=start, range_sensor=None)

runs, folder = int(sys.argv[1]), Path(sys.argv[2])
result = Campaign(short, runs, folder, noise=CampaignNoise.MIXED).run(workers=2)
assert summary(result)["runs"].sum() == runs
"""


_COMMAND = """
import sys
from infoset.experiments.cli import main
try:
    main(sys.argv[1:])
except SystemExit as left:
    assert not left.code
"""

_PEAK = """
from pathlib import Path
lines = Path('/proc/self/status').read_text().splitlines()
(line,) = [line for line in lines if line.startswith('VmHWM')]
print(line.split()[1])
"""


def peak_mb(code: str, *arguments: object) -> float:
    """Return the peak memory of code in a new process, MB, which the process reads itself.

    The value that the parent gets from the system includes the memory of the parent.
    """
    if not Path("/proc/self/status").exists():
        pytest.skip("this system has no /proc/self/status, which contains the peak memory")
    command = [sys.executable, "-c", code + _PEAK, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return int(done.stdout.splitlines()[-1]) * 1024.0 / 1e6


def times_as_long(work: Work, other: Work, folder: Path) -> float:
    """Return the median over rounds of the ratio of two times.

    Both are measured in every round, because the speed of a machine varies, and their order
    alternates. Both functions get an empty folder.
    """

    def seconds(function: Work, empty: Path) -> float:
        began_s = time.perf_counter()
        function(empty)
        elapsed_s = time.perf_counter() - began_s
        shutil.rmtree(empty, ignore_errors=True)
        return elapsed_s

    ratios = []
    for number in range(ROUNDS):
        order = (work, other) if number % 2 == 0 else (other, work)
        spent = {function: seconds(function, folder / str(number)) for function in order}
        ratios.append(spent[work] / spent[other])
    return statistics.median(ratios)


def test_time_of_storing(curve: Scenario, tmp_path: Path, under: Check) -> None:
    simulate(curve, 64)
    ratio = times_as_long(
        lambda folder: Campaign(curve, RUNS, folder).run(workers=1),
        lambda _: simulate(curve, RUNS),
        tmp_path,
    )
    under(f"campaign of {RUNS} runs compared with simulate, {curve.noise.value}", ratio, 1.1, "x")


def test_two_threads(curve: Scenario, tmp_path: Path, at_least: Check) -> None:
    if (os.cpu_count() or 1) < 2:
        pytest.skip("the machine has one core")
    simulate(curve, 64)
    ratio = times_as_long(
        lambda folder: Campaign(curve, RUNS, folder).run(workers=1),
        lambda folder: Campaign(curve, RUNS, folder).run(workers=2),
        tmp_path,
    )
    at_least(f"two threads compared with one, {curve.noise.value}", ratio, 1.6, "x")


def test_two_processes(curve: Scenario, tmp_path: Path, at_least: Check) -> None:
    if (os.cpu_count() or 1) < 2:
        pytest.skip("the machine has one core")
    simulate(curve, 64)
    with worker_processes(2) as pool:
        Campaign(curve, 4 * 64, tmp_path / "warm").run(pool)
        ratio = times_as_long(
            lambda folder: Campaign(curve, RUNS, folder).run(workers=1),
            lambda folder: Campaign(curve, RUNS, folder).run(pool, workers=4),
            tmp_path,
        )
    at_least(f"two processes compared with one thread, {curve.noise.value}", ratio, 1.6, "x")


def test_memory_does_not_grow_with_the_runs(tmp_path: Path, under: Check) -> None:
    peaks = {runs: peak_mb(_SHORT_FLIGHTS, runs, tmp_path / str(runs)) for runs in (FEW, MANY)}
    under(
        f"peak memory of {MANY} short runs compared with {FEW}", peaks[MANY] / peaks[FEW], 1.2, "x"
    )
    under(f"peak memory of {MANY} short runs", peaks[MANY], 600.0, "MB")


def test_memory_of_a_real_campaign(tmp_path: Path, under: Check) -> None:
    command = (
        "campaign",
        "--model",
        "paper",
        "--noise",
        NoiseKind.GAME.value,
        "-q",
        "--workers",
        1,
        "--runs",
    )
    few = peak_mb(_COMMAND, *command, 640, "--out", tmp_path / "few")
    many = peak_mb(_COMMAND, *command, FEW, "--out", tmp_path / "many")
    under(f"peak memory of {FEW} runs compared with 640", many / few, 1.2, "x")
    under(f"peak memory of {FEW} runs", many, 600.0, "MB")
