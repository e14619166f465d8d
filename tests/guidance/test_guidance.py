"""Thruster rules, the symmetric impulse, random and game noise."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from infoset import ExtremePoints, PredictedMiss
from infoset.guidance import Thruster, symmetric_impulse
from infoset.guidance.game_noise import keep_point

THRUSTER = Thruster(budget_m_s=1000.0, min_impulse_m_s=0.25, max_impulse_m_s=7.5)


def array(*values: float | list[float]) -> np.ndarray:
    return np.array(values, dtype=np.float64)


@pytest.mark.parametrize(
    ("wanted", "left", "given_impulse"),
    [
        (0.2, 1000.0, 0.0),
        (0.25, 1000.0, 0.25),
        (-0.2499, 1000.0, 0.0),
        (5.0, 1000.0, 5.0),
        (-9.0, 1000.0, -7.5),
        (9.0, 3.0, 3.0),
        (-9.0, 0.25, -0.25),
        (9.0, 0.2, 0.0),
        (0.1, 0.2, 0.0),
        (0.0, 1000.0, 0.0),
    ],
)
def test_thruster_follows_the_rules_of_the_paper(
    wanted: float, left: float, given_impulse: float
) -> None:
    assert THRUSTER.give(array([wanted]), array(left)).item() == given_impulse


@st.composite
def engines(draw: st.DrawFn) -> tuple[Thruster, float]:
    """An engine and the budget that is left, often at one of its limits."""
    minimum = draw(st.floats(0.0, 10.0))
    wider = draw(st.floats(0.0, 20.0) | st.just(1e-3))
    maximum = max(minimum + wider, 1e-3)
    left = draw(
        st.floats(0.0, 50.0) | st.sampled_from([minimum, maximum, np.nextafter(maximum, 0.0)])
    )
    return Thruster(1000.0, minimum, maximum), left


@given(engines(), st.floats(-1e6, 1e6), st.floats(-1e6, 1e6))
def test_the_modulus_of_an_impulse_in_space_is_limited_and_its_direction_kept(
    engine: tuple[Thruster, float], y: float, z: float
) -> None:
    thruster, left = engine
    impulse = thruster.give(array([y], [z]), array(left))[:, 0]
    size = np.hypot(*impulse)
    wanted = np.hypot(y, z)
    limit = min(thruster.max_impulse_m_s, left)
    assert size <= limit
    if size == 0.0:
        assert min(wanted, limit) == 0.0 or min(wanted, limit) < thruster.min_impulse_m_s
        return
    assert size >= thruster.min_impulse_m_s * (1.0 - 4e-16)
    if wanted <= limit:
        assert impulse.tolist() == [y, z]
    else:
        assert size >= limit * (1.0 - 4e-16)
        np.testing.assert_allclose(
            impulse, np.array([y, z]) / wanted * limit, rtol=1e-15, atol=1e-300
        )


def test_errors_of_execution_change_the_modulus_and_turn_the_impulse() -> None:
    thruster = Thruster(1000.0, 0.25, 7.5, execution_error_relative=0.1, pointing_error_rad=0.2)
    impulse = np.array([[3.0, 0.0, 0.0, 1.0], [4.0, 5.0, 0.0, -2.0]])
    size = array(1.0, -0.5, 0.3, 0.0)
    direction = array(0.0, 1.0, -1.0, -0.5)
    executed = thruster.executed(impulse, size, direction)
    np.testing.assert_allclose(
        np.hypot(*executed), np.hypot(*impulse) * (1.0 + 0.1 * size), rtol=1e-15
    )
    np.testing.assert_allclose(
        executed[:, :2].T, [[3.3, 4.4], [-4.75 * np.sin(0.2), 4.75 * np.cos(0.2)]], rtol=1e-15
    )
    turned = np.arctan2(executed[1, 3], executed[0, 3]) - np.arctan2(-2.0, 1.0)
    assert turned == pytest.approx(-0.1, rel=1e-14)
    np.testing.assert_array_equal(thruster.executed(impulse, None, None), impulse)
    np.testing.assert_array_equal(
        thruster.executed(impulse[1:], size, None), impulse[1:] * (1.0 + 0.1 * size)
    )


def interval(
    lower: float, upper: float, lower_range: float, upper_range: float, exists: bool = True
) -> PredictedMiss:
    zero = array([0.0])
    return PredictedMiss(
        np.array([exists]),
        array([lower]),
        array([upper]),
        ExtremePoints(zero, zero, array([lower_range])),
        ExtremePoints(zero, zero, array([upper_range])),
    )


@given(
    st.floats(-1e4, 1e4),
    st.floats(0.0, 1e4),
    st.floats(1e4, 6e6),
    st.floats(1e4, 6e6),
    st.floats(1e3, 1e5),
)
def test_the_symmetric_impulse_makes_the_ends_opposite(
    lower: float, width: float, lower_range: float, upper_range: float, e: float
) -> None:
    """Equation (15): pi^* - k x^*/e = -(pi_* - k x_*/e)."""
    k = symmetric_impulse(interval(lower, lower + width, lower_range, upper_range), e).item()
    upper_after = lower + width - k * upper_range / e
    lower_after = lower - k * lower_range / e
    assert upper_after == pytest.approx(
        -lower_after, rel=1e-9, abs=1e-9 * (abs(lower) + width + 1.0)
    )


def choose(
    larger: bool,
    low: float,
    high: float,
    point: float,
    minimum: float,
    maximum: float,
    reach: float,
) -> float:
    """Measured value for a point, a set [minimum, maximum] and truth-allowed values [low, high]."""
    return float(
        keep_point(
            np.array([larger]),
            point_at_top=array(point - reach),
            point_at_bottom=array(point + reach),
            min_at_bottom=array(minimum + reach),
            max_at_top=array(maximum - reach),
            lower=array(low),
            upper=array(high),
        )[0]
    )


@pytest.mark.parametrize(
    ("larger", "low", "high", "point", "minimum", "maximum", "expected"),
    [
        # The point is the set's upper end, within reach: the band's top comes to it.
        (True, -10.0, 10.0, 8.0, 0.0, 8.0, 5.0),
        # Beyond what the truth allows above: the nearest allowed value, which is the upper bound.
        (True, -10.0, 2.0, 8.0, 0.0, 8.0, 2.0),
        # The band would reach below the whole set: it is raised until its bottom is the set's
        # minimum.
        (True, -10.0, 10.0, 4.0, 0.0, 4.0, 3.0),
        # The same, but the truth does not allow as much.
        (True, -10.0, 2.0, 4.0, 0.0, 4.0, 2.0),
        # Mirror images.
        (False, -10.0, 10.0, -8.0, -8.0, 0.0, -5.0),
        (False, -2.0, 10.0, -8.0, -8.0, 0.0, -2.0),
        (False, -10.0, 10.0, -4.0, -4.0, 0.0, -3.0),
        (False, -2.0, 10.0, -4.0, -4.0, 0.0, -2.0),
    ],
)
def test_game_noise_keeps_the_point_and_then_as_much_as_it_can(
    larger: bool,
    low: float,
    high: float,
    point: float,
    minimum: float,
    maximum: float,
    expected: float,
) -> None:
    assert choose(larger, low, high, point, minimum, maximum, reach=3.0) == expected
