"""The minimum distance of motions that approach, recede, graze, or turn around within a step,
against DOP853.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from infoset import AngleSensor, SetSettings, StateBox
from infoset.arrays import Floats
from infoset.guidance import Thruster
from infoset.sim import Manoeuvre, Scenario, Sun, Target, simulate
from infoset.sim.kepler import KeplerMotion, sun_and_orbit

SUN = Sun(1.3e20, 1.5e11, 2.0)
TOLERANCE_M = 1e-3
"""Error that the class allows; DOP853 with a relative tolerance of 1e-13 is far below it at these
ranges.
"""


def rates(sun: Sun | None, manoeuvre_m_s2: Floats) -> Callable[[float, Floats], Floats]:
    """Rates of the relative motion and of the spacecraft's motion, shape (4 axes,)."""
    axes = len(manoeuvre_m_s2) + 1
    acceleration = np.append(manoeuvre_m_s2, 0.0)

    def rate(_: float, state: Floats) -> Floats:
        relative, speed, own, own_speed = state.reshape(4, axes)
        if sun is None:
            return np.concatenate([speed, acceleration, own_speed, np.zeros(axes)])
        there = own + relative
        pull = -sun.gravitational_parameter_m3_s2 * own / np.linalg.norm(own) ** 3
        pull_there = -sun.gravitational_parameter_m3_s2 * there / np.linalg.norm(there) ** 3
        return np.concatenate([speed, pull_there - pull + acceleration, own_speed, pull])

    return rate


def nearest_by_dop853(
    position_m: Floats,
    velocity_m_s: Floats,
    sun: Sun | None,
    manoeuvres_m_s2: Floats,
    step_s: float,
    steps: int,
) -> float:
    """Minimum distance over some steps, each with a constant acceleration: at the start, or where r
    . v has a zero.
    """
    axes = len(position_m)
    own = np.zeros(axes)
    own_speed = np.zeros(axes)
    if sun is not None:
        toward, along = (direction[-axes:] for direction in sun_and_orbit(sun))
        own = -sun.distance_m * toward
        own_speed = np.sqrt(sun.gravitational_parameter_m3_s2 / sun.distance_m) * along

    def radial(_: float, state: Floats) -> float:
        return float(state[:axes] @ state[axes : 2 * axes])

    state = np.concatenate([position_m, velocity_m_s, own, own_speed])
    nearest_m = float(np.linalg.norm(position_m))
    for manoeuvre in manoeuvres_m_s2[:steps]:
        solution = solve_ivp(
            rates(sun, manoeuvre),
            (0.0, step_s),
            state,
            method="DOP853",
            rtol=1e-13,
            atol=1e-7,
            events=radial,
            # Both zeros of a short approach within the step must be seen.
            max_step=step_s / 100.0,
        )
        state = solution.y[:, -1]
        for each in (state, *solution.y_events[0]):
            nearest_m = min(nearest_m, float(np.linalg.norm(each[:axes])))
    return nearest_m


def drawn(number: int) -> tuple[Floats, Floats, Floats, float]:
    """Position, velocity, manoeuvres of 40 steps, and the step of a random start; the kind changes
    with the number.
    """
    generator = np.random.default_rng([54, number])
    axes = int(generator.integers(2, 4))
    range_m = 10.0 ** generator.uniform(3.0, 6.0)
    speed_m_s = 10.0 ** generator.uniform(2.0, 5.0)
    flight_s = range_m / speed_m_s
    kind = ("approaching", "receding", "grazing", "passing in a step")[number % 4]

    offset_m = range_m * generator.uniform(-1.0, 1.0, axes - 1)
    lateral_m_s = speed_m_s * generator.uniform(-0.3, 0.3, axes - 1)
    step_s = flight_s * 10.0 ** generator.uniform(-1.3, -0.5)
    if kind == "receding":
        offset_m = 4.0 * range_m * np.sign(offset_m)
        lateral_m_s = speed_m_s * generator.uniform(0.4, 2.0) * np.sign(offset_m)
    if kind == "grazing":
        # The angle between r and v is nearly right.
        offset_m = 3.0 * range_m * np.sign(offset_m)
        share = range_m * speed_m_s / float(np.abs(offset_m).sum())
        lateral_m_s = np.sign(offset_m) * share * (1.0 + 0.1 * generator.normal(size=axes - 1))
    if kind == "passing in a step":
        step_s = flight_s * generator.uniform(0.8, 2.0)
    position = np.append(offset_m, range_m)
    velocity = np.append(lateral_m_s, -speed_m_s)

    # Up to thirty times the acceleration that turns the motion around within the flight.
    size = float(np.abs(velocity).max()) / flight_s * 10.0 ** generator.uniform(-1.0, 1.5)
    sides = generator.choice([-1.0, 0.0, 1.0], (40, axes - 1))
    return position, velocity, size * sides, step_s


