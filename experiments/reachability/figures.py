"""Figures of a rendezvous: the tube in space (as in the paper) and in planes, and controls.

Heights of figures, mm, and sizes of lines, marks and letters are chosen by eye.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]
from scipy.spatial import ConvexHull, QhullError

from infoset.arrays import Floats
from infoset.experiments.common.figure_style import (
    BOUND,
    INK,
    LINE_LOOKS,
    SET,
    label_axes,
    legend_below,
    letters,
    new_figure,
    style,
    subplots,
)
from infoset.experiments.common.hill_axes import AXIS_TITLES, component_titles
from infoset.experiments.reachability.report import ChosenControl, ReachabilityReport
from infoset.rendezvous.reachability import SetKind

_PLANE_TOLERANCE = 2e-3
"""Relative error of sets in planes: less than the width of a line."""
_SPACE_TOLERANCE = 1e-2
"""Relative error of sets in space; chosen: finer sets have facets that are too small to be seen."""
_MAX_TIMES = 6
"""Largest number of times at which sets are drawn in planes; chosen: more cover each other."""
_MAX_TIMES_IN_SPACE = 4
"""Largest number of times at which sets are drawn in space; chosen: more cover each other."""
COLOUR_RANGE = (0.1, 0.95)
"""Part of the colour map for the times of the sets, from yellow to violet.

