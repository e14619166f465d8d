"""Images of the centre of brightness: corrected, allowed for, and simulated but not modelled."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
import pytest

from infoset.experiments import load_scenario
from infoset.guidance import NoiseKind
from infoset.model import SetModel
from infoset.sensors import OffsetCamera
from infoset.sensors.brightness import Brightness, offset_share
from infoset.sim import GuaranteeWarning, Results, Scenario, simulate
from infoset.sim.kepler import Sight

CASE = Path(__file__).parent / "cases" / "bright-asteroid.toml"
RUNS = [20, pytest.param(1000, marks=pytest.mark.thorough)]


def bright(*settings: str) -> Scenario:
    return load_scenario(CASE, settings)


def offset_of(scenario: Scenario) -> tuple[float, ...]:
    """Return the offset of the images along each axis, m."""
    sensor = scenario.bearing_sensor
    assert isinstance(sensor, OffsetCamera)
    return sensor.offset_m


def unlit(scenario: Scenario) -> Scenario:
    """Return the scenario with images of the centre of the body."""
    assert scenario.camera is not None
    camera = replace(
        scenario.camera, phase_angle_rad=None, sun_angle_rad=None, phase_correction=True
    )
    return replace(scenario, camera=camera)


def known_motion(scenario: Scenario) -> Scenario:
    """Return the scenario with known range and closing speed."""

    x_m = (scenario.nominal_range_m,) * 2
    vx_m_s = (-scenario.closing_speed_m_s,) * 2
    return replace(
        scenario,
        uncertainty=replace(scenario.uncertainty, x_m=x_m, vx_m_s=vx_m_s),
        dispersion=replace(scenario.dispersion, x_m=x_m, vx_m_s=vx_m_s),
    )


def test_images_show_the_centre_of_brightness() -> None:
    sensor = bright().bearing_sensor
    assert isinstance(sensor, OffsetCamera)
    length_m = offset_share(math.radians(80.0), Brightness.MEAN) * 30.0
    turn_rad = math.radians(20.0)
    offset_m = (length_m * math.cos(turn_rad), length_m * math.sin(turn_rad))
    assert sensor.offset_m == pytest.approx(offset_m)

    position_m = np.array([300.0, -200.0, 9e4])
    lateral_m = position_m[:2, None]
    sight = Sight(
        alpha_rad=np.arctan2(lateral_m, position_m[2]),
        omega_rad_s=np.zeros((2, 1)),
        range_m=np.array([math.hypot(*position_m)]),
        along_x_m=position_m[2:],
        slope=lateral_m / position_m[2],
        slope_rate_per_s=np.zeros((2, 1)),
    )
    seen = np.arctan2(position_m[:2] + offset_m, position_m[2])
    np.testing.assert_allclose(sensor.true_value(sight)[:, 0], seen, rtol=1e-12)
    bound_rad = 3e-6 + 6.0 / math.hypot(*position_m)
    assert sensor.bound(sight) == pytest.approx(bound_rad)


def test_bound_without_a_correction_contains_offset_and_residual_along_each_axis() -> None:
    model = bright("camera.phase_correction=false").set_model
    offset_m = offset_of(bright())
    for axis, length_m in zip(model.axes, offset_m, strict=True):
        sensor = model.axis(axis).angle_sensor
        assert sensor.centroid_bound_m == pytest.approx(6.0 + length_m)
        assert sensor.shift_m == 0.0
        assert sensor.error_bound(1e5) == pytest.approx(3e-6 + (6.0 + length_m) / 1e5)


@pytest.mark.parametrize("noise", [NoiseKind.RANDOM, NoiseKind.CORRELATED])
@pytest.mark.parametrize("strategy", ["symmetric-miss", "kalman"])
def test_corrected_flights_are_those_without_an_offset(strategy: str, noise: NoiseKind) -> None:
    """If range and speed are known. Game noise is left out: rounding decides which of two equal
    extremes it takes.
    """
    known = known_motion(replace(bright(), noise=noise))
    flown, reference = (
        simulate(each, 4, strategy=strategy).miss_m for each in (known, unlit(known))
    )
    np.testing.assert_allclose(flown, reference, atol=1e-4)


def assert_guaranteed(results: Results) -> None:
    assert results.truth_kept.all()
    assert not results.set_emptied.any()
    assert (results.miss_m <= results.guaranteed_miss_m).all()


@pytest.mark.parametrize("runs", RUNS)
@pytest.mark.parametrize("noise", NoiseKind)
@pytest.mark.parametrize("is_corrected", [True, False])
def test_truth_is_kept_with_the_offset(is_corrected: bool, noise: NoiseKind, runs: int) -> None:
    scenario = bright(f"camera.phase_correction={str(is_corrected).lower()}")
    assert_guaranteed(simulate(replace(scenario, noise=noise), runs))


@dataclass(frozen=True, kw_only=True)
class Unmodelled(Scenario):
    """A scenario whose set takes the images for those of the centre."""

    @property
    def set_model(self) -> SetModel:
        values = {field.name: getattr(self, field.name) for field in fields(Scenario)}
        return unlit(Scenario(**values)).set_model


@pytest.mark.parametrize("runs", RUNS)
def test_truth_is_lost_if_only_the_simulated_images_have_the_offset(runs: int) -> None:
    """The offset of the images is 15 m, and the set allows for 6 m."""
    modelled = bright()
    values = {field.name: getattr(modelled, field.name) for field in fields(Scenario)}
    with pytest.warns(GuaranteeWarning, match="the set lost the true state"):
        results = simulate(Unmodelled(**values), runs)
    assert results.truth_kept.mean() < 0.5
    assert not results.set_emptied.any()
