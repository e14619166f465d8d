"""Keys of a camera and of the times of impulses in scenario files."""

from __future__ import annotations

import re

import pytest

from infoset import Camera
from infoset.experiments.common.errors import InputError
from infoset.experiments.common.input_file import read_text, to_toml
from infoset.experiments.interception.scenario_file import scenario_warnings
from infoset.sensors import OffsetCamera
from infoset.sim import Scenario
from tests.built_in import scenario_text

PLANE = scenario_text("asteroid-1997")
CAMERA = re.sub("(?m)^(error_at_|nominal_range_km = 5801.3$).*\n", "", PLANE).replace(
    "[angle_sensor]", "[camera]\npixel_error_rad = 5e-6\ncentroid_error_m = 20.0"
)
IMAGES = ["first_image_s=50.0", "last_image_s=4.5", "miss_probability=0.125"]
WHOLE = [
    "thruster.last_impulse_s=7",
    "thruster.impulses_s=[50.0, 20, 7.5]",
    "thruster.delay_steps=2",
]


def camera(**values: str) -> Scenario:
    settings = [f"{key.replace('__', '.')}={value}" for key, value in values.items()]
    return read_text(Scenario, CAMERA, "file", settings)


def test_a_camera_in_place_of_a_sensor_with_a_linear_bound() -> None:
    scenario = camera()
    assert scenario.angle_sensor is None
    assert scenario.camera == scenario.set_model.angle_sensor == Camera(0.5, 5e-6, 20.0)
    assert "error_at" not in to_toml(scenario)
    assert read_text(Scenario, to_toml(scenario), "written") == scenario
    without = read_text(Scenario, CAMERA.replace("centroid_error_m = 20.0", ""), "file")
    assert without.camera == Camera(0.5, 5e-6)


@pytest.mark.parametrize("text", [PLANE, CAMERA, scenario_text("asteroid-1997-space")])
def test_every_key_is_read_and_written(text: str) -> None:
    table = "camera" if text == CAMERA else "angle_sensor"
    images = [*IMAGES, *(["bias=constant"] if text == CAMERA else [])]
    settings = [*WHOLE, *(f"{table}.{image}" for image in images)]
    scenario = read_text(Scenario, text, "file", settings)
    sensor = scenario.bearing_sensor
    thruster = scenario.thruster
    assert (sensor.first_image_s, sensor.last_image_s, sensor.miss_probability) == (
        50.0,
        4.5,
        0.125,
    )
    assert sensor.has_constant_bias is (text == CAMERA)
    assert (thruster.last_impulse_s, thruster.impulses_s, thruster.delay_steps) == (
        7.0,
        (50.0, 20.0, 7.5),
        2,
    )
    assert read_text(Scenario, to_toml(scenario), "written") == scenario


def test_the_error_of_the_centre_is_small_at_the_range_threshold() -> None:
    with pytest.raises(
        InputError, match=r"range_threshold_m must be at least 10 times .*, 8000 m: got 5000"
    ):
        camera(camera__centroid_error_m="800")


def test_measurements_after_the_last_impulse_are_warned_of() -> None:
    blind = camera(camera__first_image_s="20", thruster__last_impulse_s="30")
    (line,) = scenario_warnings(blind)
    assert "no impulse follows a measurement" in line
    assert "the last impulse is 30.0067 s before it" in line
    assert not scenario_warnings(
        camera(camera__first_image_s="30.1", thruster__last_impulse_s="30")
    )
    schedule = {"thruster__impulses_s": "[60.0, 40.0, 20.0]", "thruster__last_impulse_s": "30"}
    for first_image_s, delay_steps, number in (("35", "0", 1), ("40.1", "0", 0), ("40.1", "2", 1)):
        late = camera(
            camera__first_image_s=first_image_s, thruster__delay_steps=delay_steps, **schedule
        )
        assert len(scenario_warnings(late)) == number


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (
            {"camera__phase_angle_deg": "60"},
            "camera: phase_angle_deg and sun_angle_deg must both be set, .* sun_angle_deg is miss",
        ),
        (
            {"camera__phase_angle_rad": "1"},
            "camera: phase_angle_rad and sun_angle_deg must both be set, .* sun_angle_deg is miss",
        ),
        (
            {"camera__phase_correction": "false"},
            "camera: phase_correction needs phase_angle_deg and sun_angle_deg",
        ),
        ({"camera__brightness": "lambert"}, "camera: brightness needs phase_angle_deg and sun_ang"),
        (
            {"camera__phase_angle_deg": "60", "camera__sun_angle_deg": "90"},
            "needs the radius of the body",
        ),
        (
            {
                "camera__phase_angle_deg": "60",
                "camera__sun_angle_deg": "45",
                "body__radius_m": "100",
            },
            "90 or -90 deg: got 45 deg",
        ),
        (
            {
                "camera__phase_angle_deg": "60",
                "camera__sun_angle_deg": "90",
                "body__radius_m": "1300",
            },
            "times camera.centroid_error_m and the offset of the centre of brightness",
        ),
    ],
)
def test_phase_angle_that_does_not_fit_is_refused(values: dict[str, str], message: str) -> None:
    with pytest.raises(InputError, match=message):
        camera(**values)


def test_offset_in_a_plane_is_toward_the_sun() -> None:
    settings = {"camera__phase_angle_deg": "60", "body__radius_m": "100"}
    for sun_deg, side in (("90", 1.0), ("-90", -1.0), ("270", -1.0)):
        scenario = camera(camera__sun_angle_deg=sun_deg, **settings)
        sensor = scenario.bearing_sensor
        assert isinstance(sensor, OffsetCamera)
        assert sensor.offset_m == pytest.approx((side * 38.9064,), abs=1e-3)
        assert read_text(Scenario, to_toml(scenario), "written") == scenario


@pytest.mark.parametrize(("centroid_error_m", "warns"), [(32.0, True), (33.0, False)])
def test_a_centroid_error_below_the_residual_of_the_light_has_a_warning(
    centroid_error_m: float, warns: bool
) -> None:
    # R (k (0.3 + 0.06 1.3) + 0.85 1.3 0.3 sin 60 deg) = 32.6 m for R = 75 m and k = 0.389.
    text = scenario_text("dart-2022")
    settings = [
        "camera.phase_angle_deg=60",
        "camera.sun_angle_deg=0",
        f"camera.centroid_error_m={centroid_error_m}",
    ]
    scenario = read_text(Scenario, text, "file", settings)

    lines = [line for line in scenario_warnings(scenario) if "centre of brightness" in line]

    assert len(lines) == warns
    assert all("32.6 m" in line for line in lines)


def test_drift_time_without_a_drift_has_a_warning() -> None:
    (line,) = scenario_warnings(camera(camera__drift_time_s="6"))
    assert line == "camera.drift_time_s has no effect: camera.drift_urad is 0; set it, too"
    assert scenario_warnings(camera(camera__drift_time_s="6", camera__drift_urad="1")) == []
