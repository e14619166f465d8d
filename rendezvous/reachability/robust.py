"""Bounded disturbances: constraints tightened by the accumulated disturbance, and plans with disturbance feedback."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import linprog
from scipy.sparse import coo_array

from infoset.geometry.polytope import HIGHS
from rendezvous._arrays import Floats
from rendezvous.reachability.conic import ConeProgram, NoSolutionError
from rendezvous.reachability.problem import ReachabilityProblem, ThrustShape

MAX_PERIODS_WITH_FEEDBACK = 24
_TIDY = 1e-7


class NoRobustPlanError(ValueError):
    """No plan with affine feedback satisfies the constraints for all disturbances."""


@dataclass(frozen=True, eq=False)
class FeedbackPlan:
    """Controls u(t) = nominal(t) + sum over s < t of gains[t, s] w(s), for a problem with a disturbance.

    Parameters
    ----------
    disturbance : ndarray, shape (T, n, q)
        x(t + 1) = A x + B u + disturbance[t] w(t), |w_k(t)| <= 1, in the units of the states.
    nominal : ndarray, shape (T, m)
        Controls without disturbance, in units of the problem.
    gains : ndarray, shape (T, T, m, q)
        Change of the controls by past disturbances, in units of the problem.
    lower, upper : ndarray, shape (T + 1, n)
        Bounds of each state over all disturbances: the robust tube.
    """

    problem: ReachabilityProblem
    disturbance: Floats
    nominal: Floats
    gains: Floats
    lower: Floats
    upper: Floats

    @property
    def worst_miss(self) -> float:
        """A bound on the terminal norm."""
        return float(np.linalg.norm(np.maximum(np.abs(self.lower[-1]), np.abs(self.upper[-1]))))

    def run(self, moves: ArrayLike) -> tuple[Floats, Floats]:
        """Return the states, shape (T + 1, n), and controls, shape (T, m), under a disturbance.

        `moves`, shape (T, q), are the values of w, each within 1.
        """
        w = np.asarray(moves, dtype=float)
        controls = self.nominal + np.einsum("tsmq,sq->tm", self.gains, w)
        states = [self.problem.initial]
        for t in range(self.problem.periods):
            pushed = self.disturbance[t] @ w[t]
            states.append(self.problem.transition[t] @ states[-1] + self.problem.control[t] @ controls[t] + pushed)
        return np.array(states), controls


def accumulated(problem: ReachabilityProblem, disturbance: Floats) -> Floats:
    """Return the effect of each disturbance at each time, without feedback, shape (T + 1, T, n, q).

    That of w(s) at t is A(t - 1) ... A(s + 1) disturbance[s], zero for s >= t.
    """
    periods = problem.periods
    effect = np.zeros((periods + 1, periods, *disturbance.shape[1:]))
    for t in range(periods):
        effect[t + 1] = problem.transition[t] @ effect[t]
        effect[t + 1, t] = disturbance[t]
    return effect


def tightened(problem: ReachabilityProblem, disturbance: Floats) -> ReachabilityProblem:
    """Return the problem whose controls keep the constraints of a `problem` under every disturbance, without feedback.

    The problem has constraints at whole periods only. x(t + 1) = A x + B u + disturbance[t] w(t), |w_k(t)| <= 1, with a
    `disturbance` of shape (T, n, q); states of the new problem are those without disturbance. Each constraint is
    tightened by the support of the accumulated disturbance along its normal, which is exact.
    """
    _check(problem, disturbance)
    effect = accumulated(problem, disturbance)
    normals, offsets, names = _all_constraints(problem)
    taken = np.abs(np.einsum("kn,tsnq->tksq", normals, effect)).sum(axis=(2, 3))
    return replace(problem, normals=normals, offsets=offsets - taken, constraint_names=names)


def feedback_plan(problem: ReachabilityProblem, disturbance: Floats) -> FeedbackPlan:
    """Return the plan with affine feedback from past disturbances whose worst terminal state is smallest.

    The `problem`, with thrust in a box, and the `disturbance` are as for `tightened`; w(t) is known from t + 1 on, by
    the state.

    With affine feedback all constraints are linear in (nominal, gains) except for absolute values, each of which needs
    an additional variable. The result is one linear program (HiGHS) with about T^2 (n + m) q / 2 additional variables,
    whose solution is checked. It minimises the sum of the maximum terminal states, divided by their bounds.

    Raises
    ------
    NoRobustPlanError
        If no plan with affine feedback satisfies the constraints.
    ValueError
        If there are too many periods, or thrust is in a ball.
    """
    _check(problem, disturbance)
    if problem.thrust is ThrustShape.BALL:
        raise ValueError("feedback from disturbances needs thrust in a box")
    if problem.periods > MAX_PERIODS_WITH_FEEDBACK:
        raise ValueError(
            f"a plan with feedback from disturbances can have at most {MAX_PERIODS_WITH_FEEDBACK} periods, found "
            f"{problem.periods}"
        )
    return _Program(problem, disturbance).solve()


def _check(problem: ReachabilityProblem, disturbance: Floats) -> None:
    shape = (problem.periods, problem.states)
    if disturbance.ndim != 3 or disturbance.shape[:2] != shape or not np.isfinite(disturbance).all():
        raise ValueError(f"the disturbance must be finite, of shape ({shape[0]}, {shape[1]}, q)")
    if problem.between is not None:
        raise ValueError("disturbances need constraints at whole periods only")


def _all_constraints(problem: ReachabilityProblem) -> tuple[Floats, Floats, tuple[str, ...]]:
    """Constraints with the bounds on states, which come first."""
    unit = np.eye(problem.states)
    normals, offsets = problem.further
    names = [f"the bound on {problem.state_name(i)}" for i in range(problem.states)] * 2
    names += [problem.name_of(k) for k in range(len(normals))]
    bounds = np.tile(np.concatenate([problem.state_bounds] * 2), (problem.periods + 1, 1))
    return np.vstack([unit, -unit, normals]), np.hstack([bounds, offsets]), tuple(names)


class _Program:
    """The linear program of a plan: variables are nominal controls, gains, and absolute values.

    Controls are divided by their bounds. `gain_at` are the variables of the gains of (t, s, control, disturbance).
    """

    def __init__(self, problem: ReachabilityProblem, disturbance: Floats) -> None:
        self.problem, self.disturbance, self.effect = problem, disturbance, accumulated(problem, disturbance)
        self.periods, self.states, self.group = problem.periods, problem.states, problem.controls
        self.width = disturbance.shape[2]
        gains = [(t, *rest) for t in range(self.periods) for rest in np.ndindex(t, self.group, self.width)]
        self.gain_at = {gain: self.periods * self.group + index for index, gain in enumerate(gains)}
        self.begin = self.size = self.periods * self.group + len(gains)
        self.rows: list[dict[int, float]] = []
        self.limits: list[float] = []
        # x(t) = free[t] + response[t] of all controls.
        self.free = problem.run(np.zeros((self.periods, self.group)))
        self.response = np.zeros((self.periods + 1, self.states, self.periods, self.group))
        for t in range(self.periods):
            self.response[t + 1] = np.einsum("ij,jsm->ism", problem.transition[t], self.response[t])
            self.response[t + 1][:, t] += problem.control[t] * problem.control_bounds

    def solve(self) -> FeedbackPlan:
        """Build and solve it."""
        problem = self.problem
        scale = problem.state_bounds
        normals, offsets, _ = _all_constraints(problem)
        n = self.states
        margins = {}
        for t in range(1, self.periods + 1):
            for i in range(n):
                margins[t, i] = self._spread(np.eye(n)[i] / scale[i], t)
                self._keep(np.eye(n)[i] / scale[i], t, offsets[t, i] / scale[i], margins[t, i])
                self._keep(-np.eye(n)[i] / scale[i], t, offsets[t, n + i] / scale[i], margins[t, i])
            for k in range(2 * n, len(normals)):
                if np.isfinite(offsets[t, k]):
                    size = float(np.abs(normals[k]) @ scale)
                    row = normals[k] / size
                    self._keep(row, t, offsets[t, k] / size, self._spread(row, t))
        self._bound_controls()
        maximum = [self._new() for _ in range(n)]
        for i in range(n):
            row = np.eye(n)[i] / scale[i]
            for sign in (1.0, -1.0):
                entries, constant = self._nominal(sign * row, self.periods)
                entries |= margins[self.periods, i]
                entries[maximum[i]] = -1.0
                self._add(entries, -constant)
        cost = np.zeros(self.size)
        cost[self.begin :] = _TIDY  # of equally good plans, the one with small gains
        cost[maximum] = 1.0
        entries_at = [(r, c, v) for r, entries in enumerate(self.rows) for c, v in entries.items()]
        r, c, v = zip(*entries_at, strict=True)
        matrix = coo_array((v, (r, c)), shape=(len(self.rows), self.size)).tocsr()
        optimum = linprog(cost, A_ub=matrix, b_ub=self.limits, bounds=(None, None), method="highs-ipm", options=HIGHS)
        if optimum.status == 2:
            raise NoRobustPlanError(
                "no plan with affine feedback keeps the constraints under every disturbance; reduce the disturbance, "
                "or relax the bounds"
            )
        if optimum.status != 0:
            raise NoSolutionError(f"HiGHS: {optimum.message}")
        ConeProgram(cost).keep(matrix, np.array(self.limits)).checked(optimum.x, -optimum.ineqlin.marginals)
        return self._plan(optimum.x)

    def _plan(self, solution: Floats) -> FeedbackPlan:
        problem, reach = self.problem, self.problem.control_bounds
        nominal = solution[: self.periods * self.group].reshape(self.periods, self.group) * reach
        gains = np.zeros((self.periods, self.periods, self.group, self.width))
        for (t, s, j, q), index in self.gain_at.items():
            gains[t, s, j, q] = solution[index] * reach[j]
        centre = problem.run(nominal)
        # Effect of w(s) at t, directly and through the controls.
        total = np.zeros_like(self.effect)
        for t in range(self.periods):
            total[t + 1] = problem.transition[t] @ total[t] + problem.control[t] @ gains[t]
            total[t + 1, t] += self.disturbance[t]
        spread = np.abs(total).sum(axis=(1, 3))
        return FeedbackPlan(problem, self.disturbance, nominal, gains, centre - spread, centre + spread)

    def _new(self) -> int:
        self.size += 1
        return int(self.size - 1)

    def _add(self, entries: dict[int, float], limit: float) -> None:
        self.rows.append(entries)
        self.limits.append(limit)

    def _absolute(self, entries: dict[int, float], constant: float) -> int:
        """Add a variable that is at least |entries + constant|."""
        index = self._new()
        self._add({**entries, index: -1.0}, -constant)
        self._add({**{c: -v for c, v in entries.items()}, index: -1.0}, constant)
        return index

    def _spread(self, row: Floats, time: int) -> dict[int, float]:
        """Return variables whose sum is the maximum effect of disturbances on row . x(time)."""
        margins: dict[int, float] = {}
        turned = np.einsum("n,nsm->sm", row, self.response[time])
        for s in range(time):
            for q in range(self.width):
                entries = {
                    self.gain_at[t, s, j, q]: float(turned[t, j])
                    for t in range(s + 1, time)
                    for j in range(self.group)
                    if turned[t, j] != 0.0
                }
                constant = float(row @ self.effect[time, s, :, q])
                if entries or constant != 0.0:
                    margins[self._absolute(entries, constant)] = 1.0
        return margins

    def _nominal(self, row: Floats, time: int) -> tuple[dict[int, float], float]:
        turned = np.einsum("n,nsm->sm", row, self.response[time]).ravel()
        return {int(c): float(turned[c]) for c in np.flatnonzero(turned)}, float(row @ self.free[time])

    def _keep(self, row: Floats, time: int, limit: float, spread: dict[int, float]) -> None:
        entries, constant = self._nominal(row, time)
        self._add({**entries, **spread}, limit - constant)

    def _bound_controls(self) -> None:
        for t in range(self.periods):
            for j in range(self.group):
                spread = {
                    self._absolute({self.gain_at[t, s, j, q]: 1.0}, 0.0): 1.0
                    for s in range(t)
                    for q in range(self.width)
                }
                for sign in (1.0, -1.0):
                    self._add({t * self.group + j: sign, **spread}, 1.0)
