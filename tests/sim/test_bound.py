from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from guidance import Thruster
from infoset import AngleSensor, RateSensor, SetModel, StateBox
from sim import Scenario
from sim.bound import TruthPair, label_grid, lower_bound, pair_at

NOMINAL_LABEL_M = 5801.3e3


def toy(vz_m_s: float = 1e3, greatest_impulse_m_s: float = 0.5) -> Scenario:
    """Two measurements, at 2000 m and at 1000 m, of an object that comes at 1000 m/s; errors of 1 mrad."""
    model = SetModel(
        closing_speed_m_s=1000.0,
        step_s=1.0,
        bounds=StateBox((-1e5, 1e5), (2000.0, 2000.0), (-vz_m_s, vz_m_s), (-1000.0, -1000.0)),
        angle_sensor=AngleSensor(1.0, 0.001, 0.001, 2000.0),
    )
    return Scenario(
        name="toy",
        description="",
        sun=None,
        nominal_range_m=2000.0,
        dispersion=model.bounds,
        set_model=model,
        range_sensor=None,
        thruster=Thruster(1000.0, 0.0, greatest_impulse_m_s),
    )


def positions(pair: TruthPair, scenario: Scenario) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times of all steps and of the arrival, and z of both truths then, by plain stepping; shape (2, steps + 1)."""
    steps = pair.acceleration_m_s2.shape[1]
    times = np.append(np.arange(steps) * scenario.set_model.step_s, pair.arrival_s)
    z, v = pair.position_m[:, 0], pair.velocity_m_s[:, 0]
    track = [z]
    for i in range(steps):
        duration, push = times[i + 1] - times[i], pair.acceleration_m_s2[:, i]
        z, v = z + v * duration + 0.5 * push * duration**2, v + push * duration
        track.append(z)
    return times, np.array(track).T


@pytest.mark.parametrize(("last_common_step", "bound_m"), [(199, 11.5), (198, 18.9), (197, 22.6), (196, 22.6)])
def test_bound_of_the_nominal_approach(last_common_step: int, bound_m: float, asteroid: Scenario) -> None:
    pair = pair_at(asteroid, NOMINAL_LABEL_M, -58e3, 0.005, last_common_step=last_common_step)
    assert pair.bound_m == pytest.approx(bound_m, abs=0.05)


def test_the_best_step_is_found_from_wherever_the_search_begins(asteroid: Scenario) -> None:
    best = max(
        (pair_at(asteroid, NOMINAL_LABEL_M, -58e3, 0.005, last_common_step=step) for step in range(190, 201)),
        key=lambda pair: pair.bound_m,
    )
    for first in (None, 2.0, 30.0):
        found = pair_at(asteroid, NOMINAL_LABEL_M, -58e3, 0.005, try_first_before_s=first)
        assert found.last_common_step == best.last_common_step
        assert found.bound_m == pytest.approx(best.bound_m)


@pytest.mark.parametrize(("last_common_step", "bound_m"), [(0, 101.5), (1, 3.0)])
def test_two_measurements_by_hand(last_common_step: int, bound_m: float) -> None:
    """Without disturbance the two truths differ by dz(t) = dz(0) + t dv, and T = 2 s.

    Measurements at t = 0 (x = 2000 m) and t = 1 s (x = 1000 m) that can be the same mean |dz(0)| <= 2 * 0.001 * 2000
    = 4 m and |dz(1)| <= 2 * 0.001 * 1000 = 2 m.

    Only the first can be the same (s = 0), and V_z is within 50 m/s, so |dv| <= 100 m/s: dz(2) = dz(0) + 2 dv is at
    most 204 m. The impulse at t = 1 s may differ and corrects 0.5 m/s * 1 s of either: 102 - 0.5 = 101.5 m.

    Both can be the same (s = 1), and V_z is within 2 m/s, so |dv| <= 4 m/s: dz(2) = dz(1) + dv is at most 2 + 4 = 6 m,
    reached from dz(0) = -2 m. No impulse is left, for x = 0 at step 2: 6 / 2 = 3 m.
    """
    half_width = 50.0 if last_common_step == 0 else 2.0
    pair = pair_at(toy(vz_m_s=half_width), 2000.0, -1000.0, 0.0, last_common_step=last_common_step)
    assert pair.bound_m == pytest.approx(bound_m, rel=3e-6)


def test_two_measurements_by_hand_without_a_binding_box() -> None:
    """As above, V_z within 1000 m/s: dz(2) = 2 dz(1) - dz(0) is at most 2 * 2 + 4 = 8 m, so 4 m with both the same.

    With one only, 1002 m - or all that a strong engine leaves of it, nothing: both the same is the best choice.

    If either truth may accelerate by 0.25 m/s^2, the difference by 0.5 m/s^2 over each second: dz(1) = dz(0) + v + a/2
    and dz(2) = dz(1) + v + a + b/2 = 2 dz(1) - dz(0) + (a + b)/2 is at most 8.5 m: 4.25 m.
    """
    strong = toy(greatest_impulse_m_s=1e4)
    strong = replace(strong, thruster=replace(strong.thruster, budget_m_s=1e9))
    found = pair_at(strong, 2000.0, -1000.0, 0.0)
    assert found.last_common_step == 1
    assert found.bound_m == pytest.approx(4.0, rel=3e-6)
    assert pair_at(strong, 2000.0, -1000.0, 0.25).bound_m == pytest.approx(4.25, rel=3e-6)
    assert lower_bound(strong).bound_m == pytest.approx(4.0, rel=3e-6)


def test_budget_limits_what_can_be_corrected() -> None:
    """From 10 km at 1 km/s, impulses from step 5 on: arms 5, 4, 3, 2 and 1 s, 2 m/s each.

    The budget of 5 m/s is best spent as 2, 2 and 1 m/s at the first three: 10 + 8 + 3 = 21 m, not 30 m.
    """
    scenario = toy(greatest_impulse_m_s=2.0)
    rich = pair_at(scenario, 10e3, -1000.0, 0.0, last_common_step=4)
    poor = replace(scenario, thruster=replace(scenario.thruster, budget_m_s=5.0))
    assert rich.correction_m == pytest.approx(30.0)
    assert pair_at(poor, 10e3, -1000.0, 0.0, last_common_step=4).correction_m == pytest.approx(21.0)


@pytest.mark.parametrize("vx_m_s", [-59e3, -57.7e3])
def test_the_pair_is_admissible(vx_m_s: float, asteroid: Scenario) -> None:
    box, sensor = asteroid.set_model.bounds, asteroid.set_model.angle_sensor
    pair = pair_at(asteroid, 5411e3, vx_m_s, 0.005)
    assert (pair.position_m[:, 1] == 5411e3).all()
    assert (pair.velocity_m_s[:, 1] == vx_m_s).all()
    assert (np.abs(pair.position_m[:, 0]) <= box.z_m[1]).all()
    assert (np.abs(pair.velocity_m_s[:, 0]) <= box.vz_m_s[1]).all()
    assert np.abs(pair.acceleration_m_s2).max() == pytest.approx(0.005)
    assert (np.abs(pair.acceleration_m_s2) <= 0.005 * (1.0 + 1e-12)).all()
    times, z = positions(pair, asteroid)
    apart = np.abs(z[0] - z[1])
    ranges = pair.label_m + vx_m_s * times
    common = slice(0, pair.last_common_step + 1)
    assert (apart[common] <= 2.0 * sensor.error_bound(ranges[common]) * ranges[common] * (1.0 + 1e-9)).all()
    assert apart[-1] == pytest.approx(pair.apart_m)
    assert ranges[-1] == pytest.approx(0.0, abs=1e-6)
    later = ranges[pair.last_common_step + 1 : -1]
    assert pair.correction_m == pytest.approx(7.5 * later.sum() / -vx_m_s)


def test_a_rate_sensor_lowers_the_bound(asteroid: Scenario) -> None:
    without = pair_at(asteroid, NOMINAL_LABEL_M, -58e3, 0.005)
    sharp = replace(asteroid, rate_sensor=RateSensor(0.5, 2e-6))
    pair = pair_at(sharp, NOMINAL_LABEL_M, -58e3, 0.005)
    assert pair.bound_m < 0.9 * without.bound_m
    blunt = replace(asteroid, rate_sensor=RateSensor(0.5, 1.0))
    assert pair_at(blunt, NOMINAL_LABEL_M, -58e3, 0.005).bound_m == pytest.approx(without.bound_m)


def test_fewer_measurements_raise_the_bound(asteroid: Scenario) -> None:
    model = asteroid.set_model
    slow = replace(asteroid, set_model=replace(model, angle_sensor=replace(model.angle_sensor, period_s=2.0)))
    often, seldom = (pair_at(each, NOMINAL_LABEL_M, -58e3, 0.005) for each in (asteroid, slow))
    assert seldom.bound_m > often.bound_m
    assert (seldom.last_common_step + 1) % 4 == 0 or seldom.last_common_step == 200


def test_gravity_as_a_free_choice_would_hardly_matter(asteroid: Scenario) -> None:
    gravity = 1.5 * 1.324948e20 / 150e9**3 * 6301.3e3
    strict, free = (pair_at(asteroid, 5309.9e3, -59e3, 0.005 + each).bound_m for each in (0.0, gravity))
    assert strict <= free < strict + 1e-4


def test_labels_are_looked_at_over_whole_periods(asteroid: Scenario) -> None:
    grid = label_grid(asteroid, -58e3)
    assert (grid[0], grid[-1]) == (5301.3e3, 6301.3e3)
    assert (np.diff(grid) > 0.0).all()
    assert grid[8] - grid[0] == pytest.approx(29e3)


def test_lower_bound_of_the_published_scenario(asteroid: Scenario) -> None:
    done: list[float] = []
    found = lower_bound(asteroid, progress=done.append)
    assert 24.0 < found.bound_m < 25.0
    assert done == sorted(done)
    assert done[-1] == pytest.approx(1.0)
    assert found.speeds_m_s == (-59e3, -58e3, -57e3)
    assert [pair.vx_m_s for pair in found.pairs] == [-59e3, -58e3, -57e3]
    for speed, least, greatest in ((-59e3, 22.0, 25.0), (-58e3, 21.5, 24.0), (-57e3, 21.0, 23.0)):
        labels, bounds = found.curve(speed)
        assert (labels[0], labels[-1]) == (5301.3e3, 6301.3e3)
        assert (np.diff(labels) > 0.0).all()
        assert least < bounds.min() < bounds.max() < greatest
    assert max(each.bound_m for each in found.by_label) == found.bound_m


def test_one_label_and_one_speed(asteroid: Scenario) -> None:
    model = asteroid.set_model
    known = replace(model, bounds=replace(model.bounds, x_m=(5.8e6, 5.8e6), vx_m_s=(-58e3, -58e3)))
    found = lower_bound(replace(asteroid, set_model=known))
    assert len(found.by_label) == 1
    assert found.bound_m == pair_at(asteroid, 5.8e6, -58e3, found.disturbance_m_s2).bound_m
