"""Page of an encounter, on which the meeting can be dragged; costs and trajectories are updated."""

from __future__ import annotations

from importlib import resources
from typing import NamedTuple

import numpy as np

from infoset.arrays import Floats
from infoset.experiments.common.hill_axes import AXES, AXIS_TITLES
from infoset.experiments.common.page_motion import Mark, Track, View, faces_of, motion_page
from infoset.experiments.common.units import length_unit
from infoset.experiments.pareto.report import CHOICES, ParetoReport, imposed_text
from infoset.rendezvous.pareto import EncounterSolution, pareto_set, simplex_weights

MOMENTS = 121
"""Number of times on the page; chosen: the browser updates all of them while a meeting is
dragged.
"""
_SET_POINTS = 600
"""Number of points of a Pareto set that is not a polygon; chosen for its outline to be visible."""


class _Path(NamedTuple):
    """Positions base + slope p of a craft on its way to the meeting with free values p.

    The shapes are (n, 3) and (n, 3, f), m.
    """

    base: Floats
    slope: Floats


def pareto_page(report: ParetoReport) -> str:
    """Return the page of an encounter as HTML."""
    solution = report.solution
    encounter = report.solution.encounter
    start_s = min(craft.start_s for craft in encounter.craft)
    time_s = np.linspace(start_s, encounter.meeting_s, MOMENTS)
    paths = [_affine(solution, index, time_s) for index in range(len(solution.costs))]
    script = (resources.files("infoset.experiments.pareto") / "page.js").read_text(encoding="utf-8")
    return motion_page(
        f"Encounter {report.problem.name}",
        _about(report),
        time_s,
        _views(solution, paths),
        own_script=script,
        own_data=_own_data(report, paths),
    )


def _about(report: ParetoReport) -> list[str]:
    """Return the lines above the views."""
    encounter = report.solution.encounter
    free = ", ".join(component.name.lower() for component in encounter.free)
    about = [
        f"{len(encounter.craft)} craft, {encounter.meeting.value} at {encounter.meeting_s:g} s; "
        f"free components: {free}",
        f"axes: {AXES}",
        "Drag the meeting, or type its components, to see the costs of the craft and the "
        "group loss.",
    ]
    if report.imposed is not None:
        text = imposed_text(report, report.imposed)
        about.append(f"This page is without the bound on the control. {text[0].upper()}{text[1:]}.")
    return about


def _views(solution: EncounterSolution, paths: list[_Path]) -> list[View]:
    """Return the trajectories to the meeting of the solution, in space and in the orbital plane."""
    tracks = [
        Track(cost.craft.name, look, path.base + path.slope @ solution.point)
        for look, (cost, path) in enumerate(zip(solution.costs, paths, strict=True))
    ]
    unit = length_unit(max(float(np.abs(track.points).max()) for track in tracks))
    marks = [Mark("meeting", solution.meeting_state()[:3], "diamond")]
    in_plane = "Seen along the orbit normal"
    return [
        View("Trajectories to the meeting", AXIS_TITLES, unit, tracks, marks, equal=False),
        View(in_plane, AXIS_TITLES, unit, tracks, marks, plane=(1, 0), equal=False),
    ]


def _own_data(report: ParetoReport, paths: list[_Path]) -> dict[str, object]:
    """Return the data of `page.js`, which computes costs and trajectories of other meetings."""
    # Names of positions have one letter, those of velocities two.
    solution = report.solution
    encounter = solution.encounter
    free = [component.name.lower() for component in encounter.free]

    # If all craft have the same M, the Pareto set is the convex hull of the ideals; in two
    # components its outline can be drawn. Else it is shown as points.
    hull: Floats | None = None
    points: object = []
    if solution.same_matrix and len(free) == 2:
        hull = faces_of(solution.ideals)[0]
    else:
        points = pareto_set(solution, simplex_weights(len(paths), _SET_POINTS))
    return {
        "free": [{"name": name, "unit": "m" if len(name) == 1 else "m/s"} for name in free],
        "point": solution.point,
        "craft": [
            {
                "name": cost.craft.name,
                "weight": cost.craft.weight,
                "ideal": cost.ideal,
                "ideal_cost_squared": cost.ideal_cost_squared,
                "root": cost.root,
                "path_base_m": path.base,
                "path_slope": path.slope,
            }
            for cost, path in zip(solution.costs, paths, strict=True)
        ],
        "meeting_base_m": encounter.base[:3],
        "opening": encounter.opening[:3],
        "selections": [
            {"name": CHOICES[rule], "point": point} for rule, point in report.selections.items()
        ],
        "pareto_hull": hull,
        "pareto_points": points,
    }


def _affine(solution: EncounterSolution, index: int, time_s: Floats) -> _Path:
    """Return the path of a craft, which waits until it starts."""
    times = np.maximum(time_s, solution.costs[index].craft.start_s)
    size = len(solution.point)

    def path(point: Floats) -> Floats:
        return np.asarray(solution.plan(index, point).state(times)[:, :3])

    base = path(np.zeros(size))
    return _Path(base, np.stack([path(unit) - base for unit in np.eye(size)], axis=-1))
