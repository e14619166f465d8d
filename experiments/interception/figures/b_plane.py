"""Misses across the approach: the B-plane, perpendicular to the nominal closing velocity.

Sizes and margins without a reason were chosen by eye (`figure_style`).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import Normal

from infoset.arrays import Floats
from infoset.experiments.common.figure_style import (
    GAME,
    HALO,
    SET_EDGE,
    TRUTH,
    first_panels,
    legend_below,
    letters,
    plain,
    style,
    subplots,
)
from infoset.experiments.common.screen import number, some_runs
from infoset.experiments.common.units import length_unit
from infoset.experiments.interception.figures.distributions import axis_limit
from infoset.experiments.interception.figures.shared import (
    MAX_VECTORS,
    aim_in_plane,
    draw_body,
    ring,
)
from infoset.experiments.interception.study import max_guarantee_m
from infoset.sim import Body, Results
from infoset.sim.statistics import shows

_MAX_COLUMNS = 3
"""Maximum number of panels in a row of the sheet; chosen: three fit the width of a page."""
_FLAT = 1e-12
"""Ratio of the variances up to which points are on a line: a ratio of widths of 1e-6, which can be
rounding errors of the positions."""
_OWN_LIMITS_FROM = 3.0
"""Ratio of the maximum to the minimum median above which each panel has its own limits; chosen."""
RADIUS_SHOWN = 2.0
"""The axes extend to the longer semi-axis of the body, and to the guaranteed miss, if it is at most
this multiple of the maximum miss shown; chosen: the points then still fill half of the panel.
"""
_PANEL_MM = (56.0, 68.0)
_BESIDE_MM = (22.0, 40.0)
"""Width and height of the room of a panel, and of the legend and the labels, mm; chosen."""
_MARKER_PT = 45.0
_MARKER_LIMITS_PT = (1.6, 3.5)
_OPACITY = 30.0
_OPACITY_LIMITS = (0.35, 0.8)
"""Size and opacity of the markers of N points: both are this number times N^(-1/2), within the
limits. Chosen; with this size the total area of the markers stays the same.
"""
_AT_BODY_SCALE = "at the scale of the body"
_BODY_FROM = 4.0
"""Ratio of the axes to the radius of the body above which a second panel shows the body; chosen."""
_BODY_SCALE = 2.0
"""Length of half the axes of this panel, in radii of the body; chosen."""

_CIRCLES: tuple[tuple[float, str, Any], ...] = (
    (0.5, "circle: median of the miss", "-"),
    (0.9, "circle: 90 % of the misses", (0, (4, 1.5))),
)
"""Share of the runs, name and line of circles: the quantiles of the miss that tables print."""
_ELLIPSES: tuple[tuple[float, str, Any], ...] = (
    (0.5, "ellipse: 50 % of the runs", "-"),
    (0.99, "ellipse: 99 % of the runs", (0, (4, 1.5))),
)
"""Share of the runs, name and line of the ellipses of a normal distribution; chosen."""


@dataclass(frozen=True, eq=False)
class Cloud:
    """Misses of one sample of N runs.

    Parameters
    ----------
    across_m : ndarray, shape (N, 2)
        Positions (y, z), or (B.T, B.R), at the closest approach, m.
    miss_m : ndarray, shape (N,)
        Distances of the closest approach from the aim point, m.
    guaranteed_m : float or None
        Maximum guaranteed miss of the runs, m; None if a run has no guarantee.
    t_rad : float or None
        Direction of the axis T from y toward z, rad: the axes are T, to the right, and R, downward.
        None: they are y and z.
    hits : int or None
        Number of hits; None if the body has no size.
    """

    title: str
    across_m: Floats
    miss_m: Floats
    guaranteed_m: float | None = None
    t_rad: float | None = None
    hits: int | None = None


def cloud(title: str, samples: Sequence[Results]) -> Cloud:
    """Return the misses of runs in space.

    With several results of the same runs, for each run all values are those of the result with its
    maximum miss. The guaranteed miss is the maximum of all results.
    """
    misses = np.array([results.miss_m for results in samples])
    t_rad = samples[0].b_plane_t_rad
    if t_rad is not None:
        across = np.array([results.b_plane_m for results in samples])
    else:
        across = np.array([results.lateral_miss_m for results in samples])
    worst = misses.argmax(axis=0)
    runs = np.arange(misses.shape[1])

    bounds = [bound for bound in map(max_guarantee_m, samples) if bound is not None]
    guaranteed_m = max(bounds) if len(bounds) == len(samples) else None
    hits = None
    if samples[0].hit.count():
        hit = np.array([results.hit.filled(False) for results in samples])
        hits = int(hit[worst, runs].sum())
    return Cloud(title, across[worst, runs], misses[worst, runs], guaranteed_m, t_rad, hits)


def ellipse(across_m: Floats, level: float, within_m: float = np.inf) -> Floats | None:
    """Return the outline, m, shape (2, 181), of the ellipse that contains a share of the points.

    It has the mean of the points as centre, and the axes of their covariance; its size is the
    quantile of their Mahalanobis radii. None if there are less than three points, they are on a
    line, or a part of the ellipse is farther than `within_m` from the origin, as no point is.
    """
    if len(across_m) <= 2:
        return None
    variances, axes = np.linalg.eigh(np.cov(across_m.T))
    # The variances rise: the first one is that across the ellipse.
    if variances[0] <= _FLAT * variances[1]:
        return None

    centre = across_m.mean(axis=0)
    scaled = axes * np.sqrt(variances)
    radii = np.linalg.norm(np.linalg.solve(scaled, (across_m - centre).T), axis=0)
    outline = np.asarray(centre[:, None] + scaled @ ring(float(np.quantile(radii, level))))
    if np.hypot(*outline).max() > within_m:
        return None
    return outline


@style()
def draw_b_plane(clouds: Sequence[Cloud], body: Body | None = None) -> Figure:
    """Draw the miss of each run as a point in the plane across the approach.

    Each cloud has a panel.

    Ellipses contain 50 % and 99 % of the runs. The radii of the circles are the median and the 90 %
    quantile of the miss, and the maximum guaranteed miss. All panels have the same limits, unless
    the median misses differ much. The body is drawn with its aim point; if it is small beside the
    misses, each cloud has a second panel at the scale of the body.
    """
    size_m = None if body is None else body.longest_m
    aim_m = float(np.hypot(*aim_in_plane(body)))
    medians = [float(np.median(each.miss_m)) for each in clouds]
    has_own_limits = max(medians) > _OWN_LIMITS_FROM * min(medians)
    halves = [_half_width([each] if has_own_limits else clouds, size_m, aim_m) for each in clouds]
    if size_m is not None and max(halves) > _BODY_FROM * size_m:
        halves += [_BODY_SCALE * size_m] * len(clouds)

    # A single cloud has its two panels in one row.
    columns = len(halves)
    if len(clouds) > 1:
        columns = min(_MAX_COLUMNS, len(clouds))
    rows = -(-len(halves) // columns)
    width_mm = _BESIDE_MM[0] + _PANEL_MM[0] * columns
    height_mm = _BESIDE_MM[1] + _PANEL_MM[1] * rows
    figure, grid = subplots(height_mm, rows, columns, width_mm=width_mm)
    panels = first_panels(grid, len(halves))
    titles = []

    for place, (axes, each, half) in enumerate(
        zip(panels, itertools.cycle(clouds), halves, strict=False)
    ):
        lines = _draw_cloud(axes, each, half, body)
        if place >= len(clouds):
            # The last line of `_draw_cloud` is the hits: the body has a size here.
            lines = [_AT_BODY_SCALE, lines[-1]]
        titles.append("\n".join([plain(each.title), *lines]))

    letters(panels, titles, fontsize="small")

    note = None
    if len(set(halves)) > 1:
        note = "The scale differs from panel to panel."
    legend_below(figure, min(2, columns), title=note)
    return figure


def _half_width(clouds: Sequence[Cloud], size_m: float | None, aim_m: float) -> float:
    """Return half the length of the axes, so that all misses are visible.

    A few that are far beyond the others need not be (`axis_limit`). The longer semi-axis of the
    body and Φ are visible, too, if they are not much greater. Misses and Φ are around the aim
    point, which is at the distance `aim_m` from the middle of the axes.
    """
    maximum = aim_m + (axis_limit([each.miss_m for each in clouds]) or 1.0)
    bounds_m = [aim_m + each.guaranteed_m for each in clouds if each.guaranteed_m is not None]
    half = maximum
    for size in (size_m, *bounds_m):
        if size is not None and size <= RADIUS_SHOWN * maximum:
            half = max(half, size)
    return 1.08 * half  # a margin, so that the farthest point is not on the frame; chosen


def _draw_cloud(axes: Axes, each: Cloud, half: float, body: Body | None) -> list[str]:
    """Draw the points and lines of a panel, and return the lines of its title.

    The first one has the quantiles that the sample shows, and may be empty.
    """
    count = len(each.miss_m)
    known = _draw_points(axes, each, aim_in_plane(body, each.t_rad))
    draw_body(axes, half, each.guaranteed_m, body, each.t_rad)
    if each.t_rad is not None:
        # The unit of the ticks of `draw_body`; R is downward.
        unit, _ = length_unit(half)
        axes.set(xlabel=rf"$B\cdot T$, {unit}", ylabel=rf"$B\cdot R$, {unit}", ylim=(half, -half))
    outside = int((np.abs(each.across_m) > half).any(axis=1).sum())

    if outside:
        place: dict[str, Any] = {
            "xycoords": "axes fraction",
            "ha": "right",
            "va": "bottom",
            "fontsize": "small",
            "path_effects": HALO,
            "zorder": 5.0,
        }
        axes.annotate(f"beyond the axes: {outside} of {count}", (0.97, 0.03), **place)

    lines = [", ".join(known)]
    if each.guaranteed_m is not None:
        lines.append(f"maximum Φ {number(each.guaranteed_m)} m")
    if each.hits is not None:
        lines.append(f"hits: {each.hits} of {some_runs(count)}")
    return lines


def _draw_points(axes: Axes, each: Cloud, aim_m: Floats) -> list[str]:
    """Draw the misses with circles and ellipses, and return the quantiles that the sample shows.

    Circles are around the aim point, m, shape (2,). Each quantile is one text. The more points, the
    smaller and paler they are (`_MARKER_PT`).
    """
    count = len(each.miss_m)
    point: dict[str, Any] = {
        "color": SET_EDGE,
        "marker": "o",
        "linestyle": "none",
        "markeredgewidth": 0.0,
        "markersize": float(np.clip(_MARKER_PT / np.sqrt(count), *_MARKER_LIMITS_PT)),
        "alpha": float(np.clip(_OPACITY / np.sqrt(count), *_OPACITY_LIMITS)),
        "rasterized": count > MAX_VECTORS,
        "zorder": 3.2,  # the white edge of a circle would hide the points on it
    }
    axes.plot(*each.across_m.T, label="miss of one run", **point)

    known = []
    line: dict[str, Any] = {"path_effects": [*HALO, Normal()], "zorder": 3.0}
    for level, name, dashes in _CIRCLES:
        if shows(count, level):
            quantile = float(np.quantile(each.miss_m, level))
            circle = aim_m[:, None] + ring(quantile)
            axes.plot(*circle, label=name, color=GAME, linestyle=dashes, linewidth=0.9, **line)
            level_text = "median" if level == 0.5 else f"{100 * level:g} %"
            known.append(f"{level_text} {number(quantile)} m")

    within_m = np.inf
    if each.guaranteed_m is not None:
        within_m = each.guaranteed_m
    for level, name, dashes in _ELLIPSES:
        if not shows(count, level):
            continue
        # The guaranteed miss is a distance from the aim point.
        outline = ellipse(each.across_m - aim_m, level, within_m)
        if outline is not None:
            outline_m = outline + aim_m[:, None]
            axes.plot(*outline_m, label=name, color=TRUTH, linestyle=dashes, **line)
    return known
