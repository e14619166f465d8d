"""The predicted-miss interval of a set."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from infoset.pictures import predicted_miss_svg

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class ExtremePoints:
    """Points of the sets at which an extreme of the predicted miss is reached, one an engagement.

    Parameters
    ----------
    alpha_rad, omega_rad_s, range_m : ndarray, shape (B,)
        Line-of-sight angle, its rate, and range.
    """

    alpha_rad: Floats
    omega_rad_s: Floats
    range_m: Floats


@dataclass(frozen=True)
class PredictedMiss:
    """The interval of misses still possible without control, disturbance included.

    Parameters
    ----------
    exists : ndarray of bool, shape (B,)
        False where the set has no section; the other fields are zero there.
    lower_m, upper_m : ndarray, shape (B,)
        pi_* and pi^*, signed, m.
    lower_point, upper_point : ExtremePoints
        Where they are reached.

    References
    ----------
    Kumkov and Patsko (1997), equations (13) and (14), with the sign of omega kept.
    """

    exists: NDArray[np.bool_]
    lower_m: Floats
    upper_m: Floats
    lower_point: ExtremePoints
    upper_point: ExtremePoints

    def _repr_svg_(self) -> str:
        return predicted_miss_svg(self.exists, self.lower_m, self.upper_m)
