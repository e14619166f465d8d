"""Sections of a window of labels, in the coordinates (V, Pi) of its middle, in which the set is
convex on the window.

The exact band of a measured rate is not convex in (z, V, label). In (Pi, V), with the predicted
miss Pi, its direction is the same for all labels, and the bands of angles can be replaced by convex
ones that are little wider. See "With a rate sensor" in docs/guarantee-miss.md. The window of one
label is the label itself, with its exact bands.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from infoset._compile import allocation_free, inlined
from infoset.arrays import Floats
from infoset.engine import chains
from infoset.engine.chains import SectionView
from infoset.engine.history import IMPULSE, PREDICTION, RATE, LastSight
from infoset.engine.section_law import SectionLaw
from infoset.engine.section_life import (
    CUT_SLACK,
    impulse_doubt,
    range_of,
    slope_band,
    time_to_go,
)


class Window(NamedTuple):
    """Labels from `near` to `far`, m, and the changes of their sections relative to the section of
    their middle c, by the events so far.

    A motion with label l and predicted miss Pi is the point Pi + turned (l - c)/e of the section,
    to within the sum `loose` times half the width of the window over e, by (13).

    Parameters
    ----------
    near, far : float
        Limits of the labels, m.
    turned, loose : float
        Sum of the impulses, and of the bounds of disturbances and of errors of impulses, m/s.
    fastest, most : float
        Bounds of |V|, m/s, and of |Pi|, m, of a true motion.
    """

    near: float
    far: float
    turned: float
    loose: float
    fastest: float
    most: float


class AxisEvent(NamedTuple):
    """An event that applies, along one axis.

    Parameters
    ----------
    kind : int
        Kind of the event.
    value, across : float
        Its value along this axis and along the other one, as in `EventLog`.
    error : float
        Error bound of a measured rate, rad/s; zero for the other kinds.
    """

    kind: int
    value: float
    across: float
    error: float


class Rate(NamedTuple):
    """A measured rate of the line of sight along one axis.

    Parameters
    ----------
    omega, error : float
        The rate and its error bound, rad/s.
    sight : LastSight
        The last angle before it.
    """

    omega: float
    error: float
    sight: LastSight


@inlined
def middle_of(window: Window) -> float:
    """Return the middle of a window, m."""
    return 0.5 * (window.near + window.far)


@inlined
def half_time(window: Window, law: SectionLaw) -> float:
    """Return half the width of a window, in seconds of approach."""
    return 0.5 * (window.far - window.near) / law.closing_speed


@inlined
def new_window(near: float, far: float, law: SectionLaw) -> Window:
    """Return a window at t = 0."""
    fastest = max(abs(law.vz_min), abs(law.vz_max))
    most = max(abs(law.z_min), abs(law.z_max)) + fastest * (far / law.closing_speed)
    return Window(near, far, 0.0, law.half_v_at_start, fastest, most)


@inlined
def window_after(window: Window, event: AxisEvent, elapsed: int, law: SectionLaw) -> Window:
    """Return a window after one more event; `elapsed` is the number of predictions up to it, and
    counts a prediction itself.
    """
    near, far, turned, loose, fastest, most = window
    # The farthest label has the greatest time to go.
    tau = max(time_to_go(far, elapsed, law), 0.0)
    size = abs(event.value)
    if event.kind == PREDICTION:
        loose += law.half_v
        fastest += law.half_v
        most += law.half_v * (tau + law.step)
    elif event.kind == IMPULSE:
        doubt = impulse_doubt(event.value, event.across, law)
        turned += event.value
        loose += doubt
        fastest += size + doubt
        most += (size + doubt) * tau
    elif event.kind == RATE and range_of(near, elapsed, law) > 0.0:
        # |z/x| is at most |Pi|/x + |V|/e.
        seen = most / range_of(near, elapsed, law) + fastest / law.closing_speed
        steepest = seen + law.misalignment
        widest = 1.0 + steepest * steepest if law.exact_angles else 1.0
        most = min(most, (size + event.error) * widest * range_of(far, elapsed, law) * tau)
    return Window(near, far, turned, loose, fastest, most)


@inlined
def nearly_tangent(angle: float, up: float, law: SectionLaw) -> float:
    """Return a slope near the tangent of an angle below 0.5 rad: at most the tangent for `up` = 1,
    at least for `up` = -1.

    The tangent of a positive angle a is at least a + a^3/3, and up to 0.5 rad at most a + 0.4 a^3.
    In the paper's model the slope is the angle itself.
    """
    if not law.exact_angles:
        return angle
    return angle + angle * angle * angle * (1.0 / 3.0 if up * angle > 0.0 else 0.4)


@allocation_free
def measure_in_window(
    section: SectionView,
    label: float,
    elapsed: int,
    angles: tuple[float, float],
    window: Window,
    law: SectionLaw,
) -> tuple[bool, float, bool]:
    """Cut the section of a label by a measured angle, with the convex band of its window.

    Return whether the section is not empty, the overlap, m, see `chains.cut`, and whether the band
    cuts a part; if not, the overlap is a lower bound. `angles` are the angles of this axis and of
    the other one, rad. The band is (13b), in the form with the smaller last term. `section.label`
    is the middle of the window.
    """
    e = law.closing_speed
    half = half_time(window, law)
    travelled = law.closing_speed * (law.step * elapsed)
    alpha, across = angles
    x = label - travelled
    near = window.near - travelled
    far = window.far - travelled
    middle = section.label - travelled
    # Both forms are exact for a single label. The other form needs a positive range of all labels.
    by_speed = half == 0.0 or near <= 0.0 or window.fastest * near <= window.most * e
    if by_speed:
        scale = x
        room = window.loose * half + window.fastest * half
    else:
        scale = middle
        room = window.loose * half + window.most * (half * e / near)
    turn = window.turned * ((label - section.label) / e)
    bound = law.error_at_zero_range + law.error_slope * x
    terms = section.label * (abs(alpha) + bound) + section.right.reach * (section.label / e)
    slack = CUT_SLACK * (terms + abs(law.shift)) + room

    # Most bands cut nothing: a narrower one without tangents shows it in half the time. Between the
    # ends of a window the shift of (21') is between those of its ends.
    minimum, maximum = chains.heights(section, middle / e)
    # `nearly_tangent` holds below 0.5 rad.
    if abs(alpha) + bound < 0.5:
        shifted = turn - law.shift
        lower = scale * nearly_tangent(alpha - bound, -1.0, law) + shifted - slack
        upper = scale * nearly_tangent(alpha + bound, 1.0, law) + shifted + slack
        if lower <= minimum and maximum <= upper:
            return True, min(maximum - lower, upper - minimum), False

    lower, upper = slope_band(alpha, across, travelled, x if by_speed else near, law)
    if not by_speed:
        lower_far, upper_far = slope_band(alpha, across, travelled, far, law)
        lower = min(lower, lower_far)
        upper = max(upper, upper_far)
    nonempty, overlap = chains.cut(
        section, middle / e, scale * lower + turn - slack, scale * upper + turn + slack
    )
    return nonempty, overlap, overlap < maximum - minimum


@inlined
def rate_band(
    label: float, elapsed: int, rate: Rate, widest: float, window: Window, law: SectionLaw
) -> tuple[float, float]:
    """Return the bounds (13a) of the section of a label in a window, m, for a measured rate.

    `widest` is a bound of 1/cos(alpha)^2, which is at least 1: it multiplies the bounds that it
    moves outward. x^2/e is a convex function of the label. In a negative lower and in a positive
    upper bound its chord over the window replaces it, so that the lower bound is convex and the
    upper one concave.
    """
    x = range_of(label, elapsed, law)
    near = range_of(window.near, elapsed, law)
    far = range_of(window.far, elapsed, law)
    lower = rate.omega - rate.error
    upper = rate.omega + rate.error
    curve = x * x / law.closing_speed
    chord = curve
    if far > near:
        chord = ((near + far) * x - near * far) / law.closing_speed
    lower *= widest * chord if lower < 0.0 else curve
    upper *= widest * chord if upper > 0.0 else curve
    turn = window.turned * ((label - middle_of(window)) / law.closing_speed)
    room = window.loose * half_time(window, law)
    return lower + turn - room, upper + turn + room


@allocation_free
def max_slope(elapsed: int, sight: LastSight, window: Window, law: SectionLaw) -> float:
    """Return a bound of the true |z/x| in a window, from the last angle, or from the initial box
    without one, and the motion since; infinity if a label of the window has arrived since.
    """
    e = law.closing_speed
    travelled = law.closing_speed * (law.step * elapsed)
    ago = law.step * sight.steps
    near = window.near - travelled
    far = window.far - travelled
    near_then = near + e * ago
    far_then = far + e * ago

    if sight.known:
        lower, upper = slope_band(sight.alpha, sight.across, travelled - e * ago, near_then, law)
        steepest = max(abs(lower), abs(upper))
        if far > near:
            lower, upper = slope_band(sight.alpha, sight.across, travelled - e * ago, far_then, law)
            steepest = max(steepest, abs(lower), abs(upper))
    else:
        steepest = max(abs(law.z_min), abs(law.z_max)) / near_then
    if sight.steps == 0:
        return steepest + law.misalignment

    fastest = max(abs(law.vz_min), abs(law.vz_max)) + sight.fired * (1.0 + law.impulse_error)
    fastest += law.disturbance * (law.step * elapsed)
    if near <= 0.0:
        return np.inf
    return (steepest * far_then + fastest * ago) / near + law.misalignment


@allocation_free
def measure_rate_section(
    section: SectionView,
    label: float,
    elapsed: int,
    rate: Rate,
    window: Window,
    law: SectionLaw,
    points: Floats,
) -> tuple[bool, float, bool]:
    """Cut the section of a label by a line-of-sight rate: by (9), a band of the predicted miss
    omega x^2 / e.

    Return whether the section is not empty, the overlap in metres of predicted miss, and whether
    the band cuts a part; if not, the overlap is a lower bound. `section.label` is the middle of the
    window. `points` is a working array.
    """
    middle = section.label
    tau = time_to_go(middle, elapsed, law)
    terms = middle * (abs(rate.omega) + rate.error) + section.right.reach
    slack = CUT_SLACK * terms * (middle / law.closing_speed)
    # The section already contains the first half of the next step's disturbance, which does not
    # commute with the cut.
    slack += tau * law.half_v_at_start

    # Most bands cut nothing even without the factor 1/cos^2, which takes longer than the rest.
    lower, upper = rate_band(label, elapsed, rate, 1.0, window, law)
    upper_miss, lower_miss = chains.max_and_min_miss(section, tau)
    if lower - slack <= lower_miss and upper_miss <= upper + slack:
        return True, min(upper_miss - lower, upper - lower_miss) + slack, False

    if law.exact_angles:
        steepest = max_slope(elapsed, rate.sight, window, law)
        lower, upper = rate_band(label, elapsed, rate, 1.0 + steepest * steepest, window, law)
    if chains.is_crowded(section):
        chains.reduce_outward(section, tau, points)
    nonempty, overlap = chains.cut_misses(section, tau, lower - slack, upper + slack, points)
    return nonempty, overlap, overlap < upper_miss - lower_miss
