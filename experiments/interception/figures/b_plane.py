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
from matplotlib.patches import Circle, Ellipse, Patch
from matplotlib.patheffects import Normal, Stroke
from matplotlib.ticker import MaxNLocator

from experiments.common.figure_style import INK, SET_EDGE, TRUTH, WIDTH_MM, figure_grid, plain, style
from experiments.common.screen import number, some_runs
from experiments.interception.figures.distributions import RADIUS_LOOK, axis_limit
from infoset.arrays import Floats
from sim import Results
from sim.statistics import shows

_MAX_COLUMNS = 3
_WIDEST_MM = 62.0
"""Maximum side of a panel, mm."""
_LEFT_MM, _RIGHT_MM = 17.0, 5.0
_OWN_LIMITS_FROM = 3.0
"""Ratio of the maximum and the minimum median above which each panel has its own limits."""
RADIUS_SHOWN = 5.0
"""The axes extend to the radius of the body if it is at most this multiple of the maximum miss shown."""
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
_ELLIPSES: tuple[tuple[float, Any], ...] = ((0.5, "-"), (0.99, (0, (4, 1.5))))
"""Level and line of the ellipses that contain a share of the runs."""
BODY_FILL = "#f0e6d8"
"""Colour of the disc of the body."""
GUARANTEE_LOOK: dict[str, Any] = {"color": "#2f6b3a", "linestyle": (0, (7, 1.5)), "linewidth": 1.4}
"""Line of the guaranteed miss."""


@dataclass(frozen=True, eq=False)
class Cloud:
    """Misses of one sample of N runs.

    Parameters
    ----------
    across_m : ndarray, shape (N, 2)
        Positions (y, z) at the closest approach, m.
    miss_m : ndarray, shape (N,)
        Distances at the closest approach, m.
    guaranteed_m : float or None
        Maximum guaranteed miss of the runs, m; None if a run has no guarantee.
    """

    title: str
    across_m: Floats
    miss_m: Floats
    guaranteed_m: float | None = None


def cloud(title: str, samples: Sequence[Results]) -> Cloud:
    """Return the misses of runs in space; with several results of the same runs, the worst result of each run."""
    misses = np.array([results.miss_m for results in samples])
    across = np.array([results.lateral_miss.data for results in samples])
    worst, runs = misses.argmax(axis=0), np.arange(misses.shape[1])
    bounds = [
        float(bound) for results in samples if results.guarantees for bound in results.guaranteed_miss_m.filled(np.inf)
    ]
    return Cloud(title, across[worst, runs], misses[worst, runs], max_guarantee(bounds))


def max_guarantee(bounds_m: Sequence[float]) -> float | None:
    """Return the maximum of the guaranteed misses of runs; infinity stands for a run without a guarantee."""
    maximum = max(bounds_m, default=np.inf)
    return maximum if np.isfinite(maximum) else None


def ellipse(across_m: Floats, level: float) -> tuple[Floats, Floats, float] | None:
    """Return the ellipse that contains a share of the points; None if the points are on a line.

    It has the centre (y, z), m, and the axes of the covariance of the points; its size is the quantile of their
    Mahalanobis radii. The result is the centre, the semi-axes, m, and the angle of the first semi-axis from y toward z,
    rad.
    """
    centre = across_m.mean(axis=0)
    variances, axes = np.linalg.eigh(np.cov(across_m.T)) if len(across_m) > 2 else (np.zeros(2), np.eye(2))
    if variances[0] <= 1e-12 * variances[1]:
        return None
    radii = np.sqrt(np.sum(((across_m - centre) @ axes) ** 2 / variances, axis=1))
    angle_rad = float(np.arctan2(axes[1, 0], axes[0, 0]))
    return centre, float(np.quantile(radii, level)) * np.sqrt(variances), angle_rad


