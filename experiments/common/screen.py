"""What the commands that fly show of their work: progress, the notice of the first compilation, numbers in tables."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from experiments.common.errors import on_a_screen
from experiments.common.output import to_json

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

BeginProgress = Callable[[str], Callable[[float], None]]
NOT_FINITE = (
    "the numbers of the scenario are so large or so small that the results are not finite; "
    "check its units with: infoset scenarios check FILE"
)


def figure_files(*names: str) -> list[str]:
    """Return the names of the files that figures become."""
    return [f"{name}.{kind}" for name in names for kind in ("pdf", "png")]


def say(message: str, quiet: bool) -> None:
    """Print a line beside the results, on stderr."""
    if not quiet:
        typer.echo(on_a_screen(message), err=True)


def say_warnings(warnings: Iterable[str], quiet: bool) -> None:
    """Print warnings beside the results, a line each."""
    for warning in warnings:
        say(f"warning: {warning}", quiet)


def table_console(stdout_taken: bool) -> Console:
    """Return the console for tables and lines: stdout, or stderr if a file is printed on stdout."""
    from rich.console import Console

    return Console(stderr=stdout_taken, highlight=False, markup=False, emoji=False)


def print_lines(console: Console, lines: Iterable[str]) -> None:
    """Print lines that the terminal wraps."""
    for line in lines:
        console.print(line, soft_wrap=True)


def number_table(*titles: str, left: int = 1) -> Table:
    """Return an empty table whose first ``left`` columns are text and whose other columns are numbers."""
    from rich.table import Table

    table = Table(*titles[:left], box=None, pad_edge=False)
    for title in titles[left:]:
        table.add_column(title, justify="right")
    return table


def tell_of_compiling(quiet: bool) -> None:
    """Say that the kernels are about to be compiled, if no compiled ones of this source are stored."""
    from infoset import location, section_passes

    kernels = ((section_passes.__file__, section_passes.measure_all), (location.__file__, location.refine_all))
    _tell_of_compiling(quiet, "half a minute", kernels)


def tell_of_compiling_pursuit(quiet: bool) -> None:
    """Say the same of the kernels of the pursuit-evasion game."""
    from rendezvous.pursuit_evasion import _extremal

    _tell_of_compiling(quiet, "five seconds", [(_extremal.__file__, _extremal.flow_kernel)])


def tell_of_compiling_rendezvous(quiet: bool, *, visits: bool = True, nonlinear: bool = False) -> None:
    """Say the same of the kernels of encounters, and of visits to several targets, nonlinear ones too."""
    from rendezvous.multipoint import _hamiltonian, _path
    from rendezvous.relative_motion import _circular

    kernels: list[tuple[str | None, object]] = [(_circular.__file__, _circular.fill_gramians)]
    if visits:
        kernels.append((_path.__file__, _path.solve_path))
    if nonlinear:
        kernels.append((_hamiltonian.__file__, _hamiltonian.propagate))
    _tell_of_compiling(quiet, "ten seconds" if nonlinear else "five seconds", kernels)


def _tell_of_compiling(quiet: bool, time: str, kernels: Sequence[tuple[str | None, object]]) -> None:
    """Say it if one of some kernels, each with the file of its module, is not stored; and where, if not beside it."""
    missing = [(Path(file or ""), kernel) for file, kernel in kernels if not _stored(kernel)]
    if quiet or not missing:
        return
    source, kernel = missing[0]
    folder = _cache_of(kernel)
    where = ""
    if folder is not None and folder != source.parent / "__pycache__":
        where = f"; they are kept in {folder.parent}, not beside their source"
    say(f"compiling the kernels, once (about {time}){where} ...", quiet)


def _cache_of(kernel: object) -> Path | None:
    """Where Numba keeps a kernel; None where it is not kept, or not compiled at all."""
    folder = getattr(getattr(kernel, "stats", None), "cache_path", None)
    return None if folder is None else Path(folder)


def _stored(kernel: object) -> bool:
    """Whether Numba has a compiled kernel of this very source: asked of its own index, whose stamp it will look at."""
    if _cache_of(kernel) is None:
        # Switched off by NUMBA_DISABLE_JIT; or nothing can be kept, which Numba's user was warned of.
        return True
    index = getattr(getattr(kernel, "_cache", None), "_cache_file", None)
    read = getattr(index, "_load_index", None)
    if read is None:  # another Numba, that keeps its index elsewhere: nothing is said rather than something wrong
        return True
    try:
        return bool(read())
    except (OSError, EOFError):
        return False


@contextlib.contextmanager
def progress_bar(quiet: bool) -> Iterator[BeginProgress]:
    """Show progress bars on stderr if that is a terminal.

    Yields
    ------
    callable
        Starts a bar with a title and returns a function that sets the fraction done.
    """
    if quiet or not sys.stderr.isatty():
        yield lambda _name: lambda _done: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:

        def begin(name: str) -> Callable[[float], None]:
            task = progress.add_task(name, total=1.0)
            return lambda done: progress.update(task, completed=done)

        yield begin


def number(value: float | None) -> str:
    """Return a number as a table shows it: three digits, more where they stand before the point."""
    if value is None:
        return "-"
    return f"{value:.1f}" if abs(value) >= 100 else f"{value:.3g}"


def show_built_in(rows: Sequence[Mapping[str, str]], json: bool, quiet: bool) -> None:
    """Print the built-in scenarios or problems: as JSON, as names alone, or as a table."""
    if json:
        typer.echo(to_json(rows), nl=False)
    elif quiet:
        typer.echo("\n".join(row["name"] for row in rows))
    else:
        from rich.table import Column, Table

        *first, description = rows[0]
        table = Table(*(Column(title, no_wrap=True) for title in first), description, box=None, pad_edge=False)
        for row in rows:
            table.add_row(*row.values())
        table_console(False).print(table)
