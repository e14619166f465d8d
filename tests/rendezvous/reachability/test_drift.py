"""Theorem 8 of docs/guaranteed-rendezvous.md: drifts after a failure, and flights with failures."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from infoset.arrays import Floats
from infoset.geometry.polytope import Polytope
from infoset.geometry.zonotope import Zonotope
from infoset.rendezvous.reachability import (
    AffinePlan,
    Coasting,
    DriftCertificate,
    NoRobustPlanError,
    OutputProblem,
    PassiveSafety,
    PathRows,
    affine_plan,
    drift_certificate,
    impulsive,
    safe_plan,
)
from infoset.rendezvous.relative_motion import EllipticOrbit, TschaunerHempel
from tests.rendezvous.reachability.arch_rendezvous import corners
from tests.rendezvous.reachability.leo_rendezvous import (
    FREE,
    PERIODS,
    fly,
    hill,
    orbit_of,
    rendezvous,
)

KEEP_OUT_M = 60.0


def straight(start: Floats, error: Floats, periods: int = 1, goal: float = 1.0) -> OutputProblem:
    """Straight motion in periods of 10 s, with execution errors of 0.01 m/s."""
    transition, control = impulsive(TschaunerHempel(FREE), periods, 10.0)
    return OutputProblem(
        transition,
        control,
        np.repeat(np.eye(3, 6)[None], periods, axis=0),
        np.zeros((periods, 3, 0)),
        Zonotope.box(start - error, start + error),
        np.diag([1.0, goal, goal]) @ np.eye(3, 6),
        target=np.array([30.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
        execution_error=np.full(3, 0.01),
        control_limits=np.full((periods, 3), 20.0),
    )


def pushed(problem: OutputProblem, impulse: float) -> AffinePlan:
    """The plan whose first impulse is along x, without feedback."""
    nominal = np.zeros((problem.periods, 3))
    nominal[0, 0] = impulse
    outputs = problem.output.shape[1]
    return AffinePlan(problem, nominal, np.zeros((problem.periods, problem.periods, 3, outputs)))


def test_straight_drift_has_its_known_distance() -> None:
    # 100 m less 1 m and (1 + 0.01 + 0.01) m/s for 20 s, along the axis of the box of states.
    start = np.array([100.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    problem = straight(start, np.repeat([1.0, 0.01], 3))

    found = drift_certificate(pushed(problem, -1.0), Coasting(FREE, 10.0, 1, 2))

    assert found.least_distance == pytest.approx(100.0 - 1.0 - 1.02 * 20.0, abs=1e-5)
    np.testing.assert_allclose(np.linalg.norm(found.normals, axis=2), 1.0, rtol=1e-12)


def test_acceleration_in_the_drift_has_its_known_bound() -> None:
    # The Gramian's bound a t^2 / sqrt(3) after 20 s, and a h^2 / 8 between instants 2.5 s apart.
    start = np.array([100.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    plan = pushed(straight(start, np.repeat([1.0, 0.01], 3)), 0.0)

    found = drift_certificate(plan, Coasting(FREE, 10.0, 1, 2, acceleration_m_s2=0.02))

    extent = 0.02 * 400.0 / np.sqrt(3.0) + 0.02 * 2.5**2 / 8.0
    assert found.least_distance == pytest.approx(100.0 - 1.0 - 0.02 * 20.0 - extent, abs=1e-5)


def test_polytope_as_start_has_the_distance_of_the_box() -> None:
    start = np.array([100.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    error = np.repeat([1.0, 0.01], 3)
    box = straight(start, error)
    polytope = replace(box, start=Polytope.from_box(start - error, start + error))

    found = drift_certificate(pushed(polytope, -1.0), Coasting(FREE, 10.0, 1, 2))

    assert found.least_distance == pytest.approx(100.0 - 1.0 - 1.02 * 20.0, abs=1e-5)


def test_passing_through_the_target_has_no_certain_distance() -> None:
    start = np.array([100.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    plan = pushed(straight(start, np.repeat([1.0, 0.01], 3)), -10.0)

    assert drift_certificate(plan, Coasting(FREE, 10.0, 1, 2)).least_distance == 0.0


def test_first_instant_of_a_drift_is_kept_too() -> None:
    # The craft leaves at 10 m/s: it is nearest at the impulse, with only its error of 1 m.
    start = np.array([100.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    plan = pushed(straight(start, np.repeat([1.0, 0.0], 3)), 10.0)

    assert drift_certificate(plan, Coasting(FREE, 10.0, 1, 2)).least_distance == pytest.approx(
        99.0, abs=1e-5
    )


def test_safety_costs_the_known_guarantee() -> None:
    # The goal is at 30 m, the drift must stay 40 m away in spite of 0.1 m: 40.2 m at most. A
    # deviation to the sides, which also gives distance, counts a thousandfold.
    start = np.array([100.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    problem = straight(start, np.zeros(6), goal=1000.0)
    # Errors to the sides would count too: there are none.
    problem = replace(problem, execution_error=np.array([0.01, 0.0, 0.0]))

    free = affine_plan(problem)
    found = safe_plan(problem, PassiveSafety(Coasting(FREE, 10.0, 1, 1), 40.0))

    assert free.guarantee == pytest.approx(0.1, abs=1e-5)
    assert found.plan.guarantee == pytest.approx(10.2, rel=1e-4)
    assert found.least_distance >= 40.0
    assert found.plan.excess <= 0.0


def test_keep_out_that_contains_the_start_is_refused() -> None:
    start = np.array([100.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    problem = straight(start, np.repeat([1.0, 0.01], 3))

    with pytest.raises(NoRobustPlanError, match="no plan was found whose drifts stay 110 m"):
        safe_plan(problem, PassiveSafety(Coasting(FREE, 10.0, 1, 1), 110.0))


def test_more_failures_than_impulses_are_refused() -> None:
    plan = pushed(straight(np.full(6, 10.0), np.zeros(6)), 0.0)

    with pytest.raises(ValueError, match="at most 1 impulses, found 2"):
        drift_certificate(plan, Coasting(FREE, 10.0, 2, 1))


def test_long_intervals_are_refused() -> None:
    coasting = Coasting(EllipticOrbit(1e-3), 4000.0, 1, 1, instants=1)
    plan = pushed(straight(np.full(6, 10.0), np.zeros(6)), 0.0)

    with pytest.raises(ValueError, match="4000 s are too long"):
        drift_certificate(plan, coasting)


@cache
def leo_certificate() -> DriftCertificate:
    orbit = orbit_of()
    safety = PassiveSafety(Coasting(orbit, 240.0, PERIODS, PERIODS), KEEP_OUT_M)
    return safe_plan(rendezvous(orbit), safety, 3)


def errors(count: int, seed: int) -> Floats:
    """Errors in [-1, 1], half of them at vertices: start, execution, measurement."""
    size = 6 + 6 * PERIODS
    uniform = np.random.default_rng(seed).uniform(-1.0, 1.0, (count // 2, size))
    return np.vstack([uniform, corners(count - count // 2, size, seed + 1)])


def flights(plan: AffinePlan, z: Floats) -> tuple[Floats, Floats]:
    """States (T + 1, k, 6) and impulses (T, k, 3) with their errors, by the problem's matrices."""
    return fly(plan, z, lambda t, after: after @ plan.problem.transition[t].T)


