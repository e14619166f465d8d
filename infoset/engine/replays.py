"""Replays of a history at chosen labels.

A replay of a history without rates is `replay_angles`; `rate_replays` contains that of a history
with rates.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from infoset._compile import allocation_free, entry, pasted
from infoset.arrays import Floats, Integers
from infoset.engine import chains
from infoset.engine.history import ANGLE, PREDICTION, History
from infoset.engine.rate_replays import replay_rates
from infoset.engine.section_law import Laws, SectionLaw, law_of
from infoset.engine.section_life import (
    NEVER_EMPTIED,
    across_of,
    measure_section,
    move_section,
    start_section,
    time_to_go,
)
from infoset.engine.workspace import (
    AT_START,
    LAST_REPLAY,
    Past,
    Record,
    Records,
    Replayed,
    past_of,
    replayed_section,
    select,
)


class Emptying(NamedTuple):
    """When and by how much a label became empty.

    Parameters
    ----------
    emptied_at : int
        Number of the event, or `NEVER_EMPTIED`.
    overlap : float
        Overlap of section and band at this event, m: negative; zero if the label is feasible.
    emptied_axis : int
        Axis of the section with that overlap.
    """

    emptied_at: int
    overlap: float
    emptied_axis: int


@pasted
def replay_angles(
    done: Replayed, label: float, until: int, past: Past, law: SectionLaw
) -> tuple[int, Replayed]:
    """Replay a history without rates, see `replay`. About 30 ns for each event.

    The section after the events `done` must still be in row `LAST_REPLAY` of the axis; it is
    started anew if there are none.
    """
    kinds = past.log.kinds
    applies = past.room.applies
    values = past.room.values
    own = values[law.channel]
    overlaps = past.room.overlaps[law.channel]
    section = replayed_section(past, law.channel, LAST_REPLAY, label)
    if done.events == 0:
        start_section(section, 0.0, law)

    elapsed = done.elapsed
    for event in range(done.events, until):
        if not applies[event]:
            continue
        across = across_of(values, event, law)
        if kinds[event] == ANGLE:
            nonempty, overlaps[event] = measure_section(section, elapsed, own[event], across, law)
            if not nonempty:
                return event, done
        else:
            is_reduced = move_section(
                section, kinds[event], own[event], across, elapsed, law, past.room.points
            )
            if is_reduced:
                # The section is too large from now on, and so are the overlaps that follow. They
                # are no concave function of the label then, so that a search that finds no feasible
                # label proves nothing (`is_infeasible_between`).
                past.room.unproved[0] = True
            elapsed += kinds[event] == PREDICTION
    return NEVER_EMPTIED, Replayed(until, elapsed, done.sight)


@allocation_free
def replay(
    done: Replayed, label: float, until: int, past: Past, errors: Floats | None, law: SectionLaw
) -> tuple[int, Replayed]:
    """Compute the section at any label along one axis: apply the events after those `done`, up to
    number `until`.

    Return the number of the event that makes the section empty, and `done` as it was; or
    NEVER_EMPTIED, and the events done now. The section after the events `done` must still be in row
    `LAST_REPLAY` of the axis; it is started anew if there are none. The workspace receives the
    section, in the same row, and the overlaps with the bands of the measurements up to the one that
    makes it empty.

    `errors` are the error bounds of the measured rates. They are an argument because the compiler
    omits `replay_rates`, which is most of the code, only if an argument is None.
    """
    if errors is None:
        return replay_angles(done, label, until, past, law)
    return replay_rates(done, label, until, past, errors, law)


@allocation_free
def run(label: float, past: Past) -> Emptying:
    """Replay a label along all axes; return when it became empty.

    A label becomes empty with the first of its axes. If several become empty at one event, the
    minimum overlap counts.
    """
    emptied_at = NEVER_EMPTIED
    overlap = 0.0
    emptied_axis = 0
    for channel in range(past.laws.shape[0]):
        # Later events of a label that is empty along one axis do not matter.
        until = past.log.number if emptied_at == NEVER_EMPTIED else emptied_at + 1
        law = law_of(past.laws, channel)
        emptied_here, _ = replay(AT_START, label, until, past, past.errors, law)
        if emptied_here == NEVER_EMPTIED:
            continue

        overlap_here = past.room.overlaps[channel, emptied_here]
        if emptied_here != emptied_at or overlap_here < overlap:
            overlap = overlap_here
            emptied_axis = channel
        emptied_at = emptied_here
    return Emptying(emptied_at, overlap, emptied_axis)


@allocation_free
def evaluate_label(records: Records, i: int, label: float, past: Past) -> bool:
    """Replay a label and write it to record `i`; return whether it is feasible."""
    emptying = run(label, past)
    record = records[i]
    record.label = label
    record.emptied_at = emptying.emptied_at
    record.overlap = emptying.overlap
    record.emptied_axis = emptying.emptied_axis
    return emptying.emptied_at == NEVER_EMPTIED


@allocation_free
def empties_later(one: Record, other: Record) -> bool:
    """Whether a label became empty later than another one, or at the same event with a greater
    overlap.
    """
    if one.emptied_at != other.emptied_at:
        return bool(one.emptied_at > other.emptied_at)
    return bool(one.overlap > other.overlap)


def margins_along(
    labels: Floats, events_before: Integers, v: Floats, z: Floats, history: History, laws: Laws
) -> tuple[Floats, Floats]:
    """Return the signed distances of states to the boundaries of their sections, and bounds of |V|.

    Parameters
    ----------
    labels : ndarray, shape (B,)
        Label of each engagement, m.
    events_before : ndarray of int, shape (L,)
        Number of events before each state, increasing.
    v, z : ndarray, shape (C, L, B)
        The states (V, z) along each axis, m/s and m.

    Returns
    -------
    margins : ndarray, shape (C, L, B)
        Distances, m: positive inside; for an empty section the overlap with the band that made it
        empty.
    reaches : ndarray, shape (C, L, B)
        Bounds of |V| in the sections, m/s, to which rounding errors are relative.
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
                # No other replay comes between: the section goes on from the events `done`.
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
    return run(label, past).emptied_at
