from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rendezvous.relative_motion import HILL, ORBITAL, ORBITAL_INTERLEAVED, Axis, Frame, StateOrder

FRAMES = (HILL, ORBITAL, ORBITAL_INTERLEAVED)
STATES = st.lists(st.floats(-1e6, 1e6), min_size=6, max_size=6)


def test_the_papers_axes_are_what_they_say() -> None:
    # 7 m outward, 3 m ahead, 2 m along the normal.
    assert HILL.states_to(ORBITAL, np.array([7.0, 3.0, 2.0, 0.7, 0.3, 0.2])).tolist() == [-3, 7, 2, -0.3, 0.7, 0.2]
    assert HILL.states_to(ORBITAL_INTERLEAVED, np.array([7.0, 3.0, 2.0, 0.7, 0.3, 0.2])).tolist() == [
        -3,
        -0.3,
        7,
        0.7,
        2,
        0.2,
    ]
    assert ORBITAL.vectors_to(HILL, np.array([-3.0, 7.0, 2.0])).tolist() == [7, 3, 2]


@given(STATES)
def test_there_and_back_is_exact(state: list[float]) -> None:
    given_state = np.array(state)
    for first, second in itertools.product(FRAMES, FRAMES):
        assert second.states_to(first, first.states_to(second, given_state)).tolist() == given_state.tolist()
        conversion = first.conversion_to(second)
        assert (conversion @ conversion.T).tolist() == np.eye(6).tolist()


def test_matrices_go_with_states() -> None:
    matrix, state = np.arange(36.0).reshape(6, 6), np.arange(6.0)
    turned = HILL.matrices_to(ORBITAL_INTERLEAVED, matrix)
    expected = HILL.states_to(ORBITAL_INTERLEAVED, matrix @ state)
    np.testing.assert_allclose(turned @ HILL.states_to(ORBITAL_INTERLEAVED, state), expected, rtol=1e-15)


def test_a_left_handed_frame_is_refused() -> None:
    with pytest.raises(ValueError, match="not right-handed"):
        Frame("wrong", Axis.RADIAL_OUTWARD, Axis.AGAINST_MOTION, Axis.ORBIT_NORMAL)
    turned = Frame("sun", Axis.RADIAL_INWARD, Axis.AGAINST_MOTION, Axis.ORBIT_NORMAL, StateOrder.INTERLEAVED)
    assert turned.states_to(HILL, np.arange(6.0)).tolist() == [0, -2, 4, -1, -3, 5]
