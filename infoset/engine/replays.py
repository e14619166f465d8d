"""Replays of a history at chosen labels, and the working arrays of replays and of searches over
labels.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from infoset._compile import FALSE, ZERO, allocation_free, constants, entry, inlined, pasted
from infoset.arrays import Flags, Floats, Integers
from infoset.engine import chains
from infoset.engine.chain_storage import Chains, copy_section, empty_sections, view_of, working_room
from infoset.engine.chains import SectionView
from infoset.engine.history import (
    ANGLE,
    IMPULSE,
    NO_SIGHT,
    PREDICTION,
    RATE,
    WIDENING,
    EventLog,
    History,
    LastSight,
)
from infoset.engine.section_law import Laws, SectionLaw, law_of
from infoset.engine.section_life import (
    NEVER_EMPTIED,
    across_of,
    measure_section,
    predict_section,
    shift_section,
    sight_after,
    start_section,
    time_to_go,
    widen_section,
)
from infoset.engine.section_window import (
    Rate,
    apply_stretch,
    half_time,
    measure_in_window,
    measure_rate_section,
    middle_of,
    new_stretch,
    new_window,
    stretch_after,
    window_after,
)

MAX_HALVED_WINDOWS = 1000
"""Maximum number of windows of labels that a search halves. If more are needed, the set counts as
empty.
"""

LAST_REPLAY, LOWER, UPPER = constants(3)
"""Rows of the workspace: the section of the last replay, and the sections at the ends of the
feasible labels.

