"""The style of all figures: the sheet `infoset.mplstyle`, and colours and lines that differ in grey too."""

from __future__ import annotations

import contextlib
import io
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain, product
from pathlib import Path
from typing import Any

import matplotlib.style
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patheffects import Normal, Stroke, withStroke
from matplotlib.ticker import FixedLocator
from numpy.typing import NDArray

from infoset.arrays import Floats

STYLE: list[Any] = [Path(__file__).with_name("infoset.mplstyle")]
WIDTH_MM = 170.0
"""Width of a figure over two columns of a page."""
_MM_PER_INCH = 25.4

INK = "#1a1a1a"
TRUTH = "#08306b"
MEASURED = "#e6842a"
IMPULSE = "#8c1c13"
SET_FILL = "#c6d9ec"
SET_EDGE = "#3f6f9f"
LIMIT = "#707070"

SET: dict[str, Any] = {"facecolor": SET_FILL, "edgecolor": SET_EDGE, "linewidth": 0.8}
"""Patch of a set."""
BOUND: dict[str, Any] = {"color": LIMIT, "linestyle": (0, (4, 2)), "linewidth": 0.9}
"""Line of a limit: of an engine, or of a range of values."""
EVENT: dict[str, Any] = {"color": LIMIT, "linestyle": (0, (1.5, 1.5)), "linewidth": 0.8}
"""Line of an event on an axis of time."""
HALO = [withStroke(linewidth=2.0, foreground="white")]
"""White outline of a text or a line over others."""

CURVE_LOOKS: dict[int, dict[str, Any]] = {
    1: {"color": "#08306b", "linestyle": "-"},
    2: {"color": "#5a9bd4", "linestyle": (0, (4, 1.5))},
    3: {"color": "#7f2704", "linestyle": "-"},
    4: {"color": "#f08a24", "linestyle": (0, (4, 1.5))},
}
"""Dark and solid without the range sensor, light and dashed with it; blue random, brown game."""

LINE_LOOKS: tuple[dict[str, Any], ...] = (
    {"color": TRUTH, "linestyle": "-", "marker": "o"},
    {"color": MEASURED, "linestyle": (0, (5, 1.5)), "marker": "s"},
    {"color": "#7f2704", "linestyle": (0, (1.2, 1.0)), "marker": "^"},
    {"color": "#2f6b3a", "linestyle": (0, (5, 1, 1, 1)), "marker": "D"},
    {"color": "#4d4d4d", "linestyle": (0, (3, 1, 1, 1, 1, 1)), "marker": "v"},
)
"""Lines and marks that differ in grey too, for craft, optimal controls and components."""


@contextlib.contextmanager
def style() -> Iterator[None]:
    """Apply the style of the figures: a context, or with ``@style()`` a decorator."""
    with matplotlib.style.context(STYLE):
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
    """Write the titles of two or three axes, with a few ticks each and room around what is drawn."""
    for name, title in zip("xyz", titles, strict=False):
        getattr(axes, f"set_{name}label")(title, labelpad=-2.0 if len(titles) > 2 else None)
    axes.locator_params(nbins=5)
    axes.margins(0.08)
    if len(titles) > 2:
        axes.tick_params(pad=-2.0)


def letters(panels: Iterable[Axes], titles: Sequence[str] = ()) -> None:
    """Write (a), (b) ... above axes, with their titles if there are any; no letter above a single one."""
    every = [*panels]
    for number, axes in enumerate(every):
        letter = [f"({chr(ord('a') + number)})"] if len(every) > 1 else []
        axes.set_title(" ".join([*letter, *titles[number : number + 1]]), loc="left")


def legend_below(figure: Figure, columns: int, **more: Any) -> None:
    """Draw the legend of a figure below its axes: everything drawn in them that has a label, once."""
    handles: dict[str, Any] = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=columns, **more)


def plain(text: str) -> str:
    """Return a text of a file so that a figure shows it as it is: two dollars would begin a formula."""
    return text.replace("$", r"\$")


@style()
def figure_bytes(figure: Figure) -> list[tuple[str, bytes]]:
    """Return a figure as PDF and as PNG, each with its file ending; the same figure gives the same bytes."""
    files = []
    for kind, undated in (("pdf", "CreationDate"), ("png", "Software")):
        content = io.BytesIO()
        figure.savefig(content, format=kind, metadata={undated: None})
        files.append((kind, content.getvalue()))
    return files


# Placing by hand, until the last figure has a constrained layout.
_CORNER_PAD = 7.0
"""Distance of the labels of a horizontal axis, in points, if they touch one of the vertical axis."""
_POSITIONS = tuple(
    (right, up, distance)
    for distance in (5.0, 9.0, 15.0)
    for right, up in ((1, 1), (-1, 1), (1, -1), (-1, -1), (0, 1), (0, -1), (1, 0), (-1, 0))
)
"""Positions of a label relative to its point: the side across and up, and the distance in points; better ones first."""
_HALO = [Stroke(linewidth=2.0, foreground="white"), Normal()]
_GROUND = {"facecolor": "white", "edgecolor": "none", "pad": 0.6, "alpha": 0.9}


