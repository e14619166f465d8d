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

A batch of sections is two arrays, `store` and `marks`, a row `n` a section; a kernel takes the three. (Views of rows,
or a tuple of arrays, cost more than the work: each is counted, atomically, wherever it is handed on.)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from infoset import polygon
from infoset._compile import allocation_free, entry, inlined, substituted

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

EPSILON = float(np.finfo(np.float64).eps)

RIGHT, LEFT = 0, 1

CAPACITY = 256
"""Vertices a section may have: a power of two."""
ROOM_AT_START = 32
"""Vertices each chain has room for at first, a power of two: sections that lie close together are quicker to reach."""
MOST_ADDED = 4
"""Vertices that one step can add, two at each of its two turns."""
REDUCED = 160
"""Vertices left in a section that has grown to CAPACITY."""

# The marks, for each chain: the number of its first vertex, one past the last, and that of the peak. Numbers only
# grow or fall: the ring holds a vertex at its number modulo the room.
BEGIN, END, PEAK = range(3)
MARKS = 3

# The store, for each chain: its origin, a bound on |V| (the right chain has it), then the vertices, each (V, m) from
# the origin. An origin moves at every step and must not wear, so it is a sum of two floats. The bound is over all that
# the section ever was: rounding is relative to it.
V_ORIGIN, V_REST, M_ORIGIN, M_REST, REACH = range(5)
VERTICES = 6


def empty_sections(number: int, room: int = CAPACITY) -> tuple[Floats, Integers]:
    """Room for a number of sections: their store and marks."""
    return np.zeros((number, 2, VERTICES + 2 * room)), np.zeros((number, 2, MARKS), dtype=np.int64)


def working_room() -> Floats:
    """Room that some operations need to work in."""
    return np.empty((CAPACITY + 2, 2))


@substituted
def place(store: Floats, i: int) -> int:
    """Where the store has a vertex of a chain."""
    return int(VERTICES + 2 * (i & (((store.shape[2] - VERTICES) >> 1) - 1)))


@entry
def move_to_wider_rings(store: Floats, marks: Integers, kept: Flags, wider: Floats) -> None:
    """Copy the sections that are kept to a store with more room; the others stay unwritten, and take no memory."""
    for n in range(store.shape[0]):
        if not kept[n]:
            continue
        for side in (RIGHT, LEFT):
            for i in range(VERTICES):
                wider[n, side, i] = store[n, side, i]
            for i in range(begin_of(marks, n, side), end_of(marks, n, side)):
                at = place(store, i)
                put(wider, n, side, i, store[n, side, at], store[n, side, at + 1])


@substituted
def sign_of(side: int) -> float:
    """The side from which a chain is seen to rise: 1 for the right one, -1 for the left one."""
    return 1.0 - 2.0 * side


@substituted
def begin_of(marks: Integers, n: int, side: int) -> int:
    """Number of the first vertex of a chain."""
    return int(marks[n, side, BEGIN])


@substituted
def end_of(marks: Integers, n: int, side: int) -> int:
    """One past the number of the last vertex of a chain."""
    return int(marks[n, side, END])


@inlined
def rise(store: Floats, n: int, side: int, i: int, tau: float) -> float:
    """Height of a vertex over the origin of its chain, seen from the chain's own side: it rises along the chain."""
    at = place(store, i)
    return float(sign_of(side) * (store[n, side, at + 1] - tau * store[n, side, at]))


@inlined
def origin_height(store: Floats, n: int, side: int, tau: float) -> float:
    """Height of the origin of a chain."""
    whole = store[n, side, M_ORIGIN] - tau * store[n, side, V_ORIGIN]
    return float(whole + (store[n, side, M_REST] - tau * store[n, side, V_REST]))


@inlined
def vertex(store: Floats, n: int, side: int, i: int) -> tuple[float, float]:
    """A vertex: V and m."""
    at = place(store, i)
    v = (store[n, side, at] + store[n, side, V_REST]) + store[n, side, V_ORIGIN]
    m = (store[n, side, at + 1] + store[n, side, M_REST]) + store[n, side, M_ORIGIN]
    return v, m


@substituted
def put(store: Floats, n: int, side: int, i: int, v: float, m: float) -> None:
    """Write a vertex, from the origin of its chain."""
    at = place(store, i)
    store[n, side, at] = v
    store[n, side, at + 1] = m


