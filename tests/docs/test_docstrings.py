"""The reference is complete: every parameter of a public name is described, every number has its
unit.
"""

from __future__ import annotations

import ast
import enum
import importlib
import inspect
import re
from collections.abc import Container, Iterator
from pathlib import Path
from typing import Any

import pytest

PACKAGES = (
    *(
        "infoset",
        "infoset.guidance",
        "infoset.sim",
        "infoset.rendezvous.relative_motion",
        "infoset.rendezvous.pareto",
        "infoset.rendezvous.multipoint",
    ),
    *(
        "infoset.rendezvous.reachability",
        "infoset.rendezvous.pursuit_evasion",
        "infoset.geometry.polytope",
    ),
    "experiments",
)

RAISES_CHECKED = ("infoset", "infoset.guidance", "infoset.sim", "infoset.rendezvous")
"""Packages in which public functions document the exceptions that they raise."""

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"

WITHOUT_UNITS = (
    *(
        "infoset.ConvexPolygons",
        "infoset.geometry.polytope.",
        "infoset.Polytope.",
        "infoset.Zonotope",
    ),
    "infoset.LinearObserver",  # geometry and systems in any unit
    *(
        "infoset.sim.Distribution",
        "infoset.sim.HitEstimate",
        "infoset.sim.QuantileEstimate",
        "infoset.sim.empirical_distribution",
        "infoset.sim.estimate_hits",
        "infoset.sim.estimate_quantiles",
        "infoset.sim.quantiles",
    ),
)
"""Geometry and statistics: their results have the units of their arguments."""

CONTRACTS = {
    "start": "infoset.guidance.Strategy",
    "decide": "infoset.guidance.Strategy",
    "measure": "infoset.guidance.MeasurementNoise",
    **dict.fromkeys(
        ("true_value", "bound", "band", "share", "cut", "measured", "error"), "infoset.Sensor"
    ),
}
"""Methods of a contract that many classes implement; the contract describes their parameters."""

_IN_NAME = re.compile(
    r"_(m|s|rad|km|deg|kg|n|m_s|km_s|rad_s|m_s2|m2_s3|m3_s2|kg_s|per_m|per_s|mb)$"
)
_UNIT = re.compile(
    r"(?<![\w^'’])"
    r"(m|s|rad|km|deg|kg|N|MB|ms|m/s|km/s|rad/s|rad/m"
    r"|m/s\^1\.5|m/s\^2|m/s\^3|m\^2/s\^3|m\^3/s\^2|kg/s|1/s)"
    r"(?!\w)"
)
_NUMBER = re.compile(r"\bfloat\b|Floats|ArrayLike|NDArray\[np\.float")
_NONE_OR_GIVEN = re.compile(
    r"share|fraction|[Rr]elative|probability|ratio|eccentricity|weights?\b|confidence|level"
    r"|direction|zonal|scaled"
    r"|[Ii]n [\[(][-\d]|between 0 and 1|0 to 1|unit (length|vector)|Unit vectors"
    r"|dimensionless|nondimensional"
    r"|standard deviations|units? of|own units|any units|permutation|matri|costate|states?\b"
    r"|Gramian"
    r"|[Ff]ree (terminal )?values"
)
"""Words for numbers without a unit, or with a unit by convention of the reference: states are in m
and m/s; the units of matrices and costates follow from that; free values have the units of their
components."""


def public_things() -> Iterator[tuple[str, Any]]:
    """Yield the public classes, functions and methods of the packages, by name."""
    for package in PACKAGES:
        module = importlib.import_module(package)
        defined = [
            name
            for name, thing in vars(module).items()
            if getattr(thing, "__module__", None) == package
        ]
        for name in getattr(
            module, "__all__", [each for each in defined if not each.startswith("_")]
        ):
            thing = getattr(module, name)
            thing = getattr(thing, "py_func", thing)
            if inspect.isclass(thing) and not issubclass(thing, Exception | enum.Enum):
                yield f"{package}.{name}", thing
                for method_name, method in vars(thing).items():
                    function = inspect.unwrap(
                        getattr(method, "__func__", getattr(method, "fget", method))
                    )
                    if not method_name.startswith("_") and inspect.isfunction(function):
                        yield f"{package}.{name}.{method_name}", function
            elif inspect.isfunction(thing):
                yield f"{package}.{name}", thing


THINGS = dict(public_things())


def entries(text: str, title: str) -> list[tuple[str, str]]:
    """Return the heads and texts of a section of a NumPy-style docstring."""
    found = re.search(
        rf"^{title}\n-+\n(.*?)(?=^\w[\w ]*\n-+$|\Z)", text, flags=re.DOTALL | re.MULTILINE
    )
    listed: list[tuple[str, str]] = []
    for line in found[1].splitlines() if found else ():
        if line and not line[0].isspace():
            listed.append((line, ""))
        elif listed:
            listed[-1] = (listed[-1][0], f"{listed[-1][1]} {line.strip()}".strip())
    return listed


def described(text: str) -> set[str]:
    """Return the names in the section Parameters of a docstring."""
    heads = [head.split(" : ")[0] for head, _ in entries(text, "Parameters")]
    return {name.strip().lstrip("*") for head in heads for name in head.split(",")}


