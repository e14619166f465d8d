from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.interception.figures.comparison import draw_comparison
from experiments.interception.scenario_file import load_scenario, with_model
from experiments.interception.study import Comparison, compared_scenarios, comparisons, summary
from guidance import NoiseKind, TieRule, strategy_names
from infoset import Model
from sim import Scenario, simulate
from sim.storage.codec import fingerprint
from sim.versions import versions

TWO = ("--strategies", "symmetric-miss,patient")
LEVELS = ["p10", "p50", "p90", "p99", "max"]
FILES = ["figure-comparison.pdf", "figure-comparison.png", "results.csv", "results.json", "scenario.toml"]

Infoset = Callable[..., tuple[int, str, str]]


@pytest.fixture
def infoset(infoset: Infoset, monkeypatch: pytest.MonkeyPatch) -> Infoset:
    """Run `infoset compare` in an empty folder."""
    monkeypatch.setenv("COLUMNS", "80")
    return partial(infoset, "compare")


def as_json(infoset: Infoset, *arguments: object) -> Any:
    code, out, _ = infoset(*arguments, "--json", "-")
    assert code == 0
    return json.loads(out, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))


def test_compare_as_json(infoset: Infoset, brief: Scenario, brief_file: Path, tmp_path: Path) -> None:
    found = as_json(infoset, brief_file, *TWO, "--runs", 4, "--seed", 3)
    assert found["versions"] == versions()
    assert (found["scenario"], found["scenario_hash"]) == ("brief", fingerprint(with_model(brief, Model.GUARANTEED)))
    assert (found["seed"], found["runs"], found["model"], found["range_sensor"]) == (3, 4, "guaranteed", True)
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
            assert [name for name, value in each[quantity].items() if value is not None] == ["p50", "max"]
            assert each[quantity]["p50"] <= each[quantity]["max"]
        assert each["truth_kept"] == each["phi_held"] == 4
        assert list(each["ties"]) == ([] if each["noise"] == "random" else ["upper", "lower", "alternate", "random"])
        assert sum(each["outcomes"].values()) == (4 if each["noise"] == "random" else 16)
    assert list(tmp_path.iterdir()) == []


def test_the_model_of_the_paper_has_no_bound(infoset: Infoset, brief_file: Path) -> None:
    for each in as_json(infoset, brief_file, *TWO, "--runs", 3, "--model", "paper")["strategies"]:
        assert 0 <= each["truth_kept"] <= 3
        assert each["phi_held"] is None


def test_the_figures_are_those_of_the_simulator_and_the_worst_tie_rule_counts(
    infoset: Infoset, brief: Scenario, brief_file: Path
) -> None:
    found = as_json(
        infoset, brief_file, "--strategies", "symmetric-miss", "--runs", 5, "--seed", 2, "--model", "paper"
    )["strategies"]
    assert found[0]["miss_m"] == summary(simulate(brief, 5, seed=2).miss_m)
    game = [simulate(replace(brief, noise=NoiseKind.GAME, tie=tie), 5, seed=2) for tie in TieRule]
    assert found[1]["miss_m"] == summary(np.max([each.miss_m for each in game], axis=0))
    assert found[1]["impulse_m_s"]["max"] == max(each.impulse_m_s.max() for each in game)
    assert found[1]["ties"]["lower"]["miss_m"] == summary(game[1].miss_m)


def test_compare_into_a_folder(infoset: Infoset, brief_file: Path, tmp_path: Path) -> None:
    asked = (brief_file, *TWO)
    assert infoset(*asked, "--runs", 3, "--out", "out", "--csv", "beside.csv", "--no-range-sensor")[0] == 0
    assert sorted(each.name for each in (tmp_path / "out").iterdir()) == FILES
    text = (tmp_path / "out" / "results.csv").read_text()
    assert text == (tmp_path / "beside.csv").read_text()
    rows = list(csv.DictReader(io.StringIO(text)))
    assert len(rows) == 2 * 5 * 3
    assert [row["tie"] for row in rows[:6:3]] == ["", "upper"]
    found = json.loads((tmp_path / "out" / "results.json").read_text())
    flown = load_scenario(tmp_path / "out" / "scenario.toml")
    assert flown.range_sensor is None
    assert found["scenario_hash"] == fingerprint(flown)
    worst = max(float(row["miss_m"]) for row in rows if (row["strategy"], row["noise"]) == ("patient", "game"))
    assert found["strategies"][3]["miss_m"]["max"] == worst

    code, _, err = infoset(*asked, "--runs", 1, "--out", "out")
    assert code == 2
    assert "--overwrite" in err
    assert (tmp_path / "out" / "results.csv").read_text() == text
    assert infoset(*asked, "--runs", 1, "--out", "out", "--overwrite", "-q")[0] == 0
    assert (tmp_path / "out" / "results.csv").read_text() != text


def test_the_strategies_of_a_comparison(infoset: Infoset, brief_file: Path) -> None:
    found = as_json(infoset, brief_file, "--runs", 1)["strategies"]
    assert [each["name"] for each in found[::2]] == strategy_names()


@pytest.fixture(scope="module")
def compared(brief: Scenario) -> list[Comparison]:
    strategies = dict.fromkeys(["symmetric-miss", "patient"])
    return comparisons({flight: simulate(flown, 6) for flight, flown in compared_scenarios(brief, strategies).items()})


def test_the_figure_shows_the_quantiles_of_every_strategy(compared: list[Comparison]) -> None:
    figure = draw_comparison(compared, 1.0)
    axes = figure.axes
    assert [each.get_text() for each in axes[0].get_yticklabels()] == ["symmetric-miss", "patient"]
    assert (axes[0].get_xlabel(), axes[2].get_xlabel()) == ("miss, m", "impulse spent, m/s")
    assert axes[0].get_xlim() == axes[1].get_xlim()
    assert axes[2].get_xlim() == axes[3].get_xlim()
    for panel, values in ((axes[1], compared[3].miss_m), (axes[3], compared[3].impulse_m_s)):
        ends = [(str(line.get_label()), *np.asarray(line.get_xydata())[0].tolist()) for line in panel.lines]
        marks = {label: value for label, value, height in ends if height > 1.0}
        assert marks["median"] == pytest.approx(np.median(values))
        assert marks["worst run"] == pytest.approx(values.max())
    radius = "body radius, 1 m: a smaller miss is a hit"
    assert [sum(line.get_label() == radius for line in each.lines) for each in axes] == [1, 1, 0, 0]
    assert all(np.max(line.get_xdata()) < each.get_xlim()[1] for each in axes for line in each.lines)


def test_misses_of_zero_can_be_drawn(compared: list[Comparison]) -> None:
    exact = [
        replace(each, results={tie: replace(r, miss_m=0.0 * r.miss_m) for tie, r in each.results.items()})
        for each in compared
    ]
    assert all(np.isfinite([*axes.get_xlim(), *axes.get_ylim()]).all() for axes in draw_comparison(exact).axes)
