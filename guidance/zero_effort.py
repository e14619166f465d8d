"""Zero-effort-miss guidance on the middle of the information set."""

from __future__ import annotations

import numpy as np

from infoset.arrays import Floats
from infoset.guidance.situation import Situation
from infoset.guidance.symmetric_impulse import range_at_impulse


class ZeroEffortMiss:
    """Steer the middle of the set to a miss of zero.

    Notes
    -----
    The middle of a section is the middle m of its interval of predicted misses, with the width of
    the interval as its weight w. This approximates the centroid of the set without its vertices.
    The impulse minimises the weighted sum of the squared misses of the middles: k = e sum(w m x) /
    sum(w x^2). (The middle of the whole interval gives U_s.)

    Limits: like U_s, it corrects every change of the middle, so it reacts to noise and spends as
    much. Unlike U_s, it leaves the ends of the interval unequal, so it does not minimise the
    maximum possible miss.

    References
    ----------
    Zarchan (2012), Tactical and Strategic Missile Guidance, chapter 2, for guidance by the
    zero-effort miss. Its use on the middle of a set is not from the literature; it is a baseline
    for comparison.
    """

    name = "zero-effort-miss"

    def start(self, shape: tuple[int, int]) -> None:
        """Start without a state."""

    def decide(self, situation: Situation, state: None) -> Floats:
        """Return the impulse k that minimises the weighted squares of the middles' misses, m/s.

        It is zero if all ranges at the impulse are zero.
        """
        lower, upper = situation.information.predicted_miss_by_section_m()
        feasible = situation.information.feasible
        # The addition keeps the weights positive if every section is a single point. They are then
        # divided by the greatest one, so that such weights do not underflow in the products;
        # without a feasible section all are zero, and the second `tiny` is only a divisor.
        width = upper - lower + np.finfo(np.float64).tiny
        weight = np.where(feasible, width, 0.0)
        weight = weight / np.maximum(weight.max(axis=-1, keepdims=True), np.finfo(np.float64).tiny)

        e = situation.closing_speed_m_s
        ranges = situation.information.ranges_m
        middle = 0.5 * (lower + upper)
        if situation.pending:
            middle = middle - situation.pending_m(ranges / e)

        ranges = range_at_impulse(ranges, e, situation.lead_s)
        wanted = (weight * middle * ranges).sum(axis=-1) * e
        square = (weight * ranges**2).sum(axis=-1)
        return np.asarray(np.divide(wanted, square, out=np.zeros_like(wanted), where=square > 0.0))