@inlined
def move_part(store: Floats, n: int, side: int, part: int, value: float) -> None:
    """Add to a coordinate of an origin; its rest keeps what rounding takes away."""
    before = store[n, side, part]
    after = before + value
    added = after - before
    store[n, side, part] = after
    store[n, side, part + 1] += (before - (after - added)) + (value - added)


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
    store: Floats,
    marks: Integers,
    n: int,
    tau: float,
    bottom: tuple[float, float, float],
    top: tuple[float, float, float],
) -> None:
    """Begin with a trapezium between two levels.

    Parameters
    ----------
    store, marks, n : section
    tau : float
        Time to go.
    bottom, top : tuple of float
        Least V, greatest V, and z, of either level.
    """
    reach = 0.0
    for side in (RIGHT, LEFT):
        for i in range(VERTICES):
            store[n, side, i] = 0.0
        for i in range(2):
            at_top = (i == 1) == (side == RIGHT)
            v = top[1 - side] if at_top else bottom[1 - side]
            put(store, n, side, i, v, (top[2] if at_top else bottom[2]) + tau * v)
            reach = max(reach, abs(v))
        marks[n, side, BEGIN] = 0
        marks[n, side, END] = 2
        marks[n, side, PEAK] = 0
    store[n, RIGHT, REACH] = reach


@inlined
def hand_over(store: Floats, marks: Integers, n: int, giver: int, tau: float) -> None:
    """Give the last vertices of a chain, past its highest now, to the front of the other chain.

    Notes
    -----
    A falling time to go lifts what is on the right: only a vertex with the one before it on its outer side is passed.
    Where the level has not turned, heights along it are equal to within rounding, and must not pass the others.
    """
    taker = 1 - giver
    same = 4.0 * EPSILON * store[n, RIGHT, REACH]
    origin = sign_of(giver) * (origin_height(store, n, giver, tau) - origin_height(store, n, taker, tau))
    first, back, front = begin_of(marks, n, giver), end_of(marks, n, giver) - 1, begin_of(marks, n, taker)
    back_rise = rise(store, n, giver, back, tau)
    front_rise = -rise(store, n, taker, front, tau)
    while True:
        if back_rise + origin > front_rise:
            front -= 1
            adopt(store, n, giver, back, taker, front)
            front_rise = -rise(store, n, taker, front, tau)
            marks[n, taker, BEGIN] = front
        if back == first:
            break
        before_rise = rise(store, n, giver, back - 1, tau)
        inward = store[n, giver, place(store, back)] - store[n, giver, place(store, back - 1)]
        if before_rise < back_rise or sign_of(giver) * inward > same:
            break
        back -= 1
        back_rise = before_rise
    marks[n, giver, END] = back + 1


@substituted
def adopt(store: Floats, n: int, giver: int, i: int, taker: int, j: int) -> None:
    """Write vertex i of one chain as vertex j of the other, from the other's origin."""
    at = place(store, i)
    v_rest = store[n, giver, V_REST] - store[n, taker, V_REST]
    m_rest = store[n, giver, M_REST] - store[n, taker, M_REST]
    v = store[n, giver, at] + ((store[n, giver, V_ORIGIN] - store[n, taker, V_ORIGIN]) + v_rest)
    m = store[n, giver, at + 1] + ((store[n, giver, M_ORIGIN] - store[n, taker, M_ORIGIN]) + m_rest)
    put(store, n, taker, j, v, m)


@substituted
def turn(store: Floats, marks: Integers, n: int, tau: float) -> None:
    """Let the time to go fall to `tau`: the level turns, and each chain ends where it is highest or lowest now."""
    hand_over(store, marks, n, RIGHT, tau)
    hand_over(store, marks, n, LEFT, tau)


@substituted
def spread(store: Floats, n: int, tau: float, half_v: float) -> None:
    """Minkowski sum with the segment of V from -half_v to half_v that lies along the level of `tau`."""
    half_m = half_v * tau
    move_part(store, n, RIGHT, V_ORIGIN, half_v)
    move_part(store, n, RIGHT, M_ORIGIN, half_m)
    move_part(store, n, LEFT, V_ORIGIN, -half_v)
    move_part(store, n, LEFT, M_ORIGIN, -half_m)
    store[n, RIGHT, REACH] += half_v


@substituted
def shift(store: Floats, n: int, tau: float, v: float) -> None:
    """Move by V along the level of `tau`: z stays, the predicted miss changes by V tau."""
    m = v * tau
    rest = product_error(v, tau, m)
    for side in (RIGHT, LEFT):
        move_part(store, n, side, V_ORIGIN, v)
        move_part(store, n, side, M_ORIGIN, m)
        store[n, side, M_REST] += rest
    store[n, RIGHT, REACH] += abs(v)


