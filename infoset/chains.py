"""Compiled operations on sections: convex polygons that turn as time passes, kept as two chains of vertices.

A section is handled in the coordinates (V, m), m = z + V tau, with tau the time to go: m is the predicted miss, free
motion leaves it alone, and z = m - tau V. What happens to a section then happens along one line of sight only,
the one that tells heights z: a cut takes away what is highest or lowest, a disturbance pulls the two sides apart
along the level. So the boundary is kept as a RIGHT chain from its lowest vertex to its highest and a LEFT chain
from its highest to its lowest:

* a disturbance moves each chain as a whole, an impulse both: their origins move, no vertex does;
* a cut drops vertices from the ends of the chains and puts the crossing in their place;
* as tau falls the level turns, always the same way, and the last vertices of each chain go over to the other;
* the greatest predicted miss is at the peak of the right chain, the least at that of the left one: both stay where
  they are until a cut takes them away.

A vertex enters, changes chains a time or two, and leaves: the cost of a step does not depend on their number.

Both chains are the same thing turned by 180 degrees: their vertices rise from the front to the back, seen
from the chain's own side (`SIDE`). Each is a ring buffer; the ends of a chain are joined to those of the other by
edges along the level, of no length where the two meet.

A batch of sections is three arrays, `origins`, `rings` and `marks`; a kernel takes them and a row `n`. (Views of rows,
or a tuple of arrays, cost more than the work: each is counted, atomically, wherever it is handed on.) A ring is as wide
as its section needs, not as the widest of the batch does: what a step touches lies close together.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from infoset import polygon
from infoset._compile import allocation_free, entry, inlined, prefetch, substituted

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

EPSILON = float(np.finfo(np.float64).eps)

RIGHT, LEFT = 0, 1

CAPACITY = 256
"""Vertices a section may have: a power of two."""
ROOM_AT_START = 64
"""Vertices each chain has room for at first, a power of two."""
MOST_ADDED = 4
"""Vertices that one step can add, two at each of its two turns."""
ROOM_AHEAD = 8 * MOST_ADDED
"""Vertices that a section is given room for beyond those it has."""
REDUCED = 160
"""Vertices left in a section that has grown to CAPACITY."""

# The marks, for each chain: the number of its first vertex, one past the last, and that of the peak; then where its
# ring is, and the ring's room less one, a power of two less one. Numbers only grow or fall: the ring holds a vertex at
# its number modulo its room.
BEGIN, END, PEAK, RING, MASK = range(5)
MARKS = 5

# An origin moves at every step and must not wear, so it is a sum of two floats. The right chain's holds a bound on |V|
# too, over all that the section ever was: rounding is relative to it. The rest makes it a line of the cache.
V_ORIGIN, V_REST, M_ORIGIN, M_REST, REACH = range(5)
ORIGIN = 8

TAKEN = 0
"""Where the rings say how many of their floats belong to chains; rings that were outgrown stay taken."""
FIRST_RING = 8
LINE = 8
"""Floats in a line of the cache."""


class Chains(NamedTuple):
    """The chains of N sections.

    Parameters
    ----------
    origins : ndarray, shape (N, 2, ORIGIN)
    rings : ndarray, shape (any,)
        The vertices of all chains, each (V, m) from the origin of its chain.
    marks : ndarray of int, shape (N, 2, MARKS)
    """

    origins: Floats
    rings: Floats
    marks: Integers


def empty_sections(number: int, room: int = CAPACITY) -> Chains:
    """Sections not begun yet, with room for so many vertices (a power of two) in each chain.

    The rings have what all may ever need: what is not written takes no memory.
    """
    marks = np.zeros((number, 2, MARKS), dtype=np.int64)
    marks[:, :, RING] = FIRST_RING + (2 * room + LINE) * np.arange(2 * number).reshape(number, 2)
    marks[:, :, MASK] = room - 1
    rings = np.empty(FIRST_RING + 8 * CAPACITY * number)
    rings[TAKEN] = FIRST_RING + 2 * (2 * room + LINE) * number
    return Chains(np.zeros((number, 2, ORIGIN)), rings, marks)


def with_room(rings: Floats, floats: int) -> Floats:
    """The same rings with room for so many floats more; themselves if they have it."""
    taken = int(rings[TAKEN])
    if taken + floats <= rings.size:
        return rings
    return copy_of_rings(rings, max(taken + floats, 2 * rings.size))


def copy_of_rings(rings: Floats, size: int) -> Floats:
    """The same rings in other memory, of so many floats."""
    taken = int(rings[TAKEN])
    copy = np.empty(size)
    copy[:taken] = rings[:taken]
    return copy


def working_room() -> Floats:
    """Room that some operations need to work in."""
    return np.empty((CAPACITY + 2, 2))


@substituted
def place(marks: Integers, n: int, side: int, i: int) -> int:
    """Where the rings have a vertex of a chain."""
    return int(marks[n, side, RING] + 2 * (i & marks[n, side, MASK]))


@substituted
def begin_of(marks: Integers, n: int, side: int) -> int:
    """Number of the first vertex of a chain."""
    return int(marks[n, side, BEGIN])


@substituted
def end_of(marks: Integers, n: int, side: int) -> int:
    """One past the number of the last vertex of a chain."""
    return int(marks[n, side, END])


@substituted
def count_of(marks: Integers, n: int) -> int:
    """Number of vertices of both chains."""
    right, left = marks[n, RIGHT, END] - marks[n, RIGHT, BEGIN], marks[n, LEFT, END] - marks[n, LEFT, BEGIN]
    return int(right + left)


@inlined
def expect(rings: Floats, marks: Integers, n: int) -> None:
    """Ask for the vertices of a section that a step reads: it comes next, and memory is slow."""
    for side in (RIGHT, LEFT):
        prefetch(rings, place(marks, n, side, begin_of(marks, n, side)))
        prefetch(rings, place(marks, n, side, end_of(marks, n, side) - 1))
        prefetch(rings, place(marks, n, side, marks[n, side, PEAK]))


@substituted
def room_of(marks: Integers, n: int) -> int:
    """Vertices that either chain of a section has room for."""
    return int(marks[n, RIGHT, MASK] + 1)


@allocation_free
def widen_rings(rings: Floats, marks: Integers, n: int, room: int) -> None:
    """Give both chains of a section rings of so much room, a power of two, from what is not taken."""
    for side in (RIGHT, LEFT):
        first = int(rings[TAKEN])
        rings[TAKEN] = first + floats_of(room)
        for i in range(begin_of(marks, n, side), end_of(marks, n, side)):
            old, new = place(marks, n, side, i), first + 2 * (i & (room - 1))
            rings[new] = rings[old]
            rings[new + 1] = rings[old + 1]
        marks[n, side, RING] = first
        marks[n, side, MASK] = room - 1


@substituted
def floats_of(room: int) -> int:
    """Floats that a ring takes: a line more than its vertices, lest all rings begin in the same lines of a cache."""
    return 2 * room + LINE


@inlined
def room_for(vertices: int, room: int) -> int:
    """Room that a chain needs for so many vertices, at least what it has: a power of two."""
    while room < vertices:
        room *= 2
    return room


@substituted
def sign_of(side: int) -> float:
    """The side from which a chain is seen to rise: 1 for the right one, -1 for the left one."""
    return 1.0 - 2.0 * side


@inlined
def rise(rings: Floats, marks: Integers, n: int, side: int, i: int, tau: float) -> float:
    """Height of a vertex over the origin of its chain, seen from the chain's own side: it rises along the chain."""
    at = place(marks, n, side, i)
    return float(sign_of(side) * (rings[at + 1] - tau * rings[at]))


