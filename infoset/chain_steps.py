"""Compiled operations of a time step on sections stored as in `chains`; they access only the ends of the chains.

The operations are the start, the turn of the level, the sum with a segment, the shift, the cut, and the extremes of
the height and of the predicted miss.
"""

from __future__ import annotations

from infoset._compile import allocation_free, constants, inlined
from infoset.chains import (
    BEGIN,
    END,
    EPSILON,
    LEFT,
    M_ORIGIN,
    M_REST,
    MASK,
    ORIGIN,
    PEAK,
    REACH,
    RIGHT,
    RING,
    V_ORIGIN,
    V_REST,
    Floats,
    Integers,
    begin_of,
    end_of,
    offset_in,
    origin_height,
    put,
    read,
    rise,
    vertex,
    write,
)

_, FORWARD = constants(2)
BACKWARD = -FORWARD
"""Directions along a chain."""


@inlined
def move_part(origins: Floats, n: int, side: int, part: int, value: float) -> None:
    """Add to a coordinate of an origin; the second float of the coordinate takes the rounding error."""
    before = origins[n, side, part]
    after = before + value
    added = after - before
    origins[n, side, part] = after
    origins[n, side, part + 1] += (before - (after - added)) + (value - added)


@inlined
def product_error(a: float, b: float, product: float) -> float:
    """Rounding error of a product of two floats: a b - product (Dekker)."""
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
    """Write a trapezium between two levels.

    Parameters
    ----------
    tau : float
        Time to go, s.
    bottom, top : tuple of float
        Least V, greatest V, m/s, and z, m, of each level.
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
    same: tuple[float, float],
    tau: float,
) -> tuple[int, int]:
    """Move the vertices of a chain after its highest one to the front of the other chain.

    Parameters
    ----------
    sign : float
        Sign of the giver's side.
    giver : tuple of int
        Offset and mask of the ring of the first chain.
    first, end : int
        Number of its first vertex, and one past that of its last.
    taker, front : tuple of int, int
        Offset and mask of the ring of the other chain, and number of its first vertex.
    between : tuple of float
        V, m and height of the giver's origin relative to the taker's.
    same : tuple of float
        Rounding errors of a difference of V, and of the difference of the origins' heights.
    tau : float
        Time to go, s.

    Returns
    -------
    end, front : int
        New end of the giver and new front of the taker.

    Notes
    -----
    A decreasing time to go raises the right side, so only vertices whose predecessor is on the outer side are moved.
    Without a turn of the level, heights along it are equal to within rounding, and no vertex may be moved. Where both
    chains end in the same vertex, their copies differ only by rounding: moving it again would add a vertex at every
    second step.
    """
    back = end - 1
    v, m = read(rings, offset_in(giver, back))
    rise = sign * (m - tau * v)
    same_v, same_rise = same[0], same[1] + 4.0 * EPSILON * abs(m)
    front_v, front_m = read(rings, offset_in(taker, front))
    front_rise = sign * (front_m - tau * front_v)
    while True:
        if rise + sign * between[2] > front_rise + same_rise:
            front -= 1
            front_v, front_m = v + between[0], m + between[1]
            write(rings, offset_in(taker, front), front_v, front_m)
            front_rise = sign * (front_m - tau * front_v)
        if back == first:
            break
        before_v, before_m = read(rings, offset_in(giver, back - 1))
        before_rise = sign * (before_m - tau * before_v)
        if before_rise < rise - same_rise or sign * (v - before_v) > same_v:
            break
        # Vertices that coincide to within rounding must not stop the search.
        if before_rise < rise and abs(v - before_v) > same_v:
            break
        back -= 1
        v, m, rise = before_v, before_m, before_rise
    return back + 1, front


@inlined
def turn(origins: Floats, rings: Floats, marks: Integers, n: int, tau: float) -> None:
    """Decrease the time to go to `tau`: the level turns, and the chains get new highest and lowest ends."""
    right = (marks[n, RIGHT, RING], marks[n, RIGHT, MASK])
    left = (marks[n, LEFT, RING], marks[n, LEFT, MASK])
    right_begin, left_begin = marks[n, RIGHT, BEGIN], marks[n, LEFT, BEGIN]
    same_v = 4.0 * EPSILON * origins[n, RIGHT, REACH]
    same_m = 2.0 * EPSILON * (abs(origins[n, RIGHT, M_ORIGIN]) + abs(origins[n, LEFT, M_ORIGIN]))
    same = (same_v, same_m + tau * same_v)
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


@inlined
def spread(origins: Floats, n: int, tau: float, half_v: float) -> None:
    """Add the segment of V from -half_v to half_v along the level of `tau` (Minkowski sum)."""
    half_m = half_v * tau
    move_part(origins, n, RIGHT, V_ORIGIN, half_v)
    move_part(origins, n, RIGHT, M_ORIGIN, half_m)
    move_part(origins, n, LEFT, V_ORIGIN, -half_v)
    move_part(origins, n, LEFT, M_ORIGIN, -half_m)
    origins[n, RIGHT, REACH] += half_v


@inlined
def shift(origins: Floats, n: int, tau: float, v: float) -> None:
    """Move a section by `v` along the level of `tau`: z is unchanged, the predicted miss changes by v tau."""
    m = v * tau
    rest = product_error(v, tau, m)
    for side in (RIGHT, LEFT):
        move_part(origins, n, side, V_ORIGIN, v)
        move_part(origins, n, side, M_ORIGIN, m)
        origins[n, side, M_REST] += rest
    origins[n, RIGHT, REACH] += abs(v)


@inlined
def heights(origins: Floats, rings: Floats, marks: Integers, n: int, tau: float) -> tuple[float, float]:
    """Least and greatest z of a section at time to go `tau`."""
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
    """Remove the part of a chain above a level, and add a vertex at the intersection.

    Parameters
    ----------
    ring : tuple of int
        Offset and mask of the chain's ring.
    end, other_end : int
        Numbers of the end vertex to cut and of the one at the other end.
    way : int
        Direction from the first to the second: 1 or -1.
    up : float
        1 to remove greater z, -1 to remove lesser z.
    tau : float
        Time to go, s.
    level : float
        `up` times the height of the level relative to the chain's origin, m.

    Returns
    -------
    int
        Number of the new end vertex.
    """
    v, m = read(rings, offset_in(ring, end))
    height = up * (m - tau * v)
    if height <= level:
        return end
    while end != other_end:
        inner_v, inner_m = read(rings, offset_in(ring, end + way))
        inner_height = up * (inner_m - tau * inner_v)
        if inner_height <= level:
            # Interpolated from the nearer end of the edge, for the least rounding error.
            if level - inner_height <= height - level:
                v = inner_v + (level - inner_height) / (height - inner_height) * (v - inner_v)
            else:
                v += (level - height) / (inner_height - height) * (inner_v - v)
            break
        v, height = inner_v, inner_height
        end += way
    write(rings, offset_in(ring, end), v, up * level + tau * v)
    return end


@inlined
def cut(
    origins: Floats, rings: Floats, marks: Integers, n: int, tau: float, lower: float, upper: float
) -> tuple[bool, float]:
    """Intersect a section at time to go `tau` with the band lower <= z <= upper.

    Returns
    -------
    living : bool
        False if the intersection is empty; the section is then unchanged.
    overlap : float
        Smaller overlap of section and band at the two borders, m; minus their distance if they do not intersect.
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
        right_last = cut_end(rings, right, right_last, right_first, BACKWARD, 1.0, tau, upper - right_height)
        left_first = cut_end(rings, left, left_first, left_last, FORWARD, 1.0, tau, upper - left_height)
        marks[n, RIGHT, END] = right_last + 1
        marks[n, LEFT, BEGIN] = left_first
    if least < lower:
        left_last = cut_end(rings, left, left_last, left_first, BACKWARD, -1.0, tau, left_height - lower)
        right_first = cut_end(rings, right, right_first, right_last, FORWARD, -1.0, tau, right_height - lower)
        marks[n, LEFT, END] = left_last + 1
        marks[n, RIGHT, BEGIN] = right_first
    return True, overlap


