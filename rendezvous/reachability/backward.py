"""Backward sets: the states from which the optimal terminal state can be reached."""

from __future__ import annotations

import numpy as np

from infoset.rendezvous._arrays import Floats
from infoset.rendezvous.reachability.admissible import Maximiser, lift_from_any_start
from infoset.rendezvous.reachability.optimum import BlockOptimum
from infoset.rendezvous.reachability.solve import OptimalControls


def backward_bounds(optimal: OptimalControls) -> Floats:
    """Return the minimum and maximum of each state in the backward sets, shape (T + 1, n, 2).

    The backward set of time t, (10) of Shorikov and Goranov (2021), contains the states x(t) from
    which admissible controls lead to the terminal state of minimum norm. Here the states also keep
    their constraints from t to T; the tube is the part of the set that is reached from x(0). A set
    at time t needs 2 n programs, with the variables of T - t periods.
    """
    problem = optimal.problem
    result = np.zeros((problem.periods + 1, problem.states, 2))
    for part in optimal.blocks:
        result[:, part.block.states] = _bounds(part) * part.block.scale[:, None]
    return result


def _bounds(optimum: BlockOptimum) -> Floats:
    """Return the minimum and maximum of each state of a block at t = 0..T, divided by the bounds of
    its states, shape (T + 1, n, 2). At t = T they are the terminal state.
    """
    block = optimum.block
    result = np.zeros((block.periods + 1, block.size, 2))
    result[-1] = optimum.terminal[:, None]
    for t in range(block.periods):
        lifted = lift_from_any_start(block.rest(t))
        # `free` is zero: states are variables, also the first.
        lifted = lifted.where(lifted.response[-1], optimum.terminal)
        program = Maximiser(lifted)
        start = lifted.response[0]
        for side, sign in enumerate((-1.0, 1.0)):
            points = program.maximise_all(sign * start)
            result[t, :, side] = np.einsum("ip,ip->i", start, points)
    return result