@inlined
def origin_height(origins: Floats, n: int, side: int, tau: float) -> float:
    """Height of the origin of a chain."""
    whole = origins[n, side, M_ORIGIN] - tau * origins[n, side, V_ORIGIN]
    return float(whole + (origins[n, side, M_REST] - tau * origins[n, side, V_REST]))


@inlined
def vertex(origins: Floats, rings: Floats, marks: Integers, n: int, side: int, i: int) -> tuple[float, float]:
    """A vertex: V and m."""
    at = place(marks, n, side, i)
    v = (rings[at] + origins[n, side, V_REST]) + origins[n, side, V_ORIGIN]
    m = (rings[at + 1] + origins[n, side, M_REST]) + origins[n, side, M_ORIGIN]
    return v, m


@inlined
def scaled_vertex(
    origins: Floats, rings: Floats, marks: Integers, n: int, side: int, i: int, tau: float
) -> tuple[float, float]:
    """A vertex: V tau and z, both of which are lengths."""
    v, m = vertex(origins, rings, marks, n, side, i)
    return tau * v, m - tau * v


@substituted
def put(rings: Floats, marks: Integers, n: int, side: int, i: int, v: float, m: float) -> None:
    """Write a vertex, from the origin of its chain."""
    at = place(marks, n, side, i)
    rings[at] = v
    rings[at + 1] = m


