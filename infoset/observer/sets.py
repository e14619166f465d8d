"""The sets of a `LinearObserver`: batches of polygons for two states, polytopes for other numbers of states."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from infoset.arrays import Flags, Floats, Integers
from infoset.engine.section_life import CUT_SLACK, SUM_SLACK
from infoset.geometry.convex_polygons import ConvexPolygons
from infoset.geometry.polytope import Polytope
from infoset.geometry.polytope.double_description import FacetsAndVertices
from infoset.geometry.zonotope import Zonotope
from infoset.observer import steps as observer_steps

Set = ConvexPolygons | Polytope | Zonotope

POLYTOPE_SLACK = 1e-12
"""Enlargement of the bounds of a measurement of a polytope, relative to the terms of normal . x."""
_SCALE_ULP = 16.0
MAX_POLYTOPE_VERTICES = 5000
"""A polytope with more vertices takes minutes a step."""


@dataclass(frozen=True, eq=False)
class Strips:
    """The sets {x: lower <= normal . x <= upper} of a batch of runs.

    `normals`, shape (r, n), have any length; a zero one bounds nothing. `lower` and `upper`, shape (B, r), are infinite
    for a strip that does not exist in this run. `terms`, shape (B, r), are the sums of the sizes of the terms of the
    bounds, which determine rounding errors.
    """

    normals: Floats
    lower: Floats
    upper: Floats
    terms: Floats


@dataclass(frozen=True, eq=False)
class Motion:
    """A step x+ = matrix x + shift + w, with w in the `disturbance`.

    `shifts`, shape (B, n) or (1, n), are B u + c, and `terms` of the same shape the sums of the sizes of their terms,
    which determine rounding errors.
    """

    matrix: Floats
    shifts: Floats
    terms: Floats
    disturbance: Set

    @property
    def reversed_sum(self) -> Motion:
        """The step x - shift - w."""
        return Motion(np.eye(len(self.matrix)), -self.shifts, self.terms, _negative(self.disturbance))


@dataclass(frozen=True, eq=False)
class Polygons:
    """Sets of two states: exact polygons, compiled."""

    vertices: Floats
    counts: Integers

    @classmethod
    def of(cls, start: Set, runs: int) -> Polygons:
        """Return the same set for all runs, or the members of a batch of `runs` polygons."""
        polygons = polygon_of(start)
        room = polygons.vertices.shape[-2]
        vertices = np.broadcast_to(polygons.vertices, (runs, room, 2))
        exact = cls(np.ascontiguousarray(vertices), np.broadcast_to(polygons.counts, (runs,)).copy())
        still = np.zeros((1, 2))
        # Sums of generators are rounded, as a true state on the boundary is.
        return exact.predicted(Motion(np.eye(2), still, still, Zonotope(np.zeros(2), [])))

    @property
    def is_empty(self) -> Flags:
        """Whether each set is empty, shape (B,)."""
        return np.asarray(self.counts == 0)

    def predicted(self, motion: Motion) -> Polygons:
        """Return the sets after a step."""
        none = np.zeros((0, 2))
        if isinstance(motion.disturbance, Zonotope):
            generators, other, centre = motion.disturbance.generators, none, motion.disturbance.centre
        else:
            generators, other, centre = none, polygon_of(motion.disturbance).polygon(), np.zeros(2)
        more = 2 * len(generators) + len(other) + 4
        shifts, terms = motion.shifts + centre, motion.terms + np.abs(centre)
        arrays = motion.matrix, shifts, terms, generators, other
        return self._apply(observer_steps.predict_all, more, *arrays, slack=SUM_SLACK)

    def cut(self, strips: Strips, excess: Floats) -> Polygons:
        """Return the sets within the strips; `excess`, shape (B, r), receives the distance of a strip from the set."""
        arrays = strips.normals, strips.lower, strips.upper, strips.terms, excess
        return self._apply(observer_steps.update_all, 2 * len(strips.normals), *arrays, slack=CUT_SLACK)

    def preimage_cut(self, later: Sets, motion: Motion) -> Polygons:
        """Return the states that lead to a state of the later set for some disturbance."""
        assert isinstance(later, Polygons)
        backward = later.predicted(motion.reversed_sum)
        more = int(backward.counts.max(initial=0)) + 4
        arrays = backward.vertices, backward.counts, motion.matrix
        return self._apply(observer_steps.cut_to_preimage, more, *arrays, slack=CUT_SLACK)

    def support(self, direction: Floats) -> Floats:
        """Return max direction . x of each set, shape (B,); -inf for the empty set."""
        return observer_steps.support_all(self.vertices, self.counts, direction)

    def chebyshev_centres(self, states: int) -> Floats:
        """Return the centres of largest discs, shape (B, 2); NaN for the empty set."""
        centres, _ = ConvexPolygons.unchecked(self.vertices, self.counts).chebyshev_centre()
        return np.ma.filled(centres, np.nan)

    def _apply(self, kernel: Callable[..., None], more: int, *arrays: NDArray[Any], slack: float) -> Polygons:
        """Return the polygons that a kernel writes, with at most `more` vertices more."""
        result = np.empty((len(self.counts), int(self.counts.max(initial=0)) + more, 2)), np.empty_like(self.counts)
        kernel(self.vertices, self.counts, *map(np.ascontiguousarray, arrays), slack, *result)
        return Polygons(*result)


@dataclass(frozen=True, eq=False)
class Polytopes:
    """Sets of any number of states; None is the empty set."""

    members: tuple[FacetsAndVertices | None, ...]

    @classmethod
    def of(cls, start: Set, runs: int, sizes: Floats | float = 0.0) -> Polytopes:
        """Return the same set for all runs; a flat one is widened by 3e-8 of its coordinates, or of `sizes`."""
        return cls((FacetsAndVertices.of(polytope_of(start), sizes).enlarged(_SCALE_ULP),) * runs)

    @property
    def is_empty(self) -> Flags:
        """Whether each set is empty, shape (B,)."""
        return np.array([member is None for member in self.members])

    def predicted(self, motion: Motion) -> Polytopes:
        """Return the sets after a step; raise ArithmeticError if one has more than `MAX_POLYTOPE_VERTICES`."""
        w, states = motion.disturbance, len(motion.matrix)
        centre = w.centre if isinstance(w, Zonotope) else np.zeros(states)
        shifts, terms = (
            np.broadcast_to(values, (len(self.members), states))
            for values in (motion.shifts + centre, motion.terms + np.abs(centre))
        )
        results: list[FacetsAndVertices | None] = []
        for member, shift, term in zip(self.members, shifts, terms, strict=True):
            if member is None:
                results.append(None)
                continue
            moved = member.affine_image(motion.matrix, shift)
            if isinstance(w, Zonotope):
                for half in w.generators:
                    moved = moved.plus_segment(half)
            else:
                moved = moved.plus(polytope_of(w))
            if len(moved.vertices) > MAX_POLYTOPE_VERTICES:
                raise ArithmeticError(
                    f"the exact set has {len(moved.vertices)} vertices, and at most {MAX_POLYTOPE_VERTICES} are "
                    "possible; use fewer states, fewer steps, or zonotopes of another library"
                )
            results.append(moved.enlarged(_SCALE_ULP, term))
        return Polytopes(tuple(results))

    def cut(self, strips: Strips, excess: Floats) -> Polytopes:
        """Return the sets within the strips; `excess`, shape (B, r), receives the distance of a strip from the set."""
        results: list[FacetsAndVertices | None] = []
        for b, start in enumerate(self.members):
            member = start
            for r, normal in enumerate(strips.normals):
                for sign, level in ((1.0, strips.upper[b, r]), (-1.0, -strips.lower[b, r])):
                    if member is None or not np.isfinite(level):
                        continue
                    terms = float(np.abs(normal) @ np.abs(member.vertices).max(axis=0)) + strips.terms[b, r]
                    slack = POLYTOPE_SLACK * terms
                    if not normal.any():
                        member, lowest = (member if level >= 0.0 else None), -level
                    else:
                        member, lowest = member.cut(sign * normal, level + slack)
                    if member is None:
                        excess[b, r] = lowest
            results.append(member)
        return Polytopes(tuple(results))

    def preimage_cut(self, later: Sets, motion: Motion) -> Polytopes:
        """Return the states that lead to a state of the later set for some disturbance."""
        assert isinstance(later, Polytopes)
        backward = later.predicted(motion.reversed_sum)
        results: list[FacetsAndVertices | None] = []
        for start, target in zip(self.members, backward.members, strict=True):
            if start is None or target is None:
                results.append(None)
                continue
            levels = (target.vertices @ target.normals.T).max(axis=0)
            open_ends = np.full((1, len(levels)), -np.inf)
            terms = np.abs(target.normals) @ np.abs(target.vertices).max(axis=0)
            strips = Strips(target.normals @ motion.matrix, open_ends, levels[None], terms[None])
            (member,) = Polytopes((start,)).cut(strips, np.zeros((1, len(levels)))).members
            results.append(member)
        return Polytopes(tuple(results))

    def support(self, direction: Floats) -> Floats:
        """Return max direction . x of each set, shape (B,); -inf for the empty set."""
        return np.array([-np.inf if member is None else (member.vertices @ direction).max() for member in self.members])

    def chebyshev_centres(self, states: int) -> Floats:
        """Return the centres of largest balls, shape (B, n), by a linear program each; NaN for the empty set."""
        nowhere = np.full(states, np.nan)
        return np.array(
            [nowhere if member is None else member.polytope.chebyshev_centre()[0] for member in self.members]
        )


Sets = Polygons | Polytopes
"""The sets of B runs; both classes have the same methods, which return new sets."""


def polygon_of(shape: Set) -> ConvexPolygons:
    """Return a set of two coordinates as polygons."""
    if isinstance(shape, ConvexPolygons):
        return shape
    if isinstance(shape, Polytope):
        return ConvexPolygons.from_points(shape.vertices)
    return ConvexPolygons.from_zonotope(shape.centre, shape.generators)


def polytope_of(shape: Set) -> Polytope:
    """Return a single set that is not empty as a polytope."""
    if isinstance(shape, Polytope):
        return shape
    if isinstance(shape, Zonotope):
        return Polytope.from_zonotope(shape.centre, shape.generators)
    return Polytope.from_vertices(shape.polygon())


def _negative(disturbance: Set) -> Set:
    """Return {-w: w in the set}."""
    if isinstance(disturbance, Zonotope):
        return Zonotope(-disturbance.centre, disturbance.generators)
    if isinstance(disturbance, ConvexPolygons):
        return disturbance.linear_map(-np.eye(2))
    return disturbance.linear_map(-np.eye(disturbance.space))
