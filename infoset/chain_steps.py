"""Compiled operations of a time step on sections stored as in `chains`; they access only the ends of the chains.

The operations are the start, the turn of the level, the sum with a segment, the shift, the cut, and the extremes of
the height and of the predicted miss.
"""

from __future__ import annotations

from infoset._compile import allocation_free, constants, inlined
from infoset.arrays import Floats
from infoset.chains import EPSILON, Chain, height_in, number_vertices, origin_height, read, vertex, write

ZERO, ONE, TWO = constants(3)
FORWARD, BACKWARD = ONE, -ONE
"""Directions along a chain."""


@inlined
def move(chain: Chain, v: float, m: float) -> None:
    """Add to the origin of a chain; the second float of each coordinate takes the rounding error."""
    before = chain.v
    after = before + v
    added = after - before
    chain.v = after
    chain.v_rest += (before - (after - added)) + (v - added)
    before = chain.m
    after = before + m
    added = after - before
    chain.m = after
    chain.m_rest += (before - (after - added)) + (m - added)


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
    right: Chain,
    left: Chain,
    rings: Floats,
    tau: float,
    bottom: tuple[float, float, float],
    top: tuple[float, float, float],
) -> None:
    """Write a trapezium between two levels at time to go `tau`, s.

    `bottom` and `top` are the least V, the greatest V, m/s, and z, m, of each level.
    """
    for chain in (right, left):
        move_to_zero(chain)
        number_vertices(chain, TWO)
    write(right, rings, ZERO, bottom[1], bottom[2] + tau * bottom[1])
    write(right, rings, ONE, top[1], top[2] + tau * top[1])
    write(left, rings, ZERO, top[0], top[2] + tau * top[0])
    write(left, rings, ONE, bottom[0], bottom[2] + tau * bottom[0])
    right.reach = max(abs(bottom[0]), abs(bottom[1]), abs(top[0]), abs(top[1]))


@inlined
def move_to_zero(chain: Chain) -> None:
    """Set the origin of a chain to zero."""
    chain.v = chain.v_rest = chain.m = chain.m_rest = 0.0


@inlined
def hand_over(
    giver: Chain,
    taker: Chain,
    rings: Floats,
    sign: float,
    between: tuple[float, float, float],
    same: tuple[float, float],
    tau: float,
) -> None:
    """Move the vertices of a chain after its highest one to the front of the other chain.

    `sign` is 1 if the giver is the right chain, else -1. `between` has V, m and height of the giver's origin relative
    to the taker's, `same` the rounding errors of a difference of V, and of the difference of the origins' heights.

    A decreasing time to go raises the right side, so only vertices whose predecessor is on the outer side are moved.
    Without a turn of the level, heights along it are equal to within rounding, and no vertex may be moved. Where both
    chains end in the same vertex, their copies differ only by rounding: moving it again would add a vertex at every
    second step.
    """
    first, back, front = giver.begin, giver.end - 1, taker.begin
    v, m = read(giver, rings, back)
    rise = sign * (m - tau * v)
    same_v, same_rise = same[0], same[1] + 4.0 * EPSILON * abs(m)
    front_v, front_m = read(taker, rings, front)
    front_rise = sign * (front_m - tau * front_v)
    while True:
        if rise + sign * between[2] > front_rise + same_rise:
            front -= 1
            front_v, front_m = v + between[0], m + between[1]
            write(taker, rings, front, front_v, front_m)
            front_rise = sign * (front_m - tau * front_v)
        if back == first:
            break
        before_v, before_m = read(giver, rings, back - 1)
        before_rise = sign * (before_m - tau * before_v)
        if before_rise < rise - same_rise or sign * (v - before_v) > same_v:
            break
        # Vertices that coincide to within rounding must not stop the search.
        if before_rise < rise and abs(v - before_v) > same_v:
            break
        back -= 1
        v, m, rise = before_v, before_m, before_rise
    giver.end = back + 1
    taker.begin = front


@inlined
def turn(right: Chain, left: Chain, rings: Floats, tau: float) -> None:
    """Decrease the time to go to `tau`: the level turns, and the chains get new highest and lowest ends."""
    same_v = 4.0 * EPSILON * right.reach
    same_m = 2.0 * EPSILON * (abs(right.m) + abs(left.m))
    same = (same_v, same_m + tau * same_v)
    v = (right.v - left.v) + (right.v_rest - left.v_rest)
    m = (right.m - left.m) + (right.m_rest - left.m_rest)
    height = origin_height(right, tau) - origin_height(left, tau)
    hand_over(right, left, rings, 1.0, (v, m, height), same, tau)
    hand_over(left, right, rings, -1.0, (-v, -m, -height), same, tau)


@inlined
def spread(right: Chain, left: Chain, tau: float, half_v: float) -> None:
    """Add the segment of V from -half_v to half_v along the level of `tau` (Minkowski sum)."""
    half_m = half_v * tau
    move(right, half_v, half_m)
    move(left, -half_v, -half_m)
    right.reach += half_v


@inlined
def shift(right: Chain, left: Chain, tau: float, v: float) -> None:
    """Move a section by `v` along the level of `tau`: z is unchanged, the predicted miss changes by v tau."""
    m = v * tau
    rest = product_error(v, tau, m)
    move(right, v, m)
    move(left, v, m)
    right.m_rest += rest
    left.m_rest += rest
    right.reach += abs(v)


