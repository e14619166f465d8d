"""True motion: relative motion of a batch of spacecraft and objects, both around the Sun."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from infoset._compile import allocation_free, entry, inlined
from infoset.arrays import Flags, Floats
from infoset.sim.scenario import Sun

POSITION_ERROR_M = 1e-5
"""Error of the position at arrival for which the length of a leap is chosen, m: a hundredth of the
error that the class promises, because the bound is an order of magnitude only. A leap is shorter
than a step only where gravity is strong.
"""
SHORTEST_LEAP = 1e-6
"""Minimum length of a leap, relative to the step, and in `arrive` to the time to x = 0. Only a fall
into the attracting body needs shorter ones.
"""
NEWTON_STEPS = 8
"""Maximum number of Newton's steps: from a first error of 1 % the error is squared in each, and
three steps reach rounding errors. In `approach` bisection follows where they do not converge;
`arrive` counts only steps that no leap limits, and returns after the last one.
"""
CONVERGED = 1e-9
"""Error of the time of a closest approach that Newton's method may leave, as a share of the leap.
It changes the distance by at most this share of the way of a leap, which is below a millimetre for
ways up to 1000 km.
"""
HALVINGS = 60
"""Number of halvings of a leap that leave less than the rounding error of its length."""
ARRIVAL_ROUNDING = 1e-16
"""Relative error of the time of arrival at which Newton's method stops: below rounding errors."""
X = -1
"""Axis x of a motion, after the lateral axes: z in a plane, y and z in space."""
RELATIVE, SPACECRAFT = 0, 1
POSITION, VELOCITY, ACCELERATION, LOST = range(4)
"""Parts of a motion. LOST is the rounding error of the position, which the next step adds again."""


@dataclass(frozen=True)
class Sight:
    """True geometry of B engagements, in the planes of x and each of C lateral axes.

    Arrays have the shape (C, B).

    Parameters
    ----------
    alpha_rad, omega_rad_s : ndarray
        Line-of-sight angle and rate, equation (12) of the paper.
    range_m, along_x_m : ndarray, shape (B,)
        Distance between the centres of mass, and its part along x.
    slope, slope_rate_per_s : ndarray
        z/x, that is tan(alpha) without the rounding of the angle, and its rate; zero where x is
        zero.
    """

    alpha_rad: Floats
    omega_rad_s: Floats
    range_m: Floats
    along_x_m: Floats
    slope: Floats
    slope_rate_per_s: Floats

    def turned(self, slope: Floats) -> Sight:
        """Return the geometry in which all slopes are greater by a constant, shape (C, B).

        The distance and the rates stay those of the true line of sight.
        """
        turned = self.slope + slope
        return replace(self, alpha_rad=np.arctan(turned), slope=turned)


@dataclass(frozen=True)
class Passage:
    """Objects that pass within one step, arrays of shape (B,).

    Parameters
    ----------
    passed : ndarray of bool
        Whether the object recedes after the step, or after a part of it. Elsewhere the distance is
        infinite and the others are zero.
    min_distance_m : ndarray
        Minimum distance since the start, m: the distance at the start if the object recedes from
        then on.
    arrival_s : ndarray
        Time from the beginning of the step to x = 0, which may be before or after the step.
    lateral_m : ndarray, shape (C, B)
        Lateral position at the minimum distance.
    """

    passed: Flags
    min_distance_m: Floats
    arrival_s: Floats
    lateral_m: Floats


