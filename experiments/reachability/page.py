"""Page of a rendezvous through reachable sets: the tube over time, and some optimal controls."""

from __future__ import annotations

import numpy as np

from infoset.arrays import Floats
from infoset.experiments.common.hill_axes import AXES, AXIS_TITLES
from infoset.experiments.common.page_motion import (
    Graph,
    Mark,
    PageCurve,
    Sets,
    Track,
    View,
    faces_of,
    motion_page,
)
from infoset.experiments.common.units import Unit
from infoset.experiments.reachability.report import ReachabilityReport
from infoset.rendezvous.reachability import SetKind

_PROJECTION_TOLERANCE = 1e-2
"""Relative error of a projection of the tube, see `ReachableSets.projection`.

It is a pixel of a set that is drawn 100 pixels wide. Sets with exact vertices do not use it.
"""
_MAX_SETS = 24
"""Maximum number of intervals between the times at which the tube is shown.

The times, with the start and the end, are one more. Chosen: more make the page large and slow.
"""
_ZERO = 1e-10
"""Controls smaller than the errors of the optimization are shown as zero."""
_VIEWS = (
    ("Positions and tube", 0, None),
    ("Velocities and tube", 3, None),
    ("Positions along track and radial", 0, (1, 0)),
    ("Positions along track and normal", 0, (1, 2)),
)
"""Caption, first state and plane of each view."""
_VELOCITY_TITLES = ("vx (radial)", "vy (along-track)", "vz (normal)")


def reachability_page(report: ReachabilityReport) -> str:
    """Return the page of a rendezvous as HTML."""
    rendezvous = report.rendezvous
    periods = rendezvous.problem.periods
    period_s = rendezvous.period_s
    time_s = report.shown_times_s

    miss = report.solution.optimal.miss
    about = [rendezvous.description] if rendezvous.description else []
    about += [
        f"axes: {AXES}",
        f"minimum terminal norm {miss:.9g} in {periods} periods of {period_s:g} s; "
        "trajectories of the nonlinear model",
    ]
    return motion_page(
        f"Rendezvous {rendezvous.name}",
        about,
        time_s,
        [_view(report, time_s, *view) for view in _VIEWS],
        _graphs(report, time_s),
        [member.name for member, _ in report.shown],
    )


def _graphs(report: ReachabilityReport, time_s: Floats) -> list[Graph]:
    """Return a graph of each component of the controls.

    Thrust is constant over each period; an impulse is a stem, of no duration.
    """
    rendezvous = report.rendezvous
    # The end belongs to the last period.
    last = rendezvous.problem.periods - 1
    period_of = np.minimum((time_s / rendezvous.period_s).astype(int), last)
    if rendezvous.has_impulses:
        name = "Impulse"
        unit: Unit = ("m/s", 1.0)
        # The first of the two equal times of an impulse, see `shown_times_s`.
        acts = np.diff(time_s, append=np.inf) == 0.0
    else:
        name = "Control"
        unit = ("m/s²", rendezvous.unit_m_s2)
        acts = np.ones(len(time_s), dtype=bool)

    members = [member for member, _ in report.shown]
    controls = [
        np.where(np.abs(member.controls) < _ZERO, 0.0, member.controls)[period_of] * acts[:, None]
        for member in members
    ]
    graphs = []
    for j, axis in enumerate("xyz"):
        curves = [
            PageCurve(member.name, look, controls[look][:, j], look)
            for look, member in enumerate(members)
        ]
        graphs.append(
            Graph(
                f"{name} along {AXIS_TITLES[j]}, and its range over all optimal controls",
                f"u{axis}",
                unit,
                curves,
                band=report.ranges[period_of, j],
                stairs=True,
            )
        )
    return graphs


def _view(
    report: ReachabilityReport,
    time_s: Floats,
    caption: str,
    first: int,
    plane: tuple[int, int] | None,
) -> View:
    """Return a view of the three states from ``first`` on: positions (0) or velocities (3)."""
    periods = report.rendezvous.problem.periods
    states = slice(first, first + 3)

    # The tube at some whole periods; each time shows the nearest of them.
    times = sorted({round(t) for t in np.linspace(0, periods, min(periods, _MAX_SETS) + 1)})
    nearest = [
        int(np.abs(np.array(times) - time / report.rendezvous.period_s).argmin()) for time in time_s
    ]
    axes = tuple(first + axis for axis in (plane or (0, 1, 2)))
    projections = [
        report.solution.sets.projection(SetKind.TUBE, t, axes, _PROJECTION_TOLERANCE) for t in times
    ]
    tube = Sets(
        "states of all optimal controls, at whole periods",
        [faces_of(points) for points in projections],
        nearest,
    )

    tracks = [
        Track(member.name, look, path[:, states], look)
        for look, (member, path) in enumerate(report.shown)
    ]
    # All optimal trajectories end in one state: the lower and upper bounds of the tube are equal
    # there, up to rounding.
    end = Mark("end of the optimal trajectories", report.tube[-1, states].mean(axis=1))
    unit = report.length_unit if first == 0 else ("m/s", 1.0)
    names = AXIS_TITLES if first == 0 else _VELOCITY_TITLES
    return View(caption, names, unit, tracks, [end], plane, equal=False, sets=tube)
