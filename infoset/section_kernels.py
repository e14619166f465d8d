"""Compiled life of sections: how one section starts, is cut, shifted and predicted, and the same over a batch.

A section is the polygon of all (V, z) that agree with the history, under the hypothesis that the range is
`x = label - e t`. With z = alpha x and V = omega x - e alpha the motion (9) of the paper is z' = V, V' = v_z:
prediction is a shear, an impulse a shift of V, an angle measurement a horizontal band of z. Each section is a filter
of its own, a function of its label and the history alone, so a section at a new label is had exactly by replaying
the history: `replay` calls the very functions that carry the stored sections.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from infoset import polygon
from infoset._compile import compiled

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

EPSILON = float(np.finfo(np.float64).eps)
CUT_SLACK = 16.0 * EPSILON
SUM_SLACK = 8.0 * EPSILON
TIE_TOLERANCE = 1e-9

VERTEX_CAP = 256
VERTEX_CAPACITY = VERTEX_CAP + 4

ANGLE, IMPULSE, PREDICTION = 0, 1, 2
ALIVE = np.iinfo(np.int64).max

# Columns of a section's summary.
Z_LEAST, Z_GREATEST, UPPER_MISS, UPPER_V, UPPER_Z, LOWER_MISS, LOWER_V, LOWER_Z = range(8)
SUMMARY_COLUMNS = 8


class SectionLaw(NamedTuple):
    """The numbers of a set model that the kernels need, SI."""

    closing_speed: float
    step: float
    disturbance: float
    half_v: float
    disturbance_slope: float
    error_at_zero_range: float
    error_slope: float
    z_least: float
    z_greatest: float
    vz_least: float
    vz_greatest: float
    vx_least: float
    vx_greatest: float
    rectangle: bool


@compiled
def range_of(label: float, elapsed: int, law: SectionLaw) -> float:
    """Range of a label after a number of steps."""
    return label - law.closing_speed * (law.step * elapsed)


@compiled
def initial_section(label: float, law: SectionLaw, points: Floats) -> int:
    """Write the section at t = 0; return its number of vertices.

    Notes
    -----
    The rectangle is the paper's (section 4), with V_x taken at whichever end of D makes it larger: the printed
    formula has the lower end always, which is the same whenever z may have either sign.
    """
    if not law.rectangle:
        made = polygon.append(points, 0, law.vz_least, law.z_least)
        made = polygon.append(points, made, law.vz_greatest, law.z_least)
        made = polygon.append(points, made, law.vz_greatest, law.z_greatest)
        made = polygon.append(points, made, law.vz_least, law.z_greatest)
        return polygon.close(points, made)
    x = label
    e = law.closing_speed
    lowest = min(law.vz_least * x - law.vx_least * law.z_least, law.vz_least * x - law.vx_greatest * law.z_least)
    highest = max(
        law.vz_greatest * x - law.vx_least * law.z_greatest, law.vz_greatest * x - law.vx_greatest * law.z_greatest
    )
    alpha_least = math.atan(law.z_least / x)
    alpha_greatest = math.atan(law.z_greatest / x)
    made = polygon.append(points, 0, lowest / x - e * alpha_least, alpha_least * x)
    made = polygon.append(points, made, highest / x - e * alpha_least, alpha_least * x)
    made = polygon.append(points, made, highest / x - e * alpha_greatest, alpha_greatest * x)
    made = polygon.append(points, made, lowest / x - e * alpha_greatest, alpha_greatest * x)
    return polygon.close(points, made)


@compiled
def measure_section(points: Floats, count: int, x: float, alpha: float, law: SectionLaw) -> tuple[int, float]:
    """Cut a section, in place, by an angle measurement.

    Returns
    -------
    count : int
        Vertices left; 0 if the section died.
    overlap : float
        Least overlap of the section and the band across either border, m: negative is the distance of a dead one.

    Notes
    -----
    The band is widened by 16 ulp: against extremal noise the truth sits on the border, and rounding must not lose it.
    """
    bound = law.error_at_zero_range + law.error_slope * x
    lower = x * (alpha - bound)
    upper = x * (alpha + bound)
    slack = CUT_SLACK * max(abs(lower), abs(upper))
    count, overlap = polygon.clip_to_band(points, count, 0.0, 1.0, lower - slack, upper + slack)
    if count > VERTEX_CAP:
        count = polygon.reduce_outward(points, count, VERTEX_CAP)
    return count, overlap


@compiled
def predict_section(points: Floats, count: int, law: SectionLaw) -> int:
    """Move a section one step on, in place: shear, then add the disturbance's segment, 8 ulp longer outward."""
    count = polygon.shear_and_add_segment(points, count, law.step, 1.0, law.disturbance_slope, law.half_v, SUM_SLACK)
    if count > VERTEX_CAP:
        count = polygon.reduce_outward(points, count, VERTEX_CAP)
    return count


