"""Kernel of the nonlinear two-body problem: states and costates, and their derivatives by initial values.

Lengths and times are such that the gravitational parameter is one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rendezvous._compile import allocation_free, compiled
from rendezvous.dormand_prince import STAGES, step_of

Floats = NDArray[np.float64]

STEP_RAD = 0.1
MOST_STEPS = 50_000
LEAST_RADIUS = 0.02
"""A trajectory nearer to the centre, relative to its initial distance, counts as falling into it."""


@allocation_free
def _rates(_time: float, _y: Floats, z: Floats, _parameters: tuple[()], _dy: Floats, slope: Floats) -> None:
    """Time derivatives of z in column 0, and of its variations in the others."""
    r0, r1, r2 = z[0, 0], z[1, 0], z[2, 0]
    l0, l1, l2 = z[9, 0], z[10, 0], z[11, 0]
    squared = r0 * r0 + r1 * r1 + r2 * r2
    third = 1.0 / (squared * np.sqrt(squared))
    fifth = third / squared
    along = r0 * l0 + r1 * l1 + r2 * l2
    slope[12, 0] = 0.5 * (l0 * l0 + l1 * l1 + l2 * l2)
    for column in range(z.shape[1]):
        for axis in range(3):
            slope[axis, column] = z[3 + axis, column]
            slope[9 + axis, column] = -z[6 + axis, column]
    for axis in range(3):
        slope[3 + axis, 0] = -third * z[axis, 0] + z[9 + axis, 0]
        slope[6 + axis, 0] = third * z[9 + axis, 0] - 3.0 * fifth * along * z[axis, 0]
    for column in range(1, z.shape[1]):
        d0, d1, d2 = z[0, column], z[1, column], z[2, column]
        e0, e1, e2 = z[9, column], z[10, column], z[11, column]
        out = r0 * d0 + r1 * d1 + r2 * d2
        turned = l0 * d0 + l1 * d1 + l2 * d2
        costate = r0 * e0 + r1 * e1 + r2 * e2
        for axis in range(3):
            position, primer = z[axis, 0], z[9 + axis, 0]
            slope[3 + axis, column] = 3.0 * fifth * out * position - third * z[axis, column] + z[9 + axis, column]
            second = 3.0 * fifth * (along * z[axis, column] + position * turned + primer * out)
            second -= 15.0 * fifth / squared * along * out * position
            first = 3.0 * fifth * costate * position - third * z[9 + axis, column]
            slope[6 + axis, column] = -first - second


_step = step_of(_rates)


@compiled
def propagate(z: Floats, duration: float) -> bool:
    """Propagate (r, v, lambda_r, lambda_v, energy), in column 0 of z, and its variations in place; z is (13, 1 + m).

    Returns whether the trajectory neither falls into the centre nor takes too many steps. The energy is not varied.

    Notes
    -----
    The method of Dormand and Prince of order 8 in steps of 0.1 radians of the circular orbit at the present distance:
    relative errors of about 1e-12 a revolution.
    """
    slopes, z_next = np.zeros((STAGES, *z.shape)), np.zeros(z.shape)
    no_y, no_slopes = np.zeros(0), np.zeros((STAGES, 0))
    left = duration
    for _ in range(MOST_STEPS):
        radius = np.sqrt(z[0, 0] ** 2 + z[1, 0] ** 2 + z[2, 0] ** 2)
        if not radius > LEAST_RADIUS:
            return False
        step = min(left, STEP_RAD * radius * np.sqrt(radius))
        if left - step < 1e-3 * step:
            step = left
        _step(0.0, step, 0, no_y, z, (), no_slopes, slopes, no_y, z_next)
        for i in range(z.shape[0]):
            for j in range(z.shape[1]):
                z[i, j] = z_next[i, j]
        left -= step
        if left <= 0.0:
            return True
    return False
