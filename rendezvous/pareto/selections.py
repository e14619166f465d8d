"""Choices of one meeting from the Pareto set."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import minimize

from infoset.geometry.polytope import nearest_difference
from rendezvous._arrays import Floats
from rendezvous._halton import halton
from rendezvous.pareto.front import simplex_weights
from rendezvous.pareto.solution import EncounterSolution

_MAX_STEPS = 200
_TRIED, _FOLLOWED, _MAX_ROUNDS = 500, 4, 20
_NEAREST = 1e-6


class NotOptimalError(ValueError):
    """The computed choice does not satisfy the conditions of the best one."""


def min_sum_of_costs(solution: EncounterSolution) -> Floats:
    """Return the free values, shape (f,), that minimise sum w_i J_i of a `solution`: costs like impulses.

    A sum of norms of affine functions, convex: damped Newton steps. If an ideal costs nothing, its norm has a corner
    there, which is the minimum if the others' slopes do not outweigh it.
    """
    roots, centres, floors, weights = _parts(solution)
    between = np.einsum("nab,nmb->nma", roots, centres[None] - centres[:, None])
    size = float(np.sqrt((between**2).sum(axis=-1).max()))
    active = weights > 0.0

    def parts(point: Floats) -> tuple[Floats, Floats]:
        apart = np.einsum("nab,nb->na", roots, point - centres)
        return apart, np.sqrt(floors + (apart**2).sum(axis=1))

    def value(point: Floats) -> float:
        return float(weights @ parts(point)[1])

    for corner in np.flatnonzero(active & (floors <= (1e-12 * size) ** 2)):
        point = centres[corner]
        apart, costs = parts(point)
        # Craft with the same ideal and no cost there have the same corner.
        here = costs <= 1e-9 * size
        slopes = np.einsum("n,nab,na->b", np.where(here, 0.0, weights / np.where(here, 1.0, costs)), roots, apart)
        if np.linalg.norm(np.linalg.solve(roots[corner].T, slopes)) <= weights[here].sum():
            return np.array(point)
    point = solution.point
    for _ in range(_MAX_STEPS):
        apart, costs = parts(point)
        shares = np.where(active, weights, 0.0) / np.maximum(costs, 1e-12 * size)
        slopes = np.einsum("nab,na->nb", roots, apart)
        slope = shares @ slopes
        bend = np.einsum("n,nca,ncb->ab", shares, roots, roots)
        curve = bend - np.einsum("n,na,nb->ab", shares / np.maximum(costs, 1e-12 * size) ** 2, slopes, slopes)
        step, lost = -np.linalg.solve(curve + 1e-12 * bend, slope), value(point)
        if abs(slope @ step) <= 1e-28 * lost or np.linalg.norm(roots[0] @ step) <= 1e-15 * size:
            break
        if slope @ step > 0.0 or not np.isfinite(step).all():
            step = -np.linalg.solve(bend, slope)  # Weiszfeld's step, always a descent
        length = 1.0
        while length > 1e-12 and value(point + length * step) > lost + 1e-4 * length * (slope @ step):
            length *= 0.5
        if length <= 1e-12:
            break
        point = point + length * step
    return np.asarray(point)


def minimax_excess(solution: EncounterSolution) -> Floats:
    """Return the free values, shape (f,), that minimise the maximum weighted excess of a `solution`.

    With one M, the centre of the smallest enclosing ball. Sequential quadratic programming on (p, t), minimum t with
    w_i e_i(p) <= t, then Newton's method on the conditions of the active craft.
    """
    counts = solution.encounter.weights > 0.0
    roots, centres, _, weights = (part[counts] for part in _parts(solution))
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
        options={"ftol": 1e-15, "maxiter": 200},
    )
    best = _bound_craft(np.asarray(minimum.x[:-1]), excess, slopes, scaled)
    return np.asarray(middle + size * scale @ best)


def nearest_to(solution: EncounterSolution, preferred: Floats) -> Floats:
    """Return the Pareto-optimal free values of a `solution` nearest to `preferred` ones, shape (f,).

    The norm is that of M, or that of the weighted mean of the M if they differ.

    With one M, or multiples of one, an exact projection onto the convex hull of the ideals; otherwise sequential
    quadratic programming over the weights from the nearest of many meetings of the set, which finds a local minimum.

    Raises
    ------
    NotOptimalError
        If the computed point does not satisfy the conditions of the nearest one.
    """
    roots, ideals, _, weights = _parts(solution)
    matrices = np.einsum("nca,ncb->nab", roots, roots)
    sizes = np.trace(matrices, axis1=1, axis2=2)
    unit = matrices / sizes[:, None, None]
    if np.allclose(unit, unit[0], rtol=1e-12, atol=1e-15):
        root, first = roots[0], ideals[0]
        known, target = (ideals - first) @ root.T, root @ (preferred - first)
        nearest = target + nearest_difference(known, target[None]) if known.any() else known[0]
        return np.asarray(first + np.linalg.solve(root, nearest))
    root = np.linalg.cholesky(np.einsum("n,nab->ab", weights / weights.sum(), matrices)).T
    back = np.linalg.inv(root)
    # In coordinates of the norm, about the preferred meeting, with M of one size: shares are then of one size too.
    unit = np.einsum("ca,ncd,db->nab", back, unit, back)
    sizes *= np.trace(unit, axis1=1, axis2=2)
    unit /= np.trace(unit, axis1=1, axis2=2)[:, None, None]
    ideals = (ideals - preferred) @ root.T
    size = float(np.linalg.norm(ideals, axis=1).max())
    if size == 0.0:
        return preferred
    ideals /= size

    def points(shares: Floats) -> Floats:
        left = np.einsum("kn,nab->kab", shares, unit)
        right = np.einsum("kn,nab,nb->ka", shares, unit, ideals)
        return np.asarray(np.linalg.solve(left, right[..., None])[..., 0])

    def distance(shares: Floats) -> tuple[float, Floats]:
        shares = np.maximum(shares, 0.0)
        point = points(shares[None])[0]
        pull = np.linalg.solve(np.einsum("n,nab->ab", shares, unit), point)
        return float(point @ point), 2.0 * np.einsum("nab,nb,a->n", unit, ideals - point, pull)

    count = len(ideals)
    # If the shapes of the M differ much, shares of a millionth matter.
    wide = 10.0 ** (-6.0 * halton(count, 3 * _TRIED - 1))
    candidates = np.concatenate([np.eye(count), np.full((1, count), 1.0 / count), simplex_weights(count, _TRIED), wide])
    nearest = np.argsort((points(candidates) ** 2).sum(axis=1), kind="stable")
    shares, left = _min_share(distance, candidates[nearest[0]]), np.inf
    for candidate in candidates[nearest[1:_FOLLOWED]]:
        other = _min_share(distance, candidate)
        shares = min(shares, other, key=lambda share: distance(share)[0])
    for _ in range(_MAX_ROUNDS):
        # The point depends on ratios of shares, so that zero is their only bound: if no change of a single share lowers
        # the distance, the conditions of the minimum hold.
        probes = _changed(shares)
        squared = (points(probes) ** 2).sum(axis=1)
        here = float(np.sqrt(distance(shares)[0]))
        left = here - float(np.sqrt(squared.min()))
        if left <= _NEAREST:
            return np.asarray(preferred + size * back @ points(shares[None])[0])
        shares = _min_share(distance, probes[squared.argmin()])
    raise NotOptimalError(
        "the Pareto-optimal meeting nearest to the preferred one was not found: one that is nearer by "
        f"{left:.2g} of the distance of the farthest ideal is known; prefer another one"
    )


def _min_share(distance: Callable[[Floats], tuple[float, Floats]], initial: Floats) -> Floats:
    """Shares of sum one, from initial ones, at which a squared distance is smallest."""
    scale = np.maximum(initial / initial.sum(), 1e-6)

    def scaled(x: Floats) -> tuple[float, Floats]:
        squared, slopes = distance(x * scale)
        return squared, slopes * scale

    minimum = minimize(
        scaled,
        initial / scale,
        jac=True,
        bounds=[(0.0, 1.0 / size) for size in scale],
        constraints={"type": "eq", "fun": lambda x: x @ scale - 1.0, "jac": lambda _: scale},
        method="SLSQP",
        options={"ftol": 1e-16, "maxiter": 300},
    )
    shares = np.maximum(minimum.x * scale, 0.0)
    return np.asarray(shares / shares.sum() if np.isfinite(shares).all() and shares.sum() > 0.0 else initial)


def _changed(shares: Floats) -> Floats:
    """Shares of which one is increased, or decreased, by steps of all sizes, shape (k, n)."""
    steps = 10.0 ** -np.arange(0.0, 13.0)
    greater = shares + steps[:, None, None] * np.eye(len(shares))
    less = shares * (1.0 - steps[:, None, None] * np.eye(len(shares)))
    changed = np.concatenate([greater, less]).reshape(-1, len(shares))
    return np.asarray(changed[changed.sum(axis=1) > 0.0])


def _parts(solution: EncounterSolution) -> tuple[Floats, Floats, Floats, Floats]:
    """Roots of M, ideals, J*^2 and weights of the craft."""
    return (
        np.array([cost.root for cost in solution.costs]),
        solution.ideals,
        np.array([cost.ideal_cost_squared for cost in solution.costs]),
        solution.encounter.weights,
    )


def _bound_craft(
    point: Floats, excess: Callable[[Floats], Floats], slopes: Callable[[Floats], Floats], matrices: Floats
) -> Floats:
    """Polish a minimax point: equal excesses of the active craft, slopes that cancel."""
    values = excess(point)
    bound = np.flatnonzero(values >= values.max() * (1.0 - 1e-5))
    count, free = len(bound), len(point)
    shares = np.linalg.lstsq(
        np.vstack([slopes(point)[bound].T, np.ones(count)]), np.append(np.zeros(free), 1.0), rcond=None
    )[0]
    best = point
    for _ in range(8):
        values, tilts = excess(point)[bound], slopes(point)[bound]
        top = float(values.mean())
        residual = np.concatenate([shares @ tilts, values - top, [shares.sum() - 1.0]])
        system = np.zeros((free + count + 1, free + count + 1))
        system[:free, :free] = 2.0 * np.einsum("n,nab->ab", shares, matrices[bound])
        system[:free, free : free + count] = tilts.T
        system[free : free + count, :free] = tilts
        system[free : free + count, -1] = -1.0
        system[-1, free : free + count] = 1.0
        step = np.linalg.lstsq(system, -residual, rcond=None)[0]
        point, shares = point + step[:free], shares + step[free : free + count]
    return np.asarray(point if excess(point).max() <= excess(best).max() * (1.0 + 1e-9) else best)
