"""A strategy that waits: it corrects what is certain, and what could not be corrected later."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from guidance.predicted_miss import symmetric_impulse
from guidance.situation import Situation

Floats = NDArray[np.float64]

LAST_SECONDS_S = 3.0


class Patient:
    """Correct only what is certain, and what could no longer be corrected later; at the very end, as U_s.

    Parameters
    ----------
    share : float
        How much of what the remaining impulses can do is relied upon, from 0 to 1. At 0 every end of the interval is
        beyond it and the strategy is U_s; at 1 it corrects nothing before it must.

    Raises
    ------
    ValueError
        If the share is not from 0 to 1.

    Notes
    -----
    Every hypothesis of the set has a predicted miss. Where the whole interval of them is on one side of zero, its
    near end is what every hypothesis needs: correcting it is never regretted, and early it costs least. The far end
    is needed by the worst hypothesis only. Most of it will be refuted by later measurements, and the strategy leaves
    it to them as long as a share of what the remaining impulses can do would still correct it:
    the sum over the steps to come of mu2 x_j/e, with no more of them than the budget pays for. What is beyond is
    corrected now; if both ends are, their excesses are balanced. In the last 3 s it is U_s, which leaves least.

    The cost of a wait: an impulse needed late is dearer than the same correction early, as 1/x; what it
    saves is the correction of noise. The larger the share, the later a worst case is met, and the more impulses at
    their limit it takes.

    Limits: it knows misses only as bounded, so probable and merely possible hypotheses weigh the same. The share
    guarantees nothing by itself: what a set may still grow by (the disturbance) is in the interval, but what nature
    may still choose is not counted.

    References
    ----------
    Kumkov and Patsko (1997), section 6, for the interval and U_s. The rule of patience is not theirs.
    """

    name = "patient"

    def __init__(self, share: float = 0.5) -> None:
        if not 0.0 <= share <= 1.0:
            raise ValueError(f"share must lie from 0 to 1: got {share}")
        self.share = share

    def start(self, batch: int) -> None:
        """Start without a state."""

    def decide(self, situation: Situation, state: None) -> Floats:
        """Return the certain part of the correction, or what could no longer wait, m/s."""
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
    """Miss that impulses after this step can still correct, if the object is at a range now.

    Parameters
    ----------
    situation : Situation
    range_m : ndarray, shape (B,)

    Returns
    -------
    ndarray, shape (B,)
        m: the sum of mu2 x_j/e over the steps to come with x_j > 0, the earliest of them, as many as the budget pays.
    """
    thruster, e, step_s = situation.thruster, situation.closing_speed_m_s, situation.step_s
    to_go_s = range_m / e
    steps = np.ceil(to_go_s / step_s) - 1.0
    full = np.clip(np.floor(situation.budget_left_m_s / thruster.greatest_impulse_m_s), 0.0, np.maximum(steps, 0.0))
    return np.asarray(thruster.greatest_impulse_m_s * (full * to_go_s - step_s * 0.5 * full * (full + 1.0)))


def _impulse(miss_m: Floats, range_m: Floats, closing_speed_m_s: float) -> Floats:
    """Impulse that corrects a miss at a range; zero where there is no range."""
    return np.divide(miss_m * closing_speed_m_s, range_m, out=np.zeros_like(range_m), where=range_m > 0.0)
