"""Misses across the approach: the B-plane, perpendicular to the nominal closing velocity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from string import ascii_lowercase
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle
from matplotlib.patheffects import Normal, Stroke
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from experiments.common.figure_style import INK, SET_EDGE, WIDTH_MM, new_figure, place_axes, plain, style
from experiments.common.screen import number
from experiments.interception.figures.distributions import RADIUS_LOOK, axis_limit
from guidance import NoiseKind
from sim import Results
from sim.statistics import shows

Floats = NDArray[np.float64]

B_PLANE = {noise: f"figure-b-plane-{noise.value}" for noise in NoiseKind}
"""Name of the figure of each noise."""

_MOST_COLUMNS = 3
_WIDEST_MM = 62.0
"""Greatest side of a panel, mm."""
_LEFT_MM, _RIGHT_MM = 17.0, 5.0
_OWN_LIMITS_FROM = 3.0
"""Ratio of the greatest and the least median above which each panel has its own limits."""
_RADIUS_SHOWN = 3.0
"""The axes extend to the radius of the body if it is at most this multiple of the greatest miss shown."""
_VECTOR_POINTS = 2000
"""Number of points of a panel above which they are pixels in the PDF file."""

_POINTS_IN_FRONT = 300
"""Number of points of a panel up to which they are in front of the circles."""

_POINT: dict[str, Any] = {"color": SET_EDGE, "marker": "o", "linestyle": "none", "markeredgewidth": 0.0}
_CIRCLES: tuple[tuple[float, str, Any], ...] = (
    (0.5, "median of the miss", "-"),
    (0.9, "90 % of the misses", (0, (4, 1.5))),
)
_CIRCLE_COLOUR = "#7f2704"


@dataclass(frozen=True, eq=False)
class Cloud:
    """Misses of one sample.

    Parameters
    ----------
    across_m : ndarray, shape (N, 2)
        Positions (y, z) at the closest approach, m.
    miss_m : ndarray, shape (N,)
        Distances at the closest approach, m.
    """

    title: str
    across_m: Floats
    miss_m: Floats


def cloud(title: str, samples: Sequence[Results]) -> Cloud:
    """Return the misses of runs in space; with several results of the same runs, the worst result of each run."""
    misses = np.array([results.miss_m for results in samples])
    across = np.array([results.lateral_miss.data for results in samples])
    worst, runs = misses.argmax(axis=0), np.arange(misses.shape[1])
    return Cloud(title, across[worst, runs], misses[worst, runs])


@style()
def draw_b_plane(clouds: Sequence[Cloud], radius_m: float | None = None) -> Figure:
    """Draw the miss of each run as a point in the plane across the approach, with circles of two quantiles.

    All panels have the same limits, unless the median misses differ much.

    Parameters
    ----------
    clouds : sequence of Cloud
        One panel each, at least one.
    radius_m : float or None
        Radius of the body, m, drawn as a circle; None draws none.
    """
    if not clouds:
        raise ValueError("at least one cloud is needed")
    medians = [float(np.median(each.miss_m)) for each in clouds]
    alone = max(medians) > _OWN_LIMITS_FROM * min(medians)
    columns = min(_MOST_COLUMNS, len(clouds))
    rows = -(-len(clouds) // columns)
    gap = 11.0 if alone else 6.0
    side = min(_WIDEST_MM, (WIDTH_MM - _LEFT_MM - _RIGHT_MM - gap * (columns - 1)) / columns)
    lines = 2 + max(each.title.count("\n") for each in clouds)
    top, between = 3.0 + 4.0 * lines, 11.5 + 4.0 * lines
    halves = [_half_width([each] if alone else clouds, radius_m) for each in clouds]
    handles = _handles({len(each.miss_m) for each in clouds}, radius_m, max(halves))
    legend_columns = min(2, columns)
    bottom = 16.0 + 4.5 * -(-len(handles) // legend_columns)
    figure = new_figure(
        height_mm=bottom + top + rows * side + (rows - 1) * between,
        width_mm=_LEFT_MM + _RIGHT_MM + columns * side + (columns - 1) * gap,
    )
    margins = (_LEFT_MM, _RIGHT_MM, bottom, top)
    grid = place_axes(figure, rows, columns, margins_mm=margins, gaps_mm=(gap, between))
    places = [axes for row in grid for axes in row]
    for unused in places[len(clouds) :]:
        unused.remove()
    for index, (axes, each, half) in enumerate(zip(places, clouds, halves, strict=False)):
        quantiles = _draw_cloud(axes, each, half, radius_m)
        letter = f"({ascii_lowercase[index]}) " if 1 < len(clouds) <= len(ascii_lowercase) else ""
        axes.set_title(f"{letter}{plain(each.title)}\n{quantiles}", linespacing=1.3, pad=4.0)
        axes.set_xlabel("miss along y, m", labelpad=2.0)
        axes.set_ylabel("miss along z, m" if index % columns == 0 else "", labelpad=2.0)
        axes.tick_params(labelleft=alone or index % columns == 0)
    note = "The scale differs from panel to panel." if alone else None
    look: dict[str, Any] = {"loc": "lower center", "columnspacing": 2.0, "title_fontsize": 7.5}
    figure.legend(handles=handles, ncols=legend_columns, title=note, **look)
    return figure


def _half_width(clouds: Sequence[Cloud], radius_m: float | None) -> float:
    """Return half the length of the axes: the misses and, if it is not much greater, the radius of the body."""
    greatest = axis_limit([each.miss_m for each in clouds]) or 1.0
    return 1.08 * max(greatest, radius_m if radius_m is not None and radius_m <= _RADIUS_SHOWN * greatest else 0.0)


def _draw_cloud(axes: Axes, each: Cloud, half: float, radius_m: float | None) -> str:
    """Draw the points and circles of a panel, and return the quantiles of the miss."""
    count = len(each.miss_m)
    axes.plot(
        *each.across_m.T,
        **_POINT,
        markersize=float(np.clip(45.0 / np.sqrt(count), 1.6, 3.5)),
        alpha=float(np.clip(30.0 / np.sqrt(count), 0.35, 0.8)),
        rasterized=count > _VECTOR_POINTS,
        zorder=2.0 if count > _POINTS_IN_FRONT else 3.1,  # the white edge of a circle hides the points on it
        label="_misses",
    )
    quantiles = []
    halo = [Stroke(linewidth=2.2, foreground="white"), Normal()]
    for level, _, dashes in _CIRCLES:
        if not shows(count, level):
            continue
        quantile = float(np.quantile(each.miss_m, level))
        look: dict[str, Any] = {"edgecolor": _CIRCLE_COLOUR, "linestyle": dashes, "linewidth": 1.2, "fill": False}
        axes.add_patch(Circle((0.0, 0.0), quantile, zorder=3.0, path_effects=halo, label=f"_{level:g}", **look))
        quantiles.append(f"{'median' if level == 0.5 else f'{100 * level:g} %'}: {number(quantile)} m")
    if radius_m is not None and radius_m <= half:
        look = {"edgecolor": RADIUS_LOOK["color"], **{key: RADIUS_LOOK[key] for key in ("linestyle", "linewidth")}}
        axes.add_patch(Circle((0.0, 0.0), radius_m, fill=False, zorder=3.2, label="_radius", **look))
    axes.plot(0.0, 0.0, marker="+", color=INK, markersize=7.0, markeredgewidth=1.1, linestyle="none", zorder=4.0)
    beyond = int((np.abs(each.across_m) > half).any(axis=1).sum())
    if beyond:
        axes.annotate(
            f"beyond the axes: {beyond} of {count}",
            (0.97, 0.03),
            xycoords="axes fraction",
            ha="right",
            va="bottom",
            fontsize=7.0,
            path_effects=halo,
            zorder=5.0,
        )
    axes.set(xlim=(-half, half), ylim=(-half, half), aspect="equal")
    for one in (axes.xaxis, axes.yaxis):
        one.set_major_locator(MaxNLocator(nbins=5, steps=[1, 2, 5, 10]))
    return ", ".join(quantiles)


def _handles(runs: set[int], radius_m: float | None, half: float) -> list[Line2D]:
    runs_per_panel = f", {max(runs)} runs per panel" if len(runs) == 1 else ""
    handles = [
        Line2D([], [], markersize=4.0, label=f"miss of one run{runs_per_panel}", **_POINT),
        Line2D([], [], color=INK, marker="+", linestyle="none", markersize=7.0, label="centre of the body"),
    ]
    handles += [
        Line2D([], [], color=_CIRCLE_COLOUR, linestyle=dashes, label=f"circle: {name}")
        for level, name, dashes in _CIRCLES
        if shows(max(runs), level)
    ]
    if radius_m is not None:
        where = "a smaller miss is a hit" if radius_m <= half else "beyond the axes"
        handles.append(Line2D([], [], label=f"body radius, {radius_m:g} m: {where}", **RADIUS_LOOK))
    return handles
