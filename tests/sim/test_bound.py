from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from guidance import Thruster
from infoset import AngleSensor, RateSensor, SetModel, StateBox
from sim import Scenario
from sim.bound import TruthPair, label_grid, lower_bound, pair_at, possible_acceleration_m_s2

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
    """Without disturbance the two truths differ by dz(t) = dz(0) + dv t, and T = 2 s.

    Measurements at t = 0 (x = 2000 m) and t = 1 s (x = 1000 m) allow |dz(0)| <= 2 * 0.001 * 2000 = 4 m and
    |dz(1)| <= 2 * 0.001 * 1000 = 2 m. Now dz(2) = 2 dz(1) - dz(0) <= 2 * 2 + 4 = 8 m.

    Both measurements common (s = 1): no impulse is left, since step 2 is at x = 0. The bound is 8 / 2 = 4 m. But the
    velocity box allows |dv| <= 5 m/s only, while dz(1) - dz(0) = 2 + 4 = 6 m/s was needed. With dv <= 5:
    dz(2) = dz(1) + dv <= 2 + 5 = 7 m, the bound is 3.5 m with these, and with |dv| <= 4 it is (2 + 4) / 2 = 3 m.

    Only the first one common (s = 0): dz(2) = dz(0) + 2 dv; here the box of the case has |dv| <= 100 m/s, so it is
    4 + 200 = 204 m; the impulse at t = 1 s corrects 0.5 m/s * 1 s = 0.5 m of either: 102 - 0.5 = 101.5 m.
    """
    half_width = 50.0 if last_common_step == 0 else 2.0
    pair = pair_at(toy(vz_m_s=half_width), 2000.0, -1000.0, 0.0, last_common_step=last_common_step)
    assert pair.bound_m == pytest.approx(bound_m)


def test_two_measurements_by_hand_without_a_binding_box() -> None:
    """As above with a wide box: 8 / 2 = 4 m for both common; a strong engine makes that the best choice of s.

    With acceleration up to nu = 0.25 m/s^2 for either truth the difference gains, at steps of 1 s with |a| <= 0.5:
    dz(1) = dz(0) + v + a0 / 2, dz(2) = dz(1) + v + a0 + a1 / 2, so dz(2) = 2 dz(1) - dz(0) + a0 / 2 + a1 / 2
    <= 8 + 0.5 = 8.5 m: 4.25 m.
    """
    strong = toy(greatest_impulse_m_s=1e4)
    strong = replace(strong, thruster=replace(strong.thruster, budget_m_s=1e9))
    found = pair_at(strong, 2000.0, -1000.0, 0.0)
    assert found.last_common_step == 1
    assert found.bound_m == pytest.approx(4.0)
    assert pair_at(strong, 2000.0, -1000.0, 0.25).bound_m == pytest.approx(4.25)
    assert lower_bound(strong).bound_m == pytest.approx(4.0)


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


def test_what_a_truth_can_do(asteroid: Scenario) -> None:
    gravity = 1.5 * 1.324948e20 / 150e9**3 * 6301.3e3
    assert possible_acceleration_m_s2(asteroid) == pytest.approx(0.005 + gravity)
    assert possible_acceleration_m_s2(replace(asteroid, sun=None)) == 0.005


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
