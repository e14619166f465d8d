"""Sets of states known by programs over the admissible controls: any number of periods, coupled constraints, balls."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from infoset.polytope import Polytope, shadow
from rendezvous.reachability.block_sets import SetKind
from rendezvous.reachability.lifted import Lifted, lift, lift_with_states
from rendezvous.reachability.optimum import BlockOptimum
from rendezvous.reachability.programs import Maximiser

Floats = NDArray[np.float64]

_FEW_CONTROLS = 24
_AT_BOUND = 1.0 - 1e-10
_SHARP = 1e-7


class LiftedSets:
    """Sets of a block by its lifted route.

    Parameters
    ----------
    optimum : BlockOptimum

    Notes
    -----
    A linear program a direction, or one with cones for thrust in a ball; nothing is approximated but by the tolerance
    of the programs, 1e-8 of the bounds at most. Of few controls these alone are the variables; of many the states are
    variables too, for the rows then have few entries that are not zero.
    """

    def __init__(self, optimum: BlockOptimum) -> None:
        self._optimum = optimum
        self._tube: Lifted | None = None
        self._forward: dict[int, Lifted] = {}
        self._programs: dict[tuple[SetKind, int], Maximiser] = {}

    def support(self, kind: SetKind, time: int, directions: Floats) -> Floats:
        """Return the support function along directions, shape (k, n), as an array of shape (k,)."""
        lifted = self._set(kind, time)
        costs = directions @ lifted.response[time]
        program = self._programs[kind, 0 if kind is SetKind.TUBE else time]
        points = np.array([program.maximise(cost) for cost in costs]).reshape(costs.shape)
        return np.asarray(directions @ lifted.free[time] + np.einsum("kp,kp->k", costs, points))

    def bounds(self, kind: SetKind) -> Floats:
        """Return the least and greatest of each state at each time, shape (T + 1, n, 2)."""
        size, periods = self._optimum.block.size, self._optimum.block.periods
        unit = np.eye(size)
        result = np.zeros((periods + 1, size, 2))
        result[0] = self._optimum.block.initial[:, None]
        if kind is SetKind.FORWARD:
            for t in range(1, periods + 1):
                found = self.support(kind, t, np.vstack([-unit, unit])).reshape(2, size)
                result[t, :, 0], result[t, :, 1] = -found[0], found[1]
            return result
        lifted = self._set(kind, periods)
        # What one optimal control reaches is known to be reached: where that is a bound, there is nothing to solve.
        program = self._programs[kind, 0]
        best = np.full((periods + 1, size, 2), -np.inf)
        for t in _coarse_first(periods):
            for i in range(size):
                for side, sign in enumerate((-1.0, 1.0)):
                    if best[t, i, side] < _AT_BOUND:
                        point = program.maximise(sign * lifted.response[t, i])
                        states = lifted.free + lifted.response @ point
                        best[t, i, side] = sign * states[t, i]
                        np.maximum(best, np.stack([-states, states], axis=-1), out=best)
        result[1:, :, 0], result[1:, :, 1] = -best[1:, :, 0], best[1:, :, 1]
        result[periods] = self._optimum.terminal[:, None]
        return result

    def shadow(self, kind: SetKind, time: int, rows: Floats, tolerance: float = 1e-9) -> Polytope:
        """Return the image of a set under a matrix, shape (d, n), of few rows."""
        if time == 0:
            return Polytope.from_vertices((rows @ self._optimum.block.initial)[None, :])
        lifted = self._set(kind, time)
        free, response = rows @ lifted.free[time], rows @ lifted.response[time]
        program = self._programs[kind, 0 if kind is SetKind.TUBE else time]

        solve = program.maximise if tolerance > _SHARP else program.maximise_sharply

        def furthest(direction: Floats) -> Floats:
            return np.asarray(free + response @ solve(direction @ response))

        return shadow(furthest, len(rows), tolerance)

    def polytope(self, kind: SetKind, time: int) -> Polytope | None:
        """Return None: only its support is known."""
        return None

    def _set(self, kind: SetKind, time: int) -> Lifted:
        if kind is SetKind.FORWARD:
            if time not in self._forward:
                block = self._optimum.block.first(max(time, 1))
                few = block.periods * len(block.controls) <= _FEW_CONTROLS
                self._forward[time] = lift(block) if few else lift_with_states(block)
                self._programs[kind, time] = Maximiser(self._forward[time])
            return self._forward[time]
        if self._tube is None:
            self._tube = optimal_set(self._optimum)
            self._programs[kind, 0] = Maximiser(self._tube)
        return self._tube


def optimal_set(optimum: BlockOptimum) -> Lifted:
    """Return the optimal controls of a block in the variables that suit many linear programs.

    Parameters
    ----------
    optimum : BlockOptimum

    Returns
    -------
    Lifted
    """
    if optimum.optimal.size <= _FEW_CONTROLS or not optimum.reached:
        return optimum.optimal
    lifted = lift_with_states(optimum.block)
    return lifted.where(lifted.response[-1], -lifted.free[-1])


def _coarse_first(periods: int) -> list[int]:
    """Times 1..T - 1 in an order in which any beginning is spread over all."""
    order: list[int] = []
    step = 1
    while step < periods:
        step *= 2
    while step >= 1:
        order += [t for t in range(step, periods, step) if t not in set(order)]
        step //= 2
    return order
