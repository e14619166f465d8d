"""Parts of a problem that share no error, no control and no constraint."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from infoset.geometry.polytope import Polytope
from infoset.geometry.zonotope import Zonotope
from infoset.rendezvous.reachability import (
    OutputProblem,
    PathRows,
    affine_plan,
    answered_plan,
    independent_parts,
    information_radius,
    lower_bound,
    plan_of_parts,
)
from infoset.rendezvous.relative_motion import ClohessyWiltshire
from tests.rendezvous.reachability.leo_rendezvous import in_space

SOLVED = 1e-6
"""Relative difference of certificates of two programs with the same optimum, solved to 1e-7."""


def low_orbit(relative: bool = False) -> OutputProblem:
    """In low orbit, 500 m behind and 30 m aside."""
    start = np.array([0.0, -500.0, 30.0, 0.0, 0.0, 0.0])
    problem = in_space(ClohessyWiltshire(0.00113), start)
    return replace(problem, relative_error=np.full(3, 0.01)) if relative else problem


def test_plane_and_normal_of_an_orbit_are_parts() -> None:
    plane, normal = independent_parts(low_orbit())

    assert [each.tolist() for each in plane[1:]] == [[0, 1, 3, 4], [0, 1], [0, 1]]
    assert [each.tolist() for each in normal[1:]] == [[2, 5], [2], [2]]


def test_largest_number_of_the_parts_is_that_of_the_whole() -> None:
    whole = low_orbit()
    parts = independent_parts(whole)
    plans = [(part, affine_plan(part.problem)) for part in parts]

    plan = plan_of_parts(whole, plans)

    assert plan.guarantee == pytest.approx(max(plan.guarantee for _, plan in plans), rel=1e-12)
    assert plan.guarantee == pytest.approx(affine_plan(whole).guarantee, rel=SOLVED)
    assert plan.excess <= 0.0
    answered = max(answered_plan(part.problem).guarantee for part in parts)
    assert answered == pytest.approx(answered_plan(whole).guarantee, rel=SOLVED)
    bound = max(lower_bound(part.problem).value for part in parts)
    assert bound == pytest.approx(lower_bound(whole).value, rel=SOLVED)
    radius = max(information_radius(part.problem).value for part in parts)
    assert radius == pytest.approx(information_radius(whole).value, rel=SOLVED)


def test_caps_of_the_whole_are_those_of_the_parts() -> None:
    whole = low_orbit(relative=True)
    plans = [(part, affine_plan(part.problem)) for part in independent_parts(whole)]

    plan = plan_of_parts(whole, plans)

    assert plan.problem.caps is not None
    assert (plan.control_ranges.largest <= plan.problem.caps * (1.0 + 1e-12)).all()
    assert plan.guarantee == pytest.approx(max(plan.guarantee for _, plan in plans), rel=1e-12)


def test_part_at_rest_is_left_out() -> None:
    whole = low_orbit()
    start = np.array([0.0, -500.0, 0.0, 0.0, 0.0, 0.0])
    error = np.array([20.0, 20.0, 0.0, 0.05, 0.05, 0.0])
    planar = replace(
        whole,
        start=Zonotope.box(start - error, start + error),
        execution_error=np.array([1e-3, 1e-3, 0.0]),
    )

    (plane,) = independent_parts(planar)
    plan = plan_of_parts(planar, [(plane, affine_plan(plane.problem))])

    assert plane.controls.tolist() == [0, 1]
    assert not plan.nominal[:, 2].any()
    assert not plan.state_ranges.largest[:, [2, 5]].any()
    # Away from its target, or pushed, the normal is a part.
    assert len(independent_parts(replace(planar, target=np.array([0, 0, 1.0, 0, 0, 0])))) == 2
    pushed = np.zeros((5, 6, 1))
    pushed[:, 5] = 1e-4
    assert len(independent_parts(replace(planar, disturbance=pushed))) == 2


@pytest.mark.parametrize("coupled", ["path", "disturbance", "noise", "goal", "polytope"])
def test_what_acts_on_both_parts_joins_them(coupled: str) -> None:
    whole = low_orbit()
    both = np.array([0.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    rows = PathRows(
        np.array([2]), both[None], np.zeros((1, 3)), np.array([-np.inf]), np.array([1e4])
    )
    joined = {
        "path": replace(whole, path=rows),
        "disturbance": replace(whole, disturbance=np.tile(both[:, None], (5, 1, 1))),
        "noise": replace(whole, noise=np.ones((5, 3, 1))),
        "goal": replace(whole, goal=np.vstack([whole.goal, both])),
        "polytope": replace(whole, start=Polytope.from_box(-np.ones(6), np.ones(6))),
    }

    (one,) = independent_parts(joined[coupled])

    assert len(one.states) == 6
