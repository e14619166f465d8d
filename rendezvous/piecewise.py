"""Smooth functions of time as polynomials on panels, as fine as the functions need."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

Floats = NDArray[np.float64]

NODES = 12
RESOLVED = 1e-11
ROUNDING = 1e-7
_AT_ONCE = 2048


def chebyshev_points(count: int) -> Floats:
    """Return the zeros of the Chebyshev polynomial of a degree, on [-1, 1].

    Parameters
    ----------
    count : int

    Returns
    -------
    ndarray, shape (count,)
    """
    return np.asarray(np.cos(np.pi * (np.arange(count) + 0.5) / count))


def chebyshev_fit(count: int) -> Floats:
    """Return what turns values at the zeros of a Chebyshev polynomial into Chebyshev coefficients.

    Parameters
    ----------
    count : int

    Returns
    -------
    ndarray, shape (count, count)
    """
    matrix = (2.0 / count) * chebyshev.chebvander(chebyshev_points(count), count - 1).T
    matrix[0] *= 0.5
    return np.asarray(matrix)


_POINTS, _FIT = chebyshev_points(NODES), chebyshev_fit(NODES)


@dataclass(frozen=True, eq=False)
class Piecewise:
    """Functions of time, each a polynomial of degree 11 on each panel.

    Parameters
    ----------
    starts_s, ends_s : ndarray, shape (P,)
        In no order.
    coefficients : ndarray, shape (P, 12, m)
        Of Chebyshev polynomials of the place in the panel, -1 to 1.
    """

    starts_s: Floats
    ends_s: Floats
    coefficients: Floats


def resolve(function: Callable[[Floats], Floats], breaks_s: Floats) -> Piecewise:
    """Represent functions of time on panels.

    Parameters
    ----------
    function : callable
        Values of m functions of one size, shape (k, m), at times of shape (k,), s. They may jump at breaks, where they
        are not evaluated.
    breaks_s : ndarray, shape (P + 1,)
        Ends of the panels to begin with, not decreasing, s.

    Returns
    -------
    Piecewise

    Raises
    ------
    ValueError
        If a value is not finite, or no break is later than another.

    Notes
    -----
    A panel is halved until the last two Chebyshev coefficients are below 1e-11 of the greatest value anywhere, or below
    1e-7 of it and no longer fall (that is rounding), or below what the rounding of times leaves. Sinusoids on panels of
    one radian have an error below 1e-13 at once: the remainder of the interpolation is at most
    (1/2)^12 / (2^11 12!) = 2.5e-16 of their amplitude.
    """
    starts, ends = breaks_s[:-1], breaks_s[1:]
    starts, ends = starts[ends > starts], ends[ends > starts]
    latest = float(np.abs(breaks_s).max())
    before, scale = np.full(len(starts), np.inf), 0.0
    found: list[tuple[Floats, Floats, Floats]] = []
    if not len(starts):
        raise ValueError("no break is later than another")
    while len(starts):
        coefficients = _fitted(function, starts, ends)
        sizes = np.abs(coefficients)
        scale = max(scale, float(sizes.max()))
        tails = sizes[:, -2:].max(axis=(1, 2))
        rounding = 64.0 * np.finfo(float).eps * latest / (ends - starts)
        resolved = (tails <= scale * np.maximum(RESOLVED, rounding)) | (
            (tails <= ROUNDING * scale) & (tails > 0.2 * before)
        )
        found.append((starts[resolved], ends[resolved], coefficients[resolved]))
        starts, ends, before = starts[~resolved], ends[~resolved], tails[~resolved]
        middles = 0.5 * (starts + ends)
        starts, ends = np.concatenate([starts, middles]), np.concatenate([middles, ends])
        before = np.tile(before, 2)
    return Piecewise(*(np.concatenate(each) for each in zip(*found, strict=True)))


def _fitted(function: Callable[[Floats], Floats], starts: Floats, ends: Floats) -> Floats:
    """Chebyshev coefficients on panels, shape (P, 12, m)."""
    parts = []
    for first in range(0, len(starts), _AT_ONCE):
        low, high = starts[first : first + _AT_ONCE], ends[first : first + _AT_ONCE]
        times = 0.5 * (low + high)[:, None] + 0.5 * (high - low)[:, None] * _POINTS
        values = function(times.ravel())
        if not np.isfinite(values).all():
            raise ValueError("a value is not finite; check the units")
        parts.append(_FIT @ values.reshape(len(low), NODES, -1))
    return np.concatenate(parts)