@substituted
def heights(store: Floats, marks: Integers, n: int, tau: float) -> tuple[float, float]:
    """Least and greatest z of a section that is turned to `tau`."""
    right, left = origin_height(store, n, RIGHT, tau), origin_height(store, n, LEFT, tau)
    least = min(
        right + rise(store, n, RIGHT, begin_of(marks, n, RIGHT), tau),
        left - rise(store, n, LEFT, end_of(marks, n, LEFT) - 1, tau),
    )
    greatest = max(
        right + rise(store, n, RIGHT, end_of(marks, n, RIGHT) - 1, tau),
        left - rise(store, n, LEFT, begin_of(marks, n, LEFT), tau),
    )
    return least, greatest


@inlined
def put_on_edge(store: Floats, n: int, side: int, near: int, far: int, at: int, tau: float, level: float) -> None:
    """Put, as vertex `at`, the point at a rise of `level` on the edge near-far; a lone vertex goes there."""
    v = store[n, side, place(store, near)]
    if near != far:
        near_rise = rise(store, n, side, near, tau)
        far_rise = rise(store, n, side, far, tau)
        # From the nearer end: least rounding.
        if abs(level - near_rise) <= abs(far_rise - level):
            v += (level - near_rise) / (far_rise - near_rise) * (store[n, side, place(store, far)] - v)
        else:
            far_v = store[n, side, place(store, far)]
            v = far_v + (level - far_rise) / (near_rise - far_rise) * (v - far_v)
    put(store, n, side, at, v, sign_of(side) * level + tau * v)


@inlined
def cut_back(store: Floats, marks: Integers, n: int, side: int, tau: float, level: float) -> None:
    """Cut off the end of a chain that rises above `level`."""
    first, last = begin_of(marks, n, side), end_of(marks, n, side) - 1
    if rise(store, n, side, last, tau) <= level:
        return
    while last > first and rise(store, n, side, last - 1, tau) > level:
        last -= 1
    put_on_edge(store, n, side, max(last - 1, first), last, last, tau, level)
    marks[n, side, END] = last + 1


@inlined
def cut_front(store: Floats, marks: Integers, n: int, side: int, tau: float, level: float) -> None:
    """Cut off the beginning of a chain that is below `level`."""
    first, last = begin_of(marks, n, side), end_of(marks, n, side) - 1
    if rise(store, n, side, first, tau) >= level:
        return
    while first < last and rise(store, n, side, first + 1, tau) < level:
        first += 1
    put_on_edge(store, n, side, min(first + 1, last), first, first, tau, level)
    marks[n, side, BEGIN] = first


@inlined
def cut(store: Floats, marks: Integers, n: int, tau: float, lower: float, upper: float) -> tuple[bool, float]:
    """Keep the band lower <= z <= upper of a section that is turned to `tau`.

    Returns
    -------
    living : bool
        False if nothing is left; the section is then as it was.
    overlap : float
        Least overlap of the section and the band across either border; negative is the distance between them.
    """
    least, greatest = heights(store, marks, n, tau)
    overlap = min(greatest - lower, upper - least)
    if overlap < 0.0:
        return False, overlap
    right, left = origin_height(store, n, RIGHT, tau), origin_height(store, n, LEFT, tau)
    if greatest > upper:
        cut_back(store, marks, n, RIGHT, tau, upper - right)
        cut_front(store, marks, n, LEFT, tau, left - upper)
    if least < lower:
        cut_back(store, marks, n, LEFT, tau, left - lower)
        cut_front(store, marks, n, RIGHT, tau, lower - right)
    return True, overlap


@substituted
def miss_of(store: Floats, n: int, side: int, i: int) -> float:
    """Predicted miss of a vertex over that of its chain's origin, counted outward."""
    return float(sign_of(side) * store[n, side, place(store, i) + 1])


@inlined
def find_peak(store: Floats, marks: Integers, n: int, side: int) -> int:
    """Number of the vertex of a chain whose predicted miss is the greatest (right) or the least (left).

    Notes
    -----
    The search starts where the peak was. It ends where the miss falls by more than rounding: vertices that repeat
    one another, or nearly so, must not stop it.
    """
    first, last = begin_of(marks, n, side), end_of(marks, n, side) - 1
    peak = int(min(max(marks[n, side, PEAK], first), last))
    miss = miss_of(store, n, side, peak)
    rounding = 16.0 * EPSILON * (abs(miss) + abs(store[n, side, M_ORIGIN]))
    start_at = peak
    for way in (1, -1):
        i = start_at + way
        while first <= i <= last:
            here = miss_of(store, n, side, i)
            if here > miss:
                peak, miss = i, here
            elif here < miss - rounding:
                break
            i += way
    marks[n, side, PEAK] = peak
    return peak


