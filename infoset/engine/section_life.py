"""Compiled operations on one section: start, measurements, shift, prediction and summary.

A section is the polygon of all (V, z) that agree with the history under the hypothesis that the
range is x = label - e t. With z = alpha x and V = omega x - e alpha, the motion (9) of the paper is
z' = V, V' = v_z: an angle measurement is a band of z, and an impulse is a shift of V. A section
depends only on its label and on the history. Therefore `replays` computes the section at any label
exactly, with the functions that update the stored sections in `section_passes`. Numbers of
equations, lemmas and assumptions are those of docs/guarantee.md and, from (15) on, of
docs/guarantee-space.md, unless they are of the paper.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from infoset._compile import ZERO, allocation_free, inlined
from infoset.arrays import Floats
from infoset.engine import chains
from infoset.engine.chains import SectionView
from infoset.engine.history import ANGLE, IMPULSE, PREDICTION, WIDENING, LastSight
from infoset.engine.section_law import SectionLaw

CUT_SLACK = 16.0 * chains.EPSILON
"""Enlargement of a cut, in the terms whose difference is a height. With 4 ulp no set of 60 runs of
190 cuts by errors of random sign at their bounds was lost; with none, 33 were."""
SUM_SLACK = 8.0 * chains.EPSILON
"""Enlargement of a sum with a segment, relative to the bound of |V|: several times the rounding
error of the sum."""
RIGHT_ANGLE = 0.5 * math.pi
ANGLE_SLACK = 1e-12
"""Added to an angle of about 1 rad, whose iteration has rounding errors of some 1e-16 rad."""

NEVER_EMPTIED = np.iinfo(np.int64).max
"""Event at which a feasible label became empty: after all others."""

# Columns of a section's summary; `widest_all` needs UPPER_MISS after LOWER_MISS.
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
def start_section(section: SectionView, room: float, law: SectionLaw) -> None:
    """Write the section at t = 0: the box of part 1 of Lemma 1, or the rectangle, with half a
    disturbance of Lemma 3.

    Both are enlarged by `room` along z, m: zero for a single label, for the middle of a window the
    bound by which z differs between the labels of the window and the middle.

    The rectangle is the one of the paper (section 4), but with V_x at the end of its interval that
    makes the rectangle larger. The printed formula always takes the lower end; both agree if z can
    have either sign.
    """
    x = section.label
    e = law.closing_speed
    z_min = law.z_min
    z_max = law.z_max
    lowest = law.vz_min
    highest = law.vz_max
    shift_at_min = 0.0
    shift_at_max = 0.0
    if law.rectangle:
        lowest -= max(law.vx_min * z_min, law.vx_max * z_min) / x
        highest -= min(law.vx_min * z_max, law.vx_max * z_max) / x
        # V = omega x - e alpha: the shift is that of the second term, at both ends of alpha.
        shift_at_min = -e * math.atan(z_min / x)
        shift_at_max = -e * math.atan(z_max / x)
        z_min = math.atan(z_min / x) * x
        z_max = math.atan(z_max / x) * x

    tau = time_to_go(x, ZERO, law)
    bottom = (lowest + shift_at_min, highest + shift_at_min, z_min - room)
    top = (lowest + shift_at_max, highest + shift_at_max, z_max + room)
    chains.start(section, tau, bottom, top)
    if law.half_v_at_start > 0.0:
        chains.spread(section, tau, law.half_v_at_start)


@inlined
def nearest_range(travelled: float, law: SectionLaw) -> float:
    """Return the minimum range of a label, m, after the range has decreased by `travelled`, m."""
    return max(law.label_min - travelled, law.min_range)


@allocation_free
def steepest_angles(
    alpha: float, across: float, range_m: float, law: SectionLaw
) -> tuple[float, float]:
    """Return the maximum sizes of two angles, rad, that agree with their measurements up to a
    range.

    The solution s of Assumption 5 for both axes, with the distances (14). `alpha` and `across` are
    the measured angles of this axis and of the other one. `range_m` must be the range of the
    farthest label: the range of the nearest one follows from it. The distance is at most
    x/(cos(own) cos(other)). If one of the angles is unbounded, the first result is pi/2 and the
    second zero.

    The bound of a camera is largest at the minimum distance, which the nearest label has, and so is
    the angle between the centre and a point beside it that the images show. The slopes that a
    misaligned camera shows differ by its misalignment. An error bound that grows with the distance
    r grows with the angles: in a plane r = x/cos(alpha), in space r is at most x/(cos(alpha_y)
    cos(alpha_z)). The maximum angles are the minimum solution of s = |alpha_m| + a + h(r(s)). Three
    fixed-point iterations approach it from below; a fourth step of the length of the third passes
    it if the right-hand side does not exceed s there.
    """
    growth = max(law.error_slope, 0.0) * range_m
    other_growth = max(law.other_error_slope, 0.0) * range_m
    centroid = 0.0
    other_centroid = 0.0
    if law.linear_band:
        nearest = nearest_range(law.label_max - range_m, law)
        centroid = (law.centroid_error + law.farthest_shift) / nearest
        other_centroid = (law.other_centroid_error + law.farthest_shift) / nearest
    minimum = abs(alpha) + law.error_at_zero_range + centroid + law.misalignment
    other_min = abs(across) + law.other_error_at_zero_range + other_centroid + law.misalignment

    own = minimum + growth
    other = other_min + other_growth
    before = own
    other_before = other
    for _ in range(3):
        if own >= RIGHT_ANGLE or other >= RIGHT_ANGLE:
            return RIGHT_ANGLE, 0.0
        cosine = math.cos(own)
        other_cosine = math.cos(other)
        before = own
        own = minimum + growth / cosine / other_cosine
        other_before = other
        other = other_min + other_growth / cosine / other_cosine

    own += (own - before) + ANGLE_SLACK
    other += (other - other_before) + ANGLE_SLACK
    if own >= RIGHT_ANGLE or other >= RIGHT_ANGLE:
        return RIGHT_ANGLE, 0.0
    cosine = math.cos(own)
    other_cosine = math.cos(other)
    has_passed = minimum + growth / cosine / other_cosine <= own
    if has_passed and other_min + other_growth / cosine / other_cosine <= other:
        return own, other
    return RIGHT_ANGLE, 0.0


@inlined
def slope_band(
    alpha: float, across: float, travelled: float, x: float, law: SectionLaw
) -> tuple[float, float]:
    """Return the minimum and the maximum slope z/x that agree with measured angles, at range x.

    By (8) they are the tangents of alpha -+ b(x), where b(x) is the error bound of the label (Lemma
    1, part 4); infinite beyond a right angle, and lower > upper (an empty band) where b < 0. The
    paper's model takes the angles in place of their tangents. `law.linear_band` takes
    `linear_slope_band`: in the guaranteed model the wider band (21), in the paper's model alpha -
    o/x -+ b(x) with the centroid error and the offset o of a camera. Only (21) uses `across` and
    `travelled`.

    `alpha` and `across` are the angles of this axis and of the other one, rad. `travelled` is the
    decrease of the range since the start, m, the same for all labels.
    """
    if law.linear_band:
        return linear_slope_band(alpha, across, travelled, x, law)
    bound = law.error_at_zero_range + law.error_slope * x
    lower = alpha - bound
    upper = alpha + bound
    if law.exact_angles:
        lower = math.tan(lower) if lower > -RIGHT_ANGLE else -np.inf
        upper = math.tan(upper) if upper < RIGHT_ANGLE else np.inf
    return lower, upper


@allocation_free
def linear_slope_band(
    alpha: float, across: float, travelled: float, x: float, law: SectionLaw
) -> tuple[float, float]:
    """Return the band of `slope_band` for an error bound that rises with the range, or for a
    camera: (21).

    Bounds over all labels need an upper bound whose product with x is a concave function of x.
    Therefore these two error bounds have a wider band, whose product with x is linear. If the bound
    h(x) rises with range, x h(x) is convex: a chord and a tangent are above it. With the bound p +
    c/x of a camera, x tan(alpha + p + c/x) is convex: a tangent in the angle, with the slope at the
    steepest angle of all labels, is above it. The band is unbounded if an angle may be pi/2. If the
    images show a point beside the centre, the band of z is shifted by its distance, (21').
    """
    bound = law.error_at_zero_range + law.error_slope * x
    shift = 0.0
    if x > 0.0:
        bound += law.centroid_error / x
        shift = law.shift / x
    if not law.exact_angles:
        return alpha - shift - bound, alpha - shift + bound

    far = law.label_max - travelled
    own, other = steepest_angles(alpha, across, far, law)
    if own >= RIGHT_ANGLE:
        return -np.inf, np.inf
    cosine = math.cos(own)
    if law.error_slope > 0.0:
        # x times `chord` is the chord of x^2 between the ranges of the nearest and farthest label.
        near = max(law.label_min - travelled, 0.0)
        # The error bound depends on the true distance, at most x/(cos(own) cos(other)).
        chord = near + far - near * far / x
        distance = chord / cosine / math.cos(other)
        bound = law.error_at_zero_range + law.error_slope * distance
    bound = bound / cosine**2
    if law.shift != 0.0 and x > 0.0:
        bound += law.shift_error / x
    middle = math.tan(alpha) - shift
    return middle - bound, middle + bound


@inlined
def measure_section(
    section: SectionView, elapsed: int, alpha: float, across: float, law: SectionLaw
) -> tuple[bool, float]:
    """Cut a section by an angle measurement.

    Return whether it is not empty, and the overlap of section and band, m, see `chains.cut`.
    `across` is the angle of the other axis. The band of z is x times that of `slope_band`. It is
    widened by 16 ulp, so that rounding does not exclude true states on the border, which extremal
    noise produces. The ulp is relative to the terms of a height, with the range at t = 0: it does
    not decrease with the range.
    """
    label = section.label
    x = range_of(label, elapsed, law)
    bound = law.error_at_zero_range + law.error_slope * x
    lower, upper = slope_band(alpha, across, law.closing_speed * (law.step * elapsed), x, law)
    terms = label * (abs(alpha) + bound) + section.right.reach * (label / law.closing_speed)
    slack = CUT_SLACK * (terms + abs(law.shift))
    return chains.cut(section, x / law.closing_speed, x * lower - slack, x * upper + slack)


@inlined
def sight_after(
    sight: LastSight, kind: int, value: float, other_value: float, applies: bool, law: SectionLaw
) -> LastSight:
    """Return the last sight after one more event of the history."""
    known, alpha, across, steps, fired = sight
    if kind == PREDICTION:
        steps += 1
    elif applies and kind == ANGLE:
        known = True
        alpha = value
        across = other_value
        steps = 0
    elif applies and kind == IMPULSE:
        fired += abs(value) + pointing_doubt(value, other_value, law)
    return LastSight(known, alpha, across, steps, fired)


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
    """Return the error bound of an impulse, m/s: (2), in space (15), of a burn the sum of both
    bounds (15a); `across` is along the other axis.
    """
    if law.burn_time > 0.0:
        burn = burn_of(impulse, across, law)
        return burn.early + burn.late
    return abs(impulse) * law.impulse_error + pointing_doubt(impulse, across, law)


class Burn(NamedTuple):
    """A burn along one axis.

    Parameters
    ----------
    duration : float
        Duration as commanded, s.
    early, late : float
        Error bounds (15a) at the levels of its start and of its end, m/s.
    """

    duration: float
    early: float
    late: float


@inlined
def burn_of(impulse: float, across: float, law: SectionLaw) -> Burn:
    """Return the burn of an impulse; `across` is the impulse along the other axis."""
    size = math.hypot(impulse, across)
    along = abs(impulse)
    early = law.early_along * along + law.early_across * size
    late = law.late_along * along + law.late_across * size
    return Burn(law.burn_time * size, early, late)


@inlined
def change_of_miss_at(
    impulse: float, across: float, tau: float, law: SectionLaw
) -> tuple[float, float]:
    """Return the changes of the predicted miss of a label by an impulse, m, to be subtracted from
    the upper and from the lower one: the least and the greatest one for all errors of the engine.

    `tau` is the time to go of the label when the impulse is given, or the burn starts.
    """
    if law.burn_time > 0.0:
        burn = burn_of(impulse, across, law)
        change = impulse * (tau - 0.5 * burn.duration)
        doubt = burn.early * tau + burn.late * (tau - burn.duration)
        return change - doubt, change + doubt
    error = impulse_doubt(impulse, across, law)
    return (impulse - error) * tau, (impulse + error) * tau


@inlined
def across_of(values: Floats, i: int, law: SectionLaw) -> float:
    """Return value `i` along the other axis, of values of shape (C, N); zero in a plane."""
    return values[law.other, i] if law.other >= 0 else 0.0


@inlined
def widen_section(section: SectionView, elapsed: int, law: SectionLaw) -> None:
    """Enlarge a section to both sides by the error bound b of an angle: by e b in V, or x b in the
    predicted miss. The range x must be positive.
    """
    x = range_of(section.label, elapsed, law)
    bound = law.error_at_zero_range + law.error_slope * x + law.centroid_error / x
    chains.spread(section, x / law.closing_speed, law.closing_speed * bound)


@inlined
def shift_section(
    section: SectionView, elapsed: int, impulse: float, across: float, law: SectionLaw
) -> None:
    """Shift a section by an impulse k, V becomes V - k, and widen it by the error bound of k.

    The error bound is (2) of docs/guarantee.md or, in space, (15) of docs/guarantee-space.md.
    `across` is the impulse along the other axis. A burn changes z too: `burn_section`.
    """
    tau = time_to_go(section.label, elapsed, law)
    if law.burn_time > 0.0:
        burn_section(section, tau, impulse, across, law)
        return
    doubt = impulse_doubt(impulse, across, law)
    chains.shift(section, tau, -impulse)
    # Otherwise the bound is zero: `pointing_along` is zero with `pointing_across`.
    if law.impulse_error > 0.0 or law.pointing_across > 0.0:
        chains.spread(section, tau, doubt)


@allocation_free
def burn_section(
    section: SectionView, tau: float, impulse: float, across: float, law: SectionLaw
) -> None:
    """Shift a section by a burn k that starts at the time to go `tau`, and widen it by its errors.

    By Lemma 11a, V becomes V - k, the predicted miss m becomes m - k (tau - t/2) with the duration
    t, and the errors are in the sum of two segments, along the levels of the start and of the end
    of the burn. Afterwards the level is that of the end, which is not after the next step; without
    errors of burns, as in the paper's model, it stays that of the start. z is that of the motion
    after the burn, continued to the time of its start.
    """
    burn = burn_of(impulse, across, law)
    end = tau - burn.duration
    chains.shift(section, tau - 0.5 * burn.duration, -impulse)
    if law.late_along == 0.0:
        return
    chains.spread(section, tau, burn.early)
    chains.turn(section, end)
    chains.spread(section, end, burn.late)


@inlined
def predict_section(section: SectionView, elapsed: int, law: SectionLaw) -> None:
    """Move a section by one step, to step `elapsed`: turn the level and add the segment of the
    disturbance.

    By Lemma 3, the segment is nu times the step in V, with both halves of adjacent steps; it is
    made 8 ulp longer.
    """
    tau = time_to_go(section.label, elapsed, law)
    chains.turn(section, tau + law.disturbance_lead)
    chains.spread(section, tau + law.disturbance_lead, law.half_v + SUM_SLACK * section.right.reach)
    if law.disturbance_lead > 0.0:
        chains.turn(section, tau)


@inlined
def move_section(
    section: SectionView,
    kind: int,
    value: float,
    across: float,
    elapsed: int,
    law: SectionLaw,
    points: Floats,
) -> bool:
    """Apply an event that is not a measurement to a section: a prediction, an impulse or an
    enlargement. Return whether the section was reduced: enlarged to fewer vertices.

    `elapsed` is the number of predictions before the event. `points` is a working array. Only a
    prediction tests whether the section is crowded: a cut by an angle adds no vertex, and the turn
    of a burn is one of the two turns in `MAX_ADDED`.
    """
    is_reduced = False
    if kind == PREDICTION:
        is_reduced = chains.is_crowded(section)
        if is_reduced:
            chains.reduce_outward(section, time_to_go(section.label, elapsed, law), points)
        predict_section(section, elapsed + 1, law)
    elif kind == IMPULSE:
        shift_section(section, elapsed, value, across, law)
    elif kind == WIDENING:
        widen_section(section, elapsed, law)
    return is_reduced


@inlined
def summarise_section(
    section: SectionView, elapsed: int, law: SectionLaw, summaries: Floats, b: int, s: int
) -> None:
    """Write the extremes of the predicted miss z + V x/e -+ nu/2 (x/e)^2 of a section, (13) and
    (14) of the paper.

    `summaries` has the shape (C, B, S, columns).
    """
    tau = time_to_go(section.label, elapsed, law)
    upper, lower = chains.max_and_min_miss(section, tau)
    drift = 0.5 * law.disturbance * tau * tau
    summaries[law.channel, b, s, UPPER_MISS] = upper + drift
    summaries[law.channel, b, s, LOWER_MISS] = lower - drift
