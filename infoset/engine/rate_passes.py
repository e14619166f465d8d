"""Pass over the stored sections of a batch: measured rates."""

from __future__ import annotations

from infoset._compile import allocation_free, entry
from infoset.arrays import Floats
from infoset.engine.history import EventLog, LastSight
from infoset.engine.section_law import Laws, SectionLaw, law_of
from infoset.engine.section_life import across_of, sight_after, summarise_section
from infoset.engine.section_passes import Sections, is_cut, mark_empty, section_of
from infoset.engine.section_window import Rate, measure_rate_section, new_window

KNOWN, ALPHA, ACROSS, STEPS, FIRED = range(5)
"""Columns of the last sights, the fields of `LastSight`."""


@allocation_free
def follow_sight(log: EventLog, done: int, b: int, sights: Floats, law: SectionLaw) -> LastSight:
    """Return the last sight of an engagement along an axis.

    `sights` contains the last sights after `done` events, shape (C, B, columns), and is updated.
    """
    c = law.channel
    # The flag and the number of steps are stored as floats.
    row = sights[c, b]
    sight = LastSight(row[KNOWN] != 0.0, row[ALPHA], row[ACROSS], int(row[STEPS]), row[FIRED])
    for event in range(done, log.number):
        values = log.values[event]
        across = across_of(values, b, law)
        applies = log.applies[event, b]
        sight = sight_after(sight, log.kinds[event], values[c, b], across, applies, law)

    row[KNOWN] = 1.0 if sight.known else 0.0
    row[ALPHA] = sight.alpha
    row[ACROSS] = sight.across
    row[STEPS] = sight.steps
    row[FIRED] = sight.fired
    return sight


@entry
def measure_rate_all(
    log: EventLog,
    error: float,
    done: int,
    sights: Floats,
    sections: Sections,
    laws: Laws,
    points: Floats,
) -> int:
    """Cut the feasible sections by the rates of the latest event and summarise them; return how
    many labels became empty.

    `error` is the error bound of the rates, rad/s; `sights` has the last sights after `done` events
    and is updated. `points` is a working array.
    """
    newly_emptied = 0
    slots = sections.slots
    used = sections.used
    event = log.number - 1
    active = log.applies[event]
    omega = log.values[event]
    for b in range(len(used)):
        for channel in range(laws.shape[0]):
            law = law_of(laws, channel)
            sight = follow_sight(log, done, b, sights, law)
            rate = Rate(omega[channel, b], error, sight)
            for s in range(used[b]):
                if not (active[b] and is_cut(sections, channel, event, b, s)):
                    continue
                section = section_of(sections, channel, b, s)
                label = slots[b, s].label
                alone = new_window(label, label, law)
                nonempty, overlap, _ = measure_rate_section(
                    section, label, log.elapsed, rate, alone, law, points
                )
                if not nonempty:
                    newly_emptied += mark_empty(slots[b, s], channel, event, overlap)
                if slots[b, s].feasible:
                    summarise_section(section, log.elapsed, law, sections.summaries, b, s)
        sections.stale[b] = sections.stale[b] and not active[b]
    return newly_emptied
