"""The minimum terminal norm, and bounds and margins, as one dense cone program over the controls."""

from __future__ import annotations

from typing import Any

import clarabel
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix

from rendezvous.reachability import ReachabilityProblem, ThrustShape

Floats = NDArray[np.float64]


class Dense:
    """A problem as matrices of the controls divided by their bounds: minimise |free + response v|, rows v <= limits.

    Written straight from x(t + 1) = A x + B u.
    """

    def __init__(self, problem: ReachabilityProblem) -> None:
        periods, n, m = problem.periods, problem.states, problem.controls
        normals = [np.eye(n) / problem.state_bounds[:, None], -np.eye(n) / problem.state_bounds[:, None]]
        offsets = [np.ones((periods + 1, 2 * n))]
        if problem.normals is not None and problem.offsets is not None:
            sizes = np.linalg.norm(problem.normals * problem.state_bounds, axis=1)
            normals.append(problem.normals / sizes[:, None])
            offsets.append(problem.offsets / sizes)
        sides, ends = np.vstack(normals), np.hstack(offsets)
        bounds = problem.control_bounds
        state, moved = problem.initial, np.zeros((n, periods * m))
        rows, limits = [], []
        for t in range(periods):
            now = np.zeros((m, periods * m))
            now[:, t * m : (t + 1) * m] = np.diag(bounds)
            if problem.between is not None:
                for each in problem.between[t]:
                    kept = np.isfinite(ends[t])
                    inner, push = each[:, :n], each[:, n:]
                    rows.append(sides[kept] @ (inner @ moved + push @ now))
                    limits.append(ends[t][kept] - sides[kept] @ (inner @ state))
            a, b = problem.transition[t], problem.control[t]
            state, moved = a @ state, a @ moved + b @ now
            kept = np.isfinite(ends[t + 1])
            rows.append(sides[kept] @ moved)
            limits.append(ends[t + 1][kept] - sides[kept] @ state)
        self.free, self.response = state, moved
        self.rows, self.limits = np.vstack(rows), np.concatenate(limits)
        self.group = m if problem.thrust is ThrustShape.BALL else 1


def cone_program(given: Dense, kind: str) -> tuple[float, Floats]:
    """Minimise the norm, or maximise a margin (deep), or minimise the bound on controls that reaches zero (bound)."""
    size = given.response.shape[1]
    rows, limits, cones = [], [], []

    def add(block: Floats, end: Floats, cone: Any) -> None:
        rows.append(block)
        limits.append(end)
        cones.append(cone)

    wide = np.hstack([given.rows, np.zeros((len(given.rows), 1))])
    lengths = np.maximum(np.linalg.norm(given.rows, axis=1), 1e-9)
    if kind == "deep":
        wide[:, -1] = lengths
    add(wide / np.maximum(1.0, lengths)[:, None], given.limits / np.maximum(1.0, lengths), None)
    cones[-1] = clarabel.NonnegativeConeT(len(wide))
    unit = np.eye(size, size + 1)
    for first in range(0, size, given.group):
        block, end = np.vstack([np.zeros((1, size + 1)), -unit[first : first + given.group]]), np.zeros(given.group + 1)
        end[0] = 0.0 if kind == "bound" else 1.0
        block[0, -1] = {"bound": -1.0, "deep": 1.0, "norm": 0.0}[kind]
        add(block, end, clarabel.SecondOrderConeT(given.group + 1))
    cost = np.zeros(size + 1)
    cost[-1] = -1.0 if kind == "deep" else 1.0
    scale = max(1.0, float(np.abs(given.free).max()))
    wide = np.hstack([given.response, np.zeros((len(given.free), 1))]) / scale
    if kind == "bound":
        weights = 1.0 / np.maximum(np.linalg.norm(wide, axis=1), 1e-9)
        add(wide * weights[:, None], -given.free / scale * weights, clarabel.ZeroConeT(len(wide)))
    elif kind == "norm":
        add(
            np.vstack([-cost, -wide]),
            np.concatenate([[0.0], given.free / scale]),
            clarabel.SecondOrderConeT(len(wide) + 1),
        )
    else:
        add(-cost[None, :], np.ones(1), clarabel.NonnegativeConeT(1))
    best: tuple[float, Floats] = (np.nan, np.zeros(size))
    for settings in ({}, {"static_regularization_constant": 1e-6}, {"equilibrate_enable": False}):
        chosen = clarabel.DefaultSettings()
        chosen.verbose = False
        chosen.tol_gap_abs = chosen.tol_gap_rel = chosen.tol_feas = 1e-10
        for name, value in settings.items():
            setattr(chosen, name, value)
        found = clarabel.DefaultSolver(
            csc_matrix((size + 1,) * 2), cost, csc_matrix(np.vstack(rows)), np.concatenate(limits), cones, chosen
        ).solve()
        best = float(found.x[-1]) * (scale if kind == "norm" else 1.0), np.array(found.x[:-1])
        if found.status == clarabel.SolverStatus.Solved:
            return best
    return np.nan, best[1]
