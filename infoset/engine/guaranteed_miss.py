"""The guaranteed miss Phi: an upper bound of the true miss over all labels, computed on board.

Labels leave the set step by step as their range passes below the threshold. Phi is the maximum of
(10) in docs/guarantee.md over all of them: a search by branch and bound. The labels that leave in
one step are divided into pieces, and Lemma 7 bounds each piece. The piece with the maximum bound is
divided further until an exact section reaches nearly as much; the other pieces need no more than
their first bounds.
"""

from __future__ import annotations

import copy
import math
from typing import NamedTuple

import numpy as np

from infoset._compile import TRUE, ZERO, allocation_free, entry, inlined
from infoset.arrays import Flags, Floats, Integers
from infoset.engine import chains
from infoset.engine.concave_bounds import bound_between
from infoset.engine.history import IMPULSE, PREDICTION, EventLog, History
from infoset.engine.location import (
    FIRST,
    LABEL_RESOLUTION,
    LAST,
    MIDDLE,
    FeasibleLabels,
    locate_end,
    search_bracket,
)
from infoset.engine.replays import (
    LAST_REPLAY,
    LOWER,
    UPPER,
    Past,
    Records,
    evaluate_label,
    keep_section,
    middle_label,
    past_of,
    replayed_section,
    run,
    select,
    with_window,
)
from infoset.engine.section_law import Laws, SectionLaw, law_of
from infoset.engine.section_life import (
    NEVER_EMPTIED,
    across_of,
    impulse_doubt,
    range_of,
    time_to_go,
)
from infoset.engine.section_passes import Sections

LABELS = 3
"""Labels replayed for one window; one more on each side serves for extrapolation."""
MAX_LABELS = LABELS + 2
PIECES = LABELS + 1
NEAREST_OUTSIDE = 0.005
"""Minimum distance of a label below the others, in their spacing: a nearer one amplifies
rounding.
"""
TIGHT = 1.001
"""A piece is divided if its bound exceeds the maximum miss of an exact section by this factor."""
MAX_DIVIDED = 400
"""Maximum number of pieces that are divided. If more are needed, Phi is a greater bound."""
GROUPS = 3000
"""Labels that leave within this part of a flight are bounded together, if they need several
steps.
"""
SLACK = 1e-9
"""Relative enlargement of a bound; the rounding errors of supports and lines are far smaller."""
ROUNDING = 4.0 * chains.EPSILON
"""Rounding error of a miss, relative to the maximum label: of x at the closest approach, also if z
is exactly zero.
"""
PIECE = np.dtype(
    [("near", np.float64), ("far", np.float64), ("step", np.int64), ("bound", np.float64)]
)
"""A piece: its labels, m, the number of the step in `Leaving`, and the bound of its miss by (12),
m.
"""


class Leaving(NamedTuple):
    """Labels that leave in each of W steps.

    Parameters
    ----------
    near, far : ndarray, shape (W, B)
        Limits of the labels, m; the lower one is greater if none leaves.
    known : ndarray, shape (W, B)
        A feasible label between them, m; minus infinity if none is known.
    events, elapsed : ndarray of int, shape (W,)
        Numbers of events and of predictions before they leave.
    """

    near: Floats
    far: Floats
    known: Floats
    events: Integers
    elapsed: Integers


class Outlines(NamedTuple):
    """Sections of the labels replayed for one window.

    Parameters
    ----------
    labels : ndarray, shape (MAX_LABELS,)
        The labels, m, in increasing order.
    points : ndarray, shape (C, MAX_LABELS, CAPACITY, 2)
        Vertices (V, z) of their sections along each axis.
    counts : ndarray of int, shape (C, MAX_LABELS)
        Numbers of vertices.
    supports : ndarray, shape (4, MAX_LABELS)
        Supports of the sections in four directions.
    """

    labels: Floats
    points: Floats
    counts: Integers
    supports: Floats


class WindowLabels(NamedTuple):
    """Number of the labels replayed for a window, and how many of them are below and above its
    feasible ones.
    """

    number: int
    inner: int
    outer: int


@inlined
def support(points: Floats, count: int, v: float, z: float) -> float:
    """Return the support of a polygon of `count` vertices (V, z) in a direction."""
    maximum = -np.inf
    for i in range(count):
        maximum = max(maximum, v * points[i, 0] + z * points[i, 1])
    return maximum


