"""Figures of a sweep: quantiles as lines (one key) or heat maps (two keys), with the bound of a requirement."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import Colormap, LinearSegmentedColormap, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.markers import CARETUPBASE
from matplotlib.patheffects import Stroke
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter, NullLocator
from numpy.typing import NDArray

from experiments.campaigns.sweep_table import SweepTable, crossings, key_label, unit_of
from experiments.common.figure_style import CURVE_LOOKS, IMPULSE, INK, new_figure, place_axes, style
from sim import QuantileName, Requirement
from sim.stopping_rule import level_name
from sim.storage import Axis

Floats = NDArray[np.float64]
Grid = np.ma.MaskedArray[tuple[int, ...], np.dtype[np.float64]]

MOST_NUMBERS = 120
"""Greatest number of cells for which numbers are drawn in the cells."""

QUANTITY_NAMES = {"miss_m": "miss, m", "impulse_m_s": "impulse spent, m/s", "guaranteed_miss_m": "guaranteed miss, m"}
_PANEL_MM = 56.0
_COLOURS: Colormap = LinearSegmentedColormap.from_list(
    "infoset", ["#f7fbff", "#c6d9ec", "#7fb0d6", "#3f7fb5", "#1b4f8a", "#08306b"]
)
_DASHES: tuple[tuple[float, Sequence[float]] | None, ...] = (
    None,
    (0.0, (5.0, 1.5)),
    (0.0, (1.5, 1.2)),
    (0.0, (6.0, 1.0, 1.0, 1.0)),
)
"""Line styles from the largest quantile down; None is a solid line."""

_MOST_TICKS = 8
_HEAD_ROOM = 1.06
"""Factor of the axis, for the arrow of the topmost point."""


def draw_sweep(table: SweepTable, shown: Sequence[QuantileName], requirement: Requirement | None) -> Figure:
    """Draw quantiles of a sweep over its one or two axes.

    With one axis there is a panel for each quantity and noise, with the quantiles as lines; with two axes there is a
    heat map for each quantile and noise. The bound of the requirement is drawn in panels with its quantile.

    Raises
    ------
    ValueError
        If there are more axes, or no quantile.
    """
    if len(table.axes) not in (1, 2) or not shown:
        raise ValueError("only a sweep with one or two axes can be drawn, with at least one quantile")
    with style():
        return _lines(table, shown, requirement) if len(table.axes) == 1 else _maps(table, shown, requirement)


def _lines(table: SweepTable, shown: Sequence[QuantileName], requirement: Requirement | None) -> Figure:
    quantities = list(dict.fromkeys(quantile.quantity for quantile in shown))
    rows = len(table.noises)
    levels = sorted({quantile.level for quantile in shown}, reverse=True)
    figure = new_figure(height_mm=rows * (_PANEL_MM + 16.0) + 12.0, width_mm=90.0 * len(quantities))
    grid = place_axes(figure, rows, len(quantities), margins_mm=(16.0, 4.0, 22.0, 7.0), gaps_mm=(16.0, 18.0))
    letter = iter("abcdefghijklmnopqrstuvwxyz")
    for row, noise in zip(grid, table.noises, strict=True):
        for axes, quantity in zip(row, quantities, strict=True):
            quantiles = [quantile for quantile in shown if quantile.quantity == quantity]
            _line_panel(axes, table, noise, quantiles, levels, requirement)
            axes.set_title(f"({next(letter)}) {noise} noise")
            axes.set_ylabel(QUANTITY_NAMES[quantity])
    handles = [
        Line2D([], [], color=INK, linestyle=_look(levels, level), marker="o", markersize=3, label=level_name(level))
        for level in levels
    ]
    if requirement is not None:
        handles.append(Line2D([], [], color=IMPULSE, linewidth=0.9, label=f"required: {_words(requirement)}"))
    note = "bars: 95 % confidence intervals; arrow: too few runs for an upper end"
    figure.legend(handles=handles, loc="lower center", ncols=len(handles), title=note, title_fontsize=7.0)
    return figure


def _line_panel(
    axes: Axes,
    table: SweepTable,
    noise: str,
    quantiles: Sequence[QuantileName],
    levels: Sequence[float],
    requirement: Requirement | None,
) -> None:
    (axis,) = table.axes
    colour = CURVE_LOOKS[1 if noise == "random" else 3]["color"]
    for quantile in quantiles:
        estimates = [table.estimate(cell, noise, quantile) for cell in range(len(axis.values))]
        known = [
            (value, estimate) for value, estimate in zip(axis.values, estimates, strict=True) if estimate is not None
        ]
        if not known:
            continue
        keys, values = [value for value, _ in known], [estimate.value for _, estimate in known]
        axes.plot(
            keys,
            values,
            color=colour,
            linestyle=_look(levels, quantile.level),
            marker="o",
            markersize=3.0,
            zorder=3.0,
        )
        ends = [(estimate.lower, estimate.upper) for _, estimate in known]
        for key, value, (lower, upper) in zip(keys, values, ends, strict=True):
            axes.plot(
                [key, key],
                [value if lower is None else lower, value if upper is None else upper],
                color=colour,
                linewidth=0.8,
                zorder=2.0,
            )
            if upper is None:
                axes.plot([key], [value], marker=CARETUPBASE, markersize=6.0, color=colour, zorder=2.0)
        if requirement is not None and requirement.quantile == quantile:
            axes.axhline(requirement.bound, color=IMPULSE, linewidth=0.9, zorder=2.5)
            for crossing in crossings(keys, values, requirement.bound, axis.scale):
                axes.plot([crossing], [requirement.bound], marker="D", markersize=4.5, color=IMPULSE, zorder=5.0)
                axes.vlines(crossing, 0.0, requirement.bound, color=IMPULSE, linewidth=0.7, linestyle=":", zorder=2.5)
                axes.annotate(
                    f"{crossing / 10.0 ** _power(axis):.3g}",
                    (crossing, 0.0),
                    xycoords=axes.get_xaxis_transform(),
                    xytext=(0.0, 3.0),
                    textcoords="offset points",
                    ha="center",
                    color=IMPULSE,
                    bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.8},
                    zorder=6.0,
                )
    axes.set_ylim(0.0, _HEAD_ROOM * axes.get_ylim()[1])
    _scale(axes, axis, "x")


def _maps(table: SweepTable, shown: Sequence[QuantileName], requirement: Requirement | None) -> Figure:
    panels = [(noise, quantile) for noise in table.noises for quantile in shown]
    columns = min(2, len(panels))
    rows = -(-len(panels) // columns)
    figure = new_figure(height_mm=rows * (_PANEL_MM + 20.0) + 10.0, width_mm=90.0 * columns)
    grid = place_axes(figure, rows, columns, margins_mm=(16.0, 16.0, 20.0, 8.0), gaps_mm=(33.0, 20.0))
    for (noise, quantile), axes, letter in zip(
        panels, (axes for row in grid for axes in row), "abcdefghijklmnopqrstuvwxyz", strict=False
    ):
        _map_panel(figure, axes, table, noise, quantile, requirement)
        name, unit = QUANTITY_NAMES[quantile.quantity].split(", ")
        axes.set_title(f"({letter}) {name}, {level_name(quantile.level)}, {unit}; {noise} noise")
    for unused in [axes for row in grid for axes in row][len(panels) :]:
        unused.remove()
    if requirement is not None and requirement.quantile in shown:
        line = Line2D([], [], color=IMPULSE, linewidth=1.5, label=f"required: {_words(requirement)}")
        figure.legend(handles=[line], loc="lower center")
    return figure


def _map_panel(
    figure: Figure,
    axes: Axes,
    table: SweepTable,
    noise: str,
    quantile: QuantileName,
    requirement: Requirement | None,
) -> None:
    across, up = table.axes
    values = table.grid(noise, quantile).T
    norm = _norm(values)
    image = axes.pcolormesh(
        _edges(across), _edges(up), values, cmap=_COLOURS, norm=norm, edgecolors="white", linewidth=0.3, zorder=1.0
    )
    bar = figure.colorbar(image, ax=axes, cax=_colour_axes(figure, axes))
    bar.ax.yaxis.set_major_formatter(FuncFormatter(lambda tick, _: f"{tick:g}"))
    bar.ax.yaxis.set_minor_formatter(NullFormatter())
    _scale(axes, across, "x")
    _scale(axes, up, "y")
    axes.grid(visible=False)
    if values.size <= MOST_NUMBERS:
        _write_numbers(axes, across, up, values, norm)
    if requirement is None or requirement.quantile != quantile:
        return
    met = values < requirement.bound
    if met.any() and not met.all():
        limit = LineCollection(
            between(_edges(across), _edges(up), met), colors=IMPULSE, capstyle="projecting", zorder=4.0
        )
        limit.set_path_effects([Stroke(linewidth=3.2, foreground="white"), Stroke(linewidth=1.5, foreground=IMPULSE)])
        axes.add_collection(limit, autolim=False)
    else:
        extent = "everywhere" if met.all() else "nowhere"
        axes.set_xlabel(f"{axes.get_xlabel()}\n{_words(requirement)}: {extent}")


def between(across: Floats, up: Floats, met: np.ma.MaskedArray[Any, Any]) -> list[list[tuple[float, float]]]:
    """Return the edges between a cell that meets the requirement and a neighbour that does not.

    Parameters
    ----------
    across, up : ndarray, shape (n + 1,) and (m + 1,)
        Edges of the columns and of the rows.
    met : masked array of bool, shape (m, n)
        Whether each cell meets the requirement; a masked cell has no edges.
    """
    rows, columns = met.shape
    right = np.ma.filled(met[:, 1:] != met[:, :-1], fill_value=False)
    above = np.ma.filled(met[1:, :] != met[:-1, :], fill_value=False)
    upright = [
        [(float(across[column + 1]), float(up[row])), (float(across[column + 1]), float(up[row + 1]))]
        for row in range(rows)
        for column in range(columns - 1)
        if right[row, column]
    ]
    level = [
        [(float(across[column]), float(up[row + 1])), (float(across[column + 1]), float(up[row + 1]))]
        for row in range(rows - 1)
        for column in range(columns)
        if above[row, column]
    ]
    return upright + level


def _write_numbers(axes: Axes, across: Axis, up: Axis, values: Grid, norm: Normalize) -> None:
    size = 6.5 if max(len(across.values), len(up.values)) <= 8 else 5.0
    for row, y in enumerate(up.values):
        for column, x in enumerate(across.values):
            if np.ma.getmaskarray(values)[row, column]:
                continue
            value = float(values[row, column])
            axes.text(
                x,
                y,
                f"{value:.3g}" if value < 100.0 else f"{value:.0f}",
                ha="center",
                va="center",
                fontsize=size,
                color="white" if float(norm(value)) > 0.48 else INK,
                zorder=5.0,
            )


def _norm(values: Grid) -> Normalize:
    """Return the scale of the colours: logarithmic if the values differ by more than a factor of 10."""
    low, high = float(values.min()), float(values.max())
    if low > 0.0 and high > 10.0 * low:
        return LogNorm(low, high)
    return Normalize(low, high if high > low else low + 1.0)


def _colour_axes(figure: Figure, axes: Axes) -> Axes:
    """Return axes for the colour scale to the right of a heat map."""
    box = axes.get_position()
    width, _ = figure.get_size_inches()
    gap, thick = 2.0 / (25.4 * width), 3.0 / (25.4 * width)
    return figure.add_axes((box.x1 + gap, box.y0, thick, box.height))


def _edges(axis: Axis) -> Floats:
    """Return the edges of the cells around the values of an axis, midway between the values on its scale."""
    values = np.log(axis.values) if axis.scale == "log" else np.array(axis.values)
    middle = 0.5 * (values[1:] + values[:-1])
    edges = np.concatenate([[2.0 * values[0] - middle[0]], middle, [2.0 * values[-1] - middle[-1]]])
    return np.exp(edges) if axis.scale == "log" else edges


def _scale(axes: Axes, axis: Axis, which: str) -> None:
    """Set scale and label of an axis; the ticks are at its values if they are few."""
    one = axes.xaxis if which == "x" else axes.yaxis
    if axis.scale == "log":
        (axes.set_xscale if which == "x" else axes.set_yscale)("log")
        one.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    if len(axis.values) <= _MOST_TICKS:
        one.set_major_locator(FixedLocator(axis.values))
        one.set_minor_locator(NullLocator())
    power = _power(axis)
    one.set_major_formatter(FuncFormatter(lambda tick, _: f"{tick / 10.0**power:.3g}"))
    one.set_minor_formatter(NullFormatter())
    one.set_tick_params(length=2.0)
    unit = unit_of(axis.key)
    scaled = f"$10^{{{power}}}$ {unit}".strip() if power else unit
    name = key_label(axis.key).removesuffix(f", {unit}") if unit else key_label(axis.key)
    one.set_label_text(f"{name}, {scaled}" if scaled else name)


def _power(axis: Axis) -> int:
    """Return the power of ten of the labels of an axis."""
    greatest = max(abs(value) for value in axis.values)
    return 0 if 0.01 <= greatest < 1e5 else math.floor(math.log10(greatest))


def _look(levels: Sequence[float], level: float) -> Any:
    """Return the line style of one of several quantiles."""
    return _DASHES[min(levels.index(level), len(_DASHES) - 1)] or "-"


def _words(requirement: Requirement) -> str:
    name, unit = QUANTITY_NAMES[requirement.quantile.quantity].split(", ")
    return f"{name} {level_name(requirement.quantile.level)} under {requirement.bound:g} {unit}"
