"""Construction and storage of batches of polygons, and application of the compiled loops to them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from infoset.arrays import Flags, Floats, Integers
from infoset.geometry import polygon_batches as kernels
from infoset.geometry._set_arguments import (
    bound_values,
    box_ends,
    constraint_values,
    finite_values,
    need_finite,
    need_set,
    radius_values,
)
from infoset.limits import Limits, real_values, shown

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry


_ROUNDING = 64.0 * float(np.finfo(np.float64).eps)
"""Rounding of an area, relative to the products of coordinates and widths in it."""


class PolygonArrays:
    """Vertices, shape (..., V, 2), and their numbers, shape (...), of a batch of polygons; see `ConvexPolygons`.

    Raises
    ------
    ValueError
        If shapes disagree.
    """

    vertices: Floats
    counts: Integers

    def __init__(self, vertices: ArrayLike, counts: ArrayLike) -> None:
        points, numbers = real_values("vertices", vertices), real_values("counts", counts)
        room = points.shape[-2] if points.ndim > 1 else 0
        if points.shape != (*numbers.shape, room, 2):
            raise ValueError(
                f"vertices of shape (..., V, 2) and counts of shape (...) are needed: "
                f"got {points.shape} and {numbers.shape}"
            )
        if not ((numbers >= 0) & (numbers <= room) & (numbers == np.floor(numbers))).all():
            raise ValueError(f"counts must be whole numbers from 0 to {room}, the room for vertices")
        given = self.unchecked(points, numbers.astype(np.int64))
        need_finite("vertices", points[given._used()])
        hull = given._make(0, kernels.hull)
        self.vertices, self.counts = hull.vertices, hull.counts

    @classmethod
    def unchecked(cls, vertices: Floats, counts: Integers) -> Self:
        """Return polygons of arrays `vertices` and `counts`, counter-clockwise, without checks and without a copy."""
        self = cls.__new__(cls)
        self.vertices, self.counts = vertices, counts
        return self

    @classmethod
    def from_vertices(cls, rings: ArrayLike) -> Self:
        """Return the polygons with rings of vertices, shape (..., V, 2), in either order around the polygon. O(n).

        A ring may repeat vertices, also its first at the end, and have vertices along a side. `stack` makes a batch of
        polygons from rings of different lengths.

        Raises
        ------
        ValueError
            If a ring is not convex; the message has the first reflex vertex. This is decided exactly. `from_points`
            takes the convex hull of any points instead.
        """
        vertices = finite_values("rings", rings, "...", "k", 2)
        polygons = cls.unchecked(vertices.copy(), np.full(vertices.shape[:-2], vertices.shape[-2]))
        corners, counts = polygons._flat()
        reflex = np.empty(polygons.shape, dtype=np.int64)
        kernels.drop_repeats(corners, counts)
        kernels.reflex_vertices(corners, counts, reflex.reshape(-1))
        if (reflex >= 0).any():
            index = np.argwhere(reflex >= 0)[0].tolist()
            vertex = reflex[tuple(index)]
            x, y = polygons.vertices[*index, vertex]
            raise ValueError(
                f"the ring is not convex: vertex {vertex}{f' of polygon {index}' if index else ''}, "
                f"({x:.17g}, {y:.17g}), is reflex"
            )
        return polygons._make(0, kernels.hull)

    @classmethod
    def from_points(cls, points: ArrayLike) -> Self:
        """Return the convex hull of points, shape (n, 2) or (..., n, 2); no points give the empty set.

        O(n) for sorted points, O(n^2) at worst. Exact: vertices are points, and rounding does not decide which.
        """
        array = finite_values("points", points, "...", "k", 2)
        return cls.unchecked(array, np.full(array.shape[:-2], array.shape[-2]))._make(0, kernels.hull)

    @classmethod
    def from_constraints(cls, normals: ArrayLike, offsets: ArrayLike) -> Self:
        """Return {p: normals p <= offsets}, with normals of shape (..., k, 2), of any length, and offsets (..., k).

        Infinite offsets are no limit. O(k^2). Exact: which constraints are redundant, and whether the set is empty, is
        decided without rounding, and each coordinate is within a few ulp of itself.

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
        table[..., :2], table[..., 2] = rows, limits
        lines = table.reshape(-1, shape[-1], 3, 1)
        sets = cls.empty(shape[:-1])._make(shape[-1] + 4, kernels.intersect_lines, lines)
        if (sets.counts < 0).any():
            index = np.argwhere(sets.counts < 0)[0].tolist()
            raise ValueError(f"the set{f' {index}' if index else ''} is unbounded")
        return sets

    @classmethod
    def from_box(cls, lower: ArrayLike, upper: ArrayLike) -> Self:
        """Return {p: lower <= p <= upper}, of shapes (2,) or (..., 2). Exact; equal ends give a segment or a point."""
        minimum, most = box_ends(lower, upper, "...", 2)
        corners = np.stack([minimum, minimum, most, most], axis=-2)
        corners[..., 1, 0], corners[..., 3, 0] = most[..., 0], minimum[..., 0]
        counts = np.full(corners.shape[:-2], 4)
        kernels.drop_repeats(corners.reshape(-1, 4, 2), counts.reshape(-1))
        return cls.unchecked(corners, counts)

    @classmethod
    def from_ball(cls, centre: ArrayLike, radius: ArrayLike, sides: int = 16, *, outer: bool = True) -> Self:
        """Return regular polygons around discs with `centre`, shape (..., 2), and `radius`, shape (...), or in them.

        An `outer` polygon contains the disc and exceeds it by the factor 1 / cos(pi / sides); an inner one is
        contained in it. Both to rounding: a few ulp. O(sides), at least three.
        """
        Limits(minimum=3, whole=True).need("sides", sides)
        middle, r = finite_values("centre", centre, "...", 2), radius_values(radius, "...")
        angles = (np.arange(sides) + (0.5 if outer else 0.0)) * (2.0 * math.pi / sides)
        unit = np.stack([np.cos(angles), np.sin(angles)], axis=-1) / (math.cos(math.pi / sides) if outer else 1.0)
        return cls.from_points(middle[..., None, :] + r[..., None, None] * unit)

    @classmethod
    def from_zonotope(cls, centre: ArrayLike, generators: ArrayLike) -> Self:
        """Return {centre + sum of z_i generators[i]: -1 <= z_i <= 1}, with a row of `generators` for each i.

        `centre` has the shape (2,) or (..., 2), and `generators` (g, 2) or (..., g, 2). O(g^2); each coordinate is
        rounded g times.
        """
        middle = finite_values("centre", centre, "...", 2)
        rows = finite_values("generators", generators, "...", "g", 2)
        shape = np.broadcast_shapes(middle.shape[:-1], rows.shape[:-2])
        points = cls.unchecked(middle[..., None, :], np.ones(middle.shape[:-1], dtype=np.int64)).broadcast_to(shape)
        halves = np.broadcast_to(rows, (*shape, *rows.shape[-2:])).reshape(points.counts.size, *rows.shape[-2:])
        return points._make(2 * rows.shape[-2], kernels.add_segments, np.ascontiguousarray(halves))

    @classmethod
    def from_shapely(cls, geometry: BaseGeometry) -> Self:
        """Return a convex shapely Point, LineString or Polygon as a single polygon. O(n).

        Vertices along a side are dropped.

        Raises
        ------
        ValueError
            If a geometry is not convex by more than rounding, or is of another type.
        """
        from shapely import get_coordinates

        vertices, kind = get_coordinates(geometry), geometry.geom_type
        if kind not in ("Point", "LineString", "Polygon"):
            raise ValueError(f"a Point, a LineString or a Polygon is needed: got {shown(geometry)}")
        hull = cls.from_points(vertices)
        if len(vertices):
            rounding = _ROUNDING * np.abs(vertices).max(axis=0) @ np.ptp(vertices, axis=0)[::-1]
            missing = abs(geometry.convex_hull.area - geometry.area)
            if missing > rounding:
                raise ValueError(f"the {kind} is not convex: its area and that of its hull differ by {missing:g}")
        return hull

    def to_shapely(self) -> BaseGeometry:
        """Return a single polygon as a shapely Point, LineString or Polygon; the empty set is an empty Polygon."""
        from shapely import LineString, Point, Polygon

        vertices = self.polygon()
        if len(vertices) == 1:
            return Point(vertices[0])
        return LineString(vertices) if len(vertices) == 2 else Polygon(vertices)

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
            raise ValueError(f"this is a batch of shape {self.shape}: choose one with an index first")
        return np.array(self.vertices[: int(self.counts)])

    def broadcast_to(self, shape: tuple[int, ...]) -> Self:
        """Return the batch repeated along new axes to another shape; the vertices are shared, not copied.

        Raises
        ------
        ValueError
            If the batch cannot be broadcast to this shape.
        """
        if shape == self.shape:
            return self
        counts = np.broadcast_to(self.counts, shape)
        return self.unchecked(np.broadcast_to(self.vertices, (*shape, *self.vertices.shape[-2:])), counts)

    # For operations -----------------------------------------------------------------------------------------------

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

    def _measure_at(self, kernel: Callable[..., None], name: str, value: ArrayLike) -> Floats:
        """Apply a kernel that measures at a vector for each polygon; a single polygon is measured at all vectors."""
        one = self if self.shape else self.broadcast_to(real_values(name, value).shape[:-1])
        return one._measure(kernel, one._each(name, value, 2))

    def _each(self, name: str, value: ArrayLike, *last: int) -> Floats:
        """Return a value for each polygon, shape (B, *last), from such values or from one of the shape `last`.

        Numbers, whose shape is (), may be infinite. Values may be masked for empty polygons, as results of a batch are.
        """
        if isinstance(value, np.ma.MaskedArray) and value.shape == (*self.shape, *last):
            masked = np.ma.getmaskarray(value).reshape(*self.shape, -1).any(axis=-1)
            value = value.filled(0.0) if (self.is_empty | ~masked).all() else value
        values = finite_values(name, value, "...", *last) if last else bound_values(name, value)
        shape = (*self.shape, *last)
        if values.shape != shape:
            try:
                values = np.broadcast_to(values, shape)
            except ValueError:
                raise ValueError(
                    f"{name} must have the shape {last}, or one that can be broadcast to {shape}: got {values.shape}"
                ) from None
        return _plain(values.reshape(self.counts.size, *last))

    def _with(self, other: Self) -> tuple[Self, Self]:
        """Return both batches in their common shape."""
        need_set("other", other, type(self))
        if self.shape == other.shape:
            return self, other
        shape = np.broadcast_shapes(self.shape, other.shape)
        return self.broadcast_to(shape), other.broadcast_to(shape)

    def _flat(self) -> tuple[Floats, Integers]:
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
        """Apply a kernel that computes up to three numbers for each polygon, shape (..., 3)."""
        vertices, counts = self._flat()
        out = np.zeros((counts.size, 3))
        kernel(vertices, counts, out, *arguments)
        return out.reshape(*self.shape, 3)


def _plain(values: NDArray[Any]) -> NDArray[Any]:
    """Return an array that kernels accept: contiguous and writeable."""
    return values if values.flags.carray else values.copy()
