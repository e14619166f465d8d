from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rendezvous.linear_game import (
    Thruster,
    circular_orbit_capture,
    free_space_capture,
    mass_loss_capture,
)

EXHAUST_M_S = 350.0 * 9.80665
GEO_RATE = math.sqrt(398600.4418e9 / 42166e3**3)
KM = st.floats(-500e3, 500e3)
SPEED = st.floats(-100.0, 100.0)
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(100)


# Theory, analytic checks: free space, with loss of mass, about a circular orbit.
def test_free_space_from_rest() -> None:
    found = free_space_capture(np.array([100e3, 0.0, 0.0]), np.zeros(3), 20.0 / 2000.0, 10.0 / 2000.0)
    assert found is not None
    assert found.time_s == pytest.approx(6324.5553203368, rel=1e-12)
    np.testing.assert_allclose(found.direction, [1.0, 0.0, 0.0], atol=1e-15)


def test_free_space_in_motion() -> None:
    position, velocity = np.array([100e3, 50e3, -20e3]), np.array([20.0, -50.0, 10.0])
    found = free_space_capture(position, velocity, 0.01, 0.005)
    assert found is not None
    assert found.time_s == pytest.approx(21773.0539755394, rel=1e-12)


def test_loss_of_mass() -> None:
    position, velocity = np.array([1000e3, 500e3, -200e3]), np.array([20.0, -50.0, 10.0])
    found = mass_loss_capture(
        position, velocity, Thruster(20.0, 2000.0, EXHAUST_M_S), Thruster(10.0, 2000.0, EXHAUST_M_S)
    )
    assert found is not None
    assert found.time_s == pytest.approx(25599.6258933, rel=1e-11)


def test_circular_orbit() -> None:
    position, velocity = np.array([100e3, 1500e3, 200e3]), np.array([10.0, -20.0, 15.0])
    found = circular_orbit_capture(position, velocity, 0.01, 0.005, GEO_RATE)
    assert found is not None
    assert found.time_s == pytest.approx(21366.29566606, rel=1e-12)


@given(KM, KM, KM, SPEED, SPEED, SPEED)
def test_free_space_ends_where_the_pursuers_reach_covers_the_evaders(
    x: float, y: float, z: float, vx: float, vy: float, vz: float
) -> None:
    position, velocity = np.array([x + 501e3, y, z]), np.array([vx, vy, vz])
    found = free_space_capture(position, velocity, 0.02, 0.01)
    assert found is not None
    t = found.time_s
    place = position + velocity * t
    np.testing.assert_allclose(found.direction * 0.005 * t * t, place, atol=1e-9 * np.abs(place).max())
    before = t * np.linspace(0.0, 1.0 - 1e-6, 2000)
    apart = np.linalg.norm(position + velocity * before[:, None], axis=1)
    assert (apart > 0.005 * before**2).all()


@pytest.mark.parametrize("evader", [0.01, 0.02])
def test_an_evader_that_is_not_weaker_gets_away(evader: float) -> None:
    assert free_space_capture(np.array([1e5, 0.0, 0.0]), np.zeros(3), 0.01, evader) is None
    assert circular_orbit_capture(np.array([1e5, 0.0, 0.0]), np.zeros(3), 0.01, evader, GEO_RATE) is None


def test_masses_that_hardly_fall_give_the_free_space_answer() -> None:
    position, velocity = np.array([100e3, 50e3, -20e3]), np.array([20.0, -50.0, 10.0])
    heavy = mass_loss_capture(position, velocity, Thruster(20.0, 2000.0, 1e12), Thruster(10.0, 2000.0, 1e12))
    still = mass_loss_capture(position, velocity, Thruster(20.0, 2000.0, math.inf), Thruster(10.0, 2000.0, math.inf))
    free = free_space_capture(position, velocity, 0.01, 0.005)
    assert heavy is not None
    assert free is not None
    assert heavy.time_s == pytest.approx(free.time_s, rel=1e-7)
    assert still is not None
    assert still.time_s == pytest.approx(free.time_s, rel=1e-12)


def test_a_slow_orbit_gives_the_free_space_answer() -> None:
    position, velocity = np.array([30e3, -20e3, 10e3]), np.array([2.0, -5.0, 1.0])
    free = free_space_capture(position, velocity, 0.01, 0.005)
    slow = circular_orbit_capture(position, velocity, 0.01, 0.005, 1e-10, longest_s=1e5)
    assert free is not None
    assert slow is not None
    assert slow.time_s == pytest.approx(free.time_s, rel=1e-6)
    np.testing.assert_allclose(slow.direction, free.direction, atol=1e-4)


@given(st.floats(1e-12, 0.99))
def test_travel_is_the_integral_of_the_integral_of_the_acceleration(share: float) -> None:
    craft = Thruster(20.0, 2000.0, EXHAUST_M_S)
    time = share * craft.mass_kg * craft.exhaust_speed_m_s / craft.thrust_n
    t = 0.5 * time * (1.0 + POINTS)
    rate = craft.thrust_n / craft.exhaust_speed_m_s
    direct = float((0.5 * time * WEIGHTS) @ ((time - t) * craft.thrust_n / (craft.mass_kg - rate * t)))
    assert craft.travel_m(time) == pytest.approx(direct, rel=1e-9)


def test_all_the_mass_burnt_ends_the_game() -> None:
    weak = Thruster(20.0, 2000.0, 100.0)
    assert mass_loss_capture(np.array([1e9, 0.0, 0.0]), np.zeros(3), weak, Thruster(10.0, 2000.0, 100.0)) is None
    with pytest.raises(ValueError, match="all the mass is burnt"):
        weak.travel_m(1e6)


@pytest.mark.parametrize(
    ("position", "message"),
    [(np.zeros(3), "same position"), (np.array([np.nan, 0.0, 0.0]), "finite"), (np.zeros(2), "three components")],
)
def test_what_is_no_game_is_refused(position: np.ndarray, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        free_space_capture(position, np.zeros(3), 0.01, 0.0)
