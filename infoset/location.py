"""Where the living labels are: they form an interval, found exactly by replaying the history at chosen labels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from infoset._compile import allocation_free, constants, entry
from infoset.chains import CAPACITY, copy_section, count_of, empty_sections, room_of, working_room
from infoset.history import Tapes
from infoset.section_law import SectionLaw
from infoset.section_life import ALIVE, Flags, Floats, Integers, Tape, replay, summarise_section
from infoset.section_passes import Sections

LABEL_RESOLUTION = 1e-13
MOST_PROBES = 200

PROBE, LOWER, UPPER = constants(3)
"""Rows of the workspace: the section of the last replay, and those at the ends of the living labels."""


class Workspace(NamedTuple):
    """Room for replays of E events and a search among K labels.

    Parameters
    ----------
    values, applies : ndarray, shape (E,)
        The history of one engagement, in one piece: angles, rates and impulses (SI), and which events are its own.
    origins, rings, marks : ndarray
        Three sections, `PROBE`, `LOWER` and `UPPER`, as `chains.empty_sections` makes them.
    overlaps, living_overlaps : ndarray, shape (E,)
        Overlap of section and band at each measurement, of the last replay and of the last label that lived; m.
    points : ndarray, shape (n, 2)
        Room for the outline of a section.
    labels, died, label_overlaps : ndarray, shape (K,)
        Labels that are known, m; the event at which each died, or `ALIVE`; its overlap there.
    """

    values: Floats
    applies: Flags
    origins: Floats
    rings: Floats
    marks: Integers
    overlaps: Floats
    living_overlaps: Floats
    points: Floats
    labels: Floats
    died: Integers
    label_overlaps: Floats


class Living(NamedTuple):
    """The interval of living labels [lower, upper], each end bracketed by a label known to be dead.

    Where an end is the limit of the search itself, the bracket is that limit.

    Parameters
    ----------
    found : bool
        Whether any label lives.
    below, lower, upper, above : float
        In rising order, m; those in the middle live, the outer two are dead.
    """

    found: bool
    below: float
    lower: float
    upper: float
    above: float


def workspace(events: int, slots: int) -> Workspace:
    """Room for replays of histories of so many events, and for a search among so many stored labels."""
    known = slots + 2
    return Workspace(
        np.empty(events),
        np.empty(events, dtype=bool),
        *empty_sections(3),
        overlaps=np.empty(events),
        living_overlaps=np.empty(events),
        points=working_room(),
        labels=np.empty(known),
        died=np.empty(known, dtype=np.int64),
        label_overlaps=np.empty(known),
    )


@allocation_free
def tape_of(tapes: Tapes, b: int, room: Workspace) -> Tape:
    """Lay the history of one engagement out in one piece: replays read it many times."""
    for event in range(tapes.events):
        room.values[event] = tapes.values[event, b]
        room.applies[event] = tapes.applies[event, b]
    return Tape(tapes.kinds, room.values, room.applies, tapes.events)


@allocation_free
def run(label: float, tape: Tape, errors: Floats | None, law: SectionLaw, room: Workspace) -> tuple[int, float]:
    """Event at which a label died (or ALIVE) and its overlap there (0 if alive)."""
    died = replay(label, tape, errors, law, room.origins, room.rings, room.marks, PROBE, room.overlaps, room.points)
    return died, room.overlaps[died] if died != ALIVE else 0.0


@allocation_free
def keep_section(room: Workspace, row: int) -> None:
    """Keep the section of the last replay as that of an end."""
    copy_section(room.origins, room.rings, room.marks, PROBE, room.origins, room.rings, room.marks, row)


@allocation_free
def keep_living(room: Workspace, events: int, row: int) -> None:
    """Keep section and overlaps of the last replay as those of the living label."""
    keep_section(room, row)
    for event in range(events):
        room.living_overlaps[event] = room.overlaps[event]


@allocation_free
def outlives(died: int, overlap: float, other_died: int, other_overlap: float) -> bool:
    """Whether a dead label is nearer to living than another: it died later, or at less distance."""
    return died > other_died or (died == other_died and overlap > other_overlap)


@allocation_free
def locate_end(
    dead: float,
    died: int,
    overlap: float,
    living: float,
    resolution: float,
    tape: Tape,
    errors: Floats | None,
    law: SectionLaw,
    room: Workspace,
    row: int,
) -> tuple[float, float]:
    """Narrow the bracket between a dead and a living label; return the bracket (dead, living).

    The section at the living one is left in a row of the workspace.

    Notes
    -----
    The overlap at the measurement that kills is concave in the label, so the Illinois form of false position
    converges fast; where four probes have not narrowed the bracket to an eighth, against a change of the killing
    measurement, one halves it.
    """
    run(living, tape, errors, law, room)
    keep_living(room, tape.events, row)
    weight_dead = overlap
    weight_living = room.living_overlaps[died]
    side = 0
    before = 0.0
    for probes in range(MOST_PROBES):
        width = abs(living - dead)
        if width <= resolution:
            break
        slow = probes % 4 == 3 and width > 0.125 * before
        if probes % 4 == 0:
            before = width
        fraction = 0.5
        if not slow and weight_living > weight_dead:
            # A probe on either end would tell nothing: it goes half a resolution inside.
            least = 0.5 * resolution / width
            fraction = min(max(-weight_dead / (weight_living - weight_dead), least), 1.0 - least)
        label = dead + fraction * (living - dead)
        probe_died, probe_overlap = run(label, tape, errors, law, room)
        if probe_died == ALIVE:
            living = label
            keep_living(room, tape.events, row)
            weight_living = room.living_overlaps[died]
            weight_dead = 0.5 * weight_dead if side == 1 else overlap
            side = 1
        else:
            dead, died, overlap = label, probe_died, probe_overlap
            weight_dead = overlap
            weight_living = (0.5 if side == -1 else 1.0) * room.living_overlaps[died]
            side = -1
    return dead, living


@allocation_free
def search_living(
    labels: Floats,
    died: Integers,
    overlaps: Floats,
    resolution: float,
    tape: Tape,
    errors: Floats | None,
    law: SectionLaw,
    room: Workspace,
) -> int:
    """Look for a living label between dead ones; the arrays hold three, of which the middle outlives the others.

    Returns
    -------
    int
        1 if the middle label now lives, 0 if the bracket closed without one.

    Notes
    -----
    (time of death, overlap) is unimodal in the label: the larger half of the bracket is probed in its middle.
    """
    for _ in range(MOST_PROBES):
        if labels[2] - labels[0] <= resolution:
            return 0
        lower_half = labels[1] - labels[0] > labels[2] - labels[1]
        outer = 0 if lower_half else 2
        label = 0.5 * (labels[1] + labels[outer])
        probe_died, probe_overlap = run(label, tape, errors, law, room)
        if probe_died == ALIVE or outlives(probe_died, probe_overlap, died[1], overlaps[1]):
            other = 2 - outer
            labels[other], died[other], overlaps[other] = labels[1], died[1], overlaps[1]
            labels[1], died[1], overlaps[1] = label, probe_died, probe_overlap
            if probe_died == ALIVE:
                return 1
        else:
            labels[outer], died[outer], overlaps[outer] = label, probe_died, probe_overlap
    return 0


@allocation_free
def locate_living(
    limit_below: float,
    limit_above: float,
    labels: Floats,
    alive: Flags,
    died: Integers,
    overlaps: Floats,
    tape: Tape,
    errors: Floats | None,
    law: SectionLaw,
    room: Workspace,
) -> Living:
    """Find the living labels within limits, starting from what is known of the stored ones (in rising order).

    The sections at both ends are left in the workspace.
    """
    nothing = Living(False, limit_below, limit_below, limit_above, limit_above)
    if limit_below > limit_above:
        return nothing
    resolution = LABEL_RESOLUTION * max(abs(limit_below), abs(limit_above))
    # The stored labels within the limits, between the limits themselves.
    known, known_died, known_overlap = room.labels, room.died, room.label_overlaps
    end = 1
    first = last = 0
    for s in range(labels.shape[0]):
        if limit_below < labels[s] < limit_above:
            known[end] = labels[s]
            known_died[end] = ALIVE if alive[s] else died[s]
            known_overlap[end] = overlaps[s]
            if alive[s]:
                first = first if last > 0 else end
                last = end
            end += 1
    known[0], known[end] = limit_below, limit_above
    some_live = last > 0
    # A limit matters only where no dead label stands between it and the living ones.
    if not some_live or first == 1:
        known_died[0], known_overlap[0] = run(limit_below, tape, errors, law, room)
        if known_died[0] == ALIVE:
            keep_section(room, LOWER)
            first, some_live = 0, True
    if not some_live or last == end - 1:
        known_died[end], known_overlap[end] = run(limit_above, tape, errors, law, room)
        if known_died[end] == ALIVE:
            keep_section(room, UPPER)
            first = first if some_live else end
            last, some_live = end, True
    if not some_live:
        best = 0
        for i in range(1, end + 1):
            if outlives(known_died[i], known_overlap[i], known_died[best], known_overlap[best]):
                best = i
        # The best of the dead and its neighbours, at the front of the same room.
        first, last = max(best - 1, 0), min(best + 1, end)
        known[0], known_died[0], known_overlap[0] = known[first], known_died[first], known_overlap[first]
        middle, middle_died, middle_overlap = known[best], known_died[best], known_overlap[best]
        known[2], known_died[2], known_overlap[2] = known[last], known_died[last], known_overlap[last]
        known[1], known_died[1], known_overlap[1] = middle, middle_died, middle_overlap
        if search_living(known, known_died, known_overlap, resolution, tape, errors, law, room) == 0:
            return nothing
        first, last, end = 1, 1, 2
    below = lower = known[first]
    if first > 0:
        below, lower = locate_end(
            known[first - 1],
            known_died[first - 1],
            known_overlap[first - 1],
            lower,
            resolution,
            tape,
            errors,
            law,
            room,
            LOWER,
        )
    above = upper = known[last]
    if last < end:
        above, upper = locate_end(
            known[last + 1],
            known_died[last + 1],
            known_overlap[last + 1],
            upper,
            resolution,
            tape,
            errors,
            law,
            room,
            UPPER,
        )
    return Living(True, below, lower, upper, above)


@entry
def refine_all(
    wanted: Flags,
    number: int,
    elapsed: int,
    limit_below: Floats,
    limit_above: Floats,
    tapes: Tapes,
    errors: Floats | None,
    sections: Sections,
    law: SectionLaw,
    room: Workspace,
) -> int:
    """Give each wanted engagement a new grid of sections over its living labels, ends included, by replay.

    Notes
    -----
    `limit_below` and `limit_above` are narrowed to labels known to be dead. Where nothing lives, the engagement is
    left with no living section. Returned is how many vertices the fullest of the new sections may gain.
    """
    spare = CAPACITY
    labels, used, alive, died, overlaps, origins, rings, marks, summaries, _ = sections
    for b in range(labels.shape[0]):
        if not wanted[b]:
            continue
        tape = tape_of(tapes, b, room)
        stored = used[b]
        living = locate_living(
            limit_below[b],
            limit_above[b],
            labels[b, :stored],
            alive[b, :stored],
            died[b, :stored],
            overlaps[b, :stored],
            tape,
            errors,
            law,
            room,
        )
        alive[b, :stored] = False
        if not living.found:
            continue
        limit_below[b] = living.below
        limit_above[b] = living.above
        used[b] = number
        for s in range(number):
            share = s / (number - 1) if number > 1 else 0.5
            label = living.lower + share * (living.upper - living.lower)
            if s > 0 and s == number - 1:
                label = living.upper
            labels[b, s] = label
            n = b * labels.shape[1] + s
            row = PROBE
            if number > 1 and (s == 0 or s == number - 1):
                row = LOWER if s == 0 else UPPER
                died[b, s], overlaps[b, s] = ALIVE, 0.0
            else:
                died[b, s], overlaps[b, s] = run(label, tape, errors, law, room)
            alive[b, s] = died[b, s] == ALIVE
            if alive[b, s]:
                copy_section(room.origins, room.rings, room.marks, row, origins, rings, marks, n)
                summarise_section(origins, rings, marks, n, label, elapsed, law, summaries, b, s)
                spare = min(spare, room_of(marks, n) - count_of(marks, n))
    return spare
