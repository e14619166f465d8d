"""The corridor of many runs: quantiles of possible misses and of impulses against the time before arrival."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator, NullFormatter

from experiments.common.figure_style import IMPULSE, SET_EDGE, SET_FILL, TRUTH, figure_grid, style
from experiments.common.screen import some_runs
from experiments.interception.course import Courses, marks
from experiments.interception.curves import Curve
from experiments.interception.figures.approach import MARK_LOOK, count_down_pair
from experiments.interception.figures.b_plane import GUARANTEE_LOOK
from experiments.interception.figures.distributions import RADIUS_LOOK
from experiments.interception.study import max_guarantee_m
from sim.statistics import shows

_POSSIBLE_MM, _IMPULSES_MM, _GAP_MM, _BETWEEN_MM = 46.0, 19.0, 3.0, 21.0
_DECADES = 4.0
"""Maximum extent of the axis of impulses, decades."""
_MEDIAN: dict[str, Any] = {"color": TRUTH, "linewidth": 1.2}
_MAX: dict[str, Any] = {"color": SET_EDGE, "linewidth": 1.0, "linestyle": (0, (4, 1.5))}
_IMPULSES: tuple[tuple[float, dict[str, Any]], ...] = (
    (0.9, {"color": "#d9a39e", "linewidth": 0.9}),
    (0.5, {"color": IMPULSE, "linewidth": 1.3}),
)


def draw_corridor(curves: Sequence[Curve], courses: Sequence[Courses]) -> Figure:
    """Draw possible misses and impulses of each curve against the time before the nominal arrival.

    The possible miss is the maximum without further impulses. Its quantiles are those of the runs that still have a
    complete set (see `Courses`), and end when these are less than half of the runs. Quantiles for which the runs are
    too few are not drawn.
    """
    if not curves:
        raise ValueError("at least one curve is needed")
    rows = -(-len(curves) // 2)
    tall = _POSSIBLE_MM + _GAP_MM + _IMPULSES_MM
    with style():
        height_mm, gaps_mm = rows * tall + (rows - 1) * _BETWEEN_MM + 37.0, (17.0, _BETWEEN_MM)
        margins_mm, columns = (17.0, 5.0, 28.0, 9.0), min(2, len(curves))
        figure, panels = figure_grid(height_mm, rows, columns, margins_mm, gaps_mm, count=len(curves))
        pairs = []
        for axes, curve, course, letter in zip(panels, curves, courses, "abcd", strict=False):
            left, foot, width, height = axes.get_position().bounds
            axes.set_position((left, foot + height * (1.0 - _POSSIBLE_MM / tall), width, height * _POSSIBLE_MM / tall))
            below = figure.add_axes((left, foot, width, height * _IMPULSES_MM / tall))
            _draw_possible(axes, curve, course)
            _draw_impulses(below, course)
            meter = f", {'' if curve.range_sensor else 'no '}range sensor" if len(curves) > 2 else ""
            axes.set_title(f"({letter}) {curve.noise.value} noise{meter}, {some_runs(len(course.possible_m))}")
            count_down_pair(axes, below, course.scenario)
            axes.set_ylabel("possible miss, m")
            below.set_ylabel("impulse, m/s")
            pairs.append((axes, below))
        for level in zip(*pairs, strict=True):
            limits = np.array([axes.get_ylim() for axes in level])
            for axes in level:
                axes.set_ylim(limits.min(), limits.max())
        figure.legend(handles=_handles(curves, courses[0]), loc="lower center", ncols=3, columnspacing=2.0)
    return figure


def _draw_possible(axes: Axes, curve: Curve, course: Courses) -> None:
    """Draw quantiles of the possible miss, the maximum guaranteed miss, and the radius of the body."""
    shown = np.count_nonzero(~np.isnan(course.possible_m), axis=0) >= 0.5 * len(course.possible_m)
    times = course.before_arrival_s[shown]
    axes.set_yscale("log")
    if shown.any():
        low, median, high, maximum = np.nanquantile(course.possible_m[:, shown], (0.1, 0.5, 0.9, 1.0), axis=0)
        if shows(len(course.possible_m), 0.9):
            axes.fill_between(times, low, high, color=SET_FILL, linewidth=0.0)
        axes.plot(times, median, **_MEDIAN)
        axes.plot(times, maximum, **_MAX)
    for value, look in ((max_guarantee_m(curve.results), GUARANTEE_LOOK), (course.scenario.radius_m, RADIUS_LOOK)):
        if value:
            axes.axhline(value, **look)
    axes.yaxis.set_major_locator(LogLocator(numticks=8))
    axes.yaxis.set_minor_formatter(NullFormatter())


def _draw_impulses(axes: Axes, course: Courses) -> None:
    """Draw the 90 % quantile and the median of the impulses as bars."""
    maximum = float(course.impulse_m_s.max()) or 1.0
    minimum = float(course.impulse_m_s[course.impulse_m_s > 0.0].min(initial=maximum))
    bottom = 0.5 * max(minimum, 10.0**-_DECADES * maximum)
    for level, look in _shown_impulses(course):
        sizes = np.quantile(course.impulse_m_s, level, axis=0)
        given = sizes > bottom
        axes.vlines(course.before_arrival_s[given], 1e-12, sizes[given], **look)
    axes.set_yscale("log")
    axes.set_ylim(bottom, 2.0 * maximum)
    axes.yaxis.set_major_locator(LogLocator(numticks=5))
    axes.yaxis.set_minor_formatter(NullFormatter())


def _shown_impulses(course: Courses) -> list[tuple[float, dict[str, Any]]]:
    return [(level, look) for level, look in _IMPULSES if shows(len(course.impulse_m_s), level)]


def _handles(curves: Sequence[Curve], course: Courses) -> list[Line2D | Patch]:
    handles: list[Line2D | Patch] = [
        Line2D([], [], label="possible miss: median", **_MEDIAN),
        Line2D([], [], label="possible miss: maximum", **_MAX),
    ]
    if shows(len(course.possible_m), 0.9):
        handles.insert(1, Patch(facecolor=SET_FILL, label="possible miss: 10 to 90 %"))
    for level, look in _shown_impulses(course):
        handles.append(Line2D([], [], label=f"impulse: {'median' if level == 0.5 else '90 %'}", **look))
    if any(max_guarantee_m(curve.results) for curve in curves):
        handles.append(Line2D([], [], label="maximum guaranteed miss Φ", **GUARANTEE_LOOK))
    if course.scenario.radius_m is not None:
        handles.append(Line2D([], [], label=f"body radius, {course.scenario.radius_m:g} m", **RADIUS_LOOK))
    if marks(course.scenario):
        handles.append(Line2D([], [], label="times of the schedule", **MARK_LOOK))
    return handles
