"""The page of visits: the chaser's path, the targets as they move, and the control."""

from __future__ import annotations

import numpy as np

from experiments.common.display_units import length_unit, time_unit
from experiments.common.page_motion import Curve, Graph, Mark, Track, View, motion_page
from experiments.multipoint.tables import Axes
from rendezvous.multipoint import Path, Visits

MOMENTS = 401


def multipoint_page(
    name: str,
    tour: Visits,
    order: tuple[int, ...],
    path: Path,
    axes: Axes,
    greatest_control_m_s2: float | None = None,
) -> str:
    """Return the page of a path that visits targets.

    Parameters
    ----------
    name : str
        Of the problem.
    tour : Visits
    order : tuple of int
        Which target first, second and so on.
    path : Path
    axes : Axes
        What positions are in.
    greatest_control_m_s2 : float or None
        A bound on the control.

    Returns
    -------
    str
        HTML.
    """
    targets, nodes = tour.targets, path.nodes
    start_s, end_s = tour.start_s, float(nodes.arrive_s[-1])
    time_s = np.unique(np.concatenate([np.linspace(start_s, end_s, MOMENTS), nodes.arrive_s]))
    flown, control = path.state(time_s)[:, :3], path.control(time_s)
    tracks = [Track("chaser", 0, flown)]
    for place, target in enumerate(order):
        until = float(nodes.leave_s[place])
        moving = time_s[time_s <= until] if place < len(order) - 1 else time_s
        states = targets.states(np.full(len(moving), target), moving)
        tracks.append(Track(targets.targets[target].name, 1 + place % 4, states[:, :3]))
    marks = [
        Mark("visit" if not place else "", state[:3], "diamond") for place, state in enumerate(path.arrival_states)
    ]
    hill = axes is Axes.HILL
    names = ("x radial", "y along the motion", "z normal") if hill else ("x", "y", "z")
    if not hill:
        marks.append(Mark("centre of attraction", np.zeros(3), "square"))
    unit = length_unit(float(np.abs(flown).max()))
    size = float(np.linalg.norm(control, axis=1).max())
    small = ("mm/s²", 1e3) if size < 1.0 else ("m/s²", 1.0)
    bounds = [] if greatest_control_m_s2 is None else [greatest_control_m_s2]
    clock, per_s = time_unit(end_s - start_s)
    visits = ", ".join(
        f"{targets.targets[target].name} at {time * per_s:.6g} {clock}"
        for target, time in zip(order, nodes.arrive_s, strict=True)
    )
    plane = (1, 0) if hill else (0, 1)
    across = (1, 2) if hill else (0, 2)
    return motion_page(
        f"Visits {name}",
        [f"cost I = {path.cost:.8g} m²/s³", f"order: {visits}"],
        time_s,
        [
            View("The path and the targets until they are left", names, unit, tracks, marks, equal=not hill),
            View("Seen from above", names, unit, tracks, marks, plane=plane, equal=not hill),
            View("Seen from the side", names, unit, tracks, marks, plane=across, equal=False),
        ],
        [
            Graph("Size of the control", "|u|", small, [Curve("|u|", 0, np.linalg.norm(control, axis=1))], bounds),
            Graph("Components of the control", "u", small,
                  [Curve(f"u{letter}", look, control[:, look]) for look, letter in enumerate("xyz")]),
        ],
    )  # fmt: skip