class KeplerMotion:
    """Motion of the object relative to the spacecraft, in the Sun's gravity or in free space.

    `position_m` and `velocity_m_s` are the relative position and velocity at t = 0, shape (B, C +
    1), along the lateral axes, z in a plane, y and z in space, and x. The spacecraft's orbit gives
    the position of the Sun: circular at t = 0, in the plane of the Sun and the x axis and toward
    +x, unless `sun` has its velocity. Impulses change it. `burn_acceleration_m_s2` is that of
    burns; None is for instantaneous impulses.

    The motion is integrated in leaps of order four (`leap`) on the exact difference of the two
    accelerations. The error of the position at arrival is below 1 mm, or 1e-9 of the miss if that
    is greater.

    References
    ----------
    Kumkov and Patsko (1997), equations (1) to (3).
    """

    def __init__(
        self,
        position_m: Floats,
        velocity_m_s: Floats,
        sun: Sun | None,
        burn_acceleration_m_s2: float | None = None,
    ) -> None:
        self._burn_acceleration_m_s2 = burn_acceleration_m_s2
        batch, axes = position_m.shape
        # For each engagement, part and axis: the relative motion, and the spacecraft's.
        self._motion = np.zeros((batch, 4, axes, 2))
        self._motion[:, POSITION, :, RELATIVE] = position_m
        self._motion[:, VELOCITY, :, RELATIVE] = velocity_m_s
        self._manoeuvre = np.zeros((batch, axes - 1))
        self._scratch = np.empty((4, *self._motion.shape[1:]))
        # The relative positions nearest to the spacecraft so far, at which the distance is least.
        self._closest_m = np.ascontiguousarray(position_m, dtype=np.float64).copy()

        parameter = 0.0
        if sun is not None:
            # Components (y, z, x), of which a plane has the last two.
            toward_sun, along_orbit = sun_and_orbit(sun)
            speed = np.sqrt(sun.gravitational_parameter_m3_s2 / sun.distance_m)
            self._motion[:, POSITION, :, SPACECRAFT] = -sun.distance_m * toward_sun[-axes:]
            self._motion[:, VELOCITY, :, SPACECRAFT] = speed * along_orbit[-axes:]
            parameter = float(sun.gravitational_parameter_m3_s2)

        # An acceleration with this error over the whole flight changes the position by
        # POSITION_ERROR_M.
        self._gravity = parameter, POSITION_ERROR_M * (velocity_m_s[:, X] / position_m[:, X]) ** 2
        accelerate_all(self._motion, self._manoeuvre, parameter)

    @property
    def position_m(self) -> Floats:
        """Relative position along the lateral axes and x, m, shape (B, C + 1)."""
        return self._motion[:, POSITION, :, RELATIVE].copy()

    @property
    def velocity_m_s(self) -> Floats:
        """Relative velocity along the lateral axes and x, m/s, shape (B, C + 1)."""
        return self._motion[:, VELOCITY, :, RELATIVE].copy()

    def bodies(self) -> Floats:
        """Return position and velocity of both craft from the Sun, shape (2, 2, axes, B)."""
        own, relative = (
            self._motion[:, :ACCELERATION, :, part].transpose(1, 2, 0)
            for part in (SPACECRAFT, RELATIVE)
        )
        return np.stack([own, own + relative], axis=1)

    def sight(self) -> Sight:
        """Return the present geometry."""
        position, velocity = np.ascontiguousarray(
            self._motion[:, :ACCELERATION, :, RELATIVE].transpose(1, 2, 0)
        )
        lateral = position[:X]
        x = position[X:]
        speed = velocity[:X]
        v_x = velocity[X:]
        slope = _ratio(lateral, x)
        return Sight(
            alpha_rad=np.arctan2(lateral, x),
            omega_rad_s=_ratio(speed * x - v_x * lateral, lateral * lateral + x * x),
            range_m=np.sqrt((position * position).sum(axis=0)),
            along_x_m=position[X],
            slope=slope,
            slope_rate_per_s=_ratio(speed - v_x * slope, x),
        )

    def fire(self, impulse_m_s: Floats) -> None:
        """Change the spacecraft's lateral velocity by impulses of shape (C, B): V becomes V - k.

        A burn with the duration t moves the spacecraft by k t/2 less than an impulse at its start.
        The motion is that after the burn, which ends within the step, continued to its start.

        Neglected: during the burn, gravity acts at a position that differs by up to k t/2. With
        25 m and 50 s at 1 au this changes the velocity by 1e-10 m/s (docs/guarantee.md).
        """
        self._motion[:, VELOCITY, :X, RELATIVE] -= impulse_m_s.T
        self._motion[:, VELOCITY, :X, SPACECRAFT] += impulse_m_s.T
        if self._burn_acceleration_m_s2 is None:
            return

        duration_s = np.hypot.reduce(impulse_m_s, axis=0) / self._burn_acceleration_m_s2
        late_m = (0.5 * duration_s * impulse_m_s).T
        for part, change_m in ((RELATIVE, late_m), (SPACECRAFT, -late_m)):
            before_m = self._motion[:, POSITION, :X, part]
            way_m = change_m + self._motion[:, LOST, :X, part]
            position_m = before_m + way_m
            self._motion[:, LOST, :X, part] = way_m - (position_m - before_m)
            self._motion[:, POSITION, :X, part] = position_m
        accelerate_all(self._motion, self._manoeuvre, self._gravity[0])

    def arrival_s(self) -> Floats:
        """Return the times from now to x = 0, shape (B,), s.

        Further impulses, which are across x, would change these times through gravity by some
        nanoseconds.
        """
        arrival_s = np.empty(len(self._motion))
        arrive_all(self._motion, self._manoeuvre, *self._gravity, self._scratch, arrival_s)
        return arrival_s

    def advance(self, step_s: float, manoeuvre_m_s2: Floats | None = None) -> Passage:
        """Advance by one step.

        `manoeuvre_m_s2`, shape (C, B), is the lateral acceleration of the object from now on; None
        leaves it as it is.
        """
        if manoeuvre_m_s2 is not None:
            self._manoeuvre = np.ascontiguousarray(manoeuvre_m_s2.T)
            accelerate_all(self._motion, self._manoeuvre, self._gravity[0])

        batch = len(self._motion)
        passed = np.zeros(batch, dtype=bool)
        arrival = np.zeros(batch)
        passage = (passed, arrival, self._closest_m)
        advance_all(
            self._motion, self._manoeuvre, *self._gravity, float(step_s), self._scratch, passage
        )

        nearest = np.where(passed, self._closest_m.T, 0.0)
        minimum = np.where(passed, np.hypot.reduce(nearest), np.inf)
        return Passage(passed, minimum, arrival, nearest[:X])


