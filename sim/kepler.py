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


@dataclass(frozen=True)
class Sight:
    """The true geometry, one a row.

    Parameters
    ----------
    alpha_rad, omega_rad_s : ndarray, shape (B,)
        Line-of-sight angle and rate, equation (12) of the paper.
    range_m : ndarray, shape (B,)
        Distance between the centres of mass.
    """

    alpha_rad: Floats
    omega_rad_s: Floats
    range_m: Floats


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
        # The relative motion and, below it, the spacecraft's own: shape (2, B, 2).
        self._position = np.stack([position_m.astype(np.float64), np.zeros(position_m.shape)])
        self._velocity = np.stack([velocity_m_s.astype(np.float64), np.zeros(position_m.shape)])
        self._sun = sun
        self._manoeuvre: Floats | None = None
        if sun is not None:
            toward_sun = np.array([np.sin(sun.direction_rad), np.cos(sun.direction_rad)])
            along_orbit = np.array([toward_sun[X], -toward_sun[Z]])
            if along_orbit[X] < 0.0:
                along_orbit = -along_orbit
            self._position[1] = -sun.distance_m * toward_sun
            self._velocity[1] = np.sqrt(sun.gravitational_parameter_m3_s2 / sun.distance_m) * along_orbit
        self._acceleration = self._gravity()

    @property
    def position_m(self) -> Floats:
        """Relative (z, x), shape (B, 2)."""
        return np.asarray(self._position[0])

    @property
    def velocity_m_s(self) -> Floats:
        """Relative (V_z, V_x), shape (B, 2)."""
        return np.asarray(self._velocity[0])

    def sight(self) -> Sight:
        """Geometry now."""
        z, x = self.position_m[:, Z], self.position_m[:, X]
        squared = z * z + x * x
        return Sight(
            alpha_rad=np.arctan2(z, x),
            omega_rad_s=(self.velocity_m_s[:, Z] * x - self.velocity_m_s[:, X] * z) / squared,
            range_m=np.sqrt(squared),
        )

    def fire(self, impulse_m_s: Floats) -> None:
        """Change the spacecraft's velocity along z: V_z becomes V_z - k."""
        self._velocity[0, :, Z] -= impulse_m_s
        self._velocity[1, :, Z] += impulse_m_s

    def arrival_s(self) -> Floats:
        """Times from now until x = 0, shape (B,), s.

        Notes
        -----
        The motion without impulses, in 64 leaps and a last straight stretch: impulses are along z, and shift this
        time by far less than a nanosecond.
        """
        free = KeplerMotion.__new__(KeplerMotion)
        free._sun, free._position, free._velocity = self._sun, self._position.copy(), self._velocity.copy()
        free._manoeuvre, free._acceleration = None, self._acceleration
        duration = self.position_m[:, X] / -self.velocity_m_s[:, X]
        for _ in range(ARRIVAL_LEAPS):
            free._leap((duration / ARRIVAL_LEAPS)[:, None])
        return duration - free.position_m[:, X] / free.velocity_m_s[:, X]

    def advance(self, step_s: float, manoeuvre_m_s2: Floats | None = None) -> Passage:
        """Move one step on, the object accelerating along z, shape (B,), if it manoeuvres."""
        if manoeuvre_m_s2 is not None:
            self._manoeuvre = manoeuvre_m_s2
            self._acceleration = self._gravity()
        substeps = max(1, int(np.ceil(step_s / LONGEST_SUBSTEP_S * (1.0 - 1e-12))))
        passed = np.zeros(len(self.position_m), dtype=bool)
        least = np.full(len(self.position_m), np.inf)
        for _ in range(substeps):
            before = self.position_m.copy(), self.velocity_m_s.copy(), self._acceleration[0]
            self._leap(step_s / substeps)
            new = (_dot(self.position_m, self.velocity_m_s) >= 0.0) & ~passed
            if new.any():
                position, velocity, acceleration = (value[new] for value in before)
                least[new] = closest_distance(position, velocity, acceleration, step_s / substeps)
                passed |= new
        return Passage(passed, least)

    def _leap(self, duration_s: float | Floats) -> None:
        half = 0.5 * duration_s
        self._velocity += half * self._acceleration
        self._position += duration_s * self._velocity
        self._acceleration = self._gravity()
        self._velocity += half * self._acceleration

    def _gravity(self) -> Floats:
        """Relative acceleration, manoeuvre included, and that of the spacecraft, m/s^2, shape (2, B, 2)."""
        if self._sun is None:
            acceleration = np.zeros_like(self._position)
        else:
            from_sun = self._position.copy()
            from_sun[0] += from_sun[1]
            acceleration = attraction(from_sun, self._sun.gravitational_parameter_m3_s2)
            acceleration[0] -= acceleration[1]
        if self._manoeuvre is not None:
            acceleration[0, :, Z] += self._manoeuvre
        return acceleration


def attraction(position_m: Floats, gravitational_parameter_m3_s2: float) -> Floats:
    """Acceleration -K r / |r|^3 at positions from the Sun, shape (..., 2), m/s^2."""
    squared = _dot(position_m, position_m)
    return (-gravitational_parameter_m3_s2 / (squared * np.sqrt(squared)))[..., None] * position_m


def closest_distance(position_m: Floats, velocity_m_s: Floats, acceleration_m_s2: Floats, duration_s: float) -> Floats:
    """Least distance from the origin over a stretch of uniformly accelerated motion that passes it.

    Parameters
    ----------
    position_m, velocity_m_s, acceleration_m_s2 : ndarray, shape (B, 2)
    duration_s : float

    Returns
    -------
    ndarray, shape (B,)
        m. Four Newton steps from the straight line's answer.
    """
    moment = np.clip(-_dot(position_m, velocity_m_s) / _dot(velocity_m_s, velocity_m_s), 0.0, duration_s)
    for _ in range(4):
        at = position_m + moment[:, None] * velocity_m_s + (0.5 * moment**2)[:, None] * acceleration_m_s2
        speed = velocity_m_s + moment[:, None] * acceleration_m_s2
        slope = _dot(speed, speed) + _dot(at, acceleration_m_s2)
        moment = np.clip(moment - _dot(at, speed) / slope, 0.0, duration_s)
    at = position_m + moment[:, None] * velocity_m_s + (0.5 * moment**2)[:, None] * acceleration_m_s2
    return np.hypot(at[:, Z], at[:, X])


def _dot(first: Floats, second: Floats) -> Floats:
    return first[..., Z] * second[..., Z] + first[..., X] * second[..., X]
