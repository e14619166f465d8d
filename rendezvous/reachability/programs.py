"""Convex programs over admissible controls: linear by HiGHS or an interior point, quadratic and conic by Clarabel."""

from __future__ import annotations

from dataclasses import dataclass

import clarabel
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog
from scipy.sparse import csc_matrix

from rendezvous.polytope.relative_interior import HIGHS
from rendezvous.reachability.lifted import Lifted

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

_GAP = 1e-10
_BROKEN = 3e-10
_NEAR = 2
_MANY_ROWS = 200
_STILL = 1e-9


class NoSolutionError(ArithmeticError):
    """A program that has a solution was not solved."""


@dataclass(frozen=True, eq=False)
class Optimum:
    """A solution of a program: the point, and the multipliers of the rows (none negative)."""

    point: Floats
    multipliers: Floats


class Maximiser:
    """Maximise many linear functions over one set of controls.

    Parameters
    ----------
    lifted : Lifted
        Not empty.

    Notes
    -----
    An interior point (Clarabel), which costs less a program than the simplex method does to begin; that (HiGHS) solves
    what the interior point does not. Of many constraints on states most never matter: it begins without any, and adds
    one, at all times, once a solution breaks it.
    """

    def __init__(self, lifted: Lifted) -> None:
        self._lifted = lifted
        soft = lifted.moments >= 0
        self._used = np.ones(len(soft), dtype=bool) if soft.sum() < _MANY_ROWS else ~soft
        self._program = _Repeated(lifted, self._used) if lifted.size else None

    def maximise(self, cost: Floats) -> Floats:
        """Return a maximiser of a linear function.

        Parameters
        ----------
        cost : ndarray, shape (p,)

        Returns
        -------
        ndarray, shape (p,)

        Raises
        ------
        NoSolutionError
            If the program was not solved.
        """
        return self._solved(cost).point

    def _solved(self, cost: Floats) -> Optimum:
        if self._program is None:
            return Optimum(np.zeros(0), np.zeros(int(self._used.sum())))
        while True:
            found = self._program.maximise(cost)
            if self._used.all():
                return found
            broken = (self._lifted.rows @ found.point - self._lifted.limits > _BROKEN) & ~self._used
            if not broken.any():
                return found
            for place in np.flatnonzero(broken):
                near = np.abs(self._lifted.moments - self._lifted.moments[place]) <= _NEAR
                self._used = self._used | (near & (self._lifted.labels == self._lifted.labels[place]))
            self._program = _Repeated(self._lifted, self._used)

    def maximise_sharply(self, cost: Floats) -> Floats:
        """Return a maximiser that is on its active rows to rounding; for thrust in a ball, to the program's tolerance.

        Parameters
        ----------
        cost : ndarray, shape (p,)

        Returns
        -------
        ndarray, shape (p,)

        Notes
        -----
        The shortest step onto the rows with multipliers above their slacks: a least-squares problem more.
        """
        found = self._solved(cost)
        if not self._lifted.size or self._lifted.ball:
            return found.point
        rows, limits = self._lifted.rows[self._used], self._lifted.limits[self._used]
        active = found.multipliers > limits - rows @ found.point
        held = np.vstack([self._lifted.equal, rows[active]])
        missing = np.concatenate([self._lifted.levels, limits[active]]) - held @ found.point
        moved = found.point + np.linalg.lstsq(held, missing, rcond=1e-12)[0]
        kept = float((self._lifted.limits - self._lifted.rows @ moved).min(initial=0.0)) > -_BROKEN
        return moved if kept else found.point


def maximise(lifted: Lifted, costs: Floats) -> Floats:
    """Maximise linear functions over a set of controls.

    Parameters
    ----------
    lifted : Lifted
        Not empty.
    costs : ndarray, shape (k, p)

    Returns
    -------
    ndarray, shape (k, p)
        A maximiser of each.

    Raises
    ------
    NoSolutionError
        If a program was not solved.

    Notes
    -----
    A program each: see `Maximiser`.
    """
    program = Maximiser(lifted)
    return np.array([program.maximise(cost) for cost in costs]).reshape(len(costs), lifted.size)