def sun_and_orbit(sun: Sun) -> tuple[Floats, Floats]:
    """Return (y, z, x) of the Sun's direction, and of the spacecraft's velocity.

    The unit of the velocity is the speed of a circular orbit. Without a velocity in `sun` it is a
    direction: the part of +x across the Sun's direction, or z if the Sun is on x.
    """
    level = np.cos(sun.elevation_rad)
    y = np.sin(sun.elevation_rad)
    z = level * np.sin(sun.direction_rad)
    x = level * np.cos(sun.direction_rad)
    direction = np.array([y, z, x])
    if sun.spacecraft_velocity_m_s is not None:
        # In a plane it has no component along y.
        velocity = np.array([0.0, *sun.spacecraft_velocity_m_s])[-3:]
        return direction, velocity / np.sqrt(sun.gravitational_parameter_m3_s2 / sun.distance_m)

    across = np.hypot(y, z)
    if across > 0.0:
        return direction, np.array([-x * (y / across), -x * (z / across), across])
    return direction, np.array([0.0, x, 0.0])


@inlined
def attraction_share(squared_m2: float, gravitational_parameter_m3_s2: float) -> float:
    """Return -K / |r|^3 from the square of |r|: times r, the acceleration at r from the Sun."""
    return -gravitational_parameter_m3_s2 / (squared_m2 * math.sqrt(squared_m2))


@allocation_free
def accelerate(state: Floats, manoeuvre_m_s2: Floats, gravitational_parameter_m3_s2: float) -> None:
    """Write the accelerations of a state, relative and of the spacecraft.

    A state, shape (4, A + 1, 2), has position, velocity, acceleration and lost rounding; along the
    A lateral axes and x; relative, and of the spacecraft. `manoeuvre_m_s2`, shape (A,), is the
    lateral acceleration of the object. The gravitational parameter K of the Sun is zero in free
    space.
    """
    own_share = object_share = 0.0
    if gravitational_parameter_m3_s2 > 0.0:
        own_squared = object_squared = 0.0
        for axis in range(state.shape[1]):
            own = state[POSITION, axis, SPACECRAFT]
            of_object = state[POSITION, axis, RELATIVE] + own
            own_squared += own * own
            object_squared += of_object * of_object
        own_share = attraction_share(own_squared, gravitational_parameter_m3_s2)
        object_share = attraction_share(object_squared, gravitational_parameter_m3_s2)
    for axis in range(state.shape[1]):
        own = state[POSITION, axis, SPACECRAFT]
        of_object = state[POSITION, axis, RELATIVE] + own
        state[ACCELERATION, axis, SPACECRAFT] = own_share * own
        state[ACCELERATION, axis, RELATIVE] = object_share * of_object - own_share * own
    for axis in range(len(manoeuvre_m_s2)):
        state[ACCELERATION, axis, RELATIVE] += manoeuvre_m_s2[axis]


