"""A first trajectory far from the coasting orbit: the nonlinear conditions, followed as targets move away from it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rendezvous.multipoint._hamiltonian import propagate
from rendezvous.multipoint.segments import Nodes, Path

Floats = NDArray[np.float64]

TOLERANCE = 1e-11
ON_THE_WAY = 1e-4
ROUNDING = 1e-8
"""What is left and falls no more is rounding, if it is less than this."""
LEAST_STEP = 1.0 / 64.0
LEAST_STEP_FROM_NEAR = 1.0 / 8.0
_ROUNDS = 12
_FAST = 0.2
_GREATEST_CORRECTION = 0.5
_FIRST_STEP = 0.3
_NONE: Floats = np.zeros((12, 0))


@dataclass(frozen=True, eq=False)
class Block:
    """Visits up to the next rendezvous, with what is known of their start.

    Parameters
    ----------
    start_s : float
    start_state : ndarray, shape (6,)
    time_s : ndarray, shape (k,)
    goal : ndarray, shape (k, 6)
        States of the targets.
    rendezvous : bool
        Whether the last one is.
    """

    start_s: float
    start_state: Floats
    time_s: Floats
    goal: Floats
    rendezvous: bool


def blocks_of(start_s: float, start_state: Floats, nodes: Nodes) -> list[Block]:
    """Split visits after every rendezvous: what follows starts from a known state."""
    blocks, first = [], 0
    for node in range(len(nodes.arrive_s)):
        if nodes.rendezvous[node] or node == len(nodes.arrive_s) - 1:
            own = slice(first, node + 1)
            blocks.append(
                Block(start_s, start_state, nodes.arrive_s[own], nodes.arrive[own], bool(nodes.rendezvous[node]))
            )
            start_s, start_state, first = float(nodes.leave_s[node]), nodes.leave[node], node + 1
    return blocks


def unknowns_of(path: Path, gravitational_parameter_m3_s2: float) -> list[Floats]:
    """Return the unknowns of each block of a known path."""
    found, first = [], 0
    for block in blocks_of(float(path.starts_s[0]), path.start_states[0], path.nodes):
        length, duration = _units(block, gravitational_parameter_m3_s2)
        scale = np.array([length / duration**3] * 3 + [length / duration**2] * 3)
        start = path.costate_start if first == 0 else path.costate_after[first - 1]
        last = first + len(block.time_s) - 1
        found.append(np.concatenate([start / scale, (path.jumps[first:last, :3] / scale[:3]).ravel()]))
        first = last + 1
    return found


@dataclass(frozen=True, eq=False)
class Shot:
    """A block's trajectory: the costates at its start, and their jumps.

    Parameters
    ----------
    block : Block
    unknowns : ndarray, shape (3 + 3 k,)
        lambda at the start, then the jumps at the nodes but the last; in the block's own units.
    gravitational_parameter_m3_s2 : float
    """

    block: Block
    unknowns: Floats
    gravitational_parameter_m3_s2: float

    def along(self, time_s: Floats) -> tuple[Floats, Floats]:
        """Return states and costates at increasing times of the block, those after the jump at a node.

        Parameters
        ----------
        time_s : ndarray, shape (k,)

        Returns
        -------
        tuple of ndarray, each of shape (k, 6)
            m, m/s; m/s^3, m/s^2.
        """
        _, duration = _units(self.block, self.gravitational_parameter_m3_s2)
        z, now, node = self._begin(), self.block.start_s, 0
        found = np.empty((len(time_s), 12))
        for row, time in enumerate(time_s):
            while node < len(self.block.time_s) - 1 and self.block.time_s[node] <= time:
                _advance(z, _NONE, (self.block.time_s[node] - now) / duration)
                self._jump(z, node)
                now, node = self.block.time_s[node], node + 1
            _advance(z, _NONE, (time - now) / duration)
            now = time
            found[row] = z[:12]
        return self._in_si(found)

    def ends(self) -> tuple[Floats, Floats, Floats, float]:
        """Return states and costates where each segment ends, costates where each starts, and the energy spent.

        Returns
        -------
        states : ndarray, shape (k, 6)
        before, starting : ndarray, shape (k, 6)
        energy : float
            m^2/s^3.
        """
        length, duration = _units(self.block, self.gravitational_parameter_m3_s2)
        count = len(self.block.time_s)
        z, starting, ending = self._begin(), np.empty((count, 12)), np.empty((count, 12))
        for node, (start, end) in enumerate(zip(starts_of(self.block), self.block.time_s, strict=True)):
            starting[node] = z[:12]
            _advance(z, _NONE, (float(end) - start) / duration)
            ending[node] = z[:12]
            if node < count - 1:
                self._jump(z, node)
        states, before = self._in_si(ending)
        return states, before, self._in_si(starting)[1], float(z[12]) * length**2 / duration**3

    def _begin(self) -> Floats:
        length, duration = _units(self.block, self.gravitational_parameter_m3_s2)
        state = self.block.start_state / np.array([length] * 3 + [length / duration] * 3)
        return np.concatenate([state, self.unknowns[:6], [0.0]])

    def _jump(self, z: Floats, node: int) -> None:
        z[6:9] -= self.unknowns[6 + 3 * node : 9 + 3 * node]

    def _in_si(self, z: Floats) -> tuple[Floats, Floats]:
        length, duration = _units(self.block, self.gravitational_parameter_m3_s2)
        states = z[:, :6] * np.array([length] * 3 + [length / duration] * 3)
        return states, z[:, 6:] * np.array([length / duration**3] * 3 + [length / duration**2] * 3)


def shoot(block: Block, gravitational_parameter_m3_s2: float, near: Floats | None = None) -> Shot | None:
    """Find a block's trajectory by Newton's method, as what the nodes are missed by is taken away in steps.

    Parameters
    ----------
    block : Block
    gravitational_parameter_m3_s2 : float
    near : ndarray, shape (3 + 3 k,), or None
        Unknowns of other times, to begin from; where that leads nowhere, and with None, it begins from the coasting
        orbit.

    Returns
    -------
    Shot or None
        None where it leads nowhere.
    """
    mu = gravitational_parameter_m3_s2
    coasting = np.zeros(3 + 3 * len(block.time_s))
    begins = [] if near is None else [(near, LEAST_STEP_FROM_NEAR)]
    for begin, least_step in (*begins, (coasting, LEAST_STEP)):
        found = _follow(block, mu, begin, least_step)
        if found is not None:
            return Shot(block, found, mu)
    return None


def starts_of(block: Block) -> Iterator[float]:
    """When each segment of a block starts."""
    yield block.start_s
    yield from (float(each) for each in block.time_s[:-1])


def _units(block: Block, mu: float) -> tuple[float, float]:
    length = float(np.linalg.norm(block.start_state[:3]))
    return length, float(np.sqrt(length**3 / mu))


def _advance(z: Floats, variations: Floats, duration: float) -> None:
    if duration > 0.0 and not propagate(z, variations, duration):
        raise ValueError("a trajectory falls into the centre")


def _missed(block: Block, mu: float, unknowns: Floats, slopes: Floats | None = None) -> Floats | None:
    """What the nodes are missed by; None where there is no trajectory. Its derivatives are filled in, if asked for."""
    length, duration = _units(block, mu)
    scale = np.array([length] * 3 + [length / duration] * 3)
    goals = block.goal / scale
    size, last = len(unknowns), len(block.time_s) - 1
    z = np.concatenate([block.start_state / scale, unknowns[:6], [0.0]])
    variations = np.zeros((12, size))
    variations[6:, :6] = np.eye(6)
    missed = np.empty(size)
    for node, (start, end) in enumerate(zip(starts_of(block), block.time_s, strict=True)):
        known = 0 if slopes is None else 6 + 3 * node  # columns of jumps still ahead are zero
        varied = np.ascontiguousarray(variations[:, :known])
        try:
            _advance(z, varied, (float(end) - start) / duration)
        except ValueError:
            return None
        variations[:, :known] = varied
        rows, jump = slice(3 * node, 3 * node + 3), slice(6 + 3 * node, 9 + 3 * node)
        missed[rows] = z[:3] - goals[node, :3]
        if slopes is not None:
            slopes[rows] = variations[:3]
        if node < last:
            z[6:9] -= unknowns[jump]
            variations[6:9, jump] -= np.eye(3)
    missed[-3:] = z[3:6] - goals[last, 3:] if block.rendezvous else z[9:12]
    if slopes is not None:
        slopes[-3:] = variations[3:6] if block.rendezvous else variations[9:]
    return missed if np.isfinite(missed).all() and (slopes is None or np.isfinite(slopes).all()) else None


def _follow(block: Block, mu: float, begin: Floats, least_step: float) -> Floats | None:
    """Go from unknowns that miss the nodes to such that do not, in steps as long as Newton's method bears."""
    slopes = np.empty((len(begin), len(begin)))
    first = _missed(block, mu, begin, slopes)
    if first is None:
        return None
    unknowns, done, step = begin, 0.0, min(1.0, _FIRST_STEP / max(float(np.abs(first).max()), _FIRST_STEP))
    while True:
        ahead = _solved(slopes, -first)
        if ahead is None:
            return None
        while True:
            share = min(done + step, 1.0)
            tried = _newton(block, mu, unknowns + (share - done) * ahead, share, (1.0 - share) * first, slopes.copy())
            if tried is not None:
                break
            step *= 0.5
            if step < least_step:
                return None
        unknowns, rounds = tried
        if share == 1.0:
            return unknowns
        done, step = share, step * (2.0 if rounds <= 2 else 1.5 if rounds <= 4 else 1.0)
        if _missed(block, mu, unknowns, slopes) is None:
            return None


def _newton(
    block: Block, mu: float, unknowns: Floats, share: float, goal: Floats, slopes: Floats
) -> tuple[Floats, int] | None:
    """Newton's method towards a residual, with derivatives as old as they may be; None where it is not fast."""
    before, fresh = np.inf, False
    for rounds in range(_ROUNDS):
        found = _missed(block, mu, unknowns)
        if found is None:
            return None
        size = float(np.abs(found - goal).max())
        if size <= (TOLERANCE if share == 1.0 else ON_THE_WAY) or (fresh and size <= ROUNDING and size > 0.3 * before):
            return unknowns, rounds
        if size > _GREATEST_CORRECTION or size > 2.0 * before:
            return None
        fresh = size > _FAST * before
        if fresh and _missed(block, mu, unknowns, slopes) is None:
            return None
        move = _solved(slopes, found - goal)
        if move is None:
            return None
        unknowns, before = unknowns - move, size
    return None


def _solved(matrix: Floats, right: Floats) -> Floats | None:
    try:
        return np.asarray(np.linalg.solve(matrix, right))
    except np.linalg.LinAlgError:
        return None
