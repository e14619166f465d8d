"""Batches of convex polygons, and operations on them."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from infoset import polygon, polygon_hull, polygon_sum
from infoset._compile import compiled
from infoset.limits import Limits, need_pair, real_values, shown
from infoset.pictures import outlines_svg

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_CAP = Limits(least=4, whole=True)
_NAMES = ("empty set", "point", "segment", "triangle", "quadrangle", "pentagon", "hexagon")


class ConvexPolygons:
    """A batch of convex polygons with any batch shape; a single polygon is a batch of shape ().

    Parameters
    ----------
    vertices : array_like, shape (..., V, 2)
        The first `counts` rows are the vertices, counter-clockwise: one for a point, two for a segment, none for the
        empty set.
    counts : array_like of int, shape (...)
        Number of vertices.

    Raises
    ------
    TypeError
        If a vertex or a count is not a real number.
    ValueError
        If shapes disagree, a vertex is not finite or a count is not a whole number.

    Notes
    -----
    Operations return new objects and cost O(vertices); their arguments are broadcast over the batch.
    Cuts and sums are exact up to rounding of the coordinates; no tolerance is absolute.
    """

    def __init__(self, vertices: ArrayLike, counts: ArrayLike) -> None:
        numbers = real_values("counts", counts)
        if not np.isfinite(numbers).all() or (numbers != np.floor(numbers)).any():
            raise ValueError(f"counts must be whole numbers: got {shown(counts)}")
        self.counts: Integers = numbers.astype(np.int64)
        self.vertices: Floats = real_values("vertices", vertices)
        if self.vertices.ndim < 2 or self.vertices.shape[-1] != 2 or self.vertices.shape[:-2] != self.counts.shape:
            raise ValueError(
                f"vertices of shape (..., V, 2) and counts of shape (...) are needed: "
                f"got {self.vertices.shape} and {self.counts.shape}"
            )
        if (self.counts < 0).any() or (self.counts > self.vertices.shape[-2]).any():
            raise ValueError(f"counts must lie between 0 and {self.vertices.shape[-2]}, the room for vertices")
        used = np.arange(self.vertices.shape[-2]) < self.counts[..., None]
        if not np.isfinite(self.vertices[used]).all():
            raise ValueError("vertices must be finite")

    @classmethod
    def from_points(cls, points: ArrayLike) -> ConvexPolygons:
        """Return the convex hull of points.

        Parameters
        ----------
        points : array_like, shape (n, 2)
            Points in any order; no points give the empty set.

        Returns
        -------
        ConvexPolygons
            A batch of shape ().

        Raises
        ------
        ValueError
            If a point is not finite or does not have two coordinates.
        """
        array = real_values("points", points)
        if array.size and array.shape[1:] != (2,):
            raise ValueError(f"points must have the shape (n, 2): got {array.shape}")
        if not np.isfinite(array).all():
            raise ValueError("points must be finite")
        if len(array) == 0:
            return cls.empty()
        vertices = np.zeros((len(array), 2))
        count = polygon_hull.hull(array, len(array), vertices)
        return cls(vertices[:count], count)

    @classmethod
    def box(cls, x: tuple[float, float], y: tuple[float, float]) -> ConvexPolygons:
        """Return the axis-parallel box of the intervals `x` and `y`; equal ends give a segment or a point.

        Raises
        ------
        ValueError
            If an interval is reversed.
        """
        need_pair("x", x)
        need_pair("y", y)
        corners = [(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1])]
        distinct = list(dict.fromkeys(corners))
        return cls(np.array(distinct), len(distinct))

    @classmethod
    def empty(cls, shape: tuple[int, ...] = ()) -> ConvexPolygons:
        """Return a batch of empty sets."""
        return cls(np.zeros((*shape, 0, 2)), np.zeros(shape, dtype=np.int64))

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the batch."""
        return self.counts.shape

    @property
    def is_empty(self) -> NDArray[np.bool_]:
        """Whether each polygon is empty, shape (...)."""
        return np.asarray(self.counts == 0)

    def __len__(self) -> int:
        if not self.shape:
            raise TypeError("a single polygon has no length; its number of vertices is .counts")
        return self.shape[0]

    def __getitem__(self, index: int | slice | tuple[int | slice, ...] | NDArray[np.bool_]) -> ConvexPolygons:
        if not self.shape:
            raise TypeError("a single polygon cannot be indexed; its vertices are .polygon()")
        return ConvexPolygons(self.vertices[index], self.counts[index])

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
        return self.vertices[: int(self.counts)].copy()

    def clip(self, normal: ArrayLike, lower: ArrayLike = -np.inf, upper: ArrayLike = np.inf) -> ConvexPolygons:
        """Return the intersection with the band lower <= normal . p <= upper.

        Parameters
        ----------
        normal : array_like, shape (2,) or (..., 2)
            Normal of the band, of any nonzero length.
        lower, upper : array_like, shape () or (...)
            Bounds; infinite ones give half-planes, and lower > upper gives the empty set.

        Raises
        ------
        ValueError
            If the normal is zero.
        """
        normals = self._vectors(normal, "normal")
        if (np.abs(normals).max(axis=-1, initial=0.0) == 0.0).any():
            raise ValueError("the normal of a band must not be zero")
        return self._make(2, _clip_all, normals, self._scalars(lower, "lower"), self._scalars(upper, "upper"))

    def linear_map(self, matrix: ArrayLike) -> ConvexPolygons:
        """Return the image under a matrix, shape (2, 2) or (..., 2, 2); a singular one gives segments or points.

        Raises
        ------
        ValueError
            If the matrix is not finite.
        """
        matrices = self._spread(real_values("matrix", matrix), "matrix", (2, 2)).reshape(-1, 2, 2)
        if not np.isfinite(matrices).all():
            raise ValueError("matrix must be finite")
        return self._make(0, _map_all, np.ascontiguousarray(matrices))

    def translate(self, offset: ArrayLike) -> ConvexPolygons:
        """Return the polygons moved by an offset, shape (2,) or (..., 2)."""
        moved = self.vertices + np.reshape(self._vectors(offset, "offset"), (*self.shape, 1, 2))
        return ConvexPolygons(moved, self.counts)

    def add_segment(self, half: ArrayLike) -> ConvexPolygons:
        """Return the Minkowski sum with the segment from -half to +half, shape (2,) or (..., 2)."""
        return self._make(2, _add_segment_all, self._vectors(half, "half"))

    def minkowski_sum(self, other: ConvexPolygons) -> ConvexPolygons:
        """Return the Minkowski sum with polygons of the same batch shape, or with a single polygon."""
        shape = self.shape if not other.shape else np.broadcast_shapes(self.shape, other.shape)
        first, second = self._broadcast(shape), other._broadcast(shape)
        return first._make(second.vertices.shape[-2], _add_polygon_all, *second._flat())

    def support(self, direction: ArrayLike) -> Floats:
        """Return the support function max(direction . p), shape (...); -inf for the empty set."""
        return self._measure(_support_all, self._vectors(direction, "direction"))[:, 0].reshape(self.shape)

    def support_vector(self, direction: ArrayLike) -> Floats:
        """Return a vertex farthest along a direction, shape (..., 2).

        Raises
        ------
        ValueError
            If a set is empty.
        """
        self._need_points("support vector")
        return self._measure(_support_all, self._vectors(direction, "direction"))[:, 1:].reshape(*self.shape, 2)

    def margin(self, point: ArrayLike) -> Floats:
        """Signed distance of a point, shape (2,) or (..., 2), to the boundary; positive inside, -inf if empty."""
        return self._measure(_margin_all, self._vectors(point, "point"))[:, 0].reshape(self.shape)

    def contains(self, point: ArrayLike) -> NDArray[np.bool_]:
        """Return whether a point, shape (2,) or (..., 2), lies inside or on the boundary."""
        return np.asarray(self.margin(point) >= 0.0)

    def area(self) -> Floats:
        """Return the area, shape (...)."""
        return self._measure(_area_all, np.zeros((self.counts.size, 2)))[:, 0].reshape(self.shape)

    def centroid(self) -> Floats:
        """Return the centroid, shape (..., 2).

        Raises
        ------
        ValueError
            If a set is empty.
        """
        self._need_points("centroid")
        return self._measure(_centroid_all, np.zeros((self.counts.size, 2)))[:, :2].reshape(*self.shape, 2)

    def bounding_box(self) -> tuple[Floats, Floats]:
        """Return the least and the greatest coordinates, two arrays of shape (..., 2).

        Raises
        ------
        ValueError
            If a set is empty.
        """
        self._need_points("bounding box")
        ends = [self.support((sign * (1 - axis), sign * axis)) for sign in (-1.0, 1.0) for axis in (0, 1)]
        return np.stack((-ends[0], -ends[1]), axis=-1), np.stack(ends[2:], axis=-1)

    def reduce_outward(self, cap: int) -> ConvexPolygons:
        """Return polygons of at most `cap` (>= 4) vertices that contain these, by removing edges with least added area.

        Raises
        ------
        ValueError
            If `cap` is less than 4.
        """
        _CAP.need("cap", cap)
        return self._make(0, _reduce_all, np.full(self.counts.size, cap))

    def _need_points(self, quantity: str) -> None:
        if self.is_empty.any():
            raise ValueError(f"the empty set has no {quantity}")

    def _vectors(self, value: ArrayLike, name: str) -> Floats:
        vectors = real_values(name, value)
        if vectors.shape[-1:] != (2,) or not np.isfinite(vectors).all():
            raise ValueError(f"{name} must be finite, of shape (2,) or (..., 2): got {shown(value)}")
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

    def _broadcast(self, shape: tuple[int, ...]) -> ConvexPolygons:
        return ConvexPolygons(
            np.broadcast_to(self.vertices, (*shape, *self.vertices.shape[-2:])), np.broadcast_to(self.counts, shape)
        )

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
        return ConvexPolygons(out[:, :room].reshape(*self.shape, room, 2), made.reshape(self.shape))

    def _measure(self, kernel: Callable[..., None], vectors: Floats) -> Floats:
        """Apply a kernel that computes up to three numbers for each polygon."""
        vertices, counts = self._flat()
        out = np.zeros((counts.size, 3))
        kernel(vertices, counts, vectors, out)
        return out


