"""The greatest magnitude of a control over a time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from rendezvous.piecewise import NODES, chebyshev_fit, chebyshev_halves, chebyshev_points, resolve

Floats = NDArray[np.float64]

TOLERANCE = 1e-11
_DEGREE = 2 * (NODES - 1)
_SAMPLES = 4 * _DEGREE
_FACTOR = 1.0 / np.cos(0.5 * np.pi * _DEGREE / _SAMPLES)
_MOST_HALVINGS = 40

_AT_SQUARES = chebyshev.chebvander(chebyshev_points(_DEGREE + 1), NODES - 1)
_FIT = chebyshev_fit(_DEGREE + 1)
_AT_SAMPLES = chebyshev.chebvander(chebyshev_points(_SAMPLES), _DEGREE)
_HALVES = chebyshev_halves(_DEGREE + 1)


def greatest_control(control: Callable[[Floats], Floats], breaks_s: Floats) -> float:
    """Return the greatest |u| of a control, m/s^2, to 1e-9, relative.

    `control` returns u, shape (k, 3), m/s^2, at k times, s. It is smooth between `breaks_s`, which do not decrease, and
    its motion turns by about a radian at most between two of them (`LinearMotion.breaks`). Between short panels at late
    times the error is the effect of the rounding of times.

    Raises
    ------
    ValueError
        If a value is not finite, or no break is later than another.

    Notes
    -----
    On panels u is a polynomial of degree 11 to 1e-11 (`rendezvous.piecewise`), |u|^2 one of degree 22. A polynomial p
    of degree d is bounded by its values at the zeros of the Chebyshev polynomial of degree M > d (Ehlich and Zeller,
    1964): max |p| <= max_j |p(x_j)| / cos(pi d / (2 M)). Applied to |u|^2 minus the middle of its samples, this bounds
    each panel from above; panels that may contain the greatest are halved until bound and sample agree to 1e-11. No
    peak between samples is missed.
    """
    pieces = resolve(control, breaks_s)
    squares = _FIT @ ((_AT_SQUARES @ pieces.coefficients) ** 2).sum(axis=2)[..., None]
    squares = squares[..., 0]
    greatest = 0.0
    for _ in range(_MOST_HALVINGS):
        values = squares @ _AT_SAMPLES.T
        top, bottom = values.max(axis=1), values.min(axis=1)
        bounds = 0.5 * (top + bottom) + 0.5 * _FACTOR * (top - bottom)
        greatest = max(greatest, float(top.max()))
        open_ = bounds > greatest * (1.0 + 2.0 * TOLERANCE)
        if not open_.any():
            break
        squares = np.concatenate([squares[open_] @ half.T for half in _HALVES])
    return float(np.sqrt(greatest))
