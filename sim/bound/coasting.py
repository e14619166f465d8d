"""Relative motion without impulses under gravity, and small differences of the object's motion from
it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from infoset.arrays import Floats
from infoset.sim.approach import pair_rates
from infoset.sim.kepler import sun_and_orbit
from infoset.sim.scenario import Sun

TOLERANCE = 1e-12
"""Relative tolerance of the integrator, in units in which range and flight time are one."""
LONGEST_FLIGHT = 3.0
"""Time, in units of range by closing speed, after which a motion counts as one that does not
arrive.
"""


MIN_RANGE = 1e-9
"""Minimum range of a step as a share of the first; at a range of zero there is no angle."""


class NoArrivalError(ValueError):
    """Gravity keeps the object from reaching x = 0."""


@dataclass(frozen=True)
class Coasting:
    """A motion without impulses, and the state-transition matrices of the object's motion around
    it.

    States are positions and then velocities along the lateral axes and x: (z, x, V_z, V_x) in a
    plane, (y, z, x, V_y, V_z, V_x) in space; n times.

    Parameters
    ----------
    times_s : ndarray, shape (n,)
        Times of all steps before the arrival, and the arrival, s.
    states : ndarray, shape (2 C, n)
        Relative states, m and m/s; x is zero at the arrival.
    transition : ndarray, shape (n, 2 C, 2 C)
        Derivatives Phi of the object's state with respect to that at t = 0.
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
        ranges_m = self.states[self.axes - 1]
        return np.asarray(np.maximum(ranges_m[:-1], MIN_RANGE * ranges_m[0]))

    @property
    def closing_speed_m_s(self) -> Floats:
        """Closing speed -V_x at all times, m/s, shape (n,)."""
        return np.asarray(-self.states[-1])

    @cached_property
    def back(self) -> Floats:
        """Inverses of the transition matrices, which are symplectic because the gravity gradient is
        symmetric.
        """
        c = self.axes
        transposed = np.swapaxes(self.transition, 1, 2)
        inverse = np.empty_like(transposed)
        inverse[:, :c, :c], inverse[:, c:, c:] = transposed[:, c:, c:], transposed[:, :c, :c]
        inverse[:, :c, c:], inverse[:, c:, :c] = -transposed[:, c:, :c], -transposed[:, :c, c:]
        return inverse

    def difference(
        self, offset_m: Floats, velocity_m_s: Floats, acceleration_m_s2: Floats
    ) -> Floats:
        """Return a difference of two motions of the object at all times, to first order, shape (2
        C, n).

        `offset_m` and `velocity_m_s`, shape (C - 1,), are its lateral parts at t = 0; it has no
        part along x there. `acceleration_m_s2`, shape (C - 1, n - 1), is that over each step.
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
        (z, x) and (V_z, V_x) at t = 0; (y, z, x) and (V_y, V_z, V_x) in space; SI units.
    sun : Sun or None
        None is free space.
    step_s : float
        Time between the steps, s.

    Raises
    ------
    NoArrivalError
        If x stays positive.
    """
    if sun is None:
        return _straight(position_m, velocity_m_s, step_s)
    return _kepler(position_m, velocity_m_s, sun, step_s)


def _times(arrival_s: float, step_s: float) -> Floats:
    """Return the times of steps that start before the arrival, up to rounding, and the arrival."""
    steps = max(1, int(np.ceil(arrival_s / step_s * (1.0 - TOLERANCE))))
    return np.append(np.arange(steps) * step_s, arrival_s)


def _straight(position_m: Floats, velocity_m_s: Floats, step_s: float) -> Coasting:
    axes = len(position_m)
    times_s = _times(-position_m[-1] / velocity_m_s[-1], step_s)
    transition = np.tile(np.eye(2 * axes), (len(times_s), 1, 1))
    time = times_s[:, None, None]
    lateral = np.eye(axes)[:, :-1]
    transition[:, :axes, axes:] = time * np.eye(axes)
    pushed = np.concatenate([-0.5 * time**2 * lateral, time * lateral], axis=1)
    speeds = np.repeat(velocity_m_s[:, None], len(times_s), axis=1)
    states = np.vstack([position_m[:, None] + speeds * times_s, speeds])
    states[axes - 1, -1] = 0.0
    return Coasting(times_s, states, transition, pushed, np.inf, 0.0)


def _kepler(position_m: Floats, velocity_m_s: Floats, sun: Sun, step_s: float) -> Coasting:
    """Integrate spacecraft, relative motion, transition matrices and `pushed` together, always in
    space.
    """
    from scipy.integrate import solve_ivp  # takes long to load

    axes = len(position_m)
    metres = float(position_m[-1])
    seconds = float(-position_m[-1] / velocity_m_s[-1])
    parameter = sun.gravitational_parameter_m3_s2 * seconds**2 / metres**3
    toward_sun, along_orbit = sun_and_orbit(sun)
    distance = sun.distance_m / metres
    relative = np.zeros((2, 3))
    relative[:, -axes:] = position_m / metres, velocity_m_s * seconds / metres
    craft = np.stack([-distance * toward_sun, np.sqrt(parameter / distance) * along_orbit])
    start = np.concatenate([craft.ravel(), relative.ravel(), np.eye(6).ravel(), np.zeros(12)])

    def rates(_time: float, state: Floats) -> Floats:
        transition = state[12:48].reshape(6, 6)
        changes = np.empty(60)
        changes[:48] = pair_rates(state[:48], parameter)
        # Phi^-1 (0, unit acceleration): columns of the inverse, which is symplectic.
        pushed = changes[48:].reshape(6, 2)
        pushed[:3] = -transition[:2, 3:].T
        pushed[3:] = transition[:2, :3].T
        return changes

    def along_x(_time: float, state: Floats) -> float:
        return float(state[8])

    along_x.terminal = True  # type: ignore[attr-defined]
    tolerances = {"rtol": TOLERANCE, "atol": 0.1 * TOLERANCE}
    flown = solve_ivp(
        rates,
        (0.0, LONGEST_FLIGHT),
        start,
        method="DOP853",
        events=along_x,
        dense_output=True,
        **tolerances,
    )
    if not len(flown.t_events[0]):
        raise NoArrivalError(f"x does not reach zero within {LONGEST_FLIGHT * seconds:g} s")
    times_s = _times(float(flown.t_events[0][0]) * seconds, step_s)
    found = flown.sol(times_s / seconds)
    own = found[:6]
    apart = found[6:12]
    transition = found[12:48].reshape(6, 6, -1)
    chosen = np.concatenate([np.arange(3 - axes, 3), np.arange(6 - axes, 6)])
    units = np.repeat([metres, metres / seconds], axes)
    states = units[:, None] * apart[chosen]
    states[axes - 1, -1] = 0.0
    share = np.clip(-(own[:3] * apart[:3]).sum(axis=0) / (apart[:3] ** 2).sum(axis=0), 0.0, 1.0)
    nearest = float(np.linalg.norm(own[:3] + share * apart[:3], axis=0).min())
    fastest = max(
        float(np.linalg.norm(each, axis=0).max()) for each in (own[3:], own[3:] + apart[3:])
    )
    return Coasting(
        times_s,
        states,
        np.moveaxis(transition[np.ix_(chosen, chosen)], -1, 0) * (units[:, None] / units),
        np.moveaxis(found[48:].reshape(6, 2, -1)[chosen][:, 3 - axes :], -1, 0)
        * (units * seconds**2 / metres)[:, None],
        metres * nearest,
        metres / seconds * fastest,
    )
