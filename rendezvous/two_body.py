"""Motion under the gravity of one point: coasting along an ellipse, in closed form, for many states at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rendezvous.relative_motion.elliptic_orbit import eccentric_of_mean

Floats = NDArray[np.float64]


def coast(states: Floats, duration_s: ArrayLike, gravitational_parameter_m3_s2: float) -> Floats:
    """Return `states` (r, v), shape (..., 6), about the attracting point, after coasting; `duration_s` may be negative.

    Raises
    ------
    ValueError
        If a state is not on an ellipse.

    Notes
    -----
    Lagrange's f and g functions of the change of the eccentric anomaly.
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


def coasting_rates(states: Floats, gravitational_parameter_m3_s2: float) -> Floats:
    """Return (v, -mu r / |r|^3), the time derivatives of coasting `states`, shape (..., 6)."""
    position = states[..., :3]
    cube = np.linalg.norm(position, axis=-1, keepdims=True) ** 3
    return np.concatenate([states[..., 3:], -gravitational_parameter_m3_s2 * position / cube], axis=-1)


def gravity_gradient(position_m: Floats, gravitational_parameter_m3_s2: float) -> Floats:
    """Return A = d(v, g) / d(r, v), shape (..., 6, 6), at positions of shape (..., 3)."""
    squared = (position_m**2).sum(axis=-1)[..., None, None]
    outer = position_m[..., :, None] * position_m[..., None, :]
    matrix = np.zeros((*position_m.shape[:-1], 6, 6))
    matrix[..., :3, 3:] = np.eye(3)
    matrix[..., 3:, :3] = gravitational_parameter_m3_s2 / squared**1.5 * (3.0 * outer / squared - np.eye(3))
    return matrix
