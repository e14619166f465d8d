"""Flights with the set of possible states on board, and a plan that is kept until a better one.

Theorem 6 of `docs/guaranteed-rendezvous.md`: the promised guarantee never increases.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np

from infoset.geometry.polytope import Polytope
from infoset.geometry.zonotope import Zonotope
from infoset.observer.linear_observer import LinearObserver
from infoset.rendezvous._arrays import Floats, Places
from infoset.rendezvous.reachability.answer import AnsweredPlan, last_answer
from infoset.rendezvous.reachability.conic import NoSolutionError
from infoset.rendezvous.reachability.guaranteed import NoRobustPlanError, plan_at_caps
from infoset.rendezvous.reachability.outputs import AffinePlan, OutputProblem

MAX_FACETS = 36
"""Facets of a set on board: that of `LinearObserver`."""
_MAX_POLYTOPE_STATES = 4
"""Number of states up to which an observer has polytopes."""
_ANSWER_RESERVE = 1e-6
"""Relative increase of the guarantee of an answered plan in flight: sets on board are larger than
the exact ones by 1e-7 of their widths, or less."""
_ROUNDING = 1e-12
"""Relative increase of caps above the certified controls: more than a certificate is rounded."""

Acceptance = Callable[[AffinePlan, int], bool]
"""Whether a plan of the rest, from a period on, keeps what is not a constraint of its problem."""


class Cuts(NamedTuple):
    """Strips lower <= normals . x <= upper that contain the state, known only in flight.

    The shapes are (k, n), (k,) and (k,); ends may be infinite.
    """

    normals: Floats
    lower: Floats
    upper: Floats


class TrueMotion(Protocol):
    """The true motion of a flight, which only the simulation knows."""

    def measured(self) -> Floats:
        """Return the output y(t), shape (q,), before the control of the period."""

    def move(self, control: Floats) -> None:
        """Apply the control u(t), shape (m,), and its errors, until the next period."""


class LinearTruth:
    """The linear motion of a problem with given errors, as fractions of their bounds.

    Parameters
    ----------
    problem : OutputProblem
        The motion and the bounds.
    start : ndarray, shape (n,)
        The true state x(0); `state` is the present one.
    execution : ndarray, shape (T, m)
        Execution errors, as fractions of the bounds at the applied controls.
    noise : ndarray, shape (T, r)
        The measurement errors nu.
    disturbance : ndarray, shape (T, p), or None
        The errors w of the disturbances; zero if None.
    """

    def __init__(
        self,
        problem: OutputProblem,
        start: Floats,
        execution: Floats,
        noise: Floats,
        disturbance: Floats | None = None,
    ) -> None:
        self.problem = problem
        self.state = start
        self.time = 0
        self._execution = execution
        self._noise = noise
        self._disturbance = disturbance

    @classmethod
    def random(
        cls, problem: OutputProblem, generator: np.random.Generator, *, at_bounds: bool
    ) -> LinearTruth:
        """Return a motion with uniform errors, or with all errors at their bounds.

        A start in a polytope is a mixture of its vertices with uniform weights, or a vertex.
        """

        def errors(*shape: int) -> Floats:
            values = generator.uniform(-1.0, 1.0, shape)
            return np.sign(values) if at_bounds else values

        if isinstance(problem.start, Zonotope):
            generators = problem.start.generators
            start = problem.start.centre + errors(len(generators)) @ generators
        else:
            vertices = problem.start.vertices
            weights = generator.dirichlet(np.ones(len(vertices)))
            if at_bounds:
                weights = np.eye(len(vertices))[generator.integers(len(vertices))]
            start = weights @ vertices
        disturbance = None
        if problem.disturbance is not None:
            disturbance = errors(problem.periods, problem.disturbance.shape[2])
        return cls(
            problem,
            start,
            errors(problem.periods, problem.controls),
            errors(problem.periods, problem.noise.shape[2]),
            disturbance,
        )

    @property
    def distance(self) -> float:
        """The present |x - target|, in units of the goal."""
        return float(np.abs(self.problem.goal @ (self.state - self.problem.aim)).max())

    def measured(self) -> Floats:
        """Return the output y(t), shape (q,)."""
        problem = self.problem
        noise = problem.noise[self.time] @ self._noise[self.time]
        return np.asarray(problem.output[self.time] @ self.state + noise)

    def move(self, control: Floats) -> None:
        """Apply the control u(t), shape (m,), with its errors."""
        problem = self.problem
        acting = control + self._execution[self.time] * execution_bounds(problem, control)
        moved = problem.transition[self.time] @ self.state + problem.control[self.time] @ acting
        if problem.disturbance is not None and self._disturbance is not None:
            moved = moved + problem.disturbance[self.time] @ self._disturbance[self.time]
        self.state = moved
        self.time += 1


@dataclass(frozen=True, eq=False)
class GuidedFlight:
    """A flight with the set of possible states on board.

    Parameters
    ----------
    guarantees : ndarray, shape (T + 1,)
        The promised maximum of |x(T) - target| before the flight and after each output, in units of
        the goal; it does not increase.
    controls : ndarray, shape (T, m)
        The controls, in units of the problem.
    lower, upper : ndarray, shape (T, n)
        Bounds of the states after each output; NaN if the outputs contradict the bounds of the
        errors. The promises then do not hold, and the plan is kept.
    planned_at : ndarray of int, shape (T,)
        The period whose output the plan of each control was computed from; -1 is the plan before
        the flight.
    is_reduced : bool
        Whether a set on board was larger than the exact one.
    """

    guarantees: Floats
    controls: Floats
    lower: Floats
    upper: Floats
    planned_at: Places
    is_reduced: bool

    @property
    def is_consistent(self) -> bool:
        """Whether all outputs agree with the bounds of the errors."""
        return not bool(np.isnan(self.lower).any())


def execution_bounds(problem: OutputProblem, control: Floats) -> Floats:
    """Return the bounds of the execution errors of a known control, shape (m,)."""
    bounds = np.zeros(problem.controls)
    if problem.execution_error is not None:
        bounds = bounds + problem.execution_error
    if problem.relative_error is not None:
        bounds = bounds + problem.relative_error * np.abs(control)
    return bounds


class GuidedCraft:
    """The set of possible states on board, and the kept plan.

    In each period the set is cut by the output, and the program of the rest of the flight begins in
    it. Its plan replaces the kept one if its certificate is smaller than the promise; otherwise the
    kept plan gives the control.

    Parameters
    ----------
    plan : AffinePlan or AnsweredPlan
        The plan before the flight. Limits, caps and the path are those of its problem. Until it is
        replaced, an answered plan needs exact sets: none is reduced.
    window : int or None, optional
        The window of the programs, as in `affine_plan`.
    max_facets : int or None, optional
        Maximum number of facets of the set of up to four states, as in `LinearObserver`. None is
        no maximum; it is not used with an answered plan.
    accepts : callable or None, optional
        A plan of the rest is adopted only if this returns true for it and its first period:
        `keeps_drifts`, `keeps_distances` and `keeps_limits`. The plan before the flight must
        have been accepted.

    Notes
    -----
    A program of up to four states begins in the polytope of the observer. Observers of five and
    more states have no polytope; programs begin in up to three parallelotopes around the set.

    Half-spaces that are known only in flight, such as the wedge of a measured angle, are the `cuts`
    of `measure`.

    Raises
    ------
    ValueError
        If `accepts` is given with an answered plan, whose last control must be adopted.
    ArithmeticError
        In `control`, if a set that is not reduced has more than 5000 vertices.
    """

    def __init__(
        self,
        plan: AffinePlan | AnsweredPlan,
        *,
        window: int | None = None,
        max_facets: int | None = MAX_FACETS,
        accepts: Acceptance | None = None,
    ) -> None:
        self._needs_answer = isinstance(plan, AnsweredPlan)
        self._accepts = accepts
        if self._needs_answer and accepts is not None:
            raise ValueError("accepts: an answered plan adopts its last control in any case")
        if isinstance(plan, AnsweredPlan):
            self.guarantee = (1.0 + _ANSWER_RESERVE) * plan.guarantee
            self._plan = plan.plan
            self.observer = observer_of(self._plan.problem, None)
        else:
            self.guarantee = plan.guarantee
            self._plan = plan
            self.observer = observer_of(plan.problem, max_facets)
        self.problem = self._plan.problem
        self.planned_at = -1
        self._window = window
        self._first = 0
        self._outputs = list[Floats]()
        self._applied = list[Floats]()

    @property
    def time(self) -> int:
        """The present period."""
        return len(self._applied)

    def measure(self, output: Floats, cuts: Cuts | None = None) -> None:
        """Cut the set by the output y(t), shape (q,), and adopt the plan of the rest if better."""
        self._outputs.append(output)
        if cuts is not None:
            self.observer.cut(*cuts)
        self.observer.update(output)
        if self.observer.estimate().is_empty:
            return

        # The problem of the kept plan begins in the period `_first`, not at t = 0.
        kept = self._plan.problem
        since = self.time - self._first
        for start in self._start_sets():
            self._adopt_if_better(_rest_of(kept, since, start))

    def _adopt_if_better(self, rest: OutputProblem) -> None:
        # The best control of a last period is computed without a solver if there is no path.
        is_answer = rest.periods == 1 and rest.path is None
        try:
            plan = last_answer(rest) if is_answer else plan_at_caps(rest, self._window)
        except (NoRobustPlanError, NoSolutionError):
            return
        # Without an answer, the last control of an answered plan does not exist.
        is_better = plan.guarantee < self.guarantee or (is_answer and self._needs_answer)
        if not is_better:
            return
        better = _with_smaller_caps(plan)
        if self._accepts is not None and not self._accepts(better, self.time):
            return
        self._plan = better
        self._first = self.time
        self.planned_at = self.time
        self.guarantee = better.guarantee
        self._needs_answer = False

    def control(self) -> Floats:
        """Return the control u(t), shape (m,), after the output; the next period begins."""
        # The kept plan knows only what came since its first period.
        measured = np.array(self._outputs[self._first :])
        applied = np.array(self._applied[self._first :])
        control = self._plan.control(measured, applied)
        self.observer.predict(control, disturbance=errors_of_step(self.problem, self.time, control))
        self._applied.append(control)
        return control

    def _start_sets(self) -> list[Polytope | Zonotope]:
        """Return sets that contain the set on board."""
        estimate = self.observer.estimate()
        if self.problem.states <= _MAX_POLYTOPE_STATES:
            return [estimate.polytopes[0]]

        starts = list[Polytope | Zonotope]()
        for rows in _bases(self.problem, self.time):
            lower, upper = estimate.output_hull(rows)
            columns = np.linalg.inv(rows)
            centre = columns @ (lower + upper) / 2.0
            # Generators are the columns, half as long as the strips are wide.
            starts.append(Zonotope(centre, (columns * (upper - lower) / 2.0).T))
        return starts


def guided_flight(
    plan: AffinePlan | AnsweredPlan,
    truth: TrueMotion,
    *,
    window: int | None = None,
    max_facets: int | None = MAX_FACETS,
    cuts: Callable[[], Cuts] | None = None,
) -> GuidedFlight:
    """Simulate a flight that is planned again after each output.

    The plan and the options are those of `GuidedCraft`. The true motion is moved; its errors must
    be within the bounds of the problem, or the promises do not hold. `cuts` returns half-spaces of
    the present states, such as `SightTruth.cuts`; it is called after each output.
    """
    craft = GuidedCraft(plan, window=window, max_facets=max_facets)
    guarantees = [craft.guarantee]
    controls = []
    lower = []
    upper = []
    planned_at = []
    is_reduced = False
    for _ in range(craft.problem.periods):
        craft.measure(truth.measured(), None if cuts is None else cuts())
        estimate = craft.observer.estimate()
        is_reduced = is_reduced or bool(estimate.reduced)
        lower.append(estimate.lower)
        upper.append(estimate.upper)
        guarantees.append(craft.guarantee)
        planned_at.append(craft.planned_at)

        control = craft.control()
        controls.append(control)
        truth.move(control)
    return GuidedFlight(
        np.array(guarantees),
        np.array(controls),
        np.array(lower),
        np.array(upper),
        np.array(planned_at),
        is_reduced,
    )


def _bases(problem: OutputProblem, time: int) -> list[Floats]:
    """Return normals of parallelotopes around a set of five or more states, shape (n, n) each.

    They are the goal carried back to the period, which makes the last answer exact, the states, and
    the outputs of this period and of the one before; those that are not regular are left out.
    """
    goal = problem.goal
    for t in range(problem.periods - 1, time - 1, -1):
        goal = goal @ problem.transition[t]
    candidates = [goal, np.eye(problem.states)]
    if time > 0:
        # Rows on the state before, as rows on the present state.
        before = problem.output[time - 1] @ np.linalg.inv(problem.transition[time - 1])
        candidates.append(np.vstack([problem.output[time], before]))
    bases = []
    for rows in candidates:
        if len(rows) == problem.states and np.linalg.matrix_rank(rows) == len(rows):
            bases.append(rows)
    return bases


def observer_of(problem: OutputProblem, max_facets: int | None = MAX_FACETS) -> LinearObserver:
    """Return an observer of the problem; the errors of a step are given with its control.

    Sets of up to four states have at most `max_facets` facets, if it is not None. Bounds of more
    states follow from all outputs: a flight has few.
    """
    noise = [Zonotope(np.zeros(len(matrix)), matrix.T) for matrix in problem.noise]
    return LinearObserver(
        problem.transition,
        problem.output,
        problem.start,
        noise=noise,
        input_matrix=problem.control,
        max_facets=max_facets,
        window=None,
    )


def errors_of_step(problem: OutputProblem, time: int, control: Floats) -> Zonotope:
    """Return the set of the effects of all errors in a period, whose control is known."""
    effects = problem.control[time] * execution_bounds(problem, control)
    if problem.disturbance is not None:
        effects = np.hstack([problem.disturbance[time], effects])
    acting = effects.any(axis=0)
    return Zonotope(np.zeros(problem.states), effects[:, acting].T)


def _rest_of(problem: OutputProblem, time: int, start: Polytope | Zonotope) -> OutputProblem:
    """Return the problem from a period on, whose output has cut the start."""
    output = problem.output[time:].copy()
    noise = problem.noise[time:].copy()
    output[0] = 0.0
    noise[0] = 0.0
    rest = replace(
        problem,
        transition=problem.transition[time:],
        control=problem.control[time:],
        output=output,
        noise=noise,
        start=start,
    )
    if problem.disturbance is not None:
        rest = replace(rest, disturbance=problem.disturbance[time:])
    if problem.control_limits is not None:
        rest = replace(rest, control_limits=problem.control_limits[time:])
    if problem.caps is not None:
        rest = replace(rest, caps=problem.caps[time:])
    if problem.path is not None:
        # No control changes the present state.
        acting = problem.path.controls.any(axis=1)
        remains = (problem.path.times > time) | ((problem.path.times == time) & acting)
        path = problem.path.chosen(remains)
        path = path._replace(times=path.times - time)
        rest = replace(rest, path=path if len(path.times) else None)
    return rest


def _with_smaller_caps(plan: AffinePlan) -> AffinePlan:
    """Return the plan, certified for errors proportional to its own largest controls."""
    if plan.problem.relative_error is None:
        return plan
    caps = (1.0 + _ROUNDING) * plan.control_ranges.largest
    return plan.under(replace(plan.problem, caps=caps))
