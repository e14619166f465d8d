"""The truth against an independent integrator."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from infoset.arrays import Floats
from sim.kepler import KeplerMotion, sun_and_orbit
from sim.scenario import Sun

hy = pytest.importorskip("heyoka", reason="needs the extra test: the independent integrator")

SUN_K = 1.324948e20
DISTANCE = 150e9


def integrate_independently(
    position: np.ndarray, velocity: np.ndarray, sun_direction: float, duration: float, impulses: dict[float, float]
) -> np.ndarray:
    """Both craft about the Sun by Taylor series, one by one, in heliocentric coordinates."""
    names = [hy.make_vars(*(f"{name}{craft}" for name in ("z", "x", "u", "w"))) for craft in "ad"]
    system = []
    for z, x, u, w in names:
        cubed = (z * z + x * x) ** 1.5
        system += [(z, u), (x, w), (u, -SUN_K * z / cubed), (w, -SUN_K * x / cubed)]
    toward = np.array([np.sin(sun_direction), np.cos(sun_direction)])
    along = np.array([toward[1], -toward[0]])
    if along[1] < 0.0:
        along = -along
    craft = -DISTANCE * toward
    speed = np.sqrt(SUN_K / DISTANCE) * along
    state = [*craft, *speed, *(craft + position), *(speed + velocity)]
    integrator = hy.taylor_adaptive(system, state, tol=1e-18)
    for moment, impulse in sorted(impulses.items()):
        integrator.propagate_until(moment)
        integrator.state[2] += impulse
    integrator.propagate_until(duration)
    result = integrator.state
    return np.array([*(result[4:6] - result[0:2]), *(result[6:8] - result[2:4])])


@pytest.mark.parametrize("sun_degrees", [90.0, -90.0, 30.0, 180.0])
@pytest.mark.parametrize("step", [0.5, 0.1, 3.0])
def test_motion_agrees_with_an_independent_integrator(sun_degrees: float, step: float) -> None:
    position = np.array([-8000.0, 8_000_000.0])
    velocity = np.array([90.0, -58_900.0])
    motion = KeplerMotion(position[None], velocity[None], Sun(SUN_K, DISTANCE, np.radians(sun_degrees)))
    impulses = {30.0: 7.0, 60.0: -3.5}
    for number in range(round(120.0 / step)):
        if (impulse := impulses.get(round(number * step, 9))) is not None:
            motion.fire(np.array([[impulse]]))
        motion.advance(step)
    expected = integrate_independently(position, velocity, float(np.radians(sun_degrees)), 120.0, impulses)
    # The independent coordinates are 1.5e11 m: their own rounding is 3e-5 m a step, so it bounds the comparison.
    np.testing.assert_allclose(motion.position_m[0], expected[:2], rtol=0.0, atol=5e-4)
    np.testing.assert_allclose(motion.velocity_m_s[0], expected[2:], rtol=0.0, atol=1e-6)


def relative_by_taylor(position: np.ndarray, velocity: np.ndarray, sun_direction: float, duration: float) -> np.ndarray:
    """Relative motion in relative coordinates, by Taylor series: no cancellation of heliocentric positions."""
    z, x, u, w, q, p, r, s = hy.make_vars("z", "x", "u", "w", "q", "p", "r", "s")
    craft = (q * q + p * p) ** 1.5
    target = ((q + z) ** 2 + (p + x) ** 2) ** 1.5
    system = [
        (z, u),
        (x, w),
        (u, SUN_K * q / craft - SUN_K * (q + z) / target),
        (w, SUN_K * p / craft - SUN_K * (p + x) / target),
        (q, r),
        (p, s),
        (r, -SUN_K * q / craft),
        (s, -SUN_K * p / craft),
    ]
    toward = np.array([np.sin(sun_direction), np.cos(sun_direction)])
    along = np.array([toward[1], -toward[0]])
    if along[1] < 0.0:
        along = -along
    speed = np.sqrt(SUN_K / DISTANCE) * along
    integrator = hy.taylor_adaptive(system, [*position, *velocity, *(-DISTANCE * toward), *speed], tol=1e-18)
    integrator.propagate_until(duration)
    return np.array(integrator.state[:4])


@pytest.mark.parametrize("sun_degrees", [90.0, -90.0, 30.0, 0.0])
def test_error_is_under_a_micrometre_over_120_seconds(sun_degrees: float) -> None:
    position, velocity = np.array([-8000.0, 7_000_000.0]), np.array([90.0, -58_000.0])
    motion = KeplerMotion(position[None], velocity[None], Sun(SUN_K, DISTANCE, np.radians(sun_degrees)))
    for _ in range(240):
        motion.advance(0.5)
    expected = relative_by_taylor(position, velocity, float(np.radians(sun_degrees)), 120.0)
    np.testing.assert_allclose(motion.position_m[0], expected[:2], rtol=0.0, atol=1e-6)


def test_min_distance_between_steps_matches_a_dense_search() -> None:
    """A target that accelerates, in free space: the motion is a parabola."""
    position, velocity, acceleration = np.array([40.0, 11_000.0]), np.array([3.0, -58_000.0]), 2.0e4
    moments = np.linspace(0.18, 0.20, 2_000_001)
    z = position[0] + velocity[0] * moments + 0.5 * acceleration * moments**2
    x = position[1] + velocity[1] * moments
    passage = KeplerMotion(position[None], velocity[None], None).advance(0.5, np.array([[acceleration]]))
    assert passage.min_distance_m[0] == pytest.approx(np.hypot(z, x).min(), rel=1e-9)
    assert passage.arrival_s[0] == pytest.approx(11.0 / 58.0, rel=1e-14)


def closest_by_scipy(position: Floats, velocity: Floats, sun: Sun, longest_s: float) -> tuple[float, float, float]:
    """Time and distance of the closest approach, and the minimum distance from the Sun until then.

    Both craft move around the Sun; the unknowns are the relative motion and that of the spacecraft.
    """
    parameter, axes = sun.gravitational_parameter_m3_s2, len(position)
    toward, along = (direction[-axes:] for direction in sun_and_orbit(sun))

    def rates(_: float, state: Floats) -> Floats:
        relative, speed, own, own_speed = state.reshape(4, axes)
        pull = -parameter * own / np.linalg.norm(own) ** 3
        there = own + relative
        return np.concatenate([speed, -parameter * there / np.linalg.norm(there) ** 3 - pull, own_speed, pull])

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
    relative, own = solution.y[:axes], solution.y[2 * axes : 3 * axes]
    nearest = min(np.linalg.norm(own, axis=0).min(), np.linalg.norm(own + relative, axis=0).min())
    return float(solution.t[-1]), float(np.linalg.norm(relative[:, -1])), float(nearest)


@pytest.mark.parametrize("flights", [60, pytest.param(300, marks=pytest.mark.thorough)])
def test_the_miss_is_exact_in_gravity_of_any_strength(flights: int) -> None:
    """From a planet to a star, ranges of up to 80 % of the distance from it, speeds from a tenth of the orbital one."""
    random, flown, strongest = np.random.default_rng(flights), 0, 0.0
    while flown < flights:
        parameter, distance = 10.0 ** random.uniform(13.0, 20.2), 10.0 ** random.uniform(6.8, 11.2)
        range_m = distance * 10.0 ** random.uniform(-2.0, -0.1)
        speed = np.sqrt(parameter / distance) * 10.0 ** random.uniform(-1.0, 1.5)
        axes = int(random.choice([2, 3]))
        elevation = float(random.uniform(-1.5, 1.5)) if axes == 3 else 0.0
        sun = Sun(parameter, distance, float(random.uniform(-np.pi, np.pi)), elevation)
        position = np.append(range_m * random.uniform(-0.01, 0.01, axes - 1), range_m)
        velocity = np.append(speed * random.uniform(-0.1, 0.1, axes - 1), -speed)
        arrival_s, expected_m, nearest_m = closest_by_scipy(position, velocity, sun, 3.0 * range_m / speed)
        if arrival_s == 3.0 * range_m / speed or nearest_m < 0.15 * distance:
            continue  # it does not come near, or falls into the Sun
        motion, step_s, steps = KeplerMotion(position[None], velocity[None], sun), range_m / speed / 30.0, 0
        while not (passage := motion.advance(step_s)).passed[0]:
            steps += 1
        assert abs(passage.min_distance_m[0] - expected_m) <= max(1e-3, 1e-9 * expected_m)
        assert steps * step_s <= arrival_s * (1.0 + 1e-9)
        flown, strongest = flown + 1, max(strongest, (range_m / speed) * np.sqrt(parameter / distance**3))
    assert strongest > 0.5  # radians of the orbit


def test_the_motion_does_not_depend_on_the_batch_or_on_the_step() -> None:
    """The length of a leap is that of the engagement: strong gravity, two starts together and alone."""
    sun = Sun(3.986004418e14, 6.878e6, np.radians(100.0))
    position, velocity = np.array([[-20.0, 2.8e6], [5e4, 1.4e6]]), np.array([[1100.0, -14_000.0], [-300.0, -9_000.0]])
    together = KeplerMotion(position, velocity, sun)
    alone = [KeplerMotion(position[i : i + 1], velocity[i : i + 1], sun) for i in range(2)]
    short = KeplerMotion(position, velocity, sun)
    for _ in range(100):
        together.advance(1.0)
        for motion in alone:
            motion.advance(1.0)
        for _ in range(4):
            short.advance(0.25)
    np.testing.assert_array_equal(together.position_m, np.concatenate([motion.position_m for motion in alone]))
    np.testing.assert_allclose(together.position_m, short.position_m, rtol=0.0, atol=1e-4)


def test_a_low_orbit_around_the_earth() -> None:
    """The closest approach of two integrators of order 8 is 180 810.888 m; steps of half a second were 0.11 m short."""
    sun = Sun(3.986004418e14, 6.878e6, np.radians(100.0))
    motion = KeplerMotion(np.array([[-20.0, 2.8e6]]), np.array([[1100.0, -14_000.0]]), sun)
    while not (passage := motion.advance(1.0)).passed[0]:
        pass
    _, expected_m, _ = closest_by_scipy(np.array([-20.0, 2.8e6]), np.array([1100.0, -14_000.0]), sun, 400.0)
    assert expected_m == pytest.approx(180_810.888, abs=1e-3)
    assert passage.min_distance_m[0] == pytest.approx(expected_m, abs=1e-4)