@compiled
def summarise_section(points: Floats, count: int, x: float, law: SectionLaw, summary: Floats) -> None:
    """Write the extent in z and the extremes of the predicted miss (13), (14) with the points that reach them.

    Notes
    -----
    The predicted miss is z + V x/e -+ nu/2 (x/e)^2. An extreme is usually a whole edge; the point is its lowest
    for the upper extreme and its highest for the lower one, so that a mirrored engagement is mirrored exactly.
    """
    time_to_go = x / law.closing_speed
    z_least = lower = np.inf
    z_greatest = upper = -np.inf
    upper_at = lower_at = 0
    for i in range(count):
        z = points[i, 1]
        miss = z + points[i, 0] * time_to_go
        z_least = min(z_least, z)
        z_greatest = max(z_greatest, z)
        if miss > upper:
            upper = miss
            upper_at = i
        if miss < lower:
            lower = miss
            lower_at = i
    magnitude = abs(points[upper_at, 1]) + abs(points[lower_at, 1]) + (upper - lower)
    tolerance = TIE_TOLERANCE * (upper - lower) + CUT_SLACK * magnitude
    upper_at = extreme_along_edge(points, count, upper_at, time_to_go, upper - tolerance, 1.0)
    lower_at = extreme_along_edge(points, count, lower_at, time_to_go, lower + tolerance, -1.0)
    drift = 0.5 * law.disturbance * time_to_go * time_to_go
    summary[Z_LEAST] = z_least
    summary[Z_GREATEST] = z_greatest
    summary[UPPER_MISS] = upper + drift
    summary[UPPER_V] = points[upper_at, 0]
    summary[UPPER_Z] = points[upper_at, 1]
    summary[LOWER_MISS] = lower - drift
    summary[LOWER_V] = points[lower_at, 0]
    summary[LOWER_Z] = points[lower_at, 1]


@compiled
def extreme_along_edge(points: Floats, count: int, start: int, time_to_go: float, level: float, sign: float) -> int:
    """Index of the lowest (sign 1) vertex with a miss at least `level`, or highest (sign -1) with one at most."""
    best = start
    for direction in (1, -1):
        i = start
        for _ in range(count - 1):
            i += direction
            if i == count:
                i = 0
            elif i < 0:
                i = count - 1
            if sign * (points[i, 1] + points[i, 0] * time_to_go - level) < 0.0:
                break
            if sign * (points[i, 1] - points[best, 1]) < 0.0:
                best = i
    return best


@compiled
def start_all(labels: Floats, used: Integers, law: SectionLaw, vertices: Floats, counts: Integers) -> None:
    """Write the initial sections of a batch."""
    for b in range(labels.shape[0]):
        for s in range(used[b]):
            counts[b, s] = initial_section(labels[b, s], law, vertices[b, s])


@compiled
def measure_all(
    active: Flags,
    alpha: Floats,
    elapsed: int,
    event: int,
    labels: Floats,
    used: Integers,
    law: SectionLaw,
    vertices: Floats,
    counts: Integers,
    died: Integers,
    overlaps: Floats,
    summaries: Floats,
) -> None:
    """Cut every living section of the active engagements by their angle measurements, and summarise it."""
    for b in range(labels.shape[0]):
        if not active[b]:
            continue
        for s in range(used[b]):
            if counts[b, s] == 0:
                continue
            x = range_of(labels[b, s], elapsed, law)
            points = vertices[b, s]
            counts[b, s], overlap = measure_section(points, counts[b, s], x, alpha[b], law)
            if counts[b, s] == 0:
                died[b, s] = event
                overlaps[b, s] = overlap
            else:
                summarise_section(points, counts[b, s], x, law, summaries[b, s])


