"""`infoset pareto`: computation, files and tables."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from experiments.common.errors import InputError, input_errors, shown
from experiments.common.input_file import to_toml
from experiments.common.output import TRAJECTORIES, output_of, to_json
from experiments.common.problems import need_finite
from experiments.common.screen import figure_files, progress_bar, show
from experiments.pareto.command import Pareto
from experiments.pareto.file import TERMINAL, ParetoProblem, load_pareto
from experiments.pareto.page import pareto_page
from experiments.pareto.report import Report, report_json, report_parts, trajectories
from infoset.arrays import Floats
from infoset.limits import MAXIMUM
from rendezvous.pareto import (
    BoundCheck,
    EncounterSolution,
    Feasibility,
    analyse_coalitions,
    check_bound,
    min_sum_of_costs,
    minimax_excess,
    nearest_to,
    peak_control,
    solve_encounter,
    sweep_meeting_time,
    total_impulse,
)
from rendezvous.pareto.coalitions import MAX_CRAFT

FIGURES = ("figure-trajectories", "figure-controls", "figure-front", "figure-costs")
SWEEP = (0.5, 2.0, 31)
"""Smallest and largest duration of the sweep, relative to the duration of the problem, and their number."""


def run(options: Pareto) -> None:
    """Solve the problem, write the files and print the tables."""
    problem = load_pareto(options.problem, options.settings)
    preferred = None if options.prefer is None else _preferred(options.prefer, problem)
    with (
        output_of(options, ("problem.toml", "results.json", TRAJECTORIES, *figure_files(*FIGURES))) as written,
        progress_bar(options.quiet) as begin,
    ):
        report = _solve(problem, preferred, begin("meetings and coalitions"))
        written.save("problem.toml", to_toml(problem))
        written.save("results.json", to_json(report_json(report, options.samples)), "--json")
        if written.wants("--csv"):
            written.save(TRAJECTORIES, trajectories(report, options.samples), "--csv")
        if options.html is not None:
            written.deliver("--html", pareto_page(problem.name, report.solution, report.selections))
        if options.out is not None:
            from experiments.pareto.figures import draw_all

            written.draw(FIGURES, draw_all(report), begin("figures"))
    show(report_parts(report), options.quiet, stdout_taken=written.stdout_taken)


def _preferred(text: str, problem: ParetoProblem) -> Floats:
    """Read a preferred meeting: a value for each free component."""
    keys = [TERMINAL[component.name.lower()] for component in problem.encounter.free]
    example = "--prefer " + ",".join(f"{key}=0" for key in keys)
    values: dict[str, float] = {}
    for part in text.split(","):
        key, mark, number = (piece.strip() for piece in part.partition("="))
        if not mark or key not in keys or key in values:
            raise InputError(
                f"--prefer: give each of {', '.join(keys)} once, found {shown(part.strip())}; for example {example}"
            )
        try:
            values[key] = float(number)
        except ValueError:
            raise InputError(f"--prefer: {shown(number)} is not a number; for example {example}") from None
    missing = [key for key in keys if key not in values]
    if missing:
        raise InputError(f"--prefer: {' and '.join(missing)} is missing; for example {example}")
    if not all(math.isfinite(value) and abs(value) <= MAXIMUM for value in values.values()):
        raise InputError(f"--prefer: values must be finite and at most {MAXIMUM:g} in size; for example {example}")
    return np.array([values[key] for key in keys])


def _solve(problem: ParetoProblem, preferred: Floats | None, progress: Callable[[float], None]) -> Report:
    encounter = problem.encounter
    with input_errors(problem.name):
        solution = solve_encounter(encounter)
    need_finite(problem, solution.meeting_state(), solution.cost_squared())
    selections = _selections(problem, solution, preferred)
    progress(0.2)
    bounds = _bounds(problem, solution)
    progress(0.4)
    plans = [solution.plan(index) for index in range(len(solution.costs))]
    coalitions = analyse_coalitions(solution) if len(plans) <= MAX_CRAFT else None
    progress(0.9)
    latest_s = max(craft.start_s for craft in encounter.craft)
    durations = latest_s + (encounter.meeting_s - latest_s) * np.linspace(*SWEEP)
    return Report(
        problem,
        solution,
        selections,
        coalitions,
        bounds,
        peaks_m_s2=tuple(peak_control(plan) for plan in plans),
        impulses_m_s=tuple(total_impulse(plan) for plan in plans),
        sweep=sweep_meeting_time(encounter, durations),
    )


def _selections(problem: ParetoProblem, solution: EncounterSolution, preferred: Floats | None) -> dict[str, Floats]:
    """Return Pareto-optimal meetings by the rule of their choice."""
    selections = {
        "min_group_loss": solution.point,
        "min_sum_of_costs": min_sum_of_costs(solution),
        "minimax_excess": minimax_excess(solution),
    }
    if preferred is not None:
        with input_errors(f"{problem.name}: --prefer"):
            selections["preferred"] = nearest_to(solution, preferred)
    return selections


def _bounds(problem: ParetoProblem, solution: EncounterSolution) -> tuple[BoundCheck, ...]:
    """Return the check of the bound for each craft; refuse a bound that no control keeps."""
    bound, encounter = problem.max_control_m_s2, problem.encounter
    if bound is None:
        return ()
    where = f"{problem.name}: max_control_m_s2"
    with input_errors(where):
        checks = [check_bound(solution.plan(index), bound, encounter.common) for index in range(len(solution.costs))]
    worst = max(range(len(checks)), key=lambda index: checks[index].min_peak_m_s2)
    need = checks[worst].min_peak_m_s2
    if checks[worst].feasibility is Feasibility.IMPOSSIBLE:
        raise InputError(
            f"{where}: no control of at most {bound:g} m/s^2 brings the craft {encounter.craft[worst].name} to the "
            f"meeting; at least {need:.6g} m/s^2 is needed, {need / bound:.4g} times the bound; raise it, or make "
            "duration_s longer"
        )
    return tuple(checks)
