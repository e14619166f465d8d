"""The linear game about a circular orbit, from the textbook solution of Hill's equations and SciPy
alone.

The capture is the first zero of the distance that the evader can keep, l(T) = max over |nu| = 1 of
nu . (Phi x)_r - (a_P - a_E) int |Phi_rv(T - t)^T nu| dt: both reachable sets have the same shape.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq, minimize

from infoset.arrays import Floats

POINTS, WEIGHTS = np.polynomial.legendre.leggauss(20)
PANELS = 25


def hill(angle: Floats) -> tuple[Floats, Floats]:
    """Phi_rr and Phi_rv of Hill's equations at rate one, shape (n, 3, 3)."""
    s = np.sin(angle)
    c = np.cos(angle)
    rr = np.zeros((len(angle), 3, 3))
    rv = np.zeros((len(angle), 3, 3))
    rr[:, 0, 0], rr[:, 1, 0], rr[:, 1, 1], rr[:, 2, 2] = 4.0 - 3.0 * c, 6.0 * (s - angle), 1.0, c
    rv[:, 0, 0], rv[:, 0, 1], rv[:, 2, 2] = s, 2.0 * (1.0 - c), s
    rv[:, 1, 0], rv[:, 1, 1] = -2.0 * (1.0 - c), 4.0 * s - 3.0 * angle
    return rr, rv


def distance(position: Floats, velocity: Floats, advantage: float, angle: float) -> float:
    """l at a time, for the evader's relative state, at rate one."""
    rr, rv = (matrices[0] for matrices in hill(np.array([angle])))
    there = rr @ position + rv @ velocity
    edges = np.linspace(0.0, angle, PANELS + 1)
    half = 0.5 * angle / PANELS
    effects = hill((edges[:-1, None] + half * (1.0 + POINTS)).ravel())[1]
    weights = np.tile(half * WEIGHTS, PANELS)

    def kept(nu: Floats) -> float:
        return float(
            (advantage * weights @ np.linalg.norm(nu @ effects, axis=1) - nu @ there)
            / np.linalg.norm(nu)
        )

    return -float(
        minimize(kept, there / np.linalg.norm(there), method="BFGS", options={"gtol": 1e-12}).fun
    )


def capture_s(
    position_m: Floats, velocity_m_s: Floats, advantage_m_s2: float, rate: float, until_s: float
) -> float:
    """The first zero of l on a grid of 60 times, refined."""
    scaled = position_m, velocity_m_s / rate, advantage_m_s2 / rate**2
    times = np.linspace(0.0, until_s * rate, 61)[1:]
    values = np.array([distance(*scaled, angle) for angle in times])
    first = int(np.flatnonzero(values <= 0.0)[0])
    return (
        float(
            brentq(
                lambda angle: distance(*scaled, angle), times[first - 1], times[first], xtol=1e-13
            )
        )
        / rate
    )
