"""Figures of a sweep: the decisions about the requirement, and quantiles as lines (one key) or heat maps (two keys)."""

from __future__ import annotations

import itertools
import math
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from contourpy import contour_generator
from matplotlib.axes import Axes
from matplotlib.colors import Colormap, LinearSegmentedColormap, ListedColormap, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.markers import CARETUPBASE
from matplotlib.patches import Patch, Rectangle
from matplotlib.patheffects import Normal, Stroke
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, MaxNLocator, NullFormatter, NullLocator

from experiments.campaigns.sweep_axes import key_label, unit_of
from experiments.campaigns.sweep_table import (
    QUANTITY_NAMES,
    Limit,
    SweepTable,
    above_bound,
    answers,
    interpolated_text,
    limits,
    separating_digits,
    spans_decades,
    value_text,
)
from experiments.common.figure_style import (
    CURVE_LOOKS,
    IMPULSE,
    INK,
    LIMIT,
    figure_grid,
    separate_labels,
    style,
    width_mm,
)
from infoset.arrays import Floats
from sim import QuantileName, Requirement
from sim.requirement import AnyRequirement, Decision
from sim.statistics import level_name, number_text
from sim.storage import Axis

Grid = np.ma.MaskedArray[tuple[int, ...], np.dtype[np.float64]]

MAX_NUMBERS = 120
"""Maximum number of cells for which numbers are drawn in the cells."""

DECISION_COLOURS = {Decision.MET: "#3f7fb5", Decision.UNDECIDED: "#ececec", Decision.NOT_MET: "#f2a65a"}
"""Colours that differ in grey too, and for colour-blind readers."""
_PANEL_MM = 56.0
_COLUMN_MM = 90.0
_COLOURS: Colormap = LinearSegmentedColormap.from_list(
    "infoset", ["#f7fbff", "#c6d9ec", "#7fb0d6", "#3f7fb5", "#1b4f8a", "#08306b"]
)
_DASHES: tuple[Any, ...] = ("-", (0.0, (5.0, 1.5)), (0.0, (1.5, 1.2)), (0.0, (6.0, 1.0, 1.0, 1.0)))
"""Line styles from the largest quantile down."""

_NO_VALUE = "\N{EN DASH}"
"""Text in the cells whose runs do not show the quantile."""
_LETTERS = "abcdefghijklmnopqrstuvwxyz"
_MAX_TICKS = 8
_HEAD_ROOM = 1.06
"""Factor by which an axis is extended, so that the arrow above the topmost point is visible."""
_DIAMOND: dict[str, Any] = {
    "marker": "D",
    "markersize": 4.0,
    "color": IMPULSE,
    "markeredgecolor": "white",
    "markeredgewidth": 0.6,
}
_LINE: dict[str, Any] = {"color": INK, "linewidth": 1.3}
_CLOSED_FORM: dict[str, Any] = {"color": "#2f6b3a", "linewidth": 1.3, "linestyle": (0, (5, 1.5))}
"""Lines on which the estimate and the closed form equal the bound."""
_CELLS: dict[str, Any] = {"edgecolors": "white", "linewidth": 0.3, "zorder": 1.0}
_MAX_LEGEND_COLUMNS = 5
_LINE_MM, _LETTER_MM = 3.6, 1.5
"""Height of a line of an axis label, and width of a letter of a tick label."""
_STRIP = 0.045
"""Height of the strip of decisions above a panel, as a fraction of the panel."""
_BAR_AT, _NUMBERS_AT = 0.2, (0.6, 0.5, 0.75, 0.35)
"""Heights of the limit, and possible heights of the number, in the cells of a map, as fractions of a row."""
_NUMBER_WIDTH, _NUMBER_HEIGHT = 0.7, 0.36
"""Size of the number in a cell, as fractions of the cell."""
_MAX_LETTERS = {"x": 52, "y": 36}
"""Maximum number of letters of a line of an axis label."""
_MM_PER_POINT = 25.4 / 72.0


