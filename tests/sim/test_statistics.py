from __future__ import annotations

import math
from fractions import Fraction
from math import comb

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from infoset.sim import empirical_distribution, estimate_hits, estimate_quantiles
from infoset.sim.statistics import (
    average_ranks,
    order_statistics,
    shown_quantiles,
    shows,
)


def test_distribution_of_a_small_sample_has_steps_of_one_over_its_size() -> None:
    distribution = empirical_distribution([3.0, 1.0, 2.0, 2.0])
    np.testing.assert_array_equal(distribution.values, (1.0, 2.0, 2.0, 3.0))
    np.testing.assert_array_equal(distribution.probability, (0.25, 0.5, 0.75, 1.0))


def test_width_of_the_band_is_massarts_bound() -> None:
    distribution = empirical_distribution(np.arange(50.0))
    half = distribution.probability - distribution.lower
    assert half[-1] == pytest.approx(math.sqrt(math.log(40.0) / 100.0), rel=1e-12)
    assert distribution.lower.min() >= 0.0
    assert distribution.upper.max() <= 1.0


def test_order_statistics_equal_textbook_values() -> None:
    # The median of 10 values: the second and the ninth hold it with probability 1 - 22/1024 =
    # 0.9785.
    assert order_statistics(10, 0.5, 0.95) == (2, 9)
    # Of n values the maximum exceeds the 99 % quantile with probability 1 - 0.99^n: 0.975 from n =
    # 368 on.
    assert order_statistics(367, 0.99, 0.95)[1] == 368
    assert order_statistics(368, 0.99, 0.95)[1] == 368


@given(size=st.integers(1, 400), level=st.floats(0.01, 0.99), confidence=st.floats(0.5, 0.999))
@settings(deadline=None)
def test_order_statistics_are_the_narrowest_with_the_confidence(
    size: int, level: float, confidence: float
) -> None:
    lower, upper = order_statistics(size, level, confidence)
    tail = 0.5 * (1.0 - confidence)

    def at_most(count: int) -> float:
        return math.fsum(
            math.comb(size, k) * level**k * (1.0 - level) ** (size - k) for k in range(count + 1)
        )

    assert at_most(lower - 1) <= tail + 1e-9
    assert at_most(lower) >= tail - 1e-9
    assert 1.0 - at_most(upper - 1) <= tail + 1e-9
    assert 1.0 - at_most(upper - 2) >= tail - 1e-9


def test_quantiles_of_a_small_sample_have_open_ends() -> None:
    median, high = estimate_quantiles([3.0, 1.0, 2.0], [0.5, 0.99])
    assert (median.value, median.lower, median.upper, median.width) == (2.0, None, None, None)
    assert (high.upper, high.width) == (None, None)
    assert high.value == np.quantile([3.0, 1.0, 2.0], 0.99)
    minimum, maximum = estimate_quantiles(np.arange(100.0), [0.0, 1.0])
    assert (minimum.value, minimum.lower, minimum.upper) == (0.0, None, 0.0)
    assert (maximum.value, maximum.lower, maximum.upper) == (99.0, 99.0, None)


def tail(runs: int, hits: range, probability: float) -> float:
    """Probability of a number of hits in a range, summed exactly."""
    p = Fraction(probability)
    return float(sum(math.comb(runs, k) * p**k * (1 - p) ** (runs - k) for k in hits))


@pytest.mark.parametrize(
    ("hits", "runs"), [(1, 1), (1, 2), (19, 20), (48, 50), (50, 50), (0, 7), (3, 160), (187, 200)]
)
@pytest.mark.parametrize("confidence", [0.8, 0.95, 0.999])
def test_the_interval_of_hits_ends_where_the_binomial_tails_are_half_the_rest(
    hits: int, runs: int, confidence: float
) -> None:
    found = estimate_hits(hits, runs, confidence)
    half = 0.5 * (1.0 - confidence)
    assert (found.runs, found.hits, found.probability) == (runs, hits, hits / runs)
    assert 0.0 <= found.lower <= found.probability <= found.upper <= 1.0
    if hits:
        assert tail(runs, range(hits, runs + 1), found.lower) == pytest.approx(half, rel=1e-9)
    else:
        assert found.lower == 0.0
    if hits < runs:
        assert tail(runs, range(hits + 1), found.upper) == pytest.approx(half, rel=1e-9)
    else:
        assert found.upper == 1.0


@pytest.mark.parametrize(
    ("level", "fewest"), [(0.5, 2), (0.1, 10), (0.9, 10), (0.99, 100), (0.999, 1000), (1.0, 1)]
)
def test_a_quantile_needs_values_beyond_it(level: float, fewest: int) -> None:
    assert shows(fewest, level)
    assert shows(10 * fewest, level)
    assert fewest == 1 or not shows(fewest - 1, level)
    sample = np.arange(float(fewest))
    assert shown_quantiles(sample, [level]) == [np.quantile(sample, level)]
    assert shown_quantiles(np.arange(1.0), [0.99, 1.0]) == [None, 0.0]


def probability_of_at_most(misses: int, runs: int, share: Fraction) -> Fraction:
    """Return the probability of at most so many misses in some runs; `share` is the probability of
    a hit.
    """
    return sum(
        (
            comb(runs, miss) * (1 - share) ** miss * share ** (runs - miss)
            for miss in range(misses + 1)
        ),
        Fraction(0),
    )


@given(
    values=st.lists(
        st.sampled_from([-2.5, -0.0, 0.0, 1.0, math.nextafter(1.0, 2.0), 7.0, 1e300]), max_size=40
    )
)
def test_average_ranks_equal_their_definition(values: list[float]) -> None:
    expected = [
        sum(other < value for other in values) + 0.5 * (sum(other == value for other in values) + 1)
        for value in values
    ]
    assert average_ranks(np.array(values)).tolist() == expected
