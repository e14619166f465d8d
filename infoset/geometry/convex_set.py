"""Operators of sets, and equality."""

from __future__ import annotations

from numbers import Real
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from infoset.geometry._set_arguments import finite_values


class ConvexSet:
    """What `ConvexPolygons` and `Polytope` share: operators and equality in terms of their methods."""

    __array_ufunc__ = None  # so that NumPy leaves `array + set` and `array @ set` to the set

    vertices: Any
    affine_map: Any
    contains: Any
    intersection: Any
    is_subset: Any
    minkowski_sum: Any

    def equals(self, other: Self, tolerance: float = 0.0) -> Any:
        """Return whether each set is a subset of the other one, with the tolerance of `is_subset`."""
        return self.is_subset(other, tolerance) & other.is_subset(self, tolerance)

    def linear_map(self, matrix: ArrayLike) -> Self:
        """Return {matrix x}, with a matrix of shape (m, n), singular or not."""
        image: Self = self.affine_map(matrix)
        return image

    def translate(self, offset: ArrayLike) -> Self:
        """Return the set moved by an offset, shape (n,), at the cost of `affine_map`."""
        space = self.vertices.shape[-1]
        moved: Self = self.affine_map(np.eye(space), finite_values("offset", offset, space))
        return moved

    def __and__(self, other: Self) -> Self:
        return self.intersection(other) if isinstance(other, type(self)) else NotImplemented

    def __add__(self, other: Self | ArrayLike) -> Self:
        result: Self = self.minkowski_sum(other) if isinstance(other, ConvexSet) else self.translate(other)
        return result

    __radd__ = __add__

    def __mul__(self, factor: float) -> Self:
        if not isinstance(factor, Real):
            return NotImplemented
        return self.linear_map(float(factor) * np.eye(self.vertices.shape[-1]))

    __rmul__ = __mul__

    def __neg__(self) -> Self:
        return -1.0 * self

    def __rmatmul__(self, matrix: ArrayLike) -> Any:
        return self.affine_map(matrix)

    def __contains__(self, point: ArrayLike) -> bool:
        found = self.contains(point)
        if np.ndim(found):
            raise TypeError("'in' is for one point and one set; use contains for a batch")
        return bool(found)

    def __le__(self, other: Self) -> Any:
        return self.is_subset(other) if isinstance(other, type(self)) else NotImplemented
