"""Compiled life of sections: how one section starts, is cut, shifted and predicted, and the same over a batch.

A section is the polygon of all (V, z) that agree with the history, under the hypothesis that the range is
`x = label - e t`. With z = alpha x and V = omega x - e alpha the motion (9) of the paper is z' = V, V' = v_z:
an angle measurement is a band of z, an impulse a shift of V; `chains` has the polygon for that. Each section is a
filter of its own, a function of its label and the history alone, so a section at a new label is had exactly by
replaying the history: `replay` calls the very functions that carry the stored sections.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from infoset import chains, polygon
from infoset._compile import allocation_free, entry, inlined, substituted
from infoset.chains import REACH, RIGHT

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

CUT_SLACK = 16.0 * chains.EPSILON
SUM_SLACK = 8.0 * chains.EPSILON
TIE_TOLERANCE = 1e-9
RIGHT_ANGLE = 0.5 * math.pi

ANGLE, IMPULSE, PREDICTION, RATE, WIDENING = range(5)
ALIVE = np.iinfo(np.int64).max

# Columns of a section's summary.
LOWER_MISS, UPPER_MISS, Z_LEAST, Z_GREATEST = range(4)
SUMMARY_COLUMNS = 4


class SectionLaw(NamedTuple):
    """The numbers of a set model that the kernels need, SI."""

    closing_speed: float
    step: float
    disturbance: float
    half_v: float
    half_v_at_start: float
    disturbance_lead: float
    impulse_error: float
    error_at_zero_range: float
    error_slope: float
    exact_angles: bool
    label_least: float
    label_greatest: float
    z_least: float
    z_greatest: float
    vz_least: float
    vz_greatest: float
    vx_least: float
    vx_greatest: float
    rectangle: bool


class Sections(NamedTuple):
    """B engagements x S slots of one section each.

    Parameters
    ----------
    labels : ndarray, shape (B, S)
        Range at t = 0 of each slot's hypothesis, m; the slots in use come first, in rising order.
    used : ndarray of int, shape (B,)
        Number of slots in use.
    living : ndarray of bool, shape (B, S)
    died : ndarray of int, shape (B, S)
        Event that emptied the section, or ALIVE.
    overlaps : ndarray, shape (B, S)
        Overlap of a dead section with the band that emptied it, m: negative.
    origins, rings, marks : ndarray
        The sections themselves, as `chains` has them: slot s of engagement b is row b S + s.
    summaries : ndarray, shape (B, S, columns)
    rows : ndarray of int, shape (B S,)
        Room for a list of sections.
    """

    labels: Floats
    used: Integers
    living: Flags
    died: Integers
    overlaps: Floats
    origins: Floats
    rings: Floats
    marks: Integers
    summaries: Floats
    rows: Integers


class Tape(NamedTuple):
    """The history of one engagement: what happened, the value, and whether it concerned this one.

    Parameters
    ----------
    kinds : ndarray of int, shape (>= events,)
    values : ndarray, shape (>= events,)
    applies : ndarray of bool, shape (>= events,)
    events : int
        Number of events.
    """

    kinds: Integers
    values: Floats
    applies: Flags
    events: int


def room_for_sections(labels: Floats, used: Integers) -> Sections:
    """Arrays for a batch of sections, none of them written yet."""
    shape = labels.shape
    origins, rings, marks = chains.empty_sections(labels.size, chains.ROOM_AT_START)
    return Sections(
        labels=labels,
        used=used,
        living=np.zeros(shape, dtype=bool),
        died=np.full(shape, ALIVE, dtype=np.int64),
        overlaps=np.zeros(shape),
        origins=origins,
        rings=rings,
        marks=marks,
        summaries=np.zeros((*shape, SUMMARY_COLUMNS)),
        rows=np.empty(labels.size, dtype=np.int64),
    )


@substituted
def range_of(label: float, elapsed: int, law: SectionLaw) -> float:
    """Range of a label after a number of steps."""
    return label - law.closing_speed * (law.step * elapsed)


@substituted
def time_to_go(label: float, elapsed: int, law: SectionLaw) -> float:
    """Time until the range of a label is zero, after a number of steps."""
    return range_of(label, elapsed, law) / law.closing_speed


@entry
def start_section(origins: Floats, rings: Floats, marks: Integers, n: int, label: float, law: SectionLaw) -> None:
    """Write the section at t = 0.

    Notes
    -----
    The rectangle is the paper's (section 4), with V_x taken at whichever end of D makes it larger: the printed
    formula has the lower end always, which is the same whenever z may have either sign.
    """
    x = label
    e = law.closing_speed
    z_least, z_greatest = law.z_least, law.z_greatest
    shift_at_least = shift_at_greatest = 0.0
    lowest, highest = law.vz_least, law.vz_greatest
    if law.rectangle:
        lowest -= max(law.vx_least * z_least, law.vx_greatest * z_least) / x
        highest -= min(law.vx_least * z_greatest, law.vx_greatest * z_greatest) / x
        shift_at_least, shift_at_greatest = -e * math.atan(z_least / x), -e * math.atan(z_greatest / x)
        z_least, z_greatest = math.atan(z_least / x) * x, math.atan(z_greatest / x) * x
    tau = time_to_go(label, 0, law)
    chains.start(
        origins,
        rings,
        marks,
        n,
        tau,
        (lowest + shift_at_least, highest + shift_at_least, z_least),
        (lowest + shift_at_greatest, highest + shift_at_greatest, z_greatest),
    )
    if law.half_v_at_start > 0.0:
        chains.spread(origins, n, tau, law.half_v_at_start)


@inlined
def measure_section(
    origins: Floats, rings: Floats, marks: Integers, n: int, label: float, elapsed: int, alpha: float, law: SectionLaw
) -> tuple[bool, float]:
    """Cut a section by an angle measurement.

    Returns
    -------
    living : bool
    overlap : float
        Least overlap of the section and the band across either border, m: negative is the distance of a dead one.

    Notes
    -----
    The band is widened by 16 ulp: against extremal noise the truth sits on the border, and rounding must not lose it.
    The ulp is that of what is subtracted to find a height, so it does not shrink with the range.
    """
    x = range_of(label, elapsed, law)
    bound = law.error_at_zero_range + law.error_slope * x
    lower, upper = alpha - bound, alpha + bound
    if law.exact_angles and law.error_slope > 0.0:
        # x h(x) is convex then. What is claimed over all labels needs it concave: a chord and a tangent lie above it.
        travelled = label - x
        near, far = max(law.label_least - travelled, 0.0), law.label_greatest - travelled
        steepest = abs(alpha) + law.error_at_zero_range + law.error_slope * far
        half = law.error_at_zero_range + law.error_slope * (near + far - near * far / x)
        half = half / math.cos(steepest) ** 2 if steepest < RIGHT_ANGLE else np.inf
        lower, upper = math.tan(alpha) - half, math.tan(alpha) + half
    elif law.exact_angles:
        lower = math.tan(lower) if lower > -RIGHT_ANGLE else -np.inf
        upper = math.tan(upper) if upper < RIGHT_ANGLE else np.inf
    slack = CUT_SLACK * (label * (abs(alpha) + bound) + origins[n, RIGHT, REACH] * (label / law.closing_speed))
    return chains.cut(origins, rings, marks, n, x / law.closing_speed, x * lower - slack, x * upper + slack)


@allocation_free
def measure_rate_section(
    origins: Floats,
    rings: Floats,
    marks: Integers,
    n: int,
    label: float,
    elapsed: int,
    omega: float,
    error: float,
    law: SectionLaw,
    points: Floats,
) -> tuple[bool, float]:
    """Cut a section by a measurement of the line of sight's rate: a band of the predicted miss, omega x^2 / e.

    Notes
    -----
    What is measured is (V_z x - V_x z)/(x^2 + z^2), less than the model's V/x + e z/x^2 by the square of cos(alpha).
    """
    if chains.is_crowded(marks, n):
        chains.reduce_outward(origins, rings, marks, n, time_to_go(label, elapsed, law), points)
    x = range_of(label, elapsed, law)
    tau = x / law.closing_speed
    lower, upper = omega - error, omega + error
    if law.exact_angles:
        least, greatest = chains.heights(origins, rings, marks, n, tau)
        widest = 1.0 + (max(abs(least), abs(greatest)) / x) ** 2
        lower *= widest if lower < 0.0 else 1.0
        upper *= widest if upper > 0.0 else 1.0
    slack = CUT_SLACK * (label * (abs(omega) + error) + origins[n, RIGHT, REACH]) * (label / law.closing_speed)
    return chains.cut_misses(origins, rings, marks, n, tau, tau * x * lower - slack, tau * x * upper + slack, points)


@inlined
def widen_section(origins: Floats, n: int, label: float, elapsed: int, law: SectionLaw) -> None:
    """Widen a section by what one angle measurement may err, b: by e b in V, which is x b in the predicted miss."""
    x = range_of(label, elapsed, law)
    bound = law.error_at_zero_range + law.error_slope * x
    chains.spread(origins, n, x / law.closing_speed, law.closing_speed * bound)


@substituted
def shift_section(origins: Floats, n: int, label: float, elapsed: int, impulse: float, law: SectionLaw) -> None:
    """Shift a section by an impulse: V becomes V - k, for every k that the commanded one may have been."""
    tau = time_to_go(label, elapsed, law)
    chains.shift(origins, n, tau, -impulse)
    if law.impulse_error > 0.0:
        chains.spread(origins, n, tau, abs(impulse) * law.impulse_error)


@inlined
def predict_section(
    origins: Floats, rings: Floats, marks: Integers, n: int, label: float, elapsed: int, law: SectionLaw
) -> None:
    """Move a section on to step `elapsed`: time to go falls, and the disturbance adds its segment, 8 ulp longer."""
    tau = time_to_go(label, elapsed, law)
    chains.turn(origins, rings, marks, n, tau + law.disturbance_lead)
    chains.spread(origins, n, tau + law.disturbance_lead, law.half_v + SUM_SLACK * origins[n, RIGHT, REACH])
    chains.turn(origins, rings, marks, n, tau)


@inlined
def summarise_section(
    origins: Floats,
    rings: Floats,
    marks: Integers,
    n: int,
    label: float,
    elapsed: int,
    law: SectionLaw,
    summaries: Floats,
    b: int,
    s: int,
) -> None:
    """Write the extremes of the predicted miss (13), (14) of a section: those of z + V x/e -+ nu/2 (x/e)^2."""
    tau = time_to_go(label, elapsed, law)
    upper, lower = chains.greatest_and_least_miss(origins, rings, marks, n)
    drift = 0.5 * law.disturbance * tau * tau
    summaries[b, s, UPPER_MISS] = upper + drift
    summaries[b, s, LOWER_MISS] = lower - drift


@entry
def start_all(sections: Sections, law: SectionLaw) -> None:
    """Write the initial sections of a batch; they are not summarised yet."""
    labels, used, living, _, _, origins, rings, marks, _, _ = sections
    for b in range(labels.shape[0]):
        for s in range(used[b]):
            n = b * labels.shape[1] + s
            start_section(origins, rings, marks, n, labels[b, s], law)
            living[b, s] = True


@allocation_free
def list_rows(some: Flags, others: Flags, everyone: bool, sections: Sections) -> int:
    """List the living sections of the engagements that are among some or others, or of everyone; return how many."""
    _, used, living, _, _, _, _, _, _, rows = sections
    count = 0
    for b in range(living.shape[0]):
        if some[b] or others[b] or everyone:
            for s in range(used[b]):
                if living[b, s]:
                    rows[count] = b * living.shape[1] + s
                    count += 1
    return count


@entry
def measure_all(
    behind: Flags, active: Flags, alpha: Floats, elapsed: int, event: int, sections: Sections, law: SectionLaw
) -> int:
    """Cut every living section of the active engagements by their angle measurements, and summarise it.

    Sections that are a step behind are moved on first, in the same pass. Returned is how many died.
    """
    deaths = 0
    labels, _, living, died, overlaps, origins, rings, marks, summaries, rows = sections
    count = list_rows(behind, active, False, sections)
    for k in range(count):
        n = rows[k]
        b, s = divmod(n, labels.shape[1])
        if k + 1 < count:
            chains.expect(rings, marks, rows[k + 1])
        if behind[b]:
            predict_section(origins, rings, marks, n, labels[b, s], elapsed, law)
        if not active[b]:
            continue
        living[b, s], overlap = measure_section(origins, rings, marks, n, labels[b, s], elapsed, alpha[b], law)
        if living[b, s]:
            summarise_section(origins, rings, marks, n, labels[b, s], elapsed, law, summaries, b, s)
        else:
            died[b, s] = event
            overlaps[b, s] = overlap
            deaths += 1
    return deaths


@entry
def measure_rate_all(
    active: Flags,
    omega: Floats,
    error: float,
    elapsed: int,
    event: int,
    sections: Sections,
    law: SectionLaw,
    points: Floats,
) -> int:
    """Cut every living section of the active engagements by measured rates, and summarise it; return how many died."""
    deaths = 0
    labels, used, living, died, overlaps, origins, rings, marks, summaries, _ = sections
    for b in range(labels.shape[0]):
        if not active[b]:
            continue
        for s in range(used[b]):
            if not living[b, s]:
                continue
            n = b * labels.shape[1] + s
            living[b, s], overlap = measure_rate_section(
                origins, rings, marks, n, labels[b, s], elapsed, omega[b], error, law, points
            )
            if living[b, s]:
                summarise_section(origins, rings, marks, n, labels[b, s], elapsed, law, summaries, b, s)
            else:
                died[b, s] = event
                overlaps[b, s] = overlap
                deaths += 1
    return deaths


@entry
def shift_all(active: Flags, impulse: Floats, elapsed: int, sections: Sections, law: SectionLaw) -> None:
    """Shift every living section, and its summary, by its engagement's impulse."""
    labels, used, living, _, _, origins, _, _, summaries, _ = sections
    for b in range(labels.shape[0]):
        if not active[b] or impulse[b] == 0.0:
            continue
        for s in range(used[b]):
            if not living[b, s]:
                continue
            shift_section(origins, b * labels.shape[1] + s, labels[b, s], elapsed, impulse[b], law)
            tau, error = time_to_go(labels[b, s], elapsed, law), abs(impulse[b]) * law.impulse_error
            summaries[b, s, UPPER_MISS] += (error - impulse[b]) * tau
            summaries[b, s, LOWER_MISS] -= (error + impulse[b]) * tau


