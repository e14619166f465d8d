from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from rendezvous.pursuit_evasion._extremal import (
    acceleration,
    derivatives,
    end_of,
    flow_back,
    shoot_back,
)
from rendezvous.pursuit_evasion._pair import across

Floats = NDArray[np.float64]
PLACE = st.floats(-1.5, 1.5)
OBLATENESS = (0.0, 5e-4)


def potential(r: NDArray[np.complex128], oblateness: float) -> complex:
    q = (r * r).sum()
    return complex(1.0 / np.sqrt(q) + oblateness * (q**-1.5 - 3.0 * r[2] ** 2 * q**-2.5))


def gravity(r: Floats, oblateness: float) -> Floats:
    out = np.empty(3)
    acceleration(r, 1.0, oblateness, out)
    return out


@pytest.mark.parametrize("oblateness", [0.0, 0.3])
@given(PLACE, PLACE, PLACE)
@settings(deadline=None, max_examples=50)
def test_gravity_is_the_gradient_of_the_potential(oblateness: float, x: float, y: float, z: float) -> None:
    r = np.array([x, y, z + 3.0])
    step = 1e-30
    gradient = [potential(r + 1j * step * axis, oblateness).imag / step for axis in np.eye(3)]
    np.testing.assert_allclose(gravity(r, oblateness), gradient, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("oblateness", [0.0, 0.3])
def test_derivatives_are_those_of_gravity(oblateness: float) -> None:
    random = np.random.default_rng(1)
    g, first, second = np.empty(3), np.empty((3, 3)), np.empty((3, 3))
    step = 1e-5
    for _ in range(20):
        r, p = random.uniform(0.6, 1.5, 3) * random.choice([-1.0, 1.0], 3), random.standard_normal(3)
        derivatives(r, p, 1.0, oblateness, g, first, second, True)
        np.testing.assert_allclose(g, gravity(r, oblateness), rtol=1e-13)
        by_difference = np.empty((3, 3))
        of_product = np.empty((3, 3))
        for i, axis in enumerate(np.eye(3)):
            ahead, behind = np.empty((3, 3)), np.empty((3, 3))
            derivatives(r + step * axis, p, 1.0, oblateness, g, ahead, second.copy(), False)
            derivatives(r - step * axis, p, 1.0, oblateness, g, behind, second.copy(), False)
            by_difference[:, i] = (gravity(r + step * axis, oblateness) - gravity(r - step * axis, oblateness)) / (
                2.0 * step
            )
            of_product[:, i] = (ahead - behind) @ p / (2.0 * step)
        np.testing.assert_allclose(first, by_difference, atol=1e-7)
        np.testing.assert_allclose(second, of_product, atol=1e-6)


@pytest.mark.parametrize("oblateness", OBLATENESS)
def test_variations_are_differences(oblateness: float) -> None:
    nu = np.array([0.3, 0.9, -0.2])
    nu /= np.linalg.norm(nu)
    plane = across(nu)
    end = np.array([-0.93, -0.45, 0.02, 0.52, -0.73, -0.03])
    thrust, flow, mass, duration = 0.045, 0.04, 0.87, 3.3

    def start(state: Floats, direction: Floats, final_mass: float) -> Floats:
        craft = np.array([1.0, oblateness, thrust, final_mass, flow])
        y = end_of(state, direction)
        assert flow_back(y, None, craft, 0.0, duration, 1e-14)
        return y

    shot = shoot_back(end, nu, plane, np.array([1.0, oblateness, thrust, mass, flow]), duration, 1e-13)
    assert shot is not None
    step = 1e-5
    for column in range(9):
        moved = []
        for sign in (1.0, -1.0):
            state, direction, final_mass = end.copy(), nu.copy(), mass
            if column < 6:
                state[column] += sign * step
            elif column < 8:
                direction = nu + sign * step * plane[column - 6]
            else:
                final_mass += sign * step
            moved.append(start(state, direction, final_mass))
        difference = (moved[0] - moved[1]) / (2.0 * step)
        np.testing.assert_allclose(shot[1][:, column], difference, rtol=2e-5, atol=2e-5 * np.abs(difference).max())


def test_there_and_back_is_where_it_was() -> None:
    craft = np.array([1.0, 5e-4, 0.045, 0.87, 0.04])
    y = np.concatenate([[-0.93, -0.45, 0.02, 0.52, -0.73, -0.03], [0.3, 0.9, -0.2], np.zeros(3)])
    before = y.copy()
    assert flow_back(y, None, craft, 0.0, 3.3, 1e-13)
    assert np.abs(y - before).max() > 0.1
    assert flow_back(y, None, craft, 3.3, 0.0, 1e-13)
    np.testing.assert_allclose(y, before, atol=1e-10)


@given(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
@settings(deadline=None)
def test_directions_across_a_vector_are_at_right_angles(x: float, y: float, z: float) -> None:
    nu = np.array([x, y, z + 1e-3])
    if np.linalg.norm(nu) < 1e-3:
        return
    nu /= np.linalg.norm(nu)
    frame = np.vstack([across(nu), nu])
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
