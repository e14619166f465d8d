"""What plans in flight must prove: safe drifts, constraints between impulses, and distances."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from infoset.rendezvous.reachability import (
    AffinePlan,
    Coasting,
    DriftCertificate,
    GuidedCraft,
    LinearTruth,
    OutputProblem,
    PassiveSafety,
    acceptance,
    affine_plan,
    drift_certificate,
    independent_parts,
    keeps_distances,
    keeps_drifts,
    keeps_limits,
    nonlinear_plan,
    part_of_plan,
    plan_of_parts,
    plan_within,
    safe_plan,
    whole_problem,
)
from tests.rendezvous.reachability.hops import HOP_S, HOPS, RATE, highest, hop, limits
from tests.rendezvous.reachability.leo_rendezvous import (
    PERIGEE_M,
    hill,
    orbit_of,
    rendezvous,
)

PERIOD_S = 240.0
KEEP_OUT_M = 100.0
PERIODS = 4


def short() -> OutputProblem:
    """The rendezvous in low orbit in four periods."""
    return rendezvous(orbit_of(), limit=5.0, periods=PERIODS)


def coasting() -> Coasting:
    return Coasting(orbit_of(), PERIOD_S, PERIODS, 6)


@pytest.fixture(scope="module")
def free() -> AffinePlan:
    return affine_plan(short(), 2)


@pytest.fixture(scope="module")
def safe() -> DriftCertificate:
    return safe_plan(short(), PassiveSafety(coasting(), KEEP_OUT_M), 2)


def test_coasts_of_the_rest_are_those_of_the_whole_flight() -> None:
    whole = Coasting(orbit_of(0.5), PERIOD_S, PERIODS, 3)

    rest = acceptance._later_coasts(whole, 2)

    assert rest.impulses == 2
    # The anomaly is rounded by 1e-16, and positions of 720 s are up to 1e3 times a velocity.
    np.testing.assert_allclose(rest.transitions, whole.transitions[2:], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(rest.rates, whole.rates[2:], rtol=1e-9)


def test_plan_whose_drifts_come_too_near_is_not_accepted(
    free: AffinePlan, safe: DriftCertificate
) -> None:
    accepts = keeps_drifts(safe, KEEP_OUT_M)

    assert drift_certificate(free, coasting()).least_distance < KEEP_OUT_M
    assert not accepts(free, 0)
    assert accepts(safe.plan, 0)
    # After the last impulse with a drift nothing is left to prove.
    assert accepts(free, PERIODS)


def test_plan_beyond_the_assumed_distances_is_not_accepted(free: AffinePlan) -> None:
    motion = replace(coasting(), semi_major_axis_m=PERIGEE_M)
    found = nonlinear_plan(short(), motion)
    accepts = keeps_distances(found, motion)

    # 1 m/s more for a period is far beyond the reserve of 2 % of 1 km.
    detour = replace(found.plan, nominal=found.plan.nominal + np.eye(PERIODS, 3)[:, ::-1])
    assert accepts(found.plan, 0)
    assert not accepts(detour, 0)


def test_drifts_in_flight_stay_outside_the_ball(safe: DriftCertificate) -> None:
    problem = safe.plan.problem
    rate = orbit_of().mean_motion_rad_s
    after = [hill(rate, time_s) for time_s in np.arange(0.0, 6.0 * PERIOD_S + 1.0, 10.0)]
    adopted = 0
    for seed in range(2):
        generator = np.random.default_rng(seed)
        truth = LinearTruth.random(problem, generator, at_bounds=seed == 1)
        craft = GuidedCraft(safe.plan, window=2, accepts=keeps_drifts(safe, KEEP_OUT_M))
        guarantees = [craft.guarantee]
        for t in range(PERIODS):
            craft.measure(truth.measured())
            guarantees.append(craft.guarantee)
            before = truth.state
            truth.move(craft.control())
            # The state just after the impulse with its error.
            left = np.linalg.solve(problem.transition[t], truth.state)
            np.testing.assert_allclose(left[:3], before[:3], atol=1e-6)
            distances = [float(np.linalg.norm((matrix @ left)[:3])) for matrix in after]
            assert min(distances) >= KEEP_OUT_M
        adopted += craft.planned_at >= 0
        assert (np.diff(guarantees) <= 0.0).all()
        assert truth.distance <= guarantees[-1] + 1e-9
    # New plans were adopted, not only refused.
    assert adopted > 0


DEPTH_M = 100.0
"""Greatest depth below the orbit, between the impulses of `hop` too."""


def by_parts(problem: OutputProblem) -> AffinePlan:
    """The plan of the plane of the orbit, and the one along its normal."""
    parts = [(part, affine_plan(part.problem)) for part in independent_parts(problem)]
    return plan_of_parts(problem, parts)


@pytest.fixture(scope="module")
def shallow() -> AffinePlan:
    return plan_within(hop(), limits(DEPTH_M), by_parts)


def test_plan_that_breaks_a_constraint_between_impulses_is_not_accepted(
    shallow: AffinePlan,
) -> None:
    deep = by_parts(hop())
    accepts = keeps_limits(limits(DEPTH_M), whole_problem(hop()))

    assert highest(deep, limits(DEPTH_M).normals) > DEPTH_M
    assert not accepts(deep, 0)
    assert accepts(shallow, 0)


def test_part_is_certified_by_its_own_states(shallow: AffinePlan) -> None:
    plane, _ = independent_parts(shallow.problem)
    within = limits(DEPTH_M)

    whole = within.flight.tube(shallow)
    part = within.flight.tube(part_of_plan(plane, shallow), plane)

    # The same sets in the plane; without the motion along the normal the bound (7) is smaller.
    np.testing.assert_allclose(part.maxima(within.normals), whole.maxima(within.normals), rtol=1e-9)
    assert (part.sagittas < whole.sagittas).all()
    assert keeps_limits(within, plane)(part_of_plan(plane, shallow), 0)
    assert not keeps_limits(within, plane)(part_of_plan(plane, by_parts(hop())), 0)


def test_constraints_between_impulses_hold_in_flight(shallow: AffinePlan) -> None:
    plane, _ = independent_parts(shallow.problem)
    before = part_of_plan(plane, shallow)
    inner = [hill(RATE, float(time_s)) for time_s in np.linspace(0.0, HOP_S, 101)]
    within = [matrix[np.ix_(plane.states, plane.states)] for matrix in inner]
    adopted = 0
    for seed in range(4):
        truth = LinearTruth.random(
            before.problem, np.random.default_rng(seed), at_bounds=seed % 2 == 1
        )
        craft = GuidedCraft(before, accepts=keeps_limits(limits(DEPTH_M), plane))
        for t in range(HOPS):
            craft.measure(truth.measured())
            truth.move(craft.control())
            left = np.linalg.solve(before.problem.transition[t], truth.state)
            assert max(float(-(matrix @ left)[0]) for matrix in within) <= DEPTH_M
        adopted += craft.planned_at >= 0
        assert truth.distance <= craft.guarantee + 1e-9
    assert adopted > 0
