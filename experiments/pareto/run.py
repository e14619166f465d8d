"""`infoset pareto`: computation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from infoset.arrays import Floats
from infoset.experiments.common.errors import InputError, shown
from infoset.experiments.common.problem_command import ProblemCommand
from infoset.experiments.common.screen import BeginProgress
from infoset.experiments.pareto.command import Pareto
from infoset.experiments.pareto.file import TERMINAL, ParetoProblem
from infoset.experiments.pareto.page import pareto_page
from infoset.experiments.pareto.report import (
    ImposedBound,
    ParetoReport,
    report_json,
    report_lines,
    trajectories,
)
from infoset.limits import MAXIMUM
from infoset.rendezvous.bounded_control import BoundTooSmallError
from infoset.rendezvous.pareto import (
    EncounterSolution,
    analyse_coalitions,
    bound_encounter,
    min_sum_of_costs,
    minimax_excess,
    nearest_to,
    needed_bound,
    peak_control,
    solve_encounter,
)
from infoset.rendezvous.pareto.coalitions import MAX_CRAFT

SWEEP = (0.5, 2.0, 31)
"""Smallest and largest duration of the sweep, relative to the problem's, and their number.

Durations are from the last start of a craft. Chosen: costs change by some powers of the duration,
and 31 points draw a smooth curve.
"""


def solve(problem: ParetoProblem, options: Pareto, begin: BeginProgress) -> ParetoReport:
    """Return the meetings, their costs, the coalitions and the costs of other durations."""
    preferred = None if options.prefer is None else _preferred(options.prefer, problem)
    encounter = problem.encounter
    # The shares of the progress are chosen.
    progress = begin("meetings and coalitions")
    solution = solve_encounter(encounter)
    selections = {
        "min_group_loss": solution.point,
        "min_sum_of_costs": min_sum_of_costs(solution),
        "minimax_excess": minimax_excess(solution),
    }
    if preferred is not None:
        selections["preferred"] = nearest_to(solution, preferred)
    progress(0.2)
    imposed = _imposed(problem, solution)
    progress(0.4)
    coalitions = analyse_coalitions(solution) if len(solution.costs) <= MAX_CRAFT else None
    progress(0.9)
    latest_s = max(craft.start_s for craft in encounter.craft)
    times_s = (latest_s + (encounter.meeting_s - latest_s) * np.linspace(*SWEEP)).tolist()
    return ParetoReport(
        problem,
        solution,
        selections,
        coalitions,
        imposed,
        sweep=tuple(solve_encounter(replace(encounter, meeting_s=time_s)) for time_s in times_s),
    )


def _preferred(text: str, problem: ParetoProblem) -> Floats:
    """Read `--prefer`, KEY=VALUE,.. in SI units: one value for each free component.

    The values, shape (f,), are in the order of `encounter.free`. Raise `InputError` if a component
    is missing, unknown or given twice, or if a value is not a finite number within the limit.
    """
    keys = [TERMINAL[component.name.lower()] for component in problem.encounter.free]
    pairs = [part.partition("=") for part in text.split(",")]
    try:
        values = {key.strip(): float(number) for key, _, number in pairs}
    except ValueError:
        values = {}
    # A key that is given twice leaves fewer values than pairs; a NaN is not within the limit.
    if (
        len(values) != len(pairs)
        or sorted(values) != sorted(keys)
        or not all(abs(value) <= MAXIMUM for value in values.values())
    ):
        example = ",".join(f"{key}=0" for key in keys)
        raise InputError(
            f"--prefer: must be a finite number for each free component, found {shown(text)}; for "
            f"example --prefer {example}"
        )
    return np.array([values[key] for key in keys])


def _imposed(problem: ParetoProblem, solution: EncounterSolution) -> ImposedBound | None:
    """Return the meeting with the bound imposed.

    It is None if there is no bound, or the minimum-energy controls keep it.
    """
    bound = problem.max_control_m_s2
    encounter = problem.encounter
    if bound is None:
        return None
    peaks = [peak_control(flight) for flight in solution.plans()]
    if max(peaks) <= bound:
        return None
    least = needed_bound(encounter)
    key = f"{problem.name}: max_control_m_s2"
    if bound < least.value_m_s2:
        names = " and ".join(encounter.craft[index].name for index in least.craft)
        raise InputError(
            f"{key}: no meeting is possible with controls of at most {bound:g} m/s^2; {names} need "
            f"at least {least.value_m_s2:.6g} m/s^2, {least.value_m_s2 / bound:.4g} times the "
            "bound; raise it, or make duration_s longer"
        )
    try:
        return ImposedBound(bound_encounter(solution, bound), least.value_m_s2, tuple(peaks))
    except BoundTooSmallError as error:
        raise InputError(
            f"{key}: {error}; the smallest bound with which a meeting is possible is "
            f"{least.value_m_s2:.6g} m/s^2; raise it, or make duration_s longer"
        ) from None


COMMAND = ProblemCommand(
    owner=ParetoProblem,
    solve=solve,
    to_json=report_json,
    to_csv=trajectories,
    lines=report_lines,
    to_html=pareto_page,
    figures="infoset.experiments.pareto.figures",
    figure_names=("figure-trajectories", "figure-controls", "figure-front"),
)
run = COMMAND.run
