"""`infoset reproduce`: computation, file and tables."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from decimal import Decimal
from importlib import import_module
from itertools import groupby

import typer
from rich.text import Text

from experiments.common.output import library_version, output_of, to_json
from experiments.common.published_number import Origin, Progress, PublishedNumber, Reproduction, Verdict
from experiments.common.screen import Part, print_parts, progress_bar, table_console
from experiments.reproduce import Reproduce

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
        summary = {"version": library_version(), "papers": [_summary(each) for each in reproductions]}
        written.deliver("--json", to_json(summary))
    if not options.quiet:
        console = table_console(written.stdout_taken)
        print_parts(console, _parts(reproductions, console.width))
    disagreed = [number for each in reproductions for number in each.numbers if number.verdict is Verdict.DISAGREED]
    for number in disagreed:
        typer.echo(
            f"disagreed: {number.paper}, {number.source}, {number.name}: {TITLES[number.origin][0]}: {number.printed}, "
            f"ours {number.ours}",
            err=True,
        )
    if disagreed:
        raise typer.Exit(DISAGREED)


def _summary(reproduction: Reproduction) -> dict[str, object]:
    return {
        "paper": reproduction.paper,
        "title": reproduction.title,
        "problems": [{"name": name, "hash": fingerprint} for name, fingerprint in reproduction.problems],
        "verdicts": {verdict.value: reproduction.count(verdict) for verdict in Verdict},
        "remarks": list(reproduction.remarks),
        "numbers": [_number(number) for number in reproduction.numbers],
    }


def _number(number: PublishedNumber) -> dict[str, object]:
    finite = number.ours is not None and abs(number.ours) < float("inf")
    return {
        "source": number.source,
        "name": number.name,
        "origin": number.origin.value,
        "printed": number.printed,
        "corrected": number.corrected,
        "ours": number.ours if finite else None,
        "other_model": number.other,
        "agrees_from": number.band.lowest,
        "agrees_to": number.band.highest,
        "agrees_by": "ours" if number.spread is None else "printed",
        "verdict": number.verdict.value,
        "note": number.note,
    }


TITLES = {
    Origin.PRINTED: ("paper prints", "tolerance"),
    Origin.OTHER: ("other program", "tolerance"),
    Origin.EXACT: ("exact", "tolerance"),
}
ONE_RUN = ("paper, one run", "5 to 95 % of ours")


def _parts(reproductions: Sequence[Reproduction], width: int) -> Iterator[Part]:
    for reproduction in reproductions:
        notes = list(dict.fromkeys(number.note for number in reproduction.numbers if number.note))
        yield Text(reproduction.title, style="bold")
        for _, numbers in groupby(reproduction.numbers, lambda number: (number.origin, number.spread is None)):
            yield from _block([*numbers], notes, width)
            yield ""
        yield from (f"({i}) {note}." for i, note in enumerate(notes, start=1))
        yield from (f"* {remark}" for remark in reproduction.remarks)
        yield ""
    for reproduction in reproductions:
        counts = [(reproduction.count(verdict), verdict.value) for verdict in Verdict]
        listed = ", ".join(f"{count} {verdict}" for count, verdict in counts if count)
        yield f"{reproduction.paper}: {len(reproduction.numbers)} numbers: {listed}"


def _block(numbers: Sequence[PublishedNumber], notes: Sequence[str], width: int) -> Iterator[str]:
    """Yield the lines of numbers of one origin; if `width` is too small for a line, the name stands above the rest."""
    theirs, tolerance = TITLES[numbers[0].origin] if numbers[0].spread is None else ONE_RUN
    ours = "ours" if numbers[0].spread is None else "our median"
    rows: list[tuple[str, ...]] = [("", theirs, ours, "other model", tolerance, "verdict")]
    for number in numbers:
        note = f" ({notes.index(number.note) + 1})" if number.note else ""
        right = f", right: {number.corrected}" if number.corrected not in {None, number.printed} else ""
        verdict = f"{number.verdict.value}{right}{note}"
        other = "" if number.other is None else _digits(number, number.other)
        rows.append((number.name, number.printed, _digits(number, number.ours), other, _tolerance(number), verdict))
    if all(number.other is None for number in numbers):
        rows = [(*row[:3], *row[4:]) for row in rows]
    sizes = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    above = sum(sizes) + 2 * len(sizes) > width
    sources = ["", *(number.source for number in numbers)]
    for before, source, (name, *cells, verdict) in zip(["", *sources], sources, rows, strict=False):
        if source != before:
            yield f"{source}:"
        if above and name:
            yield f"  {name}"
        first = "  " if above else f"  {name:<{sizes[0]}}"
        yield "  ".join([first, *(f"{cell:>{size}}" for cell, size in zip(cells, sizes[1:], strict=False)), verdict])


def _digits(number: PublishedNumber, value: float | None) -> str:
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


def _tolerance(number: PublishedNumber) -> str:
    band, printed = number.band, float(number.printed)
    below, above = printed - band.lowest, band.highest - printed
    if number.spread is None and abs(above - below) <= 1e-3 * max(above, below):
        return f"{0.5 * (below + above):.2g}"
    return f"{band.lowest:.3g} .. {band.highest:.3g}"
