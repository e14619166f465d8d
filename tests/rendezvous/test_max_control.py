from __future__ import annotations

import numpy as np
import pytest

from infoset.arrays import Floats
from infoset.rendezvous.piecewise import max_control


@pytest.mark.parametrize("at", [0.0, 0.3, 1.7, 7.123456, 10.0])
def test_maximum_is_found_between_samples_and_at_both_ends(at: float) -> None:
    def control(time_s: Floats) -> Floats:
        size = 3.0 / (1.0 + 9.0 * (time_s - at) ** 2)
        return np.stack([0.6 * size, np.zeros_like(size), -0.8 * size], axis=1)

    assert max_control(control, np.linspace(0.0, 10.0, 11)) == pytest.approx(3.0, rel=1e-11)
    assert max_control(control, np.array([0.0, 10.0])) == pytest.approx(3.0, rel=1e-11)


def test_maximum_of_a_zero_control_is_zero() -> None:
    assert max_control(lambda time_s: np.zeros((len(time_s), 3)), np.array([5.0, 6.0])) == 0.0


def test_maximum_includes_both_sides_of_a_jump() -> None:
    def control(time_s: Floats) -> Floats:
        return np.where(
            time_s[:, None] < 3.0, [[1.0, 0.0, 0.0]] * time_s[:, None], [[0.0, 2.0, 0.0]]
        )

    assert max_control(control, np.array([0.0, 3.0, 4.0])) == pytest.approx(3.0, rel=1e-12)
