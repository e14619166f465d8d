"""`infoset problems`: list and show the built-in problems of rendezvous and pursuit."""

from __future__ import annotations

from typing import Annotated

import typer

from experiments.common.options import AsJson, Quiet

app = typer.Typer(name="problems", epilog="Example: infoset problems show pareto-2008 > mine.toml")


@app.callback(invoke_without_command=True)
def problems(context: typer.Context, json: AsJson = False, quiet: Quiet = False) -> None:
    """List and show the built-in problems of rendezvous and pursuit. Without a command, list them."""
    if context.invoked_subcommand is None:
        list_problems(json=json, quiet=quiet)
    elif json or quiet:
        raise typer.BadParameter(f"put --json and --quiet after {context.invoked_subcommand!r}")


@app.command("list", epilog="Example: infoset problems list --json")
def list_problems(json: AsJson = False, quiet: Quiet = False) -> None:
    """List the built-in problems with their kinds; with --quiet, print only their names."""
    from experiments.common.problem_file import built_in_problems
    from experiments.common.screen import show_built_in

    rows = [
        {"name": problem.name, "kind": problem.kind, "description": problem.description}
        for problem in built_in_problems()
    ]
    show_built_in(rows, json, quiet)


@app.command(epilog="Example: infoset problems show pareto-2008 > mine.toml")
def show(name: Annotated[str, typer.Argument(help="Name of a built-in problem.")]) -> None:
    """Print the file of a built-in problem, including its comments."""
    from experiments.common.problem_file import problem_text

    typer.echo(problem_text(name), nl=False)
