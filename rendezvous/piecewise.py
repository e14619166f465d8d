"""Smooth functions of time as polynomials on panels; maximum and integral of a control."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.polynomial import chebyshev

from infoset.rendezvous._arrays import Floats

NODES = 12
"""Nodes of a panel: polynomials of degree 11 resolve sinusoids on a radian to 1e-13 (`resolve`)."""
RESOLVED = 1e-11
"""Last coefficients, relative to the maximum value, at which a panel is resolved: a hundred times
below the accuracy of 1e-9 of the maximum and of the integral."""
ROUNDING_BELOW = 1e-7
"""Last coefficients, relative to the maximum value, that are rounding if they no longer decrease: a
control of nearly singular matrices has as few digits."""
_NOT_DECREASING = 0.2
"""Ratio of the last coefficients after a panel is halved to those before, above which they no
longer decrease: halving reduces resolved coefficients of degree 11 by 2^11."""
_TIME_ROUNDINGS = 64.0
"""Number of roundings of a time whose effect on the values is accepted. Chosen: the tests of
`max_control` hold from 8 to 1e5 (measured)."""
_AT_ONCE = 2048
"""Panels whose values are computed at once, to bound the memory."""
PEAK_TOLERANCE = 1e-11
"""Relative difference between an upper bound of |u| and a sample at which a peak is found."""
_MAX_HALVINGS = 40
"""Maximum number of halvings of a panel: bound and sample agree to 1e-11 after about 18, because
their difference decreases with the square of the length."""


def chebyshev_points(count: int) -> Floats:
    """Return the zeros of the Chebyshev polynomial of degree `count`, on [-1, 1]."""
    return np.asarray(np.cos(np.pi * (np.arange(count) + 0.5) / count))


def chebyshev_fit(count: int) -> Floats:
    """Return the matrix of Chebyshev coefficients from values at `chebyshev_points(count)`."""
    matrix = (2.0 / count) * chebyshev.chebvander(chebyshev_points(count), count - 1).T
    # The coefficient of degree zero is the mean; the others are twice a mean.
    matrix[0] *= 0.5
    return np.asarray(matrix)


def chebyshev_halves(count: int) -> list[Floats]:
    """Return the matrices of `count` Chebyshev coefficients on the two halves of an interval.

    Each matrix multiplies the coefficients on the interval.
    """
    points = chebyshev_points(count)
    fit = chebyshev_fit(count)
    return [fit @ chebyshev.chebvander(0.5 * points + middle, count - 1) for middle in (-0.5, 0.5)]


_POINTS = chebyshev_points(NODES)
_FIT = chebyshev_fit(NODES)
"""Nodes of a panel on [-1, 1], and the matrix of coefficients from the values at them."""
_DEGREE = 2 * (NODES - 1)
"""Degree of the square of a control on a panel."""
_SAMPLES = 4 * _DEGREE
"""Number M of samples that bound the square: the factor is then 1.08."""
_FACTOR = 1.0 / np.cos(0.5 * np.pi * _DEGREE / _SAMPLES)
"""Bound of the maximum of |p|, p a polynomial, by that of its samples (Ehlich and Zeller, 1964)."""
# Matrices: the control at the nodes of its square, the coefficients of the square from them, these
# coefficients on both halves of the panel, and the square at the samples.
_AT_SQUARES = chebyshev.chebvander(chebyshev_points(_DEGREE + 1), NODES - 1)
_FIT_SQUARES = chebyshev_fit(_DEGREE + 1)
_HALVES = chebyshev_halves(_DEGREE + 1)
_AT_SAMPLES = chebyshev.chebvander(chebyshev_points(_SAMPLES), _DEGREE)

_SIZE_TOLERANCE = 1e-10
"""Error of the integral of a magnitude, relative: a tenth of the accuracy of 1e-9."""
_MIN_SHARE = 1e-3
"""Minimum share of an interval in this error: the halves at a corner of the magnitude are many, but
short.
"""
_MAX_SIZE_HALVINGS = 45
"""Maximum number of halvings of an interval: its length is then below the rounding of times."""
_RULE_POINTS, _RULE_WEIGHTS = (
    rule.astype(np.float64) for rule in np.polynomial.legendre.leggauss(NODES)
)
# Matrices: a function at the nodes of the rule, and its coefficients on both halves of an interval.
_AT_RULE = chebyshev.chebvander(_RULE_POINTS, NODES - 1)
_RULE_HALVES = chebyshev_halves(NODES)


def resolve(function: Callable[[Floats], Floats], breaks_s: Floats) -> tuple[Floats, Floats]:
    """Represent m functions of time by polynomials of degree 11 on P panels, in no order.

    `function` returns values of similar magnitude, shape (k, m), at k times, s. `breaks_s`, not
    decreasing, are the ends of the initial panels; the functions may jump there and are not
    evaluated there. Returns half the lengths of the panels, s, and the coefficients, shape (P, 12,
    m), of Chebyshev polynomials of the position in the panel, -1 to 1.

    A panel is halved until the last two coefficients are below 1e-11 of the largest coefficient
    found so far, or below 1e-7 of it and no longer decreasing (rounding), or below the effect of
    the rounding of times. Two, because every second one of an even or odd function is zero. The
    effect of the rounding of times grows as panels get shorter, so that halving ends also at a jump
    within a panel. Sinusoids on panels of one radian have an error below 1e-13 at once: the
    remainder of the interpolation is at most (1/2)^12 / (2^11 12!) = 2.5e-16 of their amplitude.
    Raise `ValueError` if a value is not finite, or no break is later than another.
    """
    is_panel = breaks_s[1:] > breaks_s[:-1]
    starts = breaks_s[:-1][is_panel]
    ends = breaks_s[1:][is_panel]
    if not len(starts):
        raise ValueError("no break is later than another")
    latest = float(np.abs(breaks_s).max())
    # Coefficients of a panel before it was halved: infinite for initial panels, which are not yet
    # rounding.
    before = np.full(len(starts), np.inf)
    scale = 0.0
    half_s = []
    resolved_coefficients = []

    while len(starts):
        coefficients = _fitted(function, starts, ends)
        sizes = np.abs(coefficients)
        scale = max(scale, float(sizes.max()))
        tails = sizes[:, -2:].max(axis=(1, 2))
        time_rounding = _TIME_ROUNDINGS * np.finfo(float).eps * latest / (ends - starts)
        is_small = tails <= scale * np.maximum(RESOLVED, time_rounding)
        is_rounding = (tails <= ROUNDING_BELOW * scale) & (tails > _NOT_DECREASING * before)
        resolved = is_small | is_rounding
        half_s.append(0.5 * (ends - starts)[resolved])
        resolved_coefficients.append(coefficients[resolved])

        starts = starts[~resolved]
        ends = ends[~resolved]
        before = tails[~resolved]
        middles = 0.5 * (starts + ends)
        starts = np.concatenate([starts, middles])
        ends = np.concatenate([middles, ends])
        before = np.tile(before, 2)
    return np.concatenate(half_s), np.concatenate(resolved_coefficients)


def _fitted(function: Callable[[Floats], Floats], starts: Floats, ends: Floats) -> Floats:
    """Return the Chebyshev coefficients on panels, shape (P, 12, m)."""
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
    (`LinearMotion.breaks`). On short panels at late times the error is the effect of the rounding
    of times. Raise `ValueError` if a value is not finite, or no break is later than
    another.

    On panels u is a polynomial of degree 11 to 1e-11 (`resolve`), and |u|^2 has degree 22. A
    polynomial p of degree d is bounded by its values at the zeros of the Chebyshev polynomial of
    degree M > d (Ehlich and Zeller, 1964): max |p| <= max_j |p(x_j)| / cos(pi d / (2 M)). Applied
    to |u|^2 minus the middle of its samples, this bounds each panel from above; panels that may
    contain the maximum are halved until bound and sample agree to 1e-11. No peak between samples is
    missed.
    """
    _, coefficients = resolve(control, breaks_s)
    at_nodes = ((_AT_SQUARES @ coefficients) ** 2).sum(axis=2)
    squares = (_FIT_SQUARES @ at_nodes[..., None])[..., 0]

    maximum = 0.0
    for _ in range(_MAX_HALVINGS):
        values = squares @ _AT_SAMPLES.T
        top = values.max(axis=1)
        bottom = values.min(axis=1)
        # Less the middle, samples are at most half their spread in size, and other values at most
        # `_FACTOR` times that.
        bounds = 0.5 * (top + bottom) + 0.5 * _FACTOR * (top - bottom)
        maximum = max(maximum, float(top.max()))

        # A square has twice the relative difference of its root.
        may_be_larger = bounds > maximum * (1.0 + 2.0 * PEAK_TOLERANCE)
        if not may_be_larger.any():
            break
        squares = np.concatenate([squares[may_be_larger] @ half.T for half in _HALVES])
    return float(np.sqrt(maximum))


