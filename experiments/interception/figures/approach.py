"""The approach of single engagements: the B-plane, and possible misses and impulses against the time before arrival."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle
from matplotlib.patheffects import withStroke
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, MaxNLocator, NullFormatter, NullLocator

from experiments.common.figure_style import (
    IMPULSE,
    INK,
    LIMIT,
    SET_EDGE,
    SET_FILL,
    WIDTH_MM,
    new_figure,
    plain,
    style,
    width_mm,
)
from experiments.interception.course import (
    TICKS_S,
    Clock,
    duration_text,
    marks,
    min_to_go_s,
    outcome_title,
    possible_misses,
    record_titles,
    true_predicted_misses,
)
from experiments.interception.figures.b_plane import GUARANTEE_LOOK, RADIUS_SHOWN, draw_discs
from experiments.interception.figures.distributions import RADIUS_LOOK
from sim import Record, Scenario

MAX_VECTORS = 2000
"""Number of points above which they are pixels in the PDF file."""

_SIDE_MM, _IMPULSES_MM, _GAP_MM = 62.0, 17.0, 3.0
_LEFT_MM, _RIGHT_MM, _BETWEEN_MM, _FOOT_MM = 17.0, 5.0, 21.0, 12.0
_NARROW_MM = 60.0
"""Width of axes up to which the label of the time axis is short."""
_TICK_LETTER_MM, _TICK_GAP_MM = 1.4, 1.5
"""Width of a letter of a tick of the time axis, and gap between ticks."""
MARK_LOOK: dict[str, Any] = {"color": LIMIT, "linewidth": 0.8, "linestyle": (0, (1.5, 1.5))}
_CENTRED_LOOK: dict[str, Any] = {"color": SET_EDGE, "linewidth": 1.1, "linestyle": (0, (4, 1.5))}
_TRUE_LOOK: dict[str, Any] = {"color": INK, "linewidth": 0.9}
_END_LOOK: dict[str, Any] = {
    "color": INK,
    "marker": "x",
    "markersize": 6.0,
    "markeredgewidth": 1.4,
    "linestyle": "none",
}
_LOGARITHMIC_FROM = 10.0
"""Ratio of the maximum and the minimum impulse above which their axis is logarithmic."""
_MIN_SHOWN = 1e-3
"""Minimum miss of a logarithmic axis, as a multiple of the minimum possible miss."""


def draw_approach(records: Sequence[Record]) -> Figure:
    """Draw possible misses and impulses against the time before the nominal arrival, and in space the B-plane.

    Each record has a row. The possible miss is the maximum distance of a point of the box of predicted misses, which
    contains those of all sections. After an impulse that centres the box it is half the diagonal of the box. Both end
    when the first section leaves at the range threshold.
    """
    if not records:
        raise ValueError("at least one record is needed")
    in_space = any(record.scenario.is_spatial for record in records)
    titles = [
        "\n".join(textwrap.wrap(f"{plain(title)}: {outcome_title(record)}", 100))
        for title, record in zip(record_titles(records), records, strict=True)
    ]
    head = 4.0 + 4.0 * (1 + max(title.count("\n") for title in titles))
    row_mm = head + _SIDE_MM + _FOOT_MM
    legend_mm = 24.0 if in_space else 14.0
    height = legend_mm + row_mm * len(records)
    left = _LEFT_MM + in_space * (_SIDE_MM + _BETWEEN_MM)
    with style():
        figure = new_figure(height_mm=height)

        def place(x: float, y: float, width: float, tall: float) -> Axes:
            return figure.add_axes((x / WIDTH_MM, y / height, width / WIDTH_MM, tall / height))

        for row, (record, title) in enumerate(zip(records, titles, strict=True)):
            foot = height - (row + 1) * row_mm + _FOOT_MM
            figure.text(0.5, (foot + _SIDE_MM + 3.0) / height, title, ha="center", va="bottom", fontsize=8.5)
            upper = _IMPULSES_MM + _GAP_MM
            above = place(left, foot + upper, WIDTH_MM - _RIGHT_MM - left, _SIDE_MM - upper)
            below = place(left, foot, WIDTH_MM - _RIGHT_MM - left, _IMPULSES_MM)
            _draw_possible(above, record)
            _draw_moduli(below, record)
            count_down_pair(above, below, record.scenario)
            if record.scenario.is_spatial:
                _draw_b_plane(place(_LEFT_MM, foot, _SIDE_MM, _SIDE_MM), record)
        figure.legend(handles=_handles(records), loc="lower center", ncols=3, columnspacing=2.0)
    return figure


def count_down(axes: Axes, scenario: Scenario) -> None:
    """Make the time axis logarithmic in the time before the arrival, and draw the times of the schedule."""
    begin, end = scenario.nominal_arrival_s, min_to_go_s(scenario)
    axes.set_xscale("log")
    axes.set_xlim(1.1 * begin, end)
    decade_mm = width_mm(axes) / np.log10(1.1 * begin / end)
    ticks = [begin]
    for tick in TICKS_S[::-1]:
        letters = len(duration_text(ticks[-1])) + len(duration_text(tick))
        apart_mm = 0.5 * _TICK_LETTER_MM * letters + _TICK_GAP_MM
        if tick >= end and decade_mm * np.log10(ticks[-1] / tick) >= apart_mm:
            ticks.append(tick)
    axes.xaxis.set_major_locator(FixedLocator(ticks))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda tick, _: duration_text(tick)))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xlabel(f"time before {'the nominal ' if width_mm(axes) > _NARROW_MM else ''}arrival")
    for time in marks(scenario).values():
        axes.axvline(time, zorder=1.5, **MARK_LOOK)


def count_down_pair(above: Axes, below: Axes, scenario: Scenario) -> None:
    """Give two axes the time axis of `count_down`, labelled below, with the names of its times above."""
    for axes in (above, below):
        count_down(axes, scenario)
    name_marks(above, scenario)
    above.tick_params(labelbottom=False)
    above.xaxis.label.set_visible(False)


def name_marks(axes: Axes, scenario: Scenario) -> None:
    """Write the names of the times of the schedule along their lines, at the top of the axes."""
    low, high = np.log(axes.get_xlim()[::-1])
    taken = -1.0
    for name, time in sorted(marks(scenario).items(), key=lambda item: -item[1]):
        share = (high - np.log(time)) / (high - low)
        side = "left" if abs(share - taken) < 0.05 else "right"
        taken = share
        place: dict[str, Any] = {"xycoords": axes.get_xaxis_transform(), "textcoords": "offset points"}
        place |= {"xytext": (-1.5 if side == "right" else 1.5, 0.0), "rotation": 90.0, "ha": side, "va": "top"}
        look: dict[str, Any] = {"fontsize": 6.5, "color": INK, "zorder": 5.0}
        halo = [withStroke(linewidth=2.0, foreground="white")]
        axes.annotate(f"{name}, {duration_text(time)}", (time, 0.97), path_effects=halo, **place, **look)


def _draw_possible(axes: Axes, record: Record) -> None:
    """Draw the possible miss, that after an impulse that centres the set, and the miss of the true state."""
    clock = Clock(counts_down=True)
    known, misses = possible_misses(record)
    times = clock.at(record)
    maximum = np.hypot.reduce([np.abs(interval).max(axis=1) for interval in misses.values()])
    centred = np.hypot.reduce([0.5 * (interval[:, 1] - interval[:, 0]) for interval in misses.values()])
    true = np.hypot.reduce(np.abs([*true_predicted_misses(record).values()]))
    levels = _levels(record)
    shown = np.concatenate([maximum, centred, true, [*levels.values()]])
    top = float(shown.max())
    bottom = max(float(shown.min()), _MIN_SHOWN * float(min([*centred, top])), 1e-6)
    axes.set_yscale("log")
    axes.set_ylim(0.5 * bottom, 2.0 * top)
    axes.fill_between(times[known], np.full(len(known), 1e-9), maximum, color=SET_FILL, linewidth=0.0)
    axes.plot(times[known], maximum, color=SET_EDGE, linewidth=1.2, label="_possible")
    axes.plot(times[known], centred, label="_centred", **_CENTRED_LOOK)
    axes.plot(times, true, label="_true", **_TRUE_LOOK)
    for name, value in levels.items():
        axes.axhline(value, label=f"_{name}", **(GUARANTEE_LOOK if name == "guarantee" else RADIUS_LOOK))
    axes.yaxis.set_major_locator(LogLocator(numticks=8))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_ylabel("miss, m")


def _levels(record: Record) -> dict[str, float]:
    """Return the guaranteed miss of the run and the radius of the body, m, if they are known."""
    (bound,) = record.result.guaranteed_miss_m.tolist()
    levels = {"guarantee": bound if record.result.guarantees else None, "radius": record.scenario.radius_m}
    return {name: value for name, value in levels.items() if value is not None}


def _draw_moduli(axes: Axes, record: Record) -> None:
    moduli = np.abs([step.impulse_m_s for step in record.steps])
    times, given = Clock(counts_down=True).at(record), moduli > 0.0
    many = given.sum() > MAX_VECTORS
    axes.vlines(times[given], 1e-9, moduli[given], color=IMPULSE, linewidth=0.9, rasterized=many)
    axes.plot(times[given], moduli[given], ".", color=IMPULSE, markersize=3.0, markeredgewidth=0.0, rasterized=many)
    if given.any() and moduli.max() > _LOGARITHMIC_FROM * moduli[given].min():
        axes.set_yscale("log")
        axes.set_ylim(0.4 * float(moduli[given].min()), 2.5 * float(moduli.max()))
        axes.yaxis.set_major_locator(LogLocator(numticks=4))
        axes.yaxis.set_minor_formatter(NullFormatter())
    else:
        axes.set_ylim(0.0, 1.15 * float(moduli.max()) or 1.0)
        axes.yaxis.set_major_locator(MaxNLocator(3))
    axes.set_ylabel("impulse, m/s")


def _draw_b_plane(axes: Axes, record: Record) -> None:
    """Draw the B-plane of one engagement: the box of the last predicted misses, and the path of that of the truth."""
    known, misses = possible_misses(record)
    true = np.stack([*true_predicted_misses(record).values()], axis=1)
    end = record.result.lateral_miss[0].data
    levels = _levels(record)
    boxes = [[misses[axis][-1] for axis in ("y", "z")]] if len(known) else []
    sizes = [float(np.abs(end).max()), *(float(np.abs(box).max()) for box in boxes), levels.get("guarantee", 0.0)]
    if levels.get("radius", np.inf) <= RADIUS_SHOWN * max(sizes):
        sizes.append(levels["radius"])
    half = 1.15 * max(sizes) or 1.0
    draw_discs(axes, half, levels.get("radius"), levels.get("guarantee"))
    for y, z in boxes:
        look: dict[str, Any] = {"facecolor": SET_FILL, "edgecolor": SET_EDGE, "zorder": 2.0, "label": "_last"}
        axes.add_patch(Rectangle((y[0], z[0]), y[1] - y[0], z[1] - z[0], **look))
    axes.plot(*true.T, zorder=3.0, label="_path", **_TRUE_LOOK)
    fired = [index for index, step in enumerate(record.steps[:-1]) if step.impulse_m_s != 0.0]
    axes.plot(
        *true[[index + 1 for index in fired]].T, ".", color=IMPULSE, markersize=5.0, markeredgewidth=0.0, zorder=3.5
    )
    axes.plot(*end, zorder=4.0, **_END_LOOK)
    axes.plot(0.0, 0.0, marker="+", color=INK, markersize=7.0, markeredgewidth=1.1, linestyle="none", zorder=4.0)
    axes.set(xlim=(-half, half), ylim=(-half, half), aspect="equal", xlabel="miss along y, m", ylabel="miss along z, m")
    for one in (axes.xaxis, axes.yaxis):
        one.set_major_locator(MaxNLocator(nbins=5, steps=[1, 2, 5, 10]))


def _handles(records: Sequence[Record]) -> list[Line2D | Patch]:
    levels: dict[str, float] = {}
    for record in records:
        levels |= _levels(record)
    is_spatial = any(record.scenario.is_spatial for record in records)
    handles: list[Line2D | Patch] = [
        Patch(facecolor=SET_FILL, edgecolor=SET_EDGE, label="possible miss without further impulses"),
        Line2D([], [], label="after an impulse that centres the set", **_CENTRED_LOOK),
        Line2D([], [], label="miss of the true state without further impulses", **_TRUE_LOOK),
        Line2D([], [], color=IMPULSE, marker=".", linewidth=0.9, label="impulse"),
    ]
    if is_spatial:
        handles.append(Line2D([], [], label="closest approach", **_END_LOOK))
    if "guarantee" in levels:
        handles.append(Line2D([], [], label="guaranteed miss Φ of the run", **GUARANTEE_LOOK))
    if "radius" in levels:
        handles.append(Line2D([], [], label=f"body radius, {levels['radius']:g} m", **RADIUS_LOOK))
    if any(marks(record.scenario) for record in records):
        handles.append(Line2D([], [], label="times of the schedule", **MARK_LOOK))
    return handles