@substituted
def first_near_peak(store: Floats, marks: Integers, n: int, side: int, peak: int, tolerance: float) -> int:
    """First vertex of the edge through the peak along which the predicted miss is the same to within a tolerance."""
    first = begin_of(marks, n, side)
    level = miss_of(store, n, side, peak) - tolerance
    while peak > first and miss_of(store, n, side, peak - 1) >= level:
        peak -= 1
    return peak


@substituted
def count_of(marks: Integers, n: int) -> int:
    """Number of vertices of both chains."""
    right, left = marks[n, RIGHT, END] - marks[n, RIGHT, BEGIN], marks[n, LEFT, END] - marks[n, LEFT, BEGIN]
    return int(right + left)


@substituted
def is_crowded(marks: Integers, n: int) -> bool:
    """Whether a section may have more vertices than there is room for before the next step is over."""
    return bool(count_of(marks, n) > CAPACITY - MOST_ADDED)


@allocation_free
def reduce_outward(store: Floats, marks: Integers, n: int, tau: float, points: Floats) -> None:
    """Drop edges of the longer chain, outward, until the section has `REDUCED` vertices.

    Parameters
    ----------
    store, marks, n : section
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
        at = place(store, i)
        v, m = store[n, side, at], store[n, side, at + 1]
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
        put(store, n, side, i, points[i, 0], points[i, 1])
        # New vertices may be farther out than any that the section ever had.
        v, _ = vertex(store, n, side, i)
        store[n, RIGHT, REACH] = max(store[n, RIGHT, REACH], abs(v))
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
def outline(store: Floats, marks: Integers, n: int, tau: float, out: Floats) -> int:
    """Write the vertices (V, z), counter-clockwise; return how many: at most CAPACITY.

    Notes
    -----
    Where the chains meet in one point they hold it twice, equal up to rounding: it is written once.
    """
    made = 0
    for side in (RIGHT, LEFT):
        first = begin_of(marks, n, side)
        for i in range(first, end_of(marks, n, side)):
            v, m = vertex(store, n, side, i)
            z = m - tau * v
            if i > first or made == 0 or not meets(out, made - 1, v, z, store[n, RIGHT, REACH], tau):
                made = polygon.append(out, made, v, z)
    while made > 1 and meets(out, made - 1, out[0, 0], out[0, 1], store[n, RIGHT, REACH], tau):
        made -= 1
    return made


@allocation_free
def meets(points: Floats, i: int, v: float, z: float, reach: float, tau: float) -> bool:
    """Whether a vertex is (V, z) up to the rounding of a change of chains."""
    close_v = abs(points[i, 0] - v) <= 4.0 * EPSILON * reach
    return bool(close_v and abs(points[i, 1] - z) <= 4.0 * EPSILON * (abs(z) + 2.0 * tau * reach))


@entry
def cut_misses(
    store: Floats, marks: Integers, n: int, tau: float, lower: float, upper: float, points: Floats
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
            v, m = vertex(store, n, side, i)
            count = polygon.append(points, count, v, m)
    count, overlap = polygon.clip_to_band(points, count, 0.0, 1.0, lower, upper)
    if count == 0:
        return False, overlap
    for side in (RIGHT, LEFT):
        for part in range(REACH):
            store[n, side, part] = 0.0
    bottom, top = polygon.extremes(points, count, -tau, 1.0)
    thickness = polygon.height(points, top, -tau, 1.0) - polygon.height(points, bottom, -tau, 1.0)
    if thickness <= 16.0 * EPSILON * (abs(points[top, 1]) + abs(points[bottom, 1]) + tau * store[n, RIGHT, REACH]):
        # Level to within rounding: its ends are to the right and to the left, and each chain has both.
        bottom, top = polygon.extremes(points, count, -1.0, 0.0)
    for side in (RIGHT, LEFT):
        first, last = (bottom, top) if side == RIGHT else (top, bottom)
        length = (last - first) % count + 1
        for i in range(length):
            at = (first + i) % count
            put(store, n, side, i, points[at, 0], points[at, 1])
        marks[n, side, BEGIN] = 0
        marks[n, side, END] = length
        marks[n, side, PEAK] = 0
    return True, overlap