@allocation_free
def copy_section(
    origins: Floats,
    rings: Floats,
    marks: Integers,
    n: int,
    to_origins: Floats,
    to_rings: Floats,
    to_marks: Integers,
    to: int,
) -> None:
    """Copy a section to a row of other chains, which have room for it, and more, that is not taken."""
    for side in (RIGHT, LEFT):
        to_marks[to, side, BEGIN] = to_marks[to, side, END] = 0
    wanted = room_for(min(count_of(marks, n) + ROOM_AHEAD, CAPACITY), room_of(to_marks, to))
    if wanted > room_of(to_marks, to):
        widen_rings(to_rings, to_marks, to, wanted)
    for side in (RIGHT, LEFT):
        for part in range(ORIGIN):
            to_origins[to, side, part] = origins[n, side, part]
        for part in (BEGIN, END, PEAK):
            to_marks[to, side, part] = marks[n, side, part]
        for i in range(begin_of(marks, n, side), end_of(marks, n, side)):
            at = place(marks, n, side, i)
            put(to_rings, to_marks, to, side, i, rings[at], rings[at + 1])


@inlined
def move_part(origins: Floats, n: int, side: int, part: int, value: float) -> None:
    """Add to a coordinate of an origin; its rest keeps what rounding takes away."""
    before = origins[n, side, part]
    after = before + value
    added = after - before
    origins[n, side, part] = after
    origins[n, side, part + 1] += (before - (after - added)) + (value - added)


@substituted
def product_error(a: float, b: float, product: float) -> float:
    """What rounding took from a product of two floats: a b - product (Dekker)."""
    split = 134217729.0
    a_high = split * a - (split * a - a)
    b_high = split * b - (split * b - b)
    a_low = a - a_high
    b_low = b - b_high
    return a_low * b_low - (((product - a_high * b_high) - a_low * b_high) - a_high * b_low)


@allocation_free
def start(
    origins: Floats,
    rings: Floats,
    marks: Integers,
    n: int,
    tau: float,
    bottom: tuple[float, float, float],
    top: tuple[float, float, float],
) -> None:
    """Begin with a trapezium between two levels.

    Parameters
    ----------
    origins, rings, marks, n : section
    tau : float
        Time to go.
    bottom, top : tuple of float
        Least V, greatest V, and z, of either level.
    """
    reach = 0.0
    for side in (RIGHT, LEFT):
        for i in range(ORIGIN):
            origins[n, side, i] = 0.0
        for i in range(2):
            at_top = (i == 1) == (side == RIGHT)
            v = top[1 - side] if at_top else bottom[1 - side]
            put(rings, marks, n, side, i, v, (top[2] if at_top else bottom[2]) + tau * v)
            reach = max(reach, abs(v))
        marks[n, side, BEGIN] = 0
        marks[n, side, END] = 2
        marks[n, side, PEAK] = 0
    origins[n, RIGHT, REACH] = reach


