"""A lower bound of the miss that any strategy can guarantee, from two motions with the same measurements."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from operator import attrgetter

import numpy as np

from infoset import AngleSensor
from infoset.arrays import Floats, Integers
from infoset.sensor import Apart
from sim.farthest_pair import MARGIN, PairProgram, motion_of
from sim.gravity import greatest_impulses_m_s, with_gravity
from sim.scenario import Scenario

LABELS_A_PERIOD, PERIODS_LOOKED_AT = 8, 7
"""The bound oscillates with the label; the period is the distance travelled between two measurements."""
REFINEMENTS = 5
GREATEST_SPEED_CHANGE = 0.05
"""Greatest relative change of V_x by gravity for which the reserve for gravity is proved."""
LEAST_RANGE = 1e-9
"""Least range of a measurement as a share of the label; at a range of zero there is no angle."""

FEW_CANDIDATES = 16
"""Number of last common steps up to which all are tried: between few impulses, the bound has several maxima."""
_BOUND, _UNLIMITED = attrgetter("bound_m"), attrgetter("unlimited_bound_m")


@dataclass(frozen=True)
class TruthPair:
    """Two true motions with the same measurements up to some step, and the greatest distance at the end.

    Parameters
    ----------
    label_m : float
        Their common range x at t = 0, m.
    vx_m_s : float
        Their common velocity along x, m/s; negative.
    last_common_step : int
        Last step whose measurements, and therefore impulses, can be the same; -1 if there is none.
    apart_m : float
        Their distance across x at x = 0, with the same impulses, m.
    correction_m : float
        Greatest change of one position across x at x = 0 by the impulses after `last_common_step`, m.
    gravity_m : float
        Greatest change of half of `apart_m` by gravity, m.
    across_m_s : float
        Greatest velocity across x of the two in the flight, with any impulses and gravity, m/s.
    position_m, velocity_m_s : ndarray, shape (2, 2) or (2, 3)
        (z, x) and (V_z, V_x) of the two motions at t = 0; (y, z, x) and (V_y, V_z, V_x) in space.
    acceleration_m_s2 : ndarray, shape (2, steps) or (2, 2, steps)
        Accelerations of the two motions along z over each step; x = 0 is in the last step. In space, those along y
        and z: axis, motion, step.
    """

    label_m: float
    vx_m_s: float
    last_common_step: int
    apart_m: float
    correction_m: float
    gravity_m: float
    across_m_s: float
    position_m: Floats
    velocity_m_s: Floats
    acceleration_m_s2: Floats

    @property
    def bound_m(self) -> float:
        """Least distance, m, below which at least one of the two does not come with any strategy."""
        return max(0.0, self.unlimited_bound_m)

    @property
    def unlimited_bound_m(self) -> float:
        """The bound without its limit at zero, m."""
        cosine = -self.vx_m_s / math.hypot(self.vx_m_s, self.across_m_s)
        return (0.5 * self.apart_m - self.correction_m - self.gravity_m) * cosine

    @property
    def arrival_s(self) -> float:
        """Time when x = 0, s."""
        return -self.label_m / self.vx_m_s

    def difference_m(self, step_s: float) -> tuple[Floats, Floats]:
        """Return the times of all steps and of the arrival, s, and the differences of the two motions there, m.

        The shapes are (n,) and (axes, n). The difference is first motion minus second, along z, or along y and z.
        """
        steps = self.acceleration_m_s2.shape[-1]
        times_s = np.append(np.arange(steps) * step_s, self.arrival_s)
        offset, velocity = (-np.diff(values[:, :-1], axis=0)[0] for values in (self.position_m, self.velocity_m_s))
        first, second = np.moveaxis(self.acceleration_m_s2.reshape(-1, 2, steps), 1, 0)
        return times_s, motion_of(offset, velocity, first - second, times_s)[0]


@dataclass(frozen=True)
class LowerBound:
    """A miss below which no strategy can guarantee to stay.

    Parameters
    ----------
    pairs : tuple of TruthPair
        Best pair at both ends of the interval of V_x and at the nominal closing speed, the best one first.
    by_label : tuple of TruthPair
        Best pairs of all examined labels, in ascending order, for each velocity along x.
    disturbance_m_s2 : float
        Greatest acceleration of the true motion along z, m/s^2; `SetModel` contains that along y.
    """

    pairs: tuple[TruthPair, ...]
    by_label: tuple[TruthPair, ...]
    disturbance_m_s2: float

    def __repr__(self) -> str:
        return (
            f"<lower bound {self.bound_m:.4g} m from {len(self.by_label)} labels; best label {self.pair.label_m:.6g} m>"
        )

    @property
    def bound_m(self) -> float:
        """The bound, m."""
        return self.pair.bound_m

    @property
    def pair(self) -> TruthPair:
        """The two motions with this bound."""
        return self.pairs[0]

    @property
    def speeds_m_s(self) -> tuple[float, ...]:
        """Examined velocities along x, in ascending order, m/s."""
        return tuple(sorted({pair.vx_m_s for pair in self.by_label}))

    def curve(self, vx_m_s: float) -> tuple[Floats, Floats]:
        """Return labels and bounds of one velocity along x, m."""
        pairs = [pair for pair in self.by_label if pair.vx_m_s == vx_m_s]
        return np.array([pair.label_m for pair in pairs]), np.array([pair.bound_m for pair in pairs])


def lower_bound(scenario: Scenario, *, progress: Callable[[float], None] | None = None) -> LowerBound:
    """Find the greatest miss below which no strategy can guarantee to stay.

    Parameters
    ----------
    scenario : Scenario
        A range meter has no effect unless it is very precise, because the two motions have the same range x.
    progress : callable or None
        Called with the fraction done, from 0 to 1.

    Raises
    ------
    BoundError
        If a linear program is not solved.

    Notes
    -----
    Any pair of admissible motions gives a bound; the search looks for a good one. The bound depends on the label mostly
    through the range of the last measurement before x = 0, and repeats with the distance between measurements.
    Therefore the search covers whole periods of labels in some parts of the range interval, for both ends of the
    interval of V_x and for the nominal closing speed, and refines the best labels. Cost: about 600 linear programs of
    about 110 variables, 6 ms each.

    The order in a step is measure, decide, fire. Equal measurements up to step s give equal impulses up to step s.
    Later impulses may differ, and each changes z at x = 0 by at most mu2 x_j / |V_x|. The distance of the two along z
    at x = 0 is therefore at least |dz(T)| - 2 mu2 sum_{j > s} x_j / |V_x|, and one of the two has at least half of it.
    The sum uses the earliest impulses that the budget allows, because they change z most. The miss is the least
    distance of the flight, which is shorter than the distance at x = 0 by at most the factor |V_x| / |(V_x, W)|, with
    the greatest velocity W across x. The linear programs neglect the square of the slope of the line of sight; the
    difference that they find is reduced until all measurements can be the same. docs/guarantee.md has the proof.

    The manoeuvres of a pair may differ. Gravity acts on both alike, up to K/R^3 times their distance, and changes the
    time of arrival: the bound has a reserve for both, and is zero if gravity changes V_x by 5 % or more.

    In space, each axis has a linear program, and the impulses limit the modulus. If the errors of the angles are in a
    box, the two motions of a pair differ along both axes, each by the most that its program allows: |(dy(T), dz(T))|
    replaces |dz(T)|, so the bound is never below that of one axis. If the errors are in a disc, they differ along the
    axis with the greater bound. Equal axes have one linear program.
    """
    model = scenario.set_model
    slow, fast = max(model.bounds.vx_m_s), min(model.bounds.vx_m_s)
    speeds = sorted({fast, min(max(-model.closing_speed_m_s, fast), slow), slow})
    grids = [label_grid(scenario, speed) for speed in speeds]
    refinements = [2 * REFINEMENTS if len(grid) > 1 else 0 for grid in grids]
    total, done = sum(len(grid) for grid in grids) + sum(refinements), 0
    by_label: dict[tuple[float, float], TruthPair] = {}
    best: list[TruthPair] = []
    for speed, grid, extra in zip(speeds, grids, refinements, strict=True):
        tried: list[TruthPair] = []
        before_s: float | None = None
        width = float(np.diff(grid).min(initial=np.inf))
        labels = grid.tolist()
        for index in range(len(grid) + extra):
            if index >= len(grid):
                # Refine around the best label: half a width to each side, repeatedly.
                width *= 0.5 if (index - len(grid)) % 2 == 0 else 1.0
                side = 1.0 if (index - len(grid)) % 2 else -1.0
                label_m = max(tried, key=_BOUND).label_m + side * width
                labels.append(min(max(label_m, model.bounds.x_m[0]), model.bounds.x_m[1]))
            pair = pair_at(scenario, labels[index], speed, try_first_before_s=before_s)
            before_s = pair.arrival_s - pair.last_common_step * model.step_s
            tried.append(pair)
            by_label[speed, pair.label_m] = pair
            done += 1
            if progress is not None:
                progress(done / total)
        best.append(max(tried, key=_BOUND))
    best.sort(key=_BOUND, reverse=True)
    return LowerBound(
        tuple(best),
        tuple(pair for _, pair in sorted(by_label.items(), key=lambda item: item[0])),
        model.disturbance_m_s2,
    )


def label_grid(scenario: Scenario, vx_m_s: float) -> Floats:
    """Return the labels to examine, m, in ascending order: whole periods of the bound, evenly spaced, ends included."""
    lower, upper = scenario.set_model.bounds.x_m
    period = -vx_m_s * scenario.set_model.step_s * scenario.set_model.steps_in(scenario.set_model.angle_sensor.period_s)
    whole = max(1, int(np.ceil((upper - lower) / period)))
    if whole <= PERIODS_LOOKED_AT:
        return np.unique(np.linspace(lower, upper, whole * LABELS_A_PERIOD + 1))
    starts = np.linspace(lower, upper - period, PERIODS_LOOKED_AT)
    places = starts[:, None] + np.linspace(0.0, period, LABELS_A_PERIOD + 1)[None, :]
    return np.unique(np.minimum(places, upper))


def pair_at(
    scenario: Scenario,
    label_m: float,
    vx_m_s: float,
    *,
    last_common_step: int | None = None,
    try_first_before_s: float | None = None,
) -> TruthPair:
    """Find the pair of motions with the greatest bound for the range x(t) = label + vx t.

    `last_common_step` is the last step with the same measurements; None searches for the best one. That search starts
    at the time `try_first_before_s` before arrival, s, or at the end.
    """
    approach = _Approach(scenario, label_m, vx_m_s)
    if last_common_step is not None:
        pairs = [approach.pair(last_common_step, axes) for axes in approach.choices]
        return max(pairs, key=_UNLIMITED)
    candidates = approach.candidates
    if scenario.thruster.impulses_s and len(candidates) <= FEW_CANDIDATES:
        every = [approach.pair(step, axes) for axes in approach.choices for step in candidates.tolist()]
        return max(every, key=_UNLIMITED)
    start = len(candidates) - 1
    if try_first_before_s is not None:
        wanted = (approach.arrival_s - try_first_before_s) / scenario.set_model.step_s
        start = int(np.abs(candidates - wanted).argmin())
    pairs = [_climb(partial(approach.pair, axes=axes), candidates, start) for axes in approach.choices]
    return max(pairs, key=_UNLIMITED)


def _climb(pair_of: Callable[[int], TruthPair], candidates: Integers, start: int) -> TruthPair:
    """Return the pair at a local maximum over candidates, found from an index with strides that double and halve.

    The distance grows linearly and the correction quadratically, so the bound has one maximum.
    """
    known: dict[int, TruthPair] = {}

    def value(index: int) -> float:
        if not 0 <= index < len(candidates):
            return -np.inf
        if index not in known:
            known[index] = pair_of(int(candidates[index]))
        return known[index].unlimited_bound_m

    at, stride = start, 1
    while stride:
        better = next((index for index in (at - stride, at + stride) if value(index) > value(at)), None)
        if better is None:
            stride //= 2
        else:
            at, stride = better, 2 * stride
    return known[at]


class _Approach:
    """Data of one label and velocity that all its linear programs use.

    `choices` are the axes along which the motions of a pair differ: all at once if the errors of the angle are in a
    box, one of them in a disc.
    """

    def __init__(self, scenario: Scenario, label_m: float, vx_m_s: float) -> None:
        model = scenario.set_model
        self.scenario, self.label_m, self.vx_m_s = scenario, label_m, vx_m_s
        self.arrival_s = -label_m / vx_m_s
        # Steps that start before the arrival, up to rounding.
        steps = max(1, int(np.ceil(self.arrival_s / model.step_s * (1.0 - 1e-12))))
        self.times_s = times_s = np.append(np.arange(steps) * model.step_s, self.arrival_s)
        self.ranges_m = np.maximum(label_m + vx_m_s * times_s[:-1], LEAST_RANGE * label_m)
        self.impulses_m_s = greatest_impulses_m_s(model, scenario.thruster)
        self.speed_change = 0.0
        if scenario.sun is not None:
            change = with_gravity(model, scenario.sun, self.impulses_m_s).gravity_speed_change
            self.speed_change = min(change, GREATEST_SPEED_CHANGE)
        self.late_s = 0.5 * self.speed_change / (1.0 - self.speed_change) * self.arrival_s
        self._models = {name: model.axis(name) for name in model.axes}
        self._due: dict[str, Integers] = {}
        for name, sensor in scenario.sensors.items():
            due = np.arange(0, steps, model.steps_in(sensor.period_s))
            before_s = (scenario.nominal_arrival_s - times_s[due]).tolist()
            self._due[name] = due[[sensor.measures_at(each_s) for each_s in before_s]]
        self._programs = {
            planar: PairProgram(
                planar,
                {**scenario.sensors, AngleSensor.name: planar.angle_sensor},
                self._due,
                times_s,
                self.ranges_m,
                vx_m_s,
            )
            for planar in dict.fromkeys(self._models.values())
        }
        single = {planar: (name,) for name, planar in self._models.items()}
        self.choices = [*single.values()] if model.angle_sensor.is_disc else [model.axes]

    @property
    def candidates(self) -> Integers:
        """Last common steps that may be the best: those before a measurement, and the end."""
        measured = np.logical_or.reduce([program.is_measured for program in self._programs.values()])
        last = np.append(np.flatnonzero(measured) - 1, len(self.ranges_m) - 1).astype(np.int64)
        thruster, steps = self.scenario.thruster, self.scenario.impulse_steps
        if steps is None:
            return last
        # Between two decisions, more common measurements only bring the motions nearer to each other.
        after_decisions = np.searchsorted(last, np.array(steps) - thruster.delay_steps)
        return np.asarray(last[np.unique(np.append(0, np.minimum(after_decisions, len(last) - 1)))])

    def correction_m(self, last_common_step: int) -> float:
        """Return the greatest change of the miss by impulses that are decided after a step, within the budget, m."""
        thruster, steps = self.scenario.thruster, self.scenario.impulse_steps
        latest_s, step_s = self.arrival_s + self.late_s, self.scenario.set_model.step_s
        given = np.arange(thruster.delay_steps, math.ceil(latest_s / step_s)) if steps is None else np.array(steps)
        arms_s = latest_s - step_s * given[given > last_common_step + thruster.delay_steps]
        arms_s = arms_s[arms_s > 0.0]
        spent = thruster.greatest_impulse_m_s * np.arange(len(arms_s))
        sizes = np.clip(thruster.budget_m_s - spent, 0.0, thruster.greatest_impulse_m_s)
        return float(sizes @ arms_s)

    def pair(self, last_common_step: int, axes: Sequence[str]) -> TruthPair:
        """Return the pair with the greatest distance at the end of those with the same measurements up to a step."""
        wanted = dict.fromkeys(self._models[name] for name in axes)
        farthest = {planar: self._programs[planar].farthest(last_common_step) for planar in wanted}
        nothing = (0.0, 0.0, np.zeros(len(self.ranges_m)), 0.0)
        found = [farthest[planar] if name in axes else nothing for name, planar in self._models.items()]
        offset, velocity, acceleration, end_m = (np.array(each) for each in zip(*found, strict=True))
        step_s, sides, eta = self.scenario.set_model.step_s, np.array([0.5, -0.5]), self.speed_change
        boxes = [planar.bounds for planar in self._models.values()]
        z = np.array([0.5 * sum(box.z_m) for box in boxes])[:, None]
        vz = np.array([0.5 * sum(box.vz_m_s) for box in boxes])[:, None]
        by_manoeuvre = np.abs(acceleration).sum(axis=1) * step_s
        speeds = np.abs(vz + sides * velocity[:, None]) + 0.5 * by_manoeuvre[:, None]
        across_m_s = float(np.hypot.reduce(speeds).max()) + self.impulses_m_s
        across_m_s = (across_m_s - eta * self.vx_m_s) / (1.0 - eta)
        correction_m, apart_m = self.correction_m(last_common_step), math.hypot(*end_m)
        positions, velocities = motion_of(offset, velocity, acceleration, self.times_s)
        misses = positions + velocities * (self.arrival_s - self.times_s)
        # Gravity changes the difference of the two and the time of arrival.
        change_m = eta / (2.0 - eta) * float(np.hypot.reduce(positions).max())
        late_m = self.late_s * float(np.hypot.reduce(np.abs(velocity) + by_manoeuvre))
        shift_m = change_m + 2.0 * eta * correction_m
        gravity_m = 0.5 * (change_m + late_m) + eta * correction_m + shift_m * across_m_s / -self.vx_m_s
        left_m = max(0.0, 0.5 * apart_m - correction_m)
        share = self._admissible_share(last_common_step, positions, misses, change_m, late_m, across_m_s, left_m)
        halves = share * sides
        pushes = halves[:, None] * acceleration[:, None, :]
        return TruthPair(
            self.label_m,
            self.vx_m_s,
            last_common_step,
            share * apart_m,
            correction_m,
            gravity_m,
            across_m_s,
            np.column_stack([*(z + halves * offset[:, None]), np.full(2, self.label_m)]),
            np.column_stack([*(vz + halves * velocity[:, None]), np.full(2, self.vx_m_s)]),
            pushes if self.scenario.is_spatial else pushes[0],
        )

    def _admissible_share(
        self,
        last_common_step: int,
        positions_m: Floats,
        misses_m: Floats,
        change_m: float,
        late_m: float,
        across_m_s: float,
        left_m: float,
    ) -> float:
        """Return the share of a difference, at most 1, with which all measurements up to a step can be the same.

        The linear programs neglect gravity and the square of the slope of the line of sight.
        """
        nearest_m = self.ranges_m - 0.5 * self.speed_change * self.label_m
        if self.speed_change >= GREATEST_SPEED_CHANGE or nearest_m[: last_common_step + 1].min(initial=np.inf) <= 0.0:
            return 0.0
        greatest = 1.0 - MARGIN
        for name, sensor in self.scenario.sensors.items():
            due = self._due[name][self._due[name] <= last_common_step]
            slope = across_m_s / -self.vx_m_s + left_m / nearest_m[due]
            apart = Apart(
                offset_m=np.abs(positions_m[:, due]) + (1.0 + slope) * change_m,
                predicted_miss_m=np.abs(misses_m[:, due]) + (2.0 + 4.0 * slope) * change_m + 3.0 * late_m,
                shift_m=change_m,
                range_m=nearest_m[due],
                farthest_m=(2.0 * self.ranges_m[due] - nearest_m[due]) * np.hypot(1.0, slope),
                slope=slope,
                closing_speed_m_s=-self.vx_m_s * (1.0 + self.speed_change),
            )
            greatest = max(greatest, float(sensor.share(apart).max(initial=0.0)))
        return (1.0 - MARGIN) / greatest
