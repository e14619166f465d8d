"""Noises in space: on each axis the rules of the plane."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from infoset import (
    AngleSensor,
    ExtremePoints,
    InformationSet,
    InformationSetView,
    Model,
    PredictedMiss,
    RangeSensor,
    RateSensor,
    SetModel,
    StateBox,
)
from infoset.arrays import Floats
from infoset.guidance import GameNoise, LineOfSight, RandomNoise, ScriptedNoise, TieRule
from infoset.guidance.game_noise import SwitchingNoise
from infoset.guidance.noise import checked_measurements
from infoset.guidance.scripted_noise import errors_made, measure_with_errors
from infoset.sensors import Sensor

BATCH = 4
SENSOR = AngleSensor(0.5, 0.00015, 0.00023, 5801.3e3)
METER = RangeSensor(0.5, 0.05)
RATE = RateSensor(0.5, 1e-6)
BOX = StateBox(
    (-10e3, 10e3),
    (5301.3e3, 6301.3e3),
    (-100.0, 100.0),
    (-59e3, -57e3),
    (-10e3, 10e3),
    (-100.0, 100.0),
)
MODEL = SetModel(
    closing_speed_m_s=58e3,
    step_s=0.5,
    bounds=BOX,
    angle_sensor=SENSOR,
    disturbance_m_s2=0.005,
    model=Model.PAPER,
)


def sight(
    sensors: dict[str, Sensor], seed: int = 0, step: int = 0, batch: int = BATCH
) -> LineOfSight:
    random = np.random.default_rng(seed)
    x, y, z = 5.8e6 + random.uniform(-2e5, 2e5, batch), *random.uniform(-1e3, 1e3, (2, batch))
    speed = -58e3
    velocity = random.uniform(-50.0, 50.0, (2, batch))
    across = np.array([y, z])
    omega = (velocity * x - speed * across) / (x * x + across * across)
    return LineOfSight(step, np.arctan2(across, x), omega, np.hypot(x, np.hypot(y, z)), sensors)


def of_axis(whole: LineOfSight, number: int) -> LineOfSight:
    """The planar line of sight of one axis."""
    return replace(
        whole,
        alpha_rad=whole.alpha_rad[number : number + 1],
        omega_rad_s=whole.omega_rad_s[number : number + 1],
        sensors={
            name: sensor.axis("yz"[number]) if isinstance(sensor, AngleSensor) else sensor
            for name, sensor in whole.sensors.items()
        },
    )


def moved(model: SetModel = MODEL, seed: int = 1, axis: int | None = None) -> InformationSetView:
    """A set after a few steps with impulses, or that of the plane of one axis."""
    planar = model if axis is None else model.axis("yz"[axis])
    information = InformationSet(planar, BATCH)
    random = np.random.default_rng(seed)
    for _ in range(3):
        impulse = random.uniform(-5.0, 5.0, (2, BATCH))
        information.shift(impulse if axis is None else impulse[[axis]])
        information.predict()
    return information.view()


def draws(seed: int = 5, steps: int = 2) -> Floats:
    return np.random.default_rng(seed).uniform(-1.0, 1.0, (2, BATCH, steps))


def all_sensors(angle: AngleSensor) -> dict[str, Sensor]:
    return {"range": METER, "angle": angle, "rate": RATE}


@pytest.mark.parametrize("tie", list(TieRule))
@pytest.mark.parametrize("at_tie", [True, False])
def test_game_noise_of_each_axis_equals_game_noise_in_its_plane(tie: TieRule, at_tie: bool) -> None:
    view = InformationSet(MODEL, BATCH).view() if at_tie else moved()
    for step in range(2):
        seen = sight({"angle": SENSOR, "rate": RATE}, step=step)
        measured = GameNoise(tie, draws()).measure(seen, view)
        for number, name in enumerate("yz"):
            plane = InformationSet(MODEL.axis(name), BATCH).view() if at_tie else moved(axis=number)
            planar = GameNoise(tie, draws()[[number]]).measure(of_axis(seen, number), plane)
            for key in planar:
                assert np.array_equal(measured[key][number], planar[key][0])


def test_tie_rules_differ() -> None:
    view = InformationSet(MODEL, BATCH).view()
    seen = sight({"angle": SENSOR})
    upper, lower = (
        GameNoise(tie, draws()).measure(seen, view)["angle"]
        for tie in (TieRule.UPPER, TieRule.LOWER)
    )
    assert (upper != lower).all()


def test_a_shift_along_one_axis_keeps_the_errors_possible() -> None:
    seen = sight({"angle": SENSOR})
    view = moved()
    for rule in TieRule:
        measured = GameNoise(rule, draws(), np.array([[1e9]])).measure(seen, view)["angle"]
        assert np.abs(SENSOR.error(seen, measured)).max() <= 1.0 + 1e-9


def test_bounds_by_axis_are_used_by_the_game() -> None:
    angle = replace(SENSOR, error_at_nominal_range_y_rad=0.0003, error_at_zero_range_y_rad=0.0001)
    model = replace(MODEL, angle_sensor=angle)
    seen = sight({"angle": angle})
    view = moved(model)
    measured = GameNoise(TieRule.UPPER, draws()).measure(seen, view)["angle"]
    for number in range(2):
        plane = moved(model, axis=number)
        planar = GameNoise(TieRule.UPPER, draws()[[number]]).measure(of_axis(seen, number), plane)[
            "angle"
        ]
        assert np.array_equal(measured[number], planar[0])


@pytest.mark.parametrize("make", [GameNoise, SwitchingNoise])
def test_measurements_of_game_noise_are_possible(make: type[GameNoise]) -> None:
    for seed in range(10):
        seen = sight(all_sensors(SENSOR), seed)
        view = moved(seed=seed)
        noise = make(TieRule.RANDOM, draws(seed))
        measured = checked_measurements(noise.measure(seen, view), seen, noise)
        assert {name: values.shape for name, values in measured.items()} == {
            "range": (BATCH,),
            "angle": (2, BATCH),
            "rate": (2, BATCH),
        }
        size = np.abs(SENSOR.error(seen, measured["angle"])).max()
        # On the border, as in the plane: the extremes are far outside of the bounds of one
        # measurement.
        assert 0.99 < size <= 1.0 + 1e-9
        again = measure_with_errors(seen, errors_made(seen, measured))
        for name, values in again.items():
            np.testing.assert_allclose(values, measured[name], rtol=1e-9, atol=1e-15)


class Misses:
    """The part of a view that the game's rule for ranges reads, with misses by section, shape (2,
    B, S).
    """

    def __init__(self, lower: Floats, upper: Floats, ranges: Floats) -> None:
        self.lower = lower
        self.upper = upper
        self.ranges_m = ranges
        self.feasible = np.ones(ranges.shape, dtype=bool)

    def predicted_miss_by_section_m(self) -> tuple[Floats, Floats]:
        return self.lower, self.upper

    def min_and_max_alpha(self) -> tuple[Floats, ...]:
        return (np.zeros(self.lower.shape[:-1]),) * 4

    def stored_range_interval_m(self) -> tuple[Floats, Floats]:
        return self.ranges_m.min(axis=1), self.ranges_m.max(axis=1)

    def predicted_miss(self, pending: object = ()) -> PredictedMiss:
        none = np.zeros(self.lower.shape[:-1])
        exists = np.ones(len(self.ranges_m), dtype=bool)
        lower = self.lower.argmin(axis=-1)
        upper = self.upper.argmax(axis=-1)
        points = (ExtremePoints(none, none, self.ranges_m[0, which]) for which in (lower, upper))
        return PredictedMiss(exists, self.lower.min(axis=-1), self.upper.max(axis=-1), *points)


def ranged(noise: GameNoise, misses: Any, distance: float) -> float:
    seen = LineOfSight(
        0, np.zeros((2, 1)), np.zeros((2, 1)), np.array([distance]), {"range": METER}
    )
    return float(noise.measure(seen, misses)["range"][0])


@pytest.mark.parametrize(("opposite", "share"), [(0, 0.95), (1, 0.95), (2, 1.05)])
def test_measured_range_keeps_the_section_of_the_worst_corner(opposite: int, share: float) -> None:
    """The section of the worst corner is the second one; measured ranges end there, on the side of
    the opposite one.
    """
    ranges = np.array([[3.0e6, 5.8e6, 8.0e6]])
    # Corners of modulus 5, 13 and 10: the largest components are in two sections. The opposite
    # ones: 2 and once 20.
    upper = np.array([[[3.0, 5.0, 8.0]], [[4.0, 12.0, 6.0]]])
    lower = np.full((2, 1, 3), -(2.0**0.5))
    lower[:, 0, opposite] = -12.0, -16.0
    noise = SwitchingNoise(TieRule.UPPER, np.ones((2, 1, 1)))
    assert ranged(noise, Misses(lower, upper, ranges), 5.8e6) == 5.8e6 * share
    mirrored = SwitchingNoise(TieRule.UPPER, -np.ones((2, 1, 1)))
    assert ranged(mirrored, Misses(-upper, -lower, ranges), 5.8e6) == 5.8e6 * share
    one = SwitchingNoise(TieRule.UPPER, np.array([[[1.0]], [[-1.0]]]))
    turned = Misses(np.stack([lower[0], -upper[1]]), np.stack([upper[0], -lower[1]]), ranges)
    assert ranged(one, turned, 5.8e6) == 5.8e6 * share


def test_scripted_noise_measures_with_its_errors() -> None:
    scripts = {"angle": draws(), "rate": draws(6), "range": draws(7)[0]}
    view = SimpleNamespace()
    for step in range(2):
        seen = sight(all_sensors(SENSOR), step=step)
        for make in (ScriptedNoise, RandomNoise):
            noise = make(scripts)
            measured = checked_measurements(noise.measure(seen, view), seen, noise)  # type: ignore[arg-type]
            for name, sensor in seen.sensors.items():
                assert np.array_equal(
                    measured[name], sensor.measured(seen, scripts[name][..., step])
                )
            for name, errors in errors_made(seen, measured).items():
                np.testing.assert_allclose(errors, scripts[name][..., step], atol=1e-9)
