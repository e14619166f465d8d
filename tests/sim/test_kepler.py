"""The truth against an independent integrator."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from infoset.arrays import Floats
from infoset.sim.kepler import KeplerMotion, sun_and_orbit
from infoset.sim.scenario import Sun

hy = pytest.importorskip("heyoka", reason="needs the extra test: the independent integrator")

SUN_K = 1.324948e20
DISTANCE = 150e9
IMPULSES = {30.0: 7.0, 60.0: -3.5}


def relative_by_taylor(position: Floats, velocity: Floats, sun: Sun, duration_s: float) -> Floats:
    """Relative motion with impulses along each lateral axis, by Taylor series.

    The unknowns are the relative motion and that of the spacecraft: no cancellation of heliocentric
    positions.
    """
    axes = len(position)
    parameter = sun.gravitational_parameter_m3_s2
    place, speed, own, own_speed = (
        hy.make_vars(*(f"{name}{axis}" for axis in range(axes))) for name in "rvpq"
    )
    here = sum(p * p for p in own) ** 1.5
    there = sum((p + r) * (p + r) for p, r in zip(own, place, strict=True)) ** 1.5
    system = [*zip(place, speed, strict=True)]
    system += [
        (v, parameter * (p / here - (p + r) / there))
        for r, v, p in zip(place, speed, own, strict=True)
    ]
    system += [
        *zip(own, own_speed, strict=True),
        *((q, -parameter * p / here) for p, q in zip(own, own_speed, strict=True)),
    ]
    toward, along = (direction[-axes:] for direction in sun_and_orbit(sun))
    orbit = np.sqrt(parameter / sun.distance_m) * along
    state = np.concatenate([position, velocity, -sun.distance_m * toward, orbit])
    integrator = hy.taylor_adaptive(system, state, tol=1e-18)
    for moment, impulse in IMPULSES.items():
        integrator.propagate_until(moment)
        integrator.state[axes : 2 * axes - 1] -= impulse
        integrator.state[3 * axes : 4 * axes - 1] += impulse
    integrator.propagate_until(duration_s)
    return np.array(integrator.state[: 2 * axes])


@pytest.mark.parametrize("step_s", [0.1, 0.5, 3.0])
@pytest.mark.parametrize(
    ("direction", "elevation"),
    [
        (90.0, None),
        (-90.0, None),
        (30.0, None),
        (180.0, None),
        (0.0, None),
        (90.0, 0.0),
        (-35.0, 25.0),
        (160.0, -70.0),
    ],
)
def test_motion_agrees_with_an_independent_integrator(
    step_s: float, direction: float, elevation: float | None
) -> None:
    sun = Sun(SUN_K, DISTANCE, np.radians(direction), np.radians(elevation or 0.0))
    position = np.array([5000.0, -8000.0, 8e6])
    velocity = np.array([-40.0, 90.0, -58_900.0])
    if elevation is None:
        position = position[1:]
        velocity = velocity[1:]
    motion = KeplerMotion(position[None], velocity[None], sun)
    for number in range(round(120.0 / step_s)):
        if (impulse := IMPULSES.get(round(number * step_s, 9))) is not None:
            motion.fire(np.full((len(position) - 1, 1), impulse))
        motion.advance(step_s)
    expected = relative_by_taylor(position, velocity, sun, 120.0)
    np.testing.assert_allclose(motion.position_m[0], expected[: len(position)], rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(
        motion.velocity_m_s[0], expected[len(position) :], rtol=0.0, atol=1e-8
    )


def test_min_distance_between_steps_matches_a_dense_search() -> None:
    """A target that accelerates, in free space: the motion is a parabola."""
    position = np.array([40.0, 11_000.0])
    velocity = np.array([3.0, -58_000.0])
    acceleration = 2.0e4
    moments = np.linspace(0.18, 0.20, 2_000_001)
    z = position[0] + velocity[0] * moments + 0.5 * acceleration * moments**2
    x = position[1] + velocity[1] * moments
    passage = KeplerMotion(position[None], velocity[None], None).advance(
        0.5, np.array([[acceleration]])
    )
    assert passage.min_distance_m[0] == pytest.approx(np.hypot(z, x).min(), rel=1e-9)
    assert passage.arrival_s[0] == pytest.approx(11.0 / 58.0, rel=1e-14)


def closest_by_scipy(
    position: Floats, velocity: Floats, sun: Sun, longest_s: float
) -> tuple[float, float, float]:
    """Time and distance of the closest approach, and the minimum distance from the Sun until then.

    Both craft move around the Sun; the unknowns are the relative motion and that of the spacecraft.
    """
    parameter = sun.gravitational_parameter_m3_s2
    axes = len(position)
    toward, along = (direction[-axes:] for direction in sun_and_orbit(sun))

    def rates(_: float, state: Floats) -> Floats:
        relative, speed, own, own_speed = state.reshape(4, axes)
        pull = -parameter * own / np.linalg.norm(own) ** 3
        there = own + relative
        return np.concatenate(
            [speed, -parameter * there / np.linalg.norm(there) ** 3 - pull, own_speed, pull]
        )

    def receding(_: float, state: Floats) -> float:
        return float(state[:axes] @ state[axes : 2 * axes])

    receding.terminal, receding.direction = True, 1.0  # type: ignore[attr-defined]
    orbit = np.sqrt(parameter / sun.distance_m) * along
    start = np.concatenate([position, velocity, -sun.distance_m * toward, orbit])
    solution = solve_ivp(
        rates,
        (0.0, longest_s),
        start,
        method="DOP853",
        rtol=1e-13,
        atol=1e-7,
        events=receding,
        max_step=longest_s / 50.0,
    )
    relative = solution.y[:axes]
    own = solution.y[2 * axes : 3 * axes]
    nearest = min(np.linalg.norm(own, axis=0).min(), np.linalg.norm(own + relative, axis=0).min())
    return float(solution.t[-1]), float(np.linalg.norm(relative[:, -1])), float(nearest)


@pytest.mark.parametrize("flights", [60, pytest.param(300, marks=pytest.mark.thorough)])
def test_the_miss_is_exact_in_gravity_of_any_strength(flights: int) -> None:
    """From a planet to a star, ranges of up to 80 % of the distance from it, speeds from a tenth of
    the orbital one.
    """
    random = np.random.default_rng(flights)
    flown = 0
    strongest = 0.0
    while flown < flights:
        parameter = 10.0 ** random.uniform(13.0, 20.2)
        distance = 10.0 ** random.uniform(6.8, 11.2)
        range_m = distance * 10.0 ** random.uniform(-2.0, -0.1)
        speed = np.sqrt(parameter / distance) * 10.0 ** random.uniform(-1.0, 1.5)
        axes = int(random.choice([2, 3]))
        elevation = float(random.uniform(-1.5, 1.5)) if axes == 3 else 0.0
        sun = Sun(parameter, distance, float(random.uniform(-np.pi, np.pi)), elevation)
        position = np.append(range_m * random.uniform(-0.01, 0.01, axes - 1), range_m)
        velocity = np.append(speed * random.uniform(-0.1, 0.1, axes - 1), -speed)
        arrival_s, expected_m, nearest_m = closest_by_scipy(
            position, velocity, sun, 3.0 * range_m / speed
        )
        if arrival_s == 3.0 * range_m / speed or nearest_m < 0.15 * distance:
            continue  # it does not come near, or falls into the Sun
        motion = KeplerMotion(position[None], velocity[None], sun)
        step_s = range_m / speed / 30.0
        steps = 0
        while not (passage := motion.advance(step_s)).passed[0]:
            steps += 1
        assert abs(passage.min_distance_m[0] - expected_m) <= max(1e-3, 1e-9 * expected_m)
        assert steps * step_s <= arrival_s * (1.0 + 1e-9)
        flown = flown + 1
        strongest = max(strongest, (range_m / speed) * np.sqrt(parameter / distance**3))
    assert strongest > 0.5  # radians of the orbit


def test_the_motion_does_not_depend_on_the_batch_or_on_the_step() -> None:
    """The length of a leap depends on its engagement only.

    In strong gravity two starts move together as each alone.
    """
    sun = Sun(3.986004418e14, 6.878e6, np.radians(100.0))
    position = np.array([[-20.0, 2.8e6], [5e4, 1.4e6]])
    velocity = np.array([[1100.0, -14_000.0], [-300.0, -9_000.0]])
    together = KeplerMotion(position, velocity, sun)
    alone = [KeplerMotion(position[i : i + 1], velocity[i : i + 1], sun) for i in range(2)]
    short = KeplerMotion(position, velocity, sun)
    for _ in range(100):
        together.advance(1.0)
        for motion in alone:
            motion.advance(1.0)
        for _ in range(4):
            short.advance(0.25)
    np.testing.assert_array_equal(
        together.position_m, np.concatenate([motion.position_m for motion in alone])
    )
    np.testing.assert_allclose(together.position_m, short.position_m, rtol=0.0, atol=1e-4)
