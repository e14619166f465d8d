"""Compiled sums and products with their rounding errors.

The exact result is the sum of two floats.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import types
from numba.extending import intrinsic

from infoset.arrays import Floats
from infoset.geometry.tolerances import EPS
from infoset.kernels import Kernels

_kernels = Kernels()  # without fast-math: reordered sums would lose the errors

TERM_ROUNDING = 8.0 * EPS
"""Rounding of a scalar product, relative to its terms: enough for sums of up to 16 coordinates.

A height that is lower by more than this is not the highest.
"""


def _multiply_add(_: Any, _a: Any, _b: Any, _c: Any) -> Any:
    """Return the type and the code of a b + c, rounded once.

    Processors have an instruction for it, which Numba does not offer.
    """

    def code(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.fma(*arguments)

    return types.float64(types.float64, types.float64, types.float64), code


_fused: Any = intrinsic(_multiply_add)


@_kernels.inlined
def two_sum(a: float, b: float) -> tuple[float, float]:
    """Return the rounded sum and its rounding error."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


@_kernels.inlined
def two_product(a: float, b: float) -> tuple[float, float]:
    """Return the rounded product and its rounding error."""
    product = a * b
    return product, _fused(a, b, -product)


@_kernels.allocation_free
def precise_dot(a: Floats, b: Floats, start: float) -> tuple[float, float]:
    """Return start + a . b as the sum of two numbers, as exact as with doubled digits.

    Entries of `a` after the last one of `b` do not count.

    References
    ----------
    T. Ogita, S. M. Rump and S. Oishi, Accurate sum and dot product, SIAM J. Sci. Comput. 26 (2005).
    """
    high = start
    low = 0.0
    for i in range(len(b)):
        product, rounded = two_product(a[i], b[i])
        high, lost = two_sum(high, product)
        low += lost + rounded
    return two_sum(high, low)


@_kernels.compiled
def affine_image(points: Floats, matrix: Floats, shift: Floats) -> tuple[Floats, Floats]:
    """Return matrix x + shift of points, shape (k, m), and the maximum errors, shape (m,).

    Each coordinate is rounded once. The errors are the greatest roundings of each coordinate over
    all points, without a sign.
    """
    image = np.empty((len(points), len(matrix)))
    errors = np.zeros(len(matrix))
    for j in range(len(matrix)):
        for i in range(len(points)):
            image[i, j], low = precise_dot(matrix[j], points[i], shift[j])
            errors[j] = max(errors[j], abs(low))
    return image, errors


@_kernels.compiled
def supports(points: Floats, normals: Floats) -> Floats:
    """Return max normal . point of each normal, shape (f,), rounded up; -inf without points.

    The products are nearly exact.
    """
    result = np.full(len(normals), -np.inf)
    for f in range(len(normals)):
        for i in range(len(points)):
            height = 0.0
            terms = 0.0
            for j in range(points.shape[1]):
                height += normals[f, j] * points[i, j]
                terms += abs(normals[f, j] * points[i, j])

            # Only points that may be highest are worth the precise product.
            if height + TERM_ROUNDING * terms >= result[f]:
                high, low = precise_dot(normals[f], points[i], 0.0)
                if low > 0.0:
                    high = math.nextafter(high, math.inf)
                result[f] = max(result[f], high)
    return result
