"""Fixed times and order: the minimum-energy path through the nodes, segment by segment, in O(N)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from rendezvous._arrays import Flags, Floats, Integers
from rendezvous._compile import compiled
from rendezvous.relative_motion import LinearMotion, TimeVaryingMotion


@dataclass(frozen=True, eq=False)
class Nodes:
    """States through which a path must pass, and their times, in order.

    `arrive` and `leave`, shape (N, 6), are the targets' states at the arrivals and departures, `arrive_s` and
    `leave_s`, shape (N,), which are equal if the chaser does not stay; `arrive_rate` and `leave_rate` are their time
    derivatives. `rendezvous`, shape (N,), says whether the velocities must also agree.
    """

    arrive_s: Floats
    leave_s: Floats
    arrive: Floats
    leave: Floats
    arrive_rate: Floats
    leave_rate: Floats
    rendezvous: Flags


class NotSettledError(ValueError):
    """No path of minimum energy was found; one may still exist."""


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

    def _segment_of(self, time_s: Floats) -> tuple[Integers, Flags]:
        """The segment of each time, and whether the chaser is in motion to its end rather than staying there."""
        which = np.searchsorted(self.nodes.leave_s, time_s, side="right")
        last = len(self.nodes.leave_s) - 1
        ended = (which > last) & (time_s <= self.nodes.arrive_s[last])
        which = np.minimum(which, last)
        return which, (time_s < self.nodes.arrive_s[which]) | ended


def solve_segments(motion: LinearMotion, start_s: float, start_state: Floats, nodes: Nodes) -> Path:
    """Find the minimum-energy path of a `motion` from the `start_state` (m, m/s) through `nodes`.

    Unknowns are the velocities at flybys. The cost is the sum of 1/2 |L_k^-1 e_k|^2, e_k = x_k - Phi_k x_(k-1) - d_k,
    with L_k the Cholesky factor of the Gramian, in states divided by (T, T, T, 1, 1, 1): a least-squares problem whose
    normal equations are symmetric positive definite with 3 x 3 blocks on three diagonals. In contrast to R13 in the
    paper's elimination, no inverted block is singular in a well-posed problem. O(N) time and memory.

    Raises
    ------
    ValueError
        If times do not increase.
    NotSettledError
        If the numbers overflow, or a Gramian is singular in floating point.
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
    """Raise `ValueError` unless the times of the start, of arrivals and of departures are finite and increase."""
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


@compiled
def factor(matrix: Floats, lower: Floats) -> bool:
    """Fill the Cholesky factor; False if the matrix is not positive definite."""
    size = len(matrix)
    for row in range(size):
        for column in range(row + 1):
            value = matrix[row, column]
            for inner in range(column):
                value -= lower[row, inner] * lower[column, inner]
            if row == column:
                if not value > 0.0:
                    return False
                lower[row, row] = np.sqrt(value)
            else:
                lower[row, column] = value / lower[column, column]
    return True


@compiled
def whiten(lower: Floats, columns: Floats) -> None:
    """Multiply by the inverse of a lower triangle, in place; `columns` has shape (size, m)."""
    for column in range(columns.shape[1]):
        for row in range(len(lower)):
            value = columns[row, column]
            for inner in range(row):
                value -= lower[row, inner] * columns[inner, column]
            columns[row, column] = value / lower[row, row]


@compiled
def whiten_back(lower: Floats, columns: Floats) -> None:
    """Multiply by the inverse of its transpose, in place."""
    for column in range(columns.shape[1]):
        for row in range(len(lower) - 1, -1, -1):
            value = columns[row, column]
            for inner in range(row + 1, len(lower)):
                value -= lower[inner, row] * columns[inner, column]
            columns[row, column] = value / lower[row, row]


