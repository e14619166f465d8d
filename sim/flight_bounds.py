"""Bounds of all motions that a set model allows for, and the distance from the attracting body."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from infoset.arrays import Floats
from infoset.model import StateBox
from infoset.sim.kepler import KeplerMotion, X
from infoset.sim.scenario import Sun

INSTANTS = 500
"""Number of times at which a flight is bounded. Chosen: between two of them a bound is greater by
the motion in half a step, 0.1 % of the flight. With 125 the bounds of gravity of comet-fast and
asteroid-1997 are 0.6 % greater, and with 2000 they are 0.2 % smaller, in four times the time
(measured)."""
STRETCHES = (1.001, 1.02, 1.2, 4.0)
"""Lengths of the flight that are tried, in units of the longest one without gravity: a weak
attraction needs the first only, and a short flight has narrow bounds. With the last one alone the
bounds of `INSTANTS` are 0.6 % greater (measured).
"""
NEAREST_SHARE = 0.1
"""Minimum share of the nominal distance from the attracting body that the deviations must leave: at
a tenth, the gradient is a thousand times the nominal one, and a bound would be of no use.
"""
INFLATION = 1.001
"""Factor between a trial and the deviations that follow from the one before: a bound is greater
than necessary by at most this. Chosen: the bounds of `INSTANTS` are the same from 1.0001 to 1.1
(measured).
"""
TRIALS = 100
"""Maximum number of trials. Chosen: deviations that still grow are refused, which is safe. For the
bounds of `INSTANTS` 5 are enough (measured)."""
MODULUS = 0
"""Row of a deviation."""
TOO_NEAR = "the motions may come too near the attracting body"
TOO_SLOW = "gravity may take away the closing speed"


@dataclass(frozen=True)
class FlightBounds:
    """Bounds of all motions that a model allows for, at N equal steps until the last one has x = 0.

    Parameters
    ----------
    times_s : ndarray, shape (N,)
        Times since t = 0.
    nearest_m : ndarray, shape (N,)
        Minimum distance of the segment between spacecraft and object from the attracting body,
        within half a step.
    fastest_m_s : ndarray, shape (N,)
        Maximum speed of a point of the segment relative to the attracting body.
    distance_m, speed_m_s : ndarray, shape (N,)
        Maximum modulus of the relative position and velocity.
    offset_m, velocity_m_s : ndarray, shape (axes, N)
        Maximum modulus of each component of the relative position and velocity, x last.
    closing_speed_m_s : float
        Minimum closing speed of the flight.
    """

    times_s: Floats
    nearest_m: Floats
    fastest_m_s: Floats
    distance_m: Floats
    speed_m_s: Floats
    offset_m: Floats
    velocity_m_s: Floats
    closing_speed_m_s: float


def no_bound(cause: str, range_m: float) -> ValueError:
    """Return the error of a scenario whose gravity has no bound from a range on."""
    return ValueError(
        f"sun: gravity has no bound: {cause} at a range of {range_m / 1000.0:.4g} km; start nearer "
        "to the target, narrow the bounds of the start, or omit the attracting body"
    )


@dataclass(frozen=True)
class _Motion:
    """Positions and velocities of spacecraft and object, in this order, shape (2, axes, N).

    Deviations have the shape (2, 1 + axes, N), with the modulus first: the impulses along two axes
    have a common bound.
    """

    place_m: Floats
    speed_m_s: Floats

    @property
    def relative(self) -> tuple[Floats, Floats]:
        """Position and velocity of the object relative to the spacecraft, shape (axes, N)."""
        return self.place_m[1] - self.place_m[0], self.speed_m_s[1] - self.speed_m_s[0]

    @property
    def range_m(self) -> Floats:
        """Distance between the two, shape (N,)."""
        return np.asarray(np.linalg.norm(self.relative[0], axis=0))


@lru_cache(maxsize=64)  # a simulation needs the bounds of its scenario several times
def flight_bounds(
    bounds: StateBox, disturbances_m_s2: tuple[float, ...], sun: Sun, impulses_m_s: float
) -> FlightBounds:
    """Return bounds of all motions from a box of starts, as in Lemma 2 of docs/guarantee.md.

    The nominal motion starts in the middle of the box and has no impulses. All deviations from it
    have a bound.

    Parameters
    ----------
    bounds : StateBox
        Possible starts.
    disturbances_m_s2 : tuple of float
        Maximum acceleration of the object along each lateral axis.
    sun : Sun
        The attracting body.
    impulses_m_s : float
        Maximum sum of the impulses' moduli.

    Raises
    ------
    ValueError
        If the motions may come too near the attracting body, or may never have x = 0; the message
        names the range.
    """
    boxes = [bounds.axis(name) for name in bounds.axes]
    # Rows: position and velocity; columns: lateral axes and x.
    start = np.array(
        [[*(box.z_m for box in boxes), bounds.x_m], [*(box.vz_m_s for box in boxes), bounds.vx_m_s]]
    )
    middle = start.mean(axis=2)
    half = 0.5 * np.ptp(start, axis=2)
    half = np.concatenate([np.linalg.norm(half, axis=1, keepdims=True), half], axis=1)

    # Deviations at t = 0 and accelerations of spacecraft and object. All impulses are given at
    # once, along each axis: the deviations are largest then. Axes of `first`: position and
    # velocity; spacecraft and object; modulus, lateral axes and x.
    impulses = np.array([impulses_m_s, *(impulses_m_s for _ in boxes), 0.0])
    nothing = np.zeros_like(half[0])
    first = np.array([[nothing, half[0]], [impulses, half[1]]])
    disturbance = np.array([nothing, [np.linalg.norm(disturbances_m_s2), *disturbances_m_s2, 0.0]])

    for stretch in STRETCHES:
        times_s = np.linspace(0.0, stretch * bounds.x_m[1] / -bounds.vx_m_s[1], INSTANTS)
        nominal = _nominal(middle, sun, times_s)
        deviation = _deviation(first, disturbance, nominal, times_s, sun)
        beyond = np.flatnonzero(nominal.relative[0][X] + deviation.place_m[:, X].sum(axis=0) <= 0.0)
        if len(beyond):
            return _bounds(nominal, deviation, times_s, beyond[0] + 1)
    raise no_bound(TOO_SLOW, nominal.range_m[-1])


def _nominal(middle: Floats, sun: Sun, times_s: Floats) -> _Motion:
    """Return the motion of spacecraft and object without impulses or disturbance.

    `middle`, shape (2, axes), is the relative position (m) and velocity (m/s) at t = 0, and
    `times_s` are equal steps from 0.
    """
    motion = KeplerMotion(middle[None, 0], middle[None, 1], sun)
    states = [motion.bodies()]
    for _ in times_s[1:]:
        motion.advance(times_s[1])
        states.append(motion.bodies())
    # `bodies` has the axes: position or velocity, craft, axis, engagement.
    place_m, speed_m_s = np.moveaxis(np.array(states)[..., 0], 0, -1)
    return _Motion(place_m, speed_m_s)


def _deviation(
    first: Floats, disturbance_m_s2: Floats, nominal: _Motion, times_s: Floats, sun: Sun
) -> _Motion:
    """Return bounds of all deviations from the nominal motion.

    A deviation d satisfies abs(d_i'') <= (K/R^3) (1.5 abs(d) + 0.5 abs(d_i)) + disturbance along
    axis i, with the minimum distance R from the attracting body that the deviation allows for. Its
    modulus satisfies the same with abs(d) in place of abs(d_i). The right side increases with both.
    A function that is not less than the double integral of its right side is therefore a bound of
    all deviations.
    """
    step_s = times_s[1]
    far_m = np.linalg.norm(nominal.place_m, axis=1)
    fast_m_s = np.linalg.norm(nominal.speed_m_s, axis=1)
    place = np.repeat(first[0, ..., None], INSTANTS, axis=2)
    speed = np.repeat(first[1, ..., None], INSTANTS, axis=2)
    for _ in range(TRIALS):
        size_m = place[:, MODULUS]
        size_m_s = speed[:, MODULUS]
        # Less the way of half a step, at the speed of the instant.
        nearest_m = far_m - size_m - 0.5 * step_s * (fast_m_s + size_m_s)
        too_near = (nearest_m < NEAREST_SHARE * far_m).any(axis=0)
        if too_near.any():
            raise no_bound(TOO_NEAR, nominal.range_m[too_near.argmax()])

        gradient = (sun.gravitational_parameter_m3_s2 / nearest_m**3)[:, None]
        growth = gradient * (1.5 * size_m[:, None] + 0.5 * place) + disturbance_m_s2[..., None]
        new_speed = first[1, ..., None] + step_s * _sums(greater_of_neighbours(growth))
        # Speeds do not decrease: the later one of two instants is a bound between them.
        new_place = first[0, ..., None] + step_s * _sums(new_speed[..., 1:])
        grows = ((new_place > place) | (new_speed > speed)).any(axis=(0, 1))
        if not grows.any():
            return _Motion(new_place, new_speed)

        place = INFLATION * new_place
        speed = INFLATION * new_speed
    raise no_bound(TOO_NEAR, nominal.range_m[grows.argmax()])


def _sums(values: Floats) -> Floats:
    """Return the sums of the first values along the last axis, from none to all."""
    return np.concatenate([np.zeros((*values.shape[:-1], 1)), np.cumsum(values, axis=-1)], axis=-1)


def greater_of_neighbours(values: Floats) -> Floats:
    """Return the greater value of each two neighbours along the last axis.

    It is a bound between them if the values are monotonic there. The result is shorter by one.
    """
    return np.asarray(np.maximum(values[..., 1:], values[..., :-1]))


def _bounds(nominal: _Motion, deviation: _Motion, times_s: Floats, instants: int) -> FlightBounds:
    """Return the bounds of a flight in its first `instants`, the last of which has x = 0.

    A ValueError is raised if the motions may come too near the attracting body or stop closing.
    """
    place, speed = nominal.relative
    place_error = deviation.place_m.sum(axis=0)
    speed_error = deviation.speed_m_s.sum(axis=0)
    offset = np.abs(place) + place_error[1:]
    # Flights end at x = 0: x is not negative, and its maximum is that of its modulus.
    offset[X] = np.maximum(place[X] + place_error[X], 0.0)
    across = np.linalg.norm(place[:X], axis=0) + place_error[MODULUS]
    distance = np.minimum(nominal.range_m + place_error[MODULUS], np.hypot(offset[X], across))

    # Between two instants the segment moves by at most its speed in half a step.
    speeds = np.linalg.norm(nominal.speed_m_s, axis=1) + deviation.speed_m_s[:, MODULUS]
    fastest_m_s = speeds.max(axis=0)
    closest_m, nearest_m = _distances_of_segment(nominal, deviation)
    nearest_m -= 0.5 * times_s[1] * fastest_m_s

    closing_m_s = -speed[X] - speed_error[X]
    is_too_near = nearest_m < NEAREST_SHARE * closest_m
    is_too_slow = closing_m_s <= 0.0
    for cause, is_bad in ((TOO_NEAR, is_too_near), (TOO_SLOW, is_too_slow)):
        if is_bad[:instants].any():
            raise no_bound(cause, nominal.range_m[is_bad.argmax()])
    return FlightBounds(
        times_s=times_s[:instants],
        nearest_m=nearest_m[:instants],
        fastest_m_s=fastest_m_s[:instants],
        distance_m=distance[:instants],
        speed_m_s=(np.linalg.norm(speed, axis=0) + speed_error[MODULUS])[:instants],
        offset_m=offset[:, :instants],
        velocity_m_s=(np.abs(speed) + speed_error[1:])[:, :instants],
        closing_speed_m_s=float(closing_m_s[:instants].min()),
    )


def _distances_of_segment(nominal: _Motion, deviation: _Motion) -> tuple[Floats, Floats]:
    """Return the minimum distance of the segment from the attracting body, m.

    The first value is nominal, the second one is for all possible motions. At the length u of the
    nominal segment the distance is (height^2 + (u - foot)^2)^(1/2). The deviation is at most linear
    in u.
    """
    own = nominal.place_m[0]
    relative, _ = nominal.relative
    length = np.maximum(np.linalg.norm(relative, axis=0), np.finfo(float).tiny)
    # Length, along the line of the segment, of its point nearest to the body.
    foot = -(own * relative / length).sum(axis=0)
    height = np.sqrt(np.maximum((own * own).sum(axis=0) - foot**2, 0.0))

    def minimum(of_craft: Floats, of_object: Floats) -> Floats:
        """Return the minimum over the segment, with deviations at its two ends."""
        # With a slope of one the minimum is at an end, as it is with almost one.
        slope = np.clip((of_object - of_craft) / length, -1.0 + 1e-12, 1.0 - 1e-12)
        # The derivative of the distance less the deviation is zero here.
        at = np.clip(foot + height * slope / np.sqrt(1.0 - slope**2), 0.0, length)
        deviation_m = (of_object - of_craft) * (at / length)
        return np.asarray(np.hypot(height, at - foot) - of_craft - deviation_m)

    sizes = deviation.place_m[:, MODULUS]
    return minimum(*np.zeros_like(sizes)), minimum(*sizes)
