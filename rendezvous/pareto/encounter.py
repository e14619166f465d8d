"""The problem: craft that meet at one time in one state, some of whose components are free."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from infoset.rendezvous._arrays import Floats
from infoset.rendezvous.relative_motion import LinearMotion


class Component(Enum):
    """A component of the terminal state, in the order of a state."""

    X = 0
    Y = 1
    Z = 2
    VX = 3
    VY = 4
    VZ = 5


class Meeting(Enum):
    """The components that the craft have in common when they meet."""

    RENDEZVOUS = "rendezvous"
    """Position and velocity."""
    INTERCEPT = "intercept"
    """Position only: the velocities of the craft differ."""


@dataclass(frozen=True, eq=False)
class Craft:
    """A craft that takes part.

    `state`, shape (6,), is (x, y, z, vx, vy, vz) at its start, in Hill's axes, m and m/s. The
    `weight` of its excess in the loss of the group is not negative.
    """

    name: str
    state: Floats
    motion: LinearMotion
    weight: float = 1.0
    start_s: float = 0.0


@dataclass(frozen=True, eq=False)
class Encounter:
    """Craft that meet at one time.

    `free` lists the free components of the terminal state, at least one, each once; in an
    intercept, components of the position only. `fixed`, shape (6,), contains the values of the
    other components, m and m/s; those of free components are ignored.

    Raises
    ------
    ValueError
        If there is no free component, a component repeats, a velocity is free in an intercept, all
        weights are zero, a craft starts at the meeting or later, or names repeat.
    """

    craft: tuple[Craft, ...]
    meeting_s: float
    free: tuple[Component, ...]
    fixed: Floats
    meeting: Meeting = Meeting.RENDEZVOUS

    def __post_init__(self) -> None:
        if len({craft.name for craft in self.craft}) < len(self.craft):
            raise ValueError("two craft have the same name")
        if not self.free or len(set(self.free)) < len(self.free):
            raise ValueError("name one or more free components of x, y, z, vx, vy, vz, each once")
        if any(component.value >= self.common for component in self.free):
            raise ValueError(
                "the velocities of the craft differ in an intercept; free only x, y and z"
            )
        for craft in self.craft:
            if not craft.start_s < self.meeting_s:
                raise ValueError(
                    f"craft {craft.name!r}: it must start before the meeting at {self.meeting_s!r} "
                    f"s, found {craft.start_s!r} s"
                )
        if not any(craft.weight > 0.0 for craft in self.craft):
            raise ValueError("all weights are zero; give one craft a positive weight")

    @property
    def weights(self) -> Floats:
        """Weights of the craft, shape (n,)."""
        return np.array([craft.weight for craft in self.craft])

    @property
    def common(self) -> int:
        """Number of common components of the terminal states: 6, or 3 (the position)."""
        return 6 if self.meeting is Meeting.RENDEZVOUS else 3

    @property
    def base(self) -> Floats:
        """The terminal state with zeros in its free components, shape (6,)."""
        state = np.array(self.fixed, dtype=np.float64)
        state[[component.value for component in self.free]] = 0.0
        return state

    @property
    def opening(self) -> Floats:
        """E: the map from free values to the terminal state, shape (6, f)."""
        matrix = np.zeros((6, len(self.free)))
        matrix[[component.value for component in self.free], range(len(self.free))] = 1.0
        return matrix
