"""Compiled operations on a section: a convex polygon, stored as two chains of vertices.

The coordinates are (V, m) with m = z + V tau, where tau is the time to go: m is the predicted miss,
which is constant in free motion, and z = m - tau V. The height of a vertex is z, and a level is a
line of constant z. Cuts and disturbances act relative to the levels: a cut removes the highest or
the lowest part, and a disturbance moves the two sides apart along the level. Therefore the boundary
is stored as a RIGHT chain from the lowest vertex to the highest and a LEFT chain from the highest
vertex to the lowest:

* a disturbance moves each chain as a whole, an impulse moves both: only the origins of the chains
  change;
* a cut removes vertices from the ends of the chains and inserts the intersections with its line;
* as tau decreases, the levels turn in a constant direction, and the last vertices of each chain
  pass to the other one;
* the maximum predicted miss is at the peak of the right chain, the minimum at the peak of the left
  one. A peak changes only when a cut removes it.

A vertex is inserted once, changes chains once or twice and is removed once, so the cost of a step
is constant.

The left chain has the structure of the right one rotated by 180 degrees: the sign of its side times
the height increases along each chain. Each chain is a ring buffer. Edges along the level join its
ends to those of the other chain; their length is zero where the chains meet. `chain_storage`
contains the arrays of a batch of sections.
"""

from __future__ import annotations

import math
from typing import NamedTuple, Protocol

import numpy as np

from infoset._compile import FALSE, allocation_free, constants, inlined
from infoset.arrays import Floats
from infoset.geometry import polygon, polygon_reduction
from infoset.geometry.double_words import two_product, two_sum

EPSILON = float(np.finfo(np.float64).eps)
"""One ulp of 1. A coordinate of a vertex has an error of about one ulp of its terms, V tau and m;
where two of them are compared, 4 ulp allow for both, and for the two origins."""
CAPACITY = 256
"""Maximum number of vertices of a section, a power of two. The sections of a flight of 4 h with
10 000 steps have 110 vertices on average (docs/measured/performance.md). A section that would
exceed it is enlarged to `REDUCED` vertices."""
MAX_ADDED = 4
"""Maximum number of vertices that one step adds: two at each of its two turns."""
REDUCED = 160
"""Maximum number of vertices of a section after a reduction (`is_crowded`). Chosen: at least 24
steps pass before the next one."""
ZERO, ONE, TWO = constants(3)
FORWARD = ONE
BACKWARD = -ONE
"""Directions along a chain."""


class Chain(Protocol):
    """Record of a chain.

    Parameters
    ----------
    v, v_rest, m, m_rest : float
        Origin, m/s and m. Each coordinate is a sum of two floats, since it changes at every step
        and rounding errors must not accumulate.
    reach : float
        Bound of |V| over the section's history, m/s, to which rounding errors are relative; in the
        right chain only.
    begin, end, peak : int
        Number of the first vertex, one past that of the last, and that of the peak. They become
        negative if vertices are inserted before the first one.
    ring, mask : int
        Offset of the ring in `rings`, and the ring's size minus one. The size is a power of two,
        and a vertex is stored at its number modulo the size.
    """

    v: float
    v_rest: float
    m: float
    m_rest: float
    reach: float
    begin: int
    end: int
    peak: int
    ring: int
    mask: int


class SectionView(NamedTuple):
    """A section for kernels.

    Parameters
    ----------
    right, left : Chain
        Addresses of its chains.
    rings : ndarray
        Rings with the vertices of the chains of a batch.
    label : float
        Its label, m.
    """

    right: Chain
    left: Chain
    rings: Floats
    label: float


@inlined
def offset_of(chain: Chain, i: int) -> int:
    """Offset of a vertex in the rings."""
    return chain.ring + 2 * (i & chain.mask)


