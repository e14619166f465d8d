from __future__ import annotations

import math

import numpy as np
import pytest

from sim import band_half_width, empirical_distribution, quantiles


def test_the_distribution_of_a_small_sample_by_hand() -> None:
    distribution = empirical_distribution([3.0, 1.0, 2.0, 2.0])
    np.testing.assert_array_equal(distribution.values, (1.0, 2.0, 2.0, 3.0))
    np.testing.assert_array_equal(distribution.probability, (0.25, 0.5, 0.75, 1.0))


def test_the_band_is_massarts() -> None:
    assert band_half_width(50, 0.95) == pytest.approx(math.sqrt(math.log(40.0) / 100.0), rel=1e-12)
    distribution = empirical_distribution(np.arange(50.0))
    half = distribution.probability - distribution.lower
    assert half[-1] == pytest.approx(0.19207, abs=1e-4)
    assert distribution.lower.min() >= 0.0
    assert distribution.upper.max() <= 1.0


def test_the_band_holds_the_true_distribution_as_often_as_it_says() -> None:
    random, held = np.random.default_rng(1), 0
    for _ in range(400):
        distribution = empirical_distribution(random.uniform(size=60), confidence=0.9)
        # The true distribution function is the identity; the empirical one jumps at each value.
        below = distribution.probability - 1.0 / 60.0
        half = band_half_width(60, 0.9)
        held += bool(
            (np.abs(distribution.values - distribution.probability) <= half).all()
            and (np.abs(distribution.values - below) <= half).all()
        )
    assert held / 400 >= 0.87


def test_quantiles_interpolate() -> None:
    np.testing.assert_allclose(quantiles([1.0, 2.0, 3.0], [0.0, 0.25, 0.5, 1.0]), (1.0, 1.5, 2.0, 3.0))


@pytest.mark.parametrize("sample", [[], [math.nan], [math.inf]])
def test_no_distribution_of_nothing(sample: list[float]) -> None:
    with pytest.raises(ValueError, match="at least one value, all finite"):
        empirical_distribution(sample)
