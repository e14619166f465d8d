"""Location of the feasible labels of an engagement by replay, and new grids of sections over them.

If the set is convex in (z, V, label), the feasible labels form one interval. This holds for the
guaranteed model without rates. With rates the search finds one interval and does not narrow the
limits of the labels to it; before it reports that no label is feasible, it searches windows of
labels with bands that are convex there. See docs/guarantee-miss.md for the other cases.
"""

from __future__ import annotations

from typing import NamedTuple

from infoset._compile import ZERO, allocation_free, entry, pasted
from infoset.arrays import Flags, Floats
from infoset.engine.chain_storage import copy_section, room_of, view_of
from infoset.engine.chains import CAPACITY, count_of
from infoset.engine.label_search import (
    FIRST,
    LABEL_RESOLUTION,
    LAST,
    MIDDLE,
    FeasibleLabels,
    narrow_ends,
    search_bracket,
)
from infoset.engine.replays import empties_later, evaluate_label, run
from infoset.engine.section_law import Laws, law_of
from infoset.engine.section_life import NEVER_EMPTIED, summarise_section
from infoset.engine.section_passes import Sections, row_of
from infoset.engine.window_search import search_windows
from infoset.engine.workspace import (
    LAST_REPLAY,
    LOWER,
    ROWS,
    UPPER,
    Past,
    keep_section,
    select,
)


class KnownLabels(NamedTuple):
    """Labels in `known` of the workspace: the limits of the search, which are the first and the
    last one, and the stored labels between them.

    Parameters
    ----------
    last : int
        Index of the upper limit.
    some_feasible : bool
        Whether a label is known to be feasible.
    lowest_feasible, highest_feasible : int
        Indices of the lowest and the highest feasible label; zero, the index of the lower limit,
        also if none is known.
    """

    last: int
    some_feasible: bool
    lowest_feasible: int
    highest_feasible: int


@allocation_free
def list_known_labels(
    b: int, limit_below: float, limit_above: float, sections: Sections, past: Past
) -> KnownLabels:
    """Write the limits and the stored labels strictly between them to the workspace.

    The limits have only their labels: whether they are feasible is not known yet.
    """
    known = past.room.known
    known[0].label = limit_below
    last = ZERO + 1
    lowest = ZERO
    highest = ZERO
    for s in range(sections.used[b]):
        slot = sections.slots[b, s]
        # Labels of a grid over a very short interval may be equal. A bracket needs different ones.
        if not known[last - 1].label < slot.label < limit_above:
            continue
        record = known[last]
        record.label = slot.label
        record.emptied_at = NEVER_EMPTIED if slot.feasible else slot.emptied_at
        record.overlap = slot.overlap
        record.emptied_axis = slot.emptied_axis
        if slot.feasible:
            # Index 0 is the lower limit: no feasible label so far.
            if lowest == 0:
                lowest = last
            highest = last
        last += 1
    known[last].label = limit_above
    return KnownLabels(last, highest > 0, lowest, highest)


@pasted
def check_limits(labels: KnownLabels, past: Past) -> KnownLabels:
    """Replay the limits of the search where no infeasible label separates them from the feasible
    ones, and where no label is known to be feasible.

    The sections at feasible limits are in the rows `LOWER` and `UPPER` of the workspace afterwards.
    """
    known = past.room.known
    last, some_feasible, lowest, highest = labels
    # The labels 1 and last - 1 are next to the limits.
    if (not some_feasible or lowest == 1) and evaluate_label(known, ZERO, known[0].label, past):
        keep_section(past, LOWER)
        lowest = ZERO
        some_feasible = True
    if (not some_feasible or highest == last - 1) and evaluate_label(
        known, last, known[last].label, past
    ):
        keep_section(past, UPPER)
        if not some_feasible:
            lowest = last
        highest = last
        some_feasible = True
    return KnownLabels(last, some_feasible, lowest, highest)


@allocation_free
def bracket_latest(last: int, past: Past) -> None:
    """Write the bracket of the known label that empties last: this label and its neighbours.

    Of equal labels it is the first. A limit of the search is its own neighbour on the outer side.
    All known labels are infeasible, and the limits are replayed.
    """
    known = past.room.known
    bracket = past.room.bracket
    best = 0
    for i in range(1, last + 1):
        if empties_later(known[i], known[best]):
            best = i
    bracket[FIRST] = known[max(best - 1, 0)]
    bracket[MIDDLE] = known[best]
    bracket[LAST] = known[min(best + 1, last)]


@pasted
def bracket_found(label: float, last: int, past: Past) -> None:
    """Write the bracket of a feasible label between known labels: this label and its neighbours.

    The neighbours are replayed. The sections at feasible ones, which then count as limits of the
    search, are in the rows `LOWER` and `UPPER` of the workspace afterwards.
    """
    known = past.room.known
    below = known[0].label
    above = known[last].label
    for i in range(1, last):
        if known[i].label < label:
            below = known[i].label
        elif label < known[i].label < above:
            above = known[i].label
    bracket = past.room.bracket
    bracket[MIDDLE].label = label
    if evaluate_label(bracket, FIRST, below, past):
        keep_section(past, LOWER)
    if evaluate_label(bracket, LAST, above, past):
        keep_section(past, UPPER)