@allocation_free
def leap(
    state: Floats,
    manoeuvre_m_s2: Floats,
    gravitational_parameter_m3_s2: float,
    duration_s: float,
    stage: Floats,
) -> None:
    """Advance a state by a time: one step of the method of Runge, Kutta and Nystroem of order four.

    With the acceleration a(p) at the position p, and a1 = a(p), a2 = a(p + h v/2 + h^2 a1/8), a3 =
    a(p + h v + h^2 a2/2), the position gains h v + h^2 (a1 + 2 a2)/6 and the velocity h (a1 + 4 a2
    + a3)/6. It is exact for a constant acceleration. The stored accelerations of the state must be
    those at its position (`accelerate`), and are so afterwards. `stage` is memory of the shape of
    the state.

    References
    ----------
    Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, section II.14 (the method
    of Nystroem).
    """
    sixth = duration_s / 6.0
    for axis in range(state.shape[1]):
        for craft in (RELATIVE, SPACECRAFT):
            speed = state[VELOCITY, axis, craft]
            first = state[ACCELERATION, axis, craft]
            stage[POSITION, axis, craft] = state[POSITION, axis, craft] + 0.5 * duration_s * (
                speed + 0.25 * duration_s * first
            )
    accelerate(stage, manoeuvre_m_s2, gravitational_parameter_m3_s2)
    for axis in range(state.shape[1]):
        for craft in (RELATIVE, SPACECRAFT):
            before = state[POSITION, axis, craft]
            speed = state[VELOCITY, axis, craft]
            first = state[ACCELERATION, axis, craft]
            second = stage[ACCELERATION, axis, craft]
            stage[POSITION, axis, craft] = before + duration_s * (speed + 0.5 * duration_s * second)
            # Rounding errors of positions must not accumulate: the set allows for those of one
            # step. Those of velocities are not kept.
            way = duration_s * (speed + sixth * (first + 2.0 * second)) + state[LOST, axis, craft]
            position = before + way
            state[POSITION, axis, craft] = position
            state[LOST, axis, craft] = way - (position - before)
            state[VELOCITY, axis, craft] = speed + sixth * (first + 4.0 * second)
    accelerate(stage, manoeuvre_m_s2, gravitational_parameter_m3_s2)
    for axis in range(state.shape[1]):
        for craft in (RELATIVE, SPACECRAFT):
            state[VELOCITY, axis, craft] += sixth * stage[ACCELERATION, axis, craft]
    accelerate(state, manoeuvre_m_s2, gravitational_parameter_m3_s2)


@inlined
def longest_leap_s(
    state: Floats, gravitational_parameter_m3_s2: float, acceleration_error_m_s2: float
) -> float:
    """Return the maximum length of a leap whose mean acceleration has at most a given error.

    At the distance R from the Sun, a motion with the speed v changes in the time t = min(R/v,
    (R^3/K)^(1/2)). A leap of order four and length h has an error of the order of (K/R^2) (h/t)^4.
    The shorter length of the two bodies' counts.
    """
    if gravitational_parameter_m3_s2 == 0.0:
        return math.inf
    shortest = math.inf
    for share_of_relative in (0.0, 1.0):
        squared = speed_squared = 0.0
        for axis in range(state.shape[1]):
            place = (
                state[POSITION, axis, SPACECRAFT]
                + share_of_relative * state[POSITION, axis, RELATIVE]
            )
            speed = (
                state[VELOCITY, axis, SPACECRAFT]
                + share_of_relative * state[VELOCITY, axis, RELATIVE]
            )
            squared += place * place
            speed_squared += speed * speed
        # The square of the speed of a circular orbit, in place of a lower speed.
        of_orbit = gravitational_parameter_m3_s2 / math.sqrt(squared)
        time_s = math.sqrt(squared / max(speed_squared, of_orbit))
        share = acceleration_error_m_s2 * squared / gravitational_parameter_m3_s2
        shortest = min(shortest, time_s * math.sqrt(math.sqrt(share)))
    return shortest


@inlined
def copy_state(state: Floats, copy: Floats) -> None:
    """Write a copy of a state."""
    for part in range(state.shape[0]):
        for axis in range(state.shape[1]):
            for craft in (RELATIVE, SPACECRAFT):
                copy[part, axis, craft] = state[part, axis, craft]


@inlined
def products(state: Floats) -> tuple[float, float]:
    """Return r . v of the relative motion and its rate v . v + r . a.

    The first is zero at the closest approach.
    """
    radial = rate = 0.0
    for axis in range(state.shape[1]):
        place = state[POSITION, axis, RELATIVE]
        speed = state[VELOCITY, axis, RELATIVE]
        radial += place * speed
        rate += speed * speed + place * state[ACCELERATION, axis, RELATIVE]
    return radial, rate


