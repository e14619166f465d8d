"""The commands `infoset scenarios` and `infoset problems`, which list, show and check files."""

from __future__ import annotations

from typing import Annotated

import typer

from experiments.common.command import loaded
from experiments.common.options import AsJson, Quiet

BuiltInName = Annotated[str, typer.Argument(help="A built-in name.")]
FileName = Annotated[str, typer.Argument(help="A file, or a built-in name.")]


def file_commands(noun: str, module: str, built_in: str, text: str, example: str) -> typer.Typer:
    """Return the commands that list, show and check the files of a kind.

    The functions `list_files`, `show` and `check` of the module run them; it is imported when a command runs.
    `built_in` is a built-in name and `example` a command, both for examples.
    """
    name = f"infoset {noun}s"
    app = typer.Typer(name=f"{noun}s", epilog=f"Example: infoset {example}")

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
        loaded(module, quiet).list_files(json, quiet)

    @app.command(
        help=f"Print the file of a built-in {noun}, including its comments.",
        epilog=f"Example: {name} show {built_in} > mine.toml",
    )
    def show(name: BuiltInName) -> None:
        loaded(module, False).show(name)

    @app.command(
        help=f"Check a {noun} file. The exit code is 0 if it is valid; otherwise it is 2, and all errors are listed.",
        epilog=f"Example: {name} check mine.toml",
    )
    def check(file: FileName, json: AsJson = False, quiet: Quiet = False) -> None:
        loaded(module, quiet).check(file, json, quiet)

    return app
