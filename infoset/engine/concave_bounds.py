"""Bounds of a concave function of the label between sampled labels: of supports and of overlaps."""

from __future__ import annotations

import numpy as np

from infoset._compile import ZERO, allocation_free
from infoset.arrays import Floats
from infoset.engine.workspace import Records

CERTAIN = 1e-13
"""Labels count as infeasible if their overlap is certainly less than minus this number, 450 ulp,
times the greatest of them: the rounding error of an overlap is a few ulp of the terms of a height,
which are less than the label."""


@allocation_free
def line_at(x: float, x0: float, y0: float, x1: float, y1: float) -> float:
    """Value at x of the line through two points."""
    return y0 + (y1 - y0) * ((x - x0) / (x1 - x0))


@allocation_free
def bound_between(
    labels: Floats, values: Floats, first: int, p: float, q: float, slope: float
) -> float:
    """Upper bound of f(x) + slope (x - c) for all x of the interval [p, q] with the middle c, where
    f is a concave function: (12) of docs/guarantee-miss.md.

    `values` are the values of f at increasing `labels`. The first `first` labels are at most p, and
    the others at least q: none is between p and q. Outside of two of its points, a concave function
    lies below the line through them. The bound is infinite if neither side has two labels.
    """
    has_left = first >= 2
    has_right = labels.size - first >= 2
    left_p = left_q = right_p = right_q = np.inf
    if has_left:
        a = first - 2
        b = first - 1
        left_p = line_at(p, labels[a], values[a], labels[b], values[b])
        left_q = line_at(q, labels[a], values[a], labels[b], values[b])
    if has_right:
        a = first
        b = first + 1
        right_p = line_at(p, labels[a], values[a], labels[b], values[b])
        right_q = line_at(q, labels[a], values[a], labels[b], values[b])

    middle = 0.5 * (p + q)
    bound_p = min(left_p, right_p) + slope * (p - middle)
    bound_q = min(left_q, right_q) + slope * (q - middle)
    bound = max(bound_p, bound_q)
    if has_left and has_right and (left_p < right_p) != (left_q < right_q):
        # The lines intersect between p and q, where their minimum has a corner.
        share = (right_p - left_p) / ((right_p - left_p) - (right_q - left_q))
        x = p + share * (q - p)
        bound = max(bound, left_p + share * (left_q - left_p) + slope * (x - middle))
    return bound


@allocation_free
def is_infeasible_between(infeasible: Records, room: Floats) -> bool:
    """Return whether no label between the first and the last infeasible one can be feasible.

    False if that is not proven. `infeasible` are records with increasing labels. The overlap at the
    last event at which one of them became empty is a concave function of the label. Only the labels
    that became empty at this event have its overlap (negative: empty); an equal label counts once.
    With the slope 0, `bound_between` adds no line. `room`, shape (2, len(infeasible)), is a working
    array.
    """
    last_event = infeasible[0].emptied_at
    for i in range(1, len(infeasible)):
        last_event = max(last_event, infeasible[i].emptied_at)

    labels = room[0]
    overlaps = room[1]
    count = ZERO
    for i in range(len(infeasible)):
        record = infeasible[i]
        is_new = count == 0 or record.label > labels[count - 1]
        if record.emptied_at == last_event and is_new:
            labels[count] = record.label
            overlaps[count] = record.overlap
            count += 1
    labels = labels[:count]
    overlaps = overlaps[:count]

    minimum = infeasible[0].label
    maximum = infeasible[len(infeasible) - 1].label
    certain = -CERTAIN * maximum
    lowest = labels[0]
    highest = labels[count - 1]
    if minimum < lowest and bound_between(labels, overlaps, ZERO, minimum, lowest, 0.0) >= certain:
        return False
    for i in range(count - 1):
        if bound_between(labels, overlaps, i + 1, labels[i], labels[i + 1], 0.0) >= certain:
            return False
    if highest < maximum:
        return bool(bound_between(labels, overlaps, count, highest, maximum, 0.0) < certain)
    return True
