"""The minimum terminal norm in forty decimal digits, by a barrier method.

It shares no code with the package.
"""

from __future__ import annotations

from decimal import Decimal, localcontext
from typing import Any

import clarabel
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix

from infoset.arrays import Floats
from infoset.rendezvous.reachability import ReachabilityProblem, ThrustShape

Numbers = NDArray[Any]

DIGITS = 40
GAP = 1e-15
"""Duality gap of a precise norm, relative to it: less than the rounding of the data in doubles."""
_decimals = np.vectorize(lambda value: Decimal(float(value)), otypes=[object])


class Dense:
    """Minimise |free + response v| over rows v <= limits, with controls v divided by their bounds.

    The matrices come directly from x(t + 1) = A x + B u, in the number type of `convert`.
    """

    def __init__(self, problem: ReachabilityProblem, convert: Any = np.asarray) -> None:
        periods = problem.periods
        n = problem.states
        m = problem.controls
        normals = [
            np.eye(n) / problem.state_bounds[:, None],
            -np.eye(n) / problem.state_bounds[:, None],
        ]
        offsets = [np.ones((periods + 1, 2 * n))]
        if problem.normals is not None and problem.offsets is not None:
            sizes = np.linalg.norm(problem.normals * problem.state_bounds, axis=1)
            normals.append(problem.normals / sizes[:, None])
            offsets.append(problem.offsets / sizes)
        sides = convert(np.vstack(normals))
        ends = np.hstack(offsets)
        bounds = convert(problem.control_bounds)
        state = convert(problem.initial)
        moved = convert(np.zeros((n, periods * m)))
        rows = []
        limits = []
        for t in range(periods):
            now = convert(np.zeros((m, periods * m)))
            now[:, t * m : (t + 1) * m] = np.diag(bounds)
            if problem.between is not None:
                for each in problem.between[t]:
                    kept = np.isfinite(ends[t])
                    inner = convert(each[:, :n])
                    push = convert(each[:, n:])
                    rows.append(sides[kept] @ (inner @ moved + push @ now))
                    limits.append(convert(ends[t][kept]) - sides[kept] @ (inner @ state))
            a = convert(problem.transition[t])
            b = convert(problem.control[t])
            state = a @ state
            moved = a @ moved + b @ now
            kept = np.isfinite(ends[t + 1])
            rows.append(sides[kept] @ moved)
            limits.append(convert(ends[t + 1][kept]) - sides[kept] @ state)
        self.free = state
        self.response = moved
        self.rows = np.vstack(rows)
        self.limits = np.concatenate(limits)
        self.group = m if problem.thrust is ThrustShape.BALL else 1


def cone_program(given: Dense, kind: str) -> tuple[float, Floats]:
    """Solve one of three problems (`kind`) and return its value and the controls.

    norm: the minimum norm; deep: the maximum margin; bound: the minimum bound on the controls with
    which zero is reached.
    """
    size = given.response.shape[1]
    rows = []
    limits = []
    cones = []

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
        block = np.vstack([np.zeros((1, size + 1)), -unit[first : first + given.group]])
        end = np.zeros(given.group + 1)
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
            csc_matrix((size + 1,) * 2),
            cost,
            csc_matrix(np.vstack(rows)),
            np.concatenate(limits),
            cones,
            chosen,
        ).solve()
        best = float(found.x[-1]) * (scale if kind == "norm" else 1.0), np.array(found.x[:-1])
        if found.status == clarabel.SolverStatus.Solved:
            return best
    return np.nan, best[1]


