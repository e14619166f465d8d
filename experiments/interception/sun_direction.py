"""Phase angle and direction of the Sun across the approach, from the attracting body of a
scenario.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from infoset.arrays import Floats
from infoset.sim import Sun

SUN_PARAMETER_M3_S2 = 1.32712440018e20
"""Gravitational parameter of the Sun, m^3/s^2 (DE405)."""
SAME_PARAMETER = 0.01
"""Relative difference of the parameter up to which the attracting body is the Sun: those of the
scenarios differ by 0.2 %, and Jupiter has a thousandth of it."""
FAR_RAD = math.radians(5.0)
"""Angle between two directions of the Sun above which a warning reports them. Chosen: the direction
changes by less in a flight of some days."""


class SunDirection(NamedTuple):
    """Phase angle at the object and direction of the Sun across x, from y toward z, deg."""

    phase_deg: float
    across_deg: float

    def __str__(self) -> str:
        return f"phase_angle_deg = {self.phase_deg:.4g}, sun_angle_deg = {self.across_deg:.4g}"

    def vector(self) -> Floats:
        """Return the unit vector (y, z, x) from the object to the Sun."""
        phase = math.radians(self.phase_deg)
        across = math.radians(self.across_deg)
        # The camera is toward -x, seen from the object.
        return np.array(
            [
                math.sin(phase) * math.cos(across),
                math.sin(phase) * math.sin(across),
                -math.cos(phase),
            ]
        )

    def is_far_from(self, other: SunDirection) -> bool:
        """Whether the angle between both directions is more than `FAR_RAD`."""
        return bool(self.vector() @ other.vector() < math.cos(FAR_RAD))


def is_the_sun(body: Sun) -> bool:
    """Whether the body of the table [sun] is the Sun: the table may be another attracting body."""
    ratio = body.gravitational_parameter_m3_s2 / SUN_PARAMETER_M3_S2
    return abs(ratio - 1.0) <= SAME_PARAMETER


def direction_of(sun: Sun | None) -> SunDirection | None:
    """Return the direction of the Sun at the start; None if the attracting body is not the Sun.

    It is seen from the spacecraft and taken for that from the object: the range is a negligible
    part of the distance of the Sun.
    """
    if sun is None or not is_the_sun(sun):
        return None

    in_plane = math.cos(sun.elevation_rad)
    x = in_plane * math.cos(sun.direction_rad)
    y = math.sin(sun.elevation_rad)
    z = in_plane * math.sin(sun.direction_rad)
    # Seen from the object, the spacecraft is toward -x: the phase angle is that from -x.
    phase_rad = math.atan2(math.hypot(y, z), -x)
    return SunDirection(math.degrees(phase_rad), math.degrees(math.atan2(z, y)))
