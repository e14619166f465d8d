"""The reference orbit of elliptic relative motion: its anomalies at a time, and A(t) about it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from infoset.rendezvous._arrays import Floats

_MAX_KEPLER_STEPS = 60
"""Maximum number of Newton's steps. They decrease to the root, and near e = 1 the last steps may
only alternate by rounding: then E is exact to rounding too."""
_ANOMALY_ROUNDING = 4e-16
"""Newton step, relative to 1 + E, at which E is exact to rounding: two roundings of a double."""


@dataclass(frozen=True)
class EllipticOrbit:
    """An elliptic reference orbit: mean motion, eccentricity, and true anomaly at t = 0.

    Raises
    ------
    ValueError
        If the mean motion is not positive, or the eccentricity outside [0, 1).
    """

    mean_motion_rad_s: float
    eccentricity: float = 0.0
    true_anomaly_rad: float = 0.0

    def __post_init__(self) -> None:
        if not self.mean_motion_rad_s > 0.0:
            raise ValueError(
                f"the mean motion must be positive, found {self.mean_motion_rad_s!r} rad/s"
            )
        if not 0.0 <= self.eccentricity < 1.0:
            raise ValueError(
                f"the eccentricity must be at least 0 and below 1, found {self.eccentricity!r}"
            )

    @classmethod
    def of_size(
        cls,
        semi_major_axis_m: float,
        eccentricity: float,
        gravitational_parameter_m3_s2: float,
        true_anomaly_rad: float = 0.0,
    ) -> EllipticOrbit:
        """Return the orbit of a semi-major axis and an `eccentricity` in [0, 1).

        The true anomaly is that at t = 0.
        """
        rate = float(np.sqrt(gravitational_parameter_m3_s2 / semi_major_axis_m**3))
        return cls(rate, eccentricity, true_anomaly_rad)

    @property
    def semi_latus_rate_rad_s(self) -> float:
        """Mean motion of a circular orbit at the semi-latus rectum p, rad/s.

        It is sqrt(mu / p^3) = h / p^2 with the angular momentum h per mass. Yamanaka and Ankersen
        (2002) call it k^2.
        """
        return float(self.mean_motion_rad_s / (1.0 - self.eccentricity**2) ** 1.5)

    def eccentric_anomaly(self, time_s: ArrayLike) -> Floats:
        """Return the eccentric anomaly at times, rad; it increases without bound."""
        start = self._eccentric_of_true(self.true_anomaly_rad)
        times = np.asarray(time_s, dtype=np.float64)
        mean = start - self.eccentricity * np.sin(start) + self.mean_motion_rad_s * times
        return eccentric_of_mean(mean, self.eccentricity)

    def time_of_eccentric(self, eccentric_rad: Floats) -> Floats:
        """Return the times of eccentric anomalies, s, by Kepler's equation."""
        start = self._eccentric_of_true(self.true_anomaly_rad)
        e = self.eccentricity
        mean = eccentric_rad - start - e * (np.sin(eccentric_rad) - np.sin(start))
        return np.asarray(mean / self.mean_motion_rad_s)

    def true_anomaly(self, time_s: ArrayLike) -> Floats:
        """Return the true anomaly at times, rad; it increases without bound."""
        eccentric = self.eccentric_anomaly(time_s)
        fraction = self._anomaly_fraction
        sine = fraction * np.sin(eccentric)
        return np.asarray(eccentric + 2.0 * np.arctan2(sine, 1.0 - fraction * np.cos(eccentric)))

    def dynamics(self, time_s: ArrayLike) -> Floats:
        """Return A(t), shape (..., 6, 6), of states in m and m/s in Hill's axes.

        Equation (2) of Shorikov and Goranov (2021), whose x is -y here and whose y is x; mu / r^3 =
        w^2 r / p.
        """
        anomaly = self.true_anomaly(time_s)
        e = self.eccentricity
        k2 = self.semi_latus_rate_rad_s
        rho = 1.0 + e * np.cos(anomaly)
        w = k2 * rho**2
        w_dot = -2.0 * k2**2 * e * np.sin(anomaly) * rho**3
        gravity = k2**2 * rho**3

        matrix = np.zeros((*anomaly.shape, 6, 6))
        matrix[..., 0, 3] = matrix[..., 1, 4] = matrix[..., 2, 5] = 1.0
        matrix[..., 3, 0] = w**2 + 2.0 * gravity
        matrix[..., 3, 1] = w_dot
        matrix[..., 3, 4] = 2.0 * w
        matrix[..., 4, 0] = -w_dot
        matrix[..., 4, 1] = w**2 - gravity
        matrix[..., 4, 3] = -2.0 * w
        matrix[..., 5, 2] = -gravity
        return matrix

    @property
    def _anomaly_fraction(self) -> float:
        """Tangent of half the angle whose sine is e: e / (1 + sqrt(1 - e^2))."""
        e = self.eccentricity
        return float(e / (1.0 + np.sqrt(1.0 - e * e)))

    def _eccentric_of_true(self, true_rad: float) -> float:
        fraction = self._anomaly_fraction
        sine = fraction * np.sin(true_rad)
        return float(true_rad - 2.0 * np.arctan2(sine, 1.0 + fraction * np.cos(true_rad)))


def eccentric_of_mean(mean_rad: ArrayLike, eccentricity: ArrayLike) -> Floats:
    """Solve Kepler's equation E - e sin E = M for E, rad; E increases with M without bound.

    Newton's method from a bound above the root in [0, pi], where the function is convex: it
    decreases to the root and cannot overshoot.
    """
    mean = np.asarray(mean_rad, dtype=np.float64)
    e = np.asarray(eccentricity, dtype=np.float64)

    # E - M is odd and periodic: what is left of M after whole turns is solved for its size.
    turns = 2.0 * np.pi * np.round(mean / (2.0 * np.pi))
    sign = np.where(mean < turns, -1.0, 1.0)
    rest = np.abs(mean - turns)

    # Three bounds above the root: sin E <= 1, sin E <= E, and the rest is at most pi.
    eccentric = np.minimum(np.minimum(rest + e, rest / (1.0 - e)), np.pi)
    for _ in range(_MAX_KEPLER_STEPS):
        excess = eccentric - e * np.sin(eccentric) - rest
        step = excess / (1.0 - e * np.cos(eccentric))
        eccentric = np.maximum(eccentric - step, 0.0)
        if np.all(np.abs(step) <= _ANOMALY_ROUNDING * (1.0 + eccentric)):
            break
    return np.asarray(turns + sign * eccentric)
