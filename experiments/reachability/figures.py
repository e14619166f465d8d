"""Reachable rendezvous: the tube with trajectories in space (figures 1 and 2 of the paper), in planes, and controls."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import product
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Polygon
from matplotlib.patheffects import Normal, Stroke
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from experiments.common.display_units import length_unit
from experiments.common.figure_style import INK, LIMIT, SET_EDGE, SET_FILL, new_figure, place_axes, style
from experiments.reachability.report import Member, Report
from rendezvous.reachability import SetKind

Floats = NDArray[np.float64]
Progress = Callable[[float], None]
Shown = Sequence[tuple[Member, Floats]]
"""Members and their flights."""

_TOLERANCE, _TOLERANCE_IN_SPACE = 2e-3, 1e-2
"""By how much of their size sets may be drawn too small."""
_MOST_TIMES, _MOST_TIMES_IN_SPACE = 6, 4
_TOGETHER = 0.06
_MANY_EDGES = 120
_SHARP = np.cos(np.radians(4.0))
_NAMES = {
    "energy": "least energy",
    "l1": "least L1",
    "norms": "least norms",
    "peak": "least peak",
    "chebyshev": "Chebyshev centre",
    "analytic": "analytic centre",
}
_MOST_MEMBERS = 4
_LOOKS: tuple[dict[str, Any], ...] = (
    {"color": "#08306b", "linestyle": "-", "marker": "o"},
    {"color": "#e6842a", "linestyle": (0, (4, 1.5)), "marker": "s"},
    {"color": "#7f2704", "linestyle": (0, (1, 1)), "marker": "^"},
    {"color": "#2f6b3a", "linestyle": (0, (5, 1, 1, 1)), "marker": "D"},
)
_HALO = [Stroke(linewidth=2.2, foreground="white"), Normal()]
_START: dict[str, Any] = {
    "color": INK,
    "marker": "o",
    "markerfacecolor": "none",
    "markersize": 7.5,
    "linestyle": "none",
    "zorder": 7,
    "label": "start",
}
_END = "least terminal state"
_TUBE = Patch(facecolor=SET_FILL, edgecolor=SET_EDGE, linewidth=0.7, label="tube at t")
_AXES = ("x", "y", "z", "$v_x$", "$v_y$", "$v_z$")
_PLANES = ((0, 1), (0, 2), (3, 4), (3, 5))


def draw_reach(report: Report, progress: Progress = lambda _done: None) -> Iterator[Figure]:
    """Draw positions and velocities in space, the tube in planes, and the controls.

    Parameters
    ----------
    report : Report
    progress : callable
        Told the fraction done, to four fifths.

    Yields
    ------
    Figure
        Four of them.
    """
    shown = report.shown[:_MOST_MEMBERS]
    with style():
        for part in (0, 1):
            yield _space(report, shown, part)
            progress(0.25 * (part + 1))
        yield _planes(report, shown)
        progress(0.8)
        yield _controls(report, [member for member, _ in shown])


def shown_times(periods: int, most: int = _MOST_TIMES) -> list[int]:
    """Return at which times sets are drawn: all of a few, evenly spread ones of many, never the last.

    Parameters
    ----------
    periods : int
    most : int

    Returns
    -------
    list of int
    """
    if periods <= most + 1:
        return list(range(1, periods))
    return sorted({round(each) for each in np.linspace(1, periods - 1, most)})


def _space(report: Report, shown: Shown, part: int) -> Figure:
    """Positions (0) or velocities (1)."""
    figure = new_figure(height_mm=112.0)
    axes: Any = figure.add_axes((-0.03, 0.0, 0.74, 1.0), projection="3d", computed_zorder=False)
    first = 3 * part
    places = slice(first, first + 3)
    sets, (titles, per_si) = report.solution.sets, _units(report)
    factors = per_si[places]
    shadows = [
        (t, sets.shadow(SetKind.TUBE, t, range(first, first + 3), _TOLERANCE_IN_SPACE) * factors)
        for t in shown_times(sets.problem.periods, _MOST_TIMES_IN_SPACE)
    ]
    labels = []
    for times, points in _equal(shadows, _TOLERANCE_IN_SPACE):
        _solid(axes, points)
        labels.append((times, points[points[:, 2].argmax()]))
    for text, place in _stacked(labels, report.tube[:, places] * factors[:, None]):
        label = axes.text(*place, text, fontsize=7.0, color=SET_EDGE, ha="center", va="bottom", zorder=8)
        label.set_path_effects(_HALO)
    for look, (member, path) in zip(_LOOKS, shown, strict=False):
        name = title(member)
        line = {"color": look["color"], "linestyle": look["linestyle"], "zorder": 5}
        axes.plot(*(path[:, places] * factors).T, label=f"{name}, nonlinear", **line)
        marks = {"color": look["color"], "marker": look["marker"], "markersize": 3.5, "linestyle": "none", "zorder": 6}
        axes.plot(*(member.linear[:, places] * factors).T, label=f"{name}, linear", **marks)
    star = {"color": INK, "marker": "*", "markersize": 9.0, "linestyle": "none", "zorder": 7}
    axes.plot(*(report.tube[0].mean(axis=1)[places] * factors)[:, None], **_START)
    axes.plot(*(member_end(report)[places] * factors)[:, None], label=_END, **star)
    for name, label in zip("xyz", titles[places], strict=True):
        getattr(axes, f"set_{name}label")(label, labelpad=3.0)
        getattr(axes, f"{name}axis").set_tick_params(labelsize=6.5, pad=0.0)
        getattr(axes, f"{name}axis").set_major_locator(MaxNLocator(6))
    axes.view_init(elev=22.0, azim=-58.0)
    axes.set_box_aspect((1.0, 1.0, 0.85), zoom=1.0)
    handles, _ = axes.get_legend_handles_labels()
    figure.legend(handles=[*handles, _TUBE], loc="center left", bbox_to_anchor=(0.705, 0.5))
    return figure


def _units(report: Report) -> tuple[list[str], Floats]:
    """Return the six axes' titles, and how many of their units make those of the states."""
    unit, per_m = length_unit(float(np.abs(report.tube[:, :3]).max()))
    names = [f"{name}, {unit if place < 3 else 'm/s'}" for place, name in enumerate(_AXES)]
    return names, np.array([per_m] * 3 + [1.0] * 3)


