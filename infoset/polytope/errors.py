"""Errors of polytopes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class EmptyPolytopeError(ValueError):
    """No point satisfies the constraints.

    Parameters
    ----------
    relaxation : float
        Least relaxation of every constraint, its normal of unit length, with which a point satisfies all.
    rows : ndarray of int, shape (k,)
        Indices of constraints that conflict; empty where they are not known.
    """

    def __init__(self, relaxation: float, rows: NDArray[np.int64] | None = None) -> None:
        super().__init__(f"the polytope is empty; it is not if its constraints are relaxed by {relaxation:.3g}")
        self.relaxation = relaxation
        self.rows = np.zeros(0, np.int64) if rows is None else rows


class UnboundedPolytopeError(ValueError):
    """The constraints do not bound a set.

    Parameters
    ----------
    direction : ndarray, shape (n,)
        A direction in which the set is unbounded, of unit length.
    """

    def __init__(self, direction: Floats) -> None:
        shown = ", ".join(f"{component:.3g}" for component in direction)
        super().__init__(f"the polytope is unbounded along ({shown})")
        self.direction = direction


class UncertainHullError(ArithmeticError):
    """Facets and vertices do not agree because of rounding."""
