"""What gravity can change in a pair of motions beyond first order, for the lower bound of the
miss.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from infoset.arrays import Floats
from infoset.guidance import Thruster
from infoset.sim.bound.coasting import Coasting
from infoset.sim.scenario import Sun

ROUNDING = 1e-12
"""Part of a step by which a time may be before a step and still belong to it."""


@dataclass(frozen=True)
class GravityReserve:
    """Bounds of Lemma 21 of docs/guarantee.md, for any strategy; zero in free space.

    Parameters
    ----------
    position_m, speed_m_s : float
        Maximum second-order part of the difference of the two motions and of its rate.
    across_m_s : float
        Maximum change of the velocity across x by gravity.
    closing_m_s : float
        Minimum closing speed of the flight.
    deviation_m_s : float
        Maximum difference of a closing speed from that of the motion without impulses.
    nearer_m : ndarray, shape (n,)
        Maximum change of x by impulses, at the steps and at last until after the arrival.
    late_s : float
        Maximum change of the time when the middle of the two is at x = 0, by impulses.
    drift_m : float
        Maximum change of the difference of the two in that time.
    impulses_m_s : float
        Maximum sum of impulses.
    stretch_per_s2 : float
        An impulse that acts for the time t displaces by its straight line times at most 1 + stretch
        t^2.
    """

    position_m: float
    speed_m_s: float
    across_m_s: float
    closing_m_s: float
    deviation_m_s: float
    nearer_m: Floats
    late_s: float
    drift_m: float
    impulses_m_s: float
    stretch_per_s2: float


def gravity_reserve(
    motion: Coasting,
    difference: Floats,
    reach_m: float,
    disturbance_m_s2: float,
    sun: Sun | None,
    thruster: Thruster,
    step_s: float,
) -> GravityReserve | None:
    """Return the reserve for two motions, or None if gravity is too strong for the proof.

    Parameters
    ----------
    motion : Coasting
        The middle of the two without impulses.
    difference : ndarray, shape (2 C, n)
        Difference of their states to first order.
    reach_m : float
        A bound of the distance across x at x = 0 that is to be proved.
    disturbance_m_s2 : float
        Maximum acceleration of each by its engine.

    Notes
    -----
    docs/guarantee.md, Lemma 21, has the symbols and the proof.
    """
    axes = motion.axes
    arrival_s = motion.arrival_s
    closing = motion.closing_speed_m_s

    def impulses_until(end_s: float) -> float:
        steps = math.floor(end_s / step_s * (1.0 + ROUNDING)) + 1
        return min(thruster.budget_m_s, thruster.max_impulse_m_s * steps)

    if sun is None:
        nothing = np.zeros(len(closing))
        minimum = float(closing.min())
        impulses = impulses_until(arrival_s + reach_m / minimum)
        return GravityReserve(0.0, 0.0, 0.0, minimum, 0.0, nothing, 0.0, 0.0, impulses, 0.0)
    parameter = sun.gravitational_parameter_m3_s2
    near = motion.nearest_m
    half, rate = (
        0.5 * np.linalg.norm(part, axis=0) for part in (difference[:axes], difference[axes:])
    )
    # The proof needs all bounds until the closest approach, some time after x = 0: gap bounds it,
    # as is checked below.
    guess_m = impulses_until(arrival_s) * arrival_s * parameter / near**3 * arrival_s**2
    gap = max(0.5 * step_s, 2.0 * (reach_m + float(half[-1]) + guess_m) / float(closing.min()))
    horizon = arrival_s + gap
    impulses = impulses_until(horizon)
    size = float((half + gap * rate).max()) + 0.5 * disturbance_m_s2 * gap**2
    nearest = (
        near
        - motion.speed_m_s * gap
        - 2.0 * parameter * (gap / near) ** 2
        - 2.0 * max(size, impulses * horizon)
    )
    if nearest < 0.5 * near:
        return None
    gradient = parameter / nearest**3
    turned = 2.0 * gradient * horizon**2  # the square of omega H
    growth = math.cosh(min(math.sqrt(turned), 2.0))
    if growth > 2.0 or gradient * gap**2 > 1.0 / 3.0 or 12.0 * size * (growth - 1.0) > nearest:
        return None
    distances, speeds = (
        np.linalg.norm(part, axis=0) for part in (motion.states[:axes], motion.states[axes:])
    )
    between = 3.0 * gradient * float((distances + gap * speeds).max()) * gap
    deviation = 4.0 * gradient * size * horizon + 0.5 * impulses * turned * growth
    lateral = motion.states[axes:-1]
    across = float(np.linalg.norm(lateral - lateral[:, :1], axis=0).max()) + deviation + between
    minimum = float(closing.min()) - deviation - between
    position = 6.0 * size**2 / nearest * turned * growth
    speed = 2.0 * position / horizon
    stretch = gradient * growth / 3.0
    nearer_m = impulses * stretch * np.append(motion.times_s[:-1], horizon) ** 3
    nearer_end = float(nearer_m[-1])
    if minimum <= 0.0 or nearer_end + position + float(half[-1]) + reach_m > gap * minimum:
        return None
    late = (nearer_end + 0.5 * position) / minimum
    drift = late * (
        2.0 * float(rate[-1]) + speed + (disturbance_m_s2 + 4.0 * gradient * size) * late
    )
    return GravityReserve(
        position, speed, across, minimum, deviation, nearer_m, late, drift, impulses, stretch
    )