@allocation_free
def write_outline(outlines: Outlines, i: int, label: float, row: int, past: Past) -> None:
    """Write the sections in a row of the workspace as those of label number `i`."""
    outlines.labels[i] = label
    for channel in range(past.laws.shape[0]):
        middle = middle_label(label, past)
        tau = time_to_go(middle, past.log.elapsed, law_of(past.laws, channel))
        section = replayed_section(past, channel, row, middle)
        outlines.counts[channel, i] = chains.outline(section, tau, outlines.points[channel, i])


@allocation_free
def later_impulses(
    near: float, far: float, side: float, past: Past, law: SectionLaw
) -> tuple[float, float]:
    """Return a lower bound of the sum of side kappa_j x_j/e in (10) over the impulses after a
    history.

    It is a linear function of the labels from `near` to `far`: its value at the middle, m, and its
    slope. The events that follow the history are in the workspace. An impulse at which only a part
    of the labels has arrived is bounded by its extremes.
    """
    e = law.closing_speed
    elapsed = past.log.elapsed
    values = past.room.values
    applies = past.room.applies
    middle, slope = 0.0, 0.0
    for event in range(past.log.number, applies.shape[0]):
        if past.log.kinds[event] == PREDICTION:
            elapsed += 1
        elif past.log.kinds[event] == IMPULSE and applies[event]:
            x_near = range_of(near, elapsed, law)
            x_far = range_of(far, elapsed, law)
            if x_far <= 0.0:
                break
            impulse = values[law.channel, event]
            minimum = side * impulse - impulse_doubt(impulse, across_of(values, event, law), law)
            if x_near >= 0.0:
                middle += minimum * (0.5 * (x_near + x_far) / e)
                slope += minimum / e
            else:
                middle += min(minimum * (x_far / e), 0.0)
    return middle, slope


@allocation_free
def miss_at(outlines: Outlines, i: int, past: Past) -> float:
    """Return the maximum miss (10) of the section of one label, without the error of the speed,
    m.
    """
    label = outlines.labels[i]
    miss = 0.0
    middle = middle_label(label, past)
    for channel in range(past.laws.shape[0]):
        law = law_of(past.laws, channel)
        points = outlines.points[channel, i]
        count = outlines.counts[channel, i]
        tau = time_to_go(middle, past.log.elapsed, law)
        room = past.room.drifts[channel, 1]
        turn = past.room.drifts[channel, 0] * ((label - middle) / law.closing_speed)
        upper = (
            support(points, count, tau, 1.0)
            - turn
            - later_impulses(label, label, 1.0, past, law)[0]
        )
        lower = (
            support(points, count, -tau, -1.0)
            + turn
            - later_impulses(label, label, -1.0, past, law)[0]
        )
        drift = 0.5 * law.disturbance * time_to_go(label, past.log.elapsed, law) ** 2
        miss = math.hypot(miss, max(upper, lower) + room + drift)
    return miss


@allocation_free
def max_exact_miss(replayed: WindowLabels, reached: float, past: Past, outlines: Outlines) -> float:
    """Return the maximum miss of the exact sections of replayed labels, m; with rates, that of one
    of them.

    With rates, the sections of a window contain those of its labels. They need not be exact if they
    reach less than `reached`.
    """
    worst = ZERO
    miss = 0.0
    for i in range(replayed.inner, replayed.number - replayed.outer):
        miss_here = miss_at(outlines, i, past)
        if miss_here > miss:
            worst = i
            miss = miss_here
    if past.errors is not None and miss > reached:
        label = outlines.labels[worst]
        alone = with_window(past, np.inf, -np.inf)
        if run(label, alone)[0] != NEVER_EMPTIED:
            return 0.0
        write_outline(outlines, ZERO, label, LAST_REPLAY, alone)
        miss = miss_at(outlines, ZERO, alone)
    return miss