@entry
def catch_up_all(
    behind: Flags, stale: Flags, heights_wanted: bool, elapsed: int, sections: Sections, law: SectionLaw
) -> None:
    """Move the sections that are a step behind on to step `elapsed`, and summarise those whose summary is stale.

    Where it is wanted, the summary has the least and the greatest z too.
    """
    labels, _, _, _, _, origins, rings, marks, summaries, rows = sections
    count = list_rows(behind, stale, heights_wanted, sections)
    for k in range(count):
        n = rows[k]
        b, s = divmod(n, labels.shape[1])
        if k + 1 < count:
            chains.expect(rings, marks, rows[k + 1])
        if behind[b]:
            predict_section(origins, rings, marks, n, labels[b, s], elapsed, law)
        if stale[b]:
            summarise_section(origins, rings, marks, n, labels[b, s], elapsed, law, summaries, b, s)
        if heights_wanted:
            tau = time_to_go(labels[b, s], elapsed, law)
            least, greatest = chains.heights(origins, rings, marks, n, tau)
            summaries[b, s, Z_LEAST] = least
            summaries[b, s, Z_GREATEST] = greatest


@entry
def room_wanted(active: Flags, added: int, sections: Sections) -> tuple[int, int]:
    """Say what room the living sections of the active engagements have.

    Returns
    -------
    floats : int
        Floats that the rings lack before any section may gain so many vertices.
    spare : int
        Vertices that every section may gain; negative where one must be reduced first.
    """
    labels, used, living, _, _, _, _, marks, _, _ = sections
    floats = 0
    spare = chains.CAPACITY
    for b in range(labels.shape[0]):
        if not active[b]:
            continue
        for s in range(used[b]):
            if living[b, s]:
                n = b * labels.shape[1] + s
                count, room = chains.count_of(marks, n), chains.room_of(marks, n)
                spare = min(spare, room - count)
                if min(count + added, chains.CAPACITY) > room:
                    floats += 2 * chains.floats_of(chains.room_for(count + added, room))
    return floats, spare


