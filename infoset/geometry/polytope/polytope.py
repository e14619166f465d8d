"""A convex polytope in R^n, in both representations."""

from __future__ import annotations

import itertools
from dataclasses import replace
from fractions import Fraction
from functools import cached_property
from math import factorial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.distance import cdist

from infoset.arrays import Flags, Floats, Integers
from infoset.geometry import conversion
from infoset.geometry._set_arguments import (
    axis_numbers,
    bound_values,
    box_ends,
    constraint_values,
    finite_values,
    need_finite,
    not_negative,
    offset_values,
    radius_values,
)
from infoset.geometry.convex_set import ConvexSet, need_convex_set
from infoset.geometry.double_words import affine_image, supports
from infoset.geometry.drawing import axes_of, draw_facets, draw_polygons, limits_of, ring_order
from infoset.geometry.polytope import cone, construction, polyhedron
from infoset.geometry.polytope import double_description as dd
from infoset.geometry.polytope._measures import largest_ball, simplices_of, triangle_of
from infoset.geometry.polytope.arrays import PolytopeArrays, half_spaces, own_and_others
from infoset.geometry.polytope.generators import polytope_of
from infoset.geometry.polytope.hulls import hull, hull_of
from infoset.geometry.polytope.nearest import nearest_pair
from infoset.geometry.polytope.outward import image, swept
from infoset.geometry.polytope.reduction import reduced_outward
from infoset.geometry.tolerances import EPS, ON, REDUCED, SNAP, UNSURE
from infoset.geometry.zonotope_arrays import ZonotopeArrays, need_zonotope
from infoset.limits import COUNT, Limits, real_values

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

_WIDE = 2.0**6
"""Maximum coordinate of a sum, in the coordinates in which one of its terms is one wide, from which
the sum gets its own coordinates: up to it at most two digits are lost.
"""


