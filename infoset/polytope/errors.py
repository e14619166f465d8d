"""Why a polytope could not be made."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class EmptyPolytopeError(ValueError):
    """Constraints that no point meets.

    Parameters
    ----------
    relaxation : float
        By how much every constraint, its normal of unit length, must be relaxed until a point meets them all.
    rows : ndarray of int, shape (k,)
        Constraints that conflict, by their place; of no entries where that is not known.
    """

    def __init__(self, relaxation: float, rows: NDArray[np.int64] | None = None) -> None:
        super().__init__(f"the polytope is empty: its constraints must be relaxed by {relaxation:.3g} to hold a point")
        self.relaxation = relaxation
        self.rows = np.zeros(0, np.int64) if rows is None else rows


class UnboundedPolytopeError(ValueError):
    """Constraints that leave a direction free.

    Parameters
    ----------
    direction : ndarray, shape (n,)
        A direction in which the set goes on without end, of unit length.
    """

    def __init__(self, direction: Floats) -> None:
        shown = ", ".join(f"{each:.3g}" for each in direction)
        super().__init__(f"the polytope is unbounded: it goes on without end along ({shown})")
        self.direction = direction


class UncertainHullError(ArithmeticError):
    """Facets and vertices that do not agree with each other: the set is beyond what floating point can tell."""
