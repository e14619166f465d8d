"""The approach of a spacecraft to an object from the states of both, in the axes of its B-plane.

A pair of states is an array of shape (4, 3): position and velocity of the spacecraft from the
attracting body, and of the object from the spacecraft. Without an attracting body its parameter K
is zero, and both move on straight lines.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from infoset.arrays import Floats
from infoset.model import StateBox
from infoset.sim.covariance import Covariance, covariance_of
from infoset.sim.results import b_plane
from infoset.sim.scenario import Sun

DAY_S = 86_400.0
"""A day, s."""
STEP_TOLERANCE = 1e-12
"""Relative error of a step of the integration: 1 mm of a relative position of a million kilometres,
and well above rounding errors.
"""
UNIT = np.eye(3)
"""Unit matrix of space."""
SEARCH = 3.0
"""Limit of the time of the closest approach, in units of its time along straight lines. Chosen;
gravity changes the time of an approach that fits a scenario little, and a later one is refused.
"""
WIDEST = 0.1
"""Maximum miss of an approach in units of its range at the start: the paths of wider ones are not
almost along the axis x, which a scenario assumes.
"""
SPEEDS = (0.05, 20.0)
"""Speeds around the attracting body in units of the speed of a circular orbit. Others are mistakes
of units: those of metres and kilometres change the ratio by a factor of 30 or more.
"""
AXES_TOLERANCE = 1e-9
"""Sine of the angle between approach and pole below which the axis T is a rounding error."""
FILE_DIGITS = 13
"""Number of digits in a scenario file: more than states are known to, and the rounding errors of a
propagation are in later ones.
"""


@dataclass(frozen=True)
class Approach:
    """An approach without impulses, with (y, z, x) along (T, R, S) of the B-plane across the
    velocity at its start.

    It starts `start_s` after the epoch of the states, before it if negative, with the relative
    state (y, z, x) and (V_y, V_z, V_x), its covariance and the attracting body, None in free space.
    It lasts `flight_s` until the closest approach at (B.T, B.R) = `miss_m`. Until then the relative
    speed increases by `speed_change_m_s`, and its direction changes by an angle whose sine is
    `turn_rad`: it is small.
    """

    start_s: float
    flight_s: float
    state: Floats
    covariance: Covariance
    sun: Sun | None
    miss_m: Floats
    speed_change_m_s: float
    turn_rad: float

    def box(self, sigmas: float) -> StateBox:
        """Return the box of a number of standard deviations to each side of the state."""
        y, z, x, v_y, v_z, v_x = (
            (_rounded(mean - sigmas * sigma), _rounded(mean + sigmas * sigma))
            for mean, sigma in zip(self.state, self.covariance.sigma, strict=True)
        )
        return StateBox(y_m=y, z_m=z, x_m=x, vy_m_s=v_y, vz_m_s=v_z, vx_m_s=v_x)


def find_approach(
    states: Floats, parameter_m3_s2: float, covariance: Floats, pole: Floats, flight_s: float | None
) -> Approach:
    """Return the approach of a pair of states at an epoch.

    `covariance` is that of the relative state, shape (6, 6), and `pole` the normal of the reference
    plane of the B-plane. The approach starts `flight_s` before the closest one; None is the epoch.
    A ValueError is raised if there is none, or it does not fit a scenario.
    """
    if parameter_m3_s2:
        _check_speed(states, parameter_m3_s2)
    arrival_s = closest_approach_s(states, parameter_m3_s2)
    start_s = 0.0 if flight_s is None else arrival_s - flight_s
    if arrival_s <= start_s:
        raise ValueError(
            f"the closest approach is {-arrival_s / DAY_S:.6g} d before the epoch: give earlier "
            "states, or flight_s"
        )

    start, transition = propagate(states, parameter_m3_s2, start_s)
    end, _ = propagate(start, parameter_m3_s2, arrival_s - start_s)
    own_start, own_velocity, relative_start, velocity_start = start
    _, _, relative_end, velocity_end = end
    axes = approach_axes(velocity_start, pole)
    place = axes @ relative_start
    range_m = place[2]
    miss_m = float(np.linalg.norm(relative_end))
    if miss_m > WIDEST * range_m:
        raise ValueError(
            f"the states do not meet: the closest approach is {miss_m / 1e3:.6g} km, "
            f"{arrival_s / DAY_S:.6g} d after the epoch, from {range_m / 1e3:.6g} km at the "
            "start; check the units, the epoch and the reference frame"
        )

    sun = None
    if parameter_m3_s2:
        sun = _sun(axes @ own_start, axes @ own_velocity, parameter_m3_s2)
    # The axes turn position and velocity alike.
    change = np.kron(np.eye(2), axes) @ transition
    speeds = np.linalg.norm([velocity_start, velocity_end], axis=1)
    turn = np.linalg.norm(np.cross(velocity_start, velocity_end)) / speeds.prod()
    return Approach(
        start_s=start_s,
        flight_s=arrival_s - start_s,
        # S is opposite to the relative velocity, which has no other component.
        state=np.array([*map(_rounded, place), 0.0, 0.0, _rounded(-speeds[0])]),
        covariance=covariance_of(change @ covariance @ change.T),
        sun=sun,
        # The axis y is T.
        miss_m=b_plane((axes @ relative_end)[None, :2], 0.0)[0],
        speed_change_m_s=float(speeds[1] - speeds[0]),
        turn_rad=float(turn),
    )


def _check_speed(states: Floats, parameter_m3_s2: float) -> None:
    """Raise ValueError if the speed of the spacecraft is not one around the attracting body."""
    distance_m = np.linalg.norm(states[0])
    speed = np.linalg.norm(states[1])
    ratio = float(speed * math.sqrt(distance_m / parameter_m3_s2))
    if not SPEEDS[0] <= ratio <= SPEEDS[1]:
        raise ValueError(
            f"spacecraft: its speed is {ratio:.3g} times that of a circular orbit at its "
            f"distance of {distance_m / 1e3:.6g} km: check the units of positions, velocities "
            "and the gravitational parameter"
        )


def approach_axes(velocity: Floats, pole: Floats) -> Floats:
    """Return the axes (T, R, S) of a B-plane as rows, from the relative velocity of the object.

    S is opposite to this velocity, T = S x N / |S x N| with the normal N of the reference plane,
    the `pole`, and R = S x T: T is the line in which the two planes meet. A ValueError is raised if
    the approach is along the pole.

    References
    ----------
    Kizner (1961), A method of describing miss distances for lunar and interplanetary trajectories,
    Planetary and Space Science 7.
    """
    along = -velocity / np.linalg.norm(velocity)
    across = np.cross(along, pole)
    size = np.linalg.norm(across)
    if size <= AXES_TOLERANCE * np.linalg.norm(pole):
        raise ValueError("pole: must not be along the line of approach, where T has no direction")
    t_axis = across / size
    return np.stack([t_axis, np.cross(along, t_axis), along])


def closest_approach_s(states: Floats, parameter_m3_s2: float) -> float:
    """Return the time of the closest approach of a pair, s; it is negative if the two recede now.

    A ValueError is raised if there is none within `SEARCH` times the time along straight lines.
    """
    relative, velocity = states[2:]
    if not velocity.any():
        raise ValueError("spacecraft and object have the same velocity")
    horizon_s = float(-SEARCH * (relative @ velocity) / (velocity @ velocity))

    # Values 6 to 11 are the relative position and velocity.
    def radial(_time: float, state: Floats) -> float:
        return float(state[6:9] @ state[9:12])

    # The event is a minimum of the distance: r . v goes from negative to positive, and from
    # positive to negative if the integration is backward.
    radial.terminal = True  # type: ignore[attr-defined]
    radial.direction = np.sign(horizon_s)  # type: ignore[attr-defined]
    # Zero if the approach is now; negative, for a backward integration, if the two recede.
    time_s = 0.0
    if horizon_s:
        times_s = _integrate(states, parameter_m3_s2, horizon_s, radial).t_events[0]
        if not len(times_s):
            raise ValueError(
                f"the states have no closest approach within {abs(horizon_s) / DAY_S:.4g} d of "
                "their epoch"
            )
        time_s = times_s[0]

    # One step of Newton's method: the event has the error of an interpolation.
    (_, _, relative, velocity), _ = propagate(states, parameter_m3_s2, time_s)
    return float(time_s - relative @ velocity / (velocity @ velocity))


def propagate(states: Floats, parameter_m3_s2: float, duration_s: float) -> tuple[Floats, Floats]:
    """Return the pair of states after a time, and the transition matrix of the relative state.

    The matrix, shape (6, 6), maps small changes of the object's orbit. A ValueError is raised if
    the integration fails.
    """
    end = _integrate(states, parameter_m3_s2, duration_s).y[:, -1]
    # As in `pair_rates`: 12 numbers of the pair, then 36 of the matrix.
    return end[:12].reshape(4, 3), end[12:].reshape(6, 6)


def pair_rates(state: Floats, parameter_m3_s2: float) -> Floats:
    """Return the derivative of a pair of states and of its transition matrix, shape (48,).

    The difference of gravity has no cancellation: with q = r . (r + 2 R) / R^2, the ratio of the
    cubes of both distances is (1 + q)^(3/2) (Battin's form of Encke's method).
    """
    own, own_velocity, relative, velocity = state[:12].reshape(4, 3)
    transition = state[12:].reshape(6, 6)
    own_pull = np.zeros(3)
    pull = np.zeros(3)
    gradient = np.zeros((3, 3))
    if parameter_m3_s2:
        body = own + relative
        squared = own @ own
        scale = -parameter_m3_s2 / squared**1.5
        ratio = np.log1p(relative @ (own + body) / squared)
        own_pull = scale * own
        pull = scale * (relative + np.expm1(-1.5 * ratio) * body)
        gradient = (
            scale * np.exp(-1.5 * ratio) * (UNIT - 3.0 * (body[:, None] * body) / (body @ body))
        )
    changes = transition[3:].ravel(), (gradient @ transition[:3]).ravel()
    return np.concatenate([own_velocity, own_pull, velocity, pull, *changes])


def _integrate(states: Floats, parameter_m3_s2: float, duration_s: float, event: Any = None) -> Any:
    """Integrate a pair of states with the transition matrix of the relative state."""
    from scipy.integrate import solve_ivp  # takes long to load

    # Errors are relative to the modulus of each vector, and absolute for the transition matrix.
    sizes = np.linalg.norm(states, axis=1)
    scale = np.concatenate([np.repeat(np.where(sizes > 0.0, sizes, 1.0), 3), np.ones(36)])
    start = np.concatenate([states.ravel(), np.eye(6).ravel()])
    result = solve_ivp(
        lambda _, state: pair_rates(state, parameter_m3_s2),
        (0.0, duration_s),
        start,
        method="DOP853",
        rtol=STEP_TOLERANCE,
        atol=STEP_TOLERANCE * scale,
        events=event,
    )
    if not result.success or not np.isfinite(result.y[:, -1]).all():
        raise ValueError("the motion cannot be integrated: it comes too near the attracting body")
    return result


def _sun(place_m: Floats, velocity_m_s: Floats, parameter_m3_s2: float) -> Sun:
    """Return the attracting body, from position and velocity (y, z, x) of the spacecraft."""
    # From the spacecraft toward the attracting body.
    y, z, x = -place_m
    return Sun(
        gravitational_parameter_m3_s2=parameter_m3_s2,
        distance_m=_rounded(float(np.linalg.norm(place_m))),
        direction_rad=math.atan2(z, x),
        elevation_rad=math.atan2(y, math.hypot(z, x)),
        spacecraft_velocity_m_s=tuple(map(_rounded, velocity_m_s.tolist())),
    )


def _rounded(value: float) -> float:
    """Return a value without the digits that are rounding errors."""
    return float(f"{value:.{FILE_DIGITS}g}")
