"""Figure of a map: capture time over two parameters, with hatching where no capture is certified."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.common.figure_style import HALO, INK, LIMIT, legend_below, style, subplots
from experiments.common.units import S_PER_HOUR, split_unit
from experiments.pursuit.map import STATUS_WORDS, MapReport, counted
from infoset.arrays import Floats
from rendezvous.pursuit_evasion import STATUSES, CaptureMap, PointStatus

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
    figure, ((axes,),) = subplots(105.0, width_mm=140.0)
    if hours.count():
        look: dict[str, Any] = {"cmap": mpl.colormaps["Blues"], "shading": "nearest", "rasterized": True}
        mesh = axes.pcolormesh(solved.columns, solved.rows, hours, **look)
        figure.colorbar(mesh, ax=axes, label="capture time, h")
        if hours.count() > 3 and min(hours.shape) > 1 and float(np.ptp(hours.compressed())) > 0.0:
            # No contour lines in cells with a corner that has no capture time.
            lines = axes.contour(
                solved.columns, solved.rows, hours, levels=_LEVELS, colors=INK, linewidths=0.7, corner_mask=False
            )
            for label in axes.clabel(lines, fontsize="small", fmt="%g"):
                label.set(rotation=0.0, path_effects=HALO)  # upright, so that a 6 is not read as a 9
    _hatch_unknown(axes, solved)
    # The cells of the outer points end at the range of the parameters, which values outside it may not have.
    axes.set(xlim=solved.columns[[0, -1]], ylim=solved.rows[[0, -1]], xlabel=axis_name(column), ylabel=axis_name(row))
    axes.set_title(f"{solved.status.size} points: {counted(solved)}", fontsize="small")
    axes.grid(visible=False)
    legend_below(figure, 2)
    return figure


def axis_name(parameter: str) -> str:
    """Return the axis label of a parameter: `evader orbit: inclination, deg` for `evader.orbit.inclination_deg`."""
    owner, _, key = parameter.rpartition(".")
    words = _RATIOS.get(key) or ", ".join(filter(None, split_unit(key)))
    return f"{owner.replace('.', ' ')}: {words}" if owner else words


def _hatch_unknown(axes: Axes, solved: CaptureMap) -> None:
    """Hatch the points without a capture time."""
    across, up = _edges(solved.columns), _edges(solved.rows)
    for status, (colour, hatch) in _UNKNOWN.items():
        look: dict[str, Any] = {"facecolor": colour, "edgecolor": LIMIT, "hatch": hatch, "linewidth": 0.0}
        for j, i in np.argwhere(solved.status == STATUSES.index(status)):
            left, right, bottom, top = across[i], across[i + 1], up[j], up[j + 1]
            axes.fill([left, right, right, left], [bottom, bottom, top, top], label=STATUS_WORDS[status], **look)


def _edges(centres: Floats) -> Floats:
    """Return the edges of the cells around the points, one more than there are points."""
    middles = 0.5 * (centres[1:] + centres[:-1])
    return np.concatenate([[2.0 * centres[0] - middles[0]], middles, [2.0 * centres[-1] - middles[-1]]])
