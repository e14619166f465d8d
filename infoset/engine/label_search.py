"""Searches over labels by replay: for a feasible label in a bracket, and for the ends of the
feasible labels.

A bracket is three records of replayed labels in increasing order, in the workspace. The pair (event
at which a label became empty, overlap at this event) is a unimodal function of the label if the set
is convex, so that a bracket whose middle label empties later than the outer ones contains all
feasible labels.
"""

from __future__ import annotations

from typing import NamedTuple

from infoset._compile import allocation_free, constants, pasted
from infoset.engine.concave_bounds import is_infeasible_between
from infoset.engine.replays import Emptying, empties_later, evaluate_label, run
from infoset.engine.section_life import NEVER_EMPTIED
from infoset.engine.workspace import LOWER, UPPER, Past, Record, keep_feasible

FIRST, MIDDLE, LAST = constants(3)
"""Indices of the labels of a bracket."""
LABEL_RESOLUTION = 1e-13
"""Accuracy of the ends of the feasible labels, relative to the labels: some 500 ulp, so that
evaluations differ; 1 um of range in the scenario of 1997."""
COARSE = 1.0 / 64.0
"""With rates, accuracy of an end in a window for Phi, relative to the length of the feasible labels
found so far: bounds hold up to the infeasible label. Chosen: a piece that decides Phi is divided,
and its ends with it.
Phi of flights of ten seconds is the same from 1/256 to 1/4 (measured).
"""
NARROWEST = 1e-15
"""Width of an interval of feasible labels that the search may miss, relative to the labels: 5 to 9
ulp. The slack of the cuts makes the labels next to the label of a true state feasible over a wider
interval: 149 ulp in the narrowest engagement found (docs/guarantee.md).
"""
MAX_EVALUATIONS = 200
"""Maximum number of evaluations of one search; bisection alone needs 53 to divide an interval to an
ulp.
"""


class FeasibleLabels(NamedTuple):
    """Interval [lower, upper] of feasible labels, m, and labels `below` and `above` it.

    The outer two labels are infeasible, or equal to an end at a limit of the search. `exists` is
    whether a label is feasible.
    """

    exists: bool
    below: float
    lower: float
    upper: float
    above: float


@allocation_free
def share_to_zero(infeasible_overlap: float, feasible_overlap: float, minimum: float) -> float:
    """Return where the line through the overlaps at two labels is zero, as a share of the distance
    from the infeasible label; it keeps a share of `minimum`, at most 0.5, away from both.

    The share is 0.5 if the line does not increase.
    """
    if feasible_overlap <= infeasible_overlap:
        return 0.5
    share = -infeasible_overlap / (feasible_overlap - infeasible_overlap)
    return min(max(share, minimum), 1.0 - minimum)


@allocation_free
def locate_end(
    outside: Record, feasible: float, resolution: float, past: Past, row: int
) -> tuple[float, float]:
    """Narrow the bracket between an infeasible label, a record, and a feasible one; return both.

    The section at the feasible label is stored in `row` of the workspace. The overlap at the event
    that makes the section empty is a concave function of the label, so that the Illinois variant of
    regula falsi converges fast: if one end stays twice in a row, half of its overlap is used. If
    three evaluations have not narrowed the bracket to an eighth, because that event changes with
    the label, the fourth one is a bisection.
    """
    run(feasible, past)
    keep_feasible(past, row)
    feasible_overlaps = past.room.feasible_overlaps
    # Of all replays only those of windows for Phi are thinned.
    is_coarse = past.errors is not None and past.thinned
    known = feasible
    infeasible = outside.label
    emptying = Emptying(outside.emptied_at, outside.overlap, outside.emptied_axis)
    infeasible_weight = emptying.overlap
    feasible_weight = feasible_overlaps[emptying.emptied_axis, emptying.emptied_at]
    # The end that was moved last: 1 the feasible one, -1 the infeasible one.
    last_moved = 0
    width_before = 0.0
    for evaluations in range(MAX_EVALUATIONS):
        width = abs(feasible - infeasible)
        if width <= resolution or (is_coarse and width <= COARSE * abs(feasible - known)):
            break
        is_slow = evaluations % 4 == 3 and width > 0.125 * width_before
        if evaluations % 4 == 0:
            width_before = width

        share = 0.5
        if not is_slow:
            # An evaluation at an end gives no information: keep half a resolution away from both.
            minimum = 0.5 * resolution / width
            share = share_to_zero(infeasible_weight, feasible_weight, minimum)
        label = infeasible + share * (feasible - infeasible)
        new = run(label, past)
        if new.emptied_at == NEVER_EMPTIED:
            feasible = label
            keep_feasible(past, row)
            feasible_weight = feasible_overlaps[emptying.emptied_axis, emptying.emptied_at]
            infeasible_weight = 0.5 * infeasible_weight if last_moved == 1 else emptying.overlap
            last_moved = 1
        else:
            infeasible = label
            emptying = new
            infeasible_weight = emptying.overlap
            feasible_weight = feasible_overlaps[emptying.emptied_axis, emptying.emptied_at]
            if last_moved == -1:
                feasible_weight *= 0.5
            last_moved = -1
    return infeasible, feasible


