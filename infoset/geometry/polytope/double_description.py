"""Polytopes of full dimension by vertices, facets and their incidence: cuts and sums without a hull.

A cut makes new vertices on edges, and the Minkowski sum with a segment makes new facets on ridges; edges and ridges
follow from the incidence. Each new vertex is an interpolation between two others, so that the result is exact to a few
ulp, where a hull merges points that are nearer than 1e-10. Tolerances do not depend on the units of the coordinates:
they are relative to the terms of a scalar product, or to the sizes of the set along the axes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from infoset.arrays import Flags, Floats, Integers
from infoset.geometry.polytope._scaling import powers_of_two
from infoset.geometry.polytope.polytope import Polytope

EPSILON = float(np.finfo(np.float64).eps)
_ON = 64.0 * EPSILON
"""Distance of a vertex from a plane that contains it, relative to the terms of the distance."""
_THIN = 3e-8
"""Minimum thickness of a set, relative to its coordinates."""
_ENTRIES = 20_000_000
"""Maximum size of a working array."""
_PARALLEL = 1e-14
_INCIDENT = 1e-8
_SINGULAR = 1e-6
"""Minimum singular value of a matrix, relative to the largest one, with which facets are mapped."""
_HULL = 1e-8
"""Enlargement of a hull, relative to the size of the set along each axis: it may have merged points."""
_ROUNDED = 1e-13
"""Depth of a facet, relative to the terms of normal . x, below which rounding errors determine the set."""
_WIDENED = 1e-12
"""Widening of such a set, relative to its coordinates."""


@dataclass(frozen=True, eq=False)
class FacetsAndVertices:
    """A polytope of full dimension n that is not empty: v vertices, and f facets normal . x <= offset.

    No vertex is redundant, and the normals have unit length. `incidence`, shape (v, f), is whether a vertex lies on a
    facet.
    """

    vertices: Floats
    normals: Floats
    offsets: Floats
    incidence: Flags

    @classmethod
    def of(cls, polytope: Polytope, sizes: Floats | float = 0.0) -> FacetsAndVertices:
        """Return a polytope; a flat one is widened by 3e-8 of its maximum coordinates, or of `sizes`, shape (n,)."""
        vertices, normals = polytope.vertices, polytope.normals
        depth = (heights := vertices @ normals.T).max(axis=0) - heights
        incidence, offsets = depth <= _INCIDENT * depth.max(axis=0), heights.max(axis=0)
        sizes = np.maximum(np.abs(vertices).max(axis=0), sizes)
        for row, level in zip(polytope.across, polytope.levels, strict=True):
            # Where the coordinates are rounding errors, the layer is thicker than these.
            rounding = float(np.abs(vertices @ row - level).max())
            half = max(_THIN * float(np.abs(row) @ sizes), rounding / _THIN) or _THIN
            along = half * row / (row @ row)
            above = np.repeat([False, True], len(vertices))
            vertices = np.vstack([vertices - along, vertices + along])
            normals, offsets = np.vstack([normals, row, -row]), np.append(offsets, [level + half, half - level])
            incidence = np.column_stack([np.vstack([incidence, incidence]), above, ~above])
        return cls(vertices, normals, offsets, incidence)

    @property
    def polytope(self) -> Polytope:
        """The same set as a `Polytope`."""
        size = self.vertices.shape[1]
        return Polytope(self.vertices, self.normals, self.offsets, np.zeros((0, size)), np.zeros(0))

    def enlarged(self, slack: float, sizes: Floats | float = 0.0) -> FacetsAndVertices:
        """Return the set scaled about its centre, so that each facet moves outward by at least `slack` ulp.

        The ulp is that of the terms of normal . x, in which x has the maximum coordinates of the set or `sizes`, shape
        (n,), if these are greater. A set about as thin as rounding errors is widened by 1e-12 of these coordinates.
        """
        sizes = np.maximum(np.abs(self.vertices).max(axis=0), sizes)
        depths, terms = self._depths, np.abs(self.normals) @ sizes
        if (depths < _ROUNDED * terms).any():
            wide = self
            for half in np.diag(_WIDENED * sizes):
                wide = wide.plus_segment(half)
            return wide
        return self._scaled(1.0 + slack * EPSILON * (1.0 + float((terms / depths).max())))

    @property
    def _depths(self) -> Floats:
        """Distances of the facets from the mean of the vertices, shape (f,)."""
        return np.asarray(self.offsets - self.normals @ self.vertices.mean(axis=0))

    def _scaled(self, factor: float) -> FacetsAndVertices:
        """Return the set scaled about the mean of its vertices."""
        centre = self.vertices.mean(axis=0)
        offsets = self.normals @ centre + factor * self._depths
        return FacetsAndVertices(centre + factor * (self.vertices - centre), self.normals, offsets, self.incidence)

    def affine_image(self, matrix: Floats, shift: Floats) -> FacetsAndVertices:
        """Return {matrix x + shift}; the image under a singular matrix is widened by 1e-6 of its size."""
        before = np.abs(self.vertices).max(axis=0)
        before = powers_of_two(np.where(before > 0.0, before, 1.0))
        after = np.abs(matrix) @ before
        after = powers_of_two(np.where(after > 0.0, after, before))
        left, sizes, right = np.linalg.svd(matrix * before / after[:, None])
        floor = _SINGULAR * (float(sizes[0]) or 1.0)
        small = sizes < floor
        start = self
        if small.any():
            # A regular matrix, and segments that contain the difference of both images. They are added before the map:
            # it makes the set so thin that rounding decides which facets the segments are parallel to.
            reach = np.abs((self.vertices / before) @ right[small].T).max(axis=0)
            lengths = np.maximum(reach, _THIN * float(np.abs(self.vertices / before).max()))
            for axis, length in zip(right[small], lengths, strict=True):
                start = start.plus_segment(length * axis * before)
            matrix = (left * np.maximum(sizes, floor)) @ right * after[:, None] / before
        vertices = start.vertices @ matrix.T + shift
        scaled = matrix * before / after[:, None]
        normals = np.array(np.linalg.solve(scaled.T, (start.normals * before).T).T, dtype=np.float64) / after
        normals /= np.sqrt((normals**2).sum(axis=1))[:, None]
        # The offsets follow from the vertices, so that rounding errors of both do not add up over many steps.
        return FacetsAndVertices(vertices, normals, (vertices @ normals.T).max(axis=0), start.incidence)

    def plus(self, other: Polytope) -> FacetsAndVertices:
        """Return the Minkowski sum with a polytope: a hull, enlarged by 1e-8 of its size."""
        scale = powers_of_two(np.ptp(self.vertices, axis=0))
        sums = (self.vertices[:, None, :] + other.vertices).reshape(-1, len(scale)) / scale
        hull = FacetsAndVertices.of(Polytope.from_vertices(sums))._scaled(1.0 + _HULL)
        return hull.in_units(scale)

    def in_units(self, scale: Floats) -> FacetsAndVertices:
        """Return the set whose coordinates are those of this one times powers of two, shape (n,): exact."""
        normals = self.normals / scale
        lengths = np.sqrt((normals**2).sum(axis=1))
        return FacetsAndVertices(
            self.vertices * scale, normals / lengths[:, None], self.offsets / lengths, self.incidence
        )

    def plus_segment(self, half: Floats) -> FacetsAndVertices:
        """Return the Minkowski sum with the segment from -half to +half.

        Each facet moves, and each ridge between two facets that face opposite ends of the segment becomes a facet.
        """
        if not half.any():
            return self
        along, widths = self.normals @ half, np.ptp(self.vertices, axis=0) + np.abs(half)
        share = half / np.where(widths > 0.0, widths, 1.0)
        rounding = _PARALLEL * np.linalg.norm(share) * np.linalg.norm(self.normals * widths, axis=1)
        ahead, behind = along > rounding, along < -rounding
        opposite = np.flatnonzero(behind) if len(half) > 1 else np.zeros(0, dtype=np.int64)  # an interval has no ridges
        first, second, common = _adjacent(self.incidence.T, np.flatnonzero(ahead), opposite, len(half))
        weight, other = -along[second], along[first]
        normals = weight[:, None] * self.normals[first] + other[:, None] * self.normals[second]
        lengths = np.linalg.norm(normals, axis=1)
        offsets = (weight * self.offsets[first] + other * self.offsets[second]) / lengths
        upper, lower = self.incidence[:, ahead].any(axis=1), self.incidence[:, behind].any(axis=1)
        incidence = np.hstack([self.incidence, common.T])
        new = np.zeros(len(first), dtype=bool)
        on_upper, on_lower = np.concatenate([~behind, ~new]), np.concatenate([~ahead, ~new])
        return FacetsAndVertices(
            np.vstack([self.vertices[upper] + half, self.vertices[lower] - half]),
            np.vstack([self.normals, normals / lengths[:, None]]),
            np.concatenate([self.offsets + np.abs(along), offsets]),
            np.vstack([incidence[upper] & on_upper, incidence[lower] & on_lower]),
        )

    def cut(self, normal: Floats, offset: float) -> tuple[FacetsAndVertices | None, float]:
        """Return the part with normal . x <= offset, None if it is empty, and the excess of the lowest vertex."""
        height = self.vertices @ normal - offset
        lowest = float(height.min())
        on = _ON * (np.abs(self.vertices) @ np.abs(normal) + abs(offset))
        above, below = height > on, height < -on
        if not above.any():
            return self, lowest
        if lowest > 0.0:
            return None, lowest
        thin = _THIN * float(on.max()) / _ON
        if lowest > -0.5 * thin:  # the plane touches the set: keep a layer that is thicker than rounding errors
            return self.cut(normal, offset + lowest + thin)[0], lowest
        first, second, common = _adjacent(self.incidence, np.flatnonzero(above), np.flatnonzero(below), len(normal))
        share = height[first] / (height[first] - height[second])
        new = self.vertices[first] + share[:, None] * (self.vertices[second] - self.vertices[first])
        kept = ~above
        vertices = np.vstack([self.vertices[kept], new])
        on_new = np.concatenate([~below[kept], np.ones(len(new), dtype=bool)])
        incidence = np.column_stack([np.vstack([self.incidence[kept], common]), on_new])
        length = float(np.linalg.norm(normal))
        normals = np.vstack([self.normals, normal / length])
        offsets = np.append(self.offsets, offset / length)
        facets = _facets(incidence, self.vertices.shape[1])
        return FacetsAndVertices(vertices, normals[facets], offsets[facets], incidence[:, facets]), lowest


def _adjacent(incidence: Flags, first: Integers, second: Integers, size: int) -> tuple[Integers, Integers, Flags]:
    """Return the pairs of rows, one of each list, that span an edge, and what both lie on.

    Two vertices span an edge if no third vertex lies on all facets on which both lie. With rows and columns exchanged,
    two facets meet in a ridge. In `size` dimensions both lie on size - 1 facets at least.
    """
    numbers = incidence.astype(np.float32)
    i, j = np.nonzero(numbers[first] @ numbers[second].T >= size - 1)
    common = incidence[first[i]] & incidence[second[j]]
    edge = np.zeros(len(i), dtype=bool)
    rows = max(1, _ENTRIES // len(incidence))
    for start in range(0, len(i), rows):
        part = common[start : start + rows]
        holders = part.astype(np.float32) @ numbers.T >= part.sum(axis=1)[:, None]
        edge[start : start + rows] = holders.sum(axis=1) == 2
    return first[i[edge]], second[j[edge]], common[edge]


def _facets(incidence: Flags, size: int) -> Integers:
    """Return the columns that are facets: with at least `size` vertices that do not all lie on another column."""
    counts = incidence.sum(axis=0)
    wide = np.flatnonzero(counts >= size)
    columns = incidence[:, wide].astype(np.float32)
    shared = columns.T @ columns
    within = (shared >= counts[wide][:, None]) & ~np.eye(len(wide), dtype=bool)
    # Of equal columns the last one, which is the newest, is kept.
    same = within & within.T
    within &= ~same | np.triu(np.ones_like(same))
    return np.asarray(wide[~within.any(axis=1)])