@compiled
def solve_path(
    transition: Floats,
    gramian: Floats,
    drift: Floats,
    durations: Floats,
    begin: Floats,
    arrive: Floats,
    pinned: Flags,
    before: Floats,
    at_start: Floats,
) -> tuple[bool, float]:
    """Solve for the velocities at flybys (in `begin`, `arrive`) and the costates `before` and `at_start` of N segments.

    Transitions, Gramians, drifts and durations are those of the segments, begin and arrive their states at both ends;
    `pinned` says whether the velocity at the end is given. Returns whether all blocks are positive definite, and I;
    otherwise the outputs are invalid.

    y_k = L_k^-1 S_k^-1 (x_k - Phi_k x_(k-1) - d_k) with S = (T, T, T, 1, 1, 1); ahead and behind are its slopes along
    the velocities at the end and, negated, at the start. Normal equations by blocks of 3, factored as they are built.
    """
    count = len(durations)
    lower = np.zeros((count, 6, 6))
    ahead, behind, effort = np.zeros((count, 6, 3)), np.zeros((count, 6, 3)), np.zeros((count, 6, 1))
    scaled = np.empty((6, 6))
    for k in range(count):
        for row in range(6):
            by = durations[k] if row < 3 else 1.0
            for column in range(6):
                scaled[row, column] = gramian[k, row, column] / (by * (durations[k] if column < 3 else 1.0))
            value = -drift[k, row]
            if row < 3 or pinned[k]:
                value += arrive[k, row]
            for column in range(6):
                if column < 3 or k == 0 or pinned[k - 1]:
                    value -= transition[k, row, column] * begin[k, column]
            effort[k, row, 0] = value / by
            for column in range(3):
                behind[k, row, column] = transition[k, row, 3 + column] / by
        for axis in range(3):
            ahead[k, 3 + axis, axis] = 1.0
        if not factor(scaled, lower[k]):
            return False, 0.0
        whiten(lower[k], effort[k])
        whiten(lower[k], ahead[k])
        whiten(lower[k], behind[k])
    velocities = np.zeros((count, 3))
    if not _eliminate(ahead, behind, effort, pinned, velocities):
        return False, 0.0
    cost = 0.0
    for k in range(count):
        for row in range(6):
            value = effort[k, row, 0]
            for column in range(3):
                value += ahead[k, row, column] * velocities[k, column]
                if k > 0:
                    value -= behind[k, row, column] * velocities[k - 1, column]
            effort[k, row, 0] = value
            cost += 0.5 * value * value
        whiten_back(lower[k], effort[k])
        for row in range(6):
            before[k, row] = effort[k, row, 0] / (durations[k] if row < 3 else 1.0)
        for row in range(6):
            value = 0.0
            for column in range(6):
                value += transition[k, column, row] * before[k, column]
            at_start[k, row] = value
        if not pinned[k]:
            for axis in range(3):
                arrive[k, 3 + axis] = velocities[k, axis]
                if k + 1 < count:
                    begin[k + 1, 3 + axis] = velocities[k, axis]
    return True, cost


@compiled
def _eliminate(ahead: Floats, behind: Floats, effort: Floats, pinned: Flags, velocities: Floats) -> bool:
    """Solve the block-tridiagonal normal equations; given velocities stay zero."""
    count = len(effort)
    lower, coupled = np.zeros((count, 3, 3)), np.zeros((count, 3, 3))
    right, block = np.zeros((count, 3, 1)), np.zeros((3, 3))
    for k in range(count):
        for first in range(3):
            value = 0.0
            for row in range(6):
                value -= ahead[k, row, first] * effort[k, row, 0]
                if k + 1 < count:
                    value += behind[k + 1, row, first] * effort[k + 1, row, 0]
            right[k, first, 0] = value
            for second in range(3):
                value = 0.0
                for row in range(6):
                    value += ahead[k, row, first] * ahead[k, row, second]
                    if k + 1 < count:
                        value += behind[k + 1, row, first] * behind[k + 1, row, second]
                block[first, second] = value
        if pinned[k]:
            for axis in range(3):
                right[k, axis, 0] = 0.0
                lower[k, axis, axis] = 1.0
            continue
        if k > 0 and not pinned[k - 1]:
            # coupled = L_(k-1)^-1 times the block above the diagonal.
            for first in range(3):
                for second in range(3):
                    value = 0.0
                    for row in range(6):
                        value -= behind[k, row, first] * ahead[k, row, second]
                    coupled[k, first, second] = value
            whiten(lower[k - 1], coupled[k])
            for first in range(3):
                for inner in range(3):
                    right[k, first, 0] -= coupled[k, inner, first] * right[k - 1, inner, 0]
                    for second in range(3):
                        block[first, second] -= coupled[k, inner, first] * coupled[k, inner, second]
        if not factor(block, lower[k]):
            return False
        whiten(lower[k], right[k])
    for k in range(count - 1, -1, -1):
        if k + 1 < count:
            for first in range(3):
                for second in range(3):
                    right[k, first, 0] -= coupled[k + 1, first, second] * right[k + 1, second, 0]
        whiten_back(lower[k], right[k])
        for axis in range(3):
            velocities[k, axis] = right[k, axis, 0]
    return True
