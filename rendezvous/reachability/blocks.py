"""Parts of a problem that do not act on each other, in units in which every bound is one."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from rendezvous.reachability.problem import ReachabilityProblem, ThrustShape

Floats = NDArray[np.float64]
Places = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Block:
    """States and controls that act on no others, divided by their bounds.

    Parameters
    ----------
    states, controls : ndarray of int
        Their places in the problem.
    scale : ndarray, shape (n,)
        Bounds on the states, in their own units.
    transition, control, initial
        As in the problem, scaled.
    normals : ndarray, shape (k, n)
        All constraints on states, the bounds first; of unit length.
    offsets : ndarray, shape (T + 1, k)
    names : tuple of str
        What to call these k.
    ball : bool
        Whether |u(t)| <= 1 in the Euclidean norm, and not each component.
    between : ndarray, shape (T, s, n, n + m) or None
    """

    states: Places
    controls: Places
    scale: Floats
    transition: Floats
    control: Floats
    initial: Floats
    normals: Floats
    offsets: Floats
    names: tuple[str, ...]
    ball: bool
    between: Floats | None

    @property
    def periods(self) -> int:
        """Number of periods T."""
        return len(self.transition)

    @property
    def size(self) -> int:
        """Number of states n."""
        return len(self.states)

    def first(self, periods: int) -> Block:
        """Return the block that ends after the first periods."""
        return replace(
            self,
            transition=self.transition[:periods],
            control=self.control[:periods],
            offsets=self.offsets[: periods + 1],
            between=None if self.between is None else self.between[:periods],
        )


def split(problem: ReachabilityProblem) -> tuple[Block, ...]:
    """Return the smallest blocks that a problem falls into.

    Parameters
    ----------
    problem : ReachabilityProblem

    Returns
    -------
    tuple of Block
        In the order of their first states. Together they have all states, and all controls that act on any.
    """
    n, m = problem.states, problem.controls
    linked = np.zeros((n + m, n + m), dtype=bool)
    linked[:n, :n] = (problem.transition != 0.0).any(axis=0)
    linked[:n, n:] = (problem.control != 0.0).any(axis=0)
    if problem.between is not None:
        linked[:n] |= (problem.between != 0.0).any(axis=(0, 1))
    if problem.normals is not None:
        for normal in problem.normals:
            acting = np.flatnonzero(normal)
            linked[acting[0], acting] = True
    if problem.thrust is ThrustShape.BALL:
        linked[n, n:] = True
    labels = connected_components(csr_array(linked), directed=False)[1]
    order = list(dict.fromkeys(labels[:n].tolist()))
    return tuple(_block(problem, np.flatnonzero(labels == label)) for label in order)


def _block(problem: ReachabilityProblem, members: Places) -> Block:
    n = problem.states
    states, controls = members[members < n], members[members >= n] - n
    scale, reach = problem.state_bounds[states], problem.control_bounds[controls]
    square, oblong = np.ix_(states, states), np.ix_(states, controls)
    transition = np.array([each[square] for each in problem.transition]) / scale[:, None] * scale
    control = np.array([each[oblong] for each in problem.control]) / scale[:, None] * reach
    unit = np.eye(len(states))
    normals, names = [unit, -unit], [f"the bound on {problem.state_name(i)}" for i in states.tolist()] * 2
    offsets = [np.ones((problem.periods + 1, 2 * len(states)))]
    if problem.normals is not None and problem.offsets is not None:
        mine = np.flatnonzero(np.abs(problem.normals[:, states]).max(axis=1, initial=0.0) > 0.0)
        rows = problem.normals[np.ix_(mine, states)] * scale
        lengths = np.linalg.norm(rows, axis=1)
        normals.append(rows / lengths[:, None])
        offsets.append(problem.offsets[:, mine] / lengths)
        names += [problem.name_of(k) for k in mine.tolist()]
    between = None
    if problem.between is not None:
        inner = problem.between[:, :, states][:, :, :, members]
        between = inner / scale[:, None] * np.concatenate([scale, reach])
    return Block(
        states,
        controls,
        scale,
        transition,
        control,
        problem.initial[states] / scale,
        np.vstack(normals),
        np.hstack(offsets),
        tuple(names),
        problem.thrust is ThrustShape.BALL,
        between,
    )
