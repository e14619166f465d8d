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
from infoset.experiments.reachability.report import POINTS, ReachabilityReport
from infoset.rendezvous.reachability import SetKind

_TOLERANCE = 1e-2
_MAX_SETS = 24
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
    members = [member for member, _ in report.shown]
    time_s = np.linspace(
        0.0, periods * period_s, len(report.shown[0][1]) if members else periods * POINTS + 1
    )
    views = [_view(report, time_s, *view) for view in _VIEWS]
    period_of = np.minimum((time_s / period_s).astype(int), periods - 1)
    controls = [
        np.where(np.abs(member.controls) < _ZERO, 0.0, member.controls)[period_of]
        for member in members
    ]
    graphs = [
        Graph(
            f"Control along {AXIS_TITLES[j]}, and its range over all optimal controls",
            f"u{axis}",
            ("m/s²", rendezvous.acceleration_m_s2),
            [
                PageCurve(member.name, look, controls[look][:, j], look)
                for look, member in enumerate(members)
            ],
            band=report.ranges[period_of, j],
            stairs=True,
        )
        for j, axis in enumerate("xyz")
    ]
    miss = report.solution.optimal.miss
    about = [
        *filter(None, [rendezvous.description]),
        f"axes: {AXES}",
        (
            f"minimum terminal norm {miss:.9g} in {periods} periods of {period_s:g} s; "
            "trajectories of the nonlinear model"
        ),
    ]
    names = [member.name for member in members]
    return motion_page(f"Rendezvous {rendezvous.name}", about, time_s, views, graphs, names)


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
    times = sorted({round(t) for t in np.linspace(0, periods, min(periods, _MAX_SETS) + 1)})
    nearest = [
        int(np.abs(np.array(times) - time / report.rendezvous.period_s).argmin()) for time in time_s
    ]
    axes = tuple(first + axis for axis in (plane or (0, 1, 2)))
    projections = [
        report.solution.sets.projection(SetKind.TUBE, t, axes, _TOLERANCE) for t in times
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
    end = Mark("end of the optimal trajectories", report.tube[-1, states].mean(axis=1))
    unit = report.length_unit if first == 0 else ("m/s", 1.0)
    names = AXIS_TITLES if first == 0 else _VELOCITY_TITLES
    return View(caption, names, unit, tracks, [end], plane, equal=False, sets=tube)
