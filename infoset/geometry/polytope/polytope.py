"""A bounded convex polytope in R^n, in both representations."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.distance import cdist

from infoset.arrays import Flags, Floats
from infoset.geometry._set_arguments import (
    axis_numbers,
    bound_values,
    finite_values,
    is_set,
    need_set,
    not_negative,
)
from infoset.geometry.polytope._affine_hull import EmptyPolytopeError, min_relaxation
from infoset.geometry.polytope._measures import max_ball, nearest_difference, simplices_of, volume_of
from infoset.geometry.polytope._scaling import LocalAxes, described, tightened, without_far
from infoset.geometry.polytope.arrays import PolytopeArrays
from infoset.limits import Limits, real_values

_FLAT_WIDTH = 1e-12
_EPS = float(np.finfo(np.float64).eps)


class Polytope(PolytopeArrays):
    """A convex polytope; it may be flat, a segment, a point, or empty.

    It is {x: normals x <= offsets, across x = levels}, and the hull of its `vertices`, shape (v, n), without redundant
    points. The f normals of the facets have unit length and are in the directions of the affine hull; the n - dimension
    rows of `across` are orthonormal. Construct it with `from_vertices`, `from_constraints`, `from_box`, `from_ball` or
    `from_zonotope`. A set that is 1e9 times thinner than it is long counts as flat. The units of the axes do not
    matter, except that points whose width along one axis is 3e-12 times that along another one, or less, count as flat.
    Rounding of the coordinates limits sets far from the origin: a thickness below 1e-13 of a coordinate counts as flat.

    An empty set has no vertices; `relaxation` is then the minimum relaxation of the constraints that made it empty,
    their normals of unit length, with which a point satisfies them; 0 if it is not known. Operations on it give the
    empty set; points such as its centroid do not exist, and an EmptyPolytopeError is raised.

    All arguments are checked: numbers are finite (TypeError if they are not real numbers), shapes and spaces fit
    (ValueError). Operations are exact up to rounding: about 1e-12 of the size of the set, and 2e-9 at most. Their cost
    is that of a convex hull: O(k log k) for k points or half-spaces in up to three dimensions, O(k^(n/2)) at worst in
    n.

    Operators: `P & Q` (intersection), `P + Q` (Minkowski sum), `P + vector` (translation), `A @ P` (linear map),
    `point in P`, `P <= Q` (subset, to rounding). `P == Q` compares objects; `equals` compares sets. The vertices are in
    no order; `plot` and `to_shapely` order those of a set of the plane.
    """

    __array_ufunc__ = None

    # Sets -----------------------------------------------------------------------------------------------------------

    def linear_map(self, matrix: ArrayLike) -> Polytope:
        """Return {matrix x}, with a matrix of shape (m, n), singular or not: the hull of the images of the vertices."""
        return self.affine_map(matrix)

    def affine_map(self, matrix: ArrayLike, offset: ArrayLike = 0.0) -> Polytope:
        """Return {matrix x + offset} in R^m, with a matrix of shape (m, n), singular or not, and an offset of shape
        (m,) or 0.

        The hull of the images of the vertices, each rounded n + 1 times.
        """
        rows = finite_values("matrix", matrix, "m", self.space)
        moved = self._shift(offset, len(rows))
        if self.is_empty:
            return self.empty(len(rows), self.relaxation)
        return self.from_vertices(self.vertices @ rows.T + moved)

    @staticmethod
    def _shift(offset: ArrayLike, space: int) -> Floats:
        """Return an offset, shape (space,), from such an array or from one number for all coordinates."""
        shift = real_values("offset", offset)
        return np.broadcast_to(finite_values("offset", shift, *[space] * min(shift.ndim, 1)), (space,))

    def translate(self, offset: ArrayLike) -> Polytope:
        """Return the set moved by an offset, shape (n,). O((v + f) n): no hull is needed."""
        by = finite_values("offset", offset, self.space)
        if self.is_empty:
            return self
        offsets, levels = self.offsets + self.normals @ by, self.levels + self.across @ by
        return Polytope(self.vertices + by, self.normals, offsets, self.across, levels)

    def preimage(self, matrix: ArrayLike, offset: ArrayLike = 0.0) -> Polytope:
        """Return {x in R^m: matrix x + offset in the set}, with a matrix of shape (n, m): its facets, mapped.

        An UnboundedPolytopeError is raised if the preimage is unbounded: the matrix has a null space.
        """
        rows, moved = finite_values("matrix", matrix, self.space, "m"), self._shift(offset, self.space)
        if self.is_empty:
            return self.empty(rows.shape[1], self.relaxation)
        offsets, levels = self.offsets - self.normals @ moved, self.levels - self.across @ moved
        return self.from_constraints(self.normals @ rows, offsets, self.across @ rows, levels)

    def minkowski_sum(self, other: Polytope) -> Polytope:
        """Return {x + y: x in the set, y in the other}, the hull of all v1 v2 sums of two vertices."""
        self._need_other(other)
        if self.is_empty or other.is_empty:
            return self if self.is_empty else other
        sums = self.vertices[:, None, :] + other.vertices[None, :, :]
        return self._hull(sums.reshape(-1, self.space), solid=self.space in (self.dimension, other.dimension))

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
        rows, limits = self.constraints()
        limits = limits - other.support_function(rows)
        most, minimum = np.split(limits[len(self.normals) :], 2)
        sizes = np.maximum(np.abs(self.vertices).max(axis=0), np.abs(other.vertices).max(axis=0))
        if (most + minimum < -_FLAT_WIDTH * np.abs(self.across) @ sizes).any():
            return self.empty(self.space, min_relaxation(rows, limits))
        (lower, upper), (start, end) = self.bounding_box(), other.bounding_box()
        sides = self.normals, limits[: len(self.normals)], self.across, 0.5 * (most - minimum)
        return self._in_box(sides, lower - start, upper - end, upper - lower, solid=self.dimension == self.space)

    def intersection(self, *others: Polytope) -> Polytope:
        """Return the intersection with one or more polytopes, from the facets of all."""
        sets = (self, *map(self._need_other, others))
        for one in sets:
            if one.is_empty:
                return one
        boxes = np.array([one.bounding_box() for one in sets])
        widths = np.min(boxes[:, 1] - boxes[:, 0], axis=0)
        names = ("normals", "offsets", "across", "levels")
        sides = tuple(np.concatenate([getattr(one, name) for one in sets]) for name in names)
        solid = all(one.dimension == one.space for one in sets)
        return self._in_box(sides, boxes[:, 0].max(axis=0), boxes[:, 1].min(axis=0), widths, solid=solid)

    @classmethod
    def _in_box(
        cls, sides: tuple[Floats, ...], lower: Floats, upper: Floats, widths: Floats, *, solid: bool
    ) -> Polytope:
        """Return {x: rows x <= limits, across x = levels}, which is known to lie between `lower` and `upper`.

        `widths` are those of sets that contain it; `solid` is whether these have an interior.
        """
        rows, limits, across, levels = sides
        axes = LocalAxes.needed(lower, upper, widths if solid else None, widths)
        try:
            if axes is not None:
                return cls(*axes.intersection(rows, limits, across, levels, widths))
            near, box = without_far(rows, limits, lower, upper), np.array([lower, upper, widths])
            return cls(*described(*near, across, levels, bounded=True, box=box))
        except EmptyPolytopeError as error:
            return cls.empty(len(lower), error.relaxation)

    def convex_hull(self, *others: Polytope) -> Polytope:
        """Return the convex hull of the union with one or more polytopes."""
        points = np.vstack([self.vertices, *(self._need_other(one).vertices for one in others)])
        solid = self.space in (self.dimension, *(one.dimension for one in others))
        return self._hull(points, solid=solid) if len(points) else self

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
        wider = slack_ulp * _EPS * (np.abs(rows) @ np.abs(self.vertices).max(axis=0))
        rows, limits = np.vstack([rows, -rows]), np.concatenate([most + wider, wider - minimum])
        cuts = self.support_function(rows) > limits
        if not cuts.any():
            return self
        if np.isneginf(limits).any() or (minimum > most).any():
            own_rows, own_limits = self.constraints()
            rows, limits = np.vstack([own_rows, rows[cuts]]), np.concatenate([own_limits, limits[cuts]])
            return self.empty(self.space, min_relaxation(rows, limits))
        lower, upper = self.bounding_box()
        sides = np.vstack([self.normals, rows[cuts]]), np.concatenate([self.offsets, limits[cuts]])
        ends = tightened(rows[cuts], limits[cuts], lower, upper)
        solid = self.dimension == self.space
        return self._in_box((*sides, self.across, self.levels), *ends, upper - lower, solid=solid)

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

    def reduce_outward(self, cap: int) -> Polytope:
        """Return a polytope with at most `cap` (>= 2n) facets that contains the set.

        It starts with the bounding box. Then it is cut by the facet of the set beyond which a vertex is farthest,
        until it has `cap` facets: one intersection for each.
        """
        Limits(minimum=2 * self.space, whole=True).need("cap", cap)
        if self.is_empty or len(self.normals) <= cap:
            return self
        outer = self.from_box(*self.bounding_box())
        rows, limits = self.constraints()
        for _ in range(cap):
            beyond = outer.support_function(rows) - limits
            worst = int(beyond.argmax())
            tighter = outer.cut(rows[worst], upper=limits[worst])
            if beyond[worst] <= 0.0 or len(tighter.normals) + 2 * len(tighter.across) > cap:
                break
            outer = tighter
        return outer

    def _need_other(self, other: Polytope) -> Polytope:
        """Return another polytope; it must be in the same space."""
        if need_set("other", other, Polytope).space != self.space:
            raise ValueError(f"other must be a polytope in R^{self.space}, as this one: got {other!r}")
        return other

    # Measures ---------------------------------------------------------------------------------------------------------

    def constraints(self) -> tuple[Floats, Floats]:
        """Return normals, shape (k, n), of unit length, and offsets, shape (k,): the set is normals x <= offsets.

        An equation of a flat set gives two rows; an empty set is 0 x <= -1.
        """
        rows = np.vstack([self.normals, self.across, -self.across])
        return rows, np.concatenate([self.offsets, self.levels, -self.levels])

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
        return beyond, away

    @cached_property
    def _axes(self) -> LocalAxes | None:
        """Coordinates in which the set is about one wide, if its own differ much."""
        lower, upper = self.bounding_box()
        return LocalAxes.needed(lower, upper, upper - lower if self.dimension == self.space else None)

    def excess(self, points: ArrayLike) -> Floats:
        """Return the maximum distance of `points`, shape (..., n), beyond a facet or from the affine hull.

        It has shape (...), and is at most 0 inside, also for the vertices: the rounding of a scalar product, and of the
        representation (distances of vertices beyond facets), is subtracted. Infinite for the empty set.
        """
        x = finite_values("points", points, "...", self.space)
        if self.is_empty:
            return np.full(x.shape[:-1], np.inf)
        reach = (self.space + 2) * _EPS * np.maximum(np.abs(x), np.abs(self.vertices).max(axis=0))
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
        return 0.0 if self.is_empty else volume_of(self.vertices, self._axes)

    def area(self) -> float:
        """Return the area of a set of R^2; 0 for a segment or a point. `volume` is for any space."""
        return self.volume() if self._of_plane().dimension == 2 else 0.0

    def centroid(self) -> Floats:
        """Return the centroid within the affine hull, shape (n,), from a division into simplices."""
        simplices, shares = simplices_of(self.needed().vertices, self._axes)
        return np.asarray(shares @ simplices.mean(axis=1))

    def sample(self, count: int, seed: int | np.random.Generator = 0) -> Floats:
        """Return points distributed uniformly over the set, shape (count, n), from a division into simplices."""
        random = np.random.default_rng(seed)
        simplices, shares = simplices_of(self.needed().vertices, self._axes)
        weights = random.dirichlet(np.ones(simplices.shape[1]), count)
        return np.asarray(np.einsum("ij,ijk->ik", weights, simplices[random.choice(len(shares), count, p=shares)]))

    def chebyshev_centre(self) -> tuple[Floats, float]:
        """Return the centre, shape (n,), and the radius of a largest ball in the set, within its affine hull.

        A linear program (HiGHS) in coordinates about the centre of the vertices.
        """
        return max_ball(self.needed().vertices, self.normals, self.offsets, self._axes)

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

    def hausdorff_distance(self, other: Polytope) -> float:
        """Return the Hausdorff distance; inf between an empty and a nonempty set. One `distance` for each vertex."""
        pairs = (self, self._need_other(other)), (other, self)
        return max((two.distance(vertex) for one, two in pairs for vertex in one.vertices), default=0.0)

    def plot(self, axes: Any, **style: Any) -> None:
        """Fill a set of R^2 on matplotlib axes, with the options of `matplotlib.axes.Axes.fill`."""
        self._of_plane()
        points = self.vertices - self.vertices.mean(axis=0) if len(self.vertices) else self.vertices
        order = np.argsort(np.arctan2(points[:, 1], points[:, 0]))
        axes.fill(*self.vertices[order].T, **style)

    # Operators and old names --------------------------------------------------------------------------------------

    def __and__(self, other: Polytope) -> Polytope:
        return self.intersection(other) if isinstance(other, Polytope) else NotImplemented

    def __add__(self, other: Polytope | ArrayLike) -> Polytope:
        given: Any = other
        return self.minkowski_sum(given) if is_set(given) else self.translate(given)

    __radd__ = __add__

    def __rmatmul__(self, matrix: ArrayLike) -> Polytope:
        return self.affine_map(matrix)

    def __contains__(self, point: ArrayLike) -> bool:
        return bool(self.contains(point))

    def __le__(self, other: Polytope) -> bool:
        return self.is_subset(other) if isinstance(other, Polytope) else NotImplemented


def _bent(reach: Floats, rows: Floats) -> Floats:
    """Return bounds of the rounding of scalar products of points and rows."""
    return np.asarray(reach @ np.abs(rows).T)
