"""Scenario files of engagements in space: keys of a second axis across, and planar files as they were."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from experiments.campaigns.sweep_axes import sweep_axes, sweep_cells
from experiments.common.errors import InputError
from experiments.common.toml_form import keys_of
from experiments.interception.scenario_file import (
    load_scenario,
    read_scenario,
    scenario_hash,
    scenario_template,
    scenario_to_toml,
    scenario_warnings,
)
from experiments.interception.scenario_tables import SPACE_KEYS, ScenarioTables
from infoset.sensors import Convention, ErrorShape
from sim import Manoeuvre, Scenario, Target
from tests.built_in import scenario_text

BEFORE = Path(__file__).parents[2] / "data" / "first-format" / "scenarios"
"""Built-in scenarios as `scenario_to_toml` wrote them before there were engagements in space."""
AXIS = {"uncertainty": ("[-9.0, 9.0]", "[-0.09, 0.09]"), "dispersion": ("[-0.9, 0.9]", "[-0.08, 0.08]")}


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


def message_of(text: str) -> str:
    with pytest.raises(InputError) as caught:
        read_scenario(text, "mine.toml")
    return str(caught.value)


@pytest.fixture(scope="module")
def space() -> Scenario:
    return read_scenario(spatial(), "mine.toml")


@pytest.mark.parametrize("file", sorted(BEFORE.iterdir()), ids=lambda file: file.stem)
def test_a_planar_scenario_is_written_as_before(file: Path) -> None:
    text = file.read_text()
    assert scenario_to_toml(load_scenario(file.stem)) == text
    assert scenario_to_toml(read_scenario(text, file.name)) == text


def test_two_pairs_in_both_tables_make_a_scenario_spatial(space: Scenario) -> None:
    planar = load_scenario("asteroid-1997")
    assert space.is_spatial
    assert space == replace(
        planar,
        dispersion=replace(planar.dispersion, y_m=(-900.0, 900.0), vy_m_s=(-80.0, 80.0)),
        set_model=replace(
            planar.set_model, bounds=replace(planar.set_model.bounds, y_m=(-9e3, 9e3), vy_m_s=(-90.0, 90.0))
        ),
    )
    assert scenario_warnings(space) == []
    assert scenario_hash(space) != scenario_hash(planar)


def test_the_built_in_scenario_has_the_numbers_of_the_plane_in_both_axes() -> None:
    planar, space = load_scenario("asteroid-1997"), load_scenario("asteroid-1997-space")
    assert [space.set_model.bounds.axis(name) for name in ("y", "z")] == [planar.set_model.bounds] * 2
    assert [space.dispersion.axis(name) for name in ("y", "z")] == [planar.dispersion] * 2
    in_plane = replace(space.set_model, bounds=planar.set_model.bounds)
    assert replace(space, dispersion=planar.dispersion, set_model=in_plane, name="", description="") == replace(
        planar, name="", description=""
    )
    assert load_scenario("asteroid-1997-space", ["angle_sensor.convention=cone"]).set_model.angle_sensor.is_disc


def test_every_key_of_space_is_read_and_written() -> None:
    text = spatial(
        sun__elevation_deg="-30.0",
        angle_sensor__error_at_nominal_range_y_rad="0.0",
        angle_sensor__error_at_zero_range_y_rad="0.0",
        angle_sensor__convention='"gimbal"',
        angle_sensor__error_shape='"box"',
        thruster__pointing_error_rad="0.01",
        information_set__disturbance_y_m_s2="0.006",
    )
    scenario = read_scenario(
        f'{text}\n[target]\nmanoeuvre = "constant"\nacceleration_m_s2 = 0.001\nacceleration_y_m_s2 = 0.002\n',
        "mine.toml",
    )
    sensor = scenario.set_model.angle_sensor
    assert (sensor.error_at_nominal_range_y_rad, sensor.error_at_zero_range_y_rad) == (0.0, 0.0)
    assert (sensor.convention, sensor.error_shape) == (Convention.GIMBAL, ErrorShape.BOX)
    assert (scenario.set_model.disturbance_y_m_s2, scenario.thruster.pointing_error_rad) == (0.006, 0.01)
    assert scenario.sun is not None
    assert scenario.sun.elevation_rad == pytest.approx(-0.5235987755982988)
    assert scenario.target == Target(Manoeuvre.CONSTANT, 0.001, acceleration_y_m_s2=0.002)
    written = scenario_to_toml(scenario)
    assert read_scenario(written, "again") == scenario
    for table, key in SPACE_KEYS:
        block = next(block for block in written.split("\n\n") if block.startswith(f"[{table}]"))
        assert f"\n{key} = " in block


def test_a_start_along_y_may_be_fixed() -> None:
    scenario = read_scenario(spatial().replace("y_km = [-0.9, 0.9]", "y_km = 0.5"), "mine.toml")
    assert scenario.dispersion.y_m == (500.0, 500.0)
    assert "\ny_km = 0.5\n" in scenario_to_toml(scenario)


def test_the_template_has_every_key_of_space_as_a_comment() -> None:
    template = scenario_template()
    assert not read_scenario(template, "template").is_spatial
    lines = [line for line in template.splitlines() if line.endswith("; in space only")]
    assert len(lines) == len(SPACE_KEYS)
    assert all(line.startswith("# ") for line in lines)
    linear = re.sub(r"(?m)^# (pixel_error_rad|centroid_error_m) = .*\n", "", template)
    whole = read_scenario(re.sub(r"(?m)^# (?=\w+ = |\[)", "", linear), "whole")
    assert whole.is_spatial
    assert scenario_warnings(whole) == []


@pytest.mark.parametrize(
    ("table", "key"),
    sorted(
        SPACE_KEYS
        - {("uncertainty", "y_km"), ("dispersion", "y_km"), ("uncertainty", "vy_km_s"), ("dispersion", "vy_km_s")}
    ),
)
def test_a_value_of_space_is_refused_in_a_plane(table: str, key: str) -> None:
    value = {"convention": '"cone"', "error_shape": '"disc"', "elevation_deg": "10.0"}.get(key, "0.001")
    tables = scenario_text("asteroid-1997") + '\n[target]\nmanoeuvre = "constant"\nacceleration_m_s2 = 0.001\n'
    text = re.sub(rf"(?m)^\[{table}\].*$", rf"\g<0>\n{key} = {value}", tables)
    assert message_of(text) == (
        f"mine.toml: {table}.{key}: belongs to a scenario in space, and this one is in a plane, found {value}; remove "
        "it, or add y_km and vy_km_s to [uncertainty] and [dispersion]"
    )
    default = keys_of(ScenarioTables, (table,))[key].default
    if default is not None:  # a value that changes nothing
        same = "0" if key != "convention" else '"plane"'
        unused = read_scenario(text.replace(f"{key} = {value}", f"{key} = {same}"), "mine.toml")
        assert unused == read_scenario(tables, "mine.toml")


@pytest.mark.parametrize(
    "missing", [("uncertainty", "y_km"), ("uncertainty", "vy_km_s"), ("dispersion", "y_km"), ("dispersion", "vy_km_s")]
)
def test_a_second_axis_is_whole(missing: tuple[str, str]) -> None:
    table, key = missing
    message = message_of(spatial(**{f"{table}__{key}": ""}))
    assert message.startswith(f"mine.toml: {table}.{key}: is missing; add it under [{table}], for example {key} = [-")
    assert "\n" not in message


def test_a_second_axis_in_one_table_only_lacks_both_pairs() -> None:
    message = message_of(spatial(dispersion__y_km="", dispersion__vy_km_s=""))
    assert [line.split(": ")[1] for line in message.splitlines()[1:]] == ["dispersion.y_km", "dispersion.vy_km_s"]


@pytest.mark.parametrize(
    ("old", "new", "path", "part"),
    [
        ("y_km = [-9.0, 9.0]", "y_km = [9.0, -9.0]", "uncertainty.y_km", "reversed"),
        ("y_km = [-9.0, 9.0]", "y_km = 9.0", "uncertainty.y_km", "must be a pair"),
        ("y_km = [-9.0, 9.0]", "y_kn = [-9.0, 9.0]", "uncertainty.y_kn", "did you mean y_km?"),
        ("vy_km_s = [-0.08, 0.08]", "vy_km_s = 4e5", "dispersion.vy_km_s", "at most 299792.458"),
        ("[sun]", "[sun]\nelevation_deg = 90.5", "sun.elevation_deg", "at most 90"),
        ("[thruster]", "[thruster]\npointing_error_rad = 1.0", "thruster.pointing_error_rad", "less than 1"),
        ("[angle_sensor]", '[angle_sensor]\nconvention = "gimbals"', "angle_sensor.convention", 'mean "gimbal"?'),
        ("[angle_sensor]", '[angle_sensor]\nerror_shape = "disk"', "angle_sensor.error_shape", 'mean "disc"?'),
        (
            "[angle_sensor]",
            "[angle_sensor]\nerror_at_zero_range_y_rad = -1e-4",
            "angle_sensor.error_at_zero_range_y_rad",
            "at least 0",
        ),
        (
            "[angle_sensor]",
            '[angle_sensor]\nconvention = "cone"\nerror_shape = "box"',
            "angle_sensor.error_shape",
            'must be "disc" for convention = "cone"',
        ),
        (
            "[angle_sensor]",
            '[angle_sensor]\nconvention = "cone"\nerror_at_zero_range_y_rad = 0.0002',
            "angle_sensor.error_at_zero_range_y_rad",
            "remove error_at_zero_range_y_rad",
        ),
        (
            "[angle_sensor]",
            '[angle_sensor]\nerror_shape = "disc"\nerror_at_nominal_range_y_rad = 0.0002',
            "angle_sensor.error_at_nominal_range_y_rad",
            "equal to error_at_nominal_range_rad",
        ),
        (
            "[angle_sensor]",
            "[angle_sensor]\nerror_at_nominal_range_y_rad = 0.0",
            "angle_sensor.error_at_nominal_range_y_rad",
            "or lower error_at_zero_range_rad",
        ),
    ],
)
def test_a_problem_of_the_second_axis_is_one_problem(old: str, new: str, path: str, part: str) -> None:
    message = message_of(spatial().replace(old, new, 1))
    assert message.startswith(f"mine.toml: {path}: "), message
    assert part in message
    assert "\n" not in message


def test_the_error_law_is_checked_where_the_object_goes_across_along_y() -> None:
    law = "error_at_nominal_range_rad = 0.00002"
    assert read_scenario(re.sub("error_at_nominal_range_rad = 0.00015", law, spatial()), "mine.toml").is_spatial
    wide = re.sub("error_at_nominal_range_rad = 0.00015", law, spatial(uncertainty__y_km="[-9000.0, 9000.0]"))
    assert "leaves no error bound at the greatest possible range" in message_of(wide)


def test_the_guaranteed_model_needs_labels_in_space_too() -> None:
    text = spatial(information_set__disturbance_y_m_s2="0.006").replace('"paper"', '"guaranteed"')
    assert read_scenario(text, "mine.toml").set_model.is_guaranteed
    assert "closing speeds from" in message_of(text.replace("[-59.0, -57.0]", "[-159.0, -57.0]"))


@pytest.mark.parametrize(
    ("values", "part"),
    [
        ({"dispersion__y_km": "[-0.9, 9.5]"}, "dispersion.y_km reaches 0.5 km above uncertainty.y_km"),
        ({"dispersion__vy_km_s": "-0.1"}, "dispersion.vy_km_s reaches 0.01 km/s below uncertainty.vy_km_s"),
        ({"uncertainty__y_km": "[-100.0, 10.0]"}, "0.019 rad off the x axis"),
    ],
)
def test_warnings_of_y_are_those_of_z(values: dict[str, str], part: str) -> None:
    (line,) = scenario_warnings(read_scenario(spatial(**values), "mine.toml"))
    assert part in line


def test_an_exact_angle_is_warned_of_unless_the_object_stays_in_the_plane() -> None:
    exact = {"angle_sensor__error_at_nominal_range_y_rad": "0.0", "angle_sensor__error_at_zero_range_y_rad": "0.0"}
    (line,) = scenario_warnings(read_scenario(spatial(**exact), "mine.toml"))
    assert "a measurement leaves a single range" in line
    still = {f"{table}__{key}": "[0.0, 0.0]" for table in AXIS for key in ("y_km", "vy_km_s")}
    assert scenario_warnings(read_scenario(spatial(**exact, **still), "mine.toml")) == []


@pytest.mark.parametrize(
    ("acceleration", "disturbance", "lines"),
    [
        ({}, None, ["target.acceleration_m_s2, 0.006, exceeds information_set.disturbance_m_s2, 0.005"]),
        ({}, 0.007, ["target.acceleration_m_s2, 0.006, exceeds information_set.disturbance_m_s2, 0.005"]),
        (
            {"acceleration_y_m_s2": 0.008},
            0.007,
            [
                "target.acceleration_y_m_s2, 0.008, exceeds information_set.disturbance_y_m_s2, 0.007",
                "target.acceleration_m_s2, 0.006, exceeds information_set.disturbance_m_s2, 0.005",
            ],
        ),
    ],
)
def test_a_target_that_exceeds_the_disturbance_of_an_axis(
    space: Scenario, acceleration: dict[str, float], disturbance: float | None, lines: list[str]
) -> None:
    text = scenario_to_toml(replace(space, set_model=replace(space.set_model, disturbance_y_m_s2=disturbance)))
    scenario = read_scenario(text.replace('"paper"', '"guaranteed"'), "mine.toml")
    warnings = scenario_warnings(replace(scenario, target=Target(Manoeuvre.CONSTANT, 0.006, **acceleration)))
    assert [line.split(":")[0] for line in warnings] == lines


def test_settings_reach_the_second_axis(space: Scenario) -> None:
    settings = [
        f"{table}.{key}={pair}"
        for table, pairs in AXIS.items()
        for key, pair in zip(("y_km", "vy_km_s"), pairs, strict=True)
    ]
    scenario = load_scenario("asteroid-1997", settings)
    assert replace(scenario, description=space.description) == space
    tilted = load_scenario("asteroid-1997", [*settings, "uncertainty.y_km.least=-8", "angle_sensor.convention=cone"])
    assert tilted.set_model.bounds.y_m == (-8e3, 9e3)
    assert tilted.set_model.angle_sensor.is_disc
    with pytest.raises(InputError, match="the file has no such pair"):
        load_scenario("asteroid-1997", ["uncertainty.y_km.least=-8"])


def test_sweeps_vary_the_second_axis(space: Scenario) -> None:
    cells = sweep_cells(space, sweep_axes("uncertainty.y_km.least=-9:-8:2,sun.elevation_deg=0:30:2", space))
    assert [cell.set_model.bounds.y_m for cell in cells[::2]] == [(-9e3, 9e3), (-8e3, 9e3)]
    assert [cell.sun.elevation_rad > 0.5 for cell in cells[:2] if cell.sun] == [False, True]
    keys = (
        "angle_sensor.error_at_nominal_range_y_rad",
        "information_set.disturbance_y_m_s2",
        "thruster.pointing_error_rad",
    )
    cells = sweep_cells(space, sweep_axes(",".join(f"{key}=0.001:0.002:2" for key in keys), space))
    assert [cell.set_model.angle_sensor.error_at_nominal_range_y_rad for cell in cells[::4]] == [0.001, 0.002]
    assert [cell.set_model.disturbance_y_m_s2 for cell in cells[:4:2]] == [0.001, 0.002]
    assert [cell.thruster.pointing_error_rad for cell in cells[:2]] == [0.001, 0.002]
    wider = read_scenario(
        spatial(angle_sensor__error_at_zero_range_y_rad="0.0003", angle_sensor__error_shape='"box"'), "mine.toml"
    )
    (_, double) = sweep_cells(wider, sweep_axes("angle_sensor.scale=1:2:2", wider))
    sensor = double.set_model.angle_sensor
    assert (sensor.error_at_zero_range_rad, sensor.error_at_zero_range_y_rad) == (0.00046, 0.0006)


def test_a_sweep_of_a_planar_scenario_has_no_keys_of_space() -> None:
    with pytest.raises(InputError, match=r"sun\.elevation_deg is a key of scenarios in space; add y_km and vy_km_s"):
        sweep_axes("sun.elevation_deg=0:30:2", load_scenario("asteroid-1997"))
