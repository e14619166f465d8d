"""`infoset reproduce`: computation, file and tables."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from decimal import Decimal
from importlib import import_module
from typing import Any

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
"""Options of the commands whose results are compared, by paper; the other papers have a module
`published`.
"""
DISAGREED = 1
"""Exit code if a number that should agree does not."""


def reproduce_paper(paper: Paper, progress: Progress) -> tuple[NumberComparison, ...]:
    """Compute and compare the numbers of a paper; `progress` receives the fraction done."""
    if paper.name not in COMMANDS:
        ours = import_module(f"infoset.experiments.{paper.name}.published").compute(progress)
    else:
        command = import_module(f"infoset.experiments.{paper.name}.run").COMMAND
        ours = {}
        for done, (source, numbers) in enumerate(paper.tables.items(), start=1):
            report = command.report(COMMANDS[paper.name](**paper.options[source]))
            results = json.loads(to_json(command.to_json(report)))
            ours[source] = [_value(results, number.name) for number in numbers]
            progress(done / len(paper.tables))
    progress(1.0)
    return paper.compare(ours)


def _value(results: Any, key: str) -> float:
    """Return the number at a key such as `nodes.0.velocity_m_s.1`; NaN if there is none."""
    for part in key.split("."):
        results = results and results[int(part) if isinstance(results, list) else part]
    return math.nan if results is None else float(results)


def run(options: Reproduce) -> None:
    """Compute the numbers, write the file and print the tables."""
    papers = [read_paper(name) for name in PAPERS if options.paper in (None, name)]
    with output_of(options) as written, progress_bar(options.quiet) as begin:
        compared = [reproduce_paper(paper, begin(paper.name)) for paper in papers]
        summary = [
            _summary(paper, numbers) for paper, numbers in zip(papers, compared, strict=True)
        ]
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
    return {
        "paper": paper.name,
        "title": paper.title,
        "verdicts": _count(numbers),
        "remarks": list(paper.remarks),
        "numbers": [
            {
                **{
                    key: getattr(each.number, key)
                    for key in ("source", "name", "printed", "corrected", "note")
                },
                "ours": each.ours.value if math.isfinite(each.ours.value) else None,
                "other_model": each.ours.other,
                "agrees_from": each.band[0],
                "agrees_to": each.band[1],
                "verdict": each.verdict,
            }
            for each in numbers
        ],
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
    titles = ("", "published", "ours", "other model" if any(row[3] for row in rows) else "")
    widths = [max(len(row[column]) for row in (titles, *rows)) for column in range(4)]
    sources = [each.number.source for each in numbers]
    for source, before, row in zip(
        ["", *sources], ["", "", *sources], [(*titles, "verdict"), *rows], strict=False
    ):
        if source != before:
            yield f"{source}:"
        name, *cells = (
            f"{cell:>{width}}" for cell, width in zip(row, widths, strict=False) if width
        )
        yield "  ".join(["", f"{row[0]:<{len(name)}}", *cells, row[4]])


def _row(each: NumberComparison, notes: Sequence[str]) -> tuple[str, ...]:
    number = each.number
    ours = each.ours
    verdict = each.verdict.value
    if ours.spread is not None:
        verdict += f", most of ours: {ours.spread[0]:.3g} to {ours.spread[1]:.3g}"
    if number.corrected not in {None, number.printed}:
        verdict += f", right: {number.corrected}"
    if number.note:
        verdict += f" ({notes.index(number.note) + 1})"
    other = "" if ours.other is None else _digits(number, ours.other)
    return number.name, number.printed, _digits(number, ours.value), other, verdict


def _digits(number: PrintedNumber, value: float) -> str:
    """Return a computed number with at least two digits more than the printed one."""
    digits = len(Decimal(number.corrected or number.printed).as_tuple().digits) + 2
    return f"{value:#.{digits}g}"
