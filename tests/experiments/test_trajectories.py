"""``--csv`` of the rendezvous problems: trajectories in one table, units in the headings."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Callable
from pathlib import Path

import pytest

Infoset = Callable[..., tuple[int, str, str]]
STATE = ["x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s"]
CONTROL = ["ux_m_s2", "uy_m_s2", "uz_m_s2"]


def table(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


def test_craft_meet_at_the_end(infoset: Infoset) -> None:
    code, out, _ = infoset("pareto", "--csv", "-", "--samples", "5")
    rows = table(out)
    assert code == 0
    assert list(rows[0]) == ["craft", "time_s", *STATE, *CONTROL]
    assert [row["craft"] for row in rows] == [name for name in ("first", "second", "third") for _ in range(5)]
    ends = [[float(row[name]) for name in STATE[:3]] for row in rows if row["time_s"] == "30.0"]
    assert ends[0] == pytest.approx(ends[1], abs=1e-9)
    assert ends[0] == pytest.approx(ends[2], abs=1e-9)


def test_the_chaser_is_where_the_targets_are_at_their_times(infoset: Infoset, tmp_path: Path) -> None:
    assert infoset("multipoint", "service-3", "--csv", "flown.csv", "--json", "flown.json", "-q")[0] == 0
    rows = table((tmp_path / "flown.csv").read_text())
    at = {(row["craft"], float(row["time_s"])): [float(row[name]) for name in STATE[:3]] for row in rows}
    result = json.loads((tmp_path / "flown.json").read_text())
    for name, time_s in zip(result["order"], result["times_s"], strict=True):
        assert at["chaser", time_s] == pytest.approx(at[name, time_s], abs=1e-6)
    assert {row["ux_m_s2"] for row in rows if row["craft"] == "T1"} == {""}


def test_selected_controls_are_written_on_both_models(infoset: Infoset) -> None:
    code, out, _ = infoset("reach", "--select", "energy,l1", "--csv", "-")
    rows = table(out)
    assert code == 0
    assert list(rows[0]) == ["control", "model", "time_s", *STATE, *CONTROL]
    energy = [row for row in rows if (row["control"], row["model"]) == ("energy", "nonlinear")]
    assert [row["time_s"] for row in energy] == ["0.0", "180.0", "360.0", "540.0", "720.0"]
    assert math.hypot(*(float(energy[-1][name]) for name in STATE)) == pytest.approx(1.668, abs=1e-3)
    assert energy[-1]["ux_m_s2"] == ""
    assert max(abs(float(row["ux_m_s2"])) for row in energy[:-1]) <= 0.15


def test_both_players_are_at_the_capture(infoset: Infoset) -> None:
    code, out, _ = infoset("pursuit", "--csv", "-")
    rows = table(out)
    assert code == 0
    assert list(rows[0]) == ["player", "time_s", *STATE, "mass_kg", *(f"thrust_direction_{axis}" for axis in "xyz")]
    ends = {row["player"]: [float(row[name]) for name in STATE[:3]] for row in rows}
    assert math.dist(ends["pursuer"], ends["evader"]) < 1.0
    assert float(rows[-1]["time_s"]) == pytest.approx(45343.620266)


def test_there_is_no_table_without_a_trajectory(infoset: Infoset) -> None:
    code, _, err = infoset("pursuit", "--set", "evader.thrust_N=20", "--csv", "none.csv")
    assert code == 2
    assert err.startswith("error: --csv: there is no trajectory to show")
