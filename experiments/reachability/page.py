"""The page of a rendezvous through reachable sets: the tube over time, and some of all optimal controls."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from experiments.common.display_units import length_unit
from experiments.common.page_motion import Curve, Graph, Mark, Sets, Track, View, faces_of, motion_page
from experiments.reachability.report import POINTS, Report
from rendezvous.reachability import SetKind

Floats = NDArray[np.float64]

_TOLERANCE = 1e-2
_MOST_SETS = 24
_NOTHING = 1e-10


def reachability_page(report: Report) -> str:
    """Return the page of a rendezvous.

    Parameters
    ----------
    report : Report

    Returns
    -------
    str
        HTML.
    """
    rendezvous, sets = report.rendezvous, report.solution.sets
    periods, period_s = rendezvous.problem.periods, rendezvous.period_s
    members, paths = [member for member, _ in report.shown], [path for _, path in report.shown]
    count = len(paths[0]) if paths else periods * POINTS + 1
    time_s = np.linspace(0.0, periods * period_s, count)
    times = sorted({round(each) for each in np.linspace(0, periods, min(periods, _MOST_SETS) + 1)})
    nearest = [int(np.abs(np.array(times) - each / period_s).argmin()) for each in time_s]

    def tube(axes: tuple[int, ...]) -> Sets:
        shadows = [sets.shadow(SetKind.TUBE, t, axes, _TOLERANCE) for t in times]
        return Sets(
            "states on the way of optimal controls, at whole periods", [faces_of(each) for each in shadows], nearest
        )

    def view(caption: str, first: int, plane: tuple[int, int] | None = None) -> View:
        tracks = [
            Track(each.name, look, path[:, first : first + 3], look)
            for look, (each, path) in enumerate(zip(members, paths, strict=True))
        ]
        end = Mark("where the plans end", report.tube[-1, first : first + 3].mean(axis=1), "cross")
        shown = tube(tuple(first + axis for axis in (plane or (0, 1, 2))))
        size = float(np.abs(report.tube[:, first : first + 3]).max())
        unit = length_unit(size) if first == 0 else ("m/s", 1.0)
        names = ("x", "y", "z") if first == 0 else ("vx", "vy", "vz")
        return View(caption, names, unit, tracks, [end], plane, equal=False, sets=shown)

    period_of = np.minimum((time_s / period_s).astype(int), periods - 1)
    acceleration = ("m/s²", rendezvous.acceleration_m_s2)
    graphs = [
        Graph(
            f"Control along {axis}, and the range of all optimal ones",
            f"u{axis}",
            acceleration,
            [Curve(each.name, look, _clean(each.controls[period_of, j]), look) for look, each in enumerate(members)],
            band=report.ranges[period_of, j],
            stairs=True,
        )
        for j, axis in enumerate("xyz")
    ]
    miss = report.solution.optimal.miss
    return motion_page(
        f"Rendezvous {rendezvous.name}",
        [
            *([rendezvous.description] if rendezvous.description else []),
            f"least terminal norm {miss:.9g} in {periods} periods of {period_s:g} s; flown on the nonlinear truth",
        ],
        time_s,
        [
            view("Positions, and the tube", 0),
            view("Velocities, and the tube", 3),
            view("Positions in the plane of x and y", 0, (0, 1)),
            view("Positions in the plane of x and z", 0, (0, 2)),
        ],
        graphs,
        [member.name for member in members],
    )


def _clean(controls: Floats) -> Floats:
    """Controls as shown: what is below the programs' own errors is zero."""
    return np.asarray(np.where(np.abs(controls) < _NOTHING, 0.0, controls))
