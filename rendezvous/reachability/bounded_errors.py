"""A rendezvous with bounded errors: its problem of `docs/guaranteed-rendezvous.md`."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from infoset.geometry.zonotope import Zonotope
from infoset.rendezvous._arrays import Floats, Places
from infoset.rendezvous.reachability.line_of_sight import SightSensor
from infoset.rendezvous.reachability.norm_limit import acting_controls, with_norm_limit
from infoset.rendezvous.reachability.outputs import OutputProblem, PathRows, joined
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
        Of the first q components of the state, which are measured at t = 0, ..., T - 1; 0 for exact
        measurements, and q = 0 for none.
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
    problem: ReachabilityProblem,
    errors: ErrorBounds,
    target: Floats,
    box: Floats,
    *,
    all_act: bool = False,
    at_instants: bool = True,
) -> OutputProblem:
    """Return a rendezvous with bounded errors.

    The norm of the goal is that of a `box` of half-widths, shape (n,), about the state `target`; a
    component whose half-width is infinite does not count. All constraints hold for all errors.
    Thrust in a ball is limited by the faces of a polytope inside it (`norm_faces`), in the plane of
    the controls that act in this problem. `all_act` is needed if a plan may use the others too: if
    errors or constraints are added later, or the independent parts are not planned apart.
    `at_instants` is for `constraint_rows`.
    """
    periods = problem.periods
    output = np.eye(len(errors.measured), problem.states)
    noise = np.diag(errors.measured)[:, errors.measured > 0.0]
    if errors.sight is not None:
        # An affine plan has outputs along its own lines of sight, or one that is zero.
        output = np.zeros((1, problem.states))
        noise = np.zeros((1, 0))
    is_goal = np.isfinite(box)
    largest = errors.execution + errors.relative * problem.control_bounds
    start = np.diag(errors.start)
    whole = OutputProblem(
        problem.transition,
        problem.control,
        np.repeat(output[None], periods, axis=0),
        np.repeat(noise[None], periods, axis=0),
        Zonotope(problem.initial, start[errors.start > 0.0]),
        np.diag(1.0 / box)[is_goal],
        target,
        errors.disturbance,
        errors.execution,
        errors.relative if errors.relative.any() else None,
        np.tile(problem.control_bounds, (periods, 1)),
        constraint_rows(problem, largest, at_instants=at_instants),
    )
    if problem.thrust is ThrustShape.BALL:
        # All bounds of a ball are equal.
        acting = np.arange(problem.controls) if all_act else _acting(whole, problem.further[0])
        return with_norm_limit(whole, float(problem.control_bounds[0]), acting)
    return whole


def _acting(whole: OutputProblem, normals: Floats) -> Places:
    """Return the controls that a plan may use, also if it keeps constraints at all times.

    Constraints with these `normals`, shape (k, n), couple their states between impulses even if
    `whole` has no row of them, as in the first period.
    """
    endless = np.full(len(normals), np.inf)
    times = np.zeros(len(normals), dtype=np.int64)
    still = np.zeros((len(normals), whole.controls))
    coupled = PathRows(times, normals, still, -endless, endless)
    return acting_controls(replace(whole, path=joined(whole.path, coupled)))


def constraint_rows(
    problem: ReachabilityProblem, execution: Floats, *, at_instants: bool = True
) -> PathRows:
    """Return the constraints after the start, before and after impulses and between periods.

    States after a control have its error too, at most `execution`, shape (m,): the ends of their
    constraints are less by its effect. Without `at_instants` there are none on states after an
    impulse and between periods: `plan_within` keeps them at all times, with smaller errors if these
    are proportional to the controls.
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
        if problem.jump is not None and at_instants:
            add(t, rows, rows @ problem.jump)
        if problem.between is not None and at_instants:
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