@pytest.mark.parametrize("sun", [None, SUN], ids=["free space", "gravity"])
@pytest.mark.parametrize(
    "number", [*range(8), *(pytest.param(n, marks=pytest.mark.thorough) for n in range(8, 400))]
)
def test_minimum_distance_of_random_motions(number: int, sun: Sun | None) -> None:
    position, velocity, manoeuvres, step_s = drawn(number)
    motion = KeplerMotion(position[None], velocity[None], sun)

    steps = 0
    has_passed = False
    while not has_passed and steps < len(manoeuvres):
        passage = motion.advance(step_s, manoeuvres[steps][:, None])
        has_passed = bool(passage.passed[0])
        steps += 1

    assert has_passed == ((motion.position_m * motion.velocity_m_s).sum() >= 0.0)
    if has_passed:
        expected_m = nearest_by_dop853(position, velocity, sun, manoeuvres, step_s, steps)
        assert abs(passage.min_distance_m[0] - expected_m) <= max(TOLERANCE_M, 1e-9 * expected_m)


@pytest.mark.parametrize("acceleration_m_s2", [0.0, -4e5, 2e5])
@pytest.mark.parametrize("step_s", [0.0234, 0.1])
def test_object_that_recedes_from_the_start_is_nearest_there(
    step_s: float, acceleration_m_s2: float
) -> None:
    """r . v is 5.2e9 m^2/s at the start, and no acceleration makes it negative within a step."""
    position = np.array([[72968.0, -13250.0, 22768.0]])
    velocity = np.array([[87146.0, -24880.0, -65607.0]])
    passage = KeplerMotion(position, velocity, None).advance(
        step_s, np.array([[acceleration_m_s2], [0.0]])
    )

    assert passage.passed[0]
    assert passage.min_distance_m[0] == np.hypot.reduce(position[0])
    assert passage.lateral_m[:, 0].tolist() == [72968.0, -13250.0]


def test_target_that_returns_before_the_arrival_is_nearest_at_its_return() -> None:
    """z = 1000 + 1000 t - 750 t^2 and x = 500 - 250 t are both zero at t = 2; the object recedes
    until t = 0.8.
    """
    exact = StateBox((1000.0, 1000.0), (500.0, 500.0), (1000.0, 1000.0), (-250.0, -250.0))
    scenario = Scenario(
        name="return",
        nominal_range_m=500.0,
        closing_speed_m_s=250.0,
        step_s=0.125,
        uncertainty=exact,
        dispersion=exact,
        angle_sensor=AngleSensor(0.125, 1e-3, 1e-3, 500.0),
        target=Target(Manoeuvre.CONSTANT, 1500.0),
        thruster=Thruster(0.0, 1.0, 1.0),
        information_set=SetSettings(sections=2, fewest_sections=2, disturbance_m_s2=1500.0),
    )
    results = simulate(scenario, 20)

    returns = results.miss_m < 1e-6
    assert returns.any()
    assert not returns.all()
    # The others accelerate away: the start is nearest.
    np.testing.assert_array_equal(results.miss_m[~returns], np.hypot(1000.0, 500.0))
    assert results.phi_held.all()
