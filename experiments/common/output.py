"""Files that commands write, each completely or not at all.

No file is replaced unless the user allows it.
"""

from __future__ import annotations

import contextlib
import json
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import is_dataclass
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from infoset.experiments.common.errors import InputError
from infoset.experiments.common.screen import say
from infoset.sim.columns import Cell
from infoset.sim.storage.files import replace_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from infoset.sim import HitEstimate, Results

STDOUT = "-"
ENDINGS = {"--html": (".html", ".htm"), "--gif": (".gif",), "--record": (".npz",)}
"""Endings of the files of options; other options take any ending.

Browsers and viewers recognize a file by its ending; `write_record` writes only `.npz`.
"""


class Output:
    """The files of one command, listed when the command ends.

    Single files are named by the option that gives them; the path ``-`` is stdout. After an error
    no files are listed.
    """

    def __init__(self, folder: Path | None, files: Mapping[str, Path], overwrite: bool) -> None:
        self.folder = folder
        self.files = files
        self.written: list[Path] = []
        self._overwrite = overwrite

    @property
    def stdout_taken(self) -> bool:
        """Whether a file is printed on stdout, so that no tables are printed."""
        return any(str(file) == STDOUT for file in self.files.values())

    def wants(self, option: str) -> bool:
        """Whether the file of an option, or the folder, is written."""
        return self.folder is not None or option in self.files

    def save(self, name: str, content: str | bytes, option: str | None = None) -> None:
        """Write a file of the folder under its name, and the same content for an option."""
        if self.folder is not None:
            self._write(self.folder / name, content)
        if option is not None:
            self.deliver(option, content)

    def deliver(self, option: str, content: str | bytes) -> None:
        """Write the file of an option, or print it on stdout, if the option was given."""
        file = self.files.get(option)
        if file is not None and str(file) == STDOUT:
            typer.echo(content, nl=False)
        elif file is not None:
            self._write(file, content)

    def figure(self, name: str, figure: Figure) -> None:
        """Write a figure into the folder, as PDF and PNG."""
        from infoset.experiments.common.figure_style import figure_bytes

        if self.folder is not None:
            for kind, content in figure_bytes(figure):
                self._write(self.folder / f"{name}.{kind}", content)

    def draw(
        self,
        names: Sequence[str],
        figures: Iterable[Figure | None],
        progress: Callable[[float], None],
    ) -> None:
        """Write figures under their names, each as soon as it is drawn.

        None is a figure that a result lacks.
        """
        for done, (name, figure) in enumerate(zip(names, figures, strict=True), start=1):
            if figure is not None:
                self.figure(name, figure)
            progress(done / len(names))

    def enter(self, folder: Path, *names: str) -> None:
        """Continue in a folder into which another function has written these files.

        From now on existing files are replaced; `output_of` has checked those of the options.
        """
        self.folder = folder
        self._overwrite = True
        self.written += [folder / name for name in names]

    def _write(self, file: Path, content: str | bytes) -> None:
        write_file(file, content, overwrite=self._overwrite)
        self.written.append(file)


@contextlib.contextmanager
def output_of(
    options: Any, names: Sequence[str] = (), files: Mapping[str, Path | None] | None = None
) -> Iterator[Output]:
    """Yield the output of a command, and list the written files on stderr at the end.

    Single files are the files of the options ``json``, ``csv`` and ``html``, and of `files`, by
    option; `names` are the files that the command writes into the folder of ``--out``; without
    `names` this folder is not used. Only ``json``, ``csv`` and ``html`` may be stdout. Raise
    `InputError` before the work if a file exists and ``--overwrite`` is not given, two files have
    the same path, a file has the ending of another kind, or a folder cannot be written.
    """
    given: dict[str, Path | None] = {}
    for option in ("json", "csv", "html"):
        given[f"--{option}"] = getattr(options, option, None)
    given |= files or {}
    single = {option: path for option, path in given.items() if path is not None}
    folder = options.out if names else None

    for option, path in single.items():
        _check_ending(option, path)
    paths = [*single.values()]
    if folder is not None:
        paths += [folder / name for name in names]
    _check_paths(paths, [*(files or {}).values()], options.overwrite)
    if folder is not None and folder.is_file():
        raise InputError(f"{folder}: is a file, not a folder; choose another name for the folder")

    for parent in dict.fromkeys(path.parent for path in paths if str(path) != STDOUT):
        need_writable(parent)

    output = Output(folder, single, options.overwrite)
    yield output

    if output.written and not options.quiet:
        for parent in dict.fromkeys(file.parent for file in output.written):
            line = "wrote " + ", ".join(
                file.name for file in output.written if file.parent == parent
            )
            if parent != Path():
                line += f" in {parent}"
            say(line, quiet=False)


