"""`infoset scenarios check --magnitude`."""

from __future__ import annotations

import json

import pytest

from tests.experiments.command_line import Command


def test_check_prints_the_first_image_and_its_error(infoset: Command) -> None:
    code, out, _ = infoset(
        "scenarios", "check", "haiv-2013", "--magnitude", "H=23.8,limit=9,phase=40"
    )
    assert code == 0
    # 10^((9 - 23.8 - 1.5807) / 5) au at 11.5 km/s is 6886 s.
    assert out.splitlines()[-1] == (
        "first image by the magnitude, 1 au from the Sun: camera.first_image_s = 6890 (115 "
        "min before the arrival); an error of one magnitude is a factor of 1.6: 72.4 min to 3.03 h"
    )


def test_all_images_are_bright_enough_if_the_first_one_is_before_the_start(
    infoset: Command,
) -> None:
    code, out, _ = infoset(
        "scenarios", "check", "haiv-2013", "--magnitude", "H=23.8,limit=11,phase=40"
    )
    assert code == 0
    # Two magnitudes fainter: 10^(2 / 5) times as early as above, and the flight takes 2 h.
    assert out.splitlines()[-1] == (
        "first image by the magnitude, 1 au from the Sun: the body has the limiting magnitude 11 "
        "4.81 h before the arrival, before the start of the flight: all images are bright enough "
        "(an error of one magnitude is a factor of 1.6: 3.03 h to 7.62 h)"
    )


def test_key_of_the_first_image_is_that_of_the_sensor(infoset: Command) -> None:
    asked = ("scenarios", "check", "asteroid-1997", "--json", "--magnitude")
    _, out, _ = infoset(*asked, "H=20,limit=-3,phase=0")
    found = json.loads(out)["first_image"]
    assert (found["key"], found["before_start"]) == ("angle_sensor.first_image_s", False)


LIT = ("--set", "camera.phase_angle_deg=60", "--set", "camera.sun_angle_deg=0")


def test_phase_angle_of_the_file_is_the_default(infoset: Command) -> None:
    asked = ("scenarios", "check", "haiv-2013", "--json", *LIT, "--magnitude")
    found = []
    for text in ("H=23.8,limit=9", "H=23.8,limit=9,phase=60"):
        _, out, _ = infoset(*asked, text)
        found.append(json.loads(out)["first_image"]["first_image_s"])
    default_s, asked_s = found
    assert default_s == asked_s


def test_phase_angle_that_is_not_that_of_the_file_is_refused(infoset: Command) -> None:
    message = infoset.refused(
        "scenarios", "check", "haiv-2013", *LIT, "--magnitude", "H=23.8,limit=9,phase=10"
    )
    assert "--magnitude: phase is 10, camera.phase_angle_deg is 60" in message


def test_distance_of_the_sun_is_that_of_the_file(infoset: Command) -> None:
    asked = ("scenarios", "check", "asteroid-1997", "--json", "--magnitude", "H=20,limit=5,phase=0")
    found = []
    for distance_km in (150e6, 300e6):
        _, out, _ = infoset(*asked, "--set", f"sun.distance_km={distance_km}")
        found.append(json.loads(out)["first_image"])
    near, far = found
    assert near["sun_distance_au"] == pytest.approx(1.0027, abs=1e-4)
    assert near["first_image_s"] == pytest.approx(2.0 * far["first_image_s"])


def test_distance_of_another_attracting_body_is_not_that_of_the_sun(infoset: Command) -> None:
    """With the gravitational parameter of Jupiter in [sun], the Sun is taken to be at 1 au."""
    _, out, _ = infoset(
        *("scenarios", "check", "comet-fast", "--magnitude", "H=20,limit=11,phase=40"),
        *("--set", "sun.gravitational_parameter_m3_s2=1.26686534e17"),
    )
    assert out.splitlines()[-1].startswith(
        "first image by the magnitude, 1 au from the Sun, because [sun] is another body: "
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("H=23.8,limit=11", "phase is missing: write it, for example H=23.8,limit=11,phase=40"),
        ("H=23.8,phase=40", "must be three numbers, for example H=23.8,limit=11,phase=40"),
        ("H=23.8,limit=11,phase=40,size=3", "must be three numbers"),
        ("H=23.8,limit=11,phase=40,phase=50", "must be three numbers"),
        ("H=bright,limit=11,phase=40", "must be three numbers"),
        ("H=23.8,limit=11,phase=140", "--magnitude: phase must be at most 120: got 140"),
        ("H=23.8,limit=nan,phase=40", "--magnitude: limit must be a finite number: got nan"),
    ],
)
def test_mistaken_magnitude_is_refused(infoset: Command, text: str, message: str) -> None:
    assert message in infoset.refused("scenarios", "check", "haiv-2013", "--magnitude", text)


def test_problems_have_no_magnitude(infoset: Command) -> None:
    infoset.refused("problems", "check", "service-2", "--magnitude", "H=23.8,limit=11,phase=40")
