"""Bounded disturbances: constraints tightened by the accumulated disturbance, and plans with
disturbance feedback.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import linprog
from scipy.sparse import block_array, csr_array, eye_array, kron

from infoset.geometry.polytope import HIGHS
from infoset.rendezvous._arrays import Floats, Places
from infoset.rendezvous.reachability.conic import ConeProgram, NoSolutionError
from infoset.rendezvous.reachability.problem import ReachabilityProblem, ThrustShape

MAX_PERIODS_WITH_FEEDBACK = 24
_TIDY = 1e-7


class NoRobustPlanError(ValueError):
    """No plan with affine feedback satisfies the constraints for all disturbances."""


@dataclass(frozen=True, eq=False)
class FeedbackPlan:
    """Controls u(t) = nominal(t) + sum over s < t of gains[t, s] w(s), for a problem with a
    disturbance.

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


def accumulated(problem: ReachabilityProblem, disturbance: Floats) -> Floats:
    """Return the effect of each disturbance at each time, without feedback, shape (T + 1, T, n, q).

    That of w(s) at t is A(t - 1) ... A(s + 1) disturbance[s], zero for s >= t. Raise `ValueError`
    if the problem has constraints within periods.
    """
    if problem.between is not None:
        raise ValueError("disturbances need constraints at whole periods only")
    periods = problem.periods
    effect = np.zeros((periods + 1, periods, *disturbance.shape[1:]))
    for t in range(periods):
        effect[t + 1] = problem.transition[t] @ effect[t]
        effect[t + 1, t] = disturbance[t]
    return effect


def tightened(problem: ReachabilityProblem, disturbance: Floats) -> ReachabilityProblem:
    """Return the problem whose controls keep the constraints of a `problem` under every
    disturbance, without feedback.

    The problem has constraints at whole periods only. x(t + 1) = A x + B u + disturbance[t] w(t),
    |w_k(t)| <= 1, with a `disturbance` of shape (T, n, q); states of the new problem are those
    without disturbance. Each constraint is tightened by the support of the accumulated disturbance
    along its normal, which is exact.
    """
    effect = accumulated(problem, disturbance)
    normals, offsets, names = _all_constraints(problem)
    taken = np.abs(np.einsum("kn,tsnq->tksq", normals, effect)).sum(axis=(2, 3))
    return replace(problem, normals=normals, offsets=offsets - taken, constraint_names=names)


def feedback_plan(problem: ReachabilityProblem, disturbance: Floats) -> FeedbackPlan:
    """Return the plan with affine feedback from past disturbances whose worst terminal state is
    smallest.

    The `problem`, with thrust in a box, and the `disturbance` are as for `tightened`; w(t) is known
    from t + 1 on, by the state.

    With affine feedback all constraints are linear in (nominal, gains) except for absolute values,
    each of which needs an additional variable. The result is one linear program (HiGHS) with about
    T^2 (n + m) q / 2 additional variables, whose solution is checked. It minimises the sum of the
    maximum terminal states, divided by their bounds.

    Raises
    ------
    NoRobustPlanError
        If no plan with affine feedback satisfies the constraints.
    ValueError
        If there are too many periods, or thrust is in a ball.
    NoSolutionError
        If the linear program was not solved.
    """
    if problem.thrust is ThrustShape.BALL:
        raise ValueError("feedback from disturbances needs thrust in a box")
    if problem.periods > MAX_PERIODS_WITH_FEEDBACK:
        raise ValueError(
            f"a plan with feedback from disturbances can have at most {MAX_PERIODS_WITH_FEEDBACK} "
            f"periods, found {problem.periods}"
        )
    cost, matrix, limits = _program(problem, accumulated(problem, disturbance))
    optimum = linprog(
        cost, A_ub=matrix, b_ub=limits, bounds=(None, None), method="highs-ipm", options=HIGHS
    )
    if optimum.status == 2:
        raise NoRobustPlanError(
            "no plan with affine feedback keeps the constraints under every disturbance; reduce "
            "the disturbance, or relax the bounds"
        )
    if optimum.status != 0:
        raise NoSolutionError(f"HiGHS: {optimum.message}")
    ConeProgram(cost).keep(matrix, limits).checked(optimum.x, -optimum.ineqlin.marginals)
    (periods, n, m), q, (at, earlier) = problem.control.shape, disturbance.shape[2], _pairs(problem)
    nominal, own, _ = np.split(optimum.x, np.cumsum([periods * m, q * len(at) * m]))
    nominal = nominal.reshape(periods, m) * problem.control_bounds
    gains = np.zeros((periods, periods, m, q))
    gains[at, earlier] = (
        np.moveaxis(own.reshape(q, len(at), m), 0, -1) * problem.control_bounds[:, None]
    )
    centre = problem.run(nominal)
    total = np.zeros((periods + 1, periods, n, q))
    for t in range(periods):  # the effect of w(s) at t, directly and through the controls
        total[t + 1] = problem.transition[t] @ total[t] + problem.control[t] @ gains[t]
        total[t + 1, t] += disturbance[t]
    spread = np.abs(total).sum(axis=(1, 3))
    return FeedbackPlan(problem, disturbance, nominal, gains, centre - spread, centre + spread)


