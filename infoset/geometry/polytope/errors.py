"""Errors of polytopes."""

from __future__ import annotations

import numpy as np

from infoset.arrays import Floats


class EmptyPolytopeError(ValueError):
    """No point satisfies the constraints."""


class UnboundedPolytopeError(ValueError):
    """The result does not exist because the set is unbounded.

    The set is unbounded along `direction`, shape (n,), of unit length.
    """

    def __init__(self, direction: Floats) -> None:
        direction = direction / np.abs(direction).max()
        direction = direction / np.linalg.norm(direction) + 0.0
        shown = ", ".join(f"{component:.3g}" for component in direction)
        super().__init__(f"the polytope is unbounded along ({shown})")
        self.direction = direction


class SolverError(ArithmeticError):
    """A linear program was not solved."""