@compiled
def shift_all(
    active: Flags,
    impulse: Floats,
    elapsed: int,
    labels: Floats,
    used: Integers,
    law: SectionLaw,
    vertices: Floats,
    counts: Integers,
    summaries: Floats,
) -> None:
    """Shift every living section, and its summary, by its engagement's impulse: V becomes V - k."""
    for b in range(counts.shape[0]):
        if not active[b] or impulse[b] == 0.0:
            continue
        for s in range(used[b]):
            if counts[b, s] == 0:
                continue
            polygon.translate(vertices[b, s], counts[b, s], -impulse[b], 0.0)
            summary = summaries[b, s]
            summary[UPPER_V] -= impulse[b]
            summary[LOWER_V] -= impulse[b]
            miss = impulse[b] * range_of(labels[b, s], elapsed, law) / law.closing_speed
            summary[UPPER_MISS] -= miss
            summary[LOWER_MISS] -= miss


@compiled
def predict_all(active: Flags, used: Integers, law: SectionLaw, vertices: Floats, counts: Integers) -> None:
    """Move every living section of the active engagements one step on; the summaries stay those of before."""
    for b in range(counts.shape[0]):
        if not active[b]:
            continue
        for s in range(used[b]):
            if counts[b, s] > 0:
                counts[b, s] = predict_section(vertices[b, s], counts[b, s], law)


@compiled
def summarise_all(
    active: Flags,
    elapsed: int,
    labels: Floats,
    used: Integers,
    law: SectionLaw,
    vertices: Floats,
    counts: Integers,
    summaries: Floats,
) -> None:
    """Summarise every living section of the active engagements."""
    for b in range(labels.shape[0]):
        if not active[b]:
            continue
        for s in range(used[b]):
            if counts[b, s] > 0:
                x = range_of(labels[b, s], elapsed, law)
                summarise_section(vertices[b, s], counts[b, s], x, law, summaries[b, s])


@compiled
def margins_all(
    v: Floats, z: Floats, elapsed: int, labels: Floats, law: SectionLaw, vertices: Floats, counts: Integers
) -> Floats:
    """Signed margin of a state (V, z) in the first section of each engagement, m.

    Notes
    -----
    Distances are taken with V counted as V x/e, the metres of miss that it is worth.
    """
    result = np.empty(v.shape[0])
    scaled = np.empty((VERTEX_CAPACITY, 2))
    for b in range(v.shape[0]):
        time_to_go = range_of(labels[b, 0], elapsed, law) / law.closing_speed
        for i in range(counts[b, 0]):
            scaled[i, 0] = vertices[b, 0, i, 0] * time_to_go
            scaled[i, 1] = vertices[b, 0, i, 1]
        result[b] = polygon.margin(scaled, counts[b, 0], v[b] * time_to_go, z[b])
    return result


@compiled
def replay(
    label: float,
    kinds: Integers,
    values: Floats,
    applies: Flags,
    events: int,
    law: SectionLaw,
    points: Floats,
    overlaps: Floats,
) -> tuple[int, int]:
    """Carry the section at any label through a whole history.

    Parameters
    ----------
    label : float
        Range at t = 0 of the hypothesis, m.
    kinds, values, applies : ndarray, shape (>= events,)
        The history of one engagement: what happened, its value, and whether it concerned this engagement.
    events : int
        Number of events.
    law : SectionLaw
        The numbers of the model.
    points : ndarray
        Where the section goes.
    overlaps : ndarray, shape (>= events,)
        Receives the overlap with the band of each angle measurement that the section lived to see.

    Returns
    -------
    count, died : int
        Vertices (0 if dead) and the event that killed it, or ALIVE.

    Notes
    -----
    About 0.1 to 0.3 us an event.
    """
    count = initial_section(label, law, points)
    elapsed = 0
    for event in range(events):
        if kinds[event] == PREDICTION:
            elapsed += 1
            count = predict_section(points, count, law)
        elif not applies[event]:
            continue
        elif kinds[event] == ANGLE:
            x = range_of(label, elapsed, law)
            count, overlaps[event] = measure_section(points, count, x, values[event], law)
            if count == 0:
                return 0, event
        else:
            polygon.translate(points, count, -values[event], 0.0)
    return count, ALIVE
