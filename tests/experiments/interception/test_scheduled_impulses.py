"""The report of the impulses of a schedule."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from infoset.experiments import load_scenario
from infoset.experiments.interception.runs.experiment import impulses_key
from infoset.sim import simulate
from infoset.sim.results import join
from tests.experiments.command_line import Command, strict

SETTINGS = ("thruster.impulses_s=[80.0, 40.0, 10.0]", "thruster.last_impulse_s=20.0")


def test_impulses_of_a_schedule_are_in_the_table(infoset: Command) -> None:
    """Their shares add up to one, and no time after the cut-off has an impulse."""
    options = [option for setting in SETTINGS for option in ("--set", setting)]
    arguments = ["experiment", "asteroid-1997", "--runs", 10, *options]
    code, out, _ = infoset(*arguments, "--json", "results.json")
    assert code == 0
    assert "impulse, s before arrival" in out
    curves = strict(Path("results.json").read_text())["curves"]
    assert len(curves) == 4
    for curve in curves:
        first, second = curve["impulses"]
        # Flights have 200 steps until the nominal arrival at 5801.3 km / 58 km/s.
        step_s = 5801.3 / 58.0 / 200
        assert first["before_arrival_s"] == pytest.approx(160 * step_s)
        assert second["before_arrival_s"] == pytest.approx(80 * step_s)
        assert first["share"] + second["share"] == pytest.approx(1.0)
        assert first["p99_m_s"] is None  # ten runs do not show it
    results = simulate(load_scenario("asteroid-1997", SETTINGS), 10)
    assert curves[2]["impulses"] != curves[0]["impulses"]
    assert impulses_key(load_scenario("asteroid-1997", SETTINGS), results)["impulses"] in [
        curve["impulses"] for curve in curves
    ]


def test_impulses_are_columns_of_the_results() -> None:
    scenario = load_scenario("asteroid-1997", SETTINGS)
    results = simulate(scenario, 4)
    assert results.burns_m_s is not None
    np.testing.assert_allclose(results.burns_m_s.sum(axis=1), results.impulse_m_s, rtol=1e-12)
    halves = join([simulate(scenario, [0, 1]), simulate(scenario, [2, 3])])
    assert halves.burns_m_s is not None
    np.testing.assert_array_equal(halves.burns_m_s, results.burns_m_s)
    assert halves.take(np.array([3])).burns_m_s.tolist() == results.burns_m_s[3:].tolist()  # type: ignore[union-attr]
    without = simulate(load_scenario("asteroid-1997"), 2)
    assert without.burns_m_s is None
    assert join([without, without]).take(np.array([1])).burns_m_s is None
    idle = simulate(load_scenario("asteroid-1997", [*SETTINGS, "thruster.budget_m_s=0.0"]), 2)
    of_idle = impulses_key(scenario, idle)["impulses"]
    assert [impulse["share"] for impulse in of_idle] == [None, None]


def test_many_impulses_are_only_in_json(infoset: Command) -> None:
    settings = ("thruster.last_impulse_s=20", "thruster.impulse_period_s=1")
    options = [option for setting in settings for option in ("--set", setting)]
    _, out, _ = infoset(
        "experiment", "asteroid-1997", "--runs", 4, *options, "--json", "results.json"
    )
    assert "impulses at 81 times: --json has the quantiles of each" in out
    assert "impulse, s before arrival" not in out
    assert len(strict(Path("results.json").read_text())["curves"][0]["impulses"]) == 81
