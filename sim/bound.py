"""A lower bound on what any strategy can guarantee, and the two truths that no strategy can serve both."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.scenario import Scenario

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

LABELS_A_PERIOD, PERIODS_LOOKED_AT = 8, 7
"""The bound ripples with the label, once in the way flown between two steps; beneath that it changes slowly."""
REFINEMENTS = 5
MARGIN = 1e-6
"""Share of each limit that is kept back: angles are no ratios, and the truths are to look alike in rounded numbers."""

STEPS_A_BLOCK = 8
"""Acceleration is constant over blocks whose length is an eighth of the time to the last common measurement."""


class BoundError(RuntimeError):
    """The linear program of a bound could not be solved."""


@dataclass(frozen=True)
class TruthPair:
    """Two truths that look alike up to some step, and end as far apart as they can.

    Parameters
    ----------
    label_m : float
        Their common range x at t = 0, m.
    vx_m_s : float
        Their common velocity along x, m/s; negative.
    last_common_step : int
        The last step whose measurements, and so whose impulse, can be the same; -1 if there is none.
    apart_m : float
        Their distance along z when x = 0, without impulses or under the same ones, m.
    correction_m : float
        What the impulses after `last_common_step` can change of one miss, m.
    position_m, velocity_m_s : ndarray, shape (2, 2)
        (z, x) and (V_z, V_x) of either at t = 0.
    acceleration_m_s2 : ndarray, shape (2, steps)
        Acceleration along z of either over each step; the last step holds x = 0.
    """

    label_m: float
    vx_m_s: float
    last_common_step: int
    apart_m: float
    correction_m: float
    position_m: Floats
    velocity_m_s: Floats
    acceleration_m_s2: Floats

    @property
    def bound_m(self) -> float:
        """What one of the two must miss by, whatever the strategy, m."""
        return max(0.0, 0.5 * self.apart_m - self.correction_m)

    @property
    def arrival_s(self) -> float:
        """Time when x = 0, s."""
        return -self.label_m / self.vx_m_s

    def distance_m(self, step_s: float) -> tuple[Floats, Floats]:
        """Times of all steps and of the arrival, s, and the distance of the two along z then, m."""
        steps = self.acceleration_m_s2.shape[1]
        times_s = np.append(np.arange(steps) * step_s, self.arrival_s)
        offset, velocity, acceleration = (
            values[0] - values[1] for values in (self.position_m[:, 0], self.velocity_m_s[:, 0], self.acceleration_m_s2)
        )
        return times_s, _motion(float(offset), float(velocity), acceleration, times_s)[0]


@dataclass(frozen=True)
class LabelBound:
    """The bound at one label and one closing speed.

    Parameters
    ----------
    label_m, vx_m_s : float
        Range at t = 0 and velocity along x.
    last_common_step : int
        Where it is reached.
    bound_m : float
    """

    label_m: float
    vx_m_s: float
    last_common_step: int
    bound_m: float


@dataclass(frozen=True)
class LowerBound:
    """What no strategy can guarantee to stay below.

    Parameters
    ----------
    pairs : tuple of TruthPair
        The best pair at either end of the interval of V_x and at the nominal closing speed, the best of them first.
    by_label : tuple of LabelBound
        All labels looked at, in rising order, for each velocity along x.
    disturbance_m_s2 : float
        Acceleration along z that the truth is allowed, m/s^2.
    """

    pairs: tuple[TruthPair, ...]
    by_label: tuple[LabelBound, ...]
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
        """The two truths that show it."""
        return self.pairs[0]

    @property
    def speeds_m_s(self) -> tuple[float, ...]:
        """Velocities along x that were looked at, in rising order, m/s."""
        return tuple(sorted({each.vx_m_s for each in self.by_label}))

    def curve(self, vx_m_s: float) -> tuple[Floats, Floats]:
        """Labels and bounds of one velocity along x, m."""
        found = [each for each in self.by_label if each.vx_m_s == vx_m_s]
        return np.array([each.label_m for each in found]), np.array([each.bound_m for each in found])


def lower_bound(
    scenario: Scenario,
    *,
    progress: Callable[[float], None] | None = None,
) -> LowerBound:
    """Find the greatest miss that no strategy can guarantee to stay below.

    Parameters
    ----------
    scenario : Scenario
        Its range meter does not matter: the two truths have the same range.
    progress : callable or None
        Is told the fraction done, from 0 to 1.

    Returns
    -------
    LowerBound

    Raises
    ------
    BoundError
        If a linear program is not solved.

    Notes
    -----
    Any pair of admissible truths gives a bound; the search is for a good one. The last measurements decide, so that
    the bound depends on the label mostly through the place of the last measurement before x = 0, and repeats with the
    way flown in between. Labels are therefore looked at over whole periods, at some places of the range
    interval, for both ends of the interval of V_x and for the nominal closing speed; the best are then refined.
    Some 600 linear programs of about 110 variables, 6 ms each.

    The order in a step is measure, decide, fire. Equal measurements up to step s, then, mean equal impulses up to and
    with that of step s; those of j > s may differ, and each moves one miss by at most mu2 x_j / |V_x|. The distance
    along z of the two at x = 0 is thus at least |dz(T)| - 2 mu2 sum_{j > s} x_j / |V_x|, and one of them misses by at
    least half of it. Of impulses the budget allows, the earliest count: they move the miss most.
    """
    model = scenario.set_model
    # The target's manoeuvre is what tells one truth from another. Gravity is no choice of theirs: at one label it acts
    # on both of a pair alike but for about K/R^3 times their distance, 1e-11 m/s^2 here.
    allowed = model.disturbance_m_s2
    slow, fast = max(model.bounds.vx_m_s), min(model.bounds.vx_m_s)
    speeds = sorted({fast, min(max(-model.closing_speed_m_s, fast), slow), slow})
    grids = [label_grid(scenario, speed) for speed in speeds]
    refinements = [2 * REFINEMENTS if len(grid) > 1 else 0 for grid in grids]
    total, done = sum(len(grid) for grid in grids) + sum(refinements), 0
    found: list[LabelBound] = []
    pairs: list[TruthPair] = []
    for speed, grid, extra in zip(speeds, grids, refinements, strict=True):
        best: TruthPair | None = None
        before_s: float | None = None
        width = float(np.diff(grid).min(initial=np.inf))
        labels = grid.tolist()
        for index in range(len(grid) + extra):
            if index >= len(grid) and best is not None:
                # About the best so far: half a width to either side, again and again.
                width *= 0.5 if (index - len(grid)) % 2 == 0 else 1.0
                side = 1.0 if (index - len(grid)) % 2 else -1.0
                labels.append(min(max(best.label_m + side * width, model.bounds.x_m[0]), model.bounds.x_m[1]))
            pair = pair_at(scenario, labels[index], speed, allowed, try_first_before_s=before_s)
            before_s = pair.arrival_s - pair.last_common_step * model.step_s
            found.append(LabelBound(pair.label_m, speed, pair.last_common_step, pair.bound_m))
            if best is None or pair.bound_m > best.bound_m:
                best = pair
            done += 1
            if progress is not None:
                progress(done / total)
        if best is not None:
            pairs.append(best)
    pairs.sort(key=lambda pair: -pair.bound_m)
    by_label = {(each.vx_m_s, each.label_m): each for each in found}
    return LowerBound(tuple(pairs), tuple(each for _, each in sorted(by_label.items())), allowed)


def label_grid(scenario: Scenario, vx_m_s: float) -> Floats:
    """Labels to look at: whole periods of the ripple at even places, ends included.

    Parameters
    ----------
    scenario : Scenario
    vx_m_s : float
        Velocity along x, m/s.

    Returns
    -------
    ndarray
        m, in rising order; all periods where they are few.
    """
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
    disturbance_m_s2: float,
    *,
    last_common_step: int | None = None,
    try_first_before_s: float | None = None,
) -> TruthPair:
    """Find the pair of truths of one label and velocity that gives the greatest bound.

    Parameters
    ----------
    scenario : Scenario
    label_m, vx_m_s : float
        Range at t = 0 and velocity along x; the range is x(t) = label + vx t.
    disturbance_m_s2 : float
        Acceleration along z that a truth may have, m/s^2.
    last_common_step : int or None
        Up to where the two look alike; None tries all that may be the best.
    try_first_before_s : float or None
        How long before arrival to look first for the last common step, s; None begins at the end.

    Returns
    -------
    TruthPair

    Raises
    ------
    BoundError
        If a linear program is not solved.
    """
    approach = _Approach(scenario, label_m, vx_m_s, disturbance_m_s2)
    if last_common_step is not None:
        return approach.pair(last_common_step)
    candidates = approach.candidates
    start = len(candidates) - 1
    if try_first_before_s is not None:
        wanted = (approach.arrival_s - try_first_before_s) / scenario.set_model.step_s
        start = int(np.abs(candidates - wanted).argmin())
    return _climb(lambda index: approach.pair(int(candidates[index])), start, len(candidates))


def _climb(pair_of: Callable[[int], TruthPair], start: int, count: int) -> TruthPair:
    """Climb from an index to where neither neighbour is better, in strides that double and halve.

    With a straight rise of the distance and a quadratic one of the correction the bound has one summit.
    """
    known: dict[int, TruthPair] = {}

    def value(index: int) -> float:
        if not 0 <= index < count:
            return -np.inf
        if index not in known:
            known[index] = pair_of(index)
        return 0.5 * known[index].apart_m - known[index].correction_m

    at, stride = start, 1
    while stride:
        better = next((each for each in (at - stride, at + stride) if value(each) > value(at)), None)
        if better is None:
            stride //= 2
        else:
            at, stride = better, 2 * stride
    return known[at]


class _Approach:
    """Everything about one label and velocity that the linear programs share.

    `limits_m` is how far apart the two may be along z at each step, `rate_limits_m` how far apart their predicted
    misses may be for the rate sensor; infinite where nothing is measured.
    """

    def __init__(self, scenario: Scenario, label_m: float, vx_m_s: float, disturbance_m_s2: float) -> None:
        model = scenario.set_model
        self.scenario, self.label_m, self.vx_m_s, self.disturbance_m_s2 = scenario, label_m, vx_m_s, disturbance_m_s2
        self.arrival_s = -label_m / vx_m_s
        # Steps whose range is positive; a step that would begin at the very arrival has none.
        self.steps = max(1, int(np.ceil(self.arrival_s / model.step_s * (1.0 - 1e-12))))
        self.times_s = np.append(np.arange(self.steps) * model.step_s, self.arrival_s)
        self.ranges_m = np.maximum(label_m + vx_m_s * self.times_s[:-1], 0.0)
        self.limits_m = np.full(self.steps, np.inf)
        looked = np.arange(0, self.steps, scenario.set_model.steps_in(model.angle_sensor.period_s))
        self.limits_m[looked] = (
            2.0 * (1.0 - MARGIN) * model.angle_sensor.error_bound(self.ranges_m[looked]) * self.ranges_m[looked]
        )
        self.rate_limits_m = np.full(self.steps, np.inf)
        if scenario.rate_sensor is not None:
            rated = np.arange(0, self.steps, scenario.set_model.steps_in(scenario.rate_sensor.period_s))
            error_m_s = (1.0 - MARGIN) * scenario.rate_sensor.error_rad_s * self.ranges_m[rated]
            self.rate_limits_m[rated] = 2.0 * error_m_s * self.ranges_m[rated] / -vx_m_s

    @property
    def candidates(self) -> Integers:
        """Last common steps that may be the best: each just before a measurement, or at the end."""
        measured = np.flatnonzero(np.isfinite(np.minimum(self.limits_m, self.rate_limits_m)))
        return np.append(measured - 1, self.steps - 1).astype(np.int64)

    def correction_m(self, last_common_step: int) -> float:
        """What impulses after a step can change of the miss: the earliest first, while the budget lasts, m."""
        thruster = self.scenario.thruster
        arms_s = self.ranges_m[last_common_step + 1 :] / -self.vx_m_s
        spent = thruster.greatest_impulse_m_s * np.arange(len(arms_s))
        sizes = np.clip(thruster.budget_m_s - spent, 0.0, thruster.greatest_impulse_m_s)
        return float(sizes @ arms_s)

    def pair(self, last_common_step: int) -> TruthPair:
        """The pair farthest apart at the end of those that look alike up to a step."""
        offset, velocity, acceleration = self._farthest(last_common_step)
        box = self.scenario.set_model.bounds
        sides = np.array([0.5, -0.5])
        z, vz = 0.5 * sum(box.z_m) + sides * offset, 0.5 * sum(box.vz_m_s) + sides * velocity
        return TruthPair(
            self.label_m,
            self.vx_m_s,
            last_common_step,
            float(_motion(offset, velocity, acceleration, self.times_s)[0][-1]),
            self.correction_m(last_common_step),
            np.column_stack([z, np.full(2, self.label_m)]),
            np.column_stack([vz, np.full(2, self.vx_m_s)]),
            sides[:, None] * acceleration[None, :],
        )

    def _farthest(self, last_common_step: int) -> tuple[float, float, Floats]:
        """Difference of the two truths: offset and velocity at t = 0, acceleration over each step.

        Notes
        -----
        A linear program in the offset, the velocity and the acceleration at the knots of a time grid that is as fine
        as the steps about the last common measurement and coarser before: an acceleration constant over longer
        blocks is an admissible one, and measurements within a block are inequalities of their own.
        """
        from scipy.optimize import linprog  # takes half a second to load

        box = self.scenario.set_model.bounds
        knots = self._knots(last_common_step)
        at_s, count = self.times_s[knots], len(knots)
        blocks = count - 1
        # Units in which all variables are of the order of one: otherwise absolute tolerances of the solver matter.
        second = self.scenario.set_model.step_s
        metre = 1.0 / max(float(np.median(self.ranges_m)) * 2e-4, 1e-9)
        push = 2.0 * self.disturbance_m_s2 * metre
        step = np.diff(at_s)
        rows = np.arange(blocks)
        z, v, u = rows, count + rows, 2 * count + rows
        motion = _sparse(
            (2 * blocks, 2 * count + blocks),
            (rows, z + 1, 1.0),
            (rows, z, -1.0),
            (rows, v, -step / second),
            (rows, u, -0.5 * push * step**2),
            (blocks + rows, v + 1, 1.0),
            (blocks + rows, v, -1.0),
            (blocks + rows, u, -push * step * second),
        )
        limits, rate_limits = self.limits_m * metre, self.rate_limits_m * metre
        limits[last_common_step + 1 :] = np.inf
        rate_limits[last_common_step + 1 :] = np.inf
        bounds = np.full(2 * count + blocks, np.inf)
        bounds[:count] = np.append(limits, np.inf)[knots]
        bounds[0] = min(bounds[0], (box.z_m[1] - box.z_m[0]) * metre)
        bounds[count] = (box.vz_m_s[1] - box.vz_m_s[0]) * metre * second
        bounds[2 * count :] = 1.0
        # What is measured within a block, and all rates: a z + b V + c u of the block's first knot.
        within, rated = (
            np.setdiff1d(np.flatnonzero(np.isfinite(limits)), knots),
            np.flatnonzero(np.isfinite(rate_limits)),
        )
        looked = np.concatenate([within, rated])
        block = np.searchsorted(knots, looked, side="right") - 1
        since = self.times_s[looked] - at_s[block]
        to_go = np.concatenate([np.zeros(len(within)), self.arrival_s - self.times_s[rated]])
        row = np.arange(len(looked))
        entries = [
            (row, block, np.ones(len(looked))),
            (row, count + block, (since + to_go) / second),
            (row, 2 * count + block, push * (0.5 * since**2 + since * to_go)),
        ]
        entries += [(len(looked) + row, column, -factor) for row, column, factor in entries]
        most = np.concatenate([limits[within], rate_limits[rated]])
        cost = np.zeros(2 * count + blocks)
        cost[blocks] = -1.0
        solved = linprog(
            cost,
            A_eq=motion,
            b_eq=np.zeros(2 * blocks),
            A_ub=_sparse((2 * len(looked), 2 * count + blocks), *entries) if len(looked) else None,
            b_ub=np.tile(most, 2) if len(looked) else None,
            bounds=np.column_stack([-bounds, bounds]),
            method="highs-ds",
            options={"presolve": False},
        )
        if solved.status != 0:
            raise BoundError(f"label {self.label_m:g} m, V_x {self.vx_m_s:g} m/s: {solved.message}")
        pushes = np.clip(np.asarray(solved.x[2 * count :]), -1.0, 1.0)
        acceleration = 2.0 * self.disturbance_m_s2 * np.repeat(pushes, np.diff(knots))
        widths = [box.z_m[1] - box.z_m[0], box.vz_m_s[1] - box.vz_m_s[0]]
        offset, velocity = (
            float(np.clip(value / unit, -width, width))
            for value, unit, width in zip((solved.x[0], solved.x[count]), (metre, metre * second), widths, strict=True)
        )
        # The solver keeps to the limits but for its tolerances; what is returned keeps to them exactly.
        positions, speeds = _motion(offset, velocity, acceleration, self.times_s)
        misses = positions[:-1] + speeds[:-1] * (self.arrival_s - self.times_s[:-1])
        sizes = np.abs(np.concatenate([positions[:-1], misses]))
        allowed = np.concatenate([limits / metre, rate_limits / metre])
        share = float(np.divide(allowed, sizes, out=np.full(len(sizes), np.inf), where=sizes > 0.0).min())
        share = min(1.0, share)
        return share * offset, share * velocity, share * acceleration

    def _knots(self, last_common_step: int) -> Integers:
        """Steps where blocks of constant acceleration end, 0 and the arrival included."""
        knots = [self.steps]
        while knots[-1] > 0:
            to_go = max(0, last_common_step - knots[-1])
            knots.append(max(0, knots[-1] - 1 - to_go // STEPS_A_BLOCK))
        return np.array(knots[::-1], dtype=np.int64)


def _motion(offset: float, velocity: float, acceleration: Floats, times_s: Floats) -> tuple[Floats, Floats]:
    """Positions and speeds at some times, with constant acceleration between them."""
    step = np.diff(times_s)
    speeds = velocity + np.concatenate([[0.0], np.cumsum(acceleration * step)])
    ways = speeds[:-1] * step + 0.5 * acceleration * step**2
    return offset + np.concatenate([[0.0], np.cumsum(ways)]), speeds


def _sparse(shape: tuple[int, int], *entries: tuple[Integers, Integers, Floats | float]) -> Any:
    """Return a sparse matrix of (rows, columns, values)."""
    from scipy.sparse import csc_array

    rows = np.concatenate([each[0] for each in entries])
    columns = np.concatenate([each[1] for each in entries])
    values = np.concatenate([np.broadcast_to(each[2], each[0].shape) for each in entries])
    return csc_array((values, (rows, columns)), shape=shape)
