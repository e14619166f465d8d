"""The two true motions of a lower bound with the same measurements, and the single one, for one
range and speed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from operator import attrgetter

import numpy as np

from infoset.arrays import Floats, Integers
from infoset.sensors import Apart, BearingSensor
from infoset.sim.bound.coasting import NoArrivalError, coasting
from infoset.sim.bound.difference_sets import MARGIN, POSITION, PREDICTED_MISS, AxisDifferences
from infoset.sim.bound.gravity_reserve import GravityReserve, gravity_reserve
from infoset.sim.scenario import Scenario

UNLIMITED = attrgetter("unlimited_bound_m")


@dataclass(frozen=True)
class TruthPair:
    """Two true motions with the same measurements up to some step that are far apart at the end, or
    one far motion.

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
    acceleration_m_s2 : ndarray, shape (2, steps) or (2, 2, steps)
        Accelerations of the two motions along z over each step; x = 0 is in the last step. In
        space, those along y and z: axis, motion, step.
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

    @property
    def bound_m(self) -> float:
        """Minimum distance, m, below which at least one of the two does not come with any
        strategy.
        """
        return max(0.0, self.unlimited_bound_m)

    @property
    def unlimited_bound_m(self) -> float:
        """The bound without its limit at zero, m."""
        return (
            float(np.hypot.reduce(self.track_m[:, -1])) - self.correction_m - self.reserve_m
        ) * self.cosine

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
        """Difference of the two motions across x at `times_s`, first minus second, shape (axes, n),
        m.
        """
        return np.zeros_like(self.track_m) if self.is_single else 2.0 * self.track_m


