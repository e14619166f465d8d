"""Errors of polytopes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class EmptyPolytopeError(ValueError):
    """No point satisfies the constraints.

    `relaxation` is the least relaxation of every constraint, its normal of unit length, with which a point satisfies
    all.
    """

    def __init__(self, relaxation: float) -> None:
        super().__init__(f"the polytope is empty; it is not if its constraints are relaxed by {relaxation:.3g}")
        self.relaxation = relaxation


class UnboundedPolytopeError(ValueError):
    """The constraints do not bound a set; `direction`, shape (n,), of unit length, is one in which it is unbounded."""

    def __init__(self, direction: Floats) -> None:
        shown = ", ".join(f"{component:.3g}" for component in direction)
        super().__init__(f"the polytope is unbounded along ({shown})")
        self.direction = direction


class UncertainHullError(ArithmeticError):
    """Facets and vertices do not agree because of rounding."""
