"""Terminal output of commands: messages, progress bars and tables."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence

import typer
from rich.cells import cell_len
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from experiments.common.errors import on_a_screen
from sim.statistics import level_name, shows

BeginProgress = Callable[[str], Callable[[float], None]]
Part = str | Text | Table
"""A line or a table of a result on the screen."""
_GAP = 2
"""Width of the space between the columns of a table."""
_NARROWEST_TEXT = 12
"""Width to which texts in a table are wrapped before the table is divided; no word is divided."""
LINE_EVERY_S = 30.0
"""Time between two lines of progress in a log."""
NOT_FINITE = (
    "the numbers of the scenario are so large or so small that the results are not finite; "
    "check its units with: infoset scenarios check FILE"
)


def figure_files(*names: str) -> list[str]:
    """Return the names of the files of figures."""
    return [f"{name}.{kind}" for name in names for kind in ("pdf", "png")]


def say(message: str, quiet: bool) -> None:
    """Print a line on stderr, unless `quiet`."""
    if not quiet:
        typer.echo(on_a_screen(message), err=True)


def say_warnings(warnings: Iterable[str], quiet: bool, notes: Iterable[str] = ()) -> None:
    """Print notes and warnings on stderr, one line each."""
    for note in notes:
        say(note, quiet)
    for warning in warnings:
        say(f"warning: {warning}", quiet)


def table_console(stdout_taken: bool) -> Console:
    """Return the console for tables and lines: stdout, or stderr if a file is printed on stdout."""
    return Console(stderr=stdout_taken, highlight=False, markup=False, emoji=False)


def show(parts: Iterable[Part], quiet: bool, *, stdout_taken: bool = False) -> None:
    """Print a result, unless `quiet`: lines, which the terminal wraps, and tables of `number_table`."""
    if not quiet:
        print_parts(table_console(stdout_taken), parts)


def print_parts(console: Console, parts: Iterable[Part]) -> None:
    """Print lines, which the terminal wraps, and tables of `number_table`."""
    for part in parts:
        if isinstance(part, Table):
            _print_table(console, part)
        else:
            console.print(part, soft_wrap=True)


def number_table(*titles: str, left: int = 1) -> Table:
    """Return an empty table whose first ``left`` columns are text and whose other columns are numbers."""
    table = Table(*titles[:left], box=None, pad_edge=False)
    for title in titles[left:]:
        table.add_column(title, justify="right")
    return table


def _print_table(console: Console, table: Table) -> None:
    """Print a table; if the screen is too narrow, print it in parts, each with the columns of text.

    No number is cut or wrapped: texts are wrapped, and a part has as many columns of numbers as fit, and at least one.
    """
    cells = [[str(cell) for cell in (column.header, *column.cells)] for column in table.columns]
    widths = [max(cell_len(line) for cell in column for line in cell.splitlines() or [""]) + _GAP for column in cells]
    left = [index for index, column in enumerate(table.columns) if column.justify != "right"]
    for index in left:
        words = [cell_len(word) for cell in cells[index] for word in cell.split()]
        widths[index] = min(widths[index], max(_NARROWEST_TEXT, *words, 0) + _GAP)
    parts: list[list[int]] = []
    used = room = console.width + _GAP - sum(widths[index] for index in left)
    for index in sorted(set(range(len(widths))) - set(left)):
        used += widths[index]
        if used > room:
            parts.append([])
            used = widths[index]
        parts[-1].append(index)
    for number, numbers in enumerate(parts):
        part = Table(box=None, pad_edge=False)
        chosen = sorted([*left, *numbers])
        for index in chosen:
            column = table.columns[index]
            part.add_column(column.header, justify=column.justify, no_wrap=index not in left and widths[index] <= room)
        for row in zip(*(table.columns[index].cells for index in chosen), strict=True):
            part.add_row(*row)
        console.print(*([""] if number else []), part, sep="\n")


@contextlib.contextmanager
def progress_bar(quiet: bool) -> Iterator[BeginProgress]:
    """Show progress on stderr: bars on a terminal, otherwise a line every `LINE_EVERY_S`.

    The context is a function that starts a bar with a title, and returns a function that sets the fraction done.
    """
    if quiet:
        yield lambda _name: lambda _done: None
        return
    if not sys.stderr.isatty():
        yield _progress_lines()
        return
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:

        def begin(name: str) -> Callable[[float], None]:
            task = progress.add_task(name, total=1.0)
            return lambda done: progress.update(task, completed=done)

        yield begin


def _progress_lines() -> BeginProgress:
    """Return the function of `progress_bar` for a log: a line with all unfinished parts every `LINE_EVERY_S`."""
    shares: dict[str, float] = {}
    last_s = time.monotonic()

    def begin(name: str) -> Callable[[float], None]:
        shares[name] = 0.0

        def progress(done: float) -> None:
            nonlocal last_s
            shares[name] = done
            if time.monotonic() - last_s >= LINE_EVERY_S:
                last_s = time.monotonic()
                parts = ", ".join(f"{part} {100.0 * share:.0f} %" for part, share in [*shares.items()] if share < 1.0)
                say(f"progress: {parts}", quiet=not parts)

        return progress

    return begin


def number(value: float | None) -> str:
    """Return a number with three significant digits, from 100 to 1e9 with one decimal, for tables."""
    if value is None:
        return "-"
    return f"{value:.1f}" if 100 <= abs(value) < 1e9 else f"{value:.3g}"


def some_runs(count: int) -> str:
    """Return a number of runs as text: 1 run, 2 runs."""
    return f"{count} run{'' if count == 1 else 's'}"


def quantile_notes(runs: int, levels: Sequence[float], noises: int = 1) -> list[str]:
    """Return a line about the quantiles that so many runs of a noise do not show; no line if they show all."""
    hidden = [level for level in levels if not shows(runs, level)]
    if not hidden:
        return []
    needed = max(round(1.0 / min(level, 1.0 - level)) for level in hidden)
    each = f" of each noise (--runs {noises * needed})" if noises > 1 else ""
    too_few = f"{some_runs(runs)} {'is' if runs == 1 else 'are'} too few for {', '.join(map(level_name, hidden))}"
    return [f"{too_few}; {needed} runs{each} show all quantiles"]