The colours differ in hue and in brightness.
"""
NEAR_LIMIT = 0.7
"""Part of a limit from which it is drawn: one far from all controls would only make them small.
Chosen."""
_NAMES = {
    "energy": "minimum energy",
    "l1": "minimum L1",
    "norms": "minimum norms",
    "delta-v": "minimum Delta-v",
    "peak": "minimum peak",
    "chebyshev": "Chebyshev centre",
    "analytic": "analytic centre",
}
_START: dict[str, Any] = {
    "marker": "o",
    "markerfacecolor": "none",
    "markersize": 7.5,
    "label": "start",
}
_END: dict[str, Any] = {"marker": "*", "markersize": 9.0, "label": "terminal state of minimum norm"}
_STEM_STEP = 0.08
"""Distance between the stems of two controls, periods: equal impulses do not cover each other."""
_STEM_END: dict[str, Any] = {"marker": "o", "markersize": 2.5}
_AXES = (*AXIS_TITLES, *component_titles("v"))
_PLANES = ((1, 0), (1, 2), (4, 3), (4, 5))


def _shown(report: ReachabilityReport) -> list[tuple[dict[str, Any], ChosenControl, Floats]]:
    """Return the line style, the member and the nonlinear trajectory of each member drawn."""
    looks = [{**look, "linewidth": 1.0} for look in LINE_LOOKS]
    return [(look, *pair) for look, pair in zip(looks, report.shown, strict=False)]


def _legend(figure: Figure, report: ReachabilityReport) -> None:
    """Draw the legend, with the names of the members that are not drawn."""
    drawn = [member.name for _, member, _ in _shown(report)]
    hidden = [
        _NAMES.get(member.name, member.name)
        for member in report.members
        if member.name not in drawn
    ]
    if not hidden:
        legend_below(figure, 3)
        return

    names = f"{len(hidden)} of {len(report.members)}"
    if len(hidden) <= len(_NAMES):
        names = ", ".join(hidden)
    note = f"not drawn, as equal to others or beyond the first {len(LINE_LOOKS)}: {names}"
    legend_below(figure, 3, title=note)


def shown_times(periods: int, most: int = _MAX_TIMES) -> list[int]:
    """Return the times at which sets are drawn, without the first one and the last one.

    These are all times between them, or `most` evenly spaced ones; none if there is one period.
    """
    if periods <= most + 1:
        return list(range(1, periods))
    return sorted({round(t) for t in np.linspace(1, periods - 1, most)})


def draw_all(report: ReachabilityReport) -> Iterator[Figure]:
    """Draw the figures of a report, one after the other."""
    for draw in (
        partial(draw_space, first=0),
        partial(draw_space, first=3),
        draw_planes,
        draw_controls,
    ):
        yield draw(report)


@style()
def draw_space(report: ReachabilityReport, first: int) -> Figure:
    """Draw three of the six states in space: positions (0) or velocities (3)."""
    figure = new_figure(145.0)
    axes: Any = figure.add_subplot(projection="3d", computed_zorder=False)
    states = list(range(first, first + 3))
    _draw_motion(axes, report, states, _MAX_TIMES_IN_SPACE, _SPACE_TOLERANCE)
    axes.view_init(elev=22.0, azim=-58.0)
    axes.set_box_aspect((1.0, 1.0, 0.85), zoom=1.1)
    _legend(figure, report)
    return figure


@style()
def draw_planes(report: ReachabilityReport) -> Figure:
    """Draw positions and velocities in two planes each."""
    figure, grid = subplots(175.0, 2, 2)
    for axes, plane in zip(grid.flat, _PLANES, strict=True):
        _draw_motion(axes, report, list(plane), _MAX_TIMES, _PLANE_TOLERANCE)
    letters([*grid.flat])
    _legend(figure, report)
    return figure


def _draw_motion(
    axes: Axes, report: ReachabilityReport, states: list[int], max_times: int, tolerance: float
) -> None:
    """Draw two or three states of the six: the tube, from light to dark, and the members."""
    unit, per_m = report.length_unit
    factors = np.array([per_m if state < 3 else 1.0 for state in states])
    times = shown_times(report.solution.problem.periods, max_times)
    colours = mpl.colormaps["viridis_r"](np.linspace(*COLOUR_RANGE, len(times)))
    for t, colour in zip(times, colours, strict=True):
        points = report.solution.sets.projection(SetKind.TUBE, t, states, tolerance) * factors
        draw_set(axes, points, colour, f"tube at t = {t}")

    for look, member, path in _shown(report):
        name = _NAMES.get(member.name, member.name)
        axes.plot(
            *(path[:, states] * factors).T,
            zorder=5,
            label=f"{name}, nonlinear",
            **look | {"marker": "none"},
        )
        marks = {**look, "linestyle": "none", "markersize": 3.5, "zorder": 6}
        axes.plot(*(member.linear[:, states] * factors).T, label=f"{name}, linear", **marks)
    # At the start, and at the end of all optimal trajectories, the tube is one state: its lower and
    # upper bounds are equal up to rounding.
    for t, mark in ((0, _START), (-1, _END)):
        point = report.tube[t, states].mean(axis=1) * factors
        axes.plot(*point[:, None], color=INK, linestyle="none", zorder=7, **mark)
    label_axes(axes, [f"{_AXES[state]}, {unit if state < 3 else 'm/s'}" for state in states])


def draw_set(axes: Any, points: Floats, colour: Any, label: str) -> None:
    """Draw the convex hull of points in a plane or in space.

    A hull without area or volume is drawn as its points on a line.
    """
    # Equal points are divided by 1: they have no hull.
    try:
        hull = ConvexHull(points / (np.ptp(points, axis=0).max() or 1.0))
    except QhullError:
        axes.plot(*points.T, color=colour, label=label)
        return
    if points.shape[1] == 2:
        axes.fill(
            *points[hull.vertices].T, facecolor=colour, edgecolor=colour, alpha=0.25, label=label
        )
    else:
        look: dict[str, Any] = {"facecolors": colour, "alpha": 0.25, "shade": True}
        axes.add_collection3d(Poly3DCollection(points[hull.simplices], **look))
        # The legend needs another mark: the collection's has the colour of its first, shaded facet.
        axes.plot(
            [],
            [],
            [],
            marker="s",
            markersize=8.0,
            linestyle="none",
            color=colour,
            alpha=0.6,
            label=label,
        )


@style()
def draw_controls(report: ReachabilityReport) -> Figure:
    """Draw the components of the controls, and the ranges of all optimal controls.

    Thrust is drawn as steps, impulses as stems at the starts of the periods.
    """
    figure, (row,) = subplots(78.0, 1, 3)
    rendezvous = report.rendezvous
    periods = report.solution.problem.periods
    bounds = report.solution.problem.control_bounds
    # An impulse is in the middle of its bar, held thrust acts from the start to the end of it.
    unit = ", m/s"
    first = -0.5
    if not rendezvous.has_impulses:
        unit = f" / ({rendezvous.unit_m_s2:g} m/s²)"
        first = 0.0
    for j, axes in enumerate(row):
        low, high = report.ranges[:, j].T
        bars = {**SET, "width": 1.0, "label": "all optimal controls"}
        axes.bar(first + np.arange(periods) + 0.5, high - low, bottom=low, **bars)
        for place, (look, member, _) in enumerate(_shown(report)):
            line: dict[str, Any] = {
                "color": look["color"],
                "linestyle": look["linestyle"],
                "linewidth": 1.3,
            }
            name = _NAMES.get(member.name, member.name)
            values = member.controls[:, j]
            if rendezvous.has_impulses:
                times = np.arange(periods) + _STEM_STEP * place
                axes.vlines(times, 0.0, values, label=name, **line)
                axes.plot(times, values, linestyle="none", **_STEM_END, color=look["color"])
            else:
                axes.stairs(values, np.arange(periods + 1), baseline=None, label=name, **line)
        if np.abs(report.ranges[:, j]).max() > NEAR_LIMIT * bounds[j]:
            for sign in (-1.0, 1.0):
                axes.axhline(sign * bounds[j], label="bound", **BOUND)
        axes.set_xlabel(f"time, periods of {rendezvous.period_s:g} s")
        axes.set_ylabel(f"{component_titles('u')[j]}{unit}")
        axes.set_xlim(first, periods + first)
        # The margin applies also at the ends of bars, which are sticky.
        axes.use_sticky_edges = False
        axes.margins(y=0.08)
        axes.xaxis.set_major_locator(MaxNLocator(8, integer=True))
    letters(row)
    _legend(figure, report)
    return figure
