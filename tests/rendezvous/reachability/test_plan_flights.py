"""Simulated flights of a rendezvous with bounded errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from infoset.arrays import Floats
from infoset.geometry.zonotope import Zonotope
from infoset.rendezvous.reachability import (
    AffinePlan,
    ReplannedPart,
    ReplannedPlan,
    SightSensor,
    affine_plan,
    fly_plan,
    fly_replanned,
    independent_parts,
    linear_motion,
    plan_of_parts,
    sighted_plan,
    whole_problem,
    with_errors,
)
from tests.rendezvous.reachability.bounded_approach import BOX, approach, errors, problem


def test_constraints_hold_before_and_after_impulses_and_between_them_for_all_errors() -> None:
    free = affine_plan(problem())
    speed = 0.9 * float(free.state_ranges.largest[1:-1, 4].max())

    plan = affine_plan(problem(speed))
    flights = fly_plan(approach(speed), plan, errors(), 2000, 1)
    unaware = fly_plan(approach(speed), free, errors(), 2000, 1)

    assert plan.guarantee > free.guarantee
    assert plan.excess <= 0.0
    assert flights.outside == 0
    # The plan without this constraint breaks it.
    assert unaware.outside > 0


def test_flights_at_the_bounds_come_near_the_guarantee() -> None:
    plan = affine_plan(problem())

    flights = fly_plan(approach(), plan, errors(), 4000, 2)

    assert flights.outside == 0
    assert flights.distances.shape == (4000,)
    assert 0.5 * plan.guarantee < flights.distances.max() <= plan.guarantee
    # Half of the flights have errors at their bounds, and come farther than the others.
    assert flights.distances[1::2].mean() > flights.distances[::2].mean()


def test_flights_show_a_guarantee_that_is_too_small() -> None:
    whole = problem()
    assert isinstance(whole.start, Zonotope)
    smaller = Zonotope(whole.start.centre, 0.1 * whole.start.generators)
    plan = affine_plan(replace(whole, start=smaller))

    assert fly_plan(approach(), plan, errors(), 1000, 3).outside > 0


def test_flights_depend_on_the_seed_only() -> None:
    plan = affine_plan(problem())
    first, same, other = (
        fly_plan(approach(), plan, errors(), 20, seed).distances for seed in (1, 1, 2)
    )

    np.testing.assert_array_equal(first, same)
    assert (first != other).any()


@pytest.fixture(scope="module")
def before() -> ReplannedPlan:
    """The plan in the plane of the orbit and along its normal."""
    whole = problem()
    plans = [(part, affine_plan(part.problem, 2)) for part in independent_parts(whole)]
    parts = [ReplannedPart(part, plan) for part, plan in plans]
    return ReplannedPlan(plan_of_parts(whole, plans), parts, window=2)


def test_promises_of_replanned_flights_are_kept_and_do_not_increase(before: ReplannedPlan) -> None:
    flights = fly_replanned(approach(), before, errors(), 4, 1)

    assert [len(each.part.states) for each in before.parts] == [4, 2]
    assert flights.outside == 0
    assert flights.guarantees.shape == (4, 5)
    assert (flights.guarantees[:, 0] == before.plan.guarantee).all()
    assert (np.diff(flights.guarantees) <= 0.0).all()
    assert (flights.guarantees[:, -1] < before.plan.guarantee).all()
    # A flight of four periods rounds its states by less than 1e-9.
    assert (flights.distances <= flights.guarantees[:, -1] + 1e-9).all()


def test_first_replanned_flights_do_not_depend_on_their_number(before: ReplannedPlan) -> None:
    one = fly_replanned(approach(), before, errors(), 1, 5)
    two = fly_replanned(approach(), before, errors(), 2, 5)

    np.testing.assert_array_equal(two.guarantees[:1], one.guarantees)
    np.testing.assert_array_equal(two.distances[:1], one.distances)
    assert two.distances[1] != two.distances[0]


@pytest.mark.parametrize("range_error", [None, 0.5])
def test_directions_in_flight_decrease_the_guarantee(range_error: float | None) -> None:
    sensor = SightSensor(np.radians(0.5), range_error)
    seen = replace(errors(0.0), measured=np.zeros(0), sight=sensor)
    without = with_errors(approach(), seen, np.zeros(6), BOX)
    plan = affine_plan(without) if range_error is None else sighted_plan(without, sensor, 3)
    before = ReplannedPlan(plan, [ReplannedPart(whole_problem(plan.problem), plan)], window=2)

    flights = fly_replanned(approach(), before, seen, 2, 4)

    assert flights.outside == 0
    assert (np.diff(flights.guarantees) <= 0.0).all()
    assert (flights.guarantees[:, -1] < plan.guarantee).all()


def pushed(time: int, states: Floats, acting: Floats, pushes: Floats) -> Floats:
    """A motion with 20 m more along the orbit in the last period."""
    path = linear_motion(approach(), errors())(time, states, acting, pushes)
    path[:, -1, 1] += 20.0 * (time == 3)
    return path


def test_flights_with_another_motion_are_outside(before: ReplannedPlan) -> None:
    affine = fly_plan(approach(), before.plan, errors(), 10, 2, pushed)
    replanned = fly_replanned(approach(), before, errors(), 2, 2, pushed)

    assert affine.outside == 10
    assert replanned.outside == 2


def test_outputs_that_contradict_the_bounds_are_outside(before: ReplannedPlan) -> None:
    wider = replace(errors(), measured=np.full(3, 50.0))
    outside = fly_replanned(approach(), before, wider, 4, 3).outside

    assert outside == 4


def test_flights_of_a_problem_that_rests_stay() -> None:
    still = replace(problem(), start=Zonotope(np.zeros(6), np.zeros((0, 6))), execution_error=None)
    still = replace(still, relative_error=None)
    plan = AffinePlan(still, np.zeros((4, 3)), np.zeros((4, 4, 3, 3)))
    none = replace(errors(0.0), start=np.zeros(6), execution=np.zeros(3))
    resting = replace(approach(), initial=np.zeros(6))

    flights = fly_replanned(resting, ReplannedPlan(plan, []), none, 1, 0)

    assert independent_parts(still) == ()
    assert not flights.guarantees.any()
    assert not flights.distances.any()
    assert flights.outside == 0