def after_impulses(states: Floats, impulses: Floats) -> Floats:
    after = states[:-1].copy()
    after[..., 3:] += impulses
    return after


def least_distance_of_drifts(states: Floats, impulses: Floats, instants: int) -> float:
    """The least distance in drifts of 12 periods after each impulse, by the textbook's matrix."""
    rate = orbit_of().mean_motion_rad_s
    after = after_impulses(states, impulses)
    nearest = np.inf
    for since in np.linspace(0.0, 240.0 * PERIODS, instants):
        positions = after @ hill(rate, float(since))[:3].T
        nearest = min(nearest, float(np.linalg.norm(positions, axis=-1).min()))
    return nearest


def check_flights(count: int, instants: int) -> tuple[float, float]:
    """Return the least distance of all drifts and the largest terminal norm of flights."""
    found = leo_certificate()
    problem = found.plan.problem
    states, impulses = flights(found.plan, errors(count, 20))
    nearest = least_distance_of_drifts(states, impulses, instants)
    reached = float(np.abs((states[-1] - problem.aim) @ problem.goal.T).max())
    assert nearest >= found.least_distance
    assert reached <= found.plan.guarantee
    return nearest, reached


def test_safety_in_low_orbit_costs_no_guarantee() -> None:
    """The plan without safety may hit the target; safety changes its drifts, not its end."""
    free = affine_plan(rendezvous(orbit_of()), 3)
    found = leo_certificate()

    assert drift_certificate(free, found.tube.coasting).least_distance == 0.0
    assert found.least_distance >= KEEP_OUT_M
    assert found.plan.excess <= 0.0
    # The renewal of the normals stops at 1e-3.
    assert free.guarantee * (1.0 - 1e-6) <= found.plan.guarantee <= free.guarantee * (1.0 + 1e-3)


