"""Coasting along ellipses, parabolas and hyperbolas, against Kepler's equation in 40 digits."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from infoset.arrays import Floats
from infoset.rendezvous.two_body import (
    OrbitalElements,
    closest_approach_m,
    coast,
    flight_fault,
    perigee_m,
)

EPSILON = 2.0**-53


def exactly_coasted(state: Floats, duration: float) -> Floats:
    """Coast by universal variables, mu = 1, with bisection in 40 digits."""
    r, v = ([mp.mpf(float(each)) for each in part] for part in np.split(state, 2))
    time = abs(mp.mpf(duration))
    sign = 1 if duration >= 0.0 else -1
    radius = mp.sqrt(mp.fdot(r, r))
    along = sign * mp.fdot(r, v)
    inverse_axis = 2 / radius - mp.fdot(v, v)

    def functions(anomaly: mp.mpf) -> tuple[mp.mpf, mp.mpf, mp.mpf]:
        root = mp.sqrt(mp.mpc(inverse_axis)) * anomaly
        if abs(root) < mp.mpf(10) ** -9:  # two terms of the series leave 1e-36
            square = (root**2).real
            return (
                anomaly * (1 - square / 6),
                anomaly**2 * (1 - square / 12) / 2,
                anomaly**3 * (1 - square / 20) / 6,
            )
        return (
            (mp.sin(root) / root).real * anomaly,
            ((1 - mp.cos(root)) / root**2).real * anomaly**2,
            ((root - mp.sin(root)) / root**3).real * anomaly**3,
        )

    def time_of(anomaly: mp.mpf) -> mp.mpf:
        return mp.fdot((radius, along, 1), functions(anomaly))

    low = mp.mpf(0)
    high = mp.mpf(1)
    while time_of(high) < time:
        high *= 2
    for _ in range(150):
        middle = (low + high) / 2
        low, high = (middle, high) if time_of(middle) < time else (low, middle)
    first, second, _ = functions(high)
    later = radius + along * first + (1 - radius * inverse_axis) * second
    f = 1 - second / radius
    g = sign * (radius * first + along * second)
    f_rate = -sign * first / (later * radius)
    g_rate = 1 - second / later
    position = [f * x + g * y for x, y in zip(r, v, strict=True)]
    return np.array(
        position + [f_rate * x + g_rate * y for x, y in zip(r, v, strict=True)], dtype=float
    )


def random_state(seed: int, share: float) -> Floats:
    """A state at a share of the escape velocity, not straight down."""
    random = np.random.default_rng(seed)
    axes = np.linalg.qr(random.normal(size=(3, 3)))[0]
    radius = float(random.uniform(0.5, 2.0))
    angle = float(random.uniform(0.2, np.pi - 0.2))
    speed = share * np.sqrt(2.0 / radius)
    return np.concatenate(
        [radius * axes[0], speed * (np.cos(angle) * axes[0] + np.sin(angle) * axes[1])]
    )


def allowed_error(state: Floats, duration: float) -> float:
    """Error by rounding of the state, which changes period and perigee, and of the time."""
    return float(
        200.0 * EPSILON * (1.0 + abs(duration)) / perigee_m(state[:3], state[3:], 1.0) ** 1.5
    )


@pytest.mark.parametrize("duration", [-30.0, -0.8, 1e-3, 2.0, 40.0])
@pytest.mark.parametrize(
    "share",
    [
        0.4,  # ellipses
        0.95,
        1.0 - 1e-6,
        1.0 - 1e-12,
        1.0,  # a parabola, but for rounding
        1.0 + 1e-12,  # hyperbolas
        1.0 + 1e-6,
        1.05,
        4.0,
    ],
)
@pytest.mark.parametrize("seeds", [(0,), pytest.param((1, 2), marks=pytest.mark.thorough)])
def test_states_on_any_conic_are_coasted(
    share: float, duration: float, seeds: tuple[int, ...]
) -> None:
    for seed in seeds:
        state = random_state(seed, share)
        with mp.workdps(40):
            exact = exactly_coasted(state, duration)

        found = coast(state, duration, 1.0)

        size = np.repeat([np.linalg.norm(exact[:3]), np.linalg.norm(exact[3:])], 3)
        np.testing.assert_allclose(
            found / size, exact / size, rtol=0.0, atol=allowed_error(state, duration)
        )


def test_array_of_states_on_all_conics_is_coasted_as_single_states() -> None:
    states = np.array([random_state(seed, share) for seed, share in enumerate((0.5, 1.0, 2.0))])

    found = coast(states[:, None], np.array([-3.0, 0.0, 5.0, 7.0]), 1.0)

    assert found.shape == (3, 4, 6)
    for row in range(3):
        for column, duration in enumerate((-3.0, 0.0, 5.0, 7.0)):
            alone = coast(states[row], duration, 1.0)
            # Functions of arrays and of single numbers may be rounded differently.
            size = np.repeat([np.linalg.norm(alone[:3]), np.linalg.norm(alone[3:])], 3)
            difference = (found[row, column] - alone) / size
            assert np.abs(difference).max() <= allowed_error(states[row], duration)


@pytest.mark.parametrize(
    ("velocity", "duration"),
    [
        (0.5, 6.0),  # up, and down again
        (0.0, 5.0),
        (-2.0, 5.0),  # down a hyperbola
        (2.0, -5.0),  # the same, backwards
    ],
)
def test_fall_through_the_centre_is_refused(velocity: float, duration: float) -> None:
    with pytest.raises(ValueError, match="a state falls straight into the attracting point"):
        coast(np.array([1.0, 0.0, 0.0, velocity, 0.0, 0.0]), duration, 1.0)


@pytest.mark.parametrize(
    ("velocity", "duration"), [(2.0, 5.0), (0.5, 1.0), (-2.0, 0.1), (-2.0, -50.0)]
)
def test_straight_motion_that_avoids_the_centre_is_coasted(
    velocity: float, duration: float
) -> None:
    state = np.array([1.0, 0.0, 0.0, velocity, 0.0, 0.0])
    with mp.workdps(40):
        exact = exactly_coasted(state, duration)
    # The distance is at least 0.7: no point of the motion is near the centre.
    np.testing.assert_allclose(coast(state, duration, 1.0), exact, rtol=100.0 * EPSILON * 50.0)


def test_state_at_the_centre_is_refused() -> None:
    with pytest.raises(ValueError, match="a state is at the attracting point"):
        coast(np.zeros(6), 1.0, 1.0)


@pytest.mark.parametrize("binding", [-9e-6, -1e-6, 1e-6, 9e-6])
def test_flight_that_ends_before_the_perigee_of_a_near_parabola(binding: float) -> None:
    """It ends at 2e-4 of the distance of its start, where the time to go is 3e-6 of the flight."""
    perigee, last, duration = 1e-5, 2e-4, 0.47
    transverse_squared = perigee * (2.0 - perigee * binding) / last**2
    inward = np.sqrt(2.0 / last - binding - transverse_squared)
    end = np.array([last, 0.0, 0.0, -inward, np.sqrt(transverse_squared), 0.0])
    with mp.workdps(40):
        start = exactly_coasted(end, -duration)
    found = closest_approach_m(start[:3], start[3:], 1.0, duration)
    # A rounding of the state at the start changes the end by some 1e-10 of its distance.
    assert found == pytest.approx(last, rel=1e-8)


@pytest.mark.parametrize("seed", range(40))
def test_closest_approach_is_the_minimum_distance_of_coasted_states(seed: int) -> None:
    random = np.random.default_rng(seed)
    state = random_state(
        seed, float(random.choice([random.uniform(0.3, 0.99), 1.0, random.uniform(1.01, 3.0)]))
    )
    duration = float(10.0 ** random.uniform(-1.0, 1.5))

    found = closest_approach_m(state[:3], state[3:], 1.0, duration)

    steps = 2000
    times = np.linspace(0.0, duration, steps + 1)
    sampled = float(np.linalg.norm(coast(state, times, 1.0)[:, :3], axis=1).min())
    # Half a step from a perigee q the distance is above it by r'' dt^2 / 2 at most, with r'' <= h^2
    # / q^3.
    momentum = np.cross(state[:3], state[3:])
    beyond = 0.5 * (0.5 * duration / steps) ** 2 * float(momentum @ momentum) / found**3
    assert found - 1e-12 <= sampled <= found + beyond + 1e-12


@pytest.mark.parametrize(
    ("velocity", "duration", "is_met"),
    [
        # An ellipse with a perigee inside the planet
        ([0.0, 0.3, 0.0], 0.2, False),
        ([0.0, 0.3, 0.0], 2.0, True),
        ([0.0, 0.3, 0.0], np.inf, True),
        # A hyperbola toward the planet, and away from it
        ([-2.0, 0.1, 0.0], 0.1, False),
        ([-2.0, 0.1, 0.0], 0.5, True),
        ([2.0, 0.1, 0.0], np.inf, False),
        # Straight motion
        ([-1.0, 0.0, 0.0], 0.1, False),
        ([-1.0, 0.0, 0.0], 2.0, True),
    ],
)
def test_flight_that_meets_the_planet_is_refused(
    velocity: list[float], duration: float, is_met: bool
) -> None:
    fault = flight_fault(np.array([1.0, 0.0, 0.0]), np.array(velocity), 1.0, 0.5, duration)
    assert (fault is not None and "the orbit meets the planet during the flight" in fault) == is_met


def test_elements_of_a_hyperbola_give_its_energy_perigee_and_motion() -> None:
    elements = OrbitalElements(-2.0, 1.5, 0.4, 1.0, 2.0, -1.2)
    position, velocity = elements.state(1.0)

    def rates(_: float, y: Floats) -> Floats:
        return np.concatenate([y[3:], -y[:3] / np.linalg.norm(y[:3]) ** 3])

    # Energy 1 / (2 |a|), perigee |a| (e - 1), which DOP853 finds as well.
    assert 0.5 * velocity @ velocity - 1.0 / np.linalg.norm(position) == pytest.approx(
        0.25, rel=1e-14
    )
    assert perigee_m(position, velocity, 1.0) == pytest.approx(1.0, rel=1e-14)
    flown = solve_ivp(
        rates,
        (0.0, 4.0),
        np.concatenate([position, velocity]),
        method="DOP853",
        rtol=1e-12,
        atol=1e-12,
    )
    np.testing.assert_allclose(
        coast(np.concatenate([position, velocity]), 4.0, 1.0), flown.y[:, -1], atol=1e-9
    )


@pytest.mark.parametrize(
    ("axis", "eccentricity", "anomaly", "message"),
    [
        (-1.0, 0.5, 0.0, "a hyperbola a semi-major axis below 0"),
        (1.0, 1.5, 0.0, "a hyperbola a semi-major axis below 0"),
        (1.0, 1.0, 0.0, "give a parabola by position and velocity"),
        (-1.0, 2.0, 2.2, "a hyperbola of eccentricity 2 has true anomalies up to 120 deg"),
    ],
)
def test_elements_that_belong_to_no_conic_are_refused(
    axis: float, eccentricity: float, anomaly: float, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        OrbitalElements(axis, eccentricity, 0.0, 0.0, 0.0, anomaly)
