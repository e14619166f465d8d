"""Figures of the pursuit-evasion game: orbits, relative motion, thrust, distance against duration, feedback."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from experiments.common.display_units import M_PER_KM, length_unit, time_unit
from experiments.common.figure_style import IMPULSE, LIMIT, MEASURED, TRUTH, figure_grid, new_figure, style
from experiments.common.hill_axes import AXIS_TITLES, INERTIAL_TITLES
from experiments.pursuit.report import Report, thrust_angles
from infoset.arrays import Floats
from rendezvous.pursuit_evasion import Ended, Flight, History, PlayerHistory, Solution, Verdict, history, orbital_axes

PURSUER: dict[str, Any] = {"color": TRUTH, "linestyle": "-"}
EVADER: dict[str, Any] = {"color": MEASURED, "linestyle": (0, (5, 1.5))}
_WIDE: dict[str, Any] = {"linewidth": 2.8}
"""The pursuer's path stays visible where the evader's dashes cover it."""
_START: dict[str, Any] = {"marker": "o", "markersize": 4.0, "linestyle": "none"}
_STAR: dict[str, Any] = {"marker": "*", "markersize": 9.0, "color": IMPULSE, "linestyle": "none"}
_LEVEL: dict[str, Any] = {"color": LIMIT, "linewidth": 0.8, "linestyle": "--"}

_ARROWS, _ARROW_LENGTH, _MIN_HEIGHT = 14, 0.17, 0.15


def draw_all(report: Report) -> Iterator[Figure | None]:
    """Draw the figures of a report, one after the other; None is a figure without results."""
    solution, feedback = report.solution, report.feedback
    sampled = None if solution.capture is None else history(solution)
    for draw in (draw_orbits, draw_relative, draw_control):
        yield None if sampled is None else draw(sampled)
    yield draw_distance(solution) if len(solution.curve.duration_s) > 1 else None
    yield None if feedback is None else draw_feedback(solution, feedback.flights)


@style()
def draw_orbits(sampled: History) -> Figure:
    """Draw both paths in space with arrows of thrust, and projected along the planet's axis."""
    size_m = float(np.abs(sampled.pursuer.position_m).max())
    unit, per_m = length_unit(size_m)
    figure = new_figure(height_mm=88.0)
    space: Any = figure.add_axes((-0.02, 0.0, 0.54, 1.0), projection="3d")
    flat = figure.add_axes((0.63, 0.18, 0.35, 0.74))
    _draw_path(space, flat, sampled.pursuer, per_m, {**_WIDE, **PURSUER, "label": "pursuer"})
    _draw_path(space, flat, sampled.evader, per_m, {**EVADER, "label": "evader"})
    end = sampled.evader.position_m[-1] * per_m
    for axes, point in ((space, end), (flat, end[:2])):
        axes.plot(*point[:, None], label="capture", **_STAR)
    low, high = space.get_zlim()
    middle, half = 0.5 * (low + high), max(0.5 * (high - low), _MIN_HEIGHT * size_m * per_m)
    space.set_zlim(middle - half, middle + half)
    for name, title in zip("xyz", INERTIAL_TITLES, strict=True):
        getattr(space, f"set_{name}label")(f"{title}, {unit}", labelpad=-4.0)
        getattr(space, f"{name}axis").set_major_locator(_few_ticks())
    space.tick_params(pad=-2.0, labelsize=6.5)
    space.set_box_aspect((1.0, 1.0, 0.6), zoom=0.88)
    space.view_init(elev=28.0, azim=-62.0)
    space.set_title("(a) paths and thrust", y=0.91)
    flat.plot([0.0], [0.0], marker="+", color=LIMIT, markersize=7.0, linestyle="none", label="planet's centre")
    flat.margins(0.12)
    flat.set_aspect("equal", adjustable="box", anchor="C")
    flat.xaxis.set_major_locator(_few_ticks())
    flat.set(xlabel=f"{INERTIAL_TITLES[0]}, {unit}", ylabel=f"{INERTIAL_TITLES[1]}, {unit}")
    flat.set_title("(b) seen along the planet's axis")
    handles, _ = flat.get_legend_handles_labels()
    handles[2:2] = [Line2D([], [], color=LIMIT, label="start", **_START)]
    if sampled.pursuer.thrust_direction.any() or sampled.evader.thrust_direction.any():
        arrow: dict[str, Any] = {"marker": r"$\rightarrow$", "markersize": 11.0, "linestyle": "none"}
        handles[2:2] = [Line2D([], [], color=LIMIT, markeredgewidth=0.3, label="thrust", **arrow)]
    figure.legend(handles=handles, loc="lower center", ncols=len(handles))
    return figure


