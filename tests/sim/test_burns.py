"""Impulses at scheduled times, before a cut-off and after a delay, in engagements computed by hand
and in flight.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from infoset import (
    AngleSensor,
    ExtremePoints,
    InformationSet,
    InitialSet,
    Model,
    PredictedMiss,
    SetModel,
    StateBox,
)
from infoset.arrays import Floats
from infoset.guidance import (
    NoiseKind,
    Patient,
    Situation,
    Strategy,
    SymmetricMiss,
    Thruster,
    TieRule,
)
from infoset.sim import Results, Scenario, fly_one, simulate
from infoset.sim.draws import draw
from infoset.sim.engagement import Engagements, Step
from infoset.sim.scenario import of_model
from tests.guaranteed import guaranteed
from tests.space import in_space

E, RANGE = 58e3, 5800e3


@pytest.fixture
def known(asteroid: Scenario) -> Scenario:
    """A straight flight of 100 s at a miss of 900 m, known on board, with a strong engine."""
    box = StateBox((700.0, 700.0), (RANGE, RANGE), (2.0, 2.0), (-E, -E))
    sensor = AngleSensor(0.5, 1e-10, 1e-10, RANGE)
    model = replace(asteroid.set_model, bounds=box, angle_sensor=sensor, disturbance_m_s2=0.0)
    return replace(
        asteroid,
        sun=None,
        nominal_range_m=RANGE,
        dispersion=box,
        **of_model(
            replace(
                model,
                initial_set=InitialSet.BOX,
                range_threshold_m=1e3,
                sections=1,
                fewest_sections=1,
            )
        ),
        thruster=Thruster(1000.0, 0.0, 500.0),
    )


def with_thruster(scenario: Scenario, **fields: Any) -> Scenario:
    return replace(scenario, thruster=replace(scenario.thruster, **fields))


def impulses(
    scenario: Scenario, seed: int = 0, strategy: Strategy | None = None
) -> dict[float, float]:
    """Return the impulses of one planar flight by time."""
    given: dict[float, float] = {}
    flight = Engagements(scenario, draw(scenario, [0], seed), strategy, guarantee=False)
    while flight.flying:
        flight.advance(lambda step: given.update({step.time_s: step.impulse_m_s.item()}))
    return {time_s: impulse for time_s, impulse in given.items() if impulse != 0.0}


STRATEGIES = ["symmetric-miss", "zero-effort-miss", "patient"]


@pytest.mark.parametrize("strategy", STRATEGIES)
@pytest.mark.parametrize("delay_steps", [0, 1, 7])
def test_a_single_impulse_without_noise_hits(
    known: Scenario, strategy: str, delay_steps: int
) -> None:
    """The impulse corrects 900 m in the 40 s that are left when it is given, whenever it was
    decided.
    """
    scenario = replace(
        with_thruster(known, impulses_s=(40.0,), delay_steps=delay_steps), strategy=strategy
    )
    given = impulses(scenario)
    assert list(given) == [60.0]
    assert given[60.0] == pytest.approx(900.0 / 40.0, rel=1e-6)
    result = simulate(scenario, 1)
    assert result.miss_m[0] < 1e-4
    assert result.impulse_m_s[0] == pytest.approx(900.0 / 40.0, rel=1e-6)


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_a_later_impulse_corrects_the_rest(known: Scenario, strategy: str) -> None:
    """An engine of 10 m/s corrects 500 m of 900 m with 50 s left; 400 m need 20 m/s with 20 s left
    and get 10.
    """
    scenario = replace(
        with_thruster(known, impulses_s=(50.0, 20.0), max_impulse_m_s=10.0, delay_steps=3),
        strategy=strategy,
    )
    assert impulses(scenario) == pytest.approx({50.0: 10.0, 80.0: 10.0}, rel=1e-6)
    assert simulate(scenario, 1).miss_m[0] == pytest.approx(900.0 - 500.0 - 200.0, rel=1e-6)


@pytest.mark.parametrize("delay_steps", [0, 3])
@pytest.mark.parametrize("strategy", [*STRATEGIES, "kalman"])
def test_impulses_are_zero_after_the_cut_off(
    asteroid: Scenario, strategy: str, delay_steps: int
) -> None:
    scenario = replace(
        with_thruster(asteroid, last_impulse_s=30.0, delay_steps=delay_steps), strategy=strategy
    )
    given = impulses(scenario, seed=1)
    assert min(given) >= 0.5 * delay_steps
    assert max(given) <= scenario.nominal_arrival_s - 30.0
    later = with_thruster(scenario, last_impulse_s=10.0)
    assert max(impulses(later, seed=1)) > scenario.nominal_arrival_s - 30.0


class Wasteful(SymmetricMiss):
    """Always wants the maximum impulse."""

    def decide(self, situation: Situation, state: None) -> Floats:
        assert (situation.budget_left_m_s >= 0.0).all()
        return np.full(situation.last_impulse_m_s.shape, situation.thruster.max_impulse_m_s)


@pytest.mark.parametrize("strategy", [SymmetricMiss(), Wasteful()], ids=["symmetric", "wasteful"])
@pytest.mark.parametrize("budget", [0.0, 7.5, 31.0])
def test_pending_impulses_count_in_the_budget(
    asteroid: Scenario, budget: float, strategy: Strategy
) -> None:
    scenario = with_thruster(asteroid, budget_m_s=budget, delay_steps=9)
    record = fly_one(replace(scenario, noise=NoiseKind.GAME), strategy=strategy)
    given = np.abs(record.impulse_m_s[:, 0]).tolist()
    assert sum(given) <= budget * (1.0 + 1e-12)
    assert record.result.impulse_m_s[0] == pytest.approx(sum(given), abs=1e-9)
    if isinstance(strategy, Wasteful) and budget == 31.0:
        assert sum(given) == pytest.approx(31.0)
        assert given[:9] == [0.0] * 9


def situation(lower: float, upper: float, **fields: Any) -> Situation:
    """One planar engagement, 50 s before the arrival, with a predicted-miss interval and a strong
    engine.
    """
    point = ExtremePoints(np.zeros((1, 1)), np.zeros((1, 1)), np.array([[E * 50.0]]))
    box = StateBox((-1e3, 1e3), (RANGE, RANGE), (-10.0, 10.0), (-E, -E))
    information = InformationSet(
        SetModel(
            E,
            0.5,
            box,
            AngleSensor(0.5, 1e-4, 1e-4, RANGE),
            sections=1,
            fewest_sections=1,
            model=Model.PAPER,
        )
    )
    values: dict[str, Any] = {
        "time_s": 50.0,
        "step": 100,
        "step_s": 0.5,
        "predicted_miss": PredictedMiss(
            np.array([True]), np.array([[lower]]), np.array([[upper]]), point, point
        ),
        "budget_left_m_s": np.array([1000.0]),
        "thruster": Thruster(1000.0, 0.0, 10.0),
        "closing_speed_m_s": E,
        "measured": {},
        "last_impulse_m_s": np.zeros((1, 1)),
        "information": information.view(),
    }
    return Situation(**{**values, **fields})


@pytest.mark.parametrize(
    ("later", "budget", "expected"),
    [
        ([], 1000.0, 0.0),
        ([70.0], 1000.0, 10.0 * 30.0),
        ([70.0, 90.0], 1000.0, 10.0 * 30.0 + 10.0 * 10.0),
        ([70.0, 90.0, 100.0, 120.0], 1000.0, 10.0 * 30.0 + 10.0 * 10.0),
        ([70.0, 90.0], 14.0, 10.0 * 30.0 + 4.0 * 10.0),
        ([70.0, 90.0], 4.0, 4.0 * 30.0),
        ([70.0, 90.0], 0.0, 0.0),
    ],
)
def test_patient_relies_on_the_later_impulses_of_the_schedule(
    later: list[float], budget: float, expected: float
) -> None:
    """With 50 s left, the part of the miss that later impulses cannot correct is corrected.

    The last impulse acts as U_s.
    """
    now = situation(
        0.0,
        1000.0,
        later_times_s=np.array(later),
        budget_left_m_s=np.array([budget]),
        thruster=Thruster(1e3, 0.0, 10.0),
    )
    wanted = Patient(1.0).decide(now, None).item()
    symmetric = 500.0 / 50.0
    assert wanted == pytest.approx(symmetric if not later else (1000.0 - expected) / 50.0, rel=1e-6)


def test_a_strategy_sees_the_schedule(known: Scenario) -> None:
    seen: list[Situation] = []

    class Looking(SymmetricMiss):
        def decide(self, situation: Situation, state: None) -> Floats:
            seen.append(situation)
            return super().decide(situation, state)

    scenario = with_thruster(known, impulses_s=(80.0, 40.0), delay_steps=4, min_impulse_m_s=0.1)
    fly_one(scenario, strategy=Looking())
    assert [now.step for now in seen if now.may_fire] == [36, 116]
    assert {now.lead_s for now in seen} == {2.0}
    assert [now.next_s for now in seen[:3]] == [18.0, 17.5, 17.0]
    assert (seen[36].next_s, seen[37].next_s, seen[116].next_s) == (40.0, 39.5, None)
    assert (seen[0].last_s, seen[116].last_s) == (60.0, 2.0)
    given = 900.0 / 80.0
    assert [len(now.pending) for now in seen[36:43]] == [0, 1, 1, 1, 1, 0, 0]
    ((time_s, impulse),) = seen[38].pending
    assert time_s == 1.0
    assert impulse.item() == pytest.approx(given, rel=1e-6)
    assert seen[38].pending_m(np.array([[81.0, 0.5]])) == pytest.approx(
        np.array([[[80.0 * given, 0.0]]]), rel=1e-6
    )
    # The predicted miss counts the pending impulse, the set does not until it is given.
    middle = [
        0.5 * (now.predicted_miss.lower_m.item() + now.predicted_miss.upper_m.item())
        for now in seen[36:43]
    ]
    assert middle == pytest.approx([900.0, *[0.0] * 6], abs=1e-3)


@pytest.mark.parametrize("spatial", [False, True])
def test_predicted_miss_after_pending_impulses_equals_the_miss_of_the_shifted_set(
    asteroid: Scenario, spatial: bool
) -> None:
    """Without measurements and disturbances, the interval is the same before and after the impulses
    are given.
    """
    scenario = in_space(guaranteed(asteroid)) if spatial else guaranteed(asteroid)
    model = replace(scenario.set_model, disturbance_m_s2=0.0, execution_error_relative=0.02)
    model = replace(model, pointing_error_rad=0.01 if spatial else 0.0)
    information = InformationSet(model, 2)
    shape = len(model.axes), 2
    information.measure_angle(np.full(shape, 1e-4))
    random = np.random.default_rng(1)
    first, second = random.uniform(-5.0, 5.0, (2, *shape))
    early = information.predicted_miss([(1.0, first), (2.5, second)])
    for step in range(5):
        if step == 2:
            information.shift(first)
        information.predict()
    information.shift(second)
    late = information.predicted_miss()
    for name in ("lower_m", "upper_m"):
        np.testing.assert_allclose(getattr(early, name), getattr(late, name), rtol=1e-9)
    now = InformationSet(model, 2)
    now.measure_angle(np.full(shape, 1e-4))
    np.testing.assert_array_equal(
        now.predicted_miss([(1e6, first)]).upper_m, now.predicted_miss().upper_m
    )


def sound(results: Results) -> bool:
    return bool(
        results.truth_kept.all()
        and results.phi_held.filled(False).all()
        and not results.set_emptied.any()
    )


SCHEDULES: list[dict[str, Any]] = [
    {"delay_steps": 1},
    {"delay_steps": 12},
    {"last_impulse_s": 15.0, "delay_steps": 3},
    {"impulses_s": (80.0, 50.0, 30.0, 10.0, 1.0), "delay_steps": 5},
]


@pytest.mark.parametrize("fields", SCHEDULES, ids=["one-step", "twelve-steps", "cut-off", "times"])
@pytest.mark.parametrize(
    "strategy",
    [STRATEGIES[0], *(pytest.param(each, marks=pytest.mark.thorough) for each in STRATEGIES[1:])],
)
@pytest.mark.parametrize("spatial", [False, True], ids=["plane", "space"])
def test_the_guarantee_holds_with_errors_of_the_engine_and_a_delay(
    asteroid: Scenario, fields: dict[str, Any], strategy: str, spatial: bool
) -> None:
    """Measurements between decision and impulse keep the truth in the set, and the miss is at most
    Phi.
    """
    scenario = replace(guaranteed(asteroid), strategy=strategy)
    scenario = with_thruster(
        in_space(scenario) if spatial else scenario, execution_error_relative=0.05, **fields
    )
    if spatial:
        scenario = with_thruster(scenario, pointing_error_rad=0.02)
    for noise in (NoiseKind.RANDOM, NoiseKind.GAME):
        assert sound(simulate(replace(scenario, noise=noise, tie=TieRule.RANDOM), 6, seed=4))


def test_an_impulse_at_a_finished_set_moves_phi(asteroid: Scenario) -> None:
    """Impulses that are given after the last label has left still move the pieces of Phi."""
    far = replace(asteroid, **of_model(replace(asteroid.set_model, range_threshold_m=300e3)))
    scenario = with_thruster(guaranteed(far), delay_steps=8, budget_m_s=1e4)
    late: list[bool] = []

    def look(step: Step) -> None:
        late.extend((~step.tracking & step.flying & (step.impulse_m_s != 0.0)).tolist())

    flight = Engagements(scenario, draw(scenario, range(12), 5), Wasteful())
    while flight.flying:
        flight.advance(look)
    assert any(late)
    assert sound(flight.results(np.arange(12)))
