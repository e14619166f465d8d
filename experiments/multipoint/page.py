"""Page of visits: the path of the chaser, the moving targets, and the control."""

from __future__ import annotations

import numpy as np

from infoset.experiments.common.page_motion import Graph, Mark, PageCurve, Track, View, motion_page
from infoset.experiments.common.units import length_unit
from infoset.experiments.multipoint.report import MultipointReport

MOMENTS = 401


def multipoint_page(report: MultipointReport) -> str:
    """Return the page of a path that visits targets as HTML."""
    path = report.path
    nodes = report.path.nodes
    bound_m_s2 = report.problem.max_control_m_s2
    time_s = np.unique(
        np.concatenate(
            [np.linspace(report.problem.tour.start_s, report.end_s, MOMENTS), nodes.arrive_s]
        )
    )
    positions = path.state(time_s)[:, :3]
    control = path.control(time_s)
    tracks = [Track("chaser", 0, positions)]
    for visit, target in enumerate(report.names):
        until_s = nodes.leave_s[visit] if visit < len(report.best.order) - 1 else report.end_s
        tracks.append(
            Track(target, 1 + visit, report.target_path(visit, time_s[time_s <= until_s]))
        )
    marks = [
        Mark("" if visit else "visit", state[:3], "diamond")
        for visit, state in enumerate(path.arrival_states)
    ]
    hill = report.hill
    axes = report.axis_titles
    if not hill:
        marks.append(Mark("centre of attraction", np.zeros(3), "plus"))
    unit = length_unit(float(np.abs(positions).max()))
    above, side = ((1, 0), (1, 2)) if hill else ((0, 1), (0, 2))
    views = [
        View(
            "Path, and targets until the chaser leaves them",
            axes,
            unit,
            tracks,
            marks,
            equal=not hill,
        ),
        View("Seen from above", axes, unit, tracks, marks, plane=above, equal=not hill),
        View("Seen from the side", axes, unit, tracks, marks, plane=side, equal=False),
    ]
    magnitude = np.linalg.norm(control, axis=1)
    control_unit = ("mm/s²", 1e3) if magnitude.max() < 1.0 else ("m/s²", 1.0)
    components = [
        PageCurve(f"u along {title}", look, control[:, look]) for look, title in enumerate(axes)
    ]
    levels = [] if bound_m_s2 is None else [bound_m_s2]
    graphs = [
        Graph(
            "Magnitude of the control",
            "|u|",
            control_unit,
            [PageCurve("|u|", 0, magnitude)],
            levels,
        ),
        Graph("Components of the control", "u", control_unit, components),
    ]
    clock, per_s = report.time_unit
    visits = ", ".join(
        f"{target} at {time * per_s:.6g} {clock}"
        for target, time in zip(report.names, nodes.arrive_s, strict=True)
    )
    about = [
        f"cost I = {path.cost:.8g} m²/s³",
        f"order: {visits}",
        f"axes: {report.axes_text}",
        *report.notes,
    ]
    return motion_page(f"Visits {report.problem.name}", about, time_s, views, graphs)
