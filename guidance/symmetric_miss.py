"""The paper's strategy U_s."""

from __future__ import annotations

from infoset.arrays import Floats
from infoset.guidance.situation import Situation
from infoset.guidance.symmetric_impulse import symmetric_impulse


class SymmetricMiss:
    """Keep the predicted-miss interval symmetric about zero: the maximum possible miss is minimal.

    It reacts to noise: every measurement moves the middle of the interval, and every move is
    corrected.

    References
    ----------
    Kumkov and Patsko (1997), section 6. `Thruster.give` applies the thresholds of the engine.
    """

    name = "symmetric-miss"

    def start(self, shape: tuple[int, int]) -> None:
        """Start without a state."""

    def decide(self, situation: Situation, state: None) -> Floats:
        """Return k_s of equation (15), m/s."""
        return symmetric_impulse(
            situation.predicted_miss, situation.closing_speed_m_s, situation.lead_s
        )