@allocation_free
def feasible_part(known: float, past: Past) -> FeasibleLabels:
    """Return the feasible labels of the window of a history, which form an interval, and leave the
    sections at its ends.

    With rates, the bands are those that are convex on the window. `known` is a feasible label of
    the window; any other number if none is known.
    """
    near = past.nearest
    far = past.farthest
    limits = past.room.known
    below = near
    lower = near
    upper = far
    above = far
    lower_is_feasible = evaluate_label(limits, FIRST, near, past)
    if lower_is_feasible:
        keep_section(past, LOWER)
    upper_is_feasible = evaluate_label(limits, LAST, far, past)
    if upper_is_feasible:
        keep_section(past, UPPER)
    feasible = near if lower_is_feasible else far
    if not lower_is_feasible and not upper_is_feasible:
        feasible = known if near <= known <= far else 0.5 * (near + far)
        if past.errors is not None:
            # A label that is feasible by itself may be infeasible with the bands of the window, and
            # others may be feasible.
            if not (evaluate_label(limits, MIDDLE, feasible, past) or search_bracket(past)):
                return FeasibleLabels(False, below, lower, upper, above)
            feasible = limits[1].label
        elif feasible != known:
            # The feasible labels of the set form an interval. None of it is known here, and both
            # limits are infeasible.
            return FeasibleLabels(False, below, lower, upper, above)
    resolution = LABEL_RESOLUTION * far
    if not lower_is_feasible:
        below, lower = locate_end(limits[0], feasible, resolution, past, LOWER)
    if not upper_is_feasible:
        above, upper = locate_end(limits[2], feasible, resolution, past, UPPER)
    return FeasibleLabels(True, below, lower, upper, above)


@allocation_free
def replay_labels(feasible: FeasibleLabels, past: Past, outlines: Outlines) -> WindowLabels:
    """Write the sections of equally spaced feasible labels, and of one more on each side without
    rates.

    The sections at the ends are in the workspace. A single label is replayed if the interval is as
    short as the resolution.
    """
    spacing = (feasible.upper - feasible.lower) / (LABELS - 1)
    law = law_of(past.laws, ZERO)
    travelled = feasible.lower - range_of(feasible.lower, past.log.elapsed, law)
    number = inner = outer = ZERO
    if spacing <= LABEL_RESOLUTION * feasible.upper:
        write_outline(outlines, ZERO, feasible.lower, LOWER, past)
        return WindowLabels(ZERO + 1, inner, outer)
    for k in range(-1, LABELS + 1):
        label = feasible.lower + k * spacing
        row = LAST_REPLAY
        if k < 0 and label <= travelled:
            # No section exists behind x = 0. A much shorter distance would amplify rounding errors.
            label = travelled + 0.5 * (feasible.lower - travelled)
            if feasible.lower - label < NEAREST_OUTSIDE * spacing:
                continue
        if k == 0:
            row = LOWER
        elif k == LABELS - 1:
            label = feasible.upper
            row = UPPER
        elif k < 0 or k == LABELS:
            # Labels are feasible outside if the limit is. The bands of rates are convex only on the
            # window.
            limit_is_feasible = (
                feasible.below == feasible.lower if k < 0 else feasible.above == feasible.upper
            )
            if (
                past.errors is not None
                or not limit_is_feasible
                or run(label, past)[0] != NEVER_EMPTIED
            ):
                continue
            inner = inner + (k < 0)
            outer = outer + (k > 0)
        elif run(label, past)[0] != NEVER_EMPTIED:
            continue
        write_outline(outlines, number, label, row, past)
        number += 1
    return WindowLabels(number, inner, outer)


@allocation_free
def bound_pieces(
    feasible: FeasibleLabels,
    replayed: WindowLabels,
    past: Past,
    outlines: Outlines,
    pieces: Records,
    count: int,
) -> int:
    """Add the pieces between replayed labels, with their bounds, to `count` pieces; return the new
    count.

    The first piece ends at the first feasible label, and the last one begins at the last feasible
    label.
    """
    number, inner, outer = replayed
    if number < 3:
        # The feasible labels are equal to within the resolution: one outline and a small margin
        # bound them all.
        piece = pieces[count]
        piece.near, piece.far = feasible.below, feasible.above
        piece.bound = miss_at(outlines, ZERO, past) + margin_of(
            outlines, feasible.above - feasible.below, past
        )
        return count + 1
    for first in range(inner, number - outer + 1):
        near = feasible.below if first == inner else outlines.labels[first - 1]
        far = feasible.above if first == number - outer else outlines.labels[first]
        if near < far:
            piece = pieces[count]
            piece.near = near
            piece.far = far
            piece.bound = bound_piece(near, far, number, first, past, outlines)
            count += 1
    return count


