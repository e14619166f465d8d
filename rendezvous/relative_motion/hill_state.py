"""The state of a craft in Hill's axes from the inertial states of two craft."""

from __future__ import annotations

import numpy as np

from infoset.rendezvous._arrays import Floats


def hill_state(craft: Floats, origin: Floats) -> Floats:
    """Return the state of a craft in Hill's axes about another one, shape (6,), m and m/s.

    `craft` and `origin` are positions and velocities in inertial axes, shape (2, 3). The axes turn
    with the radius of the origin, at the rate h / r^2 of its angular momentum h > 0 per mass.
    """
    position, velocity = origin
    momentum = np.cross(position, velocity)
    radial = position / np.linalg.norm(position)
    normal = momentum / np.linalg.norm(momentum)
    axes = np.stack([radial, np.cross(normal, radial), normal])
    rate_rad_s = np.array([0.0, 0.0, np.linalg.norm(momentum) / (position @ position)])

    relative = (craft - origin) @ axes.T
    return np.concatenate([relative[0], relative[1] - np.cross(rate_rad_s, relative[0])])
