"""Motion about a circular orbit (Hill, Clohessy and Wiltshire), in accurate closed forms."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from infoset.rendezvous._arrays import Floats
from infoset.rendezvous._compile import compiled
from infoset.rendezvous.relative_motion.linear_motion import LinearMotion, Segment, even_breaks

SERIES_BELOW_RAD = 1.0
"""Angle below which theta - sin(theta) is computed by its series: beyond, the difference loses at
most three bits, and the next term of the series, theta^21 / 21!, is below 2e-19 of the sum."""
QUADRATURE_BELOW_RAD = 2.0
"""Angle below which Gramians are computed by Gauss and Legendre's rule: the closed forms cancel
below, and the rule of 12 nodes is exact to rounding. Tests compare both sides with 50 digits."""
NODES, WEIGHTS = (rule.astype(np.float64) for rule in np.polynomial.legendre.leggauss(12))
"""Gauss and Legendre's rule of a Gramian up to two radians, on [-1, 1]."""


@dataclass(frozen=True)
class ClohessyWiltshire(LinearMotion):
    """Relative motion about a circular orbit, whose mean motion n > 0 is `rate_rad_s`.

    Barseghyan and Stepanyan (2008): (1.8), X[T, t], and (2.3) with corrections, in Hill's axes. A
    transition takes about 0.1 microseconds, a Gramian at most 1.
    """

    rate_rad_s: float

    stationary = True

    def dynamics(self, time_s: ArrayLike) -> Floats:
        """A, which is constant, for times of any shape: shape (..., 6, 6).

        x'' = 3 n^2 x + 2 n y', y'' = -2 n x', z'' = -n^2 z.
        """
        n = self.rate_rad_s
        matrix = np.zeros((*np.shape(time_s), 6, 6))
        matrix[..., 0, 3] = matrix[..., 1, 4] = matrix[..., 2, 5] = 1.0
        matrix[..., 3, 0] = 3.0 * n * n
        matrix[..., 3, 4] = 2.0 * n
        matrix[..., 4, 3] = -2.0 * n
        matrix[..., 5, 2] = -n * n
        return matrix

    def transition(self, start_s: ArrayLike, end_s: ArrayLike) -> Floats:
        """Phi(end, start), shape (..., 6, 6); the end may be before the start."""
        durations = np.asarray(end_s, dtype=np.float64) - np.asarray(start_s, dtype=np.float64)
        matrices = np.zeros((durations.size, 6, 6))
        fill_transitions(self.rate_rad_s, durations.ravel(), matrices)
        return matrices.reshape(*durations.shape, 6, 6)

    def gramian(self, start_s: ArrayLike, end_s: ArrayLike) -> Floats:
        """Gramian, shape (..., 6, 6); end >= start.

        Up to two radians, where the closed forms cancel, Gauss and Legendre's rule is used. Each
        entry has a relative error below 1e-14 up to 50 radians.
        """
        durations = np.asarray(end_s, dtype=np.float64) - np.asarray(start_s, dtype=np.float64)
        matrices = np.zeros((durations.size, 6, 6))
        fill_gramians(self.rate_rad_s, durations.ravel(), NODES, WEIGHTS, matrices)
        return matrices.reshape(*durations.shape, 6, 6)

    def segment(self, start_s: ArrayLike, end_s: ArrayLike) -> Segment:
        """Transition and Gramian together; end >= start."""
        return Segment(self.transition(start_s, end_s), self.gramian(start_s, end_s))

    def breaks(self, start_s: float, end_s: float) -> Floats:
        """Evenly spaced times from start to end, inclusive, at most a radian apart."""
        return even_breaks(start_s, end_s, self.rate_rad_s * (end_s - start_s))


@compiled
def angle_less_sine(theta: float) -> float:
    """Return theta - sin(theta) to full relative accuracy."""
    if abs(theta) >= SERIES_BELOW_RAD:
        return theta - math.sin(theta)
    # Nine terms of theta^3 / 3! - theta^5 / 5! + ..., in nested form.
    squared = theta * theta
    tail = 1.0
    for order in range(19, 3, -2):
        tail = 1.0 - squared / (order * (order - 1)) * tail
    return theta * squared / 6.0 * tail


@compiled
def fill_effect(theta: float, effect: Floats) -> None:
    """Fill Phi B for unit rate, shape (6, 3), which is zero before."""
    sine = math.sin(theta)
    half = math.sin(0.5 * theta)
    versine = 2.0 * half * half

    effect[0, 0] = effect[2, 2] = sine
    effect[0, 1] = 2.0 * versine
    effect[1, 0] = -2.0 * versine
    effect[1, 1] = 4.0 * sine - 3.0 * theta
    effect[3, 0] = effect[5, 2] = math.cos(theta)
    effect[3, 1] = 2.0 * sine
    effect[4, 0] = -2.0 * sine
    effect[4, 1] = 1.0 - 4.0 * versine


