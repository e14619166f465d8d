"""Targets of the visits, and the kinds of visit."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from rendezvous.relative_motion import LinearMotion

Floats = NDArray[np.float64]
Integers = NDArray[np.intp]


class Meet(Enum):
    """Kind of a visit."""

    FLYBY = "flyby"
    """At its position, with any velocity."""
    RENDEZVOUS = "rendezvous"
    """At its position, with its velocity."""


@dataclass(frozen=True)
class Target:
    """A target.

    Parameters
    ----------
    name : str
        Unique name.
    meet : Meet
        Whether velocities must agree.
    dwell_s : float
        Duration of the stay with the target, coasting; for a rendezvous only.

    Raises
    ------
    ValueError
        If the dwell is negative or not finite, or that of a flyby is not zero.
    """

    name: str
    meet: Meet = Meet.FLYBY
    dwell_s: float = 0.0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.dwell_s) and self.dwell_s >= 0.0):
            raise ValueError(
                f"target {self.name!r}: the dwell must be finite and not negative, found {self.dwell_s!r} s"
            )
        if self.meet is Meet.FLYBY and self.dwell_s > 0.0:
            raise ValueError(f"target {self.name!r}: a flyby cannot dwell; make it a rendezvous")


class MovingTargets(ABC):
    """Targets whose motion is known, with their states at an epoch. They coast in the same dynamics as the chaser.

    Raises
    ------
    ValueError
        If there is no target, two have one name, or a state is not six finite numbers.
    """

    targets: tuple[Target, ...]
    initial: Floats

    def __post_init__(self) -> None:
        if not self.targets:
            raise ValueError("there is no target to visit")
        names = [target.name for target in self.targets]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"target {name!r} is listed twice; each target is visited once")
        if np.shape(self.initial) != (len(names), 6) or not np.isfinite(self.initial).all():
            raise ValueError("each target needs a state of six finite numbers")

    @property
    def dwell_s(self) -> Floats:
        """Duration of the stay with each target, shape (n,)."""
        return np.array([target.dwell_s for target in self.targets])

    @abstractmethod
    def states(self, which: Integers, time_s: Floats) -> Floats:
        """States, m and m/s, of the k targets numbered `which` at k times, shape (k, 6)."""

    @abstractmethod
    def rates(self, time_s: Floats, states: Floats) -> Floats:
        """Time derivatives of `states` of targets at k times, shape (k, 6)."""


@dataclass(frozen=True, eq=False)
class DriftingTargets(MovingTargets):
    """Targets that coast in a linear motion.

    Parameters
    ----------
    targets : tuple of Target
        At least one.
    motion : LinearMotion
        Motion of all targets.
    initial : ndarray, shape (n, 6)
        States of the targets at t = 0, m and m/s.

    Raises
    ------
    ValueError
        If there is no target, two have one name, or a state is not six finite numbers.
    """

    targets: tuple[Target, ...]
    motion: LinearMotion
    initial: Floats

    def states(self, which: Integers, time_s: Floats) -> Floats:
        """States, m and m/s, of the k targets numbered `which` at k times, shape (k, 6)."""
        zero = np.zeros(time_s.shape)
        coasted = self.motion.transition(zero, time_s) @ self.initial[which][:, :, None]
        return np.asarray(coasted[:, :, 0] + self.motion.drift(zero, time_s))

    def rates(self, time_s: Floats, states: Floats) -> Floats:
        """Time derivatives of `states` of targets at k times, shape (k, 6)."""
        return self.motion.rates(time_s, states)
