"""Parts that figures of the interception share: lines of levels, and the time axis.

Sizes and margins without a reason were chosen by eye (`figure_style`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, FuncFormatter, MaxNLocator, NullFormatter

from infoset.arrays import Floats
from infoset.experiments.common.figure_style import BODY_FILL, EVENT, GUARANTEED, HALO, INK
from infoset.experiments.common.units import SECONDS, duration_text, length_unit
from infoset.experiments.interception.course import marks, min_to_go_s
from infoset.sim import Body, Scenario
from infoset.sim.results import b_plane

RADIUS: dict[str, Any] = {"color": INK, "linestyle": (0, (6, 1.5, 1, 1.5)), "linewidth": 0.9}
"""Line of the radius of the body."""
GUARANTEE: dict[str, Any] = {"color": GUARANTEED, "linestyle": (0, (7, 1.5)), "linewidth": 1.4}
"""Line of the guaranteed miss."""
MAX_VECTORS = 2000
"""Number of points above which they are pixels in the PDF file; chosen: more are slow to show."""

_TICKS_S = (0.01, *SECONDS.values())
"""Ticks of the time before the arrival."""
_MORE_TICKS_S = (0.1, 10.0, 10.0 * SECONDS["min"], 6.0 * SECONDS["h"], 10.0 * SECONDS["d"])
"""Ticks that have a label only in a short flight: in a long one the labels would overlap."""
_LONG = 1000.0
"""Ratio of the first and the last time of the axis from which a flight is long; chosen."""
_BEFORE_START = 1.1
"""Start of the axis, by the first time: a margin, so that the first points are not on its edge.

Chosen.
"""
_MIN_DISC = 0.02
"""Share of half the axes below which a body with this longer semi-axis is not drawn.

