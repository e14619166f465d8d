"""infoset adversary: what it writes, what it prints, what it refuses."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from infoset import Model
from infoset.experiments.common.input_file import to_toml
from infoset.experiments.common.screen import number
from infoset.experiments.interception.record_file import load_record
from infoset.experiments.interception.runs.shared import find_worst_misses
from infoset.experiments.interception.scenario_file import load_scenario, with_model
from infoset.sim import Scenario
from infoset.sim.adversary import WorstEngagement, find_worst
from infoset.sim.storage.codec import fingerprint
from infoset.sim.versions import versions
from tests.built_in import scenario_text
from tests.experiments.command_line import Command
from tests.space import in_space

pytestmark = pytest.mark.usefixtures("unrendered")

KEYS = [
    *(
        "versions",
        "scenario",
        "scenario_hash",
        "model",
        "range_sensor",
        "elapsed_s",
        "seed",
        "strategy",
        "objective",
    ),
    *("searched_accelerations_m_s2", "worst_of_search_set_kept_m", "worst_of_search_m"),
    *(
        "worst_any_state_miss_m",
        "worst_miss_m",
        "worst_miss_z_m",
        "outcome",
        "truth_kept",
        "evaluations",
        "record",
    ),
    *("found_from", "changes", "start", "history"),
]
BUDGET = 12


def test_the_worst_as_json_and_as_a_record_that_replays(infoset: Command, tmp_path: Path) -> None:
    code, out, err = infoset(
        "adversary",
        "--budget",
        BUDGET,
        "--seed",
        5,
        "--record",
        "worst.npz",
        "--json",
        "-",
        "--quiet",
    )
    assert (code, err) == (0, "")
    found: dict[str, Any] = json.loads(out)
    assert list(found) == KEYS
    scenario = with_model(load_scenario("asteroid-1997"), Model.GUARANTEED)
    assert found["versions"] == versions()
    assert (found["scenario"], found["scenario_hash"]) == (scenario.name, fingerprint(scenario))
    assert (found["seed"], found["evaluations"], found["record"]) == (5, BUDGET, "worst.npz")
    assert (found["strategy"], found["model"], found["range_sensor"]) == (
        "symmetric-miss",
        "guaranteed",
        True,
    )
    worst = find_worst(scenario, budget=BUDGET, seed=5)
    assert (found["objective"], found["searched_accelerations_m_s2"]) == ("any-state", {"z": 0.005})
    assert found["worst_any_state_miss_m"] == worst.value_m == found["history"][-1]["value_m"]
    assert found["worst_miss_m"] == worst.miss_m
    assert worst.value_m == found["worst_of_search_m"] >= found["worst_of_search_set_kept_m"]
    assert (
        found["worst_of_search_set_kept_m"]
        == find_worst(scenario, budget=BUDGET, seed=5, keep_set=True).value_m
    )
    assert list(found["start"].values()) == [*worst.start().values()]

    record = load_record(tmp_path / "worst.npz")
    assert float(record.result.miss_m[0]) == worst.miss_m
    assert record.noise == record.noise_name == "worst-found"
    assert record.result.position_m[0].tolist() == worst.result.position_m[0].tolist()
    assert record.scenario == worst.scenario
    code, out, _ = infoset("replay", "worst.npz", "--out", "figures")
    assert code == 0
    assert "worst-found + range sensor" in out
    assert sorted(each.name for each in (tmp_path / "figures").iterdir()) == [
        "figure-2-process.pdf",
        "figure-2-process.png",
        "figure-3-sets.pdf",
        "figure-3-sets.png",
        "figure-approach.pdf",
        "figure-approach.png",
    ]


def test_the_worst_in_space_as_json_table_and_record(
    infoset: Command, brief: Scenario, tmp_path: Path
) -> None:
    file = tmp_path / "space.toml"
    file.write_text(to_toml(in_space(brief)))
    code, out, _ = infoset(
        "adversary", file, "--budget", BUDGET, "--record", "worst.npz", "--json", "worst.json"
    )
    assert code == 0
    assert "initial y, z, x, km" in out
    assert "initial V_y, V_z, V_x, km/s" in out
    assert "miss along y, z, m" in out
    found = json.loads((tmp_path / "worst.json").read_text())
    across = ["worst_miss_y_m", "worst_miss_z_m"]
    assert [key for key in found if key != "worst_miss_y_m"] == KEYS
    assert list(found["start"]) == ["y_m", "z_m", "x_m", "vy_m_s", "vz_m_s", "vx_m_s"]
    record = load_record(tmp_path / "worst.npz")
    result = record.result
    assert float(result.miss_m[0]) == found["worst_miss_m"]
    assert result.lateral_miss_m[0].tolist() == [found[name] for name in across]
    assert [*result.position_m[0].tolist(), *result.velocity_m_s[0].tolist()] == [
        *found["start"].values()
    ]
    sensor = record.scenario.set_model.angle_sensor
    errors = np.abs(record.measured["angle"] - record.true_angle_rad)
    assert (errors <= sensor.error_bound(record.true_range_m)[:, None] * (1.0 + 1e-9)).all()


@pytest.mark.thorough
def test_adversary_with_fixed_truth_finds_the_misses_of_bound(
    infoset: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same strategy, seed, budget and model: bound and adversary print the same two numbers."""
    monkeypatch.setattr("infoset.sim.bound.lower_bound.PERIODS_LOOKED_AT", 1)  # few pairs
    monkeypatch.setattr("infoset.sim.bound.lower_bound.REFINEMENTS", 0)
    options = ("--budget", 24, "--model", "paper", "--json")
    same = ("--objective", "fixed-truth", *options)
    table = infoset("bound", "--strategies", "symmetric-miss", *options, "bound.json")[1]
    shown = infoset("adversary", "--strategy", "symmetric-miss", *same, "adversary.json")[1]
    (of_bound,) = json.loads(Path("bound.json").read_text())["strategies"]
    found = json.loads(Path("adversary.json").read_text())
    misses = [found[name] for name in ("worst_of_search_set_kept_m", "worst_of_search_m")]
    assert misses == [of_bound["worst_of_search_set_kept_m"], of_bound["worst_of_search_m"]]
    assert misses[0] < 60.0 < misses[1]
    assert misses[1] == of_bound["worst_found_m"]
    for miss in misses:
        assert f" {number(miss)} " in table
        assert number(miss) in shown.split()
    assert "the target of the scenario; objective: fixed-truth" in shown
    assert found["searched_accelerations_m_s2"] == {}
    assert "use --model guaranteed, whose set keeps the true state" in shown


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--budget", "0"], "--budget"),
        (["--record", "there.npz"], "there.npz: exists already"),
        (["--record", "-"], "only JSON, CSV and HTML can be printed"),
        (["asteroid-1997-single", "--range-sensor"], "has no [range_sensor]"),
    ],
)
def test_wrong_option_is_refused_before_the_search(
    arguments: list[str], message: str, infoset: Command
) -> None:
    Path("there.npz").write_text("something")
    assert message in infoset.refused("adversary", *arguments)
    assert Path("there.npz").read_text() == "something"


