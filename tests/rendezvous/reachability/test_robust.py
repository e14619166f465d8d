from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import linprog

from infoset.arrays import Floats
from infoset.rendezvous.reachability import (
    EmptyTubeError,
    FeedbackPlan,
    ReachabilityProblem,
    feedback_plan,
    samples,
    solve,
    tightened,
)
from infoset.rendezvous.reachability.conic import NoSolutionError
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


def run(plan: FeedbackPlan, moves: Floats) -> tuple[Floats, Floats]:
    """The states and the controls of a plan under a disturbance."""
    controls = plan.nominal + np.einsum("tsmq,sq->tm", plan.gains, moves)
    return flown(plan.problem, plan.disturbance, controls, moves), controls


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
        states, controls = run(plan, moves)
        assert (np.abs(states) <= problem.state_bounds + 1e-6).all()
        assert (np.abs(controls) <= 1.0 + 1e-9).all()
        assert (states >= plan.lower - 1e-6).all()
        assert (states <= plan.upper + 1e-6).all()
        assert float(np.linalg.norm(states[-1])) <= plan.worst_miss + 1e-6
    # Controls do not depend on later disturbances.
    moves = extreme_moves(1, 4, 3)[0]
    later = moves.copy()
    later[2:] *= -1.0
    np.testing.assert_array_equal(run(plan, moves)[1][:3], run(plan, later)[1][:3])


def test_terminal_spread_is_near_the_effect_of_the_last_disturbance(paper: Paper) -> None:
    # Earlier ones can be answered, the last one cannot: its own effect is a lower bound.
    problem = paper()
    disturbance = pushes(problem, 1e-3)
    plan = feedback_plan(problem, disturbance)
    last = np.abs(disturbance[-1]).sum(axis=1)
    spread = 0.5 * (plan.upper[-1] - plan.lower[-1])
    assert (spread >= last - 1e-9).all()
    open_loop = tightened(problem, disturbance)
    assert open_loop.offsets is not None
    fixed = problem.state_bounds - open_loop.offsets[4, :6]
    assert (spread / problem.state_bounds).sum() < 0.6 * (fixed / problem.state_bounds).sum()


def test_feedback_plan_that_is_not_optimal_is_refused(
    paper: Paper, monkeypatch: pytest.MonkeyPatch
) -> None:
    def shifted(*arguments: Any, **options: Any) -> Any:
        result = linprog(*arguments, **options)
        result.x = result.x + 1e-6
        return result

    monkeypatch.setattr("infoset.rendezvous.reachability.robust.linprog", shifted)
    with pytest.raises(NoSolutionError, match="constraints violated by"):
        feedback_plan(paper(), pushes(paper(), 1e-3))
