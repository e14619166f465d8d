"""Thruster rules, the symmetric impulse, random and game noise."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from guidance import Thruster, make_strategy, strategy_names, symmetric_impulse, zero_effort_miss
from guidance.game_noise import keep_point
from infoset import ExtremePoints, PredictedMiss

THRUSTER = Thruster(budget_m_s=1000.0, least_impulse_m_s=0.25, greatest_impulse_m_s=7.5)


def array(*values: float) -> np.ndarray:
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
def test_the_thruster_follows_the_papers_rules(wanted: float, left: float, given_impulse: float) -> None:
    assert THRUSTER.give(array(wanted), array(left))[0] == given_impulse


@given(st.floats(-1e6, 1e6), st.floats(0.0, 1000.0))
def test_an_impulse_is_zero_or_within_the_limits_and_the_budget(wanted: float, left: float) -> None:
    given_impulse = float(THRUSTER.give(array(wanted), array(left))[0])
    assert given_impulse == 0.0 or 0.25 <= abs(given_impulse) <= min(7.5, left)
    assert given_impulse * wanted >= 0.0


def interval(lower: float, upper: float, lower_range: float, upper_range: float, exists: bool = True) -> PredictedMiss:
    zero = array(0.0)
    return PredictedMiss(
        np.array([exists]),
        array(lower),
        array(upper),
        ExtremePoints(zero, zero, array(lower_range)),
        ExtremePoints(zero, zero, array(upper_range)),
    )


@given(st.floats(-1e4, 1e4), st.floats(0.0, 1e4), st.floats(1e4, 6e6), st.floats(1e4, 6e6), st.floats(1e3, 1e5))
def test_the_symmetric_impulse_makes_the_ends_opposite(
    lower: float, width: float, lower_range: float, upper_range: float, e: float
) -> None:
    """Equation (15): pi^* - k x^*/e = -(pi_* - k x_*/e)."""
    k = float(symmetric_impulse(interval(lower, lower + width, lower_range, upper_range), e)[0])
    upper_after, lower_after = lower + width - k * upper_range / e, lower - k * lower_range / e
    assert upper_after == pytest.approx(-lower_after, rel=1e-9, abs=1e-9 * (abs(lower) + width + 1.0))


def test_without_a_set_the_symmetric_impulse_is_zero() -> None:
    assert symmetric_impulse(interval(0.0, 0.0, 0.0, 0.0, exists=False), 58e3)[0] == 0.0


def test_the_zero_effort_miss_is_where_the_straight_line_goes() -> None:
    z, v, x, e = 300.0, -12.0, 2e6, 58e3
    alpha = z / x
    omega = (v + e * alpha) / x
    assert zero_effort_miss(array(omega), array(x), e)[0] == pytest.approx(z + v * x / e, rel=1e-12)


def choose(larger: bool, low: float, high: float, point: float, least: float, greatest: float, reach: float) -> float:
    """Measured value for a point, a set [least, greatest] and truth-allowed values [low, high]."""
    return float(
        keep_point(
            np.array([larger]),
            point_at_top=array(point - reach),
            point_at_bottom=array(point + reach),
            least_at_bottom=array(least + reach),
            greatest_at_top=array(greatest - reach),
            lower=array(low),
            upper=array(high),
        )[0]
    )


@pytest.mark.parametrize(
    ("larger", "low", "high", "point", "least", "greatest", "expected"),
    [
        # The point is the set's upper end, within reach: the band's top comes to it.
        (True, -10.0, 10.0, 8.0, 0.0, 8.0, 5.0),
        # Beyond what the truth allows above: the nearest allowed value, which is the upper bound.
        (True, -10.0, 2.0, 8.0, 0.0, 8.0, 2.0),
        # The band would reach below the whole set: it is raised until its bottom is the set's least.
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
    larger: bool, low: float, high: float, point: float, least: float, greatest: float, expected: float
) -> None:
    assert choose(larger, low, high, point, least, greatest, reach=3.0) == expected


@given(st.booleans(), st.floats(-5.0, 5.0), st.floats(-8.0, 8.0), st.floats(0.0, 6.0), st.floats(0.0, 6.0))
def test_game_noise_stays_within_what_the_truth_allows(
    larger: bool, truth: float, point: float, below: float, above: float
) -> None:
    chosen = choose(larger, truth - 3.0, truth + 3.0, point, point - below, point + above, reach=3.0)
    assert truth - 3.0 <= chosen <= truth + 3.0


def test_strategies_are_known_by_name() -> None:
    assert "symmetric-miss" in strategy_names()
    with pytest.raises(ValueError, match=r"no strategy is called 'symetric'; there are: .*symmetric-miss"):
        make_strategy("symetric")
