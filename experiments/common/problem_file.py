"""Problem files: TOML with a `kind`, one kind per command; the built-in files are in `experiments/problems`."""

from __future__ import annotations

import hashlib
import json
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from decimal import Decimal
from enum import Enum
from importlib import resources

from experiments.common.errors import InputError
from experiments.common.toml_file import Form, Known, Problem, Tables, no_checks
from experiments.common.toml_values import Constant, Description, Name, Table, key, nearest, shown


class ProblemTables(Table):
    """The keys of every problem file, above its first table."""

    schema_number: Constant = key("version of this file format", "1", alias="schema", default=1)
    kind: Constant = key("kind of problem", '"pareto-encounter"')
    name: Name = key("name of the results", '"my-problem"')
    description: Description = key("one line for `infoset problems list`", '"Who meets whom"', default="")


@dataclass(frozen=True)
class BuiltInProblem:
    """A built-in problem."""

    name: str
    kind: str
    description: str
    text: str


def built_in_problems() -> list[BuiltInProblem]:
    """Return the built-in problems of every kind, in alphabetical order."""
    folder = resources.files("experiments").joinpath("problems")
    files = sorted((each for each in folder.iterdir() if each.name.endswith(".toml")), key=lambda each: each.name)
    problems = []
    for file in files:
        text = file.read_text(encoding="utf-8")
        values = tomllib.loads(text)
        name = file.name.removesuffix(".toml")
        problems.append(BuiltInProblem(name, values["kind"], values.get("description", ""), text))
    return problems


def problem_text(name: str) -> str:
    """Return the file of a built-in problem, with its comments.

    Returns
    -------
    str
        TOML.

    Raises
    ------
    InputError
        If there is no such problem.
    """
    problems = {each.name: each.text for each in built_in_problems()}
    if name not in problems:
        guess = nearest(name, [*problems])
        hint = f'did you mean "{guess}"? ' if guess else ""
        raise InputError(
            f"no built-in problem is called {shown(name)}; {hint}the built-in ones are {', '.join(problems)}"
        )
    return problems[name]


def problem_form(
    kind: str,
    tables: type[Tables],
    checks: Callable[[Known], Iterator[Problem]] = no_checks,
) -> Form[Tables]:
    """Return the form of the problem files of a kind.

    Parameters
    ----------
    kind : str
        Value of ``kind`` in the file.
    tables : type
        The pydantic model of the whole file; it has `schema`, `kind` and `name` among its keys.
    checks : callable, optional
        Checks of relations between values.

    Returns
    -------
    Form
        To be given to `experiments.common.toml_file.load_tables`.
    """
    return Form("problem", "problems", "infoset problems list", "infoset problems show NAME", tables, checks, kind)


def problem_hash(tables: Tables) -> str:
    """Return a short hash of all values of a problem except its name and description.

    Returns
    -------
    str
        16 hexadecimal digits, the same for equal values on every machine.
    """
    values = tables.model_dump(exclude={"name", "description"})
    return hashlib.sha256(json.dumps(values, sort_keys=True, default=_plain).encode()).hexdigest()[:16]


def duplicate_names(known: Known, table: str, count: int) -> Iterator[Problem]:
    """Yield a problem for each name that occurs twice in the first ``count`` tables of an array of tables."""
    numbers: dict[object, int] = {}
    for index in range(count):
        name = known.value(table, str(index), "name")
        first = numbers.setdefault(name, index + 1)
        if isinstance(name, str) and first <= index:
            yield Problem((table, str(index), "name"), f'"{name}" is also the name of {table} #{first}', "rename one")


def _plain(value: object) -> str:
    if isinstance(value, Enum):
        return str(value.value)
    if isinstance(value, Decimal):
        return f"{value.normalize():f}"
    raise TypeError(f"a problem contains no {type(value).__name__}")
