"""True motion: heliocentric two-body motion of spacecraft and object, as relative motion of a batch."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import reduce

import numpy as np

from infoset._compile import entry, inlined
from infoset.arrays import Flags, Floats
from sim.scenario import Scenario, Sun

LONGEST_SUBSTEP_S = 0.5
"""Greatest length of a substep, s, if longer ones are not accurate enough for a scenario (`longest_substep_s`)."""
POSITION_ERROR_M = 1e-3
"""Error of the position over a flight that allows longer substeps."""
ARRIVAL_LEAPS = 64
PASSAGE_LEAPS = 8
X = -1
"""Axis x of a motion, after the lateral axes: z in a plane, y and z in space."""
RELATIVE, SPACECRAFT = 0, 1
POSITION, VELOCITY, ACCELERATION, LOST = range(4)
"""Parts of a motion. LOST is the rounding error of the position, which the next step adds again."""


@dataclass(frozen=True)
class Sight:
    """True geometry of each engagement, arrays of shape (B,); in space (2, B), for the planes (x, y) and (x, z).

    Parameters
    ----------
    alpha_rad, omega_rad_s : ndarray
        Line-of-sight angle and rate, equation (12) of the paper.
    range_m : ndarray, shape (B,)
        Distance between the centres of mass.
    slope, slope_rate_per_s : ndarray
        z/x, that is tan(alpha) without the rounding of the angle, and its rate; zero where x is zero. In space y/x and
        z/x.
    """

    alpha_rad: Floats
    omega_rad_s: Floats
    range_m: Floats
    slope: Floats
    slope_rate_per_s: Floats


@dataclass(frozen=True)
class Passage:
    """Closest approaches within one step, arrays of shape (B,).

    Parameters
    ----------
    passed : ndarray of bool
        Whether the closest approach lies within the step. Elsewhere the distance is infinite and the others are zero.
    arrival_s : ndarray
        Time from the beginning of the step to x = 0.
    lateral_m : ndarray, shape (B,), or (2, B) in space
        z, or (y, z), at the closest approach.
    """

    passed: Flags
    least_distance_m: Floats
    arrival_s: Floats
    lateral_m: Floats


class KeplerMotion:
    """Motion of the object relative to the spacecraft, both in the Sun's gravity, or in free space without a `sun`.

    `position_m` and `velocity_m_s` are the relative (z, x) and (V_z, V_x) at t = 0, shape (B, 2); in space (y, z, x)
    and (V_y, V_z, V_x), shape (B, 3). Velocity Verlet on the exact difference of the two accelerations, in substeps of
    at most `substep_s`: with 0.5 s about 1e-8 m over 100 s here. The spacecraft's orbit is circular at t = 0, in the
    plane of the Sun and the x axis and toward +x; it gives the position of the Sun. Impulses change it.

    References
    ----------
    Kumkov and Patsko (1997), equations (1) to (3).
    """

    def __init__(
        self, position_m: Floats, velocity_m_s: Floats, sun: Sun | None, substep_s: float = LONGEST_SUBSTEP_S
    ) -> None:
        self._substep_s = substep_s
        batch, axes = position_m.shape
        # For each axis the relative motion and that of the spacecraft.
        self._motion = np.zeros((4, axes, 2, batch))
        self._motion[POSITION, :, RELATIVE] = position_m.T
        self._motion[VELOCITY, :, RELATIVE] = velocity_m_s.T
        # An index of one axis and a slice of two: arrays of shape (B,) in a plane, (2, B) in space.
        self._lateral: int | slice = 0 if axes == 2 else slice(0, 2)
        self._manoeuvre = np.zeros((axes - 1, batch))
        self._gravitational_parameter = 0.0
        if sun is not None:
            toward_sun, along_orbit = sun_and_orbit(sun)
            speed = np.sqrt(sun.gravitational_parameter_m3_s2 / sun.distance_m)
            self._motion[POSITION, :, SPACECRAFT] = (-sun.distance_m * toward_sun[-axes:])[:, None]
            self._motion[VELOCITY, :, SPACECRAFT] = (speed * along_orbit[-axes:])[:, None]
            self._gravitational_parameter = float(sun.gravitational_parameter_m3_s2)
        accelerate_all(self._motion, self._manoeuvre, self._gravitational_parameter)

    @property
    def position_m(self) -> Floats:
        """Relative (z, x), shape (B, 2); in space (y, z, x), shape (B, 3)."""
        return np.asarray(self._motion[POSITION, :, RELATIVE].T)

    @property
    def velocity_m_s(self) -> Floats:
        """Relative (V_z, V_x), shape (B, 2); in space (V_y, V_z, V_x), shape (B, 3)."""
        return np.asarray(self._motion[VELOCITY, :, RELATIVE].T)

    def sight(self) -> Sight:
        """Return the present geometry."""
        position, velocity = self._motion[POSITION, :, RELATIVE], self._motion[VELOCITY, :, RELATIVE]
        lateral, x, speed, v_x = position[self._lateral], position[X], velocity[self._lateral], velocity[X]
        slope = _ratio(lateral, x)
        return Sight(
            alpha_rad=np.arctan2(lateral, x),
            omega_rad_s=_ratio(speed * x - v_x * lateral, lateral * lateral + x * x),
            range_m=np.sqrt(_dot(position, position)),
            slope=slope,
            slope_rate_per_s=_ratio(speed - v_x * slope, x),
        )

    def fire(self, impulse_m_s: Floats) -> None:
        """Change the spacecraft's lateral velocity by impulses of shape (B,), or (2, B) in space: V becomes V - k."""
        self._motion[VELOCITY, self._lateral, RELATIVE] -= impulse_m_s
        self._motion[VELOCITY, self._lateral, SPACECRAFT] += impulse_m_s

    def arrival_s(self) -> Floats:
        """Return the times from now to x = 0, shape (B,), s.

        The motion without impulses in 64 leaps, and a straight line at the end. Impulses, which are across x, change
        this time through gravity by some nanoseconds.
        """
        return self._time_to_zero(self._motion, self._manoeuvre, ARRIVAL_LEAPS)

    def _time_to_zero(self, motion: Floats, manoeuvre_m_s2: Floats, leaps: int) -> Floats:
        """Return the times to x = 0 of some motions without impulses, s."""
        duration = motion[POSITION, X, RELATIVE] / -motion[VELOCITY, X, RELATIVE]
        for _ in range(leaps):
            motion, _ = self._leap(motion, duration / leaps, manoeuvre_m_s2)
        return np.asarray(duration - motion[POSITION, X, RELATIVE] / motion[VELOCITY, X, RELATIVE])

    def advance(self, step_s: float, manoeuvre_m_s2: Floats | None = None) -> Passage:
        """Advance by one step.

        `manoeuvre_m_s2`, shape (B,), or (2, B) in space, is the lateral acceleration of the object from now on; None
        leaves it as it is.
        """
        if manoeuvre_m_s2 is not None:
            self._manoeuvre = np.ascontiguousarray(np.atleast_2d(manoeuvre_m_s2))
            accelerate_all(self._motion, self._manoeuvre, self._gravitational_parameter)
        # In free space one leap gives the exact motion over a step, a parabola.
        free_space = self._gravitational_parameter == 0.0
        substeps = 1 if free_space else max(1, int(np.ceil(step_s / self._substep_s * (1.0 - 1e-12))))
        duration = np.full(self._motion.shape[-1], step_s / substeps)
        passed = np.zeros(self._motion.shape[-1], dtype=bool)
        least, arrival = np.full(passed.shape, np.inf), np.zeros(passed.shape)
        closest = np.zeros(self._motion.shape[1:2] + passed.shape)
        for substep in range(substeps):
            before, (self._motion, some_recede) = self._motion, self._leap(self._motion, duration, self._manoeuvre)
            if not some_recede:
                continue
            new = (_dot(self._motion[POSITION, :, RELATIVE], self._motion[VELOCITY, :, RELATIVE]) >= 0.0) & ~passed
            if new.any():
                position, velocity, acceleration = before[:LOST, :, RELATIVE, new]
                closest[:, new] = closest_position(position, velocity, acceleration, step_s / substeps)
                least[new] = np.hypot.reduce(closest[:, new])
                to_zero = self._time_to_zero(
                    np.ascontiguousarray(before[..., new]),
                    np.ascontiguousarray(self._manoeuvre[:, new]),
                    PASSAGE_LEAPS,
                )
                arrival[new] = substep * (step_s / substeps) + to_zero
                passed |= new
        return Passage(passed, least, arrival, closest[self._lateral])

    def _leap(self, motion: Floats, duration_s: Floats, manoeuvre_m_s2: Floats) -> tuple[Floats, bool]:
        """Return a motion at a later time, in new memory, and whether some distance increases then."""
        after = np.empty_like(motion)
        return after, leap_all(motion, duration_s, manoeuvre_m_s2, self._gravitational_parameter, after)


