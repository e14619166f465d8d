"""The minimum terminal norm against dense cone programs and forty digits, up to the edges."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from infoset.experiments.common.input_file import load_problem
from infoset.rendezvous.reachability import (
    EmptyTubeError,
    ReachabilityProblem,
    Route,
    ThrustShape,
    analytic_centre,
    chebyshev_centre,
    min_periods,
    minimum_energy,
    minimum_l1,
    minimum_norms,
    minimum_peak,
    optimal_controls,
    samples,
    solve,
)
from infoset.rendezvous.reachability.admissible import lift
from infoset.rendezvous.reachability.conic import CONE_TOLERANCE, MAX_GAP, NoSolutionError
from infoset.rendezvous.reachability.optimum import _OptimumSearch
from tests.rendezvous.reachability.conftest import Paper

from .high_precision import Dense, cone_program, precise_min_norm
from .random_rendezvous import random_rendezvous

CASES = Path(__file__).parent / "cases"
SELECTIONS = (
    minimum_energy,
    minimum_l1,
    minimum_norms,
    minimum_peak,
    chebyshev_centre,
    analytic_centre,
)
RELATIVE = 1e-6
ZERO = 1e-11
ABSOLUTE = 1e-12
"""Maximum miss that counts as zero, and error of small misses.

Both are relative to the effect of the controls.
"""


def size_of(problem: ReachabilityProblem) -> float:
    """The maximum effect of controls and free motion on the terminal state.

    Doubles have a rounding error of about 1e-16 of it.
    """
    given = Dense(problem)
    return float(np.abs(given.free).max() + np.abs(given.response).sum(axis=1).max())


def assert_precise(problem: ReachabilityProblem, miss: float) -> bool:
    """Compare a miss with forty digits; return False if these are not available."""
    found = precise_min_norm(problem)
    if found is None:
        return False
    expected, rounding = found
    if miss == 0.0:
        assert expected <= ZERO * size_of(problem)
        return True
    assert abs(miss - expected) <= max(MAX_GAP * expected, ABSOLUTE * size_of(problem)) + rounding
    return True


@pytest.mark.parametrize(
    "name", ["near_0.172", "near_0.1726", "s2_1_193", "s2_2_133", "s2_2_26", "s2_2_68"]
)
def test_miss_at_the_edge_of_feasibility_agrees_with_a_dense_program(name: str) -> None:
    problem = load_problem(CASES / f"{name}.toml").problem
    miss = solve(problem).optimal.miss
    if problem.periods <= 4:
        assert assert_precise(problem, miss)
    assert miss == pytest.approx(cone_program(Dense(problem), "norm")[0], rel=RELATIVE, abs=1e-6)


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["s2_2_26", "s2_2_68"])
def test_miss_for_thrust_in_a_ball_agrees_with_forty_digits(name: str) -> None:
    problem = load_problem(CASES / f"{name}.toml").problem
    assert assert_precise(problem, solve(problem).optimal.miss)


@pytest.mark.parametrize("thrust", list(ThrustShape))
@pytest.mark.parametrize("gap", [1e-1, 1e-5, 1e-9])
def test_miss_is_zero_only_above_the_minimum_bound(
    paper: Paper, thrust: ThrustShape, gap: float
) -> None:
    problem = paper(periods=3, thrust=thrust)
    minimum = cone_program(Dense(problem), "bound")[0]
    below = replace(problem, control_bounds=np.full(3, minimum * (1.0 - gap)))
    miss = optimal_controls(below).miss
    assert miss > 0.0
    assert assert_precise(below, miss)
    above = replace(problem, control_bounds=np.full(3, minimum * (1.0 + gap)))
    assert optimal_controls(above).miss == 0.0


def test_norm_of_zero_that_violates_a_constraint_is_refused(paper: Paper) -> None:
    (block, *_) = paper(periods=3).blocks
    search = _OptimumSearch(lift(block), np.ones(block.size))
    search.value = 0.0
    search.violation = 0.5

    with pytest.raises(NoSolutionError, match=r"norm, 0, .* gap 0, constraints violated by 0\.5"):
        search.result()


@pytest.mark.parametrize("bound", [0.115, 0.14, 0.172])
def test_selections_from_a_flat_set_are_optimal(paper: Paper, bound: float) -> None:
    problem = paper(bound=bound)
    optimal = solve(problem).optimal
    assert optimal.miss == pytest.approx(cone_program(Dense(problem), "norm")[0], rel=RELATIVE)
    for select in SELECTIONS:
        control = select(optimal)
        assert float(optimal.excess(control)) < 1e-9
        assert float(np.linalg.norm(problem.run(control)[-1])) == pytest.approx(
            optimal.miss, rel=1e-9
        )


def test_set_loses_dimensions_at_the_minimum_bound(paper: Paper) -> None:
    """With fewer periods than needed it is a point."""
    problem = paper()
    dimensions = []
    for shape in ThrustShape:
        given = replace(problem, thrust=shape)
        for factor in (1.0, cone_program(Dense(given), "bound")[0]):
            optimal = solve(replace(given, control_bounds=given.control_bounds * factor)).optimal
            dimensions.append(optimal.dimension)
            for select in SELECTIONS:
                assert float(optimal.excess(select(optimal))) < 1e-7
    assert dimensions[0] == dimensions[2] == 6
    assert dimensions[1] < 6
    assert dimensions[3] < 6
    assert solve(problem.first(1)).optimal.dimension == 0


@pytest.mark.parametrize("axes", [(2,), (0, 1), (0, 1, 2)])
@pytest.mark.parametrize("thrust", list(ThrustShape))
def test_problem_with_axes_without_thrust_is_solved(
    paper: Paper, axes: tuple[int, ...], thrust: ThrustShape
) -> None:
    problem = paper(thrust=thrust)
    control = problem.control.copy()
    control[:, :, list(axes)] = 0.0
    start = problem.initial.copy()
    start[3:] = [-1.0, 0.5, 0.5]
    still = replace(problem, control=control, initial=0.1 * start)
    optimal = solve(still).optimal
    assert optimal.miss == pytest.approx(cone_program(Dense(still), "norm")[0], rel=RELATIVE)
    for select in SELECTIONS:
        controls = select(optimal)
        assert float(optimal.excess(controls)) < (
            1e-9 if thrust is ThrustShape.BOX else CONE_TOLERANCE
        )
    if thrust is ThrustShape.BOX:
        assert solve(still).route is Route.EXACT  # both routes agree


@pytest.fixture(scope="module")
def miss_in_metres(paper: Paper) -> float:
    return solve(paper(bound=0.1726)).optimal.miss


@pytest.mark.parametrize("size", [1e-6, 1e6])
def test_miss_scales_with_the_unit_of_length(
    paper: Paper, miss_in_metres: float, size: float
) -> None:
    problem = paper(bound=0.1726)
    other = replace(
        problem,
        control=problem.control * size,
        initial=problem.initial * size,
        state_bounds=problem.state_bounds * size,
    )
    assert solve(other).optimal.miss == pytest.approx(size * miss_in_metres, rel=RELATIVE)


def check(seed: int, *, precise_to: int = 0, members: bool = True) -> str:
    """Solve a random problem, compare, and return the kind of result."""
    problem = random_rendezvous(seed)
    rough = Dense(problem)
    try:
        optimal = optimal_controls(problem)
    except EmptyTubeError:
        assert not cone_program(rough, "deep")[0] > 1e-8
        return "no control"
    except NoSolutionError:
        return "refused"
    expected = cone_program(rough, "norm")[0]
    miss = optimal.miss
    if np.isfinite(expected):
        assert abs(miss - expected) <= RELATIVE * expected + 1e-8 * size_of(problem)
    told = "reached" if miss == 0.0 else "missed"
    if problem.periods <= precise_to and assert_precise(problem, miss):
        told += ", to forty digits"
    if members:
        accuracy = CONE_TOLERANCE if problem.thrust is ThrustShape.BALL else 1e-8
        for select in SELECTIONS:
            try:
                controls = select(optimal)
            except NoSolutionError:
                return "refused"
            assert float(optimal.excess(controls)) < accuracy
        assert float(optimal.excess(samples(optimal, 2, np.random.default_rng(seed))).max()) < 1e-8
        optimal.ranges()
        minimum = min_periods(problem)
        assert (minimum is not None) == (miss == 0.0)
    return told


def test_model_that_amplifies_rounding_is_refused(paper: Paper) -> None:
    problem = paper(periods=20)
    growing = np.repeat([np.diag([4.0, 0.1, 0.1, 1.0, 1.0, 1.0])], 20, axis=0)
    with pytest.raises(ValueError, match="multiplies deviations by over 1e\\+10"):
        replace(problem, transition=growing)
    replace(problem, transition=growing[::-1] / 4.0)


def test_random_problems_agree_with_dense_programs() -> None:
    told = Counter(check(seed) for seed in range(24))
    assert told["refused"] == 0
    assert told["reached"] > 0
    assert told["missed"] > 3


@pytest.mark.parametrize("seed", [11, 78, 196, 274])
def test_programs_with_thrust_in_a_ball_are_solved_for_any_rounding(seed: int) -> None:
    # With each of three kernels of a BLAS some of these were refused, and others with each.
    assert check(seed) in {"missed", "reached"}


@pytest.mark.thorough
def test_two_thousand_random_problems_agree_with_forty_digits() -> None:
    # Half of them are at the edges: few may be refused, none may be wrong.
    told = Counter(check(seed, precise_to=4, members=False) for seed in range(2000))
    assert told["refused"] <= 10
