"""Files that commands write: checked before the work, written completely or not at all."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import is_dataclass
from enum import Enum
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from experiments.common.errors import InputError, on_a_screen
from sim.storage.files import replace_file, temporary_beside

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from sim import HitEstimate, Results

STDOUT = "-"

Cell = str | int | float | bool | None


class Output:
    """The files of one command, listed when the command ends.

    Single files are named by the option that gives them; the path ``-`` is stdout.
    """

    def __init__(self, folder: Path | None, files: Mapping[str, Path], overwrite: bool) -> None:
        self.folder = folder
        self.files = files
        self.written: list[Path] = []
        self._overwrite = overwrite
        self._replaces = overwrite

    @property
    def stdout_taken(self) -> bool:
        """Whether a file is printed on stdout, so that tables go to stderr."""
        return any(str(file) == STDOUT for file in self.files.values())

    def wants(self, option: str) -> bool:
        """Whether the file of an option, or the folder, is written."""
        return self.folder is not None or option in self.files

    def save(self, name: str, content: str | bytes, option: str | None = None) -> None:
        """Write a file of the folder under its name, and the file of an option with the same content."""
        if self.folder is not None:
            self._write(self.folder / name, content, self._replaces)
        if option is not None:
            self.deliver(option, content)

    def deliver(self, option: str, content: str | bytes) -> None:
        """Write the file of an option, or print it on stdout, if the option was given."""
        file = self.files.get(option)
        if file is None:
            return
        if str(file) == STDOUT:
            typer.echo(content, nl=False)
        else:
            self._write(file, content, self._overwrite)

    def figure(self, name: str, figure: Figure) -> None:
        """Write a figure into the folder, as PDF and PNG."""
        from experiments.common.figure_style import figure_bytes

        if self.folder is not None:
            for kind, content in figure_bytes(figure):
                self._write(self.folder / f"{name}.{kind}", content, self._replaces)

    def draw(self, names: Sequence[str], figures: Iterable[Figure | None], progress: Callable[[float], None]) -> None:
        """Write figures under their names, each as soon as it is drawn; None is a figure that a result lacks."""
        for done, (name, figure) in enumerate(zip(names, figures, strict=True), start=1):
            if figure is not None:
                self.figure(name, figure)
            progress(done / len(names))

    def enter(self, folder: Path, *names: str) -> None:
        """Continue in a folder into which another function has written these files; files there are replaced."""
        self.folder, self._replaces = folder, True
        self.written += [folder / name for name in names]

    def add(self, file: Path) -> None:
        """List a file that another function has written."""
        self.written.append(file)

    def _write(self, file: Path, content: str | bytes, overwrite: bool) -> None:
        write_file(file, content, overwrite=overwrite)
        self.written.append(file)


@contextlib.contextmanager
def output_of(
    options: Any, names: Sequence[str] = (), files: Mapping[str, Path | None] | None = None
) -> Iterator[Output]:
    """Check every file that a command will write before the work begins, and list them on stderr at the end.

    The files `names` are written into the folder of ``--out``, which is created; if the work fails, it is removed again
    as long as it is empty. Single files are those of ``--json``, ``--csv`` and ``--html``, and further ones by the
    option that names them; the path ``-`` is stdout, which only one may be. Raise `InputError` if a file cannot be
    written, or would replace an existing one without ``--overwrite``.
    """
    folder = options.out if names else None
    given = {f"--{option}": getattr(options, option, None) for option in ("json", "csv", "html")} | dict(files or {})
    single = {option: path for option, path in given.items() if path is not None}
    printed = [option for option, path in single.items() if str(path) == STDOUT]
    if len(printed) > 1:
        raise InputError(f"{' and '.join(printed)} cannot both be printed on stdout; name a file for one of them")
    wanted = [("", folder / name) for name in names] if folder is not None else []
    wanted += [(option, path) for option, path in single.items() if option not in printed]
    created: list[Path] = []
    owners: dict[Path, str] = {}
    try:
        if folder is not None:
            _make_folder(folder, options.overwrite, created)
        for option, path in wanted:
            _check_file(path, options.overwrite)
            owner = f"the file of {option}" if option else "a file of --out"
            if (other := owners.setdefault(path.resolve(), owner)) != owner:
                raise InputError(f"{option}: {path} is also {other}; choose another name")
        opened = Output(folder, single, options.overwrite)
        yield opened
    finally:
        for path in reversed(created):
            with contextlib.suppress(OSError):
                path.rmdir()
    if opened.written and not options.quiet:
        typer.echo(on_a_screen("\n".join(_listed(opened.written))), err=True)


def _listed(files: Sequence[Path]) -> Iterator[str]:
    """Return a line for each folder, with the files written into it."""
    for folder in dict.fromkeys(file.parent for file in files):
        names = ", ".join(file.name for file in files if file.parent == folder)
        yield f"wrote {names}" + (f" in {folder}" if folder != Path() else "")


def _check_file(file: Path, overwrite: bool) -> None:
    """Check that a file can be written, by creating a temporary file in its folder."""
    with _reporting(file):
        _check_name(file, overwrite)
        probe = temporary_beside(file)
        try:
            probe.touch(exist_ok=False)
        finally:
            probe.unlink(missing_ok=True)


def write_file(file: Path, content: str | bytes, *, overwrite: bool = False) -> None:
    """Write a file completely or not at all; text is written as UTF-8.

    `InputError` if it cannot be written, is a link, or exists and `overwrite` is false.
    """
    with _reporting(file):
        _check_name(file, overwrite)
        replace_file(file, content.encode() if isinstance(content, str) else content)


def library_version() -> str:
    """Return the version of the installed distribution."""
    return version("infoset")


def outcome_columns(results: Results) -> dict[str, list[Cell]]:
    """Return the columns of results by name, without run numbers, starts and hits."""
    return {name: values for name, values in results.to_dict().items() if not name.startswith(("run", "start_", "hit"))}


def hit_key(hits: HitEstimate | None) -> dict[str, object]:
    """Return the key `hit` of a curve, a sample or a cell in JSON; nothing if the body has no size."""
    return {} if hits is None else {"hit": vars(hits)}


def to_json(value: object) -> str:
    """Return a value as indented JSON, keys in the order given; raise ValueError if a number is not finite.

    Arrays become lists, enumerations their values, dataclasses dicts.
    """
    return json.dumps(value, indent=2, allow_nan=False, default=json_value) + "\n"


def json_value(value: Any) -> object:
    """Return the JSON form of an array, an enumeration or a dataclass, for `json.dumps`."""
    if isinstance(value, Enum):
        return value.value
    return vars(value) if is_dataclass(value) else value.tolist()


def to_csv(columns: Sequence[str], rows: Sequence[Sequence[Cell]]) -> str:
    """Return a table as comma-separated values, the names of the columns in the first line.

    None is an empty cell, True and False are ``true`` and ``false``, numbers have all their digits.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows([_cell(value) for value in row] for row in rows)
    return text.getvalue()