def longest_substep_s(scenario: Scenario) -> float:
    """Return the length of substeps for which the position has an error of at most 1 mm at arrival, at least 0.5 s.

    Velocity Verlet with substeps h neglects a' h^3/6 of the position in each substep, where a' is the derivative of the
    acceleration: h^2 T a'/6 over a flight of T, and T^2 h^2 a''/24 by later derivatives. With the distance r of the two
    bodies, which changes at the speed v, and the velocity w of both around the Sun at the distance R,

        a' <= (K/R^3) (2 v + 6 r w/R).

    The bound is twice that, which covers the second term while the Sun turns by less than a radian.
    """
    box, sun = scenario.dispersion, scenario.sun
    if sun is None:
        return LONGEST_SUBSTEP_S
    slowest, fastest = -box.vx_m_s[1], math.hypot(box.vx_m_s[0], box.lateral_speed_m_s)
    flight_s, reach_m = box.x_m[1] / slowest, math.hypot(box.x_m[1], box.offset_m)
    orbital = math.sqrt(sun.gravitational_parameter_m3_s2 / sun.distance_m)
    nearest = max(sun.distance_m - reach_m, 0.1 * sun.distance_m)
    turned = (orbital + fastest) / nearest
    jerk = sun.gravitational_parameter_m3_s2 / nearest**3 * (2.0 * fastest + 6.0 * reach_m * turned)
    return max(LONGEST_SUBSTEP_S, math.sqrt(POSITION_ERROR_M / (flight_s * jerk / 3.0)))


