"""What the code must never do, looked for in its own text."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("infoset", "guidance", "sim", "rendezvous", "experiments", "benchmarks")
SOURCES = sorted(file for package in PACKAGES for file in (ROOT / package).rglob("*.py"))

UNSAFE_MODULES = {"pickle", "cPickle", "dill", "cloudpickle", "joblib", "marshal", "shelve", "yaml"}
"""What runs code that a file holds, or may."""
UNSAFE_CALLS = {"eval", "exec", "compile", "__import__"}


def calls(tree: ast.AST) -> list[ast.Call]:
    return [node for node in ast.walk(tree) if isinstance(node, ast.Call)]


def name_of(call: ast.Call) -> str:
    """The last part of what is called: `load` of `np.load(...)`."""
    if isinstance(call.func, ast.Attribute):
        return call.func.attr
    return call.func.id if isinstance(call.func, ast.Name) else ""


def test_there_are_sources() -> None:
    assert {file.relative_to(ROOT).parts[0] for file in SOURCES} == set(PACKAGES)


@pytest.mark.parametrize("package", PACKAGES)
def test_nothing_that_runs_what_a_file_says(package: str) -> None:
    found = []
    for file in (each for each in SOURCES if each.relative_to(ROOT).parts[0] == package):
        tree = ast.parse(file.read_text())
        for node in ast.walk(tree):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            found += [f"{file}: {name}" for name in names if name.split(".")[0] in UNSAFE_MODULES]
        for call in calls(tree):
            if isinstance(call.func, ast.Name) and call.func.id in UNSAFE_CALLS:
                found.append(f"{file}:{call.lineno} {call.func.id}")
            if any(each.arg == "shell" for each in call.keywords):
                found.append(f"{file}:{call.lineno} shell")
    assert not found


def test_arrays_are_read_and_written_without_pickle() -> None:
    for file in SOURCES:
        for call in calls(ast.parse(file.read_text())):
            of_numpy = isinstance(call.func, ast.Attribute) and ast.unparse(call.func).startswith(("np.", "numpy."))
            if of_numpy and name_of(call) in {"load", "read_array", "write_array"}:
                given = {each.arg: each.value for each in call.keywords}
                allowed = given.get("allow_pickle")
                assert isinstance(allowed, ast.Constant), f"{file}:{call.lineno}"
                assert allowed.value is False, f"{file}:{call.lineno}"
