"""True motion: heliocentric two-body motion of spacecraft and object, as relative motion of a batch."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from infoset._compile import entry, inlined
from sim.scenario import Sun

Floats = NDArray[np.float64]

LONGEST_SUBSTEP_S = 0.5
ARRIVAL_LEAPS = 64
PASSAGE_LEAPS = 8
Z, X = 0, 1
RELATIVE, SPACECRAFT = 0, 1
POSITION, VELOCITY, ACCELERATION, LOST = range(4)
"""Parts of a motion. LOST is the rounding error of the position, which the next step adds again."""


@dataclass(frozen=True)
class Sight:
    """True geometry of each engagement.

    Parameters
    ----------
    alpha_rad, omega_rad_s : ndarray, shape (B,)
        Line-of-sight angle and rate, equation (12) of the paper.
    range_m : ndarray, shape (B,)
        Distance between the centres of mass.
    slope, slope_rate_per_s : ndarray, shape (B,)
        z/x, that is tan(alpha) without the rounding of the angle, and its rate; zero where x is zero.
    """

    alpha_rad: Floats
    omega_rad_s: Floats
    range_m: Floats
    slope: Floats
    slope_rate_per_s: Floats


@dataclass(frozen=True)
class Passage:
    """Closest approaches within one step.

    Parameters
    ----------
    passed : ndarray of bool, shape (B,)
        Whether the closest approach lies within the step.
    least_distance_m : ndarray, shape (B,)
        Least distance where the closest approach lies within the step, infinite elsewhere.
    arrival_s : ndarray, shape (B,)
        Time from the beginning of the step to x = 0 where the closest approach lies within the step, zero elsewhere.
    """

    passed: NDArray[np.bool_]
    least_distance_m: Floats
    arrival_s: Floats


class KeplerMotion:
    """Motion of the object relative to the spacecraft, both in the Sun's gravity.

    Parameters
    ----------
    position_m, velocity_m_s : ndarray, shape (B, 2)
        Relative (z, x) and (V_z, V_x) at t = 0.
    sun : Sun or None
        None is free space.

    Notes
    -----
    Velocity Verlet on the exact difference of the two accelerations, in substeps of at most 0.5 s: about 1e-8 m over
    100 s here. The spacecraft's orbit, circular and toward +x at t = 0, gives the position of the Sun; impulses change
    it.

    References
    ----------
    Kumkov and Patsko (1997), equations (1) to (3).
    """

    def __init__(self, position_m: Floats, velocity_m_s: Floats, sun: Sun | None) -> None:
        # For each coordinate the relative motion and that of the spacecraft.
        self._motion = np.zeros((4, 2, 2, len(position_m)))
        self._motion[POSITION, :, RELATIVE] = position_m.T
        self._motion[VELOCITY, :, RELATIVE] = velocity_m_s.T
        self._manoeuvre = np.zeros(len(position_m))
        self._gravitational_parameter = 0.0
        if sun is not None:
            toward_sun = np.array([np.sin(sun.direction_rad), np.cos(sun.direction_rad)])
            along_orbit = np.array([toward_sun[X], -toward_sun[Z]])
            if along_orbit[X] < 0.0:
                along_orbit = -along_orbit
            speed = np.sqrt(sun.gravitational_parameter_m3_s2 / sun.distance_m)
            self._motion[POSITION, :, SPACECRAFT] = (-sun.distance_m * toward_sun)[:, None]
            self._motion[VELOCITY, :, SPACECRAFT] = (speed * along_orbit)[:, None]
            self._gravitational_parameter = float(sun.gravitational_parameter_m3_s2)
        accelerate_all(self._motion, self._manoeuvre, self._gravitational_parameter)

    @property
    def position_m(self) -> Floats:
        """Relative (z, x), shape (B, 2)."""
        return np.asarray(self._motion[POSITION, :, RELATIVE].T)

    @property
    def velocity_m_s(self) -> Floats:
        """Relative (V_z, V_x), shape (B, 2)."""
        return np.asarray(self._motion[VELOCITY, :, RELATIVE].T)

    def sight(self) -> Sight:
        """Return the present geometry."""
        (z, x), (v_z, v_x) = self._motion[POSITION, :, RELATIVE], self._motion[VELOCITY, :, RELATIVE]
        squared, slope = z * z + x * x, _ratio(z, x)
        return Sight(
            alpha_rad=np.arctan2(z, x),
            omega_rad_s=_ratio(v_z * x - v_x * z, squared),
            range_m=np.sqrt(squared),
            slope=slope,
            slope_rate_per_s=_ratio(v_z - v_x * slope, x),
        )

    def fire(self, impulse_m_s: Floats) -> None:
        """Change the spacecraft's velocity along z: V_z becomes V_z - k."""
        self._motion[VELOCITY, Z, RELATIVE] -= impulse_m_s
        self._motion[VELOCITY, Z, SPACECRAFT] += impulse_m_s

    def arrival_s(self) -> Floats:
        """Return the times from now to x = 0, shape (B,), s.

        Notes
        -----
        The motion without impulses in 64 leaps, and a straight line at the end. Impulses, which are along z, change
        this time through gravity by some nanoseconds.
        """
        return self._time_to_zero(self._motion, self._manoeuvre, ARRIVAL_LEAPS)

    def _time_to_zero(self, motion: Floats, manoeuvre_m_s2: Floats, leaps: int) -> Floats:
        """Return the times to x = 0 of some motions without impulses, s."""
        duration = motion[POSITION, X, RELATIVE] / -motion[VELOCITY, X, RELATIVE]
        for _ in range(leaps):
            motion = self._leap(motion, duration / leaps, manoeuvre_m_s2)
        return np.asarray(duration - motion[POSITION, X, RELATIVE] / motion[VELOCITY, X, RELATIVE])

    def advance(self, step_s: float, manoeuvre_m_s2: Floats | None = None) -> Passage:
        """Advance by one step, with accelerations of the object along z, shape (B,), if it manoeuvres."""
        if manoeuvre_m_s2 is not None:
            self._manoeuvre = manoeuvre_m_s2
            accelerate_all(self._motion, self._manoeuvre, self._gravitational_parameter)
        # In free space one leap gives the exact motion over a step, a parabola.
        free_space = self._gravitational_parameter == 0.0
        substeps = 1 if free_space else max(1, int(np.ceil(step_s / LONGEST_SUBSTEP_S * (1.0 - 1e-12))))
        duration = np.full(self._motion.shape[-1], step_s / substeps)
        passed = np.zeros(self._motion.shape[-1], dtype=bool)
        least, arrival = np.full(passed.shape, np.inf), np.zeros(passed.shape)
        for substep in range(substeps):
            before, self._motion = self._motion, self._leap(self._motion, duration, self._manoeuvre)
            new = (_dot(self._motion[POSITION, :, RELATIVE], self._motion[VELOCITY, :, RELATIVE]) >= 0.0) & ~passed
            if new.any():
                position, velocity, acceleration = before[:LOST, :, RELATIVE, new]
                least[new] = closest_distance(position, velocity, acceleration, step_s / substeps)
                to_zero = self._time_to_zero(
                    np.ascontiguousarray(before[..., new]), self._manoeuvre[new], PASSAGE_LEAPS
                )
                arrival[new] = substep * (step_s / substeps) + to_zero
                passed |= new
        return Passage(passed, least, arrival)

    def _leap(self, motion: Floats, duration_s: Floats, manoeuvre_m_s2: Floats) -> Floats:
        """Return a motion at a later time, in new memory."""
        after = np.empty_like(motion)
        leap_all(motion, duration_s, manoeuvre_m_s2, self._gravitational_parameter, after)
        return after


