"""The style of all figures: the sheet `infoset.mplstyle`, colours and lines.

Colours and lines differ in grey, too.

Functions that draw have sizes as numbers: heights in millimetres, sizes of marks and lines in
points, margins as shares or multiples of what is drawn. Where no other reason stands at such a
number, it was chosen by eye, and nothing depends on it.
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import matplotlib.style
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import NDArray

STYLE: list[Any] = [Path(__file__).with_name("infoset.mplstyle")]
WIDTH_MM = 170.0
"""Width of a figure over two columns of a page, mm: A4 with margins of 20 mm."""
_MM_PER_INCH = 25.4
TICKS = (1.0, 2.0, 5.0)
"""Multiples of powers of ten at a logarithmic axis."""

# Colours, named after their main use; the true state dark blue, sets light blue with a blue edge.
# Others use them too, so a change of one colour is seen in several figures.
INK = "#1a1a1a"
TRUTH = "#08306b"
MEASURED = "#e6842a"
IMPULSE = "#8c1c13"
SET_FILL = "#c6d9ec"
SET_EDGE = "#3f6f9f"
LIMIT = "#707070"
GAME = "#7f2704"
GUARANTEED = "#2f6b3a"
BODY_FILL = "#f0e6d8"
REGION_FILL = "#e8e8e8"

SET: dict[str, Any] = {"facecolor": SET_FILL, "edgecolor": SET_EDGE, "linewidth": 0.8}
"""Patch of a set."""
BOUND: dict[str, Any] = {"color": LIMIT, "linestyle": (0, (4, 2)), "linewidth": 0.9}
"""Line of a limit: of an engine, or of a range of values."""
EVENT: dict[str, Any] = {"color": LIMIT, "linestyle": (0, (1.5, 1.5)), "linewidth": 0.8}
"""Line of an event on an axis of time."""
HALO = [withStroke(linewidth=2.0, foreground="white")]
"""White outline of a text or a line over others."""

CURVE_LOOKS: dict[int, dict[str, Any]] = {
    1: {"color": TRUTH, "linestyle": "-"},
    2: {"color": "#5a9bd4", "linestyle": (0, (4, 1.5))},
    3: {"color": GAME, "linestyle": "-"},
    4: {"color": "#f08a24", "linestyle": (0, (4, 1.5))},
}
"""Lines of the curves of the paper of 1997, by their number (`study.Curve`): dark and solid without
the range sensor (1, 3), light and dashed with it (2, 4); blue random noise (1, 2), brown and orange
game noise (3, 4).
"""

LINE_LOOKS: tuple[dict[str, Any], ...] = (
    {"color": TRUTH, "linestyle": "-", "marker": "o"},
    {"color": MEASURED, "linestyle": (0, (5, 1.5)), "marker": "s"},
    {"color": GAME, "linestyle": (0, (1.2, 1.0)), "marker": "^"},
    {"color": GUARANTEED, "linestyle": (0, (5, 1, 1, 1)), "marker": "D"},
    {"color": "#4d4d4d", "linestyle": (0, (3, 1, 1, 1, 1, 1)), "marker": "v"},
)
"""Lines and marks that differ in grey too, for craft, optimal controls and components."""


@contextlib.contextmanager
def style() -> Iterator[None]:
    """Apply the style of the figures: a context, or with ``@style()`` a decorator.

    It begins with Matplotlib's defaults, so that settings of the user, as TeX for all texts, change
    no figure.
    """
    with matplotlib.style.context(STYLE, after_reset=True):
        yield


def new_figure(height_mm: float, width_mm: float = WIDTH_MM) -> Figure:
    """Return an empty figure, independent of pyplot; in the `style`, its layout is constrained."""
    figure = Figure(figsize=(width_mm / _MM_PER_INCH, height_mm / _MM_PER_INCH))
    FigureCanvasAgg(figure)
    return figure


def subplots(
    height_mm: float, rows: int = 1, columns: int = 1, *, width_mm: float = WIDTH_MM, **grid: Any
) -> tuple[Figure, NDArray[Any]]:
    """Return a new figure and its axes, shape (rows, columns).

    `grid` are arguments of `matplotlib.figure.Figure.subplots`, as ``sharex="col"``.
    """
    figure = new_figure(height_mm, width_mm)
    return figure, np.asarray(figure.subplots(rows, columns, squeeze=False, **grid))


def first_panels(grid: NDArray[Any], count: int) -> list[Axes]:
    """Return the first axes of a grid, row by row, and remove the others."""
    for unused in grid.flat[count:]:
        unused.remove()
    return [*grid.flat[:count]]


def label_axes(axes: Any, titles: Sequence[str]) -> None:
    """Write the titles of two or three axes, with few ticks and room around the drawing."""
    in_space = len(titles) > 2
    # In a plane there are two titles.
    for name, title in zip("xyz", titles, strict=False):
        getattr(axes, f"set_{name}label")(title, labelpad=-2.0 if in_space else None)
    axes.locator_params(nbins=5)
    axes.margins(0.08)
    if in_space:
        axes.tick_params(pad=-2.0)


def letters(panels: Iterable[Axes], titles: Sequence[str] = (), **look: Any) -> None:
    """Write (a), (b) ... above axes, with their titles if there are any.

    A single panel has no letter. `look` are arguments of `matplotlib.text.Text`.
    """
    every = [*panels]
    for number, axes in enumerate(every):
        words = [*titles[number : number + 1]]
        if len(every) > 1:
            words.insert(0, f"({chr(ord('a') + number)})")
        axes.set_title(" ".join(words), loc="left", **look)


def legend_below(figure: Figure, columns: int, **more: Any) -> None:
    """Draw the legend of a figure below its axes: everything drawn in them that has a label, once.

    It has fewer columns if it would be wider than the figure.
    """
    handles: dict[str, Any] = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    for count in range(columns, 0, -1):
        legend = figure.legend(
            handles.values(), handles.keys(), loc="outside lower center", ncols=count, **more
        )
        if count == 1 or legend.get_window_extent().width <= figure.bbox.width:
            return
        legend.remove()


def plain_ticks(one: Axis, subs: Sequence[float] = ()) -> None:
    """Write the ticks of a logarithmic axis as numbers, the minor ones without labels.

    `subs` are the multiples of powers of ten that have a tick; without them, Matplotlib chooses.
    """
    if subs:
        one.set_major_locator(LogLocator(subs=subs))
    one.set_major_formatter(FuncFormatter(lambda tick, _: f"{tick:g}"))
    one.set_minor_formatter(NullFormatter())


def plain(text: str) -> str:
    """Return a text of a file so that a figure shows it as it is.

    Two dollars would begin a formula.
    """
    return text.replace("$", r"\$")


@style()
def figure_bytes(figure: Figure) -> list[tuple[str, bytes]]:
    """Return a figure as PDF and as PNG, each with its file ending.

    The same figure gives the same bytes.
    """
    files = []
    # The date, and the version of Matplotlib.
    for kind, changing in (("pdf", "CreationDate"), ("png", "Software")):
        content = io.BytesIO()
        figure.savefig(content, format=kind, metadata={changing: None})
        files.append((kind, content.getvalue()))
    return files
