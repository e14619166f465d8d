"""Engagements over time: the paper's figure 2.

Sizes and margins without a reason were chosen by eye (`figure_style`).
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from infoset.arrays import Floats, Integers
from infoset.experiments.common.figure_style import (
    BOUND,
    IMPULSE,
    LIMIT,
    MEASURED,
    SET_EDGE,
    SET_FILL,
    TRUTH,
    legend_below,
    new_figure,
    plain,
    style,
)
from infoset.experiments.interception.course import (
    Clock,
    measured_name,
    outcome_title,
    record_titles,
    true_predicted_misses,
)
from infoset.experiments.interception.figures.shared import (
    MAX_VECTORS,
    count_down,
    draw_impulses,
)
from infoset.sensors import BearingSensor
from infoset.sim import Record

RANGE_SHARE = 0.1
"""Share of the maximum range, the first one, below which values do not set the limits.

Angle and rate grow as 1/x and 1/x^2 there. Chosen: the limits then contain ten times the first
angle.
"""
_MIN_RATE = 0.02
"""Quantile of the moduli of the rates at which their logarithmic axis starts: a rate can be 0.

Chosen.
"""
_IMPULSE_ROOM = 1.2
"""Limit of the axes in units of the greatest impulse; chosen."""
_ZERO: dict[str, Any] = {"color": LIMIT, "linewidth": 0.6}

Trace = tuple[Record, int]
"""An engagement and the index of one of its lateral axes."""


@style()
def draw_process(records: Sequence[Record]) -> Figure:
    """Draw angle, angular rate, impulse and predicted miss over time.

    There is one column per record and lateral axis.

    The axes of a row have the same limits. At least one record is needed. On a logarithmic time
    axis (`Clock`), where angle and rate grow by many decades, the angle is replaced by the error of
    its measurement with its bound, the rate by its modulus, and the predicted miss of the true
    state is drawn, too.
    """
    if not records:
        raise ValueError("at least one record is needed")
    clock = Clock.of(records)
    impulse_m_s = max(float(np.abs(record.impulse_m_s).max()) for record in records) or 1.0
    figure = new_figure(190.0)
    parts = figure.subfigures(1, len(records), squeeze=False)[0]
    grids = []

    for part, record, title in zip(parts, records, record_titles(records), strict=True):
        # So many letters fit above a column of half the width of a page.
        part.suptitle(plain(f"{title}\n{textwrap.fill(outcome_title(record), 44)}"))
        traces = traces_of([record])
        grid = part.subplots(4, len(traces), squeeze=False, sharex=True, sharey="row")
        for trace, column in zip(traces, grid.T, strict=True):
            _draw_column(column, trace, clock, impulse_m_s)
            if len(traces) > 1:
                column[0].set_title(f"along {record.scenario.set_model.axes[trace[1]]}")
        _name_rows(grid[:, 0], clock)
        grids.append(grid)

    angles, rates, impulses, misses = np.hstack(grids)
    if clock.counts_down:
        _level_errors(angles, traces_of(records))
        _level_moduli(rates)
    else:
        _level(angles, traces_of(records), "angle")
        _level(rates, traces_of(records), "rate")
    for axes in impulses:
        axes.set_ylim(-_IMPULSE_ROOM * impulse_m_s, _IMPULSE_ROOM * impulse_m_s)
    level_predicted_miss(misses)
    legend_below(figure, 3, markerscale=2.0)
    return figure


def _draw_column(column: Sequence[Axes], trace: Trace, clock: Clock, impulse_m_s: float) -> None:
    """Draw the four panels of an engagement along one lateral axis."""
    angle, rate, impulse, miss = column
    rate.axhline(0.0, **_ZERO)  # not seen on the logarithmic axis of moduli
    if clock.counts_down:
        _draw_angle_error(angle, trace, clock)
        _draw_sight(rate, trace, clock, "rate", is_modulus=True)
        count_down(column, trace[0].scenario)
    else:
        _draw_sight(angle, trace, clock, "angle")
        _draw_sight(rate, trace, clock, "rate")
        miss.set_xlabel("time t, s")

    _draw_impulse(impulse, trace, clock, impulse_m_s)
    draw_predicted_miss(miss, trace, clock)


def traces_of(records: Sequence[Record]) -> list[Trace]:
    """Return the columns of figures: each record with each of its lateral axes."""
    return [
        (record, axis) for record in records for axis in range(len(record.scenario.set_model.axes))
    ]


def _name_rows(rows: Sequence[Axes], clock: Clock) -> None:
    names = ["angle α, mrad", "rate ω, µrad/s", "impulse, m/s", "predicted miss π, m"]
    if clock.counts_down:
        names[:2] = ["error of α, µrad", "modulus of ω, µrad/s"]
    for axes, name in zip(rows, names, strict=True):
        axes.set_ylabel(name)


_SCALE = {"angle": 1e3, "rate": 1e6}
"""Factor from SI units to the unit of the axis."""


def _true(trace: Trace, sensor: str) -> Floats:
    """Return the true angle, mrad, or rate, µrad/s, at each step."""
    record, axis = trace
    values = {"angle": record.true_angle_rad, "rate": record.true_rate_rad_s}[sensor]
    return np.asarray(_SCALE[sensor] * values[:, axis])


def _measured(trace: Trace, sensor: str) -> tuple[Integers, Floats]:
    """Return the steps with a measurement, and the measured angles, mrad, or rates, µrad/s."""
    record, axis = trace
    steps = np.flatnonzero(record.measures(sensor))
    if not steps.size:
        return steps, np.zeros(0)
    return steps, np.asarray(_SCALE[sensor] * record.measured[sensor][steps, axis])


def _draw_sight(
    axes: Axes, trace: Trace, clock: Clock, sensor: str, *, is_modulus: bool = False
) -> None:
    """Draw the angle or the rate of the line of sight, and its measurements as dots.

    If wanted, the modulus is drawn.
    """
    times = clock.at(trace[0])
    change = np.abs if is_modulus else np.asarray
    steps, values = _measured(trace, sensor)
    if steps.size:
        name = f"measured {sensor}"
        if sensor == "angle":
            name = measured_name(trace[0].scenario)
        _dots(axes, times[steps], change(values), name)
    axes.plot(times, change(_true(trace, sensor)), color=TRUTH, label="true value")


def _dots(axes: Axes, times: Floats, values: Floats, label: str) -> None:
    look: dict[str, Any] = {
        "color": MEASURED,
        "markersize": 3.0,
        "markeredgewidth": 0.0,
        "label": label,
    }
    axes.plot(times, values, ".", rasterized=len(values) > MAX_VECTORS, **look)


def _draw_angle_error(axes: Axes, trace: Trace, clock: Clock) -> None:
    """Draw the errors of the measured angle and their bound at the true range, µrad.

    They are about the angle that the set expects of the true state: with a correction of the centre
    of brightness that of this point.
    """
    record, axis = trace
    steps, values = _measured(trace, "angle")
    times = clock.at(record)[steps]
    bounds = 1e6 * _sensor(trace).error_bound(record.true_range_m[steps])
    axes.axhline(0.0, **_ZERO)
    band: dict[str, Any] = {"facecolor": MEASURED, "alpha": 0.18, "linewidth": 0.0}
    axes.fill_between(times, -bounds, bounds, label="bound of the angle error", **band)
    sensor = record.scenario.set_model.angle_sensor
    expected_rad = sensor.expected(record.true_angle_rad[steps].T, record.true_range_m[steps])
    # `_measured` is in mrad, and the axis is in µrad.
    errors = 1e3 * values - 1e6 * expected_rad[axis]
    _dots(axes, times, errors, "error of the measured angle")


def _sensor(trace: Trace) -> BearingSensor:
    model = trace[0].scenario.set_model
    return model.axis(model.axes[trace[1]]).angle_sensor


def _level_errors(row: Sequence[Axes], traces: Sequence[Trace]) -> None:
    """Give axes of angle errors the same limits.

    They are linear to the power of ten at or above the greatest bound at a start, and logarithmic
    beyond.
    """
    bounds = [np.abs(axes.dataLim.intervaly).max() for axes in row]
    firsts = [1e6 * float(_sensor(trace).error_bound(trace[0].true_range_m[0])) for trace in traces]
    maximum = max(bounds)
    first = 10.0 ** np.ceil(np.log10(max(firsts)))
    for axes in row:
        axes.set_yscale("symlog", linthresh=first)
        axes.set_ylim(-1.3 * maximum, 1.3 * maximum)


def _level_moduli(row: Sequence[Axes]) -> None:
    """Give axes of moduli of rates the same logarithmic limits.

    Zeros are left out: a rate can be 0.
    """
    moduli = np.concatenate(
        [
            np.asarray(line.get_ydata(), dtype=np.float64)
            for axes in row
            for line in axes.lines
            if line.get_transform() == axes.transData  # not the times of the schedule
        ]
    )
    # If all moduli are 0, any axis will do.
    known = np.ones(1)
    if moduli.any():
        known = moduli[moduli > 0.0]
    low = 0.5 * float(np.quantile(known, _MIN_RATE))
    high = 2.0 * float(known.max())
    for axes in row:
        axes.set(yscale="log", ylim=(low, high))


def _draw_impulse(axes: Axes, trace: Trace, clock: Clock, impulse_m_s: float) -> None:
    """Draw the impulses along one axis, m/s, and the engine's maximum.

    `impulse_m_s` is the greatest impulse of all records, on which the limits of the axes depend.
    """
    record, axis = trace
    maximum = record.scenario.engine.max_impulse_m_s
    times = clock.at(record)
    axes.axhline(0.0, **_ZERO)
    label = f"maximum impulse, {maximum:g} m/s"
    if maximum > _IMPULSE_ROOM * impulse_m_s:
        label = f"maximum {maximum:g} m/s, beyond the axis"
    for limit in (-maximum, maximum):
        axes.axhline(limit, label=label, **BOUND)
    draw_impulses(
        axes, times, record.impulse_m_s[:, axis], color=IMPULSE, linewidth=0.9, label="impulse"
    )


def draw_predicted_miss(axes: Axes, trace: Trace, clock: Clock) -> None:
    """Draw the predicted-miss interval over time."""
    record, axis = trace
    times = clock.at(record)
    lower, upper = record.predicted_miss_m[:, axis].T
    known = np.isfinite(lower)
    axes.axhline(0.0, **_ZERO)
    band: dict[str, Any] = {"facecolor": SET_FILL, "linewidth": 0.0}
    axes.fill_between(
        times[known], lower[known], upper[known], label="predicted-miss interval", **band
    )
    for bound in (lower, upper):
        axes.plot(times[known], bound[known], color=SET_EDGE, linewidth=0.9)
    if clock.counts_down:
        true_m = true_predicted_misses(record)[:, axis]
        axes.plot(times, true_m, color=TRUTH, linewidth=1.0, label="true value")


def level_predicted_miss(row: Sequence[Axes]) -> None:
    """Give axes of predicted misses the same limits: linear to ten metres, logarithmic beyond.

    The ten metres, the same as `members.LINEAR_M`, are chosen.
    """
    maximum = max(10.0, *(float(np.abs(axes.dataLim.intervaly).max()) for axes in row))
    for axes in row:
        axes.set_yscale("symlog", linthresh=10.0)
        axes.set_ylim(-2.0 * maximum, 2.0 * maximum)


def _level(row: Sequence[Axes], traces: Sequence[Trace], sensor: str) -> None:
    """Give axes of a row the same limits, which contain the first part of the way."""
    values = []
    for trace in traces:
        ranges = trace[0].true_range_m
        shown = ranges >= RANGE_SHARE * ranges.max()
        steps, measured = _measured(trace, sensor)
        values += [_true(trace, sensor)[shown], measured[shown[steps]]]

    far = np.concatenate(values)
    # Values without extent have a margin, too: a tenth of them, or 1 if they are 0.
    margin = 0.12 * float(np.ptp(far)) or 0.1 * float(np.abs(far).max()) or 1.0
    low = float(far.min()) - margin
    high = float(far.max()) + margin
    for axes in row:
        axes.set_ylim(low, high)
