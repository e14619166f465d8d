"""A bounded convex polytope in R^n, in both representations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import ConvexHull

from infoset.polytope._affine_hull import FLAT, frame_of
from infoset.polytope._qhull import hull_of_points, intersection_of_halfspaces, together

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

_TOGETHER = 1e-7


@dataclass(frozen=True)
class Polytope:
    """A convex polytope that is not empty; it may be flat, a segment or a point.

    It is {x: normals x <= offsets, across x = levels}, and the hull of its `vertices`, shape (v, n), without redundant
    points. The f normals of the facets have unit length and are in the directions of the affine hull; the n - dimension
    rows of `across` are orthonormal. Construct it with `from_vertices` or `from_halfspaces`. Coordinates should be of
    similar size: scale them first, because a set that is 1e9 times thinner than it is long counts as flat.
    """

    vertices: Floats
    normals: Floats
    offsets: Floats
    across: Floats
    levels: Floats

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
        return cls(*hull_of_points(array, flat))

    @classmethod
    def from_halfspaces(
        cls,
        normals: ArrayLike,
        offsets: ArrayLike,
        across: ArrayLike | None = None,
        levels: ArrayLike | None = None,
        *,
        bounded: bool = False,
    ) -> Polytope:
        """Return {x: normals x <= offsets, across x = levels}, of shapes (m, n), (m,), (k, n) and (k,).

        A set that is known to be `bounded` saves a linear program. Equations hidden in the half-spaces are found first,
        by linear programs (HiGHS); then Qhull intersects in the affine hull, around the Chebyshev centre.

        Raises
        ------
        ValueError
            If shapes do not fit, or a number is not finite.
        EmptyPolytopeError
            If no point satisfies all; it holds the least relaxation of the half-spaces.
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
        return cls(*intersection_of_halfspaces(rows, limits, flat, heights, bounded=bounded))

    @classmethod
    def box(cls, lower: ArrayLike, upper: ArrayLike) -> Polytope:
        """Return {x: lower <= x <= upper}, flat across the axes along which `lower` and `upper`, shape (n,), are equal.

        Raises
        ------
        ValueError
            If lower exceeds upper somewhere.
        """
        least, most = np.asarray(lower, dtype=float), np.asarray(upper, dtype=float)
        if (least > most).any():
            raise ValueError(
                f"the box is empty: its lower end exceeds the upper one by {float((least - most).max()):g}"
            )
        unit = np.eye(len(least))
        return cls.from_halfspaces(np.vstack([unit, -unit]), np.concatenate([most, -least]), bounded=True)

    @property
    def space(self) -> int:
        """Dimension n of the space."""
        return int(self.vertices.shape[1])

    @property
    def dimension(self) -> int:
        """Dimension of the affine hull."""
        return int(self.space - len(self.across))

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """Least and greatest coordinates, each of shape (n,)."""
        return self.vertices.min(axis=0), self.vertices.max(axis=0)

    def essential_vertices(self) -> int:
        """Return the number of vertices; those within 1e-7 of each other in every coordinate count once."""
        return int(together(self.vertices, _TOGETHER).max()) + 1

    def support(self, directions: ArrayLike) -> Floats:
        """Return the maximum of direction . x over the set, shape (...), for `directions` of shape (..., n)."""
        return np.asarray((np.asarray(directions, dtype=float) @ self.vertices.T).max(axis=-1))

    def support_vector(self, direction: ArrayLike) -> Floats:
        """Return a vertex furthest along a `direction`, both of shape (n,)."""
        return np.asarray(self.vertices[int((self.vertices @ np.asarray(direction, dtype=float)).argmax())])

    def excess(self, points: ArrayLike) -> Floats:
        """Return the greatest distance of `points`, shape (..., n), beyond a facet or from the affine hull.

        It has shape (...), and is at most 0 inside.
        """
        x = np.asarray(points, dtype=float)
        beyond = (x @ self.normals.T - self.offsets).max(axis=-1, initial=-np.inf)
        away = np.abs(x @ self.across.T - self.levels).max(axis=-1, initial=-np.inf)
        return np.asarray(np.maximum(beyond, away))

    def volume(self) -> float:
        """Return the volume within the affine hull, of its dimension; 1 for a point."""
        frame = frame_of(self.vertices)
        scale = float(np.prod(frame.extents))
        if frame.dimension < 2:
            return scale * 2.0 if frame.dimension else 1.0
        return float(ConvexHull(frame.inward(self.vertices)).volume) * scale
