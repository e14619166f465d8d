"""Visits to several targets: the path with the targets' motion, the control, the costates, cost against each time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patheffects import Normal, Stroke
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import NDArray

from experiments.common.display_units import Unit, length_unit, time_unit
from experiments.common.figure_style import (
    IMPULSE,
    INK,
    LIMIT,
    MEASURED,
    SET_EDGE,
    SET_FILL,
    TRUTH,
    new_figure,
    place_axes,
    style,
)
from experiments.multipoint.curves import CostCurve
from experiments.multipoint.tables import Axes as FrameAxes
from rendezvous.multipoint import Path, Visits

Floats = NDArray[np.float64]

_POINTS = 1601
_TRACK_POINTS = 241
_COMPONENTS: tuple[dict[str, Any], ...] = (
    {"color": TRUTH, "linestyle": "-"},
    {"color": MEASURED, "linestyle": (0, (5, 1.5))},
    {"color": IMPULSE, "linestyle": (0, (1.2, 1.0))},
)
_MOST_NAMED = 12
_PLACES = tuple(
    (right, up, far)
    for far in (5.0, 9.0, 15.0)
    for right, up in ((1, 1), (-1, 1), (1, -1), (-1, -1), (0, 1), (0, -1), (1, 0), (-1, 0))
)
"""Where a name may stand beside its mark: the side across and up, and how far, points; better ones first."""
_SUN_M3_S2 = 1.32712440018e20
_CLASH, _OUTSIDE = 100.0, 1000.0


@dataclass(frozen=True, eq=False)
class Scene:
    """What is drawn.

    Parameters
    ----------
    axes : Axes
        What positions are in.
    tour : Visits
    order : tuple of int
        Which target first, second and so on.
    path : Path
    """

    axes: FrameAxes
    tour: Visits
    order: tuple[int, ...]
    path: Path

    @property
    def names(self) -> list[str]:
        """Names of the targets, in the order of the visits."""
        return [self.tour.targets.targets[each].name for each in self.order]

    @property
    def end_s(self) -> float:
        """When the last target is met."""
        return float(self.path.nodes.arrive_s[-1])

    def times(self, count: int) -> Floats:
        """Return equally spaced times, with both sides of every node among them."""
        even = np.linspace(self.tour.start_s, self.end_s, count)
        nodes = self.path.nodes.arrive_s
        return np.unique(np.concatenate([even, nodes, np.nextafter(nodes, -np.inf), self.path.nodes.leave_s[:-1]]))

    @property
    def time_unit(self) -> Unit:
        """The unit that times are drawn in."""
        return time_unit(self.end_s - self.tour.start_s)


def draw_path(scene: Scene) -> Figure:
    """Draw the path with the targets' motion, in two planes.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    Figure
        Two axes.
    """
    flown = scene.path.state(scene.times(_POINTS))[:, :3]
    name, per_m = length_unit(float(np.abs(flown).max()))
    flown = flown * per_m
    hill = scene.axes is FrameAxes.HILL
    planes = ((1, 0), (1, 2)) if hill else ((0, 1), (0, 2))
    labels = ("x (radial)", "y (along the motion)", "z (normal)") if hill else ("x", "y", "z")
    with style():
        figure = new_figure(height_mm=88.0)
        (panels,) = place_axes(figure, 1, 2, margins_mm=(14.0, 4.0, 20.0, 7.0), gaps_mm=(17.0, 0.0))
        for panel, (across, up), letter in zip(panels, planes, "ab", strict=True):
            for place, target in enumerate(scene.order):
                track = _track(scene, place, target) * per_m
                panel.plot(track[:, across], track[:, up], color=LIMIT, linewidth=0.7, linestyle=(0, (3, 2)))
                panel.plot(track[0, across], track[0, up], marker=".", color=LIMIT, markersize=4.0)
            panel.plot(flown[:, across], flown[:, up], color=TRUTH, zorder=3)
            panel.plot(flown[0, across], flown[0, up], marker="s", color=TRUTH, markersize=4.5, zorder=4)
            if not hill and across == 0 and up == 1:
                panel.plot(0.0, 0.0, marker="*", color=MEASURED, markersize=8.0, linestyle="none")
            panel.margins(0.1)
            same_scale = not hill and up == 1
            if same_scale:
                panel.set_aspect("equal", adjustable="datalim")
                panel.apply_aspect()
            _mark_nodes(panel, scene, across, up, per_m, flown)
            panel.set_xlabel(f"{labels[across]}, {name}")
            panel.set_ylabel(f"{labels[up]}, {name}")
            panel.set_title(f"({letter}) axes to one scale" if same_scale else f"({letter}) axes not to one scale",
                            loc="left")  # fmt: skip
        figure.legend(
            handles=_path_handles(scene), loc="lower center", ncols=7, handlelength=2.0, columnspacing=1.3, fontsize=7.0
        )
    return figure


def _centre(scene: Scene) -> str:
    """What planets or asteroids go round: the Sun where gravity is its."""
    parameter = getattr(scene.tour.targets, "gravitational_parameter_m3_s2", 0.0)
    return "Sun" if abs(parameter / _SUN_M3_S2 - 1.0) < 0.01 else "centre of gravity"


def _path_handles(scene: Scene) -> list[Line2D]:
    """What the legend of the path explains: only what is drawn."""
    mark: dict[str, Any] = {"linestyle": "none", "markersize": 5.0}
    hollow: dict[str, Any] = {**mark, "color": "white", "markeredgecolor": INK}
    met = scene.path.nodes.rendezvous
    handles = [
        Line2D([], [], color=TRUTH, label="chaser"),
        Line2D([], [], marker="s", color=TRUTH, label="its start", **{**mark, "markersize": 4.5}),
        Line2D([], [], color=LIMIT, linewidth=0.7, linestyle=(0, (3, 2)), label="target until it is met"),
        Line2D([], [], marker=".", color=LIMIT, label=f"target at t = {scene.tour.start_s:g}", **mark),
    ]
    if not all(met):
        handles.append(Line2D([], [], marker="o", label="flyby", **hollow))
    if any(met):
        handles.append(Line2D([], [], marker="D", label="rendezvous", **hollow))
    if scene.axes is not FrameAxes.HILL:
        handles.append(Line2D([], [], marker="*", color=MEASURED, label=_centre(scene), **{**mark, "markersize": 8.0}))
    return handles


def draw_control(scene: Scene, bound_m_s2: float | None = None) -> Figure:
    """Draw the control's components and size against time.

    Parameters
    ----------
    scene : Scene
    bound_m_s2 : float or None
        A bound on its size.

    Returns
    -------
    Figure
        Two axes.
    """
    times = scene.times(_POINTS)
    control = scene.path.control(times) * 1e3
    with style():
        figure = new_figure(height_mm=100.0)
        ((above,), (below,)) = place_axes(figure, 2, 1, margins_mm=(17.0, 8.0, 12.0, 9.0), gaps_mm=(0.0, 8.0))
        for axis, letter in enumerate("xyz"):
            _line(above, scene, times, control[:, axis], label=f"$u_{letter}$", **_COMPONENTS[axis])
        _line(below, scene, times, np.linalg.norm(control, axis=1), color=INK)
        if bound_m_s2 is not None:
            below.axhline(1e3 * bound_m_s2, color=LIMIT, linewidth=0.9, linestyle=(0, (2, 2)))
        above.set_ylabel("$u$, mm/s$^2$")
        below.set_ylabel("$|u|$, mm/s$^2$")
        below.set_ylim(bottom=0.0)
        _legend(above)
        _mark_times(scene, above, below)
    return figure


def draw_costates(scene: Scene) -> Figure:
    """Draw the costates: that of the position jumps where a target is met.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    Figure
        Two axes.
    """
    times = scene.times(_POINTS)
    costate = scene.path.costate(times)
    with style():
        figure = new_figure(height_mm=100.0)
        ((above,), (below,)) = place_axes(figure, 2, 1, margins_mm=(17.0, 8.0, 12.0, 9.0), gaps_mm=(0.0, 8.0))
        for axis, letter in enumerate("xyz"):
            _line(above, scene, times, costate[:, axis], label=rf"$\lambda_{{r,{letter}}}$", **_COMPONENTS[axis])
            _line(below, scene, times, costate[:, 3 + axis], label=rf"$\lambda_{{V,{letter}}}$", **_COMPONENTS[axis])
        above.set_ylabel(r"$\lambda_r$, m/s$^3$")
        below.set_ylabel(r"$\lambda_V$, m/s$^2$")
        for panel in (above, below):
            _legend(panel)
            panel.ticklabel_format(axis="y", style="sci", scilimits=(-2, 3), useMathText=True)
        _mark_times(scene, above, below)
    return figure


def draw_times(scene: Scene, curves: list[CostCurve]) -> Figure:
    """Draw the cost against each time.

    Parameters
    ----------
    scene : Scene
    curves : list of CostCurve

    Returns
    -------
    Figure
        One axes a visit.
    """
    name, per_s = scene.time_unit
    columns = min(len(curves), 3)
    rows = -(-len(curves) // columns)
    with style():
        figure = new_figure(height_mm=20.0 + 48.0 * rows)
        grid = place_axes(figure, rows, columns, margins_mm=(16.0, 4.0, 12.0, 7.0), gaps_mm=(15.0, 16.0))
        panels = [panel for row in grid for panel in row]
        for index, panel in enumerate(panels):
            if index >= len(curves):
                panel.remove()
                continue
            curve, now = curves[index], float(scene.path.nodes.arrive_s[index])
            panel.plot(curve.time_s * per_s, curve.cost, color=SET_EDGE)
            panel.plot(now * per_s, scene.path.cost, marker="o", color=INK, markersize=4.0)
            reach = 0.12 * float(np.ptp(curve.time_s))
            ends = np.array([-reach, reach])
            panel.plot(
                (now + ends) * per_s, scene.path.cost + scene.path.time_gradient[index] * ends, color=MEASURED,
                linewidth=0.9, label="slope $dI/dt$",
            )  # fmt: skip
            if curve.cost.max() > 20.0 * max(curve.cost.min(), 1e-300):
                panel.set_yscale("log")
                panel.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
                panel.yaxis.set_major_formatter(FuncFormatter(lambda value, _place: f"{value:g}"))
                panel.yaxis.set_minor_formatter(NullFormatter())
            panel.set_xlabel(f"time of {scene.names[index]}, {name}")
            panel.set_title(f"({chr(ord('a') + index)})", loc="left")
            if index % columns == 0:
                panel.set_ylabel("$I$, m$^2$/s$^3$")
        panels[0].legend(loc="best")
    return figure


def _legend(panel: Axes) -> None:
    panel.margins(y=0.16)
    panel.legend(loc="best", ncols=3, frameon=True, framealpha=0.85, edgecolor="none", borderpad=0.2)


def _track(scene: Scene, place: int, target: int) -> Floats:
    """Positions of a target until it is met, and while the chaser stays."""
    until = float(scene.path.nodes.leave_s[place])
    times = np.linspace(scene.tour.start_s, until, _TRACK_POINTS)
    return scene.tour.targets.states(np.full(len(times), target), times)[:, :3]


def _mark_nodes(panel: Axes, scene: Scene, across: int, up: int, per_m: float, flown: Floats) -> None:
    marks = scene.path.arrival_states[:, [across, up]] * per_m
    named = len(scene.order) <= _MOST_NAMED
    labels = []
    for place, name in enumerate(scene.names):
        where = scene.path.arrival_states[place, :3] * per_m
        met = bool(scene.path.nodes.rendezvous[place])
        panel.plot(where[across], where[up], marker="D" if met else "o", markersize=5.0, color="white",
                   markeredgecolor=INK, linestyle="none", zorder=5)  # fmt: skip
        if named:
            labels.append(
                panel.annotate(
                    name, (where[across], where[up]), xytext=(4, 4), textcoords="offset points", fontsize=7.0, zorder=6
                )
            )
            labels[-1].set_path_effects([Stroke(linewidth=2.0, foreground="white"), Normal()])
    panel.set_xlim(panel.get_xlim())
    panel.set_ylim(panel.get_ylim())
    line = flown[:, [across, up]]
    _push_apart(panel, labels, np.vstack([marks, line[:1]]), line)


def _push_apart(panel: Axes, labels: list[Any], marks: Floats, line: Floats) -> None:
    """Put each name beside its mark where it covers no other name, no mark and as little of the path as can be."""
    figure: Any = panel.figure
    renderer = figure.canvas.get_renderer()
    pixels_per_point = figure.dpi / 72.0
    line, marks = panel.transData.transform(line), panel.transData.transform(marks)
    frame = panel.get_window_extent(renderer)
    taken: list[Any] = []
    for label in labels:
        best: tuple[float, tuple[float, float], dict[str, str]] = (np.inf, (0.0, 0.0), {})
        for rank, (right, up, far) in enumerate(_PLACES):
            look = {"ha": ("center", "left", "right")[right], "va": ("center", "bottom", "top")[up]}
            beside = (right * far, up * far * (1.0 if right == 0 else 0.7))
            label.set(**look)
            label.set_position(beside)
            box = label.get_window_extent(renderer)
            clash = sum(box.overlaps(each) for each in taken) + np.count_nonzero(
                _within(box.padded(3.0 * pixels_per_point), marks)
            )
            outside = not (frame.x0 <= box.x0 and box.x1 <= frame.x1 and frame.y0 <= box.y0 and box.y1 <= frame.y1)
            covered = np.count_nonzero(_within(box, line))
            bad = _OUTSIDE * outside + _CLASH * clash + 3.0 * covered + rank
            if bad < best[0]:
                best = (bad, beside, look)
        label.set(**best[2])
        label.set_position(best[1])
        taken.append(label.get_window_extent(renderer))


def _within(box: Any, points: Floats) -> NDArray[np.bool_]:
    """Which points lie in a box."""
    return np.asarray((points > (box.x0, box.y0)).all(axis=1) & (points < (box.x1, box.y1)).all(axis=1))


def _line(panel: Axes, scene: Scene, times: Floats, values: Floats, **look: Any) -> None:
    """A line that breaks where it jumps: where a target is met, and where it is left."""
    _, per_s = scene.time_unit
    nodes = scene.path.nodes
    stays = nodes.leave_s[:-1][nodes.leave_s[:-1] > nodes.arrive_s[:-1]]
    cuts = np.searchsorted(times, np.sort(np.concatenate([nodes.arrive_s[:-1], stays])), side="left")
    label = look.pop("label", None)
    for piece, (one, other) in enumerate(zip(np.split(times, cuts), np.split(values, cuts), strict=True)):
        panel.plot(one * per_s, other, label=label if piece == 0 else None, **look)


def _mark_times(scene: Scene, above: Axes, below: Axes) -> None:
    name, per_s = scene.time_unit
    for panel, letter in ((above, "a"), (below, "b")):
        for when in scene.path.nodes.arrive_s:
            panel.axvline(when * per_s, color=LIMIT, linewidth=0.7, linestyle=(0, (2, 2)), zorder=0)
        nodes = scene.path.nodes
        for arrive, leave in zip(nodes.arrive_s[:-1] * per_s, nodes.leave_s[:-1] * per_s, strict=True):
            if leave > arrive:
                panel.axvspan(arrive, leave, color=SET_FILL, linewidth=0.0, zorder=0)
                panel.text(0.5 * (arrive + leave), 0.06, "stay", transform=panel.get_xaxis_transform(), rotation=90.0,
                           ha="center", va="bottom", fontsize=7.0)  # fmt: skip
        panel.set_xlim(scene.tour.start_s * per_s, scene.end_s * per_s)
        panel.annotate(f"({letter})", (0.0, 1.0), xycoords="axes fraction", xytext=(-24, 2), textcoords="offset points")
    if len(scene.order) <= _MOST_NAMED:
        for when, target in zip(scene.path.nodes.arrive_s, scene.names, strict=True):
            above.annotate(target, (when * per_s, 1.0), xycoords=("data", "axes fraction"), xytext=(0, 3),
                           textcoords="offset points", ha="center", fontsize=7.0)  # fmt: skip
    below.set_xlabel(f"time, {name}")