def place_axes(
    figure: Figure,
    rows: int,
    columns: int,
    *,
    margins_mm: tuple[float, float, float, float],
    gaps_mm: tuple[float, float],
) -> list[list[Axes]]:
    """Return a grid of axes at fixed positions by row, the top one first, without the cost of an automatic layout.

    Margins are left, right, bottom and top; gaps are between columns and between rows.
    """
    figure.set_layout_engine("none")
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
    *,
    width_mm: float = WIDTH_MM,
    count: int | None = None,
) -> tuple[Figure, list[Axes]]:
    """Return a new figure and the axes of `place_axes`, row by row; with `count`, only the first ones."""
    figure = new_figure(height_mm, width_mm)
    panels = [*chain(*place_axes(figure, rows, columns, margins_mm=margins_mm, gaps_mm=gaps_mm))]
    for unused in panels[count:] if count is not None else ():
        unused.remove()
    return figure, panels[:count]


def separate_labels(axes: Axes, gap_points: float = 2.0) -> None:
    """Remove tick labels that touch, for axes whose place and limits are final.

    If labels of a logarithmic axis touch, those at powers of ten are kept first.
    """
    figure: Any = axes.figure
    gap = gap_points * figure.dpi / 72.0
    shown = []
    for one, end in ((axes.xaxis, 0), (axes.yaxis, 1)):
        one.get_ticklabels()  # places the labels
        low, high = sorted(one.get_view_interval())
        boxes = {}
        for tick in one.get_major_ticks():
            label = tick.label1 if tick.label1.get_visible() else tick.label2
            if low <= tick.get_loc() <= high and label.get_visible() and label.get_text():
                boxes[float(tick.get_loc())] = label.get_window_extent()
        kept = _apart(list(boxes), boxes, end, gap)
        if len(kept) < len(boxes) and one.get_scale() == "log":
            decades = [at for at in boxes if math.log10(at).is_integer()]
            if len(decades) > 1:
                kept = _apart(decades, boxes, end, gap)
        if boxes:
            one.set_major_locator(FixedLocator(kept))
        shown.append([boxes[at] for at in kept])
    if any(below.overlaps(left) for below in shown[0] for left in shown[1]):  # in the corner of the axes
        axes.tick_params(axis="x", pad=_CORNER_PAD)


def _apart(ticks: Sequence[float], boxes: Mapping[float, Any], end: int, gap: float) -> list[float]:
    """Return ticks whose labels have a gap along an axis of the page, the first tick included."""
    edge, kept = -math.inf, []
    for at in ticks:
        if boxes[at].min[end] >= edge + gap:
            kept.append(at)
            edge = boxes[at].max[end]
    return kept


def place_labels(
    axes: Axes, labels: Sequence[tuple[str, Floats, Floats]], marks: Floats, *, centred: bool = False, **look: Any
) -> None:
    """Write labels where they cover no other label, no mark and as little of the lines as possible.

    The limits of the axes become fixed. A label is its text; the points at which it can stand, shape (k, 2), the better
    ones first; and points of lines that it should not cover, shape (n, 2), each of which weighs 3 % of another label. A
    mark weighs as much as another label. A `centred` label stands preferably on its point, as on a contour. `look` are
    arguments of `matplotlib.axes.Axes.annotate`.
    """
    figure: Any = axes.figure
    positions = ((0, 0, 0.0), *_POSITIONS) if centred else _POSITIONS
    renderer, per_point = figure.canvas.get_renderer(), figure.dpi / 72.0
    axes.set(xlim=axes.get_xlim(), ylim=axes.get_ylim())
    marks = axes.transData.transform(marks)
    frame = axes.get_window_extent(renderer).extents
    taken: list[Floats] = []
    for text, anchors, line in labels:
        label = axes.annotate(text, (0.0, 0.0), xytext=(0, 0), textcoords="offset points", **look)
        label.set(**({"bbox": _GROUND} if centred else {"path_effects": _HALO}))
        avoided = axes.transData.transform(line)
        size = np.array(label.get_window_extent(renderer).size)
        choices: list[tuple[float, Floats, Floats, int, int, Floats]] = []
        for rank, ((right, up, distance), anchor) in enumerate(product(positions, anchors)):
            offset = np.array([right * distance, up * distance * (1.0 if right == 0 else 0.7)])
            low = axes.transData.transform(anchor) + per_point * offset + size * (np.array([right, up]) - 1.0) / 2.0
            box = np.concatenate([low, low + size])
            clashes = sum(bool((box[:2] < other[2:]).all() and (other[:2] < box[2:]).all()) for other in taken)
            clashes += _count_inside(box + 3.0 * per_point * np.array([-1.0, -1.0, 1.0, 1.0]), marks)
            outside = bool((box[:2] < frame[:2]).any() or (box[2:] > frame[2:]).any())
            penalty = 1000.0 * outside + 100.0 * clashes + 3.0 * _count_inside(box, avoided) + rank
            choices.append((penalty, box, offset, right, up, anchor))
        _, box, offset, right, up, anchor = min(choices, key=lambda choice: choice[0])
        taken.append(box)
        label.xy = tuple(anchor)
        label.set_position(tuple(offset))
        label.set(ha=("center", "left", "right")[right], va=("center", "bottom", "top")[up])


def _count_inside(box: Floats, points: Floats) -> int:
    return int(np.count_nonzero(((points > box[:2]) & (points < box[2:])).all(axis=1)))


def width_mm(axes: Axes) -> float:
    """Return the width of placed axes, mm."""
    figure: Any = axes.figure
    return float(axes.get_position().width * figure.get_figwidth() * _MM_PER_INCH)
