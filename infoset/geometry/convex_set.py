"""Operators of sets, and equality."""

from __future__ import annotations

from numbers import Real
from typing import Any, Self, overload

import numpy as np
from numpy.typing import ArrayLike

from infoset.geometry._set_arguments import finite_values
from infoset.limits import shown


class ConvexSet:
    """Operators and equality of `ConvexPolygons`, `Polytope` and `Zonotope`.

    They are written in terms of the methods of these classes. An operation of two sets of different
    classes converts both by their method `polytope`.
    """

    __array_ufunc__ = None  # so that NumPy leaves `array + set` and `array @ set` to the set

    vertices: Any
    affine_map: Any
    contains: Any
    intersection: Any
    is_subset: Any
    minkowski_sum: Any
    polytope: Any

    @property
    def space(self) -> int:
        """Dimension n of the space."""
        return int(self.vertices.shape[-1])

    def equals(self, other: ConvexSet, tolerance: float = 0.0) -> Any:
        """Return whether each set is a subset of the other one.

        `tolerance` is the tolerance of `is_subset`.
        """
        return self.is_subset(other, tolerance) & other.is_subset(self, tolerance)

    def linear_map(self, matrix: ArrayLike) -> Self:
        """Return {matrix x}, with a matrix of shape (m, n), singular or not."""
        image: Self = self.affine_map(matrix)
        return image

    def translate(self, offset: ArrayLike) -> Self:
        """Return the set moved by an offset, shape (n,), at the cost of `affine_map`."""
        moved: Self = self.affine_map(
            np.eye(self.space), finite_values("offset", offset, self.space)
        )
        return moved

    # The second signatures are for sets of two classes: mypy looks only at this class, where `Self`
    # is any set.
    @overload
    def __and__(self, other: Self) -> Self: ...
    @overload
    def __and__(self, other: ConvexSet) -> Any: ...  # type: ignore[overload-cannot-match]
    def __and__(self, other: Any) -> Any:
        return self.intersection(other) if isinstance(other, ConvexSet) else NotImplemented

    @overload
    def __add__(self, other: Self | ArrayLike) -> Self: ...
    @overload
    def __add__(self, other: ConvexSet) -> Any: ...  # type: ignore[overload-cannot-match]
    def __add__(self, other: Any) -> Any:
        return self.minkowski_sum(other) if isinstance(other, ConvexSet) else self.translate(other)

    __radd__ = __add__

    def __mul__(self, factor: float) -> Self:
        if not isinstance(factor, Real):
            return NotImplemented
        return self.linear_map(float(factor) * np.eye(self.space))

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

    def __le__(self, other: ConvexSet) -> Any:
        return self.is_subset(other) if isinstance(other, ConvexSet) else NotImplemented


def need_convex_set(name: str, value: object) -> ConvexSet:
    """Return an argument that is a set of any class, or raise a TypeError."""
    if not isinstance(value, ConvexSet):
        raise TypeError(
            f"{name} must be a set (ConvexPolygons, Polytope or Zonotope): got {shown(value)}"
        )
    return value
