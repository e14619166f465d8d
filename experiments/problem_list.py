"""infoset problems: list and show the built-in problems of rendezvous and pursuit."""

from __future__ import annotations

from typing import Annotated

import typer

app = typer.Typer(
    name="problems",
    help="List and show the built-in problems of rendezvous and pursuit, to begin your own from.",
    epilog="Example: infoset problems show pareto-2008 > mine.toml",
    no_args_is_help=True,
)


@app.command("list", epilog="Example: infoset problems list --json")
def list_problems(json_: Annotated[bool, typer.Option("--json", help="Print JSON alone on stdout.")] = False) -> None:
    """List the built-in problems, each with its kind."""
    import json

    from experiments.common.problem_file import built_in_problems

    found = built_in_problems()
    if json_:
        rows = [{"name": each.name, "kind": each.kind, "description": each.description} for each in found]
        typer.echo(json.dumps(rows, indent=2))
        return

    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table("name", "kind", "description", box=None, pad_edge=False)
    for each in found:
        table.add_row(Text(each.name, no_wrap=True), Text(each.kind, no_wrap=True), Text(each.description))
    Console().print(table)


@app.command("show", epilog="Example: infoset problems show pareto-2008 > mine.toml")
def show(name: Annotated[str, typer.Argument(help="Name of a built-in problem.")]) -> None:
    """Print the file of a built-in problem, comments and all."""
    from experiments.common.problem_file import problem_text

    typer.echo(problem_text(name), nl=False)
