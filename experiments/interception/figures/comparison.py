"""Comparison of strategies: distributions of miss and impulse, with random and with game noise."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import chain

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter

from experiments.common.figure_style import INK, SET_EDGE, SET_FILL, new_figure, place_axes, style
from experiments.common.screen import some_runs
from experiments.interception.comparison import Comparison
from experiments.interception.figures.distributions import draw_radius
from guidance import NoiseKind
from infoset.arrays import Floats
from sim.statistics import shows

_ROW_MM = 9.0
_LETTER_MM = 1.4
"""Width of a letter of a name."""

_BINS = 48
_HILL = 0.62
"""Height of a histogram, in rows."""

_BAR = 0.17
"""Distance of the quantile bar below its histogram, in rows."""

_FEW_DECADES = 3
"""Number of decades up to which a logarithmic axis also has ticks at 2 and 5."""

_NOISES = ((NoiseKind.RANDOM, "random noise"), (NoiseKind.GAME, "game noise, worst of four tie rules"))


def draw_comparison(compared: Sequence[Comparison], radius_m: float | None = None) -> Figure:
    """Draw the distributions of (a, b) the miss and (c, d) the impulse spent, one row per strategy.

    Random noise is left, game noise right. Misses are on a logarithmic axis, with a line at the radius of the body, m.
    """
    names = list(dict.fromkeys(each.strategy for each in compared))
    if not names:
        raise ValueError("at least one strategy is needed")
    height = _ROW_MM * len(names)
    with style():
        figure = new_figure(height_mm=2.0 * height + 46.0)
        left = min(max(30.0, 4.0 + _LETTER_MM * max(len(name) for name in names)), 60.0)
        rows = place_axes(figure, 2, 2, margins_mm=(left, 4.0, 20.0, 7.0), gaps_mm=(6.0, 19.0))
        _draw_row(rows[0], compared, names, lambda each: each.miss_m, logarithmic=True)
        _draw_row(rows[1], compared, names, lambda each: each.impulse_m_s, logarithmic=False)
        titles = [title for _, title in _NOISES]
        labels = ["miss, m"] * 2 + ["impulse spent, m/s"] * 2
        for axes, letter, title, label in zip(chain(*rows), "abcd", titles * 2, labels, strict=True):
            axes.set(title=f"({letter}) {title}", xlabel=label)
        (radius, _) = [draw_radius(axes, radius_m) for axes in rows[0]]
        handles = _handles(len(compared[0].miss_m)) + radius
        figure.legend(handles=handles, loc="lower center", ncols=5 if radius_m is None else 3, columnspacing=1.6)
    return figure


def _draw_row(
    row: Sequence[Axes],
    compared: Sequence[Comparison],
    names: Sequence[str],
    value: Callable[[Comparison], Floats],
    *,
    logarithmic: bool,
) -> None:
    everything = np.concatenate([value(each) for each in compared])
    left, right = _ends(everything, [value(each) for each in compared], logarithmic=logarithmic)
    for axes, (noise, _) in zip(row, _NOISES, strict=True):
        for each in compared:
            if each.noise is noise:
                _draw_strategy(axes, names.index(each.strategy), value(each), (left, right), logarithmic=logarithmic)
        if logarithmic:
            axes.set_xscale("log")
            powers = np.arange(np.floor(np.log10(left)), np.floor(np.log10(right)) + 1.0)
            ticks = np.outer(10.0**powers, (1.0, 2.0, 5.0) if len(powers) <= _FEW_DECADES else (1.0,)).ravel()
            axes.xaxis.set_major_locator(FixedLocator(ticks[(ticks >= 0.999 * left) & (ticks <= right)].tolist()))
            axes.xaxis.set_major_formatter(FuncFormatter(lambda tick, _: f"{tick:g}"))
            axes.xaxis.set_minor_formatter(NullFormatter())
        axes.set_xlim(left, right)
        axes.set_ylim(len(names) - 0.62, -0.78)
        axes.set_yticks(range(len(names)), names)
        axes.tick_params(axis="y", length=0.0)
        axes.grid(visible=False, axis="y")
    row[1].tick_params(labelleft=False)


def _ends(everything: Floats, samples: Sequence[Floats], *, logarithmic: bool) -> tuple[float, float]:
    """Limits of an axis; a logarithmic axis may omit a few small values."""
    if not logarithmic:
        return 0.0, 1.04 * float(everything.max()) or 1.0
    positive = everything[everything > 0.0]
    if not positive.size:
        return 0.1, 1.0
    minimum = min(float(np.quantile(sample[sample > 0.0], 0.02)) for sample in samples if (sample > 0.0).any())
    right = 1.25 * float(positive.max())
    return min(minimum, 0.1 * right), right


def _draw_strategy(axes: Axes, place: int, sample: Floats, ends: tuple[float, float], *, logarithmic: bool) -> None:
    edges = np.geomspace(*ends, _BINS + 1) if logarithmic else np.linspace(*ends, _BINS + 1)
    counts, _ = np.histogram(np.clip(sample, edges[0], edges[-1]), bins=edges)
    heights = _HILL * counts / counts.max()
    axes.stairs(
        place - heights, edges, baseline=place, fill=True, facecolor=SET_FILL, edgecolor=SET_EDGE, linewidth=0.5
    )
    low, middle, high, nearly, worst = np.maximum(np.quantile(sample, (0.1, 0.5, 0.9, 0.99, 1.0)), ends[0])
    level = place + _BAR
    if shows(len(sample), 0.9):
        axes.plot([low, high], [level, level], color=INK, linewidth=2.4, zorder=3.0, solid_capstyle="butt")
    else:
        high = middle
    axes.plot([high, worst], [level, level], color=INK, linewidth=0.6, zorder=3.0, solid_capstyle="butt")
    axes.plot([middle], [level], marker="o", markersize=5.0, markerfacecolor="white", color=INK, zorder=4.0)
    if shows(len(sample), 0.99):
        axes.plot([nearly], [level], marker="|", markersize=6.0, markeredgewidth=1.0, color=INK, zorder=4.0)
    axes.plot([worst], [level], marker="x", markersize=4.5, markeredgewidth=1.0, color=INK, zorder=4.0)


def _handles(runs: int) -> list[Line2D | Patch]:
    def mark(marker: str, label: str, size: float) -> Line2D:
        return Line2D(
            [], [], linestyle="", marker=marker, markersize=size, markerfacecolor="white", color=INK, label=label
        )

    return [
        Patch(facecolor=SET_FILL, edgecolor=SET_EDGE, linewidth=0.5, label=f"histogram of {some_runs(runs)}"),
        mark("o", "median", 5.0),
        *([Line2D([], [], color=INK, linewidth=2.4, label="10 to 90 %")] if shows(runs, 0.9) else []),
        *([mark("|", "99 %", 6.0)] if shows(runs, 0.99) else []),
        mark("x", "worst run", 4.5),
    ]
