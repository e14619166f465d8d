"""Replays of a history with measured rates.

With rates, the section of a label is computed with the bands of a window of labels, and a replay of
a window leaves out the measurements that have not cut the section of any label so far: the events
between two cuts form a stretch, which is applied at once. See "With a rate sensor" in
docs/guarantee-miss.md.
"""

from __future__ import annotations

from typing import NamedTuple

from infoset._compile import allocation_free, inlined
from infoset.arrays import Floats
from infoset.engine import chains
from infoset.engine.chains import SectionView
from infoset.engine.history import ANGLE, IMPULSE, PREDICTION, RATE, LastSight
from infoset.engine.section_law import SectionLaw
from infoset.engine.section_life import (
    NEVER_EMPTIED,
    SUM_SLACK,
    across_of,
    impulse_doubt,
    move_section,
    sight_after,
    start_section,
    time_to_go,
)
from infoset.engine.section_window import (
    AxisEvent,
    Rate,
    Window,
    half_time,
    measure_in_window,
    measure_rate_section,
    middle_of,
    new_window,
    window_after,
)
from infoset.engine.workspace import LAST_REPLAY, Past, Replayed, replayed_section

IN_BURN = -1
"""Step at which a stretch began: none, after a burn."""


class Stretch(NamedTuple):
    """Events without a cut, from step `began` on, which are applied at once; times are measured
    from that step.

    A burn and the prediction after it are in no stretch, because the level of the section is
    between those of two steps then.

    Parameters
    ----------
    began : int
        Step after the last event that was applied by itself, such as a cut; the first step if there
        is none, `IN_BURN` between a burn and the prediction after it.
    bounds, moments : float
        Sum of the bounds of changes of V, m/s, and of bound times time, m.
    turned, impulses : float
        Sum of the impulses, m/s, and of impulse times time, m.
    """

    began: int
    bounds: float
    moments: float
    turned: float
    impulses: float


@inlined
def new_stretch(began: int) -> Stretch:
    """Return a stretch without events."""
    return Stretch(began, 0.0, 0.0, 0.0, 0.0)


@inlined
def stretch_after(
    stretch: Stretch, event: AxisEvent, fastest: float, elapsed: int, law: SectionLaw
) -> Stretch:
    """Return a stretch after one more event; `fastest` bounds abs(V), see `Window`.

    `elapsed` is the step after the event.
    """
    began, bounds, moments, turned, impulses = stretch
    time = law.step * (elapsed - began)
    bound = 0.0
    if event.kind == PREDICTION:
        bound = law.half_v + SUM_SLACK * fastest
    elif event.kind == IMPULSE:
        bound = impulse_doubt(event.value, event.across, law)
        turned += event.value
        impulses += event.value * time
    return Stretch(began, bounds + bound, moments + bound * time, turned, impulses)


@inlined
def next_stretch(
    stretch: Stretch,
    event: AxisEvent,
    is_left_out: bool,
    fastest: float,
    elapsed: int,
    law: SectionLaw,
) -> Stretch:
    """Return the stretch that goes on with an event that is left out, or begins after another one;
    the arguments are those of `stretch_after`.
    """
    if is_left_out:
        return stretch_after(stretch, event, fastest, elapsed, law)
    if starts_burn(event.kind, law):
        return new_stretch(IN_BURN)
    return new_stretch(elapsed)


@inlined
def starts_burn(kind: int, law: SectionLaw) -> bool:
    """Whether an event is a burn."""
    return kind == IMPULSE and law.burn_time > 0.0


