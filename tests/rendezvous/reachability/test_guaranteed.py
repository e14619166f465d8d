"""Theorems 1, 2 and 4 of docs/guaranteed-rendezvous.md: certificates, bounds and flights.

Numbers of the rendezvous of the ARCH competition are those of an independent prototype.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linprog

from infoset.arrays import Floats
from infoset.experiments.common.input_file import load_problem
from infoset.geometry.polytope import Polytope
from infoset.geometry.zonotope import Zonotope
from infoset.rendezvous.reachability import (
    LateConstraintError,
    NoRobustPlanError,
    OutputProblem,
    PathRows,
    ReachabilityProblem,
    affine_plan,
    answered_plan,
    feedback_plan,
    impulsive,
    information_radius,
    lower_bound,
    multipliers,
)
from infoset.rendezvous.reachability.guaranteed import no_rows, plan_with_rows
from infoset.rendezvous.reachability.sparse_program import Affine, SparseProgram
from infoset.rendezvous.relative_motion import EllipticOrbit, TschaunerHempel
from tests.rendezvous.reachability.arch_rendezvous import (
    START,
    START_ERROR,
    answer_by_programs,
    arch,
    by_plan,
    corners,
    fly,
    norms,
)

SOLVED = 1e-6
"""Relative difference of a certificate from the optimum: programs are solved to 1e-7 at least."""
PRINTED = 1e-3
"""Difference from a number of the prototype, whose programs were solved to 1e-3 in places."""


def scalar(periods: int, start: float, noise: float, push: float) -> OutputProblem:
    """x+ = x + u + push w, y = x + v, |v| <= noise."""
    one = np.ones((periods, 1, 1))
    return OutputProblem(
        one,
        one,
        one,
        noise * one,
        Zonotope.box([-start], [start]),
        np.ones((1, 1)),
        disturbance=push * one,
    )


def double_integrator(periods: int, noise: float) -> OutputProblem:
    """A cart whose position is measured, with nearly any start; the goal is its position."""
    return OutputProblem(
        np.repeat(np.array([[[1.0, 1.0], [0.0, 1.0]]]), periods, axis=0),
        np.repeat(np.array([[[0.5], [1.0]]]), periods, axis=0),
        np.repeat(np.array([[[1.0, 0.0]]]), periods, axis=0),
        np.full((periods, 1, 1), noise),
        Zonotope.box([-1e3, -1e3], [1e3, 1e3]),
        np.array([[1.0, 0.0]]),
    )


def errors_of(problem: OutputProblem, z: Floats) -> tuple[Floats, Floats, Floats]:
    """The start, the execution errors and the measurement errors of a vector of errors."""
    n, m, q = problem.states, problem.controls, problem.output.shape[1]
    start, execution, noise = np.split(z, [n, n + m * problem.periods])
    first = START + START_ERROR * start
    return first, execution.reshape(-1, m), noise.reshape(-1, q) * problem.noise[0, 0, 0]


@pytest.mark.parametrize(
    ("periods", "start", "noise", "push", "expected"),
    [
        # min(start + (T - 1) push, noise) + push
        (1, 1.0, 0.3, 0.1, 0.4),
        (4, 0.2, 5.0, 0.1, 0.6),
    ],
)
def test_scalar_system_has_its_known_guarantee(
    periods: int, start: float, noise: float, push: float, expected: float
) -> None:
    problem = scalar(periods, start, noise, push)

    assert affine_plan(problem).guarantee == pytest.approx(expected, rel=SOLVED)
    assert information_radius(problem).value == pytest.approx(expected, rel=SOLVED)


@pytest.mark.parametrize(("periods", "expected"), [(2, 2.1), (3, 1.4), (10, 0.7 * 11.0 / 9.0)])
def test_position_extrapolated_from_measurements_has_its_known_error(
    periods: int, expected: float
) -> None:
    # A line through the first and the last measurement, noise (T + 1) / (T - 1) at the time T.
    problem = double_integrator(periods, 0.7)

    assert affine_plan(problem).guarantee == pytest.approx(expected, rel=SOLVED)
    assert information_radius(problem).value == pytest.approx(expected, rel=SOLVED)


def test_last_control_of_full_rank_attains_the_information_radius() -> None:
    """Theorem 3, for a box."""
    problem = arch()
    full = replace(
        problem,
        control=np.repeat(np.eye(4)[None], 10, axis=0),
        control_limits=None,
        execution_error=None,
        disturbance=0.02 * problem.control,
    )

    assert affine_plan(full, 4).guarantee == pytest.approx(5.0172, abs=1e-4)
    assert information_radius(full).value == pytest.approx(5.0172, abs=1e-4)


def test_measurements_with_much_noise_do_not_help() -> None:
    assert affine_plan(arch(noise_m=1e5), 4).guarantee == pytest.approx(116.2046, abs=1e-4)


@pytest.mark.parametrize(
    ("periods", "period_min", "limit", "window", "expected"),
    [
        (10, 10.0, 6.0, None, 6.4601),
        (10, 10.0, 6.0, 2, 6.4601),
        (10, 10.0, 6.0, 3, 6.4601),
        (4, 10.0, np.inf, None, 8.5434),
        (16, 10.0, 6.0, 2, 6.4737),
        (16, 10.0, 6.0, 3, 6.4600),
        (20, 5.0, 4.5, 2, 6.5202),
        (20, 5.0, 4.5, 3, 5.6071),
        pytest.param(20, 5.0, 4.5, None, 5.6071, marks=pytest.mark.thorough),
        pytest.param(40, 2.5, 2.25, 2, 7.5336, marks=pytest.mark.thorough),
        pytest.param(40, 2.5, 2.25, 4, 7.1875, marks=pytest.mark.thorough),
        pytest.param(40, 2.5, 2.25, 8, 7.1875, marks=pytest.mark.thorough),
    ],
)
def test_affine_plan_has_the_known_guarantee(
    periods: int, period_min: float, limit: float, window: int | None, expected: float
) -> None:
    plan = affine_plan(arch(periods, period_min, limit), window)

    assert plan.guarantee == pytest.approx(expected, abs=PRINTED)
    assert plan.excess <= 0.0
    assert plan.control_ranges.largest.max() <= limit


@pytest.mark.parametrize(
    ("periods", "period_min", "limit", "value", "radius"),
    [
        (10, 10.0, 6.0, 6.0496, 5.0172),
        (4, 10.0, np.inf, 8.2343, 5.7698),
        (16, 10.0, 6.0, 6.0496, 5.0172),
        pytest.param(20, 5.0, 4.5, 5.593, 5.4032, marks=pytest.mark.thorough),
    ],
)
def test_answer_of_the_last_control_attains_the_bound(
    periods: int, period_min: float, limit: float, value: float, radius: float
) -> None:
    problem = arch(periods, period_min, limit)

    bound = lower_bound(problem).value
    answered = answered_plan(problem, 3)

    assert bound == pytest.approx(value, abs=PRINTED)
    assert bound <= answered.guarantee <= bound * (1.0 + SOLVED)
    assert answered.plan.excess <= 0.0
    assert information_radius(problem).value == pytest.approx(radius, abs=1e-4)


@pytest.mark.thorough
def test_many_periods_have_the_known_bound() -> None:
    problem = arch(40, 2.5, 2.25)

    assert lower_bound(problem).value == pytest.approx(7.1875, abs=PRINTED)
    assert information_radius(problem).value == pytest.approx(7.1875, abs=PRINTED)


@pytest.mark.parametrize(
    ("noise_m", "affine", "value"),
    [
        (0.1, 0.8853, 0.8853),
        (0.3, 1.4385, 1.366),
        (1.0, 2.9548, 2.925),
        (10.0, 17.53, 15.372),
        (30.0, 46.32, 38.840),
    ],
)
def test_noise_changes_the_guarantee_as_known(noise_m: float, affine: float, value: float) -> None:
    # The prototype's affine numbers, of window 3, have four digits; its values are without limits.
    digits = 5e-3 if affine > 10.0 else PRINTED
    free = arch(noise_m=noise_m)

    bound = lower_bound(free).value

    limited = affine_plan(arch(10, 10.0, 6.0, noise_m), 3)
    assert limited.guarantee == pytest.approx(affine, abs=digits)
    assert bound == pytest.approx(value, abs=PRINTED)
    assert bound <= answered_plan(free, 4).guarantee <= bound + 2.0 * PRINTED


@pytest.mark.parametrize("eccentricity", [0.0, 0.5])
def test_bound_is_attained_in_low_orbit_and_on_an_elliptic_orbit(eccentricity: float) -> None:
    # n = 6 = 2 m, position known to 1 m, impulses of 1 mm/s error, a start known to 20 m, 5 cm/s.
    orbit = EllipticOrbit.of_size(6778137.0, eccentricity, 3.986004418e14)
    transition, control = impulsive(TschaunerHempel(orbit), 6, 60.0)
    start = np.array([0.0, -1000.0, 0.0, 0.0, 0.0, 0.0])
    error = np.repeat([20.0, 0.05], 3)
    problem = OutputProblem(
        transition,
        control,
        np.repeat(np.eye(3, 6)[None], 6, axis=0),
        np.repeat(np.eye(3)[None], 6, axis=0),
        Zonotope.box(start - error, start + error),
        np.diag(np.repeat([1.0, 50.0], 3)),
        execution_error=np.full(3, 1e-3),
        control_limits=np.full((6, 3), 10.0),
    )

    bound = lower_bound(problem).value
    answered = answered_plan(problem, 3)

    assert information_radius(problem).value <= bound * (1.0 + SOLVED)
    assert bound <= answered.guarantee <= bound * (1.0 + SOLVED)
    assert answered.plan.excess <= 0.0
    assert answered.guarantee <= affine_plan(problem, 3).guarantee * (1.0 + SOLVED)


def test_multipliers_with_limits_have_44_vertices() -> None:
    # Counted by hand for n = 4 and m = 2 in the prototype.
    found = multipliers(arch(10, 10.0, 6.0))

    assert len(found.weights) == 44
    np.testing.assert_allclose(found.weights.sum(axis=1), 1.0, rtol=1e-12)


def test_flights_stay_inside_and_worst_errors_attain_the_guarantee() -> None:
    problem = arch(10, 10.0, 6.0)
    plan = affine_plan(problem, 3)
    size = problem.errors.size
    inside = np.random.default_rng(1).uniform(-1.0, 1.0, (150, size))
    rows = problem.goal @ plan.state_columns[-1]
    middles = problem.goal @ plan.nominal_states[-1]
    worst = np.argmax(np.abs(middles) + np.abs(rows).sum(axis=1))
    extreme = np.sign(rows[worst]) * (1.0 if middles[worst] >= 0.0 else -1.0)

    reached = []
    for z in [*inside, *corners(150, size, 2), extreme]:
        states, controls = fly(problem, by_plan(plan), *errors_of(problem, z))
        reached.append(norms(problem, states))
        assert np.abs(controls).max() <= 6.0
        assert (states >= plan.state_ranges.lower - 1e-9).all()
        assert (states <= plan.state_ranges.upper + 1e-9).all()

    # A flight of ten periods rounds its states by less than 1e-9.
    assert max(reached) <= plan.guarantee + 1e-9
    assert reached[-1] == pytest.approx(plan.guarantee, rel=1e-9)


def test_errors_of_the_bound_are_hidden_from_every_strategy() -> None:
    problem = arch(10, 10.0, 6.0)
    bound = lower_bound(problem)
    plan = affine_plan(problem, 3)
    shown = np.einsum("tqz,iz->itq", problem.pure_outputs, bound.errors)

    assert np.abs(bound.errors).max() <= 1.0
    # Outputs are of the order of 3 m; they are equal to rounding.
    assert np.abs(shown[:, : bound.last + 1]).max() <= 1e-9
    assert np.abs(shown[:, bound.last + 1 :] - shown[:1, bound.last + 1 :]).max() <= 1e-9
    reached = [
        norms(problem, fly(problem, by_plan(plan), *errors_of(problem, z))[0])
        for z in [*bound.errors, *-bound.errors]
    ]
    assert max(reached) >= bound.value - 1e-6


def test_answer_over_the_exact_set_keeps_the_guarantee_in_the_worst_flights() -> None:
    problem = arch(10, 10.0, 6.0)
    answered = answered_plan(problem, 2)
    bound = lower_bound(problem)

    def choose(outputs: list[Floats], controls: list[Floats]) -> Floats:
        if len(outputs) < problem.periods:
            return answered.plan.control(np.array(outputs), np.array(controls))
        return answer_by_programs(problem, outputs, np.array(controls))

    reached = []
    for z in [*bound.errors, *-bound.errors, *corners(10, problem.errors.size, 3)]:
        # Errors slightly inside their bounds: outputs of the flight are rounded.
        states, controls = fly(problem, choose, *errors_of(problem, z * (1.0 - 1e-9)))
        reached.append(norms(problem, states))
        assert np.abs(controls).max() <= 6.0

    # The linear programs of the answer are solved to 1e-7.
    assert max(reached) <= answered.guarantee + 1e-6
    assert max(reached) >= bound.value - 1e-6


def test_polytope_as_start_has_the_numbers_of_the_box() -> None:
    box = arch(4)
    polytope = replace(box, start=Polytope.from_box(START - START_ERROR, START + START_ERROR))

    assert affine_plan(polytope).guarantee == pytest.approx(8.5434, abs=PRINTED)
    assert answered_plan(polytope).guarantee == pytest.approx(8.2343, abs=PRINTED)
    assert lower_bound(polytope).value == pytest.approx(8.2343, abs=PRINTED)
    assert information_radius(polytope).value == pytest.approx(5.7698, abs=PRINTED)


def test_start_without_symmetry_has_a_guarantee_that_its_vertices_attain() -> None:
    corner = Polytope.from_vertices(START + np.vstack([np.zeros(4), np.diag(START_ERROR)]))
    problem = replace(arch(4), start=corner)
    plan = affine_plan(problem)
    rows = np.vstack([problem.goal, -problem.goal])
    columns = rows @ plan.state_columns[-1]
    others = np.sign(columns[:, 4:])
    generator = np.random.default_rng(5)

    reached = []
    for row in range(len(rows)):
        for vertex in corner.vertices:
            z = others[row]
            execution, noise = np.split(z.reshape(8, 2), 2)
            states, _ = fly(problem, by_plan(plan), vertex, execution, 3.0 * noise)
            reached.append(norms(problem, states))
    inside = generator.dirichlet(np.ones(5), 50) @ corner.vertices
    for start, z in zip(inside, corners(50, 16, 6), strict=True):
        states, _ = fly(
            problem, by_plan(plan), start, z[:8].reshape(4, 2), 3.0 * z[8:].reshape(4, 2)
        )
        assert norms(problem, states) <= plan.guarantee + 1e-9

    assert max(reached) == pytest.approx(plan.guarantee, rel=1e-9)
    assert lower_bound(problem).value <= answered_plan(problem).guarantee <= plan.guarantee


def test_caps_of_proportional_errors_decrease_the_guarantee_and_flights_keep_it() -> None:
    problem = replace(arch(10, 10.0, 8.0), relative_error=np.full(2, 0.03))
    first = affine_plan(replace(problem, relative_error=None, execution_error=np.full(2, 0.26)), 3)
    plan = affine_plan(problem, 3)

    # Errors at the limits, 0.02 + 0.03 8, are those of the first caps.
    assert plan.guarantee < first.guarantee
    assert plan.problem.caps is not None
    assert (plan.control_ranges.largest <= plan.problem.caps).all()
    for z in corners(200, problem.errors.size, 4):
        states, controls = fly(problem, by_plan(plan), *errors_of(problem, z))
        assert norms(problem, states) <= plan.guarantee + 1e-9
        assert np.abs(controls).max() <= 8.0
    assert lower_bound(problem).value <= answered_plan(plan.problem, 3).guarantee


def test_proportional_errors_without_limits_are_refused() -> None:
    problem = replace(arch(4), relative_error=np.full(2, 0.03))

    with pytest.raises(ValueError, match="need limits of all controls"):
        affine_plan(problem)


def half_as_much(lower: float, upper: float) -> OutputProblem:
    """x(2) = u(0) + u(1) + errors of half of each, without outputs, to 10; limits of x(1)."""
    problem = scalar(2, 0.0, 0.0, 0.0)
    return replace(
        problem,
        output=np.zeros((2, 1, 1)),
        noise=np.zeros((2, 1, 0)),
        disturbance=None,
        target=np.array([10.0]),
        relative_error=np.array([0.5]),
        control_limits=np.full((2, 1), 8.0),
        path=PathRows(
            np.array([1]), np.ones((1, 1)), np.zeros((1, 1)), np.array([lower]), np.array([upper])
        ),
    )


def test_first_caps_are_those_of_a_plan() -> None:
    # At the limits x(1) has an error of 4, too much for its interval of +-3. At half of them it has
    # 2, so that u(0) = 1 and u(1) = 4; their own errors are 0.5 + 2, and 5 is missing.
    problem = half_as_much(-3.0, 3.0)

    plan = affine_plan(problem)

    # Caps are kept, and constraints, with 1e-7 to spare.
    assert plan.guarantee == pytest.approx(7.5, abs=1e-5)
    assert plan.excess <= 0.0


@pytest.mark.parametrize(
    ("interval", "message"),
    [
        # u(0) = 5 has an error of 2.5: no caps are small enough for an error of 0.25.
        ((5.0, 5.5), "no plan with affine feedback was found that keeps"),
        # Beyond the limits, also without errors.
        ((9.0, 20.0), "no plan with affine feedback keeps"),
    ],
)
def test_refusal_says_whether_no_plan_exists(interval: tuple[float, float], message: str) -> None:
    with pytest.raises(NoRobustPlanError, match=message):
        affine_plan(half_as_much(*interval))


def slow(speed: float) -> OutputProblem:
    """The rendezvous with a limit of the velocities before each impulse but the first."""
    times = np.repeat(np.arange(1, 10), 2)
    rows = PathRows(
        times,
        np.tile(np.eye(4)[2:], (9, 1)),
        np.zeros((18, 2)),
        np.full(18, -speed),
        np.full(18, speed),
    )
    return replace(arch(10, 10.0, 6.0), path=rows)


def test_path_holds_for_all_errors_and_costs_guarantee() -> None:
    free = affine_plan(arch(10, 10.0, 6.0), 3)
    speed = 0.8 * float(free.state_ranges.largest[1:10, 2:].max())
    problem = slow(speed)

    plan = affine_plan(problem, 3)

    assert plan.excess <= 0.0
    assert plan.guarantee >= free.guarantee - 1e-6
    for z in corners(50, problem.errors.size, 7):
        states, _ = fly(problem, by_plan(plan), *errors_of(problem, z))
        assert np.abs(states[1:10, 2:]).max() <= speed + 1e-9


def test_constraints_that_were_needed_before_need_one_program(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    free = affine_plan(arch(10, 10.0, 6.0), 3)
    problem = slow(0.8 * float(free.state_ranges.largest[1:10, 2:].max()))
    first = plan_with_rows(problem, 3, no_rows(problem))
    programs = []
    minimise = SparseProgram.minimise

    def counted(program: SparseProgram, cost: Affine) -> Floats:
        programs.append(program)
        return minimise(program, cost)

    monkeypatch.setattr(SparseProgram, "minimise", counted)

    again = plan_with_rows(problem, 3, first.entered)

    assert 0 < np.count_nonzero(first.entered) < len(first.entered)
    assert len(programs) == 1
    # The margin for the solver's errors is 1e-7 of the limits.
    assert again.plan.guarantee == pytest.approx(first.plan.guarantee, rel=1e-5)


def test_constraints_that_no_plan_keeps_are_refused() -> None:
    # The start is known to 25 m, and a first impulse does not see more than 3 m.
    rows = PathRows(
        np.array([1]), np.eye(4)[:1], np.zeros((1, 2)), np.array([-0.5]), np.array([0.5])
    )

    with pytest.raises(NoRobustPlanError, match="keeps the constraints for all errors"):
        affine_plan(replace(arch(4), path=rows))


@pytest.mark.parametrize(
    ("time", "state", "control", "end", "follows"),
    [
        # x(4) is at most the guarantee, 8.23 m.
        (4, [1.0, 0.0, 0.0, 0.0], [0.0, 0.0], 8.3, True),
        (4, [1.0, 0.0, 0.0, 0.0], [0.0, 0.0], 8.2, False),
        # A velocity at the end is at most 8.23 times 0.05 m/min.
        (4, [0.0, 0.0, 1.0, 1.0], [0.0, 0.0], 0.83, True),
        (4, [0.0, 0.0, 1.0, 1.0], [0.0, 0.0], 0.82, False),
        # The last control is at most 200 m/min along an axis.
        (3, [0.0, 0.0, 0.0, 0.0], [1.0, -1.0], 400.0, True),
        (3, [0.0, 0.0, 0.0, 0.0], [1.0, -1.0], 399.0, False),
    ],
)
def test_constraints_of_the_answer_must_follow_from_its_limits_and_the_guarantee(
    time: int, state: list[float], control: list[float], end: float, follows: bool
) -> None:
    rows = PathRows(
        np.array([time]),
        np.array([state]),
        np.array([control]),
        np.array([-np.inf]),
        np.array([end]),
    )
    problem = replace(arch(4, limit=200.0), path=rows)

    if follows:
        assert answered_plan(problem, 3).guarantee == pytest.approx(8.2343, abs=PRINTED)
        return
    with pytest.raises(LateConstraintError, match="depend on the last control"):
        answered_plan(problem, 3)


def test_answered_plan_keeps_the_path_for_all_errors() -> None:
    free = answered_plan(arch(10, 10.0, 6.0), 3)
    speed = 0.9 * float(free.plan.state_ranges.largest[1:9, 2:].max())
    times = np.repeat(np.arange(1, 9), 2)
    ends = np.full(16, speed)
    rows = PathRows(times, np.tile(np.eye(4)[2:], (8, 1)), np.zeros((16, 2)), -ends, ends)

    found = answered_plan(replace(arch(10, 10.0, 6.0), path=rows), 3)

    assert found.plan.state_ranges.largest[1:9, 2:].max() <= speed
    assert found.guarantee >= free.guarantee * (1.0 - SOLVED)


def test_target_moves_the_aim() -> None:
    problem = arch(4)
    target = np.array([0.0, -150.0, 0.0, 0.0])

    moved = replace(problem, target=target)

    # A target costs nothing without limits: the nominal controls reach it.
    assert affine_plan(moved).guarantee == pytest.approx(8.5434, abs=PRINTED)
    assert answered_plan(moved).guarantee == pytest.approx(8.2343, abs=PRINTED)


def least_sum_without_path(problem: ReachabilityProblem, disturbance: Floats) -> float:
    """Return the least sum of the maximum terminal states, divided by their bounds (HiGHS).

    The controls react to all disturbances before them. They are U (1, w) with the disturbances w of
    all periods, and U = positive - negative; the terminal states are (effects U + free) (1, w).
    """
    periods, states, pushes = disturbance.shape
    controls = problem.controls
    to_end = [np.eye(states)]
    for matrix in problem.transition[:0:-1]:
        to_end.insert(0, to_end[0] @ matrix)
    start = to_end[0] @ problem.transition[0] @ problem.initial
    pushed = [to_end[s] @ disturbance[s] for s in range(periods)]
    moved = [to_end[t] @ problem.control[t] for t in range(periods)]
    free = np.column_stack([start, *pushed]) / problem.state_bounds[:, None]
    effects = np.hstack(moved) / problem.state_bounds[:, None]

    known_at = np.concatenate([[0], np.repeat(np.arange(1, periods + 1), pushes)])
    is_known = known_at <= np.repeat(np.arange(periods), controls)[:, None]
    reaction = np.kron(effects, np.eye(len(known_at)))
    apart = np.eye(free.size)
    equations = np.hstack([reaction, -reaction, -apart, apart])
    sums = np.kron(np.eye(periods * controls), np.ones(len(known_at)))
    limits = np.hstack([sums, sums, np.zeros((len(sums), 2 * free.size))])
    reacting = np.where(is_known, np.inf, 0.0).ravel()
    most = np.concatenate([reacting, reacting, np.full(2 * free.size, np.inf)])

    found = linprog(
        np.repeat([0.0, 1.0], [2 * is_known.size, 2 * free.size]),
        limits,
        np.tile(problem.control_bounds, periods),
        equations,
        -free.ravel(),
        np.column_stack([np.zeros(len(most)), most]),
    )
    assert found.status == 0, found.message
    return float(found.fun)


def test_known_states_give_the_plan_with_feedback_from_disturbances() -> None:
    """C = 1 without noise: `feedback_plan` minimises the sum, `affine_plan` the largest."""
    rendezvous = load_problem("approach-cone")
    problem = rendezvous.problem
    disturbance = rendezvous.disturbance_effect
    periods = problem.periods
    normals = np.vstack([np.eye(6), problem.normals])
    upper = np.hstack([np.tile(problem.state_bounds, (periods, 1)), problem.offsets[1:]])
    lower = np.full_like(upper, -np.inf)
    lower[:, :6] = -problem.state_bounds
    rows = PathRows(
        np.repeat(np.arange(1, periods + 1), len(normals)),
        np.tile(normals, (periods, 1)),
        np.zeros((upper.size, 3)),
        lower.ravel(),
        upper.ravel(),
    )
    known = OutputProblem(
        problem.transition,
        problem.control,
        np.repeat(np.eye(6)[None], periods, axis=0),
        np.zeros((periods, 6, 0)),
        Zonotope(problem.initial, np.zeros((0, 6))),
        np.diag(1.0 / problem.state_bounds),
        disturbance=disturbance,
        control_limits=np.ones((periods, 3)),
        path=rows,
    )

    plan = affine_plan(known)
    other = feedback_plan(problem, disturbance)

    assert plan.excess <= 0.0
    assert plan.guarantee == pytest.approx(2.1341944e-4, rel=1e-6)
    assert other.guarantee == pytest.approx(plan.guarantee, rel=1e-6)
    least = least_sum_without_path(problem, disturbance)
    parts = other.state_ranges.largest[-1] / problem.state_bounds
    assert parts.sum() == pytest.approx(least, rel=1e-6)
    assert other.excess <= 0.0
