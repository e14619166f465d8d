"""Game noise with the extreme to keep prescribed for every step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from guidance.game_noise import GameNoise
from infoset import PredictedMiss

Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class SwitchingNoise(GameNoise):
    """Game noise with the extreme to keep prescribed for every step, not only for ties.

    Parameters
    ----------
    tie : TieRule
        Not used.
    tie_draws : ndarray, shape (B, steps)
        The upper extreme is kept where the value is not negative, the lower one elsewhere.
    """

    def _upper_is_worse(self, miss: PredictedMiss, step: int) -> Flags:
        return np.asarray(self.tie_draws[:, step] >= 0.0)