def draw_sweep(table: SweepTable, shown: Sequence[QuantileName], noise: str) -> Figure:
    """Draw the decisions and the quantiles of a sweep with one or two axes, for one noise.

    With one axis there is a panel for each quantity, with the quantiles as lines; with two axes there is a map of the
    decisions, and a heat map for each other quantile that the runs show. The panel of the requirement is the first.
    Raise ValueError if there are more axes, or no quantile.
    """
    if len(table.axes) not in (1, 2) or not shown:
        raise ValueError("only a sweep with one or two axes can be drawn, with at least one quantile")
    with style():
        return _lines(table, shown, noise) if len(table.axes) == 1 else _maps(table, shown, noise)


@dataclass(frozen=True)
class _Point:
    """A value of a sweep's axis, an estimate there or None, and the ends of its interval."""

    at: float
    value: float | None
    lower: float | None
    upper: float | None


def _points(table: SweepTable, noise: str, quantile: QuantileName | None) -> list[_Point]:
    """Return the known estimates of a quantile along the axis; None is the probability of a hit."""
    (axis,), required = table.axes, table.required
    is_required = quantile is None or (isinstance(required, Requirement) and quantile == required.quantile)
    points = []
    for cell, at in enumerate(axis.values):
        verdict = table.verdict(cell, noise) if is_required else None
        estimate = verdict if verdict is not None or quantile is None else table.estimate(cell, noise, quantile)
        if estimate is not None:
            value = estimate.value if quantile is None or verdict is not None else table.value(cell, noise, quantile)
            points.append(_Point(at, value, estimate.lower, estimate.upper))
    return points


