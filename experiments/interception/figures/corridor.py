"""The corridor of many runs: possible misses and impulses over the time before arrival.

Sizes and margins without a reason were chosen by eye (`figure_style`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from infoset.experiments.common.figure_style import (
    IMPULSE,
    SET_EDGE,
    SET_FILL,
    TRUTH,
    first_panels,
    legend_below,
    letters,
    plain_ticks,
    style,
    subplots,
)
from infoset.experiments.common.screen import some_runs
from infoset.experiments.interception.course import Courses
from infoset.experiments.interception.figures.shared import (
    count_down,
    draw_end,
    draw_levels,
    name_events,
)
from infoset.experiments.interception.study import Curve, max_guarantee_m
from infoset.sim.statistics import shows

_DECADES = 4.0
"""Maximum extent of the axis of impulses, decades; chosen: with more, the large impulses, which
decide about the budget, would look alike.
"""
_IMPULSES: tuple[tuple[float, str, dict[str, Any]], ...] = (
    (0.9, "impulse: 90 %", {"color": "#d9a39e", "linewidth": 0.9}),
    (0.5, "impulse: median", {"color": IMPULSE, "linewidth": 1.3}),
)
_OF_ONE_RUN: tuple[float, str, dict[str, Any]] = (
    1.0,
    "impulses of the run",
    {"color": IMPULSE, "linewidth": 1.3},
)


@style()
def draw_corridor(curves: Sequence[Curve], courses: Sequence[Courses]) -> Figure:
    """Draw possible misses and impulses of each curve against the time before the nominal arrival.

    The possible miss is the maximum without further impulses. Its quantiles are taken over the
    runs that still have a complete set (see `Courses`), and end when these are less than half of
    the runs. Quantiles for which all runs are too few are not drawn, but the median and the maximum
    of the possible miss always are; of a single run its impulses are drawn.
    """
    rows = -(-len(curves) // 2)
    columns = min(2, len(curves))
    # Millimetres: the legend, and a row of two panels; chosen.
    figure, grid = subplots(
        20.0 + 75.0 * rows, 2 * rows, columns, sharex=True, height_ratios=[2.4, 1.0] * rows
    )
    # Rows of possible misses alternate with rows of impulses.
    above, below = (first_panels(part, len(curves)) for part in (grid[::2], grid[1::2]))
    titles = []

    for first, second, curve, course in zip(above, below, curves, courses, strict=True):
        _draw_possible(first, course)
        draw_levels(first, max_guarantee_m(curve.results), course.scenario.body)
        _draw_impulses(second, course)
        count_down((first, second), course.scenario)
        name_events(first, course.scenario)
        first.set_ylabel("possible miss, m")
        second.set_ylabel("impulse, m/s")
        second.tick_params(labelbottom=True)
        title = f"{curve.noise} noise"
        if len(curves) > 2:
            title += ", range sensor" if curve.range_sensor else ", no range sensor"
        titles.append(f"{title}, {some_runs(len(course.possible_m))}")

    letters(above, titles)
    for level in (above, below):
        limits = np.array([axes.get_ylim() for axes in level])
        for axes in level:
            axes.set_ylim(limits.min(), limits.max())

    legend_below(figure, 3)
    return figure


def _draw_possible(axes: Axes, course: Courses) -> None:
    """Draw quantiles of the possible miss while half of the runs and more have a complete set."""
    shown = np.count_nonzero(~np.isnan(course.possible_m), axis=0) >= 0.5 * len(course.possible_m)
    times = course.before_arrival_s[shown]
    axes.set_yscale("log")
    if shown.any():
        low, median, high, maximum = np.nanquantile(
            course.possible_m[:, shown], (0.1, 0.5, 0.9, 1.0), axis=0
        )
        if shows(len(course.possible_m), 0.9):
            band = "possible miss: 10 to 90 %"
            axes.fill_between(times, low, high, facecolor=SET_FILL, linewidth=0.0, label=band)
        axes.plot(times, median, color=TRUTH, label="possible miss: median")
        look: dict[str, Any] = {"color": SET_EDGE, "linewidth": 1.0, "linestyle": (0, (4, 1.5))}
        axes.plot(times, maximum, label="possible miss: maximum", **look)
        draw_end(axes, times[-1], median[-1], "end: last complete set of half the runs")


def _draw_impulses(axes: Axes, course: Courses) -> None:
    """Draw quantiles of the impulses as bars, the higher ones behind the median."""
    maximum = float(course.impulse_m_s.max()) or 1.0
    minimum = float(course.impulse_m_s[course.impulse_m_s > 0.0].min(initial=maximum))
    # A factor of 2 below the smallest impulse shown, and above the largest one: a short bar is
    # seen.
    bottom = 0.5 * max(minimum, 10.0**-_DECADES * maximum)
    runs = len(course.impulse_m_s)
    drawn = [each for each in _IMPULSES if shows(runs, each[0])]
    if runs == 1:
        drawn = [_OF_ONE_RUN]
    for level, name, look in drawn:
        sizes = np.quantile(course.impulse_m_s, level, axis=0)
        given = sizes > bottom
        # From 1e-12 m/s, far below the axis: a logarithmic one has no zero.
        axes.vlines(course.before_arrival_s[given], 1e-12, sizes[given], label=name, **look)
    axes.set(yscale="log", ylim=(bottom, 2.0 * maximum))
    plain_ticks(axes.yaxis)
