"""`infoset scenarios`: list, show, check and create scenario files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from experiments.common.command import loaded
from experiments.common.file_commands import file_commands
from experiments.common.options import Overwrite, Quiet

MODULE = "experiments.interception.runs.scenarios"

app = file_commands(
    "scenario",
    MODULE,
    "asteroid-1997",
    "List, show and check scenarios, and create a scenario file. Without a command, list the built-in scenarios.",
    "scenarios new mine.toml",
)


@app.command(epilog="Example: infoset scenarios new mine.toml")
def new(
    file: Annotated[Path, typer.Argument(help="The file to write; - is stdout.")],
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> None:
    """Write a scenario file with a comment on every key, as a template for your own scenario."""
    loaded(MODULE, quiet).new(file, overwrite, quiet)
