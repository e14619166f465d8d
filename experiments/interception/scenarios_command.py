"""`infoset scenarios`: list, show, check and create scenario files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from experiments.common.command import loading
from experiments.common.options import AsJson, Overwrite, Quiet

app = typer.Typer(name="scenarios", epilog="Example: infoset scenarios new mine.toml")


@app.callback(invoke_without_command=True)
def scenarios(context: typer.Context, json: AsJson = False, quiet: Quiet = False) -> None:
    """List, show and check scenarios, and create a scenario file. Without a command, list the built-in scenarios."""
    if context.invoked_subcommand is None:
        list_scenarios(json=json, quiet=quiet)
    elif json or quiet:
        raise typer.BadParameter(f"put --json and --quiet after {context.invoked_subcommand!r}")


@app.command("list", epilog="Example: infoset scenarios list --json")
def list_scenarios(json: AsJson = False, quiet: Quiet = False) -> None:
    """List the built-in scenarios; with --quiet, print only their names."""
    with loading(quiet):
        from experiments.interception.runs.scenarios import list_scenarios

    list_scenarios(json, quiet)


@app.command(epilog="Example: infoset scenarios show asteroid-1997 > mine.toml")
def show(name: Annotated[str, typer.Argument(help="Name of a built-in scenario.")]) -> None:
    """Print the file of a built-in scenario, including its comments."""
    with loading(False):
        from experiments.interception.scenario_file import scenario_text

    typer.echo(scenario_text(name), nl=False)


@app.command(epilog="Example: infoset scenarios check mine.toml")
def check(
    file: Annotated[str, typer.Argument(help="A scenario file, or the name of a built-in scenario.")],
    json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Check a scenario file. The exit code is 0 if it is valid; otherwise it is 2, and all problems are listed."""
    with loading(quiet):
        from experiments.interception.runs.scenarios import check

    check(file, json, quiet)


@app.command(epilog="Example: infoset scenarios new mine.toml")
def new(
    file: Annotated[Path, typer.Argument(help="The file to write.")],
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> None:
    """Write a scenario file with a comment on every key, as a template for your own scenario."""
    with loading(quiet):
        from experiments.interception.runs.scenarios import new

    new(file, overwrite, quiet)
