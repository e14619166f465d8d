"""Search for the feasible labels: those whose section is not empty. Each evaluation of a label
replays the history.

If the set is convex in (z, V, label), the feasible labels form one interval. This holds for the
guaranteed model without rates. With rates the search finds one interval and does not narrow the
limits of the labels to it; before it reports that no label is feasible, it searches windows of
labels with bands that are convex there. See docs/guarantee.md for the other cases.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from infoset._compile import allocation_free, constants, entry, pasted
from infoset.arrays import Flags, Floats
from infoset.engine.chain_storage import copy_section, room_of, view_of
from infoset.engine.chains import CAPACITY, count_of
from infoset.engine.concave_bounds import is_infeasible_between
from infoset.engine.replays import (
    LAST_REPLAY,
    LOWER,
    MAX_HALVED_WINDOWS,
    ROWS,
    UPPER,
    Past,
    Record,
    empties_later,
    evaluate_label,
    keep_feasible,
    keep_section,
    run,
    select,
    with_window,
)
from infoset.engine.section_law import Laws, law_of
from infoset.engine.section_life import NEVER_EMPTIED, summarise_section
from infoset.engine.section_passes import Sections, row_of

FIRST, MIDDLE, LAST = constants(3)
"""Indices of a bracket of three labels."""
LABEL_RESOLUTION = 1e-13
"""Accuracy of the ends of the feasible labels, relative to the labels: some 500 ulp, so that
evaluations differ; 1 um of range in the scenario of 1997.
"""
COARSE = 1.0 / 64.0
"""Accuracy of an end in a window for Phi, relative to the feasible labels there: bounds hold up to
the infeasible label.
"""
NARROWEST = 1e-15
"""Width of an interval of feasible labels that the search may miss, relative to the labels: 5 to 9
ulp. The slack of the cuts makes the labels next to the label of a true state feasible over a wider
interval.
"""
MAX_EVALUATIONS = 200
"""Maximum number of evaluations of one search; bisection alone needs 53 to divide an interval to an
ulp.
"""


class FeasibleLabels(NamedTuple):
    """Interval of feasible labels [lower, upper], m, and a bracket of each end: `below` and
    `above`.

    The outer two labels are infeasible, or equal to an end at a limit of the search. `exists` is
    whether a label is feasible.
    """

    exists: bool
    below: float
    lower: float
    upper: float
    above: float


@allocation_free
def locate_end(
    infeasible: Record,
    feasible: float,
    resolution: float,
    past: Past,
    row: int,
) -> tuple[float, float]:
    """Narrow the bracket between an infeasible and a feasible label; return the bracket in this
    order.

    The section at the feasible label is stored in `row` of the workspace. The overlap at the event
    that makes the section empty is a concave function of the label, so that the Illinois variant of
    regula falsi converges fast. If four evaluations have not narrowed the bracket to an eighth,
    because that event changes with the label, one bisection follows.
    """
    run(feasible, past)
    keep_feasible(past, row)
    end = infeasible.label
    emptied_at = infeasible.emptied_at
    overlap = infeasible.overlap
    emptied_axis = infeasible.emptied_axis
    infeasible_weight = overlap
    feasible_weight = past.room.feasible_overlaps[emptied_axis, emptied_at]
    side = 0
    before = 0.0
    first = feasible
    for evaluations in range(MAX_EVALUATIONS):
        width = abs(feasible - end)
        coarse = past.errors is not None and past.thinned
        if width <= resolution or (coarse and width <= COARSE * abs(feasible - first)):
            break
        slow = evaluations % 4 == 3 and width > 0.125 * before
        if evaluations % 4 == 0:
            before = width
        fraction = 0.5
        if not slow and feasible_weight > infeasible_weight:
            # An evaluation at an end gives no information: keep half a resolution away from both.
            minimum = 0.5 * resolution / width
            fraction = min(
                max(-infeasible_weight / (feasible_weight - infeasible_weight), minimum),
                1.0 - minimum,
            )
        label = end + fraction * (feasible - end)
        new_emptied_at, new_overlap, new_emptied_axis = run(label, past)
        if new_emptied_at == NEVER_EMPTIED:
            feasible = label
            keep_feasible(past, row)
            feasible_weight = past.room.feasible_overlaps[emptied_axis, emptied_at]
            infeasible_weight = 0.5 * infeasible_weight if side == 1 else overlap
            side = 1
        else:
            end = label
            emptied_at = new_emptied_at
            overlap = new_overlap
            emptied_axis = new_emptied_axis
            infeasible_weight = overlap
            feasible_weight = (0.5 if side == -1 else 1.0) * past.room.feasible_overlaps[
                emptied_axis, emptied_at
            ]
            side = -1
    return end, feasible


@allocation_free
def search_feasible_label(past: Past) -> bool:
    """Search for a feasible label between the first three known ones, which are infeasible; the
    middle one empties later than the others.

    Return whether the middle label is feasible now; if not, the bracket has no feasible label. The
    pair (event, overlap) is a unimodal function of the label: the larger half of the bracket is
    evaluated at its middle. The search ends if the bracket is as narrow as `NARROWEST`, or if no
    label in it can be feasible.
    """
    known = past.room.known
    four = past.room.four
    for _ in range(MAX_EVALUATIONS):
        if known[2].label - known[0].label <= NARROWEST * known[2].label:
            return False
        lower_half = known[1].label - known[0].label > known[2].label - known[1].label
        outer, at = (0, 1) if lower_half else (2, 2)
        for i in range(3):
            four[i if i < at else i + 1] = known[i]
        is_feasible = evaluate_label(four, at, 0.5 * (known[1].label + known[outer].label), past)
        if not is_feasible and is_infeasible_between(four, past.room.latest):
            return False
        if is_feasible or empties_later(four[at], known[1]):
            known[2 - outer], known[1] = known[1], four[at]
            if is_feasible:
                return True
        else:
            known[outer] = four[at]
    return False


@allocation_free
def search_window(
    lower: float,
    upper: float,
    first: float,
    past: Past,
) -> bool:
    """Return whether a label of the window is feasible with the bands that are convex on it.

    `first` is the first label replayed. If a label is feasible, it is the second of the known ones
    afterwards.
    """
    known = past.room.known
    for i, label in ((MIDDLE, first), (FIRST, lower), (LAST, upper)):
        if evaluate_label(known, i, label, past):
            known[1] = known[i]
            return True
    return search_bracket(past)


@allocation_free
def search_bracket(past: Past) -> bool:
    """Return whether a label between the first three known ones, which are infeasible, is feasible;
    it is then the second one.
    """
    known = past.room.known
    for end in (0, 2):
        if empties_later(known[end], known[1]):
            known[2 - end] = known[1]
            known[1] = known[end]
            break
    return search_feasible_label(past)


@allocation_free
def search_everywhere(
    lower: float, upper: float, past: Past, errors: Floats | None
) -> tuple[bool, float]:
    """Find a feasible label within limits if the feasible labels need not form an interval, or
    prove that none is feasible.

    A window without feasible labels under the bands that are convex on it is discarded. The others
    are halved until they are as narrow as `NARROWEST`, beginning with the one in which an evaluated
    label empties last with its own bands.

    Only rates make the search necessary. `errors` are those of the history, as in `replay`.
    """
    if errors is None:
        return False, lower
    windows = past.room.windows
    evaluated = past.room.four
    windows[0].near = lower
    windows[0].far = upper
    windows[0].emptied_at = NEVER_EMPTIED
    windows[0].overlap = 0.0
    count = 1
    for _ in range(MAX_HALVED_WINDOWS):
        if count == 0:
            break
        best = 0
        for i in range(1, count):
            if empties_later(windows[i], windows[best]):
                best = i
        near = windows[best].near
        far = windows[best].far
        middle = 0.5 * (near + far)
        count -= 1
        windows[best] = windows[count]
        for p, q in ((near, middle), (middle, far)):
            if not search_window(p, q, 0.5 * (p + q), with_window(past, p, q)):
                continue
            new = windows[count]
            new.near, new.far, new.emptied_at, new.overlap = p, q, -1, -np.inf
            for label in (past.room.known[1].label, p, q):
                if evaluate_label(evaluated, FIRST, label, past):
                    return True, label
                if empties_later(evaluated[0], new):
                    new.emptied_at, new.overlap = evaluated[0].emptied_at, evaluated[0].overlap
            count += q - p > NARROWEST * q
    return False, lower


@pasted
def locate_feasible_labels(
    b: int,
    limit_below: float,
    limit_above: float,
    sections: Sections,
    past: Past,
) -> FeasibleLabels:
    """Locate the feasible labels of an engagement within limits, from its stored labels.

    The sections at both ends are left in the workspace.
    """
    none_feasible = FeasibleLabels(False, limit_below, limit_below, limit_above, limit_above)
    if limit_below > limit_above:
        return none_feasible
    resolution = LABEL_RESOLUTION * max(abs(limit_below), abs(limit_above))
    # The limits, and the stored labels between them.
    slots = sections.slots
    stored = sections.used[b]
    known = past.room.known
    end = FIRST + 1
    first = last = 0
    known[0].label = limit_below
    for s in range(stored):
        slot = slots[b, s]
        # Labels of a grid over a very short interval may be equal. A bracket needs different ones.
        if known[end - 1].label < slot.label < limit_above:
            new = known[end]
            new.label, new.overlap, new.emptied_axis = slot.label, slot.overlap, slot.emptied_axis
            new.emptied_at = NEVER_EMPTIED if slot.feasible else slot.emptied_at
            if slot.feasible:
                first = first if last > 0 else end
                last = end
            end += 1
    known[end].label = limit_above
    some_feasible = last > 0
    # A limit must be replayed only if no infeasible label separates it from the feasible ones.
    if (not some_feasible or first == 1) and evaluate_label(known, FIRST, limit_below, past):
        keep_section(past, LOWER)
        first, some_feasible = 0, True
    if (not some_feasible or last == end - 1) and evaluate_label(known, end, limit_above, past):
        keep_section(past, UPPER)
        first = first if some_feasible else end
        last = end
        some_feasible = True
    if not some_feasible:
        best = 0
        for i in range(1, end + 1):
            if empties_later(known[i], known[best]):
                best = i
        # Bracket of the label that empties last: this label and its neighbours, at the front of the
        # same array.
        past.room.four[0] = known[best]
        known[0], known[2] = known[max(best - 1, 0)], known[min(best + 1, end)]
        known[1] = past.room.four[0]
        first, last, end = 1, 1, 2
        if not search_feasible_label(past):
            found, label = search_everywhere(limit_below, limit_above, past, past.errors)
            if not found:
                return none_feasible
            below = limit_below
            above = limit_above
            for s in range(stored):
                stored_label = slots[b, s].label
                if below < stored_label < label:
                    below = stored_label
                elif label < stored_label < above:
                    above = stored_label
            known[1].label = label
            if evaluate_label(known, FIRST, below, past):
                keep_section(past, LOWER)
                first = 0
            if evaluate_label(known, LAST, above, past):
                keep_section(past, UPPER)
                last = 2
    below = lower = known[first].label
    if first > 0:
        below, lower = locate_end(known[first - 1], lower, resolution, past, LOWER)
    above = upper = known[last].label
    if last < end:
        above, upper = locate_end(known[last + 1], upper, resolution, past, UPPER)
    return FeasibleLabels(True, below, lower, upper, above)


@allocation_free
def is_convex(laws: Laws) -> bool:
    """Whether sets without rates are convex along all axes, so that the feasible labels form one
    interval.
    """
    for channel in range(laws.shape[0]):
        law = law_of(laws, channel)
        if not law.exact_angles and law.error_slope > 0.0:
            return False
    return True


@entry
def refine_all(
    wanted: Flags, number: int, limits: tuple[Floats, Floats], past: Past, sections: Sections
) -> int:
    """Replace the sections of the wanted engagements by a grid of `number` over the feasible
    labels, ends included.

    Return the number of vertices that every new section may gain. If no label is feasible, the
    engagement has no feasible section afterwards. The limits of the labels, each of shape (B,), are
    narrowed to infeasible labels, except where other labels may be feasible beyond them: with
    rates, and with an error bound that rises with range in the paper's model.
    """
    spare = CAPACITY
    slots = sections.slots
    used = sections.used
    laws = past.laws
    limit_below, limit_above = limits
    for b in range(len(used)):
        if not wanted[b]:
            continue
        select(past, b)
        feasible = locate_feasible_labels(b, limit_below[b], limit_above[b], sections, past)
        for s in range(used[b]):
            slots[b, s].feasible = False
        if not feasible.exists:
            continue
        if past.errors is None and is_convex(laws):
            limit_below[b] = feasible.below
            limit_above[b] = feasible.above
        used[b] = number
        for s in range(number):
            share = s / (number - 1) if number > 1 else 0.5
            label = feasible.lower + share * (feasible.upper - feasible.lower)
            if s > 0 and s == number - 1:
                label = feasible.upper
            slot = slots[b, s]
            row = LAST_REPLAY
            slot.label = label
            if number > 1 and (s == 0 or s == number - 1):
                row = LOWER if s == 0 else UPPER
                slot.emptied_at = NEVER_EMPTIED
                slot.overlap = 0.0
            else:
                slot.emptied_at, slot.overlap, slot.emptied_axis = run(label, past)
            slot.feasible = slot.emptied_at == NEVER_EMPTIED
            if slot.feasible:
                for channel in range(laws.shape[0]):
                    n = row_of(sections, channel, b, s)
                    law = law_of(laws, channel)
                    copy_section(past.room.chains, ROWS * channel + row, sections.chains, n)
                    section = view_of(sections.chains, n, label)
                    summarise_section(section, past.log.elapsed, law, sections.summaries, b, s)
                    spare = min(spare, room_of(section) - count_of(section))
    return spare
