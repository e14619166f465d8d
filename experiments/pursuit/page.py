"""The page of a pursuit: both orbits, what the evader sees of the pursuer, distance and thrust."""

from __future__ import annotations

import numpy as np

from experiments.common.display_units import length_unit
from experiments.common.page_motion import Curve, Graph, Mark, Track, View, motion_page
from rendezvous.pursuit_evasion import Solution, history
from rendezvous.pursuit_evasion.history import orbital_axes

MOMENTS = 301


def pursuit_page(name: str, description: str, solution: Solution) -> str:
    """Return the page of a game.

    Parameters
    ----------
    name, description : str
        Of the problem.
    solution : Solution
        With a capture, or with a fallback.

    Returns
    -------
    str
        HTML.

    Raises
    ------
    ValueError
        If there is no capture to show.
    """
    sampled = history(solution, MOMENTS)
    pursuer, evader = sampled.pursuer, sampled.evader
    players = (("pursuer", 0, pursuer), ("evader", 1, evader))
    offset = pursuer.position_m - evader.position_m
    frames = orbital_axes(evader.position_m, evader.velocity_m_s)
    # Along the motion, normal, outward: the last is drawn upright.
    relative = np.einsum("nij,nj->ni", frames, offset)[:, [1, 2, 0]]
    size = float(np.abs(pursuer.position_m).max())
    centre, end = Mark("centre of the planet", np.zeros(3), "square"), Mark("capture", evader.position_m[-1], "diamond")
    tracks = [Track(called, look, each.position_m) for called, look, each in players]
    seen = [Track("pursuer", 0, relative)]
    here = [Mark("evader", np.zeros(3), "cross")]
    near, axes = length_unit(float(np.abs(relative).max())), ("along the motion", "normal", "outward")
    angles = [_thrust_angles(each.position_m, each.velocity_m_s, each.thrust_direction) for _, _, each in players]
    thrusting = [each.thrust_direction.any() for _, _, each in players]
    graphs = [
        Graph("Distance between the two", "distance", near, [Curve("distance", 0, np.linalg.norm(offset, axis=1))],
              [solution.game.capture_radius_m]),
        *(
            Graph(caption, title, ("deg", 180.0 / np.pi),
                  [Curve(called, look, angle[:, which]) for (called, look, _), angle, on
                   in zip(players, angles, thrusting, strict=True) if on])
            for which, (caption, title) in enumerate(
                (("Thrust in the orbit's plane, from along the motion to outward", "in the plane"),
                 ("Thrust out of the orbit's plane", "out of the plane")))
        ),
        Graph("Mass", "mass", ("kg", 1.0), [Curve(called, look, each.mass_kg) for called, look, each in players]),
    ]  # fmt: skip
    return motion_page(
        f"Pursuit {name}",
        [each for each in (description, _verdict(solution)) if each],
        sampled.time_s,
        [
            View("Both orbits", ("x", "y", "z"), length_unit(size), tracks, [centre, end]),
            View("As the evader sees the pursuer", axes, near, seen, here, plane=(0, 2)),
            View("The same in space", axes, near, seen, here),
            View("Both orbits, along the planet's axis", ("x", "y", "z"), length_unit(size), tracks, [centre, end],
                 plane=(0, 1)),
        ],
        graphs,
    )  # fmt: skip


def _verdict(solution: Solution) -> str:
    capture = solution.capture
    if capture is None:
        return f"{solution.verdict.value}: what another route found is shown, and nothing is claimed of it"
    return f"{solution.verdict.value} after {capture.time_s:.6g} s, closing at {capture.closing_speed_m_s:.6g} m/s"


def _thrust_angles(position_m: np.ndarray, velocity_m_s: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Angles of the thrust in the craft's own orbital frame, rad, shape (n, 2)."""
    u = np.einsum("nij,nj->ni", orbital_axes(position_m, velocity_m_s), direction)
    return np.stack([np.unwrap(np.arctan2(u[:, 0], u[:, 1])), np.arcsin(np.clip(u[:, 2], -1.0, 1.0))], axis=1)
