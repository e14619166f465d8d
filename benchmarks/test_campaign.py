"""Campaigns: what storing costs beside flying, what a second thread gains, and whether memory grows with the runs."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from guidance import NoiseKind
from sim import Campaign, Scenario, simulate
from sim.worker_processes import worker_processes

Check = Callable[[str, float, float, str], None]

RUNS = 800
ROUNDS = 5
FEW, MANY = 10_000, 1_000_000

_WITHOUT_FLYING = """
import sys
from concurrent.futures import Future, Executor
from dataclasses import replace
from pathlib import Path
import numpy as np
from experiments import load_scenario
from experiments.campaign_samples import samples
from sim import Campaign, CampaignNoise
from sim.chunk import fly_chunk

class Pretender(Executor):
    '''Flies the first chunk, and hands out copies of its results: the storage cannot tell.'''
    flown = None
    def submit(self, fly, chunk, *_):
        if self.flown is None:
            self.flown = fly(replace(chunk, first=0, runs=min(chunk.runs, 64)))
        copies = -(-chunk.runs // len(self.flown))
        def many(values):
            repeated = np.ma.concatenate([values] * copies) if np.ma.isMaskedArray(values) else np.concatenate(
                [values] * copies)
            return repeated[: chunk.runs]
        future = Future()
        future.set_result(replace(
            self.flown,
            runs=np.arange(chunk.first, chunk.first + chunk.runs),
            outcomes=(self.flown.outcomes * copies)[: chunk.runs],
            **{name: many(getattr(self.flown, name)) for name in (
                'miss_m', 'impulse_m_s', 'guaranteed_miss_m', 'truth_kept', 'truth_margin_m', 'position_m',
                'velocity_m_s')},
        ))
        return future

runs, folder = int(sys.argv[1]), Path(sys.argv[2])
asked = Campaign(load_scenario('asteroid-1997'), runs, folder, noise=CampaignNoise.MIXED)
result = asked.run(Pretender(), workers=2)
assert sum(sample.runs for sample in samples(result.folder)) == runs
"""


_COMMAND = """
import sys
from experiments.cli import main
try:
    main(sys.argv[1:])
except SystemExit as left:
    assert not left.code
"""

_PEAK = """
from pathlib import Path
(line,) = [each for each in Path('/proc/self/status').read_text().splitlines() if each.startswith('VmHWM')]
print(line.split()[1])
"""


def peak_mb(code: str, *arguments: object) -> float:
    """Peak memory of a process of its own, by its own account: what the system tells its parent counts the parent's."""
    if not Path("/proc/self/status").exists():
        pytest.skip("this system does not tell a process its peak")
    command = [sys.executable, "-c", code + _PEAK, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return int(done.stdout.splitlines()[-1]) * 1024.0 / 1e6


def best_s(work: Callable[[Path], object], folder: Path) -> float:
    """The least time of some rounds, each in an empty folder."""
    times = []
    for number in range(ROUNDS):
        place = folder / str(number)
        began_s = time.perf_counter()
        work(place)
        times.append(time.perf_counter() - began_s)
        shutil.rmtree(place, ignore_errors=True)
    return min(times)


def test_storing_costs_little_beside_flying(curve: Scenario, tmp_path: Path, under: Check) -> None:
    simulate(curve, 64)
    flying_s = best_s(lambda _: simulate(curve, RUNS), tmp_path)
    stored_s = best_s(lambda folder: Campaign(curve, RUNS, folder).run(workers=1), tmp_path)
    under(f"campaign of {RUNS} runs beside simulate, {curve.noise.value}", stored_s / flying_s, 1.1, "x")


def test_two_threads(curve: Scenario, tmp_path: Path, at_least: Check) -> None:
    if (os.cpu_count() or 1) < 2:
        pytest.skip("there is one core")
    simulate(curve, 64)
    one_s = best_s(lambda folder: Campaign(curve, RUNS, folder).run(workers=1), tmp_path)
    two_s = best_s(lambda folder: Campaign(curve, RUNS, folder).run(workers=2), tmp_path)
    at_least(f"two threads beside one, {curve.noise.value}", one_s / two_s, 1.6, "x")


def test_two_processes(curve: Scenario, tmp_path: Path, at_least: Check) -> None:
    if (os.cpu_count() or 1) < 2:
        pytest.skip("there is one core")
    simulate(curve, 64)
    with worker_processes(2) as pool:
        Campaign(curve, 4 * 64, tmp_path / "warm").run(pool)
        one_s = best_s(lambda folder: Campaign(curve, RUNS, folder).run(workers=1), tmp_path)
        two_s = best_s(lambda folder: Campaign(curve, RUNS, folder).run(pool, workers=4), tmp_path)
    at_least(f"two processes beside one thread, {curve.noise.value}", one_s / two_s, 1.6, "x")


def test_memory_does_not_grow_with_the_runs(tmp_path: Path, under: Check) -> None:
    peaks = {runs: peak_mb(_WITHOUT_FLYING, runs, tmp_path / str(runs)) for runs in (FEW, MANY)}
    under(f"peak memory of {MANY} runs, stored but not flown, beside {FEW}", peaks[MANY] / peaks[FEW], 1.2, "x")
    under(f"peak memory of {MANY} runs, stored but not flown", peaks[MANY], 600.0, "MB")


def test_memory_of_a_real_campaign(tmp_path: Path, under: Check) -> None:
    command = ("campaign", "--noise", NoiseKind.GAME.value, "-q", "--runs")
    few = peak_mb(_COMMAND, *command, 640, "--out", tmp_path / "few")
    many = peak_mb(_COMMAND, *command, FEW, "--out", tmp_path / "many")
    under(f"peak memory of {FEW} runs flown beside 640", many / few, 1.2, "x")
    under(f"peak memory of {FEW} runs flown", many, 600.0, "MB")