@inlined
def hand_over(
    rings: Floats,
    sign: float,
    giver: tuple[int, int],
    first: int,
    end: int,
    taker: tuple[int, int],
    front: int,
    between: tuple[float, float, float],
    same: float,
    tau: float,
) -> tuple[int, int]:
    """Give the last vertices of a chain, past its highest now, to the front of the other chain.

    Parameters
    ----------
    rings : ndarray
    sign : float
        The side from which the giver is seen to rise.
    giver : tuple of int
        Ring and mask of the chain that gives.
    first, end : int
        Its first vertex, and one past its last.
    taker, front : tuple of int, int
        Ring and mask of the other chain, and its first vertex.
    between : tuple of float
        V, m and height of the giver's origin, from the taker's.
    same : float
        Differences of V that are rounding.
    tau : float
        Time to go.

    Returns
    -------
    end, front : int

    Notes
    -----
    A falling time to go lifts what is on the right: only a vertex with the one before it on its outer side is passed.
    Where the level has not turned, heights along it are equal to within rounding, and must not pass the others.
    """
    back = end - 1
    at = giver[0] + 2 * (back & giver[1])
    v, m = rings[at], rings[at + 1]
    rise = sign * (m - tau * v)
    at = taker[0] + 2 * (front & taker[1])
    front_rise = sign * (rings[at + 1] - tau * rings[at])
    while True:
        if rise + sign * between[2] > front_rise:
            front -= 1
            taken_v, taken_m = v + between[0], m + between[1]
            at = taker[0] + 2 * (front & taker[1])
            rings[at] = taken_v
            rings[at + 1] = taken_m
            front_rise = sign * (taken_m - tau * taken_v)
        if back == first:
            break
        at = giver[0] + 2 * ((back - 1) & giver[1])
        before_v, before_m = rings[at], rings[at + 1]
        before_rise = sign * (before_m - tau * before_v)
        if before_rise < rise or sign * (v - before_v) > same:
            break
        back -= 1
        v, m, rise = before_v, before_m, before_rise
    return back + 1, front


@inlined
def turn(origins: Floats, rings: Floats, marks: Integers, n: int, tau: float) -> None:
    """Let the time to go fall to `tau`: the level turns, and each chain ends where it is highest or lowest now."""
    right = (marks[n, RIGHT, RING], marks[n, RIGHT, MASK])
    left = (marks[n, LEFT, RING], marks[n, LEFT, MASK])
    right_begin, left_begin = marks[n, RIGHT, BEGIN], marks[n, LEFT, BEGIN]
    same = 4.0 * EPSILON * origins[n, RIGHT, REACH]
    v_rest = origins[n, RIGHT, V_REST] - origins[n, LEFT, V_REST]
    m_rest = origins[n, RIGHT, M_REST] - origins[n, LEFT, M_REST]
    v = (origins[n, RIGHT, V_ORIGIN] - origins[n, LEFT, V_ORIGIN]) + v_rest
    m = (origins[n, RIGHT, M_ORIGIN] - origins[n, LEFT, M_ORIGIN]) + m_rest
    height = origin_height(origins, n, RIGHT, tau) - origin_height(origins, n, LEFT, tau)
    right_end, left_begin = hand_over(
        rings, 1.0, right, right_begin, marks[n, RIGHT, END], left, left_begin, (v, m, height), same, tau
    )
    left_end, right_begin = hand_over(
        rings, -1.0, left, left_begin, marks[n, LEFT, END], right, right_begin, (-v, -m, -height), same, tau
    )
    marks[n, RIGHT, BEGIN], marks[n, RIGHT, END] = right_begin, right_end
    marks[n, LEFT, BEGIN], marks[n, LEFT, END] = left_begin, left_end