def sun_and_orbit(sun: Sun) -> tuple[Floats, Floats]:
    """Return the directions (y, z, x) of the Sun and of the spacecraft's velocity in its orbit.

    The second one is the part of +x across the first, or along z if the Sun is on the x axis.
    """
    level = np.cos(sun.elevation_rad)
    y, z, x = np.sin(sun.elevation_rad), level * np.sin(sun.direction_rad), level * np.cos(sun.direction_rad)
    across = np.hypot(y, z)
    along = np.array([-x * (y / across), -x * (z / across), across]) if across > 0.0 else np.array([0.0, x, 0.0])
    return np.array([y, z, x]), along


@inlined
def attraction_share(squared_m2: float, gravitational_parameter_m3_s2: float) -> float:
    """Return -K / |r|^3, whose product with r is the acceleration at r from the Sun, from the square of |r|."""
    return -gravitational_parameter_m3_s2 / (squared_m2 * math.sqrt(squared_m2))


@entry
def accelerate_all(motion: Floats, manoeuvre_m_s2: Floats, gravitational_parameter_m3_s2: float) -> None:
    """Write the accelerations of a motion, relative and of the spacecraft.

    A motion, shape (4, A + 1, 2, B), has position, velocity, acceleration and lost rounding; along the A lateral axes
    and x; relative, and of the spacecraft. `manoeuvre_m_s2`, shape (A, B), is the lateral acceleration of the object.
    The gravitational parameter K of the Sun is zero in free space.
    """
    for b in range(motion.shape[3]):
        own_share = object_share = 0.0
        if gravitational_parameter_m3_s2 > 0.0:
            own_squared = object_squared = 0.0
            for axis in range(motion.shape[1]):
                own = motion[POSITION, axis, SPACECRAFT, b]
                of_object = motion[POSITION, axis, RELATIVE, b] + own
                own_squared += own * own
                object_squared += of_object * of_object
            own_share = attraction_share(own_squared, gravitational_parameter_m3_s2)
            object_share = attraction_share(object_squared, gravitational_parameter_m3_s2)
        for axis in range(motion.shape[1]):
            own = motion[POSITION, axis, SPACECRAFT, b]
            of_object = motion[POSITION, axis, RELATIVE, b] + own
            motion[ACCELERATION, axis, SPACECRAFT, b] = own_share * own
            motion[ACCELERATION, axis, RELATIVE, b] = object_share * of_object - own_share * own
        for axis in range(len(manoeuvre_m_s2)):
            motion[ACCELERATION, axis, RELATIVE, b] += manoeuvre_m_s2[axis, b]


@entry
def leap_all(
    motion: Floats, duration_s: Floats, manoeuvre_m_s2: Floats, gravitational_parameter_m3_s2: float, after: Floats
) -> bool:
    """Write a motion after times of shape (B,), in the form of `accelerate_all`: one step of velocity Verlet.

    Return whether the distance of some relative motion increases then.
    """
    for axis in range(motion.shape[1]):
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
    for axis in range(motion.shape[1]):
        for craft in (RELATIVE, SPACECRAFT):
            for b in range(motion.shape[3]):
                after[VELOCITY, axis, craft, b] += 0.5 * duration_s[b] * after[ACCELERATION, axis, craft, b]
    for b in range(motion.shape[3]):
        growth = 0.0
        for axis in range(motion.shape[1]):
            growth += after[POSITION, axis, RELATIVE, b] * after[VELOCITY, axis, RELATIVE, b]
        if growth >= 0.0:
            return True
    return False


def closest_position(position_m: Floats, velocity_m_s: Floats, acceleration_m_s2: Floats, duration_s: float) -> Floats:
    """Return the position (m) nearest to the origin during uniformly accelerated motion, vectors of shape (axes, B).

    Four Newton steps, starting from the closest approach of straight motion.
    """
    moment = np.clip(-_dot(position_m, velocity_m_s) / _dot(velocity_m_s, velocity_m_s), 0.0, duration_s)
    for _ in range(4):
        at = position_m + moment * velocity_m_s + 0.5 * moment**2 * acceleration_m_s2
        speed = velocity_m_s + moment * acceleration_m_s2
        slope = _dot(speed, speed) + _dot(at, acceleration_m_s2)
        moment = np.clip(moment - _dot(at, speed) / slope, 0.0, duration_s)
    return position_m + moment * velocity_m_s + 0.5 * moment**2 * acceleration_m_s2


def _ratio(over: Floats, under: Floats) -> Floats:
    """Return the quotient; zero where the divisor is zero, where no section exists."""
    return np.divide(over, under, out=np.zeros(over.shape), where=under != 0.0)


def _dot(first: Floats, second: Floats) -> Floats:
    return reduce(np.add, first * second)
