"""The rendezvous of the ARCH competition with bounded errors, and flights by a plain loop."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import linprog

from infoset.arrays import Floats
from infoset.geometry.zonotope import Zonotope
from infoset.rendezvous.reachability import AffinePlan, OutputProblem, impulsive
from infoset.rendezvous.relative_motion import ClohessyWiltshire

PLANE = [0, 1, 3, 4]
START = np.array([-900.0, -400.0, 0.0, 0.0])
START_ERROR = np.array([25.0, 25.0, 0.5, 0.5])
GOAL = np.diag([1.0, 1.0, 20.0, 20.0])
"""A box of 1 m and 0.05 m/min."""
ROUNDING = 1e-9
"""A flight of ten periods rounds its states by less than this."""


def arch(
    periods: int = 10, period_min: float = 10.0, limit: float = np.inf, noise_m: float = 3.0
) -> OutputProblem:
    """Planar motion in a geostationary orbit, in m and minutes; position is measured."""
    motion = ClohessyWiltshire(0.00876276 / 2.0)
    transition, control = impulsive(motion, periods, period_min)
    return OutputProblem(
        transition[:, PLANE][:, :, PLANE],
        control[:, PLANE][:, :, :2],
        np.repeat(np.eye(2, 4)[None], periods, axis=0),
        np.repeat(noise_m * np.eye(2)[None], periods, axis=0),
        Zonotope.box(START - START_ERROR, START + START_ERROR),
        GOAL,
        execution_error=np.full(2, 0.02),
        control_limits=np.full((periods, 2), limit),
    )


def fly(
    problem: OutputProblem,
    choose: Callable[[list[Floats], list[Floats]], Floats],
    start: Floats,
    execution: Floats,
    noise: Floats,
) -> tuple[Floats, Floats]:
    """Return the states and the controls of a flight.

    `start` has the shape (n,); `execution`, shape (T, m), are the execution errors in units of
    their bounds, and `noise`, shape (T, q), the measurement errors. `choose` gives a control for
    all outputs and all controls before.
    """
    assert problem.execution_error is not None
    relative = np.zeros(problem.controls)
    if problem.relative_error is not None:
        relative = problem.relative_error
    states = [start]
    outputs = list[Floats]()
    controls = list[Floats]()
    for t in range(problem.periods):
        outputs.append(problem.output[t] @ states[t] + noise[t])
        control = choose(outputs, controls)
        bound = problem.execution_error + relative * np.abs(control)
        acting = control + execution[t] * bound
        states.append(problem.transition[t] @ states[t] + problem.control[t] @ acting)
        controls.append(control)
    return np.array(states), np.array(controls)


def by_plan(plan: AffinePlan) -> Callable[[list[Floats], list[Floats]], Floats]:
    """The plan, as a choice of a control in `fly`."""
    return lambda outputs, controls: plan.control(np.array(outputs), np.array(controls))


def norms(problem: OutputProblem, states: Floats) -> float:
    return float(np.abs(problem.goal @ (states[-1] - problem.aim)).max())


def answer_by_programs(problem: OutputProblem, outputs: list[Floats], before: Floats) -> Floats:
    """Return the last control that is best for all states that agree with all outputs.

    The states without the last control are maximised by linear programs over the start, the
    execution errors and the measurement errors; another one minimises the largest of them.
    """
    periods = problem.periods
    predicted = [problem.centre]
    for t in range(periods):
        push = before[t] if t < periods - 1 else np.zeros(problem.controls)
        predicted.append(problem.transition[t] @ predicted[t] + problem.control[t] @ push)
    shown = np.concatenate([outputs[t] - problem.output[t] @ predicted[t] for t in range(periods)])

    equations = problem.pure_outputs.reshape(len(shown), -1)
    goal = np.vstack([problem.goal, -problem.goal])
    heights = []
    for row in goal:
        worst = linprog(
            -row @ problem.free_states[-1], A_eq=equations, b_eq=shown, bounds=(-1.0, 1.0)
        )
        assert worst.status == 0, worst.message
        heights.append(row @ predicted[-1] - worst.fun)

    rows = np.column_stack([goal @ problem.control[-1], -np.ones(len(goal))])
    bounds = [(-limit, limit) for limit in problem.limits[-1]]
    best = linprog(
        [0.0] * problem.controls + [1.0], rows, -np.array(heights), bounds=[*bounds, (None, None)]
    )
    return np.asarray(best.x[: problem.controls])


def corners(count: int, size: int, seed: int) -> Floats:
    return np.asarray(np.random.default_rng(seed).choice([-1.0, 1.0], (count, size)))
