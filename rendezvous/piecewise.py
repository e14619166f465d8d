"""Smooth functions of time as polynomials on panels, refined until resolved; maximum and integral
of a control.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.polynomial import chebyshev

from infoset.rendezvous._arrays import Floats

NODES = 12
RESOLVED = 1e-11
ROUNDING = 1e-7
_AT_ONCE = 2048
TOLERANCE = 1e-11
_MAX_HALVINGS = 40


def chebyshev_points(count: int) -> Floats:
    """Return the zeros of the Chebyshev polynomial of degree `count`, on [-1, 1]."""
    return np.asarray(np.cos(np.pi * (np.arange(count) + 0.5) / count))


def chebyshev_fit(count: int) -> Floats:
    """Return the matrix that turns values at `chebyshev_points(count)` into Chebyshev
    coefficients.
    """
    matrix = (2.0 / count) * chebyshev.chebvander(chebyshev_points(count), count - 1).T
    matrix[0] *= 0.5
    return np.asarray(matrix)


def chebyshev_halves(count: int) -> list[Floats]:
    """Return the matrices that turn `count` Chebyshev coefficients on an interval into those on its
    two halves.
    """
    points = chebyshev_points(count)
    return [
        chebyshev_fit(count) @ chebyshev.chebvander(0.5 * points + middle, count - 1)
        for middle in (-0.5, 0.5)
    ]


_POINTS = chebyshev_points(NODES)
_FIT = chebyshev_fit(NODES)
# The square of a control, a polynomial of twice the degree, at samples that bound it.
_DEGREE = 2 * (NODES - 1)
_SAMPLES = 4 * _DEGREE
_FACTOR = 1.0 / np.cos(0.5 * np.pi * _DEGREE / _SAMPLES)
_AT_SQUARES = chebyshev.chebvander(chebyshev_points(_DEGREE + 1), NODES - 1)
_FIT_SQUARES = chebyshev_fit(_DEGREE + 1)
_HALVES = chebyshev_halves(_DEGREE + 1)
_AT_SAMPLES = chebyshev.chebvander(chebyshev_points(_SAMPLES), _DEGREE)

_SIZE_TOLERANCE = 1e-10
"""Error of the integral of a magnitude, relative."""
_MIN_SHARE = 1e-3
"""Least share of an interval in that error: the halves at a corner of the magnitude are many, but
short.
"""
_MAX_SIZE_HALVINGS = 45
"""Halvings of an interval at most: its length is then below the rounding of times."""
_RULE_POINTS, _RULE_WEIGHTS = (
    rule.astype(np.float64) for rule in np.polynomial.legendre.leggauss(NODES)
)
_AT_RULE = chebyshev.chebvander(_RULE_POINTS, NODES - 1)
_RULE_HALVES = chebyshev_halves(NODES)


def resolve(function: Callable[[Floats], Floats], breaks_s: Floats) -> tuple[Floats, Floats]:
    """Represent m functions of time, of similar magnitude, by polynomials of degree 11 on P panels,
    in no order.

    `function` returns values, shape (k, m), at k times, s. `breaks_s`, not decreasing, are the ends
    of the initial panels; the functions may jump there and are not evaluated there. Returns half
    the lengths of the panels, s, and the coefficients, shape (P, 12, m), of Chebyshev polynomials
    of the position in the panel, -1 to 1.

    A panel is halved until the last two coefficients are below 1e-11 of the maximum value on all
    panels, or below 1e-7 of it and no longer decreasing (rounding), or below the effect of the
    rounding of times. Sinusoids on panels of one radian have an error below 1e-13 at once: the
    remainder of the interpolation is at most (1/2)^12 / (2^11 12!) = 2.5e-16 of their amplitude.
    Raise `ValueError` if a value is not finite, or no break is later than another.
    """
    starts = breaks_s[:-1]
    ends = breaks_s[1:]
    starts, ends = starts[ends > starts], ends[ends > starts]
    latest = float(np.abs(breaks_s).max())
    before = np.full(len(starts), np.inf)
    scale = 0.0
    pieces: list[tuple[Floats, Floats]] = []
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
        pieces.append((0.5 * (ends - starts)[resolved], coefficients[resolved]))
        starts = starts[~resolved]
        ends = ends[~resolved]
        before = tails[~resolved]
        middles = 0.5 * (starts + ends)
        starts = np.concatenate([starts, middles])
        ends = np.concatenate([middles, ends])
        before = np.tile(before, 2)
    half_s, parts = zip(*pieces, strict=True)
    return np.concatenate(half_s), np.concatenate(parts)


def _fitted(function: Callable[[Floats], Floats], starts: Floats, ends: Floats) -> Floats:
    """Chebyshev coefficients on panels, shape (P, 12, m)."""
    parts = []
    for first in range(0, len(starts), _AT_ONCE):
        low = starts[first : first + _AT_ONCE]
        high = ends[first : first + _AT_ONCE]
        times = 0.5 * (low + high)[:, None] + 0.5 * (high - low)[:, None] * _POINTS
        values = function(times.ravel())
        if not np.isfinite(values).all():
            raise ValueError("a value is not finite; check the units")
        parts.append(_FIT @ values.reshape(len(low), NODES, -1))
    return np.concatenate(parts)


def max_control(control: Callable[[Floats], Floats], breaks_s: Floats) -> float:
    """Return the maximum |u| of a control, m/s^2, to 1e-9, relative.

    `control` returns u, shape (k, 3), m/s^2, at k times, s. It is smooth between `breaks_s`, which
    do not decrease, and its motion turns by about a radian at most between two of them
    (`LinearMotion.breaks`). Between short panels at late times the error is the effect of the
    rounding of times. Raise `ValueError` if a value is not finite, or no break is later than
    another.

    On panels u is a polynomial of degree 11 to 1e-11 (`resolve`), |u|^2 one of degree 22. A
    polynomial p of degree d is bounded by its values at the zeros of the Chebyshev polynomial of
    degree M > d (Ehlich and Zeller, 1964): max |p| <= max_j |p(x_j)| / cos(pi d / (2 M)). Applied
    to |u|^2 minus the middle of its samples, this bounds each panel from above; panels that may
    contain the maximum are halved until bound and sample agree to 1e-11. No peak between samples is
    missed.
    """
    squares = (
        _FIT_SQUARES @ ((_AT_SQUARES @ resolve(control, breaks_s)[1]) ** 2).sum(axis=2)[..., None]
    )[..., 0]
    maximum = 0.0
    for _ in range(_MAX_HALVINGS):
        values = squares @ _AT_SAMPLES.T
        top = values.max(axis=1)
        bottom = values.min(axis=1)
        bounds = 0.5 * (top + bottom) + 0.5 * _FACTOR * (top - bottom)
        maximum = max(maximum, float(top.max()))
        open_ = bounds > maximum * (1.0 + 2.0 * TOLERANCE)
        if not open_.any():
            break
        squares = np.concatenate([squares[open_] @ half.T for half in _HALVES])
    return float(np.sqrt(maximum))


def integral_of_size(function: Callable[[Floats], Floats], breaks_s: Floats) -> float:
    """Integrate the magnitude of a vector, shape (k, 3) at k times, that is smooth between breaks,
    to 1e-9.

    It is a polynomial on each panel (`resolve`). Gauss and Legendre's rule of 12 nodes on an
    interval and on its two halves; where they differ by more than the interval's share of the
    tolerance, as at a corner of the magnitude where the vector passes through zero, the halves are
    treated in the same way.
    """
    half_s, coefficients = resolve(function, breaks_s)
    total = 0.0
    share = np.maximum(half_s / half_s.sum(), _MIN_SHARE)
    scale: float | None = None
    for level in range(_MAX_SIZE_HALVINGS + 1):
        halves = [half @ coefficients for half in _RULE_HALVES]
        whole, first, second = (
            half_s * (np.linalg.norm(_AT_RULE @ each, axis=2) @ _RULE_WEIGHTS)
            for each in (coefficients, *halves)
        )
        parts = 0.5 * (first + second)
        scale = float(parts.sum()) if scale is None else scale
        left = (np.abs(parts - whole) > _SIZE_TOLERANCE * scale * share) & (
            level < _MAX_SIZE_HALVINGS
        )
        total += float(parts[~left].sum())
        coefficients = np.concatenate([half[left] for half in halves])
        half_s = np.tile(0.5 * half_s[left], 2)
        share = np.tile(np.maximum(0.5 * share[left], _MIN_SHARE), 2)
        if not left.any():
            break
    return total
