"""Backward sets against polytopes, and against the tube."""

from __future__ import annotations

import numpy as np
from hypothesis import given, reject, settings
from hypothesis import strategies as st

from infoset.geometry.polytope import Polytope
from infoset.rendezvous.reachability import (
    EmptyTubeError,
    ReachabilityProblem,
    backward_bounds,
    optimal_controls,
)
from tests.rendezvous.reachability.conftest import Paper


def test_double_integrator() -> None:
    # x+ = x + v + u / 2, v+ = v + u. One step from 0: v = -u, x = u / 2. Two steps: v is at most 2.
    problem = ReachabilityProblem(
        np.array([[[1.0, 1.0], [0.0, 1.0]]] * 2),
        np.array([[[0.5], [1.0]]] * 2),
        np.array([0.0, 0.0]),
        np.array([10.0, 1.5]),
        np.array([1.0]),
    )
    bounds = backward_bounds(optimal_controls(problem))
    expected = [
        # v(0) = -u(0) - u(1), at most 1.5, and x(0) = u(0) / 2 + 3 u(1) / 2.
        [[-1.75, 1.75], [-1.5, 1.5]],
        [[-0.5, 0.5], [-1.0, 1.0]],
        [[0.0, 0.0], [0.0, 0.0]],
    ]
    np.testing.assert_allclose(bounds, expected, atol=1e-8)


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_sets_are_those_of_polytopes(seed: int) -> None:
    # G-(t) = X and the preimage under A of G-(t + 1) - B U.
    generator = np.random.default_rng(seed)
    periods = int(generator.integers(1, 4))
    transition = np.eye(3) + 0.4 * generator.standard_normal((periods, 3, 3))
    control = 0.5 * generator.standard_normal((periods, 3, 2))
    problem = ReachabilityProblem(
        transition, control, generator.uniform(-0.2, 0.2, 3), np.ones(3), np.ones(2)
    )
    try:
        optimal = optimal_controls(problem)
    except EmptyTubeError:
        reject()

    (part,) = optimal.blocks
    reached = Polytope.from_vertices(part.terminal[None, :])
    bounds = backward_bounds(optimal)
    for t in range(periods - 1, -1, -1):
        for half in control[t].T:
            reached = reached.add_segment(half)
        rows, limits = reached.constraints()
        box = Polytope.from_box(-np.ones(3), np.ones(3))
        reached = box.cut(rows @ transition[t], upper=limits)
        found = np.stack(reached.bounding_box(), axis=-1)
        # The programs violate constraints by at most 1e-9, which a thin corner magnifies.
        np.testing.assert_allclose(bounds[t], found, atol=1e-6)


def test_sets_of_the_paper(paper: Paper) -> None:
    # With a fifth of the thrust no bound on a state is active one period before the end, where the
    # states are -A^-1 B u.
    problem = paper(bound=0.2)
    bounds = backward_bounds(optimal_controls(problem))
    effect = np.abs(np.linalg.solve(problem.transition[3], problem.control[3]))
    last = 0.2 * effect.sum(axis=1)
    np.testing.assert_allclose(bounds[3, :, 1], last, rtol=1e-7)
    np.testing.assert_allclose(bounds[3, :, 0], -last, rtol=1e-7)
    # The start of the paper is a member at t = 0.
    assert (bounds[0, :, 0] <= problem.initial).all()
    assert (problem.initial <= bounds[0, :, 1]).all()
