"""Figures of a sweep: decisions and quantiles as lines (one key) or maps (two keys).

The values of a key are drawn at the positions 0, 1, 2, ...: the values of `--vary` are equally
spaced on its scale, linear or logarithmic. Lines between them interpolate on this scale, as
`sweep_table.limits` does. Sizes and margins without a reason were chosen by eye (`figure_style`).
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
"""Maximum number of cells for which numbers are drawn in the cells: more would be too small."""
QUANTITY_NAMES = {
    "miss_m": "miss, m",
    "impulse_m_s": "impulse spent, m/s",
    "guaranteed_miss_m": "guaranteed miss, m",
    "hit": "probability of a hit",
    "cause": "probability of no miss by this cause",
}
_PANEL_MM = 66.0
"""Height of a row of panels; chosen: a panel of two in a row is then about as high as wide."""
_SINGLE_MM = 0.7 * WIDTH_MM
"""Width of a figure with a single panel; chosen: the title of the legend is 105 mm long (measured),
more than half of `WIDTH_MM`.
"""
_LEGEND_MM = 24.0
"""Height of the legend: up to three rows of entries and the title; chosen."""
_TICK_LETTERS = 32
"""Maximum number of letters of all tick labels of an axis: more would touch each other."""
_LABEL_LETTERS = 40
"""Maximum number of letters of a line of an axis label: the width of a panel."""
_DARK = 0.55
"""Part of the scale of colours, from 0 (light) to 1 (dark), above which numbers are white: black is
hard to read there. Chosen by eye.
"""
_NO_VALUE = "\N{EN DASH}"
"""Text in the cells whose runs do not show the quantile."""


@style()
def draw_sweep(table: SweepTable, shown: Sequence[QuantileName], noise: str) -> Figure:
    """Draw the decisions and the quantiles of a sweep with one or two axes, for one noise.

    With one axis there is a panel for each quantity, with the quantiles as lines; with two axes
    there is a map of the decisions, and a heat map for each other quantile that the runs show. The
    panel of the requirement is the first.
    """
    draw = _lines if len(table.axes) == 1 else _maps
    figure = draw(table, table.of_noise(noise), shown)
    figure.suptitle(f"{noise} noise")
    return figure


def _panels(count: int) -> tuple[Figure, Any]:
    """Return a figure of so many panels, two in a row; a single panel is narrower."""
    rows = -(-count // 2)
    height_mm = rows * _PANEL_MM + _LEGEND_MM
    if count == 1:
        figure, grid = subplots(height_mm, 1, 1, width_mm=_SINGLE_MM)
    else:
        figure, grid = subplots(height_mm, rows, 2, width_mm=WIDTH_MM)
    return figure, first_panels(grid, count)


def _lines(table: SweepTable, cells: pd.DataFrame, shown: Sequence[QuantileName]) -> Figure:
    """Draw a panel for each quantity, with its quantiles as lines over the varied key."""
    (axis,) = table.axes
    lines = _lines_by_quantity(table, shown)
    figure, panels = _panels(len(lines))
    for axes, (quantity, columns) in zip(panels, lines.items(), strict=True):
        for column, look in columns:
            _draw_estimates(axes, cells, column, look)
        if quantity in ("hit", "cause"):
            # Probabilities: 0 and 1 are near the frame, and not on it.
            axes.set_ylim(-0.03, 1.03)
        elif spans_decades(cells[[column for column, _ in columns]].stack()):
            axes.set_yscale("log")
            plain_ticks(axes.yaxis, TICKS)
        else:
            axes.set_ylim(0.0)

        _draw_requirement(axes, table.required, cells, quantity)
        _name_values(axes.xaxis, axis)
        # Each value has the width of 1, which `_shade_decisions` fills.
        axes.set(xlim=(-0.5, len(axis.values) - 0.5), ylabel=QUANTITY_NAMES[quantity])

    letters(panels)
    legend_below(
        figure, 4, title="bars: 95 % confidence intervals; arrows: too few runs for an upper end"
    )
    return figure


def _lines_by_quantity(
    table: SweepTable, shown: Sequence[QuantileName]
) -> dict[str, list[tuple[str, dict[str, Any]]]]:
    """Return the columns of each quantity, with their line styles; the required one is first."""
    required = table.required
    levels = sorted({quantile.level for quantile in shown}, reverse=True)
    lines: dict[str, list[tuple[str, dict[str, Any]]]] = {required.quantity: []}
    if not isinstance(required, Requirement):
        # A required probability is no quantile, so it is not among those shown.
        lines[required.quantity].append(("required_value", {"color": INK, "marker": "o"}))
    for quantile in shown:
        look = LINE_LOOKS[levels.index(quantile.level) % len(LINE_LOOKS)]
        look = look | {"label": level_name(quantile.level)}
        lines.setdefault(quantile.quantity, []).append((_column(table, quantile), look))
    return lines


def _draw_requirement(
    axes: Axes, required: AnyRequirement, cells: pd.DataFrame, quantity: str
) -> None:
    """Draw the decisions and the bound in the panel of the requirement.

    A required probability of hits has the radius of the body as its bound of the miss.
    """
    if quantity == required.quantity:
        _shade_decisions(axes, cells)
        label = f"required: {requirement_words(required)}"
        axes.axhline(required.bound, color=IMPULSE, linewidth=1.0, label=label)
    # A radius that is varied has several values, and an unknown one (NaN) counts as none.
    is_one_radius = required.quantity == "hit" and cells["limit_bound"].nunique() == 1
    if quantity == "miss_m" and is_one_radius:
        radius_m = float(cells["limit_bound"].iloc[0])
        dashed: dict[str, Any] = {"color": LIMIT, "linewidth": 1.0, "linestyle": "--"}
        axes.axhline(radius_m, label="radius of the body", **dashed)


def _draw_estimates(axes: Axes, cells: pd.DataFrame, column: str, look: dict[str, Any]) -> None:
    """Draw a column with its intervals; an arrow up means too few runs for an upper end."""
    name = column.removesuffix("_value")
    value = cells[column].to_numpy(np.float64)
    lower = cells[f"{name}_lower"].to_numpy(np.float64)
    upper = cells[f"{name}_upper"].to_numpy(np.float64)

    at = np.arange(len(cells))
    colour = look["color"]
    axes.plot(at, value, markersize=3.5, zorder=3.0, **look)
    # Without an upper end the bar ends at the greater of value and lower end; NaN is ignored.
    top = np.where(np.isnan(upper), np.fmax(value, lower), upper)
    axes.vlines(at, lower, top, color=colour, linewidth=0.8, zorder=2.0)

    arrow: dict[str, Any] = {"linestyle": "", "marker": "$\\uparrow$", "markersize": 7.0}
    arrows = np.where(np.isnan(upper), top, np.nan)
    axes.plot(at, arrows, color=colour, zorder=2.0, **arrow)


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
    """Draw a map of the decisions, and a heat map for each other quantile that the runs show."""
    columns = {quantile: _column(table, quantile) for quantile in shown}
    drawn = {
        quantile: column
        for quantile, column in columns.items()
        if column != "required_value" and cells[column].count()
    }
    figure, panels = _panels(1 + len(drawn))
    _draw_decisions(panels[0], table, cells)
    titles = [requirement_words(table.required)]
    for axes, (quantile, column) in zip(panels[1:], drawn.items(), strict=True):
        _draw_heat(figure, axes, _grid(table, cells[column]))
        name, unit = QUANTITY_NAMES[quantile.quantity].split(", ")
        titles.append(f"{name}, {level_name(quantile.level)}, {unit}")

    for axes in panels:
        axes.grid(visible=False)
        _name_values(axes.xaxis, table.axes[0])
        _name_values(axes.yaxis, table.axes[1])

    letters(panels, titles)

    notes = []
    if len(cells) <= MAX_NUMBERS:
        note = f"numbers in (a): {QUANTITY_NAMES[table.required.quantity]}"
        if isinstance(table.required, Requirement):
            note += f", {level_name(table.required.share)}"
        notes.append(note)
    if cells[["required_value", *columns.values()]].isna().any(axis=None):
        notes.append(f"{_NO_VALUE} or no map: too few runs for the quantile")
    legend_below(figure, 2, title="; ".join(notes))
    return figure


def _draw_decisions(axes: Axes, table: SweepTable, cells: pd.DataFrame) -> None:
    """Draw decision and estimate of each cell, and the lines of the limits."""
    # The codes 0, 1 and 2 are in the middle of the three equal parts from -0.5 to 2.5.
    codes = {decision.value: code for code, decision in enumerate(DECISION_COLOURS)}
    look = {"cmap": ListedColormap([*DECISION_COLOURS.values()]), "vmin": -0.5, "vmax": 2.5}
    _draw_cells(axes, _grid(table, cells["requirement"].map(codes)), **look)
    found = set(cells["requirement"])
    for decision, colour in DECISION_COLOURS.items():
        if decision.value in found:
            axes.fill([], [], color=colour, label=str(decision))

    values = _grid(table, cells["required_value"])
    _write_numbers(axes, values, np.zeros(values.shape, dtype=bool), path_effects=HALO)

    if {Decision.MET.value, Decision.NOT_MET.value} <= found:
        limit = {"color": INK, "label": "limit, interpolated between cells"}
        _draw_zero(axes, table, cells, "limit_quantile", **limit)
    if "closed_form_m" in cells:
        dashed = {"color": GUARANTEED, "linestyle": "--"}
        name = "closed form: worst errors, no later images"
        _draw_zero(axes, table, cells, "closed_form_m", label=name, **dashed)


def _draw_zero(
    axes: Axes, table: SweepTable, cells: pd.DataFrame, column: str, **look: Any
) -> None:
    """Draw the line on which a quantile equals its bound, if some cells are on each side of it."""
    above = _grid(table, above_bound(cells, column))
    if (above < 0.0).any() and (above > 0.0).any():
        dashes = look.get("linestyle", "-")
        axes.contour(above, levels=[0.0], colors=look["color"], linestyles=dashes).set(
            path_effects=HALO
        )
        axes.plot([], [], **look)  # the entry in the legend


def _draw_heat(figure: Figure, axes: Axes, values: Floats) -> None:
    """Draw a quantile as a heat map.

    The scale of colours is logarithmic if the values are positive and vary by more than a factor of
    10. NaN is a cell whose runs do not show the quantile; at least one value is known.
    """
    low = float(np.nanmin(values))
    high = float(np.nanmax(values))
    # Equal values need a scale with a length, too; any length gives them one colour.
    norm = Normalize(low, max(high, low + 1e-9))
    if high > 10.0 * low > 0.0:
        norm = LogNorm(low, high)
    bar = figure.colorbar(_draw_cells(axes, values, cmap="Blues", norm=norm), ax=axes)
    if isinstance(norm, LogNorm):
        plain_ticks(bar.ax.yaxis, TICKS)

    is_dark = np.ma.filled(norm(np.ma.masked_invalid(values)) > _DARK, fill_value=False)
    _write_numbers(axes, values, is_dark)


def _grid(table: SweepTable, values: Any) -> Floats:
    """Return a column of the cells of one noise, in the order of the table, as a map.

    Its shape is (values of the second axis, values of the first).
    """
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
    # Points: as the labels, or in more than seven columns as much as the width of a cell leaves to
    # four digits; chosen.
    size = min(7.0, 54.0 / values.shape[1])
    place: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": size, "zorder": 4.0}
    for (row, column), value in np.ndenumerate(values):
        colour = "white" if is_dark[row, column] else INK
        axes.text(column, row, _number(value), color=colour, **place, **look)


def _number(value: float) -> str:
    """Return the text of a value in a cell: three digits, from 1000 on without an exponent."""
    if np.isnan(value):
        return _NO_VALUE
    if value < 1000.0:
        return f"{value:.3g}"
    return f"{value:.0f}"


def _name_values(one: MatplotlibAxis, axis: Axis) -> None:
    """Label an axis with its key, and some of its positions 0, 1, 2, ... with their values."""
    # Values have the power of ten of the largest one in the label if without it the labels of the
    # ticks would have zeros before (below 0.01) or more than five digits; chosen.
    maximum = max(map(abs, axis.values))
    power = 0
    factor = ""
    if not 0.01 <= maximum < 1e5:
        power = math.floor(math.log10(maximum))
    if power:
        factor = f"$10^{{{power}}}$\N{NO-BREAK SPACE}"

    names = [f"{value / 10.0**power:.4g}" for value in axis.values]
    step = -(-len(names) * max(map(len, names)) // _TICK_LETTERS)
    one.set_ticks(range(0, len(names), step), names[::step])
    one.set_label_text(textwrap.fill(key_label(axis.key, factor), _LABEL_LETTERS))


def _column(table: SweepTable, quantile: QuantileName) -> str:
    """Return the column of a quantile; the required one has the estimate that decides."""
    if isinstance(table.required, Requirement) and quantile == table.required.quantile:
        return "required_value"
    return f"{quantile.quantity}_{level_name(quantile.level)}"


def requirement_words(required: AnyRequirement) -> str:
    """Return a requirement in words: `miss p99 under 10 m`."""
    if isinstance(required, Requirement):
        name, unit = QUANTITY_NAMES[required.quantity].split(", ")
        return f"{name} {level_name(required.quantile.level)} under {required.bound:g} {unit}"
    event = "a hit"
    if required.cause is not None:
        event = f"no miss by {required.cause.value}"
    return f"probability of {event} at least {number_text(required.share)}"
