"""Game noise before a cut-off: its errors put the true state at an end of the set."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from infoset.experiments import load_scenario
from infoset.guidance import NoiseKind
from infoset.sim import Scenario, simulate
from infoset.sim.bound.lower_bound import pair_at
from infoset.sim.bound.pair_of_motions import TruthPair
from infoset.sim.closed_form import possible_miss_m, possible_miss_of, worst_shift_m

RUNS = 10


def latest_pair(scenario: Scenario) -> TruthPair:
    """The pair of motions that arrives last, which has the maximum bound of the missions."""
    bounds = scenario.set_model.bounds
    return pair_at(scenario, bounds.x_m[1], bounds.vx_m_s[1])


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("dart-2022", []),
        ("dart-2022", ["thruster.last_impulse_s=900"]),
        ("dart-2022", ["thruster.last_impulse_s=1800"]),
        ("haiv-2013", []),
        ("haiv-2013", ["thruster.impulses_s=[5400, 2100, 750]"]),
    ],
)
def test_game_noise_is_worse_than_random_noise_and_near_the_bound(
    name: str, settings: list[str]
) -> None:
    """Errors of one sign gave 12.5 m in place of 38 m for haiv-2013, whose lower bound is 39 m."""
    scenario = load_scenario(name, settings)
    random, game = (
        simulate(replace(scenario, noise=noise), runs=RUNS)
        for noise in (NoiseKind.RANDOM, NoiseKind.GAME)
    )
    assert (game.miss_m > random.miss_m).all()
    assert (game.miss_m <= game.guaranteed_miss_m).all()
    assert game.truth_kept.all()
    assert game.miss_m.max() > 0.85 * latest_pair(scenario).bound_m


@pytest.mark.parametrize("manoeuvre", ["constant", "worst-case"])
def test_a_target_at_the_bound_of_the_model_brings_every_run_to_the_closed_form(
    manoeuvre: str,
) -> None:
    """With one sign of the errors for both axes the median was 146 m: the target accelerated with
    it along an axis.
    """
    target = [f"target.manoeuvre={manoeuvre}", "target.acceleration_m_s2=2.7e-5"]
    scenario = load_scenario("dart-2022", [*target, "thruster.last_impulse_s=900"])
    results = simulate(replace(scenario, noise=NoiseKind.GAME), runs=RUNS)
    assert results.miss_m.min() > 0.98 * possible_miss_of(scenario)
    assert results.truth_kept.all()
    assert results.phi_held.all()


def test_without_a_disturbance_the_shift_is_a_straight_line_between_the_bounds() -> None:
    """The miss equals the closed form."""
    settings = [
        "camera.centroid_error_m=3",
        "information_set.disturbance_m_s2=0",
        "target.manoeuvre=none",
    ]
    scenario = load_scenario("dart-2022", settings)
    shifts_m = worst_shift_m(scenario)
    first_s = scenario.nominal_arrival_s
    last_s = 150.0
    speed_m_s = 6140.0
    assert shifts_m is not None
    shift_m, along_z_m = shifts_m
    np.testing.assert_array_equal(shift_m, along_z_m)
    assert shift_m[0] == pytest.approx(-(3.0 + 5.4e-6 * speed_m_s * first_s))
    assert shift_m[-1] == pytest.approx(3.0 + 5.4e-6 * speed_m_s * last_s)
    assert np.diff(shift_m[:-1], 2) == pytest.approx(0.0, abs=1e-9)
    per_second = (shift_m[-1] - shift_m[0]) / (first_s - last_s)
    expected = possible_miss_m(speed_m_s, 5.4e-6, 3.0, first_s, last_s)
    assert shift_m[-1] + per_second * last_s == pytest.approx(expected)


def test_each_axis_has_the_shift_of_its_own_bounds() -> None:
    settings = ["thruster.last_impulse_s=15", "angle_sensor.error_at_nominal_range_y_rad=6e-4"]
    scenario = load_scenario(
        "asteroid-1997-space", [*settings, "angle_sensor.error_at_zero_range_y_rad=4e-4"]
    )
    shift_m = worst_shift_m(scenario)
    model = scenario.set_model
    assert shift_m is not None
    last_image_m = np.array([15.0 * model.closing_speed_m_s])
    np.testing.assert_allclose(
        shift_m[:, -1:], model.angle_sensor.error_bounds(last_image_m) * last_image_m, rtol=2e-3
    )
    along_z = worst_shift_m(load_scenario("asteroid-1997-space", settings[:1]))
    assert along_z is not None
    np.testing.assert_array_equal(shift_m[1], along_z[1])
    assert (np.abs(shift_m[0]) > 1.5 * np.abs(shift_m[1])).mean() > 0.9
