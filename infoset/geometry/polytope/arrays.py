"""Storage and construction of polytopes: vertices, facets and their incidence, in scaled coordinates."""

from __future__ import annotations

import itertools
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import ArrayLike

from infoset.arrays import Flags, Floats, Integers
from infoset.geometry import conversion
from infoset.geometry._set_arguments import box_ends, constraint_values, finite_values, need_finite, radius_values
from infoset.geometry.double_words import EPS, affine_image, supports
from infoset.geometry.polytope import cone
from infoset.geometry.polytope import double_description as dd
from infoset.geometry.polytope._measures import orthonormal
from infoset.geometry.polytope.errors import EmptyPolytopeError, UnboundedPolytopeError, UncertainHullError
from infoset.geometry.polytope.polyhedron import (
    Polyhedron,
    as_directions,
    as_points,
    holds_with_equality,
    of_generators,
    rounded_directions,
    rounded_equations,
    rounded_points,
    rounded_rows,
)
from infoset.limits import COUNT

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

Box = tuple[Floats, ...]
"""Minimum and maximum coordinates, each of shape (n,); empty if they are not known."""
FLAT = 1e-11
"""Thickness below which points are flat, in coordinates in which they are one wide, and movement of their vertices."""
_THIN = 1e-10
"""Width of a set, relative to the coordinates, below which rounding would fill it: the minimum of a scale."""
_NOISE = 1e-15
"""Length of a row, relative to the longest one, below which it is the rounding of a sum that is zero."""
_FINE = 2.0**14
"""Ratio of widths from which a part is computed again in its own coordinates: it is known to 1e-12 of the whole."""
_AGREEMENT = Fraction(1, 10**9)
"""Distance between ends of a set and of the exact one, relative to its width: far above rounding in its coordinates."""
_JOGGLES = (0.0, 3e-10, 1e-6)
"""Movements of points or half-spaces, one after the other, until vertices and facets agree."""


