"""Outer approximations of polytopes by few of their facets."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import TypeVar

import numpy as np

from infoset.arrays import Floats, Integers
from infoset.geometry.polytope import double_description as dd
from infoset.geometry.polytope.arrays import PolytopeArrays
from infoset.geometry.polytope.errors import UncertainHullError
from infoset.kernels import Kernels

Shape = TypeVar("Shape", bound=PolytopeArrays)
_kernels = Kernels()


def reduced_outward(polytope: Shape, cap: int, max_vertices: int) -> Shape:
    """Return a set that contains a polytope with an interior, with at most `cap` facets and `max_vertices` vertices.

    It starts with the bounding box, so that all widths are exact, and is cut by the facet beyond which it extends most,
    relative to the width along its normal.
    """
    space = polytope.space
    lower, upper = polytope.points.min(axis=0), polytope.points.max(axis=0)
    unit = np.eye(space)
    box = np.column_stack([np.vstack([unit, -unit]), np.concatenate([upper, -lower])])
    high = np.array(list(itertools.product([False, True], repeat=space)))
    corners = np.column_stack([np.where(high, upper, lower), np.ones(len(high))])
    bits = dd.packed(np.hstack([high, ~high, np.zeros((len(high), len(polytope.facets)), bool)]))
    rays, bits, chosen = _cut_by_worst(corners, bits, polytope.points, polytope.facets, cap, max_vertices)
    sides = np.vstack([box, polytope.facets[chosen]])
    outer = replace(polytope, points=rays[:, :-1].copy(), facets=sides, incidence=dd.unpacked(bits, len(sides)))
    try:
        return outer._reduced(2 * space)
    except UncertainHullError:  # at last it is the bounding box
        return reduced_outward(polytope, cap // 2, max_vertices)


@_kernels.compiled
def _cut_by_worst(
    rays: Floats, bits: dd.Bits, points: Floats, facets: Floats, cap: int, max_vertices: int
) -> tuple[Floats, dd.Bits, Integers]:
    """Return the vertices (y, 1) of a box that is cut by facets, their bits, and the numbers of these facets.

    The excess of a facet only decreases, so that one of an earlier round is an upper bound: only the greatest one is
    computed again.
    """
    f, n = len(facets), points.shape[1]
    widths, excess, round_of = np.empty(f), np.empty(f), np.full(f, -1)
    for i in range(f):
        highest, lowest = -np.inf, np.inf
        for k in range(len(points)):
            height = 0.0
            for j in range(n):
                height += facets[i, j] * points[k, j]
            highest, lowest = max(highest, height), min(lowest, height)
        widths[i] = max(highest - lowest, dd.ON)
        excess[i] = np.inf
    chosen, count = np.empty(f, np.int64), 0
    while count < f:
        worst = int(np.argmax(excess))
        if round_of[worst] < count:
            highest = -np.inf
            for k in range(len(rays)):
                height = -facets[worst, n]
                for j in range(n):
                    height += facets[worst, j] * rays[k, j]
                highest = max(highest, height)
            excess[worst], round_of[worst] = highest / widths[worst], count
            continue
        if excess[worst] <= dd.ON:
            break
        row = np.empty(n + 1)
        row[:n], row[n] = -facets[worst, :n], facets[worst, n]
        affine = n > 0  # Numba would compile `insert` again for the constant True
        cut, cut_bits = dd.insert(rays, bits, row, 2 * n + count, n - 1, affine)
        if len(cut) > max_vertices or (2 * n + count >= cap and _sides(cut_bits, 2 * n + count + 1, n) > cap):
            break
        rays, bits = cut, cut_bits
        chosen[count] = worst
        excess[worst] = -np.inf
        count += 1
    return rays, bits, chosen[:count]


@_kernels.compiled
def _sides(bits: dd.Bits, rows: int, least: int) -> int:
    """Return the number of rows with at least `least` rays."""
    counts = np.zeros(rows, np.int64)
    for i in range(len(bits)):
        for row in range(rows):
            counts[row] += int((bits[i, row // 64] >> np.uint64(row % 64)) & np.uint64(1))
    return int((counts >= least).sum())
