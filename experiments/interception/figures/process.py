"""Engagements over time: the paper's figure 2."""

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
    outcome_title,
    record_titles,
    true_predicted_misses,
)
from infoset.experiments.interception.figures.shared import MAX_VECTORS, count_down, draw_impulses
from infoset.sensors import BearingSensor
from infoset.sim import Record

RANGE_SHARE = 0.1
"""Share of the first range below which values do not set the limits: angle and rate grow as 1/x and
1/x^2.
"""
_MIN_RATE = 0.02
"""Quantile of the moduli of the rates at which their logarithmic axis starts: a rate can be
zero.
"""
_ZERO: dict[str, Any] = {"color": LIMIT, "linewidth": 0.6}

Trace = tuple[Record, int]
"""An engagement and the index of one of its lateral axes."""


@style()
def draw_process(records: Sequence[Record]) -> Figure:
    """Draw angle, angular rate, impulse and predicted miss over time, one column per record and
    lateral axis.

    The axes of a row have the same limits. At least one record is needed. On a logarithmic time
    axis (`Clock`), where angle and rate grow by many decades, the angle is replaced by the error of
    its measurement with its bound, the rate by its modulus, and the predicted miss has that of the
    true state.
    """
    if not records:
        raise ValueError("at least one record is needed")
    clock = Clock.of(records)
    impulse_m_s = max(float(np.abs(record.impulse_m_s).max()) for record in records) or 1.0
    figure = new_figure(190.0)
    parts = figure.subfigures(1, len(records), squeeze=False)[0]
    grids = []
    for part, record, title in zip(parts, records, record_titles(records), strict=True):
        part.suptitle(plain(f"{title}\n{textwrap.fill(outcome_title(record), 44)}"))
        traces = traces_of([record])
        grid = part.subplots(4, len(traces), squeeze=False, sharex=True, sharey="row")
        for trace, column in zip(traces, grid.T, strict=True):
            angle, rate, impulse, miss = column
            rate.axhline(0.0, **_ZERO)
            if clock.counts_down:
                _draw_angle_error(angle, trace, clock)
                _draw_sight(rate, trace, clock, "rate", is_modulus=True)
                count_down(column, record.scenario)
            else:
                _draw_sight(angle, trace, clock, "angle")
                _draw_sight(rate, trace, clock, "rate")
                miss.set_xlabel("time t, s")
            _draw_impulse(impulse, trace, clock, impulse_m_s)
            draw_predicted_miss(miss, trace, clock)
            if len(traces) > 1:
                angle.set_title(f"along {record.scenario.set_model.axes[trace[1]]}")
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
        axes.set_ylim(-1.2 * impulse_m_s, 1.2 * impulse_m_s)
    level_predicted_miss(misses)
    legend_below(figure, 3, markerscale=2.0)
    return figure


def traces_of(records: Sequence[Record]) -> list[Trace]:
    """Return the columns of figures: each record with each of its lateral axes."""
    return [
        (record, axis) for record in records for axis in range(len(record.scenario.set_model.axes))
    ]


def _name_rows(rows: Sequence[Axes], clock: Clock) -> None:
    down = clock.counts_down
    rows[0].set_ylabel("error of α, µrad" if down else "angle α, mrad")
    rows[1].set_ylabel("modulus of ω, µrad/s" if down else "rate ω, µrad/s")
    rows[2].set_ylabel("impulse, m/s")
    rows[3].set_ylabel("predicted miss π, m")


_SCALE = {"angle": 1e3, "rate": 1e6}
"""Number per SI unit of the unit of its axis."""


def _true(trace: Trace, sensor: str) -> Floats:
    """Return the true angle, mrad, or rate, µrad/s, at each step."""
    record, axis = trace
    values = record.true_angle_rad if sensor == "angle" else record.true_rate_rad_s
    return np.asarray(_SCALE[sensor] * values[:, axis])


def _measured(trace: Trace, sensor: str) -> tuple[Integers, Floats]:
    """Return the steps with a measurement, and the measured angles, mrad, or rates, µrad/s."""
    record, axis = trace
    steps = np.flatnonzero(record.measures(sensor))
    values = record.measured[sensor][steps, axis] if steps.size else np.zeros(0)
    return steps, np.asarray(_SCALE[sensor] * values)


