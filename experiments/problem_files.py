"""`infoset problems`: what its commands print and write."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import typer

from experiments.common.errors import InputError, nearest, shown
from experiments.common.file_kinds import PROBLEM_COMMANDS, SCENARIO, built_in_files, kind_of, taken_by
from experiments.common.options import choice
from experiments.common.output import library_version, write_template
from experiments.common.problem_file import ProblemTables, problem_form, problem_text
from experiments.common.screen import show_built_in, show_checked
from experiments.common.template import template
from experiments.common.toml_file import document_of
from experiments.common.toml_form import Form
from experiments.multipoint import file as multipoint
from experiments.observer import file as observer
from experiments.pareto import file as pareto
from experiments.pursuit import file as pursuit
from experiments.reachability import file as reachability

FILES: Mapping[str, tuple[Form[Any], Callable[[str], Any]]] = {
    pareto.KIND: (pareto.FORM, pareto.load_pareto),
    multipoint.KIND: (multipoint.FORM, multipoint.load_multipoint),
    reachability.KIND: (reachability.FORM, reachability.load_rendezvous),
    pursuit.KIND: (pursuit.FORM, pursuit.load_pursuit),
    observer.KIND: (observer.FORM, observer.load_observer),
}
"""Form and loader of each kind of problem."""


def list_files(json: bool, quiet: bool) -> None:
    """List the built-in problems."""
    problems = [file for file in built_in_files().values() if file.kind in PROBLEM_COMMANDS]
    rows = [{"name": file.name, "kind": file.kind, "description": file.description} for file in problems]
    show_built_in(rows, json, quiet)


def show(name: str) -> None:
    """Print the file of a built-in problem."""
    typer.echo(problem_text(name), nl=False)


def check(file: str, json: bool, quiet: bool) -> None:
    """Check a problem file of any kind."""
    document = document_of(problem_form("", ProblemTables), file)
    kind = kind_of(document)
    if kind == SCENARIO:
        raise InputError(f"{file}: {taken_by(kind)}")
    if kind is None:
        found = f"found {shown(document['kind'])}" if "kind" in document else "which is missing"
        guess = nearest(str(document.get("kind")), [*FILES])
        remedy = (
            f"did you mean {guess}?" if guess else f'write for example kind = "{pareto.KIND}" above the first table'
        )
        raise InputError(f"{file}: kind: must be one of {', '.join(FILES)}, {found}; {remedy}")
    problem = FILES[kind][1](file)
    warnings = list(problem.warnings()) if kind == pursuit.KIND else []
    head = {"version": library_version(), "name": problem.name, "kind": kind, "problem_hash": problem.hash}
    show_checked({**head, "warnings": warnings}, problem.hash, json, quiet)


def new(kind: str, file: Path, overwrite: bool, quiet: bool) -> None:
    """Write a problem file to start from."""
    kinds = {command: kind for kind, command in PROBLEM_COMMANDS.items()}
    kind = kinds.get(kind) or choice("KIND", kind, [*FILES])
    command = PROBLEM_COMMANDS[kind]
    head = [
        f"A problem for: infoset {command} FILE. Check it with: infoset problems check FILE",
        "Every key carries its unit in its name. A line `# key = value` is optional: the default or an example.",
    ]
    steps = f"infoset problems check {file}, and: infoset {command} {file}"
    write_template(file, template(FILES[kind][0], head), steps, overwrite=overwrite, quiet=quiet)
