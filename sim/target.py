"""Acceleration of a manoeuvring target."""

from __future__ import annotations

import math

import numpy as np

from infoset.arrays import Floats
from infoset.sim.scenario import Manoeuvre, Target

PERIOD_ROUNDING = 1e-12
"""Relative margin for the rounding of a time in switching periods. The time is one product and one
quotient: its error is a few 1e-16 for every step. A switch is early by at most 1e-12 of the time.
"""


def acceleration_m_s2(
    target: Target, draws: Floats, step: int, step_s: float, predicted_miss_m: Floats
) -> Floats:
    """Return the lateral acceleration of the targets of a batch over one step, m/s^2, shape (C, B).

    `draws`, shape (C, B, steps), are uniform in [-1, 1]. Of `predicted_miss_m`, shape (C, B), only
    the sign counts, zero as positive, and only for `Manoeuvre.WORST_CASE`: it is the signed
    predicted miss of the true state, or the side to which the noise shifts this state.
    """
    first = _first_side(draws)
    if target.manoeuvre is Manoeuvre.NONE:
        side = np.zeros_like(first)
    elif target.manoeuvre is Manoeuvre.CONSTANT:
        side = first
    elif target.manoeuvre is Manoeuvre.BANG_BANG:
        # A whole number of periods must not be rounded down.
        periods = step * step_s / target.switching_period_s * (1.0 + PERIOD_ROUNDING)
        side = first * (-1.0) ** math.floor(periods)
    elif target.manoeuvre is Manoeuvre.RANDOM_TELEGRAPH:
        # Probability of an odd number of switches within a step of a Poisson process.
        odd = 0.5 * (1.0 - math.exp(-2.0 * step_s / target.switching_period_s))
        # Number 0 is the side at the start; each later step may change it.
        uniform = 0.5 * (1.0 + draws[..., 1 : step + 1])
        switches = uniform < odd
        side = first * (-1.0) ** switches.sum(axis=-1)
    else:
        side = np.where(predicted_miss_m >= 0.0, 1.0, -1.0)
    return np.asarray(amplitudes_m_s2(target, len(draws))[:, None] * side)


def amplitudes_m_s2(target: Target, axes: int) -> Floats:
    """Return the acceleration of a target along each of its lateral axes, z or y and z, m/s^2."""
    along_z = target.acceleration_m_s2
    along_y = target.acceleration_y_m_s2
    if along_y is None:
        along_y = along_z
    return np.array([along_y, along_z][-axes:])


def constant_side(target: Target | None, draws: Floats | None) -> Floats | None:
    """Return the sign of a constant acceleration, shape (C, B); None for other targets."""
    if target is None or draws is None or target.manoeuvre is not Manoeuvre.CONSTANT:
        return None
    return _first_side(draws)


def _first_side(draws: Floats) -> Floats:
    return np.where(draws[..., 0] >= 0.0, 1.0, -1.0)