def least_relaxation(lifted: Lifted) -> tuple[float, Floats]:
    """Return by how much all rows on states, and the equations' misfit, must be relaxed to leave a point; and one.

    Parameters
    ----------
    lifted : Lifted

    Returns
    -------
    relaxation : float
        Not below -1, which is where the search stops; not positive where the set is not empty.
    point : ndarray, shape (p,)

    Raises
    ------
    NoSolutionError
        If the program was not solved.

    Notes
    -----
    One linear program, or one with cones for thrust in a ball. Bounds on controls are not relaxed.
    """
    soft = lifted.moments >= 0
    size = lifted.size
    rows = np.column_stack([lifted.rows, -soft.astype(float)])
    about = np.column_stack([lifted.equal, -np.ones(len(lifted.equal))])
    other = np.column_stack([-lifted.equal, -np.ones(len(lifted.equal))])
    floor = np.zeros((1, size + 1))
    floor[0, -1] = -1.0
    # A misfit of an equation is at least zero; without equations the relaxation may be negative: a margin.
    matrix = np.vstack([rows, about, other, floor])
    limits = np.concatenate([lifted.limits, lifted.levels, -lifted.levels, [1.0 if not len(about) else 0.0]])
    cost = np.zeros(size + 1)
    cost[-1] = 1.0
    if lifted.ball:
        wide = np.column_stack([lifted.control_response, np.zeros(len(lifted.control_free))])
        found = _conic(np.zeros((0, 0)), cost, matrix, limits, (wide, lifted.control_free, lifted.ball))
        return float(found.point[-1]), found.point[:-1]
    solved = linprog(cost, A_ub=matrix, b_ub=limits, bounds=(None, None), method="highs", options=HIGHS)
    if solved.status != 0:
        raise NoSolutionError(f"HiGHS: {solved.message}")
    return float(solved.x[-1]), solved.x[:-1]


def quadratic(lifted: Lifted, matrix: Floats, vector: Floats) -> Optimum:
    """Minimise v . matrix v / 2 + vector . v over a set of controls without equations.

    Parameters
    ----------
    lifted : Lifted
    matrix : ndarray, shape (p, p)
        Positive semidefinite.
    vector : ndarray, shape (p,)

    Returns
    -------
    Optimum

    Raises
    ------
    NoSolutionError
        If it was not solved.

    Notes
    -----
    Clarabel; for a box the solution is then put where its active rows meet, which gives it all its digits.
    """
    if not lifted.size:
        return Optimum(np.zeros(0), np.zeros(len(lifted.limits)))
    cone = (lifted.control_response, lifted.control_free, lifted.ball) if lifted.ball else None
    found = _conic(matrix, vector, lifted.rows, lifted.limits, cone)
    return found if lifted.ball else _polished(found, matrix, vector, lifted.rows, lifted.limits)