@allocation_free
def bound_piece(
    near: float, far: float, number: int, first: int, past: Past, outlines: Outlines
) -> float:
    """Return the bound (12) of the miss over all labels from `near` to `far`, without the error of
    the speed, m.

    The support of the sections in a fixed direction is a concave function of the label, but the
    direction of z + V x/e turns with the label. With the middle c of the piece, z + V x/e = (z + V
    x_c/e) + V (x - x_c)/e: the first term has a fixed direction, and the V of the second lies
    within its extrapolated bounds V_c +- rho. With rates the direction of (13) is that of the
    middle of the window. Of the `number` replayed labels, `first` are below the piece.
    """
    labels = outlines.labels[:number]
    supports = outlines.supports[:, :number]
    total = 0.0
    centre = 0.5 * (near + far)
    middle = centre if past.errors is None else middle_label(centre, past)
    for channel in range(past.laws.shape[0]):
        law = law_of(past.laws, channel)
        drifts = past.room.drifts[channel]
        e = law.closing_speed
        tau = time_to_go(middle, past.log.elapsed, law)
        for k in range(max(first - 2, 0), min(first + 2, number)):
            points = outlines.points[channel, k]
            count = outlines.counts[channel, k]
            supports[0, k], supports[1, k] = (
                support(points, count, 1.0, 0.0),
                support(points, count, -1.0, 0.0),
            )
            supports[2, k], supports[3, k] = (
                support(points, count, tau, 1.0),
                support(points, count, -tau, -1.0),
            )
        if past.errors is None:
            v_max = bound_between(labels, supports[0], first, near, far, 0.0)
            v_min = -bound_between(labels, supports[1], first, near, far, 0.0)
            slope = 0.5 * (v_max + v_min) / e
            offset = 0.0
            room = 0.5 * (v_max - v_min) * ((far - near) / (2.0 * e))
        else:
            slope = -drifts[0] / e
            room = drifts[1]
            offset = slope * (centre - middle)
        moved, turn = later_impulses(near, far, 1.0, past, law)
        upper = bound_between(labels, supports[2], first, near, far, slope - turn) + offset - moved
        moved, turn = later_impulses(near, far, -1.0, past, law)
        lower = bound_between(labels, supports[3], first, near, far, -slope - turn) - offset - moved
        drift = 0.5 * law.disturbance * time_to_go(far, past.log.elapsed, law) ** 2
        total = math.hypot(total, max(upper, lower) + room + drift)
    return total


@allocation_free
def margin_of(outlines: Outlines, width: float, past: Past) -> float:
    """Return the margin of a bound from one label, m, for `width` metres of labels: their relative
    change of range.
    """
    label = outlines.labels[0]
    margin = 0.0
    for channel in range(past.laws.shape[0]):
        law = law_of(past.laws, channel)
        points = outlines.points[channel, 0]
        count = outlines.counts[channel, 0]
        tau = time_to_go(label, past.log.elapsed, law)
        size = abs(support(points, count, tau, 1.0)) + abs(support(points, count, -tau, -1.0))
        margin += size * (SLACK + width / max(tau * law.closing_speed, 1.0))
    return margin


@entry
def bound_all(
    leaving: Leaving, past: Past, outlines: Outlines, pieces: Records, phi: Floats
) -> None:
    """Write Phi of each engagement without the error of the speed, m; minus infinity where no label
    has left.

    All labels that leave in a step are one piece at first, whose bound is infinite. `pieces` has
    room for all of them.
    """
    log = past.log
    for b in range(phi.shape[0]):
        select(past, b)
        count = ZERO
        divided = ZERO
        reached = -np.inf
        phi[b] = -np.inf
        for w in range(leaving.events.shape[0]):
            if leaving.near[w, b] <= leaving.far[w, b]:
                piece = pieces[count]
                piece.near, piece.far, piece.step, piece.bound = (
                    leaving.near[w, b],
                    leaving.far[w, b],
                    w,
                    np.inf,
                )
                count += 1
                if past.errors is not None and leaving.known[w, b] > 0.0:
                    # The measurements that cut this label are those that the windows apply at
                    # first.
                    run(leaving.known[w, b], past)
        while count > 0:
            worst = 0
            for i in range(
                count
            ):  # of the pieces without a bound the last one, which often has the maximum miss
                if pieces[i].bound >= pieces[worst].bound:
                    worst = i
            piece = pieces[worst]
            near = piece.near
            far = piece.far
            step = piece.step
            if piece.bound < np.inf:
                phi[b] = piece.bound
                divided += 1
                if piece.bound <= TIGHT * reached or divided > MAX_DIVIDED:
                    break
            count -= 1
            pieces[worst] = pieces[count]
            until = EventLog(
                log.kinds, log.values, log.applies, leaving.events[step], leaving.elapsed[step]
            )
            window = Past(until, past.errors, past.laws, past.room, near, far, TRUE)
            feasible = feasible_part(leaving.known[step, b], window)
            if feasible.exists:
                replayed = replay_labels(feasible, window, outlines)
                before = count
                count = bound_pieces(feasible, replayed, window, outlines, pieces, count)
                for i in range(before, count):
                    pieces[i].step = step
                reached = max(reached, max_exact_miss(replayed, reached, window, outlines))


