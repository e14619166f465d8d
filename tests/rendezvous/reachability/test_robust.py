from __future__ import annotations

import numpy as np
import pytest

from infoset.arrays import Floats
from infoset.rendezvous.reachability import (
    AffinePlan,
    EmptyTubeError,
    ReachabilityProblem,
    ThrustShape,
    feedback_plan,
    samples,
    solve,
    tightened,
)
from tests.rendezvous.reachability.conftest import Paper


def pushes(problem: ReachabilityProblem, acceleration_m_s2: float) -> Floats:
    """An acceleration held over each period, unknown within a bound on each axis."""
    return np.asarray(problem.control * (acceleration_m_s2 / 0.15))


def flown(
    problem: ReachabilityProblem, disturbance: Floats, controls: Floats, moves: Floats
) -> Floats:
    states = [problem.initial]
    for t in range(problem.periods):
        states.append(
            problem.transition[t] @ states[-1]
            + problem.control[t] @ controls[t]
            + disturbance[t] @ moves[t]
        )
    return np.array(states)


def run(
    problem: ReachabilityProblem, disturbance: Floats, plan: AffinePlan, moves: Floats
) -> tuple[Floats, Floats]:
    """The states and the controls of a plan under a disturbance: all states are measured."""
    states = [problem.initial]
    controls = list[Floats]()
    for t in range(problem.periods):
        controls.append(plan.control(np.array(states), np.array(controls)))
        states.append(
            problem.transition[t] @ states[-1]
            + problem.control[t] @ controls[-1]
            + disturbance[t] @ moves[t]
        )
    return np.array(states), np.array(controls)


def extreme_moves(count: int, periods: int, seed: int) -> Floats:
    return np.asarray(np.random.default_rng(seed).choice([-1.0, 1.0], (count, periods, 3)))


def test_tightened_constraints_hold_for_every_disturbance(paper: Paper) -> None:
    problem = paper()
    disturbance = pushes(problem, 1e-3)
    safe = solve(tightened(problem, disturbance))
    assert safe.optimal.miss == 0.0
    for control in samples(safe.optimal, 5, np.random.default_rng(0)):
        for moves in extreme_moves(50, 4, 1):
            states = flown(problem, disturbance, control, moves)
            assert (np.abs(states) <= problem.state_bounds + 1e-9).all()


def test_feedback_plan_satisfies_constraints_that_fixed_controls_violate(paper: Paper) -> None:
    problem = paper()
    disturbance = pushes(problem, 0.012)
    with pytest.raises(EmptyTubeError):
        solve(tightened(problem, disturbance))
    plan = feedback_plan(problem, disturbance)
    for moves in (*extreme_moves(200, 4, 2), np.zeros((4, 3))):
        states, controls = run(problem, disturbance, plan, moves)
        assert (np.abs(states) <= problem.state_bounds + 1e-6).all()
        assert (np.abs(controls) <= 1.0 + 1e-9).all()
        assert (states >= plan.state_ranges.lower - 1e-6).all()
        assert (states <= plan.state_ranges.upper + 1e-6).all()


def test_terminal_spread_is_near_the_effect_of_the_last_disturbance(paper: Paper) -> None:
    # Earlier ones can be answered, the last one cannot: its own effect is a lower bound.
    problem = paper()
    disturbance = pushes(problem, 1e-3)
    plan = feedback_plan(problem, disturbance)
    last = np.abs(disturbance[-1]).sum(axis=1)
    spread = 0.5 * (plan.state_ranges.upper - plan.state_ranges.lower)[-1]
    assert (spread >= last - 1e-9).all()
    open_loop = tightened(problem, disturbance)
    assert open_loop.offsets is not None
    fixed = problem.state_bounds - open_loop.offsets[4, :6]
    assert (spread / problem.state_bounds).sum() < 0.6 * (fixed / problem.state_bounds).sum()


def test_feedback_of_thrust_in_a_ball_and_of_many_periods_is_refused(paper: Paper) -> None:
    ball = paper(thrust=ThrustShape.BALL)
    with pytest.raises(ValueError, match="needs thrust in a box"):
        feedback_plan(ball, pushes(ball, 1e-3))
    long = paper(periods=41, period_s=10.0)
    with pytest.raises(ValueError, match="at most 40 periods, found 41"):
        feedback_plan(long, pushes(long, 1e-3))
