from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from infoset import Model
from infoset.experiments.interception.scenario_file import with_model
from infoset.experiments.interception.study import summary
from infoset.guidance import NoiseKind, TieRule, strategy_names
from infoset.sim import Scenario, simulate
from infoset.sim.storage.codec import fingerprint
from infoset.sim.versions import versions
from tests.experiments.command_line import Command

TWO = ("--strategies", "symmetric-miss,patient")
LEVELS = ["p10", "p50", "p90", "p99", "max"]


def test_compare_as_json(
    infoset: Command, brief: Scenario, brief_file: Path, tmp_path: Path
) -> None:
    found = infoset.json("compare", brief_file, *TWO, "--runs", 4, "--seed", 3)
    assert found["versions"] == versions()
    assert (found["scenario"], found["scenario_hash"]) == (
        "brief",
        fingerprint(with_model(brief, Model.GUARANTEED)),
    )
    assert (found["seed"], found["runs"], found["model"], found["range_sensor"]) == (
        3,
        4,
        "guaranteed",
        True,
    )
    strategies = found["strategies"]
    assert [(each["name"], each["noise"]) for each in strategies] == [
        ("symmetric-miss", "random"),
        ("symmetric-miss", "game"),
        ("patient", "random"),
        ("patient", "game"),
    ]
    for each in strategies:
        for quantity in ("miss_m", "impulse_m_s"):
            assert list(each[quantity]) == LEVELS
            # Three runs show the median and the maximum value only.
            assert [name for name, value in each[quantity].items() if value is not None] == [
                "p50",
                "max",
            ]
            assert each[quantity]["p50"] <= each[quantity]["max"]
        assert each["truth_kept"] == each["phi_held"] == 4
        assert list(each["ties"]) == (
            [] if each["noise"] == "random" else ["upper", "lower", "alternate", "random"]
        )
        assert sum(each["outcomes"].values()) == (4 if each["noise"] == "random" else 16)
    assert list(tmp_path.iterdir()) == []


def test_compare_in_the_model_paper_has_no_bound_phi(infoset: Command, brief_file: Path) -> None:
    for each in infoset.json("compare", brief_file, *TWO, "--runs", 3, "--model", "paper")[
        "strategies"
    ]:
        assert 0 <= each["truth_kept"] <= 3
        assert each["phi_held"] is None


def test_compare_equals_the_simulator_with_the_worst_tie_rule_of_each_run(
    infoset: Command, brief: Scenario, brief_file: Path
) -> None:
    found = infoset.json(
        "compare",
        brief_file,
        "--strategies",
        "symmetric-miss",
        "--runs",
        5,
        "--seed",
        2,
        "--model",
        "paper",
    )["strategies"]
    assert found[0]["miss_m"] == summary(simulate(brief, 5, seed=2).miss_m)
    game = [simulate(replace(brief, noise=NoiseKind.GAME, tie=tie), 5, seed=2) for tie in TieRule]
    assert found[1]["miss_m"] == summary(np.max([each.miss_m for each in game], axis=0))
    assert found[1]["impulse_m_s"]["max"] == max(each.impulse_m_s.max() for each in game)
    assert found[1]["ties"]["lower"]["miss_m"] == summary(game[1].miss_m)


def test_the_strategies_of_a_comparison(infoset: Command, brief_file: Path) -> None:
    found = infoset.json("compare", brief_file, "--runs", 1)["strategies"]
    assert [each["name"] for each in found[::2]] == strategy_names()
