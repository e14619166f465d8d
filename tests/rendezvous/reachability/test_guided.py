"""Theorems 5 and 6 of docs/guaranteed-rendezvous.md: flights with the set on board."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linprog

from infoset.arrays import Floats
from infoset.geometry.polytope import Polytope
from infoset.rendezvous.reachability import (
    AffinePlan,
    AnsweredPlan,
    GuidedCraft,
    LinearTruth,
    OutputProblem,
    PathRows,
    affine_plan,
    answered_plan,
    guided,
    guided_flight,
    lower_bound,
)
from infoset.rendezvous.reachability.answer import last_answer
from infoset.rendezvous.reachability.conic import NoSolutionError
from infoset.rendezvous.reachability.guaranteed import plan_at_caps
from infoset.rendezvous.relative_motion import EllipticOrbit, TschaunerHempel
from tests.rendezvous.reachability.arch_rendezvous import (
    ROUNDING,
    START,
    START_ERROR,
    arch,
    fly,
    norms,
)
from tests.rendezvous.reachability.leo_rendezvous import in_space


@pytest.fixture(scope="module")
def plan() -> AffinePlan:
    return affine_plan(arch(10, 10.0, 6.0), 3)


class GreedyTruth(LinearTruth):
    """Errors that leave the widest terminal set after the next output, of all pairs of corners."""

    def __init__(self, problem: OutputProblem, generator: np.random.Generator) -> None:
        signs = generator.choice([-1.0, 1.0], 6)
        periods = problem.periods
        self.execution = np.zeros((periods, 2))
        self.noise = np.zeros((periods, 2))
        self.noise[0] = signs[4:]
        start = START + START_ERROR * signs[:4]
        super().__init__(problem, start, self.execution, self.noise)
        self._observer = guided.observer_of(problem)

    def move(self, control: Floats) -> None:
        problem = self.problem
        time = self.time
        self._observer.update(self.measured())
        errors = guided.errors_of_step(problem, time, control)
        self._observer.predict(control, disturbance=errors)
        if time + 1 < problem.periods:
            self._choose(time, control)
        super().move(control)

    def _choose(self, time: int, control: Floats) -> None:
        """Write the execution error of this period and the measurement error of the next one."""
        problem = self.problem
        moved = problem.transition[time] @ self.state + problem.control[time] @ control
        to_goal = problem.goal
        for t in range(problem.periods - 1, time, -1):
            to_goal = to_goal @ problem.transition[t]
        present = self._observer.estimate().polytopes[0]

        widest = -1.0
        signs = np.array(np.meshgrid(*[[-1.0, 1.0]] * 4)).reshape(4, -1).T
        for corner in signs:
            push = problem.control[time] @ (0.02 * corner[:2])
            output = (moved + push)[:2] + 3.0 * corner[2:]
            part = present.cut(np.eye(2, 4), output - 3.0, output + 3.0)
            width = float(np.ptp(part.vertices @ to_goal.T, axis=0).max())
            if width > widest:
                widest = width
                self.execution[time] = corner[:2]
                self.noise[time + 1] = corner[2:]


def hidden_truth(problem: OutputProblem, generator: np.random.Generator) -> LinearTruth:
    """Errors whose purified outputs are all zero, and with the most effect in a direction."""
    direction = generator.choice([-1.0, 1.0]) * problem.goal[generator.integers(4)]
    direction = direction + 0.2 * generator.normal(size=4) @ problem.goal
    outputs = problem.pure_outputs.reshape(-1, problem.errors.size)
    worst = linprog(
        -direction @ problem.free_states[-1],
        A_eq=outputs,
        b_eq=np.zeros(len(outputs)),
        bounds=(-1.0, 1.0),
    )
    assert worst.status == 0, worst.message
    start, execution, noise = np.split(worst.x, [4, 4 + 2 * problem.periods])
    return LinearTruth(
        problem, START + START_ERROR * start, execution.reshape(-1, 2), noise.reshape(-1, 2)
    )


def uniform_truth(problem: OutputProblem, generator: np.random.Generator) -> LinearTruth:
    return LinearTruth.random(problem, generator, at_bounds=False)


def extreme_truth(problem: OutputProblem, generator: np.random.Generator) -> LinearTruth:
    return LinearTruth.random(problem, generator, at_bounds=True)


class Witness:
    """A true motion whose states are kept."""

    def __init__(self, truth: LinearTruth) -> None:
        self.truth = truth
        self.states = list[Floats]()

    def measured(self) -> Floats:
        self.states.append(self.truth.state)
        return self.truth.measured()

    def move(self, control: Floats) -> None:
        self.truth.move(control)


def check_flight(
    plan: AffinePlan | AnsweredPlan, truth: LinearTruth, max_facets: int | None = 36
) -> float:
    """Fly, compare all promises with the truth, and return the last guarantee."""
    craft = GuidedCraft(plan, window=3, max_facets=max_facets)
    problem = craft.problem
    guarantees = [craft.guarantee]
    for _ in range(problem.periods):
        craft.measure(truth.measured())
        assert craft.observer.estimate().polytopes[0].contains(truth.state)
        guarantees.append(craft.guarantee)
        control = craft.control()
        assert np.abs(control).max() <= 6.0
        truth.move(control)

    assert (np.diff(guarantees) <= 0.0).all()
    # The last promise is the smallest one.
    assert truth.distance == norms(problem, np.array([truth.state]))
    assert truth.distance <= guarantees[-1] + ROUNDING
    return float(guarantees[-1])


@pytest.mark.parametrize(
    ("make", "flights"),
    [
        (uniform_truth, 2),
        (extreme_truth, 2),
        (hidden_truth, 2),
        (GreedyTruth, 2),
        pytest.param(uniform_truth, 200, marks=pytest.mark.thorough),
        pytest.param(extreme_truth, 150, marks=pytest.mark.thorough),
        pytest.param(hidden_truth, 16, marks=pytest.mark.thorough),
        pytest.param(GreedyTruth, 150, marks=pytest.mark.thorough),
    ],
)
def test_promises_are_true_and_do_not_increase(
    plan: AffinePlan,
    make: Callable[[OutputProblem, np.random.Generator], LinearTruth],
    flights: int,
) -> None:
    last = [
        check_flight(plan, make(plan.problem, np.random.default_rng(seed)))
        for seed in range(flights)
    ]

    assert max(last) < plan.guarantee


@pytest.mark.parametrize("max_facets", [None, 10])
def test_exact_and_much_reduced_sets_keep_the_promises(
    plan: AffinePlan, max_facets: int | None
) -> None:
    truth = extreme_truth(plan.problem, np.random.default_rng(3))

    assert check_flight(plan, truth, max_facets) <= plan.guarantee


def answered_flights(answered: AnsweredPlan, errors: list[Floats]) -> list[float]:
    """The last guarantees of flights with an answered plan."""
    problem = answered.plan.problem
    last = []
    for z in errors:
        # Errors slightly inside their bounds: outputs of the flight are rounded.
        start, execution, noise = np.split(z * (1.0 - 1e-9), [4, 4 + 2 * problem.periods])
        truth = LinearTruth(
            problem, START + START_ERROR * start, execution.reshape(-1, 2), noise.reshape(-1, 2)
        )
        last.append(check_flight(answered, truth))
    return last


@pytest.mark.parametrize("replans", [pytest.param(True, marks=pytest.mark.thorough), False])
def test_answered_plan_keeps_its_promise_in_the_worst_flights(
    monkeypatch: pytest.MonkeyPatch, replans: bool
) -> None:
    problem = arch(10, 10.0, 6.0)
    answered = answered_plan(problem, 2)
    bound = lower_bound(problem)

    def fail(problem: OutputProblem, window: int | None) -> AffinePlan:
        raise NoSolutionError("injected")

    if not replans:
        monkeypatch.setattr(guided, "plan_at_caps", fail)
    last = answered_flights(answered, [bound.errors[0], -bound.errors[0], bound.errors[-1]])

    # No strategy can promise less in all flights with errors of the bound.
    assert max(last) <= answered.guarantee * (1.0 + 1e-6)
    assert replans or max(last) == pytest.approx(bound.value, rel=1e-5)


@pytest.mark.parametrize("limit", [np.inf, 6.0, 0.5])
@pytest.mark.parametrize("effect", [1.0, 0.0])
def test_last_answer_is_the_optimum_of_its_linear_program(limit: float, effect: float) -> None:
    problem = arch(1, 10.0, limit)
    control = problem.control.copy()
    control[..., 1] *= effect
    problem = replace(problem, control=control, target=np.array([-890.0, -420.0, 1.0, 0.0]))

    found = last_answer(problem)

    moved = problem.goal @ problem.transition[0]
    middle = moved @ START - problem.goal @ problem.aim
    pulls = problem.goal @ control[0]
    spread = np.abs(moved) @ START_ERROR + np.abs(pulls) @ [0.02, 0.02]
    rows = np.column_stack([np.vstack([pulls, -pulls]), -np.ones(8)])
    best = linprog(
        [0.0, 0.0, 1.0],
        rows,
        -np.concatenate([middle + spread, spread - middle]),
        bounds=[(-limit, limit), (-limit, limit), (None, None)],
    )
    assert found.guarantee == pytest.approx(best.fun, rel=1e-9)
    assert np.abs(found.nominal).max() <= limit


def test_flight_has_the_results_of_its_steps(plan: AffinePlan) -> None:
    problem = plan.problem
    generator = np.random.default_rng(5)
    z = generator.uniform(-1.0, 1.0, (2, 10, 2))
    craft = GuidedCraft(plan, window=3)

    def choose(outputs: list[Floats], _: list[Floats]) -> Floats:
        craft.measure(outputs[-1])
        return craft.control()

    states, controls = fly(problem, choose, START + START_ERROR, z[0], 3.0 * z[1])
    witness = Witness(LinearTruth(problem, START + START_ERROR, z[0], z[1]))
    flight = guided_flight(plan, witness, window=3)

    # The loops add the same terms in another order.
    np.testing.assert_allclose(flight.controls, controls, rtol=0.0, atol=ROUNDING)
    np.testing.assert_allclose(witness.states, states[:-1], rtol=0.0, atol=ROUNDING)
    np.testing.assert_allclose(witness.truth.state, states[-1], rtol=0.0, atol=ROUNDING)
    assert flight.guarantees[0] == plan.guarantee
    assert flight.is_consistent
    assert (flight.lower <= states[:-1] + ROUNDING).all()
    assert (flight.upper >= states[:-1] - ROUNDING).all()
    # A new plan and a smaller guarantee come together.
    changed = np.diff(flight.planned_at, prepend=-1) > 0
    assert (flight.planned_at[changed] == np.flatnonzero(changed)).all()
    assert ((np.diff(flight.guarantees) < 0.0) == changed).all()


def test_plan_is_kept_if_no_program_is_solved(
    plan: AffinePlan, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(problem: OutputProblem, window: int | None) -> AffinePlan:
        raise NoSolutionError("injected")

    monkeypatch.setattr(guided, "plan_at_caps", fail)
    errors = np.random.default_rng(6).uniform(-1.0, 1.0, (2, 10, 2))
    flight = guided_flight(plan, LinearTruth(plan.problem, START, errors[0], errors[1]))

    _, controls = fly(
        plan.problem,
        lambda outputs, applied: plan.control(np.array(outputs), np.array(applied)),
        START,
        errors[0],
        3.0 * errors[1],
    )
    # The last control needs no solver.
    assert (flight.planned_at == [-1] * 9 + [9]).all()
    assert (flight.guarantees[:-1] == plan.guarantee).all()
    assert flight.guarantees[-1] < plan.guarantee
    np.testing.assert_allclose(flight.controls[:-1], controls[:-1], rtol=0.0, atol=ROUNDING)


def test_plan_that_is_not_accepted_is_not_adopted(plan: AffinePlan) -> None:
    asked = []

    def accepts(better: AffinePlan, time: int) -> bool:
        asked.append((better.guarantee, time))
        return time == 9

    truth = extreme_truth(plan.problem, np.random.default_rng(7))
    craft = GuidedCraft(plan, window=3, accepts=accepts)
    planned_at = []
    for _ in range(10):
        craft.measure(truth.measured())
        planned_at.append(craft.planned_at)
        truth.move(craft.control())

    assert planned_at == [-1] * 9 + [9]
    assert len(asked) > 1
    assert all(guarantee < plan.guarantee for guarantee, _ in asked)
    assert craft.guarantee == asked[-1][0]
    assert truth.distance <= craft.guarantee + ROUNDING


def test_answered_plan_with_a_condition_is_refused() -> None:
    answered = answered_plan(arch(2, 10.0, 20.0), 2)

    with pytest.raises(ValueError, match="adopts its last control in any case"):
        GuidedCraft(answered, accepts=lambda _plan, _time: True)


@pytest.mark.parametrize("failing", [3, 8])
def test_plan_is_kept_after_a_failure_in_one_period(
    plan: AffinePlan, monkeypatch: pytest.MonkeyPatch, failing: int
) -> None:
    def fail_once(problem: OutputProblem, window: int | None) -> AffinePlan:
        if problem.periods == 10 - failing:
            raise NoSolutionError("injected")
        return plan_at_caps(problem, window)

    monkeypatch.setattr(guided, "plan_at_caps", fail_once)
    truth = extreme_truth(plan.problem, np.random.default_rng(7))
    flight = guided_flight(plan, truth, window=3)

    assert flight.planned_at[failing] == flight.planned_at[failing - 1] >= 0
    assert flight.guarantees[failing + 1] == flight.guarantees[failing]
    assert truth.distance <= flight.guarantees[-1] + ROUNDING


def test_outputs_that_contradict_the_bounds_keep_the_plan(plan: AffinePlan) -> None:
    noise = np.zeros((10, 2))
    noise[4] = 100.0

    flight = guided_flight(
        plan, LinearTruth(plan.problem, START, np.zeros((10, 2)), noise), window=3
    )

    assert not flight.is_consistent
    assert np.isnan(flight.lower[4:]).all()
    assert not np.isnan(flight.lower[:4]).any()
    assert (flight.planned_at[4:] == flight.planned_at[3]).all()


def wedge(line_of_sight: float, error: float) -> Floats:
    """Normals of the half-planes normals x <= 0 of all positions within an angle."""
    low = line_of_sight - error
    high = line_of_sight + error
    return np.array(
        [[np.sin(low), -np.cos(low), 0.0, 0.0], [-np.sin(high), np.cos(high), 0.0, 0.0]]
    )


@pytest.mark.parametrize("flights", [1, pytest.param(16, marks=pytest.mark.thorough)])
def test_angles_cut_the_set_in_flight(flights: int) -> None:
    # Section 7 of the derivation: no range, angles within 0.5 degrees, nothing else is measured.
    error = np.deg2rad(0.5)
    problem = arch(10, 10.0, 6.0)
    problem = replace(problem, output=0.0 * problem.output, noise=0.0 * problem.noise)
    plan = affine_plan(problem)

    last = []
    for seed in range(flights):
        generator = np.random.default_rng(seed)
        truth = uniform_truth(problem, generator)
        craft = GuidedCraft(plan)
        guarantees = [plan.guarantee]
        for _ in range(10):
            seen = np.arctan2(truth.state[1], truth.state[0]) + generator.uniform(-error, error)
            craft.observer.cut(wedge(seen, error), upper=0.0)
            craft.measure(np.zeros(2))
            assert craft.observer.estimate().polytopes[0].contains(truth.state)
            guarantees.append(craft.guarantee)
            truth.move(craft.control())
        assert (np.diff(guarantees) <= 0.0).all()
        assert truth.distance <= guarantees[-1] + ROUNDING
        last.append(guarantees[-1])

    # As without outputs, before the flight.
    assert plan.guarantee == pytest.approx(116.2046, abs=1e-4)
    assert max(last) < 0.8 * plan.guarantee


def test_execution_errors_are_those_of_the_known_control() -> None:
    problem = replace(
        arch(10, 10.0, 8.0),
        relative_error=np.full(2, 0.03),
        disturbance=np.repeat(np.diag([0.1, 0.1, 0.0, 0.0])[None], 10, axis=0),
    )

    control = np.array([2.0, -5.0])
    effects = guided.errors_of_step(problem, 4, control)

    expected = np.abs(problem.control[4]) @ [0.02 + 0.06, 0.02 + 0.15] + [0.1, 0.1, 0.0, 0.0]
    lower, upper = effects.bounding_box()
    np.testing.assert_allclose(upper, expected, rtol=1e-12)
    np.testing.assert_allclose(lower, -expected, rtol=1e-12)


def test_proportional_errors_keep_the_promises() -> None:
    problem = replace(arch(6, 10.0, 8.0), relative_error=np.full(2, 0.03))
    plan = affine_plan(problem, 2)

    for seed in range(3):
        truth = LinearTruth.random(problem, np.random.default_rng(seed), at_bounds=seed > 0)
        flight = guided_flight(plan, truth, window=2)

        assert (np.diff(flight.guarantees) <= 0.0).all()
        assert truth.distance <= flight.guarantees[-1] + ROUNDING
        assert np.abs(flight.controls).max() <= 8.0


def test_path_holds_in_flight() -> None:
    free = affine_plan(arch(6, 10.0, 8.0), 2)
    speed = 0.9 * float(free.state_ranges.largest[1:6, 2:].max())
    rows = PathRows(
        np.repeat(np.arange(1, 6), 2),
        np.tile(np.eye(4)[2:], (5, 1)),
        np.zeros((10, 2)),
        np.full(10, -speed),
        np.full(10, speed),
    )
    plan = affine_plan(replace(arch(6, 10.0, 8.0), path=rows), 2)

    for seed in range(3):
        witness = Witness(extreme_truth(plan.problem, np.random.default_rng(seed)))
        flight = guided_flight(plan, witness, window=2)

        assert (np.diff(flight.guarantees) <= 0.0).all()
        assert flight.planned_at[-1] == 5
        assert np.abs(np.array(witness.states)[1:, 2:]).max() <= speed + ROUNDING


def test_six_states_keep_the_promises_and_improve_them() -> None:
    orbit = EllipticOrbit.of_size(6778137.0, 0.5, 3.986004418e14)
    start = np.array([0.0, -1000.0, 0.0, 0.0, 0.0, 0.0])
    problem = in_space(TschaunerHempel(orbit), start)
    plan = affine_plan(problem, 3)

    witness = Witness(uniform_truth(problem, np.random.default_rng(1)))

    flight = guided_flight(plan, witness, window=3)

    assert (np.diff(flight.guarantees) <= 0.0).all()
    assert flight.guarantees[-1] < plan.guarantee
    assert witness.truth.distance <= flight.guarantees[-1] + ROUNDING
    assert (flight.lower <= np.array(witness.states)).all()
    assert (flight.upper >= np.array(witness.states)).all()


def test_random_start_is_in_its_set() -> None:
    corner = Polytope.from_vertices(START + np.vstack([np.zeros(4), np.diag(START_ERROR)]))
    problem = replace(arch(4), start=corner)

    for seed in range(5):
        inside = uniform_truth(problem, np.random.default_rng(seed))
        vertex = extreme_truth(problem, np.random.default_rng(seed))

        assert corner.contains(inside.state, tolerance=ROUNDING)
        assert (np.abs(corner.vertices - vertex.state).max(axis=1) == 0.0).any()
