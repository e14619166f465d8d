"""Scenario files of engagements in space: keys of a second axis across, and planar files as they
were.
"""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from infoset.experiments.common.input_file import read_text, to_toml
from infoset.experiments.interception.scenario_file import load_scenario, scenario_warnings
from infoset.sim import Manoeuvre, Scenario, Target
from infoset.sim.scenario import of_model
from infoset.sim.storage.codec import fingerprint
from tests.built_in import scenario_text
from tests.sensors import linear

AXIS = {
    "uncertainty": ("[-9.0, 9.0]", "[-0.09, 0.09]"),
    "dispersion": ("[-0.9, 0.9]", "[-0.08, 0.08]"),
}


def spatial(**values: str) -> str:
    """The paper's file with a second axis, and with other values or None by ``table__key``."""
    wanted = {
        f"{table}__{key}": pair
        for table, pairs in AXIS.items()
        for key, pair in zip(("y_km", "vy_km_s"), pairs, strict=True)
    }
    text = scenario_text("asteroid-1997")
    for name, value in (wanted | values).items():
        table, _, key = name.partition("__")
        text = re.sub(rf"(?m)^\[{table}\].*$", rf"\g<0>\n{key} = {value}", text) if value else text
    return text


@pytest.fixture(scope="module")
def space() -> Scenario:
    return read_text(Scenario, spatial(), "mine.toml")


def test_two_pairs_in_both_tables_make_a_scenario_spatial(space: Scenario) -> None:
    planar = load_scenario("asteroid-1997")
    assert space.is_spatial
    assert space == replace(
        planar,
        dispersion=replace(planar.dispersion, y_m=(-900.0, 900.0), vy_m_s=(-80.0, 80.0)),
        **of_model(
            replace(
                planar.set_model,
                bounds=replace(planar.set_model.bounds, y_m=(-9e3, 9e3), vy_m_s=(-90.0, 90.0)),
            )
        ),
    )
    assert scenario_warnings(space) == []
    assert fingerprint(space) != fingerprint(planar)


def test_the_built_in_scenario_has_the_numbers_of_the_plane_in_both_axes() -> None:
    planar = load_scenario("asteroid-1997")
    space = load_scenario("asteroid-1997-space")
    assert [space.set_model.bounds.axis(name) for name in ("y", "z")] == [
        planar.set_model.bounds
    ] * 2
    assert [space.dispersion.axis(name) for name in ("y", "z")] == [planar.dispersion] * 2
    in_plane = replace(space.set_model, bounds=planar.set_model.bounds)
    assert replace(
        space, dispersion=planar.dispersion, **of_model(in_plane), name="", description=""
    ) == replace(planar, name="", description="")


def test_every_key_of_space_is_read_and_written() -> None:
    text = spatial(
        sun__elevation_deg="-30.0",
        angle_sensor__error_at_nominal_range_y_rad="0.0",
        angle_sensor__error_at_zero_range_y_rad="0.0",
        thruster__pointing_error_rad="0.01",
        information_set__disturbance_y_m_s2="0.006",
    )
    scenario = read_text(
        Scenario,
        f'{text}\n[target]\nmanoeuvre = "constant"\n'
        "acceleration_m_s2 = 0.001\nacceleration_y_m_s2 = 0.002\n",
        "mine.toml",
    )
    sensor = linear(scenario.angle_sensor)
    assert (sensor.error_at_nominal_range_y_rad, sensor.error_at_zero_range_y_rad) == (0.0, 0.0)
    assert (scenario.set_model.disturbance_y_m_s2, scenario.thruster.pointing_error_rad) == (
        0.006,
        0.01,
    )
    assert scenario.sun is not None
    assert scenario.sun.elevation_rad == pytest.approx(-0.5235987755982988)
    assert scenario.target == Target(Manoeuvre.CONSTANT, 0.001, acceleration_y_m_s2=0.002)
    written = to_toml(scenario)
    assert read_text(Scenario, written, "again") == scenario


def test_a_target_that_exceeds_the_disturbance_of_an_axis(space: Scenario) -> None:
    model = replace(space.set_model, disturbance_y_m_s2=0.007)
    text = to_toml(replace(space, **of_model(model))).replace('"paper"', '"guaranteed"')
    target = Target(Manoeuvre.CONSTANT, 0.006, acceleration_y_m_s2=0.008)
    warnings = scenario_warnings(replace(read_text(Scenario, text, "mine.toml"), target=target))
    assert [line.split(":")[0] for line in warnings] == [
        "target.acceleration_y_m_s2, 0.008, exceeds information_set.disturbance_y_m_s2, 0.007",
        "target.acceleration_m_s2, 0.006, exceeds information_set.disturbance_m_s2, 0.005",
    ]
