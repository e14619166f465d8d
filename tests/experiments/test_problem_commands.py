"""What the commands of the problems have in common: files, trajectories, and one message for bad
input.
"""

from __future__ import annotations

import csv
import io
import math
from importlib import import_module
from importlib.metadata import version
from pathlib import Path

import pytest

from tests.experiments.command_line import Command, strict

STATE = ["x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s"]
CONTROL = ["ux_m_s2", "uy_m_s2", "uz_m_s2"]
SMALL_MAP = ("--x", "phase_deg=-9:-6:4", "--y", "evader.thrust_N=10:20:2")
COMMANDS = {
    "pareto.run": ("pareto", "pareto-2008"),
    "multipoint.run": ("multipoint", "service-2"),
    "reachability.run": ("reach", "rendezvous-2021", "--select", "energy"),
    "reachability.guarantee_report": ("reach", "approach-guaranteed", "--set", "periods=4"),
    "reachability.system": ("reach", "double-integrator"),
    "pursuit.run": ("pursuit", "leo-pursuit", "--feedback", "coast"),
    "pursuit.map": ("pursuit-map", "geo-pursuit", *SMALL_MAP),
    "observer.run": ("observe", "vehicle", "--smooth"),
}


@pytest.mark.parametrize("module", COMMANDS)
@pytest.mark.usefixtures("unrendered")
def test_the_folder_has_the_problem_the_results_and_the_figures(
    module: str, infoset: Command, tmp_path: Path
) -> None:
    command = import_module(f"infoset.experiments.{module}").COMMAND
    arguments = COMMANDS[module]
    pages = () if command.to_html is None else ("--html", "page.html")
    assert infoset(*arguments, "--out", "found", "--json", "x.json", *pages, "-q") == (0, "", "")
    figures = [f"{name}.{kind}" for name in command.figure_names for kind in ("pdf", "png")]
    names = sorted(each.name for each in (tmp_path / "found").iterdir())
    assert names == sorted(["problem.toml", "results.json", command.csv_name, *figures])
    results = (tmp_path / "found" / "results.json").read_text()
    assert results == (tmp_path / "x.json").read_text()
    found = strict(results)
    assert (found["versions"]["infoset"], found["problem"]) == (version("infoset"), arguments[1])
    assert pages == () or arguments[1] in (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "--overwrite" in infoset.refused(*arguments, "--json", "x.json")
    # The written problem is the same problem.
    again = strict(
        infoset(arguments[0], "found/problem.toml", *arguments[2:], "--json", "-", "-q")[1]
    )
    assert again == found


@pytest.mark.parametrize("command", [arguments[0] for arguments in COMMANDS.values()])
def test_unknown_problem_is_refused_with_one_message(
    command: str, infoset: Command, tmp_path: Path
) -> None:
    err = infoset.refused(command, "bad\x1b[31mname", "--json", "x.json")
    assert "built-in problem: there is no" in err
    assert "\x1b" not in err
    assert list(tmp_path.iterdir()) == []


def table(infoset: Command, *arguments: object) -> list[dict[str, str]]:
    code, out, _ = infoset(*arguments, "--csv", "-")
    assert code == 0
    return list(csv.DictReader(io.StringIO(out)))


def test_craft_meet_at_the_end(infoset: Command) -> None:
    rows = table(infoset, "pareto")
    assert list(rows[0]) == ["craft", "time_s", *STATE, *CONTROL]
    ends = [[float(row[name]) for name in STATE[:3]] for row in rows if row["time_s"] == "30.0"]
    assert ends[0] == pytest.approx(ends[1], abs=1e-9)
    assert ends[0] == pytest.approx(ends[2], abs=1e-9)


def test_the_chaser_is_where_the_targets_are_at_their_times(
    infoset: Command, tmp_path: Path
) -> None:
    rows = table(infoset, "multipoint", "service-3", "--json", "flown.json")
    at = {
        (row["craft"], float(row["time_s"])): [float(row[name]) for name in STATE[:3]]
        for row in rows
    }
    result = strict((tmp_path / "flown.json").read_text())
    for name, time_s in zip(result["order"], result["times_s"], strict=True):
        assert at["chaser", time_s] == pytest.approx(at[name, time_s], abs=1e-6)
    assert {row["ux_m_s2"] for row in rows if row["craft"] == "T1"} == {""}


def test_selected_controls_are_written_on_both_models(infoset: Command) -> None:
    rows = table(infoset, "reach", "--select", "energy,l1")
    assert list(rows[0]) == ["control", "model", "time_s", *STATE, *CONTROL]
    energy = [row for row in rows if (row["control"], row["model"]) == ("energy", "nonlinear")]
    assert [row["time_s"] for row in energy] == ["0.0", "180.0", "360.0", "540.0", "720.0"]
    assert math.hypot(*(float(energy[-1][name]) for name in STATE)) == pytest.approx(
        1.668, abs=1e-3
    )
    assert energy[-1]["ux_m_s2"] == ""
    assert max(abs(float(row["ux_m_s2"])) for row in energy[:-1]) <= 0.15


def test_both_players_are_at_the_capture(infoset: Command) -> None:
    rows = table(infoset, "pursuit")
    assert list(rows[0]) == [
        "player",
        "time_s",
        *STATE,
        "mass_kg",
        *(f"thrust_direction_{axis}" for axis in "xyz"),
    ]
    ends = {row["player"]: [float(row[name]) for name in STATE[:3]] for row in rows}
    assert math.dist(ends["pursuer"], ends["evader"]) < 1.0
    assert float(rows[-1]["time_s"]) == pytest.approx(45343.620266)
