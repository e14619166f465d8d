"""`infoset reproduce`: computation, file and tables."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from decimal import Decimal
from importlib import import_module
from typing import Any, NamedTuple

import typer
from rich.text import Text

from infoset.experiments.common.output import output_of, to_json
from infoset.experiments.common.printed_numbers import (
    NumberComparison,
    NumberVerdict,
    Paper,
    PrintedNumber,
    Progress,
    read_paper,
)
from infoset.experiments.common.screen import Part, progress_bar, show
from infoset.experiments.multipoint.command import Multipoint
from infoset.experiments.pursuit.command import Pursuit
from infoset.experiments.reproduce import Reproduce
from infoset.sim.versions import versions

PAPERS = ("interception", "pareto", "multipoint", "reachability", "pursuit")
COMMANDS: Mapping[str, type] = {"multipoint": Multipoint, "pursuit": Pursuit}
"""Options of the commands whose results are compared, by paper.

The other papers have a module `published`.
"""
DISAGREED = 1
"""Exit code if a number that should agree does not."""


def reproduce_paper(paper: Paper, progress: Progress) -> tuple[NumberComparison, ...]:
    """Compute and compare the numbers of a paper; `progress` receives the fraction done."""
    if paper.name in COMMANDS:
        ours = _results_of_command(paper, progress)
    else:
        module = import_module(f"infoset.experiments.{paper.name}.published")
        ours = module.compute(progress)
    progress(1.0)
    return paper.compare(ours)


def _results_of_command(paper: Paper, progress: Progress) -> dict[str, list[float]]:
    """Return the results of a command, by source; the names of the numbers are their JSON keys."""
    command = import_module(f"infoset.experiments.{paper.name}.run").COMMAND
    ours = {}
    for done, (source, numbers) in enumerate(paper.tables.items(), start=1):
        report = command.report(COMMANDS[paper.name](**paper.options[source]))
        results = json.loads(to_json(command.to_json(report)))
        ours[source] = [result_at(results, number.name) for number in numbers]
        progress(done / len(paper.tables))
    return ours


def result_at(results: Any, key: str) -> float:
    """Return the number at a key such as `nodes.0.velocity_m_s.1`.

    NaN if the value, or one of the values that contain it, is None. A key that does not exist is a
    mistake in the file of the paper, and raises.
    """
    for part in key.split("."):
        if results is None:
            return math.nan
        results = results[int(part)] if isinstance(results, list) else results[part]
    if results is None:
        return math.nan
    return float(results)


def run(options: Reproduce) -> None:
    """Compute the numbers, write the file and print the tables."""
    papers = [read_paper(name) for name in PAPERS if options.paper in (None, name)]
    with output_of(options) as written, progress_bar(options.quiet) as begin:
        compared = [reproduce_paper(paper, begin(paper.name)) for paper in papers]
        summary = list(map(_summary, papers, compared))
        written.deliver("--json", to_json({"versions": versions(), "papers": summary}))

    show(_lines(papers, compared), options.quiet or written.stdout_taken)

    wrong = [
        each for numbers in compared for each in numbers if each.verdict is NumberVerdict.DISAGREED
    ]
    for each in wrong:
        number = each.number
        typer.echo(
            f"disagreed: {number.source}, {number.name}: {number.printed}, ours {each.ours.value}",
            err=True,
        )

    if wrong:
        raise typer.Exit(DISAGREED)


def _count(numbers: Sequence[NumberComparison]) -> dict[str, int]:
    return {
        verdict.value: sum(each.verdict is verdict for each in numbers) for verdict in NumberVerdict
    }


def _summary(paper: Paper, numbers: Sequence[NumberComparison]) -> dict[str, object]:
    """Return the numbers of a paper, with their verdicts, in JSON."""
    return {
        "paper": paper.name,
        "title": paper.title,
        "verdicts": _count(numbers),
        "remarks": list(paper.remarks),
        "numbers": list(map(_number_json, numbers)),
    }


def _number_json(each: NumberComparison) -> dict[str, object]:
    number = each.number
    agrees_from, agrees_to = each.band
    return {
        "source": number.source,
        "name": number.name,
        "printed": number.printed,
        "corrected": number.corrected,
        "note": number.note,
        "ours": each.ours.value if math.isfinite(each.ours.value) else None,
        "other_model": each.ours.other,
        "agrees_from": agrees_from,
        "agrees_to": agrees_to,
        "verdict": each.verdict,
    }


def _lines(
    papers: Sequence[Paper], compared: Sequence[Sequence[NumberComparison]]
) -> Iterator[Part]:
    """Yield the numbers of each paper, with its notes and remarks, and the numbers of verdicts."""
    for paper, numbers in zip(papers, compared, strict=True):
        notes = list(dict.fromkeys(each.number.note for each in numbers if each.number.note))
        yield Text(paper.title, style="bold")
        yield from _rows(numbers, notes)
        yield from (f"({i}) {note}." for i, note in enumerate(notes, start=1))
        yield from (f"* {remark}" for remark in paper.remarks)
        yield ""

    for paper, numbers in zip(papers, compared, strict=True):
        counts = ", ".join(
            f"{count} {verdict}" for verdict, count in _count(numbers).items() if count
        )
        yield f"{paper.name}: {len(numbers)} numbers: {counts}"


def _rows(numbers: Sequence[NumberComparison], notes: Sequence[str]) -> Iterator[str]:
    """Yield a line for each number, below its source."""
    rows = [_row(each, notes) for each in numbers]
    titles = _Row("", "published", "ours", "", "verdict")
    if any(row.other for row in rows):
        titles = titles._replace(other="other model")

    # The verdicts, which are the last column, have no width.
    widths = [max(map(len, column)) for column in zip(titles, *rows, strict=True)][:-1]
    yield _line(titles, widths)
    source = ""
    for each, row in zip(numbers, rows, strict=True):
        if each.number.source != source:
            source = each.number.source
            yield f"{source}:"
        yield _line(row, widths)


def _line(row: _Row, widths: Sequence[int]) -> str:
    """Return a line of a table; a column without width is left out."""
    name_width, *number_widths = widths
    cells = [f"{row.name:<{name_width}}"]
    for cell, width in zip(row[1:-1], number_widths, strict=True):
        if width:
            cells.append(f"{cell:>{width}}")
    return "  ".join(["", *cells, row.verdict])


class _Row(NamedTuple):
    """The cells of a number."""

    name: str
    published: str
    ours: str
    other: str
    verdict: str


def _row(each: NumberComparison, notes: Sequence[str]) -> _Row:
    number = each.number
    ours = each.ours
    verdict = each.verdict.value
    if ours.spread is not None:
        low, high = ours.spread
        verdict += f", most of ours: {low:.3g} to {high:.3g}"
    if number.corrected not in {None, number.printed}:
        verdict += f", right: {number.corrected}"
    if number.note:
        verdict += f" ({notes.index(number.note) + 1})"
    other = ""
    if ours.other is not None:
        other = _digits(number, ours.other)
    return _Row(number.name, number.printed, _digits(number, ours.value), other, verdict)


def _digits(number: PrintedNumber, value: float) -> str:
    """Return a computed number with two significant digits more than the published one.

    The published number is the corrected one of a misprint.
    """
    digits = len(Decimal(number.corrected or number.printed).as_tuple().digits) + 2
    return f"{value:#.{digits}g}"
