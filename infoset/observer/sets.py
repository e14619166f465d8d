"""The sets of a `LinearObserver`: batches of polygons for two states, polytopes for other numbers
of states.
"""

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
"""Enlargement of polytopes, relative to the terms of normal . x of a measurement, or to the widths
of a prediction: the distance from a facet within which points are its vertices, so that the tip of
a sharp corner may be missing."""
MAX_POLYTOPE_VERTICES = 5000
"""A polytope with more vertices takes minutes a step."""
_MAX_VERTICES = 700
"""The same for sets that are reduced: those of four states have many more vertices than facets."""
_TINY = float(np.finfo(np.float64).tiny)


@dataclass(frozen=True, eq=False)
class Motion:
    """A step x+ = matrix x + shift + w, with w in the `disturbance`.

    `shifts`, shape (B, n) or (1, n), are B u + c, and `terms` of the same shape the sums of the
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
        """Return the sums of the sizes of the terms of a state after the step of one run, shape
        (n,).

        `sizes`, shape (n,), bound the state before it.
        """
        return np.asarray(np.abs(self.matrix) @ sizes + self.terms[0] + sizes_of(self.disturbance))

    @property
    def reversed_sum(self) -> Motion:
        """The step x - shift - w."""
        unit = np.eye(len(self.matrix))
        return Motion(unit, -self.shifts, self.terms, -unit @ self.disturbance)


class Sets(Protocol):
    """The sets of B runs; methods return new sets."""

    @property
    def is_empty(self) -> Flags:
        """Whether each set is empty, shape (B,)."""

    @property
    def is_known_empty(self) -> Flags:
        """The same as far as it is known without linear programs."""

    @property
    def reduced(self) -> Flags:
        """Whether each set was replaced by a larger one, shape (B,)."""

    def predicted(self, motion: Motion) -> Sets:
        """Return the sets after a step; raise ArithmeticError if one has too many vertices."""

    def cut(self, strips: Strips, excess: Floats) -> Sets:
        """Return the sets within the strips; `excess`, shape (B, r), receives the distance of a
        strip from the set.
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
        vertices = np.array(
            np.broadcast_to(polygons.vertices, (runs, room, 2))
        )  # writable, as all sets: one kernel
        exact = cls(vertices, np.array(np.broadcast_to(polygons.counts, (runs,))))
        still = np.zeros((1, 2))
        # Sums of generators are rounded, as a true state on the boundary is.
        return exact.predicted(Motion(np.eye(2), still, still, Zonotope(np.zeros(2), [])))

    @property
    def is_empty(self) -> Flags:
        """Whether each set is empty, shape (B,)."""
        return np.asarray(self.counts == 0)

    @property
    def is_known_empty(self) -> Flags:
        """The same."""
        return self.is_empty

    @property
    def reduced(self) -> Flags:
        """Not known: the kernels reduce only polygons of more than 512 vertices."""
        return np.zeros(len(self.counts), bool)

    def predicted(self, motion: Motion) -> Polygons:
        """Return the sets after a step."""
        w = motion.disturbance
        none = np.zeros((0, 2))
        if isinstance(w, Zonotope):
            generators = w.generators
            other = none
            centre = w.centre
        else:
            generators = none
            other = polygon_of(w).polygon()
            centre = np.zeros(2)
        arrays = (
            motion.matrix,
            motion.shifts + centre,
            motion.terms + np.abs(centre),
            generators,
            other,
        )
        move = Move(*map(np.ascontiguousarray, arrays))  # kernels are compiled once
        return self._apply(predict_all, 2 * len(generators) + len(other) + 4, move)

    def cut(self, strips: Strips, excess: Floats) -> Polygons:
        """Return the sets within the strips; `excess`, shape (B, r), receives the distance of a
        strip from the set.
        """
        return self._apply(
            update_all, 2 * len(strips.normals), Strips(*map(np.ascontiguousarray, strips)), excess
        )

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
    """The set of one run as a polytope, of at most `max_facets` facets; None is no bound.

    `reduced` is whether the set, or one that it was computed from, was replaced by a larger one
    with fewer facets.
    """

    polytope: Polytope
    max_facets: int | None
    reduced: bool = False

    @property
    def sizes(self) -> Floats:
        """Maximum coordinates, shape (n,)."""
        return np.asarray(np.abs(self.polytope.vertices).max(axis=0, initial=0.0))

    def solid(self, sizes: Floats) -> RunPolytope:
        """Return the set; a flat one is enlarged to a layer that is thicker than rounding.

        `sizes`, shape (n,), are maximum terms of the coordinates of a flat set.
        """
        one = self.polytope
        if one.is_empty or one.dimension == one.space:
            return self
        sizes = np.maximum(self.sizes, sizes)
        return replace(self, polytope=one.enlarged(REDUCED * np.where(sizes > 0.0, sizes, 1.0)))

    def limited(self) -> RunPolytope:
        """Return a set that contains this one, with at most as many facets and vertices as allowed.

        Raises
        ------
        ArithmeticError
            If there is no limit and the set has too many vertices.
        """
        vertices = len(self.polytope.vertices)
        if self.max_facets is None:
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
        """Return the set of matrix x + shift + w; `terms` are the sums of the sizes of the terms of
        shift + w.

        It is not reduced after the last sum: most of its facets go with the next measurement.
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
        if self.max_facets is None:
            moved = moved.limited()

        widths = np.ptp(one.vertices, axis=0) if not one.is_empty else 0.0
        slack = POLYTOPE_SLACK if was_solid and moved.solid(terms) is moved else REDUCED
        return replace(moved, polytope=moved.polytope.enlarged(SUM_SLACK * terms + slack * widths))

    def cut(self, strips: Strips, run: int = 0) -> tuple[RunPolytope, Floats]:
        """Return the part within strips, and the distances of strips from the set, shape (r,), if
        the part is empty.
        """
        terms = np.abs(strips.normals) @ self.sizes + strips.terms[run]
        # A row that is short in the units of the states counts like others; normals may have at
        # most 1e60.
        unit = np.ldexp(1.0, -np.frexp(np.maximum(terms, 1e-50))[1])
        normals = strips.normals * unit[:, None]
        excess = np.zeros(len(terms))
        for slack in (
            POLYTOPE_SLACK,
            REDUCED,
        ):  # a layer that is thicker than rounding, where a flat set is left
            lower = (strips.lower[run] - slack * terms) * unit
            upper = (strips.upper[run] + slack * terms) * unit
            part = self.polytope.cut(normals, lower, upper)
            if part.is_empty or part.dimension == part.space:
                break

        if part.is_empty and not self.polytope.is_empty:
            excess = self._excess(normals, lower, upper) / unit
        found = replace(self, polytope=part)
        if slack == REDUCED and not part.is_empty:
            widths = np.ptp(self.polytope.vertices, axis=0)
            found = found.solid(self.sizes)
            found = replace(found, polytope=found.polytope.enlarged(POLYTOPE_SLACK * widths))
        return found.limited(), excess

    def _excess(self, normals: Floats, lower: Floats, upper: Floats) -> Floats:
        """Return the distance, shape (r,), of the first strip that leaves nothing from what others
        leave; else 0.
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
        """Return the same set for all runs; `sizes`, shape (n,), are those of disturbances."""
        member = RunPolytope(polytope_of(start), max_facets).solid(sizes)
        return cls(
            (
                replace(
                    member, polytope=member.polytope.enlarged(SUM_SLACK * member.sizes)
                ).limited(),
            )
            * runs
        )

    @property
    def is_empty(self) -> Flags:
        """Whether each set is empty, shape (B,)."""
        return np.array([member.polytope.is_empty for member in self.members])

    @property
    def is_known_empty(self) -> Flags:
        """The same."""
        return self.is_empty

    @property
    def reduced(self) -> Flags:
        """Whether each set was reduced, shape (B,)."""
        return np.array([member.reduced for member in self.members])

    def predicted(self, motion: Motion) -> Polytopes:
        """Return the sets after a step; raise ArithmeticError if one has too many vertices."""
        w = motion.disturbance
        shape = (len(self.members), len(motion.matrix))
        centre = w.centre if isinstance(w, Zonotope) else np.zeros(shape[1])
        shifts = np.broadcast_to(motion.shifts + centre, shape)
        terms = np.broadcast_to(motion.terms + sizes_of(w), shape)
        pairs = zip(self.members, shifts, terms, strict=True)
        return Polytopes(
            tuple(member.predicted(motion.matrix, shift, term, w) for member, shift, term in pairs)
        )

    def cut(self, strips: Strips, excess: Floats) -> Polytopes:
        """Return the sets within the strips; `excess`, shape (B, r), receives the distance of a
        strip from the set.
        """
        members, distances = zip(
            *(member.cut(strips, b) for b, member in enumerate(self.members)), strict=True
        )
        excess[:] = distances
        return Polytopes(members)

    def preimage_cut(self, later: Sets, motion: Motion) -> Polytopes:
        """Return the states that lead to a state of the later set for some disturbance."""
        assert isinstance(later, Polytopes)
        results = []
        for start, target in zip(
            self.members, later.predicted(motion.reversed_sum).members, strict=True
        ):
            rows, limits = target.polytope.constraints()
            # rows @ matrix is rounded, relative to these terms.
            terms = np.abs(rows) @ (np.abs(motion.matrix) @ start.sizes + target.sizes)
            open_ends = np.full((1, len(rows)), -np.inf)
            member, _ = start.cut(
                Strips(rows @ motion.matrix, open_ends, limits[None], terms[None])
            )
            results.append(replace(member, reduced=member.reduced or target.reduced))
        return Polytopes(tuple(results))

    def support(self, direction: Floats) -> Floats:
        """Return max direction . x of each set, shape (B,); -inf for the empty set."""
        return np.array([member.polytope.support_function(direction) for member in self.members])

    def chebyshev_centres(self) -> Floats:
        """Return the centres of largest balls, shape (B, n), by a linear program each; NaN for the
        empty set.
        """
        polytopes = [member.polytope for member in self.members]
        return np.array(
            [np.full(p.space, np.nan) if p.is_empty else p.chebyshev_centre()[0] for p in polytopes]
        )


def polygon_of(shape: Set) -> ConvexPolygons:
    """Return a set of two coordinates as polygons."""
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
    """Return the maximum coordinates of a set, shape (n,), or bounds of them."""
    if isinstance(shape, Zonotope):
        return np.asarray(np.abs(shape.centre) + np.abs(shape.generators).sum(axis=0))
    return np.asarray(np.abs(shape.vertices).reshape(-1, shape.vertices.shape[-1]).max(axis=0))
