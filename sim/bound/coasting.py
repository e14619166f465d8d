"""Relative motion without impulses under gravity, and small differences of the object's motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from infoset.arrays import Floats
from infoset.sim.approach import pair_rates
from infoset.sim.kepler import sun_and_orbit
from infoset.sim.scenario import Sun

INTEGRATION_TOLERANCE = 1e-12
"""Relative tolerance of the integrator, in units in which range and flight time are one: the error
is far below `MARGIN` of `infoset.sim.bound.difference_sets`.
"""
ARRIVAL_ROUNDING = 1e-12
"""A step that starts by this share before the arrival starts at it: the rounding of the arrival."""
LONGEST_FLIGHT = 3.0
"""Maximum time of a motion to x = 0, in units of range by closing speed. Chosen: it only selects
the scenarios whose bound is zero because gravity turns the object away. The bounds of dart-2022 and
asteroid-1997-single are the same from 1.01 on (measured).
"""
MIN_RANGE = 1e-9
"""Minimum range of a step as a share of the first; at a range of zero there is no angle."""


class NoArrivalError(ValueError):
    """Gravity keeps the object from reaching x = 0 within `LONGEST_FLIGHT`."""


@dataclass(frozen=True)
class Coasting:
    """A motion without impulses, and the transition matrices of the object's motion around it.

    States are positions and then velocities along the lateral axes and x: (z, x, V_z, V_x) in a
    plane, (y, z, x, V_y, V_z, V_x) in space; n times.

    Parameters
    ----------
    times_s : ndarray, shape (n,)
        Times of all steps before the arrival, and the arrival, s.
    states : ndarray, shape (2 C, n)
        Relative states, m and m/s; x is zero at the arrival.
    transition : ndarray, shape (n, 2 C, 2 C)
        Derivatives Phi of the object's state with respect to its state at t = 0.
    pushed : ndarray, shape (n, 2 C, C - 1)
        Integral of Phi^-1 over time for a unit acceleration along each lateral axis.
    nearest_m, speed_m_s : float
        Minimum distance of the segment between spacecraft and object from the Sun, and maximum
        velocity of the two relative to it, at these times; infinite and zero in free space.
    """

    times_s: Floats
    states: Floats
    transition: Floats
    pushed: Floats
    nearest_m: float
    speed_m_s: float

    @property
    def arrival_s(self) -> float:
        """Time of x = 0, s."""
        return float(self.times_s[-1])

    @property
    def axes(self) -> int:
        """Number C of axes."""
        return len(self.states) // 2

    @property
    def range_m(self) -> Floats:
        """Range x at the steps, m, shape (n - 1,)."""
        # x is the last of the positions.
        ranges_m = self.states[self.axes - 1]
        return np.asarray(np.maximum(ranges_m[:-1], MIN_RANGE * ranges_m[0]))

    @property
    def closing_speed_m_s(self) -> Floats:
        """Closing speed -V_x at all times, m/s, shape (n,)."""
        return np.asarray(-self.states[-1])

    @cached_property
    def back(self) -> Floats:
        """Inverses of the transition matrices.

        The matrices are symplectic because the gravity gradient is symmetric.
        """
        c = self.axes
        transposed = np.swapaxes(self.transition, 1, 2)
        inverse = np.empty_like(transposed)
        inverse[:, :c, :c] = transposed[:, c:, c:]
        inverse[:, c:, c:] = transposed[:, :c, :c]
        inverse[:, :c, c:] = -transposed[:, c:, :c]
        inverse[:, c:, :c] = -transposed[:, :c, c:]
        return inverse

    def difference(
        self, offset_m: Floats, velocity_m_s: Floats, acceleration_m_s2: Floats
    ) -> Floats:
        """Return a difference of two motions of the object to first order, shape (2 C, n).

        `offset_m` and `velocity_m_s`, shape (C - 1,), are its lateral parts at t = 0; it has no
        part along x there. `acceleration_m_s2`, shape (C - 1, n - 1), is the difference of the
        accelerations over each step.
        """
        start = np.zeros(2 * self.axes)
        start[: self.axes - 1] = offset_m
        start[self.axes : -1] = velocity_m_s
        shares = np.einsum("nsw,wn->ns", np.diff(self.pushed, axis=0), acceleration_m_s2)
        from_start = start + np.vstack([np.zeros_like(start), np.cumsum(shares, axis=0)])
        return np.asarray(np.einsum("nrs,ns->rn", self.transition, from_start))


def coasting(position_m: Floats, velocity_m_s: Floats, sun: Sun | None, step_s: float) -> Coasting:
    """Return the motion without impulses from a relative state until x = 0.

    Parameters
    ----------
    position_m, velocity_m_s : ndarray, shape (C,)
        (z, x) and (V_z, V_x) at t = 0; (y, z, x) and (V_y, V_z, V_x) in space; SI units. x is
        positive and V_x negative.
    sun : Sun or None
        None is free space.
    step_s : float
        Time between the steps, s.

    Raises
    ------
    NoArrivalError
        If x is positive until `LONGEST_FLIGHT`; never in free space.
    """
    if sun is None:
        return _straight(position_m, velocity_m_s, step_s)
    return _kepler(position_m, velocity_m_s, sun, step_s)


def _times(arrival_s: float, step_s: float) -> Floats:
    """Return the times of steps that start before the arrival, up to rounding, and the arrival."""
    steps = max(1, int(np.ceil(arrival_s / step_s * (1.0 - ARRIVAL_ROUNDING))))
    return np.append(np.arange(steps) * step_s, arrival_s)


def _straight(position_m: Floats, velocity_m_s: Floats, step_s: float) -> Coasting:
    """Return the motion without gravity, in closed form."""
    axes = len(position_m)
    times_s = _times(-position_m[-1] / velocity_m_s[-1], step_s)
    time = times_s[:, None, None]
    transition = np.tile(np.eye(2 * axes), (len(times_s), 1, 1))
    transition[:, :axes, axes:] = time * np.eye(axes)
    lateral = np.eye(axes)[:, :-1]
    # The change of the state at t = 0 with the effect of a constant acceleration a: the integral of
    # (-t a, a) over time, which carries each velocity change back to t = 0.
    pushed = np.concatenate([-0.5 * time**2 * lateral, time * lateral], axis=1)

    speeds = np.repeat(velocity_m_s[:, None], len(times_s), axis=1)
    states = np.vstack([position_m[:, None] + speeds * times_s, speeds])
    # The range is zero at the arrival, without its rounding error.
    states[axes - 1, -1] = 0.0
    return Coasting(times_s, states, transition, pushed, nearest_m=np.inf, speed_m_s=0.0)


class _KeplerFlight(NamedTuple):
    """Integrated flight in space until x = 0, in units of the first range and of the flight time
    without gravity.

    Parameters
    ----------
    arrival : float
        Time of x = 0.
    at : callable
        Returns the integrated values at given times: rows `CRAFT`, `RELATIVE`, `TRANSITION` and
        `PUSHED`.
    """

    arrival: float
    at: Callable[[Floats], Floats]


CRAFT = slice(0, 6)
RELATIVE = slice(6, 12)
TRANSITION = slice(12, 48)
PUSHED = slice(48, 60)
"""Rows of integrated values: heliocentric position and velocity of the spacecraft, relative ones of
the object, the transition matrix, and the integrals of its inverse.
"""
ROW_OF_X = 8
"""Row of the relative position along x."""


def _kepler(position_m: Floats, velocity_m_s: Floats, sun: Sun, step_s: float) -> Coasting:
    """Return the motion with gravity, integrated in units of the first range and of the flight time
    without gravity. Motion in a plane has the last two of three axes.
    """
    axes = len(position_m)
    metres = float(position_m[-1])
    seconds = float(-position_m[-1] / velocity_m_s[-1])
    parameter = sun.gravitational_parameter_m3_s2 * seconds**2 / metres**3
    relative = np.zeros((2, 3))
    relative[:, -axes:] = position_m / metres, velocity_m_s * seconds / metres
    flown = _kepler_flight(relative, _on_circular_orbit(sun, metres, parameter), parameter)
    if flown is None:
        raise NoArrivalError(f"x does not reach zero within {LONGEST_FLIGHT * seconds:g} s")

    times_s = _times(flown.arrival * seconds, step_s)
    found = flown.at(times_s / seconds)
    craft = found[CRAFT]
    apart = found[RELATIVE]

    # The rows of a plane are z and x of space.
    chosen = np.concatenate([np.arange(3 - axes, 3), np.arange(6 - axes, 6)])
    units = np.repeat([metres, metres / seconds], axes)
    states = units[:, None] * apart[chosen]
    states[axes - 1, -1] = 0.0
    transition = found[TRANSITION].reshape(6, 6, -1)[np.ix_(chosen, chosen)]
    pushed = found[PUSHED].reshape(6, 2, -1)[chosen][:, 3 - axes :]
    return Coasting(
        times_s,
        states,
        transition=np.moveaxis(transition, -1, 0) * (units[:, None] / units),
        pushed=np.moveaxis(pushed, -1, 0) * (units * seconds**2 / metres)[:, None],
        nearest_m=metres * _nearest(craft[:3], apart[:3]),
        speed_m_s=metres / seconds * max(_fastest(craft[3:]), _fastest(craft[3:] + apart[3:])),
    )


def _on_circular_orbit(sun: Sun, metres: float, parameter: float) -> Floats:
    """Return the heliocentric position and velocity of the spacecraft, shape (2, 3).

    `metres` is the unit of length, and `parameter` the gravitational parameter in the units of
    `_KeplerFlight`. The orbit is circular only if `sun` has no velocity of the spacecraft.
    """
    toward_sun, along_orbit = sun_and_orbit(sun)
    distance = sun.distance_m / metres
    return np.stack([-distance * toward_sun, np.sqrt(parameter / distance) * along_orbit])


def _kepler_flight(relative: Floats, craft: Floats, parameter: float) -> _KeplerFlight | None:
    """Integrate spacecraft, relative motion, transition matrix and `Coasting.pushed` together.

    None if x does not become zero within `LONGEST_FLIGHT`. `relative` and `craft` are positions and
    velocities, shape (2, 3).
    """
    from scipy.integrate import solve_ivp  # takes long to load

    def rates(_time: float, state: Floats) -> Floats:
        transition = state[TRANSITION].reshape(6, 6)
        # 12 numbers of the two craft and 36 of the transition matrix, then 12 of `pushed`.
        changes = np.empty(60)
        changes[:48] = pair_rates(state[:48], parameter)
        # Phi^-1 (0, unit acceleration): columns of the inverse, which is symplectic.
        pushed = changes[PUSHED].reshape(6, 2)
        pushed[:3] = -transition[:2, 3:].T
        pushed[3:] = transition[:2, :3].T
        return changes

    def along_x(_time: float, state: Floats) -> float:
        return float(state[ROW_OF_X])

    along_x.terminal = True  # type: ignore[attr-defined]
    flown = solve_ivp(
        rates,
        (0.0, LONGEST_FLIGHT),
        np.concatenate([craft.ravel(), relative.ravel(), np.eye(6).ravel(), np.zeros(12)]),
        method="DOP853",
        events=along_x,
        dense_output=True,
        # The absolute tolerance is for values near zero; chosen: a tenth of the relative error of a
        # value of one.
        rtol=INTEGRATION_TOLERANCE,
        atol=0.1 * INTEGRATION_TOLERANCE,
    )
    arrivals = flown.t_events[0]
    return _KeplerFlight(float(arrivals[0]), flown.sol) if len(arrivals) else None


def _nearest(craft: Floats, apart: Floats) -> float:
    """Return the minimum distance of the segment between spacecraft and object from the Sun."""
    share = np.clip(-(craft * apart).sum(axis=0) / (apart**2).sum(axis=0), 0.0, 1.0)
    return float(np.linalg.norm(craft + share * apart, axis=0).min())


def _fastest(velocities: Floats) -> float:
    return float(np.linalg.norm(velocities, axis=0).max())
