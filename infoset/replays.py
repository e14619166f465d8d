"""Replays of a history at chosen labels, and the working arrays of replays and of searches over labels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from infoset._compile import allocation_free, constants
from infoset.chains import copy_section, empty_sections, working_room
from infoset.section_law import SectionLaw
from infoset.section_life import ALIVE, Flags, Floats, Integers, Tape, replay

MOST_HALVED_WINDOWS = 1000
"""Greatest number of windows of labels that a search halves. If more are needed, the set counts as empty."""

PROBE, LOWER, UPPER = constants(3)
"""Rows of the workspace: the section of the last replay, and the sections at the ends of the living labels."""


class Workspace(NamedTuple):
    """Working arrays for replays of E events and a search over K labels.

    Parameters
    ----------
    values, applies : ndarray, shape (E,)
        History of one engagement in contiguous arrays: angles, rates and impulses, SI, and the events that apply.
    origins, rings, marks : ndarray
        The sections `PROBE`, `LOWER` and `UPPER`, stored as in `chains`.
    overlaps, living_overlaps : ndarray, shape (E,)
        Overlap of section and band at each measurement, m, in the last replay and at the last living label.
    points : ndarray, shape (n, 2)
        Vertices of a section.
    labels, died, label_overlaps : ndarray, shape (K,)
        Replayed labels, m; the event at which each became empty, or `ALIVE`; its overlap there, m.
    four_labels, four_died, four_overlaps : ndarray, shape (4,)
        The same for a bracket of three labels and the label probed in it.
    latest : ndarray, shape (2, 4)
        Labels and overlaps of those that became empty at the latest event.
    windows, windows_died, windows_overlaps : ndarray, shape (MOST_HALVED_WINDOWS + 2, 2) and (MOST_HALVED_WINDOWS + 2,)
        Windows of labels to be searched, with the latest event and overlap that a label of each reached.
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
    four_labels: Floats
    four_died: Integers
    four_overlaps: Floats
    latest: Floats
    windows: Floats
    windows_died: Integers
    windows_overlaps: Floats


def workspace(events: int, slots: int) -> Workspace:
    """Allocate the arrays for replays of `events` events and a search over `slots` stored labels."""
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
        four_labels=np.empty(4),
        four_died=np.empty(4, dtype=np.int64),
        four_overlaps=np.empty(4),
        latest=np.empty((2, 4)),
        windows=np.empty((MOST_HALVED_WINDOWS + 2, 2)),
        windows_died=np.empty(MOST_HALVED_WINDOWS + 2, dtype=np.int64),
        windows_overlaps=np.empty(MOST_HALVED_WINDOWS + 2),
    )


@allocation_free
def run(label: float, tape: Tape, errors: Floats | None, law: SectionLaw, room: Workspace) -> tuple[int, float]:
    """Replay a label; return the event at which it became empty, or ALIVE, and the overlap there, or zero."""
    died = replay(label, tape, errors, law, room.origins, room.rings, room.marks, PROBE, room.overlaps, room.points)
    return died, room.overlaps[died] if died != ALIVE else 0.0


@allocation_free
def keep_section(room: Workspace, row: int) -> None:
    """Copy the section of the last replay to a row of the workspace."""
    copy_section(room.origins, room.rings, room.marks, PROBE, room.origins, room.rings, room.marks, row)


@allocation_free
def keep_living(room: Workspace, events: int, row: int) -> None:
    """Copy section and overlaps of the last replay to those of the living label."""
    keep_section(room, row)
    for event in range(events):
        room.living_overlaps[event] = room.overlaps[event]


@allocation_free
def outlives(died: int, overlap: float, other_died: int, other_overlap: float) -> bool:
    """Whether a label became empty later than another one, or at the same event with a greater overlap."""
    return died > other_died or (died == other_died and overlap > other_overlap)
