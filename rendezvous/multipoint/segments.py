"""Fixed times and order: the minimum-energy path through the nodes, segment by segment, in O(N)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solveh_banded

from infoset.rendezvous._arrays import Flags, Floats, Integers
from infoset.rendezvous.bounded_control import power
from infoset.rendezvous.relative_motion import LinearMotion
from infoset.rendezvous.relative_motion.linear_motion import state_scales


@dataclass(frozen=True, eq=False)
class Nodes:
    """States through which a path must pass, and their times, in order.

    `arrive` and `leave`, shape (N, 6), are the targets' states at the arrivals and departures,
    `arrive_s` and `leave_s`, shape (N,), which are equal if the chaser does not stay. `rendezvous`,
    shape (N,), says whether the velocities must also agree.
    """

    arrive_s: Floats
    leave_s: Floats
    arrive: Floats
    leave: Floats
    rendezvous: Flags


class NotSettledError(ValueError):
    """No path of minimum energy was found; one may still exist."""


@dataclass(frozen=True, eq=False)
class Path(ABC):
    """The minimum-energy path through N nodes.

    Parameters
    ----------
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
        dI / dt_i by the arrival at node i; a departure moves with the arrival before it.
    """

    nodes: Nodes
    cost: float
    starts_s: Floats
    start_states: Floats
    arrival_states: Floats
    costate_before: Floats
    costate_after: Floats
    costate_start: Floats
    time_gradient: Floats

    @abstractmethod
    def along(self, time_s: Floats) -> tuple[Floats, Floats]:
        """Return states and costates, shapes (k, 6), at k times from the start to the last node."""

    @abstractmethod
    def breaks(self) -> Floats:
        """Return times, s, not decreasing; the control turns by about a radian between them."""

    @property
    def jumps(self) -> Floats:
        """Costate before minus costate after, shape (N, 6).

        Without a stay at the node it is dI / d(target's state). It is zero in the velocity of a
        flyby.
        """
        return self.costate_before - self.costate_after

    def costate(self, time_s: Floats) -> Floats:
        """Return lambda (m/s^3, m/s^2), shape (k, 6), at k times.

        At a node it is the value after the jump, at the last one before it; it is zero during a
        stay, also at its beginning.
        """
        return self.along(time_s)[1]

    def control(self, time_s: Floats) -> Floats:
        """Return u = B' lambda, m/s^2, shape (k, 3), at k times."""
        return self.costate(time_s)[:, 3:]

    def state(self, time_s: Floats) -> Floats:
        """Return the chaser's states, shape (k, 6), at k times."""
        return self.along(time_s)[0]


@dataclass(frozen=True, eq=False)
class LinearPath(Path):
    """A path of a linear motion."""

    motion: LinearMotion

    def breaks(self) -> Floats:
        """Return times, s, not decreasing; the control turns by about a radian between them."""
        legs = zip(self.starts_s, self.nodes.arrive_s, strict=True)
        return np.concatenate([self.motion.breaks(float(start), float(end)) for start, end in legs])

    def along(self, time_s: Floats) -> tuple[Floats, Floats]:
        """Return states and costates, shapes (k, 6), at k times from the start to the last node.

        States are propagated from one time to the next, because long intervals of a time-varying
        motion are expensive.
        """
        times = np.asarray(time_s, dtype=np.float64)
        which, moving = self._segment_of(times)
        states = np.empty((len(times), 6))
        costates = np.zeros((len(times), 6))
        order = np.argsort(times, kind="stable")
        for segment in np.unique(which):
            members = order[which[order] == segment]
            flying = members[moving[members]]
            staying = members[~moving[members]]
            end = float(self.nodes.arrive_s[segment])
            if len(flying):
                start = self.start_states[segment]
                last = self.costate_before[segment]
                grid = np.concatenate([[self.starts_s[segment]], times[flying], [end]])
                states[flying], costates[flying] = _carried(self.motion, grid, start, last)
            if len(staying):
                # Coasting with a target, from the arrival there. The last time is repeated, because
                # `_carried` leaves out both ends.
                grid = np.concatenate([[end], times[staying], times[staying[-1:]]])
                states[staying] = _carried(
                    self.motion, grid, self.arrival_states[segment], np.zeros(6)
                )[0]
        return states, costates

    def _segment_of(self, time_s: Floats) -> tuple[Integers, Flags]:
        """Return the segment of each time, and whether the chaser moves in it or stays."""
        which = np.searchsorted(self.nodes.leave_s, time_s, side="right")
        last = len(self.nodes.leave_s) - 1
        # The path ends at the arrival at the last node, which belongs to the motion before it.
        ended = (which > last) & (time_s <= self.nodes.arrive_s[last])
        which = np.minimum(which, last)
        return which, (time_s < self.nodes.arrive_s[which]) | ended


def solve_segments(
    motion: LinearMotion, start_s: float, start_state: Floats, nodes: Nodes
) -> LinearPath:
    """Find the minimum-energy path of a `motion` from the `start_state` (m, m/s) through `nodes`.

    Unknowns are the velocities at flybys. The cost is the sum of 1/2 |L_k^-1 e_k|^2, e_k = x_k -
    Phi_k x_(k-1), with L_k the Cholesky factor of the Gramian, in states divided by (T, T, T, 1, 1,
    1): a least-squares problem whose normal equations are symmetric positive definite with 3 x 3
    blocks on three diagonals. In contrast to R13 in the paper's elimination, no inverted block is
    singular in a well-posed problem. O(N) time and memory.

    Raises
    ------
    ValueError
        If times do not increase.
    NotSettledError
        If the numbers overflow, or a Gramian is singular in floating point.
    """
    check_times(start_s, nodes.arrive_s, nodes.leave_s)
    starts = np.concatenate([[start_s], nodes.leave_s[:-1]])
    segment = motion.segment(starts, nodes.arrive_s)
    scale = state_scales(nodes.arrive_s - starts)
    arrive = nodes.arrive.copy()
    begin = np.concatenate([start_state[None], nodes.leave[:-1]])
    free = ~nodes.rendezvous
    arrive[free, 3:] = begin[1:][free[:-1], 3:] = 0.0  # the unknowns
    missing = (arrive - (segment.transition @ begin[:, :, None])[:, :, 0]) / scale
    try:
        lower = np.linalg.cholesky(segment.gramian / (scale[:, :, None] * scale[:, None, :]))
        # Effects of the velocity at the end of each segment, and of that at its start.
        slopes = (
            np.broadcast_to(np.eye(6)[:, 3:], (len(starts), 6, 3)),
            segment.transition[:, :, 3:] / scale[:, :, None],
        )
        whitened = np.linalg.solve(lower, np.concatenate([missing[:, :, None], *slopes], axis=2))
        effort = whitened[:, :, 0]
        ahead = whitened[:, :, 1:4]
        behind = whitened[:, :, 4:]
        velocities = _velocities(effort, ahead, behind, free)
    except (np.linalg.LinAlgError, ValueError):  # ValueError: a number is not finite
        raise NotSettledError(
            "the numbers of the path overflow, or a segment is too short or too long for its "
            "Gramian; check the units"
        ) from None
    effort = effort + np.einsum("kij,kj->ki", ahead, velocities)
    effort[1:] -= np.einsum("kij,kj->ki", behind[1:], velocities[:-1])
    before = np.linalg.solve(np.swapaxes(lower, 1, 2), effort[:, :, None])[:, :, 0] / scale
    at_start = np.einsum("kji,kj->ki", segment.transition, before)
    after = np.concatenate([at_start[1:], np.zeros((1, 6))])
    arrive[free, 3:] = velocities[free]
    # The segment after a flyby starts with the velocity at it.
    begin[1:][free[:-1], 3:] = velocities[:-1][free[:-1]]
    cost = 0.5 * float((effort**2).sum())
    gradient = time_gradient(nodes, arrive, before, after)
    return LinearPath(
        nodes, cost, starts, begin, arrive, before, after, at_start[0], gradient, motion
    )


def _velocities(effort: Floats, ahead: Floats, behind: Floats, free: Flags) -> Floats:
    """Minimise sum |effort_k + ahead_k v_k - behind_k v_(k-1)|^2 over the free velocities v_k.

    The other velocities are zero. The normal equations have 3 x 3 blocks on three diagonals: a
    banded matrix, shape (6, 3 N), of the lower diagonals. Row d has the entries d below the main
    diagonal, by their columns.
    """
    diagonal = np.einsum("kra,krb->kab", ahead, ahead)
    diagonal[:-1] += np.einsum("kra,krb->kab", behind[1:], behind[1:])
    right = -np.einsum("kra,kr->ka", ahead, effort)
    right[:-1] += np.einsum("kra,kr->ka", behind[1:], effort[1:])
    below = -np.einsum("kra,krb->kab", ahead[1:], behind[1:])
    # Equations v_k = 0 for the velocities that are not free.
    diagonal[~free] = np.eye(3)
    right[~free] = 0.0
    below[~(free[1:] & free[:-1])] = 0.0
    band = np.zeros((6, len(effort), 3))
    for row in range(3):
        for column in range(3):
            band[3 + row - column, :-1, column] = below[:, row, column]
            if row >= column:
                band[row - column, :, column] = diagonal[:, row, column]
    return np.asarray(solveh_banded(band.reshape(6, -1), right.ravel(), lower=True).reshape(-1, 3))


def _carried(
    motion: LinearMotion, grid: Floats, start: Floats, costate_end: Floats
) -> tuple[Floats, Floats]:
    """Return states and costates at the inner times of a grid.

    They follow from the state at its start and the costate at its end. The times do not decrease.
    A state is Phi x + G lambda, with x the state before and lambda the costate at its own time.
    """
    segment = motion.segment(grid[:-1], grid[1:])
    count = len(grid) - 2
    states = np.empty((count, 6))
    costates = np.empty((count, 6))
    costate = costate_end
    state = start
    for index in range(count - 1, -1, -1):
        costate = segment.transition[index + 1].T @ costate
        costates[index] = costate
    for index in range(count):
        state = segment.transition[index] @ state + segment.gramian[index] @ costates[index]
        states[index] = state
    return states, costates


def check_times(start_s: float, arrive_s: Floats, leave_s: Floats) -> None:
    """Raise `ValueError` unless all times are finite and each arrival is after what comes before.

    That is the start, or the departure from the node before. A departure is not compared with its
    arrival.
    """
    if not (np.isfinite(start_s) and np.isfinite(arrive_s).all() and np.isfinite(leave_s).all()):
        raise ValueError("a time is not finite")
    before = np.concatenate([[start_s], leave_s[:-1]])
    late = np.flatnonzero(~(arrive_s > before))
    if len(late):
        index = int(late[0])
        limit = (
            f"{before[index]:g} s, when the chaser leaves the one before"
            if index
            else f"the start at {start_s:g} s"
        )
        raise ValueError(
            f"times must increase: visit {index + 1} is at {arrive_s[index]:g} s, not after {limit}"
        )


def time_gradient(
    nodes: Nodes, arrive: Floats, before: Floats, after: Floats, max_m_s2: float = np.inf
) -> Floats:
    """Return dI/dt, shape (N,), from states and costates at the nodes.

    The states of the chaser and its costates before and after the nodes have shape (N, 6). D'(V_i -
    V) at a flyby, with D the jump of the position's costate and V_i the target's velocity. H(t+) -
    H(t-) + (lambda- - lambda+)' x_i' at a rendezvous: as the target coasts in the dynamics of the
    chaser, this is the power lambda_V' u - 1/2 |u|^2, after minus before; 1/2 |u|^2 below the
    bound.
    """
    flyby = ((before - after)[:, :3] * (nodes.arrive[:, 3:] - arrive[:, 3:])).sum(axis=1)
    sizes_before, sizes_after = (
        np.linalg.norm(costates[:, 3:], axis=1) for costates in (before, after)
    )
    change = power(sizes_after, max_m_s2) - power(sizes_before, max_m_s2)
    return np.asarray(np.where(nodes.rendezvous, change, flyby))
