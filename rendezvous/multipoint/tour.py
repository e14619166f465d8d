"""Moving targets, a chaser that visits them, and the path for given order and times."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from rendezvous._arrays import Floats, Integers
from rendezvous.multipoint.segments import LinearPath, Nodes, Path, solve_segments
from rendezvous.relative_motion import LinearMotion

SMOOTH = 4.0 / 3.0


class Meet(Enum):
    """Kind of a visit."""

    FLYBY = "flyby"
    """At its position, with any velocity."""
    RENDEZVOUS = "rendezvous"
    """At its position, with its velocity."""


@dataclass(frozen=True)
class Target:
    """A target; `dwell_s` is the duration of the stay with it, coasting, for a rendezvous only.

    Raises
    ------
    ValueError
        If the dwell of a flyby is not zero.
    """

    name: str
    meet: Meet = Meet.FLYBY
    dwell_s: float = 0.0

    def __post_init__(self) -> None:
        if self.meet is Meet.FLYBY and self.dwell_s > 0.0:
            raise ValueError(f"target {self.name!r}: a flyby cannot dwell; make it a rendezvous")


class MovingTargets(ABC):
    """Targets whose motion is known, with their states at an epoch. They coast in the same dynamics as the chaser.

    Raises
    ------
    ValueError
        If two targets have the same name.
    """

    targets: tuple[Target, ...]
    initial: Floats

    def __post_init__(self) -> None:
        if len({target.name for target in self.targets}) < len(self.targets):
            raise ValueError("two targets have the same name; each target is visited once")

    @property
    def dwell_s(self) -> Floats:
        """Duration of the stay with each target, shape (n,)."""
        return np.array([target.dwell_s for target in self.targets])

    @abstractmethod
    def states(self, which: Integers, time_s: Floats) -> Floats:
        """States, m and m/s, of the k targets numbered `which` at k times, shape (k, 6)."""


@dataclass(frozen=True, eq=False)
class DriftingTargets(MovingTargets):
    """Targets that coast in a linear motion; `initial`, shape (n, 6), are their states at t = 0, m and m/s."""

    targets: tuple[Target, ...]
    motion: LinearMotion
    initial: Floats

    def states(self, which: Integers, time_s: Floats) -> Floats:
        """States, m and m/s, of the k targets numbered `which` at k times, shape (k, 6)."""
        coasted = self.motion.transition(np.zeros(time_s.shape), time_s) @ self.initial[which][:, :, None]
        return np.asarray(coasted[:, :, 0])


class Visits(ABC):
    """A chaser's start (`start_s`, `start_state`) and its targets."""

    targets: MovingTargets
    start_state: Floats
    start_s: float = 0.0
    ruggedness: ClassVar[float]
    """Ratio up to which local minima of one order may differ; used to compare orders."""

    @property
    def dwell_s(self) -> Floats:
        """Duration of the stay with each target, shape (n,)."""
        return self.targets.dwell_s

    @abstractmethod
    def fly(self, order: Sequence[int], time_s: ArrayLike) -> Path:
        """Return the path of minimum energy that reaches targets in an `order`, some or all, each once, at N times."""

    @abstractmethod
    def flyer(self, order: Sequence[int]) -> Callable[[Floats], Path]:
        """Return a function of N times that finds paths of one `order`, each near one before if that helps."""


@dataclass(frozen=True, eq=False)
class Tour(Visits):
    """A chaser and the targets it visits, in the same linear motion.

    `start_state`, shape (6,), is the chaser's at the start, m and m/s.
    """

    motion: LinearMotion
    targets: MovingTargets
    start_state: Floats
    start_s: float = 0.0

    ruggedness = SMOOTH
    """Small: the path of given times is unique, and the costs of an order's few local minima are close."""

    def fly(self, order: Sequence[int], time_s: ArrayLike) -> LinearPath:
        """Return the path of minimum energy that reaches targets in an `order`, some or all, each once, at N times."""
        return solve_segments(self.motion, self.start_s, self.start_state, nodes_of(self.targets, order, time_s))

    def flyer(self, order: Sequence[int]) -> Callable[[Floats], Path]:
        """Return `fly` for one `order`; the path is unique."""
        return lambda time_s: self.fly(order, time_s)


def nodes_of(targets: MovingTargets, order: Sequence[int], time_s: ArrayLike) -> Nodes:
    """Return the nodes of a path that reaches `targets` in an `order`, first to last, at N times.

    Raises
    ------
    ValueError
        If a target is visited twice, or the number of times is not that of visits.
    """
    which, times = np.asarray(order), np.asarray(time_s, dtype=np.float64)
    if times.shape != which.shape:
        raise ValueError(f"{len(which)} visits need {len(which)} times, found {times.size}")
    if len(set(order)) < len(which):
        raise ValueError("a target is visited twice")
    rendezvous = np.array([targets.targets[index].meet is Meet.RENDEZVOUS for index in order])
    leave_s = times + targets.dwell_s[which]
    if (leave_s == times).all():
        arrive = targets.states(which, times)
        return Nodes(times, times, arrive, arrive, rendezvous)
    states = targets.states(np.concatenate([which, which]), np.concatenate([times, leave_s]))
    return Nodes(times, leave_s, states[: len(times)], states[len(times) :], rendezvous)
