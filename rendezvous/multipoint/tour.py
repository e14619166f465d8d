"""The problem: a chaser that visits moving targets, and the path for given order and times."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rendezvous.multipoint.segments import Flown, Nodes, Path, solve_segments
from rendezvous.multipoint.targets import Meet, MovingTargets, dwells
from rendezvous.relative_motion import LinearMotion

Floats = NDArray[np.float64]

SMOOTH = 4.0 / 3.0


class Visits(Protocol):
    """Targets to be visited from a start, and what finds paths to them."""

    @property
    def targets(self) -> MovingTargets:
        """What is visited."""

    @property
    def start_s(self) -> float:
        """When the chaser starts."""

    @property
    def dwell_s(self) -> Floats:
        """How long the chaser stays with each target, shape (n,)."""

    @property
    def ruggedness(self) -> float:
        """By how many times the local minima that are found of one order may differ: orders are compared with that."""

    def fly(self, order: Sequence[int], time_s: ArrayLike) -> Path:
        """Find the path of least energy to targets in an order at times of shape (N,)."""

    def flyer(self, order: Sequence[int], near: Path | None = None) -> Callable[[Floats], Flown]:
        """Return what finds paths of one order for times asked in turn, the first near a known one."""


@dataclass(frozen=True, eq=False)
class Tour:
    """A chaser and the targets it visits, in linear motion.

    Parameters
    ----------
    motion : LinearMotion
        Of the chaser.
    targets : MovingTargets
    start_state : ndarray, shape (6,)
        The chaser's, m and m/s.
    start_s : float

    Raises
    ------
    ValueError
        If the start is not finite.
    """

    motion: LinearMotion
    targets: MovingTargets
    start_state: Floats
    start_s: float = 0.0

    def __post_init__(self) -> None:
        check_start(self.start_state, self.start_s)

    @property
    def dwell_s(self) -> Floats:
        """How long the chaser stays with each target, shape (n,)."""
        return dwells(self.targets.targets)

    @property
    def ruggedness(self) -> float:
        """Little: paths of given times are unique, and the costs of an order's few local minima near one another."""
        return SMOOTH

    def fly(self, order: Sequence[int], time_s: ArrayLike) -> Path:
        """Find the minimum-energy path.

        Parameters
        ----------
        order : sequence of int
            Which targets, first to last; some or all, each once.
        time_s : array_like, shape (N,)
            When each is reached, in that order.

        Returns
        -------
        Path
        """
        return solve_segments(self.motion, self.start_s, self.start_state, nodes_of(self.targets, order, time_s))

    def flyer(self, order: Sequence[int], near: Path | None = None) -> Callable[[Floats], Flown]:
        """Return what finds the path of times of shape (N,), for one order.

        Parameters
        ----------
        order : sequence of int
        near : Path or None
            Does not count: the path is one.

        Returns
        -------
        callable
        """
        return lambda time_s: self.fly(order, time_s)


def check_start(start_state: Floats, start_s: float) -> None:
    """Refuse a start that is none.

    Parameters
    ----------
    start_state : ndarray, shape (6,)
    start_s : float

    Raises
    ------
    ValueError
        If a number is not finite.
    """
    if np.shape(start_state) != (6,) or not np.isfinite(start_state).all():
        raise ValueError("the chaser's state must be six finite numbers")
    if not np.isfinite(start_s):
        raise ValueError("the start is not finite")


def nodes_of(targets: MovingTargets, order: Sequence[int], time_s: ArrayLike) -> Nodes:
    """Return where and when a path must pass.

    Parameters
    ----------
    targets : MovingTargets
    order : sequence of int
        Which targets, first to last.
    time_s : array_like, shape (N,)
        When each is reached.

    Returns
    -------
    Nodes

    Raises
    ------
    ValueError
        If there is no visit, a visit is of no target, a target is visited twice, or there are not as many times as
        visits.
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
    described = tuple(targets.targets[each] for each in order)
    rendezvous = np.array([each.meet is Meet.RENDEZVOUS for each in described])
    leave_s = times + dwells(described)
    if not rendezvous.any():  # rates and departures do not count
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