def least_sum_of_norms(lifted: Lifted, scale: Floats, group: int) -> Floats:
    """Minimise the sum over the periods of the Euclidean norms of a control.

    Parameters
    ----------
    lifted : Lifted
        Without equations.
    scale : ndarray, shape (T m,)
        Units of the controls.
    group : int
        Number m of controls a period.

    Returns
    -------
    ndarray, shape (p,)

    Raises
    ------
    NoSolutionError
        If the program was not solved.

    Notes
    -----
    A second-order cone a period (Clarabel).
    """
    periods = len(lifted.control_free) // group
    size = lifted.size
    cost = np.concatenate([np.zeros(size), np.ones(periods)])
    rows = np.hstack([lifted.rows, np.zeros((len(lifted.rows), periods))])
    matrices, limits = [rows], [lifted.limits]
    cones = [clarabel.NonnegativeConeT(len(rows))]
    for t in range(periods):
        block = np.zeros((group + 1, size + periods))
        block[0, size + t] = -1.0
        mine = slice(t * group, (t + 1) * group)
        block[1:, :size] = -scale[mine, None] * lifted.control_response[mine]
        matrices.append(block)
        limits.append(np.concatenate([[0.0], scale[mine] * lifted.control_free[mine]]))
        cones.append(clarabel.SecondOrderConeT(group + 1))
    if lifted.ball:
        wide = np.hstack([lifted.control_response, np.zeros((len(lifted.control_free), periods))])
        block, ends, more = _ball_rows((wide, lifted.control_free, lifted.ball))
        matrices.append(block)
        limits.append(ends)
        cones += more
    empty = csc_matrix((size + periods, size + periods))
    return _solve(empty, cost, csc_matrix(np.vstack(matrices)), np.concatenate(limits), cones).point[:size]