@pasted
def narrow_ends(lower: float, upper: float, resolution: float, past: Past) -> FeasibleLabels:
    """Locate both ends of the feasible labels; their sections are in the rows `LOWER` and `UPPER`
    of the workspace afterwards.

    `lower` and `upper` are feasible labels, and the outer labels of the bracket in the workspace
    are infeasible, or feasible limits of the search, whose sections are in these rows already.
    """
    outside_below = past.room.bracket[FIRST]
    outside_above = past.room.bracket[LAST]
    below = outside_below.label
    if outside_below.emptied_at == NEVER_EMPTIED:
        lower = below
    else:
        below, lower = locate_end(outside_below, lower, resolution, past, LOWER)

    above = outside_above.label
    if outside_above.emptied_at == NEVER_EMPTIED:
        upper = above
    else:
        above, upper = locate_end(outside_above, upper, resolution, past, UPPER)
    return FeasibleLabels(True, below, lower, upper, above)


@allocation_free
def search_bracket(past: Past) -> bool:
    """Search for a feasible label in the bracket of the workspace, whose labels are infeasible and
    whose middle one empties last.

    Return whether the middle label is feasible now. If not, no feasible label was found, and
    `room.unproved` is set unless it is proved that there is none. The larger half of the bracket is
    evaluated at its middle. The search ends if the bracket is as narrow as `NARROWEST`, after
    `MAX_EVALUATIONS`, or if no label in it can be feasible. The last is a proof, and so is a
    bracket of one label.
    """
    bracket = past.room.bracket
    four = past.room.four
    for _ in range(MAX_EVALUATIONS):
        lower_half = bracket[MIDDLE].label - bracket[FIRST].label
        upper_half = bracket[LAST].label - bracket[MIDDLE].label
        width = bracket[LAST].label - bracket[FIRST].label
        if width == 0.0:
            return False
        if width <= NARROWEST * bracket[LAST].label:
            break

        outer = FIRST if lower_half > upper_half else LAST
        other = LAST - outer
        # The index of the new label among four, next to the outer label.
        at = 1 if outer == FIRST else 2
        for i in range(3):
            four[i if i < at else i + 1] = bracket[i]
        label = 0.5 * (bracket[MIDDLE].label + bracket[outer].label)
        is_feasible = evaluate_label(four, at, label, past)
        if not is_feasible and is_infeasible_between(four, past.room.latest):
            return False

        if is_feasible or empties_later(four[at], bracket[MIDDLE]):
            bracket[other] = bracket[MIDDLE]
            bracket[MIDDLE] = four[at]
        else:
            bracket[outer] = four[at]
        if is_feasible:
            return True
    past.room.unproved[0] = True
    return False


@allocation_free
def order_bracket(past: Past) -> None:
    """Make the middle label of the bracket in the workspace the one that empties last.

    If it is an outer label, the bracket becomes this label, twice, and the middle one. Only one
    outer label can empty later than the middle one, because the pair is unimodal.
    """
    bracket = past.room.bracket
    for end in (FIRST, LAST):
        if empties_later(bracket[end], bracket[MIDDLE]):
            bracket[LAST - end] = bracket[MIDDLE]
            bracket[MIDDLE] = bracket[end]
            break
