"""Moving targets, a chaser that visits them, and the path for given order and times."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from infoset.rendezvous._arrays import Floats, Integers
from infoset.rendezvous.multipoint.segments import LinearPath, Nodes, Path, solve_segments
from infoset.rendezvous.relative_motion import LinearMotion

SMOOTH = 4.0 / 3.0
"""Ratio of the costs of the local minima of an order in linear motion; chosen, see `ruggedness`."""


class Meet(Enum):
    """Kind of a visit."""

    FLYBY = "flyby"
    """At its position, with any velocity."""
    RENDEZVOUS = "rendezvous"
    """At its position, with its velocity."""


@dataclass(frozen=True)
class TourTarget:
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


class Visits(ABC):
    """Moving targets, and the start of a chaser that visits them, in one dynamics.

    The chaser starts in `start_state` at `start_s`.

    Raises
    ------
    ValueError
        If two targets have the same name.
    """

    targets: tuple[TourTarget, ...]
    start_state: Floats
    start_s: float = 0.0
    ruggedness: ClassVar[float]
    """Ratio up to which local minima of one order may differ; used to compare orders."""

    def __post_init__(self) -> None:
        if len({target.name for target in self.targets}) < len(self.targets):
            raise ValueError("two targets have the same name; each target is visited once")

    @property
    def dwell_s(self) -> Floats:
        """Duration of the stay with each target, shape (n,)."""
        return np.array([target.dwell_s for target in self.targets])

    @abstractmethod
    def target_states(self, which: Integers, time_s: Floats) -> Floats:
        """States, m and m/s, of the k targets numbered `which` at k times, shape (k, 6)."""

    @abstractmethod
    def flyer(self, order: Sequence[int]) -> Callable[[Floats], Path]:
        """Return `fly` for one `order` as a function of N times.

        The function may store the last paths, to find the next ones faster.
        """

    def fly(self, order: Sequence[int], time_s: ArrayLike) -> Path:
        """Return the path of minimum energy that reaches targets in an `order` at N times.

        Some targets or all are visited, each once. `ValueError` is raised if times do not increase;
        other errors are those of `flyer`.
        """
        return self.flyer(order)(np.asarray(time_s, dtype=np.float64))

    def nodes(self, order: Sequence[int], time_s: Floats) -> Nodes:
        """Return the nodes of a path that reaches targets in an `order`, first to last, at N times.

        Raises
        ------
        ValueError
            If a target is visited twice, or the number of times is not that of visits.
        """
        which = np.asarray(order)
        if time_s.shape != which.shape:
            raise ValueError(f"{len(which)} visits need {len(which)} times, found {time_s.size}")
        if len(set(order)) < len(which):
            raise ValueError("a target is visited twice")
        rendezvous = np.array([self.targets[index].meet is Meet.RENDEZVOUS for index in order])
        leave_s = time_s + self.dwell_s[which]
        arrive = self.target_states(which, time_s)
        leave = arrive if (leave_s == time_s).all() else self.target_states(which, leave_s)
        return Nodes(time_s, leave_s, arrive, leave, rendezvous)


@dataclass(frozen=True, eq=False)
class Tour(Visits):
    """A chaser and the targets it visits, in the same linear motion.

    `initial`, shape (n, 6), are the states of the targets at t = 0, and `start_state`, shape (6,),
    is the chaser's at the start, m and m/s.
    """

    motion: LinearMotion
    targets: tuple[TourTarget, ...]
    initial: Floats
    start_state: Floats
    start_s: float = 0.0

    ruggedness = SMOOTH
    """Small: the path of given times is unique, and the costs of an order's few local minima are
    close.
    """

    def target_states(self, which: Integers, time_s: Floats) -> Floats:
        """States, m and m/s, of the k targets numbered `which` at k times, shape (k, 6)."""
        coasted = (
            self.motion.transition(np.zeros(time_s.shape), time_s) @ self.initial[which][:, :, None]
        )
        return np.asarray(coasted[:, :, 0])

    def flyer(self, order: Sequence[int]) -> Callable[[Floats], LinearPath]:
        """Return `fly` for one `order`; the path is unique."""
        return lambda time_s: solve_segments(
            self.motion, self.start_s, self.start_state, self.nodes(order, time_s)
        )
