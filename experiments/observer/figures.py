"""Figures of an observer: bounds of the states against time, and the sets of two states."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from experiments.common.figure_style import IMPULSE, INK, MEASURED, SET_EDGE, SET_FILL, TRUTH, figure_grid, plain, style
from experiments.observer.report import Report, times
from infoset import Estimate
from infoset.arrays import Floats

_MAX_OUTLINES = 60


def draw_all(report: Report) -> Iterator[Figure | None]:
    """Draw the figures of a report, one after the other; None for the sets of more than two states."""
    yield draw_bounds(report)
    yield draw_sets(report) if len(report.problem.names) == 2 else None


@style()
def draw_bounds(report: Report) -> Figure:
    """Draw the bounds of each state and their distance against time, with the true state of a simulation."""
    names = report.problem.names
    figure, grid = figure_grid(24.0 + 34.0 * len(names), len(names), 2, (18.0, 4.0, 11.0, 9.0), (17.0, 5.0))
    time, title = times(report)
    (lower, upper), smoothed = _ends(report.estimates), report.smoothed and _ends(report.smoothed)
    dashed: dict[str, Any] = {"color": MEASURED, "linewidth": 0.9, "linestyle": (0, (4, 1.5))}
    missing = np.isnan(report.data.measured).all(axis=1)
    for index, (name, panel, width) in enumerate(zip(names, grid[::2], grid[1::2], strict=True)):
        panel.fill_between(time, lower[:, index], upper[:, index], color=SET_FILL, label="possible states")
        for ends in (lower, upper):
            panel.plot(time, ends[:, index], color=SET_EDGE, linewidth=0.8)
        width.plot(time, upper[:, index] - lower[:, index], color=SET_EDGE)
        if smoothed:
            first, last = smoothed[0][:, index], smoothed[1][:, index]
            panel.plot(time, first, label="with later measurements", **dashed)
            panel.plot(time, last, **dashed)
            width.plot(time, last - first, **dashed)
        if report.data.states is not None:
            panel.plot(time, report.data.states[:, index], color=TRUTH, linewidth=1.1, label="true state")
        if missing.any():
            mark: dict[str, Any] = {"color": INK, "linestyle": "none", "marker": "|", "label": "no measurement"}
            low = np.full(missing.sum(), 0.02)
            panel.plot(time[missing], low, transform=panel.get_xaxis_transform(), **mark)
        if report.contradicted:
            _mark_contradiction(panel, report, f"no state from step {int(report.inconsistency.step)} on")
            _mark_contradiction(width, report)
        panel.set_ylabel(plain(name))
        panel.margins(x=0.01)
        width.set_ylabel(f"width of {plain(name)}")
        width.margins(x=0.01, y=0.05)
        width.set_ylim(bottom=0.0)
        for axes in (panel, width):
            axes.tick_params(labelbottom=index == len(names) - 1)
            if report.problem.system.step_s is None:
                axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    for axes in grid[-2:]:
        axes.set_xlabel(title)
    handles, labels = grid[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="upper center", ncols=5, columnspacing=1.2)
    return figure


def _ends(estimates: Sequence[Estimate]) -> list[Floats]:
    """Return the lower and the upper bounds of the states, each of shape (N, n)."""
    return [np.array([getattr(estimate, end) for estimate in estimates]) for end in ("lower", "upper")]


def _mark_contradiction(panel: Axes, report: Report, label: str | None = None) -> None:
    """Mark the steps without a possible state."""
    time, _ = times(report)
    empty = time[[estimate.is_empty for estimate in report.estimates]]
    panel.axvspan(empty[0], time[-1], facecolor="none", edgecolor=IMPULSE, hatch="////", linewidth=0.0, alpha=0.35)
    panel.axvline(empty[0], color=IMPULSE, linewidth=1.2, label=label)


@style()
def draw_sets(report: Report) -> Figure:
    """Draw the sets of two states, the first ones light and the last ones dark, at most 60 of them."""
    figure, (panel,) = figure_grid(110.0, 1, 1, (18.0, 6.0, 12.0, 8.0), (0.0, 0.0))
    shown = [estimate for estimate in report.estimates if not estimate.is_empty]
    shown = shown[:: -(-len(shown) // _MAX_OUTLINES)] if shown else []
    outlines = [estimate.polygons.polygon() for estimate in shown]
    edges = [str(shade) for shade in np.linspace(0.75, 0.2, len(outlines))]
    fill = PolyCollection(outlines, facecolors=SET_FILL, edgecolors=edges, linewidths=0.8, alpha=0.55)
    panel.add_collection(fill)
    if outlines:
        panel.update_datalim(np.vstack(outlines))
        title = f"possible states, from step {shown[0].step} (light) to step {shown[-1].step} (dark)"
        panel.set_title(title, loc="left")
    if report.data.states is not None:
        states = report.data.states
        panel.plot(
            states[:, 0], states[:, 1], color=TRUTH, marker=".", markersize=3.0, linewidth=0.7, label="true state"
        )
        panel.legend(loc="best")
    panel.autoscale_view()
    panel.set(xlabel=plain(report.problem.names[0]), ylabel=plain(report.problem.names[1]))
    return figure
