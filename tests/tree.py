"""The modules of the project as they are installed, for programs that read files: mypy,
import-linter, editors.

In a checkout the package `infoset.sim` is the folder ``sim``, which only Python's import system
finds (`infoset/__init__.py`). ``python tests/tree.py FOLDER`` makes links to all modules; where
links are not allowed, as on Windows without the right to make them, copies.
"""

from __future__ import annotations

import shutil
import sys
from importlib.util import find_spec
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("guidance", "sim", "rendezvous", "experiments")
"""Packages inside `infoset`."""


def write_tree(folder: Path) -> Path:
    """Make links to all modules in ``folder/infoset`` and return the folder."""
    shutil.rmtree(folder / "infoset", ignore_errors=True)
    sets = ROOT / "infoset"
    if not sets.is_dir():  # the tests alone, beside an installation
        spec = find_spec("infoset")
        assert spec is not None
        assert spec.origin is not None
        sets = Path(spec.origin).parent

    sources = {sets: folder / "infoset"}
    for package in PACKAGES:
        beside = sets.parent / package
        if not (sets / package).is_dir():
            sources[beside] = folder / "infoset" / package

    for source, target in sources.items():
        for file in [*source.rglob("*.py"), *source.rglob("py.typed")]:
            link = target / file.relative_to(source)
            link.parent.mkdir(parents=True, exist_ok=True)
            try:
                link.symlink_to(file)
            except OSError:
                shutil.copy(file, link)
    return folder


if __name__ == "__main__":
    write_tree(Path(sys.argv[1]))
