"""The whole Pareto set: every meeting that no other one improves for all craft."""

from __future__ import annotations

import numpy as np

from infoset.rendezvous._arrays import Floats
from infoset.rendezvous._halton import halton
from infoset.rendezvous.pareto.solution import EncounterSolution


def pareto_set(solution: EncounterSolution, weights: Floats) -> Floats:
    """Return Pareto-optimal meetings of a `solution`, shape (k, f), for `weights`, shape (k, n).

    They are free terminal values; the weights are not negative, nor all zero in a row. (sum w_i
    M_i)^-1 sum w_i M_i p_i*: with one M the convex hull of the ideals, otherwise curved. All
    weights together cover the set, as the excesses are convex.
    """
    shares = weights / weights.sum(axis=1, keepdims=True)
    ideals = solution.ideals
    # About the mean of the ideals, scaled by the mean M: the systems are then of order one.
    middle = ideals.mean(axis=0)
    root = np.linalg.cholesky(np.mean([cost.matrix for cost in solution.costs], axis=0)).T
    back = np.linalg.inv(root)
    matrices = np.array([back.T @ cost.matrix @ back for cost in solution.costs])
    scaled = (ideals - middle) @ root.T
    left = np.einsum("kn,nab->kab", shares, matrices)
    right = np.einsum("kn,nab,nb->ka", shares, matrices, scaled)
    return np.asarray(middle + np.linalg.solve(left, right[..., None])[..., 0] @ back.T)


def simplex_weights(craft: int, count: int) -> Floats:
    """Return about `count` rows of weights, shape (k, craft), spread evenly over all shares.

    Those of single craft are included. A lattice up to three craft, beyond that a low-discrepancy
    sequence.
    """
    if craft == 1:
        return np.ones((1, 1))
    if craft == 2:
        share = np.linspace(0.0, 1.0, max(count, 2))
        return np.stack([1.0 - share, share], axis=1)
    if craft == 3:
        # A lattice with d divisions has (d + 1) (d + 2) / 2 points.
        divisions = max(1, int(np.sqrt(2.0 * count)) - 1)
        pairs = [(i, j) for i in range(divisions + 1) for j in range(divisions + 1 - i)]
        return np.array([(divisions - i - j, i, j) for i, j in pairs], dtype=np.float64) / divisions
    uniform = halton(craft, count)
    # Shares of exponentially distributed numbers are uniform over all shares.
    spread = -np.log(uniform)
    return np.concatenate([np.eye(craft), spread / spread.sum(axis=1, keepdims=True)])


def distances(solution: EncounterSolution) -> Floats:
    """Return d_ij = |p_i* - p_j*|_M of the ideals of a `solution` with one M, m/s^1.5, (n, n)."""
    scaled = solution.ideals @ solution.costs[0].root.T
    return np.asarray(np.linalg.norm(scaled[:, None] - scaled, axis=-1))