@substituted
def spread(origins: Floats, n: int, tau: float, half_v: float) -> None:
    """Minkowski sum with the segment of V from -half_v to half_v that lies along the level of `tau`."""
    half_m = half_v * tau
    move_part(origins, n, RIGHT, V_ORIGIN, half_v)
    move_part(origins, n, RIGHT, M_ORIGIN, half_m)
    move_part(origins, n, LEFT, V_ORIGIN, -half_v)
    move_part(origins, n, LEFT, M_ORIGIN, -half_m)
    origins[n, RIGHT, REACH] += half_v


@substituted
def shift(origins: Floats, n: int, tau: float, v: float) -> None:
    """Move by V along the level of `tau`: z stays, the predicted miss changes by V tau."""
    m = v * tau
    rest = product_error(v, tau, m)
    for side in (RIGHT, LEFT):
        move_part(origins, n, side, V_ORIGIN, v)
        move_part(origins, n, side, M_ORIGIN, m)
        origins[n, side, M_REST] += rest
    origins[n, RIGHT, REACH] += abs(v)


@substituted
def heights(origins: Floats, rings: Floats, marks: Integers, n: int, tau: float) -> tuple[float, float]:
    """Least and greatest z of a section that is turned to `tau`."""
    right, left = origin_height(origins, n, RIGHT, tau), origin_height(origins, n, LEFT, tau)
    least = min(
        right + rise(rings, marks, n, RIGHT, begin_of(marks, n, RIGHT), tau),
        left - rise(rings, marks, n, LEFT, end_of(marks, n, LEFT) - 1, tau),
    )
    greatest = max(
        right + rise(rings, marks, n, RIGHT, end_of(marks, n, RIGHT) - 1, tau),
        left - rise(rings, marks, n, LEFT, begin_of(marks, n, LEFT), tau),
    )
    return least, greatest


@inlined
def cut_end(
    rings: Floats, ring: tuple[int, int], end: int, other_end: int, way: int, up: float, tau: float, level: float
) -> int:
    """Cut off what is above a level at one end of a chain, and put a vertex where the level crosses it.

    Parameters
    ----------
    rings : ndarray
    ring : tuple of int
        Ring and mask of the chain.
    end, other_end : int
        Its vertex that may be too high, and the one at its other end.
    way : int
        From the one to the other: 1 or -1.
    up : float
        1 if above is toward greater z, -1 if toward lesser.
    tau : float
        Time to go.
    level : float
        From the chain's origin, counted upward.

    Returns
    -------
    int
        Number of the vertex that is the end now.
    """
    at = ring[0] + 2 * (end & ring[1])
    v = rings[at]
    height = up * (rings[at + 1] - tau * v)
    if height <= level:
        return end
    while end != other_end:
        at = ring[0] + 2 * ((end + way) & ring[1])
        inner_v = rings[at]
        inner_height = up * (rings[at + 1] - tau * inner_v)
        if inner_height <= level:
            # From the nearer end of the edge: least rounding.
            if level - inner_height <= height - level:
                v = inner_v + (level - inner_height) / (height - inner_height) * (v - inner_v)
            else:
                v += (level - height) / (inner_height - height) * (inner_v - v)
            break
        v, height = inner_v, inner_height
        end += way
    at = ring[0] + 2 * (end & ring[1])
    rings[at] = v
    rings[at + 1] = up * level + tau * v
    return end


