"""Targets to be visited, and how each is met."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from rendezvous.relative_motion import LinearMotion

Floats = NDArray[np.float64]
Integers = NDArray[np.intp]


class Meet(Enum):
    """How a target is met."""

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
    meet : Meet
    dwell_s : float
        How long the chaser stays with it, coasting; a rendezvous only.

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


class MovingTargets(Protocol):
    """Targets whose motion is known. They coast in the same dynamics as the chaser."""

    @property
    def targets(self) -> tuple[Target, ...]:
        """The targets, each with a name of its own."""

    def states(self, which: Integers, time_s: Floats) -> Floats:
        """States, m and m/s, of the targets `which` at times `time_s`, one a time, shape (k, 6)."""

    def rates(self, time_s: Floats, states: Floats) -> Floats:
        """Time derivatives of such states at times, shape (k, 6)."""


@dataclass(frozen=True, eq=False)
class DriftingTargets:
    """Targets that coast in a linear motion.

    Parameters
    ----------
    targets : tuple of Target
    motion : LinearMotion
    initial : ndarray, shape (n, 6)
        Their states at t = 0, m and m/s.

    Raises
    ------
    ValueError
        If there is none, two have one name, or a number is not finite.
    """

    targets: tuple[Target, ...]
    motion: LinearMotion
    initial: Floats

    def __post_init__(self) -> None:
        check_targets(self.targets, self.initial)

    def states(self, which: Integers, time_s: Floats) -> Floats:
        """States, m and m/s, of the targets `which` at times `time_s`, one a time, shape (k, 6)."""
        zero = np.zeros(time_s.shape)
        coasted = self.motion.transition(zero, time_s) @ self.initial[which][:, :, None]
        return np.asarray(coasted[:, :, 0] + self.motion.drift(zero, time_s))

    def rates(self, time_s: Floats, states: Floats) -> Floats:
        """Time derivatives of such states at times, shape (k, 6)."""
        pulled = self.motion.dynamics(time_s) @ states[:, :, None]
        return np.asarray(pulled[:, :, 0] + self.motion.forcing(time_s))


def check_targets(targets: tuple[Target, ...], initial: Floats) -> None:
    """Refuse no targets at all, targets that are listed twice, and states that are none.

    Parameters
    ----------
    targets : tuple of Target
    initial : ndarray, shape (n, 6)

    Raises
    ------
    ValueError
        If there is no target, two have one name, or a state is not of six finite numbers.
    """
    if not targets:
        raise ValueError("there is no target to visit")
    names = [each.name for each in targets]
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"target {name!r} is listed twice; each target is visited once")
    if np.shape(initial) != (len(targets), 6) or not np.isfinite(initial).all():
        raise ValueError("each target needs a state of six finite numbers")


def dwells(targets: tuple[Target, ...]) -> Floats:
    """Return how long the chaser stays with each target, shape (n,).

    Parameters
    ----------
    targets : tuple of Target

    Returns
    -------
    ndarray, shape (n,)
        s.
    """
    return np.array([each.dwell_s for each in targets])
