"""The nearest step of a time before the arrival, against rational numbers."""

from __future__ import annotations

import math
import random
from fractions import Fraction

import pytest

from infoset.clock import fitted_step_s, steps_between


def nearest_step(start_s: Fraction, time_s: Fraction, step_s: Fraction) -> int:
    """Return the nearest step before the arrival; of two the earlier one."""
    below = math.floor((start_s - time_s) / step_s)
    last = math.ceil(start_s / step_s) - 1
    steps = [step for step in range(below - 1, below + 3) if step <= last] or [last]
    return min(steps, key=lambda step: (abs(start_s - step * step_s - time_s), step))


def decimal(draw: random.Random, maximum: int) -> Fraction:
    """Return a decimal number of at most three digits after the point."""
    return Fraction(
        draw.randint(1, 1000 * maximum), 10 ** draw.choice((0, 1, 2, 3))
    ) % maximum + Fraction(1, 1000)


@pytest.mark.parametrize("count", [4_000, pytest.param(20_000, marks=pytest.mark.thorough)])
def test_step_of_a_random_time_is_the_nearest_one(count: int) -> None:
    draw = random.Random(1)
    for _ in range(count):
        step_s = decimal(draw, 100)
        start_s = decimal(draw, 50_000) % (100_000 * step_s)  # a flight has no more steps
        time_s = decimal(draw, 60_000) % (2 * start_s + 1)
        if draw.random() < 0.5:  # at a step, or in the middle of two
            time_s = start_s - Fraction(draw.randint(0, 200), 2) * step_s
        expected = nearest_step(start_s, time_s, step_s)
        assert steps_between(float(start_s), float(time_s), float(step_s)) == expected, (
            start_s,
            time_s,
            step_s,
        )


@pytest.mark.parametrize(
    ("start_s", "time_s", "step_s", "step"),
    [
        (10799.978561399868, 120.0, 60.0, 178),
        (10799.978561399868, 60.0, 60.0, 179),
        (10790.0, 120.0, 60.0, 178),
        (100.0, 35.0, 10.0, 6),  # the middle of 40 s and 30 s
        (100.7, 0.1, 1.0, 100),  # step 101 is after the arrival
        (100.7, 0.0, 1.0, 100),
        (100.0, 0.0, 10.0, 9),  # step 10 is at the arrival
        (100.0, 104.0, 10.0, 0),
        (100.0, 106.0, 10.0, -1),
        (0.3, 0.1, 0.1, 2),  # 0.3 - 0.1 is less than two steps in floating point
    ],
)
def test_step_of_a_time_is_before_the_arrival(
    start_s: float, time_s: float, step_s: float, step: int
) -> None:
    assert steps_between(start_s, time_s, step_s) == step


@pytest.mark.parametrize(
    ("arrival_s", "step_s", "fitted_s"),
    [
        (100.0, 8.0, 100.0 / 12),  # 12.5 steps: of two equally near numbers the even one
        (100.0, 7.0, 100.0 / 14),
        (100.0, 10.0, 10.0),
        (3.0, 10.0, 3.0),
        (0.3, 0.1, 0.1),  # 0.3 / 0.1 is less than 3 in floats
    ],
)
def test_fitted_step_divides_the_time_to_the_arrival(
    arrival_s: float, step_s: float, fitted_s: float
) -> None:
    assert fitted_step_s(arrival_s, step_s) == fitted_s
