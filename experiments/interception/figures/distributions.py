"""Distribution functions of the miss and of the impulse spent: the paper's figure 4."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.legend_handler import HandlerTuple
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, NullFormatter
from numpy.typing import NDArray

from experiments.common.figure_style import CURVE_LOOKS, INK, new_figure, place_axes, style, width_mm
from experiments.interception.curves import Curve
from sim import empirical_distribution

Floats = NDArray[np.float64]

_HEIGHT_MM, _NUMBER_MM = 59.0, 5.0
"""Height of the axes, and diameter of a curve number, mm."""

_LEVELS = np.linspace(0.15, 0.85, 29)
_INSIDE = 0.05, 0.95
"""Horizontal range of curve numbers, as shares of the axes."""

RADIUS_LOOK: dict[str, Any] = {"color": INK, "linestyle": (0, (6, 1.5, 1, 1.5)), "linewidth": 0.9}
"""Line of the radius of the body."""

_LOGARITHMIC_FROM = 30.0
_LEAST_SHOWN = 0.01
"""Quantile at which a logarithmic axis starts: misses can be arbitrarily small."""


def draw_distributions(curves: Sequence[Curve], confidence: float = 0.95, radius_m: float | None = None) -> Figure:
    """Draw the distribution functions of (a) the miss and (b) the impulse spent, with their confidence bands.

    Where a few values are far beyond the others, the axis ends before them and says how many; where the curves lie
    decades apart, the axis of the miss is logarithmic.

    Parameters
    ----------
    confidence : float
        Of the Dvoretzky-Kiefer-Wolfowitz bands, in (0, 1).
    radius_m : float or None
        Radius of the body, m, which is a line in (a); None draws none.
    """
    if not curves:
        raise ValueError("at least one curve is needed")
    with style():
        figure = new_figure(height_mm=36.0 + _HEIGHT_MM)
        (row,) = place_axes(figure, 1, 2, margins_mm=(14.0, 4.0, 29.0, 7.0), gaps_mm=(7.0, 0.0))
        notes = (
            _draw_panel(row[0], curves, lambda curve: curve.results.miss_m, confidence, from_zero=True),
            _draw_panel(row[1], curves, lambda curve: curve.results.impulse_m_s, confidence, from_zero=False),
        )
        labels = ("miss, m", "impulse spent, m/s")
        for axes, title, label, note in zip(row, ("(a) miss", "(b) impulse spent"), labels, notes, strict=True):
            axes.set_title(title)
            axes.set_xlabel(f"{label}\n{note}" if note else label)
            axes.set_ylabel("distribution function (share of runs)")
        row[1].yaxis.label.set_visible(False)
        row[1].tick_params(labelleft=False)
        handles, names = _handles(curves, confidence)
        radius = draw_radius(row[0], radius_m)
        figure.legend(
            [*handles, *radius],
            [*names, *(str(line.get_label()) for line in radius)],
            loc="lower center",
            ncols=2,
            columnspacing=2.5,
            handler_map={tuple: HandlerTuple(ndivide=None, pad=0.15)},
        )
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

    It is the greatest value if that is at most twice the farthest upper fence (upper quartile and three times the
    distance between the quartiles) of the samples, else the greatest value within half as much again as that fence.
    """
    quartiles = [np.quantile(sample, (0.25, 0.75)) for sample in samples]
    fence = max(float(upper + 3.0 * (upper - lower)) for lower, upper in quartiles)
    greatest = max(float(sample.max()) for sample in samples)
    if greatest <= 2.0 * fence:
        return greatest
    return max(float(sample[sample <= 1.5 * fence].max(initial=0.0)) for sample in samples)


def decades_apart(samples: Sequence[Floats]) -> bool:
    """Whether samples differ so much that a linear axis would show some of them only at its end.

    The greatest median is then more than thirty times the least, and the least is not zero.
    """
    medians = [float(np.median(sample)) for sample in samples]
    return min(medians) > 0.0 and max(medians) > _LOGARITHMIC_FROM * min(medians)


