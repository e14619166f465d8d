"""A chaser that visits moving targets, and the path for given order and times."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rendezvous.multipoint.segments import Flown, Nodes, Path, solve_segments
from rendezvous.multipoint.targets import Meet, MovingTargets
from rendezvous.relative_motion import LinearMotion

Floats = NDArray[np.float64]

SMOOTH = 4.0 / 3.0


class Visits(ABC):
    """A chaser's start (`start_s`, `start_state`) and its targets.

    Raises
    ------
    ValueError
        If the start is not finite.
    """

    targets: MovingTargets
    start_state: Floats
    start_s: float = 0.0
    ruggedness: ClassVar[float]
    """Ratio up to which local minima of one order may differ; used to compare orders."""

    def __post_init__(self) -> None:
        if np.shape(self.start_state) != (6,) or not np.isfinite(self.start_state).all():
            raise ValueError("the chaser's state must be six finite numbers")
        if not np.isfinite(self.start_s):
            raise ValueError("the start is not finite")

    @property
    def dwell_s(self) -> Floats:
        """Duration of the stay with each target, shape (n,)."""
        return self.targets.dwell_s

    @abstractmethod
    def fly(self, order: Sequence[int], time_s: ArrayLike) -> Path:
        """Return the path of least energy that reaches targets in an `order`, some or all, each once, at N times."""

    @abstractmethod
    def flyer(self, order: Sequence[int], near: Path | None = None) -> Callable[[Floats], Flown]:
        """Return a function of N times that finds paths of one `order`, the first one near a known path `near`."""


@dataclass(frozen=True, eq=False)
class Tour(Visits):
    """A chaser and the targets it visits, in linear motion.

    Parameters
    ----------
    motion : LinearMotion
        Motion of the chaser.
    targets : MovingTargets
        Targets, in the same motion.
    start_state : ndarray, shape (6,)
        State of the chaser at the start, m and m/s.
    start_s : float
        Time of the start.

    Raises
    ------
    ValueError
        If the start is not finite.
    """

    motion: LinearMotion
    targets: MovingTargets
    start_state: Floats
    start_s: float = 0.0

    ruggedness = SMOOTH
    """Small: the path of given times is unique, and the costs of an order's few local minima are close."""

    def fly(self, order: Sequence[int], time_s: ArrayLike) -> Path:
        """Return the path of least energy that reaches targets in an `order`, some or all, each once, at N times."""
        return solve_segments(self.motion, self.start_s, self.start_state, nodes_of(self.targets, order, time_s))

    def flyer(self, order: Sequence[int], near: Path | None = None) -> Callable[[Floats], Flown]:
        """Return `fly` for one `order`; the path is unique, so `near` has no effect."""
        return lambda time_s: self.fly(order, time_s)


def nodes_of(targets: MovingTargets, order: Sequence[int], time_s: ArrayLike) -> Nodes:
    """Return the nodes of a path that reaches `targets` in an `order`, first to last, at N times.

    Raises
    ------
    ValueError
        If there is no visit, a target does not exist or is visited twice, or the number of times is not that of visits.
    """
    which, times = np.asarray(order), np.asarray(time_s, dtype=np.float64)
    if not len(which) or times.shape != which.shape:
        raise ValueError(f"{len(which)} visits need {len(which)} times, at least one; found {times.size}")
    if which.dtype.kind not in "iu" or which.min() < 0 or which.max() >= len(targets.targets):
        raise ValueError(f"order must hold numbers of targets, from 0 to {len(targets.targets) - 1}: found {order!r}")
    if len(set(order)) < len(which):
        raise ValueError("a target is visited twice")
    if not np.isfinite(times).all():
        raise ValueError("a time is not finite")
    rendezvous = np.array([targets.targets[index].meet is Meet.RENDEZVOUS for index in order])
    leave_s = times + targets.dwell_s[which]
    if not rendezvous.any():  # rates and departures are not used
        arrive = targets.states(which, times)
        return Nodes(times, times, arrive, arrive, arrive, arrive, rendezvous)
    if (leave_s == times).all():
        arrive = targets.states(which, times)
        rate = targets.rates(times, arrive)
        return Nodes(times, times, arrive, arrive, rate, rate, rendezvous)
    both, count = np.concatenate([times, leave_s]), len(times)
    states = targets.states(np.concatenate([which, which]), both)
    rates = targets.rates(both, states)
    return Nodes(times, leave_s, states[:count], states[count:], rates[:count], rates[count:], rendezvous)
