"""The notebooks run from the first cell to the last, and are stored without results."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import pytest

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))


def code_cells(file: Path) -> list[dict[str, Any]]:
    return [
        cell
        for cell in json.loads(file.read_text(encoding="utf-8"))["cells"]
        if cell["cell_type"] == "code"
    ]


def test_the_readme_links_the_notebooks() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert NOTEBOOKS
    assert all(f"(notebooks/{file.name})" in readme for file in NOTEBOOKS)


@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
def test_notebooks_are_stored_without_results(file: Path) -> None:
    assert all(
        cell["outputs"] == [] and cell["execution_count"] is None for cell in code_cells(file)
    )


@pytest.mark.docs
@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
def test_notebooks_run(file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    plt.switch_backend("agg")
    names: dict[str, Any] = {}
    for number, cell in enumerate(code_cells(file)):
        lines = [line for line in cell["source"] if not line.startswith("%")]  # commands of Jupyter
        exec(compile("".join(lines), f"{file.name}, code cell {number}", "exec"), names)
    plt.close("all")
    assert not list(tmp_path.iterdir())
