"""Page of a rendezvous with bounded errors: the path, all states around it, and the controls."""

from __future__ import annotations

import numpy as np

from infoset.experiments.common.hill_axes import AXES, AXIS_TITLES
from infoset.experiments.common.page_motion import (
    Graph,
    Mark,
    PageCurve,
    Sets,
    Track,
    View,
    motion_page,
    outline,
)
from infoset.experiments.common.units import Unit, length_unit
from infoset.experiments.reachability.guarantee import (
    GuaranteeReport,
    flight_lines,
    guarantee_lines,
)

_PLANES = {"radial": (1, 0), "normal": (1, 2)}
"""Axes of the two views, along the motion and across it."""
_ZERO = 1e-10
"""Controls smaller than the errors of the optimization are shown as zero."""


def guarantee_page(report: GuaranteeReport) -> str:
    """Return the page of a rendezvous with bounded errors as HTML."""
    rendezvous = report.rendezvous
    about = [rendezvous.description] if rendezvous.description else []
    about += [f"axes: {AXES}", *guarantee_lines(report), *flight_lines(report)]
    return motion_page(
        f"Guaranteed rendezvous {rendezvous.name}",
        about,
        report.path_times_s,
        [_view(report, name, plane) for name, plane in _PLANES.items()],
        [_graph(report, axis) for axis in range(3)],
    )


def _view(report: GuaranteeReport, name: str, plane: tuple[int, int]) -> View:
    plan = report.plan
    times_s = report.path_times_s
    # Each time shows the set of the nearest whole period.
    shown = np.rint(times_s / report.rendezvous.period_s).astype(int)
    faces = [[outline(report.tube(t, list(plane)))] for t in range(len(plan.nominal_states))]
    return View(
        f"Positions along track and {name}",
        AXIS_TITLES,
        length_unit(float(plan.state_ranges.largest[:, :3].max())),
        [Track("path without errors", 0, report.path[:, :3])],
        [Mark("hold point", plan.problem.aim[:3])],
        plane,
        equal=False,
        sets=Sets("states for all errors, before controls", faces, shown.tolist()),
    )


def _graph(report: GuaranteeReport, axis: int) -> Graph:
    """Return the graph of a component of the controls, an impulse as a stem of no duration."""
    rendezvous = report.rendezvous
    times_s = report.path_times_s
    # The end belongs to the last period.
    last = rendezvous.periods - 1
    period_of = np.minimum((times_s / rendezvous.period_s).astype(int), last)
    acts = np.ones(len(times_s), dtype=bool)
    noun = "Control"
    if rendezvous.has_impulses:
        noun = "Impulse"
        # The first of the two equal times of an impulse, see `path_times_s`.
        acts = np.diff(times_s, append=np.inf) == 0.0
    name, per_control = report.control_unit
    unit: Unit = (name.replace("^2", "²"), per_control)
    nominal = report.plan.nominal[:, axis]
    shown = np.where(np.abs(nominal) < _ZERO, 0.0, nominal)[period_of] * acts
    ranges = report.plan.control_ranges
    return Graph(
        f"{noun} along {AXIS_TITLES[axis]}, and its range over all errors",
        f"u{'xyz'[axis]}",
        unit,
        [PageCurve("without errors", 0, shown)],
        band=np.column_stack([ranges.lower[:, axis], ranges.upper[:, axis]])[period_of],
        stairs=True,
    )
