"""Compiled 3 x 3 system that couples the extremals of both sides, and Newton's step of both.

All values are nondimensional.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from infoset.rendezvous._arrays import Floats
from infoset.rendezvous._compile import allocation_free, compiled
from infoset.rendezvous.pursuit_evasion._extremal import Response, invert


class Coupling(NamedTuple):
    """Both sides linearised at a guess, and coupled by r_E - r_P = l nu.

    `inverse`, shape (3, 3), gives the change of (nu, T), if T is free, or of (nu, l) for an error
    of that equation, with nu by its two components across. `slope`, shape (15,), is d/dT of
    (pursuer, evader, nu) at l free, and `curvature`, shape (2,), contains the eigenvalues of the
    Hessian of h_P - h_E across nu, ascending. If the equations are singular, `solvable` is False,
    and the rest is not meaningful.
    """

    inverse: Floats
    slope: Floats
    curvature: Floats
    solvable: bool


class Step(NamedTuple):
    """A change of (pursuer, evader, nu, T, l), shape (17,), and its maximum absolute component."""

    change: Floats
    size: float


@compiled
def across(nu: Floats) -> Floats:
    """Return two unit vectors across a unit vector and each other, shape (2, 3).

    References
    ----------
    Duff et al. (2017), Building an orthonormal basis, revisited.
    """
    x = nu[0]
    y = nu[1]
    z = nu[2]
    # With the sign of z, the divisor is never nearer to zero than 1.
    sign = 1.0 if z >= 0.0 else -1.0
    a = -1.0 / (sign + z)
    b = x * y * a
    plane = np.empty((2, 3))
    plane[0, 0] = 1.0 + sign * x * x * a
    plane[0, 1] = sign * b
    plane[0, 2] = -sign * x
    plane[1, 0] = b
    plane[1, 1] = sign + y * y * a
    plane[1, 2] = -y
    return plane


@compiled
def couple(
    pursuer: Response, evader: Response, plane: Floats, nu: Floats, distance: float, time_free: bool
) -> Coupling:
    """Return the coupling of two responses at a guess of `nu` and l.

    The rows of `plane` are the directions across nu.
    """
    outer = np.empty((3, 3))
    inverse = np.empty((3, 3))
    slope = np.empty(15)
    curvature = np.empty(2)
    # d/dT of r_E - r_P at the same nu.
    drift = evader.by_time[:3] - pursuer.by_time[:3]
    for i in range(3):
        for j in range(2):
            outer[i, j] = pursuer.by_nu[i, j] - evader.by_nu[i, j] + distance * plane[j, i]
        outer[i, 2] = nu[i]
    # The slope is at l free; if the time is free, the inverse is computed again below.
    solvable = invert(outer.copy(), inverse) != 0.0

    turn_0, turn_1 = 0.0, 0.0
    for i in range(3):
        turn_0 += inverse[0, i] * drift[i]
        turn_1 += inverse[1, i] * drift[i]
    for i in range(6):
        slope[i] = pursuer.by_time[i] + pursuer.by_nu[i, 0] * turn_0 + pursuer.by_nu[i, 1] * turn_1
        slope[6 + i] = evader.by_time[i] + evader.by_nu[i, 0] * turn_0 + evader.by_nu[i, 1] * turn_1
    for i in range(3):
        slope[12 + i] = turn_0 * plane[0, i] + turn_1 * plane[1, i]

    fill_curvature(pursuer, evader, plane, curvature)
    if time_free:
        for i in range(3):
            outer[i, 2] = -drift[i]
        solvable = solvable and invert(outer, inverse) != 0.0
    return Coupling(inverse, slope, curvature, solvable)


@allocation_free
def fill_curvature(pursuer: Response, evader: Response, plane: Floats, curvature: Floats) -> None:
    """Fill the eigenvalues of the Hessian of h_P - h_E across nu, ascending."""
    along, mixed, beside = 0.0, 0.0, 0.0
    for k in range(3):
        first = pursuer.by_nu[k, 0] - evader.by_nu[k, 0]
        second = pursuer.by_nu[k, 1] - evader.by_nu[k, 1]
        along += plane[0, k] * first
        mixed += 0.5 * (plane[0, k] * second + plane[1, k] * first)
        beside += plane[1, k] * second
    middle = 0.5 * (along + beside)
    apart = math.hypot(0.5 * (along - beside), mixed)
    curvature[0] = middle - apart
    curvature[1] = middle + apart


@compiled
def newton_step(
    pursuer: Response,
    evader: Response,
    plane: Floats,
    inverse: Floats,
    rho: Floats,
    state: Floats,
    time_free: bool,
) -> Step:
    """Return Newton's step of a guess, shape (17,), of (pursuer, evader, nu, T, l).

    `rho`, shape (2, 6), are the corrections of the end states, and `inverse` is that of `couple`
    with the same `time_free`.
    """
    gap = np.empty(3)
    turn = np.zeros(3)
    change = np.empty(17)
    for i in range(3):
        gap[i] = state[6 + i] + rho[1, i] - state[i] - rho[0, i] - state[16] * state[12 + i]
    for i in range(3):
        for j in range(3):
            turn[i] += inverse[i, j] * gap[j]
    change[15] = turn[2] if time_free else 0.0
    change[16] = 0.0 if time_free else turn[2]

    for i in range(6):
        by_time = pursuer.by_time[i] * change[15]
        change[i] = (
            rho[0, i] + pursuer.by_nu[i, 0] * turn[0] + pursuer.by_nu[i, 1] * turn[1] + by_time
        )
        by_time = evader.by_time[i] * change[15]
        change[6 + i] = (
            rho[1, i] + evader.by_nu[i, 0] * turn[0] + evader.by_nu[i, 1] * turn[1] + by_time
        )
    for i in range(3):
        change[12 + i] = turn[0] * plane[0, i] + turn[1] * plane[1, i]
    return Step(change, np.abs(change).max())
