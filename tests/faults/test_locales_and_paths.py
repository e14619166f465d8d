"""A locale whose decimals have a comma, and names of files that are hard on programs."""

from __future__ import annotations

import csv
import json
import locale
import shlex
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from experiments.interception.scenario_file import load_scenario
from sim import Scenario
from sim.storage import CampaignFolder
from tests.faults.conftest import Infoset, begin, ended, need_whole

pytestmark = pytest.mark.thorough

GERMAN = "de_DE.UTF-8"
ODD = ("with some spaces", "標的-🛰", 'quote\'s "and" $HOME', "-rf", "line\nbreak")


@pytest.fixture(scope="module")
def german(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The environment of a German, made here where the system has none."""
    if shutil.which("localedef") is None:
        pytest.skip("there is no localedef")
    folder = tmp_path_factory.mktemp("locales")
    command = ["localedef", "--no-archive", "-i", "de_DE", "-f", "UTF-8", str(folder / GERMAN)]
    if subprocess.run(command, capture_output=True, check=False).returncode != 0:
        pytest.skip("no German locale can be made here")
    return {"LOCPATH": str(folder), "LC_ALL": GERMAN, "LANG": GERMAN}


@pytest.fixture
def commas(german: dict[str, str], monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """This process in that locale, as by a library that sets it."""
    before = locale.setlocale(locale.LC_ALL)
    for name, value in german.items():
        monkeypatch.setenv(name, value)
    try:
        locale.setlocale(locale.LC_ALL, GERMAN)
    except locale.Error:
        pytest.skip("the German locale cannot be set in this process")
    assert locale.localeconv()["decimal_point"] == ","
    yield
    locale.setlocale(locale.LC_ALL, before)


def strip_time(text: str) -> str:
    return "\n".join(line for line in text.splitlines() if "elapsed_s" not in line)


def test_files_are_the_same_with_a_decimal_comma(
    infoset: Infoset, file: Path, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    asked = ("experiment", file, "--runs", 2, "-q")
    assert infoset(*asked, "--json", "plain.json", "--csv", "plain.csv").code == 0
    assert infoset("scenarios", "check", file).code == 0
    request.getfixturevalue("commas")
    assert infoset(*asked, "--json", "comma.json", "--csv", "comma.csv").code == 0
    assert (tmp_path / "comma.csv").read_bytes() == (tmp_path / "plain.csv").read_bytes()
    plain, comma = ((tmp_path / name).read_text() for name in ("plain.json", "comma.json"))
    assert strip_time(comma) == strip_time(plain)
    with (tmp_path / "comma.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 8
    assert all(float(row["miss_m"]) >= 0.0 for row in rows)


def test_every_file_of_a_command_in_a_german_process(
    german: dict[str, str], brief: Scenario, file: Path, tmp_path: Path
) -> None:
    flown = begin(
        "campaign", file, "--model", "paper", "--runs", 16, "--out", "runs", folder=tmp_path, environment=german
    )
    assert ended(flown).code == 0
    drawn = begin("report", "runs", "--out", "o", "--json", "-", folder=tmp_path, environment=german)
    assert json.loads(ended(drawn).out)["runs"] == 16
    assert load_scenario(tmp_path / "o" / "scenario.toml") == brief
    page = begin("pareto", "--html", "page.html", "--json", "p.json", "-q", folder=tmp_path, environment=german)
    assert ended(page).code == 0
    json.loads((tmp_path / "p.json").read_text())
    need_whole(tmp_path)


def hard_names() -> list[object]:
    """The hardest by default: 255 bytes, the most that a name may have."""
    hardest = f"{'n' * 240} Ünï-цель"
    assert len(hardest.encode()) == 255
    return [hardest, *(pytest.param(each, marks=pytest.mark.thorough) for each in ODD)]


@pytest.mark.parametrize("name", hard_names())
def test_a_folder_of_any_name(name: str, infoset: Infoset, file: Path, tmp_path: Path) -> None:
    home = tmp_path / name
    home.mkdir()
    scenario = home / "an approach, brief.toml"
    shutil.copy(file, scenario)
    done = infoset("engage", scenario, "--record", home / "flight.npz", "--json", home / "r.json")
    assert (done.code, done.err) == (0, f"wrote r.json, flight.npz in {home}\n")
    assert infoset("replay", home / "flight.npz", "--html", home / "page.html").code == 0
    assert infoset("campaign", scenario, "--runs", 8, "--out", home / "runs", "-q").code == 0
    assert CampaignFolder.read(home / "runs").complete
    need_whole(home)
    replay = json.loads(infoset("report", home / "runs", "--json", "-").out)["worst"][0]["replay"]
    program, *arguments = shlex.split(replay)
    assert program == "infoset"
    assert infoset(*arguments, "-q").code == 0


@pytest.mark.parametrize("name", ["n" * 256, "a/" * 2100])
def test_a_name_that_cannot_be(name: str, infoset: Infoset, file: Path, tmp_path: Path) -> None:
    for option in ("--out", "--json"):
        left = infoset("engage", file, option, f"{name}.json", "-q")
        assert (left.code, left.out) == (2, "")
        assert left.err.startswith("error: ")
        assert left.err.count("\n") == 1
    assert infoset("engage", f"{name}.toml").code == 2
    assert [each.name for each in tmp_path.iterdir()] == ["brief.toml"]
