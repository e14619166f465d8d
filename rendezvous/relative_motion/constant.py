"""Motion with a constant A: transition and held control from one block exponential."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm

from rendezvous._arrays import Floats
from rendezvous.relative_motion.linear_motion import checked_durations, state_scales


@dataclass(frozen=True, eq=False)
class ConstantMotion:
    """x' = A x + (0, u)' with a constant `matrix` A, shape (6, 6).

    Van Loan's block exponential, 9 x 9 for each interval, in states divided by (T, T, T, 1, 1, 1) to balance it.
    """

    matrix: Floats

    def transition(self, start_s: ArrayLike, end_s: ArrayLike) -> Floats:
        """Phi(end, start), shape (..., 6, 6); the end may be before the start."""
        durations = np.asarray(end_s, dtype=np.float64) - np.asarray(start_s, dtype=np.float64)
        scale = state_scales(durations)
        return np.asarray(expm(self._scaled(durations, scale)) * (scale[..., :, None] / scale[..., None, :]))

    def held_input(self, start_s: ArrayLike, end_s: ArrayLike) -> Floats:
        """Effect at the end of a unit control held from the start, shape (..., 6, 3)."""
        durations = checked_durations(start_s, end_s)
        scale = state_scales(durations)
        block = np.zeros((*durations.shape, 9, 9))
        block[..., :6, :6] = self._scaled(durations, scale)
        block[..., (3, 4, 5), (6, 7, 8)] = 1.0
        return np.asarray(expm(block)[..., :6, 6:] * scale[..., :, None] * durations[..., None, None])

    def _scaled(self, durations: Floats, scale: Floats) -> Floats:
        """A T in states divided by (T, T, T, 1, 1, 1)."""
        return np.asarray(self.matrix * (scale[..., None, :] / scale[..., :, None]) * durations[..., None, None])
