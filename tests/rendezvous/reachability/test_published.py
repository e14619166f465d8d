"""The numbers of the paper, and of its identified parameters (acceptance/reachability.json)."""

from __future__ import annotations

import numpy as np
import pytest

from infoset.arrays import Floats
from infoset.experiments.common.hill_axes import to_paper
from infoset.rendezvous.reachability import (
    MotionModel,
    NonlinearMotion,
    SetKind,
    Solution,
    ThrustShape,
    VertexCounts,
    effort,
    min_periods,
    minimum_energy,
    minimum_l1,
    minimum_norms,
    minimum_peak,
    solve,
)
from infoset.rendezvous.relative_motion import EllipticOrbit
from tests.rendezvous.reachability.conftest import Paper, printed

FORWARD = {
    1: [[1682.1015150268104, 3000], [-3000, -1646.5870806392707], [1714.4010382196716, 3000],
        [-7.5, 7.145481035439279], [-7.5, 7.5], [-7.5, 6.76333860081409]],
    2: [[332.3010389098497, 3000], [-3000, -301.26114817966607], [362.40449895191006, 3000],
        [-7.5, 7.5], [-7.5, 7.5], [-7.5, 7.5]],
    3: [[-1017.4994372071109, 3000], [-3000, 1042.5863404701045], [-989.5920403158516, 3000],
        [-7.5, 7.5], [-7.5, 7.5], [-7.5, 7.5]],
    4: [[-2367.2999133240714, 3000], [-3000, 2386.4338291198756], [-2341.5885795836134, 3000],
        [-7.5, 7.5], [-7.5, 7.5], [-7.5, 7.5]],
}  # fmt: skip
TUBE = {
    1: [[1682.1015150268104, 2551.9431339090447], [-2549.2793438973335, -1669.1751093012476],
        [1714.4010382196716, 2547.1961931945375], [-7.5, 1.7290529781477957],
        [-1.8941071581676396, 7.5], [-7.5, 1.7396148672012093]],
    2: [[332.30103890984975, 2032.6346647262549], [-2047.0483427549239, -325.3276206514768],
        [362.40449895191006, 2027.9948089016427], [-7.5, 1.7290529781477961],
        [-1.8941071581676392, 7.5], [-7.5, 1.7396148672012093]],
    3: [[-187.00743027294112, 682.8341886092944], [-703.200854105153, 176.90338049093265],
        [-156.79688534098548, 675.9982696338809], [-7.5, 1.7290529781477963],
        [-1.8941071581676385, 7.5], [-7.5, 1.7396148672012095]],
}  # fmt: skip


@pytest.fixture(scope="module")
def exact(paper: Paper) -> Solution:
    return solve(paper())


def test_matrices_agree_with_the_identified_matrices(paper: Paper) -> None:
    problem = paper()
    # Rows and columns in the paper's axes.
    a, b = (
        to_paper(to_paper(matrix).T).T for matrix in (problem.transition[0], problem.control[0])
    )
    expected = [
        1.0008801595082484,
        0.002552748205224468,
        0,
        177.71697310723644,
        25.082847920872695,
        0,
    ]
    np.testing.assert_allclose(a[0], expected, rtol=1e-11, atol=1e-13)
    assert a[2, 2] == pytest.approx(0.9911552814183396, rel=1e-12)
    assert a[2, 5] == pytest.approx(179.46900330815475, rel=1e-12)
    found = [b[0, 0], b[0, 1], b[5, 2]]
    np.testing.assert_allclose(
        found, [2414.5844342853457, 225.9057563126505, 26.920350496223215], rtol=1e-11
    )


def ends_in_paper(bounds: Floats) -> Floats:
    """Convert minimum and maximum values, shape (6, 2); the bounds of all axes are the same."""
    return np.sort(to_paper(bounds.T).T, axis=1)


def test_bounds_of_forward_sets_and_tube_agree_with_the_reference(exact: Solution) -> None:
    scale = exact.problem.state_bounds[:, None]
    forward = exact.sets.bounds(SetKind.FORWARD)
    tube = exact.sets.bounds(SetKind.TUBE)
    for t, expected in FORWARD.items():
        assert np.abs((ends_in_paper(forward[t]) - expected) / scale).max() < 1e-9
    for t, expected in TUBE.items():
        assert np.abs((ends_in_paper(tube[t]) - expected) / scale).max() < 1e-9
    assert np.abs(tube[4] / scale).max() == 0.0


def test_counts_of_vertices_facets_and_dimensions_agree_with_the_reference(
    exact: Solution, paper: Paper
) -> None:
    found = [exact.sets.counts(SetKind.FORWARD, t) for t in range(1, 5)]
    assert found == [
        VertexCounts(10, 7, 3),
        VertexCounts(130, 15, 6),
        VertexCounts(100, 15, 6),
        VertexCounts(96, 15, 6),
    ]
    assert exact.sets.counts(SetKind.TUBE, 2) == VertexCounts(27, 9, 6)
    dimensions = [exact.sets.counts(SetKind.TUBE, t) for t in (1, 3)]
    assert [each.dimension for each in dimensions if each is not None] == [3, 3]
    assert solve(paper(thrust=ThrustShape.BALL)).sets.counts(SetKind.TUBE, 2) is None


def test_minimum_norms_agree_with_the_reference(paper: Paper, exact: Solution) -> None:
    problem = paper()
    assert exact.optimal.miss == 0.0
    assert min_periods(problem) == 3
    assert solve(problem.first(1)).optimal.miss == printed("2947.01842678")
    assert solve(problem.first(2)).optimal.miss == printed("611.79357068")
    assert min_periods(problem.first(2)) is None
    assert solve(paper(bound=0.15)).optimal.miss == printed("1.62757318")


def test_minimum_energy_l1_and_peak_agree_with_the_reference(exact: Solution) -> None:
    assert effort(minimum_energy(exact.optimal)).energy == printed("0.14323052820")
    sparse = minimum_l1(exact.optimal)
    assert effort(sparse).l1 == printed("0.88770050948")
    np.testing.assert_allclose(
        to_paper(sparse[0]), [-0.1255926124, 0.0371598443, -0.2619971202], atol=1e-10
    )
    np.testing.assert_allclose(sparse[1:3], 0.0, atol=1e-10)
    np.testing.assert_allclose(
        to_paper(sparse[3]), [0.0891976706, -0.2056122151, 0.1681410469], atol=1e-10
    )
    assert effort(minimum_peak(exact.optimal)).peak == printed("0.17263864653")
    # With both ends only, the sum of norms has the same minimiser.
    np.testing.assert_allclose(minimum_norms(exact.optimal), sparse, atol=1e-6)


@pytest.mark.parametrize(
    ("model", "energy", "miss"),
    [
        (MotionModel.FROZEN, 0.14323052820, 1.668028),
        (MotionModel.TIME_VARYING, 0.143250218, 0.212159),
    ],
)
def test_nonlinear_misses_agree_with_the_reference(
    paper: Paper, orbit: EllipticOrbit, model: MotionModel, energy: float, miss: float
) -> None:
    problem = paper(model)
    control = minimum_energy(solve(problem).optimal)
    assert effort(control).energy == pytest.approx(energy, abs=1e-9)
    end = NonlinearMotion(orbit, 1e7).fly(problem.initial, 0.15 * control[None], 180.0)[0, -1]
    assert float(np.linalg.norm(end)) == pytest.approx(miss, abs=1e-6)
