"""The orbital pursuit-evasion game: orbits, relative motion, thrust, the distance that the evader keeps, feedback."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from experiments.common.display_units import M_PER_KM, length_unit, time_unit
from experiments.common.figure_style import IMPULSE, LIMIT, TRUTH, new_figure, place_axes, style
from rendezvous.pursuit_evasion import Ended, Flight, History, PlayerHistory, Solution, Verdict
from rendezvous.pursuit_evasion.history import orbital_axes

Floats = NDArray[np.float64]

_UNDER: dict[str, Any] = {"linewidth": 2.8}
"""The pursuer's path shows beside the evader's dashes where the two run together."""
PURSUER: dict[str, Any] = {"color": TRUTH, "linestyle": "-"}
EVADER: dict[str, Any] = {"color": "#e6842a", "linestyle": (0, (5, 1.5))}

_ARROWS, _ARROW_LENGTH, _LEAST_HEIGHT = 14, 0.17, 0.15


def draw_orbits(sampled: History) -> Figure:
    """Draw both paths in space with arrows of thrust, and seen along the planet's axis.

    Parameters
    ----------
    sampled : History

    Returns
    -------
    Figure
        Two axes, the first in three dimensions.
    """
    unit, per_m = length_unit(float(np.abs(sampled.pursuer.position_m).max()))
    with style():
        figure = new_figure(height_mm=88.0)
        space: Any = figure.add_axes((-0.02, 0.0, 0.54, 1.0), projection="3d")
        flat = figure.add_axes((0.63, 0.18, 0.35, 0.74))
        for player, look, name in _players(sampled):
            r = player.position_m * per_m
            _draw_path(space, flat, r, player.thrust_direction, {**_UNDER, **look} if name == "pursuer" else look, name)
        end = sampled.evader.position_m[-1] * per_m
        for axes, point in ((space, end), (flat, end[:2])):
            axes.plot(
                *(np.array([each]) for each in point),
                marker="*",
                markersize=9.0,
                color=IMPULSE,
                linestyle="none",
                label="capture",
            )
        across = float(np.abs(sampled.pursuer.position_m).max()) * per_m
        low, high = space.get_zlim()
        middle, half = 0.5 * (low + high), max(0.5 * (high - low), _LEAST_HEIGHT * across)
        space.set_zlim(middle - half, middle + half)
        space.set_xlabel(f"$x$, {unit}", labelpad=-4.0)
        space.set_ylabel(f"$y$, {unit}", labelpad=-4.0)
        space.set_zlabel(f"$z$, {unit}", labelpad=-4.0)
        space.tick_params(pad=-2.0, labelsize=6.5)
        space.set_box_aspect((1.0, 1.0, 0.6), zoom=0.88)
        space.view_init(elev=28.0, azim=-62.0)
        space.set_title("(a) paths and thrust", y=0.91)
        for axis in (space.xaxis, space.yaxis, space.zaxis):
            axis.set_major_locator(_few())
        flat.plot([0.0], [0.0], marker="+", color=LIMIT, markersize=7.0, linestyle="none", label="planet's centre")
        flat.margins(0.12)
        flat.set_aspect("equal", adjustable="box", anchor="C")
        flat.xaxis.set_major_locator(_few())
        flat.set_xlabel(f"$x$, {unit}")
        flat.set_ylabel(f"$y$, {unit}")
        flat.set_title("(b) seen along the planet's axis")
        handles, _ = flat.get_legend_handles_labels()
        handles[2:2] = [Line2D([], [], color=LIMIT, marker="o", markersize=4.0, linestyle="none", label="start")]
        if sampled.pursuer.thrust_direction.any() or sampled.evader.thrust_direction.any():
            arrow: dict[str, Any] = {"marker": r"$\rightarrow$", "markersize": 11.0, "linestyle": "none"}
            handles[2:2] = [Line2D([], [], color=LIMIT, markeredgewidth=0.3, label="thrust", **arrow)]
        figure.legend(handles=handles, loc="lower center", ncols=len(handles))
    return figure


def draw_relative(sampled: History) -> Figure:
    """Draw the pursuer's way in the evader's orbital frame.

    Parameters
    ----------
    sampled : History

    Returns
    -------
    Figure
        Three axes.
    """
    evader = sampled.evader
    axes_of_evader = orbital_axes(evader.position_m, evader.velocity_m_s)
    offset = sampled.pursuer.position_m - evader.position_m
    relative = np.einsum("nij,nj->ni", axes_of_evader, offset)
    length, per_m = length_unit(float(np.abs(relative).max()))
    offset, relative = offset * per_m, relative * per_m
    with style():
        figure = new_figure(height_mm=66.0)
        ((plane, side, distance),) = place_axes(figure, 1, 3, margins_mm=(15.0, 4.0, 12.0, 8.0), gaps_mm=(17.0, 0.0))
        for axes, column, name, title in (
            (plane, 0, f"radial, {length}", "(a) pursuer, seen from the evader"),
            (side, 2, f"normal, {length}", "(b) the same, out of the plane"),
        ):
            axes.plot(relative[:, 1], relative[:, column], **PURSUER)
            axes.plot(
                relative[0, 1],
                relative[0, column],
                marker="o",
                markersize=4.0,
                color=TRUTH,
                linestyle="none",
                label="start",
            )
            axes.plot(0.0, 0.0, marker="*", markersize=9.0, color=IMPULSE, linestyle="none", label="evader")
            axes.set_xlabel(f"along the motion, {length}")
            axes.set_ylabel(name)
            axes.set_title(title)
            axes.xaxis.set_major_locator(_few())
        plane.legend(loc="best")
        time, unit = _times(sampled.time_s)
        distance.plot(time, np.linalg.norm(offset, axis=1), **PURSUER)
        distance.set_xlabel(f"time, {unit}")
        distance.set_ylabel(f"distance, {length}")
        distance.set_title("(c) distance")
        distance.set_ylim(bottom=0.0)
    return figure


def draw_control(sampled: History) -> Figure:
    """Draw the directions of thrust in each craft's own orbital frame, and the switching functions.

    Parameters
    ----------
    sampled : History

    Returns
    -------
    Figure
        Three axes.
    """
    time, unit = _times(sampled.time_s)
    with style():
        figure = new_figure(height_mm=66.0)
        ((inside, outside, switching),) = place_axes(
            figure, 1, 3, margins_mm=(16.0, 4.0, 12.0, 8.0), gaps_mm=(16.0, 0.0)
        )
        for player, look, name in _players(sampled):
            if not player.thrust_direction.any():
                continue
            u = np.einsum("nij,nj->ni", orbital_axes(player.position_m, player.velocity_m_s), player.thrust_direction)
            inside.plot(time, np.degrees(np.unwrap(np.arctan2(u[:, 0], u[:, 1]))), label=name, **look)
            outside.plot(time, np.degrees(np.arcsin(np.clip(u[:, 2], -1.0, 1.0))), label=name, **look)
            switching.plot(time, player.switching, label=name, **look)
        inside.yaxis.set_major_locator(MaxNLocator(nbins=6, steps=[1.0, 1.5, 3.0, 4.5, 9.0, 10.0]))
        inside.set_ylabel("from along-track to outward, deg")
        inside.set_title("(a) thrust in the plane")
        outside.yaxis.set_major_locator(_few())
        outside.set_ylabel("out of the plane, deg")
        outside.set_title("(b) thrust out of the plane")
        switching.set_ylim(bottom=0.0)
        switching.set_ylabel("switching function over its start")
        switching.set_title("(c) full thrust while positive")
        for axes in (inside, outside, switching):
            axes.set_xlabel(f"time, {unit}")
        switching.legend(loc="best")
    return figure


def draw_distance(solution: Solution) -> Figure:
    """Draw the distance that the evader can keep against the duration, and the curvature that certifies it.

    Parameters
    ----------
    solution : Solution

    Returns
    -------
    Figure
        Two axes.
    """
    curve = solution.curve
    time, unit = _times(curve.duration_s)
    radius = solution.game.capture_radius_m / M_PER_KM
    with style():
        figure = new_figure(height_mm=66.0)
        ((left, right),) = place_axes(figure, 1, 2, margins_mm=(15.0, 4.0, 12.0, 8.0), gaps_mm=(20.0, 0.0))
        left.plot(time, curve.distance_m / M_PER_KM, marker="o", markersize=2.2, color=TRUTH)
        left.axhline(radius, color=LIMIT, linewidth=0.8, linestyle="--")
        if solution.verdict is Verdict.CAPTURED:
            left.plot(
                time[-1], radius, marker="*", markersize=9.0, color=IMPULSE, linestyle="none", zorder=5, clip_on=False
            )
        left.set_ylim(bottom=0.0)
        left.set_xlabel(f"duration $T$, {unit}")
        left.set_ylabel("distance kept $l(T)$, km")
        left.set_title(f"(a) {solution.verdict.value}")
        right.plot(time, curve.least_curvature, marker="o", markersize=2.2, color=TRUTH)
        right.set_ylim(bottom=0.0)
        right.set_xlabel(f"duration $T$, {unit}")
        right.set_ylabel("least curvature of $h_P - h_E + l$")
        right.set_title("(b) a saddle while positive")
    return figure


def draw_feedback(solution: Solution, flights: Sequence[Flight]) -> Figure:
    """Draw what each plan predicted and how far the two were apart; of many flights, how their times spread.

    Parameters
    ----------
    solution : Solution
    flights : sequence of Flight

    Returns
    -------
    Figure
        Two axes.
    """
    optimal_s = None if solution.capture is None else solution.capture.time_s
    with style():
        figure = new_figure(height_mm=66.0)
        ((left, right),) = place_axes(figure, 1, 2, margins_mm=(15.0, 4.0, 12.0, 8.0), gaps_mm=(18.0, 0.0))
        faint = {"linewidth": 0.6, "alpha": 0.5} if len(flights) > 1 else {"marker": "o", "markersize": 2.0}
        unit, per_s = time_unit(float(np.ptp(flights[0].planned_s)))
        for flight in flights[:100]:
            left.plot(flight.planned_s * per_s, flight.predicted_s * per_s, color=TRUTH, **faint)
        if optimal_s is not None:
            left.axhline(optimal_s * per_s, color=LIMIT, linewidth=0.8, linestyle="--", label="both play their best")
            left.legend(loc="best")
        left.set_xlabel(f"time of the plan, {unit}")
        left.set_ylabel(f"predicted capture, {unit}")
        left.set_title("(a) what the plans predict")
        if len(flights) == 1:
            (flight,) = flights
            at = np.append(flight.planned_s, flight.time_s) * per_s
            right.plot(at, np.append(flight.distances_m, flight.distance_m) / M_PER_KM, **PURSUER)
            right.set_xlabel(f"time, {unit}")
            right.set_ylabel("distance, km")
            right.set_ylim(bottom=0.0)
            right.set_title(f"(b) {flight.ended.value} at {flight.time_s:.1f} s")
        else:
            times = np.sort([flight.time_s for flight in flights if flight.ended is Ended.CAPTURED]) * per_s
            if len(times):
                right.step(times, np.arange(1, len(times) + 1) / len(flights), where="post", color=TRUTH)
            right.set_ylim(0.0, 1.02)
            right.set_xlabel(f"capture time, {unit}")
            right.set_ylabel("share of flights captured")
            right.set_title(f"(b) {len(times)} of {len(flights)} captured")
    return figure


def _draw_path(space: Any, flat: Axes, r: Floats, direction: Floats, look: dict[str, Any], name: str) -> None:
    """Draw a path with its start and its thrust in both views."""
    for axes, points in ((space, r), (flat, r[:, :2])):
        axes.plot(*points.T, label=name, **look)
        axes.plot(
            *(np.array([each]) for each in points[0]), marker="o", markersize=4.0, color=look["color"], linestyle="none"
        )
    if not direction.any():
        return
    places = np.linspace(0, len(r) - 1, _ARROWS).astype(int)
    length = _ARROW_LENGTH * float(np.abs(r[:, :2]).max())
    u = length * direction[places]
    space.quiver(*r[places].T, *u.T, color=look["color"], linewidth=0.9, arrow_length_ratio=0.25)
    flat.quiver(
        *r[places, :2].T,
        *u[:, :2].T,
        color=look["color"],
        angles="xy",
        scale_units="xy",
        scale=1.0,
        width=0.005,
        headwidth=4.0,
    )
    tips = r[places, :2] + u[:, :2]
    flat.update_datalim(tips)


def _players(sampled: History) -> tuple[tuple[PlayerHistory, dict[str, Any], str], ...]:
    return (sampled.pursuer, PURSUER, "pursuer"), (sampled.evader, EVADER, "evader")


def _times(seconds: Floats) -> tuple[Floats, str]:
    unit, per_s = time_unit(float(np.ptp(seconds)) if len(seconds) else 0.0)
    return seconds * per_s, unit


def _few() -> MaxNLocator:
    return MaxNLocator(nbins=4)
