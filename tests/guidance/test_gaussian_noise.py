"""Truncated Gaussian errors against scipy's distribution, and their correlation against that of the
process.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from infoset.guidance import NoiseKind, RandomNoise, TieRule
from infoset.guidance.gaussian_noise import (
    correlated_uniform,
    gaussian_noise,
    share_cut,
    truncated_gaussian,
)
from infoset.guidance.noise_registry import NoiseBatch, make_noise

SIGMAS = [0.05, 1.0 / 3.0, 1.0, 5.0]


def uniform(*shape: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-1.0, 1.0, shape)


@pytest.mark.parametrize("sigma", SIGMAS)
def test_the_errors_are_quantiles_of_the_truncated_gaussian(sigma: float) -> None:
    known = stats.truncnorm(-1.0 / sigma, 1.0 / sigma, scale=sigma)
    numbers = uniform(2000)
    np.testing.assert_allclose(
        truncated_gaussian(numbers, sigma), known.ppf(0.5 * (numbers + 1.0)), atol=1e-9 * sigma
    )
    assert stats.kstest(truncated_gaussian(uniform(20_000, seed=1), sigma), known.cdf).pvalue > 1e-3
    assert share_cut(sigma) == pytest.approx(
        stats.norm.cdf(-1.0 / sigma) + stats.norm.sf(1.0 / sigma), rel=1e-12
    )


@given(st.floats(-1.0, 1.0), st.floats(0.01, 10.0))
def test_an_error_is_within_its_bound_and_has_the_sign_of_its_number(
    number: float, sigma: float
) -> None:
    error, mirrored = truncated_gaussian(np.array([number, -number]), sigma)
    assert abs(error) <= 1.0
    assert error == -mirrored
    assert error * number >= 0.0


@pytest.mark.parametrize("end", [-1.0, 1.0])
def test_numbers_at_the_ends_stay_finite_and_within_the_bound(end: float) -> None:
    numbers = np.array([end, *[0.5] * 50])
    assert np.abs(correlated_uniform(numbers, 0.9)).max() <= 1.0
    for sigma in SIGMAS:
        assert truncated_gaussian(numbers, sigma)[0] == pytest.approx(end, abs=1e-12)
        assert np.abs(truncated_gaussian(correlated_uniform(numbers, 0.99), sigma)).max() <= 1.0


@pytest.mark.parametrize("steps_of_a_time_constant", [2.0, 20.0])
def test_the_underlying_process_has_an_exponential_autocorrelation(
    steps_of_a_time_constant: float,
) -> None:
    runs, steps = 4000, 61
    found = correlated_uniform(uniform(runs, steps), float(np.exp(-1.0 / steps_of_a_time_constant)))
    process = stats.norm.ppf(0.5 * (found + 1.0))
    for step in (
        0,
        30,
        60,
    ):  # stationary: standard Gaussian at every step, so that the errors are truncated Gaussian
        assert stats.kstest(process[:, step], stats.norm.cdf).pvalue > 1e-3
    for lag in (1, 3, 10, 40):
        wanted = np.exp(-lag / steps_of_a_time_constant)
        found_at = np.corrcoef(process[:, 20], process[:, 20 + lag])[0, 1]
        assert abs(np.arctanh(found_at) - np.arctanh(wanted)) < 4.0 / np.sqrt(
            runs - 3
        )  # Fisher's interval


def test_a_noise_has_the_errors_of_every_sensor_and_of_the_centroid() -> None:
    numbers = {"angle": uniform(2, 3, 40), "range": uniform(3, 40, seed=1)}
    bias = uniform(2, 3, seed=2)
    noise = gaussian_noise(numbers, bias, 0.5, 0.8)
    for name, each in numbers.items():
        assert np.array_equal(
            noise.errors[name], truncated_gaussian(correlated_uniform(each, 0.8), 0.5)
        )
        alone = correlated_uniform(
            each[..., :1, :], 0.8
        )  # an engagement does not depend on its batch
        assert np.array_equal(correlated_uniform(each, 0.8)[..., :1, :], alone)
    assert noise.bias is not None
    assert np.array_equal(noise.bias, truncated_gaussian(bias, 0.5))
    assert gaussian_noise(numbers, None, 0.5).bias is None


def test_correlation_of_a_step_is_that_of_the_steps_of_the_flight() -> None:
    """A step of 50 s is fitted to 40 s, so that the times before the arrival are exact."""

    class Settings(NamedTuple):
        fitted_step_s: float = 40.0
        step_s: float = 50.0
        tie: TieRule = TieRule.UPPER
        noise_sigma: float = 0.5
        correlation_time_s: float = 100.0

    independent = np.random.default_rng(0).uniform(-1.0, 1.0, (1, 2, 30))
    batch = NoiseBatch({"angle": independent}, None, None, independent, lambda: None, lambda: None)

    made = make_noise(NoiseKind.CORRELATED, Settings(), batch)
    expected = gaussian_noise({"angle": independent}, None, 0.5, math.exp(-40.0 / 100.0))

    assert isinstance(made, RandomNoise)
    assert isinstance(expected, RandomNoise)
    np.testing.assert_array_equal(made.errors["angle"], expected.errors["angle"])
