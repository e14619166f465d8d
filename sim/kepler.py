"""The truth: heliocentric two-body motion of both craft, as relative motion of a batch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from sim.scenario import Sun

Floats = NDArray[np.float64]

LONGEST_SUBSTEP_S = 0.5
ARRIVAL_LEAPS = 64
Z, X = 0, 1
RELATIVE, SPACECRAFT = 0, 1


@dataclass(frozen=True)
class Sight:
    """The true geometry, one a row.

    Parameters
    ----------
    alpha_rad, omega_rad_s : ndarray, shape (B,)
        Line-of-sight angle and rate, equation (12) of the paper.
    range_m : ndarray, shape (B,)
        Distance between the centres of mass.
    slope, slope_rate_per_s : ndarray, shape (B,)
        z/x, which is tan(alpha) without the rounding of the angle, and its rate.
    """

    alpha_rad: Floats
    omega_rad_s: Floats
    range_m: Floats
    slope: Floats
    slope_rate_per_s: Floats


@dataclass(frozen=True)
class Passage:
    """What one step showed of the closest approach.

    Parameters
    ----------
    passed : ndarray of bool, shape (B,)
        Whether the closest approach lies within the step.
    least_distance_m : ndarray, shape (B,)
        The least distance of those that have passed; infinite for the others, which are still coming nearer.
    """

    passed: NDArray[np.bool_]
    least_distance_m: Floats


class TrueMotion(Protocol):
    """The motion that guidance is flown against."""

    def sight(self) -> Sight:
        """Geometry now."""

    def fire(self, impulse_m_s: Floats) -> None:
        """Change the spacecraft's velocity along z: V_z becomes V_z - k."""

    def advance(self, step_s: float, manoeuvre_m_s2: Floats | None = None) -> Passage:
        """Move one step on, the object accelerating along z, shape (B,), if it manoeuvres."""

    def arrival_s(self) -> Floats:
        """Times from now until x = 0, shape (B,)."""