@inlined
def find_peak(
    rings: Floats, ring: tuple[int, int], first: int, last: int, peak: int, sign: float, magnitude: float
) -> int:
    """Return the number of the vertex with the greatest (right chain) or least (left chain) predicted miss.

    Parameters
    ----------
    ring : tuple of int
        Offset and mask of the chain's ring.
    first, last : int
        Numbers of its end vertices.
    peak : int
        Previous peak.
    sign : float
        Sign of the chain's side.
    magnitude : float
        Magnitude of the terms of the predicted misses, to which their rounding error is relative, m.

    Notes
    -----
    The search starts at the previous peak and ends where the miss decreases by more than rounding, so that vertices
    that nearly coincide do not stop it.
    """
    peak = min(max(peak, first), last)
    miss = sign * read(rings, offset_in(ring, peak))[1]
    rounding = 16.0 * EPSILON * (abs(miss) + magnitude)
    start_at = peak
    for way in (1, -1):
        i = start_at + way
        while first <= i <= last:
            here = sign * read(rings, offset_in(ring, i))[1]
            if here > miss:
                peak, miss = i, here
            elif here < miss - rounding:
                break
            i += way
    return peak


@inlined
def first_near_peak(rings: Floats, ring: tuple[int, int], first: int, peak: int, sign: float, tolerance: float) -> int:
    """First vertex before the peak whose predicted miss equals that of the peak to within a tolerance."""
    level = sign * read(rings, offset_in(ring, peak))[1] - tolerance
    while peak > first and sign * read(rings, offset_in(ring, peak - 1))[1] >= level:
        peak -= 1
    return peak


@inlined
def greatest_and_least_miss(origins: Floats, rings: Floats, marks: Integers, n: int, tau: float) -> tuple[float, float]:
    """Return the greatest and the least predicted miss of a section; store their vertices as peaks."""
    right = (marks[n, RIGHT, RING], marks[n, RIGHT, MASK])
    left = (marks[n, LEFT, RING], marks[n, LEFT, MASK])
    right_first, left_first = marks[n, RIGHT, BEGIN], marks[n, LEFT, BEGIN]
    # A miss is z + V tau; both terms may be far greater than the sum.
    reach = tau * origins[n, RIGHT, REACH]
    right_m, left_m = abs(origins[n, RIGHT, M_ORIGIN]) + reach, abs(origins[n, LEFT, M_ORIGIN]) + reach
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
    """Return points with the extremes of the predicted miss; `greatest_and_least_miss` must have stored the peaks.

    Parameters
    ----------
    tau : float
        Time to go, s.
    relative, slack : float
        Tolerances for equal misses, relative to the interval and to the magnitudes of the terms.

    Returns
    -------
    upper, lower : tuple of float
        V and m of the lowest point with the greatest miss, and of the highest point with the least.
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
