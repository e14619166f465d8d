"""What both routes can tell of the sets of a block."""

from __future__ import annotations

from enum import Enum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from infoset.polytope import Polytope

Floats = NDArray[np.float64]


class SetKind(Enum):
    """Which set of states at a time.

    FORWARD is every state that admissible controls reach; TUBE every one that optimal controls lead through.
    """

    FORWARD = "forward"
    TUBE = "tube"


class BlockSets(Protocol):
    """Sets of states of a block, at t = 0..T, scaled."""

    def support(self, kind: SetKind, time: int, directions: Floats) -> Floats:
        """Return the support function along directions, shape (k, n), as an array of shape (k,)."""

    def bounds(self, kind: SetKind) -> Floats:
        """Return the least and greatest of each state at each time, shape (T + 1, n, 2)."""

    def shadow(self, kind: SetKind, time: int, rows: Floats, tolerance: float = 1e-9) -> Polytope:
        """Return the image of a set under a matrix, shape (d, n), of few rows."""

    def polytope(self, kind: SetKind, time: int) -> Polytope | None:
        """Return the set itself, where it is known."""