def _draw_sight(
    axes: Axes, trace: Trace, clock: Clock, sensor: str, *, is_modulus: bool = False
) -> None:
    """Draw the angle or the rate of the line of sight, or its modulus, and its measurements as
    dots.
    """
    times = clock.at(trace[0])
    change = np.abs if is_modulus else np.asarray
    steps, values = _measured(trace, sensor)
    if steps.size:
        _dots(axes, times[steps], change(values), f"measured {sensor}")
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
    """Draw the errors of the measured angle, µrad, in their bounds."""
    record, (steps, values) = trace[0], _measured(trace, "angle")
    times = clock.at(record)[steps]
    bounds = 1e6 * _sensor(trace).error_bound(record.true_range_m[steps])
    axes.axhline(0.0, **_ZERO)
    band: dict[str, Any] = {
        "facecolor": MEASURED,
        "alpha": 0.18,
        "linewidth": 0.0,
        "label": "bound of the angle error",
    }
    axes.fill_between(times, -bounds, bounds, **band)
    _dots(axes, times, 1e3 * (values - _true(trace, "angle")[steps]), "error of the measured angle")


def _sensor(trace: Trace) -> BearingSensor:
    model = trace[0].scenario.set_model
    return model.axis(model.axes[trace[1]]).angle_sensor


def _level_errors(row: Sequence[Axes], traces: Sequence[Trace]) -> None:
    """Give axes of angle errors the same limits: logarithmic beyond the power of ten of the first
    bound.
    """
    bounds = [np.abs(axes.dataLim.intervaly).max() for axes in row]
    firsts = [1e6 * float(_sensor(trace).error_bound(trace[0].true_range_m[0])) for trace in traces]
    maximum = max(bounds)
    first = 10.0 ** np.ceil(np.log10(max(firsts)))
    for axes in row:
        axes.set_yscale("symlog", linthresh=first)
        axes.set_ylim(-1.3 * maximum, 1.3 * maximum)


def _level_moduli(row: Sequence[Axes]) -> None:
    moduli = np.concatenate(
        [np.asarray(line.get_ydata(), dtype=np.float64) for axes in row for line in axes.lines]
    )
    known = moduli[moduli > 0.0] if moduli.any() else np.ones(1)
    for axes in row:
        axes.set(
            yscale="log",
            ylim=(0.5 * float(np.quantile(known, _MIN_RATE)), 2.0 * float(known.max())),
        )


def _draw_impulse(axes: Axes, trace: Trace, clock: Clock, impulse_m_s: float) -> None:
    record, axis = trace
    maximum = record.scenario.thruster.max_impulse_m_s
    times = clock.at(record)
    axes.axhline(0.0, **_ZERO)
    label = f"maximum impulse, {maximum:g} m/s"
    if maximum > 1.2 * impulse_m_s:
        label = f"maximum {maximum:g} m/s, beyond the axis"
    for limit in (-maximum, maximum):
        axes.axhline(limit, label=label, **BOUND)
    draw_impulses(
        axes, times, record.impulse_m_s[:, axis], color=IMPULSE, linewidth=0.9, label="impulse"
    )


def draw_predicted_miss(axes: Axes, trace: Trace, clock: Clock) -> None:
    """Draw the predicted-miss interval over time."""
    record, axis = trace
    times, (lower, upper) = clock.at(record), record.predicted_miss_m[:, axis].T
    known = np.isfinite(lower)
    axes.axhline(0.0, **_ZERO)
    axes.fill_between(
        times[known],
        lower[known],
        upper[known],
        facecolor=SET_FILL,
        linewidth=0.0,
        label="predicted-miss interval",
    )
    for bound in (lower, upper):
        axes.plot(times[known], bound[known], color=SET_EDGE, linewidth=0.9)
    if clock.counts_down:
        axes.plot(
            times,
            true_predicted_misses(record)[:, axis],
            color=TRUTH,
            linewidth=1.0,
            label="true value",
        )


def level_predicted_miss(row: Sequence[Axes]) -> None:
    """Give axes of predicted misses the same limits: linear to ten metres, logarithmic beyond."""
    maximum = max(10.0, *(float(np.abs(axes.dataLim.intervaly).max()) for axes in row))
    for axes in row:
        axes.set_yscale("symlog", linthresh=10.0)
        axes.set_ylim(-2.0 * maximum, 2.0 * maximum)


def _level(row: Sequence[Axes], traces: Sequence[Trace], sensor: str) -> None:
    """Give axes of a row the same limits, those of the first part of the way."""
    values = []
    for trace in traces:
        ranges = trace[0].true_range_m
        shown, (steps, measured) = ranges >= RANGE_SHARE * ranges.max(), _measured(trace, sensor)
        values += [_true(trace, sensor)[shown], measured[shown[steps]]]
    far = np.concatenate(values)
    margin = 0.12 * float(np.ptp(far)) or 0.1 * float(np.abs(far).max()) or 1.0
    low = float(far.min()) - margin
    high = float(far.max()) + margin
    for axes in row:
        axes.set_ylim(low, high)
