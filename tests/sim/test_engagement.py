"""The closed loop: symmetry, the truth in its set, outcomes, reproducibility."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from infoset import InitialSet, Model, StateBox
from infoset.arrays import Floats
from infoset.guidance import NoiseKind, Situation, TieRule
from infoset.sim import Outcome, Results, Scenario, simulate
from infoset.sim.draws import Draws, draw
from infoset.sim.engagement import Engagements
from infoset.sim.kepler import Passage, Sight
from infoset.sim.scenario import of_model
from tests.long_steps import with_long_steps


def fly(scenario: Scenario, draws: Draws, truth: object = None) -> Results:
    flight = Engagements(scenario, draws, truth=truth)  # type: ignore[arg-type]
    while flight.flying:
        flight.advance()
    return flight.results(np.arange(len(draws.position_m)))


def mirrored_interval(interval: tuple[float, float]) -> tuple[float, float]:
    return -interval[1], -interval[0]


def mirror(scenario: Scenario, draws: Draws) -> tuple[Scenario, Draws]:
    box = scenario.set_model.bounds
    bounds = replace(box, z_m=mirrored_interval(box.z_m), vz_m_s=mirrored_interval(box.vz_m_s))
    assert scenario.sun is not None
    swapped = {TieRule.UPPER: TieRule.LOWER, TieRule.LOWER: TieRule.UPPER}
    mirrored = replace(
        scenario,
        sun=replace(scenario.sun, direction_rad=-scenario.sun.direction_rad),
        **of_model(replace(scenario.set_model, bounds=bounds)),
        tie=swapped.get(scenario.tie, scenario.tie),
    )
    flip = np.array([-1.0, 1.0])
    errors = {**draws.errors, "angle": -draws.errors["angle"]}
    return mirrored, Draws(draws.position_m * flip, draws.velocity_m_s * flip, errors, -draws.tie)


# Of the comet the range is measured too.
@pytest.mark.parametrize(
    "name", ["asteroid", pytest.param("ranging", marks=pytest.mark.thorough), "comet"]
)
@pytest.mark.parametrize(
    ("noise", "tie"),
    [
        (NoiseKind.RANDOM, TieRule.UPPER),
        (NoiseKind.CORRELATED, TieRule.UPPER),
        (NoiseKind.GAME, TieRule.UPPER),
        (NoiseKind.GAME, TieRule.LOWER),
        (NoiseKind.GAME, TieRule.RANDOM),
    ],
)
@pytest.mark.parametrize("model", list(Model))
def test_a_mirrored_engagement_is_mirrored(
    name: str, noise: NoiseKind, tie: TieRule, model: Model, request: pytest.FixtureRequest
) -> None:
    scenario = with_long_steps(request.getfixturevalue(name), 3 if name == "comet" else 2)
    scenario = replace(scenario, noise=noise, tie=tie)
    if model is Model.GUARANTEED:
        box = replace(scenario.set_model, model=model, initial_set=InitialSet.BOX)
        scenario = replace(scenario, **of_model(box))
    draws = draw(scenario, range(8), 3)
    there = fly(scenario, draws)
    back = fly(*mirror(scenario, draws))
    np.testing.assert_allclose(back.miss_m, there.miss_m, rtol=1e-9)
    np.testing.assert_allclose(back.impulse_m_s, there.impulse_m_s, rtol=1e-9)
    np.testing.assert_allclose(back.guaranteed_miss_m, there.guaranteed_miss_m, rtol=1e-9)
    assert back.outcomes == there.outcomes


class ModelMotion:
    """The model's own dynamics: V_x = -e, disturbances within their bound, constant over a step."""

    def __init__(self, scenario: Scenario, draws: Draws, seed: int) -> None:
        self._e = scenario.set_model.closing_speed_m_s
        self._nu = scenario.set_model.disturbance_m_s2
        self._z = draws.position_m.T[:1].copy()
        self._v = draws.velocity_m_s.T[:1].copy()
        self._start = draws.position_m[:, 1].copy()
        self._steps = 0
        self._x = self._start.copy()
        self._random = np.random.default_rng(seed)

    def sight(self) -> Sight:
        alpha = self._z / self._x
        omega = (self._v + self._e * alpha) / self._x
        slope = np.tan(alpha)
        return Sight(alpha, omega, self._x, self._x, slope, omega * (1.0 + slope * slope))

    def fire(self, impulse_m_s: Floats) -> None:
        self._v = self._v - impulse_m_s

    @property
    def position_m(self) -> Floats:
        return np.stack([self._z[0], self._x], axis=1)

    def arrival_s(self) -> Floats:
        return self._start / self._e

    def advance(self, step_s: float, manoeuvre_m_s2: Floats | None = None) -> Passage:
        # Half of the disturbances at their bounds: the extremes are what a set must withstand.
        push = np.clip(self._random.uniform(-2.0, 2.0, self._z.shape), -1.0, 1.0) * self._nu
        self._z = self._z + self._v * step_s + 0.5 * push * step_s**2
        self._v = self._v + push * step_s
        self._steps += 1
        before = self._x
        self._x = self._start - self._e * step_s * self._steps
        return Passage(self._x <= 0.0, np.abs(self._z[0]), before / self._e, self._z)


