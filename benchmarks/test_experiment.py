"""The interception experiment: one curve in this process, and commands as processes with their peak
memory.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from infoset import InitialSet, Model
from infoset.guidance import NoiseKind
from infoset.sim import Scenario, simulate
from infoset.sim.scenario import of_model

Check = Callable[[str, float, float, str], None]

RATE_TARGET = {NoiseKind.RANDOM: 450.0, NoiseKind.GAME: 150.0}
MANY = 400
CURVE_TARGET_S = {NoiseKind.RANDOM: 0.2, NoiseKind.GAME: 0.5}
ROUNDS = 5


@dataclass(frozen=True)
class Process:
    """A finished process."""

    elapsed_s: float
    peak_mb: float
    errors: str


def infoset(*arguments: str, cache: Path | None = None) -> Process:
    """Run the command `infoset` in a new process, with another compile cache if `cache` is not
    None.
    """
    environment = (
        dict(os.environ) if cache is None else {**os.environ, "NUMBA_CACHE_DIR": str(cache)}
    )
    command = [sys.executable, "-m", "infoset", *arguments]
    began = time.perf_counter()
    with subprocess.Popen(
        command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stderr is not None
        errors = process.stderr.read()
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    elapsed_s = time.perf_counter() - began
    assert process.returncode == 0, errors
    unit = (
        1.0 if sys.platform == "darwin" else 1024.0
    )  # ru_maxrss is in bytes there, in KiB elsewhere
    return Process(elapsed_s, usage.ru_maxrss * unit / 1e6, errors)


@pytest.mark.benchmark(group="50 engagements of one curve")
def test_curve(benchmark: BenchmarkFixture, curve: Scenario, under: Check) -> None:
    benchmark.pedantic(simulate, args=(curve, 50), rounds=ROUNDS, warmup_rounds=1)
    assert benchmark.stats is not None
    elapsed_s = float(benchmark.stats.stats.median)
    under(f"50 engagements, {curve.noise.value}", elapsed_s, CURVE_TARGET_S[curve.noise], "s")


@pytest.mark.benchmark(group="engagements a second, one core")
def test_rate(benchmark: BenchmarkFixture, curve: Scenario, at_least: Check) -> None:
    benchmark.pedantic(simulate, args=(curve, MANY), rounds=ROUNDS, warmup_rounds=1)
    assert benchmark.stats is not None
    rate = MANY / float(benchmark.stats.stats.median)
    at_least(
        f"engagements, {curve.noise.value}, 29 sections", rate, RATE_TARGET[curve.noise], "a second"
    )


def test_phi_costs_at_most_three_times(curve: Scenario, under: Check) -> None:
    model = replace(curve.set_model, model=Model.GUARANTEED, initial_set=InitialSet.BOX)
    scenario = replace(curve, **of_model(model))

    def elapsed_s(guarantee: bool) -> float:
        began = time.perf_counter()
        simulate(scenario, 100, guarantee=guarantee)
        return time.perf_counter() - began

    for guarantee in (True, False):
        elapsed_s(guarantee)
    ratios = [elapsed_s(True) / elapsed_s(False) for _ in range(ROUNDS)]
    under(
        f"time with Phi divided by time without, {curve.noise.value}",
        sorted(ratios)[ROUNDS // 2],
        3.0,
        "times",
    )


def test_first_run(tmp_path: Path, under: Check) -> None:
    first = infoset("experiment", cache=tmp_path / "cache")
    assert "compil" in first.errors
    under("infoset experiment, empty compile cache", first.elapsed_s, 20.0, "s")
    under("peak memory, empty compile cache", first.peak_mb, 400.0, "MB")


def test_without_figures(under: Check) -> None:
    infoset("experiment", "--runs", "1")
    runs = [infoset("experiment") for _ in range(ROUNDS)]
    under("infoset experiment without figures", min(run.elapsed_s for run in runs), 4.0, "s")
    under("peak memory without figures", max(run.peak_mb for run in runs), 400.0, "MB")


def test_with_figures(tmp_path: Path, under: Check) -> None:
    infoset("experiment", "--runs", "1", "--out", str(tmp_path / "warm"))
    runs = [
        infoset("experiment", "--out", str(tmp_path / f"results{number}"))
        for number in range(ROUNDS)
    ]
    under("infoset experiment with figures", min(run.elapsed_s for run in runs), 8.0, "s")
    under("peak memory with figures", max(run.peak_mb for run in runs), 400.0, "MB")


def test_bound(under: Check) -> None:
    run = infoset("bound", "asteroid-1997", "--model", "guaranteed")
    under("infoset bound of the published scenario", run.elapsed_s, 20.0, "s")


def test_help(under: Check) -> None:
    under("infoset --help", min(infoset("--help").elapsed_s for _ in range(ROUNDS)), 0.7, "s")
