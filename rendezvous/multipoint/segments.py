"""Fixed times and order: the minimum-energy path through the nodes, segment by segment, in O(N)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from rendezvous.multipoint._path import solve_path
from rendezvous.relative_motion import LinearMotion, TimeVaryingMotion

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Nodes:
    """States through which a path must pass, and their times, in order.

    Parameters
    ----------
    arrive_s, leave_s : ndarray, shape (N,)
        Times of arrival and departure; equal if the chaser does not stay with the target.
    arrive, leave : ndarray, shape (N, 6)
        States of the targets at these times.
    arrive_rate, leave_rate : ndarray, shape (N, 6)
        Their time derivatives.
    rendezvous : ndarray of bool, shape (N,)
        Whether the velocities must also agree.
    """

    arrive_s: Floats
    leave_s: Floats
    arrive: Floats
    leave: Floats
    arrive_rate: Floats
    leave_rate: Floats
    rendezvous: Flags


class NotSettledError(ValueError):
    """No path of least energy was found; one may still exist."""


class Flown(Protocol):
    """The properties of a path that the choice of times uses."""

    @property
    def nodes(self) -> Nodes:
        """Nodes of the path."""

    @property
    def cost(self) -> float:
        """I = 1/2 int |u|^2 dt, m^2/s^3."""

    @property
    def time_gradient(self) -> Floats:
        """Slopes dI / dt_i, shape (N,)."""

    def settled(self) -> Path:
        """Return the complete path."""


@dataclass(frozen=True, eq=False)
class Path:
    """The minimum-energy path through nodes.

    Parameters
    ----------
    motion : LinearMotion
        Motion of the chaser.
    nodes : Nodes
        N nodes.
    cost : float
        I = 1/2 int |u|^2 dt, m^2/s^3.
    starts_s : ndarray, shape (N,)
        Start of each segment.
    start_states, arrival_states : ndarray, shape (N, 6)
        The chaser's states at the start of each segment and at each node.
    costate_before, costate_after : ndarray, shape (N, 6)
        lambda at the end of each segment, and at the start of the next one; zeros after the last.
    costate_start : ndarray, shape (6,)
        lambda at the start.
    time_gradient : ndarray, shape (N,)
        dI / dt_i.
    """

    motion: LinearMotion
    nodes: Nodes
    cost: float
    starts_s: Floats
    start_states: Floats
    arrival_states: Floats
    costate_before: Floats
    costate_after: Floats
    costate_start: Floats
    time_gradient: Floats

    @property
    def jumps(self) -> Floats:
        """Costate before minus costate after, shape (N, 6): dI / d(target's state); zero in the velocity of a flyby."""
        return self.costate_before - self.costate_after

    def settled(self) -> Path:
        """Return the path itself."""
        return self

    def costate(self, time_s: Floats) -> Floats:
        """Return lambda (m/s^3, m/s^2), shape (k, 6), at k times: after the jump at a node, zero during a stay.

        Notes
        -----
        From the end of each segment where the motion has a closed form; else together with the states.
        """
        if isinstance(self.motion, TimeVaryingMotion):
            return self.along(time_s)[1]
        times = np.asarray(time_s, dtype=np.float64)
        which, moving = self._segment_of(times)
        back = self.motion.transition(times, np.where(moving, self.nodes.arrive_s[which], times))
        return np.asarray(np.where(moving[:, None], np.einsum("kba,kb->ka", back, self.costate_before[which]), 0.0))

    def control(self, time_s: Floats) -> Floats:
        """Return u = B' lambda, m/s^2, shape (k, 3), at k times."""
        return np.asarray(np.einsum("kai,ka->ki", self.motion.input_map(time_s), self.costate(time_s)))

    def breaks(self) -> Floats:
        """Return times, s, not decreasing, between which the control is smooth and turns by about a radian."""
        legs = zip(self.starts_s, self.nodes.arrive_s, strict=True)
        return np.concatenate([self.motion.breaks(float(start), float(end)) for start, end in legs])

    def state(self, time_s: Floats) -> Floats:
        """Return the chaser's states, shape (k, 6), at k times."""
        return self.along(time_s)[0]

    def along(self, time_s: Floats) -> tuple[Floats, Floats]:
        """Return states and costates, shapes (k, 6), at k times from the start to the last node.

        Notes
        -----
        States are propagated from one time to the next, because long intervals of a time-varying motion are expensive.
        """
        times = np.asarray(time_s, dtype=np.float64)
        which, moving = self._segment_of(times)
        states, costates = np.empty((len(times), 6)), np.zeros((len(times), 6))
        order = np.argsort(times, kind="stable")
        for segment in np.unique(which):
            members = order[which[order] == segment]
            flying, staying = members[moving[members]], members[~moving[members]]
            end = float(self.nodes.arrive_s[segment])
            if len(flying):
                start, last = self.start_states[segment], self.costate_before[segment]
                grid = np.concatenate([[self.starts_s[segment]], times[flying], [end]])
                states[flying], costates[flying] = _carried(self.motion, grid, start, last)
            if len(staying):  # coasting with a target, from the arrival there
                grid = np.concatenate([[end], times[staying], times[staying[-1:]]])
                states[staying] = _carried(self.motion, grid, self.arrival_states[segment], np.zeros(6))[0]
        return states, costates

    def _segment_of(self, time_s: Floats) -> tuple[NDArray[np.intp], Flags]:
        """The segment of each time, and whether the chaser is in motion to its end rather than staying there."""
        which = np.searchsorted(self.nodes.leave_s, time_s, side="right")
        last = len(self.nodes.leave_s) - 1
        ended = (which > last) & (time_s <= self.nodes.arrive_s[last])
        which = np.minimum(which, last)
        return which, (time_s < self.nodes.arrive_s[which]) | ended


def solve_segments(motion: LinearMotion, start_s: float, start_state: Floats, nodes: Nodes) -> Path:
    """Find the minimum-energy path of a `motion` from the `start_state` (m, m/s) through `nodes`.

    Raises
    ------
    ValueError
        If times do not increase.
    NotSettledError
        If the numbers overflow, or a Gramian is singular in floating point.

    Notes
    -----
    Unknowns are the velocities at flybys. The cost is the sum of 1/2 |L_k^-1 e_k|^2, e_k = x_k - Phi_k x_(k-1) - d_k,
    with L_k the Cholesky factor of the Gramian, in states divided by (T, T, T, 1, 1, 1): a least-squares problem whose
    normal equations are symmetric positive definite with 3 x 3 blocks on three diagonals. In contrast to R13 in the
    paper's elimination, no inverted block is singular in a well-posed problem. O(N) time and memory.
    """
    starts = np.concatenate([[start_s], nodes.leave_s[:-1]])
    durations = nodes.arrive_s - starts
    check_times(start_s, nodes.arrive_s, nodes.leave_s)
    segment = motion.segment(starts, nodes.arrive_s)
    arrive, begin = nodes.arrive.copy(), np.concatenate([start_state[None], nodes.leave[:-1]])
    before, at_start, after = np.empty_like(arrive), np.empty_like(arrive), np.zeros_like(arrive)
    blocks = segment.transition, segment.gramian, segment.drift
    solved, cost = solve_path(*blocks, durations, begin, arrive, nodes.rendezvous, before, at_start)
    if not solved or not np.isfinite(cost):
        raise NotSettledError(
            "the numbers of the path overflow, or a segment is too short or too long for its Gramian; check the units"
        )
    after[:-1] = at_start[1:]
    gradient = _time_gradient(motion, nodes, arrive, before, after)
    return Path(motion, nodes, cost, starts, begin, arrive, before, after, at_start[0], gradient)


def _carried(motion: LinearMotion, grid: Floats, start: Floats, costate_end: Floats) -> tuple[Floats, Floats]:
    """States and costates at the inner times of a grid, from the state at its start and the costate at its end."""
    segment = motion.segment(grid[:-1], grid[1:])
    count = len(grid) - 2
    states, costates = np.empty((count, 6)), np.empty((count, 6))
    costate, state = costate_end, start
    for index in range(count - 1, -1, -1):
        costate = segment.transition[index + 1].T @ costate
        costates[index] = costate
    for index in range(count):
        state = segment.transition[index] @ state + segment.drift[index] + segment.gramian[index] @ costates[index]
        states[index] = state
    return states, costates


def check_times(start_s: float, arrive_s: Floats, leave_s: Floats) -> None:
    """Check that the times of the start, of arrivals and of departures increase.

    Raises
    ------
    ValueError
        If one is not finite, or not after the previous one.
    """
    if not (np.isfinite(start_s) and np.isfinite(arrive_s).all() and np.isfinite(leave_s).all()):
        raise ValueError("a time is not finite")
    before = np.concatenate([[start_s], leave_s[:-1]])
    late = np.flatnonzero(~(arrive_s > before))
    if len(late):
        index = int(late[0])
        limit = (
            f"{before[index]:g} s, when the chaser leaves the one before" if index else f"the start at {start_s:g} s"
        )
        raise ValueError(f"times must increase: visit {index + 1} is at {arrive_s[index]:g} s, not after {limit}")


def _time_gradient(motion: LinearMotion, nodes: Nodes, arrive: Floats, before: Floats, after: Floats) -> Floats:
    """dI/dt: D'(V_i - V) at a flyby, H(t+) - H(t-) + (lambda- - lambda+)' x_i' at a rendezvous."""
    gradient: Floats = ((before - after)[:, :3] * (nodes.arrive[:, 3:] - arrive[:, 3:])).sum(axis=1)
    met = nodes.rendezvous
    if met.any():
        times = np.concatenate([nodes.arrive_s[met], nodes.leave_s[met]])
        states = np.concatenate([nodes.arrive[met], nodes.leave[met]])
        rates = np.concatenate([nodes.arrive_rate[met], nodes.leave_rate[met]])
        costates = np.concatenate([before[met], after[met]])
        sides = _hamiltonian(motion, times, states, costates) - (costates * rates).sum(axis=1)
        gradient[met] = sides[len(sides) // 2 :] - sides[: len(sides) // 2]
    return gradient


def _hamiltonian(motion: LinearMotion, times: Floats, states: Floats, costates: Floats) -> Floats:
    control = (costates[:, None, :] @ motion.input_map(times))[:, 0]
    return np.asarray((costates * motion.rates(times, states)).sum(axis=1) + 0.5 * (control**2).sum(axis=1))
