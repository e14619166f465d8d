"""A rendezvous with bounded errors: its problem of `docs/guaranteed-rendezvous.md`, and flights."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from infoset.geometry.zonotope import Zonotope
from infoset.rendezvous._arrays import Flags, Floats
from infoset.rendezvous.reachability.line_of_sight import SightSensor
from infoset.rendezvous.reachability.norm_limit import with_norm_limit
from infoset.rendezvous.reachability.outputs import AffinePlan, OutputProblem, PathRows
from infoset.rendezvous.reachability.problem import ReachabilityProblem, ThrustShape


@dataclass(frozen=True, eq=False)
class ErrorBounds:
    """Half-widths of the errors of a rendezvous, in the units of its states and controls.

    Parameters
    ----------
    start : ndarray, shape (n,)
        Of the state at t = 0.
    execution : ndarray, shape (m,)
        Of a control, whatever it is.
    relative : ndarray, shape (m,)
        The part of a control's absolute value that is added to `execution`.
    measured : ndarray, shape (q,)
        Of the first q components of the state, which are measured at t = 0, ..., T - 1.
    disturbance : ndarray, shape (T, n, p), or None
        Effects of unit components of an unknown acceleration in a period.
    sight : SightSensor or None
        The sensor of directions and ranges, in place of `measured`.
    """

    start: Floats
    execution: Floats
    relative: Floats
    measured: Floats
    disturbance: Floats | None = None
    sight: SightSensor | None = None


def with_errors(
    problem: ReachabilityProblem, errors: ErrorBounds, target: Floats, box: Floats
) -> OutputProblem:
    """Return a rendezvous with bounded errors.

    The norm of the goal is that of a `box` of half-widths, shape (n,), about the state `target`; a
    component whose half-width is infinite does not count. All constraints hold for all errors.
    Thrust in a ball is limited by the faces of a polytope inside it (`norm_faces`).
    """
    periods = problem.periods
    measured = len(errors.measured)
    has_noise = errors.measured > 0.0
    is_goal = np.isfinite(box)
    largest = errors.execution + errors.relative * problem.control_bounds
    start = np.diag(errors.start)
    whole = OutputProblem(
        problem.transition,
        problem.control,
        np.repeat(np.eye(measured, problem.states)[None], periods, axis=0),
        np.repeat(np.diag(errors.measured)[:, has_noise][None], periods, axis=0),
        Zonotope(problem.initial, start[errors.start > 0.0]),
        np.diag(1.0 / box)[is_goal],
        target,
        errors.disturbance,
        errors.execution,
        errors.relative if errors.relative.any() else None,
        np.tile(problem.control_bounds, (periods, 1)),
        constraint_rows(problem, largest),
    )
    if problem.thrust is ThrustShape.BALL:
        return with_norm_limit(whole, float(problem.control_bounds[0]))
    return whole


def constraint_rows(problem: ReachabilityProblem, execution: Floats) -> PathRows:
    """Return the constraints after the start, before and after impulses and between periods.

    States after a control have its error too, at most `execution`, shape (m,): the ends of their
    constraints are less by its effect.
    """
    normals, offsets = problem.further
    rows = np.vstack([np.eye(problem.states), normals])
    endless = np.full(len(normals), -np.inf)
    lower = np.concatenate([-problem.state_bounds, endless])
    blocks: list[PathRows] = []

    still = np.zeros((len(rows), problem.controls))

    def add(time: int, states: Floats, controls: Floats) -> None:
        """Add constraints of a time on a state that follows from x(time) and u(time)."""
        upper = np.concatenate([problem.state_bounds, offsets[time]])
        push = np.abs(controls) @ execution
        ends = (lower + push, upper - push)
        blocks.append(PathRows(np.full(len(states), time), states, controls, *ends))

    for t in range(problem.periods):
        if problem.jump is not None:
            add(t, rows, rows @ problem.jump)
        if problem.between is not None:
            for matrix in problem.between[t]:
                inner = rows @ matrix
                add(t, inner[:, : problem.states], inner[:, problem.states :])
        blocks.append(_control_rows(problem, t))
        add(t + 1, rows, still)
    every = PathRows(*(np.concatenate(parts) for parts in zip(*blocks, strict=True)))

    # The start does not follow from a plan.
    follows = (every.times > 0) | every.controls.any(axis=1)
    return every.chosen(follows & (np.isfinite(every.lower) | np.isfinite(every.upper)))


def _control_rows(problem: ReachabilityProblem, time: int) -> PathRows:
    """Return the limits on a control beyond its bounds; they limit commands, without errors."""
    normals, offsets = problem.limits
    count = len(normals)
    return PathRows(
        np.full(count, time),
        np.zeros((count, problem.states)),
        normals,
        np.full(count, -np.inf),
        offsets[time],
    )


class PlanFlights(NamedTuple):
    """Simulated flights of an affine plan.

    `distances`, shape (N,), are |x(T) - target| in the norm of the goal. `outside` is the number of
    flights that exceed the guarantee or break a constraint by more than rounding.
    """

    distances: Floats
    outside: int


_ROUNDING = 1e-9
"""Part of a guarantee and of the end of a constraint up to which flights may exceed them: states of
a flight are sums of terms that are up to 1e5 times their result, each rounded to 1e-16."""


def fly_plan(
    problem: ReachabilityProblem, plan: AffinePlan, errors: ErrorBounds, flights: int, seed: int
) -> PlanFlights:
    """Simulate flights: in one half errors are uniform, in the other half at their bounds.

    The loop uses the matrices of the motion and the measurements only; directions and ranges are
    those of the true positions, without linearisation. Errors proportional to a
    control are those of the control that is commanded.
    """
    generator = np.random.default_rng(seed)
    extreme = np.arange(flights) % 2 == 1

    def drawn(bounds: Floats) -> Floats:
        values = generator.uniform(-1.0, 1.0, (flights, len(bounds)))
        values[extreme] = np.sign(values[extreme])
        return np.asarray(values * bounds)

    def measured(output: Floats, states: Floats) -> Floats:
        """Return the outputs with errors, shape (N, q), for the matrix of the outputs."""
        if errors.sight is None or not len(output):
            return np.asarray(states @ output.T + drawn(errors.measured))
        size = len(output)
        directions, ranges = errors.sight.simulated(states[:, :size], generator, extreme)
        return np.asarray((ranges[:, None] * directions) @ output[:, :size].T)

    states = problem.initial + drawn(errors.start)
    predicted = np.tile(problem.initial, (flights, 1))
    shown = np.zeros((problem.periods, flights, plan.problem.output.shape[1]))
    broken = np.zeros(flights, dtype=bool)
    for t in range(problem.periods):
        output = plan.problem.output[t]
        shown[t] = measured(output, states) - predicted @ output.T
        control = plan.nominal[t] + np.einsum("sjq,sfq->fj", plan.gains[t], shown)
        acting = control + drawn(np.ones(problem.controls)) * (
            errors.execution + errors.relative * np.abs(control)
        )
        broken |= _breaks(problem, t, states, control, acting)
        predicted = predicted @ problem.transition[t].T + control @ problem.control[t].T
        states = states @ problem.transition[t].T + acting @ problem.control[t].T
        if errors.disturbance is not None:
            pushes = drawn(np.ones(errors.disturbance.shape[2]))
            states = states + pushes @ errors.disturbance[t].T
    broken |= _exceeds(problem, problem.periods, states)

    goal = plan.problem.goal
    distances = np.abs((states - plan.problem.aim) @ goal.T).max(axis=1)
    broken |= distances > plan.guarantee * (1.0 + _ROUNDING)
    return PlanFlights(distances, int(broken.sum()))


def _breaks(
    problem: ReachabilityProblem, time: int, states: Floats, control: Floats, acting: Floats
) -> Flags:
    """Return which flights, (N,), break a constraint before, at or after a control.

    `acting`, shape (N, m), is the `control` with its error.
    """
    normals, offsets = problem.limits
    slack = _ROUNDING * (np.abs(normals) @ problem.control_bounds)
    broken = (np.abs(control) > problem.control_bounds * (1.0 + _ROUNDING)).any(axis=1)
    broken |= (control @ normals.T > offsets[time] + slack).any(axis=1)
    if problem.thrust is ThrustShape.BALL:
        norms = np.linalg.norm(control, axis=1)
        broken |= norms > problem.control_bounds[0] * (1.0 + _ROUNDING)
    broken |= _exceeds(problem, time, states)
    if problem.jump is not None:
        broken |= _exceeds(problem, time, states + acting @ problem.jump.T)
    if problem.between is not None:
        both = np.hstack([states, acting])
        for matrix in problem.between[time]:
            broken |= _exceeds(problem, time, both @ matrix.T)
    return np.asarray(broken)


def _exceeds(problem: ReachabilityProblem, time: int, states: Floats) -> Flags:
    """Return which states, (N,), break a constraint of a time."""
    normals, offsets = problem.further
    slack = _ROUNDING * (np.abs(normals) @ problem.state_bounds)
    beyond = (np.abs(states) > problem.state_bounds * (1.0 + _ROUNDING)).any(axis=1)
    return np.asarray(beyond | (states @ normals.T > offsets[time] + slack).any(axis=1))
