"""Studies use the guaranteed model unless another one is asked for."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from experiments import load_scenario
from experiments.common.input_file import to_toml
from infoset import Model
from sim import Scenario
from sim.storage import read_manifest

Infoset = Callable[..., tuple[int, str, str]]
LINE = "model: guaranteed, the default of studies; to use that of the file, add --model paper\n"
VARY = (
    "--vary",
    "thruster.max_impulse_m_s=2:8:2,thruster.min_impulse_m_s=0.1:0.2:2,angle_sensor.scale=1:2:2",
)
"""Three keys, which have no figure."""


def model_of(command: str, out: str, tmp_path: Path) -> str:
    """Model that a command reports."""
    if command in ("campaign", "sweep"):
        return read_manifest(tmp_path / "runs").scenario.information_set.model.value
    return str(json.loads(out)["model"])


@pytest.mark.parametrize(
    "arguments",
    [
        ("campaign", "--runs", 4, "--out", "runs"),
        ("sweep", *VARY, "--runs", 1, "--out", "runs"),
        ("compare", "--strategies", "patient", "--runs", 2),
        ("adversary", "--budget", 8),
    ],
    ids=lambda arguments: arguments[0],
)
def test_the_default_model_is_the_guaranteed_one(
    infoset: Infoset, brief_file: Path, tmp_path: Path, arguments: tuple[str, ...]
) -> None:
    """On commit 652bf7c the model is that of the file."""
    command, *others = arguments
    code, out, err = infoset(command, brief_file, *others, "--json", "-")
    assert code == 0
    assert err.count(LINE) == 1
    assert model_of(command, out, tmp_path) == "guaranteed"
    for chosen in (("--model", "paper"), ("--set", "information_set.model=paper")):
        shutil.rmtree(tmp_path / "runs", ignore_errors=True)
        code, out, err = infoset(command, brief_file, *others, *chosen, "--json", "-")
        assert (code, LINE in err) == (0, False)
        assert model_of(command, out, tmp_path) == "paper"
    shutil.rmtree(tmp_path / "runs", ignore_errors=True)
    assert LINE not in infoset(command, brief_file, *others, "--model", "guaranteed")[2]
    shutil.rmtree(tmp_path / "runs", ignore_errors=True)
    assert infoset(command, brief_file, *others, "--quiet") == (0, "", "")


def test_experiment_and_engage_keep_the_model_of_the_file(infoset: Infoset, brief_file: Path) -> None:
    for command, others in (("experiment", ("--runs", 2)), ("engage", ())):
        code, out, err = infoset(command, brief_file, *others)
        assert (code, err) == (0, "")
        assert "the paper's Phi (not a bound here)" in out.replace("\n", " ") or "paper's" in out


def test_a_new_scenario_has_the_guaranteed_model(infoset: Infoset, tmp_path: Path) -> None:
    assert infoset("scenarios", "new", "mine.toml")[0] == 0
    assert load_scenario(tmp_path / "mine.toml").information_set.model is Model.GUARANTEED
    assert load_scenario("asteroid-1997").information_set.model is Model.PAPER


@pytest.mark.parametrize("command", ["campaign", "compare", "experiment"])
def test_a_scenario_outside_the_conditions_of_the_model_is_refused(
    infoset: Infoset, brief: Scenario, tmp_path: Path, command: str
) -> None:
    """`--model guaranteed` was a traceback here."""
    text = to_toml(brief).replace("vx_m_s = [-58000.0, -57500.0]", "vx_m_s = [-130e3, -57.5e3]", 1)
    (tmp_path / "wide.toml").write_text(text)
    others = ("--runs", 2, *(("--out", "runs") if command == "campaign" else ()))
    code, _, err = infoset(command, "wide.toml", *others, "--model", "guaranteed")
    assert code == 2
    assert err.startswith("error: brief with --model guaranteed: SetModel: the guaranteed model needs a closing speed")
    code, _, err = infoset(command, "wide.toml", *others)
    if command == "experiment":
        assert code == 0
    else:
        assert code == 2
        assert err.endswith("; or choose the model of the file with --model paper\n")


def test_a_resumed_folder_keeps_its_model(infoset: Infoset, brief_file: Path, tmp_path: Path) -> None:
    asked = ("campaign", brief_file, "--chunk", 4, "--out", "runs")
    assert infoset(*asked, "--runs", 4, "--model", "paper")[0] == 0
    code, out, err = infoset(*asked, "--runs", 8, "--resume")
    assert (code, "model: " in err) == (0, False)
    assert read_manifest(tmp_path / "runs").scenario.information_set.model is Model.PAPER
    assert "8 runs" in out
    code, _, err = infoset(*asked, "--runs", 8, "--resume", "--model", "guaranteed")
    assert code == 2
    assert 'scenario.information_set.model: "paper" in the folder, "guaranteed" now' in err
    code, _, err = infoset(*asked, "--runs", 8, "--resume", "--set", "information_set.model=guaranteed")
    assert code == 2


def test_a_folder_of_another_model_than_the_file_is_resumed(
    infoset: Infoset, brief: Scenario, brief_file: Path, tmp_path: Path
) -> None:
    asked = ("campaign", "mine.toml", "--chunk", 4, "--out", "runs")
    text = to_toml(brief)
    (tmp_path / "mine.toml").write_text(text.replace('"paper"', '"guaranteed"').replace('"rectangle"', '"box"'))
    assert infoset(*asked, "--runs", 4, "--model", "paper")[0] == 0
    code, _, err = infoset(*asked, "--runs", 8, "--resume")
    assert code == 0
    assert "model: paper, the model of the resumed folder; the scenario file has guaranteed\n" in err
