"""Figure of a map: capture time over two parameters, with hatching where no capture is certified."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from experiments.common.display_units import S_PER_HOUR, split_unit
from experiments.common.figure_style import INK, LIMIT, new_figure, style
from experiments.pursuit.map import STATUS_WORDS, MapReport, counted
from infoset.arrays import Floats
from rendezvous.pursuit_evasion import STATUSES, CaptureMap, PointStatus

_BOTTOM, _BOTTOM_WITH_LEGEND, _TOP = 0.18, 0.25, 0.93
_SHADES = LinearSegmentedColormap.from_list("blues", ["#f4f8fc", "#b4d0e8", "#4f8bbf", "#0b3c74"])
_DARK = 0.6
"""Fraction of the colour scale from which contour lines are white."""
_LEVELS = 8
_UNKNOWN: dict[PointStatus, tuple[str, str]] = {
    PointStatus.NOT_CERTIFIED: ("#f6d9bd", "////"),
    PointStatus.ESCAPES: ("#e4e4e4", "...."),
    PointStatus.PROPELLANT_EXHAUSTED: ("#d2d2d2", "\\\\\\\\"),
    PointStatus.NO_GAME: ("#ffffff", "xxxx"),
}
_RATIOS = {
    "phase_deg": "lead of the evader, deg",
    "thrust_ratio": "thrust of the evader / thrust of the pursuer",
    "mass_ratio": "mass of the evader / mass of the pursuer",
}


def draw_all(report: MapReport) -> Iterator[Figure]:
    """Draw the figure of a report."""
    yield draw_map(report.solved, report.x.parameter, report.y.parameter)


@style()
def draw_map(solved: CaptureMap, column: str, row: str) -> Figure:
    """Draw the capture times in hours with contours.

    Parameters
    ----------
    column, row : str
        Names of the parameters, with their units.
    """
    hours = solved.capture_s / S_PER_HOUR
    figure = new_figure(height_mm=95.0, width_mm=150.0)
    has_unknown = any(solved.count(status) for status in _UNKNOWN)
    bottom = _BOTTOM_WITH_LEGEND if has_unknown else _BOTTOM
    axes = figure.add_axes((0.12, bottom, 0.71, _TOP - bottom))
    if hours.count():
        mesh = axes.pcolormesh(solved.columns, solved.rows, hours, cmap=_SHADES, shading="nearest", rasterized=True)
        figure.colorbar(mesh, cax=figure.add_axes((0.86, bottom, 0.025, _TOP - bottom)))
        if hours.count() > 3 and min(hours.shape) > 1 and float(np.ptp(hours.compressed())) > 0.0:
            _draw_levels(axes, solved, hours)
    handles = _hatch_unknown(axes, solved)
    # The cells of the outer points end at the range of the parameters, which values outside it may not have.
    axes.set_xlim(*solved.columns[[0, -1]])
    axes.set_ylim(*solved.rows[[0, -1]])
    axes.set_xlabel(axis_name(column))
    axes.set_ylabel(axis_name(row))
    axes.set_title("capture time, h")
    figure.text(0.475, 0.025, f"{solved.status.size} points: {counted(solved)}", ha="center", fontsize=7.5)
    axes.grid(visible=False)
    if handles:
        axes.legend(
            handles=handles,
            loc="upper center",
            bbox_to_anchor=(0.5, -0.18),
            ncols=len(handles),
            handlelength=2.2,
            handleheight=1.2,
        )
    return figure


def axis_name(parameter: str) -> str:
    """Return the axis label of a parameter: `evader orbit: inclination, deg` for `evader.orbit.inclination_deg`."""
    owner, _, key = parameter.rpartition(".")
    words = _RATIOS.get(key) or ", ".join(filter(None, split_unit(key)))
    return f"{owner.replace('.', ' ')}: {words}" if owner else words


def _draw_levels(axes: Any, solved: CaptureMap, hours: Any) -> None:
    """Draw contour lines, except in cells with a corner that has no capture time."""
    low, high = float(hours.min()), float(hours.max())
    levels = [float(level) for level in MaxNLocator(_LEVELS).tick_values(low, high) if low < level < high]
    inks = ["white" if level > low + _DARK * (high - low) else INK for level in levels]
    if not levels:
        return
    lines = axes.contour(
        solved.columns, solved.rows, hours, levels=levels, colors=inks, linewidths=0.7, corner_mask=False
    )
    for label in axes.clabel(lines, fontsize=6.5, fmt="%g"):
        # Upright, so that a rotated 6 is not read as a 9.
        label.set_rotation(0.0)


def _hatch_unknown(axes: Any, solved: CaptureMap) -> list[Patch]:
    """Hatch the points without a capture time, and return the entries of the legend."""
    across, up = _edges(solved.columns), _edges(solved.rows)
    handles = []
    for status, (colour, hatch) in _UNKNOWN.items():
        where = np.argwhere(solved.status == STATUSES.index(status))
        if not len(where):
            continue
        look: dict[str, Any] = {"facecolor": colour, "edgecolor": LIMIT, "hatch": hatch, "linewidth": 0.0}
        ends = 1 + np.flatnonzero((np.diff(where, axis=0) != (0, 1)).any(axis=1))
        for stretch in np.split(where, ends):  # adjacent cells of a row
            (j, first), (_, last) = stretch[[0, -1]]
            left, right, bottom, top = across[first], across[last + 1], up[j], up[j + 1]
            axes.fill([left, right, right, left], [bottom, bottom, top, top], **look)
        handles.append(Patch(label=STATUS_WORDS[status], **look))
    return handles


def _edges(centres: Floats) -> Floats:
    """Return the edges of the cells around the points, one more than there are points."""
    middles = 0.5 * (centres[1:] + centres[:-1])
    return np.concatenate([[2.0 * centres[0] - middles[0]], middles, [2.0 * centres[-1] - middles[-1]]])
