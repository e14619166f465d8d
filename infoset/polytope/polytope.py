"""A bounded convex polytope in R^n, in both representations."""

from __future__ import annotations

import contextlib
import itertools
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import block_diag
from scipy.spatial import ConvexHull, Delaunay
from scipy.spatial.distance import cdist

from infoset.polytope._affine_hull import (
    FLAT,
    EmptyPolytopeError,
    UnboundedPolytopeError,
    UncertainHullError,
    chebyshev_ball,
    frame_of,
)
from infoset.polytope._nearest import nearest_difference
from infoset.polytope._qhull import hull_of_points, intersection_of_halfspaces, together
from infoset.polytope._scaling import scale_of, scale_of_box, scale_of_constraints, stretched, tightened, without_far
from infoset.renamed import renamed

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

_TOGETHER = 1e-7
_FLAT_WIDTH = 1e-12
_EPS = float(np.finfo(np.float64).eps)


@dataclass(frozen=True, eq=False)
class Polytope:
    """A convex polytope; it may be flat, a segment, a point, or empty.

    It is {x: normals x <= offsets, across x = levels}, and the hull of its `vertices`, shape (v, n), without redundant
    points. The f normals of the facets have unit length and are in the directions of the affine hull; the n - dimension
    rows of `across` are orthonormal. Construct it with `from_vertices`, `from_constraints`, `from_box`, `from_ball` or
    `from_zonotope`. Coordinates should be of similar size: a set that is 1e9 times thinner than it is long counts as
    flat.

    An empty set has no vertices; `relaxation` is then the least relaxation of all constraints, their normals of unit
    length, with which a point satisfies them, if it is known. Operations on it give the empty set; points such as its
    centroid do not exist, and an EmptyPolytopeError is raised.

    Operations are exact up to rounding: about 1e-12 of the size of the set, and 1e-9 at most. Their cost is that of a
    convex hull: O(k log k) for k points or half-spaces in up to three dimensions, O(k^(n/2)) at worst in n.

    Operators: `P & Q` (intersection), `P + Q` (Minkowski sum), `P + vector` (translation), `A @ P` (linear map),
    `point in P`, `P <= Q` (subset, to rounding).
    """

    vertices: Floats
    normals: Floats
    offsets: Floats
    across: Floats
    levels: Floats
    relaxation: float = 0.0

    __array_ufunc__ = None

    @classmethod
    def from_vertices(cls, points: ArrayLike, flat: float = FLAT) -> Polytope:
        """Return the convex hull of `points`, shape (k, n), at least one.

        `flat` is the relative thickness below which a set counts as flat: greater for points that are known to fewer
        digits. The affine hull first, then Qhull in coordinates of it in which the set is round, then a check that
        facets and vertices agree. Qhull takes O(k log k) for n to 3, O(k^(n/2)) beyond at worst.

        Raises
        ------
        ValueError
            If there is no point, or one is not finite.
        UncertainHullError
            If rounding decides which points are vertices.
        """
        array = np.asarray(points, dtype=float)
        if array.ndim != 2 or not len(array) or not array.shape[1]:
            raise ValueError("points must have the shape (k, n), with k and n at least 1")
        if not np.isfinite(array).all():
            raise ValueError("points must be finite")
        scale = scale_of(array)
        return cls(
            *hull_of_points(array, flat) if scale is None else stretched(hull_of_points(array / scale, flat), scale)
        )

    @classmethod
    def from_constraints(
        cls,
        normals: ArrayLike,
        offsets: ArrayLike,
        across: ArrayLike | None = None,
        levels: ArrayLike | None = None,
        *,
        bounded: bool = False,
    ) -> Polytope:
        """Return {x: normals x <= offsets, across x = levels}, of shapes (m, n), (m,), (k, n) and (k,); it may be
        empty.

        A set that is known to be `bounded` saves a linear program. Equations hidden in the half-spaces are found first,
        by linear programs (HiGHS); then Qhull intersects in the affine hull, around the Chebyshev centre.

        Raises
        ------
        ValueError
            If shapes do not fit, or a number is not finite.
        UnboundedPolytopeError
            If the set is unbounded; it holds a direction.
        UncertainHullError
            If rounding decides which points are vertices.
        """
        rows, limits = np.asarray(normals, dtype=float), np.asarray(offsets, dtype=float)
        if rows.ndim != 2 or limits.shape != (len(rows),) or not rows.shape[1]:
            raise ValueError("half-spaces must have normals of shape (m, n) and offsets of shape (m,)")
        flat = np.zeros((0, rows.shape[1])) if across is None else np.asarray(across, dtype=float)
        heights = np.zeros(0) if levels is None else np.asarray(levels, dtype=float)
        if flat.ndim != 2 or flat.shape[1] != rows.shape[1] or heights.shape != (len(flat),):
            raise ValueError("equations must have rows of shape (k, n) and levels of shape (k,)")
        if not all(np.isfinite(array).all() for array in (rows, limits, flat, heights)):
            raise ValueError("half-spaces and equations must be finite")
        failure: ValueError | ArithmeticError | None = None
        try:
            polytope = cls(*intersection_of_halfspaces(rows, limits, flat, heights, bounded=bounded))
        except EmptyPolytopeError as error:
            polytope = cls.empty(rows.shape[1], error.relaxation)
        except (UnboundedPolytopeError, UncertainHullError) as error:
            polytope, failure = cls.empty(rows.shape[1]), error
        if polytope.dimension < polytope.space:
            known = scale_of_constraints(rows, limits, flat, heights)
            with contextlib.suppress(EmptyPolytopeError, UncertainHullError):
                if known is not None:
                    scale, lower, upper = known
                    near, ends = without_far(rows * scale, limits, lower / scale, upper / scale)
                    inner = intersection_of_halfspaces(near, ends, flat * scale, heights, bounded=True)
                    return cls(*stretched(inner, scale))
            # The bounds exist, so the set is not emptier than their rounding.
            if known is not None and failure is None and polytope.relaxation > 1e-6 * np.abs(known[1:]).max():
                failure = UncertainHullError(
                    "the half-spaces have common points, but their sizes differ too much for a hull: scale the "
                    "coordinates"
                )
        if failure is not None:
            raise failure
        return polytope

    @classmethod
    def empty(cls, space: int, relaxation: float = 0.0) -> Polytope:
        """Return the empty set of R^n, n = `space`, with the `relaxation` of its constraints if it is known."""
        return cls(
            np.zeros((0, space)), np.zeros((1, space)), -np.ones(1), np.zeros((0, space)), np.zeros(0), relaxation
        )

    @classmethod
    def from_box(cls, lower: ArrayLike, upper: ArrayLike) -> Polytope:
        """Return {x: lower <= x <= upper}, flat across the axes along which `lower` and `upper`, shape (n,), are
        equal. Exact.

        Raises
        ------
        ValueError
            If lower exceeds upper somewhere, or a number is not finite.
        """
        least, most = np.asarray(lower, dtype=float), np.asarray(upper, dtype=float)
        if least.shape != most.shape or least.ndim != 1 or not len(least) or not np.isfinite([least, most]).all():
            raise ValueError("lower and upper must be finite, of the same shape (n,)")
        if (least > most).any():
            raise ValueError(
                f"the box is empty: its lower end exceeds the upper one by {float((least - most).max()):g}"
            )
        unit, wide = np.eye(len(least)), least < most
        corners = list(itertools.product(*(dict.fromkeys(pair) for pair in zip(least, most, strict=True))))
        return cls(
            np.array(corners),
            np.vstack([unit[wide], -unit[wide]]),
            np.concatenate([most[wide], -least[wide]]),
            unit[~wide],
            most[~wide],
        )

    @classmethod
    def from_ball(cls, centre: ArrayLike, radius: float, *, outer: bool = True) -> Polytope:
        """Return a polytope around the ball with `centre`, shape (n,), and `radius`, or in it.

        Its facets, or its vertices if not `outer`, are in the 3^n - 1 directions whose components are in ratios of -1,
        0 and 1: it extends beyond the ball, or stays inside it, by the factor 1.09 in two dimensions, 1.14 in three
        and 1.23 in six at most.

        Raises
        ------
        ValueError
            If the radius is negative or a number is not finite.
        """
        middle = np.asarray(centre, dtype=float)
        if middle.ndim != 1 or not np.isfinite(middle).all() or not 0.0 <= radius < np.inf:
            raise ValueError("centre must be finite, of shape (n,), and radius finite and not negative")
        rows = np.array([row for row in itertools.product((-1.0, 0.0, 1.0), repeat=len(middle)) if any(row)])
        rows /= np.linalg.norm(rows, axis=1)[:, None]
        if not outer or radius == 0.0:
            return cls.from_vertices(middle + radius * rows)
        return cls.from_constraints(rows, np.full(len(rows), radius), bounded=True).translate(middle)

    @classmethod
    def from_zonotope(cls, centre: ArrayLike, generators: ArrayLike) -> Polytope:
        """Return {centre + sum of z_i generators[i]: -1 <= z_i <= 1}; `generators`, shape (g, n), has a row for each.

        One Minkowski sum for each generator: O(g^(n-1)) vertices.

        Raises
        ------
        ValueError
            If shapes do not fit or a number is not finite.
        """
        middle = np.asarray(centre, dtype=float)
        rows = np.asarray(generators, dtype=float)
        rows = rows.reshape(0, *middle.shape) if not rows.size else rows
        if middle.ndim != 1 or rows.ndim != 2 or rows.shape[1] != len(middle):
            raise ValueError(
                f"centre of shape (n,) and generators of shape (g, n) are needed: got {middle.shape} and {rows.shape}"
            )
        zonotope = cls.from_vertices(middle[None, :])
        for row in rows:
            zonotope = cls.from_vertices(np.vstack([zonotope.vertices - row, zonotope.vertices + row]))
        return zonotope

    @property
    def space(self) -> int:
        """Dimension n of the space."""
        return int(self.vertices.shape[1])

    @property
    def dimension(self) -> int:
        """Dimension of the affine hull; -1 for the empty set."""
        return int(self.space - len(self.across)) if len(self.vertices) else -1

    @property
    def is_empty(self) -> bool:
        """Whether the set is empty."""
        return not len(self.vertices)

    def needed(self) -> Polytope:
        """Return the set itself.

        Raises
        ------
        EmptyPolytopeError
            If it is empty; the error has the least relaxation of the constraints.
        """
        if self.is_empty:
            raise EmptyPolytopeError(self.relaxation)
        return self

    def __repr__(self) -> str:
        if self.is_empty:
            return f"<empty polytope in R^{self.space}>"
        return (
            f"<polytope of dimension {self.dimension} in R^{self.space}: "
            f"{len(self.vertices)} vertices, {len(self.normals)} facets>"
        )

    def essential_vertices(self) -> int:
        """Return the number of vertices; those within 1e-7 of each other in every coordinate count once."""
        return int(together(self.vertices, _TOGETHER).max()) + 1

    # Sets -----------------------------------------------------------------------------------------------------------

    def linear_map(self, matrix: ArrayLike) -> Polytope:
        """Return {matrix x}, with a matrix of shape (m, n), singular or not: the hull of the images of the vertices."""
        return self.affine_map(matrix)

    def affine_map(self, matrix: ArrayLike, offset: ArrayLike = 0.0) -> Polytope:
        """Return {matrix x + offset} in R^m, with a matrix of shape (m, n), singular or not, and an offset of shape
        (m,) or 0.

        The hull of the images of the vertices, each rounded n + 1 times.
        """
        rows = np.asarray(matrix, dtype=float)
        if self.is_empty:
            return self.empty(len(rows), self.relaxation)
        return self.from_vertices(self.vertices @ rows.T + np.asarray(offset, dtype=float))

    def translate(self, offset: ArrayLike) -> Polytope:
        """Return the set moved by an offset, shape (n,). O((v + f) n): no hull is needed.

        Raises
        ------
        ValueError
            If the offset is not finite or has another shape.
        """
        by = np.asarray(offset, dtype=float)
        if by.shape != (self.space,) or not np.isfinite(by).all():
            raise ValueError(f"offset must be finite, of shape ({self.space},): got the shape {by.shape}")
        if self.is_empty:
            return self
        offsets, levels = self.offsets + self.normals @ by, self.levels + self.across @ by
        return Polytope(self.vertices + by, self.normals, offsets, self.across, levels)

    def preimage(self, matrix: ArrayLike, offset: ArrayLike = 0.0) -> Polytope:
        """Return {x in R^m: matrix x + offset in the set}, with a matrix of shape (n, m): its facets, mapped.

        Raises
        ------
        UnboundedPolytopeError
            If the preimage is unbounded: the matrix has a null space.
        """
        rows = np.asarray(matrix, dtype=float)
        moved = np.broadcast_to(np.asarray(offset, dtype=float), (self.space,))
        if self.is_empty:
            return self.empty(rows.shape[1], self.relaxation)
        offsets, levels = self.offsets - self.normals @ moved, self.levels - self.across @ moved
        return self.from_constraints(self.normals @ rows, offsets, self.across @ rows, levels)

    def minkowski_sum(self, other: Polytope) -> Polytope:
        """Return {x + y: x in the set, y in the other}, the hull of all v1 v2 sums of two vertices."""
        if self.is_empty or other.is_empty:
            return self if self.is_empty else other
        sums = self.vertices[:, None, :] + other.vertices[None, :, :]
        return self.from_vertices(sums.reshape(-1, self.space))

    def minkowski_difference(self, other: Polytope) -> Polytope:
        """Return the Pontryagin difference {x: x + y in the set for all y in the other}: each facet moves inward.

        Raises
        ------
        ValueError
            If the other set is empty and this one is not: every point would satisfy the condition.
        """
        if self.is_empty:
            return self
        if other.is_empty:
            raise ValueError("the difference with an empty set is unbounded")
        rows = np.vstack([self.normals, self.across, -self.across])
        limits = np.concatenate([self.offsets, self.levels, -self.levels]) - other.support_function(rows)
        most, least = np.split(limits[len(self.normals) :], 2)
        size = max(float(np.abs(one.vertices).max()) for one in (self, other))
        if (most + least < -_FLAT_WIDTH * size).any():
            return self.empty(self.space, -0.5 * float((most + least).min()))
        return self.from_constraints(
            self.normals, limits[: len(self.normals)], self.across, 0.5 * (most - least), bounded=True
        )

    def intersection(self, *others: Polytope) -> Polytope:
        """Return the intersection with one or more polytopes, from the facets of all."""
        sets = (self, *others)
        for one in sets:
            if one.is_empty:
                return one
        boxes = [one.bounding_box() for one in sets]
        return self._in_box(
            np.vstack([one.normals for one in sets]),
            np.concatenate([one.offsets for one in sets]),
            np.vstack([one.across for one in sets]),
            np.concatenate([one.levels for one in sets]),
            np.max([lower for lower, _ in boxes], axis=0),
            np.min([upper for _, upper in boxes], axis=0),
        )

    @classmethod
    def _in_box(
        cls, rows: Floats, limits: Floats, across: Floats, levels: Floats, lower: Floats, upper: Floats
    ) -> Polytope:
        """Return {x: rows x <= limits, across x = levels}, which is known to lie between `lower` and `upper`."""
        scale = None if (lower > upper).any() else scale_of_box(lower, upper)
        if scale is None:
            return cls.from_constraints(*without_far(rows, limits, lower, upper), across, levels, bounded=True)
        rows, limits = without_far(rows * scale, limits, lower / scale, upper / scale)
        inner = cls.from_constraints(rows, limits, across * scale, levels, bounded=True)
        if inner.is_empty:
            return cls.empty(len(lower))
        return cls(*stretched((inner.vertices, inner.normals, inner.offsets, inner.across, inner.levels), scale))

    def convex_hull(self, *others: Polytope) -> Polytope:
        """Return the convex hull of the union with one or more polytopes."""
        points = np.vstack([self.vertices, *(one.vertices for one in others)])
        return self.from_vertices(points) if len(points) else self

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

        Parameters
        ----------
        normals : array_like, shape (n,) or (m, n)
            Normals of the strips, of any length.
        lower, upper : array_like, shape () or (m,)
            Bounds; infinite ones give half-spaces.
        slack_ulp : float
            Each strip is wider on both sides by this number of ulp of the products in normals x: a point that
            satisfies the bounds up to rounding is not lost.

        Raises
        ------
        ValueError
            If a normal is not finite or of another length, or a bound is NaN.
        """
        rows = np.atleast_2d(np.asarray(normals, dtype=float))
        least, most = np.broadcast_to(lower, len(rows)), np.broadcast_to(upper, len(rows))
        if rows.shape[1:] != (self.space,) or not np.isfinite(rows).all() or np.isnan([least, most]).any():
            raise ValueError(
                f"normals must be finite, of shape ({self.space},) or (m, {self.space}), and bounds not NaN"
            )
        if self.is_empty:
            return self
        wider = slack_ulp * _EPS * (np.abs(rows) @ np.abs(self.vertices).max(axis=0))
        rows, limits = np.vstack([rows, -rows]), np.concatenate([most + wider, wider - least])
        cuts = self.support_function(rows) > limits
        if not cuts.any():
            return self
        if np.isneginf(limits).any() or (least > most).any():
            return self.empty(self.space, 0.5 * float(np.max(least - most)))
        return self._in_box(
            np.vstack([self.normals, rows[cuts]]),
            np.concatenate([self.offsets, limits[cuts]]),
            self.across,
            self.levels,
            *tightened(rows[cuts], limits[cuts], *self.bounding_box()),
        )

    def project(self, axes: Sequence[int]) -> Polytope:
        """Return the projection on some `axes`, in a space of as many dimensions."""
        return self.affine_map(np.eye(self.space)[list(axes)])

    def slice(self, axes: Sequence[int], values: ArrayLike) -> Polytope:
        """Return the set of the other coordinates where the coordinates `axes` have some `values`.

        Raises
        ------
        ValueError
            If an axis does not exist, or none is left.
        """
        if not set(axes) < set(range(self.space)):
            raise ValueError(f"axes must be some of the numbers from 0 to {self.space - 1}, not all: got {list(axes)}")
        rest = [axis for axis in range(self.space) if axis not in axes]
        if self.is_empty:
            return self.empty(len(rest), self.relaxation)
        fixed = np.broadcast_to(np.asarray(values, dtype=float), (len(axes),))
        return self.from_constraints(
            self.normals[:, rest],
            self.offsets - self.normals[:, list(axes)] @ fixed,
            self.across[:, rest],
            self.levels - self.across[:, list(axes)] @ fixed,
            bounded=True,
        )

    def reduce_outward(self, cap: int) -> Polytope:
        """Return a polytope with at most `cap` (>= 2n) facets that contains the set.

        It starts with the bounding box. Then it is cut by the facet of the set beyond which a vertex is farthest,
        until it has `cap` facets: one intersection for each.

        Raises
        ------
        ValueError
            If `cap` is less than 2n.
        """
        if cap < 2 * self.space:
            raise ValueError(f"cap must be at least {2 * self.space}: got {cap}")
        if self.is_empty or len(self.normals) <= cap:
            return self
        outer = self.from_box(*self.bounding_box())
        rows = np.vstack([self.normals, self.across, -self.across])
        limits = np.concatenate([self.offsets, self.levels, -self.levels])
        for _ in range(cap):
            beyond = outer.support_function(rows) - limits
            worst = int(beyond.argmax())
            tighter = outer.cut(rows[worst], upper=limits[worst])
            if beyond[worst] <= 0.0 or len(tighter.normals) + 2 * len(tighter.across) > cap:
                break
            outer = tighter
        return outer

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
        return np.asarray((np.asarray(directions, dtype=float) @ self.vertices.T).max(axis=-1, initial=-np.inf))

    def support_vector(self, direction: ArrayLike) -> Floats:
        """Return a vertex farthest along a `direction`, both of shape (n,). O(v n)."""
        heights = self.needed().vertices @ np.asarray(direction, dtype=float)
        return np.asarray(self.vertices[int(heights.argmax())])

    @cached_property
    def _misfits(self) -> tuple[Floats, Floats]:
        """Distances of the vertices beyond the facets and from the affine hull: rounding of this representation."""
        x = self.vertices
        beyond = (x @ self.normals.T - self.offsets).max(axis=0, initial=0.0)
        away = np.abs(x @ self.across.T - self.levels).max(axis=0, initial=0.0)
        return beyond, away

    @cached_property
    def _stretch(self) -> Floats | None:
        """Scales of the axes of a set with an interior if they differ much, shape (n,)."""
        return scale_of(self.vertices) if self.dimension == self.space else None

    def excess(self, points: ArrayLike) -> Floats:
        """Return the greatest distance of `points`, shape (..., n), beyond a facet or from the affine hull.

        It has shape (...), and is at most 0 inside, also for the vertices: the rounding of a scalar product, and of the
        representation (distances of vertices beyond facets), is subtracted. Infinite for the empty set.
        """
        x = np.asarray(points, dtype=float)
        if self.is_empty:
            return np.full(x.shape[:-1], np.inf)
        reach = (self.space + 2) * _EPS * np.maximum(np.abs(x), np.abs(self.vertices).max(axis=0))
        over, apart = self._misfits
        beyond = x @ self.normals.T - self.offsets - over - _bent(reach, self.normals)
        away = np.abs(x @ self.across.T - self.levels) - apart - _bent(reach, self.across)
        return np.asarray(np.maximum(beyond.max(axis=-1, initial=-np.inf), away.max(axis=-1, initial=-np.inf)))

    def margin(self, points: ArrayLike) -> Floats:
        """Return the distances of `points`, shape (..., n), from the nearest facet, positive inside: -`excess`."""
        return -self.excess(points)

    def contains(self, points: ArrayLike, tolerance: float = 0.0) -> Flags:
        """Return whether `points`, shape (..., n), are in the set, to rounding, or within a `tolerance` of its facets.

        O(f n).
        """
        return np.asarray(self.excess(points) <= tolerance)

    def is_subset(self, other: Polytope, tolerance: float = 0.0) -> bool:
        """Return whether all vertices are in the other set, to rounding, or within a `tolerance` of its facets.

        O(v f n).
        """
        return bool(other.contains(self.vertices, tolerance).all())

    def equals(self, other: Polytope, tolerance: float = 0.0) -> bool:
        """Return whether each set is a subset of the other one, with the tolerance of `is_subset`."""
        return self.is_subset(other, tolerance) and other.is_subset(self, tolerance)

    def bounding_box(self) -> tuple[Floats, Floats]:
        """Return the least and the greatest coordinates of the vertices, each of shape (n,). O(v n), exact."""
        return self.needed().vertices.min(axis=0), self.vertices.max(axis=0)

    def volume(self) -> float:
        """Return the volume within the affine hull, of its dimension; 1 for a point, 0 for the empty set."""
        if self.is_empty:
            return 0.0
        stretch = self._stretch
        if stretch is not None:
            return float(np.prod(stretch)) * Polytope.from_vertices(self.vertices / stretch).volume()
        frame = frame_of(self.vertices)
        scale = float(np.prod(frame.extents))
        if frame.dimension < 2:
            return scale * 2.0 if frame.dimension else 1.0
        return float(ConvexHull(frame.inward(self.vertices)).volume) * scale

    def _simplices(self) -> tuple[Floats, Floats]:
        """Return simplices that divide the set, shape (k, d + 1, n), and their shares of the volume, shape (k,)."""
        frame = frame_of(self.needed().vertices / (1.0 if self._stretch is None else self._stretch))
        if len(self.vertices) == frame.dimension + 1:
            return self.vertices[None], np.ones(1)
        inner = frame.inward(self.vertices / (1.0 if self._stretch is None else self._stretch))
        corners = Delaunay(inner, qhull_options="QJ").simplices
        sizes = np.abs(np.linalg.det(inner[corners[:, 1:]] - inner[corners[:, :1]]))
        return self.vertices[corners], sizes / sizes.sum()

    def centroid(self) -> Floats:
        """Return the centroid within the affine hull, shape (n,), from a division into simplices."""
        simplices, shares = self._simplices()
        return np.asarray(shares @ simplices.mean(axis=1))

    def sample(self, count: int, seed: int | np.random.Generator = 0) -> Floats:
        """Return points distributed uniformly over the set, shape (count, n), from a division into simplices."""
        random = np.random.default_rng(seed)
        simplices, shares = self._simplices()
        weights = random.dirichlet(np.ones(simplices.shape[1]), count)
        return np.asarray(np.einsum("ij,ijk->ik", weights, simplices[random.choice(len(shares), count, p=shares)]))

    def chebyshev_centre(self) -> tuple[Floats, float]:
        """Return the centre, shape (n,), and the radius of a largest ball in the set, within its affine hull.

        A linear program (HiGHS) in coordinates about the centre of the vertices.
        """
        if self._stretch is not None:  # in units of the axes, and of the shortest axis for the radius
            least = float(self._stretch.min())
            middle, rows = self.vertices.mean(axis=0), self.normals * self._stretch
            sizes = np.abs(rows).max(axis=1)
            limits = (self.offsets - self.normals @ middle) / sizes
            inner, radius = chebyshev_ball(rows / sizes[:, None], limits, least / sizes)
            return middle + self._stretch * inner, least * max(0.0, radius)
        frame = frame_of(self.needed().vertices)
        if not frame.dimension:
            return frame.centre, 0.0
        scale = float(frame.extents.max())
        rows = self.normals @ frame.basis
        sizes = np.linalg.norm(rows, axis=1)
        limits = (self.offsets - self.normals @ frame.centre) / (scale * sizes)
        centre, radius = chebyshev_ball(rows / sizes[:, None], limits)
        return frame.centre + scale * frame.basis @ centre, scale * max(0.0, radius)

    def diameter(self) -> float:
        """Return the greatest distance between two vertices; 0 for the empty set. O(v^2 n)."""
        return float(cdist(self.vertices, self.vertices).max(initial=0.0))

    def closest_point(self, point: ArrayLike) -> Floats:
        """Return the point of the set nearest to a `point`, both of shape (n,), within 1e-12 of the size of the set.

        Wolfe's algorithm: a least-squares problem of at most n + 1 points in each of a few steps.
        """
        x = np.asarray(point, dtype=float)
        return np.asarray(x + nearest_difference(self.needed().vertices, x[None, :])) if x not in self else x

    def distance(self, other: Polytope | ArrayLike) -> float:
        """Return the distance from `other`, a polytope or a point, shape (n,); inf if a set is empty.

        As `closest_point`.
        """
        points = other.vertices if isinstance(other, Polytope) else np.atleast_2d(np.asarray(other, dtype=float))
        if self.is_empty or not len(points):
            return float("inf")
        return float(np.linalg.norm(nearest_difference(self.vertices, points)))

    def hausdorff_distance(self, other: Polytope) -> float:
        """Return the Hausdorff distance; inf between an empty and a nonempty set. One `distance` for each vertex."""
        pairs = (self, other), (other, self)
        return max((two.distance(vertex) for one, two in pairs for vertex in one.vertices), default=0.0)

    def plot(self, axes: Any, **style: Any) -> None:
        """Fill a set of R^2 on matplotlib axes, with the options of `matplotlib.axes.Axes.fill`.

        Raises
        ------
        ValueError
            If the space does not have two dimensions: `project` the set first.
        """
        if self.space != 2:
            raise ValueError(f"a set of R^2 is needed: project this one, of R^{self.space}, on two axes first")
        points = self.vertices - self.vertices.mean(axis=0) if len(self.vertices) else self.vertices
        order = np.argsort(np.arctan2(points[:, 1], points[:, 0]))
        axes.fill(*self.vertices[order].T, **style)

    # Operators and old names --------------------------------------------------------------------------------------

    def __and__(self, other: Polytope) -> Polytope:
        return self.intersection(other) if isinstance(other, Polytope) else NotImplemented

    def __add__(self, other: Polytope | ArrayLike) -> Polytope:
        return self.minkowski_sum(other) if isinstance(other, Polytope) else self.translate(other)

    __radd__ = __add__

    def __rmatmul__(self, matrix: ArrayLike) -> Polytope:
        return self.affine_map(matrix)

    def __contains__(self, point: ArrayLike) -> bool:
        return bool(self.contains(point))

    def __le__(self, other: Polytope) -> bool:
        return self.is_subset(other) if isinstance(other, Polytope) else NotImplemented

    support = renamed("support", "support_function")

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """Return `bounding_box()`. Deprecated."""
        warnings.warn("bounds is deprecated and will be removed: use bounding_box", DeprecationWarning, stacklevel=2)
        return self.bounding_box()

    @classmethod
    def box(cls, lower: ArrayLike, upper: ArrayLike) -> Polytope:
        """Return `from_box(lower, upper)`. Deprecated."""
        warnings.warn("box is deprecated and will be removed: use from_box", DeprecationWarning, stacklevel=2)
        return cls.from_box(lower, upper)

    @classmethod
    def from_halfspaces(cls, *arguments: Any, **options: Any) -> Polytope:
        """Return `from_constraints(...).needed()`: an empty set raises an EmptyPolytopeError. Deprecated."""
        warnings.warn(
            "from_halfspaces is deprecated and will be removed: use from_constraints", DeprecationWarning, stacklevel=2
        )
        return cls.from_constraints(*arguments, **options).needed()


def _bent(reach: Floats, rows: Floats) -> Floats:
    """Return bounds of the rounding of scalar products of points and rows."""
    return np.asarray(reach @ np.abs(rows).T)


def product(*polytopes: Polytope) -> Polytope:
    """Return the Cartesian product of `polytopes`, at least one, with v1 v2 ... vertices and f1 + f2 + ... facets."""
    vertices = polytopes[0].vertices
    for factor in polytopes[1:]:
        left = np.repeat(vertices, len(factor.vertices), axis=0)
        vertices = np.hstack([left, np.tile(factor.vertices, (len(vertices), 1))])
    return Polytope(
        vertices,
        block_diag(*[factor.normals for factor in polytopes]),
        np.concatenate([factor.offsets for factor in polytopes]),
        block_diag(*[factor.across for factor in polytopes]),
        np.concatenate([factor.levels for factor in polytopes]),
    )
