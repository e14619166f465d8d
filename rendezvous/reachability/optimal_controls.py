"""All optimal controls of a problem, as one convex set."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rendezvous.reachability.lifted import Lifted, joined
from rendezvous.reachability.lifted_sets import optimal_set
from rendezvous.reachability.optimum import BlockOptimum
from rendezvous.reachability.problem import ReachabilityProblem
from rendezvous.reachability.programs import maximise

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class OptimalControls:
    """{u: |x(T)| is least and every constraint kept}: a polytope for thrust in a box.

    Parameters
    ----------
    problem : ReachabilityProblem
    blocks : tuple of BlockOptimum
        What the problem falls into.
    """

    problem: ReachabilityProblem
    blocks: tuple[BlockOptimum, ...]

    @property
    def space(self) -> Lifted:
        """The set in coordinates z of its affine hull; controls divided by their bounds."""
        return joined(
            [each.optimal for each in self.blocks],
            [each.block.controls for each in self.blocks],
            self.problem.periods,
            self.problem.controls,
        )

    @property
    def centre(self) -> Floats:
        """A point deep inside, in these coordinates, shape (dimension,)."""
        return np.concatenate([each.centre for each in self.blocks])

    @property
    def scale(self) -> Floats:
        """What the controls are divided by, shape (T m,)."""
        return np.tile(self.problem.control_bounds, self.problem.periods)

    @property
    def dimension(self) -> int:
        """Dimension of the set; 0 where the optimal control is unique."""
        return sum(each.optimal.size for each in self.blocks)

    @property
    def miss(self) -> float:
        """The least terminal norm, in the units of the problem."""
        return float(np.linalg.norm([each.miss for each in self.blocks]))

    def at(self, point: Floats) -> Floats:
        """Return the controls of a point z of the set, z dimensionless.

        Parameters
        ----------
        point : ndarray, shape (..., dimension)

        Returns
        -------
        ndarray, shape (..., T, m)
            In the units of the problem.
        """
        space = self.space
        scaled = space.control_free + np.asarray(point) @ space.control_response.T
        return np.asarray((scaled * self.scale).reshape(*np.shape(point)[:-1], self.problem.periods, -1))

    def excess(self, controls: ArrayLike) -> Floats:
        """Return by how much controls are not optimal: of a constraint, or of the terminal state from the best one.

        Parameters
        ----------
        controls : array_like, shape (..., T, m)

        Returns
        -------
        ndarray, shape (...)
            Relative to the bounds; at most rounding for members.
        """
        given = np.asarray(controls, dtype=float)
        best = np.zeros(self.problem.states)
        for each in self.blocks:
            best[each.block.states] = each.terminal * each.block.scale
        last = self.problem.run(given)[..., -1, :]
        away = (np.abs(last - best) / self.problem.state_bounds).max(axis=-1)
        return np.asarray(np.maximum(self.problem.excess(given), away))

    def ranges(self) -> Floats:
        """Return the least and greatest of each control over the set.

        Returns
        -------
        ndarray, shape (T, m, 2)

        Notes
        -----
        2 T m linear programs over the blocks.
        """
        periods, group = self.problem.periods, self.problem.controls
        result = np.zeros((periods, group, 2))
        for each in self.blocks:
            lifted = optimal_set(each)
            costs = np.vstack([-lifted.control_response, lifted.control_response])
            moving = np.abs(costs).max(axis=1, initial=0.0) > 1e-12
            best = np.zeros(len(costs))
            best[moving] = np.einsum("kp,kp->k", costs[moving], maximise(lifted, costs[moving]))
            count = len(lifted.control_free)
            ends = np.stack([lifted.control_free - best[:count], lifted.control_free + best[count:]], axis=-1)
            result[:, each.block.controls] = ends.reshape(periods, -1, 2)
        return result * self.problem.control_bounds[:, None]
