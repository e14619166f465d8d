"""Motion under the gravity of one point: osculating elements, and coasting along an ellipse for many states at once."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rendezvous._arrays import Floats
from rendezvous.relative_motion.elliptic_orbit import eccentric_of_mean


@dataclass(frozen=True)
class OrbitalElements:
    """Elements of an ellipse and the true anomaly; `raan` is the right ascension of the ascending node.

    The constructor raises `ValueError` if the semi-major axis is not positive, or the eccentricity outside [0, 1).
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
        (cn, sn), (ci, si), (cp, sp) = (
            (np.cos(angle), np.sin(angle))
            for angle in (self.raan_rad, self.inclination_rad, self.argument_of_perigee_rad)
        )
        # In the plane, ahead is a quarter of a turn from the direction of the perigee.
        toward_perigee = np.array([cn * cp - sn * ci * sp, sn * cp + cn * ci * sp, si * sp])
        ahead = np.array([-cn * sp - sn * ci * cp, -sn * sp + cn * ci * cp, si * cp])
        position = radius * (cosine * toward_perigee + sine * ahead)
        return position, speed * (-sine * toward_perigee + (self.eccentricity + cosine) * ahead)


def semi_major_axis_m(position_m: Floats, velocity_m_s: Floats, gravitational_parameter_m3_s2: float) -> float:
    """Return the osculating semi-major axis, m: negative for a hyperbola, infinite for a parabola."""
    inverse = 2.0 / np.linalg.norm(position_m) - velocity_m_s @ velocity_m_s / gravitational_parameter_m3_s2
    return float(1.0 / inverse) if inverse != 0.0 else float("inf")


def perigee_m(position_m: Floats, velocity_m_s: Floats, gravitational_parameter_m3_s2: float) -> float:
    """Return the minimum distance from the planet's centre on the osculating orbit, m; zero for a radial fall."""
    inward = float(position_m @ velocity_m_s)
    momentum_squared = float((position_m @ position_m) * (velocity_m_s @ velocity_m_s)) - inward * inward
    latus_rectum = max(0.0, momentum_squared) / gravitational_parameter_m3_s2
    axis = semi_major_axis_m(position_m, velocity_m_s, gravitational_parameter_m3_s2)
    return latus_rectum / (1.0 + math.sqrt(max(0.0, 1.0 - latus_rectum / axis)))


def orbit_fault(position_m: Floats, velocity_m_s: Floats, mu_m3_s2: float, planet_radius_m: float) -> str | None:
    """Return why a craft cannot stay on the orbit of a state: it is no ellipse, or meets the planet; None if it can."""
    if not position_m.any():
        return "the position is the centre of the planet"
    axis = semi_major_axis_m(position_m, velocity_m_s, mu_m3_s2)
    if not 0.0 < axis < math.inf:
        return "the orbit is a parabola or a hyperbola: the velocity is not below the escape velocity"
    perigee = perigee_m(position_m, velocity_m_s, mu_m3_s2)
    if perigee <= 1e-6 * axis:
        return "the orbit is a fall along a line through the planet's centre"
    if perigee <= planet_radius_m:
        return (
            f"the orbit meets the planet: its perigee is {perigee / 1e3:.6g} km from the centre, and the planet's "
            f"radius is {planet_radius_m / 1e3:.6g} km"
        )
    return None


def coast(states: Floats, duration_s: ArrayLike, gravitational_parameter_m3_s2: float) -> Floats:
    """Return `states` (r, v), shape (..., 6), about the attracting point, after coasting; `duration_s` may be negative.

    Lagrange's f and g functions of the change of the eccentric anomaly. Raise `ValueError` if a state is not on an
    ellipse.
    """
    mu = gravitational_parameter_m3_s2
    position, velocity = states[..., :3], states[..., 3:]
    radius = np.linalg.norm(position, axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 2.0 / radius - (velocity**2).sum(axis=-1) / mu
    if not (np.isfinite(inverse).all() and (inverse > 0.0).all()):
        raise ValueError("a state is not on an ellipse about the attracting point: it escapes, or falls into it")
    axis = 1.0 / inverse
    cosine, sine = 1.0 - radius / axis, (position * velocity).sum(axis=-1) / np.sqrt(mu * axis)
    eccentricity, first = np.hypot(cosine, sine), np.arctan2(sine, cosine)
    if (eccentricity >= 1.0).any():
        raise ValueError("a state falls straight into the attracting point; give it a transverse velocity")
    rate = np.sqrt(mu / axis**3)
    passed = eccentric_of_mean(first - sine + rate * np.asarray(duration_s, dtype=np.float64), eccentricity) - first
    later = axis * (1.0 - cosine * np.cos(passed) + sine * np.sin(passed))
    half = 2.0 * np.sin(0.5 * passed) ** 2
    f = 1.0 - axis / radius * half
    g = (radius / axis * np.sin(passed) + sine * half) / rate
    f_rate = -np.sqrt(mu * axis) / (later * radius) * np.sin(passed)
    g_rate = 1.0 - axis / later * half
    return np.concatenate(
        [
            f[..., None] * position + g[..., None] * velocity,
            f_rate[..., None] * position + g_rate[..., None] * velocity,
        ],
        axis=-1,
    )
