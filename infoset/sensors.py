"""Bounded sensor errors: nothing is known of their distribution."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from infoset.limits import Fraction, Positive, check_fields

RangeOrRanges = TypeVar("RangeOrRanges", float, NDArray[np.float64])


@dataclass(frozen=True)
class AngleSensor:
    """A line-of-sight angle sensor whose error bound is a straight line in the range.

    Parameters
    ----------
    period_s : float
        Time between measurements, s; the first is at t = 0.
    error_at_nominal_range_rad, error_at_zero_range_rad : float
        Bound a + h(d) at `nominal_range_m` and at zero range, rad, in (0, 1). The same line continues beyond.
    nominal_range_m : float
        Range at which the first of the two holds, m.

    Raises
    ------
    TypeError, ValueError
        If a value is not a number within its limits.

    References
    ----------
    Kumkov and Patsko (1997), equations (4) and (10).
    """

    period_s: Positive
    error_at_nominal_range_rad: Fraction
    error_at_zero_range_rad: Fraction
    nominal_range_m: Positive

    def __post_init__(self) -> None:
        check_fields(self)

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

    Raises
    ------
    TypeError, ValueError
        If a value is not a number within its limits.

    References
    ----------
    Kumkov and Patsko (1997), equations (5) and (11).
    """

    period_s: Positive
    relative_error: Fraction

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True)
class RateSensor:
    """A sensor of the line of sight's angular rate with a bounded error.

    Parameters
    ----------
    period_s : float
        Time between measurements, s; the first is at t = 0.
    error_rad_s : float
        Greatest |omega_m - omega|, rad/s.

    Raises
    ------
    TypeError, ValueError
        If a value is not a number within its limits.

    References
    ----------
    Kumkov and Patsko (2001).
    """

    period_s: Positive
    error_rad_s: Positive

    def __post_init__(self) -> None:
        check_fields(self)
