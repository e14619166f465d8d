"""infoset reach: the sets a rendezvous leads through, all its optimal controls, and what members of them come to."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from experiments.common.options import Html, Json, Out, Overwrite, ProblemName, Quiet, Seed, choice, whole_number

if TYPE_CHECKING:
    from pathlib import Path

    from experiments.reachability.printed_tables import Comparison
    from experiments.reachability.report import Report

FIGURES = ("figure-positions", "figure-velocities", "figure-planes", "figure-controls")
TABLES = "published-tables.csv"
DEFAULT_SELECTION = "energy,l1,norms,peak,chebyshev,analytic"
MOST_NOISY_FLIGHTS = 1000


def reach(
    problem: ProblemName = "rendezvous-2021",
    select: Annotated[
        str,
        typer.Option(
            "--select",
            metavar="A,B,C",
            help="Optimal controls to show: energy, l1, norms (least sums of squares, absolute values, Euclidean "
            "norms), peak, chebyshev, analytic, vertices, samples:N.",
        ),
    ] = DEFAULT_SELECTION,
    route: Annotated[
        str, typer.Option("--route", metavar="NAME", help="How sets are found: auto, exact or lifted.")
    ] = "auto",
    replan: Annotated[
        bool, typer.Option("--replan", help="Also fly in closed loop: a new plan every period, on the nonlinear truth.")
    ] = False,
    noisy_flights: Annotated[
        int,
        typer.Option("--noisy-flights", metavar="N", help="How often, where the problem has errors of navigation."),
    ] = 10,
    seed: Seed = 0,
    out: Out = None,
    json_: Json = None,
    html: Html = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> None:
    """Find every optimal control of a rendezvous under constraints, and the sets of states on the way.

    Least terminal norm, forward sets, the tube, and all optimal controls as one set; members of it by choice, each
    flown on the linear model and on the nonlinear truth. Without --out, --json or --html nothing is
    written.
    """
    from experiments.common.output import STDOUT, checked_destinations, deliver, to_csv, to_json, write_file
    from experiments.common.page_document import page_path
    from experiments.common.screen import figure_files, progress_bar, say
    from experiments.reachability.file import load_rendezvous
    from experiments.reachability.printed_tables import COLUMNS, compare_published, comparison_rows, is_published
    from experiments.reachability.report import make_report, report_json
    from rendezvous.reachability import Route

    page_path("--html", html)
    names, sample_count = _selection(select)
    chosen = choice("--route", route, ["auto", *(each.value for each in Route)])
    whole_number("--noisy-flights", noisy_flights, 0, MOST_NOISY_FLIGHTS, 10)
    whole_number("--seed", seed, 0, None, 0)
    given = load_rendezvous(problem)
    published = is_published(given)
    files = ("results.json", *((TABLES,) if published else ()), *figure_files(*FIGURES))
    with (
        checked_destinations(folder=out, names=files, files={"--json": json_, "--html": html}, overwrite=overwrite),
        progress_bar(quiet) as begin,
    ):
        report = make_report(
            given,
            names,
            sample_count=sample_count,
            seed=seed,
            route=None if chosen == "auto" else Route(chosen),
            closed_loop=replan,
            noisy_flights=noisy_flights,
            progress=begin(given.name),
        )
        comparisons = compare_published(given, report.solution) if published else ()
        json_text = to_json(report_json(report))
        deliver(json_, json_text, overwrite=overwrite)
        if html is not None:
            from experiments.reachability.page import reachability_page

            write_file(html, reachability_page(report), overwrite=overwrite)
        if out is not None:
            write_file(out / "results.json", json_text, overwrite=overwrite)
            if comparisons:
                write_file(out / TABLES, to_csv(COLUMNS, comparison_rows(comparisons)), overwrite=overwrite)
            _draw(out, report, begin("figures"))
    if out is not None:
        say(f"figures and results are in {out}", quiet)
    if not quiet:
        _show(report, comparisons, str(json_) == STDOUT)


def _selection(text: str) -> tuple[list[str], int]:
    """Return the names chosen, and how many samples."""
    from experiments.common.errors import InputError
    from experiments.reachability.report import MOST_SAMPLES, SAMPLES, SINGLE, VERTICES

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


def _draw(folder: Path, report: Report, progress: Callable[[float], None]) -> None:
    from experiments.common.errors import InputError
    from experiments.common.figure_style import save_figure
    from experiments.common.output import reporting_failures
    from experiments.reachability.figures import draw_reach

    try:
        figures = list(draw_reach(report, progress))
    except ArithmeticError as error:
        raise InputError(f"the tube could not be drawn: {error}; the results themselves are in {folder}") from None
    for place, (name, figure) in enumerate(zip(FIGURES, figures, strict=True)):
        with reporting_failures(folder):
            save_figure(figure, folder, name)
        progress(0.8 + 0.2 * (place + 1) / len(FIGURES))


def _show(report: Report, comparisons: Sequence[Comparison], stdout_taken: bool) -> None:
    from rich.text import Text

    from experiments.common.screen import number, table_console

    console = table_console(stdout_taken)
    solution, name = report.solution, report.rendezvous.name

    def line(text: str) -> None:
        console.print(Text(text), soft_wrap=True)

    miss = solution.optimal.miss
    least = report.least_periods
    periods = f"zero takes {least} periods at least" if least else f"zero is not reached in {report.searched_periods}"
    line(f"{name}: least terminal norm {miss:.9g}; {periods}")
    line(f"route: {solution.route.value} ({solution.reason})")
    dimension = solution.optimal.dimension
    line(f"optimal controls: {f'a set of dimension {dimension}' if dimension else 'one'}")
    console.print()
    console.print(_sets_table(report))
    if report.members:
        console.print()
        console.print(_members_table(report))
    if comparisons:
        console.print()
        console.print(_published_table(comparisons))
        line("the printed misses do not follow from the equations of motion; see docs/reachability.md")
    if report.flight is not None:
        console.print()
        line(f"replanned every period: nonlinear miss {number(report.flight.miss)}")
        if report.noisy:
            misses = sorted(each.miss for each in report.noisy)
            relaxed = max(float(each.relaxations.max()) for each in report.noisy)
            line(
                f"with errors of navigation, {len(misses)} flights: median {number(misses[len(misses) // 2])}, worst "
                f"{number(misses[-1])}; constraints relaxed by {relaxed:.2%} at most"
            )
    if report.robustness is not None:
        console.print()
        found = report.robustness
        line(f"disturbed, without feedback: {found.conflict or 'controls that keep the constraints exist'}")
        plan = found.plan
        line(
            f"disturbed, with feedback: "
            f"{found.refusal if plan is None else f'terminal norm at most {number(plan.worst_miss)}, whatever it does'}"
        )


def _sets_table(report: Report) -> object:
    from rich.table import Table

    table = Table("period", box=None, pad_edge=False)
    for title in ("forward\nvertices", "\nfacets", "tube\nvertices", "\nfacets", "tube\nx, m", "\ny, m", "\nz, m"):
        table.add_column(title, justify="right")
    from rendezvous.reachability import SetKind

    for t in range(1, report.solution.problem.periods + 1):
        cells = [str(t)]
        for kind in (SetKind.FORWARD, SetKind.TUBE):
            counts = report.solution.sets.counts(kind, t)
            cells += ["-", "-"] if counts is None else [str(counts.vertices), str(counts.facets)]
        cells += [f"{low:.1f} .. {high:.1f}" for low, high in report.tube[t, :3] + 0.0]
        table.add_row(*cells)
    return table


def _members_table(report: Report) -> object:
    import numpy as np
    from rich.table import Table

    from rendezvous.reachability.selection import effort

    table = Table("control", box=None, pad_edge=False)
    for title in ("energy", "L1", "norms", "peak", "nonlinear\nmiss", "beyond bounds\nbetween periods"):
        table.add_column(title, justify="right")
    for each in report.members:
        cost = effort(each.controls)
        cells = [f"{value:.6f}" for value in (cost.energy, cost.l1, cost.norms, cost.peak)]
        miss = float(np.linalg.norm(each.nonlinear[-1]))
        table.add_row(each.name, *cells, f"{miss:.4g}", f"{max(each.between, 0.0):.2%}")
    return table


def _published_table(comparisons: Sequence[Comparison]) -> object:
    import numpy as np
    from rich.table import Table

    table = Table("paper", "beside", box=None, pad_edge=False)
    for title in ("largest difference\nof a control", "nonlinear miss\nprinted", "\nof the printed u", "\nof ours"):
        table.add_column(title, justify="right")
    for each in comparisons:
        misses = [float(np.linalg.norm(member.nonlinear[-1])) for member in (each.printed, each.ours)]
        cells = [f"{each.largest_difference:.5f}", *(f"{m:.4g}" for m in (each.table.nonlinear_miss, *misses))]
        table.add_row(f"table {each.table.number}", each.table.ours, *cells)
    return table
