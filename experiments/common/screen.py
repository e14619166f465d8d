"""Terminal output of commands: messages, progress bars and tables."""

from __future__ import annotations

import contextlib
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial

import typer
from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    TaskID,
    TaskProgressColumn,
    TextColumn,
    TimeRemainingColumn,
)
from rich.table import Table
from rich.text import Text

from infoset.experiments.common.errors import on_a_screen
from infoset.experiments.common.units import duration_text
from infoset.sim.statistics import level_name, shows

BeginProgress = Callable[[str], Callable[[float], None]]
Clock = Callable[[], float]
"""The time, s, from any origin."""
Part = str | Text | Table
"""A line or a table of a result on the screen."""
NUMBER_WIDTH = 11
"""Minimum width of a column of numbers, letters: 999999999.9, the longest number of `number` that
is not negative. A longer one would be cut off in a `RowByRow`.
"""
LINE_EVERY_S = 30.0
"""Time between two lines of progress in a log; chosen: an hour has 120 lines."""
LONG_S = 10.0
"""Time, s, from which a command is long: its estimate is printed. Chosen: one waits so long without
asking.
"""
ESTIMATE_AFTER_S = 2.0
"""Time, s, over which the rate of an estimate is measured; chosen: the rate of a shorter time
depends on how the first runs end.
"""
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


def show(parts: Iterable[Part], quiet: bool) -> None:
    """Print lines, which the terminal wraps, and tables on stdout, unless `quiet`.

    Each part is printed at once, also above a progress bar.
    """
    if quiet:
        return
    console = Console(highlight=False, markup=False, emoji=False)
    for part in parts:
        with console.capture() as captured:
            if isinstance(part, Table):
                _keep_words(part)
                console.print(part, crop=False)
            else:
                console.print(part, soft_wrap=True)
        # The stream that bars on a terminal replace: click and the console would write past it.
        sys.stdout.write(captured.get())
        sys.stdout.flush()


def _keep_words(table: Table) -> None:
    """Let no word and no number of a table be divided: lines may be longer than the screen."""
    for column in table.columns:
        cells = (column.header, *column.cells)
        words = [word for cell in cells for word in str(cell).split()]
        column.min_width = max(map(len, words), default=0)


def number_table(*titles: str, left: int = 1) -> Table:
    """Return an empty table of numbers; its first ``left`` columns are text."""
    table = Table(*titles[:left], box=None, pad_edge=False)
    for title in titles[left:]:
        table.add_column(title, justify="right")
    return table


class RowByRow:
    """A table of numbers whose rows are printed one after another, as they are known.

    The first column is as wide as its title or the longest name. All others have one width, of the
    longest number or of the longest word of their titles, because the later rows are not known yet.
    """

    def __init__(self, titles: Sequence[str], names: Iterable[str], quiet: bool) -> None:
        self._quiet = quiet
        width = max(max(map(len, title.split()), default=0) for title in titles[1:])
        self._widths = [
            max(map(len, [titles[0], *names])),
            *[max(width, NUMBER_WIDTH)] * (len(titles) - 1),
        ]
        show([self._table(titles, show_header=True)], quiet)

    def add(self, *cells: str) -> None:
        """Print a row."""
        row = self._table([""] * len(cells), show_header=False)
        row.add_row(*cells)
        show([row], self._quiet)

    def _table(self, titles: Sequence[str], show_header: bool) -> Table:
        table = number_table(*titles)
        table.show_header = show_header
        for column, width in zip(table.columns, self._widths, strict=True):
            column.width = width
        return table


def progress_clock() -> float:
    """Return the time by which progress is measured, s. Tests of commands replace this function."""
    return time.monotonic()


@contextlib.contextmanager
def progress_bar(quiet: bool, clock: Clock | None = None) -> Iterator[BeginProgress]:
    """Show progress on stderr, and the estimated time.

    On a terminal progress is a bar, otherwise a line every `LINE_EVERY_S`.

    The context is a function that starts a bar with a title, and returns a function that sets the
    fraction done. The `clock` is `progress_clock` unless another is given.
    """
    if quiet:
        yield lambda _name: lambda _done: None
        return

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TimeRemainingColumn(),
    )
    # On a terminal, rows that are printed meanwhile are shown above the bars; into a file they are
    # written as always.
    bars = Progress(
        *columns,
        console=Console(stderr=True),
        transient=True,
        disable=not sys.stderr.isatty(),
        redirect_stdout=sys.stdout.isatty(),
    )
    begin = _Report(bars, clock or progress_clock).begin
    if bars.disable:
        yield begin
    else:
        with bars:
            yield begin


