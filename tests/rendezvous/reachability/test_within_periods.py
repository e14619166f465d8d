"""The section "Between impulses" of docs/guaranteed-rendezvous.md."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from infoset.geometry.zonotope import Zonotope
from infoset.rendezvous.reachability import (
    AffinePlan,
    Coasting,
    LateConstraintError,
    OutputProblem,
    PathLimits,
    PathRows,
    affine_plan,
    answers_within,
    impulsive,
    plan_within,
)
from infoset.rendezvous.relative_motion import TschaunerHempel
from tests.rendezvous.reachability.hops import BELOW, HOP_S, RATE, highest, hop, limits
from tests.rendezvous.reachability.leo_rendezvous import FREE, hill

ENDLESS = np.full(2, np.inf)


@cache
def free() -> AffinePlan:
    return affine_plan(hop())


def test_constraint_holds_between_impulses_for_all_errors() -> None:
    # At most 100 m below the orbit: a plan that keeps this at the impulses breaks it between them.
    rows = PathRows(
        np.array([1, 2]), np.tile(BELOW, (2, 1)), np.zeros((2, 3)), -ENDLESS, np.full(2, 100.0)
    )
    at_impulses = affine_plan(replace(hop(), path=rows))
    assert highest(at_impulses, BELOW) > 120.0

    plan = plan_within(hop(), limits(100.0), affine_plan)

    assert highest(plan, BELOW) <= 100.0
    assert plan.guarantee == pytest.approx(free().guarantee, rel=1e-6)
    assert limits(100.0).excess(limits(100.0).flight.tube(plan)).max() <= 0.0
    assert plan.excess <= 0.0


@pytest.mark.parametrize("normal", [[1.0, 0, 0, 0, 0, 0], [0, 0.6, 0, 0, 0.8, 0]])
def test_bound_between_instants_is_an_upper_bound_and_becomes_exact(normal: list[float]) -> None:
    normals = np.array([normal])
    attained = highest(free(), normals)

    bounds = []
    for instants in (8, 64, 512):
        each = limits(0.0, normals, instants)
        bounds.append(float(each.excess(each.flight.tube(free())).max()))

    assert attained <= bounds[2] <= bounds[1] <= bounds[0]
    # The ranges of the certificate; flights with random errors reach nearly all of them.
    ends = limits(0.0, normals, 512)
    exact = float(ends.flight.tube(free()).maxima(normals).max())
    assert bounds[2] - exact <= 0.02 * (bounds[0] - exact)


def test_unknown_acceleration_has_its_known_bound() -> None:
    # After 10 s the Gramian's bound a t^2 / sqrt(3), and a t of the velocity; between instants
    # 2.5 s apart a h^2 / 8 and a h / 2. The start is known to 1 m and 0.01 m/s.
    transition, control = impulsive(TschaunerHempel(FREE), 1, 10.0)
    start = np.array([100.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    error = np.repeat([1.0, 0.01], 3)
    problem = OutputProblem(
        transition,
        control,
        np.zeros((1, 0, 6)),
        np.zeros((1, 0, 0)),
        Zonotope.box(start - error, start + error),
        np.eye(6),
        control_limits=np.ones((1, 3)),
    )
    plan = AffinePlan(problem, np.zeros((1, 3)), np.zeros((1, 1, 3, 0)))
    flight = Coasting(FREE, 10.0, 1, 1, acceleration_m_s2=0.02)
    normals = np.array([[1.0, 0, 0, 0, 0, 0], [0, 0, 0, 0, 1.0, 0]])

    excess = PathLimits(flight, normals, np.zeros((1, 2))).excess(flight.tube(plan))

    position = 101.0 + 0.1 + 0.02 * 100.0 / np.sqrt(3.0) + 0.02 * 2.5**2 / 8.0
    velocity = 0.01 + 0.02 * 10.0 + 0.02 * 2.5 / 2.0
    np.testing.assert_allclose(excess[0, -1], [position, velocity], atol=1e-5)


def test_answer_keeps_constraints_that_follow_from_the_guarantee() -> None:
    # The last impulse of up to 2 m/s moves the craft by 1800 m: only the end of the period, which
    # is within the guarantee, bounds its motion.
    without = [answer.guarantee for answer in answers_within(hop(), None, None)]
    found = [answer.guarantee for answer in answers_within(hop(), limits(220.0), None)]

    assert found == pytest.approx(without, rel=1e-6)
    # All states whose end is in the box, carried back by the textbook's matrices.
    deepest = -np.inf
    half_widths = max(found) * np.repeat([1.0, 0.02], 3)
    for time_s in np.linspace(0.0, HOP_S, 50):
        back = np.linalg.inv(hill(RATE, float(time_s)))
        deepest = max(deepest, float((np.abs(back)[0] @ half_widths) - (back @ hop().aim)[0]))
    assert 150.0 < deepest <= 220.0


def test_answer_with_a_constraint_that_does_not_follow_is_refused() -> None:
    with pytest.raises(LateConstraintError, match="depend on the last control"):
        answers_within(hop(), limits(100.0), None)
