"""A strategy that corrects what is certain, and what could not be corrected later."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from infoset.arrays import Floats
from infoset.guidance.authority import correctable_later_m
from infoset.guidance.situation import Situation
from infoset.guidance.symmetric_impulse import range_at_impulse, symmetric_impulse
from infoset.limits import Checked, Limits

LAST_SECONDS_S = 3.0
"""Time before the arrival or the last impulse in which the strategy acts as U_s
(`symmetric_impulse`). Chosen for the scenario of 1997, where it is six steps: from 0.75
to 12 s the 95 % quantile of the miss differs by 2 mm, and the impulses are 80 to 77 m/s (measured).
"""


@dataclass(frozen=True)
class Patient(Checked):
    """Correct only certain misses, and misses that could not be corrected later; at last as U_s.

    Parameters
    ----------
    share : float
        Share of the correction that later impulses can give, from 0 to 1, on which the strategy
        relies. With 0 it is U_s; with 1 it waits as long as it can.

    Notes
    -----
    Every hypothesis of the set has a predicted miss. If the whole interval of misses is on one side
    of zero, every hypothesis needs the correction of its near end: it is certain, and costs least
    when it is early. Only the worst hypothesis needs the correction of the far end. Later
    measurements usually refute it, so the strategy waits as long as a share of the correction that
    later impulses can give covers it: the sum of mu2 x_j/e over the remaining steps, limited by the
    budget. The excess over that is corrected now; if both ends have an excess, the two are
    balanced.

    It acts as U_s in the last 3 s before the arrival, and in the last 3 s in which the engine can
    give impulses.

    Waiting saves the correction of noise, but the same correction costs more later, in proportion
    to 1/x. The larger the share, the later a worst case is corrected, with more impulses at their
    limit.

    Limits: misses are bounded only, so probable and merely possible hypotheses have the same
    weight. The share alone guarantees nothing: the interval includes future disturbances, but not
    future choices of the noise.

    References
    ----------
    Kumkov and Patsko (1997), section 6, for the interval and U_s. The rule of waiting is not
    theirs.
    """

    # Chosen: the middle of the values from 0.2 to 0.9, which give nearly the same misses and
    # impulses (docs/measured/strategies.md).
    share: Annotated[float, Limits(minimum=0.0, maximum=1.0)] = 0.5

    name: ClassVar[str] = "patient"

    def start(self, shape: tuple[int, int]) -> None:
        """Start without a state."""

    def decide(self, situation: Situation, state: None) -> Floats:
        """Return k_s in the last seconds, before them what cannot wait, m/s, shape (C, B).

        What cannot wait is the greater of two corrections: the certain one, which every hypothesis
        needs, and the urgent one, the excess over a share of what later impulses can correct. The
        last seconds count from the impulse to the arrival of the nearer end, at the nominal closing
        speed.
        """
        miss = situation.predicted_miss
        e = situation.closing_speed_m_s
        lead_s = situation.lead_s
        symmetric = symmetric_impulse(miss, e, lead_s)
        if situation.last_s <= lead_s + LAST_SECONDS_S:
            return symmetric

        # Lower end first. Each end less what later impulses can correct of it is its excess, which
        # is positive above and negative below.
        ends_m = np.stack([miss.lower_point.range_m, miss.upper_point.range_m], axis=-1)
        later_m = correctable_later_m(situation, ends_m)
        above = np.maximum(miss.upper_m - self.share * later_m[..., 1], 0.0)
        below = np.minimum(miss.lower_m + self.share * later_m[..., 0], 0.0)
        upper_range = range_at_impulse(miss.upper_point.range_m, e, lead_s)
        lower_range = range_at_impulse(miss.lower_point.range_m, e, lead_s)

        # At most one of the two ends is certain.
        certain_above = _impulse(np.maximum(miss.lower_m, 0.0), lower_range, e)
        certain_below = _impulse(np.minimum(miss.upper_m, 0.0), upper_range, e)
        certain = certain_above + certain_below
        both = (above > 0.0) & (below < 0.0)
        alone = _impulse(above, upper_range, e) + _impulse(below, lower_range, e)
        # The formula of U_s, with the excesses in place of the ends: both then have the same size.
        balanced = _impulse(above + below, upper_range + lower_range, e)
        urgent = np.where(both, balanced, alone)

        wanted = np.where(np.abs(urgent) > np.abs(certain), urgent, certain)
        last = np.minimum(upper_range, lower_range) <= LAST_SECONDS_S * e
        return np.where(last, symmetric, wanted)


def _impulse(miss_m: Floats, range_m: Floats, closing_speed_m_s: float) -> Floats:
    """Return the impulse that corrects a miss at a range; zero where the range is not positive."""
    return np.divide(
        miss_m * closing_speed_m_s, range_m, out=np.zeros_like(range_m), where=range_m > 0.0
    )
