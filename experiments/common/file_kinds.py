"""Kinds of files that commands take, recognized by their content, and the command that takes each of them."""

from __future__ import annotations

import tomllib
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

from experiments.common.errors import InputError, nearest, shown

SCENARIO = "scenario"


class ProblemKind(NamedTuple):
    """Command of a kind of problem, its folder in `experiments`, and the loader in the module `file` there."""

    command: str
    folder: str
    loader: str


PROBLEMS = {
    "pareto-encounter": ProblemKind("pareto", "pareto", "load_pareto"),
    "multipoint": ProblemKind("multipoint", "multipoint", "load_multipoint"),
    "reachable-rendezvous": ProblemKind("reach", "reachability", "load_rendezvous"),
    "pursuit-evasion": ProblemKind("pursuit", "pursuit", "load_pursuit"),
    "observer": ProblemKind("observe", "observer", "load_observer"),
}
"""Kinds of problems by the `kind` of their files."""
MAX_FILE_BYTES = 100_000
"""Size of the largest TOML file that is read."""
LONGEST_LINE = 1000
"""Longest line of a TOML file: the parser's time grows as the square of the length of a dotted key."""
ZIP = b"PK"
"""First bytes of a record."""
_SCENARIO_TABLES = {"uncertainty", "dispersion", "angle_sensor", "thruster", "information_set"}
_FEWEST_TABLES = 2
"""Number of tables of a scenario from which a file without a kind is taken for a scenario."""


@dataclass(frozen=True)
class BuiltIn:
    """A built-in scenario or problem."""

    name: str
    kind: str
    description: str
    text: str


@cache
def built_in_files() -> Mapping[str, BuiltIn]:
    """Return the built-in files of all kinds by name, in alphabetical order."""
    package = resources.files("experiments")
    files = [file for folder in ("scenarios", "problems") for file in package.joinpath(folder).iterdir()]
    found = {}
    for file in sorted(files, key=lambda file: file.name.removesuffix(".toml")):
        name, dot, _ = file.name.rpartition(".toml")
        if dot:
            text = file.read_text(encoding="utf-8")
            values = tomllib.loads(text)
            found[name] = BuiltIn(name, values.get("kind", SCENARIO), values.get("description", ""), text)
    return found


def built_in_names(kinds: Collection[str]) -> list[str]:
    """Return the names of the built-in files of these kinds, in alphabetical order."""
    return [file.name for file in built_in_files().values() if file.kind in kinds]


def built_in(name: str, kinds: Collection[str], missing: str) -> BuiltIn:
    """Return the built-in file of a name; `InputError` if there is none, or it has another kind.

    Parameters
    ----------
    kinds : collection of str
        Kinds that fit.
    missing : str
        What does not exist otherwise, for the message: ``no built-in problem``.
    """
    file = built_in_files().get(name)
    if file is not None and file.kind in kinds:
        return file
    if file is not None:
        raise InputError(f"{name}: {taken_by(file.kind, name)}")
    names = built_in_names(kinds)
    guess = nearest(name, names)
    hint = f'did you mean "{guess}"? ' if guess else ""
    raise InputError(f"{missing} is called {shown(name)}; {hint}the built-in ones are {', '.join(names)}")


def kind_of(document: Mapping[str, Any]) -> str | None:
    """Return the kind of a parsed file: `SCENARIO`, a kind of problem, or None."""
    kind = document.get("kind")
    if isinstance(kind, str) and kind in PROBLEMS:
        return kind
    return SCENARIO if kind is None and len(_SCENARIO_TABLES & document.keys()) >= _FEWEST_TABLES else None


def taken_by(kind: str, file: str = "FILE") -> str:
    """Return what a file of a kind is, and the command that takes it."""
    if kind == SCENARIO:
        return f"this is a scenario; use infoset engage {file}"
    return f"this is a problem of kind {kind}; use infoset {PROBLEMS[kind].command} {file}"


def use_of_file(path: Path) -> str | None:
    """Return what a file is, and the command that takes it; None if it is not recognized."""
    try:
        with path.open("rb") as file:
            return use_of_content(file.read(MAX_FILE_BYTES + 1))
    except (OSError, ValueError):
        return None


def use_of_content(content: bytes) -> str | None:
    """Return what a file of this content is, and the command that takes it; None if it is not recognized."""
    if content.startswith(ZIP):
        return "this may be a record; use infoset replay FILE"
    if len(content) > MAX_FILE_BYTES or max(map(len, content.split(b"\n"))) > LONGEST_LINE:
        return None
    try:
        kind = kind_of(tomllib.loads(content.decode("utf-8-sig")))
    except (ValueError, RecursionError):
        return None
    return None if kind is None else taken_by(kind)


def read_input(file: Path, noun: str, max_bytes: int, remedy: str, *, only_ordinary: bool = False) -> bytes:
    """Return the content of a file of the user, at most `max_bytes`; raise `InputError` if it cannot be read.

    The file may be a pipe or a device unless `only_ordinary`.
    """
    try:
        if file.is_dir():
            raise InputError(f"{file}: {use_of_folder(file, noun)}")
        if only_ordinary and file.exists() and not file.is_file():
            raise InputError(f"{file}: is not an ordinary file; {remedy}")
        # The buffer of a read has the size that is asked for.
        size = min(max_bytes, file.stat().st_size) if only_ordinary else max_bytes
        with file.open("rb") as stream:
            content = stream.read(size + 1)
    except FileNotFoundError:
        raise InputError(f"{file}: there is no such file; {remedy}") from None
    except PermissionError:
        raise InputError(f"{file}: cannot be read: Permission denied; check its name and permissions") from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise InputError(f"{shown(str(file))}: cannot be read: {reason}; check the path") from None
    if len(content) > max_bytes:
        raise InputError(f"{file}: has more than {max_bytes} bytes, more than any {noun}; {remedy}")
    return content


def use_of_folder(path: Path, wanted: str) -> str:
    """Return what a folder is, and what to name in place of it."""
    if (path / "manifest.json").is_file():
        return "this is the folder of a campaign or a sweep; use infoset report DIR"
    return f"is a folder; name a {wanted} in it"
