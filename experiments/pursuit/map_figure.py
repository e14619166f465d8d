"""Capture time over two parameters, with what is not certified shown as such."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from experiments.common.figure_style import INK, LIMIT, new_figure, style
from experiments.pursuit.report import counted
from rendezvous.pursuit_evasion import STATUSES, CaptureMap, PointStatus

Floats = NDArray[np.float64]

_S_PER_HOUR = 3600.0
_BOTTOM, _BOTTOM_WITH_LEGEND, _TOP = 0.18, 0.25, 0.93
_SHADES = LinearSegmentedColormap.from_list("blues", ["#f4f8fc", "#b4d0e8", "#4f8bbf", "#0b3c74"])
_DARK = 0.6
"""Of the scale: lines on darker shades are white."""
_LEVELS = 8
_UNKNOWN: dict[PointStatus, tuple[str, str]] = {
    PointStatus.NOT_CERTIFIED: ("#f6d9bd", "////"),
    PointStatus.ESCAPES: ("#e4e4e4", "...."),
    PointStatus.PROPELLANT_EXHAUSTED: ("#d2d2d2", "\\\\\\\\"),
    PointStatus.NO_GAME: ("#ffffff", "xxxx"),
}
_RATIOS = {
    "phase_deg": "lead of the evader, deg",
    "thrust_ratio": "thrust of the evader over that of the pursuer",
    "mass_ratio": "mass of the evader over that of the pursuer",
}
_UNITS = {"km3_s2": "km$^3$/s$^2$", "deg": "deg", "km": "km", "kg": "kg", "N": "N", "s": "s"}


def draw_map(found: CaptureMap, column: str, row: str) -> Figure:
    """Draw capture times in hours, with contours, and hatched where there is none.

    Parameters
    ----------
    found : CaptureMap
    column, row : str
        Names of the parameters, with their units.

    Returns
    -------
    Figure
        The map and its scale.
    """
    hours = found.capture_s / _S_PER_HOUR
    with style():
        figure = new_figure(height_mm=95.0, width_mm=150.0)
        has_unknown = any(found.count(status) for status in _UNKNOWN)
        bottom = _BOTTOM_WITH_LEGEND if has_unknown else _BOTTOM
        axes = figure.add_axes((0.12, bottom, 0.71, _TOP - bottom))
        if hours.count():
            mesh = axes.pcolormesh(found.columns, found.rows, hours, cmap=_SHADES, shading="nearest", rasterized=True)
            figure.colorbar(mesh, cax=figure.add_axes((0.86, bottom, 0.025, _TOP - bottom)))
            if hours.count() > 3 and min(hours.shape) > 1 and float(np.ptp(hours.compressed())) > 0.0:
                _draw_levels(axes, found, hours)
        handles = _hatch_unknown(axes, found)
        axes.set_xlim(*_edges(found.columns)[[0, -1]])
        axes.set_ylim(*_edges(found.rows)[[0, -1]])
        axes.set_xlabel(axis_name(column))
        axes.set_ylabel(axis_name(row))
        axes.set_title("capture time, h")
        figure.text(0.475, 0.025, f"{found.status.size} points: {counted(found)}", ha="center", fontsize=7.5)
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
    """Return a parameter as an axis names it: `evader.inclination_deg` is `evader: inclination, deg`.

    Parameters
    ----------
    parameter : str

    Returns
    -------
    str
    """
    owner, _, key = parameter.rpartition(".")
    words = _RATIOS.get(key)
    for ending, unit in _UNITS.items():
        if words is None and key.endswith(f"_{ending}"):
            words = f"{key.removesuffix(f'_{ending}').replace('_', ' ')}, {unit}"
    words = words or key.replace("_", " ")
    return f"{owner}: {words}" if owner else words


def _draw_levels(axes: Any, found: CaptureMap, hours: Any) -> None:
    """Draw lines of equal capture time, none within a cell that has a corner without one."""
    low, high = float(hours.min()), float(hours.max())
    levels = [float(each) for each in MaxNLocator(_LEVELS).tick_values(low, high) if low < each < high]
    inks = ["white" if each > low + _DARK * (high - low) else INK for each in levels]
    if not levels:
        return
    lines = axes.contour(
        found.columns, found.rows, hours, levels=levels, colors=inks, linewidths=0.7, corner_mask=False
    )
    for label in axes.clabel(lines, fontsize=6.5, fmt="%g"):
        # Upright: a 6 on its side may be a 9.
        label.set_rotation(0.0)


def _hatch_unknown(axes: Any, found: CaptureMap) -> list[Patch]:
    """Hatch the points without a capture time, and return what the legend shows."""
    across, up = _edges(found.columns), _edges(found.rows)
    handles = []
    for status, (colour, hatch) in _UNKNOWN.items():
        where = np.argwhere(found.status == STATUSES.index(status))
        if not len(where):
            continue
        look: dict[str, Any] = {"facecolor": colour, "edgecolor": LIMIT, "hatch": hatch, "linewidth": 0.0}
        for j, first, last in _stretches(where):
            corners = [(across[first], up[j]), (across[last + 1], up[j + 1])]
            (left, bottom), (right, top) = corners
            axes.fill([left, right, right, left], [bottom, bottom, top, top], **look)
        handles.append(Patch(label=status.value, **look))
    return handles


def _stretches(where: NDArray[np.int64]) -> list[tuple[int, int, int]]:
    """Join neighbours of a row: row, first and last column of each stretch."""
    out: list[tuple[int, int, int]] = []
    for j, i in where.tolist():
        if out and out[-1][0] == j and out[-1][2] == i - 1:
            out[-1] = (j, out[-1][1], i)
        else:
            out.append((j, i, i))
    return out


def _edges(centres: Floats) -> Floats:
    """Return the edges of cells about points, one more than there are points."""
    middles = 0.5 * (centres[1:] + centres[:-1])
    return np.concatenate([[2.0 * centres[0] - middles[0]], middles, [2.0 * centres[-1] - middles[-1]]])
