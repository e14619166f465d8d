"""Motion with a constant A: transition, Gramian and held control from one block exponential."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm

from rendezvous._arrays import Floats
from rendezvous.relative_motion.linear_motion import LinearMotion, checked_durations, even_breaks, state_scales


@dataclass(frozen=True, eq=False)
class ConstantMotion(LinearMotion):
    """x' = A x + (0, u)' with a constant `matrix` A, shape (6, 6).

    Van Loan's block exponential, 12 x 12 for each interval, in states divided by (T, T, T, 1, 1, 1) to balance it.
    """

    matrix: Floats

    def dynamics(self, time_s: ArrayLike) -> Floats:
        """A, the same at all times, shape (..., 6, 6)."""
        return np.broadcast_to(self.matrix, (*np.shape(time_s), 6, 6))

    def transition(self, start_s: ArrayLike, end_s: ArrayLike) -> Floats:
        """Phi(end, start), shape (..., 6, 6); the end may be before the start."""
        durations = np.asarray(end_s, dtype=np.float64) - np.asarray(start_s, dtype=np.float64)
        scale = state_scales(durations)
        return np.asarray(expm(self._scaled(durations, scale)) * (scale[..., :, None] / scale[..., None, :]))

    def gramian(self, start_s: ArrayLike, end_s: ArrayLike) -> Floats:
        """Gramian, shape (..., 6, 6); end >= start."""
        durations = checked_durations(start_s, end_s)
        scale = state_scales(durations)
        scaled = self._scaled(durations, scale)
        block = np.zeros((*durations.shape, 12, 12))
        block[..., :6, :6] = -scaled
        block[..., 6:, 6:] = np.swapaxes(scaled, -1, -2)
        block[..., (3, 4, 5), (9, 10, 11)] = 1.0
        power = expm(block)
        unit = np.swapaxes(power[..., 6:, 6:], -1, -2) @ power[..., :6, 6:]
        unit = 0.5 * (unit + np.swapaxes(unit, -1, -2))
        factor = durations[..., None, None] * scale[..., :, None] * scale[..., None, :]
        return np.asarray(unit * factor)

    def held_input(self, start_s: ArrayLike, end_s: ArrayLike) -> Floats:
        """Effect at the end of a unit control held from the start, shape (..., 6, 3)."""
        durations = checked_durations(start_s, end_s)
        scale = state_scales(durations)
        block = np.zeros((*durations.shape, 9, 9))
        block[..., :6, :6] = self._scaled(durations, scale)
        block[..., (3, 4, 5), (6, 7, 8)] = 1.0
        return np.asarray(expm(block)[..., :6, 6:] * scale[..., :, None] * durations[..., None, None])

    def breaks(self, start_s: float, end_s: float) -> Floats:
        """Times from start to end, inclusive, a radian of the fastest eigenvalue apart at most."""
        rate = float(np.abs(np.linalg.eigvals(self.matrix)).max())
        return even_breaks(start_s, end_s, rate * (end_s - start_s))

    def _scaled(self, durations: Floats, scale: Floats) -> Floats:
        """A T in states divided by (T, T, T, 1, 1, 1)."""
        return np.asarray(self.matrix * (scale[..., None, :] / scale[..., :, None]) * durations[..., None, None])