def title(member: Member) -> str:
    """Return what a legend calls a control."""
    return _NAMES.get(member.name, member.name)


def _equal(shadows: Sequence[tuple[int, Floats]], tolerance: float) -> list[tuple[list[int], Floats]]:
    """Join the times whose sets are one, to twice by how much each may be drawn too small: each is drawn once."""
    groups: list[tuple[list[int], Floats]] = []
    for t, points in shadows:
        signs = np.array(list(product((-1.0, 0.0, 1.0), repeat=points.shape[1])))
        towards = signs / np.maximum(np.ptp(points, axis=0), 1e-12)
        reach = (towards @ points.T).max(axis=1)
        same = (each for each in groups if np.abs((towards @ each[1].T).max(axis=1) - reach).max() < 2.0 * tolerance)
        group = next(same, None)
        if group is None:
            groups.append(([t], points))
        else:
            group[0].append(t)
    return groups


def _stacked(labels: Sequence[tuple[list[int], Floats]], bounds: Floats) -> list[tuple[str, Floats]]:
    """Labels of sets, one above the other where their places lie together."""
    size = np.maximum(np.ptp(bounds, axis=(0, 2)), 1e-12)
    out: list[tuple[str, Floats]] = []
    for times, place in labels:
        below = sum(float(np.abs((each - place) / size).max()) < _TOGETHER for _, each in out)
        out.append((f"t = {', '.join(str(t) for t in times)}" + "\n" * below, place))
    return out


def member_end(report: Report) -> Floats:
    """Return the least terminal state, shape (6,): the tube at T is that one point."""
    return np.asarray(report.tube[-1].mean(axis=1))


def _solid(axes: Any, points: Floats) -> None:
    """Draw a convex body, a flat one as its polygon."""
    try:
        hull = ConvexHull(points / np.ptp(points, axis=0).max())
        faces = [points[each] for each in hull.simplices]
        edges = _sharp_edges(points, hull)
    except QhullError:
        outline = _outline(points)
        faces, edges = [outline], [np.vstack([outline, outline[:1]])]
    axes.add_collection3d(Poly3DCollection(faces, facecolor=SET_FILL, edgecolor="none", alpha=0.28))
    fine = {"linewidth": 0.2, "alpha": 0.5} if len(edges) > _MANY_EDGES else {"linewidth": 0.45, "alpha": 1.0}
    for edge in edges:
        axes.plot(*edge.T, color=SET_EDGE, **fine)


def _sharp_edges(points: Floats, hull: ConvexHull) -> list[Floats]:
    """Edges between faces that are not in one plane."""
    found = []
    for place, neighbours in enumerate(hull.neighbors):
        for other in neighbours[neighbours > place]:
            if hull.equations[place, :3] @ hull.equations[other, :3] < _SHARP:
                found.append(points[np.intersect1d(hull.simplices[place], hull.simplices[other])])
    return found


def _outline(points: Floats) -> Floats:
    """Points of a flat set in the order round it."""
    centred = points - points.mean(axis=0)
    first, second = np.linalg.svd(centred, full_matrices=False)[2][:2]
    return np.asarray(points[np.argsort(np.arctan2(centred @ second, centred @ first))])


