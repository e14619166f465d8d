"""The search for the worst engagement: what it finds is real, flies again bit by bit, and is far
from the average.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from infoset import RateSensor
from infoset.guidance import GameNoise, NoiseKind, Situation, TieRule
from infoset.guidance.scripted_noise import ScriptedNoise
from infoset.sim import Outcome, Scenario
from infoset.sim.adversary import NothingCountsError, Objective, WorstEngagement, find_worst
from infoset.sim.adversary_plans import Constructions
from infoset.sim.closed_form import worst_shift_m
from infoset.sim.draws import draw
from infoset.sim.engagement import Engagements
from infoset.sim.scenario import corners, of_model
from tests.guaranteed import guaranteed

BUDGET = 40


@pytest.fixture(scope="module")
def coarse(asteroid: Scenario) -> Scenario:
    """The paper's engagement with few sections: quick to fly."""
    return replace(asteroid, **of_model(replace(asteroid.set_model, sections=9)))


@pytest.fixture(scope="module")
def worst(coarse: Scenario) -> WorstEngagement:
    return find_worst(coarse, budget=BUDGET, seed=1)


def assert_flies_again(found: WorstEngagement) -> None:
    """Alone with everything kept, and in other company, to the last bit."""
    assert float(found.record().result.miss_m[0]) == found.miss_m
    company = 3
    noise = ScriptedNoise(
        {name: np.repeat(each, company, axis=-2) for name, each in found.noise.errors.items()}
    )
    given = found.accelerations_m_s2
    target = None if given is None else np.repeat(given, company, axis=1)
    draws = draw(found.scenario, [0] * company, found.seed)
    flight = Engagements(found.scenario, draws, noise=noise, target_m_s2=target)
    while flight.flying:
        flight.advance()
    results = flight.results(np.arange(company))
    assert results.miss_m.tolist() == [found.miss_m] * company
    assert flight.any_state_miss_m(results).tolist() == [found.any_state_miss_m] * company


def assert_possible(found: WorstEngagement, scenario: Scenario) -> None:
    """Its start lies in B x D, its errors within their bounds."""
    lower, upper = corners(scenario.set_model.bounds)
    start = np.array([*found.start().values()])
    assert (lower <= start).all()
    assert (start <= upper).all()
    assert (
        corners(found.scenario.dispersion)[0].tolist()
        == corners(found.scenario.dispersion)[1].tolist()
    )
    assert corners(found.scenario.dispersion)[0].tolist() == start.tolist()
    for errors in found.noise.errors.values():
        assert np.abs(errors).max() <= 1.0
    if found.accelerations_m_s2 is None:
        assert not found.max_acceleration_m_s2
        assert not scenario.set_model.is_guaranteed
    else:
        maximum = [
            scenario.set_model.axis(axis).disturbance_m_s2 for axis in scenario.set_model.axes
        ]
        assert [*found.max_acceleration_m_s2.values()] == maximum
        assert (np.abs(found.accelerations_m_s2) == np.array(maximum)[:, None, None]).all()


def test_worst_engagement_is_possible_and_repeatable(
    worst: WorstEngagement, coarse: Scenario
) -> None:
    assert_possible(worst, coarse)
    assert_flies_again(worst)
    assert np.abs(worst.noise.errors["angle"]).max() == 1.0
    assert list(worst.noise.errors) == ["angle"]
    assert worst.record().noise_name == "worst-found"


def test_measurements_of_the_worst_lie_within_the_bounds_of_the_truth(
    worst: WorstEngagement,
) -> None:
    record = worst.record()
    sensor = worst.scenario.set_model.angle_sensor
    assert record.steps > 150
    errors = np.abs(record.measured["angle"] - record.true_angle_rad)[record.measures("angle"), 0]
    assert (
        errors <= sensor.error_bound(record.true_range_m[record.measures("angle")]) * (1.0 + 1e-12)
    ).all()


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["ranging", "comet"])
def test_worst_engagement_with_all_sensors_is_possible(
    name: str, request: pytest.FixtureRequest
) -> None:
    given = guaranteed(request.getfixturevalue(name))
    scenario = replace(
        given,
        rate_sensor=RateSensor(3.0 * given.set_model.step_s, 1e-5),
        **of_model(replace(given.set_model, sections=9, fewest_sections=3)),
    )
    found = find_worst(scenario, budget=24, seed=2)
    assert found.sets_emptied == 0
    assert found.value_m == find_worst(scenario, budget=24, seed=2, keep_set=True).value_m
    assert_possible(found, scenario)
    assert_flies_again(found)
    assert found.noise.errors["range"].any()
    assert found.noise.errors["rate"].any()
    assert found.result.truth_kept[0]


def test_search_reports_its_evaluations_and_history(worst: WorstEngagement) -> None:
    assert worst.evaluations == BUDGET
    evaluations, misses = np.array(worst.history).T
    assert (np.diff(evaluations) > 0).all()
    assert (np.diff(misses) > 0.0).all()
    assert evaluations[-1] <= BUDGET
    assert misses[-1] == worst.value_m == worst.any_state_miss_m
    assert worst.strategy == "symmetric-miss"
    assert 0 < worst.sets_emptied < BUDGET