def precise_min_norm(problem: ReachabilityProblem) -> tuple[float, float] | None:
    """Return the minimum terminal norm and its rounding in doubles.

    The result is None if no control is well inside the constraints. A logarithmic barrier is
    followed to a duality gap of `GAP`: in floats while they are exact enough, then in Decimal.
    """
    radius, start = cone_program(Dense(problem), "deep")
    if not radius > 1e-6:
        return None
    with localcontext() as context:
        context.prec = DIGITS
        rough = Dense(problem)
        exact = Dense(problem, _decimals)
        state = rough.free + rough.response @ start
        t = 2.0 * float(np.linalg.norm(state)) + 1e-3
        smallest = 1e-15 * (
            float(np.abs(rough.free).max()) + float(np.abs(rough.response).sum(axis=1).max())
        )
        count = 2.0 + len(rough.limits) + 2.0 * len(start) / rough.group
        weight = t
        point = np.append(start, t)
        while weight > 1e-5 * t:
            point = _centred(rough, point, weight)
            weight *= 0.2
        numbers = _decimals(point)
        while count * weight > GAP * float(numbers[-1]) and float(numbers[-1]) > smallest:
            numbers = _centred(exact, numbers, Decimal(weight))
            weight *= 0.2
        value = float(numbers[-1])
        state = np.array(exact.free + exact.response @ numbers[:-1], dtype=float)
        along = np.abs(state) / max(float(np.linalg.norm(state)), 1e-300)
        rounding = (
            float(along @ (np.abs(rough.free) + np.abs(rough.response).sum(axis=1))) * 2.0**-52
        )
        return (value if value > smallest else 0.0), rounding


def _centred(given: Dense, point: Numbers, weight: Any) -> Numbers:
    """Newton's method on t / weight - log(t^2 - |y|^2) - sum log slack - sum log(1 - |v|^2)."""
    for _ in range(60):
        gradient, hessian = _slopes(given, point, weight)
        step = _solved(hessian, -gradient)
        decrement = -(gradient @ step)
        length = type(decrement)(1) if isinstance(decrement, Decimal) else 1.0
        half = length / 2
        while not _inside(given, point + length * step):
            length = length * half
        if length < 1:
            length = length * half
        point = point + length * step
        if decrement < 0.1 and length == 1:
            return point
    raise ArithmeticError("the barrier method did not reach its path")


def _inside(given: Dense, point: Numbers) -> bool:
    v = point[:-1]
    t = point[-1]
    y = given.free + given.response @ v
    thrust = (v.reshape(-1, given.group) ** 2).sum(axis=1)
    return bool(
        t > 0 and t * t > y @ y and (given.limits - given.rows @ v).min() > 0 and thrust.max() < 1
    )


def _slopes(given: Dense, point: Numbers, weight: Any) -> tuple[Numbers, Numbers]:
    v = point[:-1]
    t = point[-1]
    size = len(v)
    gradient = point * 0
    hessian = np.outer(point, point) * 0
    y = given.free + given.response @ v
    room = t * t - y @ y
    slope = np.append(-2 * (given.response.T @ y), 2 * t) / room
    gradient += -slope
    hessian += np.outer(slope, slope)
    hessian[:size, :size] += given.response.T @ given.response * (2 / room)
    hessian[size, size] -= 2 / room
    gradient[size] += 1 / weight
    weighed = given.rows / (given.limits - given.rows @ v)[:, None]
    gradient[:size] += weighed.sum(axis=0)
    hessian[:size, :size] += weighed.T @ weighed
    for first in range(0, size, given.group):
        mine = slice(first, first + given.group)
        left = 1 - v[mine] @ v[mine]
        gradient[mine] += 2 * v[mine] / left
        hessian[mine, mine] += np.outer(v[mine], v[mine]) * (4 / left**2)
        places = np.arange(first, first + given.group)
        hessian[places, places] += 2 / left
    return gradient, hessian


def _solved(matrix: Numbers, right: Numbers) -> Numbers:
    """Solve a positive definite system by elimination, in floats or Decimal."""
    if matrix.dtype == float:
        scale = 1.0 / np.sqrt(np.diag(matrix))
        return np.asarray(scale * np.linalg.solve(matrix * np.outer(scale, scale), scale * right))
    matrix = matrix.copy()
    right = right.copy()
    count = len(right)
    for k in range(count):
        factors = matrix[k + 1 :, k] / matrix[k, k]
        matrix[k + 1 :, k:] -= np.outer(factors, matrix[k, k:])
        right[k + 1 :] -= factors * right[k]
    for k in range(count - 1, -1, -1):
        right[k] = (right[k] - matrix[k, k + 1 :] @ right[k + 1 :]) / matrix[k, k]
    return right
