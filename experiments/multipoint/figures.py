"""Figures of visits: the path with the targets, the control, the costates."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from experiments.common.display_units import length_unit
from experiments.common.figure_style import (
    INK,
    LIMIT,
    LINE_LOOKS,
    MEASURED,
    SET_FILL,
    TRUTH,
    figure_grid,
    place_labels,
    style,
)
from experiments.multipoint.report import Report, Scene
from infoset.arrays import Floats

_TRACK_POINTS = 241
_COMPONENTS = tuple({**look, "marker": "none"} for look in LINE_LOOKS[:3])
_MAX_NAMED = 12
_SUN_M3_S2 = 1.32712440018e20
_TARGET: dict[str, Any] = {"color": LIMIT, "linewidth": 0.7, "linestyle": (0, (3, 2))}
_TARGET_START: dict[str, Any] = {"color": LIMIT, "marker": "."}
_START: dict[str, Any] = {"color": TRUTH, "marker": "s", "markersize": 4.5}
_CENTRE: dict[str, Any] = {"color": MEASURED, "marker": "*", "markersize": 8.0, "linestyle": "none"}
_NODE: dict[str, Any] = {"color": "white", "markeredgecolor": INK, "markersize": 5.0, "linestyle": "none"}
_DOTTED: dict[str, Any] = {"color": LIMIT, "linestyle": (0, (2, 2))}


def draw_all(report: Report) -> Iterator[Figure]:
    """Draw the figures of a report, one after the other."""
    yield draw_path(report.scene)
    yield draw_control(report.scene, report.problem.max_control_m_s2)
    yield draw_costates(report.scene)


@style()
def draw_path(scene: Scene) -> Figure:
    """Draw the path and the motion of the targets, in two planes."""
    positions = scene.path.state(scene.times)[:, :3]
    name, per_m = length_unit(float(np.abs(positions).max()))
    positions = positions * per_m
    hill = scene.hill
    planes = ((1, 0), (1, 2)) if hill else ((0, 1), (0, 2))
    labels = scene.axis_titles
    figure, panels = figure_grid(88.0, 1, 2, (14.0, 4.0, 20.0, 7.0), (17.0, 0.0))
    for panel, (across, up), letter in zip(panels, planes, "ab", strict=True):
        for visit in range(len(scene.order)):
            until_s = float(scene.path.nodes.leave_s[visit])
            track = scene.target_path(visit, np.linspace(scene.tour.start_s, until_s, _TRACK_POINTS)) * per_m
            panel.plot(track[:, across], track[:, up], **_TARGET)
            panel.plot(track[0, across], track[0, up], markersize=4.0, **_TARGET_START)
        panel.plot(positions[:, across], positions[:, up], color=TRUTH, zorder=3)
        panel.plot(positions[0, across], positions[0, up], zorder=4, **_START)
        equal = not hill and up == 1
        if equal:
            panel.plot(0.0, 0.0, **_CENTRE)
        panel.margins(0.1)
        if equal:
            panel.set_aspect("equal", adjustable="datalim")
            panel.apply_aspect()
            panel.set_aspect("auto")  # the limits are final; matplotlib warns about fixed limits with a fixed aspect
        panel.set(xlim=panel.get_xlim(), ylim=panel.get_ylim())
        _mark_visits(panel, scene, positions[:, [across, up]], scene.path.arrival_states[:, [across, up]] * per_m)
        panel.set(xlabel=f"{labels[across]}, {name}", ylabel=f"{labels[up]}, {name}")
        panel.set_title(f"({letter}) axes with {'equal' if equal else 'different'} scales", loc="left")
    legend: dict[str, Any] = {"handlelength": 2.0, "columnspacing": 1.3, "fontsize": 7.0}
    figure.legend(handles=_path_handles(scene), loc="lower center", ncols=7, **legend)
    return figure


def _path_handles(scene: Scene) -> list[Line2D]:
    """Return the legend of the path: only what is drawn."""

    def handle(label: str, **look: Any) -> Line2D:
        return Line2D([], [], label=label, **look)

    rendezvous = scene.path.nodes.rendezvous
    handles = [
        handle("chaser", color=TRUTH),
        handle("start of the chaser", linestyle="none", **_START),
        handle("target until the visit", **_TARGET),
        handle(f"target at t = {scene.tour.start_s:g}", linestyle="none", markersize=5.0, **_TARGET_START),
    ]
    if not all(rendezvous):
        handles.append(handle("flyby", marker="o", **_NODE))
    if any(rendezvous):
        handles.append(handle("rendezvous", marker="D", **_NODE))
    if not scene.hill:
        parameter = getattr(scene.tour.targets, "gravitational_parameter_m3_s2", 0.0)
        sun = abs(parameter / _SUN_M3_S2 - 1.0) < 0.01
        handles.append(handle("Sun" if sun else "centre of gravity", **_CENTRE))
    return handles


def _mark_visits(panel: Axes, scene: Scene, line: Floats, visits: Floats) -> None:
    """Mark the visits with their names in a plane, for a path and visits of shapes (n, 2)."""
    for visit, rendezvous in zip(visits, scene.path.nodes.rendezvous, strict=True):
        panel.plot(*visit, marker="D" if rendezvous else "o", zorder=5, **_NODE)
    if len(visits) <= _MAX_NAMED:
        labels = [(name, visit[None], line) for name, visit in zip(scene.names, visits, strict=True)]
        place_labels(panel, labels, np.vstack([visits, line[:1]]), fontsize=7.0, zorder=6)


@style()
def draw_control(scene: Scene, bound_m_s2: float | None = None) -> Figure:
    """Draw the components and the magnitude of the control against time, with the bound if there is one."""
    times = scene.times
    control = scene.path.control(times) * 1e3
    figure, (above, below) = figure_grid(100.0, 2, 1, (17.0, 8.0, 12.0, 9.0), (0.0, 8.0))
    for axis, title in enumerate(scene.axis_titles):
        _line(above, scene, times, control[:, axis], label=title, **_COMPONENTS[axis])
    _line(below, scene, times, np.linalg.norm(control, axis=1), color=INK)
    if bound_m_s2 is not None:
        below.axhline(1e3 * bound_m_s2, linewidth=0.9, **_DOTTED)
    above.set_ylabel("$u$, mm/s$^2$")
    below.set_ylabel("$|u|$, mm/s$^2$")
    below.set_ylim(bottom=0.0)
    _legend(above)
    _mark_times(scene, above, below)
    return figure


@style()
def draw_costates(scene: Scene) -> Figure:
    """Draw the costates against time; the costate of the position jumps at each visit."""
    times = scene.times
    costate = scene.path.costate(times)
    figure, (above, below) = figure_grid(100.0, 2, 1, (17.0, 8.0, 12.0, 9.0), (0.0, 8.0))
    for axis, title in enumerate(scene.axis_titles):
        _line(above, scene, times, costate[:, axis], label=title, **_COMPONENTS[axis])
        _line(below, scene, times, costate[:, 3 + axis], label=title, **_COMPONENTS[axis])
    above.set_ylabel(r"$\lambda_r$, m/s$^3$")
    below.set_ylabel(r"$\lambda_V$, m/s$^2$")
    _legend(above)
    for panel in (above, below):
        panel.ticklabel_format(axis="y", style="sci", scilimits=(-2, 3), useMathText=True)
    _mark_times(scene, above, below)
    return figure


def _line(panel: Axes, scene: Scene, times: Floats, values: Floats, **look: Any) -> None:
    """Draw a line with breaks where the chaser arrives at a target or leaves it."""
    _, per_s = scene.time_unit
    arrive, leave = scene.path.nodes.arrive_s[:-1], scene.path.nodes.leave_s[:-1]
    cuts = np.searchsorted(times, np.sort(np.concatenate([arrive, leave[leave > arrive]])), side="left")
    for time, value in zip(np.split(times, cuts), np.split(values, cuts), strict=True):
        panel.plot(time * per_s, value, **look)
        look.pop("label", None)


def _legend(panel: Axes) -> None:
    panel.margins(y=0.16)
    look: dict[str, Any] = {"framealpha": 0.85, "edgecolor": "none", "borderpad": 0.2, "fontsize": 7.0}
    panel.legend(loc="lower left", ncols=3, frameon=True, handlelength=1.6, columnspacing=1.0, **look)


def _mark_times(scene: Scene, above: Axes, below: Axes) -> None:
    """Mark the visits and the stays on the time axis of two panels."""
    name, per_s = scene.time_unit
    arrive, leave = scene.path.nodes.arrive_s * per_s, scene.path.nodes.leave_s * per_s
    for panel, letter in ((above, "a"), (below, "b")):
        for time in arrive:
            panel.axvline(time, linewidth=0.7, zorder=0, **_DOTTED)
        for begin, end in zip(arrive[:-1], leave[:-1], strict=True):
            if end > begin:
                panel.axvspan(begin, end, color=SET_FILL, linewidth=0.0, zorder=0)
                panel.text(0.5 * (begin + end), 0.06, "stay", transform=panel.get_xaxis_transform(), rotation=90.0,
                           ha="center", va="bottom", fontsize=7.0)  # fmt: skip
        panel.set_xlim(scene.tour.start_s * per_s, scene.end_s * per_s)
        panel.annotate(f"({letter})", (0.0, 1.0), xycoords="axes fraction", xytext=(-24, 2), textcoords="offset points")
    if len(scene.order) <= _MAX_NAMED:
        for time, target in zip(arrive, scene.names, strict=True):
            above.annotate(target, (time, 1.0), xycoords=("data", "axes fraction"), xytext=(0, 3),
                           textcoords="offset points", ha="center", fontsize=7.0)  # fmt: skip
    below.set_xlabel(f"time, {name}")
