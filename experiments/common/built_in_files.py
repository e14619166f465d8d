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
    """Command of a kind of problem, and its dataclass.

    `module` is the module in `infoset.experiments` of the dataclass `owner`.
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
    """Return the built-in file of a name.

    Raise `InputError` if there is none, or it is of another kind.
    """
    file = built_in_files().get(name)
    if file is not None and file.kind not in kinds:
        raise InputError(f"{name}: {taken_by(file.kind, name)}")
    noun = "scenario" if SCENARIO in kinds else "problem"
    known = choice(f"built-in {noun}", name, built_in_names(kinds))
    return built_in_files()[known]


def kind_of(document: Mapping[str, Any]) -> str | None:
    """Return the kind of a parsed file: a kind of problem, or `SCENARIO`.

    None for other files. A scenario has no key `kind`; it is known by its tables `uncertainty` and
    `dispersion`.
    """
    kind = document.get("kind")
    if isinstance(kind, str) and kind in PROBLEMS:
        return kind
    if kind is None and {"uncertainty", "dispersion"} <= document.keys():
        return SCENARIO
    return None


def taken_by(kind: str, file: str = "FILE") -> str:
    """Return the kind of a file in words, and the command that takes it."""
    if kind == SCENARIO:
        return f"this is a scenario; use infoset engage {file}"
    return f"this is a problem of kind {kind}; use infoset {PROBLEMS[kind].command} {file}"