@allocation_free
def apply_stretch(
    section: SectionView, stretch: Stretch, elapsed: int, law: SectionLaw, points: Floats
) -> None:
    """Move a section over a stretch to step `elapsed`: impulses at once, and the bounds of changes
    of V at both ends.

    By Lemma 9a, two segments along the levels of both ends contain the segments of all changes of V
    between them. All of them are added at once if the stretch begins at this step. Nothing is done
    between a burn and the prediction after it. `points` is a working array.
    """
    if stretch.began == IN_BURN:
        return
    before = time_to_go(section.label, stretch.began, law)
    now = time_to_go(section.label, elapsed, law)
    late = stretch.moments / (before - now) if elapsed > stretch.began else stretch.bounds
    # It is not noted in `unproved`, which is for histories without rates.
    if chains.is_crowded(section):
        chains.reduce_outward(section, before, points)

    # All events are later than `began` by at most the whole stretch: a negative difference is
    # rounding.
    chains.spread(section, before, max(stretch.bounds - late, 0.0))
    chains.shift(section, before, -stretch.turned)
    # An impulse changes the predicted miss by its product with the time to go when it is given.
    for chain in (section.right, section.left):
        chains.move(chain, 0.0, stretch.impulses)
    chains.turn(section, now)
    chains.spread(section, now, late)


@inlined
def measure_event(
    section: SectionView,
    label: float,
    event: AxisEvent,
    elapsed: int,
    sight: LastSight,
    window: Window,
    law: SectionLaw,
    points: Floats,
) -> tuple[bool, float, bool]:
    """Cut the section of a label by a measured angle or rate, with the bands of its window.

    Return whether it is not empty, the overlap with the band, m, and whether the band cuts it.
    """
    if event.kind == ANGLE:
        angles = (event.value, event.across)
        return measure_in_window(section, label, elapsed, angles, window, law)
    rate = Rate(event.value, event.error, sight)
    return measure_rate_section(section, label, elapsed, rate, window, law, points)


@allocation_free
def replay_rates(
    done: Replayed, label: float, until: int, past: Past, errors: Floats, law: SectionLaw
) -> tuple[int, Replayed]:
    """Replay a history with rates, see `replay`, and note the measurements that cut the section.

    `errors` are the error bounds of the measured rates, rad/s. The section is in the coordinates of
    the middle of its window; `drifts` of the workspace receives its displacement (13), unless it
    becomes empty. A replay that goes on from `done` must be of a single label without thinning:
    neither the window nor the stretch is in `done`.
    """
    values = past.room.values
    overlaps = past.room.overlaps[law.channel]
    cuts = past.room.cuts
    points = past.room.points
    window = new_window(min(label, past.nearest), max(label, past.farthest), law)
    section = replayed_section(past, law.channel, LAST_REPLAY, middle_of(window))
    if done.events == 0:
        start_section(section, window.fastest * half_time(window, law), law)

    elapsed = done.elapsed
    sight = done.sight
    stretch = new_stretch(elapsed)
    for i in range(done.events, until):
        if not past.room.applies[i]:
            continue
        kind = past.log.kinds[i]
        event = AxisEvent(kind, values[law.channel, i], across_of(values, i, law), errors[i])
        is_measurement = kind in (ANGLE, RATE)
        # Measurements that have cut and enlargements (both in `cuts`), burns, and the prediction
        # after a burn.
        is_single = cuts[i] or starts_burn(kind, law) or stretch.began == IN_BURN
        is_left_out = past.thinned and not is_single
        # A rate does not change the last angle, so that this may be before its cut.
        sight = sight_after(sight, kind, event.value, event.across, True, law)
        if is_left_out and is_measurement:
            continue

        if past.thinned and not is_left_out:
            apply_stretch(section, stretch, elapsed, law, points)
        if is_measurement:
            nonempty, overlaps[i], is_cut = measure_event(
                section, label, event, elapsed, sight, window, law, points
            )
            cuts[i] |= is_cut
            if not nonempty:
                return i, done
        elif not is_left_out:
            move_section(section, kind, event.value, event.across, elapsed, law, points)
        elapsed += kind == PREDICTION
        stretch = next_stretch(stretch, event, is_left_out, window.fastest, elapsed, law)
        # Of the window of a single label only the limits are used.
        if past.thinned or window.near < window.far:
            window = window_after(window, event, elapsed, law)

    if past.thinned:
        apply_stretch(section, stretch, elapsed, law, points)
    past.room.drifts[law.channel, 0] = window.turned
    past.room.drifts[law.channel, 1] = window.loose * half_time(window, law)
    return NEVER_EMPTIED, Replayed(until, elapsed, sight)
