"""Gaussian measurement errors, truncated at their bound: independent, or correlated in time."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.special import ndtr, ndtri

from infoset.arrays import Floats
from infoset.guidance.scripted_noise import RandomNoise

_SMALLEST = 2.0**-54
"""Minimum probability of a tail. Random numbers in [0, 1) are multiples of 2^-53, so that only a
tail of zero, whose quantile is infinite, is below this.
"""


def share_cut(sigma: float) -> float:
    """Return the share of a Gaussian outside the bound; `sigma` is in units of the bound."""
    return float(2.0 * ndtr(-1.0 / sigma))


def truncated_gaussian(uniform: Floats, sigma: float) -> Floats:
    """Return numbers of a Gaussian of standard deviation `sigma`, truncated to [-1, 1].

    They are the quantiles of numbers that are uniform in [-1, 1]. The negative number has the
    negative quantile.
    """
    size = np.abs(uniform)
    # The probability of a larger error of this sign, without the truncation.
    tail = 0.5 * (1.0 - size) + size * ndtr(-1.0 / sigma)
    # Rounding may exceed the bound.
    error = np.minimum(-sigma * ndtri(tail), 1.0)
    return np.asarray(np.copysign(error, uniform))


def correlated_uniform(uniform: Floats, correlation: float) -> Floats:
    """Return numbers that are uniform in [-1, 1] and correlated in time, from independent ones.

    Parameters
    ----------
    uniform : ndarray, shape (..., steps)
        Independent numbers, uniform in [-1, 1].
    correlation : float
        Correlation of the underlying process between two steps, exp(-step / time constant).

    Notes
    -----
    The underlying process is a Gauss-Markov process: x_0 = w_0 and x_k = c x_(k-1) + sqrt(1 -
    c^2) w_k for the correlation c and independent standard Gaussian w_k. It is stationary, and its
    autocorrelation after k steps is c^k.
    """
    process = _quantile(uniform)
    process[..., 1:] *= np.sqrt(1.0 - correlation**2)
    for step in range(1, process.shape[-1]):
        process[..., step] += correlation * process[..., step - 1]
    return np.asarray(np.copysign(1.0 - 2.0 * ndtr(-np.abs(process)), process))


def _quantile(uniform: Floats) -> Floats:
    """Return standard Gaussian numbers, the quantiles of numbers that are uniform in [-1, 1]."""
    tail = np.maximum(0.5 * (1.0 - np.abs(uniform)), _SMALLEST)
    return np.asarray(np.copysign(ndtri(tail), uniform))


def gaussian_noise(
    uniform: Mapping[str, Floats],
    bias: Floats | None,
    sigma: float,
    correlation: float = 0.0,
    drift: Floats | None = None,
) -> RandomNoise:
    """Return a noise with truncated Gaussian errors.

    Parameters
    ----------
    uniform : mapping of str to ndarray, shape (C, B, steps), for ranges (B, steps)
        Independent numbers by sensor, uniform in [-1, 1].
    bias : ndarray, shape (C, B), or None
        The same for the constant errors of a camera's centroid (`RandomNoise`).
    sigma : float
        Standard deviation before the truncation, in units of the bound.
    correlation : float
        As in `correlated_uniform`, for errors that are correlated in time; 0 is independent errors.
    drift : ndarray, shape (C, B, steps), or None
        The same for the drift of a camera's attitude, correlated in time (`RandomNoise`).
    """
    errors = {}
    for name, independent in uniform.items():
        numbers = correlated_uniform(independent, correlation) if correlation else independent
        errors[name] = truncated_gaussian(numbers, sigma)
    bias_errors = None if bias is None else truncated_gaussian(bias, sigma)
    drift_errors = None if drift is None else truncated_gaussian(drift, sigma)
    return RandomNoise(errors, bias_errors, drift_errors)
