"""Comparison of strategies: distributions of miss and impulse with each noise.

Sizes and margins without a reason were chosen by eye (`figure_style`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from infoset.arrays import Floats
from infoset.experiments.common.figure_style import (
    INK,
    SET,
    legend_below,
    letters,
    plain_ticks,
    style,
    subplots,
)
from infoset.experiments.common.screen import some_runs
from infoset.experiments.interception.figures.distributions import draw_radius
from infoset.experiments.interception.study import Comparison
from infoset.sim import Body
from infoset.sim.statistics import shows

_BINS = 48
"""Number of bins of a histogram: a panel has room for bars of a millimetre and a half."""
_HILL = 0.62
"""Height of a histogram, in rows; chosen."""
_BAR = 0.17
"""Distance of the quantile bar below the histogram, in rows; chosen."""
_ABOVE = 0.78
"""Room above the first line, in rows: a histogram, with a margin of 0.16; chosen."""
_BELOW = 0.38
"""Room below the last line, in rows: a quantile bar, with a margin of 0.21; chosen."""
_MARK: dict[str, Any] = {"color": INK, "linestyle": "none", "zorder": 4.0}


@style()
def draw_comparison(compared: Sequence[Comparison], body: Body | None = None) -> Figure:
    """Draw the distributions of the miss (left) and of the impulse spent.

    Each noise has a row of two panels, and each strategy a line in them. With several tie rules,
    each run has the value of its worst one. Misses are on a logarithmic axis, with a line at the
    radius of the body (`radius_name`).
    """
    names = list(dict.fromkeys(each.strategy for each in compared))
    noises = {each.noise: each.noise_title for each in compared}
    # Millimetres: 8 a strategy, 12 for the title and the labels of a row, 21 for the legend;
    # chosen.
    height = len(noises) * (12.0 + 8.0 * len(names)) + 21.0
    figure, grid = subplots(height, len(noises), 2, sharex="col", sharey=True)
    misses = [each.worst("miss_m") for each in compared]
    impulses = [each.worst("impulse_m_s") for each in compared]
    linear = np.linspace(0.0, 1.04 * float(np.max(impulses)) or 1.0, _BINS + 1)
    edges = (_logarithmic(misses), linear)

    for column, samples, bins in zip(grid.T, (misses, impulses), edges, strict=True):
        for axes, noise in zip(column, noises, strict=True):
            for each, sample in zip(compared, samples, strict=True):
                if each.noise == noise:
                    _draw_strategy(axes, names.index(each.strategy), sample, bins)
            axes.set_xlim(bins[0], bins[-1])
            axes.grid(visible=False, axis="y")

    for axes in grid[:, 0]:
        axes.set_xscale("log")
        plain_ticks(axes.xaxis)
        draw_radius(axes, body)

    for axes, label in zip(grid[-1], ("miss, m", "impulse spent, m/s"), strict=True):
        axes.set_xlabel(label)
    # The first strategy is on top: the axis points downward.
    bottom = len(names) - 1 + _BELOW
    grid[0, 0].set(ylim=(bottom, -_ABOVE), yticks=range(len(names)), yticklabels=names)
    letters([*grid.flat], [title for title in noises.values() for _ in range(2)])
    legend_below(figure, 3)
    return figure


def _logarithmic(samples: Sequence[Floats]) -> Floats:
    """Return the edges of the bins of misses.

    The first edge is the smallest 2 % quantile of the positive values of a sample, or a tenth of
    the last edge if that is smaller: misses can be arbitrarily small, and the axis spans at least a
    decade. Both, and the margin of a quarter beyond the maximum, are chosen. Values below the first
    edge are counted in the first bin.
    """
    positive = [sample[sample > 0.0] for sample in samples if (sample > 0.0).any()]
    if not positive:
        return np.geomspace(0.1, 1.0, _BINS + 1)  # all misses are 0: any decade
    right = 1.25 * max(float(sample.max()) for sample in positive)
    left = min(float(np.quantile(sample, 0.02)) for sample in positive)
    return np.geomspace(min(left, 0.1 * right), right, _BINS + 1)


def _draw_strategy(axes: Axes, place: int, sample: Floats, edges: Floats) -> None:
    """Draw a histogram on the line of its strategy, and below it a bar of quantiles.

    Quantiles that the runs do not show are left out, but not the median. Quantiles below the first
    edge are drawn at it.
    """
    counts, _ = np.histogram(np.clip(sample, edges[0], edges[-1]), bins=edges)
    # The axis points downward (`draw_comparison`): histograms rise toward smaller numbers.
    heights = place - _HILL * counts / counts.max()
    label = f"histogram of {some_runs(len(sample))}"
    axes.stairs(heights, edges, baseline=place, fill=True, label=label, **SET | {"linewidth": 0.5})
    low, middle, high, nearly, worst = np.maximum(
        np.quantile(sample, (0.1, 0.5, 0.9, 0.99, 1.0)), edges[0]
    )
    level = place + _BAR
    bar: dict[str, Any] = {"color": INK, "zorder": 3.0, "solid_capstyle": "butt"}
    axes.plot([middle, worst], [level, level], linewidth=0.6, **bar)
    axes.plot(
        middle, level, marker="o", markersize=5.0, markerfacecolor="white", label="median", **_MARK
    )
    if shows(len(sample), 0.9):
        axes.plot([low, high], [level, level], linewidth=2.4, label="10 to 90 %", **bar)
    if shows(len(sample), 0.99):
        axes.plot(nearly, level, marker="|", markersize=6.0, label="99 %", **_MARK)
    axes.plot(worst, level, marker="x", markersize=4.5, label="worst run", **_MARK)
