"""Bounded disturbances: tightened constraints, and plans with disturbance feedback.

A disturbance acts as x(t + 1) = A(t) x(t) + B(t) u(t) + D(t) w(t) with |w_k(t)| <= 1; arguments
named `disturbance` are the matrices D, of shape (T, n, q), in the units of the states.
"""

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
"""Maximum number of periods of a plan with feedback: the linear program of 24 periods with three
disturbances takes about a minute, and of 16 periods 14 s."""
_MAGNITUDE_COST = 1e-7
"""Cost of the magnitudes of gains and effects, relative to the cost of the terminal states.

It selects a plan with small gains among equally good plans. Chosen: the plans of the tests do not
change from 1e-8 to 1e-4; with a cost of 0 gains are up to five times as large.
"""


class NoRobustPlanError(ValueError):
    """No plan with affine feedback satisfies the constraints for all disturbances."""


@dataclass(frozen=True, eq=False)
class FeedbackPlan:
    """Controls u(t) = nominal(t) + sum over s < t of gains[t, s] w(s), under a disturbance.

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

    The effect is A(t - 1) ... A(s + 1) disturbance[s], and zero for s >= t. Raise `ValueError` if
    the problem has constraints within periods.
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
    """Return a problem whose controls satisfy the constraints of `problem` for all disturbances.

    The controls do not react to the `disturbance`, of shape (T, n, q). Its matrices act as x(t + 1)
    = A x + B u + disturbance[t] w(t), |w_k(t)| <= 1. Constraints must apply at whole periods only.
    The states of the new problem are the states without disturbance. Each constraint is tightened
    by the support of the accumulated disturbance along its normal, which is exact.
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

    The `problem`, with held thrust in a box, and the `disturbance` are as for `tightened`; the
    controls from t + 1 on may depend on w(t), which the state x(t + 1) reveals.

    With affine feedback all constraints are linear in the nominal controls and the gains, except
    for absolute values, each of which needs an additional variable. The result is one linear
    program (HiGHS) with about T^2 (n + m) q / 2 additional variables, whose solution is checked. It
    minimises the sum of the maximum terminal states, divided by their bounds.

    Raises
    ------
    NoRobustPlanError
        If no plan with affine feedback satisfies the constraints.
    ValueError
        If there are too many periods, thrust is in a ball, the controls are impulses, or they have
        constraints beyond their bounds.
    NoSolutionError
        If the linear program was not solved.
    """
    if problem.thrust is ThrustShape.BALL:
        raise ValueError("feedback from disturbances needs thrust in a box")
    if len(problem.limits[0]):
        raise ValueError("feedback from disturbances needs controls without further limits")
    if problem.jump is not None:
        raise ValueError("feedback from disturbances needs held thrust, not impulses")
    if problem.periods > MAX_PERIODS_WITH_FEEDBACK:
        raise ValueError(
            f"a plan with feedback from disturbances can have at most {MAX_PERIODS_WITH_FEEDBACK} "
            f"periods, found {problem.periods}"
        )
    program = _program(problem, accumulated(problem, disturbance))
    nominal, gains = _controls_of(problem, _solution(program), disturbance.shape[2])

    centre = problem.run(nominal)
    spread = _spread_of_states(problem, disturbance, gains)
    return FeedbackPlan(problem, disturbance, nominal, gains, centre - spread, centre + spread)


def _spread_of_states(problem: ReachabilityProblem, disturbance: Floats, gains: Floats) -> Floats:
    """Maximum deviation of each state from the nominal one, shape (T + 1, n), in its units."""
    effect = np.zeros((problem.periods + 1, problem.periods, *disturbance.shape[1:]))
    for t in range(problem.periods):
        through_controls = problem.control[t] @ gains[t]
        effect[t + 1] = problem.transition[t] @ effect[t] + through_controls
        effect[t + 1, t] += disturbance[t]
    return np.asarray(np.abs(effect).sum(axis=(1, 3)))


class _Constraints(NamedTuple):
    """normals x(t) <= offsets(t) with their names, of shapes (k, n), (T + 1, k) and (k,).

    The upper bounds on the n states come first, then the n lower bounds.
    """

    normals: Floats
    offsets: Floats
    names: tuple[str, ...]


def _all_constraints(problem: ReachabilityProblem) -> _Constraints:
    """Return the bounds on the states and the further constraints."""
    unit = np.eye(problem.states)
    normals, offsets = problem.further

    names = [f"the bound on {problem.state_name(i)}" for i in range(problem.states)] * 2
    names += [problem.name_of(k) for k in range(len(normals))]
    bounds = np.tile(np.concatenate([problem.state_bounds] * 2), (problem.periods + 1, 1))
    return _Constraints(
        np.vstack([unit, -unit, normals]), np.hstack([bounds, offsets]), tuple(names)
    )


class _GainPairs(NamedTuple):
    """Times t of a control and s < t of a disturbance, of each of the P gain matrices."""

    control_times: Places
    disturbance_times: Places


def _gain_pairs(periods: int) -> _GainPairs:
    return _GainPairs(*np.tril_indices(periods, -1))


class _Responses(NamedTuple):
    """Effects of the variables on the states, for controls divided by their bounds.

    `nominal`, shape (T + 1, n, T m), is the effect of the nominal controls on x(t). `gains`, shape
    (T + 1, T, n, P m), is the effect of w(s) on x(t) through the gains of one component of w.
    """

    nominal: Floats
    gains: Floats


def _responses(problem: ReachabilityProblem) -> _Responses:
    periods, n, m = problem.control.shape
    pairs = _gain_pairs(periods)
    nominal = np.zeros((periods + 1, n, periods * m))
    gains = np.zeros((periods + 1, periods, n, len(pairs.control_times) * m))
    for t in range(periods):
        push = problem.control[t] * problem.control_bounds
        nominal[t + 1] = problem.transition[t] @ nominal[t]
        nominal[t + 1, :, t * m : (t + 1) * m] += push

        gains[t + 1] = problem.transition[t] @ gains[t]
        for pair in np.flatnonzero(pairs.control_times == t):
            s = pairs.disturbance_times[pair]
            gains[t + 1, s, :, pair * m : (pair + 1) * m] += push
    return _Responses(nominal, gains)


class _Spreads(NamedTuple):
    """Effects of single disturbances on single constraints, which the constraints must allow for.

    The effect of component j of w(s) on constraint k at time t is `direct`[:, j] + `by_gains` @
    (gains of component j), of shapes (e, q) and (e, P m). `times` and `kinds`, shape (e,), are t
    and the row k of the constraint among the lower bounds on states and the further constraints:
    the effects on the two bounds of a state have the same absolute values.
    """

    times: Places
    kinds: Places
    by_gains: Floats
    direct: Floats


def _spreads(rows: Floats, finite: Flags, responses: _Responses, effect: Floats) -> _Spreads:
    """Return the effects that are not zero, on the constraints `rows` that are `finite`.

    `rows`, shape (k, n), and `finite`, shape (T + 1, k), are without the upper bounds on states.
    """
    by_gains = np.einsum("kn,tsn...->tks...", rows, responses.gains)
    direct = np.einsum("kn,tsn...->tks...", rows, effect)
    kept = (by_gains.any(axis=-1) | direct.any(axis=-1)) & finite[..., None]
    times, kinds, _ = np.nonzero(kept)
    return _Spreads(times, kinds, by_gains[kept], direct[kept])


class _NominalRows(NamedTuple):
    """Constraints on the nominal states: coasting + by_controls v <= ends.

    v are the nominal controls, divided by their bounds; the shapes are (c,), (c, T m) and (c,).
    `times` and `kinds`, shape (c,), are the time and the row of each constraint.
    """

    times: Places
    kinds: Places
    by_controls: Floats
    coasting: Floats
    ends: Floats


def _nominal_rows(
    problem: ReachabilityProblem, rows: Floats, ends: Floats, responses: _Responses
) -> _NominalRows:
    """Return the finite constraints at all times but the start, where they have been checked."""
    after_start = np.arange(problem.periods + 1) > 0
    times, kinds = np.nonzero(np.isfinite(ends) & after_start[:, None])
    by_controls = np.einsum("cn,cnu->cu", rows[kinds], responses.nominal[times])
    coasting_states = problem.run(np.zeros((problem.periods, problem.controls)))
    coasting = np.einsum("cn,cn->c", rows[kinds], coasting_states[times])
    return _NominalRows(times, kinds, by_controls, coasting, ends[times, kinds])


def _sums_of_magnitudes(
    problem: ReachabilityProblem, nominal: _NominalRows, spreads: _Spreads, components: int
) -> tuple[Floats, Floats]:
    """Return the sums that tighten each constraint on a state, and each bound on a control.

    They are matrices of zeros and ones, one column per magnitude, by component of w.
    """
    n = problem.states
    kinds = np.where(nominal.kinds < n, nominal.kinds, nominal.kinds - n)
    acts_on = (spreads.times == nominal.times[:, None]) & (spreads.kinds == kinds[:, None])

    control_times = _gain_pairs(problem.periods).control_times
    is_at_time = control_times == np.arange(problem.periods)[:, None]
    gains_of = np.kron(is_at_time, np.eye(problem.controls))

    sums = np.kron(np.ones(components), block_diag(acts_on, gains_of))
    return sums[: len(acts_on)], sums[len(acts_on) :]


class _LinearProgram(NamedTuple):
    """Minimise cost . v over matrix v <= limits."""

    cost: Floats
    matrix: csr_array
    limits: Floats


def _program(problem: ReachabilityProblem, effect: Floats) -> _LinearProgram:
    """Return the linear program of a plan, for the `effect` of disturbances without feedback.

    Its variables are

    - the nominal controls;
    - the gains of all pairs (t, s), by component of w;
    - magnitudes, by component of w: upper bounds of the absolute values of each effect of
      `_Spreads`, then of each gain;
    - the maximum terminal states.

    Controls are divided by their bounds, and constraints by their sizes. A constraint on the
    nominal state or control is tightened by the sum of the magnitudes of all disturbances.
    """
    periods, n, m = problem.control.shape
    components = effect.shape[3]
    gains = len(_gain_pairs(periods).control_times) * m

    constraints = _all_constraints(problem)
    sizes = np.abs(constraints.normals) @ problem.state_bounds
    rows = constraints.normals / sizes[:, None]
    ends = constraints.offsets / sizes
    responses = _responses(problem)
    nominal = _nominal_rows(problem, rows, ends, responses)
    spreads = _spreads(rows[n:], np.isfinite(ends[:, n:]), responses, effect)
    sums_of_states, sums_of_controls = _sums_of_magnitudes(problem, nominal, spreads, components)

    # The signed values below the magnitudes are the effects by_gains g + direct, and the gains g.
    signed = kron(np.eye(components), csr_array(np.vstack([spreads.by_gains, np.eye(gains)])))
    constant = np.vstack([spreads.direct, np.zeros((gains, components))]).T.ravel()
    magnitudes = eye_array(len(constant))

    is_last = (nominal.times == periods) & (nominal.kinds < 2 * n)
    maxima = np.tile(np.eye(n), (2, 1))
    unit = np.eye(periods * m)
    ones = np.ones(periods * m)
    matrix = block_array(
        [
            [nominal.by_controls, None, sums_of_states, None],
            [unit, None, sums_of_controls, None],
            [-unit, None, sums_of_controls, None],
            [nominal.by_controls[is_last], None, sums_of_states[is_last], -maxima],
            [None, signed, -magnitudes, None],
            [None, -signed, -magnitudes, None],
        ],
        format="csr",
    )
    room = nominal.ends - nominal.coasting
    limits = np.concatenate([room, ones, ones, -nominal.coasting[is_last], -constant, constant])
    costs = [0.0, _MAGNITUDE_COST, 1.0]
    cost = np.repeat(costs, [periods * m + components * gains, len(constant), n])
    return _LinearProgram(cost, matrix, limits)


def _solution(program: _LinearProgram) -> Floats:
    """Return the variables of a solution, whose feasibility and duality gap are checked."""
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

    checked = ConeProgram(program.cost).keep(program.matrix, program.limits)
    return checked.checked(optimum.x, -optimum.ineqlin.marginals).point


def _controls_of(
    problem: ReachabilityProblem, variables: Floats, components: int
) -> tuple[Floats, Floats]:
    """Return the nominal controls and the gains of a solution, in units of the problem."""
    periods, _, m = problem.control.shape
    pairs = _gain_pairs(periods)
    count = len(pairs.control_times)
    nominal, of_pairs, _ = np.split(variables, np.cumsum([periods * m, components * count * m]))

    gains = np.zeros((periods, periods, m, components))
    by_pair = np.moveaxis(of_pairs.reshape(components, count, m), 0, -1)
    gains[pairs] = by_pair * problem.control_bounds[:, None]
    return nominal.reshape(periods, m) * problem.control_bounds, gains
