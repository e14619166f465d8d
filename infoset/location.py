"""Where the living labels are: they form an interval, found exactly by replaying the history at chosen labels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from infoset._compile import allocation_free, entry
from infoset.chains import copy_section, empty_sections, working_room
from infoset.section_kernels import (
    ALIVE,
    Flags,
    Floats,
    Integers,
    SectionLaw,
    Sections,
    replay,
    summarise_section,
)

LABEL_RESOLUTION = 1e-13
MOST_PROBES = 200


class Tape(NamedTuple):
    """The history of one engagement, as `section_kernels.replay` takes it."""

    kinds: Integers
    errors: Floats | None
    values: Floats
    applies: Flags
    events: int


class Workspace(NamedTuple):
    """Room for replays."""

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
        *empty_sections(1),
        overlaps=np.empty(events),
        living_overlaps=np.empty(events),
        points=working_room(),
        labels=np.empty(known),
        died=np.empty(known, dtype=np.int64),
        label_overlaps=np.empty(known),
    )


@allocation_free
def run(label: float, tape: Tape, law: SectionLaw, room: Workspace) -> tuple[int, float]:
    """Event at which a label died (or ALIVE) and its overlap there (0 if alive)."""
    died = replay(
        label,
        tape.kinds,
        tape.errors,
        tape.values,
        tape.applies,
        tape.events,
        law,
        room.origins,
        room.rings,
        room.marks,
        0,
        room.overlaps,
        room.points,
    )
    return died, room.overlaps[died] if died != ALIVE else 0.0


@allocation_free
def keep_overlaps(room: Workspace, events: int) -> None:
    """Keep the overlaps of the last replay as those of the living label."""
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
    law: SectionLaw,
    room: Workspace,
) -> tuple[float, float]:
    """Narrow the bracket between a dead and a living label; return the bracket (dead, living).

    Notes
    -----
    The overlap at the measurement that kills is concave in the label, so the Illinois form of false position
    converges fast; where four probes have not narrowed the bracket to an eighth, against a change of the killing
    measurement, one halves it.
    """
    run(living, tape, law, room)
    keep_overlaps(room, tape.events)
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
        probe_died, probe_overlap = run(label, tape, law, room)
        if probe_died == ALIVE:
            living = label
            keep_overlaps(room, tape.events)
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
    labels: Floats, died: Integers, overlaps: Floats, resolution: float, tape: Tape, law: SectionLaw, room: Workspace
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
        probe_died, probe_overlap = run(label, tape, law, room)
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
    law: SectionLaw,
    room: Workspace,
) -> Living:
    """Find the living labels within limits, starting from what is known of the stored ones (in rising order)."""
    nothing = Living(False, limit_below, limit_below, limit_above, limit_above)
    if limit_below > limit_above:
        return nothing
    resolution = LABEL_RESOLUTION * max(abs(limit_below), abs(limit_above))
    # The stored labels within the limits, between the limits themselves.
    known, known_died, known_overlap = room.labels, room.died, room.label_overlaps
    known[0] = limit_below
    known_died[0], known_overlap[0] = run(limit_below, tape, law, room)
    size = 1
    for s in range(labels.shape[0]):
        if limit_below < labels[s] < limit_above:
            known[size] = labels[s]
            known_died[size] = ALIVE if alive[s] else died[s]
            known_overlap[size] = overlaps[s]
            size += 1
    if limit_above > limit_below:
        known[size] = limit_above
        known_died[size], known_overlap[size] = run(limit_above, tape, law, room)
        size += 1
    best = 0
    for i in range(1, size):
        if outlives(known_died[i], known_overlap[i], known_died[best], known_overlap[best]):
            best = i
    first = last = best
    if known_died[best] != ALIVE:
        # The best of the dead and its neighbours, at the front of the same room.
        first, last = max(best - 1, 0), min(best + 1, size - 1)
        known[0], known_died[0], known_overlap[0] = known[first], known_died[first], known_overlap[first]
        middle, middle_died, middle_overlap = known[best], known_died[best], known_overlap[best]
        known[2], known_died[2], known_overlap[2] = known[last], known_died[last], known_overlap[last]
        known[1], known_died[1], known_overlap[1] = middle, middle_died, middle_overlap
        if search_living(known, known_died, known_overlap, resolution, tape, law, room) == 0:
            return nothing
        below, lower = locate_end(known[0], known_died[0], known_overlap[0], known[1], resolution, tape, law, room)
        above, upper = locate_end(known[2], known_died[2], known_overlap[2], known[1], resolution, tape, law, room)
        return Living(True, below, lower, upper, above)
    for i in range(size):
        if known_died[i] == ALIVE:
            first = min(first, i)
            last = max(last, i)
    below = lower = known[first]
    if first > 0:
        below, lower = locate_end(
            known[first - 1], known_died[first - 1], known_overlap[first - 1], lower, resolution, tape, law, room
        )
    above = upper = known[last]
    if last < size - 1:
        above, upper = locate_end(
            known[last + 1], known_died[last + 1], known_overlap[last + 1], upper, resolution, tape, law, room
        )
    return Living(True, below, lower, upper, above)


@entry
def refine_all(
    wanted: Flags,
    number: int,
    elapsed: int,
    limit_below: Floats,
    limit_above: Floats,
    kinds: Integers,
    errors: Floats | None,
    values: Floats,
    applies: Flags,
    events: int,
    sections: Sections,
    law: SectionLaw,
    room: Workspace,
) -> None:
    """Give each wanted engagement a new grid of sections over its living labels, ends included, by replay.

    Notes
    -----
    `limit_below` and `limit_above` are narrowed to labels known to be dead. Where nothing lives, the engagement is
    left with no living section.
    """
    labels, used, alive, died, overlaps, origins, rings, marks, summaries = sections
    for b in range(labels.shape[0]):
        if not wanted[b]:
            continue
        tape = Tape(kinds, errors, values[b], applies[b], events)
        stored = used[b]
        living = locate_living(
            limit_below[b],
            limit_above[b],
            labels[b, :stored],
            alive[b, :stored],
            died[b, :stored],
            overlaps[b, :stored],
            tape,
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
            died[b, s], overlaps[b, s] = run(label, tape, law, room)
            alive[b, s] = died[b, s] == ALIVE
            if alive[b, s]:
                copy_section(room.origins, room.rings, room.marks, 0, origins, rings, marks, n)
                summarise_section(origins, rings, marks, n, label, elapsed, law, summaries, b, s)
