"""Compiled operations on all vertices of a section: outline, reduction, cut by a band of the predicted miss."""

from __future__ import annotations

from infoset import polygon, polygon_hull
from infoset._compile import ZERO, allocation_free, inlined
from infoset.arrays import Floats
from infoset.chain_steps import move_to_zero
from infoset.chains import CAPACITY, EPSILON, MOST_ADDED, REDUCED, Chain, count_of, number_vertices, read, vertex, write


@inlined
def is_crowded(right: Chain, left: Chain) -> bool:
    """Whether the next step may increase the number of vertices beyond CAPACITY."""
    return count_of(right, left) > CAPACITY - MOST_ADDED


@allocation_free
def reduce_outward(right: Chain, left: Chain, rings: Floats, tau: float, points: Floats) -> None:
    """Enlarge a section by removing edges of the longer chain until it has `REDUCED` vertices.

    An edge is removed by extending its neighbours to their intersection; the edge that adds the least area is removed
    first. Vertices that are not convex because of rounding are removed before. If no edge can be removed, three sides
    of a box around the chain replace it. `points`, shape (3 CAPACITY + 4, 2), is a working array.
    """
    in_right, in_left = right.end - right.begin, left.end - left.begin
    longer, sign = (right, 1.0) if in_right > in_left else (left, -1.0)
    count = ZERO
    for i in range(longer.begin, longer.end):
        v, m = read(longer, rings, i)
        count = polygon.append(points, polygon_hull.drop_turned(points, count, 1, v, m), v, m)
    most = REDUCED - min(in_right, in_left)
    count, done = polygon_hull.drop_inner_edges(points, count, most, points[CAPACITY + 2 :])
    if not done:
        count = box_around(points, count, sign, tau)
    for i in range(count):
        write(longer, rings, i, points[i, 0], points[i, 1])
        # |V| of a new vertex may exceed the previous bound.
        v, _ = vertex(longer, rings, i)
        right.reach = max(right.reach, abs(v))
    number_vertices(longer, count)


@allocation_free
def box_around(points: Floats, count: int, sign: float, tau: float) -> int:
    """Replace a chain by three sides of a box: from its ends along the level to the outermost vertex."""
    first_v, first_m, last_v, last_m = points[0, 0], points[0, 1], points[count - 1, 0], points[count - 1, 1]
    outermost = sign * first_v
    for i in range(count):
        outermost = max(outermost, sign * points[i, 0])
    out = sign * (outermost - min(sign * first_v, sign * last_v))
    points[1, 0], points[1, 1] = first_v + out, first_m + out * tau
    points[2, 0], points[2, 1] = last_v + out, last_m + out * tau
    points[3, 0], points[3, 1] = last_v, last_m
    return 4


@allocation_free
def outline(right: Chain, left: Chain, rings: Floats, tau: float, out: Floats) -> int:
    """Write the vertices (V, z), counter-clockwise; return their number, at most CAPACITY.

    A point in which the chains meet is stored in both, equal to within rounding. It is written once.
    """
    made = ZERO
    for chain in (right, left):
        for i in range(chain.begin, chain.end):
            v, m = vertex(chain, rings, i)
            z = m - tau * v
            if i > chain.begin or made == 0 or not meets(out, made - 1, v, z, right.reach, tau):
                made = polygon.append(out, made, v, z)
    while made > 1 and meets(out, made - 1, out[0, 0], out[0, 1], right.reach, tau):
        made -= 1
    return made


@allocation_free
def meets(points: Floats, i: int, v: float, z: float, reach: float, tau: float) -> bool:
    """Whether a vertex equals (V, z) to within the rounding error of a change of chains."""
    close_v = abs(points[i, 0] - v) <= 4.0 * EPSILON * reach
    return bool(close_v and abs(points[i, 1] - z) <= 4.0 * EPSILON * (abs(z) + 2.0 * tau * reach))


@allocation_free
def cut_misses(
    right: Chain,
    left: Chain,
    rings: Floats,
    tau: float,
    tilt: float,
    lower: float,
    upper: float,
    points: Floats,
) -> tuple[bool, float]:
    """Intersect a section with the band lower <= m + V tilt <= upper; returns are those of `chain_steps.cut`.

    This band is not parallel to the level, so that it may cut any edge: the chains are computed anew. O(vertices).
    `points` is a working array of CAPACITY + 2 vertices.
    """
    count = ZERO
    for chain in (right, left):
        for i in range(chain.begin, chain.end):
            v, m = vertex(chain, rings, i)
            count = polygon.append(points, count, v, m)
    count, overlap = polygon.clip_to_band(points, count, tilt, 1.0, lower, upper)
    if count == 0:
        return False, overlap
    bottom, top = polygon.extremes(points, count, -tau, 1.0)
    thickness = polygon.height(points, top, -tau, 1.0) - polygon.height(points, bottom, -tau, 1.0)
    if thickness <= 16.0 * EPSILON * (abs(points[top, 1]) + abs(points[bottom, 1]) + tau * right.reach):
        # All heights are equal to within rounding: the vertices of extreme V are the ends of both chains.
        bottom, top = polygon.extremes(points, count, -1.0, 0.0)
    write_chain(right, rings, points, count, bottom, top)
    write_chain(left, rings, points, count, top, bottom)
    return True, overlap


@allocation_free
def write_chain(chain: Chain, rings: Floats, points: Floats, count: int, first: int, last: int) -> None:
    """Write the vertices of a polygon from one to another, counter-clockwise, as a chain."""
    length = (last - first) % count + 1
    for i in range(length):
        at = (first + i) % count
        write(chain, rings, i, points[at, 0], points[at, 1])
    move_to_zero(chain)
    number_vertices(chain, length)
