"""Distribution functions of the miss and of the impulse spent: the paper's figure 4.

Sizes and margins without a reason were chosen by eye (`figure_style`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from infoset.arrays import Floats
from infoset.experiments.common.figure_style import (
    CURVE_LOOKS,
    LIMIT,
    legend_below,
    letters,
    plain_ticks,
    style,
    subplots,
)
from infoset.experiments.common.screen import some_runs
from infoset.experiments.interception.figures.shared import RADIUS, radius_name
from infoset.experiments.interception.published import ONE_RUN_START
from infoset.experiments.interception.study import Curve
from infoset.sim import Body, empirical_distribution

MAX_POINTS = 2000
"""Maximum number of points of a curve: a panel has fewer pixels."""

_DOTTED: dict[str, Any] = {"linestyle": (0, (1, 1.2)), "linewidth": 0.9}
_RUN: dict[str, Any] = {
    "marker": "^",
    "markersize": 7.0,
    "linestyle": "none",
    "zorder": 4.0,
    "clip_on": False,
}
_BAND = "95 % confidence band (Dvoretzky-Kiefer-Wolfowitz)"
_LOGARITHMIC_FROM = 50.0
"""Ratio of the end of the axis of the miss to the smallest median above which it is logarithmic; on
a linear axis this median would be in the first 2 % of it.

