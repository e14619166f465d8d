"""`infoset scenarios` and `infoset problems`: what their commands print and write."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import typer
from rich.console import Console
from rich.table import Column, Table
from rich.text import Text

from experiments.common.errors import InputError, nearest, shown
from experiments.common.file_kinds import PROBLEMS, SCENARIO, built_in, built_in_files, kind_of, taken_by
from experiments.common.options import choice
from experiments.common.output import STDOUT, library_version, to_json, write_file
from experiments.common.problem_file import ProblemTables, problem_form
from experiments.common.screen import table_console
from experiments.common.toml_file import document_of
from experiments.common.toml_form import Form, template
from experiments.interception.scenario_file import load_scenario, scenario_hash, scenario_template, scenario_warnings


def form_and_loader(kind: str) -> tuple[Form[Any], Callable[[str], Any]]:
    """Return the form and the loader of a kind of problem."""
    problem = PROBLEMS[kind]
    module = import_module(f"experiments.{problem.folder}.file")
    return module.FORM, getattr(module, problem.loader)


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


def show(noun: str, name: str) -> None:
    """Print the file of a built-in scenario or problem."""
    kinds = [SCENARIO] if noun == SCENARIO else PROBLEMS
    typer.echo(built_in(name, kinds, f"no built-in {noun}").text, nl=False)


def check(noun: str, file: str, json: bool, quiet: bool) -> None:
    """Check a scenario file, or a problem file of any kind; print its name, fingerprint and warnings."""
    if noun == SCENARIO:
        scenario = load_scenario(file)
        name, fingerprint, warnings = scenario.name, scenario_hash(scenario), scenario_warnings(scenario)
        head = {"scenario_hash": fingerprint}
    else:
        kind = _problem_kind(file)
        problem = form_and_loader(kind)[1](file)
        name, fingerprint = problem.name, problem.hash
        warnings = list(problem.warnings()) if hasattr(problem, "warnings") else []
        head = {"kind": kind, "problem_hash": fingerprint}
    if json:
        typer.echo(to_json({"version": library_version(), "name": name, **head, "warnings": warnings}), nl=False)
    elif not quiet:
        console = Console(soft_wrap=True)
        console.print(Text.assemble(("ok", "bold green"), f"  {name}  {fingerprint}"))
        for warning in warnings:
            console.print(Text.assemble(("warning: ", "yellow"), warning))


def _problem_kind(file: str) -> str:
    """Return the kind of a problem file; raise `InputError` if it has none."""
    document = document_of(problem_form("", ProblemTables), file)
    kind = kind_of(document)
    if kind == SCENARIO:
        raise InputError(f"{file}: {taken_by(kind)}")
    if kind is None:
        missing, found = ("", f", found {shown(document['kind'])}") if "kind" in document else ("is missing, ", "")
        guess = nearest(str(document.get("kind")), [*PROBLEMS])
        example = f'write for example kind = "{next(iter(PROBLEMS))}" above the first table'
        remedy = f"did you mean {guess}?" if guess else example
        raise InputError(f"{file}: kind: {missing}must be one of {', '.join(PROBLEMS)}{found}; {remedy}")
    return kind


def new(kind: str | None, file: Path, overwrite: bool, quiet: bool) -> None:
    """Write a problem file of a kind, or without one a scenario file, to start from; print what to do with it."""
    if kind is None:
        text, steps = scenario_template(), f"infoset scenarios check {file}"
    else:
        kinds = {problem.command: kind for kind, problem in PROBLEMS.items()}
        kind = kinds.get(kind) or choice("KIND", kind, [*PROBLEMS])
        command = PROBLEMS[kind].command
        head = [
            f"A problem for: infoset {command} FILE. Check it with: infoset problems check FILE",
            "Every key carries its unit in its name. A line `# key = value` is optional: the default or an example.",
        ]
        text = template(form_and_loader(kind)[0], head)
        steps = f"infoset problems check {file}, and: infoset {command} {file}"
    if str(file) == STDOUT:
        typer.echo(text, nl=False)
        return
    write_file(file, text, overwrite=overwrite)
    if not quiet:
        typer.echo(f"wrote {file}; edit it, then: {steps}")