@style()
def draw_relative(sampled: History) -> Figure:
    """Draw the path of the pursuer in Hill's axes at the evader, and the distance."""
    evader = sampled.evader
    offset = sampled.pursuer.position_m - evader.position_m
    relative = np.einsum("nij,nj->ni", orbital_axes(evader.position_m, evader.velocity_m_s), offset)
    length, per_m = length_unit(float(np.abs(relative).max()))
    offset, relative = offset * per_m, relative * per_m
    figure, (plane, side, distance) = figure_grid(66.0, 1, 3, (15.0, 4.0, 12.0, 8.0), (17.0, 0.0))
    for axes, column, title in (
        (plane, 0, "(a) pursuer relative to the evader"),
        (side, 2, "(b) out of the orbital plane"),
    ):
        axes.plot(relative[:, 1], relative[:, column], **PURSUER)
        axes.plot(relative[0, 1], relative[0, column], color=TRUTH, label="start", **_START)
        axes.plot(0.0, 0.0, label="evader", **_STAR)
        axes.set(xlabel=f"{AXIS_TITLES[1]}, {length}", ylabel=f"{AXIS_TITLES[column]}, {length}", title=title)
        axes.xaxis.set_major_locator(_few_ticks())
    plane.legend(loc="best")
    time, unit = _times(sampled.time_s)
    distance.plot(time, np.linalg.norm(offset, axis=1), **PURSUER)
    distance.set(xlabel=f"time, {unit}", ylabel=f"distance, {length}", title="(c) distance")
    distance.set_ylim(bottom=0.0)
    return figure


@style()
def draw_control(sampled: History) -> Figure:
    """Draw the thrust directions in the orbital frame of each craft, and the switching functions."""
    time, unit = _times(sampled.time_s)
    figure, (inside, outside, switching) = figure_grid(66.0, 1, 3, (16.0, 4.0, 12.0, 8.0), (16.0, 0.0))
    for name, player, look in (("pursuer", sampled.pursuer, PURSUER), ("evader", sampled.evader, EVADER)):
        if not player.thrust_direction.any():
            continue
        in_plane, out_of_plane = np.degrees(thrust_angles(player)).T
        inside.plot(time, in_plane, label=name, **look)
        outside.plot(time, out_of_plane, label=name, **look)
        switching.plot(time, player.switching, label=name, **look)
    inside.yaxis.set_major_locator(MaxNLocator(nbins=6, steps=[1.0, 1.5, 3.0, 4.5, 9.0, 10.0]))
    inside.set(ylabel="angle from along-track to radial, deg", title="(a) thrust in the orbital plane")
    outside.yaxis.set_major_locator(_few_ticks())
    outside.set(ylabel="angle out of plane, deg", title="(b) thrust out of plane")
    switching.set_ylim(bottom=0.0)
    switching.set(ylabel="switching function / initial value", title="(c) full thrust if positive")
    for axes in (inside, outside, switching):
        axes.set_xlabel(f"time, {unit}")
    switching.legend(loc="best")
    return figure


