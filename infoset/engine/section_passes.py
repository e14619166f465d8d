"""Compiled operations on all sections of a batch of engagements; `section_life` contains those on
one section.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from infoset._compile import ZERO, allocation_free, constants, entry, inlined, pasted, record_of
from infoset.arrays import Flags, Floats, Integers
from infoset.engine import chain_storage, chains
from infoset.engine.chain_storage import Chains, view_of
from infoset.engine.chains import SectionView
from infoset.engine.section_law import Laws, law_of
from infoset.engine.section_life import (
    CUT_SLACK,
    LOWER_MISS,
    NEVER_EMPTIED,
    SUMMARY_COLUMNS,
    UPPER_MISS,
    Z_MAX,
    Z_MIN,
    across_of,
    change_of_miss_at,
    measure_section,
    predict_section,
    range_of,
    shift_section,
    start_section,
    steepest_angles,
    summarise_section,
    time_to_go,
)

TIE_TOLERANCE = 1e-9
"""Misses of two vertices that differ by less than this part of the interval of misses count as
equal, as if an edge of equal misses joined them; their rounding errors are far smaller."""

MOVED, SUMMARISED, WITH_HEIGHTS = constants(3)
"""Results that `step_all` brings up to date: MOVED the sections, SUMMARISED also their summaries,
WITH_HEIGHTS also the columns of z of the summaries.
"""
NO_EVENT = -1
"""Number of the event of a step without a measurement."""


class Slot(Protocol):
    """Record of a slot.

    Parameters
    ----------
    label : float
        Label, m.
    feasible : bool
        Whether the slot contains sections that are not empty. A section that was removed with its
        label is not feasible either, and its `emptied_at` is NEVER_EMPTIED.
    emptied_at : int
        Number of the event that made a section empty, or NEVER_EMPTIED.
    overlap : float
        Overlap of an empty section with the band that made it empty, m: negative. The minimum one
        if several became empty at that event.
    emptied_axis : int
        Axis of the section with that overlap.
    """

    label: float
    feasible: bool
    emptied_at: int
    overlap: float
    emptied_axis: int


class Sections(NamedTuple):
    """B engagements x S slots for one section each, in the plane of each of C lateral axes.

    A label is feasible if it is feasible in all planes: the set at a label is the product of its
    sections.

    Parameters
    ----------
    slots : ndarray of `Slot`, shape (B, S)
        The slots in use are first, with increasing labels.
    used : ndarray of int, shape (B,)
        Number of slots in use.
    chains : Chains
        The polygons: slot s of engagement b is section (c B + b) S + s for axis c.
    summaries : ndarray, shape (C, B, S, columns)
        Extremes of the predicted miss and of z, m.
    behind, stale : ndarray of bool, shape (B,)
        Engagements with sections one step behind the present one, and those with summaries out of
        date.
    unproved : ndarray of bool, shape (B,)
        Engagements with a section that was reduced, or with a search that found no feasible label
        and does not prove that there is none.
    rows : ndarray of int, shape (B S, 3)
        Working array for a list of sections: row, engagement and slot.
    """

    slots: NDArray[np.record]
    used: Integers
    chains: Chains
    summaries: Floats
    behind: Flags
    stale: Flags
    unproved: Flags
    rows: Integers


def room_for_sections(channels: int, labels: Floats, used: Integers) -> Sections:
    """Allocate the sections of B engagements x S slots along `channels` lateral axes.

    `start_all` writes them. `labels`, shape (B, S), m, is copied; `used`, shape (B,), is kept.
    Nothing is feasible yet, and all summaries are out of date.
    """
    slots = np.zeros(labels.shape, dtype=record_of(Slot))
    slots["label"] = labels
    slots["emptied_at"] = NEVER_EMPTIED
    return Sections(
        slots=slots,
        used=used,
        chains=chain_storage.empty_sections(channels * labels.size, chain_storage.ROOM_AT_START),
        summaries=np.zeros((channels, *labels.shape, SUMMARY_COLUMNS)),
        behind=np.zeros(len(labels), dtype=bool),
        stale=np.ones(len(labels), dtype=bool),
        unproved=np.zeros(len(labels), dtype=bool),
        rows=np.empty((labels.size, 3), dtype=np.int64),
    )


@inlined
def row_of(sections: Sections, channel: int, b: int, s: int) -> int:
    """Row of a section among the polygons."""
    return int((channel * sections.slots.shape[0] + b) * sections.slots.shape[1] + s)


@pasted
def section_of(sections: Sections, channel: int, b: int, s: int) -> SectionView:
    """Return the section of a slot along an axis."""
    return view_of(sections.chains, row_of(sections, channel, b, s), sections.slots[b, s].label)


@entry
def start_all(sections: Sections, laws: Laws) -> None:
    """Write the initial sections of a batch, without their summaries."""
    for channel in range(laws.shape[0]):
        law = law_of(laws, channel)
        for b in range(len(sections.used)):
            for s in range(sections.used[b]):
                start_section(section_of(sections, channel, b, s), 0.0, law)
                sections.slots[b, s].feasible = True


@inlined
def is_cut(sections: Sections, channel: int, event: int, b: int, s: int) -> bool:
    """Whether a section is cut at an event: if the label is feasible, or another axis has just made
    it empty.

    The overlap of a label that an event makes empty is the smallest one of its axes, whatever their
    order.
    """
    slot = sections.slots[b, s]
    return bool(slot.feasible or (channel > 0 and slot.emptied_at == event))


@inlined
def mark_empty(slot: Slot, channel: int, event: int, overlap: float) -> int:
    """Note that an event has made a section empty; return 1 if the label was feasible until now,
    else 0.
    """
    was_feasible = slot.feasible
    if was_feasible or overlap < slot.overlap:
        slot.overlap = overlap
        slot.emptied_axis = channel
    slot.feasible = False
    slot.emptied_at = event
    return 1 if was_feasible else 0


@allocation_free
def list_rows(channel: int, event: int, measured: Flags, wanted: int, sections: Sections) -> int:
    """Write the sections of an axis that `step_all` moves, cuts or summarises to `rows`; return
    their number.
    """
    used = sections.used
    rows = sections.rows
    behind = sections.behind
    stale = sections.stale
    count = 0
    for b in range(len(used)):
        is_summarised = wanted == WITH_HEIGHTS or (stale[b] and wanted == SUMMARISED)
        if not (behind[b] or measured[b] or is_summarised):
            continue
        for s in range(used[b]):
            if is_cut(sections, channel, event, b, s):
                rows[count, 0] = row_of(sections, channel, b, s)
                rows[count, 1] = b
                rows[count, 2] = s
                count += 1
    return count


@entry
def step_all(
    measured: Flags,
    alpha: Floats,
    event: int,
    elapsed: int,
    wanted: int,
    sections: Sections,
    laws: Laws,
) -> int:
    """Predict, cut and summarise the feasible sections in one pass; return the number of labels
    that became empty.

    Sections that are behind are moved by one step, to the present step `elapsed`. The sections of
    engagements that are `measured`, shape (B,), are cut by angles `alpha`, shape (C, B), rad, and
    summarised. `event` is the number of the measurement, `NO_EVENT` without one. `wanted` is
    `MOVED`, `SUMMARISED` or `WITH_HEIGHTS`: the results that are brought up to date for all
    engagements.
    """
    newly_emptied = 0
    slots = sections.slots
    summaries = sections.summaries
    rows = sections.rows
    behind = sections.behind
    stale = sections.stale
    for channel in range(laws.shape[0]):
        law = law_of(laws, channel)
        count = list_rows(channel, event, measured, wanted, sections)
        for k in range(count):
            b = rows[k, 1]
            s = rows[k, 2]
            slot = slots[b, s]
            section = view_of(sections.chains, rows[k, 0], slot.label)
            if behind[b]:
                predict_section(section, elapsed, law)

            if measured[b]:
                across = across_of(alpha, b, law)
                nonempty, overlap = measure_section(
                    section, elapsed, alpha[channel, b], across, law
                )
                if not nonempty:
                    newly_emptied += mark_empty(slot, channel, event, overlap)
                # Another axis may have made the label empty.
                if not slot.feasible:
                    continue

            if measured[b] or (stale[b] and wanted >= SUMMARISED):
                summarise_section(section, elapsed, law, summaries, b, s)
            if wanted == WITH_HEIGHTS:
                minimum, maximum = chains.heights(section, time_to_go(slot.label, elapsed, law))
                summaries[channel, b, s, Z_MIN] = minimum
                summaries[channel, b, s, Z_MAX] = maximum

    for b in range(len(behind)):
        behind[b] = False
        stale[b] = stale[b] and not measured[b] and wanted < SUMMARISED
    return newly_emptied


@entry
def shift_all(active: Flags, impulse: Floats, elapsed: int, sections: Sections, laws: Laws) -> None:
    """Shift the feasible sections of the active engagements and their summaries by impulses of
    shape (C, B). No section may be behind.
    """
    slots = sections.slots
    used = sections.used
    summaries = sections.summaries
    for channel in range(laws.shape[0]):
        law = law_of(laws, channel)
        for b in range(len(used)):
            if not active[b]:
                continue
            along = impulse[channel, b]
            across = across_of(impulse, b, law)
            if along == 0.0 and across == 0.0:
                continue

            for s in range(used[b]):
                slot = slots[b, s]
                if not slot.feasible:
                    continue
                shift_section(section_of(sections, channel, b, s), elapsed, along, across, law)
                tau = time_to_go(slot.label, elapsed, law)
                least, greatest = change_of_miss_at(along, across, tau, law)
                summaries[channel, b, s, UPPER_MISS] -= least
                summaries[channel, b, s, LOWER_MISS] -= greatest


@entry
def make_room_all(
    active: Flags,
    added: int,
    elapsed: int,
    sections: Sections,
    laws: Laws,
    points: Floats,
    widen: bool,
) -> tuple[int, int]:
    """Compute the room that the feasible sections need; with `widen`, enlarge their rings.

    Every section must be able to gain `added` vertices, up to `CAPACITY`. Return the number of
    floats of the new rings of sections that have no room, whole rings, for which memory must be
    allocated before a call with `widen` (then it is 0), and the number of vertices that every
    section may gain now. With rings that are large enough it is less than `MAX_ADDED` only if a
    section must be reduced first; with `widen`, the sections of the active engagements are reduced.
    `points` is a working array.
    """
    slots = sections.slots
    used = sections.used
    floats = ZERO
    spare = chains.CAPACITY
    for channel in range(laws.shape[0]):
        law = law_of(laws, channel)
        for b in range(len(used)):
            for s in range(used[b]):
                slot = slots[b, s]
                if not slot.feasible:
                    continue
                section = section_of(sections, channel, b, s)
                if widen and active[b] and chains.is_crowded(section):
                    chains.reduce_outward(section, time_to_go(slot.label, elapsed, law), points)
                    # As in `replay_angles`: the overlaps that follow are too large for a proof.
                    sections.unproved[b] = True

                count = chains.count_of(section)
                room = chain_storage.room_of(section)
                wanted = chain_storage.room_for(min(count + added, chains.CAPACITY), room)
                if wanted > room and widen:
                    chain_storage.widen_rings(section, wanted)
                elif wanted > room:
                    floats += 2 * chain_storage.floats_of(wanted)
                spare = min(spare, chain_storage.room_of(section) - count)
    return floats, spare


@entry
def widest_all(elapsed: int, sections: Sections, laws: Laws, exists: Flags, ends: Floats) -> None:
    """Write the predicted-miss interval of each engagement along each axis, and whether it has a
    feasible section.

    `ends`, shape (C, B, 2, 4), has for the lower and the upper end the predicted miss, m, and
    alpha, rad, omega, rad/s, and range, m, of a state that reaches it; it is not written for
    engagements without a feasible section. The summaries must be up to date. An extreme is usually
    reached on a whole edge. The lowest point is taken for the upper end and the highest for the
    lower end, so that a mirrored engagement gives exactly mirrored results.
    """
    slots = sections.slots
    used = sections.used
    for channel in range(laws.shape[0]):
        law = law_of(laws, channel)
        summaries = sections.summaries
        for b in range(len(used)):
            lowest = -1
            highest = -1
            lower = np.inf
            upper = -np.inf
            for s in range(used[b]):
                # Only sections of stopped engagements can be at range zero.
                if not slots[b, s].feasible or range_of(slots[b, s].label, elapsed, law) == 0.0:
                    continue
                if lowest < 0 or summaries[channel, b, s, LOWER_MISS] < lower:
                    lowest = s
                    lower = summaries[channel, b, s, LOWER_MISS]
                if highest < 0 or summaries[channel, b, s, UPPER_MISS] > upper:
                    highest = s
                    upper = summaries[channel, b, s, UPPER_MISS]
            if lowest < 0:
                continue

            exists[b] = True
            for end, s in ((0, lowest), (1, highest)):
                tau = time_to_go(slots[b, s].label, elapsed, law)
                x = range_of(slots[b, s].label, elapsed, law)
                section = section_of(sections, channel, b, s)
                # The point of the upper end comes first.
                points = chains.extreme_points(section, tau, TIE_TOLERANCE, CUT_SLACK)
                v, m = points[1 - end]
                alpha = (m - tau * v) / x
                # The column `UPPER_MISS` follows `LOWER_MISS`.
                ends[channel, b, end, 0] = summaries[channel, b, s, LOWER_MISS + end]
                ends[channel, b, end, 1] = alpha
                ends[channel, b, end, 2] = (v + law.closing_speed * alpha) / x
                ends[channel, b, end, 3] = x


@entry
def extreme_angles_all(elapsed: int, sections: Sections, laws: Laws, extremes: Floats) -> None:
    """Write the minimum and the maximum alpha of the feasible sections along each axis, rad, and
    their ranges, m.

    `extremes`, shape (4, C, B), has both angles and then their ranges; it is not written for
    engagements without a feasible section. The columns of z of the summaries must be up to date.
    """
    slots = sections.slots
    used = sections.used
    summaries = sections.summaries
    for channel in range(laws.shape[0]):
        law = law_of(laws, channel)
        for b in range(len(used)):
            none = True
            for s in range(used[b]):
                x = range_of(slots[b, s].label, elapsed, law)
                # Only sections of stopped engagements can be at range zero.
                if not slots[b, s].feasible or x == 0.0:
                    continue
                minimum = summaries[channel, b, s, Z_MIN] / x
                maximum = summaries[channel, b, s, Z_MAX] / x
                if none or minimum < extremes[0, channel, b]:
                    extremes[0, channel, b] = minimum
                    extremes[2, channel, b] = x
                if none or maximum > extremes[1, channel, b]:
                    extremes[1, channel, b] = maximum
                    extremes[3, channel, b] = x
                none = False


@entry
def keep_labels_all(
    active: Flags, minimum: Floats, maximum: Floats, sections: Sections, removed: Flags
) -> int:
    """Remove the feasible sections of the active engagements with labels outside limits of shape
    (B,), m; return their number. A label equal to a limit stays.

    `removed`, shape (B, S), all false before, receives the mask of the removed ones.
    """
    number = 0
    for b in range(len(sections.used)):
        for s in range(sections.used[b]):
            slot = sections.slots[b, s]
            if active[b] and slot.feasible and not minimum[b] <= slot.label <= maximum[b]:
                slot.feasible = False
                removed[b, s] = True
                number += 1
    return number


@entry
def count_all(sections: Sections, counts: Integers) -> None:
    """Write the number of feasible sections of each engagement, shape (B,)."""
    for b in range(len(counts)):
        counts[b] = 0
        for s in range(sections.used[b]):
            counts[b] += sections.slots[b, s].feasible


@entry
def write_outline(section: Chains, n: int, tau: float, out: Floats) -> int:
    """Call `chains.outline` from Python, with the section in row `n`; its label is not used."""
    return chains.outline(view_of(section, n, 0.0), tau, out)


@entry
def steepest_all(alpha: Floats, farthest: float, laws: Laws, steepest: Floats) -> None:
    """Write the results of `steepest_angles` for angles of shape (C, B), shape (2, B)."""
    # The constants of one axis contain the error bounds of both angles.
    law = law_of(laws, ZERO)
    for b in range(alpha.shape[1]):
        steepest[0, b], steepest[1, b] = steepest_angles(
            alpha[0, b], across_of(alpha, b, law), farthest, law
        )