@inlined
def read(chain: Chain, rings: Floats, i: int) -> tuple[float, float]:
    """Return V and m of a vertex relative to the origin of its chain.

    Offsets are unsigned: the test for negative indices would take longer than the access.
    """
    at = offset_of(chain, i)
    return rings[np.uint64(at)], rings[np.uint64(at + 1)]


@inlined
def write(chain: Chain, rings: Floats, i: int, v: float, m: float) -> None:
    """Write a vertex relative to the origin of its chain."""
    at = offset_of(chain, i)
    rings[np.uint64(at)] = v
    rings[np.uint64(at + 1)] = m


@inlined
def number_vertices(chain: Chain, count: int) -> None:
    """Number the vertices of a chain from zero to `count` - 1; its peak is not known then."""
    chain.begin = 0
    chain.end = count
    chain.peak = 0


@inlined
def count_of(section: SectionView) -> int:
    """Number of vertices of both chains."""
    right = section.right
    left = section.left
    return (right.end - right.begin) + (left.end - left.begin)


@inlined
def height_in(chain: Chain, rings: Floats, i: int, tau: float) -> float:
    """Height of a vertex relative to the origin of its chain."""
    v, m = read(chain, rings, i)
    return m - tau * v


@inlined
def origin_height(chain: Chain, tau: float) -> float:
    """Height of the origin of a chain."""
    return (chain.m - tau * chain.v) + (chain.m_rest - tau * chain.v_rest)


@inlined
def vertex(chain: Chain, rings: Floats, i: int) -> tuple[float, float]:
    """Return V and m of a vertex."""
    v, m = read(chain, rings, i)
    return (v + chain.v_rest) + chain.v, (m + chain.m_rest) + chain.m


@inlined
def move(chain: Chain, v: float, m: float) -> None:
    """Add to the origin of a chain; the second float of each coordinate takes the rounding
    error.
    """
    chain.v, v_rest = two_sum(chain.v, v)
    chain.m, m_rest = two_sum(chain.m, m)
    chain.v_rest += v_rest
    chain.m_rest += m_rest


@inlined
def move_to_zero(chain: Chain) -> None:
    """Set the origin of a chain to zero."""
    chain.v = chain.v_rest = chain.m = chain.m_rest = 0.0


@allocation_free
def start(
    section: SectionView,
    tau: float,
    bottom: tuple[float, float, float],
    top: tuple[float, float, float],
) -> None:
    """Write a trapezium between two levels at time to go `tau`, s.

    `bottom` and `top` are the minimum V, the maximum V, m/s, and z, m, of each level.
    """
    right, left, rings, _ = section
    for chain in (right, left):
        move_to_zero(chain)
        number_vertices(chain, TWO)
    write(right, rings, ZERO, bottom[1], bottom[2] + tau * bottom[1])
    write(right, rings, ONE, top[1], top[2] + tau * top[1])
    write(left, rings, ZERO, top[0], top[2] + tau * top[0])
    write(left, rings, ONE, bottom[0], bottom[2] + tau * bottom[0])
    right.reach = max(abs(bottom[0]), abs(bottom[1]), abs(top[0]), abs(top[1]))


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
    """Move the vertices of a chain after its highest one to the front of the other chain, which
    gets a copy of the highest one too if that is above its first vertex.

    `sign` is 1 if the giver is the right chain, else -1: then the lowest vertex counts as the
    highest. `between` is the origin of the giver relative to the origin of the taker: V, m and
    height. `same` are the rounding errors of a difference of V, and of the difference of the
    heights of the origins.

    A decreasing time to go raises the right side, so only vertices whose predecessor is on the
    outer side are moved. Without a turn of the level, heights along it are equal to within
    rounding, and no vertex may be moved. Where both chains end in the same vertex, their copies
    differ only by rounding: moving it again would add a vertex at every second step.
    """
    first = giver.begin
    back = giver.end - 1
    front = taker.begin
    v, m = read(giver, rings, back)
    rise = sign * (m - tau * v)
    same_v = same[0]
    same_rise = same[1] + 4.0 * EPSILON * abs(m)
    between_v, between_m, between_height = between
    front_v, front_m = read(taker, rings, front)
    front_rise = sign * (front_m - tau * front_v)
    while True:
        if rise + sign * between_height > front_rise + same_rise:
            front -= 1
            front_v = v + between_v
            front_m = m + between_m
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
        v = before_v
        m = before_m
        rise = before_rise

    giver.end = back + 1
    taker.begin = front


