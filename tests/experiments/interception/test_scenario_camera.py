"""Keys of a camera and of the times of impulses in scenario files."""

from __future__ import annotations

from dataclasses import replace

import pytest

from experiments import load_scenario
from experiments.campaigns.sweep_axes import sweep_axes, sweep_cells
from experiments.common.errors import InputError
from experiments.interception.scenario_file import read_scenario, scenario_to_toml, scenario_warnings
from infoset import AngleSensor
from infoset.sensors import Bias
from sim import Scenario
from tests.built_in import scenario_text

PLANE = scenario_text("asteroid-1997")
LINE = [line for line in PLANE.splitlines() if line.startswith("error_at_")]
CAMERA = PLANE.replace(LINE[0], "pixel_error_rad = 5e-6").replace(LINE[1], "centroid_error_m = 20.0")
WHOLE = {
    "angle_sensor.bias": "constant",
    "angle_sensor.first_image_s": "50.0",
    "angle_sensor.last_image_s": "4.5",
    "angle_sensor.miss_probability": "0.125",
    "thruster.last_impulse_s": "7",
    "thruster.impulses_s": "[50.0, 20, 7.5]",
    "thruster.delay_steps": "2",
}


def camera(**values: str) -> Scenario:
    return read_scenario(CAMERA, "file", {key.replace("__", "."): value for key, value in values.items()})


def test_two_keys_in_place_of_the_linear_bound_make_a_camera() -> None:
    scenario = camera()
    assert scenario.set_model.angle_sensor == AngleSensor.camera(0.5, 5e-6, 20.0, nominal_range_m=5_801_300.0)
    text = scenario_to_toml(scenario)
    assert "pixel_error_rad = 0.000005\ncentroid_error_m = 20.0\n" in text
    assert "error_at" not in text
    assert read_scenario(text, "written") == scenario


def test_a_camera_without_an_error_of_the_centre() -> None:
    scenario = read_scenario(CAMERA.replace("centroid_error_m = 20.0", ""), "file")
    assert scenario.set_model.angle_sensor.centroid_error_m == 0.0
    assert read_scenario(scenario_to_toml(scenario), "written") == scenario


@pytest.mark.parametrize("text", [PLANE, CAMERA, scenario_text("asteroid-1997-space")])
def test_every_key_is_read_and_written(text: str) -> None:
    values = {key: value for key, value in WHOLE.items() if text == CAMERA or key != "angle_sensor.bias"}
    scenario = read_scenario(text, "file", values)
    sensor, thruster = scenario.set_model.angle_sensor, scenario.thruster
    assert (sensor.first_image_s, sensor.last_image_s, sensor.miss_probability) == (50.0, 4.5, 0.125)
    assert sensor.bias is (Bias.CONSTANT if text == CAMERA else Bias.RANDOM)
    assert (thruster.last_impulse_s, thruster.impulses_s, thruster.delay_steps) == (7.0, (50.0, 20.0, 7.5), 2)
    assert read_scenario(scenario_to_toml(scenario), "written") == scenario


@pytest.mark.parametrize(
    ("key", "value", "problem"),
    [
        ("angle_sensor.error_at_zero_range_rad", "1e-4", "must not be set together with pixel_error_rad, found 0.0001"),
        ("angle_sensor.first_image_s", "0.5", "must be at least angle_sensor.last_image_s, 5, found 0.5"),
        ("angle_sensor.bias", "always", 'must be one of "random", "constant", found "always"'),
        ("angle_sensor.miss_probability", "1", "must be less than 1, found 1"),
        ("thruster.impulses_s", "[20, 50]", "must decrease: got 50.0 after 20.0"),
        ("thruster.impulses_s", "[200, 50]", "the first impulse can be given 100.022 s before the nominal arrival"),
        ("thruster.impulses_s", "[20.1, 20.2e0]", "must decrease: got 20.2 after 20.1"),
        ("thruster.impulses_s", "[20.0, 19.9]", "two impulses in one step of 0.5 s: got 20.0 and 19.9"),
        ("thruster.impulses_s", "20", "must be an array of numbers, found 20"),
        ("thruster.impulses_s", "[-1]", "number 1 of the array must be greater than 0"),
        ("thruster.last_impulse_s", "200", "excludes all impulses: got 200.0; the nominal arrival is 100.022 s after"),
        ("thruster.delay_steps", "-1", "must be from 0 to 100000, found -1"),
        ("thruster.delay_steps", "1.5", "must be a whole number, found 1.5"),
    ],
)
def test_a_wrong_value_is_one_problem(key: str, value: str, problem: str) -> None:
    last = {"angle_sensor.last_image_s": "5"} if key == "angle_sensor.first_image_s" else {}
    with pytest.raises(InputError) as caught:
        read_scenario(CAMERA, "file", {key: value, **last})
    assert str(caught.value).startswith(f"file: {key}: ")
    assert problem in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_error_of_the_centre_is_small_at_the_range_threshold() -> None:
    with pytest.raises(InputError, match=r"^file: guidance\.range_threshold_km: must be at least 10 times .* = 8$"):
        camera(angle_sensor__centroid_error_m="800")


