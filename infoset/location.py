"""Search for the living labels: those whose section is not empty. Each probe of a label replays the history.

If the set is convex in (z, V, label), the living labels form one interval. This holds for the guaranteed model with a
box as initial set and without rates. With rates the search finds one interval and does not narrow the limits of the
labels to it; before it reports that no label lives, it searches windows of labels with bands that are convex there.
See docs/guarantee.md for the other cases.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from infoset._compile import allocation_free, entry
from infoset.chains import CAPACITY, copy_section, count_of, room_of
from infoset.concave_bounds import is_dead_between
from infoset.history import Tapes
from infoset.replays import (
    LOWER,
    MOST_HALVED_WINDOWS,
    PROBE,
    UPPER,
    Workspace,
    keep_living,
    keep_section,
    outlives,
    run,
)
from infoset.section_law import SectionLaw
from infoset.section_life import ALIVE, Flags, Floats, Integers, Tape, summarise_section
from infoset.section_passes import Sections, tape_of

LABEL_RESOLUTION = 1e-13
MOST_PROBES = 200


class Living(NamedTuple):
    """Interval of living labels [lower, upper], and a bracket of each end.

    Parameters
    ----------
    exists : bool
        Whether a label lives.
    below, lower, upper, above : float
        Increasing labels, m. The middle two live. The outer two are dead, or equal to an end at a limit of the search.
    """

    exists: bool
    below: float
    lower: float
    upper: float
    above: float


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

    The section at the living label is stored in `row` of the workspace.

    Notes
    -----
    The overlap at the event that makes the section empty is a concave function of the label, so that the Illinois
    variant of regula falsi converges fast. If four probes have not narrowed the bracket to an eighth, because that
    event changes with the label, one bisection follows.
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
            # A probe at an end gives no information: keep half a resolution away from both.
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
    """Search for a living label between three dead ones, of which the middle outlives the others.

    Returns
    -------
    int
        1 if the middle label now lives, 0 if there is no living label in the bracket.

    Notes
    -----
    The pair (event, overlap) is a unimodal function of the label: the larger half of the bracket is probed at its
    middle. The search ends if the bracket is narrower than the resolution, or if no label in it can live.
    """
    for _ in range(MOST_PROBES):
        if labels[2] - labels[0] <= resolution:
            return 0
        lower_half = labels[1] - labels[0] > labels[2] - labels[1]
        outer = 0 if lower_half else 2
        label = 0.5 * (labels[1] + labels[outer])
        probe_died, probe_overlap = run(label, tape, errors, law, room)
        at = 1 if lower_half else 2
        for i in range(3):
            k = i if i < at else i + 1
            room.four_labels[k], room.four_died[k], room.four_overlaps[k] = labels[i], died[i], overlaps[i]
        room.four_labels[at], room.four_died[at], room.four_overlaps[at] = label, probe_died, probe_overlap
        if probe_died != ALIVE and is_dead_between(
            room.four_labels, room.four_died, room.four_overlaps, 4, room.latest
        ):
            return 0
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
def search_window(
    lower: float,
    upper: float,
    probe: float,
    resolution: float,
    tape: Tape,
    errors: Floats | None,
    law: SectionLaw,
    room: Workspace,
) -> bool:
    """Return whether a label of the tape's window lives with the bands that are convex on the window.

    `probe` is the first label replayed. The bracket is left in the workspace, with a living label second.
    """
    known, died, overlaps = room.labels, room.died, room.label_overlaps
    known[0], known[1], known[2] = lower, probe, upper
    for i in (1, 0, 2):
        died[i], overlaps[i] = run(known[i], tape, errors, law, room)
        if died[i] == ALIVE:
            known[1], died[1] = known[i], ALIVE
            return True
    for end in (0, 2):
        if outlives(died[end], overlaps[end], died[1], overlaps[1]):
            other = 2 - end
            known[other], died[other], overlaps[other] = known[1], died[1], overlaps[1]
            known[1], died[1], overlaps[1] = known[end], died[end], overlaps[end]
            break
    return search_living(known, died, overlaps, resolution, tape, errors, law, room) == 1


@allocation_free
def search_everywhere(
    lower: float,
    upper: float,
    resolution: float,
    tape: Tape,
    errors: Floats | None,
    law: SectionLaw,
    room: Workspace,
) -> tuple[bool, float]:
    """Find a living label within limits if the living labels need not form an interval, or prove that none lives.

    Notes
    -----
    A window without living labels under the bands that are convex on it is discarded. The others are halved until they
    are narrower than the resolution, beginning with the one in which a probed label lived longest with its own bands.
    """
    windows, died, overlaps = room.windows, room.windows_died, room.windows_overlaps
    windows[0, 0], windows[0, 1] = lower, upper
    died[0], overlaps[0] = ALIVE, 0.0
    count = 1
    for _ in range(MOST_HALVED_WINDOWS):
        if count == 0:
            break
        best = 0
        for i in range(1, count):
            if outlives(died[i], overlaps[i], died[best], overlaps[best]):
                best = i
        near, far = windows[best, 0], windows[best, 1]
        middle = 0.5 * (near + far)
        count -= 1
        windows[best, 0], windows[best, 1] = windows[count, 0], windows[count, 1]
        died[best], overlaps[best] = died[count], overlaps[count]
        for half in range(2):
            p, q = (near, middle) if half == 0 else (middle, far)
            window = Tape(tape.kinds, tape.values, tape.applies, tape.events, p, q)
            if not search_window(p, q, 0.5 * (p + q), resolution, window, errors, law, room):
                continue
            windows[count, 0], windows[count, 1] = p, q
            died[count], overlaps[count] = -1, -np.inf
            inside = room.labels[1]
            for label in (inside, p, q):
                label_died, label_overlap = run(label, tape, errors, law, room)
                if label_died == ALIVE:
                    return True, label
                if outlives(label_died, label_overlap, died[count], overlaps[count]):
                    died[count], overlaps[count] = label_died, label_overlap
            count += q - p > resolution
    return False, lower


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
    """Locate the living labels within limits, from the stored labels, which are in increasing order.

    The sections at both ends are left in the workspace.
    """
    none_lives = Living(False, limit_below, limit_below, limit_above, limit_above)
    if limit_below > limit_above:
        return none_lives
    resolution = LABEL_RESOLUTION * max(abs(limit_below), abs(limit_above))
    # The limits, and the stored labels between them.
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
    # A limit must be replayed only if no dead label separates it from the living ones.
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
        # Bracket of the dead label that lived longest: this label and its neighbours, at the front of the same arrays.
        first, last = max(best - 1, 0), min(best + 1, end)
        known[0], known_died[0], known_overlap[0] = known[first], known_died[first], known_overlap[first]
        middle, middle_died, middle_overlap = known[best], known_died[best], known_overlap[best]
        known[2], known_died[2], known_overlap[2] = known[last], known_died[last], known_overlap[last]
        known[1], known_died[1], known_overlap[1] = middle, middle_died, middle_overlap
        alive_now = search_living(known, known_died, known_overlap, resolution, tape, errors, law, room) == 1
        first, last, end = 1, 1, 2
        if not alive_now:
            if errors is None:
                return none_lives
            alive_now, label = search_everywhere(limit_below, limit_above, resolution, tape, errors, law, room)
            if not alive_now:
                return none_lives
            known[0], known[1], known[2] = limit_below, label, limit_above
            for s in range(labels.shape[0]):
                if known[0] < labels[s] < label:
                    known[0] = labels[s]
                elif label < labels[s] < known[2]:
                    known[2] = labels[s]
            known_died[0], known_overlap[0] = run(known[0], tape, errors, law, room)
            if known_died[0] == ALIVE:
                keep_section(room, LOWER)
                first = 0
            known_died[2], known_overlap[2] = run(known[2], tape, errors, law, room)
            if known_died[2] == ALIVE:
                keep_section(room, UPPER)
                last = 2
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
    """Replace the sections of the wanted engagements by a grid over the living labels, ends included.

    Returns
    -------
    int
        Number of vertices that every new section may gain.

    Notes
    -----
    `limit_below` and `limit_above` are narrowed to dead labels, except with rates or with the rectangle as initial set
    of the guaranteed model, since other labels may live beyond them. If no label lives, the engagement has no living
    section afterwards.
    """
    spare = CAPACITY
    labels, used, alive, died = sections.labels, sections.used, sections.living, sections.died
    overlaps, summaries = sections.overlaps, sections.summaries
    origins, rings, marks = sections.origins, sections.rings, sections.marks
    for b in range(labels.shape[0]):
        if not wanted[b]:
            continue
        tape = tape_of(tapes, b, room.values, room.applies)
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
        if not living.exists:
            continue
        if errors is None and not (law.rectangle and law.exact_angles):
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
