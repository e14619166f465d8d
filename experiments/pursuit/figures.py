"""Figures of the pursuit game: orbits, relative motion, thrust, distances and feedback.

Heights of figures, mm, and sizes of lines, marks and letters are chosen by eye.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from infoset.arrays import Floats
from infoset.experiments.common.figure_style import (
    BOUND,
    IMPULSE,
    LIMIT,
    MEASURED,
    TRUTH,
    label_axes,
    legend_below,
    letters,
    new_figure,
    style,
    subplots,
)
from infoset.experiments.common.hill_axes import AXIS_TITLES, INERTIAL_TITLES
from infoset.experiments.common.units import M_PER_KM, length_unit, time_unit
from infoset.experiments.pursuit.report import PursuitReport, thrust_angles
from infoset.rendezvous.pursuit_evasion import (
    CaptureHistory,
    CaptureSolution,
    CertificateVerdict,
    Ended,
    PlayerHistory,
    PursuitFlight,
    history,
    orbital_axes,
)

PURSUER: dict[str, Any] = {"color": TRUTH, "linestyle": "-", "label": "pursuer"}
EVADER: dict[str, Any] = {"color": MEASURED, "linestyle": (0, (5, 1.5)), "label": "evader"}
_START: dict[str, Any] = {"marker": "o", "markersize": 4.0, "linestyle": "none", "label": "start"}
_STAR: dict[str, Any] = {"marker": "*", "markersize": 9.0, "color": IMPULSE, "linestyle": "none"}

_ARROWS = 14
"""Number of arrows of thrust on a path; chosen: arrows do not overlap."""
_ARROW_LENGTH = 0.17
"""Length of an arrow, as a share of the orbit's radius; chosen: long enough to show directions."""
_MIN_HEIGHT = 0.15
"""Smallest half height of the box of the orbits, as a share of their size; chosen: the small
inclination of an orbit is not stretched to the height of the panel.
"""


def draw_all(report: PursuitReport) -> Iterator[Figure | None]:
    """Draw the figures of a report, one after the other; None is a figure without results."""
    solution = report.solution
    feedback = report.feedback
    sampled = None if solution.capture is None else history(solution)
    for draw in (draw_orbits, draw_relative, draw_control):
        yield None if sampled is None else draw(sampled)
    yield draw_distance(solution) if len(solution.curve.duration_s) > 1 else None
    yield None if feedback is None else draw_feedback(solution, feedback.flights)


@style()
def draw_orbits(sampled: CaptureHistory) -> Figure:
    """Draw both paths in space with arrows of thrust, and projected along the planet's axis."""
    size_m = float(np.abs(sampled.pursuer.position_m).max())
    unit, per_m = length_unit(size_m)
    figure = new_figure(100.0)
    panels = figure.subplot_mosaic(
        "ab", width_ratios=[1.0, 1.3], per_subplot_kw={"b": {"projection": "3d"}}
    )
    flat = panels["a"]
    space: Any = panels["b"]
    # The pursuer's path stays visible where the evader's dashes cover it.
    for player, look in (
        (sampled.pursuer, {"linewidth": 2.8, **PURSUER}),
        (sampled.evader, EVADER),
    ):
        _draw_path(space, flat, player, per_m, look)
    end = sampled.evader.position_m[-1] * per_m
    for axes, point in ((space, end), (flat, end[:2])):
        axes.plot(*point[:, None], label="capture", **_STAR)
    flat.plot(
        0.0, 0.0, marker="+", color=LIMIT, markersize=7.0, linestyle="none", label="planet's centre"
    )
    flat.set_aspect("equal", adjustable="datalim")
    low, high = space.get_zlim()
    middle = 0.5 * (low + high)
    half = max(0.5 * (high - low), _MIN_HEIGHT * size_m * per_m)
    titles = [f"{title}, {unit}" for title in INERTIAL_TITLES]
    label_axes(space, titles)
    label_axes(flat, titles[:2])
    space.set_zlim(middle - half, middle + half)
    # The heights are not to scale. The direction of view, in degrees, is chosen.
    space.set_box_aspect((1.0, 1.0, 0.6), zoom=0.85)
    space.view_init(elev=28.0, azim=-62.0)
    letters([flat, space], ["seen along the planet's axis", "paths and thrust (arrows)"])
    legend_below(figure, 5)
    return figure


