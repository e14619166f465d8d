"""The kinds of files, the command that takes each of them, and the built-in files."""

from __future__ import annotations

import tomllib
from collections.abc import Collection, Mapping
from functools import cache
from importlib import resources
from typing import Any, NamedTuple

from infoset.experiments.common.errors import InputError
from infoset.experiments.common.options import choice

SCENARIO = "scenario"


class ProblemKind(NamedTuple):
    """Command of a kind of problem, and the module in `infoset.experiments` and the name of its
    dataclass.
    """

    command: str
    module: str
    owner: str


PROBLEMS = {
    "pareto-encounter": ProblemKind("pareto", "pareto.file", "ParetoProblem"),
    "multipoint": ProblemKind("multipoint", "multipoint.file", "MultipointProblem"),
    "reachable-rendezvous": ProblemKind("reach", "reachability.file", "Rendezvous"),
    "reachable-system": ProblemKind("reach", "reachability.system_file", "ReachableSystem"),
    "pursuit-evasion": ProblemKind("pursuit", "pursuit.file", "PursuitProblem"),
    "observer": ProblemKind("observe", "observer.file", "ObserverProblem"),
    "trajectory": ProblemKind(
        "scenarios from-states", "interception.trajectory_file", "Trajectory"
    ),
}
"""Kinds of problems by the `kind` of their files."""


class BuiltIn(NamedTuple):
    """A built-in scenario or problem."""

    name: str
    kind: str
    description: str
    text: str


@cache
def built_in_files() -> Mapping[str, BuiltIn]:
    """Return the built-in files of all kinds by name, in alphabetical order."""
    package = resources.files("infoset.experiments")
    found = []
    for folder in ("scenarios", "problems"):
        for file in package.joinpath(folder).iterdir():
            if file.name.endswith(".toml"):
                text = file.read_text(encoding="utf-8")
                values = tomllib.loads(text)
                name = file.name.removesuffix(".toml")
                kind = values.get("kind", SCENARIO)
                found.append(BuiltIn(name, kind, values["description"], text))
    return {file.name: file for file in sorted(found)}


def built_in_names(kinds: Collection[str]) -> list[str]:
    """Return the names of the built-in files of these kinds, in alphabetical order."""
    return [file.name for file in built_in_files().values() if file.kind in kinds]


def built_in(name: str, kinds: Collection[str]) -> BuiltIn:
    """Return the built-in file of a name; `InputError` if there is none, or it has none of these
    kinds.
    """
    file = built_in_files().get(name)
    if file is not None and file.kind not in kinds:
        raise InputError(f"{name}: {taken_by(file.kind, name)}")
    known = choice(
        "built-in scenario" if SCENARIO in kinds else "built-in problem",
        name,
        built_in_names(kinds),
    )
    return built_in_files()[known]


def kind_of(document: Mapping[str, Any]) -> str | None:
    """Return the kind of a parsed file: a kind of problem, or `SCENARIO` for tables of a scenario;
    None for others.
    """
    kind = document.get("kind")
    if isinstance(kind, str) and kind in PROBLEMS:
        return kind
    return SCENARIO if kind is None and {"uncertainty", "dispersion"} <= document.keys() else None


def taken_by(kind: str, file: str = "FILE") -> str:
    """Return what a file of a kind is, and the command that takes it."""
    if kind == SCENARIO:
        return f"this is a scenario; use infoset engage {file}"
    return f"this is a problem of kind {kind}; use infoset {PROBLEMS[kind].command} {file}"
