"""Results of a rendezvous with bounded errors, as JSON, CSV and lines."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from rich.table import Table

from infoset.arrays import Floats
from infoset.experiments.common.hill_axes import AXES
from infoset.experiments.common.problem_command import ProblemCommand
from infoset.experiments.common.screen import Part, number_table
from infoset.experiments.reachability.file import STATE_NAMES, Rendezvous
from infoset.experiments.reachability.guarantee import (
    WINDOW,
    GuaranteeReport,
    constraint_times,
    flight_lines,
    guarantee_lines,
    solve_guarantee,
)
from infoset.experiments.reachability.guarantee_page import guarantee_page
from infoset.rendezvous.reachability import Ranges
from infoset.sim.columns import Cell, csv_text


def report_json(report: GuaranteeReport) -> dict[str, object]:
    """Return the results for `infoset.experiments.common.output.to_json`."""
    plan = report.plan
    unit, factor = report.unit
    control, per_control = report.control_unit
    ranges = plan.state_ranges

    def in_unit(value: float | None) -> float | None:
        return None if value is None else factor * value

    return {
        "units": {
            "period_s": report.rendezvous.period_s,
            "axes": AXES,
            "guarantees": _unit_text(unit),
            "states": "x, y, z in m and their rates in m/s, before the control of their time",
            "controls": f"{control}, along x, y, z",
            "gains": f"{control} per m, and per m/s of a measured velocity",
            "lines_of_sight": "axes of measured positions at each t, in place of x, y, z",
        },
        "without_measurements": report.open_loop and in_unit(report.open_loop.guarantee),
        "affine": in_unit(plan.guarantee),
        "answered": in_unit(report.answered),
        "answered_refusal": report.refusal,
        "bound": in_unit(report.bound),
        "radius": in_unit(report.radius),
        "window": WINDOW,
        "nonlinear": report.rendezvous.nonlinear,
        "thrust_loss": report.thrust_faces and report.thrust_faces.loss,
        "constraints_hold": constraint_times(report.rendezvous),
        "drifts": _drifts_json(report),
        "box": {"min": ranges.lower[-1], "max": ranges.upper[-1]},
        "states": _ranges_json(plan.nominal_states, ranges, 1.0),
        "controls": _ranges_json(plan.nominal, plan.control_ranges, per_control),
        "lines_of_sight": _lines_of_sight(report),
        "gains": [
            {"period": int(t), "measurement": int(s), "matrix": per_control * plan.gains[t, s]}
            for t, s in np.argwhere(plan.gains.any(axis=(2, 3)))
        ],
        "flights": {
            "number": len(report.flights.distances),
            "outside": report.flights.outside,
            "largest": in_unit(float(report.flights.distances.max(initial=0.0))),
        },
        "replanned": _replanned_json(report),
    }


def _replanned_json(report: GuaranteeReport) -> dict[str, object] | None:
    flights = report.replanned
    if flights is None:
        return None
    factor = report.unit[1]
    return {
        "number": len(flights.distances),
        "outside": flights.outside,
        "guarantees": factor * flights.guarantees,
        "distances": factor * flights.distances,
    }


def _lines_of_sight(report: GuaranteeReport) -> Floats | None:
    """Return the axes along and across the line of sight, whose coordinates the gains are for."""
    if report.rendezvous.sight is None:
        return None
    return report.plan.problem.output[:, :, :3]


def _drifts_json(report: GuaranteeReport) -> dict[str, object] | None:
    safety = report.rendezvous.passive_safety
    if report.drifts is None or safety is None:
        return None
    return {
        "keep_out_m": safety.keep_out_m,
        "periods": safety.drift_periods,
        "least_distance_m": report.drifts.least_distance,
        "least_distance_by_impulse_m": report.drifts.distances.min(axis=1),
    }


def _unit_text(unit: str) -> str:
    if unit == "m":
        return "m, of the position along an axis; the velocity in the same proportion of its box"
    return "half-widths of the box of [goal]"


def _ranges_json(nominal: Floats, ranges: Ranges, factor: float) -> dict[str, object]:
    return {
        "nominal": factor * nominal,
        "min": factor * ranges.lower,
        "max": factor * ranges.upper,
    }


def guarantee_csv(report: GuaranteeReport) -> str:
    """Return the affine plan without errors and its ranges, a line for each time, as CSV."""
    plan = report.plan
    per_control = report.control_unit[1]
    unit = "m_s" if report.rendezvous.has_impulses else "m_s2"
    states = [f"{name}_{'m' if len(name) == 1 else 'm_s'}" for name in STATE_NAMES]
    controls = [f"u{axis}_{unit}" for axis in "xyz"]
    ends = ("", "_min", "_max")
    columns = ["time_s", *(name + end for end in ends for name in [*states, *controls])]

    rows: list[list[Cell]] = []
    times_s = report.rendezvous.period_s * np.arange(len(plan.nominal_states))
    for t, time_s in enumerate(times_s.tolist()):
        row: list[Cell] = [time_s]
        tracks = [
            (plan.nominal_states, plan.nominal),
            (plan.state_ranges.lower, plan.control_ranges.lower),
            (plan.state_ranges.upper, plan.control_ranges.upper),
        ]
        for state, control in tracks:
            row += state[t].tolist()
            row += (per_control * control[t]).tolist() if t < len(control) else [None] * 3
        rows.append(row)
    return csv_text(columns, rows)


def report_lines(report: GuaranteeReport) -> Iterator[Part]:
    """Yield the guarantees, the box at the end, the controls and the flights, for the screen."""
    rendezvous = report.rendezvous
    noun = "impulses" if rendezvous.has_impulses else "periods of thrust"
    yield f"{rendezvous.name}: guaranteed rendezvous, {rendezvous.periods} {noun}, errors bounded"
    yield from ("", *guarantee_lines(report))
    yield from ("", _component_table(report))
    yield ""
    yield from flight_lines(report)
    yield f"axes: {AXES}"


def _component_table(report: GuaranteeReport) -> Table:
    """Return the ranges at the end of the affine plan, and its largest controls, for each axis."""
    plan = report.plan
    unit, per_control = report.control_unit
    noun = "impulse" if report.rendezvous.has_impulses else "control"
    table = number_table(
        "axis",
        "position at\nthe end, m",
        "velocity at\nthe end, m/s",
        f"largest\n{noun}, {unit}",
        f"limit\n{unit}",
    )
    # Plus zero, which has no sign: -0 is printed as 0.
    lower, upper = plan.state_ranges.lower[-1] + 0.0, plan.state_ranges.upper[-1] + 0.0
    largest = per_control * plan.control_ranges.largest.max(axis=0)
    limits = per_control * report.rendezvous.control_bounds
    for axis, name in enumerate("xyz"):
        ranges = [f"{lower[i]:.3g} .. {upper[i]:.3g}" for i in (axis, axis + 3)]
        table.add_row(name, *ranges, f"{largest[axis]:.3g}", f"{limits[axis]:.3g}")
    return table


COMMAND = ProblemCommand(
    owner=Rendezvous,
    solve=solve_guarantee,
    to_json=report_json,
    to_csv=guarantee_csv,
    lines=report_lines,
    to_html=guarantee_page,
    csv_name="plan.csv",
    figures="infoset.experiments.reachability.guarantee_figures",
    figure_names=("figure-guarantee", "figure-planes", "figure-controls"),
)
