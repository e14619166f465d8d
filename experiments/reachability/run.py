"""`infoset reach`: computation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from experiments.common.errors import InputError, input_errors
from experiments.common.options import choice
from experiments.common.problem_command import ProblemCommand
from experiments.common.screen import BeginProgress
from experiments.reachability.command import Reach
from experiments.reachability.file import Rendezvous
from experiments.reachability.page import reachability_page
from experiments.reachability.report import Member, Report, Robustness, report_json, report_lines, trajectories
from infoset.arrays import Floats
from infoset.geometry.polytope import UncertainHullError
from rendezvous.reachability import (
    EmptyTubeError,
    Flight,
    NonlinearMotion,
    NoRobustPlanError,
    Route,
    SetKind,
    Solution,
    TooManyVerticesError,
    analytic_centre,
    chebyshev_centre,
    feedback_plan,
    min_periods,
    minimum_energy,
    minimum_l1,
    minimum_norms,
    minimum_peak,
    replan,
    samples,
    solve,
    tightened,
    vertices,
)

SINGLE = {
    "energy": minimum_energy,
    "l1": minimum_l1,
    "norms": minimum_norms,
    "peak": minimum_peak,
    "chebyshev": chebyshev_centre,
    "analytic": analytic_centre,
}
"""Selections of one control each: minimum sum of squares, of absolute values, of Euclidean norms, and so on."""
VERTICES, SAMPLES = "vertices", "samples"
MAX_SAMPLES = 1000
NOISY_FLIGHTS = 10
"""Number of simulations in closed loop with navigation errors."""


def solve_rendezvous(rendezvous: Rendezvous, options: Reach, begin: BeginProgress) -> Report:
    """Return the sets, the selected optimal controls with their trajectories, and the simulations in closed loop."""
    names, count = _selection(options.select)
    progress = begin(rendezvous.name)
    solution = solve(rendezvous.problem)
    progress(0.2)
    searched = rendezvous.problem if solution.optimal.miss == 0.0 else rendezvous.longer
    minimum = min_periods(searched)
    progress(0.3)
    forward, tube = (solution.sets.bounds(kind) for kind in (SetKind.FORWARD, SetKind.TUBE))
    progress(0.5)
    ranges = solution.optimal.ranges()
    controls = _controls(solution, names, count, options.seed)
    members = fly_members(rendezvous, [*controls], np.array([*controls.values()]))
    progress(0.7)
    flight, noisy = None, []
    if options.replan:
        flight = _fly(rendezvous, None)
        for run in range(NOISY_FLIGHTS if rendezvous.navigation_error is not None else 0):
            sequence = np.random.SeedSequence(entropy=options.seed, spawn_key=(run,))
            noisy.append(_fly(rendezvous, np.random.default_rng(sequence)))
            progress(0.7 + 0.2 * (run + 1) / NOISY_FLIGHTS)
    effect = rendezvous.disturbance_effect
    robustness = None if effect is None else _robustness(rendezvous, effect)
    progress(1.0)
    return Report(
        rendezvous,
        solution,
        minimum,
        searched.periods,
        forward,
        tube,
        ranges,
        members,
        flight,
        tuple(noisy),
        robustness,
    )


def _selection(text: str) -> tuple[list[str], int]:
    """Return the names of the selection, and the number of samples."""
    names, count = [], 0
    for part in text.split(","):
        name, _, digits = part.strip().partition(":")
        name = choice("--select", name, [*SINGLE, VERTICES, SAMPLES])
        if name == SAMPLES:
            with input_errors(f"--select {SAMPLES}"):
                count = int(digits)
            if not 1 <= count <= MAX_SAMPLES:
                raise InputError(f"--select {SAMPLES}: must be between 1 and {MAX_SAMPLES}, found {count}")
        names.append(name)
    return names, count


def _controls(solution: Solution, names: Sequence[str], count: int, seed: int) -> dict[str, Floats]:
    """Return the selected optimal controls, each of shape (T, 3), by name."""
    controls: dict[str, Floats] = {}
    for name in names:
        if name in SINGLE:
            controls[name] = SINGLE[name](solution.optimal)
        elif name == VERTICES:
            try:
                several = vertices(solution.optimal)
            except (TooManyVerticesError, UncertainHullError) as error:
                raise InputError(f"--select vertices: {error}; choose for example --select samples:20") from None
            controls |= {f"vertex {number}": control for number, control in enumerate(several, start=1)}
        else:
            several = samples(solution.optimal, count, np.random.default_rng(seed))
            controls |= {f"sample {number}": control for number, control in enumerate(several, start=1)}
    return controls


def fly_members(
    rendezvous: Rendezvous, names: Sequence[str], controls: Floats, truth: NonlinearMotion | None = None
) -> tuple[Member, ...]:
    """Simulate controls, shape (k, T, 3), on the linear and on the nonlinear model; `truth` replaces the latter."""
    problem = rendezvous.problem
    linear = problem.run(controls)
    pushes = rendezvous.acceleration_m_s2 * controls
    nonlinear = (truth or rendezvous.truth).fly(problem.initial, pushes, rendezvous.period_s)
    between = replace(problem, between=rendezvous.instants).excess(controls)
    rows = zip(names, controls, linear, nonlinear, between.tolist(), strict=True)
    return tuple(Member(*row) for row in rows)


def _fly(rendezvous: Rendezvous, generator: np.random.Generator | None) -> Flight:
    """Simulate in closed loop, with navigation errors if there is a generator."""

    def truth(period: int, state: Floats, control: Floats) -> Floats:
        start_s = rendezvous.period_s * period
        push = rendezvous.acceleration_m_s2 * control
        return np.asarray(rendezvous.truth.paths(start_s, state, push, [start_s + rendezvous.period_s])[0, 0])

    def observe(_period: int, state: Floats) -> Floats:
        assert generator is not None
        assert rendezvous.navigation_error is not None
        return state + rendezvous.navigation_error * generator.uniform(-1.0, 1.0, 6)

    try:
        return replan(rendezvous.problem, truth, None if generator is None else observe)
    except ArithmeticError as error:
        raise InputError(f"--replan: {error}; omit --replan, or reduce its navigation errors, if any") from None


def _robustness(rendezvous: Rendezvous, disturbance: Floats) -> Robustness:
    problem = rendezvous.problem
    fixed, conflict, plan, refusal = None, None, None, None
    try:
        fixed = solve(tightened(problem, disturbance), Route.LIFTED).optimal.miss
    except EmptyTubeError as error:
        conflict = str(error)
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
    figures="experiments.reachability.figures",
    figure_names=("figure-positions", "figure-velocities", "figure-planes", "figure-controls"),
)
run = COMMAND.run
