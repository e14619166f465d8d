"""The admissible controls of a block as one convex set, and linear programs over it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rendezvous.reachability.blocks import Block

Floats = NDArray[np.float64]
Places = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Lifted:
    """{v: rows v <= limits, equal v = levels}, with |u(t)| <= 1 for a ball; states and controls are affine in v.

    Parameters
    ----------
    free : ndarray, shape (T + 1, n)
    response : ndarray, shape (T + 1, n, p)
        x(t) = free[t] + response[t] v.
    control_free : ndarray, shape (T m,)
    control_response : ndarray, shape (T m, p)
        The same for all controls, those of the first period first.
    rows : ndarray, shape (r, p)
    limits : ndarray, shape (r,)
    moments : ndarray of int, shape (r,)
        The time that each row is about; -1 for a bound on a control.
    labels : ndarray of int, shape (r,)
        Which constraint of the block each row is; -1 for a bound on a control.
    equal : ndarray, shape (e, p)
    levels : ndarray, shape (e,)
    ball : int
        Number m of controls a period where their norm is bounded; 0 for a box, which stands among the rows.
    """

    free: Floats
    response: Floats
    control_free: Floats
    control_response: Floats
    rows: Floats
    limits: Floats
    moments: Places
    labels: Places
    equal: Floats
    levels: Floats
    ball: int

    @property
    def size(self) -> int:
        """Number p of variables."""
        return int(self.rows.shape[1])

    def controls(self, point: Floats) -> Floats:
        """Return the controls of a point, shape (T m,)."""
        return np.asarray(self.control_free + self.control_response @ point)

    def until(self, time: int) -> Lifted:
        """Return the same without constraints on states after a time."""
        return self.only(np.flatnonzero(self.moments <= time))

    def only(self, kept: Places) -> Lifted:
        """Return the same with some of its rows."""
        return replace(
            self,
            rows=self.rows[kept],
            limits=self.limits[kept],
            moments=self.moments[kept],
            labels=self.labels[kept],
        )

    def where(self, equal: Floats, levels: Floats) -> Lifted:
        """Return the same with more equations."""
        return replace(self, equal=np.vstack([self.equal, equal]), levels=np.concatenate([self.levels, levels]))

    def within(self, point: Floats, basis: Floats) -> Lifted:
        """Return the same in coordinates z of a flat v = point + basis z, where the equations hold."""
        return Lifted(
            self.free + self.response @ point,
            self.response @ basis,
            self.control_free + self.control_response @ point,
            self.control_response @ basis,
            self.rows @ basis,
            self.limits - self.rows @ point,
            self.moments,
            self.labels,
            np.zeros((0, basis.shape[1])),
            np.zeros(0),
            self.ball,
        )


def lift(block: Block) -> Lifted:
    """Return the admissible controls of a block, v = all its controls.

    Parameters
    ----------
    block : Block

    Returns
    -------
    Lifted

    Notes
    -----
    States are eliminated: O(T^2 n^2 m), dense.
    """
    periods, n, m = block.periods, block.size, len(block.controls)
    free, response = np.zeros((periods + 1, n)), np.zeros((periods + 1, n, periods * m))
    free[0] = block.initial
    for t in range(periods):
        free[t + 1] = block.transition[t] @ free[t]
        response[t + 1] = block.transition[t] @ response[t]
        response[t + 1][:, t * m : (t + 1) * m] += block.control[t]
    rows, limits, moments, labels = [], [], [], []
    for t in range(1, periods + 1):
        held = np.flatnonzero(np.isfinite(block.offsets[t]))
        rows.append(block.normals[held] @ response[t])
        limits.append(block.offsets[t, held] - block.normals[held] @ free[t])
        moments.append(np.full(len(held), t))
        labels.append(held)
    if block.between is not None:
        for t in range(periods):
            held = np.flatnonzero(np.isfinite(block.offsets[t]))
            now = np.zeros((m, periods * m))
            now[:, t * m : (t + 1) * m] = np.eye(m)
            for inner in block.between[t]:
                rows.append(block.normals[held] @ (inner[:, :n] @ response[t] + inner[:, n:] @ now))
                limits.append(block.offsets[t, held] - block.normals[held] @ inner[:, :n] @ free[t])
                moments.append(np.full(len(held), t + 1))
                labels.append(held)
    if not block.ball:
        unit = np.eye(periods * m)
        rows += [unit, -unit]
        limits.append(np.ones(2 * periods * m))
        moments.append(np.full(2 * periods * m, -1))
        labels.append(np.full(2 * periods * m, -1))
    width = periods * m
    return Lifted(
        free,
        response,
        np.zeros(width),
        np.eye(width),
        np.vstack(rows),
        np.concatenate(limits),
        np.concatenate(moments),
        np.concatenate(labels),
        np.zeros((0, width)),
        np.zeros(0),
        m if block.ball else 0,
    )


def joined(parts: Sequence[Lifted], controls: Sequence[Places], periods: int, total: int) -> Lifted:
    """Return several blocks as one set, whose controls are in the order of the problem.

    Parameters
    ----------
    parts : sequence of Lifted
    controls : sequence of ndarray of int
        Places of their controls in the problem.
    periods : int
    total : int
        How many controls the problem has: those that act on no block are zero.

    Returns
    -------
    Lifted
        States in the order of the blocks.
    """
    from scipy.linalg import block_diag

    order = [t * total + int(j) for places in controls for t in range(periods) for j in places]
    control_free, control_response = np.zeros(periods * total), np.zeros((periods * total, sum(p.size for p in parts)))
    control_free[order] = np.concatenate([each.control_free for each in parts])
    control_response[order] = block_diag(*[each.control_response for each in parts])
    response = np.array([block_diag(*[each.response[t] for each in parts]) for t in range(periods + 1)])
    return Lifted(
        np.hstack([each.free for each in parts]),
        response,
        control_free,
        control_response,
        block_diag(*[each.rows for each in parts]),
        np.concatenate([each.limits for each in parts]),
        np.concatenate([each.moments for each in parts]),
        np.concatenate([each.labels for each in parts]),
        block_diag(*[each.equal for each in parts]),
        np.concatenate([each.levels for each in parts]),
        max(each.ball for each in parts),
    )


def lift_with_states(block: Block) -> Lifted:
    """Return the admissible controls of a block, v = all its controls, then all its states x(1)..x(T).

    Parameters
    ----------
    block : Block

    Returns
    -------
    Lifted
        The same set as `lift`'s; its rows have few entries that are not zero, which an interior point uses.

    Notes
    -----
    The motion is T n equations.
    """
    periods, n, m = block.periods, block.size, len(block.controls)
    width = periods * m
    total = width + periods * n
    response = np.zeros((periods + 1, n, total))
    unit = np.eye(n)
    for t in range(1, periods + 1):
        response[t][:, width + (t - 1) * n : width + t * n] = unit
    equal, levels = np.zeros((periods, n, total)), np.zeros((periods, n))
    rows, limits, moments, labels = [], [], [], []
    for t in range(periods):
        equal[t] = response[t + 1] - block.transition[t] @ response[t]
        equal[t][:, t * m : (t + 1) * m] = -block.control[t]
        held = np.flatnonzero(np.isfinite(block.offsets[t + 1]))
        rows.append(block.normals[held] @ response[t + 1])
        limits.append(block.offsets[t + 1, held])
        moments.append(np.full(len(held), t + 1))
        labels.append(held)
        if block.between is not None:
            held = np.flatnonzero(np.isfinite(block.offsets[t]))
            now = np.zeros((m, total))
            now[:, t * m : (t + 1) * m] = np.eye(m)
            start = block.initial if t == 0 else np.zeros(n)
            for inner in block.between[t]:
                rows.append(block.normals[held] @ (inner[:, :n] @ response[t] + inner[:, n:] @ now))
                limits.append(block.offsets[t, held] - block.normals[held] @ inner[:, :n] @ start)
                moments.append(np.full(len(held), t + 1))
                labels.append(held)
    levels[0] = block.transition[0] @ block.initial
    free = np.zeros((periods + 1, n))
    free[0] = block.initial
    control_response = np.eye(width, total)
    if not block.ball:
        rows += [control_response, -control_response]
        limits.append(np.ones(2 * width))
        moments.append(np.full(2 * width, -1))
        labels.append(np.full(2 * width, -1))
    return Lifted(
        free,
        response,
        np.zeros(width),
        control_response,
        np.vstack(rows),
        np.concatenate(limits),
        np.concatenate(moments),
        np.concatenate(labels),
        equal.reshape(-1, total),
        levels.ravel(),
        m if block.ball else 0,
    )
