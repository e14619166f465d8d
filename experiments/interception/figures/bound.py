"""The lower bound of the miss: over the label, its pair, and strategies against it.

Sizes and margins without a reason were chosen by eye (`figure_style`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from infoset.arrays import Floats
from infoset.experiments.common.figure_style import (
    BOUND,
    CURVE_LOOKS,
    INK,
    REGION_FILL,
    SET_EDGE,
    SET_FILL,
    letters,
    style,
    subplots,
)
from infoset.experiments.common.screen import number
from infoset.experiments.interception.study import some_wrong_images
from infoset.sim import Scenario
from infoset.sim.bound.lower_bound import LowerBound
from infoset.sim.bound.pair_of_motions import TruthPair, later_impulses

_FIRST = CURVE_LOOKS[3]
_SECOND = CURVE_LOOKS[2]
_LOOKS = tuple(
    {"color": look["color"], "marker": marker, "markersize": 3.0}
    for look, marker in zip((_FIRST, CURVE_LOOKS[1], _SECOND), "os^", strict=True)
)
_CORRECTED: dict[str, Any] = {"linewidth": 0.8, "linestyle": ":"}
_COLUMN_MM = 88.0
"""Width of the figure: one column of a page."""
_WIDE = 8.0
"""Ratio of the maximum miss to the bound, if it is not 0, above which the axis is logarithmic.

