"""Random members of the set of optimal controls, uniform over it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rendezvous.reachability.lifted import Lifted
from rendezvous.reachability.optimal_controls import OptimalControls
from rendezvous.reachability.selection import analytic_point

Floats = NDArray[np.float64]

_STEPS_A_DIMENSION = 20
_INSIDE = 1.0 - 1e-12
_FLATTEST = 1e-15


def samples(optimal: OptimalControls, count: int, generator: np.random.Generator) -> Floats:
    """Draw optimal controls at random.

    Parameters
    ----------
    optimal : OptimalControls
    count : int
        At least 1.
    generator : Generator

    Returns
    -------
    ndarray, shape (count, T, m)

    Raises
    ------
    ValueError
        If the count is less than 1.

    Notes
    -----
    Hit-and-run: as many chains from the analytic centre, 20 d steps each, directions drawn after rounding by the
    Hessian of the barrier. Uniform in the limit; O(count r d) a step.
    """
    if count < 1:
        raise ValueError(f"at least one sample must be drawn, not {count}")
    space = optimal.space
    start, hessian = analytic_point(space, optimal.centre)
    points = np.repeat(start[None, :], count, axis=0)
    if not space.size:
        return optimal.at(points)
    try:
        rounding = np.linalg.inv(np.linalg.cholesky(hessian)).T
    except np.linalg.LinAlgError:  # a set so thin that the Hessian is flat along it by rounding
        steep, ways = np.linalg.eigh(hessian)
        rounding = ways / np.sqrt(np.maximum(steep, _FLATTEST * steep[-1]))
    for _ in range(_STEPS_A_DIMENSION * space.size):
        directions = generator.standard_normal(points.shape) @ rounding.T
        directions /= np.linalg.norm(directions, axis=1)[:, None]
        least, most = _chord(space, points, directions)
        along = least + (most - least) * generator.random(count)
        points = points + (_INSIDE * along)[:, None] * directions
    return optimal.at(points)


def _chord(space: Lifted, points: Floats, directions: Floats) -> tuple[Floats, Floats]:
    """How far lines through points stay inside, backward and forward."""
    slack = space.limits - points @ space.rows.T
    speed = directions @ space.rows.T
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = slack / speed
    most = np.where(speed > 0.0, reach, np.inf).min(axis=1, initial=np.inf)
    least = np.where(speed < 0.0, reach, -np.inf).max(axis=1, initial=-np.inf)
    if space.ball:
        shape = (len(points), -1, space.ball)
        thrust = (space.control_free + points @ space.control_response.T).reshape(shape)
        change = (directions @ space.control_response.T).reshape(shape)
        a, b, c = (change**2).sum(axis=2), (thrust * change).sum(axis=2), (thrust**2).sum(axis=2) - 1.0
        moving = a > 1e-18
        root = np.sqrt(np.maximum(b * b - a * c, 0.0))
        divisor = np.where(moving, a, 1.0)
        most = np.minimum(most, np.where(moving, (root - b) / divisor, np.inf).min(axis=1))
        least = np.maximum(least, np.where(moving, (-root - b) / divisor, -np.inf).max(axis=1))
    return np.minimum(least, 0.0), np.maximum(most, 0.0)