def test_search_with_kept_sets_has_no_result_if_every_set_becomes_empty(
    infoset: Command, tmp_path: Path
) -> None:
    text = scenario_text("asteroid-1997").replace(
        "vx_km_s = [-59.0, -57.0]", "vx_km_s = [-110.1, -110.0]"
    )
    file = tmp_path / "fast.toml"
    file.write_text(text.replace("vx_km_s = [-58.1, -57.9]", "vx_km_s = [-110.05, -110.0]"))
    options = ("adversary", file, "--model", "paper", "--budget", 2)
    found = infoset.json(*options)
    assert found["worst_of_search_set_kept_m"] is None
    assert found["worst_of_search_m"] == found["worst_any_state_miss_m"]

    _, out, _ = infoset(*options)
    assert ": 4 simulated engagements, " in out
    assert "the set became empty in 2 engagements of a search; their misses show" in out


def test_search_that_found_no_greater_miss_is_counted(
    brief: Scenario, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second search, with empty sets, has the same budget and another number of empty sets."""
    worst = find_worst(brief, budget=2)
    lesser = replace(worst, any_state_miss_m=0.5 * worst.any_state_miss_m, sets_emptied=2)

    def search(_scenario: Scenario, *, keep_set: bool, **_others: object) -> WorstEngagement:
        return replace(worst, sets_emptied=1) if keep_set else lesser

    monkeypatch.setattr("infoset.experiments.interception.runs.shared.find_worst", search)
    found = find_worst_misses(brief, None, budget=2, seed=0, begin=lambda _name: lambda _done: None)

    assert found.set_kept is found.overall
    assert found.evaluations == 4
    assert found.sets_emptied == 2