def least_peak(lifted: Lifted, scale: Floats, group: int) -> tuple[float, Floats]:
    """Find the least bound that all controls can keep: of each component, or of the norm for thrust in a ball.

    Parameters
    ----------
    lifted : Lifted
        Without equations.
    scale : ndarray, shape (T m,)
        Units of the controls.
    group : int
        Number m of controls a period.

    Returns
    -------
    bound : float
    point : ndarray, shape (p,)
        Where it is kept.

    Raises
    ------
    NoSolutionError
        If the program was not solved.

    Notes
    -----
    A linear program (HiGHS), or one with cones (Clarabel).
    """
    size = lifted.size
    cost = np.concatenate([np.zeros(size), [1.0]])
    rows = np.hstack([lifted.rows, np.zeros((len(lifted.rows), 1))])
    if lifted.ball:
        matrices, limits, cones = [rows], [lifted.limits], [clarabel.NonnegativeConeT(len(rows))]
        for t in range(len(lifted.control_free) // group):
            mine = slice(t * group, (t + 1) * group)
            block = np.zeros((group + 1, size + 1))
            block[0, size] = -1.0
            block[1:, :size] = -scale[mine, None] * lifted.control_response[mine]
            matrices.append(block)
            limits.append(np.concatenate([[0.0], scale[mine] * lifted.control_free[mine]]))
            cones.append(clarabel.SecondOrderConeT(group + 1))
        empty = csc_matrix((size + 1, size + 1))
        solved = _solve(empty, cost, csc_matrix(np.vstack(matrices)), np.concatenate(limits), cones)
        return float(solved.point[-1]), solved.point[:-1]
    turned = scale[:, None] * lifted.control_response
    below = -np.ones((len(turned), 1))
    matrix = np.vstack([rows, np.hstack([turned, below]), np.hstack([-turned, below])])
    ends = np.concatenate([lifted.limits, -scale * lifted.control_free, scale * lifted.control_free])
    found = linprog(cost, A_ub=matrix, b_ub=ends, bounds=(None, None), method="highs", options=HIGHS)
    if found.status != 0:
        raise NoSolutionError(f"HiGHS: {found.message}")
    return float(found.x[-1]), found.x[:-1]


def least_l1(lifted: Lifted, scale: Floats) -> Floats:
    """Minimise the sum of the absolute values of all controls.

    Parameters
    ----------
    lifted : Lifted
        Without equations.
    scale : ndarray, shape (T m,)
        Units of the controls.

    Returns
    -------
    ndarray, shape (p,)

    Raises
    ------
    NoSolutionError
        If the program was not solved.

    Notes
    -----
    A linear program (HiGHS), or one with cones (Clarabel) for thrust in a ball.
    """
    size, count = lifted.size, len(scale)
    turned, below = scale[:, None] * lifted.control_response, -np.eye(count)
    matrix = np.vstack(
        [
            np.hstack([lifted.rows, np.zeros((len(lifted.rows), count))]),
            np.hstack([turned, below]),
            np.hstack([-turned, below]),
        ]
    )
    ends = np.concatenate([lifted.limits, -scale * lifted.control_free, scale * lifted.control_free])
    cost = np.concatenate([np.zeros(size), np.ones(count)])
    if lifted.ball:
        wide = np.hstack([lifted.control_response, np.zeros((count, count))])
        return _conic(np.zeros((0, 0)), cost, matrix, ends, (wide, lifted.control_free, lifted.ball)).point[:size]
    found = linprog(cost, A_ub=matrix, b_ub=ends, bounds=(None, None), method="highs", options=HIGHS)
    if found.status != 0:
        raise NoSolutionError(f"HiGHS: {found.message}")
    return np.asarray(found.x[:size])


def deep_point(lifted: Lifted) -> tuple[Floats, float]:
    """Return a point deep inside a set with thrust in a ball, and the radius of a ball about it that is inside.

    Parameters
    ----------
    lifted : Lifted
        Without equations.

    Returns
    -------
    point : ndarray, shape (p,)
    radius : float

    Raises
    ------
    NoSolutionError
        If the program was not solved.

    Notes
    -----
    A program with cones (Clarabel). What the radius takes from the thrust of a period is bounded by the norm of its
    response, so that the ball is inside but may not be the largest.
    """
    size = lifted.size
    if not size:
        return np.zeros(0), 0.0
    cost = np.concatenate([np.zeros(size), [-1.0]])
    rows = np.column_stack([lifted.rows, np.linalg.norm(lifted.rows, axis=1)])
    block, ends, cones = _ball_rows((lifted.control_response, lifted.control_free, lifted.ball))
    taken = np.zeros((len(block), 1))
    norms = np.linalg.norm(lifted.control_response.reshape(-1, lifted.ball, size), ord=2, axis=(1, 2))
    taken[:: lifted.ball + 1, 0] = norms[norms > _STILL]
    matrix = csc_matrix(np.vstack([rows, np.hstack([block, taken])]))
    limits = np.concatenate([lifted.limits, ends])
    empty = csc_matrix((size + 1, size + 1))
    found = _solve(empty, cost, matrix, limits, [clarabel.NonnegativeConeT(len(rows)), *cones])
    return found.point[:size], float(found.point[-1])


def _by_simplex(lifted: Lifted, cost: Floats) -> Floats:
    size = float(np.abs(cost).max())
    if size == 0.0:
        return least_relaxation(lifted)[1]
    equal = {"A_eq": lifted.equal, "b_eq": lifted.levels} if len(lifted.equal) else {}
    found = linprog(
        -cost / size,
        A_ub=lifted.rows,
        b_ub=lifted.limits,
        bounds=(None, None),
        method="highs-ds",
        options=HIGHS,
        **equal,
    )
    if found.status != 0:
        raise NoSolutionError(f"HiGHS: {found.message}")
    return np.asarray(found.x)


class _Repeated:
    """The same constraints for many linear functions: what depends on the constraints alone is done once."""

    def __init__(self, lifted: Lifted, used: Flags) -> None:
        self._lifted = lifted
        self._count = used.sum()
        matrices = [lifted.equal, lifted.rows[used]]
        limits = [lifted.levels, lifted.limits[used]]
        cones = [clarabel.ZeroConeT(len(lifted.equal)), clarabel.NonnegativeConeT(int(used.sum()))]
        if lifted.ball:
            block, ends, more = _ball_rows((lifted.control_response, lifted.control_free, lifted.ball))
            matrices.append(block)
            limits.append(ends)
            cones += more
        size = lifted.size
        settings = _settings()
        # Its residuals are checked whatever they come from, and refinement is a third of the time.
        settings.iterative_refinement_enable = False
        self._solver = clarabel.DefaultSolver(
            csc_matrix((size, size)),
            np.zeros(size),
            csc_matrix(np.vstack(matrices)),
            np.concatenate(limits),
            cones,
            settings,
        )

    def maximise(self, cost: Floats) -> Optimum:
        size = float(np.abs(cost).max())
        self._solver.update(q=-cost / (size if size > 0.0 else 1.0))
        solution = self._solver.solve()
        if solution.status == clarabel.SolverStatus.Solved or self._lifted.ball:
            point, multipliers = _checked(solution)
            return Optimum(point, multipliers[len(self._lifted.equal) :])
        return Optimum(_by_simplex(self._lifted, cost), np.zeros(int(self._count)))


def _polished(found: Optimum, matrix: Floats, vector: Floats, rows: Floats, limits: Floats) -> Optimum:
    """Solve for the point where the active rows hold with equality; keep it if it is a solution."""
    gaps = limits - rows @ found.point
    active = found.multipliers > gaps
    held = rows[active]
    count = len(vector)
    system = np.zeros((count + len(held), count + len(held)))
    system[:count, :count] = matrix
    system[:count, count:], system[count:, :count] = held.T, held
    right = np.concatenate([-vector - matrix @ found.point, limits[active] - held @ found.point])
    step = np.linalg.lstsq(system, right, rcond=1e-13)[0]
    point, pressed = found.point + step[:count], step[count:]
    size = max(1.0, float(np.abs(pressed).max(initial=0.0)))
    if float((limits - rows @ point).min(initial=0.0)) < -1e-10 or float(pressed.min(initial=0.0)) < -1e-9 * size:
        return found
    multipliers = np.zeros(len(rows))
    multipliers[active] = np.maximum(pressed, 0.0)
    return Optimum(point, multipliers)


def _conic(
    matrix: Floats, vector: Floats, rows: Floats, limits: Floats, ball: tuple[Floats, Floats, int] | None
) -> Optimum:
    size = len(vector)
    upper = csc_matrix(np.triu(matrix)) if matrix.size else csc_matrix((size, size))
    cones = [clarabel.NonnegativeConeT(len(rows))]
    if ball is None:
        return _solve(upper, vector, csc_matrix(rows), limits, cones)
    block, ends, more = _ball_rows(ball)
    found = _solve(upper, vector, csc_matrix(np.vstack([rows, block])), np.concatenate([limits, ends]), cones + more)
    return Optimum(found.point, found.multipliers)


def _ball_rows(ball: tuple[Floats, Floats, int]) -> tuple[Floats, Floats, list[object]]:
    """Rows and cones of |control_free + control_response v| <= 1 a period, but where the thrust is fixed."""
    response, free, group = ball
    turned, fixed = response.reshape(-1, group, response.shape[1]), free.reshape(-1, group)
    moving = np.linalg.norm(turned, axis=(1, 2)) > _STILL
    periods = int(moving.sum())
    rows = np.zeros((periods, group + 1, response.shape[1]))
    rows[:, 1:] = -turned[moving]
    ends = np.ones((periods, group + 1))
    ends[:, 1:] = fixed[moving]
    return rows.reshape(-1, response.shape[1]), ends.ravel(), [clarabel.SecondOrderConeT(group + 1)] * periods


def _solve(upper: csc_matrix, vector: Floats, rows: csc_matrix, limits: Floats, cones: list[object]) -> Optimum:
    solution = clarabel.DefaultSolver(upper, vector, rows, limits, cones, _settings()).solve()
    return Optimum(*_checked(solution))


def _checked(solution: clarabel.DefaultSolution) -> tuple[Floats, Floats]:
    if solution.status not in (clarabel.SolverStatus.Solved, clarabel.SolverStatus.AlmostSolved):
        raise NoSolutionError(f"Clarabel: {solution.status}")
    return np.array(solution.x), np.array(solution.z)


def _settings() -> clarabel.DefaultSettings:
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.presolve_enable = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = _GAP
    settings.max_threads = 1
    return settings
