"""`infoset reproduce`: computation, file and tables."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from decimal import Decimal
from importlib import import_module
from itertools import groupby

import typer
from rich.text import Text

from experiments.common.output import output_of, to_json
from experiments.common.printed_numbers import Comparison, Origin, PrintedNumber, Progress, Reproduction, Verdict
from experiments.common.screen import Part, print_parts, progress_bar, table_console
from experiments.reproduce import Reproduce
from sim.versions import versions

PAPERS = ("interception", "pareto", "multipoint", "reachability", "pursuit")


def reproduce_paper(name: str, progress: Progress) -> Reproduction:
    """Compute the numbers of a paper of `PAPERS`; `progress` receives the fraction done."""
    reproduction = import_module(f"experiments.{name}.published").reproduce(progress)
    assert isinstance(reproduction, Reproduction)
    return reproduction


DISAGREED = 1
"""Exit code if a number that should agree does not."""


def run(options: Reproduce) -> None:
    """Compute the numbers, write the file and print the tables."""
    papers = PAPERS if options.paper is None else (options.paper,)
    with output_of(options) as written, progress_bar(options.quiet) as begin:
        reproductions = [reproduce_paper(name, begin(name)) for name in papers]
        summary = {"versions": versions(), "papers": [_summary(each) for each in reproductions]}
        written.deliver("--json", to_json(summary))
    if not options.quiet:
        console = table_console(written.stdout_taken)
        print_parts(console, _parts(reproductions, console.width))
    for each in reproductions:
        for number, ours in [(it.number, it.ours) for it in each.numbers if it.verdict is Verdict.DISAGREED]:
            theirs = f"{TITLES[number.origin]}: {number.printed}"
            typer.echo(
                f"disagreed: {each.paper.name}, {number.source}, {number.name}: {theirs}, ours {ours.value}", err=True
            )
    if any(each.count(Verdict.DISAGREED) for each in reproductions):
        raise typer.Exit(DISAGREED)


def _summary(reproduction: Reproduction) -> dict[str, object]:
    return {
        "paper": reproduction.paper.name,
        "title": reproduction.paper.title,
        "problems": [{"name": name, "hash": fingerprint} for name, fingerprint in reproduction.problems],
        "verdicts": {verdict.value: reproduction.count(verdict) for verdict in Verdict},
        "remarks": list(reproduction.paper.remarks),
        "numbers": [_entry(each) for each in reproduction.numbers],
    }


def _entry(each: Comparison) -> dict[str, object]:
    number, ours = each.number, each.ours
    finite = ours.value is not None and abs(ours.value) < float("inf")
    return {
        "source": number.source,
        "name": number.name,
        "origin": number.origin.value,
        "printed": number.printed,
        "corrected": number.corrected,
        "ours": ours.value if finite else None,
        "other_model": ours.other,
        "agrees_from": each.band.lowest,
        "agrees_to": each.band.highest,
        "agrees_by": "ours" if ours.spread is None else "printed",
        "verdict": each.verdict.value,
        "note": number.note,
    }


TITLES = {Origin.PRINTED: "paper prints", Origin.OTHER: "other program", Origin.EXACT: "exact"}
ONE_RUN = ("paper, one run", "our median", "other model", "5 to 95 % of ours")


def _parts(reproductions: Sequence[Reproduction], width: int) -> Iterator[Part]:
    for reproduction in reproductions:
        notes = list(dict.fromkeys(each.number.note for each in reproduction.numbers if each.number.note))
        yield Text(reproduction.paper.title, style="bold")
        for _, block in groupby(reproduction.numbers, lambda each: (each.number.origin, each.ours.spread is None)):
            yield from _block([*block], notes, width)
            yield ""
        yield from (f"({i}) {note}." for i, note in enumerate(notes, start=1))
        yield from (f"* {remark}" for remark in reproduction.paper.remarks)
        yield ""
    for reproduction in reproductions:
        counts = [(reproduction.count(verdict), verdict.value) for verdict in Verdict]
        listed = ", ".join(f"{count} {verdict}" for count, verdict in counts if count)
        yield f"{reproduction.paper.name}: {len(reproduction.numbers)} numbers: {listed}"


def _block(block: Sequence[Comparison], notes: Sequence[str], width: int) -> Iterator[str]:
    """Yield the lines of numbers of one origin; if `width` is too small for a line, the name stands above the rest."""
    first = block[0]
    titles = (TITLES[first.number.origin], "ours", "other model", "tolerance") if first.ours.spread is None else ONE_RUN
    rows = [("", *titles, "verdict"), *(_row(each, notes) for each in block)]
    if all(each.ours.other is None for each in block):
        rows = [(*row[:3], *row[4:]) for row in rows]
    sizes = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    above = sum(sizes) + 2 * len(sizes) > width
    sources = ["", *(each.number.source for each in block)]
    for before, source, (name, *cells, verdict) in zip(["", *sources], sources, rows, strict=False):
        if source != before:
            yield f"{source}:"
        if above and name:
            yield f"  {name}"
        begin = "  " if above else f"  {name:<{sizes[0]}}"
        yield "  ".join([begin, *(f"{cell:>{size}}" for cell, size in zip(cells, sizes[1:], strict=False)), verdict])


def _row(each: Comparison, notes: Sequence[str]) -> tuple[str, ...]:
    number, ours = each.number, each.ours
    note = f" ({notes.index(number.note) + 1})" if number.note else ""
    right = f", right: {number.corrected}" if number.corrected not in {None, number.printed} else ""
    other = "" if ours.other is None else _digits(number, ours.other)
    verdict = f"{each.verdict.value}{right}{note}"
    return number.name, number.printed, _digits(number, ours.value), other, _tolerance(each), verdict


def _digits(number: PrintedNumber, value: float | None) -> str:
    """Return a computed number with one or two digits more than the printed one."""
    if value is None:
        return "none"
    known = Decimal(number.corrected or number.printed).as_tuple()
    assert isinstance(known.exponent, int)
    if "e" in number.printed and value:
        text = f"{value:.{len(known.digits)}e}"
    else:
        text = f"{value:.{max(0, -known.exponent) + 2}f}"
    return text.removeprefix("-") if float(text) == 0.0 else text


def _tolerance(each: Comparison) -> str:
    below, above = each.number.value - each.band.lowest, each.band.highest - each.number.value
    if each.ours.spread is None and abs(above - below) <= 1e-3 * max(above, below):
        return f"{0.5 * (below + above):.2g}"
    return f"{each.band.lowest:.3g} .. {each.band.highest:.3g}"
