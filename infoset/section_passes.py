"""Compiled operations on all sections of a batch of engagements; `section_life` contains those on one section."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from infoset import chain_steps, chains, whole_chains
from infoset._compile import ZERO, allocation_free, by_reference, entry
from infoset.history import Tapes
from infoset.section_law import SectionLaw
from infoset.section_life import (
    ALIVE,
    CUT_SLACK,
    LOWER_MISS,
    SUMMARY_COLUMNS,
    UPPER_MISS,
    Z_GREATEST,
    Z_LEAST,
    Flags,
    Floats,
    Integers,
    Tape,
    last_sight,
    measure_rate_section,
    measure_section,
    predict_section,
    range_of,
    shift_section,
    start_section,
    summarise_section,
    time_to_go,
)

TIE_TOLERANCE = 1e-9


@by_reference
class Sections(NamedTuple):
    """B engagements x S slots for one section each.

    Parameters
    ----------
    labels : ndarray, shape (B, S)
        Label of each slot, m; the slots in use are first, with increasing labels.
    used : ndarray of int, shape (B,)
        Number of slots in use.
    living : ndarray of bool, shape (B, S)
        Whether the slot contains a section that is not empty.
    died : ndarray of int, shape (B, S)
        Number of the event that made the section empty, or ALIVE.
    overlaps : ndarray, shape (B, S)
        Overlap of an empty section with the band that made it empty, m: negative.
    origins, rings, marks : ndarray
        The polygons, stored as in `chains`: slot s of engagement b is row b S + s.
    summaries : ndarray, shape (B, S, columns)
        Extremes of the predicted miss and of z, m.
    rows : ndarray of int, shape (B S, 3)
        Working array for a list of sections: row, engagement and slot.
    """

    labels: Floats
    used: Integers
    living: Flags
    died: Integers
    overlaps: Floats
    origins: Floats
    rings: Floats
    marks: Integers
    summaries: Floats
    rows: Integers


def room_for_sections(labels: Floats, used: Integers) -> Sections:
    """Allocate the arrays of a batch of sections."""
    shape = labels.shape
    origins, rings, marks = chains.empty_sections(labels.size, chains.ROOM_AT_START)
    return Sections(
        labels=labels,
        used=used,
        living=np.zeros(shape, dtype=bool),
        died=np.full(shape, ALIVE, dtype=np.int64),
        overlaps=np.zeros(shape),
        origins=origins,
        rings=rings,
        marks=marks,
        summaries=np.zeros((*shape, SUMMARY_COLUMNS)),
        rows=np.empty((labels.size, 3), dtype=np.int64),
    )


@entry
def start_all(sections: Sections, law: SectionLaw) -> None:
    """Write the initial sections of a batch, without their summaries."""
    labels, used, living = sections.labels, sections.used, sections.living
    origins, rings, marks = sections.origins, sections.rings, sections.marks
    for b in range(labels.shape[0]):
        for s in range(used[b]):
            n = b * labels.shape[1] + s
            start_section(origins, rings, marks, n, labels[b, s], law)
            living[b, s] = True


@allocation_free
def list_rows(first: Flags, second: Flags, third: Flags, every: bool, sections: Sections) -> int:
    """List the living sections of the engagements in any of three groups, or of all; return their number."""
    used, living, rows = sections.used, sections.living, sections.rows
    count = 0
    for b in range(living.shape[0]):
        if first[b] or second[b] or third[b] or every:
            for s in range(used[b]):
                if living[b, s]:
                    rows[count, 0], rows[count, 1], rows[count, 2] = b * living.shape[1] + s, b, s
                    count += 1
    return count


@entry
def step_all(
    behind: Flags,
    measured: Flags,
    stale: Flags,
    heights_wanted: bool,
    alpha: Floats,
    elapsed: int,
    event: int,
    sections: Sections,
    law: SectionLaw,
) -> int:
    """Predict, cut and summarise the living sections in one pass; return the number of sections that became empty.

    Parameters
    ----------
    behind : ndarray of bool, shape (B,)
        Engagements whose sections are at step `elapsed - 1` and are moved to step `elapsed`.
    measured : ndarray of bool, shape (B,)
        Engagements whose sections are cut by an angle measurement and summarised.
    stale : ndarray of bool, shape (B,)
        Engagements whose sections are summarised.
    heights_wanted : bool
        Whether to write the least and the greatest z of all sections.
    alpha : ndarray, shape (B,)
        Measured angles, rad.
    elapsed, event : int
        Present step, and number of the measurement.
    sections, law : Sections, SectionLaw
        The sections, changed in place, and the constants of the model.
    """
    deaths = 0
    labels, living, died, overlaps = sections.labels, sections.living, sections.died, sections.overlaps
    summaries, rows = sections.summaries, sections.rows
    origins, rings, marks = sections.origins, sections.rings, sections.marks
    count = list_rows(behind, measured, stale, heights_wanted, sections)
    for k in range(count):
        n, b, s = rows[k, 0], rows[k, 1], rows[k, 2]
        if k + 1 < count:
            chains.expect(rings, marks, rows[k + 1, 0])
        if behind[b]:
            predict_section(origins, rings, marks, n, labels[b, s], elapsed, law)
        if measured[b]:
            living[b, s], overlap = measure_section(origins, rings, marks, n, labels[b, s], elapsed, alpha[b], law)
            if not living[b, s]:
                died[b, s] = event
                overlaps[b, s] = overlap
                deaths += 1
                continue
        if measured[b] or stale[b]:
            summarise_section(origins, rings, marks, n, labels[b, s], elapsed, law, summaries, b, s)
        if heights_wanted:
            tau = time_to_go(labels[b, s], elapsed, law)
            least, greatest = chain_steps.heights(origins, rings, marks, n, tau)
            summaries[b, s, Z_LEAST] = least
            summaries[b, s, Z_GREATEST] = greatest
    return deaths


@allocation_free
def tape_of(tapes: Tapes, b: int, values: Floats, applies: Flags) -> Tape:
    """Copy the history of one engagement to contiguous arrays, for many replays."""
    for event in range(tapes.events):
        values[event] = tapes.values[event, b]
        applies[event] = tapes.applies[event, b]
    return Tape(tapes.kinds, values, applies, tapes.events, np.inf, -np.inf)


@entry
def measure_rate_all(
    active: Flags,
    omega: Floats,
    error: float,
    elapsed: int,
    event: int,
    tapes: Tapes,
    values: Floats,
    applies: Flags,
    sections: Sections,
    law: SectionLaw,
    points: Floats,
) -> int:
    """Cut the living sections of the active engagements by rates and summarise them; return how many became empty.

    `values` and `applies` are working arrays for the history of one engagement.
    """
    deaths = 0
    labels, used, living, died = sections.labels, sections.used, sections.living, sections.died
    overlaps, summaries = sections.overlaps, sections.summaries
    origins, rings, marks = sections.origins, sections.rings, sections.marks
    for b in range(labels.shape[0]):
        if not active[b]:
            continue
        sight = last_sight(tape_of(tapes, b, values, applies), law)
        for s in range(used[b]):
            if not living[b, s]:
                continue
            n, label = b * labels.shape[1] + s, labels[b, s]
            living[b, s], overlap = measure_rate_section(
                origins, rings, marks, n, label, elapsed, omega[b], error, sight, (label, label), law, points
            )
            if living[b, s]:
                summarise_section(origins, rings, marks, n, labels[b, s], elapsed, law, summaries, b, s)
            else:
                died[b, s] = event
                overlaps[b, s] = overlap
                deaths += 1
    return deaths


@entry
def shift_all(active: Flags, impulse: Floats, elapsed: int, sections: Sections, law: SectionLaw) -> None:
    """Shift the living sections and their summaries by the impulses of the engagements."""
    labels, used, living = sections.labels, sections.used, sections.living
    origins, summaries = sections.origins, sections.summaries
    for b in range(labels.shape[0]):
        if not active[b] or impulse[b] == 0.0:
            continue
        for s in range(used[b]):
            if not living[b, s]:
                continue
            shift_section(origins, b * labels.shape[1] + s, labels[b, s], elapsed, impulse[b], law)
            tau, error = time_to_go(labels[b, s], elapsed, law), abs(impulse[b]) * law.impulse_error
            summaries[b, s, UPPER_MISS] += (error - impulse[b]) * tau
            summaries[b, s, LOWER_MISS] -= (error + impulse[b]) * tau


@entry
def make_room_all(
    active: Flags, added: int, elapsed: int, sections: Sections, law: SectionLaw, points: Floats, widen: bool
) -> tuple[int, int]:
    """Compute the room that the living sections of the active engagements need; with `widen`, enlarge their rings.

    Parameters
    ----------
    added : int
        Number of vertices that every section must be able to gain.
    active, elapsed, sections, law, points
        Engagements, present step, sections, constants of the model, and working array.
    widen : bool
        Whether to enlarge rings, for which memory must be allocated, and to reduce sections of `CAPACITY` vertices.

    Returns
    -------
    floats : int
        Number of floats by which the rings are too small.
    spare : int
        Number of vertices that every section may gain; negative if a section must be reduced first.
    """
    labels, used, living = sections.labels, sections.used, sections.living
    origins, rings, marks = sections.origins, sections.rings, sections.marks
    floats = ZERO
    spare = chains.CAPACITY
    for b in range(labels.shape[0]):
        if not active[b]:
            continue
        for s in range(used[b]):
            if not living[b, s]:
                continue
            n = b * labels.shape[1] + s
            if widen and whole_chains.is_crowded(marks, n):
                whole_chains.reduce_outward(origins, rings, marks, n, time_to_go(labels[b, s], elapsed, law), points)
            count, room = chains.count_of(marks, n), chains.room_of(marks, n)
            wanted = chains.room_for(min(count + added, chains.CAPACITY), room)
            if wanted > room and widen:
                chains.widen_rings(rings, marks, n, wanted)
            elif wanted > room:
                floats += 2 * chains.floats_of(wanted)
            spare = min(spare, chains.room_of(marks, n) - count)
    return floats, spare


@entry
def widest_all(elapsed: int, sections: Sections, law: SectionLaw, exists: Flags, ends: Floats) -> None:
    """Write the predicted-miss interval of each engagement.

    Parameters
    ----------
    elapsed : int
        Present step.
    exists : ndarray of bool, shape (B,)
        Whether the engagement has a living section.
    ends : ndarray, shape (B, 2, 4)
        For the lower and the upper end: the predicted miss, m, and alpha, rad, omega, rad/s, and range, m, of a state
        that reaches it. Not written for engagements without a living section.

    Notes
    -----
    An extreme is usually reached on a whole edge. The lowest point is taken for the upper end and the highest for the
    lower end, so that a mirrored engagement gives exactly mirrored results.
    """
    labels, used, living, summaries = sections.labels, sections.used, sections.living, sections.summaries
    origins, rings, marks = sections.origins, sections.rings, sections.marks
    for b in range(labels.shape[0]):
        lowest = highest = -1
        for s in range(used[b]):
            # Only sections of stopped engagements can be at range zero.
            if not living[b, s] or range_of(labels[b, s], elapsed, law) == 0.0:
                continue
            if lowest < 0 or summaries[b, s, LOWER_MISS] < summaries[b, lowest, LOWER_MISS]:
                lowest = s
            if highest < 0 or summaries[b, s, UPPER_MISS] > summaries[b, highest, UPPER_MISS]:
                highest = s
        if lowest < 0:
            continue
        exists[b] = True
        for end, s in ((0, lowest), (1, highest)):
            tau, x = time_to_go(labels[b, s], elapsed, law), range_of(labels[b, s], elapsed, law)
            n = b * labels.shape[1] + s
            points = chain_steps.extreme_points(origins, rings, marks, n, tau, TIE_TOLERANCE, CUT_SLACK)
            v, m = points[1 - end]
            alpha = (m - tau * v) / x
            ends[b, end, 0] = summaries[b, s, LOWER_MISS + end]
            ends[b, end, 1] = alpha
            ends[b, end, 2] = (v + law.closing_speed * alpha) / x
            ends[b, end, 3] = x


@entry
def write_outline(origins: Floats, rings: Floats, marks: Integers, n: int, tau: float, out: Floats) -> int:
    """Call `whole_chains.outline` from Python."""
    return whole_chains.outline(origins, rings, marks, n, tau, out)
