"""The B-plane: the plane through the target across the line of approach, with the axes S, T and R."""

from __future__ import annotations

import math

import numpy as np

from infoset.arrays import Floats


def approach_axes(closing_velocity: Floats, pole: Floats) -> Floats:
    """Return the axes (T, R, S) of a B-plane as rows, shape (3, 3).

    S is the direction of the spacecraft's velocity relative to the object, T = S x N / |S x N| with the normal N of
    the reference plane, and R = S x T. T is the line in which the two planes meet. The axes (y, z, x) of a scenario
    with y along T are these.

    Parameters
    ----------
    closing_velocity : ndarray, shape (3,)
        Velocity of the object relative to the spacecraft; S is opposite to it.
    pole : ndarray, shape (3,)
        Normal N of the reference plane, of any length.

    Raises
    ------
    ValueError
        If the approach is along the pole.

    References
    ----------
    Kizner (1961), A method of describing miss distances for lunar and interplanetary trajectories, Planetary and Space
    Science 7.
    """
    along = -closing_velocity / np.linalg.norm(closing_velocity)
    across = np.cross(along, pole)
    size = np.linalg.norm(across)
    if size <= 1e-9 * np.linalg.norm(pole):  # T would be rounding
        raise ValueError("pole: must not be along the line of approach, where T has no direction")
    return np.stack([across / size, np.cross(along, across / size), along])


def b_plane(lateral_m: Floats, t_rad: float | None) -> Floats:
    """Return (B.T, B.R) of positions (y, z) of the object across the approach, shape (B, 2); B x 0 without axes.

    B points from the object to the spacecraft, so it is opposite to (y, z). `t_rad` is the direction of T from y
    toward z, and x is S.
    """
    if t_rad is None:
        return np.empty((len(lateral_m), 0))
    cosine, sine = math.cos(t_rad), math.sin(t_rad)
    return np.asarray(-lateral_m @ np.array([[cosine, -sine], [sine, cosine]]))
