from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import linprog

from infoset import (
    AngleSensor,
    Model,
    RangeSensor,
    RateSensor,
    SetModel,
    StateBox,
)
from infoset.experiments import load_scenario
from infoset.guidance import Thruster
from infoset.sim import Scenario, Sun
from infoset.sim.bound.lower_bound import lower_bound, pair_at
from infoset.sim.bound.pair_flight import fly_pair
from infoset.sim.bound.pair_of_motions import PairApproach, TruthPair
from infoset.sim.scenario import of_model
from tests.space import in_space

CASES = Path(__file__).parent.parent / "cases"
NOMINAL_LABEL_M = 5801.3e3


def toy(vz_m_s: float = 1e3, max_impulse_m_s: float = 0.5, z_m: float = 1e5) -> Scenario:
    """Two measurements, at 2000 m and at 1000 m, of an object that comes at 1000 m/s; errors of 1
    mrad.
    """
    model = SetModel(
        closing_speed_m_s=1000.0,
        step_s=1.0,
        bounds=StateBox((-z_m, z_m), (2000.0, 2000.0), (-vz_m_s, vz_m_s), (-1000.0, -1000.0)),
        angle_sensor=AngleSensor(1.0, 0.001, 0.001, 2000.0),
        model=Model.PAPER,
    )
    return Scenario(
        name="toy",
        nominal_range_m=2000.0,
        dispersion=model.bounds,
        **of_model(model),
        thruster=Thruster(1000.0, 0.0, max_impulse_m_s),
    )


def cosine(across_m_s: float) -> float:
    """Cosine of the angle between the relative velocity and the x axis, at a closing speed of 1000
    m/s.
    """
    return 1.0 / float(np.sqrt(1.0 + (across_m_s / 1000.0) ** 2))


def with_disturbance(scenario: Scenario, disturbance_m_s2: float) -> Scenario:
    return replace(
        scenario, **of_model(replace(scenario.set_model, disturbance_m_s2=disturbance_m_s2))
    )


