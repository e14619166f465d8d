"""Both routes and exact rationals on random systems; members of the set of optimal controls."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, reject, settings
from hypothesis import strategies as st

from infoset.arrays import Floats
from infoset.rendezvous.reachability import (
    EmptyTubeError,
    ReachabilityProblem,
    ReachableSets,
    Route,
    SetKind,
    ThinSetError,
    ThrustShape,
    TooManyVerticesError,
    analytic_centre,
    chebyshev_centre,
    effort,
    minimum_energy,
    minimum_l1,
    minimum_norms,
    minimum_peak,
    samples,
    solve,
    vertices,
)
from infoset.rendezvous.reachability.conic import CONE_TOLERANCE
from infoset.rendezvous.reachability.optimum import BlockOptimum
from infoset.rendezvous.reachability.sets import LiftedSets, exact_sets
from infoset.rendezvous.reachability.solve import optimal_controls
from tests.rendezvous.reachability.conftest import Paper

from .rationals import rational_sets

Random = Callable[[int, int], ReachabilityProblem]
SHARED = [HealthCheck.function_scoped_fixture]
needs_ppl = pytest.mark.skipif(
    find_spec("ppl") is None, reason="needs the extra exact: pip install '.[exact]'"
)


def blocks_of(problem: ReachabilityProblem) -> tuple[BlockOptimum, ...]:
    try:
        return optimal_controls(problem).blocks
    except EmptyTubeError:
        reject()


@settings(max_examples=40, deadline=None, suppress_health_check=SHARED)
@given(seed=st.integers(0, 10**6), size=st.integers(2, 6))
def test_routes_agree_with_each_other(random_problem: Random, seed: int, size: int) -> None:
    for optimum in blocks_of(random_problem(seed, size)):
        try:
            exact = exact_sets(optimum)
            lifted = LiftedSets(optimum)
        except (TooManyVerticesError, ThinSetError):
            reject()
        for kind in SetKind:
            assert np.abs(exact.bounds(kind) - lifted.bounds(kind)).max() < 1e-9


@needs_ppl
@settings(max_examples=25, deadline=None, suppress_health_check=SHARED)
@given(seed=st.integers(0, 10**6), size=st.integers(2, 5))
def test_exact_route_agrees_with_exact_rationals(
    random_problem: Random, seed: int, size: int
) -> None:
    for optimum in blocks_of(random_problem(seed, size)):
        try:
            exact = exact_sets(optimum)
        except (TooManyVerticesError, ThinSetError):
            reject()
        forward, tube = rational_sets(optimum.block)
        for found, expected in zip(exact.forward, forward, strict=True):
            assert np.abs(np.stack(found.bounding_box(), axis=-1) - expected.bounds).max() < 1e-9
            assert found.dimension == expected.dimension
            assert len(found.vertices) <= len(expected.vertices)
        if optimum.reached:
            assert np.abs(exact.bounds(SetKind.TUBE)[1] - tube[1].bounds).max() < 1e-9


@pytest.mark.parametrize("thrust", list(ThrustShape))
@pytest.mark.parametrize("bound", [1.0, 0.15])
def test_samples_are_optimal_and_controls_outside_the_set_are_not(
    paper: Paper, thrust: ThrustShape, bound: float
) -> None:
    problem = paper(bound=bound, thrust=thrust)
    optimal = solve(problem).optimal
    generator = np.random.default_rng(1)
    members = samples(optimal, 1000, generator)
    norms = np.linalg.norm(problem.run(members)[:, -1], axis=1)
    assert np.abs(norms - optimal.miss).max() < 1e-7
    assert float(problem.excess(members).max()) < 1e-9
    assert float(optimal.excess(members).max()) < 1e-9
    # Controls outside the set: members moved out of its affine hull, and pushed outward in it.
    moved = members + 1e-3 * generator.standard_normal(members.shape)
    centre = chebyshev_centre(optimal)
    pushed = centre + 40.0 * (members - centre)
    for outside in (moved, pushed) if optimal.dimension else (moved,):
        broken = problem.excess(outside) > 1e-9
        missed = np.linalg.norm(problem.run(outside)[:, -1], axis=1) > optimal.miss + 1e-7
        assert (broken | missed).all()
        assert (optimal.excess(outside) > 1e-9).all()


def test_samples_are_reproducible_and_centred_on_the_centroid(paper: Paper) -> None:
    optimal = solve(paper()).optimal
    corners = vertices(optimal)
    drawn = samples(optimal, 1500, np.random.default_rng(0))
    assert len(corners) == 27
    assert float(optimal.excess(corners).max()) < 1e-9
    ranges = optimal.ranges()
    np.testing.assert_allclose(corners.min(axis=0), ranges[..., 0], atol=1e-9)
    np.testing.assert_allclose(corners.max(axis=0), ranges[..., 1], atol=1e-9)
    # The set of controls along z is a triangle; the mean of uniform samples is its centroid.
    triangle = np.unique(corners[:, :, 2].round(9), axis=0)
    assert len(triangle) == 3
    spread = np.ptp(triangle, axis=0)
    assert np.abs((drawn[:, :, 2].mean(axis=0) - triangle.mean(axis=0)) / spread).max() < 0.03
    again = samples(optimal, 1500, np.random.default_rng(0))
    np.testing.assert_array_equal(drawn, again)


@pytest.mark.parametrize("thrust", list(ThrustShape))
def test_selection_has_the_smallest_cost_of_a_thousand_members(
    paper: Paper, thrust: ThrustShape
) -> None:
    optimal = solve(paper(thrust=thrust)).optimal
    drawn = [effort(each) for each in samples(optimal, 1000, np.random.default_rng(2))]
    chosen = {
        "energy": minimum_energy(optimal),
        "l1": minimum_l1(optimal),
        "norms": minimum_norms(optimal),
        "peak": minimum_peak(optimal),
    }
    for name, control in chosen.items():
        assert float(optimal.excess(control)) < 1e-9
        if name == "peak" and thrust is ThrustShape.BALL:  # then the peak is of the norm
            own = float(np.linalg.norm(control, axis=1).max())
            others = samples(optimal, 1000, np.random.default_rng(2))
            assert own <= float(np.linalg.norm(others, axis=2).max(axis=1).min())
        else:
            smallest = min(getattr(each, name) for each in drawn)
            assert getattr(effort(control), name) <= smallest + 1e-9

    accuracy = 1e-12 if thrust is ThrustShape.BOX else CONE_TOLERANCE
    for centre in (chebyshev_centre(optimal), analytic_centre(optimal)):
        assert float(optimal.excess(centre)) < accuracy


def test_analytic_centre_has_the_max_product_of_slacks(paper: Paper) -> None:
    optimal = solve(paper()).optimal
    space = optimal.space
    centre = analytic_centre(optimal).ravel()

    def product(control: Floats) -> float:
        point = np.linalg.lstsq(
            space.control_response, control / optimal.scale - space.control_free, rcond=None
        )[0]
        return float(np.log(space.limits - space.rows @ point).sum())

    best = product(centre)
    assert all(
        product(each.ravel()) < best for each in samples(optimal, 200, np.random.default_rng(0))
    )


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({}, ""),
        ({"thrust": ThrustShape.BALL}, "thrust in a ball"),
        ({"periods": 16, "period_s": 45.0}, "more than 100 vertices"),
        ({"periods": 17, "period_s": 45.0}, "at most 16 periods"),
    ],
)
def test_lifted_route_states_its_reason(
    paper: Paper, monkeypatch: pytest.MonkeyPatch, changes: dict[str, Any], reason: str
) -> None:
    monkeypatch.setattr("infoset.rendezvous.reachability.sets.MAX_VERTICES", 100)

    solution = solve(paper(**changes))

    assert solution.route is (Route.LIFTED if reason else Route.EXACT)
    assert reason in solution.reason


@pytest.fixture(scope="module")
def both_routes(paper: Paper) -> tuple[ReachableSets, ReachableSets]:
    exact = solve(paper())
    parts = tuple(LiftedSets(optimum) for optimum in exact.optimal.blocks)
    return exact.sets, ReachableSets(exact.problem, parts)


@pytest.mark.parametrize(
    ("kind", "time", "axes"),
    [
        (SetKind.TUBE, 2, (0, 1)),
        (SetKind.FORWARD, 3, (0, 1, 2)),
        (SetKind.TUBE, 1, (3, 4, 5)),
    ],
)
def test_projections_of_both_routes_agree(
    both_routes: tuple[ReachableSets, ReachableSets],
    kind: SetKind,
    time: int,
    axes: tuple[int, ...],
) -> None:
    exact, lifted = (sets.projection(kind, time, axes) for sets in both_routes)

    directions = np.random.default_rng(0).standard_normal((40, len(axes)))
    gap = np.abs((directions @ exact.T).max(axis=1) - (directions @ lifted.T).max(axis=1))
    assert gap.max() < 1e-8 * np.abs(exact).max()
