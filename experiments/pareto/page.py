"""The page of an encounter: drag the meeting, and see what it costs each craft and the group."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from experiments.common.display_units import length_unit
from experiments.common.page_document import page
from experiments.common.page_motion import Mark, Track, View, faces_of, motion_data
from rendezvous.pareto import EncounterSolution, pareto_set, simplex_weights

Floats = NDArray[np.float64]

MOMENTS = 121
_SET_POINTS = 600


def pareto_page(name: str, solution: EncounterSolution, selections: Mapping[str, Floats]) -> str:
    """Return the page of an encounter.

    Parameters
    ----------
    name : str
        Of the problem.
    solution : EncounterSolution
    selections : mapping of str to ndarray, shape (f,)
        Meetings chosen in several ways.

    Returns
    -------
    str
        HTML.
    """
    encounter = solution.encounter
    free = [each.name.lower() for each in encounter.free]
    starts = [each.start_s for each in encounter.craft]
    time_s = np.linspace(min(starts), encounter.meeting_s, MOMENTS)
    flights = [_affine(solution, index, time_s) for index in range(len(solution.costs))]
    unit = length_unit(max(float(np.abs(base + slope @ solution.point).max()) for base, slope in flights))
    tracks = [
        Track(cost.craft.name, look, base + slope @ solution.point)
        for look, (cost, (base, slope)) in enumerate(zip(solution.costs, flights, strict=True))
    ]
    meeting = Mark("meeting", solution.meeting_state()[:3], "diamond")
    axes = ("x against the motion", "y outward", "z normal")
    views = [
        View("Flights to the meeting", axes, unit, tracks, [meeting], equal=False),
        View("Seen along the orbit's normal", axes, unit, tracks, [meeting], plane=(0, 1), equal=False),
    ]
    hull = solution.same_matrix and len(free) == 2
    weights = simplex_weights(len(tracks), _SET_POINTS)
    heading = f"Encounter {name}"
    about = [
        f"{len(tracks)} craft, {encounter.meeting.value} at {encounter.meeting_s:g} s; free: {', '.join(free)}",
        "Drag the meeting, or type it, and see what it costs each craft and the group.",
    ]
    return page(
        heading,
        ["motion.js", "pareto.js"],
        {
            **motion_data(heading, about, time_s, views, ()),
            "free": [{"name": each, "unit": "m" if each in "xyz" else "m/s"} for each in free],
            "point": solution.point.tolist(),
            "craft": [
                {
                    "name": cost.craft.name,
                    "weight": cost.craft.weight,
                    "ideal": cost.ideal.tolist(),
                    "ideal_cost_squared": cost.ideal_cost_squared,
                    "root": cost.root.tolist(),
                    "path_base_m": base.tolist(),
                    "path_slope": slope.tolist(),
                }
                for cost, (base, slope) in zip(solution.costs, flights, strict=True)
            ],
            "meeting_base_m": encounter.base[:3].tolist(),
            "opening": encounter.opening[:3].tolist(),
            "selections": [
                {"name": each.replace("_", " "), "point": np.asarray(point).tolist()}
                for each, point in selections.items()
            ],
            # With one M for all craft the Pareto set is the hull of the ideals; else it is curved, and shown by points.
            "pareto_hull": faces_of(solution.ideals)[0].tolist() if hull else None,
            "pareto_points": [] if hull else pareto_set(solution, weights).points.tolist(),
        },
    )


def _affine(solution: EncounterSolution, index: int, time_s: Floats) -> tuple[Floats, Floats]:
    """A craft's path as base + slope p at times, before its start where it starts: shapes (n, 3) and (n, 3, f)."""
    times = np.maximum(time_s, solution.costs[index].craft.start_s)
    size = len(solution.point)

    def path(point: Floats) -> Floats:
        return np.asarray(solution.plan(index, point).state(times)[:, :3])

    base = path(np.zeros(size))
    return base, np.stack([path(unit) - base for unit in np.eye(size)], axis=-1)
