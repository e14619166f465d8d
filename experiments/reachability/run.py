"""`infoset reach`: computation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from infoset.arrays import Floats
from infoset.experiments.common.built_in_files import kind_of
from infoset.experiments.common.errors import InputError
from infoset.experiments.common.input_file import parse, read_file, source_of
from infoset.experiments.common.problem_command import ProblemCommand
from infoset.experiments.common.screen import BeginProgress
from infoset.experiments.reachability.command import Reach
from infoset.experiments.reachability.file import Rendezvous
from infoset.experiments.reachability.guarantee_report import COMMAND as GUARANTEE_COMMAND
from infoset.experiments.reachability.page import reachability_page
from infoset.experiments.reachability.report import (
    ChosenControl,
    ReachabilityReport,
    Robustness,
    flown,
    report_json,
    report_lines,
    trajectories,
)
from infoset.experiments.reachability.selection import (
    DEFAULT_SELECTION,
    select_controls,
    selection,
)
from infoset.experiments.reachability.system import COMMAND as SYSTEM_COMMAND
from infoset.experiments.reachability.system_file import ReachableSystem
from infoset.rendezvous.reachability import (
    IMPULSE,
    ClosedLoopFlight,
    EmptyTubeError,
    NonlinearMotion,
    NoRobustPlanError,
    SetKind,
    backward_bounds,
    feedback_plan,
    min_periods,
    optimal_controls,
    replan,
    solve,
    tightened,
)

NOISY_FLIGHTS = 10
"""Number of simulations in closed loop with navigation errors; chosen."""


def solve_rendezvous(
    rendezvous: Rendezvous, options: Reach, begin: BeginProgress
) -> ReachabilityReport:
    """Return the sets, the selected controls with trajectories, and the simulations."""
    select = options.select or DEFAULT_SELECTION[rendezvous.engine]
    selection(select)  # a mistake is found before anything is computed
    progress = begin(rendezvous.name)  # its shares are chosen
    solution = solve(rendezvous.problem)
    progress(0.2)
    # If the norm is zero, fewer periods may be enough, else more may be.
    searched = rendezvous.problem if solution.optimal.miss == 0.0 else rendezvous.longer
    minimum = min_periods(searched)
    progress(0.3)
    forward, tube = (solution.sets.bounds(kind) for kind in (SetKind.FORWARD, SetKind.TUBE))
    progress(0.5)
    backward = backward_bounds(solution.optimal) if options.backward else None
    ranges = solution.optimal.ranges()
    controls = select_controls(solution, select, options.seed)
    members = fly_members(rendezvous, [*controls], np.array([*controls.values()]))
    progress(0.7)
    flight = None
    noisy = []
    if options.replan:
        flight = _fly(rendezvous, None)
        for run in range(NOISY_FLIGHTS if rendezvous.navigation_error is not None else 0):
            sequence = np.random.SeedSequence(entropy=options.seed, spawn_key=(run,))
            noisy.append(_fly(rendezvous, np.random.default_rng(sequence)))
            progress(0.7 + 0.2 * (run + 1) / NOISY_FLIGHTS)
    effect = rendezvous.disturbance_effect
    robustness = None if effect is None else _robustness(rendezvous, effect)
    progress(1.0)
    return ReachabilityReport(
        rendezvous,
        solution,
        minimum,
        searched.periods,
        forward,
        tube,
        backward,
        ranges,
        members,
        flight,
        tuple(noisy),
        robustness,
    )


def fly_members(
    rendezvous: Rendezvous,
    names: Sequence[str],
    controls: Floats,
    truth: NonlinearMotion | None = None,
) -> tuple[ChosenControl, ...]:
    """Simulate controls, shape (k, T, 3), on the linear and on the nonlinear model.

    `truth` replaces the nonlinear model.
    """
    problem = rendezvous.problem
    linear = problem.run(controls)
    nonlinear = flown(rendezvous, controls, truth=truth)
    between = replace(problem, between=rendezvous.instants).excess(controls)
    rows = zip(names, controls, linear, nonlinear, between.tolist(), strict=True)
    return tuple(ChosenControl(*row) for row in rows)


def _fly(rendezvous: Rendezvous, generator: np.random.Generator | None) -> ClosedLoopFlight:
    """Simulate in closed loop, with navigation errors if there is a generator."""

    def truth(period: int, state: Floats, control: Floats) -> Floats:
        start_s = rendezvous.period_s * period
        push = np.zeros(3)
        if rendezvous.has_impulses:
            state = state + IMPULSE @ control
        else:
            push = rendezvous.unit_m_s2 * control
        # Of one craft at one time.
        return np.asarray(
            rendezvous.truth.paths(start_s, state, push, [start_s + rendezvous.period_s])[0, 0]
        )

    def observe(_period: int, state: Floats) -> Floats:
        assert generator is not None
        assert rendezvous.navigation_error is not None
        return state + rendezvous.navigation_error * generator.uniform(-1.0, 1.0, 6)

    try:
        return replan(rendezvous.problem, truth, None if generator is None else observe)
    except ArithmeticError as error:
        raise InputError(
            f"--replan: {error}; omit --replan, or reduce its navigation errors, if any"
        ) from None


def _robustness(rendezvous: Rendezvous, disturbance: Floats) -> Robustness:
    problem = rendezvous.problem
    fixed, conflict, plan, refusal = None, None, None, None
    try:
        fixed = optimal_controls(tightened(problem, disturbance)).miss
    except EmptyTubeError as error:
        conflict = str(error)
    # ValueError: thrust in a ball, too many periods, or constraints within periods.
    try:
        plan = feedback_plan(problem, disturbance)
    except (NoRobustPlanError, ValueError) as error:
        refusal = str(error)
    return Robustness(fixed, conflict, plan, refusal)


COMMAND = ProblemCommand(
    owner=Rendezvous,
    solve=solve_rendezvous,
    to_json=report_json,
    to_csv=trajectories,
    lines=report_lines,
    to_html=reachability_page,
    figures="infoset.experiments.reachability.figures",
    figure_names=("figure-positions", "figure-velocities", "figure-planes", "figure-controls"),
)


def run(options: Reach) -> None:
    """Solve a rendezvous, with bounded errors or without, or a problem of a linear system."""
    text, source = source_of(options.problem, [Rendezvous.kind, ReachableSystem.kind])
    command: ProblemCommand[Any, Any] = COMMAND
    if kind_of(parse(text, source)) == ReachableSystem.kind:
        command = SYSTEM_COMMAND
    elif read_file(Rendezvous, options.problem, options.settings).is_guaranteed:
        command = GUARANTEE_COMMAND
    if options.flights is not None and command is not GUARANTEE_COMMAND:
        raise InputError("--flights: is for problems with [sensor] or [initial_error]")
    command.run(options)
