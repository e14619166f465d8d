"""The affine plan with the smallest guarantee (Theorem 1 of `docs/guaranteed-rendezvous.md`)."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from infoset.rendezvous._arrays import Flags, Floats, Places
from infoset.rendezvous.reachability.conic import NoSolutionError
from infoset.rendezvous.reachability.outputs import AffinePlan, OutputProblem, PathRows, Ranges
from infoset.rendezvous.reachability.sparse_program import (
    Affine,
    InfeasibleProgramError,
    Maxima,
    SparseProgram,
    Term,
    variable_sum,
)

_SPARES = (1e-7, 1e-6, 1e-5)
"""Margins of the constraints in the program, relative to their sizes, tried in turn: the solver's
errors must not break a constraint. The first one is ten times the usual error. A margin makes the
guarantee larger, so larger ones come later: reserves, chosen."""
MAX_ROUNDS = 12
"""Maximum number of rounds of a local search: of caps, normals or lines of sight. Most end after
three to five."""
MIN_GAIN = 1e-3
"""Relative decrease of the guarantee in a round below which a local search ends. Chosen."""
_MAX_CAP_HALVINGS = 8
"""Maximum number of halvings of the first caps: down to 0.4 % of the limits. Chosen."""


class NoRobustPlanError(ValueError):
    """No plan with affine feedback satisfies the constraints for all errors."""


class RowVariables(NamedTuple):
    """A row: its value without errors, (1,), and its dependence on the errors, (size,)."""

    middle: Affine
    errors: Affine


class PlanVariables:
    """The variables of an affine plan in a program.

    `nominal`, shape (T, m), and `gains`, shape (T, T, m, q), are columns of the program; those of
    zeros are -1. A `window` is the number of the last outputs that a control depends on, and all of
    them if None. Controls from the time `end` on are zero.
    """

    def __init__(
        self, program: SparseProgram, problem: OutputProblem, window: int | None, end: int
    ) -> None:
        self.problem = problem
        self._program = program
        self.nominal = np.full((problem.periods, problem.controls), -1)
        self.nominal[:end] = program.variables(end, problem.controls)
        outputs = problem.pure_outputs.shape[1]
        self.gains = np.full((problem.periods, *self.nominal.shape, outputs), -1)
        varies = np.asarray(problem.pure_outputs.any(axis=(1, 2)))
        for t in range(end):
            first = 0 if window is None else max(0, t - window + 1)
            for s in range(first, t + 1):
                # An output that no error changes would leave its gains undetermined.
                if varies[s]:
                    self.gains[t, s] = program.variables(problem.controls, outputs)

    def row(self, time: int, state: Floats, control: Floats) -> RowVariables:
        """Return state . x(time) + control . u(time) as functions of the variables."""
        problem = self.problem
        effects = np.zeros((problem.periods, problem.controls))
        # Controls before the time act through the state, and u(time) itself; at the end is none.
        effects[:time] = problem.effects_on(time, state)
        if time < problem.periods:
            effects[time] = control
        acting = np.flatnonzero((self.nominal[:, 0] >= 0) & effects.any(axis=1))

        middle = Affine(np.array([state @ problem.coasting[time]]))
        if len(acting):
            columns = self.nominal[acting].ravel()
            middle = middle.plus(variable_sum(columns, effects[acting].reshape(1, -1)))
        errors = Affine(state @ problem.free_states[time])
        for s in range(problem.periods):
            response = self._response(s, effects)
            if response is not None:
                through_output = problem.pure_outputs[s].T @ response.matrix
                errors = errors.plus(variable_sum(response.columns, through_output))
        return RowVariables(middle, errors)

    def _response(self, s: int, effects: Floats) -> Term | None:
        """Return the effect of p(s), shape (q,), through controls with `effects`, shape (T, m).

        It is None if no control with an effect depends on p(s). The effect of several controls is
        a new variable, so that the rows of the errors are sparse.
        """
        reacts = (self.gains[:, s] >= 0).any(axis=(1, 2))
        reacting = np.flatnonzero(reacts & effects.any(axis=1))
        if not len(reacting):
            return None
        count = self.gains.shape[3]
        columns = self.gains[reacting, s].reshape(-1, count)
        weights = effects[reacting].ravel()
        matrix = np.zeros((count, columns.size))
        for output in range(count):
            # Columns are ordered by control, and then by output.
            matrix[output, output::count] = weights
        if len(reacting) == 1:
            return Term(columns.ravel(), matrix)

        sums = self._program.variables(count)
        total = variable_sum(columns.ravel(), matrix)
        self._program.meet(total.plus(variable_sum(sums, -np.eye(count))))
        return Term(sums, np.eye(count))

    def keep_rows(self, rows: PathRows, spares: Floats) -> None:
        """Add constraints, tightened by `spares`, shape (k,), in their units."""
        for k in range(len(rows.times)):
            middle, errors = self.row(int(rows.times[k]), rows.states[k], rows.controls[k])
            maxima = self._program.maxima(self.problem.errors, errors)
            self.keep_between(
                middle, maxima, float(rows.lower[k] + spares[k]), float(rows.upper[k] - spares[k])
            )

    def keep_between(self, middle: Affine, maxima: Maxima, lower: float, upper: float) -> None:
        """Add lower <= middle + errors <= upper, where an end is finite."""
        if np.isfinite(upper):
            self._program.keep(middle.plus(maxima.above).plus(Affine(np.array([-upper]))))
        if np.isfinite(lower):
            under = middle.times(-1.0).plus(maxima.below)
            self._program.keep(under.plus(Affine(np.array([lower]))))

    def plan(self, point: Floats) -> AffinePlan:
        """Return the plan at a point of the program."""
        values = np.concatenate([point, np.zeros(1)])
        # Columns of -1 are zeros.
        return AffinePlan(self.problem, values[self.nominal], values[self.gains])


class PlanWithRows(NamedTuple):
    """A plan, and which constraints of the path its program had, shape (k,)."""

    plan: AffinePlan
    entered: Flags


def affine_plan(problem: OutputProblem, window: int | None = None) -> AffinePlan:
    """Return the affine plan with the smallest certified guarantee.

    A `window` of w outputs makes the program sparser: u(t) depends on p(t - w + 1), ..., p(t).
    Without it the plan is optimal among all affine output feedbacks. Without constraints, a window
    of ceil(n / m) loses nothing if these many consecutive controls move the state in all
    directions.

    Errors proportional to the controls are bounded at caps of the controls, which are constraints.
    The first caps are the limits, or the largest of their halves, quarters, ... that have a plan;
    then the certified maxima of the controls are the caps of the next program, until the guarantee
    stays. The guarantee holds in every round and does not increase, but the caps may be a local
    optimum.

    Constraints of the path enter the program when they are broken.

    Raises
    ------
    NoRobustPlanError
        If no affine plan satisfies the constraints for all errors; with errors proportional to the
        controls, if none was found.
    ValueError
        If errors are proportional to controls without limits.
    NoSolutionError
        If the program was not solved.
    """
    return best_with_rows(problem, window, no_rows(problem)).plan


def best_with_rows(problem: OutputProblem, window: int | None, known: Flags) -> PlanWithRows:
    """Return the plan of `affine_plan`; `known` constraints are in its program at first.

    The flags, shape (k,), are those of `plan_with_rows`.

    Raises
    ------
    ValueError, NoRobustPlanError, NoSolutionError
        As `affine_plan`.
    """
    if problem.relative_error is None:
        return plan_with_rows(problem, window, known)
    if not np.isfinite(problem.limits).all():
        raise ValueError("errors proportional to the controls need limits of all controls")

    found = _with_first_caps(problem, window, known)
    # The plan at the first caps was the first round.
    for _ in range(MAX_ROUNDS - 1):
        smaller = replace(problem, caps=found.plan.control_ranges.largest)
        try:
            better = plan_with_rows(smaller, window, found.entered)
        except (NoRobustPlanError, NoSolutionError):
            # Only the margin for the solver's errors can be missing.
            return found
        gain = found.plan.guarantee - better.plan.guarantee
        if gain <= 0.0:
            return found
        found = better
        if gain <= MIN_GAIN * found.plan.guarantee:
            return found
    return found


def _with_first_caps(problem: OutputProblem, window: int | None, known: Flags) -> PlanWithRows:
    """Return the plan at the largest caps, the limits or a power of 1/2 of them, that have one.

    Smaller caps leave less room for the controls, but also smaller errors.
    """
    limits = problem.limits
    try:
        return plan_with_rows(replace(problem, caps=limits), window, known)
    except NoRobustPlanError:
        # Without a plan for smaller errors there is none at any caps.
        plan_with_rows(replace(problem, relative_error=None), window, known)

    for halvings in range(1, _MAX_CAP_HALVINGS + 1):
        try:
            return plan_with_rows(replace(problem, caps=0.5**halvings * limits), window, known)
        except NoRobustPlanError:
            continue
    raise NoRobustPlanError(
        "no plan with affine feedback was found that keeps the constraints for all errors; reduce "
        "the errors, those proportional to the controls first, or relax the limits"
    )


def plan_at_caps(
    problem: OutputProblem, window: int | None, *, sum_of_rows: bool = False
) -> AffinePlan:
    """Return the affine plan with the smallest guarantee at the caps of the problem.

    The arguments and the errors are those of `plan_with_rows`.
    """
    return plan_with_rows(problem, window, no_rows(problem), sum_of_rows=sum_of_rows).plan


def no_rows(problem: OutputProblem) -> Flags:
    """Return flags of the constraints of the path, shape (k,), none of which is chosen."""
    count = 0 if problem.path is None else len(problem.path.times)
    return np.zeros(count, dtype=bool)


def plan_with_rows(
    problem: OutputProblem, window: int | None, known: Flags, *, sum_of_rows: bool = False
) -> PlanWithRows:
    """Return the affine plan with the smallest guarantee at the caps of the problem.

    The limits and the constraints of the path that are `known`, shape (k,), are in the program at
    first; the others enter when they are broken. With `sum_of_rows` the plan minimises the sum of
    the maxima of the rows of the goal in place of the largest one.

    Raises
    ------
    NoRobustPlanError
        If no affine plan satisfies the constraints for all errors.
    NoSolutionError
        If the program was not solved.
    """
    rows = problem.rows
    limits = len(rows.times) - len(known)
    # The limits of single controls come first, and are all in the program.
    entered = ~problem.is_on_path
    entered[limits:] |= known
    for spare in _SPARES:
        while True:
            plan = _plan_with(problem, window, entered, spare, sum_of_rows)
            broken = is_broken(plan.row_ranges, rows)
            if not broken.any():
                return PlanWithRows(plan, entered[limits:])
            if not (broken & ~entered).any():
                break
            entered = entered | broken
    raise NoSolutionError("the solver's plan breaks constraints, also with a margin of 1e-5")


def is_broken(ranges: Ranges, rows: PathRows) -> Flags:
    """Return which of the rows their ranges violate, shape (k,)."""
    return np.asarray((ranges.upper > rows.upper) | (ranges.lower < rows.lower))


def _plan_with(
    problem: OutputProblem, window: int | None, entered: Flags, spare: float, sum_of_rows: bool
) -> AffinePlan:
    """Return the plan with the smallest guarantee that keeps some of the rows."""
    program = SparseProgram()
    plan = PlanVariables(program, problem, window, problem.periods)
    maxima = program.variables(len(problem.goal) if sum_of_rows else 1)
    keep_goal(program, plan, problem, maxima)
    rows = problem.rows.chosen(entered)
    plan.keep_rows(rows, spare * row_sizes(problem, rows))
    try:
        return plan.plan(program.minimise(variable_sum(maxima, np.ones((1, len(maxima))))))
    except InfeasibleProgramError as error:
        raise NoRobustPlanError(
            "no plan with affine feedback keeps the constraints for all errors; reduce the errors, "
            "or relax the limits"
        ) from error


def keep_goal(
    program: SparseProgram, plan: PlanVariables, problem: OutputProblem, guarantees: Places
) -> None:
    """Add |goal_i . (x(T) - target)| <= guarantees for all errors, one for all rows or for each."""
    no_control = np.zeros(problem.controls)
    # One column is repeated for all rows.
    columns = np.broadcast_to(guarantees, len(problem.goal))
    for row, column in zip(problem.goal, columns, strict=True):
        less_guarantee = variable_sum(np.array([column]), -np.ones((1, 1)))
        middle, errors = plan.row(problem.periods, row, no_control)
        middle = middle.plus(Affine(np.array([-row @ problem.aim])))
        maxima = program.maxima(problem.errors, errors)
        program.keep(middle.plus(maxima.above).plus(less_guarantee))
        program.keep(middle.times(-1.0).plus(maxima.below).plus(less_guarantee))


def row_sizes(problem: OutputProblem, rows: PathRows) -> Floats:
    """Return the sizes to which margins of rows are relative, shape (k,): of ends and states."""
    resting = AffinePlan(
        problem,
        np.zeros((problem.periods, problem.controls)),
        np.zeros((problem.periods, problem.periods, problem.controls, problem.output.shape[1])),
    )
    sizes = np.zeros(len(rows.times))
    for end in (rows.lower, rows.upper):
        sizes = np.maximum(sizes, np.where(np.isfinite(end), np.abs(end), 0.0))
    return np.maximum(sizes, resting.ranges_of(rows).largest)