@inlined
def attraction(z: float, x: float, gravitational_parameter_m3_s2: float) -> tuple[float, float]:
    """Return the acceleration -K r / |r|^3 at a position relative to the Sun, along z and x, m/s^2."""
    squared = z * z + x * x
    share = -gravitational_parameter_m3_s2 / (squared * math.sqrt(squared))
    return share * z, share * x


@entry
def accelerate_all(motion: Floats, manoeuvre_m_s2: Floats, gravitational_parameter_m3_s2: float) -> None:
    """Write the accelerations of a motion, relative and of the spacecraft.

    Parameters
    ----------
    motion : ndarray, shape (4, 2, 2, B)
        Position, velocity, acceleration and lost rounding; along z and x; relative, and of the spacecraft.
    manoeuvre_m_s2 : ndarray, shape (B,)
        Acceleration of the object along z.
    gravitational_parameter_m3_s2 : float
        K of the Sun; zero is free space.
    """
    for b in range(motion.shape[3]):
        for axis in (Z, X):
            for craft in (RELATIVE, SPACECRAFT):
                motion[ACCELERATION, axis, craft, b] = 0.0
        if gravitational_parameter_m3_s2 > 0.0:
            own_z, own_x = motion[POSITION, Z, SPACECRAFT, b], motion[POSITION, X, SPACECRAFT, b]
            z, x = motion[POSITION, Z, RELATIVE, b] + own_z, motion[POSITION, X, RELATIVE, b] + own_x
            object_z, object_x = attraction(z, x, gravitational_parameter_m3_s2)
            own_z, own_x = attraction(own_z, own_x, gravitational_parameter_m3_s2)
            motion[ACCELERATION, Z, SPACECRAFT, b], motion[ACCELERATION, X, SPACECRAFT, b] = own_z, own_x
            motion[ACCELERATION, Z, RELATIVE, b] = object_z - own_z
            motion[ACCELERATION, X, RELATIVE, b] = object_x - own_x
        motion[ACCELERATION, Z, RELATIVE, b] += manoeuvre_m_s2[b]