@pasted
def locate_feasible_labels(
    b: int, limit_below: float, limit_above: float, sections: Sections, past: Past
) -> FeasibleLabels:
    """Locate the feasible labels of engagement `b` within limits, from its stored labels.

    The limits, m, are the first and the last known label. If `exists`, the sections at both ends
    are in the rows `LOWER` and `UPPER` of the workspace afterwards.
    """
    nothing = FeasibleLabels(False, limit_below, limit_below, limit_above, limit_above)
    if limit_below > limit_above:
        return nothing
    known = past.room.known
    bracket = past.room.bracket
    labels = list_known_labels(b, limit_below, limit_above, sections, past)
    labels = check_limits(labels, past)
    if labels.some_feasible:
        bracket[FIRST] = known[max(labels.lowest_feasible - 1, 0)]
        bracket[LAST] = known[min(labels.highest_feasible + 1, labels.last)]
        lower = known[labels.lowest_feasible].label
        upper = known[labels.highest_feasible].label
    else:
        bracket_latest(labels.last, past)
        if not search_bracket(past):
            exists, label = search_windows(limit_below, limit_above, past, past.errors)
            if not exists:
                return nothing
            bracket_found(label, labels.last, past)
        lower = bracket[MIDDLE].label
        upper = lower
    # The outer labels of the bracket are infeasible, or feasible limits whose sections are stored.
    resolution = LABEL_RESOLUTION * max(abs(limit_below), abs(limit_above))
    return narrow_ends(lower, upper, resolution, past)


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


@pasted
def fill_slot(
    b: int, s: int, number: int, labels: FeasibleLabels, sections: Sections, past: Past
) -> int:
    """Write the section of label `s` of a grid of `number` to its slot; return the number of
    vertices that it may gain, `CAPACITY` if the label is infeasible.

    A grid of one label is the middle of the feasible labels. The sections at the ends are in the
    rows `LOWER` and `UPPER` of the workspace.
    """
    slot = sections.slots[b, s]
    row = LAST_REPLAY
    share = 0.5
    if number > 1:
        share = s / (number - 1)
        if s == 0:
            row = LOWER
        elif s == number - 1:
            row = UPPER
    slot.label = labels.lower + share * (labels.upper - labels.lower)
    if row == UPPER:
        # Bit for bit the label whose section is stored; the sum above is rounded.
        slot.label = labels.upper

    if row == LAST_REPLAY:
        emptying = run(slot.label, past)
        slot.emptied_at = emptying.emptied_at
        slot.overlap = emptying.overlap
        slot.emptied_axis = emptying.emptied_axis
    else:
        slot.emptied_at = NEVER_EMPTIED
        slot.overlap = 0.0
    slot.feasible = slot.emptied_at == NEVER_EMPTIED
    if not slot.feasible:
        return CAPACITY

    spare = CAPACITY
    for channel in range(past.laws.shape[0]):
        n = row_of(sections, channel, b, s)
        copy_section(past.room.chains, ROWS * channel + row, sections.chains, n)
        section = view_of(sections.chains, n, slot.label)
        law = law_of(past.laws, channel)
        summarise_section(section, past.log.elapsed, law, sections.summaries, b, s)
        spare = min(spare, room_of(section) - count_of(section))
    return spare


@entry
def refine_all(
    wanted: Flags, number: int, limits: tuple[Floats, Floats], past: Past, sections: Sections
) -> int:
    """Replace the sections of the wanted engagements by a grid of `number` over the feasible
    labels, ends included.

    Return the number of vertices that every new section may gain. If no label is feasible, the
    engagement has no feasible section afterwards, and keeps its labels. `sections.unproved` is set,
    never reset, if a section was reduced or the search proves nothing. The limits of the labels,
    each of shape (B,), are narrowed to infeasible labels, except where other labels may be feasible
    beyond them: with rates, and with an error bound that rises with range in the paper's model.
    """
    spare = CAPACITY
    slots = sections.slots
    used = sections.used
    limit_below, limit_above = limits
    for b in range(len(used)):
        if not wanted[b]:
            continue
        select(past, b)
        labels = locate_feasible_labels(b, limit_below[b], limit_above[b], sections, past)
        for s in range(used[b]):
            slots[b, s].feasible = False
        if not labels.exists:
            sections.unproved[b] |= past.room.unproved[0]
            continue

        if past.errors is None and is_convex(past.laws):
            limit_below[b] = labels.below
            limit_above[b] = labels.above
        used[b] = number
        for s in range(number):
            spare = min(spare, fill_slot(b, s, number, labels, sections, past))
        # Replays of the new labels may have reduced a section too.
        sections.unproved[b] |= past.room.unproved[0]
    return spare
