"""Membership of points in a zonotope: a linear program proposes, sums of products decide."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linprog

from infoset.arrays import Flags, Floats, Integers
from infoset.geometry.polytope._measures import HIGHS
from infoset.geometry.polytope.errors import SolverError
from infoset.geometry.tolerances import EPS

_REACH = 2.0
"""Maximum multiple of a point for which the program searches.

A point is inside if a multiple from one on is; two is clearly beyond one.
"""
_DEPENDENT = 1e-6
"""Distance of a unit vector from a span below which it gives no new direction.

It is far above rounding, and random generators are rarely so near to a span.
"""


def are_inside(points: Floats, generators: Floats, basis: Integers, rounding: Floats) -> Flags:
    """Return which points, shape (k, d), are in or near the zonotope of generators around zero.

    A point counts as inside if a box of the half-widths `rounding`, shape (k, d), around it meets
    the zonotope. Of the generators, shape (m, d), the ones with the numbers `basis`, shape (d,),
    are unit vectors along the axes, or their opposites. Most points are decided by the bounding
    box, or by coefficients of least squares; each of the others needs a linear program.
    """
    # Outside of the bounding box a point is outside; all others are candidates.
    radius = np.abs(generators).sum(axis=0)
    found = (np.abs(points) <= radius + rounding).all(axis=1)

    coefficients = points @ np.linalg.pinv(generators)
    sure = np.abs(coefficients).max(axis=1) <= 1.0
    sure &= (np.abs(points - coefficients @ generators) <= rounding).all(axis=1)
    for k in np.flatnonzero(found & ~sure):
        found[k] = _is_inside(points[k], generators, basis, rounding[k])
    return np.asarray(found)


def _is_inside(point: Floats, generators: Floats, basis: Integers, rounding: Floats) -> bool:
    """Return whether a point is in the zonotope, from its largest multiple that is.

    Coefficients up to one that give the point prove that it is inside. A plane between the point
    and the zonotope proves that it is outside. If the solver finds neither, the point is closer to
    the boundary than its tolerance, 1e-10 of the size; it counts as inside.
    """
    count, space = generators.shape
    cost = np.zeros(count + 1)
    cost[-1] = -1.0
    equations = np.column_stack([generators.T, -point])
    bounds = np.array([[-1.0, 1.0]] * count + [[0.0, _REACH]])
    optimum = linprog(
        cost, A_eq=equations, b_eq=np.zeros(space), bounds=bounds, method="highs-ds", options=HIGHS
    )
    if optimum.status != 0:
        raise SolverError(f"the linear program of membership was not solved: {optimum.message}")

    multiple = float(optimum.x[-1])
    if multiple > 1.0:
        coefficients = np.clip(optimum.x[:-1], -1.0, 1.0) / multiple
        # The coefficients of the basis correct the error of the solver.
        missing = np.abs(point - coefficients @ generators)
        # Only their sizes count now: a correction of either sign must leave them up to one.
        coefficients[basis] = np.abs(coefficients[basis]) + missing
        if np.abs(coefficients).max() <= 1.0:
            return True

    normal = np.asarray(optimum.eqlin.marginals)
    proposals = (normal, _sharpened(normal, generators))
    return not any(_separates(one, point, generators, rounding) for one in proposals)


def _separates(normal: Floats, point: Floats, generators: Floats, rounding: Floats) -> bool:
    """Return whether a plane with this normal is between a point, rounded, and the zonotope."""
    reach = np.abs(generators @ normal).sum()
    terms = np.abs(normal) @ (np.abs(generators).sum(axis=0) + np.abs(point))
    # A sum over generators of scalar products is rounded m + d times; four more roundings are for
    # the other sums of this function.
    unsure = np.abs(normal) @ rounding + (sum(generators.shape) + 4) * EPS * terms
    return bool(abs(normal @ point) > reach + unsure)


def _sharpened(normal: Floats, generators: Floats) -> Floats:
    """Return the normal of the facet that is near a normal found by the solver.

    It is orthogonal to the d - 1 independent generators that are most orthogonal to the given
    normal.
    """
    length = np.linalg.norm(normal)
    if not length:
        return normal

    sharp = normal / length
    lengths = np.linalg.norm(generators, axis=1)
    rows = generators[lengths > 0.0] / lengths[lengths > 0.0, None]
    plane = np.zeros((0, len(normal)))
    for row in rows[np.argsort(np.abs(rows @ sharp), kind="stable")]:
        if len(plane) == len(normal) - 1:
            break
        # Gram-Schmidt, twice against rounding.
        rest = row - (plane @ row) @ plane
        rest = rest - (plane @ rest) @ plane
        size = np.linalg.norm(rest)
        if size > _DEPENDENT:
            plane = np.vstack([plane, rest / size])

    for _ in range(2):  # the second pass corrects rounding
        sharp = sharp - (plane @ sharp) @ plane
    return sharp
