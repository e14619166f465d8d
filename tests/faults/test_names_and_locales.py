"""A locale whose decimals have a comma, and difficult names of files."""

from __future__ import annotations

import json
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest

from infoset.experiments.interception.scenario_file import load_scenario
from infoset.sim import Scenario
from infoset.sim.storage import CampaignFolder
from tests.experiments.command_line import Command
from tests.faults.conftest import begin, ended, need_whole

pytestmark = pytest.mark.thorough

GERMAN = "de_DE.UTF-8"
LONGEST = f"{'n' * 240} Ünï-цель"
"""A name of 255 bytes, the maximum."""


def test_files_are_the_same_with_a_decimal_comma(
    brief: Scenario, file: Path, tmp_path: Path
) -> None:
    if shutil.which("localedef") is None:
        pytest.skip("there is no localedef")
    make = ["localedef", "--no-archive", "-i", "de_DE", "-f", "UTF-8", str(tmp_path / GERMAN)]
    if subprocess.run(make, capture_output=True, check=False).returncode != 0:
        pytest.skip("no German locale can be made here")
    german = {"LOCPATH": str(tmp_path), "LC_ALL": GERMAN, "LANG": GERMAN}
    commands = (
        ("experiment", file, "--runs", 2, "--csv", "{}.csv"),
        ("pareto", "--html", "{}.html", "--csv", "{}-craft.csv"),
    )
    for command in commands:
        for name, environment in (("plain", {}), ("comma", german)):
            words = [str(word).format(name) for word in command]
            assert ended(begin(*words, "-q", folder=tmp_path, environment=environment)).code == 0
    for kind in (".csv", "-craft.csv", ".html"):
        assert (tmp_path / f"comma{kind}").read_bytes() == (tmp_path / f"plain{kind}").read_bytes()


@pytest.mark.parametrize(
    "name",
    [LONGEST, "with some spaces", "標的-🛰", 'quote\'s "and" $HOME', "-rf", "line\nbreak"],
    ids=ascii,
)
def test_folder_of_any_name_works(
    name: str, infoset: Command, file: Path, brief: Scenario, tmp_path: Path
) -> None:
    home = tmp_path / name
    home.mkdir()
    scenario = home / "an approach, brief.toml"
    shutil.copy(file, scenario)
    code, _, err = infoset(
        "engage", scenario, "--record", home / "flight.npz", "--json", home / "r.json"
    )
    assert (code, err) == (0, f"wrote r.json, flight.npz in {home}\n")
    assert infoset("replay", home / "flight.npz", "--html", home / "page.html")[0] == 0
    assert (
        infoset(
            "campaign", scenario, "--runs", 8, "--model", "paper", "--out", home / "runs", "-q"
        )[0]
        == 0
    )
    assert CampaignFolder.read(home / "runs").complete
    assert load_scenario(home / "runs" / "scenario.toml") == brief
    need_whole(home)
    program, *arguments = shlex.split(
        json.loads(infoset("report", home / "runs", "--json", "-")[1])["worst"][0]["replay"]
    )
    assert program == "infoset"
    assert infoset(*arguments, "-q")[0] == 0


@pytest.mark.parametrize("name", ["n" * 256, "a/" * 2100], ids=["long", "deep"])
def test_file_name_that_cannot_exist_is_refused(name: str, infoset: Command, file: Path) -> None:
    for option in ("--out", "--json"):
        infoset.refused("engage", file, option, f"{name}.json", "-q")
    infoset.refused("engage", f"{name}.toml")
