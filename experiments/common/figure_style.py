"""The style of all figures: sizes, and colours that differ in grey too; figures as files."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterator
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

WIDTH_MM = 180.0
PNG_DPI = 200

INK = "#1a1a1a"
TRUTH = "#08306b"
MEASURED = "#e6842a"
IMPULSE = "#8c1c13"
SET_FILL = "#c6d9ec"
SET_EDGE = "#3f6f9f"
LIMIT = "#707070"

CURVE_LOOKS: dict[int, dict[str, Any]] = {
    1: {"color": "#08306b", "linestyle": "-"},
    2: {"color": "#5a9bd4", "linestyle": (0, (4, 1.5))},
    3: {"color": "#7f2704", "linestyle": "-"},
    4: {"color": "#f08a24", "linestyle": (0, (4, 1.5))},
}
"""Dark and solid without the range meter, light and dashed with it; blue random, brown game."""

LINE_LOOKS: tuple[dict[str, Any], ...] = (
    {"color": TRUTH, "linestyle": "-", "marker": "o"},
    {"color": MEASURED, "linestyle": (0, (5, 1.5)), "marker": "s"},
    {"color": "#7f2704", "linestyle": (0, (1.2, 1.0)), "marker": "^"},
    {"color": "#2f6b3a", "linestyle": (0, (5, 1, 1, 1)), "marker": "D"},
    {"color": "#4d4d4d", "linestyle": (0, (3, 1, 1, 1, 1, 1)), "marker": "v"},
)
"""Lines and marks that stay apart in grey, for craft, optimal controls and components."""

_STYLE: dict[Any, Any] = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 8.0,
    "axes.titlesize": 8.5,
    "axes.labelsize": 8.0,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "legend.fontsize": 7.5,
    "axes.linewidth": 0.6,
    "axes.edgecolor": INK,
    "axes.axisbelow": True,
    "axes.grid": True,
    "axes.unicode_minus": True,
    "grid.color": "#e2e2e2",
    "grid.linewidth": 0.5,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "lines.linewidth": 1.2,
    "legend.frameon": False,
    "legend.handlelength": 2.6,
    "figure.facecolor": "white",
    "pdf.fonttype": 42,
    "path.simplify": True,
}
_MM_PER_INCH = 25.4


@contextlib.contextmanager
def style() -> Iterator[None]:
    """Apply the style of the figures: a context, or with ``@style()`` a decorator."""
    with mpl.rc_context(_STYLE):
        yield


def new_figure(height_mm: float, width_mm: float = WIDTH_MM) -> Figure:
    """Return an empty figure with its own canvas, independent of pyplot."""
    figure = Figure(figsize=(width_mm / _MM_PER_INCH, height_mm / _MM_PER_INCH))
    FigureCanvasAgg(figure)
    return figure


def place_axes(
    figure: Figure,
    rows: int,
    columns: int,
    *,
    margins_mm: tuple[float, float, float, float],
    gaps_mm: tuple[float, float],
) -> list[list[Axes]]:
    """Return a grid of axes at fixed positions, without the cost of an automatic layout.

    Parameters
    ----------
    margins_mm : tuple of float
        Left, right, bottom, top.
    gaps_mm : tuple of float
        Between columns and between rows.

    Returns
    -------
    list of list of Axes
        By row, the top one first.
    """
    width, height = (float(size) * _MM_PER_INCH for size in figure.get_size_inches())
    left, right, bottom, top = margins_mm
    across = (width - left - right - gaps_mm[0] * (columns - 1)) / columns
    up = (height - bottom - top - gaps_mm[1] * (rows - 1)) / rows
    return [
        [
            figure.add_axes(
                (
                    (left + column * (across + gaps_mm[0])) / width,
                    (bottom + (rows - 1 - row) * (up + gaps_mm[1])) / height,
                    across / width,
                    up / height,
                )
            )
            for column in range(columns)
        ]
        for row in range(rows)
    ]


def figure_grid(
    height_mm: float,
    rows: int,
    columns: int,
    margins_mm: tuple[float, float, float, float],
    gaps_mm: tuple[float, float],
) -> tuple[Figure, list[Axes]]:
    """Return a new figure with a grid of axes, row by row; the parameters are those of `place_axes`."""
    figure = new_figure(height_mm)
    grid = place_axes(figure, rows, columns, margins_mm=margins_mm, gaps_mm=gaps_mm)
    return figure, [axes for row in grid for axes in row]


def plain(text: str) -> str:
    """Return a text of a file so that a figure shows it as it is: two dollars would begin a formula."""
    return text.replace("$", r"\$")


def width_mm(axes: Axes) -> float:
    """Return the width of placed axes, mm."""
    figure = axes.get_figure(root=True)
    if figure is None:
        raise ValueError("these axes are in no figure")
    return float(axes.get_position().width * figure.get_figwidth() * _MM_PER_INCH)


def figure_bytes(figure: Figure) -> list[tuple[str, bytes]]:
    """Return a figure as a vector PDF and a PNG of 200 dpi, each with its file ending.

    The same figure gives the same bytes.
    """
    options: list[tuple[str, dict[str, Any]]] = [
        ("pdf", {"metadata": {"CreationDate": None}}),
        ("png", {"metadata": {"Software": None}, "dpi": PNG_DPI}),
    ]
    files = []
    for kind, option in options:
        content = io.BytesIO()
        with style():
            figure.savefig(content, format=kind, **option)
        files.append((kind, content.getvalue()))
    return files
