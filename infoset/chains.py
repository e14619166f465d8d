"""Storage of sections: convex polygons, each stored as two chains of vertices.

The coordinates are (V, m) with m = z + V tau, where tau is the time to go: m is the predicted miss, which is constant
in free motion, and z = m - tau V. The height of a vertex is z, and a level is a line of constant z. Cuts and
disturbances act relative to the levels: a cut removes the highest or the lowest part, and a disturbance moves the two
sides apart along the level. Therefore the boundary is stored as a RIGHT chain from the lowest vertex to the highest and
a LEFT chain from the highest vertex to the lowest:

* a disturbance moves each chain as a whole, an impulse moves both: only the origins of the chains change;
* a cut removes vertices from the ends of the chains and inserts the intersections with its line;
* as tau decreases, the levels turn in a constant direction, and the last vertices of each chain pass to the other one;
* the greatest predicted miss is at the peak of the right chain, the least at the peak of the left one. A peak changes
  only when a cut removes it.

A vertex is inserted once, changes chains once or twice and is removed once, so the cost of a step does not depend on
the number of vertices.

The left chain has the structure of the right one rotated by 180 degrees: the sign of its side times the height
increases along each chain. Each chain is a ring buffer. Edges along the level join its ends to those of the other
chain; their length is zero where the chains meet.

A batch of sections is stored in two arrays, `records` and `rings`; kernels take the address of the records of both
chains, and the rings. Each ring has the size that its own section needs, so that a step accesses compact memory.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from infoset._compile import ZERO, allocation_free, inlined, prefetch, record_of
from infoset.arrays import Floats

EPSILON = float(np.finfo(np.float64).eps)

CAPACITY = 256
"""Greatest number of vertices of a section, a power of two."""
ROOM_AT_START = 64
"""Initial room of a chain, in vertices, a power of two."""
MOST_ADDED = 4
"""Greatest number of vertices that one step adds: two at each of its two turns."""
ROOM_AHEAD = 8 * MOST_ADDED
"""Additional room, in vertices, allocated when a section grows."""
REDUCED = 160
"""Number of vertices to which a section of CAPACITY vertices is reduced."""

TAKEN = 0
"""Index in the rings of the number of floats in use; rings that were replaced remain in use."""
FIRST_RING = 8
LINE = 8
"""Floats in a cache line."""


class Chain(Protocol):
    """Record of a chain.

    Parameters
    ----------
    v, v_rest, m, m_rest : float
        Origin, m/s and m. Each coordinate is a sum of two floats, since it changes at every step and rounding errors
        must not accumulate.
    reach : float
        Bound of |V| over the section's history, m/s, to which rounding errors are relative; in the right chain only.
    begin, end, peak : int
        Number of the first vertex, one past that of the last, and that of the peak.
    ring, mask : int
        Offset of the ring in `rings`, and the ring's size minus one. The size is a power of two, and a vertex is stored
        at its number modulo the size.
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


Records = NDArray[np.record]


class Chains(NamedTuple):
    """Chains of N sections.

    Parameters
    ----------
    records : ndarray of `Chain`, shape (2 N,)
        The right and the left chain of each section.
    rings : ndarray, 1-D
        Vertices of all chains, each (V, m) relative to the origin of its chain.
    """

    records: Records
    rings: Floats


def empty_sections(number: int, room: int = CAPACITY) -> Chains:
    """Return empty chains with room for `room` vertices each, a power of two.

    The rings are allocated at their greatest size; the operating system provides memory when it is written.
    """
    records = np.zeros(2 * number, dtype=record_of(Chain))
    records["ring"] = FIRST_RING + (2 * room + LINE) * np.arange(2 * number)
    records["mask"] = room - 1
    rings = np.empty(FIRST_RING + 8 * CAPACITY * number)
    rings[TAKEN] = FIRST_RING + 2 * (2 * room + LINE) * number
    return Chains(records, rings)


