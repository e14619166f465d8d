"""Distribution functions of the miss and of the impulse spent: the paper's figure 4."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import zip_longest
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.legend_handler import HandlerTuple
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, NullFormatter

from experiments.common.figure_style import CURVE_LOOKS, INK, figure_grid, separate_labels, style, width_mm
from experiments.common.screen import some_runs
from experiments.interception.curves import Curve
from infoset.arrays import Floats
from sim import empirical_distribution

_HEIGHT_MM, _NUMBER_MM = 60.0, 5.0
"""Height of the axes, and diameter of a curve number, mm."""

_LEVELS = np.linspace(0.15, 0.85, 29)
_INSIDE = 0.05, 0.95
"""Horizontal range of curve numbers, as shares of the axes."""

MAX_POINTS = 2000
"""Most points of a curve; more would only make the file larger."""
_NUMBER_LOOK: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": 8.0, "fontweight": "bold", "zorder": 5}
_NUMBER_BOX: dict[str, Any] = {"boxstyle": "circle,pad=0.18", "facecolor": "white", "linewidth": 0.8}
_DOTTED: dict[str, Any] = {"linestyle": (0, (1, 1.2)), "linewidth": 0.9}
RADIUS_LOOK: dict[str, Any] = {"color": INK, "linestyle": (0, (6, 1.5, 1, 1.5)), "linewidth": 0.9}
"""Line of the radius of the body."""

_LOGARITHMIC_FROM = 30.0
_MIN_SHOWN = 0.01
"""Quantile at which a logarithmic axis starts: misses can be arbitrarily small."""


@dataclass(frozen=True, eq=False)
class Sample:
    """Runs that are drawn as one curve, with the entry `name` in the legend.

    The known values of the guaranteed miss are drawn with a dotted line. The number is written on the curve; 0 is none.
    """

    name: str
    look: dict[str, Any]
    miss_m: Floats
    impulse_m_s: Floats
    guaranteed_miss_m: Floats = field(default_factory=lambda: np.zeros(0))
    guaranteed_name: str = ""
    number: int = 0


def draw_distributions(curves: Sequence[Curve], radius_m: float | None = None) -> Figure:
    """Draw the distribution functions of the curves of the experiment with `draw_samples`, each with its number."""
    return draw_samples([_sample(curve) for curve in curves], radius_m)


def _sample(curve: Curve) -> Sample:
    meter = "with" if curve.range_sensor else "no"
    name = f"{curve.number}  {curve.noise.value} noise, {meter} range sensor, {some_runs(len(curve.results))}"
    results = curve.results
    return Sample(name, CURVE_LOOKS[curve.number], results.miss_m, results.impulse_m_s, number=curve.number)


@style()
def draw_samples(samples: Sequence[Sample], radius_m: float | None = None) -> Figure:
    """Draw the distribution functions of (a) the miss and (b) the impulse spent, with their 95 % confidence bands.

    Where a few values are far beyond the others, the axis ends before them and says how many; where the curves lie
    decades apart, the axis of the miss is logarithmic. The radius of the body, m, is a line in (a).
    """
    if not samples:
        raise ValueError("at least one curve is needed")
    figure, (left, right) = figure_grid(_HEIGHT_MM + 38.0, 1, 2, (14.0, 4.0, 31.0, 7.0), (7.0, 0.0))
    _draw_panel(left, samples, [sample.miss_m for sample in samples], [sample.guaranteed_miss_m for sample in samples])
    _draw_panel(right, samples, [sample.impulse_m_s for sample in samples])
    right.yaxis.label.set_visible(False)
    right.tick_params(labelleft=False)
    handles: list[Any] = []
    labels = []
    for sample in samples:
        handles.append(Line2D([], [], **sample.look))
        labels.append(sample.name)
        if sample.guaranteed_miss_m.size:
            handles.append(Line2D([], [], **sample.look | _DOTTED))
            labels.append(sample.guaranteed_name)
    # The legend fills its first column first: the band ends that column, so that each column has half of the curves.
    at = len(handles) if len(handles) % 2 else len(handles) // 2
    handles.insert(at, tuple(Line2D([], [], color=sample.look["color"], linewidth=0.7) for sample in samples))
    labels.insert(at, "thin lines: 95 % confidence band (Dvoretzky-Kiefer-Wolfowitz)")
    for line in draw_radius(left, radius_m):
        handles.append(line)
        labels.append(str(line.get_label()))
    for axes in (left, right):
        separate_labels(axes)
    spread = {tuple: HandlerTuple(ndivide=None, pad=0.15)}
    figure.legend(handles, labels, loc="lower center", ncols=2, columnspacing=2.5, handler_map=spread)
    return figure


def draw_radius(axes: Axes, radius_m: float | None) -> list[Line2D]:
    """Draw the radius of the body as a line on an axis of misses, and return its entry in the legend."""
    if radius_m is None:
        return []
    low, high = axes.get_xlim()
    inside = low <= radius_m <= high
    if inside:
        axes.axvline(radius_m, zorder=2.5, label="_radius", **RADIUS_LOOK)
    where = "a smaller miss is a hit" if inside else "beyond the axis"
    return [Line2D([], [], label=f"body radius, {radius_m:g} m: {where}", **RADIUS_LOOK)]


def axis_limit(samples: Sequence[Floats]) -> float:
    """Return the end of an axis: beyond all values, or of all but a few very large ones.

    It is the maximum value if that is at most twice the farthest upper fence (upper quartile and three times the
    distance between the quartiles) of the samples, else the maximum value within half as much again as that fence.
    """
    quartiles = [np.quantile(sample, (0.25, 0.75)) for sample in samples]
    fence = max(float(upper + 3.0 * (upper - lower)) for lower, upper in quartiles)
    maximum = max(float(sample.max()) for sample in samples)
    if maximum <= 2.0 * fence:
        return maximum
    return max(float(sample[sample <= 1.5 * fence].max(initial=0.0)) for sample in samples)


def decades_apart(samples: Sequence[Floats]) -> bool:
    """Whether samples differ so much that a linear axis would show some of them only at its end.

    The maximum median is then more than thirty times the minimum, and the minimum is not zero.
    """
    medians = [float(np.median(sample)) for sample in samples]
    return min(medians) > 0.0 and max(medians) > _LOGARITHMIC_FROM * min(medians)


def scale_axis(axes: Axes, samples: Sequence[Floats], *, from_zero: bool) -> tuple[float, float]:
    """Scale the axis of the values so that every sample is visible, and return its limits.

    Only an axis that starts at zero becomes logarithmic, where the samples are decades apart.
    """
    if from_zero and decades_apart(samples):
        maximum = max(float(sample.max()) for sample in samples)
        left = min(float(np.quantile(sample[sample > 0.0], _MIN_SHOWN)) for sample in samples)
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(FuncFormatter(lambda tick, _: f"{tick:g}"))
        axes.xaxis.set_minor_formatter(NullFormatter())
        left, right = 0.5 * left, 2.0 * maximum
    else:
        minimum, limit = min(float(sample.min()) for sample in samples), axis_limit(samples)
        left = 0.0 if from_zero else max(0.0, minimum - 0.08 * (limit - minimum))
        right = limit + (0.04 * (limit - left) or 0.5)
    axes.set_xlim(left, right)
    axes.set_ylim(-0.02, 1.02)
    return left, right


def draw_band(axes: Axes, values: Floats, lower: Floats, upper: Floats, colour: str, label: str = "_band") -> None:
    """Draw the two thin edges of a confidence band at and after each of the rising values, away from 0 and 1."""
    look: dict[str, Any] = {"color": colour, "linewidth": 0.5, "alpha": 0.75, "zorder": 2.0, "label": label}
    for edge, empty in ((lower, 0.0), (upper, 1.0)):
        axes.plot(values, np.where(edge == empty, np.nan, edge), drawstyle="steps-post", **look)


def _draw_panel(
    axes: Axes, samples: Sequence[Sample], known: Sequence[Floats], guaranteed: Sequence[Floats] = ()
) -> None:
    """Draw the distributions of the misses, with the guaranteed ones, or of the impulses."""
    title, label = ("(a) miss", "miss, m") if guaranteed else ("(b) impulse spent", "impulse spent, m/s")
    everything = [*known, *(values for values in guaranteed if values.size)]
    ends = scale_axis(axes, everything, from_zero=bool(guaranteed))
    for sample, values in zip(samples, known, strict=True):
        _draw_curve(axes, sample.look, values, ends, sample.number)
    for sample, values in zip(samples, guaranteed, strict=False):
        if values.size:
            _draw_curve(axes, sample.look | _DOTTED, values, ends)
    if samples[0].number:
        _number(axes, samples, known)
    notes = [
        beyond("runs", known, ends[1], [sample.number for sample in samples]),
        beyond("dotted", guaranteed, ends[1]),
    ]
    axes.set_title(title)
    axes.set_xlabel("\n".join([label, *filter(None, notes)]))
    axes.set_ylabel("distribution function (share of runs)")


def beyond(name: str, samples: Sequence[Floats], right: float, numbers: Sequence[int] = ()) -> str:
    """Return a note with the number of values beyond an axis, or an empty text without such values."""
    counts = [
        f"{int((sample > right).sum())} of {sample.size}{f' of curve {number}' if number else ''}"
        for sample, number in zip_longest(samples, numbers)
        if (sample > right).any()
    ]
    return f"{name} beyond the axis: {', '.join(counts)}" if counts else ""


def _draw_curve(
    axes: Axes, look: dict[str, Any], sample: Floats, ends: tuple[float, float], number: int | None = None
) -> None:
    """Draw a distribution function; without a number, no confidence band."""
    every = empirical_distribution(sample)
    kept = np.unique(np.linspace(0, sample.size - 1, min(sample.size, MAX_POINTS)).astype(np.int64))
    values, share = every.values[kept], every.probability[kept]
    if number is not None:
        draw_band(axes, values, every.lower[kept], every.upper[kept], look["color"], f"band {number}")
    values = np.concatenate([[min(ends[0], float(values[0]))], values, [max(ends[1], float(values[-1]))]])
    label = f"curve {number}"
    axes.plot(values, np.concatenate([[0.0], share, [1.0]]), drawstyle="steps-post", zorder=3.0, label=label, **look)


def _number(axes: Axes, curves: Sequence[Sample], samples: Sequence[Floats]) -> None:
    """Put the number of each curve where it is farthest from the other curves and numbers."""
    logarithmic = axes.get_xscale() == "log"
    (low, high), across = axes.get_xlim(), np.log if logarithmic else np.asarray
    grid = np.geomspace(low, high, 200) if logarithmic else np.linspace(low, high, 200)
    size = np.array([width_mm(axes), _HEIGHT_MM])
    tracks, paths = [], []
    for sample in samples:
        shown = np.maximum(np.quantile(sample, _LEVELS), low)
        track = np.column_stack([(across(shown) - across(low)) / (across(high) - across(low)), _LEVELS])
        share = np.searchsorted(np.sort(sample), grid, side="right") / len(sample)
        inside = (track[:, 0] > _INSIDE[0]) & (track[:, 0] < _INSIDE[1])
        tracks.append(track[inside] if inside.any() else np.column_stack([np.clip(track[:, 0], *_INSIDE), _LEVELS]))
        paths.append(np.concatenate([track, np.column_stack([np.linspace(0.0, 1.0, len(grid)), share])]) * size)
    placed: list[Floats] = []
    for index, (curve, track) in enumerate(zip(curves, tracks, strict=True)):
        room = np.zeros(len(track))
        for other in paths[:index] + paths[index + 1 :]:
            room += np.minimum(_gaps(track * size, other), 2.0 * _NUMBER_MM)
        for spot in placed:
            gaps = _gaps(track * size, spot[None, :] * size)
            room += np.where(gaps < 1.6 * _NUMBER_MM, -100.0, 0.1 * gaps)
        room -= 1e-3 * np.abs(track[:, 1] - 0.5)
        spot = track[room.argmax()]
        placed.append(spot)
        colour = curve.look["color"]
        look = _NUMBER_LOOK | {
            "transform": axes.transAxes,
            "color": colour,
            "bbox": _NUMBER_BOX | {"edgecolor": colour},
        }
        axes.text(float(spot[0]), (float(spot[1]) + 0.02) / 1.04, str(curve.number), **look)


def _gaps(points: Floats, others: Floats) -> Floats:
    """Return the distance of each point to the nearest of the others."""
    return np.asarray(np.hypot(*(points[:, None, :] - others[None, :, :]).transpose(2, 0, 1)).min(axis=1))
