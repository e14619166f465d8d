"""`infoset reach`: computation, files and tables."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain

import numpy as np
from rich.table import Table

from experiments.common.errors import InputError
from experiments.common.hill_axes import AXES
from experiments.common.input_file import to_toml
from experiments.common.options import choice, read_number
from experiments.common.output import TRAJECTORIES, output_of, to_csv, to_json
from experiments.common.screen import Part, figure_files, number, number_table, progress_bar, show
from experiments.reachability.command import Reach
from experiments.reachability.file import load_rendezvous
from experiments.reachability.page import reachability_page
from experiments.reachability.printed_tables import (
    CHOICES,
    COLUMNS,
    TableComparison,
    compare_published,
    is_published,
)
from experiments.reachability.report import (
    MAX_SAMPLES,
    SAMPLES,
    SINGLE,
    VERTICES,
    Report,
    Request,
    delta_v,
    make_report,
    report_json,
    trajectories,
)
from rendezvous.reachability import Route, SetKind, ThrustShape, effort

TABLES = "published-tables.csv"
FIGURES = ("figure-positions", "figure-velocities", "figure-planes", "figure-controls")
_COUNTED = ("vertices", "facets")
_NORM = "(m, m/s)"
"""Unit of a norm of states."""


def run(options: Reach) -> None:
    """Solve the problem, write the files and print the tables."""
    names, samples = _selection(options.select)
    route = None if options.route == "auto" else Route(options.route)
    request = Request(names, samples, options.seed, route, options.replan, options.noisy_flights)
    rendezvous = load_rendezvous(options.problem, options.settings)
    published = is_published(rendezvous)
    files = ("problem.toml", "results.json", TRAJECTORIES, *((TABLES,) if published else ()), *figure_files(*FIGURES))
    with output_of(options, files) as written, progress_bar(options.quiet) as begin:
        report = make_report(rendezvous, request, begin(rendezvous.name))
        comparisons = compare_published(rendezvous, report.solution) if published else ()
        results = report_json(report)
        tracks = trajectories(report) if written.wants("--csv") else ""
        written.save("problem.toml", to_toml(rendezvous))
        written.save("results.json", to_json(results), "--json")
        if comparisons:
            written.save(TABLES, to_csv(COLUMNS, [row for comparison in comparisons for row in comparison.rows]))
        written.save(TRAJECTORIES, tracks, "--csv")
        try:
            if options.html is not None:
                written.deliver("--html", reachability_page(report))
            if options.out is not None:
                from experiments.reachability.figures import draw_all

                written.draw(FIGURES, draw_all(report), begin("figures"))
        except ArithmeticError as error:
            raise InputError(
                f"cannot draw the tube: {error}; the numbers are in results.json, or use --json alone"
            ) from None
    parts = chain(_summary(report), _tables(report, comparisons), _feedback(report))
    show(parts, options.quiet, stdout_taken=written.stdout_taken)


def _selection(text: str) -> tuple[list[str], int]:
    """Return the names of the selection, and the number of samples."""
    names, count = [], 0
    for part in text.split(","):
        name, _, digits = part.strip().partition(":")
        name = choice("--select", name, [*SINGLE, VERTICES, SAMPLES])
        if name in names:
            raise InputError(f"--select: {name} is named twice; name each choice once")
        if name == SAMPLES:
            count = read_number(
                f"--select {SAMPLES}", int, digits, minimum=1, maximum=MAX_SAMPLES, example="--select samples:20"
            )
        elif digits:
            raise InputError(f"--select {name}: takes no number, found {digits[:20]!r}; write --select {name}")
        names.append(name)
    return names, count


def _summary(report: Report) -> Iterator[str]:
    solution, minimum = report.solution, report.min_periods
    dimension = solution.optimal.dimension
    reached = f"norm 0 not reached in {report.searched_periods} periods"
    if minimum is not None:
        reached = f"norm 0 needs at least {minimum} period{'s' if minimum > 1 else ''}"
    yield f"{report.rendezvous.name}: minimum terminal norm {solution.optimal.miss:.9g} {_NORM}; {reached}"
    yield f"route: {solution.route.value} ({solution.reason})"
    yield f"optimal controls: {f'a set of dimension {dimension}' if dimension else 'one'}"
    yield f"axes: {AXES}"
    ball = report.rendezvous.problem.thrust is ThrustShape.BALL
    engines = "the periods, of one engine that turns" if ball else "the three axes"
    yield (
        f"units: {_NORM} is the norm of a state whose components are in m and m/s; controls u are in units of "
        f"{report.rendezvous.acceleration_m_s2:g} m/s^2; Delta-v is the sum over {engines}"
    )


def _feedback(report: Report) -> Iterator[str]:
    if report.flight is not None:
        used = delta_v(report.rendezvous, report.flight.controls)["sum"]
        yield f"\nreplanned every period: nonlinear miss {number(report.flight.miss)} {_NORM}, Delta-v {used:.4f} m/s"
    if report.noisy:
        misses = [flight.miss for flight in report.noisy]
        relaxed = max(float(flight.relaxations.max()) for flight in report.noisy)
        yield (
            f"with navigation errors, {len(misses)} simulations: median {number(float(np.median(misses)))}, "
            f"largest {number(max(misses))} {_NORM}; constraints relaxed by at most {relaxed:.2%}"
        )
    if report.robustness is not None:
        conflict, plan = report.robustness.conflict, report.robustness.plan
        yield f"\nwith disturbances, without feedback: {conflict or 'controls that keep the constraints exist'}"
        bound = (
            report.robustness.refusal if plan is None else f"terminal norm at most {number(plan.worst_miss)} {_NORM}"
        )
        yield f"with disturbances, with feedback: {bound}"


def _tables(report: Report, comparisons: Sequence[TableComparison]) -> Iterator[Part]:
    sets, periods = report.solution.sets, range(1, report.solution.problem.periods + 1)
    counts = [[sets.counts(kind, t) for kind in (SetKind.FORWARD, SetKind.TUBE)] for t in periods]
    if any(count is not None for row in counts for count in row):
        table = number_table("period", *(f"{name}\n{what}" for name in ("forward", "tube") for what in _COUNTED))
        for t, row in zip(periods, counts, strict=True):
            cells = (("-", "-") if count is None else (count.vertices, count.facets) for count in row)
            table.add_row(str(t), *(str(cell) for pair in cells for cell in pair))
        yield from ("", table)
    table = number_table("period", *(f"{axis} of the tube\nm" for axis in "xyz"))
    for t in periods:
        table.add_row(str(t), *(f"{low:.1f} .. {high:.1f}" for low, high in report.tube[t, :3] + 0.0))
    yield from ("", table)
    if report.members:
        yield from ("", _members_table(report))
    if comparisons:
        yield from ("", _published_table(comparisons))
        yield "the misses printed in the paper do not follow from the equations of motion; see docs/reachability.md"


def _members_table(report: Report) -> Table:
    titles = (
        *(f"{name}\n{unit}" for name, unit in (("energy", "u^2"), ("L1", "u"), ("norms", "u"), ("peak", "u"))),
        "Delta-v\nm/s",
        *(f"along {axis}\nm/s" for axis in "xyz"),
        f"nonlinear miss\n{_NORM}",
        "violation between\nperiods",
    )
    table = number_table("control", *titles)
    for member in report.members:
        costs = (f"{value:.6f}" for value in vars(effort(member.controls)).values())
        used = (f"{value:.4f}" for value in delta_v(report.rendezvous, member.controls).values())
        violation = f"{max(member.between, 0.0):.2%}"
        table.add_row(member.name, *costs, *used, f"{member.nonlinear_miss:.4g}", violation)
    return table


def _published_table(comparisons: Sequence[TableComparison]) -> Table:
    titles = (
        "largest difference\nof a control, u",
        f"nonlinear miss\nas printed, {_NORM}",
        f"with the\nprinted u, {_NORM}",
        f"with our\ncontrol, {_NORM}",
    )
    table = number_table("paper", "our control", *titles, left=2)
    for comparison in comparisons:
        printed = comparison.table.numbers[-1].value
        misses = (printed, comparison.printed.nonlinear_miss, comparison.ours.nonlinear_miss)
        row = [f"{comparison.max_difference:.5f}", *(f"{miss:.4g}" for miss in misses)]
        table.add_row(comparison.name, CHOICES[comparison.name], *row)
    return table
