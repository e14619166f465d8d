"""The lower bound of the miss that any strategy can guarantee: over the label, its pair, and strategies against it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import NullLocator, StrMethodFormatter

from experiments.common.figure_style import (
    INK,
    LIMIT,
    SET_EDGE,
    SET_FILL,
    TRUTH,
    new_figure,
    place_axes,
    separate_labels,
    style,
)
from experiments.common.screen import number
from infoset.arrays import Floats
from sim import Scenario
from sim.bound import LowerBound
from sim.truth_pair import TruthPair, later_impulses

_LOOKS: tuple[dict[str, Any], ...] = (
    {"color": "#7f2704", "linestyle": "-", "marker": "o"},
    {"color": "#08306b", "linestyle": "-", "marker": "s"},
    {"color": "#5a9bd4", "linestyle": (0, (4, 1.5)), "marker": "^"},
)
_COLUMN_MM, _PANEL_MM, _ROW_MM, _TITLE_MM = 88.0, 58.0, 5.0, 6.0
_LEFT_MM, _RIGHT_MM, _MM_A_CHARACTER = 15.0, 2.0, 1.45
_ROWS_OF_NAME = 4
"""Number of strategies from which the text at the bound has its value."""
_BETWEEN_MM = 17.0
"""Height of the title above a panel and of the labels below it."""
_WIDE = 8.0
"""Ratio of the maximum miss to the bound from which the axis of misses is logarithmic."""
_SECONDS_SHOWN = 3.0
"""Length of the time axis, in durations between the last equal measurement and the arrival."""


def draw_bound(scenario: Scenario, lower: LowerBound, worst_m: Mapping[str, float] | None = None) -> Figure:
    """Draw the bound in one column: over the label, the true states that prove it, and the misses of strategies.

    Panel (a) has one curve per closing speed, (b) the motions of the pair, (c) the maximum misses found, `worst_m`,
    m, by the name of the strategy; without them it is left out. The bound is the result of `sim.lower_bound` for this
    scenario. In space, (b) has the offset of the two states along the direction of their difference at x = 0. A bound
    by a single motion has its offset from the x axis.
    """
    heights_mm = [_PANEL_MM, _PANEL_MM]
    if worst_m:
        heights_mm.append(_ROW_MM * (len(worst_m) + 1))
    with style():
        height_mm = sum(heights_mm) + _BETWEEN_MM * len(heights_mm)
        figure = new_figure(height_mm, _COLUMN_MM)
        top_mm, panels = height_mm, []
        for each_mm in heights_mm:
            margins_mm = (_LEFT_MM, _RIGHT_MM, top_mm - _TITLE_MM - each_mm, height_mm - top_mm + _TITLE_MM)
            ((axes,),) = place_axes(figure, 1, 1, margins_mm=margins_mm, gaps_mm=(0.0, 0.0))
            panels.append(axes)
            top_mm -= each_mm + _BETWEEN_MM
        _draw_labels(panels[0], lower)
        _draw_pair(panels[1], scenario, lower)
        if worst_m:
            _draw_strategies(panels[2], lower.bound_m, worst_m)
    return figure


def ripples(labels_m: Floats, bounds_m: Floats) -> list[tuple[Floats, Floats]]:
    """Split a curve over rising labels where labels were not evaluated: those of a stretch lie close together."""
    gaps = np.diff(labels_m)
    if not len(gaps):
        return [(labels_m, bounds_m)]
    cuts = np.flatnonzero(gaps > 3.0 * np.median(gaps)) + 1
    return list(zip(np.split(labels_m, cuts), np.split(bounds_m, cuts), strict=True))


def _draw_labels(axes: Axes, lower: LowerBound) -> None:
    banded = False
    for look, speed in zip(_LOOKS, lower.speeds_m_s, strict=False):
        stretches = ripples(*lower.curve(speed))
        name = f"{-speed / 1e3:g} km/s"
        if len(stretches) == 1:
            axes.plot(stretches[0][0] / 1e3, stretches[0][1], label=name, **(look | {"markersize": 2.5}))
            continue
        banded = True
        # The bound ripples over the distance of one step: the largest value of each ripple, and its range.
        middles = np.array([0.5 * (labels[0] + labels[-1]) for labels, _ in stretches]) / 1e3
        most = np.array([bounds.max() for _, bounds in stretches])
        minimum = np.array([bounds.min() for _, bounds in stretches])
        axes.fill_between(middles, minimum, most, facecolor=look["color"], alpha=0.16, linewidth=0.0)
        axes.plot(middles, most, label=name, markersize=3.0, **look)
    pair = lower.pair
    axes.plot(pair.label_m / 1e3, pair.bound_m, marker="*", markersize=9.0, color=INK, linestyle="none", zorder=5)
    place: dict[str, Any] = {"xytext": (7.0, 3.0), "textcoords": "offset points"}
    axes.annotate(f"{pair.bound_m:.1f} m", (pair.label_m / 1e3, pair.bound_m), color=INK, **place)
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + (0.75 if banded else 0.5) * (high - low))  # space for the legend
    axes.set_title("(a) bound for all strategies")
    axes.set_xlabel("label: range at $t = 0$, km")
    axes.set_ylabel("lower bound of the guaranteed miss, m")
    handles, names = axes.get_legend_handles_labels()
    if banded:
        handles.append(Patch(facecolor=LIMIT, alpha=0.25))
        names.append("spread over labels within one step")
    axes.legend(handles, names, title="closing speed", loc="upper right")


def _draw_pair(axes: Axes, scenario: Scenario, lower: LowerBound) -> None:
    pair, model = lower.pair, scenario.set_model
    end = pair.track_m[:, -1]
    half = np.divide(end, np.linalg.norm(end), out=np.zeros_like(end), where=end != 0.0) @ pair.track_m
    to_go = pair.arrival_s - pair.times_s
    alike_until = pair.arrival_s - pair.last_common_step * model.step_s
    shown = float(to_go[0]) if pair.is_single else min(_SECONDS_SHOWN * alike_until + 2.0 * model.step_s, to_go[0])
    top = float(half[-1])
    if not pair.is_single:
        top = max(top, _draw_equal_measurements(axes, scenario, pair, shown))
    given_s, sizes = later_impulses(scenario, -1 if pair.is_single else pair.last_common_step, pair.arrival_s)
    corrected = half - np.maximum(pair.times_s[:, None] - given_s, 0.0) @ sizes
    after = to_go <= (np.inf if pair.is_single else alike_until + 1e-9)
    without = "no impulses" if pair.is_single else "first true state, equal impulses"
    looks: tuple[tuple[float, dict[str, Any], str], ...] = (
        (1.0, {"color": "#7f2704", "linestyle": "-"}, without),
        (-1.0, {"color": "#08306b", "linestyle": (0, (4, 1.5))}, "second true state"),
    )
    for sign, look, name in looks[: 1 if pair.is_single else 2]:
        axes.plot(to_go, sign * half, marker=None if pair.is_single else "o", markersize=2.2, label=name, **look)
        axes.plot(to_go[after], sign * corrected[after], color=look["color"], linewidth=0.8, linestyle=":")
    axes.plot([], [], color=INK, linewidth=0.8, linestyle=":", label="with the largest correction")
    top *= 1.12
    if not pair.is_single:
        axes.axvline(alike_until, ymax=0.6, color=LIMIT, linewidth=0.8, linestyle="--")
        place: dict[str, Any] = {"ha": "left", "va": "bottom", "fontsize": 7.0}
        axes.text(alike_until, -0.93 * top, "  measurements\n  equal until here", color=LIMIT, **place)
    _bracket(axes, shown, float(half[-1]), pair.correction_m)
    axes.set_xlim(shown, -0.3 * shown)
    axes.set_ylim(0.0 if pair.is_single else -top, 1.4 * top)
    axes.set_xticks([tick for tick in axes.get_xticks() if 0.0 <= tick <= shown])
    axes.set_xlabel("time to arrival, s")
    what = "offset" if scenario.is_spatial else "$z$"
    if pair.is_single:
        axes.set_title("(b) true state that proves the bound")
        axes.set_ylabel(f"{what} without impulses, m")
    else:
        axes.set_title("(b) pair of true states that proves the bound")
        axes.set_ylabel(f"{what} relative to the midpoint, m")
    axes.legend(loc="upper right", handlelength=2.0, borderaxespad=0.2)


def _draw_strategies(axes: Axes, bound_m: float, worst_m: Mapping[str, float]) -> None:
    """Draw the maximum misses found, the minimum at the top, against the bound."""
    rows = sorted(worst_m.items(), key=lambda item: item[1])
    maximum = max(bound_m, rows[-1][1])
    texts = [f"{name}, {number(miss_m)} m" for name, miss_m in rows]
    width_mm = _COLUMN_MM - _LEFT_MM - _RIGHT_MM
    # Each text must fit between its mark and the right side.
    places = [max(0.3, 0.97 - _MM_A_CHARACTER * len(text) / width_mm) for text in texts]
    if bound_m > 0.0 and maximum > _WIDE * bound_m:
        low = bound_m / (maximum / bound_m) ** 0.2
        high = max(low * (miss_m / low) ** (1.0 / place) for place, (_, miss_m) in zip(places, rows, strict=True))
        axes.set_xscale("log")
        ticks = [digit * 10.0**power for power in range(-3, 10) for digit in (1, 2, 5)]
        axes.set_xticks([tick for tick in ticks if low < tick < 2.0 * maximum])
        axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axes.xaxis.set_minor_locator(NullLocator())
    else:
        low, high = 0.0, max(miss_m / place for place, (_, miss_m) in zip(places, rows, strict=True)) or 1.0
    axes.axvspan(low, bound_m, color="#e8e8e8", linewidth=0.0)
    axes.axvline(bound_m, color=INK, linewidth=1.2)
    beside: dict[str, Any] = {"xytext": (-2.0, 0.0), "textcoords": "offset points", "rotation": 90.0}
    name = "bound" if len(rows) < _ROWS_OF_NAME else f"bound, {number(bound_m)} m"
    axes.annotate(name, (bound_m, 0.5 * (len(rows) - 1)), ha="right", va="center", fontsize=7.0, **beside)
    for row, (text, (_, miss_m)) in enumerate(zip(texts, rows, strict=True)):
        axes.plot([bound_m, miss_m], [row, row], color=SET_EDGE, linewidth=0.8)
        axes.plot(miss_m, row, marker="o", markersize=4.0, color=TRUTH)
        axes.annotate(text, (miss_m, row), xytext=(5.0, 0.0), textcoords="offset points", va="center", fontsize=7.0)
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.set_yticks([])
    axes.set_xlim(low, high)
    axes.set_title("(c) strategies against the bound")
    axes.set_xlabel("maximum miss found, m")
    separate_labels(axes)


def _draw_equal_measurements(axes: Axes, scenario: Scenario, pair: TruthPair, shown: float) -> float:
    """Draw the limits of the offset of each state with equal measurements; return the maximum one, m."""
    model = scenario.set_model
    end = pair.track_m[:, -1]
    direction = np.divide(end, np.linalg.norm(end), out=np.zeros_like(end), where=end != 0.0)
    fine = np.linspace(0.0, shown, 200)
    ranges = -pair.vx_m_s * fine
    bounds = np.array([model.angle_sensor.axis(name).error_bound(ranges) for name in model.axes])
    corridor = np.abs(direction) @ bounds * ranges
    seen = fine >= pair.arrival_s - pair.last_common_step * model.step_s
    axes.fill_between(
        fine[seen], -corridor[seen], corridor[seen], facecolor=SET_FILL, linewidth=0.0, label="equal measurements"
    )
    axes.plot(fine, corridor, color=SET_EDGE, linewidth=0.7, linestyle=":")
    axes.plot(fine, -corridor, color=SET_EDGE, linewidth=0.7, linestyle=":")
    return float(corridor[-1])


def _bracket(axes: Axes, shown: float, half: float, correction: float) -> None:
    """Mark at the arrival the largest correction and the bound."""
    at, bound = -0.03 * shown, max(half - correction, 0.0)
    for low, high, colour, text in (
        (0.0, bound, INK, f"bound\n{bound:.1f} m"),
        (bound, half, LIMIT, f"correction\n{half - bound:.1f} m"),
    ):
        arrow = {"arrowstyle": "<->", "color": colour, "linewidth": 0.9, "shrinkA": 0.0, "shrinkB": 0.0}
        axes.annotate("", (at, high), xytext=(at, low), arrowprops=arrow)
        axes.text(at - 0.02 * shown, 0.5 * (low + high), text, ha="left", va="center", color=colour, fontsize=7.0)
