"""What separates the lower bound from the value of the game, where Theorem 7 of docs/guarantee.md
holds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from infoset.arrays import Flags, Floats
from infoset.information_set import InformationSet
from infoset.model import CENTROID_ERRORS_AT_THRESHOLD, StateBox
from infoset.sensors import BearingSensor
from infoset.sim.bound.lower_bound import LowerBound
from infoset.sim.gravity import on_board_model
from infoset.sim.scenario import Scenario

ROUNDING = 1e-12
MAX_TRIALS = 100


@dataclass(frozen=True)
class ValueReserve:
    """Upper limits of what separates the lower bound from the miss that `symmetric-miss`
    guarantees, m.

    Parameters
    ----------
    lower_bound_m : float
        Reserve of the lower bound itself: the minimum distance in place of that at x = 0, Lemma 20,
        the accelerations and the steps that the search for pairs examines.
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
    """Return the assumptions of Theorem 7, and of its reserve, that a scenario does not meet; empty
    if it meets all.

    The budget is missing here: whether it binds follows from the computation of the reserve.
    """
    model = scenario.set_model
    thruster = scenario.thruster
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
        # In the paper's model the set can lose the true state, and symmetric-miss guarantees
        # nothing.
        "model paper": not model.is_guaranteed,
        "starts in a rectangle of angle and rate": not model.starts_as_box,
        # The pairs of the lower bound get all images; the reserve counts the limits of the angle
        # alone.
        "images that can be lost": model.angle_sensor.miss_probability > 0.0,
        "rate sensor": scenario.rate_sensor is not None,
    }
    return tuple(reason for reason, is_failed in failed.items() if is_failed)


def value_reserve(scenario: Scenario, lower: LowerBound) -> ValueReserve | str:
    """Return what separates the lower bound from the value of the game, or the assumption that the
    scenario fails.

    Only for scenarios without a reason of `why_no_value`.

    Notes
    -----
    docs/guarantee.md, Lemma 22, has the proof. Cost: one information set.
    """
    course = _course(scenario)
    minimum_m_s = scenario.thruster.min_impulse_m_s
    small = (True, 0.0, 0.0)
    tangent = (False, 0.0, 0.0)
    dead_zone = (False, minimum_m_s, 0.0)
    steps = (small, tangent, dead_zone, (False, minimum_m_s, course.threshold_m))
    misses_m, impulses_m_s = zip(
        *(_guarantee(scenario, course, *each) for each in steps), strict=True
    )
    if max(impulses_m_s) > scenario.thruster.budget_m_s:
        return f"budget below the {max(impulses_m_s):.3g} m/s that symmetric-miss may need"
    return ValueReserve(*np.diff([lower.bound_m, *misses_m]).tolist())


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
    model = on_board_model(scenario)
    box = model.bounds
    e = model.closing_speed_m_s
    step_s = model.step_s
    z_m, vz_m_s = (0.5 * float(np.ptp(ends)) for ends in (box.z_m, box.vz_m_s))
    centred = StateBox((-z_m, z_m), box.x_m, (-vz_m_s, vz_m_s), box.vx_m_s)
    # Half of the difference of two members of a set is a member of the set from a centred box after
    # measurements of 0.
    nearest_m = CENTROID_ERRORS_AT_THRESHOLD * model.angle_sensor.centroid_error_m
    widest = InformationSet(
        replace(model, bounds=centred, range_threshold_m=nearest_m), guarantee=False
    )
    steps = math.ceil(box.x_m[0] / (e * step_s) * (1.0 - ROUNDING))
    ranges_m: Floats = box.x_m[0] - e * step_s * np.arange(steps, dtype=np.float64)
    every = model.steps_in(model.angle_sensor.period_s)
    half_width_m = np.full(steps, np.inf)
    before_s = (scenario.nominal_arrival_s - step_s * np.arange(steps)).tolist()
    measured = np.array(
        [i % every == 0 and model.angle_sensor.measures_at(before_s[i]) for i in range(steps)]
    )
    for i in range(steps):
        if not widest.tracking.all():
            break  # below the minimum range of a camera, where the set has no label and impulses are not counted
        if measured[i]:
            widest.measure_angle(0.0)
        half_width_m[i] = widest.predicted_miss().upper_m[0, 0]
        widest.drop_below_threshold()
        widest.predict()
    given = scenario.impulse_steps
    # The set has the accelerations of a step as velocities at its ends (Lemma 3).
    arms_m = model.acceleration_m_s2 * step_s * ranges_m / e
    return _Course(
        range_m=ranges_m,
        measured=measured,
        may_decide=np.ones(steps, dtype=bool)
        if given is None
        else np.isin(np.arange(steps), given),
        half_width_m=half_width_m,
        later_m=np.cumsum(arms_m[::-1])[::-1] - arms_m,
        first_m=max(abs(z + v * box.x_m[0] / e) for z in box.z_m for v in box.vz_m_s)
        + arms_m.sum()
        - 0.5 * arms_m[0],
        threshold_m=max(model.min_range_m, nearest_m),
    )


def _guarantee(
    scenario: Scenario, course: _Course, is_small: bool, minimum_m_s: float, threshold_m: float
) -> tuple[float, float]:
    """Return the maximum miss of `symmetric-miss`, m, and the maximum sum of its impulses, m/s."""
    model = scenario.set_model
    maximum_m_s = scenario.thruster.max_impulse_m_s
    e = model.closing_speed_m_s
    decides = course.may_decide & (course.range_m >= threshold_m)
    to_go_s = course.range_m / e
    speed_m_s = max(abs(v) for v in model.bounds.vz_m_s)
    worst_m = course.first_m
    wider = 1.0
    last_to_go_s = math.inf
    by_parts_m_s = spent_m_s = 0.0
    for i in range(len(to_go_s)):
        if course.measured[i] and not is_small:
            slope = (worst_m / to_go_s[i] + speed_m_s) / e
            wider = max(wider, _wider(model.angle_sensor, float(course.range_m[i]), slope))
        if decides[i]:
            # Impulse i is at most (maximum miss before - after) / tau_i, whose sum is taken by
            # parts, and at most mu2.
            by_parts_m_s += worst_m * (1.0 / to_go_s[i] - 1.0 / last_to_go_s)
            spent_m_s = min(by_parts_m_s, spent_m_s + maximum_m_s)
            middle_m = wider * course.half_width_m[i] + course.later_m[i] + minimum_m_s * to_go_s[i]
            worst_m = min(worst_m, max(middle_m, worst_m - maximum_m_s * to_go_s[i]))
            last_to_go_s = to_go_s[i]
            speed_m_s += maximum_m_s
        speed_m_s += model.disturbance_m_s2 * model.step_s
    return float(worst_m), float(spent_m_s)


def _wider(sensor: BearingSensor, range_m: float, slope: float) -> float:
    """Return how much wider than for small angles the band of an angle can be, up to a slope of the
    line of sight.
    """
    bound = sensor.error_bound(range_m)
    true_rad = math.atan(slope)
    maximum = max(bound, sensor.error_bound(range_m * math.hypot(1.0, slope)))
    seen_rad = math.inf
    for _ in range(MAX_TRIALS):
        # The maximum possible angle depends on the bound at the distances that it allows.
        seen_rad, before_rad = (true_rad + 2.0 * maximum) * (1.0 + ROUNDING), seen_rad
        if seen_rad >= 0.5 * math.pi:
            return math.inf
        if seen_rad == before_rad:
            return math.tan(maximum) / math.tan(bound) / math.cos(seen_rad) ** 2
        maximum = max(maximum, sensor.error_bound(range_m / math.cos(seen_rad)))
    return math.inf
