"""Convex programs over admissible controls: which function is least or greatest, and where."""

from __future__ import annotations

import clarabel
import numpy as np
from numpy.typing import NDArray

from rendezvous.reachability.conic import STEADY, ConeProgram, NoSolutionError, Optimum, linear
from rendezvous.reachability.lifted import Lifted

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

_BROKEN = 3e-10
_NEAR = 2
_MANY_ROWS = 200
_STILL = 1e-9


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
    if not lifted.ball:
        point = linear(cost, matrix, limits)
        return float(point[-1]), point[:-1]
    found = with_thrust(ConeProgram(cost).keep(matrix, limits), lifted).solve().point
    return float(found[-1]), found[:-1]


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
    program = with_thrust(ConeProgram(vector, matrix).keep(lifted.rows, lifted.limits), lifted)
    found = program.solve()
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
    tops = np.hstack([np.zeros((periods, lifted.size)), np.eye(periods)])
    cost = tops.sum(axis=0)
    program = with_thrust(ConeProgram(cost).keep(*_widened(lifted.rows, lifted.limits, len(cost))), lifted)
    return _with_norms_below(program, lifted, scale, tops).solve().point[: lifted.size]


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
    cost = np.concatenate([np.zeros(lifted.size), [1.0]])
    rows, limits = _widened(lifted.rows, lifted.limits, len(cost))
    if lifted.ball:
        program = with_thrust(ConeProgram(cost).keep(rows, limits), lifted)
        tops = np.repeat(cost[None, :], len(lifted.control_free) // group, axis=0)
        point = _with_norms_below(program, lifted, scale, tops).solve().point
    else:
        turned = scale[:, None] * lifted.control_response
        below = -np.ones((len(turned), 1))
        point = linear(
            cost,
            np.vstack([rows, np.hstack([turned, below]), np.hstack([-turned, below])]),
            np.concatenate([limits, -scale * lifted.control_free, scale * lifted.control_free]),
        )
    return float(point[-1]), point[:-1]


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
    cost = np.concatenate([np.zeros(size), np.ones(count)])
    rows, limits = _widened(lifted.rows, lifted.limits, len(cost))
    rows = np.vstack([rows, np.hstack([turned, below]), np.hstack([-turned, below])])
    limits = np.concatenate([limits, -scale * lifted.control_free, scale * lifted.control_free])
    if lifted.ball:
        return with_thrust(ConeProgram(cost).keep(rows, limits), lifted).solve().point[:size]
    return linear(cost, rows, limits)[:size]


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
    if not lifted.size:
        return np.zeros(0), 0.0
    cost = np.concatenate([np.zeros(lifted.size), [-1.0]])
    rows = np.column_stack([lifted.rows, np.linalg.norm(lifted.rows, axis=1)])
    # The least bound on the radius keeps the program bounded where every row is still.
    found = with_thrust(
        ConeProgram(cost).keep(np.vstack([rows, -cost]), np.concatenate([lifted.limits, [1.0]])), lifted, deep=True
    ).solve()
    return found.point[:-1], float(found.point[-1])


def with_thrust(program: ConeProgram, lifted: Lifted, *, deep: bool = False) -> ConeProgram:
    """Add |u(t)| <= 1 to a program whose first variables are those of a set; nothing where thrust is in a box.

    Parameters
    ----------
    program : ConeProgram
    lifted : Lifted
    deep : bool
        Whether the program's last variable is the radius of a ball that is to be inside too.

    Returns
    -------
    ConeProgram
        The same.
    """
    if lifted.ball:
        size, width = lifted.size, len(program.cost)
        free = lifted.control_free.reshape(-1, lifted.ball)
        for fixed, turned in zip(free, lifted.control_response.reshape(-1, lifted.ball, size), strict=True):
            if np.linalg.norm(turned) > _STILL:  # a thrust that does not depend on v is within its bound already
                top = np.zeros(width)
                top[-1] = -np.linalg.norm(turned, ord=2) if deep else 0.0
                program.bound(_widened(turned, fixed, width)[0], fixed, top, 1.0)
    return program


def _with_norms_below(program: ConeProgram, lifted: Lifted, scale: Floats, tops: Floats) -> ConeProgram:
    """Add |u(t)| <= tops[t] . v, in the units of the controls."""
    group = len(scale) // len(tops)
    for t, top in enumerate(tops):
        mine = slice(t * group, (t + 1) * group)
        turned = scale[mine, None] * lifted.control_response[mine]
        program.bound(_widened(turned, top, len(top))[0], scale[mine] * lifted.control_free[mine], top)
    return program


def _widened(rows: Floats, limits: Floats, width: int) -> tuple[Floats, Floats]:
    """Rows with zeros for more variables."""
    return np.hstack([rows, np.zeros((len(rows), width - rows.shape[1]))]), limits


class _Repeated:
    """The same constraints for many linear functions: what depends on the constraints alone is done once."""

    def __init__(self, lifted: Lifted, used: Flags) -> None:
        self._lifted = lifted
        self._used = used
        self._program = self._with_cost(np.zeros(lifted.size))
        # Its answers are checked whatever they come from, and for a box refinement is a third of the time.
        self._solver = self._program.solver(**(STEADY if lifted.ball else {"iterative_refinement_enable": False}))

    def maximise(self, cost: Floats) -> Optimum:
        size = float(np.abs(cost).max())
        down = -cost / (size if size > 0.0 else 1.0)
        self._solver.update(q=down)
        solution = self._solver.solve()
        if solution.status == clarabel.SolverStatus.Solved:
            point, multipliers = np.array(solution.x), np.array(solution.z)
            try:
                self._program.need_solution(point, multipliers, down)
            except NoSolutionError:
                pass
            else:
                return Optimum(point, self._program.of_rows(multipliers))
        if self._lifted.ball:
            return self._with_cost(down).solve()
        lifted, used = self._lifted, self._used
        point = linear(down, lifted.rows[used], lifted.limits[used], lifted.equal, lifted.levels)
        return Optimum(point, np.zeros(int(used.sum())))

    def _with_cost(self, cost: Floats) -> ConeProgram:
        lifted, used = self._lifted, self._used
        program = ConeProgram(cost).meet(lifted.equal, lifted.levels).keep(lifted.rows[used], lifted.limits[used])
        return with_thrust(program, lifted)


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
