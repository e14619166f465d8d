"""Sensors of the range and of the rate of the line of sight, with bounded errors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from infoset.arrays import Flags, Floats
from infoset.limits import WRONG, Checked, Fraction, Positive
from infoset.sensors.bearing import BearingSensor
from infoset.sensors.sensor import Apart, Cuttable, Geometry, Measurements, Sensor


@dataclass(frozen=True)
class RangeSensor(Checked, Sensor):
    """A range sensor with a bounded relative error.

    Parameters
    ----------
    period_s : float
        Time between measurements, s; the first is at t = 0.
    relative_error : float
        Maximum |d_m - d| / d, in (0, 1).
    wrong_measurements : int
        Maximum number of measured ranges of a flight whose errors may be arbitrary. Only in the
        guaranteed model.

    References
    ----------
    Kumkov and Patsko (1997), equations (5) and (11).
    """

    name: ClassVar[str] = "range"
    table: ClassVar[str] = "range_sensor"
    quantity: ClassVar[str] = "range_m"
    stream: ClassVar[int] = 2
    is_lateral: ClassVar[bool] = False

    period_s: Positive
    relative_error: Fraction
    wrong_measurements: Annotated[int, WRONG] = 0

    def true_value(self, sight: Geometry) -> Floats:
        """Return the range, m."""
        return sight.range_m

    def bound(self, sight: Geometry) -> Floats:
        """Return the error bound, m."""
        return self.relative_error * sight.range_m

    def cut(self, sets: Cuttable, measured: Measurements, where: Flags) -> None:
        """Cut by the range; an angle measured in the same step sharpens the cut."""
        sets.measure_range(
            measured[self.name],
            self.relative_error,
            where,
            alpha_rad=measured.get(BearingSensor.name),
            wrong_measurements=self.wrong_measurements,
        )

    def band(self, range_m: Floats, closing_speed_m_s: Floats | float, errors: float = 1.0) -> None:
        """Return None: a range selects labels.

        To first order the distance does not depend on z and V.
        """

    def share(self, apart: Apart) -> Floats:
        """Return half of the maximum difference of the distances, in units of the bound, (n,)."""
        # A distance changes by at most the slope times the change across x, and the change of x.
        difference_m = apart.slope * np.hypot.reduce(apart.offset_m) + apart.shift_m
        return np.asarray(difference_m / (2.0 * self.relative_error * apart.range_m))

    def measured(self, sight: Geometry, error: Floats | float) -> Floats:
        """Return d (1 + error b), m."""
        return sight.range_m * (1.0 + self.relative_error * error)

    def error(self, sight: Geometry, measured: Floats) -> Floats:
        """Return (d_m / d - 1) / b of measured ranges d_m, m."""
        return (measured / sight.range_m - 1.0) / self.relative_error


@dataclass(frozen=True)
class RateSensor(Checked, Sensor):
    """A sensor of the line of sight's angular rate with a bounded error.

    Parameters
    ----------
    period_s : float
        Time between measurements, s; the first is at t = 0.
    error_rad_s : float
        Maximum |omega_m - omega|, rad/s.

    References
    ----------
    Kumkov and Patsko (2001).
    """

    name: ClassVar[str] = "rate"
    table: ClassVar[str] = "rate_sensor"
    quantity: ClassVar[str] = "rate_rad_s"
    stream: ClassVar[int] = 4

    period_s: Positive
    error_rad_s: Positive

    def true_value(self, sight: Geometry) -> Floats:
        """Return the rate of the line of sight, rad/s."""
        return sight.omega_rad_s

    def bound(self, sight: Geometry) -> float:
        """Return the error bound, rad/s."""
        return self.error_rad_s

    def cut(self, sets: Cuttable, measured: Measurements, where: Flags) -> None:
        """Cut by the rate."""
        sets.measure_rate(measured[self.name], self.error_rad_s, where)

    def band(
        self, range_m: Floats, closing_speed_m_s: Floats | float, errors: float = 1.0
    ) -> tuple[bool, Floats]:
        """Return a band of the predicted miss, omega x^2/e."""
        return True, errors * self.error_rad_s * range_m * range_m / closing_speed_m_s

    def share(self, apart: Apart) -> Floats:
        """Return half of the maximum difference of the rates, in units of the bound, shape (n,).

        The rate is the derivative of z/x times cos^2(alpha), which depends on z. This is the term
        with 4 q^2 in Lemma 20 of docs/guarantee-bound.md, where q is `slope`.
        """
        change_m = np.abs(apart.predicted_miss_m) + 4.0 * apart.slope**2 * np.abs(apart.offset_m)
        # Half of the change over the half-width for one bound: the half-width for two bounds.
        return np.asarray(
            change_m.max(axis=0) / self.band(apart.range_m, apart.closing_speed_m_s, 2.0)[1]
        )
