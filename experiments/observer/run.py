"""`infoset observe`: computation, files and tables."""

from __future__ import annotations

from collections.abc import Callable

from experiments.common.errors import InputError
from experiments.common.input_file import to_toml
from experiments.common.output import output_of, to_json
from experiments.common.screen import figure_files, progress_bar, say_warnings, show
from experiments.observer.command import Observe
from experiments.observer.data import Data, data_of, need_size
from experiments.observer.file import ObserverProblem, load_observer
from experiments.observer.page import observer_page
from experiments.observer.report import Report, report_csv, report_json, report_parts


def run(options: Observe) -> None:
    """Compute the sets, write the files and print the tables."""
    problem = load_observer(options.problem, options.settings)
    data = data_of(problem, options.data, options.errors, options.seed)
    figures = ("figure-bounds", "figure-sets") if len(problem.names) == 2 else ("figure-bounds",)
    with (
        output_of(options, ("problem.toml", "results.json", "bounds.csv", *figure_files(*figures))) as written,
        progress_bar(options.quiet) as begin,
    ):
        say_warnings(_unused_inputs(problem, data) if options.data is None else [], options.quiet)
        report = _observed(problem, data, options.smooth, begin("sets"))
        written.save("problem.toml", to_toml(problem))
        written.save("results.json", to_json(report_json(report)), "--json")
        written.save("bounds.csv", report_csv(report), "--csv")
        if options.html is not None:
            written.deliver("--html", observer_page(report))
        if options.out is not None:
            from experiments.observer.figures import draw_all

            written.draw(figures, draw_all(report), begin("figures"))
    show(report_parts(report), options.quiet, stdout_taken=written.stdout_taken)


def _unused_inputs(problem: ObserverProblem, data: Data) -> list[str]:
    """Return a warning about inputs of the problem file after the last measurement."""
    rows, steps = 0 if problem.inputs is None else len(problem.inputs), len(data.measured)
    if rows <= steps:
        return []
    return [f"{problem.name}: measurements.u has {rows} rows, and there are {steps} steps: the later rows are not used"]


def _observed(problem: ObserverProblem, data: Data, smooth: bool, progress: Callable[[float], None]) -> Report:
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
        smoothed = observer.smooth(estimates, data.inputs) if smooth else None
    except (ArithmeticError, ValueError) as error:
        raise InputError(f"{problem.name}: step {observer.step}: {error}") from None
    return Report(problem, data, estimates, smoothed, observer.inconsistency)