@compiled
def fill_transitions(rate: float, durations: Floats, matrices: Floats) -> None:
    """Fill the transition matrices of durations, shape (k, 6, 6), which are zero before."""
    for row in range(len(durations)):
        theta = rate * durations[row]
        matrix = matrices[row]
        fill_effect(theta, matrix[:, 3:])
        # From unit rate: positions of a unit of velocity are divided by the rate.
        for first in range(3):
            for second in range(3, 6):
                matrix[first, second] /= rate

        sine = math.sin(theta)
        half = math.sin(0.5 * theta)
        versine = 2.0 * half * half
        matrix[0, 0] = 1.0 + 3.0 * versine
        matrix[1, 0] = -6.0 * angle_less_sine(theta)
        matrix[1, 1] = 1.0
        matrix[2, 2] = math.cos(theta)
        matrix[3, 0] = 3.0 * rate * sine
        matrix[4, 0] = -6.0 * rate * versine
        matrix[5, 2] = -rate * sine


@compiled
def fill_gramians(
    rate: float, durations: Floats, nodes: Floats, weights: Floats, matrices: Floats
) -> None:
    """Fill the Gramians of durations, shape (k, 6, 6), which are zero before."""
    effect = np.zeros((6, 3))
    for row in range(len(durations)):
        theta = rate * durations[row]
        matrix = matrices[row]
        if theta < QUADRATURE_BELOW_RAD:
            _integrate(theta, nodes, weights, effect, matrix)
        else:
            _close(theta, matrix)

        # Both methods lose digits in these two integrals; these forms lose none.
        half = math.sin(0.5 * theta)
        lag = angle_less_sine(theta)
        matrix[0, 1] = -3.0 * lag * lag
        matrix[3, 4] = -12.0 * half**4

        # From unit rate: positions are divided by the rate, and the time of the integral once more.
        for first in range(6):
            for second in range(first, 6):
                velocities = (first >= 3) + (second >= 3)
                matrix[first, second] /= rate ** (3 - velocities)
                matrix[second, first] = matrix[first, second]


@compiled
def _integrate(
    theta: float, nodes: Floats, weights: Floats, effect: Floats, matrix: Floats
) -> None:
    """Add the upper triangle for unit rate, by Gauss and Legendre's rule.

    The entries [0, 1] and [3, 4], in which digits are lost, are replaced by `fill_gramians`.
    """
    half = 0.5 * theta
    for node in range(len(nodes)):
        fill_effect(half * (1.0 + nodes[node]), effect)
        for first in range(6):
            for second in range(first, 6):
                product = 0.0
                for column in range(3):
                    product += effect[first, column] * effect[second, column]
                matrix[first, second] += half * weights[node] * product


@compiled
def _close(theta: float, matrix: Floats) -> None:
    """Fill the upper triangle for unit rate in closed form: (2.3) with q11 and q44 corrected.

    The entries [0, 1] and [3, 4] are filled by `fill_gramians`.
    """
    sine = math.sin(theta)
    cosine = math.cos(theta)
    sine2 = math.sin(2.0 * theta)
    versine = 1.0 - cosine
    climb = 4.0 * sine - 3.0 * theta

    matrix[0, 0] = 6.5 * theta - 8.0 * sine + 0.75 * sine2
    matrix[0, 3] = 0.5 * (sine * sine + 4.0 * versine * versine)
    matrix[0, 4] = -(11.0 * theta - 14.0 * sine + 1.5 * sine2)
    matrix[1, 1] = 14.0 * theta + 3.0 * theta**3 + 24.0 * theta * cosine - 32.0 * sine - 3.0 * sine2
    matrix[1, 3] = -(8.0 * sine + 1.5 * sine2 - 5.0 * theta - 6.0 * theta * cosine)
    matrix[1, 4] = 0.5 * (climb * climb + 4.0 * versine * versine)
    matrix[3, 3] = 2.5 * theta - 0.75 * sine2
    matrix[4, 4] = 19.0 * theta + 3.0 * sine2 - 24.0 * sine
    matrix[2, 2] = 0.5 * theta - 0.25 * sine2
    matrix[2, 5] = 0.5 * sine * sine
    matrix[5, 5] = 0.5 * theta + 0.25 * sine2
