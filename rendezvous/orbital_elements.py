"""Osculating elements of an orbit, to and from position and velocity."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class OrbitalElements:
    """Elements of an ellipse and the true anomaly; `raan` is the right ascension of the ascending node.

    Raises
    ------
    ValueError
        If the semi-major axis is not positive, or the eccentricity outside [0, 1).
    """

    semi_major_axis_m: float
    eccentricity: float
    inclination_rad: float
    raan_rad: float
    argument_of_perigee_rad: float
    true_anomaly_rad: float

    def __post_init__(self) -> None:
        if not (self.semi_major_axis_m > 0.0 and 0.0 <= self.eccentricity < 1.0):
            raise ValueError(
                f"an ellipse has a semi-major axis above 0 and an eccentricity from 0 to below 1, not "
                f"{self.semi_major_axis_m:g} m and {self.eccentricity:g}"
            )

    def state(self, gravitational_parameter_m3_s2: float) -> tuple[Floats, Floats]:
        """Return position (m) and velocity (m/s), shapes (3,), in the inertial frame of the elements."""
        latus_rectum = self.semi_major_axis_m * (1.0 - self.eccentricity**2)
        cosine, sine = np.cos(self.true_anomaly_rad), np.sin(self.true_anomaly_rad)
        radius = latus_rectum / (1.0 + self.eccentricity * cosine)
        speed = np.sqrt(gravitational_parameter_m3_s2 / latus_rectum)
        toward_perigee, ahead = self._axes()
        position = radius * (cosine * toward_perigee + sine * ahead)
        return position, speed * (-sine * toward_perigee + (self.eccentricity + cosine) * ahead)

    def _axes(self) -> tuple[Floats, Floats]:
        """Unit vectors toward perigee and, in the plane, a quarter of a turn ahead of it."""
        (cn, sn), (ci, si), (cp, sp) = (
            (np.cos(angle), np.sin(angle))
            for angle in (self.raan_rad, self.inclination_rad, self.argument_of_perigee_rad)
        )
        toward_perigee = np.array([cn * cp - sn * ci * sp, sn * cp + cn * ci * sp, si * sp])
        ahead = np.array([-cn * sp - sn * ci * cp, -sn * sp + cn * ci * cp, si * cp])
        return toward_perigee, ahead


def semi_major_axis_m(position_m: Floats, velocity_m_s: Floats, gravitational_parameter_m3_s2: float) -> float:
    """Return the osculating semi-major axis, m: negative for a hyperbola, infinite for a parabola."""
    inverse = 2.0 / np.linalg.norm(position_m) - velocity_m_s @ velocity_m_s / gravitational_parameter_m3_s2
    return float(1.0 / inverse) if inverse != 0.0 else float("inf")


def perigee_m(position_m: Floats, velocity_m_s: Floats, gravitational_parameter_m3_s2: float) -> float:
    """Return the least distance from the planet's centre on the osculating orbit, m; zero for a radial fall."""
    inward = float(position_m @ velocity_m_s)
    momentum_squared = float((position_m @ position_m) * (velocity_m_s @ velocity_m_s)) - inward * inward
    latus_rectum = max(0.0, momentum_squared) / gravitational_parameter_m3_s2
    axis = semi_major_axis_m(position_m, velocity_m_s, gravitational_parameter_m3_s2)
    return latus_rectum / (1.0 + math.sqrt(max(0.0, 1.0 - latus_rectum / axis)))
