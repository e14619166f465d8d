"""infoset scenarios: list, show, check and begin scenario files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(
    name="scenarios",
    help="List, show and check scenarios, and begin one of your own.",
    epilog="Example: infoset scenarios new mine.toml",
)

Json = Annotated[bool, typer.Option("--json", help="Print JSON alone on stdout.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print no more than is asked for.")]


@app.callback(invoke_without_command=True)
def scenarios(context: typer.Context, json_: Json = False, quiet: Quiet = False) -> None:
    """List, show and check scenarios, and begin one of your own. Alone, it lists the built-in ones."""
    if context.invoked_subcommand is None:
        list_scenarios(json_=json_, quiet=quiet)
    elif json_ or quiet:
        raise typer.BadParameter(f"put --json and --quiet after {context.invoked_subcommand!r}")


@app.command("list", epilog="Example: infoset scenarios list --json")
def list_scenarios(json_: Json = False, quiet: Quiet = False) -> None:
    """List the built-in scenarios. With --quiet: their names alone."""
    from experiments.interception.scenario_file import load_scenario, scenario_names

    built_in = [load_scenario(name) for name in scenario_names()]
    if json_:
        typer.echo(json.dumps([{"name": each.name, "description": each.description} for each in built_in], indent=2))
        return
    if quiet:
        typer.echo("\n".join(each.name for each in built_in))
        return

    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table("name", "description", box=None, pad_edge=False)
    for each in built_in:
        table.add_row(Text(each.name, no_wrap=True), Text(each.description))
    Console().print(table)


@app.command("show", epilog="Example: infoset scenarios show asteroid-1997 > mine.toml")
def show(name: Annotated[str, typer.Argument(help="Name of a built-in scenario.")]) -> None:
    """Print the file of a built-in scenario, comments and all."""
    from experiments.interception.scenario_file import scenario_text

    typer.echo(scenario_text(name), nl=False)


@app.command("check", epilog="Example: infoset scenarios check mine.toml")
def check(
    file: Annotated[str, typer.Argument(help="A scenario file, or the name of a built-in scenario.")],
    json_: Json = False,
    quiet: Quiet = False,
) -> None:
    """Check a scenario file: exit code 0 if it is sound, 2 with every problem named if it is not."""
    from experiments.interception.scenario_file import load_scenario, scenario_hash, scenario_warnings

    scenario = load_scenario(file)
    fingerprint, warnings = scenario_hash(scenario), scenario_warnings(scenario)
    if json_:
        from importlib.metadata import version

        found = {
            "version": version("infoset"),
            "name": scenario.name,
            "scenario_hash": fingerprint,
            "warnings": warnings,
        }
        typer.echo(json.dumps(found, indent=2))
    elif not quiet:
        from rich.console import Console
        from rich.text import Text

        console = Console(soft_wrap=True)
        console.print(Text.assemble(("ok", "bold green"), f"  {scenario.name}  {fingerprint}"))
        for warning in warnings:
            console.print(Text.assemble(("warning: ", "yellow"), warning))


@app.command("new", epilog="Example: infoset scenarios new mine.toml")
def new(
    file: Annotated[Path, typer.Argument(help="The file to write.")],
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the file if it exists.")] = False,
    quiet: Quiet = False,
) -> None:
    """Write a commented scenario file to start one's own from."""
    from experiments.common.output import write_file
    from experiments.interception.scenario_file import scenario_template

    write_file(file, scenario_template(), overwrite=overwrite)
    if not quiet:
        typer.echo(f"wrote {file}; edit it, then: infoset scenarios check {file}")