def positions(
    pair: TruthPair, scenario: Scenario
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times of all steps and of the arrival, and the lateral positions then, by plain stepping.

    The positions have the shape (C, 2, steps + 1).
    """
    steps = pair.acceleration_m_s2.shape[-1]
    times = np.append(np.arange(steps) * scenario.set_model.step_s, pair.arrival_s)
    z = pair.position_m[:, :-1].T
    v = pair.velocity_m_s[:, :-1].T
    track = [z]
    for i in range(steps):
        duration = times[i + 1] - times[i]
        push = pair.acceleration_m_s2[..., i]
        z = z + v * duration + 0.5 * push * duration**2
        v = v + push * duration
        track.append(z)
    return times, np.stack(track, axis=-1)


def shares(pair: TruthPair, scenario: Scenario, axis: str) -> NDArray[np.float64]:
    """Bounds of an angle of both at the steps until the last common one, as shares of the bound on
    the x axis.

    If both come nearer than the bound, their slope is at most q = W/|V_x| + L/x, and their distance
    x sqrt(1 + q^2). The velocity across x is at most W: that at the start, by accelerations, and
    the whole budget of 1000 m/s.
    """
    assert scenario.thruster.budget_m_s == 1000.0
    pushes = np.abs(pair.acceleration_m_s2).sum(axis=-1)
    speeds = np.abs(pair.velocity_m_s[:, :-1].T) + pushes * scenario.set_model.step_s
    maximum = float(np.hypot.reduce(speeds).max()) + 1000.0
    ranges = pair.label_m + pair.vx_m_s * scenario.set_model.step_s * np.arange(
        pair.last_common_step + 1
    )
    slopes = maximum / -pair.vx_m_s + max(0.0, 0.5 * pair.apart_m - pair.correction_m) / ranges
    farthest = np.asarray(ranges * np.hypot(1.0, slopes), dtype=np.float64)
    bound = scenario.set_model.axis(axis).angle_sensor.error_bound
    return np.asarray(bound(farthest) / bound(np.asarray(ranges, dtype=np.float64)))


def max_half_distance_m(scenario: Scenario, label_m: float, last_common_step: int) -> float:
    """A_s of one axis at 58 km/s, by a dense linear program with one acceleration per step."""
    model = scenario.set_model.axis("z")
    steps = int(np.ceil(label_m / 58e3 / model.step_s))
    times = np.append(np.arange(steps) * model.step_s, label_m / 58e3)
    since = np.maximum(times[:, None] - times[None, :-1], 0.0)
    until = np.maximum(times[:, None] - times[None, 1:], 0.0)
    # Columns: offset and velocity at t = 0, accelerations; each in units of its maximum difference.
    widths = [
        model.bounds.z_m[1] - model.bounds.z_m[0],
        model.bounds.vz_m_s[1] - model.bounds.vz_m_s[0],
    ]
    motion = np.column_stack(
        [
            np.full(len(times), widths[0]),
            widths[1] * times,
            2.0 * model.disturbance_m_s2 * 0.5 * (since**2 - until**2),
        ]
    )
    ranges = label_m - 58e3 * times[: last_common_step + 1]
    limits = 2.0 * ranges * model.angle_sensor.error_bound(ranges)
    common = motion[: last_common_step + 1] / limits[:, None]
    solved = linprog(
        -motion[-1],
        A_ub=np.vstack([common, -common]),
        b_ub=np.ones(2 * len(limits)),
        bounds=(-1.0, 1.0),
    )
    assert solved.status == 0
    return float(-0.5 * solved.fun)


@pytest.mark.parametrize(
    ("last_common_step", "bound_m"), [(199, 11.5), (198, 18.9), (197, 22.6), (196, 22.6)]
)
def test_bound_of_the_nominal_approach(
    last_common_step: int, bound_m: float, asteroid: Scenario
) -> None:
    pair = pair_at(asteroid, NOMINAL_LABEL_M, -58e3, last_common_step=last_common_step)
    assert pair.bound_m == pytest.approx(bound_m, abs=0.05)


@pytest.mark.parametrize(("last_common_step", "bound_m"), [(0, 101.5), (1, 3.0)])
def test_bound_of_two_measurements_equals_its_formula(
    last_common_step: int, bound_m: float
) -> None:
    """Without disturbance the two truths differ by dz(t) = dz(0) + t dv, and T = 2 s.

    Measurements at t = 0 (x = 2000 m) and t = 1 s (x = 1000 m) that can be the same mean |dz(0)| <=
    2 * 0.001 * 2000
    = 4 m and |dz(1)| <= 2 * 0.001 * 1000 = 2 m.

    Only the first can be the same (s = 0), and V_z is within 50 m/s, so |dv| <= 100 m/s: dz(2) =
    dz(0) + 2 dv is at most 204 m. The impulse at t = 1 s may differ and corrects 0.5 m/s * 1 s of
    either: 102 - 0.5 = 101.5 m.

    Both can be the same (s = 1), and V_z is within 2 m/s, so |dv| <= 4 m/s: dz(2) = dz(1) + dv is
    at most 2 + 4 = 6 m, reached from dz(0) = -2 m. No impulse is left, for x = 0 at step 2: 6 / 2 =
    3 m.

    These are distances at x = 0. Impulses at t = 0, 1 and 2 s change V_z, which is at most the
    half-width, by 1.5 m/s.
    """
    half_width = 50.0 if last_common_step == 0 else 2.0
    pair = pair_at(toy(vz_m_s=half_width), 2000.0, -1000.0, last_common_step=last_common_step)
    assert pair.bound_m == pytest.approx(bound_m * cosine(half_width + 1.5), rel=3e-6)


def test_bound_of_two_measurements_equals_its_formula_without_a_binding_box() -> None:
    """As above, V_z within 5 m/s: dz(2) = 2 dz(1) - dz(0) is at most 2 * 2 + 4 = 8 m, so 4 m with
    both the same.

    The start is within 2 m of the x axis, and impulses at t = 0 and 1 s correct 60 m: a single
    motion proves nothing. dv = dz(1) - dz(0) is then 6 m/s, V_z is 3 m/s, and three impulses of 20
    m/s make it 63 m/s. With one measurement only, dz(2) is at most 4 + 2 * 10 = 24 m, and an
    impulse of 20 m/s at t = 1 s leaves nothing of 12 m: both the same is the best choice.

    If either truth may accelerate by 0.25 m/s^2, the difference by 0.5 m/s^2 over each second:
    dz(1) = dz(0) + v + a/2 and dz(2) = dz(1) + v + a + b/2 = 2 dz(1) - dz(0) + (a + b)/2 is at most
    8.5 m: 4.25 m. v is 6 - 0.25 = 5.75 m/s, and V_z at most 2.875 + 2 * 0.25 + 60 m/s.
    """
    strong = toy(vz_m_s=5.0, max_impulse_m_s=20.0, z_m=2.0)
    found = pair_at(strong, 2000.0, -1000.0)
    assert found.last_common_step == 1
    assert found.bound_m == pytest.approx(4.0 * cosine(63.0), rel=3e-6)
    assert lower_bound(strong).bound_m == pytest.approx(4.0 * cosine(63.0), rel=3e-6)
    pushed = pair_at(with_disturbance(strong, 0.25), 2000.0, -1000.0)
    assert pushed.bound_m == pytest.approx(4.25 * cosine(63.375), rel=3e-6)
    poor = replace(strong, thruster=replace(strong.thruster, budget_m_s=10.0))
    assert pair_at(poor, 2000.0, -1000.0, last_common_step=1).bound_m == pytest.approx(
        4.0 * cosine(13.0), rel=3e-6
    )


@pytest.mark.parametrize("slope", [0.01, 0.3])
def test_bound_is_the_minimum_distance_of_an_oblique_flight(slope: float) -> None:
    """As above with both measurements the same, no budget, and V_z within 2 m/s of `slope` times
    the closing speed.

    The two are at z = 3 m and z = -3 m when x = 0, on straight lines: their minimum distances from
    the target are 3 m times 1/sqrt(1 + (V_z/V_x)^2), which is less than 3 m. The bound takes the
    greater velocity for both.
    """
    scenario = toy()
    speed = 1000.0 * slope
    z_m = (-2.0 * speed - 100.0, -2.0 * speed + 100.0)
    box = StateBox(z_m, (2000.0, 2000.0), (speed - 2.0, speed + 2.0), (-1000.0, -1000.0))
    engine = replace(scenario.thruster, budget_m_s=0.0)
    scenario = replace(
        scenario,
        dispersion=box,
        **of_model(replace(scenario.set_model, bounds=box)),
        thruster=engine,
    )
    pair = pair_at(scenario, 2000.0, -1000.0, last_common_step=1)
    miss_m = sorted(fly_pair(scenario, pair).results.miss_m)
    assert miss_m == pytest.approx([3.0 * cosine(speed + 2.0), 3.0 * cosine(speed - 2.0)], rel=3e-6)
    assert pair.bound_m == pytest.approx(3.0 * cosine(speed + 2.0), rel=3e-6)
    assert pair.bound_m < miss_m[1] < 3.0


def oblique(z_m: float, vz_m_s: float, half_width_m_s: float = 5.0, **sensor: Any) -> Scenario:
    """The toy without budget, that starts within 100 m of z and within a half-width of V_z."""
    scenario = toy()
    speeds = (vz_m_s - half_width_m_s, vz_m_s + half_width_m_s)
    box = StateBox((z_m - 100.0, z_m + 100.0), (2000.0, 2000.0), speeds, (-1000.0, -1000.0))
    model = scenario.set_model
    model = replace(model, bounds=box, angle_sensor=replace(model.angle_sensor, **sensor))
    engine = replace(scenario.thruster, budget_m_s=0.0)
    return replace(scenario, dispersion=box, **of_model(model), thruster=engine)


FALLING = {
    "error_at_nominal_range_rad": 1e-4,
    "error_at_zero_range_rad": 1e-2,
    "nominal_range_m": 2100.0,
}


@pytest.mark.parametrize(
    "scenario",
    [
        replace(oblique(-600.0, 300.0), range_sensor=RangeSensor(1.0, 1e-6)),
        replace(oblique(200.0, -300.0, 0.0), rate_sensor=RateSensor(2.0, 1e-4)),
        oblique(-200.0, 100.0, 2.0, **FALLING),
    ],
    ids=["range", "rate", "distance"],
)
def test_measurements_far_from_the_axis_can_be_the_same(scenario: Scenario) -> None:
    """Terms that are quadratic in the slope: of the distance and of cos^2(alpha) in the rate."""
    pair = pair_at(scenario, 2000.0, -1000.0, last_common_step=1)
    flight = fly_pair(scenario, pair)
    assert flight.max_error_share <= 1.0
    assert 0.0 < pair.bound_m <= flight.results.miss_m.max()


def test_precise_range_sensor_limits_the_pair() -> None:
    """At the slope q, the distances of the two differ by at most q |dz|: not more than 2e-5 of the
    range.

    Without the meter dz is -4, 2 and 8 m at x = 2000, 1000 and 0 m, and V_z is at most 103 m/s. The
    maximum slope q, if the miss is below 4 m, is 0.103 + 4/2000 and 0.103 + 4/1000. The second is
    the stricter one: 0.107 * 2/1000 is 10.7 times 2e-5, so the difference and the bound are divided
    by 10.7.
    """
    scenario = replace(oblique(-200.0, 100.0), range_sensor=RangeSensor(1.0, 1e-5))
    pair = pair_at(scenario, 2000.0, -1000.0, last_common_step=1)
    assert pair.apart_m == pytest.approx(8.0 / 10.7, rel=3e-6)
    assert pair.bound_m == pytest.approx(4.0 / 10.7 * cosine(103.0), rel=3e-6)
    blunt = replace(scenario, range_sensor=RangeSensor(1.0, 1.1e-4))
    assert pair_at(blunt, 2000.0, -1000.0, last_common_step=1).apart_m == pytest.approx(
        8.0, rel=3e-6
    )


def test_budget_limits_the_correction_by_impulses() -> None:
    """From 10 km at 1 km/s, impulses from step 5 on: arms 5, 4, 3, 2 and 1 s, 2 m/s each.

    The budget of 5 m/s is best spent as 2, 2 and 1 m/s at the first three: 10 + 8 + 3 = 21 m, not
    30 m.
    """
    scenario = toy(max_impulse_m_s=2.0)
    rich = pair_at(scenario, 10e3, -1000.0, last_common_step=4)
    poor = replace(scenario, thruster=replace(scenario.thruster, budget_m_s=5.0))
    assert rich.correction_m == pytest.approx(30.0)
    assert pair_at(poor, 10e3, -1000.0, last_common_step=4).correction_m == pytest.approx(21.0)


def test_bound_subtracts_a_reserve_for_gravity_on_both_motions() -> None:
    """A flight of 4 h at 0.3 au, with the Sun across the approach: the arrival is later, and images
    are nearer.
    """
    scenario = replace(load_scenario("dart-2022"), sun=Sun(1.327e20, 45e9, 0.5 * np.pi))
    box = scenario.set_model.bounds
    pair = pair_at(scenario, sum(box.x_m) / 2.0, sum(box.vx_m_s) / 2.0)
    flight = fly_pair(scenario, pair)
    assert flight.max_error_share <= 1.0
    assert flight.results.miss_m.max() >= pair.bound_m > 33.0
    assert pair.bound_m < pair_at(replace(scenario, sun=None), pair.label_m, pair.vx_m_s).bound_m


@pytest.mark.thorough
def test_lower_bound_of_the_published_scenario(asteroid: Scenario) -> None:
    done: list[float] = []
    found = lower_bound(asteroid, progress=done.append)
    assert 24.0 < found.bound_m < 25.0
    assert done == sorted(done)
    assert done[-1] == pytest.approx(1.0)
    assert found.speeds_m_s == (-59e3, -58e3, -57e3)
    assert [pair.vx_m_s for pair in found.pairs] == [-59e3, -58e3, -57e3]
    for speed, minimum, maximum in ((-59e3, 22.0, 25.0), (-58e3, 21.5, 24.0), (-57e3, 21.0, 23.0)):
        labels, bounds = found.curve(speed)
        assert (labels[0], labels[-1]) == (5301.3e3, 6301.3e3)
        assert (np.diff(labels) > 0.0).all()
        assert minimum < bounds.min() < bounds.max() < maximum
    assert max(each.bound_m for each in found.by_label) == found.bound_m


@pytest.mark.parametrize(
    ("last_common_step", "half_m", "correction_m", "planar_m", "box_m"),
    [
        (192, 92.59, 106.34, 0.0, 24.6),
        (193, 80.75, 79.93, 0.8, 34.3),
        (194, 69.01, 57.26, 11.8, 40.3),
        (195, 57.36, 38.34, 19.0, 42.8),
        (196, 45.81, 23.17, 22.6, 41.6),
        (197, 34.34, 11.75, 22.6, 36.8),
        (198, 22.97, 4.09, 18.9, 28.4),
        (199, 11.69, 0.17, 11.5, 16.4),
    ],
)
def test_bounds_in_space_by_the_last_common_step(
    last_common_step: int,
    half_m: float,
    correction_m: float,
    planar_m: float,
    box_m: float,
    asteroid: Scenario,
) -> None:
    """A_s and M_s by an independent linear program, and the bounds in a plane and in space; no
    gravity.
    """
    asteroid = replace(asteroid, sun=None)
    box = in_space(asteroid)
    planar, joint = (
        pair_at(scenario, NOMINAL_LABEL_M, -58e3, last_common_step=last_common_step)
        for scenario in (asteroid, box)
    )
    independent_m = max_half_distance_m(asteroid, NOMINAL_LABEL_M, last_common_step)
    assert independent_m == pytest.approx(half_m, abs=0.006)
    assert planar.correction_m == joint.correction_m == pytest.approx(correction_m, abs=0.005)
    assert planar.bound_m == pytest.approx(planar_m, abs=0.06)
    for pair, scenario, farthest_m in (
        (planar, asteroid, independent_m),
        (joint, box, np.sqrt(2.0) * independent_m),
    ):
        # A reserve of 1e-6 of the limits, and at worst all differences reduced to the limits at the
        # true distance.
        least_m = shares(pair, scenario, "z").min() * farthest_m
        assert least_m * (1.0 - 2e-6) <= 0.5 * pair.apart_m <= farthest_m * (1.0 + 1e-7)
    assert joint.bound_m == pytest.approx(box_m, abs=0.05)


def test_pair_in_space_is_admissible(asteroid: Scenario) -> None:
    """The y axis has smaller errors and another box."""
    scenario = in_space(asteroid, error_at_nominal_range_y_rad=1e-4)
    bounds = replace(scenario.set_model.bounds, y_m=(500.0, 900.0))
    model = replace(scenario.set_model, bounds=bounds, disturbance_y_m_s2=0.002)
    scenario = replace(scenario, **of_model(model))
    pair = pair_at(scenario, 5411e3, -59e3)
    assert (pair.position_m[:, 2] == 5411e3).all()
    assert (pair.velocity_m_s[:, 2] == -59e3).all()
    times, positions_m = positions(pair, scenario)
    ranges = pair.label_m - 59e3 * times
    common = slice(0, pair.last_common_step + 1)
    for i, name in enumerate(model.axes):
        planar = model.axis(name)
        for values, limits in (
            (pair.position_m, planar.bounds.z_m),
            (pair.velocity_m_s, planar.bounds.vz_m_s),
        ):
            assert ((limits[0] <= values[:, i]) & (values[:, i] <= limits[1])).all()
        assert (np.abs(pair.acceleration_m_s2[i]) <= planar.disturbance_m_s2 * (1.0 + 1e-12)).all()
        apart = np.abs(positions_m[i, 0] - positions_m[i, 1])[common]
        limits_m = 2.0 * planar.angle_sensor.error_bound(ranges[common]) * ranges[common]
        possible = shares(pair, scenario, name)
        assert (apart / limits_m <= possible).all()
        # A reserve of 1e-6 for rounding, and that of the second order of what is narrowed.
        assert (apart / limits_m / possible).max() >= 1.0 - 1e-5
    ends = positions_m[:, 0, -1] - positions_m[:, 1, -1]
    assert np.hypot(*ends) == pytest.approx(pair.apart_m)
    assert np.count_nonzero(ends) == 2
    assert pair.difference_m == pytest.approx(positions_m[:, 0] - positions_m[:, 1], abs=1e-6)


@pytest.mark.parametrize(
    "fields",
    [{"impulses_s": (80.0, 45.0, 5.0)}, {"last_impulse_s": 8.0, "delay_steps": 3}],
    ids=["times", "cut-off"],
)
def test_best_last_common_step_is_found_with_a_schedule(
    asteroid: Scenario, fields: dict[str, Any]
) -> None:
    """The best of all steps, most of which are no candidates."""
    scenario = replace(asteroid, thruster=replace(asteroid.thruster, **fields))
    found = pair_at(scenario, NOMINAL_LABEL_M, -58e3)
    steps = range(60, 200, 3) if "last_impulse_s" in fields else range(0, 200, 5)
    every = [
        pair_at(scenario, NOMINAL_LABEL_M, -58e3, last_common_step=step).bound_m for step in steps
    ]
    assert found.bound_m >= max(every) * (1.0 - 1e-6)
    assert found.bound_m > pair_at(asteroid, NOMINAL_LABEL_M, -58e3).bound_m
    assert found.last_common_step <= 190


@pytest.mark.parametrize("case", ["narrow-labels", "rate-free-space", "late-cut-off"])
def test_best_pair_is_the_best_of_all_last_common_steps(case: str) -> None:
    """The bound has several maxima over the last common step, with the one motion of
    `narrow-labels` far from best.
    """
    scenario = load_scenario(CASES / f"{case}.toml")
    box = scenario.set_model.bounds
    approach = PairApproach(scenario, box.x_m[1], box.vx_m_s[0])

    found = approach.best_pair()

    every = [approach.pair(step).bound_m for step in range(-1, approach.steps)]
    assert found.bound_m == max(every) > approach.single().bound_m


def test_bound_of_two_measurements_in_space_equals_its_formula() -> None:
    """As in the plane, with V_z within 2 m/s and V_y within 1 m/s, both measurements the same and
    no impulse left.

    |dv_y| <= 2 m/s: dy(2) = dy(1) + dv_y is at most 2 + 2 = 4 m, with dy(0) = 0; dz(2) is at most
    6 m. One of the two is half of |(4, 6)| m from the target at x = 0. The velocity across x is at
    most |(1, 2)| m/s, and 1.5 m/s by impulses.
    """
    scenario = in_space(toy(vz_m_s=2.0))
    bounds = replace(scenario.set_model.bounds, vy_m_s=(-1.0, 1.0))
    scenario = replace(
        scenario, **of_model(replace(scenario.set_model, bounds=bounds)), dispersion=bounds
    )
    pair = pair_at(scenario, 2000.0, -1000.0, last_common_step=1)
    bound_m = 0.5 * np.hypot(4.0, 6.0) * cosine(1.5 + np.hypot(1.0, 2.0))
    assert pair.bound_m == pytest.approx(bound_m, rel=3e-6)
    assert pair.times_s.tolist() == [0.0, 1.0, 2.0]
    assert pair.difference_m[:, -1] == pytest.approx([4.0, 6.0], rel=3e-6)