@inlined
def turning_times(state: Floats, duration_s: float) -> tuple[float, float]:
    """Return the increasing times within a leap at which the rate of r . v is zero, s.

    Both are `duration_s` without such a time; with only one, the second is equal to it or
    `duration_s`. r . v is monotone between the ends of the leap and these times. With the
    acceleration a of the start of the leap its rate is v . v + r . a + 3 v . a t + 1.5 a . a t^2.
    It has no zero in a leap in which the acceleration changes the velocity only little.
    """
    _, constant = products(state)
    linear = quadratic = 0.0
    for axis in range(state.shape[1]):
        speed = state[VELOCITY, axis, RELATIVE]
        acceleration = state[ACCELERATION, axis, RELATIVE]
        linear += 3.0 * speed * acceleration
        quadratic += 1.5 * acceleration * acceleration
    discriminant = linear * linear - 4.0 * quadratic * constant
    if discriminant <= 0.0 or quadratic == 0.0:
        return duration_s, duration_s

    root = math.sqrt(discriminant)
    # The sum of two terms of one sign, and the other zero from the product of both.
    sum_of_both = -0.5 * (linear + math.copysign(root, linear))
    one = sum_of_both / quadratic
    other = constant / sum_of_both
    first = min(one, other)
    second = max(one, other)
    if first <= 0.0:
        first = second
    if not 0.0 < first < duration_s:
        return duration_s, duration_s
    return first, min(second, duration_s)


@allocation_free
def approach(
    state: Floats,
    manoeuvre_m_s2: Floats,
    gravitational_parameter_m3_s2: float,
    longest_s: float,
    stage: Floats,
    start: Floats,
) -> None:
    """Advance a state to the closest approach, by Newton's method on r . v = 0, or bisection.

    The approach is at most `longest_s` later. r . v is negative now and not negative after
    `longest_s`, and monotone between. `start` is memory of the shape of the state.
    """
    copy_state(state, start)
    moment = 0.0
    for _ in range(NEWTON_STEPS):
        radial, rate = products(state)
        after = min(max(moment - radial / rate, 0.0), longest_s)
        if after == moment:
            break
        leap(state, manoeuvre_m_s2, gravitational_parameter_m3_s2, after - moment, stage)
        moment = after
    radial, rate = products(state)
    if abs(radial) <= CONVERGED * longest_s * rate:
        return

    lower = 0.0
    upper = longest_s
    for _ in range(HALVINGS):
        middle = 0.5 * (lower + upper)
        copy_state(start, state)
        leap(state, manoeuvre_m_s2, gravitational_parameter_m3_s2, middle, stage)
        radial, _ = products(state)
        if radial < 0.0:
            lower = middle
        else:
            upper = middle


@inlined
def keep_closest(state: Floats, closest_m: Floats) -> None:
    """Write the relative position of a state if it is nearer than `closest_m`, shape (A + 1,)."""
    squared = kept = 0.0
    for axis in range(state.shape[1]):
        squared += state[POSITION, axis, RELATIVE] * state[POSITION, axis, RELATIVE]
        kept += closest_m[axis] * closest_m[axis]
    if squared < kept:
        for axis in range(state.shape[1]):
            closest_m[axis] = state[POSITION, axis, RELATIVE]


@allocation_free
def approach_within(
    before: Floats,
    manoeuvre_m_s2: Floats,
    gravitational_parameter_m3_s2: float,
    duration_s: float,
    scratch: Floats,
    closest_m: Floats,
) -> None:
    """Keep the closest approaches within a leap that starts at a state: `keep_closest`.

    They are the start, if the object recedes there, and the times at which r . v becomes positive.
    `before` is not changed. `scratch` is memory of three states.
    """
    trial = scratch[0]
    stage = scratch[1]
    start = scratch[2]
    radial, _ = products(before)
    if radial >= 0.0:
        keep_closest(before, closest_m)
    first, second = turning_times(before, duration_s)
    begin = 0.0
    for end in (first, second, duration_s):
        if end <= begin:
            continue
        copy_state(before, trial)
        leap(trial, manoeuvre_m_s2, gravitational_parameter_m3_s2, end, stage)
        next_radial, _ = products(trial)
        if radial < 0.0 <= next_radial:
            copy_state(before, trial)
            if begin > 0.0:
                leap(trial, manoeuvre_m_s2, gravitational_parameter_m3_s2, begin, stage)
            approach(
                trial, manoeuvre_m_s2, gravitational_parameter_m3_s2, end - begin, stage, start
            )
            keep_closest(trial, closest_m)
        begin = end
        radial = next_radial


