"""A bounded convex polytope in R^n, in both representations."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from math import factorial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.distance import cdist

from infoset.arrays import Flags, Floats, Integers
from infoset.geometry._set_arguments import (
    axis_numbers,
    bound_values,
    finite_values,
    is_number,
    is_set,
    need_set,
    not_negative,
    present_axes,
)
from infoset.geometry.polytope import double_description as dd
from infoset.geometry.polytope._measures import largest_ball, nearest_difference, simplices_of, triangle_of
from infoset.geometry.polytope.arrays import FLAT, SMALL, PolytopeArrays, coordinates
from infoset.geometry.polytope.errors import UnboundedPolytopeError, UncertainHullError
from infoset.limits import Limits, real_values

_MAX_CONDITION = 1e6
"""Condition of a matrix, in scaled coordinates, up to which facets are mapped; beyond, they are those of a hull."""

_THICK = 3e-8
"""Thickness of a flat set that is enlarged, relative to its coordinates: rounding does not lose it again."""


class Polytope(PolytopeArrays):
    """A convex polytope; it may be flat, a segment, a point, or empty.

    It is {x: normals x <= offsets, across x = levels}, and the hull of its `vertices`, shape (v, n), without redundant
    points. The f normals of the facets have unit length and are in the directions of the affine hull; the n - dimension
    rows of `across` are orthonormal. Construct it with `from_vertices`, `from_constraints`, `from_box`, `from_ball` or
    `from_zonotope`.

    One algorithm, the double description, computes all sets: a half-space is added by one step, which finds the edges
    that cross it from the incidence of vertices and facets. Vertices and facets that are given are kept; those that are
    computed are rounded outward, so that the set contains the exact one, and exceeds it by about 1e-12 of its size. A
    set that is 1e11 times thinner than it is long, in units in which it is one wide along each axis, counts as flat;
    the hull of points in such a set is their affine hull to rounding. A set that sticks out by less than 1e-12 of its
    size from a half-space touches it.

    The arrays are stored in scaled coordinates y, x = `centre` + `scale` y: `points`, shape (v, n), and rows (a, b) of
    `facets`, a y <= b, shape (f, n + 1), and of `equations`, a y = b, shape (n - dimension, n + 1). Bit j of a row of
    `incidence`, shape (v, words), is whether the vertex lies on facet j. `conflict` are half-spaces without a common
    point.

    An empty set has no vertices; `relaxation` is then the minimum relaxation of the constraints that made it empty,
    their normals of unit length, with which a point satisfies them; 0 if it is not known. Operations on it give the
    empty set; points such as its centroid do not exist, and an EmptyPolytopeError is raised.

    All arguments are checked: numbers are finite (TypeError if they are not real numbers), shapes and spaces fit
    (ValueError). An UncertainHullError is raised if vertices and facets do not agree because of rounding.

    Operators: `P & Q` (intersection), `P + Q` (Minkowski sum), `P + vector` (translation), `A @ P` (linear map),
    `2 * P`, `-P`, `point in P`, `P <= Q` (subset, to rounding). `P == Q` compares objects; `equals` compares sets. The
    vertices are in no order; `plot` and `to_shapely` order those of a set of the plane.
    """

    __array_ufunc__ = None

    # Sets -----------------------------------------------------------------------------------------------------------

    def linear_map(self, matrix: ArrayLike) -> Polytope:
        """Return {matrix x}, with a matrix of shape (m, n), singular or not."""
        return self.affine_map(matrix)

    def affine_map(self, matrix: ArrayLike, offset: ArrayLike = 0.0) -> Polytope:
        """Return {matrix x + offset} in R^m, with a matrix of shape (m, n), singular or not, and an offset of shape
        (m,) or 0.

        Vertices are rounded once. Under a regular matrix facets and incidence are mapped; otherwise it is a hull.
        """
        rows = finite_values("matrix", matrix, "m", self.space)
        return self._mapped(rows, self._shift(offset, len(rows)), np.zeros(len(rows)))

    def _mapped(self, rows: Floats, moved: Floats, errors: Floats) -> Polytope:
        """Return {rows x + moved}, known to `errors`, shape (m,)."""
        if self.is_empty:
            return self.empty(len(rows), self.conflict if len(rows) == self.space else None)
        shift, rounded = dd.affine_image(self.centre[None], rows, moved)
        points, centre, scale, errors = _image(self.points, rows * self.scale, shift[0], rounded + errors)
        if len(rows) == self.dimension == self.space:
            mapped = rows * self.scale / scale[:, None]
            inverse = _inverse(mapped, _MAX_CONDITION)
            if inverse is not None:
                facets = np.empty_like(self.facets)
                facets[:, :-1] = self.facets[:, :-1] @ inverse
                # A facet a y <= b is a' y' <= b + a' s under y' = matrix y + s; a' matrix differs from a by rounding.
                normals = np.ascontiguousarray(facets[:, :-1])
                back, _ = dd.affine_image(normals, np.ascontiguousarray(mapped.T), np.zeros(self.space))
                away = np.abs(back - self.facets[:, :-1]) @ np.abs(self.points).max(axis=0)
                ends, low = dd.affine_image((shift - centre) / scale, normals, self.facets[:, -1])
                facets[:, -1] = ends[0] + (low + away)
                moved_set = replace(self, points=points, facets=facets, centre=centre, scale=scale)
                return moved_set._around(errors)
        return self._hull(points, centre, scale, FLAT, errors)

    def _around(self, errors: Floats) -> Polytope:
        """Return a set that contains this one, whose vertices are known to `errors`, shape (n,)."""
        facets, points = self.facets.copy(), self.points
        facets[:, -1] += np.abs(facets[:, :-1]) @ errors
        facets *= np.ldexp(1.0, -np.frexp(np.abs(facets).max(axis=1))[1])[:, None]
        if errors.any():
            points = dd.push_out(points, facets, self.incidence, np.ones(len(points), bool), False, dd.TIP)
        return replace(self, points=points, facets=facets)

    @staticmethod
    def _shift(offset: ArrayLike, space: int) -> Floats:
        """Return an offset, shape (space,), from such an array or from one number for all coordinates."""
        shift = real_values("offset", offset)
        shift = finite_values("offset", shift, *[space] * min(shift.ndim, 1))
        return np.ascontiguousarray(np.broadcast_to(shift, (space,)))

    def translate(self, offset: ArrayLike) -> Polytope:
        """Return the set moved by an offset, shape (n,): O((v + f) n)."""
        return self.affine_map(np.eye(self.space), finite_values("offset", offset, self.space))

    def preimage(self, matrix: ArrayLike, offset: ArrayLike = 0.0) -> Polytope:
        """Return {x in R^m: matrix x + offset in the set}, with a matrix of shape (n, m).

        The image under the inverse of a regular matrix; otherwise from the facets, mapped. An UnboundedPolytopeError is
        raised if the preimage is unbounded: the matrix has a null space.
        """
        factor, moved = finite_values("matrix", matrix, self.space, "m"), self._shift(offset, self.space)
        if self.is_empty:
            return self.empty(factor.shape[1])
        inverse = _inverse(factor, 1.0 / FLAT) if len(factor) == factor.shape[1] else None
        if inverse is not None:
            product, _ = dd.affine_image(np.ascontiguousarray(inverse.T), factor, np.zeros(self.space))
            reach = np.abs(self.vertices - moved).max(axis=0)
            errors = 1.01 * np.abs(inverse) @ (np.abs(product.T - np.eye(self.space)) @ reach)
            shift, rounded = dd.affine_image(-moved[None], inverse, np.zeros(self.space))
            return self._mapped(inverse, shift[0], errors + rounded)
        rows, limits = self._rows()
        mapped, rounded = dd.affine_image(rows, np.ascontiguousarray(factor.T), np.zeros(factor.shape[1]))
        terms = np.abs(rows) @ np.abs(factor), np.abs(limits) + np.abs(rows) @ np.abs(moved)
        found = self._of_rows(mapped, limits - rows @ moved, terms)
        if found.is_empty or len(found.equations) or not (rounded.any() or moved.any()):
            return found
        return found.enlarged(2.0 * dd.EPS * np.abs(found.vertices).max(axis=0))

    def minkowski_sum(self, other: Polytope) -> Polytope:
        """Return {x + y: x in the set, y in the other}, the hull of all v1 v2 sums of two vertices."""
        self._need_other(other)
        if self.is_empty or other.is_empty:
            return self if self.is_empty else other
        pairs = [np.repeat(self.points, len(other.points), axis=0), np.tile(other.points, (len(self.points), 1))]
        matrix = np.hstack([np.diag(self.scale), np.diag(other.scale)])
        shift, rounded = dd.affine_image(self.centre[None], np.eye(self.space), other.centre)
        points, centre, scale, errors = _image(np.hstack(pairs), matrix, shift[0], rounded)
        return self._hull(points, centre, scale, FLAT, errors)

    def add_segment(self, half: ArrayLike, *, hull: bool = True) -> Polytope:
        """Return the Minkowski sum with the segment from -half to +half, shape (n,).

        Each facet moves, and each ridge between two facets that face opposite ends of the segment becomes a facet.
        Where rounding decides which ridges do, the sum is a hull of points, which may take long; without `hull` it is
        an UncertainHullError.
        """
        along = finite_values("half", half, self.space)
        if self.is_empty or not along.any():
            return self
        if self.dimension < self.space:
            return self.minkowski_sum(self.from_vertices([-along, along]))
        along = along / self.scale
        row = np.append(along / np.abs(along).max(), 0.0)
        heights, signs = dd.sides(self.facets, row, 1.0)
        ridges = dd.transposed(self.incidence, len(self.facets))
        new, common = dd.crossings(self.facets, ridges, heights, signs, self.space - 1, False)
        directed = np.abs(new[:, :-1]).max(axis=1, initial=0.0) > dd.ON  # not of two opposite facets
        new, common = new[directed], common[directed]
        on, on_new = dd.unpacked(self.incidence, len(signs)), dd.unpacked(common, len(self.points)).T
        upper, lower = on[:, signs > 0].any(axis=1), on[:, signs < 0].any(axis=1)
        incidence = np.vstack(
            [
                np.hstack([on[upper] & (signs >= 0), on_new[upper]]),
                np.hstack([on[lower] & (signs <= 0), on_new[lower]]),
            ]
        )
        ends = np.repeat([1.0, -1.0], [upper.sum(), lower.sum()])
        starts = np.column_stack([np.vstack([self.points[upper], self.points[lower]]), ends])
        points, errors = dd.affine_image(starts, np.column_stack([np.eye(self.space), along]), np.zeros(self.space))
        facets = np.vstack([self.facets, new])
        facets[:, -1] += (1.0 + 8.0 * dd.EPS) * np.abs(facets[:, :-1] @ along) + 2.0 * dd.EPS * np.abs(facets[:, -1])
        whole = replace(self, points=points, facets=facets, incidence=dd.packed(incidence))
        try:
            whole = whole._around(errors)._reduced(np.zeros(len(points), bool))
        except UncertainHullError:
            if not hull:
                raise
            return self._hull(points, self.centre, self.scale, FLAT, errors)
        return whole if np.abs(points).max() < 64.0 else whole.affine_map(np.eye(self.space))

    def enlarged(self, by: ArrayLike) -> Polytope:
        """Return a set that contains {x + e: |e_i| <= by_i}, shape (n,): each facet moves outward by as much.

        A flat set becomes 3e-8 of its coordinates thick. O((v + f) n) for a set with an interior.
        """
        margin = finite_values("by", by, self.space)
        not_negative("by", float(margin.min()))
        if self.is_empty or not margin.any():
            return self
        start = self if self.dimension == self.space else self._prism(margin)
        facets = start.facets.copy()
        facets[:, -1] += (1.0 + 8.0 * dd.EPS) * np.abs(facets[:, :-1]) @ (margin / start.scale)
        most = dd.TIP + 32.0 * float((margin / start.scale).max())
        points = dd.push_out(start.points, facets, start.incidence, np.ones(len(start.points), bool), False, most)
        return replace(start, points=points, facets=facets)

    def _prism(self, margin: Floats) -> Polytope:
        """Return a flat set and its translations across the affine hull by a `margin`, shape (n,), or 3e-8 of its size.

        The other coordinates have the coefficient one in one equation alone.
        """
        # A coordinate that is zero in all points has no scale yet: that of the margin.
        is_zero = (self.points == 0.0).all(axis=0) & (self.centre == 0.0) & (margin > 0.0)
        scale = np.where(is_zero, np.ldexp(1.0, np.frexp(margin)[1]), self.scale)
        sizes = np.maximum(margin / scale, _THICK * np.abs(self.vertices / scale).max(axis=0))
        heights = np.maximum(np.abs(self.equations[:, :-1]) @ sizes, _THICK)
        points, on = self.points, dd.unpacked(self.incidence, len(self.facets))
        others = np.delete(np.arange(self.space), self._own)
        for axis, height in zip(others, heights, strict=True):
            along, above = np.eye(self.space)[axis] * height, np.repeat([False, True], len(points))
            points = np.vstack([points - along, points + along])
            on = np.column_stack([np.vstack([on, on]), above, ~above])
        ends = np.stack([self.equations, -self.equations], axis=1)
        ends[:, :, -1] += heights[:, None]
        sides = np.vstack([self.facets, ends.reshape(-1, self.space + 1)])
        sides *= np.ldexp(1.0, -np.frexp(np.abs(sides).max(axis=1))[1])[:, None]
        return replace(
            self, points=points, facets=sides, equations=self.equations[:0], incidence=dd.packed(on), scale=scale
        )

    def minkowski_difference(self, other: Polytope) -> Polytope:
        """Return the Pontryagin difference {x: x + y in the set for all y in the other}: each facet moves inward.

        If the difference is flat, rounding decides whether it is empty.

        Raises
        ------
        ValueError
            If the other set is empty and this one is not: every point would satisfy the condition.
        """
        self._need_other(other)
        if self.is_empty:
            return self
        if other.is_empty:
            raise ValueError("the difference with an empty set is unbounded")
        rows, limits = self._rows(self.centre)
        widths = dd.supports(other.vertices, rows)
        less = limits - widths
        less = np.where((less + widths == limits) & (limits - less == widths), less, np.nextafter(less, np.inf))
        (lower, upper), (start, end) = self.bounding_box(), other.bounding_box()
        terms = np.abs(rows), np.abs(limits) + np.abs(widths)
        box = lower - start, np.maximum(upper - end, lower - start)
        return self._of_rows(rows, less, terms, box, self.centre)

    def intersection(self, *others: Polytope) -> Polytope:
        """Return the intersection with one or more polytopes: one step of the double description for each facet."""
        sets = sorted((self, *map(self._need_other, others)), key=lambda one: (one.dimension, -len(one.facets)))
        if sets[0].is_empty:
            return sets[0]
        found = sets[0]
        for one in sets[1:]:
            found = found._meet(one)
            if found.is_empty:
                rows, limits = zip(*(one.constraints() for one in sets), strict=True)
                return self.empty(self.space, (np.vstack(rows), np.concatenate(limits)))
        return found

    def _meet(self, other: Polytope) -> Polytope:
        """Return the intersection with one polytope; neither is empty."""
        boxes = np.array([self.bounding_box(), other.bounding_box()])
        lower, upper, widths = boxes[:, 0].max(axis=0), boxes[:, 1].min(axis=0), boxes[0, 1] - boxes[0, 0]
        if (SMALL * (upper - lower) < widths).any():
            rows, limits = zip(*(one._rows(self.centre) for one in (self, other)), strict=True)
            box = lower, np.maximum(lower, upper)
            with suppress(UncertainHullError, UnboundedPolytopeError):
                found = self._of_rows(np.vstack(rows), np.concatenate(limits), box=box, origin=self.centre)
                if not found.is_empty:
                    return found
        # Sets that touch each other do so within the rounding of their own coordinates.
        return self._with_rows(*other._rows(other.centre), other.centre)

    def convex_hull(self, *others: Polytope) -> Polytope:
        """Return the convex hull of the union with one or more polytopes."""
        sets = [one for one in (self, *map(self._need_other, others)) if not one.is_empty]
        return self._of_points(np.vstack([one.vertices for one in sets])) if sets else self

    def cut(
        self,
        normals: ArrayLike,
        lower: ArrayLike = -np.inf,
        upper: ArrayLike = np.inf,
        *,
        slack_ulp: float = 0.0,
    ) -> Polytope:
        """Return the intersection with one or more strips lower <= normals x <= upper, or the set itself if they
        contain it.

        `normals`, shape (n,) or (m, n), have any length. The bounds have the shape () or (m,); infinite ones give
        half-spaces. Each strip is wider on both sides by `slack_ulp` ulp of the products in normals x: a point that
        satisfies the bounds up to rounding is not lost.
        """
        rows = real_values("normals", normals)
        rows = np.atleast_2d(finite_values("normals", rows, *["m"] * (rows.ndim > 1), self.space))
        minimum, most = (
            np.broadcast_to(bound_values(name, bound, (), (len(rows),)), len(rows))
            for name, bound in (("lower", lower), ("upper", upper))
        )
        not_negative("slack_ulp", slack_ulp)
        if self.is_empty:
            return self
        wider = slack_ulp * dd.EPS * (np.abs(rows) @ np.abs(self.vertices).max(axis=0))
        rows, limits = np.vstack([rows, -rows]), np.concatenate([most + wider, wider - minimum])
        if np.isneginf(limits).any():
            return self.empty(self.space)
        limited = limits < np.inf
        if (minimum > most + 2.0 * wider).any():
            own, ends = self.constraints()
            return self.empty(self.space, (np.vstack([own, rows[limited]]), np.append(ends, limits[limited])))
        return self._with_rows(rows[limited], limits[limited])

    def project(self, axes: ArrayLike) -> Polytope:
        """Return the projection on `axes`, an integer or a sequence of integers, as a set of as many dimensions."""
        return self.affine_map(np.eye(self.space)[axis_numbers(axes, self.space, self.space)])

    def slice(self, axes: ArrayLike, values: ArrayLike) -> Polytope:
        """Return the set of the other coordinates where the coordinates `axes`, not all, have some `values`.

        `axes` is an integer or a sequence of integers; `values` is a number, or an array with one for each of them.
        """
        numbers = axis_numbers(axes, self.space, self.space - 1)
        fixed = finite_values("values", values, *[len(numbers)] * min(np.ndim(values), 1))
        rest = np.delete(np.arange(self.space), numbers)
        return self.cut(np.eye(self.space)[numbers], fixed, fixed).project(rest)

    def reduce_outward(self, cap: int, max_vertices: int | None = None) -> Polytope:
        """Return a polytope with at most `cap` (>= 2n) facets that contains the set.

        It starts with the bounding box. Then it is cut by the facet with the greatest excess, relative to the width of
        the set along its normal, until it has `cap` facets.
        """
        Limits(minimum=2 * self.space, whole=True).need("cap", cap)
        most = 10**9 if max_vertices is None else max_vertices
        if self.is_empty or (len(self.facets) + 2 * len(self.equations) <= cap and len(self.points) <= most):
            return self
        if self.dimension == self.space:
            from infoset.geometry.polytope.reduction import reduced_outward

            return reduced_outward(self, cap, most)
        outer = self.from_box(*self.bounding_box())
        rows, limits = self._rows()
        widths = np.ptp(self.vertices @ rows.T, axis=0)
        widths = np.maximum(widths, dd.EPS * np.abs(rows) @ np.abs(self.vertices).max(axis=0))
        for _ in range(cap):
            beyond = (outer.vertices @ rows.T).max(axis=0) - limits
            worst = int((beyond / widths).argmax())
            tighter = outer._with_rows(rows[worst : worst + 1], limits[worst : worst + 1])
            if beyond[worst] <= 0.0 or len(tighter.facets) + 2 * len(tighter.equations) > cap:
                break
            outer = tighter
        return outer

    def _need_other(self, other: Polytope) -> Polytope:
        """Return another polytope; it must be in the same space."""
        if need_set("other", other, Polytope).space != self.space:
            raise ValueError(f"other must be a polytope in R^{self.space}, as this one: got {other!r}")
        return other

    # Measures ---------------------------------------------------------------------------------------------------------

    def support_function(self, directions: ArrayLike) -> Floats:
        """Return the maximum of direction . x, shape (...), for `directions` of shape (..., n); -inf for the empty set.

        O(v n).
        """
        rows = finite_values("directions", directions, "...", self.space)
        return np.asarray((rows @ self.vertices.T).max(axis=-1, initial=-np.inf))

    def support_vector(self, direction: ArrayLike) -> Floats:
        """Return a vertex farthest along a `direction`, both of shape (n,). O(v n)."""
        row = finite_values("direction", direction, self.space)
        heights = self.needed().vertices @ row
        return np.asarray(self.vertices[int(heights.argmax())])

    @cached_property
    def _misfits(self) -> tuple[Floats, Floats]:
        """Distances of the vertices beyond the facets and from the affine hull: rounding of this representation."""
        x = self.vertices
        beyond = (x @ self.normals.T - self.offsets).max(axis=0, initial=0.0)
        away = np.abs(x @ self.across.T - self.levels).max(axis=0, initial=0.0)
        # Points within a few tolerances of the double description count as in the affine hull.
        away = away + 4.0 * dd.ON * (np.abs(self.across) @ np.abs(x).max(axis=0, initial=0.0))
        return beyond, away

    def excess(self, points: ArrayLike) -> Floats:
        """Return the maximum distance of `points`, shape (..., n), beyond a facet or from the affine hull.

        It has shape (...), and is at most 0 inside, also for the vertices: the rounding of a scalar product, and of the
        representation (distances of vertices beyond facets), is subtracted. Infinite for the empty set.
        """
        x = finite_values("points", points, "...", self.space)
        if self.is_empty:
            return np.full(x.shape[:-1], np.inf)
        reach = (self.space + 2) * dd.EPS * np.maximum(np.abs(x), np.abs(self.vertices).max(axis=0))
        over, apart = self._misfits
        beyond = x @ self.normals.T - self.offsets - over - _bent(reach, self.normals)
        away = np.abs(x @ self.across.T - self.levels) - apart - _bent(reach, self.across)
        return np.asarray(np.maximum(beyond.max(axis=-1, initial=-np.inf), away.max(axis=-1, initial=-np.inf)))

    def margin(self, points: ArrayLike) -> Floats:
        """Return the distances of `points`, shape (..., n), from the nearest facet, positive inside: -`excess`.

        Outside, -`margin` is at most the `distance`.
        """
        return -self.excess(points)

    def contains(self, points: ArrayLike, tolerance: float = 0.0) -> Flags:
        """Return whether `points`, shape (..., n), are in the set, to rounding, or within a `tolerance` of its facets.

        O(f n).
        """
        return np.asarray(self.excess(points) <= not_negative("tolerance", tolerance))

    def is_subset(self, other: Polytope, tolerance: float = 0.0) -> bool:
        """Return whether all vertices are in the other set, to rounding, or within a `tolerance` of its facets.

        O(v f n).
        """
        return bool(self._need_other(other).contains(self.vertices, tolerance).all())

    def equals(self, other: Polytope, tolerance: float = 0.0) -> bool:
        """Return whether each set is a subset of the other one, with the tolerance of `is_subset`."""
        return self.is_subset(other, tolerance) and other.is_subset(self, tolerance)

    def bounding_box(self) -> tuple[Floats, Floats]:
        """Return the minimum and the maximum coordinates of the vertices, each of shape (n,). O(v n), exact."""
        return self.needed().vertices.min(axis=0), self.vertices.max(axis=0)

    def volume(self) -> float:
        """Return the volume within the affine hull, of its dimension; 1 for a point, 0 for the empty set."""
        if self.is_empty:
            return 0.0
        # Along each column of the triangle of `_steps` the scaled coordinates are turned and stretched by its diagonal.
        stretch = np.prod(np.abs(np.diag(triangle_of(self._steps)[0]))) if self.dimension else 1.0
        return float(self._simplices[1].sum() * stretch / factorial(self.dimension))

    @cached_property
    def _simplices(self) -> tuple[Integers, Floats]:
        """Vertices of simplices that divide the set, shape (k, d + 1), and their determinants in d coordinates."""
        if not self.dimension:
            return np.zeros((1, 1), np.int64), np.ones(1)
        corners = simplices_of(dd.transposed(self.incidence, len(self.facets)), self.dimension)
        inner = self.points[:, self._own]
        return corners, np.abs(np.linalg.det(inner[corners[:, 1:]] - inner[corners[:, :1]]))

    def area(self) -> float:
        """Return the area of a set of R^2; 0 for a segment or a point. `volume` is for any space."""
        return self.volume() if self._of_plane().dimension == 2 else 0.0

    def centroid(self) -> Floats:
        """Return the centroid within the affine hull, shape (n,), from a division into simplices."""
        corners, sizes = self.needed()._simplices
        return np.asarray(self.centre + self.scale * (sizes / sizes.sum() @ self.points[corners].mean(axis=1)))

    def sample(self, count: int, seed: int | np.random.Generator = 0) -> Floats:
        """Return points distributed uniformly over the set, shape (count, n), from a division into simplices."""
        random = np.random.default_rng(seed)
        corners, sizes = self.needed()._simplices
        weights = random.dirichlet(np.ones(corners.shape[1]), count)
        chosen = corners[random.choice(len(sizes), count, p=sizes / sizes.sum())]
        return np.asarray(self.centre + self.scale * np.einsum("ij,ijk->ik", weights, self.points[chosen]))

    def chebyshev_centre(self) -> tuple[Floats, float]:
        """Return the centre, shape (n,), and the radius of a largest ball in the set, within its affine hull.

        A linear program (HiGHS) in coordinates about the centre of the vertices.
        """
        middle = self.needed().vertices.mean(axis=0)
        if not self.dimension:
            return middle, 0.0
        inner, radius = largest_ball(self.normals @ self._steps, self.offsets - self.normals @ middle)
        return middle + self._steps @ inner, max(0.0, radius)

    def diameter(self) -> float:
        """Return the maximum distance between two vertices; 0 for the empty set. O(v^2 n)."""
        return float(cdist(self.vertices, self.vertices).max(initial=0.0))

    def closest_point(self, point: ArrayLike) -> Floats:
        """Return the point of the set nearest to a `point`, both of shape (n,), within 1e-12 of the size of the set.

        Wolfe's algorithm: a least-squares problem of at most n + 1 points in each of a few steps.
        """
        x = finite_values("point", point, self.space)
        return np.asarray(x + nearest_difference(self.needed().vertices, x[None, :])) if x not in self else x

    def distance(self, other: Polytope | ArrayLike) -> float:
        """Return the distance from `other`, a polytope or a point, shape (n,); inf if a set is empty.

        As `closest_point`.
        """
        if isinstance(other, Polytope):
            points = self._need_other(other).vertices
        else:
            points = finite_values("other", other, self.space)[None]
        if self.is_empty or not len(points):
            return float("inf")
        return float(np.linalg.norm(nearest_difference(self.vertices, points)))

    def isdisjoint(self, other: Polytope) -> bool:
        """Return whether no point is in both sets, to rounding; see `separating_direction`."""
        return self.is_empty or self._need_other(other).is_empty or self.separating_direction(other) is not None

    def separating_direction(self, other: Polytope) -> Floats | None:
        """Return a witness that two sets are disjoint; None if they meet, to rounding, or one is empty.

        It is a direction d, shape (n,), of unit length, with d . x < d . y for all x of this set and y of the other.
        """
        if self.is_empty or self._need_other(other).is_empty:
            return None
        between = nearest_difference(other.vertices, self.vertices)
        length = float(np.linalg.norm(between))
        direction = np.asarray(between / (length or 1.0))
        return direction if self.support_function(direction) < -other.support_function(-direction) else None

    def hausdorff_distance(self, other: Polytope) -> float:
        """Return the Hausdorff distance; inf between an empty and a nonempty set. One `distance` for each vertex."""
        pairs = (self, self._need_other(other)), (other, self)
        return max((two.distance(vertex) for one, two in pairs for vertex in one.vertices), default=0.0)

    def plot(self, axes: Any = None, **style: Any) -> None:
        """Fill a set of R^2 on matplotlib axes (default: the present ones), with the options of
        `matplotlib.axes.Axes.fill`.
        """
        self._of_plane()
        points = self.vertices - self.vertices.mean(axis=0) if len(self.vertices) else self.vertices
        order = np.argsort(np.arctan2(points[:, 1], points[:, 0]))
        present_axes(axes).fill(*self.vertices[order].T, **style)

    # Operators and old names --------------------------------------------------------------------------------------

    def __and__(self, other: Polytope) -> Polytope:
        return self.intersection(other) if isinstance(other, Polytope) else NotImplemented

    def __add__(self, other: Polytope | ArrayLike) -> Polytope:
        given: Any = other
        return self.minkowski_sum(given) if is_set(given) else self.translate(given)

    __radd__ = __add__

    def __mul__(self, factor: float) -> Polytope:
        return self.affine_map(float(factor) * np.eye(self.space)) if is_number(factor) else NotImplemented

    __rmul__ = __mul__

    def __neg__(self) -> Polytope:
        return -1.0 * self

    def __rmatmul__(self, matrix: ArrayLike) -> Polytope:
        return self.affine_map(matrix)

    def __contains__(self, point: ArrayLike) -> bool:
        return bool(self.contains(point))

    def __le__(self, other: Polytope) -> bool:
        return self.is_subset(other) if isinstance(other, Polytope) else NotImplemented


def _inverse(matrix: Floats, condition: float) -> Floats | None:
    """Return the inverse of a square matrix; None if its condition is greater, whatever the units of its columns."""
    units = np.abs(matrix).max(axis=0)
    if not units.all():
        return None
    try:
        inverse = np.linalg.inv(matrix / units)
    except np.linalg.LinAlgError:
        return None
    sizes = np.abs(matrix / units).sum(axis=1).max() * np.abs(inverse).sum(axis=1).max()
    return inverse / units[:, None] if sizes < condition else None


def _image(points: Floats, matrix: Floats, shift: Floats, rounded: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Return matrix y + shift of points, shape (k, m), in new coordinates, with their centre, scale and errors.

    `rounded`, shape (m,), are errors of the shift.
    """
    rough = points @ matrix.T
    reach = np.abs(matrix) @ np.abs(points).max(axis=0)
    # Of a coordinate that is zero but for rounding, the errors stay small in the new coordinates.
    centre, scale = coordinates(rough.min(axis=0) + shift, rough.max(axis=0) + shift, 2.0**-10 * reach)
    image, errors = dd.affine_image(points, matrix / scale[:, None], (shift - centre) / scale)
    return image, centre, scale, errors + rounded / scale


def _bent(reach: Floats, rows: Floats) -> Floats:
    """Return bounds of the rounding of scalar products of points and rows."""
    return np.asarray(reach @ np.abs(rows).T)
