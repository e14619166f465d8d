"""Outer approximations of polytopes by few of their facets."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from infoset.arrays import Flags, Floats
from infoset.geometry.polytope import construction
from infoset.geometry.polytope import double_description as dd
from infoset.geometry.polytope.arrays import PolytopeArrays
from infoset.geometry.polytope.incidence import Bits, unpacked
from infoset.geometry.tolerances import ON
from infoset.kernels import Kernels

# Unlike other kernels of sets, which need the bits of each operation: here rounding decides only
# which facets are used, and `construction.settled` checks the result.
_kernels = Kernels("contract", "nnan", "nsz")


def reduced_outward(polytope: PolytopeArrays, cap: int, max_vertices: int) -> PolytopeArrays:
    """Return a set that contains a polytope with an interior, with few facets and vertices.

    It has at most `cap` (>= 2n) facets and `max_vertices` (>= 2^n) vertices. It starts with the
    bounding box, so that all widths are exact, and is cut by the facet beyond which it extends
    most, relative to the width along its normal.
    """
    points, facets, incidence = _cut_by_worst(polytope.points, polytope.facets, cap, max_vertices)
    outer = replace(polytope, points=points, facets=facets, incidence=incidence)
    found = construction.settled(outer, 2 * polytope.space)
    if found is None:
        # The check fails less often with fewer facets, and not for the box.
        return reduced_outward(polytope, cap // 2, max_vertices)
    return found


@_kernels.compiled
def _cut_by_worst(
    points: Floats, facets: Floats, cap: int, max_vertices: int
) -> tuple[Floats, Floats, Flags]:
    """Return points, facets and incidence of a box around a set, cut by facets of the set.

    The result has at most `cap` facets and `max_vertices` vertices. The excess of a facet only
    decreases, so that an excess of an earlier round is an upper bound: only the greatest one is
    computed again.
    """
    f = len(facets)
    n = points.shape[1]
    # The box has the first 2 n rows; each cut adds one, and at most `cap` are added.
    number = 2 * n
    sides = np.zeros((number + min(f, cap), n + 1))
    rays = np.ones((2**n, n + 1))
    bits = np.zeros((2**n, len(sides) // 64 + 1), np.uint64)
    _write_box(points, sides, rays, bits)

    columns = np.ascontiguousarray(rays.T)
    turned = np.ascontiguousarray(-points.T)
    # The support along the normal plus that along its opposite; ON keeps the divisor positive.
    widths = np.array([max(facets[i, n] + _highest(turned, facets[i]), ON) for i in range(f)])
    excess = np.full(f, np.inf)
    round_of = np.zeros(f, np.int64)
    row = np.empty(n + 1)
    while number < len(sides):
        worst = int(np.argmax(excess))
        facet = facets[worst]
        if round_of[worst] < number:
            excess[worst] = (_highest(columns[:n], facet) - facet[n]) / widths[worst]
            round_of[worst] = number
            continue
        if excess[worst] <= ON:
            break

        row[:n] = -facet[:n]
        row[n] = facet[n]
        cut, cut_bits = dd.insert(rays, bits, row, number, n - 1, np.bool_(True))
        if len(cut) > max_vertices:
            break
        # A cut can make facets redundant, so that the cap may allow it. A facet has at least n
        # vertices.
        if number >= cap and _count_sides(cut_bits, number + 1, n) > cap:
            break
        rays = cut
        bits = cut_bits
        columns = np.ascontiguousarray(cut.T)
        sides[number] = facet
        excess[worst] = -np.inf  # it is not chosen again
        number += 1
    return rays[:, :n].copy(), sides[:number], unpacked(bits, number)


@_kernels.allocation_free
def _write_box(points: Floats, sides: Floats, rays: Floats, bits: Bits) -> None:
    """Write the 2 n sides of the bounding box of points, its vertices, and their bits.

    `points` has the shape (N, n). `sides`, which contains zeros, gets rows (a, b) with a . y <= b:
    row j for the maximum of coordinate j, row n + j for its minimum. `rays`, which contains ones,
    gets the vertices as in double description: vertex k has the minimum of coordinate j if bit j of
    k is set. Its entry is b or -b. Bit i of a vertex in `bits`: it lies on row i. All 2 n bits must
    be in word 0, so 2 n is at most 64.
    """
    n = points.shape[1]
    for j in range(n):
        # Methods such as `max` of an array allocate memory, which this kernel cannot.
        highest = points[0, j]
        lowest = points[0, j]
        for i in range(1, len(points)):
            highest = max(highest, points[i, j])
            lowest = min(lowest, points[i, j])

        sides[j, j] = 1.0
        sides[j, n] = highest
        sides[n + j, j] = -1.0
        sides[n + j, n] = -lowest
        for k in range(2**n):
            side = j + n * (k >> j & 1)
            rays[k, j] = sides[side, j] * sides[side, n]
            bits[k, 0] |= np.uint64(1) << np.uint64(side)


@_kernels.compiled
def _highest(columns: Floats, facet: Floats) -> float:
    """Return the maximum of a . y over the points y in columns."""
    heights = np.zeros(columns.shape[1])
    for j in range(len(columns)):
        # In this order of the loops several points are added at once.
        for k in range(len(heights)):
            heights[k] += facet[j] * columns[j, k]
    highest = -np.inf
    for height in heights:
        highest = max(highest, height)
    return highest


@_kernels.compiled
def _count_sides(bits: Bits, rows: int, least: int) -> int:
    """Return the number of rows with at least `least` rays."""
    counts = np.zeros(rows, np.int64)
    for i in range(len(bits)):
        for row in range(rows):
            counts[row] += int((bits[i, row // 64] >> np.uint64(row % 64)) & np.uint64(1))
    return int((counts >= least).sum())
