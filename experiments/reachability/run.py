"""`infoset reach`: computation, files and tables."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rich.console import Console
from rich.table import Table

from experiments.common.errors import InputError
from experiments.common.options import choice, whole_number
from experiments.common.output import output, to_csv, to_json
from experiments.common.screen import figure_files, number, progress_bar, table_console
from experiments.reachability.command import Reach
from experiments.reachability.figures import draw_reach
from experiments.reachability.file import load_rendezvous
from experiments.reachability.page import reachability_page
from experiments.reachability.printed_tables import (
    COLUMNS,
    Comparison,
    compare_published,
    is_published,
)
from experiments.reachability.report import (
    MOST_SAMPLES,
    SAMPLES,
    SINGLE,
    VERTICES,
    Report,
    make_report,
    report_json,
)
from rendezvous.reachability import Route, SetKind, effort

FIGURES = ("figure-positions", "figure-velocities", "figure-planes", "figure-controls")
TABLES = "published-tables.csv"


def run(options: Reach) -> None:
    """Solve the problem, write the files and print the tables."""
    names, sample_count = _selection(options.select)
    rendezvous = load_rendezvous(options.problem)
    published = is_published(rendezvous)
    files = ("results.json", *((TABLES,) if published else ()), *figure_files(*FIGURES))
    with (
        output(
            folder=options.out,
            names=files,
            files={"--json": options.json, "--html": options.html},
            overwrite=options.overwrite,
            quiet=options.quiet,
        ) as written,
        progress_bar(options.quiet) as begin,
    ):
        report = make_report(
            rendezvous,
            names,
            sample_count=sample_count,
            seed=options.seed,
            route=None if options.route == "auto" else Route(options.route),
            closed_loop=options.replan,
            noisy_flights=options.noisy_flights,
            progress=begin(rendezvous.name),
        )
        numbers = report_json(report)
        comparisons = compare_published(rendezvous, report.solution) if published else ()
        written.save("results.json", to_json(numbers), "--json")
        if comparisons:
            written.save(TABLES, to_csv(COLUMNS, [row for comparison in comparisons for row in comparison.rows]))
        if options.html is not None:
            written.deliver("--html", reachability_page(report))
        if options.out is not None:
            progress = begin("figures")
            try:
                figures = list(draw_reach(report, progress))
            except ArithmeticError as error:
                numbers_file = f"{written.folder}/results.json"
                raise InputError(f"cannot draw the tube: {error}; the numbers are in {numbers_file}") from None
            for i, (name, figure) in enumerate(zip(FIGURES, figures, strict=True)):
                written.figure(name, figure)
                progress(0.8 + 0.2 * (i + 1) / len(FIGURES))
    if not options.quiet:
        _show(table_console(written.stdout_taken), report, comparisons)


def _selection(text: str) -> tuple[list[str], int]:
    """Return the names chosen, and how many samples."""
    valid = [*SINGLE, VERTICES, SAMPLES]
    names, count = [], 0
    for each in text.split(","):
        name, _, number = each.strip().partition(":")
        name = choice("--select", name, valid)
        if name == SAMPLES:
            if not number.isascii() or not number.isdigit() or len(number) > 6:
                raise InputError(f"--select {SAMPLES}: must say how many, for example --select {SAMPLES}:20")
            count = whole_number(f"--select {SAMPLES}", int(number), 1, MOST_SAMPLES, 20)
        elif number:
            raise InputError(f"--select {name}: takes no number, found {number[:20]!r}; write --select {name}")
        names.append(name)
    if len(set(names)) < len(names):
        (twice, *_) = [each for each in names if names.count(each) > 1]
        raise InputError(f"--select: {twice} is named twice; name each choice once")
    return names, count


def _show(console: Console, report: Report, comparisons: Sequence[Comparison]) -> None:
    solution = report.solution

    def line(text: str) -> None:
        console.print(text, soft_wrap=True)

    least = report.least_periods
    reached = f"zero needs at least {least} periods" if least else f"zero not reached in {report.searched_periods}"
    line(f"{report.rendezvous.name}: least terminal norm {solution.optimal.miss:.9g}; {reached}")
    line(f"route: {solution.route.value} ({solution.reason})")
    dimension = solution.optimal.dimension
    line(f"optimal controls: {f'a set of dimension {dimension}' if dimension else 'one'}")
    console.print("", _sets_table(report), sep="\n")
    if report.members:
        console.print("", _members_table(report), sep="\n")
    if comparisons:
        console.print("", _published_table(comparisons), sep="\n")
        line("the printed misses do not follow from the equations of motion; see docs/reachability.md")
    if report.flight is not None:
        line(f"\nreplanned every period: nonlinear miss {number(report.flight.miss)}")
        if report.noisy:
            misses = sorted(flight.miss for flight in report.noisy)
            relaxed = max(float(flight.relaxations.max()) for flight in report.noisy)
            line(
                f"with navigation errors, {len(misses)} simulations: median {number(misses[len(misses) // 2])}, "
                f"largest {number(misses[-1])}; constraints relaxed by at most {relaxed:.2%}"
            )
    if report.robustness is not None:
        conflict, plan = report.robustness.conflict, report.robustness.plan
        line(f"\nwith disturbances, without feedback: {conflict or 'controls that keep the constraints exist'}")
        feedback = report.robustness.refusal if plan is None else f"terminal norm at most {number(plan.worst_miss)}"
        line(f"with disturbances, with feedback: {feedback}")


def _sets_table(report: Report) -> Table:
    table = Table("period", box=None, pad_edge=False)
    for title in ("forward\nvertices", "\nfacets", "tube\nvertices", "\nfacets", "tube\nx, m", "\ny, m", "\nz, m"):
        table.add_column(title, justify="right")
    for t in range(1, report.solution.problem.periods + 1):
        cells = [str(t)]
        for kind in (SetKind.FORWARD, SetKind.TUBE):
            counts = report.solution.sets.counts(kind, t)
            cells += ["-", "-"] if counts is None else [str(counts.vertices), str(counts.facets)]
        cells += [f"{low:.1f} .. {high:.1f}" for low, high in report.tube[t, :3] + 0.0]
        table.add_row(*cells)
    return table


def _members_table(report: Report) -> Table:
    table = Table("control", box=None, pad_edge=False)
    for title in ("energy", "L1", "norms", "peak", "nonlinear\nmiss", "beyond bounds\nbetween periods"):
        table.add_column(title, justify="right")
    for each in report.members:
        cost = effort(each.controls)
        cells = [f"{value:.6f}" for value in (cost.energy, cost.l1, cost.norms, cost.peak)]
        miss = float(np.linalg.norm(each.nonlinear[-1]))
        table.add_row(each.name, *cells, f"{miss:.4g}", f"{max(each.between, 0.0):.2%}")
    return table


def _published_table(comparisons: Sequence[Comparison]) -> Table:
    table = Table("paper", "beside", box=None, pad_edge=False)
    for title in ("largest difference\nof a control", "nonlinear miss\nprinted", "\nof the printed u", "\nof ours"):
        table.add_column(title, justify="right")
    for each in comparisons:
        misses = [float(np.linalg.norm(member.nonlinear[-1])) for member in (each.printed, each.ours)]
        cells = [f"{each.largest_difference:.5f}", *(f"{m:.4g}" for m in (each.table.nonlinear_miss, *misses))]
        table.add_row(f"table {each.table.number}", each.table.ours, *cells)
    return table