The mark of its centre would hide it.
"""


def draw_levels(axes: Axes, guaranteed_m: float | None, body: Body | None) -> None:
    """Draw the guaranteed miss, if known and not 0, and the radius of a body as level lines."""
    if guaranteed_m:
        axes.axhline(guaranteed_m, label="guaranteed miss Φ", **GUARANTEE)
    if body is not None:
        axes.axhline(body.inscribed_m, label=radius_name(body), **RADIUS)


def radius_name(body: Body) -> str:
    """Return the name of the radius around the aim point that is certainly inside a body."""
    radius = f"{body.inscribed_m:.4g} m"
    if body.is_sphere_around_aim:
        return f"body radius, {radius}"
    return f"circle inside the body, {radius}"


def draw_end(axes: Axes, time_s: float, miss_m: float, label: str) -> None:
    """Mark the end of the possible miss, after which the set is not complete, or is empty.

    See `complete_steps`.
    """
    axes.plot(
        time_s,
        miss_m,
        marker="D",
        markersize=4.0,
        color=INK,
        linestyle="none",
        zorder=4.0,
        label=label,
    )


def draw_body(
    axes: Axes,
    half_m: float,
    guaranteed_m: float | None,
    body: Body | None,
    t_rad: float | None = None,
) -> None:
    """Draw the B-plane around the centre of the body: its outline, guaranteed miss and labels.

    The axes extend by `half_m` in each direction. They are y and z, or with `t_rad` B.T and B.R,
    which the caller names. A guaranteed miss beyond the axes is not drawn.
    """
    aim_m = aim_in_plane(body, t_rad)
    if body is not None and body.longest_m >= _MIN_DISC * half_m:
        _draw_outline(axes, half_m, body, t_rad)
    if guaranteed_m is not None and guaranteed_m <= half_m:
        circle = aim_m[:, None] + ring(guaranteed_m)
        axes.plot(*circle, label="guaranteed miss Φ", zorder=3.1, **GUARANTEE)
    centre: dict[str, Any] = {
        "color": INK,
        "marker": "+",
        "markersize": 7.0,
        "linestyle": "none",
        "zorder": 4.0,
    }
    axes.plot(0.0, 0.0, markeredgewidth=1.1, label="centre of the body", **centre)
    if aim_m.any():
        circle = {"marker": "o", "markersize": 5.0, "markerfacecolor": "none"}
        axes.plot(*aim_m, markeredgewidth=1.1, label="aim point", **{**centre, **circle})

    unit, per_m = length_unit(half_m)
    axes.set(xlim=(-half_m, half_m), ylim=(-half_m, half_m), aspect="equal")
    axes.set(xlabel=f"miss along y, {unit}", ylabel=f"miss along z, {unit}")
    for one in (axes.xaxis, axes.yaxis):
        one.set_major_locator(MaxNLocator(nbins=5, steps=[1, 2, 5, 10]))
        one.set_major_formatter(lambda tick, _: f"{tick * per_m:g}".replace("-", "\N{MINUS SIGN}"))


def _draw_outline(axes: Axes, half_m: float, body: Body, t_rad: float | None) -> None:
    """Draw the silhouette of a body; for an unknown direction, the discs inside and around it."""
    longer_m, shorter_m = body.axes_m
    label = f"body radius, {longer_m:g} m"
    if longer_m != shorter_m:
        label = f"body, {longer_m:g} m x {shorter_m:g} m"
    if body.is_turned_by_chance:
        axes.plot(
            *ring(longer_m), zorder=0.7, label=f"body, longer semi-axis, {longer_m:g} m", **RADIUS
        )
        label = f"body, shorter semi-axis, {shorter_m:g} m"
    if shorter_m > half_m:
        label += ": beyond the axes"

    outline = ring(shorter_m)
    if body.axis_angle_rad is not None:
        # B.T and B.R are opposite to y and z, which does not matter: an ellipse is symmetric.
        angle_rad = body.axis_angle_rad - (t_rad or 0.0)
        along, across = ring(1.0)
        outline = np.stack(
            [
                longer_m * along * np.cos(angle_rad) - shorter_m * across * np.sin(angle_rad),
                longer_m * along * np.sin(angle_rad) + shorter_m * across * np.cos(angle_rad),
            ]
        )
    fill = axes.fill(*outline, facecolor=BODY_FILL, zorder=0.6, label=label)
    fill[0].set(edgecolor=INK, linestyle=RADIUS["linestyle"])


def aim_in_plane(body: Body | None, t_rad: float | None = None) -> Floats:
    """Return where closest approaches without a miss are in the B-plane, m, shape (2,).

    In the axes y and z of the body's position it is opposite to the aim point, in those of B.T and
    B.R it is the aim point. It is the origin without an aim point.
    """
    if body is None or body.aim_m is None:
        return np.zeros(2)
    closest_m = -np.array(body.aim_m)
    if t_rad is None:
        return closest_m
    return np.asarray(b_plane(closest_m[None], t_rad)[0])


def ring(radius: float) -> Any:
    """Return points of a circle around the origin, shape (2, 181): one in 2 degrees, and closed."""
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    return radius * np.array([np.cos(turn), np.sin(turn)])


def draw_impulses(axes: Axes, times: Any, sizes: Any, **look: Any) -> None:
    """Draw the impulses that are not zero as bars."""
    given = sizes != 0.0  # also negative ones: `sizes` may be components
    axes.vlines(times[given], 0.0, sizes[given], rasterized=bool(given.sum() > MAX_VECTORS), **look)


def count_down(column: Sequence[Axes], scenario: Scenario) -> None:
    """Make the time axes of a column logarithmic in the time to go, decreasing to the right.

    It is the time before the nominal arrival. The times of the schedule (`marks`) are drawn as
    vertical lines. In a long flight `_MORE_TICKS_S` are minor ticks without labels.
    """
    begin_s = scenario.nominal_arrival_s
    end_s = min_to_go_s(scenario)
    ticks = [tick for tick in _TICKS_S if end_s <= tick <= begin_s]
    more = [tick for tick in _MORE_TICKS_S if end_s <= tick <= begin_s]
    if begin_s < _LONG * end_s:
        ticks = [*ticks, *more]
        more = []

    for axes in column:
        axes.set_xscale("log")
        axes.set_xlim(_BEFORE_START * begin_s, end_s)
        axes.xaxis.set_major_locator(FixedLocator(ticks))
        axes.xaxis.set_minor_locator(FixedLocator(more))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda tick, _: duration_text(tick)))
        axes.xaxis.set_minor_formatter(NullFormatter())
        for time_s in marks(scenario).values():
            axes.axvline(time_s, zorder=1.5, label="times of the schedule", **EVENT)

    column[-1].set_xlabel("time to go")


def name_events(axes: Axes, scenario: Scenario) -> None:
    """Write the names of the times of the schedule along their lines, below the upper frame.

    The names are in turn to the right and to the left of their lines, counted from the last line,
    so that those of the last two lines, often near each other, are apart. Those of the second and
    the third line from the end stand between these lines, and overlap if they are near.
    """
    look: dict[str, Any] = {
        "xycoords": axes.get_xaxis_transform(),
        "textcoords": "offset points",
        "rotation": 90.0,
        "va": "top",
        "fontsize": "small",
        "path_effects": HALO,
        "zorder": 5.0,
    }
    # From left to right, in which direction the time before the arrival decreases.
    by_time = sorted(marks(scenario).items(), key=lambda item: -item[1])
    for place, (name, time_s) in enumerate(by_time):
        lines_after = len(by_time) - 1 - place
        # "left" is the end of the text that is at the line: the text is to the right of it.
        side, offset = (("left", 2.0), ("right", -2.0))[lines_after % 2]
        text = f"{name}, {duration_text(time_s)}"
        axes.annotate(text, (time_s, 0.97), xytext=(offset, 0.0), ha=side, **look)
