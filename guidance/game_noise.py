"""Measurement noise of the auxiliary game: errors that keep the worst point inside the set."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from infoset.arrays import Flags, Floats
from infoset.engine.predicted_miss import PredictedMiss
from infoset.guidance.noise import LineOfSight, TieRule, draws_of_step, need_draws
from infoset.information_set import InformationSetView
from infoset.sensors import BearingSensor, Measurements, RangeSensor

TIE_TOLERANCE = 1e-6
"""Difference of the moduli of two equally bad extremes, as a share of the interval: more than the
rounding of an impulse of U_s, after which they are equal, and less than a measurement changes them.
"""


@dataclass(frozen=True)
class GameNoise:
    """Measurements that keep the point of maximum predicted miss, and much of the set, in the set.

    Parameters
    ----------
    tie : TieRule
        Which extreme is kept when both are equal in modulus, as they are at almost every step under
        U_s.
    tie_draws : ndarray, shape (C, B, steps)
        Uniform in [-1, 1], used by `TieRule.RANDOM`: the upper extreme where the draw is not
        negative.
    shift_m : ndarray, shape (C, steps), or None
        Shift of the measured position across x in each step with `TieRule.UPPER`, m, limited by the
        error bound; the last one holds for later steps. With `TieRule.LOWER` it has the other sign.
        These two rules then do not choose the angle by the set. None is no shift.
    target_side : ndarray, shape (C, B), or None
        Sign of the acceleration of each target, 1 or -1, if it is constant. With both rules the
        shift then has the opposite sign along each axis, which is worse: errors and target move the
        true state to the same side.

    Raises
    ------
    TypeError, ValueError
        If `tie` is not a `TieRule`, a draw is not within [-1, 1], or `tie_draws` has neither two
        nor three axes; in `measure`, if `TieRule.RANDOM` needs draws of another shape or step.

    Notes
    -----
    The errors that keep an extreme have one sign in most steps, so that the true state stays near
    the middle of a wide set. Before a cut-off, errors that change from one bound to the other are
    worse: the true state is then at an end of the set (`infoset.sim.closed_form.worst_shift_m`).

    Each axis has its own extremes and its own worse one; the measured angles are chosen for each
    axis. In space, the range has the rule of the plane, for the corner (worse extreme of y, worse
    extreme of z) of the rectangle of predicted misses of each section: the point to keep is in the
    section where this corner has the maximum modulus, the other extreme in the section where the
    opposite corner has it.

    References
    ----------
    Kumkov and Patsko (1997), section 7.
    """

    tie: TieRule
    tie_draws: Floats
    shift_m: Floats | None = None
    target_side: Floats | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.tie, TieRule):
            raise TypeError(f"tie must be a TieRule, for example TieRule.UPPER: got {self.tie!r}")
        need_draws("tie_draws", self.tie_draws)

    def measure(self, sight: LineOfSight, predicted: InformationSetView) -> Measurements:
        """Choose the measurements of a step; the true values where the set is empty."""
        # The angles first: one pass over the sections then computes the predicted misses too.
        angles = predicted.min_and_max_alpha()
        miss = predicted.predicted_miss(sight.pending)
        upper_is_worse = self._upper_is_worse(miss, sight.step)

        measured = {}
        for name, sensor in sight.sensors.items():
            if isinstance(sensor, BearingSensor):
                angle = _angle(sensor, sight, angles, miss, upper_is_worse)
                chosen = self._shifted(sensor, sight, angle)
            elif isinstance(sensor, RangeSensor):
                chosen = _range(sensor, sight, predicted, miss, upper_is_worse)
            else:
                upper = sensor.true_value(miss.upper_point)
                lower = sensor.true_value(miss.lower_point)
                chosen = sensor.nearest(sight, np.where(upper_is_worse, upper, lower))
            measured[name] = np.where(miss.exists, chosen, sensor.true_value(sight))
        return measured

    @property
    def truth_side(self) -> Floats:
        """Side of the set to which the shift moves the true state: 1 or -1, 0 for no shift.

        With `TieRule.UPPER` the measured position moves up, and with it the set: the true state is
        then on its lower side. A `target_side` replaces this side.
        The shape is () or (C, B).
        """
        if self.shift_m is None or self.tie not in (TieRule.UPPER, TieRule.LOWER):
            side = 0.0
        else:
            side = -1.0 if self.tie is TieRule.UPPER else 1.0
        if self.target_side is None:
            return np.array(side)
        return np.where(side == 0.0, 0.0, self.target_side)

    def _shifted(self, sensor: BearingSensor, sight: LineOfSight, chosen: Floats) -> Floats:
        """Return the shifted true angles of this step, and `chosen` where nothing is shifted.

        No angle is shifted beyond the error bound.
        """
        if self.shift_m is None:
            return chosen
        side = self.truth_side
        shift_m = self.shift_m[:, min(sight.step, self.shift_m.shape[1] - 1), None]
        true = sensor.true_value(sight)
        shifted = sensor.nearest(sight, true - side * shift_m / sight.range_m)
        return np.where(side == 0.0, chosen, shifted)

    def _upper_is_worse(self, miss: PredictedMiss, step: int) -> Flags:
        """Return where the upper extreme is kept, shape (C, B): the one of the greater modulus, or
        at a tie the one that the rule names.
        """
        upper = np.abs(miss.upper_m)
        lower = np.abs(miss.lower_m)
        is_tie = np.abs(upper - lower) <= TIE_TOLERANCE * (miss.upper_m - miss.lower_m)
        at_tie: Flags | bool
        if self.tie is TieRule.RANDOM:
            at_tie = draws_of_step("tie_draws", self.tie_draws, step, is_tie.shape) >= 0.0
        elif self.tie is TieRule.ALTERNATE:
            at_tie = step % 2 == 0  # the upper extreme first, in step 0
        else:
            at_tie = self.tie is TieRule.UPPER
        return np.where(is_tie, at_tie, upper > lower)


@dataclass(frozen=True)
class SwitchingNoise(GameNoise):
    """Game noise that keeps a prescribed extreme: the upper one if `tie_draws` is not negative."""

    def _upper_is_worse(self, miss: PredictedMiss, step: int) -> Flags:
        return draws_of_step("tie_draws", self.tie_draws, step, miss.upper_m.shape) >= 0.0


def _angle(
    sensor: BearingSensor,
    sight: LineOfSight,
    angles: tuple[Floats, Floats, Floats, Floats],
    miss: PredictedMiss,
    upper_is_worse: Flags,
) -> Floats:
    """Return the measured angles that keep the worse extreme, shape (C, B).

    `angles` are the minimum and the maximum angle of the set, and the ranges where it has them.
    Which of the two extremes has the larger angle does not follow from their misses.
    """
    upper = miss.upper_point
    lower = miss.lower_point
    upper_rad = sensor.expected(upper.alpha_rad, upper.range_m)
    lower_rad = sensor.expected(lower.alpha_rad, lower.range_m)
    worst = np.where(upper_is_worse, upper_rad, lower_rad)
    other = np.where(upper_is_worse, lower_rad, upper_rad)
    reach = sensor.error_bounds(np.where(upper_is_worse, upper.range_m, lower.range_m))
    minimum, maximum, range_of_min, range_of_max = angles
    minimum = sensor.expected(minimum, range_of_min)
    maximum = sensor.expected(maximum, range_of_max)
    true = sensor.true_value(sight)
    bound = sensor.bound(sight)
    return keep_point(
        (worst > other) | ((worst == other) & upper_is_worse),
        point_at_top=worst - reach,
        point_at_bottom=worst + reach,
        min_at_bottom=minimum + sensor.error_bounds(range_of_min),
        max_at_top=maximum - sensor.error_bounds(range_of_max),
        lower=true - bound,
        upper=true + bound,
    )


def _range(
    sensor: RangeSensor,
    sight: LineOfSight,
    predicted: InformationSetView,
    miss: PredictedMiss,
    upper_is_worse: Flags,
) -> Floats:
    """Return the measured ranges that keep the worse extreme, shape (B,).

    A measured range m agrees with the ranges from m / (1 + e) to m / (1 - e), with the relative
    error e: a range r is an end of this interval for m = r (1 + e) and m = r (1 - e).
    """
    upper = miss.upper_point.range_m
    lower = miss.lower_point.range_m
    error = sensor.relative_error
    if len(upper_is_worse) > 1:
        worst, other = _ranges_of_corners(predicted, upper_is_worse)
    else:  # in a plane there is one axis, and the corners of an interval are its ends
        worst = np.where(upper_is_worse, upper, lower)[0]
        other = np.where(upper_is_worse, lower, upper)[0]
    minimum, maximum = predicted.stored_range_interval_m()
    return keep_point(
        worst >= other,
        point_at_top=worst * (1.0 - error),
        point_at_bottom=worst * (1.0 + error),
        min_at_bottom=minimum * (1.0 + error),
        max_at_top=maximum * (1.0 - error),
        lower=sight.range_m * (1.0 - error),
        upper=sight.range_m * (1.0 + error),
    )


def _ranges_of_corners(
    predicted: InformationSetView, upper_is_worse: Flags
) -> tuple[Floats, Floats]:
    """Return the ranges of the sections of the worst corner and of the opposite one, m, each (B,).

    Corners on the other side of zero count as negative: with a miss of zero along one axis, the
    rule is then the rule of the plane.
    """
    lower, upper = predicted.predicted_miss_by_section_m()
    is_upper = upper_is_worse[..., None]
    side = np.where(is_upper, 1.0, -1.0)

    def signed_modulus(corner: Floats) -> Floats:
        return np.asarray(np.copysign(np.hypot(*corner), (side * corner).sum(axis=0)))

    worst = signed_modulus(np.where(is_upper, upper, lower))
    other = signed_modulus(np.where(is_upper, lower, upper))
    ranges = predicted.ranges_m
    feasible = predicted.feasible & (ranges != 0.0)
    # Where no section counts, the set is empty, and the result is not used (`measure`).
    rows = np.arange(len(ranges))
    worst_section = np.where(feasible, worst, -np.inf).argmax(axis=1)
    other_section = np.where(feasible, other, np.inf).argmin(axis=1)
    return ranges[rows, worst_section], ranges[rows, other_section]


def keep_point(
    is_larger: Flags,
    point_at_top: Floats,
    point_at_bottom: Floats,
    min_at_bottom: Floats,
    max_at_top: Floats,
    lower: Floats,
    upper: Floats,
) -> Floats:
    """Return the measured values in [lower, upper] that keep a point, and then most of the set.

    The point is lost where no value in [lower, upper] keeps it; the nearest end is returned there.
    A measured value agrees with an interval of values; "top" and "bottom" are the ends of that
    interval. All arrays have the shape (..., B).

    Parameters
    ----------
    is_larger : ndarray of bool
        Whether the point to keep is the larger of the two extremes in the measured quantity.
    point_at_top, point_at_bottom : ndarray
        Measured values whose interval ends at the point, above or below.
    min_at_bottom, max_at_top : ndarray
        Measured values whose interval begins at the minimum value of the set, or ends at its
        maximum.
    lower, upper : ndarray
        Measured values that the true value allows.

    References
    ----------
    Kumkov and Patsko (1997), section 7: the rule for ranges, and 'the same way' for angles.
    """
    # For the larger point: the interval reaches up to it, and further up only while nothing of the
    # set is lost below.
    for_larger = np.clip(np.maximum(point_at_top, min_at_bottom), lower, upper)
    for_smaller = np.clip(np.minimum(point_at_bottom, max_at_top), lower, upper)
    return np.where(is_larger, for_larger, for_smaller)
