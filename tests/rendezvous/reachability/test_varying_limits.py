"""Sets X(t) of states and U(t) of controls that vary with time, as in the paper of 2021."""

from __future__ import annotations

import numpy as np
import pytest

from infoset.arrays import Floats
from infoset.rendezvous.reachability import (
    ReachabilityProblem,
    SetKind,
    ThrustShape,
    analytic_centre,
    min_periods,
    minimum_delta_v,
    minimum_energy,
    minimum_peak,
    samples,
    solve,
)


def walk(
    limits: Floats, start: tuple[float, float] = (0.0, 0.0), shape: ThrustShape = ThrustShape.BOX
) -> ReachabilityProblem:
    """x(t + 1) = x(t) + u(t) in the plane, |x_i| <= 10, |u_i| <= 1, u_1 + u_2 <= limits(t)."""
    periods = len(limits)
    return ReachabilityProblem(
        np.array([np.eye(2)] * periods),
        np.array([np.eye(2)] * periods),
        np.array(start),
        np.full(2, 10.0),
        np.ones(2),
        shape,
        control_normals=np.array([[1.0, 1.0]]),
        control_offsets=np.asarray(limits, dtype=float)[:, None],
    )


def test_box_of_controls_is_cut_by_the_limit_of_its_time() -> None:
    # Along (1, 1) the three steps are at most 0.5, 2 and 0.25, against it 2 each.
    solution = solve(walk(np.array([0.5, np.inf, 0.25])))
    points = solution.sets.projection(SetKind.FORWARD, 3, [0, 1])
    assert points.sum(axis=1).max() == pytest.approx(2.75, abs=1e-8)
    assert points.sum(axis=1).min() == pytest.approx(-6.0, abs=1e-8)
    assert len(solution.problem.blocks) == 1


def test_ball_of_controls_is_cut_by_the_limit_of_its_time() -> None:
    # On the circle and the line u_1 + u_2 = l the first component is l / 2 + sqrt(1/2 - l^2 / 4).
    solution = solve(walk(np.array([0.5, np.inf, 0.25]), shape=ThrustShape.BALL))
    steps = [limit / 2.0 + np.sqrt(0.5 - limit**2 / 4.0) for limit in (0.5, 1.0, 0.25)]
    reached = solution.sets.bounds(SetKind.FORWARD)[1:, 0, 1]
    np.testing.assert_allclose(reached, np.cumsum(steps), atol=1e-6)  # programs with cones: 1e-7


def test_optimal_controls_obey_their_limits() -> None:
    # From (-2, -2) to 0 the sum of all components is 4, but the limits allow 3.5 in four periods,
    # so that the end on the diagonal is (-0.25, -0.25).
    limits = np.array([0.5, 0.5, 2.0, 0.5])
    solution = solve(walk(limits, start=(-2.0, -2.0)))
    assert solution.optimal.miss == pytest.approx(0.25 * np.sqrt(2.0), rel=1e-8)

    for select in (minimum_energy, minimum_delta_v, minimum_peak, analytic_centre):
        controls = select(solution.optimal)
        assert (controls.sum(axis=1) <= limits + 1e-8).all()
    drawn = samples(solution.optimal, 20, np.random.default_rng(0))
    assert solution.optimal.excess(drawn).max() <= 1e-8


def test_least_number_of_periods_obeys_the_limits() -> None:
    assert min_periods(walk(np.full(8, 1.0), start=(-2.0, -2.0))) == 4
    assert min_periods(walk(np.full(8, 2.0), start=(-2.0, -2.0))) == 2


def test_least_number_of_periods_is_found_if_zero_cannot_be_held() -> None:
    # Each control moves down by at least 1: from (1, 1) one or two reach zero, and eight do not.
    assert min_periods(walk(np.full(8, -1.0), start=(1.0, 1.0))) == 1


def test_closed_loop_keeps_the_limits_of_later_times() -> None:
    limits = np.array([0.5, 1.0, 2.0, 1.0])
    later = walk(limits, start=(-2.0, -2.0)).rest(2, [-1.0, -1.0])
    np.testing.assert_array_equal(later.limits[1][:, 0], limits[2:])


def test_excess_contains_the_limits() -> None:
    # The excess of 0.5 is relative to the largest sum in the box, 2.
    assert walk(np.array([1.0])).excess([[1.0, 0.5]]) == pytest.approx(0.25)


def test_empty_set_of_controls_is_refused() -> None:
    with pytest.raises(ValueError, match="leave no room at t = 1"):
        walk(np.array([1.0, -2.0]))


def test_limits_that_only_corners_outside_the_ball_satisfy_are_refused() -> None:
    # In the unit circle u_1 + u_2 is at least -sqrt(2), in the square at least -2.
    walk(np.array([1.0, -1.9]))
    walk(np.array([1.0, -1.41]), shape=ThrustShape.BALL)
    with pytest.raises(ValueError, match="leave no room at t = 1"):
        walk(np.array([1.0, -1.42]), shape=ThrustShape.BALL)