def _planes(report: Report, shown: Shown) -> Figure:
    figure = new_figure(height_mm=162.0)
    grid = place_axes(figure, 2, 2, margins_mm=(16.0, 3.0, 12.0, 22.0), gaps_mm=(18.0, 16.0))
    titles, per_si = _units(report)
    for axes, plane, letter in zip([each for row in grid for each in row], _PLANES, "abcd", strict=True):
        names, factors = [], per_si[list(plane)]
        shadows = [
            (t, report.solution.sets.shadow(SetKind.TUBE, t, plane, _TOLERANCE) * factors)
            for t in shown_times(report.solution.problem.periods)
        ]
        for times, points in _equal(shadows, _TOLERANCE):
            _flat(axes, points)
            highest = points[points[:, 1] >= points[:, 1].max() - 0.01 * np.ptp(points[:, 1])]
            names.append((times, np.array([highest[:, 0].mean(), points[:, 1].max()])))
        for text, place in _stacked(names, report.tube[:, list(plane)] * factors[:, None]):
            axes.annotate(
                text, (float(place[0]), float(place[1])), fontsize=6.5, color=SET_EDGE, ha="center", va="bottom",
                zorder=8, path_effects=_HALO,
            )  # fmt: skip
        for look, (member, path) in zip(_LOOKS, shown, strict=False):
            axes.plot(*(path[:, plane] * factors).T, color=look["color"], linestyle=look["linestyle"], linewidth=1.0)
            marks = {"marker": look["marker"], "markersize": 3.2, "linestyle": "none", "color": look["color"]}
            axes.plot(*(member.linear[:, plane] * factors).T, label=title(member), **marks)
        end = member_end(report)[list(plane)] * factors
        axes.plot(*(report.tube[0].mean(axis=1)[list(plane)] * factors), **_START)
        axes.plot(*end, color=INK, marker="*", markersize=8.0, linestyle="none", zorder=6, label=_END)
        axes.set_title(f"({letter})", loc="left")
        axes.set_xlabel(titles[plane[0]])
        axes.set_ylabel(titles[plane[1]])
        axes.margins(0.07)
        axes.xaxis.set_major_locator(MaxNLocator(6))
    both = [Line2D([], [], markersize=3.2, linewidth=1.0, label=title(each), **look)
            for look, (each, _) in zip(_LOOKS, shown, strict=False)]  # fmt: skip
    named = dict(zip(*grid[0][0].get_legend_handles_labels()[::-1], strict=True))
    figure.legend(
        handles=[*both, named["start"], named[_END], _TUBE], loc="upper center", ncols=4,
        title="lines: nonlinear motion; marks: linear, at the instants" if both else None, title_fontsize=7.5,
    )  # fmt: skip
    return figure


def _flat(axes: Axes, points: Floats) -> None:
    if len(points) < 3:
        axes.plot(*points.T, color=SET_EDGE, linewidth=1.0)
        axes.update_datalim(points)
        return
    axes.add_patch(
        Polygon(_outline(points), closed=True, facecolor=SET_FILL, edgecolor=SET_EDGE, linewidth=0.7, alpha=0.6)
    )
    axes.update_datalim(points)


def _controls(report: Report, members: Sequence[Member]) -> Figure:
    figure = new_figure(height_mm=62.0)
    (row,) = place_axes(figure, 1, 3, margins_mm=(14.0, 3.0, 12.0, 12.0), gaps_mm=(17.0, 0.0))
    periods = report.solution.problem.periods
    bounds = report.solution.problem.control_bounds
    for j, axes in enumerate(row):
        low, high = report.ranges[:, j].T
        starts = np.arange(periods)
        axes.bar(
            starts + 0.5, high - low, width=1.0, bottom=low, color=SET_FILL, edgecolor=SET_EDGE, linewidth=0.6,
            label="all optimal controls",
        )  # fmt: skip
        for look, member in zip(_LOOKS, members, strict=False):
            axes.stairs(
                member.controls[:, j],
                np.arange(periods + 1),
                baseline=None,
                color=look["color"],
                linestyle=look["linestyle"],
                linewidth=1.3,
                label=title(member),
            )
        if max(float(np.abs(report.ranges[:, j]).max()), 1e-9) > 0.7 * bounds[j]:
            for sign in (-1.0, 1.0):
                axes.axhline(sign * bounds[j], color=LIMIT, linewidth=0.7, linestyle=(0, (2, 2)))
        axes.set_xlabel(f"time, periods of {report.rendezvous.period_s:g} s")
        axes.set_ylabel(f"$u_{'xyz'[j]}$ / ({report.rendezvous.acceleration_m_s2:g} m/s²)")
        axes.set_xlim(0, periods)
        axes.use_sticky_edges = False
        axes.margins(x=0.0, y=0.08)
        axes.xaxis.set_major_locator(MaxNLocator(8, integer=True))
    handles, names = row[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="upper center", ncols=len(names))
    return figure