def _cell(value: Cell) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value) if isinstance(value, float) else str(value)


def _check_name(file: Path, overwrite: bool) -> None:
    """Raise `InputError` if a file cannot have this name."""
    if file.is_dir():
        raise InputError(f"{file}: is a folder; name a file in it, for example {file / 'new-file'}")
    if os.path.lexists(file):
        if file.is_symlink():
            raise InputError(f"{file}: is a link, and links are not followed; remove it, or choose another name")
        if not file.is_file():
            raise InputError(f"{file}: exists already and is no ordinary file; choose another name")
        if not overwrite:
            raise InputError(f"{file}: exists already; choose another name, or give --overwrite to replace it")
    if not file.parent.is_dir():
        raise InputError(f"{file}: there is no folder {file.parent}; make it first")
    with contextlib.suppress(FileNotFoundError):
        file.lstat()  # raises OSError if the name is too long


def _make_folder(folder: Path, overwrite: bool, created: list[Path]) -> None:
    """Create a folder if needed, and append the created folders to a list, the outermost first."""
    with _reporting(folder):
        if os.path.lexists(folder) and not folder.is_dir():
            raise InputError(f"{folder}: is a file, not a folder; choose another name for the output folder")
        for parent in reversed([parent for parent in (folder, *folder.parents) if not parent.exists()]):
            created.append(parent)  # before it exists, because an interrupt may come between
            parent.mkdir()
        if not overwrite and next(folder.iterdir(), None) is not None:
            raise InputError(
                f"{folder}: is not empty; choose another folder, or give --overwrite to replace files in it"
            )


@contextlib.contextmanager
def _reporting(path: Path) -> Iterator[None]:
    """Turn an error of the file system into an `InputError` with the path and the reason."""
    try:
        yield
    except BrokenPipeError:
        raise
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise InputError(
            f"{path}: cannot be written: {reason}; choose a folder in which you have write permission"
        ) from None
