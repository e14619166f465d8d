"""Motion about a circular orbit (Hill, Clohessy and Wiltshire), in closed forms that keep their digits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rendezvous.relative_motion.frames import HILL, Frame, StateOrder
from rendezvous.relative_motion.linear_motion import Segment, checked_durations, checked_rate, velocity_input

Floats = NDArray[np.float64]

SERIES_BELOW_RAD = 1.0
QUADRATURE_BELOW_RAD = 2.0
_NODES, _WEIGHTS = (each.astype(np.float64) for each in np.polynomial.legendre.leggauss(12))


@dataclass(frozen=True)
class ClohessyWiltshire:
    """Relative motion about a circular orbit.

    Parameters
    ----------
    rate_rad_s : float
        Mean motion of the reference orbit.
    frame : Frame
        Of states and controls; position before velocity.

    Raises
    ------
    ValueError
        If the rate is not positive, or the frame interleaves positions and velocities.

    Notes
    -----
    Barseghyan and Stepanyan (2008), (1.8), X[T, t] and (2.3) corrected; a transition or a Gramian takes some 30 array
    operations however many durations there are.
    """

    rate_rad_s: float
    frame: Frame = HILL

    def __post_init__(self) -> None:
        checked_rate(self.rate_rad_s)
        if self.frame.order is not StateOrder.POSITION_THEN_VELOCITY:
            raise ValueError(f"frame {self.frame.name}: motions have position before velocity; convert their results")

    def dynamics(self, time_s: ArrayLike) -> Floats:
        """A, the same at all times, shape (..., 6, 6)."""
        n = self.rate_rad_s
        matrix = np.zeros((*np.shape(time_s), 6, 6))
        matrix[..., 0, 3] = matrix[..., 1, 4] = matrix[..., 2, 5] = 1.0
        matrix[..., 3, 0], matrix[..., 3, 4] = 3.0 * n * n, 2.0 * n
        matrix[..., 4, 3], matrix[..., 5, 2] = -2.0 * n, -n * n
        return HILL.matrices_to(self.frame, matrix)

    def input_map(self, time_s: ArrayLike) -> Floats:
        """B, shape (..., 6, 3)."""
        return velocity_input(np.shape(time_s))

    def forcing(self, time_s: ArrayLike) -> Floats:
        """Zero, shape (..., 6)."""
        return np.zeros((*np.shape(time_s), 6))

    def transition(self, start_s: ArrayLike, end_s: ArrayLike) -> Floats:
        """Phi(end, start), shape (..., 6, 6); the end may be before the start."""
        n = self.rate_rad_s
        theta = n * (np.asarray(end_s, dtype=np.float64) - np.asarray(start_s, dtype=np.float64))
        sine, half = np.sin(theta), np.sin(0.5 * theta)
        versine = 2.0 * half * half
        matrix = np.zeros((*theta.shape, 6, 6))
        matrix[..., 3:] = _unit_effect(theta)
        matrix[..., :3, 3:] /= n
        matrix[..., 0, 0] = 1.0 + 3.0 * versine
        matrix[..., 1, 0] = -6.0 * angle_less_sine(theta)
        matrix[..., 1, 1] = 1.0
        matrix[..., 3, 0] = 3.0 * n * sine
        matrix[..., 4, 0] = -6.0 * n * versine
        matrix[..., 2, 2] = 1.0 - versine
        matrix[..., 5, 2] = -n * sine
        return HILL.matrices_to(self.frame, matrix)

    def gramian(self, start_s: ArrayLike, end_s: ArrayLike) -> Floats:
        """Gramian, int Phi(end, t) B B' Phi(end, t)' dt from start to end, shape (..., 6, 6); end >= start.

        Notes
        -----
        Below two radians by Gauss and Legendre's rule, where the closed forms cancel, beyond by these; each entry is
        within 1e-14 of its own size up to 50 radians.
        """
        n = self.rate_rad_s
        theta = np.atleast_1d(n * checked_durations(start_s, end_s))
        small = theta < QUADRATURE_BELOW_RAD
        if small.all():
            matrix = _quadrature_gramian(theta)
        else:
            matrix = _closed_gramian(theta)
            matrix[small] = _quadrature_gramian(theta[small])
        scale = np.array([n, n, n, 1.0, 1.0, 1.0])
        matrix /= n * np.outer(scale, scale)
        shape = np.broadcast_shapes(np.shape(start_s), np.shape(end_s))
        return HILL.matrices_to(self.frame, matrix.reshape(*shape, 6, 6))

    def segment(self, start_s: ArrayLike, end_s: ArrayLike) -> Segment:
        """Transition, Gramian and drift at once; end >= start."""
        return Segment(self.transition(start_s, end_s), self.gramian(start_s, end_s), self.drift(start_s, end_s))

    def held_input(self, start_s: ArrayLike, end_s: ArrayLike) -> Floats:
        """Effect at the end of a unit control held from the start, int Phi(end, t) B dt, shape (..., 6, 3)."""
        n = self.rate_rad_s
        theta = n * checked_durations(start_s, end_s)
        sine, half = np.sin(theta), np.sin(0.5 * theta)
        versine, lag = 2.0 * half * half, angle_less_sine(theta)
        matrix = np.zeros((*theta.shape, 6, 3))
        matrix[..., 0, 0] = matrix[..., 2, 2] = versine / n**2
        matrix[..., 0, 1] = 2.0 * lag / n**2
        matrix[..., 1, 0] = -2.0 * lag / n**2
        matrix[..., 1, 1] = (4.0 * versine - 1.5 * theta * theta) / n**2
        matrix[..., 3, 0] = matrix[..., 5, 2] = sine / n
        matrix[..., 3, 1] = 2.0 * versine / n
        matrix[..., 4, 0] = -2.0 * versine / n
        matrix[..., 4, 1] = (4.0 * sine - 3.0 * theta) / n
        conversion, turn = HILL.conversion_to(self.frame), self.frame.rotation @ HILL.rotation.T
        return np.asarray(conversion @ matrix @ turn.T)

    def drift(self, start_s: ArrayLike, end_s: ArrayLike) -> Floats:
        """Zero, shape (..., 6)."""
        return np.zeros((*np.broadcast_shapes(np.shape(start_s), np.shape(end_s)), 6))


def angle_less_sine(theta: Floats) -> Floats:
    """Return theta - sin(theta) to full relative accuracy.

    Parameters
    ----------
    theta : ndarray
        rad.

    Returns
    -------
    ndarray

    Notes
    -----
    Eight terms of the series up to one radian, where the difference loses digits.
    """
    squared = np.minimum(theta * theta, SERIES_BELOW_RAD)
    tail = np.ones_like(theta)
    for order in range(19, 3, -2):
        tail = 1.0 - squared / (order * (order - 1)) * tail
    return np.where(np.abs(theta) < SERIES_BELOW_RAD, theta**3 / 6.0 * tail, theta - np.sin(theta))


def _closed_gramian(theta: Floats) -> Floats:
    """Integrate in closed form for unit rate, axes of Hill; (2.3) of the paper with q11 and q44 corrected."""
    sine, cosine, sine2 = np.sin(theta), np.cos(theta), np.sin(2.0 * theta)
    versine, lag, climb = 1.0 - cosine, theta - sine, 4.0 * sine - 3.0 * theta
    matrix = np.zeros((*theta.shape, 6, 6))
    matrix[..., 0, 0] = 6.5 * theta - 8.0 * sine + 0.75 * sine2
    matrix[..., 0, 1] = -3.0 * lag * lag
    matrix[..., 0, 3] = 0.5 * (sine * sine + 4.0 * versine * versine)
    matrix[..., 0, 4] = -(11.0 * theta - 14.0 * sine + 1.5 * sine2)
    matrix[..., 1, 1] = 14.0 * theta + 3.0 * theta**3 + 24.0 * theta * cosine - 32.0 * sine - 3.0 * sine2
    matrix[..., 1, 3] = -(8.0 * sine + 1.5 * sine2 - 5.0 * theta - 6.0 * theta * cosine)
    matrix[..., 1, 4] = 0.5 * (climb * climb + 4.0 * versine * versine)
    matrix[..., 3, 3] = 2.5 * theta - 0.75 * sine2
    matrix[..., 3, 4] = -3.0 * versine * versine
    matrix[..., 4, 4] = 19.0 * theta + 3.0 * sine2 - 24.0 * sine
    matrix[..., 2, 2] = 0.5 * theta - 0.25 * sine2
    matrix[..., 2, 5] = 0.5 * sine * sine
    matrix[..., 5, 5] = 0.5 * theta + 0.25 * sine2
    return _symmetric(matrix)


def _quadrature_gramian(theta: Floats) -> Floats:
    """Integrate as `_closed_gramian` does, by quadrature, but for the two entries that cancel."""
    half = 0.5 * theta
    effect = _unit_effect(half[..., None] * (1.0 + _NODES)) * np.sqrt(_WEIGHTS)[:, None, None]
    columns = np.swapaxes(effect, -3, -2).reshape(*theta.shape, 6, 3 * len(_NODES))
    matrix = np.asarray(columns @ np.swapaxes(columns, -1, -2) * half[..., None, None])
    lag, versine = angle_less_sine(theta), 2.0 * np.sin(half) ** 2
    matrix[..., 0, 1] = matrix[..., 1, 0] = -3.0 * lag * lag
    matrix[..., 3, 4] = matrix[..., 4, 3] = -3.0 * versine * versine
    return matrix


def _unit_effect(theta: Floats) -> Floats:
    """Return Phi B for unit rate, axes of Hill, shape (..., 6, 3)."""
    sine, half = np.sin(theta), np.sin(0.5 * theta)
    double_versine = 4.0 * half * half
    matrix = np.zeros((*theta.shape, 6, 3))
    matrix[..., 0, 0] = matrix[..., 2, 2] = sine
    matrix[..., 0, 1] = double_versine
    matrix[..., 1, 0] = -double_versine
    matrix[..., 1, 1] = 4.0 * sine - 3.0 * theta
    matrix[..., 3, 0] = matrix[..., 5, 2] = np.cos(theta)
    matrix[..., 3, 1] = 2.0 * sine
    matrix[..., 4, 0] = -2.0 * sine
    matrix[..., 4, 1] = 1.0 - 2.0 * double_versine
    return matrix


def _symmetric(upper: Floats) -> Floats:
    """Complete a matrix of which the upper triangle is given."""
    return upper + np.swapaxes(np.triu(upper, 1), -1, -2)
