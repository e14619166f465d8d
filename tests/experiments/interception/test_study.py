"""What studies say about sets and hits next to their quantiles."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from infoset import Model
from infoset.experiments import load_scenario
from infoset.experiments.common.input_file import to_toml
from infoset.experiments.interception.scenario_file import with_model
from infoset.experiments.interception.study import (
    SetCounts,
    hit_text,
    percent,
    set_counts,
    set_warnings,
)
from infoset.model import SetSettings
from infoset.sim import Body, Scenario, estimate_hits, simulate

pytestmark = pytest.mark.usefixtures("unrendered")

Infoset = Callable[..., tuple[int, str, str]]
KEYS = ["runs", "hits", "probability", "lower", "upper"]
WARNING = (
    "the quantiles include these failures of the model; for quantiles without them, use --model "
    "guaranteed"
)


@pytest.fixture
def sized(brief: Scenario, tmp_path: Path) -> Path:
    file = tmp_path / "sized.toml"
    file.write_text(to_toml(replace(brief, body=Body(10.0))))
    return file


def test_lost_sets_of_a_better_range_sensor_have_a_warning_in_the_model_paper(
    infoset: Infoset,
) -> None:
    """On commit 652bf7c nothing tells the two apart: the quantiles of the better meter are those of
    emptied sets.
    """
    published = load_scenario("asteroid-1997")

    def p99(model: Model, error: float) -> tuple[float, int]:
        meter = (
            replace(published.range_sensor, relative_error=error)
            if published.range_sensor is not None
            else None
        )
        flown = simulate(
            with_model(replace(published, range_sensor=meter), model), 20, guarantee=False
        )
        return float(np.quantile(flown.miss_m, 0.99)), int(flown.set_emptied.sum())

    good = p99(Model.PAPER, 0.01)
    poor = p99(Model.PAPER, 0.1)
    assert good[0] > 3.0 * poor[0]
    assert good[1] == 15
    assert p99(Model.GUARANTEED, 0.01)[0] < 1.1 * p99(Model.GUARANTEED, 0.1)[0]

    asked = ("campaign", "--runs", 20, "--set", "range_sensor.relative_error=0.01", "--out")
    code, out, _ = infoset(*asked, "paper", "--model", "paper")
    assert code == 0
    assert "set became empty: 15 of 20 runs (75 %)" in out
    assert "warning: model paper: in " in out
    assert WARNING in out
    code, out, _ = infoset(*asked, "default")
    assert code == 0
    assert (
        "true state inside the set at every step: 20 of 20 runs (100 %); set became empty: 0 "
        "of 20 runs (0 %)"
    ) in out
    assert "warning" not in out


def test_the_json_of_an_experiment_has_its_hits(
    infoset: Infoset, sized: Path, tmp_path: Path
) -> None:
    code, out, _ = infoset("experiment", sized, "--runs", 5, "--json", "-", "--csv", "all.csv")
    assert code == 0
    with (tmp_path / "all.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    for curve in json.loads(out)["curves"]:
        expected = estimate_hits(sum(miss <= 10.0 for miss in curve["miss_m"]), 5)
        assert list(curve["hit"]) == KEYS
        case = curve["noise"], str(curve["range_sensor"]).lower()
        assert curve["hit"] == vars(expected)
        own = [row for row in rows if (row["noise"], row["range_sensor"]) == case]
        assert [row["hit"] == "true" for row in own] == [
            float(row["miss_m"]) <= 10.0 for row in own
        ]


@pytest.mark.parametrize(("radius", "word"), [(1e5, "hit"), (1e-6, "missed")])
def test_engage_prints_whether_the_body_is_hit(
    infoset: Infoset, sized: Path, radius: float, word: str
) -> None:
    size = ("--set", f"body.radius_m={radius}", "--no-range-sensor")
    code, out, _ = infoset("engage", sized, *size, "--record", "one.npz", "--out", "out")
    assert code == 0
    assert f"arrived, {word}" in out
    assert json.loads(Path("out/results.json").read_text())["hit"] is (word == "hit")
    code, out, _ = infoset("replay", "one.npz", "--html", "page.html")
    assert code == 0
    assert f"arrived, {word}" in out
    assert f" m/s, {word}" in Path("page.html").read_text()


def test_set_counts_add_up() -> None:
    kept = np.array([True, True, False, False])
    emptied = np.array([False, True, False, True])
    counts = set_counts(kept, emptied)
    assert counts == SetCounts(4, 2, 2, 3)
    assert counts + SetCounts(6, 6, 0, 0) == SetCounts(10, 8, 2, 3)
    paper = SetSettings(model=Model.PAPER)
    assert set_warnings(paper, SetCounts(5, 5, 0, 0)) == []
    assert len(set_warnings(paper, counts)) == len(set_warnings(SetSettings(), counts)) == 1


def test_warning_of_a_set_that_allows_for_wrong_images_says_that_more_can_be_wrong() -> None:
    (line,) = set_warnings(SetSettings(wrong_images=2), SetCounts(5, 4, 1, 1))
    assert "more wrong images than information_set.wrong_images, 2, or the noise exceeds" in line


def test_percent_rounds_only_the_share_one_to_100(brief: Scenario) -> None:
    assert [percent(share) for share in (0.0, 0.5, 1.0, 1e-9)] == [
        "0 %",
        "50 %",
        "100 %",
        "1e-07 %",
    ]
    assert percent(1.0 - 1e-6) == "99.9999 %"
    text = hit_text(estimate_hits(187, 200), replace(brief, body=Body(80.0)))
    assert text == "hit (miss at most 80 m): 187 of 200 runs (93.5 %), 95 % CI 89.14 % to 96.49 %"
    assert hit_text(None, brief) == ""
