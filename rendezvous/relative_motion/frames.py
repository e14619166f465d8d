"""Orbital frames that name their axes, and the conversion of states and matrices between them."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Axis(Enum):
    """A direction at the origin of an orbital frame, as its components along (radial, along the motion, normal)."""

    RADIAL_OUTWARD = (1, 0, 0)
    RADIAL_INWARD = (-1, 0, 0)
    ALONG_MOTION = (0, 1, 0)
    AGAINST_MOTION = (0, -1, 0)
    ORBIT_NORMAL = (0, 0, 1)
    AGAINST_NORMAL = (0, 0, -1)


class StateOrder(Enum):
    """How a state lists its components."""

    POSITION_THEN_VELOCITY = (0, 1, 2, 3, 4, 5)
    INTERLEAVED = (0, 3, 1, 4, 2, 5)


@dataclass(frozen=True)
class Frame:
    """A right-handed rotating frame with its origin on the reference orbit.

    Parameters
    ----------
    name : str
    x, y, z : Axis
        What the axes point along.
    order : StateOrder
        (x, y, z, vx, vy, vz), or (x, vx, y, vy, z, vz).

    Raises
    ------
    ValueError
        If the axes are not right-handed.
    """

    name: str
    x: Axis
    y: Axis
    z: Axis
    order: StateOrder = StateOrder.POSITION_THEN_VELOCITY

    def __post_init__(self) -> None:
        if round(float(np.linalg.det(self.rotation))) != 1:
            raise ValueError(
                f"frame {self.name}: the axes {self.x.name}, {self.y.name}, {self.z.name} are not right-handed"
            )

    @property
    def rotation(self) -> Floats:
        """Rows are the axes in (radial, along the motion, normal), shape (3, 3)."""
        return np.array([self.x.value, self.y.value, self.z.value], dtype=np.float64)

    def conversion_to(self, other: Frame) -> Floats:
        """Return the matrix that turns a state of this frame into the same state of another.

        Parameters
        ----------
        other : Frame

        Returns
        -------
        ndarray, shape (6, 6)
            A signed permutation, hence exact and orthogonal. Not to be written to.
        """
        return _conversion(self, other)

    def states_to(self, other: Frame, states: Floats) -> Floats:
        """Convert states to another frame, exactly.

        Parameters
        ----------
        other : Frame
        states : ndarray, shape (..., 6)
            m and m/s, in this frame.

        Returns
        -------
        ndarray, shape (..., 6)
        """
        return np.asarray(states @ _conversion(self, other).T)

    def matrices_to(self, other: Frame, matrices: Floats) -> Floats:
        """Convert matrices that map states to states, or Gramians, to another frame, exactly.

        Parameters
        ----------
        other : Frame
        matrices : ndarray, shape (..., 6, 6)

        Returns
        -------
        ndarray, shape (..., 6, 6)
        """
        if other == self:
            return matrices
        conversion = _conversion(self, other)
        return np.asarray(conversion @ matrices @ conversion.T)

    def vectors_to(self, other: Frame, vectors: Floats) -> Floats:
        """Convert positions, velocities or accelerations to another frame, exactly.

        Parameters
        ----------
        other : Frame
        vectors : ndarray, shape (..., 3)

        Returns
        -------
        ndarray, shape (..., 3)
        """
        return np.asarray(vectors @ (other.rotation @ self.rotation.T).T)


@lru_cache(maxsize=64)
def _conversion(first: Frame, second: Frame) -> Floats:
    rotation = second.rotation @ first.rotation.T
    blocked = np.kron(np.eye(2), rotation)
    conversion = np.asarray(blocked[np.ix_(second.order.value, first.order.value)], dtype=np.float64)
    conversion.flags.writeable = False
    return conversion


HILL = Frame("hill", Axis.RADIAL_OUTWARD, Axis.ALONG_MOTION, Axis.ORBIT_NORMAL)
"""Hill's frame: x'' = 3 n^2 x + 2 n y', y'' = -2 n x', z'' = -n^2 z (Mironov and Mironov 2007)."""

ORBITAL = Frame("orbital", Axis.AGAINST_MOTION, Axis.RADIAL_OUTWARD, Axis.ORBIT_NORMAL)
"""x'' = 2 w y', y'' = 3 w^2 y - 2 w x', z'' = -w^2 z (Barseghyan and Stepanyan 2008; Shorikov and Goranov 2021)."""

ORBITAL_INTERLEAVED = Frame(
    "orbital, interleaved", Axis.AGAINST_MOTION, Axis.RADIAL_OUTWARD, Axis.ORBIT_NORMAL, StateOrder.INTERLEAVED
)
"""The same axes with the state (x, x', y, y', z, z'), as Barseghyan and Stepanyan print their matrices."""
