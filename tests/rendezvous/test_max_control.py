from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from rendezvous.piecewise import max_control

Floats = NDArray[np.float64]

FEW = range(40)


@pytest.mark.parametrize("at", [0.0, 0.3, 1.7, 7.123456, 10.0])
def test_the_top_of_a_hump_is_found_between_samples_and_at_both_ends(at: float) -> None:
    def control(time_s: Floats) -> Floats:
        size = 3.0 / (1.0 + 9.0 * (time_s - at) ** 2)
        return np.stack([0.6 * size, np.zeros_like(size), -0.8 * size], axis=1)

    assert max_control(control, np.linspace(0.0, 10.0, 11)) == pytest.approx(3.0, rel=1e-11)
    assert max_control(control, np.array([0.0, 10.0])) == pytest.approx(3.0, rel=1e-11)


def test_a_control_that_is_zero_has_no_size() -> None:
    assert max_control(lambda time_s: np.zeros((len(time_s), 3)), np.array([5.0, 6.0])) == 0.0


def test_a_jump_at_a_break_belongs_to_both_sides() -> None:
    def control(time_s: Floats) -> Floats:
        return np.where(time_s[:, None] < 3.0, [[1.0, 0.0, 0.0]] * time_s[:, None], [[0.0, 2.0, 0.0]])

    assert max_control(control, np.array([0.0, 3.0, 4.0])) == pytest.approx(3.0, rel=1e-12)


def sinusoids_and_secular_terms(seed: int) -> None:
    """The control of a circular orbit, whose maximum size is between a fine sampling and its error bound."""
    random = np.random.default_rng(seed)
    turns = 10.0 ** random.uniform(-2.0, 2.0)
    coefficients = random.normal(size=(3, 4)) * 10.0 ** random.uniform(-2.0, 2.0, size=4)
    coefficients[:, 3] /= turns
    begin = float(random.choice([0.0, 1e3, -1e4]))

    def control(time_s: Floats) -> Floats:
        angle = time_s - begin
        basis = np.stack([np.ones_like(angle), np.sin(angle), np.cos(angle), angle])
        return np.asarray((coefficients @ basis).T)

    breaks = np.linspace(begin, begin + turns, max(1, int(np.ceil(turns))) + 1)
    found = max_control(control, breaks)
    times = np.linspace(begin, begin + turns, 20_001)
    sizes = np.linalg.norm(control(times), axis=1)
    step = times[1] - times[0]
    # |u|^2 bends by at most 2 (|u'|^2 + |u| |u''|): between samples it is at most that much greater.
    first = np.linalg.norm(coefficients[:, 1:3], axis=1).sum() + np.linalg.norm(coefficients[:, 3])
    bend = 2.0 * (first**2 + sizes.max() * np.linalg.norm(coefficients[:, 1:3], axis=1).sum())
    above = np.sqrt(sizes.max() ** 2 + bend * step**2 / 8.0)
    # Times are rounded: between short panels far from t = 0 the control is known no better.
    rounding = 1e-10 + 1e-15 * abs(begin) / turns
    assert sizes.max() * (1.0 - rounding) <= found <= above * (1.0 + rounding)
    # Around the maximum sample a parabola through three of |u|^2 gives the top to the fourth order.
    at = int(sizes.argmax())
    if 0 < at < len(times) - 1:
        low, top, high = sizes[at - 1 : at + 2] ** 2
        refined = top + (high - low) ** 2 / (16.0 * top - 8.0 * (low + high)) if low + high < 2.0 * top else top
        assert found >= np.sqrt(refined) * (1.0 - 1e-9 - rounding)


@pytest.mark.parametrize("seed", FEW)
def test_controls_of_a_circular_orbit(seed: int) -> None:
    sinusoids_and_secular_terms(seed)
