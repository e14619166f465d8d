"""The commands `infoset scenarios` and `infoset problems`, which list, show, check and create files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from experiments.common.command import loaded
from experiments.common.options import AsJson, Overwrite, Quiet

MODULE = "experiments.files"

BuiltInName = Annotated[str, typer.Argument(metavar="NAME", help="A built-in name.")]
FileName = Annotated[str, typer.Argument(metavar="FILE", help="A file, or a built-in name.")]
Like = Annotated[str, typer.Option("--like", metavar="NAME", help="The built-in file to copy.")]
NewFile = Annotated[Path, typer.Argument(metavar="FILE", help="The file to write; - is stdout.")]


def _commands(noun: str, built_in: str, text: str, example: str) -> typer.Typer:
    """Return the commands that list, show and check files; `built_in` and `example` are for their examples."""
    name = f"infoset {noun}s"
    app = typer.Typer(name=f"{noun}s", epilog=f"Example: {name} {example}")

    @app.callback(invoke_without_command=True, help=text)
    def default(context: typer.Context, json: AsJson = False, quiet: Quiet = False) -> None:
        if context.invoked_subcommand is None:
            list_files(json=json, quiet=quiet)
        elif json or quiet:
            raise typer.BadParameter(f"put --json and --quiet after {context.invoked_subcommand!r}")

    @app.command(
        "list",
        help=f"List the built-in {noun}s; with --quiet, print only their names.",
        epilog=f"Example: {name} list --json",
    )
    def list_files(json: AsJson = False, quiet: Quiet = False) -> None:
        loaded(MODULE, quiet).list_files(noun, json, quiet)

    @app.command(
        help=f"Print the file of a built-in {noun}, including its comments.",
        epilog=f"Example: {name} show {built_in} > mine.toml",
    )
    def show(name: BuiltInName) -> None:
        loaded(MODULE, False).show(noun, name)

    @app.command(
        help=f"Copy a built-in {noun} with its comments, as a start for your own.",
        epilog=f"Example: {name} new mine.toml --like {built_in}",
    )
    def new(file: NewFile, like: Like = built_in, overwrite: Overwrite = False, quiet: Quiet = False) -> None:
        loaded(MODULE, quiet).new(noun, like, file, overwrite, quiet)

    @app.command(
        help=f"Check a {noun} file. The exit code is 0 if it is valid; otherwise it is 2, and all errors are listed.",
        epilog=f"Example: {name} check mine.toml",
    )
    def check(file: FileName, json: AsJson = False, quiet: Quiet = False) -> None:
        loaded(MODULE, quiet).check(noun, file, json, quiet)

    return app


scenarios = _commands(
    "scenario",
    "own-scenario",
    "List, show and check scenarios, and create a scenario file. Without a command, list the built-in scenarios.",
    "new mine.toml",
)
problems = _commands(
    "problem",
    "pareto-2008",
    "List, show and check problems of rendezvous, pursuit and estimation, and create a problem file.\n\n"
    "Without a command, list the built-in problems.",
    "new mine.toml --like service-2",
)
