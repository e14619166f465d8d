"""Studies use the guaranteed model unless another one is asked for."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from infoset import Model
from infoset.experiments.common.input_file import to_toml
from infoset.sim import Scenario
from infoset.sim.storage import read_manifest
from tests.experiments.command_line import Command

LINE = "model: guaranteed, the default of studies; to use that of the file, add --model paper\n"


@pytest.mark.parametrize(
    "line",
    [
        "campaign brief.toml --runs 4 --out {}",
        "sweep brief.toml --vary thruster.max_impulse_m_s=2:8:2 --runs 1 --out {}",
        "compare brief.toml --strategies patient --runs 2",
        "adversary brief.toml --budget 8",
    ],
    ids=lambda line: line.split()[0],
)
@pytest.mark.usefixtures("unrendered")
def test_the_default_model_is_the_guaranteed_one(
    infoset: Command, brief: Scenario, tmp_path: Path, line: str
) -> None:
    (tmp_path / "brief.toml").write_text(to_toml(brief))
    for name, chosen in {"guaranteed": [], "paper": ["--model", "paper"]}.items():
        code, out, err = infoset(*line.format(name).split(), *chosen, "--json", "-")
        assert (code, LINE in err) == (0, not chosen)
        if "--out" in line:
            assert read_manifest(tmp_path / name).scenario.information_set.model.value == name
        else:
            assert json.loads(out)["model"] == name


def test_a_resumed_folder_keeps_its_model(
    infoset: Command, brief_file: Path, tmp_path: Path
) -> None:
    asked = ("campaign", brief_file, "--chunk", 4, "--out", "runs")
    assert infoset(*asked, "--runs", 4, "--model", "paper")[0] == 0
    code, _, err = infoset(*asked, "--runs", 8, "--resume")
    assert (code, "model: " in err) == (0, False)
    assert read_manifest(tmp_path / "runs").scenario.information_set.model is Model.PAPER
    message = infoset(*asked, "--runs", 8, "--resume", "--model", "guaranteed")[2]
    assert 'scenario.information_set.model: "paper" in the folder, "guaranteed" now' in message