@inlined
def heights(right: Chain, left: Chain, rings: Floats, tau: float) -> tuple[float, float]:
    """Least and greatest z of a section at time to go `tau`."""
    right_origin, left_origin = origin_height(right, tau), origin_height(left, tau)
    least = min(
        right_origin + height_in(right, rings, right.begin, tau),
        left_origin + height_in(left, rings, left.end - 1, tau),
    )
    greatest = max(
        right_origin + height_in(right, rings, right.end - 1, tau),
        left_origin + height_in(left, rings, left.begin, tau),
    )
    return least, greatest


@inlined
def cut_end(
    chain: Chain, rings: Floats, end: int, other_end: int, way: int, up: float, tau: float, level: float
) -> int:
    """Remove the part of a chain above a level, and add a vertex at the intersection; return its number, the new end.

    `end` is the end vertex to cut, `other_end` the one at the other end, and `way` the direction to it: 1 or -1. With
    `up` = 1 greater z is removed, with -1 lesser z. `level` is `up` times the height of the level relative to the
    chain's origin, m.
    """
    v, m = read(chain, rings, end)
    height = up * (m - tau * v)
    if height <= level:
        return end
    while end != other_end:
        inner_v, inner_m = read(chain, rings, end + way)
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
    write(chain, rings, end, v, up * level + tau * v)
    return end


@inlined
def cut(right: Chain, left: Chain, rings: Floats, tau: float, lower: float, upper: float) -> tuple[bool, float]:
    """Intersect a section at time to go `tau` with the band lower <= z <= upper.

    Return whether it lives, and the smaller overlap of section and band at the two borders, m: minus their distance if
    they do not intersect. If the intersection is empty, the section is unchanged. A band with `lower` above `upper` is
    empty: that of a label behind x = 0, or beyond the range at which the error bound is zero.
    """
    least, greatest = heights(right, left, rings, tau)
    overlap = min(greatest - lower, upper - least)
    if overlap < 0.0 or lower > upper:
        return False, min(overlap, upper - lower)
    right_height, left_height = origin_height(right, tau), origin_height(left, tau)
    right_first, right_last, left_first, left_last = right.begin, right.end - 1, left.begin, left.end - 1
    if greatest > upper:
        right_last = cut_end(right, rings, right_last, right_first, BACKWARD, 1.0, tau, upper - right_height)
        left_first = cut_end(left, rings, left_first, left_last, FORWARD, 1.0, tau, upper - left_height)
        right.end = right_last + 1
        left.begin = left_first
    if least < lower:
        left_last = cut_end(left, rings, left_last, left_first, BACKWARD, -1.0, tau, left_height - lower)
        right_first = cut_end(right, rings, right_first, right_last, FORWARD, -1.0, tau, right_height - lower)
        left.end = left_last + 1
        right.begin = right_first
    return True, overlap


@inlined
def find_peak(chain: Chain, rings: Floats, sign: float, magnitude: float) -> int:
    """Return the number of the vertex with the greatest (right chain) or least (left chain) predicted miss; store it.

    `sign` is 1 for the right chain, -1 for the left one. `magnitude` is that of the terms of the predicted misses, to
    which their rounding error is relative, m. The search starts at the previous peak and ends where the miss decreases
    by more than rounding, so that vertices that nearly coincide do not stop it.
    """
    first, last = chain.begin, chain.end - 1
    peak = min(max(chain.peak, first), last)
    miss = sign * read(chain, rings, peak)[1]
    rounding = 16.0 * EPSILON * (abs(miss) + magnitude)
    start_at = peak
    for way in (1, -1):
        i = start_at + way
        while first <= i <= last:
            here = sign * read(chain, rings, i)[1]
            if here > miss:
                peak, miss = i, here
            elif here < miss - rounding:
                break
            i += way
    chain.peak = peak
    return peak


@inlined
def first_near_peak(chain: Chain, rings: Floats, sign: float, tolerance: float) -> int:
    """First vertex before the peak whose predicted miss equals that of the peak to within a tolerance."""
    i = chain.peak
    level = sign * read(chain, rings, i)[1] - tolerance
    while i > chain.begin and sign * read(chain, rings, i - 1)[1] >= level:
        i -= 1
    return i


@inlined
def greatest_and_least_miss(right: Chain, left: Chain, rings: Floats, tau: float) -> tuple[float, float]:
    """Return the greatest and the least predicted miss of a section; store their vertices as peaks."""
    # A miss is z + V tau; both terms may be far greater than the sum.
    reach = tau * right.reach
    _, upper = vertex(right, rings, find_peak(right, rings, 1.0, abs(right.m) + reach))
    _, lower = vertex(left, rings, find_peak(left, rings, -1.0, abs(left.m) + reach))
    return upper, lower


@allocation_free
def extreme_points(
    right: Chain, left: Chain, rings: Floats, tau: float, relative: float, slack: float
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return points with the extremes of the predicted miss; `greatest_and_least_miss` must have stored the peaks.

    They are V and m of the lowest point with the greatest miss, and of the highest point with the least. `relative` and
    `slack` are tolerances for equal misses, relative to the interval and to the magnitudes of the terms.
    """
    upper_v, upper = vertex(right, rings, right.peak)
    lower_v, lower = vertex(left, rings, left.peak)
    magnitude = tau * (abs(upper_v) + abs(lower_v)) + abs(upper) + abs(lower)
    tolerance = relative * (upper - lower) + slack * magnitude
    upper_at = first_near_peak(right, rings, 1.0, tolerance)
    lower_at = first_near_peak(left, rings, -1.0, tolerance)
    return vertex(right, rings, upper_at), vertex(left, rings, lower_at)