def with_room(rings: Floats, floats: int) -> Floats:
    """Return rings with room for `floats` more floats: the same array if it has the room."""
    taken = int(rings[TAKEN])
    if taken + floats <= rings.size:
        return rings
    return copy_of_rings(rings, max(taken + floats, 2 * rings.size))


def copy_of_rings(rings: Floats, size: int) -> Floats:
    """Return a copy of the rings with `size` floats."""
    taken = int(rings[TAKEN])
    copy = np.empty(size)
    copy[:taken] = rings[:taken]
    return copy


def working_room() -> Floats:
    """Return the working array of the operations on whole chains."""
    return np.empty((3 * CAPACITY + 4, 2))


@inlined
def chains_of(records: Records, n: int) -> tuple[Chain, Chain]:
    """Return the right and the left chain of a section."""
    return records[np.uint64(2 * n)], records[np.uint64(2 * n + 1)]


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
    """Note that a chain consists of `count` vertices, numbered from zero, and that its peak is not known."""
    chain.begin = 0
    chain.end = count
    chain.peak = 0


@inlined
def count_of(right: Chain, left: Chain) -> int:
    """Number of vertices of both chains."""
    return (right.end - right.begin) + (left.end - left.begin)


@inlined
def expect(right: Chain, left: Chain, rings: Floats) -> None:
    """Prefetch the vertices of a section that the next step reads."""
    for chain in (right, left):
        prefetch(rings, offset_of(chain, chain.begin))
        prefetch(rings, offset_of(chain, chain.end - 1))
        prefetch(rings, offset_of(chain, chain.peak))


@inlined
def room_of(right: Chain) -> int:
    """Room of each chain of a section, in vertices."""
    return right.mask + 1


@allocation_free
def widen_rings(right: Chain, left: Chain, rings: Floats, room: int) -> None:
    """Move both chains of a section to new rings of `room` vertices, a power of two, at the end of those in use."""
    for chain in (right, left):
        first = int(rings[TAKEN])
        rings[TAKEN] = first + floats_of(room)
        for i in range(chain.begin, chain.end):
            v, m = read(chain, rings, i)
            at = first + 2 * (i & (room - 1))
            rings[np.uint64(at)] = v
            rings[np.uint64(at + 1)] = m
        chain.ring = first
        chain.mask = room - 1


@inlined
def floats_of(room: int) -> int:
    """Floats of a ring. One cache line more than its vertices: rings must not all start in the same cache lines."""
    return 2 * room + LINE


@inlined
def room_for(vertices: int, room: int) -> int:
    """Room for `vertices` vertices, a power of two and at least `room`."""
    while room < vertices:
        room *= 2
    return room


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
def copy_chain(chain: Chain, rings: Floats, to: Chain, to_rings: Floats) -> None:
    """Copy a chain to another one, whose ring must have enough room."""
    to.v = chain.v
    to.v_rest = chain.v_rest
    to.m = chain.m
    to.m_rest = chain.m_rest
    to.reach = chain.reach
    to.begin = chain.begin
    to.end = chain.end
    to.peak = chain.peak
    for i in range(chain.begin, chain.end):
        v, m = read(chain, rings, i)
        write(to, to_rings, i, v, m)


@allocation_free
def copy_section(records: Records, rings: Floats, n: int, to_records: Records, to_rings: Floats, to: int) -> None:
    """Copy a section to section `to` of other chains, whose rings must have enough unused room."""
    right, left = chains_of(records, n)
    to_right, to_left = chains_of(to_records, to)
    number_vertices(to_right, ZERO)
    number_vertices(to_left, ZERO)
    wanted = room_for(min(count_of(right, left) + ROOM_AHEAD, CAPACITY), room_of(to_right))
    if wanted > room_of(to_right):
        widen_rings(to_right, to_left, to_rings, wanted)
    copy_chain(right, rings, to_right, to_rings)
    copy_chain(left, rings, to_left, to_rings)
