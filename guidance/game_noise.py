"""Measurement noise of the auxiliary game: nature tries to keep the worst point inside the set."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from guidance.noise import LineOfSight, Measurement, TieRule, need_draws
from infoset import InformationSetView, PredictedMiss

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

TIE_TOLERANCE = 1e-6


@dataclass(frozen=True)
class GameNoise:
    """Measurements that keep the point of greatest predicted miss, and beyond that as much of the set as they can.

    Parameters
    ----------
    tie : TieRule
        Which extreme counts as the worse when both are equal in modulus, as after U_s they are at almost every step.
    tie_draws : ndarray, shape (B, steps)
        Uniform in [-1, 1], used by `TieRule.RANDOM`: the upper extreme where the draw is not negative.

    Raises
    ------
    TypeError, ValueError
        If the rule is none, a draw is not within [-1, 1], or the array not of shape (B, steps).

    References
    ----------
    Kumkov and Patsko (1997), section 7.
    """

    tie: TieRule
    tie_draws: Floats

    def __post_init__(self) -> None:
        if not isinstance(self.tie, TieRule):
            raise TypeError(f"tie must be a TieRule, for example TieRule.UPPER: got {self.tie!r}")
        need_draws("tie_draws", self.tie_draws)

    def measure(self, sight: LineOfSight, predicted: InformationSetView) -> Measurement:
        """Choose the measurements of a step; the truth itself where no set is left to play against."""
        miss = predicted.predicted_miss()
        upper_is_worse = self._upper_is_worse(miss, sight.step)
        alpha = self._angle(sight, predicted, miss, upper_is_worse)
        distance = omega = None
        if sight.range_error is not None:
            distance = self._range(sight, predicted, miss, upper_is_worse, sight.range_error)
        if sight.rate_error_rad_s is not None and sight.omega_rad_s is not None:
            worst = np.where(upper_is_worse, miss.upper_point.omega_rad_s, miss.lower_point.omega_rad_s)
            bound = sight.rate_error_rad_s
            nearest = np.clip(worst, sight.omega_rad_s - bound, sight.omega_rad_s + bound)
            omega = np.where(miss.exists, nearest, sight.omega_rad_s)
        return Measurement(alpha, distance, omega)

    def _upper_is_worse(self, miss: PredictedMiss, step: int) -> Flags:
        upper, lower = np.abs(miss.upper_m), np.abs(miss.lower_m)
        tie = np.abs(upper - lower) <= TIE_TOLERANCE * (miss.upper_m - miss.lower_m)
        if self.tie is TieRule.RANDOM:
            chosen: Flags | bool = self.tie_draws[:, step] >= 0.0
        else:
            chosen = self.tie is TieRule.UPPER or (self.tie is TieRule.ALTERNATE and step % 2 == 0)
        return np.where(tie, chosen, upper > lower)

    def _angle(
        self, sight: LineOfSight, predicted: InformationSetView, miss: PredictedMiss, upper_is_worse: Flags
    ) -> Floats:
        upper, lower = miss.upper_point, miss.lower_point
        worst = np.where(upper_is_worse, upper.alpha_rad, lower.alpha_rad)
        other = np.where(upper_is_worse, lower.alpha_rad, upper.alpha_rad)
        is_larger = (worst > other) | ((worst == other) & upper_is_worse)
        error_bound = sight.angle_sensor.error_bound
        reach = error_bound(np.where(upper_is_worse, upper.range_m, lower.range_m))
        least, greatest, range_of_least, range_of_greatest = predicted.least_and_greatest_alpha()
        bound = error_bound(sight.range_m)
        chosen = keep_point(
            is_larger,
            point_at_top=worst - reach,
            point_at_bottom=worst + reach,
            least_at_bottom=least + error_bound(range_of_least),
            greatest_at_top=greatest - error_bound(range_of_greatest),
            lower=sight.alpha_rad - bound,
            upper=sight.alpha_rad + bound,
        )
        return np.where(miss.exists, chosen, sight.alpha_rad)

    def _range(
        self,
        sight: LineOfSight,
        predicted: InformationSetView,
        miss: PredictedMiss,
        upper_is_worse: Flags,
        error: float,
    ) -> Floats:
        upper, lower = miss.upper_point.range_m, miss.lower_point.range_m
        worst = np.where(upper_is_worse, upper, lower)
        other = np.where(upper_is_worse, lower, upper)
        least, greatest = predicted.stored_range_interval_m()
        chosen = keep_point(
            worst >= other,
            point_at_top=worst * (1.0 - error),
            point_at_bottom=worst * (1.0 + error),
            least_at_bottom=least * (1.0 + error),
            greatest_at_top=greatest * (1.0 - error),
            lower=sight.range_m * (1.0 - error),
            upper=sight.range_m * (1.0 + error),
        )
        return np.where(miss.exists, chosen, sight.range_m)


def keep_point(
    is_larger: Flags,
    point_at_top: Floats,
    point_at_bottom: Floats,
    least_at_bottom: Floats,
    greatest_at_top: Floats,
    lower: Floats,
    upper: Floats,
) -> Floats:
    """Measured value that keeps a point on the border of what agrees with it, and else as much of the set as it can.

    Parameters
    ----------
    is_larger : ndarray of bool, shape (B,)
        Whether the point to keep is the larger of the two extremes in the measured quantity.
    point_at_top, point_at_bottom : ndarray, shape (B,)
        Values that put the top, or the bottom, of what agrees with them at the point.
    least_at_bottom, greatest_at_top : ndarray, shape (B,)
        Values that put the bottom at the set's least, or the top at its greatest, value.
    lower, upper : ndarray, shape (B,)
        Values that the truth allows.

    Returns
    -------
    ndarray, shape (B,)
        Chosen values, within [lower, upper].

    References
    ----------
    Kumkov and Patsko (1997), section 7: the rule for ranges, and 'the same way' the one for angles.
    """
    nearest = np.minimum(np.maximum(point_at_top, lower), upper)
    wider = np.minimum(least_at_bottom, upper)
    for_larger = np.where((nearest >= least_at_bottom) | (nearest == upper), nearest, wider)
    nearest = np.minimum(np.maximum(point_at_bottom, lower), upper)
    wider = np.maximum(greatest_at_top, lower)
    for_smaller = np.where((nearest <= greatest_at_top) | (nearest == lower), nearest, wider)
    return np.where(is_larger, for_larger, for_smaller)
