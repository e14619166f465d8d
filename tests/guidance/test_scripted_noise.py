"""Errors given in advance: within their bounds, and found again from what was measured."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from infoset import AngleSensor, InformationSet, Model, RangeSensor, RateSensor, SetModel, StateBox
from infoset.guidance import GameNoise, LineOfSight
from infoset.guidance.game_noise import SwitchingNoise
from infoset.guidance.noise import TieRule
from infoset.guidance.scripted_noise import ScriptedNoise, errors_made, measure_with_errors
from infoset.sensors import Sensor

SENSOR = AngleSensor(0.5, 0.00015, 0.00023, 5801.3e3)
MODEL = SetModel(
    closing_speed_m_s=58e3,
    step_s=0.5,
    bounds=StateBox((-10e3, 10e3), (5301.3e3, 6301.3e3), (-100.0, 100.0), (-59e3, -57e3)),
    angle_sensor=SENSOR,
    disturbance_m_s2=0.005,
    model=Model.PAPER,
)
ROUNDING = 4 * np.finfo(float).eps

errors = st.floats(-1.0, 1.0)


def sight(
    alpha: Any, distance: Any, step: int = 0, ranging: bool = True, rating: bool = True
) -> LineOfSight:
    alpha = np.atleast_2d(np.asarray(alpha, dtype=np.float64))
    sensors: dict[str, Sensor] = {"angle": SENSOR}
    if ranging:
        sensors["range"] = RangeSensor(0.5, 0.05)
    if rating:
        sensors["rate"] = RateSensor(0.5, 1e-6)
    distance = np.broadcast_to(np.float64(distance), alpha.shape[1:]).copy()
    return LineOfSight(step, alpha, 0.1 * alpha, distance, sensors)


def looked_at() -> Any:
    return InformationSet(MODEL, 1).view()


def same(found: Any, wanted: Any) -> bool:
    return found is not None and np.array_equal(found, wanted)


@given(st.floats(-0.01, 0.01), st.floats(1e3, 7e6), errors, errors, errors)
def test_measurements_stay_within_the_bounds_to_rounding(
    alpha: float, distance: float, angle: float, far: float, fast: float
) -> None:
    seen = sight(alpha, distance)
    script = {
        "angle": np.array([[[angle]]]),
        "range": np.array([[far]]),
        "rate": np.array([[[fast]]]),
    }
    found = ScriptedNoise(script).measure(seen, looked_at())
    bound = SENSOR.error_bound(distance)
    assert abs(found["angle"].item() - alpha) <= bound + ROUNDING * (abs(alpha) + bound)
    assert abs(found["range"][0] - distance) <= 0.05 * distance * (1.0 + 20.0 * ROUNDING)
    assert abs(found["rate"].item() - 0.1 * alpha) <= 1e-6 + ROUNDING * (abs(alpha) + 1e-6)


@given(st.floats(-0.01, 0.01), st.floats(1e3, 7e6), errors, errors, errors)
def test_errors_are_recovered_from_measurements(
    alpha: float, distance: float, angle: float, far: float, fast: float
) -> None:
    seen = sight(alpha, distance)
    given_errors = {"angle": np.array([angle]), "range": np.array([far]), "rate": np.array([fast])}
    found = errors_made(seen, measure_with_errors(seen, given_errors))
    assert all(np.abs(error).max() <= 1.0 for error in found.values())
    # A rounding of the measured value, in units of the bound.
    np.testing.assert_allclose(
        found["angle"], angle, atol=ROUNDING * (1.0 + abs(alpha) / SENSOR.error_bound(distance))
    )
    np.testing.assert_allclose(found["range"], far, atol=20.0 * ROUNDING)
    np.testing.assert_allclose(found["rate"], fast, atol=ROUNDING * (1.0 + abs(alpha) / 1e-6))


def test_extremal_errors_give_the_ends_of_the_possible_measurements() -> None:
    seen = sight([0.001, -0.002], 3e6)
    for end in (-1.0, 1.0):
        script = np.full((2, 1), end)
        found = ScriptedNoise({"angle": script[None], "range": script}).measure(seen, looked_at())
        assert same(found["angle"], seen.alpha_rad + end * SENSOR.error_bound(3e6))
        assert same(found["range"], seen.range_m * (1.0 + 0.05 * end))


def test_each_step_and_engagement_has_its_own_error() -> None:
    script = np.array([[0.0, 0.25, -1.0], [1.0, -0.5, 0.125]])
    noise = ScriptedNoise({"angle": script[None]})
    for step in range(3):
        seen = sight([0.0, 0.0], 3e6, step=step)
        found = noise.measure(seen, looked_at())
        assert same(found["angle"], SENSOR.error_bound(3e6) * script[None, :, step])
        assert same(found["range"], seen.range_m)
        assert same(found["rate"], seen.omega_rad_s)


def test_script_that_ends_before_the_flight_is_refused() -> None:
    with pytest.raises(ValueError, match=r"errors\['angle'\] has 3 steps, none for step 3"):
        ScriptedNoise({"angle": np.zeros((1, 1, 3))}).measure(sight(0.0, 3e6, step=3), looked_at())


def test_switching_noise_is_the_game_where_both_extremes_are_equally_bad() -> None:
    information = InformationSet(MODEL, 1)
    seen = sight(0.0, 5801.3e3, ranging=False, rating=False)

    def measured(noise: GameNoise) -> float:
        return noise.measure(seen, information.view())["angle"].item()

    upper, lower = (SwitchingNoise(TieRule.RANDOM, np.array([[[sign]]])) for sign in (1.0, -1.0))
    unused = np.zeros((1, 1, 1))
    assert measured(upper) == measured(GameNoise(TieRule.UPPER, unused))
    assert measured(lower) == measured(GameNoise(TieRule.LOWER, unused))
    assert abs(measured(upper) - measured(lower)) == pytest.approx(
        2.0 * SENSOR.error_bound(5801.3e3), rel=1e-12
    )
    information.shift(
        5.0
    )  # now the lower extreme is the worse one, and the game keeps it whatever its tie rule
    assert measured(GameNoise(TieRule.UPPER, unused)) == measured(lower) != measured(upper)
