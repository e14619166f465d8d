"""The truth against an independent integrator."""

from __future__ import annotations

import numpy as np
import pytest

from sim.kepler import KeplerMotion, closest_position
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
            motion.fire(np.array([impulse]))
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


def test_least_distance_between_steps_matches_a_dense_search() -> None:
    position = np.array([[40.0], [11_000.0]])
    velocity = np.array([[3.0], [-58_000.0]])
    acceleration = np.array([[2.0], [-5.0]])
    moments = np.linspace(0.18, 0.20, 2_000_001)
    z = position[0] + velocity[0] * moments + 0.5 * acceleration[0] * moments**2
    x = position[1] + velocity[1] * moments + 0.5 * acceleration[1] * moments**2
    found = closest_position(position, velocity, acceleration, 0.5)
    assert np.hypot(*found)[0] == pytest.approx(np.hypot(z, x).min(), rel=1e-9)


def test_free_passage_in_free_space_is_the_distance_of_a_straight_line() -> None:
    position, velocity = np.array([[30.0, 100_000.0]]), np.array([[5.0, -58_000.0]])
    motion = KeplerMotion(position, velocity, None)
    least = np.inf
    for _ in range(6):
        passage = motion.advance(0.5)
        least = min(least, passage.least_distance_m[0])
    assert passage.passed[0]
    expected = abs(position[0, 0] * velocity[0, 1] - position[0, 1] * velocity[0, 0]) / np.hypot(*velocity[0])
    assert least == pytest.approx(expected, rel=1e-12)


def test_an_object_that_is_just_beside_or_just_there_is_seen_without_a_warning() -> None:
    """Round numbers bring it there at the end of a step: 29 km at 58 km/s in half a second."""
    flight = KeplerMotion(np.array([[7.0, 29e3], [0.0, 29e3]]), np.array([[0.0, -58e3], [0.0, -58e3]]), None)
    flight.advance(0.5)
    sight = flight.sight()
    assert sight.range_m.tolist() == [7.0, 0.0]
    assert sight.alpha_rad.tolist() == [np.pi / 2, 0.0]
    assert sight.omega_rad_s.tolist() == [58e3 / 7.0, 0.0]
    assert sight.slope.tolist() == sight.slope_rate_per_s.tolist() == [0.0, 0.0]
