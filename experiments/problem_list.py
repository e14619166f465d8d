"""`infoset problems`: list, show, check and create problem files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from experiments.common.command import loading
from experiments.common.options import AsJson, Overwrite, Quiet

app = typer.Typer(name="problems", epilog="Example: infoset problems new multipoint mine.toml")


@app.callback(invoke_without_command=True)
def problems(context: typer.Context, json: AsJson = False, quiet: Quiet = False) -> None:
    """List, show and check problems of rendezvous and pursuit, and create a problem file.

    Without a command, list the built-in problems.
    """
    if context.invoked_subcommand is None:
        list_problems(json=json, quiet=quiet)
    elif json or quiet:
        raise typer.BadParameter(f"put --json and --quiet after {context.invoked_subcommand!r}")


@app.command("list", epilog="Example: infoset problems list --json")
def list_problems(json: AsJson = False, quiet: Quiet = False) -> None:
    """List the built-in problems with their kinds; with --quiet, print only their names."""
    with loading(quiet):
        from experiments.problem_files import list_problems

    list_problems(json, quiet)


@app.command(epilog="Example: infoset problems show pareto-2008 > mine.toml")
def show(name: Annotated[str, typer.Argument(help="Name of a built-in problem.")]) -> None:
    """Print the file of a built-in problem, including its comments."""
    with loading(False):
        from experiments.common.problem_file import problem_text

    typer.echo(problem_text(name), nl=False)


@app.command(epilog="Example: infoset problems check mine.toml")
def check(
    file: Annotated[str, typer.Argument(help="A problem file, or the name of a built-in problem.")],
    json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Check a problem file. The exit code is 0 if it is valid; otherwise it is 2, and all its faults are listed."""
    with loading(quiet):
        from experiments.problem_files import check

    check(file, json, quiet)


@app.command(epilog="Example: infoset problems new multipoint mine.toml")
def new(
    kind: Annotated[
        str,
        typer.Argument(
            metavar="KIND",
            help="Kind of the problem: pareto-encounter, multipoint, reachable-rendezvous or pursuit-evasion; or the "
            "command that takes it, for example reach.",
        ),
    ],
    file: Annotated[Path, typer.Argument(metavar="FILE", help="The file to write.")],
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> None:
    """Write a problem file with a comment on every key, as a template for your own problem."""
    with loading(quiet):
        from experiments.problem_files import new

    new(kind, file, overwrite, quiet)