@compiled
def _copy(vertices: Floats, count: int, out: Floats) -> None:
    for i in range(count):
        out[i, 0] = vertices[i, 0]
        out[i, 1] = vertices[i, 1]


@compiled
def _clip_all(
    vertices: Floats, counts: Integers, out: Floats, made: Integers, normal: Floats, lower: Floats, upper: Floats
) -> None:
    for i in range(counts.size):
        _copy(vertices[i], counts[i], out[i])
        made[i], _ = polygon.clip_to_band(out[i], counts[i], normal[i, 0], normal[i, 1], lower[i], upper[i])


@compiled
def _map_all(vertices: Floats, counts: Integers, out: Floats, made: Integers, matrix: Floats) -> None:
    for i in range(counts.size):
        m = matrix[i]
        made[i] = polygon.map_linearly(vertices[i], counts[i], m[0, 0], m[0, 1], m[1, 0], m[1, 1], out[i])


@compiled
def _add_segment_all(vertices: Floats, counts: Integers, out: Floats, made: Integers, half: Floats) -> None:
    for i in range(counts.size):
        _copy(vertices[i], counts[i], out[i])
        made[i] = polygon_sum.add_segment(out[i], counts[i], half[i, 0], half[i, 1])


@compiled
def _add_polygon_all(
    vertices: Floats, counts: Integers, out: Floats, made: Integers, other: Floats, other_counts: Integers
) -> None:
    for i in range(counts.size):
        made[i] = polygon_sum.add_polygon(vertices[i], counts[i], other[i], other_counts[i], out[i])