@inlined
def turn(section: SectionView, tau: float) -> None:
    """Decrease the time to go to `tau`: the level turns, and the chains get new highest and lowest
    ends.
    """
    right, left, rings, _ = section
    # 2 ulp of the origins bound the rounding errors of `height` by m; those by V are in `same_v`.
    same_v = 4.0 * EPSILON * right.reach
    same_m = 2.0 * EPSILON * (abs(right.m) + abs(left.m))
    same = (same_v, same_m + tau * same_v)

    v = (right.v - left.v) + (right.v_rest - left.v_rest)
    m = (right.m - left.m) + (right.m_rest - left.m_rest)
    height = origin_height(right, tau) - origin_height(left, tau)
    hand_over(right, left, rings, 1.0, (v, m, height), same, tau)
    hand_over(left, right, rings, -1.0, (-v, -m, -height), same, tau)


@inlined
def spread(section: SectionView, tau: float, half_v: float) -> None:
    """Add the segment of V from -half_v to half_v, which is not negative, along the level of `tau`
    (Minkowski sum).
    """
    half_m = half_v * tau
    move(section.right, half_v, half_m)
    move(section.left, -half_v, -half_m)
    section.right.reach += half_v


@inlined
def shift(section: SectionView, tau: float, v: float) -> None:
    """Move a section by `v` along the level of `tau`: z is unchanged, the predicted miss changes by
    v tau.
    """
    m, rest = two_product(v, tau)
    for chain in (section.right, section.left):
        move(chain, v, m)
        chain.m_rest += rest
    section.right.reach += abs(v)


@inlined
def heights(section: SectionView, tau: float) -> tuple[float, float]:
    """Minimum and maximum z of a section at time to go `tau`."""
    right, left, rings, _ = section
    right_origin = origin_height(right, tau)
    left_origin = origin_height(left, tau)
    minimum = min(
        right_origin + height_in(right, rings, right.begin, tau),
        left_origin + height_in(left, rings, left.end - 1, tau),
    )
    maximum = max(
        right_origin + height_in(right, rings, right.end - 1, tau),
        left_origin + height_in(left, rings, left.begin, tau),
    )
    return minimum, maximum


@inlined
def cut_end(chain: Chain, rings: Floats, way: int, up: float, tau: float, level: float) -> int:
    """Remove the part of a chain above a level, and add a vertex at the intersection; return the
    number of this vertex, which is the new end.

    A chain that is not above the level is unchanged. Of a chain that is above it as a whole, only
    the other end is left, moved to the level with its V.

    `way` is the direction from the end that is cut: FORWARD from the first vertex, BACKWARD from
    the last one. With `up` = 1 greater z is removed, with -1 lesser z. `level` is `up` times the
    height of the level relative to the chain's origin, m.
    """
    end = chain.begin
    other_end = chain.end - 1
    if way == BACKWARD:
        end = chain.end - 1
        other_end = chain.begin
    v, m = read(chain, rings, end)
    height = up * (m - tau * v)
    if height <= level:
        return end

    while end != other_end:
        inner_v, inner_m = read(chain, rings, end + way)
        inner_height = up * (inner_m - tau * inner_v)
        if inner_height <= level:
            # Interpolated from the nearer end of the edge, for the minimum rounding error.
            if level - inner_height <= height - level:
                v = inner_v + (level - inner_height) / (height - inner_height) * (v - inner_v)
            else:
                v += (level - height) / (inner_height - height) * (inner_v - v)
            break
        v = inner_v
        height = inner_height
        end += way

    write(chain, rings, end, v, up * level + tau * v)
    return end


