"""Noises of scenarios and of the user: errors in a flight, batches, threads, and names."""

from __future__ import annotations

import sys
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy import stats

from infoset.guidance import NoiseKind, RandomNoise
from infoset.sim import CampaignNoise, Scenario, fly_one, simulate
from infoset.sim.draws import draw
from infoset.sim.parallel import Task, simulate_task

OF_THE_BOUND = ("gaussian", "correlated")


class Uniform:
    """The random noise of the simulator, from the random numbers of each step."""

    def measure(self, sight: Any, predicted: Any) -> Any:
        return {
            name: sensor.measured(sight, sight.uniform[name])
            for name, sensor in sight.sensors.items()
        }


class Drift:
    """Errors that grow with the time since the start: an object serves one batch only."""

    def __init__(self) -> None:
        self.steps = 0

    def measure(self, sight: Any, predicted: Any) -> Any:
        assert sight.step == self.steps
        assert sight.time_s == pytest.approx(0.5 * sight.step)
        self.steps += 1
        return {name: sensor.measured(sight, np.full(sight.shape(sensor), 0.05 * sight.time_s))
                for name, sensor in sight.sensors.items()}  # fmt: skip


def test_gaussian_errors_of_a_flight_are_quantiles_of_the_draws_of_its_run(brief: Scenario) -> None:
    scenario = replace(brief, noise=NoiseKind.GAUSSIAN, noise_sigma=0.4)
    record = fly_one(scenario, 3, seed=5)
    seen = record.measures("angle")
    bound = np.asarray(brief.bearing_sensor.error_bound(record.true_range_m[seen]))
    errors = (record.measured["angle"][seen, 0] - record.true_angle_rad[seen, 0]) / bound
    numbers = draw(scenario, [3], 5).errors["angle"][0, 0][: record.steps][seen]
    wanted = stats.truncnorm(-2.5, 2.5, scale=0.4).ppf(0.5 * (numbers + 1.0))
    np.testing.assert_allclose(errors, wanted, atol=1e-6)


@pytest.mark.parametrize("noise", OF_THE_BOUND)
def test_a_run_is_the_same_in_every_batch(noise: str, brief: Scenario) -> None:
    together = simulate(brief, [2, 7, 4], seed=3, noise=noise)
    alone = simulate(brief, [7], seed=3, noise=noise)
    assert (alone.miss_m[0], alone.unguided_miss_m[0]) == (
        together.miss_m[1],
        together.unguided_miss_m[1],
    )
    assert fly_one(brief, 7, seed=3, noise=noise).result.miss_m[0] == together.miss_m[1]
    assert (together.miss_m != simulate(brief, [2, 7, 4], seed=3, noise="random").miss_m).all()


def test_wide_gaussian_errors_are_uniform_and_briefly_correlated_ones_independent(
    brief: Scenario,
) -> None:
    wide = replace(brief, noise_sigma=10.0)
    for noise in OF_THE_BOUND:
        flown = replace(wide, noise=NoiseKind(noise), noise_correlation_s=1e-3)
        np.testing.assert_allclose(
            simulate(flown, 20).miss_m, simulate(wide, 20).miss_m, rtol=0.02, atol=0.02
        )


def test_a_noise_of_the_user_is_made_for_each_batch(
    brief: Scenario, monkeypatch: pytest.MonkeyPatch
) -> None:
    expected = simulate(brief, 6, seed=1)
    monkeypatch.setattr(sys.modules["infoset.sim.simulate"], "ENGAGEMENTS_AT_ONCE", 2)
    for own in (Uniform, Uniform()):
        assert np.array_equal(simulate(brief, 6, seed=1, noise=own).miss_m, expected.miss_m)
    assert simulate(brief, 6, noise=Drift).miss_m.shape == (6,)
    assert fly_one(brief, noise=Drift).noise_name == "Drift"
    task = Task(brief, range(6), 1, Uniform)
    assert np.array_equal(simulate_task(task).miss_m, expected.miss_m)


def test_noise_without_the_method_measure_is_refused(brief: Scenario) -> None:
    with pytest.raises(
        ValueError,
        match="no noise is called 'gauss'; there are: random, gaussian, correlated, game",
    ):
        simulate(brief, 1, noise="gauss")
    with pytest.raises(TypeError, match="must have the method measure"):
        simulate(brief, 1, noise=0.5)  # type: ignore[arg-type]
    scripted = RandomNoise({"angle": np.zeros((1, 1, 100))})
    with pytest.raises(ValueError, match=r"must have the shape \(1, 2, 100\)"):
        simulate(brief, 2, noise=scripted)


def test_campaign_noises_have_the_names_of_noise_kinds() -> None:
    assert {kind.value for kind in NoiseKind} == {kind.value for kind in CampaignNoise} - {
        "mixed",
        "own",
    }
