"""The style of figures, and the files of a figure."""

from __future__ import annotations

import ast
import importlib
import inspect
import os
import pkgutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import matplotlib
import pytest

from infoset import ConvexPolygons, Polytope, experiments
from infoset.experiments.cli import main
from infoset.experiments.common import figure_style
from infoset.experiments.common.figure_style import (
    WIDTH_MM,
    figure_bytes,
    legend_below,
    style,
    subplots,
)


def test_pdfs_have_truetype_fonts_and_pngs_200_dpi(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(figure_style, "STYLE", figure_style.STYLE[:1])
    with style():
        figure, ((axes,),) = subplots(40.0)
        axes.set_xlabel("ν² of $\\Phi_0$, −1 to 1 µm")
        files = dict(figure_bytes(figure))
    assert files["pdf"].count(b"/FontFile2") == 2
    assert b"/Type3" not in files["pdf"]
    # The header of a PNG has its width at byte 16.
    assert int.from_bytes(files["png"][16:20], "big") == int(WIDTH_MM / 25.4 * 200.0)


@style()
def test_legend_fits_the_width_of_its_figure() -> None:
    figure, ((axes,),) = subplots(40.0)
    for number in range(6):
        axes.plot([0.0, 1.0], [0.0, number], label=f"{number}: {'long ' * 8}")
    legend_below(figure, 3)
    (legend,) = figure.legends
    assert len(legend.get_texts()) == 6
    assert legend.get_window_extent().width <= figure.bbox.width


HOSTILE = """\
backend: agg
text.usetex: true
font.size: 30
font.family: monospace
axes.facecolor: black
axes.prop_cycle: cycler(color=["r"])
lines.linewidth: 9
image.cmap: gray
savefig.bbox: tight
savefig.transparent: true
figure.dpi: 33
"""
"""A matplotlibrc that changes or stops every figure; TeX is often not installed."""
DRAW = """
import hashlib, sys
from infoset.experiments.common.figure_style import figure_bytes, style, subplots

@style()
def draw():
    figure, ((axes,),) = subplots(40.0)
    axes.plot([0.0, 1.0], [2.0, 1.0], label="one")
    axes.set_xlabel("miss, m")
    axes.legend()
    return figure

for kind, content in figure_bytes(draw()):
    print(kind, hashlib.sha256(content).hexdigest())
"""


def drawn_with(settings: str, folder: Path) -> str:
    """Return the hashes of a figure that a process with a matplotlibrc draws."""
    folder.mkdir()
    (folder / "matplotlibrc").write_text(settings)
    environment = {**os.environ, "MPLCONFIGDIR": str(folder)}
    command = [sys.executable, "-c", DRAW]
    done = subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, check=True
    )
    return done.stdout


def test_figures_do_not_depend_on_the_matplotlibrc_of_the_user(tmp_path: Path) -> None:
    assert drawn_with(HOSTILE, tmp_path / "hostile") == drawn_with("", tmp_path / "plain") != ""


def test_a_command_draws_although_the_backend_of_a_notebook_is_missing(tmp_path: Path) -> None:
    environment = {**os.environ, "MPLBACKEND": "module://no_such_package.backend_inline"}
    command = [sys.executable, "-m", "infoset", "pareto", "--out", "figures", "--quiet"]
    done = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "figures" / "figure-front.png").stat().st_size > 0


@pytest.mark.parametrize("before", [None, "svg"])
def test_the_backend_of_the_process_is_the_same_after_a_command(
    before: str | None, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("MPLBACKEND", raising=False)
    if before is not None:
        monkeypatch.setenv("MPLBACKEND", before)
    with pytest.raises(SystemExit):
        main(["--version"])
    assert os.environ.get("MPLBACKEND") == before
    assert capsys.readouterr().out.startswith("infoset")


FIGURES = [
    module.name
    for module in pkgutil.walk_packages(experiments.__path__, "infoset.experiments.")
    if "figure" in module.name.rpartition(".")[2] or ".figures." in module.name
]


@pytest.mark.parametrize("name", FIGURES)
def test_every_function_that_makes_axes_has_the_style(name: str) -> None:
    """A function that begins a figure has the decorator of the style; its helpers are called within
    it.
    """
    tree = ast.parse(inspect.getsource(importlib.import_module(name)))
    bare = [
        function.name
        for function in tree.body
        if isinstance(function, ast.FunctionDef)
        and not function.name.startswith("_")
        and {"subplots", "new_figure"} & called(function)
        and "style()" not in map(ast.unparse, function.decorator_list)
    ]
    assert bare == [] or name == "infoset.experiments.common.figure_style"


def called(function: ast.FunctionDef) -> set[str]:
    """Return the names of the functions that a function calls."""
    calls = [node.func for node in ast.walk(function) if isinstance(node, ast.Call)]
    return {call.id for call in calls if isinstance(call, ast.Name)}


@pytest.mark.parametrize("kind", [ConvexPolygons, Polytope])
def test_a_set_that_python_draws_has_the_style_of_the_user(kind: Any) -> None:
    plt = pytest.importorskip("matplotlib.pyplot")
    with matplotlib.rc_context({"axes.facecolor": "black", "patch.linewidth": 7.0}):
        kind.from_box([0.0, 1.0], [2.0, 5.0]).plot()
        axes = plt.gca()
        try:
            assert axes.get_facecolor() == (0.0, 0.0, 0.0, 1.0)
        finally:
            plt.close(axes.figure)
