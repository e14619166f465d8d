"""Sums and products of two floats with their rounding errors, compiled: one float more holds what was rounded away."""

from __future__ import annotations

from infoset.kernels import Kernels

_SPLIT = 134217729.0
"""2^27 + 1, which splits a float into two halves of 26 bits."""
_kernels = Kernels()  # without fast-math: reordered sums would lose the errors


@_kernels.inlined
def two_sum(a: float, b: float) -> tuple[float, float]:
    """Return the rounded sum and its rounding error."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


@_kernels.inlined
def two_product(a: float, b: float) -> tuple[float, float]:
    """Return the rounded product and its rounding error (T. J. Dekker, 1971)."""
    product = a * b
    high_a, high_b = _SPLIT * a, _SPLIT * b
    high_a -= high_a - a
    high_b -= high_b - b
    low_a, low_b = a - high_a, b - high_b
    return product, low_a * low_b - (((product - high_a * high_b) - low_a * high_b) - high_a * low_b)
