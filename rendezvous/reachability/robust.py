"""Bounded disturbances: tightened constraints, and plans with feedback from past disturbances."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import linprog
from scipy.sparse import block_array, csr_array, eye_array, kron

from infoset.geometry.polytope import HIGHS
from infoset.rendezvous._arrays import Flags, Floats, Places
from infoset.rendezvous.reachability.conic import ConeProgram, NoSolutionError
from infoset.rendezvous.reachability.problem import ReachabilityProblem, ThrustShape

MAX_PERIODS_WITH_FEEDBACK = 24
"""Maximum number of periods: the variables of the linear program grow with its square. Chosen."""
_GAIN_COST = 1e-7
"""Cost of the size of a gain, in units of the cost of a terminal state: of equally good plans, one
with small gains is taken. Chosen: small beside 1.
"""


class NoRobustPlanError(ValueError):
    """No plan with affine feedback satisfies the constraints for all disturbances."""


@dataclass(frozen=True, eq=False)
class FeedbackPlan:
    """Controls u(t) = nominal(t) + sum over s < t of gains[t, s] w(s), with disturbances w.

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
        """An upper bound of the terminal norm over all disturbances."""
        return float(np.linalg.norm(np.maximum(np.abs(self.lower[-1]), np.abs(self.upper[-1]))))


def accumulated(problem: ReachabilityProblem, disturbance: Floats) -> Floats:
    """Return the effect of each w(s) on each x(t), without feedback, shape (T + 1, T, n, q).

    The effect of w(s) at t is A(t - 1) ... A(s + 1) disturbance[s], zero for s >= t. Raise
    `ValueError` if the problem has constraints within periods.
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
    """Return the problem whose controls keep the constraints under every disturbance.

    The controls are without feedback. The problem has constraints at whole periods only. x(t + 1) =
    A x + B u + disturbance[t] w(t), |w_k(t)| <= 1, with a `disturbance` of shape (T, n, q); states
    of the new problem are states without disturbance. Each constraint is tightened by the support
    of the accumulated disturbance along its normal, which is exact.
    """
    effect = accumulated(problem, disturbance)
    constraints = _all_constraints(problem)
    along_normals = np.einsum("kn,tsnq->tksq", constraints.normals, effect)
    support = np.abs(along_normals).sum(axis=(2, 3))
    return replace(
        problem,
        normals=constraints.normals,
        offsets=constraints.offsets - support,
        constraint_names=constraints.names,
    )


def feedback_plan(problem: ReachabilityProblem, disturbance: Floats) -> FeedbackPlan:
    """Return the plan with affine feedback whose worst terminal state is smallest.

    The `problem`, with thrust in a box, and the `disturbance` are as for `tightened`; the controls
    from t + 1 on may depend on w(t), which the state x(t + 1) reveals.

    With affine feedback all constraints are linear in the nominal controls and the gains, except
    for absolute values, each of which needs an additional variable. The result is one linear
    program (HiGHS) with about T^2 (n + m) q / 2 additional variables, whose solution is checked. It
    minimises the sum of the maximum terminal states, divided by their bounds.

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
    program = _program(problem, accumulated(problem, disturbance))
    optimum = linprog(
        program.cost,
        A_ub=program.matrix,
        b_ub=program.limits,
        bounds=(None, None),
        method="highs-ipm",
        options=HIGHS,
    )
    if optimum.status == 2:
        raise NoRobustPlanError(
            "no plan with affine feedback keeps the constraints under every disturbance; reduce "
            "the disturbance, or relax the bounds"
        )
    if optimum.status != 0:
        raise NoSolutionError(f"HiGHS: {optimum.message}")
    cone_program = ConeProgram(program.cost).keep(program.matrix, program.limits)
    cone_program.checked(optimum.x, -optimum.ineqlin.marginals)
    return _plan(problem, disturbance, optimum.x)


def _plan(problem: ReachabilityProblem, disturbance: Floats, solution: Floats) -> FeedbackPlan:
    """Return the plan of a solution of the linear program, with its robust tube."""
    periods, n, m = problem.control.shape
    q = disturbance.shape[2]
    at, earlier = _pairs(problem)
    nominal, own, _ = np.split(solution, np.cumsum([periods * m, q * len(at) * m]))
    nominal = nominal.reshape(periods, m) * problem.control_bounds
    own = np.moveaxis(own.reshape(q, len(at), m), 0, -1)
    gains = np.zeros((periods, periods, m, q))
    gains[at, earlier] = own * problem.control_bounds[:, None]

    # The effect of w(s) at t, directly and through the controls.
    total = np.zeros((periods + 1, periods, n, q))
    for t in range(periods):
        total[t + 1] = problem.transition[t] @ total[t] + problem.control[t] @ gains[t]
        total[t + 1, t] += disturbance[t]

    centre = problem.run(nominal)
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


class _Program(NamedTuple):
    """Minimise cost x with matrix x <= limits."""

    cost: Floats
    matrix: csr_array
    limits: Floats


