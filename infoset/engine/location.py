"""Search for the living labels: those whose section is not empty. Each probe of a label replays the
history.

If the set is convex in (z, V, label), the living labels form one interval. This holds for the
guaranteed model without rates. With rates the search finds one interval and does not narrow the
limits of the labels to it; before it reports that no label lives, it searches windows of labels
with bands that are convex there. See docs/guarantee.md for the other cases.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from infoset._compile import allocation_free, constants, entry, pasted
from infoset.arrays import Flags, Floats
from infoset.engine.chain_storage import copy_section, room_of, view_of
from infoset.engine.chains import CAPACITY, count_of
from infoset.engine.concave_bounds import is_dead_between
from infoset.engine.replays import (
    LOWER,
    MAX_HALVED_WINDOWS,
    PROBE,
    ROWS,
    UPPER,
    Past,
    Record,
    keep_living,
    keep_section,
    outlives,
    probe,
    run,
    select,
    with_window,
)
from infoset.engine.section_law import Laws, law_of
from infoset.engine.section_life import ALIVE, summarise_section
from infoset.engine.section_passes import Sections, row_of

FIRST, MIDDLE, LAST = constants(3)
"""Indices of a bracket of three labels."""
LABEL_RESOLUTION = 1e-13
"""Accuracy of the ends of the living labels, relative to the labels: some 500 ulp, so that probes
differ; 1 um of range in the scenario of 1997."""
COARSE = 1.0 / 64.0
"""Accuracy of an end in a window for Phi, relative to the living labels there: bounds hold up to
the dead label.
"""
NARROWEST = 1e-15
"""Width of an interval of living labels that the search may miss, relative to the labels: 5 to 9
ulp. The slack of the cuts makes the labels next to that of a true state live over a wider interval.
"""
MAX_PROBES = 200
"""Maximum number of probes of one search; bisection alone needs 53 to divide an interval to an
ulp.
"""


class Living(NamedTuple):
    """Interval of living labels [lower, upper], m, and a bracket of each end: `below` and `above`.

    The outer two labels are dead, or equal to an end at a limit of the search. `exists` is whether
    a label lives.
    """

    exists: bool
    below: float
    lower: float
    upper: float
    above: float


@allocation_free
def locate_end(
    dead: Record,
    living: float,
    resolution: float,
    past: Past,
    row: int,
) -> tuple[float, float]:
    """Narrow the bracket between a dead and a living label; return the bracket (dead, living).

    The section at the living label is stored in `row` of the workspace. The overlap at the event
    that makes the section empty is a concave function of the label, so that the Illinois variant of
    regula falsi converges fast. If four probes have not narrowed the bracket to an eighth, because
    that event changes with the label, one bisection follows.
    """
    run(living, past)
    keep_living(past, row)
    end = dead.label
    died = dead.died
    overlap = dead.overlap
    emptied = dead.emptied
    weight_dead = overlap
    weight_living = past.room.living_overlaps[emptied, died]
    side = 0
    before = 0.0
    first = living
    for probes in range(MAX_PROBES):
        width = abs(living - end)
        coarse = past.errors is not None and past.thinned
        if width <= resolution or (coarse and width <= COARSE * abs(living - first)):
            break
        slow = probes % 4 == 3 and width > 0.125 * before
        if probes % 4 == 0:
            before = width
        fraction = 0.5
        if not slow and weight_living > weight_dead:
            # A probe at an end gives no information: keep half a resolution away from both.
            minimum = 0.5 * resolution / width
            fraction = min(
                max(-weight_dead / (weight_living - weight_dead), minimum), 1.0 - minimum
            )
        label = end + fraction * (living - end)
        probe_died, probe_overlap, probe_emptied = run(label, past)
        if probe_died == ALIVE:
            living = label
            keep_living(past, row)
            weight_living = past.room.living_overlaps[emptied, died]
            weight_dead = 0.5 * weight_dead if side == 1 else overlap
            side = 1
        else:
            end = label
            died = probe_died
            overlap = probe_overlap
            emptied = probe_emptied
            weight_dead = overlap
            weight_living = (0.5 if side == -1 else 1.0) * past.room.living_overlaps[emptied, died]
            side = -1
    return end, living


@allocation_free
def search_living(past: Past) -> bool:
    """Search for a living label between the first three known ones, which are dead; the middle one
    outlives the others.

    Return whether the middle label now lives; if not, there is no living label in the bracket. The
    pair (event, overlap) is a unimodal function of the label: the larger half of the bracket is
    probed at its middle. The search ends if the bracket is as narrow as `NARROWEST`, or if no label
    in it can live.
    """
    known = past.room.known
    four = past.room.four
    for _ in range(MAX_PROBES):
        if known[2].label - known[0].label <= NARROWEST * known[2].label:
            return False
        lower_half = known[1].label - known[0].label > known[2].label - known[1].label
        outer, at = (0, 1) if lower_half else (2, 2)
        for i in range(3):
            four[i if i < at else i + 1] = known[i]
        lives = probe(four, at, 0.5 * (known[1].label + known[outer].label), past)
        if not lives and is_dead_between(four, past.room.latest):
            return False
        if lives or outlives(four[at], known[1]):
            known[2 - outer], known[1] = known[1], four[at]
            if lives:
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
    """Return whether a label of the window lives with the bands that are convex on the window.

    `first` is the first label replayed. If a label lives, it is the second of the known ones
    afterwards.
    """
    known = past.room.known
    for i, label in ((MIDDLE, first), (FIRST, lower), (LAST, upper)):
        if probe(known, i, label, past):
            known[1] = known[i]
            return True
    return search_bracket(past)


@allocation_free
def search_bracket(past: Past) -> bool:
    """Return whether a label lives between the first three known ones, which are dead; it is then
    the second one.
    """
    known = past.room.known
    for end in (0, 2):
        if outlives(known[end], known[1]):
            known[2 - end] = known[1]
            known[1] = known[end]
            break
    return search_living(past)


@allocation_free
def search_everywhere(
    lower: float, upper: float, past: Past, errors: Floats | None
) -> tuple[bool, float]:
    """Find a living label within limits if the living labels need not form an interval, or prove
    that none lives.

    A window without living labels under the bands that are convex on it is discarded. The others
    are halved until they are as narrow as `NARROWEST`, beginning with the one in which a probed
    label lived longest with its own bands.

    Only rates make the search necessary. `errors` are those of the history, as in `replay`.
    """
    if errors is None:
        return False, lower
    windows = past.room.windows
    probed = past.room.four
    windows[0].near = lower
    windows[0].far = upper
    windows[0].died = ALIVE
    windows[0].overlap = 0.0
    count = 1
    for _ in range(MAX_HALVED_WINDOWS):
        if count == 0:
            break
        best = 0
        for i in range(1, count):
            if outlives(windows[i], windows[best]):
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
            new.near, new.far, new.died, new.overlap = p, q, -1, -np.inf
            for label in (past.room.known[1].label, p, q):
                if probe(probed, FIRST, label, past):
                    return True, label
                if outlives(probed[0], new):
                    new.died, new.overlap = probed[0].died, probed[0].overlap
            count += q - p > NARROWEST * q
    return False, lower


@pasted
def locate_living(
    b: int,
    limit_below: float,
    limit_above: float,
    sections: Sections,
    past: Past,
) -> Living:
    """Locate the living labels of an engagement within limits, from its stored labels.

    The sections at both ends are left in the workspace.
    """
    none_lives = Living(False, limit_below, limit_below, limit_above, limit_above)
    if limit_below > limit_above:
        return none_lives
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
            new.label, new.overlap, new.emptied = slot.label, slot.overlap, slot.emptied
            new.died = ALIVE if slot.living else slot.died
            if slot.living:
                first = first if last > 0 else end
                last = end
            end += 1
    known[end].label = limit_above
    some_live = last > 0
    # A limit must be replayed only if no dead label separates it from the living ones.
    if (not some_live or first == 1) and probe(known, FIRST, limit_below, past):
        keep_section(past, LOWER)
        first, some_live = 0, True
    if (not some_live or last == end - 1) and probe(known, end, limit_above, past):
        keep_section(past, UPPER)
        first = first if some_live else end
        last = end
        some_live = True
    if not some_live:
        best = 0
        for i in range(1, end + 1):
            if outlives(known[i], known[best]):
                best = i
        # Bracket of the dead label that lived longest: this label and its neighbours, at the front
        # of the same array.
        past.room.four[0] = known[best]
        known[0], known[2] = known[max(best - 1, 0)], known[min(best + 1, end)]
        known[1] = past.room.four[0]
        first, last, end = 1, 1, 2
        if not search_living(past):
            alive_now, label = search_everywhere(limit_below, limit_above, past, past.errors)
            if not alive_now:
                return none_lives
            below = limit_below
            above = limit_above
            for s in range(stored):
                stored_label = slots[b, s].label
                if below < stored_label < label:
                    below = stored_label
                elif label < stored_label < above:
                    above = stored_label
            known[1].label = label
            if probe(known, FIRST, below, past):
                keep_section(past, LOWER)
                first = 0
            if probe(known, LAST, above, past):
                keep_section(past, UPPER)
                last = 2
    below = lower = known[first].label
    if first > 0:
        below, lower = locate_end(known[first - 1], lower, resolution, past, LOWER)
    above = upper = known[last].label
    if last < end:
        above, upper = locate_end(known[last + 1], upper, resolution, past, UPPER)
    return Living(True, below, lower, upper, above)


@allocation_free
def is_convex(laws: Laws) -> bool:
    """Whether sets without rates are convex along all axes, so that the living labels form one
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
    """Replace the sections of the wanted engagements by a grid of `number` over the living labels,
    ends included.

    Return the number of vertices that every new section may gain. If no label lives, the engagement
    has no living section afterwards. The limits of the labels, each of shape (B,), are narrowed to
    dead labels, except where other labels may live beyond them: with rates, and with an error bound
    that rises with range in the paper's model.
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
        living = locate_living(b, limit_below[b], limit_above[b], sections, past)
        for s in range(used[b]):
            slots[b, s].living = False
        if not living.exists:
            continue
        if past.errors is None and is_convex(laws):
            limit_below[b] = living.below
            limit_above[b] = living.above
        used[b] = number
        for s in range(number):
            share = s / (number - 1) if number > 1 else 0.5
            label = living.lower + share * (living.upper - living.lower)
            if s > 0 and s == number - 1:
                label = living.upper
            slot = slots[b, s]
            row = PROBE
            slot.label = label
            if number > 1 and (s == 0 or s == number - 1):
                row = LOWER if s == 0 else UPPER
                slot.died = ALIVE
                slot.overlap = 0.0
            else:
                slot.died, slot.overlap, slot.emptied = run(label, past)
            slot.living = slot.died == ALIVE
            if slot.living:
                for channel in range(laws.shape[0]):
                    n = row_of(sections, channel, b, s)
                    law = law_of(laws, channel)
                    copy_section(past.room.chains, ROWS * channel + row, sections.chains, n)
                    section = view_of(sections.chains, n, label)
                    summarise_section(section, past.log.elapsed, law, sections.summaries, b, s)
                    spare = min(spare, room_of(section) - count_of(section))
    return spare
