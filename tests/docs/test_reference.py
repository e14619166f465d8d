"""The reference lists what is public."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

import pytest

import experiments

REFERENCE = Path(__file__).resolve().parents[2] / "docs" / "reference"
PACKAGES = (
    *("infoset", "infoset.geometry.polytope", "guidance", "sim", "rendezvous.relative_motion", "rendezvous.pareto"),
    *("rendezvous.multipoint", "rendezvous.reachability", "rendezvous.pursuit_evasion"),
)


def test_the_page_of_experiments_lists_its_public_names() -> None:
    page = (REFERENCE / "experiments.md").read_text(encoding="utf-8")
    assert sorted(re.findall(r"^\.\. autofunction:: experiments\.(\w+)$", page, re.MULTILINE)) == experiments.__all__


@pytest.mark.parametrize("package", PACKAGES)
def test_the_page_of_a_package_lists_all_that_the_package_names(package: str) -> None:
    page = (REFERENCE / f"{package.rpartition('.')[2]}.md").read_text(encoding="utf-8")
    assert f".. automodule:: {package}\n" in page
    module = importlib.import_module(package)
    names = getattr(module, "__all__", [])
    assert all(hasattr(module, name) for name in names)