class KeplerMotion:
    """Relative motion of the object about the spacecraft, both in the Sun's gravity.

    Parameters
    ----------
    position_m, velocity_m_s : ndarray, shape (B, 2)
        Relative (z, x) and (V_z, V_x) at t = 0.
    sun : Sun or None
        None is free space.

    Notes
    -----
    Velocity Verlet on the exact difference of the two accelerations, in substeps of at most 0.5 s: about 1e-8 m over
    100 s here. The spacecraft's own orbit, circular at t = 0 and toward +x, places the Sun; the impulses move it.

    References
    ----------
    Kumkov and Patsko (1997), equations (1) to (3).
    """

    def __init__(self, position_m: Floats, velocity_m_s: Floats, sun: Sun | None) -> None:
        # By coordinate: the relative motion and, below it, the spacecraft's own, shape (2, 2, B).
        self._position = _with_spacecraft(position_m)
        self._velocity = _with_spacecraft(velocity_m_s)
        self._lost = np.zeros(self._position.shape)
        self._sun = sun
        self._manoeuvre: Floats | None = None
        if sun is not None:
            toward_sun = np.array([np.sin(sun.direction_rad), np.cos(sun.direction_rad)])
            along_orbit = np.array([toward_sun[X], -toward_sun[Z]])
            if along_orbit[X] < 0.0:
                along_orbit = -along_orbit
            speed = np.sqrt(sun.gravitational_parameter_m3_s2 / sun.distance_m)
            self._position[:, SPACECRAFT] = (-sun.distance_m * toward_sun)[:, None]
            self._velocity[:, SPACECRAFT] = (speed * along_orbit)[:, None]
        self._acceleration = self._gravity()

    @property
    def position_m(self) -> Floats:
        """Relative (z, x), shape (B, 2)."""
        return np.asarray(self._position[:, RELATIVE].T)

    @property
    def velocity_m_s(self) -> Floats:
        """Relative (V_z, V_x), shape (B, 2)."""
        return np.asarray(self._velocity[:, RELATIVE].T)

    def sight(self) -> Sight:
        """Geometry now."""
        (z, x), (v_z, v_x) = self._position[:, RELATIVE], self._velocity[:, RELATIVE]
        squared, slope = z * z + x * x, z / x
        return Sight(
            alpha_rad=np.arctan2(z, x),
            omega_rad_s=(v_z * x - v_x * z) / squared,
            range_m=np.sqrt(squared),
            slope=slope,
            slope_rate_per_s=(v_z - v_x * slope) / x,
        )

    def fire(self, impulse_m_s: Floats) -> None:
        """Change the spacecraft's velocity along z: V_z becomes V_z - k."""
        self._velocity[Z, RELATIVE] -= impulse_m_s
        self._velocity[Z, SPACECRAFT] += impulse_m_s

    def arrival_s(self) -> Floats:
        """Times from now until x = 0, shape (B,), s.

        Notes
        -----
        The motion without impulses, in 64 leaps and a last straight stretch: impulses are along z, and shift this
        time by far less than a nanosecond.
        """
        free = KeplerMotion.__new__(KeplerMotion)
        free._sun, free._position, free._velocity = self._sun, self._position, self._velocity
        free._manoeuvre, free._acceleration, free._lost = None, self._acceleration, self._lost
        duration = self.position_m[:, X] / -self.velocity_m_s[:, X]
        for _ in range(ARRIVAL_LEAPS):
            free._leap(duration / ARRIVAL_LEAPS)
        return duration - free.position_m[:, X] / free.velocity_m_s[:, X]

    def advance(self, step_s: float, manoeuvre_m_s2: Floats | None = None) -> Passage:
        """Move one step on, the object accelerating along z, shape (B,), if it manoeuvres."""
        if manoeuvre_m_s2 is not None:
            self._manoeuvre = manoeuvre_m_s2
            self._acceleration = self._gravity()
        # In free space the motion over a step is a parabola, which one leap has exactly.
        substeps = 1 if self._sun is None else max(1, int(np.ceil(step_s / LONGEST_SUBSTEP_S * (1.0 - 1e-12))))
        passed = np.zeros(self._position.shape[-1], dtype=bool)
        least = np.full(passed.shape, np.inf)
        for _ in range(substeps):
            before = self._position, self._velocity, self._acceleration
            self._leap(step_s / substeps)
            new = (_dot(self._position[:, RELATIVE], self._velocity[:, RELATIVE]) >= 0.0) & ~passed
            if new.any():
                position, velocity, acceleration = (value[:, RELATIVE, new] for value in before)
                least[new] = closest_distance(position, velocity, acceleration, step_s / substeps)
                passed |= new
        return Passage(passed, least)

    def _leap(self, duration_s: float | Floats) -> None:
        """Move on; the arrays are new ones, so that whoever holds the old ones has the motion before."""
        half = 0.5 * duration_s
        at_middle = self._velocity + half * self._acceleration
        # Rounding would add up over the steps; the set allows for that of one: what each sum loses goes into the next.
        way = duration_s * at_middle + self._lost
        after = self._position + way
        self._lost = way - (after - self._position)
        self._position = after
        self._acceleration = self._gravity()
        self._velocity = at_middle + half * self._acceleration

    def _gravity(self) -> Floats:
        """Relative acceleration, manoeuvre included, and that of the spacecraft, m/s^2, shape (2, 2, B)."""
        if self._sun is None:
            acceleration = np.zeros_like(self._position)
        else:
            from_sun = self._position.copy()
            from_sun[:, RELATIVE] += from_sun[:, SPACECRAFT]
            acceleration = attraction(from_sun, self._sun.gravitational_parameter_m3_s2)
            acceleration[:, RELATIVE] -= acceleration[:, SPACECRAFT]
        if self._manoeuvre is not None:
            acceleration[Z, RELATIVE] += self._manoeuvre
        return acceleration


def attraction(position_m: Floats, gravitational_parameter_m3_s2: float) -> Floats:
    """Acceleration -K r / |r|^3 at positions from the Sun, shape (2, ...), m/s^2."""
    squared = _dot(position_m, position_m)
    return np.asarray(-gravitational_parameter_m3_s2 / (squared * np.sqrt(squared)) * position_m)


def closest_distance(position_m: Floats, velocity_m_s: Floats, acceleration_m_s2: Floats, duration_s: float) -> Floats:
    """Least distance from the origin over a stretch of uniformly accelerated motion that passes it.

    Parameters
    ----------
    position_m, velocity_m_s, acceleration_m_s2 : ndarray, shape (2, B)
    duration_s : float

    Returns
    -------
    ndarray, shape (B,)
        m. Four Newton steps from the straight line's answer.
    """
    moment = np.clip(-_dot(position_m, velocity_m_s) / _dot(velocity_m_s, velocity_m_s), 0.0, duration_s)
    for _ in range(4):
        at = position_m + moment * velocity_m_s + 0.5 * moment**2 * acceleration_m_s2
        speed = velocity_m_s + moment * acceleration_m_s2
        slope = _dot(speed, speed) + _dot(at, acceleration_m_s2)
        moment = np.clip(moment - _dot(at, speed) / slope, 0.0, duration_s)
    at = position_m + moment * velocity_m_s + 0.5 * moment**2 * acceleration_m_s2
    return np.asarray(np.hypot(at[Z], at[X]))


def _dot(first: Floats, second: Floats) -> Floats:
    return np.asarray(first[Z] * second[Z] + first[X] * second[X])


def _with_spacecraft(relative: Floats) -> Floats:
    """By coordinate the relative vectors, shape (B, 2), and a row of zeros for the spacecraft: shape (2, 2, B)."""
    vectors = np.zeros((2, 2, len(relative)))
    vectors[:, RELATIVE] = relative.T
    return vectors
