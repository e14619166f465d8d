"""Causes of misses in commands: texts, files, requirements and remedies."""

from __future__ import annotations

import csv
import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest

from infoset import Model
from infoset.experiments.common.input_file import changed, to_toml
from infoset.experiments.interception.study import miss_text
from infoset.guidance import NoiseKind
from infoset.sim import Body, HitRequirement, MissCause, Scenario, estimate_hits, simulate
from infoset.sim.requirement import Decision, judge, parse_requirement
from tests.experiments.command_line import Command

RUNS = 50


@pytest.fixture
def weak(brief: Scenario, tmp_path: Path, infoset: Command) -> Scenario:
    """Starts of up to 200 m; the engine corrects about 100 m of them, and the body has a radius of
    12 m.
    """
    thruster = replace(brief.thruster, max_impulse_m_s=1.0)
    settings = replace(brief.information_set, model=Model.GUARANTEED)
    scenario = replace(
        brief, thruster=thruster, body=Body(12.0), information_set=settings, range_sensor=None
    )
    (tmp_path / "weak.toml").write_text(to_toml(scenario))
    return scenario


def counts(
    scenario: Scenario, noise: NoiseKind, runs: Sequence[int] = range(RUNS)
) -> dict[str, int]:
    causes = Counter(simulate(replace(scenario, noise=noise), runs, guarantee=False).causes)
    return {cause.value: causes[cause] for cause in MissCause}


def test_experiment_prints_causes_of_misses_and_remedies(
    infoset: Command, weak: Scenario, tmp_path: Path
) -> None:
    file = tmp_path / "weak.toml"
    code, out, _ = infoset(
        "experiment", file, "--runs", RUNS, "--remedy", "--json", "a.json", "--csv", "a.csv"
    )
    assert code == 0
    remedies = 0
    for curve in json.loads(Path("a.json").read_text())["curves"]:
        noise = NoiseKind(curve["noise"])
        expected = counts(weak, noise)
        assert {name: curve["missed"][name] for name in expected} == expected
        assert curve["missed"]["needed_m"] > curve["missed"]["corrected_m"] + 12.0
        assert miss_text(curve["missed"], RUNS, weak) in out
        with Path("a.csv").open() as rows:
            in_csv = Counter(
                row["cause"] for row in csv.DictReader(rows) if row["noise"] == noise.value
            )
        assert in_csv.pop("") == curve["hit"]["hits"]
        assert in_csv == Counter({name: count for name, count in expected.items() if count})
        for remedy in curve["remedies"]:
            if remedy["enough"] is None or remedy["key"] == "angle_sensor.scale":
                continue
            remedies += 1
            enough = changed(weak, {remedy["key"]: remedy["enough"]}, "enough")
            assert counts(enough, noise)[remedy["cause"]] == 0
            others = counts(enough, noise, range(RUNS, 2 * RUNS))
            assert remedy["missed"] == {name: count for name, count in others.items() if count}
            assert remedy["hits"]["hits"] == RUNS - sum(others.values())
            less = 0.98 * remedy["enough"] if remedy["not_enough"] is None else remedy["not_enough"]
            assert counts(changed(weak, {remedy["key"]: less}, "less"), noise)[remedy["cause"]] > 0
            assert (
                f"remedy for {remedy['cause']}: {remedy['key']} = {remedy['enough']:g} instead of"
                in out
            )
    assert remedies >= 3


def test_a_campaign_stores_and_reports_the_causes(
    infoset: Command, weak: Scenario, tmp_path: Path
) -> None:
    folder = tmp_path / "runs"
    assert infoset("campaign", tmp_path / "weak.toml", "--runs", RUNS, "--out", folder)[0] == 0
    stored = pd.read_parquet(folder / "shards")["cause"].value_counts()
    found = infoset.json("report", folder)
    (sample,), expected = found["samples"], counts(weak, NoiseKind.RANDOM)
    hits = estimate_hits(RUNS - sum(expected.values()), RUNS)
    assert (sample["hits"], sample["hit_lower"], sample["hit_upper"]) == (
        hits.hits,
        hits.lower,
        hits.upper,
    )
    assert all(worst["hit"] == (worst["miss_m"] <= 12.0) for worst in found["worst"])
    assert {name: sample[f"missed_{name}"] for name in expected} == expected
    assert stored[stored > 0].to_dict() == {
        name: count for name, count in expected.items() if count
    }
    _, out, _ = infoset("report", folder)
    assert f"random noise: missed {sum(expected.values())} of {RUNS} runs: " in out
    assert ", missed (engine): infoset engage" in out


def test_a_sweep_can_require_that_a_cause_does_not_occur(
    infoset: Command, weak: Scenario, tmp_path: Path
) -> None:
    options = (
        "--vary",
        "thruster.max_impulse_m_s=0.5:8:2",
        "--require",
        "no-engine>=0.9",
        "--out",
        "sweep",
    )
    code, out, _ = infoset("sweep", tmp_path / "weak.toml", *options, "--runs", RUNS)
    assert code == 0
    assert "random noise: no-engine>=0.9 is met in 1, not met in 1" in out
    cells = json.loads(Path("sweep/summary.json").read_text())["cells"]
    assert [cell["required_value"] for cell in cells] == [
        (RUNS - cell["missed_engine"]) / RUNS for cell in cells
    ]
    assert [cell["requirement"] for cell in cells] == ["not-met", "met"]


def test_a_required_absence_of_a_cause() -> None:
    required = parse_requirement("no-budget >= 0.8")
    assert required == HitRequirement(0.8, MissCause.BUDGET)
    assert str(required) == "no-budget>=0.8"
    column = pd.Series([None] * 90 + ["engine"] * 8 + ["budget"] * 2, dtype="category")
    verdict = judge(required.numbers(column), required, watched=False)
    assert (verdict.decision, verdict.value) == (Decision.MET, 0.98)
