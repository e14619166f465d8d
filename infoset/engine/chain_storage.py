"""Storage of the sections of a batch: records of chains and their rings, and the room that a
section needs.

A batch of sections is stored in two arrays, `records` and `rings`; kernels take the address of the
records of both chains, and the rings. Each ring has the size that its own section needs, so that a
step accesses compact memory.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from infoset._compile import ZERO, allocation_free, inlined, pasted, record_of
from infoset.arrays import Floats
from infoset.engine.chains import (
    CAPACITY,
    MAX_ADDED,
    Chain,
    SectionView,
    count_of,
    number_vertices,
    read,
    write,
)

ROOM_AT_START = 64
"""Initial room of a chain, in vertices, a power of two: enough for the 36 vertices that both chains
of a section have on average in a flight of 1000 steps (docs/measured/performance.md)."""
ROOM_AHEAD = 8 * MAX_ADDED
"""Additional room, in vertices, allocated when a section grows: the rooms of a batch are counted
once in eight steps, which makes an engagement 5 to 10 % faster (docs/measured/performance.md)."""

TAKEN = 0
"""Index in the rings of the number of floats in use; rings that were replaced remain in use."""
LINE = 8
"""Floats in a cache line of 64 bytes. A ring is one line longer than its vertices."""
FIRST_RING = LINE
"""Index in the rings of the first ring."""

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

    `number` is the number of sections, with two chains each. They take at most 8 CAPACITY floats a
    section: rings that were replaced remain, and both chains with rooms of 64, 128 and 256 vertices
    take 1840 floats of 2048. The operating system provides memory when it is written.
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
    """Return a copy of the rings with `size` floats, not fewer than are in use."""
    taken = int(rings[TAKEN])
    copy = np.empty(size)
    copy[:taken] = rings[:taken]
    return copy


def working_room() -> Floats:
    """Return the working array of the operations on whole chains.

    `chains.reduce_outward` needs most: CAPACITY + 2 rows for a chain, and 2 CAPACITY for a tree.
    """
    return np.empty((3 * CAPACITY + 2, 2))


@pasted
def view_of(chains: Chains, n: int, label: float) -> SectionView:
    """Return the view of section number `n`; the chains do not contain its label, m."""
    records = chains.records
    return SectionView(
        records[np.uint64(2 * n)], records[np.uint64(2 * n + 1)], chains.rings, label
    )


@inlined
def room_of(section: SectionView) -> int:
    """Room of each chain of a section, in vertices."""
    return section.right.mask + 1


@inlined
def room_for(vertices: int, room: int) -> int:
    """Room for `vertices` vertices, a power of two and at least `room`, which is one too."""
    while room < vertices:
        room *= 2
    return room


@inlined
def floats_of(room: int) -> int:
    """Floats of a ring: one cache line more than its vertices, because rings must not all start in
    the same cache lines.
    """
    return 2 * room + LINE


@allocation_free
def widen_rings(section: SectionView, room: int) -> None:
    """Move both chains of a section to new rings of `room` vertices, a power of two, after the
    rings in use.

    `with_room` must have made room for them. The old rings are not used again.
    """
    rings = section.rings
    for chain in (section.right, section.left):
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
def copy_section(chains: Chains, n: int, to_chains: Chains, to_n: int) -> None:
    """Copy section `n` to section `to_n` of other chains, whose rings must have enough unused
    room.
    """
    # Nothing here depends on the labels.
    section = view_of(chains, n, 0.0)
    to = view_of(to_chains, to_n, 0.0)
    # The target is emptied first: `widen_rings` would copy its old vertices.
    number_vertices(to.right, ZERO)
    number_vertices(to.left, ZERO)
    wanted = room_for(min(count_of(section) + ROOM_AHEAD, CAPACITY), room_of(to))
    if wanted > room_of(to):
        widen_rings(to, wanted)

    copy_chain(section.right, section.rings, to.right, to.rings)
    copy_chain(section.left, section.rings, to.left, to.rings)
