"""Theorem 7 of docs/guaranteed-rendezvous.md: guarantees for motion about a central body."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from infoset.arrays import Floats
from infoset.rendezvous.reachability import (
    Coasting,
    DriftCertificate,
    NonlinearPlan,
    OutputProblem,
    PassiveSafety,
    UnboundedCoastError,
    affine_plan,
    drift_certificate,
    nonlinear_plan,
    safe_plan,
    with_acceleration,
)
from infoset.rendezvous.relative_motion import EllipticOrbit
from tests.rendezvous.reachability.arch_rendezvous import corners
from tests.rendezvous.reachability.leo_rendezvous import (
    GRAVITY,
    PERIGEE_M,
    PERIODS,
    fly,
    orbit_of,
    rendezvous,
    two_body,
)

PERIOD_S = 240.0


def coasting(orbit: EllipticOrbit) -> Coasting:
    size = PERIGEE_M / (1.0 - orbit.eccentricity)
    return Coasting(orbit, PERIOD_S, PERIODS, PERIODS, semi_major_axis_m=size)


def differences(radius_m: float, count: int, seed: int) -> tuple[Floats, Floats]:
    """Points at a distance from the target, and gravity there less its linear part."""
    generator = np.random.default_rng(seed)
    directions = generator.normal(size=(count, 3))
    directions[0] = [-1.0, 0.0, 0.0]
    points = radius_m * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    target = np.array([PERIGEE_M, 0.0, 0.0])
    places = target + points
    pull = -GRAVITY * places / np.linalg.norm(places, axis=1, keepdims=True) ** 3
    gradient = GRAVITY / PERIGEE_M**3 * np.diag([2.0, -1.0, -1.0])
    return points, pull + GRAVITY * target / PERIGEE_M**3 - points @ gradient


@pytest.mark.parametrize("radius_m", [1e4, 1e5, 1e6])
def test_remainder_of_gravity_is_bounded(radius_m: float) -> None:
    motion = replace(coasting(orbit_of()), impulses=1, periods=1, instants=1)

    bound = motion.remainder(np.full((1, 1), radius_m))[0, 0]

    _, apart = differences(radius_m, 2000, 3)
    largest = np.linalg.norm(apart, axis=1)
    assert largest.max() <= bound
    # Towards the centre the bound is of the right size: (1 - rho / R)^2 of it is reached.
    assert largest[0] >= bound * (1.0 - radius_m / PERIGEE_M) ** 3


def test_acceleration_as_disturbance_has_its_known_effect() -> None:
    # Straight motion for 10 s: positions a t^2 / 2, velocities a t.
    orbit = EllipticOrbit(1e-9)
    motion = Coasting(orbit, 10.0, 1, 1)
    problem = replace(rendezvous(orbit, period_s=10.0), disturbance=None)

    added = with_acceleration(problem, motion, np.full(PERIODS, 0.02)).disturbance

    assert added is not None
    expected = np.repeat([0.02 * 50.0, 0.02 * 10.0], 3)
    widths = np.einsum("tii->ti", added)
    assert (widths >= expected * (1.0 - 1e-9)).all()
    np.testing.assert_allclose(widths, np.tile(expected, (PERIODS, 1)), rtol=2e-3)


@cache
def plan_of(eccentricity: float, behind_m: float) -> NonlinearPlan:
    orbit = orbit_of(eccentricity)
    problem = rendezvous(orbit, behind_m, limit=10.0)
    return nonlinear_plan(problem, coasting(orbit), lambda other: affine_plan(other, 3))


@cache
def safe_nonlinear() -> tuple[NonlinearPlan, DriftCertificate]:
    motion = coasting(orbit_of())
    safety = PassiveSafety(motion, 60.0)
    found = nonlinear_plan(
        rendezvous(orbit_of()), motion, lambda other: safe_plan(other, safety, 3).plan
    )
    return found, drift_certificate(found.plan, motion)


def fly_about_body(
    found: NonlinearPlan, orbit: EllipticOrbit, count: int, seed: int
) -> tuple[Floats, Floats, Floats]:
    """Return states, impulses and the farthest distance in each period of flights about a body.

    Half of the errors are at their bounds.
    """
    size = 6 + 6 * PERIODS
    uniform = np.random.default_rng(seed).uniform(-1.0, 1.0, (count // 2, size))
    z = np.vstack([uniform, corners(count - count // 2, size, seed + 1)])
    farthest = []

    def move(t: int, after: Floats) -> Floats:
        times = PERIOD_S * (t + np.arange(1, 7) / 6.0)
        path = two_body(orbit, PERIOD_S * t, after, times)
        farthest.append(np.linalg.norm(path[..., :3], axis=-1).max())
        return np.asarray(path[-1])

    states, impulses = fly(found.plan, z, move)
    return states, impulses, np.array(farthest)


def terminal_norms(problem: OutputProblem, states: Floats) -> Floats:
    return np.asarray(np.abs((states[-1] - problem.aim) @ problem.goal.T).max(axis=1))


def check_flights(eccentricity: float, behind_m: float, count: int) -> float:
    """Return the largest terminal norm, as a part of the guarantee."""
    found = plan_of(eccentricity, behind_m)
    states, _, farthest = fly_about_body(found, orbit_of(eccentricity), count, 11)
    assert (farthest < found.radii).all()
    reached = float(terminal_norms(found.plan.problem, states).max() / found.plan.guarantee)
    assert reached <= 1.0
    return reached


@pytest.mark.parametrize(
    ("eccentricity", "behind_m"),
    [
        (0.0, 1000.0),
        (0.0, 10000.0),
        (0.5, 1000.0),
    ],
)
def test_nonlinear_flights_keep_the_guarantee(eccentricity: float, behind_m: float) -> None:
    # Errors at their bounds come near the worst case: 95, 88 and 95 % of the guarantee.
    assert check_flights(eccentricity, behind_m, 600) > 0.8


def test_nonlinear_guarantee_is_above_the_linear_one_and_grows_with_the_distance() -> None:
    linear = affine_plan(rendezvous(orbit_of(), limit=10.0), 3)
    near = plan_of(0.0, 1000.0)
    far = plan_of(0.0, 10000.0)

    # An acceleration is seen after a period, and the next impulse answers it: the velocity at the
    # end differs by its effect of two periods at most.
    box_m_s = 0.02
    for found in (near, far):
        effect = 2.0 * PERIOD_S * found.accelerations.max() / box_m_s
        assert linear.guarantee < found.plan.guarantee < linear.guarantee + effect
    assert near.plan.guarantee < far.plan.guarantee
    assert (near.radii < near.assumed).all()
    # 3 mu rho^2 / R^4 is 5.7e-7 m/s^2 at 1 km, and a hundred times as large at 10 km.
    assert 5.6e-7 < near.accelerations.max() < 7e-7
    assert 5.6e-5 < far.accelerations.max() < 7e-5


def check_drifts(count: int) -> float:
    """Return the least distance in nonlinear drifts after each impulse."""
    found, certificate = safe_nonlinear()
    orbit = orbit_of()
    states, impulses, _ = fly_about_body(found, orbit, count, 13)
    nearest = np.inf
    for k in range(PERIODS):
        after = states[k].copy()
        after[:, 3:] += impulses[k]
        times = PERIOD_S * (k + np.linspace(0.0, PERIODS, 97)[1:])
        path = two_body(orbit, PERIOD_S * k, after, times)
        nearest = min(nearest, float(np.linalg.norm(path[..., :3], axis=-1).min()))
    assert nearest >= certificate.least_distance >= 60.0
    assert (terminal_norms(found.plan.problem, states) <= found.plan.guarantee).all()
    return nearest


def test_nonlinear_drifts_stay_outside() -> None:
    check_drifts(6)


@pytest.mark.thorough
def test_many_nonlinear_drifts_stay_outside() -> None:
    check_drifts(600)


def test_size_of_the_orbit_is_needed() -> None:
    orbit = orbit_of()

    with pytest.raises(ValueError, match="needs the semi-major axis"):
        nonlinear_plan(rendezvous(orbit), Coasting(orbit, PERIOD_S, PERIODS, 1))


def test_motion_through_the_centre_of_gravity_is_refused() -> None:
    orbit = orbit_of()
    problem = rendezvous(orbit, behind_m=4e6, limit=np.inf)

    with pytest.raises(UnboundedCoastError, match="not proved to stay near the target"):
        nonlinear_plan(problem, coasting(orbit), lambda other: affine_plan(other, 3))
