"""Magnitudes of bodies, and the distance at which a camera sees them."""

from __future__ import annotations

import math

import pytest

from infoset.sim.detection import AU_M, FACTOR_PER_MAGNITUDE, Magnitude, phase_magnitude


@pytest.mark.parametrize(
    ("phase_deg", "magnitude"), [(20.0, 1.0001), (40.0, 1.5807), (60.0, 2.1473), (90.0, 3.1757)]
)
def test_phase_function_is_that_of_sbpy(phase_deg: float, magnitude: float) -> None:
    """The numbers of `sbpy.photometry.HG` for G = 0.15, of four digits."""
    assert phase_magnitude(phase_deg) == pytest.approx(magnitude, abs=6e-5)


def test_phase_function_is_zero_at_opposition() -> None:
    assert phase_magnitude(0.0) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(("limit", "minutes"), [(9.0, 116.0), (11.0, 290.0), (13.0, 729.0)])
def test_body_of_60_m_is_seen_some_hours_before_the_impact(limit: float, minutes: float) -> None:
    """D = 60 m with the albedo 0.15, at 11.5 km/s, 40 deg and 1 au from the Sun."""
    absolute = 5.0 * math.log10(1329.0 / (0.060 * math.sqrt(0.15)))
    distance_m = Magnitude(absolute, limit, 40.0).distance_m(AU_M)
    assert distance_m / 11_500.0 / 60.0 == pytest.approx(minutes, abs=0.5)


def test_distance_has_the_limiting_magnitude() -> None:
    camera = Magnitude(20.0, 12.0, 60.0)
    sun_distance_m = 1.7 * AU_M
    distance_m = camera.distance_m(sun_distance_m)
    apparent = 20.0 + 5.0 * math.log10(1.7 * distance_m / AU_M) + phase_magnitude(60.0)
    assert apparent == pytest.approx(12.0, abs=1e-12)
    brighter = Magnitude(21.0, 12.0, 60.0)
    assert distance_m / brighter.distance_m(sun_distance_m) == pytest.approx(FACTOR_PER_MAGNITUDE)
    assert pytest.approx(1.585, abs=1e-3) == FACTOR_PER_MAGNITUDE
