"""Figures of an observer: bounds of the states against time, and the sets of two states."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from experiments.common.figure_style import IMPULSE, INK, MEASURED, SET_EDGE, SET_FILL, TRUTH, figure_grid, plain, style
from experiments.observer.report import Report
from infoset.arrays import Floats

_MOST_OUTLINES = 60


@style()
def draw_bounds(report: Report) -> Figure:
    """Draw the bounds of each state and their distance against time, with the true state of a simulation."""
    names = report.problem.names
    figure, grid = figure_grid(24.0 + 34.0 * len(names), len(names), 2, (18.0, 4.0, 11.0, 9.0), (17.0, 5.0))
    panels, widths = grid[::2], grid[1::2]
    time, title = times(report)
    lower, upper = (np.array([getattr(each, end) for each in report.estimates]) for end in ("lower", "upper"))
    for index, (panel, name) in enumerate(zip(panels, names, strict=True)):
        panel.fill_between(time, lower[:, index], upper[:, index], color=SET_FILL, label="possible states")
        for ends in (lower, upper):
            panel.plot(time, ends[:, index], color=SET_EDGE, linewidth=0.8)
        if report.smoothed is not None:
            for end in ("lower", "upper"):
                values = [getattr(each, end)[index] for each in report.smoothed]
                label = "with later measurements" if end == "lower" else None
                panel.plot(time, values, color=MEASURED, linewidth=0.9, linestyle=(0, (4, 1.5)), label=label)
        if report.data.states is not None:
            panel.plot(time, report.data.states[:, index], color=TRUTH, linewidth=1.1, label="true state")
        missing = np.isnan(report.data.measured).all(axis=1)
        if missing.any():
            panel.plot(
                time[missing],
                np.full(missing.sum(), 0.02),
                transform=panel.get_xaxis_transform(),
                color=INK,
                linestyle="none",
                marker="|",
                label="no measurement",
            )
        if report.contradicted:
            _mark_contradiction(panel, report, f"no state from step {int(report.inconsistency.step)} on")
        panel.set_ylabel(plain(name))
        panel.margins(x=0.01)
        if index < len(names) - 1:
            panel.tick_params(labelbottom=False)
    for index, (panel, name) in enumerate(zip(widths, names, strict=True)):
        panel.plot(time, upper[:, index] - lower[:, index], color=SET_EDGE)
        if report.smoothed is not None:
            smoothed = [float(each.upper[index] - each.lower[index]) for each in report.smoothed]
            panel.plot(time, smoothed, color=MEASURED, linewidth=0.9, linestyle=(0, (4, 1.5)))
        if report.contradicted:
            _mark_contradiction(panel, report)
        panel.set_ylabel(f"width of {plain(name)}")
        panel.margins(x=0.01, y=0.05)
        panel.set_ylim(bottom=0.0)
        if index < len(names) - 1:
            panel.tick_params(labelbottom=False)
    for panel in (panels[-1], widths[-1]):
        panel.set_xlabel(title)
    if report.problem.step_s is None:
        for panel in grid:
            panel.xaxis.set_major_locator(MaxNLocator(integer=True))
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="upper center", ncols=5, columnspacing=1.2)
    return figure


def _mark_contradiction(panel: Axes, report: Report, label: str | None = None) -> None:
    """Mark the steps without a possible state."""
    time, _ = times(report)
    empty = time[[estimate.is_empty for estimate in report.estimates]]
    panel.axvspan(empty[0], time[-1], facecolor="none", edgecolor=IMPULSE, hatch="////", linewidth=0.0, alpha=0.35)
    panel.axvline(empty[0], color=IMPULSE, linewidth=1.2, label=label)


def times(report: Report) -> tuple[Floats, str]:
    """Return the times of the steps, and the title of their axis."""
    steps = np.array([estimate.step for estimate in report.estimates], dtype=float)
    step_s = report.problem.step_s
    return (steps, "step") if step_s is None else (steps * step_s, "time, s")


@style()
def draw_sets(report: Report) -> Figure:
    """Draw the sets of two states, the first ones light and the last ones dark, at most 60 of them."""
    figure, (panel,) = figure_grid(110.0, 1, 1, (18.0, 6.0, 12.0, 8.0), (0.0, 0.0))
    shown = [estimate for estimate in report.estimates if not estimate.is_empty]
    shown = shown[:: -(-len(shown) // _MOST_OUTLINES)] if shown else []
    outlines = [estimate.polygons.polygon() for estimate in shown]
    edges = [str(shade) for shade in np.linspace(0.75, 0.2, len(outlines))]
    fill = PolyCollection(outlines, facecolors=SET_FILL, edgecolors=edges, linewidths=0.8, alpha=0.55)
    panel.add_collection(fill)
    if outlines:
        panel.update_datalim(np.vstack(outlines))
        for first in (0, len(outlines) - 1):
            at = outlines[first].mean(axis=0)
            panel.annotate(f"step {shown[first].step}", at, fontsize=7.0, ha="center", va="center")
    if report.data.states is not None:
        states = report.data.states
        panel.plot(
            states[:, 0], states[:, 1], color=TRUTH, marker=".", markersize=3.0, linewidth=0.7, label="true state"
        )
        panel.legend(loc="best")
    panel.autoscale_view()
    panel.set(xlabel=plain(report.problem.names[0]), ylabel=plain(report.problem.names[1]))
    panel.set_title("possible states, light (first step) to dark (last step)", loc="left")
    return figure
