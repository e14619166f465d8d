"""The paper's strategy U_s."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from guidance.predicted_miss import symmetric_impulse
from guidance.situation import Situation


class SymmetricMiss:
    """Keep the predicted-miss interval symmetric about zero: the greatest possible miss is then least.

    It chases the noise: the middle of the interval moves with every measurement, and every move is corrected.

    References
    ----------
    Kumkov and Patsko (1997), section 6. The thresholds of the engine are `Thruster.give`.
    """

    name = "symmetric-miss"

    def start(self, batch: int) -> None:
        """Start without a state."""

    def decide(self, situation: Situation, state: None) -> NDArray[np.float64]:
        """Return k_s of equation (15), m/s."""
        return symmetric_impulse(situation.predicted_miss, situation.closing_speed_m_s)
