"""Rules that problems of several kinds share: checks of their orbits and times."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from infoset.arrays import Floats
from infoset.rendezvous.two_body import OrbitalElements, flight_fault, orbit_fault

MAX_RADIANS = 1000.0
"""Maximum angle of the orbit during a problem, rad: 160 turns, after which linear motion is far
off; chosen.
"""
MIN_RADIANS = 1e-9
"""Minimum angle of the orbit during a problem, rad: a microsecond in a low orbit of the Earth. A
smaller one is a wrong unit; chosen.
"""
EARTH_M3_S2 = 3.986004418e14
"""Gravitational parameter of the Earth (WGS 84)."""
EARTH_RADIUS_M = 6378137.0
"""Equatorial radius of the Earth (WGS 84)."""


def check_angle(key: str, duration_s: float, rate_rad_s: float) -> None:
    """Raise ValueError if the orbit turns by an unlikely angle in a time.

    `key` is the key of the time in the message.
    """
    angle = duration_s * rate_rad_s
    if not MIN_RADIANS <= angle <= MAX_RADIANS:
        raise ValueError(
            f"{key} is {angle:.3g} radians of the orbit, and {MIN_RADIANS:g} to {MAX_RADIANS:g} "
            "make sense: check its unit and that of the orbit's rate"
        )


def check_orbit(key: str, state: tuple[ArrayLike, ArrayLike], mu_m3_s2: float) -> None:
    """Raise ValueError unless the orbit of a state is an ellipse outside its planet.

    The state is position and velocity, SI. The message begins with `key`. The planet has the radius
    `densest_m`.
    """
    position, velocity = (np.asarray(vector, dtype=float) for vector in state)
    fault = orbit_fault(position, velocity, mu_m3_s2, densest_m(mu_m3_s2))
    if fault is not None:
        raise ValueError(f"{key}: {fault}")


def check_flight(key: str, state: Floats, mu_m3_s2: float, before_s: float, after_s: float) -> None:
    """Raise ValueError if a body that coasts through a state meets its planet.

    The message begins with `key`.

    It coasts along any conic, from `before_s` before the `state` (position and velocity, SI), shape
    (6,), to `after_s` after it; the planet has the radius `densest_m`.
    """
    position = state[:3]
    velocity = state[3:]
    # With the reversed velocity the body moves backward in time along the same conic.
    for direction, duration_s in ((-1.0, before_s), (1.0, after_s)):
        try:
            fault = flight_fault(
                position, direction * velocity, mu_m3_s2, densest_m(mu_m3_s2), duration_s
            )
        except ValueError as error:
            raise ValueError(f"{key}: {error}") from None
        if fault is not None:
            raise ValueError(f"{key}: {fault}")


def densest_m(mu_m3_s2: float) -> float:
    """Return the radius of a planet with the density of the Earth.

    No planet or moon is denser, so none with this gravitational parameter is smaller.
    """
    return float(EARTH_RADIUS_M * (mu_m3_s2 / EARTH_M3_S2) ** (1.0 / 3.0))


def check_rate(rate_rad_s: float, eccentricity: float = 0.0) -> None:
    """Raise ValueError if no orbit about the Earth has this mean motion and eccentricity.

    See `check_orbit`; `rate_rad_s` is positive. The rate at the surface of a planet depends on its
    density only, so that the Earth stands for all of them.
    """
    axis_m = (EARTH_M3_S2 / rate_rad_s**2) ** (1.0 / 3.0)
    state = OrbitalElements(axis_m, eccentricity, 0.0, 0.0, 0.0, 0.0).state(EARTH_M3_S2)
    check_orbit("orbit_rate_rad_s", state, EARTH_M3_S2)
