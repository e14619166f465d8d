"""Hill's axes of relative motion, their titles, and the conversion from other axes.

Two papers have other axes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from infoset.arrays import Floats

AXES = "x radially outward, y along the motion, z along the orbit's normal (Hill)"
AXIS_TITLES = ("x (radial)", "y (along-track)", "z (normal)")
INERTIAL_TITLES = ("x (inertial)", "y (inertial)", "z (inertial)")

_PAPER_AXES = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""Axes of Barseghyan and Stepanyan (2008) and of Shorikov and Goranov (2021), as rows in Hill's
axes: x against the motion, y radially outward, z along the orbit's normal."""


def component_titles(symbol: str) -> list[str]:
    """Return the titles of the components of a vector, for example `$v_x$ (radial)`."""
    return [f"${symbol}_{title[0]}${title[1:]}" for title in AXIS_TITLES]


def from_paper(vectors: ArrayLike) -> Floats:
    """Convert vectors or states from the axes of the papers.

    Positions, velocities and controls have the shape (..., 3), states (..., 6).
    """
    return _turned(np.asarray(vectors, dtype=float), _PAPER_AXES)


def to_paper(vectors: ArrayLike) -> Floats:
    """Convert vectors or states to the axes of the papers.

    Positions, velocities and controls have the shape (..., 3), states (..., 6).
    """
    return _turned(np.asarray(vectors, dtype=float), _PAPER_AXES.T)


def _turned(vectors: Floats, matrix: Floats) -> Floats:
    # The sum with 0.0 turns -0.0 into 0.0.
    return (vectors.reshape(-1, 3) @ matrix).reshape(vectors.shape) + 0.0