@entry
def make_room_all(active: Flags, added: int, elapsed: int, sections: Sections, law: SectionLaw, points: Floats) -> None:
    """See that the living sections of the active engagements may gain so many vertices: give them wider rings.

    Those that have all that a section may have are reduced, outward.
    """
    labels, used, living, _, _, origins, rings, marks, _, _ = sections
    for b in range(labels.shape[0]):
        if not active[b]:
            continue
        for s in range(used[b]):
            n = b * labels.shape[1] + s
            if not living[b, s]:
                continue
            if chains.is_crowded(marks, n):
                chains.reduce_outward(origins, rings, marks, n, time_to_go(labels[b, s], elapsed, law), points)
            vertices = min(chains.count_of(marks, n) + added, chains.CAPACITY)
            wanted = chains.room_for(vertices, chains.room_of(marks, n))
            if wanted > chains.room_of(marks, n):
                chains.widen_rings(rings, marks, n, wanted)


@entry
def keep_labels_all(active: Flags, least: Floats, greatest: Floats, sections: Sections, removed: Flags) -> int:
    """Remove the living sections whose labels are outside [least, greatest]; write which, and return how many."""
    labels, used, living, _, _, _, _, _, _, _ = sections
    count = 0
    for b in range(labels.shape[0]):
        if not active[b]:
            continue
        for s in range(used[b]):
            if living[b, s] and not least[b] <= labels[b, s] <= greatest[b]:
                living[b, s] = False
                removed[b, s] = True
                count += 1
    return count


