"""Independent parts of a problem with bounded errors, as the plane of an orbit and its normal.

If the norm of the goal is a maximum over parts that share no error, no control and no constraint,
the best guarantee of the whole is the largest one of the parts: a strategy may use the strategies
of the parts, and the errors of one part show nothing about another one. The programs of parts are
smaller, and each part has its guarantee.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from infoset.geometry.zonotope import Zonotope
from infoset.rendezvous._arrays import Flags, Floats, Places
from infoset.rendezvous.reachability.outputs import AffinePlan, OutputProblem


class ProblemPart(NamedTuple):
    """A part, with the indices of its states, controls and outputs in the whole problem."""

    problem: OutputProblem
    states: Places
    controls: Places
    outputs: Places


def independent_parts(problem: OutputProblem) -> tuple[ProblemPart, ...]:
    """Return the smallest independent parts of a problem, in the order of their first states.

    Parts that rest are left out: no error acts on them, and they are at their target. A problem
    whose start is a polytope is one part.
    """
    if not isinstance(problem.start, Zonotope):
        return (whole_problem(problem),)

    # A graph of states, controls and outputs: those that act together in a row or in an error.
    n = problem.states
    m = problem.controls
    size = n + m + problem.output.shape[1]
    linked = np.zeros((size, size), dtype=bool)
    for group in _groups(problem):
        acting = np.flatnonzero(group)
        # The first member of a group is linked to all others.
        linked[acting[:1], acting] = True
    # The labels of states come first, then those of controls and of outputs.
    labels = connected_components(csr_array(linked), directed=False)[1]

    parts = []
    for label in dict.fromkeys(labels[:n].tolist()):
        states = np.flatnonzero(labels[:n] == label)
        controls = np.flatnonzero(labels[n : n + m] == label)
        outputs = np.flatnonzero(labels[n + m :] == label)
        part = _part(problem, states, controls, outputs)
        if not _rests(part):
            parts.append(ProblemPart(part, states, controls, outputs))
    return tuple(parts)


def whole_problem(problem: OutputProblem) -> ProblemPart:
    """Return a problem as its only part."""
    outputs = np.arange(problem.output.shape[1])
    states = np.arange(problem.states)
    return ProblemPart(problem, states, np.arange(problem.controls), outputs)


def _groups(problem: OutputProblem) -> Flags:
    """Return which states, controls and outputs act together, shape (k, n + m + q)."""
    # Row i: what acts on state i in some period, and the state itself.
    motion = np.eye(problem.states) + np.abs(problem.transition).max(axis=0)
    measured = np.abs(problem.output).max(axis=0)
    noise = np.abs(problem.noise).max(axis=0).T
    assert isinstance(problem.start, Zonotope)
    on_states = [problem.goal, problem.start.generators]
    if problem.disturbance is not None:
        on_states.append(np.abs(problem.disturbance).max(axis=0).T)

    outputs = len(measured)
    after_controls = [(motion, np.abs(problem.control).max(axis=0))]
    if problem.path is not None:
        after_controls.append((problem.path.states, problem.path.controls))
    rows = [np.pad(np.hstack(pair), ((0, 0), (0, outputs))) for pair in after_controls]
    rows += [np.pad(each, ((0, 0), (0, problem.controls + outputs))) for each in on_states]
    rows.append(np.hstack([measured, np.zeros((outputs, problem.controls)), np.eye(outputs)]))
    rows.append(np.pad(noise, ((0, 0), (problem.states + problem.controls, 0))))
    return np.asarray(np.vstack(rows) != 0.0)


def _part(
    problem: OutputProblem, states: Places, controls: Places, outputs: Places
) -> OutputProblem:
    """Return the problem of some states, controls and outputs, which act on no others.

    Generators, noise, goals and rows of the path that do not act on them are left out.
    """
    start = problem.start
    assert isinstance(start, Zonotope)
    noise = problem.noise[:, outputs]
    goal = problem.goal[:, states]
    generators = start.generators[:, states]
    disturbance = problem.disturbance
    if disturbance is not None:
        disturbance = disturbance[:, states]
        disturbance = disturbance[:, :, disturbance.any(axis=(0, 1))]
    path = problem.path
    if path is not None:
        acting = np.hstack([path.states[:, states], path.controls[:, controls]])
        path = path.chosen(np.flatnonzero(acting.any(axis=1)))
        path = path._replace(states=path.states[:, states], controls=path.controls[:, controls])

    return replace(
        problem,
        transition=problem.transition[:, states][:, :, states],
        control=problem.control[:, states][:, :, controls],
        output=problem.output[:, outputs][:, :, states],
        noise=noise[:, :, noise.any(axis=(0, 1))],
        start=Zonotope(start.centre[states], generators[generators.any(axis=1)]),
        goal=goal[goal.any(axis=1)],
        target=problem.aim[states],
        disturbance=disturbance,
        execution_error=_chosen(problem.execution_error, controls),
        relative_error=_chosen(problem.relative_error, controls),
        control_limits=_chosen(problem.control_limits, controls),
        caps=_chosen(problem.caps, controls),
        path=path,
    )


def _chosen(values: Floats | None, controls: Places) -> Floats | None:
    return None if values is None else values[..., controls]


def _rests(part: OutputProblem) -> bool:
    """Whether a part stays at its target without control, and no error changes that."""
    assert isinstance(part.start, Zonotope)
    moves = bool(part.start.generators.any() or part.errors_of_period.any())
    is_away = bool(part.coasting.any() or part.aim.any())
    is_kept = True
    if part.path is not None:
        is_kept = bool(((part.path.lower <= 0.0) & (part.path.upper >= 0.0)).all())
    return not moves and not is_away and is_kept


def plan_of_parts(
    problem: OutputProblem, plans: Sequence[tuple[ProblemPart, AffinePlan]]
) -> AffinePlan:
    """Return the plan of the whole problem: those of its parts, and no control in the others."""
    nominal = np.zeros((problem.periods, problem.controls))
    outputs = problem.output.shape[1]
    gains = np.zeros((problem.periods, problem.periods, problem.controls, outputs))
    caps = None if problem.relative_error is None else np.zeros_like(nominal)
    for part, plan in plans:
        nominal[:, part.controls] = plan.nominal
        gains[:, :, part.controls[:, None], part.outputs] = plan.gains
        if caps is not None and plan.problem.caps is not None:
            caps[:, part.controls] = plan.problem.caps
    return AffinePlan(replace(problem, caps=caps), nominal, gains)


def part_of_plan(part: ProblemPart, plan: AffinePlan) -> AffinePlan:
    """Return the plan of an independent part of the problem of a plan by `plan_of_parts`.

    Its certificates are for the errors and the caps of `part`.
    """
    gains = plan.gains[:, :, part.controls[:, None], part.outputs]
    return AffinePlan(part.problem, plan.nominal[:, part.controls], gains)