@entry
def leap_all(
    motion: Floats, duration_s: Floats, manoeuvre_m_s2: Floats, gravitational_parameter_m3_s2: float, after: Floats
) -> None:
    """Write a motion after times of shape (B,), in the form of `accelerate_all`: one step of velocity Verlet."""
    for axis in (Z, X):
        for craft in (RELATIVE, SPACECRAFT):
            for b in range(motion.shape[3]):
                before = motion[POSITION, axis, craft, b]
                half = 0.5 * duration_s[b] * motion[ACCELERATION, axis, craft, b]
                at_middle = motion[VELOCITY, axis, craft, b] + half
                # Rounding errors must not accumulate: the set allows for those of one step.
                way = duration_s[b] * at_middle + motion[LOST, axis, craft, b]
                position = before + way
                after[POSITION, axis, craft, b] = position
                after[LOST, axis, craft, b] = way - (position - before)
                after[VELOCITY, axis, craft, b] = at_middle
    accelerate_all(after, manoeuvre_m_s2, gravitational_parameter_m3_s2)
    for axis in (Z, X):
        for craft in (RELATIVE, SPACECRAFT):
            for b in range(motion.shape[3]):
                after[VELOCITY, axis, craft, b] += 0.5 * duration_s[b] * after[ACCELERATION, axis, craft, b]


def closest_distance(position_m: Floats, velocity_m_s: Floats, acceleration_m_s2: Floats, duration_s: float) -> Floats:
    """Return the least distance (m) from the origin during uniformly accelerated motion, vectors of shape (2, B).

    Four Newton steps, starting from the closest approach of straight motion.
    """
    moment = np.clip(-_dot(position_m, velocity_m_s) / _dot(velocity_m_s, velocity_m_s), 0.0, duration_s)
    for _ in range(4):
        at = position_m + moment * velocity_m_s + 0.5 * moment**2 * acceleration_m_s2
        speed = velocity_m_s + moment * acceleration_m_s2
        slope = _dot(speed, speed) + _dot(at, acceleration_m_s2)
        moment = np.clip(moment - _dot(at, speed) / slope, 0.0, duration_s)
    at = position_m + moment * velocity_m_s + 0.5 * moment**2 * acceleration_m_s2
    return np.asarray(np.hypot(at[Z], at[X]))


def _ratio(over: Floats, under: Floats) -> Floats:
    """Return the quotient; zero where the divisor is zero, where no section exists."""
    return np.divide(over, under, out=np.zeros_like(over), where=under != 0.0)


def _dot(first: Floats, second: Floats) -> Floats:
    return np.asarray(first[Z] * second[Z] + first[X] * second[X])
