"""Causes of misses, against engagements that are built for them and an independent computation."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from infoset import Model
from infoset.arrays import Floats
from infoset.experiments import load_scenario
from infoset.guidance import NoiseKind, Situation, Strategy, Thruster, make_strategy
from infoset.sim import Body, MissCause, Results, Scenario, simulate
from infoset.sim.draws import draw
from infoset.sim.engagement import Step
from infoset.sim.miss_cause import max_of_cause
from tests.space import in_space

ENGINE, BUDGET, KNOWLEDGE, SATURATED, GUIDANCE = MissCause
_AIMED = [f"dispersion.{key}=0" for key in ("y_km", "z_km", "vy_km_s", "vz_km_s")]


class Idle(Strategy):
    """Gives no impulse."""

    def start(self, lateral: tuple[int, int]) -> Any:
        return None

    def decide(self, situation: Situation, state: Any) -> Floats:
        return np.zeros_like(situation.predicted_miss.lower_m)


@pytest.mark.parametrize(
    ("cause", "settings", "strategy"),
    [
        # Four impulses, 5400, 2100, 750 and 180 s before the impact, correct 6.7 km at 0.8 m/s. The
        # radius is 50 m.
        (ENGINE, ["dispersion.z_km=7.2", "thruster.max_impulse_m_s=0.8"], None),
        # At 5400 s, 0.5 m/s corrects 2.7 km.
        (BUDGET, ["dispersion.z_km=4.9", "thruster.budget_m_s=0.5"], None),
        # The images until 750 s before the impact leave misses of 150 m possible.
        (KNOWLEDGE, ["noise=game", "thruster.impulses_s=[5400, 2100, 750]"], None),
        # From the first image on, two impulses correct 186 m; all four would correct 1.7 km.
        (
            SATURATED,
            ["dispersion.z_km=0.5", "thruster.max_impulse_m_s=0.2", "camera.first_image_s=800"],
            None,
        ),
        (GUIDANCE, ["dispersion.z_km=0.4"], Idle()),
    ],
)
def test_an_engagement_built_for_a_cause_has_it(
    cause: MissCause, settings: Sequence[str], strategy: Strategy | None
) -> None:
    scenario = load_scenario("haiv-2013", [*_AIMED, *settings])
    assert set(simulate(scenario, 10, strategy=strategy, guarantee=False).causes) == {cause}


def test_hits_and_bodies_without_a_size_have_no_cause(brief: Scenario) -> None:
    assert set(simulate(brief, 3).causes) == {None}
    results = simulate(replace(brief, body=Body(2.0)), 20)
    assert 0 < results.hit.sum() < 20
    np.testing.assert_array_equal(results.hit, [cause is None for cause in results.causes])


@pytest.mark.parametrize("name", ["asteroid-1997", "asteroid-1997-space", "haiv-2013"])
def test_unguided_miss_equals_the_miss_of_a_flight_without_impulses(name: str) -> None:
    guided, idle = (
        simulate(load_scenario(name), 5, strategy=each, guarantee=False) for each in (None, Idle())
    )
    np.testing.assert_allclose(guided.unguided_miss_m, idle.miss_m, rtol=1e-5)
    np.testing.assert_allclose(idle.unguided_miss_m, idle.miss_m, rtol=1e-5)


def test_corrections_of_engine_and_budget_are_sums_of_their_impulses(brief: Scenario) -> None:
    thruster = Thruster(
        20.0, 0.25, 7.5, execution_error_relative=0.1, last_impulse_s=2.0, delay_steps=3
    )
    box = replace(brief.dispersion, x_m=(595e3, 595e3), vx_m_s=(-58e3, -58e3))
    results = simulate(replace(brief, sun=None, thruster=thruster, dispersion=box), 1)
    arrival_s = 595.0 / 58.0
    # Flights have 21 steps of 0.4885 s. The last impulse is at step 17, 1.95 s before the arrival.
    arms_s = [arrival_s * (1.0 - step / 21) for step in range(3, 18)]
    assert results.engine_corrects_m[0] == pytest.approx(1.1 * 7.5 * sum(arms_s))
    assert results.budget_corrects_m[0] == pytest.approx(
        1.1 * (7.5 * arms_s[0] + 7.5 * arms_s[1] + 5.0 * arms_s[2])
    )


def random_scenario(brief: Scenario, rng: np.random.Generator) -> tuple[Scenario, Strategy]:
    """Return a short approach with random limits of the engine, a random body, and a strategy."""
    thruster = Thruster(
        float(rng.choice([10.0, 40.0, 1000.0])),
        float(rng.choice([0.0, 0.25])),
        float(np.exp(rng.uniform(np.log(0.4), np.log(8.0)))),
        execution_error_relative=float(rng.choice([0.0, 0.1])),
        last_impulse_s=float(rng.choice([0.0, 1.0, 3.0])),
        impulses_s=(8.0, 5.0, 3.5, 1.5) if rng.uniform() < 0.2 else (),
        delay_steps=int(rng.choice([0, 2])),
    )
    settings = replace(
        brief.information_set, model=Model.GUARANTEED if rng.uniform() < 0.5 else Model.PAPER
    )
    scenario = replace(
        brief,
        sun=None,
        noise=NoiseKind.GAME if rng.uniform() < 0.5 else NoiseKind.RANDOM,
        body=Body(float(rng.uniform(2.0, 40.0))),
        thruster=thruster,
        information_set=settings,
    )
    strategies = [make_strategy(name) for name in ("symmetric-miss", "patient", "least-effort")]
    return in_space(scenario) if rng.uniform() < 0.5 else scenario, [*strategies, Idle()][
        int(rng.integers(4))
    ]


def expected_causes(
    scenario: Scenario, strategy: Strategy, runs: int, seed: int
) -> tuple[Results, list[Any]]:
    """Return results, and causes run by run: forward from the start in free space, with impulses
    spent one by one.
    """
    steps: list[Step] = []
    budgets: list[Floats] = []

    class Watched(Strategy):
        def start(self, lateral: tuple[int, int]) -> Any:
            return strategy.start(lateral)

        def decide(self, situation: Situation, state: Any) -> Floats:
            budgets.append(situation.budget_left_m_s)
            return strategy.decide(situation, state)

    results = simulate(
        scenario,
        runs,
        seed=seed,
        strategy=Watched(),
        guarantee=False,
        observe=lambda _, step: steps.append(step),
    )
    errors = draw(scenario, range(runs), seed).execution
    found: list[Any] = []
    for run in range(runs):
        size = [1.0] * len(steps)
        if errors is not None:
            size = [
                1.0 + scenario.thruster.execution_error_relative * errors[run, i]
                for i in range(len(steps))
            ]
        executed = [
            step.impulse_m_s[:, run] * factor for step, factor in zip(steps, size, strict=True)
        ]
        *lateral_m, x_m = results.position_m[run]
        *lateral_m_s, vx_m_s = results.velocity_m_s[run]
        arrival_s = -x_m / vx_m_s
        start_m = np.array(lateral_m) + np.array(lateral_m_s) * arrival_s
        seen = [
            (
                step.tracking[run],
                step.predicted_miss.lower_m[:, run],
                step.predicted_miss.upper_m[:, run],
            )
            for step in steps
        ]
        left = [float(budget[run]) for budget in budgets]
        hit = bool(results.hit[run])
        found.append(
            None if hit else _expected(scenario, seen, left, executed, start_m, float(arrival_s))
        )
    return results, found


def _expected(
    scenario: Scenario,
    seen: Sequence[Any],
    left: Sequence[float],
    executed: Sequence[Floats],
    start_m: Floats,
    arrival_s: float,
) -> MissCause:
    thruster = scenario.thruster
    step_s = scenario.step_s
    radius_m = scenario.certain_radius_m or 0.0
    delay = thruster.delay_steps
    allowed = scenario.impulse_steps or range(thruster.delay_steps, 100)

    def corrects_m(decision: int, budget_m_s: float) -> float:
        total = 0.0
        for step in allowed:
            size = min(thruster.max_impulse_m_s, budget_m_s)
            if (
                step >= decision + delay
                and step * step_s < arrival_s
                and size > 0.0
                and size >= thruster.min_impulse_m_s
            ):
                total += (
                    size * (arrival_s - step * step_s) * (1.0 + thruster.execution_error_relative)
                )
                budget_m_s -= size
        return total

    def miss_m(decision: int) -> Floats:
        given = enumerate(executed[: decision + delay])
        return np.asarray(
            start_m - sum(u * max(arrival_s - step * step_s, 0.0) for step, u in given)
        )

    def possible_m(decision: int) -> float:
        _, lower, upper = seen[decision]
        middle = 0.5 * (lower + upper)
        return float(max(np.linalg.norm(upper - middle), np.linalg.norm(miss_m(decision) - middle)))

    decisions = [step - delay for step in allowed if step - delay < len(seen)]
    tracked = [decision for decision in decisions if seen[decision][0]]
    if np.linalg.norm(start_m) - corrects_m(0, np.inf) > radius_m:
        return ENGINE
    if np.linalg.norm(start_m) - corrects_m(0, thruster.budget_m_s) > radius_m:
        return BUDGET
    could = [
        each
        for each in tracked
        if np.linalg.norm(miss_m(each)) - corrects_m(each, left[each]) <= radius_m
    ]
    if not could:
        return KNOWLEDGE
    later = [decision for decision in tracked if decision > could[-1]]
    later_m = corrects_m(later[0], np.inf) if later else 0.0
    if later and np.linalg.norm(miss_m(later[0])) - later_m <= radius_m:
        return BUDGET
    _, lower, upper = seen[could[-1]]
    farthest_m = float(np.linalg.norm(np.maximum(np.abs(lower), np.abs(upper))))
    if max(possible_m(could[-1]) - later_m, farthest_m - corrects_m(could[-1], np.inf)) <= radius_m:
        return GUIDANCE
    return KNOWLEDGE if possible_m(tracked[-1]) > radius_m else SATURATED


@pytest.mark.thorough
def test_causes_equal_an_independent_computation(brief: Scenario) -> None:
    rng = np.random.default_rng(40)
    counted = Counter[Any]()
    expected = Counter[Any]()
    differ = 0
    for seed in range(80):
        results, wanted = expected_causes(*random_scenario(brief, rng), runs=125, seed=seed)
        counted.update(results.causes)
        expected.update(wanted)
        differ += sum(found is not want for found, want in zip(results.causes, wanted, strict=True))
    assert min(counted[cause] for cause in MissCause) > 20
    assert (counted, differ) == (expected, 0)


@pytest.mark.parametrize(
    ("values_m", "maximum"),
    [
        ([np.nan, 3.0, 4.0, 9.0], 4.0),
        ([5.0, np.nan, 3.0, 9.0], 5.0),
        ([np.nan, np.nan, np.nan, 9.0], None),
    ],
)
def test_unknown_values_do_not_count_in_the_maximum_of_a_cause(
    values_m: list[float], maximum: float | None
) -> None:
    causes = np.array(["knowledge", "knowledge", "knowledge", "engine"], dtype=object)
    assert max_of_cause(causes, np.array(values_m), MissCause.KNOWLEDGE) == maximum