@dataclass(frozen=True, eq=False)
class PolytopeArrays:
    """The arrays of a polytope and its construction; see `Polytope`."""

    points: Floats
    facets: Floats
    equations: Floats
    incidence: Flags
    centre: Floats
    scale: Floats
    exact: Polyhedron | None = None
    """The set in exact integers if it is unbounded; its other arrays are this one, rounded, with `scale` one."""

    @classmethod
    def empty(cls, space: int) -> Self:
        """Return the empty set of R^n, n = `space`."""
        COUNT.need("space", space)
        nothing = np.zeros((0, space + 1))
        return cls(nothing[:, 1:], nothing, nothing, np.zeros((0, 0), np.bool_), np.zeros(space), np.ones(space))

    @classmethod
    def from_vertices(cls, points: ArrayLike, flat: float = FLAT) -> Self:
        """Return the convex hull of `points`, shape (m, n), at least one. Its vertices are points, bit for bit.

        `flat` is the relative thickness below which a set counts as flat: greater for points that are known to fewer
        digits. The facets are the rays of a double description: O(m f) for f facets in the plane, O(m f^2) at worst.
        """
        array = finite_values("points", points, "m", "n").copy()  # in the order for which kernels are compiled
        centre, scale = dd.coordinates(array.min(axis=0), array.max(axis=0), np.zeros(array.shape[1]), _THIN)
        return cls._hull((array - centre) / scale, centre, scale, flat)

    @classmethod
    def from_constraints(
        cls, normals: ArrayLike, offsets: ArrayLike, across: ArrayLike | None = None, levels: ArrayLike = ()
    ) -> Self:
        """Return {x: normals x <= offsets, across x = levels}, with the shapes (m, n), (m,), (k, n) and (k,).

        It may be empty or unbounded. Infinite offsets are no limit. One step of the double description for each row.
        """
        rows, limits = constraint_values(("normals", "offsets"), normals, offsets, "k", "n")
        if across is not None:
            flat, heights = constraint_values(("across", "levels"), across, levels, "k", rows.shape[1])
            need_finite("levels", heights)
            rows, limits = np.vstack([rows, flat, -flat]), np.concatenate([limits, heights, -heights])
        return cls._of_rows(rows, limits)

    @classmethod
    def space_of(cls, space: int) -> Self:
        """Return R^n, n = `space`."""
        COUNT.need("space", space)
        return cls.from_rays(np.zeros((1, space)), lines=np.eye(space))

    @classmethod
    def halfspace(cls, normal: ArrayLike, offset: float) -> Self:
        """Return {x: normal . x <= offset}, with a `normal` of shape (n,).

        Raises
        ------
        ValueError
            If the normal is zero.
        """
        row = finite_values("normal", normal, "n")
        if not row.any():
            raise ValueError("normal must not be zero")
        return cls.from_constraints(row[None], [offset])

    @classmethod
    def from_rays(cls, points: ArrayLike, directions: ArrayLike = (), lines: ArrayLike = ()) -> Self:
        """Return the hull of `points` and of the rays from them along `directions`, and along both ends of `lines`.

        The shapes are (m, n), m at least 1, (k, n) and (l, n). Without directions and lines it is `from_vertices`.
        """
        array = finite_values("points", points, "m", "n")
        space = array.shape[1]
        far = as_directions(finite_values("directions", directions, "k", space))
        both = as_directions(finite_values("lines", lines, "k", space))
        if not far and not both:
            return cls.from_vertices(array)
        return cls._of_polyhedron(of_generators(space, as_points(array), far, both))

    @classmethod
    def _of_polyhedron(cls, found: Polyhedron) -> Self:
        """Return an exact set; its numbers are rounded to nearest, and once more in what is computed from them."""
        if not found.points:
            return cls.empty(found.space)
        points = rounded_points(found.points, found.space)
        if found.is_bounded:
            return cls.from_vertices(points)
        on = np.array([[holds_with_equality(facet, point) for facet in found.facets] for point in found.points])
        return cls(
            points,
            rounded_rows(found.facets, found.space),
            rounded_equations(found.equations, found.space),
            on.reshape(len(points), len(found.facets)),
            np.zeros(found.space),
            np.ones(found.space),
            found,
        )

    @classmethod
    def from_box(cls, lower: ArrayLike, upper: ArrayLike) -> Self:
        """Return {x: lower <= x <= upper} for bounds of shape (n,); flat along axes whose bounds are equal. Exact."""
        minimum, most = box_ends(lower, upper, "n")
        centre, scale = dd.coordinates(minimum.copy(), most.copy(), np.zeros(len(minimum)), 0.0)
        least, top = (minimum - centre) / scale, (most - centre) / scale
        ends = [dict.fromkeys(pair) for pair in zip(least, top, strict=True)]
        points, unit, wide = np.array(list(itertools.product(*ends))), np.eye(len(least)), least < top
        facets = np.column_stack([np.vstack([unit[wide], -unit[wide]]), np.concatenate([top[wide], -least[wide]])])
        on = points @ facets[:, :-1].T == facets[:, -1]
        return cls(points, facets, np.column_stack([unit[~wide], top[~wide]]), on, centre, scale)

    @classmethod
    def from_ball(cls, centre: ArrayLike, radius: float, *, outer: bool = True) -> Self:
        """Return a polytope around the ball with `centre`, shape (n,), and `radius`, or in it.

        Its facets, or its vertices if not `outer`, are in the 3^n - 1 directions whose components are in ratios of -1,
        0 and 1; it has 2^n n! vertices, or facets: 3840 in R^5. It extends beyond the ball, or stays inside it, by the
        factor 1.09 in two dimensions, 1.13 in three and 1.19 in five at most.
        """
        middle, size = finite_values("centre", centre, "n"), float(radius_values(radius))
        rows = np.array([row for row in itertools.product((-1.0, 0.0, 1.0), repeat=len(middle)) if any(row)])
        rows /= np.linalg.norm(rows, axis=1)[:, None]
        if outer and size > 1e-13 * np.abs(middle).max():  # rounding of the coordinates is smaller
            return cls._of_rows(rows, np.full(len(rows), size), middle, (middle - size, middle + size))
        return cls.from_vertices(middle + size * rows)

    @classmethod
    def from_shapely(cls, geometry: BaseGeometry) -> Self:
        """Return a convex shapely Point, LineString or Polygon as a set of R^2; see `ConvexPolygons.from_shapely`."""
        ring = conversion.ring_of_geometry(geometry)
        return cls.from_vertices(ring) if len(ring) else cls.empty(2)

    def to_shapely(self) -> BaseGeometry:
        """Return a set of R^2 as a shapely Point, LineString or Polygon; the empty set is an empty Polygon."""
        return conversion.geometry_of_ring(self._polygon())

    def _polygon(self) -> Floats:
        """Return the vertices of a set of R^2, shape (v, 2), counter-clockwise."""
        if self.space != 2:
            raise ValueError(f"a set of R^2 is needed: project this one, of R^{self.space}, on two axes first")
        return conversion.ring_of_points(self.bounded().vertices)

    @classmethod
    def _hull(cls, points: Floats, centre: Floats, scale: Floats, flat: float = FLAT, allowed: bool = True) -> Self:
        """Return the convex hull of points in scaled coordinates, or raise an UncertainHullError if not `allowed`.

        Points that span no more than d dimensions differ in d coordinates, found by complete pivoting. The hull is
        computed in these; the other coordinates are functions of them.
        """
        if not allowed:
            raise UncertainHullError("the set is the hull of points")
        start, space = np.column_stack([points, np.ones(len(points))]), points.shape[1]
        chosen, columns = dd.pivots(start, flat, 0)
        own, rest, dimension = columns[1:], np.delete(np.arange(space), columns[1:]), len(columns) - 1
        equations = np.eye(space, space + 1)[rest]
        slopes = np.linalg.solve(start[chosen][:, [*own, space]], points[np.ix_(chosen, rest)]).T
        equations[:, own], equations[:, -1] = -slopes[:, :-1], slopes[:, -1]
        if not dimension:
            return cls(points[:1].copy(), equations[:0], equations, np.zeros((1, 0), np.bool_), centre, scale)
        inner = np.ascontiguousarray(points[:, own])
        rows = np.column_stack([-inner, np.ones(len(inner))])
        for joggle in _JOGGLES:
            if joggle:  # points that have moved have simplices as facets; offsets follow from the points themselves
                rows[:, :-1] = joggle * np.random.default_rng(0).uniform(-1.0, 1.0, inner.shape) - inner
            rays, on, _ = dd.extreme_rays(rows, False, 0.0)
            # Rounding can divide a facet in two rays, each on some of its points: on all of them, they are one.
            on |= dd.near(rays, rows, FLAT)
            with suppress(UncertainHullError):
                used, sides, incidence = dd.lattice(on.T.copy(), dimension)
                break
        else:
            raise UncertainHullError(f"rounding decides which of {len(points)} points are vertices")
        facets, normals = np.zeros((len(sides), space + 1)), np.ascontiguousarray(rays[sides, :-1])
        facets[:, own], facets[:, -1] = normals, supports(inner, normals)
        return cls(points[used], facets, equations, incidence, centre, scale)

    def _around(self, by: Floats) -> Self:
        """Return a set that contains {y + e: |e_i| <= by_i}, in scaled coordinates, `by` of shape (n,)."""
        points, facets = dd.around(self.points, self.facets, self.incidence, by, len(self.equations) > 0)
        return replace(self, points=points, facets=facets)

    @classmethod
    def _of_rows(cls, rows: Floats, limits: Floats, origin: Floats | float = 0.0, box: Box = ()) -> Self:
        """Return {x: rows (x - origin) <= limits}.

        If a `box` contains it, it is only computed in coordinates of the box; the result is empty also if rounding
        decides about it there. Otherwise the coordinates in which the set is round are not known before the set: see
        `_guessed` and `_judged`.
        """
        if np.isneginf(limits).any():
            return cls.empty(rows.shape[1])
        rows, limits = rows[limits < np.inf], limits[limits < np.inf]
        if box:
            return cls._in_box(rows, limits, origin, box, cls.empty(rows.shape[1]))
        found = cls._guessed(rows, limits, origin)
        if found._is_certain(rows, limits):
            return found
        return cls._judged(rows, limits, origin, found)

    @classmethod
    def _in_box(cls, rows: Floats, limits: Floats, origin: Floats | float, box: Box, found: Self) -> Self:
        """Return {x: rows (x - origin) <= limits}, computed in coordinates of a box around it; `found` if not there."""
        with suppress(EmptyPolytopeError, UnboundedPolytopeError, UncertainHullError):
            for _ in range(3):
                around = dd.coordinates(box[0], box[1], np.zeros(rows.shape[1]), _THIN)
                better = cls._intersect(rows, limits, origin, *around)
                box, found = better.bounding_box(), better
                if found._is_round:
                    break
        return found

    @classmethod
    def _guessed(cls, rows: Floats, limits: Floats, origin: Floats | float) -> Self:
        """Return {x: rows (x - origin) <= limits}, or the empty set, computed in guessed coordinates, then in its own.

        In too small a scale a set seems to be empty or unbounded, in too large a one it has no width.
        """
        found, centre = cls.empty(rows.shape[1]), np.zeros(rows.shape[1])
        for share in (0.25, 1.0):
            with suppress(UnboundedPolytopeError, UncertainHullError):
                found = cls._intersect(rows, limits, origin, centre, _guess(rows, limits, share))
            if not found.is_empty:
                break
        if found._is_round:
            return found
        return cls._in_box(rows, limits, origin, found.bounding_box(), found)

    def _is_certain(self, rows: Floats, limits: Floats) -> bool:
        """Whether the set of these half-spaces needs no judge: it has points, and no width is near its rounding.

        No row was taken for rounding, and pairs of opposite half-spaces hold a flat set in its affine hull.
        """
        if self.is_empty or (_shorter(rows * self.scale, _NOISE) & rows.any(axis=1)).any():
            return False
        widths = np.ptp(self.points, axis=0)
        if ((widths > 0.0) & (widths < 1.0 / 64.0)).any():
            return False
        return self.dimension == self.space or len(_equations(rows, limits)) == self.space - self.dimension

    @classmethod
    def _unbounded(cls, exact: cone.Vertices) -> Self:
        """Return the unbounded set of exact vertices, directions and lines."""
        points = [cone.whole([*point, Fraction(1)]) for point in exact.points]
        directions, lines = ([[*row, 0] for row in rows] for rows in (exact.directions, exact.lines))
        return cls._of_polyhedron(of_generators(len(points[0]) - 1, points, directions, lines))

    @classmethod
    def _judged(cls, rows: Floats, limits: Floats, origin: Floats | float, found: Self) -> Self:
        """Return {x: rows (x - origin) <= limits}; exact vertices decide whether it is the `found` one.

        If it is not, it is computed in the coordinates of the exact vertices.
        """
        is_noise, exact = _noise(rows, limits, np.broadcast_to(origin, rows.shape[1]))
        if not exact.points or not _holds_without_direction(limits, is_noise):
            return cls.empty(rows.shape[1])
        if not exact.is_bounded:
            return cls._unbounded(exact)
        if not found.is_empty and found._agrees(exact.box()):
            return found
        around = cone.coordinates(exact.box(), _THIN)
        return cls._intersect(rows[~is_noise], limits[~is_noise], origin, *around, noise=0.0)

    def _agrees(self, box: cone.Box) -> bool:
        """Whether the ends of the set along each axis are those of an exact `box`, within 1e-9 of its width."""
        lower, upper = self.points.min(axis=0), self.points.max(axis=0)
        ends = zip(self.centre.tolist(), self.scale.tolist(), lower.tolist(), upper.tolist(), *box, strict=True)
        for centre, scale, low, high, least, most in ends:
            allowed = _AGREEMENT * (most - least) or EPS * abs(most)
            for end, exact in ((low, least), (high, most)):
                if abs(Fraction(centre) + Fraction(scale) * Fraction(end) - exact) > allowed:
                    return False
        return True

    @property
    def _is_round(self) -> bool:
        """Whether no other coordinates are much better, by a factor of 64; in none the empty set has points."""
        points = self.points
        return self.is_empty or bool(np.abs(points).max() <= 64.0 and np.ptp(points, axis=0).min() >= 1.0 / 64.0)

    @classmethod
    def _intersect(
        cls,
        rows: Floats,
        limits: Floats,
        origin: Floats | float,
        centre: Floats,
        scale: Floats,
        noise: float = _NOISE,
    ) -> Self:
        """Return {x: rows (x - origin) <= limits}, computed in coordinates with a centre and scales.

        Rows that are shorter than the longest one by the factor `noise` are rounding.
        """
        space = len(scale)
        scaled, possible = _scaled_rows(rows, _moved(rows, limits, centre - origin), scale, noise)
        if not possible:
            return cls.empty(space)
        table = np.vstack([np.eye(space + 1)[-1:], scaled * ([-1.0] * space + [1.0])])  # the first row is t >= 0
        for joggle in _JOGGLES:
            if joggle:  # half-spaces that move outward by different amounts have simple vertices
                table[1:, -1] = scaled[:, -1] + joggle * np.random.default_rng(0).uniform(0.5, 1.0, len(scaled))
            rays, on, rank = dd.extreme_rays(table, True, dd.ON)
            if rank <= space:  # the rows do not depend on all coordinates
                columns = np.sort(dd.pivots(table, dd.ON, 0)[1])
                rays, _, _ = dd.extreme_rays(np.ascontiguousarray(table[:, columns]), True, dd.ON)
            ends = rays[:, -1] == 1.0
            if not ends.any():
                return cls.empty(space)
            free = np.linalg.svd(table)[2][-1:] if rank <= space else rays[~ends]
            if len(free):
                raise UnboundedPolytopeError(free[0, :-1] * scale)
            start = cls(rays[:, :-1].copy(), scaled, np.zeros((0, space + 1)), on[:, 1:].copy(), centre, scale)
            with suppress(UncertainHullError):
                return start._reduced(0)
        raise UncertainHullError(f"rounding decides where {len(rows)} half-spaces meet")

    def _reduced(self, old: int) -> Self:
        """Return the set without redundant vertices and facets; vertices on facets after the first `old` move outward.

        Facets on which all vertices lie are equations of a set of lower dimension: the hull of its vertices.
        """
        flat = len(self.points) <= self.dimension or bool(self.incidence.all(axis=0).any())
        still = flat or len(self.equations) > 0
        points = dd.push_out(self.points, self.facets, self.incidence, old, still, FLAT if still else dd.TIP)
        if flat:
            hull = self._hull(points, self.centre, self.scale, 1e2 * FLAT)
            if hull.dimension == self.dimension:  # of a thin set, the bits of the facets are rounding
                raise UncertainHullError("rounding decides whether a set is flat")
            return hull
        used, sides, incidence = dd.lattice(self.incidence, self.dimension)
        return replace(self, points=points[used], facets=self.facets[sides], incidence=incidence)

    def _with_rows(
        self, rows: Floats, limits: Floats, origin: Floats | float = 0.0, box: Box = (), recompute: bool = True
    ) -> Self:
        """Return the part where rows (x - origin) <= limits, between the ends of a `box`, if known; or the set."""
        limits, before = _moved(rows, limits, self.centre - origin), np.ptp(self.points, axis=0)
        if box and (_FINE * (box[1] - box[0]) < before * self.scale).any():
            better = self._again(rows, limits, box)
            if better.dimension == self.dimension:  # in these coordinates rounding decides about flatter parts
                return better
        scaled, possible = _scaled_rows(rows, limits, self.scale)
        heights = self.points @ scaled[:, :-1].T - scaled[:, -1]
        cuts = scaled[heights.max(axis=0) > dd.ON * max(1.0, float(np.abs(self.points).max()))]
        if not len(cuts) and possible:
            return self
        rays, on = np.column_stack([self.points, np.ones(len(heights))]), np.zeros((len(heights), len(cuts)), np.bool_)
        numbers, table = len(self.facets) + np.arange(len(cuts)), cuts * ([-1.0] * self.space + [1.0])
        rays, on = dd.insert_rows(rays, np.hstack([self.incidence, on]), table, numbers, self.dimension - 1, True)
        if not len(rays) or not possible:
            return self.empty(self.space)
        part = replace(self, points=rays[:, :-1].copy(), facets=np.vstack([self.facets, cuts]), incidence=on)
        if not recompute:
            return part._reduced(len(self.facets))
        widths = np.ptp(part.points, axis=0)
        # An axis along which the part has no width is no reason: its equations fix that coordinate.
        with suppress(UncertainHullError):
            if not ((_FINE * widths < before) & (widths > FLAT * before)).any():
                return part._reduced(len(self.facets))
        better = self._again(rows, limits, part.bounding_box())
        return part._reduced(len(self.facets)) if better.is_empty else better

    def recomputed(self) -> Self:
        """Return the set, computed again from its facets in coordinates of its size; itself if rounding decides."""
        better = self if self.is_empty else self._again(np.zeros((0, self.space)), np.zeros(0), self.bounding_box())
        return better if better.dimension == self.dimension else self

    def _again(self, rows: Floats, limits: Floats, box: Box) -> Self:
        """Return the part where rows (x - centre) <= limits, computed in the coordinates of a `box` around it."""
        own, ends = self._rows(self.centre)
        return self._of_rows(np.vstack([own, rows]), np.append(ends, limits), self.centre, box)

    @property
    def space(self) -> int:
        """Dimension n of the space."""
        return int(self.points.shape[1])

    @property
    def dimension(self) -> int:
        """Dimension of the affine hull; -1 for the empty set."""
        return int(self.space - len(self.equations)) if len(self.points) else -1

    @property
    def is_empty(self) -> bool:
        """Whether the set is empty."""
        return not len(self.points)

    @property
    def is_bounded(self) -> bool:
        """Whether the set is bounded; the empty set is."""
        return self.exact is None

    @cached_property
    def directions(self) -> Floats:
        """Directions of unit length in which the set is unbounded, shape (r, n): those of its recession cone.

        A set that contains lines has `lines` too, and one direction for each ray between them.
        """
        return rounded_directions(self.exact.directions if self.exact else (), self.space)

    @cached_property
    def lines(self) -> Floats:
        """Directions of unit length of lines that the set contains, shape (l, n), linearly independent."""
        return rounded_directions(self.exact.lines if self.exact else (), self.space)

    @cached_property
    def vertices(self) -> Floats:
        """Vertices, shape (v, n)."""
        return self.centre + self.scale * self.points

    @cached_property
    def normals(self) -> Floats:
        """Normals of the facets, shape (f, n), of unit length, in the directions of the affine hull."""
        if self.is_empty:
            return np.zeros((1, self.space))
        rows = self.facets[:, :-1] / self.scale
        if len(self.equations):
            columns, gradients = orthonormal(self._steps, rows @ self._steps)
            rows = gradients @ columns.T
        return np.asarray(rows / np.linalg.norm(rows, axis=1)[:, None])

    @cached_property
    def offsets(self) -> Floats:
        """Offsets of the facets, shape (f,): normals x <= offsets."""
        if self.is_empty:
            return -np.ones(1)
        if len(self.equations):
            return supports(self.vertices, self.normals)
        rows, limits = self._rows()
        lengths, rounding = np.linalg.norm(rows, axis=1), 4.0 * EPS * np.abs(self.vertices).max(axis=0)
        rounded = (np.frexp(lengths)[0] != 0.5) | (self.centre.any() & (rows != 0.0)).any(axis=1)
        return np.asarray(limits / lengths + rounded * (np.abs(self.normals) @ rounding))

    @cached_property
    def across(self) -> Floats:
        """Orthonormal normals of the affine hull, shape (n - dimension, n)."""
        return orthonormal((self.equations[:, :-1] / self.scale).T, np.zeros((0, len(self.equations))))[0].T

    @cached_property
    def levels(self) -> Floats:
        """Levels of the affine hull, shape (n - dimension,): across x = levels."""
        return 0.5 * supports(self.vertices, self.across) - 0.5 * supports(self.vertices, -self.across)

    @cached_property
    def _steps(self) -> Floats:
        """A basis of the directions of the affine hull, shape (n, d): changes of d coordinates by their scales."""
        (own, others), steps = self._own_and_others, np.zeros((self.space, self.dimension))
        steps[own], steps[others] = np.eye(len(own)), -self.equations[:, own]
        return self.scale[:, None] * steps

    @property
    def _own_and_others(self) -> tuple[Integers, Integers]:
        """The d coordinates of which the others are functions, and the others, in the order of their equations."""
        bound = self.equations[:, :-1]  # the columns of the others are those of the identity
        others = np.array([(unit == bound.T).all(axis=1).argmax() for unit in np.eye(len(bound))], np.int64)
        return np.delete(np.arange(self.space), others), others

    def constraints(self) -> tuple[Floats, Floats]:
        """Return normals, shape (k, n), of unit length, and offsets, shape (k,): the set is normals x <= offsets.

        An equation of a flat set gives two rows; an empty set is 0 x <= -1.
        """
        rows = np.vstack([self.normals, self.across, -self.across])
        return rows, np.concatenate([self.offsets, self.levels, -self.levels])

    def _rows(self, origin: Floats | float = 0.0) -> tuple[Floats, Floats]:
        """Return half-spaces rows (x - origin) <= limits: the facets, and two of each equation."""
        sides = np.vstack([self.facets, self.equations, -self.equations])
        rows = sides[:, :-1] / self.scale
        return rows, _moved(rows, sides[:, -1], origin - self.centre)

    def needed(self) -> Self:
        """Return the set itself.

        Raises
        ------
        EmptyPolytopeError
            If it is empty.
        """
        if self.is_empty:
            raise EmptyPolytopeError("the polytope is empty")
        return self

    def bounded(self) -> Self:
        """Return the set itself.

        Raises
        ------
        UnboundedPolytopeError
            If it is unbounded.
        """
        if self.exact is not None:
            raise UnboundedPolytopeError(np.vstack([self.lines, self.directions])[0])
        return self

    def bounding_box(self) -> tuple[Floats, Floats]:
        """Return the minimum and the maximum coordinates, each of shape (n,), infinite where the set is unbounded.

        O(v n), exact.
        """
        lower, upper = self.needed().vertices.min(axis=0), self.vertices.max(axis=0)
        if self.exact is not None:
            along = np.vstack([self.directions, self.lines, -self.lines])
            lower = np.where((along < 0.0).any(axis=0), -np.inf, lower)
            upper = np.where((along > 0.0).any(axis=0), np.inf, upper)
        return lower, upper

    def __repr__(self) -> str:
        kind = "empty polytope" if self.is_empty else f"polytope of dimension {self.dimension}"
        if not self.is_bounded:
            kind = f"unbounded {kind}"
        return f"<{kind} in R^{self.space}: {len(self.points)} vertices, {len(self.facets)} facets>"