@inlined
def cut(
    origins: Floats, rings: Floats, marks: Integers, n: int, tau: float, lower: float, upper: float
) -> tuple[bool, float]:
    """Keep the band lower <= z <= upper of a section that is turned to `tau`.

    Returns
    -------
    living : bool
        False if nothing is left; the section is then as it was.
    overlap : float
        Least overlap of the section and the band across either border; negative is the distance between them.
    """
    least, greatest = heights(origins, rings, marks, n, tau)
    overlap = min(greatest - lower, upper - least)
    if overlap < 0.0:
        return False, overlap
    right = (marks[n, RIGHT, RING], marks[n, RIGHT, MASK])
    left = (marks[n, LEFT, RING], marks[n, LEFT, MASK])
    right_first, right_last = marks[n, RIGHT, BEGIN], marks[n, RIGHT, END] - 1
    left_first, left_last = marks[n, LEFT, BEGIN], marks[n, LEFT, END] - 1
    right_height, left_height = origin_height(origins, n, RIGHT, tau), origin_height(origins, n, LEFT, tau)
    if greatest > upper:
        right_last = cut_end(rings, right, right_last, right_first, -1, 1.0, tau, upper - right_height)
        left_first = cut_end(rings, left, left_first, left_last, 1, 1.0, tau, upper - left_height)
        marks[n, RIGHT, END] = right_last + 1
        marks[n, LEFT, BEGIN] = left_first
    if least < lower:
        left_last = cut_end(rings, left, left_last, left_first, -1, -1.0, tau, left_height - lower)
        right_first = cut_end(rings, right, right_first, right_last, 1, -1.0, tau, right_height - lower)
        marks[n, LEFT, END] = left_last + 1
        marks[n, RIGHT, BEGIN] = right_first
    return True, overlap


@substituted
def miss_of(rings: Floats, marks: Integers, n: int, side: int, i: int) -> float:
    """Predicted miss of a vertex over that of its chain's origin, counted outward."""
    return float(sign_of(side) * rings[place(marks, n, side, i) + 1])


@inlined
def find_peak(
    rings: Floats, ring: tuple[int, int], first: int, last: int, peak: int, sign: float, m_origin: float
) -> int:
    """Number of the vertex of a chain whose predicted miss is the greatest (right) or the least (left).

    Parameters
    ----------
    rings : ndarray
    ring : tuple of int
        Ring and mask of the chain.
    first, last : int
        Its ends.
    peak : int
        Where the peak was.
    sign : float
        The side from which the chain is seen.
    m_origin : float
        Predicted miss of the chain's origin.

    Returns
    -------
    int

    Notes
    -----
    The search starts where the peak was. It ends where the miss falls by more than rounding: vertices that repeat
    one another, or nearly so, must not stop it.
    """
    peak = min(max(peak, first), last)
    miss = sign * rings[ring[0] + 2 * (peak & ring[1]) + 1]
    rounding = 16.0 * EPSILON * (abs(miss) + abs(m_origin))
    start_at = peak
    for way in (1, -1):
        i = start_at + way
        while first <= i <= last:
            here = sign * rings[ring[0] + 2 * (i & ring[1]) + 1]
            if here > miss:
                peak, miss = i, here
            elif here < miss - rounding:
                break
            i += way
    return peak


@inlined
def first_near_peak(rings: Floats, ring: tuple[int, int], first: int, peak: int, sign: float, tolerance: float) -> int:
    """First vertex of the edge through the peak along which the predicted miss is the same to within a tolerance."""
    level = sign * rings[ring[0] + 2 * (peak & ring[1]) + 1] - tolerance
    while peak > first and sign * rings[ring[0] + 2 * ((peak - 1) & ring[1]) + 1] >= level:
        peak -= 1
    return peak


@inlined
def greatest_and_least_miss(origins: Floats, rings: Floats, marks: Integers, n: int) -> tuple[float, float]:
    """Greatest and least predicted miss of a section; the chains note where they are reached."""
    right = (marks[n, RIGHT, RING], marks[n, RIGHT, MASK])
    left = (marks[n, LEFT, RING], marks[n, LEFT, MASK])
    right_first, left_first = marks[n, RIGHT, BEGIN], marks[n, LEFT, BEGIN]
    right_m, left_m = origins[n, RIGHT, M_ORIGIN], origins[n, LEFT, M_ORIGIN]
    upper_at = find_peak(rings, right, right_first, marks[n, RIGHT, END] - 1, marks[n, RIGHT, PEAK], 1.0, right_m)
    lower_at = find_peak(rings, left, left_first, marks[n, LEFT, END] - 1, marks[n, LEFT, PEAK], -1.0, left_m)
    marks[n, RIGHT, PEAK], marks[n, LEFT, PEAK] = upper_at, lower_at
    _, upper = vertex(origins, rings, marks, n, RIGHT, upper_at)
    _, lower = vertex(origins, rings, marks, n, LEFT, lower_at)
    return upper, lower


