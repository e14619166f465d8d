"""Compiled operations on one section: start, measurements, shift, prediction and summary.

A section is the polygon of all (V, z) that agree with the history under the hypothesis that the range is
x = label - e t. With z = alpha x and V = omega x - e alpha, the motion (9) of the paper is z' = V, V' = v_z: an angle
measurement is a band of z, and an impulse is a shift of V. A section depends only on its label and on the history.
Therefore `replays` computes the section at any label exactly, with the functions that update the stored sections in
`section_passes`. Numbers of equations, lemmas and assumptions are those of docs/guarantee.md, unless they are of the
paper.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from infoset._compile import ZERO, allocation_free, inlined
from infoset.arrays import Floats
from infoset.engine import chains
from infoset.engine.chains import SectionView
from infoset.engine.history import ANGLE, IMPULSE, PREDICTION, LastSight
from infoset.engine.section_law import SectionLaw

CUT_SLACK = 16.0 * chains.EPSILON
"""Enlargement of a cut, in the terms whose difference is a height. With 4 ulp no set of 60 runs of 190 cuts by errors
of random sign at their bounds was lost; with none, 33 were."""
SUM_SLACK = 8.0 * chains.EPSILON
"""Enlargement of a sum with a segment, in the bound of |V|: several times the rounding error of the sum."""
RIGHT_ANGLE = 0.5 * math.pi
ANGLE_SLACK = 1e-12
"""Added to an angle of about 1 rad, whose iteration has rounding errors of some 1e-16 rad."""

ALIVE = np.iinfo(np.int64).max

# Columns of a section's summary.
LOWER_MISS, UPPER_MISS, Z_MIN, Z_MAX = range(4)
SUMMARY_COLUMNS = 4


@inlined
def range_of(label: float, elapsed: int, law: SectionLaw) -> float:
    """Range of a label after a number of steps, (1): x = label - e t."""
    return label - law.closing_speed * (law.step * elapsed)


@inlined
def time_to_go(label: float, elapsed: int, law: SectionLaw) -> float:
    """Time until the range of a label is zero, after a number of steps: x/e."""
    return range_of(label, elapsed, law) / law.closing_speed


@allocation_free
def start_section(section: SectionView, law: SectionLaw) -> None:
    """Write the section at t = 0: the box of part 1 of Lemma 1, or the rectangle, with half a disturbance of Lemma 3.

    The rectangle is that of the paper (section 4), but with V_x at the end of its interval that makes the rectangle
    larger. The printed formula always takes the lower end; both agree if z can have either sign.
    """
    x, e = section.label, law.closing_speed
    z_min, z_max = law.z_min, law.z_max
    shift_at_min = shift_at_max = 0.0
    lowest, highest = law.vz_min, law.vz_max
    if law.rectangle:
        lowest -= max(law.vx_min * z_min, law.vx_max * z_min) / x
        highest -= min(law.vx_min * z_max, law.vx_max * z_max) / x
        shift_at_min, shift_at_max = -e * math.atan(z_min / x), -e * math.atan(z_max / x)
        z_min, z_max = math.atan(z_min / x) * x, math.atan(z_max / x) * x
    tau = time_to_go(x, ZERO, law)
    chains.start(
        section,
        tau,
        (lowest + shift_at_min, highest + shift_at_min, z_min),
        (lowest + shift_at_max, highest + shift_at_max, z_max),
    )
    if law.half_v_at_start > 0.0:
        chains.spread(section, tau, law.half_v_at_start)


@inlined
def nearest_range(travelled: float, law: SectionLaw) -> float:
    """Return the minimum range of a label in the set after the range has decreased by `travelled`, m."""
    return max(law.label_min - travelled, law.min_range)


@allocation_free
def steepest_angles(alpha: float, across: float, range_m: float, law: SectionLaw) -> tuple[float, float]:
    """Return the maximum sizes of two measured angles, rad, that agree with the measurements up to a range.

    The solution s of Assumption 5 for both axes, with the distances (14). `alpha` and `across` are the measured angles
    of this axis and of the other one. The distance is at most x/(cos(own) cos(other)). If one of the angles is
    unbounded, the first is pi/2 and the second zero.

    The bound of a camera is largest at the minimum distance, that of the nearest label. Another error bound that grows
    with the distance r grows with the angles: in a plane r = x/cos(alpha), in space r is at most x/(cos(alpha_y)
    cos(alpha_z)). The maximum angles are the minimum solution of s = |alpha_m| + a + h(r(s)). Three fixed-point
    iterations approach it from below; a fourth step of the length of the third passes it if the right-hand side does
    not exceed s there.
    """
    growth, other_growth = max(law.error_slope, 0.0) * range_m, max(law.other_error_slope, 0.0) * range_m
    centroid = 0.0
    if law.centroid_error > 0.0:
        centroid = law.centroid_error / nearest_range(law.label_max - range_m, law)
    minimum = abs(alpha) + law.error_at_zero_range + centroid
    other_min = abs(across) + law.other_error_at_zero_range + centroid
    before = own = minimum + growth
    other_before = other = other_min + other_growth
    for _ in range(3):
        if own >= RIGHT_ANGLE or other >= RIGHT_ANGLE:
            return RIGHT_ANGLE, 0.0
        cosine, other_cosine = math.cos(own), math.cos(other)
        before, own = own, minimum + growth / cosine / other_cosine
        other_before, other = other, other_min + other_growth / cosine / other_cosine
    own += (own - before) + ANGLE_SLACK
    other += (other - other_before) + ANGLE_SLACK
    if own >= RIGHT_ANGLE or other >= RIGHT_ANGLE:
        return RIGHT_ANGLE, 0.0
    cosine, other_cosine = math.cos(own), math.cos(other)
    passed = minimum + growth / cosine / other_cosine <= own
    if passed and other_min + other_growth / cosine / other_cosine <= other:
        return own, other
    return RIGHT_ANGLE, 0.0


@inlined
def slope_band(alpha: float, across: float, travelled: float, x: float, law: SectionLaw) -> tuple[float, float]:
    """Return the minimum and the maximum slope z/x that agree with measured angles, at range x.

    By (8), the tangents of alpha -+ b(x), with the error bound b(x) of the label: part 4 of Lemma 1. The paper's model
    takes the angles in place of their tangents. `alpha` and `across` are the angles of this axis and of the other one,
    rad. `travelled` is the decrease of the range since the start, m, the same for all labels.
    """
    if law.linear_band:
        return linear_slope_band(alpha, across, travelled, x, law)
    bound = law.error_at_zero_range + law.error_slope * x
    lower, upper = alpha - bound, alpha + bound
    if law.exact_angles:
        lower = math.tan(lower) if lower > -RIGHT_ANGLE else -np.inf
        upper = math.tan(upper) if upper < RIGHT_ANGLE else np.inf
    return lower, upper


@allocation_free
def linear_slope_band(alpha: float, across: float, travelled: float, x: float, law: SectionLaw) -> tuple[float, float]:
    """Return what `slope_band` does for an error bound that rises with the range, or that of a camera: (21).

    Bounds over all labels need an upper bound whose product with x is a concave function of x. Therefore these two
    error bounds have a wider band, whose product with x is linear. If the bound h(x) rises with range, x h(x) is
    convex: a chord and a tangent are above it. With the bound p + c/x of a camera, x tan(alpha + p + c/x) is convex: a
    tangent in the angle, with the slope at the steepest angle of all labels, is above it.
    """
    bound = law.error_at_zero_range + law.error_slope * x
    if law.centroid_error > 0.0 and x > 0.0:
        bound += law.centroid_error / x
    if not law.exact_angles:
        return alpha - bound, alpha + bound
    far = law.label_max - travelled
    own, other = steepest_angles(alpha, across, far, law)
    if own >= RIGHT_ANGLE:
        return -np.inf, np.inf
    cosine = math.cos(own)
    if law.error_slope > 0.0:
        near = max(law.label_min - travelled, 0.0)
        # The error bound depends on the true distance, at most x/(cos(own) cos(other)).
        bound = law.error_at_zero_range + law.error_slope * ((near + far - near * far / x) / cosine / math.cos(other))
    bound = bound / cosine**2
    return math.tan(alpha) - bound, math.tan(alpha) + bound


@inlined
def measure_section(
    section: SectionView, elapsed: int, alpha: float, across: float, law: SectionLaw
) -> tuple[bool, float]:
    """Cut a section by an angle measurement; return what `chains.cut` does. `across` is the angle of the other axis.

    By (8), z lies between x tan(alpha - b) and x tan(alpha + b), with the error bound b of the angle at range x. The
    band is widened by 16 ulp, so that rounding does not exclude true states on the border, which extremal noise
    produces. The ulp is that of the terms of a height and does not decrease with the range.
    """
    label = section.label
    x = range_of(label, elapsed, law)
    bound = law.error_at_zero_range + law.error_slope * x
    lower, upper = slope_band(alpha, across, law.closing_speed * (law.step * elapsed), x, law)
    slack = CUT_SLACK * (label * (abs(alpha) + bound) + section.right.reach * (label / law.closing_speed))
    return chains.cut(section, x / law.closing_speed, x * lower - slack, x * upper + slack)


@inlined
def sight_after(
    sight: LastSight, kind: int, value: float, other_value: float, applies: bool, law: SectionLaw
) -> LastSight:
    """Return the last sight after one more event of the history."""
    known, alpha, across, steps, moved, doubt, fired = sight
    if kind == PREDICTION:
        steps += 1
    elif applies and kind == ANGLE:
        known, alpha, across, steps, moved, doubt = True, value, other_value, 0, 0.0, 0.0
    elif applies and kind == IMPULSE:
        lever = law.step * steps
        moved += value * lever
        doubt += impulse_doubt(value, other_value, law) * lever
        fired += abs(value) + pointing_doubt(value, other_value, law)
    return LastSight(known, alpha, across, steps, moved, doubt, fired)


@inlined
def pointing_doubt(impulse: float, across: float, law: SectionLaw) -> float:
    """Return the second term of (15), the error of an impulse by the direction of the engine, m/s.

    `across` is the impulse along the other axis.
    """
    if law.pointing_across == 0.0:
        return 0.0
    return law.pointing_along * abs(impulse) + law.pointing_across * math.hypot(impulse, across)


@inlined
def impulse_doubt(impulse: float, across: float, law: SectionLaw) -> float:
    """Return the error bound of an impulse along an axis, m/s: (2), in space (15); `across` is along the other axis."""
    return abs(impulse) * law.impulse_error + pointing_doubt(impulse, across, law)


@inlined
def across_of(values: Floats, i: int, law: SectionLaw) -> float:
    """Return the value with number `i` along the other axis, of values of shape (C, N); zero in a plane."""
    return values[law.other, i] if law.other >= 0 else 0.0


class Rate(NamedTuple):
    """A measured rate of the line of sight along one axis.

    Parameters
    ----------
    omega, error : float
        The rate and its error bound, rad/s.
    sight : LastSight
        The last angle before it.
    nearest, farthest : float
        Window of labels, m, over which the band is convex. The empty window, from infinity to minus infinity, makes the
        window of each label the label itself.
    """

    omega: float
    error: float
    sight: LastSight
    nearest: float
    farthest: float


@allocation_free
def rate_band(label: float, elapsed: int, rate: Rate, law: SectionLaw) -> tuple[float, float]:
    """Return the bounds of z + V x_c/e, m, that agree with a measured rate; x_c is the middle of a window of labels.

    On the window the lower bound is a convex function of the label and the upper one is concave. Sets that are cut by
    this band are convex in (z, V, label) on the window; sets that are cut by the exact bands of the labels are not.

    The measured rate is (V_z x - V_x z)/(x^2 + z^2): the model's V/x + e z/x^2 times the square of cos(alpha). With
    z_j = alpha_j x_j at the last measured angle and the impulses since, the predicted miss m = z + V x/e gives
    V = (e/x_j)(m - alpha_j x_j - moved), so that

        z + V x_c/e = m x_jc/x_j + (x - x_c) (alpha_j + moved/x_j).

    m x_jc/x_j lies between (omega -+ error) times x^2 x_jc/(e x_j), a convex function of x. Its chord replaces it in
    the bound that needs a concave function. The band of alpha_j bounds the second term: (9), (13), Lemma 9.
    """
    e, omega, error, sight = law.closing_speed, rate.omega, rate.error, rate.sight
    travelled = label - range_of(label, elapsed, law)
    x, near, far = label - travelled, min(label, rate.nearest) - travelled, max(label, rate.farthest) - travelled
    ago = law.step * sight.steps
    then = e * ago
    near_then, far_then = near + then, far + then
    if sight.known:
        min_near, max_near = slope_band(sight.alpha, sight.across, travelled - then, near_then, law)
        min_far, max_far = slope_band(sight.alpha, sight.across, travelled - then, far_then, law)
    else:
        min_near, max_near = law.z_min / near_then, law.z_max / near_then
        min_far, max_far = law.z_min / far_then, law.z_max / far_then
    minimum, maximum = min(min_near, min_far), max(max_near, max_far)
    if not (minimum > -np.inf and maximum < np.inf):
        return -np.inf, np.inf
    steepest = max(abs(minimum), abs(maximum))
    if sight.steps > 0:
        fastest = max(abs(law.vz_min), abs(law.vz_max)) + sight.fired * (1.0 + law.impulse_error)
        fastest += law.disturbance * (law.step * elapsed)
        if near <= 0.0:
            return -np.inf, np.inf
        steepest = (steepest * far_then + fastest * ago) / near
        doubt = sight.doubt + 0.5 * law.disturbance * ago * ago
        minimum += min((sight.moved - doubt) / near_then, (sight.moved - doubt) / far_then)
        maximum += max((sight.moved + doubt) / near_then, (sight.moved + doubt) / far_then)
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
    turn = 0.5 * (minimum + maximum) * (x - middle)
    room = 0.5 * (maximum - minimum) * (0.5 * (far - near))
    return (
        lower * (chord if lower < 0.0 else curve) + turn - room,
        upper * (chord if upper > 0.0 else curve) + turn + room,
    )


@inlined
def scaled_square(x: float, middle: float, then: float) -> float:
    """Return x^2 x_jc/x_j, where x_j = x + `then` and x_jc = `middle` + `then`."""
    return x * (middle + then) * (x / (x + then) if then > 0.0 else 1.0)


@allocation_free
def measure_rate_section(
    section: SectionView, elapsed: int, rate: Rate, law: SectionLaw, points: Floats
) -> tuple[bool, float]:
    """Cut a section by a line-of-sight rate: by (9), a band of the predicted miss omega x^2 / e.

    Return what `chains.cut` does, with the overlap in metres of predicted miss.
    """
    label = section.label
    near, far = min(label, rate.nearest), max(label, rate.farthest)
    lower, upper = rate_band(label, elapsed, rate, law)
    # The band bounds z + V x_c/e = m + V tilt.
    tau, tilt = time_to_go(label, elapsed, law), (0.5 * (near + far) - label) / law.closing_speed
    if chains.is_crowded(section):
        chains.reduce_outward(section, tau, points)
    slack = CUT_SLACK * (label * (abs(rate.omega) + rate.error) + section.right.reach) * (label / law.closing_speed)
    # The section already contains the first half of the next step's disturbance, which does not commute with the cut.
    slack += (tau + tilt) * law.half_v_at_start
    return chains.cut_misses(section, tau, tilt, lower - slack, upper + slack, points)


@inlined
def widen_section(section: SectionView, elapsed: int, law: SectionLaw) -> None:
    """Enlarge a section by the error bound b of one angle measurement: by e b in V, or x b in the predicted miss."""
    x = range_of(section.label, elapsed, law)
    bound = law.error_at_zero_range + law.error_slope * x + law.centroid_error / x
    chains.spread(section, x / law.closing_speed, law.closing_speed * bound)


@inlined
def shift_section(section: SectionView, elapsed: int, impulse: float, across: float, law: SectionLaw) -> None:
    """Shift a section by an impulse k: V becomes V - k, and is widened by the error bound of k, (2) or (15).

    `across` is the impulse along the other axis.
    """
    tau, doubt = time_to_go(section.label, elapsed, law), impulse_doubt(impulse, across, law)
    chains.shift(section, tau, -impulse)
    if law.impulse_error > 0.0 or law.pointing_across > 0.0:
        chains.spread(section, tau, doubt)


@inlined
def predict_section(section: SectionView, elapsed: int, law: SectionLaw) -> None:
    """Move a section to step `elapsed`: the level turns, and the segment of the disturbance, 8 ulp longer, is added.

    By Lemma 3, the segment is nu times the step in V, with both halves of adjacent steps.
    """
    tau = time_to_go(section.label, elapsed, law)
    chains.turn(section, tau + law.disturbance_lead)
    chains.spread(section, tau + law.disturbance_lead, law.half_v + SUM_SLACK * section.right.reach)
    if law.disturbance_lead > 0.0:
        chains.turn(section, tau)


@inlined
def summarise_section(section: SectionView, elapsed: int, law: SectionLaw, summaries: Floats, b: int, s: int) -> None:
    """Write the extremes (13), (14) of the paper: those of the predicted miss z + V x/e -+ nu/2 (x/e)^2 of a section.

    `summaries` has the shape (C, B, S, columns).
    """
    tau = time_to_go(section.label, elapsed, law)
    upper, lower = chains.max_and_min_miss(section, tau)
    drift = 0.5 * law.disturbance * tau * tau
    summaries[law.channel, b, s, UPPER_MISS] = upper + drift
    summaries[law.channel, b, s, LOWER_MISS] = lower - drift