def _all_constraints(problem: ReachabilityProblem) -> tuple[Floats, Floats, tuple[str, ...]]:
    """Constraints with the bounds on states, which come first."""
    unit = np.eye(problem.states)
    normals, offsets = problem.further
    names = [f"the bound on {problem.state_name(i)}" for i in range(problem.states)] * 2
    names += [problem.name_of(k) for k in range(len(normals))]
    bounds = np.tile(np.concatenate([problem.state_bounds] * 2), (problem.periods + 1, 1))
    return np.vstack([unit, -unit, normals]), np.hstack([bounds, offsets]), tuple(names)


def _pairs(problem: ReachabilityProblem) -> tuple[Places, Places]:
    """Return the times t and s < t of all gains."""
    return np.tril_indices(problem.periods, -1)


def _program(problem: ReachabilityProblem, effect: Floats) -> tuple[Floats, csr_array, Floats]:
    """Return the cost, the rows and the limits of the linear program of a plan.

    Its variables are the nominal controls; the gains of all (t, s), by component of w; absolute
    values of the effect of each w(s) on each constraint, and of each gain, by component; and the
    maximum terminal states. Controls are divided by their bounds, and constraints by their sizes.
    """
    (periods, n, m), q, (at, earlier) = problem.control.shape, effect.shape[3], _pairs(problem)
    pairs = len(at)
    # x(t) by the nominal controls, and the effect of w(s) on x(t) by the gains of one component.
    response = np.zeros((periods + 1, n, periods * m))
    through = np.zeros((periods + 1, periods, n, pairs * m))
    for t in range(periods):
        push = problem.control[t] * problem.control_bounds
        response[t + 1], through[t + 1] = (
            problem.transition[t] @ response[t],
            problem.transition[t] @ through[t],
        )
        response[t + 1, :, t * m : (t + 1) * m] += push
        for pair in np.flatnonzero(at == t):
            through[t + 1, earlier[pair], :, pair * m : (pair + 1) * m] += push
    normals, offsets, _ = _all_constraints(problem)
    sizes = np.abs(normals) @ problem.state_bounds
    rows = normals / sizes[:, None]
    ends = offsets / sizes
    times, kinds = np.nonzero(np.isfinite(ends) & (np.arange(periods + 1) > 0)[:, None])
    nominal = np.einsum("cn,cnu->cu", rows[kinds], response[times])
    coasting = np.einsum("cn,cn->c", rows[kinds], problem.run(np.zeros((periods, m)))[times])
    # Both bounds on a state have the same absolute values.
    by_gains, fixed = (np.einsum("kn,tsn...->tks...", rows[n:], part) for part in (through, effect))
    kept = (by_gains.any(axis=-1) | fixed.any(axis=-1)) & np.isfinite(ends[:, n:, None])
    at_time, of_kind, _ = np.nonzero(kept)
    sums = (at_time == times[:, None]) & (of_kind == np.where(kinds < n, kinds, kinds - n)[:, None])
    gains_at = np.kron(at == np.arange(periods)[:, None], np.eye(m))
    spread = np.kron(np.ones(q), block_diag(sums, gains_at))
    spread_states = spread[: len(times)]
    spread_controls = spread[len(times) :]
    inner = kron(np.eye(q), csr_array(np.vstack([by_gains[kept], np.eye(pairs * m)])))
    constant = np.vstack([fixed[kept], np.zeros((pairs * m, q))]).T.ravel()
    last = (times == periods) & (kinds < 2 * n)
    unit = np.eye(periods * m)
    ones = np.ones(periods * m)
    matrix = block_array(
        [
            [nominal, None, spread_states, None],
            [unit, None, spread_controls, None],
            [-unit, None, spread_controls, None],
            [nominal[last], None, spread_states[last], -np.tile(np.eye(n), (2, 1))],
            [None, inner, -eye_array(len(constant)), None],
            [None, -inner, -eye_array(len(constant)), None],
        ],
        format="csr",
    )
    limits = np.concatenate(
        [ends[times, kinds] - coasting, ones, ones, -coasting[last], -constant, constant]
    )
    # Of equally good plans, the one with small gains.
    cost = np.repeat([0.0, _TIDY, 1.0], [periods * m + inner.shape[1], len(constant), n])
    return cost, matrix, limits
