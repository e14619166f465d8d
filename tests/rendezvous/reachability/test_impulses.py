"""Impulses at the starts of the periods: matrices, constraints after an impulse, least Delta-v."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, reject, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from infoset.arrays import Floats
from infoset.rendezvous.reachability import (
    IMPULSE,
    EmptyTubeError,
    MotionModel,
    NonlinearMotion,
    ReachabilityProblem,
    Route,
    SetKind,
    ThinSetError,
    TooManyVerticesError,
    between_impulses,
    feedback_plan,
    impulsive,
    minimum_delta_v,
    motion_of,
    optimal_controls,
    solve,
    tightened,
)
from infoset.rendezvous.reachability.sets import LiftedSets, exact_sets
from infoset.rendezvous.relative_motion import EllipticOrbit

RATE = 0.00115697
RADIUS_M = (3.986e14 / RATE**2) ** (1.0 / 3.0)
CIRCLE = EllipticOrbit.of_size(RADIUS_M, 0.0, 3.986e14)
START = np.array([20e3, 20e3, 20e3, -20.0, 20.0, -5.0])


def hill(time_s: float) -> Floats:
    """The transition matrix of Clohessy and Wiltshire, from its printed form."""
    n = RATE
    c = np.cos(n * time_s)
    s = np.sin(n * time_s)
    return np.array(
        [
            [4.0 - 3.0 * c, 0.0, 0.0, s / n, 2.0 * (1.0 - c) / n, 0.0],
            [6.0 * (s - n * time_s), 1.0, 0.0, 2.0 * (c - 1.0) / n, 4.0 * s / n - 3.0 * time_s, 0],
            [0.0, 0.0, c, 0.0, 0.0, s / n],
            [3.0 * n * s, 0.0, 0.0, c, 2.0 * s, 0.0],
            [6.0 * n * (c - 1.0), 0.0, 0.0, -2.0 * s, 4.0 * c - 3.0, 0.0],
            [0.0, 0.0, -n * s, 0.0, 0.0, c],
        ]
    )


def rendezvous(periods: int, period_s: float) -> ReachabilityProblem:
    """The example 7.4 of Curtis, with wide bounds."""
    motion = motion_of(CIRCLE, MotionModel.TIME_VARYING)
    transition, control = impulsive(motion, periods, period_s)
    bounds = np.array([1e6] * 3 + [1e3] * 3)
    return ReachabilityProblem(transition, control, START, bounds, np.full(3, 200.0), jump=IMPULSE)


def cart(periods: int, most: float, kept: float = 1.0) -> ReachabilityProblem:
    """Position and speed, at most 10 and 1, from rest at 0; a part of the speed is kept."""
    return ReachabilityProblem(
        np.array([[[1.0, 1.0], [0.0, kept]]] * periods),
        np.array([[[1.0], [kept]]] * periods),
        np.zeros(2),
        np.array([10.0, 1.0]),
        np.array([most]),
        jump=np.array([[0.0], [1.0]]),
    )


def test_matrices_are_those_of_clohessy_and_wiltshire() -> None:
    motion = motion_of(CIRCLE, MotionModel.TIME_VARYING)
    transition, control = impulsive(motion, 2, 3600.0)
    inner = between_impulses(motion, 2, 3600.0, 3)

    size = np.abs(hill(3600.0))
    np.testing.assert_allclose(transition[1], hill(3600.0), atol=1e-9 * size.max())
    np.testing.assert_allclose(control[1], hill(3600.0)[:, 3:], atol=1e-9 * size.max())
    np.testing.assert_allclose(inner[1, 0, :, 6:], hill(900.0)[:, 3:], atol=1e-9 * size.max())


def test_coasting_craft_follow_the_linear_motion_near_the_target() -> None:
    # The remainder of gravity at 1 m is below 1e-12 m/s^2 (3 mu rho^2 / R^4).
    impulses = np.array([[[1e-4, 2e-4, -1e-4], [0.0, -1e-4, 3e-4]]])
    start = np.array([0.5, -0.5, 0.2, 0.0, 0.0, 0.0])
    truth = NonlinearMotion(CIRCLE, RADIUS_M)

    states = truth.coast(start, impulses, 600.0)[0]

    np.testing.assert_allclose(states[[1, 3]] - states[[0, 2]], impulses[0] @ IMPULSE.T, atol=1e-15)
    first = hill(600.0) @ (start + IMPULSE @ impulses[0, 0])
    second = hill(600.0) @ (first + IMPULSE @ impulses[0, 1])
    np.testing.assert_allclose(states[[2, 4]], [first, second], atol=1e-6)


def test_speed_is_bounded_after_an_impulse() -> None:
    # Impulses of 3 would give a speed of 3; the bound of 1 leaves a reach of 1 in each period.
    problem = cart(3, 3.0)
    forward = solve(problem).sets.bounds(SetKind.FORWARD)
    np.testing.assert_allclose(forward[:, 0, 1], [0.0, 1.0, 2.0, 3.0], atol=1e-9)
    np.testing.assert_allclose(forward[1:, 1, 1], 1.0, atol=1e-9)


def test_excess_contains_the_state_after_the_last_impulse() -> None:
    # Speeds: 0, 0.5 after the first impulse, 1.5 after the second.
    problem = cart(2, 3.0)
    assert problem.excess([[0.5], [1.0]]) == pytest.approx(0.5)
    assert problem.excess([[0.5], [0.5]]) <= 0.0


@settings(
    max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(seed=st.integers(0, 10**6), size=st.integers(2, 4))
def test_routes_agree_with_impulses(seed: int, size: int) -> None:
    generator = np.random.default_rng(seed)
    periods = int(generator.integers(1, 5))
    transition = np.eye(size) + 0.4 * generator.standard_normal((periods, size, size))
    jump = 0.5 * generator.standard_normal((size, int(generator.integers(1, 3))))
    problem = ReachabilityProblem(
        transition,
        transition @ jump,
        generator.uniform(-0.5, 0.5, size),
        generator.uniform(1.0, 2.0, size),
        np.full(jump.shape[1], generator.uniform(0.5, 3.0)),
        jump=jump,
    )
    try:
        for optimum in optimal_controls(problem).blocks:
            exact = exact_sets(optimum)
            lifted = LiftedSets(optimum)
            for kind in SetKind:
                assert np.abs(exact.bounds(kind) - lifted.bounds(kind)).max() < 1e-9
    except (EmptyTubeError, TooManyVerticesError, ThinSetError):
        reject()


def test_two_impulses_of_curtis() -> None:
    # Orbital Mechanics for Engineering Students, example 7.4: the printed data, and the impulses
    # that follow from them with the mean motion 0.00115697 rad/s.
    solution = solve(rendezvous(2, 8 * 3600.0))
    assert solution.optimal.dimension == 0
    assert solution.route is Route.EXACT
    impulses = minimum_delta_v(solution.optimal)
    printed = [[29.357, -66.751, 13.030], [25.821, 0.472, 24.493]]
    np.testing.assert_allclose(impulses, printed, atol=6e-4)  # n has six digits


def test_least_delta_v_of_several_impulses() -> None:
    # An independent linear program: u = plus - minus, with the printed transition matrices.
    periods = 9
    times = 3600.0 * np.arange(periods, 0, -1)
    effects = np.hstack([hill(time)[:, 3:] for time in times])
    scale = np.array([1e4] * 3 + [10.0] * 3)[:, None]
    equations = effects / scale
    missing = -(hill(times[0]) @ START) / scale[:, 0]
    best = linprog(
        np.ones(2 * effects.shape[1]),
        A_eq=np.hstack([equations, -equations]),
        b_eq=missing,
        bounds=(0.0, 200.0),
    )

    controls = minimum_delta_v(optimal_controls(rendezvous(periods, 3600.0)))

    # The programs and the matrices are accurate to 1e-8, relative.
    assert np.abs(controls).sum() == pytest.approx(best.fun, rel=1e-7)


def test_tightened_speed_holds_after_an_impulse() -> None:
    # w changes the speed by 0, 0.1 and 0.15 up to t = 0, 1 and 2. The nominal speed after an
    # impulse, which is the change of the position in a period, leaves room for it.
    problem = cart(3, 3.0, kept=0.5)
    disturbance = np.array([[[0.0], [0.1]]] * 3)
    forward = solve(tightened(problem, disturbance)).sets.bounds(SetKind.FORWARD)
    np.testing.assert_allclose(np.diff(forward[:, 0, 1]), [1.0, 0.9, 0.85], atol=1e-9)


def test_feedback_by_impulses_leaves_what_the_last_impulse_cannot_answer() -> None:
    # The last disturbance, (0.02, 0.1), has no answer. The one before would be (0.12, 0.1) at the
    # end: the last impulse removes 0.1 from both, which is best for the sum of x / 10 and v. Two
    # impulses remove earlier ones.
    problem = cart(4, 3.0)
    disturbance = np.array([[[0.02], [0.1]]] * 4)

    plan = feedback_plan(problem, disturbance)

    spread = 0.5 * (plan.state_ranges.upper - plan.state_ranges.lower)[-1]
    assert spread == pytest.approx([0.04, 0.1], abs=1e-5)
    assert plan.excess <= 0.0
