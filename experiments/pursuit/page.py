"""Page of a pursuit: orbits, relative motion, distance, thrust directions and masses."""

from __future__ import annotations

import numpy as np

from infoset.experiments.common.errors import InputError
from infoset.experiments.common.hill_axes import AXES, AXIS_TITLES, INERTIAL_TITLES
from infoset.experiments.common.page_motion import Graph, Mark, PageCurve, Track, View, motion_page
from infoset.experiments.common.units import length_unit
from infoset.experiments.pursuit.report import (
    INERTIAL_AXES,
    PursuitReport,
    saddle_point,
    thrust_angles,
)
from infoset.rendezvous.pursuit_evasion import history, orbital_axes

MOMENTS = 301
_DEGREES = ("deg", 180.0 / np.pi)


def pursuit_page(report: PursuitReport) -> str:
    """Return the page of a game as HTML, with what its certificate claims.

    Raise `InputError` if the solution has no capture.
    """
    problem = report.problem
    solution = report.solution
    capture = report.solution.capture
    if capture is None:
        raise InputError(
            f"--html: there is no trajectory to show, the result is {solution.verdict.value}; omit "
            "--html"
        )
    sampled = history(solution, MOMENTS)
    pursuer = sampled.pursuer
    evader = sampled.evader
    players = (("pursuer", 0, pursuer), ("evader", 1, evader))
    offset = pursuer.position_m - evader.position_m
    frames = orbital_axes(evader.position_m, evader.velocity_m_s)
    relative = np.einsum("nij,nj->ni", frames, offset)
    far = length_unit(float(np.abs(pursuer.position_m).max()))
    near = length_unit(float(np.abs(relative).max()))
    marks = [
        Mark("centre of the planet", np.zeros(3), "plus"),
        Mark("capture", evader.position_m[-1], "diamond"),
    ]
    tracks = [Track(player, look, motion.position_m) for player, look, motion in players]
    path = [Track("pursuer", 0, relative), Track("evader", 1, np.zeros_like(relative))]
    views = [
        View("Both orbits", INERTIAL_TITLES, far, tracks, marks),
        View(
            "Pursuer relative to the evader, in the orbital plane",
            AXIS_TITLES,
            near,
            path,
            plane=(1, 0),
        ),
        View("Pursuer relative to the evader, in space", AXIS_TITLES, near, path),
        View(
            "Both orbits, seen along the planet's axis",
            INERTIAL_TITLES,
            far,
            tracks,
            marks,
            plane=(0, 1),
        ),
    ]
    distance = PageCurve("distance", 0, np.linalg.norm(offset, axis=1))
    radius = solution.game.capture_radius_m
    directions = [
        (player, look, thrust_angles(motion))
        for player, look, motion in players
        if motion.thrust_direction.any()
    ]
    in_plane, out_of_plane = (
        [PageCurve(player, look, angles[:, component]) for player, look, angles in directions]
        for component in (0, 1)
    )
    masses = [PageCurve(player, look, motion.mass_kg) for player, look, motion in players]
    graphs = [
        Graph("Distance between pursuer and evader", "distance", near, [distance], [radius]),
        Graph(
            "Thrust in the orbital plane, angle from along-track to radial",
            "in plane",
            _DEGREES,
            in_plane,
        ),
        Graph("Thrust out of the orbital plane", "out of plane", _DEGREES, out_of_plane),
        Graph("Mass", "mass", ("kg", 1.0), masses),
    ]
    verdict = (
        f"captured after {capture.time_s:.6g} s, closing speed {capture.closing_speed_m_s:.6g} m/s"
    )
    axes = f"axes: {INERTIAL_AXES}; relative to the evader, {AXES}"
    about = [
        line
        for line in (problem.description, verdict, saddle_point(report.certificate), axes)
        if line
    ]
    return motion_page(f"Pursuit {problem.name}", about, sampled.time_s, views, graphs)
