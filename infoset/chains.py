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

A batch of sections is stored in three arrays, `origins`, `rings` and `marks`; a kernel takes these and a row `n`,
because views of rows or tuples of arrays would cost more, by reference counting, than the operations themselves. Each
ring has the size that its own section needs, so that a step accesses compact memory.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from infoset._compile import allocation_free, constants, inlined, prefetch

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

EPSILON = float(np.finfo(np.float64).eps)

RIGHT, LEFT = constants(2)

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

# Marks of a chain: the number of its first vertex, one past that of the last, and that of the peak; then the offset of
# its ring, and the ring's size minus one. The size is a power of two, and a vertex is stored at its number modulo the
# size.
BEGIN, END, PEAK, RING, MASK = range(5)
MARKS = 5

# An origin is a sum of two floats, since it moves at every step and rounding errors must not accumulate. The origin of
# the right chain also contains a bound of |V| over the section's history, to which rounding errors are relative. The
# unused floats fill a cache line.
V_ORIGIN, V_REST, M_ORIGIN, M_REST, REACH = constants(5)
ORIGIN = 8

TAKEN = 0
"""Index in the rings of the number of floats in use; rings that were replaced remain in use."""
FIRST_RING = 8
LINE = 8
"""Floats in a cache line."""


class Chains(NamedTuple):
    """Chains of N sections.

    Parameters
    ----------
    origins : ndarray, shape (N, 2, ORIGIN)
        Origins of the chains, m/s and m.
    rings : ndarray, 1-D
        Vertices of all chains, each (V, m) relative to the origin of its chain.
    marks : ndarray of int, shape (N, 2, MARKS)
        Numbers of the first, last and peak vertex, and location of the ring.
    """

    origins: Floats
    rings: Floats
    marks: Integers


def empty_sections(number: int, room: int = CAPACITY) -> Chains:
    """Return empty chains with room for `room` vertices each, a power of two.

    The rings are allocated at their greatest size; the operating system provides memory when it is written.
    """
    marks = np.zeros((number, 2, MARKS), dtype=np.int64)
    marks[:, :, RING] = FIRST_RING + (2 * room + LINE) * np.arange(2 * number).reshape(number, 2)
    marks[:, :, MASK] = room - 1
    rings = np.empty(FIRST_RING + 8 * CAPACITY * number)
    rings[TAKEN] = FIRST_RING + 2 * (2 * room + LINE) * number
    return Chains(np.zeros((number, 2, ORIGIN)), rings, marks)


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
    return np.empty((2 * CAPACITY + 4, 2))


@inlined
def offset_in(ring: tuple[int, int], i: int) -> int:
    """Offset of a vertex in a ring, given as its offset and mask."""
    return ring[0] + 2 * (i & ring[1])


@inlined
def offset_of(marks: Integers, n: int, side: int, i: int) -> int:
    """Offset of a vertex of a chain in the rings."""
    return int(marks[n, side, RING] + 2 * (i & marks[n, side, MASK]))


@inlined
def read(rings: Floats, at: int) -> tuple[float, float]:
    """Return V and m at an offset in the rings, relative to the origin of the chain.

    Offsets are unsigned: the test for negative indices would take longer than the access.
    """
    return rings[np.uint64(at)], rings[np.uint64(at + 1)]


@inlined
def write(rings: Floats, at: int, v: float, m: float) -> None:
    """Write V and m at an offset in the rings."""
    rings[np.uint64(at)] = v
    rings[np.uint64(at + 1)] = m


@inlined
def begin_of(marks: Integers, n: int, side: int) -> int:
    """Number of the first vertex of a chain."""
    return int(marks[n, side, BEGIN])


@inlined
def end_of(marks: Integers, n: int, side: int) -> int:
    """One past the number of the last vertex of a chain."""
    return int(marks[n, side, END])


@inlined
def count_of(marks: Integers, n: int) -> int:
    """Number of vertices of both chains."""
    right, left = marks[n, RIGHT, END] - marks[n, RIGHT, BEGIN], marks[n, LEFT, END] - marks[n, LEFT, BEGIN]
    return int(right + left)


@inlined
def expect(rings: Floats, marks: Integers, n: int) -> None:
    """Prefetch the vertices of a section that the next step reads."""
    for side in (RIGHT, LEFT):
        prefetch(rings, offset_of(marks, n, side, begin_of(marks, n, side)))
        prefetch(rings, offset_of(marks, n, side, end_of(marks, n, side) - 1))
        prefetch(rings, offset_of(marks, n, side, marks[n, side, PEAK]))


@inlined
def room_of(marks: Integers, n: int) -> int:
    """Room of each chain of a section, in vertices."""
    return int(marks[n, RIGHT, MASK] + 1)


@allocation_free
def widen_rings(rings: Floats, marks: Integers, n: int, room: int) -> None:
    """Move both chains of a section to new rings of `room` vertices, a power of two, at the end of those in use."""
    for side in (RIGHT, LEFT):
        first = int(rings[TAKEN])
        rings[TAKEN] = first + floats_of(room)
        for i in range(begin_of(marks, n, side), end_of(marks, n, side)):
            v, m = read(rings, offset_of(marks, n, side, i))
            write(rings, offset_in((first, room - 1), i), v, m)
        marks[n, side, RING] = first
        marks[n, side, MASK] = room - 1


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
def sign_of(side: int) -> float:
    """Sign of the height's change along a chain: 1 for the right one, -1 for the left one."""
    return 1.0 - 2.0 * side


@inlined
def rise(rings: Floats, marks: Integers, n: int, side: int, i: int, tau: float) -> float:
    """Height of a vertex relative to the origin of its chain, times the sign of the side: increases along the chain."""
    v, m = read(rings, offset_of(marks, n, side, i))
    return float(sign_of(side) * (m - tau * v))


@inlined
def origin_height(origins: Floats, n: int, side: int, tau: float) -> float:
    """Height of the origin of a chain."""
    whole = origins[n, side, M_ORIGIN] - tau * origins[n, side, V_ORIGIN]
    return float(whole + (origins[n, side, M_REST] - tau * origins[n, side, V_REST]))


@inlined
def vertex(origins: Floats, rings: Floats, marks: Integers, n: int, side: int, i: int) -> tuple[float, float]:
    """Return V and m of a vertex."""
    v, m = read(rings, offset_of(marks, n, side, i))
    v = (v + origins[n, side, V_REST]) + origins[n, side, V_ORIGIN]
    m = (m + origins[n, side, M_REST]) + origins[n, side, M_ORIGIN]
    return v, m


@inlined
def put(rings: Floats, marks: Integers, n: int, side: int, i: int, v: float, m: float) -> None:
    """Write a vertex relative to the origin of its chain."""
    write(rings, offset_of(marks, n, side, i), v, m)


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
    """Copy a section to row `to` of other chains, whose rings must have enough unused room."""
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
            v, m = read(rings, offset_of(marks, n, side, i))
            put(to_rings, to_marks, to, side, i, v, m)
