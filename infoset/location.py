"""Where the living labels are, found exactly by replaying the history at chosen labels.

Where the sets are convex in (z, V, label) the living labels form one interval: in the guaranteed model that starts
from a box and measures no rates. Elsewhere they need not. With rates the search finds one interval of them, the limits
within which labels may live are not narrowed to it, and before it says that none lives, it looks through windows of
labels with bands that are convex there. docs/guarantee.md says what is done in the other cases.
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
    (time of death, overlap) is unimodal in the label: the larger half of the bracket is probed in its middle. It ends
    where the bracket closes, or where no label in it can live.
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
    """Whether a label of the tape's window lives, by the bands that are convex there; the first found is put second.

    `probe` is tried before any but the ends. The labels of the bracket are left in the workspace.
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
    """Find a living label within limits, where they need not form an interval, or make sure that there is none.

    Notes
    -----
    A window in which none lives by the bands that are convex there is done with; another is halved, as far as it is
    wider than the resolution. The next is that in which a label, or an end, came nearest to living by its own bands.
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
                own_died, own_overlap = run(label, tape, errors, law, room)
                if own_died == ALIVE:
                    return True, label
                if outlives(own_died, own_overlap, died[count], overlaps[count]):
                    died[count], overlaps[count] = own_died, own_overlap
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
        alive_now = search_living(known, known_died, known_overlap, resolution, tape, errors, law, room) == 1
        first, last, end = 1, 1, 2
        if not alive_now:
            if errors is None:
                return nothing
            alive_now, label = search_everywhere(limit_below, limit_above, resolution, tape, errors, law, room)
            if not alive_now:
                return nothing
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
    """Give each wanted engagement a new grid of sections over its living labels, ends included, by replay.

    Notes
    -----
    `limit_below` and `limit_above` are narrowed to labels known to be dead, unless rates were measured or a guaranteed
    model starts from the rectangle: then others may live beyond. Where nothing lives, the engagement is left with no
    living section. Returned is how many vertices the fullest of the new sections may gain.
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
        if not living.found:
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
