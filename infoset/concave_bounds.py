"""Bounds of a concave function between places where it is known: of supports over labels, and of their overlaps."""

from __future__ import annotations

import numpy as np

from infoset._compile import ZERO, allocation_free
from infoset.section_life import Floats, Integers

CERTAIN = 1e-13
"""Overlap, relative to the label, by which a label must be beyond life before those about it count as dead."""


@allocation_free
def line_at(x: float, x0: float, y0: float, x1: float, y1: float) -> float:
    """Value at x of the line through two points."""
    return y0 + (y1 - y0) * ((x - x0) / (x1 - x0))


@allocation_free
def bound_between(
    labels: Floats, values: Floats, number: int, first: int, p: float, q: float, slope: float, centre: float
) -> float:
    """Greatest value on [p, q] that a concave function with these values may have, plus slope (x - centre).

    Parameters
    ----------
    labels, values : ndarray
        Rising arguments, and the function there.
    number : int
        How many of them.
    first : int
        How many of the arguments are at most p; the others are at least q.
    p, q : float
        Ends of the stretch.
    slope, centre : float
        What is added.

    Notes
    -----
    Beyond two of its points a concave function stays below the line through them. Infinite where neither side has two.
    """
    has_left, has_right = first >= 2, number - first >= 2
    left_p = left_q = right_p = right_q = np.inf
    if has_left:
        a, b = first - 2, first - 1
        left_p = line_at(p, labels[a], values[a], labels[b], values[b])
        left_q = line_at(q, labels[a], values[a], labels[b], values[b])
    if has_right:
        a, b = first, first + 1
        right_p = line_at(p, labels[a], values[a], labels[b], values[b])
        right_q = line_at(q, labels[a], values[a], labels[b], values[b])
    best = max(min(left_p, right_p) + slope * (p - centre), min(left_q, right_q) + slope * (q - centre))
    if has_left and has_right and (left_p < right_p) != (left_q < right_q):
        share = (right_p - left_p) / ((right_p - left_p) - (right_q - left_q))
        x = p + share * (q - p)
        best = max(best, left_p + share * (left_q - left_p) + slope * (x - centre))
    return best


@allocation_free
def is_dead_between(labels: Floats, died: Integers, overlaps: Floats, number: int, latest: Floats) -> bool:
    """Whether no label from the first of these dead ones to the last can live, in rising order.

    `latest`, of shape (2, number), is room for those that died last.

    Notes
    -----
    The overlap at the latest of their deaths is concave in the label, among the labels that lived to see it.
    """
    last_event = died[0]
    for i in range(1, number):
        last_event = max(last_event, died[i])
    known, values = latest[0], latest[1]
    count = ZERO
    for i in range(number):
        if died[i] == last_event and (count == 0 or labels[i] > known[count - 1]):
            known[count], values[count] = labels[i], overlaps[i]
            count += 1
    rounding = -CERTAIN * labels[number - 1]
    if labels[0] < known[0] and bound_between(known, values, count, ZERO, labels[0], known[0], 0.0, 0.0) >= rounding:
        return False
    for i in range(count - 1):
        if bound_between(known, values, count, i + 1, known[i], known[i + 1], 0.0, 0.0) >= rounding:
            return False
    last = known[count - 1]
    return bool(
        last == labels[number - 1]
        or bound_between(known, values, count, count, last, labels[number - 1], 0.0, 0.0) < rounding
    )