@style()
def draw_relative(sampled: CaptureHistory) -> Figure:
    """Draw the path of the pursuer in Hill's axes at the evader, and the distance."""
    evader = sampled.evader
    offset = sampled.pursuer.position_m - evader.position_m
    relative = np.einsum("nij,nj->ni", orbital_axes(evader.position_m, evader.velocity_m_s), offset)
    length, per_m = length_unit(float(np.abs(relative).max()))
    offset = offset * per_m
    relative = relative * per_m
    figure, (panels,) = subplots(75.0, 1, 3)
    # The first two of three panels: radial and normal against along-track.
    for axes, column in zip(panels, (0, 2), strict=False):
        axes.plot(relative[:, 1], relative[:, column], **PURSUER)
        axes.plot(relative[0, 1], relative[0, column], color=TRUTH, **_START)
        axes.plot(0.0, 0.0, label="evader", **_STAR)
        label_axes(axes, [f"{AXIS_TITLES[1]}, {length}", f"{AXIS_TITLES[column]}, {length}"])
    time, unit = _times(sampled.time_s)
    panels[2].plot(time, np.linalg.norm(offset, axis=1), **PURSUER)
    panels[2].set(xlabel=f"time, {unit}", ylabel=f"distance, {length}")
    panels[2].set_ylim(bottom=0.0)
    letters(panels, ["in the orbital plane", "out of the orbital plane", "distance"])
    legend_below(figure, 3)
    return figure


@style()
def draw_control(sampled: CaptureHistory) -> Figure:
    """Draw the thrust directions in the orbital frames, and the switching functions."""
    time, unit = _times(sampled.time_s)
    figure, (panels,) = subplots(75.0, 1, 3)
    for player, look in ((sampled.pursuer, PURSUER), (sampled.evader, EVADER)):
        if player.thrust_direction.any():
            in_plane, out_of_plane = np.degrees(thrust_angles(player)).T
            for axes, values in zip(
                panels, (in_plane, out_of_plane, player.switching), strict=True
            ):
                axes.plot(time, values, **look)
    # Steps that divide a right angle.
    panels[0].yaxis.set_major_locator(MaxNLocator(nbins=6, steps=[1.0, 1.5, 3.0, 4.5, 9.0, 10.0]))
    panels[2].set_ylim(bottom=0.0)
    labels = (
        "from along-track to radial, deg",
        "out of plane, deg",
        "switching function / first value",
    )
    for axes, label in zip(panels, labels, strict=True):
        axes.set(xlabel=f"time, {unit}", ylabel=label)
    letters(panels, ["thrust in the plane", "thrust out of plane", "full thrust if positive"])
    legend_below(figure, 2)
    return figure


@style()
def draw_distance(solution: CaptureSolution) -> Figure:
    """Draw the distance that the evader can keep against the duration, and the curvature.

    A positive curvature certifies the distance.

    Parameters
    ----------
    solution : CaptureSolution
        The solution of a game, with or without a capture.
    """
    curve = solution.curve
    time, unit = _times(curve.duration_s)
    radius = solution.game.capture_radius_m / M_PER_KM
    figure, (panels,) = subplots(75.0, 1, 2)
    for axes, values in zip(
        panels, (curve.distance_m / M_PER_KM, curve.min_curvature), strict=True
    ):
        axes.plot(time, values, marker="o", markersize=2.2, color=TRUTH)
        axes.set_xlabel(f"duration $T$, {unit}")
    panels[0].axhline(radius, label="capture radius", **BOUND)
    if solution.verdict is CertificateVerdict.CAPTURED:
        panels[0].plot(time[-1], radius, zorder=5, clip_on=False, label="capture", **_STAR)
    panels[0].set_ylabel("distance $l(T)$ at the end, km")
    panels[1].set_ylabel("min. curvature of $h_P - h_E + l$")
    for axes in panels:
        axes.set_ylim(bottom=0.0)
    letters(panels, [solution.verdict.value, "saddle point if positive"])
    legend_below(figure, 2)
    return figure


