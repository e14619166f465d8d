"""Choices of one meeting from the Pareto set."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import minimize

from infoset.geometry.polytope import nearest_pair
from infoset.rendezvous._arrays import Floats
from infoset.rendezvous.pareto.solution import EncounterSolution

_CORNER = 1e-20
"""Square of the radius of the rounded corner of a norm, in units of the distance of the farthest
ideal: a norm is greater by up to this radius, 1e-10, than the exact one, and has derivatives at its
corner. Chosen.
"""


def min_sum_of_costs(solution: EncounterSolution) -> Floats:
    """Return the free values, shape (f,), that minimise sum w_i J_i of a `solution`.

    The J_i are costs like impulses. A sum of norms of affine functions, convex: Newton's method in
    a trust region. It begins at the best of the mean of the ideals and the ideals that cost
    nothing, where the norm has a corner. If the ideals of the craft with a weight above 0 coincide,
    they are the result.
    """
    roots, back, middle, ideals, size, weights = _scaled(solution)
    if size == 0.0:
        return middle
    floors = np.array([cost.ideal_cost_squared for cost in solution.costs])[
        solution.encounter.weights > 0.0
    ]
    floors = floors / size**2 + _CORNER

    def costs(point: Floats) -> tuple[Floats, Floats]:
        # The costs, shape (n,), and their gradients, shape (n, f).
        apart = np.einsum("nab,nb->na", roots, point - ideals)
        norms = np.sqrt(floors + (apart**2).sum(axis=1))
        return norms, np.einsum("nab,na->nb", roots, apart) / norms[:, None]

    def curvature(point: Floats) -> Floats:
        norms, slopes = costs(point)
        bend = np.einsum("nca,ncb->nab", roots, roots) - slopes[:, :, None] * slopes[:, None, :]
        return np.asarray(np.einsum("n,nab->ab", weights / norms, bend))

    # Ideals whose norm has nearly a corner: without a cost, up to ten times the radius (chosen).
    # Zero is the mean of the ideals.
    starts = [np.zeros(len(middle)), *ideals[floors < 100.0 * _CORNER]]
    minimum = minimize(
        lambda point: tuple(weights @ part for part in costs(point)),
        min(starts, key=lambda point: float(weights @ costs(point)[0])),
        jac=True,
        hess=curvature,
        method="trust-exact",
        # Both are chosen.
        options={"gtol": 1e-11, "maxiter": 300},
    )
    return np.asarray(middle + size * back @ minimum.x)


def minimax_excess(solution: EncounterSolution) -> Floats:
    """Return free values, shape (f,), that minimise the maximum weighted excess of a `solution`.

    With one M and equal weights, it is the centre of the smallest ball that contains the ideals of
    the craft with a weight above 0; other craft never count. Sequential quadratic programming on
    (p, t), minimum t with w_i e_i(p) <= t, then Newton's method on the conditions of the active
    craft. If weights differ by a factor of 1e4 and more, the maximum can be up to 1e-4 of itself
    above the minimum.
    """
    costs = [cost for cost in solution.costs if cost.craft.weight > 0.0]
    weights = np.array([cost.craft.weight for cost in costs])
    roots = np.array([cost.root for cost in costs])
    centres = np.array([cost.ideal for cost in costs])
    # The weights are in the matrices, so that the excesses below are weighted.
    matrices = np.einsum("n,nca,ncb->nab", weights, roots, roots)
    scale = np.linalg.inv(np.linalg.cholesky(matrices.mean(axis=0)).T)
    scaled = np.einsum("ca,ncd,db->nab", scale, matrices, scale)
    middle = centres.mean(axis=0)
    ideals = np.linalg.solve(scale, (centres - middle).T).T
    size = float(np.abs(ideals).max())
    if size == 0.0 or len(centres) == 1:
        return np.array(centres[0])
    ideals /= size

    def excess(point: Floats) -> Floats:
        apart = point - ideals
        return np.asarray(np.einsum("na,nab,nb->n", apart, scaled, apart))

    def slopes(point: Floats) -> Floats:
        return np.asarray(2.0 * np.einsum("nab,nb->na", scaled, point - ideals))

    initial = np.linalg.solve(scaled.sum(axis=0), np.einsum("nab,nb->a", scaled, ideals))
    free = len(initial)
    minimum = minimize(
        lambda x: x[-1],
        np.append(initial, excess(initial).max()),
        jac=lambda _: np.append(np.zeros(free), 1.0),
        constraints={
            "type": "ineq",
            "fun": lambda x: x[-1] - excess(x[:-1]),
            "jac": lambda x: np.column_stack([-slopes(x[:-1]), np.ones(len(ideals))]),
        },
        method="SLSQP",
        # Both are chosen; Newton's method follows.
        options={"ftol": 1e-15, "maxiter": 200},
    )
    best = _bound_craft(np.asarray(minimum.x[:-1]), excess, slopes, scaled)
    return np.asarray(middle + size * scale @ best)


def nearest_to(solution: EncounterSolution, preferred: Floats) -> Floats:
    """Return the Pareto-optimal free values of a `solution` nearest to `preferred` ones.

    Both have shape (f,), and the distance is the norm of M. An exact projection onto the convex
    hull of the ideals of all craft, also of those with a weight of 0.

    Raises
    ------
    ValueError
        If the M of two craft differ by more than a factor: the set is then curved.
    """
    matrices = np.array([cost.matrix for cost in solution.costs])
    unit = matrices / np.trace(matrices, axis1=1, axis2=2)[:, None, None]
    # Craft that start at one time have one M, up to a factor and rounding, which is below 1e-12.
    if not np.allclose(unit, unit[0], rtol=1e-12, atol=1e-15):
        raise ValueError(
            "the meeting nearest to a preferred one is known only for craft that start at the "
            "same time"
        )
    root = solution.costs[0].root
    ideals = solution.ideals
    known = (ideals - ideals[0]) @ root.T
    target = root @ (preferred - ideals[0])
    nearest = nearest_pair(known, target[None]).point
    return np.asarray(ideals[0] + np.linalg.solve(root, nearest))


def _scaled(solution: EncounterSolution) -> tuple[Floats, Floats, Floats, Floats, float, Floats]:
    """Return the craft of positive weight in coordinates x in which their M are of order one.

    The free values are p = middle + size back x. The results are the roots of M, `back`, the
    `middle` of the ideals, the ideals, `size`, which is zero if all ideals coincide, and the
    weights.
    """
    costs = [cost for cost in solution.costs if cost.craft.weight > 0.0]
    weights = np.array([cost.craft.weight for cost in costs])
    matrices = np.array([cost.matrix for cost in costs])
    ideals = np.array([cost.ideal for cost in costs])
    root = np.linalg.cholesky(np.einsum("n,nab->ab", weights / weights.sum(), matrices)).T
    back = np.linalg.inv(root)
    middle = ideals.mean(axis=0)
    apart = (ideals - middle) @ root.T
    size = float(np.linalg.norm(apart, axis=1).max())
    return (
        np.array([cost.root for cost in costs]) @ back,
        back,
        middle,
        apart / (size or 1.0),
        size,
        weights,
    )


def _bound_craft(
    point: Floats,
    excess: Callable[[Floats], Floats],
    slopes: Callable[[Floats], Floats],
    matrices: Floats,
) -> Floats:
    """Polish a minimax point: equal excesses of the active craft, slopes that cancel."""
    values = excess(point)
    # Craft within 1e-5 of the maximum are active; chosen, above the accuracy of the search.
    bound = np.flatnonzero(values >= values.max() * (1.0 - 1e-5))
    count = len(bound)
    free = len(point)
    # Shares of the active craft, of sum one, with which their slopes cancel.
    shares = np.linalg.lstsq(
        np.vstack([slopes(point)[bound].T, np.ones(count)]),
        np.append(np.zeros(free), 1.0),
        rcond=None,
    )[0]

    # Newton's method in the point, the shares of the slopes, and the excess of all. Its digits
    # double in each of the 8 steps, from the five of the search.
    best = point
    for _ in range(8):
        values = excess(point)[bound]
        tilts = slopes(point)[bound]
        top = float(values.mean())

        residual = np.concatenate([shares @ tilts, values - top, [shares.sum() - 1.0]])
        system = np.zeros((free + count + 1, free + count + 1))
        system[:free, :free] = 2.0 * np.einsum("n,nab->ab", shares, matrices[bound])
        system[:free, free : free + count] = tilts.T
        system[free : free + count, :free] = tilts
        system[free : free + count, -1] = -1.0
        system[-1, free : free + count] = 1.0

        step = np.linalg.lstsq(system, -residual, rcond=None)[0]
        point = point + step[:free]
        shares = shares + step[free : free + count]

    # The result of Newton's method has more digits, although rounding may make it greater by some
    # 1e-16; if it has diverged, the search's result is better.
    if excess(point).max() <= excess(best).max() * (1.0 + 1e-9):
        best = point
    return np.asarray(best)