@inlined
def cut(section: SectionView, tau: float, lower: float, upper: float) -> tuple[bool, float]:
    """Intersect a section at time to go `tau` with the band lower <= z <= upper, the heights of the
    levels, m.

    Return whether it is not empty, and the smaller overlap of section and band at the two borders,
    m: minus their distance if they do not intersect. If the intersection is empty, the section is
    unchanged. A band with `lower` above `upper` is empty: that of a label behind x = 0, or beyond
    the range at which the error bound is zero. The overlap is then at most `upper` - `lower`.
    """
    right, left, rings, _ = section
    minimum, maximum = heights(section, tau)
    overlap = min(maximum - lower, upper - minimum)
    # With `<`: a section that only touches the band is not empty, and the true state may be there.
    if overlap < 0.0 or lower > upper:
        return False, min(overlap, upper - lower)

    right_height = origin_height(right, tau)
    left_height = origin_height(left, tau)
    if maximum > upper:
        right.end = cut_end(right, rings, BACKWARD, 1.0, tau, upper - right_height) + 1
        left.begin = cut_end(left, rings, FORWARD, 1.0, tau, upper - left_height)
    if minimum < lower:
        left.end = cut_end(left, rings, BACKWARD, -1.0, tau, left_height - lower) + 1
        right.begin = cut_end(right, rings, FORWARD, -1.0, tau, right_height - lower)
    return True, overlap


@inlined
def find_peak(chain: Chain, rings: Floats, sign: float, magnitude: float) -> int:
    """Return and store the number of the vertex with the maximum predicted miss in the right chain,
    the minimum one in the left chain.

    `sign` is 1 for the right chain, -1 for the left one. `magnitude` is the magnitude of the terms
    of the predicted misses, to which their rounding error is relative, m. The search starts at the
    previous peak and ends where the miss decreases by more than rounding, so that vertices that
    nearly coincide do not stop it. Of exactly equal misses the previous peak stays.
    """
    first = chain.begin
    last = chain.end - 1
    peak = min(max(chain.peak, first), last)
    miss = sign * read(chain, rings, peak)[1]
    # 16 ulp, as for a cut: more than the errors of two misses.
    rounding = 16.0 * EPSILON * (abs(miss) + magnitude)

    start_at = peak
    for way in (1, -1):
        i = start_at + way
        while first <= i <= last:
            here = sign * read(chain, rings, i)[1]
            if here > miss:
                peak = i
                miss = here
            elif here < miss - rounding:
                break
            i += way

    chain.peak = peak
    return peak


@inlined
def first_near_peak(chain: Chain, rings: Floats, sign: float, tolerance: float) -> int:
    """First vertex from which on the predicted miss equals the miss at the peak to within a
    tolerance.
    """
    i = chain.peak
    level = sign * read(chain, rings, i)[1] - tolerance
    while i > chain.begin and sign * read(chain, rings, i - 1)[1] >= level:
        i -= 1
    return i


@inlined
def max_and_min_miss(section: SectionView, tau: float) -> tuple[float, float]:
    """Return the maximum and the minimum predicted miss, m; store their vertices as peaks."""
    right, left, rings, _ = section
    # A miss is z + V tau; both terms may be far greater than the sum.
    reach = tau * right.reach
    _, upper = vertex(right, rings, find_peak(right, rings, 1.0, abs(right.m) + reach))
    _, lower = vertex(left, rings, find_peak(left, rings, -1.0, abs(left.m) + reach))
    return upper, lower