def test_bounds_that_no_flight_reaches_need_no_programs() -> None:
    orbit = orbit_of()
    problem = rendezvous(orbit)
    instants = PERIODS + 1
    count = 6 * instants
    wide = PathRows(
        np.repeat(np.arange(instants), 6),
        np.tile(np.eye(6), (instants, 1)),
        np.zeros((count, 3)),
        np.full(count, -1e5),
        np.full(count, 1e5),
    )
    safety = PassiveSafety(Coasting(orbit, 240.0, PERIODS, PERIODS), KEEP_OUT_M)
    programs = []

    for path in (None, wide):
        programs.append(0)

        def after_program() -> None:
            programs[-1] += 1

        found = safe_plan(replace(problem, path=path), safety, 3, after_program)
        assert found.plan.guarantee == pytest.approx(leo_certificate().plan.guarantee, rel=1e-12)

    assert programs[0] == programs[1] > 0


def test_drifts_after_failures_stay_outside() -> None:
    check_flights(100, 193)


@pytest.mark.thorough
def test_many_drifts_after_failures_stay_outside() -> None:
    nearest, _ = check_flights(2000, 577)

    assert nearest >= KEEP_OUT_M


def test_flight_with_known_normals_is_not_worse() -> None:
    found = leo_certificate()
    coasting = found.tube.coasting

    again = drift_certificate(found.plan, coasting, found.normals)

    assert (again.distances >= found.distances).all()
    assert again.least_distance >= found.least_distance


@pytest.mark.thorough
def test_proportional_errors_are_those_of_the_plan() -> None:
    orbit = orbit_of()
    problem = replace(rendezvous(orbit), relative_error=np.full(3, 0.01))
    safety = PassiveSafety(Coasting(orbit, 240.0, PERIODS, PERIODS), KEEP_OUT_M)

    found = safe_plan(problem, safety, 2)

    plan = found.plan
    assert found.least_distance >= KEEP_OUT_M
    assert plan.problem.caps is not None
    assert (plan.control_ranges.largest <= plan.problem.caps).all()


def test_limits_hold_for_proportional_errors_of_the_plan() -> None:
    """Three impulses at their limits, which larger errors would exceed."""
    orbit = orbit_of()
    problem = rendezvous(orbit, limit=1.2, periods=3)
    problem = replace(problem, relative_error=np.full(3, 0.08))

    found = safe_plan(problem, PassiveSafety(Coasting(orbit, 240.0, 1, 1), 10.0), 3)

    assert found.plan.control_ranges.largest.max() > 0.99 * 1.2
    assert found.plan.excess <= 0.0


@pytest.mark.thorough
def test_least_violation_gives_normals_if_those_of_the_free_plan_conflict() -> None:
    orbit = orbit_of()
    problem = rendezvous(orbit, period_s=300.0)
    wide = np.repeat([20.0, 0.03], 3)
    problem = replace(problem, start=Zonotope.box(problem.centre - wide, problem.centre + wide))
    safety = PassiveSafety(Coasting(orbit, 300.0, PERIODS, PERIODS), KEEP_OUT_M)

    found = safe_plan(problem, safety, 3)

    assert found.least_distance >= KEEP_OUT_M
    assert found.plan.excess <= 0.0


def test_drift_on_an_elliptic_orbit_stays_outside() -> None:
    """e = 0.5, from the perigee: Tschauner and Hempel's motion."""
    orbit = orbit_of(0.5)
    problem = rendezvous(orbit, limit=3.0)
    coasting = Coasting(orbit, 240.0, PERIODS, PERIODS)

    free = drift_certificate(affine_plan(problem, 3), coasting)
    found = safe_plan(problem, PassiveSafety(coasting, 100.0), 3)

    assert free.least_distance < 90.0
    assert found.least_distance >= 100.0
    states, impulses = flights(found.plan, errors(40, 30))
    after = after_impulses(states, impulses)
    for k in range(PERIODS):
        times = 240.0 * k + np.linspace(0.0, 240.0 * PERIODS, 121)
        matrices = TschaunerHempel(orbit).transition(240.0 * k, times)
        positions = np.einsum("san,fn->sfa", matrices[:, :3], after[k])
        assert np.linalg.norm(positions, axis=-1).min() >= found.least_distance