class Polytope(PolytopeArrays, ConvexSet):
    """A convex polytope; it may be flat, a segment, a point, empty, or unbounded.

    It is {x: normals x <= offsets, across x = levels}, and the hull of its `vertices`, shape (v,
    n), without redundant points. The f normals of the facets have unit length and are in the
    directions of the affine hull; the n - dimension rows of `across` are orthonormal. The
    constructors are the methods `from_...`.

    One algorithm, the double description, computes all sets; its result is checked, and where the
    check fails exact integers decide, which takes longer. Given vertices and facets are kept;
    computed ones are rounded outward, by about 1e-12 of the size. A set that is
    thinner than 7e-12, in units in which it is one wide along each axis, counts as flat: across it,
    the exact set may be as thick as this. A set that sticks out by less than 1e-12 of its size
    from a half-space touches it.

    The arrays are stored in scaled coordinates y, x = `centre` + `scale` y, with powers of two,
    which round nothing: `points`, shape (v, n), and rows (a, b) of `facets`, a . y <= b, shape (f,
    n + 1), and of `equations`, a . y = b, shape (n - dimension, n + 1). `incidence[i, j]`, shape
    (v, f), is whether vertex i is on facet j.

    An unbounded set is the sum of the hull of its `vertices`, of the cone of its `directions` and
    of the span of its `lines`; one that contains lines has points of its smallest faces in the
    place of vertices. It is stored and computed in exact integers (`exact`), which takes longer; a
    result that is bounded is rounded to nearest. Infinite results are inf; results that do not
    exist, such as a centroid, raise an UnboundedPolytopeError.

    Operations on the empty set give the empty set, except `convex_hull` with another set; points
    such as its centroid do not exist (EmptyPolytopeError). All arguments are checked: numbers are
    finite (TypeError if they are not real numbers), shapes and spaces fit (ValueError).

    The other set of an operation may also be a `Zonotope` or a single polygon of `ConvexPolygons`:
    it is converted.

    Operators: `P & Q` (intersection), `P + Q` (Minkowski sum), `P + vector` (translation), `A @ P`
    (linear map), `2 * P`, `-P`, `point in P`, `P <= Q` (subset, to rounding); `ConvexSet` defines
    them by the methods of these names. `P == Q` compares objects; `equals` compares sets. The
    vertices are not ordered; `plot` and `to_shapely` order the vertices of a set of the plane.
    """

    def polytope(self) -> Polytope:
        """Return the set itself; every class of sets has this method."""
        return self

    @classmethod
    def _of(cls, arrays: PolytopeArrays) -> Polytope:
        """Return a polytope with these arrays."""
        if isinstance(arrays, cls):
            return arrays
        return cls(
            arrays.points,
            arrays.facets,
            arrays.equations,
            arrays.incidence,
            arrays.centre,
            arrays.scale,
            arrays.exact,
        )

    @classmethod
    def _of_exact(cls, found: polyhedron.Polyhedron) -> Polytope:
        """Return a set that was computed in exact integers."""
        return cls._of(construction.of_polyhedron(found))

    @classmethod
    def empty(cls, space: int) -> Polytope:
        """Return the empty set of R^n, n = `space`."""
        COUNT.need("space", space)
        return cls._of(construction.empty(space))

    @classmethod
    def from_vertices(cls, points: ArrayLike, flat: float = SNAP) -> Polytope:
        """Return the convex hull of `points`, shape (m, n), at least one.

        Its vertices are points, bit for bit. `flat` is the relative thickness below which a set
        counts as flat: greater for points that are known to fewer digits. The facets are the rays
        of a double description: O(m f) for f facets in the plane, O(m f^2) at worst.
        """
        # A copy has the order of entries for which kernels are compiled.
        array = finite_values("points", points, "m", "n").copy()
        return cls._of(hull_of(array, flat))

    @classmethod
    def from_constraints(
        cls,
        normals: ArrayLike,
        offsets: ArrayLike,
        across: ArrayLike | None = None,
        levels: ArrayLike = (),
    ) -> Polytope:
        """Return {x: normals x <= offsets, across x = levels}.

        The shapes are (m, n), (m,), (k, n) and (k,). The set may be empty or unbounded. Rows with
        an offset of inf are left out, and -inf gives the empty set. One step of the double
        description for each row.
        """
        rows, limits = constraint_values(("normals", "offsets"), normals, offsets, "k", "n")
        if across is not None:
            flat, heights = constraint_values(
                ("across", "levels"), across, levels, "k", rows.shape[1]
            )
            need_finite("levels", heights)
            rows = np.vstack([rows, flat, -flat])
            limits = np.concatenate([limits, heights, -heights])
        return cls._of(construction.of_half_spaces(rows, limits))

    @classmethod
    def space_of(cls, space: int) -> Polytope:
        """Return R^n, n = `space`."""
        COUNT.need("space", space)
        return cls.from_rays(np.zeros((1, space)), lines=np.eye(space))

    @classmethod
    def halfspace(cls, normal: ArrayLike, offset: float) -> Polytope:
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
    def from_rays(
        cls, points: ArrayLike, directions: ArrayLike = (), lines: ArrayLike = ()
    ) -> Polytope:
        """Return the hull of `points` and of the rays from them along `directions` and `lines`.

        A line is a ray in both of its directions. The shapes are (m, n), m at least 1, (k, n) and
        (l, n). Without directions and lines it is `from_vertices`.
        """
        array = finite_values("points", points, "m", "n")
        space = array.shape[1]
        far = polyhedron.as_directions(finite_values("directions", directions, "k", space))
        both = polyhedron.as_directions(finite_values("lines", lines, "k", space))
        if not far and not both:
            return cls.from_vertices(array)
        rows = polyhedron.as_points(array)
        return cls._of_exact(polyhedron.of_generators(space, rows, far, both))

    @classmethod
    def from_box(cls, lower: ArrayLike, upper: ArrayLike) -> Polytope:
        """Return {x: lower <= x <= upper} for bounds of shape (n,). Exact.

        It is flat along axes whose bounds are equal.
        """
        minimum, most = box_ends(lower, upper, "n")
        return cls._of(construction.box(minimum, most))

    @classmethod
    def from_ball(cls, centre: ArrayLike, radius: float, *, outer: bool = True) -> Polytope:
        """Return a polytope around the ball with `centre`, shape (n,), and `radius`, or in it.

        Its facets, or its vertices if not `outer`, are in the 3^n - 1 directions whose components
        are in ratios of -1, 0 and 1; it has 2^n n! vertices, or facets: 3840 in R^5. It extends
        beyond the ball, or stays inside it, by the factor 1.09 in two dimensions, 1.13 in three and
        1.19 in five at most.
        """
        middle = finite_values("centre", centre, "n")
        size = float(radius_values(radius))
        ratios = itertools.product((-1.0, 0.0, 1.0), repeat=len(middle))
        directions = np.array([row for row in ratios if any(row)])
        directions /= np.linalg.norm(directions, axis=1)[:, None]

        # A ball that is smaller than the rounding of its coordinates has no facets: the hull of the
        # points is its polytope then.
        if not outer or size <= ON * np.abs(middle).max():
            return cls.from_vertices(middle + size * directions)
        limits = np.full(len(directions), size)
        ends = middle - size, middle + size
        return cls._of(construction.of_half_spaces(directions, limits, middle, ends))

    @classmethod
    def from_shapely(cls, geometry: BaseGeometry) -> Polytope:
        """Return a convex shapely Point, LineString or Polygon as a set of R^2.

        See `ConvexPolygons.from_shapely`.
        """
        ring = conversion.ring_of_geometry(geometry)
        return cls.from_vertices(ring) if len(ring) else cls.empty(2)

    def to_shapely(self) -> BaseGeometry:
        """Return a set of R^2 as a shapely Point, LineString or Polygon.

        The empty set is an empty Polygon.
        """
        return conversion.geometry_of_ring(self._polygon())

    def _polygon(self) -> Floats:
        """Return the vertices of a set of R^2, shape (v, 2), counter-clockwise."""
        if self.space != 2:
            raise ValueError(
                f"a set of R^2 is needed: project this one, of R^{self.space}, on two axes first"
            )
        return conversion.ring_of_points(self.bounded().vertices)

    @classmethod
    def from_zonotope(cls, zonotope: ZonotopeArrays) -> Polytope:
        """Return a `Zonotope` as a polytope that contains it, larger by about 1e-12 of its size.

        Parallel generators are summed first. In up to three dimensions of the affine hull, all
        facets and vertices of the g generators follow from signs of determinants: O(g^2) facets,
        O(g^3). In more, or where rounding decides which generators are coplanar, it is a chain of
        `add_segment`.
        """
        given = need_zonotope("zonotope", zonotope)
        found: Polytope = polytope_of(cls, given.centre, given.generators)
        return found

    def affine_map(self, matrix: ArrayLike, offset: ArrayLike = 0.0) -> Polytope:
        """Return {matrix x + offset}.

        The matrix, singular or not, has the shape (m, n), and the offset (m,), or it is 0. Vertices
        are rounded once. If the matrix is regular and the set is not flat, its facets and incidence
        are mapped; otherwise the result is a hull, which may take long.
        """
        # Copies have the order of entries for which kernels are compiled.
        rows = finite_values("matrix", matrix, "m", self.space).copy()
        moved = offset_values(offset, len(rows)).copy()
        if self.is_empty:
            return self.empty(len(rows))
        if self.exact is not None:
            (shift,) = cone.rationals(moved[None])
            return self._of_exact(polyhedron.image(self.exact, cone.rationals(rows), shift))

        points, facets, centre, scale, errors = image(
            self.points, self.facets, self.centre, self.scale, rows, moved
        )
        if self.dimension < self.space or not len(facets):
            return self._of(construction.enlarged(hull(points, centre, scale), errors))
        mapped = replace(self, points=points, facets=facets, centre=centre, scale=scale)
        return self._of(construction.enlarged(mapped, errors))

    def preimage(self, matrix: ArrayLike, offset: ArrayLike = 0.0) -> Polytope:
        """Return {x in R^m: matrix x + offset in the set}, with a matrix of shape (n, m).

        A step of the double description for each facet. If the matrix has a null space, the
        preimage is unbounded or empty; it is computed in exact integers from the facets of the set.
        """
        factor = finite_values("matrix", matrix, self.space, "m")
        moved = offset_values(offset, self.space)
        if self.is_empty:
            return self.empty(factor.shape[1])
        if self.exact is not None or _has_null_space(factor):
            return self._exact_preimage(factor, moved)

        rows, limits = half_spaces(self, moved)
        mapped, rounded = affine_image(
            rows, np.ascontiguousarray(factor.T), np.zeros(factor.shape[1])
        )
        # Along the image of the matrix an equation of this set may be zero, to the rounding of its
        # own entries: of n + 2 operations, as in `_exact_preimage`.
        is_zero = np.abs(mapped) <= UNSURE * (self.space + 2) * (np.abs(rows) @ np.abs(factor))
        mapped[is_zero.all(axis=1)] = 0.0
        found = self._of(construction.of_half_spaces(mapped, limits))
        # A flat set stays flat: enlarged it would be thick. Without a centre and an offset the
        # limits are not moved, and so not rounded.
        is_exact = not (rounded.any() or moved.any() or self.centre.any())
        if found.dimension < found.space or is_exact:
            return found
        # The entries and the limits of the mapped rows are rounded once each, relative to
        # themselves: a facet moves by less than this.
        return found.enlarged(2.0 * EPS * np.abs(found.vertices).max(axis=0))

    def _exact_preimage(self, matrix: Floats, offset: Floats) -> Polytope:
        """Return {x: matrix x + offset in the set} in exact integers.

        Facets and equations are rounded: where they leave nothing, they are relaxed by the rounding
        of n + 2 operations.
        """
        factor = cone.rationals(matrix)
        (shift,) = cone.rationals(offset[None])
        found = polyhedron.preimage(self._polyhedron.half_spaces, factor, shift)
        if found.points or self.exact is not None:
            return self._of_exact(found)

        rows, limits = half_spaces(self, offset)
        sizes = np.abs(self.vertices).max(axis=0) + np.abs(offset) + np.abs(self.centre)
        rounding = (self.space + 2) * UNSURE * (np.abs(rows) @ sizes)
        relaxed = polyhedron.as_half_spaces(rows, limits + rounding)
        return self._of_exact(polyhedron.preimage(relaxed, factor, [Fraction(0)] * self.space))

    def minkowski_sum(self, other: ConvexSet) -> Polytope:
        """Return {x + y: x in the set, y in the other}: the hull of all sums of two vertices."""
        two = self._need_other(other)
        if self.is_empty:
            return self
        if two.is_empty:
            return two
        if self._any_is_unbounded(two):
            return self._of_exact(polyhedron.total(self._polyhedron, two._polyhedron))

        # The image of the product of both sets, of which only the vertices are needed.
        pairs = [
            np.repeat(self.points, len(two.points), axis=0),
            np.tile(two.points, (len(self.points), 1)),
        ]
        centre = np.append(self.centre, two.centre)
        scale = np.append(self.scale, two.scale)
        product = replace(self, points=np.hstack(pairs), centre=centre, scale=scale)
        return product.affine_map(np.tile(np.eye(self.space), 2))

    def add_segment(self, half: ArrayLike) -> Polytope:
        """Return the Minkowski sum with the segment from -half to +half, shape (n,).

        Each facet moves, and each ridge between two facets that face opposite ends of the segment
        becomes a facet. Where rounding decides which ridges do, the sum is a hull of points, which
        may take long.
        """
        along = finite_values("half", half, self.space)
        # In scaled coordinates, in which a tiny segment may underflow to zero.
        if self.is_empty or not (along / self.scale).any():
            return self
        if self.dimension < self.space or self.exact is not None:
            return self.minkowski_sum(self.from_vertices([-along, along]))

        points, facets, incidence, errors = swept(
            self.points, self.facets, self.incidence, along / self.scale
        )
        rough = replace(self, points=points, facets=facets, incidence=incidence)
        found = construction.settled(construction.enlarged(rough, errors), len(facets))
        if found is None:
            convex = hull(points, self.centre, self.scale)
            return self._of(construction.enlarged(convex, errors))
        whole = self._of(found)
        # The identity gives it coordinates of its own.
        return whole if np.abs(points).max() < _WIDE else whole.affine_map(np.eye(self.space))

    def enlarged(self, by: ArrayLike) -> Polytope:
        """Return a set that contains {x + e: |e_i| <= by_i}, with `by` of shape (n,).

        Each facet moves outward. A flat set is first made thick, by `by` or by 3e-8 of its
        coordinates to each side, whichever is more, so that the result is at least twice as thick
        as the exact set across its affine hull. O((v + f) n) for a set with an interior.
        """
        margin = finite_values("by", by, self.space)
        not_negative("by", float(margin.min()))
        if self.is_empty or not margin.any():
            return self
        if self.exact is not None:
            (distances,) = cone.rationals(margin[None])
            outward = polyhedron.moved_outward(self.exact.half_spaces, distances)
            return self._of_exact(polyhedron.of_half_spaces(self.space, outward))
        solid = self if self.dimension == self.space else self._layer(margin)
        return self._of(construction.enlarged(solid, margin / solid.scale))

    def _layer(self, margin: Floats) -> Polytope:
        """Return a flat set with an interior: its equations become two half-spaces each.

        Each is moved outward by a `margin`, shape (n,), or by REDUCED of its coordinates if this is
        more, so that the layer is twice as thick.
        """
        sizes = np.maximum(margin, REDUCED * np.abs(self.vertices).max(axis=0))
        rows = self.equations[:, :-1] / self.scale
        # Rounding does not lose a layer that is REDUCED thick in the coordinates in which the set
        # is one wide.
        heights = np.maximum(np.abs(rows) @ sizes, REDUCED)
        ends = np.vstack([self.equations, -self.equations])
        ends[:, -1] += np.tile(heights, 2)

        facets = np.vstack([self.facets, ends])
        solid = replace(self, facets=facets, equations=self.equations[:0])
        sides, limits = half_spaces(solid, self.centre)
        lower, upper = self.bounding_box()
        box = lower - sizes, upper + sizes
        return self._of(construction.of_half_spaces(sides, limits, self.centre, box))

    def minkowski_difference(self, other: ConvexSet) -> Polytope:
        """Return the Pontryagin difference {x: x + y in the set for all y in the other}.

        Each facet moves inward. If the difference is flat, rounding decides whether it is empty.

        Raises
        ------
        ValueError
            If the other set is empty and this one is not: every point would satisfy the condition.
        """
        two = self._need_other(other)
        if self.is_empty:
            return self
        if two.is_empty:
            raise ValueError("the difference with an empty set is unbounded")
        if self._any_is_unbounded(two):
            inward = polyhedron.moved_inward(self._polyhedron.half_spaces, two._polyhedron)
            if inward is None:
                return self.empty(self.space)
            return self._of_exact(polyhedron.of_half_spaces(self.space, inward))

        rows, limits = half_spaces(self, self.centre)
        if self.dimension < self.space:
            # The difference plus a point of the other set is a part of this one: it cannot leave
            # the affine hull.
            start = two.vertices[0]
            less = _less(limits, supports(two.vertices - start, rows))
            return self._of(construction.cut(self, rows, less, self.centre)).translate(-start)

        less = _less(limits, supports(two.vertices, rows))
        lower, upper = np.array(self.bounding_box()) - two.bounding_box()
        # Of an empty difference the box may be reversed: it has no width there, and serves only to
        # choose coordinates.
        ends = lower, np.maximum(lower, upper)
        sizes = np.abs(self.vertices - self.centre).max(axis=0) + np.abs(two.vertices).max(axis=0)
        return self._of(construction.of_half_spaces(rows, less, self.centre, ends, sizes))

    def intersection(self, *others: ConvexSet) -> Polytope:
        """Return the intersection with one or more polytopes.

        One step of the double description for each facet of all sets but one
        (`construction.cut`). If a set is unbounded, integers compute the intersection.
        """
        every = (self, *map(self._need_other, others))
        if self._any_is_unbounded(*every):
            if any(one.is_empty for one in every):
                return self.empty(self.space)
            rows = [row for one in every for row in one._polyhedron.half_spaces]
            return self._of_exact(polyhedron.of_half_spaces(self.space, rows))

        # Start from a flat set: its cuts stay in its affine hull. Of several sets, start from the
        # one with most facets: these are not inserted again.
        sets = sorted(every, key=lambda one: (one.dimension, -len(one.facets)))
        found = sets[0]
        for one in sets[1:]:
            if not found.is_empty:
                found = found._cut_by(one)
        return found

    def _cut_by(self, other: Polytope) -> Polytope:
        """Return the intersection with another bounded set.

        If the bounding boxes show that it is much smaller than this set, it is computed from all
        half-spaces together, in its own coordinates. `construction.cut` does the same if only the
        result shows this.
        """
        rows, limits = half_spaces(other, other.centre)
        ends = np.array([self.bounding_box(), other.bounding_box()])
        lower = ends[:, 0].max(axis=0)
        upper = ends[:, 1].min(axis=0)
        is_small = construction.FINE * (upper - lower) < np.ptp(self.vertices, axis=0)
        if is_small.any() and (lower <= upper).all():
            own, own_limits = half_spaces(self, other.centre)
            all_rows = np.vstack([own, rows])
            all_limits = np.append(own_limits, limits)
            found = construction.of_half_spaces(all_rows, all_limits, other.centre, (lower, upper))
            # If it is flatter than this set, rounding may decide this: a cut keeps sets that touch.
            if len(found.equations) == len(self.equations):
                return self._of(found)
        return self._of(construction.cut(self, rows, limits, other.centre))

    def convex_hull(self, *others: ConvexSet) -> Polytope:
        """Return the convex hull of the union with one or more polytopes.

        If a set is unbounded, it is the closure of the hull.
        """
        every = (self, *map(self._need_other, others))
        sets = [one for one in every if not one.is_empty]
        if not sets:
            return self
        if self._any_is_unbounded(*sets):
            return self._of_exact(polyhedron.hull([one._polyhedron for one in sets]))
        return self.from_vertices(np.vstack([one.vertices for one in sets]))

    def cut(
        self,
        normals: ArrayLike,
        lower: ArrayLike = -np.inf,
        upper: ArrayLike = np.inf,
        *,
        slack_ulp: float = 0.0,
    ) -> Polytope:
        """Return the part in one or more strips lower <= normals x <= upper.

        It is the set itself if they contain it. `normals`, shape (n,) or (m, n), have any length.
        The bounds have the shape () or (m,); infinite bounds give half-spaces. Each strip is wider
        on both sides by `slack_ulp` ulp of the products in normals x: a point that satisfies the
        bounds up to rounding is not lost.
        """
        given = real_values("normals", normals)
        shape: tuple[str | int, ...] = ("m", self.space) if given.ndim > 1 else (self.space,)
        rows = np.atleast_2d(finite_values("normals", given, *shape))
        minimum = bound_values("lower", lower, (), (len(rows),))
        most = bound_values("upper", upper, (), (len(rows),))
        sizes = np.abs(self.vertices).max(axis=0, initial=0.0)
        wider = not_negative("slack_ulp", slack_ulp) * EPS * (np.abs(rows) @ sizes)
        if self.is_empty:
            return self

        rows = np.vstack([rows, -rows])
        limits = np.concatenate([most + wider, wider - minimum])
        # A strip that is empty by less than the rounding of a cut must be decided here: for
        # `construction.cut` the set would touch both of its sides.
        if np.isneginf(limits).any() or (minimum > most + 2.0 * wider).any():
            return self.empty(self.space)
        rows = rows[limits < np.inf]
        limits = limits[limits < np.inf]
        if self.exact is not None:
            sides = [*self.exact.half_spaces, *polyhedron.as_half_spaces(rows, limits)]
            return self._of_exact(polyhedron.of_half_spaces(self.space, sides))
        return self._of(construction.cut(self, rows, limits))

    def project(self, axes: ArrayLike) -> Polytope:
        """Return the projection on `axes`, an integer or k integers, as a set of R^k."""
        return self.affine_map(np.eye(self.space)[axis_numbers(axes, self.space, self.space)])

    def slice(self, axes: ArrayLike, values: ArrayLike) -> Polytope:
        """Return the other coordinates of the points whose coordinates `axes` have some `values`.

        `axes` are not all axes. `values` is a number, or an array with a number for each axis.
        """
        numbers = axis_numbers(axes, self.space, self.space - 1)
        shape = (len(numbers),) if np.ndim(values) else ()
        fixed = finite_values("values", values, *shape)
        part = self.cut(np.eye(self.space)[numbers], fixed, fixed)
        return part.project(np.delete(np.arange(self.space), numbers))

    def reduce_outward(self, cap: int, max_vertices: int = 10**9) -> Polytope:
        """Return a polytope with few facets and vertices that contains the set.

        It has at most `cap` (>= 2n) facets and `max_vertices` (>= 2^n) vertices, by default any
        number in practice. It starts with the bounding box. Then it is cut by the facet with the
        greatest excess, relative to the width of the set along its normal, until the next cut would
        exceed `cap` or `max_vertices`. A flat set becomes thick by 3e-8 of its coordinates to each
        side.
        """
        Limits(minimum=2 * self.space, whole=True).need("cap", cap)
        self.bounded()
        sides = len(self.facets) + 2 * len(self.equations)
        is_small = sides <= cap and len(self.points) <= max_vertices
        if self.is_empty or is_small:
            return self
        solid = self if self.dimension == self.space else self._layer(np.zeros(self.space))
        return self._of(reduced_outward(solid, cap, max_vertices))

    def _need_other(self, other: ConvexSet) -> Polytope:
        """Return another set as a polytope; it must be in the same space."""
        polytope: Polytope = need_convex_set("other", other).polytope()
        if polytope.space != self.space:
            raise ValueError(f"other must be a set in R^{self.space}, as this one: got {other!r}")
        return polytope

    def _any_is_unbounded(self, *others: Polytope) -> bool:
        """Whether this set or another one is unbounded: their operation is computed in integers."""
        return not all(one.is_bounded for one in (self, *others))

    @cached_property
    def _polyhedron(self) -> polyhedron.Polyhedron:
        """The set in integers; of a bounded one, its vertices and facets as they are stored."""
        if self.exact is not None:
            return self.exact
        (centre,) = cone.rationals(self.centre[None])
        (scale,) = cone.rationals(self.scale[None])
        points = []
        for point in cone.rationals(self.points):
            axes = zip(centre, scale, point, strict=True)
            moved = [middle + unit * entry for middle, unit, entry in axes]
            points.append(cone.whole([*moved, Fraction(1)]))

        def unscaled(rows: Floats) -> tuple[cone.Row, ...]:
            """Return rows (a, b), a . y <= b, for x = centre + scale y."""
            table = []
            for row in cone.rationals(rows):
                normal = [entry / unit for entry, unit in zip(row[:-1], scale, strict=True)]
                products = (a * middle for a, middle in zip(normal, centre, strict=True))
                table.append(cone.whole([*normal, row[-1] + sum(products, Fraction(0))]))
            return tuple(table)

        facets = unscaled(self.facets)
        equations = unscaled(self.equations)
        return polyhedron.Polyhedron(self.space, tuple(points), (), (), facets, equations)

    def recession(self) -> Polytope:
        """Return the cone of the directions in which the set is unbounded, {0} if it is bounded.

        An EmptyPolytopeError is raised for the empty set.
        """
        return self._of_exact(polyhedron.recession(self.needed()._polyhedron))

    def support_function(self, directions: ArrayLike) -> Floats:
        """Return max direction . x, shape (...), for `directions`, shape (..., n). O(v n).

        It is -inf for the empty set, and inf where the set is unbounded. A product of two
        directions that is zero to rounding counts as zero.
        """
        rows = finite_values("directions", directions, "...", self.space)
        heights = np.asarray((rows @ self.vertices.T).max(axis=-1, initial=-np.inf))
        if self.exact is not None:
            heights = np.where(self._rises(rows), np.inf, heights)
        return heights

    def _rises(self, rows: Floats) -> Flags:
        """Whether the set is unbounded along `rows`, shape (..., n), to rounding of products."""
        along = np.vstack([self.directions, self.lines, -self.lines])
        rounding = 2.0 * (self.space + 2) * EPS * (np.abs(rows) @ np.abs(along).T)
        return np.asarray((rows @ along.T > rounding).any(axis=-1))

    def support_vector(self, direction: ArrayLike) -> Floats:
        """Return a vertex farthest along a `direction`, both of shape (n,). O(v n)."""
        row = finite_values("direction", direction, self.space)
        if self.exact is not None and self._rises(row):
            self.bounded()
        return np.asarray(self.vertices[int((self.needed().vertices @ row).argmax())])

    @cached_property
    def _outer_rows(self) -> tuple[Floats, Floats]:
        """The rows of `constraints`, with offsets that no vertex exceeds by their rounding."""
        rows, limits = self.constraints()
        # Points within the thickness of a flat set count as in its affine hull: the rows after the
        # facets are its equations.
        near = SNAP * (np.abs(rows) @ np.abs(self.vertices).max(axis=0))
        near[: len(self.facets)] = 0.0
        return rows, np.maximum(limits, self.support_function(rows)) + near

    def margin(self, points: ArrayLike) -> Floats:
        """Return the minimum distance of `points`, shape (..., n), from the facets, shape (...).

        It is positive inside. The equations of a flat set count as facets: it is negative farther
        than 7e-12 of the coordinates outside of the affine hull. It is -inf for the empty set. It
        is not negative at the vertices: the rounding of a scalar product, and of the representation
        (distances of vertices beyond facets), is added. Outside, -`margin` is at most the
        `distance`.
        """
        x = finite_values("points", points, "...", self.space)
        if self.is_empty:
            return np.full(x.shape[:-1], -np.inf)
        rows, limits = self._outer_rows
        sizes = np.maximum(np.abs(x), np.abs(self.vertices).max(axis=0))
        rounding = (self.space + 2) * EPS * sizes
        distances = limits + rounding @ np.abs(rows).T - x @ rows.T
        return np.asarray(distances.min(axis=-1, initial=np.inf))

    def contains(self, points: ArrayLike, tolerance: float = 0.0) -> Flags:
        """Return whether `points`, shape (..., n), are in the set, to rounding.

        Points within a `tolerance` of it (`margin`) count, too.
        """
        return np.asarray(self.margin(points) >= -not_negative("tolerance", tolerance))

    def is_subset(self, other: ConvexSet, tolerance: float = 0.0) -> bool:
        """Return whether the set is in the other one, to rounding, or within a `tolerance` of it.

        All vertices must be in the other set, and this set must not be unbounded in a direction in
        which the other one is bounded.
        """
        two = self._need_other(other)
        is_inside = bool(two.contains(self.vertices, tolerance).all())
        if self.is_empty or self.exact is None or not is_inside:
            return is_inside
        # Unbounded along a normal of the other set, this set leaves it.
        rows, _ = two.constraints()
        return not self._rises(rows).any()

    def volume(self) -> float:
        """Return the volume within the affine hull; 1 for a point, 0 for the empty set."""
        if self.is_empty:
            return 0.0
        if self.exact is not None:
            return float("inf")
        if not self.dimension:
            return 1.0
        # The steps of d scaled coordinates span a parallelotope of this volume.
        triangle, _ = triangle_of(self._steps)
        stretch = np.prod(np.abs(np.diag(triangle)))
        _, sizes = self._simplices
        return float(sizes.sum() * stretch / factorial(self.dimension))

    @cached_property
    def _simplices(self) -> tuple[Integers, Floats]:
        """Vertices of simplices that divide the set, shape (k, d + 1), and their determinants.

        The determinants are in d scaled coordinates.
        """
        if not self.dimension:
            return np.zeros((1, 1), np.int64), np.ones(1)
        corners = simplices_of(self.incidence.T, self.dimension)
        own, _ = own_and_others(self.equations)
        inner = self.points[:, own]
        edges = inner[corners[:, 1:]] - inner[corners[:, :1]]
        return corners, np.abs(np.linalg.det(edges))

    def area(self) -> float:
        """Return the area of a set of R^2; a ValueError is raised in other spaces.

        It is 0 for the empty set, a point or a flat set, and inf for an unbounded set with an
        interior. `volume` is for any space.
        """
        # `exact` exists only if the set is unbounded.
        if self.exact is not None and self.space == 2:
            return float("inf") if self.dimension == self.space else 0.0
        return self.volume() if len(self._polygon()) > 2 else 0.0

    def centroid(self) -> Floats:
        """Return the centroid within the affine hull, shape (n,), from a division in simplices."""
        corners, sizes = self.needed().bounded()._simplices
        mean = sizes / sizes.sum() @ self.points[corners].mean(axis=1)
        return np.asarray(self.centre + self.scale * mean)

    def sample(self, count: int, seed: int | np.random.Generator = 0) -> Floats:
        """Return points distributed uniformly over the set, shape (count, n).

        They are combinations of the vertices of simplices that divide the set.
        """
        random = np.random.default_rng(seed)
        corners, sizes = self.needed().bounded()._simplices
        weights = random.dirichlet(np.ones(corners.shape[1]), count)
        chosen = corners[random.choice(len(sizes), count, p=sizes / sizes.sum())]
        inner = np.einsum("ij,ijk->ik", weights, self.points[chosen])
        return np.asarray(self.centre + self.scale * inner)

    def chebyshev_centre(self) -> tuple[Floats, float]:
        """Return the centre, shape (n,), and radius of a largest ball within the affine hull.

        It is found by a linear program (HiGHS). An UnboundedPolytopeError is raised if the set has
        balls of any size.
        """
        middle = self.needed().vertices.mean(axis=0)
        if self.exact is not None and self.recession().dimension == self.dimension:
            self.bounded()
        if not self.dimension:
            return middle, 0.0
        inner, radius = largest_ball(
            self.normals @ self._steps, self.offsets - self.normals @ middle
        )
        return middle + self._steps @ inner, max(0.0, radius)

    def diameter(self) -> float:
        """Return the maximum distance between two points of the set. O(v^2 n).

        It is 0 for the empty set and inf for an unbounded one.
        """
        if self.exact is not None:
            return float("inf")
        return float(cdist(self.vertices, self.vertices).max(initial=0.0))

    def closest_point(self, point: ArrayLike) -> Floats:
        """Return the point of the set nearest to a `point`, both of shape (n,).

        It is exact to 1e-12 of the size of the set, also if the point is far away. Wolfe's
        algorithm: a least-squares problem of at most n + 1 points in each of a few steps.
        """
        x = finite_values("point", point, self.space)
        if x in self:
            return x
        if self.exact is not None:
            return x + self._nearest_difference(self.from_vertices(x[None]))
        return nearest_pair(self.needed().vertices, x[None]).point

    def distance(self, other: ConvexSet | ArrayLike) -> float:
        """Return the distance from a set or point `other`, shape (n,); inf if one is empty.

        See `closest_point`.
        """
        if not isinstance(other, ConvexSet):
            other = self.from_vertices(finite_values("other", other, self.space)[None])
        two = self._need_other(other)
        if two.is_empty or self.is_empty:
            return float("inf")
        return float(np.linalg.norm(self._nearest_difference(two)))

    def _nearest_difference(self, other: Polytope) -> Floats:
        """Return x - y, shape (n,), for nearest points x of this set and y of the other."""
        if not self._any_is_unbounded(other):
            return nearest_pair(self.vertices, other.vertices).difference
        # The nearest difference is at most as long as the difference of any two points: it is in a
        # box of the next power of two.
        differences = self + -other
        some = differences.vertices[0]
        size = float(np.ldexp(1.0, np.frexp(np.linalg.norm(some))[1]))
        near = differences & self.from_box(np.full(self.space, -size), np.full(self.space, size))
        return nearest_pair(near.vertices, np.zeros((1, self.space))).difference

    def isdisjoint(self, other: ConvexSet) -> bool:
        """Return whether no point is in both sets, to rounding; see `separating_direction`."""
        two = self._need_other(other)
        return self.is_empty or two.is_empty or self.separating_direction(two) is not None

    def separating_direction(self, other: ConvexSet) -> Floats | None:
        """Return a direction d, shape (n,), that proves that two sets are disjoint, or None.

        It has unit length, and d . x < d . y for all x of this set and y of the other. It is None
        if the sets meet, to rounding, or one is empty.
        """
        two = self._need_other(other)
        if self.is_empty or two.is_empty:
            return None
        between = two._nearest_difference(self)
        length = float(np.linalg.norm(between))
        # Sets that touch have no difference: the direction is then zero, and proves nothing.
        direction = np.asarray(between / (length or 1.0))
        is_proof = self.support_function(direction) < -two.support_function(-direction)
        return direction if is_proof else None

    def hausdorff_distance(self, other: ConvexSet) -> float:
        """Return the Hausdorff distance: the maximum `distance` of a vertex from the other set.

        It is inf between an empty and a nonempty set, and if the sets are not unbounded in the same
        directions.
        """
        two = self._need_other(other)
        have_points = not (self.is_empty or two.is_empty)
        are_unbounded = have_points and self._any_is_unbounded(two)
        if are_unbounded and not self.recession().equals(two.recession()):
            return float("inf")
        from_this = [two.distance(vertex) for vertex in self.vertices]
        from_other = [self.distance(vertex) for vertex in two.vertices]
        return max(from_this + from_other, default=0.0)

    def plot(self, ax: Any = None, **style: Any) -> list[Any]:
        """Draw a set of R^2 or R^3 on matplotlib axes, and return the artists.

        There is one artist, or none for the empty set. Without `ax` the present axes of pyplot are
        used, or new axes if these do not have the dimensions of the set. `style` has the options of
        matplotlib's `fill` in the plane and `Poly3DCollection` in space, and of `scatter` for a
        point. Facets in space are transparent. Segments and thin sets are visible by their edges.
        Of an unbounded set the part within the limits of the axes is drawn: set them before.

        Raises
        ------
        ValueError
            If the set is in another space, or the axes do not have its dimensions.
        """
        if self.space in (2, 3) and not self.is_bounded:
            axes = axes_of(ax, self.space)
            lower, upper = limits_of(axes, self.space)
            return (self & self.from_box(lower, upper)).plot(axes, **style)
        if self.space == 2:
            return draw_polygons(ax, [self._polygon()], style)
        if self.space == 3:
            return draw_facets(ax, self._facet_rings(), style)
        instead = "it is the interval of bounding_box()"
        if self.space > 3:
            instead = "project it on two or three axes first"
        raise ValueError(
            f"sets of R^2 and R^3 are drawn, and this one is of R^{self.space}: {instead}"
        )

    def _facet_rings(self) -> list[Floats]:
        """Return the vertices of each facet of a set of R^3 in their order around it.

        All vertices of a flat set are one facet.
        """
        if self.is_empty:
            return []
        faces = self.incidence.T
        if self.dimension < 3:
            faces = np.ones((1, len(self.points)), np.bool_)
        return [self.vertices[on][ring_order(self.points[on])] for on in faces]


def _less(limits: Floats, widths: Floats) -> Floats:
    """Return limits - widths, rounded up where they are rounded."""
    less = limits - widths
    is_exact = (less + widths == limits) & (limits - less == widths)
    return np.where(is_exact, less, np.nextafter(less, np.inf))


def _has_null_space(matrix: Floats) -> bool:
    """Whether matrix x = 0 has solutions other than zero, exactly decided."""
    # Pivots that are certainly not zero decide most cases; the others are decided by integers.
    units = dd.in_units(np.ascontiguousarray(matrix.T))
    chosen, _ = dd.pivots(units, REDUCED, -1)
    if len(chosen) == matrix.shape[1]:
        return False
    return bool(cone.null_space(cone.rationals(matrix)))
