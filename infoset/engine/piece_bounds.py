"""Bound of the miss over a piece of the labels that leave in one step.

A piece is replayed at a few labels, and Lemma 7 of docs/guarantee-miss.md bounds the supports of
the sections between them. With rates a piece is a window of labels, and the bands are convex on it.
The numbers of equations are those of docs/guarantee-miss.md.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from infoset._compile import ZERO, allocation_free, inlined
from infoset.arrays import Floats, Integers
from infoset.engine import chains
from infoset.engine.concave_bounds import bound_between
from infoset.engine.history import IMPULSE, PREDICTION
from infoset.engine.label_search import (
    FIRST,
    LABEL_RESOLUTION,
    LAST,
    MIDDLE,
    FeasibleLabels,
    narrow_ends,
    order_bracket,
    search_bracket,
)
from infoset.engine.replays import evaluate_label, run
from infoset.engine.section_law import SectionLaw, law_of
from infoset.engine.section_life import (
    NEVER_EMPTIED,
    across_of,
    burn_of,
    impulse_doubt,
    range_of,
    time_to_go,
)
from infoset.engine.workspace import (
    LAST_REPLAY,
    LOWER,
    UPPER,
    Past,
    Records,
    keep_section,
    middle_label,
    replayed_section,
    with_window,
)

LABELS = 3
"""Labels replayed for one piece: its ends and its middle."""
MAX_LABELS = LABELS + 2
"""The same with one more label on each side of the piece: Lemma 7 extrapolates from two labels on a
side."""
PIECES = LABELS + 1
"""Maximum number of pieces into which a piece is divided: between the labels there are LABELS - 1,
and one more on each side goes on to an infeasible label."""
NEAREST_OUTSIDE = 0.005
"""Minimum distance of a label below the others, in their spacing: a nearer one amplifies the
rounding errors of supports more than 200 times. Chosen: Phi of flights of ten seconds is the same
from 0.00125 to 0.08 (measured)."""
SLACK = 1e-9
"""Relative enlargement of a bound of Phi, for the rounding errors of supports and of lines through
them, which are far smaller."""
PIECE = np.dtype(
    [
        ("near", np.float64),
        ("far", np.float64),
        ("set", np.int64),
        ("step", np.int64),
        ("bound", np.float64),
    ]
)
"""A piece: its labels, m, the number of their set, the number of the step in which they leave, and
the bound of its miss by (12), m.
"""


class Outlines(NamedTuple):
    """Sections of the labels replayed for one piece.

    Parameters
    ----------
    labels : ndarray, shape (MAX_LABELS,)
        The labels, m, in increasing order.
    points : ndarray, shape (C, MAX_LABELS, `chains.CAPACITY`, 2)
        Vertices (V, z) of their sections along each axis.
    counts : ndarray of int, shape (C, MAX_LABELS)
        Numbers of vertices.
    supports : ndarray, shape (4, MAX_LABELS)
        Supports of the sections along one axis: maximum V, maximum -V, maximum and minus the
        minimum of the predicted miss. `write_supports` writes them.
    """

    labels: Floats
    points: Floats
    counts: Integers
    supports: Floats


V_MAX, MINUS_V_MIN, UPPER_MISS, MINUS_LOWER_MISS = range(4)
"""Rows of the supports."""


class PieceLabels(NamedTuple):
    """Number of the labels replayed for a piece, and how many of them are below and above its
    feasible ones.
    """

    number: int
    inner: int
    outer: int


class Turning(NamedTuple):
    """Change of a support of the predicted miss with the label, in a piece.

    Parameters
    ----------
    slope : float
        Change per metre of label.
    offset : float
        Change from the label in whose coordinates the section is to the middle of the piece, m.
    room : float
        Bound of the rest, m.
    """

    slope: float
    offset: float
    room: float


@inlined
def support(points: Floats, count: int, v: float, z: float) -> float:
    """Return the support of a polygon of `count` vertices (V, z) in the direction (v, z)."""
    maximum = -np.inf
    for i in range(count):
        maximum = max(maximum, v * points[i, 0] + z * points[i, 1])
    return maximum


@allocation_free
def write_outline(outlines: Outlines, i: int, label: float, row: int, past: Past) -> None:
    """Write the sections in a row of the workspace as the sections of label number `i`."""
    outlines.labels[i] = label
    for channel in range(past.laws.shape[0]):
        middle = middle_label(label, past)
        tau = time_to_go(middle, past.log.elapsed, law_of(past.laws, channel))
        section = replayed_section(past, channel, row, middle)
        outlines.counts[channel, i] = chains.outline(section, tau, outlines.points[channel, i])


@allocation_free
def write_if_feasible(outlines: Outlines, i: int, label: float, past: Past) -> int:
    """Replay a label; if it is feasible, write its sections as label number `i`. Return the number
    of labels written.
    """
    if run(label, past).emptied_at != NEVER_EMPTIED:
        return 0
    write_outline(outlines, i, label, LAST_REPLAY, past)
    return 1


@allocation_free
def later_impulses(
    near: float, far: float, side: float, past: Past, law: SectionLaw
) -> tuple[float, float]:
    """Return a lower bound of the sum of side kappa_j x_j/e in (10) over the impulses after a
    history; `side` is 1 or -1.

    It is a linear function of the labels from `near` to `far`: its value at the middle, m, and its
    slope. The events that follow the history are in the workspace. An impulse at which only a part
    of the labels has arrived is bounded by its extremes: zero, and its product at `far`. One at
    which all have arrived counts nothing.
    """
    e = law.closing_speed
    elapsed = past.log.elapsed
    values = past.room.values
    applies = past.room.applies
    middle = 0.0
    slope = 0.0
    for event in range(past.log.number, applies.shape[0]):
        if past.log.kinds[event] == PREDICTION:
            elapsed += 1
        elif past.log.kinds[event] == IMPULSE and applies[event]:
            x_near = range_of(near, elapsed, law)
            x_far = range_of(far, elapsed, law)
            if x_far <= 0.0:
                break
            impulse = values[law.channel, event]
            across = across_of(values, event, law)
            minimum = side * impulse - impulse_doubt(impulse, across, law)
            if law.burn_time > 0.0:
                # A burn acts later than at its step. It ends before each label arrives.
                burn = burn_of(impulse, across, law)
                middle += (burn.late - 0.5 * side * impulse) * burn.duration
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
    middle = middle_label(label, past)
    miss = 0.0
    for channel in range(past.laws.shape[0]):
        law = law_of(past.laws, channel)
        points = outlines.points[channel, i]
        count = outlines.counts[channel, i]
        tau = time_to_go(middle, past.log.elapsed, law)
        # Both are zero without rates.
        room = past.room.drifts[channel, 1]
        turn = past.room.drifts[channel, 0] * ((label - middle) / law.closing_speed)

        later, _ = later_impulses(label, label, 1.0, past, law)
        upper = support(points, count, tau, 1.0) - turn - later
        later, _ = later_impulses(label, label, -1.0, past, law)
        lower = support(points, count, -tau, -1.0) + turn - later
        drift = 0.5 * law.disturbance * time_to_go(label, past.log.elapsed, law) ** 2
        farther = max(upper + law.aim, lower - law.aim) + law.aim_error
        miss = math.hypot(miss, farther + room + drift)
    return miss


@allocation_free
def max_exact_miss(replayed: PieceLabels, reached: float, past: Past, outlines: Outlines) -> float:
    """Return the maximum miss of the sections of the replayed feasible labels, m.

    With rates (`past.errors`) these sections are those of the window, which are too large. If they
    exceed `reached`, the label of their maximum is replayed alone: its sections overwrite those of
    label 0 of `outlines`, so that `bound_pieces` must come before, and its miss is returned, or 0
    if it is infeasible alone.
    """
    worst = ZERO
    miss = 0.0
    for i in range(replayed.inner, replayed.number - replayed.outer):
        miss_here = miss_at(outlines, i, past)
        if miss_here > miss:
            worst = i
            miss = miss_here
    if past.errors is None or miss <= reached:
        return miss

    label = outlines.labels[worst]
    alone = with_window(past, np.inf, -np.inf)
    if write_if_feasible(outlines, ZERO, label, alone) == 0:
        return 0.0
    return miss_at(outlines, ZERO, alone)


@allocation_free
def feasible_part(known: float, past: Past) -> FeasibleLabels:
    """Return the feasible labels of the window of a history, which form an interval. Their sections
    are in the rows `LOWER` and `UPPER` of the workspace afterwards.

    With rates, the bands are convex on the window. `known` is a feasible label of the window; any
    other number if none is known.
    """
    near = past.nearest
    far = past.farthest
    bracket = past.room.bracket
    near_is_feasible = evaluate_label(bracket, FIRST, near, past)
    if near_is_feasible:
        keep_section(past, LOWER)
    far_is_feasible = evaluate_label(bracket, LAST, far, past)
    if far_is_feasible:
        keep_section(past, UPPER)

    exists = True
    inside = known
    if near_is_feasible:
        inside = near
    elif far_is_feasible:
        inside = far
    elif past.errors is not None:
        # A label that is feasible by itself may be infeasible with the bands of the window, and
        # others may be feasible.
        inside = known if near <= known <= far else 0.5 * (near + far)
        exists = evaluate_label(bracket, MIDDLE, inside, past)
        if not exists:
            order_bracket(past)
            exists = search_bracket(past)
        inside = bracket[MIDDLE].label
    else:
        # The feasible labels of the set form an interval, and both limits are infeasible: if none
        # is known between them, there is none.
        exists = near <= known <= far
    if not exists:
        return FeasibleLabels(False, near, near, far, far)
    return narrow_ends(inside, inside, LABEL_RESOLUTION * far, past)


@allocation_free
def replay_labels(feasible: FeasibleLabels, past: Past, outlines: Outlines) -> PieceLabels:
    """Write the sections of equally spaced feasible labels, and without rates of one more beyond
    each end that is a limit of the piece, if it is feasible.

    The sections at the ends are in the workspace. A single label is written if the interval is as
    short as the resolution. The bands of rates are convex only on the window, so that no label
    outside is of use.
    """
    spacing = (feasible.upper - feasible.lower) / (LABELS - 1)
    if spacing <= LABEL_RESOLUTION * feasible.upper:
        write_outline(outlines, ZERO, feasible.lower, LOWER, past)
        return PieceLabels(ZERO + 1, ZERO, ZERO)

    # Beyond a limit of the piece labels can be feasible only if the limit itself is feasible.
    inner = ZERO
    if past.errors is None and feasible.below == feasible.lower:
        label = feasible.lower - spacing
        law = law_of(past.laws, ZERO)
        travelled = feasible.lower - range_of(feasible.lower, past.log.elapsed, law)
        if label <= travelled:
            # No section exists behind x = 0. A much shorter distance would amplify rounding errors.
            label = travelled + 0.5 * (feasible.lower - travelled)
        if feasible.lower - label >= NEAREST_OUTSIDE * spacing:
            inner = write_if_feasible(outlines, ZERO, label, past)

    number = inner
    write_outline(outlines, number, feasible.lower, LOWER, past)
    number += 1
    for k in range(1, LABELS - 1):
        number += write_if_feasible(outlines, number, feasible.lower + k * spacing, past)
    write_outline(outlines, number, feasible.upper, UPPER, past)
    number += 1

    outer = ZERO
    if past.errors is None and feasible.above == feasible.upper:
        # One spacing above the upper end.
        outer = write_if_feasible(outlines, number, feasible.lower + LABELS * spacing, past)
    return PieceLabels(number + outer, inner, outer)


@allocation_free
def bound_pieces(
    feasible: FeasibleLabels,
    replayed: PieceLabels,
    past: Past,
    outlines: Outlines,
    pieces: Records,
    count: int,
) -> int:
    """Add the pieces between replayed labels, with their bounds, to `count` pieces; return the new
    count.

    The first piece ends at the first feasible label, and the last one begins at the last feasible
    label; both are left out where this label is a limit of the divided piece.
    """
    number, inner, outer = replayed
    if number < 3:
        # The feasible labels are equal to within the resolution: one outline and a small margin
        # bound them all. Two labels are left if rounding makes the middle one infeasible, in a set
        # as thin as rounding: the bound is then not proved ("not guaranteed" in docs/guarantee.md).
        piece = pieces[count]
        piece.near = feasible.below
        piece.far = feasible.above
        margin = margin_of(outlines, feasible.above - feasible.below, past)
        piece.bound = miss_at(outlines, ZERO, past) + margin
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
def write_supports(channel: int, begin: int, end: int, tau: float, outlines: Outlines) -> None:
    """Write the supports of the labels from number `begin` to before `end` along one axis.

    They replace those along the axis before. `channel` is the axis, and `tau` the time to go, s:
    the predicted miss is z + V tau.
    """
    supports = outlines.supports
    for k in range(begin, end):
        points = outlines.points[channel, k]
        count = outlines.counts[channel, k]
        supports[V_MAX, k] = support(points, count, 1.0, 0.0)
        supports[MINUS_V_MIN, k] = support(points, count, -1.0, 0.0)
        supports[UPPER_MISS, k] = support(points, count, tau, 1.0)
        supports[MINUS_LOWER_MISS, k] = support(points, count, -tau, -1.0)


@allocation_free
def turning_of(
    near: float,
    far: float,
    number: int,
    first: int,
    law: SectionLaw,
    past: Past,
    outlines: Outlines,
) -> Turning:
    """Return how the predicted miss in a fixed direction changes with the label in a piece.

    Without rates, by (12): with the middle c of the piece, z + V x/e = (z + V x_c/e) + V (x -
    x_c)/e, and the V of the second term lies within its extrapolated bounds V_c +- rho, from the
    supports along the axis of `law`, which must be in `outlines`. With rates by (13), in the
    coordinates of the middle of the window.
    """
    e = law.closing_speed
    if past.errors is not None:
        centre = 0.5 * (near + far)
        drifts = past.room.drifts[law.channel]
        slope = -drifts[0] / e
        return Turning(slope, slope * (centre - middle_label(centre, past)), drifts[1])

    labels = outlines.labels[:number]
    supports = outlines.supports[:, :number]
    v_max = bound_between(labels, supports[V_MAX], first, near, far, 0.0)
    v_min = -bound_between(labels, supports[MINUS_V_MIN], first, near, far, 0.0)
    room = 0.5 * (v_max - v_min) * ((far - near) / (2.0 * e))
    return Turning(0.5 * (v_max + v_min) / e, 0.0, room)


@allocation_free
def bound_piece(
    near: float, far: float, number: int, first: int, past: Past, outlines: Outlines
) -> float:
    """Return the bound (12) of the miss over all labels from `near` to `far`, without the error of
    the speed, m.

    The support of the sections in a fixed direction is a concave function of the label, but the
    direction of z + V x/e turns with the label, see `turning_of`. Of the `number` replayed labels,
    `first` are at most `near`, and the others at least `far`.
    """
    labels = outlines.labels[:number]
    supports = outlines.supports[:, :number]
    centre = 0.5 * (near + far)
    middle = centre if past.errors is None else middle_label(centre, past)
    total = 0.0
    for channel in range(past.laws.shape[0]):
        law = law_of(past.laws, channel)
        tau = time_to_go(middle, past.log.elapsed, law)
        # `bound_between` reads two labels on each side of the piece.
        write_supports(channel, max(first - 2, 0), min(first + 2, number), tau, outlines)
        slope, offset, room = turning_of(near, far, number, first, law, past, outlines)

        moved, turn = later_impulses(near, far, 1.0, past, law)
        upper = bound_between(labels, supports[UPPER_MISS], first, near, far, slope - turn)
        upper = upper + offset - moved
        moved, turn = later_impulses(near, far, -1.0, past, law)
        lower = bound_between(labels, supports[MINUS_LOWER_MISS], first, near, far, -slope - turn)
        lower = lower - offset - moved
        # The farthest label has the most time to drift.
        drift = 0.5 * law.disturbance * time_to_go(far, past.log.elapsed, law) ** 2
        farther = max(upper + law.aim, lower - law.aim) + law.aim_error
        total = math.hypot(total, farther + room + drift)
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
        # A range of zero would make the margin infinite: ranges below 1 m count as 1 m.
        margin += size * (SLACK + width / max(tau * law.closing_speed, 1.0))
    return margin
