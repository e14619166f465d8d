"""Difference of the lower bound from the value of the game, where Theorem 7 holds.

Theorem 7 and Lemma 22 are in docs/guarantee-bound.md, and Theorem 7a for images that may be wrong.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from infoset.arrays import Flags, Floats
from infoset.covered_set import classes_left_out
from infoset.information_set import InformationSet
from infoset.model import CENTROID_ERRORS_AT_THRESHOLD, SetModel, StateBox
from infoset.sensors import BearingSensor, OffsetCamera
from infoset.sim.bound.lower_bound import LowerBound
from infoset.sim.gravity import on_board_model
from infoset.sim.scenario import Scenario

STEP_ROUNDING = 1e-12
"""A step that starts by this share before x = 0 is not counted: the rounding of its time."""
ANGLE_ROUNDING = 1e-12
"""Share by which an angle is increased: more than its rounding, which must not make it smaller."""
MAX_TRIALS = 100
"""Maximum number of trials of an angle. Chosen: each trial changes the bound of the error only, and
without a fixed point the reserve is infinite, which is safe.
"""


@dataclass(frozen=True)
class ValueReserve:
    """Parts of the difference of the miss that `symmetric-miss` guarantees from the lower bound, m.

    Each part is an upper limit.

    Parameters
    ----------
    lower_bound_m : float
        Reserve of the lower bound itself: the minimum distance in place of the distance at x = 0,
        Lemma 20, the accelerations and the steps that the search for pairs examines. If images may
        be wrong, also the images that two sets leave out beyond 2q.
    tangent_m : float
        Angles that are not small.
    dead_zone_m : float
        Impulses below the minimum impulse.
    range_threshold_m : float
        Impulses below the range threshold.
    """

    lower_bound_m: float
    tangent_m: float
    dead_zone_m: float
    range_threshold_m: float

    @property
    def total_m(self) -> float:
        """The value of the game is at least the lower bound and at most this much greater, m."""
        return self.lower_bound_m + self.tangent_m + self.dead_zone_m + self.range_threshold_m


def why_no_value(scenario: Scenario) -> tuple[str, ...]:
    """Return the assumptions of Theorem 7, and of its reserve, that a scenario does not meet.

    The budget is missing here: whether it binds follows from the computation of the reserve.
    """
    model = scenario.set_model
    thruster = scenario.engine
    box = model.bounds
    min_m_s, max_m_s = box.vx_m_s
    failed = {
        # The possible misses are one interval for one axis, one range and one closing speed.
        "engagement in space": scenario.is_spatial,
        "gravity": scenario.sun is not None,
        "range not exactly known": box.x_m[0] != box.x_m[1],
        "closing speed not exactly known": min_m_s != max_m_s,
        # The set widens each impulse by the relative error of the nominal closing speed, also if
        # the true one is known.
        "closing speed not the nominal one": min_m_s == max_m_s != -model.closing_speed_m_s,
        # An impulse must shift all possible misses alike, and before the next measurement.
        "impulses with errors": thruster.execution_error_relative > 0.0,
        "impulses with a delay": thruster.delay_steps > 0,
        "burns that take time": thruster.acceleration_m_s2 is not None,
        # In the paper's model the set can lose the true state, and symmetric-miss guarantees
        # nothing.
        "model paper": not model.is_guaranteed,
        "starts in a rectangle of angle and rate": not model.starts_as_box,
        # The pairs of the lower bound get all images; the reserve counts the limits of the angle
        # alone.
        "images that can be lost": model.angle_sensor.miss_probability > 0.0,
        "rate sensor": scenario.rate_sensor is not None,
        # The sets of the value are symmetric about measurements of zero.
        "images of a point beside the centre": isinstance(model.angle_sensor, OffsetCamera),
        "misaligned camera": model.angle_sensor.misalignment_rad > 0.0,
    }
    return tuple(reason for reason, is_failed in failed.items() if is_failed)


def value_reserve(scenario: Scenario, lower: LowerBound) -> ValueReserve | str:
    """Return the difference of the bound from the value, or the assumption that is not met.

    Only for scenarios without a reason of `why_no_value`.

    Notes
    -----
    docs/guarantee-bound.md, Lemma 22, has the proof. Cost: one information set; with q wrong
    images and G classes, C(G, 2q).
    """
    course = _course(scenario)
    minimum_m_s = scenario.engine.min_impulse_m_s
    # Each case adds one effect to the one before it.
    cases = (
        _Case(is_small=True, minimum_m_s=0.0, threshold_m=0.0),
        _Case(is_small=False, minimum_m_s=0.0, threshold_m=0.0),
        _Case(is_small=False, minimum_m_s=minimum_m_s, threshold_m=0.0),
        _Case(is_small=False, minimum_m_s=minimum_m_s, threshold_m=course.threshold_m),
    )
    misses_m, impulses_m_s = zip(
        *(_guarantee(scenario, course, case) for case in cases), strict=True
    )
    if max(impulses_m_s) > scenario.engine.budget_m_s:
        return f"budget below the {max(impulses_m_s):.3g} m/s that symmetric-miss may need"
    return ValueReserve(*np.diff([lower.bound_m, *misses_m]).tolist())


class _Case(NamedTuple):
    """Effects that a computation of the guaranteed miss includes.

    Parameters
    ----------
    is_small : bool
        Whether all angles are small.
    minimum_m_s, threshold_m : float
        Minimum impulse, and range below which no impulse is given.
    """

    is_small: bool
    minimum_m_s: float
    threshold_m: float


@dataclass(frozen=True)
class _Course:
    """Data of the flight at its steps, shape (n,).

    `half_width_m` is the maximum half-width of the possible misses at a step, for small angles,
    without accelerations after it; `later_m` is what these add. `first_m` is the maximum possible
    miss at the start.
    """

    range_m: Floats
    measured: Flags
    may_decide: Flags
    half_width_m: Floats
    later_m: Floats
    first_m: float
    threshold_m: float


def _course(scenario: Scenario) -> _Course:
    """Return the data of the flight, whose range and closing speed e are known: the minimum range
    of the box is its only range.
    """
    model = on_board_model(scenario)
    box = model.bounds
    e = model.closing_speed_m_s
    step_s = model.step_s
    nearest_m = CENTROID_ERRORS_AT_THRESHOLD * model.angle_sensor.centroid_error_m
    steps = math.ceil(box.x_m[0] / (e * step_s) * (1.0 - STEP_ROUNDING))
    ranges_m: Floats = box.x_m[0] - e * step_s * np.arange(steps, dtype=np.float64)

    every = model.steps_in(model.angle_sensor.period_s)
    before_s = (scenario.nominal_arrival_s - step_s * np.arange(steps)).tolist()
    measured = np.array(
        [i % every == 0 and model.angle_sensor.measures_at(before_s[i]) for i in range(steps)]
    )
    may_decide = np.ones(steps, dtype=bool)
    if scenario.impulse_steps is not None:
        may_decide = np.isin(np.arange(steps), scenario.impulse_steps)

    # The set has the accelerations of a step as velocities at its ends, half of them at each: at
    # t = 0 there is one half only (Lemma 3).
    arms_m = model.acceleration_m_s2 * step_s * ranges_m / e
    farthest_m = max(abs(z + v * box.x_m[0] / e) for z in box.z_m for v in box.vz_m_s)
    return _Course(
        range_m=ranges_m,
        measured=measured,
        may_decide=may_decide,
        half_width_m=_half_widths_m(model, nearest_m, measured),
        later_m=np.cumsum(arms_m[::-1])[::-1] - arms_m,
        first_m=farthest_m + arms_m.sum() - 0.5 * arms_m[0],
        threshold_m=max(model.min_range_m, nearest_m),
    )


def _half_widths_m(model: SetModel, nearest_m: float, measured: Flags) -> Floats:
    """Return the maximum half-width of the possible misses at each step, m.

    It is after the measurement of the step, and infinite where the range is below `nearest_m`.

    Half of the difference of two members of a set is a member of the set from a centred box after
    measurements of 0. If images may be wrong, the two can be members of two sets of the cover; both
    agree with the images that neither of these sets leaves out, those outside up to 2q classes.
    """
    box = model.bounds
    z_m = 0.5 * float(np.ptp(box.z_m))
    vz_m_s = 0.5 * float(np.ptp(box.vz_m_s))
    centred = StateBox((-z_m, z_m), box.x_m, (-vz_m_s, vz_m_s), box.vx_m_s)
    classes = model.classes
    left_out = classes_left_out(min(2 * model.wrong_images, classes), classes)
    every = model.steps_in(model.angle_sensor.period_s)
    ordinary = replace(
        model,
        bounds=centred,
        range_threshold_m=nearest_m,
        wrong_images=0,
        image_classes=None,
    )
    widest = InformationSet(ordinary, len(left_out), guarantee=False)
    half_width_m = np.full(len(measured), np.inf)
    for i in range(len(measured)):
        # Below the minimum range of a camera the set has no label, and impulses are not counted.
        if not widest.tracking.all():
            break
        if measured[i]:
            # The images belong to the classes in turn.
            widest.measure_angle(0.0, ~left_out[:, i // every % classes])
        half_width_m[i] = widest.predicted_miss().upper_m[0].max()
        widest.drop_below_threshold()
        widest.predict()
    return half_width_m


def _guarantee(scenario: Scenario, course: _Course, case: _Case) -> tuple[float, float]:
    """Return the maximum miss of `symmetric-miss`, m, and the maximum sum of its impulses, m/s.

    Both are upper limits, without the budget. Without a step that decides, the miss is the maximum
    possible miss at the start.
    """
    model = scenario.set_model
    maximum_m_s = scenario.engine.max_impulse_m_s
    e = model.closing_speed_m_s
    decides = course.may_decide & (course.range_m >= case.threshold_m)
    to_go_s = course.range_m / e
    speed_m_s = max(abs(v) for v in model.bounds.vz_m_s)
    worst_m = course.first_m
    wider = 1.0
    last_to_go_s = math.inf  # before the first impulse: its inverse is zero
    by_parts_m_s = 0.0
    spent_m_s = 0.0
    for i in range(len(to_go_s)):
        if course.measured[i] and not case.is_small:
            slope = (worst_m / to_go_s[i] + speed_m_s) / e
            wider = max(wider, _wider(model.angle_sensor, float(course.range_m[i]), slope))

        if decides[i]:
            # Impulse i is at most (maximum miss before - after) / tau_i, whose sum is taken by
            # parts, and at most mu2.
            by_parts_m_s += worst_m * (1.0 / to_go_s[i] - 1.0 / last_to_go_s)
            spent_m_s = min(by_parts_m_s, spent_m_s + maximum_m_s)

            dead_zone_m = case.minimum_m_s * to_go_s[i]
            middle_m = wider * course.half_width_m[i] + course.later_m[i] + dead_zone_m
            worst_m = min(worst_m, max(middle_m, worst_m - maximum_m_s * to_go_s[i]))
            last_to_go_s = to_go_s[i]
            speed_m_s += maximum_m_s

        speed_m_s += model.disturbance_m_s2 * model.step_s
    return float(worst_m), float(spent_m_s)


def _wider(sensor: BearingSensor, range_m: float, slope: float) -> float:
    """Return the maximum width of the band of an angle, in units of its width for small angles.

    The slope of the line of sight is at most `slope`; the result is infinite if the band can reach
    a right angle.
    """
    bound = sensor.error_bound(range_m)
    true_rad = math.atan(slope)
    maximum = max(bound, sensor.error_bound(range_m * math.hypot(1.0, slope)))
    seen_rad = math.inf
    for _ in range(MAX_TRIALS):
        # The maximum possible angle depends on the bound at the distances that it allows.
        before_rad = seen_rad
        seen_rad = (true_rad + 2.0 * maximum) * (1.0 + ANGLE_ROUNDING)
        if seen_rad >= 0.5 * math.pi:
            return math.inf
        if seen_rad == before_rad:
            return math.tan(maximum) / math.tan(bound) / math.cos(seen_rad) ** 2
        maximum = max(maximum, sensor.error_bound(range_m / math.cos(seen_rad)))
    return math.inf
