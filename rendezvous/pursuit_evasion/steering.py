"""Steering of an evader other than the optimal one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from functools import lru_cache

import numpy as np

from infoset.rendezvous._arrays import Floats

Steering = Callable[[float, Floats], Floats]
"""Direction of thrust, shape (3,), of the time (s) and the evader's state (m, m/s): any length,
zero to coast.
"""


class Policy(Enum):
    """Directions of thrust that depend on the craft's state alone."""

    COAST = "coast"
    PROGRADE = "prograde"
    RETROGRADE = "retrograde"
    NORMAL = "normal"
    ANTINORMAL = "antinormal"
    OUTWARD = "outward"
    INWARD = "inward"

    def direction(self, _time: float, state: Floats) -> Floats:
        """Return the direction of thrust, shape (3,), at a `state` of position and velocity.

        The state may be in any units.
        """
        sign = -1.0 if self in (Policy.RETROGRADE, Policy.ANTINORMAL, Policy.INWARD) else 1.0
        if self is Policy.COAST:
            return np.zeros(3)
        if self in (Policy.PROGRADE, Policy.RETROGRADE):
            return sign * state[3:]
        if self in (Policy.NORMAL, Policy.ANTINORMAL):
            return sign * np.cross(state[:3], state[3:])
        return sign * state[:3]


@dataclass(frozen=True)
class RandomSteering:
    """Random directions, uniform over the sphere, each constant for `hold_s`.

    Seed and run number determine them.
    """

    seed: int
    run: int
    hold_s: float

    def __call__(self, time_s: float, _state: Floats) -> Floats:
        """Return the direction at a time, which is the same in every call."""
        # A time that is a whole number of holds belongs to the next direction, also if rounded.
        return _drawn(self.seed, self.run, max(0, int(time_s / self.hold_s + 1e-9)))


@lru_cache(maxsize=4096)
def _drawn(seed: int, run: int, draw: int) -> Floats:
    stream = np.random.SeedSequence(entropy=seed, spawn_key=(run, 1, draw))
    vector = np.random.default_rng(stream).standard_normal(3)
    direction = np.asarray(vector / np.linalg.norm(vector), dtype=np.float64)
    direction.flags.writeable = False
    return direction
