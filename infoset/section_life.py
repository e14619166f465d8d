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
from infoset._compile import ZERO, allocation_free, compiled, entry, inlined, substituted
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
    """The history of one engagement: what happened, the value, and whether it concerned this one.

    Parameters
    ----------
    kinds : ndarray of int, shape (>= events,)
    values : ndarray, shape (>= events,)
    applies : ndarray of bool, shape (>= events,)
    events : int
        Number of events.
    """

    kinds: Integers
    values: Floats
    applies: Flags
    events: int


@substituted
def range_of(label: float, elapsed: int, law: SectionLaw) -> float:
    """Range of a label after a number of steps."""
    return label - law.closing_speed * (law.step * elapsed)


@substituted
def time_to_go(label: float, elapsed: int, law: SectionLaw) -> float:
    """Time until the range of a label is zero, after a number of steps."""
    return range_of(label, elapsed, law) / law.closing_speed


@entry
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
    tau = time_to_go(label, 0, law)
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


@compiled
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
def measure_section(
    origins: Floats, rings: Floats, marks: Integers, n: int, label: float, elapsed: int, alpha: float, law: SectionLaw
) -> tuple[bool, float]:
    """Cut a section by an angle measurement.

    Returns
    -------
    living : bool
    overlap : float
        Least overlap of the section and the band across either border, m: negative is the distance of a dead one.

    Notes
    -----
    The band is widened by 16 ulp: against extremal noise the truth sits on the border, and rounding must not lose it.
    The ulp is that of what is subtracted to find a height, so it does not shrink with the range.
    """
    x = range_of(label, elapsed, law)
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
    slack = CUT_SLACK * (label * (abs(alpha) + bound) + origins[n, RIGHT, REACH] * (label / law.closing_speed))
    return chain_steps.cut(origins, rings, marks, n, x / law.closing_speed, x * lower - slack, x * upper + slack)


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
    law: SectionLaw,
    points: Floats,
) -> tuple[bool, float]:
    """Cut a section by a measurement of the line of sight's rate: a band of the predicted miss, omega x^2 / e.

    Notes
    -----
    What is measured is (V_z x - V_x z)/(x^2 + z^2), less than the model's V/x + e z/x^2 by the square of cos(alpha).
    """
    if whole_chains.is_crowded(marks, n):
        whole_chains.reduce_outward(origins, rings, marks, n, time_to_go(label, elapsed, law), points)
    x = range_of(label, elapsed, law)
    tau = x / law.closing_speed
    lower, upper = omega - error, omega + error
    if law.exact_angles:
        least, greatest = chain_steps.heights(origins, rings, marks, n, tau)
        widest = 1.0 + (max(abs(least), abs(greatest)) / x) ** 2
        lower *= widest if lower < 0.0 else 1.0
        upper *= widest if upper > 0.0 else 1.0
    slack = CUT_SLACK * (label * (abs(omega) + error) + origins[n, RIGHT, REACH]) * (label / law.closing_speed)
    # The next step's half of the disturbance is in the section already, and it does not commute with this band.
    slack += tau * law.half_v_at_start
    return whole_chains.cut_misses(
        origins, rings, marks, n, tau, tau * x * lower - slack, tau * x * upper + slack, points
    )


@inlined
def widen_section(origins: Floats, n: int, label: float, elapsed: int, law: SectionLaw) -> None:
    """Widen a section by what one angle measurement may err, b: by e b in V, which is x b in the predicted miss."""
    x = range_of(label, elapsed, law)
    bound = law.error_at_zero_range + law.error_slope * x
    chain_steps.spread(origins, n, x / law.closing_speed, law.closing_speed * bound)


@substituted
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


@entry
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
    kinds, values, applies, events = tape
    start_section(origins, rings, marks, n, label, law)
    elapsed = ZERO
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
                origins, rings, marks, n, label, elapsed, values[event], errors[event], law, points
            )
            if not living:
                return event
    return ALIVE
