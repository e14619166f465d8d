"""Sections of a window of labels, in the coordinates (V, Pi) of its middle: the set of them is
convex on the window.

The exact band of a measured rate is not convex in (z, V, label). Its direction, that of the
predicted miss Pi, is the same for all labels in (Pi, V), and there the bands of angles can be
replaced by convex ones that are little wider. See "With a rate sensor" in docs/guarantee.md. The
window of one label is the label itself, with its exact bands.
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
    SUM_SLACK,
    impulse_doubt,
    range_of,
    slope_band,
    time_to_go,
)


class Window(NamedTuple):
    """Labels from `near` to `far`, m, and what the events so far change between them and their
    middle c.

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


class Stretch(NamedTuple):
    """Events without a cut, from step `began` on, which are applied at once; times are those since
    the beginning.

    Parameters
    ----------
    began : int
        Step of the last cut.
    bounds, moments : float
        Sum of the bounds of changes of V, m/s, and of bound times time, m.
    turned, impulses : float
        Sum of the impulses, m/s, and of impulse times time, m.
    """

    began: int
    bounds: float
    moments: float
    turned: float
    impulses: float


class Rate(NamedTuple):
    """A measured rate of the line of sight along one axis, its error bound, rad/s, and the last
    angle before it.
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
def window_after(
    window: Window,
    kind: int,
    value: float,
    across: float,
    error: float,
    elapsed: int,
    law: SectionLaw,
) -> Window:
    """Return a window after one more event that applies; `elapsed` is the number of predictions up
    to it.
    """
    near, far, turned, loose, fastest, most = window
    tau = max(time_to_go(far, elapsed, law), 0.0)
    if kind == PREDICTION:
        loose += law.half_v
        fastest += law.half_v
        most += law.half_v * (tau + law.step)
    elif kind == IMPULSE:
        doubt = impulse_doubt(value, across, law)
        turned += value
        loose += doubt
        fastest += abs(value) + doubt
        most += (abs(value) + doubt) * tau
    elif kind == RATE and range_of(near, elapsed, law) > 0.0:
        # |z/x| is at most |Pi|/x + |V|/e.
        steepest = most / range_of(near, elapsed, law) + fastest / law.closing_speed
        widest = 1.0 + steepest * steepest if law.exact_angles else 1.0
        most = min(most, (abs(value) + error) * widest * range_of(far, elapsed, law) * tau)
    return Window(near, far, turned, loose, fastest, most)


@inlined
def new_stretch(began: int) -> Stretch:
    """Return a stretch without events."""
    return Stretch(began, 0.0, 0.0, 0.0, 0.0)


@inlined
def stretch_after(
    stretch: Stretch,
    kind: int,
    value: float,
    across: float,
    fastest: float,
    elapsed: int,
    law: SectionLaw,
) -> Stretch:
    """Return a stretch after one more event that applies; `fastest` is that of `Window`."""
    began, bounds, moments, turned, impulses = stretch
    time = law.step * (elapsed - began)
    bound = 0.0
    if kind == PREDICTION:
        bound = law.half_v + SUM_SLACK * fastest
    elif kind == IMPULSE:
        bound = impulse_doubt(value, across, law)
        turned += value
        impulses += value * time
    return Stretch(began, bounds + bound, moments + bound * time, turned, impulses)


@allocation_free
def apply_stretch(
    section: SectionView, stretch: Stretch, elapsed: int, law: SectionLaw, points: Floats
) -> None:
    """Move a section over a stretch to step `elapsed`: impulses at once, and the bounds of changes
    of V at both ends.

    By Lemma 9a, two segments along the levels of both ends contain those of all changes of V
    between them.
    """
    before = time_to_go(section.label, stretch.began, law)
    now = time_to_go(section.label, elapsed, law)
    late = stretch.moments / (before - now) if elapsed > stretch.began else stretch.bounds
    if chains.is_crowded(section):
        chains.reduce_outward(section, before, points)
    chains.spread(section, before, max(stretch.bounds - late, 0.0))
    chains.shift(section, before, -stretch.turned)
    for chain in (section.right, section.left):
        chains.move(chain, 0.0, stretch.impulses)
    chains.turn(section, now)
    chains.spread(section, now, late)


@inlined
def nearly_tangent(angle: float, up: float, law: SectionLaw) -> float:
    """Return a slope that is at most the tangent of an angle below 0.5 rad for `up` = 1, at least
    for `up` = -1.
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

    Return what `chains.cut` does, and whether the band cuts something; if not, the overlap is a
    lower bound. `angles` are the angles of this axis and of the other one, rad. By (13b), in the
    form with the smaller last term.
    """
    e = law.closing_speed
    half = half_time(window, law)
    travelled = law.closing_speed * (law.step * elapsed)
    alpha, across = angles
    x = label - travelled
    near = window.near - travelled
    far = window.far - travelled
    middle = section.label - travelled
    by_speed = half == 0.0 or near <= 0.0 or window.fastest * near <= window.most * e
    scale = x if by_speed else middle
    room = window.loose * half + (
        window.fastest * half if by_speed else window.most * (half * e / near)
    )
    turn = window.turned * ((label - section.label) / e)
    bound = law.error_at_zero_range + law.error_slope * x
    slack = (
        CUT_SLACK
        * (section.label * (abs(alpha) + bound) + section.right.reach * (section.label / e))
        + room
    )
    # Most bands cut nothing: a narrower one without tangents shows it in half the time.
    minimum, maximum = chains.heights(section, middle / e)
    if abs(alpha) + bound < 0.5:
        lower = scale * nearly_tangent(alpha - bound, -1.0, law) + turn - slack
        upper = scale * nearly_tangent(alpha + bound, 1.0, law) + turn + slack
        if lower <= minimum and maximum <= upper:
            return True, min(maximum - lower, upper - minimum), False
    lower, upper = slope_band(alpha, across, travelled, x if by_speed else near, law)
    if not by_speed:
        lower_far, upper_far = slope_band(alpha, across, travelled, far, law)
        lower = min(lower, lower_far)
        upper = max(upper, upper_far)
    feasible, overlap = chains.cut(
        section, middle / e, scale * lower + turn - slack, scale * upper + turn + slack
    )
    return feasible, overlap, overlap < maximum - minimum


@inlined
def rate_band(
    label: float, elapsed: int, rate: Rate, widest: float, window: Window, law: SectionLaw
) -> tuple[float, float]:
    """Return the bounds (13a) of the section of a label in a window, m, for a measured rate.

    `widest` is a bound of 1/cos(alpha)^2. The half-width error x^2/e is a convex function of the
    label: its chord replaces it in the bound that needs a concave function, so that the lower bound
    is convex and the upper one concave.
    """
    x = range_of(label, elapsed, law)
    near = range_of(window.near, elapsed, law)
    far = range_of(window.far, elapsed, law)
    lower = rate.omega - rate.error
    upper = rate.omega + rate.error
    curve = x * x / law.closing_speed
    chord = ((near + far) * x - near * far) / law.closing_speed if far > near else curve
    lower *= widest * chord if lower < 0.0 else curve
    upper *= widest * chord if upper > 0.0 else curve
    turn = window.turned * ((label - middle_of(window)) / law.closing_speed)
    room = window.loose * half_time(window, law)
    return lower + turn - room, upper + turn + room


@allocation_free
def max_slope(elapsed: int, sight: LastSight, window: Window, law: SectionLaw) -> float:
    """Return a bound of |z/x| in a window: from the last angle, or the box without one, and the
    motion since.
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
        return steepest
    fastest = max(abs(law.vz_min), abs(law.vz_max)) + sight.fired * (1.0 + law.impulse_error)
    fastest += law.disturbance * (law.step * elapsed)
    return (steepest * far_then + fastest * ago) / near if near > 0.0 else np.inf


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

    Return what `chains.cut` does, with the overlap in metres of predicted miss, and whether the
    band cuts something.
    """
    middle = section.label
    tau = time_to_go(middle, elapsed, law)
    slack = (
        CUT_SLACK
        * (middle * (abs(rate.omega) + rate.error) + section.right.reach)
        * (middle / law.closing_speed)
    )
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
    feasible, overlap = chains.cut_misses(section, tau, lower - slack, upper + slack, points)
    return feasible, overlap, overlap < upper_miss - lower_miss