def _check_paths(
    paths: Sequence[Path], not_printed: Sequence[Path | None], overwrite: bool
) -> None:
    """Raise `InputError` if a path is given twice or exists, or stdout is not possible for it.

    With `overwrite` files may exist, but not folders.
    """
    for number, path in enumerate(paths):
        if path in paths[:number]:
            raise InputError(
                f"{path}: is given twice; choose another name for one of the two files"
            )
        if str(path) != STDOUT:
            _check_new(path, overwrite)
        elif path in not_printed:
            raise InputError("-: only JSON, CSV and HTML can be printed; give the name of a file")


def _check_ending(option: str, path: Path) -> None:
    """Raise `InputError` if the file of an option does not have the ending of its kind."""
    name = option.partition(" ")[0]  # "--record of random" is one of two files of an option
    endings = ENDINGS.get(name)
    if endings is not None and str(path) != STDOUT and path.suffix.lower() not in endings:
        example = f"{path.stem}{endings[0]}"
        raise InputError(
            f"{name}: {path}: the file must end in {endings[0]}; for example {example}"
        )


def need_writable(folder: Path) -> None:
    """Raise `InputError` if no file can be written into a folder.

    Folders that are missing are made, and removed.
    """
    missing = [each for each in (folder, *folder.parents) if not each.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise InputError(
            f"{folder}: cannot be written: {error.strerror}; choose another folder"
        ) from None
    finally:
        for each in missing:
            with contextlib.suppress(OSError):  # it could not be made
                each.rmdir()


def _check_new(file: Path, overwrite: bool) -> None:
    if file.is_dir():
        raise InputError(f"{file}: is a folder; give the name of a file")
    if file.exists() and not (overwrite and file.is_file()):
        raise InputError(
            f"{file}: exists already; choose another name, or give --overwrite to replace a file"
        )


def write_file(file: Path, content: str | bytes, *, overwrite: bool = False) -> None:
    """Write a file completely or not at all, text as UTF-8, and create its folder if needed.

    `InputError` if the file exists and `overwrite` is false.
    """
    _check_new(file, overwrite)
    file.parent.mkdir(parents=True, exist_ok=True)
    if isinstance(content, str):
        content = content.encode()
    replace_file(file, content)


def outcome_columns(results: Results) -> dict[str, list[Cell]]:
    """Return the columns of results by name, without run numbers, starts and hits."""
    return {
        name: values
        for name, values in results.to_dict().items()
        if not name.startswith(("run", "start_", "hit"))
    }


def hit_key(hits: HitEstimate | None, missed: Mapping[str, object]) -> dict[str, object]:
    """Return the keys `hit` and `missed` of a curve or a sample in JSON.

    There are none if the body has no size.
    """
    if hits is None:
        return {}
    return {"hit": vars(hits), "missed": missed}


def to_json(value: object) -> str:
    """Return a value as indented JSON, keys in the order given.

    Arrays become lists, enumerations their values, dataclasses dicts. Raise ValueError if a number
    is not finite.
    """
    return json.dumps(value, indent=2, allow_nan=False, default=json_value) + "\n"


def json_value(value: Any) -> object:
    """Return the JSON form of an array, an enumeration or a dataclass, for `json.dumps`."""
    if isinstance(value, Enum):
        return value.value
    if is_dataclass(value):
        return vars(value)
    return value.tolist()
