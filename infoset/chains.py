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

from infoset._compile import allocation_free, constants, inlined, prefetch

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

EPSILON = float(np.finfo(np.float64).eps)

RIGHT, LEFT = constants(2)

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
V_ORIGIN, V_REST, M_ORIGIN, M_REST, REACH = constants(5)
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
        Origins of the right and of the left chain of each section.
    rings : ndarray, shape (any,)
        The vertices of all chains, each (V, m) from the origin of its chain.
    marks : ndarray of int, shape (N, 2, MARKS)
        First and last vertex, peak, and place in `rings` of each chain.
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


@inlined
def place_in(ring: tuple[int, int], i: int) -> int:
    """Where a ring, of which the first place and the mask are given, has a vertex."""
    return ring[0] + 2 * (i & ring[1])


@inlined
def place(marks: Integers, n: int, side: int, i: int) -> int:
    """Where the rings have a vertex of a chain."""
    return int(marks[n, side, RING] + 2 * (i & marks[n, side, MASK]))


@inlined
def read(rings: Floats, at: int) -> tuple[float, float]:
    """V and m at a place of the rings, from the origin of the chain.

    Places are unsigned: a signed index may count from the end, and to find out takes longer than to read.
    """
    return rings[np.uint64(at)], rings[np.uint64(at + 1)]


@inlined
def write(rings: Floats, at: int, v: float, m: float) -> None:
    """Write V and m at a place of the rings."""
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
    """Ask for the vertices of a section that a step reads: it comes next, and memory is slow."""
    for side in (RIGHT, LEFT):
        prefetch(rings, place(marks, n, side, begin_of(marks, n, side)))
        prefetch(rings, place(marks, n, side, end_of(marks, n, side) - 1))
        prefetch(rings, place(marks, n, side, marks[n, side, PEAK]))


@inlined
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
            v, m = read(rings, place(marks, n, side, i))
            write(rings, place_in((first, room - 1), i), v, m)
        marks[n, side, RING] = first
        marks[n, side, MASK] = room - 1


@inlined
def floats_of(room: int) -> int:
    """Floats that a ring takes: a line more than its vertices, lest all rings begin in the same lines of a cache."""
    return 2 * room + LINE


@inlined
def room_for(vertices: int, room: int) -> int:
    """Room that a chain needs for so many vertices, at least what it has: a power of two."""
    while room < vertices:
        room *= 2
    return room


@inlined
def sign_of(side: int) -> float:
    """The side from which a chain is seen to rise: 1 for the right one, -1 for the left one."""
    return 1.0 - 2.0 * side


@inlined
def rise(rings: Floats, marks: Integers, n: int, side: int, i: int, tau: float) -> float:
    """Height of a vertex over the origin of its chain, seen from the chain's own side: it rises along the chain."""
    v, m = read(rings, place(marks, n, side, i))
    return float(sign_of(side) * (m - tau * v))


@inlined
def origin_height(origins: Floats, n: int, side: int, tau: float) -> float:
    """Height of the origin of a chain."""
    whole = origins[n, side, M_ORIGIN] - tau * origins[n, side, V_ORIGIN]
    return float(whole + (origins[n, side, M_REST] - tau * origins[n, side, V_REST]))


@inlined
def vertex(origins: Floats, rings: Floats, marks: Integers, n: int, side: int, i: int) -> tuple[float, float]:
    """A vertex: V and m."""
    v, m = read(rings, place(marks, n, side, i))
    v = (v + origins[n, side, V_REST]) + origins[n, side, V_ORIGIN]
    m = (m + origins[n, side, M_REST]) + origins[n, side, M_ORIGIN]
    return v, m


@inlined
def put(rings: Floats, marks: Integers, n: int, side: int, i: int, v: float, m: float) -> None:
    """Write a vertex, from the origin of its chain."""
    write(rings, place(marks, n, side, i), v, m)


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
            v, m = read(rings, place(marks, n, side, i))
            put(to_rings, to_marks, to, side, i, v, m)
