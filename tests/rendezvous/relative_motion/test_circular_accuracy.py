"""The circular orbit's matrices against 50-digit arithmetic."""

from __future__ import annotations

import mpmath as mp
import pytest

from infoset.rendezvous.relative_motion import ClohessyWiltshire

ANGLES = (
    1e-6, 1e-5, 1e-4, 1e-3, 0.01, 0.1, 0.5, 0.999, 1.0, 1.7, 1.999999, 2.0, 2.5, 4.493409457909,
    11.06652863, 20, 50,
)  # fmt: skip


def exact(theta: float) -> tuple[mp.matrix, mp.matrix]:
    """Transition and Gramian for unit rate, by Van Loan's block exponential in 50 digits."""
    matrix = mp.zeros(6)
    for row, column, value in (
        (0, 3, 1),
        (1, 4, 1),
        (2, 5, 1),
        (3, 0, 3),
        (3, 4, 2),
        (4, 3, -2),
        (5, 2, -1),
    ):
        matrix[row, column] = value
    block = mp.zeros(12)
    for row in range(6):
        for column in range(6):
            block[row, column] = -matrix[row, column]
            block[6 + row, 6 + column] = matrix[column, row]
    for axis in range(3, 6):
        block[axis, 6 + axis] = 1
    power = mp.expm(block * mp.mpf(theta))
    transition = power[6:, 6:].T
    return transition, transition * power[:6, 6:]


@pytest.mark.parametrize("theta", ANGLES)
def test_gramian_and_transition_keep_thirteen_digits(theta: float) -> None:
    with mp.workdps(80):
        transition, gramian = exact(theta)
        motion = ClohessyWiltshire(1.0)
        found = motion.gramian(0.0, theta)
        for row in range(6):
            for column in range(6):
                value = gramian[row, column]
                if abs(value) < mp.mpf(10) ** -60:  # zero but for the reference's own rounding
                    assert found[row, column] == 0.0
                    continue
                assert abs(mp.mpf(float(found[row, column])) - value) < 1e-13 * abs(value)
        reached = motion.transition(0.0, theta)
        for row in range(6):
            for column in range(6):
                size = max(abs(transition[row, column]), mp.mpf("1e-3") * min(1, theta**3))
                assert (
                    abs(mp.mpf(float(reached[row, column])) - transition[row, column])
                    < 1e-12 * size
                )