@style()
def draw_distance(solution: Solution) -> Figure:
    """Draw the distance that the evader can keep against the duration, and the curvature that certifies it.

    Parameters
    ----------
    solution : Solution
        The solution of a game, with or without a capture.
    """
    curve = solution.curve
    time, unit = _times(curve.duration_s)
    radius = solution.game.capture_radius_m / M_PER_KM
    dots: dict[str, Any] = {"marker": "o", "markersize": 2.2, "color": TRUTH}
    figure, (left, right) = figure_grid(66.0, 1, 2, (15.0, 4.0, 12.0, 8.0), (20.0, 0.0))
    left.plot(time, curve.distance_m / M_PER_KM, **dots)
    left.axhline(radius, **_LEVEL)
    if solution.verdict is Verdict.CAPTURED:
        left.plot(time[-1], radius, zorder=5, clip_on=False, **_STAR)
    left.set(ylabel="distance $l(T)$ at the end, km", title=f"(a) {solution.verdict.value}")
    right.plot(time, curve.min_curvature, **dots)
    right.set(ylabel="smallest curvature of $h_P - h_E + l$", title="(b) saddle point if positive")
    for axes in (left, right):
        axes.set_ylim(bottom=0.0)
        axes.set_xlabel(f"duration $T$, {unit}")
    return figure


@style()
def draw_feedback(solution: Solution, flights: Sequence[Flight]) -> Figure:
    """Draw the capture times that the plans predict, and the distance, or the capture times of several simulations."""
    figure, (left, right) = figure_grid(66.0, 1, 2, (15.0, 4.0, 12.0, 8.0), (18.0, 0.0))
    look: dict[str, Any] = {"linewidth": 0.6, "alpha": 0.5} if len(flights) > 1 else {"marker": "o", "markersize": 2.0}
    unit, per_s = time_unit(float(np.ptp(flights[0].planned_s)))
    for flight in flights[:100]:
        left.plot(flight.planned_s * per_s, flight.predicted_s * per_s, color=TRUTH, **look)
    if solution.capture is not None:
        left.axhline(solution.capture.time_s * per_s, label="both players optimal", **_LEVEL)
        left.legend(loc="best")
    left.set(xlabel=f"time of the plan, {unit}", ylabel=f"predicted capture, {unit}", title="(a) predictions")
    if len(flights) == 1:
        (flight,) = flights
        time = np.append(flight.planned_s, flight.time_s) * per_s
        right.plot(time, np.append(flight.distances_m, flight.distance_m) / M_PER_KM, **PURSUER)
        right.set_ylim(bottom=0.0)
        title = f"(b) {flight.ended.value} at {flight.time_s:.1f} s"
        right.set(xlabel=f"time, {unit}", ylabel="distance, km", title=title)
    else:
        times = np.sort([flight.time_s for flight in flights if flight.ended is Ended.CAPTURED]) * per_s
        if len(times):
            right.step(times, np.arange(1, len(times) + 1) / len(flights), where="post", color=TRUTH)
        right.set_ylim(0.0, 1.02)
        title = f"(b) {len(times)} of {len(flights)} captured"
        right.set(xlabel=f"capture time, {unit}", ylabel="share of simulations captured", title=title)
    return figure


def _draw_path(space: Any, flat: Axes, player: PlayerHistory, per_m: float, look: dict[str, Any]) -> None:
    """Draw a path with its start and its thrust in both views."""
    r, colour = player.position_m * per_m, look["color"]
    for axes, points in ((space, r), (flat, r[:, :2])):
        axes.plot(*points.T, **look)
        axes.plot(*points[0][:, None], color=colour, **_START)
    if not player.thrust_direction.any():
        return
    shown = np.linspace(0, len(r) - 1, _ARROWS).astype(int)
    r, u = r[shown], _ARROW_LENGTH * float(np.abs(r[:, :2]).max()) * player.thrust_direction[shown]
    space.quiver(*r.T, *u.T, color=colour, linewidth=0.9, arrow_length_ratio=0.25)
    arrow: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1.0, "width": 0.005, "headwidth": 4.0}
    flat.quiver(*r[:, :2].T, *u[:, :2].T, color=colour, **arrow)
    flat.update_datalim(r[:, :2] + u[:, :2])


def _times(seconds: Floats) -> tuple[Floats, str]:
    unit, per_s = time_unit(float(np.ptp(seconds)) if len(seconds) else 0.0)
    return seconds * per_s, unit


def _few_ticks() -> MaxNLocator:
    return MaxNLocator(nbins=4)
