"""Effects of gravity on a pair of motions beyond first order, for the lower bound of the miss."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from infoset.arrays import Floats
from infoset.guidance import Thruster
from infoset.sim.bound.coasting import Coasting
from infoset.sim.scenario import Sun

IMPULSE_ROUNDING = 1e-12
"""An impulse at the end of a flight counts if its time is later by this share: it is more than the
rounding of a quotient of times, and one impulse more only makes the reserve greater.
"""


@dataclass(frozen=True)
class GravityReserve:
    """Bounds of Lemma 21 of docs/guarantee-bound.md, for any strategy; zero in free space.

    Parameters
    ----------
    position_m, speed_m_s : float
        Maximum second-order part of the difference of the two motions and of its rate.
    across_m_s : float
        Maximum change of the velocity across x by gravity.
    closing_m_s : float
        Minimum closing speed of the flight.
    deviation_m_s : float
        Maximum difference of a closing speed from the one of the motion without impulses.
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


class _HalfDifference(NamedTuple):
    """Moduli of half of the difference to first order, and of its rate, at all times, shape (n,).

    `reach_m` bounds the distance across x at x = 0, `disturbance_m_s2` the target's acceleration.
    """

    half_m: Floats
    rate_m_s: Floats
    reach_m: float
    disturbance_m_s2: float


class _Domain(NamedTuple):
    """Time and space in which Lemma 21 holds, with the symbols of docs/guarantee-bound.md.

    Parameters
    ----------
    gap_s, horizon_s : float
        Time gamma after the arrival that the bounds include, and its end H.
    impulses_m_s : float
        Maximum sum S of the impulses until H.
    size_m : float
        Bound of the deviation of a target, h.
    nearest_m : float
        Minimum distance R from the Sun.
    gradient_per_s2 : float
        G = K/R^3.
    turned : float
        (omega H)^2, with omega^2 = 2 G.
    growth : float
        k = cosh(omega H).
    """

    gap_s: float
    horizon_s: float
    impulses_m_s: float
    size_m: float
    nearest_m: float
    gradient_per_s2: float
    turned: float
    growth: float


