"""A misaligned camera, and an attitude that drifts."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
import pytest

from infoset.experiments import load_scenario
from infoset.guidance import NoiseKind
from infoset.model import SetModel
from infoset.sim import GuaranteeWarning, Scenario, simulate
from infoset.sim.draws import draw

CASE = Path(__file__).parent / "cases" / "bright-asteroid.toml"
RUNS = [20, pytest.param(1000, marks=pytest.mark.thorough)]
TURN_RAD = 2.2e-5


def with_attitude(*settings: str) -> Scenario:
    return load_scenario(CASE, settings)


@pytest.mark.parametrize("runs", RUNS)
@pytest.mark.parametrize("noise", NoiseKind)
@pytest.mark.parametrize(
    "settings",
    [
        [f"camera.misalignment_rad={TURN_RAD}"],
        ["camera.drift_urad=7", "camera.drift_time_s=300"],
        ["camera.misalignment_rad=0.01", "camera.drift_urad=7", "camera.bias=random"],
    ],
    ids=["misalignment", "drift", "both"],
)
def test_truth_is_kept(settings: list[str], noise: NoiseKind, runs: int) -> None:
    results = simulate(replace(with_attitude(*settings), noise=noise), runs)
    assert results.truth_kept.all()
    assert (results.miss_m <= results.guaranteed_miss_m).all()


@dataclass(frozen=True, kw_only=True)
class Unmodelled(Scenario):
    """A scenario whose set takes the camera for an aligned one."""

    @property
    def set_model(self) -> SetModel:
        values = {field.name: getattr(self, field.name) for field in fields(Scenario)}
        assert self.camera is not None
        aligned = replace(self.camera, misalignment_rad=0.0)
        return Scenario(**values | {"camera": aligned}).set_model


def test_truth_is_lost_if_only_the_simulated_camera_is_misaligned() -> None:
    """At the start 1e-3 rad are 124 km, and the set knows the position to 20 km."""
    turned = with_attitude("camera.misalignment_rad=1e-3")
    values = {field.name: getattr(turned, field.name) for field in fields(Scenario)}
    with pytest.warns(GuaranteeWarning, match="the set lost the true state"):
        results = simulate(Unmodelled(**values), 20)
    assert results.truth_kept.mean() < 0.5


def test_a_constant_angle_moves_no_impact_point() -> None:
    """z + b x and V + b V_x have the same predicted miss, so that Phi is that of the aligned
    camera: its median is within 1 %.
    """
    medians_m = []
    for turn_rad in (0.0, TURN_RAD):
        results = simulate(with_attitude(f"camera.misalignment_rad={turn_rad}"), 40)
        medians_m.append(np.median(results.guaranteed_miss_m.filled(np.nan)))
    assert medians_m[1] == pytest.approx(medians_m[0], rel=0.01)


def test_drift_is_part_of_the_error_bound() -> None:
    sensor = with_attitude("camera.drift_urad=7").bearing_sensor
    assert sensor.error_bound(1e6) == pytest.approx(3e-6 + 7e-6 + 6.0 / 1e6)


def test_drift_is_correlated_over_its_time_constant() -> None:
    """The correlation of neighbouring steps of the underlying process is exp(-60/600) = 0.905; that
    of the uniform numbers is 6/pi arcsin of half of it, 0.897.
    """
    scenario = with_attitude("camera.drift_urad=7", "camera.drift_time_s=600")
    drift = draw(scenario, range(600), 0).drift
    assert drift is not None
    assert np.abs(drift).max() <= 1.0
    first, second = drift[..., :-1].ravel(), drift[..., 1:].ravel()
    # 1200 series of 180 steps with a correlation of 10 steps: three standard errors. With 540 s
    # in place of 600 s it is 0.886.
    assert np.corrcoef(first, second)[0, 1] == pytest.approx(0.897, abs=0.007)


def test_drift_time_is_a_tenth_of_the_flight_by_default() -> None:
    assert with_attitude("camera.drift_urad=7").drift_time_s == pytest.approx(1080.0)


def test_a_strongly_misaligned_camera_keeps_the_truth_with_an_offset_of_the_light() -> None:
    """1.1 degrees and an image without an error of its own but 1e-7 rad.

    The offset of the light is a part of x: its error would be 2e-4 of the offset, and beyond the
    bound, if x were computed from the turned angles.
    """
    settings = [
        "camera.misalignment_urad=20000",
        "camera.pixel_error_urad=0.1",
        "camera.centroid_error_m=0",
        "body.radius_m=300",
        "information_set.range_threshold_km=10",
    ]
    scenario = replace(with_attitude(*settings), noise=NoiseKind.GAME)
    assert simulate(scenario, 12).truth_kept.all()
