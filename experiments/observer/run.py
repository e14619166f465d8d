"""`infoset observe`: computation."""

from __future__ import annotations

from infoset.experiments.common.errors import InputError
from infoset.experiments.common.problem_command import ProblemCommand
from infoset.experiments.common.screen import BeginProgress
from infoset.experiments.observer.command import Observe
from infoset.experiments.observer.data import data_of, need_size
from infoset.experiments.observer.file import ObserverProblem
from infoset.experiments.observer.page import observer_page
from infoset.experiments.observer.report import (
    ObserverReport,
    report_csv,
    report_json,
    report_lines,
)


def solve(problem: ObserverProblem, options: Observe, begin: BeginProgress) -> ObserverReport:
    """Return the set of each step."""
    data = data_of(problem, options)
    progress = begin("sets")
    observer = problem.observer()
    estimates = []
    try:
        for k, measurement in enumerate(data.measured):
            if k:
                observer.predict(data.inputs[k - 1])
            observer.update(measurement)
            estimates.append(observer.estimate())
            need_size(f"{problem.name}: step {k}", estimates[-1].lower, estimates[-1].upper)
            progress((k + 1) / len(data.measured))
        smoothed = observer.smooth(estimates, data.inputs) if options.smooth else None
    except (ArithmeticError, ValueError) as error:
        raise InputError(f"{problem.name}: step {observer.step}: {error}") from None
    return ObserverReport(
        problem, data, estimates, smoothed, observer.inconsistency, observer.detection
    )


COMMAND = ProblemCommand(
    owner=ObserverProblem,
    solve=solve,
    to_json=report_json,
    to_csv=report_csv,
    lines=report_lines,
    to_html=observer_page,
    csv_name="bounds.csv",
    figures="infoset.experiments.observer.figures",
    figure_names=("figure-bounds", "figure-sets"),
)
run = COMMAND.run
