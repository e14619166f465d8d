"""Constraints on states at all times between impulses, not only at the impulses.

The section "Between impulses" of `docs/guaranteed-rendezvous.md`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from infoset.rendezvous._arrays import Flags, Floats
from infoset.rendezvous.reachability.answer import (
    AnsweredPlan,
    LateConstraintError,
    answered_plan,
)
from infoset.rendezvous.reachability.coasting import Coasting, CoastTube
from infoset.rendezvous.reachability.conic import NoSolutionError
from infoset.rendezvous.reachability.independent_parts import independent_parts, plan_of_parts
from infoset.rendezvous.reachability.motion import IMPULSE
from infoset.rendezvous.reachability.outputs import (
    AffinePlan,
    ErrorSet,
    OutputProblem,
    PathRows,
    joined,
)

_MAX_CHECKS = 40
"""Maximum number of programs: each one has more rows, or larger allowances. Most plans need two.
Chosen."""


@dataclass(frozen=True, eq=False)
class PathLimits:
    """Constraints normals . x <= offsets(t) at all times of each period t, after its impulse.

    Parameters
    ----------
    flight : Coasting
        The coast of one period after each of the T impulses, divided into N intervals.
    normals : ndarray, shape (k, 6)
        Normals, for states in m and m/s.
    offsets : ndarray, shape (T, k)
        Offsets, in m or m/s as normals . x; infinite in periods without the constraint.
    """

    flight: Coasting
    normals: Floats
    offsets: Floats

    def excess(self, tube: CoastTube) -> Floats:
        """Return upper bounds of the violations in each interval, shape (T, N, k)."""
        ends = tube.maxima(self.normals)
        highest = np.maximum(ends[:, :-1], ends[:, 1:]) + tube.overshoots(self.normals)
        return np.asarray(highest - self.offsets[:, None, :])

    def allowances(self, tube: CoastTube) -> Floats:
        """Return what the constraints on x(t) and u(t) are less than the offsets.

        It is the effect of the execution errors and the accelerations at both ends of each
        interval, and what a state between the ends may exceed them; shape (T, N, k, 2).
        """
        ends = tube.uncontrolled(self.normals)
        both = np.stack([ends[:, :-1], ends[:, 1:]], axis=-1)
        return np.asarray(both + tube.overshoots(self.normals)[..., None])

    def rows(self, entered: Flags, allowances: Floats) -> PathRows:
        """Return the constraints of x(t) and u(t) at both ends of some intervals.

        `entered` has the shape (T, N, k), and `allowances` (T, N, k, 2).
        """
        times, intervals, numbers = np.nonzero(entered)
        chosen = self.normals[numbers]
        transitions = self.flight.transitions
        begin = np.einsum("rn,rnm->rm", chosen, transitions[times, intervals])
        end = np.einsum("rn,rnm->rm", chosen, transitions[times, intervals + 1])
        states = np.concatenate([begin, end])
        less = allowances[times, intervals, numbers].T.ravel()
        upper = np.tile(self.offsets[times, numbers], 2) - less
        return PathRows(
            np.concatenate([times, times]),
            states,
            states @ IMPULSE,
            np.full(len(states), -np.inf),
            upper,
        )


class _Rows:
    """The constraints that programs had so far, and their largest allowances."""

    def __init__(self, limits: PathLimits, problem: OutputProblem) -> None:
        self._limits = limits
        self._problem = problem
        shape = (*limits.flight.starts_s.shape, len(limits.normals))
        self._entered = np.zeros(shape, dtype=bool)
        self._allowances = np.zeros((*shape, 2))

    def problem_with_broken(self, tube: CoastTube, excess: Floats) -> OutputProblem:
        """Return the problem with the constraints that were broken before, and those of a plan.

        Of each constraint and period the most broken interval enters; it stays for later plans.
        """
        worst = excess.argmax(axis=1)[:, None, :]
        broken = np.take_along_axis(excess, worst, axis=1) > 0.0
        entered = np.take_along_axis(self._entered, worst, axis=1)
        np.put_along_axis(self._entered, worst, entered | broken, axis=1)
        self._allowances = np.maximum(self._allowances, self._limits.allowances(tube))
        rows = self._limits.rows(self._entered, self._allowances)
        return replace(self._problem, path=joined(self._problem.path, rows))


def plan_within(
    problem: OutputProblem, limits: PathLimits, solve: Callable[[OutputProblem], AffinePlan]
) -> AffinePlan:
    """Return a plan that keeps constraints at all times between impulses, by its certificate.

    The problem has states in m and m/s in Hill's axes and impulses in m/s at the starts of the
    periods. `solve` returns a plan for a problem with further constraints of the path.

    Raises
    ------
    NoSolutionError
        If the plans of 40 programs break a constraint.
    ValueError
        If the intervals of the flight are too long for a bound between their ends.
    UnboundedCoastError
        If nonlinear motion is not proved to stay within any distance.
    NoRobustPlanError
        As `solve`.
    """
    rows = _Rows(limits, problem)
    plan = solve(problem)
    for _ in range(_MAX_CHECKS):
        tube = limits.flight.tube(plan)
        excess = limits.excess(tube)
        if (excess <= 0.0).all():
            return plan
        plan = solve(rows.problem_with_broken(tube, excess))
    raise NoSolutionError("the plans break constraints between impulses")


def answers_within(
    problem: OutputProblem, limits: PathLimits | None, window: int | None
) -> list[AnsweredPlan]:
    """Return the answered plans of the independent parts of a problem.

    With `limits` they keep the constraints at all times; those of the last period must follow from
    the limits of the last control, or from the guarantee. The problem and the window are those of
    `answered_plan`.

    Raises
    ------
    LateConstraintError
        If a constraint of the last period does not follow.
    NoSolutionError, NoRobustPlanError
        As `answered_plan`.
    """
    whole = problem
    rows = None if limits is None else _Rows(limits, problem)
    for _ in range(_MAX_CHECKS):
        parts = independent_parts(whole)
        answers = [answered_plan(part.problem, window) for part in parts]
        # Both are None, or none of them.
        if limits is None or rows is None:
            return answers
        pairs = zip(parts, answers, strict=True)
        plan = plan_of_parts(whole, [(part, answer.plan) for part, answer in pairs])
        tube = limits.flight.tube(_with_free_end(plan))
        excess = limits.excess(tube)
        last = excess[-1].copy()
        # The last period is not in the programs: its constraints must follow, as is checked below.
        excess[-1] = -np.inf
        if (excess > 0.0).any():
            whole = rows.problem_with_broken(tube, excess)
            continue

        guarantee = max((answer.guarantee for answer in answers), default=0.0)
        backward = _from_end(tube, whole, guarantee)
        if backward is not None:
            last = np.minimum(last, limits.excess(backward)[-1])
        if (last <= 0.0).all():
            return answers
        raise LateConstraintError
    raise NoSolutionError("the plans break constraints between impulses")


def _with_free_end(plan: AffinePlan) -> AffinePlan:
    """Return a plan without a last control, whose last execution error is any control."""
    problem = plan.problem
    # These bounds contain the errors at the caps, which are left out below.
    execution = problem.execution.copy()
    execution[-1] += problem.limits[-1]
    return plan.under(replace(problem, execution_error=execution, relative_error=None, caps=None))


def _from_end(tube: CoastTube, problem: OutputProblem, guarantee: float) -> CoastTube | None:
    """Return the states of the last period whose motion ends within a guarantee.

    The sets of the other periods are the origin. None unless the goal is a regular matrix: only
    then a guarantee bounds all states.
    """
    size = problem.states
    if np.linalg.matrix_rank(problem.goal) < size or len(problem.goal) > size:
        return None
    middles = np.zeros_like(tube.middles)
    columns = np.zeros((*tube.middles.shape, size))
    shapes = np.zeros_like(tube.shapes)
    middles[-1, -1] = problem.aim
    columns[-1, -1] = guarantee * np.linalg.inv(problem.goal)

    steps = tube.coasting.segments
    h = tube.coasting.interval_s
    integral = 0.0
    shape = np.zeros((size, size))
    for i in range(steps.transition.shape[1] - 1, -1, -1):
        back = np.linalg.inv(steps.transition[-1, i])
        acceleration = tube.accelerations[-1, i]
        integral += acceleration * h
        # As in `Coasting.tube_under`, backward in time.
        shape = back @ (shape + acceleration * steps.gramian[-1, i]) @ back.T
        middles[-1, i] = back @ middles[-1, i + 1]
        columns[-1, i] = back @ columns[-1, i + 1]
        shapes[-1, i] = integral * shape
    errors = ErrorSet(size, None, np.zeros((0, 0)), np.zeros(0))
    return CoastTube(tube.coasting, errors, middles, columns, shapes, tube.accelerations)
