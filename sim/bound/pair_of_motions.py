"""True motions of a lower bound for one range and speed: two with the same measurements, or one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from infoset.arrays import Floats, Integers
from infoset.sensors import Apart, BearingSensor, Sensor
from infoset.sim.bound.coasting import NoArrivalError, coasting
from infoset.sim.bound.difference_sets import MARGIN, POSITION, PREDICTED_MISS, AxisDifferences
from infoset.sim.bound.gravity_reserve import GravityReserve, gravity_reserve
from infoset.sim.scenario import Scenario

UNLIMITED = attrgetter("unlimited_bound_m")
"""Key by which pairs are compared: it orders also pairs whose bound is zero."""


@dataclass(frozen=True)
class TruthPair:
    """Two true motions, far apart, with the same measurements up to a step; or one far motion.

    Parameters
    ----------
    label_m : float
        Their common range x at t = 0, m.
    vx_m_s : float
        Their common velocity along x at t = 0, m/s; negative.
    is_single : bool
        Whether the two are one motion, which all impulses of the flight do not bring to the target.
    last_common_step : int
        Last step whose measurements, and therefore impulses, can be the same; -1 if there is none.
    times_s : ndarray, shape (n,)
        Times of all steps and of the arrival at x = 0 without impulses, s.
    track_m : ndarray, shape (axes, n)
        Position of the first motion relative to the middle of the two then, across x, with the same
        impulses, m; of a single motion relative to the x axis and without impulses.
    correction_m : float
        Maximum change of one position across x at x = 0 by the impulses after `last_common_step`,
        for a single motion by all impulses, m.
    reserve_m : float
        Reserve for the second order of gravity, m; infinite if gravity is too strong for the proof.
    cosine : float
        Minimum ratio of the miss to the distance across x at x = 0, with any impulses.
    position_m, velocity_m_s : ndarray, shape (2, 2) or (2, 3)
        (z, x) and (V_z, V_x) of the two motions at t = 0; (y, z, x) and (V_y, V_z, V_x) in space.
    acceleration_m_s2 : ndarray, shape (axes, 2, steps)
        Accelerations along each lateral axis, z in a plane, y and z in space, of each of the two
        motions over each step; x = 0 is in the last step.
    wrong_steps : tuple of two ndarray of int
        Steps of the wrong images of each motion, at most q, ascending: the later half of the last
        2q images for the first motion, the earlier half for the second. They do not limit the
        difference of the two (Theorem 5b of docs/guarantee-bound.md). Empty for a single motion.
    """

    label_m: float
    vx_m_s: float
    is_single: bool
    last_common_step: int
    times_s: Floats
    track_m: Floats
    correction_m: float
    reserve_m: float
    cosine: float
    position_m: Floats
    velocity_m_s: Floats
    acceleration_m_s2: Floats
    wrong_steps: tuple[Integers, Integers]

    @property
    def bound_m(self) -> float:
        """Distance, m: with any strategy at least one of the two has no smaller miss."""
        return max(0.0, self.unlimited_bound_m)

    @property
    def unlimited_bound_m(self) -> float:
        """The bound without its limit at zero, m."""
        distance_m = float(np.hypot.reduce(self.track_m[:, -1]))
        return (distance_m - self.correction_m - self.reserve_m) * self.cosine

    @property
    def apart_m(self) -> float:
        """Distance of the two across x at the arrival, with the same impulses, m."""
        return float(np.hypot.reduce(self.difference_m[:, -1]))

    @property
    def arrival_s(self) -> float:
        """Time when x = 0 without impulses, s."""
        return float(self.times_s[-1])

    @property
    def difference_m(self) -> Floats:
        """First minus second motion across x at `times_s`, shape (axes, n), m."""
        return np.zeros_like(self.track_m) if self.is_single else 2.0 * self.track_m


class _Start(NamedTuple):
    """Start and accelerations of a motion relative to the middle of the box of starts.

    Parameters
    ----------
    offset_m, velocity_m_s : ndarray, shape (C - 1,)
        Lateral position and velocity at t = 0.
    acceleration_m_s2 : ndarray, shape (C - 1, steps)
        Acceleration along the lateral axes over each step.
    """

    offset_m: Floats
    velocity_m_s: Floats
    acceleration_m_s2: Floats

    def times(self, factor: float) -> _Start:
        """Return the multiple of a start and its accelerations."""
        return _Start(
            factor * self.offset_m, factor * self.velocity_m_s, factor * self.acceleration_m_s2
        )


class _Losses(NamedTuple):
    """Reductions of the distance at x = 0: `correction_m` and `reserve_m` of `TruthPair`.

    `slope` is the maximum ratio of the velocities across and along x.
    """

    correction_m: float
    reserve_m: float
    slope: float


_NO_PROOF = _Losses(0.0, math.inf, 0.0)


class _Correction(NamedTuple):
    """Maximum change of the miss by later impulses, m: on straight lines, and more by gravity."""

    straight_m: float
    by_gravity_m: float


class _Shares(NamedTuple):
    """Differences of the measurements of a pair, in units of the differences with equal values.

    Parameters
    ----------
    largest : float
        Maximum of all measurements.
    excess : ndarray, shape (steps, 2)
        Excess over the first order, by the slope of the line of sight and by impulses in gravity,
        for the columns of `AxisDifferences.limits_m`.
    """

    largest: float
    excess: Floats


class _Sighting(NamedTuple):
    """Bounds of the approach at the steps of a sensor, shape (n,), with the symbols of Lemma 20.

    Parameters
    ----------
    due : ndarray of int
        The steps.
    range_m, closing_m_s : ndarray
        x_0 and c_0 of the motion without impulses.
    shift_m, moved_m : ndarray
        Maximum difference delta_x of the ranges of the two, and maximum change xi of the range.
    nearest_m, farthest_m : ndarray
        Minimum and maximum range x.
    fastest_m_s : ndarray
        Maximum closing speed.
    slope : ndarray
        Slope q of the line of sight up to which measurements must be the same.
    """

    due: Integers
    range_m: Floats
    closing_m_s: Floats
    shift_m: Floats
    moved_m: Floats
    nearest_m: Floats
    farthest_m: Floats
    fastest_m_s: Floats
    slope: Floats

    @property
    def to_go_s(self) -> Floats:
        """Time to x = 0 without impulses, s."""
        return self.range_m / self.closing_m_s


class PairApproach:
    """Data of one label and velocity that all its motions use.

    `motion` starts in the middle of the box and has no impulses. If gravity keeps it from x = 0,
    `arrives` is false, `motion` is a straight line, and the bounds are zero.
    """

    def __init__(self, scenario: Scenario, label_m: float, vx_m_s: float) -> None:
        model = scenario.set_model
        self.scenario = scenario
        self.label_m = label_m
        self.vx_m_s = vx_m_s
        self._models = [model.axis(name) for name in model.axes]
        self.lateral = len(self._models)
        self._wrong_in_both = 2 * model.wrong_images

        # Rows: position and velocity; columns: lateral axes; the last axis has both ends.
        ends = np.stack(
            [
                [planar.bounds.z_m for planar in self._models],
                [planar.bounds.vz_m_s for planar in self._models],
            ]
        )
        self._middle = ends.mean(axis=-1)
        self._widths = np.ptp(ends, axis=-1)

        position_m = np.append(self._middle[0], label_m)
        velocity_m_s = np.append(self._middle[1], vx_m_s)
        self.arrives = True
        try:
            self.motion = coasting(position_m, velocity_m_s, scenario.sun, model.step_s)
        except NoArrivalError:
            self.motion = coasting(position_m, velocity_m_s, None, model.step_s)
            self.arrives = False
        self.steps = len(self.motion.range_m)

        self._due = {
            name: self._measured_steps(sensor) for name, sensor in scenario.sensors.items()
        }
        self._differences = [
            AxisDifferences(
                planar,
                {**scenario.sensors, BearingSensor.name: planar.angle_sensor},
                self._due,
                self.motion,
                i,
            )
            for i, planar in enumerate(self._models)
        ]

    def _measured_steps(self, sensor: Sensor) -> Integers:
        """Return the steps in which a sensor measures."""
        every = self.scenario.set_model.steps_in(sensor.period_s)
        steps = np.arange(0, self.steps, every)
        before_s = (self.scenario.nominal_arrival_s - self.motion.times_s[steps]).tolist()
        return steps[[sensor.measures_at(each_s) for each_s in before_s]]

    def _equal_steps(self, name: str, last_common_step: int) -> Integers:
        """Return the steps until a common one in which a sensor must measure equal values.

        The last 2q images may be wrong in one of the two motions. With equally spaced images of a
        camera no other 2q images give a greater bound (docs/guarantee-bound.md).
        """
        due = self._due[name]
        equal = due[due <= last_common_step]
        if name != BearingSensor.name:
            return equal
        return equal[: max(0, len(equal) - self._wrong_in_both)]

    def _wrong_steps(self, last_common_step: int) -> Integers:
        """Return the steps of the images until a common one that are wrong in one motion."""
        images = self._due[BearingSensor.name]
        equal = self._equal_steps(BearingSensor.name, last_common_step)
        return images[len(equal) : np.searchsorted(images, last_common_step, side="right")]

    def _limiting_steps(self) -> Integers:
        """Return in how many first steps the images limit the difference, shape (steps + 1,).

        The measurements are equal in the first 0, 1, ..., all steps, up to the wrong images.
        """
        common_steps = np.arange(self.steps + 1)
        images = self._due[BearingSensor.name]
        equal = np.searchsorted(images, common_steps) - self._wrong_in_both
        first_wrong = np.append(images, self.steps)[np.maximum(equal, 0)]
        return np.asarray(np.minimum(common_steps, first_wrong))

    def best_pair(self) -> TruthPair:
        """Return the best pair over the last common step.

        To first order a pair is not better than half of the farthest difference less the correction
        by later impulses. The pairs are computed in descending order of this number, until it is
        not greater than the best pair. If the motion does not arrive, one is computed.
        """
        correction_m = self._corrections_m()
        limiting = self._limiting_steps()
        half_m = 0.5 * np.hypot.reduce(
            [differences.farthest_m()[limiting] for differences in self._differences]
        )
        # Between two decisions, more common measurements only bring the motions nearer to each
        # other.
        _, common_steps = np.unique(-correction_m, return_index=True)
        estimates_m = (half_m - correction_m)[common_steps]

        best: TruthPair | None = None
        for index in np.argsort(-estimates_m, kind="stable").tolist():
            if best is not None and (estimates_m[index] <= best.bound_m or not self.arrives):
                break
            # The last of this number of common steps, which are counted from 0.
            pair = self.pair(int(common_steps[index]) - 1)
            best = pair if best is None else max(best, pair, key=UNLIMITED)
        assert best is not None
        return best

    def _corrections_m(self) -> Floats:
        """Return the corrections by impulses decided after the first 0, 1, ..., all steps, m.

        The motions are straight lines.
        """
        scenario = self.scenario
        given_s, sizes = later_impulses(scenario, -1, self.motion.arrival_s)
        sizes = sizes[sizes > 0.0]
        if not len(sizes):
            return np.zeros(self.steps + 1)

        # The engine gives the same sizes from any first impulse on, the largest first.
        arms_s = np.concatenate([self.motion.arrival_s - given_s, np.zeros(len(sizes))])
        from_each = np.correlate(arms_s, sizes)
        given = np.round(given_s / scenario.set_model.step_s)
        decided = given - scenario.engine.delay_steps
        return from_each[np.searchsorted(decided, np.arange(self.steps + 1))]

    def _correction(
        self, last_common_step: int, late_s: float, reserve: GravityReserve
    ) -> _Correction:
        """Return the correction by impulses that are decided after a step, within the budget.

        The arrival is at most `late_s` later than without impulses.
        """
        latest_s = self.motion.arrival_s + late_s
        given_s, sizes = later_impulses(self.scenario, last_common_step, latest_s)
        arms_s = latest_s - given_s
        return _Correction(
            straight_m=float(sizes @ arms_s),
            by_gravity_m=reserve.stretch_per_s2 * float(sizes @ arms_s**3),
        )

    def pair(self, last_common_step: int) -> TruthPair:
        """Return the pair with the maximum distance at the end and equal measurements to a step.

        The farthest difference is found to first order. Its measurements differ by more at some
        steps, and all of it is reduced until none does. A second one has narrower limits at these
        steps instead, and is reduced by less.
        """
        limits_m = [differences.limits_m.copy() for differences in self._differences]
        for limits in limits_m:
            limits[self._wrong_steps(last_common_step), POSITION] = np.inf
        pair, excess = self._admissible_pair(last_common_step, limits_m)
        if not excess.any():
            return pair
        narrower, _ = self._admissible_pair(
            last_common_step, [(1.0 - excess) * limits for limits in limits_m]
        )
        return max(pair, narrower, key=UNLIMITED)

    def _admissible_pair(
        self, last_common_step: int, limits_m: Sequence[Floats]
    ) -> tuple[TruthPair, Floats]:
        """Return the pair with the farthest differences within limits, and the excess of `_Shares`.

        The differences are reduced until all measurements can be the same.
        """
        members = [
            differences.member(limits, last_common_step + 1)
            for differences, limits in zip(self._differences, limits_m, strict=True)
        ]
        apart = _Start(
            np.array([member.offset_m for member in members]),
            np.array([member.velocity_m_s for member in members]),
            np.array([member.acceleration_m_s2 for member in members]),
        )
        half = apart.times(0.5)
        difference = self.motion.difference(*apart)
        half_m = 0.5 * float(np.hypot.reduce(difference[: self.lateral, -1]))
        reserve = self._reserve(difference, half_m)
        if reserve is None:
            # Its bound is minus infinity: any pair with a proof is better.
            pair = self._truths(last_common_step, 0.5 * difference, half, (1.0, -1.0), _NO_PROOF)
            return pair, np.zeros((self.steps, 2))

        correction = self._correction(last_common_step, reserve.late_s, reserve)
        by_manoeuvre = 0.5 * self._by_manoeuvre(apart.acceleration_m_s2)
        speeds = np.abs(self._middle[1]) + np.abs(half.velocity_m_s) + by_manoeuvre
        slope = self._slope(speeds, reserve)
        beyond_m = reserve.position_m + reserve.drift_m
        # Half of the difference along x at the arrival, whose row follows the lateral ones.
        along_m = (
            0.5 * (abs(float(difference[self.lateral, -1])) + beyond_m) + correction.by_gravity_m
        )

        # Measurements count while a motion can still be nearer than the bound.
        left_m = max(0.0, half_m - correction.straight_m)
        shares = self._shares(last_common_step, difference, reserve, slope, left_m)
        # Each motion has half of the difference, which is reduced until the largest share is 1 less
        # `MARGIN`. A smaller one is not increased.
        share = 0.5 * (1.0 - MARGIN) / max(1.0 - MARGIN, shares.largest)
        pair = self._truths(
            last_common_step,
            share * difference,
            _Start(
                2.0 * share * half.offset_m,
                2.0 * share * half.velocity_m_s,
                share * apart.acceleration_m_s2,
            ),
            (1.0, -1.0),
            _Losses(
                correction.straight_m,
                0.5 * beyond_m + correction.by_gravity_m + slope * along_m,
                slope,
            ),
        )
        return pair, shares.excess

    def single(self) -> TruthPair:
        """Return the motion that is farthest from the target at x = 0 without impulses."""
        motion = self.motion
        lateral = slice(0, self.lateral)
        side = np.where(motion.states[lateral, -1] < 0.0, -1.0, 1.0)
        start = self._farthest_start(side)
        change = motion.difference(*start)
        track = (1.0 - MARGIN) * (motion.states + change)
        last = self.steps - 1
        far_m = float(np.hypot.reduce(track[lateral, -1]))
        # The motion deviates from the middle by half of a difference of two.
        reserve = self._reserve(2.0 * change, far_m)
        if reserve is None:
            return self._truths(last, track, start, (1.0, 1.0), _NO_PROOF)

        # Change of x at the arrival: by impulses, by start and manoeuvre, and beyond first order.
        along_m = reserve.nearer_m[-1] + abs(change[self.lateral, -1]) + 0.5 * reserve.position_m
        late_s = float(along_m) / reserve.closing_m_s
        correction = self._correction(-1, late_s, reserve)
        speeds = np.abs(self._middle[1] + start.velocity_m_s)
        slope = self._slope(speeds + self._by_manoeuvre(start.acceleration_m_s2), reserve)
        # A single motion misses the centre; the aim point may be on its side.
        aim_m = float(np.hypot.reduce(self.scenario.set_model.lateral_aim_m))
        losses = _Losses(
            correction.straight_m,
            0.5 * reserve.position_m + correction.by_gravity_m + slope * float(along_m) + aim_m,
            slope,
        )
        return self._truths(last, track, start, (1.0, 1.0), losses)

    def _farthest_start(self, side: Floats) -> _Start:
        """Return the start and accelerations that move farthest to a side of each axis at x = 0."""
        motion = self.motion
        lateral = slice(0, self.lateral)
        velocities = slice(motion.axes, -1)
        onward = motion.transition[-1]
        pushed = np.einsum("rs,nsw->rwn", onward, np.diff(motion.pushed, axis=0))
        by_offset = np.diag(onward[lateral, lateral])
        by_velocity = np.diag(onward[lateral, velocities])
        by_push = np.stack([pushed[i, i] for i in range(self.lateral)])
        maximum = np.array([planar.disturbance_m_s2 for planar in self._models])
        return _Start(
            0.5 * side * self._widths[0] * _signs(by_offset),
            0.5 * side * self._widths[1] * _signs(by_velocity),
            (side * maximum)[:, None] * _signs(by_push),
        )

    def _reserve(self, difference: Floats, reach_m: float) -> GravityReserve | None:
        """Return the reserve for gravity, or None if gravity is too strong for the proof."""
        if not self.arrives:
            return None
        scenario = self.scenario
        disturbance = math.hypot(*(planar.disturbance_m_s2 for planar in self._models))
        step_s = scenario.set_model.step_s
        return gravity_reserve(
            self.motion, difference, reach_m, disturbance, scenario.sun, scenario.engine, step_s
        )

    def _by_manoeuvre(self, acceleration_m_s2: Floats) -> Floats:
        """Return the maximum changes of velocity by accelerations, along each axis, m/s."""
        return np.asarray(np.abs(acceleration_m_s2).sum(axis=1) * self.scenario.set_model.step_s)

    def _slope(self, speeds_m_s: Floats, reserve: GravityReserve) -> float:
        """Return the maximum ratio of the velocities across and along x.

        `speeds_m_s` are the maximum speeds of the target along the lateral axes.
        """
        across_m_s = float(np.hypot.reduce(speeds_m_s)) + reserve.impulses_m_s + reserve.across_m_s
        return across_m_s / reserve.closing_m_s

    def _truths(
        self,
        last_common_step: int,
        track: Floats,
        start: _Start,
        sides: tuple[float, float],
        losses: _Losses,
    ) -> TruthPair:
        """Return two motions with a start relative to the middle of the box, times `sides`.

        Equal sides are a single motion.
        """
        signs = np.array(sides)
        is_single = sides[0] == sides[1]
        wrong = self._wrong_steps(-1 if is_single else last_common_step)
        half = len(wrong) // 2
        positions = self._middle[0] + np.outer(signs, start.offset_m)
        velocities = self._middle[1] + np.outer(signs, start.velocity_m_s)
        return TruthPair(
            label_m=self.label_m,
            vx_m_s=self.vx_m_s,
            is_single=is_single,
            last_common_step=last_common_step,
            times_s=self.motion.times_s,
            track_m=track[: self.lateral],
            correction_m=losses.correction_m,
            reserve_m=losses.reserve_m,
            cosine=1.0 / math.hypot(1.0, losses.slope),
            position_m=np.column_stack([positions, np.full(2, self.label_m)]),
            velocity_m_s=np.column_stack([velocities, np.full(2, self.vx_m_s)]),
            acceleration_m_s2=signs[:, None] * start.acceleration_m_s2[:, None, :],
            wrong_steps=(wrong[half:], wrong[:half]),
        )

    def _shares(
        self,
        last_common_step: int,
        difference: Floats,
        reserve: GravityReserve,
        slope: float,
        left_m: float,
    ) -> _Shares:
        """Return the differences of the measurements up to a step, as shares.

        `largest` is infinite if a motion can be at x = 0 before a measurement.
        """
        largest = 0.0
        excess = np.zeros((self.steps, 2))
        for name, sensor in self.scenario.sensors.items():
            due = self._equal_steps(name, last_common_step)
            sighting = self._sighting(due, difference, reserve, slope, left_m)
            if sighting is None:
                return _Shares(math.inf, excess)

            shares = sensor.share(self._apart(sighting, difference, reserve))
            largest = max(largest, float(shares.max(initial=0.0)))
            band = sensor.band(sighting.range_m, sighting.closing_m_s)
            if band is not None:
                column = PREDICTED_MISS if band[0] else POSITION
                first_order = self._first_order_shares(sighting, difference, column)
                beyond = np.clip(shares - first_order, 0.0, 1.0)
                excess[due, column] = np.maximum(excess[due, column], beyond)
        return _Shares(largest, excess)

    def _sighting(
        self,
        due: Integers,
        difference: Floats,
        reserve: GravityReserve,
        slope: float,
        left_m: float,
    ) -> _Sighting | None:
        """Return the bounds of equation (25) and its corollary, or None if x can be zero."""
        x = self.motion.range_m[due]
        c = self.motion.closing_speed_m_s[due]
        shift = np.abs(difference[self.lateral, due]) + reserve.position_m
        moved = 0.5 * shift + reserve.nearer_m[due]
        nearest = x - moved
        if (nearest <= 0.0).any():
            return None
        return _Sighting(
            due=due,
            range_m=x,
            closing_m_s=c,
            shift_m=shift,
            moved_m=moved,
            nearest_m=nearest,
            farthest_m=x + moved,
            fastest_m_s=c + reserve.deviation_m_s,
            slope=slope + left_m / nearest,
        )

    def _apart(self, sighting: _Sighting, difference: Floats, reserve: GravityReserve) -> Apart:
        """Return the differences of a pair at the measurements of a sensor."""
        due = sighting.due
        q = sighting.slope
        offsets = np.abs(difference[: self.lateral, due])
        first_order = self._predicted_misses(sighting, difference)
        return Apart(
            offset_m=offsets + reserve.position_m + q * sighting.shift_m,
            predicted_miss_m=first_order + self._beyond_first_order(sighting, difference, reserve),
            shift_m=sighting.shift_m,
            range_m=sighting.nearest_m,
            farthest_m=sighting.farthest_m * np.hypot(1.0, q),
            slope=q,
            closing_speed_m_s=sighting.fastest_m_s,
        )

    def _predicted_misses(self, sighting: _Sighting, difference: Floats) -> Floats:
        """Return the moduli of the differences of the predicted misses to first order, m."""
        offsets = difference[: self.lateral, sighting.due]
        velocities = difference[self.motion.axes : -1, sighting.due]
        return np.abs(offsets + velocities * sighting.to_go_s)

    def _beyond_first_order(
        self, sighting: _Sighting, difference: Floats, reserve: GravityReserve
    ) -> Floats:
        """Return the terms of equation (26) of docs/guarantee-bound.md after the first one, m."""
        closing = reserve.closing_m_s
        to_go = sighting.to_go_s
        # The last row is along x.
        rates = np.abs(difference[self.motion.axes :, sighting.due]) + reserve.speed_m_s
        mistimed = (sighting.moved_m + to_go * reserve.deviation_m_s) / closing
        beyond = reserve.position_m + reserve.speed_m_s * to_go + rates[: self.lateral] * mistimed

        farthest = sighting.farthest_m
        turned = 1.0 + (1.0 + sighting.fastest_m_s / closing) * farthest / sighting.nearest_m
        by_slope = turned * sighting.shift_m + rates[-1] * farthest / closing
        return np.asarray(beyond + sighting.slope * by_slope)

    def _first_order_shares(self, sighting: _Sighting, difference: Floats, column: int) -> Floats:
        """Return the maximum over the axes of the first-order difference by its limit."""
        due = sighting.due
        if column == PREDICTED_MISS:
            heights = self._predicted_misses(sighting, difference)
        else:
            heights = np.abs(difference[: self.lateral, due])
        limits_m = np.stack([each.limits_m[due, column] for each in self._differences])
        return np.asarray((heights / limits_m).max(axis=0))


def _signs(values: Floats) -> Floats:
    """Return 1 for values from zero on, and -1 for negative ones."""
    return np.where(values < 0.0, -1.0, 1.0)


def later_impulses(
    scenario: Scenario, last_common_step: int, until_s: float
) -> tuple[Floats, Floats]:
    """Return times, s, and sizes, m/s, of the maximum impulses that are decided after a step.

    The impulses are given before `until_s`, the earliest one first. The earliest ones are as large
    as the engine allows, and those after the budget is spent are zero.
    """
    thruster = scenario.engine
    step_s = scenario.set_model.step_s
    steps = scenario.impulse_steps
    if steps is None:
        steps = range(thruster.delay_steps, math.ceil(until_s / step_s))
    given = np.array(steps, dtype=np.float64)
    given_s = step_s * given[given > last_common_step + thruster.delay_steps]
    given_s = given_s[given_s < until_s]
    left = thruster.budget_m_s - thruster.max_impulse_m_s * np.arange(len(given_s))
    return given_s, np.clip(left, 0.0, thruster.max_impulse_m_s)