@compiled
def _reduce_all(vertices: Floats, counts: Integers, out: Floats, made: Integers, cap: Integers) -> None:
    for i in range(counts.size):
        _copy(vertices[i], counts[i], out[i])
        made[i] = polygon_hull.reduce_outward(out[i], counts[i], cap[i])


@compiled
def _support_all(vertices: Floats, counts: Integers, direction: Floats, out: Floats) -> None:
    for i in range(counts.size):
        if counts[i] == 0:
            out[i, 0] = -np.inf
            continue
        x, y = direction[i]
        at = polygon.support_index(vertices[i], counts[i], x, y)
        out[i, 1] = vertices[i, at, 0]
        out[i, 2] = vertices[i, at, 1]
        out[i, 0] = x * out[i, 1] + y * out[i, 2]


@compiled
def _margin_all(vertices: Floats, counts: Integers, point: Floats, out: Floats) -> None:
    for i in range(counts.size):
        out[i, 0] = polygon.margin(vertices[i], counts[i], point[i, 0], point[i, 1])


@compiled
def _area_all(vertices: Floats, counts: Integers, unused: Floats, out: Floats) -> None:
    for i in range(counts.size):
        out[i, 0] = polygon.area(vertices[i], counts[i])


@compiled
def _centroid_all(vertices: Floats, counts: Integers, unused: Floats, out: Floats) -> None:
    for i in range(counts.size):
        out[i, 0], out[i, 1] = polygon.centroid(vertices[i], counts[i])