@entry
def widest_all(elapsed: int, sections: Sections, law: SectionLaw, exists: Flags, ends: Floats) -> None:
    """Write the predicted-miss interval of each engagement, over its living sections.

    Parameters
    ----------
    elapsed : int
        Steps so far.
    sections : Sections
    law : SectionLaw
    exists : ndarray of bool, shape (B,)
        Whether any section lives.
    ends : ndarray, shape (B, 2, 4)
        For the lower and the upper end: predicted miss, and alpha, omega and range where it is reached; left as they
        are where no section lives.

    Notes
    -----
    An extreme is usually a whole edge; the point is its lowest for the upper extreme and its highest for the lower
    one, so that a mirrored engagement is mirrored exactly.
    """
    labels, used, living, _, _, origins, rings, marks, summaries, _ = sections
    for b in range(labels.shape[0]):
        lowest = highest = -1
        for s in range(used[b]):
            if not living[b, s]:
                continue
            if lowest < 0 or summaries[b, s, LOWER_MISS] < summaries[b, lowest, LOWER_MISS]:
                lowest = s
            if highest < 0 or summaries[b, s, UPPER_MISS] > summaries[b, highest, UPPER_MISS]:
                highest = s
        if lowest < 0:
            continue
        exists[b] = True
        for end, s in ((0, lowest), (1, highest)):
            tau, x = time_to_go(labels[b, s], elapsed, law), range_of(labels[b, s], elapsed, law)
            n = b * labels.shape[1] + s
            points = chains.extreme_points(origins, rings, marks, n, tau, TIE_TOLERANCE, CUT_SLACK)
            v, m = points[1 - end]
            alpha = (m - tau * v) / x
            ends[b, end, 0] = summaries[b, s, LOWER_MISS + end]
            ends[b, end, 1] = alpha
            ends[b, end, 2] = (v + law.closing_speed * alpha) / x
            ends[b, end, 3] = x


