"""Zero-effort-miss guidance on the middle of the information set."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from guidance.situation import Situation

Floats = NDArray[np.float64]


class ZeroEffortMiss:
    """Steer the middle of the set to a miss of zero.

    Notes
    -----
    The middle of a section is that of its interval of predicted misses, and it weighs as much as the interval is wide:
    a stand-in for the centroid of the whole set that needs no vertices. The impulse makes the weighted sum of squared
    misses of the middles least, k = e sum(w m x)/sum(w x^2). (The middle of the whole interval would be U_s itself.)

    Limits: like U_s it corrects every move of the middle, so it chases the noise and spends as much; and unlike U_s it
    leaves the ends of the interval unequal, so the greatest possible miss is not the least there is.

    References
    ----------
    Zarchan (2012), Tactical and Strategic Missile Guidance, chapter 2, for guidance by the zero-effort miss; that of a
    set's middle is the plain thing to do with a set, and is here to be compared with.
    """

    name = "zero-effort-miss"

    def start(self, batch: int) -> None:
        """Start without a state."""

    def decide(self, situation: Situation, state: None) -> Floats:
        """Return the impulse that takes the middle of the set to zero, m/s."""
        lower, upper = situation.information.predicted_miss_by_section_m()
        living, ranges = situation.information.living, situation.information.ranges_m
        # A single point is as good as any other where every section is one.
        width = upper - lower + np.finfo(np.float64).tiny
        weight = np.where(living, width, 0.0)
        weight = weight / np.maximum(weight.max(axis=1, keepdims=True), np.finfo(np.float64).tiny)
        wanted = (weight * 0.5 * (lower + upper) * ranges).sum(axis=1) * situation.closing_speed_m_s
        square = (weight * ranges**2).sum(axis=1)
        return np.asarray(np.divide(wanted, square, out=np.zeros_like(wanted), where=square > 0.0))
