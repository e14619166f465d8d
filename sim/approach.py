"""The approach of a spacecraft to an object, from the states of both: geometry, attracting body and covariance."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from infoset import StateBox
from infoset.arrays import Floats
from sim.b_plane import approach_axes, b_plane
from sim.scenario import Sun
from sim.two_body import closest_approach_s, propagate

WIDEST = 0.1
"""Maximum miss of an approach in units of its range at the start."""
SPEEDS = (0.05, 20.0)
"""Speeds around the attracting body in units of that of a circular orbit; others are mistakes of units."""


@dataclass(frozen=True)
class Approach:
    """An approach without impulses, in the axes of a scenario: y along T, z along R and x along S of the B-plane.

    The B-plane is across the relative velocity at the start.

    Parameters
    ----------
    start_s : float
        Time from the epoch of the states to the start, s.
    flight_s : float
        Time from the start to the closest approach, s.
    state : ndarray, shape (6,)
        (y, z, x), m, and (V_y, V_z, V_x), m/s, of the object from the spacecraft at the start.
    covariance : ndarray, shape (6, 6)
        Its covariance.
    sun : Sun or None
        The attracting body at the start.
    miss_m : ndarray, shape (2,)
        (B.T, B.R) of the closest approach.
    speed_change_m_s, turn_rad : float
        Changes of the closing speed, m/s, and of the direction of approach, rad, until the closest approach.
    """

    start_s: float
    flight_s: float
    state: Floats
    covariance: Floats
    sun: Sun | None
    miss_m: Floats
    speed_change_m_s: float
    turn_rad: float

    def box(self, sigmas: float) -> StateBox:
        """Return the box of a number of standard deviations around the state."""
        half = sigmas * np.sqrt(np.maximum(self.covariance.diagonal(), 0.0))
        ends = [(_rounded(low), _rounded(high)) for low, high in zip(self.state - half, self.state + half, strict=True)]
        return StateBox(**dict(zip(("y_m", "z_m", "x_m", "vy_m_s", "vz_m_s", "vx_m_s"), ends, strict=True)))


def find_approach(
    states: Floats,
    parameter_m3_s2: float,
    covariance: Floats,
    pole: Floats,
    flight_s: float | None,
) -> Approach:
    """Return the approach of a pair of states at an epoch.

    Parameters
    ----------
    states : ndarray, shape (4, 3)
        See `sim.two_body`.
    parameter_m3_s2 : float
        Gravitational parameter of the attracting body; zero is no gravity.
    covariance : ndarray, shape (6, 6)
        Covariance of the relative state at the epoch.
    pole : ndarray, shape (3,)
        Normal of the reference plane of the B-plane.
    flight_s : float or None
        Time from the start to the closest approach; None starts at the epoch.

    Raises
    ------
    ValueError
        If there is no approach, or it does not fit a scenario.
    """
    _check_speeds(states, parameter_m3_s2)
    arrival_s = closest_approach_s(states, parameter_m3_s2)
    start_s = 0.0 if flight_s is None else arrival_s - flight_s
    start, transition = propagate(states, parameter_m3_s2, start_s)
    end, _ = propagate(start, parameter_m3_s2, arrival_s - start_s)
    axes = approach_axes(start[3], pole)
    (range_m, *_), miss_m = (axes @ start[2])[::-1], float(np.linalg.norm(end[2]))
    if arrival_s <= start_s:
        raise ValueError(
            f"the closest approach is {-arrival_s / 86400.0:.6g} d before the epoch: give earlier states, or flight_s"
        )
    if miss_m > WIDEST * range_m:
        raise ValueError(
            f"the states do not meet: the closest approach is {miss_m / 1e3:.6g} km, {arrival_s / 86400.0:.6g} d after "
            f"the epoch, from {range_m / 1e3:.6g} km at the start; check the units, the epoch and the reference frame"
        )
    change = np.kron(np.eye(2), axes) @ transition
    matrix = change @ covariance @ change.T
    speeds = np.linalg.norm([start[3], end[3]], axis=1)
    cross = np.linalg.norm(np.cross(start[3], end[3])) / speeds.prod()
    return Approach(
        start_s=start_s,
        flight_s=arrival_s - start_s,
        state=np.array([*map(_rounded, axes @ start[2]), 0.0, 0.0, _rounded(-speeds[0])]),
        covariance=0.5 * (matrix + matrix.T),
        sun=_sun(axes @ start[0], axes @ start[1], parameter_m3_s2) if parameter_m3_s2 else None,
        miss_m=b_plane((axes @ end[2])[None, :2], 0.0)[0],
        speed_change_m_s=float(speeds[1] - speeds[0]),
        turn_rad=float(np.arctan2(cross, start[3] @ end[3] / speeds.prod())),
    )


def _check_speeds(states: Floats, parameter_m3_s2: float) -> None:
    """Refuse states that do not move, and speeds that no orbit around the attracting body has."""
    if not states[3].any():
        raise ValueError("spacecraft and object have the same velocity")
    if not parameter_m3_s2:
        return
    own, velocity, relative, relative_velocity = states
    for name, place, speed in (("spacecraft", own, velocity), ("object", own + relative, velocity + relative_velocity)):
        distance_m = float(np.linalg.norm(place))
        circular_m_s = math.sqrt(parameter_m3_s2 / distance_m) if distance_m else math.inf
        ratio = float(np.linalg.norm(speed)) / circular_m_s
        if not SPEEDS[0] <= ratio <= SPEEDS[1]:
            raise ValueError(
                f"{name}: its speed is {ratio:.3g} times that of a circular orbit at its distance of "
                f"{distance_m / 1e3:.6g} km: check the units of positions, velocities and the gravitational parameter"
            )


def _sun(place_m: Floats, velocity_m_s: Floats, parameter_m3_s2: float) -> Sun:
    """Return the attracting body, from the position and velocity (y, z, x) of the spacecraft from it."""
    y, z, x = -place_m
    return Sun(
        gravitational_parameter_m3_s2=parameter_m3_s2,
        distance_m=_rounded(float(np.linalg.norm(place_m))),
        direction_rad=math.atan2(z, x),
        elevation_rad=math.atan2(y, math.hypot(z, x)),
        spacecraft_velocity_m_s=tuple(map(_rounded, velocity_m_s.tolist())),
    )


def _rounded(value: float) -> float:
    """Return a value with 13 digits, so that a file has no digits of rounding."""
    return float(f"{value:.13g}")