@entry
def margins_all(v: Floats, z: Floats, elapsed: int, sections: Sections, law: SectionLaw, margins: Floats) -> None:
    """Write the signed margin of a state (V, z) in the first section of each engagement, m; -inf where it is dead."""
    labels, _, living, _, _, origins, rings, marks, _, _ = sections
    for b in range(v.shape[0]):
        margins[b] = -np.inf
        if living[b, 0]:
            tau = time_to_go(labels[b, 0], elapsed, law)
            margins[b] = margin_in(origins, rings, marks, b * labels.shape[1], tau, v[b], z[b])


@allocation_free
def margin_in(origins: Floats, rings: Floats, marks: Integers, n: int, tau: float, v: float, z: float) -> float:
    """Signed margin of a state (V, z), m: distances are taken with V counted as V x/e, the miss that it is worth."""
    nearest, inside = np.inf, False
    last = chains.scaled_vertex(origins, rings, marks, n, chains.LEFT, chains.end_of(marks, n, chains.LEFT) - 1, tau)
    for side in (chains.RIGHT, chains.LEFT):
        for i in range(chains.begin_of(marks, n, side), chains.end_of(marks, n, side)):
            vertex = chains.scaled_vertex(origins, rings, marks, n, side, i, tau)
            nearest, inside = polygon.pass_edge(nearest, inside, last, vertex, v * tau, z)
            last = vertex
    return math.sqrt(nearest) if inside else -math.sqrt(nearest)


