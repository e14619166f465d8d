"""Predicted-miss interval of an information set."""

from __future__ import annotations

from dataclasses import dataclass

from infoset.arrays import Flags, Floats
from infoset.sensors.sensor import along_x_m


@dataclass(frozen=True)
class ExtremePoints:
    """States that reach an end of the predicted-miss interval, one for each engagement and lateral
    axis.

    Parameters
    ----------
    alpha_rad, omega_rad_s, range_m : ndarray, shape (C, B)
        Line-of-sight angle, its rate, and range: rad, rad/s, m.
    """

    alpha_rad: Floats
    omega_rad_s: Floats
    range_m: Floats

    @property
    def along_x_m(self) -> Floats:
        """Parts of the ranges along x, m, shape (C, B)."""
        return along_x_m(self.alpha_rad, self.range_m)


@dataclass(frozen=True)
class PredictedMiss:
    """Interval of the misses that are possible without control, for all disturbances within the
    bound.

    Parameters
    ----------
    exists : ndarray of bool, shape (B,)
        Whether the set has a feasible section; the other fields are zero where it has none.
    lower_m, upper_m : ndarray, shape (C, B)
        Ends pi_* and pi^* of the interval along each lateral axis, signed, m, of the aim point.
    lower_point, upper_point : ExtremePoints
        States of the centre that reach the ends.

    References
    ----------
    Kumkov and Patsko (1997), equations (13) and (14), with the sign of omega kept.
    """

    exists: Flags
    lower_m: Floats
    upper_m: Floats
    lower_point: ExtremePoints
    upper_point: ExtremePoints
