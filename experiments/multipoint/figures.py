"""Figures of visits: the path with the targets, and the control.

Heights of figures, mm, and sizes of lines, marks and letters are chosen by eye.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from infoset.arrays import Floats
from infoset.experiments.common.figure_style import (
    BOUND,
    EVENT,
    HALO,
    INK,
    LIMIT,
    LINE_LOOKS,
    MEASURED,
    SET_FILL,
    TRUTH,
    label_axes,
    legend_below,
    letters,
    plain,
    style,
    subplots,
)
from infoset.experiments.common.units import length_unit
from infoset.experiments.multipoint.report import MultipointReport

_TRACK_POINTS = 241
"""Number of points on the track of a target; chosen for smooth curves."""
_MAX_NAMED = 12
"""Largest number of visits with names in a figure: more names overlap."""
_SUN_M3_S2 = 1.32712440018e20
"""Gravitational parameter of the Sun, m^3/s^2: DE405, as in the scenarios about it."""
_TARGET: dict[str, Any] = {
    "color": LIMIT,
    "linewidth": 0.7,
    "linestyle": (0, (3, 2)),
    "label": "target until the visit",
}
_POINT: dict[str, Any] = {"linestyle": "none", "zorder": 4}
_NODE: dict[str, Any] = {
    "color": "white",
    "markeredgecolor": INK,
    "markersize": 5.0,
    "linestyle": "none",
    "zorder": 5,
}


def draw_all(report: MultipointReport) -> Iterator[Figure]:
    """Draw the figures of a report, one after the other."""
    yield draw_path(report)
    yield draw_control(report)


@style()
def draw_path(report: MultipointReport) -> Figure:
    """Draw the path and the motion of the targets, in two planes."""
    states = report.path.state(report.times)[:, :3]
    unit, per_m = length_unit(float(np.abs(states).max()))
    path = states * per_m
    visits = report.path.arrival_states[:, :3] * per_m
    planes = ((1, 0), (1, 2)) if report.hill else ((0, 1), (0, 2))
    figure, (panels,) = subplots(105.0, 1, 2)
    for panel, plane in zip(panels, map(list, planes), strict=True):
        for visit in range(len(report.best.order)):
            until_s = float(report.path.nodes.leave_s[visit])
            times = np.linspace(report.problem.tour.start_s, until_s, _TRACK_POINTS)
            track = report.target_path(visit, times)[:, plane] * per_m
            panel.plot(*track.T, **_TARGET)
            panel.plot(*track[0], color=LIMIT, marker=".", label="target at the start", **_POINT)
        panel.plot(*path[:, plane].T, color=TRUTH, zorder=3, label="chaser")
        panel.plot(
            *path[0, plane],
            color=TRUTH,
            marker="s",
            markersize=4.5,
            label="start of the chaser",
            **_POINT,
        )
        # Orbits have equal scales in the plane of x and y, in which the centre is marked.
        if not report.hill and plane[1] == 1:
            panel.plot(
                0.0,
                0.0,
                color=MEASURED,
                marker="*",
                markersize=8.0,
                label=_centre(report),
                **_POINT,
            )
            panel.set_aspect("equal", adjustable="datalim")
        _mark_visits(panel, report, visits[:, plane])
        label_axes(panel, [f"{report.axis_titles[axis]}, {unit}" for axis in plane])
    letters(panels)
    legend_below(figure, 3)
    return figure


def _centre(report: MultipointReport) -> str:
    parameter = getattr(report.problem.tour, "gravitational_parameter_m3_s2", 0.0)
    # Within 1 %: files round the parameter, and no other body has it so nearly.
    return "Sun" if abs(parameter / _SUN_M3_S2 - 1.0) < 0.01 else "centre of gravity"


def _mark_visits(panel: Axes, report: MultipointReport, visits: Floats) -> None:
    """Mark the visits, shape (n, 2), with their names."""
    for name, visit, rendezvous in zip(
        report.names, visits, report.path.nodes.rendezvous, strict=True
    ):
        panel.plot(
            *visit,
            marker="D" if rendezvous else "o",
            label="rendezvous" if rendezvous else "flyby",
            **_NODE,
        )
        if len(visits) <= _MAX_NAMED:
            place: dict[str, Any] = {
                "xytext": (4.0, 4.0),
                "textcoords": "offset points",
                "path_effects": HALO,
            }
            panel.annotate(plain(name), visit, fontsize="small", zorder=6, **place)


@style()
def draw_control(report: MultipointReport) -> Figure:
    """Draw the components and the magnitude of the control against time, with a bound."""
    control = report.path.control(report.times) * 1e3  # mm/s^2
    figure, (above, below) = _over_time(report)
    for title, look, component in zip(report.axis_titles, LINE_LOOKS, control.T, strict=False):
        _line(above, report, component, label=title, **look | {"marker": "none"})
    _line(below, report, np.linalg.norm(control, axis=1), color=INK, label="magnitude")
    if (bound_m_s2 := report.problem.max_control_m_s2) is not None:
        below.axhline(1e3 * bound_m_s2, label="bound of the control", **BOUND)
    above.set_ylabel("$u$, mm/s$^2$")
    below.set(ylabel="$|u|$, mm/s$^2$")
    below.set_ylim(bottom=0.0)
    legend_below(figure, 3)
    return figure


def _over_time(report: MultipointReport) -> tuple[Figure, list[Axes]]:
    """Return a figure of two panels over time, with visits and stays marked.

    Up to `_MAX_NAMED` visits are named above the first panel.
    """
    unit, per_s = report.time_unit
    figure, grid = subplots(115.0, 2, 1, sharex=True)
    arrive = report.path.nodes.arrive_s * per_s
    leave = report.path.nodes.leave_s * per_s
    for panel in grid.flat:
        for time in arrive:
            panel.axvline(time, zorder=0, label="visit", **EVENT)
        # The stay with the last target is after the end of the path.
        for begin, end in zip(arrive[:-1], leave[:-1], strict=True):
            if end > begin:
                panel.axvspan(begin, end, facecolor=SET_FILL, linewidth=0.0, zorder=0, label="stay")
    if len(report.best.order) <= _MAX_NAMED:
        named = grid[0, 0].secondary_xaxis("top")
        named.set_xticks(arrive, [plain(name) for name in report.names])
    grid[0, 0].set_xlim(report.problem.tour.start_s * per_s, report.end_s * per_s)
    grid[1, 0].set_xlabel(f"time, {unit}")
    return figure, [*grid.flat]


def _line(panel: Axes, report: MultipointReport, values: Floats, **look: Any) -> None:
    """Draw a line with breaks where the chaser arrives at a target or leaves it.

    `report.times` has a time just before each arrival, at which the line ends.
    """
    _, per_s = report.time_unit
    arrive = report.path.nodes.arrive_s[:-1]
    leave = report.path.nodes.leave_s[:-1]
    cuts = np.searchsorted(
        report.times, np.sort(np.concatenate([arrive, leave[leave > arrive]])), side="left"
    )
    for time, value in zip(np.split(report.times, cuts), np.split(values, cuts), strict=True):
        panel.plot(time * per_s, value, **look)