class _Responses(NamedTuple):
    """Derivatives of the states by the variables of the program.

    Parameters
    ----------
    nominal : ndarray, shape (T + 1, n, T m)
        By the nominal controls.
    gains : ndarray, shape (T + 1, T, n, pairs m)
        For each w(s), by the gains of one component.
    """

    nominal: Floats
    gains: Floats


class _Constraints(NamedTuple):
    """Constraints of states after t = 0, divided by their sizes.

    Parameters
    ----------
    rows : ndarray, shape (kinds, n)
        Normals.
    ends : ndarray, shape (T + 1, kinds)
        Offsets.
    times, kinds : ndarray of int
        Time and kind of each constraint whose offset is finite.
    """

    rows: Floats
    ends: Floats
    times: Places
    kinds: Places


class _Effects(NamedTuple):
    """Effects of the single w(s) on the constraints: their moduli are variables of the program.

    Parameters
    ----------
    sums : ndarray of bool, shape (constraints, effects)
        Which effects a constraint sums.
    by_gains : ndarray, shape (effects, pairs m)
        Derivatives of an effect by the gains of one component.
    fixed : ndarray, shape (effects, q)
        Effects without feedback.
    """

    sums: Flags
    by_gains: Floats
    fixed: Floats


def _program(problem: ReachabilityProblem, effect: Floats) -> _Program:
    """Return the linear program of a plan.

    Its variables are the nominal controls; the gains of all (t, s), by component of w; absolute
    values of the effect of each w(s) on each constraint, and of each gain, by component; and the
    maximum terminal states. Controls are divided by their bounds, and constraints by their sizes.
    """
    periods, n, m = problem.control.shape
    q = effect.shape[3]
    responses = _responses(problem)
    constraints = _constraints(problem)
    effects = _effects(responses, effect, constraints)
    times = constraints.times
    kinds = constraints.kinds

    normals = constraints.rows[kinds]
    nominal = np.einsum("cn,cnu->cu", normals, responses.nominal[times])
    uncontrolled = problem.run(np.zeros((periods, m)))[times]
    coasting = np.einsum("cn,cn->c", normals, uncontrolled)

    # Sums of absolute values: of the effects on each constraint, and of the gains of each control.
    at, _ = _pairs(problem)
    of_controls = np.kron(at == np.arange(periods)[:, None], np.eye(m))
    spread = np.kron(np.ones(q), block_diag(effects.sums, of_controls))
    spread_states = spread[: len(times)]
    spread_controls = spread[len(times) :]
    of_gains = np.eye(len(at) * m)
    inner = kron(np.eye(q), csr_array(np.vstack([effects.by_gains, of_gains])))
    constant = np.vstack([effects.fixed, np.zeros((len(at) * m, q))]).T.ravel()

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
    ends = constraints.ends[times, kinds]
    limits = np.concatenate([ends - coasting, ones, ones, -coasting[last], -constant, constant])
    controls = periods * m + inner.shape[1]
    cost = np.repeat([0.0, _GAIN_COST, 1.0], [controls, len(constant), n])
    return _Program(cost, matrix, limits)


def _responses(problem: ReachabilityProblem) -> _Responses:
    periods, n, m = problem.control.shape
    at, earlier = _pairs(problem)
    nominal = np.zeros((periods + 1, n, periods * m))
    gains = np.zeros((periods + 1, periods, n, len(at) * m))
    for t in range(periods):
        push = problem.control[t] * problem.control_bounds
        nominal[t + 1] = problem.transition[t] @ nominal[t]
        nominal[t + 1, :, t * m : (t + 1) * m] += push
        gains[t + 1] = problem.transition[t] @ gains[t]
        for pair in np.flatnonzero(at == t):
            gains[t + 1, earlier[pair], :, pair * m : (pair + 1) * m] += push
    return _Responses(nominal, gains)


def _constraints(problem: ReachabilityProblem) -> _Constraints:
    normals, offsets, _ = _all_constraints(problem)
    sizes = np.abs(normals) @ problem.state_bounds
    ends = offsets / sizes
    is_later = (np.arange(problem.periods + 1) > 0)[:, None]
    times, kinds = np.nonzero(np.isfinite(ends) & is_later)
    return _Constraints(normals / sizes[:, None], ends, times, kinds)


def _effects(responses: _Responses, effect: Floats, constraints: _Constraints) -> _Effects:
    """Return the effects that are not always zero."""
    # Both bounds on a state have the same absolute values: the second one stands for both.
    n = effect.shape[2]
    rows = constraints.rows[n:]
    by_gains = np.einsum("kn,tsn...->tks...", rows, responses.gains)
    fixed = np.einsum("kn,tsn...->tks...", rows, effect)
    is_limited = np.isfinite(constraints.ends[:, n:, None])
    kept = (by_gains.any(axis=-1) | fixed.any(axis=-1)) & is_limited

    at_time, of_kind, _ = np.nonzero(kept)
    kinds = np.where(constraints.kinds < n, constraints.kinds, constraints.kinds - n)
    is_at_time = at_time == constraints.times[:, None]
    return _Effects(is_at_time & (of_kind == kinds[:, None]), by_gains[kept], fixed[kept])
