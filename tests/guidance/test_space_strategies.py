"""Strategies in space: a planar one on each axis, and those that decide for both."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
import pytest

from experiments import load_scenario
from guidance import (
    Kalman,
    LeastEffort,
    NoiseKind,
    Patient,
    Predictive,
    ProportionalNavigation,
    Situation,
    Strategy,
    SymmetricMiss,
    Thruster,
    TieRule,
    ZeroEffortMiss,
    strategy_names,
    symmetric_impulse,
)
from guidance.strategy import checked_impulses, decide, start
from infoset import (
    AngleSensor,
    InformationSet,
    Model,
    RangeSensor,
    RateSensor,
    SetModel,
    StateBox,
)
from infoset.arrays import Floats
from sim import Scenario, simulate

BATCH = 3
ALL = np.ones(BATCH, dtype=bool)
SENSOR = AngleSensor(0.5, 0.00015, 0.00023, 5801.3e3)
BOX = StateBox((-10e3, 10e3), (5301.3e3, 6301.3e3), (-100.0, 100.0), (-59e3, -57e3), (-8e3, 6e3), (-50.0, 80.0))
MODEL = SetModel(58e3, 0.5, BOX, SENSOR, disturbance_m_s2=0.005, disturbance_y_m_s2=0.002, model=Model.PAPER)
AXES = ("y", "z")


def situations(model: SetModel, seed: int = 0, steps: int = 5) -> list[Situation]:
    """The situations of a few steps, all of whose impulses are drawn at random."""
    random = np.random.default_rng(seed)
    information, last, made = InformationSet(model, BATCH), np.zeros((2, BATCH)), []
    is_idle = model.bounds.y_m == (0.0, 0.0)
    alpha = 1e-4 * random.uniform(-1.0, 1.0, (2, BATCH)) * ([[0.0], [1.0]] if is_idle else 1.0)
    measured: dict[str, Floats] = {}
    for step in range(steps):
        errors = SENSOR.error_bound(5e6) * random.uniform(-0.5, 0.5, (2, BATCH)) * ([[0.0], [1.0]] if is_idle else 1.0)
        new = {"angle": alpha + errors, "rate": errors * 1e-3}
        if step % 2 == 0:
            new["range"] = random.uniform(5.6e6, 5.7e6, BATCH) - 29e3 * step
            information.measure_range(new["range"], 0.05, alpha_rad=new["angle"])
        information.measure_angle(new["angle"])
        measured = measured | new
        made.append(
            Situation(
                time_s=0.5 * step,
                step=step,
                step_s=0.5,
                predicted_miss=information.predicted_miss(),
                budget_left_m_s=np.full(BATCH, 900.0 - step),
                thruster=Thruster(1000.0, 0.25, 7.5),
                closing_speed_m_s=58e3,
                measured=measured,
                last_impulse_m_s=last,
                information=information.copy().view(),
                new=frozenset(new),
                sensors={"range": RangeSensor(1.0, 0.05), "angle": model.angle_sensor, "rate": RateSensor(0.5, 1e-6)},
            )
        )
        last = random.uniform(-5.0, 5.0, (2, BATCH)) * ([[0.0], [1.0]] if is_idle else 1.0)
        information.shift(last)
        information.predict()
    return made


def planar(name: str, whole: Situation) -> Situation:
    """The situation of an axis, written out."""
    number, view = AXES.index(name), whole.information.axis(name)
    return replace(
        whole,
        predicted_miss=view.predicted_miss(),
        measured={
            "angle": whole.measured["angle"][number],
            "rate": whole.measured["rate"][number],
            "range": whole.measured["range"],
        },
        last_impulse_m_s=whole.last_impulse_m_s[number],
        information=view,
        sensors={**whole.sensors, "angle": SENSOR},
    )


EAGER: dict[str, Strategy] = {
    "symmetric-miss": SymmetricMiss(),
    "least-effort": LeastEffort(),
    "patient": Patient(0.0),
    "zero-effort-miss": ZeroEffortMiss(),
    "kalman": Kalman(dead_zone=0.0),
    "pn-kalman": ProportionalNavigation(dead_band_m_s=0.0),
    "apn-kalman": ProportionalNavigation(is_augmented=True, dead_band_m_s=0.0),
    "predictive-kalman": Predictive(spacing=1.0001),
}
"""The built-in strategies without dead zones and waiting."""


@pytest.mark.parametrize("strategy", EAGER.values(), ids=EAGER)
def test_built_in_strategies_are_flown_on_each_axis(strategy: Strategy) -> None:
    states, alone = start(strategy, BATCH, AXES), [strategy.start(BATCH) for _ in AXES]
    assert len(states) == 2
    for whole in situations(MODEL):
        wanted = decide(strategy, whole, states, ALL)
        assert wanted.shape == (2, BATCH)
        for number, axis in enumerate(AXES):
            assert np.array_equal(wanted[number], strategy.decide(planar(axis, whole), alone[number]))
    assert np.abs(wanted).max(axis=1).min() > 0.0


def test_the_situation_of_an_axis() -> None:
    whole = situations(MODEL)[-1]
    for number, name in enumerate(AXES):
        one = whole.axis(name)
        assert one.axes == ("z",)
        assert one.axis("z") is one
        assert one.information.model == whole.information.model.axis(name)
        assert one.sensors["angle"] == SENSOR
        assert one.sensors["range"] is whole.sensors["range"]
        assert np.array_equal(one.last_impulse_m_s, whole.last_impulse_m_s[number])
        assert np.array_equal(one.measured["rate"], whole.measured["rate"][number])
        assert np.array_equal(one.measured["angle"], whole.measured["angle"][number])
        assert np.array_equal(one.predicted_miss.upper_m, whole.predicted_miss.upper_m[number])
        assert np.array_equal(one.predicted_miss.upper_m, one.information.predicted_miss().upper_m)
        assert one.budget_left_m_s is whole.budget_left_m_s
        assert one.thruster is whole.thruster


class Noted:
    """A planar strategy that stores what it gets."""

    def start(self, batch: int) -> list[Situation]:
        return []

    def decide(self, situation: Situation, state: list[Situation]) -> Floats:
        state.append(situation)
        return symmetric_impulse(situation.predicted_miss, situation.closing_speed_m_s)


class Vector(Noted):
    """A strategy that decides for both axes."""

    spatial: ClassVar[bool] = True


def test_a_planar_strategy_has_one_state_for_each_axis_and_a_spatial_one_has_one() -> None:
    now = situations(MODEL)[0]
    states = start(Noted(), BATCH, AXES)
    wanted = decide(Noted(), now, states, ALL)
    for state, name in zip(states, AXES, strict=True):
        (seen,) = state
        assert seen.information.model == MODEL.axis(name)
        assert seen.measured["angle"].shape == seen.last_impulse_m_s.shape == (BATCH,)
    (whole,) = start(Vector(), BATCH, AXES)
    assert np.array_equal(decide(Vector(), now, [whole], ALL), wanted)
    assert whole == [now]


def test_in_a_plane_a_strategy_gets_the_planar_situation_and_one_for_both_axes_is_refused() -> None:
    now = planar("z", situations(MODEL)[0])
    states = start(Noted(), BATCH, ("z",))
    assert decide(Noted(), now, states, ALL).shape == (BATCH,)
    assert states == [[now]]
    # With two engagements its arrays of shape (2, B) would be taken from arrays of shape (B,): engagements for axes.
    with pytest.raises(ValueError, match=r"strategy Vector decides for both lateral axes .* scenario is in a plane"):
        start(Vector(), BATCH, ("z",))


def test_an_impulse_need_be_finite_only_where_a_set_is_tracked() -> None:
    now, wanted = situations(MODEL)[0], np.zeros((2, BATCH))
    wanted[0, 1] = np.inf
    assert checked_impulses(wanted, now, np.array([True, False, True]), object()) is wanted
    with pytest.raises(ValueError, match="finite"):
        checked_impulses(wanted, now, ALL, object())


def space() -> Scenario:
    return replace(load_scenario("asteroid-1997-space"), range_sensor=None)


@pytest.mark.parametrize("name", strategy_names())
@pytest.mark.parametrize("noise", list(NoiseKind))
def test_all_strategies_arrive_in_space(name: str, noise: NoiseKind) -> None:
    results = simulate(replace(space(), noise=noise), 6, strategy=name)
    assert np.median(results.miss_m) < 60.0
    assert not results.set_emptied.any()


def test_a_spatial_strategy_flies_as_the_planar_one_on_each_axis() -> None:
    class Symmetric(Vector):
        def start(self, batch: int) -> Any:
            return None

        def decide(self, situation: Situation, state: Any) -> Floats:
            return symmetric_impulse(situation.predicted_miss, situation.closing_speed_m_s)

    for noise in NoiseKind:
        scenario = replace(space(), noise=noise, tie=TieRule.RANDOM)
        vector, axes = simulate(scenario, 4, strategy=Symmetric()), simulate(scenario, 4)
        assert np.array_equal(vector.miss_m, axes.miss_m)
        assert np.array_equal(vector.impulse_m_s, axes.impulse_m_s)
