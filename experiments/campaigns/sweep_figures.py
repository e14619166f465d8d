"""Figures of a sweep: the decisions about the requirement, and quantiles as lines (one key) or heat
maps (two keys).

The values of a key are drawn at the positions 0, 1, 2, ...: those of `--vary` are equally spaced on
its scale, linear or logarithmic, and lines between them interpolate on this scale, as
`sweep_table.limits` does.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.axis import Axis as MatplotlibAxis
from matplotlib.colors import ListedColormap, LogNorm, Normalize
from matplotlib.figure import Figure

from infoset.arrays import Floats
from infoset.experiments.campaigns.sweep_axes import key_label
from infoset.experiments.campaigns.sweep_table import SweepTable, above_bound, spans_decades
from infoset.experiments.common.figure_style import (
    GUARANTEED,
    HALO,
    IMPULSE,
    INK,
    LIMIT,
    LINE_LOOKS,
    TICKS,
    WIDTH_MM,
    first_panels,
    legend_below,
    letters,
    plain_ticks,
    style,
    subplots,
)
from infoset.sim import QuantileName, Requirement
from infoset.sim.requirement import AnyRequirement, Decision
from infoset.sim.statistics import level_name, number_text
from infoset.sim.storage import Axis

DECISION_COLOURS = {
    Decision.MET: "#7fb0d6",
    Decision.UNDECIDED: "#ececec",
    Decision.NOT_MET: "#f2a65a",
}
"""Colours that differ in grey too, and for colour-blind readers."""
MAX_NUMBERS = 120
"""Maximum number of cells for which numbers are drawn in the cells."""
QUANTITY_NAMES = {
    "miss_m": "miss, m",
    "impulse_m_s": "impulse spent, m/s",
    "guaranteed_miss_m": "guaranteed miss, m",
    "hit": "probability of a hit",
    "cause": "probability of no miss by this cause",
}
_PANEL_MM, _LEGEND_MM = 66.0, 24.0
_TICK_LETTERS, _LABEL_LETTERS = 32, 40
"""Maximum numbers of letters of all tick labels of an axis, and of a line of its label."""
_DARK = 0.55
"""Part of the scale of colours from which numbers are white."""
_NO_VALUE = "\N{EN DASH}"
"""Text in the cells whose runs do not show the quantile."""


@style()
def draw_sweep(table: SweepTable, shown: Sequence[QuantileName], noise: str) -> Figure:
    """Draw the decisions and the quantiles of a sweep with one or two axes, for one noise.

    With one axis there is a panel for each quantity, with the quantiles as lines; with two axes
    there is a map of the decisions, and a heat map for each other quantile that the runs show. The
    panel of the requirement is the first.
    """
    figure = (_lines if len(table.axes) == 1 else _maps)(table, table.of_noise(noise), shown)
    figure.suptitle(f"{noise} noise")
    return figure


def _panels(count: int) -> tuple[Figure, Any]:
    rows = -(-count // 2)
    columns = min(2, count)
    figure, grid = subplots(
        rows * _PANEL_MM + _LEGEND_MM,
        rows,
        columns,
        width_mm=WIDTH_MM if columns > 1 else 0.7 * WIDTH_MM,
    )
    return figure, first_panels(grid, count)


def _lines(table: SweepTable, cells: pd.DataFrame, shown: Sequence[QuantileName]) -> Figure:
    (axis,), required = table.axes, table.required
    levels = sorted({quantile.level for quantile in shown}, reverse=True)
    lines: dict[str, list[tuple[str, dict[str, Any]]]] = {required.quantity: []}
    if not isinstance(required, Requirement):
        lines[required.quantity].append(("required_value", {"color": INK, "marker": "o"}))
    for quantile in shown:
        look = LINE_LOOKS[levels.index(quantile.level) % len(LINE_LOOKS)] | {
            "label": level_name(quantile.level)
        }
        lines.setdefault(quantile.quantity, []).append((_column(table, quantile), look))
    figure, panels = _panels(len(lines))
    for axes, (quantity, columns) in zip(panels, lines.items(), strict=True):
        for column, look in columns:
            _draw_estimates(axes, cells, column, look)
        if quantity in ("hit", "cause"):
            axes.set_ylim(-0.03, 1.03)
        elif spans_decades(cells[[column for column, _ in columns]].stack()):
            axes.set_yscale("log")
            plain_ticks(axes.yaxis, TICKS)
        else:
            axes.set_ylim(0.0)
        if quantity == required.quantity:
            _shade_decisions(axes, cells)
            axes.axhline(
                required.bound,
                color=IMPULSE,
                linewidth=1.0,
                label=f"required: {requirement_words(required)}",
            )
        if (
            quantity == "miss_m"
            and required.quantity == "hit"
            and cells["limit_bound"].nunique() == 1
        ):
            radius_m = float(cells["limit_bound"].iloc[0])
            axes.axhline(
                radius_m, color=LIMIT, linewidth=1.0, linestyle="--", label="radius of the body"
            )
        _name_values(axes.xaxis, axis)
        axes.set(xlim=(-0.5, len(axis.values) - 0.5), ylabel=QUANTITY_NAMES[quantity])
    letters(panels)
    legend_below(
        figure, 4, title="bars: 95 % confidence intervals; arrows: too few runs for an upper end"
    )
    return figure


def _draw_estimates(axes: Axes, cells: pd.DataFrame, column: str, look: dict[str, Any]) -> None:
    """Draw a column with its intervals, with an arrow up where there are too few runs for an upper
    end.
    """
    at = np.arange(len(cells))
    name = column.removesuffix("_value")
    value, lower, upper = (
        cells[each].to_numpy(np.float64) for each in (column, f"{name}_lower", f"{name}_upper")
    )
    axes.plot(at, value, markersize=3.5, zorder=3.0, **look)
    top = np.where(np.isnan(upper), np.fmax(value, lower), upper)
    colour = look["color"]
    axes.vlines(at, lower, top, color=colour, linewidth=0.8, zorder=2.0)
    arrows = np.where(np.isnan(upper), top, np.nan)
    axes.plot(
        at, arrows, color=colour, linestyle="", marker="$\\uparrow$", markersize=7.0, zorder=2.0
    )


def _shade_decisions(axes: Axes, cells: pd.DataFrame) -> None:
    for decision, colour in DECISION_COLOURS.items():
        for number in np.flatnonzero(cells["requirement"] == decision.value):
            axes.axvspan(
                number - 0.5,
                number + 0.5,
                facecolor=colour,
                alpha=0.5,
                label=str(decision),
                zorder=0.5,
            )


def _maps(table: SweepTable, cells: pd.DataFrame, shown: Sequence[QuantileName]) -> Figure:
    columns = {quantile: _column(table, quantile) for quantile in shown}
    drawn = {
        name: column
        for name, column in columns.items()
        if column != "required_value" and cells[column].count()
    }
    figure, panels = _panels(1 + len(drawn))
    _draw_decisions(panels[0], table, cells)
    titles = [requirement_words(table.required)]
    notes = []
    for axes, (quantile, column) in zip(panels[1:], drawn.items(), strict=True):
        _draw_heat(figure, axes, _grid(table, cells[column]))
        name, unit = QUANTITY_NAMES[quantile.quantity].split(", ")
        titles.append(f"{name}, {level_name(quantile.level)}, {unit}")
    for axes in panels:
        axes.grid(visible=False)
        _name_values(axes.xaxis, table.axes[0])
        _name_values(axes.yaxis, table.axes[1])
    letters(panels, titles)
    if len(cells) <= MAX_NUMBERS:
        level = (
            f", {level_name(table.required.share)}"
            if isinstance(table.required, Requirement)
            else ""
        )
        notes.append(f"numbers in (a): {QUANTITY_NAMES[table.required.quantity]}{level}")
    if cells[["required_value", *columns.values()]].isna().any(axis=None):
        notes.append(f"{_NO_VALUE} or no map: too few runs for the quantile")
    legend_below(figure, 2, title="; ".join(notes))
    return figure


def _draw_decisions(axes: Axes, table: SweepTable, cells: pd.DataFrame) -> None:
    """Draw decision and estimate of each cell, and the lines on which quantiles equal their
    bound.
    """
    codes = cells["requirement"].map(
        {decision.value: code for code, decision in enumerate(DECISION_COLOURS)}
    )
    _draw_cells(
        axes,
        _grid(table, codes),
        cmap=ListedColormap([*DECISION_COLOURS.values()]),
        vmin=-0.5,
        vmax=2.5,
    )
    for decision, colour in DECISION_COLOURS.items():
        if decision.value in set(cells["requirement"]):
            axes.fill([], [], color=colour, label=str(decision))
    values = _grid(table, cells["required_value"])
    _write_numbers(axes, values, np.zeros(values.shape, dtype=bool), path_effects=HALO)
    if {Decision.MET.value, Decision.NOT_MET.value} <= set(cells["requirement"]):
        _draw_zero(
            axes,
            table,
            cells,
            "limit_quantile",
            color=INK,
            label="limit, interpolated between cells",
        )
    if "closed_form_m" in cells:
        look = {
            "color": GUARANTEED,
            "linestyle": "--",
            "label": "closed form: worst errors, no later images",
        }
        _draw_zero(axes, table, cells, "closed_form_m", **look)


def _draw_zero(
    axes: Axes, table: SweepTable, cells: pd.DataFrame, column: str, **look: Any
) -> None:
    """Draw the line on which a quantile equals its bound."""
    above = _grid(table, above_bound(cells, column))
    if (above < 0.0).any() and (above > 0.0).any():
        dashes = look.get("linestyle", "-")
        axes.contour(above, levels=[0.0], colors=look["color"], linestyles=dashes).set(
            path_effects=HALO
        )
        axes.plot([], [], **look)  # the entry in the legend


def _draw_heat(figure: Figure, axes: Axes, values: Floats) -> None:
    """Draw a quantile as a heat map, with a logarithmic scale of colours if it varies by more than
    a factor of 10.
    """
    low = float(np.nanmin(values))
    high = float(np.nanmax(values))
    norm = LogNorm(low, high) if high > 10.0 * low > 0.0 else Normalize(low, max(high, low + 1e-9))
    bar = figure.colorbar(_draw_cells(axes, values, cmap="Blues", norm=norm), ax=axes)
    if isinstance(norm, LogNorm):
        plain_ticks(bar.ax.yaxis, TICKS)
    _write_numbers(
        axes, values, np.ma.filled(norm(np.ma.masked_invalid(values)) > _DARK, fill_value=False)
    )


def _grid(table: SweepTable, values: Any) -> Floats:
    """Return a column of cells as a map, shape (values of the second axis, values of the first)."""
    shape = tuple(len(axis.values) for axis in table.axes)
    return np.asarray(values, dtype=np.float64).reshape(shape).T


def _draw_cells(axes: Axes, values: Floats, **look: Any) -> Any:
    """Draw values as cells around their numbers of row and column."""
    at = [np.arange(size) for size in reversed(values.shape)]
    return axes.pcolormesh(*at, values, edgecolors="white", linewidth=0.3, **look)


def _write_numbers(axes: Axes, values: Floats, is_dark: Any, **look: Any) -> None:
    """Write the values into the cells of a map, unless there are too many cells."""
    if values.size > MAX_NUMBERS:
        return
    size = min(7.0, 54.0 / values.shape[1])
    for (row, column), value in np.ndenumerate(values):
        text = (
            _NO_VALUE if np.isnan(value) else f"{value:.3g}" if value < 1000.0 else f"{value:.0f}"
        )
        colour = "white" if is_dark[row, column] else INK
        axes.text(
            column,
            row,
            text,
            color=colour,
            ha="center",
            va="center",
            fontsize=size,
            zorder=4.0,
            **look,
        )


def _name_values(one: MatplotlibAxis, axis: Axis) -> None:
    """Label an axis with its key, and its positions 0, 1, 2, ... with the values, a few of them if
    they are many.
    """
    maximum = max(map(abs, axis.values))
    power = 0 if 0.01 <= maximum < 1e5 else math.floor(math.log10(maximum))
    names = [f"{value / 10.0**power:.4g}" for value in axis.values]
    step = -(-len(names) * max(map(len, names)) // _TICK_LETTERS)
    one.set_ticks(range(0, len(names), step), names[::step])
    one.set_label_text(
        textwrap.fill(
            key_label(axis.key, f"$10^{{{power}}}$\N{NO-BREAK SPACE}" if power else ""),
            _LABEL_LETTERS,
        )
    )


def _column(table: SweepTable, quantile: QuantileName) -> str:
    """Return the column of a quantile: for the required one, that of the estimate that decides."""
    is_required = isinstance(table.required, Requirement) and quantile == table.required.quantile
    return "required_value" if is_required else f"{quantile.quantity}_{level_name(quantile.level)}"


def requirement_words(required: AnyRequirement) -> str:
    """Return a requirement in words: `miss p99 under 10 m`."""
    if not isinstance(required, Requirement):
        what = "a hit" if required.cause is None else f"no miss by {required.cause.value}"
        return f"probability of {what} at least {number_text(required.share)}"
    name, unit = QUANTITY_NAMES[required.quantity].split(", ")
    return f"{name} {level_name(required.quantile.level)} under {required.bound:g} {unit}"