class _GravityChanges(NamedTuple):
    """Bounds of Lemma 21.

    Parameters
    ----------
    position_m, speed_m_s : float
        Part 1: epsilon and epsilon'.
    stretch_per_s2 : float
        Part 2: k omega^2 / 6, as in `GravityReserve`.
    deviation_m_s, between_m_s : float
        Part 3: v' at the steps, and v'' between them.
    """

    position_m: float
    speed_m_s: float
    stretch_per_s2: float
    deviation_m_s: float
    between_m_s: float


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
    docs/guarantee-bound.md, Lemma 21 and its corollary, has the symbols and the proof.
    """
    if sun is None:
        return _reserve_in_free_space(motion, reach_m, thruster, step_s)

    axes = motion.axes
    half = _HalfDifference(
        0.5 * np.linalg.norm(difference[:axes], axis=0),
        0.5 * np.linalg.norm(difference[axes:], axis=0),
        reach_m,
        disturbance_m_s2,
    )
    domain = _domain(motion, half, sun, thruster, step_s)
    if domain is None:
        return None
    return _corollary(motion, half, domain, _lemma_21(motion, domain))


def _reserve_in_free_space(
    motion: Coasting, reach_m: float, thruster: Thruster, step_s: float
) -> GravityReserve:
    """Return the reserve without gravity: its effects are 0, and the impulses are counted."""
    closing = motion.closing_speed_m_s
    minimum = float(closing.min())
    return GravityReserve(
        position_m=0.0,
        speed_m_s=0.0,
        across_m_s=0.0,
        closing_m_s=minimum,
        deviation_m_s=0.0,
        nearer_m=np.zeros(len(closing)),
        late_s=0.0,
        drift_m=0.0,
        impulses_m_s=_impulses_until(motion.arrival_s + reach_m / minimum, thruster, step_s),
        stretch_per_s2=0.0,
    )


def _impulses_until(end_s: float, thruster: Thruster, step_s: float) -> float:
    """Return the maximum sum of impulses until a time, m/s; one at that time counts."""
    steps = math.floor(end_s / step_s * (1.0 + IMPULSE_ROUNDING)) + 1
    return min(thruster.budget_m_s, thruster.max_impulse_m_s * steps)


def _domain(
    motion: Coasting, half: _HalfDifference, sun: Sun, thruster: Thruster, step_s: float
) -> _Domain | None:
    """Return the domain of Lemma 21, or None if its assumptions are not met."""
    parameter = sun.gravitational_parameter_m3_s2
    near = motion.nearest_m
    arrival_s = motion.arrival_s

    # The bounds must hold until the closest approach, some time after x = 0: the gap is a guess of
    # this time that `_corollary` checks, twice the one without the effect of gravity on impulses.
    impulses = _impulses_until(arrival_s, thruster, step_s)
    guess_m = impulses * arrival_s * parameter / near**3 * arrival_s**2
    slowest = float(motion.closing_speed_m_s.min())
    gap = max(0.5 * step_s, 2.0 * (half.reach_m + float(half.half_m[-1]) + guess_m) / slowest)
    horizon = arrival_s + gap
    impulses = _impulses_until(horizon, thruster, step_s)

    # The greatest deviation of a target within the gap after each time: at its rate, and by its
    # engine.
    size = float((half.half_m + gap * half.rate_m_s).max()) + 0.5 * half.disturbance_m_s2 * gap**2
    nearest = (
        near
        - motion.speed_m_s * gap
        - 2.0 * parameter * (gap / near) ** 2
        - 2.0 * max(size, impulses * horizon)
    )
    # 2 K (gap / near)^2 bounds the effect of gravity in the gap only if the distance is not halved.
    if nearest < 0.5 * near:
        return None

    gradient = parameter / nearest**3
    turned = 2.0 * gradient * horizon**2
    # The three conditions of Lemma 21, in its symbols k, G gamma^2 and 12 h (k - 1).
    # cosh(2) is more than the limit of 2 below, so that a greater argument is refused too.
    growth = math.cosh(min(math.sqrt(turned), 2.0))
    if growth > 2.0 or gradient * gap**2 > 1.0 / 3.0 or 12.0 * size * (growth - 1.0) > nearest:
        return None
    return _Domain(gap, horizon, impulses, size, nearest, gradient, turned, growth)


def _lemma_21(motion: Coasting, domain: _Domain) -> _GravityChanges:
    """Return the bounds of Lemma 21, whose three conditions `domain` satisfies."""
    axes = motion.axes
    distances = np.linalg.norm(motion.states[:axes], axis=0)
    speeds = np.linalg.norm(motion.states[axes:], axis=0)
    farthest = float((distances + domain.gap_s * speeds).max())
    # Part 1 of the lemma, then the two terms of v' in part 3.
    position = 6.0 * domain.size_m**2 / domain.nearest_m * domain.turned * domain.growth
    by_size = 4.0 * domain.gradient_per_s2 * domain.size_m * domain.horizon_s
    by_impulses = 0.5 * domain.impulses_m_s * domain.turned * domain.growth
    return _GravityChanges(
        position_m=position,
        speed_m_s=2.0 * position / domain.horizon_s,
        stretch_per_s2=domain.gradient_per_s2 * domain.growth / 3.0,
        deviation_m_s=by_size + by_impulses,
        between_m_s=3.0 * domain.gradient_per_s2 * farthest * domain.gap_s,
    )


def _corollary(
    motion: Coasting, half: _HalfDifference, domain: _Domain, changes: _GravityChanges
) -> GravityReserve | None:
    """Return the bounds of equation (25), or None if the closest approach may be after H."""
    # Lateral velocities: after the positions, and before the velocity along x.
    lateral = motion.states[motion.axes : -1]
    turn = float(np.linalg.norm(lateral - lateral[:, :1], axis=0).max())
    slowest = float(motion.closing_speed_m_s.min())
    minimum = slowest - changes.deviation_m_s - changes.between_m_s
    times_s = np.append(motion.times_s[:-1], domain.horizon_s)
    nearer_m = domain.impulses_m_s * changes.stretch_per_s2 * times_s**3
    nearer_end = float(nearer_m[-1])
    # The assumption of the corollary: x = 0 and the closest approach are before the horizon.
    to_pass = nearer_end + changes.position_m + float(half.half_m[-1]) + half.reach_m
    if minimum <= 0.0 or to_pass > domain.gap_s * minimum:
        return None

    # tau and zeta of equation (25) of docs/guarantee-bound.md. The rate is doubled because (25) has
    # that of the whole difference.
    late = (nearer_end + 0.5 * changes.position_m) / minimum
    acceleration = half.disturbance_m_s2 + 4.0 * domain.gradient_per_s2 * domain.size_m
    drift = late * (2.0 * float(half.rate_m_s[-1]) + changes.speed_m_s + acceleration * late)
    return GravityReserve(
        position_m=changes.position_m,
        speed_m_s=changes.speed_m_s,
        across_m_s=turn + changes.deviation_m_s + changes.between_m_s,
        closing_m_s=minimum,
        deviation_m_s=changes.deviation_m_s,
        nearer_m=nearer_m,
        late_s=late,
        drift_m=drift,
        impulses_m_s=domain.impulses_m_s,
        stretch_per_s2=changes.stretch_per_s2,
    )
