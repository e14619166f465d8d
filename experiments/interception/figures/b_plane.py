"""Misses across the approach: the B-plane, perpendicular to the nominal closing velocity."""

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
from infoset.experiments.interception.figures.distributions import axis_limit
from infoset.experiments.interception.figures.shared import MAX_VECTORS, draw_body, ring
from infoset.experiments.interception.study import max_guarantee_m
from infoset.sim import Results
from infoset.sim.statistics import shows

_MAX_COLUMNS = 3
_OWN_LIMITS_FROM = 3.0
"""Ratio of the maximum and the minimum median above which each panel has its own limits."""
RADIUS_SHOWN = 2.0
"""The axes extend to the radius of the body if it is at most this multiple of the maximum miss
shown.
"""
_AT_BODY_SCALE = "at the scale of the body"
_BODY_FROM, _BODY_SCALE = 4.0, 2.0
"""Ratio of the axes and the radius of the body from which a second panel extends to some radii of
the body.
"""

_CIRCLES: tuple[tuple[float, str, Any], ...] = (
    (0.5, "circle: median of the miss", "-"),
    (0.9, "circle: 90 % of the misses", (0, (4, 1.5))),
)
_ELLIPSES: tuple[tuple[float, str, Any], ...] = (
    (0.5, "ellipse: 50 % of the runs", "-"),
    (0.99, "ellipse: 99 % of the runs", (0, (4, 1.5))),
)


@dataclass(frozen=True, eq=False)
class Cloud:
    """Misses of one sample of N runs.

    Parameters
    ----------
    across_m : ndarray, shape (N, 2)
        Positions (y, z), or (B.T, B.R), at the closest approach, m.
    miss_m : ndarray, shape (N,)
        Distances at the closest approach, m.
    guaranteed_m : float or None
        Maximum guaranteed miss of the runs, m; None if a run has no guarantee.
    has_axes : bool
        Whether the axes are T, to the right, and R, downward; otherwise they are y and z.
    """

    title: str
    across_m: Floats
    miss_m: Floats
    guaranteed_m: float | None = None
    has_axes: bool = False


def cloud(title: str, samples: Sequence[Results]) -> Cloud:
    """Return the misses of runs in space; with several results of the same runs, the worst result
    of each run.
    """
    misses = np.array([results.miss_m for results in samples])
    has_axes = samples[0].b_plane_t_rad is not None
    across = np.array(
        [results.b_plane_m if has_axes else results.lateral_miss_m for results in samples]
    )
    worst = misses.argmax(axis=0)
    runs = np.arange(misses.shape[1])
    bounds = [bound for bound in map(max_guarantee_m, samples) if bound is not None]
    most_m = max(bounds) if len(bounds) == len(samples) else None
    return Cloud(title, across[worst, runs], misses[worst, runs], most_m, has_axes)


def ellipse(across_m: Floats, level: float, within_m: float = np.inf) -> Floats | None:
    """Return the outline, m, shape (2, 181), of the ellipse that contains a share of the points.

    It has the centre (y, z) and the axes of the covariance of the points; its size is the quantile
    of their Mahalanobis radii. None if the points are on a line, or a part of it is beyond a
    distance that no point has.
    """
    variances, axes = (
        np.linalg.eigh(np.cov(across_m.T)) if len(across_m) > 2 else (np.zeros(2), np.eye(2))
    )
    if variances[0] <= 1e-12 * variances[1]:
        return None
    centre = across_m.mean(axis=0)
    scaled = axes * np.sqrt(variances)
    radii = np.linalg.norm(np.linalg.solve(scaled, (across_m - centre).T), axis=0)
    outline = np.asarray(centre[:, None] + scaled @ ring(float(np.quantile(radii, level))))
    return None if np.hypot(*outline).max() > within_m else outline


