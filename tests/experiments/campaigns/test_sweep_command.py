from __future__ import annotations

import itertools
import json
import math
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.campaigns.sweep_axes import sweep_axes, sweep_cells
from experiments.campaigns.sweep_figures import between, draw_sweep
from experiments.campaigns.sweep_table import SHOWN, crossings, key_label, sweep_table, unit_of, where_met
from experiments.interception.scenario_file import load_scenario, scenario_hash, scenario_to_toml
from sim import CampaignNoise, QuantileName, Requirement, Scenario, Sweep, quantiles, simulate
from sim.storage import Axis, CampaignFolder

Infoset = Callable[..., tuple[int, str, str]]
FILES = [
    *(".lock", "figure-sweep.pdf", "figure-sweep.png", "manifest.json", "scenario.toml", "shards", "summary.json"),
    "sweep.parquet",
]
TWO = "angle_sensor.error_at_zero_range_rad=1e-4:4e-4:3,thruster.greatest_impulse_m_s=log:2:8:2"


@pytest.fixture
def file(brief: Scenario, tmp_path: Path, infoset: Infoset) -> Path:
    path = tmp_path / "brief.toml"
    path.write_text(scenario_to_toml(brief))
    return path


@pytest.fixture(scope="module")
def swept(brief: Scenario, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sweep that no command has flown: manifest and shards only."""
    folder = tmp_path_factory.mktemp("sweep") / "two"
    axes = sweep_axes(TWO, brief)
    Sweep(brief, axes, sweep_cells(brief, axes), 20, folder).run()
    return folder


def test_a_sweep_of_two_keys(infoset: Infoset, brief: Scenario, file: Path, tmp_path: Path) -> None:
    folder = tmp_path / "sweep"
    code, out, err = infoset("sweep", file, "--vary", TWO, "--runs", 30, "--out", folder, "--seed", 2)
    assert code == 0
    assert (
        f"wrote shards, scenario.toml, sweep.parquet, figure-sweep.pdf, figure-sweep.png, summary.json in {folder}"
        in err
    )
    assert sorted(each.name for each in folder.iterdir()) == FILES
    table = pq.read_table(folder / "sweep.parquet")
    assert table.num_rows == 6
    errors, impulses = (table.column(name).to_pylist() for name in table.column_names[1:3])
    assert list(zip(errors, impulses, strict=True)) == list(itertools.product((1e-4, 2.5e-4, 4e-4), (2.0, 8.0)))
    units = {field.name: field.metadata[b"unit"].decode() for field in table.schema}
    assert (units["angle_sensor.error_at_zero_range_rad"], units["thruster.greatest_impulse_m_s"]) == ("rad", "m/s")
    assert (units["miss_m_p99"], units["impulse_m_s_p99_lower"], units["runs"]) == ("m", "m/s", "")
    rows = table.to_pylist()
    for row in rows:
        sensor = replace(
            brief.set_model.angle_sensor, error_at_zero_range_rad=row["angle_sensor.error_at_zero_range_rad"]
        )
        cell = replace(
            brief,
            set_model=replace(brief.set_model, angle_sensor=sensor),
            thruster=replace(brief.thruster, greatest_impulse_m_s=row["thruster.greatest_impulse_m_s"]),
        )
        flown = simulate(cell, 30, seed=2)
        assert row["runs"] == 30
        assert row["miss_m_p99"] == quantiles(flown.miss_m, 0.99)
        assert row["impulse_m_s_p50"] == quantiles(flown.impulse_m_s, 0.5)
        assert row["miss_m_max"] == flown.miss_m.max()
        assert row["miss_m_p99_upper"] is None
        assert row["miss_m_p50_lower"] in flown.miss_m
        assert row["truth_kept"] == int(flown.truth_kept.sum())
        assert row["intercepted"] + row["set_lost"] + row["budget_spent"] + row["diverged"] == 30
    found = json.loads((folder / "summary.json").read_text())
    assert (found["kind"], found["scenario_hash"], found["runs"]) == ("sweep", scenario_hash(brief), 180)
    assert [each["unit"] for each in found["axes"]] == ["rad", "m/s"]
    assert [each["at"] for each in found["answers"]] == [f"thruster.greatest_impulse_m_s = {each}" for each in (2, 8)]
    assert all(each["met"] in out for each in found["answers"])


def test_a_sweep_of_one_key_mixed_and_resumed(infoset: Infoset, file: Path, tmp_path: Path) -> None:
    asked = ("sweep", file, "--vary", "thruster.greatest_impulse_m_s=2:8:4", "--runs", 20, "--noise", "mixed")
    code, out, _ = infoset(*asked, "--out", tmp_path / "a", "--require", "miss_m p90<3")
    assert code == 0
    assert out.count("noise: miss_m p90<3 is met for these values of thruster.greatest_impulse_m_s:") == 2
    table = pq.read_table(tmp_path / "a" / "sweep.parquet")
    assert table.column("noise").to_pylist() == ["random", "game"] * 4
    assert set(table.column("runs").to_pylist()) == {10}
    before = (tmp_path / "a" / "sweep.parquet").read_bytes()
    for victim in list((tmp_path / "a" / "shards").glob("*.parquet"))[1:3]:
        victim.unlink()
    assert infoset(*asked, "--out", tmp_path / "a", "--resume", "-q") == (0, "", "")
    assert (tmp_path / "a" / "sweep.parquet").read_bytes() == before
    code, _, err = infoset(*asked[:3], "thruster.greatest_impulse_m_s=2:9:4", *asked[4:], "--out", "a", "--resume")
    assert code == 2
    assert "axes: " in err
    assert "cells_hash" in err


def test_the_report_of_a_sweep_is_from_its_files_alone(infoset: Infoset, swept: Path, tmp_path: Path) -> None:
    code, out, _ = infoset("report", swept, "--out", tmp_path / "report", "--require", "impulse_m_s p50<60")
    assert code == 0
    assert "impulse_m_s p50<60 is met for these values of angle_sensor.error_at_zero_range_rad:" in out
    names = ["figure-sweep.pdf", "figure-sweep.png", "report.json", "scenario.toml", "sweep.parquet"]
    assert sorted(each.name for each in (tmp_path / "report").iterdir()) == names
    assert pq.read_table(tmp_path / "report" / "sweep.parquet").num_rows == 6
    assert load_scenario(tmp_path / "report" / "scenario.toml").name == "brief"


def test_three_keys_are_a_table_only(infoset: Infoset, file: Path, tmp_path: Path) -> None:
    three = f"{TWO},information_set.sections=3:5:2"
    code, _, err = infoset("sweep", file, "--vary", three, "--runs", 2, "--out", tmp_path / "sweep")
    assert code == 0
    assert "a figure can show one or two keys only" in err
    assert sorted(each.name for each in (tmp_path / "sweep").iterdir()) == [
        each for each in FILES if not each.startswith("figure")
    ]
    assert pq.read_table(tmp_path / "sweep" / "sweep.parquet").num_rows == 12


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["--vary", "thruster.budget=1:2:2"], ["did you mean thruster.budget_m_s?"]),
        (["--vary", "thruster.greatest_impulse_m_s=0.01:5:3"], ["brief with thruster.greatest_impulse_m_s = 0.01"]),
        (["--runs", 0], ["--runs", "greater than or equal to 1"]),
        (["--require", "miss_m<10"], ["--require: must be a quantity, a quantile and a bound"]),
        (["--show", "miss_m p99,fuel p50"], ["--show: there is no quantity fuel"]),
        (["--show", ",".join(f"miss_m p{each}" for each in range(1, 20))], ["--show: at most 8"]),
        (["--noise", "loud"], ["--noise"]),
        (["--dask", "nowhere"], ["--dask"]),
        (["--runs", 300_000], ["6 cells of 300000 runs are 1800000 engagements", "give --yes"]),
    ],
)
def test_what_is_wrong_is_said_before_the_work(
    arguments: list[str],
    parts: list[str],
    infoset: Infoset,
    file: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("sim.flights.fly_chunk", lambda *_: pytest.fail("began to work"))
    given = {"--vary": TWO, "--runs": 10, "--out": "sweep"} | dict(zip(arguments[::2], arguments[1::2], strict=True))
    code, out, err = infoset("sweep", file, *[part for pair in given.items() for part in pair])
    assert (code, out) == (2, "")
    assert err.count("error: ") + err.count("─ Error ─") == 1
    for part in parts:
        assert part in err
    assert [each.name for each in tmp_path.iterdir()] == ["brief.toml"]


@pytest.mark.parametrize("answer", ["y\n", "n\n"])
def test_a_large_sweep_asks_on_a_terminal(
    answer: str, infoset: Infoset, file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Begun(Exception):  # noqa: N818
        pass

    class Terminal:
        def isatty(self) -> bool:
            return True

        def readline(self) -> str:
            return answer

    def begin(*_: object, **__: object) -> None:
        raise Begun

    asked = ("sweep", file, "--vary", TWO, "--runs", 300_000, "--out", tmp_path / "sweep", "--workers", 1)
    monkeypatch.setattr("sim.Sweep.run", begin)
    with pytest.raises(Begun):
        infoset(*asked, "--yes")
    questions = []

    def confirm(text: str, **_: object) -> bool:
        questions.append(text)
        return answer == "y\n"

    monkeypatch.setattr("typer.confirm", confirm)
    monkeypatch.setattr("sys.stdin", Terminal())
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    if answer == "y\n":
        with pytest.raises(Begun):
            infoset(*asked)
    else:
        assert infoset(*asked)[0] == 2
    assert questions == ["6 cells of 300000 runs are 1800000 engagements, more than a million. Continue?"]


def test_where_a_quantile_crosses_its_bound_by_hand() -> None:
    assert crossings((1.0, 2.0, 4.0), (5.0, 15.0, 5.0), 10.0, "linear") == [1.5, 3.0]
    assert crossings((1.0, 100.0), (5.0, 15.0), 10.0, "log") == pytest.approx([10.0])
    assert crossings((1.0, 2.0, 3.0), (5.0, None, 15.0), 10.0, "linear") == []
    axis = Axis("a", (1.0, 2.0, 4.0))
    assert where_met(axis, (5.0, 15.0, 25.0), 10.0) == "up to 1.5"
    assert where_met(axis, (15.0, 5.0, 5.0), 10.0) == "from 1.5"
    assert where_met(axis, (5.0, 15.0, 5.0), 10.0) == "up to 1.5, from 3"
    assert where_met(axis, (15.0, 5.0, 15.0), 10.0) == "1.5 to 3"
    assert where_met(axis, (5.0, 6.0, 7.0), 10.0) == "everywhere"
    assert where_met(axis, (15.0, 16.0, 17.0), 10.0) == "nowhere"
    assert where_met(axis, (None, None, None), 10.0) == "not simulated yet"


@given(values=st.lists(st.floats(0.0, 20.0), min_size=2, max_size=12), bound=st.floats(1.0, 19.0))
def test_crossings_lie_between_cells_on_either_side_of_the_bound(values: list[float], bound: float) -> None:
    places = tuple(float(each) for each in range(len(values)))
    found = crossings(places, values, bound, "linear")
    changes = [left for left in range(len(values) - 1) if (values[left] < bound) != (values[left + 1] < bound)]
    assert len(found) == len(changes)
    for place, left in zip(found, changes, strict=True):
        assert left <= place <= left + 1
        assert np.interp(place, places, values) == pytest.approx(bound, rel=1e-9)


def test_keys_as_labels() -> None:
    assert key_label("angle_sensor.error_at_zero_range_rad") == "angle sensor: error at zero range, rad"
    assert key_label("uncertainty.vx_km_s.least") == "uncertainty: vx least, km/s"
    assert key_label("information_set.sections") == "information set: sections"
    units = {"sun.gravitational_parameter_km3_s2": "km³/s²", "a.b_m_s2": "m/s²", "a.error_rad_s": "rad/s", "a.b_s": "s"}
    assert {key: unit_of(key) for key in units} == units


def test_figures_of_sweeps(brief: Scenario, swept: Path, tmp_path: Path) -> None:
    table = sweep_table(CampaignFolder.read(swept))
    middle = float(np.median(table.grid("random", SHOWN[1]).compressed()))
    figure = draw_sweep(table, SHOWN, Requirement(SHOWN[1], middle))
    panels = [each for each in figure.axes if each.get_xlabel()]
    assert [each.get_xlabel() for each in panels] == ["angle sensor: error at zero range, $10^{-4}$ rad"] * 4
    assert {each.get_ylabel() for each in panels} == {"thruster: greatest impulse, m/s"}
    assert all(len(each.texts) == 6 for each in panels)
    axes = sweep_axes("thruster.greatest_impulse_m_s=2:8:3", brief)
    Sweep(brief, axes, sweep_cells(brief, axes), 30, tmp_path / "one", noise=CampaignNoise.MIXED).run()
    table = sweep_table(CampaignFolder.read(tmp_path / "one"))
    figure = draw_sweep(table, SHOWN, None)
    assert [each.get_title() for each in figure.axes] == [
        *("(a) random noise", "(b) random noise", "(c) game noise", "(d) game noise"),
    ]
    assert [each.get_ylabel() for each in figure.axes] == ["miss, m", "impulse spent, m/s"] * 2
    with pytest.raises(ValueError, match="one or two axes"):
        draw_sweep(table, [], None)


def test_an_unfinished_sweep_is_reported_as_far_as_it_is(infoset: Infoset, swept: Path, tmp_path: Path) -> None:
    shutil.copytree(swept, tmp_path / "two")
    for victim in sorted((tmp_path / "two" / "shards").glob("*.parquet"))[2:]:
        victim.unlink()
    code, out, err = infoset("report", tmp_path / "two", "--out", tmp_path / "report", "--json", "-")
    assert code == 0
    found: Any = json.loads(out)
    assert (found["runs"], found["wanted_runs"], found["complete"]) == (40, 120, False)
    assert "40 of 120 runs are stored" in err
    assert pq.read_table(tmp_path / "report" / "sweep.parquet").column("miss_m_p50").null_count == 4
    assert math.isfinite(found["cells"][0]["samples"][0]["miss_m"]["p50"]["value"])
    assert QuantileName("miss_m", 0.5) == SHOWN[0]


def test_the_limit_runs_along_edges_of_cells_and_not_beside_unknown_ones() -> None:
    met = np.ma.masked_array(
        [[True, True, False], [True, False, False]], mask=[[False, False, False], [False, True, False]]
    )
    assert between(np.array([0.0, 1.0, 2.0, 3.0]), np.array([0.0, 1.0, 2.0]), met) == [[(2.0, 0.0), (2.0, 1.0)]]