def undescribed(name: str, thing: Any) -> list[str]:
    """Return the numbers among the parameters of a public name whose unit is neither in the name
    nor described.
    """
    if inspect.isclass(thing) and getattr(thing, "_is_protocol", False):
        return []
    text = inspect.getdoc(thing) or ""
    known = described(text)
    method = name.rsplit(".", 1)[-1]
    if method in CONTRACTS and "Parameters\n" not in text:
        text += inspect.getdoc(THINGS[f"{CONTRACTS[method]}.{method}"]) or ""
        known |= described(text) | {"batch"}
    return [
        parameter.name
        for parameter in inspect.signature(thing).parameters.values()
        if _NUMBER.search(str(parameter.annotation)) and parameter.name not in known
        if not _IN_NAME.search(parameter.name) and re.search(rf"\b{parameter.name}\b", text) is None
    ]


def without_unit(name: str, thing: Any) -> list[str]:
    """Return the numbers in the docstring of a public name that have no unit."""
    text = inspect.getdoc(thing) or ""
    if name.startswith(WITHOUT_UNITS):
        return []
    summary = text.split("\n\n")[0]
    bare = []
    for title in ("Parameters", "Returns"):
        for head, said in entries(text, title):
            names, _, kind = head.partition(" : ")
            if title == "Returns" and not kind:
                names = name.rsplit(".", 1)[-1]
                kind = head
            is_number = re.search(r"\bfloat|ndarray|array\b|array_like", kind) and not re.search(
                r"\bbool|\bint\b", kind
            )
            if not is_number or all(_IN_NAME.search(each.strip()) for each in names.split(",")):
                continue
            told = " ".join((names, kind, said, summary))
            if (
                _UNIT.search(f"{kind} {said} {summary}") is None
                and _NONE_OR_GIVEN.search(told) is None
            ):
                bare.append(f"{title}: {head}")
    return bare


Definition = ast.FunctionDef | ast.AsyncFunctionDef


def public_definitions(tree: ast.Module) -> Iterator[tuple[str, Definition, str]]:
    """Yield the public functions and methods of a module, by name, with the docstring that
    documents them.
    """
    for node in tree.body:
        if isinstance(node, Definition) and not node.name.startswith("_"):
            yield node.name, node, ast.get_docstring(node) or ""
        elif isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            for method in node.body:
                if not isinstance(method, Definition):
                    continue
                if method.name in {"__init__", "__post_init__"}:
                    yield f"{node.name}.{method.name}", method, ast.get_docstring(node) or ""
                elif method.name == "__call__" or not method.name.startswith("_"):
                    yield f"{node.name}.{method.name}", method, ast.get_docstring(method) or ""


def raised_by(body: Definition) -> set[str]:
    """Return the names of the exceptions that a function raises; "Error" for one from a
    variable.
    """
    raised = (
        node.exc for node in ast.walk(body) if isinstance(node, ast.Raise) and node.exc is not None
    )
    classes = (error.func if isinstance(error, ast.Call) else error for error in raised)
    names = (node.id if isinstance(node, ast.Name) else "" for node in classes)
    return {name if name[:1].isupper() else "Error" for name in names}


def silent_raises(source: str, public: Container[str] = ()) -> list[str]:
    """Return the functions of a module that raise exceptions which their docstrings do not name.

    Those of `public` names, and of classes with such names, must have a section Raises.
    """
    return [
        name
        for name, body, text in public_definitions(ast.parse(source))
        if (raised := raised_by(body))
        if not all(map(text.__contains__, raised))
        or (name.split(".")[0] in public and not entries(text, "Raises"))
    ]


def names_in_the_reference(package: str) -> set[str]:
    """Return the public names of a package, and those of the classes from which its classes
    inherit.
    """
    kinds = [thing for name, thing in THINGS.items() if name.startswith(package)]
    bases = {
        base.__name__ for kind in kinds if inspect.isclass(kind) for base in inspect.getmro(kind)
    }
    return bases | {thing.__name__ for thing in kinds}


@pytest.mark.parametrize("package", RAISES_CHECKED)
def test_raised_exceptions_are_documented(package: str) -> None:
    folder = Path(str(importlib.import_module(package).__file__)).parent
    modules = [each.relative_to(folder) for each in sorted(folder.rglob("*.py"))]
    assert modules
    public = names_in_the_reference(package)
    silent = {
        str(each): found
        for each in modules
        if not any(part.startswith("_") and part != "__init__.py" for part in each.parts)
        if (found := silent_raises((folder / each).read_text(encoding="utf-8"), public))
    }
    assert silent == {}


@pytest.mark.parametrize("package", PACKAGES)
def test_every_parameter_is_described(package: str) -> None:
    missing = {
        name: found
        for name, thing in THINGS.items()
        if name.startswith(package)
        if (found := undescribed(name, thing))
    }
    assert missing == {}


@pytest.mark.parametrize("package", PACKAGES)
def test_every_number_has_its_unit(package: str) -> None:
    bare = {
        name: found
        for name, thing in THINGS.items()
        if name.startswith(package)
        if (found := without_unit(name, thing))
    }
    assert bare == {}


def test_commands_of_benchmarks_are_lines_of_an_indented_block() -> None:
    """A tool that wraps docstrings may run the lines of a block together."""
    files = sorted(BENCHMARKS.glob("*.py"))
    assert files
    wrapped = []
    for file in files:
        text = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
        # A command within a sentence stands between backquotes.
        lines = re.sub(r"`[^`]+`", "", text).splitlines()
        wrapped += [
            line for line in lines if re.search(r"^(?!    python).*\bpython |python .*python", line)
        ]
    assert wrapped == []
