"""Engagements over time: the paper's figure 2."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from experiments.common.figure_style import (
    IMPULSE,
    INK,
    LIMIT,
    MEASURED,
    SET_EDGE,
    SET_FILL,
    TRUTH,
    WIDTH_MM,
    new_figure,
    place_axes,
    plain,
    style,
    width_mm,
)
from experiments.interception.record_titles import outcome_title, record_titles
from sim import Record

Floats = NDArray[np.float64]

ANGLE_RANGE_SHARE = 0.01
RATE_RANGE_SHARE = 0.1
"""Share of the first range below which values do not set the limits: angle and rate grow as 1/x and 1/x^2."""
FAR_SHARE = 0.3
MOST_GROWTH = 1.0
"""Nearer values extend the limits by at most this multiple of the extent at ranges above `FAR_SHARE` of the first."""

_ROWS = 4
_LETTER_MM, _LINE_MM = 1.8, 4.0
"""Mean width of a letter, and height of a line of a title, mm."""

_MOST_DECADES = 4
"""Number of decades up to which each decade has a label."""

_RAISED = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")


def draw_process(records: Sequence[Record]) -> Figure:
    """Draw angle, angular rate, impulse and predicted miss over time, one column per record.

    The axes of a row have the same limits. At least one record is needed.
    """
    if not records:
        raise ValueError("at least one record is needed")
    with style():
        gap = 7.0 if len(records) > 1 else 0.0
        letters = int((WIDTH_MM - 25.0 - gap * (len(records) - 1)) / len(records) / _LETTER_MM)
        titles = [
            "\n".join([*textwrap.wrap(title, letters), *textwrap.wrap(outcome_title(record), letters)])
            for title, record in zip(map(plain, record_titles(records)), records, strict=True)
        ]
        top = 4.0 + _LINE_MM * max(title.count("\n") + 1 for title in titles)
        figure = new_figure(height_mm=184.0 + top)
        grid = place_axes(figure, _ROWS, len(records), margins_mm=(21.0, 4.0, 24.0, top), gaps_mm=(gap, 4.0))
        for record, title, column in zip(records, titles, zip(*grid, strict=True), strict=True):
            _draw_sight(column[0], record, "angle", "true_angle_rad", 1e3)
            column[1].axhline(0.0, color=LIMIT, linewidth=0.6)
            _draw_sight(column[1], record, "rate", "true_rate_rad_s", 1e6)
            _draw_impulse(column[2], record)
            draw_predicted_miss(column[3], record)
            column[0].set_title(title, linespacing=1.3)
            column[-1].set_xlabel("time t, s")
        _level(grid[0], [_extent(each, "angle", "true_angle_rad", ANGLE_RANGE_SHARE) for each in records], scale=1e3)
        _level(grid[1], [_extent(each, "rate", "true_rate_rad_s", RATE_RANGE_SHARE) for each in records], scale=1e6)
        _level_impulse(grid[2], records)
        level_predicted_miss(grid[3], records)
        for record, column in zip(records, zip(*grid, strict=True), strict=True):
            _note_exit(column[0], _course(record, "true_angle_rad") * 1e3, record, 1.0, "mrad")
            _note_exit(column[1], _course(record, "true_rate_rad_s") * 1e6, record, 1e-3, "mrad/s")
        _finish(figure, grid, records)
    return figure


def _draw_sight(axes: Axes, record: Record, sensor: str, field: str, scale: float) -> None:
    """Draw a quantity of the line of sight, and its measurements as dots."""
    measured = [(step.time_s, step.measured[sensor]) for step in record.steps if sensor in step.measured]
    if measured:
        times, values = np.array(measured).T
        size = 6.0 if _marker(record) and sensor == "angle" else 3.0
        axes.plot(times, values * scale, ".", color=MEASURED, markersize=size, markeredgewidth=0.0)
    times, true = _course(record, "time_s"), _course(record, field)
    axes.plot(times, true * scale, color=TRUTH, marker=_marker(record), markersize=3.0)


def _draw_impulse(axes: Axes, record: Record) -> None:
    times, impulses = _course(record, "time_s"), _course(record, "impulse_m_s")
    greatest = record.scenario.thruster.greatest_impulse_m_s
    axes.axhline(0.0, color=LIMIT, linewidth=0.6)
    for limit in (-greatest, greatest):
        axes.axhline(limit, color=LIMIT, linewidth=0.8, linestyle=(0, (4, 2)))
    axes.annotate(
        f"greatest impulse ±{greatest:g} m/s",
        (0.985, greatest),
        xycoords=axes.get_yaxis_transform(),
        xytext=(0.0, 2.5),
        textcoords="offset points",
        ha="right",
        va="bottom",
    )
    given = impulses != 0.0
    axes.vlines(times[given], 0.0, impulses[given], color=IMPULSE, linewidth=0.9)
    axes.plot(times[given], impulses[given], ".", color=IMPULSE, markersize=2.2, markeredgewidth=0.0)


def draw_predicted_miss(axes: Axes, record: Record) -> None:
    """Draw the predicted-miss interval over time."""
    times, lower, upper = _predicted_miss(record)
    axes.axhline(0.0, color=LIMIT, linewidth=0.6)
    axes.fill_between(times, lower, upper, color=SET_FILL, linewidth=0.0)
    for bound in (lower, upper):
        axes.plot(times, bound, color=SET_EDGE, linewidth=0.9, marker=_marker(record), markersize=3.0)


def _level(row: Sequence[Axes], extents: Sequence[tuple[float, float]], scale: float) -> None:
    least = min(extent[0] for extent in extents) * scale
    greatest = max(extent[1] for extent in extents) * scale
    margin = 0.12 * (greatest - least) or 0.1 * abs(greatest) or 1.0
    for axes in row:
        axes.set_ylim(least - margin, greatest + 1.8 * margin)


def _level_impulse(row: Sequence[Axes], records: Sequence[Record]) -> None:
    greatest = max(record.scenario.thruster.greatest_impulse_m_s for record in records)
    for axes in row:
        axes.set_ylim(-1.2 * greatest, 1.35 * greatest)


def level_predicted_miss(row: Sequence[Axes], records: Sequence[Record]) -> None:
    """Give axes of predicted misses the same limits: linear to ten metres, logarithmic beyond."""
    bounds = np.concatenate([np.concatenate(_predicted_miss(record)[1:]) for record in records])
    greatest = float(np.abs(bounds).max(initial=10.0))
    decades = int(np.log10(greatest) + 1e-9)
    powers = range(1, decades + 1) if decades <= _MOST_DECADES else range(1, decades + 1, 2)
    names = ["10" + (str(power).translate(_RAISED) if power > 1 else "") for power in powers]
    sizes = [10.0**power for power in powers]
    between = [10.0**power for power in range(decades + 1) if power not in powers]
    for axes in row:
        axes.set_yscale("symlog", linthresh=10.0, linscale=1.0)
        axes.set_yticks(
            [*(-size for size in reversed(sizes)), 0.0, *sizes],
            [*("\N{MINUS SIGN}" + name for name in reversed(names)), "0", *names],
        )
        axes.set_yticks([*(-size for size in between), *between], minor=True)
        axes.set_ylim(-2.0 * greatest, 2.0 * greatest)


def _note_exit(axes: Axes, values: Floats, record: Record, scale: float, unit: str) -> None:
    """Write the largest value of a curve that leaves the axes."""
    low, high = axes.get_ylim()
    beyond = np.maximum(values - high, low - values)
    worst = int(beyond.argmax())
    if beyond[worst] <= 0.0:
        return
    value = float(values[worst]) * scale
    if abs(value) >= 1e3:
        value, unit = 1e-3 * value, unit.removeprefix("m")
    text = f"reaches {_signed(value)} {unit} at {record.steps[worst].time_s:g} s"
    # The four corners of the part before the curve leaves the axes: the one with the fewest values.
    across = np.interp(_course(record, "time_s"), axes.get_xlim(), (0.0, 1.0))
    up = (values - low) / (high - low)
    last = float(across[max(int((beyond > 0.0).argmax()) - 1, 0)])
    note_width = 1.7 * len(text) / width_mm(axes)
    corners = [(right, top) for right in (0.985, last - 0.015) for top in (values[worst] < low, values[worst] >= low)]

    def hidden(corner: tuple[float, bool]) -> int:
        right, top = corner
        inside = (across <= right) & (across >= right - note_width) & ((up > 0.8) if top else (up < 0.2))
        return int(inside.sum())

    right, top = min(corners, key=hidden)
    axes.annotate(
        text,
        (right, 0.94 if top else 0.06),
        xycoords="axes fraction",
        ha="right",
        va="top" if top else "bottom",
        bbox={"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.85},
    )


def _finish(figure: Figure, grid: Sequence[Sequence[Axes]], records: Sequence[Record]) -> None:
    labels = (
        "line-of-sight angle α, mrad",
        "line-of-sight rate ω, µrad/s",
        "impulse k, m/s",
        "predicted miss π, m\n(linear within ±10 m)",
    )
    end = max(record.steps[-1].time_s for record in records)
    start = min(record.steps[0].time_s for record in records)
    margin = 0.015 * (end - start) or 0.5
    for row, label in zip(grid, labels, strict=True):
        for axes in row:
            axes.set_xlim(start - margin, end + margin)
            axes.tick_params(labelbottom=row is grid[-1], labelleft=axes is row[0])
            axes.set_ylabel(label)
            axes.yaxis.label.set_visible(axes is row[0])
        row[0].yaxis.set_label_coords(-12.5 / width_mm(row[0]), 0.5)
    rated = any("rate" in step.measured for record in records for step in record.steps)
    measured = "measured angle and rate" if rated else "measured angle"
    handles = [
        Line2D([], [], color=TRUTH, label="true angle and rate"),
        Line2D([], [], color=MEASURED, marker=".", markersize=7, linestyle="none", label=measured),
        Line2D([], [], color=IMPULSE, linewidth=1.2, label="impulse"),
        Line2D([], [], color=LIMIT, linewidth=0.8, linestyle=(0, (4, 2)), label="greatest impulse"),
        Patch(facecolor=SET_FILL, edgecolor=SET_EDGE, label="predicted-miss interval"),
    ]
    figure.legend(handles=handles, loc="lower center", ncols=3, columnspacing=2.5, labelcolor=INK)


def _course(record: Record, field: str) -> Floats:
    """Return a field of all steps."""
    return np.array([getattr(step, field) for step in record.steps])


def _predicted_miss(record: Record) -> tuple[Floats, Floats, Floats]:
    known = [(step.time_s, *step.predicted_miss_m) for step in record.steps if step.predicted_miss_m is not None]
    times, lower, upper = np.array(known).reshape(-1, 3).T
    return times, lower, upper


def _extent(record: Record, sensor: str, field: str, range_share: float) -> tuple[float, float]:
    """Return the least and the greatest value, true or measured, without the last part of the way."""
    ranges = _course(record, "true_range_m")
    ends = []
    for share in (FAR_SHARE, range_share):
        steps = [step for step, far in zip(record.steps, ranges >= share * ranges.max(), strict=True) if far]
        seen = [getattr(step, field) for step in steps]
        seen += [step.measured[sensor] for step in steps if sensor in step.measured]
        ends.append((min(seen), max(seen)))
    (low, high), (lower, higher) = ends
    most = MOST_GROWTH * (high - low)
    return max(lower, low - most), min(higher, high + most)


def _marker(record: Record) -> str:
    return "o" if len(record.steps) == 1 else ""


def _signed(value: float) -> str:
    return f"{value:.3g}".replace("-", "\N{MINUS SIGN}")
