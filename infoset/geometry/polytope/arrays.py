"""Storage and construction of polytopes: vertices, facets and their incidence, in scaled coordinates."""

from __future__ import annotations

import itertools
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import ArrayLike

from infoset.arrays import Flags, Floats, Integers
from infoset.geometry._set_arguments import box_ends, constraint_values, finite_values, need_finite, radius_values
from infoset.geometry.polytope import double_description as dd
from infoset.geometry.polytope._measures import largest_ball, orthonormal
from infoset.geometry.polytope.errors import EmptyPolytopeError, UnboundedPolytopeError, UncertainHullError
from infoset.limits import COUNT

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

FLAT = 1e-11
"""Thickness below which points are flat, in coordinates in which they are one wide: ten tolerances of the kernel."""
_FAR = 16.0
"""Ratio of coordinates to widths from which a set has a centre: differences from the centre are then exact."""
_GAIN = 2.0**-20
"""Minimum ratio of two scales in which half-spaces are intersected one after the other."""
_ROUND = 64.0
"""Ratio of coordinates to a scale beyond which better coordinates are worth a second computation."""
_VOID = 1e-13
"""Length of a row, relative to what it was computed from, below which it is rounding: 1e3 roundings."""
_SHORT = 1e-15
"""The same relative to the longest row, if it is not known what the rows were computed from."""
SMALL = 2.0**10
"""Ratio of two sets' widths from which half-spaces are intersected in the coordinates of the smaller one."""
_JOGGLES = (0.0, 1e-10, 1e-8, 1e-6)
"""Movements of points or half-spaces, one after the other, until vertices and facets agree."""


