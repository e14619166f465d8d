"""Statistics of samples: distribution, quantiles, and distribution-free confidence intervals."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from statistics import NormalDist

import numpy as np
from numpy.typing import ArrayLike

from infoset.arrays import Floats
from infoset.limits import FRACTION, real_values

COUNT_ROUNDING = 1e-9
"""Rounding error of an expected number of values: 100 values show the quantile of 0.99, although
100 (1 - 0.99) is less than 1 in floating point.
"""
SPEARMAN_VARIANCE = 1.06
"""Variance of Fisher's z of Spearman's coefficient over the variance for Pearson's (Fieller,
Hartley, Pearson).
"""


@dataclass(frozen=True)
class Distribution:
    """Empirical distribution function of a sample, with a confidence band.

    Parameters
    ----------
    values : ndarray, shape (n,)
        The sample in ascending order.
    probability : ndarray, shape (n,)
        k/n for the k-th value. Of equal values, the last one has the share of the sample at or
        below it.
    lower, upper : ndarray, shape (n,)
        Band of the distribution function at each value. The true function lies within it everywhere
        with at least the probability of the confidence.
    """

    values: Floats
    probability: Floats
    lower: Floats
    upper: Floats


def empirical_distribution(sample: ArrayLike, confidence: float = 0.95) -> Distribution:
    """Return the empirical distribution of a sample with its Dvoretzky-Kiefer-Wolfowitz band.

    Parameters
    ----------
    sample : array_like, shape (n,)
        At least one finite value.
    confidence : float
        In (0, 1).

    Raises
    ------
    TypeError
        If the sample or the confidence is not real numbers.
    ValueError
        If the sample is empty or not finite, or the confidence is not in (0, 1).

    References
    ----------
    Massart (1990), The tight constant in the Dvoretzky-Kiefer-Wolfowitz inequality.
    """
    FRACTION.need("confidence", confidence)
    values = _ordered(sample)
    half = math.sqrt(math.log(2.0 / (1.0 - confidence)) / (2.0 * values.size))
    probability = np.arange(1, values.size + 1) / values.size
    lower, upper = (np.clip(probability + shift, 0.0, 1.0) for shift in (-half, half))
    return Distribution(values, probability, lower, upper)


def _ordered(sample: ArrayLike) -> Floats:
    """Return a sample in ascending order; raise ValueError if it is empty or not finite."""
    values = np.sort(real_values("sample", sample).ravel())
    if values.size == 0 or not np.isfinite(values).all():
        raise ValueError("a sample needs at least one value, all finite")
    return values


def shows(size: int, level: float) -> bool:
    """Return whether a sample of `size` values shows the quantile of a level in [0, 1].

    At least one value must be expected beyond the quantile: size min(p, 1 - p) >= 1, so 100 values
    for 99 %. With fewer values the interpolated quantile is only the extreme of the sample. Levels
    0 and 1 are the extremes.
    """
    tail = min(level, 1.0 - level)
    return tail == 0.0 or size * tail > 1.0 - COUNT_ROUNDING


def shown_quantiles(sample: Floats, levels: Sequence[float]) -> list[float | None]:
    """Return quantiles of a sample that is not empty; None for those that it does not show.

    The levels are in [0, 1].
    """
    values = np.quantile(sample, levels).tolist()
    return [
        value if shows(len(sample), level) else None
        for level, value in zip(levels, values, strict=True)
    ]


@dataclass(frozen=True)
class QuantileEstimate:
    """A quantile of a sample with a confidence interval.

    Parameters
    ----------
    level : float
        In [0, 1].
    value : float
        Quantile of the sample.
    lower, upper : float or None
        Ends of the interval; None if the sample is too small to bound that side.
    """

    level: float
    value: float
    lower: float | None
    upper: float | None

    @property
    def width(self) -> float | None:
        """Width of the interval; None if a side is not bounded."""
        if self.lower is None or self.upper is None:
            return None
        return self.upper - self.lower


def estimate_quantiles(
    sample: ArrayLike, levels: Sequence[float], confidence: float = 0.95
) -> list[QuantileEstimate]:
    """Return quantiles of a sample, in the order of the levels, with distribution-free confidence
    intervals.

    Parameters
    ----------
    sample : array_like, shape (n,)
        At least one finite value.
    levels : sequence of float
        In [0, 1].
    confidence : float
        Minimum probability that an interval contains the true quantile, in (0, 1).

    Raises
    ------
    TypeError
        If the sample or the confidence is not real numbers.
    ValueError
        If the sample is empty or not finite, or a level or the confidence is out of its range.

    Notes
    -----
    The ends of the interval are order statistics: the number of values below the true quantile is
    binomial with n trials and the level as probability (David, Nagaraja 2003, Order Statistics,
    section 7.1). O(n log n).
    """
    FRACTION.need("confidence", confidence)
    if not all(0.0 <= level <= 1.0 for level in levels):
        raise ValueError(f"levels must lie in [0, 1]: got {levels}")
    values = _ordered(sample)
    intervals: list[tuple[float | None, float | None]] = []
    for level in levels:
        lower, upper = order_statistics(values.size, level, confidence)
        lower_end = float(values[lower - 1]) if lower >= 1 else None
        upper_end = float(values[upper - 1]) if upper <= values.size else None
        intervals.append((lower_end, upper_end))

    # overwrite_input saves a second copy of a million values, and changes their order.
    quantiles = np.quantile(values, levels, overwrite_input=True)
    return [
        QuantileEstimate(level, float(quantile), *interval)
        for level, quantile, interval in zip(levels, quantiles, intervals, strict=True)
    ]


@functools.lru_cache(maxsize=1024)
def order_statistics(size: int, level: float, confidence: float) -> tuple[int, int]:
    """Return the ranks, from 1, of the two values of a sample that enclose the quantile of a level.

    They enclose the true quantile with at least the probability `confidence`. A rank below 1 or
    above `size` means that no value bounds that side.
    """
    from scipy.stats import binom  # slow to load, and few commands need it

    # Let K values be below the quantile: the value of rank r is not below it if K < r. P(K < r) is
    # at most the tail for the lower rank, and at least one minus the tail for the upper one.
    tail = 0.5 * (1.0 - confidence)
    return int(binom.ppf(tail, size, level)), int(binom.ppf(1.0 - tail, size, level)) + 1


@dataclass(frozen=True)
class HitEstimate:
    """The probability of a hit, estimated from a number of runs.

    Parameters
    ----------
    runs, hits : int
        Number of runs, and number of hits among them.
    probability : float
        Share of the runs that hit.
    lower, upper : float
        Ends of the Clopper-Pearson interval, in [0, 1].
    """

    runs: int
    hits: int
    probability: float
    lower: float
    upper: float


def estimate_hits(hits: int, runs: int, confidence: float = 0.95) -> HitEstimate:
    """Return the share of hits with its Clopper-Pearson interval.

    If the true probability is less than `lower`, the probability of at least this number of hits is
    less than (1 - confidence) / 2. If it is greater than `upper`, the same holds for at most this
    number of hits. For each fixed number of runs, the interval therefore contains the true
    probability with at least this confidence.

    Raises
    ------
    ValueError
        If `runs` is not at least 1, `hits` is not in [0, runs], or the confidence is not between 0
        and 1.

    References
    ----------
    Clopper, Pearson (1934), The use of confidence or fiducial limits illustrated in the case of the
    binomial.
    """
    from scipy.stats import beta  # slow to load, and few commands need it

    FRACTION.need("confidence", confidence)
    if runs < 1 or not 0 <= hits <= runs:
        raise ValueError(f"hits must be from 0 to runs, and runs at least 1: got {hits} of {runs}")
    tail = 0.5 * (1.0 - confidence)
    lower = float(beta.ppf(tail, hits, runs - hits + 1)) if hits else 0.0
    upper = float(beta.ppf(1.0 - tail, hits + 1, runs - hits)) if hits < runs else 1.0
    return HitEstimate(runs, hits, hits / runs, lower, upper)


def average_ranks(values: Floats) -> Floats:
    """Return the ranks of finite values, from 1; equal values have the mean of their ranks.

    The ranks are exact. This takes half the time of `pandas.Series.rank`, which uses no vector
    instructions.
    """
    order = np.argsort(values)
    ordered = values[order]
    is_first = np.ones(values.size, dtype=bool)
    np.not_equal(ordered[1:], ordered[:-1], out=is_first[1:])
    firsts = np.flatnonzero(is_first)
    counts = np.diff(firsts, append=values.size)

    ranks = np.empty(values.size)
    ranks[order] = np.repeat(firsts + 0.5 * (counts + 1), counts)
    return ranks


def correlation_interval(
    correlation: float, size: int, confidence: float = 0.95, *, ranks: bool = False
) -> tuple[float, float]:
    """Return the confidence interval of a correlation coefficient by Fisher's z.

    It is NaN with fewer than 4 values. The interval is approximate, and assumes two normal
    variables. `ranks` is for Spearman's coefficient.

    References
    ----------
    Fieller, Hartley, Pearson (1957), Tests for rank correlation coefficients I.
    """
    if size < 4:
        return math.nan, math.nan
    variance = (SPEARMAN_VARIANCE if ranks else 1.0) / (size - 3)
    half = NormalDist().inv_cdf(0.5 + 0.5 * confidence) * math.sqrt(variance)
    with np.errstate(divide="ignore"):  # the interval of 1 is the point 1
        # A coefficient may exceed 1 by rounding.
        z = np.arctanh(np.clip(correlation, -1.0, 1.0))
    return float(np.tanh(z - half)), float(np.tanh(z + half))


def number_text(number: float) -> str:
    """Return the shortest text from which exactly the same number is read."""
    return repr(float(number)).removesuffix(".0")


def level_name(level: float) -> str:
    """Return a level as a name, without rounding: p99 of 0.99, p99.9 of 0.999."""
    percent = Decimal(number_text(level)).scaleb(2) + 0  # the sum has no exponent above zero
    return f"p{percent}".lower()