@allocation_free
def extreme_points(
    section: SectionView, tau: float, relative: float, slack: float
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return V and m of the lowest point with the maximum predicted miss, and of the highest point
    with the minimum one.

    `max_and_min_miss` must have stored the peaks. `relative` and `slack` are tolerances for equal
    misses, relative to the interval and to the magnitudes of the terms.
    """
    right, left, rings, _ = section
    upper_v, upper = vertex(right, rings, right.peak)
    lower_v, lower = vertex(left, rings, left.peak)
    magnitude = tau * (abs(upper_v) + abs(lower_v)) + abs(upper) + abs(lower)
    tolerance = relative * (upper - lower) + slack * magnitude

    upper_at = first_near_peak(right, rings, 1.0, tolerance)
    lower_at = first_near_peak(left, rings, -1.0, tolerance)
    return vertex(right, rings, upper_at), vertex(left, rings, lower_at)


@inlined
def vertex_from(
    chain: Chain, rings: Floats, i: int, tau: float, v: float, z: float
) -> tuple[float, float]:
    """Vertex of a chain relative to a state, in the plane of V x/e and z, m."""
    offset_v = tau * (chain.v - v + chain.v_rest)
    offset_z = origin_height(chain, tau) - z
    chain_v, chain_m = read(chain, rings, i)
    return tau * chain_v + offset_v, (chain_m - tau * chain_v) + offset_z


@allocation_free
def margin_in(section: SectionView, tau: float, v: float, z: float) -> float:
    """Signed distance of a state to the boundary of a section in the plane of V x/e and z, m;
    positive inside.
    """
    right, left, rings, _ = section
    last_v, last_m = vertex(left, rings, left.end - 1)
    rounded = (tau * (last_v - v), (last_m - tau * last_v) - z)
    end = vertex_from(left, rings, left.end - 1, tau, v, z)
    last = vertex_from(right, rings, right.begin, tau, v, z)

    # The edge between the chains: a start rounded to absolute coordinates may be beyond the state
    # in a section that is thinner than this rounding. The rounded start is used for the distance
    # only, which keeps the last digit of published margins.
    nearest, _ = polygon.pass_edge(np.inf, FALSE, rounded, last, 0.0, 0.0)
    _, inside = polygon.pass_edge(np.inf, FALSE, end, last, 0.0, 0.0)

    # The state is the point (0, 0), because the vertices are relative to it.
    for chain in (right, left):
        for i in range(chain.begin, chain.end):
            end = vertex_from(chain, rings, i, tau, v, z)
            nearest, inside = polygon.pass_edge(nearest, inside, last, end, 0.0, 0.0)
            last = end
    return math.sqrt(nearest) if inside else -math.sqrt(nearest)


@allocation_free
def outline(section: SectionView, tau: float, out: Floats) -> int:
    """Write the vertices (V, z), counter-clockwise; return their number, at most CAPACITY.

    A point in which the chains meet is stored in both, equal to within rounding. It is written
    once.
    """
    right, left, rings, _ = section
    made = ZERO
    for chain in (right, left):
        for i in range(chain.begin, chain.end):
            v, m = vertex(chain, rings, i)
            z = m - tau * v
            # Only the first vertex of the left chain can repeat the last one of the right chain.
            if i > chain.begin or made == 0 or not meets(out, made - 1, v, z, right.reach, tau):
                made = polygon.append(out, made, v, z)

    while made > 1 and meets(out, made - 1, out[0, 0], out[0, 1], right.reach, tau):
        made -= 1
    return made


@allocation_free
def meets(points: Floats, i: int, v: float, z: float, reach: float, tau: float) -> bool:
    """Whether a vertex equals (V, z) to within the rounding error of a change of chains.

    The terms of z = m - tau V are at most |z| + 2 tau `reach` in all, where `reach` bounds |V|.
    """
    close_v = abs(points[i, 0] - v) <= 4.0 * EPSILON * reach
    return bool(close_v and abs(points[i, 1] - z) <= 4.0 * EPSILON * (abs(z) + 2.0 * tau * reach))


@inlined
def is_crowded(section: SectionView) -> bool:
    """Whether the next step may increase the number of vertices beyond CAPACITY."""
    return count_of(section) > CAPACITY - MAX_ADDED


@allocation_free
def reduce_outward(section: SectionView, tau: float, points: Floats) -> None:
    """Enlarge a section to at most `REDUCED` vertices by removing edges of its longer chain.

    An edge is removed by extending its neighbours to their intersection; the edge that adds the
    minimum area is removed first. Vertices that are not convex because of rounding are removed
    before. If too few edges can be removed, three sides of a box around the chain replace it, along
    the level of the time to go `tau`. The peak of the chain is not known afterwards (`find_peak`).

    `points` is a working array (`working_room`): its first CAPACITY + 2 rows hold the chain, and
    the others, at least 2 CAPACITY, the tree of `drop_inner_edges`.
    """
    right, left, rings, _ = section
    in_right = right.end - right.begin
    in_left = left.end - left.begin
    longer = left
    sign = -1.0
    if in_right > in_left:
        longer = right
        sign = 1.0

    count = ZERO
    for i in range(longer.begin, longer.end):
        v, m = read(longer, rings, i)
        count = polygon.append(points, polygon_reduction.drop_turned(points, count, v, m), v, m)
    # The shorter chain has at most half of the vertices of a full section: 32 or more are left.
    most = REDUCED - min(in_right, in_left)
    count, done = polygon_reduction.drop_inner_edges(points, count, most, points[CAPACITY + 2 :])
    if not done:
        count = polygon_reduction.box_around(points, count, sign, tau)

    for i in range(count):
        write(longer, rings, i, points[i, 0], points[i, 1])
        # |V| of a new vertex may exceed the previous bound.
        v, _ = vertex(longer, rings, i)
        right.reach = max(right.reach, abs(v))
    number_vertices(longer, count)


@allocation_free
def cut_misses(
    section: SectionView, tau: float, lower: float, upper: float, points: Floats
) -> tuple[bool, float]:
    """Intersect a section with the band of predicted misses lower <= m <= upper.

    Return whether it is not empty, and the overlap in m, as `cut` does; an empty intersection
    leaves the section unchanged. This band is not parallel to the level, so that it may cut any
    edge: the chains are computed anew, and their peaks are not known then. O(vertices). `points`
    is a working array of CAPACITY + 2 vertices.
    """
    right, left, rings, _ = section
    count = ZERO
    for chain in (right, left):
        for i in range(chain.begin, chain.end):
            v, m = vertex(chain, rings, i)
            count = polygon.append(points, count, v, m)
    # Directions are factors of V and m: (0, 1) is the miss, and (-tau, 1) the height.
    count, overlap = polygon.clip_to_band(points, count, 0.0, 1.0, lower, upper)
    if count == 0:
        return False, overlap

    bottom, top = polygon.extremes(points, count, -tau, 1.0)
    thickness = polygon.height(points, top, -tau, 1.0) - polygon.height(points, bottom, -tau, 1.0)
    magnitude = abs(points[top, 1]) + abs(points[bottom, 1]) + tau * right.reach
    if thickness <= 16.0 * EPSILON * magnitude:
        # All heights are equal to within 16 ulp, the slack of a cut (`CUT_SLACK`): the section is a
        # segment along the level, and its vertices of extreme V are the ends of both chains.
        bottom, top = polygon.extremes(points, count, -1.0, 0.0)

    write_chain(right, rings, points, count, bottom, top)
    write_chain(left, rings, points, count, top, bottom)
    return True, overlap


@allocation_free
def write_chain(
    chain: Chain, rings: Floats, points: Floats, count: int, first: int, last: int
) -> None:
    """Write the vertices of a polygon from `first` to `last`, both included, counter-clockwise, as
    a chain; one vertex if they are equal.
    """
    length = (last - first) % count + 1
    for i in range(length):
        at = (first + i) % count
        write(chain, rings, i, points[at, 0], points[at, 1])
    move_to_zero(chain)
    number_vertices(chain, length)
