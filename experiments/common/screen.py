"""Terminal output of commands: messages, progress bars and tables."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from experiments.common.errors import on_a_screen
from experiments.common.units import duration_text
from sim.statistics import level_name, shows

BeginProgress = Callable[[str], Callable[[float], None]]
Part = str | Text | Table
"""A line or a table of a result on the screen."""
LINE_EVERY_S = 30.0
"""Time between two lines of progress in a log."""
LONG_S, ESTIMATE_AFTER_S = 10.0, 2.0
"""Time from which a command is long and its estimate is printed, and the time from which the rate is taken."""
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
    """Print lines, which the terminal wraps, and tables on stdout, unless `quiet`."""
    if not quiet:
        console = Console(highlight=False, markup=False, emoji=False)
        for part in parts:
            if isinstance(part, Table):
                for column in part.columns:  # no word and no number is divided: a line may be longer than the screen
                    words = [word for cell in (column.header, *column.cells) for word in str(cell).split()]
                    column.min_width = max(map(len, words), default=0)
                console.print(part, crop=False)
            else:
                console.print(part, soft_wrap=True)


def number_table(*titles: str, left: int = 1) -> Table:
    """Return an empty table whose first ``left`` columns are text and whose other columns are numbers."""
    table = Table(*titles[:left], box=None, pad_edge=False)
    for title in titles[left:]:
        table.add_column(title, justify="right")
    return table


@contextlib.contextmanager
def progress_bar(quiet: bool) -> Iterator[BeginProgress]:
    """Show progress on stderr: bars on a terminal, otherwise a line every `LINE_EVERY_S`; and the estimated time.

    The context is a function that starts a bar with a title, and returns a function that sets the fraction done.
    """
    if quiet:
        yield lambda _name: lambda _done: None
        return
    if not sys.stderr.isatty():
        estimate = _Estimate(lambda line: say(line, quiet=False))
        yield lambda name: _progress_lines(name, estimate)
        return
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        estimate = _Estimate(progress.console.print)

        def begin(name: str) -> Callable[[float], None]:
            task, part = progress.add_task(name, total=1.0), estimate.begin(name)

            def update(done: float) -> None:
                progress.update(task, completed=done)
                estimate.update(part, done)

            return update

        yield begin


class _Estimate:
    """The time that all bars together take, from the rate of their first seconds: told once if it is long.

    The time before the first report, in which kernels are loaded or compiled, is not part of the rate.
    """

    def __init__(self, tell: Callable[[str], None]) -> None:
        self._tell = tell
        self._done: dict[object, float] = {}
        self._name = ""
        self._first: tuple[float, float] | None = None
        self._is_told = False

    def begin(self, name: str) -> object:
        """Return the key of another bar; the first one after finished bars begins a new estimate."""
        if all(done >= 1.0 for done in self._done.values()):
            self._done.clear()
            self._first, self._is_told = None, False
        part, self._name = object(), name
        self._done[part] = 0.0
        return part

    def update(self, part: object, done: float) -> float | None:
        """Set the fraction done of a bar; return the time left, s, or None if it is not known yet."""
        now_s, self._done[part] = time.monotonic(), done
        share = sum(self._done.values()) / len(self._done)
        if self._first is None:
            self._first = now_s, share
        first_s, first_share = self._first
        if share <= first_share or now_s < first_s + ESTIMATE_AFTER_S:
            return None
        left_s = (1.0 - share) * (now_s - first_s) / (share - first_share)
        if not self._is_told:
            self._is_told = True
            if now_s - first_s + left_s > LONG_S:
                name = f"{self._name}: " if len(self._done) == 1 else ""
                self._tell(f"{name}estimated time {duration_text(round(now_s - first_s + left_s))}")
        return left_s


def _progress_lines(name: str, estimate: _Estimate) -> Callable[[float], None]:
    part, last_s = estimate.begin(name), time.monotonic()

    def progress(done: float) -> None:
        nonlocal last_s
        left_s = estimate.update(part, done)
        if time.monotonic() - last_s >= LINE_EVERY_S:
            last_s = time.monotonic()
            left = "" if left_s is None else f", {duration_text(round(left_s))} left"
            say(f"{name}: {100.0 * done:.0f} %{left}", quiet=False)

    return progress


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
