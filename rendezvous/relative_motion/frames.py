"""Orbital frames that name their axes, and the conversion of states and matrices between them."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from functools import lru_cache

import numpy as np

from rendezvous._arrays import Floats


class Axis(Enum):
    """A direction at the origin of an orbital frame: its components along (radial, along the motion, normal)."""

    RADIAL_OUTWARD = (1, 0, 0)
    RADIAL_INWARD = (-1, 0, 0)
    ALONG_MOTION = (0, 1, 0)
    AGAINST_MOTION = (0, -1, 0)
    ORBIT_NORMAL = (0, 0, 1)
    AGAINST_NORMAL = (0, 0, -1)


class StateOrder(Enum):
    """Order of the components of a state."""

    POSITION_THEN_VELOCITY = (0, 1, 2, 3, 4, 5)
    INTERLEAVED = (0, 3, 1, 4, 2, 5)


@dataclass(frozen=True)
class Frame:
    """A right-handed rotating frame with its origin on the reference orbit; x, y and z are the directions of its axes.

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
        """Return the read-only signed permutation, shape (6, 6), that converts states to the frame `other`."""
        return _conversion(self, other)

    def states_to(self, other: Frame, states: Floats) -> Floats:
        """Convert `states` (m, m/s), shape (..., 6), to the frame `other`, exactly."""
        return np.asarray(states @ _conversion(self, other).T)

    def matrices_to(self, other: Frame, matrices: Floats) -> Floats:
        """Convert `matrices`, shape (..., 6, 6), of maps from states to states or Gramians, to the frame `other`."""
        if other == self:
            return matrices
        conversion = _conversion(self, other)
        return np.asarray(conversion @ matrices @ conversion.T)

    def effects_to(self, other: Frame, matrices: Floats) -> Floats:
        """Convert `matrices`, shape (..., 6, 3), that map controls to states, to the frame `other`, exactly."""
        return np.asarray(_conversion(self, other) @ matrices @ (other.rotation @ self.rotation.T).T)

    def vectors_to(self, other: Frame, vectors: Floats) -> Floats:
        """Convert positions, velocities or accelerations `vectors`, shape (..., 3), to the frame `other`, exactly."""
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
