"""Batches of convex polygons, and operations on them."""

from __future__ import annotations

import contextlib
import math
import warnings
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from infoset import polygon_batches as kernels
from infoset.limits import LARGEST, Limits, need_pair, real_values, shown
from infoset.pictures import outlines_svg
from infoset.renamed import renamed

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    from infoset.polytope import Polytope

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Integers = NDArray[np.int64]

_CAP = Limits(least=4, whole=True)
_SIDES = Limits(least=3, whole=True)
_COUNT = Limits(least=1, whole=True)
_ROUNDING = 64.0 * float(np.finfo(np.float64).eps)
"""Depth of a reflex vertex, relative to the coordinates, that rounding explains."""
_NAMES = ("empty set", "point", "segment", "triangle", "quadrangle", "pentagon", "hexagon")


class ConvexPolygons:
    """A batch of convex polygons with any batch shape; a single polygon is a batch of shape ().

    Parameters
    ----------
    vertices : array_like, shape (..., V, 2)
        The first `counts` rows are the vertices in order around the polygon: one for a point, two for a segment, none
        for the empty set. Clockwise rings are reversed.
    counts : array_like of int, shape (...)
        Number of vertices.

    Raises
    ------
    TypeError
        If a vertex or a count is not a real number.
    ValueError
        If shapes disagree, a vertex is not finite, a count is not a whole number, or a ring is not convex by more than
        rounding (64 ulp of the coordinates); `from_vertices` does not tolerate rounding.

    Notes
    -----
    Operations return new objects. Their arguments are broadcast over the batch, and a single polygon is broadcast to
    the shape of the other polygons. The cost of an operation is for one polygon of n vertices.

    An empty member of a batch does not affect the others: sets made from it are empty, its support function is -inf,
    its distance from any set is inf, and points such as its centroid are masked (`numpy.ma.MaskedArray`). A single
    empty set has no such points; then a ValueError is raised.

    Operators: `P & Q` (intersection), `P + Q` (Minkowski sum), `P + vector` (translation), `A @ P` (linear map),
    `point in P`, `P <= Q` (subset).
    """

    __array_ufunc__ = None
    vertices: Floats
    counts: Integers

    def __init__(self, vertices: ArrayLike, counts: ArrayLike) -> None:
        checked = self._checked(vertices, counts)._turned(_ROUNDING)
        self.vertices, self.counts = checked.vertices, checked.counts

    @classmethod
    def _checked(cls, vertices: ArrayLike, counts: ArrayLike) -> ConvexPolygons:
        """Return copies of the arrays after checks of shapes and numbers."""
        numbers = real_values("counts", counts)
        if not np.isfinite(numbers).all() or (numbers != np.floor(numbers)).any():
            raise ValueError(f"counts must be whole numbers: got {shown(counts)}")
        polygons = cls.unchecked(real_values("vertices", vertices).copy(), numbers.astype(np.int64))
        room = polygons.vertices.shape[-2] if polygons.vertices.ndim > 1 else 0
        if polygons.vertices.shape != (*polygons.counts.shape, room, 2):
            raise ValueError(
                f"vertices of shape (..., V, 2) and counts of shape (...) are needed: "
                f"got {polygons.vertices.shape} and {polygons.counts.shape}"
            )
        if (polygons.counts < 0).any() or (polygons.counts > room).any():
            raise ValueError(f"counts must lie between 0 and {room}, the room for vertices")
        _finite(vertices=polygons.vertices[polygons._used()])
        return polygons

    def _turned(self, depth: float) -> ConvexPolygons:
        """Reverse clockwise rings, in place; refuse a ring with a reflex vertex deeper than `depth`, relative to it."""
        vertices, counts = self._flat()
        values = np.zeros((counts.size, 3))
        kernels.check_rings(vertices, counts, values)
        refused = np.flatnonzero((values[:, 0] >= 0) & (values[:, 1] > depth))
        if refused.size:
            member = refused[0]
            vertex, turned = int(values[member, 0]), values[member, 2] < 0.0
            x, y = vertices[member, -vertex % counts[member] if turned else vertex]
            of = f" of polygon {tuple(map(int, np.unravel_index(member, self.shape)))}" if self.shape else ""
            raise ValueError(f"the ring is not convex: vertex {vertex}{of}, ({x:.17g}, {y:.17g}), is reflex")
        return self

    @classmethod
    def unchecked(cls, vertices: Floats, counts: Integers) -> ConvexPolygons:
        """Return polygons of arrays `vertices` and `counts`, counter-clockwise, without checks and without a copy."""
        self = cls.__new__(cls)
        self.vertices, self.counts = vertices, counts
        return self

    @classmethod
    def from_vertices(cls, rings: ArrayLike, counts: ArrayLike | None = None) -> ConvexPolygons:
        """Return the polygons with given rings of vertices, in either order around the polygon.

        Parameters
        ----------
        rings : array_like, shape (..., V, 2), or a sequence of arrays of shape (n, 2)
            Vertices in order. A ring may repeat vertices, also its first at the end, and have vertices along a side.
        counts : array_like of int, shape (...), optional
            Number of vertices of each ring; all V if omitted.

        Raises
        ------
        ValueError
            If a ring is not convex; the message has the first reflex vertex. This is decided exactly. `from_points`
            takes the convex hull of any points instead.

        Notes
        -----
        O(n).
        """
        if isinstance(rings, Sequence) and len({np.shape(ring) for ring in rings}) > 1:
            return cls.stack([cls.from_vertices(ring) for ring in rings])
        vertices = real_values("rings", np.zeros((0, 2)) if isinstance(rings, Sequence) and not rings else rings)
        plain = cls.unchecked(vertices, np.zeros(vertices.shape[:-2], dtype=np.int64))
        polygons = cls._checked(vertices, plain.counts + vertices.shape[-2] if counts is None else counts)
        kernels.drop_repeats(*polygons._flat())
        return polygons._turned(0.0)._make(0, kernels.exact_hull)

    @classmethod
    def from_points(cls, points: ArrayLike) -> ConvexPolygons:
        """Return the convex hull of points, shape (n, 2) or (..., n, 2); no points give the empty set.

        Raises
        ------
        ValueError
            If a point is not finite or does not have two coordinates.

        Notes
        -----
        O(n) for sorted points, O(n^2) at worst. Vertices are points; points that protrude by less than rounding are
        dropped.
        """
        array = real_values("points", points)
        array = array.reshape(0, 2) if array.shape == (0,) else array
        if array.ndim < 2 or array.shape[-1] != 2:
            raise ValueError(f"points must have the shape (n, 2) or (..., n, 2): got {array.shape}")
        _finite(points=array)
        return cls.unchecked(array, np.full(array.shape[:-2], array.shape[-2]))._make(0, kernels.hull)

    @classmethod
    def from_constraints(cls, normals: ArrayLike, offsets: ArrayLike) -> ConvexPolygons:
        """Return {p: normals p <= offsets}.

        Parameters
        ----------
        normals : array_like, shape (k, 2) or (..., k, 2)
            A row for each half-plane, of any length.
        offsets : array_like, shape (k,) or (..., k)
            Infinite ones are no limit.

        Raises
        ------
        ValueError
            If a set is unbounded.

        Notes
        -----
        O(k^2). Exact: which constraints are redundant, and whether the set is empty, is decided without rounding, and
        each coordinate is within a few ulp of itself.
        """
        rows, limits = real_values("normals", normals), real_values("offsets", offsets)
        if rows.ndim < 2 or rows.shape[-1] != 2 or limits.ndim < 1 or limits.shape[-1] != rows.shape[-2]:
            raise ValueError(
                "normals of shape (..., k, 2) and offsets of shape (..., k) are needed: "
                f"got {rows.shape} and {limits.shape}"
            )
        _finite(normals=rows, offsets=np.where(np.isinf(limits), 0.0, limits))
        shape = np.broadcast_shapes(rows.shape[:-1], limits.shape)
        if not shape[-1]:
            raise ValueError("a set without constraints is unbounded")
        table = np.concatenate(
            [np.broadcast_to(rows, (*shape, 2)), np.broadcast_to(limits, shape)[..., None]], axis=-1
        ).reshape(-1, shape[-1], 3)
        out = np.zeros((len(table), shape[-1] + 4, 2))
        made = np.zeros(len(table), dtype=np.int64)
        kernels.intersect_rows(table, out, made)
        if (made < 0).any():
            index = tuple(map(int, np.unravel_index(int((made < 0).argmax()), shape[:-1])))
            raise ValueError(f"the set{f' {index}' if index else ''} is unbounded")
        room = int(made.max(initial=0))
        return cls.unchecked(out[:, :room].reshape(*shape[:-1], room, 2), made.reshape(shape[:-1]))

    @classmethod
    def from_box(cls, lower: ArrayLike, upper: ArrayLike) -> ConvexPolygons:
        """Return {p: lower <= p <= upper}, of shapes (2,) or (..., 2). Exact; equal ends give a segment or a point.

        Raises
        ------
        ValueError
            If a lower end is greater than the upper one, or an end is not finite.
        """
        least, most = np.broadcast_arrays(real_values("lower", lower), real_values("upper", upper))
        if least.shape[-1:] != (2,):
            raise ValueError(f"lower and upper must have the shape (2,) or (..., 2): got {least.shape}")
        _finite(lower=least, upper=most)
        if (least > most).any():
            raise ValueError("the box is reversed: a lower end is greater than the upper end")
        x, y = np.stack([least, most, most, least], axis=-2), np.stack([least, least, most, most], axis=-2)
        corners = np.stack([x[..., 0], y[..., 1]], axis=-1)
        counts = np.full(corners.shape[:-2], 4)
        kernels.drop_repeats(corners.reshape(-1, 4, 2), counts.reshape(-1))
        return cls.unchecked(corners, counts)

    @classmethod
    def from_ball(cls, centre: ArrayLike, radius: ArrayLike, sides: int = 16, *, outer: bool = True) -> ConvexPolygons:
        """Return regular polygons around discs with `centre`, shape (..., 2), and `radius`, shape (...), or in them.

        An `outer` polygon contains the disc and exceeds it by the factor 1 / cos(pi / sides); an inner one is
        contained in it. Both to rounding: a few ulp. O(sides).

        Raises
        ------
        ValueError
            If a radius is negative, or there are fewer than three sides.
        """
        _SIDES.need("sides", sides)
        middle, r = real_values("centre", centre), real_values("radius", radius)
        _finite(centre=middle, radius=r)
        if middle.shape[-1:] != (2,) or (r < 0.0).any():
            raise ValueError("centre must have the shape (..., 2), and radius must not be negative")
        angles = (np.arange(sides) + (0.5 if outer else 0.0)) * (2.0 * math.pi / sides)
        unit = np.stack([np.cos(angles), np.sin(angles)], axis=-1) / (math.cos(math.pi / sides) if outer else 1.0)
        return cls.from_points(middle[..., None, :] + r[..., None, None] * unit)

    @classmethod
    def from_zonotope(cls, centre: ArrayLike, generators: ArrayLike) -> ConvexPolygons:
        """Return {centre + sum of z_i generators[i]: -1 <= z_i <= 1}.

        Parameters
        ----------
        centre : array_like, shape (2,) or (..., 2)
            The centre of symmetry.
        generators : array_like, shape (g, 2) or (..., g, 2)
            A row for each generator.

        Raises
        ------
        ValueError
            If shapes do not fit or a number is not finite.

        Notes
        -----
        O(g^2). Each coordinate is rounded g times.
        """
        middle, rows = real_values("centre", centre), real_values("generators", generators)
        rows = rows.reshape(0, 2) if rows.shape == (0,) else rows
        if middle.shape[-1:] != (2,) or rows.ndim < 2 or rows.shape[-1] != 2:
            raise ValueError(
                f"centre must have the shape (..., 2) and generators (..., g, 2): got {middle.shape} and {rows.shape}"
            )
        _finite(centre=middle, generators=rows)
        shape = np.broadcast_shapes(middle.shape[:-1], rows.shape[:-2])
        points = cls.unchecked(middle[..., None, :], np.ones(middle.shape[:-1], dtype=np.int64)).broadcast_to(shape)
        halves = np.broadcast_to(rows, (*shape, *rows.shape[-2:])).reshape(points.counts.size, *rows.shape[-2:])
        return points._make(2 * rows.shape[-2], kernels.add_segments, np.ascontiguousarray(halves))

    @classmethod
    def from_shapely(cls, geometry: BaseGeometry | Sequence[BaseGeometry]) -> ConvexPolygons:
        """Return a convex shapely Point, LineString or Polygon as a single polygon, and a sequence of them as a batch.

        Raises
        ------
        ValueError
            If a geometry is not convex by more than rounding (64 ulp of the coordinates), or is of another type.

        Notes
        -----
        O(n). Vertices along a side are dropped.
        """
        if isinstance(geometry, Sequence | np.ndarray):
            return cls.stack([cls.from_shapely(one) for one in geometry])
        if geometry.is_empty:
            return cls.empty()
        if geometry.geom_type == "Polygon":
            if len(geometry.interiors):
                raise ValueError("the polygon has a hole: it is not convex")
            vertices = np.asarray(geometry.exterior.coords)[:, :2]
        elif geometry.geom_type in ("Point", "LineString"):
            vertices = np.asarray(geometry.coords)[:, :2]
            if len(vertices) > 2:
                raise ValueError("a line must be a single segment")
        else:
            raise ValueError(f"a Point, LineString or Polygon is needed: got {geometry.geom_type}")
        count = np.array([len(vertices)])
        kernels.drop_repeats(vertices[None], count)
        return cls(vertices, count[0])._make(0, kernels.exact_hull)

    def to_shapely(self) -> BaseGeometry:
        """Return a single polygon as a shapely Point, LineString or Polygon; the empty set is an empty Polygon."""
        from shapely import LineString, Point, Polygon

        vertices = self.polygon()
        if len(vertices) == 1:
            return Point(vertices[0])
        return LineString(vertices) if len(vertices) == 2 else Polygon(vertices)

    @classmethod
    def box(cls, x: tuple[float, float], y: tuple[float, float]) -> ConvexPolygons:
        """Return `from_box((x[0], y[0]), (x[1], y[1]))`. Deprecated."""
        warnings.warn("box is deprecated and will be removed: use from_box", DeprecationWarning, stacklevel=2)
        need_pair("x", x)
        need_pair("y", y)
        return cls.from_box((x[0], y[0]), (x[1], y[1]))

    @classmethod
    def empty(cls, shape: tuple[int, ...] = ()) -> ConvexPolygons:
        """Return a batch of empty sets."""
        return cls.unchecked(np.zeros((*shape, 0, 2)), np.zeros(shape, dtype=np.int64))

    @classmethod
    def stack(cls, sets: Sequence[ConvexPolygons]) -> ConvexPolygons:
        """Return a batch of single polygons, or of batches of equal shape, along a new first axis."""
        room = max((one.vertices.shape[-2] for one in sets), default=0)
        vertices = np.zeros((len(sets), *(sets[0].shape if sets else ()), room, 2))
        for row, one in zip(vertices, sets, strict=True):
            row[..., : one.vertices.shape[-2], :] = one.vertices
        return cls.unchecked(
            vertices, np.array([one.counts for one in sets], dtype=np.int64).reshape(vertices.shape[:-2])
        )

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the batch."""
        return tuple(self.counts.shape)

    @property
    def is_empty(self) -> Flags:
        """Whether each polygon is empty, shape (...)."""
        return np.asarray(self.counts == 0)

    def __len__(self) -> int:
        if not self.shape:
            raise TypeError("a single polygon has no length; its number of vertices is .counts")
        return self.shape[0]

    def __getitem__(self, index: int | slice | tuple[int | slice, ...] | Flags) -> ConvexPolygons:
        if not self.shape:
            raise TypeError("a single polygon cannot be indexed; its vertices are .polygon()")
        return ConvexPolygons.unchecked(self.vertices[index], np.asarray(self.counts[index]))

    def __iter__(self) -> Iterator[ConvexPolygons]:
        return (self[i] for i in range(len(self)))

    def _repr_svg_(self) -> str:
        outlines = [self.vertices[index][: self.counts[index]] for index in np.ndindex(self.shape)]
        return outlines_svg(outlines, "x", "y", repr(self).strip("<>"))

    def __repr__(self) -> str:
        if self.shape:
            return f"<convex polygons, batch of shape {self.shape}, " + (
                f"{min(self.counts.flat, default=0)} to {max(self.counts.flat, default=0)} vertices>"
            )
        count = int(self.counts)
        name = _NAMES[count] if count < len(_NAMES) else f"polygon of {count} vertices"
        if count == 0:
            return "<empty set>"
        if count == 1:
            return f"<point ({self.vertices[0, 0]:.6g}, {self.vertices[0, 1]:.6g})>"
        if count == 2:
            return f"<segment, length {np.hypot(*(self.vertices[1] - self.vertices[0])):.3g}>"
        return f"<{name}, area {self.area():.3g}>"

    def polygon(self) -> Floats:
        """Return the vertices of a single polygon, shape (count, 2).

        Raises
        ------
        ValueError
            If this is a batch.
        """
        if self.shape:
            raise ValueError(f"this is a batch of shape {self.shape}: choose one with an index first")
        return np.array(self.vertices[: int(self.counts)])

    def polytope(self) -> Polytope:
        """Return a single polygon as a `Polytope`; for operations in more dimensions."""
        from infoset.polytope import Polytope

        vertices = self.polygon()
        return Polytope.from_vertices(vertices) if len(vertices) else Polytope.empty(2)

    def broadcast_to(self, shape: tuple[int, ...]) -> ConvexPolygons:
        """Return the batch repeated along new axes to another shape; the vertices are shared, not copied."""
        if shape == self.shape:
            return self
        return ConvexPolygons.unchecked(
            np.broadcast_to(self.vertices, (*shape, *self.vertices.shape[-2:])), np.broadcast_to(self.counts, shape)
        )

    # Sets -----------------------------------------------------------------------------------------------------------

    def cut(
        self, normal: ArrayLike, lower: ArrayLike = -np.inf, upper: ArrayLike = np.inf, *, slack_ulp: float = 0.0
    ) -> ConvexPolygons:
        """Return the intersection with the strip lower <= normal . p <= upper.

        Parameters
        ----------
        normal : array_like, shape (2,) or (..., 2)
            Normal of the strip, of any nonzero length.
        lower, upper : array_like, shape () or (...)
            Bounds; infinite ones give half-planes, and lower > upper gives the empty set.
        slack_ulp : float
            The strip is wider on both sides by this number of ulp of the products in normal . p: a point that
            satisfies the bounds up to rounding is not lost.

        Raises
        ------
        ValueError
            If the normal is zero.

        Notes
        -----
        O(n). Vertices inside do not change; new ones are within a few ulp of the coordinates. A vertex on a border is
        inside.
        """
        normals = self._vectors(normal, "normal")
        if (np.abs(normals).max(axis=-1, initial=0.0) == 0.0).any():
            raise ValueError("the normal of a strip must not be zero")
        bounds = self._scalars(lower, "lower"), self._scalars(upper, "upper")
        return self._make(2, kernels.cut, normals, *bounds, float(slack_ulp))

    def linear_map(self, matrix: ArrayLike) -> ConvexPolygons:
        """Return the image under a matrix, shape (2, 2) or (..., 2, 2); a singular one gives segments or points.

        O(n). Each coordinate of a vertex is rounded three times. `affine_map` maps to other dimensions.

        Raises
        ------
        ValueError
            If the matrix is not finite.
        """
        matrices = self._spread(real_values("matrix", matrix), "matrix", (2, 2)).reshape(-1, 2, 2)
        _finite(matrix=matrices)
        return self._make(0, kernels.linear_map, np.ascontiguousarray(matrices))

    def affine_map(self, matrix: ArrayLike, offset: ArrayLike = 0.0) -> Any:
        """Return {matrix p + offset}; a matrix of shape (m, 2), m not 2, maps a single polygon to a `Polytope` in R^m.

        `offset` has the shape (2,), (..., 2) or (m,), or is 0. O(n), as `linear_map`.

        Raises
        ------
        ValueError
            If a number is not finite, shapes do not fit, or a batch is mapped to another dimension.
        """
        if np.shape(matrix)[-2:] == (2, 2):
            return self.linear_map(matrix).translate(np.broadcast_to(offset, (2,)) if np.ndim(offset) == 0 else offset)
        return self.polytope().affine_map(matrix, offset)

    def translate(self, offset: ArrayLike) -> ConvexPolygons:
        """Return the polygons moved by an offset, shape (2,) or (..., 2). O(n); each coordinate is rounded once."""
        moved = self.vertices + np.reshape(self._vectors(offset, "offset"), (*self.shape, 1, 2))
        return ConvexPolygons.unchecked(moved, self.counts)

    def preimage(self, matrix: ArrayLike, offset: ArrayLike = 0.0) -> Any:
        """Return {p: matrix p + offset in the set}; a matrix of shape (2, m), m not 2, gives a `Polytope` in R^m.

        Raises
        ------
        ValueError
            If the preimage is unbounded (the matrix is singular).

        Notes
        -----
        O(n). The vertices are mapped by the inverse matrix, whose entries are within a few ulp of themselves.
        """
        if np.shape(matrix)[-1:] != (2,):
            return self.polytope().preimage(matrix, offset)
        matrices = np.ascontiguousarray(self._spread(real_values("matrix", matrix), "matrix", (2, 2))).reshape(-1, 2, 2)
        _finite(matrix=matrices)
        moved = self.translate(np.negative(np.broadcast_to(offset, (2,)) if np.ndim(offset) == 0 else offset))
        inverse = np.zeros(matrices.shape)
        kernels.invert(matrices, inverse)
        if inverse.any(axis=(1, 2)).all():
            return moved.linear_map(inverse.reshape(*self.shape, 2, 2))
        normals, limits = moved.constraints()
        return ConvexPolygons.from_constraints(normals @ matrices.reshape(*self.shape, 2, 2), limits)

    def add_segment(self, half: ArrayLike) -> ConvexPolygons:
        """Return the Minkowski sum with the segment from -half to +half, shape (2,) or (..., 2).

        O(n), each vertex rounded once.
        """
        return self._make(2, kernels.add_segments, self._vectors(half, "half")[:, None])

    def minkowski_sum(self, other: ConvexPolygons) -> ConvexPolygons:
        """Return the Minkowski sum. O(n + m), each vertex rounded once."""
        one, two = self._with(other)
        return one._make(two.vertices.shape[-2], kernels.add_polygon, *two._flat())

    def minkowski_difference(self, other: ConvexPolygons) -> ConvexPolygons:
        """Return the Pontryagin difference {p: p + q in the set for all q in the other}.

        Raises
        ------
        ValueError
            If the other set is empty and this one is not, both single: every point satisfies the condition.

        Notes
        -----
        A member of a batch without a bounded difference, because only the other set is empty, gives the empty set.

        O(n (n + m)). The sides move inward by the support function of the other set, rounded a few times; their
        intersection is exact within a few ulp. For flat sets rounding decides whether the difference is empty.
        """
        one, two = self._with(other)
        if not one.shape and two.is_empty and not one.is_empty:
            raise ValueError("the difference with an empty set is unbounded")
        one = ConvexPolygons.unchecked(one.vertices, np.where(two.is_empty, 0, one.counts))
        return one._make(6, kernels.difference, *two._flat())

    def intersection(self, other: ConvexPolygons) -> ConvexPolygons:
        """Return the intersection.

        Notes
        -----
        O(n m). Exact: which vertices are kept, which sides cross, and whether the sets touch, is decided without
        rounding; crossings are within 4 ulp of the coordinates.
        """
        one, two = self._with(other)
        return one._make(two.vertices.shape[-2], kernels.intersect, *two._flat())

    def convex_hull(self, other: ConvexPolygons) -> ConvexPolygons:
        """Return the convex hull of the union. O((n + m)^2) at worst; exact, the vertices are vertices of the sets."""
        one, two = self._with(other)
        points = np.concatenate([one.vertices, two.vertices], axis=-2)
        order = np.argsort(~np.concatenate([one._used(), two._used()], axis=-1), axis=-1, kind="stable")
        points = np.take_along_axis(points, order[..., None], axis=-2)
        return ConvexPolygons.unchecked(points, one.counts + two.counts)._make(0, kernels.exact_hull)

    def project(self, axis: int) -> tuple[Floats, Floats]:
        """Return the projection on an axis (0 or 1) as intervals: least and greatest values, shape (...).

        O(n), exact.
        """
        lower, upper = self.bounding_box()
        return lower[..., axis], upper[..., axis]

    def slice(self, axis: int, value: ArrayLike) -> tuple[Floats, Floats]:
        """Return the interval of the other coordinate where a coordinate (0 or 1) has a value: shape (...).

        O(n), within a few ulp of the coordinates; masked where the line misses the polygon.

        Raises
        ------
        ValueError
            If the line misses a single polygon.
        """
        return self.cut(np.eye(2)[axis], value, value).project(1 - axis)

    def reduce_outward(self, cap: int) -> ConvexPolygons:
        """Return polygons of at most `cap` (>= 4) vertices that contain these, by removing sides with least added area.

        O(n) for each side; new vertices are rounded.

        Raises
        ------
        ValueError
            If `cap` is less than 4.
        """
        _CAP.need("cap", cap)
        return self._make(0, kernels.reduce_outward, np.int64(cap))

    # Measures ---------------------------------------------------------------------------------------------------------

    def constraints(self) -> tuple[Floats, Floats]:
        """Return normals, shape (..., k, 2), of unit length, and offsets, shape (..., k): the set is normals p <=
        offsets.

        There is one for each side, and four for a segment or a point. Unused rows of a batch are 0 p <= 0; an empty
        set has the row 0 p <= -1. O(n^2); directions and offsets are rounded.
        """
        vertices, counts = self._flat()
        room = max(4, vertices.shape[1])
        normals, offsets = np.zeros((counts.size, room, 2)), np.zeros((counts.size, room))
        kernels.constraints(vertices, counts, normals, offsets)
        room = 1 + int(np.flatnonzero(np.any(normals.any(axis=-1) | (offsets < 0.0), axis=0)).max(initial=0))
        normals, offsets = normals[:, :room], offsets[:, :room]
        return normals.reshape(*self.shape, room, 2), offsets.reshape(*self.shape, room)

    def support_function(self, direction: ArrayLike) -> Floats:
        """Return max(direction . p), shape (...); -inf for the empty set. O(n); rounded as one scalar product."""
        return self._measure(kernels.support, self._vectors(direction, "direction"))[..., 0]

    def support_vector(self, direction: ArrayLike) -> Floats:
        """Return a vertex farthest along a direction, shape (..., 2). O(n).

        Raises
        ------
        ValueError
            If a single polygon is empty.
        """
        return self._known(
            self._measure(kernels.support, self._vectors(direction, "direction"))[..., 1:], "support vector"
        )

    def margin(self, point: ArrayLike) -> Floats:
        """Return the signed distance of a point, shape (2,) or (..., 2), from the boundary, positive inside.

        -inf for the empty set. O(n), within rounding of the coordinates.
        """
        return self._measure(kernels.margin, self._vectors(point, "point"))[..., 0]

    def contains(self, point: ArrayLike, tolerance: float = 0.0) -> Flags:
        """Return whether a point, shape (2,) or (..., 2), is inside, on the boundary, or within a distance of the set.

        O(n). Exact for a tolerance of 0: rounding does not affect the answer.
        """
        values = self._measure(kernels.holds, self._vectors(point, "point"))
        return np.asarray((values[..., 0] > 0.0) | (values[..., 1] >= -tolerance if tolerance else False))

    def is_subset(self, other: ConvexPolygons, tolerance: float = 0.0) -> Flags:
        """Return whether all points of the set are in the other one, or within a distance of it, shape (...).

        O(n m). Exact for a tolerance of 0: rounding does not affect the answer. Sets that were computed are subsets
        only up to rounding in general.
        """
        one, two = self._with(other)
        values = one._compare(kernels.is_subset, two)
        return np.asarray((values[..., 0] > 0.0) | ((values[..., 1] <= tolerance) if tolerance else False))

    def equals(self, other: ConvexPolygons, tolerance: float = 0.0) -> Flags:
        """Return whether each set is a subset of the other one, with the tolerance of `is_subset`. O(n m)."""
        return np.asarray(self.is_subset(other, tolerance) & other.is_subset(self, tolerance))

    def area(self) -> Floats:
        """Return the area, shape (...). O(n); rounded relative to the squared diameter at most."""
        return self._measure(kernels.size)[..., 0]

    volume = area

    def centroid(self) -> Floats:
        """Return the centroid, shape (..., 2); the middle of a segment. O(n); it is in the set, to rounding.

        Raises
        ------
        ValueError
            If a single polygon is empty.
        """
        return self._known(self._measure(kernels.centroid)[..., :2], "centroid")

    def chebyshev_centre(self) -> tuple[Floats, Floats]:
        """Return the centres, shape (..., 2), and the radii, shape (...), of largest discs in the polygons.

        O(n^2), within rounding of the coordinates. Of several centres it is the middle one.

        Raises
        ------
        ValueError
            If a single polygon is empty.
        """
        values = self._known(self._measure(kernels.largest_disc), "Chebyshev centre")
        return values[..., :2], values[..., 2]

    def bounding_box(self) -> tuple[Floats, Floats]:
        """Return the least and the greatest coordinates, two arrays of shape (..., 2). O(n), exact.

        Raises
        ------
        ValueError
            If a single polygon is empty.
        """
        used = self._used()[..., None]
        lower = np.min(self.vertices, axis=-2, where=used, initial=np.inf)
        upper = np.max(self.vertices, axis=-2, where=used, initial=-np.inf)
        return self._known(lower, "bounding box"), self._known(upper, "bounding box")

    def diameter(self) -> Floats:
        """Return the greatest distance between two points, shape (...); 0 for the empty set. O(n^2), rounded."""
        return self._measure(kernels.size)[..., 1]

    def distance(self, other: ConvexPolygons | ArrayLike) -> Floats:
        """Return the distance from other sets or points, shape (...); inf if a set is empty.

        O(n m). It is 0 exactly if the sets intersect; otherwise rounded.
        """
        one, two = self._with(_as_sets(other))
        return one._compare(kernels.gap, two)[..., 0]

    def closest_point(self, point: ArrayLike) -> Floats:
        """Return the point of the set nearest to a point, shape (2,) or (..., 2). O(n), rounded; a point inside is
        itself.

        Raises
        ------
        ValueError
            If a single polygon is empty.
        """
        return self._known(self._measure(kernels.nearest, self._vectors(point, "point"))[..., :2], "closest point")

    def hausdorff_distance(self, other: ConvexPolygons) -> Floats:
        """Return the Hausdorff distance, shape (...); inf between an empty and a nonempty set. O(n m), rounded."""
        one, two = self._with(other)
        both = one._compare(kernels.is_subset, two)[..., 1], two._compare(kernels.is_subset, one)[..., 1]
        return np.asarray(np.maximum(*both))

    def sample(self, count: int, seed: int | np.random.Generator = 0) -> Floats:
        """Return points distributed uniformly over the sets, shape (..., count, 2). O(n) for each point; inside to
        rounding.

        Raises
        ------
        ValueError
            If a single polygon is empty, or `count` is less than 1.
        """
        _COUNT.need("count", count)
        vertices, counts = self._flat()
        out = np.zeros((counts.size, count, 2))
        kernels.sample(vertices, counts, np.random.default_rng(seed).random((counts.size, count, 3)), out)
        return self._known(out.reshape(*self.shape, count, 2), "points")

    def plot(self, axes: Any, **style: Any) -> None:
        """Fill the polygons on matplotlib axes, with the options of `matplotlib.axes.Axes.fill`."""
        for index in np.ndindex(self.shape):
            axes.fill(*self.vertices[index][: self.counts[index]].T, **style)

    # Operators and old names --------------------------------------------------------------------------------------

    def __and__(self, other: ConvexPolygons) -> ConvexPolygons:
        return self.intersection(other) if isinstance(other, ConvexPolygons) else NotImplemented

    def __add__(self, other: ConvexPolygons | ArrayLike) -> ConvexPolygons:
        return self.minkowski_sum(other) if isinstance(other, ConvexPolygons) else self.translate(other)

    __radd__ = __add__

    def __rmatmul__(self, matrix: ArrayLike) -> Any:
        return self.affine_map(matrix)

    def __contains__(self, point: ArrayLike) -> bool:
        if self.shape:
            raise TypeError("'in' is for a single polygon; use contains for a batch")
        return bool(self.contains(point))

    def __le__(self, other: ConvexPolygons) -> Flags:
        return self.is_subset(other) if isinstance(other, ConvexPolygons) else NotImplemented

    clip, support = renamed("clip", "cut"), renamed("support", "support_function")

    # Helpers ------------------------------------------------------------------------------------------------------

    def _used(self) -> Flags:
        """Which rows of the array hold vertices, shape (..., V)."""
        return np.asarray(np.arange(self.vertices.shape[-2]) < self.counts[..., None])

    def _known(self, values: Floats, quantity: str) -> Floats:
        """Return values, shape (..., k), masked for empty members of a batch."""
        empty = self.is_empty
        if not empty.any():
            return values
        if not self.shape:
            raise ValueError(f"the empty set has no {quantity}")
        shape = empty.shape + (1,) * (values.ndim - empty.ndim)
        return np.ma.masked_array(values, np.broadcast_to(empty.reshape(shape), values.shape))

    def _vectors(self, value: ArrayLike, name: str) -> Floats:
        if isinstance(value, np.ma.MaskedArray) and self.is_empty[np.ma.getmaskarray(value).any(axis=-1)].all():
            value = value.filled(0.0)
        vectors = real_values(name, value)
        if vectors.shape[-1:] != (2,):
            raise ValueError(f"{name} must have the shape (2,) or (..., 2): got {shown(value)}")
        _finite(**{name: vectors})
        return np.ascontiguousarray(self._spread(vectors, name, (2,)).reshape(-1, 2))

    def _scalars(self, value: ArrayLike, name: str) -> Floats:
        scalars = real_values(name, value)
        if np.isnan(scalars).any():
            raise ValueError(f"{name} must be a number: got {value!r}")
        return np.ascontiguousarray(self._spread(scalars, name, ()).reshape(-1))

    def _spread(self, values: Floats, name: str, last: tuple[int, ...]) -> Floats:
        """Broadcast values over the batch; `last` is the shape of the value for one polygon."""
        shape = (*self.shape, *last)
        with contextlib.suppress(ValueError):
            if not last or values.shape[-len(last) :] == last:
                return np.broadcast_to(values, shape)
        raise ValueError(
            f"{name} must have the shape {last}, or one that can be broadcast to {shape}: got {values.shape}"
        )

    def _with(self, other: ConvexPolygons) -> tuple[ConvexPolygons, ConvexPolygons]:
        """Return both batches in their common shape."""
        if self.shape == other.shape:
            return self, other
        shape = np.broadcast_shapes(self.shape, other.shape)
        return self.broadcast_to(shape), other.broadcast_to(shape)

    def _flat(self) -> tuple[Floats, Integers]:
        room = self.vertices.shape[-2]
        vertices = np.require(self.vertices.reshape(self.counts.size, room, 2), requirements=["C", "W"])
        return vertices, np.require(self.counts.reshape(-1), requirements=["C", "W"])

    def _make(self, more: int, kernel: Callable[..., None], *arguments: object) -> ConvexPolygons:
        """Apply a kernel whose results have at most `more` vertices more than these polygons."""
        vertices, counts = self._flat()
        out = np.zeros((counts.size, vertices.shape[1] + more, 2))
        made = np.zeros(counts.size, dtype=np.int64)
        kernel(vertices, counts, out, made, *arguments)
        room = int(made.max(initial=0))
        return ConvexPolygons.unchecked(out[:, :room].reshape(*self.shape, room, 2), made.reshape(self.shape))

    def _measure(self, kernel: Callable[..., None], vectors: Floats | None = None) -> Floats:
        """Apply a kernel that computes up to three numbers for each polygon, shape (..., 3)."""
        vertices, counts = self._flat()
        out = np.zeros((counts.size, 3))
        kernel(vertices, counts, np.zeros((counts.size, 2)) if vectors is None else vectors, out)
        return out.reshape(*self.shape, 3)

    def _compare(self, kernel: Callable[..., None], other: ConvexPolygons) -> Floats:
        """Apply a kernel that computes up to three numbers for each pair of polygons, shape (..., 3)."""
        vertices, counts = self._flat()
        out = np.zeros((counts.size, 3))
        kernel(vertices, counts, out, *other._flat())
        return out.reshape(*self.shape, 3)


def _finite(**values: Floats) -> None:
    """Raise an error if a number is not finite, or too large for exact decisions."""
    for name, numbers in values.items():
        if not (np.abs(numbers) <= LARGEST).all():
            raise ValueError(f"{name} must be finite, at most {LARGEST:g} in size")


def _as_sets(value: ConvexPolygons | ArrayLike) -> ConvexPolygons:
    """Return points, shape (..., 2), as sets of one point."""
    if isinstance(value, ConvexPolygons):
        return value
    points = np.asarray(value, dtype=float)
    return ConvexPolygons(points[..., None, :], np.ones(points.shape[:-1]))
