"""Campaigns, sweeps and their reports with a scenario in space."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from experiments.common.input_file import to_toml
from experiments.interception.scenario_file import load_scenario, with_model
from guidance import NoiseKind
from infoset import Model
from sim import Scenario, simulate
from sim.scenario import of_model
from sim.storage import CampaignFolder
from tests.experiments.command_line import Command, strict
from tests.space import in_space

pytestmark = pytest.mark.usefixtures("unrendered")

SWEPT = "uncertainty.y_km.max=0.1:0.2:2,angle_sensor.error_at_zero_range_y_rad=0.0001:0.0004:2"


@pytest.fixture
def file(brief: Scenario, tmp_path: Path) -> Path:
    path = tmp_path / "space.toml"
    path.write_text(to_toml(in_space(brief)))
    return path


@pytest.mark.usefixtures("rendered")
def test_a_campaign_in_space_is_resumed_and_reported(file: Path, infoset: Command) -> None:
    assert infoset("campaign", file, "--runs", 8, "--noise", "mixed", "--out", "runs", "--seed", 3)[0] == 0
    code, _, _ = infoset("campaign", file, "--runs", 12, "--noise", "mixed", "--out", "runs", "--seed", 3, "--resume")
    assert code == 0
    table = CampaignFolder.read(Path("runs")).runs()
    assert table["run"].tolist() == list(range(12))
    scenario = with_model(load_scenario(str(file)), Model.GUARANTEED)
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


def test_a_sweep_over_keys_of_space_is_resumed_and_reported(file: Path, infoset: Command) -> None:
    sweep = ["sweep", file, "--vary", SWEPT, "--noise", "random", "--out", "cells"]
    assert infoset(*sweep, "--runs", 3)[0] == 0
    assert infoset(*sweep, "--runs", 5, "--resume")[0] == 0
    scenario = with_model(load_scenario(str(file)), Model.GUARANTEED)
    model, sensor = scenario.set_model, scenario.set_model.angle_sensor
    last = replace(
        model,
        bounds=replace(model.bounds, y_m=(-100.0, 200.0)),
        angle_sensor=replace(sensor, error_at_zero_range_y_rad=0.0004),
    )
    table = CampaignFolder.read(Path("cells")).runs(["miss_m", "miss_y_m"], 3)
    flown = simulate(replace(scenario, **of_model(last), noise=NoiseKind.RANDOM, tie=scenario.tie), 5)
    assert table["miss_m"].tolist() == flown.miss_m.tolist()
    assert table["miss_y_m"].tolist() == flown.lateral_miss[:, 0].tolist()
    report = infoset.json("report", "cells", "--quiet")
    assert [axis["key"] for axis in report["axes"]] == [part.split("=")[0] for part in SWEPT.split(",")]
    assert report["runs"] == 20


@pytest.mark.parametrize(
    "vary",
    [
        "sun.elevation_deg=0:90:2",
        "thruster.pointing_error_rad=0:0.01:2",
        "information_set.disturbance_y_m_s2=0.001:0.01:2",
        "dispersion.vy_km_s.min=-0.01:0:2",
        "angle_sensor.scale=1:2:2",
    ],
)
def test_each_number_of_space_can_be_varied(vary: str, file: Path, infoset: Command) -> None:
    code, _, err = infoset("sweep", file, "--vary", vary, "--runs", 1, "--out", "cells")
    assert code == 0, err
