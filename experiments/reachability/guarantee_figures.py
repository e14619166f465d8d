"""Figures of a rendezvous with bounded errors: guarantees, the tube in planes, and controls.

Heights of figures, mm, and sizes of lines, marks and letters are chosen by eye.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from matplotlib.ticker import MaxNLocator

from infoset.experiments.common.figure_style import (
    BOUND,
    GAME,
    IMPULSE,
    INK,
    LIMIT,
    MEASURED,
    REGION_FILL,
    SET,
    TICKS,
    TRUTH,
    first_panels,
    label_axes,
    legend_below,
    letters,
    plain_ticks,
    style,
    subplots,
)
from infoset.experiments.common.hill_axes import AXIS_TITLES, component_titles
from infoset.experiments.common.units import length_unit, time_unit
from infoset.experiments.reachability.figures import COLOUR_RANGE, NEAR_LIMIT, draw_set
from infoset.experiments.reachability.guarantee import GuaranteeReport
from infoset.rendezvous.reachability import AffinePlan

_PLANES = ((1, 0), (1, 2), (4, 3), (4, 5))
_AXES = (*AXIS_TITLES, *component_titles("v"))


def draw_all(report: GuaranteeReport) -> Iterator[Figure]:
    """Draw the figures of a report, one after the other."""
    yield draw_guarantee(report)
    yield draw_planes(report)
    yield draw_controls(report)


@style()
def draw_guarantee(report: GuaranteeReport) -> Figure:
    """Draw the guarantee by the number of measurements, and the tube of the position by time.

    The first panel needs a bound of all strategies (measured positions and linear motion), and is
    left out with [passive_safety]: the drifts of plans with some measurements are not proved to be
    safe. Flights that are planned again have a panel, the last one.
    """
    drawn = [_draw_widths]
    if report.bound is not None and report.rendezvous.passive_safety is None:
        drawn.insert(0, _draw_by_measurements)
    if report.replanned is not None and len(report.replanned.distances):
        drawn.append(_draw_in_flight)
    figure, (row,) = subplots(80.0, 1, len(drawn))
    panels = [*row]
    for draw, axes in zip(drawn, panels, strict=True):
        draw(axes, report)
    letters(panels)
    legend_below(figure, 3)
    return figure


def _draw_by_measurements(axes: Axes, report: GuaranteeReport) -> None:
    unit, factor = report.unit
    _draw_before_flight(axes, report)
    line: dict[str, Any] = {"color": TRUTH, "marker": "o", "markersize": 3.5, "linewidth": 1.2}
    axes.plot(factor * report.by_measurements, label="affine feedback", **line)
    axes.set_yscale("log")
    plain_ticks(axes.yaxis, TICKS)
    axes.xaxis.set_major_locator(MaxNLocator(8, integer=True))
    axes.set_xlabel("measurements before the sensor fails")
    axes.set_ylabel(f"certified distance at the end, {unit}")


def _draw_before_flight(axes: Axes, report: GuaranteeReport) -> None:
    """Draw the guarantee with an answer, and the bound of all strategies, as horizontal lines."""
    factor = report.unit[1]
    looks: list[tuple[str, float | None, dict[str, Any]]] = [
        ("last control re-planned", report.answered, {"color": GAME, "linewidth": 1.2}),
        ("no strategy guarantees less", report.bound, {**BOUND, "color": INK}),
    ]
    for name, value, look in looks:
        if value is not None:
            axes.axhline(factor * value, label=name, **look)


def _draw_in_flight(axes: Axes, report: GuaranteeReport) -> None:
    """Draw the guarantees in flight, after each measurement: the median and all flights."""
    assert report.replanned is not None
    unit, factor = report.unit
    guarantees = factor * report.replanned.guarantees
    measurements = np.arange(guarantees.shape[1])
    _draw_before_flight(axes, report)
    lowest = guarantees.min(axis=0)
    highest = guarantees.max(axis=0)
    axes.fill_between(measurements, lowest, highest, label="all flights", **SET)
    line: dict[str, Any] = {"color": TRUTH, "marker": "o", "markersize": 3.5, "linewidth": 1.2}
    median = np.median(guarantees, axis=0)
    axes.plot(measurements, median, label="median of the flights", **line)
    axes.xaxis.set_major_locator(MaxNLocator(8, integer=True))
    axes.set_xlabel("measurements in flight")
    axes.set_ylabel(f"guarantee in flight, {unit}")


def _draw_widths(axes: Axes, report: GuaranteeReport) -> None:
    """Draw the half-widths of the tubes of the position, the largest of the axes."""
    rendezvous = report.rendezvous
    name, per_second = time_unit(rendezvous.periods * rendezvous.period_s)
    plans: list[tuple[str, AffinePlan | None, dict[str, Any]]] = [
        ("without measurements", report.open_loop, {"color": MEASURED, "linestyle": (0, (5, 1.5))}),
        ("affine feedback", report.plan, {"color": TRUTH, "marker": "o", "markersize": 3.5}),
    ]
    for label, plan, look in plans:
        if plan is None or (plan is report.plan and not rendezvous.has_feedback):
            continue
        ranges = plan.state_ranges
        widths = 0.5 * (ranges.upper - ranges.lower)[:, :3].max(axis=1)
        times = per_second * rendezvous.period_s * np.arange(len(widths))
        axes.plot(times, widths, label=label, linewidth=1.2, **look)
    axes.set_yscale("log")
    plain_ticks(axes.yaxis, TICKS)
    axes.set_xlabel(f"time, {name}")
    axes.set_ylabel("uncertainty of the position, ± m")


_DRIFT: dict[str, Any] = {"color": IMPULSE, "linewidth": 0.6, "alpha": 0.7, "zorder": 3}
_BALL: dict[str, Any] = {"facecolor": REGION_FILL, "edgecolor": LIMIT, "zorder": 2}


@style()
def draw_planes(report: GuaranteeReport) -> Figure:
    """Draw the path without errors, and the tube of all errors, in planes.

    A plane is left out if its second component is always zero.
    """
    largest = report.plan.state_ranges.largest.max(axis=0)
    planes = [plane for plane in _PLANES if largest[plane[1]] > 0.0]
    rows = (len(planes) + 1) // 2  # of two panels
    figure, grid = subplots(95.0 * rows, rows, 2)
    panels = first_panels(grid, len(planes))
    for axes, plane in zip(panels, planes, strict=True):
        _draw_plane(axes, report, list(plane))
    letters(panels)
    legend_below(figure, 3)
    return figure


def _draw_plane(axes: Axes, report: GuaranteeReport, states: list[int]) -> None:
    plan = report.plan
    unit, per_m = length_unit(float(plan.state_ranges.largest[:, :3].max()))
    factors = np.array([per_m if state < 3 else 1.0 for state in states])
    count = len(plan.nominal_states)
    colours = mpl.colormaps["viridis_r"](np.linspace(*COLOUR_RANGE, count))
    for t, colour in enumerate(colours):
        points = report.tube(t, states) * factors
        shown = {0: "all states at the start", count - 1: "all states at the end"}
        draw_set(axes, points, colour, shown.get(t, "_"))
    if states[0] < 3:
        _draw_drifts(axes, report, states, per_m)
    path = report.path[:, states] * factors
    axes.plot(*path.T, color=TRUTH, linewidth=0.9, label="path without errors", zorder=5)
    goal = plan.problem.aim[states] * factors
    star: dict[str, Any] = {"marker": "*", "markersize": 8.0, "color": INK, "linestyle": "none"}
    axes.plot(*goal[:, None], label="hold point", zorder=7, **star)
    label_axes(axes, [f"{_AXES[state]}, {unit if state < 3 else 'm/s'}" for state in states])


def _draw_drifts(axes: Axes, report: GuaranteeReport, states: list[int], per_m: float) -> None:
    """Draw the drifts after failures of the engines, without errors, and the keep-out ball."""
    safety = report.rendezvous.passive_safety
    if report.drifts is None or safety is None:
        return
    for drift in report.drifts.tube.middles[:, :, states]:
        axes.plot(*(per_m * drift).T, label="drifts after a failure, without errors", **_DRIFT)
    ball = Circle((0.0, 0.0), per_m * safety.keep_out_m, label="keep-out ball", **_BALL)
    axes.add_patch(ball)
    # The ball is a disc, and distances from it can be seen.
    axes.set_aspect("equal", adjustable="datalim")


@style()
def draw_controls(report: GuaranteeReport) -> Figure:
    """Draw the controls without errors, and their ranges over all errors."""
    unit, per_control = report.control_unit
    plan = report.plan
    ranges = plan.control_ranges
    limits = per_control * report.rendezvous.control_bounds
    acting = np.flatnonzero(ranges.largest.any(axis=0))
    figure, (row,) = subplots(75.0, 1, max(1, len(acting)))
    for axes, j in zip(row, acting, strict=False):
        low, high = per_control * ranges.lower[:, j], per_control * ranges.upper[:, j]
        times = np.arange(len(low))
        axes.bar(times, high - low, bottom=low, label="all errors", width=0.7, **SET)
        dots: dict[str, Any] = {"marker": "o", "markersize": 3.0, "linestyle": "none"}
        nominal = per_control * plan.nominal[:, j]
        axes.plot(times, nominal, label="without errors", color=TRUTH, **dots)
        if max(np.abs(low).max(), np.abs(high).max()) > NEAR_LIMIT * limits[j]:
            for sign in (-1.0, 1.0):
                axes.axhline(sign * limits[j], label="limit", **BOUND)
        axes.set_xlabel(f"time, periods of {report.rendezvous.period_s:g} s")
        axes.set_ylabel(f"{component_titles('u')[j]}, {unit.replace('^2', '²')}")
        axes.use_sticky_edges = False
        axes.margins(y=0.08)
        axes.xaxis.set_major_locator(MaxNLocator(8, integer=True))
    letters(row)
    legend_below(figure, 3)
    return figure
