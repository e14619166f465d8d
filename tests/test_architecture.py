"""The import contracts hold, and everything public is described."""

from __future__ import annotations

import ast
import importlib
import inspect
import json
import pkgutil
import re
import subprocess
import sys
from collections.abc import Iterator
from graphlib import TopologicalSorter
from itertools import pairwise
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from tests.tree import PACKAGES, write_tree

ROOT = Path(__file__).resolve().parents[1]
LAYERS = ("infoset", "infoset.guidance", "infoset.sim", "infoset.rendezvous")


def modules() -> Iterator[ModuleType]:
    """Yield all modules of the documented layers."""
    for layer in LAYERS:
        package = importlib.import_module(layer)
        yield package
        for module in pkgutil.walk_packages(package.__path__, f"{layer}."):
            yield importlib.import_module(module.name)


def public() -> Iterator[tuple[str, object]]:
    """Yield public functions, classes and methods with the names of the modules that define
    them.
    """
    for module in modules():
        for name, thing in vars(module).items():
            python = getattr(thing, "py_func", thing)
            if name.startswith("_") or getattr(python, "__module__", None) != module.__name__:
                continue
            if inspect.isclass(python):
                yield f"{module.__name__}.{name}", python
                for method_name, method in vars(python).items():
                    function = inspect.unwrap(
                        getattr(method, "__func__", getattr(method, "fget", method))
                    )
                    if not method_name.startswith("_") and inspect.isfunction(function):
                        yield f"{module.__name__}.{name}.{method_name}", function
            elif inspect.isfunction(python):
                yield f"{module.__name__}.{name}", python


PUBLIC = dict(public())


def without_text(docstring: str) -> list[str]:
    """Return the heads of the entries in the section Parameters of a docstring that have no text
    below them.
    """
    section = re.search(
        r"^Parameters\n-+\n(.*?)(?=^\w[\w ]*\n-+$|\Z)", docstring, flags=re.DOTALL | re.MULTILINE
    )
    lines = section[1].splitlines() if section else []
    return [
        line
        for line, below in pairwise([*lines, ""])
        if line and not line[0].isspace() and not below.startswith(" ")
    ]


def documented(tree: ast.Module) -> Iterator[tuple[str, str]]:
    """Yield the classes and functions of a module, private ones too, by name, with their
    docstrings.
    """
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef | ast.FunctionDef):
            yield node.name, ast.get_docstring(node) or ""


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The modules as they are installed: grimp reads folders, and runs where Python finds these
    first.
    """
    return write_tree(tmp_path_factory.mktemp("tree"))


def test_import_contracts_are_kept(tree: Path) -> None:
    # In a separate process, because it disables all loggers that exist.
    command = "from importlinter.cli import lint_imports_command; lint_imports_command()"
    done = subprocess.run(
        [sys.executable, "-c", command, "--no-cache", "--config", str(ROOT / "pyproject.toml")],
        cwd=tree,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("name", PUBLIC)
def test_public_names_have_a_docstring(name: str) -> None:
    # The docstring of a dataclass or a named tuple without one is its signature.
    text = getattr(PUBLIC[name], "__doc__", None) or ""
    assert text.strip(), f"{name} has no docstring"
    assert not text.startswith(f"{name.rsplit('.', 1)[-1]}("), (
        f"{name} has its signature as docstring"
    )


@pytest.mark.parametrize("package", ["infoset", *PACKAGES])
def test_listed_parameters_have_a_text(package: str) -> None:
    bare = {
        f"{path.relative_to(ROOT)}: {name}": heads
        for path in sorted((ROOT / package).rglob("*.py"))
        for name, docstring in documented(ast.parse(path.read_text(encoding="utf-8")))
        if (heads := without_text(docstring))
    }
    assert bare == {}


def test_modules_do_not_import_each_other_in_a_circle(tree: Path) -> None:
    """Imports for type checkers and imports inside functions count too."""
    code = (
        "import grimp, json\n"
        "graph = grimp.build_graph('infoset', cache_dir=None)\n"
        "of = graph.find_modules_directly_imported_by\n"
        "print(json.dumps({each: sorted(of(each)) for each in graph.modules}))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tree, capture_output=True, text=True, check=True
    )
    imports = json.loads(done.stdout)
    assert len(imports) > 250
    TopologicalSorter(imports).prepare()  # raises CycleError, which names the circle


def test_a_measured_angle_reaches_the_cut_of_a_section_in_six_functions() -> None:
    """Each function that ARCHITECTURE.md lists calls the next one."""
    text = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
    found = re.findall(r"^\d\. `([\w.]+)` \(`([\w/]+)\.py`\)", text, flags=re.MULTILINE)
    assert len(found) == 6
    for (name, file), (called, _) in pairwise(found):
        owner: Any = importlib.import_module(
            ".".join(["infoset", *file.removeprefix("infoset/").split("/")])
        )
        for part in name.split("."):
            owner = getattr(owner, part)
        source = inspect.getsource(getattr(owner, "py_func", owner))
        assert re.search(rf"\b{called.rpartition('.')[2]}\(", source), (
            f"{name} does not call {called}"
        )
