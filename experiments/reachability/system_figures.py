"""Figures of a linear system: the bounds of its states and of its controls against the period.

Heights of figures, mm, and sizes of lines, marks and letters are chosen by eye.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from infoset.experiments.common.figure_style import (
    LINE_LOOKS,
    REGION_FILL,
    SET_EDGE,
    SET_FILL,
    legend_below,
    plain,
    style,
    subplots,
)
from infoset.experiments.reachability.system import SystemReport


def draw_all(report: SystemReport) -> Iterator[Figure]:
    """Draw the figures of a report, one after the other."""
    yield draw_states(report)
    yield draw_controls(report)


@style()
def draw_states(report: SystemReport) -> Figure:
    """Draw the reachable states, the tube of all optimal motions, and some of these."""
    names = report.system.names
    figure, grid = subplots(30.0 + 40.0 * len(names), len(names), 1, sharex=True)
    for i, (name, (axes,)) in enumerate(zip(map(plain, names), grid, strict=True)):
        periods = np.arange(len(report.tube))
        axes.fill_between(
            periods, *report.forward[:, i].T, color=REGION_FILL, label="reachable states"
        )
        axes.fill_between(
            periods, *report.tube[:, i].T, color=SET_FILL, label="states of all optimal controls"
        )
        for look, states in zip(LINE_LOOKS, report.states.items(), strict=False):
            axes.plot(states[1][:, i], label=states[0], **look | {"linewidth": 1.0})
        axes.set_ylabel(name)
        axes.xaxis.set_major_locator(MaxNLocator(8, integer=True))
    _finish(figure, grid, report)
    return figure


@style()
def draw_controls(report: SystemReport) -> Figure:
    """Draw the range of each control over all optimal ones, and some of these."""
    count = report.ranges.shape[1]
    periods = len(report.ranges)
    figure, grid = subplots(30.0 + 40.0 * count, count, 1, sharex=True)
    for j, (axes,) in enumerate(grid):
        low, high = report.ranges[:, j].T
        band: dict[str, Any] = {
            "width": 1.0,
            "color": SET_FILL,
            "edgecolor": SET_EDGE,
            "label": "all optimal controls",
        }
        axes.bar(np.arange(periods) + 0.5, high - low, bottom=low, **band)
        for look, (name, control) in zip(LINE_LOOKS, report.controls.items(), strict=False):
            line: dict[str, Any] = {
                "color": look["color"],
                "linestyle": look["linestyle"],
                "label": name,
            }
            axes.stairs(control[:, j], np.arange(periods + 1), baseline=None, **line)
        axes.set_ylabel(f"u{j + 1}")
    _finish(figure, grid, report)
    return figure


def _finish(figure: Figure, grid: Any, report: SystemReport) -> None:
    """Add the legend, and a title if there are more selected controls than kinds of lines."""
    if len(report.controls) > len(LINE_LOOKS):
        grid[0, 0].set_title(
            f"the first {len(LINE_LOOKS)} of {len(report.controls)} selected controls"
        )
    grid[-1, 0].set_xlabel("period")
    legend_below(figure, 3)
