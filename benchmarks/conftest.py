"""Targets, which are listed at the end of a run, and scenarios of the benchmarks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from infoset.experiments import load_scenario
from infoset.guidance import NoiseKind
from infoset.sim import Scenario

Check = Callable[[str, float, float, str], None]

LINES = pytest.StashKey[list[str]]()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--strict-targets", action="store_true", help="fail if a target is missed")


def pytest_configure(config: pytest.Config) -> None:
    config.stash[LINES] = []


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    lines = config.stash[LINES]
    if lines:
        terminalreporter.section("targets")
        for line in lines:
            terminalreporter.write_line(line)


def _checker(config: pytest.Config, at_least: bool) -> Check:
    def check(name: str, measured: float, target: float, unit: str) -> None:
        met = measured >= target if at_least else measured < target
        bound = ">=" if at_least else "<"
        line = (
            f"{'met   ' if met else 'MISSED'} {name}: {measured:.4g} {unit} (target {bound} "
            f"{target:g} {unit})"
        )
        config.stash[LINES].append(line)
        assert met or not config.getoption("--strict-targets"), line

    return check


@pytest.fixture(scope="session")
def under(pytestconfig: pytest.Config) -> Check:
    """Compare a measured value with its upper limit and list both at the end of the run."""
    return _checker(pytestconfig, at_least=False)


@pytest.fixture(scope="session")
def at_least(pytestconfig: pytest.Config) -> Check:
    """Compare a measured value with its lower limit and list both at the end of the run."""
    return _checker(pytestconfig, at_least=True)


@pytest.fixture(
    params=[NoiseKind.RANDOM, NoiseKind.GAME], ids=lambda kind: kind.value, scope="module"
)
def curve(request: pytest.FixtureRequest) -> Scenario:
    """The paper's scenario without a range sensor: curves 1 and 3 of its experiment."""
    return replace(load_scenario("asteroid-1997"), noise=request.param, range_sensor=None)