def _lines(table: SweepTable, shown: Sequence[QuantileName], noise: str) -> Figure:
    quantities = list(dict.fromkeys([table.required.quantity, *(quantile.quantity for quantile in shown)]))
    levels = sorted({quantile.level for quantile in shown}, reverse=True)
    rows = -(-len(quantities) // 2)
    columns = min(2, len(quantities))
    sizes: dict[str, Any] = {"width_mm": _COLUMN_MM * columns, "count": len(quantities)}
    height_mm = rows * _PANEL_MM + (rows - 1) * 24.0 + 47.0
    figure, panels = figure_grid(height_mm, rows, columns, (17.0, 4.0, 36.0, 11.0), (18.0, 24.0), **sizes)
    for axes, quantity, letter in zip(panels, quantities, _LETTERS, strict=False):
        quantiles = [quantile for quantile in shown if quantile.quantity == quantity]
        _line_panel(axes, table, noise, quantity, quantiles, levels)
        hidden = [level_name(quantile.level) for quantile in quantiles if not _is_shown(table, noise, quantile)]
        few = f"; too few runs for {', '.join(hidden)}" if hidden else ""
        axes.set_title(
            f"({letter}) {noise} noise{few}", pad=6.0 + (4.0 if quantity == table.required.quantity else 0.0)
        )
        axes.set_ylabel(QUANTITY_NAMES[quantity])
    drawn = {quantile.level for quantile in shown if _is_shown(table, noise, quantile)}
    handles: list[Any] = [
        Line2D([], [], color=INK, linestyle=_look(levels, level), marker="o", markersize=3, label=level_name(level))
        if level in drawn
        else Line2D([], [], color=INK, linestyle="", marker="^", label=f"{level_name(level)}: lower end only")
        for level in levels
    ]
    handles.append(Line2D([], [], color=IMPULSE, linewidth=0.9, label=f"required: {requirement_words(table.required)}"))
    handles += _decision_patches(table, noise)
    if table.radius_m is not None:
        handles.append(Line2D([], [], color=LIMIT, linestyle="--", linewidth=0.9, label="radius of the body"))
    handles += _limit_handles(table, noise, Patch(facecolor=IMPULSE, alpha=0.15, label="range of the limit"))
    note = "bars: 95 % confidence intervals; arrow: too few runs for an upper end"
    figure.legend(handles=handles, loc="lower center", ncols=4, title=note, title_fontsize=7.0)
    return figure


def _is_shown(table: SweepTable, noise: str, quantile: QuantileName) -> bool:
    return any(point.value is not None for point in _points(table, noise, quantile))


def _decision_patches(table: SweepTable, noise: str) -> list[Patch]:
    verdicts = (table.verdict(cell, noise) for cell in range(len(table.cells)))
    drawn = {verdict.decision for verdict in verdicts if verdict is not None}
    return [
        Patch(facecolor=colour, label=str(decision))
        for decision, colour in DECISION_COLOURS.items()
        if decision in drawn
    ]


def _limit_handles(table: SweepTable, noise: str, extent: Line2D | Patch) -> list[Any]:
    """Return the marks of the limits that are drawn: `extent` for their ranges, and one for interpolated limits."""
    drawn = [limit for answer in answers(table, noise) for limit in answer.limits]
    if len(table.axes) > 1 or all(limit.value is None for limit in drawn):
        return [extent] if drawn else []
    return [extent, Line2D([], [], linestyle="none", label="limit by interpolation", **_DIAMOND)]


def _line_panel(
    axes: Axes, table: SweepTable, noise: str, quantity: str, quantiles: Sequence[QuantileName], levels: Sequence[float]
) -> None:
    (axis,), required = table.axes, table.required
    colour = CURVE_LOOKS[1 if noise == "random" else 3]["color"]
    lines = [(_points(table, noise, quantile), _look(levels, quantile.level)) for quantile in quantiles]
    if quantity == "hit":
        lines = [(_points(table, noise, None), "-")]
    for points, look in lines:
        known = [(point.at, point.value) for point in points if point.value is not None]
        axes.plot(*np.reshape(known, (-1, 2)).T, color=colour, linestyle=look, marker="o", markersize=3.0, zorder=3.0)
        for point in points:
            ends = [end for end in (point.lower, point.value, point.upper) if end is not None]
            if ends:
                axes.plot([point.at, point.at], [ends[0], ends[-1]], color=colour, linewidth=0.8, zorder=2.0)
            if ends and point.upper is None:
                axes.plot([point.at], [ends[-1]], marker=CARETUPBASE, markersize=6.0, color=colour, zorder=2.0)
    if quantity == "miss_m" and table.radius_m is not None:
        axes.axhline(table.radius_m, color=LIMIT, linestyle="--", linewidth=0.9, zorder=2.5)
    if quantity == required.quantity:
        axes.axhline(required.bound, color=IMPULSE, linewidth=0.9, zorder=2.5)
    values = [point.value for points, _ in lines for point in points if point.value is not None]
    if quantity == required.quantity:
        # The scale of the required estimates is also that of the interpolation of limits.
        verdicts = (table.verdict(cell, noise) for cell in range(len(table.cells)))
        values = [item.value for item in verdicts if item is not None and item.value is not None] or values
    _scale_values(axes, quantity, values)
    _scale(axes, axis, "x")
    if quantity == required.quantity:
        _mark_decisions(axes, table, noise)
    separate_labels(axes)


def _mark_decisions(axes: Axes, table: SweepTable, noise: str) -> None:
    """Draw a strip with the decision at each value above a panel, and the limits with their intervals."""
    (axis,) = table.axes
    edges = _edges(axis)
    for cell, (left, right) in enumerate(itertools.pairwise(edges.tolist())):
        verdict = table.verdict(cell, noise)
        if verdict is not None:
            look: dict[str, Any] = {"edgecolor": "white", "linewidth": 0.5, "clip_on": False}
            look |= {"facecolor": DECISION_COLOURS[verdict.decision], "transform": axes.get_xaxis_transform()}
            axes.add_patch(Rectangle((left, 1.0), right - left, _STRIP, **look))
    axes.set_xlim(edges[0], edges[-1])
    (answer,) = answers(table, noise)
    for limit in answer.limits:
        axes.axvspan(limit.lower, limit.upper, color=IMPULSE, alpha=0.15, linewidth=0.0, zorder=0.5)
        if limit.value is not None:
            axes.plot([limit.value], [table.required.bound], zorder=5.0, **_DIAMOND)
    axes.set_xlabel("\n".join([axes.get_xlabel(), *(_limit_words(axis, limit) for limit in answer.limits[:2])]))


def _limit_words(axis: Axis, limit: Limit) -> str:
    lower, upper = (value_text(axis, value, digits=3) for value in (limit.lower, limit.upper))
    value = interpolated_text(axis, limit)
    return f"limit between {lower} and {upper} {unit_of(axis.key)}".rstrip() + (f" (diamond: {value})" if value else "")


def _maps(table: SweepTable, shown: Sequence[QuantileName], noise: str) -> Figure:
    required = table.required
    quantiles = [
        quantile
        for quantile in shown
        if not (isinstance(required, Requirement) and quantile == required.quantile)
        and table.grid(noise, quantile).count()
    ]
    columns = min(2, 1 + len(quantiles))
    rows = -(-(1 + len(quantiles)) // columns)
    up = table.axes[1]
    letters = max(len(_tick_text(up, value)) for value in up.values)
    left_mm = max(17.0, _LINE_MM * (_axis_label(up, "y").count("\n") + 1) + _LETTER_MM * letters + 3.0)
    sizes: dict[str, Any] = {"width_mm": columns * (_COLUMN_MM - 17.0 + left_mm), "count": 1 + len(quantiles)}
    margins_mm, gaps_mm = (left_mm, 17.0, 27.0, 8.0), (19.0 + left_mm, 21.0)
    height_mm = rows * _PANEL_MM + (rows - 1) * 21.0 + 35.0
    figure, (first, *others) = figure_grid(height_mm, rows, columns, margins_mm, gaps_mm, **sizes)
    _decision_panel(first, table, noise)
    first.set_title(f"(a) {requirement_words(required)}; {noise} noise")
    for quantile, axes, letter in zip(quantiles, others, _LETTERS[1:], strict=False):
        _map_panel(figure, axes, table, noise, quantile)
        name, unit = QUANTITY_NAMES[quantile.quantity].split(", ")
        axes.set_title(f"({letter}) {name}, {level_name(quantile.level)}, {unit}; {noise} noise")
    handles: list[Any] = [
        *_decision_patches(table, noise),
        *_limit_handles(table, noise, Line2D([], [], color=IMPULSE, linewidth=1.5, label="range of the limit")),
    ]
    drawn = {line.get_color() for line in first.lines}
    names = (
        (_LINE, "limit by interpolation of the quantiles"),
        (_CLOSED_FORM, "closed form: worst errors, no later images"),
    )
    handles += [Line2D([], [], label=name, **look) for look, name in names if look["color"] in drawn]
    figure.legend(
        handles=handles,
        loc="lower center",
        ncols=max(1, len(handles) if len(handles) < _MAX_LEGEND_COLUMNS else -(-len(handles) // 2)),
        title=_map_notes(table, shown, noise),
        title_fontsize=7.0,
    )
    return figure


def _map_notes(table: SweepTable, shown: Sequence[QuantileName], noise: str) -> str:
    """Return the meaning of the numbers in the map of decisions, and of cells and quantiles that are not drawn."""
    required, notes = table.required, []
    if len(table.cells) <= MAX_NUMBERS:
        level = f", {level_name(required.quantile.level)}" if isinstance(required, Requirement) else ""
        notes.append(f"numbers in (a): {QUANTITY_NAMES[required.quantity]}{level}")
    values = [table.grid(noise, quantile) for quantile in shown]
    if any(np.ma.getmaskarray(grid).any() for grid in values):
        notes.append(f"{_NO_VALUE} or white: too few runs for the quantile")
    hidden = [
        f"{QUANTITY_NAMES[quantile.quantity].split(', ')[0]} {level_name(quantile.level)}"
        for quantile, grid in zip(shown, values, strict=True)
        if not grid.count() and not (isinstance(required, Requirement) and quantile == required.quantile)
    ]
    return "; ".join([*notes, *([f"not drawn (too few runs): {', '.join(hidden)}"] if hidden else [])])


def _decision_panel(axes: Axes, table: SweepTable, noise: str) -> None:
    """Draw decision and estimate of each cell, the interval of the limit of each row, and the limit as a line."""
    across, up = table.axes
    shape = len(across.values), len(up.values)
    verdicts = [table.verdict(cell, noise) for cell in range(len(table.cells))]
    decisions = list(DECISION_COLOURS)
    codes = [0 if verdict is None else decisions.index(verdict.decision) for verdict in verdicts]
    shown = np.ma.MaskedArray(codes, mask=[verdict is None for verdict in verdicts]).reshape(shape)
    colours = ListedColormap([*DECISION_COLOURS.values()])
    axes.pcolormesh(_edges(across), _edges(up), shown.T, cmap=colours, vmin=-0.5, vmax=2.5, **_CELLS)
    _scale(axes, across, "x")
    _scale(axes, up, "y")
    axes.grid(visible=False)
    for row, height in enumerate(_heights(up, _BAR_AT)):
        cells = [verdicts[column * shape[1] + row] for column in range(shape[0])]
        for limit in limits(across, cells):
            ends = [limit.lower, limit.upper]
            axes.plot(ends, [height, height], color="white", linewidth=3.2, solid_capstyle="butt", zorder=4.0)
            axes.plot(ends, [height, height], color=IMPULSE, linewidth=1.5, solid_capstyle="butt", zorder=4.5)
    values = _masked([None if verdict is None else verdict.value for verdict in verdicts], shape)
    compared = [(None, None) if verdict is None else (verdict.quantile, verdict.bound) for verdict in verdicts]
    log_values = spans_decades([quantile for quantile, _ in compared if quantile is not None])
    halo = [Stroke(linewidth=2.6, foreground="white"), Normal()]

    def draw(pairs: Sequence[tuple[float | None, float | None]], look: dict[str, Any]) -> None:
        for line in zero_lines(across, up, _masked([above_bound(*pair, log_values) for pair in pairs], shape)):
            axes.plot(*line.T, zorder=3.5, path_effects=halo, **look)

    if table.closed_form_m:
        draw([(value, table.required.bound) for value in table.closed_form_m], _CLOSED_FORM)
    if {Decision.MET, Decision.NOT_MET} <= {verdict.decision for verdict in verdicts if verdict is not None}:
        draw(compared, _LINE)
    _write_numbers(axes, across, up, values.T, lambda row, column: shown[column, row] == 0, _clear_heights(axes, table))
    for text, decision in zip(axes.texts, shown.T.flat, strict=False):  # readable on the lines
        ground = "white" if decision is np.ma.masked else DECISION_COLOURS[decisions[int(decision)]]
        text.set_path_effects([Stroke(linewidth=1.6, foreground=ground), Normal()])
    separate_labels(axes)


def _clear_heights(axes: Axes, table: SweepTable) -> Floats:
    """Return heights at which numbers in the cells of a map cover little of its lines, shape (rows, columns)."""
    across, up = table.axes
    axes.set(xlim=axes.get_xlim(), ylim=axes.get_ylim())
    lines = [axes.transData.transform(np.asarray(line.get_xydata())) for line in axes.lines]
    parts = np.linspace(0.0, 1.0, 50)[:, None, None]
    points = np.concatenate(
        [((1.0 - parts) * line[:-1] + parts * line[1:]).reshape(-1, 2) for line in [np.zeros((1, 2)), *lines]]
    )
    heights = np.array([_heights(up, part) for part in _NUMBERS_AT])
    middle = axes.transData.transform(
        np.stack(np.broadcast_arrays(across.values, heights[:, :, None]), axis=-1).reshape(-1, 2)
    )
    cell = np.array(axes.get_window_extent().size) / (len(across.values), len(up.values))
    size = 0.5 * cell * (_NUMBER_WIDTH, _NUMBER_HEIGHT)
    covered = (np.abs(points - middle[:, None]) < size).all(axis=2).sum(axis=1)
    best = covered.reshape(len(heights), len(up.values), len(across.values)).argmin(axis=0)
    return np.asarray(heights[best, np.arange(len(up.values))[:, None]])


def _masked(values: Sequence[float | None], shape: tuple[int, ...]) -> Grid:
    """Return values as an array that is masked where they are None."""
    return np.ma.masked_invalid([math.nan if value is None else value for value in values]).reshape(shape)


def zero_lines(across: Axis, up: Axis, values: Grid) -> list[Floats]:
    """Return the lines on which values of a map, shape (columns, rows), are zero.

    They are interpolated linearly on the scales of both axes, as in `sweep_table.limits`.
    """
    x, y = (np.log(axis.values) if axis.scale == "log" else np.array(axis.values) for axis in (across, up))
    is_log = [axis.scale == "log" for axis in (across, up)]
    lines = map(np.asarray, contour_generator(x=x, y=y, z=values.T).lines(0.0))
    return [np.exp(line, out=line.copy(), where=is_log) for line in lines]


def _map_panel(figure: Figure, axes: Axes, table: SweepTable, noise: str, quantile: QuantileName) -> None:
    across, up = table.axes
    values = table.grid(noise, quantile).T
    norm = _norm(values)
    image = axes.pcolormesh(_edges(across), _edges(up), values, cmap=_COLOURS, norm=norm, **_CELLS)
    box, mm = axes.get_position(), 1.0 / (25.4 * figure.get_figwidth())
    bar = figure.colorbar(image, ax=axes, cax=figure.add_axes((box.x1 + 2.0 * mm, box.y0, 3.0 * mm, box.height)))
    bar.ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)) if isinstance(norm, LogNorm) else MaxNLocator(6))
    bar.ax.yaxis.set_major_formatter(FuncFormatter(lambda tick, _: f"{tick:g}"))
    bar.ax.yaxis.set_minor_formatter(NullFormatter())
    _scale(axes, across, "x")
    _scale(axes, up, "y")
    axes.grid(visible=False)
    middle = np.broadcast_to(_heights(up, 0.5)[:, None], values.shape)
    _write_numbers(axes, across, up, values, lambda row, column: float(norm(float(values[row, column]))) > 0.48, middle)
    separate_labels(axes)
    separate_labels(bar.ax)


def _write_numbers(axes: Axes, across: Axis, up: Axis, values: Grid, is_dark: Any, heights: Floats) -> None:
    """Write the values into the cells of a map at heights of shape (rows, columns), unless there are too many cells."""
    if values.size > MAX_NUMBERS:
        return
    room_mm = width_mm(axes) / len(across.values)
    size = min(6.5, room_mm / _MM_PER_POINT / 2.6)
    look: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": size, "zorder": 6.0}
    for row, column in np.ndindex(values.shape):
        known = not np.ma.getmaskarray(values)[row, column]
        value = float(values[row, column]) if known else 0.0
        text = f"{value:.3g}" if value < 100.0 else f"{value:.0f}"
        colour = "white" if known and is_dark(row, column) else INK
        axes.text(
            across.values[column], float(heights[row, column]), text if known else _NO_VALUE, color=colour, **look
        )


def _heights(up: Axis, part: float) -> Floats:
    """Return a height within each row of a map, as a fraction of the row on the scale of the axis."""
    edges = _edges(up)
    if up.scale == "log":
        return np.asarray(edges[:-1] ** (1.0 - part) * edges[1:] ** part)
    return np.asarray(edges[:-1] + part * (edges[1:] - edges[:-1]))


def _norm(values: Grid) -> Normalize:
    """Return the scale of the colours: logarithmic if the values differ by more than a factor of 10."""
    low, high = float(values.min()), float(values.max())
    if low > 0.0 and high > 10.0 * low:
        return LogNorm(low, high)
    return Normalize(low, high if high > low else low + 1.0)


def _edges(axis: Axis) -> Floats:
    """Return the edges of the cells around the values of an axis, midway between the values on its scale."""
    values = np.log(axis.values) if axis.scale == "log" else np.array(axis.values)
    middle = 0.5 * (values[1:] + values[:-1])
    edges = np.concatenate([[2.0 * values[0] - middle[0]], middle, [2.0 * values[-1] - middle[-1]]])
    return np.exp(edges) if axis.scale == "log" else edges


def _scale_values(axes: Axes, quantity: str, values: Sequence[float]) -> None:
    """Set the scale of the estimates: logarithmic if they differ by decades, otherwise from zero."""
    if quantity == "hit":
        axes.set_ylim(-0.03, 1.03)
        return
    if spans_decades(values):
        axes.set_yscale("log")
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.yaxis.set_major_formatter(FuncFormatter(lambda tick, _: f"{tick:g}"))
        axes.yaxis.set_minor_formatter(NullFormatter())
    else:
        axes.set_ylim(0.0, _HEAD_ROOM * axes.get_ylim()[1])


def _scale(axes: Axes, axis: Axis, which: str) -> None:
    """Set scale and label of an axis; the ticks are at its values if they are few."""
    one = axes.xaxis if which == "x" else axes.yaxis
    if axis.scale == "log":
        (axes.set_xscale if which == "x" else axes.set_yscale)("log")
        one.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    if len(axis.values) <= _MAX_TICKS:
        one.set_major_locator(FixedLocator(axis.values))
        one.set_minor_locator(NullLocator())
    one.set_major_formatter(FuncFormatter(lambda tick, _: _tick_text(axis, tick)))
    one.set_minor_formatter(NullFormatter())
    one.set_tick_params(length=2.0)
    one.set_label_text(_axis_label(axis, which))


def _axis_label(axis: Axis, which: str) -> str:
    """Return the label of an axis with the power of ten of its tick labels, in lines."""
    power, unit = _power(axis), unit_of(axis.key)
    name = key_label(axis.key).removesuffix(f", {unit}") if unit else key_label(axis.key)
    letters = f"10{power}\N{NO-BREAK SPACE}{unit}" if power else unit
    scaled = f"$10^{{{power}}}$ {unit}".strip() if power else unit
    label = "\n".join(textwrap.wrap(f"{name}, {letters}" if letters else name, _MAX_LETTERS[which]))
    return label.removesuffix(letters) + scaled


def _tick_text(axis: Axis, tick: float) -> str:
    digits = max(3, separating_digits(axis))
    return f"{float(f'{tick / 10.0 ** _power(axis):.{digits}g}'):.{digits}g}"


def _power(axis: Axis) -> int:
    """Return the power of ten of the labels of an axis: that of the minimum value if the values span a decade."""
    sizes = [abs(value) for value in axis.values]
    maximum, minimum = max(sizes), min(sizes)
    if 0.01 <= maximum < 1e5:
        return 0
    return math.floor(math.log10(minimum if 10.0 * minimum < maximum < 1000.0 * minimum else maximum))


def _look(levels: Sequence[float], level: float) -> Any:
    return _DASHES[min(levels.index(level), len(_DASHES) - 1)]


def requirement_words(required: AnyRequirement) -> str:
    """Return a requirement in words: `miss p99 under 10 m`."""
    if not isinstance(required, Requirement):
        return f"probability of a hit at least {number_text(required.share)}"
    name, unit = QUANTITY_NAMES[required.quantity].split(", ")
    return f"{name} {level_name(required.quantile.level)} under {required.bound:g} {unit}"
