"""Commands that solve a problem.

They read it, solve it, write files and print the results, all in the same way.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Generic, TypeVar

import numpy as np

from infoset.arrays import Floats
from infoset.experiments.common.errors import input_errors
from infoset.experiments.common.input_file import read_file, to_toml
from infoset.experiments.common.output import output_of, to_json
from infoset.experiments.common.screen import BeginProgress, Part, figure_files, progress_bar, show
from infoset.sim.columns import csv_text
from infoset.sim.storage.codec import fingerprint
from infoset.sim.versions import versions

Problem = TypeVar("Problem")
Report = TypeVar("Report")
_REMEDY = "; check the units and the limits of the problem"


@dataclass(frozen=True, kw_only=True)
class ProblemCommand(Generic[Problem, Report]):
    """The functions of a command.

    Parameters
    ----------
    owner : type
        The dataclass of the problem.
    solve : callable
        Returns the report of a problem for the options of the command; the third argument begins a
        progress bar.
    to_json, to_csv, lines, to_html : callable
        Return the keys of the JSON file, the table of the CSV file, the printed lines and tables,
        and the page.
    csv_name : str
        Name of the CSV file in the folder of ``--out``.
    figures : str
        Module whose function ``draw_all`` yields the figures of a report, or None for a figure that
        it lacks.
    figure_names : tuple of str
        Names of these figures, in the order in which ``draw_all`` yields them.
    """

    owner: type[Problem]
    solve: Callable[[Problem, Any, BeginProgress], Report]
    to_json: Callable[[Report], dict[str, object]]
    to_csv: Callable[[Report], str]
    lines: Callable[[Report], Iterable[Part]]
    to_html: Callable[[Report], str] | None = None
    csv_name: str = "trajectories.csv"
    figures: str
    figure_names: tuple[str, ...]

    def run(self, options: Any) -> None:
        """Solve the problem, write the files and print the results."""
        problem: Any = read_file(self.owner, options.problem, options.settings)
        files = ("problem.toml", "results.json", self.csv_name, *figure_files(*self.figure_names))
        with (
            output_of(options, files) as written,
            progress_bar(options.quiet) as begin,
            # Also errors of sets that are computed when they are drawn.
            input_errors(problem.name, _REMEDY, ArithmeticError),
        ):
            with input_errors(problem.name):
                report = self.solve(problem, options, begin)
            head = {
                "versions": versions(),
                "problem": problem.name,
                "problem_hash": fingerprint(problem),
            }
            with input_errors(problem.name, _REMEDY):  # a number that is not finite is a ValueError
                results = to_json(head | self.to_json(report))
            page = ""
            if self.to_html and options.html is not None:
                page = self.to_html(report)

            written.save("problem.toml", to_toml(problem))
            written.save("results.json", results, "--json")
            if written.wants("--csv"):
                written.save(self.csv_name, self.to_csv(report), "--csv")
            written.deliver("--html", page)
            if options.out is not None:
                drawn = import_module(self.figures).draw_all(report)
                written.draw(self.figure_names, drawn, begin("figures"))

        show(self.lines(report), options.quiet or written.stdout_taken)

    def report(self, options: Any) -> Report:
        """Return the report for options, without progress and files."""
        problem = read_file(self.owner, options.problem, options.settings)
        return self.solve(problem, options, lambda _title: lambda _done: None)


CONTROL_COLUMNS = ("ux_m_s2", "uy_m_s2", "uz_m_s2")
_STATE_COLUMNS = ("x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s")


def trajectories_csv(
    names: Sequence[str],
    tracks: Iterable[tuple[Sequence[str], Sequence[Floats]]],
    columns: Sequence[str] = CONTROL_COLUMNS,
) -> str:
    """Return trajectories as CSV, one line for each craft and time.

    A track has the values of the columns `names`, which identify it, and arrays of n times, shape
    (n,), of states, shape (n, 6), and of the values of the other `columns`; a value that does not
    exist is NaN.
    """
    rows = [
        [*track, *(None if math.isnan(value) else value for value in row)]
        for track, arrays in tracks
        for row in np.column_stack(arrays).tolist()
    ]
    return csv_text([*names, "time_s", *_STATE_COLUMNS, *columns], rows)