@entry
def replay(
    label: float,
    tape: Tape,
    errors: Floats | None,
    law: SectionLaw,
    origins: Floats,
    rings: Floats,
    marks: Integers,
    n: int,
    overlaps: Floats,
    points: Floats,
) -> int:
    """Carry the section at any label through a whole history.

    Parameters
    ----------
    label : float
        Range at t = 0 of the hypothesis, m.
    tape : Tape
        The history.
    errors : ndarray, shape (>= events,), or None
        Error bound of each rate; None where there is none. It stands apart, since only an argument that is None lets
        the compiler leave out the code for rates.
    law : SectionLaw
        The numbers of the model.
    origins, rings, marks, n : section
        Where it goes.
    overlaps : ndarray, shape (>= events,)
        Receives the overlap with the band of each angle measurement that the section lived to see.
    points : ndarray, shape (CAPACITY, 2)
        Room to work in.

    Returns
    -------
    int
        The event that killed it, or ALIVE.

    Notes
    -----
    Some 30 ns an event.
    """
    kinds, values, applies, events = tape
    start_section(origins, rings, marks, n, label, law)
    elapsed = 0
    for event in range(events):
        if kinds[event] == PREDICTION:
            if chains.is_crowded(marks, n):
                chains.reduce_outward(origins, rings, marks, n, time_to_go(label, elapsed, law), points)
            elapsed += 1
            predict_section(origins, rings, marks, n, label, elapsed, law)
        elif not applies[event]:
            continue
        elif kinds[event] == ANGLE:
            living, overlaps[event] = measure_section(origins, rings, marks, n, label, elapsed, values[event], law)
            if not living:
                return event
        elif kinds[event] == IMPULSE:
            shift_section(origins, n, label, elapsed, values[event], law)
        elif kinds[event] == WIDENING:
            widen_section(origins, n, label, elapsed, law)
        elif errors is not None:
            # Compiled only for a history that has rates: this branch would be the greater part of the work.
            living, overlaps[event] = measure_rate_section(
                origins, rings, marks, n, label, elapsed, values[event], errors[event], law, points
            )
            if not living:
                return event
    return ALIVE
