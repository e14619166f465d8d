"""The layers are what they say, and everything public is described."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import pytest
from importlinter import cli

ROOT = Path(__file__).resolve().parents[1]
LAYERS = ("infoset", "guidance", "sim", "rendezvous")


def modules() -> Iterator[ModuleType]:
    """Every module of the documented layers."""
    for layer in LAYERS:
        package = importlib.import_module(layer)
        yield package
        for found in pkgutil.walk_packages(package.__path__, f"{layer}."):
            yield importlib.import_module(found.name)


def public() -> Iterator[tuple[str, object]]:
    """Public functions, classes and methods, each where it is defined."""
    for module in modules():
        for name, thing in vars(module).items():
            python = getattr(thing, "py_func", thing)
            if name.startswith("_") or getattr(python, "__module__", None) != module.__name__:
                continue
            if inspect.isclass(python):
                yield f"{module.__name__}.{name}", python
                for method_name, method in vars(python).items():
                    function = inspect.unwrap(getattr(method, "__func__", getattr(method, "fget", method)))
                    if not method_name.startswith("_") and inspect.isfunction(function):
                        yield f"{module.__name__}.{name}.{method_name}", function
            elif inspect.isfunction(python):
                yield f"{module.__name__}.{name}", python


PUBLIC = dict(public())
FUNCTIONS = {name: thing for name, thing in PUBLIC.items() if inspect.isfunction(thing)}


def section(text: str, title: str) -> str | None:
    """A section of a NumPy-style docstring, without its title."""
    found = re.search(rf"^{title}\n-+\n(.*?)(?=^\w[\w ]*\n-+$|\Z)", text, flags=re.DOTALL | re.MULTILINE)
    return found[1] if found else None


def described(parameters: str) -> set[str]:
    """Names that a Parameters section has: `a, b : type`, or bare where the type says all."""
    heads = [line.split(" : ")[0] for line in parameters.splitlines() if line and not line[0].isspace()]
    return {name.strip().lstrip("*") for head in heads for name in head.split(",")}


def undescribed(function: Callable[..., object]) -> set[str]:
    """Parameters of a function that its docstring, if it has a Parameters section at all, does not name."""
    parameters = section(inspect.getdoc(function) or "", "Parameters")
    if parameters is None:
        return set()
    return set(inspect.signature(function).parameters) - {"self", "cls"} - described(parameters)


def test_import_contracts_are_kept(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(ROOT)
    code = cli.lint_imports(no_cache=True)
    assert code == 0, capsys.readouterr().out


def test_the_layers_were_found() -> None:
    for name in (
        "infoset.polygon.clip_to_band",
        "infoset.information_set.InformationSet.predict",
        "sim.simulate.simulate",
    ):
        assert name in FUNCTIONS


@pytest.mark.parametrize("name", PUBLIC)
def test_public_things_have_a_docstring(name: str) -> None:
    # A dataclass or a named tuple without one is given its signature: that says nothing.
    text = getattr(PUBLIC[name], "__doc__", None) or ""
    assert text.strip(), f"{name} has no docstring"
    assert not text.startswith(f"{name.rsplit('.', 1)[-1]}("), f"{name} has no docstring of its own"


@pytest.mark.parametrize("name", FUNCTIONS)
def test_parameters_sections_name_every_parameter(name: str) -> None:
    missing = undescribed(FUNCTIONS[name])
    assert not missing, f"{name}: the docstring does not name {', '.join(sorted(missing))}"


def test_the_check_sees_a_missing_parameter() -> None:
    def careless(first: int, second: int, *rest: int) -> int:
        """Add.

        Parameters
        ----------
        first : int
            A number.

        Returns
        -------
        int
        """
        return first + second + sum(rest)

    assert undescribed(careless) == {"second", "rest"}
