"""`infoset scenarios`: what its commands print and write."""

from __future__ import annotations

from pathlib import Path

import typer

from experiments.common.file_kinds import SCENARIO, built_in_files
from experiments.common.output import library_version, write_template
from experiments.common.screen import show_built_in, show_checked
from experiments.interception.scenario_file import (
    load_scenario,
    scenario_hash,
    scenario_template,
    scenario_text,
    scenario_warnings,
)


def list_files(json: bool, quiet: bool) -> None:
    """List the built-in scenarios."""
    scenarios = [file for file in built_in_files().values() if file.kind == SCENARIO]
    show_built_in([{"name": file.name, "description": file.description} for file in scenarios], json, quiet)


def show(name: str) -> None:
    """Print the file of a built-in scenario."""
    typer.echo(scenario_text(name), nl=False)


def check(file: str, json: bool, quiet: bool) -> None:
    """Check a scenario file."""
    scenario = load_scenario(file)
    head = {"version": library_version(), "name": scenario.name, "scenario_hash": scenario_hash(scenario)}
    summary = {**head, "warnings": scenario_warnings(scenario)}
    show_checked(summary, head["scenario_hash"], json, quiet)


def new(file: Path, overwrite: bool, quiet: bool) -> None:
    """Write a scenario file to start from."""
    steps = f"infoset scenarios check {file}"
    write_template(file, scenario_template(), steps, overwrite=overwrite, quiet=quiet)
