from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from infoset.arrays import Floats
from infoset.rendezvous.pursuit_evasion._extremal import NO_VARIATIONS, end_of, flow_back, rate, shoot_back
from infoset.rendezvous.pursuit_evasion._pair import across

PLACE = st.floats(-1.5, 1.5)
OBLATENESS = (0.0, 5e-4)


def potential(r: NDArray[np.complex128], oblateness: float) -> complex:
    q = (r * r).sum()
    return complex(1.0 / np.sqrt(q) + oblateness * (q**-1.5 - 3.0 * r[2] ** 2 * q**-2.5))


@pytest.mark.parametrize("oblateness", [0.0, 0.3])
@given(PLACE, PLACE, PLACE)
@settings(deadline=None, max_examples=50)
def test_gravity_is_the_gradient_of_the_potential(oblateness: float, x: float, y: float, z: float) -> None:
    r = np.array([x, y, z + 3.0])
    step = 1e-30
    gradient = [potential(r + 1j * step * axis, oblateness).imag / step for axis in np.eye(3)]
    coasting = rate(np.concatenate([r, np.zeros(9)]), 1.0, oblateness, 0.0)
    np.testing.assert_allclose(coasting[3:], gradient, rtol=1e-12, atol=1e-14)


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
        assert flow_back(y, NO_VARIATIONS, craft, 0.0, duration, 1e-14)
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
