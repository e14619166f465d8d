"""Sums and products of two floats with their rounding errors, compiled: one float more holds what was rounded away."""

from __future__ import annotations

from typing import Any

from numba import types
from numba.extending import intrinsic

from infoset.kernels import Kernels

_kernels = Kernels()  # without fast-math: reordered sums would lose the errors


def _multiply_add(_: Any, _a: Any, _b: Any, _c: Any) -> Any:
    """Return the type and the code of a b + c, rounded once: an instruction of processors, which Numba lacks."""

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
