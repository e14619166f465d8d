"""`infoset scenarios` and `infoset problems`: what their commands print and write."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

import typer
from rich.console import Console
from rich.table import Column, Table
from rich.text import Text

from experiments.common.errors import InputError
from experiments.common.file_kinds import PROBLEMS, SCENARIO, built_in, built_in_files, kind_of, taken_by
from experiments.common.input_file import parse, source_of
from experiments.common.output import STDOUT, library_version, to_json, write_file
from experiments.common.screen import table_console
from experiments.interception.scenario_file import load_scenario, scenario_warnings
from sim.storage.codec import fingerprint


def list_files(noun: str, json: bool, quiet: bool) -> None:
    """List the built-in scenarios or problems: as JSON, as names alone, or as a table."""
    rows = [
        {"name": file.name, **({} if noun == SCENARIO else {"kind": file.kind}), "description": file.description}
        for file in built_in_files().values()
        if (file.kind == SCENARIO) == (noun == SCENARIO)
    ]
    if json:
        typer.echo(to_json(rows), nl=False)
    elif quiet:
        typer.echo("\n".join(row["name"] for row in rows))
    else:
        *first, description = rows[0]
        table = Table(*(Column(title, no_wrap=True) for title in first), description, box=None, pad_edge=False)
        for row in rows:
            table.add_row(*row.values())
        table_console(False).print(table)


def text_of(noun: str, name: str) -> str:
    """Return the text of a built-in scenario or problem."""
    return built_in(name, [SCENARIO] if noun == SCENARIO else PROBLEMS, f"no built-in {noun}").text


def show(noun: str, name: str) -> None:
    """Print the file of a built-in scenario or problem."""
    typer.echo(text_of(noun, name), nl=False)


def check(noun: str, file: str, json: bool, quiet: bool) -> None:
    """Check a scenario file, or a problem file of any kind; print its name, fingerprint and warnings."""
    warnings: list[str] = []
    if noun == SCENARIO:
        read: Any = load_scenario(file)
        warnings, head = scenario_warnings(read), {"scenario_hash": fingerprint(read)}
    else:
        kind = _problem_kind(file)
        problem = PROBLEMS[kind]
        read = getattr(import_module(f"experiments.{problem.folder}.file"), problem.loader)(file)
        head = {"kind": kind, "problem_hash": fingerprint(read)}
    if json:
        typer.echo(to_json({"version": library_version(), "name": read.name, **head, "warnings": warnings}), nl=False)
    elif not quiet:
        console = Console(soft_wrap=True)
        console.print(Text.assemble(("ok", "bold green"), f"  {read.name}  {fingerprint(read)}"))
        for warning in warnings:
            console.print(Text.assemble(("warning: ", "yellow"), warning))


def _problem_kind(file: str) -> str:
    """Return the kind of a problem file; raise `InputError` if it has none."""
    document = parse(*source_of(file, PROBLEMS))
    kind = kind_of(document)
    if kind is None:
        raise InputError(f"{file}: kind: must be one of {', '.join(PROBLEMS)}; write it above the first table")
    if kind == SCENARIO:
        raise InputError(f"{file}: {taken_by(kind)}")
    return kind


def new(noun: str, like: str, file: Path, overwrite: bool, quiet: bool) -> None:
    """Copy a built-in file, to be changed; print what to do with it."""
    text = text_of(noun, like)
    if str(file) == STDOUT:
        typer.echo(text, nl=False)
        return
    write_file(file, text, overwrite=overwrite)
    if not quiet:
        typer.echo(f"wrote {file}, a copy of {like}; change it, then: infoset {noun}s check {file}")
