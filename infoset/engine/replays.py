"""Replays of a history at chosen labels, and the working arrays of replays and of searches over labels."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from infoset._compile import ZERO, allocation_free, constants, entry
from infoset.arrays import Flags, Floats, Integers
from infoset.engine import chain_storage, chains
from infoset.engine.chain_storage import chains_of, copy_section, empty_sections, working_room
from infoset.engine.history import (
    ANGLE,
    IMPULSE,
    NO_SIGHT,
    PREDICTION,
    WIDENING,
    History,
    LastSight,
    Tape,
    Tapes,
    tape_of,
)
from infoset.engine.section_law import Laws, SectionLaw, law_of
from infoset.engine.section_life import (
    ALIVE,
    across_of,
    measure_rate_section,
    measure_section,
    predict_section,
    shift_section,
    sight_after,
    start_section,
    time_to_go,
    widen_section,
)

MAX_HALVED_WINDOWS = 1000
"""Maximum number of windows of labels that a search halves. If more are needed, the set counts as empty."""

PROBE, LOWER, UPPER = constants(3)
"""Rows of the workspace: the section of the last replay, and the sections at the ends of the living labels.

Row i of axis c is `ROWS` c + i.
"""
ROWS = 3


Records = np.recarray[tuple[int], np.dtype[np.record]]
Record = Any
"""One of the records: a label that was replayed, or a window."""

OUTCOME = [("died", np.int64), ("overlap", np.float64), ("emptied", np.int64)]
"""Event at which a label became empty, or ALIVE, its overlap with the band there, m, and along which axis."""
PROBED = np.dtype([("label", np.float64), *OUTCOME])
"""A replayed label, m."""
WINDOW = np.dtype([("near", np.float64), ("far", np.float64), *OUTCOME])
"""A window of labels, m, with the latest outcome that a label of it reached."""


class ReplayRoom(NamedTuple):
    """Working arrays for replays of E events.

    Parameters
    ----------
    values, applies : ndarray, shape (C, E) and (E,)
        History of one engagement in contiguous arrays: angles, rates and impulses, SI, and the events that apply.
    records, rings : ndarray
        Sections, stored as in `chain_storage`; the last replay is `PROBE`.
    overlaps : ndarray, shape (C, E)
        Overlap of section and band at each measurement, m, in the last replay.
    points : ndarray, shape (n, 2)
        Vertices of a section.
    """

    values: Floats
    applies: Flags
    records: chain_storage.Records
    rings: Floats
    overlaps: Floats
    points: Floats


class Workspace(NamedTuple):
    """Working arrays for replays and for a search over K labels.

    Parameters
    ----------
    replays : ReplayRoom
        Arrays of the replays, with the sections `PROBE`, `LOWER` and `UPPER`.
    living_overlaps : ndarray, shape (C, E)
        Overlaps of the last replay of a living label, m.
    known : recarray of PROBED, shape (K,)
        Replayed labels.
    four : recarray of PROBED, shape (4,)
        A bracket of three labels and the label probed in it.
    latest : ndarray, shape (2, 4)
        Labels and overlaps of those that became empty at the latest event.
    windows : recarray of WINDOW, shape (MAX_HALVED_WINDOWS + 2,)
        Windows of labels to be searched.
    """

    replays: ReplayRoom
    living_overlaps: Floats
    known: Records
    four: Records
    latest: Floats
    windows: Records


def replay_room(channels: int, events: int) -> ReplayRoom:
    """Allocate the arrays for replays of `events` events along a number of axes."""
    return ReplayRoom(
        np.empty((channels, events)),
        np.empty(events, dtype=bool),
        *empty_sections(ROWS * channels),
        overlaps=np.empty((channels, events)),
        points=working_room(),
    )


def workspace(channels: int, events: int, slots: int) -> Workspace:
    """Allocate the arrays for replays of `events` events and a search over `slots` stored labels."""
    return Workspace(
        replay_room(channels, events),
        living_overlaps=np.empty((channels, events)),
        known=np.recarray(slots + 2, PROBED),
        four=np.recarray(4, PROBED),
        latest=np.empty((2, 4)),
        windows=np.recarray(MAX_HALVED_WINDOWS + 2, WINDOW),
    )


class Replayed(NamedTuple):
    """Part of a history that is replayed: its events, the predictions among them, and the last sight after them."""

    events: int
    elapsed: int
    sight: LastSight


AT_START = Replayed(ZERO, ZERO, NO_SIGHT)


@allocation_free
def replay(
    done: Replayed, label: float, tape: Tape, errors: Floats | None, law: SectionLaw, room: ReplayRoom
) -> tuple[int, Replayed]:
    """Compute the section at any label along one axis from a history: apply the events of a tape after those `done`.

    Return the number of the event that makes the section empty, or ALIVE, and the events done. About 30 ns for each
    event. `errors` are the error bounds of each rate, rad/s; None without rates. It is not a field of the tape because
    the compiler omits the code for rates only if an argument is None. The `room` receives the section, in row `PROBE`
    of the axis, and the overlaps with the bands of the measurements up to the one that makes it empty.
    """
    kinds, values, applies, events, nearest, farthest = tape
    right, left = chains_of(room.records, ROWS * law.channel + PROBE)
    rings, points, window = room.rings, room.points, (nearest, farthest)
    first, elapsed, sight = done
    own, overlaps = values[law.channel], room.overlaps[law.channel]
    if first == 0:
        start_section(right, left, rings, label, law)
    for event in range(first, events):
        if kinds[event] == PREDICTION:
            if chains.is_crowded(right, left):
                chains.reduce_outward(right, left, rings, time_to_go(label, elapsed, law), points)
            elapsed += 1
            predict_section(right, left, rings, label, elapsed, law)
        elif not applies[event]:
            continue
        elif kinds[event] == ANGLE:
            living, overlaps[event] = measure_section(
                right, left, rings, label, elapsed, own[event], across_of(values, event, law), law
            )
            if not living:
                return event, done
        elif kinds[event] == IMPULSE:
            shift_section(right, left, label, elapsed, own[event], across_of(values, event, law), law)
        elif kinds[event] == WIDENING:
            widen_section(right, left, label, elapsed, law)
        elif errors is not None:
            # Not compiled for histories without rates: this branch is most of the code.
            living, overlaps[event] = measure_rate_section(
                right, left, rings, label, elapsed, own[event], errors[event], sight, window, law, points
            )
            if not living:
                return event, done
        if errors is not None:
            sight = sight_after(sight, kinds[event], own[event], across_of(values, event, law), applies[event], law)
    return ALIVE, Replayed(events, elapsed, sight)


@allocation_free
def run(label: float, tape: Tape, errors: Floats | None, laws: Laws, room: ReplayRoom) -> tuple[int, float, int]:
    """Replay a label along all axes; return the event at which it became empty, or ALIVE, the overlap, m, and its axis.

    A label becomes empty with the first of its axes. If several become empty at one event, the minimum overlap counts.
    """
    died, overlap, emptied = ALIVE, 0.0, 0
    kinds, values, applies, events, nearest, farthest = tape
    for channel in range(laws.shape[0]):
        # Later events of a label that is empty along one axis do not matter.
        part = Tape(kinds, values, applies, events if died == ALIVE else died + 1, nearest, farthest)
        died_here, _ = replay(AT_START, label, part, errors, law_of(laws, channel), room)
        if died_here != ALIVE:
            overlap_here = room.overlaps[channel, died_here]
            if died_here != died or overlap_here < overlap:
                overlap, emptied = overlap_here, channel
            died = died_here
    return died, overlap, emptied


@allocation_free
def probe(
    known: Records, i: int, label: float, tape: Tape, errors: Floats | None, laws: Laws, room: ReplayRoom
) -> bool:
    """Replay a label and write it to record `i`; return whether it lives."""
    died, overlap, emptied = run(label, tape, errors, laws, room)
    known[i].label, known[i].died, known[i].overlap, known[i].emptied = label, died, overlap, emptied
    return died == ALIVE


@allocation_free
def keep_section(room: ReplayRoom, row: int) -> None:
    """Copy the sections of the last replay to a row of the workspace."""
    for first in range(0, ROWS * room.overlaps.shape[0], ROWS):
        copy_section(room.records, room.rings, first + PROBE, room.records, room.rings, first + row)


@allocation_free
def keep_living(room: Workspace, events: int, row: int) -> None:
    """Copy sections and overlaps of the last replay to those of the living label."""
    keep_section(room.replays, row)
    overlaps = room.replays.overlaps
    for channel in range(overlaps.shape[0]):
        for event in range(events):
            room.living_overlaps[channel, event] = overlaps[channel, event]


@allocation_free
def outlives(one: Record, other: Record) -> bool:
    """Whether a label became empty later than another one, or at the same event with a greater overlap."""
    return bool(one.died > other.died or (one.died == other.died and one.overlap > other.overlap))


def margins_along(
    labels: Floats, looks: Integers, v: Floats, z: Floats, history: History, laws: Laws
) -> tuple[Floats, Floats]:
    """Return the signed distances, m, of states (V, z) to the boundaries of sections during an engagement, (C, L, B).

    They are positive inside; for an empty section the overlap with the band that made it empty. Also return the bounds
    of |V| in the sections, m/s, (C, L, B), to which rounding errors are relative. `labels` has the shape (B,), and
    `looks`, shape (L,), the number of events before each state. The states `v` and `z`, shape (C, L, B), are along each
    axis, m/s and m.
    """
    margins, reaches = np.empty(v.shape), np.empty(v.shape)
    room = replay_room(len(laws), history.events)
    margins_all(labels, looks, v, z, history.tapes, history.errors_if_any, laws, room, margins, reaches)
    return margins, reaches


@entry
def margins_all(
    labels: Floats,
    looks: Integers,
    v: Floats,
    z: Floats,
    tapes: Tapes,
    errors: Floats | None,
    laws: Laws,
    room: ReplayRoom,
    margins: Floats,
    reaches: Floats,
) -> None:
    """Write the results of `margins_along`."""
    for b in range(labels.shape[0]):
        label, tape = labels[b], tape_of(tapes, b, room.values, room.applies)
        for channel in range(laws.shape[0]):
            law = law_of(laws, channel)
            right, left = chains_of(room.records, ROWS * channel + PROBE)
            died, done = ALIVE, AT_START
            for look in range(looks.shape[0]):
                if died == ALIVE:
                    part = Tape(tape.kinds, tape.values, tape.applies, looks[look], tape.nearest, tape.farthest)
                    died, done = replay(done, label, part, errors, law, room)
                if died == ALIVE:
                    tau = time_to_go(label, done.elapsed, law)
                    state = v[channel, look, b], z[channel, look, b]
                    margins[channel, look, b] = chains.margin_in(right, left, room.rings, tau, *state)
                else:
                    margins[channel, look, b] = room.overlaps[channel, died]
                reaches[channel, look, b] = right.reach


@entry
def replay_label(label: float, tape: Tape, errors: Floats | None, laws: Laws, room: ReplayRoom) -> int:
    """Replay a label from Python; return the event at which it became empty, or ALIVE."""
    return run(label, tape, errors, laws, room)[0]
