"""The sets of a `LinearObserver` with up to four states: polygons for two, polytopes for others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from infoset.arrays import Flags, Floats
from infoset.engine.section_life import SUM_SLACK
from infoset.geometry.convex_polygons import ConvexPolygons
from infoset.geometry.polytope import Polytope
from infoset.geometry.tolerances import REDUCED, SNAP
from infoset.geometry.zonotope import Zonotope
from infoset.observer.steps import (
    Batch,
    Move,
    Strips,
    cut_to_preimage,
    predict_all,
    support_all,
    update_all,
)

Set = ConvexPolygons | Polytope | Zonotope

POLYTOPE_SLACK = SNAP
"""Enlargement of a polytope: of the strip of a measurement relative to the terms of normal . x, and
of a predicted set relative to its widths. It is SNAP, the distance from a facet within which points
count as its vertices: by this much the tip of a sharp corner may be missing."""
MAX_POLYTOPE_VERTICES = 5000
"""Maximum number of vertices of an exact polytope: a step with more takes minutes."""
_MAX_VERTICES = 700
"""Maximum number of vertices of a polytope that is reduced. With 36 facets, the default, a set of
four states has at most 36 * 33 / 2 = 594 (upper bound theorem).
"""
_TINY = float(np.finfo(np.float64).tiny)
"""Minimum distance of a strip from a set that it leaves empty, so that the strip is found."""
_MIN_TERM = 1e-50
"""Minimum of the terms by which a row is divided. A normal is at most 1e60, so that an entry of the
divided row is at most 1e110, whose square does not overflow."""


@dataclass(frozen=True, eq=False)
class Motion:
    """A step x+ = matrix x + shift + w, with w in the `disturbance`.

    `shifts`, shape (B, n) or (1, n), are B u + c. `terms`, of the same shape, are the sums of the
    sizes of their terms, which determine rounding errors.
    """

    matrix: Floats
    shifts: Floats
    terms: Floats
    disturbance: Set

    def of_run(self, run: int) -> Motion:
        """Return the step of one run."""
        if len(self.shifts) == 1:
            return self
        return replace(self, shifts=self.shifts[run : run + 1], terms=self.terms[run : run + 1])

    def sums_of_terms(self, sizes: Floats) -> Floats:
        """Return the sums of the sizes of the terms of a state after the step, shape (n,).

        The motion is the motion of one run. `sizes`, shape (n,), bound the state before it.
        """
        return np.asarray(np.abs(self.matrix) @ sizes + self.terms[0] + sizes_of(self.disturbance))

    @property
    def reversed_sum(self) -> Motion:
        """The step x - shift - w; the set of -w is the image of W under -1."""
        unit = np.eye(len(self.matrix))
        return Motion(unit, -self.shifts, self.terms, -unit @ self.disturbance)


class Sets(Protocol):
    """The sets of B runs; methods return new sets."""

    @property
    def is_empty(self) -> Flags:
        """Whether each set is empty, shape (B,)."""

    @property
    def is_known_empty(self) -> Flags:
        """Whether each set is known to be empty without linear programs, shape (B,)."""

    @property
    def reduced(self) -> Flags:
        """Whether each set was replaced by a larger one, shape (B,)."""

    def predicted(self, motion: Motion) -> Sets:
        """Return the sets after a step; raise ArithmeticError if one has too many vertices."""

    def cut(self, strips: Strips, excess: Floats) -> Sets:
        """Return the sets within the strips.

        `excess`, shape (B, r), receives the distance of a strip from the set that it leaves empty.
        """

    def preimage_cut(self, later: Sets, motion: Motion) -> Sets:
        """Return the states that lead to a state of the later set for some disturbance."""

    def support(self, direction: Floats) -> Floats:
        """Return max direction . x of each set, shape (B,); -inf for the empty set."""

    def chebyshev_centres(self) -> Floats:
        """Return the centres of largest balls, shape (B, n); NaN for the empty set."""


class Polygons(Batch):
    """Sets of two states: exact polygons, compiled."""

    @classmethod
    def of(cls, start: Set, runs: int) -> Polygons:
        """Return the same set for all runs, or the members of a batch of `runs` polygons."""
        polygons = polygon_of(start)
        room = polygons.vertices.shape[-2]
        # Copies are writable, as the arrays of all sets, so that kernels are compiled once.
        vertices = np.array(np.broadcast_to(polygons.vertices, (runs, room, 2)))
        counts = np.array(np.broadcast_to(polygons.counts, (runs,)))
        exact = cls(vertices, counts)
        still = np.zeros((1, 2))
        # Sums of generators are rounded, as a true state on the boundary is.
        return exact.predicted(Motion(np.eye(2), still, still, Zonotope(np.zeros(2), [])))

    @property
    def is_empty(self) -> Flags:
        """Whether each set is empty, shape (B,)."""
        return np.asarray(self.counts == 0)

    @property
    def is_known_empty(self) -> Flags:
        """Whether each set is empty, shape (B,)."""
        return self.is_empty

    @property
    def reduced(self) -> Flags:
        """False: kernels reduce polygons of more than 512 vertices, which is not recorded."""
        return np.zeros(len(self.counts), bool)

    def predicted(self, motion: Motion) -> Polygons:
        """Return the sets after a step."""
        w = motion.disturbance
        generators = np.zeros((0, 2))
        other = np.zeros((0, 2))
        centre = np.zeros(2)
        if isinstance(w, Zonotope):
            generators = w.generators
            centre = w.centre
        else:
            other = polygon_of(w).polygon()

        # Kernels are compiled once, for contiguous arrays.
        move = Move(
            np.ascontiguousarray(motion.matrix),
            np.ascontiguousarray(motion.shifts + centre),
            np.ascontiguousarray(motion.terms + np.abs(centre)),
            np.ascontiguousarray(generators),
            np.ascontiguousarray(other),
        )
        more = 2 * len(generators) + len(other) + 4
        return self._apply(predict_all, more, move)

    def cut(self, strips: Strips, excess: Floats) -> Polygons:
        """Return the sets within the strips.

        `excess`, shape (B, r), receives the distance of a strip from the set that it leaves empty.
        """
        contiguous = Strips(*map(np.ascontiguousarray, strips))
        return self._apply(update_all, 2 * len(strips.normals), contiguous, excess)

    def preimage_cut(self, later: Sets, motion: Motion) -> Polygons:
        """Return the states that lead to a state of the later set for some disturbance."""
        assert isinstance(later, Polygons)
        backward = later.predicted(motion.reversed_sum)
        more = int(backward.counts.max(initial=0)) + 4
        return self._apply(cut_to_preimage, more, backward, np.ascontiguousarray(motion.matrix))

    def support(self, direction: Floats) -> Floats:
        """Return max direction . x of each set, shape (B,); -inf for the empty set."""
        return support_all(self, direction)

    def chebyshev_centres(self) -> Floats:
        """Return the centres of largest discs, shape (B, 2); NaN for the empty set."""
        centres, _ = ConvexPolygons.unchecked(self.vertices, self.counts).chebyshev_centre()
        return np.ma.filled(centres, np.nan)

    def _apply(self, kernel: Callable[..., None], more: int, *arguments: Any) -> Polygons:
        """Return the polygons that a kernel writes, with at most `more` vertices more."""
        room = int(self.counts.max(initial=0)) + more
        result = Polygons(np.empty((len(self.counts), room, 2)), np.empty_like(self.counts))
        kernel(self, *arguments, result)
        return result


@dataclass(frozen=True, eq=False)
class RunPolytope:
    """The set of one run as a polytope, of at most `max_facets` facets after a cut.

    None is no bound. `reduced` is whether the set, or one that it was computed from, was replaced
    by a larger one with fewer facets.
    """

    polytope: Polytope
    max_facets: int | None
    reduced: bool = False

    @property
    def sizes(self) -> Floats:
        """Maximum sizes of the coordinates, shape (n,); zero for the empty set."""
        return np.asarray(np.abs(self.polytope.vertices).max(axis=0, initial=0.0))

    def solid(self, sizes: Floats) -> RunPolytope:
        """Return the set; a flat one is enlarged to a layer that is thicker than rounding.

        `sizes`, shape (n,), are maximum terms of the coordinates of a flat set.
        """
        one = self.polytope
        if one.is_empty or one.dimension == one.space:
            return self
        sizes = np.maximum(self.sizes, sizes)
        # A coordinate that is always zero has the size 1.
        return replace(self, polytope=one.enlarged(REDUCED * np.where(sizes > 0.0, sizes, 1.0)))

    def limited(self) -> RunPolytope:
        """Return a set that contains this one, with the allowed numbers of facets and vertices.

        Raises
        ------
        ArithmeticError
            If there is no limit and the set has too many vertices.
        """
        if self.max_facets is None:
            vertices = len(self.polytope.vertices)
            if vertices > MAX_POLYTOPE_VERTICES:
                raise ArithmeticError(
                    f"the exact set has {vertices} vertices, and at most {MAX_POLYTOPE_VERTICES} "
                    "are possible; give max_facets for a larger set with fewer facets"
                )
            return self

        smaller = self.polytope.reduce_outward(self.max_facets, _MAX_VERTICES)
        return self if smaller is self.polytope else replace(self, polytope=smaller, reduced=True)

    def predicted(
        self, matrix: Floats, shift: Floats, terms: Floats, disturbance: Set
    ) -> RunPolytope:
        """Return the set of matrix x + shift + w, for one run.

        `terms`, shape (n,), are the sums of the sizes of the terms of shift + w. The set is not
        reduced after the last sum: most of its facets go with the next measurement.
        """
        terms = np.abs(matrix) @ self.sizes + terms
        start = self.limited()
        image = replace(start, polytope=start.polytope.affine_map(matrix, shift))
        moved = image.solid(terms)
        was_solid = moved is image

        one = moved.polytope
        if isinstance(disturbance, Zonotope):
            for half in disturbance.generators:
                one = one.add_segment(half)
        else:
            one = one.minkowski_sum(polytope_of(disturbance))
        moved = replace(moved, polytope=one)
        # Only to refuse a set of too many vertices.
        if self.max_facets is None:
            moved = moved.limited()

        widths = np.ptp(one.vertices, axis=0) if not one.is_empty else 0.0
        # `solid` returns the set itself if it is not flat.
        slack = POLYTOPE_SLACK if was_solid and moved.solid(terms) is moved else REDUCED
        return replace(moved, polytope=moved.polytope.enlarged(SUM_SLACK * terms + slack * widths))

    def cut(self, strips: Strips, run: int = 0) -> tuple[RunPolytope, Floats]:
        """Return the part within strips, and their distances from the set if the part is empty.

        The distances have the shape (r,).
        """
        terms = np.abs(strips.normals) @ self.sizes + strips.terms[run]
        # A row that is short in the units of the states counts like others. The units are powers of
        # two, so that products with them are not rounded.
        unit = np.ldexp(1.0, -np.frexp(np.maximum(terms, _MIN_TERM))[1])
        normals = strips.normals * unit[:, None]

        # Where strips leave a flat set, a layer that is thicker than rounding.
        for slack in (POLYTOPE_SLACK, REDUCED):
            lower = (strips.lower[run] - slack * terms) * unit
            upper = (strips.upper[run] + slack * terms) * unit
            part = self.polytope.cut(normals, lower, upper)
            if part.is_empty or part.dimension == part.space:
                break

        excess = np.zeros(len(terms))
        if part.is_empty and not self.polytope.is_empty:
            excess = self._excess(normals, lower, upper) / unit
        found = replace(self, polytope=part)
        if slack == REDUCED and not part.is_empty:
            widths = np.ptp(self.polytope.vertices, axis=0)
            found = found.solid(self.sizes)
            found = replace(found, polytope=found.polytope.enlarged(POLYTOPE_SLACK * widths))
        return found.limited(), excess

    def _excess(self, normals: Floats, lower: Floats, upper: Floats) -> Floats:
        """Return the distance of the first strip that leaves no state from the set before it, which
        the strips before have cut.

        The result has the shape (r,), with 0 for the other strips.
        """
        excess = np.zeros(len(normals))
        part = self.polytope
        for r, normal in enumerate(normals):
            heights = part.vertices @ normal
            part = part.cut(normal, lower[r], upper[r])
            if part.is_empty:
                excess[r] = max(heights.min() - upper[r], lower[r] - heights.max(), _TINY)
                break
        return excess


@dataclass(frozen=True, eq=False)
class Polytopes:
    """Sets of any number of states."""

    members: tuple[RunPolytope, ...]

    @classmethod
    def of(cls, start: Set, runs: int, max_facets: int | None, sizes: Floats) -> Polytopes:
        """Return the same set for all runs; `sizes`, shape (n,), are the sizes of disturbances."""
        solid = RunPolytope(polytope_of(start), max_facets).solid(sizes)
        outer = replace(solid, polytope=solid.polytope.enlarged(SUM_SLACK * solid.sizes))
        return cls((outer.limited(),) * runs)

    @property
    def is_empty(self) -> Flags:
        """Whether each set is empty, shape (B,)."""
        return np.array([member.polytope.is_empty for member in self.members])

    @property
    def is_known_empty(self) -> Flags:
        """Whether each set is empty, shape (B,)."""
        return self.is_empty

    @property
    def reduced(self) -> Flags:
        """Whether each set was reduced, shape (B,)."""
        return np.array([member.reduced for member in self.members])

    def predicted(self, motion: Motion) -> Polytopes:
        """Return the sets after a step; raise ArithmeticError if one has too many vertices."""
        w = motion.disturbance
        shape = (len(self.members), len(motion.matrix))  # (B, n)
        # The centre of a zonotope is part of the shift: `RunPolytope.predicted` adds its generators
        # only. A polytope is added where it is.
        centre = w.centre if isinstance(w, Zonotope) else np.zeros(shape[1])
        shifts = np.broadcast_to(motion.shifts + centre, shape)
        terms = np.broadcast_to(motion.terms + sizes_of(w), shape)
        runs = zip(self.members, shifts, terms, strict=True)
        members = [member.predicted(motion.matrix, shift, term, w) for member, shift, term in runs]
        return Polytopes(tuple(members))

    def cut(self, strips: Strips, excess: Floats) -> Polytopes:
        """Return the sets within the strips.

        `excess`, shape (B, r), receives the distance of a strip from the set that it leaves empty.
        """
        members = []
        for run, member in enumerate(self.members):
            part, excess[run] = member.cut(strips, run)
            members.append(part)
        return Polytopes(tuple(members))

    def preimage_cut(self, later: Sets, motion: Motion) -> Polytopes:
        """Return the states that lead to a state of the later set for some disturbance."""
        assert isinstance(later, Polytopes)
        backward = later.predicted(motion.reversed_sum)
        results = []
        for start, target in zip(self.members, backward.members, strict=True):
            rows, limits = target.polytope.constraints()
            # rows @ matrix is rounded, relative to these terms.
            terms = np.abs(rows) @ (np.abs(motion.matrix) @ start.sizes + target.sizes)
            open_ends = np.full((1, len(rows)), -np.inf)
            strips = Strips(rows @ motion.matrix, open_ends, limits[None], terms[None])
            member, _ = start.cut(strips)
            results.append(replace(member, reduced=member.reduced or target.reduced))
        return Polytopes(tuple(results))

    def support(self, direction: Floats) -> Floats:
        """Return max direction . x of each set, shape (B,); -inf for the empty set."""
        return np.array([member.polytope.support_function(direction) for member in self.members])

    def chebyshev_centres(self) -> Floats:
        """Return the centres of largest balls, shape (B, n), by a linear program each.

        They are NaN for the empty set.
        """
        centres = []
        for member in self.members:
            centre = np.full(member.polytope.space, np.nan)
            if not member.polytope.is_empty:
                centre, _ = member.polytope.chebyshev_centre()
            centres.append(centre)
        return np.array(centres)


def polygon_of(shape: Set) -> ConvexPolygons:
    """Return a set of two coordinates as polygons; of polygons a batch stays a batch."""
    if isinstance(shape, ConvexPolygons):
        return shape
    if isinstance(shape, Polytope):
        return ConvexPolygons.from_points(shape.vertices)
    return ConvexPolygons.from_zonotope(shape)


def polytope_of(shape: Set) -> Polytope:
    """Return a single set that is not empty as a polytope."""
    if isinstance(shape, Polytope):
        return shape
    if isinstance(shape, Zonotope):
        return shape.polytope()
    return Polytope.from_vertices(shape.polygon())


def sizes_of(shape: Set) -> Floats:
    """Return the maximum sizes of the coordinates of a set, shape (n,), or bounds of them."""
    if isinstance(shape, Zonotope):
        return np.asarray(np.abs(shape.centre) + np.abs(shape.generators).sum(axis=0))
    return np.asarray(np.abs(shape.vertices).reshape(-1, shape.vertices.shape[-1]).max(axis=0))
