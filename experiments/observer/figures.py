"""Figures of an observer: bounds of the states against time, and the sets of two states.

Heights of figures, mm, and sizes of lines, marks and letters are chosen by eye.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from infoset.arrays import Floats
from infoset.experiments.common.figure_style import (
    IMPULSE,
    INK,
    MEASURED,
    SET_EDGE,
    SET_FILL,
    TRUTH,
    legend_below,
    plain,
    style,
    subplots,
)
from infoset.experiments.observer.report import ObserverReport, bounds_of, outlines, times

_MAX_OUTLINES = 60
"""Largest number of sets in a figure: more outlines cannot be told apart."""


def draw_all(report: ObserverReport) -> Iterator[Figure | None]:
    """Draw the figures of a report, one after the other.

    The figure of the sets is None for more than two states.
    """
    yield draw_bounds(report)
    yield draw_sets(report) if len(report.problem.names) == 2 else None


@style()
def draw_bounds(report: ObserverReport) -> Figure:
    """Draw the bounds and the widths of each state against time.

    The true state of a simulation is added.
    """
    names = report.problem.names
    # 38 mm for a row, and 30 mm for the title of the time and the legend.
    figure, grid = subplots(30.0 + 38.0 * len(names), len(names), 2, sharex=True)
    time, title = times(report)
    lower, upper = bounds_of(report.estimates).swapaxes(0, 1)
    smoothed = report.smoothed
    dashed: dict[str, Any] = {"color": MEASURED, "linewidth": 0.9, "linestyle": (0, (4, 1.5))}
    missing = np.isnan(report.data.measured).all(axis=1)  # of all outputs
    for index, (name, (panel, width)) in enumerate(zip(map(plain, names), grid, strict=True)):
        panel.fill_between(
            time, lower[:, index], upper[:, index], color=SET_FILL, label="possible states"
        )
        for ends in (lower, upper):
            panel.plot(time, ends[:, index], color=SET_EDGE, linewidth=0.8)
        width.plot(time, upper[:, index] - lower[:, index], color=SET_EDGE)
        if smoothed:
            first, last = bounds_of(smoothed)[..., index].T
            for axes, values in ((panel, first), (panel, last), (width, last - first)):
                axes.plot(time, values, label="with later measurements", **dashed)
        if report.data.states is not None:
            panel.plot(
                time, report.data.states[:, index], color=TRUTH, linewidth=1.1, label="true state"
            )
        if missing.any():
            mark: dict[str, Any] = {
                "color": INK,
                "linestyle": "none",
                "marker": "|",
                "label": "no measurement",
            }
            low = np.full(missing.sum(), 0.02)  # along the lower frame, in parts of the height
            panel.plot(time[missing], low, transform=panel.get_xaxis_transform(), **mark)
        _mark_findings(report, time, (panel, width))
        panel.set_ylabel(name)
        width.set_ylabel(f"width of {name}")
        width.set_ylim(bottom=0.0)
    for axes in grid[-1]:
        axes.set_xlabel(title)
        axes.margins(x=0.01)
        if report.problem.system.step_s is None:
            axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    legend_below(figure, 3)
    return figure


def _mark_findings(report: ObserverReport, time: Floats, panels: tuple[Axes, Axes]) -> None:
    """Mark where a wrong measurement is proved, and from where on no state is possible."""
    for axes in panels:
        if report.proved:
            axes.axvline(
                time[int(report.detection.step)],
                color=IMPULSE,
                linewidth=0.8,
                linestyle=(0, (2, 2)),
                label="a wrong measurement is proved",
            )
        if report.contradicted:
            first = time[int(np.argmax([estimate.is_empty for estimate in report.estimates]))]
            axes.axvspan(
                first,
                time[-1],
                linewidth=0.0,
                facecolor="none",
                edgecolor=IMPULSE,
                hatch="////",
                alpha=0.35,
            )
            label = f"no state from step {int(report.inconsistency.step)} on"
            axes.axvline(first, color=IMPULSE, label=label)


@style()
def draw_sets(report: ObserverReport) -> Figure:
    """Draw the sets of two states, the first ones light and the last ones dark, at most 60."""
    figure, ((panel,),) = subplots(115.0)
    shown = [estimate for estimate in report.estimates if not estimate.is_empty]
    # Every n-th one, with n rounded up.
    shown = shown[:: -(-len(shown) // _MAX_OUTLINES)] if shown else []
    # Lighter greys than 0.3 could not be seen, and darker ones not be told from black.
    shades = mpl.colormaps["Greys"](np.linspace(0.3, 0.9, len(shown)))
    polygons = []
    edges = []
    for estimate, shade in zip(shown, shades, strict=True):
        for polygon in outlines(estimate):
            polygons.append(polygon)
            edges.append(shade)
    panel.add_collection(
        PolyCollection(polygons, facecolors=SET_FILL, edgecolors=edges, linewidths=0.8, alpha=0.55)
    )
    if polygons:
        panel.update_datalim(np.vstack(polygons))
        panel.set_title(
            f"possible states, from step {shown[0].step} (light) to step {shown[-1].step} (dark)"
        )
    if report.data.states is not None:
        panel.plot(
            *report.data.states.T,
            color=TRUTH,
            marker=".",
            markersize=3.0,
            linewidth=0.7,
            label="true state",
        )
        panel.legend(loc="best")
    panel.autoscale_view()
    panel.set(xlabel=plain(report.problem.names[0]), ylabel=plain(report.problem.names[1]))
    return figure
