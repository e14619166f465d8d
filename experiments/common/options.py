"""Options and arguments that several commands share, and checks of their values."""

from __future__ import annotations

import inspect
import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer

from infoset.experiments.common.errors import InputError, nearest, shown


def _silence_the_compile_notice(quiet: bool) -> bool:
    # By its name: the module of the logger loads Numba, which --help does not need.
    logging.getLogger("infoset.kernels").setLevel(logging.ERROR if quiet else logging.NOTSET)
    return quiet


ProblemName = Annotated[
    str,
    typer.Argument(
        metavar="PROBLEM",
        help="A built-in problem (see: infoset problems list), or a problem file.",
    ),
]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help=(
            "Replace a value of the file, in the unit at the end of KEY; a key of a table is "
            "written TABLE.KEY. May be given several times."
        ),
    ),
]
Seed = Annotated[
    int,
    typer.Option(
        "--seed", metavar="N", min=0, help="Root seed. The same seed gives the same random numbers."
    ),
]
Out = Annotated[
    Path | None,
    typer.Option("--out", metavar="DIR", help="Folder for figures and results; created if needed."),
]
Json = Annotated[
    Path | None,
    typer.Option("--json", metavar="FILE", help="Write results as JSON; - prints JSON only."),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]
Csv = Annotated[
    Path | None,
    typer.Option(
        "--csv",
        metavar="FILE",
        help="Write a table as CSV, units in the headings; - prints CSV only.",
    ),
]
Html = Annotated[
    Path | None,
    typer.Option(
        "--html",
        metavar="FILE.html",
        help="Write an interactive page: one file that opens in any browser, offline.",
    ),
]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace existing files.")]
Quiet = Annotated[
    bool,
    typer.Option(
        "--quiet",
        "-q",
        callback=_silence_the_compile_notice,
        help="Print no progress and no tables.",
    ),
]


@dataclass(frozen=True, kw_only=True)
class FileOptions:
    """Options of a command that writes files; a command adds its own ``csv`` and ``html``."""

    out: Out = None
    json: Json = None
    overwrite: Overwrite = False
    quiet: Quiet = False


def choice(option: str, name: str, valid: Sequence[str]) -> str:
    """Return a valid name; raise `InputError`, with the nearest valid name, if any, for others."""
    if name in valid:
        return name
    message = f"{option}: there is no {shown(name)}; "
    if guess := nearest(name, valid):
        message += f"did you mean {guess}? "
    raise InputError(f"{message}choose one of: {', '.join(valid)}")


def command_of(options: type, run: Callable[[Any], None]) -> Callable[..., None]:
    """Return a function for Typer whose parameters are the fields of a dataclass.

    The fields are declared with ``Annotated[type, typer.Option(...)]``; `run` takes the dataclass.
    """
    hints = get_type_hints(options, include_extras=True)

    def command(**values: Any) -> None:
        run(options(**values))

    parameters = inspect.signature(options).parameters.values()
    command.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
        [parameter.replace(annotation=hints[parameter.name]) for parameter in parameters]
    )
    command.__annotations__ = hints
    return command
