from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from infoset.arrays import Floats
from infoset.rendezvous.pursuit_evasion._coupling import across
from infoset.rendezvous.pursuit_evasion._extremal import (
    NO_VARIATIONS,
    end_of,
    flow_back,
    invert,
    rate,
    respond,
)

PLACE = st.floats(-1.5, 1.5)
OBLATENESS = (0.0, 5e-4)


def potential(r: NDArray[np.complex128], oblateness: float) -> complex:
    q = (r * r).sum()
    return complex(1.0 / np.sqrt(q) + oblateness * (q**-1.5 - 3.0 * r[2] ** 2 * q**-2.5))


@pytest.mark.parametrize("oblateness", [0.0, 0.3])
@given(PLACE, PLACE, PLACE)
@settings(deadline=None, max_examples=50)
def test_gravity_is_the_gradient_of_the_potential(
    oblateness: float, x: float, y: float, z: float
) -> None:
    r = np.array([x, y, z + 3.0])
    step = 1e-30
    gradient = [potential(r + 1j * step * axis, oblateness).imag / step for axis in np.eye(3)]
    coasting = rate(np.concatenate([r, np.zeros(9)]), 1.0, oblateness, 0.0)
    np.testing.assert_allclose(coasting[3:], gradient, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("oblateness", OBLATENESS)
def test_variations_agree_with_finite_differences(oblateness: float) -> None:
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

    shot = end_of(end, nu)
    variations = np.zeros((12, 9))
    variations[:6, :6] = np.eye(6)
    variations[6:9, 6:8] = plane.T
    assert flow_back(
        shot, variations, np.array([1.0, oblateness, thrust, mass, flow]), 0.0, duration, 1e-13
    )
    step = 1e-5
    for column in range(9):
        moved = []
        for sign in (1.0, -1.0):
            state = end.copy()
            direction = nu.copy()
            final_mass = mass
            if column < 6:
                state[column] += sign * step
            elif column < 8:
                direction = nu + sign * step * plane[column - 6]
            else:
                final_mass += sign * step
            moved.append(start(state, direction, final_mass))
        difference = (moved[0] - moved[1]) / (2.0 * step)
        np.testing.assert_allclose(
            variations[:, column], difference, rtol=2e-5, atol=2e-5 * np.abs(difference).max()
        )


@pytest.mark.parametrize("oblateness", [0.0, 1e-3])
def test_a_response_is_the_derivative_of_the_end_state_by_direction_and_duration(
    oblateness: float,
) -> None:
    nu = np.array([0.3, 0.9, -0.2])
    nu /= np.linalg.norm(nu)
    plane = across(nu)
    near = np.array([-0.93, -0.45, 0.02, 0.52, -0.73, -0.03])
    thrust, flow, mass, duration = 0.045, 0.04, 1.0, 3.3

    def craft(lasting: float) -> Floats:
        return np.array([1.0, oblateness, thrust, mass - flow * lasting, flow])

    known = end_of(near, nu)
    assert flow_back(known, NO_VARIATIONS, craft(duration), 0.0, duration, 1e-14)
    start = known[:6].copy()

    def end(direction: Floats, lasting: float) -> Floats:
        """Return the end state from which the start is reached: a fixed point, whatever the other
        derivatives.
        """
        state = near
        for _ in range(6):
            state = (
                state + respond(start, craft(lasting), state, direction, plane, lasting, 1e-14).rho
            )
        return state

    found = respond(start, craft(duration), near, nu, plane, duration, 1e-13)

    step = 1e-5
    by_nu = [
        (end(nu + step * row, duration) - end(nu - step * row, duration)) / (2.0 * step)
        for row in plane
    ]
    by_time = (end(nu, duration + step) - end(nu, duration - step)) / (2.0 * step)
    assert found.regular
    # Some 50 steps with an error of 1e-13 each, which grow a little on the way back.
    assert found.residual < 1e-11
    # The differences have errors of about the square of the step, and of roundings over it: 1e-10.
    np.testing.assert_allclose(found.by_nu.T, by_nu, atol=1e-7 * np.abs(by_nu).max())
    np.testing.assert_allclose(found.by_time, by_time, atol=1e-7 * np.abs(by_time).max())


def test_a_guess_that_cannot_be_propagated_has_an_infinite_residual() -> None:
    nu = np.array([0.0, 1.0, 0.0])
    fall = np.array([1e-9, 0.0, 0.0, 0.0, 0.0, 0.0])
    found = respond(fall, np.array([1.0, 0.0, 0.01, 1.0, 0.0]), fall, nu, across(nu), 3.0, 1e-9)
    assert found.residual == np.inf


@pytest.mark.parametrize("count", [1, 2, 3, 6])
def test_invert_agrees_with_the_definition_of_inverse_and_determinant(count: int) -> None:
    random = np.random.default_rng(count)
    matrix = random.normal(size=(count, count)) * 10.0 ** random.integers(-3, 4, size=(count, 1))
    matrix[0, 0] = 0.0 if count > 1 else 2.0  # the first pivot is in another row
    inverse = np.empty((count, count))

    determinant = invert(matrix.copy(), inverse)

    # Backward stable elimination of at most six rows: the residual has the condition of the matrix.
    allowed = 100.0 * np.finfo(float).eps * np.linalg.cond(matrix)
    np.testing.assert_allclose(inverse @ matrix, np.eye(count), atol=allowed)
    assert determinant == pytest.approx(np.linalg.det(matrix), rel=allowed)


@pytest.mark.parametrize(
    "entries", [[[1.0, 2.0], [2.0, 4.0]], [[0.0, 0.0], [0.0, 1.0]], [[np.nan, 0.0], [0.0, 1.0]]]
)
def test_a_singular_matrix_has_no_inverse(entries: list[list[float]]) -> None:
    assert invert(np.array(entries), np.empty((2, 2))) == 0.0
