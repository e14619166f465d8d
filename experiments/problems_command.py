"""`infoset problems`: list, show, check and create problem files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from experiments.common.command import loaded
from experiments.common.file_commands import file_commands
from experiments.common.options import Overwrite, Quiet

MODULE = "experiments.problem_files"

app = file_commands(
    "problem",
    MODULE,
    "pareto-2008",
    "List, show and check problems of rendezvous, pursuit and estimation, and create a problem file.\n\n"
    "Without a command, list the built-in problems.",
    "problems new multipoint mine.toml",
)


@app.command(epilog="Example: infoset problems new multipoint mine.toml")
def new(
    kind: Annotated[
        str,
        typer.Argument(
            metavar="KIND",
            help="Kind of the problem: pareto-encounter, multipoint, reachable-rendezvous, pursuit-evasion or "
            "observer; or the command that takes it, for example reach.",
        ),
    ],
    file: Annotated[Path, typer.Argument(metavar="FILE", help="The file to write; - is stdout.")],
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> None:
    """Write a problem file with a comment on every key, as a template for your own problem."""
    loaded(MODULE, quiet).new(kind, file, overwrite, quiet)
