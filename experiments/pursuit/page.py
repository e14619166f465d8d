"""Page of a pursuit: orbits, relative motion, distance, thrust directions and masses."""

from __future__ import annotations

import numpy as np

from infoset.arrays import Floats
from infoset.experiments.common.errors import InputError
from infoset.experiments.common.hill_axes import AXES, AXIS_TITLES, INERTIAL_TITLES
from infoset.experiments.common.page_motion import Graph, Mark, PageCurve, Track, View, motion_page
from infoset.experiments.common.units import Unit, length_unit
from infoset.experiments.pursuit.report import (
    INERTIAL_AXES,
    PursuitReport,
    saddle_point,
    thrust_angles,
    verdict_text,
)
from infoset.rendezvous.pursuit_evasion import CaptureHistory, history, orbital_axes

MOMENTS = 301
"""Number of times on the page; chosen for smooth curves."""
_DEGREES = ("deg", 180.0 / np.pi)


def pursuit_page(report: PursuitReport) -> str:
    """Return the page of a game as HTML, with the claim of its certificate.

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
    offset = sampled.pursuer.position_m - sampled.evader.position_m
    frames = orbital_axes(sampled.evader.position_m, sampled.evader.velocity_m_s)
    relative = np.einsum("nij,nj->ni", frames, offset)
    near = length_unit(float(np.abs(relative).max()))
    distance = np.linalg.norm(offset, axis=1)

    about = [
        f"{verdict_text(solution)}; closing speed at the end {capture.closing_speed_m_s:.6g} m/s",
        saddle_point(report.certificate),
        f"axes: {INERTIAL_AXES}; relative to the evader, {AXES}",
    ]
    if problem.description:
        about.insert(0, problem.description)
    return motion_page(
        f"Pursuit {problem.name}",
        about,
        sampled.time_s,
        _views(sampled, relative, near),
        _graphs(sampled, distance, solution.game.capture_radius_m, near),
    )


def _views(sampled: CaptureHistory, relative: Floats, near: Unit) -> list[View]:
    """Return the views of both orbits, and of the pursuer `relative` to the evader, m."""
    pursuer = sampled.pursuer
    evader = sampled.evader
    far = length_unit(float(np.abs(pursuer.position_m).max()))
    marks = [
        Mark("centre of the planet", np.zeros(3), "plus"),
        Mark("capture", evader.position_m[-1], "diamond"),
    ]
    orbits = [Track("pursuer", 0, pursuer.position_m), Track("evader", 1, evader.position_m)]
    path = [Track("pursuer", 0, relative), Track("evader", 1, np.zeros_like(relative))]

    in_plane = "Pursuer relative to the evader, in the orbital plane"
    along_axis = "Both orbits, seen along the planet's axis"
    return [
        View("Both orbits", INERTIAL_TITLES, far, orbits, marks),
        View(in_plane, AXIS_TITLES, near, path, plane=(1, 0)),
        View("Pursuer relative to the evader, in space", AXIS_TITLES, near, path),
        View(along_axis, INERTIAL_TITLES, far, orbits, marks, plane=(0, 1)),
    ]


def _graphs(sampled: CaptureHistory, distance: Floats, radius_m: float, near: Unit) -> list[Graph]:
    """Return the graphs over time: `distance`, m, with the capture radius, thrust and masses."""
    in_plane = []
    out_of_plane = []
    masses = []
    for look, (player, motion) in enumerate(
        (("pursuer", sampled.pursuer), ("evader", sampled.evader))
    ):
        masses.append(PageCurve(player, look, motion.mass_kg))
        if motion.thrust_direction.any():
            angles = thrust_angles(motion)
            in_plane.append(PageCurve(player, look, angles[:, 0]))
            out_of_plane.append(PageCurve(player, look, angles[:, 1]))

    apart = [PageCurve("distance", 0, distance)]
    from_track = "Thrust in the orbital plane, angle from along-track to radial"
    return [
        Graph("Distance between pursuer and evader", "distance", near, apart, [radius_m]),
        Graph(from_track, "in plane", _DEGREES, in_plane),
        Graph("Thrust out of the orbital plane", "out of plane", _DEGREES, out_of_plane),
        Graph("Mass", "mass", ("kg", 1.0), masses),
    ]
