"""Statistics of samples: empirical distribution, quantiles and a confidence band that assumes nothing."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Distribution:
    """Empirical distribution function of a sample, with a band that holds the true one with given confidence.

    Parameters
    ----------
    values : ndarray, shape (n,)
        The sample in rising order.
    probability : ndarray, shape (n,)
        Share of the sample not above each value.
    lower, upper : ndarray, shape (n,)
        Band of the distribution function at each value, simultaneous over all of them.
    confidence : float
        Probability that the band holds the true distribution function everywhere.
    """

    values: Floats
    probability: Floats
    lower: Floats
    upper: Floats
    confidence: float


def empirical_distribution(sample: ArrayLike, confidence: float = 0.95) -> Distribution:
    """Empirical distribution with the Dvoretzky-Kiefer-Wolfowitz band.

    Parameters
    ----------
    sample : array_like, shape (n,)
        At least one finite value.
    confidence : float
        In (0, 1).

    Returns
    -------
    Distribution

    Raises
    ------
    ValueError
        If the sample is empty or not finite, or the confidence is not in (0, 1).

    References
    ----------
    Massart (1990), The tight constant in the Dvoretzky-Kiefer-Wolfowitz inequality.
    """
    values = np.sort(np.asarray(sample, dtype=np.float64).ravel())
    if values.size == 0 or not np.isfinite(values).all():
        raise ValueError("a distribution needs at least one value, all finite")
    half = band_half_width(values.size, confidence)
    probability = np.arange(1, values.size + 1) / values.size
    return Distribution(
        values,
        probability,
        np.clip(probability - half, 0.0, 1.0),
        np.clip(probability + half, 0.0, 1.0),
        confidence,
    )


def band_half_width(size: int, confidence: float) -> float:
    """Half-width of the Dvoretzky-Kiefer-Wolfowitz band of a sample of a size: sqrt(ln(2 / (1 - c)) / (2 n))."""
    if not 0.0 < confidence < 1.0:
        raise ValueError(f"confidence must lie between 0 and 1: got {confidence}")
    return math.sqrt(math.log(2.0 / (1.0 - confidence)) / (2.0 * size))


def quantiles(sample: ArrayLike, levels: ArrayLike) -> Floats:
    """Quantiles of a sample, linearly interpolated between order statistics.

    Parameters
    ----------
    sample : array_like, shape (n,)
    levels : array_like, shape (m,)
        In [0, 1].

    Returns
    -------
    ndarray, shape (m,)
    """
    return np.asarray(np.quantile(np.asarray(sample, dtype=np.float64), np.asarray(levels)), dtype=np.float64)
