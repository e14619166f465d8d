"""Replays of a history at chosen labels, and the room that they and a search among labels need."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from infoset._compile import allocation_free, constants
from infoset.chains import copy_section, empty_sections, working_room
from infoset.section_law import SectionLaw
from infoset.section_life import ALIVE, Flags, Floats, Integers, Tape, replay

MOST_HALVED_WINDOWS = 1000
"""Windows of labels that a search may halve. A search that would need more gives up: the set then counts as empty."""

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
    four_labels, four_died, four_overlaps : ndarray, shape (4,)
        The same of a bracket and the label probed in it.
    latest : ndarray, shape (2, 4)
        Labels and overlaps of those of them that died last.
    windows, windows_died, windows_overlaps : ndarray, shape (MOST_HALVED_WINDOWS + 2, 2) and (MOST_HALVED_WINDOWS + 2,)
        Windows of labels still to be searched, and how near to living a label of each came.
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
