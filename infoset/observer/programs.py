"""Bounds of a state over all motions that agree with a record: linear programs, without sets."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from scipy.optimize import linprog

from infoset.arrays import Floats
from infoset.geometry.polytope import HIGHS
from infoset.geometry.zonotope import Zonotope
from infoset.observer.sets import Motion, Set, polytope_of
from infoset.observer.steps import Strips


def exact_hull(initial: Set, record: Sequence[Motion | Strips], run: int, step: int, sizes: Floats) -> Floats:
    """Return the minimum and the maximum of each state of a `run` at a `step`, shape (2, n); NaN if none is possible.

    The unknowns are the states of all steps, in units of `sizes`, shape (n,), and coefficients of the generators of the
    initial set and of the disturbances (of a polytope: of its vertices, with the sum 1). Errors are about 1e-9 of the
    sizes.
    """
    n, motions = len(sizes), [event for event in record if isinstance(event, Motion)]
    rows, limits, at = [[np.zeros((0, n))] for _ in range(len(motions) + 1)], list[Floats](), 0
    for event in record:
        if isinstance(event, Motion):
            at += 1
            continue
        sides = np.vstack([event.normals, -event.normals]) * sizes
        ends = np.concatenate([event.upper[run], -event.lower[run]])
        lengths = np.abs(sides).max(axis=1)
        used = np.isfinite(ends) & (lengths > 0.0)
        rows[at].append(sides[used] / lengths[used, None])
        limits.append(ends[used] / lengths[used])
    sets = [_generators(shape, sizes) for shape in (initial, *(motion.disturbance for motion in motions))]
    shifts = [np.zeros(n), *(motion.shifts[run % len(motion.shifts)] / sizes for motion in motions)]
    # x_k+1 - A x_k - generators z_k = shift_k + centre_k, and the sum of the coefficients of vertices.
    matrices = [motion.matrix * sizes / sizes[:, None] for motion in motions]
    before = sp.block_diag([np.zeros((n, 0)), *matrices, np.zeros((0, n))])
    added = sp.block_diag([generators.T for generators, _, _ in sets])
    sums = sp.block_diag([np.full((1, len(generators)), float(convex)) for generators, _, convex in sets])
    equations = sp.block_array([[sp.eye_array(before.shape[0]) - before, -added], [None, sums]]).tocsr()
    heights = [shift + centre for shift, (_, centre, _) in zip(shifts, sets, strict=True)]
    levels = np.concatenate([*heights, [float(convex) for _, _, convex in sets]])
    inside = sp.hstack(
        [sp.block_diag([np.vstack(part) for part in rows]), sp.csr_array((sum(map(len, limits)), added.shape[1]))]
    )
    least = np.concatenate(
        [np.full(before.shape[0], -np.inf), *(np.full(len(g), convex - 1.0) for g, _, convex in sets)]
    )
    bounds = np.column_stack([least, np.where(np.isinf(least), np.inf, 1.0)])
    hull = np.full((2, n), np.nan)
    for end, sign in enumerate((1.0, -1.0)):
        for i in range(n):
            cost = np.zeros(len(bounds))
            cost[step * n + i] = sign
            optimum = linprog(cost, inside, np.concatenate(limits), equations, levels, bounds, "highs", options=HIGHS)
            if optimum.status == 0:
                hull[end, i] = sign * optimum.fun * sizes[i]
    return hull


def _generators(shape: Set, sizes: Floats) -> tuple[Floats, Floats, bool]:
    """Return generators, shape (g, n), the centre, and whether the coefficients are those of vertices: >= 0, sum 1."""
    if isinstance(shape, Zonotope):
        return shape.generators / sizes, shape.centre / sizes, False
    return polytope_of(shape).vertices / sizes, np.zeros(len(sizes)), True