@pytest.mark.parametrize(
    ("text", "key"),
    [
        (PLANE.replace(LINE[0], ""), "error_at_nominal_range_rad"),
        (CAMERA.replace("pixel_error_rad = 5e-6", ""), "pixel_error_rad"),
    ],
)
def test_a_missing_error_is_one_problem(text: str, key: str) -> None:
    with pytest.raises(InputError, match=rf"^file: angle_sensor\.{key}: is missing; add it under \[angle_sensor\]"):
        read_scenario(text, "file")


def test_only_a_camera_has_a_constant_error() -> None:
    with pytest.raises(InputError, match=r"^file: angle_sensor\.bias: must be \"random\" without pixel_error_rad"):
        read_scenario(PLANE, "file", {"angle_sensor.bias": "constant"})


def test_measurements_after_the_last_impulse_are_warned_of() -> None:
    blind = camera(angle_sensor__first_image_s="20", thruster__last_impulse_s="30")
    assert scenario_warnings(blind) == [
        "angle_sensor.first_image_s is 20 s, and the last impulse is 30.0224 s before the nominal arrival: "
        "no impulse follows a measurement"
    ]
    assert not scenario_warnings(camera(angle_sensor__first_image_s="30.1", thruster__last_impulse_s="30"))
    schedule = {"thruster__impulses_s": "[60.0, 40.0, 20.0]", "thruster__last_impulse_s": "30"}
    after_cut_off = "the impulses at 20 s before the arrival are after the cut-off"
    for first_image_s, delay_steps, number in (("35", "0", 2), ("40.1", "0", 1), ("40.1", "2", 2)):
        lines = scenario_warnings(
            camera(angle_sensor__first_image_s=first_image_s, thruster__delay_steps=delay_steps, **schedule)
        )
        assert len(lines) == number
        assert [after_cut_off in line for line in lines].count(True) == 1


def test_a_camera_without_images_is_warned_of() -> None:
    assert scenario_warnings(camera(angle_sensor__last_image_s="1e6")) == [
        "angle_sensor.last_image_s is 1e+06 s, and the nominal arrival is 100.022 s after the start: no image is taken"
    ]


def test_a_delay_beyond_the_arrival_is_warned_of() -> None:
    (warning,) = scenario_warnings(camera(thruster__delay_steps="100000"))
    assert warning.startswith("thruster.delay_steps is 100000, which is 50000 s, and ")


def test_sweeps_vary_the_camera_and_the_cut_off() -> None:
    scenario = camera()
    axes = sweep_axes("angle_sensor.pixel_error_rad=1e-6:5e-6:2,thruster.last_impulse_s=5:20:2", scenario)
    cells = sweep_cells(scenario, axes)
    sensors = [cell.set_model.angle_sensor for cell in cells]
    assert [sensor.pixel_error_rad for sensor in sensors] == [1e-6, 1e-6, 5e-6, 5e-6]
    assert [cell.thruster.last_impulse_s for cell in cells] == [5.0, 20.0, 5.0, 20.0]
    (axis,) = sweep_axes("angle_sensor.scale=1:2:2", scenario)
    doubled = replace(sensors[2], centroid_error_m=40.0)
    doubled = replace(doubled, error_at_nominal_range_rad=1e-5, error_at_zero_range_rad=1e-5)
    assert sweep_cells(scenario, [axis])[1].set_model.angle_sensor == doubled
    (axis,) = sweep_axes("thruster.delay_steps=0:3:4", load_scenario("asteroid-1997"))
    assert axis.values == (0.0, 1.0, 2.0, 3.0)
    timed = camera(thruster__impulses_s="[50.0, 20.0]")
    with pytest.raises(InputError, match="no numeric key"):
        sweep_axes("thruster.impulses_s.least=1:2:2", timed)
    with pytest.raises(InputError, match=r"no numeric key \"angle_sensor\.error_at_zero_range_y_rad\""):
        sweep_axes("angle_sensor.error_at_zero_range_y_rad=1e-6:1e-5:2", load_scenario("dart-2022"))


def test_impulses_after_the_cut_off_are_named() -> None:
    scenario = load_scenario("haiv-2013", ["thruster.last_impulse_s=800"])
    assert [line for line in scenario_warnings(scenario) if "the impulses at 750, 180 s before the arrival" in line]