class GuaranteedMiss:
    """Phi of a batch of engagements: an upper bound of the true miss over the labels that have left
    the set.

    `speed_error` is the maximum |eta|, the relative error of the closing speed.
    """

    def __init__(self, law: SectionLaw, batch: int, speed_error: float) -> None:
        self._law = law
        self._speed_error = speed_error
        steps = law.label_max / (law.closing_speed * law.step)
        self._group_steps = max(1, int(steps / GROUPS))
        self._bounded_below = np.full(batch, -np.inf)
        self._leaving: list[Leaving] = []

    def copy(self) -> GuaranteedMiss:
        """Return an independent copy."""
        twin = copy.copy(self)
        twin._leaving = self._leaving.copy()
        return twin

    def leave(
        self, active: Flags, lower: Floats, upper: Floats, sections: Sections, history: History
    ) -> None:
        """Note that the feasible labels from `lower` to `upper`, shape (B,), m, leave in this step.

        Labels that leave during the following steps of a group are noted too, so that their number
        of windows does not grow with the number of steps.
        """
        lower = np.maximum(lower, self._bounded_below)
        active = active & (lower <= upper) & (lower < self._min_label(history.elapsed + 1))
        if not active.any():
            return
        below = self._min_label(history.elapsed + self._group_steps)
        near = np.where(active, lower, np.inf)
        far = np.minimum(upper, below)
        self._bounded_below = np.where(active, below, self._bounded_below)
        slots = sections.slots
        is_feasible = (
            slots["feasible"] & (slots["label"] >= near[:, None]) & (slots["label"] <= far[:, None])
        )
        is_feasible &= np.arange(slots.shape[1]) < sections.used[:, None]
        known = np.where(is_feasible, slots["label"], -np.inf).max(axis=1)
        events = np.array(history.events)
        elapsed = np.array(history.elapsed)
        self._leaving.append(Leaving(near, far, known, events, elapsed))

    def bound(self, laws: Laws, history: History) -> tuple[Floats, Flags]:
        """Return Phi so far, m, and whether a label has left, both of shape (B,).

        The labels that have left are replayed from the start; the impulses that followed act on
        them. The time is linear in the number of events and in that of the steps in which labels
        leave.
        """
        batch = len(self._bounded_below)
        channels = len(laws)
        windows = len(self._leaving)
        phi = np.full(batch, -np.inf)
        if windows:
            outlines = Outlines(
                np.empty(MAX_LABELS),
                np.empty((channels, MAX_LABELS, chains.CAPACITY, 2)),
                np.empty((channels, MAX_LABELS), dtype=np.int64),
                np.empty((4, MAX_LABELS)),
            )
            leaving = Leaving(*(np.stack(each) for each in zip(*self._leaving, strict=True)))
            pieces = np.recarray(PIECES * (windows + MAX_DIVIDED), PIECE)
            bound_all(leaving, past_of(history, laws), outlines, pieces, phi)
        exists = phi >= 0.0
        factor = (1.0 + self._speed_error) * (1.0 + SLACK)
        return np.where(exists, (phi + ROUNDING * self._law.label_max) * factor, 0.0), exists

    def _min_label(self, elapsed: int) -> float:
        """Return the minimum label, m, that is not below the range threshold after a number of
        steps.
        """
        return self._law.min_range + self._law.closing_speed * (self._law.step * elapsed)
