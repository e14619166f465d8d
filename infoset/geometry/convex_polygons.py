"""Batches of convex polygons, and operations on them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from infoset.arrays import Flags, Floats
from infoset.geometry import polygon_batches as kernels
from infoset.geometry._set_arguments import (
    axis_numbers,
    finite_values,
    not_negative,
    offset_values,
    present_axes,
)
from infoset.geometry.convex_set import ConvexSet
from infoset.geometry.polygon_arrays import PolygonArrays
from infoset.limits import Limits, real_values, shown

if TYPE_CHECKING:
    from infoset.geometry.polytope import Polytope


class ConvexPolygons(PolygonArrays, ConvexSet):
    """A batch of convex polygons with any batch shape; a single polygon is a batch of shape ().

    Parameters
    ----------
    vertices : array_like, shape (..., V, 2)
        The polygon is the convex hull of the first `counts` rows; the others are padding. As an attribute, these rows
        are the vertices counter-clockwise: one for a point, two for a segment, none for the empty set. `polygon`
        returns those of a single polygon without padding.
    counts : array_like of int, shape (...)
        Number of points; as an attribute, of vertices.

    Raises
    ------
    ValueError
        If shapes disagree.

    Notes
    -----
    Operations return new objects. Their arguments are broadcast over the batch. A single polygon is broadcast to the
    shape of the other polygons, and of several points or directions: `contains` of a polygon takes any number of
    points. The cost of an operation is for one polygon of n vertices. All arguments are
    checked: numbers are finite (TypeError if they are not real numbers), and shapes fit (ValueError).

    An empty member of a batch does not affect the others: sets made from it are empty, its support function is -inf,
    its distance from any set is inf, and points such as its centroid are masked (`numpy.ma.MaskedArray`). A single
    empty set has no such points; then a ValueError is raised.

    Operators: `P & Q` (intersection), `P + Q` (Minkowski sum), `P + vector` (translation), `A @ P` (linear map),
    `point in P`, `P <= Q` (subset). `P == Q` compares objects; `equals` compares sets.
    """

    def __repr__(self) -> str:
        return f"ConvexPolygons(shape={self.shape}, counts={self.counts.tolist()})"

    def polytope(self) -> Polytope:
        """Return a single polygon as a `Polytope`; `ConvexPolygons.from_points(polytope.vertices)` is the reverse."""
        from infoset.geometry.polytope import Polytope

        vertices = self.polygon()
        return Polytope.from_vertices(vertices) if len(vertices) else Polytope.empty(2)

    # Sets -----------------------------------------------------------------------------------------------------------

    def cut(
        self, normal: ArrayLike, lower: ArrayLike = -np.inf, upper: ArrayLike = np.inf, *, slack_ulp: float = 0.0
    ) -> ConvexPolygons:
        """Return the intersection with the strip lower <= normal . p <= upper.

        `normal` has the shape (2,) or (..., 2), and any length. The bounds have the shape () or (...); infinite ones
        give half-planes, and lower > upper gives the empty set. The strip is wider on both sides by `slack_ulp` ulp of
        the products in normal . p: a point that satisfies the bounds up to rounding is not lost.

        O(n). Vertices inside do not change; new ones are within a few ulp of the coordinates. A vertex on a border is
        inside.

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
        """Return the image under a matrix, shape (2, 2) or (..., 2, 2); a singular one gives segments or points.

        O(n). Each coordinate of a vertex is rounded three times. `affine_map` maps to other dimensions.
        """
        return self._make(0, kernels.linear_map, self._each("matrix", matrix, 2, 2))

    def affine_map(self, matrix: ArrayLike, offset: ArrayLike = 0.0) -> Any:
        """Return {matrix p + offset}; a matrix of shape (m, 2), m not 2, maps a single polygon to a `Polytope` in R^m.

        `offset` has the shape (2,), (..., 2) or (m,), or is 0. O(n), as `linear_map`.
        """
        rows = real_values("matrix", matrix)
        if rows.shape[-2:] == (2, 2):
            return self.linear_map(rows).translate(offset_values(offset, "...", 2))
        return self.polytope().affine_map(rows, offset)

    def translate(self, offset: ArrayLike) -> ConvexPolygons:
        """Return the polygons moved by an offset, shape (2,) or (..., 2). O(n); each coordinate is rounded once."""
        moved = self.vertices + self._each("offset", offset, 2).reshape(*self.shape, 1, 2)
        return ConvexPolygons.unchecked(moved, self.counts)

    def preimage(self, matrix: ArrayLike, offset: ArrayLike = 0.0) -> Any:
        """Return {p: matrix p + offset in the set}; a matrix of shape (2, m), m not 2, gives a `Polytope` in R^m.

        O(n). The vertices are mapped by the inverse matrix, whose entries are within a few ulp of themselves. If the
        matrix is singular, the preimage is unbounded or empty, which is decided exactly.

        Raises
        ------
        ValueError
            If the preimage is unbounded.
        """
        rows = real_values("matrix", matrix)
        if rows.shape[-1:] != (2,):
            return self.polytope().preimage(rows, offset)
        matrices = self._each("matrix", rows, 2, 2)
        start = offset_values(offset, "...", 2)
        inverse = np.zeros(matrices.shape)
        kernels.invert(matrices, inverse)
        mapped = self.translate(-start).linear_map(inverse.reshape(*self.shape, 2, 2))
        is_regular = inverse.any(axis=(1, 2))
        if is_regular.all():
            return mapped

        singular = ~is_regular.reshape(self.shape)
        meets = self._measure(kernels.range_meets, matrices, self._each("offset", start, 2))[..., 0] > 0.0
        unbounded = singular & meets
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

    def minkowski_sum(self, other: ConvexPolygons) -> ConvexPolygons:
        """Return the Minkowski sum. O(n + m), each vertex rounded once."""
        one, two = self._with(other)
        return one._make(two.vertices.shape[-2], kernels.add_polygon, *two._flat())

    def minkowski_difference(self, other: ConvexPolygons) -> ConvexPolygons:
        """Return the Pontryagin difference {p: p + q in the set for all q in the other}.

        A member of a batch without a bounded difference, because only the other set is empty, gives the empty set.
        O(n (n + m)). Exact: which sides remain, and whether the difference is empty, is decided without rounding, also
        for sets that fit in one place only; vertices are within 4 ulp of the coordinates.

        Raises
        ------
        ValueError
            If the other set is empty and this one is not, both single: every point satisfies the condition.
        """
        one, two = self._with(other)
        absent = two.counts == 0
        if absent.any():
            if not one.shape and one.counts:
                raise ValueError("the difference with an empty set is unbounded")
            one = ConvexPolygons.unchecked(one.vertices, np.where(absent, 0, one.counts))
        return one._make(6, kernels.difference, *two._flat())

    def intersection(self, other: ConvexPolygons) -> ConvexPolygons:
        """Return the intersection.

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
        return ConvexPolygons.unchecked(points, one.counts + two.counts)._make(0, kernels.hull)

    def project(self, axes: ArrayLike) -> Any:
        """Return the projection on an axis (0 or 1) as intervals: minimum and maximum values, shape (...).

        `axes` is an integer or a sequence of integers; both axes give the polygons, their coordinates in this order.
        O(n), exact.
        """
        numbers = axis_numbers(axes, 2, 2)
        if len(numbers) > 1:
            return self.linear_map(np.eye(2)[numbers])
        lower, upper = self.bounding_box()
        return lower[..., numbers[0]], upper[..., numbers[0]]

    def slice(self, axes: ArrayLike, values: ArrayLike) -> tuple[Floats, Floats]:
        """Return the interval of the other coordinate where a coordinate (0 or 1) has a value: shape (...).

        `axes` is an integer, or a sequence of one; `values` has the shape () or (...). O(n), within a few ulp of
        the coordinates; masked where the line misses a member of a batch.

        Raises
        ------
        ValueError
            If the line misses a single polygon.
        """
        (axis,) = axis_numbers(axes, 2, 1)
        section = self.cut(np.eye(2)[axis], values, values)
        if not self.shape and section.is_empty:
            raise ValueError(f"the line where coordinate {axis} is {shown(values)} does not meet the polygon")
        intervals: tuple[Floats, Floats] = section.project(1 - axis)
        return intervals

    def reduce_outward(self, cap: int) -> ConvexPolygons:
        """Polygons of at most `cap` (>= 4) vertices that contain these, by removing sides with minimum added area.

        O(n) for each side; new vertices are rounded.
        """
        Limits(minimum=4, whole=True).need("cap", cap)
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
        return self._measure_at(kernels.support, "direction", direction)[..., 0]

    def support_vector(self, direction: ArrayLike) -> Floats:
        """Return a vertex farthest along a direction, shape (..., 2). O(n)."""
        return self._known(self._measure_at(kernels.support, "direction", direction)[..., 1:], "support vector")

    def margin(self, point: ArrayLike) -> Floats:
        """Return the signed distance of a point, shape (2,) or (..., 2), from the boundary, positive inside.

        -inf for the empty set. O(n), within rounding of the coordinates.
        """
        return self._measure_at(kernels.margin, "point", point)[..., 0]

    def contains(self, point: ArrayLike, tolerance: float = 0.0) -> Flags:
        """Return whether a point, shape (2,) or (..., 2), is inside, on the boundary, or within a distance of the set.

        O(n). Exact for a tolerance of 0: rounding does not affect the answer.
        """
        distance = self._measure_at(kernels.nearest, "point", point)[..., 2]
        return np.asarray(distance <= not_negative("tolerance", tolerance))

    def is_subset(self, other: ConvexPolygons, tolerance: float = 0.0) -> Flags:
        """Return whether all points of the set are in the other one, or within a distance of it, shape (...).

        O(n m). Exact for a tolerance of 0: rounding does not affect the answer. Sets that were computed are subsets
        only up to rounding in general.
        """
        return np.asarray(self._excess(other) <= not_negative("tolerance", tolerance))

    def _excess(self, other: ConvexPolygons) -> Floats:
        """Return the maximum distance of a point of the set from the other one, shape (...); 0 only for a subset."""
        one, two = self._with(other)
        return one._measure(kernels.excess, *two._flat())[..., 0]

    def area(self) -> Floats:
        """Return the area, shape (...). O(n); rounded relative to the squared diameter at most."""
        return self._measure(kernels.moments)[..., 0]

    volume = area

    def centroid(self) -> Floats:
        """Return the centroid, shape (..., 2); the middle of a segment. O(n); it is in the set, to rounding."""
        return self._known(self._measure(kernels.moments)[..., 1:], "centroid")

    def chebyshev_centre(self) -> tuple[Floats, Floats]:
        """Return the centres, shape (..., 2), and the radii, shape (...), of largest discs in the polygons.

        O(n^2), within rounding of the coordinates. Of several centres it is the middle one.
        """
        values = self._known(self._measure(kernels.max_disc), "Chebyshev centre")
        return values[..., :2], values[..., 2]

    def bounding_box(self) -> tuple[Floats, Floats]:
        """Return the minimum and the maximum coordinates, two arrays of shape (..., 2). O(n), exact."""
        used = self._used()[..., None]
        lower = np.min(self.vertices, axis=-2, where=used, initial=np.inf)
        upper = np.max(self.vertices, axis=-2, where=used, initial=-np.inf)
        return self._known(lower, "bounding box"), self._known(upper, "bounding box")

    def diameter(self) -> Floats:
        """Return the maximum distance between two points, shape (...); 0 for the empty set. O(n^2), rounded."""
        return self._measure(kernels.diameter)[..., 0]

    def distance(self, other: ConvexPolygons | ArrayLike) -> Floats:
        """Return the distance from other sets or points, shape (...); inf if a set is empty.

        O(n m). It is 0 exactly if the sets intersect; otherwise rounded.
        """
        if not isinstance(other, ConvexPolygons):
            points = finite_values("other", other, "...", 2)
            other = ConvexPolygons.unchecked(points[..., None, :], np.ones(points.shape[:-1], dtype=np.int64))
        one, two = self._with(other)
        return one._measure(kernels.gap, *two._flat())[..., 0]

    def isdisjoint(self, other: ConvexPolygons) -> Flags:
        """Return whether no point is in both sets, shape (...). O(n m), exact."""
        return np.asarray(self.distance(other) > 0.0)

    def closest_point(self, point: ArrayLike) -> Floats:
        """Return the point of the set nearest to a point, shape (2,) or (..., 2): itself if inside. O(n), rounded."""
        return self._known(self._measure_at(kernels.nearest, "point", point)[..., :2], "closest point")

    def hausdorff_distance(self, other: ConvexPolygons) -> Floats:
        """Return the Hausdorff distance, shape (...); inf between an empty and a nonempty set. O(n m), rounded."""
        return np.asarray(np.maximum(self._excess(other), other._excess(self)))

    def sample(self, count: int, seed: int | np.random.Generator = 0) -> Floats:
        """Return at least one point distributed uniformly over each set, shape (..., count, 2).

        O(n) for each point; inside to rounding.
        """
        random = np.random.default_rng(seed)
        vertices, counts = self._flat()
        out = np.zeros((counts.size, count, 2))
        kernels.sample(vertices, counts, random.random((counts.size, count, 3)), out)
        return self._known(out.reshape(*self.shape, count, 2), "points")

    def plot(self, axes: Any = None, **style: Any) -> None:
        """Fill the polygons on matplotlib axes (default: the present ones), with options of matplotlib's `fill`."""
        axes = present_axes(axes)
        for index in np.ndindex(self.shape):
            axes.fill(*self.vertices[index][: self.counts[index]].T, **style)
