"""What --out writes: the numbers of --json and --csv, figures, and the scenario that was
simulated.
"""

from __future__ import annotations

import csv
import io
from pathlib import Path

import pytest

from infoset.experiments.interception.scenario_file import load_scenario
from infoset.sim.storage.codec import fingerprint
from tests.experiments.command_line import Command, strict

TIE_AND_SECTIONS = ("--set", "tie=lower", "--set", "information_set.sections=9")
STUDIES = {
    "experiment": (
        ("--runs", 2, *TIE_AND_SECTIONS),
        ["distributions", "corridor"],
        ["results.csv"],
    ),
    "compare": (
        ("--runs", 2, "--strategies", "symmetric-miss,patient", "--no-range-sensor"),
        ["comparison"],
        ["results.csv"],
    ),
    "adversary": (
        ("--budget", 6, "--no-range-sensor"),
        ["process", "sets", "approach"],
        ["record-worst.npz", "steps.csv"],
    ),
}


@pytest.mark.parametrize("command", STUDIES)
@pytest.mark.usefixtures("unrendered")
def test_folder_of_a_study_has_all_its_files(
    command: str, infoset: Command, brief_file: Path
) -> None:
    options, figures, files = STUDIES[command]
    asked = (command, brief_file, *options, "--out", "out")
    assert infoset(*asked, "--json", "beside.json", "-q")[0] == 0
    drawn = [f"figure-{name}.{kind}" for name in figures for kind in ("pdf", "png")]
    assert sorted(each.name for each in Path("out").iterdir()) == sorted(
        [*drawn, *files, "results.json", "scenario.toml"]
    )
    text = Path("out/results.json").read_text()
    assert text == Path("beside.json").read_text()
    found = strict(text)
    flown = load_scenario(Path("out/scenario.toml"))
    assert found["scenario_hash"] == fingerprint(flown)
    assert (flown.range_sensor is None) == ("--no-range-sensor" in options)
    rows = list(csv.DictReader(io.StringIO((Path("out") / files[-1]).read_text())))
    if command == "experiment":
        assert (flown.tie.value, flown.set_model.sections) == ("lower", 9)
        assert [float(row["miss_m"]) for row in rows] == [
            miss for curve in found["curves"] for miss in curve["miss_m"]
        ]
    if command == "compare":
        assert len(rows) == 2 * 5 * 2  # two strategies, random noise and four tie rules, two runs
        worst = max(
            float(row["miss_m"])
            for row in rows
            if (row["strategy"], row["noise"]) == ("patient", "game")
        )
        assert found["strategies"][3]["miss_m"]["max"] == worst
    assert "exists already" in infoset.refused(*asked)
