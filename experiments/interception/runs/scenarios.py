"""`infoset scenarios`: what its commands print and write."""

from __future__ import annotations

from pathlib import Path

import typer
from rich.console import Console
from rich.text import Text

from experiments.common.output import to_json, write_file
from experiments.common.screen import show_built_in
from experiments.interception.runs.shared import summary_head
from experiments.interception.scenario_file import (
    load_scenario,
    scenario_hash,
    scenario_names,
    scenario_template,
    scenario_warnings,
)


def list_scenarios(json: bool, quiet: bool) -> None:
    """List the built-in scenarios."""
    scenarios = [load_scenario(name) for name in scenario_names()]
    show_built_in([{"name": each.name, "description": each.description} for each in scenarios], json, quiet)


def check(file: str, json: bool, quiet: bool) -> None:
    """Check a scenario file."""
    scenario = load_scenario(file)
    warnings = scenario_warnings(scenario)
    if json:
        head = summary_head(scenario)
        typer.echo(
            to_json(
                {
                    "version": head["version"],
                    "name": scenario.name,
                    "scenario_hash": head["scenario_hash"],
                    "warnings": warnings,
                }
            ),
            nl=False,
        )
    elif not quiet:
        console = Console(soft_wrap=True)
        console.print(Text.assemble(("ok", "bold green"), f"  {scenario.name}  {scenario_hash(scenario)}"))
        for warning in warnings:
            console.print(Text.assemble(("warning: ", "yellow"), warning))


def new(file: Path, overwrite: bool, quiet: bool) -> None:
    """Write a scenario file to start from."""
    write_file(file, scenario_template(), overwrite=overwrite)
    if not quiet:
        typer.echo(f"wrote {file}; edit it, then: infoset scenarios check {file}")
