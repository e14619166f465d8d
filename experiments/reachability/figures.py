"""Figures of a rendezvous: the tube in space (figures 1 and 2 of the paper) and in planes, and the controls."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from itertools import product
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Polygon
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d import proj3d  # type: ignore[import-untyped]
from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]
from scipy.spatial import ConvexHull, QhullError

from experiments.common.figure_style import (
    INK,
    LIMIT,
    LINE_LOOKS,
    SET_EDGE,
    SET_FILL,
    figure_grid,
    new_figure,
    place_labels,
    style,
)
from experiments.common.hill_axes import AXIS_TITLES, component_titles
from experiments.reachability.report import Member, Report
from infoset.arrays import Floats
from rendezvous.reachability import SetKind

Projection = tuple[list[int], Floats]
"""Times at which a set is the same, and its vertices."""

_TOLERANCE, _TOLERANCE_IN_SPACE = 2e-3, 1e-2
"""Relative error of the drawn sets."""
_MAX_TIMES, _MAX_TIMES_IN_SPACE = 6, 4
_MANY_EDGES = 120
_OUTLINE_POINTS, _ANCHORS = 96, 4
"""Points of an outline that labels avoid, and the step between those at which its own label can stand."""
_SHARP = np.cos(np.radians(4.0))
_NAMES = {
    "energy": "minimum energy",
    "l1": "minimum L1",
    "norms": "minimum norms",
    "peak": "minimum peak",
    "chebyshev": "Chebyshev centre",
    "analytic": "analytic centre",
}
_MAX_MEMBERS = 4
_START: dict[str, Any] = {
    "color": INK,
    "marker": "o",
    "markerfacecolor": "none",
    "markersize": 7.5,
    "linestyle": "none",
    "zorder": 7,
    "label": "start",
}
_END: dict[str, Any] = {"color": INK, "marker": "*", "linestyle": "none", "label": "terminal state of minimum norm"}
_LABEL: dict[str, Any] = {"fontsize": 6.5, "color": SET_EDGE, "zorder": 8}
_SET: dict[str, Any] = {"facecolor": SET_FILL, "edgecolor": SET_EDGE, "linewidth": 0.7}
_AXES = (*AXIS_TITLES, *component_titles("v"))
_PLANES = ((1, 0), (1, 2), (4, 3), (4, 5))


def _shown(report: Report) -> list[tuple[dict[str, Any], Member, Floats]]:
    """Return the line style, the member and the trajectory of each member drawn."""
    looks = [{**look, "linewidth": 1.0} for look in LINE_LOOKS]
    return [(look, *pair) for look, pair in zip(looks, report.shown[:_MAX_MEMBERS], strict=False)]


def _title(member: Member) -> str:
    return _NAMES.get(member.name, member.name)


def shown_times(periods: int, most: int = _MAX_TIMES) -> list[int]:
    """Return the times at which sets are drawn: all of a few, or evenly spaced ones, and never the last."""
    if periods <= most + 1:
        return list(range(1, periods))
    return sorted({round(t) for t in np.linspace(1, periods - 1, most)})


def _units(report: Report) -> tuple[list[str], Floats]:
    """Return the titles of the six axes, and the factors from SI to their units."""
    unit, per_m = report.length_unit
    names = [f"{name}, {unit if axis < 3 else 'm/s'}" for axis, name in enumerate(_AXES)]
    return names, np.array([per_m] * 3 + [1.0] * 3)


def _projections(report: Report, axes: Sequence[int], max_times: int, tolerance: float) -> list[Projection]:
    """Return the projections of the tube on some axes, in their units; equal ones are joined."""
    factors = _units(report)[1][list(axes)]
    groups: list[Projection] = []
    for t in shown_times(report.solution.problem.periods, max_times):
        points = report.solution.sets.projection(SetKind.TUBE, t, axes, tolerance) * factors
        signs = np.array(list(product((-1.0, 0.0, 1.0), repeat=len(factors))))
        directions = signs / np.maximum(np.ptp(points, axis=0), 1e-12)
        support = (directions @ points.T).max(axis=1)
        for times, other in groups:
            if np.abs((directions @ other.T).max(axis=1) - support).max() < 2.0 * tolerance:
                times.append(t)
                break
        else:
            groups.append(([t], points))
    return groups


def draw_all(report: Report) -> Iterator[Figure]:
    """Draw the figures of a report, one after the other."""
    for draw in (partial(draw_space, first=0), partial(draw_space, first=3), draw_planes, draw_controls):
        yield draw(report)


@style()
def draw_space(report: Report, first: int) -> Figure:
    """Draw three of the six states in space: positions (0) or velocities (3)."""
    figure = new_figure(height_mm=112.0)
    axes: Any = figure.add_axes((-0.03, 0.0, 0.74, 1.0), projection="3d", computed_zorder=False)
    states, (titles, per_si) = slice(first, first + 3), _units(report)
    factors = per_si[states]
    projections = _projections(report, range(first, first + 3), _MAX_TIMES_IN_SPACE, _TOLERANCE_IN_SPACE)
    for _, points in projections:
        _draw_body(axes, points)
    for look, member, path in _shown(report):
        line = {**look, "marker": "none", "linewidth": None, "zorder": 5}
        axes.plot(*(path[:, states] * factors).T, label=f"{_title(member)}, nonlinear", **line)
        marks = {**look, "linestyle": "none", "markersize": 3.5, "zorder": 6}
        axes.plot(*(member.linear[:, states] * factors).T, label=f"{_title(member)}, linear", **marks)
    start, end = (report.tube[t, states].mean(axis=1) * factors for t in (0, -1))
    axes.plot(*start[:, None], **_START)
    axes.plot(*end[:, None], markersize=9.0, zorder=7, **_END)
    for name, title in zip("xyz", titles[states], strict=True):
        getattr(axes, f"set_{name}label")(title, labelpad=3.0)
        getattr(axes, f"{name}axis").set_tick_params(labelsize=6.5, pad=0.0)
        getattr(axes, f"{name}axis").set_major_locator(MaxNLocator(6))
    axes.view_init(elev=22.0, azim=-58.0)
    axes.set_box_aspect((1.0, 1.0, 0.85), zoom=1.0)
    seen = [_on_paper(axes, points) for _, points in projections]
    paths = [_on_paper(axes, path[:, states] * factors) for _, _, path in _shown(report)]
    labels = [
        (
            _name(times),
            points[np.argsort(-points[:, 1])],
            np.vstack([*paths, *(other for other in seen if other is not points)]),
        )
        for (times, _), points in zip(projections, seen, strict=True)
    ]
    place_labels(axes, labels, _on_paper(axes, np.stack([start, end])), **_LABEL)
    handles, _ = axes.get_legend_handles_labels()
    figure.legend(handles=[*handles, Patch(label="tube at t", **_SET)], loc="center left", bbox_to_anchor=(0.705, 0.5))
    return figure


def _on_paper(axes: Any, points: Floats) -> Floats:
    """Return the positions of points in space on the paper, in the coordinates of the axes, shape (n, 2)."""
    return np.column_stack(proj3d.proj_transform(*points.T, axes.get_proj())[:2])


def _draw_body(axes: Any, points: Floats) -> None:
    """Draw a convex body, or a flat one as its polygon."""
    try:
        hull = ConvexHull(points / np.ptp(points, axis=0).max())
        faces = [points[simplex] for simplex in hull.simplices]
        edges = _sharp_edges(points, hull)
    except QhullError:
        faces = [_in_order(points)]
        edges = [np.vstack([faces[0], faces[0][:1]])]
    axes.add_collection3d(Poly3DCollection(faces, facecolor=SET_FILL, edgecolor="none", alpha=0.28))
    line = {"linewidth": 0.2, "alpha": 0.5} if len(edges) > _MANY_EDGES else {"linewidth": 0.45, "alpha": 1.0}
    for edge in edges:
        axes.plot(*edge.T, color=SET_EDGE, **line)


def _sharp_edges(points: Floats, hull: ConvexHull) -> list[Floats]:
    """Return the edges between faces of different planes."""
    return [
        points[np.intersect1d(hull.simplices[face], hull.simplices[other])]
        for face, neighbours in enumerate(hull.neighbors)
        for other in neighbours[neighbours > face]
        if hull.equations[face, :3] @ hull.equations[other, :3] < _SHARP
    ]


def _in_order(points: Floats) -> Floats:
    """Return the vertices of a flat convex set in order."""
    centred = points - points.mean(axis=0)
    first, second = np.linalg.svd(centred, full_matrices=False)[2][:2]
    return np.asarray(points[np.argsort(np.arctan2(centred @ second, centred @ first))])


@style()
def draw_planes(report: Report) -> Figure:
    """Draw positions and velocities in two planes each."""
    figure, panels = figure_grid(162.0, 2, 2, (16.0, 3.0, 12.0, 22.0), (18.0, 16.0))
    titles, per_si = _units(report)
    for axes, plane, letter in zip(panels, map(list, _PLANES), "abcd", strict=True):
        factors, outlines = per_si[plane], []
        projections = _projections(report, tuple(plane), _MAX_TIMES, _TOLERANCE)
        for _, points in projections:
            _draw_polygon(axes, points)
            outlines.append(_along(_in_order(points) if len(points) > 2 else points))
        for look, member, path in _shown(report):
            axes.plot(*(path[:, plane] * factors).T, **{**look, "marker": "none"})
            marks = {**look, "linestyle": "none", "markersize": 3.2}
            axes.plot(*(member.linear[:, plane] * factors).T, **marks)
        start, end = (report.tube[t, plane].mean(axis=1) * factors for t in (0, -1))
        axes.plot(*start, **_START)
        axes.plot(*end, markersize=8.0, zorder=6, **_END)
        axes.set_title(f"({letter})", loc="left")
        axes.set(xlabel=titles[plane[0]], ylabel=titles[plane[1]])
        axes.margins(0.07)
        axes.xaxis.set_major_locator(MaxNLocator(6))
        names = [_name(times) for times, _ in projections]
        paths = [(path[:, plane] * factors) for _, _, path in _shown(report)]
        anchors = [edge[np.argsort(-edge[:, 1])[::_ANCHORS]] for edge in outlines]
        place_labels(
            axes,
            [
                (name, where, np.vstack([*paths, *(other for other in outlines if other is not edge)]))
                for name, where, edge in zip(names, anchors, outlines, strict=True)
            ],
            np.stack([start, end]),
            centred=True,
            **_LABEL,
        )
    handles = [Line2D([], [], markersize=3.2, label=_title(member), **look) for look, member, _ in _shown(report)]
    title = "lines: nonlinear model; marks: linear model, at whole periods" if handles else None
    tube = Patch(label="tube at t", **_SET)
    figure.legend(
        handles=[*handles, *panels[-1].lines[-2:], tube], loc="upper center", ncols=4, title=title, title_fontsize=7.5
    )
    return figure


def _along(vertices: Floats) -> Floats:
    """Return points along the outline of a polygon."""
    after = np.roll(vertices, -1, axis=0)
    shares = np.linspace(0.0, 1.0, _OUTLINE_POINTS // len(vertices) + 2)[:-1, None, None]
    return np.asarray((vertices + shares * (after - vertices)).reshape(-1, 2))


def _name(times: Sequence[int]) -> str:
    return f"t = {', '.join(str(t) for t in times)}"


def _draw_polygon(axes: Axes, points: Floats) -> None:
    if len(points) < 3:
        axes.plot(*points.T, color=SET_EDGE, linewidth=1.0)
    else:
        axes.add_patch(Polygon(_in_order(points), closed=True, alpha=0.6, **_SET))
    axes.update_datalim(points)


@style()
def draw_controls(report: Report) -> Figure:
    """Draw the components of the controls over the periods, and the ranges of all optimal controls."""
    figure, row = figure_grid(62.0, 1, 3, (14.0, 3.0, 12.0, 12.0), (17.0, 0.0))
    periods, bounds = report.solution.problem.periods, report.solution.problem.control_bounds
    for j, axes in enumerate(row):
        low, high = report.ranges[:, j].T
        bars: dict[str, Any] = {"color": SET_FILL, "edgecolor": SET_EDGE, "linewidth": 0.6}
        axes.bar(np.arange(periods) + 0.5, high - low, width=1.0, bottom=low, label="all optimal controls", **bars)
        for look, member, _ in _shown(report):
            line: dict[str, Any] = {"color": look["color"], "linestyle": look["linestyle"], "linewidth": 1.3}
            axes.stairs(member.controls[:, j], np.arange(periods + 1), baseline=None, label=_title(member), **line)
        if max(float(np.abs(report.ranges[:, j]).max()), 1e-9) > 0.7 * bounds[j]:
            for sign in (-1.0, 1.0):
                axes.axhline(sign * bounds[j], color=LIMIT, linewidth=0.7, linestyle=(0, (2, 2)))
        axes.set_xlabel(f"time, periods of {report.rendezvous.period_s:g} s")
        axes.set_ylabel(f"{component_titles('u')[j]} / ({report.rendezvous.acceleration_m_s2:g} m/s²)")
        axes.set_xlim(0, periods)
        axes.use_sticky_edges = False
        axes.margins(x=0.0, y=0.08)
        axes.xaxis.set_major_locator(MaxNLocator(8, integer=True))
    handles, names = row[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="upper center", ncols=len(names))
    return figure
