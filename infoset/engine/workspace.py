"""Working arrays of replays and of searches over labels, and the history that they replay."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from infoset._compile import FALSE, ZERO, allocation_free, constants, inlined, pasted
from infoset.arrays import Flags, Floats
from infoset.engine.chain_storage import Chains, copy_section, empty_sections, view_of, working_room
from infoset.engine.chains import SectionView
from infoset.engine.history import NO_SIGHT, WIDENING, EventLog, History, LastSight
from infoset.engine.section_law import Laws

MAX_HALVED_WINDOWS = 1000
"""Maximum number of windows of labels that a search halves. If more are needed, the set counts as
empty. Chosen as a limit of time; Phi does not depend on this search (docs/guarantee-miss.md), and
the misses and sets of flights of ten seconds are the same from 4 to 4000 (measured)."""

LAST_REPLAY, LOWER, UPPER = constants(3)
"""Rows of the workspace: the section of the last replay, and the sections at the lower and at the
upper end of the feasible labels. Row i of axis c is section `ROWS` c + i.
"""
ROWS = 3

Records = np.recarray[tuple[int], np.dtype[np.record]]
Record = Any
"""One of the records: a replayed label, or a window."""

EMPTYING = [("emptied_at", np.int64), ("overlap", np.float64), ("emptied_axis", np.int64)]
"""Fields of `Emptying`."""
EVALUATED = np.dtype([("label", np.float64), *EMPTYING])
"""A replayed label, m, and when it became empty."""
WINDOW = np.dtype([("near", np.float64), ("far", np.float64), *EMPTYING])
"""A window of labels, m, and when the last one of its replayed labels became empty."""


class Workspace(NamedTuple):
    """Working arrays for replays of E events and for a search over K stored labels.

    Parameters
    ----------
    values, applies : ndarray, shape (C, E) and (E,)
        Events of the engagement that is replayed, contiguous: values and whether they apply, as in
        `EventLog`. `select` writes them.
    chains : Chains
        The sections in the rows `LAST_REPLAY`, `LOWER` and `UPPER` along each axis. Replays write
        the first one, `keep_section` the others.
    overlaps : ndarray, shape (C, E)
        Overlap of section and band at each measurement that was applied, m, in the last replay.
        Replays write them, up to the measurement that makes the section empty.
    feasible_overlaps : ndarray, shape (C, E)
        The overlaps in the last replay of a feasible label that `keep_feasible` has kept.
    drifts : ndarray, shape (C, 2)
        With rates: `turned` and the room of (13), m/s and m, of the window of the last replay in
        which the section of the axis is not empty at the end. `replay_rates` writes them.
    points : ndarray, shape (n, 2)
        Vertices of a section.
    cuts : ndarray of bool, shape (E,)
        With rates, the measurements that have cut the section of a single label, in replays of all
        events. `select` resets them, `replay_rates` adds to them.
    known : recarray of EVALUATED, shape (K + 2,)
        The limits of the search and the stored labels between them. `list_known_labels` and
        `check_limits` write them.
    bracket : recarray of EVALUATED, shape (3,)
        Three labels in increasing order: the middle one empties later than the outer ones.
    four : recarray of EVALUATED, shape (4,)
        The labels of a bracket and the one evaluated between them, in increasing order.
    latest : ndarray, shape (2, 4)
        Labels and overlaps of those in `four` that became empty at the latest event.
    windows : recarray of WINDOW, shape (MAX_HALVED_WINDOWS + 2,)
        Windows of labels to be searched. One halving puts at most two in the place of one.
    unproved : ndarray of bool, shape (1,)
        Whether a search without a result proves nothing for a history without rates: a section was
        reduced, or a bracket ended without a proof. `select` resets it, `replay_angles` and
        `search_bracket` set it.
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
    bracket: Records
    four: Records
    latest: Floats
    windows: Records
    unproved: Flags


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
        For Phi, the labels of the piece, m. With rates they are also the window of labels on which
        sections are convex; the empty window, from infinity to minus infinity, makes the window of
        each label the label itself.
    thinned : bool
        With rates, whether replays leave out the measurements that have not cut the section of any
        single label so far, `cuts` of the workspace.
    """

    log: EventLog
    errors: Floats | None
    laws: Laws
    room: Workspace
    nearest: float
    farthest: float
    thinned: bool


class Replayed(NamedTuple):
    """Part of a history that is replayed: its events, the predictions among them, and the last
    angle measurement in it, which only rates need.
    """

    events: int
    elapsed: int
    sight: LastSight


AT_START = Replayed(ZERO, ZERO, NO_SIGHT)


def past_of(history: History, laws: Laws, slots: int = 1) -> Past:
    """Return the history of a batch, with working arrays for a search over `slots` stored
    labels.
    """
    channels = len(laws)
    events = history.events
    room = Workspace(
        values=np.empty((channels, events)),
        applies=np.empty(events, dtype=bool),
        chains=empty_sections(ROWS * channels),
        overlaps=np.empty((channels, events)),
        feasible_overlaps=np.empty((channels, events)),
        drifts=np.zeros((channels, 2)),
        points=working_room(),
        cuts=np.zeros(events, dtype=bool),
        known=np.recarray(slots + 2, EVALUATED),
        bracket=np.recarray(3, EVALUATED),
        four=np.recarray(4, EVALUATED),
        latest=np.empty((2, 4)),
        windows=np.recarray(MAX_HALVED_WINDOWS + 2, WINDOW),
        unproved=np.zeros(1, dtype=bool),
    )
    return Past(history.log, history.errors_if_any, laws, room, np.inf, -np.inf, FALSE)


@allocation_free
def select(past: Past, b: int) -> None:
    """Copy the events of an engagement to the contiguous arrays that replays read, and reset `cuts`
    and `unproved`.
    """
    log = past.log
    values = past.room.values
    applies = past.room.applies
    cuts = past.room.cuts
    past.room.unproved[0] = False
    for event in range(log.number):
        applies[event] = log.applies[event, b]
        # A replay that leaves out measurements must apply every enlargement of the section.
        cuts[event] = log.kinds[event] == WIDENING
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


@allocation_free
def keep_section(past: Past, row: int) -> None:
    """Copy the sections of the last replay to a row of the workspace."""
    chains = past.room.chains
    for channel in range(past.laws.shape[0]):
        copy_section(chains, ROWS * channel + LAST_REPLAY, chains, ROWS * channel + row)


@allocation_free
def keep_feasible(past: Past, row: int) -> None:
    """Keep the sections and the overlaps of the last replay, which is of a feasible label."""
    keep_section(past, row)
    overlaps = past.room.overlaps
    for channel in range(overlaps.shape[0]):
        for event in range(past.log.number):
            past.room.feasible_overlaps[channel, event] = overlaps[channel, event]