def scale_axis(axes: Axes, samples: Sequence[Floats], *, from_zero: bool) -> tuple[float, float]:
    """Scale the axis of the values so that every sample is visible, and return its limits.

    Parameters
    ----------
    from_zero : bool
        Whether a linear axis starts at zero; only such an axis becomes logarithmic, where the samples are decades
        apart.
    """
    if from_zero and decades_apart(samples):
        greatest = max(float(sample.max()) for sample in samples)
        left = min(float(np.quantile(sample[sample > 0.0], _LEAST_SHOWN)) for sample in samples)
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(FuncFormatter(lambda tick, _: f"{tick:g}"))
        axes.xaxis.set_minor_formatter(NullFormatter())
        left, right = 0.5 * left, 2.0 * greatest
    else:
        least, limit = min(float(sample.min()) for sample in samples), axis_limit(samples)
        left = 0.0 if from_zero else max(0.0, least - 0.08 * (limit - least))
        right = limit + (0.04 * (limit - left) or 0.5)
    axes.set_xlim(left, right)
    axes.set_ylim(-0.02, 1.02)
    return left, right


def draw_band(axes: Axes, values: Floats, lower: Floats, upper: Floats, colour: str, label: str = "") -> None:
    """Draw the two thin edges of a confidence band, between its samples and away from 0 and 1.

    Parameters
    ----------
    values, lower, upper : ndarray, shape (n,)
        The samples in rising order, and the band at and after each.
    """
    for edge, empty in ((lower, 0.0), (upper, 1.0)):
        axes.plot(
            values,
            np.where(edge == empty, np.nan, edge),
            drawstyle="steps-post",
            color=colour,
            linewidth=0.5,
            alpha=0.75,
            zorder=2.0,
            label=label or "_band",
        )


def _draw_panel(
    axes: Axes, curves: Sequence[Curve], value: Callable[[Curve], Floats], confidence: float, *, from_zero: bool
) -> str:
    """Draw one distribution, and return a note about the values beyond the axis."""
    samples = [np.asarray(value(curve), dtype=np.float64) for curve in curves]
    left, right = scale_axis(axes, samples, from_zero=from_zero)
    for curve, sample in zip(curves, samples, strict=True):
        _draw_curve(axes, curve, sample, confidence, (left, right))
    _number(axes, curves, samples)
    beyond = [
        (curve.number, int((sample > right).sum()), len(sample)) for curve, sample in zip(curves, samples, strict=True)
    ]
    lost = [f"{count} of {runs} of curve {number}" for number, count, runs in beyond if count]
    return "runs beyond the axis: " + ", ".join(lost) if lost else ""


def _draw_curve(axes: Axes, curve: Curve, sample: Floats, confidence: float, ends: tuple[float, float]) -> None:
    distribution = empirical_distribution(sample, confidence)
    right = max(ends[1], float(distribution.values[-1]))
    look = CURVE_LOOKS[curve.number]
    draw_band(axes, distribution.values, distribution.lower, distribution.upper, look["color"], f"band {curve.number}")
    values = np.concatenate([[min(ends[0], float(distribution.values[0]))], distribution.values, [right]])
    probability = np.concatenate([[0.0], distribution.probability, [1.0]])
    axes.plot(values, probability, drawstyle="steps-post", zorder=3.0, label=f"curve {curve.number}", **look)


def _number(axes: Axes, curves: Sequence[Curve], samples: Sequence[Floats]) -> None:
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
        axes.text(
            float(spot[0]),
            (float(spot[1]) + 0.02) / 1.04,
            str(curve.number),
            transform=axes.transAxes,
            ha="center",
            va="center",
            fontsize=8.0,
            fontweight="bold",
            color=CURVE_LOOKS[curve.number]["color"],
            bbox={
                "boxstyle": "circle,pad=0.18",
                "facecolor": "white",
                "edgecolor": CURVE_LOOKS[curve.number]["color"],
                "linewidth": 0.8,
            },
            zorder=5,
        )


def _gaps(points: Floats, others: Floats) -> Floats:
    """Return the distance of each point to the nearest of the others."""
    return np.asarray(np.hypot(*(points[:, None, :] - others[None, :, :]).transpose(2, 0, 1)).min(axis=1))


def _handles(curves: Sequence[Curve], confidence: float) -> tuple[list[Any], list[str]]:
    """Return handles and labels of the legend; the band has the colours of all curves."""
    handles: list[Any] = [Line2D([], [], **CURVE_LOOKS[curve.number]) for curve in curves]
    labels = [
        f"{curve.number}  {curve.noise.value} noise, "
        f"{'with' if curve.range_meter else 'no'} range meter, {len(curve.results)} runs"
        for curve in curves
    ]
    middle = (len(handles) + 1) // 2
    colours = [CURVE_LOOKS[curve.number]["color"] for curve in curves]
    handles.insert(middle, tuple(Line2D([], [], color=colour, linewidth=0.7) for colour in colours))
    labels.insert(middle, f"thin lines: {100.0 * confidence:g} % confidence band (Dvoretzky-Kiefer-Wolfowitz)")
    return handles, labels