@allocation_free
def arrive(
    state: Floats,
    manoeuvre_m_s2: Floats,
    gravitational_parameter_m3_s2: float,
    acceleration_error_m_s2: float,
    stage: Floats,
) -> float:
    """Advance a state to x = 0 without impulses, and return the time, s, negative if x = 0 is past.

    Newton's method takes leaps of limited length. If x no longer decreases, the time is that of a
    straight line through the current state. `stage` is as in `leap`.
    """
    total = 0.0
    last = 0
    while last < NEWTON_STEPS:
        x = state[POSITION, X, RELATIVE]
        speed = state[VELOCITY, X, RELATIVE]
        rest = -x / speed
        if speed >= 0.0 or abs(rest) <= ARRIVAL_ROUNDING * total:
            return float(total + rest)
        longest = longest_leap_s(state, gravitational_parameter_m3_s2, acceleration_error_m_s2)
        longest = max(longest, SHORTEST_LEAP * abs(total + rest))
        if abs(rest) <= longest:
            last += 1
        duration = min(max(rest, -longest), longest)

        leap(state, manoeuvre_m_s2, gravitational_parameter_m3_s2, duration, stage)
        total += duration
    return total


@entry
def accelerate_all(
    motion: Floats, manoeuvre_m_s2: Floats, gravitational_parameter_m3_s2: float
) -> None:
    """Write the accelerations of all states, shape (B, 4, A + 1, 2).

    Manoeuvres have the shape (B, A).
    """
    for b in range(len(motion)):
        accelerate(motion[b], manoeuvre_m_s2[b], gravitational_parameter_m3_s2)


@entry
def arrive_all(
    motion: Floats,
    manoeuvre_m_s2: Floats,
    gravitational_parameter_m3_s2: float,
    acceleration_error_m_s2: Floats,
    scratch: Floats,
    arrival_s: Floats,
) -> None:
    """Write the times to x = 0 of all states."""
    state = scratch[0]
    stage = scratch[1]
    for b in range(len(motion)):
        copy_state(motion[b], state)
        error = acceleration_error_m_s2[b]
        arrival_s[b] = arrive(state, manoeuvre_m_s2[b], gravitational_parameter_m3_s2, error, stage)


@entry
def advance_all(
    motion: Floats,
    manoeuvre_m_s2: Floats,
    gravitational_parameter_m3_s2: float,
    acceleration_error_m_s2: Floats,
    step_s: float,
    scratch: Floats,
    passage: tuple[Flags, Floats, Floats],
) -> None:
    """Advance all states by a step, and write the closest approaches within it: see `Passage`.

    The length of a leap depends on the state of the engagement alone, so a run does not depend on
    the others of its batch. `passage` is whether the object has passed, false at the beginning, the
    time of arrival, s, and the nearest relative positions so far, m, shape (B, A + 1). `scratch` is
    memory of four states.
    """
    before = scratch[0]
    stage = scratch[2]
    passed, arrival_s, closest_m = passage
    for b in range(len(motion)):
        state = motion[b]
        manoeuvre = manoeuvre_m_s2[b]
        error = acceleration_error_m_s2[b]
        left = step_s
        while left > 0.0:
            longest = longest_leap_s(state, gravitational_parameter_m3_s2, error)
            leaps = max(1.0, math.ceil(left / max(longest, SHORTEST_LEAP * step_s)))
            duration = left / leaps
            copy_state(state, before)
            leap(state, manoeuvre, gravitational_parameter_m3_s2, duration, stage)

            is_receding = products(state)[0] >= 0.0
            if is_receding or turning_times(before, duration)[0] < duration:
                approach_within(
                    before,
                    manoeuvre,
                    gravitational_parameter_m3_s2,
                    duration,
                    scratch[1:],
                    closest_m[b],
                )
            if is_receding and not passed[b]:
                passed[b] = True
                # `before` changes: it is not needed again.
                to_zero = arrive(before, manoeuvre, gravitational_parameter_m3_s2, error, stage)
                arrival_s[b] = step_s - left + to_zero
            # Exactly zero after the last leap, without a rounding error.
            left = left - duration if leaps > 1.0 else 0.0


def _ratio(over: Floats, under: Floats) -> Floats:
    """Return the quotient, and zero where the divisor is zero."""
    return np.divide(over, under, out=np.zeros(over.shape), where=under != 0.0)