class _Report:
    """Report the progress of bars, and once the time that all begun bars take, if it is long.

    The time follows from the rate after the first report: kernels are loaded or compiled before it.
    """

    def __init__(self, bars: Progress, clock: Clock) -> None:
        self._bars = bars
        self._clock = clock
        self._written_s = clock()
        self._lock = threading.Lock()  # the parts of a command run in threads
        self._done: dict[TaskID, float] = {}
        self._first: tuple[float, float] | None = None
        self._is_told = False

    def begin(self, name: str) -> Callable[[float], None]:
        """Start a bar; return the function that sets the fraction done.

        After all bars are finished, a new bar has a new estimate.
        """
        with self._lock:
            if all(done >= 1.0 for done in self._done.values()):
                self._done.clear()
                self._first, self._is_told = None, False
            bar = self._bars.add_task(name, total=1.0)
            self._done[bar] = 0.0
        return partial(self._update, bar, name)

    def _update(self, bar: TaskID, name: str, done: float) -> None:
        with self._lock:
            self._report(bar, name, done)

    def _report(self, bar: TaskID, name: str, done: float) -> None:
        """Show what is done of a bar; print the estimated time once, and lines into a log."""
        self._bars.update(bar, completed=done)
        self._done[bar] = done
        now_s = self._clock()
        share = sum(self._done.values()) / len(self._done)
        first_s, first_share = self._first = self._first or (now_s, share)

        left = ""
        if share > first_share and now_s >= first_s + ESTIMATE_AFTER_S:
            passed_s = now_s - first_s
            left_s = (1.0 - share) * passed_s / (share - first_share)
            left = f", {duration_text(round(left_s))} left"
            if not self._is_told and passed_s + left_s > LONG_S:
                text = f"estimated time {duration_text(round(passed_s + left_s))}"
                if len(self._done) == 1:
                    text = f"{name}: {text}"
                self._bars.console.print(text)
            self._is_told = True

        if self._bars.disable and now_s >= self._written_s + LINE_EVERY_S:
            self._written_s = now_s
            say(f"{name}: {100.0 * done:.0f} %{left}", quiet=False)


def parts_of(progress: Callable[[float], None], count: int) -> list[Callable[[float], None]]:
    """Return functions that set the fractions done of equal parts of a bar."""
    done = [0.0] * count

    def update(part: int, share: float) -> None:
        done[part] = share
        progress(sum(done) / count)

    return [partial(update, part) for part in range(count)]


def number(value: float | None) -> str:
    """Return a number for tables, with three significant digits.

    From 100 to 1e9, of either sign, it has one decimal. None is ``-``.
    """
    if value is None:
        return "-"
    if 100 <= abs(value) < 1e9:
        return f"{value:.1f}"
    return f"{value:.3g}"


def some_runs(count: int) -> str:
    """Return a number of runs as text: 1 run, 2 runs."""
    if count == 1:
        return "1 run"
    return f"{count} runs"


def quantile_notes(runs: int, levels: Sequence[float], noises: int = 1) -> list[str]:
    """Return a line about the quantiles that so many runs of a noise do not show.

    There is no line if they show all.
    """
    hidden = [level for level in levels if not shows(runs, level)]
    if not hidden:
        return []
    verb = "is" if runs == 1 else "are"
    names = ", ".join(map(level_name, hidden))
    # By `shows`, one run is expected beyond a quantile; the extremes (0 and 1) are never hidden.
    needed = max(round(1.0 / min(level, 1.0 - level)) for level in hidden)
    enough = f"{needed} runs"
    if noises > 1:
        enough += f" of each noise (--runs {noises * needed})"
    return [f"{some_runs(runs)} {verb} too few for {names}; {enough} show all quantiles"]
