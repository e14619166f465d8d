"""Choices of one meeting from the Pareto set."""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize

from infoset.geometry.polytope import nearest_difference
from rendezvous._arrays import Floats
from rendezvous.pareto.solution import EncounterSolution

_CORNER = 1e-20
"""Square of the radius of the rounded corner of a norm, relative to the distance of the farthest ideal."""


def min_sum_of_costs(solution: EncounterSolution) -> Floats:
    """Return the free values, shape (f,), that minimise sum w_i J_i of a `solution`: costs like impulses.

    A sum of norms of affine functions, convex: Newton's method in a trust region. It begins at the best of the mean
    of the ideals and the ideals that cost nothing, where the norm has a corner.
    """
    roots, back, middle, ideals, size, weights = _scaled(solution)
    if size == 0.0:
        return middle
    floors = np.array([cost.ideal_cost_squared for cost in solution.costs])[solution.encounter.weights > 0.0]
    floors = floors / size**2 + _CORNER

    def costs(point: Floats) -> tuple[Floats, Floats]:
        apart = np.einsum("nab,nb->na", roots, point - ideals)
        size = np.sqrt(floors + (apart**2).sum(axis=1))
        return size, np.einsum("nab,na->nb", roots, apart) / size[:, None]

    def curvature(point: Floats) -> Floats:
        size, slopes = costs(point)
        bend = np.einsum("nca,ncb->nab", roots, roots) - slopes[:, :, None] * slopes[:, None, :]
        return np.asarray(np.einsum("n,nab->ab", weights / size, bend))

    starts = [np.zeros(len(middle)), *ideals[floors < 100.0 * _CORNER]]
    minimum = minimize(
        lambda point: tuple(weights @ part for part in costs(point)),
        min(starts, key=lambda point: float(weights @ costs(point)[0])),
        jac=True,
        hess=curvature,
        method="trust-exact",
        options={"gtol": 1e-11, "maxiter": 300},
    )
    return np.asarray(middle + size * back @ minimum.x)


def minimax_excess(solution: EncounterSolution) -> Floats:
    """Return the free values, shape (f,), that minimise the maximum weighted excess of a `solution`.

    With one M, the centre of the smallest enclosing ball. Sequential quadratic programming on (p, t), minimum t with
    w_i e_i(p) <= t.
    """
    roots, back, middle, ideals, size, weights = _scaled(solution)
    if size == 0.0:
        return middle
    matrices = np.einsum("n,nca,ncb->nab", weights, roots, roots)

    def excess(point: Floats) -> Floats:
        apart = point - ideals
        return np.asarray(np.einsum("na,nab,nb->n", apart, matrices, apart))

    def slopes(point: Floats) -> Floats:
        return np.asarray(2.0 * np.einsum("nab,nb->na", matrices, point - ideals))

    initial = np.zeros(len(middle))
    minimum = minimize(
        lambda x: x[-1],
        np.append(initial, excess(initial).max()),
        jac=lambda _: np.append(initial, 1.0),
        constraints={
            "type": "ineq",
            "fun": lambda x: x[-1] - excess(x[:-1]),
            "jac": lambda x: np.column_stack([-slopes(x[:-1]), np.ones(len(ideals))]),
        },
        method="SLSQP",
        options={"ftol": 1e-15, "maxiter": 200},
    )
    return np.asarray(middle + size * back @ minimum.x[:-1])


def nearest_to(solution: EncounterSolution, preferred: Floats) -> Floats:
    """Return the Pareto-optimal free values of a `solution` nearest to `preferred` ones, shape (f,), in the norm of M.

    An exact projection onto the convex hull of the ideals.

    Raises
    ------
    ValueError
        If the M of two craft differ by more than a factor: the set is then curved.
    """
    matrices = np.array([cost.matrix for cost in solution.costs])
    unit = matrices / np.trace(matrices, axis1=1, axis2=2)[:, None, None]
    if not np.allclose(unit, unit[0], rtol=1e-12, atol=1e-15):
        raise ValueError("the meeting nearest to a preferred one is known only for craft that start at the same time")
    root, ideals = solution.costs[0].root, solution.ideals
    known, target = (ideals - ideals[0]) @ root.T, root @ (preferred - ideals[0])
    nearest = target + nearest_difference(known, target[None]) if known.any() else known[0]
    return np.asarray(ideals[0] + np.linalg.solve(root, nearest))


def _scaled(solution: EncounterSolution) -> tuple[Floats, Floats, Floats, Floats, float, Floats]:
    """Return the craft of positive weight in coordinates x in which their M are of order one, p = middle + size back x.

    The results are the roots of M, `back`, the `middle` of the ideals, the ideals, `size`, which is zero if all ideals
    coincide, and the weights.
    """
    costs = [cost for cost in solution.costs if cost.craft.weight > 0.0]
    weights = np.array([cost.craft.weight for cost in costs])
    matrices, ideals = np.array([cost.matrix for cost in costs]), np.array([cost.ideal for cost in costs])
    root = np.linalg.cholesky(np.einsum("n,nab->ab", weights / weights.sum(), matrices)).T
    back, middle = np.linalg.inv(root), ideals.mean(axis=0)
    apart = (ideals - middle) @ root.T
    size = float(np.linalg.norm(apart, axis=1).max())
    return np.array([cost.root for cost in costs]) @ back, back, middle, apart / (size or 1.0), size, weights
