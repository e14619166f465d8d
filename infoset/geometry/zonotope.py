"""Zonotopes: boxes, disturbances and initial sets of observers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from infoset.arrays import Floats
from infoset.geometry._set_arguments import box_ends, finite_values


@dataclass(frozen=True, eq=False, init=False)
class Zonotope:
    """The set of centre + t_1 g_1 + ... + t_m g_m with all -1 <= t_i <= 1.

    An argument of `LinearObserver`. For operations on sets, `Polytope.from_zonotope(z.centre, z.generators)` or the
    same method of `ConvexPolygons` converts it. `A @ Z` is the linear map.

    Parameters
    ----------
    centre : array_like, shape (n,)
        Point of symmetry.
    generators : array_like, shape (m, n)
        One generator g_i a row; none for a point.

    Raises
    ------
    ValueError
        If the shapes do not agree, or a number is not finite.
    """

    centre: Floats
    generators: Floats

    __array_ufunc__ = None

    def __init__(self, centre: ArrayLike, generators: ArrayLike) -> None:
        middle = finite_values("centre", centre, "n")
        object.__setattr__(self, "centre", middle)
        object.__setattr__(self, "generators", finite_values("generators", generators, "g", len(middle)))

    @classmethod
    def box(cls, lower: ArrayLike, upper: ArrayLike) -> Zonotope:
        """Return {x: lower <= x <= upper}; equal ends give a flat box."""
        minimum, maximum = box_ends(lower, upper, "n")
        centre = 0.5 * minimum + 0.5 * maximum
        # Rounding of the centre must not lose an end.
        half = np.maximum(maximum - centre, centre - minimum)
        return cls(centre, np.diag(half)[half > 0.0])

    def __rmatmul__(self, matrix: ArrayLike) -> Zonotope:
        rows = finite_values("matrix", matrix, "m", self.space)
        return Zonotope(rows @ self.centre, self.generators @ rows.T)

    @property
    def space(self) -> int:
        """Dimension n of the space."""
        return len(self.centre)
