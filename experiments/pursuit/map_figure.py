"""Figure of a map: capture time over two parameters, and where no capture is certified.

Heights of figures, mm, and sizes of lines, marks and letters are chosen by eye.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from infoset.experiments.common.figure_style import HALO, INK, legend_below, style, subplots
from infoset.experiments.common.units import S_PER_HOUR, split_unit
from infoset.experiments.pursuit.map import NO_GAME, MapReport
from infoset.rendezvous.pursuit_evasion import CertificateVerdict

_LEVELS = 8
"""Number of contour lines of the capture time; chosen: their labels do not overlap."""
_COLOURS = {
    CertificateVerdict.BRANCH_NOT_CERTIFIED.value: "#f4c28f",
    CertificateVerdict.ESCAPES.value: "#dedede",
    CertificateVerdict.PROPELLANT_EXHAUSTED.value: "#a8a8a8",
    NO_GAME: "#ffffff",
}
"""Colours of the points without a capture, by verdict."""
_RATIOS = {
    "phase_deg": "lead of the evader, deg",
    "thrust_ratio": "thrust of the evader / thrust of the pursuer",
}


def draw_all(report: MapReport) -> Iterator[Figure]:
    """Draw the figure of a report."""
    yield draw_map(report)


@style()
def draw_map(report: MapReport) -> Figure:
    """Draw the capture times in hours with contours."""
    x = report.x.values
    y = report.y.values
    hours = report.capture_s / S_PER_HOUR
    figure, ((axes,),) = subplots(105.0, width_mm=140.0)
    if hours.count():
        mesh = axes.pcolormesh(x, y, hours, cmap="Blues", shading="nearest", rasterized=True)
        figure.colorbar(mesh, ax=axes, label="capture time, h")
        # A contour line needs a cell, of four points, and times that differ.
        if hours.count() > 3 and float(np.ptp(hours.compressed())) > 0.0:
            # No contour lines in cells with a corner that has no capture time.
            lines = axes.contour(
                x, y, hours, levels=_LEVELS, colors=INK, linewidths=0.7, corner_mask=False
            )
            for label in axes.clabel(lines, fontsize="small", fmt="%g"):
                label.set(
                    rotation=0.0, path_effects=HALO
                )  # upright, so that a 6 is not read as a 9
    for verdict, colour in _COLOURS.items():
        if (here := report.verdict == verdict).any():
            axes.pcolormesh(
                x,
                y,
                np.ma.array(here, mask=~here),
                cmap=ListedColormap([colour]),
                shading="nearest",
            )
            axes.fill([], [], facecolor=colour, edgecolor=INK, linewidth=0.4, label=verdict)
    # The cells of the outer points end at the range of the parameters, which values outside it may
    # not have.
    axes.set(
        xlim=x[[0, -1]],
        ylim=y[[0, -1]],
        xlabel=axis_name(report.x.parameter),
        ylabel=axis_name(report.y.parameter),
    )
    axes.set_title(report.summary, fontsize="small")
    axes.grid(visible=False)
    legend_below(figure, 2)
    return figure


def axis_name(parameter: str) -> str:
    """Return the axis label of a parameter.

    For example, `evader orbit: inclination, deg` for `evader.orbit.inclination_deg`.
    """
    owner, _, key = parameter.rpartition(".")
    words = _RATIOS.get(key) or ", ".join(filter(None, split_unit(key)))
    return f"{owner.replace('.', ' ')}: {words}" if owner else words