def fly_in_the_model(scenario: Scenario, engagements: int, seed: int) -> Results:
    e = scenario.set_model.closing_speed_m_s
    scenario = replace(scenario, sun=None, dispersion=replace(scenario.dispersion, vx_m_s=(-e, -e)))
    draws = draw(scenario, range(engagements), seed)
    return fly(scenario, draws, ModelMotion(scenario, draws, seed))


@pytest.mark.parametrize("noise", [NoiseKind.RANDOM, NoiseKind.GAME])
def test_the_truth_stays_in_its_section_in_the_models_own_dynamics(
    asteroid: Scenario, noise: NoiseKind
) -> None:
    results = fly_in_the_model(replace(asteroid, noise=noise), 160, 5)
    assert results.truth_margin_m.min() >= 0.0
    assert Outcome.SET_EMPTY not in results.outcomes


def test_run_is_the_same_in_every_batch(ranging: Scenario) -> None:
    scenario = replace(ranging, noise=NoiseKind.GAME, tie=TieRule.RANDOM)
    together = simulate(scenario, 9, seed=4)
    alone = simulate(scenario, [7], seed=4)
    assert alone.miss_m[0] == together.miss_m[7]
    assert alone.impulse_m_s[0] == together.impulse_m_s[7]
    assert alone.guaranteed_miss_m.tolist()[0] == together.guaranteed_miss_m.tolist()[7]
    assert alone.truth_margin_m[0] == together.truth_margin_m[7]


class Silent:
    def start(self, shape: tuple[int, int]) -> None: ...

    def decide(self, situation: Situation, state: None) -> Floats:
        return np.zeros_like(situation.last_impulse_m_s)


def test_miss_without_control_equals_the_miss_of_the_free_motion(asteroid: Scenario) -> None:
    results = simulate(replace(asteroid, sun=None), 10, strategy=Silent())
    z, x = results.position_m.T
    vz, vx = results.velocity_m_s.T
    np.testing.assert_allclose(
        results.miss_m, np.abs(z * vx - x * vz) / np.hypot(vz, vx), rtol=1e-9
    )
    assert not results.impulse_m_s.any()


class Broken:
    def start(self, shape: tuple[int, int]) -> None: ...

    def decide(self, situation: Situation, state: None) -> Floats:
        return np.full(3, np.nan)


def test_strategy_that_returns_invalid_impulses_is_named(asteroid: Scenario) -> None:
    with pytest.raises(
        ValueError, match=r"Broken must return finite impulses \(m/s\) of the shape \(1, 2\)"
    ):
        simulate(asteroid, 2, strategy=Broken())


def test_a_miss_beyond_the_nominal_range_is_divergence(asteroid: Scenario) -> None:
    away = StateBox((0.0, 0.0), (5801.3e3, 5801.3e3), (90e3, 90e3), (-58e3, -58e3))
    scenario = replace(asteroid, dispersion=away, nominal_range_m=1e6)
    assert simulate(scenario, 1).outcomes == (Outcome.DIVERGED,)


@pytest.mark.thorough
@pytest.mark.parametrize("noise", [NoiseKind.RANDOM, NoiseKind.GAME])
def test_the_truth_stays_in_its_section_in_ten_thousand_engagements(
    asteroid: Scenario, noise: NoiseKind
) -> None:
    rules = list(TieRule)
    for part in range(50):
        scenario = replace(asteroid, noise=noise, tie=rules[part % len(rules)])
        results = fly_in_the_model(scenario, 200, 100 + part)
        assert results.truth_margin_m.min() >= 0.0
        assert Outcome.SET_EMPTY not in results.outcomes
