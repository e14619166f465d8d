"""Engagements over time: the paper's figure 2."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke
from matplotlib.ticker import LogLocator, NullFormatter

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
from experiments.interception.course import (
    Clock,
    duration_text,
    marks,
    outcome_title,
    record_titles,
    true_predicted_misses,
)
from experiments.interception.figures.approach import MARK_LOOK, MAX_VECTORS, count_down
from infoset.arrays import Floats, Integers
from sim import Record

ANGLE_RANGE_SHARE = 0.01
RATE_RANGE_SHARE = 0.1
"""Share of the first range below which values do not set the limits: angle and rate grow as 1/x and 1/x^2."""
FAR_SHARE = 0.3
MAX_GROWTH = 1.0
"""Nearer values extend the limits by at most this multiple of the extent at ranges above `FAR_SHARE` of the first."""

_ROWS = 4
_LETTER_MM, _LINE_MM = 1.8, 4.0
"""Mean width of a letter, and height of a line of a title, mm."""

_MAX_DECADES = 4
"""Number of decades up to which each decade has a label."""

_SMALL_IMPULSES = 0.2
"""Share of the maximum impulse: if no impulse is greater, the axis extends to the impulses."""

_NARROW_MM = 50.0
"""Width of axes up to which notes are short, or have two lines."""

Trace = tuple[Record, str]
"""An engagement and one of its lateral axes."""

_MODULUS = "#c9c9c9"
_MIN_RATE = 0.02
"""Quantile of the moduli of the rates at which their logarithmic axis starts: a rate can be zero."""
_BOUND_ALPHA = 0.18
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def draw_process(records: Sequence[Record]) -> Figure:
    """Draw angle, angular rate, impulse and predicted miss over time, one column per record and lateral axis.

    The axes of a row have the same limits. At least one record is needed. On a logarithmic time axis (`Clock`), where
    angle and rate grow by many decades, the angle is replaced by the error of its measurement with its bound, the rate
    by its modulus, and the predicted miss has that of the true state.
    """
    if not records:
        raise ValueError("at least one record is needed")
    traces, clock = traces_of(records), Clock.of(records)
    gap = 7.0 if len(traces) > 1 else 0.0
    column_mm = (WIDTH_MM - 25.0 - gap * (len(traces) - 1)) / len(traces)
    titles = []
    for title, record in zip(map(plain, record_titles(records)), records, strict=True):
        letters = int((column_mm + record.scenario.is_spatial * (gap + column_mm)) / _LETTER_MM)
        titles.append("\n".join([*textwrap.wrap(title, letters), *textwrap.wrap(outcome_title(record), letters)]))
    in_space = any(record.scenario.is_spatial for record in records)
    span_m_s = _impulse_span_m_s(records)
    top = 4.0 + _LINE_MM * (max(title.count("\n") for title in titles) + 1 + in_space)
    with style():
        figure = new_figure(height_mm=184.0 + top)
        grid = place_axes(figure, _ROWS, len(traces), margins_mm=(21.0, 4.0, 24.0, top), gaps_mm=(gap, 4.0))
        for trace, column in zip(traces, zip(*grid, strict=True), strict=True):
            column[1].axhline(0.0, color=LIMIT, linewidth=0.6)
            if clock.counts_down:
                _draw_angle_error(column[0], trace, clock)
                _draw_sight(column[1], trace, clock, "rate", "true_rate_rad_s", 1e6, is_modulus=True)
            else:
                _draw_sight(column[0], trace, clock, "angle", "true_angle_rad", 1e3)
                _draw_sight(column[1], trace, clock, "rate", "true_rate_rad_s", 1e6)
            _draw_impulse(column[2], trace, clock, span_m_s)
            draw_predicted_miss(column[3], trace, clock)
        _write_titles(grid[0], records, titles)
        if clock.counts_down:
            _level_angle_errors(grid[0], traces)
            _level_moduli(grid[1], np.concatenate([1e6 * np.abs(_course(each, "true_rate_rad_s")) for each in traces]))
        else:
            _level(grid[0], [_extent(each, "angle", "true_angle_rad", ANGLE_RANGE_SHARE) for each in traces], scale=1e3)
            _level(grid[1], [_extent(each, "rate", "true_rate_rad_s", RATE_RANGE_SHARE) for each in traces], scale=1e6)
        for axes in grid[2]:
            axes.set_ylim(-1.2 * span_m_s, 1.35 * span_m_s)
        level_predicted_miss(grid[3], traces)
        for trace, column in zip(traces, zip(*grid, strict=True), strict=True):
            if not clock.counts_down:
                _note_exit(column[0], _course(trace, "true_angle_rad") * 1e3, trace, 1.0, "mrad")
                _note_exit(column[1], _course(trace, "true_rate_rad_s") * 1e6, trace, 1e-3, "mrad/s")
        _finish(figure, grid, traces, clock)
    return figure


def traces_of(records: Sequence[Record]) -> list[Trace]:
    """Return the columns of figures: each record with each of its lateral axes."""
    return [(record, axis) for record in records for axis in record.scenario.set_model.axes]


def _write_titles(row: Sequence[Axes], records: Sequence[Record], titles: Sequence[str]) -> None:
    """Write the title of each record above its columns; in space, also the axis of each column."""
    columns = iter(row)
    for record, title in zip(records, titles, strict=True):
        first = next(columns)
        if not record.scenario.is_spatial:
            first.set_title(title, linespacing=1.3)
            continue
        last = next(columns)
        for axes, name in ((first, "y"), (last, "z")):
            axes.set_title(f"along {name}")
        boxes = [axes.get_position() for axes in (first, last)]
        middle = 0.5 * (boxes[1].x1 - boxes[0].x0) / boxes[0].width
        look: dict[str, Any] = {"ha": "center", "va": "bottom", "fontsize": first.title.get_fontsize()}
        place: dict[str, Any] = {"xytext": (0.0, 18.0), "textcoords": "offset points", "xycoords": "axes fraction"}
        first.annotate(title, (middle, 1.0), linespacing=1.3, **place, **look)


def _draw_sight(
    axes: Axes, trace: Trace, clock: Clock, sensor: str, field: str, scale: float, *, is_modulus: bool = False
) -> None:
    """Draw a quantity of the line of sight or its modulus, and its measurements as dots."""
    record, axis = trace
    times = clock.at(record)
    steps = zip(times, [step.axes[axis].measured for step in record.steps], strict=True)
    measured = [(time_s, values[sensor]) for time_s, values in steps if sensor in values]
    if measured:
        measured_at, values = np.array(measured).T
        size = 6.0 if _marker(record) and sensor == "angle" else 3.0
        look: dict[str, Any] = {"markersize": size, "rasterized": len(values) > MAX_VECTORS}
        values = np.abs(values) if is_modulus else values
        axes.plot(measured_at, values * scale, ".", color=MEASURED, markeredgewidth=0.0, **look)
    true = np.abs(_course(trace, field)) if is_modulus else _course(trace, field)
    axes.plot(times, true * scale, color=TRUTH, marker=_marker(record), markersize=3.0)


def _angle_errors(trace: Trace) -> tuple[Integers, Floats, Floats]:
    """Return the steps with a measured angle, and the error of each and its bound, µrad."""
    record, axis = trace
    steps = [index for index, step in enumerate(record.steps) if "angle" in step.axes[axis].measured]
    along = [record.steps[index].axes[axis] for index in steps]
    errors = np.array([step.measured["angle"] - step.true_angle_rad for step in along])
    sensor = record.scenario.set_model.axis(axis).angle_sensor
    bounds = sensor.error_bound(np.array([record.steps[index].true_range_m for index in steps]))
    return np.array(steps, dtype=np.int64), 1e6 * errors, 1e6 * bounds


def _draw_angle_error(axes: Axes, trace: Trace, clock: Clock) -> None:
    steps, errors, bounds = _angle_errors(trace)
    times = clock.at(trace[0])[steps]
    axes.axhline(0.0, color=LIMIT, linewidth=0.6)
    axes.fill_between(times, -bounds, bounds, color=MEASURED, alpha=_BOUND_ALPHA, linewidth=0.0)
    look: dict[str, Any] = {"markersize": 3.0, "rasterized": len(steps) > MAX_VECTORS}
    axes.plot(times, errors, ".", color=MEASURED, markeredgewidth=0.0, **look)


def _level_angle_errors(row: Sequence[Axes], traces: Sequence[Trace]) -> None:
    """Give axes of angle errors the same limits: logarithmic beyond ten times the power of ten of the first bound."""
    bounds = [bounds for _, _, bounds in map(_angle_errors, traces) if len(bounds)]
    maximum = max((float(each.max()) for each in bounds), default=1.0)
    first = math.ceil(math.log10(max((float(each[0]) for each in bounds), default=1.0)))
    if maximum > 10.0**first:
        _bend(row, first, maximum)
        return
    for axes in row:
        axes.set_ylim(-1.3 * maximum, 1.3 * maximum)


def _level_moduli(row: Sequence[Axes], moduli: Floats) -> None:
    known = moduli[moduli > 0.0] if moduli.any() else np.ones(1)
    for axes in row:
        axes.set_yscale("log")
        axes.set_ylim(0.5 * float(np.quantile(known, _MIN_RATE)), 2.0 * float(known.max()))
        axes.yaxis.set_major_locator(LogLocator(numticks=7))
        axes.yaxis.set_minor_formatter(NullFormatter())


def _draw_impulse(axes: Axes, trace: Trace, clock: Clock, span_m_s: float) -> None:
    """Draw the impulses along an axis; in space, behind them, their moduli, all upward."""
    record, _ = trace
    times, impulses = clock.at(record), _course(trace, "impulse_m_s")
    maximum = record.scenario.thruster.max_impulse_m_s
    axes.axhline(0.0, color=LIMIT, linewidth=0.6)
    for limit in (-maximum, maximum):
        axes.axhline(limit, color=LIMIT, linewidth=0.8, linestyle=(0, (4, 2)))
    wide = width_mm(axes) > _NARROW_MM
    text = f"{'maximum impulse' if wide else 'limit'} ±{maximum:g} m/s"
    place: dict[str, Any] = {"xytext": (0.0, 2.5), "textcoords": "offset points", "ha": "right", "va": "bottom"}
    axes.annotate(
        text + (", beyond the axis" if wide and maximum > span_m_s else ""),
        (0.985, min(maximum, 1.05 * span_m_s)),
        xycoords=axes.get_yaxis_transform(),
        path_effects=[withStroke(linewidth=2.0, foreground="white")],
        **place,
    )
    if record.scenario.is_spatial:
        moduli = np.array([step.impulse_m_s for step in record.steps])
        many = np.count_nonzero(moduli) > MAX_VECTORS
        axes.vlines(times[moduli > 0.0], 0.0, moduli[moduli > 0.0], color=_MODULUS, linewidth=0.9, rasterized=many)
    given = impulses != 0.0
    many = given.sum() > MAX_VECTORS
    axes.vlines(times[given], 0.0, impulses[given], color=IMPULSE, linewidth=0.9, rasterized=many)
    axes.plot(times[given], impulses[given], ".", color=IMPULSE, markersize=2.2, markeredgewidth=0.0)


def draw_predicted_miss(axes: Axes, trace: Trace, clock: Clock) -> None:
    """Draw the predicted-miss interval over time."""
    times_s, lower, upper = _predicted_miss(trace)
    times = clock.at(trace[0], times_s)
    axes.axhline(0.0, color=LIMIT, linewidth=0.6)
    axes.fill_between(times, lower, upper, color=SET_FILL, linewidth=0.0)
    for bound in (lower, upper):
        axes.plot(times, bound, color=SET_EDGE, linewidth=0.9, marker=_marker(trace[0]), markersize=3.0)
    if clock.counts_down:
        axes.plot(clock.at(trace[0]), true_predicted_misses(trace[0])[trace[1]], color=TRUTH, linewidth=1.0)


def _level(row: Sequence[Axes], extents: Sequence[tuple[float, float]], scale: float) -> None:
    minimum = min(extent[0] for extent in extents) * scale
    maximum = max(extent[1] for extent in extents) * scale
    margin = 0.12 * (maximum - minimum) or 0.1 * abs(maximum) or 1.0
    for axes in row:
        axes.set_ylim(minimum - margin, maximum + 1.8 * margin)


def _impulse_span_m_s(records: Sequence[Record]) -> float:
    """Return the maximum impulse that the axis shows: the limit of the engine unless all are small."""
    maximum = max(record.scenario.thruster.max_impulse_m_s for record in records)
    given = max(abs(step.impulse_m_s) for record in records for step in record.steps)
    return given if 0.0 < given < _SMALL_IMPULSES * maximum else maximum


def level_predicted_miss(row: Sequence[Axes], traces: Sequence[Trace]) -> None:
    """Give axes of predicted misses the same limits: linear to ten metres, logarithmic beyond."""
    bounds = np.concatenate([np.concatenate(_predicted_miss(trace)[1:]) for trace in traces])
    _bend(row, 1, float(np.abs(bounds).max(initial=10.0)))


def _bend(row: Sequence[Axes], first: int, maximum: float) -> None:
    """Make vertical axes linear to 10**first, logarithmic beyond, with symmetric limits."""
    last = int(np.floor(np.log10(2.0 * maximum)))
    powers = range(first, last + 1, 1 if last - first < _MAX_DECADES else 2)
    names = ["1" if power == 0 else "10" + (str(power).translate(_RAISED) if power != 1 else "") for power in powers]
    sizes = [10.0**power for power in powers]
    between = [10.0**power for power in range(first - 1, last + 1) if power not in powers]
    for axes in row:
        axes.set_yscale("symlog", linthresh=10.0**first, linscale=1.0)
        axes.set_yticks(
            [*(-size for size in reversed(sizes)), 0.0, *sizes],
            [*("\N{MINUS SIGN}" + name for name in reversed(names)), "0", *names],
        )
        axes.set_yticks([*(-size for size in between), *between], minor=True)
        axes.set_ylim(-2.0 * maximum, 2.0 * maximum)


def _note_exit(axes: Axes, values: Floats, trace: Trace, scale: float, unit: str) -> None:
    """Write the largest value of a curve that leaves the axes."""
    low, high = axes.get_ylim()
    beyond = np.maximum(values - high, low - values)
    worst = int(beyond.argmax())
    if beyond[worst] <= 0.0:
        return
    value = float(values[worst]) * scale
    if abs(value) >= 1e3:
        value, unit = 1e-3 * value, unit.removeprefix("m")
    space = " " if width_mm(axes) > _NARROW_MM else "\n"
    number = f"{value:.3g}".replace("-", "\N{MINUS SIGN}")
    text = f"reaches {number} {unit}{space}at {trace[0].steps[worst].time_s:g} s"
    # The four corners of the part before the curve leaves the axes: the one with the fewest values.
    across = np.interp([step.time_s for step in trace[0].steps], axes.get_xlim(), (0.0, 1.0))
    up = (values - low) / (high - low)
    last = float(across[max(int((beyond > 0.0).argmax()) - 1, 0)])
    note_width = 1.7 * max(map(len, text.splitlines())) / width_mm(axes)
    note_height = 0.2 if space == " " else 0.3
    corners = [(right, top) for right in (0.985, last - 0.015) for top in (values[worst] < low, values[worst] >= low)]

    def hidden(corner: tuple[float, bool]) -> int:
        right, top = corner
        at_end = (up > 1.0 - note_height) if top else (up < note_height)
        return int(((across <= right) & (across >= right - note_width) & at_end).sum())

    right, top = min(corners, key=hidden)
    box = {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.85}
    look: dict[str, Any] = {"fontsize": 8.0 if space == " " else 6.5, "ha": "right", "va": "top" if top else "bottom"}
    axes.annotate(text, (right, 0.94 if top else 0.06), xycoords="axes fraction", bbox=box, **look)


def _finish(figure: Figure, grid: Sequence[Sequence[Axes]], traces: Sequence[Trace], clock: Clock) -> None:
    records = [record for record, _ in traces]
    in_space = any(record.scenario.is_spatial for record in records)
    bent = clock.counts_down
    labels = (
        "error of the measured\nangle α, µrad" if bent else "line-of-sight angle α, mrad",
        "modulus of the\nline-of-sight rate ω, µrad/s" if bent else "line-of-sight rate ω, µrad/s",
        "impulse component k, m/s" if in_space else "impulse k, m/s",
        "predicted miss π, m\n(linear within ±10 m)",
    )
    end = max(record.steps[-1].time_s for record in records)
    start = min(record.steps[0].time_s for record in records)
    margin = 0.015 * (end - start) or 0.5
    for row, label in zip(grid, labels, strict=True):
        for axes, (record, _) in zip(row, traces, strict=True):
            if clock.counts_down:
                count_down(axes, record.scenario)
            else:
                axes.set_xlim(start - margin, end + margin)
                axes.set_xlabel("time t, s")
            axes.xaxis.label.set_visible(row is grid[-1])
            axes.tick_params(labelbottom=row is grid[-1], labelleft=axes is row[0])
            axes.set_ylabel(label)
            axes.yaxis.label.set_visible(axes is row[0])
        row[0].yaxis.set_label_coords(-12.5 / width_mm(row[0]), 0.5)
    rated = any("rate" in step.measured for record in records for step in record.steps)
    measured = "measured angle and rate" if rated else "measured angle"
    true = "true rate and predicted miss" if bent else "true angle and rate"
    if bent:
        measured = "error of the measured angle" + (", measured rate" if rated else "")
    handles: list[Line2D | Patch] = [
        Line2D([], [], color=TRUTH, label=true),
        Line2D([], [], color=MEASURED, marker=".", markersize=7, linestyle="none", label=measured),
        Line2D([], [], color=IMPULSE, linewidth=1.2, label="impulse component" if in_space else "impulse"),
        Line2D([], [], color=LIMIT, linewidth=0.8, linestyle=(0, (4, 2)), label="maximum impulse"),
        Patch(facecolor=SET_FILL, edgecolor=SET_EDGE, label="predicted-miss interval"),
    ]
    if in_space:
        modulus = "modulus of the impulse vector, upward"
        handles.insert(3, Line2D([], [], color=_MODULUS, linewidth=1.8, label=modulus))
    if bent:
        handles.insert(2, Patch(facecolor=MEASURED, alpha=_BOUND_ALPHA, label="bound of the angle error"))
        times = {name: duration_text(time) for record in records for name, time in marks(record.scenario).items()}
        if times:
            label = ", ".join(f"{name} {time}" for name, time in times.items())
            handles.append(Line2D([], [], label=label, **MARK_LOOK))
    figure.legend(handles=handles, loc="lower center", ncols=3, columnspacing=2.0, labelcolor=INK)


def _course(trace: Trace, field: str) -> Floats:
    record, axis = trace
    return np.array([getattr(step.axes[axis], field) for step in record.steps])


def _predicted_miss(trace: Trace) -> tuple[Floats, Floats, Floats]:
    record, axis = trace
    ends = [(step.time_s, step.axes[axis].predicted_miss_m) for step in record.steps]
    times, lower, upper = np.array([(time_s, *miss) for time_s, miss in ends if miss is not None]).reshape(-1, 3).T
    return times, lower, upper


def _extent(trace: Trace, sensor: str, field: str, range_share: float) -> tuple[float, float]:
    """Return the minimum and the maximum value, true or measured, without the last part of the way."""
    record, axis = trace
    ranges = np.array([step.true_range_m for step in record.steps])
    ends = []
    for share in (FAR_SHARE, range_share):
        far = ranges >= share * ranges.max()
        steps = [step.axes[axis] for step, shown in zip(record.steps, far, strict=True) if shown]
        seen = [getattr(step, field) for step in steps]
        seen += [step.measured[sensor] for step in steps if sensor in step.measured]
        ends.append((min(seen), max(seen)))
    (low, high), (lower, higher) = ends
    most = MAX_GROWTH * (high - low)
    return max(lower, low - most), min(higher, high + most)


def _marker(record: Record) -> str:
    return "o" if len(record.steps) == 1 else ""
