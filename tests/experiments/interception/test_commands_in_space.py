"""Commands of single engagements and of experiments with a scenario in space: files, tables."""

from __future__ import annotations

import csv
import io
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from infoset.experiments.interception.record_file import load_record
from infoset.experiments.interception.scenario_file import load_scenario
from infoset.sim import simulate
from tests.experiments.command_line import Command, strict

ANGLES = ["measured_angle_y_rad", "measured_angle_z_rad"]
ALONG = (
    "measured_angle_{}_rad",
    "measured_rate_{}_rad_s",
    "true_angle_{}_rad",
    "true_rate_{}_rad_s",
    "impulse_{}_m_s",
)
IMPULSES = ["impulse_m_s", "impulse_y_m_s", "impulse_z_m_s"]


def rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


def test_the_files_of_engage_name_the_axis(space_file: Path, infoset: Command) -> None:
    code, out, err = infoset(
        "engage", space_file, "--record", "r.npz", "--json", "r.json", "--csv", "r.csv"
    )
    assert code == 0
    assert err.endswith("wrote r.json, r.csv, r.npz\n")
    record = load_record("r.npz")
    written = strict(Path("r.json").read_text())
    steps = written.pop("steps")
    table = rows(Path("r.csv").read_text())
    ends = [f"predicted_miss_{axis}_{end}_m" for axis in ("y", "z") for end in ("lower", "upper")]
    assert [*table[0]] == [
        *("noise", "step", "time_s", "true_range_m", "measured_range_m", "impulse_m_s"),
        *(
            *(name.format("y") for name in ALONG),
            *ends[:2],
            *(name.format("z") for name in ALONG),
            *ends[2:],
        ),
        *("truth_margin_m", "sections"),
    ]
    assert [*steps[0]] == [*table[0]][1:]
    for number, (step, row) in enumerate(zip(steps, table, strict=True)):
        assert [step[name] for name in ANGLES] == record.measured["angle"][number].tolist()
        given = record.impulse_m_s[number]
        interval = record.predicted_miss_m[number].ravel().tolist()
        assert [step[name] for name in IMPULSES] == [np.hypot(*given), *given]
        misses = [None] * 4 if np.isnan(interval).any() else interval
        assert [float(row[end]) if row[end] else None for end in ends] == misses
        assert [step[end] for end in ends] == misses
    assert np.hypot(written["miss_y_m"], written["miss_z_m"]) == pytest.approx(
        written["miss_m"], rel=1e-3
    )
    assert sum(step["impulse_m_s"] for step in steps) == pytest.approx(
        written["impulse_m_s"], rel=1e-12
    )
    assert re.search(rf"^miss along y, m +{written['miss_y_m']:.3g}$", out, re.MULTILINE)
    assert re.search(rf"^miss along z, m +{written['miss_z_m']:.3g}$", out, re.MULTILINE)


def test_the_files_of_experiment_have_the_columns_of_space(
    space_file: Path, infoset: Command
) -> None:
    code, _, _ = infoset(
        "experiment", space_file, "--runs", 3, "--json", "x.json", "--csv", "x.csv"
    )
    assert code == 0
    scenario = load_scenario(str(space_file))
    flown = simulate(replace(scenario, range_sensor=None), 3).to_dict()
    lateral = ("start_y_m", "start_vy_m_s", "miss_y_m", "miss_z_m")
    table = rows(Path("x.csv").read_text())
    for name in lateral:
        assert [float(row[name]) for row in table[:3]] == flown[name]
    curve = strict(Path("x.json").read_text())["curves"][0]
    assert [curve[name] for name in ("miss_m", "miss_y_m", "miss_z_m")] == [
        flown[name] for name in ("miss_m", "miss_y_m", "miss_z_m")
    ]
    assert not {"start_y_m", "start_z_m"} & set(curve)