@allocation_free
def extreme_points(
    origins: Floats, rings: Floats, marks: Integers, n: int, tau: float, relative: float, slack: float
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Points that reach the extremes of the predicted miss, as `greatest_and_least_miss` has found them.

    Parameters
    ----------
    origins, rings, marks, n : section
    tau : float
        Time to go.
    relative, slack : float
        What is the same to within these parts of the interval and of the magnitudes is the same.

    Returns
    -------
    upper, lower : tuple of float
        V and m of the lowest point that reaches the greatest miss, and of the highest that reaches the least.
    """
    right = (marks[n, RIGHT, RING], marks[n, RIGHT, MASK])
    left = (marks[n, LEFT, RING], marks[n, LEFT, MASK])
    right_first, left_first = marks[n, RIGHT, BEGIN], marks[n, LEFT, BEGIN]
    upper_at, lower_at = marks[n, RIGHT, PEAK], marks[n, LEFT, PEAK]
    upper_v, upper = vertex(origins, rings, marks, n, RIGHT, upper_at)
    lower_v, lower = vertex(origins, rings, marks, n, LEFT, lower_at)
    magnitude = tau * (abs(upper_v) + abs(lower_v)) + abs(upper) + abs(lower)
    tolerance = relative * (upper - lower) + slack * magnitude
    upper_at = first_near_peak(rings, right, right_first, upper_at, 1.0, tolerance)
    lower_at = first_near_peak(rings, left, left_first, lower_at, -1.0, tolerance)
    return vertex(origins, rings, marks, n, RIGHT, upper_at), vertex(origins, rings, marks, n, LEFT, lower_at)


@substituted
def is_crowded(marks: Integers, n: int) -> bool:
    """Whether a section may have more vertices than there is room for before the next step is over."""
    return bool(count_of(marks, n) > CAPACITY - MOST_ADDED)


@allocation_free
def reduce_outward(origins: Floats, rings: Floats, marks: Integers, n: int, tau: float, points: Floats) -> None:
    """Drop edges of the longer chain, outward, until the section has `REDUCED` vertices.

    Parameters
    ----------
    origins, rings, marks, n : section
    tau : float
        Time to go.
    points : ndarray, shape (CAPACITY, 2)
        Room to work in.

    Notes
    -----
    The edge whose neighbours, extended until they meet, add least area goes first. O(CAPACITY) an edge. A vertex that
    rounding has put inside the others goes before; where no edge can be dropped, the chain becomes three sides
    of a box around it.
    """
    right = marks[n, RIGHT, END] - marks[n, RIGHT, BEGIN]
    other = min(right, count_of(marks, n) - right)
    side = RIGHT if right > other else LEFT
    count = 0
    for i in range(begin_of(marks, n, side), end_of(marks, n, side)):
        at = place(marks, n, side, i)
        v, m = rings[at], rings[at + 1]
        count = polygon.append(points, polygon.drop_turned(points, count, 1, v, m), v, m)
    while count > REDUCED - other:
        chosen, v, m = polygon.cheapest_edge(points, count, 1, count - 3)
        if chosen < 0:
            count = box_around(points, count, sign_of(side), tau)
            break
        points[chosen, 0] = v
        points[chosen, 1] = m
        for i in range(chosen + 1, count - 1):
            points[i, 0] = points[i + 1, 0]
            points[i, 1] = points[i + 1, 1]
        count -= 1
    for i in range(count):
        put(rings, marks, n, side, i, points[i, 0], points[i, 1])
        # New vertices may be farther out than any that the section ever had.
        v, _ = vertex(origins, rings, marks, n, side, i)
        origins[n, RIGHT, REACH] = max(origins[n, RIGHT, REACH], abs(v))
    marks[n, side, BEGIN] = 0
    marks[n, side, END] = count
    marks[n, side, PEAK] = 0


@allocation_free
def box_around(points: Floats, count: int, sign: float, tau: float) -> int:
    """Replace a chain by its ends and their images moved out along the level as far as its outermost vertex."""
    out = 0.0
    for end in (0, count - 1):
        for i in range(count):
            along = sign * (points[i, 0] - points[end, 0])
            out = max(out, along)
    last_v, last_m = points[count - 1, 0], points[count - 1, 1]
    points[1, 0] = points[0, 0] + sign * out
    points[1, 1] = points[0, 1] + sign * out * tau
    points[2, 0] = last_v + sign * out
    points[2, 1] = last_m + sign * out * tau
    points[3, 0] = last_v
    points[3, 1] = last_m
    return 4


@entry
def outline(origins: Floats, rings: Floats, marks: Integers, n: int, tau: float, out: Floats) -> int:
    """Write the vertices (V, z), counter-clockwise; return how many: at most CAPACITY.

    Notes
    -----
    Where the chains meet in one point they hold it twice, equal up to rounding: it is written once.
    """
    made = 0
    for side in (RIGHT, LEFT):
        first = begin_of(marks, n, side)
        for i in range(first, end_of(marks, n, side)):
            v, m = vertex(origins, rings, marks, n, side, i)
            z = m - tau * v
            if i > first or made == 0 or not meets(out, made - 1, v, z, origins[n, RIGHT, REACH], tau):
                made = polygon.append(out, made, v, z)
    while made > 1 and meets(out, made - 1, out[0, 0], out[0, 1], origins[n, RIGHT, REACH], tau):
        made -= 1
    return made


@allocation_free
def meets(points: Floats, i: int, v: float, z: float, reach: float, tau: float) -> bool:
    """Whether a vertex is (V, z) up to the rounding of a change of chains."""
    close_v = abs(points[i, 0] - v) <= 4.0 * EPSILON * reach
    return bool(close_v and abs(points[i, 1] - z) <= 4.0 * EPSILON * (abs(z) + 2.0 * tau * reach))


@entry
def cut_misses(
    origins: Floats, rings: Floats, marks: Integers, n: int, tau: float, lower: float, upper: float, points: Floats
) -> tuple[bool, float]:
    """Keep the band lower <= m <= upper of predicted miss; the rest is as in `cut`.

    Notes
    -----
    This band is not along the line of sight, so it may cut anywhere: the chains are taken apart and made anew.
    O(vertices). `points` has room for CAPACITY + 2.
    """
    count = 0
    for side in (RIGHT, LEFT):
        for i in range(begin_of(marks, n, side), end_of(marks, n, side)):
            v, m = vertex(origins, rings, marks, n, side, i)
            count = polygon.append(points, count, v, m)
    count, overlap = polygon.clip_to_band(points, count, 0.0, 1.0, lower, upper)
    if count == 0:
        return False, overlap
    for side in (RIGHT, LEFT):
        for part in range(REACH):
            origins[n, side, part] = 0.0
    bottom, top = polygon.extremes(points, count, -tau, 1.0)
    thickness = polygon.height(points, top, -tau, 1.0) - polygon.height(points, bottom, -tau, 1.0)
    if thickness <= 16.0 * EPSILON * (abs(points[top, 1]) + abs(points[bottom, 1]) + tau * origins[n, RIGHT, REACH]):
        # Level to within rounding: its ends are to the right and to the left, and each chain has both.
        bottom, top = polygon.extremes(points, count, -1.0, 0.0)
    for side in (RIGHT, LEFT):
        first, last = (bottom, top) if side == RIGHT else (top, bottom)
        length = (last - first) % count + 1
        for i in range(length):
            at = (first + i) % count
            put(rings, marks, n, side, i, points[at, 0], points[at, 1])
        marks[n, side, BEGIN] = 0
        marks[n, side, END] = length
        marks[n, side, PEAK] = 0
    return True, overlap
