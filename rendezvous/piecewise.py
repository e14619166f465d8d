"""Smooth functions of time as polynomials on panels that are refined until the functions are resolved."""

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
    """Return the zeros of the Chebyshev polynomial of degree `count`, on [-1, 1]."""
    return np.asarray(np.cos(np.pi * (np.arange(count) + 0.5) / count))


def chebyshev_fit(count: int) -> Floats:
    """Return the matrix that turns values at `chebyshev_points(count)` into Chebyshev coefficients."""
    matrix = (2.0 / count) * chebyshev.chebvander(chebyshev_points(count), count - 1).T
    matrix[0] *= 0.5
    return np.asarray(matrix)


def chebyshev_halves(count: int) -> list[Floats]:
    """Return the matrices that turn `count` Chebyshev coefficients on an interval into those on its two halves."""
    points = chebyshev_points(count)
    return [chebyshev_fit(count) @ chebyshev.chebvander(0.5 * points + middle, count - 1) for middle in (-0.5, 0.5)]


_POINTS, _FIT = chebyshev_points(NODES), chebyshev_fit(NODES)


@dataclass(frozen=True, eq=False)
class Piecewise:
    """Functions of time, each a polynomial of degree 11 on each of P panels, which are in no order.

    The `coefficients`, shape (P, 12, m), are those of Chebyshev polynomials of the position in the panel, -1 to 1.
    """

    starts_s: Floats
    ends_s: Floats
    coefficients: Floats


def resolve(function: Callable[[Floats], Floats], breaks_s: Floats) -> Piecewise:
    """Represent m functions of time, of similar magnitude, by polynomials on panels.

    `function` returns values, shape (k, m), at k times, s. `breaks_s`, not decreasing, are the ends of the initial
    panels; the functions may jump there and are not evaluated there.

    Raises
    ------
    ValueError
        If a value is not finite, or no break is later than another.

    Notes
    -----
    A panel is halved until the last two Chebyshev coefficients are below 1e-11 of the greatest value on all panels, or
    below 1e-7 of it and no longer decreasing (rounding), or below the effect of the rounding of times. Sinusoids on
    panels of one radian have an error below 1e-13 at once: the remainder of the interpolation is at most (1/2)^12 /
    (2^11 12!) = 2.5e-16 of their amplitude.
    """
    starts, ends = breaks_s[:-1], breaks_s[1:]
    starts, ends = starts[ends > starts], ends[ends > starts]
    latest = float(np.abs(breaks_s).max())
    before, scale = np.full(len(starts), np.inf), 0.0
    pieces: list[tuple[Floats, Floats, Floats]] = []
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
        pieces.append((starts[resolved], ends[resolved], coefficients[resolved]))
        starts, ends, before = starts[~resolved], ends[~resolved], tails[~resolved]
        middles = 0.5 * (starts + ends)
        starts, ends = np.concatenate([starts, middles]), np.concatenate([middles, ends])
        before = np.tile(before, 2)
    return Piecewise(*(np.concatenate(part) for part in zip(*pieces, strict=True)))


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
