"""infoset reproduce: the numbers of the five papers beside ours."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from experiments.common.options import Json, Overwrite, Quiet, choice

if TYPE_CHECKING:
    from rich.table import Table

    from experiments.common.published_number import PublishedNumber, Reproduction

DISAGREED = 1
"""Exit code where a number that should agree does not."""


def reproduce(
    paper: Annotated[
        str | None,
        typer.Option(
            "--paper",
            metavar="NAME",
            help="One paper alone: interception, pareto, multipoint, reachability or pursuit.",
        ),
    ] = None,
    json_: Json = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> None:
    """Compute every number of the five papers, and print it beside the published one.

    Each number has its table or equation, the tolerance that its printed digits leave, and a verdict: agreed, misprint
    (with what is right, and why), or not explained (with what was tried). Exit code 1 tells that a number that should
    agree does not. Where a paper prints no results, reference values stand in their place. Without --json nothing is
    written.
    """
    from experiments.common.output import STDOUT, checked_destinations, deliver, to_json
    from experiments.papers import PAPERS, reproduce_paper

    chosen = PAPERS if paper is None else (choice("--paper", paper, PAPERS),)
    with checked_destinations(files={"--json": json_}, overwrite=overwrite):
        _tell_of_compiling(chosen, quiet)
        from experiments.common.screen import progress_bar

        with progress_bar(quiet) as begin:
            found = [reproduce_paper(name, begin(name)) for name in chosen]
        json_text = to_json(_summary(found))
        deliver(json_, json_text, overwrite=overwrite)
    if not quiet:
        _show(found, str(json_) == STDOUT)
    wrong = [number for each in found for number in each.numbers if _is_wrong(number)]
    for number in wrong:
        typer.echo(
            f"disagreed: {number.paper}, {number.source}, {number.name}: printed {number.printed}, ours {number.ours}",
            err=True,
        )
    if wrong:
        raise typer.Exit(DISAGREED)


def _is_wrong(number: PublishedNumber) -> bool:
    from experiments.common.published_number import Verdict

    return number.verdict is Verdict.DISAGREED


def _tell_of_compiling(papers: Sequence[str], quiet: bool) -> None:
    from experiments.common.screen import (
        tell_of_compiling,
        tell_of_compiling_pursuit,
        tell_of_compiling_rendezvous,
    )

    if "interception" in papers:
        tell_of_compiling(quiet)
    if "pareto" in papers or "multipoint" in papers:
        tell_of_compiling_rendezvous(quiet)
    if "pursuit" in papers:
        tell_of_compiling_pursuit(quiet)


def _summary(found: Sequence[Reproduction]) -> dict[str, object]:
    from experiments.common.output import library_version

    return {"version": library_version(), "papers": [_paper(each) for each in found]}


def _paper(reproduction: Reproduction) -> dict[str, object]:
    from experiments.common.published_number import Verdict

    return {
        "paper": reproduction.paper,
        "title": reproduction.title,
        "problems": [{"name": name, "hash": fingerprint} for name, fingerprint in reproduction.problems],
        "verdicts": {verdict.value: reproduction.count(verdict) for verdict in Verdict},
        "remarks": list(reproduction.remarks),
        "numbers": [_number(each) for each in reproduction.numbers],
    }


def _number(number: PublishedNumber) -> dict[str, object]:
    finite = number.ours is not None and abs(number.ours) < float("inf")
    return {
        "source": number.source,
        "name": number.name,
        "printed": number.printed,
        "corrected": number.corrected,
        "ours": number.ours if finite else None,
        "agrees_from": number.band.lowest,
        "agrees_to": number.band.highest,
        "agrees_by": "ours" if number.spread is None else "printed",
        "verdict": number.verdict.value,
        "note": number.note,
    }


def _show(found: Sequence[Reproduction], stdout_taken: bool) -> None:
    from rich.text import Text

    from experiments.common.screen import table_console

    console = table_console(stdout_taken)
    for each in found:
        notes = list(dict.fromkeys(number.note for number in each.numbers if number.note))
        console.print(Text(each.title, style="bold"), soft_wrap=True)
        console.print(_table(each, notes))
        for place, note in enumerate(notes, start=1):
            console.print(Text(f"({place}) {note}."), soft_wrap=True)
        for remark in each.remarks:
            console.print(Text(f"* {remark}"), soft_wrap=True)
        console.print()
    for each in found:
        console.print(Text(f"{each.paper}: {_counts(each)}"), soft_wrap=True)


def _counts(reproduction: Reproduction) -> str:
    from experiments.common.published_number import Verdict

    counts = [f"{reproduction.count(verdict)} {verdict.value}" for verdict in Verdict if reproduction.count(verdict)]
    return f"{len(reproduction.numbers)} numbers: {', '.join(counts)}"


def _table(reproduction: Reproduction, notes: Sequence[str]) -> Table:
    from itertools import groupby

    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, pad_edge=False)
    table.add_column("number", min_width=16, overflow="fold")
    for title in ("printed", "ours", "tolerance"):
        table.add_column(title, justify="right", no_wrap=True)
    table.add_column("verdict", min_width=13)
    for source, numbers in groupby(reproduction.numbers, lambda number: number.source):
        table.add_row(Text(source, style="bold"))
        for number in numbers:
            note = f" ({notes.index(number.note) + 1})" if number.note else ""
            mended = f"\n({number.corrected})" if number.corrected not in {None, number.printed} else ""
            table.add_row(
                number.name,
                f"{number.printed}{mended}",
                _digits(number),
                _tolerance(number),
                f"{number.verdict.value}{note}",
            )
    return table


def _digits(number: PublishedNumber) -> str:
    """Return ours with a digit or two more than are printed."""
    from decimal import Decimal

    if number.ours is None:
        return "none"
    known = Decimal(number.corrected or number.printed).as_tuple()
    assert isinstance(known.exponent, int)
    if "e" in number.printed and number.ours:
        text = f"{number.ours:.{len(known.digits)}e}"
    else:
        text = f"{number.ours:.{max(0, -known.exponent) + 2}f}"
    return text.removeprefix("-") if float(text) == 0.0 else text


def _tolerance(number: PublishedNumber) -> str:
    band, printed = number.band, float(number.printed)
    below, above = printed - band.lowest, band.highest - printed
    if number.spread is None and abs(above - below) <= 1e-3 * max(above, below):
        return f"{0.5 * (below + above):.2g}"
    return f"{band.lowest:.3g} .. {band.highest:.3g}"
