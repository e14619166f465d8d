"""Campaigns, sweeps and their reports with a scenario in space."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from infoset import Model
from infoset.experiments.interception.scenario_file import load_scenario, with_model
from infoset.guidance import NoiseKind
from infoset.sim import simulate
from infoset.sim.scenario import of_model
from infoset.sim.storage import CampaignFolder
from tests.experiments.command_line import Command, strict
from tests.sensors import linear

pytestmark = pytest.mark.usefixtures("unrendered")

SWEPT = "uncertainty.y_km.max=0.1:0.2:2,angle_sensor.error_at_zero_range_y_rad=0.0001:0.0004:2"


def test_a_campaign_in_space_is_resumed_and_reported(space_file: Path, infoset: Command) -> None:
    assert (
        infoset(
            "campaign", space_file, "--runs", 8, "--noise", "mixed", "--out", "runs", "--seed", 3
        )[0]
        == 0
    )
    code, _, _ = infoset(
        "campaign",
        space_file,
        "--runs",
        12,
        "--noise",
        "mixed",
        "--out",
        "runs",
        "--seed",
        3,
        "--resume",
    )
    assert code == 0
    table = CampaignFolder.read(Path("runs")).runs()
    assert table["run"].tolist() == list(range(12))
    scenario = with_model(load_scenario(str(space_file)), Model.GUARANTEED)
    for kind, first in ((NoiseKind.RANDOM, 0), (NoiseKind.GAME, 1)):
        flown = simulate(replace(scenario, noise=kind), 12, seed=3)
        for name in ("miss_m", "miss_y_m", "miss_z_m", "start_y_m", "start_vy_m_s"):
            assert table[name][first::2].tolist() == flown.to_dict()[name][first::2]
    report = infoset.json("report", "runs", "--quiet", "--out", "figures")
    assert Path("figures/figure-b-plane.png").is_file()
    assert (report["runs"], report["complete"]) == (12, True)
    components = {row["component"] for row in report["correlation_with_miss"]}
    assert {"start_y_m", "start_vy_m_s", "|start_y_m|"} < components
    worst = report["worst"][0]
    flown = strict(infoset(*worst["replay"].split()[1:], "--json", "-")[1])
    assert flown["miss_m"] == worst["miss_m"]
    assert flown["miss_y_m"] in table["miss_y_m"].tolist()


def test_a_sweep_over_keys_of_space_is_resumed_and_reported(
    space_file: Path, infoset: Command
) -> None:
    sweep = ["sweep", space_file, "--vary", SWEPT, "--noise", "random", "--out", "cells"]
    assert infoset(*sweep, "--runs", 3)[0] == 0
    assert infoset(*sweep, "--runs", 5, "--resume")[0] == 0
    scenario = with_model(load_scenario(str(space_file)), Model.GUARANTEED)
    model = scenario.set_model
    sensor = scenario.set_model.angle_sensor
    last = replace(
        model,
        bounds=replace(model.bounds, y_m=(-100.0, 200.0)),
        angle_sensor=replace(linear(sensor), error_at_zero_range_y_rad=0.0004),
    )
    table = CampaignFolder.read(Path("cells")).runs(["miss_m", "miss_y_m"], 3)
    flown = simulate(
        replace(scenario, **of_model(last), noise=NoiseKind.RANDOM, tie=scenario.tie), 5
    )
    assert table["miss_m"].tolist() == flown.miss_m.tolist()
    assert table["miss_y_m"].tolist() == flown.lateral_miss_m[:, 0].tolist()
    report = infoset.json("report", "cells", "--quiet")
    assert [axis["key"] for axis in report["axes"]] == [
        part.split("=")[0] for part in SWEPT.split(",")
    ]
    assert report["runs"] == 20
