"""The steps of impulses: times before the arrival, a period, and what contradicts them."""

from __future__ import annotations

import random
from dataclasses import replace
from fractions import Fraction

import pytest

from infoset.guidance import Thruster
from tests.infoset.test_clock import decimal, nearest_step

ENGINE = Thruster(10.0, 0.0, 1.0)


def test_a_cut_off_is_at_the_nearest_step() -> None:
    steps = replace(ENGINE, last_impulse_s=120.0).impulse_steps(10799.978561399868, 60.0)
    assert steps is not None
    assert (len(steps), steps[0], steps[-1]) == (179, 0, 178)


def test_listed_impulses_are_at_the_nearest_steps_and_not_after_the_cut_off() -> None:
    engine = replace(ENGINE, impulses_s=(90.0, 55.0, 44.0, 12.0), last_impulse_s=38.0)
    assert engine.impulse_steps(100.0, 10.0) == [1, 4, 6]


def test_a_period_is_the_list_of_its_times() -> None:
    draw = random.Random(2)
    compared = 0
    while compared < 300:
        step_s = decimal(draw, 20)
        arrival_s = decimal(draw, 3000)
        last_s = decimal(draw, 300)
        period_s = step_s + decimal(draw, 200)
        delay = draw.randint(0, 3)
        times_s = [last_s]
        while nearest_step(arrival_s, times_s[0] + period_s, step_s) >= delay:
            times_s.insert(0, times_s[0] + period_s)
        if nearest_step(arrival_s, last_s, step_s) < delay:
            continue
        compared += 1
        listed = replace(ENGINE, impulses_s=tuple(map(float, times_s)), delay_steps=delay)
        periodic = replace(
            ENGINE,
            last_impulse_s=float(last_s),
            impulse_period_s=float(period_s),
            delay_steps=delay,
        )
        assert periodic.impulse_steps(float(arrival_s), float(step_s)) == listed.impulse_steps(
            float(arrival_s), float(step_s)
        )


@pytest.mark.parametrize(
    ("first_s", "steps"),
    [
        (None, [4, 16, 28, 40, 52, 64, 76, 88]),
        (600.0, [40, 52, 64, 76, 88]),
        (590.0, [40, 52, 64, 76, 88]),
        (
            540.0,
            [40, 52, 64, 76, 88],
        ),  # in the middle of two impulses: the earlier one is the first
        (530.0, [52, 64, 76, 88]),
        (120.0, [88]),
    ],
)
def test_the_first_impulse_is_nearest_to_its_time(first_s: float | None, steps: list[int]) -> None:
    engine = replace(ENGINE, last_impulse_s=120.0, impulse_period_s=120.0, first_impulse_s=first_s)
    assert engine.impulse_steps(1000.0, 10.0) == steps


def test_first_impulse_within_half_a_period_of_the_arrival_is_the_only_one() -> None:
    engine = replace(ENGINE, last_impulse_s=0.0, impulse_period_s=60.0, first_impulse_s=20.0)
    # The step nearest to the arrival that is before it.
    assert engine.impulse_steps(600.0, 10.0) == [59]


def test_a_period_of_one_step_is_every_step() -> None:
    engine = replace(ENGINE, last_impulse_s=0.25, impulse_period_s=0.1)
    assert engine.impulse_steps(5801.3 / 58.0, 0.1) == list(range(998 + 1))


def test_a_first_impulse_without_a_period() -> None:
    engine = replace(ENGINE, first_impulse_s=46.0)
    steps = engine.impulse_steps(100.0, 10.0)
    assert steps is not None
    assert list(steps) == [5, 6, 7, 8, 9]


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        (
            {"impulse_period_s": 60.0},
            "impulse_period_s is counted back from last_impulse_s: set last_impulse_s",
        ),
        (
            {"impulse_period_s": 60.0, "impulses_s": (60.0,)},
            "impulse_period_s and impulses_s exclude each other",
        ),
        (
            {"first_impulse_s": 60.0, "impulses_s": (60.0,)},
            "first_impulse_s and impulses_s exclude each other",
        ),
        (
            {"first_impulse_s": 60.0, "last_impulse_s": 61.0},
            "first_impulse_s must be at least last_impulse_s",
        ),
        ({"impulse_period_s": 0.0, "last_impulse_s": 1.0}, "impulse_period_s"),
    ],
)
def test_contradictions_are_refused(fields: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        replace(ENGINE, **fields)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        (
            {"impulse_period_s": 9.0},
            "thruster.impulse_period_s must be at least a step, 10 s: got 9.0",
        ),
        (
            {"impulse_period_s": 10.0, "first_impulse_s": 106.0},
            "thruster.first_impulse_s: the first impulse can be",
        ),
        (
            {"first_impulse_s": 90.0, "delay_steps": 2},
            "thruster.first_impulse_s: the first impulse can be given 80 s",
        ),
        (
            {"impulse_period_s": 10.0, "last_impulse_s": 106.0},
            "thruster.last_impulse_s excludes all impulses",
        ),
    ],
)
def test_times_that_the_steps_do_not_have_are_refused(
    fields: dict[str, object], message: str
) -> None:
    engine = replace(ENGINE, **{"last_impulse_s": 20.0, **fields})  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=message):
        engine.impulse_steps(100.0, 10.0)


def test_a_period_with_more_impulses_than_steps_of_a_flight_is_refused() -> None:
    engine = replace(ENGINE, last_impulse_s=20.0, impulse_period_s=10.0)
    with pytest.raises(ValueError, match=r"impulse_period_s gives \d+ impulses, more than 100000"):
        engine.impulse_steps(1e50, 10.0)


def test_half_a_step_is_the_greatest_difference() -> None:
    arrival_s = Fraction(1079, 10)
    step_s = Fraction(6)
    for tenths in range(30, 1079):
        steps = replace(ENGINE, last_impulse_s=tenths / 10).impulse_steps(
            float(arrival_s), float(step_s)
        )
        assert steps is not None
        assert abs(arrival_s - steps[-1] * step_s - Fraction(tenths, 10)) <= step_s / 2
