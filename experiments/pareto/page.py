"""Page of an encounter: the user drags the meeting, and costs and trajectories follow."""

from __future__ import annotations

from importlib import resources

import numpy as np

from infoset.arrays import Floats
from infoset.experiments.common.hill_axes import AXES, AXIS_TITLES
from infoset.experiments.common.page_motion import Mark, Track, View, faces_of, motion_page
from infoset.experiments.common.units import length_unit
from infoset.experiments.pareto.report import CHOICES, ParetoReport, imposed_text
from infoset.rendezvous.pareto import EncounterSolution, pareto_set, simplex_weights

MOMENTS = 121
_SET_POINTS = 600


def pareto_page(report: ParetoReport) -> str:
    """Return the page of an encounter as HTML."""
    solution = report.solution
    encounter = report.solution.encounter
    free = [component.name.lower() for component in encounter.free]
    time_s = np.linspace(
        min(craft.start_s for craft in encounter.craft), encounter.meeting_s, MOMENTS
    )
    paths = [_affine(solution, index, time_s) for index in range(len(solution.costs))]
    tracks = [
        Track(cost.craft.name, look, base + slope @ solution.point)
        for look, (cost, (base, slope)) in enumerate(zip(solution.costs, paths, strict=True))
    ]
    unit = length_unit(max(float(np.abs(track.points).max()) for track in tracks))
    meeting = Mark("meeting", solution.meeting_state()[:3], "diamond")
    views = [
        View("Trajectories to the meeting", AXIS_TITLES, unit, tracks, [meeting], equal=False),
        View(
            "Seen along the orbit normal",
            AXIS_TITLES,
            unit,
            tracks,
            [meeting],
            plane=(1, 0),
            equal=False,
        ),
    ]
    hull = solution.same_matrix and len(free) == 2
    about = [
        f"{len(tracks)} craft, {encounter.meeting.value} at {encounter.meeting_s:g} s; "
        f"free components: {', '.join(free)}",
        f"axes: {AXES}",
        (
            "Drag the meeting, or type its components, to see the costs of the craft and the "
            "group loss."
        ),
    ]
    if report.imposed is not None:
        about.append(
            "This page is without the bound on the control. "
            f"{_sentence(imposed_text(report, report.imposed))}"
        )
    data = {
        "free": [{"name": name, "unit": "m" if len(name) == 1 else "m/s"} for name in free],
        "point": solution.point,
        "craft": [
            {
                "name": cost.craft.name,
                "weight": cost.craft.weight,
                "ideal": cost.ideal,
                "ideal_cost_squared": cost.ideal_cost_squared,
                "root": cost.root,
                "path_base_m": base,
                "path_slope": slope,
            }
            for cost, (base, slope) in zip(solution.costs, paths, strict=True)
        ],
        "meeting_base_m": encounter.base[:3],
        "opening": encounter.opening[:3],
        "selections": [
            {"name": CHOICES[rule], "point": point} for rule, point in report.selections.items()
        ],
        # If all craft have the same M, the Pareto set is the convex hull of the ideals; else it is
        # shown as points.
        "pareto_hull": faces_of(solution.ideals)[0] if hull else None,
        "pareto_points": []
        if hull
        else pareto_set(solution, simplex_weights(len(tracks), _SET_POINTS)),
    }
    script = (resources.files("infoset.experiments.pareto") / "page.js").read_text(encoding="utf-8")
    return motion_page(
        f"Encounter {report.problem.name}", about, time_s, views, own_script=script, own_data=data
    )


def _sentence(text: str) -> str:
    return f"{text[0].upper()}{text[1:]}."


def _affine(solution: EncounterSolution, index: int, time_s: Floats) -> tuple[Floats, Floats]:
    """Return the path of a craft as base + slope p, with shapes (n, 3) and (n, 3, f); it waits
    until it starts.
    """
    times = np.maximum(time_s, solution.costs[index].craft.start_s)
    size = len(solution.point)

    def path(point: Floats) -> Floats:
        return np.asarray(solution.plan(index, point).state(times)[:, :3])

    base = path(np.zeros(size))
    return base, np.stack([path(unit) - base for unit in np.eye(size)], axis=-1)
