"""Strategies in space: along each axis the decisions of its plane."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest

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
from infoset.experiments import load_scenario
from infoset.guidance import (
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
    ZeroEffortMiss,
    strategy_names,
)
from infoset.guidance.estimate import MissEstimate
from infoset.guidance.predictive import ManoeuvreState
from infoset.guidance.strategy import checked_impulses
from infoset.sim import Scenario, simulate

BATCH = 3
SENSOR = AngleSensor(0.5, 0.00015, 0.00023, 5801.3e3)
BOX = StateBox(
    (-10e3, 10e3), (5301.3e3, 6301.3e3), (-100.0, 100.0), (-59e3, -57e3), (-8e3, 6e3), (-50.0, 80.0)
)
MODEL = SetModel(
    58e3, 0.5, BOX, SENSOR, disturbance_m_s2=0.005, disturbance_y_m_s2=0.002, model=Model.PAPER
)
AXES = ("y", "z")


def situations(
    model: SetModel, seed: int = 0, steps: int = 5
) -> list[tuple[Situation, list[Situation]]]:
    """The situations of a few steps, whose impulses are drawn at random, and the same in the plane
    of each axis.
    """
    random = np.random.default_rng(seed)
    sets = [InformationSet(each, BATCH) for each in (model, *map(model.axis, AXES))]
    rows: list[slice] = [slice(0, 2), slice(0, 1), slice(1, 2)]
    last = np.zeros((2, BATCH))
    measured = dict[str, Floats]()
    made = []
    alpha = 1e-4 * random.uniform(-1.0, 1.0, (2, BATCH))
    for step in range(steps):
        errors = SENSOR.error_bound(5e6) * random.uniform(-0.5, 0.5, (2, BATCH))
        new = {"angle": alpha + errors, "rate": errors * 1e-3}
        if step % 2 == 0:
            new["range"] = random.uniform(5.6e6, 5.7e6, BATCH) - 29e3 * step
        measured = measured | new
        now = []
        for information, row in zip(sets, rows, strict=True):
            if "range" in new:
                information.measure_range(new["range"], 0.05, alpha_rad=new["angle"][row])
            information.measure_angle(new["angle"][row])
            now.append(
                Situation(
                    time_s=0.5 * step,
                    step=step,
                    step_s=0.5,
                    predicted_miss=information.predicted_miss(),
                    budget_left_m_s=np.full(BATCH, 900.0 - step),
                    thruster=Thruster(1000.0, 0.25, 7.5),
                    closing_speed_m_s=58e3,
                    measured={
                        name: each if each.ndim == 1 else each[row]
                        for name, each in measured.items()
                    },
                    last_impulse_m_s=last[row],
                    information=information.copy().view(),
                    new=frozenset(new),
                    sensors={
                        "range": RangeSensor(1.0, 0.05),
                        "angle": SENSOR,
                        "rate": RateSensor(0.5, 1e-6),
                    },
                )
            )
        made.append((now[0], now[1:]))
        last = random.uniform(-5.0, 5.0, (2, BATCH))
        for information, row in zip(sets, rows, strict=True):
            information.shift(last[row])
            information.predict()
    return made


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
def test_built_in_strategies_decide_along_each_axis_as_in_its_plane(strategy: Strategy) -> None:
    state = strategy.start((2, BATCH))
    planar = [strategy.start((1, BATCH)) for _ in AXES]
    for whole, planes in situations(MODEL):
        wanted = strategy.decide(whole, state)
        assert wanted.shape == (2, BATCH)
        for number, plane in enumerate(planes):
            assert np.array_equal(wanted[number], strategy.decide(plane, planar[number])[0])
    assert np.abs(wanted).max(axis=1).min() > 0.0


class KnownMiss:
    """An estimator whose correction along both axes is known, with 10 s to go."""

    def __init__(self, impulse_m_s: float) -> None:
        self._miss_m = 10.0 * np.full((2, BATCH), impulse_m_s)

    def update(self, situation: Situation) -> None:
        """Do nothing."""

    def estimate(self, situation: Situation) -> MissEstimate:
        """Return the known miss."""
        to_go_s = np.full((2, BATCH), 10.0)
        return MissEstimate(self._miss_m, np.zeros((2, BATCH)), to_go_s)


@pytest.mark.parametrize(
    ("along_axis_m_s", "next_s"),
    [
        # The modulus, 7.07, is below the maximum impulse, 7.5 m/s: the next one is at 10 s / 1.5.
        (5.0, 10.0 / 1.5),
        # The modulus, 8.49, is above it: the manoeuvre continues.
        (6.0, 20.0),
    ],
)
def test_manoeuvre_is_done_if_its_modulus_is_within_the_maximum_impulse(
    along_axis_m_s: float, next_s: float
) -> None:
    (now, _) = situations(MODEL)[0]
    state = ManoeuvreState(cast("Any", KnownMiss(along_axis_m_s)), np.full((2, BATCH), 20.0))

    wanted = Predictive(spacing=1.5).decide(now, state)

    np.testing.assert_array_equal(wanted, along_axis_m_s)
    np.testing.assert_array_equal(state.due_s, next_s)


def test_an_impulse_need_be_finite_only_where_a_set_is_tracked() -> None:
    (now, _), wanted = situations(MODEL)[0], np.zeros((2, BATCH))
    wanted[0, 1] = np.inf
    assert checked_impulses(wanted, now, np.array([True, False, True]), object()) is wanted
    for wrong in (wanted, np.zeros(BATCH), np.zeros((BATCH, 2))):
        with pytest.raises(ValueError, match=r"finite impulses \(m/s\) of the shape \(2, 3\)"):
            checked_impulses(wrong, now, np.ones(BATCH, dtype=bool), object())


def space() -> Scenario:
    return replace(load_scenario("asteroid-1997-space"), range_sensor=None)


@pytest.mark.parametrize("name", strategy_names())
@pytest.mark.parametrize(
    "noise", [pytest.param(NoiseKind.RANDOM, marks=pytest.mark.thorough), NoiseKind.GAME]
)
def test_all_strategies_arrive_in_space(name: str, noise: NoiseKind) -> None:
    results = simulate(replace(space(), noise=noise), 6, strategy=name)
    assert np.median(results.miss_m) < 60.0
    assert not results.set_emptied.any()
