"""Distributions of the 1997 experiment: bands set from an independent implementation, not from this
one.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from infoset import Recovery
from infoset.guidance import NoiseKind
from infoset.sim import Scenario, simulate
from infoset.sim.scenario import of_model

pytestmark = pytest.mark.thorough


def test_distribution_with_random_noise_agrees_with_the_paper(asteroid: Scenario) -> None:
    results = simulate(asteroid, 1000)
    assert 1.0 <= np.quantile(results.miss_m, 0.5) <= 1.4
    assert 3.2 <= np.quantile(results.miss_m, 0.9) <= 4.2
    assert 160.0 <= np.quantile(results.impulse_m_s, 0.5) <= 172.0


def test_distribution_with_game_noise_agrees_with_the_paper(asteroid: Scenario) -> None:
    results = simulate(replace(asteroid, noise=NoiseKind.GAME), 1000)
    assert 11.5 <= np.quantile(results.miss_m, 0.5) <= 14.0
    assert 12.8 <= np.quantile(results.miss_m, 0.9) <= 17.0
    assert 303.0 <= np.quantile(results.impulse_m_s, 0.5) <= 321.0


@pytest.mark.parametrize(
    ("noise", "median", "nine_in_ten", "impulse"),
    [
        (NoiseKind.RANDOM, 1.4, 3.6, 158.0),
        (NoiseKind.GAME, 11.0, 14.0, 308.0),
    ],
)
def test_distribution_with_the_range_sensor_agrees_with_the_paper(
    ranging: Scenario, noise: NoiseKind, median: float, nine_in_ten: float, impulse: float
) -> None:
    """The published procedure: a set that a measurement empties stays lost."""
    model = replace(ranging.set_model, recovery=Recovery.NONE)
    results = simulate(replace(ranging, noise=noise, **of_model(model)), 1000)
    assert np.quantile(results.miss_m, 0.5) == pytest.approx(median, rel=0.2)
    assert np.quantile(results.miss_m, 0.9) == pytest.approx(nine_in_ten, rel=0.2)
    assert np.quantile(results.impulse_m_s, 0.5) == pytest.approx(impulse, rel=0.2)


@pytest.mark.parametrize("noise", [NoiseKind.RANDOM, NoiseKind.GAME])
def test_the_number_of_sections_does_not_matter(asteroid: Scenario, noise: NoiseKind) -> None:
    def figures(sections: int) -> np.ndarray:
        model = replace(asteroid.set_model, sections=sections)
        results = simulate(replace(asteroid, noise=noise, **of_model(model)), 1000)
        return np.array(
            [
                np.quantile(results.miss_m, 0.5),
                np.quantile(results.miss_m, 0.9),
                np.quantile(results.impulse_m_s, 0.5),
            ]
        )

    few = figures(9)
    usual = figures(29)
    many = figures(101)
    np.testing.assert_allclose(few, usual, rtol=0.08)
    np.testing.assert_allclose(many, usual, rtol=0.08)