@style()
def draw_b_plane(clouds: Sequence[Cloud], radius_m: float | None = None) -> Figure:
    """Draw the miss of each run as a point in the plane across the approach, one panel for each
    cloud.

    Ellipses contain 50 % and 99 % of the runs. The radii of the circles are the median and the 90 %
    quantile of the miss, and the maximum guaranteed miss. All panels have the same limits, unless
    the median misses differ much. The radius of the body, m, is drawn as a disc; if it is small
    beside the misses, each cloud has a second panel at the scale of the body.
    """
    medians = [float(np.median(each.miss_m)) for each in clouds]
    alone = max(medians) > _OWN_LIMITS_FROM * min(medians)
    halves = [_half_width([each] if alone else clouds, radius_m) for each in clouds]
    if radius_m is not None and max(halves) > _BODY_FROM * radius_m:
        halves += [_BODY_SCALE * radius_m] * len(clouds)
    columns = min(_MAX_COLUMNS, len(clouds)) if len(clouds) > 1 else len(halves)
    rows = -(-len(halves) // columns)
    figure, grid = subplots(40.0 + 68.0 * rows, rows, columns, width_mm=56.0 * columns + 22.0)
    panels = first_panels(grid, len(halves))
    titles = []
    for place, (axes, each, half) in enumerate(
        zip(panels, itertools.cycle(clouds), halves, strict=False)
    ):
        lines = _draw_cloud(axes, each, half, radius_m)
        titles.append(
            "\n".join(
                [
                    plain(each.title),
                    *(lines if place < len(clouds) else [_AT_BODY_SCALE, lines[-1]]),
                ]
            )
        )
    letters(panels, titles, fontsize="small")
    note = "The scale differs from panel to panel." if len(set(halves)) > 1 else None
    legend_below(figure, min(2, columns), title=note)
    return figure


def _half_width(clouds: Sequence[Cloud], radius_m: float | None) -> float:
    """Return half the length of the axes: the misses and, if not much greater, the radius of the
    body and Φ.
    """
    maximum = axis_limit([each.miss_m for each in clouds]) or 1.0
    sizes = [
        size for size in (radius_m, *(each.guaranteed_m for each in clouds)) if size is not None
    ]
    return 1.08 * max([maximum, *(size for size in sizes if size <= RADIUS_SHOWN * maximum)])


def _draw_cloud(axes: Axes, each: Cloud, half: float, radius_m: float | None) -> list[str]:
    """Draw the points and lines of a panel, and return lines about the miss: quantiles, the bound,
    and hits.
    """
    count = len(each.miss_m)
    known = []
    size = float(np.clip(45.0 / np.sqrt(count), 1.6, 3.5))
    alpha = float(np.clip(30.0 / np.sqrt(count), 0.35, 0.8))
    point: dict[str, Any] = {
        "color": SET_EDGE,
        "marker": "o",
        "linestyle": "none",
        "markeredgewidth": 0.0,
    }
    point |= {"markersize": size, "alpha": alpha, "rasterized": count > MAX_VECTORS}
    point["zorder"] = 3.2  # the white edge of a circle would hide the points on it
    axes.plot(*each.across_m.T, label="miss of one run", **point)
    line: dict[str, Any] = {"path_effects": [*HALO, Normal()], "zorder": 3.0}
    for level, name, dashes in _CIRCLES:
        if shows(count, level):
            quantile = float(np.quantile(each.miss_m, level))
            axes.plot(
                *ring(quantile), label=name, color=GAME, linestyle=dashes, linewidth=0.9, **line
            )
            known.append(
                f"{'median' if level == 0.5 else f'{100 * level:g} %'} {number(quantile)} m"
            )
    within_m = np.inf if each.guaranteed_m is None else each.guaranteed_m
    for level, name, dashes in _ELLIPSES:
        if shows(count, level) and (outline := ellipse(each.across_m, level, within_m)) is not None:
            axes.plot(*outline, label=name, color=TRUTH, linestyle=dashes, **line)
    draw_body(axes, half, each.guaranteed_m, radius_m)
    if each.has_axes:
        axes.set(xlabel=r"$B\cdot T$, m", ylabel=r"$B\cdot R$, m", ylim=(half, -half))
    outside = int((np.abs(each.across_m) > half).any(axis=1).sum())
    if outside:
        place: dict[str, Any] = {
            "xycoords": "axes fraction",
            "ha": "right",
            "va": "bottom",
            "path_effects": HALO,
        }
        axes.annotate(
            f"beyond the axes: {outside} of {count}",
            (0.97, 0.03),
            fontsize="small",
            zorder=5.0,
            **place,
        )
    lines = [", ".join(known)]
    lines += [] if each.guaranteed_m is None else [f"maximum Φ {number(each.guaranteed_m)} m"]
    lines += (
        []
        if radius_m is None
        else [f"hits: {int((each.miss_m <= radius_m).sum())} of {some_runs(count)}"]
    )
    return lines
