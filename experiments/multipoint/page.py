"""Page of visits: the path of the chaser, the moving targets, and the control."""

from __future__ import annotations

import numpy as np

from infoset.arrays import Floats
from infoset.experiments.common.page_motion import Graph, Mark, PageCurve, Track, View, motion_page
from infoset.experiments.common.units import length_unit
from infoset.experiments.multipoint.report import MultipointReport

MOMENTS = 401
"""Number of equally spaced times on the page, besides the visits; chosen for smooth curves."""


def multipoint_page(report: MultipointReport) -> str:
    """Return the page of a path that visits targets as HTML."""
    path = report.path
    arrive_s = path.nodes.arrive_s
    even_s = np.linspace(report.problem.tour.start_s, report.end_s, MOMENTS)
    time_s = np.unique(np.concatenate([even_s, arrive_s]))

    clock, per_s = report.time_unit
    visits = ", ".join(
        f"{target} at {time * per_s:.6g} {clock}"
        for target, time in zip(report.names, arrive_s, strict=True)
    )
    about = [
        f"cost I = {path.cost:.8g} m²/s³",
        f"order: {visits}",
        f"axes: {report.axes_text}",
        *report.notes,
    ]
    return motion_page(
        f"Visits {report.problem.name}",
        about,
        time_s,
        _views(report, time_s),
        _graphs(report, path.control(time_s)),
    )


def _views(report: MultipointReport, time_s: Floats) -> list[View]:
    """Return the views of the path, in space and along two axes."""
    nodes = report.path.nodes
    positions = report.path.state(time_s)[:, :3]
    tracks = [Track("chaser", 0, positions)]
    for visit, target in enumerate(report.names):
        # The stay with the last target is after the end of the path.
        until_s = nodes.leave_s[visit] if visit < len(report.best.order) - 1 else report.end_s
        tracks.append(
            Track(target, 1 + visit, report.target_path(visit, time_s[time_s <= until_s]))
        )
    # The legend has one entry for all visits.
    marks = [
        Mark("" if visit else "visit", state[:3], "diamond")
        for visit, state in enumerate(report.path.arrival_states)
    ]

    # Orbits have equal scales; relative paths are long and flat.
    hill = report.hill
    above, side = (1, 0), (1, 2)
    if not hill:
        above, side = (0, 1), (0, 2)
        marks.append(Mark("centre of attraction", np.zeros(3), "plus"))
    axes = report.axis_titles
    unit = length_unit(float(np.abs(positions).max()))
    whole = "Path, and targets until the chaser leaves them"
    return [
        View(whole, axes, unit, tracks, marks, equal=not hill),
        View("Seen from above", axes, unit, tracks, marks, plane=above, equal=not hill),
        View("Seen from the side", axes, unit, tracks, marks, plane=side, equal=False),
    ]


def _graphs(report: MultipointReport, control: Floats) -> list[Graph]:
    """Return the graphs of the control, shape (n, 3): magnitude with bound, components."""
    # Small controls are shown in mm/s^2; the limit is chosen.
    magnitude = np.linalg.norm(control, axis=1)
    unit = ("mm/s²", 1e3) if magnitude.max() < 1.0 else ("m/s²", 1.0)
    components = [
        PageCurve(f"u along {title}", look, control[:, look])
        for look, title in enumerate(report.axis_titles)
    ]
    bound_m_s2 = report.problem.max_control_m_s2
    levels = [] if bound_m_s2 is None else [bound_m_s2]
    sizes = [PageCurve("|u|", 0, magnitude)]
    return [
        Graph("Magnitude of the control", "|u|", unit, sizes, levels),
        Graph("Components of the control", "u", unit, components),
    ]