def integral_of_size(function: Callable[[Floats], Floats], breaks_s: Floats) -> float:
    """Integrate the magnitude of a vector over time to 1e-9, relative.

    `function` returns vectors, shape (k, 3), at k times, s, and is smooth between `breaks_s`. It is
    a polynomial on each panel (`resolve`). Gauss and Legendre's rule of 12 nodes is applied to an
    interval and to its two halves. If they differ by more than the interval's share of the
    tolerance, as at a corner of the magnitude where the vector passes through zero, the halves are
    treated in the same way.
    """
    half_s, coefficients = resolve(function, breaks_s)
    share = np.maximum(half_s / half_s.sum(), _MIN_SHARE)
    total = 0.0
    scale = 0.0
    for level in range(_MAX_SIZE_HALVINGS + 1):
        first, second = (half @ coefficients for half in _RULE_HALVES)
        whole = _integrated(coefficients, half_s)
        parts = 0.5 * (_integrated(first, half_s) + _integrated(second, half_s))
        if level == 0:
            scale = float(parts.sum())

        left = np.abs(parts - whole) > _SIZE_TOLERANCE * scale * share
        # Intervals that are left after the last halving count too: they are too short to matter.
        if level == _MAX_SIZE_HALVINGS:
            left[:] = False
        total += float(parts[~left].sum())
        if not left.any():
            break
        coefficients = np.concatenate([first[left], second[left]])
        half_s = np.tile(0.5 * half_s[left], 2)
        share = np.tile(np.maximum(0.5 * share[left], _MIN_SHARE), 2)
    return total


def _integrated(coefficients: Floats, half_s: Floats) -> Floats:
    """Integrals of the magnitude over intervals of half lengths, s, by the rule, shape (P,)."""
    sizes = np.linalg.norm(_AT_RULE @ coefficients, axis=2)
    return np.asarray(half_s * (sizes @ _RULE_WEIGHTS))