@style()
def draw_feedback(solution: CaptureSolution, flights: Sequence[PursuitFlight]) -> Figure:
    """Draw the predicted capture times and the distance of a simulation.

    For several simulations, draw their capture times.
    """
    figure, (panels,) = subplots(75.0, 1, 2)
    left, right = panels
    look: dict[str, Any] = (
        {"linewidth": 0.6, "alpha": 0.5} if len(flights) > 1 else {"marker": "o", "markersize": 2.0}
    )
    unit, per_s = time_unit(float(np.ptp(flights[0].planned_s)))
    # More than a hundred lines would cover each other.
    for flight in flights[:100]:
        left.plot(flight.planned_s * per_s, flight.predicted_s * per_s, color=TRUTH, **look)
    if solution.capture is not None:
        left.axhline(
            solution.capture.time_s * per_s, label="capture if both players are optimal", **BOUND
        )
    left.set(xlabel=f"time of the plan, {unit}", ylabel=f"predicted capture, {unit}")
    if len(flights) == 1:
        (flight,) = flights
        time = np.append(flight.planned_s, flight.time_s) * per_s
        right.plot(time, np.append(flight.distances_m, flight.distance_m) / M_PER_KM, color=TRUTH)
        right.set(xlabel=f"time, {unit}", ylabel="distance, km")
        right.set_ylim(bottom=0.0)
        title = f"{flight.ended.value} at {flight.time_s:.1f} s"
    else:
        times = (
            np.sort([flight.time_s for flight in flights if flight.ended is Ended.CAPTURED]) * per_s
        )
        if len(times):
            right.step(
                times, np.arange(1, len(times) + 1) / len(flights), where="post", color=TRUTH
            )
        right.set(
            xlabel=f"capture time, {unit}", ylabel="share of simulations captured", ylim=(0.0, 1.02)
        )  # a share of 1 is below the frame
        title = f"{len(times)} of {len(flights)} captured"
    letters(panels, ["predictions", title])
    legend_below(figure, 1)
    return figure


def _draw_path(
    space: Any, flat: Axes, player: PlayerHistory, per_m: float, look: dict[str, Any]
) -> None:
    """Draw a path with its start and its thrust in both views."""
    r = player.position_m * per_m
    colour = look["color"]
    for axes, points in ((space, r), (flat, r[:, :2])):
        axes.plot(*points.T, **look)
        axes.plot(*points[0][:, None], color=colour, **_START)
    if not player.thrust_direction.any():
        return
    shown = np.linspace(0, len(r) - 1, _ARROWS).astype(int)
    r, u = r[shown], _ARROW_LENGTH * float(np.abs(r[:, :2]).max()) * player.thrust_direction[shown]
    space.quiver(*r.T, *u.T, color=colour, linewidth=0.9, arrow_length_ratio=0.25)
    arrow: dict[str, Any] = {
        "angles": "xy",
        "scale_units": "xy",
        "scale": 1.0,
        "width": 0.005,
        "headwidth": 4.0,
    }
    flat.quiver(*r[:, :2].T, *u[:, :2].T, color=colour, **arrow)
    flat.update_datalim(r[:, :2] + u[:, :2])


def _times(seconds: Floats) -> tuple[Floats, str]:
    unit, per_s = time_unit(float(np.ptp(seconds)) if len(seconds) else 0.0)
    return seconds * per_s, unit
