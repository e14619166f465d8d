"""Bounded disturbances with known states: tightened constraints, and plans with feedback.

A disturbance acts as x(t + 1) = A(t) x(t) + B(t) u(t) + D(t) w(t) with |w_k(t)| <= 1; arguments
named `disturbance` are the matrices D, of shape (T, n, q), in the units of the states.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from infoset.rendezvous._arrays import Floats
from infoset.rendezvous.reachability.bounded_errors import ErrorBounds, with_errors
from infoset.rendezvous.reachability.guaranteed import plan_at_caps
from infoset.rendezvous.reachability.independent_parts import independent_parts, plan_of_parts
from infoset.rendezvous.reachability.outputs import AffinePlan
from infoset.rendezvous.reachability.problem import ReachabilityProblem, ThrustShape

MAX_PERIODS_WITH_FEEDBACK = 40
"""Maximum number of periods of a plan with feedback: with six coupled states and three
disturbances the linear programs of 24 periods take 6 s, and of 40 periods half a minute."""
_WINDOW = 2
"""Number of the last states that a control reacts to: the last disturbance follows from two. More
change the terminal states of approach-cone by less than 1e-8."""


def tightened(problem: ReachabilityProblem, disturbance: Floats) -> ReachabilityProblem:
    """Return a problem whose controls satisfy the constraints of `problem` for all disturbances.

    The controls do not react to the `disturbance`, of shape (T, n, q). The states of the new
    problem are the states without disturbance. Each constraint is tightened by the support of the
    accumulated disturbance along its normal, which is exact.

    Raises
    ------
    ValueError
        If there are constraints within periods.
    """
    _check_whole_periods(problem)
    unit = np.eye(problem.states)
    normals, offsets = problem.further
    normals = np.vstack([unit, -unit, normals])
    bounds = np.tile(problem.state_bounds, (problem.periods + 1, 2))
    names = [f"the bound on {problem.state_name(i)}" for i in range(problem.states)] * 2
    names += [problem.name_of(k) for k in range(len(problem.further[0]))]

    effects = np.zeros((problem.states, 0))
    supports = [np.zeros(len(normals))]
    for matrix, added in zip(problem.transition, disturbance, strict=True):
        effects = np.hstack([matrix @ effects, added])
        supports.append(np.abs(normals @ effects).sum(axis=1))
    return replace(
        problem,
        normals=normals,
        offsets=np.hstack([bounds, offsets]) - np.array(supports),
        constraint_names=tuple(names),
    )


def feedback_plan(problem: ReachabilityProblem, disturbance: Floats) -> AffinePlan:
    """Return the plan with affine feedback of known states whose terminal states are smallest.

    The `disturbance` is as for `tightened`. The plan is that of `affine_plan` for outputs that are
    the states without noise. It minimises the sum of the maximum terminal states, divided by their
    bounds, and its numbers are certificates.

    Raises
    ------
    NoRobustPlanError
        If no plan with affine feedback satisfies the constraints.
    ValueError
        If there are too many periods, thrust is in a ball, or constraints are within periods.
    NoSolutionError
        If the linear program was not solved.
    """
    if problem.thrust is ThrustShape.BALL:
        raise ValueError("feedback from disturbances needs thrust in a box")
    _check_whole_periods(problem)
    if problem.periods > MAX_PERIODS_WITH_FEEDBACK:
        raise ValueError(
            f"a plan with feedback from disturbances can have at most {MAX_PERIODS_WITH_FEEDBACK} "
            f"periods, found {problem.periods}"
        )
    # Half-widths of a known start and of exact measurements, and the target.
    known = np.zeros(problem.states)
    exact = np.zeros(problem.controls)
    errors = ErrorBounds(known, exact, exact, known, disturbance)
    whole = with_errors(problem, errors, known, problem.state_bounds)
    plans = [
        (part, plan_at_caps(part.problem, _WINDOW, sum_of_rows=True))
        for part in independent_parts(whole)
    ]
    return plan_of_parts(whole, plans)


def _check_whole_periods(problem: ReachabilityProblem) -> None:
    if problem.between is not None:
        raise ValueError("disturbances need constraints at whole periods only")
