"""Visits with a bound on the control."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from infoset.arrays import Floats
from infoset.rendezvous.bounded_control import BoundTooSmallError
from infoset.rendezvous.multipoint import (
    BestOrder,
    Meet,
    TimeLimits,
    Tour,
    best_times,
    bound_path,
    bound_visits,
    needed_bound,
)
from infoset.rendezvous.multipoint.bounded import BoundedPath
from infoset.rendezvous.multipoint.segments import LinearPath
from infoset.rendezvous.piecewise import max_control

Make = Callable[..., Tour]
RENDEZVOUS = (Meet.FLYBY, Meet.RENDEZVOUS, Meet.FLYBY)
TIMES_S = np.array([1200.0, 2600.0, 4200.0])


def linear_path(tour: Tour, times_s: Floats) -> LinearPath:
    path = tour.fly(range(len(times_s)), times_s)
    assert isinstance(path, LinearPath)
    return path


def peak(path: LinearPath) -> float:
    return max_control(path.control, path.breaks())


def between(path: LinearPath, share: float) -> float:
    """A bound between the smallest possible one and the peak."""
    return needed_bound(path) + share * (peak(path) - needed_bound(path))


def flown(path: BoundedPath, start_state: Floats, breaks_s: Floats) -> Floats:
    """State and cost, shape (7,), at the end of an integration (DOP853) under the control of a
    path.
    """
    inside = np.nextafter(breaks_s[-1], breaks_s[0])

    def rates(time_s: float, state: Floats) -> Floats:
        # At its end a segment's control is that before the jump.
        control = path.control(np.array([min(time_s, inside)]))[0]
        forced = path.motion.dynamics(time_s) @ state[:6]
        forced[3:] += control
        return np.append(forced, 0.5 * control @ control)

    state = np.append(start_state, 0.0)
    for ends in pairwise(breaks_s):
        state = solve_ivp(rates, ends, state, method="DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
    return np.asarray(state)


@pytest.mark.parametrize("meets", [(), RENDEZVOUS])
@pytest.mark.parametrize("share", [0.9, 0.4, 0.02])
def test_bounded_path_passes_its_nodes_and_keeps_the_bound(
    tours: Make, meets: tuple[Meet, ...], share: float
) -> None:
    tour = tours(3, meets, [0.0, 300.0, 0.0] if meets else ())
    without = linear_path(tour, TIMES_S)
    bound = between(without, share)

    path = bound_path(without, bound)

    assert isinstance(path, BoundedPath)
    assert peak(path) <= bound * (1.0 + 1e-9)
    assert path.cost > without.cost
    cost = 0.0
    for index, flight in enumerate(path.flights):
        state = flown(path, path.start_states[index], flight.breaks())
        np.testing.assert_allclose(state[:6], path.arrival_states[index], atol=1e-6)
        cost += float(state[6])
    assert cost == pytest.approx(path.cost, rel=1e-8)
    np.testing.assert_allclose(path.arrival_states[:, :3], path.nodes.arrive[:, :3], atol=1e-9)
    np.testing.assert_allclose(
        path.state(path.nodes.arrive_s)[:, :3], path.nodes.arrive[:, :3], atol=1e-6
    )
    # The velocity does not jump at a flyby, and the costate of the velocity neither.
    flybys = ~path.nodes.rendezvous
    np.testing.assert_allclose(
        path.jumps[flybys, 3:], 0.0, atol=1e-9 * np.abs(path.costate_before[:, 3:]).max()
    )
    if meets:
        np.testing.assert_allclose(path.arrival_states[1], path.nodes.arrive[1], atol=1e-9)
        assert (path.control(np.array([2700.0])) == 0.0).all()


@pytest.mark.parametrize("meets", [(), RENDEZVOUS])
def test_time_gradient_is_the_difference_of_costs(tours: Make, meets: tuple[Meet, ...]) -> None:
    tour = tours(3, meets)
    bound = between(linear_path(tour, TIMES_S), 0.4)

    gradient = bound_path(linear_path(tour, TIMES_S), bound).time_gradient

    for index, step in enumerate(0.5 * np.eye(3)):
        after = bound_path(linear_path(tour, TIMES_S + step), bound).cost
        before = bound_path(linear_path(tour, TIMES_S - step), bound).cost
        # The third derivative over half a second, and the rounding of a cost, 1e-11, over a second.
        assert gradient[index] == pytest.approx(after - before, rel=1e-4, abs=1e-11)


def test_bound_above_the_peak_changes_nothing(tours: Make) -> None:
    path = linear_path(tours(3), TIMES_S)
    assert bound_path(path, peak(path)) is path
    best = BestOrder((0, 1, 2), path, path.cost, 1, 1)
    assert bound_visits(tours(3), best, peak(path), None) is best


def test_bound_below_the_smallest_one_is_refused(tours: Make) -> None:
    path = linear_path(tours(3), TIMES_S)
    least = needed_bound(path)
    assert bound_path(path, 1.001 * least).cost > path.cost
    with pytest.raises(BoundTooSmallError):
        bound_path(path, 0.999 * least)


def test_best_times_with_a_bound_are_stationary(tours: Make) -> None:
    tour = tours(3)
    limits = TimeLimits(latest_s=4200.0)
    timed = best_times(tour, (0, 1, 2), limits, [TIMES_S])
    assert isinstance(timed.path, LinearPath)
    bound = between(timed.path, 0.5)
    best = BestOrder((0, 1, 2), timed.path, timed.objective, 1, timed.evaluations)

    found = bound_visits(tour, best, bound, limits, [TIMES_S])

    at_old_times = bound_path(timed.path, bound).cost
    assert timed.path.cost < found.path.cost < at_old_times
    assert found.path.nodes.arrive_s[-1] == pytest.approx(4200.0)
    assert np.abs(found.path.time_gradient[:2]).max() < 1e-6 * abs(found.path.time_gradient[2])
    assert found.evaluations > timed.evaluations