class PairApproach:
    """Data of one label and velocity that all its motions use.

    `motion` is in the middle of the box of starts, without impulses.
    """

    def __init__(self, scenario: Scenario, label_m: float, vx_m_s: float) -> None:
        model = scenario.set_model
        self.scenario = scenario
        self.label_m = label_m
        self.vx_m_s = vx_m_s
        self._models = [model.axis(name) for name in model.axes]
        self.lateral = len(self._models)
        ends = np.array(
            [(planar.bounds.z_m, planar.bounds.vz_m_s) for planar in self._models]
        ).swapaxes(0, 1)
        self._middle = ends.mean(axis=-1)
        self._widths = np.ptp(ends, axis=-1)
        start = np.append(self._middle[0], label_m), np.append(self._middle[1], vx_m_s)
        self.arrives = True
        try:
            self.motion = coasting(*start, scenario.sun, model.step_s)
        except NoArrivalError:
            self.motion = coasting(*start, None, model.step_s)
            self.arrives = False
        self.steps = len(self.motion.range_m)
        self._due: dict[str, Integers] = {}
        for name, sensor in scenario.sensors.items():
            due = np.arange(0, self.steps, model.steps_in(sensor.period_s))
            before_s = (scenario.nominal_arrival_s - self.motion.times_s[due]).tolist()
            self._due[name] = due[[sensor.measures_at(each_s) for each_s in before_s]]
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

    def best_pair(self) -> TruthPair:
        """Return the best pair over the last common step.

        To first order a pair is not better than half of the farthest difference less the correction
        by later impulses. The pairs are computed in descending order of this number, until it is
        not greater than the best pair.
        """
        correction_m = self._corrections_m()
        half_m = 0.5 * np.hypot.reduce(
            [differences.farthest_m() for differences in self._differences]
        )
        # Between two decisions, more common measurements only bring the motions nearer to each
        # other.
        _, common_steps = np.unique(-correction_m, return_index=True)
        estimates_m = (half_m - correction_m)[common_steps]
        best: TruthPair | None = None
        for index in np.argsort(-estimates_m, kind="stable").tolist():
            if best is not None and (estimates_m[index] <= best.bound_m or not self.arrives):
                break
            pair = self.pair(int(common_steps[index]) - 1)
            best = pair if best is None else max(best, pair, key=UNLIMITED)
        assert best is not None
        return best

    def _corrections_m(self) -> Floats:
        """Return what impulses decided after the first 0, 1, ..., all steps change on straight
        lines, m.
        """
        given_s, sizes = later_impulses(self.scenario, -1, self.motion.arrival_s)
        sizes = sizes[sizes > 0.0]
        if not len(sizes):
            return np.zeros(self.steps + 1)
        arms_s = np.concatenate([self.motion.arrival_s - given_s, np.zeros(len(sizes))])
        from_each = np.correlate(arms_s, sizes)
        decided = (
            np.round(given_s / self.scenario.set_model.step_s) - self.scenario.thruster.delay_steps
        )
        return from_each[np.searchsorted(decided, np.arange(self.steps + 1))]

    def _correction_m(
        self, last_common_step: int, late_s: float, reserve: GravityReserve
    ) -> tuple[float, float]:
        """Return the maximum change of the miss by impulses that are decided after a step, within
        the budget, m.

        The first value is that on straight lines until an arrival that is late, the second one what
        gravity adds to it.
        """
        latest_s = self.motion.arrival_s + late_s
        given_s, sizes = later_impulses(self.scenario, last_common_step, latest_s)
        arms_s = latest_s - given_s
        return float(sizes @ arms_s), reserve.stretch_per_s2 * float(sizes @ arms_s**3)

    def pair(self, last_common_step: int) -> TruthPair:
        """Return the pair with the maximum distance at the end of those with the same measurements
        up to a step.

        The farthest difference is found to first order. Its measurements differ by more at some
        steps, and all of it is reduced until none does. A second one has narrower limits at these
        steps instead, and is reduced by less.
        """
        limits_m = [differences.limits_m for differences in self._differences]
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
        """Return the pair with the farthest differences within limits, reduced until its
        measurements can be the same.

        The second value is the excess of its measurements over their first order, as a share of
        their limits.
        """
        offset, velocity = np.zeros((2, self.lateral))
        acceleration = np.zeros((self.lateral, self.steps))
        for i, differences in enumerate(self._differences):
            offset[i], velocity[i], acceleration[i] = differences.member(
                limits_m[i], last_common_step + 1
            )
        difference = self.motion.difference(offset, velocity, acceleration)
        half_m = 0.5 * float(np.hypot.reduce(difference[: self.lateral, -1]))
        start = 0.5 * np.stack([offset, velocity])
        sides = np.array([1.0, -1.0])
        reserve = self._reserve(difference, half_m)
        if reserve is None:
            pair = self._truths(
                last_common_step, 0.5 * difference, start, 0.5 * acceleration, sides
            )
            return pair, np.zeros((self.steps, 2))

        correction_m, longer_m = self._correction_m(last_common_step, reserve.late_s, reserve)
        speeds = np.abs(self._middle[1]) + np.abs(start[1]) + 0.5 * self._by_manoeuvre(acceleration)
        slope = self._slope(speeds, reserve)
        beyond_m = reserve.position_m + reserve.drift_m
        along_m = 0.5 * (abs(float(difference[self.lateral, -1])) + beyond_m) + longer_m
        left_m = max(0.0, half_m - correction_m)
        largest, excess = self._shares(last_common_step, difference, reserve, slope, left_m)
        share = 0.5 * (1.0 - MARGIN) / max(1.0 - MARGIN, largest)
        pair = self._truths(
            *(
                last_common_step,
                share * difference,
                2.0 * share * start,
                share * acceleration,
                sides,
            ),
            correction_m=correction_m,
            reserve_m=0.5 * beyond_m + longer_m + slope * along_m,
            slope=slope,
        )
        return pair, excess

    def single(self) -> TruthPair:
        """Return the motion that is farthest from the target at x = 0 without impulses."""
        motion = self.motion
        onward = motion.transition[-1]
        lateral = slice(0, self.lateral)
        pushed = np.einsum("rs,nsw->rwn", onward, np.diff(motion.pushed, axis=0))
        side = np.where(motion.states[lateral, -1] < 0.0, -1.0, 1.0)
        by_start = np.stack(
            [np.diag(onward[lateral, lateral]), np.diag(onward[lateral, motion.axes : -1])]
        )
        start = 0.5 * side * self._widths * np.where(by_start < 0.0, -1.0, 1.0)
        by_push = np.stack([pushed[i, i] for i in range(self.lateral)])
        maximum = np.array([planar.disturbance_m_s2 for planar in self._models])
        acceleration = (side * maximum)[:, None] * np.where(by_push < 0.0, -1.0, 1.0)
        change = motion.difference(start[0], start[1], acceleration)
        track = (1.0 - MARGIN) * (motion.states + change)
        last = self.steps - 1
        far_m = float(np.hypot.reduce(track[lateral, -1]))
        reserve = self._reserve(2.0 * change, far_m)
        if reserve is None:
            return self._truths(last, track, start, acceleration, np.ones(2))
        along_m = reserve.nearer_m[-1] + abs(change[self.lateral, -1]) + 0.5 * reserve.position_m
        correction_m, longer_m = self._correction_m(
            -1, float(along_m) / reserve.closing_m_s, reserve
        )
        slope = self._slope(
            np.abs(self._middle[1] + start[1]) + self._by_manoeuvre(acceleration), reserve
        )
        return self._truths(
            *(last, track, start, acceleration, np.ones(2)),
            correction_m=correction_m,
            reserve_m=0.5 * reserve.position_m + longer_m + slope * float(along_m),
            slope=slope,
        )

    def _reserve(self, difference: Floats, reach_m: float) -> GravityReserve | None:
        """Return the reserve for gravity, or None if gravity is too strong for the proof."""
        if not self.arrives:
            return None
        scenario = self.scenario
        disturbance = math.hypot(*(planar.disturbance_m_s2 for planar in self._models))
        step_s = scenario.set_model.step_s
        return gravity_reserve(
            self.motion, difference, reach_m, disturbance, scenario.sun, scenario.thruster, step_s
        )

    def _by_manoeuvre(self, acceleration: Floats) -> Floats:
        """Return the maximum changes of velocity by accelerations, along each axis, m/s."""
        return np.asarray(np.abs(acceleration).sum(axis=1) * self.scenario.set_model.step_s)

    def _slope(self, speeds_m_s: Floats, reserve: GravityReserve) -> float:
        """Return the maximum ratio of the velocities across and along x, from those along the axes
        by the target.
        """
        across_m_s = float(np.hypot.reduce(speeds_m_s)) + reserve.impulses_m_s + reserve.across_m_s
        return across_m_s / reserve.closing_m_s

    def _truths(
        self,
        last_common_step: int,
        track: Floats,
        start: Floats,
        acceleration: Floats,
        sides: Floats,
        *,
        correction_m: float = 0.0,
        reserve_m: float = math.inf,
        slope: float = 0.0,
    ) -> TruthPair:
        """Return the motions with a start and an acceleration relative to the middle of the box,
        times `sides`.
        """
        positions, velocities = (self._middle[i] + np.outer(sides, start[i]) for i in range(2))
        pushes = sides[:, None] * acceleration[:, None, :]
        return TruthPair(
            self.label_m,
            self.vx_m_s,
            bool(sides[0] == sides[1]),
            last_common_step,
            self.motion.times_s,
            track[: self.lateral],
            correction_m,
            reserve_m,
            1.0 / math.hypot(1.0, slope),
            np.column_stack([positions, np.full(2, self.label_m)]),
            np.column_stack([velocities, np.full(2, self.vx_m_s)]),
            pushes,
        )

    def _shares(
        self,
        last_common_step: int,
        difference: Floats,
        reserve: GravityReserve,
        slope: float,
        left_m: float,
    ) -> tuple[float, Floats]:
        """Return how much the measurements up to a step differ, in units of what is possible with
        equal values.

        The first value is the maximum. The second one has the shape of `AxisDifferences.limits_m`:
        what the slope of the line of sight, and impulses in gravity, add to the first order.
        """
        motion = self.motion
        axes = self.motion.axes
        largest = 0.0
        excess = np.zeros((self.steps, 2))
        for name, sensor in self.scenario.sensors.items():
            due = self._due[name][self._due[name] <= last_common_step]
            x = motion.range_m[due]
            c = motion.closing_speed_m_s[due]
            apart = np.abs(difference[:, due])
            shift = apart[self.lateral] + reserve.position_m
            moved = 0.5 * shift + reserve.nearer_m[due]
            nearest = x - moved
            farthest = x + moved
            fastest = c + reserve.deviation_m_s
            if (nearest <= 0.0).any():
                return math.inf, excess
            q = slope + left_m / nearest
            # Equation (26) of docs/guarantee.md, from the difference of the predicted misses to
            # first order.
            to_go = x / c
            rates = apart[axes:] + reserve.speed_m_s
            mistimed = (moved + to_go * reserve.deviation_m_s) / reserve.closing_m_s
            turned = 1.0 + (1.0 + fastest / reserve.closing_m_s) * farthest / nearest
            beyond = (
                reserve.position_m + reserve.speed_m_s * to_go + rates[: self.lateral] * mistimed
            )
            beyond = beyond + q * (turned * shift + rates[-1] * farthest / reserve.closing_m_s)
            misses = np.abs(difference[: self.lateral, due] + difference[axes:-1, due] * to_go)
            seen = Apart(
                offset_m=apart[: self.lateral] + reserve.position_m + q * shift,
                predicted_miss_m=misses + beyond,
                shift_m=shift,
                range_m=nearest,
                farthest_m=farthest * np.hypot(1.0, q),
                slope=q,
                closing_speed_m_s=fastest,
            )
            shares = sensor.share(seen)
            largest = max(largest, float(shares.max(initial=0.0)))
            band = sensor.band(x, c)
            if band is not None:
                column, heights = (
                    (PREDICTED_MISS, misses) if band[0] else (POSITION, apart[: self.lateral])
                )
                limits_m = np.stack(
                    [differences.limits_m[due, column] for differences in self._differences]
                )
                beyond_first = np.clip(shares - (heights / limits_m).max(axis=0), 0.0, 1.0)
                excess[due, column] = np.maximum(excess[due, column], beyond_first)
        return largest, excess


def later_impulses(
    scenario: Scenario, last_common_step: int, until_s: float
) -> tuple[Floats, Floats]:
    """Return times, s, and sizes, m/s, of the maximum impulses that are decided after a step: the
    earliest first.
    """
    thruster = scenario.thruster
    steps = scenario.impulse_steps
    step_s = scenario.set_model.step_s
    given = (
        np.arange(thruster.delay_steps, math.ceil(until_s / step_s))
        if steps is None
        else np.array(steps)
    )
    given_s: Floats = step_s * given[given > last_common_step + thruster.delay_steps].astype(
        np.float64
    )
    given_s = given_s[given_s < until_s]
    left = thruster.budget_m_s - thruster.max_impulse_m_s * np.arange(len(given_s))
    return given_s, np.clip(left, 0.0, thruster.max_impulse_m_s)
