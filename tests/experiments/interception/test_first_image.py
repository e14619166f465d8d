"""`infoset scenarios check --magnitude`."""

from __future__ import annotations

import json

import pytest

from tests.experiments.command_line import Command


def test_check_prints_the_first_image_and_its_error(infoset: Command) -> None:
    code, out, _ = infoset(
        "scenarios", "check", "haiv-2013", "--magnitude", "H=23.8,limit=11,phase=40"
    )
    assert code == 0
    # 10^((11 - 23.8 - 1.5807) / 5) au at 11.5 km/s
    assert out.splitlines()[-1] == (
        "first image by the magnitude, 1 au from the Sun: camera.first_image_s = 17300 (4.81 h "
        "before the arrival); an error of one magnitude is a factor of 1.6: 3.03 h to 7.62 h"
    )


def test_distance_of_the_sun_is_that_of_the_file(infoset: Command) -> None:
    asked = ("scenarios", "check", "asteroid-1997", "--json", "--magnitude", "H=20,limit=5,phase=0")
    found = []
    for distance_km in (150e6, 300e6):
        _, out, _ = infoset(*asked, "--set", f"sun.distance_km={distance_km}")
        found.append(json.loads(out)["first_image"])
    near, far = found
    assert near["sun_distance_au"] == pytest.approx(1.0027, abs=1e-4)
    assert near["first_image_s"] == pytest.approx(2.0 * far["first_image_s"])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("H=23.8,limit=11", "must be three numbers, for example H=23.8,limit=11,phase=40"),
        ("H=23.8,limit=11,phase=40,phase=50", "must be three numbers"),
        ("H=bright,limit=11,phase=40", "must be three numbers"),
        ("H=23.8,limit=11,phase=140", "phase_deg must be at most 120: got 140.0"),
        ("H=23.8,limit=nan,phase=40", "limit must be finite"),
    ],
)
def test_mistaken_magnitude_is_refused(infoset: Command, text: str, message: str) -> None:
    assert message in infoset.refused("scenarios", "check", "haiv-2013", "--magnitude", text)


def test_problems_have_no_magnitude(infoset: Command) -> None:
    infoset.refused("problems", "check", "service-2", "--magnitude", "H=23.8,limit=11,phase=40")