@style()
def draw_b_plane(clouds: Sequence[Cloud], radius_m: float | None = None) -> Figure:
    """Draw the miss of each run as a point in the plane across the approach, one panel for each cloud.

    Ellipses contain 50 % and 99 % of the runs. The radii of the circles are the median and the 90 % quantile of the
    miss, and the maximum guaranteed miss. All panels have the same limits, unless the median misses differ much. The
    radius of the body, m, is drawn as a disc.
    """
    if not clouds:
        raise ValueError("at least one cloud is needed")
    medians = [float(np.median(each.miss_m)) for each in clouds]
    alone = max(medians) > _OWN_LIMITS_FROM * min(medians)
    columns = min(_MAX_COLUMNS, len(clouds))
    rows = -(-len(clouds) // columns)
    gap = 11.0 if alone else 6.0
    side = min(_WIDEST_MM, (WIDTH_MM - _LEFT_MM - _RIGHT_MM - gap * (columns - 1)) / columns)
    guaranteed = any(each.guaranteed_m is not None for each in clouds)
    lines = 2 + guaranteed + max(each.title.count("\n") for each in clouds)
    top, between = 3.0 + 4.0 * lines, 11.5 + 4.0 * lines
    halves = [_half_width([each] if alone else clouds, radius_m) for each in clouds]
    handles = _handles(clouds, radius_m, halves)
    legend_columns = min(2, columns)
    bottom = 16.0 + 4.5 * -(-len(handles) // legend_columns)
    height_mm = bottom + top + rows * side + (rows - 1) * between
    width_mm = _LEFT_MM + _RIGHT_MM + columns * side + (columns - 1) * gap
    margins, gaps = (_LEFT_MM, _RIGHT_MM, bottom, top), (gap, between)
    figure, panels = figure_grid(height_mm, rows, columns, margins, gaps, width_mm=width_mm, count=len(clouds))
    for index, (axes, each, half) in enumerate(zip(panels, clouds, halves, strict=True)):
        quantiles = _draw_cloud(axes, each, half, radius_m)
        if guaranteed:
            bound = "no guarantee" if each.guaranteed_m is None else f"maximum Φ: {number(each.guaranteed_m)} m"
            quantiles += f"\n{bound}"
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
    """Return half the length of the axes: the misses and, if not much greater, the radius of the body and Φ."""
    maximum = axis_limit([each.miss_m for each in clouds]) or 1.0
    sizes = [size for size in (radius_m, *(each.guaranteed_m for each in clouds)) if size is not None]
    return 1.08 * max([maximum, *(size for size in sizes if size <= RADIUS_SHOWN * maximum)])


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
        look: dict[str, Any] = {"edgecolor": _CIRCLE_COLOUR, "linestyle": dashes, "linewidth": 0.9, "fill": False}
        axes.add_patch(Circle((0.0, 0.0), quantile, zorder=3.0, path_effects=halo, label=f"_{level:g}", **look))
        quantiles.append(f"{'median' if level == 0.5 else f'{100 * level:g} %'}: {number(quantile)} m")
    for level, dashes in _ELLIPSES:
        if shows(count, level) and (drawn := ellipse(each.across_m, level)) is not None:
            centre, (width, height), angle_rad = drawn
            look = {"edgecolor": TRUTH, "linestyle": dashes, "linewidth": 1.2, "fill": False, "path_effects": halo}
            look |= {"angle": np.degrees(angle_rad), "label": f"_ellipse {level:g}", "zorder": 3.0}
            axes.add_patch(Ellipse((centre[0], centre[1]), 2 * width, 2 * height, **look))
    draw_discs(axes, half, radius_m, each.guaranteed_m)
    axes.plot(0.0, 0.0, marker="+", color=INK, markersize=7.0, markeredgewidth=1.1, linestyle="none", zorder=4.0)
    beyond = int((np.abs(each.across_m) > half).any(axis=1).sum())
    if beyond:
        look = {"xycoords": "axes fraction", "ha": "right", "va": "bottom", "path_effects": halo, "zorder": 5.0}
        axes.annotate(f"beyond the axes: {beyond} of {count}", (0.97, 0.03), fontsize=7.0, **look)
    axes.set(xlim=(-half, half), ylim=(-half, half), aspect="equal")
    for one in (axes.xaxis, axes.yaxis):
        one.set_major_locator(MaxNLocator(nbins=5, steps=[1, 2, 5, 10]))
    return ", ".join(quantiles)


def draw_discs(axes: Axes, half: float, radius_m: float | None, guaranteed_m: float | None) -> None:
    """Draw the disc of the body and the circle of the guaranteed miss, if they are known and within the axes."""
    if radius_m is not None and radius_m <= half:
        axes.add_patch(Circle((0.0, 0.0), radius_m, facecolor=BODY_FILL, edgecolor="none", zorder=0.5))
        axes.add_patch(Circle((0.0, 0.0), radius_m, fill=False, zorder=3.2, label="_radius", **RADIUS_LOOK))
    if guaranteed_m is not None and guaranteed_m <= half:
        axes.add_patch(Circle((0.0, 0.0), guaranteed_m, fill=False, zorder=3.1, label="_guarantee", **GUARANTEE_LOOK))


def _handles(clouds: Sequence[Cloud], radius_m: float | None, halves: Sequence[float]) -> list[Line2D | Patch]:
    runs = {len(each.miss_m) for each in clouds}
    runs_per_panel = f", {some_runs(max(runs))} per panel" if len(runs) == 1 else ""
    handles: list[Line2D | Patch] = [
        Line2D([], [], markersize=4.0, label=f"miss of one run{runs_per_panel}", **_POINT),
        Line2D([], [], color=INK, marker="+", linestyle="none", markersize=7.0, label="centre of the body"),
    ]
    handles += [
        Line2D([], [], color=_CIRCLE_COLOUR, linestyle=dashes, linewidth=0.9, label=f"circle: {name}")
        for level, name, dashes in _CIRCLES
        if shows(max(runs), level)
    ]
    handles += [
        Line2D([], [], color=TRUTH, linestyle=dashes, label=f"ellipse: {100 * level:g} % of the runs")
        for level, dashes in _ELLIPSES
        if shows(max(runs), level)
    ]
    within = [
        each.guaranteed_m <= half for each, half in zip(clouds, halves, strict=True) if each.guaranteed_m is not None
    ]
    if within:
        where = "" if all(within) else ", if within the axes" if any(within) else ": beyond the axes"
        label = f"circle: guaranteed miss Φ, maximum of the runs{where}"
        handles.append(Line2D([], [], label=label, **GUARANTEE_LOOK))
    if radius_m is not None:
        where = "a smaller miss is a hit" if radius_m <= max(halves) else "beyond the axes"
        look = RADIUS_LOOK | {"facecolor": BODY_FILL, "edgecolor": RADIUS_LOOK["color"]}
        del look["color"]
        handles.append(Patch(label=f"body radius, {radius_m:g} m: {where}", **look))
    return handles