def _equations(rows: Floats, limits: Floats) -> Floats:
    """Return a basis of the rows whose opposite is also there, with the opposite limit, shape (k, n)."""
    table = np.column_stack([rows, limits]) + 0.0
    known = set(map(tuple, table.tolist()))
    pairs = np.array([tuple((0.0 - row).tolist()) in known for row in table], np.bool_)
    units = dd.in_units(rows[pairs])
    return units[dd.pivots(units, dd.ON, -1)[0]]


def _guess(rows: Floats, limits: Floats, share: float) -> Floats:
    """Return sizes of coordinates, powers of two, shape (n,): those at which a `share` of the rows is tight."""
    large = np.abs(rows) > 1e-14 * np.abs(rows).max(axis=1, initial=0.0, keepdims=True)  # others may be rounding
    used = np.where(large.any(axis=0), large, rows != 0.0) & (limits[:, None] != 0.0)
    counts, order = used.sum(axis=0), np.arange(rows.shape[1])
    if not counts.any():
        return np.ones(rows.shape[1])
    sizes = np.where(used, np.abs(limits)[:, None] / np.where(used, np.abs(rows), 1.0), np.inf)
    sizes = np.sort(sizes, axis=0)[(share * np.maximum(counts - 1, 0)).astype(np.int64), order]
    if not counts.all():  # where no row is tight away from zero, the unit is that of the others
        sizes[counts == 0] = np.sort(sizes[counts > 0])[(counts > 0).sum() // 2]
    return np.asarray(np.ldexp(1.0, np.frexp(sizes)[1]))


def _moved(rows: Floats, limits: Floats, shift: Floats) -> Floats:
    """Return the limits of rows (x - shift) from those of rows x."""
    return affine_image(shift[None], -rows, limits.copy())[0][0] if shift.any() else limits


def _scaled_rows(rows: Floats, limits: Floats, scale: Floats, noise: float = _NOISE) -> tuple[Floats, bool]:
    """Return rows (a, b), a . y <= b with x = scale y, and whether rows without a direction hold, to rounding."""
    table = np.column_stack([rows * scale, limits])
    is_noise = _shorter(table[:, :-1], noise)
    return dd.in_units(table[~is_noise]), _holds_without_direction(limits, is_noise)


def _shorter(rows: Floats, factor: float) -> Flags:
    """Return which rows are shorter than the longest one by a factor, or zero."""
    sizes = np.abs(rows).max(axis=1)
    return np.asarray(sizes <= factor * sizes.max(initial=0.0))


def _holds_without_direction(limits: Floats, which: Flags) -> bool:
    """Whether 0 x <= limit holds, to rounding, for some of the rows."""
    return bool((limits[which] >= -1e-13 * np.abs(limits).max(initial=1e-300)).all())


def _noise(rows: Floats, limits: Floats, origin: Floats) -> tuple[Flags, cone.Vertices]:
    """Return which rows are rounding, and the exact vertices of the others.

    A row is rounding if it is far shorter than the longest one, also in units of the box of the rows that are not: a
    set that needs it to be bounded has no such box.
    """
    is_short = _shorter(rows, _NOISE)
    exact = _exact_vertices(rows[~is_short], limits[~is_short], origin)
    if not is_short.any():
        return is_short, exact
    is_noise = np.asarray(~rows.any(axis=1))
    if exact.points and exact.is_bounded:
        is_noise = is_noise | is_short & _shorter(rows * cone.coordinates(exact.box(), _THIN)[1], _NOISE)
    if (is_short == is_noise).all():
        return is_noise, exact
    return is_noise, _exact_vertices(rows[~is_noise], limits[~is_noise], origin)


def _exact_vertices(rows: Floats, limits: Floats, origin: Floats) -> cone.Vertices:
    """Return the exact vertices of {x: rows (x - origin) <= limits}; without rows, those of the whole space."""
    if not len(rows):
        rows, limits = np.zeros((1, rows.shape[1])), np.zeros(1)
    normals = cone.rationals(rows)
    shifts = cone.product(normals, cone.rationals(origin[:, None]))
    ends = [Fraction(limit) + shift for limit, (shift,) in zip(limits.tolist(), shifts, strict=True)]
    return cone.vertices_of(normals, ends)
