"""Compiled life of one section: how it starts, is cut, shifted and predicted.

A section is the polygon of all (V, z) that agree with the history, under the hypothesis that the range is
`x = label - e t`. With z = alpha x and V = omega x - e alpha the motion (9) of the paper is z' = V, V' = v_z:
an angle measurement is a band of z, an impulse a shift of V; `chain_steps` does that. Each section is a filter of its
own, a function of its label and the history alone, so a section at a new label is had exactly by replaying the
history: `replay` calls the very functions that carry the stored sections in `section_passes`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from infoset import chain_steps, chains, whole_chains
from infoset._compile import ZERO, allocation_free, entry, inlined
from infoset.chains import REACH, RIGHT
from infoset.section_law import SectionLaw

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

CUT_SLACK = 16.0 * chains.EPSILON
SUM_SLACK = 8.0 * chains.EPSILON
RIGHT_ANGLE = 0.5 * math.pi
ANGLE_SLACK = 1e-12

ANGLE, IMPULSE, PREDICTION, RATE, WIDENING = range(5)
ALIVE = np.iinfo(np.int64).max

# Columns of a section's summary.
LOWER_MISS, UPPER_MISS, Z_LEAST, Z_GREATEST = range(4)
SUMMARY_COLUMNS = 4


class Tape(NamedTuple):
    """The history of one engagement: events, their values, and whether they concern this engagement.

    Parameters
    ----------
    kinds : ndarray of int, shape (>= events,)
        Kinds of the events: `ANGLE`, `IMPULSE`, `PREDICTION`, `RATE` or `WIDENING`.
    values : ndarray, shape (>= events,)
        Measured angles (rad) and rates (rad/s), and impulses (m/s).
    applies : ndarray of bool, shape (>= events,)
        Whether an event concerns this engagement.
    events : int
        Number of events.
    nearest, farthest : float
        Window of labels, m, over which the bands of measured rates are made convex; an empty one, from infinity to
        minus infinity, is that of each label alone.
    """

    kinds: Integers
    values: Floats
    applies: Flags
    events: int
    nearest: float
    farthest: float


NO_WINDOW = (np.inf, -np.inf)
"""No window: each label has rate bands of its own."""


class LastSight(NamedTuple):
    """The last angle measurement of a replayed history, and what has happened since.

    Parameters
    ----------
    known : bool
        Whether an angle was measured; without one the box of the start stands for it.
    alpha : float
        The measured angle, rad.
    steps : int
        Steps since then.
    moved, doubt : float
        Sum of the impulses since, each times the time from the measurement to it, m, and the bound of its error.
    fired : float
        Sum of the moduli of all impulses so far, m/s.
    """

    known: bool
    alpha: float
    steps: int
    moved: float
    doubt: float
    fired: float


@inlined
def range_of(label: float, elapsed: int, law: SectionLaw) -> float:
    """Range of a label after a number of steps."""
    return label - law.closing_speed * (law.step * elapsed)


@inlined
def time_to_go(label: float, elapsed: int, law: SectionLaw) -> float:
    """Time until the range of a label is zero, after a number of steps."""
    return range_of(label, elapsed, law) / law.closing_speed


@allocation_free
def start_section(origins: Floats, rings: Floats, marks: Integers, n: int, label: float, law: SectionLaw) -> None:
    """Write the section at t = 0.

    Notes
    -----
    The rectangle is the paper's (section 4), with V_x taken at whichever end of D makes it larger: the printed
    formula has the lower end always, which is the same whenever z may have either sign.
    """
    x = label
    e = law.closing_speed
    z_least, z_greatest = law.z_least, law.z_greatest
    shift_at_least = shift_at_greatest = 0.0
    lowest, highest = law.vz_least, law.vz_greatest
    if law.rectangle:
        lowest -= max(law.vx_least * z_least, law.vx_greatest * z_least) / x
        highest -= min(law.vx_least * z_greatest, law.vx_greatest * z_greatest) / x
        shift_at_least, shift_at_greatest = -e * math.atan(z_least / x), -e * math.atan(z_greatest / x)
        z_least, z_greatest = math.atan(z_least / x) * x, math.atan(z_greatest / x) * x
    tau = time_to_go(label, ZERO, law)
    chain_steps.start(
        origins,
        rings,
        marks,
        n,
        tau,
        (lowest + shift_at_least, highest + shift_at_least, z_least),
        (lowest + shift_at_greatest, highest + shift_at_greatest, z_greatest),
    )
    if law.half_v_at_start > 0.0:
        chain_steps.spread(origins, n, tau, law.half_v_at_start)


@entry
def steepest_angle(alpha: float, range_m: float, law: SectionLaw) -> float:
    """Greatest |alpha| that a measured angle admits up to a range, rad; a right angle where there is no such bound.

    Notes
    -----
    An error that grows with the distance r = x/cos(alpha) grows with the angle: what is admitted ends at the first s
    with s = |alpha_m| + a + h(x/cos(s)). Three steps toward it from below, and one more as long as the last, which is
    past it if s does not become less there.
    """
    growth = max(law.error_slope, 0.0) * range_m
    least = abs(alpha) + law.error_at_zero_range
    before = angle = least + growth
    for _ in range(3):
        if angle >= RIGHT_ANGLE:
            return RIGHT_ANGLE
        before, angle = angle, least + growth / math.cos(angle)
    angle += (angle - before) + ANGLE_SLACK
    return angle if angle < RIGHT_ANGLE and least + growth / math.cos(angle) <= angle else RIGHT_ANGLE


@inlined
def slope_band(alpha: float, label: float, x: float, law: SectionLaw) -> tuple[float, float]:
    """Least and greatest slope z/x that a measured angle admits for a label at range x."""
    bound = law.error_at_zero_range + law.error_slope * x
    lower, upper = alpha - bound, alpha + bound
    if law.exact_angles and law.error_slope > 0.0:
        # x h(x) is convex then. What is claimed over all labels needs it concave: a chord and a tangent lie above it.
        travelled = label - x
        near, far = max(law.label_least - travelled, 0.0), law.label_greatest - travelled
        steepest = steepest_angle(alpha, far, law)
        # The error is that of the true distance, x/cos(alpha).
        longest = (near + far - near * far / x) / math.cos(steepest) if steepest < RIGHT_ANGLE else np.inf
        half = law.error_at_zero_range + law.error_slope * longest
        half = half / math.cos(steepest) ** 2 if steepest < RIGHT_ANGLE else np.inf
        lower, upper = math.tan(alpha) - half, math.tan(alpha) + half
    elif law.exact_angles:
        lower = math.tan(lower) if lower > -RIGHT_ANGLE else -np.inf
        upper = math.tan(upper) if upper < RIGHT_ANGLE else np.inf
    return lower, upper


@inlined
def measure_section(
    origins: Floats, rings: Floats, marks: Integers, n: int, label: float, elapsed: int, alpha: float, law: SectionLaw
) -> tuple[bool, float]:
    """Cut a section by an angle measurement.

    Returns
    -------
    overlap : float
        Least overlap of the section and the band across either border, m: negative is the distance of a dead one.

    Notes
    -----
    The band is widened by 16 ulp: against extremal noise the truth sits on the border, and rounding must not lose it.
    The ulp is that of what is subtracted to find a height, so it does not shrink with the range.
    """
    x = range_of(label, elapsed, law)
    bound = law.error_at_zero_range + law.error_slope * x
    lower, upper = slope_band(alpha, label, x, law)
    slack = CUT_SLACK * (label * (abs(alpha) + bound) + origins[n, RIGHT, REACH] * (label / law.closing_speed))
    return chain_steps.cut(origins, rings, marks, n, x / law.closing_speed, x * lower - slack, x * upper + slack)


NO_SIGHT = LastSight(False, 0.0, 0, 0.0, 0.0, 0.0)


@inlined
def sight_after(sight: LastSight, kind: int, value: float, applies: bool, law: SectionLaw) -> LastSight:
    """What is known of the last sight after one more event of the history."""
    known, alpha, steps, moved, doubt, fired = sight
    if kind == PREDICTION:
        steps += 1
    elif applies and kind == ANGLE:
        known, alpha, steps, moved, doubt = True, value, 0, 0.0, 0.0
    elif applies and kind == IMPULSE:
        lever, size = law.step * steps, abs(value)
        moved += value * lever
        doubt += size * law.impulse_error * lever
        fired += size
    return LastSight(known, alpha, steps, moved, doubt, fired)


@allocation_free
def last_sight(tape: Tape, law: SectionLaw) -> LastSight:
    """What is known of the last sight after a whole history."""
    sight = NO_SIGHT
    for event in range(tape.events):
        sight = sight_after(sight, tape.kinds[event], tape.values[event], tape.applies[event], law)
    return sight


@allocation_free
def rate_band(
    label: float,
    near_label: float,
    far_label: float,
    elapsed: int,
    omega: float,
    error: float,
    sight: LastSight,
    law: SectionLaw,
) -> tuple[float, float]:
    """Bounds of z + V x_c/e that a measured rate admits, x_c the middle of a window of labels, m.

    On the window the lower bound is convex in the label and the upper one concave: sets that are cut by it are convex
    in (z, V, label) there, which those cut by the bands of single labels are not.

    Notes
    -----
    What is measured is (V_z x - V_x z)/(x^2 + z^2), less than the model's V/x + e z/x^2 by the square of cos(alpha).
    With z_j = alpha_j x_j at the last measured angle, and what was fired since, the predicted miss m = z + V x/e
    gives V = (e/x_j)(m - alpha_j x_j - moved), so that

        z + V x_c/e = m x_jc/x_j + (x - x_c) (alpha_j + moved/x_j).

    m x_jc/x_j is within omega -+ error times x^2 x_jc/(e x_j), a convex function of x: where it bounds on the wrong
    side its chord does. alpha_j is known to within its band, which bounds the second term. See docs/guarantee.md.
    """
    e = law.closing_speed
    travelled = label - range_of(label, elapsed, law)
    x, near, far = label - travelled, near_label - travelled, far_label - travelled
    ago = law.step * sight.steps
    then = e * ago
    near_then, far_then = near + then, far + then
    if sight.known:
        least_near, greatest_near = slope_band(sight.alpha, near_label, near_then, law)
        least_far, greatest_far = slope_band(sight.alpha, far_label, far_then, law)
    else:
        least_near, greatest_near = law.z_least / near_then, law.z_greatest / near_then
        least_far, greatest_far = law.z_least / far_then, law.z_greatest / far_then
    least, greatest = min(least_near, least_far), max(greatest_near, greatest_far)
    if not (least > -np.inf and greatest < np.inf):
        return -np.inf, np.inf
    steepest = max(abs(least), abs(greatest))
    if sight.steps > 0:
        fastest = max(abs(law.vz_least), abs(law.vz_greatest)) + sight.fired * (1.0 + law.impulse_error)
        fastest += law.disturbance * (law.step * elapsed)
        if near <= 0.0:
            return -np.inf, np.inf
        steepest = (steepest * far_then + fastest * ago) / near
        doubt = sight.doubt + 0.5 * law.disturbance * ago * ago
        least += min((sight.moved - doubt) / near_then, (sight.moved - doubt) / far_then)
        greatest += max((sight.moved + doubt) / near_then, (sight.moved + doubt) / far_then)
    widest = 1.0 + steepest * steepest if law.exact_angles else 1.0
    lower, upper = omega - error, omega + error
    lower *= widest if lower < 0.0 else 1.0
    upper *= widest if upper > 0.0 else 1.0
    middle = 0.5 * (near + far)
    curve = scaled_square(x, middle, then) / e
    chord = curve
    if far > near:
        at_near, at_far = scaled_square(near, middle, then) / e, scaled_square(far, middle, then) / e
        chord = at_near + (at_far - at_near) * ((x - near) / (far - near))
    turn = 0.5 * (least + greatest) * (x - middle)
    room = 0.5 * (greatest - least) * (0.5 * (far - near))
    return (
        lower * (chord if lower < 0.0 else curve) + turn - room,
        upper * (chord if upper > 0.0 else curve) + turn + room,
    )


@inlined
def scaled_square(x: float, middle: float, then: float) -> float:
    """Square of a range x times x_jc/x_j: as `then` was added to both since."""
    return x * (middle + then) * (x / (x + then) if then > 0.0 else 1.0)


@allocation_free
def measure_rate_section(
    origins: Floats,
    rings: Floats,
    marks: Integers,
    n: int,
    label: float,
    elapsed: int,
    omega: float,
    error: float,
    sight: LastSight,
    window: tuple[float, float],
    law: SectionLaw,
    points: Floats,
) -> tuple[bool, float]:
    """Cut a section by a measurement of the line of sight's rate: a band of the predicted miss, omega x^2 / e.

    Returns
    -------
    overlap : float
        As `measure_section` returns it, in metres of predicted miss.
    """
    if whole_chains.is_crowded(marks, n):
        whole_chains.reduce_outward(origins, rings, marks, n, time_to_go(label, elapsed, law), points)
    near, far = min(label, window[0]), max(label, window[1])
    lower, upper = rate_band(label, near, far, elapsed, omega, error, sight, law)
    # The band is one of z + V x_c/e, and `tilt` is (x_c - x)/e.
    tau, tilt = time_to_go(label, elapsed, law), (0.5 * (near + far) - label) / law.closing_speed
    slack = CUT_SLACK * (label * (abs(omega) + error) + origins[n, RIGHT, REACH]) * (label / law.closing_speed)
    # The next step's half of the disturbance is in the section already, and it does not commute with this band.
    slack += (tau + tilt) * law.half_v_at_start
    return whole_chains.cut_misses(origins, rings, marks, n, tau, tilt, lower - slack, upper + slack, points)


@inlined
def widen_section(origins: Floats, n: int, label: float, elapsed: int, law: SectionLaw) -> None:
    """Widen a section by what one angle measurement may err, b: by e b in V, which is x b in the predicted miss."""
    x = range_of(label, elapsed, law)
    bound = law.error_at_zero_range + law.error_slope * x
    chain_steps.spread(origins, n, x / law.closing_speed, law.closing_speed * bound)


@inlined
def shift_section(origins: Floats, n: int, label: float, elapsed: int, impulse: float, law: SectionLaw) -> None:
    """Shift a section by an impulse: V becomes V - k, for every k that the commanded one may have been."""
    tau = time_to_go(label, elapsed, law)
    chain_steps.shift(origins, n, tau, -impulse)
    if law.impulse_error > 0.0:
        chain_steps.spread(origins, n, tau, abs(impulse) * law.impulse_error)


@inlined
def predict_section(
    origins: Floats, rings: Floats, marks: Integers, n: int, label: float, elapsed: int, law: SectionLaw
) -> None:
    """Move a section on to step `elapsed`: time to go falls, and the disturbance adds its segment, 8 ulp longer."""
    tau = time_to_go(label, elapsed, law)
    chain_steps.turn(origins, rings, marks, n, tau + law.disturbance_lead)
    chain_steps.spread(origins, n, tau + law.disturbance_lead, law.half_v + SUM_SLACK * origins[n, RIGHT, REACH])
    if law.disturbance_lead > 0.0:
        chain_steps.turn(origins, rings, marks, n, tau)


@inlined
def summarise_section(
    origins: Floats,
    rings: Floats,
    marks: Integers,
    n: int,
    label: float,
    elapsed: int,
    law: SectionLaw,
    summaries: Floats,
    b: int,
    s: int,
) -> None:
    """Write the extremes of the predicted miss (13), (14) of a section: those of z + V x/e -+ nu/2 (x/e)^2."""
    tau = time_to_go(label, elapsed, law)
    upper, lower = chain_steps.greatest_and_least_miss(origins, rings, marks, n, tau)
    drift = 0.5 * law.disturbance * tau * tau
    summaries[b, s, UPPER_MISS] = upper + drift
    summaries[b, s, LOWER_MISS] = lower - drift


@allocation_free
def replay(
    label: float,
    tape: Tape,
    errors: Floats | None,
    law: SectionLaw,
    origins: Floats,
    rings: Floats,
    marks: Integers,
    n: int,
    overlaps: Floats,
    points: Floats,
) -> int:
    """Carry the section at any label through a whole history.

    Parameters
    ----------
    label : float
        Range at t = 0 of the hypothesis, m.
    tape : Tape
        The history.
    errors : ndarray, shape (>= events,), or None
        Error bound of each rate; None where there is none. It stands apart, since only an argument that is None lets
        the compiler leave out the code for rates.
    law : SectionLaw
        The numbers of the model.
    origins, rings, marks, n : section
        Where it goes.
    overlaps : ndarray, shape (>= events,)
        Receives the overlap with the band of each angle measurement that the section lived to see.
    points : ndarray, shape (CAPACITY, 2)
        Room to work in.

    Returns
    -------
    int
        The event that killed it, or ALIVE.

    Notes
    -----
    Some 30 ns an event.
    """
    kinds, values, applies, events, nearest, farthest = tape
    window = nearest, farthest
    start_section(origins, rings, marks, n, label, law)
    elapsed = ZERO
    sight = NO_SIGHT
    for event in range(events):
        if kinds[event] == PREDICTION:
            if whole_chains.is_crowded(marks, n):
                whole_chains.reduce_outward(origins, rings, marks, n, time_to_go(label, elapsed, law), points)
            elapsed += 1
            predict_section(origins, rings, marks, n, label, elapsed, law)
        elif not applies[event]:
            continue
        elif kinds[event] == ANGLE:
            living, overlaps[event] = measure_section(origins, rings, marks, n, label, elapsed, values[event], law)
            if not living:
                return event
        elif kinds[event] == IMPULSE:
            shift_section(origins, n, label, elapsed, values[event], law)
        elif kinds[event] == WIDENING:
            widen_section(origins, n, label, elapsed, law)
        elif errors is not None:
            # Compiled only for a history that has rates: this branch would be the greater part of the work.
            living, overlaps[event] = measure_rate_section(
                origins, rings, marks, n, label, elapsed, values[event], errors[event], sight, window, law, points
            )
            if not living:
                return event
        if errors is not None:
            sight = sight_after(sight, kinds[event], values[event], applies[event], law)
    return ALIVE