On a linear axis the bound would be in the first tenth.
"""
_SECONDS_SHOWN = 3.0
"""Length of the time axis of (b), in units of the time from the last equal measurement to the
arrival; chosen: this time then has a third of the axis.
"""


@style()
def draw_bound(
    scenario: Scenario, lower: LowerBound, worst_m: Mapping[str, float] | None = None
) -> Figure:
    """Draw the bound in one column: over the label, its proof, and misses of strategies.

    Panel (a) has one curve per closing speed, (b) the motions of the pair, (c) the maximum misses
    found, `worst_m`, m, by the name of the strategy; without them it is left out. The bound is the
    result of `lower_bound` for this scenario. In space, (b) has the offset of the two states along
    the direction of their difference at x = 0. A bound by a single motion has its offset from the x
    axis.
    """
    # Each panel with its labels, mm; a strategy is a line of 6 mm. Chosen.
    heights_mm = [75.0, 85.0]
    if worst_m:
        heights_mm.append(20.0 + 6.0 * len(worst_m))
    figure, grid = subplots(
        sum(heights_mm), len(heights_mm), height_ratios=heights_mm, width_mm=_COLUMN_MM
    )
    panels = [*grid.flat]
    _draw_labels(panels[0], lower)
    _draw_pair(panels[1], scenario, lower)
    if worst_m:
        _draw_strategies(panels[2], lower.bound_m, worst_m)
    proof = "state that proves" if lower.pair.is_single else "states that prove"
    title = "bound for all strategies"
    wrong_images = scenario.set_model.wrong_images
    if wrong_images:
        title += f", {some_wrong_images(wrong_images)}"
    letters(panels, [title, f"{proof} the bound", "strategies and bound"])
    return figure


def _draw_labels(axes: Axes, lower: LowerBound) -> None:
    """Draw the bound over the label, for each closing speed, and mark its maximum."""
    # Up to three speeds: the ends of the interval of V_x and the nominal one.
    for look, speed in zip(_LOOKS, lower.speeds_m_s, strict=False):
        labels_m, bounds_m = lower.curve(speed)
        # No lines: the bound ripples over the distance of one step, and only some stretches of
        # labels are evaluated.
        axes.plot(
            labels_m / 1e3, bounds_m, label=f"{-speed / 1e3:g} km/s", linestyle="none", **look
        )

    pair = lower.pair
    label_km = pair.label_m / 1e3
    star: dict[str, Any] = {"marker": "*", "markersize": 9.0, "linestyle": "none"}
    axes.plot(label_km, pair.bound_m, color=INK, zorder=5, **star)
    place: dict[str, Any] = {"xytext": (7.0, 3.0), "ha": "left"}
    if 2.0 * label_km > sum(axes.get_xlim()):  # in the right half
        place = {"xytext": (-7.0, 3.0), "ha": "right"}
    axes.annotate(
        f"{pair.bound_m:.1f} m",
        (label_km, pair.bound_m),
        color=INK,
        textcoords="offset points",
        **place,
    )

    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.6 * (high - low))  # space for the legend
    axes.set(xlabel="label: range at $t = 0$, km", ylabel="bound of the miss, m")
    axes.legend(title="closing speed", loc="upper right")


def _draw_pair(axes: Axes, scenario: Scenario, lower: LowerBound) -> None:
    """Draw the motions of the pair that proves the bound, or its single motion."""
    pair = lower.pair
    step_s = scenario.set_model.step_s
    if pair.is_single:
        # No measurement matters: every impulse of the flight counts as a later one.
        alike_until = np.inf
        last_common_step = -1
        motions = [(1.0, "no impulses", _FIRST)]
        title = "offset without impulses, m"
    else:
        alike_until = pair.arrival_s - pair.last_common_step * step_s
        last_common_step = pair.last_common_step
        mark: dict[str, Any] = {"marker": "o", "markersize": 2.2}
        motions = [
            (1.0, "first state, equal impulses", _FIRST | mark),
            (-1.0, "second state", _SECOND | mark),
        ]
        title = "offset from the midpoint, m"

    # The offset of the first motion from the midpoint, or of a single motion from the x axis.
    half = _direction(pair) @ pair.track_m
    to_go = pair.arrival_s - pair.times_s
    shown = float(min(_SECONDS_SHOWN * alike_until + 2.0 * step_s, to_go[0]))
    top = float(half[-1])
    bottom = 0.0
    if not pair.is_single:
        top = max(top, _draw_equal_measurements(axes, scenario, pair, shown))
        axes.vlines(alike_until, -top, top, **BOUND)
        bottom = -1.12 * top

    given_s, sizes = later_impulses(scenario, last_common_step, pair.arrival_s)
    corrected = half - np.maximum(pair.times_s[:, None] - given_s, 0.0) @ sizes
    after = to_go <= alike_until + 1e-9  # with rounding errors of the times
    for sign, name, look in motions:
        axes.plot(to_go, sign * half, label=name, **look)
        axes.plot(to_go[after], sign * corrected[after], color=look["color"], **_CORRECTED)
    axes.plot(
        [], [], color=INK, label=f"corrected by at most {pair.correction_m:.1f} m", **_CORRECTED
    )

    axes.set(xlim=(shown, 0.0), ylim=(bottom, 2.2 * top))  # space for the legend
    axes.set(xlabel="time to go, s", ylabel=title)
    axes.legend(loc="upper right", fontsize="small", borderaxespad=0.2)


def _direction(pair: TruthPair) -> Floats:
    """Return the direction of the difference of the two states at x = 0; zeros if there is none."""
    end = pair.track_m[:, -1]
    return np.divide(end, np.linalg.norm(end), out=np.zeros_like(end), where=end != 0.0)


def _draw_strategies(axes: Axes, bound_m: float, worst_m: Mapping[str, float]) -> None:
    """Draw the maximum miss of each strategy beside the bound, the smallest on top."""
    rows = sorted(worst_m.items(), key=lambda item: item[1])
    places = np.arange(len(rows))
    misses = np.array([miss_m for _, miss_m in rows])
    maximum = max(bound_m, float(misses[-1]))
    axes.axvspan(0.0, bound_m, color=REGION_FILL, linewidth=0.0)
    axes.axvline(bound_m, color=INK, linewidth=1.2)
    axes.hlines(places, bound_m, misses, color=SET_EDGE, linewidth=0.8)
    axes.plot(
        misses, places, marker="o", markersize=4.0, linestyle="none", color=_LOOKS[1]["color"]
    )
    beside: dict[str, Any] = {"xytext": (5.0, 0.0), "textcoords": "offset points", "va": "center"}
    for place, miss_m in zip(places, misses, strict=True):
        axes.annotate(f"{number(miss_m)} m", (miss_m, place), fontsize="small", **beside)

    # Room for the numbers on the right: three tenths of the longest bar, or four tenths of the
    # decades between the bound and the maximum; chosen.
    if bound_m > 0.0 and maximum > _WIDE * bound_m:
        axes.set(xscale="log", xlim=(0.6 * bound_m, maximum * (maximum / bound_m) ** 0.4))
        axes.xaxis.set_major_formatter("{x:g}")
    else:
        axes.set_xlim(0.0, 1.3 * maximum or 1.0)
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.set_yticks(places, [name for name, _ in rows])
    axes.set_xlabel(f"maximum miss, m (bound {number(bound_m)} m)")


def _draw_equal_measurements(
    axes: Axes, scenario: Scenario, pair: TruthPair, shown: float
) -> float:
    """Draw the limits of the offset of each state with equal measurements.

    Return the largest limit, m, which is at the time `shown` before the arrival: it grows with the
    range. The band ends at the last image before the wrong ones.
    """
    model = scenario.set_model
    fine = np.linspace(0.0, shown, 200)  # for smooth curves
    ranges = -pair.vx_m_s * fine
    bounds = np.array([model.angle_sensor.axis(name).error_bound(ranges) for name in model.axes])
    corridor = np.abs(_direction(pair)) @ bounds * ranges
    wrong_steps = np.concatenate(pair.wrong_steps)
    # Wrong images do not limit the offset.
    last_limited = min([pair.last_common_step, *(wrong_steps - 1)])
    seen = fine >= pair.arrival_s - last_limited * model.step_s
    band: dict[str, Any] = {"facecolor": SET_FILL, "linewidth": 0.0, "label": "equal measurements"}
    axes.fill_between(fine[seen], -corridor[seen], corridor[seen], **band)
    for sign in (-1.0, 1.0):
        axes.plot(fine, sign * corridor, color=SET_EDGE, linewidth=0.7, linestyle=":")
    if len(wrong_steps):
        wrong_s = pair.arrival_s - wrong_steps * model.step_s
        cross: dict[str, Any] = {"marker": "x", "markersize": 4.0, "linestyle": "none"}
        axes.plot(wrong_s, np.zeros(len(wrong_s)), color=INK, label="image wrong in one", **cross)
    return float(corridor[-1])