@dataclass(frozen=True, eq=False)
class PolytopeArrays:
    """Vertices and facets of a polytope in scaled coordinates y, x = centre + scale y; see `Polytope`.

    `points`, shape (v, n), are the vertices. A row (a, b) of `facets`, shape (f, n + 1), is a . y <= b, and one of
    `equations`, shape (n - dimension, n + 1), is a . y = b. Bit j of `incidence`, shape (v, words), is set if a vertex
    lies on facet j. The scales are powers of two, so that they round nothing; a set far from the origin has a `centre`.
    """

    points: Floats
    facets: Floats
    equations: Floats
    incidence: dd.Bits
    centre: Floats
    scale: Floats
    conflict: tuple[Floats, Floats] | None = field(default=None, repr=False)
    """Normals and offsets of half-spaces that have no common point, if the set is empty."""

    # Construction -----------------------------------------------------------------------------------------------------

    @classmethod
    def empty(cls, space: int, conflict: tuple[Floats, Floats] | None = None) -> Self:
        """Return the empty set of R^n, n = `space`, with half-spaces that have no common point if known."""
        COUNT.need("space", space)
        nothing = np.zeros((0, space + 1))
        none = np.zeros((0, 1), np.uint64)
        return cls(nothing[:, 1:], nothing, nothing, none, np.zeros(space), np.ones(space), conflict)

    @classmethod
    def from_vertices(cls, points: ArrayLike, flat: float = FLAT) -> Self:
        """Return the convex hull of `points`, shape (k, n), at least one. Its vertices are points, bit for bit.

        `flat` is the relative thickness below which a set counts as flat: greater for points that are known to fewer
        digits. The facets are the rays of a double description: O(k f) for f facets in the plane, O(k f^2) at worst.

        Raises
        ------
        ValueError
            If there is no point.
        UncertainHullError
            If rounding decides which points are vertices.
        """
        array = finite_values("points", points, "k", "n")
        if not len(array):
            raise ValueError("points must have at least one row: Polytope.empty makes the empty set")
        return cls._of_points(array, flat)

    @classmethod
    def from_constraints(
        cls,
        normals: ArrayLike,
        offsets: ArrayLike,
        across: ArrayLike | None = None,
        levels: ArrayLike | None = None,
    ) -> Self:
        """Return {x: normals x <= offsets, across x = levels}, of shapes (m, n), (m,), (k, n) and (k,); it may be
        empty.

        Infinite offsets are no limit. One step of the double description for each row. An UnboundedPolytopeError, which
        holds a direction, is raised if the set is unbounded, and an UncertainHullError if rounding decides which points
        are vertices.
        """
        rows, limits = constraint_values(("normals", "offsets"), normals, offsets, "k", "n")
        if across is not None:
            given: ArrayLike = [] if levels is None else levels
            flat, heights = constraint_values(("across", "levels"), across, given, "k", rows.shape[1])
            need_finite("levels", heights)
            rows, limits = np.vstack([rows, flat, -flat]), np.concatenate([limits, heights, -heights])
        return cls._of_rows(rows, limits)

    @classmethod
    def from_box(cls, lower: ArrayLike, upper: ArrayLike) -> Self:
        """Return {x: lower <= x <= upper} for bounds of shape (n,); flat along axes whose bounds are equal. Exact."""
        minimum, most = box_ends(lower, upper, "n")
        centre, scale = coordinates(minimum, most, np.zeros(len(minimum)))
        least, top = (minimum - centre) / scale, (most - centre) / scale
        ends = [dict.fromkeys(pair) for pair in zip(least, top, strict=True)]
        unit, wide = np.eye(len(least)), least < top
        return cls._of_shape(
            np.array(list(itertools.product(*ends))),
            np.column_stack([np.vstack([unit[wide], -unit[wide]]), np.concatenate([top[wide], -least[wide]])]),
            np.column_stack([unit[~wide], top[~wide]]),
            centre,
            scale,
        )

    @classmethod
    def _of_shape(cls, points: Floats, facets: Floats, equations: Floats, centre: Floats, scale: Floats) -> Self:
        """Return a polytope whose vertices and facets are known; the incidence follows from their distances."""
        unit = np.ldexp(1.0, -np.frexp(np.abs(facets).max(axis=1))[1])
        facets = facets * unit[:, None]
        on = facets[:, -1] - points @ facets[:, :-1].T <= dd.ON * max(1.0, float(np.abs(points).max()))
        return cls(points, facets, equations, dd.packed(on), centre, scale)

    @classmethod
    def from_ball(cls, centre: ArrayLike, radius: float, *, outer: bool = True) -> Self:
        """Return a polytope around the ball with `centre`, shape (n,), and `radius`, or in it.

        Its facets, or its vertices if not `outer`, are in the 3^n - 1 directions whose components are in ratios of -1,
        0 and 1; it has 2^n n! vertices, or facets. It extends beyond the ball, or stays inside it, by the factor 1.09
        in two dimensions, 1.13 in three and 1.21 in six at most.
        """
        middle, size = finite_values("centre", centre, "n"), float(radius_values(radius))
        space = len(middle)
        rows = np.array([row for row in itertools.product((-1.0, 0.0, 1.0), repeat=space) if any(row)])
        rows /= np.linalg.norm(rows, axis=1)[:, None]
        # The hyperplane through (1, 0, ..), (1, 1, 0, ..) / sqrt(2), .. is one side; symmetry gives the others.
        side = np.diff(np.sqrt(np.arange(space + 1)))
        signs = np.array(list(itertools.product((-1.0, 1.0), repeat=space)))
        sides = (np.array(list(itertools.permutations(side)))[:, None] * signs).reshape(-1, space)
        if size <= 1e-13 * np.abs(middle).max():  # rounding of the coordinates is larger
            return cls.from_vertices(middle + size * (sides if outer else rows))
        points, normals = (sides, rows) if outer else (rows, sides)
        offsets = np.ones(len(normals)) if outer else dd.supports(points, normals)
        base, scale = coordinates(middle - size, middle + size, np.zeros(space))
        shift, share = (middle - base) / scale, size / scale
        facets = normals / share
        return cls._of_shape(
            shift + share * points,
            np.column_stack([facets, offsets + facets @ shift]),
            np.zeros((0, space + 1)),
            base,
            scale,
        )

    @classmethod
    def from_zonotope(cls, centre: ArrayLike, generators: ArrayLike) -> Self:
        """Return {centre + sum of z_i generators[i]: -1 <= z_i <= 1}; `generators`, shape (g, n), has a row for each.

        One hull for each generator: O(g^(n-1)) vertices.
        """
        middle = finite_values("centre", centre, "n")
        zonotope = cls.from_vertices(middle[None, :])
        for row in finite_values("generators", generators, "g", len(middle)):
            zonotope = cls.from_vertices(np.vstack([zonotope.vertices - row, zonotope.vertices + row]))
        return zonotope

    @classmethod
    def from_shapely(cls, geometry: BaseGeometry) -> Self:
        """Return a convex shapely Point, LineString or Polygon as a set of R^2; see `ConvexPolygons.from_shapely`."""
        from infoset.geometry.polygon_arrays import PolygonArrays

        vertices = PolygonArrays.from_shapely(geometry).polygon()
        return cls.from_vertices(vertices) if len(vertices) else cls.empty(2)

    def to_shapely(self) -> BaseGeometry:
        """Return a set of R^2 as a shapely Point, LineString or Polygon; the empty set is an empty Polygon."""
        from infoset.geometry.polygon_arrays import PolygonArrays

        return PolygonArrays.from_points(self._of_plane().vertices).to_shapely()

    def _of_plane(self) -> Self:
        """Return the set; it must be in the plane."""
        if self.space != 2:
            raise ValueError(f"a set of R^2 is needed: project this one, of R^{self.space}, on two axes first")
        return self

    # Double description -----------------------------------------------------------------------------------------------

    @classmethod
    def _of_points(cls, points: Floats, flat: float = FLAT) -> Self:
        """Return the hull of points whose coordinates are exact."""
        lower, upper = points.min(axis=0), points.max(axis=0)
        # The minimum width also keeps a set that is nearly flat along an axis from being blown up to rounding errors.
        centre, scale = coordinates(lower, upper, 1e-10 * np.maximum(np.abs(lower), np.abs(upper)))
        return cls._hull((points - centre) / scale, centre, scale, flat)

    @classmethod
    def _hull(cls, points: Floats, centre: Floats, scale: Floats, flat: float, errors: Floats | None = None) -> Self:
        """Return the convex hull of points in scaled coordinates, known to `errors`, shape (n,).

        Points that span no more than d dimensions differ in d coordinates, found by complete pivoting. The hull is
        computed in these; the other coordinates are functions of them.
        """
        space = points.shape[1]
        start = np.column_stack([points, np.ones(len(points))])
        chosen, columns = dd.pivots(start, flat, 0)
        own, rest = columns[1:], np.delete(np.arange(space), columns[1:])
        dimension = len(own)
        equations = np.zeros((len(rest), space + 1))
        if len(rest):
            basis = start[chosen][:, [*own, space]]
            slopes = np.linalg.solve(basis, points[np.ix_(chosen, rest)]).T
            equations[:, own], equations[:, -1] = -slopes[:, :-1], slopes[:, -1]
            equations[np.arange(len(rest)), rest] = 1.0
        if not dimension:
            nothing, none = np.zeros((0, space + 1)), np.zeros((1, 1), np.uint64)
            return cls(points[:1].copy(), nothing, equations, none, centre, scale)
        inner = np.ascontiguousarray(points[:, own])
        for joggle in _JOGGLES:
            # Points that have moved have simplices as facets; offsets follow from the points themselves.
            moved = inner + joggle * np.random.default_rng(0).uniform(-1.0, 1.0, inner.shape)
            rows = np.column_stack([-moved, np.ones(len(inner))])
            rays, on, _ = dd.extreme_rays(rows, np.ones(len(rows)), False, 0.0)
            incidence = dd.transposed(on, len(rows))
            used = np.flatnonzero(dd.maximal(incidence, dimension))
            sides, incidence = _facets_of(incidence[used], len(rays), dimension)
            if _agree(incidence, len(sides), dimension):
                break
        else:
            raise UncertainHullError(f"rounding decides which of {len(points)} points are vertices")
        facets = np.zeros((len(sides), space + 1))
        facets[:, own] = rays[sides, :-1]
        facets[:, -1] = dd.supports(inner, np.ascontiguousarray(rays[sides, :-1]))
        vertices = points[used]
        if errors is not None and errors.any():
            facets[:, -1] += (1.0 + dd.EPS) * np.abs(facets[:, :-1]) @ errors
            vertices = dd.push_out(vertices, facets, incidence, np.ones(len(used), bool), len(rest) > 0, dd.TIP)
        return cls(vertices, facets, equations, incidence, centre, scale)

    @classmethod
    def _of_rows(
        cls,
        rows: Floats,
        limits: Floats,
        terms: tuple[Floats, Floats] | None = None,
        box: tuple[Floats, Floats] | None = None,
        origin: Floats | float = 0.0,
    ) -> Self:
        """Return {x: rows (x - origin) <= limits}.

        `terms`, shapes (m, n) and (m,), are the sizes of what rows and limits were computed from. The coordinates in
        which the set is round are not known before the set, unless a `box`, two ends, contains it; so it is computed
        again if others are much better.
        """
        space = rows.shape[1]
        if np.isneginf(limits).any():
            return cls.empty(space)
        if not (limited := limits < np.inf).all():
            rows, limits = rows[limited], limits[limited]
        # In too small a scale a set seems to be empty or unbounded, in too large a one it has no width.
        for share in (0.25, 1.0):
            if box is None:
                centre, scale = np.zeros(space), _guess(rows, limits, share)
            else:
                centre, scale = coordinates(*box, 1e-10 * np.abs(box).max(axis=0))
            try:
                found = cls._intersect(rows, limits, terms, (origin, centre, scale))
            except (UnboundedPolytopeError, UncertainHullError):
                if share == 1.0 or box is not None:
                    raise
            else:
                if box is not None or not found.is_empty:
                    break
        flat = np.zeros(space, bool)
        for _ in range(8):
            if found.is_empty:
                break
            lower, upper = found.points.min(axis=0), found.points.max(axis=0)
            # An axis along which the set has no width is tried once in finer coordinates.
            narrow = (_ROUND * (upper - lower) < 1.0) & ((upper > lower) | ~flat)
            flat = upper == lower
            if max(-lower.min(), upper.max()) <= _ROUND and not narrow.any():
                break
            ends = found.centre + found.scale * lower, found.centre + found.scale * upper
            centre, scale = coordinates(*ends, np.maximum(_GAIN * found.scale, 1e-10 * np.abs(ends).max(axis=0)))
            if (centre == found.centre).all() and (scale == found.scale).all():
                break
            try:
                better = cls._intersect(rows, limits, terms, (origin, centre, scale))
            except (UnboundedPolytopeError, UncertainHullError):
                break
            if better.is_empty:
                break
            found = better
        return found

    @classmethod
    def _intersect(
        cls,
        rows: Floats,
        limits: Floats,
        terms: tuple[Floats, Floats] | None,
        coordinates: tuple[Floats | float, Floats, Floats],
    ) -> Self:
        """Return {x: rows (x - origin) <= limits}, computed in coordinates: an origin, a centre and scales."""
        origin, centre, scale = coordinates
        space = rows.shape[1]
        scaled, slack, possible = _scaled_rows(rows, limits, terms, centre - origin, scale)
        if not possible:
            return cls.empty(space, (rows, limits))
        # The first row is t >= 0.
        table, slack = np.zeros((len(scaled) + 1, space + 1)), np.append(1.0, slack)
        table[0, -1] = 1.0
        table[1:] = scaled * ([-1.0] * space + [1.0])
        for joggle in _JOGGLES:
            # Half-spaces that move outward by different amounts have simple vertices.
            table[1:, -1] = scaled[:, -1] + joggle * np.random.default_rng(0).uniform(0.5, 1.0, len(scaled))
            rays, on, rank = dd.extreme_rays(table, slack, True, dd.ON)
            if rank <= space:
                return cls._unbounded(table, slack, (rows, limits), scale)
            ends = rays[:, -1] == 1.0
            if not ends.any():
                return cls.empty(space, (rows, limits))
            if not ends.all():
                raise UnboundedPolytopeError(rays[~ends][0, :-1] * scale)
            incidence = dd.transposed(dd.transposed(on, len(table))[1:], len(rays))  # no point lies on the first row
            start = cls(rays[:, :-1].copy(), scaled, np.zeros((0, space + 1)), incidence, centre, scale)
            with suppress(UncertainHullError):
                return start._reduced(np.ones(len(rays), bool))
        raise UncertainHullError(f"rounding decides where {len(rows)} half-spaces meet")

    @classmethod
    def _unbounded(cls, table: Floats, slack: Floats, conflict: tuple[Floats, Floats], scale: Floats) -> Self:
        """Return the empty set, or raise an error, for rows that do not depend on all coordinates."""
        chosen, columns = dd.pivots(table, dd.ON, 0)
        free = np.setdiff1d(np.arange(table.shape[1]), columns)
        rays, _, _ = dd.extreme_rays(np.ascontiguousarray(table[:, np.sort(columns)]), slack, True, dd.ON)
        if not (rays[:, -1] == 1.0).any():
            return cls.empty(len(scale), conflict)
        direction = np.zeros(table.shape[1])
        direction[free[0]] = 1.0
        direction[columns] = -np.linalg.solve(table[np.ix_(chosen, columns)], table[chosen, free[0]])
        raise UnboundedPolytopeError(direction[:-1] * scale)

    def _reduced(self, new: Flags) -> Self:
        """Return the set without redundant vertices and facets; new vertices do not lie inside their facets.

        Facets on which all vertices lie are equations of a set of lower dimension: the hull of its vertices.
        """
        dimension, incidence, facets = self.dimension, self.incidence, self.facets
        whole = np.bitwise_and.reduce(incidence, axis=0)
        flat = bool(whole.any()) or len(self.points) <= dimension
        points = dd.push_out(self.points, facets, incidence & ~whole, new, flat or len(self.equations) > 0, dd.TIP)
        if flat:
            return self._hull(points, self.centre, self.scale, 1e2 * FLAT)
        used = np.flatnonzero(dd.maximal(incidence, dimension))
        sides, incidence = _facets_of(incidence[used], len(facets), dimension)
        if not _agree(incidence, len(sides), dimension):
            raise UncertainHullError(f"rounding decides where {len(facets)} half-spaces meet")
        return replace(self, points=points[used], facets=facets[sides], incidence=incidence)

    def _with_rows(self, rows: Floats, limits: Floats, origin: Floats | float = 0.0) -> Self:
        """Return the part where rows (x - origin) <= limits, shapes (m, n) and (m,); the set itself if this is all."""
        scaled, slack, possible = _scaled_rows(rows, limits, None, self.centre - origin, self.scale)
        heights = self.points @ scaled[:, :-1].T - scaled[:, -1]
        cuts = np.flatnonzero(heights.max(axis=0) > dd.ON * slack * max(1.0, float(np.abs(self.points).max())))
        if not len(cuts) and possible:
            return self
        rays, count = np.column_stack([self.points, np.ones(len(self.points))]), len(self.facets)
        bits: dd.Bits = np.zeros((len(rays), (count + len(cuts) + 63) // 64), np.uint64)
        bits[:, : self.incidence.shape[1]] = self.incidence[:, : bits.shape[1]]
        for number, cut in enumerate(cuts, count):
            row = np.append(-scaled[cut, :-1], scaled[cut, -1])
            rays, bits = dd.insert(rays, bits, row, slack[cut], number, self.dimension - 1, True)
        sides = np.vstack([self.facets, scaled[cuts]])
        if not len(rays) or not possible:
            own, ends = self.constraints()
            return self.empty(
                self.space,
                (np.vstack([own, rows]), np.append(ends, limits + rows @ np.broadcast_to(origin, self.space))),
            )
        part = replace(self, points=rays[:, :-1].copy(), facets=sides, incidence=bits)
        new = np.asarray(dd.unpacked(bits, len(sides))[:, count:].any(axis=1))
        lower, upper, before = part.points.min(axis=0), part.points.max(axis=0), np.ptp(self.points, axis=0)
        with suppress(UncertainHullError):
            # An axis along which the part has no width is no reason: its equations fix that coordinate.
            if not ((SMALL * (upper - lower) < before) & (upper - lower > FLAT * before)).any():
                return part._reduced(new)
        # The result is much smaller: again, in its own coordinates, with the rows on which it has vertices and a box.
        margin = 2.0**-8 * before  # far from the set: rounding can have moved sharp corners of the part
        unit, box = np.eye(self.space), (lower - margin, upper + margin)
        used = np.bitwise_or.reduce(bits, axis=0)[None]
        sides = np.vstack([sides[dd.unpacked(used, len(sides))[0]], self.equations, -self.equations])
        rows = np.vstack([sides[:, :-1], unit, -unit]) / self.scale
        around = self.centre + self.scale * box[0], self.centre + self.scale * box[1]
        with suppress(UncertainHullError, UnboundedPolytopeError):
            better = self._of_rows(
                rows, np.concatenate([sides[:, -1], box[1], -box[0]]), box=around, origin=self.centre
            )
            if not better.is_empty:
                return better
        return part._reduced(new)

    # Representation ---------------------------------------------------------------------------------------------------

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

    @cached_property
    def vertices(self) -> Floats:
        """Vertices, shape (v, n)."""
        return self.centre + self.scale * self.points

    @property
    def normals(self) -> Floats:
        """Normals of the facets, shape (f, n), of unit length, in the directions of the affine hull."""
        return self._sides[0]

    @property
    def offsets(self) -> Floats:
        """Offsets of the facets, shape (f,): normals x <= offsets."""
        return self._sides[1]

    @property
    def across(self) -> Floats:
        """Orthonormal normals of the affine hull, shape (n - dimension, n)."""
        return self._sides[2]

    @property
    def levels(self) -> Floats:
        """Levels of the affine hull, shape (n - dimension,): across x = levels."""
        return self._sides[3]

    @cached_property
    def relaxation(self) -> float:
        """Minimum relaxation of the constraints of an empty set, normals of unit length, with which a point satisfies
        all; 0 if it is not known. One linear program (HiGHS).
        """
        if self.conflict is None:
            return 0.0
        rows, limits = self.conflict
        lengths = np.linalg.norm(rows, axis=1)
        if not lengths.all():
            return float(max(0.0, -limits[lengths == 0.0].min()))
        with suppress(UncertainHullError):
            return max(0.0, -largest_ball(rows / lengths[:, None], limits / lengths, _guess(rows, limits))[1])
        return 0.0

    @cached_property
    def _sides(self) -> tuple[Floats, Floats, Floats, Floats]:
        """Normals and offsets, across and levels."""
        if self.is_empty:
            nothing = np.zeros((0, self.space))
            return np.zeros((1, self.space)), -np.ones(1), nothing, nothing[:, 0]
        rows, limits = (part[: len(self.facets)] for part in self._rows())
        rounding = 4.0 * dd.EPS * np.abs(self.vertices).max(axis=0)
        if not len(self.equations):
            lengths = np.linalg.norm(rows, axis=1)
            normals, offsets = rows / lengths[:, None], limits / lengths
            rounded = (np.frexp(lengths)[0] != 0.5) | (self.centre.any() & (rows != 0.0)).any(axis=1)
            return normals, offsets + rounded * (np.abs(normals) @ rounding), rows[:0], limits[:0]
        steps = self._steps
        columns, gradients = orthonormal(steps, self.facets[:, :-1] @ (steps / self.scale[:, None]))
        normals = gradients @ columns.T
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        across = orthonormal((self.equations[:, :-1] / self.scale).T, np.zeros((0, len(self.equations))))[0].T
        levels = 0.5 * dd.supports(self.vertices, across) - 0.5 * dd.supports(self.vertices, -across)
        return normals, dd.supports(self.vertices, normals), across, levels

    @cached_property
    def _steps(self) -> Floats:
        """A basis of the directions of the affine hull, shape (n, d): changes of d coordinates by their scales."""
        own, steps = self._own, np.zeros((self.space, self.dimension))
        steps[own] = np.eye(len(own))
        steps[np.delete(np.arange(self.space), own)] = -self.equations[:, own]
        return self.scale[:, None] * steps

    @property
    def _own(self) -> Integers:
        """The d coordinates of which the others are functions."""
        # Columns of the identity in the equations, in their order, are those of the others.
        bound = self.equations[:, :-1]
        rest = [int(np.flatnonzero((unit == bound.T).all(axis=1))[0]) for unit in np.eye(len(bound))]
        return np.delete(np.arange(self.space), rest)

    def constraints(self) -> tuple[Floats, Floats]:
        """Return normals, shape (k, n), of unit length, and offsets, shape (k,): the set is normals x <= offsets.

        An equation of a flat set gives two rows; an empty set is 0 x <= -1.
        """
        rows = np.vstack([self.normals, self.across, -self.across])
        return rows, np.concatenate([self.offsets, self.levels, -self.levels])

    def _rows(self, origin: Floats | float = 0.0) -> tuple[Floats, Floats]:
        """Return half-spaces rows (x - origin) <= limits: the facets, and two of each equation."""
        sides = np.vstack([self.facets, self.equations, -self.equations])
        rows, limits, shift = sides[:, :-1] / self.scale, sides[:, -1], self.centre - origin
        return rows, dd.affine_image(shift[None], rows, limits)[0][0] if shift.any() else limits

    def needed(self) -> Self:
        """Return the set itself.

        Raises
        ------
        EmptyPolytopeError
            If it is empty; the error has the minimum relaxation of the constraints.
        """
        if self.is_empty:
            raise EmptyPolytopeError(self.relaxation)
        return self

    def __repr__(self) -> str:
        if self.is_empty:
            return f"<empty polytope in R^{self.space}>"
        return (
            f"<polytope of dimension {self.dimension} in R^{self.space}: "
            f"{len(self.points)} vertices, {len(self.facets)} facets>"
        )


def coordinates(lower: Floats, upper: Floats, minimum: Floats) -> tuple[Floats, Floats]:
    """Return a centre and scales, powers of two, for a set between two points, or as wide as `minimum`, each (n,)."""
    widths = np.maximum(upper - lower, minimum)
    scale = np.ldexp(1.0, np.frexp(np.where(widths > 0.0, widths, 1.0))[1] - 1)
    far = np.maximum(np.abs(lower), np.abs(upper)) > _FAR * scale
    return np.where(far, 0.5 * lower + 0.5 * upper, 0.0), scale


def _guess(rows: Floats, limits: Floats, share: float = 0.25) -> Floats:
    """Return sizes of coordinates, powers of two, shape (n,): those at which a `share` of the rows is tight."""
    large = np.abs(rows) > 1e-14 * np.abs(rows).max(axis=1, initial=0.0, keepdims=True)  # others may be rounding
    used = np.where(large.any(axis=0), large, rows != 0.0) & (limits[:, None] != 0.0)
    counts, order = used.sum(axis=0), np.arange(rows.shape[1])
    if not counts.any():
        return np.ones(rows.shape[1])
    sizes = np.where(used, np.abs(limits)[:, None] / np.where(used, np.abs(rows), 1.0), np.inf)
    sizes = np.sort(sizes, axis=0)[(share * np.maximum(counts - 1, 0)).astype(np.int64), order]
    # Where no row is tight away from zero, the unit is that of the others.
    sizes[counts == 0] = np.sort(sizes[counts > 0])[(counts > 0).sum() // 2]
    return np.asarray(np.ldexp(1.0, np.frexp(sizes)[1]))


def _scaled_rows(
    rows: Floats, limits: Floats, terms: tuple[Floats, Floats] | None, shift: Floats, scale: Floats
) -> tuple[Floats, Floats, bool]:
    """Return rows (a, b), a . y <= b, the factors of their tolerances, and whether rows without a direction hold.

    A row whose length is rounding has no direction. The longest entry of the others is from 1/2 to 1.
    """
    inner, ends = rows * scale, limits
    sizes, reach = np.abs(inner).max(axis=1, initial=0.0), np.abs(limits)
    shortest, noise = _SHORT * sizes.max(initial=0.0), np.zeros(len(rows))
    if terms is not None:
        noise, reach = (terms[0] * scale).max(axis=1) + terms[1], terms[1]
        shortest = _VOID * (terms[0] * scale).max(axis=1)
    if shift.any():
        ends = dd.affine_image(shift[None], -rows, limits)[0][0]
    directed = sizes > shortest
    possible = bool((ends >= -_VOID * np.maximum(reach.max(initial=0.0), 1e-300))[~directed].all())
    if not directed.all():
        inner, ends, sizes, noise = inner[directed], ends[directed], sizes[directed], noise[directed]
    unit = np.ldexp(1.0, -np.frexp(np.maximum(sizes, np.abs(ends)))[1])
    scaled = np.empty((len(inner), len(scale) + 1))
    scaled[:, :-1], scaled[:, -1] = inner * unit[:, None], ends * unit
    # Rows that were computed are known to 9 roundings of their terms.
    return scaled, np.maximum(1.0, noise * unit / 512.0), possible


def _facets_of(incidence: dd.Bits, count: int, dimension: int) -> tuple[Integers, dd.Bits]:
    """Return which of `count` rows are facets, and the incidence of vertices with these alone."""
    sides = dd.transposed(incidence, count)
    used = np.flatnonzero(dd.maximal(sides, dimension))
    return used, dd.transposed(sides[used], len(incidence))


def _agree(incidence: dd.Bits, facets: int, dimension: int) -> bool:
    """Whether each vertex has at least d facets and edges, and each facet d vertices and ridges."""
    if min(len(incidence), facets) <= dimension:
        return False
    return all(dd.have_neighbours(bits, dimension) for bits in (incidence, dd.transposed(incidence, facets)))
