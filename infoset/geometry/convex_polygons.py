"""Batches of convex polygons, and operations on them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from infoset.arrays import Flags, Floats, Integers
from infoset.geometry import conversion
from infoset.geometry import polygon_batches as kernels
from infoset.geometry._set_arguments import (
    axis_numbers,
    bound_values,
    box_ends,
    constraint_values,
    finite_values,
    need_finite,
    need_set,
    not_negative,
    offset_values,
    radius_values,
)
from infoset.geometry.convex_set import ConvexSet, need_convex_set
from infoset.geometry.drawing import draw_polygons
from infoset.geometry.zonotope_arrays import ZonotopeArrays, need_zonotope
from infoset.limits import Limits, real_values, shown

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    from infoset.geometry.polytope import Polytope

PolygonsOrPolytope = TypeVar("PolygonsOrPolytope", "ConvexPolygons", "Polytope")
"""The class of the other set of an operation, and of its result."""
_MORE_OF_DIFFERENCE = 6
"""Room for more vertices of a difference: four sides of the bounding box, and two to spare."""


class ConvexPolygons(ConvexSet):
    """A batch of convex polygons with any batch shape; a single polygon is a batch of shape ().

    Parameters
    ----------
    vertices : array_like, shape (..., V, 2)
        The polygon is the convex hull of the first `counts` rows; the others are padding. As an
        attribute, these rows are the vertices counter-clockwise: one for a point, two for a
        segment, none for the empty set. `polygon` returns the vertices of a single polygon without
        padding.
    counts : array_like of int, shape (...)
        Number of points; as an attribute, number of vertices.

    Raises
    ------
    ValueError
        If shapes disagree.

    Notes
    -----
    Operations return new objects. Their arguments are broadcast over the batch. A single polygon is
    broadcast to the shape of the other polygons, or to the number of points or directions:
    `contains` of a single polygon takes any number of points. Costs are for one polygon of n
    vertices. All arguments are checked: numbers are finite (TypeError if they are not real
    numbers), and shapes fit (ValueError).

    An empty member of a batch does not affect the others: sets made from it are empty (except a
    `convex_hull` with another set), its support function is -inf, its distance from any set is inf,
    and points such as its centroid are masked (`numpy.ma.MaskedArray`). A single empty set has no
    such points; then a ValueError is raised.

    An operation of a single polygon with a `Polytope` of the plane, in either order, converts the
    polygon to a `Polytope`: the resulting set is a `Polytope`, and exact only to rounding.
    `ConvexPolygons.from_points(polytope.vertices)` converts a polytope instead.

    Operators: `P & Q` (intersection), `P + Q` (Minkowski sum), `P + vector` (translation), `A @ P`
    (linear map), `point in P`, `P <= Q` (subset). `P == Q` compares objects; `equals` compares
    sets.
    """

    vertices: Floats
    counts: Integers

    def __init__(self, vertices: ArrayLike, counts: ArrayLike) -> None:
        points = real_values("vertices", vertices)
        numbers = real_values("counts", counts)
        room = points.shape[-2] if points.ndim > 1 else 0
        if points.shape != (*numbers.shape, room, 2):
            raise ValueError(
                f"vertices of shape (..., V, 2) and counts of shape (...) are needed: "
                f"got {points.shape} and {numbers.shape}"
            )
        if not ((numbers >= 0) & (numbers <= room) & (numbers == np.floor(numbers))).all():
            raise ValueError(
                f"counts must be whole numbers from 0 to {room}, the room for vertices"
            )

        given = self.unchecked(points, numbers.astype(np.int64))
        need_finite("vertices", points[given._used()])
        hull = given._make(0, kernels.hull)
        self.vertices = hull.vertices
        self.counts = hull.counts

    @classmethod
    def unchecked(cls, vertices: Floats, counts: Integers) -> Self:
        """Return polygons of arrays `vertices`, counter-clockwise, and `counts`.

        The arrays are not checked and not copied.
        """
        self = cls.__new__(cls)
        self.vertices = vertices
        self.counts = counts
        return self

    @classmethod
    def from_vertices(cls, rings: ArrayLike) -> Self:
        """Return the polygons with rings of vertices, shape (..., V, 2). O(n^2) at worst.

        A ring goes around the polygon in either order. It may repeat vertices, also its first one
        at the end, and have vertices along a side. `stack` makes a batch of polygons from rings of
        different lengths.

        Raises
        ------
        ValueError
            If a ring is not convex; the message has the first reflex vertex, whose number does not
            count repeated vertices. This is decided exactly. `from_points` takes the convex hull of
            any points instead.
        """
        vertices = finite_values("rings", rings, "...", "k", 2)
        polygons = cls.unchecked(vertices.copy(), np.full(vertices.shape[:-2], vertices.shape[-2]))
        corners, counts = polygons._flat()
        reflex = np.empty(polygons.shape, dtype=np.int64)

        kernels.drop_repeats(corners, counts)
        kernels.reflex_vertices(corners, counts, reflex.reshape(-1))
        if (reflex >= 0).any():
            index = np.argwhere(reflex >= 0)[0].tolist()
            of_member = f" of polygon {index}" if index else ""
            vertex = reflex[tuple(index)]
            x, y = polygons.vertices[*index, vertex]
            raise ValueError(
                f"the ring is not convex: vertex {vertex}{of_member}, ({x:.17g}, {y:.17g}), is "
                "reflex"
            )

        return polygons._make(0, kernels.hull)

    @classmethod
    def from_points(cls, points: ArrayLike) -> Self:
        """Return the convex hull of points, shape (n, 2) or (..., n, 2).

        No points give the empty set. O(n) for sorted points, O(n^2) at worst. Exact: vertices are
        points, and rounding does not decide which.
        """
        array = finite_values("points", points, "...", "k", 2)
        cloud = cls.unchecked(array, np.full(array.shape[:-2], array.shape[-2]))
        return cloud._make(0, kernels.hull)

    @classmethod
    def from_constraints(cls, normals: ArrayLike, offsets: ArrayLike) -> Self:
        """Return {p: normals p <= offsets}.

        The normals have the shape (..., k, 2) and any length, the offsets (..., k). An offset of
        inf is no limit, and -inf gives the empty set. O(k^2). Exact: which constraints are
        redundant, and whether the set is empty, is decided without rounding, and each coordinate is
        rounded by a few ulp.

        Raises
        ------
        ValueError
            If a set is unbounded.
        """
        rows, limits = constraint_values(("normals", "offsets"), normals, offsets, "...", "k", 2)
        shape = np.broadcast_shapes(rows.shape[:-1], limits.shape)
        if not shape[-1]:
            raise ValueError("a set without constraints is unbounded")

        table = np.empty((*shape, 3))
        table[..., :2] = rows
        table[..., 2] = limits
        lines = table.reshape(-1, shape[-1], 3, 1)
        # The kernel needs room for the four sides of its box, too.
        sets = cls.empty(shape[:-1])._make(shape[-1] + 4, kernels.intersect_lines, lines)
        if (sets.counts < 0).any():
            index = np.argwhere(sets.counts < 0)[0].tolist()
            number = f" {index}" if index else ""
            raise ValueError(f"the set{number} is unbounded")

        return sets

    @classmethod
    def from_box(cls, lower: ArrayLike, upper: ArrayLike) -> Self:
        """Return {p: lower <= p <= upper}, of shapes (2,) or (..., 2). Exact.

        Equal ends give a segment or a point.
        """
        minimum, most = box_ends(lower, upper, "...", 2)
        corners = np.stack([minimum, minimum, most, most], axis=-2)
        corners[..., 1, 0] = most[..., 0]
        corners[..., 3, 0] = minimum[..., 0]

        # Equal ends give repeated corners.
        counts = np.full(corners.shape[:-2], 4)
        kernels.drop_repeats(corners.reshape(-1, 4, 2), counts.reshape(-1))
        return cls.unchecked(corners, counts)

    @classmethod
    def from_ball(
        cls, centre: ArrayLike, radius: ArrayLike, sides: int = 16, *, outer: bool = True
    ) -> Self:
        """Return regular polygons around discs, or in them.

        The discs have a `centre`, shape (..., 2), and a `radius`, shape (...). An `outer` polygon
        contains the disc and exceeds it by the factor 1 / cos(pi / sides), with the default by 2 %;
        an inner polygon is contained in it. Both are true up to rounding, a few ulp. O(sides), at
        least three.
        """
        Limits(minimum=3, whole=True).need("sides", sides)
        middle = finite_values("centre", centre, "...", 2)
        radii = radius_values(radius, "...")

        # The sides of an outer polygon touch the disc where an inner one has its vertices.
        first = 0.5 if outer else 0.0
        inradius = math.cos(math.pi / sides) if outer else 1.0
        angles = (np.arange(sides) + first) * (2.0 * math.pi / sides)
        unit = np.stack([np.cos(angles), np.sin(angles)], axis=-1) / inradius
        return cls.from_points(middle[..., None, :] + radii[..., None, None] * unit)

    @classmethod
    def from_zonotope(cls, zonotope: ZonotopeArrays) -> Self:
        """Return a `Zonotope` of R^2 as a single polygon. O(g^2) for g generators.

        Coordinates are rounded g times.

        Raises
        ------
        ValueError
            If the zonotope is in another space.
        """
        if need_zonotope("zonotope", zonotope).space != 2:
            raise ValueError(f"zonotope must be in R^2: got {zonotope!r}")

        centre = cls.unchecked(zonotope.centre[None], np.ones((), dtype=np.int64))
        # A copy is contiguous and writeable: kernels are compiled once, for such arrays.
        halves = zonotope.generators[None].copy()
        return centre._make(2 * len(zonotope.generators), kernels.add_segments, halves)

    @classmethod
    def from_shapely(cls, geometry: BaseGeometry) -> Self:
        """Return a convex shapely Point, LineString or Polygon as a single polygon.

        Vertices along a side are dropped. O(n^2) at worst.

        Raises
        ------
        ValueError
            If a geometry is not convex by more than rounding, or is of another type.
        """
        ring = conversion.ring_of_geometry(geometry)
        return cls.unchecked(ring, np.array(len(ring), dtype=np.int64))

    def to_shapely(self) -> BaseGeometry:
        """Return a single polygon as a shapely Point, LineString or Polygon.

        The empty set is an empty Polygon.
        """
        return conversion.geometry_of_ring(self.polygon())

    @classmethod
    def empty(cls, shape: tuple[int, ...] = ()) -> Self:
        """Return a batch of empty sets."""
        return cls.unchecked(np.zeros((*shape, 0, 2)), np.zeros(shape, dtype=np.int64))

    @classmethod
    def stack(cls, sets: Sequence[Self]) -> Self:
        """Return a batch of single polygons, or of batches of equal shape, along a new first axis.

        Raises
        ------
        ValueError
            If the shapes of the batches differ.
        """
        shapes = {need_set("each of sets", one, cls).shape for one in sets}
        if len(shapes) > 1:
            raise ValueError(f"sets must be batches of the same shape: got {sorted(shapes)}")

        member_shape = sets[0].shape if sets else ()
        shape = (len(sets), *member_shape)
        counts = np.array([one.counts for one in sets], dtype=np.int64).reshape(shape)
        room = max((one.vertices.shape[-2] for one in sets), default=0)
        vertices = np.zeros((*shape, room, 2))
        for row, one in zip(vertices, sets, strict=True):
            row[..., : one.vertices.shape[-2], :] = one.vertices
        return cls.unchecked(vertices, counts)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the batch."""
        return self.counts.shape

    @property
    def is_empty(self) -> Flags:
        """Whether each polygon is empty, shape (...)."""
        return np.asarray(self.counts == 0)

    def __len__(self) -> int:
        if not self.shape:
            raise TypeError("a single polygon has no length; its number of vertices is .counts")
        return self.shape[0]

    def __getitem__(self, index: int | slice | tuple[int | slice, ...] | Flags) -> Self:
        if not self.shape:
            raise TypeError("a single polygon cannot be indexed; its vertices are .polygon()")
        return self.unchecked(self.vertices[index], np.asarray(self.counts[index]))

    def __iter__(self) -> Iterator[Self]:
        return (self[i] for i in range(len(self)))

    def polygon(self) -> Floats:
        """Return the vertices of a single polygon, shape (count, 2).

        Raises
        ------
        ValueError
            If this is a batch.
        """
        if self.shape:
            raise ValueError(
                f"this is a batch of shape {self.shape}: choose one with an index first"
            )
        return np.array(self.vertices[: int(self.counts)])

    def broadcast_to(self, shape: tuple[int, ...]) -> Self:
        """Return the batch repeated along new axes to another shape.

        The vertices are shared, not copied.

        Raises
        ------
        ValueError
            If the batch cannot be broadcast to this shape.
        """
        if shape == self.shape:
            return self

        vertices = np.broadcast_to(self.vertices, (*shape, *self.vertices.shape[-2:]))
        return self.unchecked(vertices, np.broadcast_to(self.counts, shape))

    def __repr__(self) -> str:
        return f"ConvexPolygons(shape={self.shape}, counts={self.counts.tolist()})"

    def polytope(self) -> Polytope:
        """Return a single polygon as a `Polytope`.

        `ConvexPolygons.from_points(polytope.vertices)` is the reverse.

        Raises
        ------
        ValueError
            If this is a batch.
        """
        from infoset.geometry.polytope import Polytope

        if self.shape:
            raise ValueError(
                f"a batch of shape {self.shape} is no Polytope: choose one with an index first, or "
                "convert the Polytope of an operation with "
                "ConvexPolygons.from_points(polytope.vertices)"
            )
        if self.is_empty:
            return Polytope.empty(2)
        return Polytope.from_vertices(self.polygon())

    def cut(
        self,
        normal: ArrayLike,
        lower: ArrayLike = -np.inf,
        upper: ArrayLike = np.inf,
        *,
        slack_ulp: float = 0.0,
    ) -> ConvexPolygons:
        """Return the intersection with the strip lower <= normal . p <= upper.

        `normal` has the shape (2,) or (..., 2), and any length. The bounds have the shape () or
        (...); infinite ones give half-planes. The strip is wider on both sides by `slack_ulp` ulp
        of the products in normal . p: a point that satisfies the bounds up to rounding is not lost.
        If then lower > upper, the result is empty.

        O(n). Vertices inside do not change; new ones are within a few ulp of the coordinates. A
        vertex on a border is inside.

        Raises
        ------
        ValueError
            If the normal is zero.
        """
        normals = self._each("normal", normal, 2)
        if not np.logical_or.reduce(normals, axis=-1).all():
            raise ValueError("the normal of a strip must not be zero")
        not_negative("slack_ulp", slack_ulp)

        bounds = np.stack([self._each("lower", lower), self._each("upper", upper)], axis=-1)
        return self._make(2, kernels.cut, normals, bounds, float(slack_ulp))

    def linear_map(self, matrix: ArrayLike) -> ConvexPolygons:
        """Return the image under a matrix, shape (2, 2) or (..., 2, 2).

        A singular matrix gives segments or points. O(n), O(n^2) for a singular matrix. Each
        coordinate of a vertex is rounded three times. `affine_map` maps to other dimensions.
        """
        return self._make(0, kernels.linear_map, self._each("matrix", matrix, 2, 2))

    def affine_map(self, matrix: ArrayLike, offset: ArrayLike = 0.0) -> Any:
        """Return {matrix p + offset}.

        A matrix of shape (m, 2), m not 2, maps a single polygon to a `Polytope` in R^m. `offset`
        has the shape (2,), (..., 2) or (m,), or is 0. The cost is the cost of `linear_map`.
        """
        rows = real_values("matrix", matrix)
        if rows.shape[-2:] == (2, 2):
            moved = offset_values(self._without_mask(offset, 2), "...", 2)
            return self.linear_map(rows).translate(moved)
        return self.polytope().affine_map(rows, offset)

    def translate(self, offset: ArrayLike) -> ConvexPolygons:
        """Return the polygons moved by an offset, shape (2,) or (..., 2). O(n).

        Each coordinate is rounded once.
        """
        moved = self.vertices + self._each("offset", offset, 2).reshape(*self.shape, 1, 2)
        return ConvexPolygons.unchecked(moved, self.counts)

    def preimage(self, matrix: ArrayLike, offset: ArrayLike = 0.0) -> Any:
        """Return {p: matrix p + offset in the set}.

        A matrix of shape (2, m), m not 2, gives a `Polytope` in R^m. O(n). The vertices are mapped
        by the inverse matrix, whose entries are rounded by a few ulp. If the matrix is singular,
        the preimage is unbounded or empty, which is decided exactly.

        Raises
        ------
        ValueError
            If the preimage is unbounded.
        """
        rows = real_values("matrix", matrix)
        if rows.shape[-1:] != (2,):
            return self.polytope().preimage(rows, offset)

        matrices = self._each("matrix", rows, 2, 2)
        start = offset_values(self._without_mask(offset, 2), "...", 2)
        inverse = np.zeros(matrices.shape)
        kernels.invert(matrices, inverse)
        mapped = self.translate(-start).linear_map(inverse.reshape(*self.shape, 2, 2))
        # `invert` leaves a matrix of zeros for a singular one.
        is_regular = inverse.any(axis=(1, 2))
        if is_regular.all():
            return mapped

        # All points of the plane are mapped into the range of a singular matrix.
        singular = ~is_regular.reshape(self.shape)
        offsets = self._each("offset", start, 2)
        meets = self._measure(kernels.range_meets, matrices, offsets)[..., 0]
        unbounded = singular & (meets > 0.0)
        if unbounded.any():
            index = np.argwhere(unbounded)[0].tolist()
            of_member = f" of polygon {index}" if index else ""
            raise ValueError(f"the preimage{of_member} is unbounded: its matrix is singular")
        return ConvexPolygons.unchecked(mapped.vertices, np.where(singular, 0, mapped.counts))

    def add_segment(self, half: ArrayLike) -> ConvexPolygons:
        """Return the Minkowski sum with the segment from -half to +half, shape (2,) or (..., 2).

        O(n), each vertex rounded once.
        """
        return self._make(2, kernels.add_segments, self._each("half", half, 2)[:, None])

    def minkowski_sum(self, other: PolygonsOrPolytope) -> PolygonsOrPolytope:
        """Return the Minkowski sum. O(n + m), each vertex rounded once."""
        if not isinstance(other, ConvexPolygons):
            return self._polytope_with(other).minkowski_sum(other)

        one, two = self._with(other)
        return one._make(two.vertices.shape[-2], kernels.add_polygon, *two._flat())

    def minkowski_difference(self, other: PolygonsOrPolytope) -> PolygonsOrPolytope:
        """Return the Pontryagin difference {p: p + q in the set for all q in the other}.

        A member of a batch without a bounded difference, because only the other set is empty, gives
        the empty set. O(n (n + m)). Exact: which sides remain, and whether the difference is empty,
        is decided without rounding, also for sets that fit in one place only; vertices are within 4
        ulp of the coordinates.

        Raises
        ------
        ValueError
            If the other set is empty and this one is not, both single: every point satisfies the
            condition.
        """
        if not isinstance(other, ConvexPolygons):
            return self._polytope_with(other).minkowski_difference(other)

        one, two = self._with(other)
        absent = two.counts == 0
        if absent.any():
            if not one.shape and one.counts:
                raise ValueError("the difference with an empty set is unbounded")
            # Without a bounded difference a member of a batch is empty; a single set is empty here.
            one = ConvexPolygons.unchecked(one.vertices, np.where(absent, 0, one.counts))
        return one._make(_MORE_OF_DIFFERENCE, kernels.difference, *two._flat())

    def intersection(self, other: PolygonsOrPolytope) -> PolygonsOrPolytope:
        """Return the intersection.

        O(n m). Exact: which vertices are kept, which sides cross, and whether the sets touch, is
        decided without rounding; crossings are within 4 ulp of the coordinates.
        """
        if not isinstance(other, ConvexPolygons):
            return self._polytope_with(other).intersection(other)

        one, two = self._with(other)
        return one._make(two.vertices.shape[-2], kernels.intersect, *two._flat())

    def convex_hull(self, other: PolygonsOrPolytope) -> PolygonsOrPolytope:
        """Return the convex hull of the union. O((n + m)^2) at worst.

        Exact: the vertices are vertices of the sets.
        """
        if not isinstance(other, ConvexPolygons):
            return self._polytope_with(other).convex_hull(other)

        one, two = self._with(other)
        points = np.concatenate([one.vertices, two.vertices], axis=-2)
        used = np.concatenate([one._used(), two._used()], axis=-1)

        # The vertices of both first, then the padding of both.
        order = np.argsort(~used, axis=-1, kind="stable")
        points = np.take_along_axis(points, order[..., None], axis=-2)
        return ConvexPolygons.unchecked(points, one.counts + two.counts)._make(0, kernels.hull)

    def project(self, axes: ArrayLike) -> Any:
        """Return the projection on an axis, 0 or 1, as intervals.

        An interval is its minimum and its maximum, both of shape (...). `axes` is an integer or a
        sequence of integers; both axes give the polygons, their coordinates in this order. O(n),
        exact.
        """
        numbers = axis_numbers(axes, 2, 2)
        if len(numbers) > 1:
            return self.linear_map(np.eye(2)[numbers])

        lower, upper = self.bounding_box()
        return lower[..., numbers[0]], upper[..., numbers[0]]

    def slice(self, axes: ArrayLike, values: ArrayLike) -> tuple[Floats, Floats]:
        """Return the interval of the other coordinate where a coordinate (0 or 1) has a value:
        shape (...).

        `axes` is an integer, or a sequence of one; `values` has the shape () or (...). O(n), within
        a few ulp of the coordinates; masked where the line misses a member of a batch.

        Raises
        ------
        ValueError
            If the line misses a single polygon.
        """
        (axis,) = axis_numbers(axes, 2, 1)
        section = self.cut(np.eye(2)[axis], values, values)
        # Empty members of a batch are masked by `project`.
        if not self.shape and section.is_empty:
            raise ValueError(
                f"the line where coordinate {axis} is {shown(values)} does not meet the polygon"
            )

        intervals: tuple[Floats, Floats] = section.project(1 - axis)
        return intervals

    def reduce_outward(self, cap: int) -> ConvexPolygons:
        """Return polygons of at most `cap` vertices that contain these up to rounding.

        `cap` is at least 4: every convex polygon of five vertices has a side that can be removed, a
        parallelogram has none. The sides whose removal adds the minimum area are removed first.
        O(n) for each side; new vertices are rounded.
        """
        Limits(minimum=4, whole=True).need("cap", cap)
        return self._make(0, kernels.reduce_outward, np.int64(cap))

    def constraints(self) -> tuple[Floats, Floats]:
        """Return the polygons as half-planes, normals p <= offsets.

        The normals have the shape (..., k, 2) and the length one, the offsets the shape (..., k).
        There is one for each side, and four for a segment or a point. Unused rows of a batch are 0
        p <= 0; an empty set has the row 0 p <= -1. O(n^2); directions and offsets are rounded.
        """
        vertices, counts = self._flat()
        # A segment and a point have four half-planes.
        room = max(4, vertices.shape[1])
        normals = np.zeros((counts.size, room, 2))
        offsets = np.zeros((counts.size, room))
        kernels.constraints(vertices, counts, normals, offsets)

        # The row 0 p <= -1 of an empty set is used, although it has no direction.
        is_used = normals.any(axis=-1) | (offsets < 0.0)
        last = int(np.flatnonzero(is_used.any(axis=0)).max(initial=0))
        normals = normals[:, : last + 1].reshape(*self.shape, last + 1, 2)
        offsets = offsets[:, : last + 1].reshape(*self.shape, last + 1)
        return normals, offsets

    def support_function(self, direction: ArrayLike) -> Floats:
        """Return max(direction . p), shape (...); -inf for the empty set. O(n).

        It is rounded as one scalar product.
        """
        return self._measure_at(kernels.support, "direction", direction)[..., 0]

    def support_vector(self, direction: ArrayLike) -> Floats:
        """Return a vertex farthest along a direction, shape (..., 2). O(n)."""
        values = self._measure_at(kernels.support, "direction", direction)
        return self._known(values[..., 1:], "support vector")

    def margin(self, point: ArrayLike) -> Floats:
        """Return the signed distance of a point from the boundary, positive inside.

        The point has the shape (2,) or (..., 2). The result is -inf for the empty set. O(n), within
        rounding of the coordinates.
        """
        return self._measure_at(kernels.margin, "point", point)[..., 0]

    def contains(self, point: ArrayLike, tolerance: float = 0.0) -> Flags:
        """Return whether a point is in the set or at most `tolerance` from it, shape (...).

        False for the empty set. The boundary belongs to the set. The point has the shape (2,) or
        (..., 2). O(n). Exact for a tolerance of 0: rounding does not affect the answer.
        """
        distance = self._measure_at(kernels.nearest, "point", point)[..., 2]
        return np.asarray(distance <= not_negative("tolerance", tolerance))

    def is_subset(self, other: ConvexPolygons | Polytope, tolerance: float = 0.0) -> Flags:
        """Return whether all points of the set are in the other one, shape (...).

        With a tolerance, they may be at most this distance from it. The empty set is in each set.
        O(n m). Exact for a tolerance of 0: rounding does not affect the answer. Sets that were
        computed are subsets only up to rounding in general.
        """
        if not isinstance(other, ConvexPolygons):
            return np.asarray(self._polytope_with(other).is_subset(other, tolerance))

        return np.asarray(self._excess(other) <= not_negative("tolerance", tolerance))

    def _excess(self, other: ConvexPolygons) -> Floats:
        """Return the maximum distance of a point of the set from the other one, shape (...).

        It is 0 only for a subset.
        """
        one, two = self._with(other)
        return one._measure(kernels.excess, *two._flat())[..., 0]

    def area(self) -> Floats:
        """Return the area, shape (...). O(n); rounded relative to the squared diameter at most."""
        return self._measure(kernels.moments)[..., 0]

    volume = area

    def centroid(self) -> Floats:
        """Return the centroid, shape (..., 2); the middle of a segment. O(n).

        It is in the set, to rounding.
        """
        return self._known(self._measure(kernels.moments)[..., 1:], "centroid")

    def chebyshev_centre(self) -> tuple[Floats, Floats]:
        """Return the centres and the radii of largest discs in the polygons.

        They have the shapes (..., 2) and (...). O(n^2), within rounding of the coordinates. If
        there are several largest discs, the centre is the middle of their centres.
        """
        values = self._known(self._measure(kernels.max_disc), "Chebyshev centre")
        return values[..., :2], values[..., 2]

    def bounding_box(self) -> tuple[Floats, Floats]:
        """Return the minimum and the maximum coordinates, each (..., 2). O(n), exact."""
        used = self._used()[..., None]
        lower = np.min(self.vertices, axis=-2, where=used, initial=np.inf)
        upper = np.max(self.vertices, axis=-2, where=used, initial=-np.inf)
        return self._known(lower, "bounding box"), self._known(upper, "bounding box")

    def diameter(self) -> Floats:
        """Return the maximum distance between two points, shape (...). O(n^2), rounded.

        It is 0 for the empty set.
        """
        return self._measure(kernels.diameter)[..., 0]

    def distance(self, other: ConvexPolygons | Polytope | ArrayLike) -> Floats:
        """Return the distance from other sets or points, shape (...); inf if a set is empty.

        O(n m). It is 0 exactly if the sets intersect; otherwise rounded.
        """
        if isinstance(other, ConvexSet) and not isinstance(other, ConvexPolygons):
            return np.asarray(self._polytope_with(other).distance(other))
        if not isinstance(other, ConvexPolygons):
            points = finite_values("other", self._without_mask(other, 2), "...", 2)
            other = ConvexPolygons.unchecked(
                points[..., None, :], np.ones(points.shape[:-1], dtype=np.int64)
            )

        one, two = self._with(other)
        return one._measure(kernels.gap, *two._flat())[..., 0]

    def isdisjoint(self, other: ConvexPolygons | Polytope) -> Flags:
        """Return whether no point is in both sets, shape (...). O(n m), exact."""
        if isinstance(other, ConvexSet) and not isinstance(other, ConvexPolygons):
            return np.asarray(self._polytope_with(other).isdisjoint(other))

        return np.asarray(self.distance(other) > 0.0)

    def closest_point(self, point: ArrayLike) -> Floats:
        """Return the point of the set nearest to a point, shape (2,) or (..., 2). O(n), rounded.

        A point inside is its own nearest point.
        """
        values = self._measure_at(kernels.nearest, "point", point)
        return self._known(values[..., :2], "closest point")

    def hausdorff_distance(self, other: ConvexPolygons | Polytope) -> Floats:
        """Return the Hausdorff distance, shape (...). O(n m), rounded.

        It is inf between an empty and a nonempty set.
        """
        if not isinstance(other, ConvexPolygons):
            return np.asarray(self._polytope_with(other).hausdorff_distance(other))

        return np.asarray(np.maximum(self._excess(other), other._excess(self)))

    def sample(self, count: int, seed: int | np.random.Generator = 0) -> Floats:
        """Return points distributed uniformly over each set, shape (..., count, 2).

        O(n) for each point; inside to rounding.
        """
        random = np.random.default_rng(seed)
        vertices, counts = self._flat()
        out = np.zeros((counts.size, count, 2))
        kernels.sample(vertices, counts, random.random((counts.size, count, 3)), out)
        return self._known(out.reshape(*self.shape, count, 2), "points")

    def plot(self, ax: Any = None, **style: Any) -> list[Any]:
        """Draw the polygons on matplotlib axes, and return the artists.

        Without `ax`, pyplot's present axes are used. There is one artist for each polygon that is
        not empty, in the order of the batch. `style` has the options of matplotlib's `fill`, and of
        `scatter` for a point. Edges have the colour of the face, unless the style has another:
        segments and thin sets are visible.
        """
        rings = [self.vertices[index][: self.counts[index]] for index in np.ndindex(self.shape)]
        return draw_polygons(ax, rings, style)

    def _used(self) -> Flags:
        """Return which rows of the array are vertices, shape (..., V)."""
        return np.asarray(np.arange(self.vertices.shape[-2]) < self.counts[..., None])

    def _known(self, values: Floats, quantity: str) -> Floats:
        """Return values, shape (..., k), masked for empty members of a batch."""
        empty = self.is_empty
        if not empty.any():
            return values
        if not self.shape:
            raise ValueError(f"the empty set has no {quantity}")

        # The batch has the first axes of the values; the mask is the same along all others.
        shape = empty.shape + (1,) * (values.ndim - empty.ndim)
        return np.ma.masked_array(values, np.broadcast_to(empty.reshape(shape), values.shape))

    def _measure_at(self, kernel: Callable[..., None], name: str, value: ArrayLike) -> Floats:
        """Apply a kernel that measures at a vector for each polygon.

        A single polygon is measured at all vectors.
        """
        polygons = self
        if not self.shape:
            polygons = self.broadcast_to(real_values(name, value).shape[:-1])
        return polygons._measure(kernel, polygons._each(name, value, 2))

    def _without_mask(self, value: ArrayLike, *last: int) -> ArrayLike:
        """Return values for each polygon, of shape (..., *last), without a mask.

        Values may be masked for empty polygons, as results of a batch are: ones replace them, which
        are a normal too. Another mask stays.
        """
        if not isinstance(value, np.ma.MaskedArray) or value.shape != (*self.shape, *last):
            return value

        is_masked = np.ma.getmaskarray(value).any(axis=tuple(range(-len(last), 0)))
        if (is_masked & ~self.is_empty).any():
            return value
        return np.asarray(value.filled(1.0))

    def _each(self, name: str, value: ArrayLike, *last: int) -> Floats:
        """Return a value for each polygon, shape (B, *last).

        `value` is such values, or one of the shape `last`. Numbers, whose shape is (), may be
        infinite.
        """
        value = self._without_mask(value, *last)
        values = finite_values(name, value, "...", *last) if last else bound_values(name, value)
        shape = (*self.shape, *last)
        if values.shape != shape:
            try:
                values = np.broadcast_to(values, shape)
            except ValueError:
                raise ValueError(
                    f"{name} must have the shape {last}, or one that can be broadcast to {shape}: "
                    f"got {values.shape}"
                ) from None
        return _plain(values.reshape(self.counts.size, *last))

    def _polytope_with(self, other: object) -> Polytope:
        """Return a single polygon as a `Polytope`, for an operation with a set of another class."""
        need_convex_set("other", other)
        return self.polytope()

    def _with(self, other: Self) -> tuple[Self, Self]:
        """Return both batches in their common shape."""
        if self.shape == other.shape:
            return self, other

        shape = np.broadcast_shapes(self.shape, other.shape)
        return self.broadcast_to(shape), other.broadcast_to(shape)

    def _flat(self) -> tuple[Floats, Integers]:
        """Return the arrays of all polygons in one axis, as kernels take them."""
        vertices = self.vertices.reshape(self.counts.size, self.vertices.shape[-2], 2)
        return _plain(vertices), _plain(self.counts.reshape(-1))

    def _make(self, more: int, kernel: Callable[..., None], *arguments: object) -> Self:
        """Apply a kernel whose results have at most `more` vertices more than these polygons."""
        vertices, counts = self._flat()
        out = np.zeros((counts.size, vertices.shape[1] + more, 2))
        made = np.zeros(counts.size, dtype=np.int64)
        kernel(vertices, counts, out, made, *arguments)
        room = int(made.max(initial=0))
        return self.unchecked(out[:, :room].reshape(*self.shape, room, 2), made.reshape(self.shape))

    def _measure(self, kernel: Callable[..., None], *arguments: object) -> Floats:
        """Apply a kernel that computes up to three numbers for each polygon, shape (..., 3).

        The kernel says what the columns are; unused ones are zero.
        """
        vertices, counts = self._flat()
        out = np.zeros((counts.size, 3))
        kernel(vertices, counts, out, *arguments)
        return out.reshape(*self.shape, 3)


def _plain(values: NDArray[Any]) -> NDArray[Any]:
    """Return an array that kernels accept: contiguous and writeable."""
    return values if values.flags.carray else values.copy()
