"""Errors of polytopes."""

from __future__ import annotations

import numpy as np

from infoset.arrays import Floats


class EmptyPolytopeError(ValueError):
    """No point satisfies the constraints."""


class UnboundedPolytopeError(ValueError):
    """The constraints do not bound a set; `direction`, shape (n,), of unit length, is one in which it is unbounded."""

    def __init__(self, direction: Floats, inside: tuple[Floats, Floats] | None = None) -> None:
        self.inside = inside
        """A point of the set and the sum of its directions, to rounding, where they are known; for its proof."""
        direction = direction / np.abs(direction).max()
        direction = direction / np.linalg.norm(direction) + 0.0
        shown = ", ".join(f"{component:.3g}" for component in direction)
        super().__init__(f"the polytope is unbounded along ({shown})")
        self.direction = direction


class UncertainHullError(ArithmeticError):
    """Facets and vertices do not agree because of rounding."""
