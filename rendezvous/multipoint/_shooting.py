"""A first trajectory far from the coasting orbit: the nonlinear conditions, followed as targets move away from it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rendezvous.multipoint._hamiltonian import propagate
from rendezvous.multipoint.segments import Nodes, Path
from rendezvous.two_body import coast

Floats = NDArray[np.float64]

TOLERANCE = 1e-9
LEAST_STEP = 1.0 / 512.0
_ROUNDS = 8
_GREATEST_CORRECTION = 0.3


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

    def states(self, time_s: Floats) -> Floats:
        """States at increasing times of the block, shape (k, 6), m and m/s."""
        length, duration = _units(self.block, self.gravitational_parameter_m3_s2)
        scale = np.array([length] * 3 + [length / duration] * 3)
        z = np.concatenate([self.block.start_state / scale, self.unknowns[:6]])
        none, now, node = np.zeros((12, 0)), self.block.start_s, 0
        found = np.empty((len(time_s), 6))
        for row, time in enumerate(time_s):
            while node < len(self.block.time_s) - 1 and self.block.time_s[node] <= time:
                _advance(z, none, (self.block.time_s[node] - now) / duration)
                z[6:9] -= self.unknowns[6 + 3 * node : 9 + 3 * node]
                now, node = self.block.time_s[node], node + 1
            _advance(z, none, (time - now) / duration)
            now = time
            found[row] = z[:6] * scale
        return found


def shoot(block: Block, gravitational_parameter_m3_s2: float, near: Floats | None = None) -> Shot | None:
    """Find a block's trajectory by Newton's method.

    Parameters
    ----------
    block : Block
    gravitational_parameter_m3_s2 : float
    near : ndarray, shape (3 + 3 k,), or None
        Unknowns of like times; None follows the targets from the coasting orbit, in steps as long as Newton's method
        bears.

    Returns
    -------
    Shot or None
        None where it leads nowhere.
    """
    mu = gravitational_parameter_m3_s2
    size = 3 + 3 * len(block.time_s)
    if near is not None and near.shape == (size,):
        found = _newton(block, mu, near, 1.0)
        if found is not None:
            return Shot(block, found[0], mu)
    unknowns, done, step = np.zeros(size), 0.0, 0.25
    slope = _tangent(block, mu, unknowns, 0.0)
    while done < 1.0:
        ahead = min(done + step, 1.0)
        found = _newton(block, mu, unknowns + (ahead - done) * slope, ahead)
        if found is None:
            step *= 0.5
            if step < LEAST_STEP:
                return None
            continue
        unknowns, rounds = found
        done, step = ahead, step * (1.6 if rounds <= 3 else 1.0)
        if done < 1.0:
            slope = _tangent(block, mu, unknowns, done)
    return Shot(block, unknowns, mu)


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


def _goals(block: Block, mu: float, share: float) -> Floats:
    """Where the nodes are when the targets are so far on the way from the coasting orbit, shape (k, 6)."""
    begin = np.broadcast_to(block.start_state, (len(block.time_s), 6))
    coasting = coast(begin, block.time_s - block.start_s, mu)
    return np.asarray(coasting + share * (block.goal - coasting))


def _residual(block: Block, mu: float, unknowns: Floats, share: float) -> tuple[Floats, Floats] | None:
    """What the nodes are missed by, and its derivatives by the unknowns; None where there is no trajectory."""
    length, duration = _units(block, mu)
    scale = np.array([length] * 3 + [length / duration] * 3)
    goals = _goals(block, mu, share) / scale
    size, last = len(unknowns), len(block.time_s) - 1
    z = np.concatenate([block.start_state / scale, unknowns[:6]])
    variations = np.zeros((12, size))
    variations[6:, :6] = np.eye(6)
    missed, slopes = np.empty(size), np.empty((size, size))
    for node, (start, end) in enumerate(zip(starts_of(block), block.time_s, strict=True)):
        try:
            _advance(z, variations, (float(end) - start) / duration)
        except ValueError:
            return None
        rows = slice(3 * node, 3 * node + 3)
        missed[rows], slopes[rows] = z[:3] - goals[node, :3], variations[:3]
        if node < last:
            jump = slice(6 + 3 * node, 9 + 3 * node)
            z[6:9] -= unknowns[jump]
            variations[6:9, jump] -= np.eye(3)
    if block.rendezvous:
        missed[-3:], slopes[-3:] = z[3:6] - goals[last, 3:], variations[3:6]
    else:
        missed[-3:], slopes[-3:] = z[9:], variations[9:]
    return (missed, slopes) if np.isfinite(missed).all() and np.isfinite(slopes).all() else None


def _newton(block: Block, mu: float, unknowns: Floats, share: float) -> tuple[Floats, int] | None:
    """Newton's method at one share of the way; None where it does not converge fast."""
    before = np.inf
    for rounds in range(_ROUNDS):
        found = _residual(block, mu, unknowns, share)
        if found is None:
            return None
        missed, slopes = found
        size = float(np.abs(missed).max())
        if size <= TOLERANCE:
            return unknowns, rounds
        if size > _GREATEST_CORRECTION or size > 2.0 * before:
            return None
        try:
            unknowns = unknowns - np.linalg.solve(slopes, missed)
        except np.linalg.LinAlgError:
            return None
        before = size
    return None


def _tangent(block: Block, mu: float, unknowns: Floats, share: float) -> Floats:
    """How the unknowns change with the share, once it is solved there."""
    found = _residual(block, mu, unknowns, share)
    if found is None:
        return np.zeros_like(unknowns)
    length, duration = _units(block, mu)
    scale = np.array([length] * 3 + [length / duration] * 3)
    away = (_goals(block, mu, 1.0) - _goals(block, mu, 0.0)) / scale
    moved = np.concatenate([away[:, :3].ravel(), away[-1, 3:] if block.rendezvous else np.zeros(3)])
    try:
        return np.asarray(np.linalg.solve(found[1], moved))
    except np.linalg.LinAlgError:
        return np.zeros_like(unknowns)