The radius of the body counts as a median.
"""
_MIN_SHOWN = 0.01
"""Quantile at which a logarithmic axis starts: misses can be arbitrarily small. Chosen."""


@dataclass(frozen=True, eq=False)
class Sample:
    """Runs that are drawn as one curve, with the entry `name` in the legend.

    The known values of the guaranteed miss are drawn with a dotted line.
    """

    name: str
    look: dict[str, Any]
    miss_m: Floats
    impulse_m_s: Floats
    guaranteed_miss_m: Floats = field(default_factory=lambda: np.zeros(0))
    guaranteed_name: str = ""


def draw_distributions(
    curves: Sequence[Curve],
    body: Body | None = None,
    printed: Mapping[str, tuple[float, float]] | None = None,
    *,
    numbered: bool = False,
) -> Figure:
    """Draw the distribution functions of the curves of the experiment with `draw_samples`.

    `printed` are the miss, m, and the impulse, m/s, of the run that the paper prints for a noise
    (`published.ONE_RUN`): without a range sensor, from `ONE_RUN_START`. They are marks in the
    colour of the curve of this noise without that sensor. If `numbered`, the curves have their
    numbers in the paper's figure 4.
    """
    samples = []
    runs = []
    for curve in curves:
        sensor = "with" if curve.range_sensor else "no"
        name = f"{curve.noise} noise, {sensor} range sensor, {some_runs(len(curve.results))}"
        if numbered:
            name = f"{curve.number}  {name}"
        samples.append(
            Sample(name, CURVE_LOOKS[curve.number], curve.results.miss_m, curve.results.impulse_m_s)
        )
        if printed and curve.noise in printed and not curve.range_sensor:
            miss_m, impulse_m_s = np.array(printed[curve.noise])[:, None]
            title = f"printed: one run from {ONE_RUN_START}, {curve.noise} noise"
            runs.append(
                Sample(title, {"color": CURVE_LOOKS[curve.number]["color"]}, miss_m, impulse_m_s)
            )

    return draw_samples(samples, body, runs)


@style()
def draw_samples(
    samples: Sequence[Sample], body: Body | None = None, runs: Sequence[Sample] = ()
) -> Figure:
    """Draw the distribution functions of (a) the miss and (b) the impulse spent.

    They have their 95 % confidence bands.

    Where a few values are far beyond the others, the axis ends before them and its label says how
    many; where the curves or the radius lie far apart, the axis of the miss is logarithmic. The
    radius of the body (`radius_name`) is a line in (a). Single runs are marks on the axes.
    """
    figure, (panels,) = subplots(85.0, 1, 2, sharey=True)
    left, right = panels
    misses = [sample.miss_m for sample in samples]
    impulses = [sample.impulse_m_s for sample in samples]
    bounds = [sample.guaranteed_miss_m for sample in samples if sample.guaranteed_miss_m.size]
    scale_misses(left, [*misses, *bounds], None if body is None else body.inscribed_m)
    # Marks are not clipped: one beyond the end of the axis would be drawn outside of the figure.
    farthest_m = max((float(run.miss_m.max()) for run in runs), default=0.0)
    left.set_xlim(right=max(left.get_xlim()[1], 1.04 * farthest_m))
    minimum = min(float(each.min()) for each in impulses)
    limit = max([axis_limit(impulses), *(float(run.impulse_m_s.max()) for run in runs)])
    margin = 0.05 * (limit - minimum) or 0.5
    right.set(xlim=(max(0.0, minimum - margin), limit + margin), ylim=(-0.02, 1.02))

    for sample in samples:
        _draw_curve(left, sample.miss_m, sample.look, sample.name)
        _draw_curve(right, sample.impulse_m_s, sample.look, sample.name)
        if sample.guaranteed_miss_m.size:
            dotted = sample.look | _DOTTED
            name = sample.guaranteed_name
            _draw_curve(left, sample.guaranteed_miss_m, dotted, name, banded=False)

    for run in runs:
        left.plot(run.miss_m, [0.0], label=run.name, **_RUN | run.look)
        right.plot(run.impulse_m_s, [0.0], **_RUN | run.look)
    left.fill_between([], [], facecolor=LIMIT, alpha=0.3, label=_BAND)
    draw_radius(left, body)

    left.set_ylabel("share of runs")
    letters(panels, ("miss", "impulse spent"))
    beyond = [*_beyond(left, "runs", misses), *_beyond(left, "guaranteed misses", bounds)]
    left.set_xlabel("\n".join(["miss, m", *beyond]))
    right.set_xlabel("\n".join(["impulse spent, m/s", *_beyond(right, "runs", impulses)]))
    legend_below(figure, 2)
    return figure


def scale_misses(axes: Axes, samples: Sequence[Floats], radius_m: float | None) -> None:
    """Scale the axis of the misses so that every sample is visible, and a radius within the axis.

    The axis does not extend to a greater radius. It is logarithmic if the smallest median or the
    radius is small beside its end (`_LOGARITHMIC_FROM`), and linear if one of them is 0.
    """
    sizes = [float(np.median(sample)) for sample in samples]
    if radius_m is not None:
        sizes.append(radius_m)
    if not 0.0 < _LOGARITHMIC_FROM * min(sizes) < axis_limit(samples):
        axes.set_xlim(0.0, 1.04 * axis_limit(samples) or 0.5)
        return
    firsts = [float(np.quantile(sample[sample > 0.0], _MIN_SHOWN)) for sample in samples]
    low = 0.5 * min(*firsts, *sizes)
    high = 2.0 * max(float(sample.max()) for sample in samples)
    axes.set(xscale="log", xlim=(low, high))
    plain_ticks(axes.xaxis)


def axis_limit(samples: Sequence[Floats]) -> float:
    """Return the end of an axis: beyond all values, or of all but a few very large ones.

    The upper fence of a sample is its upper quartile plus three times the distance between its
    quartiles, beyond which values are far out (Tukey). If the maximum of all values is at most
    twice the farthest fence, the axis ends at this maximum; otherwise at the greatest value within
    1.5 times this fence. Values are not negative. The factors are chosen: the axis is not cut off
    for a few values that would only double it.
    """
    quartiles = [np.quantile(sample, (0.25, 0.75)) for sample in samples]
    fence = max(float(upper + 3.0 * (upper - lower)) for lower, upper in quartiles)
    maximum = max(float(sample.max()) for sample in samples)
    if maximum <= 2.0 * fence:
        return maximum
    return max(float(sample[sample <= 1.5 * fence].max(initial=0.0)) for sample in samples)


def _beyond(axes: Axes, name: str, samples: Sequence[Floats]) -> list[str]:
    """Return a note with the number of values beyond a horizontal axis, if there are any."""
    count = sum(int((sample > axes.get_xlim()[1]).sum()) for sample in samples)
    if not count:
        return []
    return [f"{name} beyond the axis: {count} of {sum(sample.size for sample in samples)}"]


def draw_radius(axes: Axes, body: Body | None) -> None:
    """Draw the radius of a body (`radius_name`) as a line on a scaled axis of misses."""
    if body is None:
        return
    radius_m = body.inscribed_m
    label = radius_name(body)
    look = RADIUS | {"transform": axes.get_xaxis_transform()}
    if radius_m <= axes.get_xlim()[1]:
        axes.plot(
            [radius_m, radius_m], [0.0, 1.0], label=f"{label}: a smaller miss is a hit", **look
        )
    else:
        axes.plot([], [], label=f"{label}: beyond the axis", **look)


def _draw_curve(
    axes: Axes, values: Floats, look: dict[str, Any], label: str, *, banded: bool = True
) -> None:
    """Draw a distribution function over axes with final limits, and its confidence band."""
    every = empirical_distribution(values)
    kept = np.unique(np.linspace(0, values.size - 1, min(values.size, MAX_POINTS)).astype(np.int64))
    rising = every.values[kept]
    end = max(float(values.max()), axes.get_xlim()[1])

    if banded:
        band: dict[str, Any] = {
            "facecolor": look["color"],
            "alpha": 0.15,
            "linewidth": 0.0,
            "step": "post",
        }
        axes.fill_between(rising, every.lower[kept], every.upper[kept], **band)

    shares = [0.0, *every.probability[kept], 1.0]
    axes.plot(
        [rising[0], *rising, end], shares, drawstyle="steps-post", zorder=3.0, label=label, **look
    )
