"""Bounded sensor errors: nothing is known of their distribution."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

RangeOrRanges = TypeVar("RangeOrRanges", float, NDArray[np.float64])


@dataclass(frozen=True)
class AngleSensor:
    """A line-of-sight angle sensor whose error bound is a straight line in the range.

    Parameters
    ----------
    period_s : float
        Time between measurements, s; the first is at t = 0.
    error_at_nominal_range_rad, error_at_zero_range_rad : float
        Bound a + h(d) at `nominal_range_m` and at zero range, rad. The same line continues beyond.
    nominal_range_m : float
        Range at which the first of the two holds, m.

    References
    ----------
    Kumkov and Patsko (1997), equations (4) and (10).
    """

    period_s: float
    error_at_nominal_range_rad: float
    error_at_zero_range_rad: float
    nominal_range_m: float

    @property
    def error_slope_rad_per_m(self) -> float:
        """Change of the bound with range, rad/m."""
        return (self.error_at_nominal_range_rad - self.error_at_zero_range_rad) / self.nominal_range_m

    def error_bound(self, range_m: RangeOrRanges) -> RangeOrRanges:
        """Greatest modulus of the error at a range (m), rad."""
        return self.error_at_zero_range_rad + self.error_slope_rad_per_m * range_m


@dataclass(frozen=True)
class RangeSensor:
    """A range meter with a bounded relative error.

    Parameters
    ----------
    period_s : float
        Time between measurements, s; the first is at t = 0.
    relative_error : float
        Greatest |d_m - d| / d, in (0, 1).

    References
    ----------
    Kumkov and Patsko (1997), equations (5) and (11).
    """

    period_s: float
    relative_error: float


@dataclass(frozen=True)
class RateSensor:
    """A sensor of the line of sight's angular rate with a bounded error.

    Parameters
    ----------
    period_s : float
        Time between measurements, s; the first is at t = 0.
    error_rad_s : float
        Greatest |omega_m - omega|, rad/s.

    References
    ----------
    Kumkov and Patsko (2001).
    """

    period_s: float
    error_rad_s: float
