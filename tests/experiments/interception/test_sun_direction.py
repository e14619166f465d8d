"""Phase angle and direction of the Sun in a file, against the direction of [sun]."""

from __future__ import annotations

import math

import numpy as np
import pytest

from infoset.experiments.common.input_file import read_text
from infoset.experiments.interception.scenario_file import scenario_warnings
from infoset.experiments.interception.sun_direction import SunDirection, direction_of
from infoset.sim import Scenario, Sun
from tests.built_in import scenario_text

SUN_M3_S2 = 1.32712440018e20
AU_M = 149_597_870_700.0
RANGE_M = 1e8


@pytest.mark.parametrize("direction_deg", [0.0, 30.0, 120.0, 180.0, -75.0])
@pytest.mark.parametrize("elevation_deg", [0.0, 20.0, -60.0])
def test_direction_of_the_sun_is_that_of_the_positions(
    direction_deg: float, elevation_deg: float
) -> None:
    direction, elevation = np.radians([direction_deg, elevation_deg])
    found = direction_of(Sun(SUN_M3_S2, AU_M, direction, elevation))
    assert found is not None

    # Positions (y, z, x) from the spacecraft: the Sun, and an object on the x axis.
    sun_m = AU_M * np.array(
        [
            math.sin(elevation),
            math.cos(elevation) * math.sin(direction),
            math.cos(elevation) * math.cos(direction),
        ]
    )
    object_m = np.array([0.0, 0.0, RANGE_M])
    to_sun = (sun_m - object_m) / np.linalg.norm(sun_m - object_m)
    phase_deg = math.degrees(math.acos(to_sun @ [0.0, 0.0, -1.0]))
    # The range is 0.07 % of the distance: 0.04 deg.
    assert found.phase_deg == pytest.approx(phase_deg, abs=0.04)
    np.testing.assert_allclose(found.vector(), to_sun, atol=1e-3)


def test_another_attracting_body_has_no_light() -> None:
    assert direction_of(None) is None
    assert direction_of(Sun(3.986004418e14, 1e9, 0.0)) is None


def lit(phase_deg: float, sun_deg: float) -> Scenario:
    """Return DART with the Sun 60 deg behind the camera, toward z."""
    settings = [
        f"sun.gravitational_parameter_m3_s2={SUN_M3_S2}",
        "sun.distance_au=1",
        "sun.direction_deg=120",
        "camera.centroid_error_m=40",
        "thruster.last_impulse_s=30",
        f"camera.phase_angle_deg={phase_deg}",
        f"camera.sun_angle_deg={sun_deg}",
    ]
    return read_text(Scenario, scenario_text("dart-2022"), "file", settings)


@pytest.mark.parametrize(
    ("phase_deg", "sun_deg", "warns"),
    [
        (60.0, 90.0, False),
        (64.9, 90.0, False),
        (65.1, 90.0, True),
        # 5 deg across the line of approach are 4.3 deg of direction.
        (60.0, 95.0, False),
        (60.0, 97.0, True),
        (60.0, 0.0, True),
    ],
)
def test_light_that_contradicts_the_sun_has_a_warning(
    phase_deg: float, sun_deg: float, warns: bool
) -> None:
    lines = [line for line in scenario_warnings(lit(phase_deg, sun_deg)) if "[sun]" in line]
    assert len(lines) == warns
    of_file = SunDirection(phase_deg, sun_deg)
    assert all(
        line.startswith(
            f"camera has {of_file}, but the direction of [sun] gives phase_angle_deg = 60, "
            "sun_angle_deg = 90: "
        )
        for line in lines
    )