Row i of axis c is `ROWS` c + i.
"""
ROWS = 3


Records = np.recarray[tuple[int], np.dtype[np.record]]
Record = Any
"""One of the records: a label that was replayed, or a window."""

OUTCOME = [("emptied_at", np.int64), ("overlap", np.float64), ("emptied_axis", np.int64)]
"""Event at which a label became empty, or NEVER_EMPTIED, its overlap with the band there, m, and
along which axis.
"""
EVALUATED = np.dtype([("label", np.float64), *OUTCOME])
"""A replayed label, m."""
WINDOW = np.dtype([("near", np.float64), ("far", np.float64), *OUTCOME])
"""A window of labels, m, with the latest outcome that a label of it reached."""


class Workspace(NamedTuple):
    """Working arrays for replays of E events and for a search over K labels.

    Parameters
    ----------
    values, applies : ndarray, shape (C, E) and (E,)
        Events of the engagement that is replayed, contiguous: values and whether they apply, as in
        `EventLog`.
    chains : Chains
        The sections `LAST_REPLAY`, which is the last replay, `LOWER` and `UPPER` along each axis.
    overlaps, feasible_overlaps : ndarray, shape (C, E)
        Overlap of section and band at each measurement, m, in the last replay and in the replay of
        a feasible label.
    drifts : ndarray, shape (C, 2)
        With rates: `turned` and the room of (13), m/s and m, of the window of the last replay of a
        feasible label.
    points : ndarray, shape (n, 2)
        Vertices of a section.
    cuts : ndarray of bool, shape (E,)
        With rates, the measurements that have cut the section of a single label, in replays of all
        events.
    known : recarray of EVALUATED, shape (K,)
        Replayed labels.
    four : recarray of EVALUATED, shape (4,)
        A bracket of three labels and the label evaluated in it.
    latest : ndarray, shape (2, 4)
        Labels and overlaps of those that became empty at the latest event.
    windows : recarray of WINDOW, shape (MAX_HALVED_WINDOWS + 2,)
        Windows of labels to be searched.
    """

    values: Floats
    applies: Flags
    chains: Chains
    overlaps: Floats
    feasible_overlaps: Floats
    drifts: Floats
    points: Floats
    cuts: Flags
    known: Records
    four: Records
    latest: Floats
    windows: Records


class Past(NamedTuple):
    """The history of a batch, and what a replay of it needs.

    Parameters
    ----------
    log : EventLog
        Events of all engagements.
    errors : ndarray, shape (E,), or None
        Error bound of each measured rate, rad/s; None without rates.
    laws : Laws
        Constants of the axes.
    room : Workspace
        Working arrays, with the events of the engagement that `select` has chosen.
    nearest, farthest : float
        With rates, the window of labels, m, on which sections are convex. The empty window, from
        infinity to minus infinity, makes the window of each label the label itself.
    thinned : bool
        With rates, whether replays leave out the measurements that have not cut the section of a
        label so far.
    """

    log: EventLog
    errors: Floats | None
    laws: Laws
    room: Workspace
    nearest: float
    farthest: float
    thinned: bool


def past_of(history: History, laws: Laws, slots: int = 1) -> Past:
    """Return the history of a batch, with working arrays for a search over `slots` stored
    labels.
    """
    channels = len(laws)
    events = history.events
    room = Workspace(
        np.empty((channels, events)),
        np.empty(events, dtype=bool),
        empty_sections(ROWS * channels),
        overlaps=np.empty((channels, events)),
        feasible_overlaps=np.empty((channels, events)),
        drifts=np.zeros((channels, 2)),
        points=working_room(),
        cuts=np.zeros(events, dtype=bool),
        known=np.recarray(slots + 2, EVALUATED),
        four=np.recarray(4, EVALUATED),
        latest=np.empty((2, 4)),
        windows=np.recarray(MAX_HALVED_WINDOWS + 2, WINDOW),
    )
    return Past(history.log, history.errors_if_any, laws, room, np.inf, -np.inf, FALSE)


@allocation_free
def select(past: Past, b: int) -> None:
    """Copy the events of an engagement to the contiguous arrays that replays read."""
    log = past.log
    values = past.room.values
    applies = past.room.applies
    for event in range(log.number):
        applies[event], past.room.cuts[event] = log.applies[event, b], log.kinds[event] == WIDENING
        for channel in range(values.shape[0]):
            values[channel, event] = log.values[event, channel, b]


@allocation_free
def with_window(past: Past, nearest: float, farthest: float) -> Past:
    """Return a history with another window of labels, whose replays leave out no measurement."""
    return Past(past.log, past.errors, past.laws, past.room, nearest, farthest, FALSE)


@inlined
def middle_label(label: float, past: Past) -> float:
    """Return the label in whose coordinates a replayed section is: with rates, the middle of its
    window.
    """
    if past.errors is None:
        return label
    return 0.5 * (min(label, past.nearest) + max(label, past.farthest))


@pasted
def replayed_section(past: Past, channel: int, row: int, label: float) -> SectionView:
    """Return the section in a row of the workspace along an axis."""
    return view_of(past.room.chains, ROWS * channel + row, label)


class Replayed(NamedTuple):
    """Part of a history that is replayed: its events, the predictions among them, and the last
    sight after them.
    """

    events: int
    elapsed: int
    sight: LastSight


AT_START = Replayed(ZERO, ZERO, NO_SIGHT)


@allocation_free
def replay(
    done: Replayed, label: float, until: int, past: Past, errors: Floats | None, law: SectionLaw
) -> tuple[int, Replayed]:
    """Compute the section at any label along one axis: apply the events after those `done`, up to
    number `until`.

    Return the number of the event that makes the section empty, or NEVER_EMPTIED, and the events
    done. About 30 ns for each event. The workspace receives the section, in row `LAST_REPLAY` of
    the axis, and the overlaps with the bands of the measurements up to the one that makes it empty.

    `errors` are those of the history. They are an argument because the compiler omits the code for
    rates, which is most of it, only if an argument is None.
    """
    kinds = past.log.kinds
    applies = past.room.applies
    points = past.room.points
    values = past.room.values
    overlaps = past.room.overlaps[law.channel]
    cuts = past.room.cuts
    own = values[law.channel]
    first, elapsed, sight = done
    middle = label
    room = 0.0
    if errors is not None:
        window = new_window(min(label, past.nearest), max(label, past.farthest), law)
        stretch = new_stretch(elapsed)
        middle = middle_of(window)
        room = window.fastest * half_time(window, law)
    section = replayed_section(past, law.channel, LAST_REPLAY, middle)
    if first == 0:
        start_section(section, room, law)
    for event in range(first, until):
        across = across_of(values, event, law)
        if (
            errors is not None
            and past.thinned
            and not cuts[event]
            and kinds[event] in (ANGLE, RATE)
        ):
            sight = sight_after(sight, kinds[event], own[event], across, applies[event], law)
            continue
        if errors is not None and past.thinned and applies[event] and cuts[event]:
            apply_stretch(section, stretch, elapsed, law, points)
            stretch = new_stretch(elapsed)
        if errors is not None and past.thinned and not cuts[event]:
            elapsed += kinds[event] == PREDICTION
            if not applies[event]:
                continue
            stretch = stretch_after(
                stretch, kinds[event], own[event], across, window.fastest, elapsed, law
            )
        elif kinds[event] == PREDICTION:
            if chains.is_crowded(section):
                chains.reduce_outward(section, time_to_go(middle, elapsed, law), points)
            elapsed += 1
            predict_section(section, elapsed, law)
        elif not applies[event]:
            continue
        elif kinds[event] == ANGLE:
            if errors is None:
                feasible, overlaps[event] = measure_section(
                    section, elapsed, own[event], across, law
                )
            else:
                angles = own[event], across
                feasible, overlaps[event], is_cut = measure_in_window(
                    section, label, elapsed, angles, window, law
                )
                cuts[event] |= is_cut
            if not feasible:
                return event, done
        elif kinds[event] == IMPULSE:
            shift_section(section, elapsed, own[event], across, law)
        elif kinds[event] == WIDENING:
            widen_section(section, elapsed, law)
        elif errors is not None:
            rate = Rate(own[event], errors[event], sight)
            feasible, overlaps[event], is_cut = measure_rate_section(
                section, label, elapsed, rate, window, law, points
            )
            cuts[event] |= is_cut
            if not feasible:
                return event, done
        if errors is not None:
            sight = sight_after(sight, kinds[event], own[event], across, applies[event], law)
            if (
                past.thinned or window.near < window.far
            ):  # of a single label only the limits are used
                window = window_after(
                    window, kinds[event], own[event], across, errors[event], elapsed, law
                )
    if errors is not None:
        if past.thinned:
            apply_stretch(section, stretch, elapsed, law, points)
        past.room.drifts[law.channel, 0] = window.turned
        past.room.drifts[law.channel, 1] = window.loose * half_time(window, law)
    return NEVER_EMPTIED, Replayed(until, elapsed, sight)


@allocation_free
def run(label: float, past: Past) -> tuple[int, float, int]:
    """Replay a label along all axes; return the event at which it became empty, or NEVER_EMPTIED,
    the overlap, m, and its axis.

    A label becomes empty with the first of its axes. If several become empty at one event, the
    minimum overlap counts.
    """
    emptied_at = NEVER_EMPTIED
    overlap = 0.0
    emptied_axis = 0
    for channel in range(past.laws.shape[0]):
        # Later events of a label that is empty along one axis do not matter.
        until = past.log.number if emptied_at == NEVER_EMPTIED else emptied_at + 1
        emptied_at_here, _ = replay(
            AT_START, label, until, past, past.errors, law_of(past.laws, channel)
        )
        if emptied_at_here != NEVER_EMPTIED:
            overlap_here = past.room.overlaps[channel, emptied_at_here]
            if emptied_at_here != emptied_at or overlap_here < overlap:
                overlap = overlap_here
                emptied_axis = channel
            emptied_at = emptied_at_here
    return emptied_at, overlap, emptied_axis


@allocation_free
def evaluate_label(known: Records, i: int, label: float, past: Past) -> bool:
    """Replay a label and write it to record `i`; return whether it is feasible."""
    emptied_at, overlap, emptied_axis = run(label, past)
    known[i].label = label
    known[i].emptied_at = emptied_at
    known[i].overlap = overlap
    known[i].emptied_axis = emptied_axis
    return emptied_at == NEVER_EMPTIED


@allocation_free
def keep_section(past: Past, row: int) -> None:
    """Copy the sections of the last replay to a row of the workspace."""
    chains = past.room.chains
    for channel in range(past.laws.shape[0]):
        copy_section(chains, ROWS * channel + LAST_REPLAY, chains, ROWS * channel + row)


@allocation_free
def keep_feasible(past: Past, row: int) -> None:
    """Keep the sections and overlaps of the last replay as those of a feasible label."""
    keep_section(past, row)
    overlaps = past.room.overlaps
    for channel in range(overlaps.shape[0]):
        for event in range(past.log.number):
            past.room.feasible_overlaps[channel, event] = overlaps[channel, event]


@allocation_free
def empties_later(one: Record, other: Record) -> bool:
    """Whether a label became empty later than another one, or at the same event with a greater
    overlap.
    """
    return bool(
        one.emptied_at > other.emptied_at
        or (one.emptied_at == other.emptied_at and one.overlap > other.overlap)
    )


def margins_along(
    labels: Floats, events_before: Integers, v: Floats, z: Floats, history: History, laws: Laws
) -> tuple[Floats, Floats]:
    """Return the signed distances, m, of states (V, z) to the boundaries of sections during an
    engagement, (C, L, B).

    They are positive inside; for an empty section the overlap with the band that made it empty.
    Also return the bounds of |V| in the sections, m/s, (C, L, B), to which rounding errors are
    relative. `labels` has the shape (B,), and `events_before`, shape (L,), is the number of events
    before each state. The states `v` and `z`, shape (C, L, B), are along each axis, m/s and m.
    """
    margins = np.empty(v.shape)
    reaches = np.empty(v.shape)
    margins_all(labels, events_before, v, z, past_of(history, laws), margins, reaches)
    return margins, reaches


@entry
def margins_all(
    labels: Floats,
    events_before: Integers,
    v: Floats,
    z: Floats,
    past: Past,
    margins: Floats,
    reaches: Floats,
) -> None:
    """Write the results of `margins_along`."""
    for b in range(labels.shape[0]):
        label = labels[b]
        select(past, b)
        for channel in range(past.laws.shape[0]):
            law = law_of(past.laws, channel)
            section = replayed_section(past, channel, LAST_REPLAY, label)
            emptied_at = NEVER_EMPTIED
            done = AT_START
            for k in range(events_before.shape[0]):
                if emptied_at == NEVER_EMPTIED:
                    emptied_at, done = replay(done, label, events_before[k], past, past.errors, law)
                if emptied_at == NEVER_EMPTIED:
                    tau = time_to_go(label, done.elapsed, law)
                    margins[channel, k, b] = chains.margin_in(
                        section, tau, v[channel, k, b], z[channel, k, b]
                    )
                else:
                    margins[channel, k, b] = past.room.overlaps[channel, emptied_at]
                reaches[channel, k, b] = section.right.reach


@entry
def replay_label(label: float, b: int, past: Past) -> int:
    """Replay a label of an engagement from Python; return the event at which it became empty, or
    NEVER_EMPTIED.
    """
    select(past, b)
    return run(label, past)[0]
