"""Estimates of the motion along the lateral axes, as guidance uses them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from infoset.arrays import Floats


@dataclass(frozen=True)
class MissEstimate:
    """Zero-effort miss of a batch of engagements: the miss without further impulses.

    Parameters
    ----------
    miss_m, deviation_m : ndarray, shape (C, B)
        Signed miss and its standard deviation, m. Pending impulses count as given.
    to_go_s : ndarray, shape (C, B)
        Time from the impulse that is decided now to the closest approach, s; not negative.

    Notes
    -----
    The rate of the line of sight at the impulse is miss / (c tau^2), with the closing speed c and
    the time to go tau.
    """

    miss_m: Floats
    deviation_m: Floats
    to_go_s: Floats

    def correction_m_s(self, dead_zone_m: Floats | float = 0.0) -> Floats:
        """Return the impulse that corrects the part of the miss outside a dead zone, m/s.

        `dead_zone_m` is the half-width of the zone, a number or shape (C, B). The impulse is zero
        at the closest approach.
        """
        outside_m = self.miss_m - np.clip(self.miss_m, -dead_zone_m, dead_zone_m)
        return np.divide(
            outside_m, self.to_go_s, out=np.zeros_like(outside_m), where=self.to_go_s > 0.0
        )
