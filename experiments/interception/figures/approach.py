"""The approach of single engagements: B-plane, possible misses and impulses.

Sizes and margins without a reason were chosen by eye (`figure_style`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from infoset.experiments.common.figure_style import (
    IMPULSE,
    INK,
    SET,
    SET_EDGE,
    SET_FILL,
    legend_below,
    new_figure,
    plain,
    plain_ticks,
    style,
)
from infoset.experiments.interception.course import (
    Clock,
    complete_steps,
    outcome_title,
    record_titles,
    true_predicted_misses,
)
from infoset.experiments.interception.figures.b_plane import RADIUS_SHOWN
from infoset.experiments.interception.figures.shared import (
    aim_in_plane,
    count_down,
    draw_body,
    draw_end,
    draw_impulses,
    draw_levels,
    name_events,
)
from infoset.experiments.interception.study import max_guarantee_m
from infoset.guidance.thruster import modulus
from infoset.sim import Record

_POSSIBLE = "possible miss without further impulses"
_TRUE: dict[str, Any] = {
    "color": INK,
    "linewidth": 0.9,
    "label": "miss of the true state without further impulses",
}
_CENTRED: dict[str, Any] = {"color": SET_EDGE, "linewidth": 1.1, "linestyle": (0, (4, 1.5))}
_END: dict[str, Any] = {
    "color": INK,
    "marker": "x",
    "markersize": 6.0,
    "markeredgewidth": 1.4,
    "linestyle": "none",
}
_MIN_SHOWN = 1e-3
"""Start of the logarithmic axis of misses, as a multiple of the smallest half diagonal of a box of
predicted misses; chosen: smaller misses of the true state belong to a curve that passes zero."""


@style()
def draw_approach(records: Sequence[Record]) -> Figure:
    """Draw possible misses and impulses over the time before the nominal arrival.

    In space the B-plane is drawn, too. Each record has a row. The possible miss is the maximum
    distance from zero of a point of the box of predicted misses, which contains the predicted
    misses of all sections. After an impulse that centres the box it is half the diagonal of the
    box. Both end with the last complete set (`complete_steps`).
    """
    # Millimetres: the legend, and each record; chosen.
    figure = new_figure(25.0 + 75.0 * len(records))
    rows = figure.subfigures(len(records), 1, squeeze=False)[:, 0]
    for row, record, title in zip(rows, records, record_titles(records), strict=True):
        row.suptitle(f"{plain(title)}: {outcome_title(record)}")
        layout: list[list[str]] = [["possible"], ["impulses"]]
        sizes: dict[str, Any] = {"height_ratios": [3.0, 1.0]}
        if record.scenario.is_spatial:
            layout = [["plane", *line] for line in layout]
            sizes["width_ratios"] = [1.0, 1.3]
        panels = row.subplot_mosaic(layout, **sizes)
        possible = panels["possible"]
        impulses = panels["impulses"]
        _draw_possible(possible, record)
        _draw_moduli(impulses, record)
        count_down((possible, impulses), record.scenario)
        possible.tick_params(labelbottom=False)
        name_events(possible, record.scenario)
        if record.scenario.is_spatial:
            _draw_b_plane(panels["plane"], record)

    legend_below(figure, 2)
    return figure


def _draw_possible(axes: Axes, record: Record) -> None:
    """Draw the farthest point of the box of predicted misses, half the diagonal of the box, and the
    miss of the true state, with the levels of the guaranteed miss and of the body.
    """
    known = complete_steps(record)
    misses = record.predicted_miss_m[known]
    times = Clock(counts_down=True).at(record)
    maximum = modulus(np.abs(misses).max(axis=-1).T)
    # The last axis is the minimum and the maximum of each lateral axis.
    centred = modulus(0.5 * (misses[..., 1] - misses[..., 0]).T)
    true = modulus(true_predicted_misses(record).T)

    # The axis shows all curves and levels; of the smallest values, which may be 0, only those down
    # to the share `_MIN_SHOWN` and to a micrometre, the greater of both. Its margins are factors of
    # 2. Levels of 0 are not drawn.
    levels = [
        level
        for level in (max_guarantee_m(record.result), record.scenario.certain_radius_m)
        if level
    ]
    top = max([*maximum, *true, *levels])
    bottom = max(min([*centred, *true, *levels]), _MIN_SHOWN * min([*centred, top]), 1e-6)
    axes.set(yscale="log", ylim=(0.5 * bottom, 2.0 * top), ylabel="miss, m")
    # From 1e-9 m, below every axis: a logarithmic one has no zero.
    axes.fill_between(
        times[known], np.full(len(known), 1e-9), maximum, color=SET_FILL, linewidth=0.0
    )
    axes.plot(times[known], maximum, color=SET_EDGE, label=_POSSIBLE)
    axes.plot(times[known], centred, label="after an impulse that centres the set", **_CENTRED)
    axes.plot(times, true, **_TRUE)
    if len(known):
        draw_end(axes, times[known[-1]], maximum[-1], "end: last complete set")
    draw_levels(axes, max_guarantee_m(record.result), record.scenario.body)


def _draw_moduli(axes: Axes, record: Record) -> None:
    sizes = modulus(record.impulse_m_s.T)
    draw_impulses(
        axes,
        Clock(counts_down=True).at(record),
        sizes,
        color=IMPULSE,
        linewidth=0.9,
        label="impulse",
    )
    if sizes.any():
        axes.set(yscale="log", ylim=(0.4 * sizes[sizes > 0.0].min(), 2.5 * sizes.max()))
        plain_ticks(axes.yaxis)
    axes.set_ylabel("impulse, m/s")


def _draw_b_plane(axes: Axes, record: Record) -> None:
    """Draw the B-plane: the box of predicted misses of the last complete set, and the true ones.

    If impulses end before, the box is smaller than at the last decision.
    """
    known = complete_steps(record)
    end = record.result.lateral_miss_m[0]
    guaranteed = max_guarantee_m(record.result)
    body = record.scenario.body
    # Predicted misses are those of the aim point, and the plane is drawn around the centre.
    aim_m = aim_in_plane(body)
    sizes = [float(np.abs(end).max()), (guaranteed or 0.0) + float(np.hypot(*aim_m))]
    if len(known):
        y, z = record.predicted_miss_m[known[-1]] + aim_m[:, None]
        sizes.append(float(np.abs([y, z]).max()))
        label = "possible misses of the last complete set"
        axes.add_patch(Rectangle((y[0], z[0]), y[1] - y[0], z[1] - z[0], label=label, **SET))
    if body is not None and body.longest_m <= RADIUS_SHOWN * max(sizes):
        sizes.append(body.longest_m)
    axes.plot(*(true_predicted_misses(record) + aim_m).T, zorder=3.0, **_TRUE)
    # Without any size, axes of 1 m.
    draw_body(axes, 1.15 * max(sizes) or 1.0, guaranteed, body)
    axes.plot(*end, zorder=4.0, label="closest approach", **_END)
