"""A strategy that corrects what is certain, and what could not be corrected later."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from guidance.predicted_miss import symmetric_impulse
from guidance.situation import Situation

Floats = NDArray[np.float64]

LAST_SECONDS_S = 3.0


class Patient:
    """Correct only what is certain, and what could not be corrected later; in the last 3 s, act as U_s.

    Parameters
    ----------
    share : float
        Share of the correction that later impulses can give, from 0 to 1, on which the strategy relies. With 0 it is
        U_s; with 1 it waits as long as it can.

    Raises
    ------
    ValueError
        If the share is not from 0 to 1.

    Notes
    -----
    Every hypothesis of the set has a predicted miss. If the whole interval of misses is on one side of zero, every
    hypothesis needs the correction of its near end: it is certain, and costs least when it is early. Only the worst
    hypothesis needs the correction of the far end. Later measurements usually refute it, so the strategy waits as long
    as a share of the correction that later impulses can give covers it: the sum of mu2 x_j/e over the remaining steps,
    limited by the budget. The excess over that is corrected now; if both ends have an excess, the two are balanced.

    Waiting saves the correction of noise, but the same correction costs more later, in proportion to 1/x. The larger
    the share, the later a worst case is corrected, with more impulses at their limit.

    Limits: misses are bounded only, so probable and merely possible hypotheses have the same weight. The share alone
    guarantees nothing: the interval includes future disturbances, but not future choices of the noise.

    References
    ----------
    Kumkov and Patsko (1997), section 6, for the interval and U_s. The rule of waiting is not theirs.
    """

    name = "patient"

    def __init__(self, share: float = 0.5) -> None:
        if not 0.0 <= share <= 1.0:
            raise ValueError(f"share must lie from 0 to 1: got {share}")
        self.share = share

    def start(self, batch: int) -> None:
        """Start without a state."""

    def decide(self, situation: Situation, state: None) -> Floats:
        """Return the certain part of the correction, or the urgent part if it is larger, m/s."""
        miss, e = situation.predicted_miss, situation.closing_speed_m_s
        upper_range, lower_range = miss.upper_point.range_m, miss.lower_point.range_m
        symmetric = symmetric_impulse(miss, e)
        certain = _impulse(np.maximum(miss.lower_m, 0.0), lower_range, e) + _impulse(
            np.minimum(miss.upper_m, 0.0), upper_range, e
        )
        above = np.maximum(miss.upper_m - self.share * correctable_later_m(situation, upper_range), 0.0)
        below = np.minimum(miss.lower_m + self.share * correctable_later_m(situation, lower_range), 0.0)
        both = (above > 0.0) & (below < 0.0)
        alone = _impulse(above, upper_range, e) + _impulse(below, lower_range, e)
        urgent = np.where(both, _impulse(above + below, upper_range + lower_range, e), alone)
        wanted = np.where(np.abs(urgent) > np.abs(certain), urgent, certain)
        last = np.minimum(upper_range, lower_range) <= LAST_SECONDS_S * e
        return np.where(last, symmetric, wanted)


def correctable_later_m(situation: Situation, range_m: Floats) -> Floats:
    """Return the miss (m) that impulses after this step can still correct, if the object is now at `range_m`.

    It is the sum of mu2 x_j/e over the next steps with x_j > 0, as many as the budget allows.
    """
    thruster, e, step_s = situation.thruster, situation.closing_speed_m_s, situation.step_s
    to_go_s = range_m / e
    steps = np.ceil(to_go_s / step_s) - 1.0
    full = np.clip(np.floor(situation.budget_left_m_s / thruster.greatest_impulse_m_s), 0.0, np.maximum(steps, 0.0))
    return np.asarray(thruster.greatest_impulse_m_s * (full * to_go_s - step_s * 0.5 * full * (full + 1.0)))


def _impulse(miss_m: Floats, range_m: Floats, closing_speed_m_s: float) -> Floats:
    """Return the impulse that corrects a miss at a range; zero where the range is not positive."""
    return np.divide(miss_m * closing_speed_m_s, range_m, out=np.zeros_like(range_m), where=range_m > 0.0)