def test_search_against_a_set_with_wrong_images_finds_no_state_beyond_phi(
    coarse: Scenario,
) -> None:
    model = replace(guaranteed(coarse).set_model, wrong_images=1)
    scenario = replace(coarse, **of_model(model))

    found = find_worst(scenario, budget=20, seed=1)

    assert_possible(found, scenario)
    assert_flies_again(found)
    guaranteed_m = found.record().result.guaranteed_miss_m
    assert found.miss_m <= found.any_state_miss_m <= guaranteed_m[0]


@pytest.mark.thorough
def test_search_with_the_same_seed_is_the_same_for_any_threads(
    worst: WorstEngagement, coarse: Scenario
) -> None:
    again = find_worst(coarse, budget=BUDGET, seed=1, threads=2)
    assert (again.miss_m, again.history) == (worst.miss_m, worst.history)
    assert np.array_equal(again.noise.errors["angle"], worst.noise.errors["angle"])
    assert again.start() == worst.start()
    other = find_worst(coarse, budget=4, seed=2)
    assert other.history[0] != worst.history[0]


def test_engagements_that_lose_their_set_can_be_left_out(coarse: Scenario) -> None:
    """A set that believes in 58 km/s, and truths that come at 110: it is always lost."""
    fast = replace(coarse.set_model.bounds, vx_m_s=(-110.1e3, -110e3))
    wrong = replace(coarse, **of_model(replace(coarse.set_model, bounds=fast)))
    found = find_worst(wrong, budget=10)
    assert (found.result.outcomes[0], found.sets_emptied) == (Outcome.SET_EMPTY, 10)
    with pytest.raises(
        NothingCountsError, match="in every simulated engagement the set became empty"
    ):
        find_worst(wrong, budget=10, keep_set=True)


def test_search_accepts_a_strategy_object(coarse: Scenario) -> None:
    class Idle:
        def start(self, shape: tuple[int, int]) -> None:
            return None

        def decide(self, situation: Situation, state: None) -> np.ndarray:
            return np.zeros((1, situation.information.batch))

    found = find_worst(coarse, strategy=Idle(), budget=BUDGET, objective=Objective.FIXED_TRUTH)
    assert found.strategy == "Idle"
    assert found.miss_m > 5e3
    record = found.record(Idle())
    assert float(record.result.miss_m[0]) == found.miss_m
    assert float(record.result.impulse_m_s[0]) == 0.0


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [0])
def test_symmetric_miss_in_the_guaranteed_model_misses_by_50_m(
    asteroid: Scenario, seed: int
) -> None:
    scenario = guaranteed(asteroid)
    found = find_worst(scenario, budget=2500, seed=seed, threads=2)
    assert found.result.outcomes[0] is Outcome.ARRIVED
    assert found.result.truth_kept[0]
    assert found.value_m >= 50.0
    guaranteed_miss = found.record().result.guaranteed_miss_m
    assert not np.ma.getmaskarray(guaranteed_miss)[0]
    assert found.miss_m <= found.value_m <= guaranteed_miss.data[0]
    assert_possible(found, scenario)
    assert_flies_again(found)


def test_with_a_cut_off_the_search_begins_with_game_noise_and_its_shift(coarse: Scenario) -> None:
    late = replace(guaranteed(coarse), thruster=replace(coarse.thruster, last_impulse_s=30.0))
    first = find_worst(late, budget=1, seed=2)
    game = replace(first.scenario, noise=NoiseKind.GAME, tie=TieRule.UPPER)
    assert first.construction == "game noise, tie upper"
    assert first.accelerations_m_s2 is not None
    side = np.sign(first.accelerations_m_s2[:, :, 0])
    assert (first.accelerations_m_s2 == 0.005 * side.item()).all()

    def miss_m(noise: GameNoise) -> float:
        flight = Engagements(
            game, draw(game, [0], 0), noise=noise, target_m_s2=first.accelerations_m_s2
        )
        while flight.flying:
            flight.advance()
        return float(flight.results(np.arange(1)).miss_m[0])

    shifted = GameNoise(TieRule.UPPER, np.ones((1, 1, 1)), worst_shift_m(game), side)
    assert first.miss_m == pytest.approx(miss_m(shifted), rel=1e-9)
    assert first.miss_m > 1.05 * miss_m(GameNoise(TieRule.UPPER, np.ones((1, 1, 1))))


def test_side_of_the_true_state_is_zero_without_a_shift() -> None:
    """Formerly a target that moves against the guidance took this side, although no angle was
    shifted.
    """
    plans = Constructions(np.ones((2, 1, 3)), np.array([False, False]), np.array([1.0, -1.0]))
    shift_m = np.array([5.0])

    assert plans.noise(None, None).truth_side.tolist() == [0.0, 0.0]
    assert plans.noise(shift_m, None).truth_side.tolist() == [1.0, -1.0]
    assert plans.noise(None, np.array([[1.0, 1.0]])).truth_side.tolist() == [[0.0, 0.0]]
