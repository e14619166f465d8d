"""`infoset reach` for a linear system of the user: computation and results."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from infoset.arrays import Floats
from infoset.experiments.common.errors import InputError
from infoset.experiments.common.problem_command import ProblemCommand
from infoset.experiments.common.screen import BeginProgress, Part, number, number_table
from infoset.experiments.reachability.command import Reach
from infoset.experiments.reachability.file import Engine
from infoset.experiments.reachability.report import solution_json, solution_lines
from infoset.experiments.reachability.selection import (
    DEFAULT_SELECTION,
    select_controls,
    selection,
)
from infoset.experiments.reachability.system_file import ReachableSystem
from infoset.rendezvous.reachability import SetKind, Solution, min_periods, solve
from infoset.sim.columns import Cell, csv_text

_ZERO = 1e-10
"""Part of a bound below which a state is shown as zero."""


@dataclass(frozen=True, eq=False)
class SystemReport:
    """Results of one command.

    Sets have shape (T + 1, n, 2). Controls, (T, m), and their states, (T + 1, n), are given by
    name.
    """

    system: ReachableSystem
    solution: Solution
    min_periods: int | None
    forward: Floats
    tube: Floats
    ranges: Floats
    controls: dict[str, Floats]
    states: dict[str, Floats]


def solve_system(system: ReachableSystem, options: Reach, begin: BeginProgress) -> SystemReport:
    """Return the sets and the selected optimal controls with their motions."""
    if options.replan or options.backward or options.html is not None:
        raise InputError(
            "--replan, --backward and --html: are for problems of kind reachable-rendezvous; omit "
            "them here"
        )
    select = options.select or DEFAULT_SELECTION[Engine.HELD]
    selection(select)  # a mistake is found before anything is computed
    progress = begin(system.name)
    problem = system.problem
    path = system.path
    solution = solve(problem)
    progress(0.5)
    controls = select_controls(solution, select, options.seed)
    # The problem is in states relative to `path`: both bounds of a state are moved by it.
    forward, tube = (
        solution.sets.bounds(kind) + path[..., None] for kind in (SetKind.FORWARD, SetKind.TUBE)
    )
    states = {name: problem.run(control) + path for name, control in controls.items()}

    # If the target moves, another number of periods has another target.
    is_fixed = not np.ptp(path, axis=0).any()
    least = min_periods(problem) if is_fixed else None
    progress(1.0)
    return SystemReport(
        system, solution, least, forward, tube, solution.optimal.ranges(), controls, states
    )


def report_json(report: SystemReport) -> dict[str, object]:
    """Return the results for `infoset.experiments.common.output.to_json`."""
    return {
        "states": report.system.names,
        **solution_json(
            report.solution, report.min_periods, (report.forward, report.tube), report.ranges
        ),
        "controls": [
            {"name": name, "controls": control, "states": report.states[name]}
            for name, control in report.controls.items()
        ],
    }


def motions_csv(report: SystemReport) -> str:
    """Return the motions under the selected controls as CSV; a control acts after its row."""
    n = len(report.system.names)
    m = len(report.system.bounds.controls)
    columns = [
        "control",
        "period",
        *(f"x{i + 1}" for i in range(n)),
        *(f"u{j + 1}" for j in range(m)),
    ]
    rows: list[list[Cell]] = []
    for name, control in report.controls.items():
        # No control acts after the last state.
        controls: list[list[Cell]] = [*control.tolist(), [None] * m]
        for t, state in enumerate(report.states[name].tolist()):
            rows.append([name, t, *state, *controls[t]])
    return csv_text(columns, rows)


def report_lines(report: SystemReport) -> Iterator[Part]:
    """Yield the minimum norm, the tube and the selected controls, for the screen."""
    solution = report.solution
    minimum = report.min_periods
    reached = f"minimum distance from the target {solution.optimal.miss:.9g}"
    if minimum is not None:
        reached += f"; to reach it takes at least {minimum} period{'s' if minimum > 1 else ''}"
    yield f"{report.system.name}: {reached}"
    yield from solution_lines(solution)

    table = number_table("period", *(f"{name}\nof the tube" for name in report.system.names))
    zero = _ZERO * np.array(report.system.bounds.states)[:, None]
    for t, row in enumerate(report.tube):
        shown = np.where(np.abs(row) < zero, 0.0, row)
        table.add_row(str(t), *(f"{low:.6g} .. {high:.6g}" for low, high in shown))
    yield from ("", table)

    members = number_table("control", "energy\nu^2", "sum of |u|", "peak\n|u|")
    for name, control in report.controls.items():
        size = np.abs(control)
        members.add_row(name, *map(number, ((size**2).sum(), size.sum(), size.max())))
    if report.controls:
        yield from ("", members)


COMMAND = ProblemCommand(
    owner=ReachableSystem,
    solve=solve_system,
    to_json=report_json,
    to_csv=motions_csv,
    lines=report_lines,
    csv_name="motions.csv",
    figures="infoset.experiments.reachability.system_figures",
    figure_names=("figure-states", "figure-controls"),
)
